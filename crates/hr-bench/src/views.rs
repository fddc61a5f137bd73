//! What the accuracy is measured on: views of scenes with their reference images.

use crate::compare::luminance;
use crate::run::{camera, say};
use crate::{BenchError, float_image, run::Out};
use hr_scene::{Camera, Image, Scene, ToneMap, builtin};
use hr_view::path_tracer::{self, PathTracer};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Pixels more than this share of whose light comes straight from an emitter say nothing about a solution.
const MOST_EMITTED: f64 = 0.5;

/// A scene and the views of it.
#[derive(Debug)]
pub struct Subject {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Its views.
    pub views: Vec<View>,
}

/// A camera, and the right image.
#[derive(Debug)]
pub struct View {
    /// Its name.
    pub name: String,
    /// Where it is taken from.
    pub camera: Camera,
    /// The right image.
    pub reference: Image,
    /// Its standard error, where that is known.
    pub sigma: Option<Image>,
    /// Pixels to look at: those that do not just see an emitter.
    pub keep: Vec<bool>,
}

/// How a scene's own references are made.
#[derive(Clone, Debug)]
pub struct Making<'a> {
    /// Folder where they are kept.
    pub folder: &'a Path,
    /// Paths per pixel.
    pub spp: u32,
    /// Width in pixels.
    pub width: u32,
}

/// The list of a folder of references.
#[derive(Debug, Deserialize)]
struct List {
    views: BTreeMap<String, Entry>,
}

#[derive(Debug, Deserialize)]
struct Entry {
    scene: String,
    camera: CameraOrName,
    below: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum CameraOrName {
    Name(String),
    Camera(Camera),
}

/// All cameras of a scene (one made for it, if it has none), with references by the path tracer; those that are in the
/// folder already are taken from there.
///
/// # Errors
/// Where the scene makes no sense or files cannot be read or written.
pub fn path_traced(scene: Arc<Scene>, making: &Making<'_>, out: Out<'_>) -> Result<Subject, BenchError> {
    let visibility = path_tracer::visibility(&scene)?;
    let tracer = PathTracer::new(&scene, &visibility);
    let mut cameras = scene.cameras.clone();
    if cameras.is_empty() {
        cameras.push(("default".into(), scene.default_camera()));
    }
    std::fs::create_dir_all(making.folder)
        .map_err(|source| BenchError::Read { path: making.folder.to_owned(), source })?;
    let mut views = Vec::new();
    for (name, camera) in cameras {
        let height = f64::from(camera.height) * f64::from(making.width) / f64::from(camera.width);
        let camera = Camera { width: making.width, height: (height.round() as u32).max(1), ..camera };
        let file = |kind: &str| {
            let scene_name = Path::new(&scene.name).file_stem().unwrap_or_default().to_string_lossy();
            let key = fingerprint(&scene, &camera, making.spp);
            making.folder.join(format!("{scene_name}-{name}-{key:016x}{kind}.pfm"))
        };
        let (path, sigma_path) = (file(""), file("-sigma"));
        if !(path.exists() && sigma_path.exists()) {
            say(out, &format!("path tracing {} {name}: {} paths per pixel", scene.name, making.spp))?;
            let made = tracer.render(&camera, making.spp, 0, &|_| ());
            made.image.save(&path, &ToneMap::default(), scene.primaries)?;
            made.sigma.save(&sigma_path, &ToneMap::default(), scene.primaries)?;
        }
        let (reference, sigma) = (float_image::read(&path)?, float_image::read(&sigma_path)?);
        let emission = tracer.emission(&camera).pixels;
        let keep = reference.pixels.iter().zip(emission);
        let keep = keep.map(|(&p, e)| luminance(e) <= MOST_EMITTED * luminance(p)).collect();
        views.push(View { name, camera, reference, sigma: Some(sigma), keep });
    }
    Ok(Subject { scene, views })
}

/// Changes with everything that a reference depends on.
fn fingerprint(scene: &Scene, camera: &Camera, spp: u32) -> u64 {
    let mut hasher = DefaultHasher::new();
    let parts = (&scene.surfaces, &scene.materials, &scene.lights, &scene.attributes);
    format!("{parts:?} {camera:?} {spp}").hash(&mut hasher);
    hasher.finish()
}

/// The views of a folder of references: `references.json` is `{"views": {NAME: {"scene": ..., "camera": ..., "below":
/// L}}}`, where a camera is one of the scene's names or a camera file's contents, and pixels whose reference luminance
/// is `below` or more are left out. The images are `views/NAME.npy` and, if it is there, `views/NAME_sigma.npy`. A scene
/// is a file beside the folder or in it, or by its name without extension a built-in one. Views of scenes that cannot
/// be loaded, and those that `wanted` does not want, are left out.
///
/// # Errors
/// Where the list or an image cannot be read.
pub fn listed(folder: &Path, wanted: impl Fn(&str) -> bool, out: Out<'_>) -> Result<Vec<Subject>, BenchError> {
    let path = folder.join("references.json");
    let text = std::fs::read(&path).map_err(|source| BenchError::Read { path: path.clone(), source })?;
    let list: List = serde_json::from_slice(&text).map_err(|error| BenchError::Format {
        path,
        what: error.to_string(),
        mend: r#"it is {"views": {NAME: {"scene": FILE, "camera": CAMERA, "below": L}}}"#,
    })?;
    let mut by_scene: BTreeMap<String, Vec<(String, Entry)>> = BTreeMap::new();
    for (name, entry) in list.views {
        by_scene.entry(entry.scene.clone()).or_default().push((name, entry));
    }
    let mut subjects = Vec::new();
    for (file, entries) in by_scene {
        let name = scene_name(folder, &file);
        if !wanted(&name) {
            continue;
        }
        let scene = match Scene::load(&name) {
            Ok(scene) => Arc::new(scene),
            Err(error) => {
                say(out, &format!("left out {file}: {error}"))?;
                continue;
            }
        };
        let mut views = Vec::new();
        for (name, entry) in entries {
            let camera = match entry.camera {
                CameraOrName::Name(name) => camera(&scene, Some(&name))?,
                CameraOrName::Camera(camera) => camera,
            };
            camera.check(&name)?;
            let image = |kind: &str| folder.join("views").join(format!("{name}{kind}.npy"));
            let reference = float_image::read(&image(""))?;
            let sigma = Some(image("_sigma")).filter(|path| path.exists());
            let sigma = sigma.map(|path| float_image::read(&path)).transpose()?;
            let below = entry.below.unwrap_or(f64::INFINITY);
            let keep = reference.pixels.iter().map(|&p| luminance(p) < below).collect();
            views.push(View { name, camera, reference, sigma, keep });
        }
        subjects.push(Subject { scene, views });
    }
    Ok(subjects)
}

/// The built-in scene of that name, underscores for hyphens, or the file's path.
fn scene_name(folder: &Path, file: &str) -> String {
    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy().replace('_', "-");
    if builtin::NAMES.contains(&stem.as_str()) {
        return stem;
    }
    let beside: PathBuf = folder.parent().unwrap_or(Path::new("")).join(file);
    let path = if beside.exists() { beside } else { folder.join(file) };
    path.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn lists_are_read() {
        let folder = std::env::temp_dir().join(format!("hr-bench-views-{}", std::process::id()));
        fs::create_dir_all(folder.join("views")).expect("a folder");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (8, 8, 3), }";
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend((0..192).flat_map(|i| (i as f32).to_le_bytes()));
        fs::write(folder.join("views/a.npy"), &bytes).expect("written");
        fs::write(folder.join("views/b.npy"), &bytes).expect("written");
        let list = r#"{"views": {
            "a": {"scene": "x/glossy_sphere.json", "camera": "low", "below": 100},
            "b": {"scene": "x/glossy_sphere.json", "camera":
                  {"eye":[0,-3,1.5],"target":[0,0,1],"up":[0,0,1],"fov_x":60,"width":8,"height":8}},
            "c": {"scene": "no-such.mgf", "camera": "low"},
            "d": {"scene": "cornell.json", "camera": "high"}}}"#;
        fs::write(folder.join("references.json"), list).expect("written");
        let mut said = Vec::new();
        let found = listed(&folder, |name| name != "cornell", &mut said);
        fs::remove_dir_all(&folder).expect("it was there");
        let found = found.expect("a list");
        let [subject] = &found[..] else { panic!("one scene that is there and wanted: {found:?}") };
        assert_eq!(subject.scene.name, "glossy-sphere", "the built-in scene");
        let [a, b] = &subject.views[..] else { panic!("two views") };
        assert_eq!(a.camera, subject.scene.cameras[1].1, "a camera by name");
        assert_eq!(b.camera.eye, [0.0, -3.0, 1.5], "a camera in the list");
        assert_eq!((b.keep.iter().filter(|&&k| k).count(), a.keep.iter().filter(|&&k| k).count()), (64, 34), "below");
        let said = String::from_utf8(said).expect("text");
        assert!(said.contains("no-such.mgf"), "what is left out is said: {said}");
    }
}

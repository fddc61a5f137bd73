//! A loaded scene: surfaces for the light transport, materials and textures for the eye, cameras, warnings.

use crate::texture::{SurfaceAttributes, Texture};
use crate::{Camera, SceneError, builtin, gltf_file, mgf, obj_file};
use glam::Vec2;
use glossy_ext::{Reflector, Rgb};
use hr_diffuse::{DiffuseMaterial, Light, SceneInput, Surface, SurfaceReflectance};
use std::path::Path;
use std::sync::Arc;

/// The RGB primaries of a scene's colours; both have a white that keeps grey at (1, 1, 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Primaries {
    /// R (.640,.330) G (.290,.600) B (.150,.060), equal-energy white: those of MGF files here.
    #[default]
    Radiance,
    /// Rec. 709 with its D65 white: those of glTF, and of sRGB screens.
    Rec709,
}

/// A material as the scene file gave it.
#[derive(Clone, Debug)]
pub struct Material {
    /// Its name in the file.
    pub name: String,
    /// How it reflects (already scaled so that no channel reflects more than arrives, where a file exceeds that).
    pub reflector: Arc<dyn Reflector>,
    /// Exitance of the front in W/m²; radiance = exitance/π.
    pub exitance: Rgb,
    /// Whether the back reflects like the front; else it absorbs.
    pub two_sided: bool,
    /// Base colour texture and the factor that multiplies it.
    pub texture: Option<Texture>,
    /// Linear base colour factor that textures and vertex colours multiply; not looked at where neither is there.
    pub base_color: Rgb,
}

/// Something that was mended or left out while loading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// What and why, in one line.
    pub text: String,
    /// Where it came first: file and line, or JSON path.
    pub first: String,
    /// How often.
    pub count: u32,
}

/// So many names of materials are told where there is none of a name.
const MOST_NAMES: usize = 12;

/// A scene, ready for the solver and for the eye.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// File name or built-in name.
    pub name: String,
    /// Surfaces, in metres unless the file says otherwise.
    pub surfaces: Vec<Surface>,
    /// Attributes of the surfaces that have any, sorted by surface.
    pub attributes: Vec<SurfaceAttributes>,
    /// Materials that surfaces refer to.
    pub materials: Vec<Material>,
    /// Lights without extent.
    pub lights: Vec<Light>,
    /// Named cameras.
    pub cameras: Vec<(String, Camera)>,
    /// What the RGB numbers mean.
    pub primaries: Primaries,
    /// What was mended or left out.
    pub warnings: Vec<Warning>,
}

impl Scene {
    /// Loads a scene file by its extension (`.mgf`, `.gltf`, `.glb`, `.obj`, in capitals or not), or makes the
    /// [built-in scene](builtin) of that name, and [finishes](Self::finish) it.
    ///
    /// # Errors
    /// [`SceneError::Unknown`] for a name that is neither; else what the reader of the file or
    /// [`finish`](Self::finish) says.
    pub fn load(name_or_path: &str) -> Result<Self, SceneError> {
        let path = Path::new(name_or_path);
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let scene = match extension.as_str() {
            "mgf" => mgf::load(path)?,
            "gltf" | "glb" => gltf_file::load(path)?,
            "obj" => obj_file::load(path)?,
            _ => builtin::scene(name_or_path).ok_or_else(|| SceneError::Unknown {
                name: name_or_path.to_owned(),
                known: builtin::NAMES.join(", "),
            })?,
        };
        scene.finish()
    }

    /// The camera that a command line asks for: the scene's one of this name, or that in a [file](Camera::is_file).
    ///
    /// # Errors
    /// [`SceneError::NoCamera`] where it is neither, those of [`Camera::load`] where the file is no camera.
    pub fn camera_named(&self, name: &str) -> Result<Camera, SceneError> {
        if let Some((_, camera)) = self.cameras.iter().find(|(known, _)| known == name) {
            return Ok(*camera);
        }
        if Camera::is_file(Path::new(name)) {
            return Camera::load(Path::new(name));
        }
        let known: Vec<&str> = self.cameras.iter().map(|(known, _)| known.as_str()).collect();
        let known = if known.is_empty() { "none".to_owned() } else { listed(known) };
        Err(SceneError::NoCamera { name: name.to_owned(), scene: self.name.clone(), known })
    }

    /// Leaves out the surfaces of all materials of this name, as if they were not there: the panes of windows, for light to come in, or what
    /// only stands for something that is cut out of it.
    ///
    /// # Errors
    /// [`SceneError::NoMaterial`] where no surface has such a material, [`SceneError::Empty`] where no other is left.
    pub fn leave_out(&mut self, material: &str) -> Result<(), SceneError> {
        let stays: Vec<bool> =
            self.surfaces.iter().map(|s| self.materials[s.material as usize].name != material).collect();
        if stays.iter().all(|stays| *stays) {
            let mut known: Vec<&str> =
                self.surfaces.iter().map(|s| self.materials[s.material as usize].name.as_str()).collect();
            known.sort_unstable();
            known.dedup();
            return Err(SceneError::NoMaterial { name: material.to_owned(), known: listed(known) });
        }
        if stays.iter().all(|stays| !*stays) {
            return Err(SceneError::empty(format!("{} without '{material}'", self.name), &self.warnings));
        }
        self.keep_surfaces(&stays);
        Ok(())
    }

    /// Leaves out all surfaces but those that stay; attributes follow theirs.
    pub(crate) fn keep_surfaces(&mut self, stays: &[bool]) {
        let mut count = 0;
        let indices: Vec<Option<u32>> = stays
            .iter()
            .map(|stays| {
                count += u32::from(*stays);
                stays.then(|| count - 1)
            })
            .collect();
        let mut stays = stays.iter();
        self.surfaces.retain(|_| stays.next() == Some(&true));
        self.attributes.retain_mut(|attributes| {
            let index = indices[attributes.surface as usize];
            attributes.surface = index.unwrap_or_default();
            index.is_some()
        });
    }

    /// Whether no surface and no light emits anything: all of it is black.
    #[must_use]
    pub fn is_dark(&self) -> bool {
        let shines = |material: u32| self.materials[material as usize].exitance != Rgb::ZERO;
        self.lights.iter().all(|light| light.intensity == Rgb::ZERO)
            && !self.surfaces.iter().any(|s| shines(s.material))
    }

    /// What the diffuse engine needs of this scene: its surfaces and lights, of each material the Lambertian share,
    /// and where base colours vary over surfaces their mean over any part of one.
    #[must_use]
    pub fn input(self: &Arc<Self>) -> SceneInput {
        let diffuse = |m: &Material| DiffuseMaterial {
            reflectance: m.reflector.diffuse(),
            exitance: m.exitance,
            two_sided: m.two_sided,
        };
        SceneInput {
            surfaces: self.surfaces.clone(),
            materials: self.materials.iter().map(diffuse).collect(),
            lights: self.lights.clone(),
            texture: (!self.attributes.is_empty()).then(|| Arc::clone(self) as Arc<dyn SurfaceReflectance>),
        }
    }

    /// The reflectors of all materials, in order.
    #[must_use]
    pub fn reflectors(&self) -> Vec<Arc<dyn Reflector>> {
        self.materials.iter().map(|m| Arc::clone(&m.reflector)).collect()
    }

    /// Lambertian share of a surface's reflector with another base colour.
    #[must_use]
    pub fn diffuse_of(&self, surface: u32, base_color: Rgb) -> Rgb {
        let reflector = &self.materials[self.surfaces[surface as usize].material as usize].reflector;
        reflector.with_base_color(base_color).map_or_else(|| reflector.diffuse(), |r| r.diffuse())
    }
}

/// Names in quotes, and how many more there are than one reads.
fn listed(mut names: Vec<&str>) -> String {
    let more = names.len().saturating_sub(MOST_NAMES);
    names.truncate(MOST_NAMES);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("'{}'{more}", names.join("', '"))
}

impl SurfaceReflectance for Scene {
    fn mean(&self, surface: u32, corners: &[Vec2]) -> Option<Rgb> {
        self.mean_base_color(surface, corners).map(|color| self.diffuse_of(surface, color))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_not_there() {
        let mut scene = Scene::load("cornell").expect("built in");
        let before = scene.surfaces.clone();
        let name = |scene: &Scene, index: usize| scene.materials[before[index].material as usize].name.clone();
        let gone = name(&scene, 0);
        scene.attributes = (0..before.len() as u32)
            .map(|surface| SurfaceAttributes { surface, uv: [Vec2::splat(surface as f32); 4], color: [Rgb::ONE; 4] })
            .collect();
        let stays: Vec<usize> = (0..before.len()).filter(|&index| name(&scene, index) != gone).collect();
        assert!(!stays.is_empty() && stays.len() < before.len(), "some are left out: {gone}");
        scene.leave_out(&gone).expect("there are others");
        assert_eq!(scene.surfaces, stays.iter().map(|&index| before[index].clone()).collect::<Vec<_>>());
        for (surface, (attributes, was)) in scene.attributes.iter().zip(stays).enumerate() {
            assert_eq!((attributes.surface as usize, attributes.uv[0].x), (surface, was as f32), "attributes go along");
        }
        let error = scene.leave_out(&gone).expect_err("it is gone").to_string();
        assert!(
            error.contains(&gone) && error.contains(&scene.materials[scene.surfaces[0].material as usize].name),
            "{error}"
        );
    }

    #[test]
    fn cameras_have_names_or_are_in_files() {
        let mut scene = Scene::load("room").expect("built in");
        let (name, camera) = scene.cameras[1].clone();
        assert_eq!(scene.camera_named(&name).expect("a name"), camera, "{name}");
        let folder = crate::testing::Folder::new("cameras");
        // A name that ends in something is a file where there is one.
        for name in ["camera.JSON", "camera.001"] {
            let path = folder.path(name);
            let text = serde_json::to_string(&camera).expect("plain numbers");
            std::fs::write(&path, text).expect("a file");
            assert_eq!(scene.camera_named(&path.display().to_string()).expect("a file"), camera, "{name}");
        }
        scene.cameras[1].0 = "Camera.001".into();
        assert_eq!(scene.camera_named("Camera.001").expect("names have dots, too"), camera);
        let missing = scene.camera_named("missing.json").expect_err("no file");
        assert!(matches!(missing, SceneError::Io { .. }), "{missing}");
        let unknown = scene.camera_named("Camera.002").expect_err("no name");
        assert!(matches!(unknown, SceneError::NoCamera { .. }), "{unknown}");
        let text = unknown.to_string();
        assert!(["'Camera.002'", "room", "'main', 'Camera.001'"].iter().all(|part| text.contains(part)), "{text}");
        scene.cameras.clear();
        let none = scene.camera_named("main").expect_err("there are none").to_string();
        assert!(none.contains("has none") && none.contains(".json"), "{none}");
    }

    #[test]
    fn something_stays() {
        let mut scene = Scene::load("cornell").expect("built in");
        scene.materials.iter_mut().for_each(|material| material.name = "all".into());
        let count = scene.surfaces.len();
        let error = scene.leave_out("all").expect_err("nothing would be left");
        assert!(matches!(error, SceneError::Empty { .. }) && error.to_string().contains("without 'all'"), "{error}");
        assert_eq!(scene.surfaces.len(), count, "nothing is lost");
    }

    #[test]
    fn unknown_names_list_the_known_ones() {
        for name in ["", "rooom", "scene.blend", "no/such/folder", "room.png"] {
            let error = Scene::load(name).expect_err("unknown");
            assert!(matches!(error, SceneError::Unknown { .. }), "{name}: {error}");
            let text = error.to_string();
            assert!(text.contains(&format!("'{name}'")) && text.contains("room, three-lights"), "{text}");
        }
    }

    #[test]
    fn missing_files_are_named() {
        for name in ["no-such.mgf", "no-such.GLTF", "no-such.glb", "no-such.obj"] {
            let error = Scene::load(name).expect_err("there is no such file").to_string();
            assert!(error.contains(name), "{error}");
        }
    }

    #[test]
    fn input_has_the_lambertian_share() {
        let scene = Arc::new(Scene::load("furnace").expect("built in"));
        let input = scene.input();
        assert_eq!(input.surfaces, scene.surfaces, "all surfaces");
        let [wall] = input.materials[..] else { panic!("one material: {:?}", input.materials) };
        assert_eq!(wall.reflectance, Rgb::new(0.2, 0.5, 0.8), "reflectance");
        assert_eq!(wall.exitance, Rgb::new(1.0, 2.0, 3.0), "exitance");
        assert!(wall.two_sided, "sides");
    }
}

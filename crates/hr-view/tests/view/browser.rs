//! The page in a real browser: what it shows, how it moves, and what it says when it is damaged.
//!
//! Needs node and Chromium; where one is missing, the test says so and is skipped, unless
//! `HR_VIEW_INSTALL_BROWSER=1` lets it install them with apt-get.

use glam::DVec3;
use hr_diffuse::Settings;
use hr_scene::{Camera, Rgb, Scene};
use hr_view::Mode;
use hr_view::display::{DisplayMesh, Walkable};
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use hr_view::walkthrough::Walkthrough;
use hr_view::window::{Snapshot, Tone, WindowError};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

const SIZE: [u32; 2] = [400, 300];

/// The first program of several names that runs.
fn program(names: &[&str]) -> Option<String> {
    let runs = |name: &&&str| {
        let run = Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        run.is_ok_and(|status| status.success())
    };
    names.iter().find(runs).map(|name| (*name).to_owned())
}

fn node_and_chromium() -> Option<(String, String)> {
    let find = || Some((program(&["node"])?, program(&["chromium", "chromium-browser", "google-chrome"])?));
    find().or_else(|| {
        std::env::var_os("HR_VIEW_INSTALL_BROWSER")?;
        let install =
            Command::new("apt-get").args(["install", "-y", "--no-install-recommends", "chromium", "nodejs"]).status();
        install.is_ok_and(|status| status.success()).then(find)?
    })
}

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        let path = std::env::temp_dir().join(format!("hr-view-browser-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("the folder for temporary files can be written to");
        Self(path)
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, text).expect("the folder can be written to");
        path
    }

    fn picture(&self, name: &str) -> Vec<[u8; 3]> {
        let picture = image::open(self.0.join(name)).expect("a picture").into_rgb8();
        assert_eq!([picture.width(), picture.height()], SIZE, "{name} is of the size asked for");
        picture.pixels().map(|p| p.0).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What cannot be removed stays.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Mean difference as a share of white, outside silhouettes: where neither picture has a steep edge around the pixel.
fn difference(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
    const STEEP: u8 = 32;
    let [width, height] = SIZE.map(|side| side as usize);
    let is_steep = |p: &[[u8; 3]], x: usize, y: usize| {
        (0..3).any(|c| {
            let around = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| p[y * width + x][c]));
            let (low, high) = around.fold((255, 0), |(low, high), v| (v.min(low), v.max(high)));
            high - low > STEEP
        })
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for y in 1..height - 1 {
        for x in (1..width - 1).filter(|&x| !is_steep(a, x, y) && !is_steep(b, x, y)) {
            let (p, q) = (a[y * width + x], b[y * width + x]);
            sum += (0..3).map(|c| f64::from(p[c].abs_diff(q[c]))).sum::<f64>() / 3.0 / 255.0;
            count += 1.0;
        }
    }
    assert!(count > 0.8 * f64::from(SIZE[0] * SIZE[1]), "most of the picture is compared: {count} pixels");
    sum / count
}

/// Glossy light that stays as it is from one eye, for comparison.
struct Frozen<'a>(&'a Walkthrough, DVec3);

impl Walkable for Frozen<'_> {
    fn name(&self) -> &str {
        self.0.name()
    }
    fn mesh(&self) -> &DisplayMesh {
        self.0.mesh()
    }
    fn cameras(&self) -> &[(String, Camera)] {
        self.0.cameras()
    }
    fn exposure(&self, camera: &Camera) -> Option<f32> {
        self.0.exposure(camera)
    }
    fn glossy_radiance(&self, _: DVec3, vertices: &[u32], out: &mut [Rgb]) {
        self.0.glossy_radiance(self.1, vertices, out);
    }
}

fn on_device(walk: &dyn Walkable, camera: &Camera) -> Option<Vec<[u8; 3]>> {
    match Snapshot::of(walk, camera, None) {
        Ok(picture) => Some(picture.rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect()),
        Err(WindowError::NoAdapter(reason)) => {
            eprintln!("not compared with the window, no graphics device: {reason}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Pages that are not as they were written: what is done to them, and what they have to say.
fn damaged(folder: &Folder, page: &str) -> Vec<(PathBuf, &'static str)> {
    let data = page.find(r#"id="solution">"#).expect("the solution's place") + 20;
    let middle = (data + page.len()) / 2;
    let other = if page.as_bytes()[middle] == b'A' { "B" } else { "A" };
    let changed = format!("{}{other}{}", &page[..middle], &page[middle + 1..]);
    let strange = format!("{}#?{}", &page[..middle], &page[middle + 2..]);
    let shader = page.replace("vec3 evaluate(", "vec3 evaluat(");
    let script = page.replace("class Walker {", "class Walker (");
    vec![
        (folder.write("changed.html", &changed), "damaged"),
        (folder.write("strange.html", &strange), "damaged"),
        (folder.write("half.html", &page[..middle]), "the end is missing"),
        (
            folder.write("viewer-cut.html", &page[..page.find("class Picture").expect("the viewer") + 100]),
            "the end is missing",
        ),
        (folder.write("shader.html", &shader), "does not take the shader glossy-vertex"),
        (folder.write("script.html", &script), "damaged"),
    ]
}

#[test]
fn the_page_shows_what_the_window_shows() {
    let Some((node, chromium)) = node_and_chromium() else {
        eprintln!("skipped: node or Chromium is missing; HR_VIEW_INSTALL_BROWSER=1 installs them with apt-get");
        return;
    };
    let mut scene = Scene::load("glossy-sphere").expect("built in");
    let first = Camera { width: SIZE[0], height: SIZE[1], ..scene.default_camera() };
    let eye = DVec3::from(first.eye);
    let aside = (DVec3::from(first.target) - eye).cross(first.up.into()) * 0.4;
    let second = Camera { eye: (eye + aside).into(), ..first };
    scene.cameras = vec![("first".into(), first), ("second".into(), second)];
    let watch = &mut |_: &hr_diffuse::Progress| ControlFlow::Continue(());
    let solved = Solved::new(Arc::new(scene), Settings::with_error(0.3), true, watch).expect("a sound scene");
    let solved = Arc::new(solved);
    let folder = Folder::new();
    let path = folder.0.join("page.html");
    hr_view::html::write(&solved, &path).expect("written");
    let page = std::fs::read_to_string(&path).expect("text");
    for part in ["http:", "https:", "//cdn", "src=", "import("] {
        assert!(!page.contains(part), "nothing is fetched: {part}");
    }

    let damaged = damaged(&folder, &page);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser/walk.mjs");
    let mut command = Command::new(node);
    command.arg(script).arg(chromium).args(SIZE.map(|side| side.to_string())).arg(&folder.0).arg(&path);
    let output =
        command.args(damaged.iter().map(|(path, _)| path)).stderr(Stdio::inherit()).output().expect("node runs");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "the walk failed: {said}");
    let said: serde_json::Value = serde_json::from_str(&said).expect("JSON");

    assert_eq!(said["state"], "ready", "{said}");
    assert_eq!(said["faults"], serde_json::json!([]), "nothing is complained of");
    assert_eq!(said["idle"], 0, "nothing is drawn while nothing changes");
    assert!(said["help"].as_u64() > Some(10), "help shows the keys: {said}");
    assert_eq!(said["restored"], true, "a lost device comes back");
    for (name, moved) in said["moves"].as_object().expect("moves") {
        assert_eq!(moved, true, "{name} changes the picture");
    }
    for ((path, words), page) in damaged.iter().zip(said["damage"].as_array().expect("a list")) {
        let message = page["message"].as_str().unwrap_or_default();
        assert!(message.contains(words), "{} says '{message}'", path.display());
    }
    eprintln!("ready in {} s; {} frames a second at 1280 × 720", said["seconds"], said["rate"]);

    let walkthrough = Walkthrough::new(Arc::clone(&solved), Mode::Distributions);
    for (camera, name) in [(&first, "still"), (&second, "second")] {
        let shown = folder.picture(said[name].as_str().expect("a name"));
        let tone = Tone::for_view(&walkthrough, camera);
        let cast = RayCaster::new(&solved.scene, &solved.solution, Mode::Distributions).render(camera, &|_| ());
        let code = |radiance: &Rgb| tone.apply(*radiance).to_array().map(|c| (255.0 * c).round() as u8);
        let cast: Vec<[u8; 3]> = cast.pixels.iter().map(code).collect();
        let off = difference(&shown, &cast);
        eprintln!("{name}: {:.2} % from the ray caster", 100.0 * off);
        assert!(off < 0.015, "{name}: {off} from the ray caster");
        let Some(window) = on_device(&walkthrough, camera) else { continue };
        let off = difference(&shown, &window);
        eprintln!("{name}: {:.2} % from the window", 100.0 * off);
        assert!(off < 0.015, "{name}: {off} from the window");
        if name == "second"
            && let Some(frozen) = on_device(&Frozen(&walkthrough, eye), camera)
        {
            let stale = difference(&shown, &frozen);
            assert!(stale > 2.0 * off, "highlights follow the eye: {off}; {stale} if they did not");
        }
    }
}

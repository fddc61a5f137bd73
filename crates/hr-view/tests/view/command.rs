//! The command as the shell sees it: mistakes are status 1 and one line.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn hr_view(arguments: &[&str]) -> Output {
    command(arguments).output().expect("the command runs")
}

/// The command without any screen.
fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hr-view"));
    command.args(arguments);
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(name);
    }
    command
}

#[test]
fn mistakes_are_status_1_and_one_line() {
    let cases: [(&[&str], &str); 14] = [
        (&["no-such-scene"], "room"),
        (&["no-such-file.mgf"], "no-such-file.mgf"),
        (&["--camera", "no-such-camera.json"], "no-such-camera.json"),
        (&["room", "--camera", "no-such-camera"], "'dining'"),
        (&["--image", "picture.gif"], ".png"),
        (&["--error", "2"], "0.001"),
        (&["furnace", "--html", "no/such/folder/a.html"], "no/such/folder/a.html"),
        (&["furnace", "--export", "a.obj"], ".glb"),
        (&["furnace", "--export", "no/such/folder/a.csv"], "no/such/folder/a.csv"),
        (&["--mode", "gather"], "add --image"),
        (&["furnace", "--image", "no/such/folder/a.png"], "no/such/folder/a.png"),
        (&["furnace", "--save", "no/such/folder/a.light"], "no/such/folder/a.light"),
        (&["furnace", "--load", "Cargo.toml", "--image", "a.png"], "--save"),
        (&["furnace", "--error", "0.9", "--frames", "/dev/null/frames"], "/dev/null/frames"),
    ];
    for (arguments, hint) in cases {
        let output = hr_view(arguments);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {text}");
        assert!(text.lines().count() == 1 && text.contains(hint), "{arguments:?} says: {text}");
        assert!(output.stdout.is_empty(), "{arguments:?}: results only on standard output");
    }
}

/// What is in the way is told before anything is solved.
#[test]
fn folders_and_files_are_not_mixed_up() {
    let folder = Folder::new("mixed");
    let file = folder.write("file.obj", "");
    for name in ["folder.obj", "folder.png", "folder.html"] {
        std::fs::create_dir_all(folder.path(name)).expect("the folder is ours");
    }
    let [obj, png, html] = ["folder.obj", "folder.png", "folder.html"].map(|name| folder.path(name));
    let inside = format!("{file}/a.png");
    let cases: [(&[&str], &str); 8] = [
        (&[&obj, "--image", "a.png"], "give a file"),
        (&["furnace", "--load", &obj, "--image", "a.png"], "give a file"),
        (&["furnace", "--image", &png], "give a file name"),
        (&["furnace", "--html", &html], "give a file name"),
        (&["furnace", "--save", &obj, "--image", "a.png"], "give a file name"),
        (&["furnace", "--frames", &file], "give a folder"),
        (&["furnace", "--image", &inside], "name a folder"),
        (&["furnace", "--image", "no/such/folder/a.png"], "make it first"),
    ];
    for (arguments, hint) in cases {
        let output = hr_view(arguments);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {text}");
        assert!(text.lines().count() == 1 && text.contains(hint), "{arguments:?} says: {text}");
    }
}

#[cfg(unix)]
#[test]
fn names_that_are_no_text_are_refused() {
    use std::os::unix::ffi::OsStrExt;
    let name = std::ffi::OsStr::from_bytes(b"n\xff.obj");
    let output = command(&[]).arg(name).output().expect("the command runs");
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.lines().count() == 1 && text.contains("rename the file"), "says: {text}");
}

#[test]
fn scenes_of_which_nothing_is_left_say_why() {
    let folder = Folder::new("nothing");
    for (face, hint) in [("v nan 0 0\nv 1 0 0\nv 0 1 0\n", "not finite"), ("v 0 0 0\nv 1 0 0\nv 2 0 0\n", "no area")] {
        let scene = folder.write("scene.obj", &format!("{face}f 1 2 3\n"));
        let output = hr_view(&[&scene, "--image", &folder.path("a.png")]);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.lines().count() == 1 && text.contains(hint) && text.contains(":4"), "{face} says: {text}");
    }
}

#[test]
fn the_scenes_cameras_go_by_their_names() {
    let folder = Folder::new("cameras");
    let image = folder.path("a.pfm");
    let sizes = ["standard", "high"].map(|name| {
        succeeds(&["cornell", "--error", "0.9", "--camera", name, "--image", &image]);
        let picture = std::fs::read(&image).expect("a picture");
        String::from_utf8_lossy(&picture[..20]).lines().nth(1).map(str::to_owned)
    });
    assert_eq!(sizes, ["300 300", "400 300"].map(|size| Some(size.to_owned())), "each has its own size");
}

#[test]
fn black_pictures_are_not_silent() {
    let folder = Folder::new("black");
    let away = folder
        .write("away.json", r#"{"eye":[50,50,50],"target":[90,90,90],"up":[0,0,1],"fov_x":80,"width":24,"height":16}"#);
    let image = folder.path("a.png");
    let inside = folder.write("inside.json", IN_THE_FURNACE);
    for (camera, black) in [(away, true), (inside, false)] {
        let output = hr_view(&["furnace", "--error", "0.5", "--camera", &camera, "--image", &image]);
        assert_eq!(output.status.code(), Some(0), "black pictures are no mistake");
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(text.contains("all is black"), black, "of the view {camera}: {text}");
    }
}

#[test]
fn help_goes_to_standard_output() {
    let output = hr_view(&["--help"]);
    assert_eq!(output.status.code(), Some(0), "help is no mistake");
    assert!(String::from_utf8_lossy(&output.stdout).contains("--time-budget"), "all options are listed");
    assert!(output.stderr.is_empty(), "nothing is wrong");
}

/// A folder of its own for a test's files, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("hr-view-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("the folder for temporary files can be written to");
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        std::fs::write(self.path(name), text).expect("the folder is ours");
        self.path(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.0));
    }
}

/// Runs a command line that is to succeed without a word on standard output.
fn succeeds(arguments: &[&str]) -> String {
    let output = hr_view(arguments);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {text}");
    assert!(output.stdout.is_empty(), "{arguments:?}: results are files");
    text
}

/// Width, height and channels of a little-endian colour PFM file, rows from the bottom up.
fn read_pfm(path: &str) -> (usize, usize, Vec<f32>) {
    let bytes = std::fs::read(path).expect("the picture was written");
    let header = bytes.splitn(4, |b| *b == b'\n').take(3).map(|line| String::from_utf8_lossy(line).into_owned());
    let header: Vec<String> = header.collect();
    assert_eq!((header[0].as_str(), header[2].as_str()), ("PF", "-1.0"), "a colour PFM file");
    let size: Vec<usize> = header[1].split(' ').map(|n| n.parse().expect("a size")).collect();
    let data = &bytes[header.iter().map(|line| line.len() + 1).sum()..];
    let channels = data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    (size[0], size[1], channels)
}

/// A camera in the middle of the furnace (a cube), wider than high.
const IN_THE_FURNACE: &str =
    r#"{"eye":[0.4,0.5,0.6],"target":[1,0.4,0.3],"up":[0,0,1],"fov_x":80,"width":24,"height":16}"#;

#[test]
fn pictures_have_the_cameras_size_and_the_right_light() {
    let folder = Folder::new("pictures");
    let camera = folder.write("camera.json", IN_THE_FURNACE);
    let scene = hr_scene::Scene::load("furnace").expect("built in");
    let material = &scene.materials[0];
    // Radiosity is exitance / (1 − reflectance) in a closed furnace.
    let expected =
        material.exitance / (hr_scene::Rgb::ONE - material.reflector.diffuse()) * std::f32::consts::FRAC_1_PI;
    for mode in ["distributions", "samples", "gather"] {
        let pfm = folder.path(&format!("{mode}.pfm"));
        succeeds(&["furnace", "--error", "0.2", "--camera", &camera, "--mode", mode, "--image", &pfm]);
        let (width, height, channels) = read_pfm(&pfm);
        assert_eq!((width, height, channels.len()), (24, 16, 24 * 16 * 3), "{mode}: size");
        for (i, found) in channels.iter().enumerate() {
            let right = expected[i % 3];
            assert!(
                (found / right - 1.0).abs() < 0.2,
                "{mode}: channel {i} is {found}, not {right}: error asked for 0.2"
            );
        }
    }
    for name in ["a.exr", "a.png"] {
        let path = folder.path(name);
        succeeds(&["furnace", "--error", "0.5", "--camera", &camera, "--image", &path]);
        let bytes = std::fs::read(&path).expect("the picture was written");
        let magic: &[u8] = if name.ends_with("png") { b"\x89PNG" } else { &[0x76, 0x2f, 0x31, 0x01] };
        assert!(bytes.starts_with(magic), "{name} is what its name says");
    }
    let png = image::open(folder.path("a.png")).expect("a PNG file");
    assert_eq!((png.width(), png.height()), (24, 16), "size of the PNG file");
}

#[test]
fn pages_are_whole() {
    let folder = Folder::new("page");
    let page = folder.path("page.html");
    let stats = folder.path("stats.json");
    succeeds(&["cornell", "--error", "0.5", "--html", &page, "--stats", &stats]);
    let text = std::fs::read_to_string(&page).expect("the page was written");
    assert!(text.starts_with("<!DOCTYPE html>") && text.trim_end().ends_with("</html>"), "from begin to end");
    assert!(!text.contains("<!-- "), "every part is in its place");
    let start = text.find(r#"id="solution">"#).expect("the solution's element") + 14;
    let data = text[start..].split_once("</script>").expect("its end").0.trim();
    // The first bytes of a gzip file.
    assert!(data.len() > 1000 && data.starts_with("H4sI"), "the solution is in it: {} letters", data.len());
    let stats = std::fs::read_to_string(stats).expect("statistics were written");
    assert!(stats.contains("\"display\""), "statistics come with pages, too: {stats}");
}

#[test]
fn glossy_light_is_finite_and_counted() {
    let folder = Folder::new("glossy");
    let camera = folder.write(
        "camera.json",
        &serde_json::to_string(&hr_scene::Camera {
            width: 32,
            height: 20,
            ..hr_scene::Scene::load("three-lights").expect("built in").default_camera()
        })
        .expect("cameras serialise"),
    );
    let (pfm, json) = (folder.path("a.pfm"), folder.path("a.json"));
    let options = ["--error", "0.5", "--threads", "2", "--camera", &camera, "--image", &pfm, "--stats", &json];
    succeeds(&[&["three-lights"], &options[..]].concat());
    let (width, height, channels) = read_pfm(&pfm);
    assert_eq!((width, height), (32, 20), "size");
    assert!(channels.iter().all(|c| c.is_finite() && *c >= 0.0), "radiance is finite and not negative");
    assert!(channels.iter().any(|c| *c > 0.0), "something is lit");
    let text = std::fs::read_to_string(&json).expect("statistics were written");
    let stats: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let mut sum = 0.0;
    for phase in ["load", "build", "refine", "visibility", "transport", "reflect", "display"] {
        let seconds = stats["seconds"][phase].as_f64().unwrap_or(-1.0);
        assert!(seconds >= 0.0, "seconds of {phase}: {seconds}");
        sum += seconds;
    }
    let total = stats["seconds"]["total"].as_f64().unwrap_or(-1.0);
    assert!(sum <= total * 1.001, "phases do not overlap: {sum} s of {total} s");
    for count in ["polygons", "nodes", "leaves", "links", "rays", "samples", "basis_functions", "brdf_evaluations"] {
        assert!(stats["counts"][count].as_u64().is_some_and(|n| n > 0), "count of {count} in {text}");
    }
    let iterations = stats["iterations"].as_u64().unwrap_or(0);
    assert_eq!(stats["residuals"].as_array().map_or(0, Vec::len) as u64, iterations, "a residual per iteration");
    assert!(iterations > 0 && stats["skipped"].as_object().is_some_and(|s| !s.is_empty()), "work done and avoided");
    let peak = stats["peak_bytes"].as_u64();
    assert!(peak.is_some_and(|bytes| bytes > 1 << 20) || !cfg!(target_os = "linux"), "peak memory: {peak:?}");
}

#[test]
fn what_is_black_for_want_of_light_is_told() {
    let folder = Folder::new("dark");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let lamp = format!("mtllib lamp.mtl\nusemtl lamp\n{triangle}");
    let (dark, lit) = (folder.write("dark.obj", triangle), folder.write("lit.obj", &lamp));
    folder.write("lamp.mtl", "newmtl lamp\nKe 1 1 1\n");
    for (scene, lights) in [(dark, 0), (lit, 1)] {
        let text = succeeds(&[&scene, "--image", &folder.path("a.png")]);
        assert_eq!(text.matches("nothing in the scene shines").count(), 1 - lights, "{scene}: {text}");
    }
}

/// A convex thing of reflectance ρ under a sky of radiance L reflects ρ L everywhere, and beside it is the sky.
#[test]
fn a_sky_shines_on_what_stands_in_the_open() {
    let folder = Folder::new("sky");
    let corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n";
    let faces = "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    folder.write("grey.mtl", "newmtl grey\nKd 0.5 0.25 0.125\n");
    let cube = folder.write("cube.obj", &format!("mtllib grey.mtl\nusemtl grey\n{corners}{faces}"));
    let (pfm, stats) = (folder.path("a.pfm"), folder.path("a.json"));
    let text = succeeds(&[&cube, "--sky", "2", "--image", &pfm, "--stats", &stats]);
    assert!(!text.contains("nothing in the scene shines"), "{text}");
    let (_, _, channels) = read_pfm(&pfm);
    let (mut cube_pixels, mut sky_pixels) = (0, 0);
    for pixel in channels.chunks_exact(3) {
        let is = |color: [f32; 3]| pixel.iter().zip(color).all(|(is, should)| (is / should - 1.0).abs() < 0.01);
        cube_pixels += usize::from(is([1.0, 0.5, 0.25]));
        sky_pixels += usize::from(is([2.0; 3]));
    }
    let pixels = channels.len() / 3;
    assert!(cube_pixels > pixels / 10 && sky_pixels > pixels / 4, "{cube_pixels} and {sky_pixels} of {pixels}");
    assert!(cube_pixels + sky_pixels > pixels * 97 / 100, "but for edges: {cube_pixels} and {sky_pixels} of {pixels}");
    for wrong in ["0", "-1", "nan", "bright"] {
        let output = hr_view(&[&cube, "--sky", wrong, "--image", &pfm]);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{wrong}: {text}");
        assert!(text.contains("must be a radiance above 0"), "{text}");
    }
    // Nothing is looked for where nothing shines.
    succeeds(&[&cube, "--image", &pfm, "--stats", &stats]);
    let text = std::fs::read_to_string(&stats).expect("written");
    let stats: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(stats["skipped"]["dark_pixels"].as_u64(), Some(pixels as u64), "{text}");
    assert!(read_pfm(&pfm).2.iter().all(|&channel| channel == 0.0), "it is black");
}

#[test]
fn a_time_budget_ends_soon() {
    let folder = Folder::new("budget");
    let camera = folder.write("camera.json", IN_THE_FURNACE);
    let pfm = folder.path("a.pfm");
    let begin = Instant::now();
    succeeds(&["furnace", "--error", "0.001", "--time-budget", "0.2", "--camera", &camera, "--image", &pfm]);
    let seconds = begin.elapsed().as_secs_f64();
    // Without the budget this takes minutes; slow machines need time to start, and for the picture.
    assert!(seconds < 20.0, "{seconds} s with a budget of 0.2 s");
    assert!(read_pfm(&pfm).2.iter().all(|c| c.is_finite() && *c > 0.0), "there is something to see");
}

#[test]
fn without_a_display_frames_are_written() {
    let folder = Folder::new("frames");
    let camera = folder.write("camera.json", IN_THE_FURNACE);
    let mut command = command(&["furnace", "--error", "0.5", "--camera", &camera]);
    let output = command.current_dir(&folder.0).output().expect("the command runs");
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "no window is no mistake: {text}");
    let told = text.lines().filter(|line| line.contains("hr-view-frames instead")).count();
    assert_eq!(told, 1, "one line says where frames go: {text}");
    let mut frames = 0;
    for entry in std::fs::read_dir(folder.0.join("hr-view-frames")).expect("the folder was made") {
        let picture = image::open(entry.expect("an entry").path()).expect("a PNG file").into_rgb8();
        assert_eq!(picture.dimensions(), (24, 16), "size of the command line's camera");
        assert!(picture.as_raw().iter().all(|code| *code > 8), "walls that shine are not black");
        frames += 1;
    }
    assert_eq!(frames, 60, "frames along the walk");
}

#[cfg(unix)]
#[test]
fn kept_solutions_give_the_same_pictures() {
    let folder = Folder::new("kept");
    let paths = ["camera.json", "a.light", "solved.pfm", "loaded.pfm", "solved.json", "loaded.json"];
    let [camera, light, solved, loaded, solved_stats, loaded_stats] = paths.map(|name| folder.path(name));
    let mut view = hr_scene::Scene::load("room").expect("built in").default_camera();
    [view.width, view.height] = [20, 12];
    folder.write("camera.json", &serde_json::to_string(&view).expect("a camera is JSON"));
    let picture = ["--camera", &camera, "--image"];
    for mode in ["samples", "distributions"] {
        let show = ["room", "--mode", mode, "--threads", "2"];
        let solve = ["--error", "0.9", "--save", &light, "--stats", &solved_stats];
        succeeds(&[&show[..], &picture, &[&solved], &solve].concat());
        succeeds(&[&show[..], &picture, &[&loaded], &["--load", &light, "--stats", &loaded_stats]].concat());
        let [before, after] = [&solved, &loaded].map(|path| std::fs::read(path).expect("written"));
        assert!(before == after, "{mode}: the same picture, byte by byte");
        assert!(read_pfm(&loaded).2.iter().any(|&light| light > 0.0), "{mode}: there is light in it");
        let stats = |path: &str| -> serde_json::Value {
            serde_json::from_slice(&std::fs::read(path).expect("written")).expect("JSON")
        };
        let [before, after] = [&solved_stats, &loaded_stats].map(|path| stats(path));
        for same in ["error", "error_asked", "counts", "skipped", "iterations", "residuals"] {
            assert_eq!(before[same], after[same], "{mode}: {same} of the solution");
        }
        assert_eq!(after["seconds"]["refine"], 0.0, "{mode}: nothing was solved");
    }
    let other = hr_view(&["furnace", "--load", &light, "--image", &loaded]);
    let text = String::from_utf8_lossy(&other.stderr);
    assert!(other.status.code() == Some(1) && text.contains("another scene than furnace"), "{text}");
}

#[test]
fn ctrl_c_between_frames_ends_at_once_and_leaves_whole_files() {
    let folder = Folder::new("interrupted");
    let mut command = command(&["furnace", "--error", "0.5", "--mode", "samples", "--frames", &folder.path("frames")]);
    let mut running = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the command runs");
    let names = || -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(folder.path("frames")) else { return Vec::new() };
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    };
    while !names().iter().any(|name| name.starts_with("frame")) {
        assert!(running.try_wait().expect("it is ours").is_none(), "there are frames before it ends");
        std::thread::sleep(Duration::from_millis(1));
    }
    let pressed = Command::new("kill").args(["-INT", &running.id().to_string()]).status().expect("kill is there");
    assert!(pressed.success(), "it was still running");
    let begin = Instant::now();
    let status = running.wait().expect("it ends");
    assert_eq!(status.code(), Some(130), "the status of an interrupted program");
    assert!(begin.elapsed() < Duration::from_secs(5), "it ends soon, after {:?}", begin.elapsed());
    let names = names();
    assert!(!names.is_empty() && names.len() < 60, "some frames were done: {}", names.len());
    for name in &names {
        assert!(name.starts_with("frame"), "nothing else is left: {name}");
        image::open(folder.path("frames") + "/" + name).expect("a whole PNG file");
    }
}

#[test]
fn what_was_stopped_goes_on() {
    let folder = Folder::new("resume");
    let [begun, whole, there, here] = ["begun.light", "whole.light", "there.csv", "here.csv"].map(|n| folder.path(n));
    // Out of time before it began.
    succeeds(&["cornell", "--time-budget", "0", "--error", "0.1", "--save", &begun, "--export", &here]);
    let coarse = std::fs::read_to_string(&here).expect("a table").lines().count();
    succeeds(&["cornell", "--resume", &begun, "--error", "0.1", "--save", &whole, "--export", &there]);
    succeeds(&["cornell", "--error", "0.1", "--export", &here]);
    let [resumed, fresh] = [&there, &here].map(|path| std::fs::read_to_string(path).expect("a table").lines().count());
    assert!(10 * coarse < 9 * fresh, "{coarse} elements when it was stopped, {fresh} at the end");
    assert!(10 * resumed > 9 * fresh && 9 * resumed < 10 * fresh, "{resumed} elements, {fresh} without the stop");
}

/// A table of elements needs neither light at vertices nor distributions: it is the same where they are made to be kept.
#[test]
fn a_table_is_made_of_elements_alone() {
    let folder = Folder::new("table");
    let [light, here, there, stats] =
        ["whole.light", "here.csv", "there.csv", "stats.json"].map(|name| folder.path(name));
    let vertices = |more: &[&str], table: &str| {
        let command = ["glossy-sphere", "--error", "0.2", "--export", table, "--stats", &stats];
        succeeds(&[&command, more].concat());
        let found: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(&stats).expect("statistics")).expect("JSON");
        let [all, unseen] = [&found["counts"]["vertices"], &found["skipped"]["unseen_vertices"]].map(|n| n.as_u64());
        all.expect("a number") - unseen.expect("a number")
    };
    let [alone, kept] = [vertices(&[], &here), vertices(&["--save", &light], &there)];
    assert!(10 * alone < kept, "{alone} vertices for a table, {kept} to be kept");
    let [alone, kept] = [&here, &there].map(|path| std::fs::read_to_string(path).expect("a table"));
    assert!(alone == kept, "the tables differ");
}

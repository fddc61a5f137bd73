//! The window itself: without a screen it says so at once; on a virtual screen (Xvfb) it is walked with real keys.
//!
//! Windows want the main thread, so that this has its own `main`. The walk needs Xvfb and xdotool and is asked for with
//! `cargo test -p hr-view --test window -- --ignored`; `-- --open` opens the test's room to look at.

mod room;

use hr_view::window::{WindowOptions, open};
use std::error::Error;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

type Outcome = Result<(), Box<dyn Error>>;
type Test = fn() -> Outcome;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let asked = |name: &str| arguments.iter().any(|a| a == name);
    if asked("--open") {
        let fineness = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(64);
        let options = WindowOptions { size: [800, 500], ..WindowOptions::default() };
        return match open(Arc::new(room::Room::new(fineness)), &options) {
            Ok(walked) => {
                // For whoever counts.
                eprintln!("frames {} evaluated {}", walked.frames, walked.evaluated);
                ExitCode::SUCCESS
            }
            Err(error) => {
                eprintln!("{error}");
                ExitCode::FAILURE
            }
        };
    }
    if asked("--list") {
        return ExitCode::SUCCESS;
    }
    let mut failed = report("no_screen_is_an_error_at_once", &no_screen_is_an_error_at_once());
    let on_a_screen: [(&str, Test); 5] = [
        ("a_walk_on_a_virtual_screen", a_walk_on_a_virtual_screen),
        ("nothing_is_drawn_while_nothing_changes", nothing_is_drawn_while_nothing_changes),
        ("walks_are_recorded_and_played", walks_are_recorded_and_played),
        ("what_cannot_be_shown_is_one_line", what_cannot_be_shown_is_one_line),
        ("the_solution_follows_what_is_wanted", the_solution_follows_what_is_wanted),
    ];
    for (name, test) in on_a_screen {
        if !(asked("--ignored") || asked("--include-ignored")) {
            eprintln!("test {name} ... skipped; ask for it with -- --ignored");
        } else if ["Xvfb", "xdotool"].iter().any(|tool| !is_installed(tool)) {
            eprintln!("test {name} ... skipped; it needs Xvfb and xdotool");
        } else {
            failed |= report(name, &test());
        }
    }
    if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

fn report(name: &str, outcome: &Outcome) -> bool {
    match outcome {
        Ok(()) => eprintln!("test {name} ... ok"),
        Err(error) => eprintln!("test {name} ... FAILED: {error}"),
    }
    outcome.is_err()
}

fn is_installed(tool: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join(tool).exists())
}

/// Kills what is left of a program when a test ends early.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Both fail only where it has ended already.
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

impl Running {
    fn exit_within(&mut self, limit: Duration) -> Result<bool, Box<dyn Error>> {
        let begin = Instant::now();
        while begin.elapsed() < limit {
            if let Some(status) = self.0.try_wait()? {
                return Ok(status.success());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        Err(format!("still running after {limit:?}").into())
    }
}

fn no_screen_is_an_error_at_once() -> Outcome {
    if !cfg!(all(unix, not(target_os = "macos"))) {
        return Ok(());
    }
    for (display, what) in [(None, "no DISPLAY"), (Some(":4095"), "a DISPLAY that nobody serves")] {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("--open").stderr(Stdio::piped());
        for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            command.env_remove(name);
        }
        command.envs(display.map(|d| ("DISPLAY", d)));
        let mut child = Running(command.spawn()?);
        if child.exit_within(Duration::from_secs(10))? {
            return Err(format!("{what}: opened a window").into());
        }
        let mut text = String::new();
        std::io::Read::read_to_string(&mut child.0.stderr.take().ok_or("no stderr")?, &mut text)?;
        if text.trim().lines().count() != 1 || !text.contains("--frames") {
            return Err(format!("{what}: not one line that says what to do: {text}").into());
        }
        if text.contains("panicked") || text.contains(".rs:") {
            return Err(format!("{what}: not for users: {text}").into());
        }
    }
    Ok(())
}

/// A folder that nobody else uses.
fn folder() -> std::io::Result<PathBuf> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("hr-view-walk-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    Ok(folder)
}

/// A virtual screen: its name, and what serves it.
fn screen() -> Result<(String, Running), Box<dyn Error>> {
    let mut server = Command::new("Xvfb")
        .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    let output = server.stdout.take().ok_or("Xvfb has no output")?;
    let server = Running(server);
    let mut number = String::new();
    BufReader::new(output).read_line(&mut number)?;
    Ok((format!(":{}", number.trim()), server))
}

/// A virtual screen with a window on it.
struct Stage {
    display: String,
    window: String,
    folder: PathBuf,
    child: Running,
    _server: Running,
}

impl Stage {
    /// The test's own room.
    fn of_room() -> Result<Self, Box<dyn Error>> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["--open", "32"]);
        Self::new(command, "room")
    }

    /// A program whose window has `name` in its title; it runs in a folder of its own.
    fn new(mut command: Command, name: &str) -> Result<Self, Box<dyn Error>> {
        let (display, server) = screen()?;
        let folder = folder()?;
        command.current_dir(&folder).env("DISPLAY", &display).stderr(Stdio::piped());
        command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        let child = Running(command.spawn()?);
        let mut stage = Self { display, window: String::new(), folder, child, _server: server };
        let begin = Instant::now();
        while stage.window.is_empty() {
            if begin.elapsed() > Duration::from_secs(60) || stage.child.0.try_wait()?.is_some() {
                return Err("no window opened".into());
            }
            std::thread::sleep(Duration::from_millis(100));
            let found = stage.xdotool(&["search", "--onlyvisible", "--name", name]).unwrap_or_default();
            stage.window = found.lines().next().unwrap_or_default().to_owned();
        }
        let window = stage.window.clone();
        stage.xdotool(&["windowfocus", "--sync", &window])?;
        Ok(stage)
    }

    /// Presses Esc; what the program has said.
    fn close(mut self) -> Result<String, Box<dyn Error>> {
        self.xdotool(&["key", "Escape"])?;
        if !self.child.exit_within(Duration::from_secs(20))? {
            return Err("the exit status is not 0".into());
        }
        let mut text = String::new();
        std::io::Read::read_to_string(&mut self.child.0.stderr.take().ok_or("no stderr")?, &mut text)?;
        Ok(text)
    }

    /// Waits until something is so.
    fn until(&self, what: &str, is_so: impl Fn(&Self) -> bool) -> Outcome {
        let begin = Instant::now();
        while !is_so(self) {
            if begin.elapsed() > Duration::from_secs(60) {
                return Err(format!("a minute has passed: {what}").into());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(())
    }

    fn title(&self) -> String {
        self.xdotool(&["getwindowname", &self.window]).unwrap_or_default()
    }

    fn xdotool(&self, arguments: &[&str]) -> Result<String, Box<dyn Error>> {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display).output()?;
        if !output.status.success() {
            return Err(format!("xdotool {arguments:?}: {}", String::from_utf8_lossy(&output.stderr)).into());
        }
        std::thread::sleep(Duration::from_millis(300));
        Ok(String::from_utf8(output.stdout)?)
    }

    /// Presses F and reads the picture.
    fn screenshot(&self, number: u32) -> Result<image::RgbImage, Box<dyn Error>> {
        self.xdotool(&["key", "f"])?;
        let path = self.folder.join(format!("hr-view-{number:03}.png"));
        let begin = Instant::now();
        while !is_complete(&path) {
            if begin.elapsed() > Duration::from_secs(30) {
                return Err(format!("no screenshot {number}").into());
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        Ok(image::open(&path)?.into_rgb8())
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.folder));
    }
}

fn is_complete(path: &Path) -> bool {
    image::open(path).is_ok()
}

/// Mean difference per channel, 0…255.
fn difference(a: &image::RgbImage, b: &image::RgbImage) -> f64 {
    let sum: u64 = a.as_raw().iter().zip(b.as_raw()).map(|(x, y)| u64::from(x.abs_diff(*y))).sum();
    sum as f64 / a.as_raw().len() as f64
}

fn a_walk_on_a_virtual_screen() -> Outcome {
    let stage = Stage::of_room()?;
    let start = stage.screenshot(1)?;
    if difference(&start, &image::RgbImage::new(start.width(), start.height())) < 20.0 {
        return Err("the picture is black".into());
    }
    stage.xdotool(&["keydown", "w"])?;
    stage.xdotool(&["keyup", "w"])?;
    let ahead = stage.screenshot(2)?;
    if difference(&start, &ahead) < 1.0 {
        return Err("W does not move".into());
    }
    stage.xdotool(&["mousemove", "600", "300", "mousedown", "1", "mousemove", "500", "320", "mouseup", "1"])?;
    if difference(&ahead, &stage.screenshot(3)?) < 1.0 {
        return Err("dragging does not turn".into());
    }
    stage.xdotool(&["key", "1"])?;
    if difference(&start, &stage.screenshot(4)?) > 0.1 {
        return Err("1 does not bring the first camera back".into());
    }
    stage.xdotool(&["key", "2", "key", "plus", "key", "h"])?;
    let window = stage.window.clone();
    for (width, height) in [("300", "700"), ("1", "1"), ("900", "600")] {
        stage.xdotool(&["windowsize", &window, width, height])?;
    }
    stage.xdotool(&["windowunmap", &window])?;
    stage.xdotool(&["windowmap", &window])?;
    stage.xdotool(&["windowfocus", "--sync", &window])?;
    let resized = stage.screenshot(5)?;
    if resized.dimensions() != (900, 600) {
        return Err(format!("after resizing the picture is {:?}", resized.dimensions()).into());
    }
    stage.close().map(drop)
}

/// Frames drawn and vertices evaluated by the time a program ended.
fn counts(text: &str) -> Result<[u64; 2], Box<dyn Error>> {
    let line = text.lines().find(|line| line.starts_with("frames ")).ok_or_else(|| format!("no counts in {text}"))?;
    let numbers: Vec<u64> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
    numbers.try_into().map_err(|_| format!("no two counts in {line}").into())
}

/// Seconds of processor time that a program has used.
fn processor_seconds(child: &Child) -> Result<f64, Box<dyn Error>> {
    let text = std::fs::read_to_string(format!("/proc/{}/stat", child.id()))?;
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    // utime and stime, in hundredths.
    Ok(0.01 * (fields.get(11).ok_or("no time")?.parse::<f64>()? + fields.get(12).ok_or("no time")?.parse::<f64>()?))
}

fn nothing_is_drawn_while_nothing_changes() -> Outcome {
    let stage = Stage::of_room()?;
    let used_in = |seconds| {
        let before = processor_seconds(&stage.child.0)?;
        std::thread::sleep(Duration::from_secs(seconds));
        processor_seconds(&stage.child.0).map(|after| after - before)
    };
    // A frame of this room takes a software rasteriser some 30 ms. How long opening takes, and how many events come with it,
    // is the window system's affair: what counts is that there is an end to it.
    let rests = |seconds| used_in(seconds).is_ok_and(|used| used <= 0.02);
    stage.until("it does not come to rest", |_| rests(1))?;
    if !rests(4) {
        return Err("it draws while nothing changes".into());
    }
    let [frames, evaluated] = counts(&stage.close()?)?;
    // The eye has not moved: those vertices of the floor that are in sight once, however many frames there were.
    if frames == 0 || !(1..=33 * 33).contains(&evaluated) {
        return Err(format!("{frames} frames, {evaluated} vertices evaluated").into());
    }
    Ok(())
}

fn walks_are_recorded_and_played() -> Outcome {
    let stage = Stage::of_room()?;
    let start = stage.screenshot(1)?;
    stage.xdotool(&["key", "r"])?;
    stage.xdotool(&["keydown", "w"])?;
    stage.xdotool(&["keyup", "w"])?;
    stage.xdotool(&["key", "r"])?;
    let path = hr_view::camera_path::CameraPath::load(&stage.folder.join("hr-view-path-001.json"))?;
    let ahead = stage.screenshot(2)?;
    stage.xdotool(&["key", "1"])?;
    stage.xdotool(&["key", "v"])?;
    std::thread::sleep(Duration::from_secs_f64(path.seconds() + 1.0));
    let played = stage.screenshot(3)?;
    if difference(&start, &ahead) < 1.0 || difference(&ahead, &played) > 0.1 {
        return Err(format!("it ends {} from where it was recorded to", difference(&ahead, &played)).into());
    }
    stage.close().map(drop)
}

fn the_solution_follows_what_is_wanted() -> Outcome {
    let (scene, stats) = ("scene.mgf", "stats.json");
    // A lamp above a floor with balls on it: soon solved coarsely, not so soon finely.
    let mut text = "m white =\nc\nrd 0.5\nsides 2\nm lamp =\nc\ned 10\nsides 1\n\
        v a =\np 0 0 0\nv b =\np 4 0 0\nv c =\np 4 3 0\nv d =\np 0 3 0\nm white\nf a b c d\n\
        v e =\np 0 0 3\nv f =\np 0 2 3\nv g =\np 2 2 3\nv h =\np 2 0 3\nm lamp\nf e f g h\nm white\n"
        .to_owned();
    for ball in 0..24 {
        text += &format!("v m =\np {} {} 0.2\nsph m 0.2\n", 0.5 * f64::from(ball % 6), 0.5 * f64::from(ball / 6));
    }
    let home = folder()?;
    let file = home.join(scene);
    std::fs::write(&file, &text)?;
    let mut command = Command::new(env!("CARGO_BIN_EXE_hr-view"));
    command.arg(&file).args(["--error", "0.4", "--stats", stats]);
    let stage = Stage::new(command, scene)?;
    let path = stage.folder.join(stats);
    let number = |name: &str| -> Option<f64> {
        let text = std::fs::read_to_string(&path).ok()?;
        serde_json::from_str::<serde_json::Value>(&text).ok()?.pointer(name)?.as_f64()
    };
    let asked = |error: f64| move |_: &Stage| number("/error_asked").is_some_and(|e| (e - error).abs() < 1e-6);
    let done = |stage: &Stage| stage.title().trim().ends_with(&format!("{scene} — hr-view"));
    stage.until("the solution asked for", asked(0.4))?;
    stage.until("a title that says it is done", done)?;
    stage.xdotool(&["key", "period"])?;
    stage.until("a finer one", asked(0.2))?;
    stage.xdotool(&["key", "comma"])?;
    stage.until("a coarser one", asked(0.4))?;
    // Fine enough to be still at it when the next key comes.
    for _ in 0..9 {
        stage.xdotool(&["key", "period"])?;
    }
    stage.xdotool(&["key", "p"])?;
    stage.until("a title that says it waits", |stage| stage.title().contains("paused"))?;
    let before = processor_seconds(&stage.child.0)?;
    std::thread::sleep(Duration::from_secs(2));
    let used = processor_seconds(&stage.child.0)? - before;
    if used > 0.1 {
        return Err(format!("it is paused, and uses {used} s in 2 s").into());
    }
    stage.xdotool(&["key", "p"])?;
    stage.until("going on", |stage| stage.title().contains('%') || done(stage))?;
    stage.xdotool(&["key", "x"])?;
    stage.until("a stop", done)?;
    for _ in 0..9 {
        stage.xdotool(&["key", "comma"])?;
    }
    stage.until("the coarsest one", asked(0.512))?;
    stage.until("the end of it", done)?;
    let before = stage.screenshot(1)?;
    for keys in [&["key", "m"][..], &["key", "b"], &["key", "g"], &["mousemove", "640", "400", "click", "1"]] {
        stage.xdotool(keys)?;
    }
    if difference(&before, &stage.screenshot(2)?) < 5.0 {
        return Err("nothing is seen of the inside".into());
    }
    stage.xdotool(&["key", "Escape", "key", "m", "key", "g", "key", "g", "key", "g"])?;
    std::fs::write(&file, text.replace("p 4 3 0", "p 2 3 0"))?;
    let stale = std::fs::metadata(&path)?.modified()?;
    stage.until("reading the file again", |_| {
        std::fs::metadata(&path).and_then(|found| found.modified()).is_ok_and(|time| time > stale)
    })?;
    stage.until("the end of it", done)?;
    if difference(&before, &stage.screenshot(3)?) < 0.5 {
        return Err("the scene in the window is still the old one".into());
    }
    std::fs::write(&file, "f a b c")?;
    std::thread::sleep(Duration::from_secs(3));
    let said = stage.close();
    drop(std::fs::remove_dir_all(&home));
    // A file that cannot be read is no reason to close the window.
    said.map(drop)
}

fn what_cannot_be_shown_is_one_line() -> Outcome {
    let (display, _server) = screen()?;
    let home = folder()?;
    std::fs::write(home.join("empty.mgf"), "# nothing\n")?;
    std::fs::write(home.join("broken.mgf"), "f a b c\n")?;
    std::fs::write(home.join("path.json"), "[]")?;
    let outcome = [
        (&["missing.mgf"][..], "missing.mgf"),
        (&["empty.mgf"], "empty.mgf"),
        (&["broken.mgf"], "broken.mgf:1"),
        (&["cornell", "--camera", "missing.json"], "missing.json"),
        (&["cornell", "--path", "path.json"], "path.json"),
        (&["cornell", "--load", "broken.mgf"], "broken.mgf"),
    ]
    .into_iter()
    .try_for_each(|(arguments, hint)| -> Outcome {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hr-view"));
        command.args(arguments).current_dir(&home).env("DISPLAY", &display).stderr(Stdio::piped());
        command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        let mut child = Running(command.spawn()?);
        if child.exit_within(Duration::from_secs(30))? {
            return Err(format!("{arguments:?} succeeds").into());
        }
        let mut text = String::new();
        std::io::Read::read_to_string(&mut child.0.stderr.take().ok_or("no stderr")?, &mut text)?;
        let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("hr-view: ")).collect();
        if lines.len() != 1 || !lines[0].contains(hint) || text.contains("panicked") || text.contains("internal") {
            return Err(format!("{arguments:?}: not one line about {hint}: {text}").into());
        }
        Ok(())
    });
    drop(std::fs::remove_dir_all(&home));
    outcome?;
    // Without a driver there is a screen, but nothing to draw with.
    let mut command = Command::new(std::env::current_exe()?);
    command.arg("--open").env("DISPLAY", &display).env("WGPU_BACKEND", "vulkan").stderr(Stdio::piped());
    command.env("VK_DRIVER_FILES", "/nonexistent.json").env("VK_ICD_FILENAMES", "/nonexistent.json");
    let mut child = Running(command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET").spawn()?);
    if child.exit_within(Duration::from_secs(30))? {
        return Err("it draws without a driver".into());
    }
    let mut text = String::new();
    std::io::Read::read_to_string(&mut child.0.stderr.take().ok_or("no stderr")?, &mut text)?;
    if !text.contains("no graphics device") || !text.contains("--frames") || text.contains("panicked") {
        return Err(format!("not a line that says what to do without a driver: {text}").into());
    }
    Ok(())
}

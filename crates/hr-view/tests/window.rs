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
use std::time::{Duration, Instant};

type Outcome = Result<(), Box<dyn Error>>;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let asked = |name: &str| arguments.iter().any(|a| a == name);
    if asked("--open") {
        let fineness = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(64);
        return match open(&room::Room::new(fineness), &WindowOptions { size: [800, 500], tolerance: 0.0 }) {
            Ok(()) => ExitCode::SUCCESS,
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
    if !(asked("--ignored") || asked("--include-ignored")) {
        eprintln!("test a_walk_on_a_virtual_screen ... skipped; ask for it with -- --ignored");
    } else if ["Xvfb", "xdotool"].iter().any(|tool| !is_installed(tool)) {
        eprintln!("test a_walk_on_a_virtual_screen ... skipped; it needs Xvfb and xdotool");
    } else {
        failed |= report("a_walk_on_a_virtual_screen", &a_walk_on_a_virtual_screen());
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

/// A virtual screen with a window on it.
struct Stage {
    display: String,
    window: String,
    folder: PathBuf,
    child: Running,
    _server: Running,
}

impl Stage {
    fn new() -> Result<Self, Box<dyn Error>> {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let output = server.stdout.take().ok_or("Xvfb has no output")?;
        let server = Running(server);
        let mut number = String::new();
        BufReader::new(output).read_line(&mut number)?;
        let display = format!(":{}", number.trim());
        let folder = std::env::temp_dir().join(format!("hr-view-walk-{}", std::process::id()));
        std::fs::create_dir_all(&folder)?;
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["--open", "32"]).current_dir(&folder).env("DISPLAY", &display);
        command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        let child = Running(command.spawn()?);
        let mut stage = Self { display, window: String::new(), folder, child, _server: server };
        let begin = Instant::now();
        while stage.window.is_empty() {
            if begin.elapsed() > Duration::from_secs(60) || stage.child.0.try_wait()?.is_some() {
                return Err("no window opened".into());
            }
            std::thread::sleep(Duration::from_millis(100));
            let found = stage.xdotool(&["search", "--onlyvisible", "--name", "room"]).unwrap_or_default();
            stage.window = found.lines().next().unwrap_or_default().to_owned();
        }
        let window = stage.window.clone();
        stage.xdotool(&["windowfocus", "--sync", &window])?;
        Ok(stage)
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
    let mut stage = Stage::new()?;
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
    stage.xdotool(&["key", "Escape"])?;
    if stage.child.exit_within(Duration::from_secs(20))? { Ok(()) } else { Err("the exit status is not 0".into()) }
}

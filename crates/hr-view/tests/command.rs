//! The command as the shell sees it: mistakes are status 1 and one line.

use std::process::{Command, Output};

fn hr_view(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hr-view"));
    command.args(arguments);
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(name);
    }
    command.output().expect("the command runs")
}

#[test]
fn mistakes_are_status_1_and_one_line() {
    let cases: [(&[&str], &str); 6] = [
        (&["no-such-scene"], "room"),
        (&["no-such-file.mgf"], "no-such-file.mgf"),
        (&["--camera", "no-such-camera.json"], "no-such-camera.json"),
        (&["--image", "picture.gif"], ".png"),
        (&["--error", "2"], "0.001"),
        (&["--html", "a.html"], "not available yet"),
    ];
    for (arguments, hint) in cases {
        let output = hr_view(arguments);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {text}");
        assert!(text.lines().count() == 1 && text.contains(hint), "{arguments:?} says: {text}");
        assert!(output.stdout.is_empty(), "{arguments:?}: results only on standard output");
    }
}

#[test]
fn help_goes_to_standard_output() {
    let output = hr_view(&["--help"]);
    assert_eq!(output.status.code(), Some(0), "help is no mistake");
    assert!(String::from_utf8_lossy(&output.stdout).contains("--time-budget"), "all options are listed");
    assert!(output.stderr.is_empty(), "nothing is wrong");
}

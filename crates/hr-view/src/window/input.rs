//! Keys that do not walk: what they ask for.

use super::screen::Wish;
use winit::keyboard::{Key, KeyCode, NamedKey};

/// Stops per press of + or −.
const STOPS: f32 = 1.0 / 3.0;

/// What a press makes of emission or roughness.
const EDIT_STEP: f32 = std::f32::consts::SQRT_2;

/// The keys of the cameras in order.
const CAMERA_KEYS: [KeyCode; 10] = [
    KeyCode::Digit1,
    KeyCode::Digit2,
    KeyCode::Digit3,
    KeyCode::Digit4,
    KeyCode::Digit5,
    KeyCode::Digit6,
    KeyCode::Digit7,
    KeyCode::Digit8,
    KeyCode::Digit9,
    KeyCode::Digit0,
];

/// Keys and what they do, as the help shows them.
pub(super) const HELP: [(&str, &str); 25] = [
    ("W A S D, arrows up, down", "walk"),
    ("E Q, space shift", "up, down"),
    ("drag, arrows left, right", "look around"),
    ("right click, C", "capture or free the mouse"),
    ("wheel", "walking speed"),
    ("1 … 9, 0", "the scene's cameras"),
    (". ,", "solve finer, coarser"),
    ("P", "pause solving, go on"),
    ("X", "stop solving, show what there is"),
    ("R", "record a walk, end and save it"),
    ("V", "play the walk, or the scene's own"),
    ("click", "look inside a point: figures, samples, links, radiance"),
    ("L", "show or hide the links of the point"),
    ("[ ]", "dim, brighten the lamp that was clicked"),
    ("; '", "polish, roughen the surface that was clicked"),
    ("M", "outlines of elements"),
    ("B", "boxes of clusters, level by level"),
    ("K", "glossy light at each pixel, or at vertices"),
    ("G", "false colours: radiance, radiosity, irradiance"),
    ("+ −", "brighter, darker"),
    ("backspace", "expose for what is seen now"),
    ("F", "save a screenshot"),
    ("T", "show or hide the lines at the top"),
    ("H", "this help"),
    ("Esc", "leave the point, quit"),
];

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Command {
    /// Leave what one is in; at last the window.
    Leave,
    /// Brighter by so many stops, darker where negative.
    Expose(f32),
    AutomaticExposure,
    Help,
    Lines,
    Screenshot,
    Capture,
    Camera(usize),
    Solve(Wish),
    Record,
    Play,
    Links,
    /// The picked material shines so many times as much.
    Emission(f32),
    /// The picked material's gloss is so many times as wide.
    Roughness(f32),
    Elements,
    Clusters,
    Gauge,
    /// Glossy light at pixels or at vertices.
    Pixels,
}

/// The command of a key; `repeat` where it is held down.
pub(super) fn command(code: KeyCode, key: &Key, repeat: bool) -> Option<Command> {
    // By what is printed on them where their places differ between keyboards.
    let printed = match key {
        Key::Character(text) => text.as_str(),
        _ => "",
    };
    Some(match (code, printed) {
        _ if *key == Key::Named(NamedKey::Escape) => Command::Leave,
        (_, "+" | "=") => Command::Expose(STOPS),
        (_, "-" | "_") => Command::Expose(-STOPS),
        (KeyCode::Backspace, _) => Command::AutomaticExposure,
        _ if repeat => return None,
        (_, "." | ">") => Command::Solve(Wish::Finer),
        (_, "," | "<") => Command::Solve(Wish::Coarser),
        (KeyCode::KeyP, _) => Command::Solve(Wish::Pause),
        (KeyCode::KeyX, _) => Command::Solve(Wish::Stop),
        (KeyCode::KeyR, _) => Command::Record,
        (KeyCode::KeyV, _) => Command::Play,
        (KeyCode::BracketLeft, _) => Command::Emission(EDIT_STEP.recip()),
        (KeyCode::BracketRight, _) => Command::Emission(EDIT_STEP),
        (KeyCode::Semicolon, _) => Command::Roughness(EDIT_STEP.recip()),
        (KeyCode::Quote, _) => Command::Roughness(EDIT_STEP),
        (KeyCode::KeyL, _) => Command::Links,
        (KeyCode::KeyM, _) => Command::Elements,
        (KeyCode::KeyB, _) => Command::Clusters,
        (KeyCode::KeyG, _) => Command::Gauge,
        (KeyCode::KeyK, _) => Command::Pixels,
        (KeyCode::KeyH | KeyCode::F1, _) => Command::Help,
        (KeyCode::KeyT, _) => Command::Lines,
        (KeyCode::KeyF | KeyCode::F12, _) => Command::Screenshot,
        (KeyCode::KeyC, _) => Command::Capture,
        _ => Command::Camera(CAMERA_KEYS.iter().position(|&k| k == code)?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_keys_repeat_only_where_it_makes_sense() {
        let dot = Key::Character(".".into());
        assert_eq!(command(KeyCode::Period, &dot, false), Some(Command::Solve(Wish::Finer)), "finer");
        assert_eq!(command(KeyCode::Period, &dot, true), None, "once per press");
        let plus = Key::Character("+".into());
        assert_eq!(command(KeyCode::BracketRight, &plus, true), Some(Command::Expose(STOPS)), "brighter and brighter");
        let none = Key::Character("3".into());
        assert_eq!(command(KeyCode::Digit3, &none, false), Some(Command::Camera(2)), "the third camera");
        assert_eq!(command(KeyCode::KeyJ, &Key::Character("j".into()), false), None, "J does nothing");
    }
}

//! Walking: keys and mouse to a moving [`View`].

use super::view::View;
use crate::display::Walkable;
use glam::DVec3;
use std::time::Duration;
use winit::keyboard::KeyCode;

/// Time to cross the scene at the initial speed, in seconds.
const CROSSING: f64 = 8.0;

/// Speed per notch of the mouse wheel.
const SPEED_STEP: f64 = 1.25;

/// A frame that took longer moves no further than this, so that a hitch is not a jump.
const LONGEST_STEP: Duration = Duration::from_millis(200);

/// Turning speed of the arrow keys in radians per second.
const KEY_TURN: f64 = 1.2;

/// What a held key does, in units of speed along the view's axes, or of turning.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    Forward(f64),
    Right(f64),
    Up(f64),
    Turn(f64),
}

/// The motion of a key, by its place on the keyboard; `None` for keys that do not move.
fn motion(key: KeyCode) -> Option<Motion> {
    Some(match key {
        KeyCode::KeyW | KeyCode::ArrowUp => Motion::Forward(1.0),
        KeyCode::KeyS | KeyCode::ArrowDown => Motion::Forward(-1.0),
        KeyCode::KeyD => Motion::Right(1.0),
        KeyCode::KeyA => Motion::Right(-1.0),
        KeyCode::KeyE | KeyCode::Space => Motion::Up(1.0),
        KeyCode::KeyQ | KeyCode::ShiftLeft | KeyCode::ShiftRight => Motion::Up(-1.0),
        KeyCode::ArrowRight => Motion::Turn(1.0),
        KeyCode::ArrowLeft => Motion::Turn(-1.0),
        _ => return None,
    })
}

/// The walking eye.
#[derive(Debug)]
pub(super) struct Walker {
    /// Where it is now.
    pub(super) view: View,
    /// Unit vertical.
    up: DVec3,
    /// Scene units per second at the initial speed.
    pace: f64,
    /// Notches of the mouse wheel.
    notches: f64,
    /// Moving keys that are down.
    held: Vec<KeyCode>,
}

impl Walker {
    /// At the first camera, or where the whole scene is in view.
    pub(super) fn new(walk: &dyn Walkable) -> Self {
        let mut walker = Self {
            view: View::around(DVec3::ZERO, DVec3::ONE, DVec3::Z),
            up: DVec3::Z,
            pace: 1.0,
            notches: 0.0,
            held: Vec::new(),
        };
        walker.enter(walk, true);
        walker
    }

    /// Goes on in another scene: from where a new walk begins, or from where it is.
    pub(super) fn enter(&mut self, walk: &dyn Walkable, from_start: bool) {
        let mesh = walk.mesh();
        self.up = walk.up().try_normalize().unwrap_or(DVec3::Z);
        let (low, high) = mesh.bounds();
        let (low, high) = (mesh.origin + low.as_dvec3(), mesh.origin + high.as_dvec3());
        let extent = walk.extent();
        self.pace = if extent > 0.0 { extent / CROSSING } else { 1.0 };
        if from_start {
            self.view = match walk.cameras().first() {
                Some((_, camera)) => View::of_camera(camera),
                None => View::around(low, high, self.up),
            };
        }
    }

    /// Takes a key; whether it is one that moves.
    pub(super) fn key(&mut self, key: KeyCode, down: bool) -> bool {
        let moves = motion(key).is_some();
        self.held.retain(|&k| k != key);
        if moves && down {
            self.held.push(key);
        }
        moves
    }

    /// Lets go of all keys, as when the window loses the keyboard.
    pub(super) fn release(&mut self) {
        self.held.clear();
    }

    /// Whether a held key keeps the eye moving.
    pub(super) fn is_moving(&self) -> bool {
        !self.held.is_empty()
    }

    /// Turns by angles in radians to the right and up.
    pub(super) fn turn(&mut self, right: f64, rise: f64) {
        self.view = self.view.turned(right, rise, self.up);
    }

    /// Changes the speed by notches of the mouse wheel, faster where positive.
    pub(super) fn change_speed(&mut self, notches: f64) {
        if notches.is_finite() {
            self.notches = (self.notches + notches).clamp(-40.0, 40.0);
        }
    }

    /// Scene units per second.
    pub(super) fn speed(&self) -> f64 {
        self.pace * SPEED_STEP.powf(self.notches)
    }

    /// Moves on by the time since the last frame.
    pub(super) fn advance(&mut self, time: Duration) {
        let seconds = time.min(LONGEST_STEP).as_secs_f64();
        let (mut step, mut turn) = (DVec3::ZERO, 0.0);
        for motion in self.held.iter().filter_map(|&key| motion(key)) {
            match motion {
                Motion::Forward(s) => step += self.view.forward * s,
                Motion::Right(s) => step += self.view.right * s,
                Motion::Up(s) => step += self.up * s,
                Motion::Turn(s) => turn += s,
            }
        }
        // Two keys at once are no faster than one.
        self.view.eye += step.normalize_or_zero() * (self.speed() * seconds);
        if turn != 0.0 {
            self.turn(turn * KEY_TURN * seconds, 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::DisplayMesh;
    use glam::Vec3;
    use glossy_ext::Rgb;
    use hr_scene::Camera;

    struct Hall {
        mesh: DisplayMesh,
        cameras: Vec<(String, Camera)>,
    }

    impl Walkable for Hall {
        fn name(&self) -> &str {
            "hall"
        }
        fn mesh(&self) -> &DisplayMesh {
            &self.mesh
        }
        fn cameras(&self) -> &[(String, Camera)] {
            &self.cameras
        }
        fn glossy_radiance(&self, _: DVec3, _: &[u32], _: &mut [Rgb]) {}
    }

    /// 8 long, so that the initial speed is 1 a second.
    fn walker() -> Walker {
        let mesh = DisplayMesh { positions: vec![Vec3::ZERO, Vec3::X * 8.0], ..DisplayMesh::default() };
        let camera = Camera {
            eye: [1.0, 0.0, 0.0],
            target: [2.0, 0.0, 0.0],
            up: [0.0, 0.1, 1.0],
            fov_x: 60.0,
            width: 4,
            height: 3,
        };
        Walker::new(&Hall { mesh, cameras: vec![("first".into(), camera)] })
    }

    #[test]
    fn keys_move_along_the_view() {
        let mut walker = walker();
        assert!(walker.key(KeyCode::KeyW, true) && walker.key(KeyCode::KeyD, true), "both move");
        assert!(!walker.key(KeyCode::KeyH, true), "H does not");
        walker.advance(Duration::from_millis(100));
        let moved = walker.view.eye - DVec3::X;
        assert!((moved.length() - 0.1).abs() < 1e-12, "0.1 s at 1 a second, diagonal or not: {moved}");
        assert!(moved.x > 0.0 && moved.y < 0.0, "forward is x, right is −y: {moved}");
        walker.key(KeyCode::KeyW, false);
        assert!(walker.is_moving(), "D is still down");
        walker.release();
        assert!(!walker.is_moving(), "nothing is");
    }

    #[test]
    fn a_hitch_is_no_jump_and_the_wheel_sets_the_speed() {
        let mut walker = walker();
        walker.key(KeyCode::KeyE, true);
        walker.change_speed(2.0);
        walker.change_speed(f64::NAN);
        walker.advance(Duration::from_secs(100));
        let expected = 0.2 * SPEED_STEP.powi(2);
        assert!((walker.view.eye.z - expected).abs() < 1e-9, "climbed {}, not {expected}", walker.view.eye.z);
    }
}

//! Camera paths: walks that were recorded, to be played again, filmed or measured.
//!
//! The file is JSON: a list of [cameras](hr_scene::Camera), each with the `seconds` since the start at which it is
//! reached, in ascending order.

use glam::DVec3;
use hr_scene::whole_file::write_whole;
use hr_scene::{Camera, SceneError};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

/// Keys closer in time than this (seconds) add nothing that can be seen.
const CLOSEST: f64 = 1.0 / 30.0;

/// One camera of a path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Key {
    /// Since the start.
    seconds: f64,
    #[serde(flatten)]
    camera: Camera,
}

/// Cameras and when they are reached.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraPath {
    /// Ascending in time.
    keys: Vec<Key>,
}

impl CameraPath {
    /// Through some cameras in a number of seconds (> 0), evenly.
    #[must_use]
    pub fn through(cameras: &[Camera], seconds: f64) -> Self {
        let steps = cameras.len().saturating_sub(1).max(1) as f64;
        let key = |(i, camera): (usize, &Camera)| Key { seconds: seconds * i as f64 / steps, camera: *camera };
        Self { keys: cameras.iter().enumerate().map(key).collect() }
    }

    /// Reads a path from a file.
    ///
    /// # Errors
    /// [`SceneError::Io`] where the file cannot be read, [`SceneError::Syntax`] where it is no path, is empty, runs back
    /// in time, or has a camera that does not [check](Camera::check).
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Io { path: path.to_owned(), source })?;
        Self::from_json(&text, &path.display().to_string())
    }

    fn from_json(text: &str, file: &str) -> Result<Self, SceneError> {
        let wrong = |place: String, what: &str, mend: &str| {
            Err(SceneError::Syntax { place, what: what.to_owned(), mend: mend.to_owned() })
        };
        let keys: Vec<Key> = match serde_json::from_str(text.trim_start_matches('\u{feff}')) {
            Ok(keys) => keys,
            Err(e) => {
                let text = e.to_string();
                let what = text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what);
                let mend = r#"a path is [{"seconds":0,"eye":…},…], each a camera; record one with R in the window"#;
                return wrong(format!("{file}:{}:{}", e.line(), e.column()), what, mend);
            }
        };
        if keys.is_empty() {
            return wrong(file.to_owned(), "there is no camera in it", "record a path with R in the window");
        }
        let mut before = 0.0;
        for (at, key) in keys.iter().enumerate() {
            let place = format!("{file}: [{at}]");
            if !(key.seconds >= before && key.seconds < 1e9) {
                let mend = "give seconds that ascend from 0 and stay below 1e9";
                return wrong(place, &format!("seconds is {} after {before}", key.seconds), mend);
            }
            before = key.seconds;
            key.camera.check(&place)?;
        }
        Ok(Self { keys })
    }

    /// Writes the path, whole or not at all.
    ///
    /// # Errors
    /// [`SceneError::Io`] where it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SceneError> {
        write_whole(path, |out| {
            // A key per line: small enough, and readable.
            for (i, key) in self.keys.iter().enumerate() {
                out.write_all(if i == 0 { b"[" } else { b",\n " })?;
                serde_json::to_writer(&mut *out, key)?;
            }
            writeln!(out, "]")
        })
    }

    /// Adds a camera at the end. Where it comes too soon after the last one it takes the last one's place.
    pub fn push(&mut self, seconds: f64, camera: Camera) {
        let mut seconds = seconds.max(0.0);
        if let [.., before, last] = &self.keys[..]
            && last.seconds - before.seconds < CLOSEST
        {
            self.keys.pop();
        }
        if let Some(last) = self.keys.last() {
            seconds = seconds.max(last.seconds);
        }
        self.keys.push(Key { seconds, camera });
    }

    /// Whether there is nothing to show.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Seconds from the start to the last camera.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.keys.last().map_or(0.0, |key| key.seconds)
    }

    /// The camera at a time: between two of them the straight way, directions turned evenly. Before the first and after
    /// the last one these; `None` for an empty path.
    #[must_use]
    pub fn at(&self, seconds: f64) -> Option<Camera> {
        let after = self.keys.partition_point(|key| key.seconds <= seconds);
        let (Some(before), Some(next)) = (self.keys.get(after.max(1) - 1), self.keys.get(after)) else {
            return self.keys.last().map(|key| key.camera);
        };
        let (a, b) = (&before.camera, &next.camera);
        let span = next.seconds - before.seconds;
        let t = if span > 0.0 { ((seconds - before.seconds) / span).clamp(0.0, 1.0) } else { 0.0 };
        let mix = |a: f64, b: f64| a + (b - a) * t;
        let mixed = |a: [f64; 3], b: [f64; 3]| DVec3::from(a).lerp(DVec3::from(b), t);
        let reach = |c: &Camera| (DVec3::from(c.target) - DVec3::from(c.eye)).length();
        let forward = |c: &Camera| (DVec3::from(c.target) - DVec3::from(c.eye)).normalize_or_zero();
        // Opposite directions have no middle: then the first one stays until the second one comes.
        let ahead = forward(a).lerp(forward(b), t).try_normalize().unwrap_or(forward(a));
        let up = mixed(a.up, b.up);
        let eye = mixed(a.eye, b.eye);
        let camera = Camera {
            eye: eye.to_array(),
            target: (eye + ahead * mix(reach(a), reach(b))).to_array(),
            up: up.to_array(),
            fov_x: mix(a.fov_x, b.fov_x),
            width: a.width,
            height: a.height,
        };
        // Where two cameras are upside down to each other, what is between them may be none.
        Some(if camera.check("").is_ok() { camera } else { *a })
    }

    /// So many cameras, evenly in time.
    #[must_use]
    pub fn cameras(&self, count: usize) -> Vec<Camera> {
        let steps = count.saturating_sub(1).max(1) as f64;
        (0..count).filter_map(|i| self.at(self.seconds() * i as f64 / steps)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(x: f64, target: [f64; 3]) -> Camera {
        Camera { eye: [x, 0.0, 0.0], target, up: [0.0, 0.0, 1.0], fov_x: 60.0, width: 64, height: 40 }
    }

    #[test]
    fn between_two_cameras_there_is_a_way() {
        let path = CameraPath::through(&[camera(0.0, [1.0, 0.0, 0.0]), camera(2.0, [2.0, 1.0, 0.0])], 4.0);
        assert_eq!(path.seconds(), 4.0, "seconds");
        let middle = path.at(2.0).expect("a camera");
        assert_eq!(middle.eye, [1.0, 0.0, 0.0], "half the way");
        let ahead = DVec3::from(middle.target) - DVec3::from(middle.eye);
        assert!((ahead - DVec3::new(0.5, 0.5, 0.0).normalize()).length() < 1e-12, "half the turn: {ahead}");
        assert_eq!(path.at(-1.0).map(|c| c.eye[0]), Some(0.0), "before the start");
        assert_eq!(path.at(9.0).map(|c| c.eye[0]), Some(2.0), "after the end");
        assert_eq!(path.cameras(3).len(), 3, "three frames");
        assert_eq!(CameraPath::default().at(0.0), None, "nothing from nothing");
        let turn = CameraPath::through(&[camera(0.0, [1.0, 0.0, 0.0]), camera(0.0, [-1.0, 0.0, 0.0])], 1.0);
        assert_eq!(turn.at(0.5).map(|c| c.check("c").is_ok()), Some(true), "about-turns have no middle, but a camera");
    }

    #[test]
    fn files_give_back_what_was_recorded() {
        let mut path = CameraPath::default();
        for i in 0..100_u32 {
            path.push(0.01 * f64::from(i), camera(f64::from(i), [1e3, 0.0, 0.0]));
        }
        assert!(path.keys.len() < 40, "what adds nothing is left out: {} keys", path.keys.len());
        assert_eq!(path.at(9.0).map(|c| c.eye[0]), Some(99.0), "the last one stays");
        let file = std::env::temp_dir().join(format!("hr-view-path-{}.json", std::process::id()));
        path.save(&file).expect("written");
        let again = CameraPath::load(&file);
        drop(std::fs::remove_file(&file));
        assert_eq!(again.expect("its own output"), path, "round trip");
    }

    #[test]
    fn mistakes_say_where_and_how_to_mend() {
        let good = r#"[{"seconds":0,"eye":[0,0,0],"target":[1,0,0],"up":[0,0,1],"fov_x":60,"width":4,"height":3},
            {"seconds":1,"eye":[0,0,0],"target":[1,0,0],"up":[0,0,1],"fov_x":60,"width":4,"height":3}]"#;
        assert!(CameraPath::from_json(good, "p").is_ok(), "a good one");
        for (text, place, hint) in [
            (String::new(), "p:1:", "seconds"),
            ("[]".to_owned(), "p", "record"),
            ("{}".to_owned(), "p:1:", "record"),
            (good.replace(r#""seconds":1"#, r#""seconds":-1"#), "p: [1]", "ascend"),
            (good.replace(r#""fov_x":60"#, r#""fov_x":0"#), "p: [0]: fov_x", "between 0 and 180"),
            (good.replace(r#""seconds":0,"#, ""), "p:", "seconds"),
        ] {
            let error = CameraPath::from_json(&text, "p").expect_err(&text).to_string();
            assert!(error.starts_with(place) && error.contains(hint), "{text} gives '{error}'");
        }
    }
}

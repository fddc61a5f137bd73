//! Recording a walk and playing it.

use crate::camera_path::CameraPath;
use hr_scene::Camera;
use std::path::PathBuf;
use std::time::Instant;

/// What is going on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Doing {
    Nothing,
    /// Since when.
    Recording(Instant),
    Playing(Instant),
}

/// A walk that was recorded or given, and what is done with it.
#[derive(Debug)]
pub(super) struct Tour {
    path: CameraPath,
    doing: Doing,
    /// Where recordings go; else to numbered files of the current folder.
    file: Option<PathBuf>,
}

impl Tour {
    /// With a path to play, and a file that takes recordings.
    pub(super) fn new(path: CameraPath, file: Option<PathBuf>) -> Self {
        Self { path, doing: Doing::Nothing, file }
    }

    /// Whether there is nothing to play yet.
    pub(super) fn is_empty(&self) -> bool {
        self.path.is_empty()
    }

    /// Sets what is played as long as nothing is recorded.
    pub(super) fn suggest(&mut self, path: CameraPath) {
        self.path = path;
    }

    pub(super) fn is_playing(&self) -> bool {
        matches!(self.doing, Doing::Playing(_))
    }

    /// Begins to record, or ends and saves; what the user is told about it.
    pub(super) fn record(&mut self, now: Instant, camera: Camera) -> String {
        if let Doing::Recording(since) = self.doing {
            self.path.push((now - since).as_secs_f64(), camera);
            self.doing = Doing::Nothing;
            return self.save();
        }
        self.path = CameraPath::default();
        self.path.push(0.0, camera);
        self.doing = Doing::Recording(now);
        "recording; R ends and saves it".to_owned()
    }

    fn save(&self) -> String {
        let numbered = || super::unused("hr-view-path", "json");
        let Some(file) = self.file.clone().or_else(numbered) else { return "no name is free to save it".to_owned() };
        match self.path.save(&file) {
            Ok(()) => format!("saved {:.1} s as {}; V plays it", self.path.seconds(), super::full(&file).display()),
            // It can still be played.
            Err(error) => error.to_string(),
        }
    }

    /// Begins to play, or ends; what the user is told about it.
    pub(super) fn play(&mut self, now: Instant) -> String {
        match self.doing {
            Doing::Recording(_) => return "still recording; R ends it".to_owned(),
            Doing::Playing(_) => {
                self.doing = Doing::Nothing;
                return "stopped".to_owned();
            }
            Doing::Nothing => {}
        }
        if self.path.is_empty() {
            return "there is no walk to play; R records one".to_owned();
        }
        self.doing = Doing::Playing(now);
        format!("playing {:.1} s", self.path.seconds())
    }

    /// Ends playing, as when the user walks on.
    pub(super) fn take_over(&mut self) {
        if self.is_playing() {
            self.doing = Doing::Nothing;
        }
    }

    /// Where the eye is while playing; ends at the end.
    pub(super) fn camera(&mut self, now: Instant) -> Option<Camera> {
        let Doing::Playing(since) = self.doing else { return None };
        let seconds = (now - since).as_secs_f64();
        if seconds >= self.path.seconds() {
            self.doing = Doing::Nothing;
        }
        self.path.at(seconds)
    }

    /// Takes note of where the eye is, if that is recorded.
    pub(super) fn note(&mut self, now: Instant, camera: impl FnOnce() -> Camera) {
        if let Doing::Recording(since) = self.doing {
            self.path.push((now - since).as_secs_f64(), camera());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn what_is_recorded_is_saved_and_played() {
        let file = std::env::temp_dir().join(format!("hr-view-tour-{}.json", std::process::id()));
        let mut tour = Tour::new(CameraPath::default(), Some(file.clone()));
        let camera = |x| Camera {
            eye: [x, 0.0, 0.0],
            target: [9.0, 0.0, 0.0],
            up: [0.0, 0.0, 1.0],
            fov_x: 60.0,
            width: 4,
            height: 3,
        };
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs_f64(seconds);
        assert!(tour.play(start).contains("R records"), "nothing to play yet");
        tour.record(start, camera(0.0));
        assert!(tour.play(at(0.1)).contains("still recording"), "one after the other");
        tour.note(at(1.0), || camera(1.0));
        let said = tour.record(at(2.0), camera(3.0));
        let saved = CameraPath::load(&file);
        drop(std::fs::remove_file(&file));
        assert!(said.contains("saved 2.0 s"), "{said}");
        assert_eq!(saved.expect("saved"), tour.path, "what was saved");
        tour.play(at(10.0));
        assert_eq!(tour.camera(at(11.5)).map(|c| c.eye[0]), Some(2.0), "half the way from 1 to 3");
        assert!(tour.is_playing(), "not over");
        assert_eq!(tour.camera(at(12.5)).map(|c| c.eye[0]), Some(3.0), "the end");
        assert!(!tour.is_playing() && tour.camera(at(13.0)).is_none(), "over");
    }
}

//! Pinhole cameras: their JSON form, and what makes one usable.

use crate::SceneError;
use glam::{DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Largest image side in pixels.
pub const MAX_SIDE: u32 = 16384;

/// Sine of the angle between the view direction and `up` below which they count as parallel.
const MIN_SINE_TO_UP: f64 = 1e-6;

/// A pinhole camera: square pixels, row 0 on top, not mirrored. The JSON form has the same fields.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Where the eye is, in scene units.
    pub eye: [f64; 3],
    /// What it looks at.
    pub target: [f64; 3],
    /// Roughly up.
    pub up: [f64; 3],
    /// Horizontal field of view in degrees, > 0, < 180.
    pub fov_x: f64,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
}

impl Camera {
    /// Whether this stands for a file rather than for the name of a [scene's camera](crate::Scene::camera_named): there is one, or it ends in
    /// `.json`.
    #[must_use]
    pub fn is_file(name: &Path) -> bool {
        name.is_file() || name.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
    }

    /// Reads a camera from a JSON file and [checks](Self::check) it.
    ///
    /// # Errors
    /// [`SceneError::Io`] where the file cannot be read, [`SceneError::Syntax`] where it is not such a camera.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let text = std::fs::read_to_string(path).map_err(|source| SceneError::Io { path: path.to_owned(), source })?;
        Self::from_json(&text, &path.display().to_string())
    }

    /// Reads a camera from JSON text and [checks](Self::check) it. `place` names the text in errors.
    ///
    /// # Errors
    /// [`SceneError::Syntax`] with line and column where the text is not such a camera.
    pub fn from_json(text: &str, place: &str) -> Result<Self, SceneError> {
        let camera: Self = serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|e| {
            // The position is part of the place; serde_json would repeat it at the end of its message.
            let message = e.to_string();
            let what = message.rsplit_once(" at line ").map_or(message.as_str(), |(what, _)| what);
            SceneError::Syntax {
                place: format!("{place}:{}:{}", e.line(), e.column()),
                what: what.to_owned(),
                mend:
                    r#"a camera is {"eye":[x,y,z],"target":[x,y,z],"up":[x,y,z],"fov_x":degrees,"width":w,"height":h}"#
                        .to_owned(),
            }
        })?;
        camera.check(place)?;
        Ok(camera)
    }

    /// Whether pictures can be taken with this camera: finite numbers, eye and target apart, `up` not along the view,
    /// 0 < `fov_x` < 180, both sides of the image 1…[`MAX_SIDE`] pixels. `place` names the camera in errors.
    ///
    /// # Errors
    /// [`SceneError::Syntax`] that names the field and says what it should be.
    pub fn check(&self, place: &str) -> Result<(), SceneError> {
        let wrong = |field: &str, what: String, mend: &str| {
            Err(SceneError::Syntax { place: format!("{place}: {field}"), what, mend: mend.to_owned() })
        };
        for (field, v) in [("eye", self.eye), ("target", self.target), ("up", self.up)] {
            if !v.iter().all(|c| c.is_finite()) {
                return wrong(field, format!("{v:?} is not finite"), "give three finite numbers");
            }
        }
        let forward = unit(DVec3::from(self.target) - DVec3::from(self.eye));
        if forward == DVec3::ZERO {
            return wrong("target", "it is where the eye is".into(), "move the target to a point in front of the eye");
        }
        let sine = forward.cross(unit(self.up.into())).length();
        if sine < MIN_SINE_TO_UP {
            let mend = "give a direction that is not along the view, such as [0,0,1] where z is up";
            return wrong("up", format!("{:?} is zero or along the view direction", self.up), mend);
        }
        if !(self.fov_x > 0.0 && self.fov_x < 180.0) {
            return wrong("fov_x", format!("{} is out of range", self.fov_x), "give degrees between 0 and 180");
        }
        for (field, side) in [("width", self.width), ("height", self.height)] {
            if !(1..=MAX_SIDE).contains(&side) {
                return wrong(field, format!("{side} pixels"), &format!("give 1 to {MAX_SIDE} pixels"));
            }
        }
        Ok(())
    }

    /// Right, up and forward unit vectors; zero where the camera does not pass [`check`](Self::check).
    #[must_use]
    pub fn frame(&self) -> (DVec3, DVec3, DVec3) {
        let forward = unit(DVec3::from(self.target) - DVec3::from(self.eye));
        let right = unit(forward.cross(unit(self.up.into())));
        (right, right.cross(forward), forward)
    }

    /// Unit direction through the image point (x, y) in pixels from the upper left corner. Of many of them
    /// [`rays`](Self::rays) costs less.
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        self.rays().direction(x, y)
    }

    /// The rays of its picture.
    #[must_use]
    pub fn rays(&self) -> Rays {
        let (right, up, forward) = self.frame();
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        let pixel = 2.0 * (0.5 * self.fov_x.to_radians()).tan() / width;
        let corner = forward + (up * height - right * width) * (0.5 * pixel);
        Rays { corner, right: right * pixel, down: -up * pixel }
    }
}

/// The rays of a camera's picture: what all of its directions have in common.
#[derive(Clone, Copy, Debug)]
pub struct Rays {
    /// Toward the upper left corner of the picture at distance 1.
    corner: DVec3,
    /// To the next pixel.
    right: DVec3,
    down: DVec3,
}

impl Rays {
    /// Unit direction through the image point (x, y) in pixels from the upper left corner.
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        (self.corner + self.right * x + self.down * y).normalize()
    }

    /// How wide a pixel is in the middle of the picture at distance 1.
    #[must_use]
    pub fn pixel(&self) -> f32 {
        self.right.length() as f32
    }

    /// The same through a place (0…1) within a pixel.
    #[must_use]
    pub fn within(&self, x: usize, y: usize, place: Vec2) -> Vec3 {
        self.direction(x as f64 + f64::from(place.x), y as f64 + f64::from(place.y)).as_vec3()
    }
}

/// Unit vector of any finite one, however long or short; zero stays zero.
pub(crate) fn unit(v: DVec3) -> DVec3 {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).normalize() } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"{"eye":[0,-3,1.5],"target":[0,0,1],"up":[0,0,1],"fov_x":60,"width":640,"height":400}"#;

    #[test]
    fn good_camera_is_read() {
        let camera = Camera::from_json(GOOD, "c.json").expect("a good camera");
        assert_eq!(camera.eye, [0.0, -3.0, 1.5], "eye");
        assert_eq!((camera.width, camera.height), (640, 400), "size");
        let again = serde_json::to_string(&camera).expect("cameras serialise");
        assert_eq!(Camera::from_json(&again, "c.json").expect("own output"), camera, "round trip");
    }

    #[test]
    fn wrong_cameras_say_where_and_how_to_mend() {
        for (from, to, place, hint) in [
            (r#""target":[0,0,1]"#, r#""target":[0,-3,1.5]"#, "c.json: target", "in front of the eye"),
            (r#""target":[0,0,1]"#, r#""target":[0,-3,9]"#, "c.json: up", "not along the view"),
            (r#""up":[0,0,1]"#, r#""up":[0,0,0]"#, "c.json: up", "not along the view"),
            (r#""fov_x":60"#, r#""fov_x":180"#, "c.json: fov_x", "between 0 and 180"),
            (r#""fov_x":60"#, r#""fov_x":0"#, "c.json: fov_x", "between 0 and 180"),
            (r#""width":640"#, r#""width":0"#, "c.json: width", "1 to 16384"),
            (r#""height":400"#, r#""height":16385"#, "c.json: height", "1 to 16384"),
            (r#""height":400"#, r#""height":-4"#, "c.json:1:", "a camera is"),
            (r#""eye":[0,-3,1.5]"#, r#""eye":[0,-3]"#, "c.json:1:", "a camera is"),
            (r#""eye":[0,-3,1.5],"#, "", "c.json:1:", "missing field `eye`"),
            (r#""eye":[0,-3,1.5]"#, r#""eye":[1e999,0,0]"#, "c.json:1:", "out of range"),
        ] {
            let text = GOOD.replace(from, to);
            assert_ne!(text, GOOD, "the test changes the text");
            let error = Camera::from_json(&text, "c.json").expect_err(&text).to_string();
            assert!(error.starts_with(place) && error.contains(hint), "{text} gives '{error}'");
            assert!(!error.contains('\n'), "one line: '{error}'");
        }
    }

    #[test]
    fn not_finite_numbers_are_refused() {
        let good = Camera::from_json(GOOD, "c.json").expect("a good camera");
        let nan = f64::NAN;
        for camera in [
            Camera { eye: [nan, 0.0, 0.0], ..good },
            Camera { up: [0.0, 0.0, f64::INFINITY], ..good },
            Camera { fov_x: nan, ..good },
        ] {
            assert!(camera.check("c").is_err(), "{camera:?} must not pass");
        }
        let far = Camera { eye: [1e300, 0.0, 0.0], target: [-1e300, 0.0, 0.0], ..good };
        assert!(far.check("c").is_ok(), "far apart is no error: directions do not overflow");
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = Camera::load(Path::new("no-such-camera.json")).expect_err("there is none").to_string();
        assert!(error.contains("no-such-camera.json"), "'{error}' names the file");
    }
}

//! Where the eye is and what it sees.

use super::sight::Sight;
use glam::DVec3;
use hr_scene::Camera;
use hr_scene::camera::MAX_SIDE;

/// Directions closer to the vertical than this (radians) are not looked in: the horizon would flip.
const STEEPEST: f64 = 0.01;

/// An eye with its directions of view, in scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    /// Where it is.
    pub(super) eye: DVec3,
    /// Unit vector to the right of the picture.
    pub(super) right: DVec3,
    /// Unit vector to the top of the picture.
    pub(super) up: DVec3,
    /// Unit vector into the picture.
    pub(super) forward: DVec3,
    /// Horizontal field of view in degrees of the picture that is always seen whole.
    pub(super) fov_x: f64,
    /// Width / height of that picture. A window of another shape shows more, at the sides or above and below.
    pub(super) shape: f64,
}

impl View {
    /// From `eye` along `forward`, with `up` roughly up; any length, and any direction where they are degenerate.
    /// `shape` is > 0.
    pub(super) fn looking(eye: DVec3, forward: DVec3, up: DVec3, fov_x: f64, shape: f64) -> Self {
        let forward = forward.try_normalize().unwrap_or(DVec3::X);
        let up = up.try_normalize().unwrap_or(DVec3::Z);
        let right = forward.cross(up);
        let right = if right.length() < 1e-9 { forward.any_orthonormal_vector() } else { right.normalize() };
        let fov_x = if fov_x.is_finite() { fov_x.clamp(1.0, 170.0) } else { 60.0 };
        let eye = if eye.is_finite() { eye } else { DVec3::ZERO };
        Self { eye, right, up: right.cross(forward), forward, fov_x, shape }
    }

    /// What a camera shows.
    pub(super) fn of_camera(camera: &Camera) -> Self {
        let (eye, target) = (DVec3::from(camera.eye), DVec3::from(camera.target));
        let shape = f64::from(camera.width.max(1)) / f64::from(camera.height.max(1));
        Self::looking(eye, target - eye, camera.up.into(), camera.fov_x, shape)
    }

    /// A camera whose picture of this size (pixels, ≥ 1) shows what a window of the size shows.
    pub(super) fn camera(&self, [width, height]: [u32; 2]) -> Camera {
        let [width, height] = [width.clamp(1, MAX_SIDE), height.clamp(1, MAX_SIDE)];
        Camera {
            eye: self.eye.to_array(),
            // Far from zero a step of 1 would be lost.
            target: (self.eye + self.forward * (1e-6 * self.eye.length()).max(1.0)).to_array(),
            up: self.up.to_array(),
            fov_x: self.breadth(f64::from(width) / f64::from(height)).to_degrees(),
            width,
            height,
        }
    }

    /// From outside at a box with these corners, the whole of it in the picture.
    pub(super) fn around(low: DVec3, high: DVec3, up: DVec3) -> Self {
        let aside = up.any_orthonormal_vector();
        let from = (aside * 2.0 + up.cross(aside) + up).normalize();
        let center = 0.5 * (low + high);
        let radius = (0.5 * (high - low).length()).max(f64::MIN_POSITIVE);
        // A sphere at 4.5 radii takes 25.7°.
        Self::looking(center + from * (4.5 * radius), -from, up, 26.0, 1.0)
    }

    /// Turns by angles in radians to the right and up, about the vertical `up`; levels the horizon.
    pub(super) fn turned(&self, right: f64, rise: f64, up: DVec3) -> Self {
        let pitch = self.forward.dot(up).clamp(-1.0, 1.0).asin() + rise;
        let limit = std::f64::consts::FRAC_PI_2 - STEEPEST;
        let pitch = pitch.clamp(-limit, limit);
        // Looking along the vertical, the top of the picture says where forward is.
        let level = |v: DVec3| (v - up * v.dot(up)).try_normalize().filter(|_| (v - up * v.dot(up)).length() > 1e-6);
        let ahead = level(self.forward)
            .or_else(|| level(self.up * -self.forward.dot(up).signum()))
            .unwrap_or_else(|| up.any_orthonormal_vector());
        let (sin, cos) = right.sin_cos();
        let ahead = ahead * cos + ahead.cross(up) * sin;
        Self::looking(self.eye, ahead * pitch.cos() + up * pitch.sin(), up, self.fov_x, self.shape)
    }

    /// Horizontal and vertical scale of the projection (cotangents of half the fields of view) for a picture of
    /// width / height `aspect`.
    pub(super) fn scales(&self, aspect: f64) -> [f64; 2] {
        let x = 1.0 / (0.5 * self.fov_x.to_radians()).tan();
        if aspect > self.shape { [x * self.shape / aspect, x * self.shape] } else { [x, x * aspect] }
    }

    /// Angle in radians from the left to the right edge of a picture of width / height `aspect`.
    pub(super) fn breadth(&self, aspect: f64) -> f64 {
        2.0 * self.scales(aspect)[0].recip().atan()
    }

    /// Direction (any length) through a point in pixels from the upper left corner of a picture of a size.
    pub(super) fn direction(&self, [x, y]: [f64; 2], size: [u32; 2]) -> DVec3 {
        let [width, height] = size.map(|side| f64::from(side.max(1)));
        let [sx, sy] = self.scales(width / height);
        self.forward + self.right * ((2.0 * x / width - 1.0) / sx) + self.up * ((1.0 - 2.0 * y / height) / sy)
    }

    /// The part of space that a picture of width / height `aspect` shows, relative to `origin`.
    pub(super) fn sight(&self, origin: DVec3, aspect: f64) -> Sight {
        let [x, y] = self.scales(aspect);
        let side = |across: DVec3, scale: f64| (self.forward + across * scale).normalize().as_vec3();
        Sight {
            eye: (self.eye - origin).as_vec3(),
            sides: [side(self.right, x), side(-self.right, x), side(self.up, y), side(-self.up, y)],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_bound_the_field_of_view() {
        let view = View::looking(DVec3::ZERO, DVec3::X, DVec3::Z, 90.0, 2.0);
        let inside =
            |p: DVec3, aspect: f64| view.sight(DVec3::ZERO, aspect).sides.iter().all(|s| s.dot(p.as_vec3()) >= 0.0);
        assert!(inside(DVec3::new(1.0, 0.99, 0.0), 2.0), "just left of the right edge");
        assert!(!inside(DVec3::new(1.0, 1.01, 0.0), 2.0), "just beyond it");
        // Twice as wide as high: the tangent of half the vertical angle is 1/2.
        assert!(inside(DVec3::new(1.0, 0.0, 0.49), 2.0), "just below the top");
        assert!(!inside(DVec3::new(1.0, 0.0, 0.51), 2.0), "just above it");
        assert!(!inside(DVec3::NEG_X, 2.0), "behind");
    }

    #[test]
    fn windows_of_any_shape_show_the_whole_picture_of_a_camera() {
        for (width, height) in [(64, 64), (30, 90), (160, 100), (200, 20)] {
            let camera = Camera {
                eye: [1.0, 2.0, 3.0],
                target: [4.0, 1.0, 2.0],
                up: [0.0, 0.0, 1.0],
                fov_x: 50.0,
                width,
                height,
            };
            let view = View::of_camera(&camera);
            let shape = f64::from(width) / f64::from(height);
            for aspect in [0.2, 1.0, 1.6, 4.0, shape] {
                let sides = view.sight(view.eye, aspect).sides;
                // By a share of the picture inside or outside of its edge.
                let sees = |x: f64, y: f64| {
                    let [x, y] = [x * f64::from(width), y * f64::from(height)];
                    sides.iter().all(|side| side.dot(camera.direction(x, y).as_vec3()) >= 0.0)
                };
                let what = format!("{width} × {height} in a window of {aspect}");
                assert!(sees(0.01, 0.01) && sees(0.99, 0.99) && sees(0.99, 0.01), "{what}: all is seen");
                assert_eq!(sees(0.5, 1.01), aspect < shape, "{what}: more above and below only in higher windows");
                assert_eq!(sees(1.01, 0.5), aspect > shape, "{what}: more at the sides only in wider ones");
            }
            assert!((view.breadth(shape).to_degrees() - 50.0).abs() < 1e-9, "its own breadth in its own shape");
        }
    }

    #[test]
    fn cameras_show_what_the_window_shows() {
        let eye = DVec3::new(4e6, -2e6, 1e3);
        let view = View::looking(eye, DVec3::new(1.0, 2.0, 0.3), DVec3::Z, 70.0, 1.6);
        for size in [[640, 400], [300, 900], [1, 1], [2000, 100]] {
            let camera = view.camera(size);
            assert!(camera.check("c").is_ok(), "{size:?}: {camera:?}");
            let again = View::of_camera(&camera);
            let aspect = f64::from(size[0]) / f64::from(size[1]);
            assert!((again.forward - view.forward).length() < 1e-8, "{size:?}: {} {}", again.forward, view.forward);
            let off = (again.breadth(aspect) - view.breadth(aspect)).abs();
            assert!(off < 1e-9, "{size:?}: the breadth is off by {off}");
            let at = [0.3, 0.8].map(|share| share * f64::from(size[0].min(size[1])));
            let turn = view.direction(at, size).normalize() - camera.direction(at[0], at[1]);
            assert!(turn.length() < 1e-8, "{size:?}: the same pixel looks the same way, not {turn} off");
        }
    }

    #[test]
    fn turning_keeps_the_horizon_and_stops_short_of_the_pole() {
        let view = View::looking(DVec3::ZERO, DVec3::X, DVec3::new(0.0, 0.3, 1.0), 60.0, 1.6);
        let right = view.turned(std::f64::consts::FRAC_PI_2, 0.0, DVec3::Z);
        assert!((right.forward - DVec3::NEG_Y).length() < 1e-12, "right of x, z up, is −y: {}", right.forward);
        assert!(right.right.z.abs() < 1e-12, "the camera's roll is gone");
        let high = view.turned(0.0, 9.0, DVec3::Z);
        assert!(high.forward.z > 0.99 && high.forward.x > 0.0, "not over the top: {}", high.forward);
        let down = View::looking(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 60.0, 1.6).turned(0.0, 0.5, DVec3::Z);
        assert!(down.forward.y > 0.0 && down.forward.is_finite(), "from straight down, up is toward the top: {down:?}");
    }

    #[test]
    fn degenerate_cameras_still_see() {
        for (forward, up) in [(DVec3::ZERO, DVec3::ZERO), (DVec3::Z, DVec3::Z), (DVec3::NAN, DVec3::X)] {
            let view = View::looking(DVec3::NAN, forward, up, f64::NAN, 1.6);
            assert!(view.right.is_finite() && view.up.is_finite() && view.eye.is_finite(), "{forward} {up}: {view:?}");
        }
    }

    #[test]
    fn the_whole_box_is_seen_from_outside() {
        let (low, high) = (DVec3::new(-3.0, 0.0, 5.0), DVec3::new(1.0, 2.0, 6.0));
        let view = View::around(low, high, DVec3::Y);
        for aspect in [0.5, 1.6, 3.0] {
            let sight = view.sight(DVec3::ZERO, aspect);
            for corner in 0..8 {
                let pick = |bit: i32, a: f64, b: f64| if corner & bit == 0 { a } else { b };
                let p = DVec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z));
                let seen = sight.sides.iter().all(|s| s.dot(p.as_vec3() - sight.eye) >= 0.0);
                assert!(seen, "corner {p} is outside a picture of {aspect}");
            }
        }
    }
}

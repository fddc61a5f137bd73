//! Pinhole cameras.

use glam::DVec3;
use serde::{Deserialize, Serialize};

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
    /// Right, up and forward unit vectors.
    #[must_use]
    pub fn frame(&self) -> (DVec3, DVec3, DVec3) {
        let forward = (DVec3::from(self.target) - DVec3::from(self.eye)).normalize();
        let right = forward.cross(DVec3::from(self.up)).normalize();
        (right, right.cross(forward), forward)
    }

    /// Unit direction through the image point (x, y) in pixels from the upper left corner.
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        let (right, up, forward) = self.frame();
        let half = (self.fov_x.to_radians() * 0.5).tan();
        let scale = 2.0 * half / f64::from(self.width);
        let sx = (x - 0.5 * f64::from(self.width)) * scale;
        let sy = (0.5 * f64::from(self.height) - y) * scale;
        (forward + right * sx + up * sy).normalize()
    }
}

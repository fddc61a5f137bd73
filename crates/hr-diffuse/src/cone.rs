//! Cones of directions: the currency of every directional bound.

use glam::Vec3;

/// A set of directions: all unit vectors within an angle of an axis.
///
/// `cos_angle` is in −1…1; −1 is the whole sphere.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Cone {
    /// Unit axis.
    pub axis: Vec3,
    /// Cosine of the half-angle.
    pub cos_angle: f32,
}

impl Cone {
    /// Every direction.
    pub const SPHERE: Self = Self { axis: Vec3::Z, cos_angle: -1.0 };

    /// A single direction (unit length).
    #[must_use]
    pub fn single(axis: Vec3) -> Self {
        Self { axis, cos_angle: 1.0 }
    }

    /// Half-angle in radians, 0…π.
    #[must_use]
    pub fn angle(&self) -> f32 {
        self.cos_angle.clamp(-1.0, 1.0).acos()
    }

    /// Smallest and largest cosine between any member and the unit vector `v`.
    #[must_use]
    pub fn cosines(&self, v: Vec3) -> (f32, f32) {
        let between = self.axis.dot(v).clamp(-1.0, 1.0).acos();
        let half = self.angle();
        let low = (between + half).min(std::f32::consts::PI).cos();
        let high = (between - half).max(0.0).cos();
        (low, high)
    }

    /// Smallest and largest cosine between members of two cones.
    #[must_use]
    pub fn cosines_with(&self, other: &Self) -> (f32, f32) {
        let between = self.axis.dot(other.axis).clamp(-1.0, 1.0).acos();
        let half = self.angle() + other.angle();
        let low = (between + half).min(std::f32::consts::PI).cos();
        let high = (between - half).max(0.0).cos();
        (low, high)
    }

    /// A cone that holds both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let (a, b) = (self.angle(), other.angle());
        let between = self.axis.dot(other.axis).clamp(-1.0, 1.0).acos();
        if between + b <= a {
            return *self;
        }
        if between + a <= b {
            return *other;
        }
        let half = 0.5 * (between + a + b);
        if half >= std::f32::consts::PI {
            return Self::SPHERE;
        }
        // Turn this axis toward the other one by what is missing on that side.
        let turn = half - a;
        let side = (other.axis - self.axis * self.axis.dot(other.axis)).normalize_or_zero();
        if side == Vec3::ZERO {
            return Self::SPHERE;
        }
        let axis = (self.axis * turn.cos() + side * turn.sin()).normalize();
        // A little slack for rounding keeps the union conservative.
        Self { axis, cos_angle: (half + 1e-3).min(std::f32::consts::PI).cos() }
    }

    /// The same directions turned around.
    #[must_use]
    pub fn opposite(&self) -> Self {
        Self { axis: -self.axis, ..*self }
    }
}

//! The perfectly diffuse reflector.

use super::error::{ReflectorError, clamped, reflectance};
use super::{Lobe, Reflector, Sample, above};
use glam::{Vec2, Vec3};
use hr_diffuse::{Cone, Rgb};
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// Reflects the same radiance in all directions: ρ/π.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    rho: Rgb,
}

impl Lambert {
    /// Absorbs everything.
    pub const BLACK: Self = Self { rho: Rgb::ZERO };

    /// From the reflectance ρ, 0…1 per channel.
    ///
    /// # Errors
    /// [`ReflectorError::Reflectance`] for channels outside 0…1.
    pub fn new(rho: Rgb) -> Result<Self, ReflectorError> {
        Ok(Self { rho: reflectance("Lambert", "rho", rho)? })
    }
}

impl Reflector for Lambert {
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        if above(incident) && above(outgoing) { self.rho * FRAC_1_PI } else { Rgb::ZERO }
    }

    fn diffuse(&self) -> Rgb {
        self.rho
    }

    fn is_diffuse(&self) -> bool {
        true
    }

    fn glossy(&self, _: Vec3, _: Vec3) -> Rgb {
        Rgb::ZERO
    }

    fn glossy_toward_extent(&self, _: Vec3, _: Vec3, _: f32) -> Rgb {
        Rgb::ZERO
    }

    fn reflect_sum(&self, _: &[super::Incident], _: Vec3) -> Rgb {
        Rgb::ZERO
    }

    fn glossy_bound(&self, _: &Cone, _: Vec3) -> f32 {
        0.0
    }

    fn glossy_albedo(&self) -> Rgb {
        Rgb::ZERO
    }

    fn lobe(&self, _: Vec3) -> Lobe {
        Lobe::HEMISPHERE
    }

    fn sample(&self, _: Vec3, _: Vec2) -> Option<Sample> {
        None
    }

    fn with_base_color(&self, color: Rgb) -> Option<Arc<dyn Reflector>> {
        Some(Arc::new(Self { rho: clamped(color) }))
    }
}

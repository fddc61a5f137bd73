//! Random paths, which know nothing of links: what arrives from a lamp where all else reflects alike.

use glam::{DVec3, Vec3};
use hr_diffuse::{Hit, Solution, Visibility};

/// Follows paths through a scene.
pub(crate) struct Paths<'a> {
    solution: &'a Solution,
    visibility: Visibility,
    /// The surface that shines to its front, and reflects nothing.
    lamp: u32,
    /// Of all other surfaces.
    reflectance: f32,
    state: u32,
}

impl<'a> Paths<'a> {
    pub(crate) fn new(solution: &'a Solution, lamp: u32, reflectance: f32) -> Self {
        Self { solution, visibility: Visibility::new(solution.scene.surfaces()), lamp, reflectance, state: 1 }
    }

    /// The next random number, 0…1.
    pub(crate) fn random(&mut self) -> f32 {
        self.state = self.state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((self.state >> ((self.state >> 28) + 4)) ^ self.state).wrapping_mul(277_803_737);
        ((word >> 22) ^ word) as f32 / u32::MAX as f32
    }

    /// What a ray meets from a point of the scene.
    pub(crate) fn meets(&self, from: DVec3, direction: Vec3) -> Option<Hit> {
        self.visibility.closest(self.solution.scene.normalization.to_unit(from), direction, 0.0, f32::MAX)
    }

    /// Irradiance of a place by so many paths, over the lamp's exitance.
    pub(crate) fn irradiance(&mut self, place: &Hit, paths: u32) -> f32 {
        let mut found = 0;
        for _ in 0..paths {
            let mut at = *place;
            loop {
                let n = if at.front { at.normal } else { -at.normal };
                let (u, v) = (self.random(), self.random() * std::f32::consts::TAU);
                let (a, b) = n.any_orthonormal_pair();
                let direction = (a * v.cos() + b * v.sin()) * u.sqrt() + n * (1.0 - u).sqrt();
                let Some(hit) = self.visibility.closest_except(at.point, direction, 0.0, f32::MAX, at.surface) else {
                    break;
                };
                let shines = hit.surface == self.lamp && hit.front;
                if shines {
                    found += 1;
                }
                // The lamp reflects nothing.
                if hit.surface == self.lamp || self.random() > self.reflectance {
                    break;
                }
                at = hit;
            }
        }
        found as f32 / paths as f32
    }
}

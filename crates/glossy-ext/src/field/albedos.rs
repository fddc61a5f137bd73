//! How much of the light from each direction a material reflects: what a distribution must add up to, however coarse it is.
//!
//! A projection samples a function at a few hundred directions, and where its detail is negligible to any link at fewer still.
//! Lobes that are narrower than its triangles, and what rises toward the horizon, come out too strong on average: of a smooth
//! dielectric in a lit room by 60 %. One link does not tell; all of them together do. Power is known without a projection: it is
//! that of the samples, each times the albedo of its direction.

use super::possible;
use crate::Rgb;
use crate::reflector::{Incident, Reflector};
use glam::Vec3;
use std::f32::consts::TAU;

/// Cosines of the table: squares of equal steps, as albedos change fastest toward the horizon.
const NODES: usize = 17;
/// Directions that are averaged for each of them where the reflector has a grain.
const TURNS: usize = 4;
/// More than this times what a surface can reflect is no matter of quadrature.
const MUCH: f32 = 1.05;
/// The lowest direction that is integrated, as a cosine.
const LOWEST: f32 = 1e-3;

/// Directional-hemispherical reflectances of what a material reflects beside its diffuse part, by the cosine of the direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Albedos([Rgb; NODES]);

impl Albedos {
    /// Those of a reflector, without a mirror that is part of it: some 10,000 evaluations. What is no number counts as 0. Where their
    /// mean is much more than a surface can reflect, they are scaled down to it: else light would grow without end.
    pub(super) fn new(reflector: &dyn Reflector) -> Self {
        let turns = if reflector.grain().is_some() { TURNS } else { 1 };
        let toward = |cos: f32| {
            let sin = (1.0 - cos * cos).sqrt();
            let turned = |k: usize| Vec3::new(sin, 0.0, cos).rotate_z(TAU * (k as f32 + 0.5) / (2 * turns) as f32);
            let mean = (0..turns).map(|k| reflector.directional_albedo(turned(k))).sum::<Rgb>() / turns as f32;
            if mean.is_finite() { mean } else { Rgb::ZERO }
        };
        let node = |k: usize| k as f32 / (NODES - 1) as f32;
        let all: [Rgb; NODES] = std::array::from_fn(|k| toward((node(k) * node(k)).max(LOWEST)));
        // ∫ a(μ) 2μ dμ, where μ = x².
        let weight = |k: usize| if k == NODES - 1 { 0.5 } else { 1.0 } * 4.0 * node(k).powi(3) / (NODES - 1) as f32;
        let mean: Rgb = all.iter().enumerate().map(|(k, &albedo)| albedo * weight(k)).sum();
        let most = possible(Rgb::ONE, reflector.diffuse() + reflector.mirror());
        let is_possible = mean.cmple(MUCH * most);
        Self(all.map(|albedo| albedo * Rgb::select(is_possible, Rgb::ONE, most / mean)))
    }

    /// Interpolated at a cosine.
    fn at(&self, cos: f32) -> Rgb {
        let x = cos.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32;
        let k = (x as usize).min(NODES - 2);
        self.0[k].lerp(self.0[k + 1], x - k as f32)
    }

    /// Radiosity that samples make, W/m².
    pub(super) fn reflected(&self, incident: &[Incident]) -> Rgb {
        incident.iter().map(|sample| sample.irradiance * self.at(sample.direction.z)).sum()
    }
}

//! The parts of the GGX model: Schlick's Fresnel factor, the distribution of Trowbridge and Reitz, Smith's
//! height-correlated masking, and visible normals.

use super::lanes::Number;
use super::{above, unit};
use glam::{DVec2, Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, TAU};

/// (1 − V·H)⁵ from h = V + L, not normalised: V·H is half its length, of which the square is given.
#[inline]
pub(super) fn schlick<N: Number>(length2: N) -> N {
    let m = (length2.sqrt() * -0.5 + 1.0).at_least(0.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// D; the sine from x and y keeps small α exact.
#[inline]
pub(super) fn distribution(alpha: f32, h: Vec3) -> f32 {
    let alpha2 = alpha * alpha;
    let ratio = h.length_squared() / (h.x * h.x + h.y * h.y + alpha2 * h.z * h.z);
    alpha2 * FRAC_1_PI * ratio * ratio
}

/// √(α² + (1 − α²) cos²).
#[inline]
pub(super) fn root<N: Number>(alpha: f32, cos: N) -> N {
    let alpha2 = alpha * alpha;
    (cos * cos * (1.0 - alpha2) + alpha2).at_least(0.0).sqrt()
}

/// G / (4 (V·N) (L·N)).
#[inline]
pub(super) fn visibility<N: Number>(alpha: f32, cos_i: N, cos_o: f32) -> N {
    ((root(alpha, cos_i) * cos_o + cos_i * root(alpha, cos_o)) * 2.0).reciprocal()
}

/// A facet out of those visible from `outgoing` (Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps",
/// Computer Graphics Forum 42(8), 2023), and the direction it mirrors `outgoing` to.
pub(super) fn draw(alpha: f32, outgoing: Vec3, u: Vec2) -> Option<Vec3> {
    let stretched = unit(Vec3::new(alpha * outgoing.x, alpha * outgoing.y, outgoing.z))?;
    let z = (1.0 - u.y.clamp(0.0, 1.0)) * (1.0 + stretched.z) - stretched.z;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (s, c) = (TAU * u.x).sin_cos();
    let h = Vec3::new(radius * c, radius * s, z) + stretched;
    let h = unit(Vec3::new(alpha * h.x, alpha * h.y, h.z.max(0.0)))?;
    let incident = unit(2.0 * outgoing.dot(h) * h - outgoing)?;
    above(incident).then_some(incident)
}

/// Density of [`draw`] per solid angle of incident directions.
pub(super) fn density(alpha: f32, incident: Vec3, outgoing: Vec3) -> f32 {
    distribution(alpha, incident + outgoing) / (2.0 * (outgoing.z + root(alpha, outgoing.z)))
}

/// Mean of Schlick's factor over directions, weighted by their cosine: F₀ + (1 − F₀)/21.
pub(super) fn mean_fresnel(f0: f32) -> f32 {
    f0 + (1.0 - f0) / 21.0
}

/// Albedo of the lobe toward a cosine, without Fresnel factor (x) and with the factor w (y), from `cells` squared values.
pub(super) fn directional_albedo(alpha: f32, cos: f32, cells: usize) -> Vec2 {
    let outgoing = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = DVec2::ZERO;
    for k in 0..cells * cells {
        // Half a turn: the other half is its image.
        let u = Vec2::new(0.5 * ((k % cells) as f32 + 0.5), (k / cells) as f32 + 0.5) / cells as f32;
        if let Some(incident) = draw(alpha, outgoing, u) {
            let weight =
                2.0 * (outgoing.z + root(alpha, outgoing.z)) * visibility(alpha, incident.z, outgoing.z) * incident.z;
            sum += Vec2::new(weight, weight * schlick((incident + outgoing).length_squared())).as_dvec2();
        }
    }
    (sum / (cells * cells) as f64).as_vec2()
}

/// Mean over outgoing directions of [`directional_albedo`].
pub(super) fn mean_albedo(alpha: f32) -> (f32, f32) {
    const OUT: usize = 12;
    const CELLS: usize = 12;
    let cosines = (0..OUT).map(|j| ((j as f32 + 0.5) / OUT as f32).sqrt());
    let mean = cosines.map(|cos| directional_albedo(alpha, cos, CELLS)).sum::<Vec2>() / OUT as f32;
    (mean.x, mean.y)
}

//! Glossy radiance toward an eye, as window and ray caster share it: from the outgoing distributions of leaves, or
//! by reflecting the illumination samples that arrive.

use clap::ValueEnum;
use glam::Vec3;
use glossy_ext::{GlossyField, Incident, Place, Reflector, arriving};
use hr_diffuse::{LightField, NodeId, Rgb, Solution};
use std::f32::consts::FRAC_1_PI;

/// Cosine below which a curved leaf's intensity per area is no longer divided by it: both vanish toward the horizon.
const LEAST_COSINE: f32 = 0.05;

/// Where glossy light comes from, in images, frames and the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Mode {
    /// evaluate the outgoing distributions (the paper's walkthrough, section 5)
    #[default]
    Distributions,
    /// reflect the incident samples at each pixel, in the window at each vertex (section 3.4)
    Samples,
}

/// Radiance (W/(m² sr)) from a leaf's distribution in the unit direction `away`, without the diffuse part.
#[must_use]
pub fn leaving(solution: &Solution<GlossyField>, leaf: NodeId, away: Vec3) -> Rgb {
    let element = &solution.elements.nodes[leaf.index()];
    let distribution = &solution.reflected[leaf.index()];
    if distribution.is_empty() {
        // Carried as diffuse light.
        let albedo = solution.field.active(element.material).unwrap_or(Rgb::ZERO);
        return solution.exitant.irradiance[leaf.index()] * albedo * FRAC_1_PI;
    }
    let light = distribution.eval(away);
    if element.is_flat() {
        light
    } else {
        // Intensity per area over the cosine.
        light / element.mean_cosine(away).max(LEAST_COSINE)
    }
}

/// Radiance from the distributions around some vertices in the unit direction `away`, interpolated with the weights
/// given (paper, section 5.2).
#[must_use]
pub fn interpolated(solution: &Solution<GlossyField>, corners: &[(u32, f32)], away: Vec3) -> Rgb {
    let mut sum = Rgb::ZERO;
    for &(vertex, weight) in corners {
        if weight > 0.0 {
            let around = solution.vertices.leaves_around(vertex);
            let light: Rgb = around.iter().map(|&leaf| leaving(solution, NodeId(leaf), away)).sum();
            sum += light * (weight / around.len().max(1) as f32);
        }
    }
    sum
}

/// Radiance that a reflector makes of the illumination samples that arrive at a place of a leaf (paper, section 3.4),
/// in the unit direction `away`. Senders count as at least so wide (radians): too narrow a lobe would show them one
/// by one. `scratch` saves an allocation.
#[must_use]
pub fn reflected(
    solution: &Solution<GlossyField>,
    reflector: &dyn Reflector,
    leaf: NodeId,
    place: &Place,
    away: Vec3,
    narrowest: f32,
    scratch: &mut Vec<Incident>,
) -> Rgb {
    arriving(&solution.elements, leaf, &solution.incident_path(leaf), place, scratch);
    for sample in scratch.iter_mut() {
        sample.extent = sample.extent.max(narrowest);
    }
    reflector.reflect_sum(scratch, place.local(away))
}

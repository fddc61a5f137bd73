//! Glossy radiance toward an eye, as window and ray caster share it: from the outgoing distributions of leaves, or
//! by reflecting the illumination samples that arrive.

use clap::ValueEnum;
use glam::Vec3;
use glossy_ext::{Basis, GlossyField, Incident, Outgoing, Place, Reflector, SHOWN_COSINE, arriving};
use hr_diffuse::{LightField, NodeId, Rgb, Solution};
use std::f32::consts::FRAC_1_PI;

/// Where samples are reflected, senders count as at least so wide (standard deviation in radians, about 1.7°): as in light
/// transport, and so that a highlight between two vertices does not vanish.
pub(crate) const NARROWEST: f32 = 0.03;

/// Where glossy light comes from, in images, frames and the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Mode {
    /// evaluate the outgoing distributions (the paper's walkthrough, section 5)
    #[default]
    Distributions,
    /// reflect what arrives at each pixel: in images along rays, in walks the incident samples (section 3.4)
    Samples,
    /// final gather: one bounce of rays reads the solution, light of emitters comes by shadow rays; for stills
    Gather,
}

/// Radiance (W/(m² sr)) from a leaf's distribution at a place `at` (unit space) of the leaf that mirrors to the eye what it sees in
/// the unit direction `seen`, without the diffuse part; and the weight that it has among its neighbours'.
///
/// The leaf's distribution is that of its middle, with the normal there. The middle sees the same in
/// [another direction](glossy_ext::Focus::from_middle), and mirrors it to where its distribution is asked.
pub(crate) fn leaving<B: Basis>(solution: &Solution<GlossyField<B>>, leaf: NodeId, at: Vec3, seen: Vec3) -> (Rgb, f32) {
    leaving_as(solution, leaf, &solution.reflected[leaf.index()], (at, seen))
}

/// The same from a distribution that is given.
pub(crate) fn leaving_as<B: Basis>(
    solution: &Solution<GlossyField<B>>,
    leaf: NodeId,
    outgoing: &Outgoing<B>,
    (at, seen): (Vec3, Vec3),
) -> (Rgb, f32) {
    let element = &solution.elements.nodes[leaf.index()];
    let axis = element.normals.axis;
    let from_middle = outgoing.focus.from_middle(at - element.center, seen);
    let cosine = from_middle.dot(axis);
    let weight = (cosine / from_middle.length()).max(SHOWN_COSINE);
    if outgoing.is_empty() {
        return (carried(solution, leaf), weight);
    }
    let light = outgoing.eval(axis * (2.0 * cosine) - from_middle);
    // Elsewhere it is intensity per area.
    (if element.is_flat() { light } else { light / weight }, weight)
}

/// The unit direction from which a place with a unit normal mirrors light to where a unit direction leads `away`.
pub(crate) fn mirrored(normal: Vec3, away: Vec3) -> Vec3 {
    -away.reflect(normal)
}

/// Radiance of a leaf without a distribution, whose glossy light is carried as diffuse light.
pub(crate) fn carried<B: Basis>(solution: &Solution<GlossyField<B>>, leaf: NodeId) -> Rgb {
    let albedo = solution.field.active(solution.elements.nodes[leaf.index()].material).unwrap_or(Rgb::ZERO);
    solution.exitant.irradiance[leaf.index()] * albedo * FRAC_1_PI
}

/// The leaves whose distributions are shown around some vertices and their shares, some more than once. What lies below something is
/// not seen.
pub(crate) fn shares<B: Basis>(
    solution: &Solution<GlossyField<B>>,
    corners: &[(u32, f32)],
) -> impl Iterator<Item = (u32, f32)> {
    corners.iter().filter(|(_, share)| *share > 0.0).flat_map(move |&(vertex, share)| {
        let clusters = solution.faces.around(vertex);
        let around = if clusters.is_empty() { solution.vertices.leaves_around(vertex) } else { &[] };
        let leaves = around.iter().map(|&leaf| (leaf, solution.elements.exposed(leaf) / around.len() as f32));
        clusters.iter().copied().chain(leaves).map(move |(leaf, part)| (leaf, part * share))
    })
}

/// Radiance from the distributions around some vertices of a leaf, interpolated with the weights given (paper, section
/// 5.2), at a place (in unit space, with its unit normal), in the unit direction `away`.
#[must_use]
pub fn interpolated<B: Basis>(
    solution: &Solution<GlossyField<B>>,
    corners: &[(u32, f32)],
    place: (Vec3, Vec3),
    away: Vec3,
) -> Rgb {
    blended(solution, shares(solution, corners), place, away)
}

/// The same from leaves and their shares, as [`shares`] gives them.
pub(crate) fn blended<B: Basis>(
    solution: &Solution<GlossyField<B>>,
    leaves: impl IntoIterator<Item = (u32, f32)>,
    (at, normal): (Vec3, Vec3),
    away: Vec3,
) -> Rgb {
    let seen = mirrored(normal, away);
    let (mut sum, mut weights) = (Rgb::ZERO, 0.0);
    for (leaf, share) in leaves {
        let (light, weight) = leaving(solution, NodeId(leaf), at, seen);
        sum += light * weight * share;
        weights += weight * share;
    }
    sum / weights.max(f32::MIN_POSITIVE)
}

/// Radiance that a reflector makes of the illumination samples that arrive at a place of a leaf (paper, section 3.4),
/// in the unit direction `away`. Senders count as at least so wide (radians): too narrow a lobe would show them one
/// by one. Light that is not finite, of a reflector that misbehaves, is 0. `scratch` saves an allocation.
#[must_use]
pub fn reflected<B: Basis>(
    solution: &Solution<GlossyField<B>>,
    reflector: &dyn Reflector,
    leaf: NodeId,
    place: &Place,
    away: Vec3,
    narrowest: f32,
    scratch: &mut Vec<Incident>,
) -> Rgb {
    arriving(&solution.light(), leaf, &solution.incident_path(leaf), place, scratch);
    for sample in scratch.iter_mut() {
        sample.widen(narrowest);
    }
    let light = reflector.reflect_sum(scratch, place.local(away));
    if light.is_finite() { light } else { Rgb::ZERO }
}

//! What half vectors a cone of incident directions can make: the base of all bounds.

use super::HORIZON;
use glam::{Vec2, Vec3};
use hr_diffuse::Cone;

/// Smallest and largest cosine between members of a cone and the unit vector `v`, without inverse cosines and exact
/// to rounding also for narrow cones.
#[inline]
pub(super) fn cosine_range(cone: &Cone, v: Vec3) -> (f32, f32) {
    let across = cone.axis.cross(v).length();
    let along = cone.axis.dot(v);
    let cos = cone.cos_angle.clamp(-1.0, 1.0);
    let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
    let low = if along <= -cos { -1.0 } else { along * cos - across * sin };
    let high = if along >= cos { 1.0 } else { along * cos + across * sin };
    (low, high)
}

/// Ranges of h = incident + outgoing over a cone of incident directions above the horizon.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfRange {
    /// Lower bound of the length of the stretched horizontal part of h.
    pub across_low: f32,
    /// Lower bound of h.z.
    pub z_low: f32,
    /// Upper bound of h.z.
    pub z_high: f32,
    /// Lower bound of incident · outgoing.
    pub cos_low: f32,
    /// Upper bound of incident · outgoing.
    pub cos_high: f32,
}

/// Rounding of lengths of about 1, here and in evaluating a lobe.
const SLACK: f32 = 1e-6;

impl HalfRange {
    /// `None` where no member of the cone is above the horizon. `stretch` multiplies the horizontal part of h.
    pub(super) fn new(incident: &Cone, outgoing: Vec3, stretch: Vec2) -> Option<Self> {
        let (low, high) = cosine_range(incident, Vec3::Z);
        if !(high > -SLACK && outgoing.z > HORIZON) {
            return None;
        }
        let (cos_low, cos_high) = cosine_range(incident, outgoing);
        // h is across by at least what separates the cone's stretched shadow on the plane from that of the mirror
        // direction, along the line that joins both middles: for the unit vector v of that line and any h,
        // |S h| ≥ v·S h = S v·h.
        let across = ((incident.axis + outgoing).truncate() * stretch).try_normalize().map_or(0.0, |v| {
            let (u, length) = (v * stretch).extend(0.0).normalize_and_length();
            length * (cosine_range(incident, u).0 + outgoing.dot(u) - SLACK)
        });
        Some(Self {
            across_low: across.max(0.0),
            z_low: outgoing.z + (low - SLACK).max(HORIZON),
            z_high: outgoing.z + (high + SLACK).min(1.0),
            cos_low: (cos_low - SLACK).max(-1.0),
            cos_high: (cos_high + SLACK).min(1.0),
        })
    }
}

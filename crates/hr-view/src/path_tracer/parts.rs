//! Parts of a large emitter, and the chance of each: of a sky behind a window little is seen from a place in the room, and what is drawn
//! from all of it would be noise.

use glam::Vec2;
use hr_diffuse::{Domain, Geometry};

/// A part of an emitter that is a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub(super) domain: Domain,
    /// Its chance among all parts.
    pub(super) chance: f32,
}

/// All parts of an emitter.
#[derive(Clone, Debug)]
pub(super) struct Parts {
    parts: Vec<Part>,
    /// Chance of each and of all before it.
    sums: Vec<f32>,
}

/// So many equal parts of a domain, or a few more.
pub(super) fn divided(geometry: &Geometry, domain: Domain, count: usize) -> Vec<Domain> {
    let mut domains = vec![domain];
    while domains.len() < count {
        domains = domains.into_iter().flat_map(|domain| geometry.split(domain)).collect();
    }
    domains
}

impl Parts {
    /// Of an emitter whose parts have these weights; none where no part has any.
    pub(super) fn new(weighed: &[(Domain, f32)]) -> Option<Self> {
        let total: f32 = weighed.iter().map(|(_, weight)| weight).sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let (mut parts, mut sums, mut sum) = (Vec::new(), Vec::new(), 0.0);
        for &(domain, weight) in weighed.iter().filter(|(_, weight)| *weight > 0.0) {
            let chance = weight / total;
            sum += chance;
            parts.push(Part { domain, chance });
            sums.push(sum);
        }
        Some(Self { parts, sums })
    }

    /// The part that a pair of numbers in 0…1 picks, and a pair that picks a point of it.
    pub(super) fn pick(&self, u: Vec2) -> (Part, Vec2) {
        // Rounding may leave the last sum a little below 1.
        let at = self.sums.partition_point(|&sum| sum <= u.x).min(self.parts.len() - 1);
        let (part, before) = (self.parts[at], at.checked_sub(1).map_or(0.0, |before| self.sums[before]));
        (part, Vec2::new(((u.x - before) / part.chance).clamp(0.0, 0.999_999), u.y))
    }
}

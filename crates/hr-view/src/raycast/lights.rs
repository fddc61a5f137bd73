//! What is known of the emitters that light a leaf; where something hides parts of them, and many pixels see the leaf, what is known of
//! those that light each part of it: less is in the way of a part.

use crate::path_tracer::Nearby;
use glam::Vec2;
use hr_diffuse::sampling::hash;
use hr_diffuse::visibility::Patch;
use hr_diffuse::{Domain, Geometry};
use smallvec::SmallVec;
use std::sync::OnceLock;

/// To find out what lights a part takes about as many rays as so many pixels.
const WORTH_PIXELS: f32 = 64.0;
/// A leaf is parted so many times at most.
const MOST_PARTED: u32 = 5;

/// What is known of the emitters that light a place: a leaf, or a part of one.
#[derive(Debug)]
pub(super) struct Lights {
    pub(super) nearby: Nearby,
    /// Whether vertices know as much as rays would tell: half shadow all over.
    pub(super) are_even: bool,
    /// The parts of the place, once any is asked for.
    parts: OnceLock<SmallVec<[Lit; 4]>>,
}

/// A part of a place, and what lights it, once it is asked for.
#[derive(Debug)]
struct Lit {
    domain: Domain,
    lights: OnceLock<Box<Lights>>,
}

impl Lights {
    pub(super) fn new(nearby: Nearby, are_even: bool) -> Self {
        Self { nearby, are_even, parts: OnceLock::new() }
    }

    /// What is known of the smallest part around a point that is worth it, where this many pixels would see each unit of area; `find` finds
    /// out what lights a patch, from a seed.
    pub(super) fn around(
        &self,
        (geometry, mut place, uv): (&Geometry, Patch, Vec2),
        (pixels, mut seed): (f32, u32),
        find: impl Fn(&Patch, u32) -> Nearby,
    ) -> &Self {
        let mut lights = self;
        for _ in 0..MOST_PARTED {
            let is_clear = lights.are_even || !lights.nearby.lacks_outlines();
            if is_clear || pixels * geometry.area(place.domain) < 4.0 * WORTH_PIXELS {
                break;
            }
            let parts = lights.parts.get_or_init(|| {
                let part = |domain| Lit { domain, lights: OnceLock::new() };
                geometry.split(place.domain).into_iter().map(part).collect()
            });
            let at = geometry.locate(parts.iter().map(|part| part.domain), uv);
            place.domain = parts[at].domain;
            seed = hash(seed, at as u32);
            lights = parts[at].lights.get_or_init(|| Box::new(Self::new(find(&place, seed), false)));
        }
        lights
    }
}

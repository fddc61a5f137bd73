//! Row sums: what a point sees of all that sends light adds up to what there is to see, 1 in an enclosure.
//!
//! The links of a leaf hold form factors that are means over larger elements, and visibilities from a few segments.
//! Their sum is checked against a handful of rays from the leaf itself, which find out how much of the view is
//! taken up by senders at all; in an enclosure that is all of it, without noise. So no light is lost or made on the way.

use crate::gather::Group;
use crate::hooks::LightField;
use crate::hierarchy::Kind;
use crate::sampling::{hash, point2};
use crate::sealed::cosine_direction;
use crate::transport::Light;
use crate::visibility::Hit;
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Sides of the grid of directions that is drawn from at each point.
const GRID: u32 = 7;
/// A share of the view that is neither none nor all is known to within this: about twice the standard error of
/// stratified rays.
const UNCERTAIN: f32 = 0.05;
/// Factors are raised by at most this: where more is missing, it is not known from where.
const MOST_RAISE: f32 = 1.5;
/// Of senders that take up this share of the view some ray would meet one.
const SURELY_SEEN: f32 = 0.12;

/// What some points really see of senders.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// Shares of the view (cosine-weighted hemisphere).
    shares: Row,
    /// Whether nothing but senders is seen.
    closed: bool,
    /// Whether something covers the place: nearly all that is seen is nearer than asked for.
    pub(crate) covered: bool,
}

/// Looks around from `points`, positions with unit normals on a surface, among which the rays are dealt out. `own` tells
/// which senders count as the place's own. What is nearer than `near` may cover it.
pub(crate) fn look_around<L: LightField>(
    light: Light<'_, L>,
    surface: u32,
    points: &[(Vec3, Vec3, f32)],
    seed: u32,
    near: f32,
    own: impl Fn(u32) -> bool,
) -> Seen {
    let (mut hits, mut rays, mut close) = ([0_u16; 3], 0, 0);
    for (i, &(x, n, _)) in points.iter().enumerate() {
        let (a, b) = n.any_orthonormal_pair();
        for cell in 0..GRID * GRID {
            if cell as usize % points.len() != i {
                continue;
            }
            let jitter = point2(hash(seed, 0x2f1b), cell);
            let u = (Vec2::new((cell % GRID) as f32, (cell / GRID) as f32) + jitter) / GRID as f32;
            let (sin, cos) = (TAU * u.x).sin_cos();
            let direction = (a * cos + b * sin) * u.y.sqrt() + n * (1.0 - u.y).sqrt();
            rays += 1;
            let Some(hit) = light.scene.visibility.closest_except(x, direction, 0.0, f32::MAX, surface) else {
                continue;
            };
            close += u16::from(hit.t < near);
            if let Some(kind) = kind(light, &hit, &own) {
                hits[kind] += 1;
            }
        }
    }
    let [emitters, own, inherited] = hits.map(|hits| f32::from(hits) / rays.max(1) as f32);
    Seen {
        shares: Row { emitters, own, inherited },
        closed: hits.iter().sum::<u16>() == rays,
        covered: 10 * close >= 9 * rays,
    }
}

/// What a ray met: an emitter (0), one of a place's own senders (1) or another sender (2).
fn kind<L: LightField>(light: Light<'_, L>, hit: &Hit, own: impl Fn(u32) -> bool) -> Option<usize> {
    let mut node = light.elements.leaf_at(light.scene, hit.surface, !hit.front, hit.uv)?.0;
    if light.emitted_most(node) <= 0.0 {
        return None;
    }
    if Group::of(light, node) == Group::Emitter {
        return Some(0);
    }
    loop {
        if own(node) {
            return Some(1);
        }
        if node == 0 {
            return Some(2);
        }
        node = light.element(node).parent;
    }
}

/// Sums of form factors times visibility at a place.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Row {
    /// Of emitters.
    pub(crate) emitters: f32,
    /// Of other links that know the place itself.
    pub(crate) own: f32,
    /// Of links to something larger that holds it: what hides their senders there may not do so here.
    pub(crate) inherited: f32,
}

/// Factors that make a row what it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Correction {
    /// For the inherited part.
    pub(crate) inherited: f32,
    /// For all but emitters, the inherited part included.
    pub(crate) rest: f32,
    /// For everything.
    pub(crate) all: f32,
}

impl Default for Correction {
    fn default() -> Self {
        Self { inherited: 1.0, rest: 1.0, all: 1.0 }
    }
}

impl Row {
    /// What makes this row what was seen: what is uncertain changes first, and emitters, whose links are fine, only where
    /// they take up more than all there is, or less where there is nothing else.
    pub(crate) fn correction(&self, seen: &Seen) -> Correction {
        let mut correction = Correction::default();
        // What is seen of emitters beyond those that have links of their own sends through the links of clusters.
        let seen_inherited = seen.shares.inherited + (seen.shares.emitters - self.emitters).max(0.0);
        if self.inherited > 0.0 {
            let hidden = seen_inherited <= 0.0 && self.inherited > SURELY_SEEN;
            let goal = if hidden { 0.0 } else { within_band(self.inherited, seen_inherited) };
            correction.inherited = (goal / self.inherited).min(MOST_RAISE);
        }
        let rest = self.own + self.inherited * correction.inherited;
        if rest > 0.0 {
            let goal = if seen.closed {
                (1.0 - self.emitters).max(0.0)
            } else {
                within_band(rest, seen.shares.own + seen_inherited)
            };
            correction.rest = (goal / rest).min(MOST_RAISE);
        }
        // Where all of the view is senders it is known to be 1; what emitters lack of it is amplified by every reflection.
        let sum = self.emitters + rest * correction.rest;
        let least = if seen.closed { MOST_RAISE.recip() } else { 1.0 };
        correction.all = sum.max(least).recip();
        correction
    }
}

/// What is nearest to `row` of all that a share may be of which `seen` was seen.
fn within_band(row: f32, seen: f32) -> f32 {
    row.clamp((seen - UNCERTAIN).max(0.0), (seen + UNCERTAIN).min(1.0))
}

/// Sums of form factors times visibility of a leaf, by which its light is balanced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafRow {
    /// Of emitters.
    pub(crate) emitters: f32,
    /// Of other surfaces.
    pub(crate) rest: f32,
    /// Share of the leaf that light may reach.
    pub(crate) exposed: f32,
}

impl LeafRow {
    /// Factors for the light of [lights without extent, emitters, others] that make the row no more than what is exposed, or
    /// that where the scene is closed; and all light that of the exposed part. What emitters lack is not made up for
    /// where others can, as their links are fine.
    pub(crate) fn factors(&self, closed: bool) -> [f32; 3] {
        let Self { emitters, rest, exposed } = *self;
        if exposed <= 0.0 {
            return [0.0; 3];
        }
        let mut more = 1.0;
        if closed && rest > 0.0 && exposed >= 1.0 {
            more = ((1.0 - emitters).max(0.0) / rest).min(MOST_RAISE);
        }
        let sum = if closed { emitters + rest * more } else { rest };
        let least = if closed && exposed >= 1.0 { MOST_RAISE.recip() } else { exposed };
        if !closed { if crate::sampling::knob("CAP", 1.0) == 0.0 { return [1.0; 3]; } let all = exposed * (0.98 / sum.max(0.98)); return [exposed.recip(), exposed.recip(), all / exposed]; }
        let all = exposed / sum.max(least);
        [exposed.recip(), all / exposed, all * more / exposed]
    }
}

/// Rays that tell whether a scene is closed.
const CLOSED_RAYS: u32 = 4096;

/// Whether all that is seen from anywhere sends light: then all form factors of a leaf sum to 1.
pub(crate) fn is_closed<L: LightField>(light: Light<'_, L>) -> bool {
    let leaves: Vec<u32> = light.elements.patch_leaves().filter(|&leaf| light.element(leaf).importance > 0.0 && light.exitant.irradiance[leaf as usize] != crate::Rgb::ZERO).collect();
    let total: f64 = leaves.iter().map(|&leaf| f64::from(light.element(leaf).area)).sum();
    if total <= 0.0 {
        return false;
    }
    // Points are spread evenly over the area.
    let (mut passed, mut ray) = (0.0, 0);
    for leaf in leaves {
        let element = light.element(leaf);
        passed += f64::from(element.area) / total;
        while ray < CLOSED_RAYS && (f64::from(ray) + 0.5) / f64::from(CLOSED_RAYS) < passed {
            let (u, v) = (point2(0x8e1d, ray), point2(0x77a3, ray));
            let geometry = &light.scene.surfaces()[element.source as usize];
            let (x, normal, _) = geometry.sample_area(element.domain, u.x, u.y);
            let n = if element.kind == Kind::Back { -normal } else { normal };
            let direction = cosine_direction(n, v.x, v.y);
            let hit = light.scene.visibility.closest_except(x, direction, 0.0, f32::MAX, element.source);
            let sends = hit.and_then(|hit| light.elements.leaf_at(light.scene, hit.surface, !hit.front, hit.uv));
            if sends.is_none_or(|leaf| light.emitted_most(leaf.0) <= 0.0) {
                return false;
            }
            ray += 1;
        }
    }
    true
}

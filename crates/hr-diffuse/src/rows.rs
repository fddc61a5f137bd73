//! Row sums: what a point sees of all that sends light adds up to what there is to see, 1 in an enclosure.
//!
//! The links that light a vertex hold visibilities of larger elements, from a few segments. Their sum is checked against a
//! handful of rays from the vertex itself, which find out how much of the view is taken up by senders at all; in an
//! enclosure that is all of it, without noise. So no light is lost or made on the way.

use crate::exposed::is_dark;
use crate::footprint::Spot;
use crate::gather::Group;
use crate::hooks::LightField;
use crate::sampling::{cosine_direction, hash, point2};
use crate::transport::Light;
use crate::visibility::Hit;
use glam::Vec2;

/// Sides of the grid of directions that is drawn from at each point.
const GRID: u32 = 7;
/// Rays of a look around.
pub(crate) const RAYS: u32 = GRID * GRID;
/// A share of the view that is neither none nor all is known to within this: about twice the standard error of
/// stratified rays.
const UNCERTAIN: f32 = 0.05;
/// Factors are raised by at most this: where more is missing, it is not known from where.
pub(crate) const MOST_RAISE: f32 = 1.5;
/// Where a row is off by a little, the light that it brings is off by about this share of that: much of it is chance in how much is seen of
/// this sender or that, which may be brighter than the others or darker.
const TELLS: f32 = 0.3;
/// Of senders that take up this share of the view some ray would meet one.
const SURELY_SEEN: f32 = 0.12;

/// What some points really see of senders.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// Shares of the view (cosine-weighted hemisphere).
    shares: Row,
    /// Whether nothing but senders is seen.
    closed: bool,
    /// Whether something covers the place: nearly all that is seen is nearer than asked for, or seen from where no light goes.
    pub(crate) covered: bool,
}

/// Looks around from a place, one ray from each of its `spots` in turn. `own` tells which senders count as the place's own. What is
/// nearer than `near` may cover it.
pub(crate) fn look_around<L: LightField>(
    light: Light<'_, L>,
    spots: impl Fn(u32) -> Spot,
    seed: u32,
    near: f32,
    own: impl Fn(u32) -> bool,
) -> Seen {
    let (mut hits, mut close) = ([0_u32; 3], 0);
    for cell in 0..RAYS {
        let jitter = point2(hash(seed, 0x2f1b), cell);
        let u = (Vec2::new((cell % GRID) as f32, (cell / GRID) as f32) + jitter) / GRID as f32;
        let (x, n, surface) = spots(cell);
        let direction = cosine_direction(n, u.x, u.y);
        let Some(hit) = light.scene.visibility.closest_except(x, direction, 0.0, f32::MAX, surface) else { continue };
        let side = 2 * hit.surface + u32::from(!hit.front);
        close += u32::from(hit.t < near || is_dark(light.scene, light.elements, side));
        if let Some(kind) = kind(light, &hit, &own) {
            hits[kind] += 1;
        }
    }
    let [emitters, own, inherited] = hits.map(|hits| hits as f32 / RAYS as f32);
    Seen {
        shares: Row { emitters, own, inherited },
        closed: hits.iter().sum::<u32>() == RAYS,
        covered: 10 * close >= 9 * RAYS,
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
    /// What keeps this row from being more than all there is to see.
    pub(crate) fn limit(&self) -> Correction {
        let all = (self.emitters + self.own + self.inherited).max(1.0).recip();
        Correction { all, ..Correction::default() }
    }

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
        correction.rest = told(correction.rest);
        correction
    }
}

/// What a row that is to be changed by some factor tells of the light that it brings: near 1 but a share of the change, and nothing is left
/// where there is nothing to see.
fn told(factor: f32) -> f32 {
    factor / (factor + TELLS * (1.0 - factor))
}

/// What is nearest to `row` of all that a share may be of which `seen` was seen.
fn within_band(row: f32, seen: f32) -> f32 {
    row.clamp((seen - UNCERTAIN).max(0.0), (seen + UNCERTAIN).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a place in an enclosure, without emitters, is to be multiplied by, all of whose links know it, if they sum to this.
    fn rest(sum: f32) -> f32 {
        let seen = Seen { shares: Row { own: 1.0, ..Row::default() }, closed: true, covered: false };
        Row { own: sum, ..Row::default() }.correction(&seen).rest
    }

    #[test]
    fn rows_that_are_off_by_little_tell_little() {
        assert_eq!(rest(1.0), 1.0);
        for (sum, told) in [(0.9, 0.033), (1.1, -0.030), (1.25, -0.070)] {
            assert!((rest(sum) - 1.0 - told).abs() < 5e-3, "{sum}: {}", rest(sum));
        }
    }

    #[test]
    fn nothing_arrives_where_nothing_is_seen() {
        let seen = |own| Seen { shares: Row { own, ..Row::default() }, ..Seen::default() };
        let row = Row { own: 0.8, ..Row::default() };
        let [none, little, more] = [0.0, 0.1, 0.4].map(|own| row.correction(&seen(own)).rest);
        assert!(none < 0.2 && none < little && little < more && more < 1.0, "{none}, {little}, {more}");
        let emitters = Row { emitters: 1.0, own: 0.3, inherited: 0.0 };
        assert_eq!(
            emitters.correction(&Seen { closed: true, ..Seen::default() }).rest,
            0.0,
            "emitters are all there is"
        );
    }
}

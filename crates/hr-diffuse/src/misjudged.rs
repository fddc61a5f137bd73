//! Clusters whose light is misjudged by the moments of their normals in some directions.
//!
//! Those of a box tell up to four times too much of its narrow sides, and a tenth too little in between. What the parts of a cluster
//! show by their own moments tells where that is so; then it is taken by its parts. Each point that light is gathered at asks that
//! of the same clusters, of which most are well judged: so it is found out once for all where they may not be.

use crate::hierarchy::{Elements, Kind};
use crate::hooks::FLAT_COSINE;
use crate::threads;
use crate::transport::Exitant;
use crate::{Facing, Rgb};
use glam::Vec3;
use smallvec::SmallVec;

/// Moments that tell more or less than this share of what the parts show are no good.
const MISJUDGED: f32 = 0.03;
/// Levels of parts that are looked at for it. Moments add up, so only that of surfaces tells something new.
const PART_LEVELS: u32 = 3;
/// The middle of a region of the sphere, that of directions nearest to an axis within an octant, by its components along the axis and
/// the others.
const MIDDLE: [f32; 3] = [2.0, 1.0, 1.0];

/// By node, in which regions of the sphere its light may be misjudged. Clusters that came later are taken to be well judged.
#[derive(Clone, Debug, Default)]
pub(crate) struct Misjudged(Vec<u32>);

impl Misjudged {
    /// Looks at all clusters.
    pub(crate) fn new(elements: &Elements, exitant: &Exitant) -> Self {
        let judge = |node: usize| {
            // What is pure metal has no diffuse light, nor has any part of it.
            let is_bright = exitant.radiosity[node] != Rgb::ZERO;
            let element = &elements.nodes[node];
            // Of flat sets moments tell all: a finely cut floor is looked at for nothing.
            let is_bent = element.kind == Kind::Cluster && element.normals.cos_angle <= FLAT_COSINE;
            if is_bent && is_bright { regions(elements, exitant, node) } else { 0 }
        };
        Self(threads::map_range(0..elements.nodes.len(), 64, judge))
    }

    /// Whether a node's light may be misjudged in a direction away from it.
    pub(crate) fn may_be(&self, node: u32, away: Vec3) -> bool {
        let regions = self.0.get(node as usize).copied().unwrap_or_default();
        regions != 0 && regions >> region(away) & 1 == 1
    }
}

/// Which region of the sphere a direction lies in, of 24.
fn region(direction: Vec3) -> u32 {
    let Vec3 { x, y, z } = direction.abs();
    let axis = if x >= y && x >= z { 0 } else { 1 + u32::from(z > y) };
    3 * direction.is_negative_bitmask() + axis
}

/// Those regions of the sphere in whose middle or corners a cluster's light is misjudged.
fn regions(elements: &Elements, exitant: &Exitant, node: usize) -> u32 {
    let parts = Parts::of(elements, exitant, node);
    // Corners are directions with components of −1, 0 or 1.
    let component = |i: usize| i as f32 - 1.0;
    let corners: [bool; 27] = std::array::from_fn(|i| {
        let corner = Vec3::new(component(i % 3), component(i / 3 % 3), component(i / 9));
        corner != Vec3::ZERO && parts.are_misjudged(corner.normalize())
    });
    let mut found = 0;
    for octant in 0..8_u32 {
        let sign = [0, 1, 2].map(|bit| if octant >> bit & 1 == 1 { -1.0 } else { 1.0 });
        for axis in 0..3 {
            let corner = |[along, b, c]: [bool; 3]| {
                let mut is_used = [along, b, c];
                is_used.rotate_right(axis);
                let steps = [1, 3, 9].into_iter().zip(is_used).zip(sign);
                let step = |((step, is_used), sign): ((usize, bool), f32)| {
                    step * (1.0 + if is_used { sign } else { 0.0 }) as usize
                };
                corners[steps.map(step).sum::<usize>()]
            };
            let around = [[true, false, false], [true, true, false], [true, false, true], [true, true, true]];
            let mut middle = MIDDLE;
            middle.rotate_right(axis);
            let middle = (Vec3::from(middle) * Vec3::from(sign)).normalize();
            if around.into_iter().any(corner) || parts.are_misjudged(middle) {
                found |= 1 << (3 * octant + axis as u32);
            }
        }
    }
    found
}

/// A cluster and its parts, with the moments of their normals, weighted by radiosity, and their power.
struct Parts {
    whole: (Facing, f32),
    parts: SmallVec<[(Facing, f32); 8]>,
}

impl Parts {
    fn of(elements: &Elements, exitant: &Exitant, node: usize) -> Self {
        let shown = |node: usize| {
            let power = exitant.radiosity[node].element_sum() * elements.nodes[node].area;
            (exitant.facing[node], power)
        };
        let (mut parts, mut open) = (SmallVec::new(), SmallVec::<[(usize, u32); 8]>::from_elem((node, 0), 1));
        while let Some((node, level)) = open.pop() {
            let element = &elements.nodes[node];
            match element.kind {
                Kind::Light => {}
                Kind::Cluster if level < PART_LEVELS => {
                    let children = element.first_child..element.first_child + element.child_count;
                    open.extend(children.map(|child| (child as usize, level + 1)));
                }
                Kind::Cluster | Kind::Front | Kind::Back => parts.push(shown(node)),
            }
        }
        Self { whole: shown(node), parts }
    }

    /// Whether moments tell something else of what is shown in a direction than the parts do.
    fn are_misjudged(&self, away: Vec3) -> bool {
        let shown = |(facing, power): &(Facing, f32)| power * facing.mean_cosine(away);
        let by_parts: f32 = self.parts.iter().map(shown).sum();
        (shown(&self.whole) - by_parts).abs() > MISJUDGED * by_parts
    }
}

//! Push: the light that inner nodes received is handed down to the leaves below them.
//!
//! A link holds the mean over the node that it ends at; a leaf in a corner of it sees more of the sender or less, from
//! another side. So every leaf has a weight for each link above it: what the sender brings to the leaf's own place, over
//! what it brings to the node. The weights stay the same until links change, and are kept where they fit. Links that bring
//! next to nothing are spread evenly over flat nodes, and by orientation and distance alone over others.

use crate::NodeId;
use crate::gather::Group;
use crate::hierarchy::{Element, Kind, SceneData};
use crate::hooks::{Hierarchy, LightField};
use crate::links::{Link, Links};
use crate::segments::visibility_at;
use crate::transport::{Light, NEGLIGIBLE};
use glam::Vec3;
use rayon::prelude::*;
use smallvec::{SmallVec, smallvec};

/// No more weights than these are kept: 256 MB. In larger scenes those of the leaves beyond are found anew in each
/// iteration.
const MOST_KEPT: usize = 1 << 26;
/// Links that bring less than this share of the error asked for, relative to all that arrives, are not looked at closely.
const FAINT_SHARE: f32 = 0.03;
/// Leaves get no more than this times what a link brings on average. Surfaces that lie in one another's plane hide each
/// other by turns, which no mean visibility can tell.
const MOST_WEIGHT: f32 = 8.0;

/// Rays for a link that brings all light of a leaf; others in proportion, within limits.
const RAYS: f32 = 64.0;
const MOST_RAYS: f32 = 16.0;
/// Links none of whose segments was free let so much through, of which each leaf finds out what is true.
const LEAST_VISIBLE: f32 = 0.05;

/// How a link's light is spread over the leaves below its receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Spread {
    /// Evenly: the same irradiance for all.
    Even,
    /// By orientation and distance from the sender's middle.
    Plain,
    /// By what the sender brings to each leaf.
    Exact,
}

/// The leaves, and what light on their ancestors means to them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Push {
    pub(crate) leaves: Vec<u32>,
    /// By link.
    pub(crate) spreads: Vec<Spread>,
    /// Where the weights of each leaf begin; as many leaves as have kept ones, and the end of the last.
    first: Vec<usize>,
    /// By leaf, then by node from the leaf up to the root, then by those links of the node that are not spread evenly.
    weights: Vec<f32>,
}

impl Push {
    /// Finds the weights of the leaves, for a solution with the given relative error; where there is none, by orientation and
    /// distance alone.
    pub(crate) fn new<L: LightField>(light: Light<'_, L>, links: &Links, error: Option<f32>) -> Self {
        let leaves: Vec<u32> = light.elements.patch_leaves().collect();
        let spreads = links.all().par_iter().with_min_len(256).map(|link| spread(light, link, error)).collect();
        let mut push = Self { leaves, spreads, first: vec![0], weights: Vec::new() };
        // How many weights a leaf has, by node: its own and those of all above it.
        let mut counts = vec![0_u32; light.elements.nodes.len()];
        for (node, element) in light.elements.nodes.iter().enumerate() {
            let own = push.spreads[links.range(node as u32)].iter().filter(|s| **s != Spread::Even).count() as u32;
            counts[node] = own + if node > 0 { counts[element.parent as usize] } else { 0 };
        }
        for &leaf in &push.leaves {
            let end = push.first[push.first.len() - 1] + counts[leaf as usize] as usize;
            if end > MOST_KEPT {
                break;
            }
            push.first.push(end);
        }
        let mut weights = vec![0.0; push.first[push.first.len() - 1]];
        let mut parts: Vec<(u32, &mut [f32])> = Vec::with_capacity(push.first.len());
        let mut rest = weights.as_mut_slice();
        for (range, &leaf) in push.first.windows(2).zip(&push.leaves) {
            let (part, after) = rest.split_at_mut(range[1] - range[0]);
            parts.push((leaf, part));
            rest = after;
        }
        parts.into_par_iter().with_min_len(16).for_each(|(leaf, weights)| {
            let mut slots = weights.iter_mut();
            push.each(light, links, leaf, |_, weight| {
                if let Some(slot) = slots.next() {
                    *slot = weight();
                }
            });
        });
        push.weights = weights;
        push
    }

    /// Calls `visit` with every link above a leaf that is not spread evenly, and with what finds its weight there.
    fn each<L: LightField>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        leaf: u32,
        mut visit: impl FnMut(usize, &dyn Fn() -> f32),
    ) {
        let place = Place::new(light, leaf);
        let mut node = leaf;
        loop {
            for at in links.range(node) {
                if self.spreads[at] != Spread::Even {
                    visit(at, &|| place.weight(light, &links.all()[at], self.spreads[at]));
                }
            }
            if node == 0 {
                return;
            }
            node = light.element(node).parent;
        }
    }

    /// The sum of what arrives at the leaf at an index of `leaves`, by group: through evenly spread links, summed up by
    /// node in `even`, and through the others, by link in `arriving`.
    pub(crate) fn sum<L: LightField, T: Copy + std::ops::AddAssign + std::ops::Mul<f32, Output = T>>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        index: usize,
        (groups, arriving, even): (&[Group], &[T], &[[T; 3]]),
    ) -> [T; 3] {
        let leaf = self.leaves[index];
        let mut sums = even[leaf as usize];
        let Some(range) = self.first.get(index..index + 2) else {
            self.each(light, links, leaf, |at, weight| sums[groups[at] as usize] += arriving[at] * weight());
            return sums;
        };
        let mut weights = self.weights[range[0]..range[1]].iter();
        let mut node = leaf;
        loop {
            for at in links.range(node) {
                if self.spreads[at] != Spread::Even
                    && let Some(&weight) = weights.next()
                {
                    sums[groups[at] as usize] += arriving[at] * weight;
                }
            }
            if node == 0 {
                return sums;
            }
            node = light.element(node).parent;
        }
    }
}

fn spread<L: LightField>(light: Light<'_, L>, link: &Link, error: Option<f32>) -> Spread {
    let receiver = light.element(link.receiver);
    if receiver.is_flat() && receiver.child_count == 0 {
        return Spread::Even;
    }
    let (even, exact) = if receiver.is_flat() { (Spread::Even, Spread::Exact) } else { (Spread::Plain, Spread::Exact) };
    let Some(error) = error else { return even };
    if light.element(link.sender).kind == Kind::Light {
        return exact;
    }
    let direction = light.direction_to(receiver.center, link.sender);
    let brought = light.emitted(link.sender, -direction).element_sum() * link.factor * visible(link, exact);
    let faint = crate::sampling::knob("FAINT", FAINT_SHARE) * error * light.exitant.irradiance[link.receiver as usize].element_sum();
    if brought < faint { even } else { exact }
}

/// A leaf, and the points that stand for it.
struct Place {
    leaf: u32,
    points: SmallVec<[(Vec3, Vec3, f32); 4]>,
    negligible: f32,
}

impl Place {
    fn new<L: LightField>(light: Light<'_, L>, leaf: u32) -> Self {
        let points = sample_points(light.scene, light.element(leaf));
        let negligible = NEGLIGIBLE * light.exitant.irradiance[leaf as usize].max_element();
        Self { leaf, points, negligible }
    }

    /// What the leaf sees of a link's sender, relative to what the receiver does; `here` is what it would bring if it were
    /// wholly visible.
    fn seen<L: LightField>(&self, light: Light<'_, L>, link: &Link, here: f32) -> f32 {
        if link.visibility < 0.0 || link.visibility == 1.0 && crate::sampling::knob("VIS1", 1.0) == 0.0 {
            return 1.0;
        }
        let visible = visible(link, Spread::Exact);
        let irradiance = light.exitant.irradiance[self.leaf as usize].element_sum();
        let rays = (crate::sampling::knob("RAYS", RAYS) * here * visible / irradiance.max(f32::MIN_POSITIVE)).clamp(crate::sampling::knob("LEASTR", 1.0), MOST_RAYS.max(crate::sampling::knob("LEASTR", 1.0))) as u32;
        let each = (rays / self.points.len() as u32).max(1);
        let surface = light.element(self.leaf).source;
        let of = |&(x, n, weight): &(Vec3, Vec3, f32)| {
            weight * visibility_at(light, (x, n, surface), link.sender, each, self.leaf)
        };
        self.points.iter().map(of).sum::<f32>() / visible.max(1e-9)
    }

    /// What a link brings to the leaf over what it brings to its receiver.
    fn weight<L: LightField>(&self, light: Light<'_, L>, link: &Link, spread: Spread) -> f32 {
        let node = light.element(link.receiver);
        let direction = light.direction_to(node.center, link.sender);
        let mean = light.emitted(link.sender, -direction).element_sum() * link.factor;
        if spread == Spread::Exact && mean > 0.0 {
            let at = |x: Vec3, n: Vec3| light.arriving_at(x, n, link.sender, self.negligible).0.element_sum();
            let here: f32 = self.points.iter().map(|&(x, n, weight)| weight * at(x, n)).sum();
            return (here / mean).min(crate::sampling::knob("MAXW", MOST_WEIGHT)) * self.seen(light, link, here);
        }
        if node.is_flat() {
            return 1.0;
        }
        let element = light.element(self.leaf);
        let (direction, scale) = renewed(light, link.sender, element.center, link.receiver);
        element.mean_cosine(direction) * scale
    }
}

/// What a link lets through: what its segments found, but not nothing where each leaf looks for itself.
pub(crate) fn visible(link: &Link, spread: Spread) -> f32 {
    let least = if spread == Spread::Exact { crate::sampling::knob("FLOOR", LEAST_VISIBLE) } else { 0.0 };
    link.visibility.abs().max(least)
}

/// Direction and change of irradiance of a link's light as seen from a point inside of the node that received it.
fn renewed<L: LightField>(light: Light<'_, L>, sender: u32, at: Vec3, node: u32) -> (Vec3, f32) {
    let direction = light.direction_to(at, sender);
    if light.elements.is_distant(NodeId(sender)) {
        return (direction, 1.0);
    }
    let center = light.element(sender).center;
    let before = light.element(node).center.distance_squared(center);
    let now = at.distance_squared(center);
    // Near large senders the inverse square law ends; a factor of four is more than refinement leaves.
    (direction, (before / now.max(1e-12)).clamp(0.25, 4.0))
}

/// Points, normals and weights (sum 1) that stand for a leaf: its middle where it is flat, four of a curved one.
fn sample_points(scene: &SceneData, element: &Element) -> SmallVec<[(Vec3, Vec3, f32); 4]> {
    if element.is_flat() {
        return smallvec![(element.center, element.normals.axis, 1.0)];
    }
    let geometry = &scene.surfaces()[element.source as usize];
    let side = if element.kind == Kind::Back { -1.0 } else { 1.0 };
    let points = geometry.quadrature(element.domain);
    points.into_iter().map(|(uv, weight)| (geometry.point(uv), geometry.normal(uv) * side, weight)).collect()
}

//! What the place of a leaf makes of the light that its ancestors received.
//!
//! Form factors are means over the element that a link ends at; a leaf in a corner of it sees more or less. So the light
//! that arrives at points of each leaf is compared with what was pushed down to it, and the sum of its form factors
//! with what there is to see ([`rows`](crate::rows)). In an enclosure every row sums to 1, whichever ancestors hold the
//! links; nowhere to more, so that light dies out wherever reflectances are below 1.

use crate::Rgb;
use crate::hierarchy::{Element, Kind, SceneData};
use crate::hooks::{Hierarchy, LightField};
use crate::links::Links;
use crate::rows::{Correction, Row, look_around};
use crate::transport::{Light, NEGLIGIBLE};
use glam::Vec3;
use rayon::prelude::*;
use smallvec::{SmallVec, smallvec};
use std::ops::ControlFlow;

/// Light that arrives at leaves differs by no more than this factor from what was pushed down to them. Surfaces that
/// lie in one another's plane hide each other by turns, which no ray can tell.
const MOST_CHANGE: f32 = 4.0;

/// Links that bring less than this share of the error asked for, relative to all that arrives, count as they were pushed.
const FAINT_SHARE: f32 = 0.03;

/// How well it is known what a sender brings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// A light without extent: no part of the view.
    Light,
    /// A part of a surface that emits: links to it are fine, since it is bright.
    Emitter,
    /// Another part of a surface.
    Patch,
    /// A cluster: its light is a mean over directions.
    Cluster,
}

impl Class {
    /// That of a sender.
    pub(crate) fn of<L: LightField>(light: Light<'_, L>, sender: u32) -> Self {
        let element = light.element(sender);
        match element.kind {
            Kind::Light => Self::Light,
            Kind::Cluster => Self::Cluster,
            Kind::Front if light.scene.materials[element.material as usize].exitance != Rgb::ZERO => Self::Emitter,
            Kind::Front | Kind::Back => Self::Patch,
        }
    }

    /// Lights, emitters and the rest are placed separately.
    fn group(self) -> usize {
        match self {
            Self::Light => 0,
            Self::Emitter => 1,
            Self::Patch | Self::Cluster => 2,
        }
    }
}

/// Irradiance by the class of its senders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Gathered([Rgb; 4]);

impl Gathered {
    /// The part that comes from one class of senders.
    pub(crate) fn of(&mut self, class: Class) -> &mut Rgb {
        &mut self.0[class as usize]
    }
}

impl std::ops::AddAssign for Gathered {
    fn add_assign(&mut self, other: Self) {
        for (sum, part) in self.0.iter_mut().zip(other.0) {
            *sum += part;
        }
    }
}

/// What a leaf's own place makes of the light that was pushed down to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placed {
    /// Factors for light that ancestors received, of lights without extent, of emitters and of the rest.
    pub(crate) inherited: [f32; 3],
    /// Factors that make the form factors sum to what there is to see.
    pub(crate) row: Correction,
    /// Share of the leaf that light may reach, which gets all of it.
    pub(crate) exposed: f32,
}

impl Default for Placed {
    fn default() -> Self {
        Self { inherited: [1.0; 3], row: Correction::default(), exposed: 1.0 }
    }
}

impl Placed {
    /// Irradiance of a leaf from what its own links, which are averages over it already, and its ancestors' brought.
    pub(crate) fn irradiance(&self, own: Gathered, inherited: Gathered) -> Rgb {
        let ([lights, emitters, patches, clusters], from) = (own.0, inherited.0);
        let lights = lights + from[0] * self.inherited[0];
        let emitters = emitters + from[1] * self.inherited[1];
        let inherited = (clusters + from[2] + from[3]) * (self.inherited[2] * self.row.inherited);
        if self.exposed <= 0.0 {
            return Rgb::ZERO;
        }
        (lights + (emitters + (patches + inherited) * self.row.rest) * self.row.all) / self.exposed
    }
}

/// Leaves that a thread places between two calls of `watch`: some milliseconds.
const BETWEEN_WATCHES: usize = 8;

/// Places the leaves that are `stale`, to the error asked for; by node. The others keep what they have, and all do where
/// `watch` breaks: false then.
pub(crate) fn place<L: LightField>(
    light: Light<'_, L>,
    links: &Links,
    error: f32,
    stale: impl Fn(u32) -> bool,
    placed: &mut Vec<Placed>,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> bool {
    let leaves: Vec<u32> = light.elements.patch_leaves().filter(|&leaf| stale(leaf)).collect();
    let mut places: Vec<Placed> = Vec::with_capacity(leaves.len());
    for part in leaves.chunks(BETWEEN_WATCHES * rayon::current_num_threads()) {
        if watch().is_break() {
            return false;
        }
        places.par_extend(part.par_iter().with_min_len(2).map(|&leaf| place_leaf(light, links, leaf, error)));
    }
    placed.resize(light.elements.nodes.len(), Placed::default());
    for (leaf, place) in leaves.into_iter().zip(places) {
        placed[leaf as usize] = place;
    }
    true
}

fn place_leaf<L: LightField>(light: Light<'_, L>, links: &Links, leaf: u32, error: f32) -> Placed {
    let element = light.element(leaf);
    if element.importance <= 0.0 {
        return Placed::default();
    }
    let points = sample_points(light.scene, element);
    let negligible = NEGLIGIBLE * light.exitant.irradiance[leaf as usize].max_element();
    let faint = FAINT_SHARE * error * light.exitant.irradiance[leaf as usize].element_sum();
    // By groups of classes: light at the points, light pushed down, and what would be pushed down of unit radiosity.
    let (mut exact, mut pushed, mut inherited_row) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    let mut row = Row::default();
    let mut node = leaf;
    loop {
        let receiver = light.element(node);
        for link in links.of(node) {
            let visible = link.visibility.abs();
            if visible <= 0.0 || light.emitted_most(link.sender) <= 0.0 {
                continue;
            }
            let class = Class::of(light, link.sender);
            if node == leaf && receiver.is_flat() && class != Class::Cluster {
                match class {
                    Class::Light => {}
                    Class::Emitter => row.emitters += visible * link.factor,
                    Class::Patch | Class::Cluster => row.own += visible * link.factor,
                }
                continue;
            }
            let direction = light.direction_to(receiver.center, link.sender);
            let mut carried = link.factor * visible;
            if !receiver.is_flat() {
                let (direction, scale) = renewed(light, link.sender, element.center, node);
                carried *= element.mean_cosine(direction) * scale;
            }
            pushed[class.group()] += carried * light.emitted(link.sender, -direction).element_sum();
            let pattern =
                if class == Class::Cluster { light.element(link.sender).mean_cosine(-direction) } else { 1.0 };
            inherited_row[class.group()] += carried * pattern;
            let brought = carried * light.emitted(link.sender, -direction).element_sum();
            let sender = light.element(link.sender);
            let apart = element.center.distance_squared(sender.center);
            let most = light.emitted_most(link.sender) * visible;
            if brought < faint && sender.radius * sender.radius * most < 4.0 * faint * apart {
                exact[class.group()] += brought;
                continue;
            }
            for &(x, n, weight) in &points {
                exact[class.group()] +=
                    visible * weight * light.arriving_at(x, n, link.sender, negligible).0.element_sum();
            }
        }
        if node == 0 {
            break;
        }
        node = receiver.parent;
    }
    let inherited = [0, 1, 2].map(|group| {
        let known = pushed[group] > 0.0 && exact[group] > 0.0;
        if known { (exact[group] / pushed[group]).clamp(MOST_CHANGE.recip(), MOST_CHANGE) } else { 1.0 }
    });
    // Rows are those of the light as it is pushed down: sums that are no more than 1 let it die out, whatever it becomes.
    row.emitters += inherited[1] * inherited_row[1];
    row.inherited = inherited[2] * inherited_row[2];
    let exposed = light.elements.exposed(leaf);
    if exposed < 1.0 {
        // What is seen from the middle of the leaf is nothing to what is open of it.
        return Placed { inherited, row: row.capped(exposed), exposed };
    }
    let mut own: SmallVec<[u32; 64]> = SmallVec::new();
    if element.is_flat() {
        own.extend(links.of(leaf).iter().map(|link| link.sender).filter(|&s| light.element(s).kind != Kind::Cluster));
        own.sort_unstable();
    }
    let seen = look_around(light, element.source, &points, leaf, 0.0, |sender| own.binary_search(&sender).is_ok());
    Placed { inherited, row: row.correction(&seen), exposed }
}

/// Direction and change of irradiance of a link's light as seen from a point inside of the node that received it.
pub(crate) fn renewed<L: LightField>(light: Light<'_, L>, sender: u32, at: Vec3, node: u32) -> (Vec3, f32) {
    let direction = light.direction_to(at, sender);
    if light.elements.is_distant(crate::NodeId(sender)) {
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

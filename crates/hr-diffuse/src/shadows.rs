//! Shadows: leaves are split along the edges of shadows that can be seen.
//!
//! The error that a solution may have is a share of all light, and a few segments between two elements miss what covers a
//! corner of one. An edge that one leaf notices and the next does not looks torn, however little light that is. So the corners
//! of a leaf look at whatever brings much of its light: where some see it and others do not, there is an edge in between.

use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::links::Links;
use crate::lobes::Lobes;
use crate::refine::{MutableLight, Tolerance, can_split, estimate};
use crate::segments::visibility_at;
use crate::threads;
use crate::transport::Light;
use crate::vertices::{Corner, INSET, Outline, outlines, point_on};
use glam::Vec2;
use std::ops::ControlFlow;

/// Senders bring much of a receiver's light if it is more than this share.
const MUCH: f32 = 0.1;
/// Segments from each corner and the middle of a leaf, which go to the same points of the sender.
const SEGMENTS: u32 = 4;
/// Where no corner sees more of the sender by this share than another one does, the shadow is soft: interpolation shows it as
/// well as smaller leaves would.
const SOFT: f32 = 0.5;

/// Whether irradiance that may come from a sender (max channel) is much of what a receiver has.
pub(crate) fn counts<L: LightField>(light: Light<'_, L>, receiver: u32, irradiance: f32) -> bool {
    irradiance > MUCH * light.exitant.irradiance[receiver as usize].max_element()
}

/// How much more of a sender one corner of a part of a surface sees than another one does (0…1), 0 where that is a soft shadow;
/// and the rays that were shot for it.
pub(crate) fn edge<L: LightField>(light: Light<'_, L>, receiver: u32, sender: u32) -> (f32, u32) {
    let element = light.element(receiver);
    let geometry = &light.scene.surfaces()[element.source as usize];
    let corners = geometry.corners(element.domain).into_iter().chain([geometry.middle(element.domain)]);
    between(light, receiver, sender, corners)
}

/// The same between any places of it.
fn between<L: LightField>(
    light: Light<'_, L>,
    receiver: u32,
    sender: u32,
    places: impl Iterator<Item = Vec2>,
) -> (f32, u32) {
    let element = light.element(receiver);
    let middle = light.scene.surfaces()[element.source as usize].middle(element.domain);
    // A light without extent is seen or not.
    let count = if light.element(sender).kind == Kind::Light { 1 } else { SEGMENTS };
    let (mut least, mut most, mut rays) = (1.0_f32, 0.0_f32, 0);
    for uv in places {
        let (x, n) = point_on(light.scene, light.elements, receiver, uv.lerp(middle, INSET));
        // The same points of the sender for all.
        let seen = visibility_at(light, |_| (x, n, element.source), sender, (count, receiver));
        (least, most, rays) = (least.min(seen), most.max(seen), rays + count);
    }
    let difference = most - least;
    (if difference > SOFT { difference } else { 0.0 }, rays)
}

/// Splits leaves beside which there are smaller ones that found an edge, where it reaches into them between two corners: else
/// what is dark there would be drawn out across them. `watch` is told how many elements there are; once it breaks, no more are
/// split. Returns the rays that were shot.
pub(crate) fn sew<L: LightField>(
    light: &mut MutableLight<'_, L>,
    links: &Links,
    tolerance: Tolerance,
    watch: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> u64 {
    let (mut rays, lobes) = (0, Lobes::new(light.elements, light.faint, light.field));
    // By node, the corners of the outline in which no edge was found: none is found as long as it gets no more.
    let mut whole: Vec<u32> = Vec::new();
    loop {
        let (reader, leaves) = (light.read(), outlines(light.scene, light.elements).parts);
        whole.resize(light.elements.nodes.len(), 0);
        let look = |(leaf, outline): &(u32, Outline)| {
            if whole[*leaf as usize] == outline.len() as u32 {
                return (false, 0);
            }
            is_torn(reader, (links, &lobes), tolerance, *leaf, outline)
        };
        let looked = threads::map(&leaves, 64, look);
        rays += looked.iter().map(|(_, rays)| u64::from(*rays)).sum::<u64>();
        let mut torn: Vec<u32> = Vec::new();
        for ((leaf, outline), (is_torn, _)) in leaves.iter().zip(looked) {
            if is_torn {
                torn.push(*leaf);
            } else {
                whole[*leaf as usize] = outline.len() as u32;
            }
        }
        if torn.is_empty() || watch(light.elements.nodes.len() as u64).is_break() {
            return rays;
        }
        torn.into_iter().for_each(|leaf| light.split(leaf));
    }
}

/// Whether the edge of a shadow reaches into a leaf where smaller ones touch it, and the rays that were shot to know.
fn is_torn<L: LightField>(
    light: Light<'_, L>,
    (links, lobes): (&Links, &Lobes),
    tolerance: Tolerance,
    leaf: u32,
    outline: &[Corner],
) -> (bool, u32) {
    let element = light.element(leaf);
    let geometry = &light.scene.surfaces()[element.source as usize];
    if outline.len() <= geometry.corners(element.domain).len()
        || element.importance <= 0.0
        || !can_split(element, tolerance)
    {
        return (false, 0);
    }
    let weight = light.weight(leaf);
    let places = || outline.iter().map(|corner| corner.uv).chain([geometry.middle(element.domain)]);
    let (mut node, mut rays) = (leaf, 0);
    loop {
        for link in links.of(node).iter().filter(|link| link.visibility >= 0.0) {
            let brought = estimate(light, link) * lobes.contrast(light, leaf, link.sender);
            if weight * brought > tolerance.shadow && counts(light, leaf, brought) {
                let (edge, shot) = between(light, leaf, link.sender, places());
                rays += shot;
                if weight * brought * edge > tolerance.shadow {
                    return (true, rays);
                }
            }
        }
        if node == 0 {
            return (false, rays);
        }
        node = light.element(node).parent;
    }
}

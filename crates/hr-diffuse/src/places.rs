//! Places: where light arrives. Leaves, mostly.
//!
//! In a finely cut scene polygons may be much smaller than what the error asks for. Then links begin and end at clusters far
//! above them: refinement found it fine enough to take each of these for one. What a leaf finds out about the links above it,
//! its neighbours find out once more. So a node that is nearly in one plane, below which no link begins or ends, is one place, as a
//! leaf of its size is in the same scene without the cuts: it looks for itself once, from points all over it, and the leaves below
//! get what arrives there. Where the edge of a shadow passes through it is divided, as a leaf would be. Round meshes are cut so
//! everywhere: their places bend no more than [face clusters](crate::face_clusters), which reflect as one what arrives there.

use crate::face_clusters::most_turn;
use crate::hierarchy::{Elements, Kind, grafted};
use crate::hooks::LightField;
use crate::links::Links;
use crate::sampling::hash;
use crate::segments::visibility;
use crate::threads;
use crate::transport::Light;
use crate::visibility::{NO_BLOCKER, Proof};
use glam::Vec3;

/// Leaves whose heights over a plane differ by less than this share of their cluster's radius lie in one plane; those of a cap whose
/// normals differ rise by half that angle more.
const IN_PLANE: f32 = 0.02;
/// Normals of a place differ by at most this (radians) from their axis, …
const MOST_BEND: f32 = 0.2;
/// Fewer leaves than that look for themselves: they know more of it, for little more. With those whose light an extension reflects, which
/// would reflect it as one all the same.
const LEAST_LEAVES: u32 = 8;
const LEAST_REFLECTING: u32 = 3;
/// Segments that tell how much of a sender is seen from all over a place.
const SEGMENTS: u32 = 16;

/// What is nearly in one plane.
#[derive(Clone, Copy)]
struct Sheet {
    /// How far leaves are off it at most.
    off: f32,
    /// Number of leaves.
    count: u32,
    /// Whether an extension reflects the light of any.
    active: bool,
    /// How far normals may differ from their axis at most, radians.
    most_bend: f32,
}

impl Sheet {
    /// Whether it is worth to be one place.
    fn is_large(&self) -> bool {
        self.count >= if self.active { LEAST_REFLECTING } else { LEAST_LEAVES }
    }
}

/// Edges of shadows that no place is to have within.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edges<'a> {
    /// By link: what it brings if it is wholly visible (sum of channels).
    pub(crate) means: &'a [f32],
    /// Irradiance (sum of channels) × [`weight`](crate::hierarchy::Element::weight) by which a place may be off its mean.
    pub(crate) least: f32,
}

/// The places, in order: all leaves are below one of them, or are one. With the number of rays shot for it.
fn divided<L: LightField>(light: Light<'_, L>, links: &Links, edges: Option<Edges<'_>>) -> (Vec<u32>, u64) {
    let (whole, sheets) = undivided(light, links);
    let Some(edges) = edges else { return (whole, 0) };
    let divide = |&place: &u32| {
        let (mut found, mut shot, mut waiting) = (Vec::new(), 0, vec![place]);
        while let Some(place) = waiting.pop() {
            let element = light.element(place);
            let (has_edge, rays) = if element.is_patch() { (false, 0) } else { has_edge(light, links, edges, place) };
            shot += rays;
            if !has_edge {
                found.push(place);
                continue;
            }
            for child in element.first_child..element.first_child + element.child_count {
                if sheets[child as usize].is_some_and(|sheet| sheet.is_large()) {
                    waiting.push(child);
                } else {
                    each_leaf(light.elements, child, |leaf| found.push(leaf));
                }
            }
        }
        (found, shot)
    };
    let divided: Vec<(Vec<u32>, u64)> = threads::map(&whole, 16, divide);
    let rays = divided.iter().map(|(_, rays)| rays).sum();
    let mut places: Vec<u32> = divided.into_iter().flat_map(|(places, _)| places).collect();
    places.sort_unstable();
    (places, rays)
}

/// The largest nodes that links and planes allow, in order, and what is in one plane, by node.
fn undivided<L: LightField>(light: Light<'_, L>, links: &Links) -> (Vec<u32>, Vec<Option<Sheet>>) {
    let nodes = &light.elements.nodes;
    let mut linked = vec![false; nodes.len()];
    for link in links.all() {
        linked[link.receiver as usize] = true;
        linked[link.sender as usize] = true;
    }
    let mut sheets: Vec<Option<Sheet>> = vec![None; nodes.len()];
    for node in (0..nodes.len()).rev() {
        sheets[node] = sheet(light, &sheets, &linked, node as u32);
    }
    // Whether a node is a place, or below one.
    let mut taken = vec![false; nodes.len()];
    let mut places = Vec::new();
    for (node, element) in nodes.iter().enumerate() {
        let is_joined = sheets[node].is_some_and(|sheet| sheet.is_large());
        let is_leaf = light.elements.is_patch_leaf(node as u32);
        taken[node] = node > 0 && taken[element.parent as usize];
        if !taken[node] && (is_joined || is_leaf) {
            taken[node] = true;
            places.push(node as u32);
        }
    }
    (places, sheets)
}

/// The sheet that a node is, if it is one below which there are no links.
fn sheet<L: LightField>(light: Light<'_, L>, sheets: &[Option<Sheet>], linked: &[bool], node: u32) -> Option<Sheet> {
    let (elements, element) = (light.elements, light.element(node));
    // Leaves that are partly covered look for themselves.
    if element.kind == Kind::Light || elements.exposed(node) < 1.0 {
        return None;
    }
    let active = element.active;
    if element.is_patch() {
        // … and where an extension reflects, as one, what arrives there, by no more than that allows.
        let most_bend = if active { most_turn(light.field, element.material) } else { MOST_BEND };
        let is_plain = element.is_flat() && element.child_count == 0;
        return is_plain.then_some(Sheet { off: 0.0, count: 1, active, most_bend });
    }
    let bend = element.normals.angle();
    let (mut off, mut count, mut most_bend) = (0.0_f32, 0, MOST_BEND);
    if bend > most_bend {
        return None;
    }
    for child in element.first_child..element.first_child + element.child_count {
        let sheet = sheets[child as usize].filter(|_| !linked[child as usize])?;
        let from_middle = elements.nodes[child as usize].center - element.center;
        count += sheet.count;
        most_bend = most_bend.min(sheet.most_bend);
        off = off.max(sheet.off + from_middle.dot(element.normals.axis).abs());
    }
    let is_sheet = bend <= most_bend && off < (IN_PLANE + 0.5 * bend) * element.radius;
    is_sheet.then_some(Sheet { off, count, active, most_bend })
}

/// Whether the edge of a shadow passes through a place, and the number of rays shot to know: whether it sees a sender in part that
/// brings much.
fn has_edge<L: LightField>(light: Light<'_, L>, links: &Links, edges: Edges<'_>, place: u32) -> (bool, u64) {
    let element = light.element(place);
    let weight = light.weight(place);
    let (mut node, mut shot) = (place, 0);
    loop {
        for at in links.range(node) {
            let link = &links.all()[at];
            let direction = light.direction_to(element.center, link.sender);
            // Mean absolute difference from the mean, where so much is seen of one and nothing of the other part of it.
            let off = |seen: f32| weight * edges.means[at] * element.mean_cosine(direction) * 2.0 * seen * (1.0 - seen);
            if link.visibility < 0.0 || off(0.5) < edges.least {
                continue;
            }
            let sequence = (hash(place, 0xed6e), 0..SEGMENTS);
            let (seen, all, rays) =
                visibility(light, place, link.sender, sequence, (&Proof::Unknown, &mut NO_BLOCKER.clone()));
            shot += u64::from(rays);
            if all > 0.0 && off(seen / all) > edges.least {
                return (true, shot);
            }
        }
        if node == 0 {
            return (false, shot);
        }
        node = light.element(node).parent;
    }
}

/// A place of many leaves.
#[derive(Clone, Copy, Debug)]
struct Joined {
    node: u32,
    /// Mean of the leaves' middles by area.
    middle: Vec3,
    /// End of its leaves among those of all.
    end: u32,
}

/// All places.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    /// In order.
    pub(crate) nodes: Vec<u32>,
    /// Those of many leaves, in order, and these leaves.
    joined: Vec<Joined>,
    leaves: Vec<u32>,
}

impl Places {
    /// The places that links allow, and the number of rays shot to find the `edges` of shadows.
    pub(crate) fn new<L: LightField>(light: Light<'_, L>, links: &Links, edges: Option<Edges<'_>>) -> (Self, u64) {
        let (nodes, rays) = divided(light, links, edges);
        let mut places = Self { nodes, ..Self::default() };
        for &node in places.nodes.iter().filter(|&&node| !light.element(node).is_patch()) {
            let (mut sum, mut area) = (Vec3::ZERO, 0.0);
            each_leaf(light.elements, node, |leaf| {
                places.leaves.push(leaf);
                sum += light.element(leaf).center * light.element(leaf).area;
                area += light.element(leaf).area;
            });
            let end = places.leaves.len() as u32;
            places.joined.push(Joined { node, middle: sum / area.max(f32::MIN_POSITIVE), end });
        }
        (places, rays)
    }

    /// The middle of a place.
    pub(crate) fn middle(&self, elements: &Elements, place: u32) -> Vec3 {
        let index = self.joined.binary_search_by_key(&place, |joined| joined.node);
        index.map_or_else(|_| elements.nodes[place as usize].center, |index| self.joined[index].middle)
    }

    /// Those of many leaves, by position among all.
    pub(crate) fn joined(&self) -> Vec<usize> {
        let mut nodes = self.joined.iter().map(|place| place.node).peekable();
        (0..self.nodes.len()).filter(|&index| nodes.next_if_eq(&self.nodes[index]).is_some()).collect()
    }

    /// The leaves of those of at least so many, and how many of such places there are.
    pub(crate) fn leaves_of(&self, least: usize) -> (Vec<u32>, usize) {
        let ends = self.joined.iter().map(|place| place.end as usize);
        let starts = std::iter::once(0).chain(ends.clone());
        let ranges = starts.zip(ends).map(|(start, end)| &self.leaves[start..end]);
        let large: Vec<&[u32]> = ranges.filter(|leaves| leaves.len() >= least).collect();
        (large.concat(), large.len())
    }

    /// Calls `visit` with each leaf and the position of its place among all; of places of many leaves also with the position among
    /// these, and where the leaf lies from the middle.
    pub(crate) fn each_leaf(&self, elements: &Elements, mut visit: impl FnMut(u32, usize, Option<(usize, Vec3)>)) {
        let (mut joined, mut first) = (self.joined.iter().enumerate().peekable(), 0);
        for (index, &node) in self.nodes.iter().enumerate() {
            let Some((at, place)) = joined.next_if(|(_, place)| place.node == node) else {
                visit(node, index, None);
                continue;
            };
            for &leaf in &self.leaves[first as usize..place.end as usize] {
                visit(leaf, index, Some((at, elements.nodes[leaf as usize].center - place.middle)));
            }
            first = place.end;
        }
    }

    /// Places and leaves have the ids that they have after [`Elements::graft`].
    pub(crate) fn grafted(&mut self) {
        let joined = self.joined.iter_mut().map(|place| &mut place.node);
        self.nodes.iter_mut().chain(&mut self.leaves).chain(joined).for_each(|node| *node = grafted(*node));
    }
}

/// Calls `visit` with all leaves below a node.
fn each_leaf(elements: &Elements, node: u32, mut visit: impl FnMut(u32)) {
    let mut waiting = vec![node];
    while let Some(node) = waiting.pop() {
        let element = &elements.nodes[node as usize];
        if element.child_count == 0 {
            visit(node);
        }
        waiting.extend(element.first_child..element.first_child + element.child_count);
    }
}

#[cfg(test)]
mod tests;

//! Parts of leaves that no light reaches: a floor's under a box that stands on it.
//!
//! A leaf that reaches under the box has the irradiance of what lies open, and shines with that radiosity, but only from
//! there. Its mean over all of the leaf, sent from all of the leaf, would lose light under the box: twice the same part.

//!
//! What covers it stands on it or goes through it, and has a dark side toward it. Where no surface is like that, which
//! planes and boxes tell, no rays are shot.

use crate::geometry::{Domain, Geometry};
use crate::hierarchy::{Elements, Kind, SceneData};
use crate::sampling::{cosine_direction, hash, point2};
use crate::sealed::{Side, is_back, outward};
use crate::threads;
use crate::visibility::Region;
use glam::{Vec2, Vec3};

/// Points of a leaf that are looked from at first, and where some of them see what nobody else does.
const FIRST_POINTS: u32 = 6;
const POINTS: u32 = 24;
/// Rays of a point; it is covered where all meet dark sides.
const RAYS: u32 = 3;
/// Less than this share of a leaf is taken for so much: what little is there is known too badly.
const LEAST: f32 = 0.5;

/// What stands this much above a surface, in unit space, or less, is taken to stand on it.
pub(crate) const TOUCHING: f32 = 1e-3;
/// How far corners must lie to one side of a plane to count: an edge that surfaces share may be off by its rounding.
const ASIDE: f32 = 1e-5;

/// Finds the shares of new nodes' areas that light may reach: 1 for all but leaves that are flat, 0 for wholly covered ones.
pub(crate) fn expose(scene: &SceneData, elements: &mut Elements) {
    let new = elements.exposed.len()..elements.nodes.len();
    let new = threads::map_range(new, 64, |node| exposed_share(scene, elements, node as u32));
    elements.exposed.extend(new);
    for node in (0..elements.nodes.len()).rev() {
        let element = &elements.nodes[node];
        let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
        let (mut open, mut area) = (0.0, 0.0);
        for (child, &exposed) in elements.nodes[children.clone()].iter().zip(&elements.exposed[children]) {
            open += child.area * exposed;
            area += child.area;
        }
        if area > 0.0 {
            elements.exposed[node] = open / area;
        }
    }
}

/// Finds them anew for the nodes of some surfaces; those above are found by [`expose`].
pub(crate) fn expose_again(scene: &SceneData, elements: &mut Elements, of: impl Fn(u32) -> bool + Sync) {
    elements.exposed = threads::map_range(0..elements.exposed.len(), 64, |node| {
        let element = &elements.nodes[node];
        let is_meant = element.is_patch() && of(element.source);
        if is_meant { exposed_share(scene, elements, node as u32) } else { elements.exposed[node] }
    });
}

/// Whether light that meets a side goes nowhere from there: it is sealed, or the inside of something.
pub(crate) fn is_dark(scene: &SceneData, elements: &Elements, side: Side) -> bool {
    let material = &scene.materials[scene.surface_materials[(side / 2) as usize] as usize];
    is_back(side) && !material.two_sided || elements.is_sealed(side)
}

/// Whether part of a side may be covered by a surface that touches it.
pub(crate) fn is_touched(scene: &SceneData, elements: &Elements, side: Side) -> bool {
    let geometry = &scene.surfaces()[(side / 2) as usize];
    let bounds = geometry.bounds(Domain::WHOLE);
    // What is farther away than a surface is large covers none of it by touching it: in meshes far finer than the scene is wide there is much.
    let touching = (bounds.max - bounds.min).length().clamp(2.0 * ASIDE, TOUCHING);
    let bounds = bounds.padded(touching);
    let region = match plane(geometry, side) {
        Some((normal, height)) => Region { bounds, normal, heights: [height + ASIDE, height + touching] },
        None => Region { bounds, normal: Vec3::ZERO, heights: [f32::NEG_INFINITY, f32::INFINITY] },
    };
    scene.visibility.any_in(&region, |other| {
        let dark = [2 * other, 2 * other + 1].map(|side| is_dark(scene, elements, side));
        other != side / 2 && dark != [false; 2] && covers(&scene.surfaces()[other as usize], dark, geometry)
    })
}

/// Whether a surface of which some sides are dark may cover part of one that it is near. Of two polygons, the other has
/// corners where a dark side looks.
fn covers(surface: &Geometry, dark: [bool; 2], covered: &Geometry) -> bool {
    let Some((normal, height)) = plane(surface, 0) else { return true };
    let Some([behind, before]) = covered.heights(normal) else { return true };
    dark[0] && before > height + ASIDE || dark[1] && behind < height - ASIDE
}

/// The plane of a polygon: its unit normal on a side, and its height along it.
fn plane(geometry: &Geometry, side: Side) -> Option<(Vec3, f32)> {
    let normal = outward(geometry, side);
    geometry.is_polygon().then(|| (normal, geometry.point(Vec2::ZERO).dot(normal)))
}

fn exposed_share(scene: &SceneData, elements: &Elements, leaf: u32) -> f32 {
    let element = &elements.nodes[leaf as usize];
    if !element.is_patch() || !element.is_flat() || element.child_count > 0 || element.importance <= 0.0 {
        return 1.0;
    }
    let back = element.kind == Kind::Back;
    if !elements.is_touched(2 * element.source + u32::from(back)) {
        return 1.0;
    }
    let geometry = &scene.surfaces()[element.source as usize];
    let sign = if back { -1.0 } else { 1.0 };
    let dark = |i: u32, ray: u32| {
        let u = point2(hash(leaf, 0xe7), i);
        let (x, normal) = geometry.sample(element.domain, u.x, u.y);
        let v = point2(hash(leaf, 0xe8), i * RAYS + ray);
        let direction = cosine_direction(normal * sign, v.x, v.y);
        let met = scene.visibility.first_side(x, direction, f32::MAX, element.source);
        met.is_some_and(|(side, _)| is_dark(scene, elements, side))
    };
    if !(0..FIRST_POINTS).any(|i| dark(i, 0)) {
        return 1.0;
    }
    let open = (0..POINTS).filter(|&i| !(0..RAYS).all(|ray| dark(i, ray))).count();
    if open == 0 { 0.0 } else { (open as f32 / POINTS as f32).max(LEAST) }
}

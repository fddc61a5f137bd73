//! Parts of leaves that no light reaches: a floor's under a box that stands on it.
//!
//! A leaf that reaches under the box has the irradiance of what lies open, and shines with that radiosity, but only from
//! there. Its mean over all of the leaf, sent from all of the leaf, would lose light under the box: twice the same part.

use crate::hierarchy::{Elements, Kind, SceneData};
use crate::sampling::{hash, point2};
use crate::sealed::cosine_direction;
use rayon::prelude::*;

/// Points of a leaf that are looked from at first, and where some of them see what nobody else does.
const FIRST_POINTS: u32 = 6;
const POINTS: u32 = 24;
/// Rays of a point; it is covered where all meet dark sides.
const RAYS: u32 = 3;
/// Less than this share of a leaf is taken for so much: what little is there is known too badly.
const LEAST: f32 = 0.5;

/// Finds the shares of new nodes' areas that light may reach: 1 for all but leaves that are flat, 0 for wholly covered ones.
pub(crate) fn expose(scene: &SceneData, elements: &mut Elements) {
    let known = elements.exposed.len() as u32;
    let new: Vec<f32> = (known..elements.nodes.len() as u32)
        .into_par_iter()
        .with_min_len(64)
        .map(|node| exposed_share(scene, elements, node))
        .collect();
    elements.exposed.extend(new);
}

fn exposed_share(scene: &SceneData, elements: &Elements, leaf: u32) -> f32 {
    let element = &elements.nodes[leaf as usize];
    if !element.is_patch() || !element.is_flat() || element.importance <= 0.0 {
        return 1.0;
    }
    let geometry = &scene.surfaces()[element.source as usize];
    let side = if element.kind == Kind::Back { -1.0 } else { 1.0 };
    let dark = |i: u32, ray: u32| {
        let u = point2(hash(leaf, 0xe7), i);
        let (x, normal, _) = geometry.sample_area(element.domain, u.x, u.y);
        let n = normal * side;
        let v = point2(hash(leaf, 0xe8), i * RAYS + ray);
        let direction = cosine_direction(n, v.x, v.y);
        let hit = scene.visibility.closest_except(x, direction, 0.0, f32::MAX, element.source);
        hit.is_some_and(|hit| {
            let material = &scene.materials[scene.surface_materials[hit.surface as usize] as usize];
            let inside = !material.two_sided && !hit.front;
            inside || elements.is_sealed(hit.surface, !hit.front)
        })
    };
    if !(0..FIRST_POINTS).any(|i| dark(i, 0)) {
        return 1.0;
    }
    let open = (0..POINTS).filter(|&i| !(0..RAYS).all(|ray| dark(i, ray))).count();
    if open == 0 { 0.0 } else { (open as f32 / POINTS as f32).max(LEAST) }
}

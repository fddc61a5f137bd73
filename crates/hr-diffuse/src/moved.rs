//! What has moved in a scene, and which pairs of elements that concerns: those whose shaft it left or entered, and its own.

use crate::geometry::{Aabb, Domain, Geometry};
use crate::hierarchy::{Elements, Kind, SceneData};
use crate::proofs::shaft;
use crate::refine::Pair;
use crate::scene::LightKind;
use crate::visibility::{NO_BLOCKER, Proof, Region, Visibility};
use glam::Vec3;

/// How much of what is below a node has moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Share {
    Nothing,
    Part,
    All,
}

/// What is elsewhere than it was.
#[derive(Clone, Debug)]
pub(crate) struct Moved {
    /// By surface.
    surfaces: Vec<bool>,
    /// By light without extent.
    lights: Vec<bool>,
    /// Moved surfaces, where they were and where they are.
    places: Visibility,
    /// By node.
    below: Vec<Share>,
}

impl Moved {
    /// What is in other places, or has another shape, in a scene than in the one before.
    pub(crate) fn new(before: &SceneData, now: &SceneData) -> Self {
        let surfaces: Vec<bool> = before.surfaces().iter().zip(now.surfaces()).map(|(old, new)| old != new).collect();
        let lights = before.lights.iter().zip(&now.lights).zip(before.light_positions.iter().zip(&now.light_positions));
        let lights = lights.map(|((old, new), (from, to))| {
            old.kind != new.kind || from != to && !matches!(new.kind, LightKind::Directional { .. })
        });
        let lights = lights.collect();
        let there = |scene: &SceneData| -> Vec<Geometry> {
            let all = scene.surfaces().iter().zip(&surfaces).filter(|(_, moved)| **moved);
            all.map(|(geometry, _)| geometry.clone()).collect()
        };
        let places = Visibility::new(&[there(before), there(now)].concat());
        Self { surfaces, lights, places, below: Vec::new() }
    }

    /// Finds out what moves with the nodes of a hierarchy.
    pub(crate) fn mark(&mut self, elements: &Elements) {
        self.below = vec![Share::Nothing; elements.nodes.len()];
        for (node, element) in elements.nodes.iter().enumerate().rev() {
            let source = element.source as usize;
            let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
            self.below[node] = match element.kind {
                Kind::Cluster => {
                    let shares = &self.below[children];
                    let is = |share: Share| shares.iter().all(|&s| s == share);
                    if is(Share::Nothing) {
                        Share::Nothing
                    } else if is(Share::All) {
                        Share::All
                    } else {
                        Share::Part
                    }
                }
                Kind::Light if self.lights[source] => Share::All,
                Kind::Front | Kind::Back if self.surfaces[source] => Share::All,
                Kind::Light | Kind::Front | Kind::Back => Share::Nothing,
            };
        }
    }

    /// Whether anything below a node has moved.
    pub(crate) fn is_below(&self, node: u32) -> bool {
        self.below[node as usize] != Share::Nothing
    }

    /// Whether all that is below a node has moved.
    pub(crate) fn is_all_of(&self, node: u32) -> bool {
        self.below[node as usize] == Share::All
    }

    /// Whether a surface has moved, or may touch one where that was or is: anything within so much of it, in unit space.
    pub(crate) fn is_near(&self, surface: u32, geometry: &Geometry, gap: f32) -> bool {
        let bounds = geometry.bounds(Domain::WHOLE).padded(gap);
        let heights = [f32::NEG_INFINITY, f32::INFINITY];
        self.surfaces[surface as usize] || self.places.any_in(&Region { bounds, normal: Vec3::ZERO, heights }, |_| true)
    }

    /// Whether light between two nodes, or parts of them, is another one now: they or parts of them have moved, or what has
    /// is or was between them.
    pub(crate) fn concerns(&self, scene: &SceneData, elements: &Elements, Pair { receiver, sender }: Pair) -> bool {
        let [r, s] = [receiver, sender].map(|node| &elements.nodes[node as usize]);
        let is_between = || self.places.prove(&shaft(scene, r, s), [NO_BLOCKER; 2], 0) != Proof::Free;
        self.is_below(receiver) || self.is_below(sender) || is_between()
    }
}

/// Places of surfaces that can be computed with: unit space and half as much around it.
pub(crate) fn is_within_reach(geometry: &Geometry) -> bool {
    let Aabb { min, max } = geometry.bounds(Domain::WHOLE);
    min.min_element() >= -0.5 && max.max_element() <= 1.5
}

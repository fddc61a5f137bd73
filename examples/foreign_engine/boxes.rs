//! A tree of boxes around patches, for rays.

use crate::engine::Patch;
use glam::Vec3;

/// Patches of a box that is not divided.
const FEW: usize = 4;
/// Ends of a segment that are not looked at, as shares of it.
const ENDS: f32 = 1e-4;

/// A box: either it is divided in two, or it holds some patches.
struct Node {
    low: Vec3,
    high: Vec3,
    inside: Inside,
}

enum Inside {
    Boxes([usize; 2]),
    Patches(Vec<usize>),
}

/// The tree; the last box is the whole.
pub(crate) struct Boxes(Vec<Node>);

impl Boxes {
    pub(crate) fn new(patches: &[Patch]) -> Self {
        let mut boxes = Self(Vec::new());
        boxes.add(patches, (0..patches.len()).collect());
        boxes
    }

    /// Adds a box for some patches, after those that it is divided into.
    fn add(&mut self, patches: &[Patch], mut inside: Vec<usize>) -> usize {
        let corners = || inside.iter().flat_map(|&patch| patches[patch].corners);
        let low = corners().fold(Vec3::INFINITY, Vec3::min);
        let high = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
        let inside = if inside.len() <= FEW {
            Inside::Patches(inside)
        } else {
            let axis = (high - low).max_position();
            inside.sort_by(|&a, &b| patches[a].center[axis].total_cmp(&patches[b].center[axis]));
            let rest = inside.split_off(inside.len() / 2);
            Inside::Boxes([self.add(patches, inside), self.add(patches, rest)])
        };
        self.0.push(Node { low, high, inside });
        self.0.len() - 1
    }

    /// Whether nothing is between two points.
    pub(crate) fn is_free(&self, patches: &[Patch], from: Vec3, to: Vec3) -> bool {
        let direction = to - from;
        let mut open = vec![self.0.len() - 1];
        while let Some(node) = open.pop() {
            let node = &self.0[node];
            let (a, b) = ((node.low - from) / direction, (node.high - from) / direction);
            if a.min(b).max_element() > a.max(b).min_element().min(1.0) || a.max(b).min_element() < 0.0 {
                continue;
            }
            match &node.inside {
                Inside::Boxes(two) => open.extend(two),
                Inside::Patches(few) => {
                    let hides = |&patch: &usize| {
                        patches[patch].meets(from, direction).is_some_and(|at| (ENDS..1.0 - ENDS).contains(&at))
                    };
                    if few.iter().any(hides) {
                        return false;
                    }
                }
            }
        }
        true
    }
}

//! Leaves at which rays in lobes end, and whose light no link asked for: thousands of rays meet each of them, so it is reflected once.

use crate::glossy::leaving_as;
use glam::Vec3;
use glossy_ext::{Basis, GlossyField, Outgoing};
use hr_diffuse::{NodeId, Rgb, Solution};
use std::f32::consts::FRAC_1_PI;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// What differs by less than this share of the mean radiance of diffuse white makes no difference where it is seen in a lobe …
const NEGLIGIBLE: f32 = 0.02;
/// … and the rest may be wrong by this share of itself.
const ERROR: f32 = 0.1;

/// Distributions of leaves, found when they are asked for.
#[derive(Debug)]
pub(super) struct Ends<B: Basis> {
    /// By node.
    leaves: Vec<OnceLock<Box<Outgoing<B>>>>,
    /// As in [`Solution::reflect`].
    negligible: f32,
    asked: AtomicU64,
    found: AtomicU64,
}

impl<B: Basis> Ends<B> {
    /// Of all leaves of a solution.
    pub(super) fn new(solution: &Solution<GlossyField<B>>) -> Self {
        Self {
            leaves: std::iter::repeat_with(OnceLock::new).take(solution.elements.nodes.len()).collect(),
            // The root's irradiance is the mean of all.
            negligible: NEGLIGIBLE * FRAC_1_PI * solution.exitant.irradiance[0].max_element(),
            asked: AtomicU64::new(0),
            found: AtomicU64::new(0),
        }
    }

    /// Glossy radiance from a leaf at a place of it (unit space) that mirrors what it sees in the unit direction `seen`.
    pub(super) fn leaving(&self, solution: &Solution<GlossyField<B>>, leaf: NodeId, (at, seen): (Vec3, Vec3)) -> Rgb {
        self.asked.fetch_add(1, Ordering::Relaxed);
        let outgoing = self.leaves[leaf.index()].get_or_init(|| {
            self.found.fetch_add(1, Ordering::Relaxed);
            Box::new(solution.reflect(leaf, self.negligible, ERROR))
        });
        leaving_as(solution, leaf, outgoing, (at, seen)).0
    }

    /// How often a leaf had been reflected before.
    pub(super) fn spared(&self) -> u64 {
        self.asked.load(Ordering::Relaxed) - self.found.load(Ordering::Relaxed)
    }
}

//! Leaves at which rays in lobes end, and whose light no link asked for. Where thousands of rays meet the same leaf, its light is
//! reflected once, into a distribution; that takes as long as to reflect it toward about a hundred directions, so that where few meet a leaf
//! it is reflected toward each of them. Probes tell which leaves are met often: rays of a few pixels of a picture.

use crate::glossy::leaving_as;
use glam::Vec3;
use glossy_ext::{Basis, GlossyField, Outgoing};
use hr_diffuse::{NodeId, Rgb, Solution};
use std::collections::BTreeSet;
use std::f32::consts::FRAC_1_PI;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

/// What differs by less than this share of the mean radiance of diffuse white makes no difference where it is seen in a lobe …
const NEGLIGIBLE: f32 = 0.02;
/// … and the rest may be wrong by this share of itself.
const ERROR: f32 = 0.1;

/// Which leaves are met so often that it pays to make their distributions.
#[derive(Clone, Debug, Default)]
pub(super) enum Often {
    /// All of them.
    #[default]
    All,
    /// None yet: those that probes meet.
    Probes(BTreeSet<u32>),
    /// Those that probes met.
    Met(Arc<BTreeSet<u32>>),
}

impl Often {
    /// Whether it pays for a leaf that was met once more.
    fn holds(&mut self, leaf: NodeId) -> bool {
        match self {
            Self::All => true,
            Self::Probes(met) => {
                met.insert(leaf.0);
                false
            }
            Self::Met(met) => met.contains(&leaf.0),
        }
    }

    /// Those that probes met.
    pub(super) fn met(self) -> BTreeSet<u32> {
        match self {
            Self::Probes(met) => met,
            Self::All | Self::Met(_) => BTreeSet::new(),
        }
    }
}

/// Distributions of leaves, found when they are asked for.
#[derive(Debug)]
pub(super) struct Ends<B: Basis> {
    /// By node.
    leaves: Vec<OnceLock<Box<Outgoing<B>>>>,
    /// As in [`Solution::reflect`].
    negligible: f32,
    asked: AtomicU64,
    found: AtomicU64,
    seldom: AtomicU64,
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
            seldom: AtomicU64::new(0),
        }
    }

    /// Whether it pays to make the distribution of a leaf that was met once more. Probes are not counted.
    pub(super) fn pays(&self, leaf: NodeId, often: &mut Often) -> bool {
        let pays = often.holds(leaf);
        let is_seldom = !pays && matches!(often, Often::Met(_));
        self.seldom.fetch_add(u64::from(is_seldom), Ordering::Relaxed);
        pays
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

    /// How often a leaf was met whose distribution does not pay.
    pub(super) fn seldom(&self) -> u64 {
        self.seldom.load(Ordering::Relaxed)
    }
}

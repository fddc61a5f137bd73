//! Trees of boxes: obvhs's parts of a builder, one after the other. Its own takes the time, which stops programs where there is no clock.

use obvhs::Boundable;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Share of the nodes that may find a better place at a time.
const REINSERTED: f32 = 0.2;

/// What leaves of a tree are like.
pub(crate) struct Leaves {
    /// So many boxes at most …
    pub(crate) most: u32,
    /// … where a step down costs so many times as much as a box.
    pub(crate) step_cost: f32,
    /// Whether they, too, may find better places.
    pub(crate) reinserted: bool,
}

/// The tree of some boxes, at least one.
pub(crate) fn tree<T: Boundable>(boxes: &[T], leaves: &Leaves) -> Bvh2 {
    let all = (0..boxes.len() as u32).collect();
    // With a threshold above 0 the lowest levels are paired hastily, which costs large scenes a factor in every ray.
    let builder = &mut PlocBuilder::with_capacity(boxes.len());
    let mut tree = builder.build(PlocSearchDistance::High, boxes, all, SortPrecision::U64, 0);
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut tree, REINSERTED, None);
    collapse(&mut tree, leaves.most, leaves.step_cost);
    if leaves.reinserted {
        optimizer.run(&mut tree, REINSERTED, None);
    }
    tree
}

//! Going on with a solution: one that was stopped, whose budget was spent, or that is to be finer.
//!
//! Refinement starts again with the pass that it was in. What stopping made coarse is looked at anew: links that pairs have
//! inherited from the larger pairs that they are parts of. So the answer is as exact as without the stop, if not the same bit
//! by bit: elements were split in another order, and rays are drawn by their numbers.

use crate::error::SolveError;
use crate::hooks::LightField;
use crate::links::Links;
use crate::refine::Pair;
use crate::solution::Solution;
use crate::solver::{PASSES, Settings, Solver};
use std::collections::HashSet;

/// What is left to be done of a solution.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Unfinished {
    /// Passes that are done …
    pub(crate) passes: u32,
    /// … for this error.
    pub(crate) error: f32,
    /// Pairs without a link, whose sender was dark.
    pub(crate) unlit: Vec<Pair>,
    /// Pairs whose link is that of a larger one.
    pub(crate) coarse: Vec<Pair>,
}

impl Unfinished {
    /// Aims at another error: passes that are fine enough for it are done.
    fn go_for(&mut self, error: f32) {
        // The error of the last pass that is done.
        let done = self.passes.checked_sub(1).map_or(f32::INFINITY, |last| PASSES[last as usize] * self.error);
        self.passes = PASSES.iter().filter(|&&looseness| looseness * error >= done).count() as u32;
        self.error = error;
    }

    /// Looks at pairs with a coarse link as if they had none.
    pub(crate) fn renew(&mut self, links: &mut Links, nodes: usize) {
        if self.coarse.is_empty() {
            return;
        }
        let coarse: HashSet<Pair> = self.coarse.drain(..).collect();
        let pair = |receiver, sender| Pair { receiver, sender };
        let (again, kept): (Vec<_>, Vec<_>) =
            links.take().into_iter().partition(|link| coarse.contains(&pair(link.receiver, link.sender)));
        self.unlit.extend(again.into_iter().map(|link| pair(link.receiver, link.sender)));
        *links = Links::new(kept, nodes);
    }
}

impl<L: LightField> Solver<L> {
    /// Goes on with a solution, to an error that may be smaller than the one asked for before. [`Solver::solve`] does the
    /// rest; where nothing is left to be done, it does nothing.
    ///
    /// # Errors
    /// [`SolveError::Error`] for an error out of range.
    pub fn resume(solution: Solution<L>, settings: Settings) -> Result<Self, SolveError> {
        let Solution { scene, elements, exitant, links, field, incident, reflected, mut stats, mut unfinished, .. } =
            solution;
        stats.stopped = false;
        stats.spent = None;
        settings.check()?;
        unfinished.go_for(settings.error);
        let mut solver = Self::with_light(scene, elements, exitant, (field, incident, reflected), settings);
        (solver.links, solver.stats, solver.unfinished) = (links, stats, unfinished);
        Ok(solver)
    }
}

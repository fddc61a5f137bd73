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
use crate::solver::{Settings, Solver};
use std::collections::HashSet;

/// Tolerances of the links of the first passes, over the error asked for: nothing is refined for light that is not there yet. The
/// last of them is the first that leaves look closely in.
const FIRST: [f32; 4] = [12.0, 6.0, 3.0, 1.5];
/// At least this step is between them.
const STEP: f32 = 0.6;
/// A solution is fine enough if its error was found to be below this share of what was asked for: what was found is uncertain.
const ACCEPTED: f32 = 0.9;
/// The next pass aims at this share, …
const AIM: f32 = 0.6;
/// … as if the error shrank with the square root of the tolerance, which is halved at least once and so many times at most, …
const MOST_HALVES: f32 = 3.0;
/// … down to this tolerance over the error asked for: where more error is left it does not come from links that are too coarse.
const FINEST: f32 = 0.25;

/// What is left to be done of a solution.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unfinished {
    /// Tolerance that the links there are were made for; infinite before the first pass is done.
    pub(crate) tolerance: f32,
    /// The relative error that was found then; infinite where nobody has looked since links were made or things moved.
    pub(crate) found: f32,
    /// Pairs without a link, whose sender was dark.
    pub(crate) unlit: Vec<Pair>,
    /// Pairs whose link is that of a larger one.
    pub(crate) coarse: Vec<Pair>,
}

impl Unfinished {
    /// Nothing is done.
    pub(crate) const fn new(unlit: Vec<Pair>) -> Self {
        Self { tolerance: f32::INFINITY, found: f32::INFINITY, unlit, coarse: Vec::new() }
    }

    /// The tolerance of the next pass toward a relative error; `None` where nothing is left to be done.
    pub(crate) fn next(&self, error: f32) -> Option<f32> {
        if self.found.is_infinite() {
            // Links of the last of the first passes, or finer ones, are looked at once more.
            let firsts = first_tolerances(error);
            let next = firsts.iter().find(|&&tolerance| tolerance < self.tolerance);
            return Some(next.copied().unwrap_or(self.tolerance));
        }
        let done = self.found <= ACCEPTED * error || self.tolerance <= FINEST * error;
        // Whole halves, so that what rays happen to find seldom makes another solution.
        let halves = (2.0 * (self.found / (AIM * error)).log2()).round().clamp(1.0, MOST_HALVES);
        (!done).then(|| (self.tolerance * (-halves).exp2()).max(FINEST * error))
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

/// Tolerances of the first passes toward an error.
fn first_tolerances(error: f32) -> [f32; FIRST.len()] {
    let mut most = 1.0;
    FIRST.map(|share| {
        let tolerance = (share * error).min(most);
        most = tolerance * STEP;
        tolerance
    })
}

/// Whether an extension reflects light in a pass of this tolerance, and whether leaves look closely: not before most of the light is
/// there. What is reflected must be known before the first close look, or it would find no links.
pub(crate) fn is_worth(tolerance: f32, error: f32) -> (bool, bool) {
    let [.., before, last] = first_tolerances(error);
    (tolerance <= before, tolerance <= last)
}

impl<L: LightField> Solver<L> {
    /// Goes on with a solution, to an error that may be smaller than the one asked for before. [`Solver::solve`] does the
    /// rest; where nothing is left to be done, it does nothing.
    ///
    /// # Errors
    /// [`SolveError::Error`] for an error out of range.
    pub fn resume(solution: Solution<L>, settings: Settings) -> Result<Self, SolveError> {
        let Solution { scene, elements, exitant, links, field, incident, reflected, mut stats, unfinished, .. } =
            solution;
        stats.stopped = false;
        stats.spent = None;
        settings.check()?;
        let mut solver = Self::with_light(scene, elements, exitant, (field, incident, reflected), settings);
        (solver.links, solver.stats, solver.unfinished) = (links, stats, unfinished);
        Ok(solver)
    }
}

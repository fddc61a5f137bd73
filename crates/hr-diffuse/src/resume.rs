//! Going on with a solution: one that was stopped, whose budget was spent, or that is to be finer.
//!
//! Refinement starts again with the pass that it was in. What stopping made coarse is looked at anew: links that pairs have
//! inherited from the larger pairs that they are parts of. So the answer is as exact as without the stop, if not the same bit
//! by bit: elements were split in another order, and rays are drawn by their numbers.

use crate::error::SolveError;
use crate::hooks::LightField;
use crate::links::Links;
use crate::refine::Pair;
use crate::residual::Residual;
use crate::solution::Solution;
use crate::solver::{Settings, Solver};
use std::collections::HashSet;

/// Tolerances of the links of the first passes, over the error asked for: nothing is refined for light that is not there yet. The
/// last of them is the first that leaves look closely in.
const FIRST: [f32; 4] = [12.0, 6.0, 3.0, 1.5];
/// At least this step is between them.
const STEP: f32 = 0.6;
/// The next pass aims at the error asked for, as if the error shrank with the square root of the tolerance, which is halved at least
/// once and so many times at most, …
const MOST_HALVES: f32 = 3.0;
/// … down to this tolerance over the error asked for: where more error is left it seldom comes from links that are too coarse.
/// Below it passes begin where more than `FAR` times the error asked for is left, and go on, as long as each has gained.
const FINEST: f32 = 0.25;
const FAR: f32 = 2.0;
/// Where an error of more than this share is left at half of the tolerance, or less, it does not come from there either; …
const NO_BETTER: f32 = 0.85;
/// … if what was found is known as well as this (relative standard error). A pass that leaves no more than that share for each
/// half has gained.
const KNOWN: f32 = 0.1;

/// What is left to be done of a solution.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unfinished {
    /// Tolerance that the links there are were made for; infinite before the first pass is done.
    pub(crate) tolerance: f32,
    /// The relative error that was found then, and a standard error more; infinite where nobody has looked since links were made or
    /// things moved.
    pub(crate) found: f32,
    /// Whether the last pass found hardly less than the one before, of twice the tolerance.
    pub(crate) in_vain: bool,
    /// Whether it found much less, for sure.
    pub(crate) gained: bool,
    /// Pairs without a link, whose sender was dark.
    pub(crate) unlit: Vec<Pair>,
    /// Pairs whose link is that of a larger one.
    pub(crate) coarse: Vec<Pair>,
}

impl Unfinished {
    /// Nothing is done.
    pub(crate) const fn new(unlit: Vec<Pair>) -> Self {
        Self {
            tolerance: f32::INFINITY,
            found: f32::INFINITY,
            in_vain: false,
            gained: false,
            unlit,
            coarse: Vec::new(),
        }
    }

    /// The tolerance of the next pass toward what is asked for; `None` where nothing is left to be done.
    pub(crate) fn next(&self, settings: &Settings) -> Option<f32> {
        let (error, aim) = (settings.error, settings.tolerance());
        if self.found.is_infinite() {
            // Links of the last of the first passes, or finer ones, are looked at once more.
            let firsts = first_tolerances(aim);
            let next = firsts.iter().find(|&&tolerance| tolerance < self.tolerance);
            return Some(next.copied().unwrap_or(self.tolerance));
        }
        let in_vain = self.in_vain && self.tolerance < aim;
        let is_below = self.tolerance < FINEST * aim;
        let finest = if self.gained && (self.found > FAR * error || is_below) { 0.0 } else { FINEST * aim };
        let done = self.found <= error || 0.5 * self.tolerance < finest || in_vain;
        // Whole halves, so that what rays happen to find seldom makes another solution.
        let halves = (2.0 * (self.found / error).log2()).round().clamp(1.0, MOST_HALVES);
        (!done).then(|| (self.tolerance * (-halves).exp2()).max(finest))
    }

    /// Takes note of a pass, and of the error that was found after it, if anybody looked.
    pub(crate) fn done(&mut self, tolerance: f32, found: Option<&Residual>) {
        let finer = tolerance <= 0.5 * self.tolerance;
        let at_most = |found: &Residual| found.error() * (1.0 + found.uncertain);
        let no_better = |found: &Residual| at_most(found) > NO_BETTER * self.found && found.uncertain < KNOWN;
        let halves = (self.tolerance / tolerance).log2();
        let much_better =
            |found: &Residual| at_most(found) <= NO_BETTER.powf(halves) * self.found && found.uncertain < KNOWN;
        self.gained = finer && self.found.is_finite() && found.is_some_and(much_better);
        self.in_vain = finer && found.is_some_and(no_better);
        (self.tolerance, self.found) = (tolerance, found.map_or(f32::INFINITY, at_most));
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Tolerances of the passes, where each of them finds what `found` says of its tolerance.
    fn passes(
        settings: &Settings,
        unfinished: &mut Unfinished,
        uncertain: f32,
        found: impl Fn(f32) -> f32,
    ) -> Vec<f32> {
        let mut passes = Vec::new();
        while let Some(tolerance) = unfinished.next(settings) {
            let (_, closely) = is_worth(tolerance, settings.tolerance());
            let found = Residual { absolute: found(tolerance), uncertain, ..Residual::default() };
            unfinished.done(tolerance, closely.then_some(&found));
            passes.push(tolerance);
        }
        passes
    }

    #[test]
    fn passes_end_where_finer_links_bring_nothing() {
        let asked = Settings::with_error(0.05);
        let firsts = first_tolerances(asked.tolerance()).to_vec();
        let mut fine = Unfinished::new(Vec::new());
        assert_eq!(passes(&asked, &mut fine, 0.0, |_| 0.02), firsts, "it is fine already");
        let mut shrinks = Unfinished::new(Vec::new());
        let more = passes(&asked, &mut shrinks, 0.0, |tolerance| 0.3 * tolerance.sqrt());
        assert!(more.len() > firsts.len() && shrinks.found <= 0.05, "as long as it helps: {more:?}");
        let mut stays = Unfinished::new(Vec::new());
        let once = passes(&asked, &mut stays, 0.0, |_| 0.06);
        assert_eq!(once.len(), firsts.len() + 1, "once to see, and no more: {once:?}");
        assert_eq!(stays.next(&asked), None);
        let mut unknown = Unfinished::new(Vec::new());
        let tried = passes(&asked, &mut unknown, 0.3, |_| 0.06);
        assert!(tried.len() > once.len(), "what nobody knows does not end it: {tried:?}");
        let mut far = Unfinished::new(Vec::new());
        let all = passes(&asked, &mut far, 0.0, |tolerance| 3.0 * tolerance.sqrt());
        assert!(
            far.found <= 0.05 && far.tolerance < FINEST * asked.tolerance(),
            "far off, as long as it helps: {all:?}"
        );
        let mut stops = Unfinished::new(Vec::new());
        let some = passes(&asked, &mut stops, 0.0, |tolerance| (3.0 * tolerance.sqrt()).max(0.2));
        assert!(some.len() < all.len() && stops.found > 0.1, "and no longer: {some:?}");
        assert!(stays.next(&Settings::with_error(0.02)).is_some(), "who asks for much less may have it tried");
    }
}

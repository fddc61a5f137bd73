//! Going on with a solution: one that was stopped, whose budget was spent, or that is to be finer.
//!
//! Refinement starts again with the pass that it was in. What stopping made coarse is looked at anew: links that pairs have
//! inherited from the larger pairs that they are parts of. So the answer is as exact as without the stop, if not the same bit
//! by bit: elements were split in another order, and rays are drawn by their numbers.

use crate::effort::{self, Aim};
use crate::error::SolveError;
use crate::hooks::LightField;
use crate::links::Links;
use crate::refine::Pair;
use crate::residual::{KNOWN, Residual};
use crate::solution::Solution;
use crate::solver::{Settings, Solver};
use std::collections::HashSet;
use std::f32::consts::SQRT_2;

/// Tolerances of the links of the first passes, over the error asked for: nothing is refined for light that is not there yet. The
/// last of them is the first that leaves look closely in.
const FIRST: [f32; 4] = [12.0, 6.0, 3.0, 1.5];
/// At least this step is between them.
const STEP: f32 = 0.6;
/// Where no more than so many times the error asked for is left, the next pass looks for it with more rays over the same links: as if the
/// error shrank with the square root of the effort, at least and at most so many times as much of it, …
const NEAR: f32 = 2.0;
const MORE_EFFORT: [f32; 2] = [SQRT_2, 4.0];
/// … as long as each pass takes off what this power of how much more it was makes of the error.
const RAYS_BRING: f32 = -0.25;
/// Else, or where rays bring nothing, it has finer links, as if the error shrank with the square root of the tolerance, which is halved at
/// least once and so many times at most, …
const MOST_HALVES: f32 = 3.0;
/// … down to this tolerance over the error asked for: where more error is left it seldom comes from links that are too coarse.
/// Below it passes begin where more than `FAR` times the error asked for is left, and go on, as long as each has gained.
const FINEST: f32 = 0.25;
const FAR: f32 = 2.0;
/// Where an error of more than this share is left at half of the tolerance, or less, it does not come from there either, if what was found
/// is known well. A pass that leaves no more than that share for each half has gained.
const NO_BETTER: f32 = 0.85;

/// Which passes were worth their while.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tried {
    /// Whether the last pass of finer links found hardly less than the one before, of twice the tolerance.
    pub(crate) in_vain: bool,
    /// Whether it found much less, for sure.
    pub(crate) gained: bool,
    /// Whether more rays over the same links found hardly less, and links have brought nothing since.
    pub(crate) rays_in_vain: bool,
}

/// What is left to be done of a solution.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unfinished {
    /// What the links there are were made for; of an infinite tolerance before the first pass is done.
    pub(crate) aim: Aim,
    /// The relative error that was found then, and a standard error more; infinite where nobody has looked since links were made or
    /// things moved.
    pub(crate) found: f32,
    /// What passes have brought so far.
    pub(crate) tried: Tried,
    /// Pairs without a link, whose sender was dark.
    pub(crate) unlit: Vec<Pair>,
    /// Pairs whose link is that of a larger one.
    pub(crate) coarse: Vec<Pair>,
}

impl Unfinished {
    /// Nothing is done.
    pub(crate) fn new(unlit: Vec<Pair>) -> Self {
        Self { aim: Aim::of(f32::INFINITY), found: f32::INFINITY, tried: Tried::default(), unlit, coarse: Vec::new() }
    }

    /// What the next pass toward what is asked for is held to; `None` where nothing is left to be done.
    pub(crate) fn next(&self, settings: &Settings) -> Option<Aim> {
        let (error, asked) = (settings.error, settings.tolerance());
        let (Aim { tolerance, effort }, tried) = (self.aim, self.tried);
        if self.found.is_infinite() {
            // Links of the last of the first passes, or finer ones, are looked at once more.
            let next = first_tolerances(asked).into_iter().find(|&next| next < tolerance);
            return Some(next.map_or(self.aim, Aim::of));
        }
        if self.found <= error {
            return None;
        }
        if self.found <= NEAR * error && effort < effort::MOST && !tried.rays_in_vain {
            let [least, most] = MORE_EFFORT;
            let more = (self.found / error).powi(2).clamp(least, most);
            return Some(Aim { tolerance, effort: (effort * more).min(effort::MOST) });
        }
        let in_vain = tried.in_vain && tolerance < asked;
        let is_below = tolerance < FINEST * asked;
        let finest = if tried.gained && (self.found > FAR * error || is_below) { 0.0 } else { FINEST * asked };
        let done = 0.5 * tolerance < finest || in_vain;
        // Whole halves, so that what rays happen to find seldom makes another solution.
        let halves = (2.0 * (self.found / error).log2()).round().clamp(1.0, MOST_HALVES);
        let next = Aim::of((tolerance * (-halves).exp2()).max(finest));
        (!done).then(|| Aim { effort: next.effort.max(effort), ..next })
    }

    /// Whether a pass has links already, and is for more rays only.
    pub(crate) fn is_fine_enough(&self, aim: Aim) -> bool {
        self.found.is_finite() && aim.tolerance == self.aim.tolerance
    }

    /// Takes note of a pass, and of the error that was found after it, if anybody looked.
    pub(crate) fn done(&mut self, aim: Aim, found: Option<&Residual>) {
        let at_most = |found: &Residual| found.error() + found.uncertain;
        let known = |found: &Residual| found.uncertain < KNOWN * found.error();
        let leaves = |share: f32| found.is_some_and(|found| at_most(found) <= share * self.found);
        let is_known = found.is_some_and(known);
        let (halves, more) = ((self.aim.tolerance / aim.tolerance).log2(), aim.effort / self.aim.effort);
        if halves >= 1.0 {
            let gained = self.found.is_finite() && is_known && leaves(NO_BETTER.powf(halves));
            let in_vain = is_known && !leaves(NO_BETTER);
            self.tried = Tried { gained, in_vain, rays_in_vain: self.tried.rays_in_vain && !gained };
        } else {
            let rays_in_vain = halves == 0.0 && more > 1.0 && !leaves(more.powf(RAYS_BRING));
            self.tried = Tried { rays_in_vain, ..Tried::default() };
        }
        (self.aim, self.found) = (aim, found.map_or(f32::INFINITY, at_most));
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

    /// What the passes are held to, where each of them finds what `found` says of that.
    fn passes(
        settings: &Settings,
        unfinished: &mut Unfinished,
        uncertain: f32,
        found: impl Fn(Aim) -> f32,
    ) -> Vec<Aim> {
        let mut passes = Vec::new();
        while let Some(aim) = unfinished.next(settings) {
            let (_, closely) = is_worth(aim.tolerance, settings.tolerance());
            let absolute = found(aim);
            let found = Residual { absolute, uncertain: uncertain * absolute, ..Residual::default() };
            unfinished.done(aim, closely.then_some(&found));
            passes.push(aim);
        }
        passes
    }

    #[test]
    fn passes_end_where_finer_links_bring_nothing() {
        let asked = Settings::with_error(0.05);
        let firsts = first_tolerances(asked.tolerance()).map(Aim::of).to_vec();
        let mut fine = Unfinished::new(Vec::new());
        assert_eq!(passes(&asked, &mut fine, 0.0, |_| 0.02), firsts, "it is fine already");
        let mut shrinks = Unfinished::new(Vec::new());
        let more = passes(&asked, &mut shrinks, 0.0, |aim| 0.3 * aim.tolerance.sqrt());
        assert!(more.len() > firsts.len() && shrinks.found <= 0.05, "as long as it helps: {more:?}");
        let mut stays = Unfinished::new(Vec::new());
        let once = passes(&asked, &mut stays, 0.0, |_| 0.06);
        assert_eq!(once.len(), firsts.len() + 2, "once to see for rays and once for links, and no more: {once:?}");
        assert_eq!(stays.next(&asked), None);
        let mut unknown = Unfinished::new(Vec::new());
        let tried = passes(&asked, &mut unknown, 0.3, |_| 0.06);
        assert!(tried.len() > once.len(), "what nobody knows does not end it: {tried:?}");
        let mut far = Unfinished::new(Vec::new());
        let all = passes(&asked, &mut far, 0.0, |aim| 3.0 * aim.tolerance.sqrt());
        assert!(
            far.found <= 0.05 && far.aim.tolerance < FINEST * asked.tolerance(),
            "far off, as long as it helps: {all:?}"
        );
        let mut stops = Unfinished::new(Vec::new());
        let some = passes(&asked, &mut stops, 0.0, |aim| (3.0 * aim.tolerance.sqrt()).max(0.2));
        assert!(some.len() < all.len() && stops.found > 0.1, "and no longer: {some:?}");
        assert!(stays.next(&Settings::with_error(0.02)).is_some(), "who asks for much less may have it tried");
    }

    #[test]
    fn noise_of_rays_takes_more_of_them_and_no_finer_links() {
        let asked = Settings::with_error(0.05);
        let coarse = first_tolerances(asked.tolerance())[FIRST.len() - 1];
        let mut noisy = Unfinished::new(Vec::new());
        let more = passes(&asked, &mut noisy, 0.0, |aim| 0.08 * aim.effort.powf(-0.4));
        assert!(noisy.found <= 0.05 && more.len() > FIRST.len(), "{more:?}");
        assert!(more[FIRST.len()..].iter().all(|aim| aim.tolerance == coarse), "{more:?}");
        let mut links = Unfinished::new(Vec::new());
        let finer = passes(&asked, &mut links, 0.0, |aim| 0.09 * (aim.tolerance / coarse).sqrt());
        let [rays, finer @ ..] = &finer[FIRST.len()..] else { panic!("{finer:?}") };
        assert!(rays.tolerance == coarse && rays.effort > 1.0, "they are tried first: {rays:?}");
        assert!(links.found <= 0.05 && finer.iter().all(|aim| aim.tolerance < coarse), "{finer:?}");
        assert!(finer.iter().all(|aim| aim.effort >= rays.effort), "nothing is given up: {finer:?}");
    }
}

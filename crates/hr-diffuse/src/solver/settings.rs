//! What is asked of a solve, and what it tells while it goes on.

use crate::budget::Budget;
use crate::error::SolveError;

/// How light travels over links from one iteration to the next. Both ways lead to the same answer, within the error asked for; where
/// nearly all that is reflected is an extension's, as in a room of polished metal, shooting loses up to a sixth of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transport {
    /// Gathering: every receiver adds up what its links carry of all the light there is.
    #[default]
    Gather,
    /// Shooting: links carry the light that has not been shot yet, and what arrives is added to what there is. Light that
    /// an extension makes is reflected once for each reflection that it has behind it, and once more as a whole at the end.
    Shoot,
}

/// What is asked of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Relative error (L1) of the leaves' irradiance, as rays find it, 0.001…1: 0.02 is fine, 0.1 coarse. Links may be off by more one by
    /// one, as their errors cancel.
    pub error: f32,
    /// What it may cost.
    pub budget: Budget,
    /// How light travels.
    pub transport: Transport,
}

/// Errors of links are held to more than the error asked for where this is above …
const CANCELS_ABOVE: f32 = 0.01;
/// … in proportion to this power of it, …
const CANCELS: f32 = 0.477;
/// … up to the first of these, and for whoever asks for less up to the second: lobes and small mirrors are missed by coarser ones.
const COARSEST: [f32; 2] = [0.3, 0.5];

impl Settings {
    /// An error asked for, whatever it costs.
    #[must_use]
    pub fn with_error(error: f32) -> Self {
        Self { error, budget: Budget::default(), transport: Transport::default() }
    }

    /// The relative error that each link and each reflection is held to, as if all of them had the same sign. They have not: what comes
    /// out is much less where it is coarse, and about as much where it is fine.
    pub(crate) fn tolerance(&self) -> f32 {
        let cancels = (self.error / CANCELS_ABOVE).max(1.0).powf(CANCELS);
        (self.error * cancels).min(self.error.clamp(COARSEST[0], COARSEST[1]))
    }

    /// Whether they can be met.
    pub(crate) fn check(&self) -> Result<(), SolveError> {
        let error = self.error;
        if (0.001..=1.0).contains(&error) { Ok(()) } else { Err(SolveError::Error { error }) }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::with_error(0.05)
    }
}

/// What the solver is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Phase {
    /// Splitting pairs of elements, with visibility rays.
    Refine,
    /// Gathering, pushing, reflecting and pulling light.
    Transport,
    /// Values at vertices.
    Reconstruct,
}

/// How far a solve is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// What it is doing.
    pub phase: Phase,
    /// Rough share of the work done, 0…1.
    pub fraction: f32,
    /// Relative error that the solution is believed to have now: once rays have looked, what they found.
    pub error: f32,
    /// Links so far.
    pub links: u64,
    /// Elements so far.
    pub nodes: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_may_be_off_by_more_than_their_sum() {
        let tolerance = |error| Settings::with_error(error).tolerance();
        assert_eq!(
            [0.001, 0.005, 0.01].map(tolerance),
            [0.001, 0.005, 0.01],
            "fine ones are held to what is asked for"
        );
        let errors: Vec<f32> = (1..=1000).map(|i| i as f32 / 1000.0).collect();
        for step in errors.windows(2) {
            let [finer, coarser] = [step[0], step[1]].map(tolerance);
            assert!(
                finer <= coarser && coarser < finer + 0.04 && coarser <= COARSEST[1],
                "{step:?}: {finer}, {coarser}"
            );
            assert!(coarser >= step[1].min(COARSEST[1]), "{step:?}: {coarser}");
        }
        assert!((tolerance(0.1) - 0.3).abs() < 1e-3 && (tolerance(0.05) - 0.108).abs() < 1e-3);
    }
}

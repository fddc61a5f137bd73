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
    /// Relative error of the solution, 0.001…1: 0.02 is fine, 0.1 coarse.
    pub error: f32,
    /// What it may cost.
    pub budget: Budget,
    /// How light travels.
    pub transport: Transport,
}

impl Settings {
    /// An error asked for, whatever it costs.
    #[must_use]
    pub fn with_error(error: f32) -> Self {
        Self { error, budget: Budget::default(), transport: Transport::default() }
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

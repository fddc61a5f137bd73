//! How fast the light settles, and where to.
//!
//! Each iteration adds one more reflection, so in white rooms hundreds of them are needed. But what they add soon shrinks
//! by the same factor from one to the next, that of the slowest mode, and the sum of the geometric series is known
//! (A. Aitken, "On Bernoulli's numerical solution of algebraic equations", 1926): E + Δ·r/(1 − r), per channel.

use crate::Rgb;
use glam::DVec3;

/// The factor counts as found once it changes by less than this share of its distance from 1.
const STEADY: f64 = 0.1;
/// Slower series than this are not worth the trouble; those nearer to 1 than `FASTEST` are not known well enough.
const SLOWEST: f64 = 0.3;
const FASTEST: f64 = 0.999_99;

/// What is known of the iterations since the links were last refined.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Convergence {
    /// Sum of the last changes.
    change: Option<DVec3>,
    /// Its ratio to the one before.
    rate: Option<DVec3>,
    /// The largest rate that was extrapolated with in this scene.
    slow: f32,
}

impl Convergence {
    /// Takes the sum of an iteration's changes (area × change of irradiance). Returns, by channel, what the iterations to
    /// come would add in multiples of this change; 0 where that is not known.
    pub(crate) fn ahead(&mut self, change: DVec3) -> Rgb {
        let rate = self.change.map(|before| (change / before).map(|r| if r.is_finite() { r } else { 0.0 }));
        let ahead = match (self.rate, rate) {
            (Some(before), Some(rate)) => DVec3::from_array(std::array::from_fn(|c| {
                let steady = (rate[c] - before[c]).abs() < STEADY * (1.0 - rate[c]);
                if steady && (SLOWEST..FASTEST).contains(&rate[c]) { rate[c] / (1.0 - rate[c]) } else { 0.0 }
            })),
            _ => DVec3::ZERO,
        };
        if ahead == DVec3::ZERO {
            (self.change, self.rate) = (Some(change), rate);
        } else {
            let most = ahead.max_element();
            self.slow = self.slow.max((most / (1.0 + most)) as f32);
            self.restart();
        }
        ahead.as_vec3()
    }

    /// Forgets the series: the links are others now.
    pub(crate) fn restart(&mut self) {
        (self.change, self.rate) = (None, None);
    }

    /// What all iterations to come would change if the residuals went on shrinking as they did last, and no faster than
    /// the light is known to settle.
    pub(crate) fn remaining(&self, residual: f32, before: f32) -> f32 {
        if !before.is_finite() {
            return residual;
        }
        let rate = (residual / before).max(self.slow).clamp(0.0, 0.999);
        residual * (rate / (1.0 - rate)).max(0.1)
    }
}

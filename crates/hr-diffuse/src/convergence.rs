//! How fast the light settles, and where to.
//!
//! Each iteration adds one more reflection, so in white rooms hundreds of them are needed. But what they add soon shrinks
//! by the same factor from one to the next, that of the slowest mode, and the sum of the geometric series is known
//! (A. Aitken, "On Bernoulli's numerical solution of algebraic equations", 1926): E + Δ·r/(1 − r), per channel.
//!
//! That holds for what changes everywhere alike. Between two walls that hardly see but each other light goes back and forth, too: what is
//! added to one is taken from the other in the next iteration, of which the sum of all changes does not tell. Added up as if it were a
//! series of one sign, it would grow each time.

use crate::Rgb;
use glam::DVec3;

/// The factor counts as found once it changes by less than this share of its distance from 1.
const STEADY: f64 = 0.1;
/// Slower series than this are not worth the trouble; those nearer to 1 than `FASTEST` are not known well enough.
const SLOWEST: f64 = 0.3;
const FASTEST: f64 = 0.999_99;

/// A series has one sign: what changes the other way is no more than this share of what all changes sum to.
const OTHER_WAY: f64 = 0.1;
/// What goes back and forth, with this share of all changes at least the other way, is at rest halfway.
const BACK_AND_FORTH: f64 = 0.25;
const HALFWAY: f64 = -0.5;

/// What is known of the iterations since the links were last refined.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Convergence {
    /// Sum of the last changes.
    change: Option<DVec3>,
    /// Its ratio to the one before.
    rate: Option<DVec3>,
    /// The sum of the last changes' sizes.
    moved: DVec3,
    /// The largest rate that was extrapolated with in this scene.
    slow: f32,
}

impl Convergence {
    /// Takes the sum of an iteration's changes (area × change of irradiance), and that of their sizes. Returns, by channel, what the
    /// iterations to come would add in multiples of this change; 0 where that is not known.
    pub(crate) fn ahead(&mut self, change: DVec3, moved: DVec3) -> Rgb {
        let rate = self.change.map(|before| (change / before).map(|r| if r.is_finite() { r } else { 0.0 }));
        let ahead = match (self.rate, rate) {
            (Some(before), Some(rate)) => DVec3::from_array(std::array::from_fn(|c| {
                let other_way = 0.5 * (moved[c] - change[c].abs());
                let steady = (rate[c] - before[c]).abs() < STEADY * (1.0 - rate[c]);
                if steady && (SLOWEST..FASTEST).contains(&rate[c]) && other_way <= OTHER_WAY * change[c].abs() {
                    rate[c] / (1.0 - rate[c])
                } else if other_way > BACK_AND_FORTH * moved[c] && moved[c] > SLOWEST * self.moved[c] {
                    HALFWAY
                } else {
                    0.0
                }
            })),
            _ => DVec3::ZERO,
        };
        if ahead == DVec3::ZERO {
            (self.change, self.rate, self.moved) = (Some(change), rate, moved);
        } else {
            let most = ahead.max_element().max(0.0);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two walls that see nothing but each other, but for a light that falls on one of them: what they receive goes back and forth.
    #[test]
    fn light_between_two_walls_comes_to_rest() {
        for reflectance in [0.5, 0.9, 0.99, 0.999] {
            let (mut convergence, mut now) = (Convergence::default(), [0.0_f64; 2]);
            let exact = [1.0, reflectance].map(|e| e / (1.0 - reflectance * reflectance));
            let mut iterations = 0;
            while (0..2).any(|i| (now[i] / exact[i] - 1.0).abs() > 1e-3) {
                let next = [1.0 + reflectance * now[1], reflectance * now[0]];
                let changes = [0, 1].map(|i| next[i] - now[i]);
                let (change, moved) = (changes.iter().sum(), changes.iter().map(|c: &f64| c.abs()).sum());
                let ahead = f64::from(convergence.ahead(DVec3::splat(change), DVec3::splat(moved)).x);
                now = [0, 1].map(|i| (next[i] + ahead * changes[i]).max(0.0));
                assert!(now[0].max(now[1]) < 2.0 * exact[0], "{reflectance}: {now:?} is more than {exact:?}");
                iterations += 1;
                assert!(iterations < 60, "{reflectance}: {now:?} after {iterations} iterations, it is {exact:?}");
            }
        }
    }
}

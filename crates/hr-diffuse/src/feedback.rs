//! Feedback: light that does not die out, as more comes back to leaves than they sent.
//!
//! The links of a sender may carry somewhat more directional light than it has ([columns](crate::columns)). Two mirror-like surfaces
//! close before each other then light each other up without end, though all others have long settled. From one iteration to the next
//! no more of a change can be left than the share that the brightest material reflects; where more is left, time and again, the links of
//! that leaf may carry less. Light that goes to and fro comes back every second iteration, so those are compared.

use crate::Rgb;
use crate::columns::{FREELY, STRICTLY};

/// A leaf whose light went on growing may have so much of it left to be carried, …
const REIN: f32 = 0.7;
/// … where it grew by more than this share within two iterations.
const NOTICED: f32 = 0.01;

/// What is known of the light of leaves since links were last refined.
#[derive(Clone, Debug, Default)]
pub(crate) struct Feedback {
    /// By node: of what leaves have, their links may carry so much as directional light.
    most: Vec<f32>,
    /// By node: irradiance (sum of channels) two, four and six iterations ago, in that order; fewer at first.
    before: Vec<Vec<f32>>,
}

impl Feedback {
    /// Forgets the series: the light is another one.
    pub(crate) fn restart(&mut self) {
        self.before.clear();
    }

    /// Makes room for so many nodes.
    pub(crate) fn fit(&mut self, count: usize) {
        self.most.resize(count, FREELY);
    }

    /// By node: of what leaves have, their links may carry so much as directional light.
    pub(crate) fn most(&self) -> &[f32] {
        &self.most
    }

    /// Takes the irradiance of every second iteration. Of a change no more than the share `kept` should be left by then.
    pub(crate) fn rein_in(&mut self, irradiance: &[Rgb], kept: f32) {
        let now: Vec<f32> = irradiance.iter().map(|irradiance| irradiance.element_sum()).collect();
        self.fit(now.len());
        if let [one, two, three] = self.before.as_slice() {
            for (node, most) in self.most.iter_mut().enumerate() {
                let changes = [now[node] - one[node], one[node] - two[node], two[node] - three[node]];
                let grows = changes[1] > kept * changes[2] && changes[0] > kept * changes[1];
                if grows && changes.iter().all(|&change| change > NOTICED * now[node]) {
                    *most = (*most * REIN).max(STRICTLY);
                }
            }
        }
        self.before.truncate(2);
        self.before.insert(0, now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What leaves may send, whose irradiance is as told after each second iteration.
    fn most(series: &[[f32; 2]]) -> Vec<f32> {
        let mut feedback = Feedback::default();
        for of in series {
            feedback.rein_in(&of.map(|sum| Rgb::new(sum, 0.0, 0.0)), 0.8);
        }
        feedback.most().to_vec()
    }

    #[test]
    fn only_what_goes_on_growing_is_reined_in() {
        // The second settles as fast as it must.
        let series: Vec<[f32; 2]> = (0..7).map(|i| [1.1_f32.powi(i), 1.0 - 0.75_f32.powi(i)]).collect();
        assert_eq!(most(&series[..3]), [FREELY; 2]);
        assert_eq!(most(&series[..4]), [FREELY * REIN, FREELY]);
        assert_eq!(most(&series), [STRICTLY, FREELY]);
    }

    #[test]
    fn what_hardly_grows_is_left_alone() {
        let series: Vec<[f32; 2]> = (0..7).map(|i| [1.0 + 0.005 * i as f32, 1.0 - 0.1 * i as f32]).collect();
        assert_eq!(most(&series), [FREELY; 2]);
    }
}

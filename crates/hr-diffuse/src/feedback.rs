//! Feedback: light that does not die out, as more comes back to leaves than they sent.
//!
//! The links of a sender may carry somewhat more directional light than it has ([columns](crate::columns)). Two mirror-like surfaces
//! close before each other then light each other up without end, though all others have long settled. And columns do not bound what a
//! leaf sends diffusely, only rows do, of what arrives: a small part that is lit by a mirror at its foot may light more of that than it has
//! light for. From one iteration to the next no more of a change can be left than the share that the brightest material reflects; where more
//! is left, time and again, the links of that leaf may carry less, and where that does not end it less of what arrives counts. Light that goes
//! to and fro comes back every second iteration, so those are compared: what there is, and by how much it differs from what there was in between.

use crate::Rgb;
use crate::columns::{FREELY, STRICTLY};

/// A leaf whose light went on growing may have so much of it left to be carried, or to arrive, …
const REIN: f32 = 0.7;
/// … where it grew by more than this share within two iterations, or went to and fro by as much.
const NOTICED: f32 = 0.01;

/// What is known of the light of leaves since links were last refined.
#[derive(Clone, Debug, Default)]
pub(crate) struct Feedback {
    /// By node: of what leaves have, their links may carry so much as directional light.
    most: Vec<f32>,
    /// By node: so much of what arrives at leaves counts.
    counts: Vec<f32>,
    /// By node: irradiance (sum of channels) after an iteration that has no second one yet.
    first: Option<Vec<f32>>,
    /// After each second iteration, the last one first; the last three at most.
    before: Vec<Second>,
}

/// Light after a second iteration.
#[derive(Clone, Debug)]
struct Second {
    /// By node: irradiance (sum of channels).
    irradiance: Vec<f32>,
    /// By node: how far that is from what it was an iteration before.
    swing: Vec<f32>,
}

impl Feedback {
    /// Forgets the series: the light is another one.
    pub(crate) fn restart(&mut self) {
        self.first = None;
        self.before.clear();
    }

    /// Makes room for so many nodes.
    pub(crate) fn fit(&mut self, count: usize) {
        self.most.resize(count, FREELY);
        self.counts.resize(count, 1.0);
    }

    /// By node: of what leaves have, their links may carry so much as directional light.
    pub(crate) fn most(&self) -> &[f32] {
        &self.most
    }

    /// So much of what arrives at a leaf counts.
    pub(crate) fn counts(&self, leaf: u32) -> f32 {
        self.counts.get(leaf as usize).copied().unwrap_or(1.0)
    }

    /// Whether the light of a leaf went on growing, or to and fro.
    pub(crate) fn is_reined(&self, leaf: u32) -> bool {
        self.most.get(leaf as usize).is_some_and(|&most| most < FREELY)
    }

    /// Takes the irradiance after an iteration. Of a change no more than the share `kept` should be left two iterations later.
    pub(crate) fn rein_in(&mut self, irradiance: &[Rgb], kept: f32) {
        let now: Vec<f32> = irradiance.iter().map(|irradiance| irradiance.element_sum()).collect();
        self.fit(now.len());
        let Some(first) = self.first.take() else {
            self.first = Some(now);
            return;
        };
        let now =
            Second { swing: now.iter().zip(first).map(|(now, first)| (now - first).abs()).collect(), irradiance: now };
        if let [one, two, three] = self.before.as_slice() {
            for (node, (most, counts)) in self.most.iter_mut().zip(&mut self.counts).enumerate() {
                let [now, one, two, three] = [&now, one, two, three].map(|of| (of.irradiance[node], of.swing[node]));
                let grows = [now.0 - one.0, one.0 - two.0, two.0 - three.0];
                let goes_on = |changes: [f32; 3], noticed: f32| {
                    let is_kept = changes[1] > kept * changes[2] && changes[0] > kept * changes[1];
                    is_kept && changes.iter().all(|&change| change > noticed)
                };
                // In between there may have been more.
                let swings = goes_on([now.1, one.1, two.1], NOTICED * (now.0 + now.1));
                if swings || goes_on(grows, NOTICED * now.0) {
                    *counts *= if *most > STRICTLY { 1.0 } else { REIN };
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

    const KEPT: f32 = 0.8;

    /// What leaves may send and how much counts of what arrives, whose irradiance is as told after each iteration.
    fn reined(series: impl Iterator<Item = [f32; 2]>) -> Vec<[f32; 2]> {
        let mut feedback = Feedback::default();
        series.for_each(|of| feedback.rein_in(&of.map(|sum| Rgb::new(sum, 0.0, 0.0)), KEPT));
        feedback.most().iter().zip(&feedback.counts).map(|(&most, &counts)| [most, counts]).collect()
    }

    const FREE: [f32; 2] = [FREELY, 1.0];

    #[test]
    fn only_what_goes_on_growing_is_reined_in() {
        // The second settles as fast as it must.
        let series = |count: i32| (0..count).map(|i| [1.05_f32.powi(i), 1.0 - 0.86_f32.powi(i)]);
        assert_eq!(reined(series(7)), [FREE; 2]);
        assert_eq!(reined(series(8)), [[FREELY * REIN, 1.0], FREE]);
        assert_eq!(reined(series(10)), [[STRICTLY, 1.0], FREE], "what is sent, first");
        assert_eq!(reined(series(14)), [[STRICTLY, REIN * REIN], FREE], "then what arrives");
    }

    #[test]
    fn what_goes_to_and_fro_is_reined_in() {
        // The same every second time: by that alone it would have settled. The second swings less and less.
        let series = |count: i32| (0..count).map(|i| [(i % 2) as f32, 1.0 + (-0.86_f32).powi(i)]);
        assert_eq!(reined(series(8)), [[FREELY * REIN, 1.0], FREE]);
        assert_eq!(reined(series(14)), [[STRICTLY, REIN * REIN], FREE]);
    }

    #[test]
    fn what_hardly_changes_is_left_alone() {
        let series = (0..14).map(|i| [1.0 + 0.0025 * i as f32, 1.0 + 0.004 * (i % 2) as f32]);
        assert_eq!(reined(series), [FREE; 2]);
    }

    #[test]
    fn another_light_is_another_series() {
        let mut feedback = Feedback::default();
        for i in 0..7 {
            feedback.rein_in(&[Rgb::splat((i % 2) as f32)], KEPT);
            if i == 4 {
                feedback.restart();
            }
        }
        assert_eq!((feedback.is_reined(0), feedback.counts(0)), (false, 1.0));
        assert_eq!((feedback.is_reined(9), feedback.counts(9)), (false, 1.0), "a leaf that nothing is known of");
    }
}

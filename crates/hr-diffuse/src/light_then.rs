//! The light by which leaves found their weights, to be compared with what there is now.

use crate::hierarchy::{Elements, Kind};
use crate::transport::Exitant;

/// By node: radiosity and directional light (sums of channels).
#[derive(Clone, Debug, Default)]
pub(crate) struct LightThen(Vec<[f32; 2]>);

impl LightThen {
    /// What there is.
    pub(crate) fn new(exitant: &Exitant) -> Self {
        let both = exitant.radiosity.iter().zip(&exitant.directional);
        Self(both.map(|it| [it.0.element_sum(), it.1.element_sum()]).collect())
    }

    /// All that a node sent; nothing if it was not there.
    pub(crate) fn of(&self, node: usize) -> f32 {
        self.0.get(node).map_or(0.0, |[diffuse, directional]| diffuse + directional)
    }

    /// By node, the share of its light that is distributed among its parts otherwise than it was. Where directional light goes is not
    /// known; as long as it is as much, it is taken to come from where it came from, and to go where it went.
    pub(crate) fn uneven(&self, elements: &Elements, exitant: &Exitant) -> Vec<f32> {
        let (mut then, now) = (self.clone(), Self::new(exitant));
        // Parts that are new had the light of what they are parts of.
        for node in then.0.len()..now.0.len() {
            then.0.push(then.0[elements.nodes[node].parent as usize]);
        }
        let redirected = |(before, now): (&[f32; 2], &[f32; 2])| {
            let changed = (now[1] - before[1]).abs();
            if changed > 0.0 { changed / (now[0] + now[1]) } else { 0.0 }
        };
        let redirected = then.0.iter().zip(&now.0).map(redirected);
        then.redistributed(elements, &now).into_iter().zip(redirected).map(|(a, b)| a + b).collect()
    }

    /// By node: by which share of its power the light of its parts is distributed otherwise `now`.
    fn redistributed(&self, elements: &Elements, now: &Self) -> Vec<f32> {
        let mut changed = vec![0.0; elements.nodes.len()];
        for (node, element) in elements.nodes.iter().enumerate().rev() {
            let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
            let scale = now.of(node) / self.of(node);
            let (mut sum, mut power) = (0.0, 0.0);
            for child in children.filter(|&child| elements.nodes[child].kind != Kind::Light) {
                let own = now.of(child) * elements.nodes[child].area;
                // What there would be if it had changed as the whole has.
                let even = self.of(child) * scale * elements.nodes[child].area;
                sum += own * changed[child] + (own - even).abs();
                power += own;
            }
            if power > 0.0 {
                changed[node] = if sum.is_finite() { sum / power } else { f32::INFINITY };
            }
        }
        changed
    }
}

//! Where links say that reflected light comes from: rays toward it find what is small and bright, of which rays all over the hemisphere
//! seldom meet any. Which of both finds more of it decides how much they count (the balance heuristic of E. Veach, L. Guibas, "Optimally
//! combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995), so that links that are wrong or missing cost rays only.

use super::{children, point};
use crate::Rgb;
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::links::Links;
use crate::segments::pick;
use crate::transport::Light;
use glam::{Vec2, Vec3};

/// What arrives through each link, and the share of it that has been reflected, by sender.
#[derive(Clone, Copy)]
pub(crate) struct Brought<'a> {
    pub(crate) links: &'a Links,
    pub(crate) arriving: &'a [Rgb],
    pub(crate) shares: &'a [f32],
}

/// Senders of reflected light to a leaf, and the probability that each of them is looked at.
pub(super) struct Senders {
    /// By node.
    probabilities: Vec<(u32, f32)>,
    /// The leaf's own surface, at which it never looks.
    surface: u32,
}

/// A point of a sender, drawn.
pub(super) struct Toward {
    pub(super) leaf: u32,
    pub(super) at: Vec3,
    pub(super) normal: Vec3,
    /// What it counts, as parts of some surfaces are not drawn evenly.
    pub(super) weight: f32,
}

impl Senders {
    /// Those of a leaf, by what its links bring.
    pub(super) fn of<L: LightField>(light: Light<'_, L>, leaf: u32, brought: Brought<'_>) -> Self {
        let (links, mut node, mut all) = (brought.links, leaf, 0.0);
        let mut probabilities = Vec::new();
        loop {
            for (link, arriving) in links.of(node).iter().zip(&brought.arriving[links.range(node)]) {
                let power = arriving.max(Rgb::ZERO).element_sum() * brought.shares[link.sender as usize];
                if power > 0.0 && light.element(link.sender).kind != Kind::Light {
                    all += power;
                    probabilities.push((link.sender, power));
                }
            }
            if node == 0 {
                break;
            }
            node = light.element(node).parent;
        }
        probabilities.iter_mut().for_each(|(_, probability)| *probability /= all);
        probabilities.sort_unstable_by_key(|&(node, _)| node);
        Self { probabilities, surface: light.element(leaf).source }
    }

    /// Per area of a leaf, the probability (density) that its points are looked at.
    pub(super) fn density<L: LightField>(&self, light: Light<'_, L>, leaf: u32) -> f32 {
        if light.element(leaf).source == self.surface {
            return 0.0;
        }
        let (mut node, mut density) = (leaf, 0.0);
        loop {
            let first = self.probabilities.partition_point(|&(other, _)| other < node);
            let found = self.probabilities[first..].iter().take_while(|&&(other, _)| other == node);
            density += found.map(|(_, probability)| probability).sum::<f32>() / light.element(node).area;
            if node == 0 {
                return density;
            }
            node = light.element(node).parent;
        }
    }

    /// A point of a sender for three numbers in 0…1.
    pub(super) fn pick<L: LightField>(&self, light: Light<'_, L>, choice: f32, u: Vec2) -> Option<Toward> {
        let (picked, mut choice) = pick(self.probabilities.iter().map(|&(_, probability)| probability), choice, 1.0)?;
        let mut leaf = self.probabilities[picked].0;
        while light.element(leaf).child_count > 0 {
            let areas = || children(light, leaf).map(|child| light.element(child).area);
            let (picked, rest) = pick(areas(), choice, areas().sum())?;
            (leaf, choice) = (light.element(leaf).first_child + picked as u32, rest);
        }
        let (at, normal, area) = point(light, leaf, u);
        let element = light.element(leaf);
        let weight = area / element.area;
        (element.source != self.surface).then_some(Toward { leaf, at, normal, weight })
    }
}

//! Where links say that reflected light comes from: rays toward it find what is small and bright, of which rays all over the hemisphere
//! seldom meet any. Which of both finds more of it decides how much they count (the balance heuristic of E. Veach, L. Guibas, "Optimally
//! combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995), so that links that are wrong or missing cost rays only.

use super::{children, point, reflected_from, seen_along};
use crate::Rgb;
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::links::Links;
use crate::segments::pick;
use crate::transport::Light;
use crate::visibility::NO_BLOCKER;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// What arrives through each link, and the share of it that has been reflected, by sender.
pub(crate) struct Brought<'a> {
    pub(crate) links: &'a Links,
    pub(crate) arriving: &'a [Rgb],
    pub(crate) shares: Vec<f32>,
}

impl<'a> Brought<'a> {
    /// Where what arrives is known by link.
    pub(crate) fn known<L: LightField>(light: Light<'_, L>, links: &'a Links, arriving: &'a [Rgb]) -> Option<Self> {
        (arriving.len() == links.all().len()).then(|| Self { links, arriving, shares: light.reflected_shares() })
    }
}

/// A point that light arrives at.
#[derive(Clone, Copy)]
pub(crate) struct ReceivingPoint {
    pub(crate) at: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) surface: u32,
}

/// How many rays (on average) go all over the hemisphere, and how many toward senders.
#[derive(Clone, Copy)]
pub(crate) struct Rays {
    pub(crate) all_over: f32,
    pub(crate) toward: f32,
}

/// Senders of reflected light to a node, and the probability that each of them is looked at.
pub(crate) struct Senders {
    /// By node.
    probabilities: Vec<(u32, f32)>,
}

impl Senders {
    /// Those of a node, by what its links bring.
    pub(crate) fn of<L: LightField>(light: Light<'_, L>, mut node: u32, brought: &Brought<'_>) -> Self {
        let (links, mut all) = (brought.links, 0.0);
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
        Self { probabilities }
    }

    /// What a ray all over the hemisphere adds to the mean reflected light (π times its radiance, sum of channels) that such rays find together.
    pub(crate) fn all_over<L: LightField>(
        &self,
        light: Light<'_, L>,
        from: ReceivingPoint,
        direction: Vec3,
        rays: Rays,
    ) -> f32 {
        let Some((hit, sender)) = seen_along(light, from.at, direction, from.surface) else { return 0.0 };
        let cosines = from.normal.dot(direction) * hit.normal.dot(direction).abs();
        let counted = self.counted(light, sender, cosines / (hit.point - from.at).length_squared(), rays);
        reflected_from(light, (sender, hit.point), direction) / counted
    }

    /// What a ray toward a sender, drawn by three numbers in 0…1, adds to that. `None` where it is of no use to shoot it.
    pub(crate) fn toward<L: LightField>(
        &self,
        light: Light<'_, L>,
        from: ReceivingPoint,
        drawn: (f32, Vec2),
        rays: Rays,
    ) -> Option<f32> {
        let (sender, at, normal, weight) = self.draw(light, drawn)?;
        let to = at - from.at;
        let direction = to.normalize_or_zero();
        let (cosine, cosine_there) = (from.normal.dot(direction), -normal.dot(direction));
        let source = light.element(sender).source;
        // Rounding must not make what is flat a sender to itself; what is hollow is one.
        let is_own = source == from.surface && light.scene.surfaces()[source as usize].is_polygon();
        if is_own || cosine <= 0.0 || cosine_there <= 0.0 {
            return None;
        }
        if light.scene.visibility.occluded(from.at, at, [from.surface, source], &mut NO_BLOCKER.clone()) {
            return Some(0.0);
        }
        let counted = self.counted(light, sender, cosine * cosine_there / to.length_squared(), rays);
        Some(weight * reflected_from(light, (sender, at), direction) / counted)
    }

    /// The number of rays that come by a leaf over that of those all over the hemisphere, which meet its points by this kernel / π.
    fn counted<L: LightField>(&self, light: Light<'_, L>, leaf: u32, kernel: f32, rays: Rays) -> f32 {
        let density = self.density(light, leaf);
        // Nothing is meant where a ray just grazes what no link knows of.
        rays.all_over + if density > 0.0 { rays.toward * density * PI / kernel } else { 0.0 }
    }

    /// Per area of a leaf, the probability (density) that its points are looked at.
    fn density<L: LightField>(&self, light: Light<'_, L>, leaf: u32) -> f32 {
        let (mut node, mut density) = (leaf, 0.0);
        loop {
            let first = self.probabilities.partition_point(|&(other, _)| other < node);
            let found = self.probabilities[first..].iter().take_while(|&&(other, _)| other == node);
            density += found.map(|(_, probability)| probability / light.element(node).area).sum::<f32>();
            if node == 0 {
                return density;
            }
            node = light.element(node).parent;
        }
    }

    /// A leaf of a sender, and a point of it with its normal and what it counts, as parts of some surfaces are not drawn evenly.
    fn draw<L: LightField>(&self, light: Light<'_, L>, (choice, u): (f32, Vec2)) -> Option<(u32, Vec3, Vec3, f32)> {
        let (picked, mut choice) = pick(self.probabilities.iter().map(|&(_, probability)| probability), choice, 1.0)?;
        let mut leaf = self.probabilities[picked].0;
        while light.element(leaf).child_count > 0 {
            let areas = || children(light, leaf).map(|child| light.element(child).area);
            let (picked, rest) = pick(areas(), choice, areas().sum())?;
            (leaf, choice) = (light.element(leaf).first_child + picked as u32, rest);
        }
        let (at, normal, area) = point(light, leaf, u);
        Some((leaf, at, normal, area / light.element(leaf).area))
    }
}

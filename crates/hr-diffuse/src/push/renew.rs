//! Weights found once more, when light is in place: next to where surfaces meet senders are dark that were as bright as the rest of them when
//! places first looked.

use super::{BETWEEN_WATCHES, Look, Place, Push, Spread, by_place, visible};
use crate::Rgb;
use crate::hooks::LightField;
use crate::links::Links;
use crate::threads;
use crate::transport::Light;
use std::ops::ControlFlow;

/// Weights are found anew at places where near senders bring less by more than this share of all light than weights tell; …
const STALE_SHARE: f32 = 0.3;
/// … those of them that may bring less by more than this share of that are asked.
const MISSING_SHARE: f32 = 0.25;
/// Where more than this share of what a sender sends is an extension's, what was found stays, as its parts have no lobes of their own, …
const DIRECTIONAL_SHARE: f32 = 0.1;
/// … unless it takes up more than this share of the view: then it hides what else there was.
const MOST_OF_VIEW: f32 = 0.5;

/// Whether what a sender of which parts take up so much of a `view` brings there is told by what these parts send.
pub(super) fn is_told<L: LightField>(light: Light<'_, L>, sender: u32, view: f32) -> bool {
    let directional = light.exitant.directional[sender as usize].element_sum();
    let all = directional + light.exitant.radiosity[sender as usize].element_sum();
    view > MOST_OF_VIEW || directional <= DIRECTIONAL_SHARE * all
}

impl Push {
    /// Finds the weights of those places anew that get less from near senders than their weights tell. By node, so much of its light is
    /// `uneven`, distributed otherwise than when they were found; by link, what of it is `directional`. Returns the number of places; those
    /// that are left when `watch` breaks stay as they are.
    pub(crate) fn renew<L: LightField>(
        &mut self,
        light: Light<'_, L>,
        links: &Links,
        (uneven, directional): (&[f32], &[Rgb]),
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> u64 {
        threads::map_mut(&mut self.means, 256, |at, mean| {
            let link = &links.all()[at];
            let directional = directional.get(at).copied().unwrap_or_default();
            *mean = light.emitted_with(link, directional).element_sum() * link.factor;
        });
        let is_stale = |index: usize| {
            let node = self.places.nodes[index];
            let place = Place::new(light, node, self.places.middle(light.elements, node), self.aim);
            let irradiance = light.exitant.irradiance[node as usize].element_sum();
            let mut missing = 0.0;
            self.each_weight(light, links, index, |at, weight| {
                let (link, most) = (&links.all()[at], weight.value * self.means[at]);
                let passes = visible(link, Spread::Exact);
                let may_matter =
                    most * passes * uneven[link.sender as usize] > MISSING_SHARE * STALE_SHARE * irradiance;
                let is_near = || !place.spots(light).is_far(light.element(link.sender));
                if may_matter && is_near() {
                    let (here, view) = place.varying(light, link);
                    if is_told(light, link.sender, view) {
                        missing += passes * (most - here.value).max(0.0);
                    }
                }
            });
            missing > STALE_SHARE * irradiance
        };
        let stale: Vec<bool> = threads::map_range(0..self.first.len() - 1, 16, is_stale);
        let mut weights = std::mem::take(&mut self.weights);
        let mut parts = by_place(&mut weights, &self.first, &self.places.nodes);
        let mut parts: Vec<(usize, &mut (u32, &mut [f32]))> =
            parts.iter_mut().enumerate().filter(|(index, _)| stale[*index]).collect();
        let (mut renewed, mut rays, mut dim_views) = (0, 0, std::mem::take(&mut self.dim_views));
        for part in parts.chunks_mut(BETWEEN_WATCHES * threads::current_num_threads()) {
            if watch().is_break() {
                break;
            }
            let found = threads::map_mut(part, 4, |_, (_, part)| self.find(light, links, part, Look::Again));
            for ((index, _), looked) in part.iter().zip(found) {
                dim_views[*index] = looked.dim_view;
                rays += u64::from(looked.rays);
                renewed += 1;
            }
        }
        (self.weights, self.dim_views) = (weights, dim_views);
        self.rays += rays;
        renewed
    }
}

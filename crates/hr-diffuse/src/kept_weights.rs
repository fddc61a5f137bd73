//! What leaves found out that stays when something has moved: weights for senders that shine as they did, or matter little, where
//! nothing came or went between leaf and sender. Leaves need not look for themselves again what these bring. Which of their links are
//! fine enough still, and which leaves receive light from elsewhere now, is told from the same.

use crate::Rgb;
use crate::gather::Gather;
use crate::hierarchy::Elements;
use crate::hooks::LightField;
use crate::light_then::LightThen;
use crate::links::{Link, Links};
use crate::moved::Moved;
use crate::push::{Spread, Weight, visible};
use crate::refine::Pair;
use crate::transport::{Exitant, Light};
use std::cmp::Reverse;
use std::iter::Peekable;
use std::vec::IntoIter;

/// Links of senders that are up to so many times as bright as they were are taken to be fine enough still: rays find out whether they are.
const RISEN: f32 = 1.5;
/// Where light of a sender that is distributed otherwise than it was brings a place no more than this share of its irradiance, times
/// the tolerance, its weight stays all the same.
pub(crate) const UNEVEN_SHARE: f32 = 0.05;

/// What leaves found out over the links that there were.
#[derive(Clone, Debug)]
pub(crate) struct KeptWeights {
    gather: Gather,
    links: Links,
    /// By link: whether what has moved does not concern it at all.
    stays: Vec<bool>,
    moved: Moved,
    /// When the weights were found.
    light: LightThen,
    /// By node: the share of its light that is distributed otherwise than it was then.
    uneven: Vec<f32>,
    /// Whether leaves need not look for themselves at other links either: not before most of the light is there.
    pub(crate) rough: bool,
}

impl KeptWeights {
    /// Those of links of which some stay.
    pub(crate) fn new(gather: Gather, links: Links, stays: Vec<bool>, moved: Moved, exitant: &Exitant) -> Self {
        Self { gather, links, stays, moved, light: LightThen::new(exitant), uneven: Vec::new(), rough: false }
    }

    /// Finds which senders' light is distributed among their parts otherwise than it was.
    pub(crate) fn with_light(mut self, elements: &Elements, exitant: &Exitant) -> Self {
        self.uneven = self.light.uneven(elements, exitant);
        self
    }

    /// Links that are as fine as they were made to be, and others: those of senders that are much brighter than they were.
    pub(crate) fn as_fine_as_ever(&self, links: Vec<Link>, exitant: &Exitant) -> (Vec<Link>, Vec<Link>) {
        let now = LightThen::new(exitant);
        let is_fine = |link: &Link| now.of(link.sender as usize) <= RISEN * self.light.of(link.sender as usize);
        links.into_iter().partition(is_fine)
    }

    /// What is to be known a second time: it was used for a rough look at the light.
    pub(crate) fn once_more(self) -> Option<Self> {
        self.rough.then_some(Self { rough: false, ..self })
    }

    /// By node, the share of what arrives there that did not arrive before, or does not any more, from where it does: of what its links
    /// and those above it bring. Nothing is taken to arrive as it did where the node or its sender, or parts of them, have moved.
    pub(crate) fn reshaped(&mut self, elements: &Elements, (links, arriving): (&Links, &[Rgb])) -> Vec<f32> {
        let brought = |links: &Links, arriving: &[Rgb], node: u32| -> Vec<(u32, f32)> {
            let arriving = |at: usize| arriving.get(at).map_or(0.0, |arriving| arriving.element_sum().max(0.0));
            links.range(node).map(|at| (links.all()[at].sender, arriving(at))).collect()
        };
        self.moved.mark(elements);
        // By node: all that arrives, what of it did not, and what did and does not any more.
        let mut sums = vec![[0.0_f32; 3]; elements.nodes.len()];
        for node in 0..sums.len() {
            let [mut all, mut came, mut went] =
                if node > 0 { sums[elements.nodes[node].parent as usize] } else { [0.0; 3] };
            let mut before = brought(&self.links, self.gather.arriving(), node as u32).into_iter().peekable();
            for (sender, now) in brought(links, arriving, node as u32) {
                while let Some((_, gone)) = before.next_if(|(other, _)| *other < sender) {
                    went += gone;
                }
                let was = before.next_if(|(other, _)| *other == sender).map_or(0.0, |(_, was)| was);
                let stays = if self.moved.is_below(sender) { 0.0 } else { now.min(was) };
                (all, came, went) = (all + now, came + now - stays, went + was - stays);
            }
            went += before.map(|(_, gone)| gone).sum::<f32>();
            sums[node] = [all, came, went];
        }
        let share = |(node, [all, came, went]): (usize, [f32; 3])| {
            let changed = if self.moved.is_below(node as u32) { f32::INFINITY } else { came.max(went) };
            if changed > 0.0 { changed / all } else { 0.0 }
        };
        sums.into_iter().enumerate().map(share).collect()
    }

    /// Weights of a place, in the order of the nodes from the place up to the root, then of senders.
    pub(crate) fn of(&self, elements: &Elements, place: u32) -> PlaceWeights<'_> {
        let (left, dim_view) = self.gather.looked_at(elements, place);
        PlaceWeights { kept: self, place, dim_view, left: left.into_iter().peekable() }
    }
}

/// Weights that a place found, over links in order.
pub(crate) struct PlaceWeights<'a> {
    kept: &'a KeptWeights,
    place: u32,
    /// As in [`Push`](crate::push::Push); of a place that is not known, nothing.
    pub(crate) dim_view: Option<f32>,
    left: Peekable<IntoIter<(usize, Weight)>>,
}

impl PlaceWeights<'_> {
    /// The one for a link, if it stays; those for links before it are passed over. `brings` is what the link brings to its
    /// receiver; up to `negligible` of it may come from elsewhere than it did.
    pub(crate) fn take<L: LightField>(
        &mut self,
        light: Light<'_, L>,
        link: &Link,
        (brings, negligible): (f32, f32),
    ) -> Option<Weight> {
        let KeptWeights { links, stays, moved, uneven, .. } = self.kept;
        let order = |link: &Link| (Reverse(link.receiver), link.sender);
        while self.left.next_if(|(at, _)| order(&links.all()[*at]) < order(link)).is_some() {}
        let (at, weight) = self.left.next_if(|(at, _)| order(&links.all()[*at]) == order(link))?;
        // What the link brings to its receiver may be another mean now.
        let passes = |link: &Link| link.factor * visible(link, Spread::Exact);
        let weight = weight * (passes(&links.all()[at]) / passes(link));
        let pair = Pair { receiver: self.place, sender: link.sender };
        let stays = weight.value.is_finite()
            && weight.value * brings * uneven[link.sender as usize] <= negligible
            && (stays[at] || !moved.concerns(light.scene, light.elements, pair));
        stays.then_some(weight)
    }
}

//! Weights of leaves that stay when something has moved: those for senders that shine as they did, where nothing came or went
//! between leaf and sender. Leaves need not look for themselves again what these bring.

use crate::Rgb;
use crate::gather::Gather;
use crate::hierarchy::{Elements, Kind};
use crate::hooks::LightField;
use crate::links::{Link, Links};
use crate::moved::Moved;
use crate::push::{Spread, Weight, visible};
use crate::refine::Pair;
use crate::transport::{Exitant, Light};
use std::cmp::Reverse;
use std::iter::Peekable;
use std::vec::IntoIter;

/// What leaves found out over the links that there were.
#[derive(Debug)]
pub(crate) struct KeptWeights {
    gather: Gather,
    links: Links,
    /// By link: whether what has moved does not concern it at all.
    stays: Vec<bool>,
    moved: Moved,
    /// By node: radiosity when the weights were found.
    radiosity: Vec<Rgb>,
    /// By node: whether its light is distributed as it was then.
    even: Vec<bool>,
    /// Whether leaves need not look for themselves at other links either: not before most of the light is there.
    pub(crate) rough: bool,
}

impl KeptWeights {
    /// Those of links of which some stay.
    pub(crate) fn new(gather: Gather, links: Links, stays: Vec<bool>, moved: Moved, radiosity: Vec<Rgb>) -> Self {
        Self { gather, links, stays, moved, radiosity, even: Vec::new(), rough: false }
    }

    /// Leaves out senders whose light is distributed among their parts otherwise than it was, by more than a share.
    pub(crate) fn with_light(mut self, elements: &Elements, exitant: &Exitant, share: f32) -> Self {
        let changed = redistributed(elements, &self.radiosity, &exitant.radiosity);
        // How directional light is distributed is not known.
        let even = changed.iter().zip(&exitant.directional).map(|(by, also)| *by <= share && *also == Rgb::ZERO);
        self.even = even.collect();
        self
    }

    /// What is to be known a second time: it was used for a rough look at the light.
    pub(crate) fn once_more(self) -> Option<Self> {
        self.rough.then_some(Self { rough: false, ..self })
    }

    /// Weights of a place that stay, with their links: in the order of the nodes from the place up to the root, then of senders.
    pub(crate) fn of<L: LightField>(&self, light: Light<'_, L>, place: u32) -> Vec<(Link, Weight)> {
        let stay = |(at, weight): (usize, Weight)| {
            let link = self.links.all()[at];
            let pair = Pair { receiver: place, sender: link.sender };
            let stays = self.even[link.sender as usize]
                && (self.stays[at] || !self.moved.concerns(light.scene, light.elements, pair));
            stays.then_some((link, weight))
        };
        self.gather.looked_at(light.elements, place).into_iter().filter_map(stay).collect()
    }
}

/// The weight for a link among those of a place that are left; the links before it are passed over.
pub(crate) fn take(known: &mut Peekable<IntoIter<(Link, Weight)>>, link: &Link) -> Option<Weight> {
    let place = |link: &Link| (Reverse(link.receiver), link.sender);
    while known.next_if(|(other, _)| place(other) < place(link)).is_some() {}
    let (before, weight) = known.next_if(|(other, _)| place(other) == place(link))?;
    // What the link brings to its receiver may be another mean now.
    let brings = |link: &Link| link.factor * visible(link, Spread::Exact);
    let weight = weight * (brings(&before) / brings(link));
    weight.value.is_finite().then_some(weight)
}

/// By node: by which share of its power the light of its parts is distributed otherwise than it was.
fn redistributed(elements: &Elements, before: &[Rgb], now: &[Rgb]) -> Vec<f32> {
    let light = |all: &[Rgb], node: usize| all.get(node).map_or(0.0, |radiosity| radiosity.element_sum());
    let mut changed = vec![0.0; elements.nodes.len()];
    for (node, element) in elements.nodes.iter().enumerate().rev() {
        let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
        let scale = light(now, node) / light(before, node);
        let (mut sum, mut power) = (0.0, 0.0);
        for child in children.filter(|&child| elements.nodes[child].kind != Kind::Light) {
            let own = light(now, child) * elements.nodes[child].area;
            // What there would be if it had changed as the whole has.
            let even = light(before, child) * scale * elements.nodes[child].area;
            sum += own * changed[child] + (own - even).abs();
            power += own;
        }
        if power > 0.0 {
            changed[node] = if sum.is_finite() { sum / power } else { f32::INFINITY };
        }
    }
    changed
}

//! Weights of leaves that stay when something has moved: those for senders that shine as they did, where nothing came or went
//! between leaf and sender. Leaves need not look for themselves again what these bring. Which links of theirs are
//! still fine enough is told from the same light.

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

/// Links of senders that are up to so many times as bright as they were are taken to be fine enough still: rays find out whether they are.
const RISEN: f32 = 1.5;

/// What leaves found out over the links that there were.
#[derive(Clone, Debug)]
pub(crate) struct KeptWeights {
    gather: Gather,
    links: Links,
    /// By link: whether what has moved does not concern it at all.
    stays: Vec<bool>,
    moved: Moved,
    /// By node: radiosity and directional light (sums of channels) when the weights were found.
    light: Vec<[f32; 2]>,
    /// By node: whether its light is distributed as it was then.
    even: Vec<bool>,
    /// Whether leaves need not look for themselves at other links either: not before most of the light is there.
    pub(crate) rough: bool,
}

impl KeptWeights {
    /// Those of links of which some stay.
    pub(crate) fn new(gather: Gather, links: Links, stays: Vec<bool>, moved: Moved, exitant: &Exitant) -> Self {
        Self { gather, links, stays, moved, light: light(exitant), even: Vec::new(), rough: false }
    }

    /// Leaves out senders whose light is distributed among their parts otherwise than it was, by more than a share. Where directional
    /// light goes is not known; as long as it is as much, it is taken to come from where it came from, and to go where it went.
    pub(crate) fn with_light(mut self, elements: &Elements, exitant: &Exitant, share: f32) -> Self {
        let now = light(exitant);
        let changed = redistributed(elements, &self.light, &now);
        let as_much = |before: Option<&[f32; 2]>, now: [f32; 2]| {
            now[1] == 0.0 || before.is_some_and(|before| (now[1] - before[1]).abs() <= share * now[1])
        };
        let even = |(node, by): (usize, &f32)| *by <= share && as_much(self.light.get(node), now[node]);
        self.even = changed.iter().enumerate().map(even).collect();
        self
    }

    /// Links that are as fine as they were made to be, and others: those of senders that are much brighter than they were.
    pub(crate) fn as_fine_as_ever(&self, links: Vec<Link>, exitant: &Exitant) -> (Vec<Link>, Vec<Link>) {
        let sum = |[diffuse, directional]: [f32; 2]| diffuse + directional;
        let now = light(exitant);
        let is_fine = |link: &Link| {
            let before = self.light.get(link.sender as usize).copied().map_or(0.0, sum);
            sum(now[link.sender as usize]) <= RISEN * before
        };
        links.into_iter().partition(is_fine)
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

/// By node: radiosity and directional light (sums of channels).
fn light(exitant: &Exitant) -> Vec<[f32; 2]> {
    exitant.radiosity.iter().zip(&exitant.directional).map(|it| [it.0.element_sum(), it.1.element_sum()]).collect()
}

/// By node: by which share of its power the light of its parts is distributed otherwise than it was.
fn redistributed(elements: &Elements, before: &[[f32; 2]], now: &[[f32; 2]]) -> Vec<f32> {
    let light =
        |all: &[[f32; 2]], node: usize| all.get(node).map_or(0.0, |[diffuse, directional]| diffuse + directional);
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

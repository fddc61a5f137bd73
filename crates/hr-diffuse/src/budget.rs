//! Budgets of time and memory: where one is spent, refinement ends, and light settles over what is linked by then.

use crate::clock::Instant;
use crate::gather;
use crate::hierarchy::{Element, Elements};
use crate::hooks::LightField;
use crate::links::Link;
use crate::shooting;
use crate::solver::{Settings, Transport};
use crate::{Facing, Rgb};
use std::time::Duration;

/// What a solve may cost; without limits by default.
///
/// Refinement ends as soon as one of the budgets is spent. Light still settles over what is linked by then, so the
/// solution is a coarser one, not a darker one; [`Stats::spent`](crate::Stats::spent) tells which budget it was. With a
/// budget of time the result depends on the machine's speed; with one of memory it does not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Budget {
    /// Wall-clock time from the making of the solver (the scene's hierarchy included) to the end of refinement. Light
    /// may settle for a quarter more; then a few iterations over the links that there are must do. Values at vertices
    /// and the final reflection for display come after it. On `wasm32-unknown-unknown`, which has no clock, it is never spent: break
    /// off by what is watching instead.
    pub time: Option<Duration>,
    /// Bytes of elements, links and what the extension keeps of them while light is transported; the pairs that a
    /// refinement looks at come on top. What the scene itself takes must be had anyhow: no budget is too small for a
    /// first solution. The final reflection for display takes more.
    pub memory: Option<u64>,
}

/// A budget that was spent before the solution had the error asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spent {
    /// [`Budget::time`].
    Time,
    /// [`Budget::memory`].
    Memory,
}

/// After the end of refinement light may settle for this share of a budget of time.
const SETTLING: f64 = 0.25;

/// Parts of an element that is split, at most.
const PARTS: u64 = 4;

/// Watches over a [`Budget`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Account {
    budget: Budget,
    begin: Instant,
    transport: Transport,
    /// Bytes of the extension and of weights, per link, when light last was transported.
    extension: f64,
}

impl Account {
    pub(crate) fn new(settings: Settings, begin: Instant) -> Self {
        Self { budget: settings.budget, begin, transport: settings.transport, extension: 0.0 }
    }

    /// Bytes that so many nodes and links take in the solver, without what the extension keeps elsewhere.
    fn bytes<L: LightField>(&self, nodes: u64, links: u64) -> u64 {
        // Radiosity, range, irradiance and its last value, directional; facing; whose light it is, gain, peak, brightest, adaptation.
        let exitant = 6 * size_of::<Rgb>() + size_of::<Facing>() + 5 * size_of::<u32>();
        let node =
            size_of::<Element>() + exitant + gather::NODE_BYTES + size_of::<L::Incident>() + size_of::<L::Exitant>();
        let link = size_of::<Link>() + gather::LINK_BYTES;
        let [more, also] = match self.transport {
            Transport::Gather => [0; 2],
            Transport::Shoot => [shooting::NODE_BYTES, shooting::LINK_BYTES],
        };
        nodes * (node + more) as u64 + links * (link + also) as u64
    }

    /// Whether a solution of so many nodes and links is more than there is memory for.
    pub(crate) fn is_full<L: LightField>(&self, nodes: u64, links: u64) -> bool {
        let bytes = || self.bytes::<L>(nodes, links) + (links as f64 * self.extension) as u64;
        self.budget.memory.is_some_and(|memory| bytes() > memory)
    }

    /// Bytes that are left for weights, which need not be kept.
    pub(crate) fn room<L: LightField>(&self, nodes: u64, links: u64) -> u64 {
        self.budget.memory.map_or(u64::MAX, |memory| memory.saturating_sub(self.bytes::<L>(nodes, links)))
    }

    /// Whether it is too late to refine.
    pub(crate) fn is_late(&self) -> bool {
        self.budget.time.is_some_and(|time| self.begin.elapsed() >= time)
    }

    /// Whether light has had its time to settle, too.
    pub(crate) fn is_over(&self) -> bool {
        let now = self.begin.elapsed().as_secs_f64();
        self.budget.time.is_some_and(|time| now >= time.as_secs_f64() * (1.0 + SETTLING))
    }

    /// Takes note of what the extension keeps, and of the bytes of weights of links on leaves; returns the bytes of it all.
    pub(crate) fn measure<L: LightField>(
        &mut self,
        field: &L,
        incident: &[L::Incident],
        reflected: &[L::Exitant],
        links: u64,
        weights: u64,
    ) -> u64 {
        let received: usize = incident.iter().map(|light| field.incident_bytes(light)).sum();
        let sent: usize = reflected.iter().map(|light| field.exitant_bytes(light)).sum();
        let extension = weights + (received + sent) as u64;
        self.extension = extension as f64 / links.max(1) as f64;
        self.bytes::<L>(incident.len() as u64, links) + extension
    }
}

/// What there will be when a wave of refinement is done: nodes, and links with the pairs that may become some.
#[derive(Debug)]
pub(crate) struct Growth {
    pub(crate) nodes: u64,
    pub(crate) links: u64,
    /// Leaves that are to be split already.
    split: Vec<bool>,
}

impl Growth {
    pub(crate) fn new(elements: &Elements, links: usize) -> Self {
        let nodes = elements.nodes.len();
        Self { nodes: nodes as u64, links: links as u64, split: vec![false; nodes] }
    }

    /// Counts a pair of which these nodes are to be split.
    pub(crate) fn add(&mut self, elements: &Elements, nodes: &[u32]) {
        let mut parts = 1;
        for &node in nodes {
            let children = u64::from(elements.nodes[node as usize].child_count);
            if children == 0 && !std::mem::replace(&mut self.split[node as usize], true) {
                self.nodes += PARTS;
            }
            parts *= if children == 0 { PARTS } else { children };
        }
        self.links += parts - 1;
    }
}

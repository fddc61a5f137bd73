//! Push: the light that inner nodes received is handed down to the leaves below them.
//!
//! A link holds the mean over the node that it ends at; a leaf in a corner of it sees more of the sender or less, from
//! another side. So every leaf, or [place](crate::places) of several, has a weight for each link above it: what the sender brings
//! there, over what it brings to the node. The weights stay the same until links change, and are kept where they fit. Links that bring
//! next to nothing are spread evenly over flat nodes, and by orientation and distance alone over others: see
//! [`inherited`](crate::inherited).

use crate::NodeId;
use crate::all_over::{Points, Spots};
use crate::effort::Aim;
use crate::gather::{GROUPS, Group, share};
use crate::hierarchy::{Element, Elements, GRAFT, Kind, SceneData};
use crate::hooks::{Hierarchy, LightField};
use crate::inherited::{Above, Carried, inherit};
use crate::kept_weights::{KeptWeights, UNEVEN_SHARE};
use crate::links::{Link, Links};
use crate::places::{Edges, Places};
use crate::sampling::{hash, unit};
use crate::segments::{receiving_point, visibility};
use crate::threads;
use crate::toward::Detail;
use crate::transport::{Light, negligible};
use crate::visibility::Proof;
use glam::{Vec2, Vec3};
use smallvec::SmallVec;
use std::ops::{ControlFlow, Mul};

/// No more weights than these are kept: 256 MB. In larger scenes the leaves beyond have weights by orientation and distance
/// alone, which are found anew in each iteration.
const MOST_KEPT: usize = 1 << 26;
/// Links that bring less than this share of all that arrives, times the square root of the tolerance and over the
/// [effort](crate::effort), are not looked at closely.
const FAINT_SHARE: f32 = 0.003;
/// That is their share of what arrives at the dimmest leaf below a receiver, as of a wall that goes on into a dark room; but of no less than
/// this share of all that arrives anywhere: nobody looks closely where it is darker still.
const DIMMEST_SHARE: f32 = 0.01;
/// Leaves look for themselves at links of their own that bring more than this share of their light: others let so much through as
/// their segments found.
const OWN_SHARE: f32 = 0.02;
/// Links that bring a leaf more than this share of its light from near by, times the square root of the tolerance, are looked at from
/// several points of it.
const MUCH_SHARE: f32 = 0.045;
/// Dark parts of senders that take up no more than this share of a place's view beyond what its weights tell are not told from noise.
const LEAST_DIM_VIEW: f32 = 0.1;
/// Points of a place lie across a line if they do by this share of their spread (of squares).
const LEAST_SPREAD: f32 = 0.01;
/// Irradiance × importance × √(share of all area) that a place of many leaves may be off its mean by for the edge of a shadow, as a
/// share of the error times the mean irradiance.
const EDGE_SHARE: f32 = 0.008;
/// Links that let less through than this, as far as their segments tell, …
const HARDLY_VISIBLE: f32 = 0.2;
/// … are looked at by chance: the likelier the more they bring, up to this share of a leaf's light, times the square root of the tolerance, …
const SURE_SHARE: f32 = 0.05;
/// … those that bring next to nothing so likely, …
const LEAST_CHANCE: f32 = 0.1;
/// … and all of them so much less likely that no more than so many are drawn for a place, over the square root of the tolerance. What is
/// seen of few counts the more, which is noise, yet noise that calibration takes out: with half as many as with a hundred times as many,
/// solutions were as exact.
const LOOKS: f32 = 5.0;
/// So many points of a place of many leaves.
const CLUSTER_POINTS: u32 = 8;
/// Leaves get no more than this times what a link brings on average. Surfaces that lie in one another's plane hide each
/// other by turns, which no mean visibility can tell. A leaf in the peak of a lobe gets much more than the mean: with 8, an
/// eighth of what a glossy sphere sends was cut off.
const MOST_WEIGHT: f32 = 64.0;

/// Rays for a link that brings all light of a leaf, of the usual [effort](crate::effort); others in proportion, within limits. A single
/// one tells nothing of the directions that matter more than others.
const RAYS: f32 = 64.0;
const LEAST_RAYS: f32 = 2.0;
const MOST_RAYS: f32 = 16.0;
/// Where looks at emitters see less than links let through, as within solids of which much more lies outside of what such a link is for, it is
/// so for other emitters, too: after so many rays half as many are shot if all were to see them, and none did.
const BELIEVED_RAYS: f32 = 32.0;
/// Links none of whose segments was free let so much through, of which each leaf finds out what is true, …
const LEAST_VISIBLE: f32 = 0.01;
/// … and where leaves look at links of their own, at least so much is what rays are shot for.
const LEAST_WORTH: f32 = 0.1;
/// Links are looked at closely as if they let so much through, if that is not proved, whatever their segments found. Were those looked
/// at of which much is seen, and others not, what is seen of the former by chance would be corrected, and what is not seen of the latter be
/// missing: through a blind there came a twentieth too little.
const MAY_BE_VISIBLE: f32 = 0.5;

/// Bytes that are kept for each link, …
pub(crate) const LINK_BYTES: usize = size_of::<Spread>() + size_of::<f32>();
/// … and for each leaf, beside its weights.
pub(crate) const LEAF_BYTES: usize = size_of::<u32>() + size_of::<usize>() + size_of::<f32>();
/// Places whose weights a thread finds between two calls of `watch`: some milliseconds.
const BETWEEN_WATCHES: usize = 32;

/// How a link's light is spread over the leaves below its receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Spread {
    /// Evenly: the same irradiance for all, or none.
    Even,
    /// By orientation and distance from the sender's middle.
    Plain,
    /// By each leaf's weight: by what the sender brings there.
    Exact,
}

/// The places, and what light on their ancestors means to them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Push {
    pub(crate) places: Places,
    /// By link.
    pub(crate) spreads: Vec<Spread>,
    /// What the solution is held to.
    aim: Aim,
    /// By link: what it brings if it is wholly visible, where it is looked at closely (sum of channels).
    means: Vec<f32>,
    /// Links that would be looked at closely if they brought more.
    pub(crate) faint_links: u64,
    /// Looks at links that were left to chance, and not drawn.
    pub(crate) spared_looks: u64,
    /// Looks that saw nothing of a sender, so that what it would bring was not found out.
    pub(crate) unseen_senders: u64,
    /// Rays shot for places and weights.
    pub(crate) rays: u64,
    /// By place that has weights: how much more of its view is taken up than links and weights tell. Of the dark part of a bright sender,
    /// which is all that a place sees next to where both meet, they tell little; yet it hides the rest.
    pub(crate) dim_views: Vec<f32>,
    /// Where the weights of each place begin; as many places as have kept ones, and the end of the last.
    first: Vec<usize>,
    /// By place, then by node from there up to the root, then by those links of the node that have weights.
    weights: Vec<f32>,
    /// Links that have weights, in order.
    weighted: Vec<u32>,
    /// By node, where in `weighted` its own begin; and the end of the last.
    first_weighted: Vec<u32>,
}

impl Push {
    /// Finds the places and their weights but for those `known`, for a solution held to an aim; where there is none,
    /// and where `watch` breaks, by orientation and distance alone. The weights that are kept take no more than `room` bytes.
    pub(crate) fn new<L: LightField>(
        light: Light<'_, L>,
        links: &Links,
        aim: Option<Aim>,
        (room, known): (u64, Option<&KeptWeights>),
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Self {
        let (spreads, means) = spreads(light, links, aim);
        let all_light = light.exitant.irradiance[0].element_sum();
        let edges = aim.map(|aim| Edges { means: &means, least: EDGE_SHARE * aim.tolerance * all_light });
        let (places, found_by) = Places::new(light, links, edges);
        let mut push = Self {
            places,
            spreads,
            aim: aim.unwrap_or_default(),
            means,
            faint_links: 0,
            spared_looks: 0,
            unseen_senders: 0,
            rays: 0,
            dim_views: Vec::new(),
            first: vec![0],
            weights: Vec::new(),
            weighted: Vec::new(),
            first_weighted: vec![0],
        };
        if aim.is_some() {
            let faint =
                |(link, spread): &(&Link, &Spread)| **spread != Spread::Exact && is_shared(light, link.receiver);
            push.faint_links = links.all().iter().zip(&push.spreads).filter(faint).count() as u64;
        }
        // How many weights a place has, by node: its own and those of all above it.
        let mut counts = vec![0_u32; light.elements.nodes.len()];
        for (node, element) in light.elements.nodes.iter().enumerate() {
            let own = links.range(node as u32).filter(|&at| push.spreads[at] == Spread::Exact).map(|at| at as u32);
            push.weighted.extend(own);
            let end = push.weighted.len() as u32;
            let own = end - push.first_weighted[node];
            push.first_weighted.push(end);
            counts[node] = own + if node > 0 { counts[element.parent as usize] } else { 0 };
        }
        let kept = MOST_KEPT.min((room / size_of::<f32>() as u64) as usize);
        for &place in &push.places.nodes {
            let end = push.first[push.first.len() - 1] + counts[place as usize] as usize * numbers(light, place);
            if end > kept {
                break;
            }
            push.first.push(end);
        }
        let mut weights = vec![0.0; push.first[push.first.len() - 1]];
        let mut parts = by_place(&mut weights, &push.first, &push.places.nodes);
        let chunk = if aim.is_some() { BETWEEN_WATCHES * threads::current_num_threads() } else { parts.len().max(1) };
        push.rays = found_by;
        let look = match known {
            Some(known) => Look::Beyond(known),
            None if aim.is_none() => Look::Roughly,
            None => Look::Closely,
        };
        for part in parts.chunks_mut(chunk) {
            if aim.is_some() && watch().is_break() {
                return Self::new(light, links, None, (room, None), watch);
            }
            for looked in threads::map_mut(part, 4, |_, part| push.find(light, links, part, look)) {
                push.dim_views.push(looked.dim_view);
                push.spared_looks += u64::from(looked.spared);
                push.unseen_senders += u64::from(looked.unseen);
                push.rays += u64::from(looked.rays);
            }
        }
        push.weights = weights;
        push
    }

    /// Finds the weights of a place.
    fn find<L: LightField>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        (node, weights): &mut (u32, &mut [f32]),
        look: Look<'_>,
    ) -> Looked {
        let place = Place::new(light, *node, self.places.middle(light.elements, *node), self.aim);
        let mut slots = weights.chunks_exact_mut(numbers(light, *node));
        let mut looked = Looked::default();
        let mut known = if let Look::Beyond(known) = look { Some(known.of(light.elements, *node)) } else { None };
        let (above, rarer) = self.outlooks(light, links, &place);
        let before = known.as_ref().and_then(|known| known.dim_view);
        for ((at, outlook), slot) in above.into_iter().zip(&mut slots) {
            let link = &links.all()[at];
            let plain = || Found { weight: place.plain(light, link, outlook.turned), ..Found::default() };
            let find = || match look {
                Look::Roughly => plain(),
                Look::Beyond(known) if known.rough => plain(),
                _ => place.weight(light, link, (self.means[at], outlook, rarer), &looked),
            };
            let brings = self.means[at] * visible(link, Spread::Exact);
            let known = known.as_mut().and_then(|known| known.take(light, link, (brings, place.uneven)));
            // What few were drawn for may be much by now.
            let known = known.filter(|_| outlook.chance.is_none_or(|chance| chance <= LEAST_CHANCE));
            let mut found = known.map_or_else(find, |weight| Found { weight, ..Found::default() });
            if matches!(look, Look::Again) && !renew::is_told(light, link.sender, found.view.unwrap_or_default()) {
                found.weight = Weight::of(slot);
            }
            found.weight.keep(slot);
            looked.rays += found.rays;
            looked.spared += u32::from(found.spared);
            looked.unseen += u32::from(found.unseen);
            if Group::of(light, link.sender) == Group::Emitter {
                looked.emitters.add(visible(link, Spread::Exact), &found);
            }
            if let Some(view) = found.view.filter(|_| Group::of(light, link.sender) == Group::Rest) {
                looked.dim_view += view - found.weight.value * share(light, link, Spread::Exact);
            }
        }
        if looked.dim_view <= LEAST_DIM_VIEW {
            looked.dim_view = 0.0;
        }
        Looked { dim_view: before.unwrap_or(looked.dim_view), ..looked }
    }

    /// What a place knows of the links above it that have weights, by position among all, and how much rarer its looks by chance are than
    /// each link for itself asks for.
    fn outlooks<L: LightField>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        place: &Place,
    ) -> (Vec<(usize, Outlook)>, f32) {
        let (mut above, mut chances) = (Vec::new(), 0.0);
        self.weighted_above(light.elements, place.node, |at| {
            let outlook = place.outlook(light, &links.all()[at], self.means[at]);
            chances += outlook.chance.unwrap_or_default();
            above.push((at, outlook));
        });
        (above, (LOOKS / (self.aim.tolerance.sqrt() * chances)).min(1.0))
    }

    /// Places have the ids that they have after [`Elements::graft`].
    pub(crate) fn grafted(&mut self) {
        self.places.grafted();
        // The nodes that come in between have no links yet.
        if let Some(&end) = self.first_weighted.get(1) {
            self.first_weighted.insert(0, 0);
            self.first_weighted.insert(GRAFT as usize, end);
        }
    }

    /// Weights of a place for links that were looked at closely, by their position among `links`, from the place up to the root; and how
    /// much its view is dimmer than they tell.
    pub(crate) fn looked_at(&self, elements: &Elements, place: u32) -> (Vec<(usize, Weight)>, Option<f32>) {
        let index = self.places.nodes.binary_search(&place).ok();
        let Some(range) = index.and_then(|index| self.first.get(index..index + 2)) else { return (Vec::new(), None) };
        let numbers = if elements.nodes[place as usize].is_patch() { 1 } else { Weight::NUMBERS };
        let mut weights = self.weights[range[0]..range[1]].chunks_exact(numbers);
        let mut found = Vec::with_capacity(weights.len());
        self.weighted_above(elements, place, |at| found.extend(weights.next().map(|weight| (at, Weight::of(weight)))));
        (found, index.and_then(|index| self.dim_views.get(index).copied()))
    }

    /// The weight of a place for one link above it, by its receiver and position among all links, if the place has looked closely at it.
    pub(crate) fn weight_of(&self, elements: &Elements, index: usize, (receiver, at): (u32, usize)) -> Option<Weight> {
        let range = self.first.get(index..index + 2)?;
        let own = |node: u32| {
            let range = self.first_weighted[node as usize] as usize..self.first_weighted[node as usize + 1] as usize;
            &self.weighted[range]
        };
        let place = self.places.nodes[index];
        let (mut node, mut before) = (place, 0);
        while node != receiver {
            before += own(node).len();
            node = if node == 0 { return None } else { elements.nodes[node as usize].parent };
        }
        before += own(receiver).binary_search(&(at as u32)).ok()?;
        let numbers = if elements.nodes[place as usize].is_patch() { 1 } else { Weight::NUMBERS };
        let first = range[0] + before * numbers;
        self.weights.get(first..first + numbers).map(Weight::of)
    }

    /// Bytes of the weights that are kept.
    pub(crate) fn weight_bytes(&self) -> u64 {
        size_of_val(self.weights.as_slice()) as u64
    }

    /// Calls `visit` with every link above a place that has weights, by position among all: from the place up to the root.
    fn weighted_above(&self, elements: &Elements, place: u32, mut visit: impl FnMut(usize)) {
        let mut node = place as usize;
        loop {
            let range = self.first_weighted[node] as usize..self.first_weighted[node + 1] as usize;
            self.weighted[range].iter().for_each(|&at| visit(at as usize));
            if node == 0 {
                return;
            }
            node = elements.nodes[node].parent as usize;
        }
    }

    /// The same with the place itself.
    fn each<L: LightField>(&self, light: Light<'_, L>, node: u32, mut visit: impl FnMut(&Place, usize)) {
        let place = Place::new(light, node, self.places.middle(light.elements, node), self.aim);
        self.weighted_above(light.elements, node, |at| visit(&place, at));
    }

    /// Calls `visit` with every link above the place of an index that has weights, and the place's weight for it.
    pub(crate) fn each_weight<L: LightField>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        index: usize,
        mut visit: impl FnMut(usize, Weight),
    ) {
        let node = self.places.nodes[index];
        let Some(range) = self.first.get(index..index + 2) else {
            return self.each(light, node, |place, at| {
                let link = &links.all()[at];
                visit(at, place.plain(light, link, place.turned(light, link)));
            });
        };
        let mut weights = self.weights[range[0]..range[1]].chunks_exact(numbers(light, node));
        self.weighted_above(light.elements, node, |at| visit(at, weights.next().map(Weight::of).unwrap_or_default()));
    }

    /// The sum of what links carry to each place, by group.
    pub(crate) fn sums<L: LightField, T: Carried>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        (groups, carried): (&[Group], &[T]),
    ) -> Vec<[T; GROUPS]> {
        let above = Above { links, spreads: &self.spreads, groups, carried };
        let mut index = vec![u32::MAX; light.elements.nodes.len()];
        self.places.nodes.iter().zip(0..).for_each(|(&place, at)| index[place as usize] = at);
        let is_place = |node: u32| index[node as usize] != u32::MAX;
        let sums = inherit(light, above, is_place, |place, inherited| {
            let mut sums = inherited.on(self.places.middle(light.elements, place), &light.element(place).facing);
            let index = index[place as usize] as usize;
            self.each_weight(light, links, index, |at, weight| {
                sums[weight.group(groups[at]) as usize] += carried[at] * weight.value;
            });
            sums
        });
        sums.into_iter().map(|(_, sums)| sums).collect()
    }

    /// How what links carry varies over each place of many leaves, per unit of length, where `rows` (by place) tells what each group
    /// counts: as links do that are looked at closely.
    pub(crate) fn slopes<L: LightField, T: Carried>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        (groups, carried): (&[Group], &[T]),
        rows: &[[f32; GROUPS]],
    ) -> Vec<[T; 3]> {
        let slope = |index: usize| {
            let mut slope = [T::default(); 3];
            self.each_weight(light, links, index, |at, weight| {
                let arriving = carried[at] * rows[index][weight.group(groups[at]) as usize];
                slope.iter_mut().zip(weight.slope.to_array()).for_each(|(slope, by)| *slope += arriving * by);
            });
            slope
        };
        threads::map(&self.places.joined(), 16, |&index| slope(index))
    }
}

/// The weights of each place that has any, by where they begin.
fn by_place<'a>(mut weights: &'a mut [f32], first: &[usize], places: &[u32]) -> Vec<(u32, &'a mut [f32])> {
    let mut parts = Vec::with_capacity(first.len());
    for (range, &place) in first.windows(2).zip(places) {
        let (part, after) = weights.split_at_mut(range[1] - range[0]);
        parts.push((place, part));
        weights = after;
    }
    parts
}

/// Whether what a node received means different things to its leaves, or to parts of it: not where a link's factor is the mean
/// over the leaf itself.
pub(crate) fn is_shared<L: LightField>(light: Light<'_, L>, node: u32) -> bool {
    let element = light.element(node);
    !element.is_flat() || element.child_count > 0
}

/// By link, how its light is to be spread, and what it brings if it is wholly visible.
pub(crate) fn spreads<L: LightField>(light: Light<'_, L>, links: &Links, aim: Option<Aim>) -> (Vec<Spread>, Vec<f32>) {
    let (mut means, dimmest) = (vec![0.0; links.all().len()], dimmest(light));
    let spreads = threads::map_mut(&mut means, 256, |at, mean| {
        let link = &links.all()[at];
        let (spread, brings) = spread(light, link, aim, dimmest[link.receiver as usize]);
        *mean = brings;
        spread
    });
    (spreads, means)
}

/// By node, the irradiance of the dimmest leaf below it that reflects (sum of channels), for which links are not [faint](DIMMEST_SHARE).
fn dimmest<L: LightField>(light: Light<'_, L>) -> Vec<f32> {
    let irradiance = |node: usize| light.exitant.irradiance[node].element_sum();
    let (nodes, least) = (&light.elements.nodes, DIMMEST_SHARE * irradiance(0));
    let mut dimmest = vec![f32::INFINITY; nodes.len()];
    for (node, element) in nodes.iter().enumerate().rev() {
        if element.child_count == 0 && element.importance > 0.0 {
            dimmest[node] = irradiance(node).max(least);
        }
        dimmest[element.parent as usize] = dimmest[element.parent as usize].min(dimmest[node]);
    }
    dimmest
}

/// That of a link, to a receiver at whose `dimmest` leaf so much arrives.
fn spread<L: LightField>(light: Light<'_, L>, link: &Link, aim: Option<Aim>, dimmest: f32) -> (Spread, f32) {
    let receiver = light.element(link.receiver);
    let even = if receiver.is_flat() || link.visibility == 0.0 { Spread::Even } else { Spread::Plain };
    let mean = light.emitted_toward(link).element_sum() * link.factor;
    let least = match (is_shared(light, link.receiver), aim) {
        (true, aim) => faint_share(aim.unwrap_or(Aim::of(1.0))),
        (false, Some(_)) if link.visibility >= 0.0 => OWN_SHARE,
        // Nothing is left to be found out, or nobody looks.
        (false, _) => f32::INFINITY,
    };
    let may_be_visible = if aim.is_some() { may_be_visible(link) } else { link.visibility.abs() };
    let irradiance = light.exitant.irradiance[link.receiver as usize].element_sum().min(dimmest);
    let closely = mean > 0.0 && irradiance > 0.0 && mean * may_be_visible >= least * irradiance;
    (if closely { Spread::Exact } else { even }, mean)
}

/// Links that bring a leaf less than this share of its light are not looked at closely.
fn faint_share(aim: Aim) -> f32 {
    FAINT_SHARE * aim.tolerance.sqrt() / aim.effort
}

/// What a link may let through, for all that is known without a look.
fn may_be_visible(link: &Link) -> f32 {
    if link.visibility < 0.0 { link.visibility.abs() } else { MAY_BE_VISIBLE }
}

/// How many numbers are kept of a weight of a place.
fn numbers<L: LightField>(light: Light<'_, L>, place: u32) -> usize {
    if light.element(place).is_patch() { 1 } else { Weight::NUMBERS }
}

/// What a link brings to a place over what it brings to its receiver.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Weight {
    pub(crate) value: f32,
    /// How it changes over a place of many leaves, per unit of length.
    slope: Vec3,
    /// Whether the place did not look for itself how much it sees of the sender, as that brings next to nothing.
    unseen: bool,
}

impl Weight {
    /// Numbers that are kept where there is a slope.
    const NUMBERS: usize = 4;

    fn of(kept: &[f32]) -> Self {
        let slope = if let [_, x, y, z] = *kept { Vec3::new(x, y, z) } else { Vec3::ZERO };
        Self { value: kept[0].abs(), slope, unseen: kept[0].is_sign_negative() }
    }

    /// The group that it counts to at its place, of a link of a group: how much is seen of what lies beyond a lamp is not known there.
    pub(crate) fn group(&self, of_link: Group) -> Group {
        if self.unseen && of_link == Group::Rest { Group::Faint } else { of_link }
    }

    /// What it is so far from the middle, if the place looked for itself.
    pub(crate) fn looked(&self, from_middle: Vec3) -> Option<f32> {
        (!self.unseen).then_some((self.value + self.slope.dot(from_middle)).max(0.0))
    }

    /// Not below 0 within a radius.
    fn positive(self, radius: f32) -> Self {
        Self { slope: self.slope.clamp_length_max(self.value / radius.max(f32::MIN_POSITIVE)), ..self }
    }

    /// The sign tells what was not seen: no weight is below 0.
    fn keep(self, kept: &mut [f32]) {
        let Vec3 { x, y, z } = self.slope;
        let value = if self.unseen { -self.value } else { self.value };
        kept.iter_mut().zip([value, x, y, z]).for_each(|(kept, number)| *kept = number);
    }
}

impl Mul<f32> for Weight {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self { value: self.value * factor, slope: self.slope * factor, ..self }
    }
}

/// How a place looks at its links.
#[derive(Clone, Copy)]
enum Look<'a> {
    /// By orientation and distance alone.
    Roughly,
    Closely,
    /// At those that are not known.
    Beyond(&'a KeptWeights),
    /// Once more.
    Again,
}

/// What a place knows of a link before it looks.
#[derive(Clone, Copy)]
struct Outlook {
    /// What it would bring to the place, over what it brings to its receiver, if as much were seen of the sender from everywhere.
    turned: f32,
    /// Whether all of the place is far from the sender.
    far: bool,
    /// How likely it is looked at, if that is left to chance.
    chance: Option<f32>,
}

/// What a place finds out about a link.
#[derive(Default)]
struct Found {
    weight: Weight,
    /// The share of the view that what is seen of the sender takes up, if the place asked.
    view: Option<f32>,
    /// Rays that were shot, …
    rays: u32,
    /// … and how many of them saw the sender.
    free: f32,
    /// Whether it was left to chance to look, which did not draw it, …
    spared: bool,
    /// … or it looked, and saw nothing.
    unseen: bool,
}

/// What a place found out about all of them.
#[derive(Clone, Copy, Default)]
struct Looked {
    /// How much more of its view is taken up than its weights tell.
    dim_view: f32,
    /// Rays that it took.
    rays: u32,
    /// Links that it did not look at, as others were drawn by chance.
    spared: u32,
    /// Senders of which it saw nothing.
    unseen: u32,
    /// How far links to emitters told what it saw of them.
    emitters: Told,
}

/// Rays that saw senders, of those that were to see them as far as links tell.
#[derive(Clone, Copy, Default)]
struct Told {
    expected: f32,
    free: f32,
}

impl Told {
    /// Adds what was found of a link that lets so much through.
    fn add(&mut self, visible: f32, found: &Found) {
        self.expected += visible * found.rays as f32;
        self.free += found.free;
    }

    /// So much of what links tell is to be expected of the next one.
    fn share(&self) -> f32 {
        ((BELIEVED_RAYS + self.free) / (BELIEVED_RAYS + self.expected)).min(1.0)
    }
}

/// A place, and the points that stand for it.
struct Place {
    node: u32,
    /// Its middle, with its normal and the weight 1, …
    middle: (Vec3, Vec3, f32),
    /// … and points, normals and weights (sum 1) that stand for all of it.
    points: Points,
    /// What is brought by links that such points are worth (sum of channels).
    much: f32,
    /// Senders that bring less than this are not resolved into parts (largest channel), …
    negligible: f32,
    /// … links that bring less are not looked at closely (sum of channels), …
    faint: f32,
    /// … no weights are found anew for less (sum of channels), …
    uneven: f32,
    /// … and more is looked at whatever links let through (sum of channels).
    sure: f32,
    /// What the solution is held to.
    aim: Aim,
}

impl Place {
    fn new<L: LightField>(light: Light<'_, L>, node: u32, middle: Vec3, aim: Aim) -> Self {
        let element = light.element(node);
        let irradiance = light.exitant.irradiance[node as usize];
        Self {
            node,
            middle: (middle, element.normals.axis, 1.0),
            points: points_of(light, node),
            much: MUCH_SHARE * aim.tolerance.sqrt() * irradiance.element_sum(),
            negligible: negligible(irradiance, aim.tolerance),
            faint: faint_share(aim) * irradiance.element_sum(),
            aim,
            uneven: UNEVEN_SHARE * aim.tolerance * irradiance.element_sum(),
            sure: SURE_SHARE * aim.tolerance.sqrt() * irradiance.element_sum(),
        }
    }

    /// What a link brings to the place over what it brings to its receiver, by orientation and distance alone, which
    /// make it so much more or less if it is `turned`.
    fn plain<L: LightField>(&self, light: Light<'_, L>, link: &Link, turned: f32) -> Weight {
        let known = link.visibility.abs() / visible(link, Spread::Exact);
        let value = turned * known;
        let element = light.element(self.node);
        if element.is_patch() || light.elements.is_distant(NodeId(link.sender)) {
            return Weight { value, ..Weight::default() };
        }
        // (to·n) / d³ has the slope 3 (to·n) to / d⁵ − n / d³, of which the last part is not in the plane.
        let (middle, normal, _) = self.middle;
        let to = light.element(link.sender).center - middle;
        let slope = to.reject_from_normalized(normal) * (3.0 * value / to.length_squared().max(1e-12));
        Weight { value, slope, unseen: false }.positive(element.radius)
    }

    /// The place by its points.
    fn spots<L: LightField>(&self, light: Light<'_, L>) -> Spots<'_> {
        let ((x, n, _), radius) = (self.middle, light.element(self.node).radius);
        Spots { points: &self.points, middle: (x, n), radius, negligible: self.negligible }
    }

    /// What a link brings that is wholly visible, where it varies over the place, and the share of the view that its sender takes up.
    fn varying<L: LightField>(&self, light: Light<'_, L>, link: &Link) -> (Weight, f32) {
        self.all_over(light, &light.arriving_all_over(self.spots(light), link.sender))
    }

    /// The same of a sender that is far, by what arrives in the middle.
    fn by_middle<L: LightField>(&self, light: Light<'_, L>, link: &Link) -> (Weight, f32) {
        let (x, n, _) = self.middle;
        let brought = light.brought_to(x, n, link.sender, Detail::carried(self.negligible));
        if light.element(self.node).is_patch() || light.elements.is_distant(NodeId(link.sender)) {
            return (Weight { value: brought.x, ..Weight::default() }, brought.y);
        }
        let by_middle = self.spots(light).by_middle(light.element(link.sender), brought);
        by_middle.map_or_else(|| self.varying(light, link), |arriving| self.all_over(light, &arriving))
    }

    /// The same by what arrives at each of its points.
    fn all_over<L: LightField>(&self, light: Light<'_, L>, arriving: &[Vec2]) -> (Weight, f32) {
        let mean: Vec2 = self.points.iter().zip(arriving).map(|((.., weight), &arriving)| *weight * arriving).sum();
        let whole = Weight { value: mean.x, ..Weight::default() };
        (if light.element(self.node).is_patch() { whole } else { self.fitted(light, arriving) }, mean.y)
    }

    /// The plane over a place of many leaves that fits best what is there at its points.
    fn fitted<L: LightField>(&self, light: Light<'_, L>, arriving: &[Vec2]) -> Weight {
        let values: SmallVec<[f32; 8]> =
            self.points.iter().zip(arriving).map(|((.., weight), arriving)| weight * arriving.x).collect();
        let value: f32 = values.iter().sum();
        let element = light.element(self.node);
        // Of (s, t) from the mean of the points, by the normal equations.
        let (u, v) = self.middle.1.any_orthonormal_pair();
        let mean: Vec3 = self.points.iter().map(|&(x, _, weight)| x * weight).sum();
        let (mut squares, mut products) = ([0.0; 3], Vec2::ZERO);
        for (&(x, _, weight), &brought) in self.points.iter().zip(&values) {
            let at = Vec2::new((x - mean).dot(u), (x - mean).dot(v));
            let more = [at.x * at.x, at.x * at.y, at.y * at.y].map(|square| square * weight);
            squares.iter_mut().zip(more).for_each(|(square, more)| *square += more);
            products += at * (brought - weight * value);
        }
        let [ss, st, tt] = squares;
        // Points along a line tell nothing of what is across.
        let least = LEAST_SPREAD * (ss + tt);
        let (ss, tt) = (ss + least, tt + least);
        let slope = Vec2::new(tt * products.x - st * products.y, ss * products.y - st * products.x);
        let slope = (u * slope.x + v * slope.y) / (ss * tt - st * st).max(f32::MIN_POSITIVE);
        let value = (value + slope.dot(self.middle.0 - mean)).max(0.0);
        Weight { value, slope, unseen: false }.positive(element.radius)
    }

    /// The same as if the link's sender were seen as much of from everywhere.
    fn turned<L: LightField>(&self, light: Light<'_, L>, link: &Link) -> f32 {
        if light.element(link.receiver).is_flat() {
            return 1.0;
        }
        let element = light.element(self.node);
        let (direction, scale) = renewed(light, link.sender, self.middle.0, link.receiver);
        element.mean_cosine(direction) * scale
    }

    /// What is known of a link without a look, where it would bring `mean` to its receiver if it were wholly visible.
    fn outlook<L: LightField>(&self, light: Light<'_, L>, link: &Link, mean: f32) -> Outlook {
        let turned = self.turned(light, link);
        let far = self.spots(light).is_far(light.element(link.sender));
        let outlook = Outlook { turned, far, chance: None };
        let chance =
            if self.is_faint(light, link, mean, outlook) { None } else { self.chance(light, link, mean * turned) };
        Outlook { chance, ..outlook }
    }

    /// Whether a link brings too little to be looked at, and is far, or brings as little to all of its receiver.
    fn is_faint<L: LightField>(&self, light: Light<'_, L>, link: &Link, mean: f32, outlook: Outlook) -> bool {
        let may_bring = mean * may_be_visible(link);
        let all = light.exitant.irradiance[link.receiver as usize].element_sum();
        let is_faint_to_all = || is_shared(light, link.receiver) && may_bring < faint_share(self.aim) * all;
        may_bring * outlook.turned < self.faint && (outlook.far || is_faint_to_all())
    }

    /// What a link brings to the place over what it brings to its receiver, after what others told `before`; `mean` is what the link would
    /// bring to its receiver if it were wholly visible, and what is left to chance is so much `rarer`.
    fn weight<L: LightField>(
        &self,
        light: Light<'_, L>,
        link: &Link,
        (mean, outlook, rarer): (f32, Outlook, f32),
        before: &Looked,
    ) -> Found {
        let element = light.element(self.node);
        let flat = element.is_flat();
        let visible = visible(link, Spread::Exact);
        // A place that is small or far is told apart by its orientation; so is one that gets next to nothing.
        if self.is_faint(light, link, mean, outlook) {
            let weight = Weight { unseen: link.visibility >= 0.0, ..self.plain(light, link, outlook.turned) };
            return Found { weight, ..Found::default() };
        }
        let shared = is_shared(light, link.receiver);
        let chance = outlook.chance.map_or(1.0, |chance| chance * rarer);
        if unit(hash(hash(self.node, 0x20e1), link.sender)) >= chance {
            return Found { spared: true, ..Found::default() };
        }
        // Most of what is near is hidden: what it would bring is found out only where something of it is seen.
        let rough = if shared && link.visibility >= 0.0 { self.roughly(light, link) } else { 0.0 };
        let is_emitter = Group::of(light, link.sender) == Group::Emitter;
        let likely = if is_emitter { before.emitters.share() } else { 1.0 };
        let look = |brings: f32| self.seen(light, link, (brings, likely), before.rays);
        let first = (rough > 0.0).then(|| look(rough * visible));
        if let Some((0.0, rays)) = first {
            return Found { view: Some(0.0), rays, unseen: true, ..Found::default() };
        }
        let (here, view) = if !shared {
            (Weight { value: mean, ..Weight::default() }, None)
        } else if !outlook.far && (!element.is_patch() || mean * visible > self.much) {
            let (here, view) = self.varying(light, link);
            (here, Some(view))
        } else if flat || !element.is_patch() {
            let (here, view) = self.by_middle(light, link);
            (here, Some(view))
        } else {
            let direction = light.direction_to(element.center, link.sender);
            let cosine = element.mean_cosine(direction);
            let brought =
                cosine * light.brought_to(element.center, direction, link.sender, Detail::carried(self.negligible));
            (Weight { value: brought.x, ..Weight::default() }, Some(brought.y))
        };
        if here.value <= 0.0 {
            let (seen, rays) = first.unwrap_or_default();
            return Found { rays, free: seen * rays as f32, ..Found::default() };
        }
        let weight = here * ((here.value / mean).min(MOST_WEIGHT) / here.value);
        if link.visibility < 0.0 {
            return Found { weight, view: view.map(|view| view * visible), ..Found::default() };
        }
        let worth = if shared { visible } else { visible.max(LEAST_WORTH) };
        let (seen, rays) = first.unwrap_or_else(|| look(here.value * worth));
        let free = seen * rays as f32;
        let seen = seen / chance;
        Found { weight: weight * (seen / visible), view: view.map(|view| view * seen), rays, free, ..Found::default() }
    }

    /// About what a link brings where it is wholly visible: as much as tells how many rays it is worth.
    fn roughly<L: LightField>(&self, light: Light<'_, L>, link: &Link) -> f32 {
        let at = |&(x, n, weight): &(Vec3, Vec3, f32)| weight * light.brought_to(x, n, link.sender, Detail::rough()).x;
        self.points.iter().map(at).sum()
    }

    /// How likely a link is looked at that `may_bring` so much, if that is left to chance: one for more than this place that lets hardly any
    /// reflected light through, as far as its segments tell. What is seen counts so many times as much (J. Arvo and D. Kirk, "Particle
    /// transport and image synthesis", SIGGRAPH 1990), so that the mean of all places is what it was. In a heap nearly all that a place
    /// could see lies behind what is near; a look at each of it found that nearly always.
    fn chance<L: LightField>(&self, light: Light<'_, L>, link: &Link, may_bring: f32) -> Option<f32> {
        let is_hardly_visible = (0.0..HARDLY_VISIBLE).contains(&link.visibility);
        // A lamp that brings little beside others may be the only one that is switched on later.
        let is_reflected = Group::of(light, link.sender) == Group::Rest;
        let chance = || if may_bring < self.sure { (may_bring / self.sure).max(LEAST_CHANCE) } else { 1.0 };
        (is_hardly_visible && is_reflected && is_shared(light, link.receiver)).then(chance)
    }

    /// Share of a link's sender that the place sees, by as many rays as what it `brings` is worth if that is `likely`, and their number. The
    /// rays of all links go on with one sequence of points, so that they are spread evenly over the place.
    fn seen<L: LightField>(
        &self,
        light: Light<'_, L>,
        link: &Link,
        (brings, likely): (f32, f32),
        before: u32,
    ) -> (f32, u32) {
        let [here, all] = [self.node, 0].map(|node| light.exitant.irradiance[node as usize].element_sum());
        let irradiance = here.max(DIMMEST_SHARE * all);
        let rays = self.aim.effort * (RAYS * brings / irradiance.max(f32::MIN_POSITIVE)).min(MOST_RAYS);
        let rays = (rays * likely).max(LEAST_RAYS) as u32;
        let (mut blocker, seed) = (u32::MAX, hash(self.node, 0x1eaf));
        let sequence = (seed, before..before + rays);
        let (seen, total, rays) = visibility(light, self.node, link.sender, sequence, (&Proof::Unknown, &mut blocker));
        (if total > 0.0 { seen / total } else { 0.0 }, rays)
    }
}

/// What a link lets through: what its segments found, but not nothing where each leaf looks for itself.
pub(crate) fn visible(link: &Link, spread: Spread) -> f32 {
    let least = if spread == Spread::Exact { LEAST_VISIBLE } else { 0.0 };
    link.visibility.abs().max(least)
}

/// Direction and change of irradiance of a link's light as seen from a point inside of the node that received it.
fn renewed<L: LightField>(light: Light<'_, L>, sender: u32, at: Vec3, node: u32) -> (Vec3, f32) {
    let direction = light.direction_to(at, sender);
    if light.elements.is_distant(NodeId(sender)) {
        return (direction, 1.0);
    }
    let center = light.element(sender).center;
    let before = light.element(node).center.distance_squared(center);
    let now = at.distance_squared(center);
    // Near large senders the inverse square law ends; a factor of four is more than refinement leaves.
    (direction, (before / now.max(1e-12)).clamp(0.25, 4.0))
}

/// Points, normals and weights (sum 1) that stand for a place.
fn points_of<L: LightField>(light: Light<'_, L>, node: u32) -> Points {
    let element = light.element(node);
    if element.is_patch() {
        return sample_points(light.scene, element).into_iter().collect();
    }
    let choice = |i: u32| (i as f32 + 0.5) / CLUSTER_POINTS as f32;
    let points = (0..CLUSTER_POINTS).filter_map(|i| receiving_point(light, node, (choice(i), Vec2::splat(0.5))));
    points.map(|(x, n, _)| (x, n, (CLUSTER_POINTS as f32).recip())).collect()
}

/// The same of a part of a surface.
pub(crate) fn sample_points(scene: &SceneData, element: &Element) -> SmallVec<[(Vec3, Vec3, f32); 4]> {
    let geometry = &scene.surfaces()[element.source as usize];
    let side = if element.kind == Kind::Back { -1.0 } else { 1.0 };
    let points = geometry.quadrature(element.domain);
    let at = |(uv, weight)| {
        let (point, normal) = geometry.point_and_normal(uv);
        (point, normal * side, weight)
    };
    points.into_iter().map(at).collect()
}

mod renew;
#[cfg(test)]
mod tests;

//! Reflect and pull (paper, section 3.3): the extension turns the incident light of leaves into exitant light, and inner
//! nodes shine with that of the leaves below. Both only where some link asks for it: of the thousands of leaves below
//! a distant cluster a few stand for all, and their light is added up in the direction asked for, which costs less than
//! averages over all directions.

use crate::clock::Instant;
use crate::closely::{Closely, Looks};
use crate::columns::gains;
use crate::face_clusters::FaceClusters;
use crate::hierarchy::Elements;
use crate::hooks::{Arrived, LightField, NodeId};
use crate::links::Links;
use crate::sampling::{hash, unit};
use crate::sent::Sent;
use crate::shooting::NEW_SHARE;
use crate::solution::Seen;
use crate::solver::{Phase, Progress, Solver, Transport};
use crate::threads;
use crate::vertices::outlines;
use crate::{Cone, Rgb};
use smallvec::SmallVec;
use std::f32::consts::{FRAC_1_PI, PI};
use std::ops::ControlFlow;

/// So many leaves at most stand for all that are below a sender.
const REPRESENTATIVES: usize = 16;
/// A leaf's light is reflected anew once its irradiance has changed by this share: by then it may come from elsewhere, too. Before,
/// the leaf sends what it reflected, in proportion to what arrives.
const RESHAPED: f32 = 0.3;
/// The same, once light has settled, as a share of the error asked for.
const SETTLED_SHARE: f32 = 1.0;
/// Until then what it sends follows what arrives in steps of this share of the error asked for: that by which light may still
/// change when it counts as settled.
const STRENGTH_STEP: f32 = 0.02;

/// What changes the light that links carry by less than this share of what they may be wrong by is negligible in the light of
/// the leaves that stand for their senders. These are up to sixteen, and each errs on its own.
const DETAIL_SHARE: f32 = 0.02;
/// Of a link that is almost blocked some leaves may see as if it were blocked by no more than this.
const LEAST_VISIBILITY: f32 = 0.1;
/// What differs by less than this share of the error asked for, times the mean radiance of diffuse white, is negligible where
/// leaves themselves are looked at.
const SHOWN_SHARE: f32 = 0.25;
/// What a distribution that is shown may be wrong by, relative to itself: at least this, or the error asked for where that is less; and at
/// most half, or highlights would lose their outline.
const SHOWN_ERROR: [f32; 2] = [0.1, 0.5];
/// Of what counts for no link so much is negligible: however much more of it is sent, that is a number.
const MOST_NEGLIGIBLE: f32 = 1e30;
/// A leaf is reflected anew where so much less of its light is negligible than when it was reflected.
const FINER: f32 = 0.5;

/// Leaves that a thread reflects between two calls of `watch`: some milliseconds.
const BETWEEN_WATCHES: usize = 8;

/// What becomes of an extension's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reflect {
    /// It stays as it is.
    Not,
    /// Leaves send what they reflected in proportion to what arrives now.
    InProportion,
    /// Leaves that send something else by now are reflected anew, too.
    Reshaped,
    /// Leaves at which what arrives has changed by the error asked for are.
    Changed,
}

/// What leaves send counts as in proportion to what they sent where their shares of it have changed by less than this.
const SAME_SHAPE: f32 = 1e-4;

/// What a node sends now, compared with what it sent before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sends {
    /// The same.
    Same,
    /// So many times as much in every direction, by channel.
    InProportion(Rgb),
    /// Something else.
    Else,
}

/// Leaves, and the area that each stands for.
type Areas = SmallVec<[(u32, f32); 16]>;

/// A leaf that stands for a sender, or for a part of it.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Representative {
    /// The leaf.
    pub leaf: u32,
    /// The share of the sender's area that it stands for.
    pub share: f32,
    /// It sends so many times as much, by channel, as was reflected when it was reflected last: as much more as arrives.
    pub strength: Rgb,
}

/// Whose directional light the links ask for: for each node the leaves that stand for it.
#[derive(Clone, Debug, Default)]
pub struct Senders {
    /// By node: where its leaves are in `standing`. Empty for nodes that do not send.
    pub(crate) ranges: Vec<[u32; 2]>,
    /// Those of all nodes.
    pub(crate) standing: Vec<Representative>,
}

impl Senders {
    /// Those of a set of links, and `others`. `reflects` tells of which leaves the extension makes directional light.
    pub(crate) fn new(
        (elements, faces): (&Elements, &FaceClusters),
        links: &Links,
        others: impl Iterator<Item = u32>,
        reflects: impl Fn(u32) -> bool,
    ) -> Self {
        let nodes = &elements.nodes;
        let mut sends = vec![false; nodes.len()];
        for sender in links.all().iter().map(|link| link.sender).chain(others) {
            sends[sender as usize] = nodes[sender as usize].active;
        }
        // Whether the node or any above it sends.
        let mut below = sends.clone();
        for node in 1..nodes.len() {
            below[node] |= below[nodes[node].parent as usize];
        }
        let mut senders = Self { ranges: vec![[0; 2]; nodes.len()], standing: Vec::new() };
        let mut standing: Vec<Areas> = vec![Areas::new(); nodes.len()];
        for node in (0..nodes.len()).rev() {
            let element = &nodes[node];
            if !below[node] || !element.active {
                continue;
            }
            if element.child_count == 0 {
                if reflects(node as u32) {
                    standing[node].push((faces.standing(node as u32), element.area));
                }
            } else {
                let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
                let mut all: Vec<(u32, f32)> = standing[children].iter().flatten().copied().collect();
                all.dedup_by(|next, kept| {
                    let is_same = next.0 == kept.0;
                    kept.1 += if is_same { next.1 } else { 0.0 };
                    is_same
                });
                standing[node] = thinned(all, node as u32);
            }
            if sends[node] {
                let first = senders.standing.len() as u32;
                let representative = |&(leaf, area): &(u32, f32)| Representative {
                    leaf,
                    share: area / element.area,
                    strength: Rgb::ONE,
                };
                senders.standing.extend(standing[node].iter().map(representative));
                senders.ranges[node] = [first, senders.standing.len() as u32];
            }
        }
        senders
    }

    /// The leaves that stand for a node.
    #[must_use]
    pub fn of(&self, node: u32) -> &[Representative] {
        let [first, end] = self.ranges.get(node as usize).copied().unwrap_or_default();
        &self.standing[first as usize..end as usize]
    }

    /// All leaves that stand for something, in order, each with the angle within which the normals are for which it
    /// stands, its own among them: the least where it stands for several nodes.
    fn leaves(&self, elements: &Elements, faces: &FaceClusters, error: f32) -> Vec<Standing> {
        let mut leaves: Vec<Standing> = Vec::with_capacity(self.standing.len());
        for (node, element) in elements.nodes.iter().enumerate() {
            let standing = self.of(node as u32);
            // As if they divided the cone of normals among them. Were they blurred less, the lobes of neighbours would leave gaps
            // between them, which show as blots where a sphere lights a floor.
            let share = (standing.len() as f32).sqrt().recip();
            let spread = (element.normals.angle() * share).max(0.0);
            leaves.extend(standing.iter().map(|&Representative { leaf, .. }| Standing {
                leaf,
                spread: spread.max(faces.spread(elements, leaf)),
                negligible: 0.0,
                error,
            }));
        }
        leaves.sort_unstable_by(|a, b| a.leaf.cmp(&b.leaf).then(a.spread.total_cmp(&b.spread)));
        leaves.dedup_by_key(|standing| standing.leaf);
        leaves
    }
}

/// A leaf that stands for others, whose normals are within an angle (radians) of its own.
#[derive(Clone, Copy, Debug)]
struct Standing {
    leaf: u32,
    spread: f32,
    /// As in [`Arrived`].
    negligible: f32,
    /// As in [`Arrived`].
    error: f32,
}

/// A few of many, in proportion to the area that they stand for.
fn thinned(all: Vec<(u32, f32)>, seed: u32) -> Areas {
    if all.len() <= REPRESENTATIVES {
        return all.into_iter().collect();
    }
    let step = all.iter().map(|(_, area)| area).sum::<f32>() / REPRESENTATIVES as f32;
    let mut chosen = Areas::new();
    let mut passed = 0.0;
    let mut candidates = all.iter();
    let mut candidate = candidates.next();
    for i in 0..REPRESENTATIVES {
        let goal = (i as f32 + unit(hash(seed, i as u32))) * step;
        while let Some((_, area)) = candidate
            && passed + area < goal
            && candidates.len() > 0
        {
            passed += area;
            candidate = candidates.next();
        }
        let Some(&(leaf, _)) = candidate else { break };
        match chosen.last_mut() {
            Some((last, area)) if *last == leaf => *area += step,
            _ => chosen.push((leaf, step)),
        }
    }
    chosen
}

/// What leaves send, the same ones reflecting the same, by their strengths.
fn compared(now: &[Representative], before: &[Representative]) -> Sends {
    if now == before {
        return Sends::Same;
    }
    let same_leaves = now.len() == before.len()
        && now.iter().zip(before).all(|(now, before)| (now.leaf, now.share) == (before.leaf, before.share));
    if !same_leaves {
        return Sends::Else;
    }
    let (mut low, mut high) = (Rgb::INFINITY, Rgb::ZERO);
    for (now, before) in now.iter().zip(before) {
        let times = Rgb::select(now.strength.cmpeq(before.strength), Rgb::ONE, now.strength / before.strength);
        if !times.is_finite() {
            return Sends::Else;
        }
        (low, high) = (low.min(times), high.max(times));
    }
    let is_same_shape = (high - low).cmple(SAME_SHAPE * high).all();
    if is_same_shape { Sends::InProportion(0.5 * (low + high)) } else { Sends::Else }
}

impl<L: LightField> Solver<L> {
    /// Leaves that stand for others, by the links that there are.
    pub(crate) fn face_clusters(&self) -> FaceClusters {
        if self.skips.face_clusters {
            FaceClusters::new(&self.elements, &self.links, &self.field)
        } else {
            FaceClusters::default()
        }
    }

    /// Reflects light that arrived at senders, until `watch` breaks: all of it where it has changed, or what is new.
    pub(crate) fn reflect_senders(&mut self, how: Reflect, watch: &mut dyn FnMut() -> ControlFlow<()>) {
        self.shown.clear();
        if how == Reflect::Not || !self.elements.nodes[0].active {
            return;
        }
        let shot = self.shot.take();
        let new = shot.as_ref().map(|shot| shot.new.as_slice());
        let (changed, sends) = self.reflect_standing(new, how, watch);
        let mut gather = std::mem::take(&mut self.gather);
        let asked = gather.ask(self.light(), &self.links, |sender| sends[sender as usize], watch);
        if let ControlFlow::Continue(steady) = asked {
            self.stats.skipped.steady_senders += steady;
        }
        if changed && asked.is_continue() {
            let irradiance = new.unwrap_or(&self.exitant.irradiance);
            self.feedback.fit(self.elements.nodes.len());
            let carried = (gather.directional(), gather.lit());
            let arrived: (&[Rgb], &[Rgb]) = (irradiance, &self.strong);
            self.exitant.gain = gains(self.light(), &self.links, carried, self.feedback.most(), arrived);
        }
        (self.gather, self.shot) = (gather, shot);
    }

    /// Reflects the light of the leaves that stand for what the links ask for, where it has changed, or `new` light (by
    /// leaf) in the place of what they reflected before; until `watch` breaks. Tells whether any has, and by node what it
    /// sends now.
    fn reflect_standing(
        &mut self,
        new: Option<&[Rgb]>,
        how: Reflect,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> (bool, Vec<Sends>) {
        let count = self.elements.nodes.len();
        self.sent.resize(count, Sent::NOTHING);
        self.brightest.resize(count, 0.0);
        let (elements, faint) = (&self.elements, &self.faint);
        // What is pure metal has no diffuse light, and gets no links while it is dark: it is lit now.
        let waiting = self.unfinished.unlit.iter().map(|pair| pair.sender);
        let lit = waiting.filter(|&sender| self.exitant.directional[sender as usize] != Rgb::ZERO);
        let faces = self.face_clusters();
        let mut senders = Senders::new((elements, &faces), &self.links, lit, |leaf| {
            faint[elements.nodes[leaf as usize].material as usize] == Rgb::ZERO
        });
        let mut leaves = senders.leaves(elements, &faces, self.settings.tolerance());
        if self.skips.negligible_detail {
            self.weigh(&senders, new.is_some(), &mut leaves);
        }
        if new.is_some() {
            // What they reflected has been shot.
            for &Standing { leaf, .. } in &leaves {
                self.reflected[leaf as usize] = L::Exitant::default();
                self.brightest[leaf as usize] = 0.0;
            }
        }
        let changed = self.reflect(&leaves, new, how, watch);
        let mut stands = vec![false; count];
        for standing in leaves {
            stands[standing.leaf as usize] = true;
        }
        for (node, stands) in stands.into_iter().enumerate() {
            if !stands && self.sent[node].is_known() {
                self.reflected[node] = L::Exitant::default();
                self.sent[node] = Sent::NOTHING;
            }
        }
        if new.is_none() {
            // Light rises until it has settled: steps of all of the error would leave what is sent behind what arrives, bounce by bounce.
            let step = STRENGTH_STEP * self.settings.tolerance();
            for Representative { leaf, strength, .. } in &mut senders.standing {
                *strength = self.sent[*leaf as usize].follow(self.exitant.irradiance[*leaf as usize], step);
            }
        }
        let before = (std::mem::replace(&mut self.exitant.senders, senders), self.exitant.reflected_as.clone());
        self.refer(&changed);
        let all = new.is_some() || !self.skips.steady_senders;
        let sends = if all { vec![Sends::Else; count] } else { self.sends(&before, &changed) };
        (!changed.is_empty(), sends)
    }

    /// By node, what it sends compared with `before`: something else where other leaves stand for it, they have changed, or they shine
    /// otherwise among each other.
    fn sends(&self, (senders, reflected_as): &(Senders, Vec<u32>), changed: &[u32]) -> Vec<Sends> {
        let mut has_changed = vec![false; self.elements.nodes.len()];
        changed.iter().for_each(|&leaf| has_changed[leaf as usize] = true);
        let now = &self.exitant;
        let states: Vec<Sends> = (0..has_changed.len() as u32)
            .map(|node| {
                let standing = now.senders.of(node);
                let changed = standing.iter().any(|standing| has_changed[standing.leaf as usize]);
                if changed { Sends::Else } else { compared(standing, senders.of(node)) }
            })
            .collect();
        let sends = |(node, &state): (usize, &u32)| {
            if reflected_as.get(node) == Some(&state) { states[state as usize] } else { Sends::Else }
        };
        now.reflected_as.iter().enumerate().map(sends).collect()
    }

    /// Finds out which differences of the light of leaves are too small for any link to tell: what a link makes of them counts
    /// less than what it may be wrong by. `is_new`: it is light that is shot, so that what is negligible adds up.
    fn weigh(&self, senders: &Senders, is_new: bool, leaves: &mut [Standing]) {
        let count = self.elements.nodes.len();
        // By node: the most that a difference of its radiosity counts at the end of a link.
        let mut by_node = vec![0.0_f32; count];
        for link in self.links.all() {
            let passes = link.factor * link.visibility.abs().max(LEAST_VISIBILITY);
            let most = &mut by_node[link.sender as usize];
            *most = most.max(self.weight(link.receiver) * passes);
        }
        let mut by_leaf = vec![0.0_f32; count];
        for (node, counts) in by_node.into_iter().enumerate() {
            for &Representative { leaf, share, .. } in senders.of(node as u32) {
                let most = &mut by_leaf[leaf as usize];
                *most = most.max(PI * share * counts);
            }
        }
        let error = DETAIL_SHARE * if is_new { NEW_SHARE } else { 1.0 } * self.link_error(self.settings.tolerance());
        for Standing { leaf, negligible, .. } in leaves {
            *negligible = (error / by_leaf[*leaf as usize]).min(MOST_NEGLIGIBLE);
        }
    }

    /// Finds the node whose leaves stand for each node, and how bright it is at most.
    fn refer(&mut self, changed: &[u32]) {
        let (field, reflected) = (&self.field, &self.reflected);
        let brightest = threads::map(changed, 1, |&leaf| {
            let (low, high) = field.radiance_bounds(&reflected[leaf as usize], &Cone::SPHERE);
            high.max(-low).max_element().max(0.0)
        });
        for (&leaf, brightest) in changed.iter().zip(brightest) {
            self.brightest[leaf as usize] = brightest;
        }
        for node in 0..self.elements.nodes.len() {
            let standing = self.exitant.senders.of(node as u32);
            let parent = self.elements.nodes[node].parent as usize;
            let brightest =
                |of: &Representative| self.brightest[of.leaf as usize] * of.share * of.strength.max_element();
            self.exitant.peak[node] = standing.iter().map(brightest).sum();
            self.exitant.reflected_as[node] =
                if standing.is_empty() && node > 0 { self.exitant.reflected_as[parent] } else { node as u32 };
        }
    }

    /// The extension turns the incident light of leaves into exitant light where it has changed, or where there is enough
    /// `new` light, which is what the incident light is then; until `watch` breaks. Tells where.
    fn reflect(
        &mut self,
        leaves: &[Standing],
        new: Option<&[Rgb]>,
        how: Reflect,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Vec<u32> {
        if new.is_none() && matches!(how, Reflect::Not | Reflect::InProportion) {
            return Vec::new();
        }
        let settled = SETTLED_SHARE * self.settings.tolerance();
        let tolerance = match (new, how) {
            (Some(_), _) => self.negligibly_new(),
            (None, Reflect::Changed) => settled,
            (None, _) => settled.max(RESHAPED),
        };
        let mut changed: Vec<Standing> = leaves
            .iter()
            .copied()
            .filter(|&Standing { leaf, negligible, .. }| {
                let (now, sent) = (self.exitant.irradiance[leaf as usize], self.sent[leaf as usize]);
                let change = new.map_or_else(|| sent.change(now), |new| new[leaf as usize].abs().max_element());
                !self.skips.converged_leaves
                    || change > tolerance * now.max_element()
                    || negligible < FINER * sent.negligible()
            })
            .collect();
        self.stats.skipped.converged_leaves += (leaves.len() - changed.len()) as u64;
        let (exitant, _) = self.exitant_of(&changed, new, false, watch);
        changed.truncate(exitant.len());
        for (Standing { leaf, negligible, .. }, exitant) in changed.iter().zip(exitant) {
            self.reflected[*leaf as usize] = exitant;
            self.sent[*leaf as usize] = Sent::of(self.exitant.irradiance[*leaf as usize], *negligible);
        }
        changed.into_iter().map(|standing| standing.leaf).collect()
    }

    /// What the extension makes of the incident light of leaves, in order, until `watch` breaks; and what looking took.
    fn exitant_of(
        &self,
        leaves: &[Standing],
        new: Option<&[Rgb]>,
        shown: bool,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> (Vec<L::Exitant>, Looks) {
        let gather = Some(&self.gather).filter(|gather| shown && gather.is_for(&self.links));
        let (elements, closely) = (&self.elements, Closely::new(self.light(), &self.links, gather));
        let reflect = |&Standing { leaf, spread, negligible, error }: &Standing| {
            let mut path: Vec<&L::Incident> = vec![&self.incident[leaf as usize]];
            let mut node = leaf;
            while node != 0 {
                node = elements.nodes[node as usize].parent;
                path.push(&self.incident[node as usize]);
            }
            path.reverse();
            let element = &elements.nodes[leaf as usize];
            let irradiance = new.unwrap_or(&self.exitant.irradiance)[leaf as usize];
            let diffuse = irradiance * element.reflectance * FRAC_1_PI;
            let arrived = Arrived { irradiance, diffuse, spread, negligible, error, shown };
            // Outlines of senders show where leaves are looked at; what goes on to other elements is spread by how far away they are.
            if shown {
                self.field.reflect(&closely, NodeId(leaf), &path, arrived)
            } else {
                self.field.reflect(elements, NodeId(leaf), &path, arrived)
            }
        };
        let mut exitant: Vec<L::Exitant> = Vec::with_capacity(leaves.len());
        for part in leaves.chunks(BETWEEN_WATCHES * threads::current_num_threads()) {
            if watch().is_break() {
                break;
            }
            exitant.extend(threads::map(part, 1, reflect));
        }
        (exitant, closely.looks())
    }

    /// Reflects the incident light of all leaves once more, of those too whose light no link asked for or was carried as
    /// diffuse light: the final reflection of all accumulated samples (paper, section 3.4), for display by distributions, from
    /// [`finish`](Self::finish) on; light goes on between elements by what stands for many. Where `watch` breaks, the rest is
    /// shown as it is.
    pub fn reflect_for_display(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        self.reflect_seen_for_display(&|_| true, watch);
    }

    /// The same for pictures that show some leaves only, as of [`finish_seen`](Self::finish_seen): others, but for those whose light the
    /// vertices of `seen` ones have a share of, are shown as they send light ([`unseen_leaves`](crate::stats::Skipped::unseen_leaves)).
    pub fn reflect_seen_for_display(&mut self, seen: Seen<'_>, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        self.shown.clear();
        if !self.elements.nodes[0].active {
            return;
        }
        let faces = self.face_clusters();
        let wanted = self.standing_for(seen, &faces);
        let is_glossy = |leaf: u32| self.elements.nodes[leaf as usize].active && faces.standing(leaf) == leaf;
        let glossy: Vec<u32> = self.elements.patch_leaves().filter(|&leaf| is_glossy(leaf)).collect();
        let count = glossy.len();
        let leaves: Vec<u32> = glossy.into_iter().filter(|&leaf| wanted[leaf as usize]).collect();
        self.stats.skipped.unseen_leaves = (count - leaves.len()) as u64;
        // Whoever looks turns what he sees by the normal of the place: no other normals blur it.
        self.reflect_closely(&leaves, &vec![0.0; leaves.len()], watch);
    }

    /// The same for flat leaves that stand for senders and are not shown so yet: vertices near by see more of their lobes than links tell
    /// from afar. A metal box is a few leaves, each of which throws its own image of a lamp onto the floor. To be called before
    /// [`finish`](Self::finish), where pictures are worth it.
    pub fn reflect_flat_senders(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        if !self.elements.nodes[0].active {
            return;
        }
        let mut wanted = vec![false; self.elements.nodes.len()];
        self.exitant.senders.standing.iter().for_each(|standing| wanted[standing.leaf as usize] = true);
        self.shown.iter().for_each(|(leaf, _)| wanted[*leaf as usize] = false);
        let is_wanted = |leaf: &u32| {
            let element = &self.elements.nodes[*leaf as usize];
            // Curved ones send more blurred than they are shown.
            let is_flat = element.is_flat() && self.scene.shading_normals[element.source as usize].is_none();
            wanted[*leaf as usize] && is_flat
        };
        let leaves: Vec<u32> = self.elements.patch_leaves().filter(is_wanted).collect();
        let faces = self.face_clusters();
        let spreads: Vec<f32> = leaves.iter().map(|&leaf| faces.spread(&self.elements, leaf)).collect();
        self.reflect_closely(&leaves, &spreads, watch);
    }

    /// Reflects the incident light of leaves as closely as they are looked at; given, by leaf, the angles within which the normals are that
    /// what they reflect stands for.
    fn reflect_closely(
        &mut self,
        leaves: &[u32],
        spreads: &[f32],
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        let start = Instant::now();
        let shown = SHOWN_SHARE * self.settings.error * self.mean_irradiance() * FRAC_1_PI;
        let negligible = if self.skips.negligible_detail { shown } else { 0.0 };
        let errors = self.skips.negligible_detail.then(|| self.link_errors());
        let standing = |(&leaf, &spread): (&u32, &f32)| {
            let error =
                errors.as_ref().map_or(self.settings.error, |errors| self.shown_error(leaf, errors[leaf as usize]));
            Standing { leaf, spread, negligible, error }
        };
        let leaves: Vec<Standing> = leaves.iter().zip(spreads).map(standing).collect();
        let progress = self.progress(Phase::Transport, 0.9);
        let (mut done, mut stopped) = (0, false);
        let chunk = BETWEEN_WATCHES * threads::current_num_threads();
        let (exitant, looks) = self.exitant_of(&leaves, None, true, &mut || {
            let share = (done as f32 / leaves.len() as f32).min(1.0);
            done += chunk;
            let answer = watch(&Progress { fraction: progress.fraction + 0.04 * share, ..progress });
            stopped |= answer.is_break();
            answer
        });
        self.shown.extend(leaves.into_iter().map(|standing| standing.leaf).zip(exitant));
        self.stats.stopped |= stopped;
        self.stats.vertex_rays += looks.rays;
        self.stats.skipped.unseen_senders += looks.unseen;
        self.stats.seconds.reflect += start.elapsed().as_secs_f64();
    }

    /// By node, whether it is a leaf of whose directional light the vertices of leaves that are seen have a share: it stands for one that
    /// has a vertex with them, or next to those where several leaves have one for all.
    fn standing_for(&self, seen: Seen<'_>, faces: &FaceClusters) -> Vec<bool> {
        let nodes = self.elements.nodes.len();
        let mut wanted: Vec<bool> = (0..nodes as u32).map(|node| seen(NodeId(node))).collect();
        let is_leaf = |leaf: &u32| wanted[*leaf as usize];
        if self.elements.patch_leaves().all(|leaf| is_leaf(&leaf)) {
            return wanted;
        }
        let layout = outlines(&self.scene, &self.elements);
        let rings = if faces.joined(&self.elements) > 0 { 2 } else { 1 };
        for _ in 0..rings {
            let mut at = vec![false; layout.vertices.positions.len()];
            let parts = || layout.parts.iter().map(|(leaf, outline)| (*leaf as usize, outline));
            for (_, outline) in parts().filter(|(leaf, _)| wanted[*leaf]) {
                outline.iter().for_each(|corner| at[corner.vertex as usize] = true);
            }
            for (leaf, outline) in parts() {
                wanted[leaf] |= outline.iter().any(|corner| at[corner.vertex as usize]);
            }
        }
        for leaf in self.elements.patch_leaves() {
            if wanted[leaf as usize] {
                wanted[faces.standing(leaf) as usize] = true;
            }
        }
        wanted
    }

    /// By node, what the irradiance there may be wrong by, as links in space are no finer: those on it and on all above it, each by what
    /// its tolerance lets it be, or by all that it carries, and each on its own.
    fn link_errors(&self) -> Vec<f32> {
        let is_known = self.gather.is_for(&self.links) && self.settings.transport == Transport::Gather;
        let arriving = if is_known { self.gather.arriving() } else { &[] };
        let tolerance = self.link_error(self.unfinished.aim.tolerance.min(1.0));
        let mut squares = vec![0.0_f32; self.elements.nodes.len()];
        for (node, element) in self.elements.nodes.iter().enumerate() {
            let most = tolerance / self.weight(node as u32).max(f32::MIN_POSITIVE);
            let carried = |link: usize| arriving.get(link).map_or(f32::INFINITY, |light| light.max_element());
            let own: f32 = self.links.range(node as u32).map(|link| carried(link).min(most).powi(2)).sum();
            squares[node] = own + if node > 0 { squares[element.parent as usize] } else { 0.0 };
        }
        squares.into_iter().map(f32::sqrt).collect()
    }

    /// What a distribution that is shown may be wrong by, relative to itself, where the leaf's irradiance may be wrong by so much: to tell
    /// directions apart more finely than space would take memory and show nothing.
    fn shown_error(&self, leaf: u32, by_links: f32) -> f32 {
        let irradiance = self.exitant.irradiance[leaf as usize].max_element().max(f32::MIN_POSITIVE);
        let [least, most] = SHOWN_ERROR;
        (by_links / irradiance).clamp(least.min(self.settings.error), most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hooks::{Hierarchy, Transfer};
    use crate::skips::Skips;
    use crate::skips::tests::{room, solve};
    use glam::Vec3;

    const LIT: Representative = Representative { leaf: 0, share: 0.5, strength: Rgb::ONE };

    /// What two leaves send that sent as told before.
    fn sends(before: [Rgb; 2], now: [Rgb; 2]) -> Sends {
        let of = |strengths: [Rgb; 2]| strengths.map(|strength| Representative { strength, ..LIT });
        compared(&of(now), &of(before))
    }

    #[test]
    fn leaves_that_change_alike_send_in_proportion() {
        let (dim, red) = (Rgb::splat(0.5), Rgb::new(0.5, 0.25, 0.0));
        assert_eq!(sends([Rgb::ONE, dim], [Rgb::ONE, dim]), Sends::Same);
        assert_eq!(sends([Rgb::ONE, dim], [red, dim * red]), Sends::InProportion(red), "each channel by itself");
        assert_eq!(sends([Rgb::ONE, dim], [red, dim]), Sends::Else, "one is what it was");
        assert_eq!(sends([Rgb::ZERO, dim], [dim, dim]), Sends::Else, "one was dark");
        assert_eq!(sends([Rgb::X, Rgb::X], [red, red]), Sends::Else, "green is there now");
        assert_eq!(sends([red, red], [red * 2.0; 2]), Sends::InProportion(Rgb::new(2.0, 2.0, 1.0)), "dark stays dark");
    }

    #[test]
    fn other_leaves_send_something_else() {
        let other = Representative { leaf: 1, ..LIT };
        let more = Representative { share: 1.0, ..LIT };
        for now in [vec![other], vec![more], vec![LIT, other], vec![]] {
            assert_eq!(compared(&now, &[LIT]), Sends::Else, "{now:?}");
        }
    }

    /// Remembers whether it was reflected as closely as leaves are looked at.
    struct Looked;

    impl LightField for Looked {
        type Incident = ();
        type Exitant = bool;

        fn active(&self, _: u32) -> Option<Rgb> {
            Some(Rgb::splat(0.4))
        }
        fn clear(&self, (): &mut ()) {}
        fn receive(&self, (): &mut (), _: &Transfer) {}
        fn reflect<H: Hierarchy>(&self, _: &H, _: NodeId, _: &[&()], arrived: Arrived) -> bool {
            arrived.shown
        }
        fn radiance(&self, _: &bool, _: Vec3) -> Rgb {
            Rgb::splat(0.1)
        }
        fn radiance_bounds(&self, _: &bool, _: &Cone) -> (Rgb, Rgb) {
            (Rgb::splat(0.1), Rgb::splat(0.1))
        }
    }

    /// Vertices see flat senders as closely as eyes do, each reflected once.
    #[test]
    fn flat_senders_are_looked_at_closely() {
        let finished = |looks: bool| {
            let mut solver = solve(&room(), 0.2, Looked, Skips::ALL);
            let go_on = &mut |_: &Progress| ControlFlow::Continue(());
            if looks {
                solver.reflect_flat_senders(go_on);
                let found = solver.shown.len();
                solver.reflect_flat_senders(go_on);
                assert_eq!(solver.shown.len(), found, "they are shown already");
            }
            let solution = solver.finish(go_on);
            let leaf = |standing: &Representative| standing.leaf;
            let senders: Vec<u32> = solution.exitant.senders.standing.iter().map(leaf).collect();
            let is_flat = |leaf: u32| solution.light().element(leaf).is_flat();
            let flat: Vec<u32> = senders.into_iter().filter(|&leaf| is_flat(leaf)).collect();
            let close = flat.iter().filter(|&&leaf| solution.reflected[leaf as usize]).count();
            (close, flat.len())
        };
        let (close, all) = finished(true);
        assert!(all > 10 && close == all, "{close} of {all}");
        assert_eq!(finished(false).0, 0, "nobody asked for it");
    }
}

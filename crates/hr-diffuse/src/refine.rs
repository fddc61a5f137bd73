//! Refinement: pairs of elements are split until a link between them carries nearly constant light, or little.
//!
//! Pairs are decided upon in waves: each wave is decided in parallel against a hierarchy that does not change,
//! then the elements it asked to split are split in order, and the parts make the next wave. So the result does
//! not depend on the number of threads.

use crate::Rgb;
use crate::all_over::FAR;
use crate::beams::Beam;
use crate::budget::{Account, Growth, Spent};
use crate::clock::Instant;
use crate::form_factor::{self, Accuracy, Part};
use crate::geometry::Domain;
use crate::grazing::most_view;
use crate::hierarchy::{Element, Elements, Kind};
use crate::hooks::LightField;
use crate::links::Link;
use crate::lobes::Lobes;
use crate::oracle::{FactorBounds, factor_bounds};
use crate::proofs;
use crate::rooms::are_apart;
use crate::sampling::hash;
use crate::segments;
use crate::shadows;
use crate::skips::Skips;
use crate::stats::Skipped;
use crate::threads;
use crate::transport::{Exitant, Light};
use crate::visibility::Proof;
use glam::{DVec3, Vec3};
use smallvec::{SmallVec, smallvec};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

/// Share of the oracle's interval that counts as error where it stems from the sender's uneven radiosity.
const RADIOSITY_SHARE: f32 = 0.5;
/// The same where it stems from the sender's directional distribution: of the directions that lead to a receiver few
/// see the peak of a narrow lobe.
const DIRECTIONAL_SHARE: f32 = 0.05;
/// Leaves of surfaces that reflect directional light have normals within this angle (radians) of their middle; of those that are bent by
/// more, quadrature is no better than the middle.
const MOST_BENT: f32 = 0.6;
/// Mean cosine of a cluster's normals that is told from none: of what is seen edge-on.
pub(crate) const LEAST_COSINE: f32 = 0.05;
/// Share of a link's tolerance that its factor may be wrong by, …
const FACTOR_SHARE: f32 = 0.05;
/// … least and most that may be relative to the factor, …
const FACTOR_ERROR: [f32; 2] = [0.02, 0.1];
/// … and points of the receiver that it is worth.
const FACTOR_POINTS: u32 = 16;
/// Clusters that overlap are divided, but for those below this many times the radius of the smallest elements, …
const OVERLAPPING: f32 = 80.0;
/// … and but for light of which there can be no more than this share of what the receiver has.
const NOTICED: f32 = 0.1;
/// Pairs that a thread decides upon between two calls of `watch`: some milliseconds.
const BETWEEN_WATCHES: usize = 128;
/// Segments per link: first a few, then as many as its light is worth.
const FIRST_SEGMENTS: u32 = 4;
/// So many where elements are near each other: the light that passes varies over them, and its mean errs to one side.
const NEAR_SEGMENTS: u32 = 16;
const MOST_SEGMENTS: u32 = 32;
/// The same where none has been free.
const MOST_BLOCKED: u32 = 1024;

/// Nodes nearer than this many times the sum of their radii may be parts of one convex object, …
const NEIGHBOURS: f32 = 2.0;
/// … which is found out by so many pairs of points. If none of them faces each other, no more than this share of all does
/// (with 95% confidence: the rule of three), which is left out where it is too little to count.
const PROBES: u32 = 64;
const UNSEEN: f32 = 3.0 / PROBES as f32;

/// Normals bound what surfaces see of each other where that is no more than this share of a view: of pieces of a smooth surface. In corners
/// boxes do, by which it is told how finely corners are divided.
const MOST_GRAZING: f32 = 0.25;

/// A link to be, between two nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Pair {
    pub(crate) receiver: u32,
    pub(crate) sender: u32,
}

/// When is a link good enough?
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// Irradiance × [what it counts](Light::weight) that a link may be wrong by.
    pub(crate) error: f32,
    /// The same for what is left out for good: pairs without a link are not looked at again when errors are to be smaller.
    pub(crate) lost: f32,
    /// The same for light that is there on one side of a shadow's edge and not on the other.
    pub(crate) shadow: f32,
    /// Whether links that are there already are looked at for it, too.
    pub(crate) kept_too: bool,
    /// Radius in unit space below which elements are not split.
    pub(crate) smallest: f32,
    /// Whether nothing has been lit by the passes before: then no error tells what is worth to be looked for.
    pub(crate) dark: bool,
    /// Pairs that need no link.
    pub(crate) skips: Skips,
}

/// What becomes of a pair.
enum Verdict {
    Black,
    Facing,
    Blocked,
    Unlit,
    Keep(Link),
    /// Keep the link of a larger pair, for want of time.
    Inherit(Link),
    SplitReceiver,
    SplitSender,
    SplitBoth,
}

impl Verdict {
    /// The nodes of a pair that are to be split.
    fn split(&self, pair: Pair) -> SmallVec<[u32; 2]> {
        match self {
            Self::SplitReceiver => smallvec![pair.receiver],
            Self::SplitSender => smallvec![pair.sender],
            Self::SplitBoth => smallvec![pair.receiver, pair.sender],
            _ => SmallVec::new(),
        }
    }
}

/// What a refinement made.
#[derive(Debug, Default)]
pub(crate) struct Refined {
    pub(crate) links: Vec<Link>,
    pub(crate) unlit: Vec<Pair>,
    /// Pairs whose link is that of a larger one.
    pub(crate) coarse: Vec<Pair>,
    pub(crate) skipped: Skipped,
    pub(crate) pairs: u64,
    pub(crate) rays: u64,
    /// Splits along the edges of shadows.
    pub(crate) edges: u64,
    pub(crate) visibility_seconds: f64,
    pub(crate) stopped: bool,
    pub(crate) spent: Option<Spent>,
}

/// Work counters that threads share. Sums of integers: their order does not matter.
#[derive(Default)]
struct Counters {
    rays: AtomicU64,
    edges: AtomicU64,
    nanoseconds: AtomicU64,
}

/// A pair to decide upon.
#[derive(Clone, Copy)]
struct Candidate {
    pair: Pair,
    /// The pair's own link, or that of the pair that it is a part of.
    link: Option<Link>,
}

impl Candidate {
    /// The pair's own link, if it has one.
    fn own(&self) -> Option<Link> {
        self.link.filter(|link| link.receiver == self.pair.receiver && link.sender == self.pair.sender)
    }
}

/// Refines `links` and `unlit` pairs until each is within tolerance. `watch` is asked every few milliseconds with the
/// number of pairs in a wave and of links; once it breaks, or a budget is spent, pairs keep the link that they come from, or are linked as
/// they are.
pub(crate) fn refine<L: LightField>(
    light: &mut MutableLight<'_, L>,
    links: Vec<Link>,
    unlit: Vec<Pair>,
    tolerance: Tolerance,
    account: &Account,
    watch: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
) -> Refined {
    let mut refined = Refined::default();
    let mut wave: Vec<Candidate> = links
        .into_iter()
        .map(|l| Candidate { pair: Pair { receiver: l.receiver, sender: l.sender }, link: Some(l) })
        .collect();
    wave.extend(unlit.into_iter().map(|pair| Candidate { pair, link: None }));
    let counters = Counters::default();
    let lobes = Lobes::new(light.elements, light.faint, light.field);
    while !wave.is_empty() {
        refined.pairs += wave.len() as u64;
        let reader = light.read();
        let mut verdicts: Vec<Verdict> = Vec::with_capacity(wave.len());
        let mut growth = Growth::new(reader.elements, refined.links.len() + wave.len());
        while verdicts.len() < wave.len() {
            let first = verdicts.len();
            let part = &wave[first..wave.len().min(first + BETWEEN_WATCHES * threads::current_num_threads())];
            refined.stopped = refined.stopped || watch(wave.len() as u64, refined.links.len() as u64).is_break();
            refined.spent = refined.spent.or(account.is_late().then_some(Spent::Time));
            let stopped = refined.stopped || refined.spent.is_some();
            let decided = threads::map(part, 32, |candidate| {
                let inherited = if stopped { inherited(reader, candidate) } else { None };
                let decided = || decide(reader, candidate, (tolerance, &lobes), stopped, &counters);
                let keep = |link| if candidate.own().is_some() { Verdict::Keep(link) } else { Verdict::Inherit(link) };
                inherited.map_or_else(decided, keep)
            });
            verdicts.extend(decided);
            // Pair by pair: where memory ends does not depend on the number of threads.
            let full = (first..verdicts.len()).find(|&i| {
                growth.add(reader.elements, &verdicts[i].split(wave[i].pair));
                !stopped && account.is_full::<L>(growth.nodes, growth.links)
            });
            if let Some(last) = full {
                refined.spent = Some(Spent::Memory);
                verdicts.truncate(last + 1);
            }
        }
        split_elements(light, &wave, &verdicts);
        let elements = &*light.elements;
        let mut next = Vec::new();
        for (candidate, verdict) in wave.iter().zip(&verdicts) {
            let Candidate { pair, link } = candidate;
            let parts = |node: u32| {
                let e = &elements.nodes[node as usize];
                e.first_child..e.first_child + e.child_count
            };
            match verdict {
                Verdict::Black => refined.skipped.black_receivers += 1,
                Verdict::Facing => refined.skipped.facing += 1,
                Verdict::Blocked => refined.skipped.proved_blocked += 1,
                Verdict::Unlit => {
                    refined.skipped.unlit_senders += 1;
                    refined.unlit.push(*pair);
                }
                Verdict::Keep(link) | Verdict::Inherit(link) => {
                    if matches!(verdict, Verdict::Inherit(_)) {
                        refined.coarse.push(*pair);
                    }
                    refined.skipped.proved_free += u64::from(link.visibility < 0.0 && candidate.own().is_none());
                    refined.links.push(*link);
                }
                Verdict::SplitReceiver => {
                    next.extend(
                        parts(pair.receiver)
                            .map(|receiver| Candidate { pair: Pair { receiver, ..*pair }, link: *link }),
                    );
                }
                Verdict::SplitSender => next
                    .extend(parts(pair.sender).map(|sender| Candidate { pair: Pair { sender, ..*pair }, link: *link })),
                Verdict::SplitBoth => {
                    for receiver in parts(pair.receiver) {
                        next.extend(
                            parts(pair.sender).map(|sender| Candidate { pair: Pair { receiver, sender }, link: *link }),
                        );
                    }
                }
            }
        }
        wave = next;
    }
    refined.rays = counters.rays.into_inner();
    refined.edges = counters.edges.into_inner();
    refined.visibility_seconds =
        counters.nanoseconds.into_inner() as f64 * 1e-9 / threads::current_num_threads() as f64;
    refined
}

/// What refinement needs to write: the hierarchy grows, and new elements inherit their parent's light.
pub(crate) struct MutableLight<'a, L: LightField> {
    pub(crate) scene: &'a crate::hierarchy::SceneData,
    pub(crate) elements: &'a mut Elements,
    pub(crate) exitant: &'a mut Exitant,
    pub(crate) field: &'a L,
    pub(crate) reflected: &'a mut Vec<L::Exitant>,
    pub(crate) faint: &'a [Rgb],
}

impl<L: LightField> MutableLight<'_, L> {
    pub(crate) fn read(&self) -> Light<'_, L> {
        Light {
            scene: self.scene,
            elements: self.elements,
            exitant: self.exitant,
            field: self.field,
            reflected: self.reflected,
        }
    }

    /// Splits a node, unless it has parts already.
    pub(crate) fn split(&mut self, node: u32) {
        self.elements.split(self.scene, node);
        let exitant = &mut *self.exitant;
        for child in exitant.radiosity.len()..self.elements.nodes.len() {
            let element = &self.elements.nodes[child];
            let parent = element.parent as usize;
            // A textured part reflects its own share of the parent's irradiance.
            let emitted = if element.kind == Kind::Front {
                self.scene.materials[element.material as usize].exitance
            } else {
                Vec3::ZERO
            };
            let own =
                emitted + exitant.irradiance[parent] * (element.reflectance + self.faint[element.material as usize]);
            exitant.radiosity.push(own);
            exitant.range.push([own, own]);
            exitant.facing.push(element.facing);
            exitant.irradiance.push(exitant.irradiance[parent]);
            exitant.indirect.push(Rgb::ZERO);
            exitant.directional.push(exitant.directional[parent]);
            exitant.reflected_as.push(exitant.reflected_as[parent]);
            exitant.peak.push(0.0);
            exitant.gain.push(exitant.gain[parent]);
            exitant.adaptation.push(exitant.adaptation[parent]);
            self.reflected.push(L::Exitant::default());
        }
    }
}

fn split_elements<L: LightField>(light: &mut MutableLight<'_, L>, wave: &[Candidate], verdicts: &[Verdict]) {
    for (Candidate { pair, .. }, verdict) in wave.iter().zip(verdicts) {
        verdict.split(*pair).into_iter().for_each(|node| light.split(node));
    }
}

/// The link that a pair has where there is no time to look at it: its own, or its share of the one that it is a part of.
fn inherited<L: LightField>(light: Light<'_, L>, candidate: &Candidate) -> Option<Link> {
    let Candidate { pair, link } = *candidate;
    let from = link?;
    let (sender, whole) = (light.element(pair.sender), light.element(from.sender));
    if sender.kind == Kind::Light && from.sender != pair.sender {
        return None;
    }
    // A light without extent has no area, and no parts.
    let share = if from.sender == pair.sender { 1.0 } else { sender.area / whole.area };
    let visibility = if share < 1.0 { from.visibility.abs() } else { from.visibility };
    let factor = (from.factor * share).min(most_factor(light, pair));
    Some(Link { receiver: pair.receiver, sender: pair.sender, factor, visibility })
}

/// Most that a link's factor may be: nobody takes up more than all of a view, nor more than all that is sent. F ≤ 1 and, by
/// reciprocity, F ≤ Aₛ/Aᵣ; a few points of the receiver, or a link of something larger, may say otherwise. What a cluster emits
/// diffusely is that of its area times the mean cosine of its normals; what it sends as directional light is not.
fn most_factor<L: LightField>(light: Light<'_, L>, pair: Pair) -> f32 {
    let (receiver, sender) = (light.element(pair.receiver), light.element(pair.sender));
    match sender.kind {
        Kind::Light => f32::INFINITY,
        Kind::Front | Kind::Back if receiver.is_flat() => (sender.area / receiver.area).min(1.0),
        Kind::Cluster if !sender.active => {
            let away = -light.direction_to(receiver.center, pair.sender);
            sender.mean_cosine(away).max(LEAST_COSINE).recip()
        }
        _ => 1.0,
    }
}

/// Irradiance interval of a pair, split by cause.
struct Interval {
    /// Largest possible irradiance (max channel).
    most: f32,
    /// The share of the uncertainty from geometry that counts.
    geometry: f32,
    /// Uncertainty from the sender's uneven radiosity.
    radiosity: f32,
    /// Uncertainty from the sender's directional light.
    directional: f32,
}

impl Interval {
    /// What a receiver's lobe shows of how uneven the sender is.
    fn seen_with(self, contrast: f32) -> Self {
        Self { radiosity: self.radiosity * contrast, directional: self.directional * contrast, ..self }
    }

    fn error(&self) -> f32 {
        self.geometry + RADIOSITY_SHARE * self.radiosity + DIRECTIONAL_SHARE * self.directional
    }
}

/// The interval of a pair, with the share of its geometry that counts. Directional light below `negligible` is not looked at closely.
fn interval<L: LightField>(
    light: Light<'_, L>,
    pair: Pair,
    bounds: &FactorBounds,
    (negligible, share): (f32, f32),
) -> Interval {
    let sender = pair.sender;
    let [least, most] = light.diffuse_range(sender);
    let (factor, spread) = (0.5 * (bounds.max + bounds.min), (most - least).max_element());
    let peak = light.directional_most(sender);
    let (low, high) = if peak * bounds.max > negligible {
        light.emitted_bounds(sender, &bounds.from_sender)
    } else {
        (least, most + peak)
    };
    let typical = (0.5 * (least + most)).max(light.emitted(sender, bounds.from_sender.axis)).max_element();
    Interval {
        most: high.max_element() * bounds.max,
        geometry: share * typical * (bounds.max - bounds.min),
        radiosity: spread * factor,
        directional: ((high - low).max_element() - spread).max(0.0) * factor,
    }
}

fn decide<L: LightField>(
    light: Light<'_, L>,
    candidate: &Candidate,
    (tolerance, lobes): (Tolerance, &Lobes),
    stopped: bool,
    counters: &Counters,
) -> Verdict {
    let pair = candidate.pair;
    let (r, s) = (light.element(pair.receiver), light.element(pair.sender));
    let skips = tolerance.skips;
    if skips.black_receivers && r.importance <= 0.0 || r.kind == Kind::Light {
        return Verdict::Black;
    }
    if skips.facing && r.is_patch() && s.is_patch() && r.source == s.source && r.convex && r.kind == s.kind {
        return Verdict::Facing;
    }
    let own = pair.receiver == pair.sender;
    if !own && are_apart(r, s) {
        return Verdict::Blocked;
    }
    if light.emitted_most(pair.sender) <= 0.0 {
        return Verdict::Unlit;
    }
    if own {
        return split_self(light, pair.receiver, tolerance, stopped);
    }
    let Some(mut bounds) = factor_bounds(light.scene, r, s).or_else(|| (!skips.facing).then_some(FactorBounds::NONE))
    else {
        return Verdict::Facing;
    };
    let touching = r.center.distance(s.center) < NEIGHBOURS * (r.radius + s.radius);
    if skips.averted && touching && s.kind != Kind::Light {
        let most = grazing(r, s);
        (bounds.min, bounds.max) = (bounds.min.min(most), bounds.max.min(most));
    }
    let weight = light.weight(pair.receiver);
    let (share, contrast) = (lobes.share(light, pair.receiver), lobes.contrast(light, pair.receiver, pair.sender));
    let interval = interval(light, pair, &bounds, (tolerance.error / weight, share)).seen_with(contrast);
    let split = |verdict: Option<Verdict>| if stopped { None } else { verdict };
    let by_bounds = weight * interval.error();
    let at_stake = weight * interval.most * UNSEEN;
    // Of clusters samples miss what is small, which may see nothing else: without it the row of what it sees would be wrong.
    if skips.averted
        && touching
        && r.is_patch()
        && s.is_patch()
        && !(r.is_flat() && s.is_flat())
        && at_stake <= tolerance.lost
        && !segments::any_facing(light, pair.receiver, pair.sender, PROBES)
    {
        return Verdict::Facing;
    }
    // What a bent leaf reflects toward the eye differs over it more than one distribution can tell.
    let bent = r.active && r.is_patch() && r.normals.angle() > MOST_BENT;
    if bent && weight * interval.most > tolerance.error && can_split(r, tolerance) && !stopped {
        return Verdict::SplitReceiver;
    }
    // Middles of large clusters that overlap tell nothing of what one brings to the parts of the other; in a dim corner it may be all.
    let overlap = !(r.is_patch() && s.is_patch())
        && r.center.distance(s.center) < r.radius + s.radius
        && r.radius.max(s.radius) > OVERLAPPING * tolerance.smallest;
    let noticed = NOTICED * light.exitant.irradiance[pair.receiver as usize].max_element();
    if overlap
        && interval.most > noticed
        && let Some(verdict) = split(choose(light, pair, tolerance, false))
    {
        return verdict;
    }
    let beam = Beam::of(light.scene, s).filter(|beam| beam.ends_on(r));
    // What is not flat is lit as its middle is, and may be lit elsewhere only; as long as all is dark no error tells that this matters.
    let dark = light.exitant.irradiance[0] == Rgb::ZERO;
    if beam.is_some()
        && !r.is_flat()
        && (dark || weight * interval.most > tolerance.error)
        && let Some(verdict) = split(choose(light, pair, tolerance, false))
    {
        return verdict;
    }
    if by_bounds > tolerance.error {
        let prefer_sender = RADIOSITY_SHARE * interval.radiosity > interval.geometry;
        if let Some(verdict) = split(choose(light, pair, tolerance, prefer_sender)) {
            return verdict;
        }
    }
    // What visibility is worth: rays in proportion to the light at stake, and a split where it is uneven.
    let stake = |link: &Link| weight * interval.most.min(4.0 * estimate(light, link));
    let split_by_shadow = |link: &Link| {
        let partial = link.visibility > 0.0 && link.visibility < 1.0 || beam.is_some();
        if partial && stake(link) > tolerance.error { split(choose(light, pair, tolerance, false)) } else { None }
    };
    // What corners of the receiver tell of a shadow's edge, which segments from all over it miss or take for a soft one.
    let split_by_edge = |link: &Link| {
        if link.visibility < 0.0 || stopped || !r.is_patch() || !can_split(r, tolerance) {
            return None;
        }
        let (stake, brought) = (stake(link) * contrast, estimate(light, link) * contrast);
        if stake <= tolerance.shadow || !shadows::counts(light, pair.receiver, brought) {
            return None;
        }
        let (edge, rays) = shadows::edge(light, pair.receiver, pair.sender);
        counters.rays.fetch_add(u64::from(rays), Ordering::Relaxed);
        let found = stake * edge > tolerance.shadow;
        counters.edges.fetch_add(u64::from(found), Ordering::Relaxed);
        found.then_some(Verdict::SplitReceiver)
    };
    // What let nothing through is looked at again: by as many segments as the light that there is now asks for.
    if let Some(link) = candidate.own().filter(|link| link.visibility != 0.0) {
        let by_edge = || if tolerance.kept_too { split_by_edge(&link) } else { None };
        return split_by_shadow(&link).or_else(by_edge).unwrap_or(Verdict::Keep(link));
    }
    // A faint link's factor need not be accurate; no later pass renews it.
    let relative = (FACTOR_SHARE * tolerance.error / (weight * interval.most).max(f32::MIN_POSITIVE))
        .clamp(FACTOR_ERROR[0], FACTOR_ERROR[1]);
    let mut link = Link {
        receiver: pair.receiver,
        sender: pair.sender,
        factor: mean_factor(light, pair, relative).min(most_factor(light, pair)),
        visibility: 0.0,
    };
    if link.factor <= 0.0 && bounds.max > 0.0 && !stopped {
        // The sampled points did not face each other, though some may: no light worth splitting for. Vertices that do face the sender look
        // whether they see it, where it brings much.
        return Verdict::Keep(link);
    }
    let near = 2.0 * (r.radius + s.radius) > r.center.distance(s.center);
    let first = if near { NEAR_SEGMENTS } else { FIRST_SEGMENTS };
    let start = Instant::now();
    let proof = match candidate.link {
        _ if !skips.proofs => Proof::Unknown,
        Some(whole) if whole.visibility < 0.0 => Proof::Free,
        _ => proofs::prove(light.scene, r, s),
    };
    // Whether bent parts face each other at all their factor does not tell, but pairs of points do.
    let faces = || r.is_flat() && s.is_flat() || segments::any_facing(light, pair.receiver, pair.sender, first);
    if proof == Proof::Blocked || proof == Proof::Free && faces() {
        counters.nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        link.visibility = -1.0;
        return if proof == Proof::Free { Verdict::Keep(link) } else { Verdict::Blocked };
    }
    let (worth, seed) = ((first as f32 * stake(&link) / tolerance.error) as u32, hash(pair.receiver, pair.sender));
    let (mut blocker, mut seen, mut total, mut done) = (u32::MAX, 0.0, 0.0, 0);
    // A few at first: those of a pair that is split then are not missed. Where none is free, so many that what they may miss counts no more
    // than what a link may be wrong by.
    let enough = [
        first,
        worth.clamp(first, MOST_SEGMENTS),
        if tolerance.dark { MOST_BLOCKED } else { worth.clamp(first, MOST_BLOCKED) },
    ];
    for segments in enough {
        if segments > MOST_SEGMENTS && seen > 0.0 {
            break;
        }
        let start = Instant::now();
        let (free, all, rays) =
            segments::visibility(light, pair.receiver, pair.sender, (seed, done..segments), (&proof, &mut blocker));
        counters.rays.fetch_add(u64::from(rays), Ordering::Relaxed);
        counters.nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        (seen, total, done) = (seen + free, total + all, segments);
        link.visibility = if total > 0.0 { (seen / total).min(1.0) } else { 0.0 };
        if let Some(verdict) = split_by_shadow(&link) {
            return verdict;
        }
    }
    split_by_edge(&link).unwrap_or(Verdict::Keep(link))
}

/// Most of a view that the normals of two nodes allow, where they tell more than boxes do; else 1.
fn grazing(receiver: &Element, sender: &Element) -> f32 {
    let most = most_view(&receiver.normals, &sender.normals);
    if most > MOST_GRAZING { 1.0 } else { most }
}

/// A node and itself: parts of a convex surface never see each other, parts of anything else may.
fn split_self<L: LightField>(light: Light<'_, L>, node: u32, tolerance: Tolerance, stopped: bool) -> Verdict {
    let element = light.element(node);
    if element.is_flat() || element.convex && element.is_patch() {
        return Verdict::Facing;
    }
    let weight = light.weight(node);
    if element.child_count > 0 {
        // Of a smooth surface, parts see so little of each other that it need not be known which do.
        let [_, diffuse] = light.diffuse_range(node);
        let brightest = diffuse.max_element() + DIRECTIONAL_SHARE * light.directional_most(node);
        let most = grazing(element, element);
        let is_smooth = tolerance.skips.averted && !tolerance.dark && most < 1.0;
        return if is_smooth && weight * most * brightest <= tolerance.lost {
            Verdict::Facing
        } else {
            Verdict::SplitBoth
        };
    }
    // The inside of a curved surface: split while the light that would be lost matters.
    let at_stake = light.emitted_most(node) * weight * grazing(element, element);
    let splittable = element.is_patch() && element.radius > tolerance.smallest;
    if at_stake > tolerance.lost && splittable && !stopped { Verdict::SplitBoth } else { Verdict::Facing }
}

/// Whether an element has parts, or may get some.
pub(crate) fn can_split(element: &Element, tolerance: Tolerance) -> bool {
    element.kind == Kind::Cluster
        || element.is_patch() && (element.child_count > 0 || element.radius > tolerance.smallest)
}

/// Which of the two to split: the larger one, or the sender where its radiosity is what is uncertain.
fn choose<L: LightField>(
    light: Light<'_, L>,
    pair: Pair,
    tolerance: Tolerance,
    prefer_sender: bool,
) -> Option<Verdict> {
    let (r, s) = (light.element(pair.receiver), light.element(pair.sender));
    // A sphere looks the same from everywhere: where it is evenly lit, its parts tell nothing new.
    let (receiver, sender) = (can_split(r, tolerance), can_split(s, tolerance) && (prefer_sender || !s.whole_sphere));
    match (receiver, sender) {
        (false, false) => None,
        (true, false) => Some(Verdict::SplitReceiver),
        (false, true) => Some(Verdict::SplitSender),
        (true, true) => {
            let has_parts = s.child_count > 0;
            if prefer_sender && has_parts || s.radius > r.radius {
                Some(Verdict::SplitSender)
            } else {
                Some(Verdict::SplitReceiver)
            }
        }
    }
}

/// Unoccluded factor of a link: the mean over a receiver that is a patch, to a relative error. Of what is bent it is such that it is the
/// mean irradiance once it is turned toward the receiver's middle; of clusters, and of what is bent and far, or bent by much, that in the middle.
fn mean_factor<L: LightField>(light: Light<'_, L>, pair: Pair, relative: f32) -> f32 {
    let (r, s) = (light.element(pair.receiver), light.element(pair.sender));
    let direction = light.direction_to(r.center, pair.sender);
    let distance = r.center.distance(s.center);
    // A cluster near by is not a point: what its parts make of irradiance says what it counts for as a whole.
    let whole = light.emitted(pair.sender, -direction).element_sum();
    // Directional light differs from what moments of normals say for other reasons: a factor that makes up for it would make spots.
    let misjudged = !s.active && light.exitant.misjudged.may_be(pair.sender, -direction);
    let near = s.radius > 0.25 * distance;
    let resolve = s.kind == Kind::Cluster && (near || misjudged) && whole > 0.0;
    let factor_at = |x: Vec3, n: Vec3| {
        if resolve {
            light.irradiance_at(x, n, pair.sender).element_sum() / whole
        } else {
            light.factor_at(x, n, pair.sender)
        }
    };
    let turned = if r.is_flat() { 1.0 } else { r.mean_cosine(direction) };
    let by_middle = r.radius + s.radius < FAR * distance || r.normals.angle() > MOST_BENT || turned < LEAST_COSINE;
    if !r.is_patch() || !r.is_flat() && by_middle {
        return factor_at(r.center, direction);
    }
    let geometry = &light.scene.surfaces()[r.source as usize];
    let accuracy = Accuracy { relative: f64::from(relative), absolute: 0.0, most: FACTOR_POINTS };
    let flat = r.is_flat().then_some(r.normals.axis);
    let factor = |x: DVec3, n: DVec3| f64::from(factor_at(x.as_vec3(), flat.unwrap_or(n.as_vec3())));
    let mean = |domain: Domain, radius: f32, clear: f32| {
        let reach = if clear > 0.0 { radius / clear } else { f32::INFINITY };
        let receiver = Part { geometry, domain, back: r.kind == Kind::Back };
        form_factor::mean_factor(receiver, accuracy, f64::from(reach), factor).value as f32
    };
    let all_over = match Beam::of(light.scene, s) {
        Some(beam) => beam.mean_over(geometry, r.domain, &|part| {
            let bounds = geometry.bounds(part);
            mean(part, bounds.radius(), bounds.center().distance(s.center))
        }),
        None => mean(r.domain, r.radius, distance - s.radius),
    };
    all_over / turned
}

/// Irradiance that a link would carry unoccluded (max channel).
pub(crate) fn estimate<L: LightField>(light: Light<'_, L>, link: &Link) -> f32 {
    let away = -light.direction_to(light.element(link.receiver).center, link.sender);
    light.emitted(link.sender, away).max_element() * link.factor
}

#[cfg(test)]
mod tests {
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;
    use std::ops::ControlFlow;

    /// A dim shelf faces what is above it: the top of a ball, not its middle. So its link to the ball carries nothing, and nobody knows what
    /// of the shelf is seen from where the ball does face it.
    #[test]
    fn what_carries_nothing_is_not_taken_to_be_seen() {
        let (x, y, z, o) = (DVec3::X, DVec3::Y, DVec3::Z, DVec3::ZERO);
        let quad =
            |o: DVec3, a: DVec3, b: DVec3, material| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), material);
        let surfaces = vec![
            quad(o, x, y, 0),
            quad(z, y, x, 0),
            quad(o, y, z, 0),
            quad(x, z, y, 0),
            quad(o, z, x, 0),
            quad(y, x, z, 0),
            quad(0.99 * z + 0.4 * (x + y), 0.2 * y, 0.2 * x, 1),
            quad(0.8 * z + 0.1 * (x + y), 0.2 * x, 0.2 * y, 2),
            Surface::new(Shape::Sphere { center: DVec3::new(0.6, 0.6, 0.75), radius: 0.15 }, 0),
        ];
        let wall = DiffuseMaterial { reflectance: Rgb::splat(0.6), exitance: Rgb::ZERO, two_sided: false };
        let lamp = DiffuseMaterial { exitance: Rgb::ONE, ..wall };
        let dim = DiffuseMaterial { reflectance: Rgb::splat(1e-4), ..wall };
        let input = SceneInput { surfaces, materials: vec![wall, lamp, dim], ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.3), ()).expect("the room is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let empty: Vec<_> = solver.links.all().iter().filter(|link| link.factor == 0.0).collect();
        assert!(!empty.is_empty(), "some link carries nothing");
        assert!(empty.iter().all(|link| link.visibility == 0.0), "{empty:?}");
    }
}

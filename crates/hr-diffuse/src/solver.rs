//! The solver: refine, gather, push, reflect, pull, until the light has settled (paper, sections 3.1 to 3.3).

mod input;
mod iterate;
mod settings;
mod settle;

use crate::adaptation::adaptation;
use crate::beams::solid_angle;
use crate::budget::{Account, Spent};
use crate::clock::Instant;
use crate::contact_shadows;
use crate::convergence::Convergence;
use crate::effort::Aim;
use crate::error::SolveError;
use crate::exposed::expose;
use crate::faint::sorted;
use crate::feedback::Feedback;
use crate::gather::Gather;
use crate::hierarchy::{Elements, SceneData};
use crate::hooks::LightField;
use crate::kept_weights::KeptWeights;
use crate::light_then::LightThen;
use crate::links::Links;
use crate::misjudged::Misjudged;
use crate::refine::{MutableLight, Pair, Tolerance, refine};
use crate::reflect::{Reflect, Senders};
use crate::relight::Linked;
use crate::resume::{Tried, Unfinished, is_worth};
use crate::sent::Sent;
use crate::shadows;
use crate::shooting::Shot;
use crate::skips::Skips;
use crate::stats::Stats;
use crate::steady;
use crate::transport::{Exitant, Light};
use crate::{Facing, LightKind, Rgb, SceneInput};
use std::ops::ControlFlow;

pub(crate) use input::{check, scene_by, scene_data, scene_in, unit_lights};
pub use settings::{Phase, Progress, Settings, Transport};

/// A link may be wrong by this share of a pass's tolerance, times the mean irradiance.
const LINK_SHARE: f32 = 0.07;
/// That is of rooms that reflect at least this share of their light, and holds for all that do; where less is, errors of it count as much as
/// those of more do there.
const REFLECTED: f32 = 0.5;
/// Irradiance × importance × √(share of all area) that may be there on one side of a shadow's edge in a leaf and not on the other,
/// as a share of the error asked for times the mean irradiance.
const SHADOW_SHARE: f32 = 0.025;
/// Elements are not split below this share of the tolerance's square root, times the size of a room: features smaller than that are not resolved.
const SMALLEST_SHARE: f32 = 0.008;

/// Solves for the light in a scene. `L` is what light does besides being diffuse radiosity; `()` for nothing.
///
/// To [`finish`](Self::finish) is the end of it. A clone can be finished instead, where edits of light and paint may come.
#[derive(Clone, Debug)]
pub struct Solver<L: LightField = ()> {
    pub(crate) scene: SceneData,
    pub(crate) elements: Elements,
    pub(crate) exitant: Exitant,
    pub(crate) links: Links,
    pub(crate) field: L,
    pub(crate) incident: Vec<L::Incident>,
    pub(crate) reflected: Vec<L::Exitant>,
    pub(crate) settings: Settings,
    pub(crate) stats: Stats,
    account: Account,
    pub(crate) skips: Skips,
    /// What is left to be done.
    pub(crate) unfinished: Unfinished,
    /// Passes done by [`step`](Solver::step) since a solve began; 0 before and after.
    passes: usize,
    /// What arrives through the links there are.
    pub(crate) gather: Gather,
    /// Whether it is known for these links as well as it can be.
    pub(crate) prepared: bool,
    /// Whether the edges of shadows were looked for in all links there are.
    edges_known: bool,
    /// What of it stays known for the next links.
    pub(crate) kept_weights: Option<KeptWeights>,
    weighed_by: LightThen,
    /// What has links.
    pub(crate) linked: Linked,
    /// By material: what is reflected beside the diffuse part, if it is so little that transport carries it as
    /// diffuse light.
    pub(crate) faint: Vec<Rgb>,
    /// By leaf, how many times that it reflects of what arrives there; as much as on average where nothing is told.
    faint_times: Vec<f32>,
    /// By material: what is reflected beside the diffuse part as directional light.
    pub(crate) strong: Vec<Rgb>,
    /// By leaf, what it sends of the extension's light.
    pub(crate) sent: Vec<Sent>,
    /// Directional light of leaves as it is to be shown: in its own detail, also where it stands for others.
    pub(crate) shown: Vec<(u32, L::Exitant)>,
    /// What has been shot, while light is.
    pub(crate) shot: Option<Shot>,
    /// What links may carry of the directional light of leaves: see [`columns`](crate::columns).
    pub(crate) feedback: Feedback,
    /// Largest radiance of each leaf's directional light (max channel).
    pub(crate) brightest: Vec<f32>,
    /// Area whose light counts.
    area: f32,
    convergence: Convergence,
}

impl<L: LightField> Solver<L> {
    /// Checks a scene and builds its hierarchy.
    ///
    /// # Errors
    /// A [`SolveError`] where the scene is empty, some surface, material, light or the error asked for makes no
    /// sense, or light would grow without end ([`SolveError::NoSteadyState`]).
    pub fn new(input: &SceneInput, settings: Settings, field: L) -> Result<Self, SolveError> {
        Self::skipping(input, settings, field, Skips::ALL)
    }

    /// [`new`](Self::new) with a say in what is skipped.
    pub(crate) fn skipping(input: &SceneInput, settings: Settings, field: L, skips: Skips) -> Result<Self, SolveError> {
        let start = Instant::now();
        settings.check()?;
        let scene = scene_data(input)?;
        steady::check(&scene, |material| field.active(material).unwrap_or(Rgb::ZERO))?;
        let elements = Elements::build(&scene, |material| field.active(material), skips);
        let count = elements.nodes.len();
        let exitant = Exitant {
            radiosity: vec![Rgb::ZERO; count],
            range: vec![[Rgb::ZERO; 2]; count],
            facing: vec![Facing::ZERO; count],
            irradiance: vec![Rgb::ZERO; count],
            indirect: vec![Rgb::ZERO; count],
            directional: vec![Rgb::ZERO; count],
            reflected_as: (0..count as u32).collect(),
            peak: vec![0.0; count],
            gain: vec![1.0; count],
            adaptation: vec![1.0; count],
            senders: Senders::default(),
            misjudged: Misjudged::default(),
        };
        let incident = std::iter::repeat_with(L::Incident::default).take(count).collect();
        let reflected = std::iter::repeat_with(L::Exitant::default).take(count).collect();
        let solver = Self::with_light(scene, elements, exitant, (field, incident, reflected), settings);
        let mut solver = Self { skips, account: Account::new(settings, start), ..solver };
        solver.unfinished = Unfinished::new(vec![Pair { receiver: 0, sender: 0 }]);
        solver.stats.polygons = input.surfaces.len() as u64;
        solver.pull();
        solver.exitant.misjudged = Misjudged::new(&solver.elements, &solver.exitant);
        solver.stats.skipped.sealed_sides = solver.elements.sealed_sides();
        solver.stats.seconds.build = start.elapsed().as_secs_f64();
        Ok(solver)
    }

    /// A solver without links, with what light there is.
    pub(crate) fn with_light(
        scene: SceneData,
        elements: Elements,
        exitant: Exitant,
        (field, incident, reflected): (L, Vec<L::Incident>, Vec<L::Exitant>),
        settings: Settings,
    ) -> Self {
        let (faint, strong) = sorted(&field, &scene.materials, settings.tolerance());
        let area = elements.nodes[0].area.max(f32::MIN_POSITIVE);
        let mut solver = Self {
            scene,
            elements,
            exitant,
            links: Links::default(),
            field,
            incident,
            reflected,
            settings,
            stats: Stats::default(),
            account: Account::new(settings, Instant::now()),
            skips: Skips::ALL,
            unfinished: Unfinished::new(Vec::new()),
            gather: Gather::default(),
            prepared: false,
            edges_known: false,
            kept_weights: None,
            weighed_by: LightThen::default(),
            linked: Linked::default(),
            faint,
            faint_times: Vec::new(),
            strong,
            sent: Vec::new(),
            shown: Vec::new(),
            shot: None,
            feedback: Feedback::default(),
            brightest: Vec::new(),
            area,
            passes: 0,
            convergence: Convergence::default(),
        };
        solver.linked = solver.linked();
        solver
    }

    /// Solves. `watch` is told how far it is every few milliseconds, and may break: then the solution is what there is by
    /// then, and [`Stats::stopped`] is set; to solve again goes on from there. Where a [`Budget`](crate::Budget) is spent, light settles over what is
    /// linked by then, and [`Stats::spent`] tells which one it was.
    pub fn solve(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        while self.step(watch) {}
    }

    /// Does the next pass of a [`solve`](Self::solve), each of which is finer than the one before and ends with all light in place: in
    /// between a host can show a finished clone, and turn to other things. All passes before leaves look closely, three of most solves,
    /// take about a tenth of the time. Returns whether there is a next one: not where all is done, `watch` broke, or a [`Budget`](crate::Budget) is
    /// spent. A budget of time counts what passes between steps, too.
    pub fn step(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> bool {
        let mut stopped = false;
        if self.passes == 0 {
            self.unfinished.renew(&mut self.links, self.elements.nodes.len());
        }
        let (mut is_left, mut goes_on) = (false, None);
        while let Some(aim) = self.unfinished.next(&self.settings) {
            let (reflects, closely) = is_worth(aim.tolerance, self.settings.tolerance());
            let pass = Pass { number: self.passes, aim, reflects, closely };
            if !self.unfinished.is_fine_enough(aim) {
                self.refine(pass, &mut stopped, watch);
            }
            if stopped {
                // New elements have their parents' light.
                break;
            }
            let late = self.stats.spent == Some(Spent::Time);
            // Once time is spent there is no later pass to look closely in, and none for more rays than usual.
            let tolerance = self.settings.tolerance();
            let last = Pass { reflects: true, closely: true, aim: Aim { tolerance, effort: 1.0 }, ..pass };
            let pass = if late { last } else { pass };
            self.prepare_watched(pass, &mut stopped, watch);
            self.settle(pass, &mut stopped, watch);
            self.follow(pass, &mut stopped, watch);
            if pass.closely && !stopped {
                self.amend(pass, &mut stopped, watch);
            }
            let found = if pass.closely && !stopped { self.check(pass, &mut stopped, watch) } else { None };
            self.measure();
            if self.stats.spent.is_some() {
                // What is left to be done begins here; passes that refine nothing still link what light comes to.
                goes_on.get_or_insert((self.unfinished.aim, self.unfinished.found));
            }
            if stopped || late || self.stats.spent.is_some() && pass.closely {
                break;
            }
            self.unfinished.done(aim, found.as_ref());
            self.passes += 1;
            // Where a budget is spent light settles first.
            if self.stats.spent.is_none() {
                is_left = self.unfinished.next(&self.settings).is_some();
                break;
            }
        }
        if !is_left {
            self.passes = 0;
        }
        if let Some(before) = goes_on {
            (self.unfinished.aim, self.unfinished.found) = before;
            self.unfinished.tried = Tried::default();
        }
        if self.stats.iterations == 0 {
            // Whenever it was stopped, there is some light.
            let whole = &mut || ControlFlow::Continue(());
            self.prepare(None, whole);
            self.begin_shooting(false);
            self.iterate(Reflect::Not, whole);
            self.finish_shooting(false, false, None, whole);
        }
        self.measure();
        self.stats.stopped = stopped;
        self.stats.nodes = self.elements.nodes.len() as u64;
        self.stats.leaves = self.elements.patch_leaves().count() as u64;
        self.stats.links = self.links.all().len() as u64;
        is_left
    }

    /// Finds out how the light of the links of a pass reaches leaves.
    fn prepare_watched(&mut self, pass: Pass, stopped: &mut bool, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        let account = self.account;
        let progress = self.progress(Phase::Transport, pass.fraction(0.6));
        self.prepare(pass.closely.then_some(pass.aim), &mut || {
            *stopped = *stopped || watch(&progress).is_break();
            if *stopped || account.is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }

    /// Solves on where pairs have come to wait that had links: first those get links again, as fine as all others, and light
    /// settles roughly over them.
    pub(crate) fn solve_again(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        self.area = self.elements.nodes[0].area.max(f32::MIN_POSITIVE);
        self.stats.spent = None;
        self.stats.residuals.clear();
        self.restart();
        self.pull();
        let (mut stopped, aim) = (false, self.unfinished.aim);
        if aim.tolerance.is_finite() {
            let (reflects, _) = is_worth(aim.tolerance, self.settings.tolerance());
            let pass = Pass { number: 0, aim, reflects, closely: false };
            let kept = self.links.take();
            self.refine(pass, &mut stopped, watch);
            self.links = Links::new([kept, self.links.take()].concat(), self.elements.nodes.len());
            if !stopped {
                let known = self.kept_weights.as_mut().map(|known| known.rough = true);
                self.prepare_watched(Pass { closely: known.is_some(), ..pass }, &mut stopped, watch);
                self.settle(pass, &mut stopped, watch);
            }
        }
        self.forget_reshaped(stopped);
        self.passes = 0;
        self.solve(&mut |progress| if stopped { ControlFlow::Break(()) } else { watch(progress) });
    }

    /// Has those leaves reflected anew at which light comes from elsewhere than it did, though it may be as much.
    fn forget_reshaped(&mut self, stopped: bool) {
        // What has been shot is not known by link.
        let known = self.kept_weights.as_mut().filter(|_| !stopped && self.settings.transport == Transport::Gather);
        let now = (&self.links, self.gather.arriving());
        let reshaped = known.map(|known| known.reshaped(&self.elements, now));
        for (node, sent) in self.sent.iter_mut().enumerate() {
            if reshaped.as_ref().is_none_or(|share| share[node] > self.settings.tolerance()) {
                sent.forget();
            }
        }
    }

    /// Begins a new series of iterations: the light is another one.
    pub(crate) fn restart(&mut self) {
        self.convergence.restart();
        self.account = Account::new(self.settings, Instant::now());
    }

    /// Tells materials whose extension's light travels as diffuse light from the others.
    pub(crate) fn sort_materials(&mut self) {
        (self.faint, self.strong) = sorted(&self.field, &self.scene.materials, self.settings.tolerance());
    }

    /// Takes note of the memory in use.
    fn measure(&mut self) {
        let links = self.links.all().len() as u64;
        self.stats.bytes =
            self.account.measure(&self.field, &self.incident, &self.reflected, links, self.gather.kept_bytes());
    }

    /// Refines all links to a tolerance.
    fn refine(&mut self, pass: Pass, stopped: &mut bool, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        let start = Instant::now();
        self.exitant.misjudged = Misjudged::new(&self.elements, &self.exitant);
        // Where light has come by other links what was found then still holds.
        if self.gather.is_for(&self.links) {
            self.exitant.adaptation = adaptation(self.light(), &self.gather, &self.links);
        }
        let tolerance = Tolerance {
            error: self.link_error(pass.aim.tolerance),
            lost: self.link_error(self.settings.tolerance().min(pass.aim.tolerance)),
            shadow: if pass.closely || self.edges_known {
                SHADOW_SHARE * self.settings.tolerance() * self.reflected_irradiance()
            } else {
                f32::INFINITY
            },
            kept_too: !self.edges_known,
            dark: self.stats.iterations > 0 && self.exitant.irradiance[0] == Rgb::ZERO,
            smallest: SMALLEST_SHARE * pass.aim.tolerance.sqrt() * self.elements.rooms.size,
            skips: self.skips,
        };
        let error = self.believed_error();
        // The links are about to be others.
        self.stats.error = None;
        self.convergence.restart();
        self.feedback = Feedback::default();
        let (links, unlit) = (self.links.take(), std::mem::take(&mut self.unfinished.unlit));
        let (fine, links) = match &self.kept_weights {
            Some(known) => known.as_fine_as_ever(links, &self.exitant),
            None => (Vec::new(), links),
        };
        let nodes = self.elements.nodes.len() as u64;
        let mut light = MutableLight {
            scene: &self.scene,
            elements: &mut self.elements,
            exitant: &mut self.exitant,
            field: &self.field,
            reflected: &mut self.reflected,
            faint: &self.faint,
        };
        let mut wave_number = 0.0_f32;
        let refined = refine(&mut light, links, unlit, tolerance, &self.account, &mut |wave, done| {
            wave_number += 1.0;
            let fraction = pass.fraction(0.6 * wave_number / (wave_number + 8.0));
            watch(&Progress { phase: Phase::Refine, fraction, error, links: wave + done, nodes })
        });
        *stopped |= refined.stopped;
        self.stats.spent = self.stats.spent.or(refined.spent);
        self.links = Links::new([fine, refined.links].concat(), light.elements.nodes.len());
        if !refined.stopped && refined.spent.is_none() {
            let (account, links) = (&self.account, self.links.all().len() as u64);
            let mut watch = |nodes| {
                *stopped = *stopped
                    || watch(&Progress { phase: Phase::Refine, fraction: pass.fraction(0.6), error, links, nodes })
                        .is_break();
                let over = *stopped || account.is_late() || account.is_full::<L>(nodes, links);
                if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            // Where all links are proved free nothing hides anything.
            if pass.closely && !self.edges_known && self.stats.rays + refined.rays > 0 {
                self.stats.rays += contact_shadows::split(&mut light, tolerance, &mut watch);
            }
            if refined.edges > 0 {
                self.stats.rays += shadows::sew(&mut light, &self.links, tolerance, &mut watch);
            }
        }
        self.edges_known |= pass.closely && !*stopped && self.stats.spent.is_none();
        let count = self.elements.nodes.len();
        self.links.grow(count);
        self.prepared = false;
        self.unfinished.unlit = refined.unlit;
        self.unfinished.coarse.extend(refined.coarse);
        expose(&self.scene, &mut self.elements);
        self.incident.resize_with(count, L::Incident::default);
        self.stats.skipped += refined.skipped;
        self.stats.pairs += refined.pairs;
        self.stats.rays += refined.rays;
        self.stats.seconds.visibility += refined.visibility_seconds;
        self.stats.seconds.refine += start.elapsed().as_secs_f64();
    }

    /// Read access to hierarchy and exitant light.
    pub(crate) fn light(&self) -> Light<'_, L> {
        Light {
            scene: &self.scene,
            elements: &self.elements,
            exitant: &self.exitant,
            field: &self.field,
            reflected: &self.reflected,
        }
    }

    /// Finds out how the light of each link reaches the leaves below its receiver: where a tolerance is given, by a look from each
    /// leaf itself.
    pub(crate) fn prepare(&mut self, aim: Option<Aim>, watch: &mut dyn FnMut() -> ControlFlow<()>) {
        let start = Instant::now();
        self.shown.clear();
        let skips = self.skips;
        let looks = aim.map(|aim| if skips.faint_links { aim } else { Aim { tolerance: 0.0, ..aim } });
        let room = self.account.room::<L>(self.elements.nodes.len() as u64, self.links.all().len() as u64);
        let known = aim.and_then(|_| self.kept_weights.take());
        let known = known.map(|known| known.with_light(&self.elements, &self.exitant));
        self.gather = Gather::new(self.light(), &self.links, looks, (room, known.as_ref()), watch);
        self.kept_weights = known.and_then(KeptWeights::once_more);
        self.weighed_by = LightThen::new(&self.exitant);
        self.prepared = aim.is_some();
        self.stats.rays += self.gather.rays();
        self.stats.skipped.faint_links = self.gather.faint_links();
        self.stats.skipped.spared_looks += self.gather.spared_looks();
        self.stats.skipped.unseen_senders += self.gather.unseen_senders();
        self.stats.seconds.transport += start.elapsed().as_secs_f64();
    }

    /// What a link may be wrong by in a pass of this tolerance: irradiance × [`weight`](Self::weight).
    pub(crate) fn link_error(&self, tolerance: f32) -> f32 {
        LINK_SHARE * tolerance * self.reflected_irradiance()
    }

    /// What errors that are weighted by what surfaces reflect are relative to: the [mean irradiance](Self::mean_irradiance) where they
    /// reflect much, and less of it where it is dark all over.
    fn reflected_irradiance(&self) -> f32 {
        let Means { irradiance, reflected } = self.means();
        irradiance * (reflected / REFLECTED).min(1.0)
    }

    /// What an error of the irradiance of a receiver counts.
    pub(crate) fn weight(&self, receiver: u32) -> f32 {
        self.light().weight(receiver)
    }

    /// Mean irradiance of the surfaces that any light reaches and that reflect any, as far as it [counts](Light::counted); before there
    /// is any, that which the emitted power would make if it were spread evenly. The measure of every tolerance.
    pub(crate) fn mean_irradiance(&self) -> f32 {
        self.means().irradiance
    }

    /// How bright it is, and how much of that is reflected; before there is any light, of all that reflects.
    fn means(&self) -> Means {
        let light = self.light();
        let (mut lit, mut area, mut power) = (0.0_f64, 0.0_f64, 0.0_f64);
        // Of what is lit, and of all.
        let (mut reflected, mut reflecting, mut all) = (0.0_f64, 0.0_f64, 0.0_f64);
        for leaf in self.elements.patch_leaves() {
            let (element, counted, leaf) = (&self.elements.nodes[leaf as usize], light.counted(leaf), leaf as usize);
            let irradiance = self.exitant.irradiance[leaf].max_element() * counted;
            let importance = f64::from(element.importance);
            if importance > 0.0 {
                reflecting += f64::from(element.area) * importance;
                all += f64::from(element.area);
                if irradiance > 0.0 {
                    lit += f64::from(irradiance * element.area);
                    area += f64::from(element.area);
                    reflected += f64::from(irradiance * element.area) * importance;
                }
            }
            power += f64::from(self.exitant.radiosity[leaf].max_element() * element.area);
        }
        for light in &self.scene.lights {
            let spread = match light.kind {
                LightKind::Directional { .. } => self.area,
                LightKind::Point | LightKind::Spot { .. } => solid_angle(light.kind),
            };
            power += f64::from(light.intensity.max_element() * spread);
        }
        let (irradiance, reflected) = if area > 0.0 {
            // So dark that products are 0.
            (lit / area, reflected / lit.max(f64::MIN_POSITIVE))
        } else {
            (power / f64::from(self.area), reflecting / all.max(f64::MIN_POSITIVE))
        };
        Means { irradiance: irradiance as f32, reflected: reflected as f32 }
    }

    /// The error that was found last, or what can be said without a look.
    fn believed_error(&self) -> f32 {
        let residual = self.stats.residuals.last().copied().unwrap_or(1.0);
        self.stats.error.unwrap_or_else(|| self.unfinished.found.min(1.0).max(residual).min(1.0))
    }

    pub(crate) fn progress(&self, phase: Phase, fraction: f32) -> Progress {
        Progress {
            phase,
            fraction,
            error: self.believed_error(),
            links: self.links.all().len() as u64,
            nodes: self.elements.nodes.len() as u64,
        }
    }
}

/// How bright it is.
struct Means {
    /// See [`Solver::mean_irradiance`].
    irradiance: f32,
    /// Share of it that surfaces reflect.
    reflected: f32,
}

/// Links are refined to a tolerance, and light settles over them.
#[derive(Clone, Copy, Debug)]
struct Pass {
    /// Passes before it.
    number: usize,
    /// What it is held to.
    aim: Aim,
    /// Whether the extension's light is reflected.
    reflects: bool,
    /// Whether leaves look for themselves what arrives from where, and light settles.
    closely: bool,
}

impl Pass {
    /// Share of all the work that is done when so much of the pass is: most solves take four or five, and each costs a few times the one
    /// before.
    fn fraction(&self, within: f32) -> f32 {
        const SHARES: [f32; 8] = [0.0, 0.05, 0.1, 0.2, 0.6, 0.8, 0.87, 0.9];
        let pass = self.number.min(SHARES.len() - 2);
        SHARES[pass] + (SHARES[pass + 1] - SHARES[pass]) * within.clamp(0.0, 1.0)
    }
}

//! The solver: refine, gather, push, reflect, pull, until the light has settled (paper, sections 3.1 to 3.3).

use crate::adaptation::adaptation;
use crate::beams::solid_angle;
use crate::budget::{Account, Budget, Spent};
use crate::clock::Instant;
use crate::contact_shadows;
use crate::convergence::Convergence;
use crate::error::SolveError;
use crate::exposed::expose;
use crate::faint::{Grazing, most_times};
use crate::feedback::Feedback;
use crate::gather::Gather;
use crate::geometry::{Geometry, Normalization};
use crate::hierarchy::{Elements, Kind, SceneData};
use crate::hooks::LightField;
use crate::kept_weights::KeptWeights;
use crate::light_then::LightThen;
use crate::links::Links;
use crate::misjudged::Misjudged;
use crate::refine::{MutableLight, Pair, Tolerance, refine};
use crate::reflect::{Reflect, Senders};
use crate::relight::{Linked, ratio};
use crate::residual::{RAYS_PER_LEAF, Residual, residual};
use crate::resume::{Unfinished, is_worth};
use crate::sent::Sent;
use crate::shadows;
use crate::shooting::Shot;
use crate::skips::Skips;
use crate::stats::Stats;
use crate::steady;
use crate::threads;
use crate::transport::{Exitant, Light};
use crate::twins::twins;
use crate::visibility::Visibility;
use crate::{DiffuseMaterial, Facing, LightKind, Rgb, SceneInput};
use glam::DVec3;
use std::ops::ControlFlow;

/// A link may be wrong by this share of a pass's tolerance, times the mean irradiance.
const LINK_SHARE: f32 = 0.07;
/// Irradiance × importance × √(share of all area) that may be there on one side of a shadow's edge in a leaf and not on the other,
/// as a share of the error asked for times the mean irradiance.
const SHADOW_SHARE: f32 = 0.025;
/// Elements are not split below this share of the tolerance's square root, times the size of a room: features smaller than that are not resolved.
const SMALLEST_SHARE: f32 = 0.008;
/// Materials that reflect no more than this share of the error asked for beside their diffuse part have it carried as
/// diffuse light until it is shown; and bright ones, no more than the error times all that they reflect: most of their light is diffuse anyhow.
const FAINT_SHARE: f32 = 0.7;
/// Iterations end when all that are to come would change the solution by less than this share of the error.
const CONVERGED_SHARE: f32 = 0.02;
/// The same while an extension's light is sent in proportion to what arrives.
const EXPECTED_SHARE: f32 = 0.3;
/// No more iterations than these follow one refinement; a reflectance of 0.99 needs hundreds.
const MOST_ITERATIONS: u32 = 400;
/// So many where light need only be there roughly.
const FEW_ITERATIONS: u32 = 3;
/// Links follow light over so many reflections at most from one pure metal to the next, in one pass, …
const MOST_FOLLOWED: usize = 4;
/// … where more than this times the pass's tolerance of all light waits.
const FOLLOWED_SHARE: f32 = 0.1;
/// So many rays for each place are worth knowing how much reflected light links should bring.
const CALIBRATE_RAYS: usize = 64;
/// This share of the rays shot so far is worth knowing what the solution is off by, …
const CHECK_SHARE: f32 = 0.1;
/// … from at least and at most so many leaves; …
const CHECKED_LEAVES: [u64; 2] = [64, 2000];
/// … and once more from so many times as many where that does not tell whether it is fine enough.
const AGAIN: usize = 4;

/// Exitances and intensities above this are refused: sums of powers and what white surfaces make of them would leave the
/// range of f32.
const MOST_LIGHT: f32 = 1e30;

/// From one iteration to the next no more of a change is left than the share that the brightest material reflects, and this.
const REFLECTED_MARGIN: f32 = 0.02;

/// Light is to settle everywhere: how much has changed is a share of what there is in the same place, or of so much of the scene's mean
/// irradiance where it is dimmer.
const DIM_SHARE: f32 = 0.03;
/// Channels with less than this share of the strongest one's light need not converge by themselves.
const FAINT_CHANNEL: f64 = 1e-3;

/// How light travels over links from one iteration to the next. Both ways lead to the same answer, within the error asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transport {
    /// Gathering: every receiver adds up what its links carry of all the light there is.
    #[default]
    Gather,
    /// Shooting: links carry the light that has not been shot yet, and what arrives is added to what there is. Light that
    /// an extension makes is reflected once for each reflection that it has behind it, and once more as a whole at the end.
    Shoot,
}

/// What is asked of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Relative error of the solution, 0.001…1: 0.02 is fine, 0.1 coarse.
    pub error: f32,
    /// What it may cost.
    pub budget: Budget,
    /// How light travels.
    pub transport: Transport,
}

impl Settings {
    /// An error asked for, whatever it costs.
    #[must_use]
    pub fn with_error(error: f32) -> Self {
        Self { error, budget: Budget::default(), transport: Transport::default() }
    }

    /// Whether they can be met.
    pub(crate) fn check(&self) -> Result<(), SolveError> {
        let error = self.error;
        if (0.001..=1.0).contains(&error) { Ok(()) } else { Err(SolveError::Error { error }) }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::with_error(0.05)
    }
}

/// What the solver is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Phase {
    /// Splitting pairs of elements, with visibility rays.
    Refine,
    /// Gathering, pushing, reflecting and pulling light.
    Transport,
    /// Values at vertices.
    Reconstruct,
}

/// How far a solve is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// What it is doing.
    pub phase: Phase,
    /// Rough share of the work done, 0…1.
    pub fraction: f32,
    /// Relative error that the solution is believed to have now: once rays have looked, what they found.
    pub error: f32,
    /// Links so far.
    pub links: u64,
    /// Elements so far.
    pub nodes: u64,
}

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
        let (faint, strong) = sorted(&field, &scene.materials, settings.error);
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
    /// then, and [`Stats::stopped`] is set; to solve again goes on from there. Where a [`Budget`] is spent, light settles over what is
    /// linked by then, and [`Stats::spent`] tells which one it was.
    pub fn solve(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        while self.step(watch) {}
    }

    /// Does the next pass of a [`solve`](Self::solve), each of which is finer than the one before and ends with all light in place: in
    /// between a host can show a finished clone, and turn to other things. All passes before leaves look closely, three of most solves,
    /// take about a tenth of the time. Returns whether there is a next one: not where all is done, `watch` broke, or a [`Budget`] is
    /// spent. A budget of time counts what passes between steps, too.
    pub fn step(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> bool {
        let mut stopped = false;
        if self.passes == 0 {
            self.unfinished.renew(&mut self.links, self.elements.nodes.len());
        }
        let (mut is_left, mut goes_on) = (false, None);
        while let Some(tolerance) = self.unfinished.next(self.settings.error) {
            let (reflects, closely) = is_worth(tolerance, self.settings.error);
            let pass = Pass { number: self.passes, tolerance, reflects, closely };
            self.refine(pass, &mut stopped, watch);
            if stopped {
                // New elements have their parents' light.
                break;
            }
            let late = self.stats.spent == Some(Spent::Time);
            // Once time is spent there is no later pass to look closely in.
            let last = Pass { reflects: true, closely: true, tolerance: self.settings.error, ..pass };
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
                goes_on.get_or_insert((self.unfinished.tolerance, self.unfinished.found));
            }
            if stopped || late || self.stats.spent.is_some() && pass.closely {
                break;
            }
            self.unfinished.done(tolerance, found.as_ref());
            self.passes += 1;
            // Where a budget is spent light settles first.
            if self.stats.spent.is_none() {
                is_left = self.unfinished.next(self.settings.error).is_some();
                break;
            }
        }
        if !is_left {
            self.passes = 0;
        }
        if let Some(before) = goes_on {
            (self.unfinished.tolerance, self.unfinished.found) = before;
            (self.unfinished.in_vain, self.unfinished.gained) = (false, false);
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
        self.prepare(pass.closely.then_some(pass.tolerance), &mut || {
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
        let (mut stopped, tolerance) = (false, self.unfinished.tolerance);
        if tolerance.is_finite() {
            let (reflects, _) = is_worth(tolerance, self.settings.error);
            let pass = Pass { number: 0, tolerance, reflects, closely: false };
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
            if reshaped.as_ref().is_none_or(|share| share[node] > self.settings.error) {
                sent.forget();
            }
        }
    }

    /// Lets light settle anew over the links that there are, for which it is found out how they reach leaves where it is not
    /// known yet.
    pub(crate) fn settle_again(&mut self, stopped: &mut bool, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        let tolerance = self.unfinished.tolerance.min(1.0);
        let pass = Pass { number: 1, tolerance, reflects: true, closely: true };
        let prepared = self.prepared;
        if !prepared {
            // Nothing is refined here, before which clusters are judged.
            self.exitant.misjudged = Misjudged::new(&self.elements, &self.exitant);
            self.prepare_watched(pass, stopped, watch);
        }
        self.expect_in_proportion(pass, stopped, watch);
        self.iterate_until(pass, (MOST_ITERATIONS, CONVERGED_SHARE, Reflect::Reshaped), stopped, watch);
        if !prepared {
            self.amend(pass, stopped, watch);
        }
    }

    /// Lets light settle roughly, while the extension's light is sent in proportion to what arrives. By how much more that is than before on
    /// the whole it is to be expected to be everywhere: only leaves that differ from that need be reflected anew.
    fn expect_in_proportion(
        &mut self,
        pass: Pass,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        if self.settings.transport != Transport::Gather || !self.elements.nodes[0].active {
            return;
        }
        self.iterate_until(pass, (MOST_ITERATIONS, EXPECTED_SHARE, Reflect::InProportion), stopped, watch);
        let (mut was, mut is) = (Rgb::ZERO, Rgb::ZERO);
        for leaf in self.elements.patch_leaves().map(|leaf| leaf as usize) {
            if let Some(irradiance) = self.sent.get(leaf).and_then(Sent::irradiance) {
                was += irradiance * self.elements.nodes[leaf].area;
                is += self.exitant.irradiance[leaf] * self.elements.nodes[leaf].area;
            }
        }
        let times = ratio(is, was);
        self.sent.iter_mut().for_each(|sent| sent.expect(times));
    }

    /// Iterates until light has settled, as far as a pass needs it.
    fn settle(&mut self, pass: Pass, stopped: &mut bool, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        // The extension's light is reflected when most of it is there: that is what takes time. Shooting starts from the dark anyhow.
        let warms = self.settings.transport == Transport::Gather && self.elements.nodes[0].active;
        if !pass.closely || warms {
            let how = if pass.reflects && !pass.closely { Reflect::Reshaped } else { Reflect::Not };
            self.iterate_until(pass, (FEW_ITERATIONS, 1.0, how), stopped, watch);
        }
        if pass.closely && !*stopped {
            self.iterate_until(pass, (MOST_ITERATIONS, CONVERGED_SHARE, Reflect::Reshaped), stopped, watch);
        }
    }

    /// Pure metal is dark until light has come to it, and gets no links before. That light goes on to other metal, so that where much
    /// waits links follow it from one to the next within a pass: those that come may be much finer.
    fn follow(&mut self, pass: Pass, stopped: &mut bool, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        for _ in 0..MOST_FOLLOWED {
            let goes_on = pass.reflects && !*stopped && !self.account.is_over() && self.stats.spent.is_none();
            if !goes_on || self.waiting() < FOLLOWED_SHARE * pass.tolerance {
                break;
            }
            self.refine(pass, stopped, watch);
            if !*stopped {
                self.prepare_watched(pass, stopped, watch);
                self.settle(pass, stopped, watch);
            }
        }
    }

    /// Share of all light that senders reflect as directional light while some pair waits for it without a link.
    fn waiting(&self) -> f32 {
        let power = |light: &[Rgb], node: u32| {
            (light[node as usize].element_sum() * self.elements.nodes[node as usize].area).max(0.0)
        };
        let Exitant { radiosity, directional, .. } = &self.exitant;
        let mut senders: Vec<u32> = self.unfinished.unlit.iter().map(|pair| pair.sender).collect();
        senders.sort_unstable();
        senders.dedup();
        let waits: f32 = senders.into_iter().map(|sender| power(directional, sender)).sum();
        let all = power(radiosity, 0) + power(directional, 0);
        if all > 0.0 { waits / all } else { 0.0 }
    }

    /// Iterates, so many times at most, until what is to come is below a share of the error, with or without the extension's light.
    fn iterate_until(
        &mut self,
        pass: Pass,
        (most, share, how): (u32, f32, Reflect),
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        if *stopped {
            return;
        }
        let account = self.account;
        let reflects = matches!(how, Reflect::Reshaped | Reflect::Changed);
        let mut before = self.begin_shooting(reflects);
        // Light settles with what leaves have reflected of much of it, and once more with what all reflect of all of it.
        let directional = reflects && self.elements.nodes[0].active;
        self.feedback.restart();
        let (mut settled, mut finely, mut next) = (false, !directional || self.shot.is_some(), how);
        for iteration in 0..if before.is_some() { MOST_ITERATIONS } else { most } {
            let fraction = pass.fraction(0.6 + 0.3 * (iteration as f32 / (iteration as f32 + 4.0)));
            let progress = self.progress(Phase::Transport, fraction);
            let ask = &mut || {
                *stopped = *stopped || watch(&progress).is_break();
                if *stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let Some(residual) = self.iterate(next, ask) else { break };
            (before, next) = (None, how);
            if directional {
                let kept = self.kept();
                self.feedback.rein_in(&self.exitant.irradiance, kept);
            }
            settled = self.remaining(residual) < share * self.settings.error && iteration > 0;
            if settled && !finely {
                (settled, finely, next) = (false, true, Reflect::Changed);
            }
            if *stopped || settled || account.is_over() {
                break;
            }
        }
        if directional {
            let reined = self.elements.patch_leaves().filter(|&leaf| self.feedback.is_reined(leaf));
            self.stats.reined_leaves = reined.count() as u64;
        }
        let progress = self.progress(Phase::Transport, pass.fraction(0.9));
        self.finish_shooting(reflects, settled, before, &mut || {
            *stopped = *stopped || watch(&progress).is_break();
            if *stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }

    /// Compares what links bring with what there is, now that light is in place, and lets it settle once more: first where it
    /// comes from, then how much of it there is.
    fn amend(&mut self, pass: Pass, stopped: &mut bool, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        let renewed = self.renew_weights(pass, stopped, watch);
        let calibrated = self.calibrate(pass, stopped, watch);
        if renewed || calibrated {
            self.convergence.restart();
            self.iterate_until(pass, (MOST_ITERATIONS, CONVERGED_SHARE, Reflect::Reshaped), stopped, watch);
        }
    }

    /// Finds weights anew where light comes from other parts of senders than when they were found: next to where surfaces meet, these
    /// are dark by now. Tells whether there are any.
    fn renew_weights(
        &mut self,
        pass: Pass,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> bool {
        // Coarse links need no more.
        if *stopped || self.stats.spent.is_some() {
            return false;
        }
        let (start, account) = (Instant::now(), self.account);
        let uneven = self.weighed_by.uneven(&self.elements, &self.exitant);
        let progress = self.progress(Phase::Transport, pass.fraction(0.9));
        let mut gather = std::mem::take(&mut self.gather);
        let (renewed, rays) = gather.renew(self.light(), &self.links, &uneven, &mut || {
            *stopped = *stopped || watch(&progress).is_break();
            if *stopped || account.is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        self.gather = gather;
        self.stats.rays += rays;
        self.stats.renewed_places += renewed;
        self.stats.seconds.transport += start.elapsed().as_secs_f64();
        renewed > 0
    }

    /// Compares what links bring of reflected light with what rays find. Tells whether it has.
    fn calibrate(
        &mut self,
        pass: Pass,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> bool {
        // Where all links are proved free nothing is missing.
        if self.stats.rays == 0 || *stopped || self.account.is_over() {
            return false;
        }
        let (start, account) = (Instant::now(), self.account);
        let progress = self.progress(Phase::Transport, pass.fraction(0.9));
        let mut gather = std::mem::take(&mut self.gather);
        let shot = gather.calibrate(self.light(), &self.links, CALIBRATE_RAYS, &mut || {
            *stopped = *stopped || watch(&progress).is_break();
            if *stopped || account.is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        self.gather = gather;
        self.stats.check_rays += shot;
        self.stats.seconds.check += start.elapsed().as_secs_f64();
        shot > 0
    }

    /// Finds what the solution is off by.
    fn check(
        &mut self,
        pass: Pass,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Option<Residual> {
        let start = Instant::now();
        let [least, most] = CHECKED_LEAVES;
        let count = (CHECK_SHARE * self.stats.rays as f32 / RAYS_PER_LEAF as f32) as u64;
        let progress = self.progress(Phase::Transport, pass.fraction(0.9));
        let count = count.clamp(least, most) as usize;
        let mut look = |count| {
            residual(self.light(), count, &mut || {
                *stopped = *stopped || watch(&progress).is_break();
                if *stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
        };
        let mut found = look(count);
        if let Some(unclear) = found.filter(|found| found.may_be(self.settings.error)) {
            // A look costs little beside a pass more.
            found = look(AGAIN * count).map(|found| Residual { rays: unclear.rays + found.rays, ..found });
        }
        if let Some(residual) = &found {
            self.stats.error = Some(residual.error());
            self.stats.bias = -residual.bias();
            self.stats.check_rays += residual.rays;
        }
        self.stats.seconds.check += start.elapsed().as_secs_f64();
        found
    }

    /// Begins a new series of iterations: the light is another one.
    pub(crate) fn restart(&mut self) {
        self.convergence.restart();
        self.account = Account::new(self.settings, Instant::now());
    }

    /// Tells materials whose extension's light travels as diffuse light from the others.
    pub(crate) fn sort_materials(&mut self) {
        (self.faint, self.strong) = sorted(&self.field, &self.scene.materials, self.settings.error);
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
            error: self.link_error(pass.tolerance),
            lost: self.link_error(self.settings.error.min(pass.tolerance)),
            shadow: if pass.closely || self.edges_known {
                SHADOW_SHARE * self.settings.error * self.mean_irradiance()
            } else {
                f32::INFINITY
            },
            kept_too: !self.edges_known,
            dark: self.stats.iterations > 0 && self.exitant.irradiance[0] == Rgb::ZERO,
            smallest: SMALLEST_SHARE * pass.tolerance.sqrt() * self.elements.rooms.size,
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

    /// One iteration of the paper: gather, push, reflect, pull. Returns the change of irradiance, as
    /// [`Stats::residuals`] has it; `None`, and no change, where `watch` broke before the light was gathered.
    pub(crate) fn iterate(&mut self, how: Reflect, watch: &mut dyn FnMut() -> ControlFlow<()>) -> Option<f32> {
        let before: Vec<Rgb> = self.exitant.irradiance.clone();
        let start = Instant::now();
        if self.gather(watch).is_break() {
            return None;
        }
        self.push();
        self.weigh_faint();
        let residual = self.extrapolate(&before);
        let middle = Instant::now();
        self.reflect_senders(how, watch);
        let end = Instant::now();
        self.pull();
        self.stats.seconds.transport += (middle - start).as_secs_f64() + end.elapsed().as_secs_f64();
        self.stats.seconds.reflect += (end - middle).as_secs_f64();
        self.stats.iterations += 1;
        self.stats.residuals.push(residual);
        Some(residual)
    }

    /// Adds what the iterations to come would, where that is known. Returns the change since `before`, relative to the
    /// light there is, of all or on average over places: the larger one, of the channel that changed most.
    fn extrapolate(&mut self, before: &[Rgb]) -> f32 {
        let (mut change, mut moved, mut total) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let dim = DIM_SHARE * self.mean_irradiance();
        // Of each place by itself, and the area of all.
        let (mut moved_there, mut area) = (0.0, 0.0);
        for leaf in self.elements.patch_leaves() {
            let (element, leaf) = (&self.elements.nodes[leaf as usize], leaf as usize);
            let weight = f64::from(element.area * element.importance);
            let now = self.exitant.irradiance[leaf];
            let delta = (now - before[leaf]).as_dvec3();
            change += weight * delta;
            moved += weight * delta.abs();
            total += weight * now.as_dvec3();
            moved_there += weight * f64::from(delta_share(now, before[leaf], dim));
            area += weight;
        }
        // Directional light comes in steps: those are no series.
        let ahead = if self.elements.nodes[0].active { Rgb::ZERO } else { self.convergence.ahead(change) };
        if ahead != Rgb::ZERO {
            let leaves: Vec<u32> = self.elements.patch_leaves().collect();
            for leaf in leaves {
                let now = &mut self.exitant.irradiance[leaf as usize];
                *now = (*now + (*now - before[leaf as usize]) * ahead).max(Rgb::ZERO);
            }
        }
        // Channels in which there is next to nothing need not converge by themselves.
        let total = total.max(DVec3::splat(FAINT_CHANNEL * total.max_element()));
        if total.max_element() > 0.0 { (moved / total).max_element().max(moved_there / area) as f32 } else { 0.0 }
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
    pub(crate) fn prepare(&mut self, tolerance: Option<f32>, watch: &mut dyn FnMut() -> ControlFlow<()>) {
        let start = Instant::now();
        self.shown.clear();
        let error = tolerance.map(|tolerance| if self.skips.faint_links { tolerance } else { 0.0 });
        let room = self.account.room::<L>(self.elements.nodes.len() as u64, self.links.all().len() as u64);
        let known = tolerance.and_then(|_| self.kept_weights.take());
        let known = known.map(|known| known.with_light(&self.elements, &self.exitant));
        self.gather = Gather::new(self.light(), &self.links, error, (room, known.as_ref()), watch);
        self.kept_weights = known.and_then(KeptWeights::once_more);
        self.weighed_by = LightThen::new(&self.exitant);
        self.prepared = tolerance.is_some();
        self.stats.rays += self.gather.rays();
        self.stats.skipped.faint_links = self.gather.faint_links();
        self.stats.seconds.transport += start.elapsed().as_secs_f64();
    }

    /// Every receiver adds up what its links carry.
    fn gather(&mut self, watch: &mut dyn FnMut() -> ControlFlow<()>) -> ControlFlow<()> {
        let (mut gather, mut incident) = (std::mem::take(&mut self.gather), std::mem::take(&mut self.incident));
        let mut shot = self.shot.take();
        if let Some(shot) = &mut shot {
            shot.choose(self.light(), self.negligibly_unshot());
        }
        let answer = gather.gather(self.light(), &self.links, shot.as_ref(), &mut incident, watch);
        if answer.is_continue() {
            let waiting = shot.as_mut().map_or(0, |shot| shot.note(self.light(), &self.links, gather.arriving()));
            self.stats.links_evaluated += self.links.all().len() as u64 - waiting;
            self.stats.skipped.shot_links += waiting;
        }
        (self.gather, self.incident, self.shot) = (gather, incident, shot);
        answer
    }

    /// Hands light down to the leaves.
    fn push(&mut self) {
        for (leaf, irradiance) in self.gather.push(self.light(), &self.links) {
            // What inherited light tells of a single sender may be less than nothing.
            let irradiance = irradiance * self.feedback.counts(leaf);
            let all = self.shot.as_mut().map_or(irradiance.max(Rgb::ZERO), |shot| shot.receive(leaf, irradiance));
            self.exitant.irradiance[leaf as usize] = all;
        }
    }

    /// Finds out how much of what arrives leaves reflect beside the diffuse part where that travels as diffuse light. What is shot comes
    /// piece by piece, which tells of none how it arrives all in all.
    fn weigh_faint(&mut self) {
        let grazing = if self.shot.is_some() { None } else { Grazing::new(&self.field, &self.faint) };
        let Some(grazing) = grazing else { return };
        let found = self.gather.grazing(self.light(), &self.links, &grazing);
        self.faint_times.clear();
        self.faint_times.resize(self.elements.nodes.len(), 1.0);
        for (leaf, times) in found {
            let element = &self.elements.nodes[leaf as usize];
            let most = most_times(element.reflectance, self.faint[element.material as usize]);
            self.faint_times[leaf as usize] = times.min(most);
        }
    }

    /// Diffuse radiosity of the leaves, averaged bottom-up with its range and direction.
    pub(crate) fn pull(&mut self) {
        let exitant = &mut self.exitant;
        for node in (0..self.elements.nodes.len()).rev() {
            let element = &self.elements.nodes[node];
            if element.kind == Kind::Light {
                continue;
            }
            if element.child_count == 0 {
                let material = &self.scene.materials[element.material as usize];
                let emitted = if element.kind == Kind::Front { material.exitance } else { Rgb::ZERO };
                let times = self.faint_times.get(node).copied().unwrap_or(1.0);
                let reflectance = element.reflectance + self.faint[element.material as usize] * times;
                let radiosity = emitted + exitant.irradiance[node] * reflectance;
                exitant.radiosity[node] = radiosity;
                exitant.directional[node] = exitant.irradiance[node] * self.strong[element.material as usize];
                exitant.range[node] = [radiosity, radiosity];
                exitant.facing[node] = element.facing;
                continue;
            }
            let range = element.first_child as usize..(element.first_child + element.child_count) as usize;
            let (mut radiosity, mut irradiance, mut area, mut reflecting) = (Rgb::ZERO, Rgb::ZERO, 0.0, 0.0);
            let mut directional = Rgb::ZERO;
            let (mut low, mut high) = (Rgb::MAX, Rgb::ZERO);
            let (mut facing, mut weight) = (Facing::ZERO, 0.0);
            for child in range {
                let part = &self.elements.nodes[child];
                if part.kind == Kind::Light {
                    // Whoever links to this cluster must open it to find the light.
                    high = high.max(self.scene.lights[part.source as usize].intensity);
                    low = Rgb::ZERO;
                    continue;
                }
                radiosity += exitant.radiosity[child] * part.area;
                if part.importance > 0.0 {
                    irradiance += exitant.irradiance[child] * part.area;
                    reflecting += part.area;
                }
                directional += exitant.directional[child] * part.area;
                area += part.area;
                low = low.min(exitant.range[child][0]);
                high = high.max(exitant.range[child][1]);
                let power = exitant.radiosity[child].element_sum() * part.area;
                facing.add(&exitant.facing[child], power);
                weight += power;
            }
            if area > 0.0 {
                exitant.radiosity[node] = radiosity / area;
                exitant.irradiance[node] = if reflecting > 0.0 { irradiance / reflecting } else { Rgb::ZERO };
                exitant.directional[node] = directional / area;
                exitant.range[node] = [low, high];
            }
            // Next to no light, of which the reciprocal is infinite, is like none.
            let scale = weight.recip();
            exitant.facing[node] = if scale.is_finite() { facing.scaled(scale) } else { element.facing };
        }
    }

    /// What a link may be wrong by in a pass of this tolerance: irradiance × [`weight`](Self::weight).
    pub(crate) fn link_error(&self, tolerance: f32) -> f32 {
        LINK_SHARE * tolerance * self.mean_irradiance()
    }

    /// What an error of the irradiance of a receiver counts.
    pub(crate) fn weight(&self, receiver: u32) -> f32 {
        self.light().weight(receiver)
    }

    /// Mean irradiance of the surfaces that any light reaches and that reflect any; before there is any, that which the emitted power
    /// would make if it were spread evenly. The measure of every tolerance.
    pub(crate) fn mean_irradiance(&self) -> f32 {
        let (mut lit, mut area, mut power) = (0.0_f64, 0.0_f64, 0.0_f64);
        for leaf in self.elements.patch_leaves() {
            let (element, leaf) = (&self.elements.nodes[leaf as usize], leaf as usize);
            let irradiance = self.exitant.irradiance[leaf].max_element();
            if irradiance > 0.0 && element.importance > 0.0 {
                lit += f64::from(irradiance * element.area);
                area += f64::from(element.area);
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
        if area > 0.0 { (lit / area) as f32 } else { (power / f64::from(self.area)) as f32 }
    }

    /// Of a change of light no more than this share is left two iterations later.
    fn kept(&self) -> f32 {
        let reflected = |material: usize| {
            (self.scene.materials[material].reflectance + self.faint[material] + self.strong[material]).max_element()
        };
        let most = (0..self.scene.materials.len()).map(reflected).fold(0.0, f32::max);
        (most + REFLECTED_MARGIN).min(1.0).powi(2)
    }

    /// What all iterations to come would change.
    fn remaining(&self, residual: f32) -> f32 {
        let before = self.stats.residuals.iter().rev().nth(1).copied().unwrap_or(f32::INFINITY);
        self.convergence.remaining(residual, before)
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

/// By which share of what there is in a place its irradiance has changed; where it is dimmer than `dim`, by which share of that.
fn delta_share(now: Rgb, before: Rgb, dim: f32) -> f32 {
    let share = (now - before).abs().max_element() / now.max_element().max(dim);
    if share.is_finite() { share } else { 0.0 }
}

/// By material: what is reflected beside the diffuse part, as diffuse and as directional light.
fn sorted<L: LightField>(field: &L, materials: &[DiffuseMaterial], error: f32) -> (Vec<Rgb>, Vec<Rgb>) {
    let sort = |(material, diffuse): (u32, &DiffuseMaterial)| {
        let Some(albedo) = field.active(material) else { return (Rgb::ZERO, Rgb::ZERO) };
        let most = error * (albedo + diffuse.reflectance).min_element().max(FAINT_SHARE);
        if albedo.max_element() <= most { (albedo, Rgb::ZERO) } else { (Rgb::ZERO, albedo) }
    };
    (0..).zip(materials).map(sort).unzip()
}

/// Links are refined to a tolerance, and light settles over them.
#[derive(Clone, Copy, Debug)]
struct Pass {
    /// Passes before it.
    number: usize,
    /// Relative error that its links may have, if it all comes to the worst.
    tolerance: f32,
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

/// Checks what can be checked of a scene without its geometry.
pub(crate) fn check(input: &SceneInput) -> Result<(), SolveError> {
    if input.surfaces.is_empty() {
        return Err(SolveError::Empty);
    }
    for (i, material) in input.materials.iter().enumerate() {
        let wrong = |what, value, range| Err(SolveError::MaterialValue { material: i, what, value, range });
        let r = material.reflectance;
        if !r.is_finite() || r.min_element() < 0.0 || r.max_element() > 1.0 {
            return wrong("reflectance", r, "within 0…1");
        }
        let e = material.exitance;
        if !e.is_finite() || e.min_element() < 0.0 {
            return wrong("exitance", e, "not negative");
        }
        if e.max_element() > MOST_LIGHT {
            return wrong("exitance", e, "at most 1e30 W/m²");
        }
    }
    for (surface, s) in input.surfaces.iter().enumerate() {
        if s.material as usize >= input.materials.len() {
            return Err(SolveError::Material { surface, material: s.material, count: input.materials.len() });
        }
    }
    for (light, l) in input.lights.iter().enumerate() {
        if let Some(what) = l.fault() {
            return Err(SolveError::Light { light, what });
        }
    }
    Ok(())
}

/// Checks a scene and maps it to unit space.
pub(crate) fn scene_data(input: &SceneInput) -> Result<SceneData, SolveError> {
    scene_in(input, Normalization::new(&input.surfaces))
}

/// Checks a scene and maps it to a unit space that there is.
pub(crate) fn scene_in(input: &SceneInput, normalization: Normalization) -> Result<SceneData, SolveError> {
    scene_by(input, normalization, |surfaces, materials| {
        let twins = twins(&surfaces, materials);
        Ok((Visibility::with_twins(&surfaces, &twins), twins))
    })
}

/// Checks a scene and maps it to a unit space that there is; a closure makes of surfaces and materials what answers rays, and
/// tells which surfaces coincide.
pub(crate) fn scene_by<E: From<SolveError>>(
    input: &SceneInput,
    normalization: Normalization,
    rays: impl FnOnce(Vec<Geometry>, &[u32]) -> Result<(Visibility, Vec<u32>), E>,
) -> Result<SceneData, E> {
    check(input)?;
    let all = threads::map_range(0..input.surfaces.len(), 256, |surface| {
        let geometry = Geometry::from_surface(&input.surfaces[surface], &normalization);
        geometry.map_err(|source| SolveError::Surface { surface, source })
    });
    // The first error of all, whichever thread finds one first.
    let surfaces = all.into_iter().collect::<Result<Vec<_>, _>>()?;
    let lights = unit_lights(input, &normalization)?;
    let surface_materials: Vec<u32> = input.surfaces.iter().map(|s| s.material).collect();
    let (visibility, twins) = rays(surfaces, &surface_materials)?;
    Ok(SceneData {
        visibility,
        surface_materials,
        twins,
        shading_normals: input.surfaces.iter().map(|s| s.shading_normals).collect(),
        materials: input.materials.clone(),
        lights,
        light_positions: input.lights.iter().map(|l| normalization.to_unit(l.position)).collect(),
        texture: input.texture.clone(),
        normalization,
    })
}

/// Lights without extent in unit space, which their positions are not mapped to.
pub(crate) fn unit_lights(input: &SceneInput, normalization: &Normalization) -> Result<Vec<crate::Light>, SolveError> {
    let scale2 = (normalization.scale() * normalization.scale()) as f32;
    for (light, l) in input.lights.iter().enumerate() {
        // Far outside of the scene f32 ends: its square, which the inverse square law needs, must exist.
        if normalization.to_unit(l.position).abs().max_element() > 1e15 {
            return Err(SolveError::Light { light, what: "it is too far from the scene; make it a directional light" });
        }
    }
    let lights: Vec<crate::Light> = input
        .lights
        .iter()
        .map(|l| match l.kind {
            LightKind::Directional { .. } => *l,
            _ => crate::Light { intensity: l.intensity * scale2, ..*l },
        })
        .collect();
    // In a scene of micrometres a light of kilowatts is beyond f32.
    if let Some(light) = lights.iter().position(|l| l.intensity.max_element() > MOST_LIGHT) {
        return Err(SolveError::Light { light, what: "it is too strong for the size of the scene" });
    }
    Ok(lights)
}

//! The solver: refine, gather, push, reflect, pull, until the light has settled (paper, sections 3.1 to 3.3).

use crate::budget::{Account, Budget};
use crate::columns::{FREELY, STRICTLY, gains};
use crate::convergence::Convergence;
use crate::error::SolveError;
use crate::exposed::expose;
use crate::gather::Gather;
use crate::geometry::{Geometry, Normalization};
use crate::hierarchy::{Elements, Kind, SceneData};
use crate::hooks::LightField;
use crate::links::Links;
use crate::refine::{MutableLight, Pair, Tolerance, refine};
use crate::reflect::Senders;
use crate::relight::Linked;
use crate::resume::Unfinished;
use crate::skips::Skips;
use crate::stats::Stats;
use crate::steady;
use crate::transport::{Exitant, Light};
use crate::twins::twins;
use crate::visibility::Visibility;
use crate::{Facing, LightKind, Rgb, SceneInput};
use glam::DVec3;
use std::ops::ControlFlow;
use std::time::Instant;

/// A link's tolerance is this share of the error asked for, times the mean irradiance. Chosen so that the error of
/// the built-in scenes stays below what was asked for.
const LINK_SHARE: f32 = 0.07;
/// Elements are not split below this share of the error's square root: features smaller than that are not resolved.
const SMALLEST_SHARE: f32 = 0.008;
/// Tolerances of successive passes, relative to the last: nothing is refined for light that is not there yet.
pub(crate) const PASSES: [f32; 4] = [8.0, 4.0, 2.0, 1.0];
/// Index of the last of them.
pub(crate) const LAST_PASS: usize = PASSES.len() - 1;
/// Materials that reflect no more than this share of the error asked for beside their diffuse part have it carried as
/// diffuse light until it is shown.
const FAINT_SHARE: f32 = 0.7;
/// Iterations end when all that are to come would change the solution by less than this share of the error.
const CONVERGED_SHARE: f32 = 0.02;
/// The first pass that reflects the extension's light: before it, there is little light to reflect.
pub(crate) const FIRST_REFLECTED: usize = 2;
/// No more iterations than these follow one refinement; a reflectance of 0.99 needs hundreds.
const MOST_ITERATIONS: u32 = 400;

/// Exitances and intensities above this are refused: sums of powers and what white surfaces make of them would leave the
/// range of f32.
const MOST_LIGHT: f32 = 1e30;

/// Channels with less than this share of the strongest one's light need not converge by themselves.
const FAINT_CHANNEL: f64 = 1e-3;

/// What is asked of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Relative error of the solution, 0.001…1: 0.02 is fine, 0.1 coarse.
    pub error: f32,
    /// What it may cost.
    pub budget: Budget,
}

impl Settings {
    /// An error asked for, whatever it costs.
    #[must_use]
    pub fn with_error(error: f32) -> Self {
        Self { error, budget: Budget::default() }
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
    /// Relative error that the solution is believed to have now.
    pub error: f32,
    /// Links so far.
    pub links: u64,
    /// Elements so far.
    pub nodes: u64,
}

/// Solves for the light in a scene. `L` is what light does besides being diffuse radiosity; `()` for nothing.
#[derive(Debug)]
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
    /// What arrives through the links there are.
    gather: Gather,
    /// Whether it is known for these links as well as it can be.
    prepared: bool,
    /// What has links.
    pub(crate) linked: Linked,
    /// By material: what is reflected beside the diffuse part, if it is so little that transport carries it as
    /// diffuse light.
    pub(crate) faint: Vec<Rgb>,
    /// By material: what is reflected beside the diffuse part as directional light.
    strong: Vec<Rgb>,
    /// Irradiance of each leaf when its light was last reflected by the extension.
    pub(crate) last_reflected: Vec<Rgb>,
    /// What links may carry of directional light: see [`columns`](crate::columns).
    most_reflected: f32,
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
            directional: vec![Rgb::ZERO; count],
            reflected_as: (0..count as u32).collect(),
            peak: vec![0.0; count],
            gain: vec![1.0; count],
            senders: Senders::default(),
        };
        let incident = std::iter::repeat_with(L::Incident::default).take(count).collect();
        let reflected = std::iter::repeat_with(L::Exitant::default).take(count).collect();
        let solver = Self::with_light(scene, elements, exitant, (field, incident, reflected), settings);
        let mut solver = Self { skips, account: Account::new(settings.budget, start), ..solver };
        solver.unfinished =
            Unfinished { error: settings.error, unlit: vec![Pair { receiver: 0, sender: 0 }], ..Unfinished::default() };
        solver.stats.polygons = input.surfaces.len() as u64;
        solver.pull();
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
        let (faint, strong) = sorted(&field, scene.materials.len(), settings.error);
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
            account: Account::new(settings.budget, Instant::now()),
            skips: Skips::ALL,
            unfinished: Unfinished::default(),
            gather: Gather::default(),
            prepared: false,
            linked: Linked::default(),
            faint,
            strong,
            last_reflected: Vec::new(),
            most_reflected: FREELY,
            brightest: Vec::new(),
            area,
            convergence: Convergence::default(),
        };
        solver.linked = solver.linked();
        solver
    }

    /// Solves. `watch` is told how far it is every few milliseconds, and may break: then the solution is what there is by
    /// then, and [`Stats::stopped`] is set. Where a [`Budget`] is spent, light settles over what is linked by then, and
    /// [`Stats::spent`] tells which one it was.
    pub fn solve(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        let mut stopped = false;
        self.unfinished.renew(&mut self.links, self.elements.nodes.len());
        for (pass, looseness) in PASSES.iter().enumerate().skip(self.unfinished.passes as usize) {
            self.refine(pass, *looseness, &mut stopped, watch);
            if stopped {
                // New elements have their parents' light.
                break;
            }
            self.prepare_watched(pass, &mut stopped, watch);
            self.settle(pass, &mut stopped, watch);
            self.measure();
            if stopped {
                break;
            }
            if self.stats.spent.is_none() {
                self.unfinished.passes = pass as u32 + 1;
            }
        }
        if self.stats.iterations == 0 {
            // Whenever it was stopped, there is some light.
            self.prepare(false, &mut || ControlFlow::Continue(()));
            self.iterate(false, &mut || ControlFlow::Continue(()));
        }
        self.measure();
        self.stats.stopped = stopped;
        self.stats.nodes = self.elements.nodes.len() as u64;
        self.stats.leaves = self.elements.patch_leaves().count() as u64;
        self.stats.links = self.links.all().len() as u64;
    }

    /// Finds out how the light of the links of a pass reaches leaves.
    fn prepare_watched(
        &mut self,
        pass: usize,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        let account = self.account;
        let progress = self.progress(Phase::Transport, progress_fraction(pass, 0.8), PASSES[pass]);
        self.prepare(pass == LAST_PASS, &mut || {
            *stopped = *stopped || watch(&progress).is_break();
            if *stopped || account.is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }

    /// The same where links have changed since, for the last pass.
    pub(crate) fn prepare_again(&mut self, stopped: &mut bool, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        if !self.prepared {
            self.prepare_watched(LAST_PASS, stopped, watch);
        }
    }

    /// Iterates until light has settled, as far as a pass needs it.
    pub(crate) fn settle(
        &mut self,
        pass: usize,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        let last = pass == LAST_PASS;
        let goal = if last { CONVERGED_SHARE * self.settings.error } else { self.settings.error };
        let account = self.account;
        for iteration in 0..if last { MOST_ITERATIONS } else { 3 } {
            let fraction = progress_fraction(pass, 0.8 + 0.2 * (iteration as f32 / (iteration as f32 + 4.0)));
            let progress = self.progress(Phase::Transport, fraction, PASSES[pass]);
            let ask = &mut || {
                *stopped = *stopped || watch(&progress).is_break();
                if *stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let Some(residual) = self.iterate(pass >= FIRST_REFLECTED, ask) else { break };
            if self.grows(iteration) {
                self.most_reflected = (self.most_reflected * 0.7).max(STRICTLY);
            }
            let settled = self.remaining(residual) < goal && iteration > 0;
            if *stopped || settled || account.is_over() {
                break;
            }
        }
    }

    /// Begins a new series of iterations: the light is another one.
    pub(crate) fn restart(&mut self) {
        self.convergence.restart();
        self.account = Account::new(self.settings.budget, Instant::now());
    }

    /// Tells materials whose extension's light travels as diffuse light from the others.
    pub(crate) fn sort_materials(&mut self) {
        (self.faint, self.strong) = sorted(&self.field, self.scene.materials.len(), self.settings.error);
    }

    /// Takes note of the memory in use.
    fn measure(&mut self) {
        let links = self.links.all().len() as u64;
        self.stats.bytes =
            self.account.measure(&self.field, &self.incident, &self.reflected, links, self.gather.weight_bytes());
    }

    /// Refines all links to a tolerance.
    fn refine(
        &mut self,
        pass: usize,
        looseness: f32,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        let start = Instant::now();
        let tolerance = Tolerance {
            error: LINK_SHARE * self.settings.error * looseness * self.mean_irradiance(),
            area: self.area,
            smallest: SMALLEST_SHARE * self.settings.error.sqrt(),
            skips: self.skips,
        };
        let error = self.believed_error(looseness);
        self.convergence.restart();
        let (links, unlit) = (self.links.take(), std::mem::take(&mut self.unfinished.unlit));
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
            let fraction = progress_fraction(pass, 0.8 * wave_number / (wave_number + 8.0));
            watch(&Progress { phase: Phase::Refine, fraction, error, links: wave + done, nodes })
        });
        *stopped |= refined.stopped;
        self.stats.spent = self.stats.spent.or(refined.spent);
        let count = self.elements.nodes.len();
        self.links = Links::new(refined.links, count);
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

    /// One iteration of the paper: gather, push, reflect, pull. Returns the change of the mean radiosity, relative
    /// to it; `None`, and no change, where `watch` broke before the light was gathered.
    pub(crate) fn iterate(&mut self, reflects: bool, watch: &mut dyn FnMut() -> ControlFlow<()>) -> Option<f32> {
        let before: Vec<Rgb> = self.exitant.irradiance.clone();
        let start = Instant::now();
        if self.gather(watch).is_break() {
            return None;
        }
        self.push();
        let residual = self.extrapolate(&before);
        let middle = Instant::now();
        if reflects && self.reflect_senders(watch) {
            self.exitant.gain = gains(self.light(), &self.links, self.most_reflected);
        }
        let end = Instant::now();
        self.pull();
        self.stats.seconds.transport += (middle - start).as_secs_f64() + end.elapsed().as_secs_f64();
        self.stats.seconds.reflect += (end - middle).as_secs_f64();
        self.stats.iterations += 1;
        self.stats.residuals.push(residual);
        Some(residual)
    }

    /// Adds what the iterations to come would, where that is known. Returns the change since `before`, relative to the
    /// light there is: that of the channel that changed most.
    fn extrapolate(&mut self, before: &[Rgb]) -> f32 {
        let (mut change, mut moved, mut total) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for leaf in self.elements.patch_leaves() {
            let (element, leaf) = (&self.elements.nodes[leaf as usize], leaf as usize);
            let weight = f64::from(element.area * element.importance);
            let now = self.exitant.irradiance[leaf];
            let delta = (now - before[leaf]).as_dvec3();
            change += weight * delta;
            moved += weight * delta.abs();
            total += weight * now.as_dvec3();
        }
        // Directional light comes in steps, when it is reflected anew: those are no series.
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
        if total.max_element() > 0.0 { (moved / total).max_element() as f32 } else { 0.0 }
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

    /// Finds out how the light of each link reaches the leaves below its receiver: by a look from each leaf itself once links
    /// are as fine as they will be.
    pub(crate) fn prepare(&mut self, closely: bool, watch: &mut dyn FnMut() -> ControlFlow<()>) {
        let start = Instant::now();
        let error = closely.then_some(if self.skips.faint_links { self.settings.error } else { 0.0 });
        let room = self.account.room::<L>(self.elements.nodes.len() as u64, self.links.all().len() as u64);
        self.gather = Gather::new(self.light(), &self.links, error, room, watch);
        self.prepared = closely;
        self.stats.rays += self.gather.rays();
        self.stats.skipped.faint_links = self.gather.faint_links();
        self.stats.seconds.transport += start.elapsed().as_secs_f64();
    }

    /// Every receiver adds up what its links carry.
    fn gather(&mut self, watch: &mut dyn FnMut() -> ControlFlow<()>) -> ControlFlow<()> {
        let (mut gather, mut incident) = (std::mem::take(&mut self.gather), std::mem::take(&mut self.incident));
        let answer = gather.gather(self.light(), &self.links, &mut incident, watch);
        (self.gather, self.incident) = (gather, incident);
        answer
    }

    /// Hands light down to the leaves.
    fn push(&mut self) {
        for (leaf, irradiance) in self.gather.push(self.light(), &self.links) {
            self.exitant.irradiance[leaf as usize] = irradiance;
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
                let reflectance = element.reflectance + self.faint[element.material as usize];
                let radiosity = emitted + exitant.irradiance[node] * reflectance;
                exitant.radiosity[node] = radiosity;
                exitant.directional[node] = exitant.irradiance[node] * self.strong[element.material as usize];
                exitant.range[node] = [radiosity, radiosity];
                exitant.facing[node] = element.facing;
                continue;
            }
            let range = element.first_child as usize..(element.first_child + element.child_count) as usize;
            let (mut radiosity, mut irradiance, mut area) = (Rgb::ZERO, Rgb::ZERO, 0.0);
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
                irradiance += exitant.irradiance[child] * part.area;
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
                exitant.irradiance[node] = irradiance / area;
                exitant.directional[node] = directional / area;
                exitant.range[node] = [low, high];
            }
            // Next to no light, of which the reciprocal is infinite, is like none.
            let scale = weight.recip();
            exitant.facing[node] = if scale.is_finite() { facing.scaled(scale) } else { element.facing };
        }
    }

    /// Mean irradiance of the surfaces that any light reaches and that reflect any; before there is any, that which the emitted power
    /// would make if it were spread evenly. The measure of every tolerance.
    fn mean_irradiance(&self) -> f32 {
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
                _ => 4.0 * std::f32::consts::PI,
            };
            power += f64::from(light.intensity.max_element() * spread);
        }
        if area > 0.0 { (lit / area) as f32 } else { (power / f64::from(self.area)) as f32 }
    }

    /// Whether each of the last iterations after the first ones changed more than the last but one before it: light that does
    /// not die out. Between two surfaces it goes forth and back, and every other iteration may change less.
    fn grows(&self, iteration: u32) -> bool {
        const LAST: usize = 5;
        let last = &self.stats.residuals[self.stats.residuals.len().saturating_sub(LAST)..];
        iteration as usize >= LAST && last.windows(3).all(|three| three[2] > three[0])
    }

    /// What all iterations to come would change.
    fn remaining(&self, residual: f32) -> f32 {
        let before = self.stats.residuals.iter().rev().nth(1).copied().unwrap_or(f32::INFINITY);
        self.convergence.remaining(residual, before)
    }

    fn believed_error(&self, looseness: f32) -> f32 {
        let residual = self.stats.residuals.last().copied().unwrap_or(1.0);
        (self.settings.error * looseness).hypot(residual).min(1.0)
    }

    pub(crate) fn progress(&self, phase: Phase, fraction: f32, looseness: f32) -> Progress {
        Progress {
            phase,
            fraction,
            error: self.believed_error(looseness),
            links: self.links.all().len() as u64,
            nodes: self.elements.nodes.len() as u64,
        }
    }
}

/// By material: what is reflected beside the diffuse part, as diffuse and as directional light.
fn sorted<L: LightField>(field: &L, materials: usize, error: f32) -> (Vec<Rgb>, Vec<Rgb>) {
    let sort = |material| match field.active(material) {
        Some(albedo) if albedo.max_element() <= FAINT_SHARE * error => (albedo, Rgb::ZERO),
        Some(albedo) => (Rgb::ZERO, albedo),
        None => (Rgb::ZERO, Rgb::ZERO),
    };
    (0..materials as u32).map(sort).unzip()
}

/// Share of the work done: each pass costs a few times the one before.
fn progress_fraction(pass: usize, within: f32) -> f32 {
    const SHARES: [f32; 5] = [0.0, 0.05, 0.15, 0.4, 0.9];
    let pass = pass.min(SHARES.len() - 2);
    SHARES[pass] + (SHARES[pass + 1] - SHARES[pass]) * within.clamp(0.0, 1.0)
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
    check(input)?;
    let normalization = Normalization::new(&input.surfaces);
    let surfaces = input
        .surfaces
        .iter()
        .enumerate()
        .map(|(surface, s)| {
            Geometry::from_surface(s, &normalization).map_err(|source| SolveError::Surface { surface, source })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let lights = unit_lights(input, &normalization)?;
    let surface_materials: Vec<u32> = input.surfaces.iter().map(|s| s.material).collect();
    let twins = twins(&surfaces, &surface_materials);
    Ok(SceneData {
        visibility: Visibility::with_twins(&surfaces, &twins),
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

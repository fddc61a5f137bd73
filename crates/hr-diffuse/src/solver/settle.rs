//! Iterations until light has settled, and what is mended and checked once it has.

use super::{Pass, Phase, Progress, Solver, Transport};
use crate::Rgb;
use crate::clock::Instant;
use crate::effort::Aim;
use crate::hooks::LightField;
use crate::misjudged::Misjudged;
use crate::reflect::Reflect;
use crate::relight::ratio;
use crate::residual::{Brought, Look, RAYS_PER_LEAF, Residual, residual};
use crate::sent::Sent;
use crate::transport::Exitant;
use std::ops::ControlFlow;

/// Light has settled when all iterations to come would change the solution by less than this share of the error.
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
/// So many rays for each place, of the usual [effort](crate::effort), are worth knowing how much reflected light links should bring; no
/// more than links themselves took where that is more.
const CALIBRATE_RAYS: f32 = 64.0;
/// This share of the rays shot so far is worth knowing what the solution is off by, …
const CHECK_SHARE: f32 = 0.1;
/// … from at least and at most so many leaves, …
const CHECKED_LEAVES: [u64; 2] = [64, 2000];
/// … and more closely where that does not tell whether it is fine enough, or else by how much it is not: once, or as long as it takes no
/// more than this share. A look costs little beside a pass.
const CLEAR_SHARE: f32 = 0.5;
/// From one iteration to the next no more of a change is left than the share that the brightest material reflects, and this.
const REFLECTED_MARGIN: f32 = 0.02;

/// When iterations end.
#[derive(Clone, Copy)]
struct Until {
    /// After so many at most, or …
    most: u32,
    /// … when all that are to come would change the solution by less than this share of the error: with what leaves have reflected of
    /// much of it, …
    share: f32,
    /// … and once more with what all of an extension's leaves reflect of all of it.
    finely: bool,
}

impl Until {
    /// Light is there roughly.
    const ROUGHLY: Self = Self { most: FEW_ITERATIONS, share: 1.0, finely: true };
    /// It is sent in proportion to what arrives.
    const EXPECTED: Self = Self { most: MOST_ITERATIONS, share: EXPECTED_SHARE, finely: false };
    /// It has settled, so that links can be compared with rays.
    const COMPARABLE: Self = Self { most: MOST_ITERATIONS, share: CONVERGED_SHARE, finely: false };
    /// Nothing more is to come.
    const SETTLED: Self = Self { finely: true, ..Self::COMPARABLE };
}

impl<L: LightField> Solver<L> {
    /// Iterates until light has settled, as far as a pass needs it.
    pub(super) fn settle(
        &mut self,
        pass: Pass,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        // The extension's light is reflected when most of it is there: that is what takes time. Shooting starts from the dark anyhow.
        let warms = self.settings.transport == Transport::Gather && self.elements.nodes[0].active;
        if !pass.closely || warms {
            let how = if pass.reflects && !pass.closely { Reflect::Reshaped } else { Reflect::Not };
            self.iterate_until(pass, (Until::ROUGHLY, how), stopped, watch);
        }
        if pass.closely && !*stopped {
            self.iterate_until(pass, (Until::COMPARABLE, Reflect::Reshaped), stopped, watch);
        }
    }

    /// Iterates until light has settled so far, with or without the extension's light.
    fn iterate_until(
        &mut self,
        pass: Pass,
        (Until { most, share, finely }, how): (Until, Reflect),
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        if *stopped {
            return;
        }
        let account = self.account;
        let reflects = matches!(how, Reflect::Reshaped | Reflect::Changed);
        let mut before = self.begin_shooting(reflects);
        let directional = reflects && self.elements.nodes[0].active;
        self.feedback.restart();
        let mut is_left = finely && directional && self.shot.is_none();
        let (mut settled, mut next) = (false, how);
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
            settled = self.remaining(residual) < share * self.settings.tolerance() && iteration > 0;
            if settled && is_left {
                (settled, is_left, next) = (false, false, Reflect::Changed);
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

    /// Pure metal is dark until light has come to it, and gets no links before. That light goes on to other metal, so that where much
    /// waits links follow it from one to the next within a pass: those that come may be much finer.
    pub(super) fn follow(
        &mut self,
        pass: Pass,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        for _ in 0..MOST_FOLLOWED {
            let goes_on = pass.reflects && !*stopped && !self.account.is_over() && self.stats.spent.is_none();
            if !goes_on || self.waiting() < FOLLOWED_SHARE * pass.aim.tolerance {
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

    /// Compares what links bring with what there is, now that light is in place, and lets it settle once more: first where it
    /// comes from, then how much of it there is.
    pub(super) fn amend(
        &mut self,
        pass: Pass,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) {
        let renewed = self.renew_weights(pass, stopped, watch);
        let calibrated = self.calibrate(pass, stopped, watch);
        if renewed || calibrated {
            self.convergence.restart();
            self.iterate_until(pass, (Until::SETTLED, Reflect::Reshaped), stopped, watch);
        } else if self.settings.transport == Transport::Gather && self.elements.nodes[0].active {
            // What is shot has been reflected finely.
            self.iterate_until(pass, (Until::SETTLED, Reflect::Changed), stopped, watch);
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
        let usual = CALIBRATE_RAYS as u64 * gather.reflecting_places(self.light()) as u64;
        // Where links needed few rays there is little to mend.
        let most = self.stats.rays.max(usual);
        let rays = most.min((usual as f64 * f64::from(pass.aim.effort).powi(2)) as u64) as usize;
        let shot = gather.calibrate(self.light(), &self.links, rays, &mut || {
            *stopped = *stopped || watch(&progress).is_break();
            if *stopped || account.is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        self.gather = gather;
        self.stats.check_rays += shot;
        self.stats.seconds.check += start.elapsed().as_secs_f64();
        shot > 0
    }

    /// Finds what the solution is off by.
    pub(super) fn check(
        &mut self,
        pass: Pass,
        stopped: &mut bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Option<Residual> {
        let start = Instant::now();
        let [least, most] = CHECKED_LEAVES;
        let count = (CHECK_SHARE * self.stats.rays as f32 / RAYS_PER_LEAF as f32) as u64;
        let progress = self.progress(Phase::Transport, pass.fraction(0.9));
        let first = Look { leaves: count.clamp(least, most) as usize, finer: 1 };
        let brought = Brought::known(self.light(), &self.links, self.gather.arriving());
        let mut look = |how| {
            residual(self.light(), brought.as_ref(), how, &mut || {
                *stopped = *stopped || watch(&progress).is_break();
                if *stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
        };
        let (error, most) =
            (self.settings.error, (CLEAR_SHARE * (self.stats.rays + self.stats.check_rays) as f32) as u64);
        let (mut how, mut found, mut shot) = (first, look(first), 0);
        while let Some(unclear) = found.filter(|found| !found.tells(error)) {
            if how != first && 4 * unclear.rays > most {
                break;
            }
            how = how.closer(&unclear, error);
            shot += unclear.rays;
            found = look(how);
        }
        found = found.map(|found| Residual { rays: shot + found.rays, ..found });
        if let Some(residual) = &found {
            self.stats.error = Some(residual.error());
            self.stats.bias = -residual.bias();
            self.stats.check_rays += residual.rays;
        }
        self.stats.seconds.check += start.elapsed().as_secs_f64();
        found
    }

    /// Lets light settle anew over the links that there are, for which it is found out how they reach leaves where it is not
    /// known yet.
    pub(crate) fn settle_again(&mut self, stopped: &mut bool, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        let aim = self.unfinished.aim;
        let aim = Aim { tolerance: aim.tolerance.min(1.0), ..aim };
        let pass = Pass { number: 1, aim, reflects: true, closely: true };
        let prepared = self.prepared;
        if !prepared {
            // Nothing is refined here, before which clusters are judged.
            self.exitant.misjudged = Misjudged::new(&self.elements, &self.exitant);
            self.prepare_watched(pass, stopped, watch);
        }
        self.expect_in_proportion(pass, stopped, watch);
        self.iterate_until(pass, (Until::SETTLED, Reflect::Reshaped), stopped, watch);
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
        self.iterate_until(pass, (Until::EXPECTED, Reflect::InProportion), stopped, watch);
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
}

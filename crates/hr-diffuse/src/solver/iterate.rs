//! One iteration: gather, push, reflect, pull (paper, sections 3.1 to 3.3).

use super::Solver;
use crate::clock::Instant;
use crate::faint::{Grazing, most_times};
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::reflect::Reflect;
use crate::shooting::Shot;
use crate::{Facing, Rgb};
use glam::DVec3;
use std::ops::ControlFlow;

/// Light is to settle everywhere: how much has changed is a share of what there is in the same place, or of so much of the scene's mean
/// irradiance where it is dimmer.
const DIM_SHARE: f32 = 0.03;
/// Channels with less than this share of the strongest one's light need not converge by themselves.
const FAINT_CHANNEL: f64 = 1e-3;

impl<L: LightField> Solver<L> {
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
        let ahead = if self.elements.nodes[0].active { Rgb::ZERO } else { self.convergence.ahead(change, moved) };
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

    /// Finds out how much of what arrives leaves reflect beside the diffuse part where that travels as diffuse light.
    fn weigh_faint(&mut self) {
        let Some(grazing) = Grazing::new(&self.field, &self.faint) else { return };
        // What is shot comes piece by piece.
        let brought = self.shot.as_ref().map_or_else(|| self.gather.arriving(), Shot::carried);
        let found = self.gather.grazing(self.light(), (&self.links, brought), &grazing);
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
}

/// By which share of what there is in a place its irradiance has changed; where it is dimmer than `dim`, by which share of that.
fn delta_share(now: Rgb, before: Rgb, dim: f32) -> f32 {
    let share = (now - before).abs().max_element() / now.max_element().max(dim);
    if share.is_finite() { share } else { 0.0 }
}

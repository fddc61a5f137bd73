//! Edits of places: surfaces and lights move, and only those links are renewed that this concerns.
//!
//! The hierarchy keeps its shape: what has moved takes its elements along, and clusters become what their children are
//! together. A link is looked at again if one of its ends has moved or holds what has, or if that left or entered the shaft
//! between them (G. Drettakis and F. Sillion, "Interactive update of global illumination using a line-space hierarchy",
//! SIGGRAPH 1997); so is every such pair that had no link. All other links stay. Then light settles roughly, and the solve
//! goes on from there: links that are too coarse for the light as it is now are refined, leaves look for themselves, and rays
//! find the error.

use crate::error::SolveError;
use crate::exposed::{TOUCHING, expose_again};
use crate::geometry::Geometry;
use crate::hierarchy::{GRAFT, SceneData, grafted, make_room};
use crate::hooks::LightField;
use crate::kept_weights::KeptWeights;
use crate::links::Links;
use crate::moved::{Moved, is_within_reach};
use crate::refine::Pair;
use crate::renewal::{Renewal, renewal};
use crate::sent::Sent;
use crate::solver::{Progress, Solver, scene_in};
use crate::{Facing, Rgb, SceneInput};
use std::mem::discriminant;
use std::ops::ControlFlow;

impl<L: LightField> Solver<L> {
    /// Takes over other places and shapes of surfaces and lights, renews the links that they concern, and solves for the light as
    /// [`solve`](Self::solve) does, from that which there is. `input` is the scene as it is now; what
    /// [`relight`](Self::relight) takes of it may be another one, too. [`Stats::renewed_links`](crate::Stats::renewed_links)
    /// and [`Stats::kept_links`](crate::Stats::kept_links) tell how much the edit concerned.
    ///
    /// Things may leave the box that the scene was in at first by half its size. After a large move clusters hold what is far
    /// apart: the answer is as exact, but takes more links than that of a new solver.
    ///
    /// # Errors
    /// [`SolveError::Edit`] where surfaces, materials or lights were added or removed, a surface is of another kind now, is too
    /// far outside, or coincides with another one where it did not or the other way round; what `relight` refuses; and what
    /// [`Solver::new`] says of a scene. Nothing has changed then.
    pub fn rearrange(
        &mut self,
        input: &SceneInput,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<(), SolveError> {
        self.can_take(input, None, true)?;
        let scene = scene_in(input, self.scene.normalization)?;
        self.can_move(&scene)?;
        crate::steady::check(&scene, |material| self.field.active(material).unwrap_or(Rgb::ZERO))?;
        let mut moved = Moved::new(&self.scene, &scene);
        self.scene = scene;
        let skips = self.skips;
        let extra = |material| self.field.active(material);
        moved.mark(&self.elements);
        self.elements.refit(&self.scene, &moved);
        self.elements.repaint(&self.scene, extra);
        let sealed = self.elements.sealed.clone();
        let unsealed = self.elements.unseal(&self.scene, extra, skips);
        if !unsealed.is_empty() {
            self.elements.graft(&self.scene, unsealed);
            self.make_room();
            moved.mark(&self.elements);
        }
        self.expose_near(&moved, &sealed);
        let waiting = std::mem::take(&mut self.unfinished.unlit);
        let links = std::mem::take(&mut self.links);
        let Renewal { stays, waiting, again } = renewal(&self.scene, &self.elements, &moved, links.all(), waiting);
        let kept = links.all().iter().zip(&stays).filter(|(_, stays)| **stays).map(|(link, _)| *link);
        self.links = Links::new(kept.collect(), self.elements.nodes.len());
        self.stats.kept_links = self.links.all().len() as u64;
        self.stats.renewed_links = links.all().len() as u64 - self.stats.kept_links;
        let prepared = std::mem::replace(&mut self.prepared, false);
        let gather = std::mem::take(&mut self.gather);
        self.kept_weights = prepared.then(|| KeptWeights::new(gather, links, stays, moved, &self.exitant));
        self.unfinished.unlit = [waiting, again].concat();
        self.unfinished.found = f32::INFINITY;
        self.solve_again(watch);
        Ok(())
    }

    /// Whether surfaces are what they were, if not where.
    fn can_move(&self, scene: &SceneData) -> Result<(), SolveError> {
        let refused = |what, index| Err(SolveError::Edit { what, index });
        let kind = |geometry: &Geometry| match geometry {
            Geometry::Revolution(it) => (discriminant(geometry), Some(discriminant(&it.profile())), geometry.is_flat()),
            _ => (discriminant(geometry), None, true),
        };
        for (surface, (old, new)) in self.scene.surfaces().iter().zip(scene.surfaces()).enumerate() {
            if kind(old) != kind(new) || old.sphere().is_some() != new.sphere().is_some() {
                return refused("it is another kind of shape now: surface", surface);
            }
            if old != new && !is_within_reach(new) {
                return refused("it is too far outside of the box that held the scene: surface", surface);
            }
        }
        let is_twin = |surface: &usize| self.scene.twins[*surface] != scene.twins[*surface];
        match (0..scene.twins.len()).find(is_twin) {
            Some(surface) => refused("it coincides with another one, or did so before: surface", surface),
            None => Ok(()),
        }
    }

    /// Makes room by node for what was grafted, and lets the pairs wait that came with it.
    fn make_room(&mut self) {
        let exitant = &mut self.exitant;
        make_room(&mut exitant.radiosity, || Rgb::ZERO);
        make_room(&mut exitant.range, || [Rgb::ZERO; 2]);
        make_room(&mut exitant.facing, || Facing::ZERO);
        make_room(&mut exitant.irradiance, || Rgb::ZERO);
        make_room(&mut exitant.indirect, || Rgb::ZERO);
        make_room(&mut exitant.directional, || Rgb::ZERO);
        make_room(&mut exitant.peak, || 0.0);
        make_room(&mut exitant.gain, || 1.0);
        make_room(&mut exitant.adaptation, || 1.0);
        exitant.reflected_as.iter_mut().for_each(|node| *node = grafted(*node));
        make_room(&mut exitant.reflected_as, || 0);
        exitant.reflected_as[GRAFT as usize] = GRAFT;
        make_room(&mut exitant.senders.ranges, || [0; 2]);
        exitant.senders.standing.iter_mut().for_each(|standing| standing.leaf = grafted(standing.leaf));
        make_room(&mut self.incident, L::Incident::default);
        make_room(&mut self.reflected, L::Exitant::default);
        make_room(&mut self.brightest, || 0.0);
        make_room(&mut self.sent, || Sent::NOTHING);
        let count = self.elements.nodes.len();
        let exitant = &mut self.exitant;
        exitant.reflected_as.extend(exitant.reflected_as.len() as u32..count as u32);
        exitant.radiosity.resize(count, Rgb::ZERO);
        exitant.range.resize(count, [Rgb::ZERO; 2]);
        exitant.facing.resize(count, Facing::ZERO);
        exitant.irradiance.resize(count, Rgb::ZERO);
        exitant.indirect.resize(count, Rgb::ZERO);
        exitant.directional.resize(count, Rgb::ZERO);
        exitant.peak.resize(count, 0.0);
        exitant.gain.resize(count, 1.0);
        exitant.adaptation.resize(count, 1.0);
        self.incident.resize_with(count, L::Incident::default);
        self.reflected.resize_with(count, L::Exitant::default);
        let mut links = self.links.take();
        for link in &mut links {
            (link.receiver, link.sender) = (grafted(link.receiver), grafted(link.sender));
        }
        self.links = Links::new(links, count);
        for pair in self.unfinished.unlit.iter_mut().chain(&mut self.unfinished.coarse) {
            *pair = Pair { receiver: grafted(pair.receiver), sender: grafted(pair.sender) };
        }
        let old = grafted(0);
        self.gather.grafted();
        let pairs = [(old, GRAFT), (GRAFT, old), (GRAFT, GRAFT)].map(|(receiver, sender)| Pair { receiver, sender });
        self.unfinished.unlit.extend(pairs);
    }

    /// Finds anew which parts of surfaces are covered by what has moved, or by sides that were `sealed` and are not now or the
    /// other way round.
    fn expose_near(&mut self, moved: &Moved, sealed: &[[bool; 2]]) {
        let surfaces = self.scene.surfaces();
        let is_other = |surface: usize| self.elements.sealed[surface] != sealed[surface];
        let near = |surface| is_other(surface) || moved.is_near(surface as u32, &surfaces[surface], 2.0 * TOUCHING);
        let near: Vec<bool> = (0..surfaces.len()).map(near).collect();
        self.elements.find_touched(&self.scene, |surface| near[surface as usize]);
        expose_again(&self.scene, &mut self.elements, |surface| near[surface as usize]);
    }
}

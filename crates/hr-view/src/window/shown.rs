//! A solution on the device, with its glossy light as the eye sees it.

use super::WindowError;
use super::gpu::Gpu;
use super::layouts::Layouts;
use super::parts::Parts;
use super::refresh::{Refresh, Refreshed};
use super::scene_buffers::SceneBuffers;
use super::view::View;
use crate::display::Walkable;
use std::time::{Duration, Instant};

/// What glossy radiances are computed for: the view, the picture's size, the tolerance in radians.
type Circumstances = (View, [u32; 2], f32);

/// Buffers and what they were computed for.
pub(super) struct Shown {
    pub(super) buffers: SceneBuffers,
    /// Of each part of the glossy list.
    refresh: Vec<Refresh>,
    /// Where glossy light is computed at pixels: the materials whose light is not.
    pub(super) left: Option<Vec<String>>,
    computed_for: Option<Circumstances>,
    /// What the last refresh did, and how long it took.
    pub(super) refreshed: Refreshed,
    pub(super) evaluation: Duration,
}

impl Shown {
    /// Uploads a checked mesh, split into its lists.
    pub(super) fn new(gpu: &Gpu, layouts: &Layouts, walk: &dyn Walkable, parts: Parts) -> Result<Self, WindowError> {
        let buffers = SceneBuffers::new(gpu, layouts, walk.mesh(), &parts)?;
        let refresh = parts.glossy.into_iter().map(|part| Refresh::new(walk, part)).collect();
        let (refreshed, evaluation) = (Refreshed::default(), Duration::ZERO);
        let left = parts.at_pixels.map(|light| light.left);
        Ok(Self { buffers, refresh, left, computed_for: None, refreshed, evaluation })
    }

    /// Brings glossy radiances up to date where the eye, the picture's edges or the tolerance have changed. How many were
    /// evaluated.
    pub(super) fn follow(
        &mut self,
        gpu: &Gpu,
        walk: &dyn Walkable,
        view: &View,
        size: [u32; 2],
        tolerance: f32,
    ) -> usize {
        let wanted = (*view, size, tolerance);
        if self.computed_for == Some(wanted) {
            return 0;
        }
        self.computed_for = Some(wanted);
        let begin = Instant::now();
        let sight = view.sight(walk.mesh().origin, f64::from(size[0]) / f64::from(size[1]));
        self.refreshed = Refreshed::default();
        for (refresh, buffers) in self.refresh.iter_mut().zip(&self.buffers.glossy) {
            let refreshed = refresh.update(walk, view.eye, &sight, tolerance);
            if refreshed.evaluated > 0 {
                buffers.set_radiance(gpu, refresh.radiance());
            }
            self.refreshed += refreshed;
        }
        self.evaluation = begin.elapsed();
        self.refreshed.evaluated
    }
}

//! Looking inside: what is drawn over the picture, and about which point.

use super::WindowError;
use super::gpu::Gpu;
use super::overlay::{Layer, Marks};
use crate::display::Walkable;
use crate::inside::Finding;
use glam::DVec3;

/// What somebody wants to see of the inside.
#[derive(Default)]
pub(super) struct Looking {
    elements: bool,
    /// Level of the clusters that are shown.
    clusters: Option<u32>,
    hides_links: bool,
    /// The eye and the direction in which a point was picked.
    ray: Option<[DVec3; 2]>,
    finding: Option<Finding>,
    marks: Vec<Marks>,
}

impl Looking {
    /// What is to be drawn.
    pub(super) fn marks(&self) -> &[Marks] {
        &self.marks
    }

    /// Figures of the point that was picked.
    pub(super) fn text(&self) -> &[String] {
        self.finding.as_ref().map_or(&[], |finding| &finding.text)
    }

    /// The material of the point that was picked.
    pub(super) fn material(&self) -> Option<u32> {
        self.finding.as_ref().map(|finding| finding.material)
    }

    /// Picks the point that is seen from an eye in a direction.
    pub(super) fn pick(&mut self, eye: DVec3, direction: DVec3) {
        self.ray = Some([eye, direction]);
    }

    /// Leaves the point; whether there was one.
    pub(super) fn leave(&mut self) -> bool {
        self.finding = None;
        self.ray.take().is_some()
    }

    pub(super) fn toggle_links(&mut self) {
        self.hides_links = !self.hides_links;
    }

    pub(super) fn toggle_elements(&mut self) {
        self.elements = !self.elements;
    }

    /// One level deeper; after the deepest one none. What the user is told about it.
    pub(super) fn next_clusters(&mut self, walk: &dyn Walkable) -> String {
        let level = self.clusters.map_or(0, |level| level + 1);
        let boxes = walk.inside().map_or(0, |inside| inside.clusters(level).len() / 24);
        self.clusters = (boxes > 0).then_some(level);
        if boxes > 0 { format!("level {level}: {boxes} clusters") } else { "no clusters".to_owned() }
    }

    /// Makes anew what is drawn, after any change above or of the solution. The point is looked for where it was picked.
    pub(super) fn update(&mut self, gpu: &Gpu, walk: &dyn Walkable) -> Result<(), WindowError> {
        self.marks.clear();
        let Some(inside) = walk.inside() else { return Ok(()) };
        self.finding = self.ray.and_then(|[eye, direction]| inside.look_at(eye, direction));
        let mut add = |layer, marks: &[_]| -> Result<(), WindowError> {
            self.marks.extend(Marks::new(gpu, layer, marks)?);
            Ok(())
        };
        if self.elements {
            add(Layer::OnSurfaces, &inside.elements())?;
        }
        if let Some(level) = self.clusters {
            add(Layer::OnSurfaces, &inside.clusters(level))?;
        }
        if let Some(finding) = &self.finding {
            add(Layer::Solid, &finding.balloon)?;
            if !self.hides_links {
                add(Layer::OnTop, &finding.links)?;
            }
            add(Layer::OnTop, &finding.lines)?;
        }
        Ok(())
    }
}

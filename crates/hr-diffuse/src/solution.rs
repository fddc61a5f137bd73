//! A finished solution: what is read from it to show it.

use crate::clock::Instant;
use crate::face_clusters::FaceClusters;
use crate::hierarchy::{Elements, SceneData};
use crate::hooks::{Arrived, LightField, NodeId};
use crate::links::Links;
use crate::reconstruct::reconstruct;
use crate::resume::Unfinished;
use crate::solver::{Phase, Progress, Solver};
use crate::stats::Stats;
use crate::transport::{Exitant, Light};
use crate::vertices::Vertices;
use crate::{Rgb, visibility::Hit};
use glam::Vec2;
use std::f32::consts::FRAC_1_PI;
use std::ops::ControlFlow;

/// Tells which leaves pictures show.
pub type Seen<'a> = &'a (dyn Fn(NodeId) -> bool + Sync);

/// The light in a scene: hierarchy, links, exitant light per element and irradiance per vertex.
#[derive(Debug)]
pub struct Solution<L: LightField = ()> {
    /// Geometry and rays, in unit space.
    pub scene: SceneData,
    /// The element hierarchy.
    pub elements: Elements,
    /// Exitant diffuse light per node.
    pub exitant: Exitant,
    /// Who lights whom.
    pub links: Links,
    /// Smooth irradiance for display.
    pub vertices: Vertices,
    /// The extension.
    pub field: L,
    /// What it keeps of every node's incident light.
    pub incident: Vec<L::Incident>,
    /// What it keeps of every node's exitant light.
    pub reflected: Vec<L::Exitant>,
    /// By material: what is reflected beside the diffuse part, where transport carried it as diffuse light.
    pub faint: Vec<Rgb>,
    /// Leaves that stand for others.
    pub faces: FaceClusters,
    /// Work done and avoided.
    pub stats: Stats,
    /// What is left to be done.
    pub(crate) unfinished: Unfinished,
}

impl<L: LightField> Solver<L> {
    /// Makes the solution ready for display: values at vertices. Where `watch` breaks, those that are left take the mean of
    /// the elements around them.
    pub fn finish(self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Solution<L> {
        self.finish_seen(&|_| true, watch)
    }

    /// The same for pictures that show some leaves only: to find the irradiance of a vertex takes about as long as to solve for that
    /// of a leaf. Vertices of no leaf that is `seen` take the mean of the elements around them
    /// ([`unseen_vertices`](crate::stats::Skipped::unseen_vertices)); the others gather what they would in the whole, but for how far
    /// the light of a region is made to agree with that of its leaves: leaves that are not seen have no say in it.
    pub fn finish_seen(mut self, seen: Seen<'_>, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Solution<L> {
        let start = Instant::now();
        let faces = self.face_clusters();
        self.stats.skipped.joined_leaves = faces.joined(&self.elements);
        let (links, nodes) = (self.links.all().len() as u64, self.elements.nodes.len() as u64);
        let error = self.settings.tolerance();
        let mut stopped = false;
        // A solution that was kept, and left as it was, knows it already.
        let known = self.gather.is_for(&self.links);
        if known {
            for (leaf, indirect) in self.gather.indirect(self.light(), &self.links) {
                self.exitant.indirect[leaf as usize] = indirect;
            }
        }
        // What is shown of flat leaves is what they send, in more detail; curved ones send more blurred, as far as their normals reach.
        let (flat, curved): (Vec<_>, Vec<_>) = std::mem::take(&mut self.shown)
            .into_iter()
            .partition(|(leaf, _)| self.elements.nodes[*leaf as usize].is_flat());
        for (leaf, exitant) in flat {
            self.reflected[leaf as usize] = exitant;
        }
        let places = Some(self.gather.places()).filter(|_| known && self.skips.inner_vertices);
        let (vertices, cost) = reconstruct(self.light(), (&self.links, places), (error, seen), &mut |share| {
            let answer =
                watch(&Progress { phase: Phase::Reconstruct, fraction: 0.9 + 0.1 * share, error, links, nodes });
            stopped |= answer.is_break();
            answer
        });
        self.stats.stopped |= stopped;
        self.stats.vertex_rays += cost.rays;
        self.stats.skipped.unseen_senders += cost.unseen_senders;
        self.stats.skipped.inner_vertices = cost.within;
        self.stats.skipped.unseen_vertices = cost.unseen;
        for (leaf, exitant) in curved {
            self.reflected[leaf as usize] = exitant;
        }
        let faces = faces.with_vertices(&self.elements, &vertices);
        self.stats.seconds.reconstruct += start.elapsed().as_secs_f64();
        Solution {
            scene: self.scene,
            elements: self.elements,
            exitant: self.exitant,
            links: self.links,
            vertices,
            field: self.field,
            incident: self.incident,
            reflected: self.reflected,
            faint: self.faint,
            faces,
            stats: self.stats,
            unfinished: self.unfinished,
        }
    }
}

impl<L: LightField> Solution<L> {
    /// Read access to hierarchy and exitant light.
    #[must_use]
    pub fn light(&self) -> Light<'_, L> {
        Light {
            scene: &self.scene,
            elements: &self.elements,
            exitant: &self.exitant,
            field: &self.field,
            reflected: &self.reflected,
        }
    }

    /// The leaf that a ray hit, on the side that it hit; `None` where that side absorbs everything.
    #[must_use]
    pub fn leaf(&self, hit: &Hit) -> Option<NodeId> {
        self.elements.leaf_at(&self.scene, hit.surface, !hit.front, hit.uv)
    }

    /// Smooth irradiance (W/m²) at a point of a leaf.
    #[must_use]
    pub fn irradiance(&self, leaf: NodeId, uv: Vec2) -> Rgb {
        let corners = self.vertices.interpolation(leaf.0, uv);
        corners.iter().map(|&(vertex, weight)| self.vertices.irradiance[vertex as usize] * weight).sum()
    }

    /// What of [`irradiance`](Self::irradiance) (W/m²) is light that has been reflected before: the rest comes from emitters.
    #[must_use]
    pub fn indirect_irradiance(&self, leaf: NodeId, uv: Vec2) -> Rgb {
        let corners = self.vertices.interpolation(leaf.0, uv);
        corners.iter().map(|&(vertex, weight)| self.vertices.indirect[vertex as usize] * weight).sum()
    }

    /// What the extension makes of all light that arrived at a leaf, as [`reflected`](Self::reflected) keeps it of those whose light
    /// links asked for: found anew by each call. What differs by less than `negligible` (W/(m² sr), ≥ 0) makes no difference; the rest
    /// may have this relative `error` (0…1).
    #[must_use]
    pub fn reflect(&self, leaf: NodeId, negligible: f32, error: f32) -> L::Exitant {
        let irradiance = self.exitant.irradiance[leaf.index()];
        let diffuse = irradiance * self.elements.nodes[leaf.index()].reflectance * FRAC_1_PI;
        let arrived = Arrived { irradiance, diffuse, spread: 0.0, negligible, error, shown: false };
        self.field.reflect(&self.elements, leaf, &self.incident_path(leaf), arrived)
    }

    /// What the extension keeps of the incident light of a leaf and of all its ancestors, the root first.
    #[must_use]
    pub fn incident_path(&self, leaf: NodeId) -> Vec<&L::Incident> {
        let mut path = vec![&self.incident[leaf.index()]];
        let mut node = leaf.0;
        while node != 0 {
            node = self.elements.nodes[node as usize].parent;
            path.push(&self.incident[node as usize]);
        }
        path.reverse();
        path
    }
}

#[cfg(test)]
mod tests {
    use crate::skips::Skips;
    use crate::skips::tests::solve;
    use crate::{DiffuseMaterial, NodeId, Rgb, SceneInput, Shape, Surface};
    use glam::DVec3;
    use std::ops::ControlFlow;

    /// A floor and a wall below a lamp, with a board on the floor, all black, so that all light is direct.
    #[test]
    fn vertices_that_are_seen_gather_the_same_alone() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let quad = |o: DVec3, a: DVec3, b: DVec3| Shape::Quad([o, o + a, o + a + b, o + b]);
        let material = |reflectance, exitance| DiffuseMaterial {
            reflectance: Rgb::splat(reflectance),
            exitance: Rgb::splat(exitance),
            two_sided: true,
        };
        let input = SceneInput {
            surfaces: vec![
                Surface::new(quad(DVec3::ZERO, x, y), 0),
                Surface::new(quad(DVec3::ZERO, y, z), 0),
                Surface::new(quad(x * 0.6, y * 0.5, z * 0.2), 0),
                Surface::new(quad(DVec3::new(0.3, 0.3, 0.9), y * 0.3, x * 0.3), 1),
            ],
            // So little is reflected that nothing is made to agree with anything.
            materials: vec![material(1e-6, 0.0), material(0.0, 1.0)],
            ..SceneInput::default()
        };
        let finished = |seen: &(dyn Fn(NodeId, u32) -> bool + Sync)| {
            let solver = solve(&input, 0.1, (), Skips::ALL);
            let surfaces: Vec<u32> = solver.elements.nodes.iter().map(|element| element.source).collect();
            solver.finish_seen(&|leaf| seen(leaf, surfaces[leaf.index()]), &mut |_| ControlFlow::Continue(()))
        };
        let (all, floor) = (finished(&|_, _| true), finished(&|_, surface| surface == 0));
        let on_floor = |vertex: &usize| floor.light().element(floor.vertices.leaf[*vertex]).source == 0;
        let (seen, unseen): (Vec<usize>, Vec<usize>) = (0..floor.vertices.positions.len()).partition(on_floor);
        for &vertex in &seen {
            let [a, b] = [&all, &floor].map(|solution| solution.vertices.irradiance[vertex]);
            assert!((a - b).abs().max_element() <= 1e-4 * a.max_element(), "vertex {vertex}: {b}, not {a}");
        }
        for &vertex in &unseen {
            let around = floor.vertices.leaves_around(vertex as u32);
            let mean: Rgb = around.iter().map(|&leaf| floor.exitant.irradiance[leaf as usize]).sum::<Rgb>();
            let (mean, light) = (mean / around.len() as f32, floor.vertices.irradiance[vertex]);
            // Of what the board reflects, the lamp, which reflects nothing, keeps nothing.
            let most = 1e-4 * mean.max_element() + 1e-6;
            assert!((light - mean).abs().max_element() <= most, "{light} of elements with {mean}");
        }
        assert_eq!(all.stats.skipped.unseen_vertices, 0);
        assert_eq!(floor.stats.skipped.unseen_vertices as usize, unseen.len(), "each of them is counted");
        assert!(floor.stats.vertex_rays < all.stats.vertex_rays, "and shoots no ray");
    }
}

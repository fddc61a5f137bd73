//! A solution, ready to be walked through.

use crate::at_pixels::AtPixels;
use crate::camera_path::CameraPath;
use crate::display::{DisplayMesh, Walkable};
use crate::facets::{Facets, Roundness, Source, facets};
use crate::glossy::{self, Mode, NARROWEST};
use crate::inside::{Anatomy, Inside};
use crate::metering;
use crate::solved::Solved;
use glam::{DVec3, Vec3};
use glossy_ext::{Incident, Place};
use hr_diffuse::NodeId;
use hr_scene::{Camera, Rgb};
use std::sync::Arc;

/// The scene's own walk, as it is played: so many cameras in so many seconds.
const TOUR_CAMERAS: usize = 120;
const TOUR_SECONDS: f64 = 24.0;

/// A solution as triangles, with the light that follows the eye.
#[derive(Debug)]
pub struct Walkthrough {
    solved: Arc<Solved>,
    mode: Mode,
    mesh: DisplayMesh,
    /// Per entry of the mesh's `glossy`.
    sources: Vec<Source>,
    /// Where each of them is, in unit space.
    places: Vec<Vec3>,
    /// The leaf of each triangle.
    triangles: Vec<u32>,
    /// The leaves around each of them with their shares, each leaf once: those of entry i are at `first[i]..first[i + 1]`.
    leaves: Vec<(u32, f32)>,
    first: Vec<u32>,
}

impl Walkthrough {
    /// Makes the triangles. With [`Mode::Samples`] glossy light is that of the illumination samples, reflected at each
    /// pixel, or at each vertex where a device or a material has no other way; perfect mirrors, which samples cannot show,
    /// keep their distributions.
    #[must_use]
    pub fn new(solved: Arc<Solved>, mode: Mode) -> Self {
        let Facets { mesh, sources, leaves: triangles } = facets(&solved.scene, &solved.solution, Roundness::WALKED);
        let places = sources.iter().map(|source| source.place(&solved.solution)).collect();
        let (mut leaves, mut first) = (Vec::new(), vec![0]);
        let mut around = Vec::new();
        for source in &sources {
            around.clear();
            around.extend(glossy::shares(&solved.solution, &source.corners));
            around.sort_unstable_by_key(|&(leaf, _)| leaf);
            let start = leaves.len();
            for &(leaf, share) in &around {
                match leaves[start..].last_mut() {
                    Some((last, sum)) if *last == leaf => *sum += share,
                    _ => leaves.push((leaf, share)),
                }
            }
            first.push(leaves.len() as u32);
        }
        Self { solved, mode, mesh, sources, places, triangles, leaves, first }
    }

    /// Glossy radiance of a vertex toward an eye in unit space.
    fn radiance(&self, eye: Vec3, slot: usize, scratch: &mut Vec<Incident>) -> Rgb {
        let solution = &self.solved.solution;
        let at = self.places[slot];
        let away = (eye - at).normalize_or_zero();
        let normal = self.mesh.normals[self.mesh.glossy[slot] as usize];
        if self.mode == Mode::Samples {
            let source = &self.sources[slot];
            let surface = solution.elements.nodes[source.leaf as usize].source;
            let material = &self.solved.scene.materials[solution.scene.surface_materials[surface as usize] as usize];
            if material.reflector.mirror() == Rgb::ZERO {
                let color = self.solved.scene.base_color(surface, source.uv.x, source.uv.y);
                let reflector = color
                    .and_then(|color| material.reflector.with_base_color(color))
                    .unwrap_or_else(|| Arc::clone(&material.reflector));
                let place = Place::along(at, normal, reflector.grain());
                let leaf = NodeId(source.leaf);
                return glossy::reflected(solution, reflector.as_ref(), leaf, &place, away, NARROWEST, scratch);
            }
        }
        let leaves = &self.leaves[self.first[slot] as usize..self.first[slot + 1] as usize];
        glossy::blended(solution, leaves.iter().copied(), (at, normal), away)
    }
}

impl Walkthrough {
    /// Base colour of each vertex where it varies, without the texture; empty where none does.
    fn colors(&self) -> Vec<Rgb> {
        let Solved { scene, solution } = &*self.solved;
        let mut colors = Vec::new();
        for (&vertex, source) in self.mesh.glossy.iter().zip(&self.sources) {
            let element = &solution.elements.nodes[source.leaf as usize];
            let Some(attributes) = scene.attributes_of(element.source) else { continue };
            colors.resize(self.mesh.positions.len(), Rgb::ONE);
            let shape = &scene.surfaces[element.source as usize].shape;
            let factor = scene.materials[element.material as usize].base_color;
            colors[vertex as usize] = factor * attributes.color_at(shape, source.uv.x, source.uv.y);
        }
        colors
    }
}

impl Walkable for Walkthrough {
    fn name(&self) -> &str {
        &self.solved.scene.name
    }

    fn mesh(&self) -> &DisplayMesh {
        &self.mesh
    }

    fn extent(&self) -> f64 {
        self.solved.scene.extent()
    }

    fn cameras(&self) -> &[(String, Camera)] {
        &self.solved.scene.cameras
    }

    fn tour(&self) -> CameraPath {
        CameraPath::through(&self.solved.scene.walkthrough(TOUR_CAMERAS), TOUR_SECONDS)
    }

    fn inside(&self) -> Option<Box<dyn Inside + '_>> {
        Some(Box::new(Anatomy { solved: &self.solved, origin: self.mesh.origin }))
    }

    fn exposure(&self, camera: &Camera) -> Option<f32> {
        metering::exposure(&self.solved, self.mode, &[*camera])
    }

    fn prefers_pixels(&self) -> bool {
        self.mode == Mode::Samples
    }

    fn at_pixels(&self, most: u64) -> Option<AtPixels> {
        Some(AtPixels::new(&self.solved, self.mesh.origin, &self.triangles, self.colors(), most))
    }

    fn glossy_radiance(&self, eye: DVec3, vertices: &[u32], out: &mut [Rgb]) {
        let eye = self.solved.solution.scene.normalization.to_unit(eye);
        let mut scratch = Vec::new();
        for (out, &slot) in out.iter_mut().zip(vertices) {
            *out = self.radiance(eye, slot as usize, &mut scratch).max(Rgb::ZERO);
        }
    }
}

//! What the light of the built-in scene `glossy-sphere` comes to: by the other engine, and by ours.

use crate::engine::Engine;
use glam::{DVec3, Vec2, Vec3};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{LightField, Settings, Solution, SolveError, Solver};
use hr_scene::Scene;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Blocks along each side of the ceiling.
pub(crate) const BLOCKS: usize = 3;
/// Points along each side of a block.
const POINTS: usize = 16;

/// Light of one channel: lamp, ceiling and floor of the scene are grey.
#[derive(Debug)]
pub(crate) struct Answer {
    /// Irradiance of each block of the ceiling, W/m²: most of it has been reflected by glossy surfaces.
    pub(crate) ceiling: Vec<f32>,
    /// Glossy intensity of the floor toward each camera over its area, W/(m² sr). The sphere's is not compared: its highlight
    /// is smaller than elements, which have one distribution each, that of their middle.
    pub(crate) floor: Vec<f32>,
}

/// Materials of the scene by index.
const FLOOR: usize = 0;
const CEILING: usize = 1;

/// Places that a scene is looked at from.
fn eyes(scene: &Scene) -> impl Iterator<Item = Vec3> {
    scene.cameras.iter().map(|(_, camera)| DVec3::from(camera.eye).as_vec3())
}

impl Answer {
    /// That of the other engine.
    pub(crate) fn of_engine(scene: &Scene, engine: &Engine) -> Self {
        let with = |material: usize| {
            engine.patches.iter().enumerate().filter(move |(_, patch)| patch.paint == material).map(|(i, _)| i)
        };
        let (mut power, mut area) = (vec![0.0; BLOCKS * BLOCKS], vec![0.0; BLOCKS * BLOCKS]);
        let sides = with(CEILING).count().isqrt();
        for (k, patch) in with(CEILING).enumerate() {
            let block = (k / sides) * BLOCKS / sides * BLOCKS + (k % sides) * BLOCKS / sides;
            let patch = &engine.patches[patch];
            power[block] += patch.irradiance.y * patch.area;
            area[block] += patch.area;
        }
        let patches: Vec<_> = with(FLOOR).collect();
        let floor: Vec<_> =
            patches.into_par_iter().map(|patch| engine.glossy.leaving(&engine.patches, patch)).collect();
        let toward = |eye: Vec3| {
            mean(with(FLOOR).zip(&floor).map(|(patch, light)| {
                let patch = &engine.patches[patch];
                let away = (eye - patch.center).normalize();
                (engine.glossy.field.radiance(light, away).y * away.dot(patch.normal), patch.area)
            }))
        };
        let ceiling = power.iter().zip(area).map(|(power, area)| power / area).collect();
        Self { ceiling, floor: eyes(scene).map(toward).collect() }
    }

    /// That of our solver, for an error asked for.
    pub(crate) fn of_solver(scene: &Arc<Scene>, error: f32) -> Result<Self, SolveError> {
        let field = GlossyField::new(&scene.reflectors(), Refinement::default());
        let mut solver = Solver::new(&scene.input(), Settings::with_error(error), field)?;
        solver.solve(&mut |_| ControlFlow::Continue(()));
        solver.reflect_for_display(&mut |_| ControlFlow::Continue(()));
        let solution = solver.finish(&mut |_| ControlFlow::Continue(()));
        let along = BLOCKS * POINTS;
        let mut ceiling = vec![0.0; BLOCKS * BLOCKS];
        for point in 0..along * along {
            let (i, j) = (point % along, point / along);
            let uv = (Vec2::new(i as f32, j as f32) + 0.5) / along as f32;
            let leaf = solution.elements.leaf_at(&solution.scene, CEILING as u32, false, uv);
            let irradiance = leaf.map_or(Vec3::ZERO, |leaf| solution.irradiance(leaf, uv));
            ceiling[j / POINTS * BLOCKS + i / POINTS] += irradiance.y / (POINTS * POINTS) as f32;
        }
        let floor = eyes(scene).map(|eye| toward(&solution, FLOOR, eye)).collect();
        Ok(Self { ceiling, floor })
    }

    /// Mean irradiance of the ceiling.
    pub(crate) fn mean(&self) -> f32 {
        self.ceiling.iter().sum::<f32>() / self.ceiling.len() as f32
    }

    /// Relative difference of the two on the ceiling: the sum over all blocks of that of each, over the sum of light.
    pub(crate) fn ceilings_differ(&self, other: &Self) -> f32 {
        let differences = self.ceiling.iter().zip(&other.ceiling).map(|(a, b)| (a - b).abs());
        differences.sum::<f32>() / other.ceiling.iter().sum::<f32>()
    }
}

/// Glossy intensity of one of our flat surfaces toward an eye over its area.
fn toward(solution: &Solution<GlossyField>, surface: usize, eye: Vec3) -> f32 {
    let eye = solution.scene.normalization.to_unit(eye.as_dvec3());
    let leaves = solution.elements.patch_leaves().map(|leaf| (leaf, &solution.elements.nodes[leaf as usize]));
    mean(leaves.filter(|(_, element)| element.source == surface as u32).map(|(leaf, element)| {
        let away = (eye - element.center).normalize();
        let light = solution.field.radiance(&solution.reflected[leaf as usize], away).y;
        (light * away.dot(element.normals.axis), element.area)
    }))
}

/// The mean of values with weights.
fn mean(values: impl Iterator<Item = (f32, f32)>) -> f32 {
    let (sum, weight) = values.fold((0.0, 0.0), |(sum, all), (value, weight)| (sum + value * weight, all + weight));
    sum / weight
}

//! The glossy leaves of a solution, to be reflected once more in different ways.

use crate::BenchError;
use crate::measure::cpu_seconds;
use glam::{Vec2, Vec3};
use glossy_ext::haar::Refinement;
use glossy_ext::samples::SampleSet;
use glossy_ext::{GlossyField, Reflection, Reflector};
use hr_diffuse::{Arrived, LightField, NodeId, Rgb, SceneInput, Settings, Solution, Solver};
use std::f32::consts::FRAC_1_PI;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Solves a scene by illumination samples.
pub(super) fn solve(
    input: &SceneInput,
    reflectors: &[Arc<dyn Reflector>],
    error: f32,
) -> Result<Solution<GlossyField>, BenchError> {
    let field = GlossyField::new(reflectors, Refinement::default());
    let mut solver = Solver::new(input, Settings::with_error(error), field)?;
    solver.solve(&mut |_| ControlFlow::Continue(()));
    Ok(solver.finish(&mut |_| ControlFlow::Break(())))
}

/// A leaf, and what it is asked to reflect.
pub(super) struct Leaf<'a> {
    node: NodeId,
    path: Vec<&'a SampleSet>,
    arrived: Arrived,
}

/// Every `step`th of the leaves that take part.
pub(super) fn glossy_leaves(solution: &Solution<GlossyField>, step: usize) -> Vec<Leaf<'_>> {
    let nodes = &solution.elements.nodes;
    let active = solution.elements.patch_leaves().filter(|&leaf| nodes[leaf as usize].active);
    active
        .step_by(step)
        .map(|leaf| {
            let irradiance = solution.exitant.irradiance[leaf as usize];
            let diffuse = irradiance * nodes[leaf as usize].reflectance * FRAC_1_PI;
            let path = solution.incident_path(NodeId(leaf));
            Leaf {
                node: NodeId(leaf),
                path,
                arrived: Arrived { irradiance, diffuse, spread: 0.0, negligible: 0.0, error: 0.1, shown: false },
            }
        })
        .collect()
}

/// What all leaves reflect, and the processor seconds that took: the fewest of several attempts.
pub(super) fn reflect<L: LightField<Incident = SampleSet>>(
    field: &L,
    solution: &Solution<GlossyField>,
    leaves: &[Leaf<'_>],
    attempts: u32,
) -> (Vec<L::Exitant>, f64) {
    let mut fewest = f64::INFINITY;
    let mut exitant = Vec::new();
    for _ in 0..attempts {
        let start = cpu_seconds();
        exitant = leaves.iter().map(|l| field.reflect(&solution.elements, l.node, &l.path, l.arrived)).collect();
        fewest = fewest.min(cpu_seconds() - start);
    }
    (exitant, fewest)
}

/// Mean distance of what leaves send from what they reflect, relative to its mean, weighted by the cosine.
pub(super) fn distance(
    solution: &Solution<GlossyField>,
    leaves: &[Leaf<'_>],
    sent: impl Fn(usize, Vec3) -> Rgb,
) -> f64 {
    let (mut off, mut total) = (0.0, 0.0);
    for (index, leaf) in leaves.iter().enumerate() {
        let Some(reflection) = solution.field.reflection(&solution.elements, leaf.node, &leaf.path, leaf.arrived)
        else {
            continue;
        };
        for (direction, cosine) in hemisphere(&reflection) {
            let right = reflection.toward(direction);
            off += f64::from((sent(index, direction) - right).abs().element_sum() * cosine);
            total += f64::from(right.abs().element_sum() * cosine);
        }
    }
    if total > 0.0 { off / total } else { 0.0 }
}

/// Directions that a leaf's light is compared in.
const DIRECTIONS: usize = 3000;

/// Directions spread evenly over the hemisphere above a leaf, and their cosines.
fn hemisphere(reflection: &Reflection<'_>) -> impl Iterator<Item = (Vec3, f32)> {
    let frame = reflection.place().frame;
    (0..DIRECTIONS).map(move |i| {
        // Points of a spiral: the golden angle apart, evenly in height.
        let z = (i as f32 + 0.5) / DIRECTIONS as f32;
        let turn = Vec2::from_angle(i as f32 * 2.399_963_2) * (1.0 - z * z).sqrt();
        (frame * turn.extend(z), z)
    })
}

//! Edits against fresh solves: what they take, and how far their light is from that of a solve of the scene as it is then.
//!
//! The difference is that of the mean irradiances of surface sides, Σ area |E − E'| / Σ area E'. What moves is the first set of surfaces that share corners which is neither large nor a lamp, and the first such set that is a lamp.

use crate::BenchError;
use crate::args::EditsArgs;
use crate::curve::distance;
use crate::measure::cpu_seconds;
use crate::run::{Out, say};
use glam::DVec3;
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{Rgb, SceneInput, Settings, Shape, Solver, Surface};
use hr_scene::{Scene, builtin};
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Things that are moved are no larger than this share of the scene, and move by so much of it.
const LARGE: f64 = 0.5;
const STEP: f64 = 0.05;

/// A solver, and what it has taken so far.
struct Run {
    solver: Solver<GlossyField>,
    cpu: f64,
    rays: u64,
}

/// Prints a Markdown table.
///
/// # Errors
/// Where a scene cannot be solved or the system gives no threads.
pub fn report(args: &EditsArgs, out: Out<'_>) -> Result<(), BenchError> {
    let all = builtin::NAMES.map(String::from);
    let names = if args.scenes.is_empty() { &all } else { args.scenes.as_slice() };
    say(out, "| scene | edit | links renewed | rays | rays, fresh | CPU s | CPU s, fresh | difference over error |")?;
    say(out, "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |")?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| BenchError::Threads(error.to_string()))?;
    for name in names {
        let scene = Arc::new(Scene::load(name)?);
        for (edit, input) in edits(&scene.input()) {
            let run = || -> Result<String, BenchError> {
                let fresh = solved(&scene, &input, args.error)?;
                let mut run = solved(&scene, &scene.input(), args.error)?;
                let before = (cpu_seconds(), run.solver.stats().rays);
                run.solver.rearrange(&input, &mut |_| ControlFlow::Continue(()))?;
                let stats = run.solver.stats();
                let renewed = 100.0 * stats.renewed_links as f64 / (stats.renewed_links + stats.kept_links) as f64;
                let off = distance(&sides(&run.solver), &sides(&fresh.solver)) / f64::from(args.error);
                Ok(format!(
                    "| {} | {edit} | {renewed:.1} % | {} | {} | {:.3} | {:.3} | {off:.3} |",
                    scene.name,
                    stats.rays - before.1,
                    fresh.rays,
                    cpu_seconds() - before.0,
                    fresh.cpu
                ))
            };
            let row = pool.install(run)?;
            say(out, &row)?;
        }
    }
    Ok(())
}

/// Solves without values at vertices.
fn solved(scene: &Arc<Scene>, input: &SceneInput, error: f32) -> Result<Run, BenchError> {
    let before = cpu_seconds();
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    let mut solver = Solver::new(input, Settings::with_error(error), field)?;
    solver.solve(&mut |_| ControlFlow::Continue(()));
    let rays = solver.stats().rays;
    Ok(Run { solver, cpu: cpu_seconds() - before, rays })
}

/// Area and mean irradiance of all sides of surfaces, those without elements as dark ones.
fn sides(solver: &Solver<GlossyField>) -> Vec<(f64, Rgb)> {
    let elements = solver.elements();
    let side = |&node: &u32| match elements.nodes.get(node as usize) {
        Some(element) => (f64::from(element.area), solver.exitant().irradiance[node as usize]),
        None => (0.0, Rgb::ZERO),
    };
    elements.surface_nodes.as_flattened().iter().map(side).collect()
}

/// Names of edits, and the scene after each.
fn edits(input: &SceneInput) -> Vec<(&'static str, SceneInput)> {
    let emits = |surface: &Surface| input.materials[surface.material as usize].exitance != Rgb::ZERO;
    let all = bounds(input.surfaces.iter());
    let size = (all[1] - all[0]).max_element();
    let is_small = |thing: &&Vec<usize>| {
        let [low, high] = bounds(thing.iter().map(|&surface| &input.surfaces[surface]));
        (high - low).max_element() < LARGE * size
    };
    let things = things(&input.surfaces);
    let mut edits = Vec::new();
    // Toward the middle of the scene, along the floor or the ceiling.
    let step = |from: DVec3| {
        let to = (0.5 * (all[0] + all[1]) - from) * least_out(all);
        to.try_normalize().unwrap_or(DVec3::X) * (STEP * size)
    };
    for (name, lamp) in [("moved object", false), ("moved lamp", true)] {
        let found =
            things.iter().filter(is_small).find(|thing| thing.iter().any(|&s| emits(&input.surfaces[s])) == lamp);
        let mut moved = input.clone();
        if let Some(thing) = found {
            let [low, high] = bounds(thing.iter().map(|&surface| &input.surfaces[surface]));
            let by = step(0.5 * (low + high));
            thing.iter().for_each(|&surface| shift(&mut moved.surfaces[surface].shape, by));
        } else if let Some(light) = moved.lights.first_mut().filter(|_| lamp) {
            light.position += step(light.position);
        } else {
            continue;
        }
        edits.push((name, moved));
    }
    edits
}

/// 0 along the axis along which the scene is lowest, where things stand, and 1 along the others.
fn least_out([low, high]: [DVec3; 2]) -> DVec3 {
    let size = high - low;
    let least = size.min_element();
    let mut kept = DVec3::ONE;
    let axis = (0..3).find(|&axis| size[axis] <= least).unwrap_or(2);
    kept[axis] = 0.0;
    kept
}

/// Surfaces that share corners, as sets in order of their first ones.
fn things(surfaces: &[Surface]) -> Vec<Vec<usize>> {
    let mut first: Vec<usize> = (0..surfaces.len()).collect();
    fn root(first: &mut [usize], mut of: usize) -> usize {
        while first[of] != of {
            first[of] = first[first[of]];
            of = first[of];
        }
        of
    }
    let mut owner: HashMap<[u64; 3], usize> = HashMap::new();
    for (surface, of) in surfaces.iter().enumerate() {
        for corner in corners(&of.shape) {
            let other = *owner.entry(corner.to_array().map(f64::to_bits)).or_insert(surface);
            let (a, b) = (root(&mut first, surface), root(&mut first, other));
            first[a.max(b)] = a.min(b);
        }
    }
    let mut sets: Vec<Vec<usize>> = vec![Vec::new(); surfaces.len()];
    for surface in 0..surfaces.len() {
        sets[root(&mut first, surface)].push(surface);
    }
    sets.retain(|set| !set.is_empty());
    sets
}

/// Corners of polygons, by which they hang together.
fn corners(shape: &Shape) -> &[DVec3] {
    match shape {
        Shape::Triangle(corners) => corners,
        Shape::Quad(corners) => corners,
        _ => &[],
    }
}

fn bounds<'a>(surfaces: impl Iterator<Item = &'a Surface>) -> [DVec3; 2] {
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let mut add = |at: DVec3, reach: f64| {
        bounds = [bounds[0].min(at - reach), bounds[1].max(at + reach)];
    };
    for surface in surfaces {
        match &surface.shape {
            Shape::Sphere { center, radius } => add(*center, *radius),
            Shape::Cone { ends, radii } => ends.iter().zip(radii).for_each(|(end, radius)| add(*end, *radius)),
            Shape::Ring { center, outer, .. } => add(*center, *outer),
            Shape::Torus { center, major, minor, .. } => add(*center, major + minor),
            polygon => corners(polygon).iter().for_each(|corner| add(*corner, 0.0)),
        }
    }
    bounds
}

fn shift(shape: &mut Shape, by: DVec3) {
    match shape {
        Shape::Triangle(corners) => corners.iter_mut().for_each(|corner| *corner += by),
        Shape::Quad(corners) => corners.iter_mut().for_each(|corner| *corner += by),
        Shape::Cone { ends, .. } => ends.iter_mut().for_each(|end| *end += by),
        Shape::Sphere { center, .. } | Shape::Ring { center, .. } | Shape::Torus { center, .. } => *center += by,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_measured_and_right() {
        let args = EditsArgs { scenes: vec!["cornell".into()], error: 0.3 };
        let mut said = Vec::new();
        report(&args, &mut said).expect("sound");
        let said = String::from_utf8(said).expect("text");
        let rows: Vec<Vec<&str>> = said.lines().skip(2).map(|line| line.split('|').map(str::trim).collect()).collect();
        assert_eq!(rows.len(), 2, "an object and a lamp: {said}");
        for row in rows {
            assert_eq!(row.len(), 10, "as many columns everywhere: {said}");
            let difference: f64 = row[8].parse().expect("a number");
            assert!(difference < 1.0, "the same answer: {said}");
        }
    }
}

//! Edits against fresh solves: what they take, and how far their light is from that of a solve of the scene as it is then.
//!
//! The difference is that of the mean irradiances of surface sides, Σ area |E − E'| / Σ area E'. Every other lamp is dimmed to half, by light
//! that settles anew and as a mixture of lamps; all lamps get another colour, diffuse surfaces other paint, the glossy material that most
//! surfaces have √2 times the roughness. What moves is the first set of surfaces that share corners which is neither large nor a lamp,
//! and the first such set that is a lamp.

mod kinds;

use crate::BenchError;
use crate::args::EditsArgs;
use crate::curve::distance;
use crate::measure::cpu_seconds;
use crate::run::{Out, say};
use glossy_ext::haar::Refinement;
use glossy_ext::{GlossyField, Reflector};
use hr_diffuse::{Rgb, SceneInput, Settings, Solver};
use hr_scene::{Scene, builtin};
use kinds::{Edit, How, dimmed, edits};
use std::ops::ControlFlow;
use std::sync::Arc;

/// A solver, and what it has taken to solve.
struct Run {
    solver: Solver<GlossyField>,
    cost: Cost,
}

/// Seconds of processor time, and rays.
#[derive(Clone, Copy)]
struct Cost {
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
        let asked =
            |edit: &Edit| args.only.is_empty() || args.only.iter().any(|name| edit.name.ends_with(name.as_str()));
        for edit in edits(&scene).into_iter().filter(asked) {
            let run = || -> Result<String, BenchError> {
                let reflectors = edit.reflectors.clone().unwrap_or_else(|| scene.reflectors());
                let fresh = solved(&edit.input, &reflectors, args.error)?;
                let mut run = solved(&scene.input(), &scene.reflectors(), args.error)?;
                let cost = run.take(&edit)?;
                let stats = run.solver.stats();
                let (renewed, kept) =
                    if edit.how == How::Rearrange { (stats.renewed_links, stats.kept_links) } else { (0, stats.links) };
                let renewed = 100.0 * renewed as f64 / (renewed + kept) as f64;
                let off = distance(&sides(&run.solver), &sides(&fresh.solver)) / f64::from(args.error);
                Ok(format!(
                    "| {} | {} | {renewed:.1} % | {} | {} | {:.3} | {:.3} | {off:.3} |",
                    scene.name, edit.name, cost.rays, fresh.cost.rays, cost.cpu, fresh.cost.cpu
                ))
            };
            let row = pool.install(run)?;
            say(out, &row)?;
        }
    }
    Ok(())
}

impl Run {
    /// Takes over an edit by what it needs and no more. The light of each lamp is no part of what it costs to mix them.
    fn take(&mut self, edit: &Edit) -> Result<Cost, BenchError> {
        let (solver, watch) = (&mut self.solver, &mut |_: &_| ControlFlow::Continue(()));
        let lamps = solver.lamps();
        let variants = if edit.how == How::Mix { Some(solver.each_lamp(&lamps, watch)?) } else { None };
        let colors: Vec<Rgb> = (0..lamps.len()).map(dimmed).collect();
        let field = edit.reflectors.as_ref().map(|reflectors| GlossyField::new(reflectors, Refinement::default()));
        let (cpu, rays) = (cpu_seconds(), solver.stats().rays);
        match (edit.how, variants) {
            (How::Rearrange, _) => solver.rearrange(&edit.input, watch)?,
            (How::EachLamp, _) => drop(solver.each_lamp(&lamps, watch)?),
            (How::Mix, Some(variants)) => solver.mix(&variants, &colors, watch)?,
            _ => solver.relight(&edit.input, field, watch)?,
        }
        Ok(Cost { cpu: cpu_seconds() - cpu, rays: solver.stats().rays - rays })
    }
}

/// Solves without values at vertices.
fn solved(input: &SceneInput, reflectors: &[Arc<dyn Reflector>], error: f32) -> Result<Run, BenchError> {
    let before = cpu_seconds();
    let field = GlossyField::new(reflectors, Refinement::default());
    let mut solver = Solver::new(input, Settings::with_error(error), field)?;
    solver.solve(&mut |_| ControlFlow::Continue(()));
    let rays = solver.stats().rays;
    Ok(Run { solver, cost: Cost { cpu: cpu_seconds() - before, rays } })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::EDITS;

    #[test]
    fn edits_are_measured_and_right() {
        let args = EditsArgs { scenes: vec!["cornell".into()], error: 0.3, only: Vec::new() };
        let mut said = Vec::new();
        report(&args, &mut said).expect("sound");
        let said = String::from_utf8(said).expect("text");
        let rows: Vec<Vec<&str>> = said.lines().skip(2).map(|line| line.split('|').map(str::trim).collect()).collect();
        assert_eq!(rows.len(), 7, "light, paint, an object and a lamp: {said}");
        for row in rows {
            assert_eq!(row.len(), 10, "as many columns everywhere: {said}");
            assert!(EDITS.iter().any(|name| row[2].ends_with(name)), "it can be asked for alone: {said}");
            let difference: f64 = row[8].parse().expect("a number");
            assert!(difference < 1.0, "the same answer: {said}");
        }
    }
}

//! Space and direction together: memory over the error of what distributions show, where directions are refined by themselves and where
//! they are as fine as links in space warrant.

use crate::BenchError;
use crate::args::TogetherArgs;
use crate::compare::compare;
use crate::run::{Out, say};
use crate::views::{Subject, listed};
use glossy_ext::GlossyField;
use glossy_ext::haar::{Refinement, Refiner};
use hr_diffuse::{Settings, Solver};
use hr_view::Mode;
use hr_view::raycast::RayCaster;
use std::ops::ControlFlow;

/// Settings of directions by themselves: what interpolation may be wrong by, relative to the distribution, and the finest level.
const ALONE: [(f32, u8); 5] = [(0.3, 4), (0.3, 6), (0.1, 5), (0.1, 6), (0.05, 6)];

/// One solution.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    /// Relative error asked for.
    asked: f32,
    /// Bytes of all that is kept, and of its distributions, as they are shown.
    bytes: [u64; 2],
    /// Mean block L1 of the pictures of a scene's views.
    block: f64,
}

/// Prints a Markdown table for each scene: every way of refining directions at every error, and how many times as much memory it takes
/// as both together at equal error.
///
/// # Errors
/// Where references cannot be read, a scene cannot be solved, or nothing can be printed.
pub fn report(args: &TogetherArgs, out: Out<'_>) -> Result<(), BenchError> {
    let wanted = |name: &str| args.scenes.is_empty() || args.scenes.iter().any(|scene| scene == name);
    for subject in listed(&args.reference, wanted, out)? {
        if subject.scene.reflectors().iter().all(|reflector| reflector.is_diffuse()) {
            continue;
        }
        say(out, &format!("\n{}\n", subject.scene.name))?;
        let heads =
            "| directions | error asked | block L1 | distributions | all | all, of both together at that error |";
        say(out, heads)?;
        say(out, "| --- | ---: | ---: | ---: | ---: | ---: |")?;
        let curve = |refinement: Option<(f32, u8)>| -> Result<Vec<Point>, BenchError> {
            args.error.iter().map(|&error| solve(&subject, refinement, error)).collect()
        };
        let together = curve(None)?;
        for point in &together {
            say(out, &row("with space", point, None))?;
        }
        for (epsilon, level) in ALONE {
            for point in curve(Some((epsilon, level)))? {
                let name = format!("alone, ε = {epsilon}, level {level}");
                say(out, &row(&name, &point, at_error(&together, point.block)))?;
            }
        }
    }
    Ok(())
}

fn row(name: &str, point: &Point, together: Option<f64>) -> String {
    let megabytes = |bytes: f64| format!("{:.2} MB", bytes / 1e6);
    let [all, distributions] = point.bytes.map(|bytes| bytes as f64);
    let ratio = together.map(|bytes| format!("{} (1 : {:.2})", megabytes(bytes), all / bytes)).unwrap_or_default();
    let Point { asked, block, .. } = point;
    format!(
        "| {name} | {asked} | {:.2} % | {} | {} | {ratio} |",
        100.0 * block,
        megabytes(distributions),
        megabytes(all)
    )
}

/// Bytes of all at an error, by a curve: between two solutions of it in proportion in logarithms; where it is always finer, those of
/// its coarsest. None where it is never as fine.
fn at_error(curve: &[Point], block: f64) -> Option<f64> {
    let bytes = |point: &Point| point.bytes[0] as f64;
    let as_fine = curve.iter().filter(|point| point.block <= block);
    let fine = as_fine.min_by(|a, b| bytes(a).total_cmp(&bytes(b)))?;
    let coarser = curve.iter().filter(|point| point.block > block && bytes(point) < bytes(fine));
    let Some(coarse) = coarser.min_by(|a, b| a.block.total_cmp(&b.block)) else { return Some(bytes(fine)) };
    let share = (coarse.block / block).ln() / (coarse.block / fine.block).ln();
    Some(bytes(coarse) * (bytes(fine) / bytes(coarse)).powf(share))
}

/// Solves a scene, with directions refined by themselves or together with space, and looks at what its distributions show.
fn solve(subject: &Subject, alone: Option<(f32, u8)>, error: f32) -> Result<Point, BenchError> {
    let scene = &subject.scene;
    let field = match alone {
        Some((epsilon, max_level)) => {
            let refiner = Refiner::Interpolation(epsilon);
            let refinement = Refinement { max_level, refiner, ..Refinement::default() };
            GlossyField::new(&scene.reflectors(), refinement).refined_alone()
        }
        None => GlossyField::new(&scene.reflectors(), Refinement::default()),
    };
    let going_on = &mut |_: &_| ControlFlow::Continue(());
    let mut solver = Solver::new(&scene.input(), Settings::with_error(error), field)?;
    solver.solve(going_on);
    solver.reflect_for_display(going_on);
    let solution = solver.finish(going_on);
    let distributions: usize = solution.reflected.iter().map(|light| light.bytes()).sum();
    let empty = size_of_val(&*solution.reflected);
    let samples: usize = solution.incident.iter().map(|set| size_of_val(&**set)).sum();
    let links = size_of_val(solution.links.all());
    let elements = size_of_val(&*solution.elements.nodes);
    let all = (distributions + empty + samples + links + elements) as u64;
    let mut sum = 0.0;
    for view in &subject.views {
        let image = RayCaster::new(scene, &solution, Mode::Distributions).with_grid(2).render(&view.camera, &|_| ());
        sum += compare(&image, &view.reference, view.sigma.as_ref(), |i, _| view.keep[i])?.block_l1;
    }
    Ok(Point { asked: error, bytes: [all, distributions as u64], block: sum / subject.views.len() as f64 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::views::View;
    use hr_scene::{Camera, Scene};
    use std::sync::Arc;

    fn point(block: f64, bytes: u64) -> Point {
        Point { asked: 0.1, bytes: [bytes, bytes / 2], block }
    }

    #[test]
    fn curves_are_read_at_an_error() {
        let curve = [point(0.08, 100), point(0.04, 400)];
        let near = |found: Option<f64>, right: f64| found.is_some_and(|found| (found / right - 1.0).abs() < 1e-6);
        assert!(near(at_error(&curve, 0.08), 100.0) && near(at_error(&curve, 0.04), 400.0), "at its points");
        assert!(near(at_error(&curve, 0.0032_f64.sqrt()), 200.0), "half way between");
        assert!(near(at_error(&curve, 0.2), 100.0), "it is never as coarse");
        assert_eq!(at_error(&curve, 0.03), None, "it is never as fine");
    }

    /// Directions that follow space take less, and show what those show that do not.
    #[test]
    fn together_takes_less_memory_at_no_more_error() {
        let scene = Arc::new(Scene::load("glossy-sphere").expect("built in"));
        let camera = Camera { width: 80, height: 60, ..scene.default_camera() };
        let exact = GlossyField::new(&scene.reflectors(), Refinement::default()).refined_alone();
        let mut solver = Solver::new(&scene.input(), Settings::with_error(0.1), exact).expect("sound");
        let going_on = &mut |_: &_| ControlFlow::Continue(());
        solver.solve(going_on);
        solver.reflect_for_display(going_on);
        let solution = solver.finish(going_on);
        let reference = RayCaster::new(&scene, &solution, Mode::Distributions).with_grid(2).render(&camera, &|_| ());
        let keep = vec![true; reference.pixels.len()];
        let view = View { name: "front".into(), camera, reference, sigma: None, keep };
        let subject = Subject { scene, views: vec![view] };
        let together = solve(&subject, None, 0.1).expect("sound");
        let alone = solve(&subject, Some((0.1, 6)), 0.1).expect("sound");
        assert!(alone.block < 1e-6, "it is the reference: {alone:?}");
        assert!(together.block < 0.03, "{together:?}");
        assert!(2 * together.bytes[1] < alone.bytes[1], "{together:?}, {alone:?}");
        assert!(3 * together.bytes[0] < 2 * alone.bytes[0], "{together:?}, {alone:?}");
    }
}

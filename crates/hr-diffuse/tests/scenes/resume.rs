//! A solve that goes on after a stop ends at the answer of one that was not stopped.

use crate::fixtures::{lamp, on, paint, quad, restored, stored, table, walls};
use glam::DVec3;
use hr_diffuse::{Budget, Rgb, SceneInput, Settings, Shape, Solution, SolveError, Solver, Surface};
use std::ops::ControlFlow;

/// The error that is asked for.
const ERROR: f32 = 0.02;

/// A room with a table and a ball, and a lamp that shines at the ceiling: all else is dark at first.
fn room() -> SceneInput {
    let ball = Shape::Sphere { center: DVec3::new(3.0, 2.0, 0.5), radius: 0.4 };
    let mut surfaces = walls(1, 1, 0);
    surfaces.push(table(1));
    surfaces.push(Surface::new(ball, 0));
    surfaces.push(quad(DVec3::new(0.5, 0.5, 1.8), DVec3::X * 0.4, DVec3::Y * 0.4, 2));
    let materials = vec![paint(Rgb::splat(0.7)), paint(Rgb::splat(0.4)), lamp(Rgb::splat(100.0))];
    SceneInput { surfaces, materials, ..SceneInput::default() }
}

/// Solves for an error, and breaks after so many calls of the closure.
fn finished(mut solver: Solver, calls: usize) -> Solution {
    let mut left = calls;
    solver.solve(&mut |_| {
        left = left.saturating_sub(1);
        if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    solver.finish(&mut on)
}

fn new(error: f32) -> Solver {
    Solver::new(&room(), Settings::with_error(error), ()).expect("the room is sound")
}

fn go_on(solution: Solution, error: f32) -> Solution {
    finished(Solver::resume(solution, Settings::with_error(error)).expect("an error that can be met"), usize::MAX)
}

/// Relative difference of the mean irradiances of all surfaces, by area.
fn difference(a: &Solution, b: &Solution) -> f32 {
    let (mut apart, mut all) = (0.0, 0.0);
    for (p, q) in a.elements.surface_nodes.iter().zip(&b.elements.surface_nodes) {
        let area = a.elements.nodes[p[0] as usize].area;
        let (one, other) = (a.exitant.irradiance[p[0] as usize], b.exitant.irradiance[q[0] as usize]);
        apart += (one - other).abs().element_sum() * area;
        all += other.element_sum() * area;
    }
    apart / all
}

#[test]
fn stopped_solves_go_on_to_the_same_answer() {
    let whole = finished(new(ERROR), usize::MAX);
    let mut calls = 0;
    new(ERROR).solve(&mut |_| {
        calls += 1;
        ControlFlow::Continue(())
    });
    for share in [0.0, 0.1, 0.3, 0.6, 0.9] {
        let stopped = finished(new(ERROR), 1 + (share * calls as f64) as usize);
        assert!(stopped.stats.stopped, "{share}: it was stopped");
        let resumed = go_on(stopped, ERROR);
        assert!(!resumed.stats.stopped, "{share}: it has come to its end");
        let off = difference(&resumed, &whole);
        // Each is off by what was asked for at most, as rays have found.
        let found = resumed.stats.error.expect("rays have looked");
        assert!(found < ERROR && off < ERROR, "{share}: off by {off}, {found} by rays");
    }
}

#[test]
fn solutions_become_finer_and_are_left_alone_when_they_are_fine() {
    let fine = finished(new(ERROR), usize::MAX);
    let refined = go_on(finished(new(5.0 * ERROR), usize::MAX), ERROR);
    let off = difference(&refined, &fine);
    assert!(off < ERROR, "off by {off}");
    let (rays, irradiance) = (fine.stats.rays, fine.exitant.irradiance.clone());
    let again = go_on(fine, 2.0 * ERROR);
    assert_eq!(again.stats.rays, rays, "nothing is left to be done");
    assert_eq!(again.exitant.irradiance, irradiance, "nor has anything changed");
    let wrong = Solver::resume(again, Settings::with_error(0.0)).map(|_| ());
    assert_eq!(wrong, Err(SolveError::Error { error: 0.0 }), "an error out of range");
}

#[test]
fn spent_budgets_are_no_end() {
    let whole = finished(new(ERROR), usize::MAX);
    let settings = Settings { budget: Budget { time: None, memory: Some(300_000) }, ..Settings::with_error(ERROR) };
    let poor = finished(Solver::new(&room(), settings, ()).expect("the room is sound"), usize::MAX);
    assert!(poor.stats.spent.is_some() && poor.links.all().len() < whole.links.all().len() / 2, "it was spent");
    let rich = go_on(poor, ERROR);
    let off = difference(&rich, &whole);
    // Each is off by what was asked for at most, as rays have found: two may be as far apart.
    assert!(rich.stats.spent.is_none() && off < ERROR, "off by {off}");
}

#[test]
fn what_is_kept_goes_on_as_if_it_had_never_been_away() {
    let stopped = || finished(new(ERROR), 40);
    let kept = stored(&stopped());
    let read = restored(&room(), &kept);
    let (there, here) = (go_on(read, ERROR), go_on(stopped(), ERROR));
    assert_eq!(there.links.all(), here.links.all(), "links");
    assert_eq!(there.exitant.irradiance, here.exitant.irradiance, "light");
}

//! Who breaks gets what there is, soon: little is done after it, and the solution says so.

use crate::scenes::Room;
use crate::stability::answers::assert_sane;
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{Phase, Progress, Settings, Solution, Solver};
use std::ops::ControlFlow;

/// Calls of the watch function, and what had been done by then.
struct Watched {
    calls: u32,
    after: u32,
    solution: Solution<GlossyField>,
}

/// Solves the room and breaks at the given call, and at all that follow.
fn stopped_at(call: u32) -> Watched {
    let room = Room::new();
    let field = GlossyField::new(&room.reflectors, Refinement::default());
    let mut solver = Solver::new(&room.input, Settings::with_error(0.2), field).expect("the room is sound");
    let (mut calls, mut after) = (0, 0);
    let mut watch = |progress: &Progress| {
        assert!((0.0..=1.0).contains(&progress.fraction), "{progress:?}");
        calls += 1;
        after += u32::from(calls > call);
        if calls >= call { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    solver.solve(&mut watch);
    solver.reflect_for_display(&mut watch);
    let solution = solver.finish(&mut watch);
    Watched { calls, after, solution }
}

/// The first call that breaks ends the phase that it is in; each later phase asks once.
#[test]
fn after_a_break_each_phase_asks_once_and_ends() {
    let Watched { calls, solution, .. } = stopped_at(u32::MAX);
    assert!(!solution.stats.stopped, "nobody stopped it");
    let (rays, evaluations) = (solution.stats.rays, solution.field.counters().brdf_evaluations());
    let mut last = 0.0_f32;
    for call in (1..calls).step_by((calls / 24).max(1) as usize) {
        let stopped = stopped_at(call);
        let what = format!("stopped at call {call} of {calls}");
        assert!(stopped.solution.stats.stopped, "{what}: it is marked");
        assert_sane(&stopped.solution, &what);
        assert!(stopped.after <= 2, "{what}: asked {} times after it", stopped.after);
        assert!(stopped.solution.stats.rays <= rays, "{what}: {} rays", stopped.solution.stats.rays);
        let spent = stopped.solution.field.counters().brdf_evaluations();
        assert!(spent <= evaluations, "{what}: {spent} BRDF evaluations");
        let light = stopped.solution.vertices.irradiance.iter().map(|e| e.max_element()).fold(0.0, f32::max);
        assert!(light > 0.0, "{what}: there is light");
        last = light;
    }
    assert!(last > 0.0, "it was stopped at all");
}

/// Whole mean irradiance is near the final one once the first passes are done.
#[test]
fn what_comes_out_early_is_the_light_so_far() {
    let mean = |solution: &Solution<GlossyField>| solution.exitant.irradiance[0].element_sum();
    let whole = stopped_at(u32::MAX);
    for share in [0.5, 0.8] {
        let part = stopped_at((whole.calls as f32 * share) as u32);
        let ratio = mean(&part.solution) / mean(&whole.solution);
        assert!((0.7..1.4).contains(&ratio), "after {share} of all calls: {ratio} of the light");
    }
}

/// Pass by pass the same is done as at once, and there is light to show after each.
#[test]
fn steps_end_where_a_solve_does() {
    let room = Room::new();
    let solver = || {
        let field = GlossyField::new(&room.reflectors, Refinement::default());
        Solver::new(&room.input, Settings::with_error(0.2), field).expect("the room is sound")
    };
    let go_on = &mut |_: &Progress| ControlFlow::Continue(());
    let mut whole = solver();
    whole.solve(go_on);
    let mut stepwise = solver();
    let mut links = Vec::new();
    while stepwise.step(go_on) {
        links.push(stepwise.stats().links);
        if links.len() == 1 {
            assert_sane(&stepwise.clone().finish(go_on), "after a step");
        }
    }
    assert!(links.len() >= 3 && links.is_sorted(), "each is finer: {links:?}");
    assert_eq!(stepwise.exitant().irradiance, whole.exitant().irradiance, "the same light");
    assert_eq!(stepwise.stats().rays, whole.stats().rays, "by the same work");
    assert!(!stepwise.step(go_on), "nothing is left");
    assert_eq!(stepwise.stats().rays, whole.stats().rays, "so nothing is done");
    // Broken in its second step, it goes on from there.
    let mut broken = solver();
    assert!(broken.step(go_on));
    assert!(!broken.step(&mut |_| ControlFlow::Break(())) && broken.stats().stopped, "it is marked");
    broken.solve(go_on);
    let ratio = broken.exitant().irradiance[0] / whole.exitant().irradiance[0];
    assert!(!broken.stats().stopped && (ratio - 1.0).abs().max_element() < 0.1, "{ratio} of the light");
}

/// However large the scene: between two calls lies a bounded number of pairs, leaves or vertices.
#[test]
fn calls_are_as_many_as_the_work_asks_for() {
    let room = Room::new();
    let field = GlossyField::new(&room.reflectors, Refinement::default());
    let mut solver = Solver::new(&room.input, Settings::with_error(0.1), field).expect("the room is sound");
    let (mut refining, mut reconstructing) = (0_u64, 0_u64);
    let mut watch = |progress: &Progress| {
        refining += u64::from(progress.phase == Phase::Refine);
        reconstructing += u64::from(progress.phase == Phase::Reconstruct);
        ControlFlow::Continue(())
    };
    solver.solve(&mut watch);
    let solution = solver.finish(&mut watch);
    // So many per thread and call, at most.
    let most = 128 * rayon::current_num_threads() as u64;
    let (pairs, vertices) = (solution.stats.pairs, solution.vertices.positions.len() as u64);
    assert!(refining * most >= pairs, "{refining} calls for {pairs} pairs");
    assert!(reconstructing * most >= vertices, "{reconstructing} calls for {vertices} vertices");
}

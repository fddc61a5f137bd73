//! Budgets of time and memory: a coarser solution, not a darker one, and marked as such.

use glam::DVec3;
use hr_diffuse::{Budget, DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solution, Solver, Spent, Surface};
use std::ops::ControlFlow;
use std::time::Duration;

/// A grey room with a lamp at its ceiling that shines up, so that all light is reflected before it reaches the floor; a
/// box and a ball stand in it.
fn room() -> SceneInput {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let quad = |corner: DVec3, a: DVec3, b: DVec3| Shape::Quad([corner, corner + a, corner + a + b, corner + b]);
    let mut shapes = vec![
        quad(DVec3::ZERO, x, y),
        quad(z, y, x),
        quad(DVec3::ZERO, y, z),
        quad(x, z, y),
        quad(DVec3::ZERO, z, x),
        quad(y, x, z),
    ];
    let (at, a, b, up) = (DVec3::new(0.2, 0.3, 0.0), x * 0.2, y * 0.25, z * 0.5);
    shapes.extend([quad(at, a, up), quad(at + a, b, up), quad(at + a + b, -a, up), quad(at + b, -b, up)]);
    shapes.push(quad(at + up, a, b));
    shapes.push(Shape::Sphere { center: DVec3::new(0.7, 0.6, 0.2), radius: 0.15 });
    let mut surfaces: Vec<Surface> = shapes.into_iter().map(|shape| Surface::new(shape, 0)).collect();
    surfaces.push(Surface::new(quad(DVec3::new(0.4, 0.4, 0.8), x * 0.2, y * 0.2), 1));
    let wall = DiffuseMaterial { reflectance: Rgb::splat(0.7), exitance: Rgb::ZERO, two_sided: true };
    let lamp = DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::splat(10.0), two_sided: false };
    SceneInput { surfaces, materials: vec![wall, lamp], ..SceneInput::default() }
}

fn solve(error: f32, budget: Budget) -> Solution {
    let mut solver =
        Solver::new(&room(), Settings { budget, ..Settings::with_error(error) }, ()).expect("the room is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.finish(&mut |_| ControlFlow::Continue(()))
}

fn within(bytes: u64) -> Budget {
    Budget { memory: Some(bytes), ..Budget::default() }
}

/// Mean irradiance of all surfaces.
fn mean(solution: &Solution) -> f32 {
    solution.exitant.irradiance[0].element_sum() / 3.0
}

/// Mean irradiance of the floor, which only reflected light reaches.
fn floor(solution: &Solution) -> f32 {
    solution.exitant.irradiance[solution.elements.surface_nodes[0][0] as usize].element_sum() / 3.0
}

#[test]
fn what_is_not_spent_changes_nothing() {
    let free = solve(0.1, Budget::default());
    assert_eq!(free.stats.spent, None, "no budget");
    let generous = Budget { time: Some(Duration::MAX), memory: Some(u64::MAX) };
    for budget in [generous, within(2 * free.stats.bytes)] {
        let other = solve(0.1, budget);
        assert_eq!(other.stats.spent, None, "{budget:?}");
        assert_eq!(other.exitant.irradiance, free.exitant.irradiance, "{budget:?}");
    }
}

#[test]
fn memory_is_kept_to_and_light_stays() {
    // Coarser ones have no thirtieth that the scene would fit in.
    let free = solve(0.015, Budget::default());
    // Where leaves stay large some shadows are missed, or are all that is seen: those of the ball and the box where they stand, at the last.
    for (share, off) in [(2, 0.15), (4, 0.15), (10, 0.15), (30, 0.2)] {
        let budget = free.stats.bytes / share;
        let solution = solve(0.015, within(budget));
        let stats = &solution.stats;
        assert_eq!((stats.spent, stats.stopped), (Some(Spent::Memory), false), "a {share}th");
        // Refinement that has ended links what has no link yet, as it is.
        assert!(stats.bytes < budget + budget / 10, "{} of {budget} bytes", stats.bytes);
        // The last wave may end far from the limit, and edges of shadows that would fill it are looked for only where nothing is spent.
        assert!(stats.bytes > budget - budget / 8, "{} of {budget} bytes are made use of", stats.bytes);
        let (ratio, below) = (mean(&solution) / mean(&free), floor(&solution) / floor(&free));
        assert!((ratio - 1.0).abs() < off, "{ratio} of the light with a {share}th of the memory");
        assert!((below - 1.0).abs() < off, "{below} of the light on the floor with a {share}th of the memory");
    }
}

/// Where memory ends does not depend on how the work is dealt out.
#[test]
fn memory_ends_at_the_same_pair_on_any_number_of_threads() {
    let solve_on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads");
        pool.install(|| solve(0.05, within(200_000)))
    };
    let [one, three] = [1, 3].map(solve_on);
    assert_eq!(one.stats.spent, Some(Spent::Memory), "it is spent");
    assert_eq!(one.links.all(), three.links.all(), "links");
    assert_eq!(one.exitant.irradiance, three.exitant.irradiance, "light");
}

#[test]
fn without_time_there_is_light_everywhere() {
    let solution = solve(0.001, Budget { time: Some(Duration::ZERO), memory: None });
    assert_eq!((solution.stats.spent, solution.stats.stopped), (Some(Spent::Time), false), "marked");
    assert!(mean(&solution) > 0.0, "some light, at the least");
}

#[test]
fn some_time_gives_a_coarse_solution_of_all_light() {
    let fine = solve(0.03, Budget::default());
    let time = Duration::from_millis(400);
    let solution = solve(0.001, Budget { time: Some(time), memory: None });
    assert_eq!((solution.stats.spent, solution.stats.stopped), (Some(Spent::Time), false), "marked");
    let (ratio, below) = (mean(&solution) / mean(&fine), floor(&solution) / floor(&fine));
    assert!((0.5..1.6).contains(&ratio) && below > 0.0, "{ratio} of the light, {below} on the floor");
}

use crate::geometry::tests::surface;
use crate::refine::LEAST_COSINE;
use crate::{Budget, DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
use glam::DVec3;
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use std::ops::ControlFlow;

/// Rounding of the product of two areas in f32.
const ROUNDING: f32 = 1e-6;

fn solve(surfaces: Vec<Surface>, error: f32) -> Option<Solver> {
    let grey = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ZERO, two_sided: true };
    let lamp = DiffuseMaterial { exitance: Rgb::ONE, ..grey };
    let black = DiffuseMaterial { reflectance: Rgb::ZERO, ..grey };
    let input = SceneInput { surfaces, materials: vec![grey, lamp, black], ..SceneInput::default() };
    // Surfaces that run through each other have no end of detail.
    let budget = Budget { memory: Some(1_000_000), ..Budget::default() };
    let mut solver = Solver::new(&input, Settings { budget, ..Settings::with_error(error) }, ()).ok()?;
    solver.solve(&mut |_| ControlFlow::Continue(()));
    Some(solver)
}

/// Random surfaces of every shape; the first one is a lamp.
fn surfaces(runner: &mut TestRunner, count: usize) -> Vec<Surface> {
    let random = |i: usize| Surface {
        material: u32::from(i == 0),
        ..surface().new_tree(runner).expect("sound surfaces").current()
    };
    (0..count).map(random).collect()
}

/// Factors are shares: of what a receiver's point sees, 0…1 of what it shows, and of what leaves the sender; and what is hidden is no more
/// than there would be.
#[test]
fn links_carry_no_more_than_there_is() {
    let mut runner = TestRunner::deterministic();
    let mut seen = 0;
    for scene in 0..20 {
        let Some(solver) = solve(surfaces(&mut runner, 5), 0.2) else { continue };
        for link in solver.links.all() {
            let [receiver, sender] = [link.receiver, link.sender].map(|node| &solver.elements.nodes[node as usize]);
            // What a cluster sends is told by the mean cosine of its normals, however much of it is seen.
            let away = -solver.light().direction_to(receiver.center, link.sender);
            let shown = if sender.is_patch() { 1.0 } else { sender.mean_cosine(away).max(LEAST_COSINE) };
            assert!((0.0..=1.0 + ROUNDING).contains(&(link.factor * shown)), "scene {scene}: {link:?}");
            assert!(link.visibility.abs() <= 1.0, "scene {scene}: {link:?}");
            if receiver.is_flat() && sender.is_patch() {
                let most = receiver.area.min(sender.area);
                let carried = receiver.area * link.factor;
                assert!(carried <= most * (1.0 + ROUNDING), "scene {scene}: {carried} of {most}, {link:?}, {sender:?}");
                seen += 1;
            }
        }
    }
    assert!(seen > 200, "{seen} links between surfaces");
}

/// A black sheet takes light from some surfaces, and brings none to any.
#[test]
fn what_hides_light_makes_none() {
    const ERROR: f32 = 0.1;
    let mut runner = TestRunner::deterministic();
    let mut hidden = 0;
    for scene in 0..8 {
        let open = surfaces(&mut runner, 4);
        let corner = DVec3::new(0.2, 0.2, 0.45);
        let sheet = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y].map(|at| corner + 0.6 * at);
        let mut shut = open.clone();
        shut.push(Surface::new(Shape::Quad(sheet), 2));
        let (Some(open), Some(shut)) = (solve(open, ERROR), solve(shut, ERROR)) else { continue };
        // All that arrives at the surfaces that both have.
        let [without, with] = [&open, &shut].map(|solver| {
            let nodes = solver.elements.surface_nodes[..4].as_flattened().iter().map(|&node| node as usize);
            let lit = nodes.filter(|&node| node < solver.elements.nodes.len());
            lit.map(|node| solver.exitant.irradiance[node].x * solver.elements.nodes[node].area).sum::<f32>()
        });
        // In unit space, which the sheet may change.
        let scale = [&open, &shut].map(|solver| solver.scene.normalization.scale() as f32);
        let with = with * (scale[0] / scale[1]).powi(2);
        assert!(with <= without * (1.0 + 2.0 * ERROR), "scene {scene}: {without}, then {with}");
        hidden += u32::from(with < (1.0 - 2.0 * ERROR) * without);
    }
    assert!(hidden > 0, "in {hidden} scenes it throws a shadow");
}

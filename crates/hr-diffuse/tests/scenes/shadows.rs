//! Shadows: their edges are where they belong, all around.

use glam::{DVec2, DVec3, Vec2};
use hr_diffuse::{DiffuseMaterial, Light, LightKind, Rgb, SceneInput, Settings, Shape, Solution, Solver, Surface};
use std::ops::ControlFlow;

/// Side of the floor, heights of the bulb and of the sheet.
const SIDE: f64 = 4.0;
const BULB: f64 = 3.0;
const SHEET: f64 = 1.5;

/// The middle of the floor, above which the bulb is.
fn middle() -> DVec2 {
    DVec2::splat(SIDE / 2.0)
}

/// The sides of a square, turned so that none of its edges is along one of the floor's, as offsets from its middle.
fn sides() -> [DVec2; 2] {
    let side = DVec2::from_angle(0.4) * 0.4;
    [side, side.perp()]
}

/// A floor, a bulb, and a black sheet between them.
fn solution(error: f32) -> Solution {
    let [a, b] = sides().map(|side| side.extend(0.0));
    let at = middle().extend(SHEET);
    let (x, y) = (DVec3::X * SIDE, DVec3::Y * SIDE);
    let floor = Shape::Quad([DVec3::ZERO, x, x + y, y]);
    let sheet = Shape::Quad([at - a - b, at + a - b, at + a + b, at - a + b]);
    let material = |reflectance| DiffuseMaterial { reflectance, exitance: Rgb::ZERO, two_sided: true };
    let bulb = Light { position: middle().extend(BULB), intensity: Rgb::ONE, kind: LightKind::Point };
    let input = SceneInput {
        surfaces: vec![Surface::new(floor, 0), Surface::new(sheet, 1)],
        materials: vec![material(Rgb::splat(0.5)), material(Rgb::ZERO)],
        lights: vec![bulb],
        ..SceneInput::default()
    };
    let mut solver = Solver::new(&input, Settings::with_error(error), ()).expect("the scene is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.finish(&mut |_| ControlFlow::Continue(()))
}

/// Irradiance of the floor without the sheet, and whether a place lies in its shadow.
fn truth(at: DVec2) -> (f64, bool) {
    let d2 = at.distance_squared(middle()) + BULB * BULB;
    let through = (at - middle()) * ((BULB - SHEET) / BULB);
    let hidden = sides().iter().all(|side| through.dot(*side).abs() < side.length_squared());
    (BULB / (d2 * d2.sqrt()), hidden)
}

/// Shares of the floor where light should not be, and where it is missing.
fn wrong(solution: &Solution) -> [f64; 2] {
    const POINTS: u32 = 300;
    let mut wrong = [0, 0];
    for i in 0..POINTS * POINTS {
        let uv = Vec2::new((i % POINTS) as f32 + 0.5, (i / POINTS) as f32 + 0.5) / POINTS as f32;
        let leaf = solution.elements.leaf_at(&solution.scene, 0, false, uv).expect("the floor is there");
        let (whole, hidden) = truth(uv.as_dvec2() * SIDE);
        let lit = f64::from(solution.irradiance(leaf, uv).x) > 0.5 * whole;
        wrong[0] += u32::from(lit && hidden);
        wrong[1] += u32::from(!lit && !hidden);
    }
    wrong.map(|count| f64::from(count) / f64::from(POINTS * POINTS))
}

/// The edge is 6.4 m long, on a floor of 16 m².
#[test]
fn the_edge_of_a_shadow_is_where_it_belongs() {
    let [coarse, fine] = [0.1, 0.02].map(|error| wrong(&solution(error)));
    assert!(coarse[0] + coarse[1] < 0.002, "at 0.1: {coarse:?}");
    assert!(fine[0] + fine[1] < 0.001, "shadows sharpen with the error asked for: {fine:?}");
}

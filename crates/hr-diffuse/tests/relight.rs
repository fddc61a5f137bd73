//! Edits over links that exist give what a fresh solve gives, for a fraction of its work.

use glam::DVec3;
use hr_diffuse::{DiffuseMaterial, Light, LightKind, Rgb, SceneInput, Settings, Shape, SolveError, Solver, Surface};
use std::ops::ControlFlow;
use std::time::Instant;

/// The error that is asked for.
const ERROR: f32 = 0.02;

fn quad(corner: DVec3, a: DVec3, b: DVec3, material: u32) -> Surface {
    Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), material)
}

/// A room of 4 × 3 × 2.5 m with a table, two lamps (materials 3 and 4) and a point light.
fn room() -> SceneInput {
    let (x, y, z) = (DVec3::X * 4.0, DVec3::Y * 3.0, DVec3::Z * 2.5);
    let o = DVec3::ZERO;
    let mut surfaces = vec![
        quad(o, x, y, 1),
        quad(o + z, y, x, 0),
        quad(o, y, z, 0),
        quad(x, z, y, 0),
        quad(o, z, x, 2),
        quad(y, x, z, 0),
        quad(DVec3::new(1.0, 1.0, 0.8), DVec3::X * 1.5, DVec3::Y * 0.8, 1),
    ];
    surfaces.push(quad(DVec3::new(0.5, 0.5, 2.45), DVec3::Y * 0.4, DVec3::X * 0.4, 3));
    surfaces.push(quad(DVec3::new(3.0, 1.8, 2.3), DVec3::Y * 0.3, DVec3::X * 0.5, 4));
    let paint = |r, g, b| DiffuseMaterial { reflectance: Rgb::new(r, g, b), exitance: Rgb::ZERO, two_sided: true };
    let lamp = |exitance| DiffuseMaterial { reflectance: Rgb::ZERO, exitance, two_sided: false };
    SceneInput {
        surfaces,
        materials: vec![
            paint(0.7, 0.7, 0.65),
            paint(0.4, 0.3, 0.2),
            paint(0.2, 0.4, 0.6),
            lamp(Rgb::new(100.0, 90.0, 70.0)),
            lamp(Rgb::new(60.0, 70.0, 100.0)),
        ],
        lights: vec![Light { position: DVec3::new(2.0, 2.5, 1.5), intensity: Rgb::splat(3.0), kind: LightKind::Point }],
        texture: None,
    }
}

/// A solver that has solved, and the seconds that took.
fn solved(input: &SceneInput) -> (Solver, f64) {
    let start = Instant::now();
    let mut solver = Solver::new(input, Settings::with_error(ERROR), ()).expect("the room is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    (solver, start.elapsed().as_secs_f64())
}

fn relight(solver: &mut Solver, input: &SceneInput) -> Result<(), SolveError> {
    solver.relight(input, None, &mut |_| ControlFlow::Continue(()))
}

/// Mean irradiance of the fronts of the room's walls, floor, ceiling, and table.
fn walls(solver: &Solver) -> Vec<Rgb> {
    let nodes = &solver.elements().surface_nodes[..7];
    nodes.iter().map(|[front, _]| solver.exitant().irradiance[*front as usize]).collect()
}

/// Largest relative difference.
fn difference(a: &[Rgb], b: &[Rgb]) -> f32 {
    a.iter().zip(b).map(|(a, b)| ((*a - *b).abs() / *b).max_element()).fold(0.0, f32::max)
}

#[test]
fn edited_light_and_paint_are_those_of_a_fresh_solve() {
    let (mut solver, seconds) = solved(&room());
    let before = walls(&solver);
    let mut edited = room();
    edited.materials[0].reflectance = Rgb::new(0.5, 0.6, 0.7);
    edited.materials[2].reflectance = Rgb::new(0.7, 0.1, 0.1);
    edited.materials[3].exitance = Rgb::new(40.0, 60.0, 70.0);
    edited.lights[0].intensity = Rgb::new(1.0, 4.0, 2.0);
    // The shortest of a few times: others use the machine, too.
    let mut share = f64::INFINITY;
    for _ in 0..3 {
        relight(&mut solver, &room()).expect("links serve for it");
        let start = Instant::now();
        relight(&mut solver, &edited).expect("links serve for it");
        share = share.min(start.elapsed().as_secs_f64() / seconds);
    }
    let (fresh, _) = solved(&edited);
    let off = difference(&walls(&solver), &walls(&fresh));
    assert!(difference(&before, &walls(&fresh)) > 0.2, "the edit is one");
    assert!(off < ERROR, "off by {off}");
    assert!(share < 0.1, "{share} of the time of the first solve");
    // There and back again.
    relight(&mut solver, &room()).expect("links serve for it");
    let back = difference(&walls(&solver), &before);
    assert!(back < 0.1 * ERROR, "off by {back} on the way back");
}

#[test]
fn mixtures_of_lamps_are_those_of_a_fresh_solve() {
    let (mut solver, seconds) = solved(&room());
    let all = walls(&solver);
    let lamps = solver.lamps();
    assert_eq!(lamps.len(), 3, "two materials that emit and a point light: {lamps:?}");
    let variants = solver.each_lamp(&lamps, &mut |_| ControlFlow::Continue(())).expect("lamps");
    assert!(difference(&walls(&solver), &all) < 0.1 * ERROR, "the solver is as before");
    let mut mix = |colors: [Rgb; 3]| {
        let once = |_| {
            let start = Instant::now();
            solver.mix(&variants, &colors, &mut |_| ControlFlow::Continue(())).expect("a mixture");
            start.elapsed().as_secs_f64() / seconds
        };
        let share = (0..3).map(once).fold(f64::INFINITY, f64::min);
        (walls(&solver), share)
    };
    let (sum, share) = mix([Rgb::ONE; 3]);
    assert!(difference(&sum, &all) < 0.1 * ERROR, "all lamps are what they are together");
    assert!(share < 0.02, "a mixture takes {share} of the time of the first solve");
    let colors = [Rgb::new(0.2, 1.0, 0.5), Rgb::ZERO, Rgb::splat(1.5)];
    let (mixed, _) = mix(colors);
    let mut input = room();
    input.materials[3].exitance *= colors[0];
    input.materials[4].exitance *= colors[1];
    input.lights[0].intensity *= colors[2];
    let off = difference(&mixed, &walls(&solved(&input).0));
    assert!(off < 1.5 * ERROR, "off by {off}");
}

#[test]
fn what_needs_new_links_is_refused() {
    let (mut solver, _) = solved(&room());
    let before = walls(&solver);
    type Change = (fn(&mut SceneInput), &'static str);
    let cases: [Change; 10] = [
        (|input| input.surfaces.truncate(3), "added or removed"),
        (|input| input.surfaces[2].material = 1, "surface 2"),
        (|input| input.materials[1].exitance = Rgb::ONE, "did not emit"),
        (|input| input.materials[3].reflectance = Rgb::ONE * 0.5, "black"),
        (|input| input.materials[1].two_sided = false, "its back"),
        (|input| input.materials[1].reflectance.x = 1.5, "within 0…1"),
        (|input| input.lights.clear(), "lights"),
        (|input| input.lights[0].position.x += 0.1, "another place"),
        (|input| input.lights[0].intensity.x = f32::NAN, "intensity"),
        (|input| input.surfaces.clear(), "no surface"),
    ];
    for (change, hint) in cases {
        let mut input = room();
        change(&mut input);
        let text = relight(&mut solver, &input).expect_err(hint).to_string();
        assert!(text.contains(hint), "{hint:?} is not in: {text}");
        assert_eq!(walls(&solver), before, "{hint}: nothing has changed");
    }
    let lamps = solver.lamps();
    let variants = solver.each_lamp(&lamps[..1], &mut |_| ControlFlow::Continue(())).expect("a lamp");
    let nobody = hr_diffuse::Lamp { materials: vec![99], ..Default::default() };
    let missing = solver.each_lamp(&[nobody], &mut |_| ControlFlow::Continue(()));
    assert!(matches!(missing, Err(SolveError::Mix { .. })), "a lamp that is not there: {missing:?}");
    for colors in [&[][..], &[-Rgb::ONE], &[Rgb::splat(f32::NAN)]] {
        let mixed = solver.mix(&variants, colors, &mut |_| ControlFlow::Continue(()));
        assert!(matches!(mixed, Err(SolveError::Mix { .. })), "{colors:?}: {mixed:?}");
    }
}

#[test]
fn before_and_after_a_stop_edits_are_safe() {
    let mut solver = Solver::new(&room(), Settings::with_error(ERROR), ()).expect("the room is sound");
    let mut edited = room();
    edited.materials[3].exitance *= 2.0;
    relight(&mut solver, &edited).expect("before there is any light");
    let mut calls = 0;
    solver.solve(&mut |_| {
        calls += 1;
        if calls > 12 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    relight(&mut solver, &room()).expect("links serve for it");
    assert!(walls(&solver).iter().all(|light| light.is_finite() && light.min_element() > 0.0), "there is light");
}

/// Reciprocals of so little power are infinite.
#[test]
fn next_to_no_light_is_finite() {
    let (mut solver, _) = solved(&room());
    let mut edited = room();
    for material in &mut edited.materials {
        material.exitance *= 1e-41;
    }
    edited.lights[0].intensity *= 1e-41;
    relight(&mut solver, &edited).expect("links serve for it");
    let light = solver.exitant();
    let is_finite = |light: &[Rgb]| light.iter().all(|light| light.is_finite());
    assert!(is_finite(&light.irradiance) && is_finite(&light.radiosity), "light where there is next to none");
}

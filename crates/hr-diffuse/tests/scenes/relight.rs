//! Edits over links that exist give what a fresh solve gives, for a fraction of its work.

use crate::fixtures::{apart, bulb, ceiling_lamp, lamp, on, paint, quad, table, walls};
use glam::DVec3;
use hr_diffuse::{Rgb, SceneInput, Settings, SolveError, Solver};
use std::ops::ControlFlow;

/// The error that is asked for.
const ERROR: f32 = 0.02;

/// A room with a table, two lamps (materials 3 and 4) and a point light.
fn room() -> SceneInput {
    let mut surfaces = walls(1, 2, 0);
    surfaces.push(table(1));
    surfaces.push(ceiling_lamp(3));
    surfaces.push(quad(DVec3::new(3.0, 1.8, 2.3), DVec3::Y * 0.3, DVec3::X * 0.5, 4));
    let materials = vec![
        paint(Rgb::new(0.7, 0.7, 0.65)),
        paint(Rgb::new(0.4, 0.3, 0.2)),
        paint(Rgb::new(0.2, 0.4, 0.6)),
        lamp(Rgb::new(100.0, 90.0, 70.0)),
        lamp(Rgb::new(60.0, 70.0, 100.0)),
    ];
    SceneInput { surfaces, materials, lights: vec![bulb()], texture: None }
}

fn solved(input: &SceneInput) -> Solver {
    crate::fixtures::solved(input, Settings::with_error(ERROR))
}

/// What geometry costs: pairs looked at and rays.
fn work(solver: &Solver) -> [u64; 2] {
    [solver.stats().pairs, solver.stats().rays]
}

fn relight(solver: &mut Solver, input: &SceneInput) -> Result<(), SolveError> {
    solver.relight(input, None, &mut on)
}

/// Mean irradiance of the fronts of all that reflects.
fn fronts(solver: &Solver) -> Vec<Rgb> {
    let nodes = &solver.elements().surface_nodes[..7];
    nodes.iter().map(|[front, _]| solver.exitant().irradiance[*front as usize]).collect()
}

#[test]
fn edited_light_and_paint_are_those_of_a_fresh_solve() {
    let mut solver = solved(&room());
    let before = fronts(&solver);
    let mut edited = room();
    edited.materials[0].reflectance = Rgb::new(0.5, 0.6, 0.7);
    edited.materials[2].reflectance = Rgb::new(0.7, 0.1, 0.1);
    edited.materials[3].exitance = Rgb::new(40.0, 60.0, 70.0);
    edited.lights[0].intensity = Rgb::new(1.0, 4.0, 2.0);
    let costs = work(&solver);
    relight(&mut solver, &edited).expect("links serve for it");
    assert_eq!(work(&solver), costs, "no pair is looked at, no ray is shot");
    let fresh = solved(&edited);
    let off = apart(&fronts(&solver), &fronts(&fresh));
    assert!(apart(&before, &fronts(&fresh)) > 0.2, "the edit is one");
    assert!(off < ERROR, "off by {off}");
    // There and back again.
    relight(&mut solver, &room()).expect("links serve for it");
    let back = apart(&fronts(&solver), &before);
    assert!(back < 0.1 * ERROR, "off by {back} on the way back");
}

#[test]
fn mixtures_of_lamps_are_those_of_a_fresh_solve() {
    let mut solver = solved(&room());
    let all = fronts(&solver);
    let lamps = solver.lamps();
    assert_eq!(lamps.len(), 3, "two materials that emit and a point light: {lamps:?}");
    let variants = solver.each_lamp(&lamps, &mut on).expect("lamps");
    assert!(apart(&fronts(&solver), &all) < 0.1 * ERROR, "the solver is as before");
    let iterations = solver.stats().iterations;
    let mut mix = |colors: [Rgb; 3]| {
        solver.mix(&variants, &colors, &mut on).expect("a mixture");
        assert_eq!(solver.stats().iterations, iterations, "diffuse light is only added up");
        fronts(&solver)
    };
    let sum = mix([Rgb::ONE; 3]);
    assert!(apart(&sum, &all) < 0.1 * ERROR, "all lamps are what they are together");
    let colors = [Rgb::new(0.2, 1.0, 0.5), Rgb::ZERO, Rgb::splat(1.5)];
    let mixed = mix(colors);
    let mut input = room();
    input.materials[3].exitance *= colors[0];
    input.materials[4].exitance *= colors[1];
    input.lights[0].intensity *= colors[2];
    let off = apart(&mixed, &fronts(&solved(&input)));
    assert!(off < 1.5 * ERROR, "off by {off}");
}

#[test]
fn what_needs_new_links_is_refused() {
    let mut solver = solved(&room());
    let before = fronts(&solver);
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
        assert_eq!(fronts(&solver), before, "{hint}: nothing has changed");
    }
    let lamps = solver.lamps();
    let variants = solver.each_lamp(&lamps[..1], &mut on).expect("a lamp");
    let nobody = hr_diffuse::Lamp { materials: vec![99], ..Default::default() };
    let missing = solver.each_lamp(&[nobody], &mut on);
    assert!(matches!(missing, Err(SolveError::Mix { .. })), "a lamp that is not there: {missing:?}");
    for colors in [&[][..], &[-Rgb::ONE], &[Rgb::splat(f32::NAN)]] {
        let mixed = solver.mix(&variants, colors, &mut on);
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
    assert!(fronts(&solver).iter().all(|light| light.is_finite() && light.min_element() > 0.0), "there is light");
}

/// Reciprocals of so little power are infinite.
#[test]
fn next_to_no_light_is_finite() {
    let mut solver = solved(&room());
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

//! Light that is reflected nearly without loss, and without any.

use crate::scenes::{quad, solve, walls};
use crate::stability::answers::{assert_sane, irradiance};
use crate::stability::cases::{ceiling, glowing};
use glam::DVec3;
use glossy_ext::haar::Refinement;
use glossy_ext::{GlossyField, Lambert, MetallicRoughness, Phong, Reflector};
use hr_diffuse::{
    DiffuseMaterial, Light, LightKind, Phase, Rgb, SceneInput, Settings, Shape, Solution, SolveError, Solver, Surface,
};
use std::ops::ControlFlow;
use std::sync::Arc;

const WHITE: DiffuseMaterial = DiffuseMaterial { reflectance: Rgb::ONE, exitance: Rgb::ZERO, two_sided: false };

/// The unit cube's walls, all of one material.
fn cube(material: DiffuseMaterial) -> SceneInput {
    let surfaces = walls(DVec3::ZERO, DVec3::ONE, 0);
    SceneInput { surfaces, materials: vec![material], ..SceneInput::default() }
}

/// B = M / (1 − ρ), thus E = B too: what is sent is what arrives.
#[test]
fn nearly_white_furnaces_have_their_analytic_light() {
    for reflectance in [0.0, 0.5, 0.9, 0.99, 0.999] {
        let solution = solve(&cube(glowing(reflectance)), 0.1, ());
        assert_sane(&solution, "a furnace");
        let exact = 1.0 / (1.0 - f64::from(reflectance));
        if reflectance > 0.0 {
            for wall in 0..6 {
                let off = irradiance(&solution, wall) / exact - 1.0;
                assert!(off.abs() < 0.01, "reflectance {reflectance}: wall {wall} is {:.2} % off", 100.0 * off);
            }
        }
    }
}

/// Channels converge at their own speeds: each must get to its own answer.
#[test]
fn channels_converge_each_to_its_own_answer() {
    let reflectance = Rgb::new(0.1, 0.7, 0.99);
    let solution =
        solve(&cube(DiffuseMaterial { reflectance, exitance: Rgb::new(1.0, 10.0, 0.1), two_sided: false }), 0.1, ());
    let exact = Rgb::new(1.0, 10.0, 0.1) / (Rgb::ONE - reflectance);
    for node in &solution.elements.surface_nodes {
        let found = solution.exitant.radiosity[node[0] as usize];
        assert!(((found - exact) / exact).abs().max_element() < 0.01, "{found} instead of {exact}");
    }
}

/// What a lamp sends into a grey box is what everything in it absorbs: Φ = Σ (1 − ρ) E A.
#[test]
fn absorbed_power_is_emitted_power() {
    for reflectance in [0.2, 0.5, 0.7] {
        let mut input = cube(DiffuseMaterial { reflectance: Rgb::splat(reflectance), ..WHITE });
        input.materials.push(glowing(reflectance));
        let corner = DVec3::new(0.25, 0.25, 0.9);
        input.surfaces.push(quad(corner, DVec3::Y * 0.5, DVec3::X * 0.5, 1));
        input.surfaces.push(quad(corner, DVec3::X * 0.5, DVec3::Y * 0.5, 0));
        let solution = solve(&input, 0.1, ());
        let received: f64 = (0..8).map(|s| irradiance(&solution, s) * if s < 6 { 1.0 } else { 0.25 }).sum();
        let absorbed = (1.0 - f64::from(reflectance)) * received;
        assert!((absorbed / 0.25 - 1.0).abs() < 0.1, "reflectance {reflectance}: {absorbed} W of 0.25 W are absorbed");
    }
}

/// A cube of metal with a black lamp below its ceiling, and what its walls reflect of what arrives.
fn metal_box(color: f32, roughness: f32) -> (SceneInput, GlossyField, f64) {
    let metal = MetallicRoughness::new(Rgb::splat(color), 1.0, roughness).expect("valid parameters").compensated();
    let albedo = f64::from(metal.glossy_albedo().x);
    let mut input = cube(DiffuseMaterial { reflectance: metal.diffuse(), ..WHITE });
    input.materials.push(DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::ONE, two_sided: false });
    let corner = DVec3::new(0.25, 0.25, 0.99);
    input.surfaces.push(quad(corner, DVec3::Y * 0.5, DVec3::X * 0.5, 1));
    let lamp = Lambert::new(Rgb::ZERO).expect("valid parameters");
    (input, GlossyField::new(&[Arc::new(metal), Arc::new(lamp)], Refinement::default()), albedo)
}

/// What is absorbed in a box of metal over what is emitted, less 1.
fn metal_is_off(solution: &Solution<GlossyField>, albedo: f64) -> f64 {
    let received: f64 = (0..6).map(|wall| irradiance(solution, wall)).sum();
    // Of what comes back to the lamp all is lost.
    let back = received / 6.0 * albedo * 0.25;
    ((1.0 - albedo) * received + back) / 0.25 - 1.0
}

/// The same where walls are metal: without diffuse light they are lit by what other metal sends all the same, smooth walls by lobes
/// narrower than links at first.
#[test]
fn metal_passes_light_on() {
    for (color, roughness, error) in [(0.5, 0.8, 0.1), (0.5, 0.3, 0.1), (0.7, 0.25, 0.2), (0.9, 0.6, 0.1)] {
        let (input, field, albedo) = metal_box(color, roughness);
        let solution = solve(&input, error, field);
        assert_sane(&solution, "a metal box");
        let off = metal_is_off(&solution, albedo);
        assert!(off.abs() < 0.09, "colour {color}, roughness {roughness}: {off} of what is emitted is missing");
    }
}

/// A coarse solve has so few passes that light which got no further than to the next metal in each would be lost: a third of all.
#[test]
fn links_follow_light_from_metal_to_metal_within_a_pass() {
    let (input, field, albedo) = metal_box(0.9, 0.8);
    let mut solver = Solver::new(&input, Settings::with_error(0.5), field).expect("the box is sound");
    // Where in the solve links were made: more than once in a pass where light has travelled in between.
    let (mut refines, mut begun) = (false, Vec::new());
    solver.solve(&mut |progress| {
        if progress.phase == Phase::Refine && !refines {
            begun.push(progress.fraction);
        }
        refines = progress.phase == Phase::Refine;
        ControlFlow::Continue(())
    });
    let solution = solver.finish(&mut |_| ControlFlow::Continue(()));
    assert_sane(&solution, "a box of white metal");
    let most = begun.chunk_by(|a, b| a == b).map(<[f32]>::len).max();
    assert!(
        most.is_some_and(|most| (3..=5).contains(&most)),
        "links are made again in a pass, four times at most: {begun:?}"
    );
    let off = metal_is_off(&solution, albedo);
    assert!(off.abs() < 0.2, "{off} of what is emitted is missing");
    // 1.6 million where nothing is followed, 2.2 million as it is.
    let evaluations = solution.field.counters().brdf_evaluations();
    assert!(evaluations < 3_000_000, "what is followed is reflected when light has settled: {evaluations} evaluations");
}

fn refusal(input: &SceneInput) -> SolveError {
    Solver::new(input, Settings::default(), ()).map(|_| ()).expect_err("light without end")
}

/// Light that nothing absorbs and that cannot leave grows without end.
#[test]
fn closed_white_rooms_with_light_are_refused() {
    let glowing_white = cube(glowing(1.0));
    let mut with_lamp = cube(WHITE);
    with_lamp.lights.push(Light { position: DVec3::splat(0.5), intensity: Rgb::X, kind: LightKind::Point });
    let mut one_channel = cube(glowing(0.5));
    one_channel.materials[0].reflectance = Rgb::new(0.5, 1.0, 0.5);
    let mut inside_another =
        cube(DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ONE, two_sided: false });
    let mut small = walls(DVec3::splat(0.3), DVec3::splat(0.6), 1);
    small[0].material = 2;
    inside_another.surfaces.extend(small);
    inside_another.materials.extend([WHITE, glowing(1.0)]);
    let ball = SceneInput {
        surfaces: vec![Surface { flip: true, ..Surface::new(Shape::Sphere { center: DVec3::ONE, radius: 2.0 }, 0) }],
        materials: vec![glowing(1.0)],
        ..SceneInput::default()
    };
    for (name, input, channel) in [
        ("glowing", glowing_white, "red"),
        ("lamp", with_lamp, "red"),
        ("green", one_channel, "green"),
        ("room in a room", inside_another, "red"),
        ("ball", ball, "red"),
    ] {
        let error = refusal(&input);
        assert!(matches!(error, SolveError::NoSteadyState { .. }), "{name}: {error}");
        assert!(error.to_string().contains(channel), "{name}: {error}");
    }
}

/// White surfaces among others, and white rooms that light can leave or does not enter.
#[test]
fn white_surfaces_that_light_can_leave_are_solved() {
    let mut one_wall = cube(glowing(0.5));
    one_wall.materials.push(WHITE);
    one_wall.surfaces[2].material = 1;
    let mut black_lamp = cube(WHITE);
    black_lamp.materials.push(glowing(0.0));
    black_lamp.surfaces.push(quad(DVec3::new(0.25, 0.25, 0.9), DVec3::Y * 0.5, DVec3::X * 0.5, 1));
    let mut open = cube(glowing(1.0));
    open.surfaces.pop();
    let dark = cube(WHITE);
    let mut dark_channel =
        cube(DiffuseMaterial { exitance: Rgb::X, reflectance: Rgb::new(0.5, 1.0, 1.0), two_sided: false });
    dark_channel.lights.push(Light { position: DVec3::splat(0.5), intensity: Rgb::X, kind: LightKind::Point });
    let absorbing_back = {
        let mut input = cube(glowing(1.0));
        input.surfaces.push(ceiling(0.5, 0));
        input
    };
    for (name, input) in [
        ("one white wall", one_wall),
        ("a black lamp", black_lamp),
        ("open", open),
        ("dark", dark),
        ("dark in the white channels", dark_channel),
        ("a shelf with a black back", absorbing_back),
    ] {
        let solution = solve(&input, 0.2, ());
        assert_sane(&solution, name);
    }
}

/// What counts is all that is reflected, however it is.
#[test]
fn mirrors_and_gloss_count_as_reflectance() {
    let phong = Phong::new(Rgb::splat(0.4), Rgb::splat(0.6), 20.0).expect("a Phong lobe");
    let reflector: Arc<dyn Reflector> = Arc::new(phong);
    let albedo = reflector.diffuse() + reflector.glossy_albedo();
    let mut input = cube(DiffuseMaterial { reflectance: reflector.diffuse(), exitance: Rgb::ONE, two_sided: false });
    let field = || GlossyField::new(&[Arc::clone(&reflector)], Refinement::default());
    let answer = Solver::new(&input, Settings::default(), field()).map(|_| ());
    if albedo.min_element() >= 1.0 {
        assert!(matches!(answer, Err(SolveError::NoSteadyState { .. })), "albedo {albedo}: {answer:?}");
    } else {
        assert!(answer.is_ok(), "albedo {albedo}: {answer:?}");
    }
    // A mirror is white whatever its lobe.
    input.materials[0].reflectance = Rgb::ONE - reflector.glossy_albedo();
    let answer = Solver::new(&input, Settings::default(), field()).map(|_| ());
    assert!(matches!(answer, Err(SolveError::NoSteadyState { .. })), "white with gloss: {answer:?}");
}

//! Whatever is handed in: a typed error that says what is wrong and where, or a finite answer. Never a panic.

use crate::scenes::{quad, solve};
use glam::{DVec3, Vec3};
use hr_diffuse::{
    DiffuseMaterial, GeometryError, Light, LightKind, Rgb, SceneInput, Settings, Shape, SolveError, Solver, Surface,
};

/// A lamp over a plate, one of every shape beside them, and one of every light.
fn scene() -> SceneInput {
    let lamp = quad(DVec3::new(0.0, 0.0, 1.0), DVec3::Y, DVec3::X, 1);
    let plate = quad(DVec3::ZERO, DVec3::X, DVec3::Y, 0);
    let triangle = Shape::Triangle([DVec3::X * 2.0, DVec3::X * 3.0, DVec3::new(2.0, 1.0, 0.0)]);
    let ends = [DVec3::new(0.0, 2.0, 0.0), DVec3::new(0.0, 2.0, 1.0)];
    let curved = [
        Shape::Sphere { center: DVec3::new(2.0, 2.0, 0.5), radius: 0.25 },
        Shape::Cone { ends, radii: [0.25, 0.125] },
        Shape::Ring { center: DVec3::new(2.0, 0.0, 1.0), normal: -DVec3::Z, inner: 0.1, outer: 0.25 },
        Shape::Torus { center: DVec3::new(3.0, 3.0, 0.5), axis: DVec3::Z, major: 0.5, minor: 0.1 },
    ];
    let mut surfaces = vec![lamp, plate, Surface::new(triangle, 0)];
    surfaces[2].shading_normals = Some([Vec3::Z; 4]);
    surfaces.extend(curved.map(|shape| Surface::new(shape, 0)));
    let grey = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ZERO, two_sided: true };
    let position = DVec3::new(1.0, 1.0, 2.0);
    let direction = -Vec3::Z;
    let light = |kind| Light { position, intensity: Rgb::ONE, kind };
    SceneInput {
        surfaces,
        materials: vec![grey, DiffuseMaterial { exitance: Rgb::splat(10.0), two_sided: false, ..grey }],
        lights: vec![
            light(LightKind::Point),
            light(LightKind::Spot { direction, cos_inner: 0.9, cos_outer: 0.8 }),
            light(LightKind::Directional { direction }),
        ],
        texture: None,
    }
}

fn refused(input: &SceneInput) -> SolveError {
    Solver::new(input, Settings::default(), ()).expect_err("the scene is wrong")
}

#[test]
fn the_scene_itself_is_sound() {
    let solution = solve(&scene(), 0.5, ());
    let light = solution.exitant.radiosity.iter().map(|b| b.max_element()).fold(0.0, f32::max);
    assert!(light >= 10.0 && light.is_finite(), "the lamp is on: {light}");
}

#[test]
fn nothing_to_light_is_an_error() {
    assert_eq!(refused(&SceneInput::default()), SolveError::Empty, "no surface");
    let lights = SceneInput { surfaces: Vec::new(), ..scene() };
    assert_eq!(refused(&lights), SolveError::Empty, "lights alone");
}

#[test]
fn wrong_surfaces_are_named() {
    let mut input = scene();
    input.surfaces[1].shape = Shape::Quad([DVec3::NAN; 4]);
    let error = refused(&input);
    assert_eq!(error, SolveError::Surface { surface: 1, source: GeometryError::NonFinite }, "NaN: {error}");

    let mut input = scene();
    input.surfaces[2].shape = Shape::Triangle([DVec3::ZERO, DVec3::X, DVec3::X * 2.0]);
    let error = refused(&input);
    assert!(matches!(error, SolveError::Surface { surface: 2, source: GeometryError::NoArea(_) }), "line: {error}");

    let mut input = scene();
    input.surfaces[3].material = 2;
    let error = refused(&input);
    assert_eq!(error, SolveError::Material { surface: 3, material: 2, count: 2 }, "material: {error}");
    assert!(error.to_string().contains("surface 3 refers to material 2"), "says where: {error}");
}

#[test]
fn wrong_materials_are_named() {
    for (reflectance, exitance) in [
        (Rgb::new(0.5, 1.01, 0.5), Rgb::ZERO),
        (Rgb::new(0.5, -0.01, 0.5), Rgb::ZERO),
        (Rgb::new(f32::NAN, 0.5, 0.5), Rgb::ZERO),
        (Rgb::splat(0.5), Rgb::new(0.0, -1.0, 0.0)),
        (Rgb::splat(0.5), Rgb::new(0.0, f32::INFINITY, 0.0)),
    ] {
        let mut input = scene();
        input.materials[1] = DiffuseMaterial { reflectance, exitance, two_sided: false };
        let error = refused(&input);
        assert!(matches!(error, SolveError::MaterialValue { material: 1, .. }), "{reflectance} {exitance}: {error}");
    }
}

#[test]
fn wrong_lights_are_named() {
    for (position, intensity) in [(DVec3::NAN, Rgb::ONE), (DVec3::ZERO, -Rgb::ONE), (DVec3::ZERO, Rgb::NAN)] {
        let mut input = scene();
        input.lights[1] = Light { position, intensity, kind: LightKind::Point };
        let error = refused(&input);
        assert!(matches!(error, SolveError::Light { light: 1, .. }), "{position} {intensity}: {error}");
    }
}

#[test]
fn the_error_asked_for_has_a_range() {
    for error in [0.0, -0.1, 0.000_99, 1.01, f32::NAN, f32::INFINITY] {
        let answer = Solver::new(&scene(), Settings::with_error(error), ()).map(|_| ()).expect_err("out of range");
        assert!(matches!(answer, SolveError::Error { .. }), "{error}: {answer}");
        assert!(answer.to_string().contains("0.001"), "says what would be right: {answer}");
    }
}

/// Sets one of a scene's numbers; tells whether there is one of that index.
fn set(input: &mut SceneInput, index: usize, value: f64) -> bool {
    let mut at = 0;
    let mut hit = false;
    let mut next = |number: &mut f64| {
        if at == index {
            *number = value;
            hit = true;
        }
        at += 1;
    };
    fn double(v: &mut DVec3, next: &mut impl FnMut(&mut f64)) {
        let mut a = v.to_array();
        a.iter_mut().for_each(next);
        *v = a.into();
    }
    fn single(x: &mut f32, next: &mut impl FnMut(&mut f64)) {
        let mut d = f64::from(*x);
        next(&mut d);
        *x = d as f32;
    }
    fn singles(v: &mut Vec3, next: &mut impl FnMut(&mut f64)) {
        let mut a = v.to_array();
        a.iter_mut().for_each(|x| single(x, next));
        *v = a.into();
    }
    for surface in &mut input.surfaces {
        match &mut surface.shape {
            Shape::Triangle(points) => points.iter_mut().for_each(|p| double(p, &mut next)),
            Shape::Quad(points) => points.iter_mut().for_each(|p| double(p, &mut next)),
            Shape::Sphere { center, radius } => {
                double(center, &mut next);
                next(radius);
            }
            Shape::Cone { ends, radii } => {
                ends.iter_mut().for_each(|p| double(p, &mut next));
                radii.iter_mut().for_each(&mut next);
            }
            Shape::Ring { center, normal, inner, outer } => {
                double(center, &mut next);
                double(normal, &mut next);
                next(inner);
                next(outer);
            }
            Shape::Torus { center, axis, major, minor } => {
                double(center, &mut next);
                double(axis, &mut next);
                next(major);
                next(minor);
            }
        }
        for normal in surface.shading_normals.iter_mut().flatten() {
            singles(normal, &mut next);
        }
    }
    for material in &mut input.materials {
        singles(&mut material.reflectance, &mut next);
        singles(&mut material.exitance, &mut next);
    }
    for light in &mut input.lights {
        double(&mut light.position, &mut next);
        singles(&mut light.intensity, &mut next);
        match &mut light.kind {
            LightKind::Point => {}
            LightKind::Spot { direction, cos_inner, cos_outer } => {
                singles(direction, &mut next);
                single(cos_inner, &mut next);
                single(cos_outer, &mut next);
            }
            LightKind::Directional { direction } => singles(direction, &mut next),
        }
    }
    hit
}

/// Every single number of the scene, one after the other, made as bad as numbers get.
#[test]
fn hostile_numbers_give_an_error_or_a_finite_answer() {
    let mut solved = 0;
    let mut wrong = Vec::new();
    for value in [f64::NAN, f64::INFINITY, -f64::INFINITY, 0.0, -1.0, 1e300, -1e30, 1e-300, 1e9] {
        for index in 0.. {
            let mut input = scene();
            if !set(&mut input, index, value) {
                assert!(index > 100, "all numbers: {index}");
                break;
            }
            let Ok(mut solver) = Solver::new(&input, Settings::with_error(1.0), ()) else { continue };
            solved += 1;
            let mut steps = 0;
            let mut watch = |_: &hr_diffuse::Progress| {
                steps += 1;
                // A scene stretched beyond measure need not be solved to the end, only without a fault.
                if steps > 15 { std::ops::ControlFlow::Break(()) } else { std::ops::ControlFlow::Continue(()) }
            };
            solver.solve(&mut watch);
            let solution = solver.finish(&mut watch);
            let finite = solution.exitant.radiosity.iter().chain(&solution.vertices.irradiance).all(|b| b.is_finite());
            if !finite {
                wrong.push((index, value));
            }
        }
    }
    assert!(solved > 100, "some of it can be solved: {solved}");
    assert!(wrong.is_empty(), "light that is not finite for (number, value): {wrong:?}");
}

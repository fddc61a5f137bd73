//! Edits of glossy scenes over links that exist.

use crate::scenes::{Room, quad, walls};
use glam::DVec3;
use glossy_ext::haar::Refinement;
use glossy_ext::{GlossyField, Lambert, Phong, Reflector, Ward};
use hr_diffuse::{DiffuseMaterial, Light, LightKind, Rgb, SceneInput, Settings, Solver, Surface};
use std::ops::ControlFlow;
use std::sync::Arc;

/// Coarse: mean radiosities of surfaces are much better.
const ERROR: f32 = 0.1;

/// Surfaces of a glossy material, 0, diffuse grey, 1, and a lamp of area, 2.
fn room_of(surfaces: Vec<Surface>, specular: Ward, lights: Vec<Light>) -> Room {
    let grey = |share| Arc::new(Lambert::new(Rgb::splat(share)).expect("a share")) as Arc<dyn Reflector>;
    let reflectors = vec![Arc::new(specular) as Arc<dyn Reflector>, grey(0.5), grey(0.0)];
    let exitance = [Rgb::ZERO, Rgb::ZERO, Rgb::splat(50.0)];
    let material = |(reflector, exitance): (&Arc<dyn Reflector>, Rgb)| DiffuseMaterial {
        reflectance: reflector.diffuse(),
        exitance,
        two_sided: false,
    };
    let materials = reflectors.iter().zip(exitance).map(material).collect();
    Room { input: SceneInput { surfaces, materials, lights, texture: None }, reflectors }
}

fn solved(room: &Room) -> Solver<GlossyField> {
    let field = GlossyField::new(&room.reflectors, Refinement::default());
    let mut solver = Solver::new(&room.input, Settings::with_error(ERROR), field).expect("the room is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver
}

/// Mean irradiance of the front of each surface but the lamp, which is the last.
fn fronts(solver: &Solver<GlossyField>) -> Vec<Rgb> {
    let (lamp, others) = solver.elements().surface_nodes.split_last().expect("surfaces");
    assert!(lamp[0] != u32::MAX, "the lamp has an element");
    others.iter().map(|[front, _]| solver.exitant().irradiance[*front as usize]).collect()
}

/// Relative to all of the light.
fn difference(a: &[Rgb], b: &[Rgb]) -> f32 {
    let apart: f32 = a.iter().zip(b).map(|(a, b)| (*a - *b).abs().element_sum()).sum();
    apart / b.iter().map(|light| light.element_sum()).sum::<f32>()
}

#[test]
fn glossy_paint_and_lamps_can_be_edited() {
    let mut room = Room::new();
    let mut solver = solved(&room);
    let before = fronts(&solver);
    let phong = Phong::new(Rgb::new(0.1, 0.2, 0.5), Rgb::splat(0.4), 60.0).expect("a Phong lobe");
    room.reflectors[3] = Arc::new(phong);
    for (material, reflector) in room.input.materials.iter_mut().zip(&room.reflectors) {
        material.reflectance = reflector.diffuse();
        material.exitance *= Rgb::new(0.5, 0.7, 1.0);
    }
    room.input.lights[0].intensity *= 1.5;
    let field = GlossyField::new(&room.reflectors, Refinement::default());
    solver.relight(&room.input, Some(field), &mut |_| ControlFlow::Continue(())).expect("links serve for it");
    let fresh = fronts(&solved(&room));
    assert!(difference(&before, &fresh) > 0.2, "the edit is one");
    let off = difference(&fronts(&solver), &fresh);
    assert!(off < 0.5 * ERROR, "off by {off}");
}

/// What all lamps together emit more or less is expected everywhere, and what arrives is sent on in proportion: that of a single lamp
/// shows where leaves have to be reflected anew, and those are few.
#[test]
fn dimming_lamps_reflects_few_leaves_anew() {
    const BAR: u64 = 20;
    let mut room = Room::new();
    let mut solver = solved(&room);
    let reflected = |solver: &Solver<GlossyField>| solver.field().counters().brdf_evaluations();
    let first = reflected(&solver);
    let mut share_of = |room: &Room| {
        let before = reflected(&solver);
        solver.relight(&room.input, None, &mut |_| ControlFlow::Continue(())).expect("links serve for it");
        let off = difference(&fronts(&solver), &fronts(&solved(room)));
        assert!(off < 0.5 * ERROR, "off by {off}");
        100 * (reflected(&solver) - before) / first
    };
    let color = Rgb::new(0.3, 0.6, 0.9);
    room.input.materials.iter_mut().for_each(|material| material.exitance *= color);
    room.input.lights[0].intensity *= color;
    assert_eq!(share_of(&room), 0, "percent of what the solve reflected, for all lamps in another colour");
    room.input.lights[0].intensity *= 0.5;
    let one = share_of(&room);
    assert!(one < BAR, "{one} % of what the solve reflected, for a single lamp");
}

#[test]
fn glossy_lamps_can_be_mixed() {
    let mut room = Room::new();
    let mut solver = solved(&room);
    let lamps = solver.lamps();
    let variants = solver.each_lamp(&lamps, &mut |_| ControlFlow::Continue(())).expect("lamps");
    let colors = [Rgb::new(0.5, 0.7, 1.0), Rgb::splat(1.5)];
    solver.mix(&variants, &colors, &mut |_| ControlFlow::Continue(())).expect("a mixture");
    room.input.materials.iter_mut().for_each(|material| material.exitance *= colors[0]);
    room.input.lights[0].intensity *= colors[1];
    let off = difference(&fronts(&solver), &fronts(&solved(&room)));
    assert!(off < 0.5 * ERROR, "off by {off}");
}

/// A small metal plate that is lit from one side, then as strongly from the other: its leaves receive as much, but send it elsewhere.
#[test]
fn lobes_turn_with_a_lamp_that_moves() {
    let lit_from = |x: f64| {
        let position = DVec3::new(x, 6.0, 8.0);
        let kind = LightKind::Spot { direction: -position.normalize().as_vec3(), cos_inner: 0.9995, cos_outer: 0.999 };
        let lamp = Light { position, intensity: Rgb::splat(100.0), kind };
        let plate = quad(DVec3::new(-0.1, -0.1, 0.0), DVec3::X * 0.2, DVec3::Y * 0.2, 0);
        let screens = [-1.8, 0.0].map(|x| quad(DVec3::new(x, -1.0, 0.3), DVec3::Z * 1.9, DVec3::X * 1.8, 1));
        let metal = Ward::new(Rgb::ZERO, Rgb::splat(0.9), 0.2).expect("a Ward lobe");
        let last = quad(DVec3::new(-0.1, -0.1, -2.0), DVec3::X * 0.2, DVec3::Y * 0.2, 1);
        room_of([&[plate], screens.as_slice(), &[last]].concat(), metal, vec![lamp])
    };
    let [right, left] = [6.0, -6.0].map(lit_from);
    let mut solver = solved(&right);
    let [before, fresh] = [fronts(&solver), fronts(&solved(&left))];
    assert!(difference(&before[1..], &fresh[1..]) > 1.0, "the other screen is lit: {before:?} {fresh:?}");
    solver.rearrange(&left.input, &mut |_| ControlFlow::Continue(())).expect("a lamp elsewhere");
    let off = difference(&fronts(&solver)[1..], &fresh[1..]);
    // The screens get next to nothing else than the lobe of a plate of few leaves: either solve may be off by half of the error there.
    assert!(off < ERROR, "off by {off}: {:?} {fresh:?}", fronts(&solver));
}

/// What moves at one end of a glossy floor does not have the other end reflected anew.
#[test]
fn moved_things_reflect_few_leaves_anew() {
    const BAR: u64 = 70;
    let hall = |x: f64| {
        let mut surfaces = walls(DVec3::ZERO, DVec3::new(16.0, 3.0, 2.5), 1);
        surfaces[4].material = 0;
        surfaces.extend(walls(DVec3::new(x + 0.4, 1.4, 0.8), DVec3::new(x, 1.0, 0.4), 1));
        let lamp = |x: f64| quad(DVec3::new(x, 1.0, 2.4), DVec3::Y, DVec3::X, 2);
        surfaces.extend([1.0, 5.0, 10.0, 14.0].map(lamp));
        room_of(surfaces, Ward::new(Rgb::splat(0.3), Rgb::splat(0.3), 0.2).expect("a Ward lobe"), Vec::new())
    };
    let mut solver = solved(&hall(0.5));
    let reflected = |solver: &Solver<GlossyField>| solver.field().counters().brdf_evaluations();
    let first = reflected(&solver);
    solver.rearrange(&hall(1.5).input, &mut |_| ControlFlow::Continue(())).expect("a box in another place");
    let share = 100 * (reflected(&solver) - first) / first;
    assert!(share < BAR, "{share} % of what the solve reflected");
    let off = difference(&fronts(&solver), &fronts(&solved(&hall(1.5))));
    assert!(off < 0.5 * ERROR, "off by {off}");
}

//! Things that move have the light of a fresh solve, and links that this does not concern stay.

use crate::fixtures::{bulb, ceiling_lamp, lamp, on, paint, quad, restored, stored, table, walls};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use hr_diffuse::{LightKind, Rgb, SceneInput, Settings, Shape, SolveError, Solver, Surface};
use std::f64::consts::FRAC_PI_3;
use std::ops::{ControlFlow, Range};

/// The error that is asked for.
const ERROR: f32 = 0.03;

/// Surfaces of the room: a box on the floor, a ball, a lamp, and a little box on the table.
const BOX: Range<usize> = 7..13;
const BALL: usize = 13;
const LAMP: usize = 14;
const CUP: Range<usize> = 15..21;

/// Six sides, seen from outside.
fn cuboid(at: DVec3, size: DVec3, material: u32) -> [Surface; 6] {
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let side = |corner: DVec3, a: DVec3, b: DVec3| quad(at + corner, a, b, material);
    let o = DVec3::ZERO;
    [side(o, y, x), side(z, x, y), side(o, z, y), side(x, y, z), side(o, x, z), side(y, z, x)]
}

fn room() -> SceneInput {
    let mut surfaces = walls(1, 2, 0);
    surfaces.push(table(1));
    surfaces.extend(cuboid(DVec3::new(0.3, 2.0, 0.0), DVec3::new(0.6, 0.5, 0.9), 2));
    surfaces.push(Surface::new(Shape::Sphere { center: DVec3::new(3.2, 0.9, 0.4), radius: 0.3 }, 0));
    surfaces.push(ceiling_lamp(3));
    surfaces.extend(cuboid(DVec3::new(1.6, 1.3, 0.8), DVec3::splat(0.1), 0));
    let materials = vec![
        paint(Rgb::new(0.7, 0.7, 0.65)),
        paint(Rgb::new(0.4, 0.3, 0.2)),
        paint(Rgb::new(0.2, 0.4, 0.6)),
        lamp(Rgb::new(100.0, 90.0, 70.0)),
    ];
    SceneInput { surfaces, materials, lights: vec![bulb()], texture: None }
}

/// Moves surfaces.
fn place(input: &mut SceneInput, surfaces: Range<usize>, by: DAffine3) {
    for surface in &mut input.surfaces[surfaces] {
        match &mut surface.shape {
            Shape::Quad(corners) => corners.iter_mut().for_each(|p| *p = by.transform_point3(*p)),
            Shape::Sphere { center, .. } => *center = by.transform_point3(*center),
            other => panic!("{other:?} is not in the room"),
        }
    }
}

fn solved(input: &SceneInput) -> Solver {
    crate::fixtures::solved(input, Settings::with_error(ERROR))
}

/// Irradiance and area of both sides of all surfaces; sides without elements have none.
fn sides(solver: &Solver) -> Vec<(Rgb, f32)> {
    let elements = solver.elements();
    let side = |&node: &u32| match elements.nodes.get(node as usize) {
        Some(element) => (solver.exitant().irradiance[node as usize], element.area),
        None => (Rgb::ZERO, 0.0),
    };
    elements.surface_nodes.as_flattened().iter().map(side).collect()
}

/// Relative difference of the irradiances of all sides, by area.
fn difference(a: &[(Rgb, f32)], b: &[(Rgb, f32)]) -> f32 {
    let apart = a.iter().zip(b).map(|((p, of), (q, or))| (*p - *q).abs().element_sum() * of.max(*or));
    apart.sum::<f32>() / b.iter().map(|(light, area)| light.element_sum() * area).sum::<f32>()
}

/// What an edit took: its share of the links there were, and of the rays of the first solve.
struct Cost {
    links: f64,
    rays: f64,
}

/// Moves what is in a solved room, and compares it to a fresh solve.
fn moved(change: impl Fn(&mut SceneInput)) -> (Cost, Solver) {
    let mut input = room();
    let mut solver = solved(&input);
    change(&mut input);
    let first = solver.stats().rays;
    solver.rearrange(&input, &mut on).expect("places of the same surfaces");
    let stats = solver.stats();
    let off = difference(&sides(&solver), &sides(&solved(&input)));
    // Each is off by what was asked for at most, as rays have found.
    assert!(stats.error.is_some_and(|error| error < ERROR), "{stats:?}");
    assert!(off < ERROR, "off by {off}");
    let links = stats.renewed_links as f64 / (stats.renewed_links + stats.kept_links) as f64;
    let rays = (stats.rays - first) as f64 / first as f64;
    (Cost { links, rays }, solver)
}

#[test]
fn a_moved_box_is_lit_as_if_it_had_always_been_there() {
    let (Cost { links, rays }, _) =
        moved(|input| place(input, BOX, DAffine3::from_translation(DVec3::new(1.3, -0.6, 0.0))));
    // A large box in a small room is between much of it: leaves look again at what it may hide, also those that its old shadow needed.
    assert!(links < 0.4 && rays < 1.1, "{links} of all links, {rays} of all rays");
}

#[test]
fn a_small_move_of_something_small_costs_little() {
    let (Cost { links, rays }, _) =
        moved(|input| place(input, CUP, DAffine3::from_translation(DVec3::new(0.05, 0.0, 0.0))));
    assert!(links < 0.18 && rays < 0.3, "{links} of all links, {rays} of all rays");
}

#[test]
fn moved_lamps_light_what_they_see_now() {
    moved(|input| place(input, LAMP..LAMP + 1, DAffine3::from_translation(DVec3::new(2.7, 1.5, -0.6))));
    moved(|input| input.lights[0].position = DVec3::new(3.5, 0.4, 0.6));
    moved(|input| {
        let direction = Vec3::new(0.3, 0.2, -1.0).normalize();
        input.lights[0].kind = LightKind::Spot { direction, cos_inner: 0.9, cos_outer: 0.7 };
    });
}

/// Clusters were made of what is near each other.
#[test]
fn what_goes_far_away_is_as_exact() {
    let turn = DAffine3::from_rotation_translation(DQuat::from_rotation_z(FRAC_PI_3), DVec3::new(4.5, 0.3, 1.2));
    moved(|input| {
        place(input, BOX.start..BOX.end, turn);
        place(input, BALL..BALL + 1, DAffine3::from_translation(DVec3::new(-2.7, 1.6, 1.0)));
        place(input, CUP, DAffine3::from_translation(DVec3::new(1.9, 1.4, -0.8)));
    });
}

/// No light reached the box's bottom, nor the floor below it.
#[test]
fn what_was_covered_gets_light() {
    let (_, mut solver) = moved(|input| place(input, BOX, DAffine3::from_translation(DVec3::new(0.0, 0.0, 0.7))));
    let [bottom, _] = solver.elements().surface_nodes[BOX.start];
    assert!(solver.exitant().irradiance[bottom as usize].min_element() > 0.0, "its bottom sees the floor");
    let whole = sides(&solved(&room()));
    solver.rearrange(&room(), &mut on).expect("where it was before");
    let off = difference(&sides(&solver), &whole);
    assert!(off < ERROR, "off by {off} when it is back");
}

/// Pairs of which nothing could be seen had no links.
#[test]
fn walls_that_are_taken_away_hide_nothing_any_more() {
    let wall = |input: &mut SceneInput, from: f64| {
        input.surfaces.push(quad(DVec3::new(from, 0.0, 0.0), DVec3::Y * 3.0, DVec3::Z * 2.5, 0));
    };
    let (mut divided, mut open) = (room(), room());
    divided.lights.clear();
    open.lights.clear();
    wall(&mut divided, 2.8);
    wall(&mut open, 4.0 + 1.5);
    let mut solver = solved(&divided);
    let ball = |solver: &Solver| solver.elements().surface_nodes[BALL][0];
    assert_eq!(ball(&solver), u32::MAX, "the ball is in the dark");
    solver.rearrange(&open, &mut on).expect("the wall has been taken away");
    assert_ne!(ball(&solver), u32::MAX, "the ball is lit");
    let off = difference(&sides(&solver), &sides(&solved(&open)));
    assert!(off < ERROR, "off by {off}");
}

#[test]
fn threads_change_nothing() {
    let mut input = room();
    place(&mut input, BOX, DAffine3::from_translation(DVec3::new(1.3, -0.6, 0.3)));
    let on_threads = |count: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads");
        pool.install(|| {
            let mut solver = crate::fixtures::solved(&room(), Settings::with_error(0.2));
            solver.rearrange(&input, &mut on).expect("a box in another place");
            solver.exitant().radiosity.iter().map(|rgb| rgb.to_array().map(f32::to_bits)).collect::<Vec<_>>()
        })
    };
    assert!(on_threads(1) == on_threads(3), "radiosities with 1 and 3 threads");
}

/// Whenever it is broken off, there is light, and it can be gone on with.
#[test]
fn stops_are_no_end() {
    let mut input = room();
    place(&mut input, BOX, DAffine3::from_translation(DVec3::new(1.3, -0.6, 0.3)));
    let fresh = sides(&solved(&input));
    let first = solved(&room()).stats().clone();
    for calls in [0, 1, 5, 20, 60] {
        let mut solver = solved(&room());
        let mut left = calls;
        let watch = &mut |_: &_| {
            left -= i32::from(left > 0);
            if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        solver.rearrange(&input, watch).expect("a box in another place");
        assert!(solver.stats().stopped, "{calls}: it was stopped");
        assert!(sides(&solver).iter().all(|(light, _)| light.is_finite()), "{calls}: there is light");
        solver.solve(&mut on);
        let off = difference(&sides(&solver), &fresh);
        assert!(off < ERROR && solver.stats().rays > first.rays, "{calls}: off by {off}");
    }
    let mut unsolved = Solver::new(&room(), Settings::with_error(ERROR), ()).expect("the room is sound");
    unsolved.rearrange(&input, &mut on).expect("before there is any light");
    let off = difference(&sides(&unsolved), &fresh);
    assert!(off < ERROR, "off by {off} where nothing was solved before");
}

/// The scene is as large as it was, for those who kept it.
#[test]
fn what_was_moved_can_be_kept() {
    let mut input = room();
    let mut solver = crate::fixtures::solved(&input, Settings::with_error(0.2));
    place(&mut input, CUP, DAffine3::from_translation(DVec3::X * 3.5));
    solver.rearrange(&input, &mut on).expect("a box beside the room");
    let solution = solver.finish(&mut on);
    let bytes = stored(&solution);
    let read = restored(&input, &bytes);
    assert_eq!(read.scene.surfaces(), solution.scene.surfaces(), "surfaces in unit space");
    for (at, way) in [(Vec3::splat(0.3), Vec3::X), (Vec3::new(0.6, 0.2, 0.5), Vec3::new(0.1, 0.3, -1.0))] {
        let [kept, made] = [&read, &solution].map(|it| it.scene.visibility.closest(at, way, 0.0, f32::MAX));
        assert!(made.is_some() && kept == made, "{kept:?} and {made:?} are met");
    }
    assert!(stored(&read) == bytes, "nothing was lost on the way");
}

#[test]
fn what_cannot_be_moved_is_refused() {
    let mut solver = crate::fixtures::solved(&room(), Settings::with_error(0.2));
    let (before, links) = (sides(&solver), solver.stats().links);
    type Change = (fn(&mut SceneInput), &'static str);
    let far = |far: f64| DAffine3::from_translation(DVec3::X * far);
    let cases: [Change; 12] = [
        (|input| input.surfaces.truncate(3), "added or removed"),
        (|input| input.surfaces[2].material = 1, "surface 2"),
        (|input| input.lights.clear(), "lights"),
        (|input| input.lights[0].position.x = f64::NAN, "position is not finite"),
        (|input| input.surfaces[BALL].shape = Shape::Sphere { center: DVec3::NAN, radius: 0.3 }, "surface 13"),
        (
            |input| input.surfaces[BALL].shape = Shape::Sphere { center: DVec3::ONE, radius: f64::INFINITY },
            "surface 13",
        ),
        (|input| input.surfaces[BALL].shape = Shape::Sphere { center: DVec3::ONE, radius: 0.0 }, "surface 13"),
        (|input| input.surfaces[BALL].shape = input.surfaces[0].shape.clone(), "another kind of shape"),
        (|input| input.surfaces[LAMP].shape = input.surfaces[BALL].shape.clone(), "another kind of shape"),
        (|input| input.surfaces[8].shape = input.surfaces[9].shape.clone(), "coincides"),
        (|input| place(input, BOX, DAffine3::from_scale(DVec3::INFINITY)), "surface 7"),
        (|input| place(input, BOX, DAffine3::from_translation(DVec3::X * 1e30)), "surface 7"),
    ];
    for (change, hint) in cases {
        let mut input = room();
        change(&mut input);
        let text = solver.rearrange(&input, &mut on).expect_err(hint).to_string();
        assert!(text.contains(hint), "{hint:?} is not in: {text}");
        assert_eq!(sides(&solver), before, "{hint}: nothing has changed");
    }
    let mut input = room();
    place(&mut input, CUP, far(8.0));
    let refused = solver.rearrange(&input, &mut on);
    assert!(matches!(refused, Err(SolveError::Edit { index: 15, .. })), "too far away: {refused:?}");
    solver.rearrange(&room(), &mut on).expect("all is where it was");
    let stats = solver.stats();
    assert_eq!((stats.kept_links, stats.renewed_links), (links, 0), "no link is concerned");
}

//! Closed rooms side by side: each is solved as it would be alone, however many there are.

use glam::{DVec3, Vec2};
use hr_diffuse::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solution, Solver, Surface};
use std::ops::ControlFlow;

const WALL: u32 = 0;
const WOOD: u32 = 1;
const LAMP: u32 = 2;
const BRIGHT: u32 = 3;
/// Size of a room, and what is between two.
const ROOM: DVec3 = DVec3::new(4.0, 3.0, 2.5);
const APART: f64 = 0.5;
/// Surfaces of a room.
const SURFACES: usize = 25;
/// Places along a side of a surface where solutions are compared.
const GRID: u32 = 6;

/// A box on the axes, seen from outside or from inside.
fn block(surfaces: &mut Vec<Surface>, low: DVec3, size: DVec3, material: u32, inside: bool) {
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let faces = [(low, y, x), (low + z, x, y), (low, x, z), (low + y, z, x), (low, z, y), (low + x, y, z)];
    for (corner, a, b) in faces {
        let (a, b) = if inside { (b, a) } else { (a, b) };
        surfaces.push(Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), material));
    }
}

/// So many rooms, all furnished alike, in rows of `across`. The lamp of the first one is `first` times as bright as the others.
fn rooms(count: usize, across: usize, first: f32) -> SceneInput {
    let mut surfaces = Vec::new();
    for room in 0..count {
        let place = DVec3::new((room % across) as f64, (room / across) as f64, 0.0);
        let at = place * (ROOM + APART);
        block(&mut surfaces, at, ROOM, WALL, true);
        let lamp = at + DVec3::new(1.6, 1.2, 2.45);
        let corners = [lamp, lamp + DVec3::Y * 0.5, lamp + DVec3::new(0.8, 0.5, 0.0), lamp + DVec3::X * 0.8];
        surfaces.push(Surface::new(Shape::Quad(corners), if room == 0 { BRIGHT } else { LAMP }));
        block(&mut surfaces, at + DVec3::new(0.5, 0.5, 0.02), DVec3::new(0.8, 0.6, 1.4), WOOD, false);
        block(&mut surfaces, at + DVec3::new(2.4, 1.8, 0.6), DVec3::new(1.2, 0.8, 0.1), WOOD, false);
        block(&mut surfaces, at + DVec3::new(2.8, 0.4, 0.02), DVec3::new(0.5, 0.5, 0.5), WOOD, false);
    }
    let material = |reflectance, exitance| DiffuseMaterial { reflectance, exitance, two_sided: false };
    let lamp = material(Rgb::ZERO, Rgb::new(10.0, 9.0, 7.0));
    let bright = DiffuseMaterial { exitance: lamp.exitance * first, ..lamp };
    let materials =
        vec![material(Rgb::splat(0.7), Rgb::ZERO), material(Rgb::new(0.5, 0.3, 0.2), Rgb::ZERO), lamp, bright];
    SceneInput { surfaces, materials, ..SceneInput::default() }
}

fn solve(input: &SceneInput, error: f32) -> Solution {
    let mut solver = Solver::new(input, Settings::with_error(error), ()).expect("the scene is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.finish(&mut |_| ControlFlow::Break(()))
}

/// Irradiance (sum of channels) all over the surfaces of a room, with the area and reflectance that it counts by.
fn looks(solution: &Solution, room: usize) -> Vec<(f32, f32)> {
    let mut looks = Vec::new();
    for surface in room * SURFACES..(room + 1) * SURFACES {
        let node = solution.elements.surface_nodes[surface][0];
        if node == u32::MAX {
            continue;
        }
        let element = &solution.elements.nodes[node as usize];
        for cell in 0..GRID * GRID {
            let uv = (Vec2::new((cell % GRID) as f32, (cell / GRID) as f32) + 0.5) / GRID as f32;
            let leaf =
                solution.elements.leaf_at(&solution.scene, surface as u32, false, uv).expect("it has an element");
            let irradiance = solution.exitant.irradiance[leaf.index()].element_sum();
            looks.push((irradiance, element.reflectance.max_element() * element.area));
        }
    }
    looks
}

/// Relative L1 error of a room, all of whose light is `times` as much as in an exact solution.
fn off(solution: &Solution, room: usize, exact: &[(f32, f32)], times: f32) -> f32 {
    let found = looks(solution, room);
    assert_eq!(found.len(), exact.len(), "the same sides have elements");
    let (mut off, mut all) = (0.0, 0.0);
    for ((found, _), (exact, weight)) in found.into_iter().zip(exact) {
        off += (found - times * exact).abs() * weight;
        all += times * exact * weight;
    }
    off / all
}

/// An exact solution of one room: a much finer one.
fn exact() -> Vec<(f32, f32)> {
    looks(&solve(&rooms(1, 1, 1.0), 0.01), 0)
}

#[test]
fn a_room_among_many_is_solved_as_if_it_were_alone() {
    const ERROR: f32 = 0.05;
    let (exact, alone) = (exact(), solve(&rooms(1, 1, 1.0), ERROR));
    let alone_off = off(&alone, 0, &exact, 1.0);
    // In a square, and in a row.
    for (count, across) in [(16, 4), (9, 9)] {
        let among = solve(&rooms(count, across, 1.0), ERROR);
        let counted = [
            ("leaves", among.stats.leaves, alone.stats.leaves),
            ("links", among.stats.links, alone.stats.links),
            ("rays", among.stats.rays, alone.stats.rays),
            ("pairs", among.stats.pairs, alone.stats.pairs),
        ];
        for (what, among, alone) in counted {
            let ratio = among as f32 / (count as f32 * alone as f32);
            assert!((ratio - 1.0).abs() < 0.15, "{what}: {ratio} times as many for each of {count} rooms as for one");
        }
        let offs: Vec<f32> = (0..count).map(|room| off(&among, room, &exact, 1.0)).collect();
        let mean = offs.iter().sum::<f32>() / count as f32;
        let worst = offs.iter().copied().fold(0.0, f32::max);
        assert!((mean / alone_off - 1.0).abs() < 0.1, "off by {mean} on average, alone by {alone_off}");
        assert!(worst < 1.2 * alone_off, "one is off by {worst}, alone by {alone_off}");
        let found = among.stats.error.expect("rays have looked");
        assert!(found < ERROR, "rays find an error of {found}");
    }
}

#[test]
fn a_bright_room_leaves_the_others_as_exact() {
    let exact = exact();
    let alone = off(&solve(&rooms(1, 1, 1.0), 0.05), 0, &exact, 1.0);
    let solution = solve(&rooms(16, 4, 10.0), 0.05);
    let bright = off(&solution, 0, &exact, 10.0);
    assert!(bright < 0.6 * alone, "most of the light is better known: {bright}, alone {alone}");
    for room in 1..16 {
        let dim = off(&solution, room, &exact, 1.0);
        // On average 1.24 times, and 1.31 for the worst of them.
        assert!(dim < 1.35 * alone, "room {room} is off by {dim}, alone {alone}");
    }
}

#[test]
fn rooms_are_the_same_for_any_number_of_threads() {
    let solved = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads");
        pool.install(|| solve(&rooms(4, 2, 3.0), 0.1))
    };
    let one = solved(1);
    for threads in [2, 7] {
        let other = solved(threads);
        assert_eq!(one.exitant.irradiance, other.exitant.irradiance, "{threads} threads");
        assert_eq!(one.links.all(), other.links.all(), "{threads} threads");
    }
}

//! A dim room beside a bright one is solved as well as it can be seen, and no light leaks into it.

use crate::fixtures::{lamp, paint, quad};
use glam::{DVec3, Vec2};
use hr_diffuse::{Rgb, SceneInput, Settings, Solution, Solver, Surface};
use std::ops::ControlFlow;

/// Points of each side of a surface, per axis.
const POINTS: u32 = 24;

/// A box seen from outside, without its bottom.
fn chest(at: DVec3, size: DVec3) -> Vec<Surface> {
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    vec![
        quad(at + z, x, y, 0),
        quad(at, x, z, 0),
        quad(at + x, y, z, 0),
        quad(at + x + y, -x, z, 0),
        quad(at + y, -y, z, 0),
    ]
}

/// Two rooms of 4 × 4 × 2.6 m, a lamp at the ceiling of the first, a door between them, a chest in the second. The last five surfaces are
/// what there is of the second room's floor, its walls and its ceiling.
fn rooms() -> SceneInput {
    let (y, z) = (DVec3::Y * 4.0, DVec3::Z * 2.6);
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    // Both sides of the wall between them, with a hole of 0.9 × 2 m.
    let mut surfaces = vec![
        quad(at(4.0, 0.0, 0.0), DVec3::Y * 1.2, z, 0),
        quad(at(4.0, 2.1, 0.0), DVec3::Y * 1.9, z, 0),
        quad(at(4.0, 1.2, 2.0), DVec3::Y * 0.9, DVec3::Z * 0.6, 0),
        quad(at(1.7, 1.7, 2.58), DVec3::Y * 0.6, DVec3::X * 0.6, 1),
    ];
    surfaces.extend(chest(at(5.4, 2.4, 0.0), at(1.2, 0.7, 0.8)));
    for left in [0.0, 4.0] {
        let (corner, x) = (DVec3::X * left, DVec3::X * 4.0);
        let outer = if left > 0.0 { quad(corner + x, y, z, 0) } else { quad(corner, y, z, 0) };
        surfaces.extend([quad(corner, x, y, 0), quad(corner + z, y, x, 0), outer]);
        surfaces.extend([quad(corner, z, x, 0), quad(corner + y, x, z, 0)]);
    }
    SceneInput { surfaces, materials: vec![paint(Rgb::splat(0.6)), lamp(Rgb::splat(100.0))], ..SceneInput::default() }
}

fn solve(input: &SceneInput, error: f32) -> Solution {
    let mut solver = Solver::new(input, Settings::with_error(error), ()).expect("the rooms are sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.finish(&mut |_| ControlFlow::Continue(()))
}

/// What is shown at points of the last so many surfaces.
fn shown(solution: &Solution, count: usize) -> Vec<f32> {
    let surfaces = solution.scene.surfaces().len();
    let mut shown = Vec::new();
    for surface in surfaces - count..surfaces {
        for back in [false, true] {
            for i in 0..POINTS * POINTS {
                let uv = Vec2::new((i % POINTS) as f32 + 0.5, (i / POINTS) as f32 + 0.5) / POINTS as f32;
                if let Some(leaf) = solution.elements.leaf_at(&solution.scene, surface as u32, back, uv) {
                    shown.push(solution.irradiance(leaf, uv).x);
                }
            }
        }
    }
    shown
}

#[test]
fn a_dim_room_has_its_shadows() {
    let input = rooms();
    let [found, truth] = [0.1, 0.01].map(|error| shown(&solve(&input, error), 5));
    let off: f32 = found.iter().zip(&truth).map(|(found, truth)| (found - truth).abs()).sum();
    let all: f32 = truth.iter().sum();
    assert!(off < 0.06 * all, "{} of the light of the dim room", off / all);
}

//! Rooms that are lit through a small window and by nothing else: few rays find it.

use crate::fixtures::{lamp, paint, quad};
use glam::{DVec3, Vec3};
use hr_diffuse::{DiffuseMaterial, Light, LightKind, Rgb, SceneInput, Settings, Solver, Surface};
use std::ops::ControlFlow;

const REFLECTANCE: f32 = 0.5;
/// The lower left corner of the window, in the wall at y = 0.
const CORNER: [f64; 2] = [1.3, 0.8];

/// A room of 4 × 4 × 3 m, seen from inside, with a square window.
fn room(side: f64) -> Vec<Surface> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let [left, low] = CORNER;
    let piece = |x0: f64, x1: f64, z0: f64, z1: f64| quad(DVec3::new(x0, 0.0, z0), z * (z1 - z0), x * (x1 - x0), 0);
    vec![
        quad(DVec3::ZERO, x * 4.0, y * 4.0, 0),
        quad(z * 3.0, y * 4.0, x * 4.0, 0),
        quad(DVec3::ZERO, y * 4.0, z * 3.0, 0),
        quad(x * 4.0, z * 3.0, y * 4.0, 0),
        quad(y * 4.0, x * 4.0, z * 3.0, 0),
        piece(0.0, left, 0.0, 3.0),
        piece(left + side, 4.0, 0.0, 3.0),
        piece(left, left + side, 0.0, low),
        piece(left, left + side, low + side, 3.0),
    ]
}

/// Power that the room's surfaces absorb: all that comes in by the window, but for the little that leaves by it.
fn absorbed(surfaces: Vec<Surface>, lights: Vec<Light>) -> f64 {
    let wall = DiffuseMaterial { two_sided: false, ..paint(Rgb::splat(REFLECTANCE)) };
    let input = SceneInput { surfaces, materials: vec![wall, lamp(Rgb::ONE)], lights, ..SceneInput::default() };
    let mut solver = Solver::new(&input, Settings::with_error(0.05), ()).expect("the room is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    let (elements, nodes) = (solver.elements(), &solver.elements().nodes);
    let of_room = |leaf: &u32| nodes[*leaf as usize].material == 0;
    let power = |leaf: u32| f64::from(nodes[leaf as usize].area * solver.exitant().irradiance[leaf as usize].x);
    let all: f64 = elements.patch_leaves().filter(of_room).map(power).sum();
    // The floor has 16 m², in unit space something else.
    let floor = elements.surface_nodes[0][0];
    assert!(floor != u32::MAX, "the room is taken for one that no light reaches");
    all * f64::from(1.0 - REFLECTANCE) * 16.0 / f64::from(nodes[floor as usize].area)
}

#[track_caller]
fn assert_lit(what: &str, side: f64, found: f64, comes_in: f64) {
    // Of what comes in by a window of 1 m a fiftieth leaves by it.
    assert!((found / comes_in - 1.0).abs() < 0.06, "{what}, a window of {side} m: {found} W of {comes_in}");
}

#[test]
fn the_sun_comes_in() {
    let direction = Vec3::new(0.1, 0.7, -0.5).normalize();
    for side in [1.0, 0.5, 0.2, 0.1] {
        let kind = LightKind::Directional { direction };
        let sun = Light { position: DVec3::ZERO, intensity: Rgb::ONE, kind };
        assert_lit("the sun", side, absorbed(room(side), vec![sun]), f64::from(direction.y) * side * side);
    }
}

#[test]
fn a_lantern_shines_in() {
    let position = DVec3::new(1.5, -5.0, 4.0);
    for side in [1.0, 0.5, 0.2] {
        let lantern = Light { position, intensity: Rgb::splat(30.0), kind: LightKind::Point };
        let [x, z] = CORNER.map(|corner| corner + 0.5 * side);
        let away = DVec3::new(x, 0.0, z) - position;
        let comes_in = 30.0 * away.y / away.length().powi(3) * side * side;
        assert_lit("a lantern", side, absorbed(room(side), vec![lantern]), comes_in);
    }
}

/// A panel that shines down outside: of what it sends next to nothing comes to the window.
#[test]
fn a_sky_shines_in() {
    let (low, size) = (DVec3::new(-4.0, -8.0, 6.0), DVec3::new(12.0, 7.0, 0.0));
    for side in [1.0, 0.5] {
        let mut surfaces = room(side);
        surfaces.push(quad(low, DVec3::Y * size.y, DVec3::X * size.x, 1));
        let [x, z] = CORNER.map(|corner| corner + 0.5 * side);
        let middle = DVec3::new(x, 0.0, z);
        let n = 200;
        let part = |i: i32| {
            let at = DVec3::new(f64::from(i % n) + 0.5, f64::from(i / n) + 0.5, 0.0) / f64::from(n);
            let away = middle - (low + at * size);
            away.y * -away.z / (std::f64::consts::PI * away.length_squared().powi(2))
        };
        let irradiance = (0..n * n).map(part).sum::<f64>() * size.x * size.y / f64::from(n * n);
        assert_lit("a sky", side, absorbed(surfaces, Vec::new()), irradiance * side * side);
    }
}

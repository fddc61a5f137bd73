//! Contact shadows: what stands on something is dark where it stands.

use crate::fixtures::{lamp, on, paint, quad, solved, walls};
use crate::paths::Paths;
use glam::{DVec3, Vec3};
use hr_diffuse::{Rgb, SceneInput, Settings, Shape, Solution, Surface};
use std::f64::consts::{PI, TAU};

const RADIUS: f64 = 0.5;
const REFLECTANCE: f32 = 0.5;
/// Where the ball stands.
const FOOT: DVec3 = DVec3::new(2.0, 1.5, 0.0);
const LAMP: u32 = 6;

/// A ball of triangles.
fn mesh() -> Vec<Surface> {
    const CIRCLES: u32 = 24;
    let at = |i: u32, j: u32| {
        let (polar, around) = (f64::from(i) / f64::from(CIRCLES) * PI, f64::from(j) / f64::from(CIRCLES) * PI);
        let radial = DVec3::new(around.cos(), around.sin(), 0.0) * polar.sin();
        FOOT + RADIUS * (DVec3::Z + radial - polar.cos() * DVec3::Z)
    };
    let mut surfaces = Vec::new();
    for (i, j) in (0..CIRCLES).flat_map(|i| (0..2 * CIRCLES).map(move |j| (i, j))) {
        let next = (j + 1) % (2 * CIRCLES);
        let [a, b, c, d] = [at(i, j), at(i, next), at(i + 1, next), at(i + 1, j)];
        surfaces.extend((i > 0).then(|| Surface::new(Shape::Triangle([a, b, c]), 0)));
        surfaces.extend((i + 1 < CIRCLES).then(|| Surface::new(Shape::Triangle([a, c, d]), 0)));
    }
    surfaces
}

/// A room whose ceiling shines, with a ball in it.
fn solution(ball: Vec<Surface>) -> Solution {
    let ceiling = quad(DVec3::new(0.0, 0.0, 2.49), DVec3::Y * 3.0, DVec3::X * 4.0, 1);
    let surfaces = walls(0, 0, 0).into_iter().chain([ceiling]).chain(ball).collect();
    let materials = vec![paint(Rgb::splat(REFLECTANCE)), lamp(Rgb::ONE)];
    let input = SceneInput { surfaces, materials, ..SceneInput::default() };
    solved(&input, Settings::with_error(0.1)).finish(&mut on)
}

/// Irradiance of the floor around the foot of the ball, at a distance from it: of the solution, and by many random paths.
fn around(solution: &Solution, distance: f64) -> [f32; 2] {
    const PLACES: u32 = 12;
    const PATHS: u32 = 4000;
    let mut paths = Paths::new(solution, LAMP, REFLECTANCE);
    let (mut ours, mut found) = (0.0, 0.0);
    for place in 0..PLACES {
        let angle = TAU * (f64::from(place) + 0.3) / f64::from(PLACES);
        let at = FOOT + distance * DVec3::new(angle.cos(), angle.sin(), 0.0);
        let down = paths.meets(at + 1e-3 * DVec3::Z, Vec3::NEG_Z).expect("there is the floor");
        let leaf = solution.leaf(&down).expect("it reflects");
        ours += solution.irradiance(leaf, down.uv).x;
        found += paths.irradiance(&down, PATHS);
    }
    [ours, found].map(|sum| sum / PLACES as f32)
}

/// Light that leaves found out about while it was still bright where the ball stands is not kept.
#[test]
fn it_is_dark_where_a_ball_stands() {
    let whole = Surface::new(Shape::Sphere { center: FOOT + DVec3::Z * RADIUS, radius: RADIUS }, 0);
    for (what, ball, most) in [("whole", vec![whole], 0.18), ("mesh", mesh(), 0.04)] {
        let solution = solution(ball);
        let open = around(&solution, 1.2)[1];
        let all = [0.05, 0.1, 0.15, 0.2, 0.3].map(|distance| around(&solution, distance));
        let off = all.iter().map(|[ours, right]| (ours - right).abs()).sum::<f32>() / all.len() as f32;
        assert!(off < most * open, "{what}: off by {:.3} of what there is beside: {all:?}", off / open);
        assert!(solution.stats.renewed_places > 0, "{what}: some looked again");
    }
}

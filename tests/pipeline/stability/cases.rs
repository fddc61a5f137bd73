//! Scenes that are hard on purpose, and what is known of the light in them.

use crate::scenes::{quad, walls};
use glam::DVec3;
use hr_diffuse::{DiffuseMaterial, Light, LightKind, Rgb, SceneInput, Shape, Surface};
use std::f64::consts::PI;

/// A scene and what is known of it.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) input: SceneInput,
    /// Surfaces whose fronts' mean irradiance is known (W/m²).
    pub(crate) irradiance: Vec<(usize, f64)>,
    /// Most that any surface's front sends (W/m²).
    pub(crate) most: f64,
    /// Relative error that the known values are met with.
    pub(crate) tolerance: f64,
}

/// Walls of exitance 1 that reflect this share of light.
const GREY: f32 = 0.5;

fn grey(two_sided: bool) -> DiffuseMaterial {
    DiffuseMaterial { reflectance: Rgb::splat(GREY), exitance: Rgb::ZERO, two_sided }
}

/// What emits 1 W/m² and reflects `reflectance`.
pub(crate) fn glowing(reflectance: f32) -> DiffuseMaterial {
    DiffuseMaterial { reflectance: Rgb::splat(reflectance), exitance: Rgb::ONE, two_sided: false }
}

/// A closed room in which all surfaces emit 1 W/m² and reflect alike: whatever else is in it, each surface that sees
/// the room sends 1/(1 − ρ) and receives the same.
fn furnace(name: &'static str, things: Vec<Surface>, known: impl IntoIterator<Item = usize>, tolerance: f64) -> Case {
    let mut surfaces = walls(DVec3::ZERO, DVec3::ONE, 0);
    surfaces.extend(things);
    let exact = 1.0 / (1.0 - f64::from(GREY));
    Case {
        name,
        irradiance: (0..6).chain(known).map(|surface| (surface, exact)).collect(),
        input: SceneInput { surfaces, materials: vec![glowing(GREY)], ..SceneInput::default() },
        most: exact,
        tolerance,
    }
}

/// The unit square that looks up, on `z`.
fn floor(z: f64, material: u32) -> Surface {
    quad(DVec3::Z * z, DVec3::X, DVec3::Y, material)
}

/// The unit square that looks down, on `z`.
pub(crate) fn ceiling(z: f64, material: u32) -> Surface {
    quad(DVec3::Z * z, DVec3::Y, DVec3::X, material)
}

/// Unit squares that face each other at distance 1 (E. Sparrow and R. Cess, Radiation Heat Transfer, 1978; a = b = c).
pub(crate) const PARALLEL: f64 = 0.199_825;
/// Unit squares at a right angle with a common edge (the same source, w = h = 1).
const PERPENDICULAR: f64 = 0.200_044;

/// A black lamp of exitance 1 (material 1) and grey surfaces (material 0) that look at it.
fn lit(name: &'static str, surfaces: Vec<Surface>, irradiance: Vec<(usize, f64)>, tolerance: f64) -> Case {
    let materials = vec![grey(false), glowing(0.0), grey(true)];
    Case { name, input: SceneInput { surfaces, materials, ..SceneInput::default() }, irradiance, most: 1.0, tolerance }
}

/// A box's walls, seen from outside.
fn solid(low: DVec3, high: DVec3) -> Vec<Surface> {
    let mut walls = walls(low, high, 0);
    walls.iter_mut().for_each(|wall| wall.flip = true);
    walls
}

fn sphere(center: DVec3, radius: f64) -> Surface {
    Surface::new(Shape::Sphere { center, radius }, 0)
}

/// A strip of the floor as a rectangle and as two triangles, and both as slivers: 1 long, 1e-6 wide.
fn slivers() -> Vec<Surface> {
    const WIDTH: f64 = 1e-6;
    let at = |x: f64, y: f64| DVec3::new(x, y, 0.5);
    let triangle = |a, b, c| Surface::new(Shape::Triangle([a, b, c]), 0);
    let (x, end) = (0.5, 0.5 + WIDTH);
    vec![
        quad(at(0.3, 0.1), DVec3::X * WIDTH, DVec3::Y * 0.8, 0),
        triangle(at(x, 0.1), at(end, 0.1), at(end, 0.9)),
        triangle(at(x, 0.1), at(end, 0.9), at(x, 0.9)),
        // Needles: all three corners on nearly one line, the short side in the middle.
        triangle(at(0.7, 0.1), at(0.7 + WIDTH, 0.5), at(0.7, 0.9)),
    ]
}

/// The floor in `n` × `n` squares that overlap their neighbours by `overlap` of their side.
fn tiles(n: u32, overlap: f64) -> Vec<Surface> {
    let step = 1.0 / f64::from(n);
    let tile = |i: u32| {
        let corner = DVec3::new(f64::from(i % n), f64::from(i / n), 0.0) * step;
        let side = |at: f64| (step * (1.0 + overlap)).min(1.0 - at);
        quad(corner, DVec3::X * side(corner.x), DVec3::Y * side(corner.y), 0)
    };
    (0..n * n).map(tile).collect()
}

/// All cases.
pub(crate) fn all() -> Vec<Case> {
    let middle = DVec3::splat(0.5);
    let doubled: Vec<Surface> = walls(DVec3::ZERO, DVec3::ONE, 0);
    let crossing = [solid(DVec3::new(0.2, 0.2, 0.2), DVec3::new(0.5, 0.6, 0.7)), vec![sphere(middle, 0.25)]].concat();
    let stacked = [
        solid(DVec3::new(0.25, 0.25, 0.0), DVec3::new(0.5, 0.75, 0.5)),
        solid(DVec3::new(0.5, 0.25, 0.0), DVec3::new(0.75, 0.75, 0.5)),
    ]
    .concat();
    let cover = solid(DVec3::new(0.25, 0.25, 0.0), DVec3::new(0.75, 0.75, 0.25));
    let point = Light { position: middle, intensity: Rgb::splat(3.0), kind: LightKind::Point };
    // A sixth of all its light goes to each wall; nothing comes back from them.
    let mut candle = lit("a point light in a black box", walls(DVec3::ZERO, DVec3::ONE, 0), Vec::new(), 0.02);
    candle.input.lights.push(point);
    candle.input.materials[0].reflectance = Rgb::splat(1e-3);
    candle.irradiance = (0..6).map(|wall| (wall, 3.0 * 4.0 * PI / 6.0)).collect();
    let perpendicular = vec![floor(0.0, 0), quad(DVec3::ZERO, DVec3::Y, DVec3::Z, 1)];
    let both = vec![floor(0.0, 2), ceiling(1.0, 1), floor(-1.0, 1)];
    vec![
        furnace("an empty furnace", Vec::new(), [], 0.01),
        furnace("a furnace of doubled walls", doubled, 6..12, 0.01),
        furnace("slivers in a furnace", slivers(), 6..10, 0.08),
        furnace("a box and a sphere that cross", crossing, [], 0.15),
        furnace("boxes that touch, and stand on the floor", stacked, [], 0.08),
        furnace("a box whose bottom lies on the floor", cover, [], 0.08),
        furnace("a sphere", vec![sphere(middle, 0.3)], [6], 0.08),
        furnace("two plates back to back", vec![floor(0.5, 0), ceiling(0.5, 0)], [], 0.05),
        lit("parallel plates", vec![floor(0.0, 0), ceiling(1.0, 1)], vec![(0, PARALLEL)], 0.02),
        lit("perpendicular plates that touch", perpendicular, vec![(0, PERPENDICULAR)], 0.02),
        lit("a lamp behind", vec![floor(0.0, 0), ceiling(-1.0, 1), floor(2.0, 1)], vec![(0, 0.0)], 0.0),
        lit("a two-sided plate between two lamps", both, vec![(0, PARALLEL)], 0.02),
        lit("a doubled lamp", vec![floor(0.0, 0), ceiling(1.0, 1), ceiling(1.0, 1)], vec![(0, PARALLEL)], 0.02),
        lit(
            "a doubled plate",
            vec![floor(0.0, 0), floor(0.0, 0), ceiling(1.0, 1)],
            vec![(0, PARALLEL), (1, PARALLEL)],
            0.02,
        ),
        candle,
    ]
    .into_iter()
    .map(|case| case.trimmed())
    .chain([tiled_lamp(), tiled_furnace("touching tiles", 0.0), tiled_furnace("overlapping tiles", 0.5)])
    .collect()
}

impl Case {
    /// What touches the walls hides part of them, so that their means are not known.
    fn trimmed(mut self) -> Self {
        if self.name.contains("floor") {
            self.irradiance.retain(|(surface, _)| *surface != 4);
        }
        if self.name.contains("back to back") {
            self.irradiance.clear();
            let exact = 1.0 / (1.0 - f64::from(GREY));
            self.irradiance.extend([4, 5, 6, 7].map(|surface| (surface, exact)));
        }
        self
    }
}

/// A glowing floor of black tiles, and a grey ceiling that receives what one large tile would send.
fn tiled_lamp() -> Case {
    let mut surfaces = vec![ceiling(1.0, 0)];
    surfaces.extend(tiles(4, 0.0).into_iter().map(|tile| Surface { material: 1, ..tile }));
    lit("a lamp of touching tiles", surfaces, vec![(0, PARALLEL)], 0.02)
}

/// A furnace whose floor is made of tiles.
fn tiled_furnace(name: &'static str, overlap: f64) -> Case {
    let mut case = furnace(name, tiles(4, overlap), [], 0.05);
    case.input.surfaces.remove(4);
    case.irradiance = (0..5).map(|surface| (surface, case.most)).collect();
    case
}

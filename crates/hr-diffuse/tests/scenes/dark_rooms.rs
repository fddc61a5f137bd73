//! Two rooms, and a door that is ajar between them: light comes into the second by a gap, off what is lit in the first. Floor, ceiling and two
//! of the walls go on from one to the other.

use crate::fixtures::{ceiling_lamp, lamp, on, paint, quad, solved};
use crate::paths::Paths;
use glam::{DVec3, Vec3};
use hr_diffuse::{Rgb, SceneInput, Settings};

const REFLECTANCE: f32 = 0.6;
/// Where the dark room begins, and where it ends.
const FROM: f64 = 4.0;
const TO: f64 = 7.0;
const LAMP: u32 = 0;

fn rooms() -> SceneInput {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    let (o, length, depth, height) = (DVec3::ZERO, TO * x, 3.0 * y, 2.5 * z);
    let between = FROM * x;
    let surfaces = vec![
        ceiling_lamp(1),
        quad(o, length, depth, 0),
        quad(o + height, depth, length, 0),
        quad(o, depth, height, 0),
        quad(o + length, height, depth, 0),
        quad(o, height, length, 0),
        quad(o + depth, length, height, 0),
        quad(between, y, height, 0),
        quad(between + 2.0 * y, y, height, 0),
        quad(between + y + 2.0 * z, y, 0.5 * z, 0),
        quad(between + y, 0.2 * x + 0.98 * y, 2.0 * z, 0),
    ];
    let materials = vec![paint(Rgb::splat(REFLECTANCE)), lamp(Rgb::ONE)];
    SceneInput { surfaces, materials, ..SceneInput::default() }
}

/// Who stands in the dark room sees nothing else. It has a five-hundredth of the light; leaves on both sides of the wall made it 4.6 times as
/// bright.
#[test]
fn little_light_comes_through_a_gap() {
    const PLACES: u32 = 200;
    const PATHS: u32 = 20_000;
    let solution = solved(&rooms(), Settings::with_error(0.05)).finish(&mut on);
    let mut paths = Paths::new(&solution, LAMP, REFLECTANCE);
    let (mut ours, mut right) = (0.0, 0.0);
    for _ in 0..PLACES {
        let [a, b, c] = [0; 3].map(|_| paths.random());
        // From the middle of the room to all around.
        let (height, around) = (2.0 * a - 1.0, b * std::f32::consts::TAU);
        let flat = (1.0 - height * height).sqrt();
        let toward = Vec3::new(flat * around.cos(), flat * around.sin(), height);
        let from = DVec3::new(FROM + (0.3 + 0.6 * f64::from(c)) * (TO - FROM), 0.5, 1.25);
        let place = paths.meets(from, toward).expect("there are walls");
        let leaf = solution.leaf(&place).expect("they reflect");
        ours += solution.irradiance(leaf, place.uv).x;
        right += paths.irradiance(&place, PATHS);
    }
    let times = ours / right;
    assert!((0.6..1.7).contains(&times), "{times:.2} times as bright as it is: {ours} of {right}");
}

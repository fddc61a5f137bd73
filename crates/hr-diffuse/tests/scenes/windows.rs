//! Rooms that are lit through a small window and by nothing else: few rays find it.

use crate::fixtures::{lamp, paint, quad};
use glam::{DVec2, DVec3, Vec3};
use hr_diffuse::hierarchy::Kind;
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

fn solved(surfaces: Vec<Surface>, lights: Vec<Light>) -> Solver {
    let wall = DiffuseMaterial { two_sided: false, ..paint(Rgb::splat(REFLECTANCE)) };
    let materials = vec![wall, lamp(Rgb::ONE), paint(Rgb::ZERO)];
    let input = SceneInput { surfaces, materials, lights, ..SceneInput::default() };
    let mut solver = Solver::new(&input, Settings::with_error(0.05), ()).expect("the room is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver
}

/// Power that the room's surfaces absorb: all that comes in by the window, but for the little that leaves by it.
fn absorbed(surfaces: Vec<Surface>, lights: Vec<Light>) -> f64 {
    absorbed_in(&solved(surfaces, lights))
}

fn absorbed_in(solver: &Solver) -> f64 {
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
        let solver = solved(room(side), vec![lantern]);
        assert_lit("a lantern", side, absorbed_in(&solver), comes_in);
        // Rays seldom find the one bright spot there is, and do not take that for an error.
        let found = solver.stats().error;
        assert!(found.is_some_and(|error| error <= 0.05), "a window of {side} m: {found:?}");
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

/// A sky in front of the window, and black slats between. Of most pairs of a part of the room and one of the sky little is seen: were leaves to
/// look for themselves where segments found that much is, and not where they found that nothing is, light would be lost.
#[test]
fn a_sky_shines_in_through_a_blind() {
    const SLATS: u32 = 9;
    let (side, low, size) = (1.0, DVec3::new(-1.0, -2.0, -1.0), DVec3::new(6.0, 0.0, 5.0));
    let [left, sill] = CORNER;
    // From the lower, inner edge of a slat to its upper, outer one: y and z.
    let slat = |k: u32| {
        let z = sill + side * f64::from(k) / f64::from(SLATS);
        [DVec2::new(-0.01, z), DVec2::new(-0.06, z + 0.6 * side / f64::from(SLATS))]
    };
    let slats = (0..SLATS).map(slat).map(|[inner, outer]| {
        let along = DVec3::new(0.0, outer.x - inner.x, outer.y - inner.y);
        quad(DVec3::new(left - 1.0, inner.x, inner.y), DVec3::X * (side + 2.0), along, 2)
    });
    let mut surfaces = room(side);
    surfaces.extend(slats);
    surfaces.push(quad(low, DVec3::Z * size.z, DVec3::X * size.x, 1));
    let is_free = |from: DVec2, to: DVec2| {
        (0..SLATS).map(slat).all(|[a, b]| {
            let (d, e) = (to - from, b - a);
            let (t, u) = ((a - from).perp_dot(e) / d.perp_dot(e), (a - from).perp_dot(d) / d.perp_dot(e));
            !((0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u))
        })
    };
    let n = 400_000;
    let pair = |i: u32| {
        let u = hr_diffuse::sampling::point4(7, i).as_dvec4();
        let sky = low + DVec3::new(size.x * u.x, 0.0, size.z * u.y);
        let pane = DVec3::new(left + side * u.z, 0.0, sill + side * u.w);
        let (away, flat) = (pane - sky, |at: DVec3| DVec2::new(at.y, at.z));
        let seen = if is_free(flat(sky), flat(pane)) { 1.0 } else { 0.0 };
        seen * away.y * away.y / (std::f64::consts::PI * away.length_squared().powi(2))
    };
    let comes_in = (0..n).map(pair).sum::<f64>() / f64::from(n) * size.x * size.z * side * side;
    let share = absorbed(surfaces, Vec::new()) / comes_in;
    // It was 0.95.
    assert!((share - 1.0).abs() < 0.025, "{share} of what comes in");
}

/// The sky lights the outer sides of walls by tens of times what comes in. Nothing else is lit by them, so that they do not tell how finely
/// the room is to be solved.
#[test]
fn outer_walls_shine_in_vain() {
    let leaves_within = |two_sided| {
        let mut surfaces = room(0.5);
        surfaces.push(quad(DVec3::new(-1.0, -2.0, -1.0), DVec3::Z * 5.0, DVec3::X * 6.0, 1));
        let wall = DiffuseMaterial { two_sided, ..paint(Rgb::splat(REFLECTANCE)) };
        let input = SceneInput { surfaces, materials: vec![wall, lamp(Rgb::ONE)], ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.05), ()).expect("the room is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let nodes = &solver.elements().nodes;
        solver.elements().patch_leaves().filter(|&leaf| nodes[leaf as usize].kind == Kind::Front).count()
    };
    let [alone, outer_walls] = [false, true].map(leaves_within);
    // There was a seventh when they told.
    assert!(10 * outer_walls > 7 * alone, "{alone} leaves, {outer_walls} where outer walls reflect");
}

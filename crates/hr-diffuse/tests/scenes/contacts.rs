//! Contacts: light ends at the line in which one surface stands on another.

use glam::{DVec2, DVec3, Vec2};
use hr_diffuse::{DiffuseMaterial, Light, LightKind, Rgb, SceneInput, Settings, Shape, Solution, Solver, Surface};
use std::ops::ControlFlow;

/// Side of the wall, which stands in the plane y = 0.
const SIDE: f64 = 2.0;
/// How far the shelf reaches out: one that hides half of the wall, and the frame of a picture.
const DEPTH: f64 = 0.3;
const FRAME: f64 = 0.02;
const BULB: DVec3 = DVec3::new(1.1, 0.6, 3.0);
/// The ends of the shelf, along the wall; the last is next to the wall's upper edge.
const SHELVES: [[DVec2; 2]; 3] = [
    [DVec2::new(0.3, 1.13), DVec2::new(1.7, 1.13)],
    [DVec2::new(0.35, 0.9), DVec2::new(1.6, 1.35)],
    [DVec2::new(0.3, 1.93), DVec2::new(1.7, 1.93)],
];

/// A wall with a black shelf on it or before it, which begins and ends so far from it; a bulb above.
fn solution([a, b]: [DVec2; 2], [near, far]: [f64; 2], error: f32) -> Solution {
    let at = |p: DVec2, y: f64| DVec3::new(p.x, y, p.y);
    let (x, z) = (DVec3::X * SIDE, DVec3::Z * SIDE);
    let wall = Shape::Quad([DVec3::ZERO, z, z + x, x]);
    let shelf = Shape::Quad([at(a, near), at(b, near), at(b, far), at(a, far)]);
    let material = |reflectance| DiffuseMaterial { reflectance, exitance: Rgb::ZERO, two_sided: true };
    let input = SceneInput {
        surfaces: vec![Surface::new(wall, 0), Surface::new(shelf, 1)],
        materials: vec![material(Rgb::splat(0.5)), material(Rgb::ZERO)],
        lights: vec![Light { position: BULB, intensity: Rgb::ONE, kind: LightKind::Point }],
        ..SceneInput::default()
    };
    let mut solver = Solver::new(&input, Settings::with_error(error), ()).expect("the scene is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.finish(&mut |_| ControlFlow::Continue(()))
}

/// Irradiance at a place on the wall over that without a shelf.
fn share(solution: &Solution, at: DVec2) -> f64 {
    let to = BULB - DVec3::new(at.x, 0.0, at.y);
    let whole = to.y / to.length().powi(3);
    // The wall's u runs upward, v along x.
    let uv = Vec2::new((at.y / SIDE) as f32, (at.x / SIDE) as f32);
    [false, true]
        .iter()
        .filter_map(|&back| solution.elements.leaf_at(&solution.scene, 0, back, uv))
        .map(|leaf| f64::from(solution.irradiance(leaf, uv).x))
        .fold(0.0, f64::max)
        / whole
}

/// Right above a shelf all of the light arrives, and right below it none: but where it cuts off no more than a corner of a leaf.
#[test]
fn light_ends_where_surfaces_meet() {
    const PLACES: u32 = 400;
    for (shelf @ [a, b], most) in SHELVES.into_iter().zip([0, 32, 0]) {
        let solution = solution(shelf, [0.0, DEPTH], 0.05);
        let up = (b - a).normalize().perp();
        let mut wrong = 0;
        for i in 0..PLACES {
            // The ends of the shelf may be blurred.
            let on = a.lerp(b, 0.1 + 0.8 * f64::from(i) / f64::from(PLACES - 1));
            let is_wrong = [0.003, 0.02, 0.06].iter().any(|apart| {
                let [above, below] = [1.0, -1.0].map(|side| share(&solution, on + up * (side * apart)));
                (above - 1.0).abs() > 0.05 || below > 0.05
            });
            wrong += u32::from(is_wrong);
        }
        assert!(wrong <= most, "{wrong} of {PLACES} places along {shelf:?}");
    }
}

/// The same along the edges of the shadow that a shelf throws which does not touch the wall, however coarse the solution is.
#[test]
fn shadows_end_at_lines() {
    const PLACES: u32 = 400;
    const NEAR: f64 = 0.1;
    const FAR: f64 = 0.15;
    // Along the slanting one, where a corner of a leaf is cut off, a twentieth is wrong at the coarsest; a fortieth at an error of 0.1.
    for (shelf, most) in SHELVES[..2].iter().zip([0, 20]) {
        let solution = solution(*shelf, [NEAR, FAR], 0.9);
        for (y, outward) in [(NEAR, 1.0), (FAR, -1.0)] {
            // Seen from the bulb, on the wall.
            let thrown = |end: DVec2| {
                let bulb = DVec2::new(BULB.x, BULB.z);
                bulb + (end - bulb) * (BULB.y / (BULB.y - y))
            };
            let [a, b] = shelf.map(thrown);
            let up = (b - a).normalize().perp() * outward;
            let mut wrong = 0;
            for i in 0..PLACES {
                let on = a.lerp(b, 0.1 + 0.8 * f64::from(i) / f64::from(PLACES - 1));
                let is_wrong = [0.01, 0.03].iter().any(|apart| {
                    let [lit, dark] = [1.0, -1.0].map(|side| on + up * (side * apart));
                    let is_on_wall = |at: DVec2| at.min_element() > 0.0 && at.max_element() < SIDE;
                    is_on_wall(lit) && (share(&solution, lit) - 1.0).abs() > 0.1
                        || is_on_wall(dark) && share(&solution, dark) > 0.1
                });
                wrong += u32::from(is_wrong);
            }
            assert!(wrong <= most, "{wrong} of {PLACES} places along the edge {y} off the wall, {shelf:?}");
        }
    }
}

/// A shadow that is narrower than leaves takes away as much light as it should, and not where vertices lie in it all of what is
/// around them.
#[test]
fn narrow_shadows_are_as_dark_as_they_are_wide() {
    const LOW: f64 = 0.3;
    let shelf @ [a, b] = SHELVES[0];
    let solution = solution(shelf, [0.0, FRAME], 0.05);
    let (mut off, mut all, mut shown, mut there) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..200 {
        let on = a.lerp(b, 0.1 + 0.8 * f64::from(i) / 199.0);
        // The ray past the shelf's edge.
        let width = FRAME * (BULB.z - on.y) / (BULB.y - FRAME);
        for below in (0..100).map(|i| LOW * (f64::from(i) + 0.5) / 100.0) {
            let truth = if below < width { 0.0 } else { 1.0 };
            let found = share(&solution, on - DVec2::Y * below);
            (off, all) = (off + (found - truth).abs(), all + 1.0);
            (shown, there) = (shown + found, there + truth);
        }
    }
    assert!(off / all < 0.0125, "off by {} of the light", off / all);
    assert!((shown / there - 1.0).abs() < 0.05, "{} of the light", shown / there);
}

/// Whatever is cut, the parts make up the whole.
#[test]
fn parts_fill_the_wall() {
    for (shelf, near) in SHELVES.into_iter().flat_map(|shelf| [(shelf, 0.0), (shelf, 0.1)]) {
        let solution = solution(shelf, [near, near + DEPTH], 0.1);
        let (mut area, mut fans) = (0.0, [0, 0]);
        for leaf in solution.elements.patch_leaves() {
            let element = &solution.elements.nodes[leaf as usize];
            if element.source != 0 || element.kind != hr_diffuse::hierarchy::Kind::Front {
                continue;
            }
            let count = solution.vertices.fans(leaf).count();
            fans[usize::from(count > 1)] += 1;
            for fan in solution.vertices.fans(leaf) {
                let outline = &fan[1..];
                for (i, a) in outline.iter().enumerate() {
                    let b = &outline[(i + 1) % outline.len()];
                    let part = f64::from((a.uv - fan[0].uv).perp_dot(b.uv - fan[0].uv)) / 2.0;
                    assert!(part > -1e-9, "no triangle is turned over");
                    area += part;
                }
            }
        }
        assert!((area - 1.0).abs() < 1e-5, "{area}");
        assert!(fans[0] > 0 && fans[1] > 0, "some leaves are cut, others are not: {fans:?}");
    }
}

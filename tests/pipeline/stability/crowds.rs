//! Very many surfaces.

use crate::scenes::{quad, solve};
use crate::stability::answers::{assert_sane, irradiance};
use crate::stability::cases::{PARALLEL, ceiling, glowing};
use glam::DVec3;
use hr_diffuse::{DiffuseMaterial, Rgb, SceneInput, Shape, Surface};

fn scene(surfaces: Vec<Surface>) -> SceneInput {
    let dark = DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::ZERO, two_sided: false };
    let materials = vec![DiffuseMaterial { reflectance: Rgb::splat(0.5), ..dark }, glowing(0.0), dark, glowing(0.5)];
    SceneInput { surfaces, materials, ..SceneInput::default() }
}

/// Black surfaces cost no links; they only hide each other, and here not even that.
#[test]
fn one_lamp_among_a_hundred_thousand_black_triangles_is_found() {
    let mut surfaces = vec![quad(DVec3::ZERO, DVec3::X, DVec3::Y, 0), ceiling(1.0, 1)];
    for i in 0..100_000_u32 {
        let at = DVec3::new(1.5 + f64::from(i % 50), f64::from(i / 50 % 50), f64::from(i / 2500)) * 0.1;
        let side = 0.02;
        surfaces.push(Surface::new(Shape::Triangle([at, at + DVec3::X * side, at + DVec3::Y * side]), 2));
    }
    // Beside the plates, where they hide nothing.
    for surface in &mut surfaces[2..] {
        if let Shape::Triangle(points) = &mut surface.shape {
            points.iter_mut().for_each(|p| p.x += 1.5);
        }
    }
    let solution = solve(&scene(surfaces), 0.1, ());
    assert_sane(&solution, "black triangles");
    let found = irradiance(&solution, 0);
    assert!((found / PARALLEL - 1.0).abs() < 0.02, "{found} instead of {PARALLEL}");
    let (links, pairs) = (solution.stats.links, solution.stats.pairs);
    assert!(links < 100_000 && pairs < 1_000_000, "{links} links, {pairs} pairs");
}

/// They send and receive what one of them would.
#[test]
fn fifty_thousand_identical_triangles_are_one() {
    let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let floor = [
        Shape::Triangle([corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0), corner(1.0, 1.0, 0.0)]),
        Shape::Triangle([corner(0.0, 0.0, 0.0), corner(1.0, 1.0, 0.0), corner(0.0, 1.0, 0.0)]),
    ];
    for (material, lamp) in [(0, 1), (1, 0)] {
        let mut surfaces = vec![ceiling(1.0, lamp), Surface::new(floor[1].clone(), material)];
        surfaces.extend((0..50_000).map(|_| Surface::new(floor[0].clone(), material)));
        let solution = solve(&scene(surfaces), 0.1, ());
        assert_sane(&solution, "identical triangles");
        let known = if material == 0 { vec![1, 2, 25_000, 50_001] } else { vec![0] };
        for surface in known {
            let found = irradiance(&solution, surface);
            assert!((found / PARALLEL - 1.0).abs() < 0.02, "surface {surface}: {found} instead of {PARALLEL}");
        }
    }
}

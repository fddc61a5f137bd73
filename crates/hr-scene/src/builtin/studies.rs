//! Small scenes with known numbers, to measure and to compare with.

use super::build::{Builder, Paint};
use crate::camera::unit;
use crate::{Camera, Rgb, Scene};
use glam::{DVec2, DVec3, dvec2, dvec3};
use std::f32::consts::PI;

const INCH: f64 = 0.0254;

/// A camera with z up and 400 x 300 pixels.
fn camera(eye: [f64; 3], target: [f64; 3], fov_x: f64) -> Camera {
    Camera { eye, target, up: [0.0, 0.0, 1.0], fov_x, width: 400, height: 300 }
}

/// Unit direction so many degrees above the xy plane and around z.
fn direction(elevation: f64, azimuth: f64) -> DVec3 {
    let (e, a) = (elevation.to_radians(), azimuth.to_radians());
    dvec3(e.cos() * a.cos(), e.cos() * a.sin(), e.sin())
}

/// Three coloured square lights, 6 cm wide, shine from 1.9 m on a very glossy reflector of 0.4 m. A black screen hides
/// them from the wall: all light on the wall comes over the reflector.
pub(super) fn three_lights() -> Scene {
    let mut b = Builder::new("three-lights");
    let wall = b.material("wall", Paint::diffuse(Rgb::splat(0.7)));
    let reflector = b.material("reflector", Paint::glossy(Rgb::splat(0.02), Rgb::splat(0.9), 0.03));
    let screen = b.material("screen", Paint::diffuse(Rgb::ZERO));
    b.patch(wall, dvec3(1.2, 0.0, 1.5), -DVec3::X, DVec3::Z, dvec2(4.0, 3.0));
    b.patch(reflector, DVec3::ZERO, DVec3::Z, DVec3::Y, DVec2::splat(0.4));
    b.patch(screen, dvec3(-0.6, 0.0, 1.51), -DVec3::X, DVec3::Z, dvec2(3.0, 1.78));
    for (name, y, color) in [("red", -0.6, Rgb::X), ("green", 0.0, Rgb::Y), ("blue", 0.6, Rgb::Z)] {
        let light = b.material(name, Paint::light(color * 5e4));
        let place = dvec3(-1.5, y, 1.2);
        b.patch(light, place, -place, DVec3::Z, DVec2::splat(0.06));
    }
    b.camera("front", camera([-0.5, 0.0, 0.9], [1.2, 0.0, 1.1], 95.0));
    b.camera("side", camera([-0.45, -2.4, 1.3], [0.85, 0.15, 0.75], 65.0));
    b.done()
}

/// Seven lights, 4 cm wide, 1 m from a glossy reflector of 0.2 m: one in the middle and six around it, each `spacing`
/// degrees from its neighbours as seen from the reflector. The receiver of 3 m sees the lights directly too.
pub(super) fn seven_lights(name: &str, spacing: f64) -> Scene {
    let mut b = Builder::new(name);
    let receiver = b.material("receiver", Paint::diffuse(Rgb::splat(0.7)));
    let reflector = b.material("reflector", Paint::glossy(Rgb::splat(0.02), Rgb::splat(0.9), 0.05));
    let light = b.material("light", Paint::light(Rgb::splat(2e5)));
    b.patch(reflector, DVec3::ZERO, DVec3::Z, DVec3::Y, DVec2::splat(0.2));
    let facing = direction(45.0, 0.0);
    b.patch(receiver, 1.5 * facing, -facing, DVec3::Z, DVec2::splat(3.0));
    let middle = direction(45.0, 180.0);
    let across = unit(DVec3::Z.cross(middle));
    let along = middle.cross(across);
    let (sin, cos) = spacing.to_radians().sin_cos();
    let around = (0..6).map(|k| {
        let a = f64::from(k) * 60.0_f64.to_radians();
        cos * middle + sin * (a.cos() * across + a.sin() * along)
    });
    for toward in std::iter::once(middle).chain(around) {
        b.patch(light, toward, -toward, DVec3::Z, DVec2::splat(0.04));
    }
    b.camera("front", camera([-0.25, 0.0, 0.3], (1.5 * facing).to_array(), 90.0));
    b.camera("side", camera([-0.6, -2.4, 0.9], [0.55, 0.0, 0.5], 60.0));
    b.done()
}

/// A glossy sphere of 0.5 m radius lit by a source of 15 cm, over a glossy floor, under a diffuse ceiling; open at the
/// sides.
pub(super) fn glossy_sphere() -> Scene {
    let mut b = Builder::new("glossy-sphere");
    let floor = b.material("floor", Paint::glossy(Rgb::splat(0.2), Rgb::splat(0.3), 0.1));
    let ceiling = b.material("ceiling", Paint::diffuse(Rgb::splat(0.8)));
    let sphere = b.material("sphere", Paint::glossy(Rgb::new(0.08, 0.04, 0.02), Rgb::splat(0.6), 0.05));
    let light = b.material("light", Paint::light(Rgb::splat(1e5)));
    let middle = dvec3(0.0, 0.0, 0.6);
    b.patch(floor, DVec3::ZERO, DVec3::Z, DVec3::Y, DVec2::splat(6.0));
    b.patch(ceiling, dvec3(0.0, 0.0, 3.0), -DVec3::Z, DVec3::Y, DVec2::splat(6.0));
    b.sphere(sphere, middle, 0.5);
    let lamp = dvec3(1.2, -0.8, 2.2);
    b.patch(light, lamp, middle - lamp, DVec3::Z, DVec2::splat(0.15));
    b.camera("front", camera([0.3, -3.2, 1.5], [0.0, 0.0, 0.75], 55.0));
    b.camera("low", camera([-2.6, -1.6, 0.9], [0.2, 0.0, 1.3], 75.0));
    b.done()
}

/// A bare room of 5.08 x 2.4384 x 8.89 m (y up) with a glossy tile floor and five spherical lamps: the measures of the
/// soda shop in the MGF distribution.
pub(super) fn empty_room() -> Scene {
    let mut b = Builder::new("empty-room");
    // CIE xy (.4051, .3621), Y .2811.
    let tile = Rgb::new(0.406_729_22, 0.242_582_25, 0.165_429_97);
    let floor = b.material("floor_tile", Paint::glossy(tile, Rgb::splat(0.3), 0.07));
    let wall = b.material("wallpaint", Paint::diffuse(Rgb::splat(0.6)));
    let lamp = b.material("lamp", Paint::light(Rgb::splat(626.5)));
    let [x0, x1, y0, y1, z0, z1] = [-80.0, 120.0, 0.0, 96.0, -100.0, 250.0].map(|v| v * INCH);
    let p = |x, y, z| dvec3(x, y, z);
    b.quad(floor, [p(x0, y0, z1), p(x1, y0, z1), p(x1, y0, z0), p(x0, y0, z0)]);
    b.quad(wall, [p(x0, y1, z0), p(x1, y1, z0), p(x1, y1, z1), p(x0, y1, z1)]);
    b.quad(wall, [p(x0, y0, z1), p(x0, y0, z0), p(x0, y1, z0), p(x0, y1, z1)]);
    b.quad(wall, [p(x1, y0, z0), p(x1, y0, z1), p(x1, y1, z1), p(x1, y1, z0)]);
    b.quad(wall, [p(x0, y0, z0), p(x1, y0, z0), p(x1, y1, z0), p(x0, y1, z0)]);
    b.quad(wall, [p(x1, y0, z1), p(x0, y0, z1), p(x0, y1, z1), p(x1, y1, z1)]);
    for (x, z) in [(60.0, 75.0), (60.0, 175.0), (-25.0, 125.0), (-25.0, 25.0), (60.0, -25.0)] {
        b.sphere(lamp, dvec3(x, 83.0, z) * INCH, 8.0 * INCH);
    }
    let up = [0.0, 1.0, 0.0];
    b.camera("entrance", Camera { up, ..camera([1.2, 1.55, 5.6], [0.1, 1.0, 0.0], 60.0) });
    b.camera("corner", Camera { up, ..camera([-1.8, 1.2, -2.2], [1.4, 0.7, 3.5], 70.0) });
    b.done()
}

/// A tilted area light of 0.6 m over a highly glossy plate, before a wall.
pub(super) fn area_light() -> Scene {
    let mut b = Builder::new("area-light");
    let plate = b.material("plate", Paint::glossy(Rgb::splat(0.05), Rgb::splat(0.85), 0.01));
    let wall = b.material("wall", Paint::diffuse(Rgb::splat(0.6)));
    let light = b.material("light", Paint::light(Rgb::splat(5e3)));
    b.patch(plate, DVec3::ZERO, DVec3::Z, DVec3::Y, DVec2::splat(3.0));
    b.patch(wall, dvec3(0.0, 1.5, 1.25), -DVec3::Y, DVec3::Z, dvec2(3.0, 2.5));
    b.patch(light, dvec3(0.0, 0.8, 0.9), dvec3(0.0, -1.0, -1.0), DVec3::Z, DVec2::splat(0.6));
    b.camera("front", camera([0.0, -2.2, 1.3], [0.0, 0.5, 0.4], 60.0));
    b.camera("low", camera([1.3, -1.3, 0.35], [-0.3, 0.9, 0.5], 65.0));
    b.done()
}

/// A closed cube, 2 m wide, whose faces reflect (.2, .5, .8) and emit (1, 2, 3) W/m²: radiosity is (1.25, 4, 15) W/m²
/// everywhere.
pub(super) fn furnace() -> Scene {
    let mut b = Builder::new("furnace");
    let exitance = Rgb::new(1.0, 2.0, 3.0);
    let wall = b.material("wall", Paint { exitance, ..Paint::diffuse(Rgb::new(0.2, 0.5, 0.8)) });
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let normal = sign * DVec3::AXES[axis];
            b.patch(wall, normal, -normal, DVec3::AXES[(axis + 1) % 3], DVec2::splat(2.0));
        }
    }
    let size = |c: Camera| Camera { width: 64, height: 48, ..c };
    b.camera("inside", size(camera([-0.7, -0.6, 0.2], [0.5, 0.6, 0.0], 80.0)));
    b.camera("corner", size(camera([0.9, 0.9, 0.9], [-1.0, -1.0, -1.0], 100.0)));
    b.done()
}

/// The Cornell box: the geometry as published by Cornell's Program of Computer Graphics ("Cornell Box Data"), in metres;
/// reflectances and light as the usual RGB renditions of the measured spectra. The light hangs 1 mm below the ceiling.
pub(super) fn cornell() -> Scene {
    let mut b = Builder::new("cornell");
    let white = b.material("white", Paint::diffuse(Rgb::new(0.725, 0.71, 0.68)));
    let red = b.material("red", Paint::diffuse(Rgb::new(0.63, 0.065, 0.05)));
    let green = b.material("green", Paint::diffuse(Rgb::new(0.14, 0.45, 0.091)));
    let light = b.material("light", Paint::light(PI * Rgb::new(17.0, 12.0, 4.0)));
    // Millimetres.
    let faces: [(u32, [[f64; 3]; 4]); 16] = [
        // Floor, ceiling, back, right and left wall.
        (white, [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]]),
        (white, [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]]),
        (white, [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]]),
        (green, [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]]),
        (red, [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]]),
        // The short block, top first.
        (white, [[130.0, 165.0, 65.0], [82.0, 165.0, 225.0], [240.0, 165.0, 272.0], [290.0, 165.0, 114.0]]),
        (white, [[290.0, 0.0, 114.0], [290.0, 165.0, 114.0], [240.0, 165.0, 272.0], [240.0, 0.0, 272.0]]),
        (white, [[130.0, 0.0, 65.0], [130.0, 165.0, 65.0], [290.0, 165.0, 114.0], [290.0, 0.0, 114.0]]),
        (white, [[82.0, 0.0, 225.0], [82.0, 165.0, 225.0], [130.0, 165.0, 65.0], [130.0, 0.0, 65.0]]),
        (white, [[240.0, 0.0, 272.0], [240.0, 165.0, 272.0], [82.0, 165.0, 225.0], [82.0, 0.0, 225.0]]),
        // The tall block, top first.
        (white, [[423.0, 330.0, 247.0], [265.0, 330.0, 296.0], [314.0, 330.0, 456.0], [472.0, 330.0, 406.0]]),
        (white, [[423.0, 0.0, 247.0], [423.0, 330.0, 247.0], [472.0, 330.0, 406.0], [472.0, 0.0, 406.0]]),
        (white, [[472.0, 0.0, 406.0], [472.0, 330.0, 406.0], [314.0, 330.0, 456.0], [314.0, 0.0, 456.0]]),
        (white, [[314.0, 0.0, 456.0], [314.0, 330.0, 456.0], [265.0, 330.0, 296.0], [265.0, 0.0, 296.0]]),
        (white, [[265.0, 0.0, 296.0], [265.0, 330.0, 296.0], [423.0, 330.0, 247.0], [423.0, 0.0, 247.0]]),
        (light, [[343.0, 547.8, 227.0], [343.0, 547.8, 332.0], [213.0, 547.8, 332.0], [213.0, 547.8, 227.0]]),
    ];
    for (paint, corners) in faces {
        let [p, q, r, s] = corners.map(|p| DVec3::from(p) / 1000.0);
        if paint == red {
            // As measured, this wall is not plane.
            b.triangle(paint, [p, q, r]);
            b.triangle(paint, [p, r, s]);
        } else {
            b.quad(paint, [p, q, r, s]);
        }
    }
    let up = [0.0, 1.0, 0.0];
    let standard = camera([0.278, 0.273, -0.8], [0.278, 0.273, 0.0], 39.3077);
    b.camera("standard", Camera { up, width: 300, ..standard });
    b.camera("high", Camera { up, ..camera([0.5, 0.48, 0.03], [0.2, 0.12, 0.4], 75.0) });
    b.done()
}

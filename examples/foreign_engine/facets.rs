//! Patches of one of our scenes' surfaces.

use crate::engine::Patch;
use glam::{DVec3, Vec3};
use hr_diffuse::{Shape, Surface};
use std::f64::consts::{PI, TAU};

/// Facets of curved surfaces are finer by this factor: lobes are narrow.
const CURVED: f64 = 0.5;

/// The front of a surface as patches about so long; none for shapes that this engine does not know.
pub(crate) fn facets(surface: &Surface, length: f64) -> Vec<Patch> {
    match surface.shape {
        Shape::Quad([a, b, c, d]) => {
            let point = |s: f64, t: f64| a.lerp(b, s).lerp(d.lerp(c, s), t);
            grid(point, [parts(a.distance(b), length), parts(a.distance(d), length)], surface.material, 0.0)
        }
        Shape::Sphere { center, radius } => {
            let around = parts(PI * radius, length * CURVED);
            let sides = [2 * around, around];
            // Facets with their corners on the sphere would have less area than it has: by half a step's cosine.
            let radius = radius / (PI / (2 * around) as f64).cos().sqrt();
            let point = |s: f64, t: f64| {
                let ((sin, cos), (below, height)) = ((TAU * s).sin_cos(), (PI * (1.0 - t)).sin_cos());
                center + radius * DVec3::new(below * cos, below * sin, height)
            };
            grid(point, sides, surface.material, (PI / (2 * around) as f64) as f32)
        }
        _ => Vec::new(),
    }
}

/// Into how many parts of about a length another one goes.
fn parts(whole: f64, length: f64) -> usize {
    (whole / length).round().max(1.0) as usize
}

fn grid(point: impl Fn(f64, f64) -> DVec3, [columns, rows]: [usize; 2], material: u32, bend: f32) -> Vec<Patch> {
    let at = |i: usize, j: usize| -> Vec3 { point(i as f64 / columns as f64, j as f64 / rows as f64).as_vec3() };
    let patch = |k: usize| {
        let (i, j) = (k % columns, k / columns);
        Patch::new([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], material as usize, bend)
    };
    (0..columns * rows).map(patch).collect()
}

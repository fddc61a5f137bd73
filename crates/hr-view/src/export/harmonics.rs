//! Spherical harmonics of a few bands.

use glam::Vec3;
use hr_diffuse::Rgb;
use std::f32::consts::{PI, TAU};

/// Coefficients of the bands 0 to 2.
pub(super) const COUNT: usize = 9;
/// Directions that a function is projected at. Their sums are those of integrals to 1 % for products of two harmonics.
const DIRECTIONS: usize = 256;

/// The real spherical harmonics in a unit direction (Ramamoorthi & Hanrahan 2001, equation 3).
pub(super) fn basis(d: Vec3) -> [f32; COUNT] {
    let Vec3 { x, y, z } = d;
    [
        0.282_095,
        0.488_603 * y,
        0.488_603 * z,
        0.488_603 * x,
        1.092_548 * x * y,
        1.092_548 * y * z,
        0.315_392 * (3.0 * z * z - 1.0),
        1.092_548 * x * z,
        0.546_274 * (x * x - y * y),
    ]
}

/// A function's coefficients.
pub(super) fn project(mut f: impl FnMut(Vec3) -> Rgb) -> [Rgb; COUNT] {
    let mut sums = [Rgb::ZERO; COUNT];
    for i in 0..DIRECTIONS {
        // Points of a spiral (Vogel), evenly spread over the sphere.
        let z = 1.0 - (2 * i + 1) as f32 / DIRECTIONS as f32;
        let (sin, cos) = (TAU * (0.618_034 * i as f32).fract()).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        let direction = Vec3::new(radius * cos, radius * sin, z);
        let value = f(direction) * (4.0 * PI / DIRECTIONS as f32);
        if value != Rgb::ZERO {
            for (sum, y) in sums.iter_mut().zip(basis(direction)) {
                *sum += value * y;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonics_are_orthonormal() {
        for i in 0..COUNT {
            let coefficients = project(|d| Rgb::splat(basis(d)[i]));
            for (j, c) in coefficients.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((c.x - expected).abs() < 0.01, "harmonics {i} and {j}: {}", c.x);
            }
        }
    }
}

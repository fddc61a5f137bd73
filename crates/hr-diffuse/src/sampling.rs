//! Deterministic, well-spread sample points: an additive recurrence shifted by a hash. No state, no clock; the
//! irrational steps keep points off the symmetry of patches, where rays would aim at shared edges.

use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::TAU;

/// Steps of the four-dimensional additive recurrence, of 2³²: powers of the reciprocal of the root of x⁵ = x + 1
/// (M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018). As whole numbers they wrap without rounding: multiples
/// in floating point lie ever farther apart, and exactly on edges and poles.
const STEPS: [u32; 4] = [0xDB4F_0B91, 0xBBE0_5633, 0xA0F2_EC75, 0x89E1_8285];
/// The same in two dimensions: x³ = x + 1, …
const PLANE_STEPS: [u32; 2] = [0xC13F_A9A9, 0x91E1_0DA5];
/// … and in one, x² = x + 1.
const LINE_STEP: u32 = 0x9E37_79B9;

/// A well-mixed 32-bit hash of two numbers (the finaliser of MurmurHash3).
#[must_use]
pub fn hash(a: u32, b: u32) -> u32 {
    let mut h = a.wrapping_mul(0x9E37_79B9) ^ b.rotate_left(16).wrapping_mul(0x85EB_CA6B);
    h ^= h >> 16;
    h = h.wrapping_mul(0x85EB_CA6B);
    h ^= h >> 13;
    h = h.wrapping_mul(0xC2B2_AE35);
    h ^ (h >> 16)
}

/// A number in 0…1 (1 excluded) from a hash.
#[must_use]
pub fn unit(hash: u32) -> f32 {
    (hash >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The `i`-th point of the unit 4-cube for a seed.
#[must_use]
pub fn point4(seed: u32, i: u32) -> Vec4 {
    let [x, y, z, w] = STEPS;
    Vec4::new(
        along(hash(seed, 1), x, i),
        along(hash(seed, 2), y, i),
        along(hash(seed, 3), z, i),
        along(hash(seed, 4), w, i),
    )
}

/// The `i`-th point of the unit square for a seed.
#[must_use]
pub fn point2(seed: u32, i: u32) -> Vec2 {
    let [x, y] = PLANE_STEPS;
    Vec2::new(along(hash(seed, 5), x, i), along(hash(seed, 6), y, i))
}

/// The `i`-th number in 0…1 for a seed.
#[must_use]
pub fn number(seed: u32, i: u32) -> f32 {
    along(hash(seed, 7), LINE_STEP, i)
}

/// The `i`-th number of an additive recurrence, in 0…1 (1 excluded).
fn along(shift: u32, step: u32, i: u32) -> f32 {
    unit(shift.wrapping_add(i.wrapping_mul(step)))
}

/// A direction about a unit normal, drawn by its cosine.
pub(crate) fn cosine_direction(n: Vec3, u: f32, v: f32) -> Vec3 {
    let (a, b) = n.any_orthonormal_pair();
    let (sin, cos) = (TAU * u).sin_cos();
    (a * cos + b * sin) * v.sqrt() + n * (1.0 - v).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of points that lie within a thousandth of the edge is what it should be, however many came before.
    #[test]
    fn points_are_spread_evenly_however_many_there_are() {
        for first in [0, 1 << 16, 5 << 16, 1 << 30] {
            let near = |values: &[f32]| values.iter().filter(|&&value| value < 1e-3).count();
            let of = |i: u32| {
                let (p, q) = (point4(1, first + i), point2(1, first + i));
                near(&[p.x, p.y, p.z, p.w, q.x, q.y, number(1, first + i)])
            };
            let near = (0..1 << 16).map(of).sum::<usize>();
            assert!((420..500).contains(&near), "{first}: {near} instead of 459");
        }
    }
}

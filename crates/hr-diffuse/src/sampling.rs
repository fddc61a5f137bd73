//! Deterministic, well-spread sample points: an additive recurrence shifted by a hash. No state, no clock; the
//! irrational steps keep points off the symmetry of patches, where rays would aim at shared edges.

use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::TAU;

/// Steps of the four-dimensional additive recurrence: powers of the reciprocal of the root of x⁵ = x + 1
/// (M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018).
const STEPS: Vec4 = Vec4::new(0.856_674_9, 0.733_891_9, 0.628_706_7, 0.538_597_3);
/// The same in two dimensions: x³ = x + 1, …
const PLANE_STEPS: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
/// … and in one, x² = x + 1, of 2³².
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
    let shift = Vec4::new(unit(hash(seed, 1)), unit(hash(seed, 2)), unit(hash(seed, 3)), unit(hash(seed, 4)));
    (shift + STEPS * i as f32).fract()
}

/// The `i`-th point of the unit square for a seed.
#[must_use]
pub fn point2(seed: u32, i: u32) -> Vec2 {
    let shift = Vec2::new(unit(hash(seed, 5)), unit(hash(seed, 6)));
    (shift + PLANE_STEPS * i as f32).fract()
}

/// The `i`-th number in 0…1 for a seed.
#[must_use]
pub fn number(seed: u32, i: u32) -> f32 {
    unit(hash(seed, 7).wrapping_add(i.wrapping_mul(LINE_STEP)))
}

/// A direction about a unit normal, drawn by its cosine.
pub(crate) fn cosine_direction(n: Vec3, u: f32, v: f32) -> Vec3 {
    let (a, b) = n.any_orthonormal_pair();
    let (sin, cos) = (TAU * u).sin_cos();
    (a * cos + b * sin) * v.sqrt() + n * (1.0 - v).sqrt()
}

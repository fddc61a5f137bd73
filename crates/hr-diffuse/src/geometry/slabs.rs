//! What tests of rays against the slabs of a box share.

use glam::Vec3;

/// Growth of a box's far distance that makes the slab test conservative: three roundings on each side (Ize, "Robust
/// BVH Ray Traversal", JCGT 2(2), 2013), generously.
pub(crate) const GROWTH: f32 = 1.0 + 8.0 * f32::EPSILON;

/// In place of a zero direction component: small enough to be parallel, large enough for a finite reciprocal.
const PARALLEL: f32 = 1e-30;

/// One over each component of a direction, finite.
#[inline(always)]
pub(crate) fn reciprocal(direction: Vec3) -> Vec3 {
    direction.map(|d| if d.abs() < PARALLEL { PARALLEL.copysign(d) } else { d }.recip())
}

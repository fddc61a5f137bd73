//! What a leaf sends out: the distribution of its middle, and how what it shows moves from place to place.
//!
//! The paper's elements have no extent for light that leaves them: one distribution holds all over the element, so that a
//! highlight would stand still on it until it jumps to the next. Seen from a place beside the middle a near lamp is in another direction,
//! and its mirror image is where that says. The place shows what the middle shows in another direction, which follows from how far away
//! what lights the leaf is: its [`Focus`].

use crate::reflector::Incident;
use glam::{DMat3, DVec3, Mat3, Vec3};
use std::ops::Deref;

/// Directions from which less than this share of the light (by the weights of [`Focus::of`]) comes count as infinitely far: there
/// distances are extrapolated.
const RIDGE: f64 = 3e-3;
/// A place is at least this much of the middle's distance away from the plane of what lights the leaf: beyond it, or next to
/// it, nothing is known.
const NEAREST: f32 = 0.25;
/// Of curved leaves distributions hold radiance times the cosine of the direction; where that is smaller, times this, if they are shown.
pub const SHOWN_COSINE: f32 = 0.05;
/// Larger components are no lengths.
const MOST: f32 = 1e30;

/// Where what lights a leaf is: the plane f · x = 1, where x is relative to the leaf's middle (6 bytes; 1/256 relative precision).
///
/// The reciprocal distance of what is seen in a unit direction d is f · d. It is right for a single lamp, for up to three, and for
/// as many as lie in a plane, such as those of a ceiling; and a compromise for others. Zero: all is infinitely far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Focus([u16; 3]);

impl Focus {
    /// The plane that fits the samples of a leaf with a radius best, where each counts by the square of its irradiance: what is spread over
    /// many directions has no edges that could be seen to move. Directions of samples are those of a frame whose columns are given.
    /// What is nearer than the leaf is large counts as the farther away the nearer it is: what lies along the leaf looks the same from all
    /// places.
    #[must_use]
    pub fn of(incident: &[Incident], frame: &Mat3, radius: f32) -> Self {
        let nearest = radius.max(f32::MIN_POSITIVE).recip();
        let (mut matrix, mut right, mut sum) = (DMat3::ZERO, DVec3::ZERO, 0.0);
        for sample in incident {
            let direction = (*frame * sample.direction).as_dvec3();
            let weight = f64::from(sample.irradiance.element_sum()).powi(2);
            matrix +=
                DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z) * weight;
            let nearness = sample.nearness.min(nearest * (nearest / sample.nearness.max(f32::MIN_POSITIVE)));
            right += direction * (weight * f64::from(nearness));
            sum += weight;
        }
        if sum <= 0.0 {
            return Self::default();
        }
        let plane = (matrix * sum.recip() + DMat3::from_diagonal(DVec3::splat(RIDGE))).inverse() * (right / sum);
        Self::new(plane.as_vec3())
    }

    /// The plane f · x = 1. Of a vector that is not finite: infinitely far.
    #[must_use]
    pub fn new(plane: Vec3) -> Self {
        if !plane.is_finite() {
            return Self::default();
        }
        let rounded = plane.clamp(Vec3::splat(-MOST), Vec3::splat(MOST)).to_array();
        Self(rounded.map(|c| (c.to_bits().wrapping_add(1 << 15) >> 16) as u16))
    }

    /// f, in 1/length.
    #[must_use]
    pub fn plane(self) -> Vec3 {
        Vec3::from(self.0.map(|half| f32::from_bits(u32::from(half) << 16)))
    }

    /// The upper halves of f's components, as they are kept.
    #[must_use]
    pub fn to_bits(self) -> [u16; 3] {
        self.0
    }

    /// The direction in which the middle sees what a place beside it, `offset` away, sees in a unit direction: that of the point
    /// where the ray from the place meets the plane. Not of unit length.
    #[inline]
    #[must_use]
    pub fn from_middle(self, offset: Vec3, direction: Vec3) -> Vec3 {
        let plane = self.plane();
        let share = (1.0 - plane.dot(offset)).max(NEAREST);
        direction * share + offset * plane.dot(direction).max(0.0)
    }
}

/// A distribution with its focus: what a leaf sends out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outgoing<B> {
    /// What the leaf's middle sends, by direction.
    pub distribution: B,
    /// Where it comes from.
    pub focus: Focus,
}

/// To whom the leaf is a point it is its distribution.
impl<B> Deref for Outgoing<B> {
    type Target = B;

    fn deref(&self) -> &B {
        &self.distribution
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rgb;

    /// Lamps of equal strength as they are seen from the middle.
    fn lamps(places: &[Vec3]) -> Vec<Incident> {
        let lamp = |place: &Vec3| Incident {
            direction: place.normalize(),
            irradiance: Rgb::ONE,
            nearness: place.length().recip(),
            ..Incident::default()
        };
        places.iter().map(lamp).collect()
    }

    /// How far off (radians) the middle's direction toward lamps is found from places of the leaf.
    fn worst(places: &[Vec3]) -> f32 {
        let focus = Focus::of(&lamps(places), &Mat3::IDENTITY, 0.5);
        let mut worst = 0.0_f32;
        for place in places {
            for k in 0..20 {
                let turn = 0.7 * k as f32;
                let offset = Vec3::new(turn.cos(), turn.sin(), 0.0) * (0.5 * (k as f32 / 20.0).sqrt());
                let found = focus.from_middle(offset, (place - offset).normalize());
                worst = worst.max(found.angle_between(place.normalize()));
            }
        }
        worst
    }

    #[test]
    fn places_see_what_the_middle_sees() {
        // Lamps seen from places half their distance away, 27°: off by the ridge's share of that and by rounding.
        let lamp = Vec3::new(0.3, -0.2, 1.0);
        let one = worst(&[lamp]);
        assert!(one < 0.006, "one lamp: off by {one} rad");
        let three = worst(&[lamp, Vec3::new(-1.5, 0.4, 1.2), Vec3::new(0.5, 1.4, 0.8)]);
        assert!(three < 0.03, "three lamps: off by {three} rad");
        let ceiling: Vec<Vec3> =
            (0..25).map(|k| Vec3::new(f32::from(k as u8 % 5) - 2.0, f32::from(k as u8 / 5) - 2.0, 1.2)).collect();
        let many = worst(&ceiling);
        assert!(many < 0.03, "a ceiling of lamps: off by {many} rad");
    }

    #[test]
    fn nonsense_and_the_sky_have_no_parallax() {
        let direction = Vec3::new(0.6, 0.0, 0.8);
        let offset = Vec3::new(0.3, 0.1, 0.0);
        let sky = [Incident { direction, irradiance: Rgb::ONE, ..Incident::default() }];
        for focus in
            [Focus::of(&sky, &Mat3::IDENTITY, 0.5), Focus::of(&[], &Mat3::IDENTITY, 0.5), Focus::new(Vec3::NAN)]
        {
            assert!(
                focus.from_middle(offset, direction).normalize().distance(direction) < 1e-6,
                "{focus:?} is infinitely far"
            );
        }
        // A plane through the place, or behind it.
        for plane in [offset * 1e3, -offset * 1e3] {
            let found = Focus::new(plane).from_middle(offset, direction);
            assert!(found.is_finite() && found.length() >= 0.9 * NEAREST, "{plane} makes {found} of a direction");
        }
    }

    /// The end of a board along a wall sees the wall next to it, the middle what is next to the middle: along the board it sees neither,
    /// and from its ends what the middle sees of the room.
    #[test]
    fn what_touches_a_leaf_does_not_turn_the_view() {
        let touching = |place: Vec3| Focus::of(&lamps(&[place, Vec3::new(0.3, -1.0, 1.5)]), &Mat3::IDENTITY, 0.5);
        let along = Vec3::new(0.0, 0.94, 0.34).normalize();
        let aslant = Vec3::new(0.5, -0.2, 0.8).normalize();
        for (place, direction) in [(Vec3::Y * 0.01, along), (Vec3::new(0.08, -0.02, 0.01), aslant)] {
            for k in [-0.5, 0.5] {
                let off = touching(place).from_middle(Vec3::X * k, direction).angle_between(direction);
                assert!(off < 0.5, "turned by {off} at {k} by what is at {place}");
            }
        }
    }

    #[test]
    fn planes_are_kept_to_a_half_percent() {
        for k in 0..200 {
            let plane = Vec3::new(1.0, -0.37, 3.1) * 1.3_f32.powi(k - 100);
            let off = (Focus::new(plane).plane() - plane).abs() / plane.abs();
            // Half a step of eight bits.
            assert!(off.max_element() < 1.0 / 256.0, "{plane} is off by {off}");
        }
    }
}

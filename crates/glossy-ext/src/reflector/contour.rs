//! Senders with a contour: lobes averaged over trapezoids.
//!
//! What [`extent`](super::extent) says of disks holds for any small shape: seen through the slopes of half vectors it is
//! mapped linearly. A trapezoid stays one, and the mean over it of either lobe is exact or nearly: of the GGX density the
//! integral is a sum over edges, of a Gaussian an integral along one axis of error functions along the other.

use super::HORIZON;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_2_SQRT_PI, FRAC_PI_4};

/// Contour of a flat sender as it is seen: a trapezoid about its middle, the directions
/// middle + s (1 − taper t) across + (t + taper/3) along, for −1 ≤ s, t ≤ 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contour {
    /// Half of the mean width, in radians: a vector perpendicular to the direction of the middle.
    across: Vec3,
    /// Half of the height, likewise.
    along: Vec3,
    /// 0 for a parallelogram, 1 for a triangle.
    taper: f32,
    /// Radius about the middle that holds it; 0 where the sender has no contour.
    reach: f32,
}

/// A contour shows if it reaches this many widths of a lobe far. Directions turn by twice as much as half vectors, so that the
/// variance of a smaller one is below a fiftieth of the lobe's.
const SHOWN: f32 = 0.35;
/// Wider contours than this (radians) are not seen as a part of a plane any more.
const WIDEST: f32 = 0.8;

impl Contour {
    /// Nothing is known of the sender's shape.
    pub const NONE: Self = Self { across: Vec3::ZERO, along: Vec3::ZERO, taper: 0.0, reach: 0.0 };

    /// From half of the mean width and of the height, vectors perpendicular to the direction of the sender's middle, in
    /// radians, and a taper of 0…1. What is too wide, or no number, has none.
    #[must_use]
    pub fn new(across: Vec3, along: Vec3, taper: f32) -> Self {
        let taper = taper.clamp(0.0, 1.0);
        // From the middle the wide end is (1 − taper/3) away, the narrow one (1 + taper/3).
        let wide = (1.0 + taper) * across.length() + (1.0 - taper / 3.0) * along.length();
        let narrow = (1.0 - taper) * across.length() + (1.0 + taper / 3.0) * along.length();
        let reach = wide.max(narrow);
        if reach <= WIDEST { Self { across, along, taper, reach } } else { Self::NONE }
    }

    /// Radius (radians) about the middle that holds it; 0 where the sender has no contour.
    #[must_use]
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// The same, each side at least as long as that of a square as large as a disk of this radius.
    pub(super) fn widened(&self, least: f32) -> Self {
        // √π/2
        let least = 0.886_226_9 * least;
        let widened = |side: Vec3| side * (least / side.length().max(f32::MIN_POSITIVE)).max(1.0);
        if self.reach > 0.0 { Self::new(widened(self.across), widened(self.along), self.taper) } else { *self }
    }

    /// Whether all of it is above the horizon, seen about `middle`, and a lobe of half-vector slopes as wide as this (RMS) shows that
    /// it is no disk.
    #[inline]
    pub(super) fn shows(&self, middle: Vec3, width: f32) -> bool {
        self.reach > SHOWN * width && middle.z - self.reach > HORIZON
    }

    /// A direction of it, not normalised.
    #[inline]
    pub(super) fn point(&self, middle: Vec3, [s, t]: [f32; 2]) -> Vec3 {
        middle + self.across * s + self.along * t
    }

    /// What a linear map to slopes makes of it about the slope of its middle.
    #[inline]
    pub(super) fn mapped(&self, middle: Vec2, map: impl Fn(Vec3) -> Vec2) -> Trapezoid {
        Trapezoid { middle, across: map(self.across), along: map(self.along), taper: self.taper }
    }
}

/// An [`Contour`] in the plane of slopes, about a lobe in the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trapezoid {
    /// Its centroid.
    pub middle: Vec2,
    pub across: Vec2,
    pub along: Vec2,
    pub taper: f32,
}

/// Nodes and weights of quadratures by Gauss and Legendre, on −1…1.
const THREE: [(f32, f32); 3] = [(-0.774_596_7, 0.555_555_6), (0.0, 0.888_888_9), (0.774_596_7, 0.555_555_6)];
const FOUR: [(f32, f32); 4] =
    [(-0.861_136_3, 0.347_854_8), (-0.339_981, 0.652_145_2), (0.339_981, 0.652_145_2), (0.861_136_3, 0.347_854_8)];

impl Trapezoid {
    #[inline]
    pub(super) fn scaled(&self, scale: f32) -> Self {
        Self { middle: self.middle * scale, across: self.across * scale, along: self.along * scale, ..*self }
    }

    /// Variances of s (1 − taper t) and t.
    #[inline]
    fn variances(&self) -> (f32, f32) {
        let taper2 = self.taper * self.taper;
        ((1.0 + taper2) / 3.0, 1.0 / 3.0 - taper2 / 9.0)
    }

    /// For M = `lobe` I + covariance: det M and (det M) M⁻¹ middle.
    #[inline]
    fn solve(&self, lobe: f32, share: f32) -> (f32, Vec2) {
        let (s, t) = self.variances();
        let (u, v, m) = (self.across, self.along, self.middle);
        let xx = lobe + share * (s * u.x * u.x + t * v.x * v.x);
        let xy = share * (s * u.x * u.y + t * v.x * v.y);
        let yy = lobe + share * (s * u.y * u.y + t * v.y * v.y);
        let det = (xx * yy - xy * xy).max(lobe * lobe);
        (det, Vec2::new(yy * m.x - xy * m.y, xx * m.y - xy * m.x))
    }

    /// Steps along both sides from the middle to where it meets a lobe of a variance about the origin: the mean of the
    /// product of two Gaussians, as far as that is within.
    #[inline]
    pub(super) fn toward_lobe(&self, variance: f32) -> [f32; 2] {
        let (s, t) = self.variances();
        let (det, solved) = self.solve(variance, 1.0);
        [s * self.across.dot(solved), t * self.along.dot(solved)].map(|step| (-step / det).clamp(-1.0, 1.0))
    }

    /// Four times the area of the half.
    fn area(&self) -> f32 {
        4.0 * self.across.perp_dot(self.along).abs()
    }

    /// Largest squared half-width.
    #[inline]
    fn size2(&self) -> f32 {
        let wide = 1.0 + self.taper;
        (self.across.length_squared() * wide * wide).max(self.along.length_squared())
    }

    /// Mean of exp(−|p|²).
    ///
    /// Small ones are taken for Gaussians of the same variance, which is right to the third order.
    pub(super) fn gaussian(&self) -> f32 {
        if self.size2() < 0.2 {
            let (det, solved) = self.solve(1.0, 2.0);
            return (-(self.middle.dot(solved)) / det).exp() / det.sqrt();
        }
        // Axes along and perpendicular to `across`.
        let width = self.across.length();
        let x_axis = self.across / width;
        let turned = |p: Vec2| Vec2::new(x_axis.dot(p), x_axis.perp_dot(p));
        let along = turned(self.along);
        let base = turned(self.middle) + along * (self.taper / 3.0);
        // Half the mean over x at t, times what the width is there over the mean width.
        let over_x = |t: f32| {
            let (x, half) = (base.x + along.x * t, width * (1.0 - self.taper * t));
            error_function(x + half) - error_function(x - half)
        };
        let height = along.y.abs();
        if height < 0.7 {
            let at = |(t, weight): (f32, f32)| weight * (-(base.y + along.y * t).powi(2)).exp() * over_x(t);
            return THREE.into_iter().map(at).sum::<f32>() / (4.0 * FRAC_2_SQRT_PI * width);
        }
        // Even steps of the error function are steps of equal weight.
        let (low, high) = (error_function(base.y - height), error_function(base.y + height));
        let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
        let at = |(node, weight): (f32, f32)| {
            let y = inverse_error_function(center + half * node);
            weight * over_x(((y - base.y) / along.y).clamp(-1.0, 1.0))
        };
        FRAC_PI_4 * half * FOUR.into_iter().map(at).sum::<f32>() / (4.0 * width * height)
    }

    /// Mean of 1/(1 + |p|²)².
    ///
    /// The integral over the triangle between the origin and an edge is elementary; where the trapezoid is small these
    /// would cancel, and a series of the second order takes their place.
    pub(super) fn ggx(&self) -> f32 {
        let fall = (1.0 + self.middle.length_squared()).recip();
        if self.size2() * fall < 0.03 {
            let (s, t) = self.variances();
            let (u, v) = (self.across, self.along);
            let (mu, mv) = (self.middle.dot(u), self.middle.dot(v));
            let curvature = 12.0 * fall * fall * (s * mu * mu + t * mv * mv)
                - 2.0 * fall * (s * u.length_squared() + t * v.length_squared());
            return fall * fall * (1.0 + curvature);
        }
        let (wide, narrow) = (self.across * (1.0 + self.taper), self.across * (1.0 - self.taper));
        let base = self.middle + self.along * (self.taper / 3.0);
        let corners = [
            base - self.along - wide,
            base - self.along + wide,
            base + self.along + narrow,
            base + self.along - narrow,
        ];
        let mut sum = 0.0;
        for (k, &from) in corners.iter().enumerate() {
            let edge = corners[(k + 1) % 4] - from;
            let length2 = edge.length_squared();
            if length2 > 0.0 {
                let length = length2.sqrt();
                let (distance, start) = (from.perp_dot(edge) / length, from.dot(edge) / length);
                let root = (1.0 + distance * distance).sqrt();
                sum += distance / root * (length * root).atan2(root * root + start * (start + length));
            }
        }
        0.5 * sum.abs() / self.area()
    }
}

/// erf, to 2·10⁻⁷ (Abramowitz and Stegun, "Handbook of Mathematical Functions", 7.1.26).
#[inline]
fn error_function(x: f32) -> f32 {
    let size = x.abs();
    let t = (1.0 + 0.327_591_1 * size).recip();
    let series = t * (0.254_829_6 + t * (-0.284_496_72 + t * (1.421_413_8 + t * (-1.453_152 + t * 1.061_405_4))));
    (1.0 - series * (-size * size).exp()).copysign(x)
}

/// Its inverse in −1…1, at most ±4 (M. Giles, "Approximating the erfinv function", GPU Computing Gems 2, 2010).
#[inline]
fn inverse_error_function(x: f32) -> f32 {
    let w = -((1.0 - x) * (1.0 + x)).max(1e-7).ln();
    let series = if w < 5.0 {
        const C: [f32; 9] = [
            2.810_226_4e-8,
            3.432_739_4e-7,
            -3.523_387_7e-6,
            -4.391_506_5e-6,
            2.185_808_7e-4,
            -1.253_725e-3,
            -4.177_681_6e-3,
            0.246_640_73,
            1.501_409_4,
        ];
        C.into_iter().fold(0.0, |sum, c| sum * (w - 2.5) + c)
    } else {
        const C: [f32; 9] = [
            -2.002_142_6e-4,
            1.009_505_6e-4,
            1.349_343_2e-3,
            -3.673_428_4e-3,
            5.739_507_7e-3,
            -7.622_461_3e-3,
            9.438_870_5e-3,
            1.001_674,
            2.832_976_8,
        ];
        C.into_iter().fold(0.0, |sum, c| sum * (w.sqrt() - 3.0) + c)
    };
    series * x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of `f(squared distance)` over a trapezoid, by midpoints.
    fn mean_over(t: &Trapezoid, f: impl Fn(f64) -> f64) -> f64 {
        const N: usize = 400;
        let (mut sum, mut weights) = (0.0, 0.0);
        for j in 0..N {
            let b = 2.0 * (j as f64 + 0.5) / N as f64 - 1.0;
            let weight = 1.0 - f64::from(t.taper) * b;
            for k in 0..N {
                let a = (2.0 * (k as f64 + 0.5) / N as f64 - 1.0) * weight;
                let along = b + f64::from(t.taper) / 3.0;
                let p = t.middle.as_dvec2() + a * t.across.as_dvec2() + along * t.along.as_dvec2();
                sum += weight * f(p.length_squared());
                weights += weight;
            }
        }
        sum / weights
    }

    #[test]
    fn means_over_trapezoids_of_both_lobes() {
        let shapes = [
            (Vec2::new(0.2, 0.1), Vec2::new(-0.1, 0.15), 0.0),
            (Vec2::new(0.5, 0.2), Vec2::new(-0.2, 0.6), 0.0),
            (Vec2::new(1.5, 0.3), Vec2::new(0.2, 1.1), 0.0),
            (Vec2::new(0.9, 0.2), Vec2::new(-0.3, 1.2), 1.0),
            (Vec2::new(6.0, 0.0), Vec2::new(0.1, 0.05), 0.0),
            (Vec2::new(0.05, 0.1), Vec2::new(5.0, 0.5), 0.0),
            (Vec2::new(4.0, 3.0), Vec2::new(-3.0, 5.0), 0.0),
            (Vec2::new(4.0, 3.0), Vec2::new(-1.0, 5.0), 1.0),
            (Vec2::new(12.0, 2.0), Vec2::new(3.0, -11.0), 0.3),
        ];
        for (across, along, taper) in shapes {
            let about = |middle| Trapezoid { middle, across, along, taper };
            let (center, reach) = (about(Vec2::ZERO), across.length() + along.length());
            let (gauss_peak, ggx_peak) =
                (mean_over(&center, |x| (-x).exp()), mean_over(&center, |x| (1.0 + x).powi(-2)));
            for k in 0..40 {
                let turn = Vec2::from_angle(2.4 * k as f32);
                let t = about(turn * ((k as f32 + 0.5) / 40.0).sqrt() * (reach + 2.0));
                let gauss = mean_over(&t, |x| (-x).exp());
                let off = (f64::from(t.gaussian()) - gauss).abs() / gauss_peak;
                assert!(off < 0.012, "Gaussian over {t:?}: {}, not {gauss}, off by {off} of the peak", t.gaussian());
                let ggx = mean_over(&t, |x| (1.0 + x).powi(-2));
                let off = (f64::from(t.ggx()) - ggx).abs() / ggx_peak;
                assert!(off < 0.004, "GGX over {t:?}: {}, not {ggx}, off by {off} of the peak", t.ggx());
            }
        }
    }

    #[test]
    fn error_functions() {
        // From tables.
        let table = [(0.0, 0.0), (0.5, 0.520_499_9), (1.0, 0.842_700_8), (2.0, 0.995_322_3), (-0.1, -0.112_462_9)];
        for (x, value) in table {
            assert!((error_function(x) - value).abs() < 4e-7, "erf {x}");
            assert!(
                (inverse_error_function(value) - x).abs() < 1e-4,
                "its inverse at {value}: {}",
                inverse_error_function(value)
            );
        }
        assert!(inverse_error_function(1.0).is_finite() && inverse_error_function(-1.0).is_finite(), "at the ends");
    }
}

//! Senders with a contour: lobes averaged over trapezoids.
//!
//! What [`extent`](super::extent) says of disks holds for any small shape: seen through the slopes of half vectors it is
//! mapped linearly. A trapezoid stays one, and the mean over it of either lobe is exact or nearly: of the GGX density the
//! integral is a sum over edges, of a Gaussian an integral along one axis of error functions along the other.
//!
//! Senders that are near are seen in perspective, and the map to slopes bends them. So the trapezoid is that of the linear map where
//! lobe and sender meet, and what the second order adds is counted as it is on average over the product of both ([`Expansion`]).

use super::HORIZON;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_2_SQRT_PI, FRAC_PI_4};
use wide::f32x4;

/// Contour of a flat sender: a trapezoid about its middle, the directions of
/// middle + s (1 − taper t) across + (t + taper/3) along, for −1 ≤ s, t ≤ 1, the middle's being of unit length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contour {
    /// Half of the mean width over the distance of the middle.
    across: Vec3,
    /// Half of the height, likewise.
    along: Vec3,
    /// 0 for a parallelogram, 1 for a triangle.
    taper: f32,
    /// Tangent of the angle about the middle that holds it; 0 where the sender has no contour.
    reach: f32,
}

/// A contour shows if it reaches this many widths of a lobe far. Directions turn by twice as much as half vectors, so that the
/// variance of a smaller one is below a fiftieth of the lobe's.
const SHOWN: f32 = 0.25;
/// Wider contours than this (a tangent) are not seen as a part of a plane any more.
const WIDEST: f32 = 0.8;

impl Contour {
    /// Nothing is known of the sender's shape.
    pub const NONE: Self = Self { across: Vec3::ZERO, along: Vec3::ZERO, taper: 0.0, reach: 0.0 };

    /// From the unit direction of the sender's middle; half of the mean width and of the height, as vectors in units of the
    /// middle's distance; and a taper of 0…1. What is too wide, or no number, has none.
    #[must_use]
    pub fn new(middle: Vec3, across: Vec3, along: Vec3, taper: f32) -> Self {
        let taper = taper.clamp(0.0, 1.0);
        let recede = [across, along].map(|side| middle.dot(side));
        let [aside, above] = [across - middle * recede[0], along - middle * recede[1]];
        let tangent2 = |(s, t): (f32, f32)| {
            let depth = (1.0 + s * recede[0] + t * recede[1]).max(0.0);
            (aside * s + above * t).length_squared() / (depth * depth)
        };
        let (wide, narrow) = (1.0 + taper, 1.0 - taper);
        let (low, high) = (taper / 3.0 - 1.0, taper / 3.0 + 1.0);
        let corners = [(wide, low), (-wide, low), (narrow, high), (-narrow, high)];
        let reach = corners.map(tangent2).into_iter().fold(0.0, f32::max).sqrt();
        if reach <= WIDEST { Self { across, along, taper, reach } } else { Self::NONE }
    }

    /// Tangent of the angle about the middle that holds it; 0 where the sender has no contour.
    #[must_use]
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// The same about its middle, each side seen at least as long as that of a square as large as a disk of this radius.
    pub(super) fn widened(&self, middle: Vec3, least: f32) -> Self {
        // √π/2
        let least = 0.886_226_9 * least;
        let widened = |side: Vec3| {
            let seen = side - middle * middle.dot(side);
            side + seen * (least / seen.length().max(f32::MIN_POSITIVE) - 1.0).max(0.0)
        };
        if self.reach > 0.0 { Self::new(middle, widened(self.across), widened(self.along), self.taper) } else { *self }
    }

    /// Whether all of it is above the horizon, seen about `middle`, and a lobe of half-vector slopes as wide as this (RMS) shows that
    /// it is no disk.
    #[inline]
    pub(super) fn shows(&self, middle: Vec3, width: f32) -> bool {
        self.reach > SHOWN * width && middle.z - self.reach > HORIZON
    }

    /// To the second order about the mean of its product with a lobe.
    #[inline]
    pub(super) fn about(&self, middle: Vec3, product: Product) -> Expansion {
        let [s, t] = product.mean;
        let moved = middle + self.across * s + self.along * t;
        let nearness = moved.length_recip();
        let incident = moved * nearness;
        let sides = [self.across * nearness, self.along * nearness];
        let recede = sides.map(|side| incident.dot(side));
        let turns = [sides[0] - incident * recede[0], sides[1] - incident * recede[1]];
        Expansion { incident, turns, recede, nearness, product, taper: self.taper }
    }

    /// What a linear map to slopes makes of it about the slope of its middle.
    #[inline]
    pub(super) fn mapped(&self, middle: Vec2, map: impl Fn(Vec3) -> Vec2) -> Trapezoid {
        Trapezoid { middle, across: map(self.across), along: map(self.along), taper: self.taper }
    }
}

/// Product of a lobe and a contour, both taken for Gaussians, in steps s and t along the contour's sides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Product {
    /// As far as it is within the contour.
    mean: [f32; 2],
    /// ss, st, tt.
    covariance: [f32; 3],
}

/// A contour to the second order about the direction where it meets a lobe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expansion {
    /// The direction.
    pub incident: Vec3,
    /// What it turns by with a step along each side.
    pub turns: [Vec3; 2],
    /// Share of the distance that is added.
    recede: [f32; 2],
    /// Distance of the sender's middle over that in this direction.
    nearness: f32,
    product: Product,
    taper: f32,
}

impl Expansion {
    /// Mean squared angle from the direction after steps of such a covariance.
    #[inline]
    fn spread(&self, [ss, st, tt]: [f32; 3]) -> f32 {
        let [u, v] = self.turns;
        ss * u.length_squared() + 2.0 * st * u.dot(v) + tt * v.length_squared()
    }

    /// What a map to a plane makes of it. `at` is what it makes of the direction, `map` the derivative there; a step along each side
    /// changes that by the factor 1 − `shrinks`, and what turns by |x| moves by −`fall` |x|²/2.
    ///
    /// The image is a parallel to that of the linear map, through the mean of what is right.
    #[inline]
    pub(super) fn mapped(&self, at: Vec2, shrinks: [f32; 2], fall: Vec2, map: impl Fn(Vec3) -> Vec2) -> Trapezoid {
        let ([s, t], [ss, st, tt]) = (self.product.mean, self.product.covariance);
        let [across, along] = self.turns.map(map);
        let [x, y] = [self.recede[0] + shrinks[0], self.recede[1] + shrinks[1]];
        let back = across * (s + ss * x + st * y) + along * (t + st * x + tt * y);
        let middle = at - back - fall * (0.5 * self.spread(self.product.covariance));
        Trapezoid { middle, across, along, taper: self.taper }
    }

    /// Irradiance that an area of the sender makes where it meets the lobe over the mean of its areas. `cosine` is that of its middle;
    /// what else the lobe is multiplied by is counted, too, as far as it rises by the share `rise` |x|² at an angle |x|.
    ///
    /// Areas count by cosine/distance⁴, the cosine not being that of a unit vector: in second order by −2 |x|² + 10 recede². What
    /// the cosine adds to that is left out, so that nothing can become negative.
    #[inline]
    pub(super) fn weight(&self, cosine: f32, rise: f32) -> f32 {
        let ([ss, _, tt], (s, t)) = (self.product.covariance, variances(self.taper));
        let bulge = 2.0 * self.spread([s, 0.0, t]) - (2.0 - rise) * self.spread(self.product.covariance);
        let [x, y] = self.recede;
        let depth = 10.0 * (x * x * (s - ss) + y * y * (t - tt));
        self.incident.z * self.nearness.powi(3) * (1.0 + bulge) / (cosine * (1.0 + depth))
    }
}

/// A [`Contour`] in the plane of slopes, about a lobe in the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trapezoid {
    /// Its centroid.
    pub middle: Vec2,
    pub across: Vec2,
    pub along: Vec2,
    pub taper: f32,
}

/// Variances of s (1 − taper t) and t over a trapezoid.
#[inline]
fn variances(taper: f32) -> (f32, f32) {
    let taper2 = taper * taper;
    ((1.0 + taper2) / 3.0, 1.0 / 3.0 - taper2 / 9.0)
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

    /// For M = `lobe` I + covariance: det M and (det M) M⁻¹ middle.
    #[inline]
    fn solve(&self, lobe: f32, share: f32) -> (f32, Vec2) {
        let (s, t) = variances(self.taper);
        let (u, v, m) = (self.across, self.along, self.middle);
        let xx = lobe + share * (s * u.x * u.x + t * v.x * v.x);
        let xy = share * (s * u.x * u.y + t * v.x * v.y);
        let yy = lobe + share * (s * u.y * u.y + t * v.y * v.y);
        let det = (xx * yy - xy * xy).max(lobe * lobe);
        (det, Vec2::new(yy * m.x - xy * m.y, xx * m.y - xy * m.x))
    }

    /// With a lobe of a variance about the origin.
    // Called out of line it would cost a tenth of all there is to do for a contour.
    #[inline(always)]
    pub(super) fn product(&self, variance: f32) -> Product {
        let (s, t) = variances(self.taper);
        let (u, v) = (self.across, self.along);
        // The inverse of the covariance is the sum of those of both: of diag(s, t), and of (u v)ᵀ(u v) / variance as it is.
        let (uu, uv, vv) = (variance + s * u.length_squared(), u.dot(v), variance + t * v.length_squared());
        let share = (uu * vv - s * t * uv * uv).max(variance * variance).recip();
        let (mu, mv) = (self.middle.dot(u), self.middle.dot(v));
        let third = self.taper / 3.0;
        let along = (t * share * (s * uv * mu - uu * mv)).clamp(third - 1.0, third + 1.0);
        let half = 1.0 - self.taper * (along - third);
        let across = (s * share * (t * uv * mv - vv * mu)).clamp(-half, half);
        Product { mean: [across, along], covariance: [s * vv, -s * t * uv, t * uu].map(|x| x * (share * variance)) }
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
            let (s, t) = variances(self.taper);
            let (u, v) = (self.across, self.along);
            let (mu, mv) = (self.middle.dot(u), self.middle.dot(v));
            let curvature = 12.0 * fall * fall * (s * mu * mu + t * mv * mv)
                - 2.0 * fall * (s * u.length_squared() + t * v.length_squared());
            return fall * fall * (1.0 + curvature);
        }
        // Edges side by side: signs of `along` and shares of `across` at the corner that each starts from and that it ends at.
        let (wide, narrow) = (1.0 + self.taper, 1.0 - self.taper);
        let base = self.middle + self.along * (self.taper / 3.0);
        let corners = |signs: [f32; 4], shares: [f32; 4]| {
            let (signs, shares) = (f32x4::new(signs), f32x4::new(shares));
            let at = |axis: usize| base[axis] + self.along[axis] * signs + self.across[axis] * shares;
            (at(0), at(1))
        };
        let (x, y) = corners([-1.0, -1.0, 1.0, 1.0], [-wide, wide, narrow, -narrow]);
        let (to_x, to_y) = corners([-1.0, 1.0, 1.0, -1.0], [wide, narrow, -narrow, -wide]);
        let (edge_x, edge_y) = (to_x - x, to_y - y);
        let length2 = edge_x * edge_x + edge_y * edge_y;
        let length = length2.sqrt();
        let (distance, start) = ((x * edge_y - y * edge_x) / length, (x * edge_x + y * edge_y) / length);
        let root = (1.0 + distance * distance).sqrt();
        let angle = (length * root).atan2(root * root + start * (start + length));
        let sum = (length2.simd_gt(f32x4::ZERO) & (distance / root * angle)).reduce_add();
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

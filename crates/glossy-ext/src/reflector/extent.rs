//! Senders that are disks: what is visible of them above the horizon, and lobes averaged over them.
//!
//! What is wanted is the average of f cos over the disk by the average of cos. Ward's and the GGX model are a density p
//! of the half vector's *slope* s = (x, y)/z of h = incident + outgoing, times a smooth factor. A small disk of incident
//! directions of angular radius r becomes an ellipse of slopes with the matrix E = r² J Jᵀ, where J is the derivative of
//! the slope by the incident direction. Its average of p is known or fits a closed form; the ellipse is turned into a
//! circle of the same area by a linear map that is exact for lobes that are much wider than the sender and for
//! lobes that are much narrower. The smooth factor, the cosine and J are taken where the lobe and the disk meet: at the
//! mean of the product of two Gaussians in their place ([`Meeting`]).

use super::contour::Trapezoid;
use super::{Contour, HORIZON};
use glam::{Vec2, Vec3};

/// The visible part of a sender.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disk {
    /// Middle of the part above the horizon.
    pub middle: Vec3,
    /// Solid angle / π: square of the radius of a small disk.
    pub radius2: f32,
    /// Mean cosine to the normal.
    pub mean_cos: f32,
}

impl Disk {
    /// The part above the horizon of a disk of angular radius `extent` about `direction`; none where nothing is visible.
    #[inline]
    pub(super) fn new(direction: Vec3, extent: f32) -> Option<Self> {
        let z = direction.z;
        let is_point = extent <= 0.0 || extent.is_nan();
        if is_point {
            return (z > HORIZON).then_some(Self { middle: direction, radius2: 0.0, mean_cos: z });
        }
        let extent2 = extent.min(std::f32::consts::FRAC_PI_2).powi(2);
        // 2 (1 − cos extent), 1 % off at π/2.
        let radius2 = extent2 * (1.0 - extent2 * (1.0 / 12.0 - extent2 / 360.0));
        let steep2 = (1.0 - z * z).max(0.0);
        if z > HORIZON && z * z >= extent2 * steep2 {
            return Some(Self { middle: direction, radius2, mean_cos: (z * (1.0 - 0.25 * radius2)).max(HORIZON) });
        }
        // Seen along the height, the disk is a semicircle of half-width `reach` about z, cut at 0.
        let steep = steep2.sqrt();
        let reach = extent2.sqrt() * steep;
        if z + reach <= HORIZON || reach == 0.0 {
            return None;
        }
        // A parabola through the mean height at t = 1 (1), at t = 0 (4/3π) and at t = −1 (0).
        let t = (z / reach).min(1.0);
        let mean = (0.4244 + t * (0.5 + t * 0.0756)).max(0.0);
        // Area of a circle's segment, with the right slopes at t = 0 and 1 (within 1 % of the circle).
        let t2 = t * t;
        let area = (0.5 + t * (std::f32::consts::FRAC_2_PI - t2 * (0.0232 + 0.1134 * t2))).max(0.0);
        let turn = extent2.sqrt() * (mean - t) / steep;
        let moved = direction + turn * (Vec3::Z - z * direction);
        let middle = moved / moved.length().max(f32::MIN_POSITIVE);
        let disk = Self { middle, radius2: radius2 * area, mean_cos: (reach * mean).max(HORIZON) };
        (middle.z > HORIZON).then_some(disk)
    }
}

/// Slopes of the half vectors between an outgoing direction and incident ones.
#[derive(Clone, Copy, Debug)]
struct Slopes {
    incident: Vec3,
    /// incident + outgoing.
    half: Vec3,
    inv_z: f32,
    /// Slopes are multiplied by this, to make the lobe round.
    stretch: Vec2,
    /// Not stretched.
    slope: Vec2,
    // J Jᵀ, stretched.
    xx: f32,
    xy: f32,
    yy: f32,
}

/// Half vectors are at least this high; grazing pairs would else overflow. The largest slope that matters is ten times
/// the roughness.
const LARGEST: f32 = 1e15;

impl Slopes {
    #[inline]
    fn new(incident: Vec3, outgoing: Vec3, stretch: Vec2) -> Self {
        let h = incident + outgoing;
        let inv_z = h.z.recip();
        let (x, y) = (h.x * inv_z, h.y * inv_z);
        // Rows of the slope's gradient by h, times h.z, are (1, 0, −x) and (0, 1, −y); their parts along the incident
        // direction do not count, since that is of unit length.
        let (p, q) = (incident.x - x * incident.z, incident.y - y * incident.z);
        let scale = inv_z * inv_z;
        Self {
            incident,
            half: h,
            inv_z,
            stretch,
            slope: Vec2::new(x, y),
            xx: (scale * stretch.x * stretch.x * (1.0 + x * x - p * p)).clamp(0.0, LARGEST),
            xy: (scale * stretch.x * stretch.y * (x * y - p * q)).clamp(-LARGEST, LARGEST),
            yy: (scale * stretch.y * stretch.y * (1.0 + y * y - q * q)).clamp(0.0, LARGEST),
        }
    }

    /// J v, for any v.
    #[inline]
    fn slope_of(&self, v: Vec3) -> Vec2 {
        self.slope_of_half(v - self.incident * self.incident.dot(v))
    }

    /// Change of the slope with the half vector, J v for v perpendicular to the incident direction.
    #[inline]
    fn slope_of_half(&self, v: Vec3) -> Vec2 {
        (v.truncate() - self.slope * v.z) * self.stretch * self.inv_z
    }

    /// Jᵀ v.
    #[inline]
    fn direction_of(&self, v: Vec2) -> Vec3 {
        let v = v * self.stretch;
        let g = v.extend(-self.slope.dot(v)) * self.inv_z;
        g - self.incident * self.incident.dot(g)
    }

    /// √det M and (det M) M⁻¹ s, for M = `lobe`·I + `share`·J Jᵀ.
    #[inline]
    fn solve(&self, lobe: f32, share: f32, s: Vec2) -> (f32, Vec2) {
        let (xx, xy, yy) = (lobe + share * self.xx, share * self.xy, lobe + share * self.yy);
        let root = (xx * yy - xy * xy).max(lobe * lobe).sqrt();
        (root, Vec2::new(yy * s.x - xy * s.y, xx * s.y - xy * s.x))
    }
}

/// Where a lobe of half-vector slopes and a disk of incident directions meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meeting {
    /// The incident direction that stands for the product of both.
    pub incident: Vec3,
    /// h = incident + outgoing there, not normalised.
    pub h: Vec3,
    /// Squared slope of h.
    pub tan2: f32,
    /// Cosine there / mean cosine of the sender.
    pub weight: f32,
    radius2: f32,
    slopes: Slopes,
    /// Stretched slope of the disk's middle, as seen by the linear map.
    middle: Vec2,
}

impl Meeting {
    /// `stretch` is what slopes are multiplied by to make the lobe round; `variance` is that of the lobe's stretched
    /// slopes, per axis, as a function of their square.
    #[inline]
    pub(super) fn new(disk: &Disk, outgoing: Vec3, stretch: Vec2, variance: impl Fn(f32) -> f32) -> Self {
        let mut slopes = Slopes::new(disk.middle, outgoing, stretch);
        let mut middle = slopes.slope * stretch;
        let variance = variance(middle.length_squared());
        let share = 0.25 * disk.radius2;
        // Disks that are small against the lobe need no second look.
        if share * (slopes.xx + slopes.yy) > 1e-3 * variance {
            let (root, solved) = slopes.solve(variance, share, middle);
            let mut step = slopes.direction_of(solved) * (-share / (root * root));
            let length2 = step.length_squared();
            if length2 > disk.radius2 {
                step *= (disk.radius2 / length2).sqrt();
            }
            let moved = disk.middle + step;
            let incident = moved / moved.length();
            if incident.z > HORIZON {
                slopes = Slopes::new(incident, outgoing, stretch);
                middle = slopes.slope * stretch + slopes.slope_of(disk.middle - incident);
            }
        }
        Self::at(slopes, middle, disk.radius2, slopes.incident.z / disk.mean_cos)
    }

    #[inline]
    fn at(slopes: Slopes, middle: Vec2, radius2: f32, weight: f32) -> Self {
        Self {
            incident: slopes.incident,
            h: slopes.half,
            tan2: slopes.slope.length_squared(),
            weight,
            radius2,
            slopes,
            middle,
        }
    }

    /// The same for a sender with a contour, all of which is above the horizon; and what the contour is in the plane of
    /// stretched slopes. The smooth factor rises by the share `rise` |x|² at an angle |x|.
    #[inline]
    pub(super) fn within(
        (disk, contour): (&Disk, &Contour),
        outgoing: Vec3,
        stretch: Vec2,
        variance: impl Fn(f32) -> f32,
        rise: f32,
    ) -> (Self, Trapezoid) {
        let slopes = Slopes::new(disk.middle, outgoing, stretch);
        let middle = slopes.slope * stretch;
        let outline = contour.mapped(middle, |side| slopes.slope_of(side));
        let expansion = contour.about(disk.middle, outline.product(variance(middle.length_squared())));
        let slopes = Slopes::new(expansion.incident, outgoing, stretch);
        // Slopes are in proportion to 1/h.z; and a direction that turns by |x| is shorter by |x|²/2 along what it was.
        let shrinks = expansion.turns.map(|turn| turn.z * slopes.inv_z);
        let fall = slopes.slope_of_half(expansion.incident);
        let outline = expansion.mapped(slopes.slope * stretch, shrinks, fall, |turn| slopes.slope_of_half(turn));
        let meeting = Self::at(slopes, outline.middle, disk.radius2, expansion.weight(disk.middle.z, rise));
        (meeting, outline)
    }

    /// For M = `lobe`·I + `share`·E: √det M, and √det M × sᵀM⁻¹s with the stretched slope s of the disk's middle.
    #[inline]
    pub(super) fn rounded(&self, lobe: f32, share: f32) -> (f32, f32) {
        let (root, solved) = self.slopes.solve(lobe, share * self.radius2, self.middle);
        (root, (self.middle.dot(solved) / root).max(0.0))
    }
}

/// exp(−x) with x = (distance/a)², averaged over a disk of radius r, with y = (r/a)²; 0…1.
///
/// The exact average is a Marcum Q function. In its place stands A / (1 − q + exp(x/τ − λ)), q = exp(−λ): a Gaussian for
/// small disks (λ → 0) and flat with soft edges for large ones. A makes the middle exact and τ the energy; λ(y) is a
/// fit. The largest error is 3.2 % of the middle's value, at y around 12; below y = 3 it is 0.5 %.
#[inline]
pub(super) fn gaussian_over_disk(x: f32, y: f32) -> f32 {
    let peak = exp_mean(y);
    if y < 0.1 {
        // λ < 1/400 changes less than 10⁻⁴.
        return peak * (-x * peak).exp();
    }
    let lambda = y * y / (4.0 + y * y.sqrt() / 1.2);
    let mean = exp_mean(lambda);
    let exponent = x * peak / mean - lambda;
    if exponent > 80.0 {
        return 0.0;
    }
    peak / (lambda * mean + exponent.exp())
}

/// (1 − exp(−t))/t, the mean of exp(−t…0), for t ≥ 0.
#[inline]
fn exp_mean(t: f32) -> f32 {
    if t < 0.1 { 1.0 - t * (0.5 - t * (1.0 / 6.0 - t * (1.0 / 24.0))) } else { (1.0 - (-t).exp()) / t }
}

/// 1/(1 + x)² with x = (distance/a)², averaged over a disk of radius r, with y = (r/a)²; exact.
///
/// The GGX density of slopes is what stereographic projection makes of a uniform density on the sphere; it takes
/// disks to caps, so the average is the area of a cap over that of the disk.
#[inline]
pub(super) fn ggx_over_disk(x: f32, y: f32) -> f32 {
    let a = 1.0 + x - y;
    let s = (a * a + 4.0 * y).sqrt();
    if a > 0.0 { 2.0 / (s * (s + a)) } else { (s - a) / (2.0 * y * s) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of `f(squared distance)` over a disk of radius `r` whose middle is `d` away from the origin.
    fn over_disk(f: impl Fn(f64) -> f64, d: f64, r: f64) -> f64 {
        // Midpoints of equal area; many, since the lobe may be a tenth or less of the disk.
        const N: usize = 1000;
        const TURNS: usize = 200;
        let mut sum = 0.0;
        for j in 0..N {
            let radius = r * ((j as f64 + 0.5) / N as f64).sqrt();
            for k in 0..TURNS {
                let angle = std::f64::consts::TAU * (k as f64 + 0.5) / TURNS as f64;
                sum += f(d * d + radius * radius + 2.0 * d * radius * angle.cos());
            }
        }
        sum / (N * TURNS) as f64
    }

    #[test]
    fn disk_averages_of_both_lobes() {
        for y in [0.0_f64, 0.01, 0.09, 0.11, 0.5, 1.0, 3.0, 10.0, 16.0, 100.0] {
            let r = y.sqrt();
            let (gauss_peak, ggx_peak) = (over_disk(|x| (-x).exp(), 0.0, r), over_disk(|x| (1.0 + x).powi(-2), 0.0, r));
            for k in 0..15 {
                let d = k as f64 / 5.0 * (1.0 + r).min(r + 2.0);
                let gauss = over_disk(|x| (-x).exp(), d, r);
                let ggx = over_disk(|x| (1.0 + x).powi(-2), d, r);
                let x = (d * d) as f32;
                let allowed = if y < 3.1 { 0.006 } else { 0.035 };
                let error = (f64::from(gaussian_over_disk(x, y as f32)) - gauss).abs() / gauss_peak;
                assert!(error < allowed, "Gaussian over a disk, y = {y}, d = {d}: off by {error} of the peak");
                let error = (f64::from(ggx_over_disk(x, y as f32)) - ggx).abs() / ggx_peak;
                assert!(error < 0.003, "GGX over a disk, y = {y}, d = {d}: off by {error} of the peak");
            }
        }
    }

    #[test]
    fn visible_part_of_a_disk() {
        for (elevation, extent) in [(1.5_f32, 0.3_f32), (0.6, 0.5), (0.3, 0.3), (0.1, 0.3), (0.0, 0.2), (-0.1, 0.2)] {
            let direction = Vec3::new(elevation.cos(), 0.0, elevation.sin());
            let tangent = Vec3::new(-elevation.sin(), 0.0, elevation.cos());
            let (mut sum, mut count) = (Vec3::ZERO, 0.0);
            for j in 0..300 {
                let radius = extent * ((j as f32 + 0.5) / 300.0).sqrt();
                for k in 0..300 {
                    let (s, c) = (std::f32::consts::TAU * (k as f32 + 0.5) / 300.0).sin_cos();
                    let v = direction * radius.cos() + (tangent * c + Vec3::Y * s) * radius.sin();
                    if v.z > 0.0 {
                        sum += v;
                        count += 1.0;
                    }
                }
            }
            assert!(count > 0.0, "the case has something visible");
            let disk = Disk::new(direction, extent).expect("part of the disk is above the horizon");
            let off = disk.middle.angle_between(sum.normalize());
            assert!(off < 0.07 * extent, "elevation {elevation}, extent {extent}: middle off by {off} rad");
            let mean_cos = sum.z / count;
            let error = (disk.mean_cos / mean_cos - 1.0).abs();
            assert!(error < 0.08, "elevation {elevation}, extent {extent}: mean cosine off by {error}");
            let radius2 = 2.0 * (1.0 - extent.cos()) * count / 90_000.0;
            let error = (disk.radius2 / radius2 - 1.0).abs();
            assert!(error < 0.06, "elevation {elevation}, extent {extent}: solid angle off by {error}");
        }
        assert!(Disk::new(Vec3::new(0.8, 0.0, -0.6), 0.3).is_none(), "a disk below the horizon");
    }
}

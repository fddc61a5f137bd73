//! Senders that are disks: what is visible of them above the horizon, and lobes averaged over them.
//!
//! Both glossy models are functions of the half vector's *slope* s = (x, y)/z of h = incident + outgoing. A small
//! disk of incident directions of angular radius e becomes an ellipse of slopes with the matrix E = e² J Jᵀ, where J
//! is the derivative of the slope by the incident direction. Its average over a round lobe is known or fits a
//! closed form; the ellipse is turned into a circle of the same area by a linear map that is exact for lobes that are
//! much wider than the sender and for lobes that are much narrower.

use super::HORIZON;
use glam::Vec3;

/// The part above the horizon of a disk of angular radius `extent` about `direction`: its cosine-weighted mean
/// direction and the angular radius of a disk of the same area; none where nothing is visible.
#[inline]
pub(super) fn visible(direction: Vec3, extent: f32) -> Option<(Vec3, f32)> {
    let z = direction.z;
    if !(extent > 0.0) {
        return (z > HORIZON).then_some((direction, 0.0));
    }
    let extent = extent.min(std::f32::consts::FRAC_PI_2);
    let steep = (1.0 - z * z).max(0.0).sqrt();
    let reach = extent * steep;
    if !(z + reach > HORIZON) {
        return None;
    }
    // Seen along the height, the disk is a semicircle of half-width `reach` about z. The mean of the height weighted
    // by itself is z + reach²/4z while the disk is above the horizon.
    if z >= reach {
        let turn = extent * extent / (4.0 * z);
        return Some((turned_up(direction, turn), extent));
    }
    // Cut by the horizon: a parabola through the mean at t = 1 (5/4), at t = 0 (3π/16 of the half disk) and 0 at
    // t = −1 is within 1 % of the true mean of heights weighted by themselves.
    let t = z / reach;
    let mean = 0.589 + t * (0.625 + t * 0.036);
    // Area of a circle's segment, as a cubic (within 2 % of the circle).
    let area = (0.5 + t * (0.75 - 0.25 * t * t)).max(0.0);
    let middle = turned_up(direction, extent * (mean - t) / steep);
    (middle.z > HORIZON).then_some((middle, extent * area.sqrt()))
}

/// `direction` moved toward the normal by `turn` × the sine of its angle to the normal.
#[inline]
fn turned_up(direction: Vec3, turn: f32) -> Vec3 {
    let moved = direction + turn * (Vec3::Z - direction.z * direction);
    moved * moved.length_squared().sqrt().recip()
}

/// Slopes of the half vectors between an outgoing direction and a disk of incident ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slopes {
    /// h = incident + outgoing, not normalised.
    pub h: Vec3,
    /// 1/h.z.
    pub inv_z: f32,
    /// Squared slope of h.
    pub squared: f32,
    x: f32,
    y: f32,
    // The ellipse's matrix E.
    xx: f32,
    xy: f32,
    yy: f32,
}

impl Slopes {
    #[inline]
    pub(super) fn new(incident: Vec3, outgoing: Vec3, extent: f32) -> Self {
        let h = incident + outgoing;
        let inv_z = h.z.recip();
        let (x, y) = (h.x * inv_z, h.y * inv_z);
        // Rows of the slope's gradient by h, times h.z, are (1, 0, −x) and (0, 1, −y); their parts along the incident
        // direction do not count, since that is of unit length.
        let (p, q) = (incident.x - x * incident.z, incident.y - y * incident.z);
        let scale = (extent * inv_z) * (extent * inv_z);
        Self {
            h,
            inv_z,
            squared: x * x + y * y,
            x,
            y,
            xx: scale * (1.0 + x * x - p * p).max(0.0),
            xy: scale * (x * y - p * q),
            yy: scale * (1.0 + y * y - q * q).max(0.0),
        }
    }

    /// An upper bound of the square of the ellipse's longer half-axis.
    #[inline]
    pub(super) fn reach_squared(&self) -> f32 {
        self.xx + self.yy
    }

    /// For M = `lobe`·I + `share`·E: √det M, and √det M × sᵀM⁻¹s.
    #[inline]
    pub(super) fn rounded(&self, lobe: f32, share: f32) -> (f32, f32) {
        let (xx, xy, yy) = (lobe + share * self.xx, share * self.xy, lobe + share * self.yy);
        let root = (xx * yy - xy * xy).max(lobe * lobe).sqrt();
        let squared = yy * self.x * self.x - 2.0 * xy * self.x * self.y + xx * self.y * self.y;
        (root, (squared / root).max(0.0))
    }
}

/// exp(−x) with x = (distance/a)², averaged over a disk of radius r, with y = (r/a)²; 0…1.
///
/// The exact average is a Marcum Q function. In its place stands A / (1 − q + exp(x/τ − λ)), q = exp(−λ): a Gaussian for
/// small disks (λ → 0) and flat with soft edges for large ones. A makes the middle exact and τ the energy; λ(y) is a
/// fit. The largest error is 3 % of the middle's value, at y around 16; below y = 3 it is 0.5 %.
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
        const N: usize = 200;
        let mut sum = 0.0;
        for j in 0..N {
            let radius = r * ((j as f64 + 0.5) / N as f64).sqrt();
            for k in 0..N {
                let angle = std::f64::consts::TAU * (k as f64 + 0.5) / N as f64;
                sum += f(d * d + radius * radius + 2.0 * d * radius * angle.cos());
            }
        }
        sum / (N * N) as f64
    }

    #[test]
    fn disk_averages_of_both_lobes() {
        for y in [0.0_f64, 0.01, 0.09, 0.11, 0.5, 1.0, 3.0, 10.0, 16.0, 100.0, 1000.0] {
            let r = y.sqrt();
            let (gauss_peak, ggx_peak) = (over_disk(|x| (-x).exp(), 0.0, r), over_disk(|x| (1.0 + x).powi(-2), 0.0, r));
            for k in 0..30 {
                let d = k as f64 / 10.0 * (1.0 + r).min(r + 2.0);
                let gauss = over_disk(|x| (-x).exp(), d, r);
                let ggx = over_disk(|x| (1.0 + x).powi(-2), d, r);
                let x = (d * d) as f32;
                let allowed = if y < 3.1 { 0.006 } else { 0.03 };
                let error = (f64::from(gaussian_over_disk(x, y as f32)) - gauss).abs() / gauss_peak;
                assert!(error < allowed, "Gaussian over a disk, y = {y}, d = {d}: off by {error} of the peak");
                // The sum itself is good to about 1/200 where the disk's edge is sharp against the lobe.
                let error = (f64::from(ggx_over_disk(x, y as f32)) - ggx).abs() / ggx_peak;
                assert!(error < 0.01, "GGX over a disk, y = {y}, d = {d}: off by {error} of the peak");
            }
        }
    }

    #[test]
    fn visible_part_of_a_disk() {
        for (elevation, extent) in [(1.5_f32, 0.3_f32), (0.6, 0.5), (0.3, 0.3), (0.1, 0.3), (0.0, 0.2), (-0.1, 0.2)] {
            let direction = Vec3::new(elevation.cos(), 0.0, elevation.sin());
            let tangent = Vec3::new(-elevation.sin(), 0.0, elevation.cos());
            let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
            for j in 0..300 {
                let radius = extent * ((j as f32 + 0.5) / 300.0).sqrt();
                for k in 0..300 {
                    let (s, c) = (std::f32::consts::TAU * (k as f32 + 0.5) / 300.0).sin_cos();
                    let v = direction * radius.cos() + (tangent * c + Vec3::Y * s) * radius.sin();
                    if v.z > 0.0 {
                        sum += v * v.z;
                        weight += v.z;
                    }
                }
            }
            assert!(weight > 0.0, "the case has something visible");
            let (middle, _) = visible(direction, extent).expect("part of the disk is above the horizon");
            let off = middle.angle_between(sum.normalize());
            assert!(off < 0.07 * extent, "elevation {elevation}, extent {extent}: mean direction off by {off} rad");
        }
        assert!(visible(Vec3::new(0.8, 0.0, -0.6), 0.3).is_none(), "a disk below the horizon");
    }
}

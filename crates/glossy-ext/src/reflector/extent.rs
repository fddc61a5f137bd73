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
use super::lanes::{Directions, LANES, Lanes, Plane};
use super::{Contour, HORIZON, Incident};
use glam::{Vec2, Vec3};

/// The visible parts of some senders, side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disks {
    /// Middles of the parts above the horizon.
    pub middle: Directions,
    /// Solid angles / π: squares of the radii of small disks.
    pub radius2: Lanes,
    /// Mean cosines to the normal.
    pub mean_cos: Lanes,
    /// Whether anything is visible (a mask).
    visible: Lanes,
}

impl Disks {
    /// The parts above the horizon of disks about directions, of given angular radii.
    #[inline]
    pub(super) fn new(direction: Directions, extent: Lanes) -> Self {
        let z = direction.z;
        // What is no number is a point.
        let extent = extent.max(Lanes::ZERO).fast_min(Lanes::FRAC_PI_2);
        let extent2 = extent * extent;
        // 2 (1 − cos extent), 1 % off at π/2.
        let radius2 = extent2 * (1.0 - extent2 * (1.0 / 12.0 - extent2 * (1.0 / 360.0)));
        let steep2 = (1.0 - z * z).fast_max(Lanes::ZERO);
        let horizon = Lanes::splat(HORIZON);
        let is_whole = z.simd_gt(horizon) & (z * z).simd_ge(extent2 * steep2);
        let mean_cos = (z * (1.0 - 0.25 * radius2)).fast_max(horizon);
        let whole = Self { middle: direction, radius2, mean_cos, visible: is_whole };
        // Seen along the height, the disk is a semicircle of half-width `reach` about z, cut at 0.
        let steep = steep2.sqrt();
        let reach = extent * steep;
        let is_cut = !is_whole & (z + reach).simd_gt(horizon) & reach.simd_gt(Lanes::ZERO);
        if !is_cut.any() {
            return whole;
        }
        // A parabola through the mean height at t = 1 (1), at t = 0 (4/3π) and at t = −1 (0).
        let t = (z / reach).fast_min(Lanes::ONE);
        let mean = (0.4244 + t * (0.5 + t * 0.0756)).fast_max(Lanes::ZERO);
        // Area of a circle's segment, with the right slopes at t = 0 and 1 (within 1 % of the circle).
        let t2 = t * t;
        let area = (0.5 + t * (std::f32::consts::FRAC_2_PI - t2 * (0.0232 + 0.1134 * t2))).fast_max(Lanes::ZERO);
        let turn = extent * (mean - t) / steep;
        let moved = direction + (Directions::splat(Vec3::Z) - direction * z) * turn;
        let middle = moved.normalized();
        let is_cut = is_cut & middle.z.simd_gt(horizon);
        Self {
            middle: Directions::select(is_cut, middle, direction),
            radius2: is_cut.select(radius2 * area, radius2),
            mean_cos: is_cut.select((reach * mean).fast_max(horizon), mean_cos),
            visible: is_whole | is_cut,
        }
    }

    /// `values` where anything is visible, else 0.
    #[inline]
    pub(super) fn of_visible(&self, values: Lanes) -> Lanes {
        self.visible & values
    }
}

/// A lobe that is averaged over senders.
pub(super) trait Lobes {
    /// What is told of each sender; its default where the sender does not matter.
    type Light: Copy + Default;

    /// Of a sender that is negligible or no disk.
    fn alone(&self, sender: &Incident, outgoing: Vec3) -> Option<Self::Light>;

    /// Of disks.
    fn together(&self, disks: &Disks, outgoing: Vec3) -> [Self::Light; LANES];

    /// Calls `each` with what there is of every sender, in any order.
    #[inline]
    fn over(&self, senders: &[Incident], outgoing: Vec3, mut each: impl FnMut(usize, Self::Light)) {
        let mut waiting = [0; LANES];
        let mut count = 0;
        for (k, sender) in senders.iter().enumerate() {
            if let Some(light) = self.alone(sender, outgoing) {
                each(k, light);
                continue;
            }
            waiting[count] = k;
            count += 1;
            if count == LANES {
                self.disks(senders, &waiting, outgoing, &mut each);
                count = 0;
            }
        }
        if count > 0 {
            self.disks(senders, &waiting[..count], outgoing, &mut each);
        }
    }

    /// The same of those that are disks, no more than there are lanes.
    #[inline]
    fn disks(&self, senders: &[Incident], which: &[usize], outgoing: Vec3, each: &mut impl FnMut(usize, Self::Light)) {
        // What is left over are points below the horizon.
        let (mut directions, mut extents) = ([Vec3::NEG_Z; LANES], [0.0; LANES]);
        for (lane, &k) in which.iter().enumerate() {
            (directions[lane], extents[lane]) = (senders[k].direction, senders[k].extent);
        }
        let disks = Disks::new(Directions::from(directions), Lanes::new(extents));
        std::iter::zip(which, self.together(&disks, outgoing)).for_each(|(&k, light)| each(k, light));
    }
}

/// Half vectors are at least this high; grazing pairs would else overflow. The largest slope that matters is ten times
/// the roughness.
const LARGEST: f32 = 1e15;

/// Slopes of the half vectors between an outgoing direction and incident ones, side by side.
#[derive(Clone, Copy, Debug)]
struct Slopes {
    incident: Directions,
    /// incident + outgoing.
    half: Directions,
    inv_z: Lanes,
    /// Slopes are multiplied by this, to make the lobe round.
    stretch: Vec2,
    /// Not stretched.
    slope: Plane,
    // J Jᵀ, stretched.
    xx: Lanes,
    xy: Lanes,
    yy: Lanes,
}

impl Slopes {
    #[inline]
    fn new(incident: Directions, outgoing: Vec3, stretch: Vec2) -> Self {
        let h = incident + Directions::splat(outgoing);
        let inv_z = Lanes::ONE / h.z;
        let (x, y) = (h.x * inv_z, h.y * inv_z);
        // Rows of the slope's gradient by h, times h.z, are (1, 0, −x) and (0, 1, −y); their parts along the incident
        // direction do not count, since that is of unit length.
        let (p, q) = (incident.x - x * incident.z, incident.y - y * incident.z);
        let scale = inv_z * inv_z;
        let (least, most) = (Lanes::splat(-LARGEST), Lanes::splat(LARGEST));
        Self {
            incident,
            half: h,
            inv_z,
            stretch,
            slope: Plane { x, y },
            xx: (scale * (stretch.x * stretch.x) * (1.0 + x * x - p * p)).fast_max(Lanes::ZERO).fast_min(most),
            xy: (scale * (stretch.x * stretch.y) * (x * y - p * q)).fast_max(least).fast_min(most),
            yy: (scale * (stretch.y * stretch.y) * (1.0 + y * y - q * q)).fast_max(Lanes::ZERO).fast_min(most),
        }
    }

    /// J v, for any v.
    #[inline]
    fn slope_of(&self, v: Directions) -> Plane {
        let v = v - self.incident * self.incident.dot(v);
        let (x, y) = (v.x - self.slope.x * v.z, v.y - self.slope.y * v.z);
        Plane { x: x * self.inv_z * self.stretch.x, y: y * self.inv_z * self.stretch.y }
    }

    /// Jᵀ v.
    #[inline]
    fn direction_of(&self, v: Plane) -> Directions {
        let v = v.scaled(self.stretch);
        let g = Directions { x: v.x, y: v.y, z: -self.slope.dot(v) } * self.inv_z;
        g - self.incident * self.incident.dot(g)
    }

    /// √det M and (det M) M⁻¹ s, for M = `lobe`·I + `share`·J Jᵀ.
    #[inline]
    fn solve(&self, lobe: Lanes, share: Lanes, s: Plane) -> (Lanes, Plane) {
        let (xx, xy, yy) = (lobe + share * self.xx, share * self.xy, lobe + share * self.yy);
        let root = (xx * yy - xy * xy).fast_max(lobe * lobe).sqrt();
        (root, Plane { x: yy * s.x - xy * s.y, y: xx * s.y - xy * s.x })
    }
}

/// Where a lobe of half-vector slopes and disks of incident directions meet, side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meetings {
    /// The incident direction that stands for the product of both.
    pub incident: Directions,
    /// h = incident + outgoing there, not normalised.
    pub h: Directions,
    /// Squared slope of h.
    pub tan2: Lanes,
    /// Cosine there / mean cosine of the sender.
    pub weight: Lanes,
    radius2: Lanes,
    slopes: Slopes,
    /// Stretched slope of the disk's middle, as seen by the linear map.
    middle: Plane,
}

impl Meetings {
    /// `stretch` is what slopes are multiplied by to make the lobe round; `variance` is that of the lobe's stretched
    /// slopes, per axis, as a function of their square.
    #[inline]
    pub(super) fn new(disks: &Disks, outgoing: Vec3, stretch: Vec2, variance: impl Fn(Lanes) -> Lanes) -> Self {
        let mut slopes = Slopes::new(disks.middle, outgoing, stretch);
        let mut middle = slopes.slope.scaled(stretch);
        let variance = variance(middle.length_squared());
        let share = 0.25 * disks.radius2;
        // Disks that are small against the lobe need no second look.
        let look_again = (share * (slopes.xx + slopes.yy)).simd_gt(1e-3 * variance);
        if look_again.any() {
            let (root, solved) = slopes.solve(variance, share, middle);
            let step = slopes.direction_of(solved) * (-share / (root * root));
            let length2 = step.length_squared();
            let is_within = length2.simd_le(disks.radius2);
            let shorter = is_within.select(Lanes::ONE, (disks.radius2 / length2).sqrt());
            let moved = disks.middle + step * shorter;
            let incident = moved * (1.0 / moved.length_squared().sqrt());
            let moves = look_again & incident.z.simd_gt(Lanes::splat(HORIZON));
            slopes = Slopes::new(Directions::select(moves, incident, disks.middle), outgoing, stretch);
            middle = slopes.slope.scaled(stretch) + slopes.slope_of(disks.middle - slopes.incident);
        }
        Self {
            incident: slopes.incident,
            h: slopes.half,
            tan2: slopes.slope.length_squared(),
            weight: slopes.incident.z / disks.mean_cos,
            radius2: disks.radius2,
            slopes,
            middle,
        }
    }

    /// For M = `lobe`·I + `share`·E: √det M, and √det M × sᵀM⁻¹s with the stretched slope s of the disk's middle.
    #[inline]
    pub(super) fn rounded(&self, lobe: Lanes, share: f32) -> (Lanes, Lanes) {
        let (root, solved) = self.slopes.solve(lobe, share * self.radius2, self.middle);
        (root, (self.middle.dot(solved) / root).fast_max(Lanes::ZERO))
    }
}

/// The linear map from directions to the slopes of half vectors about an incident direction.
#[derive(Clone, Copy, Debug)]
struct Derivative {
    incident: Vec3,
    /// incident + outgoing.
    half: Vec3,
    inv_z: f32,
    /// Slopes are multiplied by this, to make the lobe round.
    stretch: Vec2,
    /// Not stretched.
    slope: Vec2,
}

impl Derivative {
    #[inline]
    fn new(incident: Vec3, outgoing: Vec3, stretch: Vec2) -> Self {
        let half = incident + outgoing;
        let inv_z = half.z.recip();
        Self { incident, half, inv_z, stretch, slope: half.truncate() * inv_z }
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
}

/// Where a lobe of half-vector slopes and a sender with a contour meet.
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
    /// The contour in the plane of stretched slopes.
    pub outline: Trapezoid,
}

impl Meeting {
    /// All of the contour, whose middle is given, is above the horizon. `stretch` and `variance` as for [`Meetings`]. The smooth factor
    /// rises by the share `rise` |x|² at an angle |x|.
    #[inline]
    pub(super) fn new(
        (direction, contour): (Vec3, &Contour),
        outgoing: Vec3,
        stretch: Vec2,
        variance: impl Fn(f32) -> f32,
        rise: f32,
    ) -> Self {
        let about = Derivative::new(direction, outgoing, stretch);
        let middle = about.slope * stretch;
        let outline = contour.mapped(middle, |side| about.slope_of(side));
        let expansion = contour.about(direction, outline.product(variance(middle.length_squared())));
        let about = Derivative::new(expansion.incident, outgoing, stretch);
        // Slopes are in proportion to 1/h.z; and a direction that turns by |x| is shorter by |x|²/2 along what it was.
        let shrinks = expansion.turns.map(|turn| turn.z * about.inv_z);
        let fall = about.slope_of_half(expansion.incident);
        let outline = expansion.mapped(about.slope * stretch, shrinks, fall, |turn| about.slope_of_half(turn));
        let tan2 = about.slope.length_squared();
        Self { incident: about.incident, h: about.half, tan2, weight: expansion.weight(direction.z, rise), outline }
    }
}

/// exp(−x) with x = (distance/a)², averaged over a disk of radius r, with y = (r/a)²; 0…1.
///
/// The exact average is a Marcum Q function. In its place stands A / (1 − q + exp(x/τ − λ)), q = exp(−λ): a Gaussian for
/// small disks (λ → 0) and flat with soft edges for large ones. A makes the middle exact and τ the energy; λ(y) is a
/// fit. The largest error is 3.2 % of the middle's value, at y around 12; below y = 3 it is 0.5 %.
#[inline]
pub(super) fn gaussian_over_disk(x: Lanes, y: Lanes) -> Lanes {
    let peak = exp_mean(y);
    // λ < 1/400 changes less than 10⁻⁴.
    let is_small = y.simd_lt(Lanes::splat(0.1));
    let small = || peak * (-x * peak).exp();
    if is_small.all() {
        return small();
    }
    let lambda = y * y / (4.0 + y * y.sqrt() * (1.0 / 1.2));
    let mean = exp_mean(lambda);
    let exponent = x * peak / mean - lambda;
    let most = Lanes::splat(80.0);
    let large = exponent.simd_le(most) & (peak / (lambda * mean + exponent.fast_min(most).exp()));
    if is_small.any() { is_small.select(small(), large) } else { large }
}

/// (1 − exp(−t))/t, the mean of exp(−t…0), for t ≥ 0.
#[inline]
fn exp_mean(t: Lanes) -> Lanes {
    let is_small = t.simd_lt(Lanes::splat(0.1));
    let series = 1.0 - t * (0.5 - t * (1.0 / 6.0 - t * (1.0 / 24.0)));
    if is_small.all() { series } else { is_small.select(series, (1.0 - (-t).exp()) / t) }
}

/// 1/(1 + x)² with x = (distance/a)², averaged over a disk of radius r, with y = (r/a)²; exact.
///
/// The GGX density of slopes is what stereographic projection makes of a uniform density on the sphere; it takes
/// disks to caps, so the average is the area of a cap over that of the disk.
#[inline]
pub(super) fn ggx_over_disk(x: Lanes, y: Lanes) -> Lanes {
    let a = 1.0 + x - y;
    let s = (a * a + 4.0 * y).sqrt();
    // Of both forms of the same the one that does not cancel.
    let rises = a.simd_gt(Lanes::ZERO);
    rises.select(Lanes::splat(2.0), s - a) / (s * rises.select(s + a, 2.0 * y))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(values: Lanes) -> f32 {
        values.to_array()[0]
    }

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
                let error = (f64::from(first(gaussian_over_disk(Lanes::splat(x), Lanes::splat(y as f32)))) - gauss)
                    .abs()
                    / gauss_peak;
                assert!(error < allowed, "Gaussian over a disk, y = {y}, d = {d}: off by {error} of the peak");
                let error =
                    (f64::from(first(ggx_over_disk(Lanes::splat(x), Lanes::splat(y as f32)))) - ggx).abs() / ggx_peak;
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
            let disk = Disks::new(Directions::splat(direction), Lanes::splat(extent));
            assert!(disk.visible.all(), "part of the disk is above the horizon");
            let middle = Vec3::new(first(disk.middle.x), first(disk.middle.y), first(disk.middle.z));
            let off = middle.angle_between(sum.normalize());
            assert!(off < 0.07 * extent, "elevation {elevation}, extent {extent}: middle off by {off} rad");
            let mean_cos = sum.z / count;
            let error = (first(disk.mean_cos) / mean_cos - 1.0).abs();
            assert!(error < 0.08, "elevation {elevation}, extent {extent}: mean cosine off by {error}");
            let radius2 = 2.0 * (1.0 - extent.cos()) * count / 90_000.0;
            let error = (first(disk.radius2) / radius2 - 1.0).abs();
            assert!(error < 0.06, "elevation {elevation}, extent {extent}: solid angle off by {error}");
        }
        let below = Disks::new(Directions::splat(Vec3::new(0.8, 0.0, -0.6)), Lanes::splat(0.3));
        assert!(!below.visible.any(), "a disk below the horizon");
    }
}

//! Form factors: the fraction of the light leaving a uniform diffuse sender that a receiver sees of it, i.e.
//! irradiance / radiosity, in 0…1, unoccluded. All lengths are in unit space.
//!
//! From a point they are closed: polygons use Lambert's contour integral, clipped at the receiver's horizon; disks and
//! rings the same integral with arcs for edges; whole spheres their closed form. Only other curved pieces need
//! quadrature over the sender. From a patch they are the mean over its points ([`mean_factor`]), by cubature with an
//! estimate of its error. Of the two integrals over a pair the one with the pole 1/r² is done in closed form, so that
//! surfaces may touch: what is left is bounded by 1.
//!
//! There are two levels: [`point_factor`] is as accurate as it is asked to be, in f64; [`point_to_surface`] is what
//! transport uses, f32 in and out, and takes senders that are far or bent for points, to a percent or so.

use crate::geometry::{Domain, Geometry, Profile};
use glam::{DVec2, DVec3, Vec2, Vec3};
use smallvec::SmallVec;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Ratio of a flat sender's radius to its distance below which the point kernel replaces the closed form: its relative error is
/// about the square, under 0.5%.
pub(crate) const FAR: f32 = 0.07;
/// The same for the kernel at a few points of it, all of which are above the horizon; under 0.6%.
const HALFWAY: f32 = 0.25;
/// The same for pieces of curved senders, which have no closed form and are split down to it.
pub(crate) const CURVED_FAR: f32 = 0.25;
/// Pieces that go further around than this share of the parameters are split, too: 45° around, 45° along a sphere.
const CURVED_BENT: f32 = 0.25;
/// Splits of a curved sender end here: 4⁴ pieces.
const CURVED_DEPTH: u32 = 4;

/// Points nearer than this to a polygon's plane (unit space) are in it, and see nothing of it: coordinates are rounded
/// to 6e-8, and what the contour integral makes of rounding within the polygon is anything up to 1.
pub(crate) const IN_PLANE: f32 = 1e-6;

/// Form factor from the point `x` with unit normal `n` to a planar polygon (any number of corners,
/// counter-clockwise seen from its front), by Lambert's formula F = ½π Σ Γᵢ·n over the edges, after clipping at
/// the horizon of `x` (Lambert 1760; Baum, Rushmeier, Winget 1989, eq. 8). Zero behind the polygon.
#[must_use]
pub fn point_to_polygon(x: Vec3, n: Vec3, corners: &[Vec3]) -> f32 {
    lambert(n.as_dvec3(), corners.iter().map(|corner| corner.as_dvec3() - x.as_dvec3())) as f32
}

/// [`point_to_polygon`] for corners relative to the point.
pub(crate) fn lambert(n: DVec3, corners: impl ExactSizeIterator<Item = DVec3> + Clone) -> f64 {
    let mut contour = Contour::new(n);
    if let Some(last) = corners.clone().last() {
        corners.fold(last, |from, to| {
            contour.straight(from, to);
            to
        });
    }
    // The contour runs clockwise seen from in front of the polygon's front.
    (-contour.close() / TAU).clamp(0.0, 1.0)
}

/// The angle (0…π) whose sine and cosine are in proportion to `sine` ≥ 0 and `cosine`; to 3e-13. Half of the time in closed forms
/// goes into it.
#[inline]
fn angle(sine: f64, cosine: f64) -> f64 {
    // atan t = t · P(t²) for |t| ≤ tan π/8, by Chebyshev's points.
    const TAN_PI_8: f64 = 0.414_213_562_373_095_03;
    const P: [f64; 8] = [
        0.999_999_999_999_270_8,
        -0.333_333_332_783_825_7,
        0.199_999_931_887_448_8,
        -0.142_853_912_547_085,
        0.111_035_348_369_773_38,
        -0.089_932_165_815_496_58,
        0.069_770_021_520_113_98,
        -0.037_701_684_298_645_73,
    ];
    let (low, high) = (sine.min(cosine.abs()), sine.max(cosine.abs()));
    let turned = low > TAN_PI_8 * high;
    let t = if turned { (low - high) / (low + high) } else { low / high };
    let z = t * t;
    let arc = t * P.iter().rev().fold(0.0, |sum, c| sum * z + c) + if turned { FRAC_PI_4 } else { 0.0 };
    let acute = if sine > cosine.abs() { FRAC_PI_2 - arc } else { arc };
    if cosine < 0.0 { PI - acute } else { acute }
}

/// Lambert's contour integral ∮ n·(r × dr)/r², r from the receiving point, over the part of a closed contour above the
/// point's horizon. What the horizon cuts off is replaced by the chord along it.
struct Contour {
    normal: DVec3,
    sum: f64,
    /// First point above the horizon, and the last one so far.
    ends: Option<(DVec3, DVec3)>,
}

impl Contour {
    fn new(normal: DVec3) -> Self {
        Self { normal, sum: 0.0, ends: None }
    }

    /// The integral along a segment: the angle it subtends, times the cosine of its plane.
    fn angle(&self, a: DVec3, b: DVec3) -> f64 {
        let cross = a.cross(b);
        let sine = cross.length();
        if sine > 0.0 { angle(sine, a.dot(b)) * cross.dot(self.normal) / sine } else { 0.0 }
    }

    /// Joins a piece above the horizon to the last one.
    fn piece(&mut self, from: DVec3, to: DVec3, integral: f64) {
        if let Some((_, last)) = self.ends
            && last != from
        {
            self.sum += self.angle(last, from);
        }
        self.sum += integral;
        self.ends = Some((self.ends.map_or(from, |(first, _)| first), to));
    }

    /// A straight edge.
    fn straight(&mut self, from: DVec3, to: DVec3) {
        let (low, high) = (from.dot(self.normal), to.dot(self.normal));
        if low <= 0.0 && high <= 0.0 {
            return;
        }
        let cut = || from + (to - from) * (low / (low - high));
        let a = if low > 0.0 { from } else { cut() };
        let b = if high > 0.0 { to } else { cut() };
        self.piece(a, b, self.angle(a, b));
    }

    /// A circle's arc about `center` from angle `from` to `to` (radians, either way around), `axes` as long as its
    /// radius. Gauss–Legendre on pieces of a quarter turn at most that are no longer than their distance from the
    /// point: the error falls by (2 + √5)² per point, 2e-5 for four.
    fn arc(&mut self, center: DVec3, axes: [DVec3; 2], [from, to]: [f64; 2], rule: &[(f64, f64)]) {
        let radius = axes[0].length();
        if radius <= 0.0 {
            return;
        }
        let at = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            center + axes[0] * cos + axes[1] * sin
        };
        let height = DVec2::new(axes[0].dot(self.normal), axes[1].dot(self.normal));
        let (middle, amplitude) = (center.dot(self.normal), height.length());
        let (low, high) = (from.min(to), from.max(to));
        let mut cuts: SmallVec<[f64; 8]> = SmallVec::new();
        cuts.push(low);
        if middle.abs() < amplitude {
            let (peak, half) = (height.y.atan2(height.x), (-middle / amplitude).acos());
            for cut in [peak - half, peak + half] {
                let first = cut + ((low - cut) / TAU).ceil() * TAU;
                cuts.extend([first, first + TAU].into_iter().filter(|cut| *cut > low && *cut < high));
            }
        }
        cuts.push(high);
        cuts.sort_by(f64::total_cmp);
        if to < from {
            cuts.reverse();
        }
        for pair in cuts.windows(2) {
            if at(0.5 * (pair[0] + pair[1])).dot(self.normal) <= 0.0 {
                continue;
            }
            let mut integral = 0.0;
            // Left to right, the rest of the arc on a stack.
            let mut pieces: SmallVec<[(f64, f64, u32); 32]> = SmallVec::new();
            pieces.push((pair[0], pair[1], ARC_DEPTH));
            while let Some((a, b, depth)) = pieces.pop() {
                let length = (b - a).abs() * radius;
                let middle = 0.5 * (a + b);
                let bent = (b - a).abs() > 0.25 * TAU;
                if bent || depth > 0 && length > at(middle).length() - 0.5 * length {
                    let depth = depth.saturating_sub(1);
                    pieces.push((middle, b, depth));
                    pieces.push((a, middle, depth));
                    continue;
                }
                for &(node, weight) in rule {
                    let (sin, cos) = (a + (b - a) * node).sin_cos();
                    let r = center + axes[0] * cos + axes[1] * sin;
                    let along = axes[1] * cos - axes[0] * sin;
                    integral += weight * (b - a) * r.cross(along).dot(self.normal) / r.length_squared();
                }
            }
            self.piece(at(pair[0]), at(pair[1]), integral);
        }
    }

    /// The integral, once the contour is back at its start.
    fn close(mut self) -> f64 {
        if let Some((first, last)) = self.ends
            && first != last
        {
            self.sum += self.angle(last, first);
        }
        self.sum
    }
}

/// Form factor from the point `x` with unit normal `n` to a whole sphere seen from outside. 1 inside of it.
///
/// Fully above the horizon it is cos θ (r/d)²; partly below, the closed form of the spherical cap cut by the
/// horizon (Howell, A Catalog of Radiation Heat Transfer Configuration Factors: plane element to sphere).
#[must_use]
pub fn point_to_sphere(x: Vec3, n: Vec3, center: Vec3, radius: f32) -> f32 {
    sphere_factor((center - x).as_dvec3(), n.as_dvec3(), f64::from(radius)) as f32
}

/// [`point_to_sphere`] with the centre relative to the point.
fn sphere_factor(to: DVec3, n: DVec3, radius: f64) -> f64 {
    let distance = to.length();
    let h = distance / radius;
    if h <= 1.0 {
        return 1.0;
    }
    let cosine = (to.dot(n) / distance).clamp(-1.0, 1.0);
    let sine_disk = 1.0 / h;
    if cosine >= sine_disk {
        return cosine / (h * h);
    }
    if cosine <= -sine_disk {
        return 0.0;
    }
    let root = (h * h - 1.0).sqrt();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt().max(1e-12);
    // Where the horizon cuts the disk: cot θ · √(h²−1), in −1…1.
    let cut = (cosine * root / sine).clamp(-1.0, 1.0);
    let a = (-cut).acos();
    let b = ((1.0 - h * h * cosine * cosine).max(0.0)).sqrt();
    let value = cosine / (h * h) * a - b * root / (h * h) + (b / root).atan();
    (value / PI).clamp(0.0, 1.0)
}

/// Point kernel cos θ cos θ' A / (π d²), bounded by cos θ: also where sender and receiver touch it stays below 1.
pub(crate) fn kernel(x: Vec3, n: Vec3, point: Vec3, normal: Vec3, area: f32) -> f32 {
    let to = point - x;
    let d2 = to.length_squared();
    if d2 <= 0.0 {
        return 0.0;
    }
    let (cos_x, cos_p) = (to.dot(n), -to.dot(normal));
    if cos_x <= 0.0 || cos_p <= 0.0 {
        return 0.0;
    }
    let cosines = cos_x * cos_p / d2;
    (cosines * area / (std::f32::consts::PI * d2)).min(cos_x / d2.sqrt())
}

/// One side of a part of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The surface.
    pub geometry: &'a Geometry,
    /// The part.
    pub domain: Domain,
    /// Whether it is the back.
    pub back: bool,
}

impl<'a> Part<'a> {
    /// The front of a whole surface.
    #[must_use]
    pub fn front(geometry: &'a Geometry) -> Self {
        Self { geometry, domain: Domain::WHOLE, back: false }
    }

    /// Point, normal on this side and Jacobian.
    fn place(&self, uv: DVec2) -> (DVec3, DVec3, f64) {
        let (point, normal, jacobian) = self.geometry.place(uv);
        (point, if self.back { -normal } else { normal }, jacobian)
    }
}

/// How accurate a form factor is to be: its error may be `relative` times its value, or `absolute`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Relative error, above 1e-8 or so.
    pub relative: f64,
    /// Absolute error, 0 or more.
    pub absolute: f64,
    /// Evaluations of the integrand after which what there is must do. Below 64 the parts of a receiver, four points each,
    /// are the last resort.
    pub most: u32,
}

impl Accuracy {
    /// A relative error, and as much work as it takes.
    #[must_use]
    pub fn relative(relative: f64) -> Self {
        Self { relative, absolute: 1e-12, most: 1 << 20 }
    }
}

/// A mean, how far it may be off, and what it took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// The mean.
    pub value: f64,
    /// Estimate of its absolute error, usually far too large.
    pub error: f64,
    /// Evaluations of the integrand.
    pub evaluations: u32,
}

/// Form factor from the point `x` with unit normal `n` to a sender, in f64, unoccluded. Exact to rounding for polygons
/// and whole spheres, better than 1e-8 for disks and rings; `accuracy` is for the others.
#[must_use]
pub fn point_factor(sender: Part<'_>, x: DVec3, n: DVec3, accuracy: Accuracy) -> f64 {
    let Part { geometry, domain, back } = sender;
    if geometry.is_polygon() {
        let middle = sender.place(geometry.middle(domain).as_dvec2());
        if (x - middle.0).dot(middle.1) <= f64::from(IN_PLANE) {
            return 0.0;
        }
        let mut corners: SmallVec<[DVec3; 4]> =
            geometry.corners(domain).iter().map(|uv| sender.place(uv.as_dvec2()).0 - x).collect();
        if (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(middle.1) < 0.0 {
            corners.reverse();
        }
        return lambert(n, corners.iter().copied());
    }
    if geometry.is_flat() {
        return ring(sender, x, n, &GAUSS_8);
    }
    if let Some((center, radius)) = geometry.sphere()
        && domain == Domain::WHOLE
        && geometry.is_convex(back)
    {
        return sphere_factor(center.as_dvec3() - x, n, f64::from(radius));
    }
    let kernel = |uv: DVec2| {
        let (point, normal, jacobian) = sender.place(uv);
        let to = point - x;
        let d2 = to.length_squared();
        let (cos_x, cos_p) = (to.dot(n), -to.dot(normal));
        let size = cos_x.abs() * cos_p.abs() * jacobian / (PI * d2 * d2);
        if cos_x > 0.0 && cos_p > 0.0 {
            Sample { value: size, hidden: 0.0 }
        } else {
            Sample { value: 0.0, hidden: size }
        }
    };
    Cells(geometry).integral(domain, accuracy, kernel).value.min(1.0)
}

/// Form factor from all of a receiver to a sender, unoccluded: the mean of [`point_factor`] over its points.
#[must_use]
pub fn part_factor(receiver: Part<'_>, sender: Part<'_>, accuracy: Accuracy) -> Mean {
    let inner = Accuracy { relative: 0.3 * accuracy.relative, ..accuracy };
    if receiver.geometry.is_polygon() && sender.geometry.is_polygon() {
        return polygon_pair(receiver, sender, accuracy.relative);
    }
    mean_factor(receiver, accuracy, f64::INFINITY, |x, n| point_factor(sender, x, n, inner))
}

/// Corners of a part of a polygon, counter-clockwise around its normal, which is returned, too.
pub(crate) fn outline(part: Part<'_>) -> (SmallVec<[DVec3; 5]>, DVec3) {
    let normal = part.place(part.geometry.middle(part.domain).as_dvec2()).1;
    let mut corners: SmallVec<[DVec3; 5]> =
        part.geometry.corners(part.domain).iter().map(|uv| part.place(uv.as_dvec2()).0).collect();
    if (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(normal) < 0.0 {
        corners.reverse();
    }
    (corners, normal)
}

/// What of a convex polygon is in front of a plane.
pub(crate) fn in_front(polygon: &[DVec3], on_plane: DVec3, normal: DVec3) -> SmallVec<[DVec3; 5]> {
    let mut front: SmallVec<[DVec3; 5]> = SmallVec::new();
    for (i, &to) in polygon.iter().enumerate() {
        let from = polygon[(i + polygon.len() - 1) % polygon.len()];
        let (low, high) = ((from - on_plane).dot(normal), (to - on_plane).dot(normal));
        if (low > 0.0) != (high > 0.0) {
            front.push(from + (to - from) * (low / (low - high)));
        }
        if high > 0.0 {
            front.push(to);
        }
    }
    front
}

/// [`part_factor`] of two polygons by Stokes' theorem: A F = (1/2π) ∮∮ ln r dr·dr' over the contours of what each has
/// in front of the other (E. Sparrow, Journal of Heat Transfer 85, 1963), the inner integral in closed form, the outer
/// one by nested Gauss–Legendre quadrature. Its integrand is bounded also where they touch.
fn polygon_pair(receiver: Part<'_>, sender: Part<'_>, relative: f64) -> Mean {
    let ((a, a_normal), (b, b_normal)) = (outline(receiver), outline(sender));
    let (front_a, front_b) = (in_front(&a, b[0], b_normal), in_front(&b, a[0], a_normal));
    if front_a.len() < 3 || front_b.len() < 3 {
        return Mean::default();
    }
    // A constant factor of r changes nothing, as contours are closed; with this one what is far does not cancel.
    let unit2 = a[0].distance_squared(b[b.len() / 2]).max(1e-12);
    let integral = |x: DVec3, from: DVec3, to: DVec3| {
        let along = (to - from).normalize();
        let (start, end) = ((from - x).dot(along), (to - x).dot(along));
        let height = ((from - x) - along * start).length();
        let primitive = |w: f64| {
            let r2 = w * w + height * height;
            let logarithm = if r2 > 0.0 { 0.5 * w * (r2 / unit2).ln() } else { 0.0 };
            logarithm - w + if height > 0.0 { height * (w / height).atan() } else { 0.0 }
        };
        primitive(end) - primitive(start)
    };
    let edges = |polygon: &[DVec3]| -> SmallVec<[(DVec3, DVec3); 5]> {
        let next = polygon.iter().cycle().skip(1);
        polygon.iter().copied().zip(next.copied()).filter(|(from, to)| from.distance(*to) > 1e-14).collect()
    };
    let (edges_a, edges_b) = (edges(&front_a), edges(&front_b));
    let area = f64::from(receiver.geometry.area(receiver.domain));
    let small = relative * 1e-3;
    let mut mean = Mean::default();
    for &(from, to) in &edges_a {
        let along = to - from;
        for &(p, q) in &edges_b {
            let cosine = along.dot((q - p).normalize());
            if cosine.abs() <= 1e-15 * along.length() {
                continue;
            }
            let mut rule = |start: f64, end: f64| {
                mean.evaluations += 8;
                GAUSS_8.iter().map(|(t, w)| w * integral(from + along * (start + (end - start) * t), p, q)).sum::<f64>()
                    * (end - start)
            };
            let whole = rule(0.0, 1.0);
            let mut pieces: SmallVec<[(f64, f64, f64); 32]> = SmallVec::new();
            pieces.push((0.0, 1.0, whole));
            while let Some((start, end, whole)) = pieces.pop() {
                let middle = 0.5 * (start + end);
                let (left, right) = (rule(start, middle), rule(middle, end));
                let off = (left + right - whole).abs();
                // The sum over all edges is smaller than its terms by about the square of size over distance.
                let scale = (along.length_squared() / unit2).min(1.0) * (p.distance_squared(q) / unit2).min(1.0);
                let wanted = small * scale * p.distance(q) * (end - start);
                // Of what is singular each half is as hard as the whole: depth is limited, and so is what rounding tells.
                let rounding = 1e-13 * (left.abs() + right.abs()) + 1e-15 * p.distance(q);
                if off <= wanted.max(rounding) || end - start < SHORTEST {
                    mean.value += cosine * (left + right) / (TAU * area);
                    mean.error += cosine.abs() * off / (TAU * area);
                } else {
                    pieces.push((middle, end, right));
                    pieces.push((start, middle, left));
                }
            }
        }
    }
    mean.value = mean.value.clamp(0.0, 1.0);
    mean
}

/// The mean of a form factor from points, given by point and unit normal, over a receiver. `reach` is the receiver's
/// radius over its distance to the sender; infinity where that is not known, or where they touch.
///
/// Far away one point is enough: the mean of a function over a patch differs from that in its middle by its second
/// derivative times the radius' square. Nearer the rules of two orders are compared, and the patch is cut into four
/// where they differ most (the global adaptive strategy of P. van Dooren and L. de Ridder, J. Comput. Appl. Math. 2,
/// 1976), which grades it toward edges that touch.
pub fn mean_factor(
    receiver: Part<'_>,
    accuracy: Accuracy,
    reach: f64,
    mut factor: impl FnMut(DVec3, DVec3) -> f64,
) -> Mean {
    let Part { geometry, domain, .. } = receiver;
    let mut evaluations = 0;
    let mut at = |uv: DVec2| {
        evaluations += 1;
        let (point, normal, jacobian) = receiver.place(uv);
        (factor(point, normal), jacobian)
    };
    if reach * reach <= accuracy.relative || accuracy.most <= 1 {
        let (value, _) = at(geometry.middle(domain).as_dvec2());
        return Mean { value, error: value * (reach * reach).min(1.0), evaluations };
    }
    let coarse = accuracy.most < COARSE;
    if reach < if coarse { 0.5 } else { 1.0 } {
        let (mut value, mut weight) = (0.0, 0.0);
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        let mut add = |uv: DVec2, share: f64| {
            let (found, jacobian) = at(uv);
            value += share * jacobian * found;
            weight += share * jacobian;
            (low, high) = (low.min(found), high.max(found));
        };
        low_rule(geometry, domain, &mut add);
        let mean = value / weight;
        // Four points follow what is linear; the rest is a share of what they differ by.
        let error = 0.25 * (high - low) * reach;
        if coarse || error <= (accuracy.relative * mean).max(accuracy.absolute) {
            return Mean { value: mean, error, evaluations };
        }
    }
    if coarse {
        let (mut value, mut weight) = (0.0, 0.0);
        let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
        let mut add = |uv: DVec2, share: f64| {
            let (found, jacobian) = at(uv);
            value += share * jacobian * found;
            weight += share * jacobian;
            (low, high) = (low.min(found), high.max(found));
        };
        for part in geometry.split(domain) {
            low_rule(geometry, part, &mut add);
        }
        return Mean { value: value / weight, error: 0.0625 * (high - low), evaluations };
    }
    let area = f64::from(geometry.area(domain));
    let accuracy = Accuracy { absolute: accuracy.absolute * area, ..accuracy };
    let mut mean = Cells(geometry).integral(domain, accuracy, |uv| {
        let (point, normal, jacobian) = receiver.place(uv);
        Sample { value: jacobian * factor(point, normal), hidden: 0.0 }
    });
    mean.value = (mean.value / area).min(1.0);
    mean.error /= area;
    mean
}

/// Gauss–Legendre nodes and weights on 0…1.
const GAUSS_2: [(f64, f64); 2] = [(0.211_324_865_405_187_1, 0.5), (0.788_675_134_594_812_9, 0.5)];
const GAUSS_3: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
const GAUSS_4: [(f64, f64); 4] = [
    (0.069_431_844_202_973_7, 0.173_927_422_568_726_9),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_1),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_1),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_9),
];
const GAUSS_8: [(f64, f64); 8] = [
    (0.019_855_071_751_231_9, 0.050_614_268_145_188_1),
    (0.101_666_761_293_186_6, 0.111_190_517_226_687_2),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_6),
    (0.408_282_678_752_175_1, 0.181_341_891_689_180_9),
    (0.591_717_321_247_825, 0.181_341_891_689_180_9),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_6),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_2),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_1),
];
/// Barycentric points and weights of degree 5 in a triangle (J. Radon, Monatshefte für Mathematik 52, 1948), without
/// the centroid, whose weight is 9/40.
const RADON: [(f64, f64); 2] =
    [(0.470_142_064_105_115_1, 0.132_394_152_788_506_2), (0.101_286_507_323_456_3, 0.125_939_180_544_827_2)];
/// An arc is halved no more often than this: a point is hardly nearer to it than rounding.
const ARC_DEPTH: u32 = 40;
/// With fewer evaluations than this there is no use in an adaptive cubature.
const COARSE: u32 = 64;
/// Most evaluations of the two rules for one cell.
const RULE: u32 = 13;

/// Three (triangles) or four points of a part, exact for polynomials of degree two and three in the parameters, with
/// weights that sum to its area in parameter space.
fn low_rule(geometry: &Geometry, domain: Domain, mut at: impl FnMut(DVec2, f64)) {
    let (origin, size) = extent(domain);
    let area = (size.x * size.y).abs();
    if let Geometry::Triangle(_) = geometry {
        for (s, t) in [(1.0 / 6.0, 1.0 / 6.0), (2.0 / 3.0, 1.0 / 6.0), (1.0 / 6.0, 2.0 / 3.0)] {
            at(origin + size * DVec2::new(s, t), area / 6.0);
        }
        return;
    }
    for (t, b) in GAUSS_2 {
        for (s, a) in GAUSS_2 {
            at(origin + size * DVec2::new(s, t), a * b * area);
        }
    }
}

/// Seven or nine points, exact for degree five.
fn high_rule(geometry: &Geometry, domain: Domain, mut at: impl FnMut(DVec2, f64)) {
    let (origin, size) = extent(domain);
    let area = (size.x * size.y).abs();
    if let Geometry::Triangle(_) = geometry {
        at(origin + size / 3.0, 0.1125 * area);
        for (a, weight) in RADON {
            let b = 1.0 - 2.0 * a;
            for (s, t) in [(a, a), (b, a), (a, b)] {
                at(origin + size * DVec2::new(s, t), 0.5 * weight * area);
            }
        }
        return;
    }
    for (t, b) in GAUSS_3 {
        for (s, a) in GAUSS_3 {
            at(origin + size * DVec2::new(s, t), a * b * area);
        }
    }
}

/// First corner and signed size of a part in parameter space.
fn extent(domain: Domain) -> (DVec2, DVec2) {
    let [u0, v0, u1, v1] = [domain.u0, domain.v0, domain.u1, domain.v1].map(f64::from);
    (DVec2::new(u0, v0), DVec2::new(u1 - u0, v1 - v0))
}

/// Part of an integral; ordered by its error.
struct Cell {
    domain: Domain,
    value: f64,
    error: f64,
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Cell {}
impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error)
    }
}

/// What an integrand is at a point.
#[derive(Clone, Copy, Default)]
struct Sample {
    /// Its value, 0 where point and surface do not face each other.
    value: f64,
    /// What it would be there if facing did not matter.
    hidden: f64,
}

/// Cubature over parts of a surface.
#[derive(Clone, Copy)]
struct Cells<'a>(&'a Geometry);

impl Cells<'_> {
    /// The halves of a part that is too bent for its points to tell what is between them: more than an eighth turn.
    fn unbent(self, domain: Domain) -> Option<[Domain; 2]> {
        let Geometry::Revolution(revolution) = self.0 else { return None };
        let Domain { u0, v0, u1, v1 } = domain;
        let along = match revolution.profile() {
            Profile::Line { .. } => 0.0,
            Profile::Arc { sweep, .. } => (v1 - v0) * sweep.abs(),
        };
        let (u, v) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
        if self.0.is_flat() || (u1 - u0).max(along) < 0.126 {
            None
        } else if u1 - u0 >= along {
            Some([Domain { u1: u, ..domain }, Domain { u0: u, ..domain }])
        } else {
            Some([Domain { v1: v, ..domain }, Domain { v0: v, ..domain }])
        }
    }

    /// The integral over one cell by both rules.
    fn cell(self, domain: Domain, f: &mut impl FnMut(DVec2) -> Sample) -> Cell {
        let (mut low, mut high, mut hidden) = (0.0, 0.0, 0.0);
        low_rule(self.0, domain, |uv, weight| {
            let sample = f(uv);
            low += weight * sample.value;
            hidden += weight * sample.hidden;
        });
        high_rule(self.0, domain, |uv, weight| {
            let sample = f(uv);
            high += weight * sample.value;
            hidden += weight * sample.hidden;
        });
        let mut error = (high - low).abs();
        if !self.0.is_flat() && hidden > 0.0 {
            // Where some of it faces the point and some does not, the rules do not see the bend: its corners count, too.
            let (mut lit, area) = (high, extent(domain).1);
            for uv in self.0.corners(domain) {
                lit += f(uv.as_dvec2()).value * (area.x * area.y).abs() / 16.0;
            }
            error = error.max(KINK * lit.min(hidden));
        }
        Cell { domain, value: high, error }
    }

    /// The integral over a part of the parameters.
    fn integral(self, domain: Domain, accuracy: Accuracy, mut f: impl FnMut(DVec2) -> Sample) -> Mean {
        let spent = std::cell::Cell::new(0);
        let mut counted = |uv: DVec2| {
            spent.set(spent.get() + 1);
            f(uv)
        };
        let (mut value, mut error) = (0.0, 0.0);
        let mut cells = BinaryHeap::new();
        // Two rules may agree by chance on one cell, hardly on all of several.
        let mut bent: SmallVec<[Domain; 32]> = self.0.split(domain).into_iter().collect();
        while let Some(domain) = bent.pop() {
            if let Some(halves) = self.unbent(domain) {
                bent.extend(halves);
                continue;
            }
            let cell = self.cell(domain, &mut counted);
            (value, error) = (value + cell.value, error + cell.error);
            cells.push(cell);
        }
        while error > (accuracy.relative * value).max(accuracy.absolute) && spent.get() + 4 * RULE <= accuracy.most {
            let Some(worst) = cells.pop() else { break };
            let small = (worst.domain.u1 - worst.domain.u0).abs().min((worst.domain.v1 - worst.domain.v0).abs());
            if small < SMALLEST_CELL || worst.error <= 0.0 {
                break;
            }
            (value, error) = (value - worst.value, error - worst.error);
            for part in self.0.split(worst.domain) {
                let cell = self.cell(part, &mut counted);
                (value, error) = (value + cell.value, error + cell.error);
                cells.push(cell);
            }
        }
        Mean { value, error: error.max(0.0), evaluations: spent.get() }
    }
}

/// Edges are not cut into pieces shorter than this share of them.
const SHORTEST: f64 = 1e-6;

/// Share of the light at stake in a cell that only partly faces the point that counts as its error.
const KINK: f64 = 0.2;

/// Parts are not cut below this side in parameter space, the last that their corners are exact at.
const SMALLEST_CELL: f32 = 1.0 / (1 << 20) as f32;

/// Form factor from the point `x` with unit normal `n` to a part of a surface, seen from that surface's front, or
/// from its back where `back` is set. Unoccluded.
#[must_use]
pub fn point_to_surface(geometry: &Geometry, domain: &Domain, back: bool, x: Vec3, n: Vec3) -> f32 {
    match geometry {
        Geometry::Triangle(_) | Geometry::Quad(_) => {
            let corners: SmallVec<[Vec3; 4]> = geometry.corners(*domain).iter().map(|&uv| geometry.point(uv)).collect();
            let middle = corners.iter().sum::<Vec3>() / corners.len() as f32;
            let radius = corners.iter().map(|c| c.distance(middle)).fold(0.0, f32::max);
            let facing = geometry.normal(geometry.middle(*domain)) * if back { -1.0 } else { 1.0 };
            let flat = Flat { geometry, domain, middle, radius, facing, area: geometry.area(*domain) };
            flat.point_factor(x, n)
        }
        Geometry::Revolution(_) => match geometry.sphere() {
            Some((center, radius)) if *domain == Domain::WHOLE && geometry.is_convex(back) => {
                point_to_sphere(x, n, center, radius)
            }
            // All around.
            Some((center, radius)) if *domain == Domain::WHOLE && x.distance(center) < radius => 1.0,
            _ if geometry.is_flat() => {
                ring(Part { geometry, domain: *domain, back }, x.as_dvec3(), n.as_dvec3(), &GAUSS_4) as f32
            }
            _ => curved(geometry, *domain, back, x, n, CURVED_DEPTH),
        },
    }
}

/// A part of a polygon, and what is known of it.
pub(crate) struct Flat<'a> {
    pub(crate) geometry: &'a Geometry,
    pub(crate) domain: &'a Domain,
    /// Somewhere in it, …
    pub(crate) middle: Vec3,
    /// … within this distance of all of it.
    pub(crate) radius: f32,
    /// Its unit normal.
    pub(crate) facing: Vec3,
    pub(crate) area: f32,
}

impl Flat<'_> {
    /// See [`point_to_surface`].
    pub(crate) fn point_factor(&self, x: Vec3, n: Vec3) -> f32 {
        let to = self.middle - x;
        let (before, above) = (-to.dot(self.facing), to.dot(n));
        if before <= IN_PLANE || above <= -self.radius {
            return 0.0;
        }
        let far = |ratio: f32| self.radius * self.radius < ratio * ratio * to.length_squared();
        if far(FAR) {
            return kernel(x, n, self.middle, self.facing, self.area);
        }
        if above > self.radius && far(HALFWAY) {
            let points = self.geometry.quadrature(*self.domain);
            let at = |&(uv, weight): &(Vec2, f32)| {
                let to = self.geometry.point(uv) - x;
                weight * to.dot(n) / to.length_squared().powi(2)
            };
            return points.iter().map(at).sum::<f32>() * before * self.area * std::f32::consts::FRAC_1_PI;
        }
        let mut corners: SmallVec<[Vec3; 4]> =
            self.geometry.corners(*self.domain).iter().map(|&uv| self.geometry.point(uv)).collect();
        if (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(self.facing) < 0.0 {
            corners.reverse();
        }
        point_to_polygon(x, n, &corners)
    }
}

/// A disk, a ring or a sector of one.
fn ring(Part { geometry, domain, back }: Part<'_>, x: DVec3, n: DVec3, rule: &[(f64, f64)]) -> f64 {
    let Geometry::Revolution(revolution) = geometry else { return 0.0 };
    let facing = geometry.normal(geometry.middle(domain)).as_dvec3() * if back { -1.0 } else { 1.0 };
    let center = revolution.center().as_dvec3() - x;
    if -center.dot(facing) <= f64::from(IN_PLANE) {
        return 0.0;
    }
    let [u0, v0, u1, v1] = [domain.u0, domain.v0, domain.u1, domain.v1].map(f64::from);
    let axes = |v: f64| [0.0, 0.25].map(|u| geometry.place(DVec2::new(u, v)).0 - x - center);
    let on = |u: f64, v: f64| geometry.place(DVec2::new(u, v)).0 - x;
    let (inner, outer) = (axes(v0), axes(v1));
    let mut contour = Contour::new(n);
    contour.arc(center, outer, [u0 * TAU, u1 * TAU], rule);
    contour.straight(on(u1, v1), on(u1, v0));
    contour.arc(center, inner, [u1 * TAU, u0 * TAU], rule);
    contour.straight(on(u0, v0), on(u0, v1));
    let side = outer[0].cross(outer[1]).dot(facing).signum();
    (-side * contour.close() / TAU).clamp(0.0, 1.0)
}

fn curved(geometry: &Geometry, domain: Domain, back: bool, x: Vec3, n: Vec3, depth: u32) -> f32 {
    let by_parts =
        || geometry.split(domain).into_iter().map(|part| curved(geometry, part, back, x, n, depth - 1)).sum();
    let bent = (domain.u1 - domain.u0).abs().max((domain.v1 - domain.v0).abs()) > CURVED_BENT;
    if bent && depth > 0 {
        return by_parts();
    }
    let point = geometry.point(geometry.middle(domain));
    let area = geometry.area(domain);
    let radius2 = geometry
        .corners(domain)
        .iter()
        .map(|&corner| geometry.point(corner).distance_squared(point))
        .fold(area * 0.25, f32::max);
    let to = point - x;
    let above = to.dot(n);
    if above < 0.0 && above * above > radius2 {
        return 0.0;
    }
    if depth == 0 || radius2 < CURVED_FAR * CURVED_FAR * to.length_squared() {
        let side = if back { -1.0 } else { 1.0 };
        let at = |(uv, weight)| {
            let (point, normal) = geometry.point_and_normal(uv);
            kernel(x, n, point, normal * side, area * weight)
        };
        return geometry.quadrature(domain).into_iter().map(at).sum();
    }
    by_parts()
}

#[cfg(test)]
mod tests;

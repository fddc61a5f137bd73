//! Form factors from a point: the fraction of the light leaving a uniform diffuse sender that a small plane patch
//! would see of it, i.e. irradiance / radiosity, in 0…1.
//!
//! Polygons use Lambert's contour integral, clipped at the receiver's horizon; whole spheres their closed form;
//! other curved pieces are split until a point kernel is accurate. Nowhere does 1/r² meet two surfaces that touch: the
//! kernel is bounded.

use crate::geometry::{Domain, Geometry};
use glam::{DVec3, Vec2, Vec3};
use smallvec::SmallVec;
use std::f64::consts::PI;

/// Ratio of a sender's radius to its distance below which the point kernel replaces the closed form. The kernel's
/// relative error is about the ratio's square: under 1%.
const FAR: f32 = 0.06;
/// The same for pieces of curved senders, which have no closed form and are split down to it.
const CURVED_FAR: f32 = 0.25;
/// Pieces that go further around than this share of the parameters are split, too: 45° around, 45° along a sphere.
const CURVED_BENT: f32 = 0.25;
/// Chords that stand for a full circle.
const RING_CHORDS: f32 = 24.0;
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
    let (x, n) = (x.as_dvec3(), n.as_dvec3());
    let mut above: SmallVec<[DVec3; 8]> = SmallVec::new();
    let count = corners.len();
    if count < 3 {
        return 0.0;
    }
    let mut previous = corners[count - 1].as_dvec3() - x;
    let mut previous_height = previous.dot(n);
    for corner in corners {
        let current = corner.as_dvec3() - x;
        let height = current.dot(n);
        if (height > 0.0) != (previous_height > 0.0) {
            let t = previous_height / (previous_height - height);
            above.push(previous + (current - previous) * t);
        }
        if height > 0.0 {
            above.push(current);
        }
        (previous, previous_height) = (current, height);
    }
    if above.len() < 3 {
        return 0.0;
    }
    let mut sum = 0.0;
    for (i, a) in above.iter().enumerate() {
        let b = &above[(i + 1) % above.len()];
        let cross = a.cross(*b);
        let sine = cross.length();
        if sine > 0.0 {
            sum += sine.atan2(a.dot(*b)) * cross.dot(n) / sine;
        }
    }
    // The contour runs clockwise seen from in front of the polygon's front.
    (-sum / (2.0 * PI)).clamp(0.0, 1.0) as f32
}

/// Form factor from the point `x` with unit normal `n` to a whole sphere seen from outside. 1 inside of it.
///
/// Fully above the horizon it is cos θ (r/d)²; partly below, the closed form of the spherical cap cut by the
/// horizon (Howell, A Catalog of Radiation Heat Transfer Configuration Factors: plane element to sphere).
#[must_use]
pub fn point_to_sphere(x: Vec3, n: Vec3, center: Vec3, radius: f32) -> f32 {
    let to = (center - x).as_dvec3();
    let distance = to.length();
    let h = distance / f64::from(radius);
    if h <= 1.0 {
        return 1.0;
    }
    let cosine = (to.dot(n.as_dvec3()) / distance).clamp(-1.0, 1.0);
    let sine_disk = 1.0 / h;
    if cosine >= sine_disk {
        return (cosine / (h * h)) as f32;
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
    ((value / PI).clamp(0.0, 1.0)) as f32
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

/// Corners of a domain of a flat polygon, counter-clockwise seen from the front of the given side.
fn polygon_corners(geometry: &Geometry, domain: &Domain, back: bool) -> SmallVec<[Vec3; 4]> {
    let mut corners: SmallVec<[Vec3; 4]> = geometry.corners(*domain).iter().map(|&uv| geometry.point(uv)).collect();
    let normal = geometry.normal(geometry.middle(*domain)) * if back { -1.0 } else { 1.0 };
    let newell = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if newell.dot(normal) < 0.0 {
        corners.reverse();
    }
    corners
}

/// Form factor from the point `x` with unit normal `n` to a part of a surface, seen from that surface's front, or
/// from its back where `back` is set. Unoccluded.
#[must_use]
pub fn point_to_surface(geometry: &Geometry, domain: &Domain, back: bool, x: Vec3, n: Vec3) -> f32 {
    match geometry {
        Geometry::Triangle(_) | Geometry::Quad(_) => {
            let corners = polygon_corners(geometry, domain, back);
            let facing = geometry.normal(geometry.middle(*domain)) * if back { -1.0 } else { 1.0 };
            if (x - corners[0]).dot(facing) <= IN_PLANE {
                return 0.0;
            }
            let center = corners.iter().sum::<Vec3>() / corners.len() as f32;
            let radius2 = corners.iter().map(|c| c.distance_squared(center)).fold(0.0, f32::max);
            let d2 = center.distance_squared(x);
            if radius2 < FAR * FAR * d2 {
                return kernel(x, n, center, facing, geometry.area(*domain));
            }
            point_to_polygon(x, n, &corners)
        }
        Geometry::Revolution(_) => match geometry.sphere() {
            Some((center, radius)) if *domain == Domain::WHOLE && geometry.is_convex(back) => {
                point_to_sphere(x, n, center, radius)
            }
            _ if geometry.is_flat() => point_to_ring(geometry, *domain, back, x, n),
            _ => curved(geometry, *domain, back, x, n, CURVED_DEPTH),
        },
    }
}

/// A disk, a ring or a sector of one, as a polygon of as much area.
fn point_to_ring(geometry: &Geometry, domain: Domain, back: bool, x: Vec3, n: Vec3) -> f32 {
    let normal = geometry.normal(geometry.middle(domain)) * if back { -1.0 } else { 1.0 };
    let center = geometry.point(geometry.middle(domain));
    if (x - center).dot(normal) <= IN_PLANE {
        return 0.0;
    }
    let turn = domain.u1 - domain.u0;
    let chords = (turn * RING_CHORDS).ceil().max(2.0);
    let mut corners: SmallVec<[Vec3; 64]> = SmallVec::new();
    for (v, reversed) in [(domain.v1, false), (domain.v0, true)] {
        for i in 0..=chords as u32 {
            let step = i as f32 / chords;
            let u = domain.u0 + turn * if reversed { 1.0 - step } else { step };
            corners.push(geometry.point(Vec2::new(u, v)));
        }
    }
    let newell: Vec3 =
        (1..corners.len() - 1).map(|i| (corners[i] - corners[0]).cross(corners[i + 1] - corners[0])).sum();
    if newell.dot(normal) < 0.0 {
        corners.reverse();
    }
    // Chords cut off a little of each arc.
    let lost = geometry.area(domain) / (0.5 * newell.length()).max(f32::MIN_POSITIVE);
    (point_to_polygon(x, n, &corners) * lost.clamp(1.0, 1.1)).min(1.0)
}

fn curved(geometry: &Geometry, domain: Domain, back: bool, x: Vec3, n: Vec3, depth: u32) -> f32 {
    let point = geometry.point(geometry.middle(domain));
    let area = geometry.area(domain);
    let radius2 = geometry
        .corners(domain)
        .iter()
        .map(|&corner| geometry.point(corner).distance_squared(point))
        .fold(area * 0.25, f32::max);
    let bent = (domain.u1 - domain.u0).abs().max((domain.v1 - domain.v0).abs()) > CURVED_BENT;
    if depth == 0 || radius2 < CURVED_FAR * CURVED_FAR * point.distance_squared(x) && !bent {
        let side = if back { -1.0 } else { 1.0 };
        let points = geometry.quadrature(domain);
        return points
            .iter()
            .map(|&(uv, weight)| kernel(x, n, geometry.point(uv), geometry.normal(uv) * side, area * weight))
            .sum();
    }
    geometry.split(domain).into_iter().map(|part| curved(geometry, part, back, x, n, depth - 1)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec3;

    /// Oracle: midpoint rule over a parallelogram sender in f64.
    fn brute(x: DVec3, n: DVec3, origin: DVec3, a: DVec3, b: DVec3) -> f64 {
        let count = 600;
        let area = a.cross(b).length() / f64::from(count * count);
        let normal = a.cross(b).normalize();
        let mut sum = 0.0;
        for i in 0..count {
            for j in 0..count {
                let p = origin
                    + a * ((f64::from(i) + 0.5) / f64::from(count))
                    + b * ((f64::from(j) + 0.5) / f64::from(count));
                let to = p - x;
                let d2 = to.length_squared();
                sum += (to.dot(n).max(0.0) * (-to.dot(normal)).max(0.0)) / (PI * d2 * d2) * area;
            }
        }
        sum
    }

    #[test]
    fn polygon_agrees_with_brute_force_also_across_the_horizon() {
        let (origin, a, b) = (DVec3::new(-0.5, -1.0, 1.0), DVec3::new(0.0, 2.0, 0.3), DVec3::new(1.5, 0.0, 0.1));
        let corners = [origin, origin + a, origin + a + b, origin + b].map(|c| c.as_vec3());
        for n in [DVec3::Z, DVec3::new(1.0, 0.0, 0.2), DVec3::new(-0.3, 0.9, -0.2)] {
            let n = n.normalize();
            let x = DVec3::new(0.1, 0.2, 0.0);
            let exact = brute(x, n, origin, a, b);
            let ours = f64::from(point_to_polygon(x.as_vec3(), n.as_vec3(), &corners));
            assert!((ours - exact).abs() < 2e-4, "normal {n}: {ours} against {exact}");
            let reversed: Vec<Vec3> = corners.iter().rev().copied().collect();
            assert_eq!(point_to_polygon(x.as_vec3(), n.as_vec3(), &reversed), 0.0, "the polygon's back is dark");
        }
    }

    #[test]
    fn enclosing_box_sums_to_one() {
        let c = |x: f32, y: f32, z: f32| vec3(x, y, z);
        let faces = [
            [c(0., 0., 1.), c(0., 1., 1.), c(1., 1., 1.), c(1., 0., 1.)],
            [c(0., 0., 0.), c(0., 1., 0.), c(0., 1., 1.), c(0., 0., 1.)],
            [c(1., 0., 0.), c(1., 0., 1.), c(1., 1., 1.), c(1., 1., 0.)],
            [c(0., 0., 0.), c(0., 0., 1.), c(1., 0., 1.), c(1., 0., 0.)],
            [c(0., 1., 0.), c(1., 1., 0.), c(1., 1., 1.), c(0., 1., 1.)],
        ];
        for x in [vec3(0.5, 0.5, 0.0), vec3(1e-4, 0.3, 0.0), vec3(0.999, 0.001, 0.0)] {
            let sum: f32 = faces.iter().map(|face| point_to_polygon(x, Vec3::Z, face)).sum();
            assert!((sum - 1.0).abs() < 1e-5, "at {x} the row sums to {sum}");
        }
    }

    #[test]
    fn sphere_agrees_with_sampling_its_cap() {
        // Oracle: integrate the cosine over the directions that hit the sphere.
        for (center, radius) in [(vec3(0.0, 0.0, 2.0), 0.5), (vec3(1.5, 0.0, 0.4), 0.8), (vec3(1.0, 0.5, -0.2), 0.9)] {
            let d = center.as_dvec3().normalize();
            let half = (f64::from(radius) / f64::from(center.length())).asin();
            let (u, v) = d.any_orthonormal_pair();
            let (rings, steps) = (1500, 1500);
            let mut exact = 0.0;
            for i in 0..rings {
                let t = half * (f64::from(i) + 0.5) / f64::from(rings);
                for j in 0..steps {
                    let p = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(steps);
                    let w = d * t.cos() + (u * p.cos() + v * p.sin()) * t.sin();
                    exact += w.z.max(0.0) * t.sin() * (half / f64::from(rings)) * (2.0 * PI / f64::from(steps));
                }
            }
            exact /= PI;
            let ours = f64::from(point_to_sphere(Vec3::ZERO, Vec3::Z, center, radius));
            assert!((ours - exact).abs() < 1e-4, "{center} {radius}: {ours} against {exact}");
        }
    }
}

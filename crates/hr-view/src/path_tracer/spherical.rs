//! Directions toward a polygon that is near, spread evenly over the solid angle that it fills.
//!
//! Points spread evenly over its area would be noise there: what one of them sends falls with its squared distance, and the few nearest
//! ones send almost everything.
//!
//! J. Arvo: Stratified Sampling of Spherical Triangles, SIGGRAPH 1995; solid angles by A. Van Oosterom, J. Strackee: The Solid Angle of a
//! Plane Triangle, IEEE Transactions on Biomedical Engineering 30(2), 1983.

use glam::{Vec2, Vec3, vec2};
use hr_diffuse::{Domain, Geometry};
use smallvec::SmallVec;

/// Polygons that fill less (sr) are seen about evenly, and rounding would tell in their directions.
const LEAST: f32 = 0.2;

/// A polygon as it is seen from a point from which it is large: one spherical triangle, or two.
#[derive(Clone, Debug)]
pub(super) struct Spherical {
    triangles: SmallVec<[Triangle; 2]>,
    /// Of all of it, sr.
    solid_angle: f32,
}

/// A spherical triangle: unit directions and its solid angle.
#[derive(Clone, Copy, Debug)]
struct Triangle {
    corners: [Vec3; 3],
    solid_angle: f32,
}

impl Spherical {
    /// The part of a polygon as it is seen from a point; none where it is small, or seen from the edge.
    pub(super) fn new(geometry: &Geometry, domain: Domain, at: Vec3) -> Option<Self> {
        let corners = geometry.corners(domain);
        let toward: SmallVec<[Vec3; 4]> =
            corners.into_iter().map(|uv| (geometry.point(uv) - at).try_normalize()).collect::<Option<_>>()?;
        let first = toward[0];
        let triangles: SmallVec<[Triangle; 2]> =
            toward[1..].windows(2).map(|pair| Triangle::new([first, pair[0], pair[1]])).collect();
        let solid_angle = triangles.iter().map(|triangle| triangle.solid_angle).sum();
        (solid_angle >= LEAST).then_some(Self { triangles, solid_angle })
    }

    /// Of all of it, sr.
    pub(super) fn solid_angle(&self) -> f32 {
        self.solid_angle
    }

    /// A unit direction for two numbers in 0…1, of density 1 / [`solid_angle`](Self::solid_angle); none where rounding leaves none.
    pub(super) fn direction(&self, u: Vec2) -> Option<Vec3> {
        let mut rest = u.x * self.solid_angle;
        let (last, before) = self.triangles.split_last()?;
        for triangle in before {
            if rest < triangle.solid_angle {
                return triangle.direction(vec2(rest / triangle.solid_angle, u.y));
            }
            rest -= triangle.solid_angle;
        }
        last.direction(vec2((rest / last.solid_angle).min(1.0), u.y))
    }
}

impl Triangle {
    fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let volume = a.dot(b.cross(c)).abs();
        let solid_angle = 2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        Self { corners, solid_angle }
    }

    /// A unit direction for two numbers in 0…1: the first cuts off its share of the triangle by an arc through the second corner, the
    /// other is a place along that arc.
    fn direction(&self, u: Vec2) -> Option<Vec3> {
        let [a, b, c] = self.corners;
        let toward = |to: Vec3| (to - a * a.dot(to)).try_normalize();
        let (to_b, to_c) = (toward(b)?, toward(c)?);
        let (cos_alpha, sin_alpha) = (to_b.dot(to_c), to_b.cross(to_c).length());
        // Of the angle that the cut-off triangle's excess leaves.
        let (sin, cos) = (u.x * self.solid_angle).sin_cos();
        let (s, t) = (sin * cos_alpha - cos * sin_alpha, cos * cos_alpha + sin * sin_alpha);
        let (p, q) = (t - cos_alpha, s + sin_alpha * a.dot(b));
        let along = ((q * t - p * s) * cos_alpha - q) / ((q * s + p * t) * sin_alpha);
        // Nothing is cut off where the first number is 0.
        let along = if along.is_finite() { along.clamp(-1.0, 1.0) } else { 1.0 };
        let cut = a * along + to_c * (1.0 - along * along).sqrt();
        let z = 1.0 - u.y * (1.0 - cut.dot(b));
        let from_b = (cut - b * cut.dot(b)).normalize_or_zero();
        (b * z + from_b * (1.0 - z * z).max(0.0).sqrt()).try_normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{dvec3, vec3};
    use hr_diffuse::form_factor::point_to_surface;
    use hr_diffuse::sampling::point2;
    use hr_diffuse::{Normalization, Shape, Surface};
    use std::f32::consts::PI;

    fn polygons() -> [Geometry; 2] {
        let corners = [dvec3(0.0, 0.0, 0.0), dvec3(1.0, 0.0, 0.0), dvec3(1.1, 0.8, 0.0), dvec3(0.0, 0.9, 0.0)];
        [Shape::Quad(corners), Shape::Triangle([corners[0], corners[1], corners[3]])].map(|shape| {
            let surface = Surface::new(shape, 0);
            Geometry::from_surface(&surface, &Normalization::new(std::slice::from_ref(&surface))).expect("sound")
        })
    }

    /// The mean of the cosine times the solid angle is the form factor times π, by Lambert's formula.
    #[test]
    fn directions_are_spread_evenly() {
        const COUNT: u32 = 4096;
        for geometry in &polygons() {
            let (middle, normal) = geometry.sample(Domain::WHOLE, 0.4, 0.3);
            for (height, aside) in [(0.3, 0.0), (0.05, 0.1), (1e-3, 0.0), (0.02, 0.3)] {
                let at = middle + normal * height + vec3(aside, 0.0, 0.0);
                let spherical = Spherical::new(geometry, Domain::WHOLE, at).expect("it is near");
                for n in [-normal, vec3(0.6, 0.0, -0.8 * normal.z.signum())] {
                    let expected = PI * point_to_surface(geometry, &Domain::WHOLE, false, at, n);
                    let cosine = |k| spherical.direction(point2(7, k)).map_or(0.0, |d| d.dot(n).max(0.0));
                    let mean = (0..COUNT).map(cosine).sum::<f32>() / COUNT as f32;
                    let found = mean * spherical.solid_angle();
                    assert!((found / expected - 1.0).abs() < 5e-3, "{found}, expected {expected} at {height}, {aside}");
                }
            }
        }
    }

    #[test]
    fn directions_meet_the_polygon_that_they_are_for() {
        for geometry in &polygons() {
            let (middle, normal) = geometry.sample(Domain::WHOLE, 0.4, 0.3);
            for height in [0.3, 0.01, 1e-4] {
                let at = middle + normal * height;
                let spherical = Spherical::new(geometry, Domain::WHOLE, at).expect("it is near");
                let meets = |k| {
                    let direction = spherical.direction(point2(3, k))?;
                    geometry.intersect(at, direction, 0.0, f32::MAX)
                };
                let met = (0..1000).filter_map(meets).count();
                assert!(met >= 995, "{met} of 1000 from {height}: rounding may lose some at the border");
            }
        }
    }

    #[test]
    fn what_is_far_or_seen_from_the_edge_is_not_near() {
        let [quad, _] = polygons();
        let (middle, normal) = quad.sample(Domain::WHOLE, 0.5, 0.5);
        assert!(Spherical::new(&quad, Domain::WHOLE, middle + normal * 3.0).is_none(), "far");
        assert!(Spherical::new(&quad, Domain::WHOLE, middle + vec3(2.0, 0.0, 0.0)).is_none(), "in its plane");
        let corner = quad.point(quad.corners(Domain::WHOLE)[0]);
        assert!(Spherical::new(&quad, Domain::WHOLE, corner).is_none(), "from a corner");
    }
}

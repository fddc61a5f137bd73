//! Surfaces in normalised space: points, normals, areas, bounds, splitting and ray intersection in (u, v).
//!
//! A scene is shifted and scaled in f64 into the unit cube ([`Normalization`]); from there on everything is f32 and
//! every tolerance is relative to the scene. There are three kinds of [`Geometry`]: triangles, planar convex
//! quadrilaterals, and surfaces of revolution (sphere, cone, cylinder, ring, disk, torus), whose profile is a
//! straight line or a circle's arc. All of them are maps of (u, v) in the unit square (triangle: its lower left
//! half) to space; an element of the hierarchy is a [`Domain`] in (u, v). Domains are split at midpoints only, so
//! their corners are dyadic numbers, exact in f32 down to 2⁻²³, and points on an edge that two polygons share come
//! out bit-identical from both.

mod aabb;
mod error;
mod facts;
mod normalization;
mod polygon;
mod revolution;
mod roots;
pub(crate) mod slabs;
#[cfg(test)]
pub(crate) mod tests;

pub use aabb::Aabb;
pub use error::GeometryError;
pub use facts::{FACETS, Facet};
pub use normalization::Normalization;
pub(crate) use polygon::Outline;
pub use polygon::{Quad, Triangle};
pub use revolution::{Profile, Revolution};

use crate::{Cone, Shape, Surface};
use glam::{DVec2, DVec3, Vec2, Vec3, vec2};
use smallvec::{SmallVec, smallvec};

/// A piece that is longer than this many times its width is split across its length only.
const LONG: f32 = 2.5;

/// Part of a surface.
///
/// For a triangle: the sub-triangle with the corners (`u0`, `v0`), (`u1`, `v0`), (`u0`, `v1`), where `u1 − u0` equals
/// `v1 − v0` and is negative for the middle child, which stands on its head. For all other kinds: the rectangle
/// between the two corners, `u0 < u1`, `v0 < v1`.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Domain {
    /// First corner, u, 0…1.
    pub u0: f32,
    /// First corner, v, 0…1.
    pub v0: f32,
    /// Opposite corner, u, 0…1.
    pub u1: f32,
    /// Opposite corner, v, 0…1.
    pub v1: f32,
}

impl Domain {
    /// The whole surface.
    pub const WHOLE: Self = Self { u0: 0.0, v0: 0.0, u1: 1.0, v1: 1.0 };

    /// The parameters at fractions `s`, `t` (0…1) of the domain's sides. For a triangle only `s + t ≤ 1` is inside.
    #[must_use]
    pub fn lerp(&self, s: f32, t: f32) -> Vec2 {
        vec2(self.u0 + (self.u1 - self.u0) * s, self.v0 + (self.v1 - self.v0) * t)
    }

    /// Four similar parts of a triangle's, the middle one last.
    pub(crate) fn quarter_triangle(&self) -> SmallVec<[Self; 4]> {
        let Self { u0, v0, u1, v1 } = *self;
        let (u, v) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
        let part = |u0, v0, u1, v1| Self { u0, v0, u1, v1 };
        smallvec![part(u0, v0, u, v), part(u, v0, u1, v), part(u0, v, u, v1), part(u, v, u0, v0)]
    }

    /// Area of the rectangle between the corners, in parameter space.
    fn rectangle(&self) -> f32 {
        ((self.u1 - self.u0) * (self.v1 - self.v0)).abs()
    }
}

/// One surface in unit space. Its front is where [`normal`](Self::normal) points.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// P = p₀(1−u−v) + p₁u + p₂v.
    Triangle(Triangle),
    /// Planar and convex, bilinear in (u, v).
    Quad(Quad),
    /// u is the angle around the axis in full turns, v runs along the profile.
    Revolution(Revolution),
}

impl Geometry {
    /// Takes a surface over into unit space.
    ///
    /// # Errors
    /// A [`GeometryError`] if the surface has non-finite numbers, no area, radii out of range, or is a quadrilateral
    /// that is not planar and convex; or if it is so small against the scene that f32 cannot hold it. A scene is
    /// still sound without such a surface, so callers may leave it out.
    pub fn from_surface(surface: &Surface, normalization: &Normalization) -> Result<Self, GeometryError> {
        let flip = surface.flip;
        Ok(match &surface.shape {
            Shape::Triangle(points) => Self::Triangle(Triangle::new(points, flip, normalization)?),
            Shape::Quad(points) => Self::Quad(Quad::new(points, flip, normalization)?),
            Shape::Sphere { center, radius } => {
                Self::Revolution(Revolution::sphere(*center, *radius, flip, normalization)?)
            }
            Shape::Cone { ends, radii } => Self::Revolution(Revolution::cone(*ends, *radii, flip, normalization)?),
            Shape::Ring { center, normal, inner, outer } => {
                Self::Revolution(Revolution::ring(*center, *normal, [*inner, *outer], flip, normalization)?)
            }
            Shape::Torus { center, axis, major, minor } => {
                Self::Revolution(Revolution::torus(*center, *axis, [*major, *minor], flip, normalization)?)
            }
        })
    }

    /// The point at (u, v).
    #[must_use]
    pub fn point(&self, uv: Vec2) -> Vec3 {
        match self {
            Self::Triangle(triangle) => triangle.point(uv),
            Self::Quad(quad) => quad.point(uv),
            Self::Revolution(revolution) => revolution.point(uv),
        }
    }

    /// The unit normal on the front side at (u, v). At the tip of a cone: that of the mantle in direction u.
    #[must_use]
    pub fn normal(&self, uv: Vec2) -> Vec3 {
        match self {
            Self::Triangle(triangle) => triangle.normal(),
            Self::Quad(quad) => quad.normal(),
            Self::Revolution(revolution) => revolution.normal(uv),
        }
    }

    /// Both at the cost of one.
    #[must_use]
    pub fn point_and_normal(&self, uv: Vec2) -> (Vec3, Vec3) {
        match self {
            Self::Triangle(_) | Self::Quad(_) => (self.point(uv), self.normal(uv)),
            Self::Revolution(revolution) => revolution.point_and_normal(uv),
        }
    }

    /// Area per parameter area at (u, v): |∂P/∂u × ∂P/∂v|. 0 at the poles of a sphere and the tip of a cone.
    #[must_use]
    pub fn jacobian(&self, uv: Vec2) -> f32 {
        match self {
            Self::Triangle(triangle) => 2.0 * triangle.area(),
            Self::Quad(quad) => quad.jacobian(uv),
            Self::Revolution(revolution) => revolution.jacobian(uv),
        }
    }

    /// [`point`](Self::point), [`normal`](Self::normal) and [`jacobian`](Self::jacobian) in double precision.
    #[must_use]
    pub fn place(&self, uv: DVec2) -> (DVec3, DVec3, f64) {
        match self {
            Self::Triangle(triangle) => {
                let [p0, p1, p2] = triangle.points().map(|p| p.as_dvec3());
                let (e, f) = (p1 - p0, p2 - p0);
                (p0 + e * uv.x + f * uv.y, triangle.normal().as_dvec3(), e.cross(f).length())
            }
            Self::Quad(quad) => {
                let [p0, p1, p2, p3] = quad.points().map(|p| p.as_dvec3());
                let (along_u, along_v) = ((p1 - p0).lerp(p2 - p3, uv.y), (p3 - p0).lerp(p2 - p1, uv.x));
                let point = p0.lerp(p1, uv.x).lerp(p3.lerp(p2, uv.x), uv.y);
                (point, quad.normal().as_dvec3(), along_u.cross(along_v).length())
            }
            Self::Revolution(revolution) => revolution.place(uv),
        }
    }

    /// Area of a part (one side), in closed form.
    #[must_use]
    pub fn area(&self, domain: Domain) -> f32 {
        match self {
            Self::Triangle(triangle) => triangle.area() * domain.rectangle(),
            Self::Quad(quad) => quad.domain_area(domain),
            Self::Revolution(revolution) => revolution.domain_area(domain),
        }
    }

    /// Maps the unit square uniformly to the parameters of a part: mean over (s, t) = mean over (u, v).
    #[must_use]
    pub fn domain_point(&self, domain: Domain, s: f32, t: f32) -> Vec2 {
        match self {
            // The half beyond the diagonal is turned around onto the other one.
            Self::Triangle(_) if s + t > 1.0 => domain.lerp(1.0 - s, 1.0 - t),
            _ => domain.lerp(s, t),
        }
    }

    /// A point of a part for two numbers in 0…1, with its front normal and a weight: the mean of f·weight over the
    /// unit square of (s, t) is the integral of f over the part's area. The weight is the part's area wherever the
    /// map can be made to keep areas (all but the torus and quadrilaterals that are no parallelograms).
    #[must_use]
    pub fn sample_area(&self, domain: Domain, s: f32, t: f32) -> (Vec3, Vec3, f32) {
        let (point, normal) = self.sample(domain, s, t);
        let weight = match self {
            Self::Triangle(_) => self.area(domain),
            Self::Quad(quad) => quad.jacobian(domain.lerp(s, t)) * domain.rectangle(),
            Self::Revolution(revolution) => revolution.sample_weight(domain, revolution.sample(domain, s, t)),
        };
        (point, normal, weight)
    }

    /// Point and normal of [`sample_area`](Self::sample_area) alone, for where areas are kept or the difference does not
    /// matter.
    #[must_use]
    pub fn sample(&self, domain: Domain, s: f32, t: f32) -> (Vec3, Vec3) {
        match self {
            Self::Triangle(triangle) => (triangle.point(self.domain_point(domain, s, t)), triangle.normal()),
            Self::Quad(quad) => (quad.point(domain.lerp(s, t)), quad.normal()),
            Self::Revolution(revolution) => revolution.point_and_normal(revolution.sample(domain, s, t)),
        }
    }

    /// A box that holds all points of a part, as [`point`](Self::point) computes them: exact up to
    /// [`Aabb::ROUNDING`], also where the surface bulges.
    #[must_use]
    pub fn bounds(&self, domain: Domain) -> Aabb {
        let exact = match self {
            Self::Revolution(revolution) => revolution.domain_bounds(domain),
            _ => Aabb::of_points(self.corners(domain).into_iter().map(|uv| self.point(uv))),
        };
        exact.padded(Aabb::ROUNDING)
    }

    /// A cone that holds all front normals of a part; exactly one direction where it is flat.
    #[must_use]
    pub fn normal_cone(&self, domain: Domain) -> Cone {
        match self {
            Self::Triangle(triangle) => Cone::single(triangle.normal()),
            Self::Quad(quad) => Cone::single(quad.normal()),
            Self::Revolution(revolution) => revolution.domain_normals(domain),
        }
    }

    /// Whether all of it lies in one plane.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        match self {
            Self::Triangle(_) | Self::Quad(_) => true,
            Self::Revolution(revolution) => revolution.is_flat(),
        }
    }

    /// The parameters of a part's corners in order around it: three for triangles, else four (of which some may
    /// be the same point: the poles of a sphere).
    #[must_use]
    pub fn corners(&self, domain: Domain) -> SmallVec<[Vec2; 4]> {
        let Domain { u0, v0, u1, v1 } = domain;
        match self {
            Self::Triangle(_) => smallvec![vec2(u0, v0), vec2(u1, v0), vec2(u0, v1)],
            _ => smallvec![vec2(u0, v0), vec2(u1, v0), vec2(u1, v1), vec2(u0, v1)],
        }
    }

    /// Cuts a part at the midpoints of its sides into four, or into two where it is much longer than wide or
    /// goes around more than a quarter turn. Triangles always give four, the middle one last.
    ///
    /// Midpoints are exact as long as no side is shorter than 2⁻²³; callers stop long before.
    #[must_use]
    pub fn split(&self, domain: Domain) -> SmallVec<[Domain; 4]> {
        let Domain { u0, v0, u1, v1 } = domain;
        let (u, v) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
        let part = |u0, v0, u1, v1| Domain { u0, v0, u1, v1 };
        let (cut_u, cut_v) = match self {
            Self::Triangle(_) => return domain.quarter_triangle(),
            Self::Quad(quad) => cuts(quad.extent(domain)),
            Self::Revolution(revolution) => {
                // Pieces that go far around are bent, not long: one cut at a time, the axis first.
                let (around, along) = revolution.turns(domain);
                match cuts(revolution.extent(domain)) {
                    (true, _) if around > 0.25 => (true, false),
                    (_, true) if along > 0.25 => (false, true),
                    cuts => cuts,
                }
            }
        };
        match (cut_u, cut_v) {
            (true, false) => smallvec![part(u0, v0, u, v1), part(u, v0, u1, v1)],
            (false, _) => smallvec![part(u0, v0, u1, v), part(u0, v, u1, v1)],
            (true, true) => smallvec![part(u0, v0, u, v), part(u, v0, u1, v), part(u0, v, u, v1), part(u, v, u1, v1)],
        }
    }

    /// Halves of a part, cut along which way it turns most: around the axis or around the profile's centre. None where it
    /// is a polygon.
    pub(crate) fn turned_less(&self, domain: Domain) -> Option<[Domain; 2]> {
        let Self::Revolution(revolution) = self else { return None };
        let Domain { u0, v0, u1, v1 } = domain;
        let (u, v) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
        let (around, along) = revolution.turns(domain);
        Some(if around >= along {
            [Domain { u1: u, ..domain }, Domain { u0: u, ..domain }]
        } else {
            [Domain { v1: v, ..domain }, Domain { v0: v, ..domain }]
        })
    }

    /// Share of a full turn that a part of a surface of revolution goes around its axis; 0 for others.
    pub(crate) fn around(&self, domain: Domain) -> f32 {
        match self {
            Self::Revolution(revolution) => revolution.turns(domain).0,
            _ => 0.0,
        }
    }

    /// Whether the parameters are in a part; its border is.
    #[must_use]
    pub fn contains(&self, domain: Domain, uv: Vec2) -> bool {
        self.distance_outside(domain, uv) <= 0.0
    }

    /// Index of the child that holds the parameters, of the nearest one if rounding has put them outside all.
    #[must_use]
    pub fn locate(&self, children: impl IntoIterator<Item = Domain>, uv: Vec2) -> usize {
        let mut nearest = (f32::INFINITY, 0);
        for (i, child) in children.into_iter().enumerate() {
            let distance = self.distance_outside(child, uv);
            if distance < nearest.0 {
                nearest = (distance, i);
            }
        }
        nearest.1
    }

    /// How far outside a part the parameters are; ≤ 0 inside.
    fn distance_outside(&self, domain: Domain, uv: Vec2) -> f32 {
        let Domain { u0, v0, u1, v1 } = domain;
        match self {
            Self::Triangle(_) => {
                let size = u1 - u0;
                let (a, b) = ((uv.x - u0) * size.signum(), (uv.y - v0) * size.signum());
                (-a).max(-b).max(a + b - size.abs())
            }
            _ => (u0 - uv.x).max(uv.x - u1).max(v0 - uv.y).max(uv.y - v1),
        }
    }

    /// The parameters of the surface point nearest to a point on (or, by rounding, next to) the surface.
    #[must_use]
    pub fn parameters_of(&self, point: Vec3) -> Vec2 {
        match self {
            Self::Triangle(triangle) => triangle.parameters_of(point),
            Self::Quad(quad) => quad.parameters_of(point),
            Self::Revolution(revolution) => revolution.parameters_of(point),
        }
    }

    /// The nearest hit of a ray, from either side, with `t_min` < t < `t_max`, in multiples of `direction` (of any
    /// length), and its parameters. A ray that runs within a plane does not hit it.
    #[must_use]
    pub fn intersect(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<(f32, Vec2)> {
        match self {
            Self::Triangle(triangle) => {
                let t = triangle.outline().intersect(origin, direction, t_min, t_max)?;
                Some((t, triangle.parameters_of(origin + direction * t)))
            }
            Self::Quad(quad) => {
                let t = quad.outline().intersect(origin, direction, t_min, t_max)?;
                Some((t, quad.parameters_of(origin + direction * t)))
            }
            Self::Revolution(revolution) => revolution.intersect(origin, direction, t_min, t_max),
        }
    }

    /// The distance alone of [`intersect`](Self::intersect), which takes less time.
    pub(crate) fn distance(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<f32> {
        match self {
            Self::Triangle(triangle) => triangle.outline().intersect(origin, direction, t_min, t_max),
            Self::Quad(quad) => quad.outline().intersect(origin, direction, t_min, t_max),
            Self::Revolution(revolution) => revolution.distance(origin, direction, t_min, t_max),
        }
    }

    /// Length of the longest chord that rounding alone can put between a curved surface and a ray that leaves it
    /// tangentially; 0 for flat surfaces. Hits of a ray on its own surface nearer than this mean nothing.
    #[must_use]
    pub fn self_gap(&self) -> f32 {
        match self {
            Self::Revolution(revolution) if !revolution.is_flat() => revolution.self_gap(),
            _ => 0.0,
        }
    }
}

/// Which sides of a rectangle to cut, by its lengths along u and v.
fn cuts((along_u, along_v): (f32, f32)) -> (bool, bool) {
    (along_u * LONG >= along_v, along_v * LONG >= along_u)
}

//! What the hierarchy asks of a part of a surface beside its geometry.

use super::{Domain, Geometry, Profile};
use crate::Facing;
use glam::{Vec2, Vec3, vec2};
use smallvec::{SmallVec, smallvec};

/// Gauss–Legendre points of order 2 on 0…1.
const GAUSS: [f32; 2] = [0.211_324_87, 0.788_675_1];

/// How many [`Facet`]s stand for a curved part.
pub const FACETS: usize = 16;

/// A small piece of a curved part.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Facet {
    /// Its middle.
    pub point: Vec3,
    /// Unit normal there.
    pub normal: Vec3,
    /// Its area.
    pub area: f32,
}

impl Geometry {
    /// Whether it is bounded by straight edges.
    #[must_use]
    pub fn is_polygon(&self) -> bool {
        matches!(self, Self::Triangle(_) | Self::Quad(_))
    }

    /// The least and the greatest coordinate of a polygon's corners along a direction; `None` for other surfaces.
    pub(crate) fn heights(&self, direction: Vec3) -> Option<[f32; 2]> {
        let each = self.polygon()?.iter().map(|p| p.dot(direction));
        Some(each.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], height| [low.min(height), high.max(height)]))
    }

    /// The corners of a polygon.
    pub(crate) fn polygon(&self) -> Option<&[Vec3]> {
        match self {
            Self::Triangle(triangle) => Some(triangle.points()),
            Self::Quad(quad) => Some(quad.points()),
            Self::Revolution(_) => None,
        }
    }

    /// The least coordinate of the whole surface along a unit direction.
    #[inline]
    pub(crate) fn lowest(&self, direction: Vec3) -> f32 {
        match self {
            Self::Triangle(triangle) => {
                let [a, b, c] = triangle.points().map(|p| p.dot(direction));
                a.min(b).min(c)
            }
            Self::Quad(quad) => {
                let [a, b, c, d] = quad.points().map(|p| p.dot(direction));
                a.min(b).min(c.min(d))
            }
            Self::Revolution(revolution) => revolution.lowest(direction),
        }
    }

    /// Centre and radius, if it is a sphere.
    #[must_use]
    pub fn sphere(&self) -> Option<(Vec3, f32)> {
        match self {
            Self::Revolution(revolution) => match revolution.profile() {
                Profile::Arc { center: 0.0, radius, .. } => Some((revolution.center(), radius)),
                _ => None,
            },
            _ => None,
        }
    }

    /// Whether no two points of one side of the surface see each other: flat ones, and the outside of spheres and
    /// cones.
    #[must_use]
    pub fn is_convex(&self, back: bool) -> bool {
        if self.is_flat() {
            return true;
        }
        let Self::Revolution(revolution) = self else { return true };
        if matches!(revolution.profile(), Profile::Arc { center, .. } if center > 0.0) {
            return false;
        }
        let uv = vec2(0.0, 0.5);
        let from_center = self.point(uv) - revolution.center();
        let outward = from_center - revolution.axis() * from_center.dot(revolution.axis());
        (self.normal(uv).dot(outward) > 0.0) != back
    }

    /// Parameters of the middle of a part.
    #[must_use]
    pub fn middle(&self, domain: Domain) -> Vec2 {
        match self {
            Self::Triangle(_) => domain.lerp(1.0 / 3.0, 1.0 / 3.0),
            _ => domain.lerp(0.5, 0.5),
        }
    }

    /// Weights of the corners of a polygon at (u, v): they sum to 1.
    #[must_use]
    pub fn corner_weights(&self, uv: Vec2) -> [f32; 4] {
        let Vec2 { x: u, y: v } = uv;
        match self {
            Self::Triangle(_) => [1.0 - u - v, u, v, 0.0],
            _ => [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v],
        }
    }

    /// Three or four points of a part with weights that sum to 1, for means over its area: exact for quadratic functions on
    /// triangles and rectangles.
    #[must_use]
    pub fn quadrature(&self, domain: Domain) -> SmallVec<[(Vec2, f32); 4]> {
        if let Self::Triangle(_) = self {
            // Strang and Fix: exact for polynomials of degree 2.
            let [low, high] = [1.0 / 6.0, 2.0 / 3.0];
            return [(low, low), (high, low), (low, high)]
                .iter()
                .map(|&(s, t)| (domain.lerp(s, t), 1.0 / 3.0))
                .collect();
        }
        let mut points: SmallVec<[(Vec2, f32); 4]> = smallvec![];
        for t in GAUSS {
            for s in GAUSS {
                let uv = domain.lerp(s, t);
                points.push((uv, self.jacobian(uv)));
            }
        }
        let sum: f32 = points.iter().map(|(_, w)| w).sum();
        for (_, weight) in &mut points {
            *weight /= sum.max(f32::MIN_POSITIVE);
        }
        points
    }

    /// Points, unit normals (front side) and areas of equal steps in the parameters, that stand for a curved part.
    #[must_use]
    pub fn facets(&self, domain: Domain) -> [Facet; FACETS] {
        const SIDE: usize = 4;
        let area = self.area(domain);
        let mut facets = [Facet::default(); FACETS];
        let mut sum = 0.0;
        for (i, facet) in facets.iter_mut().enumerate() {
            let step = |k: usize| (k as f32 + 0.5) / SIDE as f32;
            let uv = domain.lerp(step(i % SIDE), step(i / SIDE));
            let (point, normal) = self.point_and_normal(uv);
            *facet = Facet { point, normal, area: self.jacobian(uv) };
            sum += facet.area;
        }
        for facet in &mut facets {
            facet.area *= area / sum.max(f32::MIN_POSITIVE);
        }
        facets
    }

    /// How the front normals of a part are distributed.
    #[must_use]
    pub fn facing(&self, domain: Domain) -> Facing {
        if self.is_flat() {
            return Facing::single(self.normal(self.middle(domain)));
        }
        // The midpoint rule: its symmetry makes closed surfaces come out as exactly as f32 has it.
        let steps = if domain.u1 - domain.u0 > 0.2 || domain.v1 - domain.v0 > 0.2 { 12 } else { 4 };
        let (mut sum, mut area) = (Facing::ZERO, 0.0);
        for i in 0..steps {
            for j in 0..steps {
                let uv = domain.lerp((i as f32 + 0.5) / steps as f32, (j as f32 + 0.5) / steps as f32);
                let weight = self.jacobian(uv);
                sum.add(&Facing::single(self.normal(uv)), weight);
                area += weight;
            }
        }
        if area > 0.0 { sum.scaled(area.recip()) } else { Facing::single(self.normal(self.middle(domain))) }
    }
}

//! The non-adaptive basis (paper, section 4.1): a tetrahedron subdivided evenly, values at its vertices, linear between.
//!
//! Midpoints of edges are moved out to the sphere before they are subdivided further, so that the triangles of one level
//! differ in size by much less than those of a flat tetrahedron, whose largest have 27 times the solid angle of the
//! smallest. All that depends on the level only, where vertices are and how triangles lie, is made once for each level
//! and shared; a distribution is nothing but the values.

use super::half::{Half3, decode, encode, scale_for};
use super::triangle::{ConeTest, Overlap, PIECE_SPLITS, Triangle, child_corners};
use super::{Basis, Known, Projected, Sampler};
use crate::Rgb;
use glam::{DVec3, Vec3};
use hr_diffuse::Cone;
use std::collections::HashMap;
use std::iter::zip;
use std::sync::OnceLock;

/// Settings of the non-adaptive basis: how often the tetrahedron is subdivided, at most [`Level::MAX`]. Level n has
/// 4ⁿ⁺¹ triangles and 2·4ⁿ + 2 vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level(pub u8);

impl Level {
    /// 131,074 vertices, 0.4° apart.
    pub const MAX: u8 = 8;
}

/// A directional distribution with a value at each vertex of an evenly subdivided tetrahedron.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NonAdaptive {
    /// What values are multiplied by; ≥ 0.
    scale: f32,
    level: u8,
    /// By vertex. Empty: zero everywhere.
    values: Box<[Half3]>,
}

/// What all distributions of a level share.
#[derive(Debug)]
struct Mesh {
    /// Unit directions of the vertices.
    vertices: Vec<Vec3>,
    /// Vertices at the corners of the triangles, level by level, the four parts of a triangle together.
    corners: Vec<[u32; 3]>,
    /// Of each divided triangle: normals of the planes through the origin that cut off its corners, toward them.
    cuts: Vec<[Vec3; 3]>,
    /// ∫ of the hat function at each vertex, sr.
    weights: Vec<f64>,
}

/// Triangles on all levels before this one.
fn before(level: u8) -> usize {
    4 * ((1 << (2 * level)) - 1) / 3
}

impl Mesh {
    fn of(level: u8) -> &'static Self {
        static MESHES: [OnceLock<Mesh>; Level::MAX as usize + 1] = [const { OnceLock::new() }; Level::MAX as usize + 1];
        MESHES[usize::from(level)].get_or_init(|| Self::new(level))
    }

    fn new(level: u8) -> Self {
        let vertices = [Vec3::ONE, Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0)];
        let mut mesh = Self {
            vertices: vertices.map(Vec3::normalize).to_vec(),
            // Face f is opposite vertex f, counterclockwise from outside.
            corners: vec![[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]],
            cuts: Vec::with_capacity(before(level)),
            weights: Vec::new(),
        };
        let mut known: HashMap<[u32; 2], u32> = HashMap::new();
        for index in 0..before(level) {
            let corners = mesh.corners[index];
            let mids = [[1, 2], [2, 0], [0, 1]].map(|[i, j]: [usize; 2]| {
                let (a, b) = (corners[i], corners[j]);
                *known.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    let [a, b] = [a, b].map(|v| mesh.vertices[v as usize]);
                    mesh.vertices.push((a + b).normalize());
                    mesh.vertices.len() as u32 - 1
                })
            });
            let [d, e, f] = mids.map(|v| mesh.vertices[v as usize]);
            mesh.cuts.push([f.cross(e), d.cross(f), e.cross(d)]);
            mesh.corners.extend((0..4).map(|child| child_corners(corners, mids, child)));
        }
        mesh.weights = vec![0.0; mesh.vertices.len()];
        for index in mesh.leaves(level) {
            let hats = [DVec3::X, DVec3::Y, DVec3::Z];
            let parts = mesh.triangle(index).integrate(hats, splits(level), &|_| 1.0).0.to_array();
            for (vertex, part) in zip(mesh.corners[index], parts) {
                mesh.weights[vertex as usize] += part;
            }
        }
        mesh
    }

    fn leaves(&self, level: u8) -> std::ops::Range<usize> {
        before(level)..self.corners.len()
    }

    fn triangle(&self, index: usize) -> Triangle {
        Triangle::new(self.corners[index].map(|v| self.vertices[v as usize]))
    }

    /// The undivided triangle around a direction, as an index.
    #[inline]
    fn find(&self, level: u8, direction: Vec3) -> usize {
        // The face opposite the vertex that is farthest.
        let far = |face: usize| self.vertices[face].dot(direction);
        let mut index = (1..4).fold(0, |best, face| if far(face) < far(best) { face } else { best });
        for _ in 0..level {
            let [a, b, c] = self.cuts[index].map(|n| n.dot(direction) > 0.0);
            let child = if a {
                0
            } else if b {
                1
            } else if c {
                2
            } else {
                3
            };
            index = 4 + 4 * index + child;
        }
        index
    }
}

/// How often the quadrature divides the triangles of a level: those of the tetrahedron itself are large.
fn splits(level: u8) -> u32 {
    3_u32.saturating_sub(level.into())
}

impl NonAdaptive {
    fn new(level: u8, values: &[Rgb]) -> Self {
        let size = |v: &Rgb| if v.is_finite() { v.abs().max_element() } else { 0.0 };
        let scale = scale_for(values.iter().map(size).fold(0.0, f32::max));
        if scale == 0.0 {
            return Self::default();
        }
        let stored = |&v: &Rgb| encode(if v.is_finite() { v } else { Rgb::ZERO }, scale);
        Self { scale, level, values: values.iter().map(stored).collect() }
    }

    fn mesh(&self) -> &'static Mesh {
        Mesh::of(self.level)
    }

    fn corner_values(&self, corners: [u32; 3]) -> [Rgb; 3] {
        corners.map(|v| decode(self.values[v as usize]))
    }

    /// Extends bounds by the triangles under one that a cone touches.
    fn bound(&self, mesh: &Mesh, index: usize, test: &ConeTest, range: &mut (Rgb, Rgb)) {
        if mesh.triangle(index).overlap(test) == Overlap::Apart {
            return;
        }
        if index < mesh.cuts.len() {
            for child in 0..4 {
                self.bound(mesh, 4 + 4 * index + child, test, range);
            }
        } else {
            let values = self.corner_values(mesh.corners[index]);
            mesh.triangle(index).bound(values, test, PIECE_SPLITS, &mut range.0, &mut range.1);
        }
    }
}

impl Basis for NonAdaptive {
    type Settings = Level;

    /// Evaluates the function at the vertices: peaks between them are missed.
    fn project(settings: &Level, known: &Known<'_>, mut f: impl FnMut(Vec3) -> Rgb) -> Projected<Self> {
        let level = settings.0.min(Level::MAX);
        let mut sampler = Sampler::new(known.support.as_ref());
        let values: Vec<Rgb> = Mesh::of(level).vertices.iter().map(|&v| sampler.at(v, &mut f)).collect();
        sampler.projected(Self::new(level, &values))
    }

    fn eval(&self, direction: Vec3) -> Rgb {
        if self.values.is_empty() || !direction.is_finite() || direction == Vec3::ZERO {
            return Rgb::ZERO;
        }
        // Neither products of huge components nor of tiny ones.
        let direction = direction / direction.abs().max_element();
        let mesh = self.mesh();
        let corners = mesh.corners[mesh.find(self.level, direction)];
        let [a, b, c] = corners.map(|v| mesh.vertices[v as usize]);
        // Where the ray meets the triangle's plane, barycentric coordinates are these volumes.
        let weights = Vec3::new(b.cross(c).dot(direction), c.cross(a).dot(direction), a.cross(b).dot(direction));
        let weights = weights.max(Vec3::ZERO);
        let [p, q, r] = self.corner_values(corners);
        (weights.x * p + weights.y * q + weights.z * r) * (self.scale / weights.element_sum())
    }

    /// On the finer of both subdivisions, where the coarser one is evaluated.
    fn add(&self, other: &Self) -> Self {
        match (self.is_empty(), other.is_empty()) {
            (_, true) => self.clone(),
            (true, false) => other.clone(),
            _ => Self::average(&[(1.0, self), (1.0, other)], &Level(self.level.max(other.level)), Rgb::ZERO),
        }
    }

    fn scale(&mut self, factor: f32) {
        let scale = self.scale * factor.abs();
        if !(scale.is_finite() && scale >= f32::MIN_POSITIVE) {
            *self = Self::default();
            return;
        }
        self.scale = scale;
        if factor < 0.0 {
            for value in &mut self.values {
                *value = encode(-decode(*value), 1.0);
            }
        }
    }

    fn average(distributions: &[(f32, &Self)], settings: &Level, _offset: Rgb) -> Self {
        let level = settings.0.min(Level::MAX);
        let some = distributions.iter().filter(|(w, h)| *w != 0.0 && w.is_finite() && !h.is_empty());
        let mesh = Mesh::of(level);
        let mut sum = vec![Rgb::ZERO; mesh.vertices.len()];
        for (weight, distribution) in some {
            if distribution.level == level {
                let factor = weight * distribution.scale;
                zip(&mut sum, &distribution.values).for_each(|(sum, &value)| *sum += factor * decode(value));
            } else {
                zip(&mut sum, &mesh.vertices).for_each(|(sum, &at)| *sum += *weight * distribution.eval(at));
            }
        }
        Self::new(level, &sum)
    }

    fn bounds(&self, cone: &Cone) -> (Rgb, Rgb) {
        if self.values.is_empty() {
            return (Rgb::ZERO, Rgb::ZERO);
        }
        let mut range = (Rgb::MAX, Rgb::MIN);
        let test = ConeTest::new(cone);
        let mesh = self.mesh();
        (0..4).for_each(|face| self.bound(mesh, face, &test, &mut range));
        let (low, high) = range;
        if low.cmpgt(high).any() {
            // No cone at all: one of its numbers is not a number.
            return self.bounds(&Cone::SPHERE);
        }
        // Rounding in the interpolation.
        let slack = low.abs().max(high.abs()) * (4.0 * f32::EPSILON);
        ((low - slack) * self.scale, (high + slack) * self.scale)
    }

    fn integral(&self) -> Rgb {
        if self.values.is_empty() {
            return Rgb::ZERO;
        }
        let parts = zip(&self.mesh().weights, &self.values);
        let sum: DVec3 = parts.map(|(&weight, &value)| weight * decode(value).as_dvec3()).sum();
        (sum * f64::from(self.scale)).as_vec3()
    }

    fn cosine_integral(&self, normal: Vec3) -> Rgb {
        if self.values.is_empty() {
            return Rgb::ZERO;
        }
        let mesh = self.mesh();
        let mut sum = DVec3::ZERO;
        for index in mesh.leaves(self.level) {
            let triangle = mesh.triangle(index);
            let above = triangle.corners.iter().filter(|c| c.dot(normal) > 0.0).count();
            if above > 0 {
                // The cosine has a kink where the horizon cuts a triangle.
                let splits = splits(self.level) + if above < 3 { 2 } else { 0 };
                let values = self.corner_values(mesh.corners[index]).map(|v| v.as_dvec3());
                sum += triangle.integrate(values, splits, &|d| d.dot(normal).max(0.0)).0;
            }
        }
        (sum * f64::from(self.scale)).as_vec3()
    }

    fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Triangles.
    fn basis_functions(&self) -> usize {
        if self.is_empty() { 0 } else { 4 << (2 * self.level) }
    }

    /// What all distributions of the level share is not counted.
    fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sphere_is_covered_once() {
        for level in 0..=5_u8 {
            let mesh = Mesh::of(level);
            assert_eq!(mesh.vertices.len(), (2 << (2 * level)) + 2, "vertices of level {level}");
            assert_eq!(mesh.leaves(level).len(), 4 << (2 * level), "triangles of level {level}");
            let total: f64 = mesh.weights.iter().sum();
            let off = (total / (4.0 * std::f64::consts::PI) - 1.0).abs();
            assert!(off < 2e-4, "level {level}: {off} of the sphere is missing or twice");
            for index in mesh.leaves(level) {
                let inside = mesh.triangle(index).center();
                assert_eq!(mesh.find(level, inside), index, "level {level}: the middle of a triangle is in it");
            }
        }
    }

    #[test]
    fn triangles_of_a_level_are_of_similar_size() {
        let mesh = Mesh::of(5);
        let sizes = || mesh.leaves(5).map(|index| mesh.triangle(index).integrate([DVec3::ONE; 3], 0, &|_| 1.0).1);
        let (least, most) = (sizes().fold(f64::MAX, f64::min), sizes().fold(0.0, f64::max));
        assert!(most < 8.0 * least, "largest to smallest: {}", most / least);
    }
}

//! Geometric entities: from vertices and radii in the file's local coordinates to surfaces in the scene's.

use super::fault::{Fault, fault};
use super::lexer::File;
use super::transform::{is_mirrored, scale};
use crate::polygon::{self, Piece};
use crate::warnings::Warnings;
use glam::{DAffine3, DVec3, Vec3};
use hr_diffuse::{Shape, Surface};

/// A vertex context.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Vertex {
    pub(super) point: DVec3,
    /// Unit length, or zero where there is none.
    pub(super) normal: DVec3,
}

/// Vertex normals of a face that differ by less than this shade like a flat face.
const SAME_NORMAL: f64 = 1e-6;

/// A torus whose hole is closed has a tube as thick as its circle; [`Shape::Torus`] wants it thinner.
const THICKEST_TUBE: f64 = 1.0 - 1e-9;

/// Where surfaces of one statement go: the transform and material in effect, and what is collected.
pub(super) struct Sink<'a> {
    pub(super) matrix: DAffine3,
    pub(super) material: u32,
    /// The statement, for warnings.
    pub(super) file: &'a File,
    pub(super) statement: usize,
    pub(super) surfaces: &'a mut Vec<Surface>,
    pub(super) warnings: &'a mut Warnings,
}

impl Sink<'_> {
    fn warn(&mut self, text: &str) {
        let (file, statement) = (self.file, self.statement);
        self.warnings.add(text, || file.place(statement));
    }

    fn push(&mut self, shape: Shape, flip: bool) {
        let surface = Surface { flip, ..Surface::new(shape, self.material) };
        self.surfaces.push(surface);
    }

    fn point(&self, p: DVec3) -> DVec3 {
        self.matrix.transform_point3(p)
    }

    fn direction(&self, v: DVec3) -> DVec3 {
        unit(self.matrix.transform_vector3(v))
    }

    /// A polygon; see [`polygon::pieces`] for `holes`.
    pub(super) fn face(&mut self, corners: &[Vertex], holes: &[usize]) {
        let points: Vec<_> = corners.iter().map(|corner| corner.point).collect();
        let outline = &points[..holes.first().copied().unwrap_or(points.len())];
        let (pieces, normal) = match polygon::pieces(&points, holes).and_then(|p| Ok((p, polygon::normal(outline)?))) {
            Ok(cut) => cut,
            Err(error) => return self.warn(&format!("face with {error}: left out")),
        };
        let all = corners.iter().all(|corner| corner.normal != DVec3::ZERO);
        let turned = all && corners.iter().all(|corner| corner.normal.dot(normal) < 0.0);
        if turned {
            self.warn("all vertex normals of a face point behind it: turned over to agree with them");
        }
        let smooth = all && corners.iter().any(|c| !c.normal.abs_diff_eq(corners[0].normal, SAME_NORMAL));
        let front = self.direction(if turned { -normal } else { normal });
        let normals = if smooth { self.shading_normals(corners, front) } else { Vec::new() };
        // A mirror turns the order of the corners round, but not the side that the normal points to.
        let turn = turned != is_mirrored(&self.matrix);
        for piece in pieces {
            let piece = if turn { piece.turned() } else { piece };
            let shape = match piece {
                Piece::Triangle(k) => Shape::Triangle(k.map(|k| self.point(points[k]))),
                Piece::Quad(k) => Shape::Quad(k.map(|k| self.point(points[k]))),
            };
            let shading_normals = smooth.then(|| {
                let k = piece.corners();
                [k[0], k[1], k[2], k[k.len() - 1]].map(|k| normals[k])
            });
            self.surfaces.push(Surface { shading_normals, ..Surface::new(shape, self.material) });
        }
    }

    /// Vertex normals in the scene, on the front side.
    fn shading_normals(&mut self, corners: &[Vertex], front: DVec3) -> Vec<Vec3> {
        let normals: Vec<_> = corners.iter().map(|corner| self.direction(corner.normal)).collect();
        if normals.iter().any(|n| n.dot(front) <= 0.0) {
            self.warn("some vertex normals of a face point behind it: the face's own taken there");
        }
        normals.iter().map(|&n| (if n.dot(front) > 0.0 { n } else { front }).as_vec3()).collect()
    }

    pub(super) fn sphere(&mut self, center: Vertex, radius: f64) {
        if radius == 0.0 {
            return self.warn("sphere with a radius of 0: left out");
        }
        let shape = Shape::Sphere { center: self.point(center.point), radius: radius.abs() * scale(&self.matrix) };
        self.push(shape, radius < 0.0);
    }

    pub(super) fn cone(&mut self, ends: [Vertex; 2], radii: [f64; 2]) -> Result<(), Fault> {
        if radii[0].signum() != radii[1].signum() && !radii.contains(&0.0) {
            return fault(
                format!("a cone whose radii {} and {} have opposite signs", radii[0], radii[1]),
                "make both positive (facing outward) or both negative (facing inward)",
            );
        }
        if radii == [0.0; 2] || ends[0].point == ends[1].point {
            self.warn("cone or cylinder without length or radius: left out");
            return Ok(());
        }
        let size = scale(&self.matrix);
        let shape =
            Shape::Cone { ends: ends.map(|end| self.point(end.point)), radii: radii.map(|radius| radius.abs() * size) };
        self.push(shape, radii[0] < 0.0 || radii[1] < 0.0);
        Ok(())
    }

    pub(super) fn ring(&mut self, center: Vertex, inner: f64, outer: f64) -> Result<(), Fault> {
        if inner < 0.0 || outer < inner {
            return fault(
                format!("a ring from radius {inner} to {outer}"),
                "the inner radius comes first and is 0 or more, the outer one is larger",
            );
        }
        if inner == outer {
            self.warn("ring with equal radii: left out");
            return Ok(());
        }
        let size = scale(&self.matrix);
        let shape = Shape::Ring {
            center: self.point(center.point),
            normal: self.direction(center.normal),
            inner: inner * size,
            outer: outer * size,
        };
        self.push(shape, false);
        Ok(())
    }

    pub(super) fn torus(&mut self, center: Vertex, inner: f64, outer: f64) -> Result<(), Fault> {
        // Both radii are negative where the torus faces inward.
        let inward = inner < 0.0 || outer < 0.0;
        if inner * outer < 0.0 || outer.abs() < inner.abs() {
            return fault(
                format!("a torus from radius {inner} to {outer}"),
                "the inner radius comes first, the outer one has the same sign and is larger in size",
            );
        }
        let (inner, outer) = (inner.abs(), outer.abs());
        if inner == outer {
            self.warn("torus with equal radii: left out");
            return Ok(());
        }
        let size = scale(&self.matrix);
        let major = 0.5 * (inner + outer) * size;
        let shape = Shape::Torus {
            center: self.point(center.point),
            axis: self.direction(center.normal),
            major,
            minor: (0.5 * (outer - inner) * size).min(major * THICKEST_TUBE),
        };
        self.push(shape, inward);
        Ok(())
    }

    /// A polygon and its copy at a distance `length` behind it (negative: before it), with sides between them.
    pub(super) fn prism(&mut self, corners: &[Vertex], length: f64) {
        let points: Vec<_> = corners.iter().map(|corner| corner.point).collect();
        let normal = match polygon::normal(&points) {
            Ok(normal) => normal,
            Err(error) => return self.warn(&format!("prism with {error}: left out")),
        };
        if length == 0.0 {
            return self.warn("prism with a length of 0: left out");
        }
        let moved = |corner: Vertex| Vertex { point: corner.point - normal * length, ..corner };
        for (k, &here) in corners.iter().enumerate() {
            let before = corners[(k + corners.len() - 1) % corners.len()];
            if here.point != before.point {
                self.face(&[moved(here), here, before, moved(before)], &[]);
            }
        }
        // Vertex normals are those of the sides.
        let flat = |corner: Vertex| Vertex { normal: DVec3::ZERO, ..corner };
        let cap: Vec<_> = corners.iter().copied().map(flat).collect();
        self.face(&cap, &[]);
        let cap: Vec<_> = corners.iter().rev().copied().map(moved).map(flat).collect();
        self.face(&cap, &[]);
    }
}

/// A vector at unit length, whatever its size; zero where it has none.
pub(super) fn unit(v: DVec3) -> DVec3 {
    (v / v.abs().max_element()).normalize_or_zero()
}

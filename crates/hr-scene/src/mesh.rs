//! From triangles and polygons of a scene file to surfaces: pairs of triangles merged to parallelograms, instances
//! placed, degenerate faces dropped, attributes kept.

use crate::warnings::Warnings;
use crate::{Scene, SurfaceAttributes};
use glam::{DMat3, DMat4, DVec3, Vec2, Vec3};
use glossy_ext::Rgb;
use hr_diffuse::{Shape, Surface};
use std::collections::HashMap;

/// Most surfaces of one scene: instances multiply a small file to any size, and this still fits into some GiB.
pub(crate) const MAX_SURFACES: usize = 1 << 24;

/// How far the fourth corner of a parallelogram may lie from where the others put it, relative to its size: what
/// single precision and printed decimals leave of an exact one.
const PARALLELOGRAM_TOLERANCE: f64 = 1e-5;

/// The same for texture coordinates, colours and shading normals, absolute: 1/8 of the last place of 8-bit ones.
const ATTRIBUTE_TOLERANCE: f32 = 5e-4;

/// A face whose cross product of diagonals is below this, relative to their squared length, has no area.
const DEGENERATE: f64 = 1e-10;

/// Shading normals within this of the geometric normal (1 − cosine: 0.26°) shade like a flat face.
const FLAT: f32 = 1e-5;

/// Vertices in the space of the mesh; what is not there is an empty list.
#[derive(Debug, Default)]
pub(crate) struct Vertices {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) uv: Vec<Vec2>,
    pub(crate) colors: Vec<Rgb>,
}

/// A triangle (`corners[3] == corners[2]`) or a planar convex quadrilateral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Face {
    pub(crate) corners: [u32; 4],
}

impl Face {
    pub(crate) fn triangle([a, b, c]: [u32; 3]) -> Self {
        Self { corners: [a, b, c, c] }
    }

    fn is_triangle(self) -> bool {
        self.corners[2] == self.corners[3]
    }

    /// The same seen from the other side.
    fn turned(self) -> Self {
        let [a, b, c, d] = self.corners;
        if self.is_triangle() { Self { corners: [a, c, b, b] } } else { Self { corners: [a, d, c, b] } }
    }
}

impl Vertices {
    /// Whether two vertices look alike in all but their position.
    fn alike(&self, a: u32, b: u32) -> bool {
        self.affine([a, b, a, b])
    }

    /// Whether the attributes at the corners of a parallelogram are those of an affine map.
    fn affine(&self, corners: [u32; 4]) -> bool {
        let [a, b, c, d] = corners.map(|i| i as usize);
        let normals = self.normals.get(a).is_none_or(|_| {
            let n = &self.normals;
            (n[a] + n[c] - n[b] - n[d]).abs().max_element() <= ATTRIBUTE_TOLERANCE
        });
        let uv = self.uv.get(a).is_none_or(|_| {
            let t = &self.uv;
            let size = 1.0 + t[a].abs().max_element();
            (t[a] + t[c] - t[b] - t[d]).abs().max_element() <= 1e-5 * size
        });
        let colors = self.colors.get(a).is_none_or(|_| {
            let k = &self.colors;
            (k[a] + k[c] - k[b] - k[d]).abs().max_element() <= ATTRIBUTE_TOLERANCE
        });
        normals && uv && colors
    }
}

/// Merges pairs of triangles that share an edge and make a parallelogram, attributes included: fewer and better
/// elements. Rectangles first, and neighbours in the list first, since exporters write them so; each triangle is
/// looked at a fixed number of times.
pub(crate) fn merge(vertices: &Vertices, triangles: &[[u32; 3]]) -> Vec<Face> {
    let mut ids = HashMap::new();
    let welded: Vec<u32> = (vertices.positions.iter())
        .map(|p| {
            // Adding 0 makes −0 and 0 one point.
            let key = (*p + DVec3::ZERO).to_array().map(f64::to_bits);
            let next = ids.len() as u32;
            *ids.entry(key).or_insert(next)
        })
        .collect();
    let edge = |t: &[u32; 3], e: usize| (welded[t[e] as usize], welded[t[(e + 1) % 3] as usize]);
    let mut owner = HashMap::new();
    for (i, t) in triangles.iter().enumerate() {
        for e in 0..3 {
            owner.insert(edge(t, e), (i, e));
        }
    }
    // The parallelogram that triangle i makes with its neighbour across its edge e.
    let partner = |i: usize, e: usize| {
        let (from, to) = edge(&triangles[i], e);
        owner.get(&(to, from)).copied().filter(|&(j, _)| j != i)
    };
    let mut quad_of: Vec<Option<(usize, [u32; 4])>> = vec![None; triangles.len()];
    let mut used = vec![false; triangles.len()];
    for skew in [0.01, 1.0] {
        for only_next in [true, false] {
            for i in 0..triangles.len() {
                for e in 0..3 {
                    if used[i] {
                        break;
                    }
                    let Some((j, f)) = partner(i, e) else {
                        continue;
                    };
                    if used[j] || (only_next && j != i + 1) {
                        continue;
                    }
                    if let Some(quad) = parallelogram(vertices, &triangles[i], e, &triangles[j], f, skew) {
                        (used[i], used[j]) = (true, true);
                        quad_of[i.min(j)] = Some((i.max(j), quad));
                    }
                }
            }
        }
    }
    let mut faces = Vec::with_capacity(triangles.len());
    for i in 0..triangles.len() {
        match quad_of[i] {
            Some((_, corners)) => faces.push(Face { corners }),
            None if !used[i] => faces.push(Face::triangle(triangles[i])),
            None => {}
        }
    }
    faces
}

/// The parallelogram made of triangle `s` and triangle `t` that share the edges `e` and `f`, if it is one; `skew` is
/// the largest |cosine| of its angles.
fn parallelogram(v: &Vertices, s: &[u32; 3], e: usize, t: &[u32; 3], f: usize, skew: f64) -> Option<[u32; 4]> {
    let (b, d, a) = (s[e], s[(e + 1) % 3], s[(e + 2) % 3]);
    let (d2, b2, c) = (t[f], t[(f + 1) % 3], t[(f + 2) % 3]);
    let corners = [a, b, c, d];
    let [pa, pb, pc, pd] = corners.map(|i| v.positions[i as usize]);
    let (u, w) = (pb - pa, pd - pa);
    let size = u.length() + w.length();
    // Single precision positions are rounded in proportion to their distance from 0.
    let rounding = 2.0 * f64::from(f32::EPSILON) * pa.abs().max(pc.abs()).max_element();
    let fits = (pa + pc - pb - pd).length() <= PARALLELOGRAM_TOLERANCE * size + rounding
        && u.dot(w).abs() <= skew * u.length() * w.length()
        && u.cross(w).length() > DEGENERATE.sqrt() * size * size;
    (fits && v.alike(b, b2) && v.alike(d, d2) && v.affine(corners)).then_some(corners)
}

/// Faces of one material in the space of their mesh, ready to be placed.
pub(crate) struct Part {
    pub(crate) vertices: Vertices,
    pub(crate) faces: Vec<Face>,
    pub(crate) material: u32,
    /// Whether texture coordinates and vertex colours are kept.
    pub(crate) attributes: bool,
    /// Where it stands in the file, for warnings.
    pub(crate) whence: String,
}

/// Adds an instance of a part to the scene.
pub(crate) fn place(scene: &mut Scene, warnings: &mut Warnings, part: &Part, transform: &DMat4) {
    let Part { vertices, faces, material, attributes, whence } = part;
    let m = DMat3::from_mat4(*transform);
    // The cofactor matrix is the inverse transpose times the determinant, and is there for flat scalings too.
    let cofactor = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    let mirrored = m.determinant() < 0.0;
    let side = if mirrored { -1.0 } else { 1.0 };
    for face in faces {
        let face = if mirrored { face.turned() } else { *face };
        let index = face.corners.map(|i| i as usize);
        let p = index.map(|i| transform.transform_point3(vertices.positions[i]));
        let (diagonal, other) =
            if face.is_triangle() { (p[1] - p[0], p[2] - p[0]) } else { (p[2] - p[0], p[3] - p[1]) };
        let normal = diagonal.cross(other);
        let area = normal.length();
        if !area.is_finite() {
            warnings.add("face left out: a corner is not a finite number", || whence.clone());
            continue;
        }
        if area <= DEGENERATE * diagonal.length_squared().max(other.length_squared()) || area < f64::MIN_POSITIVE {
            warnings.add("face left out: it has no area", || whence.clone());
            continue;
        }
        let geometric = (normal / area).as_vec3();
        let mut shape_normals = None;
        if !vertices.normals.is_empty() {
            let mut bad = false;
            let normals = index.map(|i| {
                let n = (cofactor * vertices.normals[i].as_dvec3() * side).normalize_or_zero().as_vec3();
                if n.is_finite() && n.dot(geometric) > 0.0 {
                    n
                } else {
                    bad = true;
                    geometric
                }
            });
            if bad {
                warnings
                    .add("shading normal replaced by the face's: it is zero or points to the back", || whence.clone());
            }
            if normals.iter().any(|n| n.dot(geometric) < 1.0 - FLAT) {
                shape_normals = Some(normals);
            }
        }
        if *attributes {
            scene.attributes.push(SurfaceAttributes {
                surface: scene.surfaces.len() as u32,
                uv: index.map(|i| vertices.uv.get(i).copied().unwrap_or(Vec2::ZERO)),
                color: index.map(|i| vertices.colors.get(i).copied().unwrap_or(Rgb::ONE)),
            });
        }
        let shape = if face.is_triangle() { Shape::Triangle([p[0], p[1], p[2]]) } else { Shape::Quad(p) };
        scene.surfaces.push(Surface { shape, flip: false, material: *material, shading_normals: shape_normals });
    }
}

/// Mean over all surfaces of a material of their base colour, weighted by area, for the materials whose surfaces have
/// attributes.
pub(crate) fn mean_base_colors(scene: &Scene) -> Vec<Option<Rgb>> {
    let mut sums = vec![(Rgb::ZERO.as_dvec3(), 0.0); scene.materials.len()];
    for attributes in &scene.attributes {
        let Some(surface) = scene.surfaces.get(attributes.surface as usize) else {
            continue;
        };
        let (area, corners): (f64, &[Vec2]) = match &surface.shape {
            Shape::Triangle([a, b, c]) => (0.5 * (*b - *a).cross(*c - *a).length(), &[Vec2::ZERO, Vec2::X, Vec2::Y]),
            Shape::Quad([a, b, c, d]) => {
                (0.5 * (*c - *a).cross(*d - *b).length(), &[Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y])
            }
            _ => continue,
        };
        if let Some(color) = scene.mean_base_color(attributes.surface, corners)
            && let Some((sum, weight)) = sums.get_mut(surface.material as usize)
        {
            *sum += color.as_dvec3() * area;
            *weight += area;
        }
    }
    sums.into_iter().map(|(sum, area)| (area > 0.0).then(|| (sum / area).as_vec3())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(positions: &[[f64; 3]]) -> Vertices {
        Vertices { positions: positions.iter().map(|p| DVec3::from(*p)).collect(), ..Vertices::default() }
    }

    fn grid(n: u32) -> (Vertices, Vec<[u32; 3]>) {
        let mut vertices = Vertices::default();
        for j in 0..=n {
            for i in 0..=n {
                vertices.positions.push(DVec3::new(f64::from(i), f64::from(j), 0.0));
            }
        }
        let at = |i, j| j * (n + 1) + i;
        let cells = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
        let triangles = cells.flat_map(|(i, j)| {
            [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
        });
        let triangles = triangles.collect();
        (vertices, triangles)
    }

    fn area(v: &Vertices, f: &Face) -> f64 {
        let p = f.corners.map(|i| v.positions[i as usize]);
        if f.is_triangle() {
            0.5 * (p[1] - p[0]).cross(p[2] - p[0]).z
        } else {
            0.5 * (p[2] - p[0]).cross(p[3] - p[1]).z
        }
    }

    #[test]
    fn a_grid_becomes_its_squares() {
        let (v, t) = grid(7);
        let faces = merge(&v, &t);
        assert_eq!(faces.len(), 49, "one quadrilateral per cell");
        for f in &faces {
            assert!(!f.is_triangle(), "every cell merges");
            assert!((area(&v, f) - 1.0).abs() < 1e-12, "unit squares, counter-clockwise, not skewed pairs");
        }
    }

    #[test]
    fn scattered_triangles_find_their_partner() {
        let (v, t) = grid(8);
        // 2·64 triangles, taken in steps of 37: partners are far apart in the list.
        let shuffled: Vec<_> = (0..t.len()).map(|k| t[k * 37 % t.len()]).collect();
        let faces = merge(&v, &shuffled);
        let total: f64 = faces.iter().map(|f| area(&v, f)).sum();
        assert_eq!(faces.len(), 64, "all cells merge");
        assert!((total - 64.0).abs() < 1e-9, "nothing is lost or doubled");
    }

    #[test]
    fn what_is_no_parallelogram_stays() {
        let mut v = at(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.1, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(merge(&v, &[[0, 1, 2], [0, 2, 3]]).len(), 2, "a trapezoid is two triangles");
        v.positions[2] = DVec3::new(1.0, 1.0, 0.1);
        assert_eq!(merge(&v, &[[0, 1, 2], [0, 2, 3]]).len(), 2, "a bent quadrilateral is two triangles");
        v.positions[2] = DVec3::new(1.0, 1.0, 0.0);
        assert_eq!(merge(&v, &[[0, 1, 2], [0, 2, 3]]).len(), 1, "a square is one");
        assert_eq!(merge(&v, &[[0, 1, 2], [0, 3, 2]]).len(), 2, "two that face opposite ways are two");
        v.uv = vec![Vec2::ZERO, Vec2::X, Vec2::new(1.0, 0.9), Vec2::Y];
        assert_eq!(merge(&v, &[[0, 1, 2], [0, 2, 3]]).len(), 2, "texture coordinates must be affine");
        v.uv[2] = Vec2::ONE;
        assert_eq!(merge(&v, &[[0, 1, 2], [0, 2, 3]]).len(), 1, "and are here");
    }

    #[test]
    fn zero_and_minus_zero_weld() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        let others = [[-0.0, 0.0, -0.0], [1.0, 1.0, -0.0], [0.0, 1.0, 0.0]];
        let v = at(&[corners, others].concat());
        assert_eq!(merge(&v, &[[0, 1, 2], [3, 4, 5]]).len(), 1, "signs of zero do not part an edge");
    }
}

//! The triangles of a distribution while it is being made: explicit neighbours, full-precision values.
//!
//! The mesh is balanced at every moment: a triangle is only subdivided once its three edge neighbours of its own
//! level exist, so what is coarser beside it is subdivided first. Neighbours are found by following indices; there
//! is no search and no hashing.

use super::Haar;
use super::nodes::{Fields, Layout, Node};
use crate::Rgb;
use crate::basis::half::{encode, scale_for};
use crate::basis::triangle::{EDGE_ENDS, Triangle, child_corners, midpoints};
use glam::Vec3;

/// No vertex at this midpoint.
pub(super) const NO_VERTEX: u16 = Node::NO_VERTEX;

/// No triangle of the same level across this edge.
const NO_TRIANGLE: u32 = u32::MAX;

/// Vertices a mesh may have, so that vertices and nodes can be indexed by 15 bits when packed.
///
/// With v vertices beside the first six, h of them on the edge of an undivided triangle, there are (2v − h)/3 divided
/// triangles, for each has three midpoints and all but h are shared by two; at most h undivided ones need a node to
/// hold a midpoint. Nodes ≤ (2v − h)/3 + h ≤ 4v/3, which is below 2¹⁵.
pub(super) const MAX_VERTICES: usize = 24_576;

/// One triangle, divided or not.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tri {
    /// Vertices at the corners.
    pub(super) corners: [u16; 3],
    /// Vertices at the midpoints of the edges opposite each corner: all three where the triangle is divided; where
    /// it is not, those that a divided neighbour has put there.
    pub(super) mids: [u16; 3],
    /// The triangles of the same level across each edge.
    neighbours: [u32; 3],
    /// The triangle that this is a part of (itself for a face of the octahedron).
    pub(super) parent: u32,
    /// First of four children, 0 if undivided.
    pub(super) children: u32,
    /// Which child of the parent this is.
    pub(super) place: u8,
    /// Subdivisions above this one.
    pub(super) level: u8,
}

impl Tri {
    pub(super) fn is_divided(&self) -> bool {
        self.children != 0
    }

    fn has_node(&self) -> bool {
        self.is_divided() || self.mids != [NO_VERTEX; 3]
    }
}

/// A midpoint that is about to become a vertex.
pub(super) struct Midpoint {
    /// The triangle that is being divided.
    pub(super) tri: u32,
    /// Which of its edges.
    pub(super) edge: usize,
    /// Where, on the octahedron.
    pub(super) position: Vec3,
    /// The mean of the values at the edge's ends.
    pub(super) between: Rgb,
}

/// Triangles, vertices and their values.
#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    pub(super) tris: Vec<Tri>,
    /// On the octahedron, |x| + |y| + |z| = 1; exact.
    pub(super) positions: Vec<Vec3>,
    pub(super) values: Vec<Rgb>,
}

impl Mesh {
    /// The eight faces of the octahedron, values by position.
    pub(super) fn new(mut value: impl FnMut(Vec3) -> Rgb) -> Self {
        let positions = vec![Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z];
        let values = positions.iter().map(|&p| value(p)).collect();
        let tris = (0..8_u8)
            .map(|face| Tri {
                corners: Haar::face_vertices(usize::from(face)),
                mids: [NO_VERTEX; 3],
                // Crossing the edge opposite the corner on an axis changes the sign of that axis.
                neighbours: [0, 1, 2].map(|axis| u32::from(face ^ (1 << axis))),
                parent: u32::from(face),
                children: 0,
                place: 0,
                level: 0,
            })
            .collect();
        Self { tris, positions, values }
    }

    pub(super) fn triangle(&self, tri: u32) -> Triangle {
        Triangle::new(self.tris[tri as usize].corners.map(|v| self.positions[usize::from(v)]))
    }

    pub(super) fn corner_values(&self, tri: &Tri) -> [Rgb; 3] {
        let [a, b, c] = tri.corners;
        let at = |v: u16| self.values[usize::from(v)];
        [at(a), at(b), at(c)]
    }

    /// Values at the midpoints of the edges, linear where there is no vertex.
    pub(super) fn mid_values(&self, tri: &Tri) -> [Rgb; 3] {
        let corners = self.corner_values(tri);
        let mut mids = midpoints(corners);
        for (value, &vertex) in std::iter::zip(&mut mids, &tri.mids) {
            if vertex != NO_VERTEX {
                *value = self.values[usize::from(vertex)];
            }
        }
        mids
    }

    /// Divides a triangle in four, coarser neighbours first. New vertices take the value that `value` gives them.
    /// False, and the triangle is left as it is, if the mesh is full; a neighbour may have been divided.
    pub(super) fn divide(&mut self, tri: u32, value: &mut impl FnMut(&Midpoint) -> Rgb) -> bool {
        if self.tris[tri as usize].is_divided() {
            return true;
        }
        for edge in 0..3 {
            let here = self.tris[tri as usize];
            if here.neighbours[edge] == NO_TRIANGLE {
                // Only a child's edge on the parent's edge of the same number can lack a neighbour, and the parent
                // has one there: it was divided.
                let coarse = self.tris[here.parent as usize].neighbours[edge];
                if !self.divide(coarse, value) {
                    return false;
                }
            }
        }
        if self.positions.len() + 3 > MAX_VERTICES {
            return false;
        }
        let Tri { corners, neighbours, level, .. } = self.tris[tri as usize];
        for edge in 0..3 {
            if self.tris[tri as usize].mids[edge] == NO_VERTEX {
                let [a, b] = EDGE_ENDS[edge].map(|i| usize::from(corners[i]));
                let position = 0.5 * (self.positions[a] + self.positions[b]);
                let between = 0.5 * self.values[a] + 0.5 * self.values[b];
                let vertex = self.positions.len() as u16;
                self.values.push(value(&Midpoint { tri, edge, position, between }));
                self.positions.push(position);
                self.tris[tri as usize].mids[edge] = vertex;
                let across = &mut self.tris[neighbours[edge] as usize];
                let opposite = across.corner_off(corners[EDGE_ENDS[edge][0]], corners[EDGE_ENDS[edge][1]]);
                across.mids[opposite] = vertex;
            }
        }
        let mids = self.tris[tri as usize].mids;
        let first = self.tris.len() as u32;
        self.tris[tri as usize].children = first;
        for place in 0..4 {
            let neighbours = if place == 3 {
                [first, first + 1, first + 2]
            } else {
                let mut inner = [NO_TRIANGLE; 3];
                inner[place] = first + 3;
                inner
            };
            self.tris.push(Tri {
                corners: child_corners(corners, mids, place),
                mids: [NO_VERTEX; 3],
                neighbours,
                parent: tri,
                children: 0,
                place: place as u8,
                level: level + 1,
            });
        }
        for edge in 0..3 {
            let across = self.tris[neighbours[edge] as usize];
            if across.is_divided() {
                let [a, b] = EDGE_ENDS[edge];
                let their_edge = across.corner_off(corners[a], corners[b]);
                for corner in [a, b] {
                    let ours = first + corner as u32;
                    let theirs = across.children + across.corner_at(corners[corner]) as u32;
                    self.tris[ours as usize].neighbours[edge] = theirs;
                    self.tris[theirs as usize].neighbours[their_edge] = ours;
                }
            }
        }
        true
    }

    /// Moves vertex values so that leaves keep the mean value that is known of them, where `means` gives one: what
    /// the linear interpolation lacks is shared among its vertices in proportion to their share of its integral. No
    /// value leaves the range `low`…`high` of what is known around its vertex, so that nothing becomes negative that
    /// was not. `fixed` vertices stay.
    pub(super) fn preserve_means(&mut self, means: &[Option<Rgb>], fixed: impl Fn(Vec3) -> bool) {
        let n = self.values.len();
        let mut excess = vec![Rgb::ZERO; n];
        let mut mass = vec![0.0_f32; n];
        let mut low = self.values.clone();
        let mut high = self.values.clone();
        for (t, tri) in self.tris.iter().enumerate().filter(|(_, tri)| !tri.is_divided()) {
            let solid_angle = self.triangle(t as u32).rough_solid_angle();
            let lack = means[t].map_or(Rgb::ZERO, |mean| mean - self.mean(tri));
            let mut share = |vertex: u16, part: f32| {
                let v = usize::from(vertex);
                mass[v] += solid_angle * part;
                excess[v] += solid_angle * part * lack;
                if let Some(mean) = means[t] {
                    low[v] = low[v].min(mean);
                    high[v] = high[v].max(mean);
                }
            };
            // Of the 12 corners of the four children, one is at each corner and three at each midpoint.
            for (corner, &vertex) in tri.corners.iter().enumerate() {
                let missing = (0..3).filter(|&e| e != corner && tri.mids[e] == NO_VERTEX).count();
                share(vertex, (1.0 + 1.5 * missing as f32) / 12.0);
            }
            for &vertex in tri.mids.iter().filter(|&&v| v != NO_VERTEX) {
                share(vertex, 3.0 / 12.0);
            }
        }
        for v in 0..n {
            if mass[v] > 0.0 && !fixed(self.positions[v]) {
                self.values[v] = (self.values[v] + excess[v] / mass[v]).clamp(low[v], high[v]);
            }
        }
    }

    /// Mean of the interpolation over an undivided triangle (with respect to area on the octahedron).
    pub(super) fn mean(&self, tri: &Tri) -> Rgb {
        let [a, b, c] = self.corner_values(tri);
        let [d, e, f] = self.mid_values(tri);
        (a + b + c + 3.0 * (d + e + f)) / 12.0
    }

    /// Packs the mesh. Values that are not finite become 0; a mesh of zeros becomes the empty distribution.
    pub(super) fn pack(&self) -> Haar {
        let finite = |v: Rgb| if v.is_finite() { v } else { Rgb::ZERO };
        let largest = self.values.iter().map(|&v| finite(v).abs().max_element()).fold(0.0, f32::max);
        let scale = scale_for(largest);
        if scale == 0.0 {
            return Haar::default();
        }
        let with_node = |tris: std::ops::Range<u32>| tris.filter(|&t| self.tris[t as usize].has_node());
        let mut order: Vec<u32> = with_node(0..8).collect();
        let roots = order.iter().fold(0_u8, |mask, &face| mask | 1 << face);
        let mut nodes = Vec::with_capacity(self.tris.len() / 4);
        let mut next = 0;
        while next < order.len() {
            let tri = &self.tris[order[next] as usize];
            let base = order.len();
            let mut mask = 0_u8;
            if tri.is_divided() {
                order.extend(with_node(tri.children..tri.children + 4));
                mask = order[base..].iter().fold(0, |mask, &t| mask | 1 << (t - tri.children));
            }
            nodes.push(Fields { mask, mids: tri.mids, base: if mask == 0 { 0 } else { base } });
            next += 1;
        }
        let vertices = self.values.iter().map(|&v| encode(finite(v), scale)).collect();
        let layout = Layout::new(self.values.len(), nodes.len());
        Haar { scale, roots, vertices, layout, nodes: layout.pack(&nodes) }
    }
}

impl Tri {
    /// The corner that is neither of two.
    fn corner_off(&self, a: u16, b: u16) -> usize {
        self.corners.iter().position(|&c| c != a && c != b).unwrap_or(0)
    }

    /// The corner at a vertex.
    fn corner_at(&self, vertex: u16) -> usize {
        self.corners.iter().position(|&c| c == vertex).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::face_corners;
    use super::*;

    #[test]
    fn faces_use_the_vertices_on_their_axes() {
        let mesh = Mesh::new(|p| p);
        for face in 0..8 {
            assert_eq!(mesh.triangle(face).corners, face_corners(face as usize), "face {face}");
        }
    }
}

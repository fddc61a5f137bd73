//! A distribution taken apart, for files and for other programs that show it.

use super::Haar;
use super::nodes::Node;
use crate::Rgb;
use crate::basis::triangle::{EDGE_ENDS, child_corners};

/// All that a distribution consists of, in an order in which it can be put together again without any index: triangles
/// level by level, vertices as they are met.
///
/// The faces of the octahedron are numbered by the signs of their points (bit 0: x < 0, bit 1: y < 0, bit 2: z < 0); the
/// corners of each lie on the x, y and z axis in this order. A divided triangle with the corners 0, 1, 2 and the
/// midpoints 3, 4, 5 of the edges opposite to them has the children (0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5). Midpoints
/// lie on the octahedron, halfway on the flat. A midpoint that two triangles share is one vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Bit f: face f is divided.
    pub faces: u8,
    /// Of each divided triangle (faces first, by number, then those of the next level in the order of their parents):
    /// bit c, child c is divided.
    pub children: Vec<u8>,
    /// Values of the corners of the octahedron (+x, −x, +y, −y, +z, −z), then of the midpoints of the divided triangles, in
    /// their order, as they are met for the first time. None for the empty distribution.
    pub values: Vec<Rgb>,
    /// Of each value from the seventh on: the vertices at the ends of the edge that it is in the middle of, as indices
    /// of `values`.
    pub ends: Vec<[u16; 2]>,
}

impl Haar {
    /// Takes the distribution apart.
    #[must_use]
    pub fn outline(&self) -> Outline {
        const UNMET: u16 = u16::MAX;
        let mut outline = Outline::default();
        if self.is_empty() {
            return outline;
        }
        let value = |vertex: u16| self.vertex(vertex) * self.scale;
        let mut met = vec![UNMET; self.vertices.len()];
        for corner in 0..6 {
            met[usize::from(corner)] = corner;
            outline.values.push(value(corner));
        }
        let divided = |node: Option<usize>| node.map(|n| self.node(n)).filter(|n| n.is_divided());
        let mut triangles: Vec<(Node, [u16; 3])> = Vec::new();
        for face in 0..8 {
            if let Some(node) = divided(self.root(face)) {
                outline.faces |= 1 << face;
                triangles.push((node, Self::face_vertices(face)));
            }
        }
        let mut next = 0;
        while let Some(&(node, corners)) = triangles.get(next) {
            next += 1;
            let mids = node.mids();
            for (mid, ends) in std::iter::zip(mids, EDGE_ENDS) {
                let place = &mut met[usize::from(mid)];
                if *place == UNMET {
                    *place = outline.values.len() as u16;
                    outline.values.push(value(mid));
                    outline.ends.push(ends.map(|end| met[usize::from(corners[end])]));
                }
            }
            let mut mask = 0;
            for child in 0..4 {
                if let Some(below) = divided(node.child(child)) {
                    mask |= 1 << child;
                    triangles.push((below, child_corners(corners, mids, child)));
                }
            }
            outline.children.push(mask);
        }
        outline
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Known, Peak, Refinement};
    use super::*;
    use glam::Vec3;

    #[test]
    fn every_vertex_is_where_its_edge_says() {
        let axis = Vec3::new(0.3, -0.2, 0.9).normalize();
        let lobe = |d: Vec3| Vec3::new(1.0, 0.5, 0.1) * d.dot(axis).max(0.0).powi(150) + 0.01 * d.x.abs();
        let peaks = [Peak { direction: axis, width: 0.1 }];
        let haar = Haar::project(&Refinement::default(), &Known { peaks: &peaks, ..Known::NOTHING }, lobe).distribution;
        let Outline { faces, children, values, ends } = haar.outline();
        assert_eq!(values.len(), haar.vertices.len(), "every vertex once");
        assert_eq!(values.len(), ends.len() + 6, "an edge for every midpoint");
        let divided = faces.count_ones() as usize + children.iter().map(|c| c.count_ones() as usize).sum::<usize>();
        assert_eq!(children.len(), divided, "a mask for every divided triangle");
        assert_eq!(haar.basis_functions(), 8 + 3 * divided, "division takes one triangle and gives four");
        let mut positions = vec![Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z];
        for [a, b] in ends {
            positions.push(0.5 * (positions[usize::from(a)] + positions[usize::from(b)]));
        }
        for (position, value) in std::iter::zip(positions, values) {
            // At a vertex, interpolation is rounding.
            let off = (haar.eval(position) - value).abs().max_element();
            assert!(off < 1e-6, "{position}: {value} is off by {off}");
        }
        assert_eq!(Haar::default().outline(), Outline::default(), "nothing has no parts");
    }
}

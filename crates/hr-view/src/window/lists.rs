//! The paper's two lists: triangles that never change, and triangles with a vertex whose radiance follows the eye; and a
//! third one: triangles whose radiance toward the eye is computed at each pixel.

use crate::display::{Batch, DisplayMesh};
use std::collections::HashMap;

/// Some of a mesh's triangles with their own, compact vertices.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct VertexList {
    /// The mesh's vertex behind each of the list's.
    pub(crate) vertices: Vec<u32>,
    /// In the third list for each vertex the leaf that its triangles are of; else empty.
    pub(crate) leaves: Vec<u32>,
    /// Triangles, as positions in `vertices`.
    pub(crate) indices: Vec<u32>,
    /// The triangles by texture; no batch is empty.
    pub(crate) batches: Vec<Batch>,
}

/// Splits a mesh, but for the triangles `taken` (in ascending order), into its diffuse and its glossy list.
pub(crate) fn split(mesh: &DisplayMesh, taken: &[u32]) -> [VertexList; 2] {
    let mut is_glossy = vec![false; mesh.positions.len()];
    for &vertex in &mesh.glossy {
        is_glossy[vertex as usize] = true;
    }
    [false, true].map(|wanted| {
        let mut list = VertexList::default();
        let mut place = vec![u32::MAX; mesh.positions.len()];
        let mut taken = taken.iter().copied().peekable();
        for batch in &mesh.batches {
            let start = count(list.indices.len());
            for triangle in batch.indices.start / 3..batch.indices.end / 3 {
                while taken.next_if(|&taken| taken < triangle).is_some() {}
                let corners = corners(mesh, triangle);
                if taken.peek() == Some(&triangle) || corners.iter().any(|&c| is_glossy[c as usize]) != wanted {
                    continue;
                }
                for corner in corners {
                    let place = &mut place[corner as usize];
                    if *place == u32::MAX {
                        *place = count(list.vertices.len());
                        list.vertices.push(corner);
                    }
                    list.indices.push(*place);
                }
            }
            list.end_batch(start, batch.texture);
        }
        list
    })
}

/// The list of some triangles, in ascending order, with their leaves. Triangles of different leaves share no vertex.
pub(crate) fn lit(mesh: &DisplayMesh, triangles: &[(u32, u32)]) -> VertexList {
    let mut list = VertexList::default();
    let mut place = HashMap::new();
    let mut next = triangles.iter().copied().peekable();
    for batch in &mesh.batches {
        let start = count(list.indices.len());
        while let Some((triangle, leaf)) = next.next_if(|&(triangle, _)| triangle < batch.indices.end / 3) {
            for corner in corners(mesh, triangle) {
                let at = *place.entry((corner, leaf)).or_insert_with(|| {
                    list.vertices.push(corner);
                    list.leaves.push(leaf);
                    count(list.vertices.len() - 1)
                });
                list.indices.push(at);
            }
        }
        list.end_batch(start, batch.texture);
    }
    list
}

impl VertexList {
    /// The triangles since `start` have a texture.
    fn end_batch(&mut self, start: u32, texture: Option<u32>) {
        let indices = start..count(self.indices.len());
        if !indices.is_empty() {
            self.batches.push(Batch { indices, texture });
        }
    }
}

fn corners(mesh: &DisplayMesh, triangle: u32) -> [u32; 3] {
    let first = 3 * triangle as usize;
    [0, 1, 2].map(|i| mesh.indices[first + i])
}

/// A length as an index; lists are never longer than the mesh, whose own indices are `u32`.
fn count(length: usize) -> u32 {
    u32::try_from(length).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn triangles_go_to_one_list_each() {
        let mesh = DisplayMesh {
            positions: (0..5).map(|i| Vec3::splat(i as f32)).collect(),
            indices: vec![0, 1, 2, 2, 1, 3, 3, 4, 2],
            batches: vec![Batch { indices: 0..6, texture: None }, Batch { indices: 6..9, texture: Some(0) }],
            glossy: vec![4],
            ..DisplayMesh::default()
        };
        let [diffuse, glossy] = split(&mesh, &[]);
        assert_eq!(diffuse.vertices, [0, 1, 2, 3], "vertices of the triangles without vertex 4");
        assert_eq!(diffuse.batches, [Batch { indices: 0..6, texture: None }], "one batch keeps both");
        assert_eq!(glossy.vertices, [3, 4, 2], "the glossy triangle brings its other corners along");
        assert_eq!(glossy.indices, [0, 1, 2], "renumbered");
        assert_eq!(glossy.batches, [Batch { indices: 0..3, texture: Some(0) }], "and its texture");
    }

    #[test]
    fn leaves_share_no_vertex() {
        let mesh = DisplayMesh {
            positions: (0..5).map(|i| Vec3::splat(i as f32)).collect(),
            indices: vec![0, 1, 2, 2, 1, 3, 3, 4, 2],
            batches: vec![Batch { indices: 0..3, texture: None }, Batch { indices: 3..9, texture: Some(0) }],
            glossy: vec![1, 2, 3, 4],
            ..DisplayMesh::default()
        };
        let [diffuse, glossy] = split(&mesh, &[1, 2]);
        assert_eq!((diffuse.indices.len(), glossy.indices.len()), (0, 3), "what is taken is in neither");
        let lit = lit(&mesh, &[(1, 7), (2, 8)]);
        assert_eq!(lit.vertices, [2, 1, 3, 3, 4, 2], "corners");
        assert_eq!(lit.leaves, [7, 7, 7, 8, 8, 8], "their leaves");
        assert_eq!(lit.batches, [Batch { indices: 0..6, texture: Some(0) }], "and their texture");
    }
}

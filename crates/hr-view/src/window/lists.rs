//! The paper's two lists: triangles that never change, and triangles with a vertex whose radiance follows the eye.

use crate::display::{Batch, DisplayMesh};

/// Some of a mesh's triangles with their own, compact vertices.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct VertexList {
    /// The mesh's vertex behind each of the list's.
    pub(crate) vertices: Vec<u32>,
    /// Triangles, as positions in `vertices`.
    pub(crate) indices: Vec<u32>,
    /// The triangles by texture; no batch is empty.
    pub(crate) batches: Vec<Batch>,
}

/// Splits a mesh into its diffuse and its glossy list.
pub(crate) fn split(mesh: &DisplayMesh) -> [VertexList; 2] {
    let mut is_glossy = vec![false; mesh.positions.len()];
    for &vertex in &mesh.glossy {
        is_glossy[vertex as usize] = true;
    }
    [false, true].map(|wanted| {
        let mut list = VertexList::default();
        let mut place = vec![u32::MAX; mesh.positions.len()];
        for batch in &mesh.batches {
            let start = count(list.indices.len());
            let indices = &mesh.indices[batch.indices.start as usize..batch.indices.end as usize];
            for corners in indices.chunks_exact(3) {
                if corners.iter().any(|&c| is_glossy[c as usize]) != wanted {
                    continue;
                }
                for &corner in corners {
                    let place = &mut place[corner as usize];
                    if *place == u32::MAX {
                        *place = count(list.vertices.len());
                        list.vertices.push(corner);
                    }
                    list.indices.push(*place);
                }
            }
            let indices = start..count(list.indices.len());
            if !indices.is_empty() {
                list.batches.push(Batch { indices, texture: batch.texture });
            }
        }
        list
    })
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
        let [diffuse, glossy] = split(&mesh);
        assert_eq!(diffuse.vertices, [0, 1, 2, 3], "vertices of the triangles without vertex 4");
        assert_eq!(diffuse.batches, [Batch { indices: 0..6, texture: None }], "one batch keeps both");
        assert_eq!(glossy.vertices, [3, 4, 2], "the glossy triangle brings its other corners along");
        assert_eq!(glossy.indices, [0, 1, 2], "renumbered");
        assert_eq!(glossy.batches, [Batch { indices: 0..3, texture: Some(0) }], "and its texture");
    }
}

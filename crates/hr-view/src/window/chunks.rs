//! Triangles in chunks that are near each other and face alike, so that what is not seen is left out by the hundred.

use super::lists::VertexList;
use super::sight::Sight;
use crate::display::{Batch, DisplayMesh};
use glam::Vec3;
use std::ops::Range;

/// Triangles of a chunk: enough to make the cost of a test and of a draw vanish, few enough to fit closely around them.
const MOST_TRIANGLES: usize = 256;

/// A run of triangles that share a texture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chunk {
    /// Range of the list's indices.
    pub(super) indices: Range<u32>,
    /// Index into the mesh's textures.
    pub(super) texture: Option<u32>,
    /// A ball that holds it, relative to the mesh's origin.
    center: Vec3,
    radius: f32,
    /// A cone that holds its triangles' normals: axis, and the cosine and sine of its half angle.
    axis: Vec3,
    cosine: f32,
    sine: f32,
}

impl Chunk {
    /// For some triangles.
    fn new(indices: Range<u32>, texture: Option<u32>, triangles: &[[Vec3; 3]]) -> Self {
        let corners = || triangles.iter().flatten();
        let low = corners().fold(Vec3::INFINITY, |low, p| low.min(*p));
        let high = corners().fold(Vec3::NEG_INFINITY, |high, p| high.max(*p));
        let center = 0.5 * (low + high);
        let radius = corners().map(|p| p.distance_squared(center)).fold(0.0, f32::max).sqrt();
        let normals = || triangles.iter().map(normal);
        let axis = normals().sum::<Vec3>().normalize_or_zero();
        // Triangles without area are not seen.
        let cosine = normals().filter(|n| *n != Vec3::ZERO).map(|n| n.dot(axis)).fold(1.0, f32::min);
        // Rounding must not make it narrower than it is.
        let cosine = (cosine - 1e-4).max(-1.0);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        Self { indices, texture, center, radius, axis, cosine, sine }
    }

    /// Whether some of it may be seen: it is not wholly beyond an edge of the picture, and some of it may face the eye.
    pub(super) fn may_be_seen(&self, sight: &Sight) -> bool {
        let to_eye = sight.eye - self.center;
        sight.sides.iter().all(|side| side.dot(to_eye) <= self.radius) && self.may_face(to_eye)
    }

    /// Those of the picture's sides that it is not wholly within, and how many they are.
    pub(super) fn crossing(&self, sight: &Sight) -> ([Vec3; 4], usize) {
        sight.crossing(self.center, self.radius)
    }

    /// From the eye to its middle: of what is large, such as a wall, most is not near though some may be.
    pub(super) fn distance(&self, sight: &Sight) -> f32 {
        self.center.distance(sight.eye)
    }

    fn may_face(&self, to_eye: Vec3) -> bool {
        let distance = to_eye.length();
        let along = self.axis.dot(to_eye);
        // Of the cone's normals the one nearest to the eye's direction, which is at an angle φ to the axis:
        // |d| cos(max(0, φ − θ)).
        let across = (distance * distance - along * along).max(0.0).sqrt();
        let is_within = along >= distance * self.cosine;
        let most = if is_within { distance } else { along * self.cosine + across * self.sine };
        most + self.radius >= 0.0
    }
}

/// A list in chunks.
#[derive(Debug, Default)]
pub(super) struct Chunked {
    pub(super) list: VertexList,
    pub(super) chunks: Vec<Chunk>,
}

impl Chunked {
    /// Sorts a list's triangles into chunks, and its vertices by first use. There is more than one part where one would have
    /// more than so many vertices or indices, and there is none of an empty list.
    pub(super) fn within(mesh: &DisplayMesh, list: &VertexList, most: u64) -> Vec<Self> {
        let position = |v: u32| mesh.positions[list.vertices[v as usize] as usize];
        let (low, high) = mesh.bounds();
        let scale = 1023.0 / (high - low).max_element().max(f32::MIN_POSITIVE);
        let (mut parts, mut part) = (Vec::new(), Self::default());
        let mut place = vec![u32::MAX; list.vertices.len()];
        for batch in &list.batches {
            let indices = &list.indices[batch.indices.start as usize..batch.indices.end as usize];
            let mut triangles: Vec<(u64, [u32; 3])> = indices
                .chunks_exact(3)
                .map(|t| {
                    let corners = [t[0], t[1], t[2]];
                    let points = corners.map(position);
                    let middle = (points[0] + points[1] + points[2]) / 3.0;
                    (key(normal(&points), (middle - low) * scale), corners)
                })
                .collect();
            triangles.sort_by_key(|(key, _)| *key);
            for chunk in triangles.chunks(MOST_TRIANGLES) {
                // There may be as many new vertices.
                let more = 3 * chunk.len();
                if part.list.indices.len().max(part.list.vertices.len()) as u64 + more as u64 > most {
                    parts.extend(std::mem::take(&mut part).unless_empty());
                    place.fill(u32::MAX);
                }
                part.add(list, batch.texture, chunk, &mut place, &position);
            }
        }
        parts.extend(part.unless_empty());
        parts
    }

    fn unless_empty(self) -> Option<Self> {
        (!self.chunks.is_empty()).then_some(self)
    }

    /// Adds triangles of another list. `place` is where its vertices are in this one.
    fn add(
        &mut self,
        from: &VertexList,
        texture: Option<u32>,
        triangles: &[(u64, [u32; 3])],
        place: &mut [u32],
        position: &impl Fn(u32) -> Vec3,
    ) {
        let list = &mut self.list;
        let start = list.indices.len() as u32;
        for corner in triangles.iter().flat_map(|(_, corners)| *corners) {
            let place = &mut place[corner as usize];
            if *place == u32::MAX {
                *place = list.vertices.len() as u32;
                list.vertices.push(from.vertices[corner as usize]);
                list.leaves.extend(from.leaves.get(corner as usize));
            }
            list.indices.push(*place);
        }
        let indices = start..list.indices.len() as u32;
        let points: Vec<[Vec3; 3]> = triangles.iter().map(|(_, corners)| corners.map(position)).collect();
        self.chunks.push(Chunk::new(indices.clone(), texture, &points));
        list.batches.push(Batch { indices, texture });
    }
}

/// Unit normal of a triangle; zero where it has no area.
fn normal([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (*b - *a).cross(*c - *a).normalize_or_zero()
}

/// Sorts by the side of a cube that a triangle faces, then by place (Morton order; coordinates 0…1023).
fn key(normal: Vec3, at: Vec3) -> u64 {
    let size = normal.abs();
    let side = if size.x >= size.y && size.x >= size.z {
        u64::from(normal.x < 0.0)
    } else if size.y >= size.z {
        2 + u64::from(normal.y < 0.0)
    } else {
        4 + u64::from(normal.z < 0.0)
    };
    let spread = |x: f32| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0…1023")]
        let x = x.clamp(0.0, 1023.0) as u64;
        (0..10).fold(0, |sum, bit| sum | ((x >> bit) & 1) << (3 * bit))
    };
    side << 30 | spread(at.x) | spread(at.y) << 1 | spread(at.z) << 2
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::window::lists::split;
    use crate::window::sight::may_be_seen;
    use crate::window::view::View;
    use glam::DVec3;
    use std::collections::HashSet;

    /// A hilly square of many small triangles, and what is behind it.
    pub(in crate::window) fn hills() -> DisplayMesh {
        let n = 100_u32;
        let mut mesh = DisplayMesh::default();
        for i in 0..=n {
            for j in 0..=n {
                let [x, y] = [i, j].map(|k| k as f32 / n as f32 * 6.0);
                mesh.positions.push(Vec3::new(x, y, x.sin() * (1.3 * y).cos()));
            }
        }
        for i in 0..n {
            for j in 0..n {
                let at = |i: u32, j: u32| i * (n + 1) + j;
                mesh.indices.extend([
                    at(i, j),
                    at(i + 1, j),
                    at(i + 1, j + 1),
                    at(i, j),
                    at(i + 1, j + 1),
                    at(i, j + 1),
                ]);
            }
        }
        let backs: Vec<u32> = mesh.indices.iter().rev().copied().collect();
        let half = mesh.indices.len() as u32;
        mesh.indices.extend(backs);
        mesh.batches =
            vec![Batch { indices: 0..half, texture: None }, Batch { indices: half..2 * half, texture: Some(0) }];
        mesh
    }

    #[test]
    fn nothing_is_lost_and_nothing_that_is_seen_is_left_out() {
        let mesh = hills();
        let [list, _] = split(&mesh, &[]);
        let [chunked] = &Chunked::within(&mesh, &list, u64::MAX)[..] else { panic!("one part") };
        let triangles = |list: &VertexList, range: Range<u32>| -> Vec<[u32; 3]> {
            let indices = &list.indices[range.start as usize..range.end as usize];
            indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|v| list.vertices[v as usize])).collect()
        };
        let all = |list: &VertexList| -> HashSet<[u32; 3]> {
            list.batches.iter().flat_map(|b| triangles(list, b.indices.clone())).collect()
        };
        assert_eq!(all(&list), all(&chunked.list), "the same triangles");
        assert_eq!(chunked.list.vertices.len(), list.vertices.len(), "each vertex once");
        let (mut seen, mut drawn, mut count, mut spared) = (0, 0, 0, 0);
        for k in 0..40 {
            let turn = 0.4 * f64::from(k);
            let eye = DVec3::new(3.0 + 2.0 * turn.cos(), 3.0 + 3.0 * turn.sin(), 2.0 * (0.7 * turn).sin());
            let view = View::looking(eye, DVec3::new(turn.sin(), turn.cos(), 0.3 * turn.sin()), DVec3::Z, 70.0, 1.6);
            let sight = view.sight(DVec3::ZERO, 1.6);
            for chunk in &chunked.chunks {
                let (sides, crossing) = chunk.crossing(&sight);
                spared += 4 - crossing;
                let is_visible = |t: &[u32; 3]| {
                    let points = t.map(|v| mesh.positions[v as usize]);
                    let is_visible = may_be_seen(points, sight.eye, &sight.sides);
                    let by_fewer = may_be_seen(points, sight.eye, &sides[..crossing]);
                    assert_eq!(by_fewer, is_visible, "{crossing} sides tell as much as four, from {eye}");
                    is_visible
                };
                let visible = triangles(&chunked.list, chunk.indices.clone()).iter().filter(|t| is_visible(t)).count();
                assert!(visible == 0 || chunk.may_be_seen(&sight), "{visible} triangles seen from {eye} are left out");
                seen += visible;
                drawn += if chunk.may_be_seen(&sight) { chunk.indices.len() / 3 } else { 0 };
                count += chunk.indices.len() / 3;
            }
        }
        // Half of all triangles look the other way, and half of the rest are beside the picture.
        assert!(drawn * 2 < count, "{drawn} of {count} are drawn, {seen} are seen");
        assert!(spared > 0, "no chunk lies wholly within a side");
    }
}

//! Triangles and vertices in few bytes.

use super::colors::shared_exponent;
use super::payload::Payload;
use crate::display::{Batch, DisplayMesh};
use crate::window::lists::VertexList;
use crate::window::tone::finite;
use glam::{Vec2, Vec3, Vec3Swizzles};
use serde::Serialize;

/// Positions are whole numbers of this share of the scene's size along each axis: 10 µm in a room of 10 m.
const STEPS: f32 = (1 << 20) as f32;

/// What the page knows of one of the two lists.
#[derive(Serialize)]
pub(super) struct List {
    /// Start, number of indices and, if any, the texture of each run.
    batches: Vec<(u32, u32, Option<u32>)>,
}

/// The box that whole numbers are places in.
#[derive(Serialize)]
pub(super) struct Lattice {
    low: [f32; 3],
    step: [f32; 3],
}

impl Lattice {
    /// Around a mesh.
    pub(super) fn of(mesh: &DisplayMesh) -> Self {
        let (low, high) = mesh.bounds();
        Self { low: low.to_array(), step: ((high - low) / STEPS).to_array() }
    }

    pub(super) fn place(&self, position: Vec3) -> [u32; 3] {
        [0, 1, 2].map(|axis| {
            let steps = (position[axis] - self.low[axis]) / self.step[axis];
            // A scene may be flat; then it is not a number, and 0.
            steps.round() as u32
        })
    }
}

/// Sorts the triangles of each batch by place, along a curve that fills the box (G. Morton, 1966): the page leaves out
/// runs of triangles that are not in the picture.
pub(super) fn gather(mesh: &mut DisplayMesh) {
    // Cells of 1/32 of the box.
    const BITS: u32 = 5;
    let lattice = Lattice::of(mesh);
    let place = |corners: &[u32; 3]| {
        let middle = corners.iter().map(|&corner| mesh.positions[corner as usize]).sum::<Vec3>() / 3.0;
        let cell = lattice.place(middle).map(|steps| (steps >> (20 - BITS)).min((1 << BITS) - 1));
        (0..BITS)
            .fold(0, |key, bit| (0..3).fold(key, |key, axis| key | (cell[axis] >> bit & 1) << (3 * bit + axis as u32)))
    };
    for batch in &mesh.batches {
        let indices = &mut mesh.indices[batch.indices.start as usize..batch.indices.end as usize];
        let (triangles, _) = indices.as_chunks_mut::<3>();
        triangles.sort_by_cached_key(place);
    }
}

/// Adds a list of triangles. Light is multiplied by `exposure`.
pub(super) fn add(
    payload: &mut Payload,
    name: &str,
    mesh: &DisplayMesh,
    list: &VertexList,
    lattice: &Lattice,
    exposure: f32,
) -> List {
    let vertices = || list.vertices.iter().map(|&vertex| vertex as usize);
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        let places = vertices().map(|v| lattice.place(mesh.positions[v])[axis]);
        payload.steps(format!("{name}.{letter}"), places);
    }
    payload.steps(format!("{name}.indices"), list.indices.iter().copied());
    let mut colors = |what: &str, color: &dyn Fn(usize) -> Vec3| {
        let words: Vec<u32> = vertices().map(|v| shared_exponent(finite(color(v)))).collect();
        payload.words(format!("{name}.{what}"), &words);
    };
    colors("irradiance", &|v| mesh.irradiance[v] * exposure);
    colors("tint", &|v| mesh.tint[v]);
    colors("emission", &|v| mesh.emission[v] * exposure);
    for (letter, axis) in [("u", 0), ("v", 1)] {
        let words: Vec<u32> = vertices().map(|v| mesh.uv[v][axis].to_bits()).collect();
        payload.words(format!("{name}.{letter}"), &words);
    }
    let batch = |b: &Batch| (b.indices.start, b.indices.end - b.indices.start, b.texture);
    List { batches: list.batches.iter().map(batch).collect() }
}

/// A unit vector in 32 bits: its point on an octahedron unfolded to a square, 16 bits per side (Q. Meyer et al., "On
/// Floating-Point Normal Vectors", 2010). Off by at most 0.004°.
pub(super) fn packed_normal(normal: Vec3) -> u32 {
    let sum = normal.abs().element_sum();
    let flat = if sum > 0.0 { normal / sum } else { Vec3::Z };
    let square = if flat.z < 0.0 { (1.0 - flat.yx().abs()) * Vec2::ONE.copysign(flat.xy()) } else { flat.xy() };
    let [x, y] = square.to_array().map(|c| (c.clamp(-1.0, 1.0) * 32767.0).round() as i16);
    u32::from(x.cast_unsigned()) | u32::from(y.cast_unsigned()) << 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_keep_their_direction() {
        let mut worst = 0.0_f32;
        for i in 0..4000 {
            let (z, turn) = (1.0 - (i as f32 + 0.5) / 2000.0, 2.4 * i as f32);
            let normal = Vec3::from((Vec2::from_angle(turn) * (1.0 - z * z).sqrt(), z));
            let word = packed_normal(normal);
            let [x, y] = [word as u16, (word >> 16) as u16].map(|c| f32::from(c.cast_signed()) / 32767.0);
            let mut found = Vec3::new(x, y, 1.0 - x.abs() - y.abs());
            if found.z < 0.0 {
                (found.x, found.y) = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
            }
            worst = worst.max(found.normalize().distance(normal));
        }
        // Half a step of 1/32767 in both directions, at most tripled by the projection: 0.004°.
        assert!(worst < 7e-5, "off by {worst} rad");
    }

    #[test]
    fn places_are_on_the_lattice_also_of_flat_scenes() {
        let positions = vec![Vec3::new(-1.0, 2.0, 5.0), Vec3::new(3.0, 2.0, 6.0), Vec3::new(0.5, 2.0, 5.3)];
        let mesh = DisplayMesh { positions, ..DisplayMesh::default() };
        let lattice = Lattice::of(&mesh);
        for &position in &mesh.positions {
            let place = lattice.place(position);
            for axis in 0..3 {
                let back = lattice.low[axis] + place[axis] as f32 * lattice.step[axis];
                // Half a step, and f32's own rounding.
                let off = (back - position[axis]).abs();
                assert!(off <= 0.5 * lattice.step[axis] + 1e-6, "{position} comes back off by {off} along {axis}");
            }
        }
        assert_eq!(Lattice::of(&DisplayMesh::default()).place(Vec3::ZERO), [0; 3], "nothing has a place, too");
    }
}

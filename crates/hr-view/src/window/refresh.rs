//! Keeps the radiance of glossy vertices up to date with the eye, and no more than that.
//!
//! A vertex is evaluated when a triangle that it belongs to may be seen and the direction toward the eye has changed
//! by more than a tolerance since the last time (paper, section 5).

use super::chunks::Chunked;
use super::sight::{Sight, may_be_seen};
use super::tone::finite;
use crate::display::Walkable;
use glam::{DVec3, Vec3};
use glossy_ext::Rgb;
use rayon::prelude::*;
use std::ops::AddAssign;

/// Vertices per call of [`Walkable::glossy_radiance`]: enough to make the call's own cost vanish, few enough to keep
/// all threads busy.
const CHUNK: usize = 256;

/// What a refresh did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Refreshed {
    /// Glossy vertices of triangles that may be seen.
    pub(super) visible: usize,
    /// How many of them were evaluated.
    pub(super) evaluated: usize,
}

impl AddAssign for Refreshed {
    fn add_assign(&mut self, other: Self) {
        self.visible += other.visible;
        self.evaluated += other.evaluated;
    }
}

/// The radiances of a glossy list and the directions that they are valid for.
pub(super) struct Refresh {
    chunked: Chunked,
    /// Per list vertex: its position in `DisplayMesh::glossy`; `None` for those that came along with a triangle.
    slots: Vec<Option<u32>>,
    /// Per list vertex: position relative to the mesh's origin.
    positions: Vec<Vec3>,
    /// Per list vertex: unit direction toward the eye at the last evaluation, zero before the first.
    seen_from: Vec<Vec3>,
    /// Per list vertex: radiance toward the eye.
    radiance: Vec<Rgb>,
    /// Per list vertex: the last refresh that found it on a visible triangle.
    needed_in: Vec<u32>,
    /// Number of the current refresh.
    now: u32,
    /// List vertices to be evaluated, their positions in `DisplayMesh::glossy`, and what they become; kept for their
    /// memory.
    stale: Vec<usize>,
    slots_of_stale: Vec<u32>,
    fresh: Vec<Rgb>,
}

impl Refresh {
    /// Nothing evaluated yet.
    pub(super) fn new(walk: &dyn Walkable, chunked: Chunked) -> Self {
        let mesh = walk.mesh();
        let mut slot_of = vec![None; mesh.positions.len()];
        for (slot, &vertex) in (0_u32..).zip(&mesh.glossy) {
            slot_of[vertex as usize] = Some(slot);
        }
        let list = &chunked.list;
        let count = list.vertices.len();
        Self {
            slots: list.vertices.iter().map(|&v| slot_of[v as usize]).collect(),
            positions: list.vertices.iter().map(|&v| mesh.positions[v as usize]).collect(),
            seen_from: vec![Vec3::ZERO; count],
            radiance: vec![Rgb::ZERO; count],
            needed_in: vec![0; count],
            now: 0,
            stale: Vec::new(),
            slots_of_stale: Vec::new(),
            fresh: Vec::new(),
            chunked,
        }
    }

    /// Radiance per list vertex, finite.
    pub(super) fn radiance(&self) -> &[Rgb] {
        &self.radiance
    }

    /// Evaluates what the new eye made stale. `tolerance` in radians; 0 evaluates at any change of direction.
    pub(super) fn update(&mut self, walk: &dyn Walkable, eye: DVec3, sight: &Sight, tolerance: f32) -> Refreshed {
        self.now = self.now.wrapping_add(1);
        // Two unit vectors at an angle t are 2 sin(t/2) apart: exact for small angles, where a cosine is all rounding.
        let apart = 2.0 * (0.5 * tolerance.clamp(0.0, std::f32::consts::PI)).sin();
        let mut done = Refreshed::default();
        self.stale.clear();
        self.slots_of_stale.clear();
        for chunk in self.chunked.chunks.iter().filter(|chunk| chunk.may_be_seen(sight)) {
            let indices = &self.chunked.list.indices[chunk.indices.start as usize..chunk.indices.end as usize];
            for corners in indices.chunks_exact(3) {
                let corners = [corners[0], corners[1], corners[2]].map(|c| c as usize);
                if corners.iter().all(|&c| self.needed_in[c] == self.now || self.slots[c].is_none())
                    || !may_be_seen(corners.map(|c| self.positions[c]), sight)
                {
                    continue;
                }
                for c in corners {
                    let Some(slot) = self.slots[c].filter(|_| self.needed_in[c] != self.now) else { continue };
                    self.needed_in[c] = self.now;
                    done.visible += 1;
                    let toward = (sight.eye - self.positions[c]).normalize_or_zero();
                    let moved = (toward - self.seen_from[c]).length_squared() > apart * apart;
                    if moved || self.seen_from[c] == Vec3::ZERO {
                        self.seen_from[c] = toward;
                        self.stale.push(c);
                        self.slots_of_stale.push(slot);
                    }
                }
            }
        }
        done.evaluated = self.stale.len();
        self.fresh.clear();
        self.fresh.resize(self.stale.len(), Rgb::ZERO);
        self.slots_of_stale
            .par_chunks(CHUNK)
            .zip(self.fresh.par_chunks_mut(CHUNK))
            .for_each(|(slots, out)| walk.glossy_radiance(eye, slots, out));
        for (&c, value) in self.stale.iter().zip(&self.fresh) {
            self.radiance[c] = finite(*value);
        }
        done
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{Batch, DisplayMesh};
    use crate::window::lists::split;
    use crate::window::view::View;
    use glam::Vec2;
    use hr_scene::Camera;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A glossy square 2 × 2 in the plane z = 0, facing +z, whose radiance is the eye's height.
    struct Square {
        mesh: DisplayMesh,
        asked: AtomicUsize,
    }

    impl Square {
        fn new() -> Self {
            let positions = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let mesh = DisplayMesh {
                positions: positions.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
                normals: vec![Vec3::Z; 4],
                irradiance: vec![Rgb::ZERO; 4],
                tint: vec![Rgb::ZERO; 4],
                emission: vec![Rgb::ZERO; 4],
                uv: vec![Vec2::ZERO; 4],
                indices: vec![0, 1, 2, 0, 2, 3],
                batches: vec![Batch { indices: 0..6, texture: None }],
                glossy: vec![3, 2, 1, 0],
                ..DisplayMesh::default()
            };
            Self { mesh, asked: AtomicUsize::new(0) }
        }
    }

    impl Walkable for Square {
        fn name(&self) -> &str {
            "square"
        }
        fn mesh(&self) -> &DisplayMesh {
            &self.mesh
        }
        fn cameras(&self) -> &[(String, Camera)] {
            &[]
        }
        fn glossy_radiance(&self, eye: DVec3, vertices: &[u32], out: &mut [Rgb]) {
            self.asked.fetch_add(vertices.len(), Ordering::Relaxed);
            out.fill(Rgb::splat(eye.as_vec3().z));
        }
    }

    /// All of a mesh's glossy list.
    fn glossy(mesh: &DisplayMesh) -> Chunked {
        let [_, list] = split(mesh, &[]);
        Chunked::within(mesh, &list, u64::MAX).remove(0)
    }

    fn update(refresh: &mut Refresh, square: &Square, eye: DVec3, target: DVec3, tolerance: f32) -> Refreshed {
        let view = View::looking(eye, target - eye, DVec3::Y, 90.0, 1.0);
        refresh.update(square, eye, &view.sight(DVec3::ZERO, 1.0), tolerance)
    }

    #[test]
    fn only_what_changed_is_evaluated() {
        let square = Square::new();
        let mut refresh = Refresh::new(&square, glossy(square.mesh()));
        let eye = DVec3::new(0.0, 0.0, 4.0);
        let all = Refreshed { visible: 4, evaluated: 4 };
        assert_eq!(update(&mut refresh, &square, eye, DVec3::ZERO, 0.0), all, "first sight");
        assert!(refresh.radiance().iter().all(|r| *r == Rgb::splat(4.0)), "values arrive: {:?}", refresh.radiance());

        let nothing = Refreshed { visible: 4, evaluated: 0 };
        assert_eq!(update(&mut refresh, &square, eye, DVec3::ZERO, 0.0), nothing, "the same eye");

        // From 4 to 4.01 above, the direction of a corner turns by about 0.01 · √2/18 = 0.0008 rad.
        let nearer = DVec3::new(0.0, 0.0, 4.01);
        assert_eq!(update(&mut refresh, &square, nearer, DVec3::ZERO, 0.01), nothing, "within the tolerance");
        assert_eq!(update(&mut refresh, &square, nearer, DVec3::ZERO, 0.0), all, "a tolerance of 0 takes any change");
        assert_eq!(square.asked.load(Ordering::Relaxed), 8, "two full evaluations in all");
    }

    #[test]
    fn what_is_not_seen_waits() {
        let square = Square::new();
        let mut refresh = Refresh::new(&square, glossy(square.mesh()));
        let above = DVec3::new(0.0, 0.0, 4.0);
        let away = update(&mut refresh, &square, above, DVec3::new(0.0, 0.0, 9.0), 0.0);
        assert_eq!(away, Refreshed::default(), "it is behind the eye");
        let below = update(&mut refresh, &square, DVec3::new(0.0, 0.0, -4.0), DVec3::ZERO, 0.0);
        assert_eq!(below, Refreshed::default(), "its back is culled");
        let now = update(&mut refresh, &square, above, DVec3::ZERO, 0.0);
        assert_eq!(now, Refreshed { visible: 4, evaluated: 4 }, "turning toward it is enough");
    }
}

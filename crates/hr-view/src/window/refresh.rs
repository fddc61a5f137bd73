//! Keeps the radiance of glossy vertices up to date with the eye, and no more than that.
//!
//! A vertex is evaluated when a triangle that it belongs to may be seen and the direction toward the eye has changed
//! by more than a tolerance since the last time (paper, section 5).

use super::chunks::{Chunk, Chunked};
use super::sight::{Sight, may_be_seen};
use super::tone::finite;
use crate::display::Walkable;
use glam::{DVec3, Vec3};
use glossy_ext::Rgb;
use rayon::prelude::*;
use std::iter::Sum;
use std::ops::{Add, AddAssign};
use std::sync::atomic::{AtomicU32, Ordering};

/// In place of a position in `DisplayMesh::glossy`.
const NOT_GLOSSY: u32 = u32::MAX;

/// What a refresh did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Refreshed {
    /// Glossy vertices of triangles that may be seen.
    pub(super) visible: usize,
    /// How many of them were evaluated.
    pub(super) evaluated: usize,
}

impl Add for Refreshed {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { visible: self.visible + other.visible, evaluated: self.evaluated + other.evaluated }
    }
}

impl AddAssign for Refreshed {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sum for Refreshed {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), Self::add)
    }
}

/// The radiances of a glossy list and the directions that they are valid for.
pub(super) struct Refresh {
    chunks: Vec<Stale>,
    /// The list's triangles.
    indices: Vec<u32>,
    vertices: Vertices,
    /// Per list vertex: radiance toward the eye.
    radiance: Vec<Rgb>,
}

/// What is known of the list's vertices.
struct Vertices {
    /// Position in `DisplayMesh::glossy`; [`NOT_GLOSSY`] for those that came along with a triangle.
    slots: Vec<u32>,
    /// Position relative to the mesh's origin.
    positions: Vec<Vec3>,
    /// Unit direction toward the eye at the last evaluation, zero before the first.
    seen_from: Vec<Vec3>,
    /// The last refresh that found it on a visible triangle.
    needed_in: Vec<AtomicU32>,
    /// Number of the current refresh.
    now: u32,
}

/// A chunk and its vertices to be evaluated, kept for their memory. A vertex that chunks share is one's of them.
struct Stale {
    chunk: Chunk,
    /// List vertices, and unit directions from there toward the eye.
    vertices: Vec<u32>,
    toward: Vec<Vec3>,
    /// Positions in `DisplayMesh::glossy`, and what is found there.
    slots: Vec<u32>,
    radiance: Vec<Rgb>,
}

impl Vertices {
    /// Whether a vertex has been found on a visible triangle of this refresh.
    fn is_needed(&self, vertex: u32) -> bool {
        self.needed_in[vertex as usize].load(Ordering::Relaxed) == self.now
    }

    /// Takes note that a vertex is on a visible triangle; true for one caller of each refresh, whoever is the first.
    fn need(&self, vertex: u32) -> bool {
        // All else that is shared rests meanwhile: there is no order to keep.
        !self.is_needed(vertex) && self.needed_in[vertex as usize].swap(self.now, Ordering::Relaxed) != self.now
    }
}

impl Stale {
    fn new(chunk: Chunk) -> Self {
        let (vertices, toward, slots, radiance) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { chunk, vertices, toward, slots, radiance }
    }

    /// Finds the vertices of visible triangles whose direction toward the eye has changed by more than the length
    /// `apart`. The number of those that no other chunk has found.
    fn find(&mut self, indices: &[u32], vertices: &Vertices, sight: &Sight, apart: f32) -> usize {
        self.vertices.clear();
        self.toward.clear();
        self.slots.clear();
        if !self.chunk.may_be_seen(sight) {
            return 0;
        }
        let (sides, crossing) = self.chunk.crossing(sight);
        let sides = &sides[..crossing];
        let place = |vertex: u32| vertices.positions[vertex as usize];
        let mut visible = 0;
        for corners in indices[self.chunk.indices.start as usize..self.chunk.indices.end as usize].chunks_exact(3) {
            let corners = [corners[0], corners[1], corners[2]];
            if corners.iter().all(|&c| vertices.is_needed(c)) {
                continue;
            }
            let points = [place(corners[0]), place(corners[1]), place(corners[2])];
            if !may_be_seen(points, sight.eye, sides) {
                continue;
            }
            for c in corners {
                let at = c as usize;
                if !vertices.need(c) || vertices.slots[at] == NOT_GLOSSY {
                    continue;
                }
                visible += 1;
                let toward = (sight.eye - place(c)).normalize_or_zero();
                let before = vertices.seen_from[at];
                if before == Vec3::ZERO || (toward - before).length_squared() > apart * apart {
                    self.vertices.push(c);
                    self.toward.push(toward);
                    self.slots.push(vertices.slots[at]);
                }
            }
        }
        visible
    }

    /// Evaluates what was found. How many.
    fn evaluate(&mut self, walk: &dyn Walkable, eye: DVec3) -> usize {
        self.radiance.clear();
        self.radiance.resize(self.slots.len(), Rgb::ZERO);
        if !self.slots.is_empty() {
            walk.glossy_radiance(eye, &self.slots, &mut self.radiance);
        }
        self.slots.len()
    }
}

impl Refresh {
    /// Nothing evaluated yet.
    pub(super) fn new(walk: &dyn Walkable, chunked: Chunked) -> Self {
        let mesh = walk.mesh();
        let mut slot_of = vec![NOT_GLOSSY; mesh.positions.len()];
        for (slot, &vertex) in (0_u32..).zip(&mesh.glossy) {
            slot_of[vertex as usize] = slot;
        }
        let Chunked { list, chunks } = chunked;
        let count = list.vertices.len();
        Self {
            chunks: chunks.into_iter().map(Stale::new).collect(),
            indices: list.indices,
            vertices: Vertices {
                slots: list.vertices.iter().map(|&v| slot_of[v as usize]).collect(),
                positions: list.vertices.iter().map(|&v| mesh.positions[v as usize]).collect(),
                seen_from: vec![Vec3::ZERO; count],
                needed_in: std::iter::repeat_with(AtomicU32::default).take(count).collect(),
                now: 0,
            },
            radiance: vec![Rgb::ZERO; count],
        }
    }

    /// Radiance per list vertex, finite.
    pub(super) fn radiance(&self) -> &[Rgb] {
        &self.radiance
    }

    /// Evaluates what the new eye made stale. `tolerance` in radians; 0 evaluates at any change of direction. All
    /// threads take part, chunk by chunk: neighbours read the same distributions.
    pub(super) fn update(&mut self, walk: &dyn Walkable, eye: DVec3, sight: &Sight, tolerance: f32) -> Refreshed {
        self.vertices.now = self.vertices.now.wrapping_add(1);
        // Two unit vectors at an angle t are 2 sin(t/2) apart: exact for small angles, where a cosine is all rounding.
        let apart = 2.0 * (0.5 * tolerance.clamp(0.0, std::f32::consts::PI)).sin();
        let (indices, vertices) = (&self.indices, &self.vertices);
        let renew = |stale: &mut Stale| {
            let visible = stale.find(indices, vertices, sight, apart);
            Refreshed { visible, evaluated: stale.evaluate(walk, eye) }
        };
        let done = self.chunks.par_iter_mut().map(renew).sum();
        for stale in &self.chunks {
            for ((&c, &toward), &light) in stale.vertices.iter().zip(&stale.toward).zip(&stale.radiance) {
                self.vertices.seen_from[c as usize] = toward;
                self.radiance[c as usize] = finite(light);
            }
        }
        done
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{Batch, DisplayMesh};
    use crate::window::chunks::tests::hills;
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

    /// Hills, most of their vertices glossy, whose radiance tells vertex and eye.
    struct Hills {
        mesh: DisplayMesh,
        /// How often each glossy vertex was evaluated.
        asked: Vec<AtomicUsize>,
    }

    impl Hills {
        fn new() -> Self {
            let mut mesh = hills();
            mesh.glossy = (0..mesh.positions.len() as u32).rev().filter(|v| v % 7 != 0).collect();
            let asked = mesh.glossy.iter().map(|_| AtomicUsize::new(0)).collect();
            Self { mesh, asked }
        }

        fn light(slot: u32, eye: DVec3) -> Rgb {
            Rgb::new(slot as f32, eye.x as f32, eye.y as f32)
        }
    }

    impl Walkable for Hills {
        fn name(&self) -> &str {
            "hills"
        }
        fn mesh(&self) -> &DisplayMesh {
            &self.mesh
        }
        fn cameras(&self) -> &[(String, Camera)] {
            &[]
        }
        fn glossy_radiance(&self, eye: DVec3, vertices: &[u32], out: &mut [Rgb]) {
            for (&slot, out) in vertices.iter().zip(out) {
                self.asked[slot as usize].fetch_add(1, Ordering::Relaxed);
                *out = Self::light(slot, eye);
            }
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

    /// Against triangle by triangle, one after the other: vertices of several chunks, whichever thread finds them first.
    #[test]
    fn vertices_that_chunks_share_count_once() {
        let hills = Hills::new();
        let (mesh, tolerance) = (hills.mesh(), 0.1_f32);
        let chunked = glossy(mesh);
        let list = chunked.list.vertices.clone();
        assert!(chunked.chunks.len() > 100, "{} chunks share vertices", chunked.chunks.len());
        let mut refresh = Refresh::new(&hills, chunked);
        let count = mesh.glossy.len();
        let (mut seen_from, mut light, mut asked) = (vec![Vec3::ZERO; count], vec![Rgb::ZERO; count], vec![0; count]);
        let mut kept = 0;
        for k in 0..60 {
            let turn = 0.1 * f64::from(k);
            let eye = DVec3::new(3.0 + 2.0 * turn.cos(), 3.0 + 3.0 * turn.sin(), 2.0 * (0.7 * turn).sin());
            let view = View::looking(eye, DVec3::new(turn.sin(), turn.cos(), 0.3 * turn.sin()), DVec3::Z, 70.0, 1.6);
            let sight = view.sight(DVec3::ZERO, 1.6);
            let place = |v: u32| mesh.positions[v as usize];
            let mut is_seen = vec![false; mesh.positions.len()];
            for t in mesh.indices.chunks_exact(3) {
                if may_be_seen([t[0], t[1], t[2]].map(place), sight.eye, &sight.sides) {
                    t.iter().for_each(|&v| is_seen[v as usize] = true);
                }
            }
            let mut expected = Refreshed::default();
            for (slot, &v) in mesh.glossy.iter().enumerate().filter(|(_, v)| is_seen[**v as usize]) {
                expected.visible += 1;
                let toward = (sight.eye - place(v)).normalize();
                if toward.distance(seen_from[slot]) > 2.0 * (0.5 * tolerance).sin() {
                    (seen_from[slot], light[slot]) = (toward, Hills::light(slot as u32, eye));
                    asked[slot] += 1;
                    expected.evaluated += 1;
                }
            }
            kept += expected.visible - expected.evaluated;
            assert_eq!(refresh.update(&hills, eye, &sight, tolerance), expected, "frame {k}");
        }
        assert!(kept > 0 && light.iter().any(|light| *light != Rgb::ZERO), "some are kept, some evaluated");
        let found: Vec<usize> = hills.asked.iter().map(|asked| asked.load(Ordering::Relaxed)).collect();
        assert!(found == asked, "each once, and only where it is stale");
        for (at, &v) in list.iter().enumerate() {
            let slot = mesh.glossy.iter().rev().position(|&g| g == v).map(|from_last| count - 1 - from_last);
            let expected = slot.map_or(Rgb::ZERO, |slot| light[slot]);
            assert_eq!(refresh.radiance()[at], expected, "vertex {v}");
        }
    }
}

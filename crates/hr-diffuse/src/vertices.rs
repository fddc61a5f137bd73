//! Vertices for display: every leaf is shown as a fan about its middle, through its corners and through the corners that finer
//! neighbours put on its edges, so that no crack opens where elements of different size meet. Where other surfaces stand on a
//! leaf it is cut, and shown as several fans (`contacts.rs`); so is one that goes far around a curved surface or a disk.

use crate::hierarchy::{Elements, Kind, SceneData};
use crate::{Domain, Rgb};
use glam::{Vec2, Vec3};
use smallvec::{SmallVec, smallvec};
use std::collections::HashMap;

/// Light is gathered this far from a vertex toward the middle of its leaf: on an edge or in a corner of a room the
/// horizon and the rays would graze the neighbouring surface.
pub(crate) const INSET: f32 = 0.02;
/// Leaves whose normals differ from their middle's by more than this angle (radians) are shown in parts, as light changes with the
/// normal, …
const MOST_TURN: f32 = 0.6;
/// … and so are those, flat or not, that go around their axis by more than this share of a full turn: of a disk, corners are but
/// its centre and one point of its rim, …
const MOST_AROUND: f32 = 0.25;
/// … unless they are smaller than this share of all area: a part takes as long as a leaf. Where so small ones turn by more than an angle,
/// as halves of a rail do, they are still shown in parts, down to …
const SMALL: f32 = 3e-5;
const MUCH_TURN: f32 = 1.2;
/// … a tenth of that.
const TINY: f32 = 3e-6;
/// Most finer levels that a neighbour may have.
const EDGE_DEPTH: u32 = 14;

/// A corner of a leaf's fan.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Corner {
    /// Index of the vertex.
    pub vertex: u32,
    /// Where it is on the leaf's surface.
    pub uv: Vec2,
}

/// The fans of all leaves, and the irradiance at their vertices.
#[derive(Clone, Debug, Default)]
pub struct Vertices {
    /// Positions in unit space.
    pub positions: Vec<Vec3>,
    /// Unit normals on the side of the elements that share the vertex.
    pub normals: Vec<Vec3>,
    /// Irradiance, W/m², …
    pub irradiance: Vec<Rgb>,
    /// … and what of it is light that has been reflected before.
    pub indirect: Vec<Rgb>,
    /// The smallest leaf at the vertex.
    pub leaf: Vec<u32>,
    /// Where the vertex is on that leaf's surface.
    pub uv: Vec<Vec2>,
    /// Corners of all fans: of each its middle first, then the outline, counter-clockwise in (u, v).
    pub(crate) corners: Vec<Corner>,
    /// By fan, where its corners begin, and the end of the last.
    pub(crate) first_corner: Vec<u32>,
    /// By node, where its fans begin, and the end of the last.
    pub(crate) first_fan: Vec<u32>,
    /// Leaves around each vertex.
    pub(crate) around: Vec<u32>,
    pub(crate) first_around: Vec<u32>,
}

impl Vertices {
    /// The fans of a leaf: of each its middle, then its outline. None for other nodes.
    pub fn fans(&self, leaf: u32) -> impl Iterator<Item = &[Corner]> {
        let fans = match self.first_fan.get(leaf as usize..leaf as usize + 2) {
            Some(range) => range[0] as usize..range[1] as usize,
            None => 0..0,
        };
        fans.map(|fan| &self.corners[self.first_corner[fan] as usize..self.first_corner[fan + 1] as usize])
    }

    /// The triangles of a leaf's fans.
    pub(crate) fn triangles(&self, leaf: u32) -> impl Iterator<Item = [&Corner; 3]> {
        self.fans(leaf).filter_map(<[Corner]>::split_first).flat_map(|(middle, outline)| {
            let next = outline.iter().cycle().skip(1);
            outline.iter().zip(next).map(move |(a, b)| [middle, a, b])
        })
    }

    /// The leaves that share a vertex.
    #[must_use]
    pub fn leaves_around(&self, vertex: u32) -> &[u32] {
        let range = &self.first_around[vertex as usize..vertex as usize + 2];
        &self.around[range[0] as usize..range[1] as usize]
    }

    /// The triangle of a leaf's fans that holds (u, v): its vertices and their weights, which sum to 1.
    #[must_use]
    pub fn interpolation(&self, leaf: u32, uv: Vec2) -> [(u32, f32); 3] {
        let Some(Corner { vertex, .. }) = self.fans(leaf).flatten().next() else { return [(0, 0.0); 3] };
        let mut best = [(*vertex, 1.0), (*vertex, 0.0), (*vertex, 0.0)];
        let mut best_low = f32::NEG_INFINITY;
        for [middle, a, b] in self.triangles(leaf) {
            let (p, q, r) = (a.uv - middle.uv, b.uv - middle.uv, uv - middle.uv);
            let area = p.perp_dot(q);
            if area.abs() <= f32::MIN_POSITIVE {
                continue;
            }
            let (wa, wb) = (r.perp_dot(q) / area, p.perp_dot(r) / area);
            let low = wa.min(wb).min(1.0 - wa - wb);
            if low > best_low {
                best_low = low;
                best = [(middle.vertex, 1.0 - wa - wb), (a.vertex, wa), (b.vertex, wb)];
                if low >= 0.0 {
                    break;
                }
            }
        }
        if best_low < 0.0 {
            // Rounding put the point outside of every triangle: the nearest one, without extrapolation.
            let sum: f32 = best.iter().map(|(_, w)| w.max(0.0)).sum();
            for (_, w) in &mut best {
                *w = w.max(0.0) / sum.max(f32::MIN_POSITIVE);
            }
        }
        best
    }

    /// The mean over a leaf of what is known at vertices; `None` for a leaf without extent.
    pub(crate) fn mean(&self, leaf: u32, values: &[f32]) -> Option<f32> {
        let (mut sum, mut area) = (0.0, 0.0);
        for [middle, a, b] in self.triangles(leaf) {
            let part = (a.uv - middle.uv).perp_dot(b.uv - middle.uv).abs();
            sum += part * [middle, a, b].map(|corner| values[corner.vertex as usize]).iter().sum::<f32>() / 3.0;
            area += part;
        }
        (area > 0.0).then(|| sum / area)
    }
}

/// What makes two corners the same vertex: place, normal, material. Exact, as dyadic points on a shared edge are.
type Key = ([u32; 3], [i8; 3], u32);

fn key(position: Vec3, normal: Vec3, material: u32) -> Key {
    // Adding zero makes −0 the same as 0.
    let bits = (position + Vec3::ZERO).to_array().map(f32::to_bits);
    (bits, (normal * 60.0).round().to_array().map(|c| c as i8), material)
}

/// A point of an element as display sees it: position and normal on the element's side.
pub(crate) fn point_on(scene: &SceneData, elements: &Elements, leaf: u32, uv: Vec2) -> (Vec3, Vec3) {
    let element = &elements.nodes[leaf as usize];
    let side = if element.kind == Kind::Back { -1.0 } else { 1.0 };
    let position = scene.surfaces()[element.source as usize].point(uv);
    (position, scene.shading_normal(element.source, uv) * side)
}

/// Corners of leaves, or of their parts, counter-clockwise in (u, v).
pub(crate) type Outline = SmallVec<[Corner; 12]>;

/// What vertices and fans are made of.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// The corners; no middles yet.
    pub(crate) vertices: Vertices,
    /// Leaves, or parts of leaves, by leaf.
    pub(crate) parts: Vec<(u32, Outline)>,
}

/// Finds the corners of all leaves, and the outlines through them.
pub(crate) fn outlines(scene: &SceneData, elements: &Elements) -> Layout {
    layout(scene, elements, |leaf| smallvec![elements.nodes[leaf as usize].domain])
}

/// The same for display: of leaves that turn, parts of them.
pub(crate) fn outlines_of_parts(scene: &SceneData, elements: &Elements) -> Layout {
    layout(scene, elements, |leaf| turns(scene, elements, leaf))
}

/// Finds the corners of leaves or their parts, and the outlines through them.
fn layout(scene: &SceneData, elements: &Elements, parts_of: impl Fn(u32) -> SmallVec<[Domain; 8]>) -> Layout {
    let mut vertices = Vertices::default();
    let mut index: HashMap<Key, u32> = HashMap::new();
    let domains = || elements.patch_leaves().flat_map(|leaf| parts_of(leaf).into_iter().map(move |part| (leaf, part)));
    for (leaf, domain) in domains() {
        let element = &elements.nodes[leaf as usize];
        for uv in scene.surfaces()[element.source as usize].corners(domain) {
            let (position, normal) = point_on(scene, elements, leaf, uv);
            let next = vertices.positions.len() as u32;
            let vertex = *index.entry(key(position, normal, element.material)).or_insert(next);
            if vertex == next {
                vertices.add((position, normal), leaf, uv);
            } else {
                vertices.of_smallest(elements, vertex, leaf, uv);
            }
        }
    }
    let mut parts = Vec::new();
    for (leaf, domain) in domains() {
        let element = &elements.nodes[leaf as usize];
        let corners = scene.surfaces()[element.source as usize].corners(domain);
        let at = |uv: Vec2| {
            let (position, normal) = point_on(scene, elements, leaf, uv);
            index.get(&key(position, normal, element.material)).copied()
        };
        let mut outline = Outline::new();
        for (i, &a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            // An edge that is one point, such as a pole, has no inner vertices.
            let ends = [at(a), at(b)];
            if let Some(vertex) = ends[0] {
                outline.push(Corner { vertex, uv: a });
            }
            let find = |uv: Vec2| at(uv).filter(|vertex| !ends.contains(&Some(*vertex)));
            along_edge(a, b, EDGE_DEPTH, &find, &mut outline);
        }
        parts.push((leaf, outline));
    }
    Layout { vertices, parts }
}

/// Parts of a leaf whose normals differ little and which do not go far around; the leaf itself, where it is such, small or black.
fn turns(scene: &SceneData, elements: &Elements, leaf: u32) -> SmallVec<[Domain; 8]> {
    let element = &elements.nodes[leaf as usize];
    let geometry = &scene.surfaces()[element.source as usize];
    let share = element.area / elements.measure();
    if element.importance <= 0.0 || share < TINY {
        return smallvec![element.domain];
    }
    let [most_turn, most_around] = if share < SMALL { [MUCH_TURN, f32::INFINITY] } else { [MOST_TURN, MOST_AROUND] };
    let turns =
        |domain: Domain| geometry.normal_cone(domain).angle() > most_turn || geometry.around(domain) > most_around;
    let mut parts = SmallVec::<[Domain; 8]>::new();
    let mut open: SmallVec<[Domain; 8]> = smallvec![element.domain];
    while let Some(domain) = open.pop() {
        match geometry.turned_less(domain).filter(|_| turns(domain)) {
            Some(halves) => open.extend(halves),
            None => parts.push(domain),
        }
    }
    parts
}

impl Layout {
    /// Makes a fan of each part; irradiance is zero still.
    pub(crate) fn fans(self, scene: &SceneData, elements: &Elements) -> Vertices {
        let Self { mut vertices, parts } = self;
        let mut shared: Vec<(u32, u32)> = Vec::new();
        vertices.first_fan = vec![0; elements.nodes.len() + 1];
        let whole = |i: usize| {
            [i.checked_sub(1), Some(i + 1)]
                .into_iter()
                .flatten()
                .filter_map(|j| parts.get(j))
                .all(|(leaf, _)| *leaf != parts[i].0)
        };
        for (i, (leaf, outline)) in parts.iter().enumerate() {
            let leaf = *leaf;
            vertices.first_fan[leaf as usize + 1] += 1;
            vertices.first_corner.push(vertices.corners.len() as u32);
            let element = &elements.nodes[leaf as usize];
            let uv = if whole(i) {
                scene.surfaces()[element.source as usize].middle(element.domain)
            } else {
                middle(outline)
            };
            let vertex = vertices.positions.len() as u32;
            vertices.add(point_on(scene, elements, leaf, uv), leaf, uv);
            vertices.corners.push(Corner { vertex, uv });
            vertices.corners.extend_from_slice(outline);
            shared.push((vertex, leaf));
            shared.extend(outline.iter().map(|corner| (corner.vertex, leaf)));
        }
        vertices.first_corner.push(vertices.corners.len() as u32);
        shared.sort_unstable();
        shared.dedup();
        vertices.first_around = vec![0; vertices.positions.len() + 1];
        for (vertex, _) in &shared {
            vertices.first_around[*vertex as usize + 1] += 1;
        }
        for counts in [&mut vertices.first_fan, &mut vertices.first_around] {
            let mut sum = 0;
            for count in counts {
                sum += *count;
                *count = sum;
            }
        }
        vertices.around = shared.into_iter().map(|(_, leaf)| leaf).collect();
        vertices
    }
}

/// The middle of a part.
pub(crate) fn middle(outline: &[Corner]) -> Vec2 {
    outline.iter().map(|corner| corner.uv).sum::<Vec2>() / outline.len().max(1) as f32
}

impl Vertices {
    /// A new vertex: position and normal, a leaf that it belongs to, and where it is there.
    pub(crate) fn add(&mut self, (position, normal): (Vec3, Vec3), leaf: u32, uv: Vec2) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.irradiance.push(Rgb::ZERO);
        self.indirect.push(Rgb::ZERO);
        self.leaf.push(leaf);
        self.uv.push(uv);
        self.positions.len() as u32 - 1
    }

    /// Takes a leaf for the one that a vertex belongs to, if it is smaller.
    pub(crate) fn of_smallest(&mut self, elements: &Elements, vertex: u32, leaf: u32, uv: Vec2) {
        let now = &mut self.leaf[vertex as usize];
        if elements.nodes[leaf as usize].area < elements.nodes[*now as usize].area {
            *now = leaf;
            self.uv[vertex as usize] = uv;
        }
    }
}

/// Vertices that finer neighbours put between two corners, in order: they lie on dyadic points of the edge.
fn along_edge(a: Vec2, b: Vec2, depth: u32, find: &impl Fn(Vec2) -> Option<u32>, out: &mut Outline) {
    if depth == 0 {
        return;
    }
    let uv = 0.5 * (a + b);
    if let Some(vertex) = find(uv) {
        along_edge(a, uv, depth - 1, find, out);
        out.push(Corner { vertex, uv });
        along_edge(uv, b, depth - 1, find, out);
    }
}

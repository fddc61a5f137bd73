//! Vertices for display: every leaf is shown as a fan about its middle, through its corners and through the corners that finer
//! neighbours put on its edges, so that no crack opens where elements of different size meet. Where other surfaces stand on a
//! leaf it is cut, and shown as several fans (`contacts.rs`); so is one that goes far around a curved surface or a disk.
//! Where light changes from a leaf to the next, edges have vertices in their middles, too.

use crate::hierarchy::{Element, Elements, Kind, SceneData};
use crate::sampling::hash;
use crate::{Domain, Rgb};
use glam::{Vec2, Vec3};
use smallvec::{SmallVec, smallvec};
use std::collections::HashMap;
use std::hash::{Hash, Hasher};

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
/// Where irradiances of leaves around a corner differ by more than this many times the error, in shares of the largest, leaves have
/// vertices in the middles of their edges, too.
const CHANGE: f32 = 1.25;
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
        let shares = |[middle, a, b]: [&Corner; 3]| {
            let (p, q, r) = (a.uv - middle.uv, b.uv - middle.uv, uv - middle.uv);
            (p.perp_dot(q), r.perp_dot(q), p.perp_dot(r))
        };
        let weighted = |[middle, a, b]: [&Corner; 3], wa: f32, wb: f32| {
            [(middle.vertex, 1.0 - wa - wb), (a.vertex, wa), (b.vertex, wb)]
        };
        for triangle in self.triangles(leaf) {
            let (area, a, b) = shares(triangle);
            let sign = area.signum();
            if area.abs() > f32::MIN_POSITIVE && (sign * a).min(sign * b).min(sign * (area - a - b)) >= 0.0 {
                return weighted(triangle, a / area, b / area);
            }
        }
        // Rounding put the point outside of every triangle: the nearest one, without extrapolation.
        let Some(Corner { vertex, .. }) = self.fans(leaf).flatten().next() else { return [(0, 0.0); 3] };
        let mut best = [(*vertex, 1.0), (*vertex, 0.0), (*vertex, 0.0)];
        let mut best_low = f32::NEG_INFINITY;
        for triangle in self.triangles(leaf) {
            let (area, a, b) = shares(triangle);
            let (wa, wb) = (a / area, b / area);
            let low = wa.min(wb).min(1.0 - wa - wb);
            if area.abs() > f32::MIN_POSITIVE && low > best_low {
                best_low = low;
                best = weighted(triangle, wa, wb);
            }
        }
        let sum: f32 = best.iter().map(|(_, w)| w.max(0.0)).sum();
        best.map(|(vertex, w)| (vertex, w.max(0.0) / sum.max(f32::MIN_POSITIVE)))
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

/// What makes two corners the same vertex. Exact, as dyadic points on a shared edge are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Key {
    place: [u32; 3],
    normal: [i8; 3],
    material: u32,
}

impl Key {
    fn new(position: Vec3, normal: Vec3, material: u32) -> Self {
        // Adding zero makes −0 the same as 0.
        let place = (position + Vec3::ZERO).to_array().map(f32::to_bits);
        Self { place, normal: (normal * 60.0).round().to_array().map(|c| c as i8), material }
    }
}

/// One number instead of seven: all corners of all leaves are looked up, many times while leaves are split.
impl Hash for Key {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let ([x, y, z], [a, b, c]) = (self.place, self.normal.map(i8::cast_unsigned));
        let rest = u32::from_le_bytes([a, b, c, 0]) ^ self.material.rotate_left(24);
        state.write_u32(hash(hash(hash(x, y), z), rest));
    }
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
    let leaves = elements.patch_leaves().map(|leaf| (leaf, elements.nodes[leaf as usize].domain)).collect();
    Corners::new(scene, elements, leaves).outlines()
}

/// The same for display to an error: of leaves that turn, parts of them; and vertices on edges where the irradiance, by node, changes
/// from a leaf to the next.
pub(crate) fn outlines_of_parts(scene: &SceneData, elements: &Elements, (irradiance, error): (&[Rgb], f32)) -> Layout {
    let parts_of = |leaf| turns(scene, elements, leaf).into_iter().map(move |part| (leaf, part));
    let mut corners = Corners::new(scene, elements, elements.patch_leaves().flat_map(parts_of).collect());
    corners.halve_edges(irradiance, CHANGE * error);
    corners.outlines()
}

/// The corners of leaves, or of their parts.
struct Corners<'a> {
    scene: &'a SceneData,
    elements: &'a Elements,
    parts: Vec<(u32, Domain)>,
    vertices: Vertices,
    index: HashMap<Key, u32>,
}

impl<'a> Corners<'a> {
    fn new(scene: &'a SceneData, elements: &'a Elements, parts: Vec<(u32, Domain)>) -> Self {
        let mut corners = Self { scene, elements, parts, vertices: Vertices::default(), index: HashMap::new() };
        for part in 0..corners.parts.len() {
            let (leaf, around) = corners.around(part);
            around.into_iter().for_each(|uv| corners.add(leaf, uv));
        }
        corners
    }

    /// The leaf of a part, and its corners.
    fn around(&self, part: usize) -> (u32, SmallVec<[Vec2; 4]>) {
        let (leaf, domain) = self.parts[part];
        let surface = self.elements.nodes[leaf as usize].source;
        (leaf, self.scene.surfaces()[surface as usize].corners(domain))
    }

    fn key(&self, leaf: u32, uv: Vec2) -> (Key, (Vec3, Vec3)) {
        let (position, normal) = point_on(self.scene, self.elements, leaf, uv);
        (Key::new(position, normal, self.elements.nodes[leaf as usize].material), (position, normal))
    }

    /// The vertex at a point of a leaf.
    fn at(&self, leaf: u32, uv: Vec2) -> Option<u32> {
        self.index.get(&self.key(leaf, uv).0).copied()
    }

    /// Makes one there, if there is none.
    fn add(&mut self, leaf: u32, uv: Vec2) {
        let (key, point) = self.key(leaf, uv);
        let next = self.vertices.positions.len() as u32;
        let vertex = *self.index.entry(key).or_insert(next);
        if vertex == next {
            self.vertices.add(point, leaf, uv);
        } else {
            self.vertices.of_smallest(self.elements, vertex, leaf, uv);
        }
    }

    /// Adds the middles of all edges of leaves that have a corner around which irradiances differ by more than a share of the largest.
    /// Where the edge of a shadow runs through a row of leaves, their middles may be lit and their corners dark, or the other way round: by
    /// both alone it would be shown as a row of teeth.
    fn halve_edges(&mut self, irradiance: &[Rgb], share: f32) {
        let counts = |element: &Element| element.importance > 0.0 && element.area > TINY * self.elements.measure();
        let mut edges: Vec<(u32, SmallVec<[Vec2; 4]>)> = Vec::new();
        let mut ranges = vec![(f32::MAX, 0.0_f32); self.vertices.positions.len()];
        for part in 0..self.parts.len() {
            let (leaf, around) = self.around(part);
            if self.elements.nodes[leaf as usize].importance > 0.0 {
                let light = irradiance[leaf as usize].element_sum();
                for vertex in around.iter().filter_map(|&uv| self.at(leaf, uv)) {
                    let (low, high) = &mut ranges[vertex as usize];
                    (*low, *high) = (low.min(light), high.max(light));
                }
            }
        }
        let changes = |(low, high): (f32, f32)| high - low > share * high;
        for part in 0..self.parts.len() {
            let (leaf, around) = self.around(part);
            let mut vertices = around.iter().filter_map(|&uv| self.at(leaf, uv));
            if counts(&self.elements.nodes[leaf as usize]) && vertices.any(|vertex| changes(ranges[vertex as usize])) {
                edges.push((leaf, around));
            }
        }
        for (leaf, around) in edges {
            for (i, &a) in around.iter().enumerate() {
                self.add(leaf, 0.5 * (a + around[(i + 1) % around.len()]));
            }
        }
    }

    /// The outlines of all parts through what is on their edges.
    fn outlines(self) -> Layout {
        let outline = |part: usize| {
            let (leaf, corners) = self.around(part);
            let at = |uv: Vec2| self.at(leaf, uv);
            let vertices: SmallVec<[Option<u32>; 4]> = corners.iter().map(|&uv| at(uv)).collect();
            let mut outline = Outline::new();
            for (i, &a) in corners.iter().enumerate() {
                let next = (i + 1) % corners.len();
                // An edge that is one point, such as a pole, has no inner vertices.
                let ends = [vertices[i], vertices[next]];
                if let Some(vertex) = ends[0] {
                    outline.push(Corner { vertex, uv: a });
                }
                let find = |uv: Vec2| at(uv).filter(|vertex| !ends.contains(&Some(*vertex)));
                along_edge(a, corners[next], EDGE_DEPTH, &find, &mut outline);
            }
            (leaf, outline)
        };
        let parts = (0..self.parts.len()).map(outline).collect();
        Layout { vertices: self.vertices, parts }
    }
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

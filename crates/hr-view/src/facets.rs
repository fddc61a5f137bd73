//! From a solution to triangles: the fans of its leaves, curved ones cut until they look round.
//!
//! An edge is cut or not by its own ends and its surface's gloss alone, so that the triangles on both sides of it agree and no crack
//! opens. Where surfaces of different gloss meet at a round edge their chords may differ, by less than is [flat enough](Roundness).

use crate::display::{Batch, DisplayMesh};
use glam::{DVec3, Mat3, Vec2, Vec3};
use glossy_ext::GlossyField;
use hr_diffuse::hierarchy::Kind;
use hr_diffuse::vertices::Corner;
use hr_diffuse::{Domain, Geometry, Rgb, Shape, Solution, Surface};
use hr_scene::{Scene, Texture};
use std::collections::HashMap;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// How round curved surfaces are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roundness {
    /// A chord of a curved surface spans at most this angle (radians) …
    pub fine: f32,
    /// … unless it leaves the surface by less than this (share of the scene's size) …
    pub flat_enough: f32,
    /// … and then at most this (radians), …
    pub coarse: f32,
    /// … or this where it is glossy: wider chords blur what round metal mirrors.
    pub glossy: f32,
}

impl Roundness {
    /// For walks: 8°, or 45° within 1 mm in a room of 10 m, which from a metre away is a pixel; where it is glossy 23° (an eighth and a
    /// sixteenth of a turn, as halving makes them).
    pub const WALKED: Self = Self { fine: 0.14, flat_enough: 1e-4, coarse: 0.8, glossy: 0.4 };
    /// For what is kept: 8°, or 23° within 0.5 mm in a room of 10 m.
    pub const SMOOTH: Self = Self { fine: 0.14, flat_enough: 5e-5, coarse: 0.4, glossy: 0.4 };
}

/// Edges this near to their surface (unit space) are never cut: rounding bends very short ones at random.
const NEGLIGIBLE: f32 = 1e-6;
/// An edge is halved at most so often: a full turn to less than a degree and a half.
const MOST_CUTS: u32 = 8;
/// Nearer than this to a side of a domain (share of its breadth) is on it.
const ON_SIDE: f32 = 1e-6;
/// No index.
const NONE: u32 = u32::MAX;

/// Where the glossy light of a vertex comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Source {
    /// A leaf that the vertex belongs to.
    pub leaf: u32,
    /// Where it is on the leaf's surface.
    pub uv: Vec2,
    /// Vertices of the solution and their weights, which sum to 1.
    pub corners: [(u32, f32); 3],
}

impl Source {
    /// Where the vertex is, in unit space.
    pub(crate) fn place(&self, solution: &Solution<GlossyField>) -> Vec3 {
        let surface = solution.elements.nodes[self.leaf as usize].source;
        solution.scene.surfaces()[surface as usize].point(self.uv)
    }
}

/// The triangles that show a solution, and what they show.
#[derive(Debug)]
pub struct Facets {
    /// The triangles.
    pub mesh: DisplayMesh,
    /// For each of [`DisplayMesh::glossy`] where its light comes from.
    pub sources: Vec<Source>,
    /// For each triangle the leaf that it is a part of, or [`NO_LEAF`].
    pub leaves: Vec<u32>,
}

/// In place of a leaf, where a triangle is the black back of something.
pub const NO_LEAF: u32 = u32::MAX;

/// Makes the triangles that show a solution.
#[must_use]
pub fn facets(scene: &Scene, solution: &Solution<GlossyField>, roundness: Roundness) -> Facets {
    let mut maker = Maker::new(scene, solution, roundness);
    for leaf in solution.elements.patch_leaves() {
        maker.leaf(leaf);
    }
    for surface in 0..solution.scene.surfaces().len() {
        maker.black_back(surface as u32);
    }
    maker.finish()
}

/// A point of a surface that has become a vertex.
#[derive(Clone, Copy)]
struct Point {
    uv: Vec2,
    /// In unit space.
    at: Vec3,
    index: u32,
}

/// The middle of an edge that leaves its surface.
struct Bend {
    uv: Vec2,
    /// On the surface, in unit space.
    at: Vec3,
}

/// What the triangles of one leaf have in common.
struct Look<'a> {
    leaf: u32,
    surface: u32,
    geometry: &'a Geometry,
    back: bool,
    /// Whether triangles that run counter-clockwise in (u, v) are seen so from the side that is shown.
    counter_clockwise: bool,
    /// Whether what is behind them is black.
    black_behind: bool,
    glossy: bool,
    tint: Rgb,
    emission: Rgb,
    /// 0 without texture, else one more than the texture's index.
    batch: usize,
    /// Whether tint or texture coordinates vary over the surface.
    varies: bool,
}

/// Triangles and their leaves.
#[derive(Clone, Default)]
struct Triangles {
    indices: Vec<u32>,
    leaves: Vec<u32>,
}

impl Triangles {
    fn push(&mut self, corners: [u32; 3], leaf: u32) {
        self.indices.extend(corners);
        self.leaves.push(leaf);
    }
}

struct Maker<'a> {
    scene: &'a Scene,
    solution: &'a Solution<GlossyField>,
    roundness: Roundness,
    mesh: DisplayMesh,
    sources: Vec<Source>,
    /// Triangles per batch.
    batches: Vec<Triangles>,
    /// Of each material: 0, or one more than the index of its texture.
    texture_of: Vec<usize>,
    /// Vertex of each of the solution's vertices on fronts and on backs.
    plain: Vec<[u32; 2]>,
    /// The same where attributes vary, by surface and side.
    varied: HashMap<(u32, u32, bool), u32>,
    /// Vertices on cut edges, by place, surface and side.
    cut: HashMap<([u32; 3], u32, bool), u32>,
    /// Black vertex behind a vertex.
    behind: HashMap<u32, u32>,
}

impl<'a> Maker<'a> {
    fn new(scene: &'a Scene, solution: &'a Solution<GlossyField>, roundness: Roundness) -> Self {
        let mut textures: Vec<Texture> = Vec::new();
        let texture_of = scene.materials.iter().map(|material| {
            let Some(texture) = &material.texture else { return 0 };
            let same = |t: &Texture| {
                Arc::ptr_eq(&t.texels, &texture.texels) && t.transform == texture.transform && t.wrap == texture.wrap
            };
            1 + textures.iter().position(same).unwrap_or_else(|| {
                textures.push(texture.clone());
                textures.len() - 1
            })
        });
        let texture_of: Vec<usize> = texture_of.collect();
        let (low, high) = scene.bounds().unwrap_or((DVec3::ZERO, DVec3::ZERO));
        let origin = low + 0.5 * (high - low);
        let mesh = DisplayMesh { origin, primaries: scene.primaries, ..DisplayMesh::default() };
        Self {
            scene,
            solution,
            roundness,
            batches: vec![Triangles::default(); textures.len() + 1],
            mesh: DisplayMesh { textures, ..mesh },
            sources: Vec::new(),
            texture_of,
            plain: vec![[NONE; 2]; solution.vertices.positions.len()],
            varied: HashMap::new(),
            cut: HashMap::new(),
            behind: HashMap::new(),
        }
    }

    /// The fans of a leaf.
    fn leaf(&mut self, leaf: u32) {
        let solution = self.solution;
        let element = &solution.elements.nodes[leaf as usize];
        let (surface, back) = (element.source, element.kind == Kind::Back);
        let geometry = &solution.scene.surfaces()[surface as usize];
        let material = &self.scene.materials[element.material as usize];
        let varies = self.scene.attributes_of(surface).is_some();
        let look = Look {
            leaf,
            surface,
            geometry,
            back,
            counter_clockwise: runs_counter_clockwise(geometry) != back,
            black_behind: is_round(geometry)
                && !is_closed(&self.scene.surfaces[surface as usize])
                && solution.elements.surface_nodes[surface as usize][1] == NONE,
            glossy: element.active,
            tint: material.reflector.diffuse() * FRAC_1_PI,
            emission: if back { Rgb::ZERO } else { material.exitance * FRAC_1_PI },
            batch: if varies { self.texture_of[element.material as usize] } else { 0 },
            varies,
        };
        for (middle, outline) in solution.vertices.fans(leaf).filter_map(<[Corner]>::split_first) {
            if is_round(geometry) {
                self.round_part(&look, outline);
                continue;
            }
            let middle = self.vertex(&look, middle.vertex, middle.uv);
            let outline: Vec<u32> = outline.iter().map(|c| self.vertex(&look, c.vertex, c.uv)).collect();
            for (i, &a) in outline.iter().enumerate() {
                self.emit(&look, [middle, a, outline[(i + 1) % outline.len()]]);
            }
        }
    }

    /// A part of a leaf of a curved surface: its outline, cut where its edges leave the surface, a grid within, and a strip of
    /// triangles between them.
    fn round_part(&mut self, look: &Look, outline: &[Corner]) {
        let solution = self.solution;
        let ends = |(low, high): (Vec2, Vec2), corner: &Corner| (low.min(corner.uv), high.max(corner.uv));
        let (low, high) = outline.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), ends);
        let domain = Domain { u0: low.x, v0: low.y, u1: high.x, v1: high.y };
        // Of an edge that is one point, such as a pole, the ends are enough.
        let inner = |i: usize| {
            let corner = &outline[i];
            let beside = [outline[(i + outline.len() - 1) % outline.len()], outline[(i + 1) % outline.len()]];
            beside.iter().all(|next| {
                let between = look.geometry.point(0.5 * (corner.uv + next.uv));
                next.vertex == corner.vertex
                    && between.distance(solution.vertices.positions[corner.vertex as usize]) < NEGLIGIBLE
            })
        };
        let corners: Vec<Point> =
            (0..outline.len()).filter(|&i| !inner(i)).map(|i| self.point(look, &outline[i])).collect();
        let mut edge = Vec::new();
        for (i, a) in corners.iter().enumerate() {
            self.cut(look, *a, corners[(i + 1) % corners.len()], MOST_CUTS, &mut edge);
        }
        let mut outer: Vec<(f32, u32)> = edge.iter().map(|point| (around(&domain, point.uv), point.index)).collect();
        outer.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [columns, rows] = [self.steps(look, &domain, true), self.steps(look, &domain, false)];
        // Points between the steps; one at least.
        let [across, along] = [columns, rows].map(|steps| steps.max(2) - 1);
        let mut grid = Vec::new();
        for j in 1..=along {
            for i in 1..=across {
                let share = |i: u32, count: u32| i as f32 / (count + 1) as f32;
                grid.push(self.interior(look, domain.lerp(share(i, across), share(j, along))));
            }
        }
        let at = |i: u32, j: u32| grid[(j * across + i) as usize];
        for j in 1..along {
            for i in 1..across {
                let [a, b, c, d] = [at(i - 1, j - 1), at(i, j - 1), at(i, j), at(i - 1, j)];
                self.emit(look, [a, b, c]);
                self.emit(look, [a, c, d]);
            }
        }
        // The grid's edge, counter-clockwise like the outline.
        let share = |i: u32, count: u32| if count > 1 { i as f32 / (count - 1) as f32 } else { 0.0 };
        let bottom = (0..across).map(|i| (share(i, across), at(i, 0)));
        let right = (0..along).map(|j| (1.0 + share(j, along), at(across - 1, j)));
        let top = (0..across).rev().map(|i| (3.0 - share(i, across), at(i, along - 1)));
        let left = (0..along).rev().map(|j| (4.0 - share(j, along), at(0, j)));
        let ring: Vec<(f32, u32)> = bottom.chain(right).chain(top).chain(left).collect();
        self.strip(look, &outer, &ring);
    }

    /// Triangles between two closed rings, whose points ascend around the domain.
    fn strip(&mut self, look: &Look, outer: &[(f32, u32)], inner: &[(f32, u32)]) {
        let (Some(&(_, first)), Some(&(_, within))) = (outer.first(), inner.first()) else { return };
        let (mut i, mut j) = (1, 1);
        let (mut a, mut b) = (first, within);
        while i <= outer.len() || j <= inner.len() {
            let end = |ring: &[(f32, u32)], at: usize, close: u32| match ring.get(at) {
                Some(&next) => Some(next),
                None => (at == ring.len()).then_some((4.0, close)),
            };
            let (out, in_) = (end(outer, i, first), end(inner, j, within));
            // The outline goes first: at a corner the strip turns about the grid's.
            if let Some((_, next)) = out.filter(|o| in_.is_none_or(|n| o.0 <= n.0)) {
                self.emit(look, [a, next, b]);
                (a, i) = (next, i + 1);
            } else if let Some((_, next)) = in_ {
                self.emit(look, [a, next, b]);
                (b, j) = (next, j + 1);
            }
        }
    }

    /// The points of an edge, its end left out.
    fn cut(&mut self, look: &Look, a: Point, b: Point, cuts: u32, out: &mut Vec<Point>) {
        match self.bend(look, &a, &b).filter(|_| cuts > 0) {
            Some(bend) => {
                let middle = self.middle(look, &bend);
                self.cut(look, a, middle, cuts - 1, out);
                self.cut(look, middle, b, cuts - 1, out);
            }
            None => out.push(a),
        }
    }

    /// Into how many steps, a power of two, the domain's lines along u or v are cut.
    fn steps(&self, look: &Look, domain: &Domain, along_u: bool) -> u32 {
        let leaves = |across: f32, steps: u32| {
            let ends = [0.0, 1.0 / steps as f32].map(|share| {
                let uv = if along_u { domain.lerp(share, across) } else { domain.lerp(across, share) };
                Point { uv, at: look.geometry.point(uv), index: NONE }
            });
            self.bend(look, &ends[0], &ends[1]).is_some()
        };
        let mut steps = 1;
        while steps < 1 << MOST_CUTS && [0.0, 0.5, 1.0].iter().any(|&across| leaves(across, steps)) {
            steps *= 2;
        }
        steps
    }

    fn point(&mut self, look: &Look, corner: &Corner) -> Point {
        let at = self.solution.vertices.positions[corner.vertex as usize];
        Point { uv: corner.uv, at, index: self.vertex(look, corner.vertex, corner.uv) }
    }

    /// How an edge leaves the surface; `None` where that is little enough.
    fn bend(&self, look: &Look, a: &Point, b: &Point) -> Option<Bend> {
        let mut uv = 0.5 * (a.uv + b.uv);
        // From a pole all directions are meridians; it is at any u.
        if is_pole(look.geometry, a.uv) {
            uv.x = b.uv.x;
        } else if is_pole(look.geometry, b.uv) {
            uv.x = a.uv.x;
        }
        let at = look.geometry.point(uv);
        let (chord, off) = (b.at - a.at, at - a.at);
        let length = chord.length();
        let distance =
            if length > 0.0 { (off - chord * (off.dot(chord) / (length * length))).length() } else { off.length() };
        // An arc of a small angle t over a chord of length 1 is t/8 high.
        let angle = if length > 0.0 { 8.0 * distance / length } else { f32::INFINITY };
        let Roundness { fine, flat_enough, coarse, glossy } = self.roundness;
        let most = match (distance < flat_enough, look.glossy) {
            (false, _) => fine,
            (true, true) => glossy,
            (true, false) => coarse,
        };
        let much = distance >= NEGLIGIBLE && angle >= most;
        much.then_some(Bend { uv, at })
    }

    /// The vertex in the middle of an edge that is cut.
    fn middle(&mut self, look: &Look, &Bend { uv, at }: &Bend) -> Point {
        // Adding zero makes −0 the same as 0.
        let key = ((at + Vec3::ZERO).to_array().map(f32::to_bits), look.surface, look.back);
        let index = match self.cut.get(&key) {
            Some(&index) => index,
            None => {
                let index = self.interior(look, uv);
                self.cut.insert(key, index);
                index
            }
        };
        Point { uv, at, index }
    }

    /// A vertex somewhere on the leaf.
    fn interior(&mut self, look: &Look, uv: Vec2) -> u32 {
        let corners = self.solution.vertices.interpolation(look.leaf, uv);
        let irradiance = &self.solution.vertices.irradiance;
        let light = corners.iter().map(|&(vertex, weight)| irradiance[vertex as usize] * weight).sum();
        let side = if look.back { -1.0 } else { 1.0 };
        let normal = self.solution.scene.shading_normal(look.surface, uv) * side;
        let at = look.geometry.point(uv);
        self.add(look, at, normal, light, Source { leaf: look.leaf, uv, corners })
    }

    /// Counter-clockwise in (u, v).
    fn emit(&mut self, look: &Look, [a, b, c]: [u32; 3]) {
        if a == b || b == c || c == a {
            return;
        }
        let corners = if look.counter_clockwise { [a, b, c] } else { [a, c, b] };
        self.batches[look.batch].push(corners, look.leaf);
        // A sliver beside a pole may be folded over, within the tolerance; its black behind would be in front.
        let [p, q, r] = corners.map(|vertex| self.mesh.positions[vertex as usize]);
        let faces = (q - p).cross(r - p).dot(self.mesh.normals[corners[0] as usize]) > 0.0;
        if look.black_behind && faces {
            let [a, b, c] = corners.map(|vertex| self.black_behind(vertex));
            self.batches[0].push([a, c, b], NO_LEAF);
        }
    }

    /// The vertex that stands for one of the solution's.
    fn vertex(&mut self, look: &Look, vertex: u32, uv: Vec2) -> u32 {
        let known = if look.varies {
            self.varied.get(&(vertex, look.surface, look.back)).copied().unwrap_or(NONE)
        } else {
            self.plain[vertex as usize][usize::from(look.back)]
        };
        if known != NONE {
            return known;
        }
        let vertices = &self.solution.vertices;
        let at = vertex as usize;
        let source = Source { leaf: look.leaf, uv, corners: [(vertex, 1.0), (vertex, 0.0), (vertex, 0.0)] };
        let index = self.add(look, vertices.positions[at], vertices.normals[at], vertices.irradiance[at], source);
        if look.varies {
            self.varied.insert((vertex, look.surface, look.back), index);
        } else {
            self.plain[at][usize::from(look.back)] = index;
        }
        index
    }

    fn add(&mut self, look: &Look, at: Vec3, normal: Vec3, irradiance: Rgb, source: Source) -> u32 {
        let (mut tint, mut uv) = (look.tint, Vec2::ZERO);
        if let Some(attributes) = self.scene.attributes_of(look.surface) {
            let surface = &self.scene.surfaces[look.surface as usize];
            let material = &self.scene.materials[surface.material as usize];
            let color = material.base_color * attributes.color_at(&surface.shape, source.uv.x, source.uv.y);
            tint = self.scene.diffuse_of(look.surface, color) * FRAC_1_PI;
            uv = attributes.uv_at(&surface.shape, source.uv.x, source.uv.y);
        }
        let index = self.push(at, normal);
        self.mesh.irradiance.push(irradiance);
        self.mesh.tint.push(tint);
        self.mesh.emission.push(look.emission);
        self.mesh.uv.push(uv);
        if look.glossy {
            self.mesh.glossy.push(index);
            self.sources.push(source);
        }
        index
    }

    /// The black vertex behind a vertex.
    fn black_behind(&mut self, vertex: u32) -> u32 {
        if let Some(&known) = self.behind.get(&vertex) {
            return known;
        }
        let (position, normal) = (self.mesh.positions[vertex as usize], self.mesh.normals[vertex as usize]);
        let index = self.mesh.positions.len() as u32;
        self.mesh.positions.push(position);
        self.mesh.normals.push(-normal);
        self.black();
        self.behind.insert(vertex, index);
        index
    }

    /// The back of a polygon that absorbs there: black, and opaque. Round ones take the triangles of their front, so
    /// that no rim of black sticks out from behind it.
    fn black_back(&mut self, surface: u32) {
        let geometry = &self.solution.scene.surfaces()[surface as usize];
        if self.solution.elements.surface_nodes[surface as usize][1] != NONE || is_round(geometry) {
            return;
        }
        let corners: Vec<u32> = geometry
            .corners(Domain::WHOLE)
            .into_iter()
            .map(|uv| {
                let index = self.push(geometry.point(uv), -geometry.normal(uv));
                self.black();
                index
            })
            .collect();
        let forward = !runs_counter_clockwise(geometry);
        for i in 1..corners.len() - 1 {
            let [a, b, c] = [corners[0], corners[i], corners[i + 1]];
            self.batches[0].push(if forward { [a, b, c] } else { [a, c, b] }, NO_LEAF);
        }
    }

    fn push(&mut self, at: Vec3, normal: Vec3) -> u32 {
        let index = self.mesh.positions.len() as u32;
        let position = self.solution.scene.normalization.to_scene(at) - self.mesh.origin;
        self.mesh.positions.push(position.as_vec3());
        self.mesh.normals.push(normal);
        index
    }

    fn black(&mut self) {
        self.mesh.irradiance.push(Rgb::ZERO);
        self.mesh.tint.push(Rgb::ZERO);
        self.mesh.emission.push(Rgb::ZERO);
        self.mesh.uv.push(Vec2::ZERO);
    }

    fn finish(self) -> Facets {
        let (mut mesh, mut leaves) = (self.mesh, Vec::new());
        for (batch, mut triangles) in self.batches.into_iter().enumerate() {
            let start = mesh.indices.len() as u32;
            mesh.indices.append(&mut triangles.indices);
            leaves.append(&mut triangles.leaves);
            let indices = start..mesh.indices.len() as u32;
            if !indices.is_empty() {
                mesh.batches.push(Batch { indices, texture: batch.checked_sub(1).map(|t| t as u32) });
            }
        }
        Facets { mesh, sources: self.sources, leaves }
    }
}

/// Where a point of a domain's outline is, going around it counter-clockwise from its first corner: 0…4.
fn around(domain: &Domain, uv: Vec2) -> f32 {
    let s = (uv.x - domain.u0) / (domain.u1 - domain.u0);
    let t = (uv.y - domain.v0) / (domain.v1 - domain.v0);
    let off = [t, 1.0 - s, 1.0 - t, s].map(f32::abs);
    let nearest = off.iter().copied().fold(f32::INFINITY, f32::min);
    // Corners belong to the side that begins there; the last one is the first.
    let is_on = |side: usize| off[side] <= nearest + ON_SIDE;
    if is_on(3) && !is_on(0) {
        4.0 - t
    } else if is_on(2) && !is_on(3) {
        3.0 - s
    } else if is_on(1) && !is_on(2) {
        1.0 + t
    } else {
        s
    }
}

/// Whether edges of parts may be round; a disk's outline is, though it is flat.
fn is_round(geometry: &Geometry) -> bool {
    matches!(geometry, Geometry::Revolution(_))
}

/// Whether the surface has the same point at all u.
fn is_pole(geometry: &Geometry, uv: Vec2) -> bool {
    let distance = |u: f32| geometry.point(uv).distance(geometry.point(Vec2::new(u, uv.y)));
    distance(uv.x + 0.25) < NEGLIGIBLE && distance(uv.x + 0.5) < NEGLIGIBLE
}

/// Whether a surface hides its own back, from everywhere but the inside of a solid.
fn is_closed(surface: &Surface) -> bool {
    !surface.flip && matches!(surface.shape, Shape::Sphere { .. } | Shape::Torus { .. })
}

/// Whether the front of a surface is where its (u, v) run counter-clockwise.
fn runs_counter_clockwise(geometry: &Geometry) -> bool {
    // Well inside of triangles, too, and far from poles and seams.
    let (at, step) = (Vec2::new(0.3, 0.4), 0.01);
    let origin = geometry.point(at);
    let along_u = geometry.point(at + Vec2::X * step) - origin;
    let along_v = geometry.point(at + Vec2::Y * step) - origin;
    Mat3::from_cols(along_u, along_v, geometry.normal(at)).determinant() > 0.0
}

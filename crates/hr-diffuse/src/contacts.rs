//! Contacts: where one surface stands on another, light ends at a line.
//!
//! A wall is bright above a shelf and dark below it. Values at the corners of leaves are drawn out across that line, however
//! small the leaves are, as teeth of light. So what is shown of a leaf is cut along the lines in which other polygons meet it, and
//! each part gathers at vertices of its own (discontinuities of degree 0: P. Heckbert, "Discontinuity meshing for radiosity",
//! Eurographics Workshop on Rendering 1992). Light travels between whole leaves as before.
//!
//! The floors of two rooms may be two polygons that end at the wall between them: there nothing is cut, but leaves on one side of the
//! wall share no vertices with those on the other.
//!
//! The shadow of a light without extent ends at a line as well ([`shadow_lines`]).

mod shadow_lines;

use crate::geometry::Geometry;
use crate::hierarchy::{Element, Elements, SceneData};
use crate::hooks::LightField;
use crate::sealed::outward;
use crate::threads;
use crate::transport::Light;
use crate::vertices::{Corner, INSET, Layout, Outline, Vertices};
use crate::visibility::Region;
use glam::{Vec2, Vec3};
use shadow_lines::ShadowLines;
use smallvec::{SmallVec, smallvec};
use std::collections::HashMap;

/// What stands above a leaf by less than this share of its radius …
const GAP: f32 = 0.15;
/// … and by less than this, in unit space, touches it.
const MOST_GAP: f32 = 0.01;
/// A line counts from this share of a leaf's radius, …
const LONG: f32 = 0.06;
/// … and corners nearer than this share lie on it.
const ON: f32 = 0.04;
/// Polygons whose normals' cosine is larger than this lie in one plane.
const PARALLEL: f32 = 0.97;
/// Most lines that cut a leaf.
const MOST_LINES: usize = 4;
/// How far beyond a line a vertex gathers, as a share of the way to the middle of its part.
const BEYOND: f32 = 0.05;

/// The plane of a polygon that meets a leaf. Of the two normals it has the one with the first positive component, so that
/// the parts of a larger polygon agree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    normal: Vec3,
    height: f32,
    /// Whether all of the leaf's surface is on one side of it.
    pub(crate) beside: bool,
}

impl Contact {
    /// The plane through a line in one with a normal, at right angles to that; none where the line is a point.
    fn through([from, to]: [Vec3; 2], normal: Vec3) -> Option<Self> {
        let across = normal.cross(to - from).try_normalize()?;
        Some(Self { normal: across, height: from.dot(across), beside: false }.turned())
    }

    /// The same, of the two normals that it may have with the one that all have.
    fn turned(self) -> Self {
        let sign = self.normal.to_array().into_iter().find(|c| c.abs() > 1e-3).map_or(1.0, f32::signum);
        Self { normal: self.normal * sign, height: self.height * sign, ..self }
    }

    /// Whether another one is the same for a leaf with these corners, to `near`.
    fn is_like(&self, other: &Self, corners: &[Vec3], near: f32) -> bool {
        self.normal.dot(other.normal) > PARALLEL
            && corners.iter().all(|x| (self.above(*x) - other.above(*x)).abs() < near)
    }

    /// How far in front of the plane a point is.
    fn above(&self, x: Vec3) -> f32 {
        x.dot(self.normal) - self.height
    }
}

/// What meets the leaves of a scene: nothing, for most of them.
#[derive(Debug, Default)]
pub(crate) struct Contacts {
    of: HashMap<u32, SmallVec<[Contact; MOST_LINES]>>,
    /// Rays that were shot to find them.
    pub(crate) rays: u64,
}

impl Contacts {
    /// Finds what meets each leaf, and where shadows end on it.
    pub(crate) fn new<L: LightField>(light: Light<'_, L>, layout: &Layout) -> Self {
        let Light { scene, elements, .. } = light;
        let look = |(leaf, _): &(u32, Outline)| contacts(scene, elements, *leaf);
        let mut found = threads::map(&layout.parts, 64, look);
        part(elements, layout, &mut found);
        let shadows = ShadowLines::new(light);
        let add = |part: usize, contacts: &mut SmallVec<[Contact; MOST_LINES]>| {
            let (leaf, outline) = &layout.parts[part];
            let (lines, rays) = shadows.on(*leaf, outline);
            if lines.is_empty() {
                return rays;
            }
            let at = |corner: &Corner| layout.vertices.positions[corner.vertex as usize];
            let corners: SmallVec<[Vec3; 12]> = outline.iter().map(at).collect();
            let near = ON * elements.nodes[*leaf as usize].radius;
            for line in lines {
                if contacts.len() < MOST_LINES && !contacts.iter().any(|other| line.is_like(other, &corners, near)) {
                    contacts.push(line);
                }
            }
            rays
        };
        let rays = threads::map_mut(&mut found, 64, add).into_iter().sum();
        let of = layout.parts.iter().map(|(leaf, _)| *leaf).zip(found);
        Self { of: of.filter(|(_, contacts)| !contacts.is_empty()).collect(), rays }
    }

    /// Cuts leaves along the lines.
    pub(crate) fn cut(&self, elements: &Elements, layout: &mut Layout) {
        if self.of.is_empty() {
            return;
        }
        let Layout { vertices, parts } = layout;
        let (beside, like, on_edge) = (HashMap::new(), HashMap::new(), HashMap::new());
        let mut cuts = Cuts { elements, vertices, beside, like, on_edge };
        for (leaf, outline) in std::mem::take(parts) {
            let mut pieces: SmallVec<[Outline; 2]> = smallvec![outline];
            for contact in self.of.get(&leaf).into_iter().flatten() {
                pieces = pieces.into_iter().flat_map(|piece| cuts.cut(leaf, piece, contact)).collect();
            }
            parts.extend(pieces.into_iter().map(|piece| (leaf, piece)));
        }
        parts.iter_mut().for_each(|(_, part)| cuts.close(part));
    }

    /// Where the light of each vertex is gathered, in the parameters of its leaf.
    pub(crate) fn places(&self, elements: &Elements, vertices: &Vertices) -> Vec<Vec2> {
        let mut places = vertices.uv.clone();
        for leaf in elements.patch_leaves() {
            for (middle, outline) in vertices.fans(leaf).filter_map(<[Corner]>::split_first) {
                for corner in outline.iter().filter(|corner| vertices.leaf[corner.vertex as usize] == leaf) {
                    places[corner.vertex as usize] = self.place(vertices, leaf, [middle, corner]);
                }
            }
        }
        places
    }

    /// Where it may be gathered instead, on other leaves around.
    pub(crate) fn places_around(&self, vertices: &Vertices, vertex: u32) -> SmallVec<[(u32, Vec2); 8]> {
        let others = vertices.leaves_around(vertex).iter().filter(|&&leaf| leaf != vertices.leaf[vertex as usize]);
        let on_leaf = |&leaf: &u32| {
            let fans = vertices.fans(leaf).filter_map(<[Corner]>::split_first);
            let with_vertex = fans.filter_map(move |(middle, outline)| {
                outline.iter().find(|corner| corner.vertex == vertex).map(|corner| [middle, corner])
            });
            with_vertex.map(move |ends| (leaf, self.place(vertices, leaf, ends)))
        };
        others.flat_map(on_leaf).collect()
    }

    /// A little toward the middle of a part of a leaf from a corner of it, and to its side of what meets the leaf.
    fn place(&self, vertices: &Vertices, leaf: u32, [middle, corner]: [&Corner; 2]) -> Vec2 {
        let mut share = INSET;
        for contact in self.of.get(&leaf).into_iter().flatten() {
            let [from, to] = [corner, middle].map(|at| contact.above(vertices.positions[at.vertex as usize]));
            let crosses = (from / (from - to)).clamp(0.0, 1.0 - BEYOND);
            if from.abs() < to.abs() && crosses.is_finite() {
                share = share.max(BEYOND + if from * to < 0.0 { crosses } else { 0.0 });
            }
        }
        corner.uv.lerp(middle.uv, share)
    }
}

/// Of what leaves lie beside, keeps what parts them from others: leaves on its other side that share a vertex with them. By leaf of the
/// layout.
fn part(elements: &Elements, layout: &Layout, found: &mut [SmallVec<[Contact; MOST_LINES]>]) {
    let positions = &layout.vertices.positions;
    let is_on = |leaf: u32, contact: &Contact, corner: &Corner| {
        let near = ON * elements.nodes[leaf as usize].radius;
        contact.above(positions[corner.vertex as usize]).abs() <= near
    };
    let mut asked = vec![false; positions.len()];
    for ((leaf, outline), contacts) in layout.parts.iter().zip(&*found) {
        for contact in contacts.iter().filter(|contact| contact.beside) {
            let on_line = outline.iter().filter(|corner| is_on(*leaf, contact, corner));
            on_line.for_each(|corner| asked[corner.vertex as usize] = true);
        }
    }
    let asking = |(leaf, outline): &(u32, Outline)| {
        let vertices: SmallVec<[u32; 12]> =
            outline.iter().map(|corner| corner.vertex).filter(|&vertex| asked[vertex as usize]).collect();
        let leaf = *leaf;
        vertices.into_iter().map(move |vertex| (vertex, leaf))
    };
    let mut around: Vec<(u32, u32)> = layout.parts.iter().flat_map(asking).collect();
    around.sort_unstable();
    for ((leaf, outline), contacts) in layout.parts.iter().zip(found) {
        let middle = |leaf: u32| elements.nodes[leaf as usize].center;
        let parts = |contact: &Contact, vertex: u32| {
            let leaves = &around[around.partition_point(|of| of.0 < vertex)..];
            let mine = contact.above(middle(*leaf));
            let mut leaves = leaves.iter().take_while(|of| of.0 == vertex);
            leaves.any(|&(_, other)| contact.above(middle(other)) * mine < 0.0)
        };
        contacts.retain(|contact| {
            let mut on_line = outline.iter().filter(|corner| is_on(*leaf, contact, corner));
            !contact.beside || on_line.any(|corner| parts(contact, corner.vertex))
        });
    }
}

/// What meets a leaf.
fn contacts(scene: &SceneData, elements: &Elements, leaf: u32) -> SmallVec<[Contact; MOST_LINES]> {
    let element = &elements.nodes[leaf as usize];
    let geometry = &scene.surfaces()[element.source as usize];
    let mut found: SmallVec<[(u32, Contact); MOST_LINES]> = SmallVec::new();
    if !geometry.is_polygon() || element.importance <= 0.0 {
        return SmallVec::new();
    }
    let normal = element.normals.axis;
    let height = geometry.point(Vec2::ZERO).dot(normal);
    let gap = (GAP * element.radius).min(MOST_GAP);
    let region =
        Region { bounds: geometry.bounds(element.domain).padded(gap), normal, heights: [height - gap, height + gap] };
    let outline: SmallVec<[Vec3; 4]> = geometry.corners(element.domain).iter().map(|uv| geometry.point(*uv)).collect();
    scene.visibility.any_in(&region, |other| {
        let surface = &scene.surfaces()[other as usize];
        if other != element.source
            && let Some(contact) = contact(surface, geometry, (normal, ON * element.radius))
            && let Some(line) = section(surface, normal, height + gap)
            && length_within(line, (&outline, contact.beside), normal, element) > LONG * element.radius
        {
            found.push((other, contact));
        }
        false
    });
    // Two triangles of one polygon are in the same plane.
    found.sort_by_key(|(other, contact)| (contact.beside, *other));
    let mut contacts: SmallVec<[Contact; MOST_LINES]> = SmallVec::new();
    for (_, contact) in found {
        let near = ON * element.radius;
        if contacts.len() < MOST_LINES && !contacts.iter().any(|other| contact.is_like(other, &outline, near)) {
            contacts.push(contact);
        }
    }
    contacts
}

/// The plane of a polygon that is not parallel to one with a normal, which may lie beside it, as walls beside floors do: no more than
/// `near` of that is beyond.
pub(crate) fn contact(surface: &Geometry, geometry: &Geometry, (normal, near): (Vec3, f32)) -> Option<Contact> {
    let plane = surface.is_polygon().then(|| outward(surface, 0))?;
    let [low, high] = geometry.heights(plane)?;
    let height = surface.point(Vec2::ZERO).dot(plane);
    if plane.dot(normal).abs() > PARALLEL {
        return None;
    }
    let beside = low > height - near || high < height + near;
    Some(Contact { normal: plane, height, beside }.turned())
}

/// Where a polygon that reaches down to a height along a direction, or below it, is cut by the plane there.
pub(crate) fn section(surface: &Geometry, direction: Vec3, height: f32) -> Option<[Vec3; 2]> {
    let points = surface.polygon()?;
    let mut ends: SmallVec<[Vec3; 2]> = SmallVec::new();
    for (i, &a) in points.iter().enumerate() {
        let b = points[(i + 1) % points.len()];
        let [from, to] = [a, b].map(|x| x.dot(direction) - height);
        if (from < 0.0) != (to < 0.0) {
            ends.push(a.lerp(b, from / (from - to)));
        }
    }
    ends.get(..2).map(|ends| [ends[0], ends[1]])
}

/// How much of a line lies within the convex outline of an element, or on its edge where it may be `beside` it, seen along its normal.
pub(crate) fn length_within(
    [from, to]: [Vec3; 2],
    (outline, beside): (&[Vec3], bool),
    normal: Vec3,
    element: &Element,
) -> f32 {
    let (mut first, mut last) = (0.0_f32, 1.0_f32);
    for (i, &a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        let inward = normal.cross(b - a);
        let inward = if inward.dot(element.center - a) < 0.0 { -inward } else { inward };
        let slack = if beside { ON * element.radius * inward.length() } else { 0.0 };
        let [start, end] = [from, to].map(|x| inward.dot(x - a) + slack);
        match (start < 0.0, end < 0.0) {
            (true, true) => return 0.0,
            (true, false) => first = first.max(start / (start - end)),
            (false, true) => last = last.min(start / (start - end)),
            (false, false) => {}
        }
    }
    (last - first).max(0.0) * from.distance(to)
}

/// Cuts leaves. Leaves beside each other share the vertices on lines.
struct Cuts<'a> {
    elements: &'a Elements,
    vertices: &'a mut Vertices,
    /// By vertex, plane and side, its like on a side of a line through it.
    beside: HashMap<(u32, [i8; 3], bool), u32>,
    /// And by those, the vertex that they are like.
    like: HashMap<u32, u32>,
    /// By the edge's end on the same side and its other end.
    on_edge: HashMap<(u32, u32), u32>,
}

impl Cuts<'_> {
    /// The parts of an outline on both sides of a line.
    fn cut(&mut self, leaf: u32, outline: Outline, contact: &Contact) -> SmallVec<[Outline; 2]> {
        let near = ON * self.elements.nodes[leaf as usize].radius;
        let heights = outline.iter().map(|corner| contact.above(self.vertices.positions[corner.vertex as usize]));
        let heights: SmallVec<[f32; 12]> = heights.map(|above| if above.abs() <= near { 0.0 } else { above }).collect();
        let mut parts: SmallVec<[Outline; 2]> = SmallVec::new();
        for front in [true, false] {
            let is_mine = |above: f32| if front { above > 0.0 } else { above < 0.0 };
            if !heights.iter().any(|&above| is_mine(above)) {
                continue;
            }
            let mut part = Outline::new();
            for (i, a) in outline.iter().enumerate() {
                let next = (i + 1) % outline.len();
                let (b, from, to) = (&outline[next], heights[i], heights[next]);
                if is_mine(from) {
                    part.push(*a);
                } else if from == 0.0 {
                    part.push(Corner { vertex: self.beside(leaf, a, contact, front), uv: a.uv });
                }
                if from * to < 0.0 {
                    part.push(self.between(leaf, if is_mine(from) { [a, b] } else { [b, a] }, contact));
                }
            }
            parts.push(part);
        }
        if parts.is_empty() { smallvec![outline] } else { parts }
    }

    /// The like of a corner on one side of a line through it.
    fn beside(&mut self, leaf: u32, corner: &Corner, contact: &Contact, front: bool) -> u32 {
        let at = corner.vertex as usize;
        let like = (self.vertices.positions[at], self.vertices.normals[at]);
        let plane = contact.normal.to_array().map(|c| (c * 60.0).round() as i8);
        let next = || self.vertices.add(like, leaf, corner.uv);
        let vertex = *self.beside.entry((corner.vertex, plane, front)).or_insert_with(next);
        self.like.insert(vertex, corner.vertex);
        self.vertices.of_smallest(self.elements, vertex, leaf, corner.uv);
        vertex
    }

    /// The vertex where a line crosses an edge, for the part on the side of the edge's first corner.
    fn between(&mut self, leaf: u32, [mine, other]: [&Corner; 2], contact: &Contact) -> Corner {
        // From the same end on whichever side, so that no crack opens.
        let [a, b] = if mine.vertex < other.vertex { [mine, other] } else { [other, mine] };
        let [from, to] = [a, b].map(|corner| contact.above(self.vertices.positions[corner.vertex as usize]));
        let share = from / (from - to);
        let mix = |values: &[Vec3]| values[a.vertex as usize].lerp(values[b.vertex as usize], share);
        let normal = mix(&self.vertices.normals).normalize_or(self.vertices.normals[a.vertex as usize]);
        let (like, uv) = ((mix(&self.vertices.positions), normal), a.uv.lerp(b.uv, share));
        let next = || self.vertices.add(like, leaf, uv);
        let vertex = *self.on_edge.entry((mine.vertex, other.vertex)).or_insert_with(next);
        self.vertices.of_smallest(self.elements, vertex, leaf, uv);
        Corner { vertex, uv }
    }

    /// Puts the vertices into a part's outline that leaves beside it have on its edges: else what is shown would end there in steps.
    fn close(&self, part: &mut Outline) {
        let mut closed = Outline::new();
        for (i, a) in part.iter().enumerate() {
            let b = &part[(i + 1) % part.len()];
            closed.push(*a);
            let [from, to] = [a, b].map(|corner| self.like.get(&corner.vertex).copied());
            let ends = (from.unwrap_or(a.vertex), to.unwrap_or(b.vertex));
            // Beyond the line the other leaf has is what this one ends at.
            let mine = if from.is_some() { (ends.1, ends.0) } else { ends };
            let found = self.on_edge.get(&mine).or_else(|| self.on_edge.get(&(mine.1, mine.0)));
            let Some(&vertex) = found.filter(|&&vertex| vertex != a.vertex && vertex != b.vertex) else { continue };
            let [start, at, end] = [a.vertex, vertex, b.vertex].map(|vertex| self.vertices.positions[vertex as usize]);
            let share = start.distance(at) / start.distance(end);
            if share > 0.0 && share < 1.0 {
                closed.push(Corner { vertex, uv: a.uv.lerp(b.uv, share) });
            }
        }
        *part = closed;
    }
}

//! The adaptive Haar basis on the octahedron (paper, section 4.2): what a surface element or a cluster sends out, by
//! direction.
//!
//! The sphere of directions is an octahedron with its corners on the main axes of world space, each face divided in
//! four recursively, finer where the function varies ([`Haar::project`]). Triangles that share an edge differ by at
//! most one level. Values are kept at the corners of the triangles and interpolated linearly, so that
//! [`Haar::eval`] is continuous over the whole sphere: where a triangle borders a finer one, the value at the middle
//! of the common edge belongs to both.
//!
//! ```
//! use glam::Vec3;
//! use glossy_ext::haar::{Haar, Known, Peak, Refinement};
//!
//! // A lobe about 6° wide, and the direction in which it must not be missed.
//! let axis = Vec3::new(0.3, -0.2, 0.9).normalize();
//! let lobe = |d: Vec3| Vec3::splat(d.dot(axis).max(0.0).powi(200));
//! let peaks = [Peak { direction: axis, width: 0.1 }];
//! let made = Haar::project(&Refinement::default(), &Known { peaks: &peaks, ..Known::NOTHING }, lobe);
//! assert!((made.distribution.eval(axis).x - 1.0).abs() < 0.05);
//! assert!(made.distribution.eval(-axis).x < 1e-3);
//! ```
//!
//! # Triangles
//! A direction d is parametrised by the point p = d / (|x| + |y| + |z|) of the octahedron's surface. Triangles are
//! subdivided at the midpoints of that *flat* surface: corners are dyadic fractions, exact in `f32`; finding the
//! triangle of a direction takes only doublings of barycentric coordinates; and the solid angles of the triangles
//! of one level differ by no more than the Jacobian 1/(√3 |p|³), a factor of 5.2 between a corner of the octahedron
//! and the middle of a face.
//!
//! # Layout
//! A *basis function* is one undivided triangle ([`Haar::basis_functions`]). At rest a distribution is an array of
//! vertex values (three half floats relative to a scale of the whole distribution: 2⁻¹¹ relative precision, values
//! below 2⁻²⁹ of the largest component are zero) and an array of nodes: one for each divided triangle,
//! holding the vertices in the middle of its edges and where its children's nodes are, and one for each undivided
//! triangle beside a finer one, holding the midpoints that it shares. Nodes take as many bits as their indices need, in whole
//! bytes: 4 or 5 in small distributions, 8 in the largest. Undivided triangles need no storage of their own and there is half
//! a vertex to each, so that 5 to 7 bytes are used per basis function. The empty distribution, zero everywhere, allocates
//! nothing.
//!
//! # Limits
//! Magnitudes from 10⁻³⁰ to 10³⁷ are kept; what is larger may become 0, never infinite or not a number.
//!
//! Indices have up to 15 bits: a distribution has up to 24,576 vertices, about 49,000 basis functions (level 6 everywhere,
//! or finer in parts). Refinement stops there, coarse levels first, and says so ([`Projected::truncated`]).

mod combine;
mod integrals;
mod keep;
mod mesh;
mod nodes;
mod outline;
mod project;
mod terms;
#[cfg(test)]
mod tests;

pub use crate::basis::{Beyond, Known, Peak, Projected, Superposition, Support};
pub use outline::Outline;
pub use project::{Refinement, Refiner};

use crate::Rgb;
use crate::basis::Basis;
use crate::basis::half::{Half3, decode, encode, scale_for};
use crate::basis::triangle::{ConeTest, Overlap, PIECE_SPLITS, Triangle, child_corners, midpoints};
use glam::Vec3;
use hr_diffuse::Cone;
use nodes::{Layout, Node};

/// Deepest level of subdivision: triangles 0.02° across. Positions stay exact and barycentric coordinates, which
/// lose a bit per level, keep more than what half floats can show.
pub const MAX_LEVEL: u8 = 12;

/// Deepest level that may be asked for everywhere: 16,386 vertices, more would not fit.
pub const MAX_UNIFORM_LEVEL: u8 = 6;

/// A directional distribution of a signed RGB quantity over the sphere, in world space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Haar {
    /// What vertex values are multiplied by; ≥ 0.
    scale: f32,
    /// Bit f: face f has a node. The nodes of the faces come first, in order.
    roots: u8,
    /// The corners of the octahedron (+x, −x, +y, −y, +z, −z) come first. Empty: zero everywhere.
    vertices: Box<[Half3]>,
    layout: Layout,
    /// As the layout says.
    nodes: Box<[u8]>,
}

/// Face of the octahedron by its signs (bit 0: x < 0, bit 1: y < 0, bit 2: z < 0) → its corners.
fn face_corners(face: usize) -> [Vec3; 3] {
    let sign = |axis: usize| if face >> axis & 1 == 1 { -1.0 } else { 1.0 };
    [Vec3::X * sign(0), Vec3::Y * sign(1), Vec3::Z * sign(2)]
}

/// A triangle on the way down the tree.
#[derive(Clone, Copy)]
struct Visit {
    triangle: Triangle,
    vertices: [u16; 3],
    node: Option<usize>,
    level: u8,
    /// Among all triangles of its face: that is 0, and the parts of triangle i are 4i + 1 to 4i + 4.
    place: usize,
}

/// A triangle over which the quantity is linear, in units of the scale.
struct Piece {
    triangle: Triangle,
    /// As of a [`Visit`].
    place: usize,
    /// At its corners.
    values: [Rgb; 3],
}

impl Visit {
    /// The parts of a divided triangle that has this node.
    #[inline]
    fn children(&self, node: Node) -> [Self; 4] {
        let (triangles, mids) = (self.triangle.children(), node.mids());
        let child = |child: usize| Self {
            triangle: triangles[child],
            vertices: child_corners(self.vertices, mids, child),
            node: node.child(child),
            level: self.level + 1,
            place: 4 * self.place + 1 + child,
        };
        [child(0), child(1), child(2), child(3)]
    }
}

impl Haar {
    /// The corners of a face of the octahedron as vertex indices.
    #[inline]
    fn face_vertices(face: usize) -> [u16; 3] {
        let face = face as u16;
        [face & 1, 2 + (face >> 1 & 1), 4 + (face >> 2 & 1)]
    }

    #[inline]
    fn root(&self, face: usize) -> Option<usize> {
        let roots = u32::from(self.roots);
        (roots >> face & 1 == 1).then(|| (roots & ((1 << face) - 1)).count_ones() as usize)
    }

    #[inline]
    fn node(&self, index: usize) -> Node {
        self.layout.node(&self.nodes, index)
    }

    fn all_nodes(&self) -> impl Iterator<Item = Node> {
        (0..self.layout.count(&self.nodes).unwrap_or(0)).map(|index| self.node(index))
    }

    #[inline]
    fn vertex(&self, vertex: u16) -> Rgb {
        decode(self.vertices[usize::from(vertex)])
    }

    /// The values at three vertices.
    #[inline]
    fn at_vertices(&self, [a, b, c]: [u16; 3]) -> [Rgb; 3] {
        [self.vertex(a), self.vertex(b), self.vertex(c)]
    }

    /// Values at midpoints, linear where there is no vertex. In units of the scale.
    #[inline]
    fn mid_values(&self, corners: [Rgb; 3], node: Node) -> [Rgb; 3] {
        let (between, mids) = (midpoints(corners), node.mids());
        let at = |edge: usize| if mids[edge] == Node::NO_VERTEX { between[edge] } else { self.vertex(mids[edge]) };
        [at(0), at(1), at(2)]
    }

    /// The value in a direction, which need not have unit length. Zero for a direction that is zero or not finite.
    ///
    /// Linear in the direction's point on the octahedron over each triangle; between the smallest and the largest
    /// of the values at its corners.
    #[must_use]
    pub fn eval(&self, direction: Vec3) -> Rgb {
        let size = direction.abs();
        let sum = size.x + size.y + size.z;
        if self.vertices.is_empty() || !(sum > 0.0 && sum < f32::INFINITY) {
            return Rgb::ZERO;
        }
        let negative = direction.cmplt(Vec3::ZERO).bitmask() as usize;
        // Barycentric coordinates are the point's coordinates on the octahedron.
        let mut at = size / sum;
        let mut corners = Self::face_vertices(negative);
        let mut node = self.root(negative);
        while let Some(index) = node {
            let here = self.node(index);
            if here.is_childless() && !here.is_divided() {
                let values = self.at_vertices(corners);
                let child = descend(&mut at);
                let [a, b, c] = child.corners(values, self.mid_values(values, here));
                return interpolate(at, a, b, c) * self.scale;
            }
            let child = descend(&mut at);
            corners = child.corners(corners, here.mids());
            node = here.child(child.index());
        }
        let [a, b, c] = self.at_vertices(corners);
        interpolate(at, a, b, c) * self.scale
    }

    /// The smallest and largest value of [`eval`](Self::eval) over a cone, per channel: bounds that are never crossed,
    /// and attained up to the interpolation over parts of the size of the cone.
    #[must_use]
    pub fn bounds(&self, cone: &Cone) -> (Rgb, Rgb) {
        if self.vertices.is_empty() {
            return (Rgb::ZERO, Rgb::ZERO);
        }
        let test = ConeTest::new(cone);
        let mut range = (Rgb::MAX, Rgb::MIN);
        match self.smallest_around(&test) {
            Some(visit) => self.bound_below(&visit, &test, &mut range),
            None => self.faces().for_each(|visit| self.bound_below(&visit, &test, &mut range)),
        }
        let (low, high) = range;
        if low.cmpgt(high).any() {
            // No cone at all: one of its numbers is not a number.
            return self.bounds(&Cone::SPHERE);
        }
        // Rounding in the interpolation, a few units in the last place of the largest value involved.
        let slack = low.abs().max(high.abs()) * (4.0 * f32::EPSILON);
        ((low - slack) * self.scale, (high + slack) * self.scale)
    }

    /// Extends bounds by what a cone touches under a triangle. Pieces whose values are within them already are not looked at.
    fn bound_below(&self, visit: &Visit, cone: &ConeTest, range: &mut (Rgb, Rgb)) {
        let values = || self.at_vertices(visit.vertices);
        let bound = |triangle: &Triangle, values: [Rgb; 3], range: &mut (Rgb, Rgb)| {
            triangle.bound(values, cone, PIECE_SPLITS, &mut range.0, &mut range.1);
        };
        let Some(index) = visit.node else { return bound(&visit.triangle, values(), range) };
        match visit.triangle.overlap(cone) {
            Overlap::Apart => (),
            Overlap::Inside => self.vertices_below(visit.vertices, visit.node, &mut |v| {
                *range = (range.0.min(v), range.1.max(v));
            }),
            Overlap::Partial => {
                let node = self.node(index);
                if node.is_divided() {
                    visit.children(node).iter().for_each(|below| self.bound_below(below, cone, range));
                } else {
                    let corners = values();
                    let mids = self.mid_values(corners, node);
                    for (child, triangle) in visit.triangle.children().iter().enumerate() {
                        bound(triangle, child_corners(corners, mids, child), range);
                    }
                }
            }
        }
    }

    /// The smallest triangle that holds a whole cone, if any does: bounds over narrow cones start there.
    fn smallest_around(&self, cone: &ConeTest) -> Option<Visit> {
        let axis = cone.axis();
        let face = axis.cmplt(Vec3::ZERO).bitmask() as usize;
        let mut around = self.face(face);
        if !around.triangle.holds(cone) {
            return None;
        }
        let size = axis.abs();
        let mut at = size / size.element_sum();
        while let Some(node) = around.node.map(|n| self.node(n)).filter(|n| n.is_divided()) {
            let child = descend(&mut at).index();
            let below = around.children(node)[child];
            if !below.triangle.holds(cone) {
                break;
            }
            around = below;
        }
        Some(around)
    }

    /// Visits the linear pieces under all triangles that `enter` lets pass.
    fn pieces(&self, enter: &mut impl FnMut(&Visit) -> bool, piece: &mut impl FnMut(&Piece)) {
        if self.vertices.is_empty() {
            return;
        }
        self.faces().for_each(|visit| self.pieces_below(&visit, enter, piece));
    }

    fn face(&self, face: usize) -> Visit {
        let triangle = Triangle::new(face_corners(face));
        Visit { triangle, vertices: Self::face_vertices(face), node: self.root(face), level: 0, place: 0 }
    }

    fn faces(&self) -> impl Iterator<Item = Visit> {
        (0..8).map(|face| self.face(face))
    }

    fn pieces_below(&self, visit: &Visit, enter: &mut impl FnMut(&Visit) -> bool, piece: &mut impl FnMut(&Piece)) {
        if !enter(visit) {
            return;
        }
        let values = || self.at_vertices(visit.vertices);
        let Some(index) = visit.node else {
            return piece(&Piece { triangle: visit.triangle, place: visit.place, values: values() });
        };
        let node = self.node(index);
        if node.is_divided() {
            visit.children(node).iter().for_each(|below| self.pieces_below(below, enter, piece));
        } else {
            let corners = values();
            let mids = self.mid_values(corners, node);
            for (child, triangle) in visit.triangle.children().into_iter().enumerate() {
                let place = 4 * visit.place + 1 + child;
                piece(&Piece { triangle, place, values: child_corners(corners, mids, child) });
            }
        }
    }

    /// Visits the values at all vertices of a triangle, some more than once.
    fn vertices_below(&self, vertices: [u16; 3], node: Option<usize>, visit: &mut impl FnMut(Rgb)) {
        for vertex in vertices {
            visit(self.vertex(vertex));
        }
        if let Some(index) = node {
            self.mids_below(self.node(index), visit);
        }
    }

    fn mids_below(&self, node: Node, visit: &mut impl FnMut(Rgb)) {
        for mid in node.mids().into_iter().filter(|&m| m != Node::NO_VERTEX) {
            visit(self.vertex(mid));
        }
        for child in (0..4).filter_map(|child| node.child(child)) {
            self.mids_below(self.node(child), visit);
        }
    }

    /// The directions of the vertices (on the octahedron, not normalised), in the order of storage.
    fn positions(&self) -> Vec<Vec3> {
        let mut positions = vec![Vec3::ZERO; self.vertices.len()];
        let mut enter = |visit: &Visit| {
            for (vertex, corner) in visit.vertices.iter().zip(visit.triangle.corners) {
                positions[usize::from(*vertex)] = corner;
            }
            true
        };
        self.pieces(&mut enter, &mut |_| ());
        positions
    }

    /// Applies a function of (unit direction, value) to the value at every vertex. The subdivision stays: where the
    /// result varies faster than this distribution did, [`project`](Self::project) one from [`eval`](Self::eval).
    /// Results that are not finite count as 0.
    #[must_use]
    pub fn map(&self, mut f: impl FnMut(Vec3, Rgb) -> Rgb) -> Self {
        let values: Vec<Rgb> = std::iter::zip(self.positions(), &*self.vertices)
            .map(|(p, &v)| f(p.normalize(), decode(v) * self.scale))
            .map(|v| if v.is_finite() { v } else { Rgb::ZERO })
            .collect();
        let scale = scale_for(values.iter().map(|v| v.abs().max_element()).fold(0.0, f32::max));
        if scale == 0.0 {
            return Self::default();
        }
        let vertices = values.iter().map(|&v| encode(v, scale)).collect();
        Self { scale, vertices, ..self.clone() }
    }

    /// Multiplies every value. A factor that is not finite, or that leaves nothing representable, empties.
    pub fn scale(&mut self, factor: f32) {
        let scale = self.scale * factor.abs();
        if !(scale.is_finite() && scale >= f32::MIN_POSITIVE) {
            *self = Self::default();
        } else if factor < 0.0 {
            *self = self.map(|_, v| v * factor);
        } else {
            self.scale = scale;
        }
    }

    /// Whether the distribution is zero everywhere and stores nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Undivided triangles: what the paper counts as directional basis functions. 0 if empty.
    #[must_use]
    pub fn basis_functions(&self) -> usize {
        if self.is_empty() {
            return 0;
        }
        8 + 3 * self.all_nodes().filter(|node| node.is_divided()).count()
    }

    /// Level of the finest triangle; 0 for an octahedron.
    #[must_use]
    pub fn max_level(&self) -> u8 {
        let mut level = 0;
        let mut enter = |visit: &Visit| {
            level = level.max(visit.level);
            true
        };
        if !self.is_empty() {
            self.pieces(&mut enter, &mut |_| ());
        }
        level
    }

    /// Memory in bytes, on the heap and in place.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.vertices) + size_of_val(&*self.nodes)
    }
}

impl Basis for Haar {
    type Settings = Refinement;

    fn project(settings: &Refinement, known: &Known<'_>, f: impl FnMut(Vec3) -> Rgb) -> Projected<Self> {
        Self::project(settings, known, f)
    }

    fn project_sum(settings: &Refinement, known: &Known<'_>, sum: &impl Superposition) -> Projected<Self> {
        Self::project_sum(settings, known, sum)
    }

    #[inline]
    fn eval(&self, direction: Vec3) -> Rgb {
        self.eval(direction)
    }

    fn add(&self, other: &Self) -> Self {
        self.add(other)
    }

    fn scale(&mut self, factor: f32) {
        self.scale(factor);
    }

    fn shrink(&mut self, by: Rgb) {
        *self = self.map(|_, value| value - value.clamp(Rgb::ZERO, by));
    }

    fn average(distributions: &[(f32, &Self)], settings: &Refinement, offset: Rgb) -> Self {
        Self::average(distributions, settings, offset)
    }

    fn bounds(&self, cone: &Cone) -> (Rgb, Rgb) {
        self.bounds(cone)
    }

    fn integral(&self) -> Rgb {
        self.integral()
    }

    fn cosine_integral(&self, normal: Vec3) -> Rgb {
        self.cosine_integral(normal)
    }

    fn is_empty(&self) -> bool {
        self.is_empty()
    }

    fn basis_functions(&self) -> usize {
        self.basis_functions()
    }

    fn bytes(&self) -> usize {
        self.bytes()
    }
}

/// Which child holds a point: the one at corner 0, 1, 2, or the one in the middle if none is set.
///
/// A look-up takes a step for each level, and which way it goes is not to be predicted: flags and selection instead
/// of an index and branches take half the time.
#[derive(Clone, Copy)]
struct Which(bool, bool, bool);

impl Which {
    #[inline]
    fn index(self) -> usize {
        3 - 3 * usize::from(self.0) - 2 * usize::from(self.1) - usize::from(self.2)
    }

    /// As [`child_corners`].
    #[inline]
    fn corners<T: Copy>(self, corners: [T; 3], mids: [T; 3]) -> [T; 3] {
        let Self(is_0, is_1, is_2) = self;
        let select = |corner: T, a: (bool, T), b: (bool, T), middle: T, here: bool| {
            let other = if a.0 { a.1 } else { middle };
            let other = if b.0 { b.1 } else { other };
            if here { corner } else { other }
        };
        [
            select(corners[0], (is_1, mids[2]), (is_2, mids[1]), mids[0], is_0),
            select(corners[1], (is_0, mids[2]), (is_2, mids[0]), mids[1], is_1),
            select(corners[2], (is_0, mids[1]), (is_1, mids[0]), mids[2], is_2),
        ]
    }
}

/// One step down: which child holds the point, and the point's barycentric coordinates there.
#[inline]
fn descend(at: &mut Vec3) -> Which {
    let twice = *at + *at;
    // No more than one, also where a midpoint is a corner of either.
    let is_0 = twice.x >= 1.0;
    let is_1 = (twice.y >= 1.0) & !is_0;
    let is_2 = (twice.z >= 1.0) & !is_0 & !is_1;
    let middle = !(is_0 | is_1 | is_2);
    // At a corner 2p − 1 and twice the others; in the middle 1 − 2p.
    let one = |flag: bool| f32::from(u8::from(flag | middle));
    *at = (twice - Vec3::new(one(is_0), one(is_1), one(is_2))).abs();
    Which(is_0, is_1, is_2)
}

/// Linear interpolation. Coordinates are never negative, but their sum drifts from 1 by the rounding of the first
/// division, doubled on each level: without its correction a constant would not be one.
#[inline]
fn interpolate(at: Vec3, a: Rgb, b: Rgb, c: Rgb) -> Rgb {
    (at.x * a + at.y * b + at.z * c) / (at.x + at.y + at.z)
}

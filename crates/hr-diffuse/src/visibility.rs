//! Visibility by rays: occlusion of segments and closest hits, over an obvhs tree.
//!
//! The tree is obvhs's binary one, collapsed to nodes of eight children whose boxes are tested side by side. Leaves
//! hold the outlines of polygons, which is all that a test needs; curved surfaces are tested in f64 through their
//! [`Geometry`]. No ray allocates, and every query is a pure function: results do not depend on the thread.

use crate::geometry::{Aabb, Domain, Geometry, Outline, slabs};
use crate::sealed::Side;
use crate::threads;
use crate::tree::{Leaves, tree};
use eight::{Eight, WIDTH};
use glam::{Vec2, Vec3, Vec3A};
use obvhs::Boundable;
use obvhs::bvh2::Bvh2;
use smallvec::SmallVec;

/// What an end of a segment may touch without being blocked, in unit space: surfaces that abut there. Positions are
/// rounded to some 2e-7 (twice, on either side), which grazing angles stretch; 1e-5 allows for 2°.
const END_TRIM: f32 = 1e-5;

/// The trim of a segment shorter than [`END_TRIM`]/this is this share of its length, but at least
/// [`Aabb::ROUNDING`]: what stands between two near patches must still block.
const END_TRIM_SHARE: f32 = 1e-3;

/// The "no blocker yet" value of the cache that [`Visibility::occluded`] keeps.
pub const NO_BLOCKER: u32 = u32::MAX;

/// Marks a child of a node as a leaf.
const LEAF: u32 = 1 << 31;

/// Where a ray meets the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index of the surface.
    pub surface: u32,
    /// Distance in multiples of the ray's direction.
    pub t: f32,
    /// Parameters on the surface.
    pub uv: Vec2,
    /// The surface's point at `uv`.
    pub point: Vec3,
    /// Unit normal on the surface's front at `uv`, whichever side was hit.
    pub normal: Vec3,
    /// Whether the front was hit.
    pub front: bool,
}

/// Boxes side by side: lows and highs of x, y, z alternating, so that a direction's sign picks near and far.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Node {
    bounds: [Eight; 6],
    /// Index of a node, or [`LEAF`] | index of a leaf's first primitive.
    children: [u32; WIDTH],
}

impl Node {
    /// Empty boxes are hit by no ray.
    const EMPTY: Self = {
        let (low, high) = (Eight::INFINITY, Eight::NEG_INFINITY);
        Self { bounds: [low, high, low, high, low, high], children: [0; WIDTH] }
    };
}

/// One surface as the tree's leaves hold it: all that a test of a polygon needs, in one line of a cache.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Primitive {
    /// Nothing, of curved surfaces.
    outline: Outline,
    /// Its id, and marks: [`LAST`], [`CURVED`].
    surface: u32,
}

/// Marks the last primitive of a leaf, …
const LAST: u32 = 1 << 31;
/// … and one whose surface is no polygon.
const CURVED: u32 = 1 << 30;

impl Primitive {
    fn of(geometry: &Geometry, surface: u32, is_last: bool) -> Self {
        let (outline, curved) = match geometry {
            Geometry::Triangle(triangle) => (triangle.outline(), 0),
            Geometry::Quad(quad) => (quad.outline(), 0),
            Geometry::Revolution(_) => (Outline::NONE, CURVED),
        };
        Self { outline, surface: surface | curved | if is_last { LAST } else { 0 } }
    }

    #[inline(always)]
    fn surface(&self) -> u32 {
        self.surface & !(LAST | CURVED)
    }

    #[inline(always)]
    fn is_last(&self) -> bool {
        self.surface & LAST != 0
    }

    /// Its outline, if it is a polygon.
    #[inline(always)]
    fn polygon(&self) -> Option<&Outline> {
        (self.surface & CURVED == 0).then_some(&self.outline)
    }
}

/// Part of space: a box, between two heights along a unit normal.
pub(crate) struct Region {
    pub(crate) bounds: Aabb,
    pub(crate) normal: Vec3,
    pub(crate) heights: [f32; 2],
}

impl Region {
    /// Whether the box of a surface reaches into its own, and the surface between its heights.
    fn meets(&self, surface: &Geometry) -> bool {
        let [least, most] = self.heights;
        let is_between = || surface.heights(self.normal).is_none_or(|[low, high]| low <= most && least <= high);
        surface.bounds(Domain::WHOLE).overlaps(&self.bounds) && is_between()
    }
}

/// Points up to a height along a normal, for tests of boxes side by side.
struct HalfSpace {
    normal: Vec3,
    height: f32,
    /// Indices in [`Node::bounds`] of those that lie lowest along the normal.
    lowest: [usize; 3],
}

impl HalfSpace {
    fn new(normal: Vec3, height: f32) -> Self {
        Self { normal, height, lowest: [0, 1, 2].map(|axis| 2 * axis + usize::from(normal[axis] < 0.0)) }
    }

    /// The least heights of a node's boxes.
    #[inline(always)]
    fn least(&self, node: &Node) -> Eight {
        let term = |axis: usize| Eight::splat(self.normal[axis]) * node.bounds[self.lowest[axis]];
        term(0) + term(1) + term(2)
    }

    /// Which of a node's boxes reach into it.
    #[inline(always)]
    fn meets(&self, node: &Node) -> u32 {
        self.least(node).at_most(Eight::splat(self.height))
    }
}

/// A ray with what slab tests need.
struct Ray {
    origins: [Eight; 3],
    reciprocals: [Eight; 3],
    /// Index of the near bound in [`Node::bounds`], by axis.
    near: [usize; 3],
}

impl Ray {
    #[inline(always)]
    fn new(origin: Vec3, direction: Vec3) -> Self {
        let reciprocal = slabs::reciprocal(direction);
        let axis = |i: usize| 2 * i + usize::from(reciprocal[i] < 0.0);
        Self {
            origins: origin.to_array().map(Eight::splat),
            reciprocals: reciprocal.to_array().map(Eight::splat),
            near: [axis(0), axis(1), axis(2)],
        }
    }

    /// Where the ray enters each of a node's boxes, and which of them it meets between `t_min` and `t_max`.
    #[inline(always)]
    fn enter(&self, node: &Node, t_min: f32, t_max: f32) -> (Eight, u32) {
        let [x, y, z] = self.near;
        let slab = |bound: usize, axis: usize| (node.bounds[bound] - self.origins[axis]) * self.reciprocals[axis];
        let near = slab(x, 0).max(slab(y, 1)).max(slab(z, 2)).max(Eight::splat(t_min));
        let far = slab(x ^ 1, 0).min(slab(y ^ 1, 1)).min(slab(z ^ 1, 2)) * Eight::splat(slabs::GROWTH);
        (near, near.at_most(far.min(Eight::splat(t_max))))
    }
}

/// A segment, and what of it counts.
struct Span {
    from: Vec3,
    direction: Vec3,
    length: f32,
    t_min: f32,
    t_max: f32,
    skip: [u32; 2],
}

impl Span {
    /// None of segments without length and of those with non-finite ends.
    #[inline]
    fn new(from: Vec3, to: Vec3, skip: [u32; 2]) -> Option<Self> {
        let direction = to - from;
        let length = direction.length();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let trim = (END_TRIM_SHARE * length).clamp(Aabb::ROUNDING, END_TRIM) / length;
        let (t_min, t_max) = (trim, 1.0 - trim);
        (t_min < t_max).then_some(Self { from, direction, length, t_min, t_max, skip })
    }
}

/// Answers ray queries over all surfaces of a scene.
#[derive(Clone, Debug)]
pub struct Visibility {
    geometries: Vec<Geometry>,
    nodes: Vec<Node>,
    /// Leaf by leaf.
    primitives: Vec<Primitive>,
    /// Primitive of each surface.
    primitive_of: Vec<u32>,
}

impl Visibility {
    /// Builds the tree. Surface ids are indices into `geometries`.
    #[must_use]
    pub fn new(geometries: &[Geometry]) -> Self {
        let each: Vec<u32> = (0..geometries.len() as u32).collect();
        Self::with_twins(geometries, &each)
    }

    /// Like [`new`](Self::new), but rays meet only those surfaces that are their own `first`: the others coincide with
    /// theirs.
    pub(crate) fn with_twins(geometries: &[Geometry], first: &[u32]) -> Self {
        let groups = Groups::new(geometries, first);
        let bvh = groups.tree();
        let mut visibility = Self {
            geometries: geometries.to_vec(),
            nodes: Vec::new(),
            primitives: Vec::with_capacity(geometries.len()),
            primitive_of: vec![0; geometries.len()],
        };
        if !bvh.nodes.is_empty() {
            visibility.collapse(&bvh, &groups);
        }
        for (surface, &twin) in first.iter().enumerate() {
            visibility.primitive_of[surface] = visibility.primitive_of[twin as usize];
        }
        visibility
    }

    /// The surfaces, by id.
    #[must_use]
    pub fn geometries(&self) -> &[Geometry] {
        &self.geometries
    }

    /// Whether the open segment between two points is blocked.
    ///
    /// `skip` are the surfaces of the two ends ([`NO_BLOCKER`] for none): a flat one cannot block its own points and
    /// is never tested; a curved one can, at a distance from the end that rounding does not explain. Other surfaces
    /// block unless they touch the very end (1e-5 in unit space, less for short segments). `cache` holds the
    /// surface that blocked last, [`NO_BLOCKER`] at first: it is tested first and changes only the time taken.
    /// Segments without length and with non-finite ends are free.
    #[must_use]
    pub fn occluded(&self, from: Vec3, to: Vec3, skip: [u32; 2], cache: &mut u32) -> bool {
        let Some(span) = Span::new(from, to, skip) else { return false };
        if let Some(&primitive) = self.primitive_of.get(*cache as usize)
            && self.blocks(&self.primitives[primitive as usize], &span)
        {
            return true;
        }
        let ray = Ray::new(from, span.direction);
        let mut stack: SmallVec<[u32; 64]> = SmallVec::new();
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(index) = stack.pop() {
            if index & LEAF == 0 {
                let node = &self.nodes[index as usize];
                let (_, mut mask) = ray.enter(node, span.t_min, span.t_max);
                while mask != 0 {
                    stack.push(node.children[mask.trailing_zeros() as usize & (WIDTH - 1)]);
                    mask &= mask - 1;
                }
                continue;
            }
            for primitive in self.leaf(index) {
                if self.blocks(primitive, &span) {
                    *cache = primitive.surface();
                    return true;
                }
            }
        }
        false
    }

    /// Whether a primitive blocks a segment.
    #[inline(always)]
    fn blocks(&self, primitive: &Primitive, span: &Span) -> bool {
        let surface = primitive.surface();
        match primitive.polygon() {
            Some(outline) => {
                outline.intersect(span.from, span.direction, span.t_min, span.t_max).is_some()
                    && !span.skip.contains(&surface)
            }
            None => self.curved_blocks(surface, span),
        }
    }

    /// The primitives of a leaf.
    #[inline(always)]
    fn leaf(&self, index: u32) -> impl Iterator<Item = &Primitive> {
        let mut ended = false;
        self.primitives[(index & !LEAF) as usize..]
            .iter()
            .take_while(move |primitive| !std::mem::replace(&mut ended, primitive.is_last()))
    }

    /// Whether a surface that is no polygon blocks a segment, with its own ends taken into account.
    #[cold]
    fn curved_blocks(&self, surface: u32, span: &Span) -> bool {
        let geometry = &self.geometries[surface as usize];
        let Span { from, direction, length, mut t_min, mut t_max, skip } = *span;
        if skip.contains(&surface) {
            if geometry.is_flat() {
                return false;
            }
            let gap = geometry.self_gap() / length;
            if surface == skip[0] {
                t_min = t_min.max(gap);
            }
            if surface == skip[1] {
                t_max = t_max.min(1.0 - gap);
            }
        }
        geometry.distance(from, direction, t_min, t_max).is_some()
    }

    /// The nearest surface that a ray meets, from either side, with `t_min` < t < `t_max` in multiples of
    /// `direction` (of any length).
    #[must_use]
    pub fn closest(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<Hit> {
        self.closest_except(origin, direction, t_min, t_max, NO_BLOCKER)
    }

    /// As [`closest`](Self::closest), for a ray that starts on the surface `own`: a flat one is not tested, a curved
    /// one not within the distance that rounding explains.
    #[must_use]
    pub fn closest_except(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32, own: u32) -> Option<Hit> {
        let first = self.nearest(origin, direction, t_min, t_max, own)?;
        Some(self.hit(first, origin, direction))
    }

    /// Surface and distance of the hit that [`closest`](Self::closest) tells more about.
    #[must_use]
    pub fn first(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<(u32, f32)> {
        self.nearest(origin, direction, t_min, t_max, NO_BLOCKER)
    }

    /// All about where a ray meets a surface, at a distance that is known.
    #[must_use]
    pub fn hit(&self, (surface, t): (u32, f32), origin: Vec3, direction: Vec3) -> Hit {
        let geometry = &self.geometries[surface as usize];
        let uv = geometry.parameters_of(origin + direction * t);
        let (point, normal) = geometry.point_and_normal(uv);
        Hit { surface, t, uv, point, normal, front: normal.dot(direction) < 0.0 }
    }

    /// The side that a ray from the surface `own` meets first, with t < `t_max`, and at which t, in multiples of its
    /// direction.
    pub(crate) fn first_side(&self, origin: Vec3, direction: Vec3, t_max: f32, own: u32) -> Option<(Side, f32)> {
        let (surface, t) = self.nearest(origin, direction, 0.0, t_max, own)?;
        let geometry = &self.geometries[surface as usize];
        // Where the normal is the same everywhere, the place on the surface need not be found.
        let uv = if geometry.is_flat() { Vec2::ZERO } else { geometry.parameters_of(origin + direction * t) };
        Some((2 * surface + u32::from(geometry.normal(uv).dot(direction) >= 0.0), t))
    }

    /// Surface and distance of the hit that [`closest_except`](Self::closest_except) tells more about.
    fn nearest(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32, own: u32) -> Option<(u32, f32)> {
        let length = direction.length();
        if !(length > 0.0 && length.is_finite() && origin.is_finite()) || self.nodes.is_empty() {
            return None;
        }
        let ray = Ray::new(origin, direction);
        let mut best = (t_max, None);
        let mut stack: SmallVec<[(u32, f32); 64]> = SmallVec::new();
        stack.push((0, t_min));
        while let Some((index, entry)) = stack.pop() {
            if entry > best.0 {
                continue;
            }
            if index & LEAF == 0 {
                let node = &self.nodes[index as usize];
                let (near, mask) = ray.enter(node, t_min, best.0);
                push_children(&mut stack, node, near, mask);
                continue;
            }
            for primitive in self.leaf(index) {
                if let Some(t) = self.meets(primitive, (origin, direction), (t_min, best.0), (own, length)) {
                    best = (t, Some(primitive.surface()));
                }
            }
        }
        best.1.map(|surface| (surface, best.0))
    }

    /// Where a ray, whose direction has a length, meets a primitive between two distances, if not on its `own` surface.
    #[inline(always)]
    fn meets(
        &self,
        primitive: &Primitive,
        (origin, direction): (Vec3, Vec3),
        (t_min, t_max): (f32, f32),
        (own, length): (u32, f32),
    ) -> Option<f32> {
        let surface = primitive.surface();
        match primitive.polygon() {
            Some(_) if surface == own => None,
            Some(outline) => outline.intersect(origin, direction, t_min, t_max),
            None => {
                let geometry = &self.geometries[surface as usize];
                if surface == own && geometry.is_flat() {
                    return None;
                }
                let gap = if surface == own { geometry.self_gap() / length } else { 0.0 };
                geometry.distance(origin, direction, t_min.max(gap), t_max)
            }
        }
    }

    /// Whether any surface whose box reaches into a region is `wanted`.
    pub(crate) fn any_in(&self, region: &Region, mut wanted: impl FnMut(u32) -> bool) -> bool {
        let [least, most] = region.heights;
        let sides = [HalfSpace::new(region.normal, most), HalfSpace::new(-region.normal, -least)];
        // Those that share a leaf of the tree have one box there.
        let reaches = |surface: u32| region.meets(&self.geometries[surface as usize]);
        self.any_within(&region.bounds, &sides, |surface| reaches(surface) && wanted(surface))
    }

    /// Whether any surface whose box, about, reaches into a box and all of some half-spaces is `wanted`.
    fn any_within(&self, within: &Aabb, sides: &[HalfSpace], mut wanted: impl FnMut(u32) -> bool) -> bool {
        let [low, high] = [within.min, within.max].map(|p| p.to_array().map(Eight::splat));
        let mut stack: SmallVec<[u32; 64]> = SmallVec::new();
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(index) = stack.pop() {
            if index & LEAF == 0 {
                let node = &self.nodes[index as usize];
                let overlap = |axis: usize| {
                    node.bounds[2 * axis].at_most(high[axis]) & low[axis].at_most(node.bounds[2 * axis + 1])
                };
                let met = overlap(0) & overlap(1) & overlap(2);
                let mut mask = sides.iter().fold(met, |met, side| met & side.meets(node));
                while mask != 0 {
                    stack.push(node.children[mask.trailing_zeros() as usize & (WIDTH - 1)]);
                    mask &= mask - 1;
                }
                continue;
            }
            if self.leaf(index).any(|primitive| wanted(primitive.surface())) {
                return true;
            }
        }
        false
    }

    /// Turns the binary tree into nodes of eight children, parents before children.
    fn collapse(&mut self, bvh: &Bvh2, groups: &Groups) {
        // Nodes still to be filled, with the binary node that each stands for.
        let mut pending = vec![(0, 0)];
        self.nodes.push(Node::EMPTY);
        while let Some((target, source)) = pending.pop() {
            let mut children: SmallVec<[usize; WIDTH]> = SmallVec::new();
            children.push(source);
            // The largest inner child gives way to its own children while there is room.
            while children.len() < WIDTH {
                let largest = (0..children.len())
                    .filter(|&i| !bvh.nodes[children[i]].is_leaf())
                    .max_by(|&a, &b| half_area(bvh, children[a]).total_cmp(&half_area(bvh, children[b])));
                let Some(i) = largest else { break };
                let first = bvh.nodes[children[i]].first_index as usize;
                children[i] = first;
                children.push(first + 1);
            }
            for (i, &child) in children.iter().enumerate() {
                let node = &bvh.nodes[child];
                for axis in 0..3 {
                    self.nodes[target].bounds[2 * axis].set(i, node.aabb().min[axis]);
                    self.nodes[target].bounds[2 * axis + 1].set(i, node.aabb().max[axis]);
                }
                self.nodes[target].children[i] = if node.is_leaf() {
                    let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
                    LEAF | self.push_leaf(bvh.primitive_indices[range].iter().map(|&g| groups.members(g)))
                } else {
                    let index = self.nodes.len();
                    self.nodes.push(Node::EMPTY);
                    pending.push((index, child));
                    index as u32
                };
            }
        }
    }

    /// Lays out the surfaces of a leaf in a row and returns its index.
    fn push_leaf<'a>(&mut self, groups: impl Iterator<Item = &'a [u32]>) -> u32 {
        let first = self.primitives.len() as u32;
        for &surface in groups.flatten() {
            self.primitive_of[surface as usize] = self.primitives.len() as u32;
            self.primitives.push(Primitive::of(&self.geometries[surface as usize], surface, false));
        }
        if let Some(last) = self.primitives.last_mut() {
            last.surface |= LAST;
        }
        first
    }
}

/// Puts those of a node's children that a mask has on a stack, the nearest last, to be popped first.
#[inline(always)]
fn push_children(stack: &mut SmallVec<[(u32, f32); 64]>, node: &Node, near: Eight, mut mask: u32) {
    let (near, base) = (near.to_array(), stack.len());
    while mask != 0 {
        let child = mask.trailing_zeros() as usize & (WIDTH - 1);
        mask &= mask - 1;
        stack.push((node.children[child], near[child]));
        let mut at = stack.len() - 1;
        while at > base && stack[at - 1].1 < stack[at].1 {
            stack.swap(at - 1, at);
            at -= 1;
        }
    }
}

/// Half the surface area of a node's box.
fn half_area(bvh: &Bvh2, node: usize) -> f32 {
    bvh.nodes[node].aabb().half_area()
}

/// Surfaces with the same box count as one when the tree is built: the two halves of a rectangle, and stacks of
/// coinciding surfaces, which would make the build quadratic.
struct Groups {
    boxes: Vec<GroupBox>,
    /// Surfaces, group by group.
    surfaces: Vec<u32>,
    /// Where each group begins, and the end of the last.
    starts: Vec<usize>,
}

/// The box of a group, as obvhs wants it.
struct GroupBox(Aabb);

impl Boundable for GroupBox {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        obvhs::aabb::Aabb::new(Vec3A::from(self.0.min), Vec3A::from(self.0.max))
    }
}

impl Groups {
    fn new(geometries: &[Geometry], first: &[u32]) -> Self {
        // In order of the boxes' bits: no hashing, thus the same tree every time.
        let bounds = |surface: u32| {
            let bounds = geometries[surface as usize].bounds(Domain::WHOLE);
            ([bounds.min, bounds.max].map(|p| p.to_array().map(f32::to_bits)), surface)
        };
        let own: Vec<u32> =
            (0..geometries.len() as u32).filter(|&surface| first[surface as usize] == surface).collect();
        let mut sorted: Vec<([[u32; 3]; 2], u32)> = threads::map(&own, 1024, |&surface| bounds(surface));
        threads::sort_unstable(&mut sorted);
        let mut result = Self { boxes: Vec::new(), surfaces: Vec::with_capacity(sorted.len()), starts: vec![0] };
        for group in sorted.chunk_by(|a, b| a.0 == b.0) {
            let [min, max] = group[0].0.map(|bits| Vec3::from_array(bits.map(f32::from_bits)));
            result.boxes.push(GroupBox(Aabb { min, max }));
            result.surfaces.extend(group.iter().map(|&(_, surface)| surface));
            result.starts.push(result.surfaces.len());
        }
        result
    }

    fn members(&self, group: u32) -> &[u32] {
        &self.surfaces[self.starts[group as usize]..self.starts[group as usize + 1]]
    }

    fn tree(&self) -> Bvh2 {
        tree(&self.boxes, &Leaves { most: 4, step_cost: 1.5, reinserted: true })
    }
}

mod beam;
mod eight;
mod keep;
mod occluders;
mod pieces;
mod shaft;
#[cfg(test)]
mod tests;

pub use beam::Beam;
pub use occluders::{Occluders, Patch};
pub(crate) use shaft::{End, MOST_LISTED, Proof, Shaft};

//! Shafts: what is proved of all segments between two sets at once (Haines, Wallace: "Shaft Culling for Efficient
//! Ray-Traced Radiosity", 1991).
//!
//! The shaft holds all segments from points of one set to points of the other that face each other. Where no other
//! surface enters it, every segment is free; where a single polygon cuts it across, none is. What enters and does not cut
//! is listed: rays need be tested against no others.

use super::{HalfSpace, Span, Visibility};
use crate::geometry::{Aabb, Domain, Geometry};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use smallvec::SmallVec;

/// What enters a shaft no deeper than this does not enter, in unit space: touching surfaces, of which rounding lets some
/// stick in. Four times the padding of boxes, of which two may meet.
const TOUCHING: f32 = 4.0 * Aabb::ROUNDING;

/// A polygon cuts only what is at least this far from its plane, in unit space: ends that it touches it does not block.
const APART: f32 = 1e-4;

/// Surfaces that are worth a list, at most: rays against more of them are faster through the tree.
pub(crate) const MOST_LISTED: usize = 8;

/// What is proved of the segments between two sets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Proof {
    /// Nothing.
    Unknown,
    /// No surface but these blocks any of them.
    Among(SmallVec<[u32; MOST_LISTED]>),
    /// None is blocked.
    Free,
    /// All are blocked.
    Blocked,
}

/// Up to eight points side by side, of fewer some twice.
#[derive(Clone, Debug)]
struct Corners {
    /// Of these so many are there, …
    count: usize,
    /// … x, y and z of four each.
    four: [[Vec4; 3]; 2],
}

impl Corners {
    fn new(points: &[Vec3]) -> Self {
        let last = points.len() - 1;
        let of = |axis: usize, first: usize| Vec4::from_array([0, 1, 2, 3].map(|i| points[last.min(first + i)][axis]));
        Self { count: points.len(), four: [0, 4].map(|first| [0, 1, 2].map(|axis| of(axis, first))) }
    }

    fn get(&self, i: usize) -> Vec3 {
        Vec3::from_array(self.four[i / 4].map(|axis| axis[i % 4]))
    }

    fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        (0..self.count).map(|i| self.get(i))
    }

    /// Least and greatest height along a direction, over a point.
    #[inline]
    fn heights(&self, direction: Vec3, over: Vec3) -> [f32; 2] {
        let height =
            |[x, y, z]: [Vec4; 3]| (x - over.x) * direction.x + (y - over.y) * direction.y + (z - over.z) * direction.z;
        let (mut low, mut high) = (height(self.four[0]), height(self.four[0]));
        if self.count > 4 {
            let more = height(self.four[1]);
            (low, high) = (low.min(more), high.max(more));
        }
        [low.min_element(), high.max_element()]
    }
}

/// A set that segments start from or end at, as far as shafts know it.
#[derive(Clone, Debug)]
pub(crate) struct End {
    /// Of a convex set that holds it: of a polygon in order, of a box, or a single point.
    corners: Corners,
    bounds: Aabb,
    /// Normal of, and distance from the origin to, a plane that all segments are before.
    plane: Option<Vec4>,
}

impl End {
    /// A triangle or quadrilateral, seen from where its unit `normal` points.
    pub(crate) fn polygon(corners: &[Vec3], normal: Vec3) -> Self {
        let height = corners.iter().map(|p| normal.dot(*p)).fold(f32::INFINITY, f32::min);
        let bounds = Aabb::of_points(corners.iter().copied());
        Self { corners: Corners::new(corners), bounds, plane: Some(normal.extend(height)) }
    }

    /// One side of a part of a surface, given its unit normal, if it is a polygon; else the box around it.
    pub(crate) fn of(geometry: &Geometry, domain: Domain, normal: Vec3, bounds: Aabb) -> Self {
        if !geometry.is_polygon() {
            return Self::within(bounds);
        }
        let corners: SmallVec<[Vec3; 4]> = geometry.corners(domain).into_iter().map(|uv| geometry.point(uv)).collect();
        Self::polygon(&corners, normal)
    }

    /// All that is in a box.
    pub(crate) fn within(bounds: Aabb) -> Self {
        Self { corners: Corners::new(&bounds.corners()), bounds, plane: None }
    }

    /// A point.
    pub(crate) fn point(at: Vec3) -> Self {
        Self { corners: Corners::new(&[at]), bounds: Aabb { min: at, max: at }, plane: None }
    }

    /// Moved elsewhere, and seen from everywhere.
    pub(crate) fn shifted(&self, by: Vec3) -> Self {
        let corners: SmallVec<[Vec3; 8]> = self.corners.iter().map(|p| p + by).collect();
        let bounds = Aabb { min: self.bounds.min + by, max: self.bounds.max + by };
        Self { corners: Corners::new(&corners), bounds, plane: None }
    }

    /// Whether it is all of what segments start from or end at, not a box around it.
    fn is_exact(&self) -> bool {
        self.corners.count <= 4
    }
}

/// How a surface stands to a shaft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stand {
    Outside,
    Enters,
    Cuts,
}

/// The convex hull of two sets, or a little more, before both.
#[derive(Clone, Debug)]
pub(crate) struct Shaft {
    ends: [End; 2],
    bounds: Aabb,
    /// Unit normals, outward, and distances from the origin: of the planes before both ends, and of the hull of both boxes.
    planes: SmallVec<[Vec4; 8]>,
}

impl Shaft {
    pub(crate) fn new(ends: [End; 2]) -> Self {
        let bounds = ends[0].bounds.union(&ends[1].bounds);
        let mut planes: SmallVec<[Vec4; 8]> = ends.iter().filter_map(|end| end.plane.map(|plane| -plane)).collect();
        // Along each axis, the sides of the hull of two boxes pass through corners of both that lie in the same direction.
        let corner =
            |end: &End, high: bool, axis: usize| if high { end.bounds.max[axis] } else { end.bounds.min[axis] };
        for (x, y) in [(0, 1), (1, 2), (2, 0)] {
            for (right, up) in [(false, false), (true, false), (false, true), (true, true)] {
                let [from, to] = [&ends[0], &ends[1]].map(|end| Vec2::new(corner(end, right, x), corner(end, up, y)));
                let along = to - from;
                let [right, up] = [right, up].map(|high| if high { 1.0 } else { -1.0 });
                if along.x * right * along.y * up >= 0.0 {
                    continue;
                }
                let flat = Vec2::new(along.y.abs() * right, along.x.abs() * up).normalize_or_zero();
                let mut normal = Vec3::ZERO;
                (normal[x], normal[y]) = (flat.x, flat.y);
                planes.push(normal.extend(flat.dot(from)));
            }
        }
        Self { ends, bounds, planes }
    }

    /// Sides of the hull of two polygons or points, with outward normals: each passes through an edge of one and a corner of
    /// the other, and has everything on one side.
    fn sides(&self) -> SmallVec<[Vec4; 16]> {
        let mut sides = SmallVec::new();
        for (one, other) in
            [(&self.ends[0].corners, &self.ends[1].corners), (&self.ends[1].corners, &self.ends[0].corners)]
        {
            for i in 0..one.count {
                let (a, b) = (one.get(i), one.get((i + 1) % one.count));
                for c in other.iter() {
                    let across = (b - a).cross(c - a);
                    let [[low, high], [least, most]] = [one, other].map(|corners| corners.heights(across, a));
                    let (low, high, length) = (low.min(least), high.max(most), across.length());
                    let outward = if high <= TOUCHING * length { length } else { -length };
                    if high.min(-low) <= TOUCHING * length && length > 0.0 {
                        let normal = across / outward;
                        sides.push(normal.extend(normal.dot(a)));
                    }
                }
            }
        }
        sides
    }

    /// How a surface stands to it, as far as boxes and planes tell.
    fn stand(&self, geometry: &Geometry) -> Stand {
        let Some(polygon) = geometry.polygon() else {
            return if is_inside(geometry, &self.planes) { Stand::Enters } else { Stand::Outside };
        };
        let normal = geometry.normal(Vec2::ZERO);
        let [[low, high], [least, most]] = [0, 1].map(|end: usize| self.ends[end].corners.heights(normal, polygon[0]));
        let on_one_side = low.min(least) >= -TOUCHING || high.max(most) <= TOUCHING;
        if on_one_side || !is_inside(geometry, &self.planes) {
            return Stand::Outside;
        }
        let between = low >= APART && most <= -APART || least >= APART && high <= -APART;
        if between && self.passes_through(polygon, normal) { Stand::Cuts } else { Stand::Enters }
    }

    /// Whether every segment passes through a convex polygon whose plane is between the two ends. The points where segments
    /// cross its plane are in the convex hull of those of the segments between corners.
    fn passes_through(&self, polygon: &[Vec3], normal: Vec3) -> bool {
        let crossing = |from: Vec3, to: Vec3| {
            let [above, below] = [from, to].map(|p| normal.dot(p - polygon[0]));
            from + (to - from) * (above / (above - below))
        };
        let [from, to] = &self.ends;
        from.corners.iter().all(|p| to.corners.iter().all(|q| holds(polygon, normal, crossing(p, q))))
    }
}

/// Whether a surface may have points on the inner side of all planes.
fn is_inside(geometry: &Geometry, planes: &[Vec4]) -> bool {
    planes.iter().all(|plane| geometry.lowest(plane.xyz()) < plane.w - TOUCHING)
}

/// Whether a convex polygon holds a point of its plane, not at its very edge.
fn holds(polygon: &[Vec3], normal: Vec3, point: Vec3) -> bool {
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for (i, &a) in polygon.iter().enumerate() {
        let along = polygon[(i + 1) % polygon.len()] - a;
        let inward = normal.cross(along).dot(point - a) / along.length().max(f32::MIN_POSITIVE);
        (low, high) = (low.min(inward), high.max(inward));
    }
    low > TOUCHING || high < -TOUCHING
}

impl Visibility {
    /// What [`occluded`](Self::occluded) answers for a segment of which something is proved.
    pub(crate) fn occluded_given(&self, proof: &Proof, from: Vec3, to: Vec3, skip: [u32; 2], cache: &mut u32) -> bool {
        match proof {
            Proof::Free => false,
            Proof::Blocked => true,
            Proof::Among(surfaces) => Span::new(from, to, skip).is_some_and(|span| {
                surfaces
                    .iter()
                    .any(|&surface| self.blocks(&self.primitives[self.primitive_of[surface as usize] as usize], &span))
            }),
            Proof::Unknown => self.occluded(from, to, skip, cache),
        }
    }

    /// What can be proved of the segments along a shaft. The surfaces of its ends that cannot hide their own points are
    /// `own` ([`NO_BLOCKER`](super::NO_BLOCKER) for none).
    /// Nothing where more than `most` others enter.
    pub(crate) fn prove(&self, shaft: &Shaft, own: [u32; 2], most: usize) -> Proof {
        let mut entering = Entering::new(most);
        let within = Aabb { min: shaft.bounds.min + TOUCHING, max: shaft.bounds.max - TOUCHING };
        let planes: SmallVec<[HalfSpace; 8]> =
            shaft.planes.iter().map(|plane| HalfSpace::new(plane.xyz(), plane.w - TOUCHING)).collect();
        self.any_within(&within, &planes, |surface| self.enter(shaft, own, surface, &mut entering));
        self.judge(shaft, entering)
    }

    /// Takes note of a surface; returns whether nothing more needs to be known.
    fn enter(&self, shaft: &Shaft, own: [u32; 2], surface: u32, entering: &mut Entering) -> bool {
        if own.contains(&surface) {
            return false;
        }
        match shaft.stand(&self.geometries[surface as usize]) {
            Stand::Outside => {}
            Stand::Enters if entering.surfaces.len() == entering.most => entering.too_many = true,
            Stand::Enters => entering.surfaces.push(surface),
            Stand::Cuts => entering.cut = true,
        }
        entering.cut || entering.too_many
    }

    fn judge(&self, shaft: &Shaft, Entering { mut surfaces, too_many, cut, .. }: Entering) -> Proof {
        if cut {
            return Proof::Blocked;
        }
        if too_many {
            return Proof::Unknown;
        }
        if !surfaces.is_empty() && shaft.ends.iter().all(End::is_exact) {
            let sides = shaft.sides();
            surfaces.retain(|surface| is_inside(&self.geometries[*surface as usize], &sides));
        }
        if surfaces.is_empty() { Proof::Free } else { Proof::Among(surfaces) }
    }
}

/// Surfaces that enter a shaft.
struct Entering {
    surfaces: SmallVec<[u32; MOST_LISTED]>,
    most: usize,
    /// Whether there are more.
    too_many: bool,
    /// Whether one of them cuts it.
    cut: bool,
}

impl Entering {
    fn new(most: usize) -> Self {
        Self { surfaces: SmallVec::new(), most, too_many: false, cut: false }
    }
}

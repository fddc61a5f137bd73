//! Beams: what all rays from one point through a small part of a picture may meet first, found once for all of them
//! (Heckbert, Hanrahan: "Beam Tracing Polygonal Objects", 1984).
//!
//! The tree is walked front to back with the pyramid that holds the rays. A polygon that all of them meet hides what lies
//! deeper, so that few surfaces are left, and these are tested nearest first, without the tree.

use super::eight::Eight;
use super::{HalfSpace, LEAF, NO_BLOCKER, Primitive, Visibility, push_children};
use glam::{DVec3, Vec3};
use smallvec::SmallVec;

/// Surfaces that are worth a list, at most: rays against more of them are faster through the tree.
const MOST_MET: usize = 12;
/// What lies outside no farther than this share of the distances there are is inside: rounding of points and rays.
const SLACK: f32 = 1e-6;

/// A unit step along any ray of a beam is at least so deep.
const LEAST_DEPTH: f64 = 0.1;

/// The surfaces that rays from a point, within a pyramid, may meet first.
#[derive(Clone, Debug)]
pub struct Beam {
    origin: Vec3,
    /// Unit vector amid the rays.
    axis: Vec3,
    t_min: f32,
    /// Whether all rays meet one of these, if no other stands before it.
    spanned: bool,
    /// Primitives with their least depths along the axis, rising.
    met: SmallVec<[(f32, u32); MOST_MET]>,
}

/// The pyramid of a beam as it is looked for.
struct Pyramid {
    origin: Vec3,
    axis: Vec3,
    /// Outward normals of its sides with the heights of what is inside, at most.
    sides: [(Vec3, f32); 4],
    halves: [HalfSpace; 4],
    corners: [Vec3; 4],
    slack: f32,
}

impl Pyramid {
    /// None where the corners span nothing, or nearly a half-space: depths along the axis tell nothing there.
    fn new(origin: Vec3, corners: [DVec3; 4]) -> Option<Self> {
        let axis = corners.iter().map(|corner| corner.normalize_or_zero()).sum::<DVec3>().try_normalize()?;
        if corners.iter().any(|corner| corner.dot(axis) < LEAST_DEPTH * corner.length()) {
            return None;
        }
        let slack = SLACK * (1.0 + origin.abs().max_element());
        let mut sides = [(Vec3::ZERO, 0.0); 4];
        for (i, side) in sides.iter_mut().enumerate() {
            let normal = corners[i].cross(corners[(i + 1) % 4]).try_normalize()?;
            let outward = (if normal.dot(axis) > 0.0 { -normal } else { normal }).as_vec3();
            *side = (outward, outward.dot(origin) + slack);
        }
        let halves = sides.map(|(normal, height)| HalfSpace::new(normal, height));
        let corners = corners.map(|corner| corner.as_vec3());
        Some(Self { origin, axis: axis.as_vec3(), sides, halves, corners, slack })
    }
}

impl Beam {
    /// How many surfaces the rays may meet first.
    #[must_use]
    pub fn count(&self) -> usize {
        self.met.len()
    }

    /// Whether all rays meet one and the same surface, or none, first.
    #[must_use]
    pub fn is_even(&self) -> bool {
        self.met.is_empty() || self.met.len() == 1 && self.spanned
    }
}

impl Visibility {
    /// What rays from `origin` may meet first, with t > `t_min` in multiples of their unit directions, which lie within the pyramid of
    /// four `corners` (directions, in order around). None where that is more than is worth a list.
    #[must_use]
    pub fn beam(&self, origin: Vec3, corners: [DVec3; 4], t_min: f32) -> Option<Beam> {
        if !origin.is_finite() {
            return None;
        }
        let pyramid = Pyramid::new(origin, corners)?;
        let axis = pyramid.axis;
        let eye = axis.dot(origin);
        let depths = HalfSpace::new(axis, 0.0);
        let mut met: SmallVec<[(f32, u32); MOST_MET]> = SmallVec::new();
        // Nothing that lies deeper is seen.
        let (mut far, mut spanned) = (f32::INFINITY, false);
        let mut stack: SmallVec<[(u32, f32); 64]> = SmallVec::new();
        if !self.nodes.is_empty() {
            stack.push((0, f32::NEG_INFINITY));
        }
        while let Some((index, depth)) = stack.pop() {
            if depth > far {
                continue;
            }
            if index & LEAF == 0 {
                let node = &self.nodes[index as usize];
                let near = depths.least(node) - Eight::splat(eye + pyramid.slack);
                let before = near.at_most(Eight::splat(far));
                let inside = pyramid.halves.iter().fold(before, |inside, half| inside & half.meets(node));
                push_children(&mut stack, node, near, inside);
                continue;
            }
            for primitive in self.leaf(index) {
                let geometry = &self.geometries[primitive.surface() as usize];
                let depth = geometry.lowest(axis) - (eye + pyramid.slack);
                if depth > far || pyramid.sides.iter().any(|&(normal, height)| geometry.lowest(normal) > height) {
                    continue;
                }
                if let Some(outline) = primitive.polygon()
                    && outline.is_beside(origin, &pyramid.corners)
                {
                    continue;
                }
                if let Some(whole) = spans(primitive, &pyramid, t_min)
                    && whole < far
                {
                    far = whole;
                    spanned = true;
                    met.retain(|met| met.0 <= far);
                }
                if met.len() == MOST_MET {
                    return None;
                }
                met.push((depth, self.primitive_of[primitive.surface() as usize]));
            }
        }
        met.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Some(Beam { origin, axis, t_min, spanned, met })
    }

    /// Surface and distance that [`closest`](Self::closest) finds for a ray of a beam, in a unit `direction`.
    #[must_use]
    pub fn first_in(&self, beam: &Beam, direction: Vec3) -> Option<(u32, f32)> {
        let along = direction.dot(beam.axis);
        let mut best = (f32::MAX, None);
        for &(depth, primitive) in &beam.met {
            if depth > best.0 * along {
                break;
            }
            let primitive = &self.primitives[primitive as usize];
            if let Some(t) = self.meets(primitive, (beam.origin, direction), (beam.t_min, best.0), (NO_BLOCKER, 1.0)) {
                best = (t, Some(primitive.surface()));
            }
        }
        best.1.map(|surface| (surface, best.0))
    }
}

/// The depth at which all rays have met a primitive, if it is a polygon across all of the pyramid: that of one of the corners.
fn spans(primitive: &Primitive, pyramid: &Pyramid, t_min: f32) -> Option<f32> {
    let outline = primitive.polygon()?;
    let mut most = 0.0_f32;
    for corner in pyramid.corners {
        let t = outline.intersect(pyramid.origin, corner, 2.0 * t_min, f32::MAX)?;
        most = most.max(t * corner.dot(pyramid.axis));
    }
    Some(most * (1.0 + SLACK) + pyramid.slack)
}

//! What is seen of a polygon from a point, exactly: what other polygons hide of it is cut off (Weiler, Atherton: "Hidden Surface
//! Removal Using Polygon Area Sorting", 1977), and the form factors of what is left add up (Nishita, Nakamae: "Continuous Tone
//! Representation of Three-Dimensional Objects Taking Account of Shadows and Interreflection", 1985).
//!
//! From all points of a patch the same few polygons may be in the way, which a [shaft](super::shaft) finds once. No ray is shot.

use super::pieces::{Corners, Pieces, Sides};
use super::shaft::{End, Proof, Shaft};
use super::{NO_BLOCKER, Visibility};
use crate::form_factor::{IN_PLANE, Part, in_front, lambert, outline};
use crate::geometry::Domain;
use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};
use smallvec::SmallVec;

/// One side of a part of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// The surface.
    pub surface: u32,
    /// The part of it.
    pub domain: Domain,
    /// Whether it is its back.
    pub back: bool,
}

/// A polygon that sends light, and those that may hide parts of it from points of a patch. See [`Visibility::occluders`].
#[derive(Clone, Debug, Default)]
pub struct Occluders {
    /// Corners of the sender, counter-clockwise around its normal, and of each occluder; none where nothing of the sender is seen.
    corners: Vec<Vec3>,
    /// Where each of them ends there.
    ends: Vec<u32>,
    /// The plane of each: unit normal, and distance from the zero point.
    planes: Vec<Vec4>,
}

impl Visibility {
    /// What may hide parts of a polygon that sends light from the points of a patch that it shines at. `None` where the sender or
    /// something in the way is curved, or where more than `most` polygons are.
    #[must_use]
    pub fn occluders(&self, receiver: &Patch, sender: &Patch, most: usize) -> Option<Occluders> {
        let part = |patch: &Patch| Part {
            geometry: &self.geometries()[patch.surface as usize],
            domain: patch.domain,
            back: patch.back,
        };
        let [from, to] = [receiver, sender].map(part);
        if !to.geometry.is_polygon() {
            return None;
        }
        if !is_facing(from, to) || !is_facing(to, from) {
            return Some(Occluders::default());
        }
        // Surfaces that cannot hide their own points.
        let own = |part: &Part<'_>, patch: &Patch| {
            if part.geometry.is_convex(part.back) { patch.surface } else { NO_BLOCKER }
        };
        let own = [own(&from, receiver), own(&to, sender)];
        let proof = self.prove(&Shaft::new([end(from), end(to)]), own, most);
        let hiding = match proof {
            Proof::Unknown => return None,
            Proof::Blocked => return Some(Occluders::default()),
            Proof::Free => SmallVec::new(),
            Proof::Among(hiding) => hiding,
        };
        let (outline, normal) = outline(to);
        let mut occluders = Occluders::default();
        occluders.push(&outline);
        for surface in hiding {
            let polygon = self.geometries()[surface as usize].polygon()?;
            let polygon: Corners = polygon.iter().map(|corner| corner.as_dvec3()).collect();
            // What is behind the sender hides nothing of it.
            let before = in_front(&polygon, outline[0], normal);
            if before.len() >= 3 {
                occluders.push(&before);
            }
        }
        Some(occluders)
    }
}

/// Whether any point of a part may be before a polygon.
fn is_facing(part: Part<'_>, polygon: Part<'_>) -> bool {
    if !polygon.geometry.is_polygon() {
        return true;
    }
    let (outline, normal) = outline(polygon);
    let is_before = |point: Vec3| normal.dot(point.as_dvec3() - outline[0]) > 0.0;
    if part.geometry.is_polygon() {
        part.geometry.corners(part.domain).iter().any(|&uv| is_before(part.geometry.point(uv)))
    } else {
        part.geometry.bounds(part.domain).corners().into_iter().any(is_before)
    }
}

fn end(Part { geometry, domain, back }: Part<'_>) -> End {
    let front = geometry.normal(geometry.middle(domain));
    End::of(geometry, domain, if back { -front } else { front }, geometry.bounds(domain))
}

impl Occluders {
    fn push(&mut self, polygon: &[DVec3]) {
        let normal = normal(polygon);
        self.planes.push(normal.extend(normal.dot(polygon[0])).as_vec4());
        self.corners.extend(polygon.iter().map(|corner| corner.as_vec3()));
        self.ends.push(self.corners.len() as u32);
    }

    /// How many polygons there are: none where nothing of the sender is seen, else the sender and those in the way.
    #[must_use]
    pub fn polygons(&self) -> usize {
        self.planes.len()
    }

    /// Form factor (0…1) from the point `x` of the patch, in unit space, to what is seen from there of the sender, by the unit normal `n`, which may be a
    /// shading normal, above the horizon of the surface's own `normal`. Right to rounding, some 1e-6; it takes time in proportion to the polygons in the way, and to the
    /// pieces that they leave.
    #[must_use]
    pub fn visible_factor(&self, x: Vec3, [n, normal]: [Vec3; 2]) -> f32 {
        let height = |polygon: usize| self.planes[polygon].xyz().dot(x) - self.planes[polygon].w;
        if self.planes.is_empty() || height(0) <= IN_PLANE {
            return 0.0;
        }
        let mut sender = Corners::new();
        self.seen_from(x, 0, &mut sender);
        if n != normal {
            sender = in_front(&sender, DVec3::ZERO, normal.as_dvec3()).into_iter().collect();
        }
        let view = Sides::new(&sender, false);
        let mut pieces = Pieces::of(&sender);
        let (mut polygon, mut sides) = (Corners::new(), Sides::default());
        for occluder in 1..self.planes.len() {
            let height = height(occluder);
            if height.abs() <= IN_PLANE {
                // Seen edge-on.
                continue;
            }
            self.seen_from(x, occluder, &mut polygon);
            // What is beside all of the sender leaves its pieces whole, too.
            if !view.are_clear_of(&polygon) && sides.meet(&polygon, height < 0.0, &sender) {
                pieces.cut(&sides);
            }
        }
        let n = n.as_dvec3();
        pieces.iter().map(|piece| lambert(n, piece.iter().copied())).sum::<f64>().min(1.0) as f32
    }

    /// A polygon as it is seen from a point, in the place of another one.
    fn seen_from(&self, x: Vec3, at: usize, polygon: &mut Corners) {
        let start = at.checked_sub(1).map_or(0, |before| self.ends[before]);
        let corners = &self.corners[start as usize..self.ends[at] as usize];
        polygon.clear();
        corners.iter().for_each(|corner| polygon.push(corner.as_dvec3() - x.as_dvec3()));
    }
}

/// Unit normal of a polygon.
fn normal(polygon: &[DVec3]) -> DVec3 {
    let fan = polygon.windows(2).skip(1).map(|pair| (pair[0] - polygon[0]).cross(pair[1] - polygon[0]));
    fan.sum::<DVec3>().normalize_or_zero()
}

#[cfg(test)]
mod tests;

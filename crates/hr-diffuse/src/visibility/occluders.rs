//! What is seen of a polygon from a point, exactly: what other polygons hide of it is cut off (Weiler, Atherton: "Hidden Surface
//! Removal Using Polygon Area Sorting", 1977), and the form factors of what is left add up (Nishita, Nakamae: "Continuous Tone
//! Representation of Three-Dimensional Objects Taking Account of Shadows and Interreflection", 1985).
//!
//! From all points of a patch the same few polygons may be in the way, which a [shaft](super::shaft) finds once. No ray is shot.

use super::shaft::{End, Proof, Shaft};
use super::{NO_BLOCKER, Visibility};
use crate::form_factor::{IN_PLANE, Part, in_front, lambert, outline};
use crate::geometry::Domain;
use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};
use smallvec::{SmallVec, smallvec};

/// What is no further from a plane than this share of its distance lies in it: pieces so thin would add nothing but work.
const THIN: f64 = 1e-7;

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

/// A convex polygon whose corners are relative to the point that sees it.
type Piece = SmallVec<[DVec3; 6]>;

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
            let polygon: Piece = polygon.iter().map(|corner| corner.as_dvec3()).collect();
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
        let mut sender = self.polygon(0, x);
        if n != normal {
            sender = in_front(&sender, DVec3::ZERO, normal.as_dvec3()).into_iter().collect();
        }
        let mut pieces: SmallVec<[Piece; 8]> = smallvec![sender.clone()];
        for occluder in 1..self.planes.len() {
            let height = height(occluder);
            if height.abs() <= IN_PLANE {
                // Seen edge-on.
                continue;
            }
            let sides = Sides::new(&self.polygon(occluder, x), height < 0.0);
            if sides.are_clear_of(&sender) {
                continue;
            }
            for at in (0..pieces.len()).rev() {
                if !sides.are_clear_of(&pieces[at]) {
                    let piece = pieces.swap_remove(at);
                    sides.cut(piece, &mut pieces);
                }
            }
        }
        let n = n.as_dvec3();
        pieces.into_iter().map(|piece| lambert(n, piece.into_iter())).sum::<f64>().min(1.0) as f32
    }

    /// A polygon as it is seen from a point.
    fn polygon(&self, at: usize, x: Vec3) -> Piece {
        let start = at.checked_sub(1).map_or(0, |before| self.ends[before]);
        let corners = &self.corners[start as usize..self.ends[at] as usize];
        corners.iter().map(|corner| corner.as_dvec3() - x.as_dvec3()).collect()
    }
}

/// Unit normal of a polygon.
fn normal(polygon: &[DVec3]) -> DVec3 {
    let fan = polygon.windows(2).skip(1).map(|pair| (pair[0] - polygon[0]).cross(pair[1] - polygon[0]));
    fan.sum::<DVec3>().normalize_or_zero()
}

/// Planes through the zero point and the edges of a convex polygon, with their squared lengths: what it hides is on the inner side of
/// all.
struct Sides(SmallVec<[(DVec3, f64); 6]>);

/// Where a corner is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum At {
    Inside,
    Between,
    Outside,
}

impl Sides {
    /// Of a polygon whose normal points to the zero point, or away from it.
    fn new(polygon: &[DVec3], away: bool) -> Self {
        let sign = if away { 1.0 } else { -1.0 };
        let edge = |i: usize| {
            let side = polygon[i].cross(polygon[(i + 1) % polygon.len()]) * sign;
            (side, side.length_squared())
        };
        Self((0..polygon.len()).map(edge).filter(|(_, square)| *square > 0.0).collect())
    }

    /// Whether a convex polygon is beyond one of them.
    fn are_clear_of(&self, polygon: &[DVec3]) -> bool {
        self.0.iter().any(|side| polygon.iter().all(|corner| at(side, *corner) != At::Inside))
    }

    /// Adds what of a convex polygon is beyond any of them.
    fn cut(&self, mut piece: Piece, outside: &mut SmallVec<[Piece; 8]>) {
        for side in &self.0 {
            let (outer, inner) = parted(&piece, side);
            if outer.len() >= 3 {
                outside.push(outer);
            }
            piece = inner;
        }
    }
}

fn at((side, square): &(DVec3, f64), corner: DVec3) -> At {
    let height = side.dot(corner);
    if height * height <= THIN * THIN * square * corner.length_squared() {
        At::Between
    } else if height > 0.0 {
        At::Inside
    } else {
        At::Outside
    }
}

/// What of a convex polygon is on the outer and on the inner side of a plane through the zero point.
fn parted(piece: &[DVec3], side: &(DVec3, f64)) -> (Piece, Piece) {
    let places: SmallVec<[At; 8]> = piece.iter().map(|corner| at(side, *corner)).collect();
    let (mut outer, mut inner) = (Piece::new(), Piece::new());
    for (i, &to) in piece.iter().enumerate() {
        let before = (i + piece.len() - 1) % piece.len();
        if matches!((places[before], places[i]), (At::Inside, At::Outside) | (At::Outside, At::Inside)) {
            let from = piece[before];
            let (low, high) = (side.0.dot(from), side.0.dot(to));
            let crossing = from + (to - from) * (low / (low - high));
            outer.push(crossing);
            inner.push(crossing);
        }
        if places[i] != At::Inside {
            outer.push(to);
        }
        if places[i] != At::Outside {
            inner.push(to);
        }
    }
    let filled = |piece: Piece, place: At| if places.contains(&place) { piece } else { Piece::new() };
    (filled(outer, At::Outside), filled(inner, At::Inside))
}

#[cfg(test)]
mod tests;

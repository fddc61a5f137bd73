//! What is seen of a polygon from a point, exactly: what other polygons hide of it is cut off (Weiler, Atherton: "Hidden Surface
//! Removal Using Polygon Area Sorting", 1977), and the form factors of what is left add up (Nishita, Nakamae: "Continuous Tone
//! Representation of Three-Dimensional Objects Taking Account of Shadows and Interreflection", 1985).
//!
//! From all points of a patch the same few polygons may be in the way, which a [shaft](super::shaft) finds once; and spheres, cylinders
//! and cones, whose outlines each point sees as other polygons. No ray is shot.

mod round;

use super::pieces::{Corners, Pieces, Sides};
use super::shaft::{End, Proof, Shaft};
use super::{NO_BLOCKER, Visibility};
use crate::form_factor::{IN_PLANE, Part, in_front, lambert, outline};
use crate::geometry::{Domain, Geometry};
use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};
use round::{Before, Round, Viewers, disk};
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
    /// What else may hide parts of the sender.
    round: Vec<Round>,
}

/// A round body is counted as so many polygons.
const ROUND_COSTS: usize = 2;

impl Visibility {
    /// What may hide parts of a polygon that sends light from the points of a patch that it shines at. `None` where the sender is curved,
    /// what is in the way is a torus, a ring or around the patch, or takes more time than `most` polygons.
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
        let viewers = Viewers::new(corners(from).map(|corner| corner.as_dvec3()).collect());
        let mut polygons: Vec<(f64, SmallVec<[DVec3; 5]>)> = Vec::new();
        for surface in hiding {
            // What is behind the sender hides nothing of it.
            match outlined(&self.geometries()[surface as usize], &viewers)? {
                Outlined::Polygon(polygon) => {
                    let before = in_front(&polygon, outline[0], normal);
                    if before.len() >= 3 {
                        polygons.push((solid_angle(&before, viewers.middle), before));
                    }
                }
                Outlined::Round(round) => match round.before(normal, normal.dot(outline[0]))? {
                    Before::Nothing => {}
                    Before::Round(round) => occluders.round.push(round),
                },
            }
        }
        // What is large leaves fewer pieces for the others to cut.
        polygons.sort_by(|a, b| b.0.total_cmp(&a.0));
        polygons.iter().for_each(|(_, polygon)| occluders.push(polygon));
        (occluders.cost() <= most + 1).then_some(occluders)
    }
}

/// What a point sees of a surface, whichever side.
enum Outlined {
    /// The same from everywhere.
    Polygon(SmallVec<[DVec3; 5]>),
    Round(Round),
}

/// That of a surface, as it is to all viewers.
fn outlined(geometry: &Geometry, viewers: &Viewers) -> Option<Outlined> {
    match geometry {
        Geometry::Triangle(_) | Geometry::Quad(_) => {
            let corners = geometry.polygon()?.iter();
            Some(Outlined::Polygon(corners.map(|corner| corner.as_dvec3()).collect()))
        }
        Geometry::Revolution(surface) => disk(surface)
            .map(|corners| Outlined::Polygon(corners.collect()))
            .or_else(|| Round::of(surface, viewers).map(Outlined::Round)),
    }
}

/// Whether any point of a part may be before a polygon.
fn is_facing(part: Part<'_>, polygon: Part<'_>) -> bool {
    if !polygon.geometry.is_polygon() {
        return true;
    }
    let (outline, normal) = outline(polygon);
    corners(part).any(|point| normal.dot(point.as_dvec3() - outline[0]) > 0.0)
}

/// Points between which all of a part is.
fn corners(part: Part<'_>) -> impl Iterator<Item = Vec3> {
    let corners: SmallVec<[Vec3; 8]> = if part.geometry.is_polygon() {
        part.geometry.corners(part.domain).iter().map(|&uv| part.geometry.point(uv)).collect()
    } else {
        part.geometry.bounds(part.domain).corners().into_iter().collect()
    };
    corners.into_iter()
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

    /// How many polygons take as long: none where nothing of the sender is seen, else the sender and those in the way.
    #[must_use]
    pub fn cost(&self) -> usize {
        self.planes.len() + ROUND_COSTS * self.round.len()
    }

    /// Form factor (0…1) from the point `x` of the patch, in unit space, to what is seen from there of the sender, by the unit normal `n`, which may be a
    /// shading normal, above the horizon of the surface's own `normal`. Right to rounding, some 1e-6, where only polygons are in the way;
    /// circles count as polygons of the same area. It takes time in proportion to what is in the way, and to the pieces that this leaves.
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
        let mut seen = Seen::new(sender);
        let mut polygon = Corners::new();
        for occluder in 1..self.planes.len() {
            let height = height(occluder);
            // Others are seen edge-on.
            if height.abs() > IN_PLANE {
                self.seen_from(x, occluder, &mut polygon);
                if seen.meets(&polygon, height < 0.0) {
                    seen.pieces.cut(&seen.hiding);
                }
            }
        }
        for round in &self.round {
            let away = round.seen_from(x.as_dvec3(), &mut polygon);
            if seen.meets(&polygon, away) {
                seen.hide_but(&round.openings(x.as_dvec3()));
            }
        }
        let n = n.as_dvec3();
        seen.pieces.iter().map(|piece| lambert(n, piece.iter().copied())).sum::<f64>().min(1.0) as f32
    }

    /// A polygon as it is seen from a point, in the place of another one.
    fn seen_from(&self, x: Vec3, at: usize, polygon: &mut Corners) {
        let start = at.checked_sub(1).map_or(0, |before| self.ends[before]);
        let corners = &self.corners[start as usize..self.ends[at] as usize];
        polygon.clear();
        corners.iter().for_each(|corner| polygon.push(corner.as_dvec3() - x.as_dvec3()));
    }
}

/// What a point sees of a sender.
struct Seen {
    sender: Corners,
    /// What is inside of these is before all of it, or behind.
    sides: Sides,
    pieces: Pieces,
    /// Of what hid some of it last: saves allocations.
    hiding: Sides,
}

impl Seen {
    fn new(sender: Corners) -> Self {
        let pieces = Pieces::of(&sender);
        Self { sides: Sides::new(&sender, false), sender, pieces, hiding: Sides::default() }
    }

    /// Whether a polygon, whose normal points away from the point or not, may hide some of the sender: then it is what hides it next.
    fn meets(&mut self, polygon: &[DVec3], away: bool) -> bool {
        // What is beside all of the sender leaves its pieces whole, too.
        !self.sides.are_clear_of(polygon) && self.hiding.meet(polygon, away, &self.sender)
    }

    /// Takes away what is behind that, but for what is seen through both of two openings.
    fn hide_but(&mut self, openings: &Option<[(Corners, bool); 2]>) {
        let through = match openings.as_ref().map(|openings| self.pieces.within(openings)) {
            Some(None) => return,
            Some(through) => through,
            None => None,
        };
        self.pieces.cut(&self.hiding);
        through.iter().flatten().for_each(|piece| self.pieces.push(piece));
    }
}

/// About what a small polygon takes of what is seen from a point.
fn solid_angle(polygon: &[DVec3], x: DVec3) -> f64 {
    let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64 - x;
    0.5 * doubled_area(polygon).dot(middle).abs() / middle.length().powi(3).max(f64::MIN_POSITIVE)
}

/// Unit normal of a polygon.
fn normal(polygon: &[DVec3]) -> DVec3 {
    doubled_area(polygon).normalize_or_zero()
}

/// Twice its area, along its normal.
fn doubled_area(polygon: &[DVec3]) -> DVec3 {
    polygon.windows(2).skip(1).map(|pair| (pair[0] - polygon[0]).cross(pair[1] - polygon[0])).sum()
}

#[cfg(test)]
mod tests;

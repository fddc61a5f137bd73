//! Pieces of a convex polygon that others leave of it, as a point sees them: corners are relative to that point, and planes go through it.
//!
//! This is where the light of outlined emitters takes its time, so what is cut goes to and fro between buffers that stay in place.

use glam::DVec3;
use smallvec::SmallVec;

/// What is no further from a plane than this share of its distance lies in it: pieces so thin would add nothing but work.
const THIN: f64 = 1e-7;

/// The corners of a convex polygon.
pub(super) type Corners = SmallVec<[DVec3; 8]>;

/// Convex polygons.
#[derive(Default)]
pub(super) struct Pieces {
    corners: SmallVec<[DVec3; 32]>,
    /// Where each of them ends there.
    ends: SmallVec<[u32; 8]>,
}

impl Pieces {
    pub(super) fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.corners[start as usize..end as usize])
    }

    pub(super) fn clear(&mut self) {
        self.corners.clear();
        self.ends.clear();
    }

    pub(super) fn push(&mut self, piece: &[DVec3]) {
        self.corners.extend_from_slice(piece);
        self.close();
    }

    /// Makes a piece of the corners since the last one, if they are enough.
    fn close(&mut self) {
        let start = self.ends.last().map_or(0, |&end| end as usize);
        if self.corners.len() < start + 3 {
            self.corners.truncate(start);
        } else {
            self.ends.push(self.corners.len() as u32);
        }
    }
}

/// A plane by its normal, with the square of that.
type Plane = (DVec3, f64);

/// Planes through the edges of a convex polygon: what it hides is on the inner side of all.
#[derive(Default)]
pub(super) struct Sides(SmallVec<[Plane; 6]>);

/// Where a corner is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum At {
    Inside,
    Between,
    Outside,
}

impl Sides {
    /// Of a polygon whose normal points to the zero point, or away from it.
    pub(super) fn new(polygon: &[DVec3], away: bool) -> Self {
        Self(sides(polygon, away).collect())
    }

    /// Takes the place of another one's, if another polygon is not beyond one of them: tells whether it is not.
    pub(super) fn meet(&mut self, polygon: &[DVec3], away: bool, other: &[DVec3]) -> bool {
        self.0.clear();
        for side in sides(polygon, away) {
            if is_beyond(&side, other) {
                return false;
            }
            self.0.push(side);
        }
        true
    }

    /// Whether a convex polygon is beyond one of them.
    pub(super) fn are_clear_of(&self, polygon: &[DVec3]) -> bool {
        self.0.iter().any(|side| is_beyond(side, polygon))
    }

    /// Adds what of a convex polygon is beyond any of them.
    pub(super) fn cut(&self, piece: &[DVec3], outside: &mut Pieces) {
        let (mut piece, mut inner) = (&mut Corners::from_slice(piece), &mut Corners::new());
        for side in &self.0 {
            let places: SmallVec<[At; 8]> = piece.iter().map(|corner| at(side, *corner)).collect();
            if !places.contains(&At::Inside) {
                if places.contains(&At::Outside) {
                    outside.push(piece);
                }
                return;
            }
            if places.contains(&At::Outside) {
                part(piece, &places, side.0, (outside, inner));
                std::mem::swap(&mut piece, &mut inner);
            }
        }
    }
}

/// The sides of a polygon that has any.
fn sides(polygon: &[DVec3], away: bool) -> impl Iterator<Item = Plane> {
    let sign = if away { 1.0 } else { -1.0 };
    let side = move |i: usize| {
        let side = polygon[i].cross(polygon[if i + 1 < polygon.len() { i + 1 } else { 0 }]) * sign;
        (side, side.length_squared())
    };
    (0..polygon.len()).map(side).filter(|(_, square)| *square > 0.0)
}

fn at((side, square): &Plane, corner: DVec3) -> At {
    let height = side.dot(corner);
    if height * height <= THIN * THIN * square * corner.length_squared() {
        At::Between
    } else if height > 0.0 {
        At::Inside
    } else {
        At::Outside
    }
}

/// Whether nothing of a polygon is on the inner side.
fn is_beyond(side: &Plane, polygon: &[DVec3]) -> bool {
    polygon.iter().all(|&corner| side.0.dot(corner) <= 0.0 || at(side, corner) != At::Inside)
}

/// Adds what of a convex polygon is on the outer side of a plane, and puts what is on the inner side in the place of another polygon.
fn part(piece: &[DVec3], places: &[At], side: DVec3, (outside, inner): (&mut Pieces, &mut Corners)) {
    inner.clear();
    let mut before = piece.len() - 1;
    for (i, &to) in piece.iter().enumerate() {
        if matches!((places[before], places[i]), (At::Inside, At::Outside) | (At::Outside, At::Inside)) {
            let from = piece[before];
            let (low, high) = (side.dot(from), side.dot(to));
            let crossing = from + (to - from) * (low / (low - high));
            outside.corners.push(crossing);
            inner.push(crossing);
        }
        if places[i] != At::Inside {
            outside.corners.push(to);
        }
        if places[i] != At::Outside {
            inner.push(to);
        }
        before = i;
    }
    outside.close();
}

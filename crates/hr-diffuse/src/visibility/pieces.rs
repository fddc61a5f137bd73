//! Pieces of a convex polygon that others leave of it, as a point sees them: corners are relative to that point, and planes go through it.
//!
//! This is where the light of outlined emitters takes its time, so nothing is moved or allocated that need not be.

use crate::form_factor::in_front;
use glam::DVec3;
use smallvec::SmallVec;

/// What is no further from a plane than this share of its distance lies in it: pieces so thin would add nothing but work.
const THIN: f64 = 1e-7;

/// The corners of a convex polygon.
pub(super) type Corners = SmallVec<[DVec3; 24]>;

/// Convex polygons.
#[derive(Default)]
pub(super) struct Pieces {
    /// Corners of all, and of those that have been cut: to leave those there takes less than to move what follows.
    corners: SmallVec<[DVec3; 64]>,
    /// Where each of them starts and ends there.
    ranges: SmallVec<[[u32; 2]; 16]>,
}

impl Pieces {
    pub(super) fn of(polygon: &[DVec3]) -> Self {
        let mut pieces = Self::default();
        pieces.push(polygon);
        pieces
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        self.ranges.iter().map(|&[start, end]| &self.corners[start as usize..end as usize])
    }

    /// Takes away what of each is on the inner side of all of some sides.
    pub(super) fn cut(&mut self, sides: &Sides) {
        for at in (0..self.ranges.len()).rev() {
            let [start, end] = self.ranges[at];
            let piece = &self.corners[start as usize..end as usize];
            if !sides.are_clear_of(piece) {
                let piece = Corners::from_slice(piece);
                self.ranges.swap_remove(at);
                self.push_outside(piece, sides);
            }
        }
    }

    /// What of each is within two convex polygons, whose normals point away from the zero point or not; `None` where all of them are.
    pub(super) fn within(&self, polygons: &[(Corners, bool); 2]) -> Option<SmallVec<[Corners; 2]>> {
        let sides = || polygons.iter().flat_map(|(polygon, away)| sides(polygon, *away));
        let (mut all, mut inner) = (true, SmallVec::new());
        for piece in self.iter() {
            let mut left = Corners::from_slice(piece);
            for side in sides() {
                if is_beyond(&side, &left) {
                    left.clear();
                } else if left.iter().any(|&corner| at(&side, corner) == At::Outside) {
                    left = in_front(&left, DVec3::ZERO, side.0).into_iter().collect();
                } else {
                    continue;
                }
                all = false;
                if left.is_empty() {
                    break;
                }
            }
            if left.len() >= 3 {
                inner.push(left);
            }
        }
        (!all).then_some(inner)
    }

    /// Adds what of a convex polygon is beyond any of some sides.
    fn push_outside(&mut self, mut piece: Corners, sides: &Sides) {
        let (mut piece, mut inner) = (&mut piece, &mut Corners::new());
        let mut places: SmallVec<[At; 8]> = SmallVec::new();
        for side in &sides.0 {
            places.clear();
            piece.iter().for_each(|corner| places.push(at(side, *corner)));
            if !places.contains(&At::Inside) {
                if places.contains(&At::Outside) {
                    self.push(piece);
                }
                return;
            }
            if places.contains(&At::Outside) {
                self.part(piece, &places, side.0, inner);
                std::mem::swap(&mut piece, &mut inner);
            }
        }
    }

    /// Adds what of a convex polygon is on the outer side of a plane, and puts what is on the inner side in the place of another polygon.
    fn part(&mut self, piece: &[DVec3], places: &[At], side: DVec3, inner: &mut Corners) {
        let start = self.corners.len();
        inner.clear();
        let mut before = piece.len() - 1;
        for (i, &to) in piece.iter().enumerate() {
            if matches!((places[before], places[i]), (At::Inside, At::Outside) | (At::Outside, At::Inside)) {
                let from = piece[before];
                let (low, high) = (side.dot(from), side.dot(to));
                let crossing = from + (to - from) * (low / (low - high));
                self.corners.push(crossing);
                inner.push(crossing);
            }
            if places[i] != At::Inside {
                self.corners.push(to);
            }
            if places[i] != At::Outside {
                inner.push(to);
            }
            before = i;
        }
        self.close(start);
    }

    /// Adds one.
    pub(super) fn push(&mut self, piece: &[DVec3]) {
        let start = self.corners.len();
        self.corners.extend_from_slice(piece);
        self.close(start);
    }

    /// Makes a piece of the corners from this one on, if they are enough.
    fn close(&mut self, start: usize) {
        if self.corners.len() >= start + 3 {
            self.ranges.push([start, self.corners.len()].map(|corner| corner as u32));
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

//! Axis-aligned boxes.

use glam::Vec3;

/// An axis-aligned box in unit space; empty if any `min` > `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lowest corner.
    pub min: Vec3,
    /// Highest corner.
    pub max: Vec3,
}

impl Aabb {
    /// Holds nothing; the neutral element of [`union`](Self::union).
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// How far a point computed in f32 within the unit cube may lie from where it would be exactly: a sum of four
    /// products, each rounded, below 1 in size. Bounds are padded by it.
    pub const ROUNDING: f32 = 4.0 * f32::EPSILON;

    /// The smallest box around points.
    #[must_use]
    pub fn of_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Larger by `distance` on all sides.
    #[must_use]
    pub fn padded(&self, distance: f32) -> Self {
        Self { min: self.min - distance, max: self.max + distance }
    }

    /// Its middle.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// Edge lengths.
    #[must_use]
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// Radius of the sphere about the centre that holds the box.
    #[must_use]
    pub fn radius(&self) -> f32 {
        0.5 * self.size().length()
    }

    /// Whether the point is inside or on the border.
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// Whether the boxes have a point in common.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Smallest distance between points of two boxes, 0 if they overlap.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f32 {
        (other.min - self.max).max(self.min - other.max).max(Vec3::ZERO).length()
    }

    /// Largest distance between points of two boxes.
    #[must_use]
    pub fn farthest_distance(&self, other: &Self) -> f32 {
        (other.max - self.min).max(self.max - other.min).length()
    }

    /// The eight corners, x running fastest.
    #[must_use]
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let high = glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0);
            Vec3::select(high, self.max, self.min)
        })
    }
}

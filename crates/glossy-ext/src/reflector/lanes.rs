//! Numbers, directions and points of a plane side by side, as processors compute them: a lobe is averaged over eight senders in little more
//! than the time of one, as it takes a chain of square roots and quotients.

use glam::{Vec2, Vec3};
use std::ops::{Add, Mul, Sub};

/// Numbers side by side.
pub(super) type Lanes = wide::f32x8;
/// How many.
pub(super) const LANES: usize = size_of::<Lanes>() / size_of::<f32>();

/// One number, or some side by side.
pub(super) trait Number:
    Copy + Add<Output = Self> + Mul<Output = Self> + Add<f32, Output = Self> + Mul<f32, Output = Self>
{
    fn sqrt(self) -> Self;
    fn reciprocal(self) -> Self;
    fn at_least(self, least: f32) -> Self;
}

impl Number for f32 {
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn reciprocal(self) -> Self {
        self.recip()
    }

    #[inline]
    fn at_least(self, least: f32) -> Self {
        self.max(least)
    }
}

impl Number for Lanes {
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    /// Exactly rounded, unlike what `recip` gives.
    #[inline]
    fn reciprocal(self) -> Self {
        1.0 / self
    }

    #[inline]
    fn at_least(self, least: f32) -> Self {
        self.fast_max(Self::splat(least))
    }
}

/// Directions, or any vectors, side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Directions {
    pub x: Lanes,
    pub y: Lanes,
    pub z: Lanes,
}

impl From<[Vec3; LANES]> for Directions {
    #[inline]
    fn from(directions: [Vec3; LANES]) -> Self {
        Self {
            x: Lanes::new(directions.map(|direction| direction.x)),
            y: Lanes::new(directions.map(|direction| direction.y)),
            z: Lanes::new(directions.map(|direction| direction.z)),
        }
    }
}

impl Directions {
    #[inline]
    pub(super) fn splat(direction: Vec3) -> Self {
        Self { x: Lanes::splat(direction.x), y: Lanes::splat(direction.y), z: Lanes::splat(direction.z) }
    }

    /// By a mask.
    #[inline]
    pub(super) fn select(mask: Lanes, yes: Self, no: Self) -> Self {
        Self { x: mask.select(yes.x, no.x), y: mask.select(yes.y, no.y), z: mask.select(yes.z, no.z) }
    }

    #[inline]
    pub(super) fn dot(self, other: Self) -> Lanes {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline]
    pub(super) fn length_squared(self) -> Lanes {
        self.dot(self)
    }

    /// Of unit length, but for what has none.
    #[inline]
    pub(super) fn normalized(self) -> Self {
        self * (1.0 / self.length_squared().sqrt().fast_max(Lanes::splat(f32::MIN_POSITIVE)))
    }
}

impl Add for Directions {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl Sub for Directions {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl Mul<Lanes> for Directions {
    type Output = Self;

    #[inline]
    fn mul(self, by: Lanes) -> Self {
        Self { x: self.x * by, y: self.y * by, z: self.z * by }
    }
}

/// Points of a plane side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub x: Lanes,
    pub y: Lanes,
}

impl Plane {
    /// Each axis by its own scale.
    #[inline]
    pub(super) fn scaled(self, by: Vec2) -> Self {
        Self { x: self.x * by.x, y: self.y * by.y }
    }

    #[inline]
    pub(super) fn dot(self, other: Self) -> Lanes {
        self.x * other.x + self.y * other.y
    }

    #[inline]
    pub(super) fn length_squared(self) -> Lanes {
        self.dot(self)
    }
}

impl Add for Plane {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y }
    }
}

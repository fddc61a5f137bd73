//! Eight numbers side by side, in two registers: tests of so many boxes cost hardly more than of four, and trees are less deep.

use glam::Vec4;
use std::ops::{Add, Mul, Sub};

/// How many numbers there are.
pub(super) const WIDTH: usize = 8;

/// Eight numbers.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Eight([Vec4; 2]);

impl Eight {
    pub(super) const INFINITY: Self = Self([Vec4::INFINITY; 2]);
    pub(super) const NEG_INFINITY: Self = Self([Vec4::NEG_INFINITY; 2]);

    /// The same number eight times.
    #[inline(always)]
    pub(super) fn splat(value: f32) -> Self {
        Self([Vec4::splat(value); 2])
    }

    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self([self.0[0].min(other.0[0]), self.0[1].min(other.0[1])])
    }

    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self([self.0[0].max(other.0[0]), self.0[1].max(other.0[1])])
    }

    /// Where it is no more than another, as bits.
    #[inline(always)]
    pub(super) fn at_most(self, other: Self) -> u32 {
        self.0[0].cmple(other.0[0]).bitmask() | self.0[1].cmple(other.0[1]).bitmask() << 4
    }

    /// All of them, in order.
    #[inline(always)]
    pub(super) fn to_array(self) -> [f32; WIDTH] {
        bytemuck::cast(self.0)
    }

    /// Changes one of them.
    pub(super) fn set(&mut self, at: usize, value: f32) {
        self.0[at / 4][at % 4] = value;
    }
}

impl Add for Eight {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self([self.0[0] + other.0[0], self.0[1] + other.0[1]])
    }
}

impl Sub for Eight {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self([self.0[0] - other.0[0], self.0[1] - other.0[1]])
    }
}

impl Mul for Eight {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self([self.0[0] * other.0[0], self.0[1] * other.0[1]])
    }
}

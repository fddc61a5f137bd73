//! The map from scene units to the unit cube and back.

use crate::{Shape, Surface};
use glam::{DVec3, Vec3};

/// Shift and uniform scaling that take a scene into the unit cube.
///
/// Done in f64 before anything becomes f32, so that a scene keeps its precision wherever it lies and whatever its
/// unit is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalization {
    offset: DVec3,
    scale: f64,
}

impl Default for Normalization {
    /// The identity.
    fn default() -> Self {
        Self { offset: DVec3::ZERO, scale: 1.0 }
    }
}

impl Normalization {
    /// For these surfaces: their longest extent becomes 1, their lowest coordinates 0. Surfaces with non-finite
    /// coordinates are passed over, here; without any (finite) surface it is the identity.
    #[must_use]
    pub fn new(surfaces: &[Surface]) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for surface in surfaces {
            let (low, high) = bounds(&surface.shape);
            if low.is_finite() && high.is_finite() {
                min = min.min(low);
                max = max.max(high);
            }
        }
        if !min.is_finite() {
            return Self::default();
        }
        let scale = (max - min).max_element().recip();
        // A scene that is a single point, or one as large as f64 goes, has no sensible scale; its surfaces are
        // rejected one by one.
        Self { offset: min, scale: if scale.is_finite() && scale > 0.0 { scale } else { 1.0 } }
    }

    /// Shift and scale, to be kept.
    pub(crate) fn to_array(self) -> [f64; 4] {
        [self.offset.x, self.offset.y, self.offset.z, self.scale]
    }

    /// From what [`to_array`](Self::to_array) tells; `None` where that is no such map.
    pub(crate) fn from_array([x, y, z, scale]: [f64; 4]) -> Option<Self> {
        let offset = DVec3::new(x, y, z);
        (offset.is_finite() && scale.is_finite() && scale > 0.0).then_some(Self { offset, scale })
    }

    /// A scene position in unit space.
    #[must_use]
    pub fn to_unit(&self, position: DVec3) -> Vec3 {
        ((position - self.offset) * self.scale).as_vec3()
    }

    /// A unit-space position in the scene.
    #[must_use]
    pub fn to_scene(&self, position: Vec3) -> DVec3 {
        position.as_dvec3() / self.scale + self.offset
    }

    /// Unit-space length per scene length.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.scale
    }
}

/// Lowest and highest coordinates of a shape in scene units.
fn bounds(shape: &Shape) -> (DVec3, DVec3) {
    // How far a circle reaches along the coordinate axes, by its unit normal.
    let reach = |axis: DVec3| (DVec3::ONE - axis * axis).max(DVec3::ZERO).map(f64::sqrt);
    let around = |center: DVec3, half: DVec3| (center - half, center + half);
    let hull = |points: &[DVec3]| {
        // `min` and `max` drop NaN; it must come through to be seen.
        if points.iter().any(|p| p.is_nan()) {
            return (DVec3::NAN, DVec3::NAN);
        }
        points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
    };
    match shape {
        Shape::Triangle(points) => hull(points),
        Shape::Quad(points) => hull(points),
        Shape::Sphere { center, radius } => around(*center, DVec3::splat(radius.abs())),
        Shape::Cone { ends, radii } => {
            let reach = reach((ends[1] - ends[0]).normalize_or_zero());
            let (low0, high0) = around(ends[0], reach * radii[0].abs());
            let (low1, high1) = around(ends[1], reach * radii[1].abs());
            hull(&[low0, high0, low1, high1])
        }
        Shape::Ring { center, normal, outer, .. } => around(*center, reach(normal.normalize_or_zero()) * outer.abs()),
        Shape::Torus { center, axis, major, minor } => {
            let half = reach(axis.normalize_or_zero()) * major.abs() + DVec3::splat(minor.abs());
            around(*center, half)
        }
    }
}

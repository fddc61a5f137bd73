//! What can be wrong with a surface.

use thiserror::Error;

/// Why a surface cannot be taken over.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// A coordinate or radius is infinite or not a number. Mend the file, or leave the surface out.
    #[error("a coordinate or radius is not a finite number; correct it or leave the surface out")]
    NonFinite,
    /// It encloses no area. Leave the surface out: it neither sends nor receives light.
    #[error("the {0} has no area (corners that coincide, lie on one line, or cross over); leave it out")]
    NoArea(&'static str),
    /// A radius is out of its range.
    #[error("{what} is {value}, but must be {range}")]
    Radius {
        /// Which radius.
        what: &'static str,
        /// What it is, in scene units.
        value: f64,
        /// What it must be.
        range: &'static str,
    },
    /// An axis or normal has no direction.
    #[error("{0} has length zero; give it a direction")]
    NoDirection(&'static str),
    /// The corners of a quadrilateral are not in a plane. Split it into two triangles.
    #[error(
        "a corner of the quadrilateral is {distance:.2e} of its diagonal out of the plane of the others \
         (at most {tolerance:.0e}); split it into two triangles"
    )]
    NotPlanar {
        /// Distance from the mean plane over the longer diagonal.
        distance: f64,
        /// The largest one that is taken for rounding.
        tolerance: f64,
    },
    /// A quadrilateral has a reflex corner, crosses itself, or two of its corners coincide. Split it into two
    /// triangles along the diagonal from that corner.
    #[error("the quadrilateral is not convex or has coinciding corners; split it into two triangles")]
    NotConvex,
    /// The surface is smaller than what f32 resolves in a scene of this extent.
    #[error("the surface vanishes against the extent of the scene; leave it out or split the scene")]
    Vanishing,
}

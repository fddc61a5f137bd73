//! Errors of the solver: what is wrong, where, and how to mend it.

/// Why a scene cannot be solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// There is nothing to light.
    #[error("the scene has no surface; add at least one of non-zero area")]
    Empty,
    /// A surface cannot be used.
    #[error("surface {surface}: {source}")]
    Surface {
        /// Index of the surface.
        surface: usize,
        /// What is wrong with it.
        source: crate::geometry::GeometryError,
    },
    /// A surface refers to a material that does not exist.
    #[error("surface {surface} refers to material {material}, but there are {count}; materials count from 0")]
    Material {
        /// Index of the surface.
        surface: usize,
        /// The index it gives.
        material: u32,
        /// Number of materials.
        count: usize,
    },
    /// A material's numbers make no sense.
    #[error("material {material}: {what} is {value}; it must be finite and {range}")]
    MaterialValue {
        /// Index of the material.
        material: usize,
        /// Which property.
        what: &'static str,
        /// Its value.
        value: glam::Vec3,
        /// What is allowed.
        range: &'static str,
    },
    /// A light's numbers make no sense.
    #[error("light {light}: {what}; correct it or leave the light out")]
    Light {
        /// Index of the light.
        light: usize,
        /// Which property.
        what: &'static str,
    },
    /// Light arrives where nothing absorbs it and whence it cannot leave: it would grow without end.
    #[error(
        "surface {surface} and all that it sees reflect {channel} light without loss, and none of it can leave: there \
         is no steady state; give one of their materials a reflectance below 1, or open the room"
    )]
    NoSteadyState {
        /// Index of one of the surfaces.
        surface: usize,
        /// The channel.
        channel: &'static str,
    },
    /// The error asked for is out of range.
    #[error("an error of {error} was asked for; it must lie within 0.001 and 1")]
    Error {
        /// What was asked for.
        error: f32,
    },
    /// An edit that needs new links.
    #[error("{what} {index}; make a new solver for the scene as it is now")]
    Edit {
        /// What has changed.
        what: &'static str,
        /// Index of what has.
        index: usize,
    },
    /// Lamps that cannot be mixed so.
    #[error("lamps cannot be mixed: {what}")]
    Mix {
        /// What is wrong, and what would be right.
        what: &'static str,
    },
}

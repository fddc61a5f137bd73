//! What is wrong with the parameters of a reflector.

use super::unit;
use glam::Vec3;
use hr_diffuse::Rgb;

/// A parameter that no surface can have.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReflectorError {
    /// A number is outside its range, or NaN. Mend: clamp it; or use the reflector that the range's end stands for
    /// (a smoother surface than the range allows is a mirror, a rougher one diffuse).
    #[error("{reflector}: {parameter} is {value}, but must be from {min} to {max}")]
    OutOfRange {
        /// The reflector's name.
        reflector: &'static str,
        /// The parameter's name.
        parameter: &'static str,
        /// What was given.
        value: f32,
        /// Smallest value allowed.
        min: f32,
        /// Largest value allowed.
        max: f32,
    },
    /// A channel of a reflectance is outside 0…1, or NaN. Mend: clamp the colour, or scale it if it was given in
    /// percent or in 0…255.
    #[error("{reflector}: {parameter} is ({}, {}, {}), but a reflectance is from 0 to 1 in every channel",
            value.x, value.y, value.z)]
    Reflectance {
        /// The reflector's name.
        reflector: &'static str,
        /// The parameter's name.
        parameter: &'static str,
        /// What was given.
        value: Rgb,
    },
    /// A direction is zero or not finite. Mend: give any vector along it; its length does not matter.
    #[error("{reflector}: {parameter} is {value}, but must be a direction: finite and not zero")]
    Direction {
        /// The reflector's name.
        reflector: &'static str,
        /// The parameter's name.
        parameter: &'static str,
        /// What was given.
        value: Vec3,
    },
}

/// `value`, if it is in the range.
pub(super) fn number(
    reflector: &'static str,
    parameter: &'static str,
    value: f32,
    (min, max): (f32, f32),
) -> Result<f32, ReflectorError> {
    if value >= min && value <= max {
        Ok(value)
    } else {
        Err(ReflectorError::OutOfRange { reflector, parameter, value, min, max })
    }
}

/// `value`, if every channel is a reflectance.
pub(super) fn reflectance(reflector: &'static str, parameter: &'static str, value: Rgb) -> Result<Rgb, ReflectorError> {
    if value.cmpge(Rgb::ZERO).all() && value.cmple(Rgb::ONE).all() {
        Ok(value)
    } else {
        Err(ReflectorError::Reflectance { reflector, parameter, value })
    }
}

/// `value` as a unit vector, if it is a direction.
pub(super) fn direction(reflector: &'static str, parameter: &'static str, value: Vec3) -> Result<Vec3, ReflectorError> {
    unit(value).ok_or(ReflectorError::Direction { reflector, parameter, value })
}

/// A reflectance out of any colour: clamped to 0…1, NaN becomes 0.
pub(super) fn clamped(color: Rgb) -> Rgb {
    let channel = |c: f32| if c > 0.0 { c.min(1.0) } else { 0.0 };
    Rgb::new(channel(color.x), channel(color.y), channel(color.z))
}

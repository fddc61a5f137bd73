//! Glossy parts as numbers, for those who evaluate them elsewhere, such as on a graphics device.

use glam::Vec2;
use hr_diffuse::Rgb;

/// Entries of [`Formula::Compensated`]'s table.
pub const LOSSES: usize = 33;

/// The glossy part of a built-in BRDF by its parameters: what [`Reflector::glossy`](super::Reflector::glossy) is of the type
/// of the same name, whose documentation has the formula.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Formula {
    /// Of a [`Phong`](super::Phong) reflector.
    Phong {
        /// Specular reflectance.
        ks: Rgb,
        /// Exponent.
        n: f32,
    },
    /// Of a [`Ward`](super::Ward) reflector that is no mirror.
    Ward {
        /// Specular reflectance.
        rs: Rgb,
        /// Geometric mean of the roughnesses along both axes.
        alpha: f32,
        /// `alpha` / (αx, αy); its product is 1.
        stretch: Vec2,
    },
    /// Of a [`MetallicRoughness`](super::MetallicRoughness) reflector.
    MetallicRoughness {
        /// Base colour.
        base: Rgb,
        /// 0…1.
        metallic: f32,
        /// Roughness².
        alpha: f32,
    },
    /// Of a [`Compensated`](super::Compensated) reflector.
    Compensated {
        /// Base colour.
        base: Rgb,
        /// 0…1.
        metallic: f32,
        /// Roughness².
        alpha: f32,
        /// What directional albedos leave of 1, (1 − E, 1 − D), where the root of the cosine is 0…1 in equal steps;
        /// linear between them.
        losses: Box<[Vec2; LOSSES]>,
        /// Their cosine-weighted means.
        mean: Vec2,
    },
}

//! Directional bases: what a function of a direction is represented by (paper, section 4).
//!
//! | basis | functions | adaptive |
//! | --- | --- | --- |
//! | [`Haar`](crate::haar::Haar) | triangles of an octahedron, finer where the function varies (section 4.2) | yes |
//! | [`NonAdaptive`] | vertices of a tetrahedron that is subdivided evenly (section 4.1) | no |
//! | [`Harmonics`] | spherical harmonics up to an order, what Radiance Clustering used (section 2.2) | no |
//!
//! All of them do the same for a light field: [`GlossyField`](crate::GlossyField) takes any, and Haar unless told
//! otherwise.

pub(crate) mod half;
mod harmonics;
mod known;
mod non_adaptive;
mod superposition;
#[cfg(test)]
mod tests;
pub(crate) mod triangle;

pub use harmonics::{Harmonics, Order, Window};
pub(crate) use known::Sampler;
pub use known::{Beyond, Known, Peak, Projected, Support};
pub use non_adaptive::{Level, NonAdaptive};
pub use superposition::Superposition;

use crate::Rgb;
use glam::Vec3;
use hr_diffuse::Cone;
use std::fmt::Debug;

/// A directional distribution of a signed RGB quantity over the sphere, in world space, in some basis.
///
/// The default is zero everywhere and allocates nothing.
pub trait Basis: Clone + Debug + Default + Send + Sync {
    /// How finely functions are represented; the same for all distributions of a solution.
    type Settings: Clone + Debug + Send + Sync;

    /// Represents a function of a unit direction. It is evaluated only inside of its support, and every evaluation is
    /// counted. Values that are not finite count as 0.
    ///
    /// Depends on nothing but the arguments: the same function gives the same distribution, bit by bit.
    fn project(settings: &Self::Settings, known: &Known<'_>, f: impl FnMut(Vec3) -> Rgb) -> Projected<Self>;

    /// The same of a sum of terms. Where a basis adapts, terms that are smooth around some directions are interpolated between these
    /// rather than evaluated, if that changes much less than the settings let be wrong.
    fn project_sum(settings: &Self::Settings, known: &Known<'_>, sum: &impl Superposition) -> Projected<Self> {
        let count = sum.terms().len();
        let projected = Self::project(settings, known, |direction| sum.at(direction));
        Projected { terms: projected.evaluations * count, ..projected }
    }

    /// The value in a direction, which need not have unit length. Zero for a direction that is zero or not finite.
    fn eval(&self, direction: Vec3) -> Rgb;

    /// The sum of two distributions.
    #[must_use]
    fn add(&self, other: &Self) -> Self;

    /// Multiplies every value. A factor that is not finite, or that leaves nothing representable, empties.
    fn scale(&mut self, factor: f32);

    /// Takes so much from every value, but not more than it is above zero: what functions that are smooth far from their peaks are
    /// overestimated by where they are not [looked at closely](Known::negligible). Bases that do not adapt take no notice.
    fn shrink(&mut self, _by: Rgb) {}

    /// The weighted sum Σ wᵢ hᵢ of distributions, such as those of the children of an element weighted by their share
    /// of its area (*pull*), no finer than the settings ask for. `offset` as in [`Known`]. Distributions with a weight
    /// that is zero or not finite are left out.
    #[must_use]
    fn average(distributions: &[(f32, &Self)], settings: &Self::Settings, offset: Rgb) -> Self;

    /// Bounds of [`eval`](Self::eval) over a cone, per channel, that are never crossed.
    #[must_use]
    fn bounds(&self, cone: &Cone) -> (Rgb, Rgb);

    /// ∫ over the sphere, per steradian of the quantity: of intensity (W/sr), the power (W).
    #[must_use]
    fn integral(&self) -> Rgb;

    /// ∫ of the quantity times the cosine to `normal` (unit length) over the hemisphere around it: of radiance
    /// (W/(m² sr)), the radiosity (W/m²).
    #[must_use]
    fn cosine_integral(&self, normal: Vec3) -> Rgb;

    /// Whether the distribution is zero everywhere and stores nothing.
    #[must_use]
    fn is_empty(&self) -> bool;

    /// What the paper counts as directional basis functions. 0 if empty.
    #[must_use]
    fn basis_functions(&self) -> usize;

    /// Memory in bytes, on the heap and in place.
    #[must_use]
    fn bytes(&self) -> usize;
}

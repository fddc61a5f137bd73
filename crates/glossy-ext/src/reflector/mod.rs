//! What a material does with light: the interface that a custom BRDF implements, and the built-in BRDFs.
//!
//! Directions are unit vectors in the surface's own frame: z along the normal, both pointing away from the
//! surface, both with z > 0 (engines turn the frame over for the back of a two-sided surface); x along the
//! [grain](Reflector::grain) of a BRDF that has one, else any tangent. A direction with z ≤ [`HORIZON`] is below the
//! horizon: nothing comes from there and nothing goes there.
//!
//! | reflector | glossy part |
//! | --- | --- |
//! | [`Lambert`] | none |
//! | [`Phong`] | cosⁿ about the mirror direction, energy-normalised |
//! | [`Ward`] | Gaussian of half-vector slopes, bounded albedo |
//! | [`MetallicRoughness`] | GGX of glTF 2.0, and what its diffuse term has more or less than a Lambertian |
//! | [`Compensated`] | the same, with the light that facets pass on and a diffuse term that gets what is left |
//! | [`Tabulated`] | measured, isotropic: files of the MERL database |
//! | [`Sum`] | that of its parts |
//!
//! Constructors check parameters one by one. They do not check that diffuse and glossy reflectance together stay
//! below 1: a file may ask for that, and the glTF model itself exceeds 1 near grazing directions for a white dielectric.
//! [`Reflector::diffuse`] + [`Reflector::glossy_albedo`] + [`Reflector::mirror`] tells an engine whether its iteration
//! converges. [`conformance::check`](crate::conformance::check) tells whether a reflector does all that is asked here;
//! [`GlossyField`](crate::GlossyField) clamps and counts what does not.

mod compensated;
mod contour;
mod error;
mod extent;
mod formula;
mod generic;
mod ggx;
mod half_vector;
mod lambert;
mod lanes;
mod merl;
mod metallic_roughness;
mod phong;
mod sum;
mod tabulated;
#[cfg(test)]
mod tests;
mod ward;

pub use compensated::Compensated;
pub use contour::Contour;
pub use error::ReflectorError;
pub use formula::{Formula, LOSSES};
pub use lambert::Lambert;
pub use merl::MerlError;
pub use metallic_roughness::MetallicRoughness;
pub use phong::Phong;
pub use sum::Sum;
pub use tabulated::{Mended, Tabulated};
pub use ward::Ward;

use glam::{Vec2, Vec3};
use hr_diffuse::{Cone, Rgb};
use std::f32::consts::FRAC_1_PI;
use std::fmt::Debug;
use std::sync::Arc;

/// Directions whose z is not above this (an elevation of 0.2 arc seconds) are below the horizon. It keeps every
/// formula of this module within the range of `f32` and takes away less than 10⁻¹² of the cosine-weighted hemisphere.
pub const HORIZON: f32 = 1e-6;

/// Where the glossy part of a BRDF is concentrated for one outgoing direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// Unit direction of the lobe's middle.
    pub direction: Vec3,
    /// Angle in radians from `direction` (standard deviation per axis; for a lobe that is not round the geometric
    /// mean of both axes); π/2 for a lobe without a peak, 0 for a perfect mirror.
    pub width: f32,
}

impl Lobe {
    /// No peak: the whole hemisphere.
    pub const HEMISPHERE: Self = Self { direction: Vec3::Z, width: std::f32::consts::FRAC_PI_2 };
}

/// A direction drawn in proportion to the glossy part of a BRDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The incident direction drawn, unit length, z > 0.
    pub incident: Vec3,
    /// Glossy BRDF × cosine / density: what the radiance from `incident` is multiplied by.
    pub weight: Rgb,
}

/// Light of one sender as it arrives at a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Incident {
    /// Unit direction toward the sender's middle.
    pub direction: Vec3,
    /// Angular radius of the sender in radians, 0…π/2. For a sender of solid angle ω that is not a disk the radius of
    /// a disk with the same solid angle, √(ω/π), is right; that of a bounding sphere blurs more than it must.
    pub extent: f32,
    /// Outline of the sender, where it is known to be none of a disk: built-in lobes are averaged over it.
    pub contour: Contour,
    /// Irradiance on the surface (W/m²), the cosine included.
    pub irradiance: Rgb,
    /// Reciprocal of the sender's distance in the hierarchy's unit; 0 where it is infinitely far, or where nobody asks.
    pub nearness: f32,
}

impl Incident {
    /// Angular radius that holds all of the sender, in radians.
    #[must_use]
    pub fn reach(&self) -> f32 {
        self.extent.max(self.contour.reach())
    }

    /// Makes the sender at least so wide (radians).
    pub fn widen(&mut self, least: f32) {
        self.extent = self.extent.max(least);
        self.contour = self.contour.widened(self.direction, least);
    }

    /// Lets the sender be a point.
    pub fn shrink(&mut self) {
        self.extent = 0.0;
        self.contour = Contour::NONE;
    }
}

/// A bidirectional reflectance distribution function (1/sr), isotropic about the normal or not.
///
/// [`eval`](Self::eval) is all that a custom one must give. The provided methods are correct for every BRDF, if
/// slow or loose; a good implementation overrides them.
///
/// No method panics or returns NaN for directions that are finite, whatever their length; where a direction is
/// below the horizon (z ≤ [`HORIZON`]) every value is 0.
pub trait Reflector: Debug + Send + Sync {
    /// The whole BRDF, diffuse part included, in 1/sr: finite, ≥ 0, reciprocal. A perfect mirror gives 0 here
    /// and declares itself by [`mirror`](Self::mirror).
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb;

    /// The Lambertian share: a reflectance ρ such that ρ/π is taken out of [`eval`](Self::eval) and carried as
    /// radiosity. What is left ([`glossy`](Self::glossy)) may be negative where ρ/π overestimates.
    fn diffuse(&self) -> Rgb {
        Rgb::ZERO
    }

    /// Whether nothing is left beside the Lambertian share, neither glossy nor mirror, so that no directional state
    /// is needed.
    fn is_diffuse(&self) -> bool {
        false
    }

    /// [`eval`](Self::eval) − [`diffuse`](Self::diffuse)/π; 0 below the horizon.
    fn glossy(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        if above(incident) && above(outgoing) {
            self.eval(incident, outgoing) - self.diffuse() * FRAC_1_PI
        } else {
            Rgb::ZERO
        }
    }

    /// [`glossy`](Self::glossy) averaged over a sender that is a disk of angular radius `extent` (radians, 0…π/2)
    /// about `incident`: a lobe widened by the sender's size, so that one sample stands for a sender that is not a
    /// point. Directions count by their cosine, those below the horizon not at all, so that irradiance × this average
    /// is what a disk of uniform radiance gives. `incident` itself may be below the horizon if part of the disk
    /// is not. For `extent` = 0 this is [`glossy`](Self::glossy).
    ///
    /// The default averages [`glossy`](Self::glossy) over 16 directions, well spread over the disk. It is good as long
    /// as the lobe is not narrower than a quarter of the disk.
    fn glossy_toward_extent(&self, incident: Vec3, outgoing: Vec3, extent: f32) -> Rgb {
        generic::disk_average(self, incident, outgoing, extent)
    }

    /// Radiance (W/(m² sr)) that the glossy part sends toward `outgoing` for many senders at once: the sum of
    /// [`glossy_toward_extent`](Self::glossy_toward_extent) × irradiance, or of a mean over the sender's
    /// [contour](Incident::contour) where an implementation knows one. This is the hottest loop of reflecting
    /// illumination samples; as one call it is dispatched once per outgoing direction, and implementations reject
    /// negligible samples (less than 10⁻⁵ of the lobe's peak) before any costly function.
    fn reflect_sum(&self, incident: &[Incident], outgoing: Vec3) -> Rgb {
        incident.iter().fold(Rgb::ZERO, |sum, sample| {
            sum + self.glossy_toward_extent(sample.direction, outgoing, sample.extent) * sample.irradiance
        })
    }

    /// What each of many senders makes alone, as [`reflect_sum`](Self::reflect_sum) adds it up, in their order; as many values as senders.
    fn reflect_each(&self, incident: &[Incident], outgoing: Vec3, reflected: &mut [Rgb]) {
        for (sender, reflected) in std::iter::zip(incident, reflected) {
            *reflected = self.reflect_sum(std::slice::from_ref(sender), outgoing);
        }
    }

    /// Upper bound of the magnitude of every channel of [`glossy`](Self::glossy) over all incident directions in a
    /// cone: magnitude, so that a negative remainder is not skipped by mistake.
    ///
    /// The default knows nothing about the BRDF: it is infinite, except where no light can come from or go to. Samples
    /// of such a reflector are never skipped.
    fn glossy_bound(&self, incident: &Cone, outgoing: Vec3) -> f32 {
        let dark = self.is_diffuse() || !above(outgoing) || half_vector::cosine_range(incident, Vec3::Z).1 <= HORIZON;
        if dark { 0.0 } else { f32::INFINITY }
    }

    /// Directional-hemispherical reflectance of the glossy part, cosine-weighted mean over outgoing directions, per
    /// channel. Slightly negative at most, where the remainder beside [`diffuse`](Self::diffuse) is.
    ///
    /// The default integrates numerically (about 50 000 evaluations): keep the result.
    fn glossy_albedo(&self) -> Rgb {
        if self.is_diffuse() { Rgb::ZERO } else { generic::albedo(self) }
    }

    /// Directional-hemispherical reflectance of the glossy part for light from one direction (by reciprocity also what it shows
    /// of even light of radiance 1 toward there), per channel; without a [`mirror`](Self::mirror). Distributions are made to
    /// add up to it.
    ///
    /// The default integrates numerically (about 2000 evaluations), good to some percent down to cosines of twice the lobe's
    /// width.
    fn directional_albedo(&self, incident: Vec3) -> Rgb {
        if self.is_diffuse() || !above(incident) { Rgb::ZERO } else { generic::albedo_toward(self, incident) }
    }

    /// Where incident light matters most for one outgoing direction.
    ///
    /// The default searches for the largest glossy × cosine (a coarse grid, the mirror direction and `outgoing`
    /// itself, then a refinement) and takes the width of a Gaussian of the same peak and energy. A peak that is
    /// narrower than about 10° and in none of those places is missed.
    fn lobe(&self, outgoing: Vec3) -> Lobe {
        if self.is_diffuse() || !above(outgoing) { Lobe::HEMISPHERE } else { generic::lobe(self, outgoing) }
    }

    /// Draws an incident direction from two numbers in 0…1 by the glossy part; `None` where the draw falls below
    /// the horizon. The mean of weight × radiance is the reflected radiance of the glossy part.
    ///
    /// The default draws by the cosine, with weight π × glossy.
    fn sample(&self, outgoing: Vec3, u: Vec2) -> Option<Sample> {
        let incident = cosine_hemisphere(u);
        (above(outgoing) && above(incident))
            .then(|| Sample { incident, weight: self.glossy(incident, outgoing) * std::f32::consts::PI })
    }

    /// Direction of the scene that the frame's x axis follows, as far as the surface allows: it is projected onto the
    /// plane of the surface, so that on a turned part the direction of the lathe's axis gives the lines along it. `None`
    /// for a BRDF that is isotropic about the normal; x is any tangent then.
    fn grain(&self) -> Option<Vec3> {
        None
    }

    /// Reflectance of a perfect mirror that is part of this BRDF (a delta lobe), else 0.
    fn mirror(&self) -> Rgb {
        Rgb::ZERO
    }

    /// The glossy part as a sum of built-in formulas, by their parameters; `None` where it is none. A mirror is no part of it.
    fn formulas(&self) -> Option<Vec<Formula>> {
        self.is_diffuse().then(Vec::new)
    }

    /// The same material with another base colour, for textures; `None` where it has none. Colours outside 0…1 are
    /// clamped.
    fn with_base_color(&self, _color: Rgb) -> Option<Arc<dyn Reflector>> {
        None
    }
}

/// Whether a direction is above the horizon; false for NaN.
#[inline]
fn above(direction: Vec3) -> bool {
    direction.z > HORIZON
}

/// `outgoing` mirrored at the normal.
#[inline]
fn mirrored(outgoing: Vec3) -> Vec3 {
    Vec3::new(-outgoing.x, -outgoing.y, outgoing.z)
}

/// A direction of density cos/π from two numbers in 0…1 (Malley's method).
fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let radius = u.y.clamp(0.0, 1.0).sqrt();
    let (s, c) = (std::f32::consts::TAU * u.x).sin_cos();
    Vec3::new(radius * c, radius * s, (1.0 - radius * radius).max(0.0).sqrt())
}

/// A unit vector, or none where there is no direction.
fn unit(v: Vec3) -> Option<Vec3> {
    v.try_normalize()
}

//! What a material does with light: the interface that a custom BRDF implements.
//!
//! Directions are unit vectors in the surface's own frame: z along the normal, both pointing away from the
//! surface, both with z > 0 (engines turn the frame over for the back of a two-sided surface).

use hr_diffuse::{Cone, Rgb};
use glam::{Vec2, Vec3};
use std::fmt::Debug;
use std::sync::Arc;

/// Where the glossy part of a BRDF is concentrated for one outgoing direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// Unit direction of the lobe's middle.
    pub direction: Vec3,
    /// Angle in radians from `direction` (standard deviation per axis); π/2 for a lobe without a peak, 0 for a
    /// perfect mirror.
    pub width: f32,
}

/// A direction drawn in proportion to the glossy part of a BRDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The incident direction drawn, unit length, z > 0.
    pub incident: Vec3,
    /// Glossy BRDF × cosine / density: what the radiance from `incident` is multiplied by.
    pub weight: Rgb,
}

/// A bidirectional reflectance distribution function (1/sr), isotropic about the normal or not.
///
/// [`eval`](Self::eval) is all that a custom one must give. The provided methods are correct for every BRDF, if
/// slow or loose; a good implementation overrides them.
pub trait Reflector: Debug + Send + Sync {
    /// The whole BRDF, diffuse part included, in 1/sr: finite, ≥ 0, reciprocal. A perfect mirror gives 0 here
    /// and declares itself by [`mirror`](Self::mirror).
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb;

    /// The Lambertian share: a reflectance ρ such that ρ/π is taken out of [`eval`](Self::eval) and carried as
    /// radiosity. What is left ([`glossy`](Self::glossy)) may be negative where ρ/π overestimates.
    fn diffuse(&self) -> Rgb {
        Rgb::ZERO
    }

    /// Whether nothing is left beside the Lambertian share, so that no directional state is needed.
    fn is_diffuse(&self) -> bool {
        false
    }

    /// [`eval`](Self::eval) − [`diffuse`](Self::diffuse)/π.
    fn glossy(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        self.eval(incident, outgoing) - self.diffuse() * std::f32::consts::FRAC_1_PI
    }

    /// [`glossy`](Self::glossy) averaged over senders of angular radius `extent` (radians) about `incident`: a
    /// lobe widened by the sender's size, so that one sample stands for a sender that is not a point.
    fn glossy_toward_extent(&self, incident: Vec3, outgoing: Vec3, extent: f32) -> Rgb;

    /// Upper bound of the largest channel of [`glossy`](Self::glossy) over all incident directions in a cone.
    fn glossy_bound(&self, incident: &Cone, outgoing: Vec3) -> f32;

    /// Directional-hemispherical reflectance of the glossy part, mean over outgoing directions, per channel.
    fn glossy_albedo(&self) -> Rgb;

    /// Where incident light matters most for one outgoing direction.
    fn lobe(&self, outgoing: Vec3) -> Lobe;

    /// Draws an incident direction from two numbers in 0…1 by the glossy part; `None` where the draw falls below
    /// the horizon. The mean of weight × radiance is the reflected radiance of the glossy part.
    fn sample(&self, outgoing: Vec3, u: Vec2) -> Option<Sample>;

    /// Reflectance of a perfect mirror that is part of this BRDF (a delta lobe), else 0.
    fn mirror(&self) -> Rgb {
        Rgb::ZERO
    }

    /// The same material with another base colour, for textures; `None` where it has none.
    fn with_base_color(&self, _color: Rgb) -> Option<Arc<dyn Reflector>> {
        None
    }
}

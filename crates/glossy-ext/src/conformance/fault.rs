//! What can be wrong with a reflector, in words.

use glam::Vec3;
use hr_diffuse::Rgb;
use std::fmt;

/// Two directions in the surface's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Where light comes from.
    pub incident: Vec3,
    /// Where it goes.
    pub outgoing: Vec3,
}

impl fmt::Display for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "incident {}, outgoing {}", Degrees(self.incident), Degrees(self.outgoing))
    }
}

/// A direction as its angles to the normal and to the x axis.
pub(super) struct Degrees(pub(super) Vec3);

impl fmt::Display for Degrees {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let v = self.0;
        let (polar, azimuth) = (v.truncate().length().atan2(v.z).to_degrees(), v.y.atan2(v.x).to_degrees());
        write!(f, "({polar:.4}° from the normal, azimuth {azimuth:.1}°)")
    }
}

/// One kind of fault: what was asked, what came, where, and how to mend it. Numbers are of the worst case found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// A method returned an infinity or no number.
    #[error(
        "`{method}` is not finite: {value} at {at}; guard divisions by cosines, which come close to 0, and roots and \
         powers of what rounding may make negative"
    )]
    NotFinite {
        /// Which method.
        method: &'static str,
        /// What it returned.
        value: Rgb,
        /// Where.
        at: Pair,
    },
    /// The BRDF is negative.
    #[error("`eval` is negative: {value} at {at}; a surface cannot reflect less than nothing: clamp it to 0")]
    Negative {
        /// What `eval` returned.
        value: Rgb,
        /// Where.
        at: Pair,
    },
    /// Light comes from or goes to below the surface.
    #[error("`{method}` is {value} below the horizon, at {at}; return 0 where either direction has z ≤ `HORIZON`")]
    BelowHorizon {
        /// Which method.
        method: &'static str,
        /// What it returned.
        value: Rgb,
        /// Where.
        at: Pair,
    },
    /// Exchanging the directions changes the value.
    #[error(
        "`eval` is not reciprocal: {there} at {at}, but {back} with the directions exchanged; light carried both ways \
         would not agree: use terms that are symmetric in both directions"
    )]
    NotReciprocal {
        /// The value.
        there: Rgb,
        /// With the directions exchanged.
        back: Rgb,
        /// Where.
        at: Pair,
    },
    /// The value depends on the azimuth though no grain is given.
    #[error(
        "`eval` is {value} at {at}, but {turned} with both directions turned by 90° about the normal, though there is no \
         `grain`: without one the frame's x axis is any tangent"
    )]
    NotIsotropic {
        /// The value.
        value: Rgb,
        /// With both directions turned.
        turned: Rgb,
        /// Where.
        at: Pair,
    },
    /// More is reflected than arrives.
    #[error(
        "`eval` reflects more than arrives: the albedo is {albedo} toward {}; scale it so that no direction exceeds 1",
        Degrees(*.outgoing)
    )]
    Energy {
        /// Directional-hemispherical reflectance.
        albedo: Rgb,
        /// Outgoing direction.
        outgoing: Vec3,
    },
    /// A reflectance is outside 0…1.
    #[error("`{method}` is {value}, but a reflectance is from 0 to 1 in every channel")]
    Reflectance {
        /// Which method.
        method: &'static str,
        /// What it returned.
        value: Rgb,
    },
    /// `is_diffuse` is true of a reflector that is not.
    #[error(
        "`is_diffuse` is true, but beside `diffuse` there is {value} at {at}, or a mirror; it would be left out of the \
         solution: return false, or put all into `diffuse`"
    )]
    NotDiffuse {
        /// What `glossy` returned.
        value: Rgb,
        /// Where.
        at: Pair,
    },
    /// `glossy` is not what is left of `eval`.
    #[error(
        "`glossy` is {value} at {at}, but `eval` − `diffuse`/π is {expected}; light would be lost or counted twice"
    )]
    Split {
        /// What `glossy` returned.
        value: Rgb,
        /// What it should.
        expected: Rgb,
        /// Where.
        at: Pair,
    },
    /// `glossy_toward_extent` is not the mean over a disk.
    #[error(
        "`glossy_toward_extent` is {value} at {at} for a sender of {extent} rad, but the mean of `glossy` over it is \
         {expected}"
    )]
    Extent {
        /// What it returned.
        value: f32,
        /// What it should be, within a third of the largest over such disks.
        expected: f32,
        /// Angular radius of the sender.
        extent: f32,
        /// Where.
        at: Pair,
    },
    /// `reflect_each` does not tell what `reflect_sum` adds up.
    #[error("`reflect_each` gives {value} at {at}, but `reflect_sum` of that sender alone is {expected}")]
    Each {
        /// What it returned.
        value: Rgb,
        /// What it should.
        expected: Rgb,
        /// Where.
        at: Pair,
    },
    /// `reflect_sum` is not the sum over its samples.
    #[error(
        "`reflect_sum` is {value} toward {}, but `glossy_toward_extent` × irradiance sums to {expected}",
        Degrees(*.outgoing)
    )]
    Sum {
        /// What it returned.
        value: Rgb,
        /// What it should.
        expected: Rgb,
        /// Outgoing direction.
        outgoing: Vec3,
    },
    /// `glossy_bound` does not bound.
    #[error(
        "`glossy_bound` is {bound} for the cone of {angle} rad about {}, but `glossy` is {value} within, at {at}; samples \
         that matter would be skipped",
        Degrees(*.axis)
    )]
    Bound {
        /// What it returned.
        bound: f32,
        /// Half-angle of the cone in radians.
        angle: f32,
        /// Its axis.
        axis: Vec3,
        /// Magnitude of the largest channel of `glossy`.
        value: f32,
        /// Where.
        at: Pair,
    },
    /// `glossy_albedo` is not the mean of the glossy part.
    #[error("`glossy_albedo` is {stated}, but the glossy part integrates to {integrated}")]
    Albedo {
        /// What it returned.
        stated: Rgb,
        /// Cosine-weighted mean over outgoing directions.
        integrated: Rgb,
    },
    /// `lobe` returned no lobe at all.
    #[error(
        "`lobe` toward {} is the direction {direction}, the width {width}; a unit vector with z ≥ 0 and 0…π/2 are due",
        Degrees(*.outgoing)
    )]
    NoLobe {
        /// The direction returned.
        direction: Vec3,
        /// The width returned.
        width: f32,
        /// Outgoing direction.
        outgoing: Vec3,
    },
    /// The declared lobe is not where the reflector's is.
    #[error(
        "`lobe` is off: toward {} it points to {}, where `glossy` × cosine is {there}, but at {} it is {peak}",
        Degrees(*.outgoing), Degrees(*.direction), Degrees(*.peak_direction)
    )]
    LobeDirection {
        /// The direction declared.
        direction: Vec3,
        /// What is there.
        there: f32,
        /// The largest value found.
        peak: f32,
        /// Where it is.
        peak_direction: Vec3,
        /// Outgoing direction.
        outgoing: Vec3,
    },
    /// The declared lobe is too narrow.
    #[error(
        "`lobe` is too narrow: toward {} it says {width} rad, but at that angle from its middle `glossy` × cosine is \
         still {share} of the peak; a Gaussian has 0.61",
        Degrees(*.outgoing)
    )]
    LobeNarrow {
        /// The width declared.
        width: f32,
        /// Mean value on the ring at that angle, by the peak.
        share: f32,
        /// Outgoing direction.
        outgoing: Vec3,
    },
    /// The declared lobe does not contain the energy that its width and peak say.
    #[error(
        "`lobe` is too wide: toward {} it says {width} rad, which with its peak makes an albedo of {said}, but there is \
         only {found}",
        Degrees(*.outgoing)
    )]
    LobeWide {
        /// The width declared.
        width: f32,
        /// 2π width² × peak.
        said: f32,
        /// The glossy albedo.
        found: f32,
        /// Outgoing direction.
        outgoing: Vec3,
    },
    /// `sample` returned what cannot be a sample.
    #[error(
        "`sample` toward {} drew {incident} with the weight {weight}; a unit vector above the horizon and a finite \
         weight are due",
        Degrees(*.outgoing)
    )]
    Sample {
        /// The direction drawn.
        incident: Vec3,
        /// Its weight.
        weight: Rgb,
        /// Outgoing direction.
        outgoing: Vec3,
    },
    /// Weights of samples do not average to the albedo.
    #[error(
        "`sample` is biased: toward {} its weights average {mean} ± {deviation}, but the glossy albedo is {albedo}",
        Degrees(*.outgoing)
    )]
    SampleMean {
        /// Mean weight.
        mean: f32,
        /// Standard error of the mean.
        deviation: f32,
        /// Glossy albedo.
        albedo: f32,
        /// Outgoing direction.
        outgoing: Vec3,
    },
    /// The base colour makes another material.
    #[error("`with_base_color` makes a material with another `grain` or mirror, where only the colour should change")]
    BaseColor,
}

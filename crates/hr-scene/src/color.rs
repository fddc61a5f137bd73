//! What RGB numbers mean: primaries, luminance, and the way to sRGB.

use crate::Primaries;
use glam::{DMat3, DVec2, DVec3};

/// CIE 1931 chromaticities of a set of primaries and of its white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chromaticities {
    /// Red, green and blue.
    pub rgb: [DVec2; 3],
    /// White.
    pub white: DVec2,
}

/// Bradford's matrix from XYZ to sharpened cone responses (Lam, *Metamerism and Colour Constancy*, 1985; also ICC.1,
/// annex E).
const BRADFORD: DMat3 = DMat3::from_cols(
    DVec3::new(0.8951, -0.7502, 0.0389),
    DVec3::new(0.2664, 1.7135, -0.0685),
    DVec3::new(-0.1614, 0.0367, 1.0296),
);

impl Primaries {
    /// The CIE 1931 chromaticities.
    #[must_use]
    pub fn chromaticities(self) -> Chromaticities {
        match self {
            Self::Radiance => Chromaticities {
                rgb: [DVec2::new(0.640, 0.330), DVec2::new(0.290, 0.600), DVec2::new(0.150, 0.060)],
                white: DVec2::splat(1.0 / 3.0),
            },
            Self::Rec709 => Chromaticities {
                rgb: [DVec2::new(0.640, 0.330), DVec2::new(0.300, 0.600), DVec2::new(0.150, 0.060)],
                white: DVec2::new(0.3127, 0.3290),
            },
        }
    }

    /// The matrix from linear RGB to CIE XYZ; (1, 1, 1) has Y = 1. Its columns scale the primaries' XYZ such that they
    /// add up to the white (SMPTE RP 177-1993).
    #[must_use]
    pub fn to_xyz(self) -> DMat3 {
        let c = self.chromaticities();
        let unscaled = DMat3::from_cols_array_2d(&c.rgb.map(|xy| xyz(xy).to_array()));
        unscaled * DMat3::from_diagonal(unscaled.inverse() * xyz(c.white))
    }

    /// The weights of R, G and B in the luminance Y; their sum is 1.
    #[must_use]
    pub fn luminance_weights(self) -> DVec3 {
        self.to_xyz().row(1)
    }

    /// The matrix to linear sRGB (Rec. 709), adapted to its white by Bradford's transform, so that grey stays grey.
    /// Saturated colours may become negative: they are outside of what sRGB can show.
    #[must_use]
    pub fn to_srgb(self) -> DMat3 {
        if self == Self::Rec709 {
            return DMat3::IDENTITY;
        }
        let cones = |p: Self| BRADFORD * xyz(p.chromaticities().white);
        let adapt = BRADFORD.inverse() * DMat3::from_diagonal(cones(Self::Rec709) / cones(self)) * BRADFORD;
        Self::Rec709.to_xyz().inverse() * adapt * self.to_xyz()
    }
}

/// XYZ of a chromaticity at Y = 1.
fn xyz(xy: DVec2) -> DVec3 {
    DVec3::new(xy.x, xy.y, 1.0 - xy.x - xy.y) / xy.y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_stays_grey() {
        for p in [Primaries::Radiance, Primaries::Rec709] {
            let white = p.to_srgb() * DVec3::ONE;
            assert!(white.abs_diff_eq(DVec3::ONE, 1e-12), "{p:?}: white becomes {white}");
            assert!((p.luminance_weights().element_sum() - 1.0).abs() < 1e-12, "{p:?}: luminance of white is 1");
        }
    }

    #[test]
    fn luminance_weights_are_the_published_ones() {
        // Radiance's own constants in color.h for these primaries and equal-energy white; Rec. 709's item 3.2.
        let radiance = DVec3::new(0.265_106, 0.670_106, 0.064_788);
        assert!(Primaries::Radiance.luminance_weights().abs_diff_eq(radiance, 1e-5), "Radiance");
        let rec709 = DVec3::new(0.2126, 0.7152, 0.0722);
        assert!(Primaries::Rec709.luminance_weights().abs_diff_eq(rec709, 1e-4), "Rec. 709");
    }

    #[test]
    fn colours_keep_their_hue() {
        let m = Primaries::Radiance.to_srgb();
        for k in 0..3 {
            let c = m.col(k);
            assert_eq!(c.max_position(), k, "primary {k} stays dominant: {c}");
        }
    }
}

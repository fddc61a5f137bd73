//! Colours: CIE 1931 chromaticities from coordinates, spectra, black bodies and mixtures; and their linear RGB.

use glam::{DMat3, DVec2, DVec3};
use std::sync::LazyLock;

/// The 1931 standard observer (CIE 15, table of the 2° colour matching functions) from 380 to 780 nm in steps of
/// 10 nm: x̄, ȳ, z̄ in 1/10000.
const OBSERVER: [[u16; 3]; 41] = [
    [14, 0, 65],
    [42, 1, 201],
    [143, 4, 679],
    [435, 12, 2074],
    [1344, 40, 6456],
    [2839, 116, 13856],
    [3483, 230, 17471],
    [3362, 380, 17721],
    [2908, 600, 16692],
    [1954, 910, 12876],
    [956, 1390, 8130],
    [320, 2080, 4652],
    [49, 3230, 2720],
    [93, 5030, 1582],
    [633, 7100, 782],
    [1655, 8620, 422],
    [2904, 9540, 203],
    [4334, 9950, 87],
    [5945, 9950, 39],
    [7621, 9520, 21],
    [9163, 8700, 17],
    [10263, 7570, 11],
    [10622, 6310, 8],
    [10026, 5030, 3],
    [8544, 3810, 2],
    [6424, 2650, 0],
    [4479, 1750, 0],
    [2835, 1070, 0],
    [1649, 610, 0],
    [874, 320, 0],
    [468, 170, 0],
    [227, 82, 0],
    [114, 41, 0],
    [58, 21, 0],
    [29, 10, 0],
    [14, 5, 0],
    [7, 2, 0],
    [3, 1, 0],
    [2, 1, 0],
    [1, 0, 0],
    [0, 0, 0],
];

/// Wavelength of an entry of [`OBSERVER`] in nm.
#[expect(clippy::cast_precision_loss, reason = "41 entries")]
fn wavelength(index: usize) -> f64 {
    380.0 + 10.0 * index as f64
}

/// Second radiation constant hc/k in m K (CODATA, to the digits that matter for a chromaticity).
const SECOND_RADIATION_CONSTANT: f64 = 1.4388e-2;

/// A chromaticity with less y than this gives no luminance to speak of: a reflectance or exitance cannot be scaled
/// by it. Spectral violet has 0.005.
const LEAST_Y: f64 = 1e-6;

/// CIE 1931 chromaticity (x, y), with y ≥ [`LEAST_Y`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Chromaticity(DVec2);

impl Default for Chromaticity {
    /// Equal-energy white.
    fn default() -> Self {
        Self(DVec2::splat(1.0 / 3.0))
    }
}

impl Chromaticity {
    /// `None` for a colour without luminance.
    pub(super) fn new(x: f64, y: f64) -> Option<Self> {
        (x.is_finite() && y.is_finite() && y >= LEAST_Y).then_some(Self(DVec2::new(x, y)))
    }

    pub(super) fn x(self) -> f64 {
        self.0.x
    }

    pub(super) fn y(self) -> f64 {
        self.0.y
    }

    /// Of a spectrum given at equal distances from `first` to `last` (nm), linear between them and 0 outside.
    /// `None` where nothing of it is visible. `values` has two or more entries, `first` < `last`; single values may be
    /// negative, as measured spectra of dark things and of phosphors are.
    pub(super) fn from_spectrum(first: f64, last: f64, values: &[f64]) -> Option<Self> {
        let largest = values.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
        if values.len() < 2 || largest <= 0.0 {
            return None;
        }
        #[expect(clippy::cast_precision_loss, reason = "lists are short against 2^52")]
        let steps = (values.len() - 1) as f64;
        Self::from_visible(|nm| {
            // 0 … 1 from the first to the last value, without overflow for whatever wavelengths.
            let t = (nm * 0.5 - first * 0.5) / (last * 0.5 - first * 0.5);
            if !(0.0..=1.0).contains(&t) {
                return 0.0;
            }
            let at = t * steps;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 … steps")]
            let index = (at as usize).min(values.len() - 2);
            #[expect(clippy::cast_precision_loss, reason = "lists are short against 2^52")]
            let between = at - index as f64;
            values[index] / largest * (1.0 - between) + values[index + 1] / largest * between
        })
    }

    /// Of a black body at a temperature in K, > 0 (Planck's law). `None` where nothing of it is visible.
    pub(super) fn from_temperature(kelvin: f64) -> Option<Self> {
        // In logarithms, relative to the largest: no temperature overflows.
        let log_power = |nm: f64| {
            let metres = nm * 1e-9;
            let x = SECOND_RADIATION_CONSTANT / (metres * kelvin);
            let log_exp_m1 = if x > 700.0 { x } else { x.exp_m1().ln() };
            -5.0 * metres.ln() - log_exp_m1
        };
        let largest = (0..OBSERVER.len()).map(|k| log_power(wavelength(k))).fold(f64::NEG_INFINITY, f64::max);
        if !largest.is_finite() {
            return None;
        }
        Self::from_visible(|nm| (log_power(nm) - largest).exp())
    }

    /// Of a mixture of colours, each with its luminance ≥ 0. `None` where all of it is dark.
    pub(super) fn from_mixture(parts: &[(f64, Self)]) -> Option<Self> {
        let largest = parts.iter().map(|part| part.0).fold(0.0, f64::max);
        if largest <= 0.0 {
            return None;
        }
        // X + Y + Z of a colour with luminance w is w/y.
        let (mut sum, mut total) = (DVec2::ZERO, 0.0);
        for &(weight, color) in parts {
            let size = weight / largest / color.y();
            sum += color.0 * size;
            total += size;
        }
        Self::new(sum.x / total, sum.y / total)
    }

    /// Sums a spectrum of nm ↦ 0 … 1 over the observer, normalised such that a flat one is white.
    fn from_visible(spectrum: impl Fn(f64) -> f64) -> Option<Self> {
        let (mut sum, mut white) = (DVec3::ZERO, DVec3::ZERO);
        for (k, weights) in OBSERVER.iter().enumerate() {
            let weights = DVec3::from(weights.map(f64::from));
            sum += weights * spectrum(wavelength(k));
            white += weights;
        }
        let xyz = sum / white;
        let total = xyz.element_sum();
        if total > 1e-12 { Self::new(xyz.x / total, xyz.y / total) } else { None }
    }

    /// Linear RGB (primaries R (.640,.330) G (.290,.600) B (.150,.060), equal-energy white) of this colour with
    /// luminance `level` ≥ 0. A colour that these primaries cannot show is mixed with grey of the same luminance until
    /// no channel is negative.
    pub(super) fn to_rgb(self, level: f64) -> DVec3 {
        let Self(DVec2 { x, y }) = self;
        let rgb = *XYZ_TO_RGB * DVec3::new(x, y, 1.0 - x - y) / y;
        let lowest = rgb.min_element();
        // keep · lowest + (1 − keep) · 1 = 0, with 1 for grey.
        let keep = if lowest < 0.0 { 1.0 / (1.0 - lowest) } else { 1.0 };
        ((rgb * keep + (1.0 - keep)) * level).max(DVec3::ZERO)
    }
}

/// From CIE XYZ to the RGB of MGF files: the inverse of the primaries' XYZ, scaled such that they add up to white
/// with Y = 1.
static XYZ_TO_RGB: LazyLock<DMat3> = LazyLock::new(|| {
    let xyz = |x: f64, y: f64| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let primaries = DMat3::from_cols(xyz(0.640, 0.330), xyz(0.290, 0.600), xyz(0.150, 0.060));
    let scale = primaries.inverse() * xyz(1.0 / 3.0, 1.0 / 3.0);
    (primaries * DMat3::from_diagonal(scale)).inverse()
});

#[cfg(test)]
mod tests {
    use super::*;

    /// Luminance weights of the primaries: the second row of RGB → XYZ, by hand from the chromaticities.
    const Y: DVec3 = DVec3::new(0.265_105_82, 0.670_105_82, 0.064_788_36);

    fn xy(x: f64, y: f64) -> Chromaticity {
        Chromaticity::new(x, y).expect("a colour")
    }

    fn assert_xy(c: Option<Chromaticity>, x: f64, y: f64, tolerance: f64, what: &str) {
        let c = c.expect(what);
        assert!((c.x() - x).abs() <= tolerance && (c.y() - y).abs() <= tolerance, "{what}: {c:?} is not {x}, {y}");
    }

    #[test]
    fn grey_and_primaries() {
        let grey = Chromaticity::default().to_rgb(0.7);
        assert!((grey - 0.7).abs().max_element() < 1e-14, "grey stays grey: {grey}");
        for (k, (x, y)) in [(0.640, 0.330), (0.290, 0.600), (0.150, 0.060)].into_iter().enumerate() {
            let mut expected = DVec3::ZERO;
            expected[k] = 1.0;
            let rgb = xy(x, y).to_rgb(Y[k]);
            assert!((rgb - expected).abs().max_element() < 1e-7, "primary {k}: {rgb}");
        }
        // Halfway between the red and green primary in XYZ, by hand: Y = (.26510582 + .67010582)/2 over
        // X + Y + Z = .26510582/.33 and .67010582/.6.
        let (red, green) = (Y.x / 0.33, Y.y / 0.6);
        let (x, y) = ((0.640 * red + 0.290 * green) / (red + green), (0.33 * red + 0.6 * green) / (red + green));
        let rgb = xy(x, y).to_rgb(0.5 * (Y.x + Y.y));
        assert!((rgb - DVec3::new(0.5, 0.5, 0.0)).abs().max_element() < 1e-7, "yellow: {rgb}");
    }

    #[test]
    fn out_of_gamut_keeps_its_luminance() {
        for (x, y) in [(0.0, 0.38), (0.75, 0.1), (0.73, 0.27), (0.17, 0.005), (0.3, LEAST_Y), (0.0, 1.0)] {
            let rgb = xy(x, y).to_rgb(0.4);
            assert!((rgb.dot(Y) - 0.4).abs() < 1e-7, "({x}, {y}): luminance of {rgb}");
            assert!(rgb.min_element().abs() < 1e-12, "({x}, {y}) is on the border of the gamut: {rgb}");
        }
    }

    #[test]
    fn spectra() {
        assert_xy(Chromaticity::from_spectrum(380.0, 780.0, &[3.0, 3.0]), 1.0 / 3.0, 1.0 / 3.0, 1e-12, "flat");
        // One line of the table: x̄ = 1.0622, ȳ = 0.6310, z̄ = 0.0008 at 600 nm, over the sums of the three tables,
        // 10.6836, 10.6857, 10.6812 (all in units of 10 nm): x/(x+y+z).
        let sums: [f64; 3] = [0, 1, 2].map(|k| OBSERVER.iter().map(|row| f64::from(row[k])).sum());
        for sum in sums {
            assert!((sum / 106_857.0 - 1.0).abs() < 2e-3, "equal-energy white needs three equal sums: {sum}");
        }
        let line = [10_622.0, 6310.0, 8.0].map(f64::from);
        let scaled = [line[0] / sums[0], line[1] / sums[1], line[2] / sums[2]];
        let total: f64 = scaled.iter().sum();
        let expected = (scaled[0] / total, scaled[1] / total);
        let color = Chromaticity::from_spectrum(590.0, 610.0, &[0.0, 7.0, 0.0]);
        assert_xy(color, expected.0, expected.1, 1e-12, "a line between grid points is seen on them alone");
        // Published chromaticity of the spectral locus at 600 nm.
        assert_xy(color, 0.6270, 0.3725, 1e-3, "600 nm");
        // Linear in between: samples at 20 nm of a ramp are the ramp.
        let ramp = |n: usize| (0..n).map(|k| k as f64 / (n - 1) as f64).collect::<Vec<_>>();
        let fine = Chromaticity::from_spectrum(400.0, 700.0, &ramp(31)).expect("a colour");
        assert_xy(Chromaticity::from_spectrum(400.0, 700.0, &ramp(2)), fine.x(), fine.y(), 1e-12, "ramp");
        for (first, last, values) in [
            (380.0, 780.0, &[0.0, 0.0][..]),
            (1000.0, 2000.0, &[1.0, 1.0]),
            (380.0, 780.0, &[1.0]),
            (380.0, 780.0, &[]),
            (-1e308, 1e308, &[0.0, 0.0, 0.0]),
        ] {
            assert_eq!(Chromaticity::from_spectrum(first, last, values), None, "dark: {first} {last} {values:?}");
        }
        assert!(Chromaticity::from_spectrum(-1e308, 1e308, &[1e308, 1e308]).is_some(), "huge numbers");
        assert_eq!(Chromaticity::from_spectrum(400.0, 700.0, &[-1.0, -1.0]), None, "negative");
        assert!(Chromaticity::from_spectrum(400.0, 700.0, &[-0.1, 1.0, 1.0]).is_some(), "noise");
    }

    #[test]
    fn black_bodies() {
        // The Planckian locus (Wyszecki and Stiles, Color Science, table 1(3.11)); illuminant A is 2856 K.
        for (kelvin, x, y) in [(2856.0, 0.4476, 0.4074), (6504.0, 0.3134, 0.3237), (2000.0, 0.5267, 0.4133)] {
            assert_xy(Chromaticity::from_temperature(kelvin), x, y, 1.5e-3, "black body");
        }
        // The Rayleigh–Jeans limit λ⁻⁴ is where every hot body ends.
        let hot = Chromaticity::from_temperature(1e12).expect("a colour");
        assert_xy(Chromaticity::from_temperature(1e200), hot.x(), hot.y(), 1e-6, "hot");
        assert_xy(Some(hot), 0.2399, 0.2341, 1e-3, "the blue end of the locus");
        for kelvin in [1e-300, 1.0, 50.0] {
            assert!(Chromaticity::from_temperature(kelvin).is_none_or(|c| c.x() > 0.6), "{kelvin} K: dark or red");
        }
    }

    #[test]
    fn mixtures() {
        // Luminances 1 and 3 of (.6, .3) and (.3, .6): X + Y + Z = 1/.3 and 3/.6 = 10/3 and 5, X = 2 and 1.5.
        let parts = [(1.0, xy(0.6, 0.3)), (3.0, xy(0.3, 0.6))];
        assert_xy(Chromaticity::from_mixture(&parts), 3.5 / (25.0 / 3.0), 4.0 / (25.0 / 3.0), 1e-14, "by hand");
        let huge = parts.map(|(w, c)| (w * 1e307, c));
        assert_xy(Chromaticity::from_mixture(&huge), 0.42, 0.48, 1e-14, "only ratios count");
        assert_eq!(Chromaticity::from_mixture(&[(0.0, xy(0.3, 0.3))]), None, "dark");
        assert_eq!(Chromaticity::from_mixture(&[]), None, "nothing");
    }
}

//! From radiance to what a screen shows: exposure, a filmic curve, sRGB.

use crate::{Primaries, Rgb};
use glam::{DMat3, DVec3};

/// Exposed luminance of a picture's middle: the key of a normally lit scene in E. Reinhard et al., "Photographic Tone
/// Reproduction for Digital Images", 2002.
const KEY: f64 = 0.18;

/// Shares of a picture's lit pixels, by luminance, that automatic exposure looks at: neither deep shadow nor lamps and
/// windows, which would otherwise pull the whole picture up or down.
const MIDDLE: (f64, f64) = (0.05, 0.90);

/// What is this many stops darker than highlights is not lit: more than film holds, and without it the dim light of what
/// is as good as black would decide.
const RANGE: f64 = 12.0;

/// Highlights are to stay below this exposed luminance, where the curve is at 0.87 and still rises.
const SHOULDER: f64 = 1.5;

/// For highlights' sake the rest is darkened by so much at most, 2 stops: beyond it, the rest would be lost.
const DARKENED: f64 = 4.0;

/// Exposed values are cut here. The curve is white far below, so this only keeps its squares from overflowing.
const BRIGHTEST: f64 = 1e6;

/// Where the [`filmic`] curve reaches 1.
pub const WHITE: f64 = 7.241_658;

/// How bright a picture is printed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// From the picture itself: its log-average luminance, darkest 5 % and brightest 10 % left out, becomes
    /// 0.18, or less, by up to 2 stops, where highlights would burn out. See [`Meter`].
    #[default]
    Auto,
    /// Radiance is multiplied by this factor (≥ 0); 1 shows a radiance of 0.18 W/(m² sr) as that.
    Factor(f32),
}

/// How radiance becomes colours on the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToneMap {
    /// How bright.
    pub exposure: Exposure,
    /// Stops (factors of two) on top of `exposure`; 0 changes nothing.
    pub stops: f32,
}

impl ToneMap {
    /// The factor that pixels are to be multiplied by; finite, ≥ 0 and the same for the same pixels. For a sequence of
    /// pictures, take it from one of them and use [`Exposure::Factor`], so that they do not flicker.
    #[must_use]
    pub fn factor(&self, pixels: &[Rgb], primaries: Primaries) -> f32 {
        let base = match self.exposure {
            Exposure::Auto => {
                let weights = primaries.luminance_weights();
                let mut meter = Meter::default();
                for pixel in pixels {
                    meter.add(pixel.as_dvec3().dot(weights), 1.0);
                }
                // Lamps are among the pixels: the brightest tenth may burn out.
                meter.factor(1.0 - MIDDLE.1).unwrap_or(1.0)
            }
            Exposure::Factor(factor) => f64::from(factor),
        };
        let factor = base * f64::from(self.stops).exp2();
        if factor.is_nan() { 1.0 } else { factor.clamp(0.0, f64::from(f32::MAX)) as f32 }
    }

    /// Everything decided: turns single pixels of this picture into screen colours.
    #[must_use]
    pub fn print(&self, pixels: &[Rgb], primaries: Primaries) -> Print {
        let factor = f64::from(self.factor(pixels, primaries));
        Print { to_srgb: primaries.to_srgb(), factor }
    }
}

/// A tone map with its exposure settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Print {
    to_srgb: DMat3,
    factor: f64,
}

impl Print {
    /// Radiance to linear sRGB (Rec. 709), each channel 0…1. Not-a-number is black, infinity white.
    #[must_use]
    pub fn linear(&self, radiance: Rgb) -> Rgb {
        let finite = radiance.to_array().map(|v| if v.is_nan() { 0.0 } else { v.clamp(f32::MIN, f32::MAX) });
        // Cut on both sides of the matrix: before it nothing may overflow, after it no negative channel may remain.
        let exposed = (Rgb::from(finite).as_dvec3() * self.factor).clamp(DVec3::ZERO, DVec3::splat(BRIGHTEST));
        printed(self.to_srgb * exposed).as_vec3()
    }

    /// Radiance to 8-bit sRGB.
    #[must_use]
    pub fn srgb8(&self, radiance: Rgb) -> [u8; 3] {
        self.linear(radiance).to_array().map(|v| (255.0 * srgb_transfer(v.into())).round() as u8)
    }
}

/// The [`filmic`] curve of an exposed colour, linear sRGB, which keeps its hue: the curve is taken of the largest and the
/// smallest channel, and the third stays as far between them as it was. Taken of each channel alone, it would turn the
/// hue toward the channels' nearest mixture: orange toward yellow, blue with some green toward cyan. Colours brighter than
/// white are printed as the brightest of their chromaticity, so that red light stays red however strong it is.
fn printed(exposed: DVec3) -> DVec3 {
    let color = exposed.max(DVec3::ZERO);
    let color = color * (WHITE / color.max_element()).min(1.0);
    let (low, high) = (color.min_element(), color.max_element());
    if high <= low {
        return DVec3::splat(filmic(low));
    }
    let (dark, bright) = (filmic(low), filmic(high));
    DVec3::splat(dark) + (color - low) * ((bright - dark) / (high - low))
}

/// The filmic curve: a toe that deepens shadows, a shoulder that rolls highlights off; 0 → 0, ≥ [`WHITE`] → 1, rising in
/// between. Below 0 it is 0.
///
/// K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2016: a fit to the ACES reference rendering transform.
#[must_use]
pub fn filmic(x: f64) -> f64 {
    let x = x.clamp(0.0, 2.0 * BRIGHTEST);
    ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0)
}

/// The sRGB transfer function (IEC 61966-2-1) of a linear value in 0…1.
#[must_use]
pub fn srgb_transfer(linear: f64) -> f64 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// An exposure meter: a histogram of luminances. The order in which they are added hardly matters.
///
/// The geometric mean of what is lit becomes the key (E. Reinhard et al., equation 1), as long as highlights stay below the
/// curve's shoulder: else all is darkened, down to a bound.
#[derive(Clone, Debug)]
pub struct Meter {
    /// Weights, and sums of weight times binary logarithm, by the exponents of `f32`.
    bins: Vec<(f64, f64)>,
}

const BINS_PER_STOP: f64 = 16.0;
const DARKEST: f64 = -150.0;
const BINS: usize = (280.0 * BINS_PER_STOP) as usize;

impl Default for Meter {
    fn default() -> Self {
        Self { bins: vec![(0.0, 0.0); BINS] }
    }
}

impl Meter {
    /// Adds a luminance, W/(m² sr), that so many pixels or so much area shows. What is black or not finite does not count.
    pub fn add(&mut self, luminance: f64, weight: f64) {
        if luminance > 0.0 && luminance.is_finite() && weight > 0.0 {
            let stops = luminance.log2();
            let bin = ((stops - DARKEST) * BINS_PER_STOP).max(0.0) as usize;
            let (total, sum) = &mut self.bins[bin.min(BINS - 1)];
            *total += weight;
            *sum += weight * stops;
        }
    }

    /// What luminances are to be multiplied by: the mean of what is lit, darkest 5 % and brightest 10 % left out, becomes
    /// 0.18, or less, by up to 2 stops, if more than the share `highlights` of all would be above the curve's shoulder.
    /// `None` where nothing is lit.
    #[must_use]
    pub fn factor(&self, highlights: f64) -> Option<f64> {
        let total: f64 = self.bins.iter().map(|(weight, _)| weight).sum();
        let mut below = 0.0;
        let bright = self.bins.iter().position(|(weight, _)| {
            below += weight;
            *weight > 0.0 && below >= total * (1.0 - highlights)
        })?;
        let lit = &self.bins[bright.saturating_sub((RANGE * BINS_PER_STOP) as usize)..];
        let total: f64 = lit.iter().map(|(weight, _)| weight).sum();
        let (low, high) = (total * MIDDLE.0, total * MIDDLE.1);
        let (mut sum, mut counted, mut below) = (0.0, 0.0, 0.0);
        for (weight, stops) in lit.iter().filter(|(weight, _)| *weight > 0.0) {
            // The part of this bin that lies between the two shares.
            let above = below + weight;
            let part = (above.min(high) - below.max(low)).max(0.0);
            sum += part * (stops / weight);
            counted += part;
            below = above;
        }
        if counted <= 0.0 {
            return None;
        }
        let factor = KEY / (sum / counted).exp2();
        let (weight, stops) = self.bins[bright];
        let over = factor * (stops / weight).exp2() / SHOULDER;
        Some(factor / over.clamp(1.0, DARKENED))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn greys(values: &[f32]) -> Vec<Rgb> {
        values.iter().map(|&v| Rgb::splat(v)).collect()
    }

    #[test]
    fn curve_rises_from_black_to_white() {
        assert_eq!(filmic(0.0), 0.0, "black");
        assert_eq!(filmic(WHITE), 1.0, "white");
        assert!(filmic(WHITE - 1e-4) < 1.0, "not white before");
        // 0.18 (2.51·0.18 + 0.03) / (0.18 (2.43·0.18 + 0.59) + 0.14)
        assert!((filmic(0.18) - 0.266_90).abs() < 1e-5, "the key: {}", filmic(0.18));
        let mut last = 0.0;
        for k in 1..3000 {
            let y = filmic(f64::from(k) * 0.0024);
            assert!(y > last, "strictly rising below the white point, at {k}");
            last = y;
        }
        assert_eq!(filmic(f64::INFINITY), 1.0, "no overflow");
        assert_eq!(filmic(-1.0), 0.0, "no negative light");
    }

    #[test]
    fn print_is_monotone_and_keeps_grey() {
        for primaries in [Primaries::Radiance, Primaries::Rec709] {
            let print = ToneMap { exposure: Exposure::Factor(1.0), stops: 0.0 }.print(&[], primaries);
            let mut last = 0;
            for k in 0..=2000 {
                let [r, g, b] = print.srgb8(Rgb::splat(k as f32 * 0.004));
                assert!(r == g && g == b, "{primaries:?}: grey stays grey at {k}: {r} {g} {b}");
                assert!(r >= last, "{primaries:?}: monotone at {k}");
                last = r;
            }
            assert_eq!(last, 255, "{primaries:?}: ends in white");
        }
    }

    #[test]
    fn automatic_exposure_scales_with_the_light() {
        let dim: Vec<_> = (1..400).map(|k| Rgb::new(k as f32, 0.7 * k as f32, 0.3 * k as f32) * 1e-3).collect();
        let map = ToneMap::default();
        let expected = map.factor(&dim, Primaries::Radiance);
        for scale in [1e-30_f32, 1e-6, 3.0, 1e6, 1e30] {
            let lit: Vec<_> = dim.iter().map(|p| *p * scale).collect();
            let ratio = map.factor(&lit, Primaries::Radiance) * scale / expected;
            // A pixel moves by at most one bin of 1/16 stop: 2^(1/16) = 1.044.
            assert!((0.957..1.045).contains(&ratio), "light times {scale:e}: {ratio}");
        }
    }

    #[test]
    fn lamps_and_night_do_not_dominate() {
        let mut values = vec![1.0_f32; 900];
        let map = ToneMap::default();
        let plain = map.factor(&greys(&values), Primaries::Radiance);
        assert!((plain - KEY as f32).abs() < 0.05 * KEY as f32, "grey 1 is exposed to the key: {plain}");
        values.extend([1e5; 60]);
        values.extend([0.0; 500]);
        values.extend([f32::NAN, f32::INFINITY]);
        let lit = map.factor(&greys(&values), Primaries::Radiance);
        assert!((lit / plain - 1.0).abs() < 1e-6, "lamps and black background change nothing: {lit} {plain}");
    }

    #[test]
    fn highlights_are_kept_and_darkness_is_not_lit() {
        let map = ToneMap::default();
        let factor = |values: &[(f32, usize)]| {
            let pixels: Vec<f32> = values.iter().flat_map(|&(v, n)| vec![v; n]).collect();
            map.factor(&greys(&pixels), Primaries::Rec709)
        };
        let plain = factor(&[(1.0, 1000)]);
        // A fifth is 20 times as bright: the mean of the middle, 70 parts of 1 and 15 of 20 (5 % and 10 % are left out of
        // each end), is 20^(10/85) of a wall's, so the fifth would come to 0.18 · 20^(75/85) = 2.53.
        let bright = factor(&[(1.0, 800), (20.0, 200)]) * 20.0;
        assert!((f64::from(bright) / SHOULDER - 1.0).abs() < 1e-3, "as bright as the shoulder: {bright}");
        // A thousand times as bright: the wall is darkened by 2 stops and no more.
        let wall = factor(&[(1.0, 850), (1000.0, 150)]);
        let mean = 1000.0_f32.powf(5.0 / 85.0);
        assert!((wall * 4.0 * mean / plain - 1.0).abs() < 1e-3, "2 stops: {wall} {plain}");
        // Next to nothing is no light, even where most of the picture is that.
        let among = factor(&[(1e-5, 700), (1.0, 300)]);
        assert!((among / plain - 1.0).abs() < 1e-3, "a bright thing in the dark: {among} {plain}");
    }

    #[test]
    fn hues_are_kept() {
        // Position of the middle channel between the others, which is what hue is within a sixth of the circle.
        let place = |c: Rgb| (c.y - c.z) / (c.x - c.z);
        let print = ToneMap { exposure: Exposure::Factor(1.0), stops: 0.0 }.print(&[], Primaries::Rec709);
        for color in [Rgb::new(1.0, 0.5, 0.1), Rgb::new(1.0, 0.03, 0.0), Rgb::new(1.0, 0.9, 0.8)] {
            let mut last = 0.0;
            for k in -10..=20 {
                let light = color * (0.5 * k as f32).exp2();
                let out = print.linear(light);
                assert!((place(out) - place(color)).abs() < 1e-3, "{light} becomes {out}");
                assert!(out.x >= last, "{light}: monotone");
                last = out.x;
            }
            assert!(last > 0.999, "{color}: ends as bright as can be: {last}");
        }
        let red = print.srgb8(Rgb::new(1e5, 10.0, 10.0));
        assert!(red[0] == 255 && red[1] < 4 && red[2] < 4, "strong red light is red: {red:?}");
    }

    #[test]
    fn every_input_gives_a_colour() {
        let hard = [0.0, -1.0, 1e-45, f32::MIN_POSITIVE, 1.0, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
        let exposures = hard.map(Exposure::Factor);
        let mut pictures: Vec<Vec<Rgb>> = hard.iter().map(|&v| greys(&[v])).collect();
        pictures.push(vec![]);
        pictures.push(greys(&hard));
        for exposure in exposures.into_iter().chain([Exposure::Auto]) {
            for stops in hard {
                for pixels in &pictures {
                    let print = ToneMap { exposure, stops }.print(pixels, Primaries::Radiance);
                    for r in hard {
                        let out = print.linear(Rgb::new(r, f32::MAX, 1.0));
                        assert!(
                            out.cmpge(Rgb::ZERO).all() && out.cmple(Rgb::ONE).all(),
                            "{exposure:?} {stops} {pixels:?} {r}: {out}"
                        );
                    }
                }
            }
        }
        let black = ToneMap::default().print(&greys(&[0.0; 8]), Primaries::Radiance);
        assert_eq!(black.srgb8(Rgb::ZERO), [0; 3], "a black picture is black");
    }

    #[test]
    fn stops_are_factors_of_two() {
        let pixels = greys(&[0.1, 0.4, 2.0]);
        for exposure in [Exposure::Auto, Exposure::Factor(3.0)] {
            let at = |stops| ToneMap { exposure, stops }.factor(&pixels, Primaries::Rec709);
            assert_eq!(at(2.0), 4.0 * at(0.0), "{exposure:?}");
        }
    }

    #[test]
    fn transfer_is_srgb() {
        // IEC 61966-2-1: 8-bit code 118 is middle grey 0.1812.
        assert!((srgb_transfer(0.181_164_2) * 255.0 - 118.0).abs() < 1e-3, "middle grey");
        assert_eq!(srgb_transfer(0.0), 0.0, "black");
        assert!((srgb_transfer(1.0) - 1.0).abs() < 1e-12, "white");
    }
}

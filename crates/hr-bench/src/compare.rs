//! How far an image is from a reference, as numbers that the reference's noise does not spoil.
//!
//! With a the image and r the reference, over the pixels compared and their three channels, nothing fitted:
//!
//! | number | formula |
//! | --- | --- |
//! | bias | Σ a / Σ r − 1 |
//! | pixel L1 | Σ \|a − r\| / Σ r |
//! | block L1 | Σ \|A − R\| / Σ R, A and R being sums over the compared pixels of a block of 8 × 8 pixels |
//! | p95 | 95th percentile of Σ \|A − R\| / Σ R of single blocks, those left out that are darker than 5 % of the mean |
//!
//! Block L1 is the headline: independent noise of the pixels is down to an eighth in it. Blocks that do not fit into
//! the image at the right and lower border are left out.

use crate::BenchError;
use hr_scene::{Image, Primaries, Rgb};
use std::fmt;

/// Side of a block in pixels.
pub const BLOCK: usize = 8;
/// Blocks darker than this share of the mean are left out of [`Difference::p95`].
const DARK: f64 = 0.05;

/// How far an image is from a reference; the formulas are in the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Pixels compared.
    pub compared: usize,
    /// Pixels of the image.
    pub pixels: usize,
    /// Pixels of the image with a negative channel.
    pub negative: usize,
    /// Too bright (> 0) or too dark on the whole.
    pub bias: f64,
    /// The headline error.
    pub block_l1: f64,
    /// Error of single pixels.
    pub pixel_l1: f64,
    /// Error that 95 % of the blocks stay below.
    pub p95: f64,
    /// Part of `pixel_l1` that the reference's noise explains, where that is known.
    pub noise: Option<f64>,
}

/// Luminance in the Radiance primaries, as thresholds for "sees an emitter" are given.
#[must_use]
pub fn luminance(color: Rgb) -> f64 {
    Primaries::Radiance.luminance_weights().dot(color.as_dvec3())
}

/// Compares the pixels for which `keep` (index, the reference's pixel) holds and whose reference is not black. `sigma`
/// is the reference's standard error.
///
/// # Errors
/// [`BenchError::Compare`] where sizes differ, a number is not finite, or no pixel and no block is left.
pub fn compare(
    image: &Image,
    reference: &Image,
    sigma: Option<&Image>,
    keep: impl Fn(usize, Rgb) -> bool,
) -> Result<Difference, BenchError> {
    let wrong = |what: String| Err(BenchError::Compare(what));
    let (width, height) = (reference.width as usize, reference.height as usize);
    for other in std::iter::once(image).chain(sigma) {
        if (other.width, other.height) != (reference.width, reference.height) {
            return wrong(format!("{} x {} pixels against {width} x {height}", other.width, other.height));
        }
    }
    let broken = |image: &Image| image.pixels.iter().filter(|p| !p.is_finite()).count();
    let not_finite = broken(image) + broken(reference);
    if not_finite > 0 {
        return wrong(format!("{not_finite} pixels are infinite or NaN"));
    }
    let kept: Vec<bool> = reference.pixels.iter().enumerate().map(|(i, &p)| luminance(p) > 0.0 && keep(i, p)).collect();
    let sum = |channels: Rgb| channels.as_dvec3().element_sum();
    let (mut total, mut ours, mut pixel, mut explained) = (0.0, 0.0, 0.0, 0.0);
    for i in (0..kept.len()).filter(|&i| kept[i]) {
        let (a, r) = (image.pixels[i], reference.pixels[i]);
        total += sum(r);
        ours += sum(a);
        pixel += sum((a - r).abs());
        // The mean of |x| for a normal distribution.
        explained += sigma.map_or(0.0, |s| sum(s.pixels[i])) * std::f64::consts::FRAC_2_PI.sqrt();
    }
    let mut blocks = Vec::new();
    for y in (0..(height + 1).saturating_sub(BLOCK)).step_by(BLOCK) {
        for x in (0..(width + 1).saturating_sub(BLOCK)).step_by(BLOCK) {
            let inside = (y..y + BLOCK).flat_map(|y| (x..x + BLOCK).map(move |x| y * width + x));
            let (mut a, mut r) = (glam::DVec3::ZERO, glam::DVec3::ZERO);
            for i in inside.filter(|&i| kept[i]) {
                a += image.pixels[i].as_dvec3();
                r += reference.pixels[i].as_dvec3();
            }
            if r.element_sum() > 0.0 {
                blocks.push(((a - r).abs().element_sum(), r.element_sum()));
            }
        }
    }
    let block_total: f64 = blocks.iter().map(|(_, r)| r).sum();
    if blocks.is_empty() || total <= 0.0 {
        return wrong("nothing is left that is neither black nor left out".into());
    }
    let bright = DARK * block_total / blocks.len() as f64;
    let mut relative: Vec<f64> = blocks.iter().filter(|(_, r)| *r > bright).map(|(e, r)| e / r).collect();
    relative.sort_by(f64::total_cmp);
    Ok(Difference {
        compared: kept.iter().filter(|&&k| k).count(),
        pixels: kept.len(),
        negative: image.pixels.iter().filter(|p| p.min_element() < 0.0).count(),
        bias: ours / total - 1.0,
        block_l1: blocks.iter().map(|(e, _)| e).sum::<f64>() / block_total,
        pixel_l1: pixel / total,
        p95: relative[(0.95 * (relative.len() - 1) as f64) as usize],
        noise: sigma.map(|_| explained / total),
    })
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |v: f64| 100.0 * v;
        write!(
            f,
            "pixels compared {}/{}, bias {:+.2} %, block L1 {:.2} %, p95 {:.1} %, pixel L1 {:.2} %",
            self.compared,
            self.pixels,
            percent(self.bias),
            percent(self.block_l1),
            percent(self.p95),
            percent(self.pixel_l1)
        )?;
        if let Some(noise) = self.noise {
            write!(f, " (reference noise {:.2} %)", percent(noise))?;
        }
        if self.negative > 0 {
            write!(f, ", {} pixels are negative", self.negative)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(width: u32, height: u32, color: impl Fn(usize, usize) -> Rgb) -> Image {
        let mut image = Image::new(width, height);
        for (i, p) in image.pixels.iter_mut().enumerate() {
            *p = color(i % width as usize, i / width as usize);
        }
        image
    }

    fn close(found: f64, expected: f64, what: &str) {
        assert!((found - expected).abs() < 1e-6, "{what}: {found}, by hand {expected}");
    }

    #[test]
    fn numbers_worked_out_by_hand() {
        // 20 x 9: two whole blocks; columns from 16 and row 8 belong to none.
        let reference = filled(20, 9, |x, _| if x < 8 { Rgb::ONE } else { Rgb::splat(3.0) });
        // Left block: +0.5 and -0.5 alternating. Right: 10 % too bright in red. Rest: right.
        let image = filled(20, 9, |x, y| match (x, y) {
            (_, 8) | (16.., _) => Rgb::splat(if x < 8 { 1.0 } else { 3.0 }),
            (..8, _) => Rgb::splat(if (x + y) % 2 == 0 { 1.5 } else { 0.5 }),
            _ => Rgb::new(3.3, 3.0, 3.0),
        });
        let sigma = filled(20, 9, |_, _| Rgb::splat(0.1));
        let found = compare(&image, &reference, Some(&sigma), |_, _| true).expect("comparable");
        let total = 3.0 * (72.0 * 1.0 + 108.0 * 3.0);
        assert_eq!((found.compared, found.pixels, found.negative), (180, 180, 0), "pixels");
        close(found.bias, 64.0 * 0.3 / total, "bias");
        close(found.pixel_l1, (64.0 * 1.5 + 64.0 * 0.3) / total, "pixel L1");
        // The left block's errors cancel: 0 of 192; the right one's are 19.2 of 576.
        close(found.block_l1, 19.2 / 768.0, "block L1");
        close(found.p95, 0.0, "p95 of two blocks is the lower one");
        let noise = 180.0 * 0.3 * (2.0 / std::f64::consts::PI).sqrt() / total;
        assert!((found.noise.expect("sigma was given") - noise).abs() < 1e-6, "noise");
    }

    #[test]
    fn what_is_left_out_does_not_count() {
        let reference = filled(8, 8, |x, y| match (x, y) {
            (0, 0) => Rgb::splat(100.0),
            (1, _) => Rgb::ZERO,
            _ => Rgb::ONE,
        });
        let image = filled(8, 8, |x, _| if x < 2 { Rgb::splat(-7.0) } else { Rgb::ONE });
        let found = compare(&image, &reference, None, |i, p| luminance(p) < 50.0 && i % 8 != 0).expect("comparable");
        assert_eq!((found.compared, found.negative), (48, 16), "black, bright and unwanted pixels");
        assert_eq!((found.bias, found.block_l1, found.noise), (0.0, 0.0, None), "the rest is equal");
    }

    #[test]
    fn what_cannot_be_compared_is_an_error() {
        let one = filled(8, 8, |_, _| Rgb::ONE);
        let nan = filled(8, 8, |x, _| if x == 3 { Rgb::NAN } else { Rgb::ONE });
        let dark = Image::new(8, 8);
        let small = filled(7, 8, |_, _| Rgb::ONE);
        for (image, reference, hint) in
            [(&small, &one, "7 x 8"), (&nan, &one, "8 pixels"), (&one, &dark, "nothing"), (&small, &small, "nothing")]
        {
            let error = compare(image, reference, None, |_, _| true).expect_err(hint).to_string();
            assert!(error.contains(hint), "'{error}' should say '{hint}'");
        }
    }
}

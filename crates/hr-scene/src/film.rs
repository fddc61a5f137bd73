//! Pictures that know what their pixels see of each surface.
//!
//! A print shows less than radiance: a lamp is white, were it a hundred times as bright. Were the samples of a pixel averaged
//! as radiance, the least corner of a lamp would make the whole pixel white, and its edge jagged. What a screen shows is light,
//! too, and the mean of a pixel is that of its prints. But samples are noisy, and the curve bends: the mean of their prints would
//! be darker than the print of their mean. So samples of the same surface are averaged as radiance, and what is then printed
//! of each surface is averaged by its share of the pixel, as graphics devices do it that shade once and sample edges.

use crate::tonemap::{Print, srgb_transfer};
use crate::{Image, Primaries, Rgb};
use crate::{ImageKind, SceneError, ToneMap};
use glam::DVec3;
use std::path::Path;

/// Surfaces look alike in a pixel that differ by no more than this share of its mean.
const ALIKE: f32 = 0.05;

/// What a pixel sees of one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Part {
    surface: Option<u32>,
    sum: DVec3,
    /// Of the means of the channels.
    squares: f64,
    samples: u32,
    /// Rays that met it, samples included.
    covered: u32,
}

impl Part {
    fn mean(&self) -> DVec3 {
        self.sum / f64::from(self.samples)
    }
}

/// Samples of a pixel, by surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pixel {
    parts: Vec<Part>,
}

impl Pixel {
    /// Adds the radiance, W/(m² sr), of a sample of a surface, or of none.
    pub fn add(&mut self, surface: Option<u32>, radiance: Rgb) {
        let sum = radiance.as_dvec3();
        let squares = (sum.element_sum() / 3.0).powi(2);
        match self.parts.iter_mut().find(|part| part.surface == surface) {
            Some(part) => {
                part.sum += sum;
                part.squares += squares;
                part.samples += 1;
                part.covered += 1;
            }
            None => self.parts.push(Part { surface, sum, squares, samples: 1, covered: 1 }),
        }
    }

    /// Counts a ray that met a surface, or none, and brings no light: how much of the pixel a surface covers is then known better than
    /// its light. Whether there is a sample of that surface; where there is none, nothing is counted.
    pub fn cover(&mut self, surface: Option<u32>) -> bool {
        let part = self.parts.iter_mut().find(|part| part.surface == surface);
        let is_known = part.is_some();
        if let Some(part) = part {
            part.covered += 1;
        }
        is_known
    }

    /// Mean radiance; black without samples, and where noise makes it less than nothing, as it may that of a sample.
    #[must_use]
    pub fn radiance(&self) -> Rgb {
        self.mean().as_vec3().max(Rgb::ZERO)
    }

    fn mean(&self) -> DVec3 {
        let sum: DVec3 = self.parts.iter().map(|part| part.mean() * f64::from(part.covered)).sum();
        sum / f64::from(self.rays().max(1))
    }

    /// Whether several surfaces are seen.
    #[must_use]
    pub fn has_edge(&self) -> bool {
        self.parts.len() > 1
    }

    /// Whether the surfaces that it sees look different.
    #[must_use]
    pub fn has_contrast(&self) -> bool {
        Self::contrast(&std::iter::once(self)) > ALIKE
    }

    /// By how much the surfaces that pixels see differ, in terms of the mean of all: the channel where that is most. Nothing where
    /// all see one surface, or black.
    pub fn contrast<'a>(pixels: &(impl Iterator<Item = &'a Self> + Clone)) -> f32 {
        let parts = || pixels.clone().flat_map(|pixel| &pixel.parts);
        let first = parts().next().map(|part| part.surface);
        if parts().all(|part| Some(part.surface) == first) {
            return 0.0;
        }
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut sum, mut rays) = (DVec3::ZERO, 0.0);
        for part in parts() {
            let (mean, covered) = (part.mean(), f64::from(part.covered));
            (low, high) = (low.min(mean), high.max(mean));
            (sum, rays) = (sum + mean * covered, rays + covered);
        }
        let (difference, mean) = ((high - low).max_element(), (sum / rays).max_element());
        if mean > 0.0 { (difference / mean) as f32 } else { 0.0 }
    }

    /// Standard error of what is seen of the surfaces, were samples independent, in terms of the mean; 0 where nothing is known of it.
    #[must_use]
    pub fn noise(&self) -> f32 {
        let (mut variance, mut light) = (0.0, 0.0);
        for part in &self.parts {
            let (n, mean) = (f64::from(part.samples), part.mean().element_sum() / 3.0);
            let rays = f64::from(part.covered);
            light += rays * mean;
            if part.samples > 1 {
                variance += rays * rays * (part.squares / n - mean * mean).max(0.0) / (n - 1.0);
            }
        }
        if light > 0.0 { (variance.sqrt() / light) as f32 } else { 0.0 }
    }

    fn rays(&self) -> u32 {
        self.parts.iter().map(|part| part.covered).sum()
    }
}

/// A picture of linear radiance, and what is printed otherwise of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Mean radiance of each pixel.
    pub image: Image,
    /// Pixels that are printed from their own samples.
    own: Vec<(usize, Pixel)>,
}

impl Film {
    /// A picture, and those of its pixels that are printed otherwise, because they see several surfaces or have more samples: their
    /// places in it and their samples.
    #[must_use]
    pub fn new(image: Image, own: Vec<(usize, Pixel)>) -> Self {
        Self { image, own }
    }

    /// Saves as [`Image::save`] does; only a `.png` shows the difference.
    ///
    /// # Errors
    /// As there.
    pub fn save(&self, path: &Path, tone_map: &ToneMap, primaries: Primaries) -> Result<(), SceneError> {
        match ImageKind::of(path)? {
            ImageKind::Pfm | ImageKind::Exr => self.image.save(path, tone_map, primaries),
            ImageKind::Png => self.image.save_codes(path, &self.to_srgb8(tone_map, primaries)),
        }
    }

    /// Tone-mapped 8-bit sRGB, three bytes a pixel, row 0 on top.
    #[must_use]
    pub fn to_srgb8(&self, tone_map: &ToneMap, primaries: Primaries) -> Vec<u8> {
        let print = tone_map.print(&self.image.pixels, primaries);
        let mut codes: Vec<u8> = self.image.pixels.iter().flat_map(|&p| print.srgb8(p)).collect();
        for (place, pixel) in &self.own {
            if let Some(code) = codes.chunks_exact_mut(3).nth(*place) {
                code.copy_from_slice(&mixed(&print, pixel));
            }
        }
        codes
    }
}

/// The light that a screen shows of a pixel: the mean of what is printed of its surfaces.
fn mixed(print: &Print, pixel: &Pixel) -> [u8; 3] {
    let mut light = DVec3::ZERO;
    for part in &pixel.parts {
        let radiance = part.mean().as_vec3().max(Rgb::ZERO);
        light += print.linear(radiance).as_dvec3() * f64::from(part.covered);
    }
    (light / f64::from(pixel.rays().max(1))).to_array().map(|v| (255.0 * srgb_transfer(v)).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Exposure;

    const MAP: ToneMap = ToneMap { exposure: Exposure::Factor(1.0), stops: 0.0 };

    /// A film of one pixel with samples of a wall and of a lamp.
    fn pixel(wall: u32, lamp: u32) -> Film {
        let mut pixel = Pixel::default();
        (0..wall).for_each(|_| pixel.add(Some(0), Rgb::splat(0.1)));
        (0..lamp).for_each(|_| pixel.add(Some(1), Rgb::splat(500.0)));
        let image = Image { width: 1, height: 1, pixels: vec![pixel.radiance()] };
        Film::new(image, vec![(0, pixel)])
    }

    #[test]
    fn lamps_cover_as_much_of_a_pixel_as_is_seen_of_them() {
        let linear = |film: &Film| {
            let v = f64::from(film.to_srgb8(&MAP, Primaries::Rec709)[0]) / 255.0;
            if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        let (dark, bright) = (linear(&pixel(9, 0)), linear(&pixel(0, 9)));
        assert!(bright == 1.0 && dark < 0.2, "a dark wall and a white lamp: {dark} {bright}");
        for lamp in 1..9 {
            let film = pixel(9 - lamp, lamp);
            let share = f64::from(lamp) / 9.0;
            let expected = dark + (bright - dark) * share;
            // Half a code of 8 bits is 0.5 % of light at most, where the curve is steepest.
            assert!((linear(&film) - expected).abs() < 0.005, "{lamp} of 9: {} not {expected}", linear(&film));
            let radiance = film.image.pixels[0].x;
            assert!((f64::from(radiance) - 0.1 - 499.9 * share).abs() < 1e-3, "radiance is linear: {radiance}");
        }
    }

    #[test]
    fn noise_is_that_within_surfaces() {
        let mut pixel = Pixel::default();
        assert_eq!(pixel.noise(), 0.0, "nothing is known");
        for light in [1.0, 3.0, 1.0, 3.0] {
            pixel.add(Some(0), Rgb::splat(light));
        }
        // Variance of the mean of 4: 1/(4 − 1); the mean is 2.
        assert!((pixel.noise() - (1.0_f32 / 3.0).sqrt() / 2.0).abs() < 1e-6, "{}", pixel.noise());
        (0..4).for_each(|_| pixel.add(Some(1), Rgb::splat(6.0)));
        // Half of the pixel is sure, and the mean is 4.
        assert!((pixel.noise() - 0.5 * (1.0_f32 / 3.0).sqrt() / 4.0).abs() < 1e-6, "{}", pixel.noise());
    }

    #[test]
    fn noise_of_one_surface_does_not_darken_it() {
        let mut pixel = Pixel::default();
        for k in 0..16 {
            pixel.add(Some(7), if k == 0 { Rgb::splat(16.0) } else { Rgb::ZERO });
        }
        let image = Image { width: 1, height: 1, pixels: vec![pixel.radiance()] };
        assert_eq!(image.pixels[0], Rgb::ONE, "a sixteenth of 16");
        let contrast = |pixels: &[Pixel]| Pixel::contrast(&pixels.iter());
        assert!(!pixel.has_edge() && contrast(&[pixel.clone(), pixel.clone()]) == 0.0, "one surface has no edge");
        let printed = Film::new(image.clone(), vec![(0, pixel.clone())]).to_srgb8(&MAP, Primaries::Rec709);
        assert_eq!(printed, image.to_srgb8(&MAP, Primaries::Rec709), "printed as its mean");
        pixel.add(None, Rgb::ZERO);
        assert!(pixel.has_edge() && contrast(&[pixel]) > 1.0, "what is behind it differs");
        let pixels = [1.0_f32, 1.05].map(|light| {
            let mut pixel = Pixel::default();
            pixel.add(Some(light.to_bits()), Rgb::splat(light));
            pixel
        });
        assert!((contrast(&pixels) - 0.05 / 1.025).abs() < 1e-6, "pixels that look alike: {}", contrast(&pixels));
    }

    #[test]
    fn surfaces_count_by_what_they_cover() {
        let mut pixel = Pixel::default();
        assert!(!pixel.cover(Some(0)), "nothing is known of it");
        pixel.add(Some(0), Rgb::splat(1.0));
        pixel.add(Some(0), Rgb::splat(3.0));
        pixel.add(Some(1), Rgb::splat(10.0));
        assert_eq!(pixel.radiance(), Rgb::splat(14.0 / 3.0), "by samples");
        (0..5).for_each(|_| assert!(pixel.cover(Some(1)), "its light is known"));
        assert_eq!(pixel.radiance(), Rgb::splat(8.0), "two rays of 2, six of 10");
        let contrast = Pixel::contrast(&std::iter::once(&pixel));
        assert!((contrast - 1.0).abs() < 1e-6, "{contrast}");
        // Variance of the mean of 2: 1/(2 − 1); it is a quarter of the pixel.
        assert!((pixel.noise() - 0.25 / 8.0).abs() < 1e-6, "{}", pixel.noise());
    }
}

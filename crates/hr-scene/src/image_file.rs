//! Pictures of linear radiance, and the files they are saved to.

use crate::whole_file::write_whole;
use crate::{Primaries, Rgb, SceneError, ToneMap};
use exr::prelude as exr;
use std::io::{self, Seek, Write};
use std::path::Path;

/// A picture of linear radiance in W/(m² sr).
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width · height` pixels, row 0 on top, from left to right.
    pub pixels: Vec<Rgb>,
}

/// The kinds of image files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageKind {
    /// Portable float map: linear, unclamped, 32-bit.
    Pfm,
    /// OpenEXR: linear, unclamped, 32-bit, with the primaries' chromaticities.
    Exr,
    /// Tone-mapped 8-bit sRGB.
    Png,
}

impl ImageKind {
    /// The kind that a file name's extension stands for, in capitals or not.
    ///
    /// # Errors
    /// [`SceneError::Syntax`] for any other extension. Ask before a long computation whose picture could not be saved.
    pub fn of(path: &Path) -> Result<Self, SceneError> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match extension.as_str() {
            "pfm" => Ok(Self::Pfm),
            "exr" => Ok(Self::Exr),
            "png" => Ok(Self::Png),
            _ => Err(SceneError::Syntax {
                place: path.display().to_string(),
                what: if extension.is_empty() {
                    "the name has no extension".to_owned()
                } else {
                    format!("'.{extension}' is no kind of image that can be written")
                },
                mend: "end the name in .pfm or .exr (linear radiance) or .png (tone-mapped)".to_owned(),
            }),
        }
    }
}

impl Image {
    /// A black picture.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![Rgb::ZERO; width as usize * height as usize] }
    }

    /// Saves to a file of the kind that its extension says: `.pfm` (little-endian) and `.exr` keep linear radiance in
    /// `primaries`, unclamped, `.png` is tone-mapped to sRGB. The file is written whole or not at all.
    ///
    /// # Errors
    /// [`SceneError::Syntax`] for another extension and for a picture without pixels or with a wrong number of them,
    /// [`SceneError::Io`] where the file cannot be written.
    pub fn save(&self, path: &Path, tone_map: &ToneMap, primaries: Primaries) -> Result<(), SceneError> {
        let kind = ImageKind::of(path)?;
        self.check(path)?;
        write_whole(path, |out| match kind {
            ImageKind::Pfm => self.write_pfm(out),
            ImageKind::Exr => self.write_exr(out, primaries),
            ImageKind::Png => self.write_png(out, &self.to_srgb8(tone_map, primaries)),
        })
    }

    /// Saves a `.png` of three bytes for each pixel, which somebody else has printed.
    pub(crate) fn save_codes(&self, path: &Path, codes: &[u8]) -> Result<(), SceneError> {
        self.check(path)?;
        write_whole(path, |out| self.write_png(out, codes))
    }

    /// Whether there are as many pixels as there should be.
    fn check(&self, path: &Path) -> Result<(), SceneError> {
        if self.pixels.is_empty() || self.pixels.len() != self.width as usize * self.height as usize {
            return Err(SceneError::Syntax {
                place: path.display().to_string(),
                what: format!("{} pixels are no picture of {} x {}", self.pixels.len(), self.width, self.height),
                mend: "give width times height pixels, at least one".to_owned(),
            });
        }
        Ok(())
    }

    /// Tone-mapped 8-bit sRGB, three bytes a pixel, row 0 on top.
    #[must_use]
    pub fn to_srgb8(&self, tone_map: &ToneMap, primaries: Primaries) -> Vec<u8> {
        let print = tone_map.print(&self.pixels, primaries);
        self.pixels.iter().flat_map(|&p| print.srgb8(p)).collect()
    }

    /// A "PF" file: rows from the bottom up, a negative scale for little-endian.
    fn write_pfm(&self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "PF\n{} {}\n-1.0\n", self.width, self.height)?;
        for row in self.pixels.rchunks_exact(self.width as usize) {
            for channel in row.iter().flat_map(Rgb::to_array) {
                out.write_all(&channel.to_le_bytes())?;
            }
        }
        Ok(())
    }

    fn write_exr(&self, out: &mut (impl Write + Seek), primaries: Primaries) -> io::Result<()> {
        use exr::WritableImage;
        let (width, height) = (self.width as usize, self.height as usize);
        let channels = exr::SpecificChannels::rgb(|at: exr::Vec2<usize>| {
            let Rgb { x, y, z } = self.pixels[at.y() * width + at.x()];
            (x, y, z)
        });
        let mut image = exr::Image::from_encoded_channels((width, height), exr::Encoding::SMALL_LOSSLESS, channels);
        let xy = primaries.chromaticities();
        let point = |p: glam::DVec2| exr::Vec2(p.x as f32, p.y as f32);
        image.attributes.chromaticities = Some(::exr::meta::attribute::Chromaticities {
            red: point(xy.rgb[0]),
            green: point(xy.rgb[1]),
            blue: point(xy.rgb[2]),
            white: point(xy.white),
        });
        image.write().to_buffered(out).map_err(io::Error::other)
    }

    fn write_png(&self, out: &mut impl Write, codes: &[u8]) -> io::Result<()> {
        use image::ImageEncoder;
        image::codecs::png::PngEncoder::new(out)
            .write_image(codes, self.width, self.height, image::ExtendedColorType::Rgb8)
            .map_err(io::Error::other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Folder;
    use crate::tonemap::Exposure;
    use std::fs;

    /// A small picture in which every pixel differs and some are beyond 0…1.
    fn picture() -> Image {
        let mut image = Image::new(5, 3);
        for (k, p) in image.pixels.iter_mut().enumerate() {
            *p = Rgb::new(k as f32 * 0.1, 1e-20 * k as f32, 3.3e7 - k as f32);
        }
        image
    }

    #[test]
    fn pfm_has_the_exact_bytes() {
        let folder = Folder::new("pfm");
        let (path, image) = (folder.path("a.PFM"), picture());
        image.save(&path, &ToneMap::default(), Primaries::Radiance).expect("saved");
        let bytes = fs::read(&path).expect("written");
        let header = b"PF\n5 3\n-1.0\n";
        assert!(bytes.starts_with(header), "header");
        let floats: Vec<f32> =
            bytes[header.len()..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(floats.len(), 5 * 3 * 3, "nothing more, nothing less");
        for (k, p) in image.pixels.iter().enumerate() {
            let (x, row) = (k % 5, k / 5);
            let at = ((2 - row) * 5 + x) * 3;
            assert_eq!(floats[at..at + 3], p.to_array(), "pixel {x} of row {row}, bottom row first");
        }
    }

    #[test]
    fn exr_reads_back_with_its_primaries() {
        let folder = Folder::new("exr");
        for (name, primaries) in [("a.exr", Primaries::Radiance), ("b.exr", Primaries::Rec709)] {
            let (path, image) = (folder.path(name), picture());
            image.save(&path, &ToneMap::default(), primaries).expect("saved");
            let back = exr::read_first_rgba_layer_from_file(
                &path,
                |size, _| Image::new(size.width() as u32, size.height() as u32),
                |image, at, (r, g, b, _): (f32, f32, f32, f32)| {
                    image.pixels[at.y() * image.width as usize + at.x()] = Rgb::new(r, g, b);
                },
            )
            .expect("an EXR file");
            assert_eq!(back.layer_data.channel_data.pixels, image, "{name}: every bit of every pixel");
            let found = back.attributes.chromaticities.expect("chromaticities are there");
            let expected = primaries.chromaticities();
            assert_eq!(found.green.x(), expected.rgb[1].x as f32, "{name}: green");
            assert_eq!(found.white.y(), expected.white.y as f32, "{name}: white");
        }
    }

    #[test]
    fn png_decodes_to_the_print() {
        let folder = Folder::new("png");
        let path = folder.path("a.png");
        let mut image = Image::new(4, 2);
        image.pixels[0] = Rgb::splat(0.13);
        image.pixels[3] = Rgb::splat(1e4);
        image.pixels[4] = Rgb::new(0.5, 0.05, 0.05);
        let map = ToneMap { exposure: Exposure::Factor(1.0), stops: 0.0 };
        image.save(&path, &map, Primaries::Rec709).expect("saved");
        let back = image::open(&path).expect("a PNG file").into_rgb8();
        assert_eq!(back.dimensions(), (4, 2), "size");
        assert_eq!(back.as_raw(), &image.to_srgb8(&map, Primaries::Rec709), "pixels");
        // Middle grey: 18 % linear is code 117.5 by sRGB's transfer function.
        assert!((117..=118).contains(&back.get_pixel(0, 0)[0]), "middle grey: {:?}", back.get_pixel(0, 0));
        assert_eq!(back.get_pixel(1, 0).0, [0; 3], "black");
        assert_eq!(back.get_pixel(3, 0).0, [255; 3], "white");
        let red = back.get_pixel(0, 1);
        assert!(red[0] > 2 * red[1] && red[1] == red[2], "red in the second row: {red:?}");
    }

    #[test]
    fn impossible_pictures_are_errors_and_leave_nothing() {
        let folder = Folder::new("image-errors");
        let short = Image { pixels: vec![Rgb::ONE; 14], ..picture() };
        for (image, name, hint) in [
            (&picture(), "a.jpg", "'.jpg' is no kind of image"),
            (&picture(), "a", "has no extension"),
            (&short, "a.png", "14 pixels are no picture of 5 x 3"),
            (&short, "a.exr", "14 pixels are no picture of 5 x 3"),
            (&Image::new(0, 7), "a.pfm", "0 pixels are no picture of 0 x 7"),
            (&picture(), "no/folder/a.png", "no/folder/a.png"),
        ] {
            let result = image.save(&folder.path(name), &ToneMap::default(), Primaries::Radiance);
            let error = result.expect_err(name).to_string();
            assert!(error.contains(hint), "{name}: '{error}'");
        }
        assert!(folder.names().is_empty(), "no file is left: {:?}", folder.names());
    }
}

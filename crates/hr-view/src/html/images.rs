//! Textures as PNG files.

use super::payload::Payload;
use hr_scene::tonemap::srgb_transfer;
use hr_scene::{Texture, Wrap};
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use serde::Serialize;
use std::io;

/// What the page knows of a texture.
#[derive(Serialize)]
pub(super) struct Picture {
    /// Rows of the transform of texture coordinates.
    u: [f32; 3],
    v: [f32; 3],
    wrap: [&'static str; 2],
}

/// Adds a texture: 8-bit sRGB, as the window shows it.
pub(super) fn add(payload: &mut Payload, index: usize, texture: &Texture) -> io::Result<Picture> {
    let code = |x: f32| (255.0 * srgb_transfer(x.into())).round() as u8;
    let bytes: Vec<u8> = texture.texels.data().iter().flat_map(|texel| texel.to_array().map(code)).collect();
    let mut png = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive);
    let (width, height) = (texture.texels.width(), texture.texels.height());
    encoder.write_image(&bytes, width, height, image::ExtendedColorType::Rgb8).map_err(io::Error::other)?;
    payload.bytes(format!("texture.{index}"), &png);
    let wrap = texture.wrap.map(|wrap| match wrap {
        Wrap::Repeat => "REPEAT",
        Wrap::Mirror => "MIRRORED_REPEAT",
        Wrap::Clamp => "CLAMP_TO_EDGE",
    });
    let [u, v] = [0, 1].map(|row| texture.transform.row(row).to_array());
    Ok(Picture { u, v, wrap })
}

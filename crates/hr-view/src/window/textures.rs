//! Textures on the device: 8-bit sRGB with all mip levels.

use super::gpu::Gpu;
use super::tone::srgb_encode;
use glossy_ext::Rgb;
use hr_scene::{Texture, Wrap};
use std::borrow::Cow;

/// Entries of the table that encodes sRGB: at its steepest the code rises by 12.92 · 255 per unit, so that this many
/// keep every entry well below one code.
const ENCODE: usize = 1 << 14;

/// A mip level: `width · height` linear colours, row 0 first.
struct Level<'a> {
    width: u32,
    height: u32,
    data: Cow<'a, [Rgb]>,
}

/// Uploads textures; keeps the encoding table.
pub(super) struct Uploader<'a> {
    gpu: &'a Gpu,
    encode: Vec<u8>,
}

impl<'a> Uploader<'a> {
    pub(super) fn new(gpu: &'a Gpu) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0…255 by construction")]
        let code = |i: usize| (255.0 * srgb_encode(i as f32 / ENCODE as f32)).round() as u8;
        Self { gpu, encode: (0..=ENCODE).map(code).collect() }
    }

    /// A texture with its sampler.
    pub(super) fn upload(&self, texture: &Texture) -> (wgpu::TextureView, wgpu::Sampler) {
        let texels = &texture.texels;
        let level = Level { width: texels.width(), height: texels.height(), data: texels.data().into() };
        (self.levels(level), self.sampler(texture.wrap))
    }

    fn sampler(&self, wrap: [Wrap; 2]) -> wgpu::Sampler {
        let [address_mode_u, address_mode_v] = wrap.map(|wrap| match wrap {
            Wrap::Repeat => wgpu::AddressMode::Repeat,
            Wrap::Mirror => wgpu::AddressMode::MirrorRepeat,
            Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
        });
        self.gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("texture"),
            address_mode_u,
            address_mode_v,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            anisotropy_clamp: self.gpu.anisotropy(),
            ..wgpu::SamplerDescriptor::default()
        })
    }

    /// All mip levels, from the largest one that the device can hold.
    fn levels(&self, mut level: Level<'_>) -> wgpu::TextureView {
        let limit = self.gpu.device.limits().max_texture_dimension_2d.max(1);
        while level.width > limit || level.height > limit {
            level = halved(&level);
        }
        let (width, height) = (level.width, level.height);
        let mip_level_count = u32::BITS - width.max(height).leading_zeros();
        let texture = self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("texels"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        for mip_level in 0..mip_level_count {
            let bytes: Vec<u8> = level.data.iter().flat_map(|texel| self.encoded(*texel)).collect();
            self.gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo { mip_level, ..texture.as_image_copy() },
                &bytes,
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * level.width), rows_per_image: None },
                wgpu::Extent3d { width: level.width, height: level.height, depth_or_array_layers: 1 },
            );
            if mip_level + 1 < mip_level_count {
                level = halved(&level);
            }
        }
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    }

    fn encoded(&self, texel: Rgb) -> [u8; 4] {
        // Not-a-number casts to 0.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped; saturates")]
        let code = |x: f32| self.encode[(x.clamp(0.0, 1.0) * ENCODE as f32).round() as usize];
        [code(texel.x), code(texel.y), code(texel.z), 255]
    }
}

/// The next mip level: half as wide and high, rounded down, at least 1. Texels are means over the area that they cover,
/// so that sizes that are not powers of two do not shift.
fn halved(texels: &Level<'_>) -> Level<'static> {
    let across = footprints(texels.width);
    let (width, height) = ((texels.width / 2).max(1), (texels.height / 2).max(1));
    let mut data = Vec::with_capacity(width as usize * height as usize);
    for rows in footprints(texels.height) {
        for columns in &across {
            let mut sum = Rgb::ZERO;
            for &(y, wy) in &rows {
                for &(x, wx) in columns {
                    sum += texels.data[y * texels.width as usize + x] * (wx * wy);
                }
            }
            data.push(sum);
        }
    }
    Level { width, height, data: data.into() }
}

/// For each place of the next level, the places of this one that it covers, with weights that add up to 1.
fn footprints(size: u32) -> Vec<Vec<(usize, f32)>> {
    let half = (size / 2).max(1);
    let stride = f64::from(size) / f64::from(half);
    (0..half)
        .map(|i| {
            let (low, high) = (f64::from(i) * stride, f64::from(i + 1) * stride);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 … size")]
            let places = low as usize..(high.ceil() as usize).min(size as usize);
            places
                .map(|x| (x, (((x + 1) as f64).min(high) - (x as f64).max(low)) / stride))
                .filter(|(_, w)| *w > 1e-9)
                .map(|(x, w)| (x, w as f32))
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mip_levels_keep_the_mean() {
        for (width, height) in [(1, 1), (2, 2), (3, 1), (5, 7), (8, 3), (1, 6)] {
            let data: Vec<_> = (0..width * height).map(|i| Rgb::new(i as f32, (i * i) as f32, 1.0)).collect();
            let mean = |t: &Level<'_>| t.data.iter().sum::<Rgb>() / t.data.len() as f32;
            let mut level = Level { width, height, data: data.into() };
            let expected = mean(&level);
            while level.width > 1 || level.height > 1 {
                level = halved(&level);
                assert_eq!(level.data.len(), (level.width * level.height) as usize, "{width} × {height} is filled");
                // f32 sums of at most 35 numbers up to 1200, in another order.
                let off = (mean(&level) - expected).abs().max_element();
                assert!(off < 1e-2, "{width} × {height} drifts by {off}");
            }
        }
    }
}

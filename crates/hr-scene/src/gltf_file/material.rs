//! Materials and their textures.

use super::document::Document;
use crate::reflectors::metallic_roughness;
use crate::texture::{Texels, Texture, Wrap, decode};
use crate::warnings::Warnings;
use crate::{Material, Scene};
use glam::{Mat3, Vec2};
use glossy_ext::Rgb;
use gltf::json;
use gltf::json::material::AlphaMode;
use gltf::json::texture::WrappingMode;
use gltf::json::validation::Checked;
use std::collections::HashMap;
use std::f32::consts::PI;
use std::sync::Arc;

/// What makes a material of the scene: that of the file, whether its base colour texture is applied, and the
/// primitive (mesh, index) whose vertex colours multiply it.
pub(super) type Key = (Option<usize>, bool, Option<(usize, usize)>);

/// Materials as they are first needed.
#[derive(Default)]
pub(super) struct Materials {
    index: HashMap<Key, u32>,
    images: HashMap<(usize, bool), Option<Arc<Texels>>>,
    /// Metallic and roughness factors of the scene's materials.
    factors: Vec<[f32; 2]>,
}

impl Materials {
    /// The index in the scene of a material, which is added if it is new.
    pub(super) fn get(&mut self, key: Key, document: &Document, scene: &mut Scene, warnings: &mut Warnings) -> u32 {
        if let Some(&index) = self.index.get(&key) {
            return index;
        }
        let index = scene.materials.len() as u32;
        self.index.insert(key, index);
        let (number, textured, _) = key;
        let material = match number {
            Some(number) => self.convert(number, textured, document, warnings),
            None => {
                // The default material of the specification, section 5.19: white metal.
                self.factors.push([1.0, 1.0]);
                Material {
                    name: "default".to_owned(),
                    reflector: metallic_roughness(Rgb::ONE, 1.0, 1.0),
                    exitance: Rgb::ZERO,
                    two_sided: false,
                    texture: None,
                    base_color: Rgb::ONE,
                }
            }
        };
        scene.materials.push(material);
        index
    }

    /// Builds the reflectors of textured and coloured materials anew, from their mean base colour.
    pub(super) fn apply_means(&self, scene: &mut Scene) {
        let means = crate::mesh::mean_base_colors(scene);
        for ((material, mean), [metallic, roughness]) in scene.materials.iter_mut().zip(means).zip(&self.factors) {
            if let Some(mean) = mean {
                material.reflector = metallic_roughness(mean.clamp(Rgb::ZERO, Rgb::ONE), *metallic, *roughness);
            }
        }
    }

    fn convert(&mut self, number: usize, textured: bool, document: &Document, warnings: &mut Warnings) -> Material {
        let source = &document.root.materials[number];
        let path = format!("materials[{number}]");
        let name = source.name.clone().unwrap_or_else(|| format!("material {number}"));
        let pbr = &source.pbr_metallic_roughness;
        let mut fixed = false;
        let mut unit = |value: f32| {
            fixed |= !(0.0..=1.0).contains(&value);
            if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
        };
        let [r, g, b, _] = pbr.base_color_factor.0.map(&mut unit);
        let base_color = Rgb::new(r, g, b);
        let mut metallic = unit(pbr.metallic_factor.0);
        let mut roughness = unit(pbr.roughness_factor.0);
        if fixed {
            warnings.add("material factors outside 0…1 are clamped", || path.clone());
        }
        let strength = (source.extensions.as_ref())
            .and_then(|e| e.emissive_strength.as_ref())
            .map_or(1.0, |strength| strength.emissive_strength.0);
        let mut radiance = Rgb::from(source.emissive_factor.0) * strength;
        if !(radiance.is_finite() && radiance.min_element() >= 0.0) {
            warnings.add("emission that is negative or not finite is left out", || path.clone());
            radiance = Rgb::ZERO;
        }

        let mut not_simulated = Vec::new();
        if let Some(info) = &pbr.metallic_roughness_texture {
            // Green is roughness, blue is metallic.
            let place = format!("{path}.pbrMetallicRoughness.metallicRoughnessTexture");
            if let Some(texels) = self.image(document, info.index.value(), false, &place, warnings) {
                let mean = texels.mean();
                roughness *= mean.y;
                metallic *= mean.z;
            }
            not_simulated.push("the metallic-roughness texture is replaced by its mean");
        }
        if let Some(info) = &source.emissive_texture
            && radiance != Rgb::ZERO
        {
            let place = format!("{path}.emissiveTexture");
            if let Some(texels) = self.image(document, info.index.value(), true, &place, warnings) {
                radiance *= texels.mean();
            }
            not_simulated.push("the emissive texture is replaced by its mean");
        }
        if source.normal_texture.is_some() {
            not_simulated.push("the normal texture is left out");
        }
        if source.occlusion_texture.is_some() {
            not_simulated.push("the occlusion texture is left out");
        }
        match source.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => {
                not_simulated
                    .push("alphaMode MASK is taken as opaque; leave the material out if it hides what it should not");
            }
            Checked::Valid(AlphaMode::Blend) => {
                not_simulated.push("alphaMode BLEND is taken as opaque; leave the material out for light to pass");
            }
            _ => {}
        }
        let transmission = source.extensions.as_ref().and_then(|e| e.transmission.as_ref());
        if transmission.is_some_and(|t| t.transmission_factor.0 > 0.0) {
            not_simulated.push("transmission is taken as opaque; leave the material out for light to pass");
        }
        if source.double_sided && radiance != Rgb::ZERO {
            not_simulated.push("a doubleSided emitter emits from its front only");
        }
        if !not_simulated.is_empty() && !self.index.keys().any(|k| k.0 == Some(number) && k.1 != textured) {
            warnings.add(format!("material '{name}': {}", not_simulated.join("; ")), || path.clone());
        }

        let texture = pbr.base_color_texture.as_ref().filter(|_| textured).and_then(|info| {
            let place = format!("{path}.pbrMetallicRoughness.baseColorTexture");
            let texels = self.image(document, info.index.value(), true, &place, warnings)?;
            let transform = transform(info);
            if !transform.is_finite() {
                warnings.add("a texture transform that is not finite is left out", || place);
            }
            let transform = if transform.is_finite() { transform } else { Mat3::IDENTITY };
            Some(Texture { texels, transform, wrap: wrap(document, info.index.value()) })
        });
        self.factors.push([metallic, roughness]);
        Material {
            reflector: metallic_roughness(base_color, metallic, roughness),
            name,
            exitance: PI * radiance,
            two_sided: source.double_sided,
            texture,
            base_color,
        }
    }

    /// The texels of a texture's image; `None`, with a warning, where they cannot be had.
    fn image(
        &mut self,
        document: &Document,
        texture: usize,
        srgb: bool,
        place: &str,
        warnings: &mut Warnings,
    ) -> Option<Arc<Texels>> {
        let number = document.root.textures[texture].source.value();
        if let Some(known) = self.images.get(&(number, srgb)) {
            return known.clone();
        }
        let Some(image) = document.root.images.get(number) else {
            warnings.add("texture left out: it has no image that is PNG or JPEG", || place.to_owned());
            return None;
        };
        let at = format!("images[{number}]");
        let bytes = match (&image.buffer_view, &image.uri) {
            (Some(view), _) => document.view(view.value(), &at).map(std::borrow::Cow::from),
            (None, Some(uri)) => document.read_uri(uri, &at).map(std::borrow::Cow::from),
            (None, None) => Err(document.wrong(&at, "it has neither a uri nor a buffer view", "give it one")),
        };
        let decoded = bytes.map_err(|e| e.to_string()).and_then(|bytes| decode(&bytes, srgb));
        let texels = match decoded {
            Ok((texels, halved)) => {
                if halved {
                    warnings.add("an image of more than 4096 x 4096 pixels is used at a lower resolution", || at);
                }
                Some(Arc::new(texels))
            }
            Err(e) => {
                warnings.add(format!("texture left out, its image is no PNG or JPEG that can be read: {e}"), || {
                    place.to_owned()
                });
                None
            }
        };
        self.images.insert((number, srgb), texels.clone());
        texels
    }
}

/// The set of texture coordinates that the base colour texture of a material uses, if it has one.
pub(super) fn base_color_set(document: &Document, material: usize) -> Option<u32> {
    let info = document.root.materials[material].pbr_metallic_roughness.base_color_texture.as_ref()?;
    let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
    Some(transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord))
}

/// `KHR_texture_transform`: scaled, then rotated, then moved. Positive angles turn u towards −v, which is
/// counter-clockwise as v points down; the matrix listed in early texts of the extension turned the other way.
fn transform(info: &json::texture::Info) -> Mat3 {
    let Some(t) = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref()) else {
        return Mat3::IDENTITY;
    };
    Mat3::from_translation(Vec2::from(t.offset.0))
        * Mat3::from_angle(-t.rotation.0)
        * Mat3::from_diagonal(Vec2::from(t.scale.0).extend(1.0))
}

fn wrap(document: &Document, texture: usize) -> [Wrap; 2] {
    let Some(sampler) = document.root.textures[texture].sampler else {
        return [Wrap::Repeat; 2];
    };
    let sampler = &document.root.samplers[sampler.value()];
    [sampler.wrap_s, sampler.wrap_t].map(|mode| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    })
}

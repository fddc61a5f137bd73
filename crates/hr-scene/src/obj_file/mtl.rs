//! MTL material libraries.

use super::{number, statements};
use crate::reflectors::{metallic_roughness, phong};
use crate::texture::{Texture, Wrap, decode};
use crate::warnings::Warnings;
use crate::whole_file;
use crate::{Material, SceneError};
use glam::{Mat3, Vec2};
use glossy_ext::{Reflector, Rgb};
use std::collections::HashMap;
use std::f32::consts::PI;
use std::path::Path;
use std::sync::Arc;

/// Reflectance of what has no material.
const GREY: f32 = 0.5;

/// Roughness of metallic-roughness materials that do not give one.
const DEFAULT_ROUGHNESS: f32 = 0.5;

/// Largest Phong exponent: a lobe of 0.1°.
const MAX_EXPONENT: f32 = 1e6;

/// A material as its statements give it, but that the reflectances `diffuse` and `specular` are at most 1 in sum.
#[derive(Clone, Debug, Default)]
pub(super) struct Source {
    name: String,
    diffuse: Option<Rgb>,
    specular: Rgb,
    exponent: f32,
    radiance: Rgb,
    roughness: Option<f32>,
    metallic: Option<f32>,
    illumination: Option<i64>,
    pub(super) texture: Option<Texture>,
}

/// The materials of all libraries read so far.
#[derive(Default)]
pub(super) struct Library {
    pub(super) materials: Vec<Source>,
    pub(super) index: HashMap<String, usize>,
}

impl Library {
    /// Adds the materials of a library; a name that is known already is given its new meaning.
    pub(super) fn read(&mut self, bytes: &[u8], path: &Path, warnings: &mut Warnings) -> Result<(), SceneError> {
        let first = self.materials.len();
        for (line, statement) in statements(&whole_file::text(bytes)) {
            let place = || format!("{}:{line}", path.display());
            let mut words = statement.split_whitespace();
            let Some(keyword) = words.next() else {
                continue;
            };
            let rest = statement.trim_start().strip_prefix(keyword).unwrap_or("").trim();
            if keyword == "newmtl" {
                self.index.insert(rest.to_owned(), self.materials.len());
                self.materials.push(Source { name: rest.to_owned(), ..Source::default() });
                continue;
            }
            let known = self.materials.len() > first;
            let Some(material) = self.materials.last_mut().filter(|_| known) else {
                warnings.add("a statement before the first newmtl is left out", place);
                continue;
            };
            match keyword {
                "Kd" => material.diffuse = color(rest, place, warnings)?.or(material.diffuse),
                "Ks" => {
                    material.specular = color(rest, place, warnings)?.unwrap_or(material.specular);
                }
                "Ke" => {
                    material.radiance = color(rest, place, warnings)?.unwrap_or(material.radiance);
                }
                "Ns" => material.exponent = number(words.next(), place)? as f32,
                "Pr" => material.roughness = Some(number(words.next(), place)? as f32),
                "Pm" => material.metallic = Some(number(words.next(), place)? as f32),
                "illum" => material.illumination = words.next().and_then(|w| w.parse().ok()),
                "d" if words.next().is_some_and(|w| w.parse().is_ok_and(|d: f32| d < 1.0)) => {
                    warnings.add(format!("material '{}': its transparency is not simulated", material.name), place);
                }
                "map_Kd" => material.texture = texture(rest, path, place, warnings),
                _ if keyword.starts_with("map_") || ["bump", "disp", "decal", "norm", "refl"].contains(&keyword) => {
                    warnings.add(format!("material '{}': {keyword} is left out", material.name), place);
                }
                _ => {}
            }
        }
        let added = &mut self.materials[first..];
        for material in &mut *added {
            material.tame();
        }
        if let Some(bright) = added.iter().find(|m| m.largest() > 1.0) {
            let name = &bright.name;
            warnings.add(
                format!(
                    "Kd + Ks is more than 1 (material '{name}'), so Ks is read as the classic model's factor, that is, \
                         a reflectance of 8 Ks / (Ns + 8)"
                ),
                || path.display().to_string(),
            );
            added.iter_mut().for_each(Source::read_as_classic);
        }
        for material in added {
            material.conserve_energy(path, warnings);
        }
        Ok(())
    }
}

impl Source {
    /// Brings numbers into their ranges, each by itself.
    fn tame(&mut self) {
        let unit = |x: f32| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) };
        let positive = |c: Rgb| Rgb::from(c.to_array().map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 }));
        self.diffuse = Some(positive(self.base_color()));
        // Illumination models 0 and 1 have no highlight.
        let matte = matches!(self.illumination, Some(0 | 1));
        self.specular = if matte || self.is_pbr() { Rgb::ZERO } else { positive(self.specular) };
        self.exponent = if self.exponent.is_nan() { 0.0 } else { self.exponent.clamp(0.0, MAX_EXPONENT) };
        self.radiance = positive(self.radiance);
        self.roughness = self.roughness.map(unit);
        self.metallic = self.metallic.map(unit);
    }

    /// What is reflected of the brightest channel, if Ks is a reflectance.
    fn largest(&self) -> f32 {
        (self.base_color() + self.specular).max_element()
    }

    /// Takes Ks as the factor of cos^Ns of the half vector's angle, as the format's illumination model 2 has it: not
    /// normalised, so that the lobe's reflectance falls with Ns. Near the mirror direction that is a Phong lobe of a
    /// fourth of the exponent (Fisher and Woo, "R.E versus N.H specular highlights", Graphics Gems IV, 1994).
    fn read_as_classic(&mut self) {
        self.exponent *= 0.25;
        self.specular *= 2.0 / (self.exponent + 2.0);
    }

    fn conserve_energy(&mut self, path: &Path, warnings: &mut Warnings) {
        let largest = self.largest();
        if largest > 1.0 {
            let place = || format!("{}: {}", path.display(), self.name);
            warnings.add("Kd and Ks are scaled to at most 1: no surface reflects more than it receives", place);
            self.diffuse = Some(self.base_color() / largest);
            self.specular /= largest;
        }
    }

    fn is_pbr(&self) -> bool {
        self.roughness.is_some() || self.metallic.is_some()
    }

    fn base_color(&self) -> Rgb {
        self.diffuse.unwrap_or(Rgb::splat(GREY))
    }
}

/// The reflector of a material (grey if there is none) with another base colour in place of Kd.
pub(super) fn reflector(source: Option<&Source>, base_color: Rgb) -> Arc<dyn Reflector> {
    match source {
        None => phong(base_color, Rgb::ZERO, 0.0),
        Some(m) if m.is_pbr() => {
            let roughness = m.roughness.unwrap_or(DEFAULT_ROUGHNESS);
            metallic_roughness(base_color, m.metallic.unwrap_or(0.0), roughness)
        }
        Some(m) => phong(base_color, m.specular, m.exponent),
    }
}

/// The scene's material for one of a library, or grey for a missing one.
pub(super) fn material(source: Option<&Source>, textured: bool) -> Material {
    let base_color = source.map_or(Rgb::splat(GREY), Source::base_color);
    Material {
        name: source.map_or("default", |m| &m.name).to_owned(),
        reflector: reflector(source, base_color),
        exitance: source.map_or(Rgb::ZERO, |m| PI * m.radiance),
        two_sided: true,
        texture: source.and_then(|m| m.texture.clone()).filter(|_| textured),
        base_color,
    }
}

/// A colour of three numbers, or of one for grey; `None`, with a warning, where it is a spectrum or CIE XYZ.
fn color(rest: &str, place: impl Fn() -> String, warnings: &mut Warnings) -> Result<Option<Rgb>, SceneError> {
    let mut words = rest.split_whitespace().peekable();
    if let Some(kind @ ("spectral" | "xyz")) = words.peek().copied() {
        warnings.add(format!("a colour given as '{kind}' is left out"), place);
        return Ok(None);
    }
    let r = number(words.next(), &place)? as f32;
    let Some(g) = words.next() else {
        return Ok(Some(Rgb::splat(r)));
    };
    let g = number(Some(g), &place)? as f32;
    Ok(Some(Rgb::new(r, g, number(words.next(), &place)? as f32)))
}

/// `map_Kd [-s u v w] [-o u v w] [-clamp on] … file`.
fn texture(rest: &str, path: &Path, place: impl Fn() -> String, warnings: &mut Warnings) -> Option<Texture> {
    let mut scale = Vec2::ONE;
    let mut offset = Vec2::ZERO;
    let mut wrap = Wrap::Repeat;
    let mut rest = rest;
    while let Some(option) = rest.strip_prefix('-') {
        let mut parts = option.splitn(2, char::is_whitespace);
        let (name, mut tail) = (parts.next()?, parts.next().unwrap_or("").trim_start());
        let mut arguments = Vec::new();
        let most = match name {
            "s" | "o" | "t" => 3,
            "mm" => 2,
            _ => 1,
        };
        while arguments.len() < most {
            let (word, after) = tail.split_once(char::is_whitespace).unwrap_or((tail, ""));
            // Fewer numbers than three may be given; a switch's argument is a word.
            if after.is_empty() || (most > 1 && word.parse::<f32>().is_err()) {
                break;
            }
            arguments.push(word);
            tail = after.trim_start();
        }
        let at = |i: usize| arguments.get(i).and_then(|w| w.parse().ok()).filter(|x: &f32| x.is_finite());
        match name {
            "s" => scale = Vec2::new(at(0).unwrap_or(1.0), at(1).unwrap_or(1.0)),
            "o" => offset = Vec2::new(at(0).unwrap_or(0.0), at(1).unwrap_or(0.0)),
            "clamp" if arguments == ["on"] => wrap = Wrap::Clamp,
            _ => {}
        }
        rest = tail;
    }
    let file = path.parent().unwrap_or(Path::new("")).join(rest.replace('\\', "/"));
    let decoded = whole_file::read(&file).map_err(|e| e.to_string()).and_then(|bytes| decode(&bytes, true));
    match decoded {
        Ok((texels, halved)) => {
            if halved {
                warnings.add("an image of more than 4096 x 4096 pixels is used at a lower resolution", place);
            }
            // The options act where v goes up, but texture coordinates have v turned down on reading.
            let turn = Mat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 1.0]);
            let options = Mat3::from_translation(offset) * Mat3::from_diagonal(scale.extend(1.0));
            Some(Texture { texels: Arc::new(texels), transform: turn * options * turn, wrap: [wrap; 2] })
        }
        Err(e) => {
            warnings.add(format!("texture '{}' left out: {e}", file.display()), place);
            None
        }
    }
}

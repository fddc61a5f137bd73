//! Materials: what a file says of them, and what becomes of it.

use super::color::Chromaticity;
use crate::Material;
use crate::reflectors::ward;
use crate::warnings::Warnings;
use glam::DVec3;
use glossy_ext::Rgb;

/// An amount (Y) of a colour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tint {
    pub(super) amount: f64,
    pub(super) color: Chromaticity,
}

impl Tint {
    fn rgb(self) -> DVec3 {
        self.color.to_rgb(self.amount)
    }

    fn bits(self) -> [u64; 3] {
        [self.amount, self.color.x(), self.color.y()].map(|v| (v + 0.0).to_bits())
    }
}

/// A material context.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Definition {
    /// Diffuse reflectance (`rd`).
    pub(super) diffuse: Tint,
    /// Specular reflectance (`rs`).
    pub(super) specular: Tint,
    /// RMS facet slope of the specular reflection; 0 is a mirror.
    pub(super) roughness: f64,
    /// Diffuse and specular transmittance (`td`, `ts`), which are not simulated.
    pub(super) transmitted: [f64; 2],
    /// Exitance in W/m² (`ed`).
    pub(super) exitance: Tint,
    /// Whether `sides` is 2.
    pub(super) two_sided: bool,
}

impl Default for Definition {
    fn default() -> Self {
        Self {
            diffuse: Tint::default(),
            specular: Tint::default(),
            roughness: 0.0,
            transmitted: [0.0; 2],
            exitance: Tint::default(),
            two_sided: true,
        }
    }
}

/// What tells materials of the same name apart.
pub(super) type Key = [u64; 13];

/// Linear RGB values of a material.
#[derive(Debug, PartialEq)]
pub(super) struct Values {
    pub(super) diffuse: Rgb,
    pub(super) specular: Rgb,
    pub(super) roughness: f32,
    pub(super) exitance: Rgb,
    /// How much was reflected in the channel that reflected most, before it was scaled to 1.
    pub(super) reflected: f64,
}

/// Reflecting up to this much more than all is rounding and is mended without a word.
const ROUNDING: f64 = 1e-6;

impl Definition {
    pub(super) fn key(&self) -> Key {
        let mut key = Key::default();
        let numbers = [self.roughness, self.transmitted[0], self.transmitted[1]].map(|v| (v + 0.0).to_bits());
        let [d, s, e] = [self.diffuse.bits(), self.specular.bits(), self.exitance.bits()];
        for (out, v) in key.iter_mut().zip([d, s, e, numbers].into_iter().flatten()) {
            *out = v;
        }
        key[12] = self.two_sided.into();
        key
    }

    pub(super) fn values(&self) -> Values {
        let (diffuse, specular) = (self.diffuse.rgb(), self.specular.rgb());
        let reflected = (diffuse + specular).max_element();
        let scale = 1.0 / reflected.max(1.0);
        let (mut diffuse, mut specular) = ((diffuse * scale).as_vec3(), (specular * scale).as_vec3());
        // The sum of two rounded numbers may be above 1 again.
        if (diffuse + specular).max_element() > 1.0 {
            diffuse *= 1.0 - f32::EPSILON;
            specular *= 1.0 - f32::EPSILON;
        }
        #[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is meant")]
        let roughness = self.roughness as f32;
        Values { diffuse, specular, roughness, exitance: self.exitance.rgb().as_vec3(), reflected }
    }

    /// The material of a surface at `place`, with a warning for what is not simulated as the file says.
    pub(super) fn finish(&self, name: &str, place: &str, warnings: &mut Warnings) -> Material {
        let values = self.values();
        if values.reflected > 1.0 + ROUNDING {
            let text = format!(
                "material '{name}' reflects {:.3} of the light in a channel: rd and rs scaled so that it is 1",
                values.reflected
            );
            warnings.add(text, || place.to_owned());
        }
        if self.transmitted != [0.0; 2] {
            let text = format!("material '{name}' is translucent (td, ts): opaque here, what it reflects is kept");
            warnings.add(text, || place.to_owned());
        }
        Material {
            name: name.to_owned(),
            reflector: ward(values.diffuse, values.specular, values.roughness),
            exitance: values.exitance,
            two_sided: self.two_sided,
            texture: None,
            base_color: Rgb::ONE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(amount: f64) -> Tint {
        Tint { amount, color: Chromaticity::default() }
    }

    #[test]
    fn reflectance_above_one_is_scaled_by_one_factor() {
        let definition = Definition { diffuse: grey(0.9), specular: grey(0.6), ..Definition::default() };
        let values = definition.values();
        assert!((values.diffuse - 0.6).abs().max_element() < 1e-6, "rd 0.9/1.5: {values:?}");
        assert!((values.specular - 0.4).abs().max_element() < 1e-6, "rs 0.6/1.5: {values:?}");
        let mut warnings = Warnings::default();
        definition.finish("m", "f:1", &mut warnings);
        let list = warnings.into_list();
        assert!(list[0].text.contains("'m' reflects 1.500"), "{list:?}");
    }

    #[test]
    fn never_more_than_all_in_single_precision() {
        for k in 1..1000 {
            let rd = f64::from(k) / 1000.0;
            let definition = Definition { diffuse: grey(rd), specular: grey(1.0 - rd), ..Definition::default() };
            let values = definition.values();
            assert!((values.diffuse + values.specular).max_element() <= 1.0, "rd {rd}: {values:?}");
            let mut warnings = Warnings::default();
            definition.finish("m", "f:1", &mut warnings);
            assert_eq!(warnings.into_list(), [], "rd {rd}: rounding is no reason to complain");
        }
    }

    #[test]
    fn keys_tell_all_properties_apart() {
        let base = Definition::default();
        let tint = grey(0.5);
        let changed = [
            Definition { diffuse: tint, ..base.clone() },
            Definition { specular: tint, ..base.clone() },
            Definition { roughness: 0.1, ..base.clone() },
            Definition { transmitted: [0.1, 0.0], ..base.clone() },
            Definition { transmitted: [0.0, 0.1], ..base.clone() },
            Definition { exitance: tint, ..base.clone() },
            Definition { two_sided: false, ..base.clone() },
            base,
        ];
        for a in &changed {
            for b in &changed {
                assert_eq!(a.key() == b.key(), a == b, "{a:?} and {b:?}");
            }
        }
    }
}

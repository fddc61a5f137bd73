//! Changes of materials while one looks at them.

use crate::{Material, Rgb};
use glam::Vec3;
use glossy_ext::Ward;
use std::f32::consts::SQRT_2;
use std::sync::Arc;

/// Exitance (W/m²) of lamps that are brightened; dimmed, they do not fall below its inverse.
const BRIGHTEST: f32 = 1e20;
/// Roughness that can be set.
const LEAST_ALPHA: f32 = 0.02;
const MOST_ALPHA: f32 = 0.8;
/// The direction that a lobe's width is taken for.
const ASLANT: Vec3 = Vec3::new(0.6, 0.0, 0.8);

/// Lets a material shine `factor` times as much (> 0). Tells in one line what it is now.
///
/// # Errors
/// One line on why it stays as it is: it does not shine, or would by far too much or too little.
pub fn brightened(material: &mut Material, factor: f32) -> Result<String, String> {
    if material.exitance == Rgb::ZERO {
        return Err(format!("'{}' does not shine", material.name));
    }
    let exitance = material.exitance * factor;
    if exitance.max_element() > BRIGHTEST || exitance.max_element() < BRIGHTEST.recip() {
        return Err(format!("'{}' stays as it is", material.name));
    }
    material.exitance = exitance;
    Ok(format!("'{}' emits {:.3} {:.3} {:.3} W/m² now", material.name, exitance.x, exitance.y, exitance.z))
}

/// Makes a material's gloss `factor` times as wide (> 0), as Ward's reflector of the same albedo, which takes the place of any
/// other. Tells in one line what it is now.
///
/// # Errors
/// One line on why it stays as it is: it has no gloss, is a perfect mirror, or has a texture.
pub fn roughened(material: &mut Material, factor: f32) -> Result<String, String> {
    let reflector = &material.reflector;
    let (diffuse, glossy) = (reflector.diffuse(), reflector.glossy_albedo().max(Rgb::ZERO));
    if reflector.is_diffuse() || reflector.mirror() != Rgb::ZERO || material.texture.is_some() {
        return Err(format!("'{}' has no roughness that could be changed", material.name));
    }
    // Half-vector slopes of standard deviation α/√2 turn what is reflected by twice as much.
    let alpha = reflector.lobe(ASLANT).width / SQRT_2;
    let wanted = (alpha * factor).clamp(LEAST_ALPHA, MOST_ALPHA);
    let ward = Ward::new(diffuse, glossy, wanted).map_err(|error| error.to_string())?;
    material.reflector = Arc::new(ward);
    Ok(format!("'{}' has a roughness α of {wanted:.3} now", material.name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glossy_ext::Reflector;

    fn material(reflector: Arc<dyn Reflector>, exitance: Rgb) -> Material {
        Material { name: "it".into(), reflector, exitance, two_sided: false, texture: None, base_color: Rgb::ONE }
    }

    #[test]
    fn lamps_are_dimmed_within_reason() {
        let black = || Arc::new(glossy_ext::Lambert::new(Rgb::ZERO).expect("black"));
        let mut lamp = material(black(), Rgb::new(4.0, 2.0, 0.0));
        assert!(brightened(&mut lamp, 0.5).is_ok_and(|said| said.contains("2.000 1.000 0.000")), "half the light");
        assert_eq!(lamp.exitance, Rgb::new(2.0, 1.0, 0.0), "half the light");
        assert!(brightened(&mut lamp, 1e30).is_err(), "there is an end to it");
        assert!(brightened(&mut material(black(), Rgb::ZERO), 2.0).is_err(), "what does not shine stays dark");
    }

    #[test]
    fn roughness_follows_and_energy_stays() {
        let ward = Ward::new(Rgb::splat(0.3), Rgb::splat(0.4), 0.2).expect("sound");
        let before = ward.glossy_albedo();
        let mut metal = material(Arc::new(ward), Rgb::ZERO);
        for factor in [SQRT_2, SQRT_2, 0.25] {
            let width = metal.reflector.lobe(ASLANT).width;
            roughened(&mut metal, factor).expect("it is glossy");
            let change = metal.reflector.lobe(ASLANT).width / width;
            assert!((change / factor - 1.0).abs() < 0.25, "{factor} times as rough is {change} times as wide");
        }
        let off = (metal.reflector.glossy_albedo() - before).abs().max_element();
        assert!(off < 0.1, "it reflects {} after {before}", metal.reflector.glossy_albedo());
        let lambert = Arc::new(glossy_ext::Lambert::new(Rgb::splat(0.5)).expect("grey"));
        assert!(roughened(&mut material(lambert, Rgb::ZERO), 2.0).is_err(), "chalk has no gloss");
    }
}

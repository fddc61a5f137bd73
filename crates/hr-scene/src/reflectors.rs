//! Reflectors from the numbers of a file. Numbers out of range were mended and warned about by the readers; what
//! is left of them is clamped here, so that every material has a reflector.

use glossy_ext::{Lambert, MetallicRoughness, Phong, Reflector, ReflectorError, Rgb, Ward};
use std::sync::Arc;

/// MGF's `rd` and `rs`: Lambert and a Ward lobe.
pub(crate) fn ward(rd: Rgb, rs: Rgb, alpha: f32) -> Arc<dyn Reflector> {
    let rd = clamped(rd);
    if rs.max_element() <= 0.0 {
        return made(Lambert::new(rd));
    }
    made(Ward::new(rd, clamped(rs), if alpha.is_finite() { alpha.clamp(0.0, 1.0) } else { 1.0 }))
}

/// glTF's metallic-roughness material.
pub(crate) fn metallic_roughness(base_color: Rgb, metallic: f32, roughness: f32) -> Arc<dyn Reflector> {
    made(MetallicRoughness::new(clamped(base_color), metallic.clamp(0.0, 1.0), roughness.clamp(0.0, 1.0)))
}

/// Lambert and energy-normalised Phong.
pub(crate) fn phong(diffuse: Rgb, specular: Rgb, exponent: f32) -> Arc<dyn Reflector> {
    if specular.max_element() <= 0.0 {
        return made(Lambert::new(clamped(diffuse)));
    }
    made(Phong::new(clamped(diffuse), clamped(specular), exponent.max(0.0)))
}

fn clamped(color: Rgb) -> Rgb {
    if color.is_nan() { Rgb::ZERO } else { color.clamp(Rgb::ZERO, Rgb::ONE) }
}

fn made<R: Reflector + 'static>(result: Result<R, ReflectorError>) -> Arc<dyn Reflector> {
    match result {
        Ok(reflector) => Arc::new(reflector),
        Err(_) => Arc::new(Lambert::BLACK),
    }
}

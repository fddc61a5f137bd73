//! Stand-ins until the reflectors of `glossy-ext` are there: the Lambertian part only.

use glam::{Vec2, Vec3};
use glossy_ext::{Lobe, Reflector, Rgb, Sample};
use hr_diffuse::Cone;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2};
use std::sync::Arc;

/// glTF's metallic-roughness material.
pub(crate) fn metallic_roughness(base_color: Rgb, metallic: f32, roughness: f32) -> Arc<dyn Reflector> {
    // replaced by MetallicRoughness
    let _ = roughness;
    Arc::new(Lambert { base_color, scale: 1.0 - metallic })
}

/// Lambert and energy-normalised Phong.
pub(crate) fn phong(diffuse: Rgb, specular: Rgb, exponent: f32) -> Arc<dyn Reflector> {
    // replaced by Phong
    let _ = exponent;
    let _ = specular;
    Arc::new(Lambert { base_color: diffuse, scale: 1.0 })
}

#[derive(Debug)]
struct Lambert {
    base_color: Rgb,
    scale: f32,
}

impl Reflector for Lambert {
    fn eval(&self, _incident: Vec3, _outgoing: Vec3) -> Rgb {
        self.diffuse() * FRAC_1_PI
    }
    fn diffuse(&self) -> Rgb {
        self.base_color * self.scale
    }
    fn is_diffuse(&self) -> bool {
        true
    }
    fn glossy_toward_extent(&self, _incident: Vec3, _outgoing: Vec3, _extent: f32) -> Rgb {
        Rgb::ZERO
    }
    fn glossy_bound(&self, _incident: &Cone, _outgoing: Vec3) -> f32 {
        0.0
    }
    fn glossy_albedo(&self) -> Rgb {
        Rgb::ZERO
    }
    fn lobe(&self, _outgoing: Vec3) -> Lobe {
        Lobe { direction: Vec3::Z, width: FRAC_PI_2 }
    }
    fn sample(&self, _outgoing: Vec3, _u: Vec2) -> Option<Sample> {
        None
    }
    fn with_base_color(&self, color: Rgb) -> Option<Arc<dyn Reflector>> {
        Some(Arc::new(Self { base_color: color, scale: self.scale }))
    }
}

//! A loaded scene: surfaces for the light transport, materials and textures for the eye, cameras, warnings.

use crate::Camera;
use crate::texture::{SurfaceAttributes, Texture};
use glossy_ext::{Reflector, Rgb};
use hr_diffuse::{Light, Surface};
use std::sync::Arc;

/// The RGB primaries of a scene's colours; both have a white that keeps grey at (1, 1, 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Primaries {
    /// R (.640,.330) G (.290,.600) B (.150,.060), equal-energy white: those of MGF files here.
    #[default]
    Radiance,
    /// Rec. 709 with its D65 white: those of glTF, and of sRGB screens.
    Rec709,
}

/// A material as the scene file gave it.
#[derive(Clone, Debug)]
pub struct Material {
    /// Its name in the file.
    pub name: String,
    /// How it reflects (already scaled so that no channel reflects more than arrives, where a file exceeds that).
    pub reflector: Arc<dyn Reflector>,
    /// Exitance of the front in W/m²; radiance = exitance/π.
    pub exitance: Rgb,
    /// Whether the back reflects like the front; else it absorbs.
    pub two_sided: bool,
    /// Base colour texture and the factor that multiplies it.
    pub texture: Option<Texture>,
    /// Linear base colour factor that textures and vertex colours multiply; not looked at where neither is there.
    pub base_color: Rgb,
}

/// Something that was mended or left out while loading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// What and why, in one line.
    pub text: String,
    /// Where it came first: file and line, or JSON path.
    pub first: String,
    /// How often.
    pub count: u32,
}

/// A scene, ready for the solver and for the eye.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// File name or built-in name.
    pub name: String,
    /// Surfaces, in metres unless the file says otherwise.
    pub surfaces: Vec<Surface>,
    /// Attributes of the surfaces that have any, sorted by surface.
    pub attributes: Vec<SurfaceAttributes>,
    /// Materials that surfaces refer to.
    pub materials: Vec<Material>,
    /// Lights without extent.
    pub lights: Vec<Light>,
    /// Named cameras.
    pub cameras: Vec<(String, Camera)>,
    /// What the RGB numbers mean.
    pub primaries: Primaries,
    /// What was mended or left out.
    pub warnings: Vec<Warning>,
}

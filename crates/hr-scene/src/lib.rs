//! Scene files in (MGF, glTF, OBJ), built-in scenes, cameras; images out.

pub mod builtin;
pub mod camera;
pub mod color;
pub mod edits;
pub mod error;
pub mod film;
mod fingerprint;
mod finish;
pub mod gltf_file;
pub mod image_file;
mod mesh;
pub mod mgf;
pub mod obj_file;
mod polygon;
mod reflectors;
pub mod scene;
mod sky;
#[cfg(test)]
mod testing;
pub mod texture;
pub mod tonemap;
mod viewpoint;
mod warnings;
pub mod whole_file;

pub use camera::{Camera, Rays};
pub use error::SceneError;
pub use film::{Film, Pixel};
pub use glossy_ext::Rgb;
pub use image_file::{Image, ImageKind};
pub use scene::{Material, Primaries, Scene, Warning};
pub use texture::{SurfaceAttributes, Texels, Texture, Wrap};
pub use tonemap::{Exposure, ToneMap};

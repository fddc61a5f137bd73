//! Scene files in (MGF, glTF, OBJ), built-in scenes, cameras; images out.

pub mod builtin;
pub mod camera;
pub mod error;
pub mod gltf_file;
pub mod image_file;
pub mod mgf;
pub mod obj_file;
mod polygon;
pub mod scene;
pub mod tonemap;
mod warnings;

pub use camera::Camera;
pub use error::SceneError;
// pub use image_file::Image;
pub use scene::{Material, Primaries, Scene, SurfaceAttributes, Texture, Warning};

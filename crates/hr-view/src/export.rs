//! Solutions for other programs: `--export FILE`.
//!
//! # `.csv`: a table of the elements
//! One line for each finest element, comma-separated, names and units in the first line. Lengths are in the scene's unit
//! (m), light is linear RGB in the scene's primaries. *radiosity* is what leaves diffusely, emission included, *glossy
//! exitance* what leaves besides.
//!
//! # `.glb`: glTF 2.0
//! Two scenes, both y up, in linear Rec. 709, with unlit materials that any viewer shows (`KHR_materials_unlit`). Light that
//! follows the eye is in both of them as its mean over all directions.
//!
//! Scene 0, the default one, has the light **at the vertices** of the finest elements:
//!
//! | attribute | is |
//! | --- | --- |
//! | `COLOR_0` | radiance × `extras.exposure` of the mesh, clamped to 0…1 |
//! | `_IRRADIANCE` | incident irradiance, W/m² |
//! | `_RADIANCE` | diffuse radiance, emission included, W/(m² sr) |
//! | `_SH_0` … `_SH_8` | of glossy surfaces: the radiance that follows the eye, W/(m² sr), beside `_RADIANCE` |
//!
//! The last are coefficients cᵢ of the real spherical harmonics of the bands 0 to 2, in the order and with the signs of R.
//! Ramamoorthi & P. Hanrahan, "An Efficient Representation for Irradiance Environment Maps", SIGGRAPH 2001, equation 3: the
//! radiance toward the unit direction ω, in the axes of the mesh, is about Σ cᵢ Yᵢ(ω), and 0 where that is negative.
//! Nine coefficients resolve about 60°: they tell a sheen from another, and blur highlights.
//!
//! Scene 1, `lightmap`, has the surfaces as they came, round ones cut into few triangles, and the light in **images** on
//! their second set of texture coordinates, `TEXCOORD_1`: the base colour texture is radiance × `extras.exposure` of the
//! material, in 8 bits that are dithered, so that gradients have no steps; `extras.irradiance` names a second texture with the
//! irradiance, in 16 bits, and how many W/m² its white stands for. Both are sRGB-encoded. Each side of each surface has a rectangle of its own, whose border is in the middle of its outermost
//! texels, so that surfaces that share an edge of the same length have the same texels on it; what lies around is a copy of
//! the border, for filters. Sides that reflect and emit nothing are left out.
//!
//! # `.exr`: the lightmap as it is
//! The first of these images, texel by texel, as linear radiance in W/(m² sr), neither exposed nor clamped, in the scene's primaries.

mod glb;
mod harmonics;
mod lightmap;
mod table;
mod vertex_light;

use crate::ViewError;
use crate::display::up_of;
use crate::facets::{Facets, Roundness, facets};
use crate::glossy::Mode;
use crate::metering;
use crate::solved::Solved;
use crate::window::Tone;
use glam::{DMat4, DQuat, DVec3};
use glb::Glb;
use hr_diffuse::Rgb;
use hr_scene::ToneMap;
use hr_scene::whole_file::write_whole;
use std::f32::consts::FRAC_1_PI;
use std::path::Path;

/// What a solution is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A table of elements.
    Csv,
    /// Binary glTF.
    Glb,
    /// OpenEXR.
    Exr,
}

impl Format {
    /// By a file name's ending.
    ///
    /// # Errors
    /// [`ViewError::Arguments`] for another ending.
    pub fn of(path: &Path) -> Result<Self, ViewError> {
        match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
            Some("csv") => Ok(Self::Csv),
            Some("glb") => Ok(Self::Glb),
            Some("exr") => Ok(Self::Exr),
            _ => Err(ViewError::Arguments(format!(
                "--export {}: unknown format; end the name with .csv, .glb or .exr",
                path.display()
            ))),
        }
    }
}

/// Writes a solution, whole or not at all. But for a table its distributions have been made, and the light at all vertices is known.
///
/// # Errors
/// [`ViewError::Arguments`] for an unknown ending, [`ViewError::Scene`] with `path` where it cannot be written.
pub fn write(solved: &Solved, path: &Path) -> Result<(), ViewError> {
    match Format::of(path)? {
        Format::Csv => Ok(write_whole(path, |out| table::write(solved, out))?),
        Format::Exr => Ok(lightmap::image(solved).save(path, &ToneMap::default(), solved.scene.primaries)?),
        Format::Glb => {
            let file = gltf(solved);
            Ok(write_whole(path, |out| file.write(out))?)
        }
    }
}

/// Both scenes.
fn gltf(solved: &Solved) -> Glb {
    let Facets { mesh, sources, .. } = facets(&solved.scene, &solved.solution, Roundness::SMOOTH);
    let of_mesh = Tone::for_mesh(&mesh);
    let metered = metering::exposure(solved, Mode::Distributions, &[solved.scene.default_camera()]);
    let tone = Tone { exposure: metered.unwrap_or(of_mesh.exposure), ..of_mesh };
    let mut file = Glb::default();
    let place = place(solved, mesh.origin);
    let at_vertices = vertex_light::add(&mut file, solved, &mesh, &sources, &tone);
    let mapped = lightmap::add(&mut file, solved, mesh.origin, &tone);
    let cameras = &solved.scene.cameras;
    file.scene("light at vertices", at_vertices, place, cameras);
    file.scene("lightmap", mapped, place, cameras);
    file
}

/// From a mesh about `origin` to glTF's space, where y is up.
fn place(solved: &Solved, origin: DVec3) -> DMat4 {
    let turn = DQuat::from_rotation_arc(up_of(&solved.scene.cameras), DVec3::Y);
    DMat4::from_rotation_translation(turn, turn * origin)
}

/// Radiance of a place of a surface's side, were it the same in all directions: diffusely and otherwise reflected, and emitted.
fn even_radiance(solved: &Solved, material: u32, diffuse: Rgb, irradiance: Rgb, front: bool) -> Rgb {
    use hr_diffuse::LightField;
    let glossy = solved.solution.field.active(material).unwrap_or(Rgb::ZERO);
    let emitted = if front { solved.scene.materials[material as usize].exitance } else { Rgb::ZERO };
    ((diffuse + glossy) * irradiance + emitted) * FRAC_1_PI
}

#[cfg(test)]
mod tests;

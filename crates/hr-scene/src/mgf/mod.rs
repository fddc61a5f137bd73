//! MGF 1.0, the Materials and Geometry Format (Greg Ward, Lawrence Berkeley Laboratory, May 1995), with `cct` and `fh`
//! of its later revisions.
//!
//! Entities: `# c cct cmix cone cspec cxy cyl ed f fh i ir m n o p prism rd ring rs sides sph td torus ts v xf`.
//! `ies` is refused; entities of no MGF that we know are ignored with a warning, as the format asks for.
//!
//! - **Geometry** is in metres unless the file's transforms say otherwise. Spheres, cones, cylinders, rings and tori
//!   stay curved. Polygons are cut into triangles and convex quadrilaterals. A polygon whose vertex normals all point
//!   behind it is turned over; where they differ they become shading normals.
//! - **Colours** are CIE 1931 chromaticities (the 2° observer at 10 nm for spectra); RGB has the primaries
//!   R (.640,.330) G (.290,.600) B (.150,.060) and equal-energy white. What these cannot show is mixed with grey of the
//!   same luminance.
//! - **Materials**: `rd`, `rs` (Ward's model), `sides`, and `ed`, the exitance of the front in W/m². `td` and `ts` are
//!   not simulated: opaque, with a warning. Where rd + rs exceeds 1 in a channel both are scaled, with a warning.
//! - **Limits**: includes and arrays nest up to 64 deep, an array has up to 10⁶ instances, and repetition may come to
//!   20 million words. Any bytes give a scene or an error with file and line.

mod color;
mod context;
mod entities;
mod fault;
mod geometry;
mod lexer;
mod material;
mod reader;
mod transform;

#[cfg(test)]
mod tests;

pub use reader::Include;

use crate::whole_file;
use crate::{Scene, SceneError};
use std::path::Path;

/// Reads an MGF file and the files that it includes.
///
/// # Errors
/// [`SceneError::Io`] where the file cannot be read; [`SceneError::Syntax`], with file and line, where a statement
/// makes no sense or an include cannot be read.
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    read(path, &whole_file::read_whole(path)?, &whole_file::read)
}

/// Reads MGF from memory. `path` is its name in messages; includes are sought with `include`, by a path relative to
/// the folder of the file that includes them, and once only.
///
/// ```
/// let text = b"m white =\n\trd .8\nv c =\n\tp 0 0 1\nsph c .5\n";
/// let scene = hr_scene::mgf::read("ball.mgf".as_ref(), text, &|_| Err(std::io::ErrorKind::NotFound.into()))?;
/// assert_eq!(scene.surfaces.len(), 1);
/// # Ok::<(), hr_scene::SceneError>(())
/// ```
///
/// # Errors
/// [`SceneError::Syntax`], with file and line, where a statement makes no sense or an include cannot be read.
pub fn read(path: &Path, bytes: &[u8], include: Include) -> Result<Scene, SceneError> {
    reader::read(path, bytes, include)
}

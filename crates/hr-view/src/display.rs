//! What is shown: a triangle mesh with light at its vertices, and the one thing that the eye's place changes.
//!
//! The paper's two lists (Stamminger et al. 2000, section 5): light that looks alike from everywhere is a number per
//! vertex and never computed again; radiance that follows the eye is asked for, vertex by vertex, with
//! [`Walkable::glossy_radiance`].

use crate::at_pixels::AtPixels;
use crate::camera_path::CameraPath;
use crate::inside::Inside;
use glam::{DVec3, Vec2, Vec3};
use glossy_ext::Rgb;
use hr_scene::{Camera, Primaries, Texture};
use std::ops::Range;

/// A run of triangles that share a texture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Batch {
    /// Range of [`DisplayMesh::indices`]; both ends are multiples of three.
    pub indices: Range<u32>,
    /// Index into [`DisplayMesh::textures`]; `None` draws the vertex tint alone.
    pub texture: Option<u32>,
}

/// A solution as triangles. All per-vertex arrays have the length of `positions`.
///
/// The radiance shown at a point is `irradiance · tint · texel + emission + glossy`, each factor interpolated between
/// the vertices. Back faces are culled: a surface that is seen from both sides is two sets of triangles, wound
/// oppositely, each with its own light.
#[derive(Clone, Debug, Default)]
pub struct DisplayMesh {
    /// The point in scene units that `positions` are relative to, so that `f32` suffices far from the scene's zero.
    pub origin: DVec3,
    /// Vertices in scene units, relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Unit normals of the side that is shown.
    pub normals: Vec<Vec3>,
    /// Incident irradiance in W/m².
    pub irradiance: Vec<Rgb>,
    /// Diffuse reflectance / π (1/sr), or the factor / π that the batch's texture multiplies.
    pub tint: Vec<Rgb>,
    /// Emitted radiance in W/(m² sr).
    pub emission: Vec<Rgb>,
    /// Texture coordinates before the texture's own transform; zero where there is none.
    pub uv: Vec<Vec2>,
    /// Triangles, counter-clockwise seen from the side that is shown.
    pub indices: Vec<u32>,
    /// All triangles, by texture.
    pub batches: Vec<Batch>,
    /// Textures that batches refer to.
    pub textures: Vec<Texture>,
    /// Vertices whose radiance follows the eye, each once.
    pub glossy: Vec<u32>,
    /// What the RGB numbers mean.
    pub primaries: Primaries,
}

/// Why a [`DisplayMesh`] cannot be shown.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A per-vertex array is shorter or longer than `positions`.
    #[error("display mesh: {array} has {found} entries for {expected} vertices; give one per vertex")]
    Length {
        /// Which array.
        array: &'static str,
        /// Its length.
        found: usize,
        /// The number of vertices.
        expected: usize,
    },
    /// An index points beyond its array.
    #[error("display mesh: {array}[{at}] is {found}, must be below {limit}")]
    Index {
        /// Which array.
        array: &'static str,
        /// Where in it.
        at: usize,
        /// What stands there.
        found: u32,
        /// The length of the array pointed into.
        limit: usize,
    },
    /// A batch is not a range of whole triangles of `indices`.
    #[error("display mesh: batch {at} covers indices {start}..{end} of {limit}; must be whole triangles within them")]
    Batch {
        /// Which batch.
        at: usize,
        /// Its first index.
        start: u32,
        /// One past its last index.
        end: u32,
        /// The number of indices.
        limit: usize,
    },
    /// A position is infinite or not a number.
    #[error("display mesh: vertex {at} lies at infinity; positions must be finite")]
    NotFinite {
        /// Which vertex.
        at: usize,
    },
}

impl DisplayMesh {
    /// Whether the arrays fit each other.
    ///
    /// # Errors
    /// The first thing that does not fit.
    pub fn check(&self) -> Result<(), MeshError> {
        let expected = self.positions.len();
        for (array, found) in [
            ("normals", self.normals.len()),
            ("irradiance", self.irradiance.len()),
            ("tint", self.tint.len()),
            ("emission", self.emission.len()),
            ("uv", self.uv.len()),
        ] {
            if found != expected {
                return Err(MeshError::Length { array, found, expected });
            }
        }
        if let Some(at) = self.positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite { at });
        }
        for (array, list) in [("indices", &self.indices), ("glossy", &self.glossy)] {
            if let Some(at) = list.iter().position(|&i| i as usize >= expected) {
                return Err(MeshError::Index { array, at, found: list[at], limit: expected });
            }
        }
        for (at, batch) in self.batches.iter().enumerate() {
            let (Range { start, end }, limit) = (batch.indices.clone(), self.indices.len());
            if start > end || end as usize > limit || start % 3 != 0 || end % 3 != 0 {
                return Err(MeshError::Batch { at, start, end, limit });
            }
            if let Some(found) = batch.texture.filter(|&t| t as usize >= self.textures.len()) {
                return Err(MeshError::Index { array: "batches", at, found, limit: self.textures.len() });
            }
        }
        Ok(())
    }

    /// Smallest and largest corner relative to `origin`; two zeros for an empty mesh.
    #[must_use]
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let Some(&first) = self.positions.first() else {
            return (Vec3::ZERO, Vec3::ZERO);
        };
        self.positions.iter().fold((first, first), |(low, high), &p| (low.min(p), high.max(p)))
    }

    /// Length of the diagonal of [`bounds`](Self::bounds) in scene units.
    #[must_use]
    pub fn diagonal(&self) -> f32 {
        let (low, high) = self.bounds();
        (high - low).length()
    }

    /// Number of triangles that batches draw.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.batches.iter().map(|b| b.indices.len() / 3).sum()
    }
}

/// A solution that can be walked through.
pub trait Walkable: Send + Sync {
    /// What the window's title says.
    fn name(&self) -> &str;

    /// Everything that does not follow the eye. Must not change while it is shown.
    fn mesh(&self) -> &DisplayMesh;

    /// How far it is across what one walks through, scene units.
    fn extent(&self) -> f64 {
        self.mesh().diagonal().into()
    }

    /// Named cameras, in the order of the digit keys; may be empty.
    fn cameras(&self) -> &[(String, Camera)];

    /// A walk to play; empty where there is none.
    fn tour(&self) -> CameraPath {
        CameraPath::default()
    }

    /// What lies behind the picture, where it can be looked into.
    fn inside(&self) -> Option<Box<dyn Inside + '_>> {
        None
    }

    /// The direction that stays up while walking, unit length: by default the coordinate axis nearest to the first
    /// camera's up, and z without a camera.
    fn up(&self) -> DVec3 {
        up_of(self.cameras())
    }

    /// What radiance is to be multiplied by in a picture that a camera takes, by what it sees; `None` where that is not known, or
    /// nothing that it sees is lit. Called whenever the eye jumps, so it must not take long.
    fn exposure(&self, _camera: &Camera) -> Option<f32> {
        None
    }

    /// Whether glossy light is to be shown as it is at pixels, where that can be.
    fn prefers_pixels(&self) -> bool {
        false
    }

    /// Glossy light for a device that reflects it at each pixel, in arrays of at most so many bytes; `None` where there is
    /// none in that form.
    fn at_pixels(&self, _most: u64) -> Option<AtPixels> {
        None
    }

    /// Radiance (W/(m² sr)) toward an eye (in scene units), beside the diffuse part and emission. `vertices` are
    /// positions in [`DisplayMesh::glossy`]; `out`, equally long, takes the results. Called from several threads at
    /// once, with different vertices.
    fn glossy_radiance(&self, eye: DVec3, vertices: &[u32], out: &mut [Rgb]);
}

/// The signed coordinate axis nearest to the first camera's up; z without a camera.
pub(crate) fn up_of(cameras: &[(String, Camera)]) -> DVec3 {
    nearest_axis(cameras.first().map_or(DVec3::Z, |(_, camera)| DVec3::from(camera.up)))
}

/// The signed coordinate axis nearest to `v`; z where `v` is zero or not finite.
fn nearest_axis(v: DVec3) -> DVec3 {
    if !v.is_finite() || v == DVec3::ZERO {
        return DVec3::Z;
    }
    // The positive ones first, so that ties do not turn a scene upside down.
    let axes = [DVec3::Z, DVec3::Y, DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y, DVec3::NEG_X];
    axes.into_iter().fold(DVec3::Z, |best, axis| if axis.dot(v) > best.dot(v) { axis } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> DisplayMesh {
        DisplayMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            irradiance: vec![Rgb::ONE; 3],
            tint: vec![Rgb::ONE; 3],
            emission: vec![Rgb::ZERO; 3],
            uv: vec![Vec2::ZERO; 3],
            indices: vec![0, 1, 2],
            batches: vec![Batch { indices: 0..3, texture: None }],
            glossy: vec![1],
            ..DisplayMesh::default()
        }
    }

    #[test]
    fn a_sound_mesh_passes() {
        assert_eq!(triangle().check(), Ok(()), "a single triangle is sound");
        assert_eq!(DisplayMesh::default().check(), Ok(()), "nothing at all is sound too");
        assert!((triangle().diagonal() - 2.0_f32.sqrt()).abs() < 1e-6, "diagonal of the unit square");
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let mut mesh = triangle();
        mesh.tint.pop();
        assert!(matches!(mesh.check(), Err(MeshError::Length { array: "tint", .. })), "short array");

        let mut mesh = triangle();
        mesh.indices[1] = 3;
        assert!(matches!(mesh.check(), Err(MeshError::Index { array: "indices", at: 1, .. })), "index beyond the end");

        let mut mesh = triangle();
        mesh.glossy[0] = 9;
        assert!(matches!(mesh.check(), Err(MeshError::Index { array: "glossy", .. })), "glossy vertex beyond the end");

        let mut mesh = triangle();
        mesh.batches[0].indices = 0..4;
        assert!(matches!(mesh.check(), Err(MeshError::Batch { .. })), "part of a triangle");

        let mut mesh = triangle();
        mesh.batches[0].texture = Some(0);
        assert!(matches!(mesh.check(), Err(MeshError::Index { array: "batches", .. })), "texture that is not there");

        let mut mesh = triangle();
        mesh.positions[2].x = f32::NAN;
        assert_eq!(mesh.check(), Err(MeshError::NotFinite { at: 2 }), "no place");
    }

    #[test]
    fn up_snaps_to_an_axis() {
        assert_eq!(nearest_axis(DVec3::new(0.1, 0.9, -0.3)), DVec3::Y, "tilted y");
        assert_eq!(nearest_axis(DVec3::new(0.0, -0.2, -2.0)), DVec3::NEG_Z, "upside down");
        assert_eq!(nearest_axis(DVec3::splat(f64::NAN)), DVec3::Z, "nonsense");
    }
}

//! What of a mesh is drawn how, in parts that fit a device.

use super::chunks::Chunked;
use super::gpu::Capacity;
use super::lists::{lit, split};
use super::scene_buffers::Vertex;
use crate::at_pixels::{AtPixels, Part};
use crate::display::Walkable;

/// The lists of a mesh.
pub(super) struct Parts {
    /// Triangles that never change.
    pub(super) diffuse: Vec<Chunked>,
    /// Triangles with a vertex whose radiance follows the eye.
    pub(super) glossy: Vec<Chunked>,
    /// Triangles whose glossy light is computed at each pixel, with its samples.
    pub(super) sampled: Vec<(Chunked, Part)>,
    /// What the samples are reflected by; without parts. `None` where all glossy light is at vertices.
    pub(super) at_pixels: Option<AtPixels>,
}

impl Parts {
    /// For a checked mesh. Glossy light is shown at pixels if that is wanted and there can be any.
    pub(super) fn new(walk: &dyn Walkable, capacity: Capacity, wants_pixels: bool) -> Self {
        let mesh = walk.mesh();
        let most = capacity.buffer / size_of::<Vertex>() as u64;
        let storage = capacity.storage.filter(|_| wants_pixels);
        let mut at_pixels = storage.and_then(|storage| walk.at_pixels(storage)).filter(|light| fits(light, capacity));
        let samples = at_pixels.as_mut().map_or_else(Vec::new, |light| std::mem::take(&mut light.parts));
        let taken: Vec<u32> = samples.iter().flat_map(|part| &part.triangles).map(|&(triangle, _)| triangle).collect();
        let [diffuse, glossy] = split(mesh, &taken).map(|list| Chunked::within(mesh, &list, most));
        let mut sampled = Vec::new();
        for part in samples {
            let chunks = Chunked::within(mesh, &lit(mesh, &part.triangles), most);
            sampled.extend(chunks.into_iter().map(|chunked| (chunked, part.clone())));
        }
        Self { diffuse, glossy, sampled, at_pixels }
    }
}

/// Whether what all parts need fits.
fn fits(light: &AtPixels, capacity: Capacity) -> bool {
    size_of_val(light.reflectors.as_slice()) as u64 <= capacity.storage.unwrap_or(0)
}

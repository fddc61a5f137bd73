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
    pub(super) sampled: Vec<(Vec<Chunked>, Part)>,
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
        let sampled = samples.into_iter().map(|part| {
            let list = lit(mesh, &part.triangles);
            (Chunked::within(mesh, &list, most), part)
        });
        let sampled = sampled.collect();
        Self { diffuse, glossy, sampled, at_pixels }
    }
}

/// Whether what all parts need fits.
fn fits(light: &AtPixels, capacity: Capacity) -> bool {
    size_of_val(light.reflectors.as_slice()) as u64 <= capacity.storage.unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::glossy::Mode;
    use crate::solved::Solved;
    use crate::walkthrough::Walkthrough;
    use crate::window::frame::Frame;
    use crate::window::gauge::Gauge;
    use crate::window::gpu::Gpu;
    use crate::window::layouts::Layouts;
    use crate::window::shown::Shown;
    use crate::window::snapshot::Snapshot;
    use crate::window::tone::Tone;
    use crate::window::view::View;
    use hr_diffuse::Settings;
    use hr_scene::Scene;
    use std::ops::ControlFlow;
    use std::sync::Arc;

    /// However small the buffers of a device are, the picture is the same.
    #[test]
    fn what_is_too_large_is_drawn_in_parts() {
        let gpu = match Gpu::new() {
            Ok(gpu) => gpu,
            Err(error) => return eprintln!("skipped, no graphics device: {error}"),
        };
        let scene = Arc::new(Scene::load("glossy-sphere").expect("built in"));
        let settings = Settings::with_error(0.5);
        let solved = Solved::new(scene, settings, true, &mut |_| ControlFlow::Continue(())).expect("a sound scene");
        let view = View::of_camera(&solved.scene.default_camera());
        let walk = Walkthrough::new(Arc::new(solved), Mode::Samples);
        let layouts = Layouts::new(&gpu);
        let tone = Tone::for_mesh(walk.mesh());
        let drawn = |parts: Parts| {
            let mut shown = Shown::new(&gpu, &layouts, &walk, parts).expect("it fits");
            shown.follow(&gpu, &walk, &view, [160, 120], 0.0);
            let frame = Frame { view: &view, tone: &tone, mesh: walk.mesh(), gauge: Gauge::OFF, marks: &[] };
            Snapshot::draw(&gpu, &layouts, &shown.buffers, [160, 120], &frame).expect("a small picture")
        };
        let lists = |parts: &Parts| {
            let sampled: usize = parts.sampled.iter().map(|(chunked, _)| chunked.len()).sum();
            [parts.diffuse.len(), parts.glossy.len(), sampled, parts.sampled.len()]
        };
        for wants_pixels in [false, true] {
            let whole = Parts::new(&walk, gpu.capacity(), wants_pixels);
            let few = 1 << 14;
            let capacity = Capacity { buffer: few, storage: Some(few) };
            let small = Parts::new(&walk, capacity, wants_pixels);
            if gpu.capacity().storage.is_some() {
                let least = if wants_pixels { [1, 0, 2, 2] } else { [1, 2, 0, 0] };
                assert!(lists(&small).iter().zip(least).all(|(n, least)| *n >= least), "{:?}", lists(&small));
                assert!(lists(&whole).iter().all(|n| *n <= 1), "{:?}", lists(&whole));
            }
            let fits = |part: &Part| {
                size_of_val(part.arrivals.as_slice()).max(size_of_val(part.runs.as_slice())) as u64 <= few
            };
            assert!(small.sampled.iter().all(|(_, part)| fits(part)), "samples beyond the buffers");
            assert_eq!(drawn(whole), drawn(small), "in parts, at pixels: {wants_pixels}");
        }
    }
}

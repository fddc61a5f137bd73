//! Speed of the rays, on one thread.

use crate::path_tracer::Sampler;
use crate::run::{Out, say};
use crate::{BenchError, PathTracer};
use glam::Vec3;
use hr_diffuse::sampling::hash;
use hr_diffuse::visibility::NO_BLOCKER;
use hr_diffuse::{Domain, Visibility};
use hr_scene::Camera;
use std::time::Instant;

/// Segments between one pair of small patches, as a link asks for them.
const PER_PAIR: u32 = 16;
/// Side of such a patch in its surface's parameters.
const PATCH: f32 = 0.125;

/// A segment between two surfaces.
struct Segment {
    ends: [Vec3; 2],
    surfaces: [u32; 2],
}

/// Draws points on surfaces by area.
struct Areas<'a> {
    visibility: &'a Visibility,
    sums: Vec<f32>,
}

impl<'a> Areas<'a> {
    fn new(visibility: &'a Visibility) -> Self {
        let areas = visibility.geometries().iter().map(|g| g.area(Domain::WHOLE));
        let sums = areas.scan(0.0, |sum, area| {
            *sum += area;
            Some(*sum)
        });
        Self { visibility, sums: sums.collect() }
    }

    fn surface(&self, choice: f32) -> u32 {
        let total = self.sums.last().copied().unwrap_or(0.0);
        self.sums.partition_point(|&sum| sum <= choice * total).min(self.sums.len() - 1) as u32
    }

    /// The `i`-th of many segments; `spread` 1 draws from whole surfaces, less from patches of that size.
    fn segment(&self, group: u32, i: u32, spread: f32) -> Segment {
        let of_group = Sampler::new(1, group);
        let choice = of_group.pair(0);
        let surfaces = [self.surface(choice.x), self.surface(choice.y)];
        let ends = [0, 1].map(|end| {
            let corner = of_group.pair(1 + end) * (1.0 - spread);
            let at = corner + Sampler::new(hash(group, 7), i).pair(end) * spread;
            self.visibility.geometries()[surfaces[end as usize] as usize].sample_area(Domain::WHOLE, at.x, at.y).0
        });
        Segment { ends, surfaces }
    }
}

/// Prints millions of rays per second for random segments, for segments between pairs of patches, and for a camera's
/// rays.
///
/// # Errors
/// [`BenchError::Output`] where nothing can be printed.
pub fn report(tracer: &PathTracer, camera: &Camera, rays: u32, out: Out<'_>) -> Result<(), BenchError> {
    let visibility = tracer.visibility();
    let areas = Areas::new(visibility);
    let surfaces = visibility.geometries();
    let curved = surfaces.iter().filter(|g| !g.is_flat()).count();
    say(out, &format!("{}: {} surfaces, {curved} of them curved", tracer.scene().name, surfaces.len()))?;
    say(out, "| rays | count | Mrays/s | blocked or hit |")?;
    say(out, "| --- | ---: | ---: | ---: |")?;
    let random: Vec<Segment> = (0..rays).map(|i| areas.segment(i, i, 1.0)).collect();
    let coherent: Vec<Segment> = (0..rays).map(|i| areas.segment(i / PER_PAIR, i % PER_PAIR, PATCH)).collect();
    for (name, segments) in [("random segments", random), ("segments between patches", coherent)] {
        let mut cache = NO_BLOCKER;
        let start = Instant::now();
        let blocked = segments.iter().filter(|s| visibility.occluded(s.ends[0], s.ends[1], s.surfaces, &mut cache));
        let blocked = blocked.count();
        row(name, segments.len(), blocked, start, out)?;
    }
    let eye = tracer.to_unit(camera.eye.into());
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (f64::from(x), f64::from(y))));
    let directions: Vec<Vec3> = pixels.map(|(x, y)| camera.direction(x + 0.5, y + 0.5).as_vec3()).collect();
    let start = Instant::now();
    let hits = directions.iter().filter(|&&d| visibility.closest(eye, d, 0.0, f32::MAX).is_some()).count();
    row("a camera's closest hits", directions.len(), hits, start, out)
}

fn row(name: &str, count: usize, found: usize, start: Instant, out: Out<'_>) -> Result<(), BenchError> {
    let speed = count as f64 / start.elapsed().as_secs_f64().max(1e-9) / 1e6;
    say(out, &format!("| {name} | {count} | {speed:.2} | {:.1} % |", 100.0 * found as f64 / count.max(1) as f64))
}

//! Speed of the rays, on one thread: every kind of query on the same segments, in the same run; and how many links need none.
//!
//! The measure is obvhs's own any-hit query on its own binary tree, over the same surfaces (quadrilaterals as two
//! triangles).

mod links;

use crate::BenchError;
use crate::run::{Out, say};
use glam::Vec3;
use hr_diffuse::sampling::hash;
use hr_diffuse::visibility::NO_BLOCKER;
use hr_diffuse::{Domain, Geometry, Normalization, Visibility};
use hr_scene::{Camera, Scene};
use hr_view::path_tracer::{self, Sampler};
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;
use obvhs::{Boundable, BvhBuildParams};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Segments between one pair of small patches, as a link asks for them.
const PER_PAIR: u32 = 32;
/// The time of a kind of query is the shortest of so many rounds, in which the kinds take turns: other programs on the
/// machine then disturb them alike.
const ROUNDS: u32 = 5;
/// What obvhs's triangle test and ours call the ends of a segment, which obvhs's query cannot vary with its length.
const STOCK_TRIM: f32 = 1e-4;
/// Side of such a patch, in unit space.
const PATCH: f32 = 0.02;

/// A segment between two surfaces.
#[derive(Clone, Copy)]
struct Segment {
    from: Vec3,
    to: Vec3,
    skip: [u32; 2],
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

    /// The `i`-th of many segments between patches with sides of `spread`, or whole surfaces that are smaller.
    fn segment(&self, group: u32, i: u32, spread: f32) -> Segment {
        let of_group = Sampler::new(1, group);
        let choice = of_group.pair(0);
        let surfaces = [self.surface(choice.x), self.surface(choice.y)];
        let ends = [0, 1].map(|end| {
            let surface = &self.visibility.geometries()[surfaces[end as usize] as usize];
            let spread = (spread / surface.area(Domain::WHOLE).sqrt()).min(1.0);
            let corner = of_group.pair(1 + end) * (1.0 - spread);
            let at = corner + Sampler::new(hash(group, 7), i).pair(end) * spread;
            surface.sample_area(Domain::WHOLE, at.x, at.y).0
        });
        Segment { from: ends[0], to: ends[1], skip: surfaces }
    }
}

/// obvhs's tree as it comes.
struct Stock<'a> {
    visibility: &'a Visibility,
    bvh: Bvh2,
    /// By primitive, in the order of the tree: its surface, and a triangle unless the surface is curved.
    primitives: Vec<(u32, Option<Triangle>)>,
}

/// A primitive of that tree.
struct Primitive {
    surface: u32,
    triangle: Option<Triangle>,
    bounds: obvhs::aabb::Aabb,
}

impl Boundable for Primitive {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        self.bounds
    }
}

impl<'a> Stock<'a> {
    fn new(visibility: &'a Visibility) -> Self {
        let mut unsorted = Vec::new();
        for (surface, geometry) in (0..).zip(visibility.geometries()) {
            let mut triangle = |corners: [Vec3; 3]| {
                let [v0, v1, v2] = corners.map(Into::into);
                let triangle = Triangle { v0, v1, v2 };
                unsorted.push(Primitive { surface, bounds: triangle.aabb(), triangle: Some(triangle) });
            };
            match geometry {
                Geometry::Triangle(found) => triangle(*found.points()),
                Geometry::Quad(quad) => {
                    let [a, b, c, d] = *quad.points();
                    triangle([a, b, c]);
                    triangle([a, c, d]);
                }
                Geometry::Revolution(_) => {
                    let bounds = geometry.bounds(Domain::WHOLE);
                    let bounds = obvhs::aabb::Aabb::new(bounds.min.into(), bounds.max.into());
                    unsorted.push(Primitive { surface, triangle: None, bounds });
                }
            }
        }
        // The preset of medium speed, with full depth of the search: shallower ones make large trees slow.
        let parameters =
            BvhBuildParams { search_depth_threshold: 0, pre_split: false, ..BvhBuildParams::medium_build() };
        let bvh = build_bvh2(&unsorted, parameters, &mut Duration::default());
        let sorted = bvh.primitive_indices.iter().map(|&i| &unsorted[i as usize]);
        let primitives = sorted.map(|p| (p.surface, p.triangle)).collect();
        Self { visibility, bvh, primitives }
    }

    fn occluded(&self, segment: &Segment) -> bool {
        let Segment { from, to, skip } = *segment;
        if from == to {
            return false;
        }
        let ray = Ray::new(from.into(), (to - from).into(), STOCK_TRIM, 1.0 - STOCK_TRIM);
        !self.bvh.ray_traverse_miss(ray, |ray, primitive| match self.primitives[primitive] {
            (surface, _) if skip.contains(&surface) => f32::INFINITY,
            (_, Some(triangle)) => triangle.intersect(ray),
            (surface, None) => {
                let geometry = &self.visibility.geometries()[surface as usize];
                geometry.intersect(from, to - from, ray.tmin, ray.tmax).map_or(f32::INFINITY, |hit| hit.0)
            }
        })
    }
}

/// A kind of query: its name, and what counts blocked segments.
type Query<'a> = (String, Box<dyn Fn(&[Segment]) -> usize + 'a>);

/// Prints millions of rays per second for random segments, for segments between pairs of patches, and for a camera's
/// rays; where an `error` is given, what is proved of the links of a solution with it, too.
///
/// # Errors
/// [`BenchError::Solve`] where a surface makes no sense, [`BenchError::Output`] where nothing can be printed.
pub fn report(
    scene: &Arc<Scene>,
    camera: &Camera,
    rays: u32,
    error: Option<f32>,
    out: Out<'_>,
) -> Result<(), BenchError> {
    let visibility = &path_tracer::visibility(scene)?;
    let areas = Areas::new(visibility);
    let surfaces = visibility.geometries();
    let curved = surfaces.iter().filter(|g| !g.is_flat()).count();
    say(out, &format!("{}: {} surfaces, {curved} of them curved", scene.name, surfaces.len()))?;
    say(out, "| segments | query | Mrays/s | times stock | blocked or hit |")?;
    say(out, "| --- | --- | ---: | ---: | ---: |")?;
    let stock = Stock::new(visibility);
    let queries: Vec<Query<'_>> = vec![
        ("obvhs any hit".into(), Box::new(|all: &[Segment]| all.iter().filter(|s| stock.occluded(s)).count())),
        (
            "one by one".into(),
            Box::new(|all: &[Segment]| {
                let mut cache = NO_BLOCKER;
                all.iter().filter(|s| visibility.occluded(s.from, s.to, s.skip, &mut cache)).count()
            }),
        ),
    ];
    let random: Vec<Segment> = (0..rays).map(|i| areas.segment(i, i, f32::MAX)).collect();
    let coherent: Vec<Segment> = (0..rays).map(|i| areas.segment(i / PER_PAIR, i % PER_PAIR, PATCH)).collect();
    for (name, segments) in [("random", random), ("between patches", coherent)] {
        let mut best = vec![(f64::INFINITY, 0); queries.len()];
        for _ in 0..ROUNDS {
            for ((_, query), best) in queries.iter().zip(&mut best) {
                let start = Instant::now();
                let blocked = query(&segments);
                *best = (best.0.min(start.elapsed().as_secs_f64()), blocked);
            }
        }
        for ((query, _), &(seconds, blocked)) in queries.iter().zip(&best) {
            row(name, query, segments.len(), blocked, [seconds, best[0].0], out)?;
        }
    }
    let eye = Normalization::new(&scene.surfaces).to_unit(camera.eye.into());
    let rays = camera.rays();
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (f64::from(x), f64::from(y))));
    let directions: Vec<Vec3> = pixels.map(|(x, y)| rays.direction(x + 0.5, y + 0.5).as_vec3()).collect();
    let start = Instant::now();
    let hits = directions.iter().filter(|&&d| visibility.closest(eye, d, 0.0, f32::MAX).is_some()).count();
    let seconds = start.elapsed().as_secs_f64();
    row("a camera's", "closest hit", directions.len(), hits, [seconds, f64::NAN], out)?;
    error.map_or(Ok(()), |error| links::report(&scene.input(), error, out))
}

fn row(
    segments: &str,
    query: &str,
    count: usize,
    found: usize,
    [seconds, stock]: [f64; 2],
    out: Out<'_>,
) -> Result<(), BenchError> {
    let speed = count as f64 / seconds.max(1e-9) / 1e6;
    let ratio = if stock.is_nan() { String::new() } else { format!("{:.2}", stock / seconds.max(1e-9)) };
    let share = 100.0 * found as f64 / count.max(1) as f64;
    say(out, &format!("| {segments} | {query} | {speed:.2} | {ratio} | {share:.1} % |"))
}

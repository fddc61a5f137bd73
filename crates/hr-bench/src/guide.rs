//! The pictures of the guide: the method's steps, as the program does them.

use crate::BenchError;
use crate::args::GuideArgs;
use crate::run::{Out, camera, say};
use crate::side_by_side::side_by_side;
use glam::{DVec3, Vec3};
use glossy_ext::{Incident, Place, arriving};
use hr_diffuse::{Hit, NodeId, Rgb, Settings};
use hr_scene::{Camera, Image, Scene, ToneMap};
use hr_view::Mode;
use hr_view::path_tracer::{self, PathTracer};
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use std::f32::consts::{FRAC_1_PI, PI};
use std::ops::ControlFlow;
use std::sync::Arc;

/// Errors that are shown beside one another.
const ERRORS: [f32; 3] = [0.5, 0.2, 0.05];
/// Width of a picture, pixels.
const WIDTH: u32 = 320;
/// Side of a hemisphere, pixels.
const SPHERE: u32 = 256;
/// The smallest disk that shows a sample has so many pixels' radius.
const LEAST_DISK: f32 = 1.5;
/// Where the picture of a point is taken: in the default scene, from its first camera, at this share of the width and height.
const POINT: [f64; 2] = [0.45, 0.92];

/// Makes all pictures.
///
/// # Errors
/// Where a scene cannot be solved, or files cannot be written.
pub fn pictures(args: &GuideArgs, out: Out<'_>) -> Result<(), BenchError> {
    let unwritable = |source| BenchError::Write { path: args.out.clone(), source };
    std::fs::create_dir_all(&args.out).map_err(unwritable)?;
    let sphere = Arc::new(Scene::load("glossy-sphere")?);
    let room = Arc::new(Scene::load(hr_scene::builtin::DEFAULT)?);
    let made = [("errors", errors(&sphere)?), ("point", point(&room)?), ("modes", modes(&sphere, args.spp)?)];
    for ((name, image), scene) in made.iter().zip([&sphere, &room, &sphere]) {
        let path = args.out.join(format!("guide-{name}.png"));
        image.save(&path, &ToneMap::default(), scene.primaries)?;
        say(out, &path.display().to_string())?;
    }
    Ok(())
}

fn solved(scene: &Arc<Scene>, error: f32) -> Result<Solved, BenchError> {
    Ok(Solved::new(scene.clone(), Settings::with_error(error), true, &mut |_| ControlFlow::Continue(()))?)
}

/// A camera of a scene, for a picture of the guide's size.
fn small(scene: &Scene, name: Option<&str>) -> Result<Camera, BenchError> {
    Ok(Camera { width: WIDTH, height: WIDTH * 3 / 4, ..camera(scene, name)? })
}

/// Solutions with several errors: what is seen, and below the elements with their irradiance.
fn errors(scene: &Arc<Scene>) -> Result<Image, BenchError> {
    let camera = small(scene, None)?;
    let mut rows = [Vec::new(), Vec::new()];
    for error in ERRORS {
        let solved = solved(scene, error)?;
        rows[0].push(RayCaster::new(&solved.scene, &solved.solution, Mode::Samples).render(&camera, &|_| ()));
        rows[1].push(elements(&solved, &camera));
    }
    Ok(side_by_side(&rows))
}

/// What a ray from a camera meets first.
fn met(solved: &Solved, camera: &Camera, [x, y]: [f64; 2]) -> Option<Hit> {
    let scene = &solved.solution.scene;
    let eye = scene.normalization.to_unit(DVec3::from(camera.eye));
    scene.visibility.closest(eye, camera.direction(x, y).as_vec3(), 0.0, f32::MAX)
}

/// The elements that a camera sees: radiance that each would have if it were white, and their outlines.
fn elements(solved: &Solved, camera: &Camera) -> Image {
    let solution = &solved.solution;
    let leaf = |x: u32, y: u32| {
        let hit = met(solved, camera, [f64::from(x) + 0.5, f64::from(y) + 0.5])?;
        solution.leaf(&hit).map(NodeId::index)
    };
    let leaves: Vec<Option<usize>> =
        (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y))).map(|(x, y)| leaf(x, y)).collect();
    let mut image = Image::new(camera.width, camera.height);
    let width = camera.width as usize;
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        let beside = [i + 1, i + width].map(|j| leaves.get(j).copied().unwrap_or(leaves[i]));
        let is_outline = beside.iter().any(|other| *other != leaves[i]);
        let irradiance = leaves[i].map_or(Rgb::ZERO, |leaf| solution.exitant.irradiance[leaf]);
        *pixel = irradiance * FRAC_1_PI * if is_outline { 0.3 } else { 1.0 };
    }
    image
}

/// A hemisphere over a place, seen from above: by direction in the place's frame (z up).
fn hemisphere(radiance: impl Fn(Vec3) -> Rgb) -> Image {
    let mut image = Image::new(SPHERE, SPHERE);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        let [x, y] = [i as u32 % SPHERE, i as u32 / SPHERE].map(|at| (at as f32 + 0.5) * 2.0 / SPHERE as f32 - 1.0);
        let height2 = 1.0 - x * x - y * y;
        if height2 > 0.0 {
            *pixel = radiance(Vec3::new(x, -y, height2.sqrt()));
        }
    }
    image
}

/// What happens at a point of a glossy floor: the light that there is, as illumination samples, and what is reflected of them.
fn point(scene: &Arc<Scene>) -> Result<Image, BenchError> {
    let solved = solved(scene, 0.1)?;
    let solution = &solved.solution;
    let camera = scene.default_camera();
    let at = [POINT[0] * f64::from(camera.width), POINT[1] * f64::from(camera.height)];
    let found = met(&solved, &camera, at).and_then(|hit| Some((hit, solution.leaf(&hit)?)));
    let Some((hit, leaf)) = found else {
        return Err(BenchError::Arguments(format!("nothing is lit at {POINT:?} of {}'s first camera", scene.name)));
    };
    let place = Place::new(hit.point, solution.elements.nodes[leaf.index()].normals.axis);
    let light = solution.light();
    let there = hemisphere(|direction| {
        let direction = place.frame * direction;
        let met = solution.scene.visibility.closest_except(hit.point, direction, 0.0, f32::MAX, hit.surface);
        let sender = met.and_then(|met| solution.leaf(&met));
        sender.map_or(Rgb::ZERO, |sender| light.emitted(sender.0, -direction) * FRAC_1_PI)
    });
    let mut incident = Vec::new();
    arriving(&solution.elements, leaf, &solution.incident_path(leaf), &place, &mut incident);
    let samples = hemisphere(|direction| incident.iter().map(|sample| disk(sample, direction)).sum());
    let shown = solution.faces.standing(leaf.0) as usize;
    let away = |direction: Vec3| solution.reflected[shown].eval(place.frame * direction);
    Ok(side_by_side(&[vec![there, samples, hemisphere(away)]]))
}

/// Radiance of a disk that a sample stands for, in a direction.
fn disk(sample: &Incident, direction: Vec3) -> Rgb {
    let radius = sample.extent.max(LEAST_DISK * 2.0 / SPHERE as f32);
    let inside = direction.dot(sample.direction) > radius.cos();
    let solid_angle = PI * radius * radius * sample.direction.z.max(0.05);
    if inside { sample.irradiance / solid_angle } else { Rgb::ZERO }
}

/// One view in every mode, and path-traced.
fn modes(scene: &Arc<Scene>, spp: u32) -> Result<Image, BenchError> {
    let solved = solved(scene, 0.1)?;
    let camera = small(scene, Some("low"))?;
    let by = |mode| RayCaster::new(&solved.scene, &solved.solution, mode).render(&camera, &|_| ());
    let visibility = path_tracer::visibility(scene)?;
    let reference = PathTracer::new(scene, &visibility).render(&camera, spp, 0, &|_| ()).image;
    Ok(side_by_side(&[vec![by(Mode::Distributions), by(Mode::Samples)], vec![by(Mode::Gather), reference]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What samples bring is what their disks show: irradiance over the hemisphere.
    #[test]
    fn disks_have_their_samples_irradiance() {
        for (direction, extent) in [(Vec3::Z, 0.2), (Vec3::new(0.6, 0.0, 0.8), 0.1), (Vec3::new(0.0, -0.8, 0.6), 0.06)]
        {
            let sample = Incident { direction, extent, irradiance: Rgb::splat(3.0), ..Incident::default() };
            let image = hemisphere(|direction| disk(&sample, direction));
            // A hemisphere seen from above is projected as irradiance is: each pixel counts by its area.
            let pixel = (2.0 / SPHERE as f32).powi(2);
            let sum: f32 = image.pixels.iter().map(|radiance| radiance.x * pixel).sum();
            assert!((sum / 3.0 - 1.0).abs() < 0.15, "{direction}, {extent}: {sum} of 3");
        }
    }
}

//! Final gathers against the path tracer: they share paths, but not what is at their ends.

use glam::dvec3;
use glossy_ext::{Lambert, Ward};
use hr_diffuse::{Light, LightKind, Settings, Shape, Surface};
use hr_scene::{Camera, Material, Rgb, Scene};
use hr_view::Mode;
use hr_view::path_tracer::{self, PathTracer};
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Side of the blocks whose means are compared, in pixels.
const BLOCK: u32 = 8;

/// Means of the blocks of an image.
fn blocks(image: &hr_scene::Image, camera: &Camera) -> Vec<Rgb> {
    let columns = camera.width / BLOCK;
    let mut sums = vec![Rgb::ZERO; (columns * (camera.height / BLOCK)) as usize];
    for (i, pixel) in image.pixels.iter().enumerate() {
        let (x, y) = (i as u32 % camera.width, i as u32 / camera.width);
        sums[(y / BLOCK * columns + x / BLOCK) as usize] += *pixel / (BLOCK * BLOCK) as f32;
    }
    sums
}

/// Sum of the differences over the sum of what is right, where less than `below` is right.
fn difference(found: &[Rgb], right: &[Rgb], below: f32) -> f32 {
    let kept = || found.iter().zip(right).filter(|(_, right)| right.max_element() < below);
    let off: f32 = kept().map(|(found, right)| (found - right).abs().element_sum()).sum();
    off / kept().map(|(_, right)| right.element_sum()).sum::<f32>()
}

#[test]
fn final_gathers_are_nearer_to_the_truth_than_their_solutions() {
    for (name, below, most) in [("cornell", 1.0, 0.025), ("glossy-sphere", 100.0, 0.04)] {
        let scene = Arc::new(Scene::load(name).expect("built in"));
        let camera = Camera { width: 64, height: 48, ..scene.cameras[0].1 };
        let rays = path_tracer::visibility(&scene).expect("sound");
        let right = PathTracer::new(&scene, &rays).render(&camera, 256, 1, &|_| ());
        let right = blocks(&right.image, &camera);
        let settings = Settings::with_error(0.07);
        let solved =
            Solved::new(Arc::clone(&scene), settings, false, &mut |_| ControlFlow::Continue(())).expect("solvable");
        let [gathered, reflected] = [Mode::Gather, Mode::Samples].map(|mode| {
            let image = RayCaster::new(&scene, &solved.solution, mode).render(&camera, &|_| ());
            difference(&blocks(&image, &camera), &right, below)
        });
        // Of the solution's own error, a few percent at this setting, less than half is light by way of other surfaces;
        // noise of the blocks is 1 % at most, and that of the reference.
        assert!(gathered < most, "{name}: gather is {gathered} off");
        assert!(gathered < reflected, "{name}: gather is {gathered} off, the solution {reflected}");
    }
}

/// How far pictures of a solution by samples are off, where rays follow all lobes and find emitters, and without them.
fn off_by_samples(scene: Scene, view: usize, (paths, error): (u32, f32)) -> [f32; 2] {
    let scene = Arc::new(scene);
    let camera = Camera { width: 64, height: 48, ..scene.cameras[view].1 };
    let rays = path_tracer::visibility(&scene).expect("sound");
    let right = PathTracer::new(&scene, &rays).render(&camera, paths, 1, &|_| ());
    let right = blocks(&right.image, &camera);
    let settings = Settings::with_error(error);
    let solved =
        Solved::new(Arc::clone(&scene), settings, false, &mut |_| ControlFlow::Continue(())).expect("solvable");
    [f32::INFINITY, 0.0].map(|width| {
        let caster = RayCaster::new(&scene, &solved.solution, Mode::Samples).with_followed(width);
        difference(&blocks(&caster.render(&camera, &|_| ()), &camera), &right, 1.0)
    })
}

/// Where all is glossy a sample stands for a sender that looks different from each place: rays tell more than samples do.
#[test]
fn rays_into_lobes_are_nearer_to_the_truth_than_samples() {
    let mut scene = Scene::load("cornell").expect("built in");
    scene.materials[0].reflector = Arc::new(Ward::new(Rgb::splat(0.15), Rgb::splat(0.6), 0.2).expect("a gloss"));
    let [followed, reflected] = off_by_samples(scene, 0, (256, 0.2));
    assert!(followed < 0.06 && followed < 0.6 * reflected, "off by {followed}, samples by {reflected}");
}

/// Of a coarse solution: its leaves are as large as the shadows. Both are off by the reference's noise, too.
#[test]
fn shadows_at_pixels_are_nearer_to_the_truth_than_those_of_vertices() {
    let scene = Scene::load("cornell").expect("built in");
    let [at_pixels, at_vertices] = off_by_samples(scene, 1, (1024, 0.3));
    assert!(at_pixels < 0.01 && at_pixels < 0.8 * at_vertices, "off by {at_pixels}, vertices by {at_vertices}");
}

#[test]
fn final_gathers_are_the_same_on_any_number_of_threads() {
    let scene = Arc::new(Scene::load("glossy-sphere").expect("built in"));
    let camera = Camera { width: 16, height: 12, ..scene.cameras[0].1 };
    let settings = Settings::with_error(0.5);
    let solved =
        Solved::new(Arc::clone(&scene), settings, false, &mut |_| ControlFlow::Continue(())).expect("solvable");
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| RayCaster::new(&scene, &solved.solution, Mode::Gather).with_grid(1).render(&camera, &|_| ()))
    });
    assert_eq!(one, three, "every path has random numbers of its own");
}

/// Light that comes by way of a small plate, as by that of a lampshade: rays find it seldom.
#[test]
fn bright_parts_are_no_fireflies() {
    let square = |half: f64, z: f64, flip: bool| {
        let p = |x: f64, y: f64| dvec3(x * half, y * half, z);
        let corners = [p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)];
        Surface { flip, ..Surface::new(Shape::Quad(corners), 0) }
    };
    let material = Material {
        name: "white".into(),
        reflector: Arc::new(Lambert::new(Rgb::splat(0.7)).expect("a reflectance")),
        exitance: Rgb::ZERO,
        two_sided: false,
        texture: None,
        base_color: Rgb::ONE,
    };
    let kind = LightKind::Spot { direction: glam::Vec3::Z, cos_inner: 0.95, cos_outer: 0.9 };
    let light = Light { position: dvec3(0.0, 0.0, 0.8), intensity: Rgb::new(3.0, 2.0, 0.0), kind };
    let scene = Arc::new(Scene {
        surfaces: vec![square(2.0, 0.0, false), square(0.1, 1.0, true)],
        materials: vec![material],
        lights: vec![light],
        ..Scene::default()
    });
    let camera = Camera {
        eye: [1.0, 0.0, 0.7],
        target: [0.4, 0.0, 0.0],
        up: [0.0, 0.0, 1.0],
        fov_x: 8.0,
        width: 16,
        height: 16,
    };
    let rays = path_tracer::visibility(&scene).expect("sound");
    let right = PathTracer::new(&scene, &rays).render(&Camera { width: 2, height: 2, ..camera }, 16_384, 1, &|_| ());
    let settings = Settings::with_error(0.05);
    let solved =
        Solved::new(Arc::clone(&scene), settings, false, &mut |_| ControlFlow::Continue(())).expect("solvable");
    let image = RayCaster::new(&scene, &solved.solution, Mode::Gather).render(&camera, &|_| ());
    let mean = |pixels: &[Rgb]| pixels.iter().sum::<Rgb>() / pixels.len() as f32;
    let (found, right) = (mean(&image.pixels), mean(&right.image.pixels));
    let off = ((found - right) / right.max(Rgb::splat(1e-9))).abs();
    // The solution's error at the plate.
    assert!(off.x < 0.025 && off.y < 0.025 && found.z == 0.0, "{found}, right is {right}");
    let noise = image.pixels.iter().map(|pixel| (pixel.x / found.x - 1.0).powi(2)).sum::<f32>() / 256.0;
    // A hundredth of the rays would meet the plate: of 64, 0.6 ± 0.8.
    assert!(noise.sqrt() < 0.12, "{} between pixels", noise.sqrt());
}

//! Final gathers against the path tracer: they share paths, but not what is at their ends.

use hr_diffuse::Settings;
use hr_scene::{Camera, Rgb, Scene};
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
        let settings = Settings::with_error(0.15);
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

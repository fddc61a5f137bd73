//! Things that move in glossy scenes: the light is that of a fresh solve, and so is what the eye sees of it.

use glam::DVec3;
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{Rgb, Settings, Shape, Solution, Solver};
use hr_scene::{Camera, Scene};
use hr_view::Mode;
use hr_view::raycast::RayCaster;
use std::ops::{ControlFlow, Range};
use std::sync::{Arc, LazyLock};

/// The error that is asked for.
const ERROR: f32 = 0.1;

/// Surfaces of `glossy-sphere`.
const SPHERE: usize = 2;
const LAMP: usize = 3;

fn solver(scene: &Arc<Scene>) -> Solver<GlossyField> {
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    let mut solver = Solver::new(&scene.input(), Settings::with_error(ERROR), field).expect("the scene is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver
}

fn finished(mut solver: Solver<GlossyField>) -> Solution<GlossyField> {
    solver.reflect_for_display(&mut |_| ControlFlow::Continue(()));
    solver.finish(&mut |_| ControlFlow::Continue(()))
}

/// The scene with some of its surfaces elsewhere.
fn shifted(scene: &Scene, surfaces: Range<usize>, by: DVec3) -> Arc<Scene> {
    let mut scene = scene.clone();
    for surface in &mut scene.surfaces[surfaces] {
        match &mut surface.shape {
            Shape::Quad(corners) => corners.iter_mut().for_each(|p| *p += by),
            Shape::Sphere { center, .. } => *center += by,
            other => panic!("{other:?} does not move here"),
        }
    }
    Arc::new(scene)
}

/// Relative difference of the irradiances of all sides, by area.
fn irradiances(a: &Solution<GlossyField>, b: &Solution<GlossyField>) -> f32 {
    let of = |solution: &Solution<GlossyField>| -> Vec<(Rgb, f32)> {
        let side = |&node: &u32| match solution.elements.nodes.get(node as usize) {
            Some(element) => (solution.exitant.irradiance[node as usize], element.area),
            None => (Rgb::ZERO, 0.0),
        };
        solution.elements.surface_nodes.as_flattened().iter().map(side).collect()
    };
    let (a, b) = (of(a), of(b));
    let apart: f32 = a.iter().zip(&b).map(|((p, s), (q, t))| (*p - *q).abs().element_sum() * s.max(*t)).sum();
    apart / b.iter().map(|(light, area)| light.element_sum() * area).sum::<f32>()
}

/// Relative difference of pictures of both, by blocks of 8 × 8 pixels: what is between them is how leaves lie.
fn pictures(scene: &Scene, a: &Solution<GlossyField>, b: &Solution<GlossyField>, mode: Mode) -> f32 {
    const BLOCKS: usize = 10;
    let camera = Camera { width: 80, height: 80, ..scene.cameras[0].1 };
    let blocks = |solution: &Solution<GlossyField>| {
        let image = RayCaster::new(scene, solution, mode).render(&camera, &|_| ());
        let mut sums = [Rgb::ZERO; BLOCKS * BLOCKS];
        for (k, pixel) in image.pixels.iter().enumerate() {
            sums[k / 80 / 8 * BLOCKS + k % 80 / 8] += *pixel;
        }
        sums
    };
    let (a, b) = (blocks(a), blocks(b));
    let apart: f32 = a.iter().zip(&b).map(|(a, b)| (*a - *b).abs().element_sum()).sum();
    apart / b.iter().map(|b| b.element_sum()).sum::<f32>()
}

/// The scene before anything has moved, what has solved it, and its solution.
static BEFORE: LazyLock<(Arc<Scene>, Solver<GlossyField>, Solution<GlossyField>)> = LazyLock::new(|| {
    let scene = Arc::new(Scene::load("glossy-sphere").expect("built in"));
    let solver = solver(&scene);
    let solution = finished(solver.clone());
    (scene, solver, solution)
});

/// Moves what is in the solved scene once or several times, and compares it to a fresh solve.
fn rearranged(moves: &[Arc<Scene>]) {
    let (_, solved, before) = &*BEFORE;
    let mut solver = solved.clone();
    for scene in moves {
        solver.rearrange(&scene.input(), &mut |_| ControlFlow::Continue(())).expect("places of the same surfaces");
    }
    assert!(solver.stats().kept_links > 0, "some of it stays");
    let last = moves.last().expect("a move");
    let (there, fresh) = (finished(solver), finished(self::solver(last)));
    let off = irradiances(&there, &fresh);
    assert!(off < ERROR, "irradiance is off by {off}");
    for mode in [Mode::Samples, Mode::Distributions] {
        let (edit, off) = (pictures(last, before, &fresh, mode), pictures(last, &there, &fresh, mode));
        assert!(edit > 2.0 * ERROR, "{mode:?}: the edit is one: {edit}");
        assert!(off < ERROR, "{mode:?}: pictures are off by {off}");
    }
}

#[test]
fn a_moved_mirror_reflects_what_it_sees_there() {
    rearranged(&[shifted(&BEFORE.0, SPHERE..SPHERE + 1, DVec3::new(-0.6, 0.5, 0.3))]);
}

#[test]
fn highlights_follow_a_moved_lamp() {
    rearranged(&[shifted(&BEFORE.0, LAMP..LAMP + 1, DVec3::new(-1.5, 0.6, -0.3))]);
}

#[test]
fn moves_one_after_the_other_leave_nothing_behind() {
    let aside = shifted(&BEFORE.0, SPHERE..SPHERE + 1, DVec3::new(0.9, 0.9, 0.0));
    let both = shifted(&aside, LAMP..LAMP + 1, DVec3::new(-1.0, 0.2, 0.0));
    rearranged(&[aside, both]);
}

#[test]
fn in_a_room_that_is_mostly_glossy_leaves_keep_what_they_found_out() {
    let scene = Arc::new(Scene::load("room").expect("built in"));
    let ball = scene.surfaces.iter().position(|surface| matches!(surface.shape, Shape::Sphere { .. }));
    let ball = ball.expect("something round stands there");
    let mut solver = solver(&scene);
    let first = solver.stats().rays;
    let moved = shifted(&scene, ball..ball + 1, DVec3::new(0.05, 0.0, 0.0));
    solver.rearrange(&moved.input(), &mut |_| ControlFlow::Continue(())).expect("places of the same surfaces");
    let stats = solver.stats();
    let rays = (stats.rays - first) as f64 / first as f64;
    assert!(stats.error.is_some_and(|error| error < ERROR), "{stats:?}");
    assert!(rays < 0.15, "{rays} of the rays of the first solve");
}

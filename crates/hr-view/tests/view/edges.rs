//! Edges of what is brighter than white, and what is noisy, as they are printed.

use hr_diffuse::Settings;
use hr_scene::{Camera, Exposure, Rgb, Scene, ToneMap};
use hr_view::Mode;
use hr_view::path_tracer::{self, PathTracer};
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Side of the squares of small pixels that a pixel is compared with.
const FINER: u32 = 6;

/// Light that a screen shows of a code.
fn shown(code: u8) -> f32 {
    let v = f32::from(code) / 255.0;
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

#[test]
fn lamps_have_smooth_edges_in_prints_and_radiance_stays_as_it_is() {
    let scene = Arc::new(Scene::load("cornell").expect("built in"));
    let settings = Settings::with_error(0.5);
    let solved = Solved::new(Arc::clone(&scene), settings, true, &mut |_| ControlFlow::Continue(())).expect("solvable");
    let camera = Camera { width: 96, height: 72, ..scene.default_camera() };
    let fine = Camera { width: FINER * camera.width, height: FINER * camera.height, ..camera };
    for mode in [Mode::Distributions, Mode::Gather] {
        let caster = RayCaster::new(&scene, &solved.solution, mode);
        let film = caster.film(&camera, &|_| ());
        assert_eq!(film.image, caster.render(&camera, &|_| ()), "{mode:?}: radiance is that of any image");
        let factor = ToneMap::default().factor(&film.image.pixels, scene.primaries);
        let map = ToneMap { exposure: Exposure::Factor(factor), ..ToneMap::default() };
        // Small pixels, each printed, and what they show together.
        let small = RayCaster::new(&scene, &solved.solution, Mode::Distributions).with_grid(1).film(&fine, &|_| ());
        let rays = path_tracer::visibility(&scene).expect("sound");
        let shines = PathTracer::new(&scene, &rays).emission(&fine).pixels;
        let codes = small.to_srgb8(&map, scene.primaries);
        let mut right = vec![0.0; film.image.pixels.len()];
        let mut lamp = vec![0; right.len()];
        for (i, code) in codes.chunks_exact(3).enumerate() {
            let (x, y) = (i as u32 % fine.width / FINER, i as u32 / fine.width / FINER);
            let place = (y * camera.width + x) as usize;
            right[place] += shown(code[0]) / (FINER * FINER) as f32;
            lamp[place] += u32::from(shines[i] != Rgb::ZERO);
        }
        let off = |codes: &[u8]| {
            let at_edges = || (0..right.len()).filter(|&i| lamp[i] > 0 && lamp[i] < FINER * FINER);
            assert!(at_edges().count() > 12, "the lamp has edges");
            let error = |i: usize| (shown(codes[3 * i]) - right[i]).abs();
            at_edges().map(error).sum::<f32>() / at_edges().count() as f32
        };
        let (printed, averaged) =
            (off(&film.to_srgb8(&map, scene.primaries)), off(&film.image.to_srgb8(&map, scene.primaries)));
        // Paths of a final gather know a share of a pixel to 0.5/√64 = 0.06 at worst, and to half of that on average, as they are spread
        // evenly; rays that look for edges are more.
        assert!(printed < 0.02, "{mode:?}: {printed} off");
        assert!(averaged > 5.0 * printed, "{mode:?}: {averaged} off were it averaged as radiance");
    }
}

/// Where narrow lobes show lamps, rays of a pixel differ much.
#[test]
fn prints_of_what_is_noisy_have_more_rays() {
    let scene = Arc::new(Scene::load("glossy-sphere").expect("built in"));
    let settings = Settings::with_error(0.3);
    let solved =
        Solved::new(Arc::clone(&scene), settings, false, &mut |_| ControlFlow::Continue(())).expect("solvable");
    let camera = Camera { width: 40, height: 30, ..scene.default_camera() };
    let caster = |grid| RayCaster::new(&scene, &solved.solution, Mode::Samples).with_grid(grid);
    let (film, fine) = (caster(2).film(&camera, &|_| ()), caster(12).film(&camera, &|_| ()));
    assert_eq!(film.image, caster(2).render(&camera, &|_| ()), "radiance is that of any image");
    let factor = ToneMap::default().factor(&fine.image.pixels, scene.primaries);
    let map = ToneMap { exposure: Exposure::Factor(factor), ..ToneMap::default() };
    let [right, printed, plain] = [
        &fine.to_srgb8(&map, scene.primaries),
        &film.to_srgb8(&map, scene.primaries),
        &film.image.to_srgb8(&map, scene.primaries),
    ]
    .map(|codes| codes.iter().map(|&code| shown(code)).collect::<Vec<_>>());
    let off = |codes: &[f32]| codes.iter().zip(&right).map(|(a, b)| (a - b).abs()).sum::<f32>();
    let (printed, plain) = (off(&printed), off(&plain));
    // Up to eight times as many rays; not where there is less noise than prints show.
    assert!(printed < 0.7 * plain, "{printed} off where there are more rays, {plain} where there are not");
}

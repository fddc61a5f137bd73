//! Glossy light computed at pixels by the device, against the ray caster on the processor.

use glam::{DVec3, Mat3, Vec2, Vec3};
use glossy_ext::{MetallicRoughness, Phong, Reflector, Rgb, Sum, Ward};
use hr_diffuse::Settings;
use hr_scene::{Camera, Scene};
use hr_view::Mode;
use hr_view::display::Walkable;
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use hr_view::walkthrough::Walkthrough;
use hr_view::window::{Curve, Snapshot, Tone, WindowError};
use std::ops::ControlFlow;
use std::sync::Arc;

fn solved(scene: Scene, error: f32) -> Arc<Solved> {
    let watch = &mut |_: &_| ControlFlow::Continue(());
    Arc::new(Solved::new(Arc::new(scene), Settings::with_error(error), true, watch).expect("a sound scene"))
}

/// The Cornell box, white things of another material.
fn box_of(reflector: Arc<dyn Reflector>) -> Scene {
    let mut scene = Scene::load("cornell").expect("built in");
    scene.materials[0].reflector = reflector;
    scene
}

/// Draws, or says that there is nothing to draw with.
fn draw(walk: &dyn Walkable, camera: &Camera, tone: &Tone) -> Option<Snapshot> {
    match Snapshot::of(walk, camera, Some(tone)) {
        Ok(picture) => Some(picture),
        Err(WindowError::NoAdapter(reason)) => {
            eprintln!("skipped, no graphics device: {reason}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// The surface that each pixel's middle shows.
fn surfaces(solved: &Solved, camera: &Camera) -> Vec<Option<u32>> {
    let data = &solved.solution.scene;
    let eye = data.normalization.to_unit(DVec3::from(camera.eye));
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
    pixels
        .map(|(x, y)| {
            let direction = camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5).as_vec3();
            data.visibility.closest(eye, direction, 1e-6, f32::MAX).map(|hit| hit.surface)
        })
        .collect()
}

/// What the ray caster sees in this mode, and where all that is around a pixel is of one surface that does not shine.
struct Truth {
    light: Vec<Rgb>,
    counts: Vec<bool>,
}

impl Truth {
    /// Lobes narrower than `followed` (radians) are followed by rays.
    fn new(solved: &Solved, camera: &Camera, followed: f32) -> Self {
        let caster =
            RayCaster::new(&solved.scene, &solved.solution, Mode::Samples).with_grid(2).with_followed(followed);
        let light = caster.render(camera, &|_| ()).pixels;
        let surfaces = surfaces(solved, camera);
        let (width, height) = (camera.width as usize, camera.height as usize);
        let counts = (0..width * height).map(|i| {
            let (x, y) = (i % width, i / width);
            let around = [y.wrapping_sub(1), y, y + 1]
                .into_iter()
                .flat_map(|y| [x.wrapping_sub(1), x, x + 1].map(|x| (x, y)))
                .filter(|&(x, y)| x < width && y < height);
            let shines = |surface: u32| {
                let material = solved.scene.surfaces[surface as usize].material;
                solved.scene.materials[material as usize].exitance != Rgb::ZERO
            };
            surfaces[i]
                .is_some_and(|own| !shines(own) && around.clone().all(|(x, y)| surfaces[y * width + x] == Some(own)))
        });
        Self { light, counts: counts.collect() }
    }

    /// A tone that shows radiance as it is, the brightest pixel that counts as white.
    fn tone(&self) -> Tone {
        let counted = self.light.iter().zip(&self.counts).filter(|(_, counts)| **counts);
        let most = counted.map(|(light, _)| light.max_element()).fold(0.0, f32::max);
        let curve = Curve { numerator: [0.0, 1.0], denominator: [0.0, 0.0, 1.0] };
        Tone { exposure: most.recip(), to_srgb: Mat3::IDENTITY, curve }
    }

    /// Mean difference of a picture drawn with the tone, as a share of the mean light.
    fn difference(&self, picture: &Snapshot, tone: &Tone) -> f32 {
        let (mut off, mut sum) = (0.0, 0.0);
        for ((light, counts), pixel) in self.light.iter().zip(&self.counts).zip(picture.rgba.chunks_exact(4)) {
            if *counts {
                let shown = Vec3::from([0, 1, 2].map(|c| decoded(pixel[c])));
                off += (shown - *light * tone.exposure).abs().element_sum();
                sum += (*light * tone.exposure).element_sum();
            }
        }
        off / sum
    }
}

/// The linear value of an sRGB code.
fn decoded(code: u8) -> f32 {
    let x = f32::from(code) / 255.0;
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// Every formula, in lobes that are wide enough for samples, with the ray caster reflecting them, too.
#[test]
fn pixels_agree_with_the_ray_caster() {
    let white = Rgb::new(0.5, 0.45, 0.4);
    let phong = || Arc::new(Phong::new(0.4 * white, 0.5 * Rgb::ONE, 20.0).expect("Phong"));
    let ward = || Arc::new(Ward::new(0.3 * white, white, 0.25).expect("Ward"));
    let brushed =
        Ward::anisotropic(0.2 * white, white, Vec2::new(0.2, 0.5), Vec3::new(1.0, 0.3, 0.2)).expect("brushed");
    let metal = |metallic: f32, roughness: f32| MetallicRoughness::new(white, metallic, roughness).expect("a metal");
    let cases: [(&str, Arc<dyn Reflector>); 7] = [
        ("Phong", phong()),
        ("Ward", ward()),
        ("brushed", Arc::new(brushed)),
        ("metal", Arc::new(metal(1.0, 0.6))),
        ("plastic", Arc::new(metal(0.3, 0.5))),
        ("compensated", Arc::new(metal(0.6, 0.8).compensated())),
        ("sum", Arc::new(Sum::new(vec![phong(), ward()]))),
    ];
    for (name, reflector) in cases {
        let solved = solved(box_of(reflector), 0.5);
        for (view, camera) in &solved.scene.cameras {
            let camera = Camera { width: 80, height: 80, ..*camera };
            let truth = Truth::new(&solved, &camera, 0.0);
            let tone = truth.tone();
            let walk = Walkthrough::new(Arc::clone(&solved), Mode::Samples);
            let Some(picture) = draw(&walk, &camera, &tone) else { return };
            let off = truth.difference(&picture, &tone);
            eprintln!("{name}, {view}: {:.2} % of the light", 100.0 * off);
            assert!(off < 0.015, "{name}, {view}: {off} of the light");
        }
    }
}

/// Rays that follow narrow lobes show the lamp as it is; pixels that reflect samples show it with its own outline, too.
#[test]
fn highlights_have_the_outline_of_their_lamp() {
    let solved = solved(Scene::load("area-light").expect("built in"), 0.1);
    let (_, camera) = &solved.scene.cameras[0];
    // The highlight, close up.
    let camera = Camera { target: [0.0, -0.4, 0.0], fov_x: 22.0, width: 96, height: 72, ..*camera };
    let truth = Truth::new(&solved, &camera, f32::INFINITY);
    let tone = truth.tone();
    let walk = Walkthrough::new(Arc::clone(&solved), Mode::Samples);
    let Some(picture) = draw(&walk, &camera, &tone) else { return };
    let off = truth.difference(&picture, &tone);
    // Were the lamp's parts disks, 13 % would be off.
    assert!(off < 0.06, "{off} of the light");
}

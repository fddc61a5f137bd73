//! Highlights in narrow lobes: of small lamps, and of lights without extent, which no ray ever meets.

use glam::{DVec3, Vec3};
use glossy_ext::reflector::{Reflector, Ward};
use hr_diffuse::{Light, LightKind, Settings, Shape, Surface};
use hr_scene::{Camera, Material, Rgb, Scene};
use hr_view::Mode;
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use std::f32::consts::FRAC_1_PI;
use std::ops::ControlFlow;
use std::sync::Arc;

const ALPHA: f32 = 0.03;
/// The eye, and the light in its mirror image, so that the highlight is in the middle of the plate.
const EYE: DVec3 = DVec3::new(-1.0, 0.0, 1.0);
const LIGHT: DVec3 = DVec3::new(2.0, 0.0, 2.0);

fn material(reflector: Ward, exitance: Rgb) -> Material {
    Material {
        name: String::new(),
        reflector: Arc::new(reflector),
        exitance,
        two_sided: false,
        texture: None,
        base_color: Rgb::ONE,
    }
}

fn square(middle: DVec3, half: f64, facing: DVec3, material: u32) -> Surface {
    let a = facing.any_orthonormal_vector() * half;
    let b = facing.cross(a);
    Surface::new(Shape::Quad([middle - a - b, middle + a - b, middle + a + b, middle - a + b]), material)
}

fn plate() -> Ward {
    Ward::new(Rgb::splat(0.1), Rgb::splat(0.4), ALPHA).expect("a sound reflector")
}

/// A glossy plate, lit by a light without extent or by a lamp.
fn scene(lamp: Option<(f64, Rgb)>, light: Option<Light>) -> Arc<Scene> {
    let mut surfaces = vec![square(DVec3::ZERO, 0.5, DVec3::Z, 0)];
    surfaces.extend(lamp.map(|(half, _)| square(LIGHT, half, -LIGHT.normalize(), 1)));
    let black = Ward::new(Rgb::ZERO, Rgb::ZERO, 0.5).expect("a sound reflector");
    let scene = Scene {
        surfaces,
        materials: vec![
            material(plate(), Rgb::ZERO),
            material(black, lamp.map_or(Rgb::ZERO, |(_, exitance)| exitance)),
        ],
        lights: light.into_iter().collect(),
        ..Scene::default()
    };
    Arc::new(scene.finish().expect("the scene is sound"))
}

/// The pixels of a small picture of the middle of the plate.
fn picture(scene: &Arc<Scene>) -> Vec<f32> {
    let solved = Solved::new(Arc::clone(scene), Settings::with_error(0.1), false, &mut |_| ControlFlow::Continue(()))
        .expect("solvable");
    let camera = Camera { eye: EYE.into(), target: [0.0; 3], up: [0.0, 0.0, 1.0], fov_x: 0.2, width: 4, height: 4 };
    let image = RayCaster::new(scene, &solved.solution, Mode::Samples).render(&camera, &|_| ());
    image.pixels.iter().map(|pixel| pixel.x).collect()
}

/// Radiance in the middle of the highlight of a light that makes so much irradiance on a surface that faces it.
fn truth(irradiance: f32) -> f32 {
    let cosine = std::f32::consts::FRAC_1_SQRT_2;
    let (out, back) = (Vec3::new(-cosine, 0.0, cosine), Vec3::new(cosine, 0.0, cosine));
    (plate().glossy(back, out).x + plate().diffuse().x * FRAC_1_PI) * cosine * irradiance
}

#[test]
fn lights_without_extent_are_seen_in_narrow_lobes() {
    let light = Light { position: LIGHT, intensity: Rgb::ONE, kind: LightKind::Point };
    let right = truth(1.0 / LIGHT.length_squared() as f32);
    for found in picture(&scene(None, Some(light))) {
        assert!((found / right - 1.0).abs() < 0.02, "{found} is {right}");
    }
}

#[test]
fn highlights_of_small_lamps_are_free_of_noise() {
    let (half, exitance) = (0.005, 1e4);
    // It takes up so little that few rays of a lobe would meet it.
    let right = truth(exitance * FRAC_1_PI * (4.0 * half * half / LIGHT.length_squared()) as f32);
    let pixels = picture(&scene(Some((half, Rgb::splat(exitance))), None));
    for found in &pixels {
        assert!((found / right - 1.0).abs() < 0.05, "{found} is {right} in {pixels:?}");
    }
}

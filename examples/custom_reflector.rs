//! A material of one's own: paint with glass beads in it, as on road signs, that throws light back to where it comes
//! from. The conformance kit looks it over before its picture is taken.
//!
//! `cargo run --release --example custom_reflector` writes `custom_reflector.png` into the current folder.

use glam::{DVec3, Vec3};
use glossy_ext::reflector::HORIZON;
use glossy_ext::{Lambert, Reflector, Rgb, conformance};
use hr_diffuse::{Settings, Shape, Surface};
use hr_scene::{Camera, Material, Primaries, Scene, ToneMap};
use hr_view::Mode;
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use std::error::Error;
use std::f32::consts::{FRAC_1_PI, PI};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// A Lambertian ground, and on it a lobe about the direction that light comes from.
#[derive(Debug)]
struct Retroreflector {
    /// Diffuse reflectance.
    ground: Rgb,
    /// Reflectance of the lobe for light along the normal.
    beads: Rgb,
    /// The lobe is the n-th power of the cosine to the incident direction.
    exponent: f32,
}

impl Reflector for Retroreflector {
    // Reciprocal, as the cosine between the two directions is.
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        if incident.z <= HORIZON || outgoing.z <= HORIZON {
            return Rgb::ZERO;
        }
        let lobe = incident.dot(outgoing).max(0.0).powf(self.exponent);
        self.ground * FRAC_1_PI + self.beads * ((self.exponent + 2.0) / (2.0 * PI) * lobe)
    }

    // Optional, but then that share travels as radiosity, which is cheap. All else (albedo, peak and width of the
    // lobe, its mean over a sender) the trait finds out numerically; who knows it in closed form overrides it.
    fn diffuse(&self) -> Rgb {
        self.ground
    }
}

fn material(name: &str, reflector: impl Reflector + 'static, exitance: Rgb) -> Material {
    Material {
        name: name.into(),
        reflector: Arc::new(reflector),
        exitance,
        two_sided: false,
        texture: None,
        base_color: Rgb::ONE,
    }
}

#[expect(clippy::print_stdout, reason = "an example tells what it found out")]
/// A lamp beside the camera shines on three balls: plaster, retroreflector, plaster.
fn scene() -> Result<Scene, Box<dyn Error>> {
    let beads = Retroreflector { ground: Rgb::new(0.3, 0.08, 0.02), beads: Rgb::new(0.1, 0.07, 0.02), exponent: 20.0 };
    let measured = conformance::check(&beads)?;
    println!("The beads reflect at most {:.1} % of the light.", 100.0 * measured.largest_albedo);
    let quad = |corner: DVec3, a: DVec3, b: DVec3, material| {
        Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), material)
    };
    let mut surfaces = vec![
        quad(DVec3::new(-3.0, -2.0, 0.0), DVec3::X * 6.0, DVec3::Y * 4.0, 0),
        quad(DVec3::new(-3.0, 2.0, 0.0), DVec3::X * 6.0, DVec3::Z * 3.0, 0),
        quad(DVec3::new(-0.8, -3.0, 2.0), DVec3::Z * 0.5, DVec3::X * 0.5, 2),
    ];
    for (x, material) in [(-1.3, 0), (0.0, 1), (1.3, 0)] {
        surfaces.push(Surface::new(Shape::Sphere { center: DVec3::new(x, 0.3, 0.6), radius: 0.6 }, material));
    }
    let camera = Camera {
        eye: [0.0, -4.5, 1.9],
        target: [0.0, 0.3, 0.7],
        up: [0.0, 0.0, 1.0],
        fov_x: 48.0,
        width: 480,
        height: 300,
    };
    Ok(Scene {
        name: "retroreflector".into(),
        surfaces,
        materials: vec![
            material("plaster", Lambert::new(Rgb::splat(0.6))?, Rgb::ZERO),
            material("beads", beads, Rgb::ZERO),
            material("lamp", Lambert::BLACK, Rgb::splat(400.0)),
        ],
        cameras: vec![("front".into(), camera)],
        primaries: Primaries::Rec709,
        ..Scene::default()
    }
    .finish()?)
}

#[expect(clippy::print_stdout, reason = "an example tells where its picture is")]
fn main() -> Result<(), Box<dyn Error>> {
    let scene = Arc::new(scene()?);
    let solved = Solved::new(Arc::clone(&scene), Settings::with_error(0.1), true, &mut |_| ControlFlow::Continue(()))?;
    let film = RayCaster::new(&scene, &solved.solution, Mode::Samples).film(&scene.cameras[0].1, &|_| ());
    let path = Path::new("custom_reflector.png");
    film.save(path, &ToneMap::default(), scene.primaries)?;
    println!("{}", std::path::absolute(path)?.display());
    Ok(())
}

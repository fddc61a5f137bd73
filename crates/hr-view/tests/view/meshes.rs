//! Glossy light of what is cut finely, and in pictures with many rays.

use glam::{DVec3, Vec3};
use glossy_ext::reflector::{MetallicRoughness, Reflector, Ward};
use hr_diffuse::{Settings, Shape, Surface};
use hr_scene::{Camera, Image, Material, Rgb, Scene};
use hr_view::Mode;
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::Arc;

const GLOSSY: u32 = 0;
const WALL: u32 = 1;
const LAMP: u32 = 2;

fn material(reflector: impl Reflector + 'static, exitance: f32) -> Material {
    Material {
        name: String::new(),
        reflector: Arc::new(reflector),
        exitance: Rgb::splat(exitance),
        two_sided: false,
        texture: None,
        base_color: Rgb::ONE,
    }
}

fn quad(corner: DVec3, a: DVec3, b: DVec3, material: u32) -> Surface {
    Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), material)
}

/// A glossy floor in `parts` by `parts` pieces before a wall, below a lamp.
fn floor(parts: u32, reflector: impl Reflector + 'static) -> Arc<Scene> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let part = 2.0 / f64::from(parts);
    let piece = |i: u32| DVec3::new(f64::from(i % parts), f64::from(i / parts), 0.0) * part;
    let mut surfaces: Vec<Surface> = (0..parts * parts).map(|i| quad(piece(i), x * part, y * part, GLOSSY)).collect();
    surfaces.push(quad(y * 2.0, x * 2.0, z, WALL));
    surfaces.push(quad(DVec3::new(0.8, 1.2, 1.0), y * 0.4, x * 0.4, LAMP));
    let wall = MetallicRoughness::new(Rgb::new(0.7, 0.5, 0.3), 0.0, 1.0).expect("a wall");
    let black = Ward::new(Rgb::ZERO, Rgb::ZERO, 0.5).expect("black");
    let materials = vec![material(reflector, 0.0), material(wall, 0.0), material(black, 10.0)];
    Arc::new(Scene { surfaces, materials, ..Scene::default() }.finish().expect("a sound scene"))
}

fn solved(scene: &Arc<Scene>) -> Solved {
    let watch = &mut |_: &_| ControlFlow::Continue(());
    Solved::new(Arc::clone(scene), Settings::with_error(0.05), true, watch).expect("a sound scene")
}

fn camera(width: u32) -> Camera {
    let (eye, target) = ([1.0, 0.3, 0.8], [1.0, 1.1, 0.0]);
    Camera { eye, target, up: [0.0, 0.0, 1.0], fov_x: 45.0, width, height: width }
}

fn picture(solved: &Solved, mode: Mode, grid: u32, width: u32) -> Image {
    RayCaster::new(&solved.scene, &solved.solution, mode).with_grid(grid).render(&camera(width), &|_| ())
}

/// Means of squares of pixels.
fn means(image: &Image, side: usize) -> Vec<Vec3> {
    let (width, height) = (image.width as usize, image.height as usize);
    let square = |i: usize| {
        let (x, y) = (i % (width / side) * side, i / (width / side) * side);
        let pixels = (0..side * side).map(|k| image.pixels[(y + k / side) * width + x + k % side]);
        pixels.sum::<Vec3>() / (side * side) as f32
    };
    (0..(width / side) * (height / side)).map(square).collect()
}

fn difference(a: &[Vec3], b: &[Vec3]) -> f32 {
    let off: f32 = a.iter().zip(b).map(|(a, b)| (*a - *b).abs().element_sum()).sum();
    off / a.iter().map(|light| light.element_sum()).sum::<f32>()
}

/// However finely a floor is cut, it shows the same, and has not many more distributions.
#[test]
fn a_floor_shows_the_same_in_many_pieces() {
    let metal = || MetallicRoughness::new(Rgb::new(0.9, 0.8, 0.7), 1.0, 0.5).expect("a metal");
    let [whole, cut] = [1, 64].map(|parts| solved(&floor(parts, metal())));
    let [few, many] = [&whole, &cut].map(|it| it.solution.reflected.iter().filter(|light| !light.is_empty()).count());
    let leaves = cut.solution.stats.leaves as usize;
    assert!(leaves > 4000 && 4 * many < leaves, "{many} distributions of {leaves} leaves, {few} where it is whole");
    let [whole, cut] = [whole, cut].map(|it| means(&picture(&it, Mode::Distributions, 2, 96), 4));
    let off = difference(&whole, &cut);
    // Were clusters not blended, 7 % would be off.
    assert!(off < 0.05, "{off} of the light");
}

/// The middle of a pixel stands for its rays: a picture of as many pixels as there were rays, each with its own light, is the same.
#[test]
fn rays_of_a_pixel_see_what_its_middle_shows() {
    let gloss = Ward::new(Rgb::splat(0.2), Rgb::splat(0.5), 0.2).expect("a gloss");
    let solved = solved(&floor(1, gloss));
    let [shared, apart] = [(3, 96), (1, 288)].map(|(grid, width)| {
        let caster = RayCaster::new(&solved.scene, &solved.solution, Mode::Samples).with_grid(grid).with_followed(0.0);
        caster.render(&camera(width), &|_| ())
    });
    let off = difference(&means(&shared, 2), &means(&apart, 6));
    assert!(off < 0.005, "{off} of the light");
}

/// A metal ball of so many facets around, which are shown round, on a floor between walls.
fn ball(facets: u32, roughness: f32) -> Arc<Scene> {
    let metal = MetallicRoughness::new(Rgb::new(0.9, 0.8, 0.6), 1.0, roughness).expect("a metal");
    let mut scene = Scene::clone(&floor(1, metal));
    let (z, center, radius) = (DVec3::Z, DVec3::new(1.0, 1.2, 0.35), 0.3);
    // The floor is a wall's; the other wall is behind the eye.
    scene.surfaces[0].material = WALL;
    scene.surfaces.push(quad(DVec3::ZERO, z, DVec3::X * 2.0, WALL));
    let normal = |i: u32, k: u32| {
        let [polar, around] = [(i, 1.0), (k, 2.0)].map(|(n, turns)| turns * PI * f64::from(n) / f64::from(facets));
        DVec3::new(polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos())
    };
    for (i, k) in (0..facets).flat_map(|i| (0..facets).map(move |k| (i, k))) {
        let normals = [(i, k), (i + 1, k), (i + 1, k + 1), (i, k + 1)].map(|(i, k)| normal(i, k));
        let corners = normals.map(|normal| center + normal * radius);
        let shape = match i {
            0 => Shape::Triangle([corners[0], corners[1], corners[2]]),
            _ if i + 1 == facets => Shape::Triangle([corners[0], corners[1], corners[3]]),
            _ => Shape::Quad(corners),
        };
        let mut shading = normals.map(|normal| normal.as_vec3());
        if i + 1 == facets {
            shading[2] = shading[3];
        }
        scene.surfaces.push(Surface { shading_normals: Some(shading), ..Surface::new(shape, GLOSSY) });
    }
    Arc::new(scene.finish().expect("a sound scene"))
}

/// Distributions of facets are turned by the normal of the place that is seen: they show what is around as sharply as the rays that
/// pictures follow.
#[test]
fn facets_that_are_shown_round_mirror_sharply() {
    let solved = solved(&ball(12, 0.2));
    // 40 % are off where normals of whole facets blur them.
    let off = distributions_are_off(&solved);
    assert!(off < 0.1, "{off} of the light");
}

/// How much distributions of the ball are off what rays find that pictures follow.
fn distributions_are_off(solved: &Solved) -> f32 {
    let camera = Camera { eye: [1.0, 0.3, 0.5], target: [1.0, 1.2, 0.35], fov_x: 40.0, ..camera(96) };
    let [distributions, rays] = [Mode::Distributions, Mode::Samples].map(|mode| {
        let caster = RayCaster::new(&solved.scene, &solved.solution, mode).with_grid(2);
        means(&caster.render(&camera, &|_| ()), 4)
    });
    difference(&rays, &distributions)
}

/// The rougher a mesh is the more of its facets share a distribution, and are shown as they would be.
#[test]
fn rough_meshes_have_fewer_distributions() {
    let [polished, rough] = [0.2, 0.9].map(|roughness| solved(&ball(64, roughness)));
    let [many, few] = [&polished, &rough].map(|solved| {
        let stats = &solved.solution.stats;
        stats.leaves - stats.skipped.joined_leaves
    });
    assert!(3 * few < 2 * many, "{few} of rough leaves, {many} of polished ones");
    let off = distributions_are_off(&rough);
    assert!(off < 0.05, "{off} of the light");
}

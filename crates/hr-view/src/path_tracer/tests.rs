use super::*;
use glam::{Mat3, dvec3};
use glossy_ext::{Lambert, Ward};
use hr_diffuse::visibility::Patch;
use hr_diffuse::{Light, LightKind, Shape, Surface};
use hr_scene::{Material, Primaries, ToneMap};

pub(super) fn material(reflector: impl Reflector + 'static, exitance: f32, two_sided: bool) -> Material {
    Material {
        name: String::new(),
        reflector: Arc::new(reflector),
        exitance: Rgb::splat(exitance),
        two_sided,
        texture: None,
        base_color: Rgb::ONE,
    }
}

fn lambert(reflectance: f32) -> Lambert {
    Lambert::new(Rgb::splat(reflectance)).expect("a reflectance")
}

/// A square in the plane z = `height` around the z axis, its front above, or below where `down` is set.
fn square(half: f64, height: f64, down: bool, material: u32) -> Surface {
    let p = |x: f64, y: f64| dvec3(x * half, y * half, height);
    let corners = [p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)];
    Surface { flip: down, ..Surface::new(Shape::Quad(corners), material) }
}

fn scene(surfaces: Vec<Surface>, materials: Vec<Material>) -> Scene {
    Scene { surfaces, materials, ..Scene::default() }
}

/// Mean radiance at `at` toward the eye at `eye` (scene units), and its standard error.
fn seen(scene: &Scene, eye: DVec3, at: DVec3, paths: u32) -> (f64, f64) {
    let rays = visibility(scene).expect("sound surfaces");
    let tracer = PathTracer::new(scene, &rays);
    let (origin, target) = (tracer.normalization.to_unit(eye), tracer.normalization.to_unit(at));
    let direction = (target - origin).normalize();
    let (mut sum, mut squares) = (0.0, 0.0);
    for index in 0..paths {
        let value = f64::from(tracer.path(origin, direction, &Sampler::new(17, index)).x);
        sum += value;
        squares += value * value;
    }
    let mean = sum / f64::from(paths);
    (mean, ((squares / f64::from(paths) - mean * mean).max(0.0) / f64::from(paths)).sqrt())
}

/// Within four standard errors (a chance of 1 in 16 000 to fail, were the seed not fixed) and what f32 leaves; the error
/// itself is bounded, lest the test cannot fail.
fn agrees((mean, sigma): (f64, f64), expected: f64, what: &str) {
    assert!(sigma < 0.02 * expected, "{what}: noise {sigma} of {expected}");
    assert!((mean - expected).abs() < 4.0 * sigma + 1e-5 * expected, "{what}: {mean} ± {sigma}, expected {expected}");
}

/// Irradiance on the ground at the origin from a square of radiosity 1, parallel to it, over 0, by Lambert's formula
/// for a corner (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-3), times 4.
fn parallel_square(half: f64, height: f64) -> f64 {
    let x = half / height;
    let root = (1.0 + x * x).sqrt();
    4.0 / (2.0 * std::f64::consts::PI) * 2.0 * (x / root * (x / root).atan())
}

#[test]
fn furnace_has_the_same_radiance_everywhere() {
    // In a closed cube that emits e and reflects r, radiosity is e/(1 − r) everywhere.
    let scene = Scene::load("furnace").expect("built in");
    let camera = scene.cameras[0].1;
    let camera = Camera { width: 24, height: 18, ..camera };
    let rays = visibility(&scene).expect("sound");
    let tracer = PathTracer::new(&scene, &rays);
    let found = tracer.render(&camera, 256, 0, &|_| ());
    let expected = Rgb::new(1.25, 4.0, 15.0) * FRAC_1_PI;
    let mean = found.image.pixels.iter().sum::<Rgb>() / found.image.pixels.len() as f32;
    // 432 pixels of 256 paths; noise of the mean is below 0.2 % for the brightest channel (15 of which 12 are reflected).
    assert!(((mean - expected) / expected).abs().max_element() < 4e-3, "mean {mean}, expected {expected}");
    let outliers = found.image.pixels.iter().zip(&found.sigma.pixels);
    let outliers = outliers.filter(|(p, s)| (**p - expected).abs().cmpgt(**s * 4.0 + 1e-4).any()).count();
    // 1296 channels within 4 sigma: 0.1 expected outside, were the paths' light normally distributed.
    assert!(outliers <= 2, "{outliers} pixels beyond their standard error");
    let sigma = found.sigma.pixels.iter().sum::<Rgb>() / found.sigma.pixels.len() as f32;
    assert!((sigma / expected).max_element() < 0.1, "noise {sigma}");
}

#[test]
fn direct_light_of_a_square_is_lamberts() {
    let (half, height) = (0.4, 0.7);
    let (eye, at) = (dvec3(0.9, 0.2, 0.4), DVec3::ZERO);
    let form_factor = parallel_square(half, height);
    let surfaces = vec![square(1.0, 0.0, false, 0), square(half, height, true, 1)];
    let lamp = || material(Lambert::BLACK, 10.0, true);
    let diffuse = scene(surfaces.clone(), vec![material(lambert(0.6), 0.0, true), lamp()]);
    let expected = 0.6 / std::f64::consts::PI * 10.0 * form_factor;
    agrees(seen(&diffuse, eye, at, 4096), expected, "diffuse ground");
    // A lamp that is turned away gives nothing.
    let away = vec![surfaces[0].clone(), square(half, height, false, 1)];
    let dark = scene(away, vec![material(lambert(0.6), 0.0, true), lamp()]);
    assert_eq!(seen(&dark, eye, at, 256), (0.0, 0.0), "the back of a lamp is dark");
}

/// Irradiance at the origin of the ground, which is surface 0, by each of so many draws; by what is known of emitters nearby, or by nothing.
fn draws(scene: &Scene, count: u32, seed: u32, is_known: bool) -> Vec<f64> {
    let rays = visibility(scene).expect("sound surfaces");
    let tracer = PathTracer::new(scene, &rays);
    let (eye, at) = (dvec3(0.9, 0.2, 0.4), DVec3::ZERO);
    let [origin, target] = [eye, at].map(|point| tracer.normalization.to_unit(point));
    let direction = (target - origin).normalize();
    let hit = rays.closest(origin, direction, START, f32::MAX).expect("the ground");
    let ground = Patch { surface: 0, domain: hr_diffuse::Domain::WHOLE, back: false };
    let nearby = is_known.then(|| Nearby::new(tracer.emitters(), &rays, &ground, seed));
    let draw = |index| f64::from(tracer.irradiance(&hit, direction, &Sampler::new(seed, index), nearby.as_ref()).x);
    (0..count).map(draw).collect()
}

#[test]
fn irradiance_has_no_noise_where_all_is_seen() {
    let materials = || vec![material(lambert(0.6), 0.0, true), material(Lambert::BLACK, 10.0, true)];
    let lit = scene(vec![square(1.0, 0.0, false, 0), square(0.4, 0.7, true, 1)], materials());
    let expected = 10.0 * parallel_square(0.4, 0.7);
    for found in draws(&lit, 64, 5, true) {
        assert!((found / expected - 1.0).abs() < 1e-4, "a square: {found}, expected {expected}");
    }
    let lamp = Surface::new(Shape::Sphere { center: dvec3(0.3, 0.0, 0.8), radius: 0.1 }, 1);
    let lit = scene(vec![square(1.0, 0.0, false, 0), lamp], materials());
    let d2: f64 = 0.3 * 0.3 + 0.8 * 0.8;
    let expected = 10.0 * 0.01 * 0.8 / (d2 * d2.sqrt());
    for found in draws(&lit, 64, 5, true) {
        assert!((found / expected - 1.0).abs() < 1e-4, "a sphere: {found}, expected {expected}");
    }
}

/// Whatever the few rays of a place say of how much of a lamp is seen from it.
#[test]
fn irradiance_is_right_in_half_shadow() {
    let materials = vec![
        material(lambert(0.6), 0.0, true),
        material(Lambert::BLACK, 10.0, true),
        material(Lambert::BLACK, 0.0, true),
    ];
    let surfaces = vec![square(1.0, 0.0, false, 0), square(0.4, 0.7, true, 1), square(0.1, 0.3, false, 2)];
    let shaded = scene(surfaces, materials);
    let expected = 10.0 * (parallel_square(0.4, 0.7) - parallel_square(0.1, 0.3));
    const COUNT: u32 = 16384;
    for seed in 0..4 {
        let found = draws(&shaded, COUNT, seed, seed > 0);
        let mean = found.iter().sum::<f64>() / f64::from(COUNT);
        let variance = found.iter().map(|found| (found - mean).powi(2)).sum::<f64>() / f64::from(COUNT);
        agrees((mean, (variance / f64::from(COUNT)).sqrt()), expected, "a screen before the middle of a lamp");
    }
}

/// Of a lamp that is much nearer than it is large the nearest points send almost everything.
#[test]
fn irradiance_has_little_noise_beside_a_large_lamp() {
    let materials = vec![
        material(lambert(0.6), 0.0, true),
        material(Lambert::BLACK, 10.0, true),
        material(Lambert::BLACK, 0.0, true),
    ];
    // A wall beside the ground's middle, half hidden by another one.
    let wall = |away: f64, from: f64, to: f64, material| {
        let p = |y: f64, z: f64| dvec3(-away, y, z);
        Surface::new(Shape::Quad([p(-1.0, from), p(1.0, from), p(1.0, to), p(-1.0, to)]), material)
    };
    let ground = square(1.0, 0.0, false, 0);
    let lit = scene(vec![ground, wall(0.04, 0.001, 1.0, 1), wall(0.02, 0.02, 1.0, 2)], materials);
    // What is known of all of the ground is wrong here.
    for (is_known, most) in [(false, 0.5), (true, 2.0)] {
        let found = draws(&lit, 1024, 3, is_known);
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        let deviation = (found.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / found.len() as f64).sqrt();
        assert!(deviation < most * mean, "known {is_known}: {mean} ± {deviation}");
    }
}

#[test]
fn both_ways_to_find_light_agree_for_gloss() {
    // The expected value by brute force over the lamp, with the reflector's own eval; it is what no sampling of the
    // BRDF enters.
    let (half, height) = (0.4, 0.7);
    let (eye, at) = (dvec3(-0.5, 0.1, 0.6), DVec3::ZERO);
    for alpha in [0.03, 0.1, 0.4] {
        let ward = Ward::new(Rgb::splat(0.2), Rgb::splat(0.5), alpha).expect("parameters");
        let (outgoing, steps) = (eye.normalize().as_vec3(), 800);
        let mut expected = 0.0;
        for i in 0..steps * steps {
            let place = |i: i32| half * (2.0 * (f64::from(i) + 0.5) / f64::from(steps) - 1.0);
            let to = dvec3(place(i % steps), place(i / steps), height);
            let d2 = to.length_squared();
            let incident = to / d2.sqrt();
            let area = (2.0 * half / f64::from(steps)).powi(2);
            let brdf = f64::from(ward.eval(incident.as_vec3(), outgoing).x);
            expected += brdf * incident.z * incident.z / d2 * area * 10.0 / std::f64::consts::PI;
        }
        let surfaces = vec![square(1.0, 0.0, false, 0), square(half, height, true, 1)];
        let glossy = scene(surfaces, vec![material(ward, 0.0, true), material(Lambert::BLACK, 10.0, true)]);
        agrees(seen(&glossy, eye, at, 16384), expected, &format!("alpha {alpha}"));
    }
}

#[test]
fn lights_without_extent_and_scale() {
    // In centimetres and far from the origin: irradiance is I cos/d² in the scene's own unit.
    let shift = dvec3(500.0, -300.0, 40.0);
    let ground = |sides| {
        let corners =
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| shift + 100.0 * dvec3(x, y, 0.0));
        scene(vec![Surface::new(Shape::Quad(corners), 0)], vec![material(lambert(0.5), 0.0, sides)])
    };
    let light = |kind| Light { position: shift + dvec3(30.0, 0.0, 40.0), intensity: Rgb::splat(2500.0), kind };
    let eye = shift + dvec3(-50.0, 20.0, 60.0);
    let (cosine, d2) = (0.8, 2500.0);
    let reflected = 0.5 / std::f64::consts::PI;
    let down = Vec3::new(-0.6, 0.0, -0.8);
    let spot = |aside: f32| LightKind::Spot {
        direction: (Mat3::from_rotation_y(aside) * down).normalize(),
        cos_inner: 0.9,
        cos_outer: 0.8,
    };
    // The ramp's middle in the cosine, 0.85: a quarter.
    let aside = 0.85_f32.acos();
    for (kind, expected, what) in [
        (LightKind::Point, 2500.0 * cosine / d2, "point"),
        (LightKind::Directional { direction: down }, 2500.0 * cosine, "directional"),
        (spot(0.0), 2500.0 * cosine / d2, "spot"),
        (spot(aside), 0.25 * 2500.0 * cosine / d2, "spot's border"),
        (spot(1.0), 0.0, "beside the spot"),
    ] {
        let mut lit = ground(true);
        lit.lights = vec![light(kind)];
        let (mean, _) = seen(&lit, eye, shift, 16);
        assert!((mean - reflected * expected).abs() <= 1e-4 * reflected * expected, "{what}: {mean}");
    }
    // From below: a two-sided sheet shades its other side, a one-sided back absorbs whatever comes.
    for (sides, expected) in [(true, reflected * 2500.0 * cosine), (false, 0.0)] {
        let mut lit = ground(sides);
        lit.lights = vec![light(LightKind::Directional { direction: Vec3::new(0.6, 0.0, 0.8) })];
        let below = shift - dvec3(-50.0, 20.0, 60.0);
        let (mean, _) = seen(&lit, below, shift, 16);
        assert!((mean - expected).abs() <= 1e-4 * expected, "two-sided {sides}: {mean}, expected {expected}");
    }
}

#[test]
fn mirrors_show_the_lamp_and_lose_their_share() {
    let mirror = Ward::new(Rgb::ZERO, Rgb::splat(0.9), 0.0).expect("a mirror");
    let surfaces = vec![square(1.0, 0.0, false, 0), square(0.4, 0.7, true, 1)];
    let shown = scene(surfaces, vec![material(mirror, 0.0, true), material(Lambert::BLACK, 10.0, true)]);
    agrees(seen(&shown, dvec3(0.3, 0.1, 0.6), DVec3::ZERO, 4096), 0.9 * 10.0 / std::f64::consts::PI, "mirror");
}

#[test]
fn energy_is_kept_between_two_spheres() {
    // The inside of a sphere, reflectance r, with an emitter of exitance e and area a in its middle (both black to what
    // comes back): the wall's irradiance is uniform, E = e a/A + r E (1 − a/A).
    let (small, large, r) = (0.3, 1.0, 0.8);
    let sphere = |radius, material, flip| Surface {
        flip,
        ..Surface::new(Shape::Sphere { center: dvec3(1.0, 2.0, 3.0), radius }, material)
    };
    let surfaces = vec![sphere(large, 0, true), sphere(small, 1, false)];
    let both = scene(surfaces, vec![material(lambert(0.8), 0.0, false), material(Lambert::BLACK, 5.0, false)]);
    let share = small * small / (large * large);
    let irradiance = 5.0 * share / (1.0 - r * (1.0 - share));
    let expected = r * irradiance / std::f64::consts::PI;
    let middle = dvec3(1.0, 2.0, 3.0);
    agrees(seen(&both, middle + dvec3(0.5, 0.1, 0.0), middle + dvec3(0.6, 0.9, 0.1), 16384), expected, "wall");
}

#[test]
fn the_same_seed_gives_the_same_image() {
    let scene = Scene::load("glossy-sphere").expect("built in");
    let camera = Camera { width: 20, height: 15, ..scene.cameras[0].1 };
    let rays = visibility(&scene).expect("sound");
    let tracer = PathTracer::new(&scene, &rays);
    let render = |threads: usize, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| tracer.render(&camera, 4, seed, &|_| ()))
    };
    let one = render(1, 5);
    assert_eq!(one, render(3, 5), "for any number of threads");
    assert_ne!(one.image, render(1, 6).image, "another seed is another image");
    let path = std::env::temp_dir().join(format!("hr-view-sigma-{}.pfm", std::process::id()));
    one.sigma.save(&path, &ToneMap::default(), Primaries::Radiance).expect("saved");
    std::fs::remove_file(&path).expect("it was written");
}

#[test]
fn emitters_are_seen_without_what_they_reflect() {
    let scene = Scene::load("furnace").expect("built in");
    let camera = Camera { width: 8, height: 6, ..scene.cameras[0].1 };
    let rays = visibility(&scene).expect("sound");
    let tracer = PathTracer::new(&scene, &rays);
    let expected = Rgb::new(1.0, 2.0, 3.0) * FRAC_1_PI;
    for p in tracer.emission(&camera).pixels {
        assert!((p - expected).abs().max_element() < 1e-5, "{p}, expected {expected}");
    }
}

/// Ground below a strong lamp that a plate hides and a weak one that is seen.
pub(super) fn hidden_lamp() -> Scene {
    let surfaces = vec![
        square(0.3, 0.0, false, 0),
        square(2.0, 0.8, false, 0),
        square(0.4, 1.0, true, 1),
        square(0.1, 0.6, true, 2),
    ];
    let lamp = |exitance| material(Lambert::BLACK, exitance, true);
    scene(surfaces, vec![material(lambert(0.6), 0.0, true), lamp(20.0), lamp(16.0)])
}

/// Knows which emitters light the ground, and nothing else.
struct Ground(Nearby);

impl Known for Ground {
    fn end(&self, ray: &Ray<'_>) -> Option<Rgb> {
        (ray.bounce > 0).then_some(Rgb::ZERO)
    }

    fn nearby(&self, hit: &Hit) -> Option<&Nearby> {
        (hit.surface == 0).then_some(&self.0)
    }

    fn glowing(&self, _: &Hit) -> Option<u32> {
        None
    }
}

#[test]
fn emitters_that_are_seen_are_drawn_and_the_mean_stays() {
    let scene = hidden_lamp();
    let rays = visibility(&scene).expect("sound");
    let tracer = PathTracer::new(&scene, &rays);
    let place = Patch { surface: 0, domain: hr_diffuse::Domain::WHOLE, back: false };
    let [knowing, not_knowing] = [Nearby::new(tracer.emitters(), &rays, &place, 1), Nearby::default()].map(Ground);
    let unit = |p: DVec3| tracer.normalization.to_unit(p);
    let (origin, target) = (unit(dvec3(1.0, 0.3, 0.5)), unit(DVec3::ZERO));
    let seen = |known: &Ground| {
        let paths = 32_768;
        let (mut sum, mut squares) = (0.0, 0.0);
        for index in 0..paths {
            let sampler = Sampler::new(5, index);
            let light = f64::from(tracer.seen(origin, (target - origin).normalize(), &sampler, known).1.x);
            (sum, squares) = (sum + light, squares + light * light);
        }
        let mean = sum / f64::from(paths);
        (mean, (squares / f64::from(paths) - mean * mean).sqrt() / f64::from(paths).sqrt())
    };
    let expected = 0.6 / std::f64::consts::PI * 16.0 * parallel_square(0.1, 0.6);
    let (known, plain) = (seen(&knowing), seen(&not_knowing));
    agrees(known, expected, "known");
    // The other one's draws go to the hidden lamp, but for those few.
    assert!(plain.1 > 3.0 * known.1, "noise {} of what is known, {} else", known.1, plain.1);
    assert!((plain.0 - expected).abs() < 4.0 * plain.1, "{} expected, {plain:?} without", expected);
}

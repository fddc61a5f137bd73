//! Scenes whose answer is known in closed form.

use glam::{DVec3, Vec3};
use hr_diffuse::{DiffuseMaterial, Light, LightKind, Rgb, SceneInput, Settings, Shape, Solution, Solver, Surface};
use std::f64::consts::PI;
use std::ops::ControlFlow;

fn solve(input: &SceneInput, error: f32) -> Solution {
    let mut solver = Solver::new(input, Settings::with_error(error), ()).expect("the scene is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.finish(&mut |_| ControlFlow::Continue(()))
}

/// The six faces of a cube, seen from inside.
fn cube(side: f64) -> Vec<Surface> {
    let mut surfaces = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let n = DVec3::AXES[axis] * -sign;
            let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
            let c = n * (-side / 2.0);
            let mut corners = [
                c - u * side / 2.0 - v * side / 2.0,
                c + u * side / 2.0 - v * side / 2.0,
                c + u * side / 2.0 + v * side / 2.0,
                c - u * side / 2.0 + v * side / 2.0,
            ];
            if sign > 0.0 {
                corners.reverse();
            }
            surfaces.push(Surface::new(Shape::Quad(corners), 0));
        }
    }
    surfaces
}

/// B = ed / (1 − ρ) everywhere in a closed room whose walls all emit and reflect alike.
#[test]
fn furnace_has_its_analytic_radiosity() {
    let material =
        DiffuseMaterial { reflectance: Rgb::new(0.2, 0.5, 0.8), exitance: Rgb::new(1.0, 2.0, 3.0), two_sided: true };
    let input = SceneInput { surfaces: cube(2.0), materials: vec![material], ..SceneInput::default() };
    let solution = solve(&input, 0.05);
    let exact = material.exitance / (Vec3::ONE - material.reflectance);
    let (mut sum, mut area) = (Vec3::ZERO, 0.0);
    for leaf in solution.elements.patch_leaves() {
        let element = &solution.elements.nodes[leaf as usize];
        if element.kind == hr_diffuse::hierarchy::Kind::Front {
            sum += solution.exitant.radiosity[leaf as usize] * element.area;
            area += element.area;
        }
    }
    let mean = sum / area;
    let error = ((mean - exact) / exact).abs().max_element();
    assert!(error < 0.01, "mean radiosity {mean} against {exact}");
}

/// A grey plate (material 0, the first surface) and black senders of exitance 1 (material 1).
fn lit_plate(plate: [DVec3; 4], senders: Vec<Shape>) -> SceneInput {
    let mut surfaces = vec![Surface::new(Shape::Quad(plate), 0)];
    surfaces.extend(senders.into_iter().map(|shape| Surface::new(shape, 1)));
    let plate = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ZERO, two_sided: false };
    let sender = DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::ONE, two_sided: false };
    SceneInput { surfaces, materials: vec![plate, sender], ..SceneInput::default() }
}

/// The unit square in z = 0 that looks up.
const FLOOR: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];

/// Mean irradiance on the front of the first surface.
fn plate_irradiance(input: &SceneInput, error: f32) -> f64 {
    let solution = solve(input, error);
    // Sides that no light reaches have no element.
    let node = solution.elements.surface_nodes[0][0];
    solution.exitant.irradiance.get(node as usize).map_or(0.0, |irradiance| f64::from(irradiance.x))
}

/// Nothing else sends, so the whole error asked for belongs to this one transfer.
#[track_caller]
fn assert_irradiance(input: &SceneInput, exact: f64, what: &str) {
    for error in [0.1, 0.02] {
        let found = plate_irradiance(input, error);
        let off = (found / exact - 1.0).abs();
        assert!(off < f64::from(error), "{what}: {found} instead of {exact}, {:.2} % off", 100.0 * off);
    }
}

/// Two unit squares face each other at distance 1 (E. Sparrow and R. Cess, Radiation Heat Transfer, 1978; the closed
/// form for a = b = c).
#[test]
fn parallel_plates_have_their_form_factor() {
    let r2 = 2.0_f64.sqrt();
    let exact = 2.0 / PI * ((4.0_f64 / 3.0).sqrt().ln() + 2.0 * r2 * (1.0 / r2).atan() - 2.0 * 1.0_f64.atan());
    assert!((exact - 0.199_825).abs() < 1e-6, "the tabulated value: {exact}");
    let above = FLOOR.map(|p| p + DVec3::Z);
    let lamp = Shape::Quad([above[0], above[3], above[2], above[1]]);
    assert_irradiance(&lit_plate(FLOOR, vec![lamp]), exact, "parallel");
}

/// Two unit squares at a right angle share an edge: F = 0.200044 (the same source, w = h = 1), where 1/r² has its pole.
#[test]
fn perpendicular_plates_have_their_form_factor() {
    let wall = Shape::Quad([DVec3::ZERO, DVec3::Y, DVec3::new(0.0, 1.0, 1.0), DVec3::Z]);
    assert_irradiance(&lit_plate(FLOOR, vec![wall]), 0.200_044, "perpendicular");
}

/// Solid angle of the unit square seen from height h above its middle: that of a right pyramid.
fn solid_angle(h: f64) -> f64 {
    4.0 * (1.0 / (4.0 * h * h + 1.0)).asin()
}

/// A sphere that does not cross the plate's plane acts through the plate's solid angle alone: F = Ω/4π from the sphere
/// (A. Feingold and K. Gupta, Journal of Heat Transfer 92, 1970), so E = B·4πr²·Ω/4π over area 1.
#[test]
fn a_sphere_has_its_form_factor() {
    let sphere = Shape::Sphere { center: DVec3::new(0.5, 0.5, 0.75), radius: 0.25 };
    assert_irradiance(&lit_plate(FLOOR, vec![sphere]), 0.0625 * solid_angle(0.75), "sphere");
}

/// A point light of 3 W/sr sends 3·Ω W onto the plate; distant light of 3 W/m² at 60° makes 1.5 W/m².
/// A lamp within a can, which lights what is below its plane: parts of the can lie on both sides of that. What does not leave by the
/// opening, a disk on the same axis, is on the can.
#[test]
fn a_can_has_the_light_of_the_lamp_in_it() {
    const LAMP: f64 = 2.0 / 3.0;
    const DEPTH: f64 = 2.2;
    let material = |reflectance, exitance| DiffuseMaterial {
        reflectance: Rgb::splat(reflectance),
        exitance: Rgb::splat(exitance),
        two_sided: true,
    };
    let z = DVec3::Z;
    let can = Shape::Cone { ends: [z * -DEPTH, z * (DEPTH / 2.0)], radii: [1.0, 1.0] };
    let lamp = Shape::Ring { center: DVec3::ZERO, normal: -z, inner: 0.0, outer: LAMP };
    let surfaces = vec![Surface::new(can, 0), Surface::new(lamp, 1)];
    let materials = vec![material(1e-3, 0.0), material(0.0, 1.0)];
    let solution = solve(&SceneInput { surfaces, materials, ..SceneInput::default() }, 0.05);
    let [inside] = solution.elements.surface_nodes[0][1..] else { panic!("two sides") };
    let node = inside as usize;
    let unit = solution.elements.nodes[solution.elements.surface_nodes[1][0] as usize].area;
    let share = f64::from(solution.exitant.irradiance[node].x * solution.elements.nodes[node].area / unit);
    let x = 1.0 + (1.0 + (1.0 / DEPTH).powi(2)) / (LAMP / DEPTH).powi(2);
    let exact = 1.0 - 0.5 * (x - (x * x - 4.0 / (LAMP * LAMP)).sqrt());
    assert!((share / exact - 1.0).abs() < 0.02, "{share} of its light instead of {exact}");
}

#[test]
fn lights_without_extent_make_their_irradiance() {
    let light = |kind| Light { position: DVec3::new(0.5, 0.5, 0.75), intensity: Rgb::splat(3.0), kind };
    let with = |light| SceneInput { lights: vec![light], ..lit_plate(FLOOR, vec![]) };
    assert_irradiance(&with(light(LightKind::Point)), 3.0 * solid_angle(0.75), "point");
    let direction = Vec3::new(0.75_f32.sqrt(), 0.0, -0.5);
    assert_irradiance(&with(light(LightKind::Directional { direction })), 1.5, "distant");
}

/// Half of a plate lies under a roof that reaches to its middle; distant light from straight above sees the other half.
#[test]
fn a_roof_over_half_the_plate_takes_half_the_light() {
    let roof = [(0.5, 0.0), (0.5, 1.0), (-1.0, 1.0), (-1.0, 0.0)].map(|(x, y)| DVec3::new(x, y, 0.25));
    let kind = LightKind::Directional { direction: -Vec3::Z };
    let light = Light { position: DVec3::ZERO, intensity: Rgb::ONE, kind };
    let mut input = lit_plate(FLOOR, vec![Shape::Quad(roof)]);
    input.materials[1].exitance = Rgb::ZERO;
    input.lights.push(light);
    assert_irradiance(&input, 0.5, "half");
}

/// Not a trace of light passes through a wall, at any height.
#[test]
fn nothing_passes_through_a_wall() {
    let sheet = |z: f64| FLOOR.map(|p| DVec3::new(5.0 * p.x - 2.0, 5.0 * p.y - 2.0, z));
    for z in [0.01, 0.5, 0.99] {
        let lamp = FLOOR.map(|p| p + DVec3::Z);
        let mut input = lit_plate(FLOOR, vec![Shape::Quad([lamp[0], lamp[3], lamp[2], lamp[1]])]);
        input.surfaces.push(Surface::new(Shape::Quad(sheet(z)), 2));
        input.materials.push(DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::ZERO, two_sided: true });
        assert_eq!(plate_irradiance(&input, 0.1), 0.0, "under a sheet at height {z}");
    }
}

/// A picture that hangs before a wall darkens only what is behind it: beside it the wall is as bright as bare.
#[test]
fn the_darkness_behind_a_picture_stays_there() {
    let lamp = FLOOR.map(|p| DVec3::new(4.0 * p.y - 1.5, 4.0 * p.x - 1.5, 2.0));
    let bare = lit_plate(FLOOR, vec![Shape::Quad(lamp)]);
    let mut hung = bare.clone();
    let picture = FLOOR.map(|p| DVec3::new(0.3 + 0.4 * p.x, 0.3 + 0.4 * p.y, 0.002));
    hung.surfaces.push(Surface::new(Shape::Quad(picture), 0));
    let (bare, hung) = (solve(&bare, 0.05), solve(&hung, 0.05));
    let at = |solution: &Solution, x: f32, y: f32| {
        let uv = glam::Vec2::new(x, y);
        let leaf = solution.elements.leaf_at(&solution.scene, 0, false, uv).expect("the wall is lit");
        solution.irradiance(leaf, uv).x
    };
    for i in 0..20 {
        for j in 0..20 {
            let [x, y] = [i, j].map(|k| (k as f32 + 0.5) / 20.0);
            let (without, with) = (at(&bare, x, y), at(&hung, x, y));
            let beside = (x - 0.5).abs().max((y - 0.5).abs()) > 0.2;
            if beside {
                assert!(
                    (with / without - 1.0).abs() < 0.1,
                    "at ({x}, {y}): {with} against {without} without a picture"
                );
            }
        }
    }
}

/// A room whose ceiling shines, with boxes in it.
fn room(boxes: &[(DVec3, DVec3)]) -> SceneInput {
    let mut surfaces = cube(2.0);
    surfaces[5].material = 1;
    for (i, &(center, size)) in boxes.iter().enumerate() {
        let turn = glam::DMat3::from_rotation_z(0.4 + i as f64);
        surfaces.extend(cube(1.0).into_iter().map(|surface| {
            let Shape::Quad(corners) = surface.shape else { panic!("a cube's faces") };
            let [a, b, c, d] = corners.map(|p| center + turn * (p * size));
            Surface::new(Shape::Quad([d, c, b, a]), 0)
        }));
    }
    let wall = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ZERO, two_sided: false };
    let lamp = DiffuseMaterial { exitance: Rgb::ONE, ..wall };
    SceneInput { surfaces, materials: vec![wall, lamp], ..SceneInput::default() }
}

/// Errors are relative to the light that there is, however little of it is reflected.
#[test]
fn a_dark_room_is_as_fine_as_a_bright_one() {
    let mut input = room(&[(DVec3::new(-0.4, 0.3, -0.6), DVec3::new(0.5, 0.4, 0.8))]);
    let bright = solve(&input, 0.1).stats.leaves;
    input.materials.iter_mut().for_each(|material| material.reflectance *= 0.05);
    let dark = solve(&input, 0.1).stats.leaves;
    assert!(2 * dark > bright, "{dark} leaves instead of {bright}");
}

#[test]
fn an_empty_room_needs_no_visibility_rays() {
    let solution = solve(&room(&[]), 0.05);
    assert!(solution.links.all().len() > 100, "there are links");
    assert!(solution.links.all().iter().all(|link| link.visibility < 0.0), "all are proved free");
    assert_eq!((solution.stats.rays, solution.stats.vertex_rays), (0, 0), "no rays");
}

#[test]
fn no_ray_contradicts_a_proof() {
    let boxes = [
        (DVec3::new(-0.4, 0.3, -0.6), DVec3::new(0.5, 0.4, 0.8)),
        (DVec3::new(0.5, -0.4, -0.2), DVec3::new(0.3, 0.5, 0.2)),
        (DVec3::new(0.2, 0.6, 0.1), DVec3::new(0.02, 0.5, 0.9)),
    ];
    let solution = solve(&room(&boxes), 0.025);
    let (surfaces, visibility) = (solution.scene.surfaces(), &solution.scene.visibility);
    let (mut proved, mut contradicted) = (0, 0);
    for link in solution.links.all().iter().filter(|link| link.visibility < 0.0) {
        let [r, s] = [link.receiver, link.sender].map(|node| &solution.elements.nodes[node as usize]);
        if !(r.is_patch() && s.is_patch()) {
            continue;
        }
        proved += 1;
        for i in 0..64 {
            let u = hr_diffuse::sampling::point4(link.receiver ^ link.sender.rotate_left(16), i);
            let from = surfaces[r.source as usize].sample_area(r.domain, u.x, u.y).0;
            let to = surfaces[s.source as usize].sample_area(s.domain, u.z, u.w).0;
            let facing = (to - from).dot(r.normals.axis) > 0.0 && (from - to).dot(s.normals.axis) > 0.0;
            contradicted += u32::from(facing && visibility.occluded(from, to, [r.source, s.source], &mut { u32::MAX }));
        }
    }
    let links = solution.links.all().len();
    assert!(2 * proved > links, "{proved} of {links} links are proved free");
    // Rays that graze an edge where surfaces meet count as blocked.
    assert!(10_000 * contradicted <= 64 * proved as u32, "{contradicted} segments are blocked that are proved free");
}

/// All light of a spot arrives at the walls of a room, however narrow its cone: 2π I times the mean of its ramp, t² over cosines,
/// which is what is within the inner cone and a third of the rest.
#[test]
fn spots_of_all_widths_arrive() {
    let wall = DiffuseMaterial { reflectance: Rgb::splat(1e-3), exitance: Rgb::ZERO, two_sided: false };
    let mut wrong = Vec::new();
    for degrees in [60.0_f64, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5] {
        let targets =
            [DVec3::new(0.3, -0.2, -2.0), DVec3::new(2.0, 0.4, -0.7), DVec3::splat(-2.0), DVec3::new(0.1, 0.4, 2.0)];
        for target in targets {
            let (inner, outer) = ((0.7 * degrees).to_radians().cos(), degrees.to_radians().cos());
            let position = DVec3::new(0.2, 0.3, 1.5);
            let direction = (target - position).normalize().as_vec3();
            let kind = LightKind::Spot { direction, cos_inner: inner as f32, cos_outer: outer as f32 };
            let lights = vec![Light { position, intensity: Rgb::ONE, kind }];
            let input = SceneInput { surfaces: cube(4.0), materials: vec![wall], lights, ..SceneInput::default() };
            let solution = solve(&input, 0.1);
            let power = |leaf: u32| {
                let element = &solution.elements.nodes[leaf as usize];
                f64::from(element.area * solution.exitant.irradiance[leaf as usize].x)
            };
            let unit = f64::from(solution.elements.nodes[0].area) / 96.0;
            let arrived: f64 = solution.elements.patch_leaves().map(power).sum::<f64>() / unit;
            let emitted = 2.0 * PI * ((1.0 - inner) + (inner - outer) / 3.0);
            if (arrived / emitted - 1.0).abs() > 0.01 {
                wrong.push(format!("{degrees}° toward {target}: {arrived} of {emitted}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

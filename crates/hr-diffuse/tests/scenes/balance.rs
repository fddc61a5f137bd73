//! What lamps emit is absorbed in the end: in closed rooms, where light that is bright beside a lamp is easily lost or made.

use glam::DVec3;
use hr_diffuse::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
use std::ops::ControlFlow;

const WALL: u32 = 0;
const LAMP: u32 = 1;
const WOOD: u32 = 2;

/// A box on the axes, seen from outside or from inside, with its surfaces' areas.
fn block(surfaces: &mut Vec<Surface>, areas: &mut Vec<f64>, (low, high): (DVec3, DVec3), material: u32, inside: bool) {
    let [x, y, z] = DVec3::AXES.map(|axis| axis * (high - low).dot(axis));
    let faces = [(low, y, x), (low + z, x, y), (low, x, z), (low + y, z, x), (low, z, y), (low + x, y, z)];
    for (corner, a, b) in faces {
        let (a, b) = if inside { (b, a) } else { (a, b) };
        surfaces.push(Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), material));
        areas.push(a.cross(b).length());
    }
}

/// What is absorbed over what is emitted in a room of boxes: the first one is the room, seen from inside. All that emits reflects, too,
/// so that its irradiance is known.
fn absorbed(boxes: &[(DVec3, DVec3, u32)], reflectances: [f32; 3], error: f32) -> f64 {
    let (mut surfaces, mut areas) = (Vec::new(), Vec::new());
    for (i, &(low, high, material)) in boxes.iter().enumerate() {
        block(&mut surfaces, &mut areas, (low, high), material, i == 0);
    }
    let material = |reflectance, exitance| DiffuseMaterial {
        reflectance: Rgb::splat(reflectance),
        exitance: Rgb::splat(exitance),
        two_sided: false,
    };
    let [wall, lamp, wood] = reflectances;
    let materials = vec![material(wall, 0.0), material(lamp, 100.0), material(wood, 0.0)];
    let input = SceneInput { surfaces, materials, ..SceneInput::default() };
    let mut solver = Solver::new(&input, Settings::with_error(error), ()).expect("the room is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    let (mut absorbed, mut emitted) = (0.0, 0.0);
    for (surface, area) in areas.iter().enumerate() {
        let material = &input.materials[input.surfaces[surface].material as usize];
        emitted += area * f64::from(material.exitance.x);
        // Sides that no light reaches have no elements.
        let node = solver.elements().surface_nodes[surface][0] as usize;
        let irradiance = solver.exitant().irradiance.get(node).map_or(0.0, |irradiance| irradiance.x);
        absorbed += area * f64::from((1.0 - material.reflectance.x) * irradiance);
    }
    absorbed / emitted
}

/// A flat lamp 5 cm below the ceiling hides the room from what it lights most.
#[test]
fn light_between_a_lamp_and_a_ceiling_is_kept() {
    let room = (DVec3::ZERO, DVec3::new(5.6, 4.0, 2.6), WALL);
    let lamp = (DVec3::new(1.8, 1.8, 2.5), DVec3::new(3.8, 2.2, 2.55), LAMP);
    let shelf = (DVec3::new(0.5, 3.5, 0.5), DVec3::new(5.1, 3.9, 1.8), WOOD);
    let absorbed = absorbed(&[room, lamp, shelf], [0.6, 0.5, 0.3], 0.05);
    assert!((absorbed - 1.0).abs() < 0.02, "{absorbed} of what is emitted");
}

/// In a white room light goes in and out of a cove many times before it is absorbed.
#[test]
fn light_of_a_cove_in_a_white_room_is_kept() {
    let room = (DVec3::ZERO, DVec3::new(5.0, 4.0, 2.8), WALL);
    let lamp = (DVec3::new(0.1, 0.1, 2.6), DVec3::new(4.9, 0.16, 2.66), LAMP);
    let shelf = (DVec3::new(0.01, 0.01, 2.45), DVec3::new(4.99, 0.5, 2.5), WALL);
    let lip = (DVec3::new(0.01, 0.46, 2.5), DVec3::new(4.99, 0.5, 2.7), WALL);
    let table = (DVec3::new(2.0, 2.0, 0.0), DVec3::new(3.0, 3.0, 1.0), WOOD);
    let absorbed = absorbed(&[room, lamp, shelf, lip, table], [0.95, 0.1, 0.5], 0.025);
    // A bounce that is off by half a percent, a fifth of the error asked for, is repeated some fifteen times.
    assert!((absorbed - 1.0).abs() < 0.08, "{absorbed} of what is emitted");
}

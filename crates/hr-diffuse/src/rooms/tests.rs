use super::{NO_ROOM, ROOMS, Rooms, are_apart};
use crate::{DiffuseMaterial, Light, LightKind, Rgb, SceneInput, Settings, Shape, Solver, Surface};
use glam::{DVec3, Vec3};

const GREY: u32 = 0;
const LAMP: u32 = 1;

fn quad(corner: DVec3, a: DVec3, b: DVec3, material: u32) -> Surface {
    Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), material)
}

/// The first so many sides of a cube, seen from inside; the last one is the lid. With a lamp in it.
fn cube(at: DVec3, side: f64, sides: usize) -> Vec<Surface> {
    let [x, y, z] = DVec3::AXES.map(|axis| axis * side);
    let walls = [(at, x, y), (at, y, z), (at + x, z, y), (at, z, x), (at + y, x, z), (at + z, y, x)];
    let mut surfaces: Vec<Surface> = walls.into_iter().take(sides).map(|(at, a, b)| quad(at, a, b, GREY)).collect();
    surfaces.push(quad(at + DVec3::splat(0.4 * side), y * 0.2, x * 0.2, LAMP));
    surfaces
}

fn solver(surfaces: Vec<Surface>, lights: Vec<Light>) -> Solver {
    let material = |reflectance, exitance| DiffuseMaterial { reflectance, exitance, two_sided: false };
    let materials = vec![material(Rgb::splat(0.5), Rgb::ZERO), material(Rgb::ZERO, Rgb::ONE)];
    let input = SceneInput { surfaces, materials, lights, ..SceneInput::default() };
    Solver::new(&input, Settings::default(), ()).expect("the scene is sound")
}

fn in_a_row(count: u32, sides: usize) -> Vec<Surface> {
    (0..count).flat_map(|i| cube(DVec3::X * 1.5 * f64::from(i), 1.0, sides)).collect()
}

#[test]
fn alike_rooms_count_by_the_root_of_their_number() {
    for count in [1, 2, 9] {
        let found = solver(in_a_row(count, 6), Vec::new()).elements.rooms;
        assert!((found.number - (count as f32).sqrt()).abs() < 1e-4, "{count} rooms: {found:?}");
        let size = (1.5 * (count - 1) as f32 + 1.0).recip();
        // Spots of walls do not reach all of the way.
        assert!((0.7 * size..=1.01 * size).contains(&found.size), "{count} rooms of size {size}: {found:?}");
    }
    assert_eq!(solver(in_a_row(1, 6), Vec::new()).elements.rooms, Rooms::ONE, "a single room");
}

#[test]
fn lanterns_hardly_count_in_a_hall() {
    let mut surfaces = cube(DVec3::ZERO, 10.0, 6);
    for i in 0..4 {
        surfaces.extend(cube(DVec3::new(1.0 + 2.0 * f64::from(i), 1.0, 5.0), 0.1, 6));
    }
    let found = solver(surfaces, Vec::new()).elements.rooms;
    // The hall and each lantern have areas of 100 to 0.01.
    assert!((found.number - 1.04).abs() < 0.01, "{found:?}");
    assert!(found.size > 0.7, "{found:?}");
}

#[test]
fn what_is_open_is_one() {
    let sun =
        Light { kind: LightKind::Directional { direction: -Vec3::Z }, intensity: Rgb::ONE, position: DVec3::ZERO };
    // Troughs without a lid and two walls.
    assert_eq!(solver(in_a_row(9, 3), vec![sun]).elements.rooms, Rooms::ONE, "troughs");
    // Two cubes side by side without the wall between them, or with a hole in it as large as a door.
    let mut joined = cube(DVec3::ZERO, 1.0, 6);
    joined.extend(cube(DVec3::X, 1.0, 6));
    joined.retain(|surface| {
        let Shape::Quad(corners) = surface.shape else { return true };
        !corners.iter().all(|corner| corner.x == 1.0)
    });
    assert_eq!(solver(joined.clone(), Vec::new()).elements.rooms, Rooms::ONE, "no wall between them");
    let (y, z) = (DVec3::Y, DVec3::Z);
    for facing in [false, true] {
        let mut wall = |at: DVec3, a: DVec3, b: DVec3| {
            joined.push(if facing { quad(at, a, b, GREY) } else { quad(at, b, a, GREY) });
        };
        let at = DVec3::X * if facing { 1.0 } else { 0.99 };
        wall(at, y * 0.7, z);
        wall(at + y * 0.7 + z * 0.7, y * 0.3, z * 0.3);
    }
    assert_eq!(solver(joined, Vec::new()).elements.rooms, Rooms::ONE, "a door");
}

/// One floor below several rooms: parts of it are in each of them, so that all links to it may matter.
#[test]
fn a_floor_below_several_rooms_is_in_none() {
    let mut surfaces = Vec::new();
    for i in 0..3 {
        surfaces.extend(cube(DVec3::X * 1.1 * f64::from(i), 1.0, 6).split_off(1));
    }
    surfaces.push(quad(DVec3::ZERO, DVec3::X * 3.2, DVec3::Y, GREY));
    let solver = solver(surfaces, Vec::new());
    assert!((solver.elements.rooms.number - 3.0_f32.sqrt()).abs() < 0.05, "{:?}", solver.elements.rooms);
    let room = |surface: usize| solver.elements.nodes[solver.elements.surface_nodes[surface][0] as usize];
    assert_eq!(room(18).room, NO_ROOM, "the floor");
    let apart = [6, 1, 18].map(|other| are_apart(&room(0), &room(other)));
    assert_eq!(apart, [true, false, false], "another room, the same, the floor");
    let clusters = solver.elements.nodes.iter().filter(|node| node.room == ROOMS);
    assert!(clusters.count() > 0, "there is a tree over the rooms");
}

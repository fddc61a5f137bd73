//! Generated scenes of any size. The same size gives the same scene; lengths are metres.

use glam::{DQuat, DVec2, DVec3, dvec2, dvec3};
use hr_diffuse::sampling::{hash, unit};
use hr_diffuse::{DiffuseMaterial, Rgb, SceneInput, Shape, Surface};
use std::fmt;

/// What is generated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// One furnished room whose walls and furniture are cut finer and finer: all sees all, and links are between
    /// clusters.
    Room,
    /// More and more closed rooms of a hundred polygons each: what is far away is never seen.
    City,
    /// Ever more and smaller objects, half of them boxes and half of them spheres, in a heap under a lamp: what is near
    /// hides what is far.
    Heap,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Room, Self::City, Self::Heap];
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Room => "room",
            Self::City => "city",
            Self::Heap => "heap",
        })
    }
}

const WALL: u32 = 0;
const FLOOR: u32 = 1;
const WOOD: u32 = 2;
const PAINT: u32 = 3;
const LAMP: u32 = 4;

/// Surfaces of one room of the city.
const PER_ROOM: u64 = 100;
/// Size of a room.
const ROOM: DVec3 = dvec3(6.0, 5.0, 2.8);

/// A scene of about so many surfaces.
#[must_use]
pub fn scene(kind: Kind, size: u64) -> SceneInput {
    let diffuse = |r, g, b| DiffuseMaterial { reflectance: Rgb::new(r, g, b), exitance: Rgb::ZERO, two_sided: false };
    let lamp = DiffuseMaterial { exitance: Rgb::new(1000.0, 900.0, 700.0), ..diffuse(0.0, 0.0, 0.0) };
    let materials =
        vec![diffuse(0.7, 0.7, 0.65), diffuse(0.4, 0.4, 0.4), diffuse(0.5, 0.3, 0.2), diffuse(0.2, 0.4, 0.6), lamp];
    let surfaces = match kind {
        Kind::Room => room(size),
        Kind::City => city(size),
        Kind::Heap => heap(size),
    };
    SceneInput { surfaces, materials, ..SceneInput::default() }
}

/// A parallelogram, cut into parts of about `cell`; its front is where `a` × `b` points.
fn rectangle(surfaces: &mut Vec<Surface>, corner: DVec3, [a, b]: [DVec3; 2], cell: f64, material: u32) {
    let counts = [a, b].map(|side| (side.length() / cell).round().max(1.0));
    let point = |i: f64, j: f64| corner + a * (i / counts[0]) + b * (j / counts[1]);
    for i in 0..counts[0] as u32 {
        for j in 0..counts[1] as u32 {
            let (i, j) = (f64::from(i), f64::from(j));
            let quad = [point(i, j), point(i + 1.0, j), point(i + 1.0, j + 1.0), point(i, j + 1.0)];
            surfaces.push(Surface::new(Shape::Quad(quad), material));
        }
    }
}

/// The sides of a box with these edges (right-handed); they face outside, or inside where `inside` is set.
fn sides(
    surfaces: &mut Vec<Surface>,
    corner: DVec3,
    [x, y, z]: [DVec3; 3],
    cell: f64,
    materials: [u32; 2],
    inside: bool,
) {
    let [around, below] = materials;
    let faces = [
        (corner, [y, x], below),
        (corner + z, [x, y], around),
        (corner, [x, z], around),
        (corner + y, [z, x], around),
        (corner, [z, y], around),
        (corner + x, [y, z], around),
    ];
    for (corner, [a, b], material) in faces {
        rectangle(surfaces, corner, if inside { [b, a] } else { [a, b] }, cell, material);
    }
}

/// A box on the axes.
fn block(surfaces: &mut Vec<Surface>, low: DVec3, size: DVec3, cell: f64, material: u32) {
    let edges = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    sides(surfaces, low, edges, cell, [material; 2], false);
}

/// A lamp that shines down.
fn lamp(surfaces: &mut Vec<Surface>, middle: DVec3, size: DVec2, cell: f64) {
    let corner = middle - 0.5 * size.extend(0.0);
    rectangle(surfaces, corner, [DVec3::Y * size.y, DVec3::X * size.x], cell, LAMP);
}

/// Walls, furniture and lamps, cut into cells of one size.
fn room(size: u64) -> Vec<Surface> {
    let fill = |cell: f64| {
        let mut surfaces = Vec::new();
        let edges = [DVec3::X * ROOM.x, DVec3::Y * ROOM.y, DVec3::Z * ROOM.z];
        sides(&mut surfaces, DVec3::ZERO, edges, cell, [WALL, FLOOR], true);
        for (i, place) in [dvec2(0.6, 0.6), dvec2(2.5, 3.5), dvec2(4.2, 1.0), dvec2(4.6, 3.4)].into_iter().enumerate() {
            let height = 0.4 + 0.4 * i as f64;
            // Clear of the floor, so that no surfaces coincide.
            block(&mut surfaces, place.extend(0.05), dvec3(0.9, 0.7, height), cell, WOOD + i as u32 % 2);
        }
        for x in [1.5, 4.5] {
            lamp(&mut surfaces, dvec3(x, 2.5, ROOM.z - 0.05), dvec2(0.8, 0.4), cell);
        }
        surfaces
    };
    // As many cells as their area allows; rounding to whole ones makes the number a little different.
    let area = 2.0 * (ROOM.x * ROOM.y + ROOM.y * ROOM.z + ROOM.z * ROOM.x) + 18.0;
    fill((area / size as f64).sqrt())
}

/// Closed rooms side by side, each with a lamp, fifteen boxes and three pictures.
fn city(size: u64) -> Vec<Surface> {
    let rooms = (size / PER_ROOM).max(1);
    let across = (rooms as f64).sqrt().ceil() as u64;
    let mut surfaces = Vec::new();
    for room in 0..rooms {
        let at = dvec3((room % across) as f64 * (ROOM.x + 1.0), (room / across) as f64 * (ROOM.y + 1.0), 0.0);
        let edges = [DVec3::X * ROOM.x, DVec3::Y * ROOM.y, DVec3::Z * ROOM.z];
        sides(&mut surfaces, at, edges, f64::INFINITY, [WALL, FLOOR], true);
        lamp(&mut surfaces, at + dvec3(3.0, 2.5, ROOM.z - 0.1), dvec2(1.2, 0.6), f64::INFINITY);
        // On a grid, of all sizes, some of them like table tops.
        for piece in 0..15_u32 {
            let random = |i: u32| f64::from(unit(hash(room as u32, 4 * piece + i)));
            let cell = dvec3(f64::from(piece % 5) * 1.15 + 0.2, f64::from(piece / 5) * 1.5 + 0.3, 0.0);
            let size = dvec3(0.3 + 0.6 * random(0), 0.3 + 0.8 * random(1), 0.3 + 1.2 * random(2));
            let above = if piece % 5 == 2 { 0.6 } else { 0.02 };
            block(&mut surfaces, at + cell + DVec3::Z * above, size, f64::INFINITY, WOOD + piece % 2);
        }
        // Three pictures, clear of the wall.
        for picture in 0..3 {
            let corner = at + dvec3(0.8 + 1.6 * f64::from(picture), 0.02, 1.2);
            rectangle(&mut surfaces, corner, [DVec3::Z * 0.6, DVec3::X * 0.9], f64::INFINITY, PAINT);
        }
    }
    surfaces
}

/// A pyramid of cells, an object in each, on a floor under a lamp.
fn heap(size: u64) -> Vec<Surface> {
    // Half boxes of 6 surfaces, half spheres of 1.
    let objects = (size as f64 / 3.5).ceil().max(1.0) as u64;
    let mut base = 1_u64;
    while base * (base + 1) * (2 * base + 1) / 6 < objects {
        base += 1;
    }
    let cell = 2.0 / base as f64;
    let mut surfaces = Vec::new();
    rectangle(&mut surfaces, dvec3(-3.0, -3.0, 0.0), [DVec3::X * 6.0, DVec3::Y * 6.0], f64::INFINITY, FLOOR);
    lamp(&mut surfaces, dvec3(0.5, 0.2, 3.5), dvec2(0.8, 0.8), f64::INFINITY);
    let mut object = 0_u32;
    for layer in 0..base {
        let side = base - layer;
        for place in 0..side * side {
            if u64::from(object) >= objects {
                return surfaces;
            }
            let random = |i: u32| f64::from(unit(hash(object, i)));
            let grid = dvec2((place % side) as f64, (place / side) as f64) + 0.5 - 0.5 * side as f64;
            let middle = (grid * cell).extend((layer as f64 + 0.55) * cell);
            if object.is_multiple_of(2) {
                let turned = DQuat::from_euler(glam::EulerRot::XYZ, 6.0 * random(0), 6.0 * random(1), 6.0 * random(2));
                // Its diagonal fits into the cell.
                let edges = DVec3::AXES.map(|axis| axis * cell * (0.2 + 0.3 * random(3)));
                let edges = [edges[0], edges[1] * 0.9, edges[2] * (0.4 + 0.6 * random(4))].map(|edge| turned * edge);
                let corner = middle - 0.5 * (edges[0] + edges[1] + edges[2]);
                sides(&mut surfaces, corner, edges, f64::INFINITY, [WOOD, WOOD], false);
            } else {
                let radius = cell * (0.2 + 0.28 * random(0));
                surfaces.push(Surface::new(Shape::Sphere { center: middle, radius }, PAINT));
            }
            object += 1;
        }
    }
    surfaces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::{Extent, solve};

    #[test]
    fn sizes_are_about_those_asked_for() {
        for kind in Kind::ALL {
            for size in [1_000, 30_000] {
                let made = scene(kind, size);
                let off = made.surfaces.len() as f64 / size as f64 - 1.0;
                assert!(off.abs() < 0.1, "{kind} of {size} has {} surfaces", made.surfaces.len());
                assert_eq!(made.surfaces, scene(kind, size).surfaces, "the same again");
            }
        }
    }

    #[test]
    fn fronts_are_where_the_light_is() {
        for kind in Kind::ALL {
            let (solution, _) = solve(&scene(kind, 300), 0.5, 1, Extent::FULL).expect("sound");
            let (mut lit, mut area) = (0.0, 0.0);
            for leaf in solution.elements.patch_leaves() {
                let element = &solution.elements.nodes[leaf as usize];
                if element.reflectance != Rgb::ZERO {
                    let irradiance = solution.exitant.irradiance[leaf as usize].max_element();
                    area += element.area;
                    lit += if irradiance > 0.0 { element.area } else { 0.0 };
                }
            }
            assert!(lit > 0.8 * area, "{kind}: {lit} of {area} is lit");
        }
    }

    #[test]
    fn boxes_are_closed() {
        for inside in [false, true] {
            let mut surfaces = Vec::new();
            let edges = [dvec3(1.0, 0.2, 0.0), dvec3(0.0, 2.0, 0.1), dvec3(0.3, 0.0, 3.0)];
            sides(&mut surfaces, DVec3::ONE, edges, 0.5, [0, 1], inside);
            // The divergence theorem: the flux of the position through a closed surface is three times its volume.
            let flux: f64 = surfaces
                .iter()
                .map(|surface| {
                    let Shape::Quad(q) = surface.shape else { panic!("all are quadrilaterals") };
                    (q[1] - q[0]).cross(q[3] - q[0]).dot(0.25 * (q[0] + q[1] + q[2] + q[3]))
                })
                .sum();
            let volume = edges[0].cross(edges[1]).dot(edges[2]) * if inside { -1.0 } else { 1.0 };
            assert!((flux / 3.0 - volume).abs() < 1e-9, "volume {volume}, inside {inside}: {}", flux / 3.0);
        }
    }
}

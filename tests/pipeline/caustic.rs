//! What a polished plate makes of a lamp's light: that of the lamp behind the mirror.

use glam::{DVec3, Vec3};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::form_factor::point_to_polygon;
use hr_diffuse::hierarchy::Kind;
use hr_diffuse::{Settings, Shape, Solver};
use hr_scene::Scene;
use std::f32::consts::PI;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Surfaces of the scene.
const PLATE: usize = 0;
const WALL: u32 = 1;
const LAMP: usize = 2;
/// What the plate reflects as a mirror, and diffusely.
const ALBEDO: f32 = 0.85;
const DIFFUSE: f32 = 0.05;
/// The wall below this sees the lamp itself, and the plate from close by.
const FROM: f64 = 0.3;
/// The plate's diffuse light is that of so many parts one way.
const PARTS: usize = 40;

/// Leaves of the plate are as large as what a place of the wall sees of the lamp in it: from beside their middles it is elsewhere.
#[test]
fn a_wall_is_lit_by_a_lamp_in_a_polished_plate() {
    let scene = Arc::new(Scene::load("area-light").expect("built in"));
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    let mut solver = Solver::new(&scene.input(), Settings::with_error(0.05), field).expect("the scene is sound");
    let going_on = &mut |_: &hr_diffuse::Progress| ControlFlow::Continue(());
    solver.solve(going_on);
    solver.reflect_flat_senders(going_on);
    let solution = solver.finish(going_on);

    let quad = |surface: usize| match scene.surfaces[surface].shape {
        Shape::Quad(corners) => corners,
        ref other => panic!("{other:?} is no square"),
    };
    let normalization = &solution.scene.normalization;
    let lamp = quad(LAMP).map(|corner| normalization.to_unit(corner));
    // The plate is the plane z = 0; mirrored, corners go around the other way.
    let mut mirrored = quad(LAMP).map(|corner| normalization.to_unit(corner * DVec3::new(1.0, 1.0, -1.0)));
    mirrored.reverse();
    let exitance = solution.scene.materials[scene.surfaces[LAMP].material as usize].exitance.x;
    let [corner, u, _, v] = quad(PLATE);
    let part = |i: usize| {
        let [s, t] = [i % PARTS, i / PARTS].map(|step| (step as f64 + 0.5) / PARTS as f64);
        let at = normalization.to_unit(corner + (u - corner) * s + (v - corner) * t);
        (at, DIFFUSE * exitance * point_to_polygon(at, Vec3::Z, &lamp))
    };
    let parts: Vec<(Vec3, f32)> = (0..PARTS * PARTS).map(part).collect();
    let area = ((u - corner).length() * normalization.scale() / PARTS as f64).powi(2) as f32;
    let expected = |at: Vec3| {
        let diffuse = parts.iter().map(|&(part, radiosity)| {
            let (away, distance) = (at - part).normalize_and_length();
            radiosity * away.y.max(0.0) * away.z.max(0.0) * area / (PI * distance * distance)
        });
        ALBEDO * exitance * point_to_polygon(at, -Vec3::Y, &mirrored) + diffuse.sum::<f32>()
    };
    // Of points with their weights and light: how far off on average, and together.
    let compare = |found: &[(Vec3, f32, f32)]| {
        let (mut off, mut sum, mut all) = (0.0, 0.0, 0.0);
        for &(at, weight, light) in found {
            let expected = expected(at);
            off += weight * (light - expected).abs();
            sum += weight * light;
            all += weight * expected;
        }
        assert!(all > 0.0, "nothing is compared");
        (off / all, sum / all - 1.0)
    };
    let nodes = &solution.elements.nodes;
    let is_on_wall = |leaf: usize, at: Vec3| {
        nodes[leaf].source == WALL && nodes[leaf].kind == Kind::Front && normalization.to_scene(at).z > FROM
    };
    let leaves: Vec<(Vec3, f32, f32)> = (0..nodes.len())
        .filter(|&leaf| nodes[leaf].child_count == 0 && is_on_wall(leaf, nodes[leaf].center))
        .map(|leaf| (nodes[leaf].center, nodes[leaf].area, solution.exitant.indirect[leaf].x))
        .collect();
    let vertices = &solution.vertices;
    let vertices: Vec<(Vec3, f32, f32)> = (0..vertices.positions.len())
        .filter(|&vertex| is_on_wall(vertices.leaf[vertex] as usize, vertices.positions[vertex]))
        .map(|vertex| (vertices.positions[vertex], 1.0, vertices.indirect[vertex].x))
        .collect();
    let [(leaves, bias), (vertices, _)] = [compare(&leaves), compare(&vertices)];
    eprintln!("leaves {leaves:.4} ({bias:+.4}), vertices {vertices:.4}");
    assert!(leaves < 0.13 && bias.abs() < 0.05, "leaves are off by {leaves} on average, together by {bias}");
    assert!(vertices < 0.11, "vertices are off by {vertices} on average");
}

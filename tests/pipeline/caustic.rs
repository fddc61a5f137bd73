//! What a polished plate makes of a lamp's light: that of the lamp behind the mirror.

use glam::{DVec3, Vec3};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::form_factor::point_to_polygon;
use hr_diffuse::{Settings, Shape, Solver};
use hr_scene::Scene;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Surfaces of the scene.
const WALL: u32 = 1;
const LAMP: usize = 2;
/// What the plate reflects.
const ALBEDO: f32 = 0.85;

/// Leaves of the plate are as large as what a point of the wall sees of the lamp in it: from beside their middles it is elsewhere.
#[test]
fn a_wall_is_lit_by_a_lamp_in_a_polished_plate() {
    let scene = Arc::new(Scene::load("area-light").expect("built in"));
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    let mut solver = Solver::new(&scene.input(), Settings::with_error(0.1), field).expect("the scene is sound");
    let going_on = &mut |_: &hr_diffuse::Progress| ControlFlow::Continue(());
    solver.solve(going_on);
    solver.reflect_flat_senders(going_on);
    let solution = solver.finish(going_on);
    let Shape::Quad(corners) = scene.surfaces[LAMP].shape else { panic!("the lamp is a square") };
    // The plate is the plane z = 0; mirrored, corners go around the other way.
    let normalization = &solution.scene.normalization;
    let mut mirrored = corners.map(|corner| normalization.to_unit(corner * DVec3::new(1.0, 1.0, -1.0)));
    mirrored.reverse();
    let exitance = solution.scene.materials[scene.surfaces[LAMP].material as usize].exitance.x;
    let (mut off, mut all) = (0.0, 0.0);
    for (vertex, &at) in solution.vertices.positions.iter().enumerate() {
        let place = normalization.to_scene(at);
        let is_on_wall = solution.elements.nodes[solution.vertices.leaf[vertex] as usize].source == WALL;
        if is_on_wall && place.x.abs() < 0.5 && (0.25..1.0).contains(&place.z) {
            let expected = ALBEDO * exitance * point_to_polygon(at, -Vec3::Y, &mirrored);
            off += (solution.vertices.indirect[vertex].x - expected).abs();
            all += expected;
        }
    }
    assert!(all > 0.0 && off < 0.2 * all, "off by {:.1} % on average", 100.0 * off / all);
}

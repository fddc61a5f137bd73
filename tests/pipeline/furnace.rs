//! A closed room whose walls all emit and reflect alike: its radiosity is known.

use crate::scenes::{mean_radiosity, solve};
use glam::Vec3;
use hr_diffuse::hierarchy::Kind;
use hr_scene::Scene;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// B = M / (1 − ρ): 1.25, 4, 15 W/m² for ρ = 0.2, 0.5, 0.8 and M = 1, 2, 3 W/m².
#[test]
fn the_built_in_furnace_has_its_analytic_radiosity() {
    let scene = Arc::new(Scene::load("furnace").expect("built in"));
    let exact = Vec3::new(1.25, 4.0, 15.0);
    let solution = solve(&scene.input(), 0.05, ());
    for (wall, radiosity) in mean_radiosity(&solution).into_iter().enumerate() {
        let error = ((radiosity - exact) / exact).abs().max_element();
        assert!(error < 0.01, "wall {wall} has radiosity {radiosity}, {:.2} % off {exact}", 100.0 * error);
    }
    let material = solution.scene.materials[0];
    let mut inside = 0;
    for (vertex, irradiance) in solution.vertices.irradiance.iter().enumerate() {
        // The outside is dark: it neither emits nor is lit.
        if solution.elements.nodes[solution.vertices.leaf[vertex] as usize].kind != Kind::Front {
            continue;
        }
        inside += 1;
        let radiance = (material.exitance + material.reflectance * *irradiance) * FRAC_1_PI;
        let error = ((radiance - exact * FRAC_1_PI) / (exact * FRAC_1_PI)).abs().max_element();
        // What was asked for, at every single vertex, corners and edges of the cube included.
        assert!(error < 0.05, "vertex {vertex} shows {radiance}, {:.2} % off", 100.0 * error);
    }
    assert!(inside > 24, "vertices inside: {inside}");
}

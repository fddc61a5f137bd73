//! `hr-diffuse` alone: diffuse light in a box, from nothing to radiosities.
//!
//! `cargo run --release --example embed`

use glam::DVec3;
use hr_diffuse::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, SolveError, Solver, Surface};
use std::ops::ControlFlow;

/// The six walls of a box of the given size (metres), seen from inside; the last one is the ceiling.
fn walls(size: DVec3) -> Vec<Surface> {
    let wall = |axis: usize, high: bool| {
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let (mut a, mut b) = (DVec3::AXES[a] * size[a], DVec3::AXES[b] * size[b]);
        let corner = if high { DVec3::AXES[axis] * size[axis] } else { DVec3::ZERO };
        if high {
            // Corners are counter-clockwise seen from the front, which is the inside.
            (a, b) = (b, a);
        }
        Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), 0)
    };
    (0..3).flat_map(|axis| [wall(axis, false), wall(axis, true)]).collect()
}

#[expect(clippy::print_stdout, reason = "an example shows what it found")]
fn main() -> Result<(), SolveError> {
    // Surfaces, what they are made of, and nothing else.
    let plaster = DiffuseMaterial { reflectance: Rgb::new(0.7, 0.65, 0.6), exitance: Rgb::ZERO, two_sided: false };
    let lamp = DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::splat(100.0), two_sided: false };
    let mut surfaces = walls(DVec3::new(4.0, 3.0, 2.5));
    surfaces.push(Surface::new(
        // Just below the ceiling, facing down; its back is the front that nobody sees.
        Shape::Ring { center: DVec3::new(2.0, 1.5, 2.45), normal: -DVec3::Z, inner: 0.0, outer: 0.3 },
        1,
    ));
    let input = SceneInput { surfaces, materials: vec![plaster, lamp], ..SceneInput::default() };

    // Solve to 5 %. The closures could show progress, or break to stop early.
    let mut solver = Solver::new(&input, Settings::with_error(0.05), ())?;
    solver.solve(&mut |_| ControlFlow::Continue(()));
    let solution = solver.finish(&mut |_| ControlFlow::Continue(()));

    // Mean light on each wall: the root element of the surface's front, averaged from all elements below.
    for (name, surface) in ["x = 0", "x = 4", "y = 0", "y = 3", "floor", "ceiling"].iter().zip(0..) {
        let [front, _back] = solution.elements.surface_nodes[surface];
        let irradiance = solution.exitant.irradiance[front as usize];
        println!("{name:8} irradiance {irradiance:6.3} W/m²");
    }
    // The finest elements, and smooth values at their corners.
    let stats = &solution.stats;
    println!("{} elements, {} links, {} vertices", stats.leaves, stats.links, solution.vertices.positions.len());
    for leaf in solution.elements.patch_leaves().take(3) {
        let element = &solution.elements.nodes[leaf as usize];
        let at = solution.scene.normalization.to_scene(element.center);
        println!("at {at:.2}: radiosity {:.3} W/m²", solution.exitant.radiosity[leaf as usize]);
    }
    Ok(())
}

//! What shading normals let in.

use super::fixtures::{paint, quad, solved};
use glam::{DVec3, Vec2, Vec3};
use hr_diffuse::{Rgb, SceneInput, Settings, Shape, Surface};
use std::f32::consts::TAU;
use std::ops::ControlFlow;

const RHO: f32 = 0.6;
/// Directions, and points along each side, of the brute force.
const DIRECTIONS: u32 = 4096;
const POINTS: u32 = 12;

/// Share of the light from everywhere that a surface of a solved scene lets in, direction by direction; and what its element says.
fn let_in(surface: Surface) -> [f32; 2] {
    let is_triangle = matches!(surface.shape, Shape::Triangle(_));
    let far = quad(DVec3::Z * 9.0, DVec3::Y, DVec3::X, 0);
    let input =
        SceneInput { surfaces: vec![surface, far], materials: vec![paint(Rgb::splat(RHO))], ..SceneInput::default() };
    let solution = solved(&input, Settings::with_error(0.5)).finish(&mut |_| ControlFlow::Continue(()));
    let ours = solution.elements.nodes[solution.elements.surface_nodes[0][0] as usize].reflectance.x / RHO;
    let (mut sum, mut count) = (0.0, 0);
    for i in 0..POINTS * POINTS {
        let uv = (Vec2::new((i % POINTS) as f32, (i / POINTS) as f32) + 0.5) / POINTS as f32;
        if is_triangle && uv.x + uv.y > 1.0 {
            continue;
        }
        let normal = solution.scene.shading_normal(0, uv);
        for k in 0..DIRECTIONS {
            // Evenly over the hemisphere above the surface.
            let (z, turn) = ((k as f32 + 0.5) / DIRECTIONS as f32, TAU * (k as f32 * 0.618_034).fract());
            let flat = (1.0 - z * z).sqrt();
            sum += 2.0 * normal.dot(Vec3::new(flat * turn.cos(), flat * turn.sin(), z)).max(0.0);
        }
        count += DIRECTIONS;
    }
    [ours, sum / count as f32]
}

/// A face of a box whose normals are those of the box's corners, and one whose normals lean to one side.
#[test]
fn leaning_normals_let_in_less() {
    let face = |normals: [Vec3; 4]| Surface {
        shading_normals: Some(normals.map(Vec3::normalize)),
        ..quad(DVec3::ZERO, DVec3::X, DVec3::Y, 0)
    };
    let outward = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 1.0));
    let [ours, right] = let_in(face(outward));
    assert!((ours / right - 1.0).abs() < 0.01 && right < 0.93, "a box's face lets in {ours}, not {right}");
    let [ours, right] = let_in(face([Vec3::new(1.0, 0.0, 1.0); 4]));
    assert!((ours / right - 1.0).abs() < 0.01 && right < 0.86, "a leaning one {ours}, not {right}");
    let [ours, right] = let_in(face([Vec3::Z; 4]));
    assert!((ours / right - 1.0).abs() < 0.001 && ours == 1.0, "an upright one {ours}, not {right}");
}

/// A facet of a round mesh lets in nearly all.
#[test]
fn facets_of_round_things_let_in_all() {
    let normals = [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(x, y)| Vec3::new(0.1 * x, 0.1 * y, 1.0).normalize());
    let shading_normals = Some([normals[0], normals[1], normals[2], normals[2]]);
    let facet = Shape::Triangle([DVec3::ZERO, DVec3::X, DVec3::Y]);
    let [ours, right] = let_in(Surface { shading_normals, ..Surface::new(facet, 0) });
    assert!((ours - right).abs() < 0.003 && ours > 0.995, "it lets in {ours}, not {right}");
}

//! Footprints: what is shown at a vertex stands for all around it.
//!
//! Values at vertices are drawn out over the leaves around. The narrow shadow of a picture's frame on a wall would become as wide as
//! the leaves where vertices happen to lie in it, and vanish where none does. So how much of a sender a vertex sees is asked from
//! points all over what it is drawn out to, the more densely the more the vertex counts there: weighted by its hat function, as
//! finite elements project a function that has more detail than they.

use crate::hooks::LightField;
use crate::sampling::{hash, point4};
use crate::transport::Light;
use crate::vertices::{Vertices, point_on};
use glam::{Vec2, Vec3};
use smallvec::SmallVec;

/// Points of a footprint.
const POINTS: u32 = 16;
/// What is drawn out from a vertex that is covered is seen where so many of them are not.
const OPEN: usize = POINTS as usize / 4;
/// So much of the way to the ends of its triangles a footprint reaches: all of it would blur what leaves can show.
const REACH: f32 = 0.6;

/// A point of a surface: where it is, its unit normal on the side that is lit, the surface.
pub(crate) type Spot = (Vec3, Vec3, u32);

/// Points around a vertex.
#[derive(Debug)]
pub(crate) struct Footprint {
    spots: SmallVec<[Spot; POINTS as usize]>,
    /// Rays shot.
    pub(crate) rays: u32,
}

impl Footprint {
    /// Whether a share of what the vertex is drawn out to that counts is open.
    pub(crate) fn is_open(&self) -> bool {
        self.spots.len() >= OPEN
    }

    /// One of the points, the first after the last again; `None` where there are none.
    pub(crate) fn spot(&self, index: u32) -> Option<Spot> {
        self.spots.get(index as usize % self.spots.len().max(1)).copied()
    }
}

/// A triangle of a leaf's fans that has the vertex.
struct Part {
    leaf: u32,
    /// The vertex, and the ways from there to the other corners, on the leaf's surface.
    at: Vec2,
    ways: [Vec2; 2],
    /// Area of this one and all before.
    until: f32,
}

/// Points around a vertex, but for those that something covers which is nearer than a share of their leaf's radius.
pub(crate) fn footprint<L: LightField>(
    light: Light<'_, L>,
    (vertices, vertex): (&Vertices, u32),
    (cover, seed): (f32, u32),
) -> Footprint {
    let parts = parts(vertices, vertex);
    let Some(all) = parts.last().map(|part| part.until) else {
        return Footprint { spots: SmallVec::new(), rays: 0 };
    };
    let mut blocker = u32::MAX;
    let spot = |i: u32| {
        let u = point4(hash(seed, 0xf007), i);
        let choice = (i as f32 + u.x) / POINTS as f32 * all;
        let part = &parts[parts.partition_point(|part| part.until <= choice).min(parts.len() - 1)];
        // The hat's value 1 − s times the width s: the integral 3 s² − 2 s³ of its density is inverted.
        let s = 0.5 - ((1.0 - 2.0 * u.y).asin() / 3.0).sin();
        let uv = part.at + REACH * s * part.ways[0].lerp(part.ways[1], u.z);
        let (x, n) = point_on(light.scene, light.elements, part.leaf, uv);
        let element = light.element(part.leaf);
        let end = x + n * (cover * element.radius);
        let is_covered = light.scene.visibility.occluded(x, end, [element.source, u32::MAX], &mut blocker);
        (!is_covered).then_some((x, n, element.source))
    };
    Footprint { spots: (0..POINTS).filter_map(spot).collect(), rays: POINTS }
}

/// The triangles around a vertex.
fn parts(vertices: &Vertices, vertex: u32) -> SmallVec<[Part; 16]> {
    let mut parts = SmallVec::new();
    let mut until = 0.0;
    for &leaf in vertices.leaves_around(vertex) {
        for mut corners in vertices.triangles(leaf) {
            let Some(first) = corners.iter().position(|corner| corner.vertex == vertex) else { continue };
            corners.rotate_left(first);
            let [at, a, b] = corners.map(|corner| vertices.positions[corner.vertex as usize]);
            let area = (a - at).cross(b - at).length();
            if area > 0.0 {
                until += area;
                let [at, a, b] = corners.map(|corner| corner.uv);
                parts.push(Part { leaf, at, ways: [a - at, b - at], until });
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vertices::outlines;
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;
    use std::f32::consts::SQRT_2;

    /// Points are spread by the hat function over what reaches so far, and none lies below what covers it.
    #[test]
    fn points_are_spread_over_what_a_vertex_is_drawn_out_to() {
        let quad = |o: DVec3, a: DVec3, b: DVec3| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), 0);
        let (x, y) = (DVec3::X, DVec3::Y);
        let plate = quad(DVec3::new(0.5, -1.0, 0.02), y * 3.0, x * 0.5);
        let square = || quad(DVec3::ZERO, x, y);
        for (surfaces, is_covered) in [(vec![square()], false), (vec![square(), plate.clone()], true)] {
            let material = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ONE, two_sided: true };
            let input = SceneInput { surfaces, materials: vec![material], ..SceneInput::default() };
            let mut solver = Solver::new(&input, Settings::with_error(0.5), ()).expect("the scene is sound");
            solver.elements.split(&solver.scene, solver.elements.surface_nodes[0][0]);
            let light = solver.light();
            let vertices = outlines(light.scene, light.elements).fans(light.scene, light.elements);
            let four_meet = |&vertex: &u32| vertices.leaves_around(vertex).len() == 4;
            let mut corners = (0..vertices.positions.len() as u32).filter(four_meet);
            let middle = corners.find(|&vertex| vertices.normals[vertex as usize].z > 0.5).expect("four parts meet");
            let at = vertices.positions[middle as usize];
            let side = light.element(vertices.leaf[middle as usize]).radius * SQRT_2;
            let (mut sum, mut count, mut beyond) = (0.0, 0_u32, 0_u32);
            for seed in 0..64 {
                let found = footprint(light, (&vertices, middle), (0.25, seed));
                assert_eq!(found.rays, POINTS, "one for each");
                for (x, n, _) in found.spots {
                    assert!(n.z > 0.999 && (x - at).z.abs() < 1e-6, "on the leaf: {x}");
                    assert!((x - at).abs().max_element() <= REACH * side, "within reach: {x}");
                    beyond += u32::from(x.x > at.x + 1e-6);
                    sum += (x - at).length() / side;
                    count += 1;
                }
            }
            let share = count as f32 / (64.0 * POINTS as f32);
            if is_covered {
                assert!(beyond == 0 && (share - 0.5).abs() < 0.1, "half is covered: {beyond}, {share}");
            } else {
                assert_eq!(share, 1.0, "nothing is covered");
            }
            // Half of the way on average to the edge between the corner and the middle of a leaf.
            let edge = (0..100).map(|i| (i as f32 + 0.5) / 200.0).map(|t| (1.0 - t).hypot(t));
            let (mean, expected) = (sum / count as f32, 0.5 * REACH * edge.sum::<f32>() / 100.0);
            assert!((mean - expected).abs() < 0.02, "{mean}, not {expected}");
        }
    }
}

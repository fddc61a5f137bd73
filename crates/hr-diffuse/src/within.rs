//! Vertices within [places](crate::places) of many leaves.
//!
//! What such a place knows of its light is a plane over all of it, however many leaves there are. A vertex whose leaves around all
//! belong to such places has nothing to find out: it has the mean of these leaves. Where two places meet their planes differ, by what
//! the error allows; so values are evened out, by the mean over neighbours in some rounds, between the vertices that gather for
//! themselves. Where light changes from a leaf to the next, as at the edge of a shadow along the border of two places, they do.

use crate::Rgb;
use crate::hooks::LightField;
use crate::places::Places;
use crate::threads;
use crate::transport::Light;
use crate::vertices::Vertices;

/// Leaves around a vertex whose irradiances differ by more than this share of the largest have an edge between them.
const EDGE: f32 = 0.25;
/// In places of fewer leaves vertices find out for themselves: too many of them lie at borders.
const LEAST_LEAVES: usize = 8;
/// Values of neighbouring places mix over about the square root of the number of rounds, in leaves, which places have a multiple of
/// from side to side.
const LEAVES_PER_ROUND: usize = 4;
const MOST_ROUNDS: usize = 32;

/// What lies within places.
#[derive(Debug, Default)]
pub(crate) struct Within {
    /// Leaves of places of many.
    leaves: Vec<u32>,
    rounds: usize,
    /// By vertex.
    holds: Vec<bool>,
}

impl Within {
    /// Where no places are known.
    pub(crate) fn none(vertices: &Vertices) -> Self {
        Self { holds: vec![false; vertices.positions.len()], ..Self::default() }
    }

    /// Finds the vertices within.
    pub(crate) fn new<L: LightField>(light: Light<'_, L>, places: &Places, vertices: &Vertices) -> Self {
        let (leaves, count) = places.leaves_of(LEAST_LEAVES);
        if leaves.is_empty() {
            return Self::none(vertices);
        }
        // Leaves on which others stand are cut: what they show ends at a line.
        let mut is_joined = vec![false; light.elements.nodes.len()];
        leaves.iter().for_each(|&leaf| is_joined[leaf as usize] = vertices.fans(leaf).count() == 1);
        let holds = |vertex: usize| {
            let around = vertices.leaves_around(vertex as u32);
            let irradiance = |&leaf: &u32| light.exitant.irradiance[leaf as usize].element_sum();
            let (low, high) =
                around.iter().map(irradiance).fold((f32::MAX, 0.0_f32), |(low, high), e| (low.min(e), high.max(e)));
            // No leaf has a vertex from which cuts have taken all parts.
            !around.is_empty() && around.iter().all(|&leaf| is_joined[leaf as usize]) && high - low <= EDGE * high
        };
        let rounds = (leaves.len() / count / LEAVES_PER_ROUND).clamp(1, MOST_ROUNDS);
        let holds = threads::map_range(0..vertices.positions.len(), 1024, holds);
        Self { leaves, rounds, holds }
    }

    /// Whether a vertex lies within.
    pub(crate) fn holds(&self, vertex: u32) -> bool {
        self.holds[vertex as usize]
    }

    /// How many do.
    pub(crate) fn count(&self) -> u64 {
        self.holds.iter().filter(|&&holds| holds).count() as u64
    }

    /// Gives the vertices within their values; the others have theirs.
    pub(crate) fn fill<L: LightField>(&self, light: Light<'_, L>, vertices: &mut Vertices) {
        if self.leaves.is_empty() {
            return;
        }
        let [mut irradiance, mut indirect] = [&mut vertices.irradiance, &mut vertices.indirect].map(std::mem::take);
        self.fill_with(light.exitant.irradiance.clone(), vertices, &mut irradiance);
        self.fill_with(light.exitant.indirect.clone(), vertices, &mut indirect);
        (vertices.irradiance, vertices.indirect) = (irradiance, indirect);
    }

    /// The same for one of the quantities that they have, by that of each leaf.
    fn fill_with(&self, mut of_leaf: Vec<Rgb>, vertices: &Vertices, values: &mut [Rgb]) {
        self.even_out(&of_leaf, vertices, values);
        for _ in 0..self.rounds {
            let mean = |&leaf: &u32| {
                let corners = vertices.fans(leaf).flat_map(|fan| &fan[1..]);
                let (mut sum, mut count) = (Rgb::ZERO, 0.0);
                corners.for_each(|corner| {
                    sum += values[corner.vertex as usize];
                    count += 1.0;
                });
                (leaf, sum / f32::max(count, 1.0))
            };
            let means: Vec<(u32, Rgb)> = threads::map(&self.leaves, 1024, mean);
            means.into_iter().for_each(|(leaf, mean)| of_leaf[leaf as usize] = mean);
            self.even_out(&of_leaf, vertices, values);
        }
    }

    /// Sets the vertices within to the mean of the leaves around.
    fn even_out(&self, of_leaf: &[Rgb], vertices: &Vertices, values: &mut [Rgb]) {
        threads::map_mut(values, 1024, |vertex, value| {
            if self.holds[vertex] {
                let around = vertices.leaves_around(vertex as u32);
                *value = around.iter().map(|&leaf| of_leaf[leaf as usize]).sum::<Rgb>() / around.len() as f32;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::Within;
    use crate::skips::Skips;
    use crate::skips::tests::solve;
    use crate::vertices::outlines;
    use crate::{DiffuseMaterial, Rgb, SceneInput, Shape, Solution, Surface};
    use glam::{DVec3, Vec3};
    use std::ops::ControlFlow;

    const ERROR: f32 = 0.05;
    /// Parts of a side of the floor.
    const PARTS: u32 = 60;
    /// Where the wall stands.
    const WALL: f64 = 0.7;

    /// A floor cut into small parts below a lamp; a wall stands across it on their edges.
    fn scene() -> SceneInput {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let quad = |corner: DVec3, a: DVec3, b: DVec3| Shape::Quad([corner, corner + a, corner + a + b, corner + b]);
        let part = f64::from(PARTS).recip();
        let cell = |i: u32| DVec3::new(f64::from(i % PARTS), f64::from(i / PARTS), 0.0) * part;
        let floor = (0..PARTS * PARTS).map(|i| Surface::new(quad(cell(i), x * part, y * part), 0));
        let lamp = Surface::new(quad(DVec3::new(0.2, 0.4, 0.6), y * 0.2, x * 0.2), 1);
        let wall = Surface::new(quad(x * WALL, y, z * 0.8), 2);
        let material = |reflectance: f32, exitance: f32, two_sided| DiffuseMaterial {
            reflectance: Rgb::splat(reflectance),
            exitance: Rgb::splat(exitance),
            two_sided,
        };
        SceneInput {
            surfaces: floor.chain([lamp, wall]).collect(),
            materials: vec![material(0.5, 0.0, false), material(0.0, 1.0, false), material(0.0, 0.0, true)],
            ..SceneInput::default()
        }
    }

    fn finished(inner_vertices: bool) -> Solution {
        let solver = solve(&scene(), ERROR, (), Skips { inner_vertices, ..Skips::ALL });
        solver.finish(&mut |_| ControlFlow::Continue(()))
    }

    /// Irradiance of the floor's vertices, where they are from the wall, and what all of the lamp would bring them (closed form).
    fn floor(solution: &Solution) -> Vec<(f32, f32, f32)> {
        let (light, vertices) = (solution.light(), &solution.vertices);
        let lamp = solution.elements.surface_nodes[(PARTS * PARTS) as usize][0];
        let of = |vertex: usize| {
            let surface = light.element(vertices.leaf[vertex]).source;
            let x = ((surface % PARTS) as f32 + vertices.uv[vertex].x) / PARTS as f32;
            let open = light.factor_at(vertices.positions[vertex], Vec3::Z, lamp);
            (surface < PARTS * PARTS).then_some((x - WALL as f32, vertices.irradiance[vertex].x, open))
        };
        (0..vertices.positions.len()).filter_map(of).collect()
    }

    #[test]
    fn vertices_within_places_need_no_look() {
        let [with, without] = [true, false].map(finished);
        let [some, none] = [&with, &without].map(|solution| solution.stats.skipped.inner_vertices as usize);
        let [with, without] = [&with, &without].map(|solution| (floor(solution), solution.stats.vertex_rays));
        assert!(4 * some > 3 * with.0.len() && none == 0, "{some} of {}, then {none}", with.0.len());
        assert!(3 * with.1 < without.1, "{} rays, then {}", with.1, without.1);
        let total: f32 = without.0.iter().map(|(_, light, _)| light).sum();
        let apart: f32 = with.0.iter().zip(&without.0).map(|(a, b)| (a.1 - b.1).abs()).sum();
        // What is asked of links is twice the error: as their errors cancel.
        assert!(apart < 0.6 * ERROR * total, "{:.4} of the light", apart / total);
    }

    #[test]
    fn light_is_even_within_places_and_ends_at_walls() {
        let part = (PARTS as f32).recip();
        let found = floor(&finished(true));
        let (mut off, mut all) = (0.0, 0.0);
        for &(x, light, open) in &found {
            if x > 0.1 * part {
                assert!(light < 0.02 * open, "{x} behind the wall: {light} of {open}");
            } else if x < -0.6 * part {
                assert!((light / open - 1.0).abs() < 6.0 * ERROR, "{x} before the wall: {light} of {open}");
                off += (light - open).abs();
                all += open;
            }
        }
        assert!(off < 0.6 * ERROR * all, "off by {:.4}", off / all);
    }

    /// Cuts may leave a vertex without any leaf.
    #[test]
    fn vertices_of_no_leaf_are_within_nothing() {
        let solver = solve(&scene(), ERROR, (), Skips::ALL);
        let mut vertices = outlines(&solver.scene, &solver.elements).fans(&solver.scene, &solver.elements);
        let left = vertices.add((Vec3::ZERO, Vec3::Z), 0, glam::Vec2::ZERO);
        vertices.first_around.push(vertices.around.len() as u32);
        let within = Within::new(solver.light(), solver.gather.places(), &vertices);
        assert!(within.count() > 0 && !within.holds(left), "it has no leaves around");
        within.fill(solver.light(), &mut vertices);
        assert_eq!(vertices.irradiance[left as usize], Rgb::ZERO, "it gathers no light of others");
    }
}

//! Sides of surfaces that no light can reach, such as the insides of closed objects.
//!
//! What a ray joins sees each other, so light passes either way. Rays from all sides of all surfaces join them to groups;
//! groups without any light stay dark whatever is computed, and need no elements.

use crate::Rgb;
use crate::geometry::Domain;
use crate::hierarchy::SceneData;
use crate::sampling::{hash, point4};
use crate::segments::light_segment;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Rays per side in successive rounds; only sides of groups that are still dark take part in the next one.
const ROUNDS: [u32; 4] = [4, 12, 48, 192];

/// Rays are confirmed by others that turn away from them by this (radians).
const BESIDE: f32 = 2e-3;

/// A side of a surface: twice the surface's index, plus 1 for the back.
pub(crate) type Side = u32;

/// For each surface, whether its front and its back may be lit. Where nothing is, everything counts as if it were: there
/// is no light in the scene. `idle` surfaces hide light, and do nothing else with it.
///
/// A side that sees lit ones in less than about a hundredth of its view may be missed.
pub(crate) fn lit_sides(scene: &SceneData, idle: &[bool]) -> Vec<[bool; 2]> {
    let count = scene.surfaces().len();
    let mut groups = Groups::new(2 * count);
    for surface in 0..count {
        groups.lit[2 * surface] = scene.materials[scene.surface_materials[surface] as usize].exitance != Rgb::ZERO;
    }
    let mut first = 0;
    for rays in ROUNDS {
        let dark: Vec<Side> =
            (0..2 * count as u32).filter(|&side| reflects(scene, idle, side) && !groups.is_lit(side)).collect();
        let seen: Vec<Seen> = dark.par_iter().map(|&side| look(scene, idle, side, first..first + rays)).collect();
        for (&side, seen) in dark.iter().zip(&seen) {
            for &other in &seen.sides {
                groups.join(side, other);
            }
            if seen.light {
                groups.light(side);
            }
        }
        first += rays;
    }
    let lit: Vec<[bool; 2]> = (0..count as u32).map(|s| [2 * s, 2 * s + 1].map(|side| groups.is_lit(side))).collect();
    if lit.iter().flatten().any(|lit| *lit) { lit } else { vec![[true; 2]; count] }
}

/// Whether a side does anything with light.
fn reflects(scene: &SceneData, idle: &[bool], side: Side) -> bool {
    let material = &scene.materials[scene.surface_materials[(side / 2) as usize] as usize];
    !idle[(side / 2) as usize] && (side.is_multiple_of(2) || material.two_sided)
}

/// What a side sees.
struct Seen {
    sides: Vec<Side>,
    /// A light without extent.
    light: bool,
}

fn look(scene: &SceneData, idle: &[bool], side: Side, rays: std::ops::Range<u32>) -> Seen {
    let surface = side / 2;
    let geometry = &scene.surfaces()[surface as usize];
    let mut seen = Seen { sides: Vec::new(), light: false };
    for i in rays {
        let u = point4(hash(side, 0x5ea1), i);
        let (x, normal, _) = geometry.sample_area(Domain::WHOLE, u.x, u.y);
        let n = if side.is_multiple_of(2) { normal } else { -normal };
        let (a, b) = n.any_orthonormal_pair();
        let direction = cosine_direction(n, u.z, u.w);
        // Between surfaces that nearly meet single rays slip through: what is seen must be seen a little beside, too.
        let met = [Vec3::ZERO, a * BESIDE, b * BESIDE].map(|beside| {
            let hit = scene.visibility.closest_except(x, direction + beside, 0.0, f32::MAX, surface);
            hit.map(|hit| 2 * hit.surface + u32::from(!hit.front))
        });
        if let [Some(other), Some(second), Some(third)] = met
            && other == second
            && other == third
            && reflects(scene, idle, other)
        {
            seen.sides.push(other);
        }
        seen.light |= sees_light(scene, surface, x, n, |_| true);
    }
    seen
}

/// A direction about a unit normal, drawn by its cosine.
pub(crate) fn cosine_direction(n: Vec3, u: f32, v: f32) -> Vec3 {
    let (a, b) = n.any_orthonormal_pair();
    let (sin, cos) = (TAU * u).sin_cos();
    (a * cos + b * sin) * v.sqrt() + n * (1.0 - v).sqrt()
}

/// Whether a point of a surface with normal `n` sees one of those lights without extent that are `wanted`.
pub(crate) fn sees_light(
    scene: &SceneData,
    surface: u32,
    x: Vec3,
    n: Vec3,
    wanted: impl Fn(&crate::Light) -> bool,
) -> bool {
    let mut blocker = u32::MAX;
    scene.lights.iter().enumerate().filter(|(_, light)| wanted(light)).any(|(light, _)| {
        let (to, cosine) = light_segment(scene, light, x, n);
        cosine > 0.0 && !scene.visibility.occluded(x, to, [surface, u32::MAX], &mut blocker)
    })
}

/// Disjoint sets of sides, by union with path halving; a set is lit if any of its members is.
pub(crate) struct Groups {
    parent: Vec<Side>,
    lit: Vec<bool>,
}

impl Groups {
    pub(crate) fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect(), lit: vec![false; count] }
    }

    pub(crate) fn root(&mut self, mut side: Side) -> usize {
        while self.parent[side as usize] != side {
            let above = self.parent[self.parent[side as usize] as usize];
            self.parent[side as usize] = above;
            side = above;
        }
        side as usize
    }

    pub(crate) fn is_lit(&mut self, side: Side) -> bool {
        let root = self.root(side);
        self.lit[root]
    }

    pub(crate) fn light(&mut self, side: Side) {
        let root = self.root(side);
        self.lit[root] = true;
    }

    pub(crate) fn join(&mut self, a: Side, b: Side) {
        let (a, b) = (self.root(a), self.root(b));
        self.lit[a] |= self.lit[b];
        self.parent[b] = a as u32;
    }
}

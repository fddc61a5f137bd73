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
type Side = u32;

/// For each surface, whether its front and its back may be lit. Where nothing is, everything counts as if it were: there
/// is no light in the scene.
///
/// A side that sees lit ones in less than about a hundredth of its view may be missed.
pub(crate) fn lit_sides(scene: &SceneData) -> Vec<[bool; 2]> {
    let count = scene.surfaces().len();
    let mut groups = Groups::new(2 * count);
    for surface in 0..count {
        groups.lit[2 * surface] = scene.materials[scene.surface_materials[surface] as usize].exitance != Rgb::ZERO;
    }
    let mut first = 0;
    for rays in ROUNDS {
        let dark: Vec<Side> =
            (0..2 * count as u32).filter(|&side| reflects(scene, side) && !groups.is_lit(side)).collect();
        let seen: Vec<Seen> = dark.par_iter().map(|&side| look(scene, side, first..first + rays)).collect();
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
fn reflects(scene: &SceneData, side: Side) -> bool {
    let material = &scene.materials[scene.surface_materials[(side / 2) as usize] as usize];
    side.is_multiple_of(2) || material.two_sided
}

/// What a side sees.
struct Seen {
    sides: Vec<Side>,
    /// A light without extent.
    light: bool,
}

fn look(scene: &SceneData, side: Side, rays: std::ops::Range<u32>) -> Seen {
    let surface = side / 2;
    let geometry = &scene.surfaces()[surface as usize];
    let mut seen = Seen { sides: Vec::new(), light: false };
    for i in rays {
        let u = point4(hash(side, 0x5ea1), i);
        let (x, normal, _) = geometry.sample_area(Domain::WHOLE, u.x, u.y);
        let n = if side.is_multiple_of(2) { normal } else { -normal };
        let (a, b) = n.any_orthonormal_pair();
        let (sin, cos) = (TAU * u.z).sin_cos();
        let direction = (a * cos + b * sin) * u.w.sqrt() + n * (1.0 - u.w).sqrt();
        // Between surfaces that nearly meet single rays slip through: what is seen must be seen a little beside, too.
        let met = [Vec3::ZERO, a * BESIDE, b * BESIDE].map(|beside| {
            let hit = scene.visibility.closest_except(x, direction + beside, 0.0, f32::MAX, surface);
            hit.map(|hit| 2 * hit.surface + u32::from(!hit.front))
        });
        if let [Some(other), Some(second), Some(third)] = met
            && other == second
            && other == third
            && reflects(scene, other)
        {
            seen.sides.push(other);
        }
        let mut blocker = u32::MAX;
        seen.light |= (0..scene.lights.len()).any(|light| {
            let (to, cosine): (Vec3, f32) = light_segment(scene, light, x, n);
            cosine > 0.0 && !scene.visibility.occluded(x, to, [surface, u32::MAX], &mut blocker)
        });
    }
    seen
}

/// Disjoint sets of sides, by union with path halving; a set is lit if any of its members is.
struct Groups {
    parent: Vec<Side>,
    lit: Vec<bool>,
}

impl Groups {
    fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect(), lit: vec![false; count] }
    }

    fn root(&mut self, mut side: Side) -> usize {
        while self.parent[side as usize] != side {
            let above = self.parent[self.parent[side as usize] as usize];
            self.parent[side as usize] = above;
            side = above;
        }
        side as usize
    }

    fn is_lit(&mut self, side: Side) -> bool {
        let root = self.root(side);
        self.lit[root]
    }

    fn light(&mut self, side: Side) {
        let root = self.root(side);
        self.lit[root] = true;
    }

    fn join(&mut self, a: Side, b: Side) {
        let (a, b) = (self.root(a), self.root(b));
        self.lit[a] |= self.lit[b];
        self.parent[b] = a as u32;
    }
}

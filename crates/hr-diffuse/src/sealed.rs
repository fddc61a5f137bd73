//! Sides of surfaces that no light can reach, such as the insides of closed objects and of boxes that stand on a floor.
//!
//! What a ray joins sees each other, so light passes either way. Rays join spots of surfaces to groups; groups without
//! any light stay dark whatever is computed. A large flat side has several spots, for it may be divided by what stands
//! on it: a floor is lit, but not where a box covers it. Two spots on it belong together if a line just above it, from
//! one to the other, is free.

use crate::Rgb;
use crate::geometry::Domain;
use crate::hierarchy::SceneData;
use crate::sampling::{hash, point2, point4};
use crate::segments::light_segment;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use smallvec::SmallVec;
use std::f32::consts::TAU;

/// Rays per spot in successive rounds; only spots of groups that are still dark take part in the next one.
const ROUNDS: [u32; 4] = [2, 6, 24, 96];

/// Rays that all emitters' spots share, at first.
const EMITTER_RAYS: u32 = 8192;

/// Rays are confirmed by others that turn away from them by this (radians).
const BESIDE: f32 = 2e-3;

/// Flat surfaces whose radius in unit space is larger have several spots, so many at first and at most.
const LARGE: f32 = 0.02;
const FIRST_SPOTS: u32 = 4;
const MOST_SPOTS: usize = 64;

/// How far above a surface lines between its spots run, in unit space.
const ABOVE: f32 = 1e-3;

/// A point is joined to so many of the spots around it.
const NEAREST: usize = 6;

/// A side of a surface: twice the surface's index, plus 1 for the back.
pub(crate) type Side = u32;

/// For each surface, whether its front and its back may be lit. Where nothing is, everything counts as if it were: there
/// is no light in the scene. `idle` surfaces hide light, and do nothing else with it.
///
/// A side that sees lit ones in less than about a hundredth of its view may be missed.
pub(crate) fn lit_sides(scene: &SceneData, idle: &[bool]) -> Vec<[bool; 2]> {
    let count = scene.surfaces().len();
    let mut spots = Spots::new(scene);
    // What emitters see is lit; few rays from elsewhere would find a small one.
    let emitters: Vec<u32> = (0..spots.all.len() as u32).filter(|&spot| spots.groups.is_lit(spot)).collect();
    let rays = (EMITTER_RAYS / emitters.len().max(1) as u32).clamp(16, 256);
    spots.explore(scene, idle, &emitters, 0..rays);
    let mut first = rays;
    for rays in ROUNDS {
        let dark: Vec<u32> = (0..spots.all.len() as u32)
            .filter(|&spot| reflects(scene, idle, spots.all[spot as usize].side) && !spots.groups.is_lit(spot))
            .collect();
        spots.explore(scene, idle, &dark, first..first + rays);
        first += rays;
    }
    let mut is_lit = |side: usize| spots.of_side[side].iter().any(|&spot| spots.groups.is_lit(spot));
    let lit: Vec<[bool; 2]> = (0..count).map(|surface| [2 * surface, 2 * surface + 1].map(&mut is_lit)).collect();
    if lit.iter().flatten().any(|lit| *lit) { lit } else { vec![[true; 2]; count] }
}

/// Whether a side does anything with light.
fn reflects(scene: &SceneData, idle: &[bool], side: Side) -> bool {
    let material = &scene.materials[scene.surface_materials[(side / 2) as usize] as usize];
    !idle[(side / 2) as usize] && (side.is_multiple_of(2) || material.two_sided)
}

/// A place on a side, which stands for what is around it.
struct Spot {
    side: Side,
    at: Vec3,
    normal: Vec3,
}

/// What a spot sees.
struct Seen {
    met: Vec<Spot>,
    /// A light without extent.
    light: bool,
}

fn look(scene: &SceneData, idle: &[bool], spot: &Spot, seed: u32, rays: std::ops::Range<u32>) -> Seen {
    let surface = spot.side / 2;
    let geometry = &scene.surfaces()[surface as usize];
    let mut seen = Seen { met: Vec::new(), light: false };
    let whole = !is_large(scene, surface);
    for i in rays {
        let u = point4(hash(seed, 0x5ea1), i);
        let (x, n) = if whole {
            let (x, normal, _) = geometry.sample_area(Domain::WHOLE, u.x, u.y);
            (x, if spot.side.is_multiple_of(2) { normal } else { -normal })
        } else {
            (spot.at, spot.normal)
        };
        let (a, b) = n.any_orthonormal_pair();
        let direction = cosine_direction(n, u.z, u.w);
        // Between surfaces that nearly meet single rays slip through: what is seen must be seen a little beside, too.
        let met = [Vec3::ZERO, a * BESIDE, b * BESIDE]
            .map(|beside| scene.visibility.closest_except(x, direction + beside, 0.0, f32::MAX, surface));
        let side = |hit: &crate::Hit| 2 * hit.surface + u32::from(!hit.front);
        if let [Some(hit), Some(second), Some(third)] = &met
            && side(hit) == side(second)
            && side(hit) == side(third)
            && reflects(scene, idle, side(hit))
        {
            let normal = if hit.front { hit.normal } else { -hit.normal };
            seen.met.push(Spot { side: side(hit), at: hit.point, normal });
        }
        seen.light |= sees_light(scene, surface, x, n, |_| true);
    }
    seen
}

/// Whether a surface has several spots.
fn is_large(scene: &SceneData, surface: u32) -> bool {
    let geometry = &scene.surfaces()[surface as usize];
    geometry.is_polygon() && geometry.bounds(Domain::WHOLE).radius() > LARGE
}

/// All spots, and to what groups rays have joined them.
struct Spots {
    all: Vec<Spot>,
    of_side: Vec<SmallVec<[u32; 4]>>,
    groups: Groups,
}

impl Spots {
    fn new(scene: &SceneData) -> Self {
        let count = scene.surfaces().len();
        let mut spots = Self { all: Vec::new(), of_side: vec![SmallVec::new(); 2 * count], groups: Groups::default() };
        for surface in 0..count as u32 {
            let geometry = &scene.surfaces()[surface as usize];
            let emits = scene.materials[scene.surface_materials[surface as usize] as usize].exitance != Rgb::ZERO;
            let places = if is_large(scene, surface) { FIRST_SPOTS } else { 1 };
            for side in [2 * surface, 2 * surface + 1] {
                for place in 0..places {
                    let u: Vec2 = point2(hash(side, 0x59), place);
                    let (at, normal, _) = geometry.sample_area(Domain::WHOLE, u.x, u.y);
                    let normal = if side.is_multiple_of(2) { normal } else { -normal };
                    let spot = spots.add(Spot { side, at, normal }, emits && side.is_multiple_of(2));
                    spots.connect(scene, spot);
                }
            }
        }
        spots
    }

    /// Joins spots to what rays from them meet.
    fn explore(&mut self, scene: &SceneData, idle: &[bool], spots: &[u32], rays: std::ops::Range<u32>) {
        let look = |&spot: &u32| look(scene, idle, &self.all[spot as usize], spot, rays.clone());
        let seen: Vec<Seen> = spots.par_iter().map(look).collect();
        for (&spot, seen) in spots.iter().zip(&seen) {
            for met in &seen.met {
                self.join(scene, spot, met);
            }
            if seen.light {
                self.groups.light(spot);
            }
        }
    }

    fn add(&mut self, spot: Spot, lit: bool) -> u32 {
        let id = self.groups.add(lit);
        self.of_side[spot.side as usize].push(id);
        self.all.push(spot);
        id
    }

    /// Joins a spot to what a ray from it met.
    fn join(&mut self, scene: &SceneData, spot: u32, met: &Spot) {
        let there = &self.of_side[met.side as usize];
        if !is_large(scene, met.side / 2) {
            let other = there[0];
            self.groups.join(spot, other);
            return;
        }
        let around = self.reached(scene, met);
        if around.is_empty() && there.len() < MOST_SPOTS {
            let other = self.add(Spot { side: met.side, at: met.at, normal: met.normal }, false);
            self.groups.join(spot, other);
        }
        for other in around {
            self.groups.join(spot, other);
        }
    }

    /// Joins a new spot to the others on its side.
    fn connect(&mut self, scene: &SceneData, spot: u32) {
        let Spot { side, at, normal } = self.all[spot as usize];
        for other in self.reached(scene, &Spot { side, at, normal }) {
            self.groups.join(spot, other);
        }
    }

    /// Of the spots nearest to a place on a large flat side those that a line just above it reaches.
    fn reached(&self, scene: &SceneData, place: &Spot) -> SmallVec<[u32; NEAREST]> {
        let mut there: SmallVec<[(f32, u32); 64]> = self.of_side[place.side as usize]
            .iter()
            .map(|&spot| (self.all[spot as usize].at.distance_squared(place.at), spot))
            .collect();
        there.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let lift = place.normal * ABOVE;
        let own = place.side / 2;
        let mut blocker = u32::MAX;
        let mut free = |&(_, spot): &(f32, u32)| {
            let to = self.all[spot as usize].at;
            !scene.visibility.occluded(place.at + lift, to + lift, [own, own], &mut blocker)
        };
        there.iter().take(NEAREST).filter(|near| free(near)).map(|&(_, spot)| spot).collect()
    }
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

/// Disjoint sets, by union with path halving; a set is lit if any of its members is.
#[derive(Default)]
pub(crate) struct Groups {
    parent: Vec<u32>,
    lit: Vec<bool>,
}

impl Groups {
    pub(crate) fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect(), lit: vec![false; count] }
    }

    fn add(&mut self, lit: bool) -> u32 {
        let id = self.parent.len() as u32;
        self.parent.push(id);
        self.lit.push(lit);
        id
    }

    pub(crate) fn root(&mut self, mut member: u32) -> usize {
        while self.parent[member as usize] != member {
            let above = self.parent[self.parent[member as usize] as usize];
            self.parent[member as usize] = above;
            member = above;
        }
        member as usize
    }

    pub(crate) fn is_lit(&mut self, member: u32) -> bool {
        let root = self.root(member);
        self.lit[root]
    }

    pub(crate) fn light(&mut self, member: u32) {
        let root = self.root(member);
        self.lit[root] = true;
    }

    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.lit[a] |= self.lit[b];
        self.parent[b] = a as u32;
    }
}

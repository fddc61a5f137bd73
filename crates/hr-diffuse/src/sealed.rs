//! Sides of surfaces that no light can reach, such as the insides of closed objects and of boxes that stand on a floor.
//!
//! What a ray joins sees each other, so light passes either way. Rays join spots of surfaces to groups; groups without
//! any light stay dark whatever is computed. A large flat side has several spots, for it may be divided by what stands
//! on it: a floor is lit, but not where a box covers it. Two spots on it belong together if a line just above it, from
//! one to the other, is free.
//!
//! Most sides are known to be lit after a ray or two. Of the others a group shares its rays, however many spots it has:
//! any one of them that finds light finds it for all. Sides that have the whole scene behind them need none.

use crate::geometry::{Aabb, Domain, Geometry};
use crate::hierarchy::SceneData;
use crate::rooms::{Rooms, rooms};
use crate::sampling::{cosine_direction, hash, point2, point4};
use crate::segments::{DISTANT, light_segment};
use crate::threads;
use crate::visibility::{NO_BLOCKER, Region};
use crate::{Light, Rgb};
use glam::{Vec2, Vec3};
use smallvec::SmallVec;
use std::ops::Range;

/// Rays that a group shares in successive rounds; only groups that are still dark take part in the next one, and
/// emitters.
pub(crate) const ROUNDS: [u32; 6] = [1, 2, 8, 32, 128, 384];
/// In rounds with so many rays every spot has one at least.
const ALL_SPOTS: u32 = 128;

/// Rays are confirmed by others that turn away from them by this (radians), or where this is less, so much that they
/// go beside by a share of the radius of what was met.
const BESIDE: f32 = 2e-3;
const BESIDE_SHARE: f32 = 0.1;
/// These meet it at no more than so many times the distance, unless it is seen edge-on.
const NEARLY: f32 = 1.1;

/// Flat surfaces whose radius in unit space is larger have several spots, so many at first and at most.
const LARGE: f32 = 0.02;
const FIRST_SPOTS: u32 = 4;
const MOST_SPOTS: usize = 64;

/// How far above a surface lines between its spots run, in unit space.
const ABOVE: f32 = 1e-3;

/// What rises no more than this above a surface's plane sends it no light worth mentioning.
const FLUSH: f32 = 1e-5;

/// A point is joined to so many of the spots around it.
const NEAREST: usize = 6;

/// So many rays of a dark group tell whether it is an interior, of which no more than this share leaves the scene, …
const FIRST_WINDOW_RAYS: usize = 64;
pub(crate) const MOST_LEAVING: f32 = 0.25;
/// … and so many whether it has a window, if it is so large (radius in unit space); fewer, by area, of smaller ones.
const MOST_WINDOW_RAYS: usize = 16_384;
const LARGEST: f32 = 0.25;

/// No spot.
const NONE: u32 = u32::MAX;

/// A side of a surface: twice the surface's index, plus 1 for the back.
pub(crate) type Side = u32;

pub(crate) fn is_back(side: Side) -> bool {
    !side.is_multiple_of(2)
}

/// For each surface, whether its front and its back may be lit; and what [rooms](crate::rooms) there are, and which its front and
/// its back are in. Where nothing is lit, everything counts as if it were: there is no light in the scene. `idle` surfaces hide
/// light, and do nothing else with it.
///
/// A side that sees lit ones in less than about a hundredth of its view, or of that of the group that it belongs to, may
/// be missed, but not in a large interior that light may come into from outside.
pub(crate) fn lit_sides(scene: &SceneData, idle: &[bool]) -> (Vec<[bool; 2]>, Rooms, Vec<[u32; 2]>) {
    let mut spots = Spots::new(scene, idle);
    // What emitters see is lit; few rays from elsewhere would find a small one.
    let emitters: Vec<u32> = (0..spots.all.len() as u32).filter(|&spot| spots.groups.is_lit(spot)).collect();
    let mut first = 0;
    for rays in ROUNDS {
        spots.groups.flatten();
        let dark = (0..spots.all.len() as u32).filter(|&spot| !spots.groups.is_known_lit(spot));
        let looking: Vec<u32> = dark.chain(emitters.iter().copied()).collect();
        if looking.len() == emitters.len() {
            break;
        }
        spots.explore(&looking, first, rays);
        first += rays;
    }
    let windows = spots.windows();
    let mut lit = vec![[false; 2]; scene.surfaces().len()];
    for spot in 0..spots.all.len() as u32 {
        let side = spots.all[spot as usize].side;
        let may_be_lit = spots.groups.is_lit(spot) || windows[spots.groups.root(spot)];
        lit[(side / 2) as usize][(side % 2) as usize] |= may_be_lit;
    }
    if !lit.iter().flatten().any(|lit| *lit) {
        lit.fill([true; 2]);
    }
    let (rooms, of_sides) = rooms(&mut spots, first);
    (lit, rooms, of_sides)
}

/// Whether a side does anything with light that falls on it.
fn reflects(scene: &SceneData, idle: &[bool], side: Side) -> bool {
    let material = &scene.materials[scene.surface_materials[(side / 2) as usize] as usize];
    !idle[(side / 2) as usize] && (!is_back(side) || material.two_sided)
}

/// Whether a side has the whole scene behind it, with all lights.
fn faces_nothing(scene: &SceneData, side: Side) -> bool {
    let geometry = &scene.surfaces()[(side / 2) as usize];
    if !geometry.is_polygon() {
        return false;
    }
    let (x, normal) = (geometry.point(Vec2::ZERO), outward(geometry, side));
    let above = x.dot(normal) + FLUSH;
    let bounds = Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
    let region = Region { bounds, normal, heights: [above, f32::INFINITY] };
    let unlit = (0..scene.lights.len()).all(|light| light_segment(scene, light, x, normal).1 <= 0.0);
    unlit && !scene.visibility.any_in(&region, |_| true)
}

/// The unit normal of a flat surface on one of its sides.
pub(crate) fn outward(geometry: &Geometry, side: Side) -> Vec3 {
    let normal = geometry.normal(Vec2::ZERO);
    if is_back(side) { -normal } else { normal }
}

/// A place on a large side, which stands for what is around it; or a whole side.
pub(crate) struct Spot {
    pub(crate) side: Side,
    /// On large sides.
    at: Vec3,
    /// The next one on the same side.
    next: u32,
}

/// What a ray from a spot met.
enum Met {
    /// Another spot, or what a line from there reaches.
    Spot(u32),
    /// A place on a large side that no spot there is known to belong to.
    Place(Side, Vec3),
}

/// A few spots.
type Spotted = SmallVec<[u32; NEAREST]>;

/// What a spot sees that is not of its group.
#[derive(Default)]
struct Seen {
    met: SmallVec<[Met; 1]>,
    /// A light without extent.
    light: bool,
}

/// All spots, and to what groups rays have joined them.
pub(crate) struct Spots<'a> {
    pub(crate) scene: &'a SceneData,
    pub(crate) all: Vec<Spot>,
    /// The spot of each side that was added last; [`NONE`] on sides that do nothing with light or that none can reach.
    of_side: Vec<u32>,
    /// Surfaces whose sides have several spots.
    large: Vec<bool>,
    pub(crate) groups: Groups,
}

impl<'a> Spots<'a> {
    fn new(scene: &'a SceneData, idle: &[bool]) -> Self {
        let count = scene.surfaces().len();
        let is_large = |geometry: &Geometry| geometry.is_polygon() && geometry.bounds(Domain::WHOLE).radius() > LARGE;
        let mut spots = Self {
            scene,
            all: Vec::with_capacity(count),
            of_side: vec![NONE; 2 * count],
            large: scene.surfaces().iter().map(is_large).collect(),
            groups: Groups::default(),
        };
        let emits = |side: Side| {
            let material = scene.surface_materials[(side / 2) as usize];
            !is_back(side) && scene.materials[material as usize].exitance != Rgb::ZERO
        };
        let takes_part = |side: Side| reflects(scene, idle, side) && (emits(side) || !faces_nothing(scene, side));
        let take_part = threads::map_range(0..2 * count, 64, |side| takes_part(side as Side));
        let sides =
            take_part.into_iter().zip(0..).filter_map(|(takes_part, side): (bool, Side)| takes_part.then_some(side));
        for side in sides {
            if !spots.large[(side / 2) as usize] {
                spots.add(side, Vec3::ZERO, emits(side));
                continue;
            }
            for place in 0..FIRST_SPOTS {
                let u: Vec2 = point2(hash(side, 0x59), place);
                let (at, _) = scene.surfaces()[(side / 2) as usize].sample(Domain::WHOLE, u.x, u.y);
                let spot = spots.add(side, at, emits(side));
                spots.join_around(spot, side, at);
            }
        }
        spots
    }

    fn add(&mut self, side: Side, at: Vec3, lit: bool) -> u32 {
        let id = self.groups.add(lit);
        self.all.push(Spot { side, at, next: self.of_side[side as usize] });
        self.of_side[side as usize] = id;
        id
    }

    /// Where a spot of a large side is.
    pub(crate) fn place(&self, spot: u32) -> Option<Vec3> {
        let Spot { side, at, .. } = self.all[spot as usize];
        self.large[(side / 2) as usize].then_some(at)
    }

    /// Joins spots to what rays from them meet; those of a group share `rays`, of which `first` were shot before.
    pub(crate) fn explore(&mut self, looking: &[u32], first: u32, rays: u32) {
        let mut sharing = vec![0_u32; self.all.len()];
        for &spot in looking {
            sharing[self.groups.known_root(spot)] += 1;
        }
        let mut passed = vec![0_u32; self.all.len()];
        let takes_turn = |&spot: &u32| {
            let root = self.groups.known_root(spot);
            passed[root] += 1;
            rays >= ALL_SPOTS || passed[root].is_multiple_of(sharing[root].div_ceil(rays))
        };
        let looking: Vec<u32> = looking.iter().copied().filter(takes_turn).collect();
        let look = |&spot: &u32| {
            let share = rays / sharing[self.groups.known_root(spot)];
            self.look(spot, first..first + share.max(1))
        };
        let seen = threads::map(&looking, 16, look);
        for (&spot, seen) in looking.iter().zip(&seen) {
            for met in &seen.met {
                match *met {
                    Met::Spot(other) => self.groups.join(spot, other),
                    Met::Place(side, at) => {
                        if !self.join_around(spot, side, at) && self.on_side(side).count() < MOST_SPOTS {
                            let other = self.add(side, at, false);
                            self.groups.join(spot, other);
                        }
                    }
                }
            }
            if seen.light {
                self.groups.light(spot);
            }
        }
    }

    /// What rays from a spot meet, until it is known to be lit.
    fn look(&self, spot: u32, rays: Range<u32>) -> Seen {
        let Spot { side, at, .. } = self.all[spot as usize];
        let (scene, surface) = (self.scene, side / 2);
        let geometry = &scene.surfaces()[surface as usize];
        let searching = !self.groups.is_known_lit(spot);
        let mut seen = Seen::default();
        for i in rays {
            let u = point4(hash(spot, 0x5ea1), i);
            let (x, n) = if self.large[surface as usize] {
                (at, outward(geometry, side))
            } else {
                let (x, normal) = geometry.sample(Domain::WHOLE, u.x, u.y);
                (x, if is_back(side) { -normal } else { normal })
            };
            let direction = cosine_direction(n, u.z, u.w);
            seen.light |=
                searching && (sees_light(scene, surface, x, n, |_| true) || self.meets_light(surface, x, n, direction));
            let mut lit = seen.light;
            if let Some(met) = self.meet(spot, x, n, direction) {
                lit |= matches!(met, Met::Spot(other) if self.groups.is_known_lit(other));
                seen.met.push(met);
            }
            if searching && lit {
                break;
            }
        }
        seen
    }

    /// By root, whether its group is a large interior that is dark, but that a ray leaves, as by a window: light that comes in there
    /// may fall where no ray from within goes.
    fn windows(&mut self) -> Vec<bool> {
        self.groups.flatten();
        let mut dark = vec![Vec::new(); self.all.len()];
        for spot in (0..self.all.len() as u32).filter(|&spot| !self.groups.is_known_lit(spot)) {
            if self.place(spot).is_some() {
                dark[self.groups.known_root(spot)].push(spot);
            }
        }
        threads::map(&dark, 1, |spots| !spots.is_empty() && self.has_window(spots))
    }

    /// Whether some ray from spots of large sides leaves the scene, but most do not.
    fn has_window(&self, spots: &[u32]) -> bool {
        let bounds = Aabb::of_points(spots.iter().filter_map(|&spot| self.place(spot)));
        let size = (bounds.radius() / LARGEST).min(1.0);
        let rays = ((MOST_WINDOW_RAYS as f32 * size * size) as usize).max(FIRST_WINDOW_RAYS);
        let mut blocker = NO_BLOCKER;
        let mut leaves = |ray: &usize| {
            let spot = spots[ray % spots.len()];
            let Spot { side, at, .. } = self.all[spot as usize];
            let own = side / 2;
            let n = outward(&self.scene.surfaces()[own as usize], side);
            let u = point4(hash(spot, 0x0be2), *ray as u32);
            let direction = cosine_direction(n, u.z, u.w);
            // Nearly all meet something, and what it is does not matter.
            if self.scene.visibility.occluded(at, at + direction * DISTANT, [own, own], &mut blocker) {
                return false;
            }
            let (a, b) = n.any_orthonormal_pair();
            // Rays that slip through between surfaces that nearly meet have none beside them.
            [Vec3::ZERO, a * BESIDE, b * BESIDE]
                .into_iter()
                .all(|aside| self.scene.visibility.first_side(at, direction + aside, f32::MAX, own).is_none())
        };
        let first = (0..FIRST_WINDOW_RAYS).filter(&mut leaves).count();
        let is_interior = first as f32 <= MOST_LEAVING * FIRST_WINDOW_RAYS as f32;
        is_interior && (first > 0 || (FIRST_WINDOW_RAYS..rays).any(|ray| leaves(&ray)))
    }

    /// What a ray from a spot meets that is not known to be of its group.
    fn meet(&self, spot: u32, x: Vec3, n: Vec3, direction: Vec3) -> Option<Met> {
        let visibility = &self.scene.visibility;
        let own = self.all[spot as usize].side / 2;
        let (side, t) = visibility.first_side(x, direction, f32::MAX, own)?;
        let met = self.around(spot, side, x + direction * t)?;
        self.is_confirmed(own, x, n, direction, (side, t)).then_some(met)
    }

    /// Whether a ray from a surface meets a place on a large flat side that sees a light without extent: the sun that comes
    /// in by a window may light none of the side's spots.
    fn meets_light(&self, own: u32, x: Vec3, n: Vec3, direction: Vec3) -> bool {
        let scene = self.scene;
        if scene.lights.is_empty() {
            return false;
        }
        let Some((side, t)) = scene.visibility.first_side(x, direction, f32::MAX, own) else { return false };
        let surface = side / 2;
        self.large[surface as usize]
            && self.of_side[side as usize] != NONE
            && {
                let normal = outward(&scene.surfaces()[surface as usize], side);
                sees_light(scene, surface, x + direction * t, normal, |_| true)
            }
            && self.is_confirmed(own, x, n, direction, (side, t))
    }

    /// Between surfaces that nearly meet single rays slip through: what is seen from a surface with normal `n` must be seen a
    /// little beside, too.
    fn is_confirmed(&self, own: u32, x: Vec3, n: Vec3, direction: Vec3, (side, t): (Side, f32)) -> bool {
        let visibility = &self.scene.visibility;
        let radius = visibility.geometries()[(side / 2) as usize].bounds(Domain::WHOLE).radius();
        let turn = BESIDE.min(BESIDE_SHARE * radius / t);
        let (a, b) = n.any_orthonormal_pair();
        let also = |aside: Vec3| {
            let met = visibility.first_side(x, direction + aside * turn, NEARLY * t, own);
            met.is_some_and(|met| met.0 == side)
        };
        also(a) && also(b)
    }

    /// What a spot may be joined to that sees a place on a side; `None` where that is of its group as far as is known.
    fn around(&self, spot: u32, side: Side, at: Vec3) -> Option<Met> {
        let root = self.groups.known_root(spot);
        if !self.large[(side / 2) as usize] {
            let other = self.of_side[side as usize];
            return (other != NONE && self.groups.known_root(other) != root).then_some(Met::Spot(other));
        }
        let near = self.nearest(side, at);
        let known = |other: u32| self.groups.known_root(other) == root;
        match near.iter().find(|&&other| !known(other) && self.is_joined(side, at, other)) {
            Some(&other) => Some(Met::Spot(other)),
            None => (!near.is_empty() && !near.iter().any(|&other| known(other))).then_some(Met::Place(side, at)),
        }
    }

    /// Joins a spot to those around a place that it sees; tells whether there are any, or that it belongs to already.
    fn join_around(&mut self, spot: u32, side: Side, at: Vec3) -> bool {
        let mut joined = false;
        for other in self.nearest(side, at) {
            if self.groups.root(other) == self.groups.root(spot) || self.is_joined(side, at, other) {
                self.groups.join(spot, other);
                joined = true;
            }
        }
        joined
    }

    /// Whether a line just above a large flat side leads from a place on it to a spot.
    fn is_joined(&self, side: Side, at: Vec3, spot: u32) -> bool {
        let own = side / 2;
        let lift = outward(&self.scene.surfaces()[own as usize], side) * ABOVE;
        let to = self.all[spot as usize].at;
        !self.scene.visibility.occluded(at + lift, to + lift, [own, own], &mut { NO_BLOCKER })
    }

    /// The spots of a side that are nearest to a place on it, the nearest first.
    fn nearest(&self, side: Side, at: Vec3) -> Spotted {
        let distance = |spot: u32| self.all[spot as usize].at.distance_squared(at);
        let mut there: SmallVec<[(f32, u32); MOST_SPOTS]> =
            self.on_side(side).map(|spot| (distance(spot), spot)).collect();
        there.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        there.into_iter().take(NEAREST).map(|(_, spot)| spot).collect()
    }

    /// The spots of a side.
    pub(crate) fn on_side(&self, side: Side) -> impl Iterator<Item = u32> {
        let known = |spot: u32| (spot != NONE).then_some(spot);
        std::iter::successors(known(self.of_side[side as usize]), move |&spot| known(self.all[spot as usize].next))
    }
}

/// Whether a point of a surface with normal `n` sees one of those lights without extent that are `wanted`.
pub(crate) fn sees_light(scene: &SceneData, surface: u32, x: Vec3, n: Vec3, wanted: impl Fn(&Light) -> bool) -> bool {
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

    /// Makes all members point to their roots, for [`known_root`](Self::known_root).
    pub(crate) fn flatten(&mut self) {
        for member in 0..self.parent.len() as u32 {
            self.parent[member as usize] = self.root(member) as u32;
        }
    }

    /// The root as it was when all were flattened.
    pub(crate) fn known_root(&self, member: u32) -> usize {
        self.parent[member as usize] as usize
    }

    pub(crate) fn is_known_lit(&self, member: u32) -> bool {
        self.lit[self.known_root(member)]
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

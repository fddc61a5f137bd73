//! Contact shadows: leaves are split where something near takes their light away.
//!
//! Below a ball the floor is dark, though none of the many senders that light it casts a shadow that would count by itself: each link is
//! fine enough, and all of them together are wrong alike. So each leaf whose light counts finds out by rays from all over it how open its
//! surroundings are, and is split where one part of it is shut in and another is not. Nothing is near that is farther away than the leaf is
//! large: so the smaller leaves are, the less is near, and they are small only where things touch, or all but.

use crate::Rgb;
use crate::hierarchy::{Element, Kind};
use crate::hooks::LightField;
use crate::refine::{MutableLight, Tolerance, can_split};
use crate::sampling::{cosine_direction, hash, point4};
use crate::threads;
use crate::transport::Light;
use crate::vertices::INSET;
use crate::visibility::Region;
use glam::{Vec2, Vec3};
use std::ops::ControlFlow;

/// A leaf is looked at from so many times as many points, evenly spread from edge to edge, …
const SIDE: u32 = 5;
/// … in so many times as many directions, which are the same everywhere.
const DIRECTIONS: u32 = 4;
/// Leaves that a thread looks at between two calls of `watch`: some milliseconds.
const BETWEEN_WATCHES: usize = 32;
/// What lies flat on a leaf, or in its plane, is no higher than this share of its radius.
const ABOVE: f32 = 1e-3;
/// What all senders together bring counts as much as this share of what a single one does: a shadow in which there is nothing left is seen
/// however small it is.
const SHARE: f32 = 0.5;
/// What differs by less than this share from one point to another is shown by interpolation as well.
const SOFT: f32 = 0.4;

/// Splits leaves within which openness differs by what counts, and their parts likewise. `watch` is told how many elements there are; once
/// it breaks, no more are split. Returns the rays that were shot.
pub(crate) fn split<L: LightField>(
    light: &mut MutableLight<'_, L>,
    tolerance: Tolerance,
    watch: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> u64 {
    let mut rays = 0;
    let mut leaves: Vec<u32> = light.elements.patch_leaves().collect();
    while !leaves.is_empty() {
        let reader = light.read();
        let mut looked: Vec<(bool, u64)> = Vec::with_capacity(leaves.len());
        for some in leaves.chunks(BETWEEN_WATCHES * threads::current_num_threads()) {
            if watch(light.elements.nodes.len() as u64).is_break() {
                return rays;
            }
            looked.extend(threads::map(some, 1, |&leaf| is_partly_shut_in(reader, tolerance, leaf)));
        }
        let mut parts = Vec::new();
        for (leaf, (splits, shot)) in leaves.into_iter().zip(looked) {
            rays += shot;
            if splits {
                light.split(leaf);
                let element = &light.elements.nodes[leaf as usize];
                parts.extend(element.first_child..element.first_child + element.child_count);
            }
        }
        leaves = parts;
    }
    rays
}

/// Whether openness differs within a leaf by what counts, and the rays that were shot to know.
fn is_partly_shut_in<L: LightField>(light: Light<'_, L>, tolerance: Tolerance, leaf: u32) -> (bool, u64) {
    let element = light.element(leaf);
    // Directional light is reflected as a whole by leaves, however large.
    let diffuse = element.reflectance.max_element() / element.importance.max(f32::MIN_POSITIVE);
    let most = diffuse * light.weight(leaf) * light.exitant.irradiance[leaf as usize].max_element();
    let is_covered = light.elements.exposed(leaf) < 1.0;
    let least = SHARE * tolerance.shadow;
    if most * SOFT <= least || !can_split(element, tolerance) || is_covered {
        return (false, 0);
    }
    let mut look = Look { light, element, seed: hash(leaf, 0xc047), rays: 0 };
    if !look.is_anything_near() {
        return (false, 0);
    }
    // A few directions tell of most leaves that they are as open everywhere.
    let is_split = look.differs(|direction| direction % (DIRECTIONS + 1) == 0, |share| share >= SOFT)
        && look.differs(|_| true, |share| share > SOFT && most * share > least);
    (is_split, look.rays)
}

/// A leaf that is looked at.
struct Look<'a, L: LightField> {
    light: Light<'a, L>,
    element: &'a Element,
    seed: u32,
    rays: u64,
}

impl<L: LightField> Look<'_, L> {
    /// Whether there is anything that may be near.
    fn is_anything_near(&self) -> bool {
        let Element { source, domain, radius, normals, .. } = *self.element;
        let geometry = &self.light.scene.surfaces()[source as usize];
        let height = geometry.point(geometry.middle(domain)).dot(normals.axis);
        let below = if geometry.is_flat() { ABOVE * radius } else { -radius };
        let region = Region {
            bounds: geometry.bounds(domain).padded(radius),
            normal: normals.axis,
            heights: [height + below, height + radius],
        };
        self.light.scene.visibility.any_in(&region, |other| other != source)
    }

    /// Whether the share of directions in which there is light from afar differs from one point of the leaf to another by what `counts`, of
    /// those directions that are `asked`.
    fn differs(&mut self, asked: impl Fn(u32) -> bool, counts: impl Fn(f32) -> bool) -> bool {
        let directions = (0..DIRECTIONS * DIRECTIONS).filter(|&direction| asked(direction));
        let count = directions.clone().count();
        let (mut least, mut greatest) = (count, 0);
        (0..SIDE * SIDE).any(|point| {
            let place = self.place(point);
            let open = directions.clone().filter(|&direction| self.sees_afar(place, direction)).count();
            (least, greatest) = (least.min(open), greatest.max(open));
            counts((greatest - least) as f32 / count as f32)
        })
    }

    /// A point of the leaf, with its normal.
    fn place(&self, point: u32) -> (Vec3, Vec3) {
        let Element { source, domain, kind, .. } = *self.element;
        let geometry = &self.light.scene.surfaces()[source as usize];
        let at = Vec2::new((point % SIDE) as f32, (point / SIDE) as f32) / (SIDE - 1) as f32;
        let (x, normal) = geometry.sample(domain, at.x, at.y);
        let inward = x.lerp(geometry.point(geometry.middle(domain)), INSET);
        (inward, if kind == Kind::Back { -normal } else { normal })
    }

    /// Whether a point has light from afar in a direction: by itself, or by way of something near that has.
    fn sees_afar(&mut self, (x, normal): (Vec3, Vec3), direction: u32) -> bool {
        let u = point4(self.seed, direction);
        let cell = Vec2::new((direction % DIRECTIONS) as f32, (direction / DIRECTIONS) as f32);
        let along = (cell + Vec2::new(u.x, u.y)) / DIRECTIONS as f32;
        let visibility = &self.light.scene.visibility;
        self.rays += 1;
        let to = cosine_direction(normal, along.x, along.y);
        let Some(hit) = visibility.closest_except(x, to, 0.0, self.element.radius, self.element.source) else {
            return true;
        };
        let facing = if hit.front { hit.normal } else { -hit.normal };
        let material = &self.light.scene.materials[self.light.scene.surface_materials[hit.surface as usize] as usize];
        if hit.front && material.exitance != Rgb::ZERO {
            return true;
        }
        self.rays += 1;
        let onward = cosine_direction(facing, u.z, u.w);
        visibility.closest_except(hit.point, onward, 0.0, self.element.radius, hit.surface).is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::Skips;
    use crate::{DiffuseMaterial, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;

    /// Whether a floor of 4 m below a ball, whose middle is so high above it, is to be split.
    fn is_split(height: f64) -> bool {
        let (x, y) = (DVec3::X * 4.0, DVec3::Y * 4.0);
        let floor = Surface::new(Shape::Quad([DVec3::ZERO, x, x + y, y]), 0);
        let ball = Surface::new(Shape::Sphere { center: DVec3::new(2.0, 2.0, height), radius: 0.4 }, 0);
        let material = DiffuseMaterial { reflectance: Rgb::splat(0.6), exitance: Rgb::ZERO, two_sided: false };
        let input = SceneInput { surfaces: vec![floor, ball], materials: vec![material], ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.2), ()).expect("the scene is sound");
        solver.exitant.irradiance.fill(Rgb::ONE);
        let tolerance = Tolerance {
            error: 0.0,
            lost: 0.0,
            shadow: 0.01,
            kept_too: true,
            dark: false,
            smallest: 0.01,
            skips: Skips::ALL,
        };
        is_partly_shut_in(solver.light(), tolerance, solver.elements.surface_nodes[0][0]).0
    }

    #[test]
    fn a_floor_is_split_where_a_ball_stands() {
        assert!(is_split(0.4), "nothing is left where they touch");
        assert!(!is_split(2.0), "it takes little away from above");
    }
}

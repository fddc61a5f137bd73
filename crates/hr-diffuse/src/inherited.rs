//! Inherited light: what nodes received through links that leaves do not look at closely, summed up on the way down.
//!
//! In a large scene hundreds of faint links, from far clusters, end above each leaf. Seen from all that is below a node, a
//! sender that is far from it lies in about the same direction, at about the same distance. So what it brings is added to the
//! node's moments: the light itself, its mean direction and their second moments, which is as much as a distribution of normals
//! ([`Facing`]) can tell apart. What is nearer is handed on to the children, until it is far from them. So a link costs as
//! much as there are nodes near its sender, rather than as there are leaves.

use crate::Facing;
use crate::gather::{GROUPS, Group};
use crate::hooks::{Hierarchy, LightField, NodeId};
use crate::links::Links;
use crate::push::Spread;
use crate::threads;
use crate::transport::Light;
use glam::{Vec3, Vec3Swizzles};
use std::ops::{AddAssign, Mul, Range};

/// Nodes whose radius is below this share of a sender's distance see it in one direction: 9° at the rim, evenly to both sides.
const ONE_DIRECTION: f32 = 0.15;
/// Near large senders the inverse square law ends; a factor of four is more than refinement leaves.
const MOST_RENEWED: f32 = 4.0;
/// Nodes below which a thread goes on alone.
const SUBTREE: u32 = 256;

/// What links carry: irradiance, or shares of the view.
pub(crate) trait Carried: Copy + Default + Send + Sync + AddAssign + Mul<f32, Output = Self> {}

impl<T: Copy + Default + Send + Sync + AddAssign + Mul<f32, Output = T>> Carried for T {}

/// What arrives from many directions, by its moments: the sums of L, L ω and L ω ωᵀ.
#[derive(Clone, Copy, Debug, Default)]
struct Moments<T> {
    sum: T,
    mean: [T; 3],
    diagonal: [T; 3],
    mixed: [T; 3],
}

impl<T: Carried> Moments<T> {
    fn add(&mut self, light: T, direction: Vec3) {
        self.sum += light;
        let add = |to: &mut [T; 3], factors: Vec3| {
            for (to, factor) in to.iter_mut().zip(factors.to_array()) {
                *to += light * factor;
            }
        };
        add(&mut self.mean, direction);
        add(&mut self.diagonal, direction * direction);
        add(&mut self.mixed, direction.yzx() * direction.zxy());
    }

    /// Irradiance of surfaces with these normals: the series of [`Facing::mean_cosine`], which has no sharp horizon. A single
    /// sender is off by up to 9%, many around by less.
    fn on(&self, facing: &Facing) -> T {
        let mut sum = self.sum * (0.25 - 5.0 / 32.0);
        let mut add = |moments: &[T; 3], factors: Vec3, scale: f32| {
            for (moment, factor) in moments.iter().zip(factors.to_array()) {
                sum += *moment * (factor * scale);
            }
        };
        add(&self.mean, facing.mean, 0.5);
        add(&self.diagonal, facing.diagonal, 15.0 / 32.0);
        add(&self.mixed, facing.mixed, 15.0 / 16.0);
        sum
    }
}

/// What a link brings that is handed down.
#[derive(Clone, Copy, Debug)]
struct Handed<T> {
    /// Irradiance at the receiver, perpendicular to its direction.
    light: T,
    group: Group,
    /// The link, by its place among all.
    link: u32,
    /// Middle of the sender, and its squared distance from the receiver's.
    from: Vec3,
    distance2: f32,
}

impl<T: Carried> Handed<T> {
    /// Direction and irradiance at another place than the receiver's middle, with the squared distance.
    fn at(&self, x: Vec3) -> (Vec3, T, f32) {
        let to = self.from - x;
        let distance2 = to.length_squared();
        let change = (self.distance2 / distance2.max(1e-12)).clamp(MOST_RENEWED.recip(), MOST_RENEWED);
        (to.normalize_or(Vec3::Z), self.light * change, distance2)
    }
}

/// What a place inherits.
#[derive(Debug)]
pub(crate) struct Inherited<'a, T> {
    summed: &'a Summed<T>,
    near: &'a [Handed<T>],
}

impl<T: Carried> Inherited<'_, T> {
    /// By group, what arrives from afar, and evenly, where there are such normals.
    pub(crate) fn afar(&self, facing: &Facing) -> [T; GROUPS] {
        let mut sums = self.summed.even;
        for (sum, moments) in sums.iter_mut().zip(&self.summed.moments) {
            *sum += moments.on(facing);
        }
        sums
    }

    /// Links of the others, by place among all.
    pub(crate) fn near(&self) -> impl Iterator<Item = u32> {
        self.near.iter().map(|handed| handed.link)
    }

    /// By group, what arrives at a place with such normals.
    pub(crate) fn on(&self, x: Vec3, facing: &Facing) -> [T; GROUPS] {
        let mut sums = self.afar(facing);
        for handed in self.near {
            let (direction, light, _) = handed.at(x);
            sums[handed.group as usize] += light * facing.mean_cosine(direction);
        }
        sums
    }
}

/// What was summed up on the way to a node, by group.
#[derive(Clone, Copy, Debug, Default)]
struct Summed<T> {
    /// Through links that are spread evenly.
    even: [T; GROUPS],
    /// From far senders.
    moments: [Moments<T>; GROUPS],
}

/// A node where a thread begins, with what comes from above.
#[derive(Default)]
struct Start<T> {
    node: u32,
    summed: Summed<T>,
    near: Vec<Handed<T>>,
}

/// Links of which leaves inherit what they carry.
#[derive(Clone, Copy)]
pub(crate) struct Above<'a, T> {
    pub(crate) links: &'a Links,
    /// By link: how it is spread, whose light it is, and what it carries.
    pub(crate) spreads: &'a [Spread],
    pub(crate) groups: &'a [Group],
    pub(crate) carried: &'a [T],
}

/// Calls `answer` with each place and what it inherits; the answers by place, in order. All leaves that are parts of surfaces
/// are places, or lie below one.
pub(crate) fn inherit<L: LightField, T: Carried, R: Send>(
    light: Light<'_, L>,
    above: Above<'_, T>,
    is_place: impl Fn(u32) -> bool + Sync,
    answer: impl Fn(u32, &Inherited<'_, T>) -> R + Sync,
) -> Vec<(u32, R)> {
    let nodes = &light.elements.nodes;
    let mut below = vec![1_u32; nodes.len()];
    for node in (1..nodes.len()).rev() {
        if is_place(node as u32) {
            below[node] = 1;
        }
        below[nodes[node].parent as usize] += below[node];
    }
    let mut starts = Vec::new();
    let root = Start { node: 0, summed: Summed::default(), near: Vec::new() };
    let mut begin = |node: u32, summed: &Summed<T>, near: &[Handed<T>]| {
        let small = below[node as usize] <= SUBTREE;
        if small {
            starts.push(Start { node, summed: *summed, near: near.to_vec() });
        }
        small
    };
    let at_places = |_: u32, _: &Inherited<'_, T>| unreachable!("nothing else is below a place");
    descend(light, above, root, (&mut begin, &is_place), at_places);
    let answers: Vec<Vec<(u32, R)>> = threads::map_mut(&mut starts, 1, |_, start| {
        let mut answers = Vec::new();
        descend(light, above, std::mem::take(start), (&mut |_, _, _| false, &is_place), |place, inherited| {
            answers.push((place, answer(place, inherited)));
        });
        answers
    });
    let mut answers: Vec<(u32, R)> = answers.into_iter().flatten().collect();
    answers.sort_unstable_by_key(|answer| answer.0);
    answers
}

/// Goes down from a node to all places below it, but not below nodes that `ends` says yes to.
fn descend<L: LightField, T: Carried>(
    light: Light<'_, L>,
    Above { links, spreads, groups, carried }: Above<'_, T>,
    start: Start<T>,
    (ends, is_place): (&mut impl FnMut(u32, &Summed<T>, &[Handed<T>]) -> bool, &impl Fn(u32) -> bool),
    mut answer: impl FnMut(u32, &Inherited<'_, T>),
) {
    let (mut near, mut sums) = (start.near, vec![start.summed]);
    // Nodes that wait, with the number of nodes above them and what is handed to them.
    let mut waiting: Vec<(u32, usize, Range<usize>)> = vec![(start.node, 0, 0..near.len())];
    while let Some((node, depth, from)) = waiting.pop() {
        near.truncate(from.end);
        sums.truncate(depth + 1);
        let mut summed = sums[depth];
        if ends(node, &summed, &near[from.clone()]) {
            continue;
        }
        let element = light.element(node);
        let is_place = is_place(node);
        // A place looks at each of what is left.
        let reach = if is_place { f32::INFINITY } else { (element.radius / ONE_DIRECTION).powi(2) };
        for i in from.clone() {
            let handed = near[i];
            let (direction, light, distance2) = handed.at(element.center);
            if reach < distance2 {
                summed.moments[handed.group as usize].add(light, direction);
            } else {
                near.push(handed);
            }
        }
        for at in links.range(node) {
            let (light_of, group) = (carried[at], groups[at]);
            let sender = links.all()[at].sender;
            match spreads[at] {
                Spread::Exact => {}
                Spread::Even => summed.even[group as usize] += light_of,
                Spread::Plain => {
                    let center = light.element(sender).center;
                    let distance2 = center.distance_squared(element.center);
                    if reach < distance2 || light.elements.is_distant(NodeId(sender)) {
                        let direction = light.direction_to(element.center, sender);
                        summed.moments[group as usize].add(light_of, direction);
                    } else {
                        near.push(Handed { light: light_of, group, link: at as u32, from: center, distance2 });
                    }
                }
            }
        }
        let handed = from.end..near.len();
        if is_place {
            answer(node, &Inherited { summed: &summed, near: &near[handed] });
            continue;
        }
        sums.push(summed);
        let children = element.first_child..element.first_child + element.child_count;
        waiting.extend(children.rev().map(|child| (child, depth + 1, handed.clone())));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{hash, unit};

    fn direction(seed: u32) -> Vec3 {
        let (z, angle) = (2.0 * unit(hash(seed, 0)) - 1.0, std::f32::consts::TAU * unit(hash(seed, 1)));
        (Vec3::new(angle.cos(), angle.sin(), 0.0) * (1.0 - z * z).sqrt()).with_z(z)
    }

    /// Of spheres and hemispheres the series is exact, and so are sums of what arrives from anywhere.
    #[test]
    fn moments_tell_what_bent_surfaces_get() {
        let hemisphere = Facing { mean: 0.5 * Vec3::Z, diagonal: Vec3::splat(1.0 / 3.0), mixed: Vec3::ZERO };
        for facing in [hemisphere, Facing { mean: Vec3::ZERO, ..hemisphere }] {
            let (mut moments, mut sum) = (Moments::default(), 0.0);
            for i in 0..20 {
                let light = unit(hash(i, 77));
                moments.add(light, direction(i));
                sum += light * facing.mean_cosine(direction(i));
            }
            assert!((moments.on(&facing) / sum - 1.0).abs() < 1e-5, "{} of {sum}", moments.on(&facing));
        }
    }

    /// Flat surfaces have a sharp horizon, which matters for a single sender but not for many.
    #[test]
    fn moments_tell_flat_surfaces_what_many_senders_bring() {
        let mut most_single = 0.0_f32;
        for i in 0..200 {
            let facing = Facing::single(direction(1000 + i));
            let (mut all, mut sum) = (Moments::default(), 0.0);
            for j in 0..300 {
                let from = direction(500 * i + j);
                // More from above than from below.
                let light = 1.0 + 0.5 * from.z;
                all.add(light, from);
                sum += light * facing.mean_cosine(from);
                let mut single = Moments::default();
                single.add(1.0, from);
                most_single = most_single.max((single.on(&facing) - facing.mean_cosine(from)).abs());
            }
            // What the series leaves out has a root mean square of √(1/6 − 1/16 − 1/12 − 5/256) = 0.036; four times that.
            let off: f32 = all.on(&facing) - sum;
            assert!(off.abs() < 4.0 * 0.036 * 300.0_f32.sqrt(), "{} of {sum}", all.on(&facing));
        }
        assert!((0.08..0.0942).contains(&most_single), "{most_single}: ¼ − 5/32 on the horizon");
    }

    /// What is handed down and what is summed up agree where the sender is far.
    #[test]
    fn what_leaves_inherit_is_what_each_link_brings() {
        let input = crate::skips::tests::room();
        let solver = crate::skips::tests::solve(&input, 0.1, (), crate::skips::Skips::ALL);
        let (light, links) = (solver.light(), &solver.links);
        let even = |link: &crate::links::Link| light.element(link.receiver).is_flat();
        let spread = |link| if even(link) { Spread::Even } else { Spread::Plain };
        let spreads: Vec<Spread> = links.all().iter().map(spread).collect();
        let groups = vec![Group::Rest; links.all().len()];
        let carried: Vec<f32> = links.all().iter().map(|link| link.factor * link.visibility.abs()).collect();
        let above = Above { links, spreads: &spreads, groups: &groups, carried: &carried };
        let found = inherit(
            light,
            above,
            |node| light.elements.is_patch_leaf(node),
            |leaf, inherited| {
                let element = light.element(leaf);
                inherited.on(element.center, &element.facing)[Group::Rest as usize]
            },
        );
        let (mut apart, mut total, mut shared) = (0.0, 0.0, 0.0);
        for (leaf, found) in found {
            let (element, mut sum, mut node) = (light.element(leaf), 0.0, leaf);
            loop {
                for at in links.range(node) {
                    let (sender, receiver) = (light.element(links.all()[at].sender), light.element(node));
                    let change = receiver.center.distance_squared(sender.center)
                        / element.center.distance_squared(sender.center);
                    let weight = match spreads[at] {
                        Spread::Even => 1.0,
                        _ => {
                            element.mean_cosine((sender.center - element.center).normalize()) * change.clamp(0.25, 4.0)
                        }
                    };
                    sum += carried[at] * weight;
                    shared += if spreads[at] == Spread::Even { 0.0 } else { element.area * carried[at] * weight };
                }
                if node == 0 {
                    break;
                }
                node = light.element(node).parent;
            }
            apart += element.area * (found - sum).abs();
            total += element.area * sum;
        }
        assert!(shared > 0.1 * total, "{shared} of {total} comes through links of clusters");
        assert!(apart < 0.1 * shared, "{apart} of {shared}");
    }
}

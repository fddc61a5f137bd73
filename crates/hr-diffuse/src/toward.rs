//! Directional light on its way: a distribution is asked for several directions, between points of both ends of a link.
//!
//! A node's distribution depends on the direction alone, and a narrow lobe on all of it: one direction, from the middle of the
//! sender to the middle of the receiver, finds the peak or misses it. The mean over both ends is what the link carries.
//!
//! From place to place of a polished plate a lamp's mirror image moves, and leaves that all showed what their middles do would send it
//! in stripes: a place of a flat leaf sends what is seen from [there](LightField::radiance_beside).

use crate::Rgb;
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::push::sample_points;
use crate::reflect::Representative;
use crate::sampling::{cosine_direction, point2};
use crate::transport::Light;
use glam::Vec3;
use smallvec::{SmallVec, smallvec};
use std::f32::consts::PI;

/// Where sender and receiver together subtend less than this (radians, half), one direction is as good as all: no lobe that
/// travels is narrower.
const NARROW: f32 = 0.02;
/// Of a cluster's box, points are so far from its middle, in halves of its sides: a uniform box has the same variance.
const SPREAD: f32 = 0.577;
/// Pairs of points that a link from what is not flat is worth, if there are so many.
const PAIRS: usize = 16;
/// Of what is not flat, light is divided by a mean cosine of at least this: near the terminator both fade.
const LEAST_COSINE: f32 = 0.05;

/// A point lies beside a flat sender if it is no higher above it than this share of its radius …
const BESIDE: f32 = 0.25;
/// … and sees at least so much of it (the form factor).
const LARGE: f32 = 0.1;
/// It looks in so many directions that about this number meets the sender, …
const MET: f32 = 32.0;
/// … and takes what they say if at least so many do.
const LEAST_MET: usize = 3;
/// Flat senders are looked at in steps of an angle (radians) that makes a few of the narrowest lobe that travels, which is blurred further by
/// where its light comes from; in steps that are so many times as large as all that they reflect is more than what is directional of
/// it; …
const STEP: f32 = 0.1;
/// … and in no more steps than these one way, and no fewer.
const MOST_STEPS: f32 = 6.0;
const LEAST_STEPS: f32 = 2.0;
/// Where what they bring is shown, and more than this times what is negligible, …
const CLOSELY: f32 = 4.0;
/// … they are looked at in as small steps in any case, but no more of them than these one way.
const MOST_CLOSE_STEPS: f32 = 24.0;
/// All points look in the same directions, and at all receivers the same points are looked at, so that what is found changes smoothly.
const SAME: u32 = 0x2f1d;

/// How closely light that arrives at a point is looked at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detail {
    /// What brings no more than this (W/m²) is looked at less closely.
    pub(crate) negligible: f32,
    /// Whether the point is shown. What is right on average along an edge makes spots there.
    pub(crate) shown: bool,
}

impl Detail {
    /// For light on its way.
    pub(crate) fn carried(negligible: f32) -> Self {
        Self { negligible, shown: false }
    }

    /// For what is hardly seen: all senders are points that send evenly.
    pub(crate) fn rough() -> Self {
        Self::carried(f32::INFINITY)
    }

    /// For what is seen.
    pub(crate) fn shown(negligible: f32) -> Self {
        Self { negligible, shown: true }
    }
}

/// A point that stands for a part of a node, its normal (zero where it has none), and its weight.
type Point = (Vec3, Vec3, f32);

/// How closely a flat sender is looked at.
#[derive(Clone, Copy, Debug)]
struct Steps {
    /// In steps of this angle (radians), …
    angle: f32,
    /// … and in no more than these one way.
    most: f32,
}

impl<L: LightField> Light<'_, L> {
    /// [`directional`](Self::directional) on the way to a receiver: its mean over both. Geometry and materials alone
    /// decide how closely it is looked at, so that light settles.
    pub(crate) fn directional_toward(&self, sender: u32, receiver: u32) -> Rgb {
        let r = self.element(receiver);
        let away = -self.direction_to(r.center, sender);
        if !self.is_wide(sender, r.center, r.radius) || self.directional_most(sender) <= 0.0 {
            return self.directional(sender, away);
        }
        let mut points = self.points(receiver);
        if !r.is_flat() && r.is_patch() {
            // What arrives is that on a plane that faces the sender.
            points.retain(|(_, n, _)| n.dot(away) < 0.0);
        }
        if !r.is_flat() {
            points.iter_mut().for_each(|(_, n, _)| *n = Vec3::ZERO);
        }
        if points.is_empty() {
            return self.directional(sender, away);
        }
        let geometry = (r.is_flat() && r.is_patch()).then(|| &self.scene.surfaces()[r.source as usize]);
        let receiving = |i: u32| match geometry {
            Some(geometry) => {
                let u = point2(SAME, i);
                (geometry.sample(r.domain, u.x, u.y).0, r.normals.axis, 1.0)
            }
            None => points[i as usize % points.len()],
        };
        let of_flat = self.mean_over_flat(sender, (receiving, r.radius), self.steps(sender));
        of_flat.unwrap_or_else(|| self.mean_directional(sender, away, &points))
    }

    /// The same on the way to a point with normal `n`: the mean over the sender. Senders that bring less than what is negligible through
    /// this form factor are asked for one direction.
    pub(crate) fn directional_at(&self, sender: u32, (x, n): (Vec3, Vec3), (factor, detail): (f32, Detail)) -> Rgb {
        let away = -self.direction_to(x, sender);
        if !self.is_wide(sender, x, 0.0) || self.directional_most(sender) * factor <= detail.negligible {
            return self.directional(sender, away);
        }
        let look = || {
            let is_one = self.exitant.senders.of(self.exitant.reflected_as[sender as usize]).len() == 1;
            let much = is_one && self.directional_most(sender) * factor > CLOSELY * detail.negligible;
            let steps = Steps { angle: STEP, most: MOST_CLOSE_STEPS };
            let closely = || much.then(|| self.mean_over_flat(sender, (|_| (x, n, 1.0), 0.0), steps)).flatten();
            self.seen_beside(sender, (x, n), factor).or_else(closely)
        };
        let seen = detail.shown.then(look).flatten();
        let of_flat = || self.mean_over_flat(sender, (|_| (x, n, 1.0), 0.0), self.steps(sender));
        seen.or_else(of_flat).unwrap_or_else(|| self.mean_directional(sender, away, &[(x, n, 1.0)]))
    }

    /// The same by the directions in which a point sees a flat sender that it lies close beside, as in a corner of a room: half of what it
    /// sees is the strip next to it, at any angle. Points of the sender would show but the rest, along the surface. `None` where
    /// it is not so.
    fn seen_beside(&self, sender: u32, (x, n): (Vec3, Vec3), factor: f32) -> Option<Rgb> {
        let element = self.element(sender);
        let is_beside = (x - element.center).dot(element.normals.axis) < BESIDE * element.radius;
        let standing = self.exitant.senders.of(self.exitant.reflected_as[sender as usize]);
        if !is_beside || factor < LARGE || !element.is_flat() || standing.is_empty() {
            return None;
        }
        let geometry = &self.scene.surfaces()[element.source as usize];
        let (mut sum, mut all, mut met) = (Rgb::ZERO, 0.0, 0);
        for i in 0..(MET / factor) as u32 {
            let u = point2(SAME, i);
            let toward = cosine_direction(n, u.x, u.y);
            if toward.dot(element.normals.axis) >= 0.0 {
                continue;
            }
            let hit = geometry.intersect(x, toward, 0.0, f32::MAX);
            if let Some((t, _)) = hit.filter(|(_, uv)| geometry.contains(element.domain, *uv)) {
                let Representative { leaf, share, strength } = standing[met % standing.len()];
                sum += self.radiance_from(leaf, (sender, x + toward * t), -toward) * strength * share;
                all += share;
                met += 1;
            }
        }
        let share: f32 = standing.iter().map(|standing| standing.share).sum();
        (met >= LEAST_MET && all > 0.0).then(|| sum * self.times_as_much(sender) * (PI * share / all))
    }

    /// The same toward a receiver, whose `i`-th point and radius are given, weighted by the transfer's kernel: by pairs of points all over
    /// both, as many as their size in each other's view asks for. A narrow lobe is seen from one of a few points, or from none, which
    /// shows as stars around vertices. `None` where the sender is not flat.
    fn mean_over_flat(
        &self,
        sender: u32,
        (receiving, radius): (impl Fn(u32) -> Point, f32),
        Steps { angle, most }: Steps,
    ) -> Option<Rgb> {
        let element = self.element(sender);
        let standing = self.exitant.senders.of(self.exitant.reflected_as[sender as usize]);
        let is_flat = element.is_patch() && standing.iter().all(|standing| self.element(standing.leaf).is_flat());
        if !element.is_flat() || !is_flat || standing.is_empty() {
            return None;
        }
        // Leaves that stand for the sender are where they are; one that is all of it is all over it.
        let own = standing.len() > 1;
        let across = (standing.len() as f32).sqrt();
        let distance = (receiving(0).0.distance(element.center) - radius).max(radius);
        let [least, most] = [LEAST_STEPS, most].map(|steps| (steps / across).max(1.0));
        let (mut sum, mut all, mut pair) = (Rgb::ZERO, 0.0, 0);
        for &Representative { leaf, share, strength } in standing {
            let node = if own { leaf } else { sender };
            let part = self.element(node);
            let geometry = &self.scene.surfaces()[part.source as usize];
            let steps = 2.0 * (part.radius + radius / across) / (angle * distance).max(f32::MIN_POSITIVE);
            let steps = steps.clamp(least, most).ceil() as u32;
            // The size of a step takes the pole out of the kernel.
            let pole = 0.1 * (part.radius / steps as f32).powi(2);
            for i in 0..steps * steps {
                let [s, t] = [i / steps, i % steps].map(|step| (step as f32 + 0.5) / steps as f32);
                let at = geometry.sample(part.domain, s, t).0;
                let (x, n, weight) = receiving(pair);
                pair += 1;
                let toward = (at - x).normalize_or_zero();
                let cosine = if n == Vec3::ZERO { 1.0 } else { toward.dot(n).max(0.0) };
                let cosines = cosine * (-toward).dot(part.normals.axis).max(0.0);
                let kernel = cosines / (at.distance_squared(x) + pole).max(1e-20);
                let kernel = kernel * weight * share / (steps * steps) as f32;
                if kernel > 0.0 {
                    all += kernel;
                    sum += self.radiance_from(leaf, (node, at), -toward) * strength * kernel;
                }
            }
        }
        let share: f32 = standing.iter().map(|standing| standing.share).sum();
        Some(if all > 0.0 { sum * self.times_as_much(sender) * (PI * share / all) } else { Rgb::ZERO })
    }

    /// How closely a flat sender is looked at for light on its way.
    fn steps(&self, sender: u32) -> Steps {
        let element = self.element(sender);
        let [directional, diffuse] =
            [self.field.active(element.material).unwrap_or_default(), element.reflectance].map(Rgb::max_element);
        Steps { angle: STEP * ((directional + diffuse) / directional), most: MOST_STEPS }
    }

    /// Whether a sender and what is within a radius of a point are so near that more than their middles count.
    fn is_wide(&self, sender: u32, to: Vec3, radius: f32) -> bool {
        let element = self.element(sender);
        let reach = element.radius + radius;
        reach * reach > NARROW * NARROW * to.distance_squared(element.center)
    }

    /// Points that stand for a node: of parts of surfaces those of a quadrature, of clusters four corners of a box.
    fn points(&self, node: u32) -> SmallVec<[Point; 4]> {
        let element = self.element(node);
        if !element.is_patch() {
            let [low, high] = element.bounds;
            let (middle, half) = (0.5 * (low + high), 0.5 * SPREAD * (high - low));
            let corners =
                [Vec3::ONE, Vec3::new(-1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(1.0, -1.0, -1.0)];
            return corners.into_iter().map(|corner| (middle + half * corner, Vec3::ZERO, 0.25)).collect();
        }
        sample_points(self.scene, element)
    }

    /// Mean of what a sender emits toward points of a receiver, weighted by the transfer's kernel; `away` leads to their middle.
    fn mean_directional(&self, sender: u32, away: Vec3, points: &[Point]) -> Rgb {
        let element = self.element(sender);
        let state = self.exitant.reflected_as[sender as usize];
        let standing = self.exitant.senders.of(state);
        if standing.is_empty() {
            return self.directional(sender, away);
        }
        // Leaves that stand for the sender are where they are; one that is all of it is all over it.
        let own = if standing.len() == 1 || state != sender { self.points(sender) } else { smallvec![] };
        let (mut sum, mut seen, mut all) = (Rgb::ZERO, 0.0, 0.0);
        let places = standing.len().max(own.len());
        for pair in 0..places * points.len().min(PAIRS.div_ceil(places)) {
            let (place, turn) = (pair % places, pair / places);
            let Representative { leaf, share, strength } = standing[place % standing.len()];
            let (x, n, weight) = points[(place + turn) % points.len()];
            let part = self.element(leaf);
            let at = if own.is_empty() { part.center } else { own[place % own.len()].0 };
            let d2 = at.distance_squared(x);
            let toward = (at - x).normalize_or_zero();
            let cosine = if n == Vec3::ZERO { 1.0 } else { toward.dot(n).max(0.0) };
            // The radius takes the pole out of the kernel.
            let kernel = weight * share * cosine / (d2 + 0.1 * element.radius * element.radius).max(1e-20);
            if kernel <= 0.0 {
                continue;
            }
            let facing = if part.is_flat() { part.normals.axis.dot(-toward).max(0.0) } else { 1.0 };
            all += kernel;
            seen += kernel * if part.is_flat() { facing } else { part.mean_cosine(-toward).max(LEAST_COSINE) };
            if facing > 0.0 {
                sum += self.field.radiance(&self.reflected[leaf as usize], -toward) * strength * (facing * kernel * PI);
            }
        }
        // Intensity per area over the mean cosine is mean radiance.
        let over = if element.kind == Kind::Cluster { all } else { seen };
        if over <= 0.0 {
            return Rgb::ZERO;
        }
        sum * self.times_as_much(sender) * (standing.iter().map(|standing| standing.share).sum::<f32>() / over)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::Element;
    use crate::hooks::{Arrived, Hierarchy, NodeId, Transfer};
    use crate::reflect::Senders;
    use crate::sampling::point4;
    use crate::{Cone, DiffuseMaterial, SceneInput, Settings, Shape, Solver, Surface};
    use glam::{DVec3, Vec2};
    use std::f32::consts::FRAC_1_PI;

    /// What is sent does not depend on what arrives: a lobe around `axis` with this exponent, which comes from so far behind the surface.
    struct Lobe {
        axis: Vec3,
        exponent: f32,
        behind: f32,
    }

    impl LightField for Lobe {
        type Incident = ();
        type Exitant = ();

        fn active(&self, _: u32) -> Option<Rgb> {
            Some(Rgb::splat(0.5))
        }
        fn clear(&self, (): &mut ()) {}
        fn receive(&self, (): &mut (), _: &Transfer) {}
        fn reflect<H: Hierarchy>(&self, _: &H, _: NodeId, _: &[&()], _: Arrived) {}
        fn radiance(&self, (): &(), away: Vec3) -> Rgb {
            Rgb::splat(FRAC_1_PI * away.dot(self.axis).max(0.0).powf(self.exponent))
        }
        fn radiance_beside(&self, (): &(), (_, offset): (Vec3, Vec3), away: Vec3) -> Rgb {
            Lobe { axis: (self.axis + offset / self.behind).normalize(), ..*self }.radiance(&(), away)
        }
        fn radiance_bounds(&self, (): &(), _: &Cone) -> (Rgb, Rgb) {
            (Rgb::ZERO, Rgb::splat(FRAC_1_PI))
        }
    }

    /// Unit squares, one of them 2 above the other and moved by `aside`; the lower one sends a lobe.
    fn squares(aside: f64, axis: Vec3, (exponent, behind): (f32, f32)) -> (Solver<Lobe>, [u32; 2]) {
        let square = |o: DVec3, a: DVec3, b: DVec3| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), 0);
        let surfaces =
            vec![square(DVec3::ZERO, DVec3::X, DVec3::Y), square(DVec3::new(aside, 0.0, 2.0), DVec3::Y, DVec3::X)];
        let material = DiffuseMaterial { reflectance: Rgb::splat(0.2), exitance: Rgb::ZERO, two_sided: false };
        let input = SceneInput { surfaces, materials: vec![material], ..SceneInput::default() };
        let field = Lobe { axis: axis.normalize(), exponent, behind };
        let mut solver = Solver::new(&input, Settings::with_error(0.1), field).expect("the scene is sound");
        let nodes = [0, 1].map(|surface| solver.elements.surface_nodes[surface][0]);
        let mut ranges = vec![[0; 2]; solver.elements.nodes.len()];
        ranges[nodes[0] as usize] = [0, 1];
        solver.exitant.senders =
            Senders { ranges, standing: vec![Representative { leaf: nodes[0], share: 1.0, strength: Rgb::ONE }] };
        solver.exitant.reflected_as = (0..solver.elements.nodes.len() as u32).collect();
        solver.exitant.peak.fill(FRAC_1_PI);
        (solver, nodes)
    }

    /// By many random pairs of points: what passes over what would of unit radiosity.
    fn brute_force(solver: &Solver<Lobe>, [sender, receiver]: [u32; 2], at: Option<Vec3>) -> f32 {
        let point = |node: u32, u: Vec2| {
            let element = &solver.elements.nodes[node as usize];
            solver.scene.surfaces()[element.source as usize].sample(element.domain, u.x, u.y)
        };
        let (mut sum, mut all) = (0.0, 0.0);
        for i in 0..20_000 {
            let u = point4(7, i);
            let ((s, m), (r, n)) = (point(sender, Vec2::new(u.x, u.y)), point(receiver, Vec2::new(u.z, u.w)));
            let x = at.unwrap_or(r);
            let toward = (s - x).normalize();
            let kernel = toward.dot(n).max(0.0) * (-toward).dot(m).max(0.0) / s.distance_squared(x);
            all += kernel;
            let beside = (m, s - solver.elements.nodes[sender as usize].center);
            sum += kernel * PI * solver.field.radiance_beside(&(), beside, -toward).x;
        }
        sum / all
    }

    #[test]
    fn lobes_count_by_their_mean_over_both_ends() {
        let mut worst = [0.0_f32; 3];
        for (aside, axis, exponent) in [
            (0.0, Vec3::Z, 1.0),
            (0.0, Vec3::Z, 30.0),
            (0.0, Vec3::new(0.5, 0.3, 1.0), 30.0),
            (1.5, Vec3::Z, 10.0),
            (1.5, Vec3::new(1.0, 0.0, 1.0), 60.0),
        ] {
            let (solver, nodes @ [sender, receiver]) = squares(aside, axis, (exponent, f32::INFINITY));
            let light = solver.light();
            let truth = brute_force(&solver, nodes, None);
            let (x, n) = (light.element(receiver).center, light.element(receiver).normals.axis);
            let single = light.directional(sender, -light.direction_to(x, sender)).x;
            let off = [
                (single - truth).abs(),
                (light.directional_toward(sender, receiver).x - truth).abs(),
                (light.directional_at(sender, (x, n), (1.0, Detail::carried(0.0))).x
                    - brute_force(&solver, nodes, Some(x)))
                .abs(),
            ];
            worst.iter_mut().zip(off).for_each(|(worst, off)| *worst = worst.max(off));
        }
        let [single, toward, at] = worst;
        assert!(single > 0.5, "one direction is not enough: {single} of the peak");
        assert!(toward < 0.05 && at < 0.1, "{toward}, {at} of the peak; {single} by one direction");
    }

    /// What comes from a mirror image close behind the sender fans out: it brings less than what leaves all over the sender in one direction.
    #[test]
    fn mirror_images_are_seen_in_other_directions_from_other_places() {
        let toward = |behind: f32| {
            let (solver, nodes @ [sender, receiver]) = squares(0.4, Vec3::new(0.2, 0.1, 1.0), (20.0, behind));
            (solver.light().directional_toward(sender, receiver).x, brute_force(&solver, nodes, None))
        };
        let ((near, truth), (_, far)) = (toward(0.5), toward(f32::INFINITY));
        assert!((near / truth - 1.0).abs() < 0.05, "{near} of {truth}");
        assert!((far / truth - 1.0).abs() > 0.5, "{far} from far away, {truth} from near by");
    }

    /// A lobe that is narrower than its sender is wide, as it is seen from all over a surface.
    #[test]
    fn narrow_lobes_are_smooth_where_they_are_shown() {
        let (solver, [sender, receiver]) = squares(0.3, Vec3::new(0.3, 0.1, 2.0), (300.0, f32::INFINITY));
        let (light, mut worst) = (solver.light(), [0.0_f32; 2]);
        let element = light.element(receiver);
        let geometry = &solver.scene.surfaces()[element.source as usize];
        for i in 0..25 {
            let [s, t] = [i / 5, i % 5].map(|step| 0.1 + 0.2 * step as f32);
            let (x, n) = geometry.sample(element.domain, s, t);
            let (truth, factor) = (brute_force(&solver, [sender, receiver], Some(x)), light.factor_at(x, n, sender));
            for (worst, detail) in worst.iter_mut().zip([Detail::shown(0.0), Detail::carried(0.0)]) {
                *worst = worst.max((light.directional_at(sender, (x, n), (factor, detail)).x - truth).abs());
            }
        }
        let [shown, carried] = worst;
        assert!(shown < 0.01 && carried < 0.02, "{shown}, on its way {carried} of the peak");
    }

    /// A point of a wall next to a floor that sends most along itself, as what is smooth does of light from afar.
    #[test]
    fn points_in_corners_see_what_is_next_to_them() {
        let (solver, [sender, _]) = squares(0.0, Vec3::new(-1.0, 0.0, 0.1), (8.0, f32::INFINITY));
        let light = solver.light();
        let element = light.element(sender);
        let floor = &solver.scene.surfaces()[element.source as usize];
        for height in [0.005, 0.02, 0.05] {
            let (x, n) = (floor.sample(element.domain, 0.0, 0.5).0 + Vec3::Z * (height * element.radius), Vec3::X);
            let (mut sum, mut all) = (0.0, 0.0);
            // Squares of steps: fine next to the wall.
            let steps = 600;
            for i in 0..steps * steps {
                let [u, v] = [i / steps, i % steps].map(|k| (k as f32 + 0.5) / steps as f32);
                let (s, m) = floor.sample(element.domain, u * u, v);
                let toward = (s - x).normalize();
                let kernel = u * toward.dot(n).max(0.0) * (-toward).dot(m).max(0.0) / s.distance_squared(x);
                all += kernel;
                sum += kernel * PI * solver.field.radiance(&(), -toward).x;
            }
            let (truth, factor) = (sum / all, light.factor_at(x, n, sender));
            let [carried, shown] = [Detail::carried(0.0), Detail::shown(0.0)]
                .map(|detail| light.directional_at(sender, (x, n), (factor, detail)).x);
            // Points all over the floor are enough for what is on its way, but not for what is shown.
            assert!((shown / truth - 1.0).abs() < 0.15, "{shown} of {truth} at {height}");
            assert!(
                (carried / truth - 1.0).abs() > 0.2,
                "{carried} of {truth} by points, which are enough then, at {height}"
            );
        }
    }

    /// A part that other leaves stand for sends as much less than they as it reflects less, however closely it is looked at.
    #[test]
    fn parts_send_as_much_as_they_reflect() {
        let (mut solver, [standing, part]) = squares(0.0, Vec3::NEG_Z, (2.0, f32::INFINITY));
        solver.exitant.reflected_as[part as usize] = standing;
        solver.exitant.directional[standing as usize] = Rgb::splat(0.5);
        let mut sent = |share: f32| {
            solver.exitant.directional[part as usize] = Rgb::splat(share * 0.5);
            let light = solver.light();
            let seen_from =
                |x: Vec3, n: Vec3, detail| light.directional_at(part, (x, n), (light.factor_at(x, n, part), detail)).x;
            let Element { center, radius, .. } = *light.element(part);
            let corner = light.scene.surfaces()[light.element(part).source as usize]
                .sample(light.element(part).domain, 0.0, 0.5)
                .0;
            let inward = (center - corner).normalize();
            [
                light.directional(part, Vec3::NEG_Z).x,
                light.directional_toward(part, standing).x,
                seen_from(light.element(standing).center, Vec3::Z, Detail::carried(0.0)),
                seen_from(corner - Vec3::Z * (0.02 * radius), inward, Detail::shown(0.0)),
            ]
        };
        let (alike, fifth, dark) = (sent(1.0), sent(0.2), sent(0.0));
        for (alike, fifth) in alike.into_iter().zip(fifth) {
            assert!(alike > 0.0 && (fifth / alike - 0.2).abs() < 1e-5, "{fifth} of {alike}");
        }
        assert_eq!(dark, [0.0; 4], "a lamp that reflects nothing beside what reflects");
    }

    /// Where little is at stake, or both ends are far from each other, one direction is asked for.
    #[test]
    fn what_cannot_matter_is_not_looked_at() {
        let (solver, [sender, receiver]) = squares(0.0, Vec3::Z, (30.0, f32::INFINITY));
        let light = solver.light();
        let single = light.directional(sender, Vec3::Z);
        let (x, n) = (light.element(receiver).center, light.element(receiver).normals.axis);
        assert_ne!(light.directional_at(sender, (x, n), (1.0, Detail::carried(0.9))), single);
        assert_eq!(light.directional_at(sender, (x, n), (1.0, Detail::carried(1.1))), single, "at most 1 is sent");
        assert!(light.is_wide(sender, x, 0.5) && !light.is_wide(sender, Vec3::splat(100.0), 0.5));
    }

    /// A sender is negligible by what most directions get of it, not by a peak that few do; but not where the peak may be most of what there is.
    #[test]
    fn what_is_not_likely_to_matter_is_not_looked_at() {
        // Radius²/distance² times the peak's radiosity is 1/8.
        for (exponent, looked, taken_evenly) in [(40.0, 0.047, 0.048), (300.0, 0.0078, 0.0079)] {
            let (mut solver, [sender, receiver]) = squares(0.0, Vec3::Z, (exponent, f32::INFINITY));
            let mean = 2.0 / (exponent + 2.0);
            solver.exitant.directional[sender as usize] = Rgb::splat(mean);
            let light = solver.light();
            let (x, n) = (light.element(receiver).center, light.element(receiver).normals.axis);
            let with = |negligible: f32| light.arriving_at(x, n, sender, Detail::carried(negligible));
            assert_eq!(with(looked), with(0.0), "exponent {exponent}");
            let (evenly, share) = with(taken_evenly);
            assert_eq!(evenly, Rgb::splat(mean) * share, "exponent {exponent}");
            assert_ne!(evenly, with(0.0).0, "exponent {exponent}");
        }
    }
}

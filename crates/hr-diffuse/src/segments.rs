//! Segments between random points of two elements: how much of the sender does the receiver see?

use crate::LightKind;
use crate::footprint::Spot;
use crate::geometry::{Domain, Geometry};
use crate::hierarchy::{Element, Elements, Kind, SceneData};
use crate::hooks::LightField;
use crate::sampling::{hash, number, point2, point4, unit};
use crate::transport::{Exitant, Light};
use crate::visibility::Proof;
use glam::{Vec2, Vec3};
use smallvec::SmallVec;
use std::ops::AddAssign;

/// Parts of surfaces nearer than this many radii are drawn from by parts, …
const NEAR: f32 = 2.0;
/// … over so many levels.
const NEAR_LEVELS: u32 = 4;
/// Radiosities that differ by no more than this share are taken to be the same.
const EVENLY: f32 = 0.1;

/// Of a sender's parts dim ones are drawn so seldom that they count for many when its view is estimated: for no more than these.
const MOST_FOR_DIM: f32 = 1e3;

/// How far away distant light is taken to come from: outside of unit space and half as much around it, from
/// wherever in there.
pub(crate) const DISTANT: f32 = 4.0;

/// A point on a surface below a node.
#[derive(Clone, Copy, Debug)]
struct Point {
    at: Vec3,
    normal: Vec3,
    surface: u32,
    /// Area of the part of the surface that the point was drawn from.
    area: f32,
    /// How much rarer the point was drawn than by area and density.
    rarity: f32,
    /// Density there over the mean of the node.
    density: f32,
}

/// How densely the points of a node are drawn.
#[derive(Clone, Copy, Debug)]
enum Density<'a> {
    Uniform,
    /// By power: what a lamp among walls sends is not seen where the walls are.
    Power(&'a Exitant),
    /// Where light is of importance; what nothing reaches does not count as hidden.
    Receiving,
}

impl Density<'_> {
    /// Relative density of a node's points.
    fn of(self, elements: &Elements, node: usize) -> f32 {
        match self {
            Self::Uniform => 1.0,
            Self::Power(exitant) => exitant.radiosity[node].element_sum() + f32::MIN_POSITIVE,
            Self::Receiving if elements.nodes[node].importance > 0.0 => elements.exposed(node as u32),
            Self::Receiving => 0.0,
        }
    }

    /// Whether it is about the same all over a part of a surface.
    fn is_even(self, elements: &Elements, node: usize) -> bool {
        match self {
            Self::Uniform => true,
            Self::Power(exitant) => {
                let [low, high] = exitant.range[node];
                (high - low).max_element() <= EVENLY * high.max_element()
            }
            Self::Receiving => elements.exposed(node as u32) >= 1.0,
        }
    }
}

/// Draws a point below a node: down the tree in proportion to each child's area and density, then uniformly on the
/// surface. Children near `from` are drawn more often than that, as more of what leaves them goes there.
fn draw(
    scene: &SceneData,
    elements: &Elements,
    mut node: u32,
    (mut choice, u): (f32, Vec2),
    density: Density<'_>,
    from: Option<Vec3>,
) -> Option<Point> {
    let mut rarity = 1.0;
    let mean = density.of(elements, node as usize);
    loop {
        let element = &elements.nodes[node as usize];
        if element.kind == Kind::Light {
            return None;
        }
        let near = |from: Vec3| from.distance_squared(element.center) < NEAR * NEAR * element.radius * element.radius;
        let whole = element.is_patch() && !from.is_some_and(near) && density.is_even(elements, node as usize);
        if whole || element.child_count == 0 {
            let geometry = &scene.surfaces()[element.source as usize];
            let part = match from {
                Some(from) => draw_part(geometry, element, from, choice),
                None => Part { domain: element.domain, area: element.area, rarity: 1.0 },
            };
            let (at, normal) = geometry.sample(part.domain, u.x, u.y);
            let normal = if element.kind == Kind::Back { -normal } else { normal };
            let (surface, area) = (element.source, part.area);
            let density = density.of(elements, node as usize) / mean;
            return Some(Point { at, normal, surface, area, rarity: rarity * part.rarity, density });
        }
        let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
        let nearness = |element: &Element| match from {
            Some(from) => (from.distance_squared(element.center) + element.radius * element.radius).max(1e-20).recip(),
            None => 1.0,
        };
        let (mut even, mut total) = (0.0, 0.0);
        let mut weights: SmallVec<[f32; 4]> = SmallVec::new();
        for child in children.clone() {
            let plain = elements.nodes[child].area * density.of(elements, child);
            let weight = plain * nearness(&elements.nodes[child]);
            even += plain;
            total += weight;
            weights.push(weight);
        }
        let (child, rest) = pick(weights.into_iter(), choice, total)?;
        (node, choice) = ((children.start + child) as u32, rest);
        rarity *= total / (even * nearness(&elements.nodes[node as usize])).max(f32::MIN_POSITIVE);
    }
}

/// A random point of a node that receives, by area, with the normal there and its surface, from three numbers in 0…1. `None` where
/// light is of no importance.
pub(crate) fn receiving_point<L: LightField>(
    Light { scene, elements, .. }: Light<'_, L>,
    node: u32,
    (choice, u): (f32, Vec2),
) -> Option<(Vec3, Vec3, u32)> {
    let point = draw(scene, elements, node, (choice, u), Density::Receiving, None)?;
    Some((point.at, point.normal, point.surface))
}

/// A part of a surface that a point is drawn from.
struct Part {
    domain: Domain,
    area: f32,
    rarity: f32,
}

/// Draws a part of a patch that is near `from`: the kernel has a pole where two surfaces touch, and points spread evenly would
/// seldom fall where most of the light passes.
fn draw_part(geometry: &Geometry, element: &Element, from: Vec3, mut choice: f32) -> Part {
    let mut drawn = Part { domain: element.domain, area: element.area, rarity: 1.0 };
    let (mut radius, mut apart) = (element.radius, from.distance_squared(element.center));
    for _ in 0..NEAR_LEVELS {
        if apart > NEAR * NEAR * radius * radius {
            break;
        }
        radius *= 0.5;
        let (mut even, mut total) = (0.0, 0.0);
        let domains = geometry.split(drawn.domain);
        // By part: area, squared distance, weight.
        let mut parts = [(0.0, 0.0, 0.0); 4];
        for (part, &domain) in parts.iter_mut().zip(&domains) {
            let (area, apart) = (geometry.area(domain), geometry.point(geometry.middle(domain)).distance_squared(from));
            let weight = area / (apart + radius * radius).max(1e-20);
            even += area;
            total += weight;
            *part = (area, apart, weight);
        }
        let Some((picked, rest)) = pick(parts.iter().map(|part| part.2), choice, total) else { break };
        let (domain, (area, distance, weight)) = (domains[picked], parts[picked]);
        let rarity = drawn.rarity * total * area / (even * weight).max(f32::MIN_POSITIVE);
        (drawn, apart, choice) = (Part { domain, area, rarity }, distance, rest);
    }
    drawn
}

/// Picks one of several by their weights, which sum to `total`, with a number in 0…1; returns what is left of the number,
/// scaled to 0…1 again. `None` where all weights are 0.
pub(crate) fn pick(weights: impl Iterator<Item = f32>, choice: f32, total: f32) -> Option<(usize, f32)> {
    let mut rest = choice * total;
    let mut picked = None;
    for (i, weight) in weights.enumerate() {
        if weight > 0.0 {
            picked = Some((i, (rest / weight).clamp(0.0, 0.999_999)));
            if rest < weight {
                break;
            }
            rest -= weight;
        }
    }
    picked
}

/// Of points that do not face each other, so many pairs are drawn before a segment is given up: of closed objects every
/// other point looks away.
const TRIES: u32 = 6;

/// The seed of an attempt: each has a sequence of its own. Points further on in the same one lie always as far from those that did not
/// face each other, so that parts of what does would be drawn too seldom.
fn again(seed: u32, attempt: u32) -> u32 {
    seed ^ attempt.wrapping_mul(0x9E37)
}

/// Visibility estimated by the segments of a range of a sequence, of which something is proved: the weight (the transfer's kernel) that is not blocked, that of all,
/// and the number of rays shot. All 0 where no drawn pair faced each other.
#[must_use]
pub(crate) fn visibility<L: LightField>(
    light: Light<'_, L>,
    receiver: u32,
    sender: u32,
    (seed, range): (u32, std::ops::Range<u32>),
    (proof, blocker): (&Proof, &mut u32),
) -> (f32, f32, u32) {
    let segments =
        range.filter_map(|i| (0..TRIES).find_map(|attempt| segment(light, receiver, sender, (seed, i, attempt))));
    let (seen, total, rays) = shoot(light.scene, segments, (proof, blocker));
    (seen.light, total.light, rays)
}

/// Shoots segments: the weights that are not blocked, those of all, and the number of rays.
fn shoot(
    scene: &SceneData,
    segments: impl Iterator<Item = Segment>,
    (proof, blocker): (&Proof, &mut u32),
) -> (Visible, Visible, u32) {
    let (mut seen, mut total, mut rays) = (Visible::default(), Visible::default(), 0);
    for segment in segments {
        rays += 1;
        total += segment.weight;
        if !scene.visibility.occluded_given(proof, segment.from, segment.to, segment.surfaces, blocker) {
            seen += segment.weight;
        }
    }
    (seen, total, rays)
}

/// A segment between two points that face each other.
struct Segment {
    from: Vec3,
    to: Vec3,
    surfaces: [u32; 2],
    weight: Visible,
}

/// What is seen of a sender: its shares of the light that it sends, and of the view that it takes up. Where it is bright it may be hidden,
/// or where it is dark.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Visible {
    pub(crate) light: f32,
    pub(crate) view: f32,
}

impl Visible {
    /// As much of the one as of the other.
    fn all(share: f32) -> Self {
        Self { light: share, view: share }
    }

    fn share_of(self, total: Self) -> Self {
        let share = |part: f32, of: f32| if of > 0.0 { part / of } else { 0.0 };
        Self { light: share(self.light, total.light), view: share(self.view, total.view) }
    }
}

impl AddAssign for Visible {
    fn add_assign(&mut self, other: Self) {
        self.light += other.light;
        self.view += other.view;
    }
}

/// One attempt at the segment of an index: `None` where its points do not face each other.
fn segment<L: LightField>(
    Light { scene, elements, exitant, .. }: Light<'_, L>,
    receiver: u32,
    sender: u32,
    (seed, i, attempt): (u32, u32, u32),
) -> Option<Segment> {
    let round = again(seed, attempt);
    let u = point4(round, i);
    let choices = [unit(hash(round ^ 0x5bd1, i)), unit(hash(round ^ 0x1b87, i))];
    let (on, of) = ((choices[0], Vec2::new(u.x, u.y)), (choices[1], Vec2::new(u.z, u.w)));
    let on_receiver = |from| draw(scene, elements, receiver, on, Density::Receiving, from);
    let on_sender = |from| draw(scene, elements, sender, of, Density::Power(exitant), from);
    let (target, source) = (&elements.nodes[receiver as usize], &elements.nodes[sender as usize]);
    if source.kind == Kind::Light {
        let r = on_receiver(None)?;
        let (to, weight) = light_segment(scene, source.source as usize, r.at, r.normal);
        let (surfaces, weight) = ([r.surface, u32::MAX], Visible::all(weight));
        return (weight.light > 0.0).then_some(Segment { from: r.at, to, surfaces, weight });
    }
    // Of the larger one most of what matters is near the other.
    let (r, s, part) = if target.radius > source.radius {
        let s = on_sender(None)?;
        let r = on_receiver(Some(s.at))?;
        (r, s, r)
    } else {
        let r = on_receiver(None)?;
        let s = on_sender(Some(r.at))?;
        (r, s, s)
    };
    between((r.at, r.normal, r.surface), &s, part)
}

/// The segment from a point with normal and surface to one of a sender, weighted by the transfer's kernel; `part` is the one of
/// both ends that was drawn for the other.
fn between((x, n, surface): (Vec3, Vec3, u32), s: &Point, part: Point) -> Option<Segment> {
    let to = s.at - x;
    let d2 = to.length_squared();
    let (a, b) = (to.dot(n), -to.dot(s.normal));
    let faces = a > 0.0 && b > 0.0 && d2 > 0.0;
    let light = kernel(a * b, d2, part.area) * part.rarity;
    let weight = Visible { light, view: light * s.density.recip().min(MOST_FOR_DIM) };
    faces.then_some(Segment { from: x, to: s.at, surfaces: [surface, s.surface], weight })
}

/// The transfer's kernel by the product of both cosines × distance, the squared distance and the area of the part that a point
/// was drawn from. Surfaces may be so small and near that its square is 0 in f32.
fn kernel(product: f32, d2: f32, area: f32) -> f32 {
    product / d2 / (d2 + area).max(1e-30)
}

/// Whether any of `count` random pairs of points on two nodes face each other. Neighbouring parts of a convex object,
/// which no bound by boxes and cones can tell apart from others, never do.
#[must_use]
pub(crate) fn any_facing<L: LightField>(light: Light<'_, L>, receiver: u32, sender: u32, count: u32) -> bool {
    let (scene, elements) = (light.scene, light.elements);
    let seed = hash(receiver, sender) ^ 0x7fac;
    (0..count).any(|i| {
        let u = point4(seed, i);
        let choices = [unit(hash(seed ^ 0x5bd1, i)), unit(hash(seed ^ 0x1b87, i))];
        let r = draw(scene, elements, receiver, (choices[0], Vec2::new(u.x, u.y)), Density::Uniform, None);
        let s = draw(scene, elements, sender, (choices[1], Vec2::new(u.z, u.w)), Density::Uniform, None);
        let (Some(r), Some(s)) = (r, s) else { return true };
        let to = s.at - r.at;
        to.dot(r.normal) > 0.0 && to.dot(s.normal) < 0.0
    })
}

/// End of a segment from `x` toward a light without extent, and the cosine at `x`.
pub(crate) fn light_segment(scene: &SceneData, light: usize, x: Vec3, n: Vec3) -> (Vec3, f32) {
    match scene.lights[light].kind {
        LightKind::Directional { direction } => (x - direction * DISTANT, -direction.dot(n)),
        _ => {
            let at = scene.light_positions[light];
            (at, (at - x).normalize_or_zero().dot(n))
        }
    }
}

/// Share of a sender's light that is seen from some points, told by index, from `count` segments; 0 where none faces them.
#[must_use]
pub(crate) fn visibility_at<L: LightField>(
    light: Light<'_, L>,
    from: impl Fn(u32) -> Spot,
    sender: u32,
    (count, seed): (u32, u32),
) -> f32 {
    visible_at(light, from, sender, (count, seed)).light
}

/// What is seen of a sender from some points, as [`visibility_at`].
#[must_use]
pub(crate) fn visible_at<L: LightField>(
    Light { scene, elements, exitant, .. }: Light<'_, L>,
    from: impl Fn(u32) -> Spot,
    sender: u32,
    (count, seed): (u32, u32),
) -> Visible {
    let source = &elements.nodes[sender as usize];
    let mut blocker = u32::MAX;
    if source.kind == Kind::Light {
        let mut is_free = |i: &u32| {
            let (x, n, surface) = from(*i);
            let (to, cosine) = light_segment(scene, source.source as usize, x, n);
            cosine > 0.0 && !scene.visibility.occluded(x, to, [surface, u32::MAX], &mut blocker)
        };
        return Visible::all((0..count).filter(|i| is_free(i)).count() as f32 / count.max(1) as f32);
    }
    let seed = hash(seed, sender);
    let segment = |i: u32, attempt: u32| {
        let (round, (x, n, surface)) = (again(seed, attempt), from(i));
        let drawn = (number(round, i), point2(round, i));
        let s = draw(scene, elements, sender, drawn, Density::Power(exitant), Some(x))?;
        between((x, n, surface), &s, s)
    };
    let segments = (0..count).filter_map(|i| (0..TRIES).find_map(|attempt| segment(i, attempt)));
    let (seen, total, _) = shoot(scene, segments, (&Proof::Unknown, &mut blocker));
    seen.share_of(total)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;

    /// A floor and a ceiling that is bright in one corner; a sheet between them hides all but that corner.
    fn solver() -> (Solver, [u32; 2]) {
        let quad = |z: f64, a: DVec3, b: DVec3| {
            Shape::Quad([0.0, 1.0, 2.0, 3.0].map(|i| {
                let at = DVec3::new(0.0, 0.0, z);
                if i == 0.0 {
                    at
                } else if i == 1.0 {
                    at + a
                } else if i == 2.0 {
                    at + a + b
                } else {
                    at + b
                }
            }))
        };
        let (x, y) = (DVec3::X, DVec3::Y);
        let shapes = vec![quad(0.0, x, y), quad(1.0, y, x)];
        let [low, mid, high] = [0.0, 0.5, 1.0];
        let part = |from: [f64; 2], to: [f64; 2]| {
            let corner = |x: f64, y: f64| DVec3::new(x, y, 0.99);
            Shape::Quad([
                corner(from[0], from[1]),
                corner(to[0], from[1]),
                corner(to[0], to[1]),
                corner(from[0], to[1]),
            ])
        };
        let sheets = [part([mid, low], [high, high]), part([low, mid], [mid, high])];
        let surfaces = shapes.into_iter().chain(sheets).map(|shape| Surface::new(shape, 0)).collect();
        let material = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ZERO, two_sided: true };
        let input = SceneInput { surfaces, materials: vec![material], ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.1), ()).expect("the scene is sound");
        let [floor, ceiling] = [0, 1].map(|surface| solver.elements.surface_nodes[surface][0]);
        solver.elements.split(&solver.scene, ceiling);
        let count = solver.elements.nodes.len();
        let exitant = &mut solver.exitant;
        exitant.radiosity.resize(count, Rgb::splat(0.01));
        exitant.range.resize(count, [Rgb::splat(0.01); 2]);
        (solver, [floor, ceiling])
    }

    /// What is seen of a sender counts by its power, not by its area.
    #[test]
    fn what_is_seen_is_weighed_by_radiosity() {
        let (mut solver, [floor, ceiling]) = solver();
        let element = solver.elements.nodes[ceiling as usize];
        let children = element.first_child..element.first_child + element.child_count;
        let bright = children.clone().find(|&child| {
            let at = solver.scene.normalization.to_scene(solver.elements.nodes[child as usize].center);
            at.x < 0.5 && at.y < 0.5
        });
        let bright = bright.expect("one of four parts is in the corner") as usize;
        let see = |solver: &Solver| {
            let mut blocker = u32::MAX;
            let (seen, total, rays) =
                visibility(solver.light(), floor, ceiling, (1, 0..512), (&Proof::Unknown, &mut blocker));
            assert!(rays > 500, "the two face each other: {rays}");
            seen / total
        };
        let even = see(&solver);
        assert!((even - 0.25).abs() < 0.05, "a fourth of it is open: {even}");
        solver.exitant.radiosity[bright] = Rgb::ONE;
        solver.exitant.range[ceiling as usize] = [Rgb::splat(0.01), Rgb::ONE];
        let (seen, bright_share) = (see(&solver), 1.0 / 1.03);
        assert!((seen - bright_share).abs() < 0.05, "nearly all of its light passes: {seen}");
    }

    /// Where most of a sender is dark and hidden, most of its light is seen, but little of it.
    #[test]
    fn what_is_seen_of_the_view_counts_by_area() {
        let (mut solver, [floor, ceiling]) = solver();
        let element = solver.elements.nodes[ceiling as usize];
        let lit = |child: &u32| {
            let at = solver.scene.normalization.to_scene(solver.elements.nodes[*child as usize].center);
            at.x < 0.5 && at.y < 0.5
        };
        let children = element.first_child..element.first_child + element.child_count;
        let bright = children.clone().find(lit);
        let (least, most) = (Rgb::splat(0.1), Rgb::ONE);
        children.for_each(|child| solver.exitant.radiosity[child as usize] = least);
        solver.exitant.radiosity[bright.expect("one of four parts is in the corner") as usize] = most;
        solver.exitant.radiosity[ceiling as usize] = (most + 3.0 * least) / 4.0;
        solver.exitant.range[ceiling as usize] = [least, most];
        let floor = solver.elements.nodes[floor as usize];
        let from = |_| (floor.center, floor.normals.axis, floor.source);
        let visible = visible_at(solver.light(), from, ceiling, (4096, 1));
        assert!((visible.light - 1.0 / 1.3).abs() < 0.02, "most of its light: {visible:?}");
        assert!((visible.view - 0.25).abs() < 0.02, "a fourth of it: {visible:?}");
    }

    /// The larger of two elements is drawn from near the smaller one: the same as with many segments between plain points.
    #[test]
    fn small_elements_below_large_ones_see_what_is_there() {
        let (solver, [floor, ceiling]) = solver();
        let part = solver.elements.nodes[ceiling as usize].first_child;
        for pair in [[floor, part], [part, floor], [floor, ceiling]] {
            let [few, many] = [64, 8192].map(|count| {
                let mut blocker = u32::MAX;
                let (seen, total, _) =
                    visibility(solver.light(), pair[0], pair[1], (1, 0..count), (&Proof::Unknown, &mut blocker));
                seen / total
            });
            assert!((few - many).abs() < 0.12, "{pair:?}: {few}, {many}");
        }
    }

    /// Half of a ball does not face what is above it. A disk above its pole hides as much of the other half as independent points find.
    #[test]
    fn all_that_faces_is_drawn_as_often() {
        let sphere = Shape::Sphere { center: DVec3::ZERO, radius: 0.1 };
        let disk = Shape::Ring { center: DVec3::Z * 0.11, normal: DVec3::Z, inner: 0.0, outer: 0.02 };
        let corner = |x: f64, y: f64| DVec3::new(0.1 * x, 0.1 * y, 1.0);
        let plate = Shape::Quad([corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)]);
        let surfaces = [plate, sphere, disk].map(|shape| Surface::new(shape, 0)).to_vec();
        let material = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ONE, two_sided: true };
        let input = SceneInput { surfaces, materials: vec![material], ..SceneInput::default() };
        let solver = Solver::new(&input, Settings::with_error(0.1), ()).expect("the scene is sound");
        let (light, [plate, ball]) = (solver.light(), [0, 1].map(|at| solver.elements.surface_nodes[at][0]));
        let (mut seen, mut total) = (0.0_f64, 0.0_f64);
        for seed in 0..4096 {
            let few = visibility(light, plate, ball, (seed, 0..16), (&Proof::Unknown, &mut u32::MAX.clone()));
            (seen, total) = (seen + f64::from(few.0), total + f64::from(few.1));
        }
        let by_segments = seen / total;
        let (mut free, mut all) = (0.0_f64, 0.0_f64);
        for i in 0..1 << 18 {
            let number = |k: u32| unit(hash(i, k));
            let at = |node: u32, k: u32| {
                let element = &solver.elements.nodes[node as usize];
                let geometry = &light.scene.surfaces()[element.source as usize];
                geometry.sample_area(element.domain, number(k), number(k + 1))
            };
            let ((x, n, _), (y, m, area)) = (at(plate, 1), at(ball, 3));
            let to = y - x;
            let weight = area * to.dot(n).max(0.0) * (-to.dot(m)).max(0.0) / to.length_squared().powi(2);
            if weight > 0.0 {
                all += f64::from(weight);
                let hidden = light.scene.visibility.occluded(x, y, [0, 1], &mut u32::MAX.clone());
                free += if hidden { 0.0 } else { f64::from(weight) };
            }
        }
        let exact = free / all;
        assert!((0.9..0.99).contains(&exact), "some of it is hidden: {exact}");
        assert!((by_segments - exact).abs() < 0.003, "{by_segments}, not {exact}");
    }
}

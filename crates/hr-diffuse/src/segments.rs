//! Segments between random points of two elements: how much of the sender does the receiver see?

use crate::LightKind;
use crate::geometry::{Domain, Geometry};
use crate::hierarchy::{Element, Elements, Kind, SceneData};
use crate::hooks::LightField;
use crate::sampling::{hash, point2, point4, unit};
use crate::transport::Light;
use glam::{Vec2, Vec3};
use smallvec::SmallVec;

/// Parts of surfaces nearer than this many radii are drawn from by parts, …
const NEAR: f32 = 2.0;
/// … over so many levels.
const NEAR_LEVELS: u32 = 4;

/// A point on a surface below a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub(crate) at: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) surface: u32,
    /// Area of the part of the surface that the point was drawn from.
    pub(crate) area: f32,
    /// How much rarer the point was drawn than by area and density.
    pub(crate) rarity: f32,
}

/// Draws a point below a node: down the tree in proportion to each child's area times `density`, then uniformly on
/// the surface. Children near `from` are drawn more often than that, as more of what leaves them goes there.
pub(crate) fn draw(
    scene: &SceneData,
    elements: &Elements,
    mut node: u32,
    mut choice: f32,
    u: Vec2,
    density: impl Fn(usize) -> f32,
    from: Option<Vec3>,
) -> Option<Point> {
    let mut rarity = 1.0;
    loop {
        let element = &elements.nodes[node as usize];
        match element.kind {
            Kind::Light => return None,
            Kind::Front | Kind::Back => {
                let geometry = &scene.surfaces()[element.source as usize];
                let part = match from {
                    Some(from) => draw_part(geometry, element, from, choice),
                    None => Part { domain: element.domain, area: element.area, rarity: 1.0 },
                };
                let (at, normal, _) = geometry.sample_area(part.domain, u.x, u.y);
                let normal = if element.kind == Kind::Back { -normal } else { normal };
                let (surface, area) = (element.source, part.area);
                return Some(Point { at, normal, surface, area, rarity: rarity * part.rarity });
            }
            Kind::Cluster => {
                let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
                let plain = |child: usize| elements.nodes[child].area * density(child);
                let nearness = |child: usize| {
                    let (at, radius) = (elements.nodes[child].center, elements.nodes[child].radius);
                    from.map_or(1.0, |from| (from.distance_squared(at) + radius * radius).max(1e-20).recip())
                };
                let weight = |child: usize| plain(child) * nearness(child);
                let total: f32 = children.clone().map(weight).sum();
                let even: f32 = children.clone().map(plain).sum();
                let (child, rest) = pick(children.clone().map(weight), choice, total)?;
                (node, choice) = ((children.start + child) as u32, rest);
                rarity *= total / (even * nearness(node as usize)).max(f32::MIN_POSITIVE);
            }
        }
    }
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
        let weigh = |&domain: &Domain| {
            let (area, apart) = (geometry.area(domain), geometry.point(geometry.middle(domain)).distance_squared(from));
            (domain, area, apart, area / (apart + radius * radius).max(1e-20))
        };
        let parts: SmallVec<[(Domain, f32, f32, f32); 4]> = geometry.split(drawn.domain).iter().map(weigh).collect();
        let (even, total) = parts.iter().fold((0.0, 0.0), |(even, total), part| (even + part.1, total + part.3));
        let Some((picked, rest)) = pick(parts.iter().map(|part| part.3), choice, total) else { break };
        let (domain, area, distance, weight) = parts[picked];
        let rarity = drawn.rarity * total * area / (even * weight).max(f32::MIN_POSITIVE);
        (drawn, apart, choice) = (Part { domain, area, rarity }, distance, rest);
    }
    drawn
}

/// Picks one of several by their weights, which sum to `total`, with a number in 0…1; returns what is left of the number,
/// scaled to 0…1 again. `None` where all weights are 0.
fn pick(weights: impl Iterator<Item = f32>, choice: f32, total: f32) -> Option<(usize, f32)> {
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

/// Visibility estimated by the segments of a range: the weight (the transfer's kernel) that is not blocked, that of all,
/// and the number of rays shot. All 0 where no drawn pair faced each other.
#[must_use]
pub(crate) fn visibility<L: LightField>(
    Light { scene, elements, exitant, .. }: Light<'_, L>,
    receiver: u32,
    sender: u32,
    range: std::ops::Range<u32>,
    blocker: &mut u32,
) -> (f32, f32, u32) {
    // Points of a sender are drawn by their power: what a lamp among walls sends is not seen where the walls are.
    let power = |child: usize| exitant.radiosity[child].element_sum() + f32::MIN_POSITIVE;
    let seed = hash(receiver, sender);
    let (mut seen, mut total, mut rays) = (0.0, 0.0, 0);
    let source = &elements.nodes[sender as usize];
    for i in range {
        for attempt in 0..TRIES {
            let (index, round) = (i + attempt * 0x1_0000, seed ^ attempt.wrapping_mul(0x9E37));
            let u = point4(seed, index);
            let choices = [unit(hash(round ^ 0x5bd1, i)), unit(hash(round ^ 0x1b87, i))];
            let important = |child: usize| if elements.nodes[child].importance > 0.0 { 1.0 } else { 0.0 };
            let Some(r) = draw(scene, elements, receiver, choices[0], Vec2::new(u.x, u.y), important, None) else {
                continue;
            };
            let (target, weight, surface) = match source.kind {
                Kind::Light => {
                    let (to, cosine) = light_segment(scene, source.source as usize, r.at, r.normal);
                    (to, cosine, u32::MAX)
                }
                _ => {
                    let Some(s) = draw(scene, elements, sender, choices[1], Vec2::new(u.z, u.w), power, Some(r.at))
                    else {
                        continue;
                    };
                    let to = s.at - r.at;
                    let d2 = to.length_squared();
                    let (a, b) = (to.dot(r.normal), -to.dot(s.normal));
                    let weight =
                        if a > 0.0 && b > 0.0 && d2 > 0.0 { kernel(a * b, d2, s.area) * s.rarity } else { 0.0 };
                    (s.at, weight, s.surface)
                }
            };
            if weight > 0.0 {
                rays += 1;
                total += weight;
                if !scene.visibility.occluded(r.at, target, [r.surface, surface], blocker) {
                    seen += weight;
                }
                break;
            }
        }
    }
    (seen, total, rays)
}

/// The transfer's kernel by the product of both cosines × distance, the squared distance and the sender's area. Surfaces
/// may be so small and near that its square is 0 in f32.
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
        let r = draw(scene, elements, receiver, choices[0], Vec2::new(u.x, u.y), |_| 1.0, None);
        let s = draw(scene, elements, sender, choices[1], Vec2::new(u.z, u.w), |_| 1.0, None);
        let (Some(r), Some(s)) = (r, s) else { return true };
        let to = s.at - r.at;
        to.dot(r.normal) > 0.0 && to.dot(s.normal) < 0.0
    })
}

/// End of a segment from `x` toward a light without extent, and the cosine at `x`.
pub(crate) fn light_segment(scene: &SceneData, light: usize, x: Vec3, n: Vec3) -> (Vec3, f32) {
    match scene.lights[light].kind {
        // Unit space is the unit cube: two of its lengths away is outside.
        LightKind::Directional { direction } => (x - direction * 2.0, -direction.dot(n)),
        _ => {
            let at = scene.light_positions[light];
            (at, (at - x).normalize_or_zero().dot(n))
        }
    }
}

/// Share of a sender that a point with normal `n` on a surface sees, from `count` segments; 0 where none faces it.
#[must_use]
pub(crate) fn visibility_at<L: LightField>(
    Light { scene, elements, exitant, .. }: Light<'_, L>,
    (x, n, surface): (Vec3, Vec3, u32),
    sender: u32,
    count: u32,
    seed: u32,
) -> f32 {
    let source = &elements.nodes[sender as usize];
    let mut blocker = u32::MAX;
    if source.kind == Kind::Light {
        let (to, cosine) = light_segment(scene, source.source as usize, x, n);
        let free = cosine > 0.0 && !scene.visibility.occluded(x, to, [surface, u32::MAX], &mut blocker);
        return if free { 1.0 } else { 0.0 };
    }
    let power = |child: usize| exitant.radiosity[child].element_sum() + f32::MIN_POSITIVE;
    let seed = hash(seed, sender);
    let (mut seen, mut total) = (0.0, 0.0);
    for i in 0..count {
        for attempt in 0..TRIES {
            let (index, round) = (i + attempt * 0x1_0000, seed ^ attempt.wrapping_mul(0x9E37));
            let choice = unit(hash(round ^ 0x68e3, i));
            let Some(s) = draw(scene, elements, sender, choice, point2(seed, index), power, Some(x)) else { continue };
            let to = s.at - x;
            let d2 = to.length_squared();
            let (a, b) = (to.dot(n), -to.dot(s.normal));
            if a > 0.0 && b > 0.0 && d2 > 0.0 {
                let weight = kernel(a * b, d2, s.area) * s.rarity;
                total += weight;
                if !scene.visibility.occluded(x, s.at, [surface, s.surface], &mut blocker) {
                    seen += weight;
                }
                break;
            }
        }
    }
    if total > 0.0 { seen / total } else { 0.0 }
}

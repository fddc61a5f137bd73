//! The residual of the radiosity equation: how far a solution is from what it should be, found by rays that know nothing of
//! its links.
//!
//! At random leaves the irradiance is gathered anew: over the hemisphere by rays that read the solution where they end, and
//! from emitters by rays toward random points of them. The difference to the solution's own irradiance is what one bounce of
//! light gets wrong (D. Lischinski, B. Smits, D. Greenberg, "Bounds and error estimates for radiosity", SIGGRAPH 1994,
//! section 3). Each leaf is looked at twice: the two estimates' difference tells how much of it is the rays' own noise.

mod linked;

pub(crate) use linked::{Brought, Rays, ReceivingPoint, Senders};

use crate::Rgb;
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::rooms::{NO_ROOM, ROOMS};
use crate::sampling::{cosine_direction, hash, point4, unit};
use crate::segments::{light_segment, pick};
use crate::threads;
use crate::transport::Light;
use crate::visibility::{Hit, NO_BLOCKER};
use glam::{Vec2, Vec3};
use smallvec::SmallVec;
use std::f32::consts::PI;
use std::ops::{ControlFlow, Range};

/// Sides of the grid of directions of one estimate.
const GRID: u32 = 8;
/// Rays of one estimate toward emitters; leaves that are brighter than others get up to `MOST_BRIGHT` times as many.
const TOWARD_EMITTERS: u32 = 32;
const MOST_BRIGHT: f32 = 16.0;
/// The same toward lights without extent.
const TOWARD_LIGHTS: u32 = 16;

/// Rays of one estimate toward what links say that reflected light comes from: what is small, or far away, and narrow lobes are met by
/// few rays of the grid.
const TOWARD_SENDERS: u32 = 32;

/// An error is known if its standard error is less than this share of it.
pub(crate) const KNOWN: f32 = 0.1;
/// Noise of more than this share of what was found makes it seem more: in eight rooms by up to a tenth where there was as much, by up to a
/// fifth where there was more.
const MOST_NOISE: f32 = 0.75;

/// So many times as many leaves look closer, at least and at most.
const LEAST_MORE: f32 = 2.0;
const MOST_MORE: f32 = 4.0;

/// Leaves that a thread looks from between two calls of `watch`: some milliseconds.
const BETWEEN_WATCHES: usize = 32;

/// About how many rays one leaf takes.
pub(crate) const RAYS_PER_LEAF: u64 = 2 * (GRID * GRID + TOWARD_EMITTERS) as u64;

/// What a solution is off by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Residual {
    /// Mean absolute difference of the leaves' irradiance, weighted by what they reflect, relative to its mean …
    pub(crate) absolute: f32,
    /// … and the same with its sign: positive where there should be more light.
    pub(crate) signed: f32,
    /// How much more `absolute` may be (a standard error).
    pub(crate) uncertain: f32,
    /// The rays' own noise in what was found, relative to the mean irradiance; `absolute` is without it.
    pub(crate) noise: f32,
    /// Share of the light that was reflected before.
    pub(crate) indirect: f32,
    /// Rays shot.
    pub(crate) rays: u64,
}

impl Residual {
    /// Light that is missing, relative to all there is.
    pub(crate) fn bias(&self) -> f32 {
        self.signed / (1.0 - self.indirect).max(0.05)
    }

    /// Whether it tells for sure (two standard errors) that the error is no more than this one, or else by how much it is more.
    pub(crate) fn tells(&self, error: f32) -> bool {
        let (found, doubt) = (self.error(), 2.0 * self.uncertain);
        found + doubt <= error || found - doubt > error && self.uncertain < KNOWN * found && !self.is_noisy()
    }

    /// Whether what was found may owe much to the rays' own noise: where few rays find much and most find nothing, that is not all that is
    /// taken off.
    pub(crate) fn is_noisy(&self) -> bool {
        self.noise > MOST_NOISE * self.absolute
    }

    /// Relative L1 error of the solution: what has one sign is repeated by each bounce, the rest averages out.
    pub(crate) fn error(&self) -> f32 {
        let repeated = self.bias();
        let random = (self.absolute * self.absolute - self.signed * self.signed).max(0.0);
        (random + repeated * repeated).sqrt()
    }
}

/// What was found at a leaf (sums of channels).
#[derive(Clone, Copy, Debug)]
struct Found {
    estimates: [f32; 2],
    /// The share of emitters in their mean.
    direct: f32,
    /// What the solution says.
    solution: f32,
    rays: u32,
}

/// How closely a solution is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    /// From so many leaves, …
    pub(crate) leaves: usize,
    /// … over a grid of directions with so many times as many sides as usual, and its square times as many rays toward emitters.
    pub(crate) finer: u32,
}

impl Look {
    /// More rays, where they tell the most whether there is more than an error: four times as many of each leaf, or those of as many more
    /// leaves as should be enough, up to four times as many.
    pub(crate) fn closer(self, found: &Residual, error: f32) -> Self {
        if found.is_noisy() {
            return Self { finer: 2 * self.finer, ..self };
        }
        let [apart, known] = [0.5 * (found.error() - error).abs(), KNOWN * found.error()];
        let enough = if found.error() > error { apart.min(known) } else { apart };
        let more = (found.uncertain / enough).powi(2).clamp(LEAST_MORE, MOST_MORE);
        // Where neither is any number they are as many.
        Self { leaves: ((self.leaves as f32 * more).ceil() as usize).max(self.leaves), ..self }
    }
}

/// Looks at a solution from random leaves, if known with what its links bring; `None` where `watch` breaks.
pub(crate) fn residual<L: LightField>(
    light: Light<'_, L>,
    brought: Option<&Brought<'_>>,
    how: Look,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Residual> {
    // Leaves are drawn by what they reflect: half of them as if all were lit alike, half as they are.
    let weight = |leaf: u32| {
        let element = light.element(leaf);
        // Of covered parts the solution says nothing.
        let counts = element.importance > 0.0 && light.elements.exposed(leaf) >= 1.0;
        if counts { f64::from(element.area * element.importance * light.counted(leaf)) } else { 0.0 }
    };
    let irradiance = |leaf: u32| f64::from(light.exitant.irradiance[leaf as usize].element_sum());
    let (mut area, mut power) = (0.0, 0.0);
    for leaf in light.elements.patch_leaves() {
        area += weight(leaf);
        power += weight(leaf) * irradiance(leaf);
    }
    let mean = power / area;
    let mut sum = 0.0;
    let mut ends: Vec<(u32, f64)> = Vec::new();
    for leaf in light.elements.patch_leaves() {
        let share = weight(leaf) * (mean + irradiance(leaf));
        if share > 0.0 {
            sum += share;
            ends.push((leaf, sum));
        }
    }
    if ends.is_empty() || !sum.is_finite() {
        return Some(Residual::default());
    }
    let emitters = Emitters::new(light);
    let Look { leaves, finer } = how;
    let look = |i: usize| {
        let at = (i as f64 + f64::from(unit(hash(i as u32, 0x51de)))) / leaves as f64 * sum;
        let leaf = ends[ends.partition_point(|&(_, end)| end <= at).min(ends.len() - 1)].0;
        let senders = brought.map(|brought| Senders::of(light, leaf, brought));
        Place { leaf, emitters: &emitters, senders, mean: mean as f32, finer }.look(light, i as u32)
    };
    let mut found: Vec<Found> = Vec::with_capacity(leaves);
    while found.len() < leaves {
        if watch().is_break() {
            return None;
        }
        let each = (BETWEEN_WATCHES / (finer * finer) as usize).max(1);
        let part = found.len()..leaves.min(found.len() + each * threads::current_num_threads());
        found.extend(threads::map_range(part, 1, look));
    }
    let (mut agreed, mut noise) = (Sum::default(), Sum::default());
    let (mut signed, mut total, mut direct, mut rays) = (0.0, 0.0, 0.0, 0);
    for leaf in &found {
        let [a, b] = leaf.estimates.map(f64::from);
        let solution = f64::from(leaf.solution);
        let share = (mean + solution).recip();
        let [off, other] = [a, b].map(|estimate| share * (estimate - solution));
        agreed.add(0.5 * (off.signum() * other + other.signum() * off));
        // Half the difference of the estimates is distributed as the noise of their mean.
        noise.add(0.5 * (off - other).abs());
        signed += 0.5 * (off + other);
        total += share * 0.5 * (a + b);
        direct += share * f64::from(leaf.direct);
        rays += u64::from(leaf.rays);
    }
    if total <= 0.0 {
        return Some(Residual { rays, ..Residual::default() });
    }
    let absolute = without_noise(agreed.sum, noise.sum);
    let more = |agreed, noise| without_noise(agreed, noise) - absolute;
    let uncertain =
        more(agreed.sum.max(0.0) + agreed.doubt(), noise.sum).hypot(more(agreed.sum, noise.sum + noise.doubt()));
    Some(Residual {
        absolute: (absolute / total) as f32,
        signed: (signed / total) as f32,
        uncertain: (uncertain / total) as f32,
        noise: (noise.sum / total) as f32,
        indirect: (1.0 - direct / total).clamp(0.0, 1.0) as f32,
        rays,
    })
}

/// Sum of the absolute values x of what leaves are off by, of which two estimates are known: `agreed`, that of the one with the
/// other's sign, on the mean of both ways round, and `noise`, that of the noise of the mean of both.
///
/// Whatever the noise is, it is independent in both, so that a leaf's part in `agreed` is expected to be |x| where there is none and never
/// more. Where differences and noise are normal, of standard deviations σ and τ for one estimate, it is |x| σ / √(σ² + τ²), and τ is √2
/// times the noise of the mean: solved for |x|. The square root of the difference of squares, which is right there, too, says up to a
/// third too much where a few leaves have most of the noise.
fn without_noise(agreed: f64, noise: f64) -> f64 {
    let agreed2 = agreed.max(0.0).powi(2);
    (0.5 * (agreed2 + (agreed2 * (agreed2 + 8.0 * noise * noise)).sqrt())).sqrt()
}

/// A sum.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    sum: f64,
    squares: f64,
}

impl Sum {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.squares += value * value;
    }

    /// About its standard error.
    fn doubt(&self) -> f64 {
        self.squares.sqrt()
    }
}

/// A few nodes.
type Nodes = SmallVec<[u32; 8]>;

/// What emits.
struct Emitters {
    /// Power below each node, sum of channels, of what has an extent.
    power: Vec<f32>,
    /// Nodes of lights without extent.
    lights: Vec<u32>,
    /// By room, the node of all of it.
    rooms: Vec<u32>,
    /// Nodes of all that is in no room, where there are rooms.
    outside: Nodes,
}

impl Emitters {
    fn new<L: LightField>(light: Light<'_, L>) -> Self {
        let is_light = |&node: &u32| light.element(node).kind == Kind::Light;
        let lights = (0..light.elements.nodes.len() as u32).filter(is_light).collect();
        let mut rooms = Vec::new();
        for node in 0..light.elements.nodes.len() as u32 {
            let room = light.element(node).room as usize;
            // Parents come before what is below them.
            if room < ROOMS as usize && rooms.get(room).is_none_or(|&node| node == u32::MAX) {
                rooms.resize(rooms.len().max(room + 1), u32::MAX);
                rooms[room] = node;
            }
        }
        let outside = children(light, 0).filter(|&node| light.element(node).room == NO_ROOM).collect();
        Self { power: light.emitted_power(), lights, rooms, outside }
    }

    /// Nodes below which is all that a leaf may see.
    fn seen_from<L: LightField>(&self, light: Light<'_, L>, leaf: u32) -> Nodes {
        match self.rooms.get(light.element(leaf).room as usize) {
            Some(&room) => self.outside.iter().copied().chain([room]).collect(),
            None => SmallVec::from_slice(&[0]),
        }
    }

    /// A leaf with extent below some nodes, drawn by its power over its squared distance from `x`, and the probability of that.
    fn pick<L: LightField>(
        &self,
        light: Light<'_, L>,
        mut nodes: Nodes,
        x: Vec3,
        mut choice: f32,
    ) -> Option<(u32, f32)> {
        let mut probability = 1.0;
        loop {
            let weight = |child: u32| {
                let part = light.element(child);
                let apart = x.distance_squared(part.center) + part.radius * part.radius;
                self.power[child as usize] / apart.max(1e-20)
            };
            let mut node = nodes[0];
            if nodes.len() > 1 {
                let total: f32 = nodes.iter().map(|&node| weight(node)).sum();
                let (picked, rest) = pick(nodes.iter().map(|&node| weight(node)), choice, total)?;
                (node, choice) = (nodes[picked], rest);
                probability *= weight(node) / total;
            }
            if light.element(node).child_count == 0 {
                return Some((node, probability));
            }
            nodes = children(light, node).collect();
        }
    }
}

/// The children of a node.
fn children<L: LightField>(light: Light<'_, L>, node: u32) -> Range<u32> {
    let element = light.element(node);
    element.first_child..element.first_child + element.child_count
}

/// A random point of a leaf, with its normal and the [area that it stands for](crate::Shape::sample_area).
fn point<L: LightField>(light: Light<'_, L>, leaf: u32, u: Vec2) -> (Vec3, Vec3, f32) {
    let element = light.element(leaf);
    let (x, normal, area) = light.scene.surfaces()[element.source as usize].sample_area(element.domain, u.x, u.y);
    (x, if element.kind == Kind::Back { -normal } else { normal }, area)
}

/// A leaf that is looked from.
struct Place<'a> {
    leaf: u32,
    emitters: &'a Emitters,
    senders: Option<Senders>,
    /// Mean irradiance of all leaves, sum of channels.
    mean: f32,
    /// See [`Look::finer`].
    finer: u32,
}

impl Place<'_> {
    /// Looks around from all over the leaf.
    fn look<L: LightField>(&self, light: Light<'_, L>, seed: u32) -> Found {
        let &Self { leaf, emitters, mean, finer, .. } = self;
        let solution = light.exitant.irradiance[leaf as usize].element_sum();
        let times = (solution / mean).clamp(1.0, MOST_BRIGHT) * (finer * finer) as f32;
        let count = (TOWARD_EMITTERS as f32 * times) as u32;
        let mut found = Found { estimates: [0.0; 2], direct: 0.0, solution, rays: 0 };
        for half in 0..2 {
            let seed = hash(seed, 0x77 + half);
            let (lights, shot) = from_lights(light, emitters, leaf, (seed, TOWARD_LIGHTS * finer * finer));
            let (surfaces, also) = from_emitters(light, emitters, leaf, (seed, count));
            found.direct += 0.5 * (lights + surfaces);
            let (reflected, looked) = match &self.senders {
                Some(senders) => reflected_by(light, senders, leaf, (seed, finer)),
                None => (reflected(light, leaf, (seed, finer)), (GRID * finer).pow(2)),
            };
            found.estimates[half as usize] = lights + surfaces + reflected;
            found.rays += shot + also + looked;
        }
        found
    }
}

/// Mean irradiance by lights without extent, from `count` rays toward all of them, at least one toward each, and the number that was
/// shot.
fn from_lights<L: LightField>(
    light: Light<'_, L>,
    emitters: &Emitters,
    leaf: u32,
    (seed, count): (u32, u32),
) -> (f32, u32) {
    let surface = light.element(leaf).source;
    let each = count.div_ceil(emitters.lights.len().max(1) as u32);
    let (mut sum, mut rays, mut blocker) = (0.0, 0, NO_BLOCKER);
    for &node in &emitters.lights {
        let index = light.element(node).source as usize;
        for ray in 0..each {
            let u = point4(hash(seed, node), ray);
            let (x, n, _) = point(light, leaf, Vec2::new(u.x, u.y));
            let (to, cosine) = light_segment(light.scene, index, x, n);
            let irradiance = light.scene.lights[index].intensity.element_sum() * light.factor_at(x, n, node);
            if cosine > 0.0 && irradiance > 0.0 {
                rays += 1;
                let hidden = light.scene.visibility.occluded(x, to, [surface, u32::MAX], &mut blocker);
                sum += if hidden { 0.0 } else { irradiance };
            }
        }
    }
    (sum / each as f32, rays)
}

/// Mean irradiance by emitted light, from `count` rays toward random points, and the number that was shot.
fn from_emitters<L: LightField>(
    light: Light<'_, L>,
    emitters: &Emitters,
    leaf: u32,
    (seed, count): (u32, u32),
) -> (f32, u32) {
    if emitters.power[0] <= 0.0 {
        return (0.0, 0);
    }
    let surface = light.element(leaf).source;
    let seen = emitters.seen_from(light, leaf);
    let (mut sum, mut rays, mut blocker) = (0.0, 0, NO_BLOCKER);
    for ray in 0..count {
        let u = point4(seed, ray);
        let (x, n, _) = point(light, leaf, Vec2::new(u.z, u.w));
        let choice = (ray as f32 + unit(hash(seed, ray))) / count as f32;
        let Some((emitter, probability)) = emitters.pick(light, seen.clone(), x, choice) else {
            continue;
        };
        let (at, normal, _) = point(light, emitter, Vec2::new(u.x, u.y));
        let to = at - x;
        let d2 = to.length_squared();
        let cosines = to.dot(n).max(0.0) * (-to.dot(normal)).max(0.0);
        if cosines > 0.0 && d2 > 0.0 {
            rays += 1;
            let skip = [surface, light.element(emitter).source];
            if !light.scene.visibility.occluded(x, at, skip, &mut blocker) {
                sum += emitters.power[emitter as usize] * (cosines / d2) / (PI * d2 * probability);
            }
        }
    }
    (sum / count as f32, rays)
}

/// Points of a leaf, with normals, and stratified directions from there: over a grid with so many sides.
fn around<L: LightField>(
    light: Light<'_, L>,
    leaf: u32,
    (seed, sides): (u32, u32),
) -> impl Iterator<Item = (Vec3, Vec3, Vec3)> {
    (0..sides * sides).map(move |cell| {
        let u = point4(seed ^ 0x3c3c, cell);
        let (x, n, _) = point(light, leaf, Vec2::new(u.z, u.w));
        let direction = (Vec2::new((cell % sides) as f32, (cell / sides) as f32) + Vec2::new(u.x, u.y)) / sides as f32;
        (x, n, cosine_direction(n, direction.x, direction.y))
    })
}

/// Mean irradiance by light that has been reflected, over stratified directions.
fn reflected<L: LightField>(light: Light<'_, L>, leaf: u32, (seed, finer): (u32, u32)) -> f32 {
    let (surface, sides) = (light.element(leaf).source, GRID * finer);
    let found = around(light, leaf, (seed, sides));
    found.map(|(x, _, direction)| reflected_along(light, x, direction, surface)).sum::<f32>() / (sides * sides) as f32
}

/// The same by rays toward senders, too, and the number of rays.
fn reflected_by<L: LightField>(
    light: Light<'_, L>,
    senders: &Senders,
    leaf: u32,
    (seed, finer): (u32, u32),
) -> (f32, u32) {
    let surface = light.element(leaf).source;
    let (sides, count) = (GRID * finer, TOWARD_SENDERS * finer * finer);
    let each = Rays { all_over: (sides * sides) as f32, toward: count as f32 };
    let from = |at, normal| ReceivingPoint { at, normal, surface };
    let found = around(light, leaf, (seed, sides));
    let found = found.map(|(x, n, direction)| senders.all_over(light, from(x, n), direction, each));
    let (mut sum, mut rays) = (found.sum::<f32>(), sides * sides);
    for ray in 0..count {
        let u = point4(seed ^ 0x5e4d, ray);
        let (x, n, _) = point(light, leaf, Vec2::new(u.z, u.w));
        let choice = (ray as f32 + unit(hash(hash(seed, 0x5e), ray))) / count as f32;
        if let Some(found) = senders.toward(light, from(x, n), (choice, Vec2::new(u.x, u.y)), each) {
            (sum, rays) = (sum + found, rays + 1);
        }
    }
    (sum, rays)
}

/// What a ray from a surface meets, and the leaf there.
fn seen_along<L: LightField>(light: Light<'_, L>, x: Vec3, direction: Vec3, surface: u32) -> Option<(Hit, u32)> {
    let hit = light.scene.visibility.closest_except(x, direction, 0.0, f32::MAX, surface)?;
    let leaf = light.elements.leaf_at(light.scene, hit.surface, !hit.front, hit.uv)?.0;
    Some((hit, leaf))
}

/// What a leaf emits of its own.
fn own_light<L: LightField>(light: Light<'_, L>, leaf: u32) -> Rgb {
    let element = light.element(leaf);
    match element.kind {
        Kind::Front => light.scene.materials[element.material as usize].exitance,
        _ => Rgb::ZERO,
    }
}

/// Light that a place of a leaf has reflected toward where a ray in some direction comes from (π times its radiance, sum of channels).
fn reflected_from<L: LightField>(light: Light<'_, L>, (sender, at): (u32, Vec3), direction: Vec3) -> f32 {
    // Rays read the light itself: gains are for what links make of it.
    let away = -direction;
    let light_there = light.diffuse(sender, away) + light.directional_from(sender, at, away);
    (light_there - own_light(light, sender)).max(Rgb::ZERO).element_sum()
}

/// The same by what a ray from a surface meets.
pub(crate) fn reflected_along<L: LightField>(light: Light<'_, L>, x: Vec3, direction: Vec3, surface: u32) -> f32 {
    let seen = seen_along(light, x, direction, surface);
    seen.map_or(0.0, |(hit, sender)| reflected_from(light, (sender, hit.point), direction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::tests::Echo;
    use crate::{DiffuseMaterial, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;

    #[test]
    fn errors_are_clear_that_are_known_or_small() {
        let found = |absolute, uncertain| Residual { absolute, uncertain, ..Residual::default() };
        assert!(!found(0.09, 0.01).tells(0.1) && !found(0.11, 0.01).tells(0.1));
        assert!(found(0.05, 0.02).tells(0.1), "it is fine for sure");
        assert!(!found(0.2, 0.04).tells(0.1), "it is not for sure, but by how much?");
        assert!(found(0.09, 0.001).tells(0.1) && found(0.2, 0.01).tells(0.1), "it is known well");
        let noisy = Residual { noise: 0.2, ..found(0.2, 0.001) };
        assert!(!noisy.tells(0.1) && noisy.tells(0.3), "noise makes it seem more, not less");
    }

    #[test]
    fn looks_get_closer_where_they_tell_the_most() {
        let look = Look { leaves: 100, finer: 1 };
        let found = |absolute, noise| Residual { absolute, noise, ..Residual::default() };
        assert_eq!(look.closer(&found(0.01, 0.02), 0.1), Look { leaves: 100, finer: 2 }, "noise hides what is off");
        let leaves =
            |absolute, uncertain, error| look.closer(&Residual { uncertain, ..found(absolute, 0.0) }, error).leaves;
        assert_eq!(leaves(0.04, 0.03, 0.05), 400, "nothing is known");
        assert_eq!(leaves(0.04, 0.0086, 0.05), 296, "three times as many should do");
        assert_eq!(leaves(0.04, 0.0051, 0.05), 200);
        assert_eq!(leaves(0.2, 0.035, 0.05), 307, "by how much it is more is to be known, too");
    }

    /// Whether few leaves have all of the noise or all have their share, what they are off by is found, or a little more than that.
    #[test]
    fn noise_of_some_leaves_is_not_what_all_are_off_by() {
        const COUNT: u32 = 20_000;
        // Box and Muller.
        let normal = |seed: u32, i: u32| {
            let [u, v] = [2 * i, 2 * i + 1].map(|i| f64::from(unit(hash(seed, i))));
            (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
        };
        let found = |noise: &dyn Fn(u32) -> f64| {
            let (mut agreed, mut noises, mut off_by, mut mean) = (0.0, 0.0, 0.0, 0.0);
            for i in 0..COUNT {
                let x = normal(1, i);
                let [a, b] = [2, 3].map(|seed| x + noise(i) * normal(seed, i));
                agreed += 0.5 * (a.signum() * b + b.signum() * a);
                noises += 0.5 * (a - b).abs();
                mean += 0.5 * (a + b).abs();
                off_by += x.abs();
            }
            let by_squares = (mean * mean - noises * noises).sqrt();
            [without_noise(agreed, noises), by_squares].map(|found| found / off_by)
        };
        let [even, _] = found(&|_| 1.5);
        assert!((even - 1.0).abs() < 0.03, "{even}");
        let [uneven, by_squares] = found(&|i| if i.is_multiple_of(4) { 4.0 } else { 0.2 });
        assert!((1.0..1.18).contains(&uneven), "{uneven}");
        assert!(by_squares > 1.22, "{by_squares}");
        assert_eq!(without_noise(-1.0, 3.0), 0.0, "estimates that contradict each other");
    }

    /// Sixteen times as many rays from each leaf leave a fourth of the noise, and find the same to what was known of it.
    #[test]
    fn more_rays_leave_less_noise() {
        let solver = shade();
        let found = [1, 4].map(|finer| {
            residual(solver.light(), None, Look { leaves: 400, finer }, &mut || ControlFlow::Continue(()))
                .expect("nobody breaks")
        });
        let [usual, finer] = found;
        assert!(finer.noise < 0.35 * usual.noise, "{found:?}");
        assert!(finer.uncertain < usual.uncertain, "{found:?}");
        let apart = (usual.absolute - finer.absolute).abs();
        assert!(apart < 3.0 * usual.uncertain.max(finer.uncertain), "{found:?}");
    }

    /// A dark room with a lamp for its ceiling and a small white plate off the floor, which reflects most of what walls get of
    /// reflected light; solved.
    fn dark_room() -> Solver {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let quad =
            |o: DVec3, a: DVec3, b: DVec3, material| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), material);
        let dark = DiffuseMaterial { reflectance: Rgb::splat(0.02), exitance: Rgb::ZERO, two_sided: false };
        let lamp = DiffuseMaterial { exitance: Rgb::ONE, ..dark };
        let white = DiffuseMaterial { reflectance: Rgb::splat(0.9), ..dark };
        let o = DVec3::ZERO;
        let mut surfaces = vec![quad(o, x, y, 0), quad(z, y, x, 1), quad(o, y, z, 0), quad(x, z, y, 0)];
        surfaces.extend([quad(o, z, x, 0), quad(y, x, z, 0)]);
        surfaces.push(quad(DVec3::new(0.4, 0.5, 0.1), 0.1 * x, 0.1 * y, 2));
        solved(surfaces, vec![dark, lamp, white])
    }

    fn solved(surfaces: Vec<Surface>, materials: Vec<DiffuseMaterial>) -> Solver {
        let input = SceneInput { surfaces, materials, ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.018), ()).expect("the room is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        solver
    }

    /// A bulb in a white shade above a dark floor: the shade gets much of its light from itself.
    fn shade() -> Solver {
        let dark = DiffuseMaterial { reflectance: Rgb::splat(0.02), exitance: Rgb::ZERO, two_sided: true };
        let bulb = DiffuseMaterial { exitance: Rgb::ONE, ..dark };
        let white = DiffuseMaterial { reflectance: Rgb::splat(0.8), ..dark };
        let corner = |x: f64, y: f64| DVec3::new(x, y, -1.0);
        let floor = Shape::Quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        let cone = Shape::Cone { ends: [DVec3::ZERO, 0.3 * DVec3::Z], radii: [0.25, 0.15] };
        let sphere = Shape::Sphere { center: 0.15 * DVec3::Z, radius: 0.05 };
        solved(vec![Surface::new(floor, 0), Surface::new(sphere, 1), Surface::new(cone, 2)], vec![dark, bulb, white])
    }

    /// What links carry is scaled to what their senders have; what these have is not.
    #[test]
    fn rays_find_light_as_it_is() {
        let input = SceneInput {
            surfaces: vec![
                Surface::new(Shape::Quad([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]), 0),
                Surface::new(
                    Shape::Quad([DVec3::Z, DVec3::new(0.0, 1.0, 1.0), DVec3::ONE, DVec3::new(1.0, 0.0, 1.0)]),
                    1,
                ),
            ],
            materials: vec![
                DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::ZERO, two_sided: false },
                DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ONE, two_sided: false },
            ],
            ..SceneInput::default()
        };
        let field = Echo { material: 0, albedo: 0.5, errs: false };
        let mut solver = Solver::new(&input, Settings::with_error(0.1), field).expect("the plates are sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let leaf = solver.elements.patch_leaves().find(|&leaf| solver.elements.nodes[leaf as usize].source == 1);
        let leaf = leaf.expect("the lamp has leaves");
        let as_it_is = reflected(solver.light(), leaf, (1, 1));
        solver.exitant.gain.fill(0.5);
        assert!(as_it_is > 0.0 && reflected(solver.light(), leaf, (1, 1)) == as_it_is, "{as_it_is}");
    }

    /// Whatever links say, rays toward what they do find the same light as rays all over the hemisphere; where they are right, with less
    /// noise where it comes from something small.
    #[test]
    fn rays_toward_senders_find_the_same() {
        for (solver, (surface, every), is_small) in [(dark_room(), (3, 5), true), (shade(), (2, 200), false)] {
            let (light, arriving) = (solver.light(), solver.gather.arriving());
            let wrong: Vec<Rgb> = arriving.iter().rev().copied().collect();
            let mean_and_deviation = |values: &[f64]| {
                let mean = values.iter().sum::<f64>() / values.len() as f64;
                (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt())
            };
            let is_checked =
                |&leaf: &u32| light.element(leaf).source == surface && light.element(leaf).importance > 0.0;
            let (mut checked, mut noises) = (0, [0.0; 2]);
            for leaf in light.elements.patch_leaves().filter(is_checked).step_by(every) {
                let all_over: Vec<f64> = (0..600).map(|seed| f64::from(reflected(light, leaf, (seed, 1)))).collect();
                let (mean, noise) = mean_and_deviation(&all_over);
                for (arriving, is_right) in [(arriving, true), (wrong.as_slice(), false)] {
                    let brought = Brought { links: &solver.links, arriving, shares: light.reflected_shares() };
                    let senders = Senders::of(light, leaf, &brought);
                    let toward: Vec<f64> =
                        (0..600).map(|seed| f64::from(reflected_by(light, &senders, leaf, (seed, 1)).0)).collect();
                    let (found, less) = mean_and_deviation(&toward);
                    let doubt = 4.0 * (noise * noise + less * less).sqrt() / 600.0_f64.sqrt();
                    assert!((found - mean).abs() < doubt, "{surface}, {leaf}: {found}, not {mean} ± {doubt}");
                    if is_right {
                        noises = [noises[0] + less, noises[1] + noise];
                    }
                    checked += 1;
                }
            }
            assert!(checked >= 8, "{surface}: {checked}");
            assert!(!is_small || noises[0] < 0.5 * noises[1], "{surface}: {noises:?}");
        }
    }
}

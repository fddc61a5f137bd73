//! Which emitters light a place: what is drawn where somebody knows it.
//!
//! Emitters that are strong but hidden, such as bulbs in their shades, would take most of the draws, and what is left for those
//! that are seen would be noise: a few strong samples among many of none. So a few rays find, once for each place that somebody
//! tells apart, which emitters are seen from it and how much each of them brings. Draws follow that; a share of
//! them goes by power alone, so that nothing is missed whose rays were all blocked.

use super::emitters::{Arrival, Emitters};
use super::parts::{Part, Parts, divided};
use glam::{Vec2, Vec3};
use hr_diffuse::Visibility;
use hr_diffuse::sampling::{hash, point2};
use hr_diffuse::visibility::{NO_BLOCKER, Occluders, Patch};
use std::ops::RangeInclusive;

/// Share of draws that go by power alone.
const BY_POWER: f32 = 0.1;
/// Rays look for at most so many emitters, those that would bring most were nothing between …
const LOOKED_AT: usize = 64;
/// … and of the others so much is believed to be seen.
const BELIEVED: f32 = 0.25;
/// Rays to each of them.
const RAYS: u32 = 8;
/// Where a shadow ends within a place, an emitter is seen from next to its rim only: one that no ray found is looked for there, too, if it
/// would bring at least this share of all were nothing between, …
const STRONG: f32 = 0.05;
/// … by so many rays …
const RIM_RAYS: usize = 3;
/// … from each of these points.
const RIM: [Vec2; 8] = {
    let [low, middle, high] = [0.02, 0.5, 0.98];
    [
        Vec2::new(low, low),
        Vec2::new(high, high),
        Vec2::new(low, high),
        Vec2::new(high, low),
        Vec2::new(low, middle),
        Vec2::new(high, middle),
        Vec2::new(middle, low),
        Vec2::new(middle, high),
    ]
};
/// Emitters that bring less than this share of what is seen are too many to look at each of them.
const MUCH: f32 = 0.01;
/// Of an emitter that no ray found so much is believed to be seen.
const LEAST_SEEN: f32 = 0.1;
/// Emitters that bring less than this of all are left to power.
const FAINT: f32 = 1e-4;
/// Polygons in the way of emitters that a place may have, at most, and emitters: more take longer than rays do. So do more than the
/// first of these where there are rays all the same, to emitters that bring more and have no outlines.
const MOST_OCCLUDERS: [usize; 2] = [32, 128];
/// Of so small a share of all light nothing more is asked.
const NEGLIGIBLE: f32 = 1e-3;
/// Emitters of which no more than this share is seen, and that bring at least this share of all light, …
const PARTLY_SEEN: f32 = 0.95;
const WORTH_PARTS: f32 = 0.05;
/// … are drawn from by so many parts, …
const PARTS: usize = 64;
/// … each of which counts as seen by this share at least.
const LEAST_SEEN_OF_PART: f32 = 0.05;
/// Half shadow is even where what is seen differs by less than this share of an emitter, and of itself, …
const UNEVEN: f32 = 0.15;
/// … and is between these shares: vertices hardly know an emitter of which less is seen.
const HALF: RangeInclusive<f32> = 0.15..=0.9;
/// Cosine that counts at least: shading normals are bent, and places are large.
const LEAST_COSINE: f32 = 0.05;

/// The emitters of a place, and the chance of each.
#[derive(Clone, Debug, Default)]
pub struct Nearby {
    /// Emitters, rising.
    entries: Vec<u32>,
    /// Chance of each and of all before it, up to 1.
    sums: Vec<f32>,
    /// Share of each that is seen, about, > 0.
    seen: Vec<f32>,
    /// Least irradiance, sum of channels, that one of those which bring much would bring were nothing between; 0 if some of them are
    /// seen by all rays.
    half_shadow: f32,
    /// Emitters that are polygons, with all that may hide parts of them: what they bring is known without chance. They are not drawn.
    outlined: Vec<(u32, Occluders)>,
    /// Share of the others in what all bring.
    rest: f32,
    /// Whether most light of the others that are seen in part is that of polygons, and much: from parts of the place less is in the way.
    lacks_outlines: bool,
    /// Of those that are drawn and large, and of which little is seen: their parts.
    parts: Vec<(u32, Parts)>,
}

/// An emitter that is looked at.
struct Found {
    entry: u32,
    /// What it brings, sum of channels; at first as if nothing were between.
    light: f32,
    seen: f32,
}

/// Looks for emitters from a place.
struct Look<'a> {
    emitters: &'a Emitters,
    visibility: &'a Visibility,
    place: &'a Patch,
    seed: u32,
}

impl Look<'_> {
    /// A point of the place and the normal on its side.
    fn point(&self, u: Vec2) -> (Vec3, Vec3) {
        let (point, front) =
            self.visibility.geometries()[self.place.surface as usize].sample(self.place.domain, u.x, u.y);
        (point, if self.place.back { -front } else { front })
    }

    /// What a point of an emitter or of a part of it, its `k`-th, brings to a point of the place, sum of channels.
    fn brings(&self, (entry, part): (u32, Option<Part>), (at, normal): (Vec3, Vec3), k: u32) -> Option<(f32, Arrival)> {
        let u = point2(hash(self.seed, 1 + entry), k);
        let arrival = self.emitters.shine(self.visibility.geometries(), at, (entry, part), u, 1.0)?;
        let cosine = arrival.direction.dot(normal);
        (cosine > 0.0).then(|| (arrival.irradiance.element_sum() * cosine.max(LEAST_COSINE), arrival))
    }

    /// What an emitter brings to points, were nothing between, and what of that is seen; points of the emitter are its `first` and those
    /// after it.
    fn shines(&self, emitter: (u32, Option<Part>), points: impl Iterator<Item = (Vec3, Vec3)>, first: u32) -> [f32; 2] {
        let [mut all, mut open] = [0.0; 2];
        for (point, k) in points.zip(first..) {
            let Some((brought, arrival)) = self.brings(emitter, point, k) else { continue };
            all += brought;
            let ends = [self.place.surface, arrival.surface.unwrap_or(NO_BLOCKER)];
            if !self.visibility.occluded(point.0, arrival.from, ends, &mut { NO_BLOCKER }) {
                open += brought;
            }
        }
        [all, open]
    }
}

impl Nearby {
    /// Looks for them by rays.
    #[must_use]
    pub fn new(emitters: &Emitters, visibility: &Visibility, place: &Patch, seed: u32) -> Self {
        let look = Look { emitters, visibility, place, seed };
        let points: [_; RAYS as usize] = std::array::from_fn(|k| look.point(point2(hash(seed, 0), k as u32)));
        let rim = RIM.map(|u| look.point(u));
        let is_mesh = emitters.len() > LOOKED_AT;
        let unblocked = |entry: u32| {
            // Parts that glow are many and small, and so are polygons of lamps that are meshes; of what is round half may face away.
            let is_small = emitters.is_glowing(entry) || is_mesh && emitters.is_flat(entry, visibility.geometries());
            let looks = if is_small { 2 } else { RAYS };
            let light = |k: u32| look.brings((entry, None), points[k as usize], k).map(|(light, _)| light);
            (0..looks).filter_map(light).sum::<f32>() / looks as f32
        };
        let mut found: Vec<_> =
            (0..emitters.len() as u32).map(|entry| Found { entry, light: unblocked(entry), seen: BELIEVED }).collect();
        found.sort_by(|a, b| b.light.total_cmp(&a.light));
        let strong = STRONG * found.iter().map(|found| found.light).sum::<f32>();
        for Found { entry, light, seen } in found.iter_mut().take(LOOKED_AT) {
            let [mut all, mut open] = look.shines((*entry, None), points.into_iter(), 0);
            *light = all / RAYS as f32;
            if open == 0.0 && *light >= strong {
                let more = look.shines((*entry, None), rim.iter().flat_map(|&point| [point; RIM_RAYS]), RAYS);
                [all, open] = [all + more[0], open + more[1]];
            }
            if all > 0.0 {
                // What any ray found is surely seen.
                *seen = if open > 0.0 { (open / all).max(1.0 / RAYS as f32) } else { LEAST_SEEN };
            }
        }
        for Found { light, seen, .. } in &mut found {
            *light *= *seen;
        }
        let most: f32 = found.iter().map(|found| found.light).sum();
        let strong = found.iter().filter(|found| found.light >= STRONG * most);
        let half_shadow = strong.fold(f32::INFINITY, |least, found| {
            least.min(if found.seen < 1.0 { found.light / found.seen } else { 0.0 })
        });
        let total: f32 = found.iter().map(|found| found.light).sum();
        found.retain(|found| found.light > FAINT * total && found.light.is_finite());
        found.sort_unstable_by_key(|found| found.entry);
        let total: f32 = found.iter().map(|found| found.light).sum();
        let mut sum = 0.0;
        let add = |found: &Found| {
            sum += found.light / total;
            sum
        };
        Self {
            sums: found.iter().map(add).collect(),
            entries: found.iter().map(|found| found.entry).collect(),
            seen: found.iter().map(|found| found.seen).collect(),
            half_shadow,
            outlined: Vec::new(),
            rest: 1.0,
            lacks_outlines: false,
            parts: Vec::new(),
        }
    }

    /// Finds out, by rays, which parts are seen of surfaces that emit, bring much, and are drawn from: those whose occluders are not all known.
    #[must_use]
    pub fn with_parts(mut self, emitters: &Emitters, visibility: &Visibility, place: &Patch, seed: u32) -> Self {
        if self.is_all_outlined() {
            return self;
        }
        let look = Look { emitters, visibility, place, seed };
        for at in 0..self.entries.len() {
            let entry = self.entries[at];
            let is_worth = self.seen[at] <= PARTLY_SEEN && self.share(at) >= WORTH_PARTS && !self.is_outlined(entry);
            let Some(patch) = emitters.patch(entry).filter(|_| is_worth) else { continue };
            let domains = divided(&visibility.geometries()[patch.surface as usize], patch.domain, PARTS);
            let points = (0..RAYS).map(|k| look.point(point2(hash(seed, 0), k)));
            let found: Vec<_> = (domains.iter().zip(1..))
                .map(|(&domain, part)| {
                    look.shines((entry, Some(Part { domain, chance: 1.0 })), points.clone(), part * RAYS)
                })
                .collect();
            // Those that shine at no point that was looked at may do so at others.
            let mean = found.iter().map(|[all, _]| all).sum::<f32>() / found.len() as f32;
            let weight = |[all, open]: [f32; 2]| open.max(LEAST_SEEN_OF_PART * all.max(mean));
            let weighed: Vec<_> = domains.into_iter().zip(found.into_iter().map(weight)).collect();
            self.parts.extend(Parts::new(&weighed).map(|parts| (entry, parts)));
        }
        self
    }

    /// Finds all that may hide parts of emitters from the place, of those that bring most first, as long as that is not too much.
    #[must_use]
    pub fn with_occluders(mut self, emitters: &Emitters, visibility: &Visibility, place: &Patch) -> Self {
        let shares: Vec<f32> = (0..self.entries.len()).map(|at| self.share(at)).collect();
        let mut order: Vec<usize> = (0..shares.len()).collect();
        order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]));
        let known = order.into_iter().map(|at| self.entries[at]);
        // A few rays may have missed that an emitter is seen from a corner of the place.
        let others = (0..emitters.len() as u32).filter(|entry| self.entries.binary_search(entry).is_err());
        let has_outline = |entry: u32| {
            let sender = emitters.patch(entry);
            sender.is_some_and(|sender| visibility.geometries()[sender.surface as usize].is_polygon())
        };
        // Draws make noise where emitters are seen in part.
        let without = self.seen_in_part(&shares, |entry| !has_outline(entry));
        let with = self.seen_in_part(&shares, has_outline);
        let mut left = MOST_OCCLUDERS[usize::from(with > without)];
        for entry in known.chain(others) {
            if left == 0 {
                break;
            }
            let found = emitters.patch(entry).and_then(|sender| visibility.occluders(place, &sender, left - 1));
            if let Some(occluders) = found {
                left -= occluders.cost();
                self.outlined.push((entry, occluders));
            }
        }
        self.outlined.sort_unstable_by_key(|(entry, _)| *entry);
        let lacking = self.seen_in_part(&shares, |entry| has_outline(entry) && !self.is_outlined(entry));
        self.lacks_outlines = lacking >= MUCH && lacking > without;
        let is_drawn: Vec<bool> = self.entries.iter().map(|&entry| !self.is_outlined(entry)).collect();
        let mut sum = 0.0;
        for ((so_far, share), is_drawn) in self.sums.iter_mut().zip(&shares).zip(is_drawn) {
            sum += if is_drawn { *share } else { 0.0 };
            *so_far = sum;
        }
        if sum > 0.0 {
            self.sums.iter_mut().for_each(|so_far| *so_far /= sum);
        }
        self.rest = sum;
        self
    }

    /// What the emitters among these bring that are seen in part, given the share of each.
    fn seen_in_part(&self, shares: &[f32], is_among: impl Fn(u32) -> bool) -> f32 {
        let is_counted = |at: &usize| self.seen[*at] < 1.0 && is_among(self.entries[*at]);
        (0..shares.len()).filter(is_counted).map(|at| shares[at]).sum()
    }

    /// Whether all is known that may hide parts of an emitter.
    pub(super) fn is_outlined(&self, entry: u32) -> bool {
        self.outlined.binary_search_by_key(&entry, |(entry, _)| *entry).is_ok()
    }

    /// The emitters of which all is known that may hide parts of them.
    #[must_use]
    pub fn all_outlined(&self) -> &[(u32, Occluders)] {
        &self.outlined
    }

    /// Whether what these bring is all but nothing of the light.
    #[must_use]
    pub fn is_all_outlined(&self) -> bool {
        self.rest <= NEGLIGIBLE
    }

    /// Whether emitters bring much, and more than others that are seen in part, whose light would be known without chance if less were in the way.
    #[must_use]
    pub fn lacks_outlines(&self) -> bool {
        self.lacks_outlines
    }

    /// Whether emitters that are all partly seen light the place about evenly, by what they are said to bring (irradiance, sum of
    /// channels) to points all over it: nothing so fine throws shadows on it that one would see.
    #[must_use]
    pub fn is_even_half_shadow(&self, brought: impl Iterator<Item = f32>) -> bool {
        if self.half_shadow <= 0.0 {
            return false;
        }
        let (low, high) = brought.fold((f32::INFINITY, 0.0f32), |(low, high), light| (low.min(light), high.max(light)));
        high - low < UNEVEN * self.half_shadow.min(2.0 * high) && HALF.contains(&(high / self.half_shadow))
    }

    /// The emitters that bring much, of which some ray saw something, and the share that is seen of each.
    pub(super) fn surely_seen(&self) -> impl Iterator<Item = (u32, f32)> {
        let brings_much = |&at: &usize| {
            let entry = self.entries[at];
            let is_drawn_evenly = !self.is_outlined(entry) && self.parts_of(entry).is_none();
            self.share(at) >= MUCH && self.seen[at] > LEAST_SEEN && is_drawn_evenly
        };
        (0..self.entries.len()).filter(brings_much).map(|at| (self.entries[at], self.seen[at]))
    }

    /// Whether something hides parts of emitters from here, or parts of the place from them.
    pub(super) fn is_shaded(&self) -> bool {
        let is_shaded = |at: usize| self.seen[at] > LEAST_SEEN && self.seen[at] < 1.0;
        (0..self.entries.len()).any(|at| is_shaded(at) && !self.is_outlined(self.entries[at]))
    }

    fn parts_of(&self, entry: u32) -> Option<&Parts> {
        let at = self.parts.binary_search_by_key(&entry, |(entry, _)| *entry).ok()?;
        Some(&self.parts[at].1)
    }

    /// The part of an emitter that is to be drawn from, if it has parts, and the place there, for a pair of numbers in 0…1.
    pub(super) fn part(&self, entry: u32, u: Vec2) -> (Option<Part>, Vec2) {
        self.parts_of(entry).map_or((None, u), |parts| {
            let (part, u) = parts.pick(u);
            (Some(part), u)
        })
    }

    /// Share of an emitter that is seen, about, > 0.
    pub(super) fn seen(&self, entry: u32) -> f32 {
        self.entries.binary_search(&entry).map_or(BELIEVED, |at| self.seen[at])
    }

    /// The emitter that a number in 0…1 picks, or a number in 0…1 that is to pick one by power.
    pub(super) fn pick(&self, choice: f32) -> Result<u32, f32> {
        let Some(last) = self.entries.len().checked_sub(1) else { return Err(choice) };
        if choice < BY_POWER {
            return Err(choice / BY_POWER);
        }
        let choice = (choice - BY_POWER) / (1.0 - BY_POWER);
        // Rounding may leave the last sum a little below the choice.
        Ok(self.entries[self.sums.partition_point(|&sum| sum <= choice).min(last)])
    }

    /// The chance of an emitter whose chance by power alone is given.
    pub(super) fn chance(&self, entry: u32, by_power: f32) -> f32 {
        if self.entries.is_empty() {
            return by_power;
        }
        let own = self.entries.binary_search(&entry).map_or(0.0, |at| self.share(at));
        BY_POWER * by_power + (1.0 - BY_POWER) * own
    }

    /// What one of the entries brings of what they all do.
    fn share(&self, at: usize) -> f32 {
        self.sums[at] - at.checked_sub(1).map_or(0.0, |before| self.sums[before])
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{hidden_lamp, material};
    use super::*;
    use crate::path_tracer::{PathTracer, Sampler, visibility};
    use glossy_ext::Lambert;
    use hr_diffuse::{Light, LightKind, Rgb};

    #[test]
    fn chances_add_up_to_1_and_follow_what_is_seen() {
        let mut scene = hidden_lamp();
        scene.materials.push(material(Lambert::BLACK, 0.0, true));
        let position = glam::dvec3(0.0, 0.0, 0.2);
        scene.lights = vec![Light { position, intensity: Rgb::splat(1e-4), kind: LightKind::Point }];
        let rays = visibility(&scene).expect("sound");
        let tracer = PathTracer::new(&scene, &rays);
        let ground = Patch { surface: 0, domain: hr_diffuse::Domain::WHOLE, back: false };
        let nearby = Nearby::new(tracer.emitters(), &rays, &ground, 3);
        let count = tracer.emitters().len() as u32;
        let by_power = 1.0 / count as f32;
        let chances: Vec<f32> = (0..count).map(|entry| nearby.chance(entry, by_power)).collect();
        assert!((chances.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{chances:?}");
        // Draws follow them.
        let mut drawn = vec![0.0; count as usize];
        let n = 4096;
        for i in 0..n {
            match nearby.pick((i as f32 + 0.5) / n as f32) {
                Ok(entry) => drawn[entry as usize] += 1.0 / n as f32,
                Err(rest) => drawn[(rest * count as f32) as usize] += 1.0 / n as f32,
            }
        }
        for (drawn, chance) in drawn.iter().zip(&chances) {
            assert!((drawn - chance).abs() < 2.0 / n as f32 * count as f32, "{drawn} {chance}");
        }
        // The hidden lamp is 20 times as strong as the other one.
        let [strong, weak] =
            [2, 3].map(|surface| chances[tracer.emitters().of_surface(surface).expect("it shines") as usize]);
        assert!(weak > strong, "hidden: {strong}, seen: {weak}");
    }

    /// Of a sky behind a window in a wall, which is seen from near by in a corner only, draws of parts bring what draws of all of it do, with little more than half of the noise.
    #[test]
    fn parts_that_are_seen_are_drawn_from() {
        let mut scene = hidden_lamp();
        let p = |x: f64, y: f64, z: f64| glam::dvec3(x, y, z);
        let flat = |z: f64, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2]| {
            hr_diffuse::Shape::Quad([p(x0, y0, z), p(x1, y0, z), p(x1, y1, z), p(x0, y1, z)])
        };
        let mut surfaces = vec![scene.surfaces[0].clone(); 5];
        surfaces[0].shape = flat(0.0, [-0.2, 0.2], [-0.2, 0.2]);
        for (surface, (x, y)) in surfaces[1..].iter_mut().zip([
            ([-6.0, -0.3], [-6.0, 6.0]),
            ([0.3, 6.0], [-6.0, 6.0]),
            ([-0.3, 0.3], [-6.0, -0.3]),
            ([-0.3, 0.3], [0.3, 6.0]),
        ]) {
            surface.shape = flat(1.0, x, y);
        }
        let mut sky = scene.surfaces[2].clone();
        sky.shape = flat(2.0, [-4.0, 4.0], [-4.0, 4.0]);
        surfaces.push(sky);
        scene.surfaces = surfaces;
        let rays = visibility(&scene).expect("sound");
        let tracer = PathTracer::new(&scene, &rays);
        let ground = Patch { surface: 0, domain: hr_diffuse::Domain::WHOLE, back: false };
        let all = Nearby::new(tracer.emitters(), &rays, &ground, 3);
        let by_parts = all.clone().with_parts(tracer.emitters(), &rays, &ground, 3);
        assert!(all.parts.is_empty() && by_parts.parts.len() == 1);
        let (point, normal) = rays.geometries()[0].sample(ground.domain, 0.3, 0.6);
        let hit = rays.closest(point + normal * 0.01, -normal, 0.0, 1.0).expect("the ground");
        let found = [&all, &by_parts].map(|nearby| {
            const DRAWS: u32 = 8192;
            let (mut sum, mut squares) = (0.0, 0.0);
            for i in 0..DRAWS {
                let light = tracer.irradiance(&hit, -normal, &Sampler::new(5, i), Some(nearby)).x;
                (sum, squares) = (sum + light, squares + light * light);
            }
            let mean = sum / DRAWS as f32;
            (mean, (squares / DRAWS as f32 - mean * mean).sqrt())
        });
        let exact = all.with_occluders(tracer.emitters(), &rays, &ground);
        let exact = tracer.outlined(&hit, -normal, &exact).x;
        let [(mean, noise), (mean_by_parts, less_noise)] = found;
        assert!((mean_by_parts - exact).abs() < 0.02 * exact, "{mean_by_parts}, {mean}, exactly {exact}");
        assert!(less_noise < 0.55 * noise, "{less_noise}, without parts {noise}");
    }

    /// Of an emitter of which little is seen all the difference may be in that.
    #[test]
    fn half_shadow_is_even_by_what_is_seen() {
        let nearby = Nearby { half_shadow: 10.0, ..Nearby::default() };
        let is_even = |brought: [f32; 3]| nearby.is_even_half_shadow(brought.into_iter());
        assert!(is_even([5.0, 5.5, 5.2]) && is_even([2.4, 3.0, 3.1]));
        assert!(
            !is_even([2.0, 3.0, 2.5]) && !is_even([1.0, 1.1, 1.05]),
            "shadows that one would see, or vertices do not know"
        );
        assert!(!is_even([9.5, 9.5, 9.5]) && !is_even([0.0; 3]), "light, and none");
    }

    /// Where some emitters are cut out and others drawn, all of their light arrives, and nothing is drawn of the former by what is known.
    #[test]
    fn what_is_cut_out_and_what_is_drawn_add_up() {
        let mut scene = hidden_lamp();
        let position = glam::dvec3(0.0, 0.0, 0.2);
        scene.lights = vec![Light { position, intensity: Rgb::splat(0.02), kind: LightKind::Point }];
        let rays = visibility(&scene).expect("sound");
        let tracer = PathTracer::new(&scene, &rays);
        let ground = Patch { surface: 0, domain: hr_diffuse::Domain::WHOLE, back: false };
        let drawn = Nearby::new(tracer.emitters(), &rays, &ground, 3);
        let cut = drawn.clone().with_occluders(tracer.emitters(), &rays, &ground);
        let lamps = [2, 3].map(|surface| tracer.emitters().of_surface(surface).expect("it shines"));
        assert!(lamps.iter().all(|&lamp| cut.is_outlined(lamp)) && !cut.is_all_outlined());
        assert_eq!(lamps.map(|lamp| cut.chance(lamp, 0.5)), [BY_POWER * 0.5; 2]);
        let (point, normal) = rays.geometries()[0].sample(ground.domain, 0.4, 0.7);
        let hit = rays.closest(point + normal * 0.01, -normal, 0.0, 1.0).expect("the ground");
        assert_eq!(hit.surface, 0);
        let mean = |nearby: &Nearby| {
            const DRAWS: u32 = 4096;
            let draw = |i| tracer.irradiance(&hit, -normal, &Sampler::new(5, i), Some(nearby)).x;
            (0..DRAWS).map(draw).sum::<f32>() / DRAWS as f32
        };
        let (found, expected) = (tracer.outlined(&hit, -normal, &cut).x + mean(&cut), mean(&drawn));
        assert!((found - expected).abs() < 0.01 * expected, "{found}, drawn {expected}");
    }

    #[test]
    fn an_emitter_that_is_seen_from_the_rim_of_a_place_only_is_found() {
        let mut scene = hidden_lamp();
        let square = |height: f64, [low, high]: [f64; 2]| {
            let p = |x: f64, y: f64| glam::dvec3(low + x * (high - low), low + y * (high - low), height);
            hr_diffuse::Shape::Quad([p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)])
        };
        // The shadow of the plate ends just before two edges of the ground.
        scene.surfaces[0].shape = square(0.0, [-1.0, 1.0]);
        scene.surfaces[1].shape = square(0.5, [-1.0, 0.485]);
        scene.surfaces[2].shape = square(1.0, [-0.1, 0.1]);
        scene.surfaces.truncate(3);
        let rays = visibility(&scene).expect("sound");
        let tracer = PathTracer::new(&scene, &rays);
        let ground = Patch { surface: 0, domain: hr_diffuse::Domain::WHOLE, back: false };
        let lamp = tracer.emitters().of_surface(2).expect("it shines");
        for seed in 0..40 {
            let seen = Nearby::new(tracer.emitters(), &rays, &ground, seed).seen(lamp);
            assert!(seen > LEAST_SEEN, "seed {seed}: {seen}");
        }
    }
}

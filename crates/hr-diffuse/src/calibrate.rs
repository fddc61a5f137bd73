//! Calibration: what arrives of reflected light is compared with what rays find, region by region.
//!
//! Rows of form factors (see [`leaf_rows`](crate::leaf_rows)) say how much is seen, not how bright it is: what is bright is
//! seen by chance a little too much or too little, all over a region alike, and each bounce repeats it. Rays from all over a
//! region know the mean, whatever the links. Few rays tell the mean of much, and little of a part; so each part is taken to be
//! as the whole that it belongs to, as far as its own rays do not know better. Of narrow lobes few rays all over a hemisphere see the
//! peaks: where an extension takes part some of them go where links say that light comes from.

use crate::hierarchy::Elements;
use crate::hooks::LightField;
use crate::residual::{Brought, Rays, ReceivingPoint, Senders, reflected_along};
use crate::sampling::{cosine_direction, hash, point4, unit};
use crate::segments::receiving_point;
use crate::threads;
use crate::transport::Light;
use glam::Vec2;
use std::ops::ControlFlow;

/// What is believed before anything is compared, in relative terms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Doubt {
    /// How far (standard deviation) all the light that there is may be off, …
    whole: f64,
    /// … and that of each part from its whole's; further where observations tell that parts differ by more.
    part: f64,
    /// Variance of a single observation: at least so much.
    noise: f64,
}

/// Of what vertices gather, against the light of the leaves around.
pub(crate) const OF_VERTICES: Doubt = Doubt { whole: 0.1, part: 0.05, noise: 0.2 };
/// Of what links bring, against single rays.
const OF_LINKS: Doubt = Doubt { whole: 0.1, part: 0.03, noise: 0.05 };

/// Light is changed by no more than this factor, …
const MOST: f64 = 1.8;
/// … and made brighter by less where what is seen reflects much: of what that absorbs at least this share still is, so that light dies out
/// as it did. Within that what was found counts there as anywhere: what is wrong is repeated many times, and that the rows' sums are right
/// does not tell which of what is seen is bright.
const ABSORBED: f64 = 0.2;
/// That parts differ by as much as is believed counts as so many of them that are known for certain.
const BELIEVED_PARTS: f64 = 10.0;
/// A part tells of no larger (squared) relative difference from its whole: where next to nothing is brought anything may be found.
const MOST_APART: f64 = 0.1;
/// Parts differ by no more than so many times (squared) what is believed.
const MOST_SPREAD: f64 = 100.0;
/// One ray of so many goes where links say that light comes from; the others, all over the hemisphere, know more of what is even.
const ONE_OF: u32 = 4;
const RAYS: Rays = Rays { all_over: 1.0 - 1.0 / ONE_OF as f32, toward: 1.0 / ONE_OF as f32 };
/// Rays that a thread shoots between two calls of `watch`, about: some milliseconds.
const BETWEEN_WATCHES: usize = 4096;

/// What rays from a place are expected to find of reflected light, as links bring it (sum of channels).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Expected {
    /// The node.
    pub(crate) place: u32,
    /// On average …
    pub(crate) mean: f32,
    /// … and the mean of its square: few rays see what is small and bright, and those that do not do not know of it.
    pub(crate) square: f32,
}

/// Sums over observations: of what was found, of what is compared with it, and of the squares.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    found: f64,
    brought: f64,
    found2: f64,
    both: f64,
    brought2: f64,
    /// Of the variance that is expected of what is found.
    variance: f64,
}

impl Sums {
    /// Those of one observation of some variance, as far as that is known.
    pub(crate) fn of(found: f64, brought: f64, variance: f64) -> Self {
        Self { found, brought, found2: found * found, both: found * brought, brought2: brought * brought, variance }
    }

    fn add(&mut self, other: &Self) {
        self.found += other.found;
        self.brought += other.brought;
        self.found2 += other.found2;
        self.both += other.both;
        self.brought2 += other.brought2;
        self.variance += other.variance;
    }

    /// What is found over what is brought, and the variance of that.
    fn ratio(&self, noise: f64) -> Option<(f64, f64)> {
        let ratio = self.found / self.brought;
        let off2 = self.found2 - 2.0 * ratio * self.both + ratio * ratio * self.brought2;
        // A few may agree by chance.
        let variance = (off2.max(self.variance) + noise * self.brought2) / (self.brought * self.brought);
        (ratio.is_finite() && variance.is_finite()).then_some((ratio, variance))
    }
}

/// Factors for reflected light, in the order of the places in `expected`, which come with what share of the light there what is seen
/// reflects, if known with what links bring; from so many rays, and how many were shot. `None` where `watch` breaks.
pub(crate) fn calibrate<L: LightField>(
    light: Light<'_, L>,
    (expected, reflectances): (&[Expected], &[f32]),
    brought: Option<&Brought<'_>>,
    rays: usize,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<(Vec<f32>, u64)> {
    let weight = |of: &Expected| {
        let element = light.element(of.place);
        let counts = of.mean > 0.0 && light.elements.exposed(of.place) >= 1.0;
        if counts { f64::from(element.area * element.importance) } else { 0.0 }
    };
    let (mut area, mut power) = (0.0, 0.0);
    for of in expected {
        area += weight(of);
        power += weight(of) * f64::from(of.mean);
    }
    let mean = power / area;
    // Half of the rays as if all places were lit alike, half as they are; and more where errors count more.
    let looks = |of: &Expected| (mean + f64::from(of.mean)) * f64::from(light.exitant.adaptation[of.place as usize]);
    let total: f64 = expected.iter().map(|of| weight(of) * looks(of)).sum();
    if !(total > 0.0 && total.is_finite()) {
        return Some((vec![1.0; expected.len()], 0));
    }
    // How many rays start from each place, and what each of them counts.
    let mut sum = 0.0_f64;
    let counts: Vec<(u32, f64)> = expected
        .iter()
        .map(|of| {
            let share = weight(of) * looks(of) / total * rays as f64;
            let first = sum.round() as u64;
            sum += share;
            let count = (sum.round() as u64 - first) as u32;
            (count, if share > 0.0 { weight(of) / share } else { 0.0 })
        })
        .collect();
    let look = |index: usize| {
        let (Expected { place, mean, square }, (count, each)) = (expected[index], counts[index]);
        let senders = brought.filter(|_| count > 0).map(|brought| Senders::of(light, place, brought));
        // Rays toward senders find what is small and bright by its power.
        let square = if senders.is_some() { square.min(2.0 * mean * mean) } else { square };
        let variance = each * each * (f64::from(square) - f64::from(mean) * f64::from(mean)).max(0.0);
        let seed = hash(place, 0x1c0d);
        let mut sums = Sums::default();
        for ray in 0..count {
            let u = point4(seed, ray);
            let on = (unit(hash(hash(seed, 0x53), ray)), Vec2::new(u.z, u.w));
            let Some((x, n, surface)) = receiving_point(light, place, on) else { continue };
            let (from, direction) = (ReceivingPoint { at: x, normal: n, surface }, cosine_direction(n, u.x, u.y));
            let found = match &senders {
                None => reflected_along(light, x, direction, surface),
                Some(senders) if ray % ONE_OF != seed % ONE_OF => senders.all_over(light, from, direction, RAYS),
                Some(senders) => {
                    let choice = unit(hash(hash(seed, 0x5e), ray));
                    senders.toward(light, from, (choice, Vec2::new(u.x, u.y)), RAYS).unwrap_or(0.0)
                }
            };
            sums.add(&Sums::of(each * f64::from(found), each * f64::from(mean), variance));
        }
        sums
    };
    let mut found: Vec<Sums> = Vec::with_capacity(expected.len());
    let between_watches = (BETWEEN_WATCHES * expected.len() / rays.max(1)).max(1) * threads::current_num_threads();
    while found.len() < expected.len() {
        if watch().is_break() {
            return None;
        }
        let part = found.len()..expected.len().min(found.len() + between_watches);
        found.extend(threads::map_range(part, 8, look));
    }
    let factors = factors(light.elements, expected.iter().map(|of| of.place).zip(found), OF_LINKS);
    let factor = |(of, &reflectance): (&Expected, &f32)| {
        let reflectance = f64::from(reflectance);
        let most = ((1.0 - ABSORBED * (1.0 - reflectance)) / reflectance).clamp(1.0, MOST);
        factors[of.place as usize].clamp(MOST.recip(), most) as f32
    };
    let factors = expected.iter().zip(reflectances).map(factor).collect();
    Some((factors, counts.iter().map(|(count, _)| u64::from(*count)).sum()))
}

/// By node, what is found over what it is compared with, by the observations at leaves or places: of each part as of its whole, as far as
/// its own observations do not know better. Together the parts change by what their whole does.
pub(crate) fn factors(elements: &Elements, found: impl Iterator<Item = (u32, Sums)>, doubt: Doubt) -> Vec<f64> {
    let nodes = &elements.nodes;
    let mut sums = vec![Sums::default(); nodes.len()];
    for (leaf, found) in found {
        sums[leaf as usize] = found;
    }
    for node in (1..nodes.len()).rev() {
        let sum = sums[node];
        sums[nodes[node].parent as usize].add(&sum);
    }
    let spreads = spreads(elements, &sums, doubt);
    let mut factors = vec![1.0_f64; nodes.len()];
    let mut ratios = vec![1.0_f64; nodes.len()];
    // What tells a part from its whole is the difference of what was found: the whole has been told already.
    let told = |sums: &Sums, (factor, ratio): (f64, f64), spread: f64| match sums.ratio(doubt.noise) {
        Some((own, variance)) => {
            let prior = spread * ratio * ratio;
            (factor + (own - ratio) * prior / (prior + variance).max(f64::MIN_POSITIVE), own)
        }
        None => (factor, ratio),
    };
    (factors[0], ratios[0]) = told(&sums[0], (1.0, 1.0), doubt.whole.powi(2));
    for (node, element) in nodes.iter().enumerate() {
        let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
        let (mut brought, mut changed) = (0.0, 0.0);
        for child in children.clone() {
            (factors[child], ratios[child]) = told(&sums[child], (factors[node], ratios[node]), spreads[node]);
            brought += sums[child].brought;
            changed += sums[child].brought * factors[child];
        }
        // Of parts the dim ones know the least: they keep what they are believed to be, and light would be lost.
        let kept = factors[node] * brought / changed;
        if kept.is_finite() && kept > 0.0 {
            factors[children].iter_mut().for_each(|factor| *factor *= kept);
        }
    }
    factors
}

/// By node, the variance of its parts' ratios, relative to its own squared, as observations below it tell; as far as these say
/// little, that of what it is a part of.
///
/// A part whose ratio is r, of a whole of r', tells (r / r' - 1)² less what its noise makes of that, weighted by how well it knows it
/// (the moment estimator of R. DerSimonian and N. Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7, 1986).
fn spreads(elements: &Elements, sums: &[Sums], doubt: Doubt) -> Vec<f64> {
    let nodes = &elements.nodes;
    let believed = doubt.part.powi(2);
    let ratios: Vec<Option<(f64, f64)>> = sums.iter().map(|sums| sums.ratio(doubt.noise)).collect();
    // By node, weighted sums over all parts below it, and of the weights.
    let mut told = vec![[0.0_f64; 2]; nodes.len()];
    for node in (1..nodes.len()).rev() {
        let parent = nodes[node].parent as usize;
        if let (Some((own, variance)), Some((whole, _))) = (ratios[node], ratios[parent]) {
            let variance = variance / (whole * whole);
            // As far as it is the whole itself it does not differ.
            let rest = 1.0 - sums[node].brought / sums[parent].brought;
            let weight = (believed + variance).powi(-2);
            if weight > 0.0 && variance.is_finite() && rest > 0.0 {
                told[node][0] += weight * ((own / whole - 1.0).powi(2).min(MOST_APART) - rest * variance);
                told[node][1] += weight * rest;
            }
        }
        let [apart, weight] = told[node];
        told[parent][0] += apart;
        told[parent][1] += weight;
    }
    let prior = BELIEVED_PARTS * believed.powi(-2);
    let mut spreads = vec![believed; nodes.len()];
    for (node, [apart, weight]) in told.into_iter().enumerate() {
        let of_whole = if node == 0 { believed } else { spreads[nodes[node].parent as usize] };
        spreads[node] = ((apart + prior * of_whole) / (weight + prior)).clamp(believed, MOST_SPREAD * believed);
    }
    spreads
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::tests::Echo;
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;

    /// A cube whose ceiling shines, of which so much is reflected, solved.
    fn room(reflectance: f32) -> Solver {
        room_of([reflectance; 2], ())
    }

    /// The same with an extension; walls and what is above and below reflect as much.
    fn room_of<L: LightField>([walls, rest]: [f32; 2], field: L) -> Solver<L> {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let quad =
            |o: DVec3, a: DVec3, b: DVec3, material| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), material);
        let wall = DiffuseMaterial { reflectance: Rgb::splat(walls), exitance: Rgb::ZERO, two_sided: false };
        let floor = DiffuseMaterial { reflectance: Rgb::splat(rest), ..wall };
        let lamp = DiffuseMaterial { exitance: Rgb::ONE, ..floor };
        let o = DVec3::ZERO;
        let surfaces = vec![
            quad(o, x, y, 2),
            quad(z, y, x, 1),
            quad(o, y, z, 0),
            quad(x, z, y, 0),
            quad(o, z, x, 0),
            quad(y, x, z, 0),
        ];
        let input = SceneInput { surfaces, materials: vec![wall, lamp, floor], ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.03), field).expect("the room is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        solver
    }

    /// Factors by leaf, where links bring the leaves this share of what they should.
    fn factors(solver: &Solver, share: impl Fn(u32) -> f32, rays: usize) -> (Vec<u32>, Vec<f32>) {
        let light = solver.light();
        let mut expected = solver.gather.expected(light, &solver.links);
        for Expected { place, mean, square } in &mut expected {
            *mean *= share(*place);
            *square *= share(*place) * share(*place);
        }
        let watch = &mut || ControlFlow::Continue(());
        let seen = solver.gather.reflectances(light, &solver.links);
        let (factors, shot) = calibrate(light, (&expected, &seen), None, rays, watch).expect("nobody breaks");
        assert!(shot.abs_diff(rays as u64) < 2, "{shot} rays of {rays}");
        (expected.into_iter().map(|of| of.place).collect(), factors)
    }

    /// Where all links are proved free nothing is calibrated, and the rays are those that looked at what the solution is off by.
    #[test]
    fn rays_of_looks_are_counted() {
        let solver = room(0.5);
        assert_eq!(solver.stats.rays, 0, "nothing hides anything");
        assert!(solver.stats.error.is_some() && solver.stats.check_rays > 0, "{:?}", solver.stats);
    }

    #[test]
    fn what_is_missing_in_a_region_is_found() {
        let solver = room(0.5);
        let surface = |leaf: u32| solver.elements.nodes[leaf as usize].source;
        let (leaves, factors) = factors(&solver, |leaf| if surface(leaf) == 0 { 0.9 } else { 1.0 }, 200_000);
        for (wall, goal) in [(0, 1.0 / 0.9), (2, 1.0), (3, 1.0)] {
            let mine = || leaves.iter().zip(&factors).filter(|(leaf, _)| surface(**leaf) == wall);
            let mean = mine().map(|(_, factor)| factor).sum::<f32>() / mine().count() as f32;
            assert!((mean - goal).abs() < 0.025, "{wall}: {mean}, {goal}");
        }
    }

    /// Of bright parts much is known, of dim ones little: what these lack must not be missing from all there is.
    #[test]
    fn parts_change_together_by_what_their_whole_does() {
        let solver = room(0.5);
        let leaves = || solver.elements.patch_leaves().enumerate();
        let brought = |i: usize| if i.is_multiple_of(2) { 1.0 } else { 0.2 };
        let mut sums = vec![Sums::default(); solver.elements.nodes.len()];
        for (i, leaf) in leaves() {
            for ray in 0..8 {
                // All that is seen of the dim ones is in one ray of eight.
                let found = if i.is_multiple_of(2) { 1.0 } else { f64::from(u8::from(ray == 0)) * 8.0 * 0.3 };
                sums[leaf as usize].add(&Sums::of(found, brought(i), 0.0));
            }
        }
        let found = leaves().map(|(_, leaf)| (leaf, sums[leaf as usize]));
        let factors = super::factors(&solver.elements, found, OF_LINKS);
        let (mut before, mut after) = (0.0, 0.0);
        for (i, leaf) in leaves() {
            (before, after) = (before + brought(i), after + brought(i) * factors[leaf as usize]);
        }
        assert!(factors[0] > 1.03, "something is missing: {}", factors[0]);
        assert!((after / before - factors[0]).abs() < 1e-6, "{}, not {}", after / before, factors[0]);
    }

    /// Of what a part of a surface lacks more is believed where others near it differ as much: 30 % here, and 3 % are expected.
    #[test]
    fn parts_that_differ_tell_that_others_do() {
        let solver = room(0.5);
        let off = |differ: bool| {
            let found = solver.elements.patch_leaves().enumerate().map(|(i, leaf)| {
                let ratio = if !differ {
                    1.0
                } else if i.is_multiple_of(2) {
                    1.3
                } else {
                    0.7
                };
                // One leaf knows less than others, and lacks half.
                let (count, ratio) = if i == 5 { (20, 0.5) } else { (200, ratio) };
                let mut sums = Sums::default();
                (0..count).for_each(|ray| sums.add(&Sums::of(if ray % 2 == 0 { 2.0 * ratio } else { 0.0 }, 1.0, 1.0)));
                (leaf, sums)
            });
            let leaf = solver.elements.patch_leaves().nth(5).expect("there are more");
            1.0 - super::factors(&solver.elements, found, OF_LINKS)[leaf as usize]
        };
        let [alone, among_others] = [false, true].map(off);
        assert!(alone < 0.03, "it may be chance: {alone}");
        assert!(among_others > 0.08 && among_others > 3.0 * alone, "it is as others are: {among_others}, not {alone}");
    }

    /// Rays that miss what is small and bright do not know better.
    #[test]
    fn what_rays_may_miss_is_kept() {
        let solver = room(0.5);
        let factor = |variance: f64| {
            let found = solver.elements.patch_leaves().map(|leaf| {
                let mut sums = Sums::default();
                (0..10).for_each(|_| sums.add(&Sums::of(0.5, 1.0, variance)));
                (leaf, sums)
            });
            super::factors(&solver.elements, found, OF_LINKS)[0]
        };
        let few = solver.elements.patch_leaves().count() as f64 * 10.0;
        let (sure, unsure) = (factor(0.0), factor(few));
        assert!(sure < 0.6 && unsure > 0.98, "{sure}, {unsure}");
    }

    /// An extension's light is compared, too, by rays all over the hemisphere and by such as go where links say it comes from.
    #[test]
    fn what_an_extension_reflects_is_known() {
        let solver = room_of([0.5; 2], Echo { material: 0, albedo: 0.05, errs: false });
        let (light, expected) = (solver.light(), solver.gather.expected(solver.light(), &solver.links));
        let brought = Brought::known(light, &solver.links, solver.gather.arriving()).expect("an extension takes part");
        for (brought, missing) in [(None, 0.0), (Some(&brought), 0.0), (Some(&brought), 0.1)] {
            let less = |of: &Expected| Expected {
                mean: of.mean * (1.0 - missing),
                square: of.square * (1.0 - missing).powi(2),
                ..*of
            };
            let expected: Vec<Expected> = expected.iter().map(less).collect();
            let watch = &mut || ControlFlow::Continue(());
            let seen = vec![0.5; expected.len()];
            let (factors, _) = calibrate(light, (&expected, &seen), brought, 200_000, watch).expect("nobody breaks");
            let sum = |of: &dyn Fn(usize) -> f32| {
                let weight = |(i, expected): (usize, &Expected)| light.element(expected.place).area * of(i);
                expected.iter().enumerate().map(weight).sum::<f32>()
            };
            let mean = sum(&|i| factors[i] * expected[i].mean) / sum(&|i| expected[i].mean);
            assert!((mean * (1.0 - missing) - 1.0).abs() < 0.02, "{mean} where {missing} is missing");
        }
    }

    #[test]
    fn few_rays_change_little() {
        let solver = room(0.5);
        let (_, factors) = factors(&solver, |_| 1.0, 50);
        assert!(factors.iter().all(|factor| (factor - 1.0).abs() < 0.1), "{factors:?}");
    }

    /// What a wall reflects all of is seen with what absorbs some: light dies out, however much of what is missing comes back.
    #[test]
    fn what_reflects_all_may_be_brought_more() {
        let solver = room_of([1.0, 0.5], ());
        let (leaves, factors) = factors(&solver, |_| 0.9, 200_000);
        let walls =
            || leaves.iter().zip(&factors).filter(|(leaf, _)| solver.elements.nodes[**leaf as usize].importance == 1.0);
        let mean = walls().map(|(_, factor)| factor).sum::<f32>() / walls().count() as f32;
        assert!((mean - 1.0 / 0.9).abs() < 0.03, "{mean}");
        let seen = solver.gather.reflectances(solver.light(), &solver.links);
        for ((leaf, factor), seen) in leaves.iter().zip(&factors).zip(seen) {
            assert!(seen > 0.5 && factor * seen < 1.0, "{leaf}: {factor} of {seen}");
        }
    }

    /// Where nearly all is reflected light must go on dying out.
    #[test]
    fn hardly_anything_changes_where_nearly_all_is_reflected() {
        let solver = room(0.99);
        let (_, factors) = factors(&solver, |_| 0.7, 10_000);
        assert!(factors.iter().all(|&factor| factor > 1.0 && factor * 0.99 < 1.0), "{factors:?}");
    }

    #[test]
    fn where_no_light_is_reflected_nothing_changes() {
        let solver = room(0.0);
        let light = solver.light();
        let nothing = |place| Expected { place, mean: 0.0, square: 0.0 };
        let nothing: Vec<Expected> = light.elements.patch_leaves().map(nothing).collect();
        let answer =
            calibrate(light, (&nothing, &vec![0.0; nothing.len()]), None, 100, &mut || ControlFlow::Continue(()));
        assert_eq!(answer, Some((vec![1.0; nothing.len()], 0)));
    }
}

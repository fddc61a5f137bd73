//! Calibration: what arrives of reflected light is compared with what rays find, region by region.
//!
//! Rows of form factors (see [`leaf_rows`](crate::leaf_rows)) say how much is seen, not how bright it is: what is bright is
//! seen by chance a little too much or too little, all over a region alike, and each bounce repeats it. Rays from all over a
//! region know the mean, whatever the links. Few rays tell the mean of much, and little of a part; so each part is taken to be
//! as the whole that it belongs to, as far as its own rays do not know better. Of narrow lobes few rays see the peaks: places that
//! are lit by much directional light are left out.

use crate::hierarchy::Elements;
use crate::hooks::LightField;
use crate::residual::reflected_along;
use crate::sampling::{cosine_direction, hash, point4, unit};
use crate::segments::receiving_point;
use crate::threads::{self, prelude::*};
use crate::transport::Light;
use glam::Vec2;
use std::ops::ControlFlow;

/// What is believed before anything is compared, in relative terms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Doubt {
    /// How far (standard deviation) all the light that there is may be off, …
    whole: f64,
    /// … and that of each part from its whole's.
    part: f64,
    /// Variance of a single observation: at least so much.
    noise: f64,
}

/// Of what vertices gather, against the light of the leaves around.
pub(crate) const OF_VERTICES: Doubt = Doubt { whole: 0.1, part: 0.05, noise: 0.2 };
/// Of what links bring, against single rays.
const OF_LINKS: Doubt = Doubt { whole: 0.1, part: 0.03, noise: 0.25 };

/// Light is changed by no more than this factor, …
const MOST: f64 = 1.2;
/// … and by less where more than this share of it is reflected, in proportion to what is not. So rows of form factors times
/// reflectance stay below 1 if they were before. Within that what was found counts there as anywhere: what is wrong is repeated many
/// times, and that the rows' sums are right does not tell which of what is seen is bright.
const REFLECTED: f64 = 0.8;
/// Places that a thread looks from between two calls of `watch`: some milliseconds.
const BETWEEN_WATCHES: usize = 64;

/// Sums over observations: of what was found, of what is compared with it, and of the squares.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    found: f64,
    brought: f64,
    found2: f64,
    both: f64,
    brought2: f64,
}

impl Sums {
    /// Those of one observation.
    pub(crate) fn of(found: f64, brought: f64) -> Self {
        Self { found, brought, found2: found * found, both: found * brought, brought2: brought * brought }
    }

    fn add(&mut self, other: &Self) {
        self.found += other.found;
        self.brought += other.brought;
        self.found2 += other.found2;
        self.both += other.both;
        self.brought2 += other.brought2;
    }

    /// What is found over what is brought, and the variance of that.
    fn ratio(&self, noise: f64) -> Option<(f64, f64)> {
        let ratio = self.found / self.brought;
        let off2 = self.found2 - 2.0 * ratio * self.both + ratio * ratio * self.brought2;
        // A few may agree by chance.
        let variance = (off2.max(0.0) + noise * self.brought2) / (self.brought * self.brought);
        (ratio.is_finite() && variance.is_finite()).then_some((ratio, variance))
    }
}

/// Factors for reflected light, in the order of the places in `brought`, each with what links bring of it (sum of channels); from so
/// many rays, and how many were shot. `None` where `watch` breaks.
pub(crate) fn calibrate<L: LightField>(
    light: Light<'_, L>,
    brought: &[(u32, f32)],
    rays: usize,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<(Vec<f32>, u64)> {
    let weight = |&(place, brought): &(u32, f32)| {
        let element = light.element(place);
        let counts = brought > 0.0 && light.elements.exposed(place) >= 1.0;
        if counts { f64::from(element.area * element.importance) } else { 0.0 }
    };
    let (mut area, mut power) = (0.0, 0.0);
    for place in brought {
        area += weight(place);
        power += weight(place) * f64::from(place.1);
    }
    let mean = power / area;
    let total = 2.0 * power;
    if !(total > 0.0 && total.is_finite()) {
        return Some((vec![1.0; brought.len()], 0));
    }
    // How many rays start from each place, and what each of them counts.
    let mut sum = 0.0_f64;
    let counts: Vec<(u32, f64)> = brought
        .iter()
        .map(|place| {
            let share = weight(place) * (mean + f64::from(place.1)) / total * rays as f64;
            let first = sum.round() as u64;
            sum += share;
            let count = (sum.round() as u64 - first) as u32;
            (count, if share > 0.0 { weight(place) / share } else { 0.0 })
        })
        .collect();
    let look = |index: usize| {
        let ((place, brought), (count, each)) = (brought[index], counts[index]);
        let seed = hash(place, 0x1c0d);
        let mut sums = Sums::default();
        for ray in 0..count {
            let u = point4(seed, ray);
            let on = (unit(hash(hash(seed, 0x53), ray)), Vec2::new(u.z, u.w));
            let Some((x, n, surface)) = receiving_point(light, place, on) else { continue };
            let found = reflected_along(light, x, cosine_direction(n, u.x, u.y), surface);
            sums.add(&Sums::of(each * f64::from(found), each * f64::from(brought)));
        }
        sums
    };
    let mut found: Vec<Sums> = Vec::with_capacity(brought.len());
    while found.len() < brought.len() {
        if watch().is_break() {
            return None;
        }
        let part = found.len()..brought.len().min(found.len() + BETWEEN_WATCHES * threads::current_num_threads());
        found.par_extend(part.into_par_iter().with_min_len(8).map(look));
    }
    let factors = factors(light.elements, brought.iter().map(|place| place.0).zip(found), OF_LINKS);
    let factor = |&(place, _): &(u32, f32)| {
        let absorbed = (1.0 - f64::from(light.element(place).importance)) / (1.0 - REFLECTED);
        let most = 1.0 + (MOST - 1.0) * absorbed.clamp(0.0, 1.0);
        factors[place as usize].clamp(most.recip(), most) as f32
    };
    Some((brought.iter().map(factor).collect(), counts.iter().map(|(count, _)| u64::from(*count)).sum()))
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
    let mut factors = vec![1.0_f64; nodes.len()];
    let mut ratios = vec![1.0_f64; nodes.len()];
    // What tells a part from its whole is the difference of what was found: the whole has been told already.
    let told = |sums: &Sums, (factor, ratio): (f64, f64), off: f64| match sums.ratio(doubt.noise) {
        Some((own, variance)) => {
            let prior = (off * ratio).powi(2);
            (factor + (own - ratio) * prior / (prior + variance).max(f64::MIN_POSITIVE), own)
        }
        None => (factor, ratio),
    };
    (factors[0], ratios[0]) = told(&sums[0], (1.0, 1.0), doubt.whole);
    for (node, element) in nodes.iter().enumerate() {
        let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
        let (mut brought, mut changed) = (0.0, 0.0);
        for child in children.clone() {
            (factors[child], ratios[child]) = told(&sums[child], (factors[node], ratios[node]), doubt.part);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::tests::Echo;
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;

    /// A cube whose ceiling shines, with walls of which so much is reflected, solved.
    fn room(reflectance: f32) -> Solver {
        room_with(reflectance, ())
    }

    /// The same with an extension.
    fn room_with<L: LightField>(reflectance: f32, field: L) -> Solver<L> {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let quad =
            |o: DVec3, a: DVec3, b: DVec3, material| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), material);
        let wall = DiffuseMaterial { reflectance: Rgb::splat(reflectance), exitance: Rgb::ZERO, two_sided: false };
        let lamp = DiffuseMaterial { exitance: Rgb::ONE, ..wall };
        let o = DVec3::ZERO;
        let surfaces = vec![
            quad(o, x, y, 0),
            quad(z, y, x, 1),
            quad(o, y, z, 0),
            quad(x, z, y, 0),
            quad(o, z, x, 0),
            quad(y, x, z, 0),
        ];
        let input = SceneInput { surfaces, materials: vec![wall, lamp], ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.05), field).expect("the room is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        solver
    }

    /// Factors by leaf, where links bring the leaves this share of what they should.
    fn factors(solver: &Solver, share: impl Fn(u32) -> f32, rays: usize) -> (Vec<u32>, Vec<f32>) {
        let light = solver.light();
        let mut brought = solver.gather.diffuse(light, &solver.links);
        for (leaf, brought) in &mut brought {
            *brought *= share(*leaf);
        }
        let watch = &mut || ControlFlow::Continue(());
        let (factors, shot) = calibrate(light, &brought, rays, watch).expect("nobody breaks");
        assert!(shot.abs_diff(rays as u64) < 2, "{shot} rays of {rays}");
        (brought.into_iter().map(|leaf| leaf.0).collect(), factors)
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
                sums[leaf as usize].add(&Sums::of(found, brought(i)));
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

    /// An extension's light is compared, too.
    #[test]
    fn nothing_changes_where_nothing_is_missing() {
        let solver = room_with(0.5, Echo { material: 0, albedo: 0.05, errs: false });
        let (light, brought) = (solver.light(), solver.gather.reflected(solver.light(), &solver.links));
        let (factors, _) =
            calibrate(light, &brought, 200_000, &mut || ControlFlow::Continue(())).expect("nobody breaks");
        let sum = |of: &dyn Fn(usize) -> f32| {
            let weight = |(i, &(leaf, _)): (usize, &(u32, f32))| light.element(leaf).area * of(i);
            brought.iter().enumerate().map(weight).sum::<f32>()
        };
        let mean = sum(&|i| factors[i] * brought[i].1) / sum(&|i| brought[i].1);
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
    }

    #[test]
    fn few_rays_change_little() {
        let solver = room(0.5);
        let (_, factors) = factors(&solver, |_| 1.0, 50);
        assert!(factors.iter().all(|factor| (factor - 1.0).abs() < 0.1), "{factors:?}");
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
        let nothing: Vec<(u32, f32)> = light.elements.patch_leaves().map(|leaf| (leaf, 0.0)).collect();
        let answer = calibrate(light, &nothing, 100, &mut || ControlFlow::Continue(()));
        assert_eq!(answer, Some((vec![1.0; nothing.len()], 0)));
    }
}

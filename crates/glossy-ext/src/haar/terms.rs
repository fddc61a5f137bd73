//! Which terms of a sum are evaluated where, while it is projected.
//!
//! At a leaf some forty samples arrive, and the sum of their lobes is rough only where one of them has its peak. All others are
//! smooth there: linear over a triangle much smaller than the distance to their peaks. So before a triangle is divided, each
//! term is looked at: what is as good as linear is interpolated from there on down, between the corners of that triangle, and only the
//! rest is evaluated at new vertices.

use crate::Rgb;
use crate::basis::triangle::{ConeTest, Triangle, child_corners, midpoints};
use crate::basis::{Peak, Superposition};
use glam::Vec3;
use hr_diffuse::Cone;
use std::f32::consts::PI;

/// What is interpolated from a triangle on may be wrong by this share of what the refiner lets pass there. Of each level there are some
/// such terms, and what they are wrong by hardly adds up.
const SHARE: f32 = 0.03;
/// A term is wrong by at least this share of how much it varies over the triangle, as four samples may happen to lie on a
/// line.
const LEAST_BEND: f32 = 1.0 / 32.0;
/// Fewer terms are not looked at one by one, and neither are more than there are numbers for.
const FEWEST: u32 = 6;
const MOST: u32 = 1 << 16;
/// Nothing was kept of a point.
const NONE: u32 = u32::MAX;

/// Which terms are evaluated in a triangle, and what all others add up to.
///
/// Tails of lobes are convex, so that linear interpolation would make too much of all of them. Between corners there is what
/// each term was found to lack in the middle, times 3 (ab + bc + ca) of the barycentric coordinates: that is exact for curvature that is the
/// same in all directions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Active {
    first: u32,
    end: u32,
    /// At the corners.
    others: [Rgb; 3],
    /// In the middle, beyond the mean of the corners.
    bend: Rgb,
}

impl Active {
    /// That of a child before it is looked at.
    pub(super) fn of_child(&self, place: usize) -> Self {
        let mids = midpoints(self.others).map(|mid| mid + 0.75 * self.bend);
        Self { others: child_corners(self.others, mids, place), bend: 0.25 * self.bend, ..*self }
    }

    fn count(&self) -> u32 {
        self.end - self.first
    }
}

/// What was found at a point: the values of the terms that were evaluated there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    active: [u32; 2],
    values: u32,
}

impl Found {
    pub(super) const NOTHING: Self = Self { active: [0; 2], values: NONE };
}

/// The terms of a sum while it is projected.
pub(super) struct Terms<'a, S: Superposition> {
    sum: &'a S,
    peaks: Vec<Option<ConeTest>>,
    /// Lists of terms, one after the other: each is sorted, and a part of a list before it.
    indices: Vec<u16>,
    listed: Vec<S::Term>,
    /// Values of terms, as lists of points refer to them.
    values: Vec<Rgb>,
    pub(super) evaluated: usize,
    pub(super) interpolated: usize,
}

impl<'a, S: Superposition> Terms<'a, S> {
    pub(super) fn new(sum: &'a S) -> Self {
        let listed = sum.terms().to_vec();
        let indices = (0..listed.len() as u32).map(|i| i as u16).collect();
        let peaks = if !(FEWEST as usize..=MOST as usize).contains(&listed.len()) {
            Vec::new()
        } else {
            let cone = |peak: Peak| Cone { axis: peak.direction, cos_angle: peak.width.clamp(0.0, PI).cos() };
            listed.iter().map(|term| Some(ConeTest::new(&cone(sum.peak(term))))).collect()
        };
        Self { sum, peaks, indices, listed, values: Vec::new(), evaluated: 0, interpolated: 0 }
    }

    /// All terms.
    pub(super) fn all(&self) -> Active {
        Active { first: 0, end: self.sum.terms().len() as u32, others: [Rgb::ZERO; 3], bend: Rgb::ZERO }
    }

    /// Whether terms are looked at one by one.
    pub(super) fn is_partible(&self, active: &Active) -> bool {
        (FEWEST..=MOST).contains(&active.count())
    }

    /// The function in a unit direction, at the point of a triangle whose barycentric coordinates are given, and what is kept of it.
    pub(super) fn at(&mut self, active: &Active, at: Vec3, direction: Vec3) -> (Rgb, Found) {
        let others = active.others[0] * at.x
            + active.others[1] * at.y
            + active.others[2] * at.z
            + active.bend * (3.0 * (at.x * at.y + at.y * at.z + at.z * at.x));
        let terms = &self.listed[active.first as usize..active.end as usize];
        self.evaluated += terms.len();
        self.interpolated += self.sum.terms().len() - terms.len();
        if !self.is_partible(active) {
            return (self.sum.value(direction, others + self.sum.add_up(terms, direction)), Found::NOTHING);
        }
        let first = self.values.len();
        self.values.resize(first + terms.len(), Rgb::ZERO);
        self.sum.each(terms, direction, &mut self.values[first..]);
        let found = Found { active: [active.first, active.end], values: first as u32 };
        (self.sum.value(direction, others + self.values[first..].iter().sum::<Rgb>()), found)
    }

    /// The value of a term at a point.
    fn term(&mut self, index: u32, found: &Found, position: Vec3) -> Rgb {
        let term = self.indices[index as usize];
        let [first, end] = found.active;
        if found.values != NONE
            && let Ok(place) = self.indices[first as usize..end as usize].binary_search(&term)
        {
            return self.values[found.values as usize + place];
        }
        self.evaluated += 1;
        self.sum.add_up(&self.listed[index as usize..=index as usize], position.normalize())
    }

    /// What of a triangle that is about to be divided is interpolated from there on: what is smooth and together wrong by no more than a share
    /// of `tolerance`. What was found at its corners and in its middle is given.
    pub(super) fn part(&mut self, active: Active, triangle: &Triangle, found: &[Found; 4], tolerance: f32) -> Active {
        let [a, b, c] = triangle.corners;
        let positions = [a, b, c, triangle.center()];
        let mut smooth: Vec<(f32, u32, [Rgb; 4])> = Vec::new();
        for index in active.first..active.end {
            let [a, b, c, middle] = [0, 1, 2, 3].map(|point| self.term(index, &found[point], positions[point]));
            let bend = middle - (a + b + c) / 3.0;
            let range = (a.max(b).max(c).max(middle) - a.min(b).min(c).min(middle)).max_element();
            let off = bend.abs().max_element().max(LEAST_BEND * range);
            let peak = &self.peaks[usize::from(self.indices[index as usize])];
            if off <= SHARE * tolerance && !peak.as_ref().is_some_and(|peak| triangle.touches(peak)) {
                smooth.push((off, index, [a, b, c, bend]));
            }
        }
        smooth.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut off = 0.0;
        let within = smooth.iter().take_while(|term| {
            off += term.0;
            off <= SHARE * tolerance
        });
        let count = within.count();
        smooth.truncate(count);
        if smooth.is_empty() {
            return active;
        }
        smooth.sort_unstable_by_key(|term| term.1);
        let mut parted = Active { first: self.indices.len() as u32, ..active };
        let mut leaving = smooth.iter().peekable();
        for index in active.first..active.end {
            if let Some((_, _, values)) = leaving.next_if(|term| term.1 == index) {
                std::iter::zip(&mut parted.others, values).for_each(|(others, value)| *others += *value);
                parted.bend += values[3];
            } else {
                self.indices.push(self.indices[index as usize]);
                self.listed.push(self.listed[index as usize]);
            }
        }
        parted.end = self.indices.len() as u32;
        parted
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Haar, Known, Refinement};
    use super::*;

    /// Lobes of one width and of all directions and strengths, as many samples make them.
    struct Lobes {
        lobes: Vec<(Vec3, f32)>,
        width: f32,
    }

    impl Lobes {
        fn new(count: u16, width: f32) -> Self {
            let lobe = |k: u16| {
                let z = 1.0 - (2.0 * f32::from(k) + 1.0) / f32::from(count);
                let (sin, cos) = (2.399_963_2 * f32::from(k)).sin_cos();
                let strength = 0.1 + f32::from(k % 7).powi(2);
                (Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z, strength)
            };
            Self { lobes: (0..count).map(lobe).collect(), width }
        }
    }

    impl Superposition for Lobes {
        type Term = (Vec3, f32);

        fn terms(&self) -> &[(Vec3, f32)] {
            &self.lobes
        }

        fn peak(&self, &(direction, _): &(Vec3, f32)) -> Peak {
            Peak { direction, width: self.width }
        }

        /// With the tails of the GGX model.
        fn add_up(&self, lobes: &[(Vec3, f32)], direction: Vec3) -> Rgb {
            let lobe = |&(axis, strength): &(Vec3, f32)| {
                strength * (1.0 + direction.distance_squared(axis) / (2.0 * self.width * self.width)).powi(-2)
            };
            Rgb::splat(lobes.iter().map(lobe).sum())
        }

        fn value(&self, _: Vec3, sum: Rgb) -> Rgb {
            sum
        }
    }

    /// What is interpolated changes much less than the refiner lets be wrong, a tenth of what it is.
    #[test]
    fn interpolated_terms_make_no_difference() {
        for width in [0.03, 0.1, 0.3] {
            let lobes = Lobes::new(48, width);
            let peaks: Vec<Peak> = lobes.lobes.iter().map(|lobe| lobes.peak(lobe)).collect();
            let (settings, known) = (Refinement::default(), Known { peaks: &peaks, ..Known::NOTHING });
            let all = Haar::project(&settings, &known, |direction| lobes.at(direction));
            let few = Haar::project_sum(&settings, &known, &lobes);
            assert_eq!(all.interpolated, 0, "a function that is no sum");
            assert!(few.interpolated > few.terms, "most terms are: {} of {}", few.interpolated, few.terms);
            let (mut off, mut without, mut total) = (0.0, 0.0, 0.0);
            for direction in Lobes::new(20_000, width).lobes.into_iter().map(|(direction, _)| direction) {
                let right = lobes.at(direction).x;
                off += (few.distribution.eval(direction).x - right).abs();
                without += (all.distribution.eval(direction).x - right).abs();
                total += right;
            }
            // Some levels may each add SHARE to what is off.
            assert!(off < 1.05 * without, "width {width}: off by {} instead of {}", off / total, without / total);
            let power = few.distribution.integral().x / all.distribution.integral().x - 1.0;
            // As SHARE of the tenth by which linear interpolation may be off.
            assert!(power.abs() < SHARE * 0.1, "width {width}: {power} more power");
            let before = all.evaluations * lobes.lobes.len();
            assert!(2 * few.terms < before, "width {width}: {} of {before} evaluations of terms", few.terms);
        }
    }

    /// A sum of few terms is taken as it is, bit by bit.
    #[test]
    fn few_terms_are_all_evaluated() {
        let lobes = Lobes::new(FEWEST as u16 - 1, 0.1);
        let all = Haar::project(&Refinement::default(), &Known::NOTHING, |direction| lobes.at(direction));
        let sum = Haar::project_sum(&Refinement::default(), &Known::NOTHING, &lobes);
        assert_eq!((all.distribution, all.evaluations * 5), (sum.distribution, sum.terms), "nothing is left out");
    }
}

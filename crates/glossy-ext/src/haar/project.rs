//! Top-down projection (paper, section 4.2).

use super::mesh::{Mesh, Midpoint, NO_VERTEX, Tri};
use super::terms::{Active, Found, Terms};
use super::{Haar, MAX_LEVEL, MAX_UNIFORM_LEVEL};
use crate::Rgb;
use crate::basis::triangle::{ConeTest, Triangle, midpoints};
use crate::basis::{Known, Peak, Projected, Sampler, Superposition, Support};
use glam::Vec3;
use hr_diffuse::Cone;
use std::cell::RefCell;
use std::f32::consts::{FRAC_PI_2, PI};

/// Where a function is brighter than this share of its largest value, …
const BRIGHT: f32 = 0.3;
/// … interpolation is wrong by no more than this, relative to it, or the top of a wide highlight would be cut off.
const BRIGHT_ERROR: f32 = 0.15;

/// When a triangle is subdivided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refiner {
    /// Where the difference between the largest and the smallest sample exceeds this fraction (0.1 to 0.5) of the
    /// value in the middle: the paper's choice. Where a function is linear, it subdivides in vain.
    Relative(f32),
    /// Where that difference exceeds this threshold, in the unit of the function. Shows ringing around highlights
    /// (paper, figure 8).
    Absolute(f32),
    /// Where linear interpolation misses the sample in the middle, or a vertex that is known in the middle of an
    /// edge, by more than this fraction (0.02 to 0.2) of the value in the middle. Needs half the basis functions of
    /// `Relative` for the same error on lobes as wide as cos¹⁰, as many on narrow ones.
    Interpolation(f32),
}

/// How finely functions are represented; the same for all distributions of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// Subdivide everywhere down to this level, lest peaks be missed between the samples; at most
    /// [`MAX_UNIFORM_LEVEL`]. "m" in the paper's tables.
    pub min_level: u8,
    /// Subdivide nowhere below this level, at most [`MAX_LEVEL`]. A triangle of level n is 90°/2ⁿ wide. "M".
    pub max_level: u8,
    /// Where to subdivide between the two.
    pub refiner: Refiner,
    /// For the relative refiner: values below this fraction of the distribution's largest one count as being that
    /// large, so that the dark flanks of a lobe, where every difference is large relative to the value, are not
    /// subdivided down to the last level. 0 for the paper's criterion.
    pub negligible: f32,
    /// Whether to sample the middle of undivided triangles too and let vertex values keep the mean that follows,
    /// rather than interpolate exactly. Takes up to 1.8 times the evaluations for a given subdivision; the mean error
    /// of interpolation falls to 0.6 times, as convex functions are no longer overestimated everywhere.
    pub preserve_energy: bool,
}

impl Default for Refinement {
    /// Levels 1 to 6, interpolation to 10%: lobes from cos¹⁰ to cos³⁰⁰ with 600 to 1,500 basis functions, a mean
    /// error of 2 to 3% of the lobe and less than 0.5% in energy.
    fn default() -> Self {
        Self {
            min_level: 1,
            max_level: 6,
            refiner: Refiner::Interpolation(0.1),
            negligible: 1e-2,
            preserve_energy: true,
        }
    }
}

impl Refinement {
    pub(super) fn min_level(&self) -> u8 {
        self.min_level.min(MAX_UNIFORM_LEVEL).min(self.max_level)
    }

    pub(super) fn max_level(&self) -> u8 {
        self.max_level.min(MAX_LEVEL)
    }

    /// The settings of the paper's table 3: ε = 0.5, levels 1 to 5, interpolation of samples.
    pub const PAPER: Self =
        Self { min_level: 1, max_level: 5, refiner: Refiner::Relative(0.5), negligible: 0.0, preserve_energy: false };

    /// Whether a triangle must be subdivided. `center` includes the offset; `largest` is the largest component met
    /// so far, `error` how exact interpolation is to be.
    pub(super) fn is_rough(&self, variation: &Variation, center: Rgb, largest: f32, error: f32) -> bool {
        let size = self.size(center, largest);
        let spread = self.spread(variation);
        match self.refiner {
            Refiner::Relative(epsilon) => spread > epsilon * size,
            Refiner::Interpolation(epsilon) => {
                let error = interpolated(epsilon, error);
                let bright = size > BRIGHT * largest;
                spread > size * if bright { error.min(BRIGHT_ERROR.max(epsilon)) } else { error }
            }
            Refiner::Absolute(threshold) => spread > threshold,
        }
    }

    /// What linear interpolation may be wrong by where a triangle is not divided; 0 where the refiner does not ask for that.
    pub(super) fn allowed(&self, center: Rgb, largest: f32, error: f32) -> f32 {
        match self.refiner {
            Refiner::Relative(_) | Refiner::Absolute(_) => 0.0,
            Refiner::Interpolation(epsilon) => interpolated(epsilon, error) * self.size(center, largest),
        }
    }

    /// What differences count relative to.
    fn size(&self, center: Rgb, largest: f32) -> f32 {
        center.abs().max_element().max(self.negligible * largest)
    }

    /// What differs over a triangle, as the refiner sees it.
    fn spread(&self, variation: &Variation) -> f32 {
        match self.refiner {
            Refiner::Relative(_) | Refiner::Absolute(_) => (variation.high - variation.low).max_element(),
            Refiner::Interpolation(_) => variation.deviation,
        }
    }
}

/// What interpolation may be wrong by, relative to the function: what is known of that, or else what the refiner says.
fn interpolated(epsilon: f32, error: f32) -> f32 {
    if error < 1.0 { error } else { epsilon }
}

/// How a function varies over a triangle, as far as is known.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Variation {
    pub(super) low: Rgb,
    pub(super) high: Rgb,
    /// Largest component of the difference to linear interpolation.
    pub(super) deviation: f32,
}

/// A peak made ready: the cone about it and the level down to which that is refined.
fn peak_test(peak: &Peak, max_level: u8) -> Option<(ConeTest, u8)> {
    if !peak.direction.is_finite() || peak.direction == Vec3::ZERO {
        return None;
    }
    let level = level_of(peak.width, max_level);
    let cone = Cone { axis: peak.direction.normalize(), cos_angle: peak.width.clamp(0.0, PI).cos() };
    Some((ConeTest::new(&cone), level))
}

/// The level whose triangles are no wider than an angle (radians), if there is one up to `max_level`, else that.
fn level_of(width: f32, max_level: u8) -> u8 {
    (0..max_level).find(|&level| FRAC_PI_2 * 0.5_f32.powi(level.into()) <= width).unwrap_or(max_level)
}

/// What has been found out about a triangle of the mesh.
#[derive(Clone, Copy, Default)]
struct Finding {
    /// The function in its middle, if sampled.
    center: Option<(Rgb, Found)>,
    /// The terms that are evaluated in it.
    active: Active,
    /// Not to be tested: the parent was smooth and is divided for balance only.
    accepted: bool,
}

impl Haar {
    /// Projects a function of a unit direction (paper, section 4.2): samples it at the corners and in the middle
    /// of triangles, and divides those over which the samples differ too much. Corners are sampled once however
    /// many triangles share them. Values that are not finite count as 0.
    ///
    /// Depends on nothing but the arguments: the same function gives the same distribution, bit by bit.
    pub fn project(settings: &Refinement, known: &Known<'_>, f: impl FnMut(Vec3) -> Rgb) -> Projected<Self> {
        Self::project_sum(settings, known, &Whole(RefCell::new(f)))
    }

    /// The same of a sum of terms. With [`Refiner::Interpolation`] those that are smooth around some directions are interpolated
    /// between these, if that changes much less than the refiner lets be wrong.
    pub fn project_sum(settings: &Refinement, known: &Known<'_>, sum: &impl Superposition) -> Projected<Self> {
        let max_level = level_of(known.finest, settings.max_level());
        let min_level = settings.min_level().min(max_level);
        let support = known.support.as_ref();
        let within = support.map(|s| ConeTest::new(&s.cone));
        let peaks: Vec<_> = known.peaks.iter().filter_map(|p| peak_test(p, max_level)).collect();
        let peak_level = peaks.iter().map(|p| p.1).max().unwrap_or(0);

        let mut samples = Samples { sampler: Sampler::new(support), terms: Terms::new(sum), vertices: Vec::new() };
        let all = samples.terms.all();
        let mut mesh = Mesh::new(|p| samples.vertex(&all, Vec3::ZERO, p));
        let mut findings = vec![Finding { active: all, ..Finding::default() }; mesh.tris.len()];
        let (mut truncated, mut spared) = (false, 0);
        // The mesh grows while it is walked, coarse triangles first.
        let mut next = 0;
        while next < mesh.tris.len() {
            let index = next;
            next += 1;
            let tri = mesh.tris[index];
            if tri.is_divided() || findings[index].accepted {
                continue;
            }
            let triangle = mesh.triangle(index as u32);
            if within.as_ref().is_some_and(|w| !triangle.touches(w)) {
                findings[index].accepted = true;
                continue;
            }
            let may_divide = tri.level < max_level && !truncated;
            let forced = tri.level < min_level
                || tri.level < peak_level && peaks.iter().any(|(c, l)| tri.level < *l && triangle.touches(c));
            let divide = may_divide
                && (forced || {
                    let center = samples.center(&mut findings[index], &triangle);
                    let variation = variation(&samples.sampler, &mesh, &tri, &triangle, center);
                    let middle = center + known.offset;
                    let is_rough = settings.is_rough(&variation, middle, samples.sampler.largest, known.error);
                    let counts = is_rough && settings.spread(&variation) > known.negligible;
                    spared += usize::from(is_rough && !counts);
                    counts
                });
            if !divide {
                findings[index].accepted = true;
                if settings.preserve_energy {
                    samples.center(&mut findings[index], &triangle);
                }
                continue;
            }
            samples.part(&mut findings[index], &tri, &triangle, |center, largest| {
                settings.allowed(center + known.offset, largest, known.error).max(known.negligible)
            });
            truncated |= !mesh.divide(index as u32, &mut |m: &Midpoint| {
                let mut at = Vec3::splat(0.5);
                at[m.edge] = 0.0;
                samples.vertex(&findings[m.tri as usize].active, at, m.position)
            });
            inherit(&mesh, &mut findings);
        }
        if settings.preserve_energy {
            keep_means(&mut mesh, &findings, support);
        }
        let Terms { evaluated, interpolated, .. } = samples.terms;
        let projected = samples.sampler.projected(mesh.pack());
        Projected { truncated, spared, terms: evaluated, interpolated, ..projected }
    }
}

/// A function that is no sum: one term.
struct Whole<F>(RefCell<F>);

impl<F: FnMut(Vec3) -> Rgb> Superposition for Whole<F> {
    type Term = ();

    fn terms(&self) -> &[()] {
        &[()]
    }

    fn peak(&self, (): &()) -> Peak {
        Peak { direction: Vec3::Z, width: PI }
    }

    fn add_up(&self, _: &[()], direction: Vec3) -> Rgb {
        self.0.borrow_mut()(direction)
    }

    fn value(&self, _: Vec3, sum: Rgb) -> Rgb {
        sum
    }
}

/// How a sum is sampled, and what was found.
struct Samples<'a, S: Superposition> {
    sampler: Sampler<'a>,
    terms: Terms<'a, S>,
    /// By vertex of the mesh.
    vertices: Vec<Found>,
}

impl<S: Superposition> Samples<'_, S> {
    /// The value at a point of a triangle whose barycentric coordinates there are `at`.
    fn at(&mut self, active: &Active, at: Vec3, position: Vec3) -> (Rgb, Found) {
        let mut found = Found::NOTHING;
        let terms = &mut self.terms;
        let value = self.sampler.at(position, |direction| {
            let (value, here) = terms.at(active, at, direction);
            found = here;
            value
        });
        (value, found)
    }

    /// The same at a new vertex.
    fn vertex(&mut self, active: &Active, at: Vec3, position: Vec3) -> Rgb {
        let (value, found) = self.at(active, at, position);
        self.vertices.push(found);
        value
    }

    /// The sample in the middle of a triangle, taken once. It counts as zero outside the support.
    fn center(&mut self, finding: &mut Finding, triangle: &Triangle) -> Rgb {
        let active = finding.active;
        finding.center.get_or_insert_with(|| self.at(&active, Vec3::splat(1.0 / 3.0), triangle.center())).0
    }

    /// Finds out which terms need not be evaluated in the parts of a triangle: none where some of it is outside the support, as nothing is
    /// known there.
    fn part(&mut self, finding: &mut Finding, tri: &Tri, triangle: &Triangle, allowed: impl Fn(Rgb, f32) -> f32) {
        let is_inside = |position: &Vec3| self.sampler.is_inside(*position);
        if !self.terms.is_partible(&finding.active) || !triangle.corners.iter().all(is_inside) {
            return;
        }
        let center = self.center(finding, triangle);
        let allowed = allowed(center, self.sampler.largest);
        let [a, b, c] = tri.corners.map(|vertex| self.vertices[usize::from(vertex)]);
        let middle = finding.center.map_or(Found::NOTHING, |(_, found)| found);
        finding.active = self.terms.part(finding.active, triangle, &[a, b, c, middle], allowed);
    }
}

/// Variation of the samples inside the support: the step at its border is no reason to subdivide.
fn variation(sampler: &Sampler<'_>, mesh: &Mesh, tri: &Tri, triangle: &Triangle, center: Rgb) -> Variation {
    let corners = mesh.corner_values(tri);
    let mut range: Option<(Rgb, Rgb)> = None;
    let mut extend = |v: Rgb| range = Some(range.map_or((v, v), |(low, high)| (low.min(v), high.max(v))));
    let mut all_inside = true;
    for (position, value) in std::iter::zip(triangle.corners, corners) {
        if sampler.is_inside(position) {
            extend(value);
        } else {
            all_inside = false;
        }
    }
    if sampler.is_inside(triangle.center()) {
        extend(center);
    }
    let mut deviation = (center - (corners[0] + corners[1] + corners[2]) / 3.0).abs();
    if all_inside && tri.mids != [NO_VERTEX; 3] {
        for (mid, between) in std::iter::zip(mesh.mid_values(tri), midpoints(corners)) {
            extend(mid);
            deviation = deviation.max((mid - between).abs());
        }
    }
    let (low, high) = range.unwrap_or_default();
    // Across the border the interpolation is unknown. A parabola deviates from its chord by a quarter of its range.
    let deviation = if all_inside { deviation } else { (high - low) * 0.25 };
    Variation { low, high, deviation: deviation.max_element() }
}

/// Findings for triangles that are new: the middle of a triangle is the middle of its middle child.
fn inherit(mesh: &Mesh, findings: &mut Vec<Finding>) {
    for tri in &mesh.tris[findings.len()..] {
        let Finding { center, active, accepted } = findings[tri.parent as usize];
        let active = active.of_child(usize::from(tri.place));
        findings.push(Finding { center: center.filter(|_| tri.place == 3), active, accepted });
    }
}

/// Vertex values that keep the means of the triangles.
///
/// Over a triangle, corners and centroid with weights 1/12 and 3/4 integrate quadratic functions exactly: the
/// mean is that of the interpolation plus 3/4 of what it lacks in the middle. The same holds for a triangle with
/// some midpoints on its edges, each of which takes 3/4 of its edge's share from both.
fn keep_means(mesh: &mut Mesh, findings: &[Finding], support: Option<&Support>) {
    let outside = |p: Vec3| support.is_some_and(|s| !s.contains(p));
    let means: Vec<Option<Rgb>> = std::iter::zip(&mesh.tris, findings)
        .map(|(tri, finding)| {
            // The mean of a triangle that the border cuts is not known from its samples.
            if support.is_some() && tri.corners.iter().any(|&v| outside(mesh.positions[usize::from(v)])) {
                return None;
            }
            let (center, _) = finding.center.filter(|_| !tri.is_divided())?;
            let interpolated: Rgb = mesh.mid_values(tri).iter().sum::<Rgb>() / 3.0;
            Some(mesh.mean(tri) + 0.75 * (center - interpolated))
        })
        .collect();
    mesh.preserve_means(&means, outside);
}

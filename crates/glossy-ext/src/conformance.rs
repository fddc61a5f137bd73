//! Checks of a [`Reflector`], for whoever writes one: what a solution relies on, in words where it does not hold.
//!
//! ```
//! use glossy_ext::{Phong, Rgb, conformance};
//!
//! let varnish = Phong::new(Rgb::splat(0.4), Rgb::splat(0.5), 50.0)?;
//! let measured = conformance::check(&varnish)?;
//! assert!(measured.largest_albedo <= 0.9001, "{measured:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What is checked, from the normal to 0.1° above the horizon:
//!
//! - values are finite and not negative, 0 below the horizon, [reciprocal](Fault::NotReciprocal) to 10⁻³, and
//!   [isotropic](Fault::NotIsotropic) unless there is a grain;
//! - no more is reflected than arrives, in any direction ([`Fault::Energy`], to 1 %);
//! - what a reflector says of itself: the split into [`diffuse`](Reflector::diffuse) and [`glossy`](Reflector::glossy),
//!   means over senders, sums, albedo, samples;
//! - [`glossy_bound`](Reflector::glossy_bound) holds over cones of directions;
//! - the [`lobe`](Reflector::lobe) is at the peak (outgoing directions up to 60°), and a Gaussian of its width and the
//!   peak's height has about the energy that there is.
//!
//! Peaks are looked for about the mirror direction, the outgoing one, the normal, and where the lobe is said to be.
//! A narrow one elsewhere may be missed. A check takes about a million evaluations, a second at most for what is
//! given in closed form.

mod fault;
mod quadrature;
#[cfg(test)]
mod tests;

pub use fault::{Fault, Pair};

use crate::reflector::{HORIZON, Incident, Lobe, Reflector};
use glam::{Vec2, Vec3};
use hr_diffuse::{Cone, Rgb};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, TAU};
use std::fmt;
use std::mem::discriminant;

/// What a check found out about a reflector that passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Largest share of light reflected toward any outgoing direction tried, largest channel, mirror included.
    pub largest_albedo: f32,
    /// Cosine-weighted mean of the glossy part's share over outgoing directions.
    pub glossy_albedo: Rgb,
}

/// One kind of fault and how often it was met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// The worst case.
    pub fault: Fault,
    /// Number of cases.
    pub count: u32,
}

/// Why a reflector fails: the worst case of every kind of fault.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Faults(Vec<Finding>);

impl Faults {
    /// Each kind once.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.0
    }
}

impl std::error::Error for Faults {}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the reflector does not conform:")?;
        for finding in &self.0 {
            write!(f, "\n- {}", finding.fault)?;
            if finding.count > 1 {
                write!(f, " (the worst of {} cases)", finding.count)?;
            }
        }
        Ok(())
    }
}

/// Angles to the normal in degrees where values are compared.
const POLARS: [f32; 9] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0, 89.0, 89.9];
/// Azimuths in degrees, none the image of another.
const AZIMUTHS: [f32; 3] = [0.0, 37.0, 130.0];
/// Azimuths in degrees of outgoing directions that are integrated for where there is a grain. Lobes are along the axes or
/// along the plane of reflection, and the grid of the quadrature is along both.
const GRAIN_AZIMUTHS: [f32; 4] = [0.0, 45.0, 90.0, 135.0];
/// Angles in degrees where the albedo is looked at beside those that its mean is made of.
const GRAZING: [f32; 3] = [85.0, 89.0, 89.9];
/// Levels of cos² for means over outgoing directions.
const LEVELS: usize = 8;
/// Offsets in radians from likely peaks.
const OFFSETS: [f32; 7] = [0.0, 1e-4, 1e-3, 1e-2, 0.05, 0.2, 0.6];
/// Relative differences that rounding and approximations of built-in functions may make.
const RELATIVE: f32 = 1e-3;
/// Means over disks may be off by this share of their largest value: approximations of slender lobes are.
const DISK: f32 = 0.35;
/// Share of a lobe's peak that the trait allows to be left out of sums.
const NEGLIGIBLE: f32 = 1e-5;
/// Albedos may be above 1, or different, by this: the quadrature's accuracy, and what a solver does not notice.
const ALBEDO: f32 = 0.01;
/// Accuracy asked of the quadrature, and the most values for one integral.
const ACCURACY: f64 = 2e-3;
const BUDGET: usize = 150_000;

/// Checks a reflector.
///
/// # Errors
/// [`Faults`] tells what is wrong, where, and how to mend it.
pub fn check(reflector: &dyn Reflector) -> Result<Measured, Faults> {
    let mut check = Check { reflector, faults: Faults::default() };
    check.reflectances();
    for polar in POLARS {
        for azimuth in AZIMUTHS {
            let outgoing = direction(polar, azimuth);
            let incident = check.incident_directions(outgoing);
            let glossy = incident.iter().map(|&i| reflector.glossy(i, outgoing).abs().max_element());
            let negligible = NEGLIGIBLE * glossy.fold(0.0, f32::max);
            for &incident in &incident {
                check.values(Pair { incident, outgoing }, negligible);
            }
            check.bounds(&incident, outgoing);
            check.sums(&incident, outgoing);
        }
    }
    check.extents();
    // Integrals of what is not a number say nothing.
    if check.faults.0.iter().any(|f| matches!(f.fault, Fault::NotFinite { .. } | Fault::Reflectance { .. })) {
        return Err(check.faults);
    }
    let measured = check.integrals();
    if check.faults.0.is_empty() { Ok(measured) } else { Err(check.faults) }
}

/// A direction from angles in degrees.
fn direction(polar: f32, azimuth: f32) -> Vec3 {
    let ((s, z), (y, x)) = (polar.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
    Vec3::new(s * x, s * y, z)
}

fn mirrored(v: Vec3) -> Vec3 {
    Vec3::new(-v.x, -v.y, v.z)
}

/// Whether a channel is off by more than `slack`, or no number.
fn differs(a: Rgb, b: Rgb, slack: f32) -> bool {
    !(a - b).abs().cmple(Rgb::splat(slack)).all()
}

/// A check under way.
struct Check<'a> {
    reflector: &'a dyn Reflector,
    faults: Faults,
}

impl Check<'_> {
    /// Keeps a fault, or the worse one of its kind: that of the larger `severity`, which is any measure.
    fn report(&mut self, fault: Fault) {
        let known = self.faults.0.iter_mut().find(|f| discriminant(&f.fault) == discriminant(&fault));
        match known {
            Some(known) => {
                known.count += 1;
                if severity(&fault) > severity(&known.fault) {
                    known.fault = fault;
                }
            }
            None => self.faults.0.push(Finding { fault, count: 1 }),
        }
    }

    /// Incident directions all over the hemisphere and near likely peaks.
    fn incident_directions(&self, outgoing: Vec3) -> Vec<Vec3> {
        let mut all = Vec::new();
        for polar in POLARS {
            for k in 0..8 {
                all.push(direction(polar, 45.0 * k as f32 + 11.0));
            }
        }
        for peak in [mirrored(outgoing), outgoing, self.reflector.lobe(outgoing).direction] {
            let (a, b) = peak.try_normalize().unwrap_or(Vec3::Z).any_orthonormal_pair();
            for offset in OFFSETS {
                for side in [a, -a, b, -b] {
                    all.extend((peak + side * offset).try_normalize().filter(|v| v.z > HORIZON));
                }
            }
        }
        all
    }

    /// Numbers that do not depend on directions.
    fn reflectances(&mut self) {
        let r = self.reflector;
        let stated =
            [("diffuse", r.diffuse(), 0.0), ("mirror", r.mirror(), 0.0), ("glossy_albedo", r.glossy_albedo(), ALBEDO)];
        for (method, value, slack) in stated {
            // The glossy part may be negative where the diffuse one overestimates.
            if !(value.cmpge(Rgb::splat(-slack)).all() && value.cmple(Rgb::splat(1.0 + slack)).all()) {
                self.report(Fault::Reflectance { method, value });
            }
        }
        if let Some(recolored) = r.with_base_color(Rgb::splat(0.5))
            && (recolored.grain() != r.grain() || recolored.mirror() != r.mirror())
        {
            self.report(Fault::BaseColor);
        }
    }

    /// Values at a pair of directions above the horizon; what is below `negligible` need not be reflected.
    fn values(&mut self, at: Pair, negligible: f32) {
        let Pair { incident, outgoing } = at;
        let r = self.reflector;
        let value = r.eval(incident, outgoing);
        let glossy = r.glossy(incident, outgoing);
        if !value.is_finite() {
            return self.report(Fault::NotFinite { method: "eval", value, at });
        }
        if !glossy.is_finite() {
            return self.report(Fault::NotFinite { method: "glossy", value: glossy, at });
        }
        let size = value.abs().max_element();
        if value.min_element() < -1e-6 * size {
            self.report(Fault::Negative { value, at });
        }
        let back = r.eval(outgoing, incident);
        if differs(value, back, RELATIVE * size.max(back.abs().max_element()) + 1e-9) {
            self.report(Fault::NotReciprocal { there: value, back, at });
        }
        let quarter = |v: Vec3| Vec3::new(-v.y, v.x, v.z);
        let turned = r.eval(quarter(incident), quarter(outgoing));
        if r.grain().is_none() && differs(value, turned, RELATIVE * size.max(turned.abs().max_element()) + 1e-9) {
            self.report(Fault::NotIsotropic { value, turned, at });
        }
        let expected = value - r.diffuse() * FRAC_1_PI;
        if differs(glossy, expected, RELATIVE * size + 1e-6) {
            self.report(Fault::Split { value: glossy, expected, at });
        }
        if r.is_diffuse() && (glossy.abs().max_element() > RELATIVE * size || r.mirror() != Rgb::ZERO) {
            self.report(Fault::NotDiffuse { value: glossy, at });
        }
        let point = r.glossy_toward_extent(incident, outgoing, 0.0);
        if differs(point, glossy, RELATIVE * size + negligible + 1e-6) {
            let (value, expected) = (point.max_element(), glossy.max_element());
            self.report(Fault::Extent { value, expected, extent: 0.0, at });
        }
        for extent in [0.01, 0.3, FRAC_PI_2] {
            let value = r.glossy_toward_extent(incident, outgoing, extent);
            if !value.is_finite() {
                self.report(Fault::NotFinite { method: "glossy_toward_extent", value, at });
            }
        }
        for (i, o) in [(-incident, outgoing), (incident, -outgoing)] {
            let at = Pair { incident: i, outgoing: o };
            for (method, value) in [("eval", r.eval(i, o)), ("glossy", r.glossy(i, o))] {
                if value != Rgb::ZERO {
                    self.report(Fault::BelowHorizon { method, value, at });
                }
            }
        }
    }

    /// Bounds over cones about some incident directions.
    fn bounds(&mut self, incident: &[Vec3], outgoing: Vec3) {
        for &axis in incident.iter().step_by(3) {
            let (a, b) = axis.any_orthonormal_pair();
            for angle in [1e-3_f32, 0.03, 0.3, 1.2] {
                let cone = Cone { axis, cos_angle: angle.cos() };
                // The cosine has rounded the angle.
                let angle = cone.angle();
                let bound = self.reflector.glossy_bound(&cone, outgoing);
                for k in 0..13 {
                    let (s, c) = (TAU * k as f32 / 8.0).sin_cos();
                    let off = angle * [0.0, 0.5, 0.999][usize::div_ceil(k, 8)];
                    let incident = axis * off.cos() + (a * c + b * s) * off.sin();
                    let Some(incident) = incident.try_normalize().filter(|v| v.z > HORIZON) else { continue };
                    let value = self.reflector.glossy(incident, outgoing).abs().max_element();
                    let holds = value <= bound * (1.0 + 1e-4) + 1e-6;
                    if !holds && value.is_finite() {
                        self.report(Fault::Bound { bound, angle, axis, value, at: Pair { incident, outgoing } });
                    }
                }
            }
        }
    }

    /// Many senders at once.
    fn sums(&mut self, incident: &[Vec3], outgoing: Vec3) {
        let senders: Vec<_> = incident
            .iter()
            .enumerate()
            .map(|(k, &direction)| Incident {
                direction,
                extent: [0.0, 0.05, 0.4][k % 3],
                irradiance: Rgb::new(1.0, 0.5, 0.1 + 0.2 * (k % 5) as f32),
                ..Incident::default()
            })
            .collect();
        let (mut expected, mut size) = (Rgb::ZERO, Rgb::ZERO);
        for s in &senders {
            let part = self.reflector.glossy_toward_extent(s.direction, outgoing, s.extent) * s.irradiance;
            expected += part;
            size += part.abs();
        }
        let value = self.reflector.reflect_sum(&senders, outgoing);
        if differs(value, expected, RELATIVE * size.max_element() + 1e-6) && expected.is_finite() {
            self.report(Fault::Sum { value, expected, outgoing });
        }
        let mut each = vec![Rgb::NAN; senders.len()];
        self.reflector.reflect_each(&senders, outgoing, &mut each);
        for (sender, value) in std::iter::zip(&senders, each) {
            let expected = self.reflector.reflect_sum(std::slice::from_ref(sender), outgoing);
            if differs(value, expected, RELATIVE * expected.abs().max_element() + 1e-6) && expected.is_finite() {
                let at = Pair { incident: sender.direction, outgoing };
                self.report(Fault::Each { value, expected, at });
            }
        }
    }

    /// Means over senders that are disks, where brute force resolves them.
    fn extents(&mut self) {
        for polar in [0.0, 30.0, 50.0] {
            let outgoing = direction(polar, 20.0);
            let lobe = self.reflector.lobe(outgoing);
            for extent in [0.1_f32, 0.3] {
                if lobe.width < extent / 4.0 {
                    continue;
                }
                let mut cases = Vec::new();
                let (a, b) = lobe.direction.try_normalize().unwrap_or(Vec3::Z).any_orthonormal_pair();
                for side in [Vec3::ZERO, 0.5 * a, -a, 0.7 * b, -1.5 * b] {
                    let incident = (lobe.direction + side * (extent + lobe.width)).try_normalize();
                    let Some(incident) = incident.filter(|v| v.z > extent) else { continue };
                    let value = self.reflector.glossy_toward_extent(incident, outgoing, extent).max_element();
                    cases.push((Pair { incident, outgoing }, value, self.disk_average(incident, outgoing, extent)));
                }
                let largest = cases.iter().map(|c| c.2.abs()).fold(0.0, f32::max);
                for (at, value, expected) in cases {
                    if (value - expected).abs() > DISK * largest + 1e-4 {
                        self.report(Fault::Extent { value, expected, extent, at });
                    }
                }
            }
        }
    }

    fn disk_average(&self, incident: Vec3, outgoing: Vec3, extent: f32) -> f32 {
        const N: usize = 4096;
        // Vogel's spiral is not in step with anything.
        const TURN: f32 = 2.399_963;
        let (a, b) = incident.any_orthonormal_pair();
        let (mut sum, mut weight) = (Rgb::ZERO, 0.0);
        for k in 0..N {
            let versine = (1.0 - extent.cos()) * (k as f32 + 0.5) / N as f32;
            let (s, c) = (TURN * k as f32).sin_cos();
            let v = incident * (1.0 - versine) + (a * c + b * s) * (versine * (2.0 - versine)).sqrt();
            sum += self.reflector.glossy(v, outgoing) * v.z;
            weight += v.z;
        }
        (sum / weight).max_element()
    }

    /// Albedos, lobes and samples.
    fn integrals(&mut self) -> Measured {
        let azimuths: &[f32] = if self.reflector.grain().is_some() { &GRAIN_AZIMUTHS } else { &[0.0] };
        let constant = self.reflector.diffuse() + self.reflector.mirror();
        let (mut mean, mut largest) = (Rgb::ZERO, 0.0_f32);
        let levels = (0..LEVELS).map(|k| ((k as f32 + 0.5) / LEVELS as f32).sqrt().acos().to_degrees());
        for (index, polar) in levels.chain(GRAZING).enumerate() {
            for &azimuth in azimuths {
                let outgoing = direction(polar, azimuth);
                let lobe = self.reflector.lobe(outgoing);
                // And what the lobe can be made of: a negative remainder of the diffuse part does not count.
                let glossy = |i: Vec3| {
                    let value = self.reflector.glossy(i, outgoing) * i.z;
                    value.extend(value.max_element().max(0.0))
                };
                let peaks = [outgoing, Vec3::Z, lobe.direction];
                let sums = quadrature::hemisphere(glossy, outgoing, &peaks, ACCURACY, BUDGET).as_vec4();
                let (energy, lobes) = (sums.truncate(), sums.w);
                let albedo = constant + energy;
                largest = largest.max(albedo.max_element());
                if albedo.max_element() > 1.0 + ALBEDO {
                    self.report(Fault::Energy { albedo, outgoing });
                }
                if index < LEVELS {
                    mean += energy / (LEVELS * azimuths.len()) as f32;
                }
                self.lobe(outgoing, lobe, lobes);
                self.samples(outgoing, lobe, energy.max_element());
            }
        }
        let stated = self.reflector.glossy_albedo();
        if (stated - mean).abs().max_element() > ALBEDO + 0.02 * mean.max_element() {
            self.report(Fault::Albedo { stated, integrated: mean });
        }
        Measured { largest_albedo: largest, glossy_albedo: mean }
    }

    /// Whether a lobe is what it says, given the albedo of all that is positive of the glossy part toward `outgoing`.
    fn lobe(&mut self, outgoing: Vec3, lobe: Lobe, energy: f32) {
        let Lobe { direction, width } = lobe;
        let is_direction = direction.is_normalized() && direction.z >= 0.0;
        if !(is_direction && (0.0..=FRAC_PI_2).contains(&width)) {
            return self.report(Fault::NoLobe { direction, width, outgoing });
        }
        // A mirror's lobe stands beside any other; what is next to nothing has no lobe.
        if self.reflector.mirror() != Rgb::ZERO || energy < ALBEDO {
            return;
        }
        let strength =
            |v: Vec3| if v.z > HORIZON { self.reflector.glossy(v, outgoing).max_element() * v.z } else { 0.0 };
        let there = strength(direction);
        let found = self.incident_directions(outgoing).into_iter().map(|v| (strength(v), v));
        let (peak, peak_direction) = found.fold((0.0, direction), |best, v| if v.0 > best.0 { v } else { best });
        if outgoing.z >= 0.5 && there < MIN_PEAK * peak {
            return self.report(Fault::LobeDirection { direction, there, peak, peak_direction, outgoing });
        }
        let said = TAU * width * width * there;
        if said > MOST_ENERGY * energy {
            self.report(Fault::LobeWide { width, said, found: energy, outgoing });
        }
        let (a, b) = direction.any_orthonormal_pair();
        let ring = (0..16).map(|k| {
            let (s, c) = (TAU * k as f32 / 16.0).sin_cos();
            direction * width.cos() + (a * c + b * s) * width.sin()
        });
        let above: Vec<f32> = ring.filter(|v| v.z > HORIZON).map(strength).collect();
        let share = above.iter().sum::<f32>() / (above.len().max(1) as f32 * there);
        if outgoing.z >= 0.5 && width < WIDE && share > MOST_LEFT {
            self.report(Fault::LobeNarrow { width, share, outgoing });
        }
    }

    /// Whether samples average to the glossy albedo.
    fn samples(&mut self, outgoing: Vec3, lobe: Lobe, albedo: f32) {
        const N: usize = 64;
        let (mut sum, mut squares, mut met) = (Rgb::ZERO, 0.0_f64, 0);
        for k in 0..N * N {
            let u = Vec2::new((k % N) as f32 + 0.5, (k / N) as f32 + 0.5) / N as f32;
            let Some(sample) = self.reflector.sample(outgoing, u) else { continue };
            let (incident, weight) = (sample.incident, sample.weight);
            if !(incident.is_normalized() && incident.z > HORIZON && weight.is_finite()) {
                return self.report(Fault::Sample { incident, weight, outgoing });
            }
            met += usize::from(incident.distance(lobe.direction) < 2.0 * lobe.width);
            sum += weight;
            squares += f64::from(weight.max_element()).powi(2);
        }
        let count = (N * N) as f64;
        let mean = sum.max_element() / count as f32;
        let deviation = ((squares / count - f64::from(mean).powi(2)).max(0.0) / count).sqrt() as f32;
        // Directions drawn by the cosine miss a narrow lobe; they are right in the mean.
        let resolved = lobe.width > NARROW || met > N;
        if resolved && (mean - albedo).abs() > ALBEDO + 0.03 * albedo + 6.0 * deviation {
            self.report(Fault::SampleMean { mean, deviation, albedo, outgoing });
        }
    }
}

/// Where the lobe is said to be, glossy × cosine is at least this share of the largest value found.
const MIN_PEAK: f32 = 0.2;
/// Energy by which a lobe's width and peak may overestimate what there is. A lobe over all the hemisphere has 2.4 times
/// that of a constant BRDF.
const MOST_ENERGY: f32 = 6.0;
/// Lobes from this width on (radians) are as much of the hemisphere as of a peak.
const WIDE: f32 = 0.5;
/// What may be left of the peak at the lobe's width from it; a Gaussian has 0.61, the lobe of a diffuse surface π/2 wide 0.
const MOST_LEFT: f32 = 0.93;
/// Lobes wider than this (radians) are met by some of the samples of any distribution over the hemisphere.
const NARROW: f32 = 0.1;

/// How bad a fault is among those of its kind.
fn severity(fault: &Fault) -> f32 {
    match *fault {
        Fault::Negative { value, .. } => -value.min_element(),
        Fault::BelowHorizon { value, .. } | Fault::NotDiffuse { value, .. } => value.abs().max_element(),
        Fault::NotReciprocal { there: a, back: b, .. }
        | Fault::NotIsotropic { value: a, turned: b, .. }
        | Fault::Split { value: a, expected: b, .. }
        | Fault::Sum { value: a, expected: b, .. }
        | Fault::Each { value: a, expected: b, .. }
        | Fault::Albedo { stated: a, integrated: b } => {
            (a - b).abs().max_element() / a.abs().max(b.abs()).max_element()
        }
        Fault::Energy { albedo, .. } => albedo.max_element(),
        Fault::Extent { value, expected, .. } => (value - expected).abs(),
        Fault::Bound { bound, value, .. } => value - bound,
        Fault::LobeDirection { there, peak, .. } => peak / there.max(f32::MIN_POSITIVE),
        Fault::LobeNarrow { share, .. } => share,
        Fault::LobeWide { said, found, .. } => said / found,
        Fault::SampleMean { mean, albedo, .. } => (mean - albedo).abs(),
        Fault::NotFinite { .. }
        | Fault::Reflectance { .. }
        | Fault::NoLobe { .. }
        | Fault::Sample { .. }
        | Fault::BaseColor => 0.0,
    }
}

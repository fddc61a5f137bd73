//! Spherical harmonics (paper, section 2.2: what Radiance Clustering keeps), with a choice of windows against ringing.
//!
//! A function is the sum of c_lm Y_lm over the real, orthonormal harmonics of the orders l = 0…L. Every direction is
//! treated alike, sums are sums of coefficients, and integrals are closed forms; but detail of an angle α takes some (π/α)²
//! coefficients wherever it is, and a series that is cut off overshoots beside steep flanks and becomes negative.
//! A [`Window`] that fades out the high orders trades that for a wider lobe.

use super::{Basis, Known, Projected, Sampler};
use crate::Rgb;
use glam::{DVec3, Vec2, Vec3};
use hr_diffuse::Cone;
use std::f32::consts::{PI, SQRT_2, TAU};
use std::iter::zip;
use std::sync::OnceLock;

/// How much of the order l is kept in a series that ends with the order L.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Window {
    /// All: the best fit by least squares; rings.
    None,
    /// Lanczos' σ factors, sin(x)/x with x = π l/(L + 1): rings by about a tenth as much.
    Lanczos,
    /// Cesàro means of second order, (L−l+1)(L−l+2) / ((L+1)(L+2)): a mean with a kernel that is nowhere negative
    /// (Kogbetliantz, J. Math. Pures Appl. 9(3), 1924), so that values never leave the range of the function.
    Cesaro,
}

impl Window {
    fn factor(self, order: u8, last: u8) -> f32 {
        let (l, last) = (f32::from(order), f32::from(last));
        match self {
            Self::None => 1.0,
            Self::Lanczos if order == 0 => 1.0,
            Self::Lanczos => {
                let x = PI * l / (last + 1.0);
                x.sin() / x
            }
            Self::Cesaro => (last - l + 1.0) * (last - l + 2.0) / ((last + 1.0) * (last + 2.0)),
        }
    }
}

/// Settings of spherical harmonics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// Last order L, at most [`Order::MAX`]: (L + 1)² functions.
    pub last: u8,
    /// What is done against ringing.
    pub window: Window,
}

impl Order {
    /// 1,681 functions; details of about 4.5°.
    pub const MAX: u8 = 40;
}

/// A directional distribution as coefficients of spherical harmonics.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Harmonics {
    /// c_lm at l² + l + m. Empty: zero everywhere.
    coefficients: Box<[Rgb]>,
}

/// Factors of the recurrence of the normalised associated Legendre functions (without their factor sin^m θ):
/// P(l, m) = a z P(l−1, m) − b P(l−2, m), P(m, m) = c.
#[derive(Clone, Copy, Debug, Default)]
struct Factors {
    a: f32,
    b: f32,
    c: f32,
}

/// At l(l + 1)/2 + m.
fn factors() -> &'static [Factors] {
    static FACTORS: OnceLock<Vec<Factors>> = OnceLock::new();
    FACTORS.get_or_init(|| {
        let mut diagonal = 1.0 / (4.0 * std::f64::consts::PI);
        let mut all = Vec::new();
        for l in 0..=u32::from(Order::MAX) {
            if l > 0 {
                diagonal *= f64::from(2 * l + 1) / f64::from(2 * l);
            }
            for m in 0..=l {
                let [l, m] = [l, m].map(f64::from);
                let a = if m < l { ((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt() } else { 0.0 };
                let before = l - 1.0;
                let b = if m < before {
                    a * ((before * before - m * m) / (4.0 * before * before - 1.0)).sqrt()
                } else {
                    0.0
                };
                all.push(Factors { a: a as f32, b: b as f32, c: diagonal.sqrt() as f32 });
            }
        }
        all
    })
}

/// Hands the value of every harmonic up to an order in a unit direction to `use_it`, with its index.
#[inline]
fn harmonics(last: u8, direction: Vec3, mut use_it: impl FnMut(usize, f32)) {
    let factors = factors();
    // (x + iy)^m = sin^m θ (cos mφ + i sin mφ)
    let (mut re, mut im) = (1.0, 0.0);
    for m in 0..=usize::from(last) {
        let (mut one_back, mut two_back) = (0.0, 0.0);
        for l in m..=usize::from(last) {
            let Factors { a, b, c } = factors[l * (l + 1) / 2 + m];
            let p = if l == m { c } else { a * direction.z * one_back - b * two_back };
            let middle = l * (l + 1);
            if m == 0 {
                use_it(middle, p);
            } else {
                use_it(middle + m, SQRT_2 * p * re);
                use_it(middle - m, SQRT_2 * p * im);
            }
            (one_back, two_back) = (p, one_back);
        }
        (re, im) = (re * direction.x - im * direction.y, re * direction.y + im * direction.x);
    }
}

/// Nodes and weights of the Gauss–Legendre rule on −1…1.
fn gauss_legendre(count: usize) -> impl Iterator<Item = (f64, f64)> {
    (0..count).map(move |i| {
        // Newton's method from Tricomi's guess.
        let mut z = (std::f64::consts::PI * (i as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..8 {
            let (mut p, mut before) = (1.0, 0.0);
            for k in 1..=count {
                let k = k as f64;
                (p, before) = (((2.0 * k - 1.0) * z * p - (k - 1.0) * before) / k, p);
            }
            slope = count as f64 * (z * p - before) / (z * z - 1.0);
            z -= p / slope;
        }
        (z, 2.0 / ((1.0 - z * z) * slope * slope))
    })
}

/// Most circles of latitude that a function is sampled on: 0.6° apart.
const MOST_CIRCLES: usize = 300;

/// Circles per cell of the cover of a cone, in units of the shortest wave: bounds are off by what a wave changes over a
/// twelfth of its length.
const CELLS_PER_ORDER: f32 = 2.0;

impl Harmonics {
    fn last(&self) -> u8 {
        (self.coefficients.len().isqrt().max(1) - 1) as u8
    }

    fn new(coefficients: Vec<Rgb>) -> Self {
        if coefficients.iter().all(|c| *c == Rgb::ZERO || !c.is_finite()) {
            return Self::default();
        }
        Self { coefficients: coefficients.into_iter().map(|c| if c.is_finite() { c } else { Rgb::ZERO }).collect() }
    }

    /// The value in a unit direction.
    fn at(&self, direction: Vec3) -> Rgb {
        let mut sum = Rgb::ZERO;
        harmonics(self.last(), direction, |index, y| sum += self.coefficients[index] * y);
        sum
    }

    /// Largest sum of the terms' sizes in any direction: the squares of all harmonics in one direction add up to
    /// (last + 1)² / 4π, by the addition theorem.
    fn terms(&self) -> Rgb {
        let squares: Rgb = self.coefficients.iter().map(|&c| c * c).sum();
        squares.map(f32::sqrt) * ((f32::from(self.last()) + 1.0) / (4.0 * PI).sqrt())
    }

    /// Largest slope, per radian and channel: by the addition theorem the squares of the derivatives of the harmonics of
    /// order l in one direction add up to l (l + 1) (2l + 1) / 8π everywhere.
    fn slope(&self) -> Rgb {
        let band = |l: usize| {
            let squares: Rgb = self.coefficients[l * l..(l + 1) * (l + 1)].iter().map(|&c| c * c).sum();
            let weight = (l * (l + 1) * (2 * l + 1)) as f32 / (8.0 * PI);
            (squares * weight).map(f32::sqrt)
        };
        (1..=usize::from(self.last())).map(band).sum()
    }
}

impl Basis for Harmonics {
    type Settings = Order;

    /// By quadrature on circles of latitude: Gauss–Legendre by height, evenly around. There are twice as many as the
    /// harmonics themselves need, more where peaks are narrower.
    fn project(settings: &Order, known: &Known<'_>, mut f: impl FnMut(Vec3) -> Rgb) -> Projected<Self> {
        let last = settings.last.min(Order::MAX);
        let narrowest = known.peaks.iter().map(|p| p.width).filter(|w| *w > 0.0).fold(PI, f32::min);
        let circles = (2 * (usize::from(last) + 1)).max((2.0 * PI / narrowest) as usize).min(MOST_CIRCLES);
        let mut sampler = Sampler::new(known.support.as_ref());
        let mut sums = vec![DVec3::ZERO; (usize::from(last) + 1).pow(2)];
        for (z, weight) in gauss_legendre(circles) {
            let radius = (1.0 - z * z).sqrt();
            let around = 2 * circles;
            for k in 0..around {
                let turn = Vec2::from_angle(TAU * (k as f32 + 0.5) / around as f32) * radius as f32;
                let direction = turn.extend(z as f32);
                let value = sampler.at(direction, &mut f).as_dvec3() * (weight * std::f64::consts::TAU / around as f64);
                if value != DVec3::ZERO {
                    harmonics(last, direction, |index, y| sums[index] += value * f64::from(y));
                }
            }
        }
        let mut coefficients: Vec<Rgb> = sums.iter().map(|sum| sum.as_vec3()).collect();
        for l in 0..=last {
            let band = usize::from(l).pow(2)..(usize::from(l) + 1).pow(2);
            coefficients[band].iter_mut().for_each(|c| *c *= settings.window.factor(l, last));
        }
        sampler.projected(Self::new(coefficients))
    }

    fn eval(&self, direction: Vec3) -> Rgb {
        if self.is_empty() || !direction.is_finite() || direction == Vec3::ZERO {
            return Rgb::ZERO;
        }
        self.at((direction / direction.abs().max_element()).normalize())
    }

    fn add(&self, other: &Self) -> Self {
        let (long, short) =
            if self.coefficients.len() < other.coefficients.len() { (other, self) } else { (self, other) };
        let mut sum = long.coefficients.to_vec();
        zip(&mut sum, &short.coefficients).for_each(|(sum, &c)| *sum += c);
        Self::new(sum)
    }

    fn scale(&mut self, factor: f32) {
        let factor = if factor.is_finite() { factor } else { 0.0 };
        *self = Self::new(self.coefficients.iter().map(|&c| c * factor).collect());
    }

    /// Coefficients above the order of the settings are left out; windows are not applied again.
    fn average(distributions: &[(f32, &Self)], settings: &Order, _offset: Rgb) -> Self {
        let most = (usize::from(settings.last.min(Order::MAX)) + 1).pow(2);
        let some = || distributions.iter().filter(|(w, h)| *w != 0.0 && w.is_finite() && !h.is_empty());
        let count = some().map(|(_, h)| h.coefficients.len()).max().unwrap_or(0).min(most);
        let mut sum = vec![Rgb::ZERO; count];
        for (weight, distribution) in some() {
            zip(&mut sum, &distribution.coefficients).for_each(|(sum, &c)| *sum += *weight * c);
        }
        Self::new(sum)
    }

    /// Values on a cover of the cone, and what the steepest slope can add between them: loose by some tenths of the
    /// range for wide cones.
    fn bounds(&self, cone: &Cone) -> (Rgb, Rgb) {
        if self.is_empty() {
            return (Rgb::ZERO, Rgb::ZERO);
        }
        let angle = cone.angle();
        let Some(axis) = cone.axis.try_normalize().filter(|_| angle.is_finite()) else {
            // No cone at all: one of its numbers is not a number.
            return self.bounds(&Cone::SPHERE);
        };
        let rings = (angle * CELLS_PER_ORDER * f32::from(self.last().max(1))).ceil().max(1.0);
        let step = angle / rings;
        let (u, v) = axis.any_orthonormal_pair();
        let (mut low, mut high) = (Rgb::MAX, Rgb::MIN);
        for ring in 0..rings as usize {
            let (sin, cos) = ((ring as f32 + 0.5) * step).sin_cos();
            let count = (TAU * sin / step.max(f32::MIN_POSITIVE)).ceil().clamp(1.0, 1e4);
            for k in 0..count as usize {
                let turn = Vec2::from_angle(TAU * k as f32 / count) * sin;
                let value = self.at(axis * cos + u * turn.x + v * turn.y);
                (low, high) = (low.min(value), high.max(value));
            }
        }
        // No direction is farther than half a step from a ring, nor that place from a point by more than another half. Rounding
        // is that of the terms, which may be far larger than their sum.
        let slack = self.slope() * (step + 1e-5) + self.terms() * 1e-5;
        (low - slack, high + slack)
    }

    fn integral(&self) -> Rgb {
        self.coefficients.first().map_or(Rgb::ZERO, |&c| c * (4.0 * PI).sqrt())
    }

    /// The clamped cosine's own series has the weights π, 2π/3, and for even l
    /// 2π (−1)^(l/2 + 1) / ((l + 2)(l − 1)) l! / (2^l (l/2)!²), 0 for other odd l (Ramamoorthi and Hanrahan, "An Efficient
    /// Representation for Irradiance Environment Maps", 2001, equation 8).
    fn cosine_integral(&self, normal: Vec3) -> Rgb {
        let (mut weights, mut central) = (vec![PI, 2.0 * PI / 3.0], 1.0_f32);
        for l in 2..=i16::from(self.last()) {
            let mut weight = 0.0;
            if l % 2 == 0 {
                central *= f32::from(l - 1) / f32::from(l);
                let sign = if l % 4 == 2 { 1.0 } else { -1.0 };
                weight = sign * TAU * central / f32::from((l + 2) * (l - 1));
            }
            weights.push(weight);
        }
        let mut sum = Rgb::ZERO;
        if !self.is_empty() {
            harmonics(self.last(), normal, |index, y| sum += self.coefficients[index] * (y * weights[index.isqrt()]));
        }
        sum
    }

    fn is_empty(&self) -> bool {
        self.coefficients.is_empty()
    }

    /// Coefficients.
    fn basis_functions(&self) -> usize {
        self.coefficients.len()
    }

    fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.coefficients)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Projecting a harmonic gives its own coefficient, 1, and no other.
    #[test]
    fn harmonics_are_orthonormal() {
        let last = 9;
        for index in [0, 1, 2, 3, 7, 24, 50, 90, 99] {
            let f = |d: Vec3| {
                let mut value = 0.0;
                harmonics(last, d, |i, y| value = if i == index { y } else { value });
                Rgb::splat(value)
            };
            let made = Harmonics::project(&Order { last, window: Window::None }, &Known::NOTHING, f).distribution;
            for (i, c) in made.coefficients.iter().enumerate() {
                let right = if i == index { 1.0 } else { 0.0 };
                assert!((c.x - right).abs() < 1e-5, "function {index} on function {i}: {}", c.x);
            }
        }
    }

    #[test]
    fn cesaro_means_stay_in_range_where_others_ring() {
        let step = |d: Vec3| Rgb::splat(if d.dot(Vec3::new(0.6, 0.0, 0.8)) > 0.9 { 1.0 } else { 0.0 });
        let overshoot = |window| {
            let made = Harmonics::project(&Order { last: 20, window }, &Known::NOTHING, step).distribution;
            let along = (0..2000).map(|i| {
                let turn = Vec2::from_angle(PI * i as f32 / 1000.0);
                made.eval(Vec3::new(turn.x, 0.0, turn.y)).x
            });
            along.fold(0.0_f32, |most, v| most.max(-v).max(v - 1.0))
        };
        let [none, lanczos, cesaro] = [Window::None, Window::Lanczos, Window::Cesaro].map(overshoot);
        assert!(none > 0.05, "a step rings: {none}");
        assert!(lanczos < 0.3 * none, "less with a window: {lanczos} of {none}");
        // The quadrature's weights are positive, so that only rounding is left.
        assert!(cesaro < 1e-4, "not at all with a positive kernel: {cesaro}");
    }
}

//! The same properties of every basis.

use super::*;
use crate::haar::{Haar, Refinement, Refiner};
use crate::{Incident, Reflector, Ward};
use glam::DVec3;
use proptest::prelude::*;
use std::f32::consts::{PI, TAU};

/// Directions spread evenly (Fibonacci spiral); each stands for 4π/count sr.
fn directions(count: usize) -> impl Iterator<Item = Vec3> {
    (0..count).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f32 / count as f32;
        let (s, c) = (i as f32 * 2.399_963_2).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * c, r * s, z)
    })
}

fn quadrature(f: impl Fn(Vec3) -> Rgb) -> Rgb {
    const COUNT: usize = 12_000;
    let sum: DVec3 = directions(COUNT).map(|d| f(d).as_dvec3()).sum();
    (sum * (4.0 * std::f64::consts::PI / COUNT as f64)).as_vec3()
}

fn largest<B: Basis>(of: &B) -> f32 {
    directions(800).map(|d| of.eval(d).abs().max_element()).fold(1e-6, f32::max)
}

/// A basis with settings under test.
trait Case: Basis + PartialEq {
    /// Coarse and fine; fine represents lobes of 20° well.
    fn settings() -> [Self::Settings; 2];
    /// Of `average`, beside the largest value: what is lost by storing values, and by coarsening.
    const AVERAGED: f32;
    /// Mean error of representing what a surface reflects, beside its mean.
    const REFLECTED: f32;
    /// Mean error in energy.
    const ENERGY: f32;
}

impl Case for Haar {
    fn settings() -> [Refinement; 2] {
        [Refinement { refiner: Refiner::Relative(0.5), max_level: 3, ..Refinement::default() }, Refinement::default()]
    }
    // Averages are coarsened: 10 % of what is beside a triangle's own value.
    const AVERAGED: f32 = 0.1;
    const REFLECTED: f32 = 0.03;
    const ENERGY: f32 = 0.005;
}

impl Case for NonAdaptive {
    fn settings() -> [Level; 2] {
        [Level(2), Level(5)]
    }
    const AVERAGED: f32 = 1e-3;
    // Lobes are convex but for their tops: interpolation is too bright.
    const REFLECTED: f32 = 0.03;
    const ENERGY: f32 = 0.015;
}

impl Case for Harmonics {
    fn settings() -> [Order; 2] {
        [Order { last: 4, window: Window::None }, Order { last: 16, window: Window::Lanczos }]
    }
    const AVERAGED: f32 = 1e-4;
    // The window widens lobes, and the continued border of a hemisphere rings through it.
    const REFLECTED: f32 = 0.08;
    const ENERGY: f32 = 0.01;
}

type Lobe = (Vec3, f32, f32);

fn lobes() -> impl Strategy<Value = Vec<Lobe>> {
    let direction = (-1.0_f32..1.0, 0.0..TAU).prop_map(|(z, phi)| {
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z)
    });
    prop::collection::vec((direction, 1.0_f32..25.0, -0.5_f32..1.0), 1..4)
}

fn sum_of(lobes: &[Lobe]) -> impl Fn(Vec3) -> Rgb {
    move |d| lobes.iter().map(|&(axis, n, k)| d.dot(axis).max(0.0).powf(n) * Rgb::new(k, k.abs(), 1.0)).sum()
}

fn make<B: Case>(settings: &B::Settings, lobes: &[Lobe]) -> B {
    B::project(settings, &Known::NOTHING, sum_of(lobes)).distribution
}

fn evaluations_are_counted<B: Case>() {
    let hemisphere = Cone { axis: Vec3::new(0.6, 0.0, 0.8), cos_angle: 0.0 };
    for settings in B::settings() {
        for beyond in [Beyond::Zero, Beyond::Continued] {
            let mut calls = 0;
            let known = Known { support: Some(Support { cone: hemisphere, beyond }), ..Known::NOTHING };
            let made = B::project(&settings, &known, |d| {
                calls += 1;
                assert!(d.is_normalized() && d.dot(hemisphere.axis) > -1e-6, "{d} is not asked for");
                if calls % 5 == 0 { Rgb::NAN } else { Rgb::ONE }
            });
            assert_eq!((made.evaluations, made.not_finite), (calls, calls / 5), "{settings:?}");
            assert!(made.distribution.eval(Vec3::Z).is_finite(), "{settings:?}: what is no number counts as 0");
        }
    }
}

fn nothing_is_zero_and_free<B: Case>() {
    let nothing = B::default();
    let dark = B::project(&B::settings()[1], &Known::NOTHING, |_| Rgb::ZERO).distribution;
    for empty in [&nothing, &dark] {
        assert!(empty.is_empty() && empty.basis_functions() == 0, "{empty:?}");
        assert_eq!(empty.bytes(), size_of::<B>(), "nothing on the heap");
        assert_eq!(empty.eval(Vec3::X), Rgb::ZERO, "value");
        assert_eq!((empty.integral(), empty.cosine_integral(Vec3::Z)), (Rgb::ZERO, Rgb::ZERO), "integrals");
        assert_eq!(empty.bounds(&Cone::SPHERE), (Rgb::ZERO, Rgb::ZERO), "bounds");
    }
    let one = B::project(&B::settings()[1], &Known::NOTHING, |_| Rgb::ONE).distribution;
    for d in [Vec3::ZERO, Vec3::NAN, Vec3::splat(f32::INFINITY)] {
        assert_eq!(one.eval(d), Rgb::ZERO, "{d} is no direction");
    }
    for d in directions(500) {
        for length in [1e-30, 1.0, 1e30] {
            let off = (one.eval(d * length) - Rgb::ONE).abs().max_element();
            assert!(off < 2e-3, "a constant, {d} of length {length}: off by {off}");
        }
    }
    assert_eq!(one.add(&nothing), one, "nothing added");
    let mut gone = one;
    gone.scale(f32::NAN);
    assert!(gone.is_empty(), "a factor that is no number");
}

/// What a surface reflects of several samples, against the samples themselves.
fn reflected_samples_are_represented<B: Case>() {
    let ward = Ward::new(Rgb::ZERO, Rgb::new(0.9, 0.7, 0.2), 0.25).expect("a Ward reflector");
    let from = |x: f32, y: f32, irradiance| Incident {
        direction: Vec3::new(x, y, (1.0 - x * x - y * y).sqrt()),
        extent: 0.1,
        irradiance,
        ..Incident::default()
    };
    let incident = [from(0.5, 0.1, Rgb::X), from(-0.3, 0.6, Rgb::new(0.2, 1.0, 3.0)), from(0.1, -0.2, Rgb::ONE)];
    let support = Some(Support { cone: Cone { axis: Vec3::Z, cos_angle: 1e-3 }, beyond: Beyond::Continued });
    let peaks: Vec<Peak> = incident
        .iter()
        .map(|sample| ward.lobe(sample.direction))
        .map(|lobe| Peak { direction: lobe.direction, width: lobe.width })
        .collect();
    let known = Known { support, peaks: &peaks, ..Known::NOTHING };
    let [_, fine] = B::settings();
    let made = B::project(&fine, &known, |d| ward.reflect_sum(&incident, d)).distribution;
    let (mut off, mut total, mut found) = (0.0, 0.0, 0.0);
    for d in directions(12_000).filter(|d| d.z > 0.01) {
        let (right, here) = (ward.reflect_sum(&incident, d), made.eval(d));
        off += (here - right).abs().element_sum() * d.z;
        total += right.element_sum() * d.z;
        found += here.element_sum() * d.z;
    }
    assert!(off <= B::REFLECTED * total, "mean error {} of the mean", off / total);
    assert!((found / total - 1.0).abs() < B::ENERGY, "energy {}", found / total);
    let bytes = made.bytes() as f32 / made.basis_functions() as f32;
    assert!(bytes <= 12.1, "{bytes} bytes per function");
}

fn sums_and_factors<B: Case>(a: &[Lobe], b: &[Lobe], factor: f32) -> Result<(), TestCaseError> {
    let [coarse, fine] = B::settings();
    for (first, second) in [(&fine, &fine), (&coarse, &fine)] {
        let (a, b) = (make::<B>(first, a), make::<B>(second, b));
        let sum = a.add(&b);
        let mut scaled = sum.clone();
        scaled.scale(factor);
        // Three roundings to half floats; where subdivisions differ, a coarse one is interpolated anew.
        let same = std::ptr::eq(first, second);
        let tolerance = (if same { 2e-3 } else { 0.15 }) * (largest(&a) + largest(&b));
        for d in directions(200) {
            let (right, here) = (a.eval(d) + b.eval(d), sum.eval(d));
            prop_assert!((here - right).abs().max_element() <= tolerance, "{d}: sum {here}, not {right}");
            let off = (scaled.eval(d) - here * factor).abs().max_element();
            prop_assert!(off <= 1e-3 * factor.abs() * largest(&sum), "{d}: {factor} times off by {off}");
        }
    }
    Ok(())
}

fn averages<B: Case>(a: &[Lobe], b: &[Lobe]) -> Result<(), TestCaseError> {
    let [_, fine] = B::settings();
    let (a, b) = (make::<B>(&fine, a), make::<B>(&fine, b));
    let same = B::average(&[(0.3, &a), (0.7, &a), (0.0, &b), (f32::NAN, &b)], &fine, Rgb::ZERO);
    let mean = B::average(&[(0.25, &a), (0.75, &b)], &fine, Rgb::ZERO);
    let tolerance = B::AVERAGED * (largest(&a) + largest(&b));
    for d in directions(200) {
        let off = (same.eval(d) - a.eval(d)).abs().max_element();
        prop_assert!(off <= tolerance, "{d}: the average of equal ones is off by {off}");
        let off = (mean.eval(d) - 0.25 * a.eval(d) - 0.75 * b.eval(d)).abs().max_element();
        prop_assert!(off <= tolerance, "{d}: the average is off by {off}");
    }
    Ok(())
}

fn integrals<B: Case>(lobes: &[Lobe], normal: Vec3) -> Result<(), TestCaseError> {
    for settings in B::settings() {
        let made = make::<B>(&settings, lobes);
        let size = 4.0 * PI * largest(&made);
        let off = (made.integral() - quadrature(|d| made.eval(d))).abs().max_element() / size;
        prop_assert!(off < 5e-4, "{settings:?}: integral off by {off}");
        let cosine = quadrature(|d| made.eval(d) * d.dot(normal).max(0.0));
        let off = (made.cosine_integral(normal) - cosine).abs().max_element() / size;
        prop_assert!(off < 1e-3, "{settings:?}: cosine integral off by {off}");
    }
    Ok(())
}

fn bounds<B: Case>(lobes: &[Lobe], axis: Vec3, angle: f32, inside: &[(f32, f32)]) -> Result<(), TestCaseError> {
    let cone = Cone { axis, cos_angle: angle.cos() };
    // Cosines near 1 do not tell narrow cones apart: the cone is what its cosine says.
    let angle = cone.angle();
    let (u, v) = axis.any_orthonormal_pair();
    for settings in B::settings() {
        let made = make::<B>(&settings, lobes);
        let (low, high) = made.bounds(&cone);
        for (r, phi) in inside {
            let (s, c) = (r.sqrt() * angle).sin_cos();
            let value = made.eval(axis * c + (u * phi.cos() + v * phi.sin()) * s);
            let is_inside = value.cmpge(low).all() && value.cmple(high).all();
            prop_assert!(is_inside, "{settings:?}: {value} is not in {low}…{high}");
        }
        let (all_low, all_high) = made.bounds(&Cone::SPHERE);
        let range = 2.0 * (all_high - all_low).max_element();
        prop_assert!((high - low).max_element() <= range, "no wider than the sphere's, twice");
        let (low, high) = made.bounds(&Cone { axis: Vec3::NAN, cos_angle: 0.5 });
        prop_assert!(low.is_finite() && high.is_finite(), "no cone at all has bounds too");
    }
    let narrow = Cone { axis, cos_angle: 1.0 };
    let made = make::<B>(&B::settings()[1], lobes);
    let (low, high) = made.bounds(&narrow);
    prop_assert!((high - low).max_element() < 0.25 * largest(&made), "bounds of a single direction are close");
    Ok(())
}

macro_rules! properties {
    ($($name:ident: $basis:ty),*) => {$(
        mod $name {
            use super::*;

            #[test]
            fn evaluations_are_counted() {
                super::evaluations_are_counted::<$basis>();
            }

            #[test]
            fn nothing_is_zero_and_free() {
                super::nothing_is_zero_and_free::<$basis>();
            }

            #[test]
            fn reflected_samples_are_represented() {
                super::reflected_samples_are_represented::<$basis>();
            }

            proptest! {
                #![proptest_config(ProptestConfig { cases: 10, ..ProptestConfig::default() })]

                #[test]
                fn sums_and_factors(a in lobes(), b in lobes(), factor in -3.0_f32..3.0) {
                    super::sums_and_factors::<$basis>(&a, &b, factor)?;
                }

                #[test]
                fn averages(a in lobes(), b in lobes()) {
                    super::averages::<$basis>(&a, &b)?;
                }

                #[test]
                fn integrals(lobes in lobes(), normal in lobes()) {
                    super::integrals::<$basis>(&lobes, normal[0].0)?;
                }

                #[test]
                fn bounds(lobes in lobes(), axis in lobes(), angle in 0.0_f32..1.5,
                          inside in prop::collection::vec((0.0_f32..1.0, 0.0..TAU), 60)) {
                    super::bounds::<$basis>(&lobes, axis[0].0, angle * angle, &inside)?;
                }
            }
        }
    )*};
}

properties!(haar: Haar, non_adaptive: NonAdaptive, harmonics: Harmonics);

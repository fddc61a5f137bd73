//! Distributions against what they represent.

use super::*;
use crate::basis::triangle::EDGE_ENDS;
use proptest::prelude::*;
use std::f32::consts::{PI, TAU};

/// Relative precision of a stored value: half of the last place of binary16.
const STORED: f32 = 1.0 / 2048.0;

fn settings(min_level: u8, max_level: u8, epsilon: f32) -> Refinement {
    Refinement { min_level, max_level, refiner: Refiner::Relative(epsilon), ..Refinement::default() }
}

fn exact(min_level: u8, max_level: u8, epsilon: f32) -> Refinement {
    Refinement { preserve_energy: false, ..settings(min_level, max_level, epsilon) }
}

fn project(settings: &Refinement, f: impl FnMut(Vec3) -> Rgb) -> Haar {
    Haar::project(settings, &Known::NOTHING, f).distribution
}

/// Directions spread evenly (Fibonacci spiral).
fn directions(count: usize) -> impl Iterator<Item = Vec3> {
    (0..count).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f32 / count as f32;
        let (s, c) = (i as f32 * 2.399_963_2).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * c, r * s, z)
    })
}

fn lobe(axis: Vec3, exponent: f32) -> impl Fn(Vec3) -> Rgb {
    move |d| Rgb::splat(d.dot(axis).max(0.0).powf(exponent))
}

/// The undivided triangles and their levels.
fn leaves(haar: &Haar) -> Vec<(Triangle, u8)> {
    let mut found = Vec::new();
    haar.pieces(
        &mut |visit| {
            if visit.node.is_none_or(|n| !haar.node(n).is_divided()) {
                found.push((visit.triangle, visit.level));
            }
            true
        },
        &mut |_| (),
    );
    found
}

fn level_at(haar: &Haar, direction: Vec3) -> u8 {
    let size = direction.abs();
    let mut at = size / size.element_sum();
    let face = direction.cmplt(Vec3::ZERO).bitmask() as usize;
    let (mut node, mut level) = (haar.root(face), 0);
    while let Some(here) = node.map(|n| haar.node(n)).filter(|n| n.is_divided()) {
        node = here.child(descend(&mut at).index());
        level += 1;
    }
    level
}

fn assert_balanced(haar: &Haar) {
    for (triangle, level) in leaves(haar) {
        for [a, b] in EDGE_ENDS {
            for along in [0.1, 0.3, 0.45, 0.55, 0.7, 0.9] {
                let on = triangle.corners[a].lerp(triangle.corners[b], along);
                let across = on + (on - triangle.center()).reject_from(on).normalize() * 1e-4;
                let other = level_at(haar, across);
                assert!(level.abs_diff(other) <= 1, "level {level} beside {other} at {on}");
            }
        }
    }
}

#[test]
fn constants_are_reproduced_exactly() {
    for value in [1e-20_f32, 0.37, 1.0, 12345.678, 1e20] {
        for level in 0..=4 {
            let grey = project(&settings(level, level, 0.1), |_| Rgb::splat(value));
            assert_eq!(grey.basis_functions(), 8 << (2 * level), "uniform subdivision");
            for d in directions(300) {
                let error = (grey.eval(d) - Rgb::splat(value)).abs().max_element();
                assert!(error <= 4.0 * f32::EPSILON * value, "{value} at {d}: off by {error}");
            }
        }
        let (low, high) = project(&settings(2, 2, 0.1), |_| Rgb::splat(-value)).bounds(&Cone::SPHERE);
        assert!((low.x + value).abs() <= 1e-5 * value && (high.x + value).abs() <= 1e-5 * value, "signed bounds");
    }
}

/// A function that is linear on the faces of the octahedron is reproduced up to the rounding of stored values.
#[test]
fn linear_functions_are_reproduced() {
    let gradient = [Rgb::new(1.0, -2.0, 0.5), Rgb::new(0.3, 0.1, -1.0), Rgb::new(-0.7, 2.0, 1.5)];
    let f = |d: Vec3| {
        let p = d / d.abs().element_sum();
        Rgb::splat(0.2) + p.x * gradient[0] + p.y * gradient[1] + p.z * gradient[2]
    };
    for level in [0, 1, 3] {
        let haar = project(&settings(level, level, 0.1), f);
        for d in directions(1000) {
            let error = (haar.eval(d) - f(d)).abs().max_element();
            assert!(error <= 3.0 * STORED, "level {level}, {d}: off by {error}");
        }
    }
}

/// Error of the interpolation falls by 4 per level for a smooth function.
#[test]
fn interpolation_is_of_second_order() {
    let f = |d: Vec3| Rgb::new(1.0 + d.x, 2.0 + d.y * d.z, (d.z - 0.5 * d.x).exp());
    let error = |level| {
        let haar = project(&exact(level, level, 0.1), f);
        directions(4000).map(|d| (haar.eval(d) - f(d)).abs().max_element()).fold(0.0, f32::max)
    };
    let errors: Vec<f32> = (2..=5).map(error).collect();
    for pair in errors.windows(2) {
        assert!(pair[1] < pair[0] / 3.0, "{errors:?}");
    }
}

#[test]
fn solid_angles_add_up_to_the_sphere() {
    for level in 0..=4 {
        let one = project(&settings(level, level, 0.1), |_| Rgb::ONE);
        let integral = one.integral().x;
        assert!((integral - 4.0 * PI).abs() < 2e-5 * 4.0 * PI, "level {level}: {integral}");
        for normal in directions(50) {
            // The kink at the horizon is what the quadrature does not resolve: a strip one part wide.
            let cosine = one.cosine_integral(normal).x;
            assert!((cosine - PI).abs() < 2e-3 * PI, "level {level}, {normal}: {cosine}");
        }
    }
}

/// ∫ cosⁿ over the hemisphere is 2π/(n+1).
#[test]
fn integrals_of_lobes_converge() {
    for exponent in [1.0, 5.0, 20.0, 100.0] {
        let truth = TAU / (exponent + 1.0);
        let error = |max_level| {
            let axes: Vec<_> = directions(23).collect();
            let sum: f32 = axes
                .iter()
                .map(|&axis| {
                    let haar = project(&settings(2, max_level, 0.1), lobe(axis, exponent));
                    (haar.integral().x / truth - 1.0).abs()
                })
                .sum();
            sum / axes.len() as f32
        };
        let errors = [error(2), error(3), error(4), error(5)];
        assert!(errors[3] < 0.01, "cos^{exponent}: {errors:?}");
        assert!(errors[3] < errors[1].max(1e-3) && errors[2] < errors[0].max(1e-3), "cos^{exponent}: {errors:?}");
    }
}

/// Mean over directions of a lobe: basis functions, error in energy, L1 error, both relative to the lobe's energy.
fn quality(settings: &Refinement, exponent: f32) -> [f32; 3] {
    let truth = TAU / (exponent + 1.0);
    let (axes, samples) = (9, 5000);
    let mut mean = [0.0; 3];
    for axis in directions(axes) {
        let f = lobe(axis, exponent);
        let peaks = [Peak { direction: axis, width: 1.0 / exponent.sqrt() }];
        let haar = Haar::project(settings, &Known { peaks: &peaks, ..Known::NOTHING }, &f).distribution;
        let l1: f32 = directions(samples).map(|d| (haar.eval(d).x - f(d).x).abs()).sum();
        mean[0] += haar.basis_functions() as f32 / axes as f32;
        mean[1] += (haar.integral().x / truth - 1.0).abs() / axes as f32;
        mean[2] += l1 / samples as f32 * 4.0 * PI / truth / axes as f32;
    }
    mean
}

#[test]
fn defaults_are_as_good_as_documented() {
    for exponent in [10.0, 60.0, 300.0] {
        let [functions, energy, l1] = quality(&Refinement::default(), exponent);
        assert!((500.0..1600.0).contains(&functions), "cos^{exponent}: {functions} basis functions");
        assert!(energy < 0.005, "cos^{exponent}: energy off by {energy}");
        assert!(l1 < 0.03, "cos^{exponent}: mean error {l1}");
    }
}

#[test]
fn means_are_preserved() {
    let plain = quality(&exact(2, 5, 0.5), 10.0);
    let kept = quality(&settings(2, 5, 0.5), 10.0);
    assert_eq!(plain[0], kept[0], "the same subdivision");
    assert!(kept[1] < 0.3 * plain[1], "energy: {plain:?}, {kept:?}");
    assert!(kept[2] < 0.7 * plain[2], "mean error: {plain:?}, {kept:?}");
}

#[test]
fn interpolation_refiner_saves_basis_functions() {
    let paper = quality(&exact(1, 6, 0.5), 10.0);
    let ours = quality(&Refinement { refiner: Refiner::Interpolation(0.05), ..exact(1, 6, 0.5) }, 10.0);
    assert!(ours[0] < 0.6 * paper[0] && ours[2] < 1.1 * paper[2], "{paper:?}, {ours:?}");
}

#[test]
fn evaluations_are_counted_and_shared() {
    let mut calls = 0;
    let made = Haar::project(&exact(3, 3, 0.1), &Known::NOTHING, |d| {
        calls += 1;
        d
    });
    assert_eq!(made.evaluations, calls, "count");
    assert_eq!(calls, 4 * 64 + 2, "once per vertex of the uniform octahedron");
    let made = Haar::project(&settings(3, 3, 0.1), &Known::NOTHING, |d| d);
    assert_eq!(made.evaluations, 4 * 64 + 2 + 8 * 64, "and once per triangle");
}

#[test]
fn nothing_is_sampled_outside_the_support() {
    let normal = Vec3::new(0.4, 0.5, -0.7).normalize();
    let cone = Cone { axis: normal, cos_angle: 0.0 };
    let f = |d: Vec3| {
        assert!(d.dot(normal) >= -1e-6, "sampled below the horizon at {d}");
        Rgb::ONE
    };
    for beyond in [Beyond::Zero, Beyond::Continued] {
        let known = Known { support: Some(Support { cone, beyond }), ..Known::NOTHING };
        let made = Haar::project(&settings(2, 5, 0.3), &known, f);
        assert!(made.distribution.basis_functions() <= 128, "a step at the horizon is no reason to subdivide");
        for d in directions(2000).filter(|d| d.dot(normal) > 0.6) {
            assert!((made.distribution.eval(d).x - 1.0).abs() < 1e-6, "inside, {d}");
        }
        let at_horizon = directions(2000).filter(|d| (0.0..0.01).contains(&d.dot(normal)));
        if beyond == Beyond::Continued {
            at_horizon.for_each(|d| {
                assert!((made.distribution.eval(d).x - 1.0).abs() < 1e-6, "at the horizon, {d}");
            });
        } else {
            let opposite = made.distribution.eval(-normal).x;
            assert_eq!(opposite, 0.0, "zero far outside");
        }
    }
}

/// A lobe of 1° between the samples: missed without its direction, found with it.
#[test]
fn peaks_are_found() {
    let sigma = 1.0_f32.to_radians();
    let exponent = 1.0 / (sigma * sigma);
    let truth = TAU / (exponent + 1.0);
    for axis in directions(40) {
        let peaks = [Peak { direction: axis, width: sigma }];
        let known = Known { peaks: &peaks, ..Known::NOTHING };
        let made = Haar::project(&settings(1, 8, 0.5), &known, lobe(axis, exponent));
        let ratio = made.distribution.integral().x / truth;
        assert!((ratio - 1.0).abs() < 0.02, "{axis}: {ratio} of the energy");
        assert!((made.distribution.eval(axis).x - 1.0).abs() < 0.15, "{axis}: peak {}", made.distribution.eval(axis));
        assert!(made.evaluations < 3000, "{axis}: {} evaluations", made.evaluations);
    }
    let axis = Vec3::new(0.31, 0.43, 0.57).normalize();
    let narrow = |d: Vec3| lobe(axis, exponent)(d) * f32::from(d.dot(axis) > (3.0 * sigma).cos());
    let blind = project(&settings(1, 8, 0.5), narrow).integral().x / truth;
    assert!(blind < 0.5, "without its direction {blind} of the energy is found");
}

#[test]
fn nothing_is_finer_than_asked_for() {
    let axis = Vec3::new(0.31, 0.43, 0.57).normalize();
    let exponent = 60.0;
    let truth = TAU / (exponent + 1.0);
    let peaks = [Peak { direction: axis, width: 0.1 }];
    let made = [0.0, 0.2, 0.4].map(|finest| {
        let known = Known { peaks: &peaks, finest, ..Known::NOTHING };
        Haar::project(&Refinement::default(), &known, lobe(axis, exponent))
    });
    // 90° / 2³ is 0.196, half of which is too fine.
    let levels = made.each_ref().map(|m| level_at(&m.distribution, axis));
    assert_eq!([levels[1], levels[2]], [3, 2], "levels in the middle of the lobe");
    assert!(levels[0] > 3, "left to the settings: level {}", levels[0]);
    assert!(3 * made[1].evaluations < made[0].evaluations, "{} of {}", made[1].evaluations, made[0].evaluations);
    let ratio = made[1].distribution.integral().x / truth;
    assert!((ratio - 1.0).abs() < 0.1, "{ratio} of the energy is left");
}

/// Where nobody minds a difference, none is looked for.
#[test]
fn negligible_differences_are_not_refined() {
    let axis = Vec3::new(0.31, 0.43, 0.57).normalize();
    let f = lobe(axis, 200.0);
    let fine = Haar::project(&settings(3, 6, 0.1), &Known::NOTHING, &f);
    assert_eq!(fine.spared, 0, "everything counts");
    let coarsest = Haar::project(&settings(3, 3, 0.1), &Known::NOTHING, &f).evaluations;
    let mut before = fine.evaluations;
    for negligible in [0.01, 0.03, 0.1] {
        let made = Haar::project(&settings(3, 6, 0.1), &Known { negligible, ..Known::NOTHING }, &f);
        assert!(made.spared > 0 && made.evaluations < before, "{} of {before} evaluations", made.evaluations);
        before = made.evaluations;
        let off = |d: Vec3| (made.distribution.eval(d) - fine.distribution.eval(d)).abs().x;
        let worst = directions(20_000).map(off).fold(0.0, f32::max);
        // What is looked at are middles of triangles and of edges; between them it may differ by a little more.
        assert!(worst < 2.0 * negligible, "{worst} of the peak, where {negligible} is negligible");
    }
    let [least, before, all] = [&coarsest, &before, &fine.evaluations].map(|&evaluations| evaluations as f32);
    assert!(before - least < 0.5 * (all - least), "{before} of {all} evaluations, {least} at least");
}

#[test]
fn refiners_differ_in_the_dark() {
    let axis = Vec3::new(0.2, 0.3, 0.9).normalize();
    // A dim lobe far from a bright one.
    let f = |d: Vec3| lobe(axis, 50.0)(d) * 100.0 + lobe(-axis, 50.0)(d) * 0.5 + 0.01;
    let relative = project(&settings(1, 5, 0.3), f);
    let absolute =
        Haar::project(&Refinement { refiner: Refiner::Absolute(5.0), ..settings(1, 5, 0.3) }, &Known::NOTHING, f);
    assert!(level_at(&relative, -axis) > 3, "relative: level {}", level_at(&relative, -axis));
    assert!(
        level_at(&absolute.distribution, -axis) <= 2,
        "absolute: level {}",
        level_at(&absolute.distribution, -axis)
    );
    // Beside a diffuse radiance of 100 the dim one is negligible to the relative refiner, too.
    let known = Known { offset: Rgb::splat(100.0), ..Known::NOTHING };
    let beside = Haar::project(&settings(1, 5, 0.3), &known, f).distribution;
    assert!(level_at(&beside, -axis) <= 2, "beside diffuse light: level {}", level_at(&beside, -axis));
    assert!(beside.basis_functions() < relative.basis_functions(), "fewer basis functions");
}

/// The flanks of a narrow lobe are dark, and every difference there is relatively large.
#[test]
fn negligible_values_are_not_refined() {
    let axis = Vec3::new(0.2, 0.3, 0.9).normalize();
    let count = |negligible| project(&Refinement { negligible, ..settings(1, 6, 0.3) }, lobe(axis, 300.0));
    let (paper, ours) = (count(0.0), count(1e-3));
    assert!(
        2 * ours.basis_functions() < paper.basis_functions(),
        "{} {}",
        ours.basis_functions(),
        paper.basis_functions()
    );
    let worst = directions(5000).map(|d| (paper.eval(d) - ours.eval(d)).abs().x).fold(0.0, f32::max);
    assert!(worst < 0.02, "and it costs {worst} of the peak");
}

#[test]
fn values_that_are_not_finite_become_zero() {
    let made = Haar::project(&settings(2, 4, 0.3), &Known::NOTHING, |d| match () {
        () if d.x > 0.5 => Rgb::NAN,
        () if d.x < -0.5 => Rgb::new(1.0, f32::INFINITY, 1.0),
        () => Rgb::ONE,
    });
    assert!(made.not_finite > 10, "{}", made.not_finite);
    for d in directions(2000) {
        let v = made.distribution.eval(d);
        assert!(v.is_finite() && v.cmpge(Rgb::ZERO).all() && v.cmple(Rgb::splat(1.0 + 1e-6)).all(), "{v} at {d}");
    }
    for d in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY, Vec3::MAX, Vec3::splat(1e-45)] {
        assert!(made.distribution.eval(d).is_finite(), "{d}");
    }
}

#[test]
fn huge_functions_stop_at_the_limit() {
    // Never smooth enough, at any level.
    let made = Haar::project(&settings(6, MAX_LEVEL, 0.0), &Known::NOTHING, |d| d * 1e5 % 1.0);
    assert!(made.truncated, "the limit is reported");
    assert!(made.distribution.vertices.len() <= mesh::MAX_VERTICES, "{}", made.distribution.vertices.len());
    assert!(made.distribution.all_nodes().count() < 1 << 15, "{} nodes", made.distribution.all_nodes().count());
    assert_balanced(&made.distribution);
    let twice = made.distribution.add(&made.distribution);
    assert!(
        (twice.eval(Vec3::Z) - 2.0 * made.distribution.eval(Vec3::Z)).abs().max_element() < 1e-3,
        "sum of full ones"
    );
}

#[test]
fn empty_costs_nothing() {
    let empty = project(&settings(2, 5, 0.3), |_| Rgb::ZERO);
    assert!(empty.is_empty() && empty.basis_functions() == 0, "{empty:?}");
    assert_eq!(empty.bytes(), size_of::<Haar>(), "nothing on the heap");
    assert!(size_of::<Haar>() <= 40, "{}", size_of::<Haar>());
    assert_eq!(empty.eval(Vec3::Z), Rgb::ZERO, "zero");
    assert_eq!(empty.bounds(&Cone::SPHERE), (Rgb::ZERO, Rgb::ZERO), "zero");
    assert_eq!(empty.integral(), Rgb::ZERO, "zero");
    assert!(Haar::average(&[(1.0, &empty), (2.0, &empty)], &settings(1, 5, 0.3), Rgb::ZERO).is_empty(), "average");
}

#[test]
fn less_than_seven_bytes_per_basis_function() {
    for exponent in [10.0_f32, 50.0, 200.0, 1000.0] {
        let axis = Vec3::new(0.2, 0.3, 0.9).normalize();
        let peaks = [Peak { direction: axis, width: 1.0 / exponent.sqrt() }];
        let known = Known { peaks: &peaks, ..Known::NOTHING };
        let haar = Haar::project(&settings(1, 7, 0.2), &known, lobe(axis, exponent)).distribution;
        let per = (haar.bytes() - size_of::<Haar>()) as f32 / haar.basis_functions() as f32;
        assert!(per < 7.0, "cos^{exponent}: {per} bytes per basis function ({})", haar.basis_functions());
    }
}

#[test]
fn map_multiplies_and_scale_scales() {
    let axis = Vec3::new(0.2, 0.3, 0.9).normalize();
    let haar = project(&settings(3, 5, 0.3), |d| lobe(axis, 8.0)(d) + Rgb::new(0.1, 0.2, 0.3));
    let clipped = haar.map(|d, v| v * d.dot(axis).max(0.0));
    let mut scaled = haar.clone();
    scaled.scale(-2.5e10);
    for d in directions(1000) {
        let (v, cos) = (haar.eval(d), d.dot(axis).max(0.0));
        // Triangles are at most 11° wide: the product is off by the product of two differences.
        assert!((clipped.eval(d) - v * cos).abs().max_element() < 0.04, "{d}: {} {}", clipped.eval(d), v * cos);
        assert!((scaled.eval(d) + v * 2.5e10).abs().max_element() < 1e-3 * 2.5e10, "{d}");
    }
    scaled.scale(f32::NAN);
    assert!(scaled.is_empty(), "a factor that is not a number empties");
    assert_eq!(clipped.eval(-axis), Rgb::ZERO, "clipped");
}

fn unit() -> impl Strategy<Value = Vec3> {
    (-1.0_f32..1.0, 0.0..TAU).prop_map(|(z, phi)| {
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z)
    })
}

/// Sums of lobes of random width, some negative: random adaptive trees. A direction may lie on an axis or an edge.
fn lobes() -> impl Strategy<Value = Vec<(Vec3, f32, f32)>> {
    let special = prop_oneof![
        4 => unit(),
        1 => Just(Vec3::Z),
        1 => Just(Vec3::new(0.0, -0.6, 0.8)),
    ];
    prop::collection::vec((special, 0.5_f32..8.0, -0.5_f32..1.0), 1..5)
}

fn make(lobes: &[(Vec3, f32, f32)], settings: &Refinement) -> Haar {
    let peaks: Vec<Peak> = lobes.iter().map(|l| Peak { direction: l.0, width: 0.5_f32.powf(l.1) }).collect();
    let known = Known { peaks: &peaks, ..Known::NOTHING };
    let f = |d: Vec3| lobes.iter().map(|l| lobe(l.0, 4.0_f32.powf(l.1))(d) * Rgb::new(l.2, l.2.abs(), 1.0)).sum();
    Haar::project(settings, &known, f).distribution
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn trees_are_balanced(lobes in lobes(), min in 0_u8..3, max in 3_u8..8) {
        assert_balanced(&make(&lobes, &settings(min, max, 0.3)));
    }

    /// On both sides of every edge, across octants and T-junctions: steps no larger than the slope allows.
    #[test]
    fn there_are_no_cracks(lobes in lobes(), max in 3_u8..8, along in 0.0_f32..1.0) {
        let haar = make(&lobes, &settings(1, max, 0.3));
        let largest = haar.bounds(&Cone::SPHERE);
        let largest = largest.0.abs().max(largest.1.abs()).max_element();
        for (triangle, level) in leaves(&haar) {
            for [a, b] in EDGE_ENDS {
                let on = triangle.corners[a].lerp(triangle.corners[b], along);
                let aside = (on - triangle.center()).reject_from(on).normalize() * 2e-6;
                let step = (haar.eval(on - aside) - haar.eval(on + aside)).abs().max_element();
                // The slope is at most the range over the height of the finer neighbour, about 1/2^(level + 1); the
                // factor covers the stretch from the octahedron to the sphere.
                let slope = 4.0 * largest * f32::from(2_u16 << level);
                prop_assert!(step <= slope * 4e-6 + 1e-5 * largest, "step {step} at {on}, level {level}");
            }
        }
    }

    #[test]
    fn bounds_are_conservative(lobes in lobes(), max in 1_u8..7, axis in unit(), angle in 0.0_f32..1.2,
                               inside in prop::collection::vec((0.0_f32..1.0, 0.0..TAU), 60)) {
        let haar = make(&lobes, &settings(1, max, 0.3));
        // Most cones of interest are narrow.
        let angle = angle.powi(3) * 1.8;
        let cone = Cone { axis, cos_angle: angle.cos() };
        let (low, high) = haar.bounds(&cone);
        let (u, v) = axis.any_orthonormal_pair();
        let (mut least, mut most) = (Rgb::MAX, Rgb::MIN);
        for (r, phi) in inside {
            let (s, c) = (r.sqrt() * angle).sin_cos();
            let d = axis * c + (u * phi.cos() + v * phi.sin()) * s;
            let value = haar.eval(d);
            prop_assert!(value.cmpge(low).all() && value.cmple(high).all(), "{value} not in {low}…{high}");
            least = least.min(value);
            most = most.max(value);
        }
        // And tight: no more than what the parts around the rim can add.
        let (all_low, all_high) = haar.bounds(&Cone { axis, cos_angle: (3.0 * angle + 0.02).min(PI).cos() });
        prop_assert!(low.cmpge(all_low).all() && high.cmple(all_high).all(), "a wider cone has wider bounds");
        let slack = (all_high - all_low) + 1e-3;
        prop_assert!((high - most).cmple(slack).all(), "loose above");
        prop_assert!((least - low).cmple(slack).all(), "loose below");
    }

    #[test]
    fn sums_are_pointwise(a in lobes(), b in lobes(), c in lobes(), max in 2_u8..7) {
        let [a, b, c] = [a, b, c].map(|l| make(&l, &settings(1, max, 0.3)));
        let sum = a.add(&b).add(&c);
        assert_balanced(&sum);
        let size = |h: &Haar| { let (l, u) = h.bounds(&Cone::SPHERE); l.abs().max(u.abs()).max_element() };
        // Two roundings of sums of stored values.
        let tolerance = 2.0 * STORED * (size(&a) + size(&b) + size(&c));
        for d in directions(500) {
            let error = (sum.eval(d) - a.eval(d) - b.eval(d) - c.eval(d)).abs().max_element();
            prop_assert!(error <= tolerance, "{d}: off by {error}, tolerance {tolerance}");
        }
        // Without tolerance, coarsening drops nothing but what is constant.
        let s = Refinement { negligible: 0.0, refiner: Refiner::Absolute(0.0), ..settings(0, MAX_LEVEL, 0.0) };
        let average = Haar::average(&[(0.5, &a), (0.2, &b), (0.3, &c)], &s, Rgb::ZERO);
        for d in directions(500) {
            let error = average.eval(d) - 0.5 * a.eval(d) - 0.2 * b.eval(d) - 0.3 * c.eval(d);
            prop_assert!(error.abs().max_element() <= tolerance, "{d}: off by {error}, tolerance {tolerance}");
        }
    }

    /// Coarsened averages: energy is kept, and values within the refiner's tolerance of the local range.
    #[test]
    fn averages_are_coarsened_within_tolerance(a in lobes(), b in lobes(), epsilon in 0.1_f32..0.5) {
        let positive = |l: &[(Vec3, f32, f32)]| -> Vec<_> { l.iter().map(|l| (l.0, l.1, l.2.abs() + 0.1)).collect() };
        let [a, b] = [a, b].map(|l| make(&positive(&l), &settings(1, 5, 0.1)));
        let fine = Haar::average(&[(0.5, &a), (0.5, &b)], &settings(0, MAX_LEVEL, 0.0), Rgb::ZERO);
        let s = settings(1, 6, epsilon);
        let coarse = Haar::average(&[(0.5, &a), (0.5, &b)], &s, Rgb::ZERO);
        assert_balanced(&coarse);
        // Beside the level that is asked for everywhere, also where there is nothing to represent.
        prop_assert!(coarse.basis_functions() <= fine.basis_functions() + 3 * 8, "coarser");
        let (_, top) = fine.bounds(&Cone::SPHERE);
        for d in directions(500) {
            let (there, here) = (fine.eval(d), coarse.eval(d));
            // Spread over the triangle ≤ ε × middle ≤ ε/(1 − ε) × value; the move of a vertex is no larger.
            let tolerance = 2.0 * epsilon / (1.0 - epsilon) * there.max_element().max(1e-3 * top.max_element());
            let error = (there - here).abs().max_element();
            prop_assert!(error <= tolerance + 2.0 * STORED, "{d}: {here} for {there}");
        }
        let (e, f) = (coarse.integral().x, fine.integral().x);
        prop_assert!((e / f - 1.0).abs() < 0.02, "energy {e} for {f}");
    }
}

/// The top of a lobe is shown as it is, however much may be wrong elsewhere.
#[test]
fn tops_of_highlights_are_not_cut_off() {
    let f = lobe(Vec3::new(0.3, 0.5, 0.8).normalize(), 60.0);
    let known = Known { error: 0.5, ..Known::NOTHING };
    let made = Haar::project(&Refinement::default(), &known, &f);
    let top = directions(20_000).map(|d| (f(d).x, d)).filter(|(right, _)| *right > 0.5);
    let (off, all) =
        top.fold((0.0, 0.0), |(off, all), (right, d)| (off + (made.distribution.eval(d).x - right).abs(), all + right));
    assert!(off < 0.05 * all, "off by {} where half may be wrong", off / all);
}

#[test]
fn shrinking_leaves_what_is_below_zero() {
    let f = |d: Vec3| Rgb::new(d.x, d.y, 0.3);
    let mut made = project(&settings(2, 2, 0.1), f);
    let before = made.clone();
    let by = Rgb::new(0.1, 0.2, 0.5);
    Basis::shrink(&mut made, by);
    for direction in leaves(&before).iter().map(|(triangle, _)| triangle.corners[0]) {
        let (was, is) = (before.eval(direction), made.eval(direction));
        let right = was - was.clamp(Rgb::ZERO, by);
        assert!((is - right).abs().max_element() < 4.0 * STORED, "{was} became {is}, not {right}");
    }
}

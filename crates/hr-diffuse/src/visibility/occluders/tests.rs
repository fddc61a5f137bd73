//! Against rays in all directions, and against what is left in closed form.

use super::{Occluders, Patch};
use crate::form_factor::point_to_polygon;
use crate::geometry::Domain;
use crate::geometry::tests::{geometry, surface};
use crate::sampling::point2;
use crate::{Geometry, Shape, Surface, Visibility};
use glam::{Vec3, dvec3, vec3};
use proptest::prelude::*;
use std::f32::consts::TAU;

/// Rays by which form factors are estimated.
const RAYS: u32 = 4096;

fn front(surface: u32) -> Patch {
    Patch { surface, domain: Domain::WHOLE, back: false }
}

/// A rectangle at a height that faces down.
fn above(x: [f64; 2], y: [f64; 2], z: f64) -> Surface {
    let p = |i: usize, j: usize| dvec3(x[i], y[j], z);
    Surface { flip: true, ..Surface::new(Shape::Quad([p(0, 0), p(1, 0), p(1, 1), p(0, 1)]), 0) }
}

fn ground() -> Surface {
    Surface { flip: false, ..above([-1.0, 1.0], [-1.0, 1.0], 0.0) }
}

/// What may hide the lamp, surface 1, from the ground, surface 0.
fn between(surfaces: &[Surface]) -> (Visibility, Option<Occluders>) {
    let geometries: Vec<Geometry> = surfaces.iter().map(geometry).collect();
    let visibility = Visibility::new(&geometries);
    let found = visibility.occluders(&front(0), &front(1), 8);
    (visibility, found)
}

fn rectangle([left, right]: [f32; 2], [low, high]: [f32; 2], z: f32) -> [Vec3; 4] {
    [vec3(left, low, z), vec3(left, high, z), vec3(right, high, z), vec3(right, low, z)]
}

/// What is seen of a surface's front of all that arrives at a point, by rays evenly over the hemisphere's disk.
fn by_rays(visibility: &Visibility, (x, n): (Vec3, Vec3), own: u32, sender: u32) -> f32 {
    let (right, up) = n.any_orthonormal_pair();
    let sees = |i: &u32| {
        let u = point2(11, *i);
        let (radius, (sin, cos)) = (u.x.sqrt(), (TAU * u.y).sin_cos());
        let direction = (right * cos + up * sin) * radius + n * (1.0 - u.x).sqrt();
        let hit = visibility.closest_except(x, direction, 1e-6, f32::MAX, own);
        hit.is_some_and(|hit| hit.surface == sender && hit.front)
    };
    (0..RAYS).filter(sees).count() as f32 / RAYS as f32
}

/// A lamp in a can that reaches below it, and above: what is seen of it is what rays find.
#[test]
fn lamps_in_cans_are_seen_from_below() {
    let small = Surface { flip: false, ..above([-0.01, 0.01], [-0.01, 0.01], 0.0) };
    let lamp = above([0.15, 0.45], [-0.15, 0.15], 1.0);
    let can = Shape::Cone { ends: [0.8, 1.1].map(|z| dvec3(0.3, 0.0, z)), radii: [0.25; 2] };
    let (visibility, found) = between(&[small, lamp, Surface::new(can, 0)]);
    let found = found.expect("flat, in a tube");
    for x in [0.0, 0.2, -0.3] {
        let x = vec3(x, 0.0, 0.0);
        let (seen, expected) = (found.visible_factor(x, [Vec3::Z; 2]), by_rays(&visibility, (x, Vec3::Z), 0, 1));
        assert!((seen - expected).abs() < 0.003, "{x}: {seen}, by rays {expected}");
    }
}

/// A triangle or quadrilateral anywhere, of those that are made of all kinds.
fn polygon() -> impl Strategy<Value = Surface> {
    surface().prop_filter("curved", |surface| matches!(surface.shape, Shape::Triangle(_) | Shape::Quad(_)))
}

/// A ball, cylinder or cone anywhere.
fn round() -> impl Strategy<Value = Surface> {
    surface()
        .prop_filter("flat, or a torus", |surface| matches!(surface.shape, Shape::Sphere { .. } | Shape::Cone { .. }))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    /// What is cut out is what rays see.
    #[test]
    fn what_is_left_is_what_is_seen(
        (receiver, sender) in (surface(), polygon()),
        others in prop::collection::vec(polygon(), 0..12),
        back in any::<bool>(),
        place in [0.02f32..0.98, 0.02..0.98],
    ) {
        let geometries: Vec<Geometry> = [receiver, sender].iter().chain(&others).map(geometry).collect();
        let visibility = Visibility::new(&geometries);
        let patch = Patch { back, ..front(0) };
        let Some(occluders) = visibility.occluders(&patch, &front(1), 12) else { return Ok(()) };
        let (x, n) = geometries[0].sample(Domain::WHOLE, place[0], place[1]);
        let n = if back { -n } else { n };
        let (found, expected) = (occluders.visible_factor(x, [n; 2]), by_rays(&visibility, (x, n), 0, 1));
        prop_assert!((found - expected).abs() < 0.02, "{found}, by rays {expected}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    /// So is what round bodies leave, whose circles are polygons of the same area.
    #[test]
    fn what_round_bodies_leave_is_what_is_seen(
        (receiver, sender) in (surface(), polygon()),
        others in prop::collection::vec(round(), 1..3),
        place in [0.02f32..0.98, 0.02..0.98],
    ) {
        let geometries: Vec<Geometry> = [receiver, sender].iter().chain(&others).map(geometry).collect();
        let visibility = Visibility::new(&geometries);
        let Some(occluders) = visibility.occluders(&front(0), &front(1), 12) else { return Ok(()) };
        let (x, n) = geometries[0].sample(Domain::WHOLE, place[0], place[1]);
        let (found, expected) = (occluders.visible_factor(x, [n; 2]), by_rays(&visibility, (x, n), 0, 1));
        prop_assert!((found - expected).abs() < 0.02, "{found}, by rays {expected}");
    }
}

#[test]
fn what_is_hidden_is_cut_off_exactly() {
    let lamp = above([-0.5, 0.5], [-0.5, 0.5], 1.0);
    let (x, up) = (vec3(0.1, 0.0, 0.0), [Vec3::Z; 2]);
    let seen = |others: &[Surface]| {
        let surfaces: Vec<Surface> = [ground(), lamp.clone()].iter().chain(others).cloned().collect();
        let found = between(&surfaces).1.expect("polygons, and few");
        (found.cost(), found.visible_factor(x, up))
    };
    let left_of = |edge: f32| point_to_polygon(x, Vec3::Z, &rectangle([-0.5, edge], [-0.5, 0.5], 1.0));
    let close = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-6, "{found}, not {expected}");
    // Nothing is between.
    let (count, whole) = seen(&[]);
    close(whole, left_of(0.5));
    assert_eq!(count, 1, "the lamp");
    // At half its height a plate hides what is twice as far to the side, seen from x.
    let plate = above([0.1, 0.9], [-1.0, 1.0], 0.5);
    let (count, half) = seen(std::slice::from_ref(&plate));
    assert_eq!(count, 2, "it, too");
    close(half, left_of(0.1));
    // Twice the same, and what is hidden already, hides no more.
    close(seen(&[plate.clone(), plate.clone(), above([0.2, 0.3], [-0.1, 0.1], 0.7)]).1, half);
    // Two of which one ends where the other begins leave no gap.
    close(seen(&[above([0.1, 0.25], [-1.0, 1.0], 0.5), above([0.25, 0.9], [-1.0, 1.0], 0.5)]).1, half);
    // What stands out of the lamp hides what it does below it.
    let p = |y: f64, z: f64| dvec3(0.3, y, z);
    let upright = Surface::new(Shape::Quad([p(-2.0, 0.9), p(2.0, 0.9), p(2.0, 1.5), p(-2.0, 1.5)]), 0);
    let from = 0.1 + 0.2 / 0.9;
    close(seen(&[upright]).1, left_of(0.3) + left_of(0.5) - left_of(from));
    // A wall that x lies in is seen edge-on.
    let p = |y: f64, z: f64| dvec3(f64::from(x.x), y, z);
    let wall = Surface::new(Shape::Quad([p(-2.0, 0.0), p(2.0, 0.0), p(2.0, 0.9), p(-2.0, 0.9)]), 0);
    close(seen(&[wall]).1, whole);
    // All of it is hidden from everywhere.
    assert_eq!(seen(&[above([-3.0, 3.0], [-3.0, 3.0], 0.5)]), (0, 0.0));
}

/// A shading normal sees what the surface's own horizon hides, and the other way round.
#[test]
fn below_the_horizon_nothing_is_seen() {
    let p = |y: f64, z: f64| dvec3(0.5, y, z);
    let upright = Surface::new(Shape::Quad([p(1.0, -0.5), p(-1.0, -0.5), p(-1.0, 0.5), p(1.0, 0.5)]), 0);
    let found = between(&[ground(), upright]).1.expect("polygons, and few");
    let half = found.visible_factor(Vec3::ZERO, [Vec3::Z; 2]);
    assert!(half > 0.05, "{half}");
    let bent = Vec3::new(0.6, 0.0, 0.8);
    let corners = [vec3(0.5, 1.0, 0.0), vec3(0.5, -1.0, 0.0), vec3(0.5, -1.0, 0.5), vec3(0.5, 1.0, 0.5)];
    let (seen, expected) =
        (found.visible_factor(Vec3::ZERO, [bent, Vec3::Z]), point_to_polygon(Vec3::ZERO, bent, &corners));
    assert!((seen - expected).abs() < 1e-6 && seen > half, "{seen}, not {expected}");
    assert_eq!(found.visible_factor(Vec3::X, [-Vec3::X, Vec3::Z]), 0.0, "from behind it");
}

/// Below a lamp: a ball, a leg, a shade from beside and from far below, a disk.
#[test]
fn round_bodies_hide_what_rays_find_hidden() {
    let lamp = above([-0.5, 0.5], [-0.5, 0.5], 1.0);
    let small = Surface { flip: false, ..above([-0.01, 0.01], [-0.01, 0.01], 0.0) };
    let cone = |[x0, z0, r0]: [f64; 3], [x1, z1, r1]: [f64; 3]| {
        Surface::new(Shape::Cone { ends: [dvec3(x0, 0.0, z0), dvec3(x1, 0.0, z1)], radii: [r0, r1] }, 0)
    };
    let ball = Shape::Sphere { center: dvec3(0.1, 0.1, 0.5), radius: 0.2 };
    let disk = Shape::Ring { center: dvec3(0.2, 0.1, 0.4), normal: dvec3(0.6, 0.0, 0.8), inner: 0.0, outer: 0.15 };
    for (what, other) in [
        ("ball", Surface::new(ball, 0)),
        ("disk", Surface::new(disk, 0)),
        ("leg", cone([0.1, 0.2, 0.03], [0.1, 0.8, 0.03])),
        ("lying", cone([-0.3, 0.4, 0.1], [0.4, 0.5, 0.1])),
        ("shade", cone([0.3, 0.3, 0.1], [0.3, 0.8, 0.02])),
        ("tube from below", cone([0.0, 0.2, 0.1], [0.1, 0.5, 0.12])),
        ("wide tube", cone([0.05, 0.7, 0.3], [0.05, 0.75, 0.3])),
        ("funnel", cone([-0.1, 0.3, 0.02], [-0.1, 0.6, 0.2])),
        ("shade from below", cone([0.02, 0.4, 0.2], [0.02, 0.6, 0.08])),
        ("tip", cone([0.0, 0.3, 0.0], [0.0, 0.6, 0.2])),
        ("pointed", cone([-0.3, 0.5, 0.08], [0.1, 0.6, 0.0])),
    ] {
        let (visibility, found) = between(&[small.clone(), lamp.clone(), other]);
        let found = found.expect("round, and seen from outside");
        let x = Vec3::ZERO;
        let whole = point_to_polygon(x, Vec3::Z, &rectangle([-0.5, 0.5], [-0.5, 0.5], 1.0));
        let (seen, expected) = (found.visible_factor(x, [Vec3::Z; 2]), by_rays(&visibility, (x, Vec3::Z), 0, 1));
        assert!(seen < 0.99 * whole, "{what}: it hides some of it");
        assert!((seen - expected).abs() < 0.006, "{what}: {seen}, by rays {expected}");
    }
}

#[test]
fn what_has_no_outline_or_too_much_is_left_to_rays() {
    let lamp = above([-0.5, 0.5], [-0.5, 0.5], 1.0);
    let ball = |z: f64| Surface::new(Shape::Sphere { center: dvec3(0.0, 0.0, z), radius: 0.2 }, 0);
    let tube = |heights: [f64; 2], radius: f64| {
        let ends = heights.map(|z| dvec3(0.0, 0.0, z));
        Surface::new(Shape::Cone { ends, radii: [radius; 2] }, 0)
    };
    let is_found = |other: Surface| between(&[ground(), lamp.clone(), other]).1.is_some();
    assert!(!is_found(tube([-0.1, 0.6], 2.0)), "around the ground");
    assert!(is_found(tube([0.4, 0.6], 0.2)), "between");
    assert!(!is_found(ball(1.0)), "half above the lamp");
    assert!(!is_found(ball(0.1)), "it holds some of the ground");
    let torus = Shape::Torus { center: dvec3(0.0, 0.0, 0.5), axis: dvec3(0.0, 0.0, 1.0), major: 0.2, minor: 0.05 };
    assert!(!is_found(Surface::new(torus, 0)), "a torus");
    assert!(between(&[ground(), ball(0.5)]).1.is_none(), "a ball that shines");
    assert!(is_found(ball(2.0)), "a ball elsewhere");
    assert!(between(&[ball(0.5), lamp.clone()]).1.is_some(), "a ball that is lit");
    let chips = |count: u32| (0..count).map(|i| above([-0.1, 0.1], [-0.1, 0.1], 0.2 + 0.02 * f64::from(i)));
    for (count, is_found) in [(8, true), (9, false)] {
        let surfaces: Vec<Surface> = [ground(), lamp.clone()].into_iter().chain(chips(count)).collect();
        assert_eq!(between(&surfaces).1.is_some(), is_found, "{count} chips");
    }
    // What faces away sends nothing, whatever is between.
    let away = Surface { flip: false, ..lamp };
    let surfaces: Vec<Surface> = [ground(), away].into_iter().chain(chips(9)).collect();
    assert_eq!(between(&surfaces).1.expect("known").cost(), 0);
}

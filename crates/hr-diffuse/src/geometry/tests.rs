//! Properties of every kind of surface, for random ones and random parts of them, against sampling and oracles that
//! share no code with what they test.

use super::{Domain, Geometry, GeometryError, Normalization};
use crate::{Shape, Surface};
use glam::{DVec3, Vec2, Vec3, dvec3, vec2};
use proptest::prelude::*;
use std::f64::consts::TAU;

fn coordinate() -> impl Strategy<Value = f64> {
    // Random ones, and the round ones that make rays and planes axis-parallel.
    prop_oneof![3 => 0.0..1.0, 1 => prop::sample::select(vec![0.0, 0.25, 0.5, 1.0])]
}

fn position() -> impl Strategy<Value = DVec3> {
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| dvec3(x, y, z))
}

fn direction() -> impl Strategy<Value = DVec3> {
    let round = prop::sample::select(vec![DVec3::X, DVec3::NEG_Y, DVec3::Z, dvec3(1.0, 1.0, 0.0).normalize()]);
    let random = (-1.0..1.0, 0.0..TAU).prop_map(|(z, angle): (f64, f64)| {
        let radius = (1.0 - z * z).sqrt();
        dvec3(radius * angle.cos(), radius * angle.sin(), z)
    });
    prop_oneof![3 => random, 1 => round]
}

fn size() -> impl Strategy<Value = f64> {
    prop_oneof![4 => 0.05..0.5, 1 => (-3.0..-1.0).prop_map(|e| 10f64.powf(e))]
}

/// A surface of any kind within or near the unit cube.
pub(crate) fn surface() -> impl Strategy<Value = Surface> {
    let triangle = [position(), position(), position()]
        .prop_filter("sliver", |[a, b, c]| (b - a).cross(c - a).length() > 1e-3)
        .prop_map(Shape::Triangle);
    // Four points on an ellipse, in order, are convex and planar.
    let quad = (position(), direction(), [0.02..0.23, 0.27..0.48, 0.52..0.73, 0.77..0.98], size(), 0.2..1.0).prop_map(
        |(center, normal, turns, size, squash)| {
            let (x, y) = normal.any_orthonormal_pair();
            Shape::Quad(turns.map(|turn: f64| {
                let (sin, cos) = (turn * TAU).sin_cos();
                center + (x * cos + y * sin * squash) * size
            }))
        },
    );
    let sphere = (position(), size()).prop_map(|(center, radius)| Shape::Sphere { center, radius });
    let radius = || prop_oneof![4 => size(), 1 => Just(0.0)];
    let cone = (position(), direction(), size(), radius(), radius())
        .prop_filter("no radius", |cone| cone.3 + cone.4 > 0.0)
        .prop_map(|(from, axis, height, a, b)| Shape::Cone { ends: [from, from + axis * height], radii: [a, b] });
    let cylinder = (position(), direction(), size(), size())
        .prop_map(|(from, axis, height, r)| Shape::Cone { ends: [from, from + axis * height], radii: [r, r] });
    let ring = (position(), direction(), radius(), size()).prop_map(|(center, normal, inner, width)| Shape::Ring {
        center,
        normal,
        inner,
        outer: inner + width,
    });
    let torus = (position(), direction(), size(), 0.05..0.95).prop_map(|(center, axis, major, share)| Shape::Torus {
        center,
        axis,
        major,
        minor: major * share,
    });
    (prop_oneof![triangle, quad, sphere, cone, cylinder, ring, torus], any::<bool>())
        .prop_map(|(shape, flip)| Surface { flip, ..Surface::new(shape, 0) })
}

/// Taken over as it is: the generator's surfaces are in unit space already.
pub(crate) fn geometry(surface: &Surface) -> Geometry {
    Geometry::from_surface(surface, &Normalization::default()).expect("generated surfaces are sound")
}

/// A random part: down the tree of splits by random choices.
fn part(geometry: &Geometry, path: &[usize]) -> Domain {
    path.iter().fold(Domain::WHOLE, |domain, choice| {
        let children = geometry.split(domain);
        children[choice % children.len()]
    })
}

fn path() -> impl Strategy<Value = Vec<usize>> {
    prop::collection::vec(0usize..4, 0..6)
}

/// Midpoints of an n×n grid over the unit square.
fn grid(n: usize) -> impl Iterator<Item = (f32, f32)> {
    let at = move |i: usize| (i as f32 + 0.5) / n as f32;
    (0..n * n).map(move |i| (at(i % n), at(i / n)))
}

/// Distance to the surface with a sign that changes where a ray crosses it, in f64 from the scene's numbers; `None`
/// where the nearest point of the unbounded surface is beyond the rim.
fn implicit(shape: &Shape, p: DVec3) -> Option<f64> {
    let polygon = |points: &[DVec3]| {
        let normal = (points[1] - points[0]).cross(points[2] - points[0]).normalize();
        let inside = (0..points.len()).all(|i| {
            let (a, b) = (points[i], points[(i + 1) % points.len()]);
            (b - a).cross(p - a).dot(normal) >= 0.0
        });
        inside.then(|| (p - points[0]).dot(normal))
    };
    match shape {
        Shape::Triangle(points) => polygon(points),
        Shape::Quad(points) => polygon(points),
        Shape::Sphere { center, radius } => Some(p.distance(*center) - radius),
        Shape::Cone { ends, radii } => {
            let axis = (ends[1] - ends[0]).normalize();
            let share = (p - ends[0]).dot(axis) / ends[0].distance(ends[1]);
            let radial = (p - ends[0]).reject_from_normalized(axis).length();
            (0.0..=1.0).contains(&share).then(|| radial - radii[0] - (radii[1] - radii[0]) * share)
        }
        Shape::Ring { center, normal, inner, outer } => {
            let radial = (p - center).reject_from_normalized(*normal).length();
            (*inner..=*outer).contains(&radial).then(|| (p - center).dot(*normal))
        }
        Shape::Torus { center, axis, major, minor } => {
            let radial = (p - center).reject_from_normalized(*axis).length();
            Some((radial - major).hypot((p - center).dot(*axis)) - minor)
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn bounds_and_normal_cone_hold_a_part_and_are_tight(surface in surface(), path in path()) {
        let geometry = geometry(&surface);
        let domain = part(&geometry, &path);
        let (bounds, cone) = (geometry.bounds(domain), geometry.normal_cone(domain));
        let corners = geometry.corners(domain);
        let (mut hull, mut smallest) = (super::Aabb::EMPTY, 1.0f32);
        let interior = grid(24).map(|(s, t)| geometry.domain_point(domain, s, t));
        // Borders, where the extremes are.
        let border = (0..corners.len() * 64).map(|i| {
            let (a, b) = (corners[i / 64], corners[(i / 64 + 1) % corners.len()]);
            a.lerp(b, (i % 64) as f32 / 64.0)
        });
        for uv in interior.chain(border) {
            let (point, normal) = (geometry.point(uv), geometry.normal(uv));
            prop_assert!((normal.length() - 1.0).abs() < 1e-5, "unit normal");
            prop_assert!(bounds.contains(point), "{point} outside {bounds:?}");
            let cosine = cone.axis.as_dvec3().dot(normal.as_dvec3());
            let limit = if geometry.is_flat() { 1.0 - 1e-6 } else { f64::from(cone.cos_angle) };
            prop_assert!(cosine >= limit || cone.cos_angle == -1.0, "{normal} outside {cone:?}: {cosine}");
            hull = super::Aabb::of_points([hull.min, hull.max, point]);
            smallest = smallest.min(cone.axis.dot(normal));
        }
        // A bulge between samples that are an angle α apart is at most α²/2 of the radius; α ≤ 2π/24.
        let slack = 0.035 * bounds.size().length() + 1e-6;
        prop_assert!((bounds.size() - hull.size()).max_element() <= 2.0 * slack, "{bounds:?} against {hull:?}");
        // Between samples an angle α apart the cosine changes by at most α.
        prop_assert!(smallest - cone.cos_angle <= 0.3, "{smallest} against {cone:?}");
        if geometry.is_flat() {
            prop_assert_eq!(cone.cos_angle, 1.0, "flat surfaces have one normal");
        }
    }

    #[test]
    fn areas_agree_with_integration_and_sampling(surface in surface(), path in path()) {
        let geometry = geometry(&surface);
        let domain = part(&geometry, &path);
        let area = geometry.area(domain);
        let n = 32;
        let (mut integral, mut sampled, mut first, mut second) = (0.0f64, 0.0f64, DVec3::ZERO, DVec3::ZERO);
        let side = f64::from((domain.u1 - domain.u0) * (domain.v1 - domain.v0)).abs();
        let side = if matches!(geometry, Geometry::Triangle(_)) { 0.5 * side } else { side };
        for (s, t) in grid(n) {
            let uv = geometry.domain_point(domain, s, t);
            let cell = f64::from(geometry.jacobian(uv)) * side / (n * n) as f64;
            integral += cell;
            first += geometry.point(uv).as_dvec3() * cell;
            let (point, _, weight) = geometry.sample_area(domain, s, t);
            sampled += f64::from(weight) / (n * n) as f64;
            second += point.as_dvec3() * f64::from(weight) / (n * n) as f64;
        }
        // The midpoint rule errs by h²/24 of the second derivative: π²/24/32² = 4e-4 for half a sine's period; the
        // whole torus' jacobian is smooth and periodic.
        let relative = |x: f64| (x / f64::from(area) - 1.0).abs();
        prop_assert!(relative(integral) < 6e-4, "integral {integral} against {area}");
        prop_assert!(relative(sampled) < 6e-4, "samples' weight {sampled} against {area}");
        // Centroids, found with two different densities of samples, to the same accuracy.
        let size = f64::from(geometry.bounds(domain).size().length());
        let distance = (first / integral).distance(second / sampled);
        prop_assert!(distance < 4e-3 * size + 1e-6, "centroids {distance} apart in a part of size {size}");
    }

    #[test]
    fn jacobian_is_the_area_of_a_small_step(surface in surface(), u in 0.01f32..0.9, v in 0.01f32..0.9) {
        let geometry = geometry(&surface);
        let uv = if u + v > 0.95 { vec2(1.0 - u, 1.0 - v) } else { vec2(u, v) };
        let h = 1.0 / 256.0;
        let difference = |step: Vec2| (geometry.point(uv + step) - geometry.point(uv - step)).as_dvec3() / (2.0 * h);
        let (du, dv) = (difference(vec2(h as f32, 0.0)), difference(vec2(0.0, h as f32)));
        let found = du.cross(dv);
        let expected = f64::from(geometry.jacobian(uv));
        // Central differences over a turn: 1 − sinc(2πh) = 1e-4 per factor; positions are rounded to 1e-7.
        let noise = 2e-7 / h * (du.length() + dv.length());
        prop_assert!((found.length() - expected).abs() < 4e-4 * expected + noise, "{} {expected}", found.length());
        if found.length() > 100.0 * noise {
            let cosine = found.normalize().dot(geometry.normal(uv).as_dvec3()).abs();
            prop_assert!(cosine > 0.999, "the normal is perpendicular to the tangents: {cosine}");
        }
    }

    #[test]
    fn children_tile_their_parent(surface in surface(), path in path(), s in 0f32..1.0, t in 0f32..1.0) {
        let geometry = geometry(&surface);
        let domain = part(&geometry, &path);
        let children = geometry.split(domain);
        let sum: f32 = children.iter().map(|c| geometry.area(*c)).sum();
        prop_assert!((sum / geometry.area(domain) - 1.0).abs() < 1e-5, "areas of the children add up");
        let parent = geometry.bounds(domain).padded(1e-6);
        for child in &children {
            let bounds = geometry.bounds(*child);
            prop_assert!(parent.contains(bounds.min) && parent.contains(bounds.max), "{bounds:?} in {parent:?}");
        }
        let uv = geometry.domain_point(domain, s, t);
        prop_assert!(geometry.contains(domain, uv), "a part's point is in it");
        let child = children[geometry.locate(children.iter().copied(), uv)];
        let nearest = vec2(uv.x + 1e-7, uv.y + 1e-7).max(Vec2::ZERO);
        prop_assert!(geometry.contains(child, uv) || geometry.contains(child, nearest), "{uv} in {child:?}");
        // Deterministic, and no child is the parent again.
        prop_assert_eq!(&children, &geometry.split(domain), "the same children every time");
        prop_assert!(children.iter().all(|c| *c != domain), "children differ from their parent");
    }

    #[test]
    fn pieces_become_well_shaped(surface in surface()) {
        let geometry = geometry(&surface);
        let Geometry::Revolution(revolution) = &geometry else { return Ok(()) };
        let mut parts = vec![Domain::WHOLE];
        for _ in 0..12 {
            let index = (0..parts.len())
                .max_by(|&a, &b| geometry.area(parts[a]).total_cmp(&geometry.area(parts[b])))
                .expect("there are parts");
            let worst = parts.swap_remove(index);
            parts.extend(geometry.split(worst));
        }
        let largest = parts.iter().max_by(|a, b| geometry.area(**a).total_cmp(&geometry.area(**b))).expect("parts");
        let (along_u, along_v) = revolution.extent(*largest);
        let (whole_u, whole_v) = revolution.extent(Domain::WHOLE);
        let ratio = |a: f32, b: f32| a.max(b) / a.min(b);
        // The largest piece is no more oblong than splitting can help: a factor 2.5 after a last cut in half, or
        // what a very long surface leaves after a dozen cuts.
        let allowed = (2.0 * super::LONG).max(ratio(whole_u / 4.0, whole_v));
        prop_assert!(ratio(along_u, along_v) <= allowed, "{along_u} by {along_v}");
    }

    #[test]
    fn parameters_of_inverts_point(surface in surface(), s in 0f32..1.0, t in 0f32..1.0) {
        let geometry = geometry(&surface);
        let point = geometry.point(geometry.domain_point(Domain::WHOLE, s, t));
        let again = geometry.point(geometry.parameters_of(point));
        prop_assert!(point.distance(again) < 1e-6, "{point} became {again}");
    }

    #[test]
    fn rays_hit_where_marching_finds_a_crossing(
        surface in surface(), s in 0.01f32..0.99, t in 0.01f32..0.99, from in direction(), distance in 0.1f64..3.0,
        aside in prop_oneof![Just(DVec3::ZERO), direction().prop_map(|d| 0.2 * d)],
    ) {
        let geometry = geometry(&surface);
        let aim = geometry.point(geometry.domain_point(Domain::WHOLE, s, t)) + aside.as_vec3();
        if geometry.is_flat() {
            // Within its plane a ray neither hits nor misses.
            prop_assume!(geometry.normal(Vec2::ZERO).as_dvec3().dot(from).abs() > 1e-3);
        }
        let origin = (aim.as_dvec3() + from * distance).as_vec3();
        let direction = aim - origin;
        let hit = geometry.intersect(origin, direction, 0.0, 2.0);
        // The oracle: the first change of sign along the ray in small steps.
        let at = |t: f64| implicit(&surface.shape, origin.as_dvec3() + direction.as_dvec3() * t);
        let steps = 4000;
        let mut crossing = None;
        for i in 0..steps {
            let (a, b) = (2.0 * f64::from(i) / f64::from(steps), 2.0 * f64::from(i + 1) / f64::from(steps));
            // Shallower ones may be lost in the rounding of the surface to f32.
            let clear = |x: f64| x.abs() > 1e-6;
            if let (Some(x), Some(y)) = (at(a), at(b))
                && x * y <= 0.0
                && clear(x)
                && clear(y)
            {
                crossing = Some((a, b));
                break;
            }
        }
        if let Some((a, b)) = crossing {
            // Marching may have stepped over two crossings before.
            let hit = hit.map(|hit| f64::from(hit.0));
            let slack = 1e-4;
            prop_assert!(hit.is_some_and(|t| t <= b + slack), "hit {hit:?} behind the crossing in {a}…{b}");
        }
        if let Some((t, uv)) = hit {
            let on_ray = origin + direction * t;
            prop_assert!(on_ray.distance(geometry.point(uv)) < 3e-6, "{on_ray} is at {uv}");
            prop_assert!(uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all(), "parameters {uv} in range");
            if let Some((a, b)) = crossing && f64::from(t) < a - 1e-3 {
                // Before the oracle's crossing only where it is blind: at a rim or between its steps.
                let nearby = at(f64::from(t));
                prop_assert!(nearby.is_none_or(|x| x.abs() < 1e-5), "hit at {t}, before {a}…{b}: {nearby:?}");
            }
        }
    }

    /// What is passed by is not hit: rays to points of a surface, or just beside them, from near and from afar.
    #[test]
    fn distances_are_those_of_hits(
        surface in surface(),
        (s, t) in (0f32..1.0, 0f32..1.0),
        (away, beside) in (direction(), direction()),
        (far, off) in (-2.0f32..2.0, -7.0f32..0.0),
    ) {
        let geometry = geometry(&surface);
        let (point, _) = geometry.sample(Domain::WHOLE, s, t);
        let origin = point + away.as_vec3() * 10f32.powf(far);
        let direction = point + beside.as_vec3() * 10f32.powf(off) - origin;
        let hit = geometry.intersect(origin, direction, 0.0, 4.0);
        prop_assert_eq!(geometry.distance(origin, direction, 0.0, 4.0), hit.map(|hit| hit.0));
    }

    #[test]
    fn a_shared_edge_has_the_same_points_on_both_sides(
        a in position(), b in position(), c in position(), d in position(), e in position(), step in 0u32..=256,
    ) {
        let area = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).length();
        prop_assume!(area(a, b, c) > 1e-3 && area(a, b, d) > 1e-3);
        let f = step as f32 / 256.0;
        let triangle = |points: [DVec3; 3]| geometry(&Surface::new(Shape::Triangle(points), 0));
        let first = triangle([a, b, c]).point(vec2(f, 0.0));
        let others = [
            triangle([b, a, d]).point(vec2(1.0 - f, 0.0)),
            triangle([a, d, b]).point(vec2(0.0, f)),
            triangle([d, b, a]).point(vec2(f, 1.0 - f)),
        ];
        for (i, other) in others.into_iter().enumerate() {
            prop_assert_eq!(first, other, "triangle {} along the edge", i);
        }
        prop_assert_eq!(first, triangle([d, a, b]).point(vec2(1.0 - f, f)), "opposite edge");
        // A parallelogram on the same edge, in each of its four turns.
        let mut corners = [a, b, b + (d - a), d];
        prop_assume!(e.is_finite());
        for turn in 0..4 {
            let quad = geometry(&Surface::new(Shape::Quad(corners), 0));
            let uv = [vec2(f, 0.0), vec2(0.0, 1.0 - f), vec2(1.0 - f, 1.0), vec2(1.0, f)][turn];
            prop_assert_eq!(first, quad.point(uv), "quadrilateral, turn {}", turn);
            corners.rotate_left(1);
        }
    }
}

#[test]
fn normals_face_the_front() {
    let outward = |shape: Shape, uv: Vec2, expected: Vec3| {
        for flip in [false, true] {
            let surface = Surface { flip, ..Surface::new(shape.clone(), 0) };
            let normal = geometry(&surface).normal(uv);
            let expected = if flip { -expected } else { expected };
            assert!(normal.distance(expected) < 1e-6, "{shape:?}, flip {flip}: {normal}");
        }
    };
    let (o, x, y, z) = (DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z);
    outward(Shape::Triangle([o, x, y]), vec2(0.2, 0.2), Vec3::Z);
    outward(Shape::Quad([o, x, x + y, y]), vec2(0.2, 0.2), Vec3::Z);
    outward(Shape::Sphere { center: o, radius: 0.5 }, vec2(0.3, 0.0), Vec3::Z);
    outward(Shape::Ring { center: o, normal: -y, inner: 0.1, outer: 0.2 }, vec2(0.3, 0.5), Vec3::NEG_Y);
    outward(Shape::Torus { center: o, axis: x, major: 0.5, minor: 0.1 }, vec2(0.7, 0.25), Vec3::X);
    let cone = Shape::Cone { ends: [o, z], radii: [1.0, 0.0] };
    for u in [0.0, 0.3, 0.8] {
        let normal = geometry(&Surface::new(cone.clone(), 0)).normal(vec2(u, 0.5));
        assert!((normal.z - 0.5f32.sqrt()).abs() < 1e-6, "a tent's roof looks up by 45°: {normal}");
    }
}

#[test]
fn unsound_surfaces_are_named() {
    let (o, x, y, z) = (DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z);
    let error = |shape| Geometry::from_surface(&Surface::new(shape, 0), &Normalization::default()).err();
    let nan = DVec3::new(f64::NAN, 0.0, 0.0);
    let radius = |e| matches!(e, Some(GeometryError::Radius { .. }));
    assert_eq!(error(Shape::Triangle([o, x, nan])), Some(GeometryError::NonFinite), "NaN corner");
    assert_eq!(error(Shape::Triangle([o, x, x * 1e300 * 1e300])), Some(GeometryError::NonFinite), "infinite corner");
    assert_eq!(error(Shape::Triangle([o, x, x * 2.0])), Some(GeometryError::NoArea("triangle")), "collinear");
    assert_eq!(error(Shape::Triangle([x, x, x])), Some(GeometryError::NoArea("triangle")), "a point");
    assert_eq!(error(Shape::Triangle([o, x * 1e-60, y * 1e-60])), Some(GeometryError::Vanishing), "far too small");
    assert_eq!(error(Shape::Triangle([o, x * 1e300, y * 1e300])), Some(GeometryError::NonFinite), "far too large");
    assert_eq!(error(Shape::Quad([o, x, y, x * 2.0 + y])), Some(GeometryError::NotConvex), "bow tie");
    assert_eq!(error(Shape::Quad([o, x, (x + y) * 0.2, y])), Some(GeometryError::NotConvex), "reflex corner");
    assert_eq!(error(Shape::Quad([o, x, x, y])), Some(GeometryError::NotConvex), "coinciding corners");
    let lifted = error(Shape::Quad([o, x, x + y + z * 0.1, y]));
    assert!(matches!(lifted, Some(GeometryError::NotPlanar { .. })), "not planar: {lifted:?}");
    assert!(radius(error(Shape::Sphere { center: o, radius: 0.0 })), "sphere without radius");
    assert!(radius(error(Shape::Sphere { center: o, radius: -1.0 })), "negative sphere");
    assert!(radius(error(Shape::Ring { center: o, normal: z, inner: 1.0, outer: 1.0 })), "empty ring");
    assert!(radius(error(Shape::Ring { center: o, normal: z, inner: -0.1, outer: 1.0 })), "negative inner radius");
    assert!(radius(error(Shape::Torus { center: o, axis: z, major: 0.1, minor: 0.2 })), "spindle torus");
    assert!(radius(error(Shape::Cone { ends: [o, z], radii: [0.1, -0.1] })), "negative cone");
    let cone = |ends, radii| error(Shape::Cone { ends, radii });
    assert_eq!(cone([o, z], [0.0, 0.0]), Some(GeometryError::NoArea("cone")), "a line");
    assert!(matches!(cone([o, o], [0.1, 0.2]), Some(GeometryError::NoDirection(_))), "no axis");
    let ring = error(Shape::Ring { center: o, normal: o, inner: 0.0, outer: 1.0 });
    assert!(matches!(ring, Some(GeometryError::NoDirection(_))), "no normal");
    assert_eq!(error(Shape::Sphere { center: nan, radius: 1.0 }), Some(GeometryError::NonFinite), "NaN centre");
}

#[test]
fn normalization_fills_the_unit_cube_and_keeps_precision() {
    for (offset, scale) in [(0.0, 1.0), (1e6, 1e-2), (-4e5, 1e3), (0.0, 1e-9), (3.0, 1e9)] {
        let offset = dvec3(offset, -2.0 * offset, 0.5 * offset);
        let place = |p: DVec3| offset + p * scale;
        let corners = [dvec3(0.0, 0.0, 0.0), dvec3(1.0, 0.25, 0.0), dvec3(0.3, 0.125, 0.5)];
        let mut surfaces = vec![Surface::new(Shape::Triangle(corners.map(place)), 0)];
        surfaces.push(Surface::new(Shape::Sphere { center: DVec3::NAN, radius: 1.0 }, 0));
        let normalization = Normalization::new(&surfaces);
        for corner in corners {
            // What f64 leaves of the scene's coordinates, and the rounding to f32.
            let tolerance = 1e-6_f64.max(4.0 * f64::EPSILON * offset.length() / scale);
            let unit = normalization.to_unit(place(corner));
            assert!(unit.as_dvec3().distance(corner) < tolerance, "{corner} became {unit} (scale {scale})");
            let back = normalization.to_scene(unit);
            assert!(back.distance(place(corner)) < 2.0 * tolerance * scale, "{corner} came back as {back}");
        }
    }
    assert_eq!(Normalization::new(&[]), Normalization::default(), "an empty scene stays as it is");
    // Bounds of curved surfaces are exact: each one alone fills the cube along its longest side.
    let axis = dvec3(1.0, 2.0, 2.0) / 3.0;
    let (center, ends) = (dvec3(5.0, 6.0, 7.0), [DVec3::ZERO, axis * 4.0]);
    for shape in [
        Shape::Sphere { center, radius: 2.0 },
        Shape::Ring { center, normal: axis, inner: 0.5, outer: 2.0 },
        Shape::Torus { center, axis, major: 2.0, minor: 0.5 },
        Shape::Cone { ends, radii: [0.5, 1.0] },
    ] {
        let surface = Surface::new(shape, 0);
        let normalization = Normalization::new(std::slice::from_ref(&surface));
        let geometry = Geometry::from_surface(&surface, &normalization).expect("sound");
        let bounds = geometry.bounds(Domain::WHOLE);
        assert!(bounds.min.abs().max_element() < 2e-6, "begins at 0: {bounds:?}");
        assert!((bounds.max.max_element() - 1.0).abs() < 2e-6, "ends at 1: {bounds:?}");
    }
}

#[test]
fn known_areas() {
    use std::f32::consts::PI;
    let area = |shape| geometry(&Surface::new(shape, 0)).area(Domain::WHOLE);
    let (o, z) = (DVec3::ZERO, DVec3::Z);
    let close = |a: f32, b: f32| assert!((a / b - 1.0).abs() < 1e-6, "{a} should be {b}");
    close(area(Shape::Sphere { center: o, radius: 0.5 }), PI);
    close(area(Shape::Torus { center: o, axis: z, major: 0.5, minor: 0.25 }), 0.5 * PI * PI);
    close(area(Shape::Ring { center: o, normal: z, inner: 0.25, outer: 0.5 }), PI * (0.25 - 0.0625));
    close(area(Shape::Cone { ends: [o, z], radii: [0.5, 0.5] }), PI);
    close(area(Shape::Cone { ends: [o, z * 0.4], radii: [0.3, 0.0] }), PI * 0.3 * 0.5);
}

#[test]
fn surfaces_of_revolution_close_without_a_seam() {
    for shape in [
        Shape::Sphere { center: dvec3(0.3, 0.4, 0.5), radius: 0.2 },
        Shape::Torus { center: dvec3(0.3, 0.4, 0.5), axis: dvec3(0.6, 0.0, 0.8), major: 0.2, minor: 0.05 },
    ] {
        let geometry = geometry(&Surface::new(shape, 0));
        for i in 0..=64 {
            let f = i as f32 / 64.0;
            assert_eq!(geometry.point(vec2(0.0, f)), geometry.point(vec2(1.0, f)), "seam in u at {f}");
        }
    }
}

//! Against testing every surface, against walls without gaps, and on scenes that trees do not like.

use super::{End, MOST_LISTED, NO_BLOCKER, Proof, Shaft, Visibility};
use crate::geometry::tests::{geometry, surface};
use crate::geometry::{Aabb, Domain, Geometry};
use crate::sampling::point4;
use crate::{Shape, Surface};
use glam::{DVec3, Vec3, dvec3, vec2, vec3};
use proptest::prelude::*;

fn scene(shapes: impl IntoIterator<Item = Shape>) -> Visibility {
    let geometries: Vec<Geometry> = shapes.into_iter().map(|shape| geometry(&Surface::new(shape, 0))).collect();
    Visibility::new(&geometries)
}

fn blocked(visibility: &Visibility, from: Vec3, to: Vec3) -> bool {
    visibility.occluded(from, to, [NO_BLOCKER; 2], &mut { NO_BLOCKER })
}

/// A ray's end: anywhere, or on a lattice, so that rays run along axes, through corners and within planes.
fn end() -> impl Strategy<Value = Vec3> {
    let lattice = prop::sample::select(vec![-0.5f32, 0.0, 0.25, 0.5, 1.0, 1.5]);
    prop_oneof![
        2 => [-0.5f32..1.5, -0.5f32..1.5, -0.5f32..1.5],
        1 => [lattice.clone(), lattice.clone(), lattice],
    ]
    .prop_map(Vec3::from_array)
}

/// Places in a pyramid's cross section, from its middle.
fn across() -> impl Strategy<Value = [f64; 2]> {
    [-1.0..1.0, -1.0..1.0]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Rays of a beam meet what they meet without it, and all the same where the beam says so.
    #[test]
    fn beams_hold_what_their_rays_meet_first(
        surfaces in prop::collection::vec(surface(), 0..40),
        eye in end(),
        target in end(),
        (width, margin) in (prop::sample::select(vec![1.0, 0.1, 0.01, 1e-3, 1e-5]), 1e-3..1e-2),
        places in prop::collection::vec(across(), 40),
    ) {
        let geometries: Vec<Geometry> = surfaces.iter().map(geometry).collect();
        let visibility = Visibility::new(&geometries);
        let forward = (target - eye).as_dvec3();
        prop_assume!(forward.length() > 1e-3);
        let (right, up) = forward.normalize().any_orthonormal_pair();
        let toward = |[x, y]: [f64; 2]| (forward.normalize() + (right * x + up * y) * width).normalize();
        let edge: f64 = 1.0 + margin;
        let corners = [[-edge, -edge], [edge, -edge], [edge, edge], [-edge, edge]].map(toward);
        let Some(beam) = visibility.beam(eye, corners, 1e-6) else { return Ok(()) };
        let mut met = Vec::new();
        for place in places {
            let direction = toward(place).as_vec3();
            let (found, expected) = (visibility.first_in(&beam, direction), visibility.first(eye, direction, 1e-6, f32::MAX));
            // Surfaces that coincide are met in any order.
            prop_assert_eq!(found.map(|hit| hit.1), expected.map(|hit| hit.1), "{:?}, {:?}", found, expected);
            met.push(found.map(|hit| hit.0));
        }
        if beam.is_even() {
            prop_assert!(met.iter().all(|surface| *surface == met[0]), "{:?}", met);
        }
    }
}

/// A wall hides all that is behind it; what stands before it is found, too.
#[test]
fn beams_end_at_walls() {
    let square = |z: f64, half: f64| {
        Shape::Quad(
            [(-1, -1), (1, -1), (1, 1), (-1, 1)].map(|(x, y)| dvec3(f64::from(x) * half, f64::from(y) * half, z)),
        )
    };
    let behind = (0..30).map(|i| square(2.0 + 0.1 * f64::from(i), 1.0));
    let visibility = scene(behind.chain([square(1.0, 1.0), square(0.5, 0.02)]));
    let corners = |x: f64| [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)].map(|(a, b)| dvec3(x + a, b, 1.0));
    let [amid, aside] = [0.0, 0.5].map(|x| visibility.beam(Vec3::ZERO, corners(x), 1e-6).expect("few surfaces"));
    assert_eq!((amid.count(), amid.is_even()), (2, false), "the wall and the square before it");
    assert_eq!((aside.count(), aside.is_even()), (1, true), "the wall alone");
    let away = corners(0.0).map(|corner| -corner);
    let away = visibility.beam(Vec3::ZERO, away, 1e-6).expect("no surfaces");
    assert_eq!((away.count(), away.is_even()), (0, true), "nothing");
    let wide = corners(0.0).map(|corner| corner * dvec3(1e3, 1e3, 1.0));
    assert!(visibility.beam(Vec3::ZERO, wide, 1e-6).is_none(), "nearly half of all directions");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn queries_agree_with_testing_all_surfaces(
        surfaces in prop::collection::vec(surface(), 0..60),
        rays in prop::collection::vec((end(), end(), 0u32..60, 0u32..60), 40),
    ) {
        let geometries: Vec<Geometry> = surfaces.iter().map(geometry).collect();
        let visibility = Visibility::new(&geometries);
        let mut cache = NO_BLOCKER;
        for (from, to, first, second) in rays {
            let direction = to - from;
            let length = direction.length();
            let hits: Vec<(u32, f32)> = (0..geometries.len() as u32)
                .filter_map(|i| Some((i, geometries[i as usize].intersect(from, direction, 0.0, 1.0)?.0)))
                .collect();
            // Within the trims at the ends, which are tested elsewhere, both answers are right.
            let near = |t: f32| t.min(1.0 - t) * length < 3e-3;
            let blocks = |(i, _): &&(u32, f32)| {
                let own = *i == first || *i == second;
                !(own && geometries[*i as usize].is_flat())
            };
            let clear = hits.iter().filter(blocks).all(|hit| !near(hit.1));
            if clear {
                let expected = hits.iter().find(blocks).is_some();
                let found = visibility.occluded(from, to, [first, second], &mut cache);
                prop_assert_eq!(found, expected, "{} to {}: {:?}, cache {}", from, to, &hits, cache);
                let again = visibility.occluded(from, to, [first, second], &mut { NO_BLOCKER });
                prop_assert_eq!(found, again, "the cache changes nothing");
            }
            let nearest = hits.iter().map(|hit| hit.1).fold(f32::INFINITY, f32::min);
            match visibility.closest(from, direction, 0.0, 1.0) {
                None => prop_assert!(hits.is_empty(), "{from} to {to} misses {hits:?}"),
                Some(hit) => {
                    prop_assert_eq!(hit.t, nearest, "{} to {}", from, to);
                    let off = hit.point.distance(from + direction * hit.t);
                    // Rounding across the surface is more along a ray that grazes it.
                    let cosine = hit.normal.dot(direction.normalize()).abs();
                    prop_assert!(off < 3e-6 + 1e-7 / cosine, "the hit is on the ray: {} at a cosine of {}", off, cosine);
                    prop_assert_eq!(hit.front, hit.normal.dot(direction) < 0.0, "front is where the normal points");
                }
            }
        }
    }

    #[test]
    fn short_and_long_segments_meet_a_wall_between_them(
        length in -4.0f32..0.5, share in 0.1f32..0.9, tilt in -1f32..1.0,
    ) {
        let wall = [dvec3(0.5, 0.0, 0.0), dvec3(0.5, 1.0, 0.0), dvec3(0.5, 1.0, 1.0), dvec3(0.5, 0.0, 1.0)];
        let wall = scene([Shape::Quad(wall)]);
        let step = vec3(1.0, tilt, 0.2).normalize() * 10f32.powf(length) * 0.3;
        let middle = vec3(0.5, 0.5, 0.5);
        prop_assert!(blocked(&wall, middle - step * share, middle + step * (1.0 - share)), "step {step}");
        // Ends on the wall are not blocked by it, known as their surface or not.
        prop_assert!(!blocked(&wall, middle, middle + step), "from the wall");
        prop_assert!(!blocked(&wall, middle - step, middle), "to the wall");
    }
}

/// A wall in the plane x = 0.5, n×n cells over the unit square, corners at random offsets (or on the lattice),
/// alternating quadrilaterals and pairs of triangles with either diagonal.
fn wall(n: usize, jitter: f64, place: impl Fn(f64, f64) -> DVec3) -> Vec<Shape> {
    let offset = |i: usize, j: usize, k: usize| {
        let inside = i > 0 && j > 0 && i < n && j < n;
        let noise = ((i * 7919 + j * 104_729 + k * 31) % 1000) as f64 / 1000.0 - 0.5;
        if inside { jitter * noise } else { 0.0 }
    };
    let corner = |i: usize, j: usize| {
        let step = 1.0 / n as f64;
        place(step * (i as f64 + offset(i, j, 0)), step * (j as f64 + offset(i, j, 1)))
    };
    let mut shapes = Vec::new();
    for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
        let (a, b, c, d) = (corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1));
        match (i + 2 * j) % 3 {
            0 => shapes.push(Shape::Quad([a, b, c, d])),
            1 => shapes.extend([Shape::Triangle([a, b, c]), Shape::Triangle([c, d, a])]),
            _ => shapes.extend([Shape::Triangle([b, c, d]), Shape::Triangle([b, d, a])]),
        }
    }
    shapes
}

#[test]
fn walls_do_not_leak() {
    type Place = fn(f64, f64) -> DVec3;
    let planes: [(&str, Place, Vec3); 3] = [
        ("upright", |a, b| dvec3(0.5, a, b), Vec3::X),
        ("slanted", |a, b| dvec3(0.2 + 0.6 * a, 0.9 * b + 0.05, 0.1 + 0.7 * a + 0.1 * b), vec3(-0.7, -0.1, 0.6)),
        ("bent", |a, b| dvec3(0.4 + 0.3 * (a - 0.5).abs(), a, b), Vec3::X),
    ];
    for (name, place, across) in planes {
        for (n, jitter) in [(8, 0.0), (13, 0.0), (13, 0.4)] {
            // Bent cells with jitter are not planar as quadrilaterals only where the fold runs through them.
            if name == "bent" && (n % 2 == 1 || jitter > 0.0) {
                continue;
            }
            let shapes = wall(n, jitter, place);
            // Every corner, edge middle and diagonal's middle, as the f32 surfaces have them.
            let targets: Vec<Vec3> = shapes
                .iter()
                .map(|shape| geometry(&Surface::new(shape.clone(), 0)))
                .flat_map(|g| {
                    let uvs = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.5, 0.0), (0.0, 0.5), (0.3, 0.7)];
                    uvs.map(|(u, v)| g.point(vec2(u, v)))
                })
                // The wall's own border may be missed.
                .filter(|p| {
                    let border = |a: f64, b: f64| place(a, b).as_vec3().distance(*p);
                    !(0..=200).any(|i| {
                        let f = f64::from(i) / 200.0;
                        [border(0.0, f), border(1.0, f), border(f, 0.0), border(f, 1.0)].iter().any(|d| *d < 6e-3)
                    })
                })
                .collect();
            assert!(targets.len() > n * n, "there is something to aim at");
            let visibility = scene(shapes);
            let mut leaks = 0;
            let mut rays = 0;
            for target in targets {
                for aside in [Vec3::ZERO, vec3(0.0, 0.25, 0.0), vec3(0.1, 0.2, -0.3), vec3(0.013, -0.4, 0.37)] {
                    for side in [1.0, -1.0] {
                        let step = side * (0.5 * across + aside);
                        rays += 2;
                        leaks += u32::from(!blocked(&visibility, target - step, target + step));
                        leaks += u32::from(visibility.closest(target - step, step, 0.0, 2.0).is_none());
                    }
                }
            }
            assert_eq!(leaks, 0, "of {rays} rays, {name} wall of {n}×{n}, jitter {jitter}");
        }
    }
}

#[test]
fn abutting_surfaces_are_free_at_the_corner() {
    let floor = Shape::Quad([DVec3::ZERO, DVec3::X, dvec3(1.0, 1.0, 0.0), DVec3::Y]);
    let wall = Shape::Quad([DVec3::ZERO, DVec3::Y, dvec3(0.0, 1.0, 1.0), DVec3::Z]);
    let room = scene([floor, wall]);
    for i in 0..=16 {
        let f = i as f32 / 16.0;
        // From the shared edge to anywhere in the room, and from patch to patch.
        assert!(!blocked(&room, vec3(0.0, f, 0.0), vec3(0.7, 0.3, 0.9)), "from the edge at {f}");
        assert!(!blocked(&room, vec3(0.01 * f, 0.5, 0.0), vec3(0.0, 0.4, 0.01)), "across the corner at {f}");
        assert!(blocked(&room, vec3(0.5, 0.5, 0.5), vec3(0.5 * f, 0.5, -0.5)), "through the floor at {f}");
    }
}

#[test]
fn curved_surfaces_block_their_own_far_side_only() {
    let center = dvec3(0.5, 0.5, 0.5);
    for (shape, concave) in [
        (Shape::Sphere { center, radius: 0.3 }, false),
        (Shape::Cone { ends: [dvec3(0.5, 0.5, 0.1), dvec3(0.5, 0.5, 0.9)], radii: [0.2, 0.3] }, false),
        (Shape::Torus { center, axis: DVec3::Z, major: 0.3, minor: 0.1 }, true),
    ] {
        let surface = geometry(&Surface::new(shape.clone(), 0));
        let visibility = Visibility::new(std::slice::from_ref(&surface));
        let mut free = 0;
        for i in 0..400u32 {
            let uv = vec2((i * 37 % 400) as f32 / 400.0, (i as f32 + 0.5) / 400.0);
            let (point, normal) = (surface.point(uv), surface.normal(uv));
            let tangent = normal.any_orthonormal_vector();
            let skip = [0, NO_BLOCKER];
            let cast = |direction: Vec3| visibility.occluded(point, point + direction, skip, &mut { NO_BLOCKER });
            // Beyond the opposite point, the far side is in between.
            let other = surface.point(vec2((uv.x + 0.5).fract(), uv.y));
            assert!(cast(1.5 * (other - point)), "{shape:?}: through the body at {uv}");
            // Outward it is free for convex ones, down to grazing directions.
            for rise in [1.0, 0.1, 1e-2, 1e-3] {
                let blocked = cast(2.0 * (tangent + normal * rise).normalize());
                assert!(concave || !blocked, "{shape:?}: leaving at {uv} by {rise}");
                free += u32::from(!blocked);
            }
            // Up to the opposite point nothing is, but the tube of the torus if one starts on its outer half.
            let hidden = visibility.occluded(point, other, [0, 0], &mut { NO_BLOCKER });
            assert_eq!(hidden, concave && (uv.y - 0.5).abs() > 0.25, "{shape:?} across from {uv}");
        }
        assert!(free > 800, "{shape:?}: most outward rays are free, {free} of 1600");
    }
}

#[test]
fn scenes_that_trees_do_not_like() {
    let triangle = Shape::Triangle([DVec3::ZERO, DVec3::X, DVec3::Y]);
    let empty = scene([]);
    assert!(!blocked(&empty, Vec3::ZERO, Vec3::ONE), "nothing blocks");
    assert_eq!(empty.closest(Vec3::ZERO, Vec3::X, 0.0, 1.0), None, "nothing is hit");
    let single = scene([triangle.clone()]);
    assert!(blocked(&single, vec3(0.2, 0.2, 1.0), vec3(0.2, 0.2, -1.0)), "a tree of one leaf");
    let hit = single.closest(vec3(0.2, 0.2, 1.0), -Vec3::Z, 0.0, 9.0).expect("in front");
    assert!(hit.front && hit.t == 1.0 && hit.surface == 0, "{hit:?}");
    assert_eq!(single.closest_except(vec3(0.2, 0.2, 0.0), Vec3::Z, -1.0, 9.0, 0), None, "its own plane");

    let same = scene(vec![triangle; 4000]);
    assert!(blocked(&same, vec3(0.2, 0.2, 1.0), vec3(0.2, 0.2, -1.0)), "4000 times the same");
    let center = DVec3::splat(0.5);
    let nested = scene((1..=600).map(|i| Shape::Sphere { center, radius: f64::from(i) / 1200.0 }));
    assert!(!blocked(&nested, Vec3::ZERO, vec3(1.0, 0.0, 0.0)), "past concentric spheres");
    let hit = nested.closest(vec3(0.5, 0.5, 2.0), -Vec3::Z, 0.0, 9.0).expect("in front");
    assert_eq!((hit.surface, hit.front), (599, true), "the outermost of concentric spheres");

    for bad in [f32::NAN, f32::INFINITY] {
        assert!(!blocked(&same, Vec3::splat(bad), Vec3::ONE), "{bad} at one end");
        assert_eq!(same.closest(Vec3::splat(bad), Vec3::X, 0.0, 1.0), None, "{bad} as origin");
        assert_eq!(same.closest(Vec3::ZERO, Vec3::splat(bad), 0.0, 1.0), None, "{bad} as direction");
    }
    assert!(!blocked(&same, Vec3::splat(0.3), Vec3::splat(0.3)), "no length");
}

#[test]
fn rays_in_the_plane_of_a_polygon_far_away_miss_it() {
    // All edge functions are rounding, and the normal of so small a polygon is not quite perpendicular to the ray.
    let (from, to) = (vec3(0.0, 1.0, 1.5), vec3(1.0, 0.0, 1.5));
    let corners = [
        dvec3(1.0006696043835028, -0.0006696043835028145, 0.18184988397190044),
        dvec3(0.9997758244255296, 0.00022417557447039182, 0.1827743679369842),
        dvec3(0.9993303956164972, 0.0006696043835028145, 0.1838419953404749),
        dvec3(1.000383421823116, -0.0003834218231160005, 0.1826679428122689),
    ];
    let visibility = scene([Shape::Quad(corners)]);
    assert_eq!(visibility.geometries()[0].distance(from, to - from, 0.0, 1.0), None);
    // As the surface that blocked last it is tested first, without its box.
    assert!(!visibility.occluded(from, to, [NO_BLOCKER; 2], &mut 0));
}

#[test]
fn ends_just_off_a_surface_see_it() {
    // A lid a ten-thousandth above the floor hides it: the trim at the ends must not swallow it.
    let lid = Shape::Quad([dvec3(0.0, 0.0, 1e-4), dvec3(1.0, 0.0, 1e-4), dvec3(1.0, 1.0, 1e-4), dvec3(0.0, 1.0, 1e-4)]);
    let visibility = scene([lid]);
    assert!(blocked(&visibility, vec3(0.3, 0.3, 0.0), vec3(0.4, 0.5, 1.0)), "under the lid");
    assert!(blocked(&visibility, vec3(0.3, 0.3, 0.9e-4), vec3(0.3, 0.3, 1.1e-4)), "both ends at the lid");
}

#[test]
fn hits_locate_the_part() {
    // The parameters of a hit locate the part of the surface that was hit.
    let quad = Shape::Quad([DVec3::ZERO, DVec3::X, dvec3(0.7, 0.6, 0.0), dvec3(0.1, 0.8, 0.0)]);
    let surface = geometry(&Surface::new(quad.clone(), 0));
    let visibility = scene([quad]);
    let children = surface.split(Domain::WHOLE);
    for (i, child) in children.iter().enumerate() {
        let target = surface.point(child.lerp(0.4, 0.6));
        let hit = visibility.closest(target + vec3(0.1, 0.2, 0.5), vec3(-0.1, -0.2, -0.5), 0.0, 2.0).expect("hit");
        assert_eq!(surface.locate(children.iter().copied(), hit.uv), i, "part {i} at {}", hit.uv);
    }
}

#[test]
fn walls_do_not_leak_from_afar() {
    // From afar the boxes' near and far distances differ by little more than their rounding.
    let visibility = scene(wall(24, 0.3, |a, b| dvec3(0.5, a, b)));
    for i in 0..4000u32 {
        let share = |k: u32| (i.wrapping_mul(k) % 4001) as f32 / 4001.0;
        let target = vec3(0.5, 0.01 + 0.98 * share(577), 0.01 + 0.98 * share(1423));
        for distance in [3.0, 40.0, 500.0] {
            let eye = vec3(0.5, 0.5, 0.5) + vec3(1.0, share(31) - 0.5, 0.5 - share(97)) * distance;
            let hit = visibility.closest(eye, target - eye, 0.0, 2.0);
            assert!(hit.is_some(), "from {eye} at {target}");
            assert!(blocked(&visibility, eye, 2.0 * target - eye), "from {eye} through {target}");
        }
    }
}

fn triangle([a, b, c]: [Vec3; 3]) -> End {
    End::polygon(&[a, b, c], (b - a).cross(c - a).normalize_or(Vec3::Z))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Proofs hold for every segment between points that face each other.
    #[test]
    fn what_is_proved_holds_for_all_segments(
        surfaces in prop::collection::vec(surface(), 1..12),
        corners in prop::array::uniform6(end()),
        size in prop::sample::select(vec![0.01f32, 0.1, 0.4]),
        boxed in prop::bool::ANY,
        seed in 0u32..1000,
    ) {
        let geometries: Vec<Geometry> = surfaces.iter().map(geometry).collect();
        let visibility = Visibility::new(&geometries);
        let [a, b, c, d, e, f] = corners;
        let shrunk = |a: Vec3, b: Vec3, c: Vec3, size: f32| [a, a + (b - a) * size, a + (c - a) * size];
        let [from, to] = [shrunk(a, b, c, size), shrunk(d, e, f, size)];
        let normals = [from, to].map(|[a, b, c]| (b - a).cross(c - a));
        prop_assume!(normals.iter().all(|normal| normal.length() > 1e-9));
        let ends = |[from, to]: [[Vec3; 3]; 2]| {
            let to = if boxed { End::within(Aabb::of_points(to)) } else { triangle(to) };
            Shaft::new([triangle(from), to])
        };
        let own = [NO_BLOCKER; 2];
        let proof = visibility.prove(&ends([from, to]), own, MOST_LISTED);
        let point = |[a, b, c]: [Vec3; 3], s: f32, t: f32| {
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            a + (b - a) * s + (c - a) * t
        };
        for i in 0..32 {
            // Off the edges, where touching surfaces hide what their rounding decides.
            let u = point4(seed, i) * 0.98 + 0.01;
            let (p, q) = (point(from, u.x, u.y), point(to, u.z, u.w));
            let along = (q - p).normalize_or_zero();
            let before = along.dot(normals[0].normalize()) > 1e-3;
            if before && (boxed || along.dot(normals[1].normalize()) < -1e-3) {
                let mut blocker = NO_BLOCKER;
                let hit = visibility.occluded(p, q, own, &mut blocker);
                let given = visibility.occluded_given(&proof, p, q, own, &mut { NO_BLOCKER });
                prop_assert_eq!(given, hit, "{} to {} meets {}, but {:?}", p, q, blocker, &proof);
            }
        }
    }
}

#[test]
fn shafts_of_walls_and_rooms() {
    let wall = |x: f64| Shape::Quad([dvec3(x, 0.0, 0.0), dvec3(x, 1.0, 0.0), dvec3(x, 1.0, 1.0), dvec3(x, 0.0, 1.0)]);
    let patch = |x: f32, low: f32, high: f32, normal: Vec3| {
        End::polygon(&[vec3(x, low, low), vec3(x, high, low), vec3(x, high, high), vec3(x, low, high)], normal)
    };
    let visibility = scene([wall(0.0), wall(0.5), wall(1.0)]);
    let own = [0, 2];
    let shaft = |a: f32, b: f32, high: f32| Shaft::new([patch(a, 0.1, 0.4, Vec3::X), patch(b, 0.2, high, Vec3::NEG_X)]);
    let prove = |a: f32, b: f32, high: f32| visibility.prove(&shaft(a, b, high), own, MOST_LISTED);
    assert_eq!(prove(0.0, 1.0, 0.9), Proof::Blocked, "a wall between");
    assert_eq!(prove(0.0, 0.5, 0.9), Proof::Free, "up to the wall");
    let known = prove(0.0, 1.0, 2.5);
    assert_eq!(known, Proof::Among(smallvec::smallvec![1]), "some pass beside it");
    assert_eq!(visibility.prove(&shaft(0.0, 1.0, 2.5), own, 0), Proof::Unknown, "more than what may be listed");
    let beside = Shaft::new([patch(0.0, 2.1, 2.2, Vec3::X), patch(1.0, 2.2, 2.9, Vec3::NEG_X)]);
    assert_eq!(visibility.prove(&beside, own, MOST_LISTED), Proof::Free, "beside the wall");
    // What is behind either end is not between them.
    let averted = Shaft::new([patch(0.0, 0.1, 0.4, Vec3::NEG_X), patch(1.0, 0.2, 0.9, Vec3::NEG_X)]);
    assert_eq!(visibility.prove(&averted, own, MOST_LISTED), Proof::Free, "no segment faces both");
}

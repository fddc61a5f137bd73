use super::*;
use crate::geometry::tests::{geometry, surface};
use crate::{Shape, Surface};
use glam::vec3;
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;

/// Oracle: midpoint rule over a parallelogram sender in f64.
fn brute(x: DVec3, n: DVec3, origin: DVec3, a: DVec3, b: DVec3) -> f64 {
    let count = 600;
    let area = a.cross(b).length() / f64::from(count * count);
    let normal = a.cross(b).normalize();
    let mut sum = 0.0;
    for i in 0..count {
        for j in 0..count {
            let p =
                origin + a * ((f64::from(i) + 0.5) / f64::from(count)) + b * ((f64::from(j) + 0.5) / f64::from(count));
            let to = p - x;
            let d2 = to.length_squared();
            sum += (to.dot(n).max(0.0) * (-to.dot(normal)).max(0.0)) / (PI * d2 * d2) * area;
        }
    }
    sum
}

#[test]
fn polygon_agrees_with_brute_force_also_across_the_horizon() {
    let (origin, a, b) = (DVec3::new(-0.5, -1.0, 1.0), DVec3::new(0.0, 2.0, 0.3), DVec3::new(1.5, 0.0, 0.1));
    let corners = [origin, origin + a, origin + a + b, origin + b].map(|c| c.as_vec3());
    for n in [DVec3::Z, DVec3::new(1.0, 0.0, 0.2), DVec3::new(-0.3, 0.9, -0.2)] {
        let n = n.normalize();
        let x = DVec3::new(0.1, 0.2, 0.0);
        let exact = brute(x, n, origin, a, b);
        let ours = f64::from(point_to_polygon(x.as_vec3(), n.as_vec3(), &corners));
        assert!((ours - exact).abs() < 2e-4, "normal {n}: {ours} against {exact}");
        let reversed: Vec<Vec3> = corners.iter().rev().copied().collect();
        assert_eq!(point_to_polygon(x.as_vec3(), n.as_vec3(), &reversed), 0.0, "the polygon's back is dark");
    }
}

#[test]
fn enclosing_box_sums_to_one() {
    let c = |x: f32, y: f32, z: f32| vec3(x, y, z);
    let faces = [
        [c(0., 0., 1.), c(0., 1., 1.), c(1., 1., 1.), c(1., 0., 1.)],
        [c(0., 0., 0.), c(0., 1., 0.), c(0., 1., 1.), c(0., 0., 1.)],
        [c(1., 0., 0.), c(1., 0., 1.), c(1., 1., 1.), c(1., 1., 0.)],
        [c(0., 0., 0.), c(0., 0., 1.), c(1., 0., 1.), c(1., 0., 0.)],
        [c(0., 1., 0.), c(1., 1., 0.), c(1., 1., 1.), c(0., 1., 1.)],
    ];
    for x in [vec3(0.5, 0.5, 0.0), vec3(1e-4, 0.3, 0.0), vec3(0.999, 0.001, 0.0)] {
        let sum: f32 = faces.iter().map(|face| point_to_polygon(x, Vec3::Z, face)).sum();
        assert!((sum - 1.0).abs() < 1e-5, "at {x} the row sums to {sum}");
    }
}

#[test]
fn sphere_agrees_with_sampling_its_cap() {
    // Oracle: integrate the cosine over the directions that hit the sphere.
    for (center, radius) in [(vec3(0.0, 0.0, 2.0), 0.5), (vec3(1.5, 0.0, 0.4), 0.8), (vec3(1.0, 0.5, -0.2), 0.9)] {
        let d = center.as_dvec3().normalize();
        let half = (f64::from(radius) / f64::from(center.length())).asin();
        let (u, v) = d.any_orthonormal_pair();
        let (rings, steps) = (1500, 1500);
        let mut exact = 0.0;
        for i in 0..rings {
            let t = half * (f64::from(i) + 0.5) / f64::from(rings);
            for j in 0..steps {
                let p = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(steps);
                let w = d * t.cos() + (u * p.cos() + v * p.sin()) * t.sin();
                exact += w.z.max(0.0) * t.sin() * (half / f64::from(rings)) * (2.0 * PI / f64::from(steps));
            }
        }
        exact /= PI;
        let ours = f64::from(point_to_sphere(Vec3::ZERO, Vec3::Z, center, radius));
        assert!((ours - exact).abs() < 1e-4, "{center} {radius}: {ours} against {exact}");
    }
}

/// Random surfaces, the same ones in every run.
struct Surfaces(TestRunner);

impl Surfaces {
    fn new() -> Self {
        Self(TestRunner::deterministic())
    }

    fn draw<S: Strategy>(&mut self, strategy: &S) -> S::Value {
        strategy.new_tree(&mut self.0).expect("the filters let most values pass").current()
    }

    fn geometry(&mut self, wanted: impl Fn(&Geometry) -> bool) -> Geometry {
        loop {
            let geometry = geometry(&self.draw(&surface()));
            if wanted(&geometry) {
                return geometry;
            }
        }
    }

    fn polygon(&mut self) -> Geometry {
        self.geometry(Geometry::is_polygon)
    }
}

/// Oracle: the mean of Lambert's closed form over a receiver by adaptive cubature.
fn cubature(receiver: &Geometry, sender: &Geometry) -> f64 {
    mean_factor(
        Part::front(receiver),
        Accuracy { relative: 1e-6, absolute: 1e-12, most: 1 << 16 },
        f64::INFINITY,
        |x, n| point_factor(Part::front(sender), x, n, Accuracy::relative(FINE)),
    )
    .value
}

/// Relative error that is asked for, and what may come out: the integrand is exact, the cubature's estimate pessimistic.
const FINE: f64 = 1e-5;

#[test]
fn contour_integrals_agree_with_cubature() {
    let mut surfaces = Surfaces::new();
    let (mut worst, mut seen, mut evaluations) = (0.0_f64, 0, 0_u64);
    for i in 0..1000 {
        let pair = [surfaces.polygon(), surfaces.polygon()];
        // Where one cuts the other's plane cubature has a kink, or a jump, to find.
        let [a, b] = pair.each_ref().map(|geometry| outline(Part::front(geometry)));
        let clear = |a: &[DVec3], b: &[DVec3], normal: DVec3| a.iter().all(|p| (p - b[0]).dot(normal) > 0.0);
        if !clear(&a.0, &b.0, b.1) || !clear(&b.0, &a.0, a.1) {
            continue;
        }
        let exact = cubature(&pair[0], &pair[1]);
        let found = part_factor(Part::front(&pair[0]), Part::front(&pair[1]), Accuracy::relative(FINE));
        let off = (found.value / exact - 1.0).abs();
        assert!(off < FINE, "pair {i}: {found:?} for {exact}");
        evaluations += u64::from(found.evaluations);
        (seen, worst) = (seen + 1, worst.max(off));
    }
    eprintln!("{seen} pairs, worst relative error {worst:.1e}, {} evaluations each", evaluations / seen);
    assert!(seen > 50, "{seen} pairs face each other");
}

#[test]
fn polygons_that_share_an_edge_agree_with_cubature() {
    let mut surfaces = Surfaces::new();
    let mut worst = 0.0_f64;
    for i in 0..100 {
        // Two triangles on the edge from the origin along x, open by an angle.
        let u: [f64; _] = surfaces.draw(&[0.1..0.9, 0.05..0.9, 0.1..0.9, 0.05..0.9, 0.05..3.0]);
        let (sin, cos) = u[4].sin_cos();
        let first = [DVec3::ZERO, DVec3::X, DVec3::new(u[0], u[1], 0.0)];
        let second = [DVec3::X, DVec3::ZERO, DVec3::new(u[2], u[3] * cos, u[3] * sin)];
        let pair = [first, second].map(|points| geometry(&Surface::new(Shape::Triangle(points), 0)));
        let exact = cubature(&pair[0], &pair[1]);
        let found = part_factor(Part::front(&pair[0]), Part::front(&pair[1]), Accuracy::relative(FINE));
        let off = (found.value / exact - 1.0).abs();
        worst = worst.max(off);
        // Points nearer than 1e-6 to the sender's plane count for nothing in the cubature.
        assert!(off < 2.0 * FINE, "pair {i}, opened by {}: {found:?} for {exact}", u[4]);
    }
    eprintln!("worst relative error {worst:.1e}");
}

#[test]
fn factors_keep_their_invariants() {
    let mut surfaces = Surfaces::new();
    for i in 0..2000 {
        let pair = [surfaces.polygon(), surfaces.polygon()];
        let factor = |r: usize, s: usize| {
            part_factor(Part::front(&pair[r]), Part::front(&pair[s]), Accuracy::relative(FINE)).value
        };
        let factors = [factor(0, 1), factor(1, 0)];
        let areas = [0, 1].map(|k: usize| f64::from(pair[k].area(Domain::WHOLE)));
        let flux = [areas[0] * factors[0], areas[1] * factors[1]];
        for k in 0..2 {
            assert!((0.0..=1.0).contains(&factors[k]), "pair {i}: a factor of {}", factors[k]);
            assert!(flux[k] <= areas[0].min(areas[1]) * (1.0 + FINE), "pair {i}: more than the smaller one can take");
        }
        // Areas are rounded to f32; what cancels of areas of up to 1 are 1e-16 of it.
        let allowed = 2.0 * FINE * flux[0].max(flux[1]) + 1e-14;
        assert!((flux[0] - flux[1]).abs() < allowed, "pair {i}: {flux:?} are not reciprocal");
    }
}

/// The inside of a box of the given size in a corner of space.
fn room(size: DVec3) -> Vec<Geometry> {
    let mut walls = Vec::new();
    for axis in 0..3 {
        let (n, u, v) = (DVec3::AXES[axis], DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
        let (n, u, v) = (n * size, u * size, v * size);
        for corners in [[DVec3::ZERO, u, u + v, v], [n, n + v, n + u + v, n + u]] {
            walls.push(geometry(&Surface::new(Shape::Quad(corners), 0)));
        }
    }
    walls
}

#[test]
fn rows_of_an_enclosure_sum_to_one() {
    let mut surfaces = Surfaces::new();
    for _ in 0..500 {
        let u: [f64; _] = surfaces.draw(&[0.05..1.0, 0.05..1.0, 0.05..1.0, 0.0001..0.9999, 0.0001..0.9999, 0.0..1.0]);
        let walls = room(DVec3::new(u[0], u[1], u[2]));
        for (i, wall) in walls.iter().enumerate() {
            let (x, n, _) = wall.place(DVec2::new(u[3], u[4]));
            let others = || walls.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, wall)| Part::front(wall));
            let sum: f64 = others().map(|part| point_factor(part, x, n, Accuracy::relative(FINE))).sum();
            // Coordinates are rounded to 6e-8; the nearest edge is at a distance of 5e-6 or more.
            assert!((sum - 1.0).abs() < 1e-2 * FINE + 6e-8 / (1e-4 * 0.05), "from a point the row sums to {sum}");
        }
    }
    for size in [DVec3::ONE, DVec3::new(1.0, 0.3, 0.05), DVec3::new(0.1, 0.1, 1.0)] {
        let walls = room(size);
        for (i, wall) in walls.iter().enumerate() {
            let factor =
                |other: &Geometry| part_factor(Part::front(wall), Part::front(other), Accuracy::relative(FINE)).value;
            let sum: f64 = walls.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, other)| factor(other)).sum();
            assert!((sum - 1.0).abs() < FINE, "wall {i} of a room of {size}: the row sums to {sum}");
        }
    }
}

#[test]
fn disks_agree_with_polygons_of_many_corners() {
    let mut surfaces = Surfaces::new();
    for i in 0..300 {
        let disk = surfaces.geometry(|geometry| geometry.is_flat() && !geometry.is_polygon());
        let mut domain = Domain::WHOLE;
        for _ in 0..i % 3 {
            domain = disk.split(domain)[0];
        }
        let part = Part { geometry: &disk, domain, back: i % 2 == 0 };
        let u: [f64; _] = surfaces.draw(&[0.0..1.0, 0.0..1.0, 0.0..1.0, 0.0..TAU, -1.0..1.0]);
        let (x, sine) = (DVec3::new(u[0], u[1], u[2]), (1.0 - u[4] * u[4]).sqrt());
        let n = DVec3::new(sine * u[3].cos(), sine * u[3].sin(), u[4]);
        let (origin, size) = extent(domain);
        let steps = 40_000;
        let mut contour = Vec::new();
        for (v, reversed) in [(1.0, false), (0.0, true)] {
            for k in 0..=steps {
                let step = f64::from(k) / f64::from(steps);
                let s = if reversed { 1.0 - step } else { step };
                contour.push(part.place(origin + size * DVec2::new(s, v)).0 - x);
            }
        }
        let facing = part.place(disk.middle(domain).as_dvec2()).1;
        let area: DVec3 = contour.windows(2).map(|w| (w[0] - contour[0]).cross(w[1] - contour[0])).sum();
        if area.dot(facing) < 0.0 {
            contour.reverse();
        }
        let exact = lambert(n, contour.into_iter());
        let found = point_factor(part, x, n, Accuracy::relative(FINE));
        assert!((found - exact).abs() < 2e-6, "{i}: {found} for {exact}");
        let fast = f64::from(point_to_surface(&disk, &domain, part.back, x.as_vec3(), n.as_vec3()));
        assert!((fast - exact).abs() < 1e-4, "{i}: quickly {fast} for {exact}");
    }
}

#[test]
fn the_inside_of_a_sphere_sends_evenly() {
    // Every point of a sphere's inside sees all parts of it by their areas: F = A/4πR², wherever they are.
    let flip = Surface { flip: true, ..Surface::new(Shape::Sphere { center: DVec3::splat(0.5), radius: 0.5 }, 0) };
    let sphere = geometry(&flip);
    let parts: Vec<Domain> = sphere.split(Domain::WHOLE).iter().flat_map(|part| sphere.split(*part)).collect();
    for receiver in &parts {
        for sender in &parts {
            let [r, s] = [receiver, sender].map(|&domain| Part { geometry: &sphere, domain, back: false });
            let found = part_factor(r, s, Accuracy::relative(1e-4)).value;
            let exact = f64::from(sphere.area(*sender)) / PI;
            assert!((found / exact - 1.0).abs() < 1e-4, "{receiver:?}, {sender:?}: {found} for {exact}");
        }
    }
    // From whatever looks at it from inside it is all there is to see.
    for (x, n) in
        [(Vec3::splat(0.5), Vec3::X), (Vec3::new(0.9, 0.4, 0.6), Vec3::Z), (Vec3::new(0.2, 0.2, 0.3), -Vec3::Y)]
    {
        assert_eq!(point_to_surface(&sphere, &Domain::WHOLE, false, x, n), 1.0, "{x}");
    }
}

#[test]
fn pieces_of_a_sphere_add_up_to_it() {
    let mut surfaces = Surfaces::new();
    let sphere = geometry(&Surface::new(Shape::Sphere { center: DVec3::splat(0.5), radius: 0.3 }, 0));
    for _ in 0..30 {
        let u: [f64; _] = surfaces.draw(&[0.0..1.0, 0.0..1.0, 0.0..1.0]);
        let x = DVec3::from(u);
        let to = DVec3::splat(0.5) - x;
        if to.length() < 0.35 {
            continue;
        }
        let n = (to.normalize() + DVec3::X * 0.7).normalize();
        let exact = point_factor(Part::front(&sphere), x, n, Accuracy::relative(FINE));
        let piece = |&domain: &Domain| {
            point_factor(Part { geometry: &sphere, domain, back: false }, x, n, Accuracy::relative(1e-4))
        };
        let sum: f64 = sphere.split(Domain::WHOLE).iter().map(piece).sum();
        assert!((sum / exact - 1.0).abs() < 2e-4, "from {x}: {sum} for {exact}");
    }
}

#[test]
fn angles_are_those_of_the_arc_tangent() {
    for i in 0..=100_000 {
        let expected = f64::from(i) * PI / 1e5;
        for scale in [1e-150, 1e-6, 1.0, 1e150] {
            let found = angle(expected.sin().max(0.0) * scale, expected.cos() * scale);
            assert!((found - expected).abs() < 5e-13, "{found} for {expected}");
        }
    }
}

/// Polygons that are far, halfway and near, above the horizon and across it.
#[test]
fn polygons_are_quickly_known_to_a_percent() {
    let mut seed = 0;
    let mut next = || {
        seed += 1;
        f64::from(crate::sampling::unit(crate::sampling::hash(seed, 0xfa)))
    };
    let mut sum = [0.0; 2];
    for i in 0..20_000 {
        let (width, apex) = (0.4 + 0.6 * next(), next());
        let shape = if i % 2 == 0 {
            Shape::Quad([DVec3::ZERO, DVec3::X, DVec3::new(1.0, width, 0.0), DVec3::new(0.0, width, 0.0)])
        } else {
            Shape::Triangle([DVec3::ZERO, DVec3::X, DVec3::new(apex, width, 0.0)])
        };
        let polygon = geometry(&Surface::new(shape, 0));
        let mut direction = || DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5).normalize();
        let (mut to, n) = (direction(), direction());
        to.z = to.z.abs() + 0.05;
        let x = polygon.place(DVec2::splat(0.3)).0 + to * (0.5 + 40.0 * next().powi(3));
        let exact = point_factor(Part::front(&polygon), x, n, Accuracy::relative(1e-9));
        let quick = f64::from(point_to_surface(&polygon, &Domain::WHOLE, false, x.as_vec3(), n.as_vec3()));
        let off = (quick - exact).abs();
        assert!(off <= 0.01 * exact + 2e-5, "{i}: {quick} for {exact}");
        sum = [sum[0] + off, sum[1] + exact];
    }
    assert!(sum[0] < 1e-3 * sum[1], "on average {} of {}", sum[0], sum[1]);
}

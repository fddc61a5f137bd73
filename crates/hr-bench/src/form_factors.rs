//! The engine's form factors against closed forms and brute force.

use crate::BenchError;
use crate::run::{Out, say};
use glam::{DVec3, dvec3};
use glossy_ext::Place;
use hr_diffuse::form_factor::{Accuracy, Mean, Part, part_factor};
use hr_diffuse::{Domain, Geometry, GeometryError, Normalization, Shape, Surface};
use hr_view::path_tracer::{Sampler, cosine_hemisphere, power_heuristic};
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::PI;

/// Relative error that the engine is asked for.
const ACCURACY: f64 = 1e-5;

/// A configuration with a known form factor.
#[derive(Clone, Debug)]
pub struct Case {
    /// What and where.
    pub name: String,
    /// Its front sees the sender.
    pub receiver: Shape,
    /// Its front sees the receiver.
    pub sender: Shape,
    /// Form factor from receiver to sender.
    pub exact: f64,
}

/// Directly opposed rectangles a × b at the distance c (Howell, A Catalog of Radiation Heat Transfer Configuration
/// Factors, C-11).
#[must_use]
pub fn parallel_rectangles(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let (x1, y1) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let logarithm = (x1 * y1 / (1.0 + x * x + y * y).sqrt()).ln();
    2.0 / (PI * x * y) * (logarithm + x * y1 * (x / y1).atan() + y * x1 * (y / x1).atan() - x * x.atan() - y * y.atan())
}

/// From a rectangle l × w to a perpendicular one, l × h, that has the edge l in common (Howell, C-14).
#[must_use]
pub fn perpendicular_rectangles(l: f64, w: f64, h: f64) -> f64 {
    let (w, h) = (w / l, h / l);
    let (w2, h2) = (w * w, h * h);
    let (all, root) = (1.0 + w2 + h2, (w2 + h2).sqrt());
    let logarithm = ((1.0 + w2) * (1.0 + h2) / all).ln()
        + w2 * (w2 * all / ((1.0 + w2) * (w2 + h2))).ln()
        + h2 * (h2 * all / ((1.0 + h2) * (w2 + h2))).ln();
    (w * w.recip().atan() + h * h.recip().atan() - root * root.recip().atan() + 0.25 * logarithm) / (PI * w)
}

/// From a disk of radius `r1` to a parallel coaxial one of radius `r2` at the distance h (Howell, C-41).
#[must_use]
pub fn coaxial_disks(r1: f64, r2: f64, h: f64) -> f64 {
    let (x, y) = (r1 / h, r2 / h);
    let s = 1.0 + (1.0 + y * y) / (x * x);
    // The smaller root of F² − s F + (r2/r1)² = 0, without the difference of large numbers.
    2.0 * (y / x).powi(2) / (s + (s * s - 4.0 * (y / x).powi(2)).sqrt())
}

/// From a disk of radius r to a sphere of radius s whose centre is at the height h over the disk's: by reciprocity from
/// the share of the sphere's directions that the disk subtends.
#[must_use]
pub fn disk_to_sphere(r: f64, s: f64, h: f64) -> f64 {
    2.0 * (s / r).powi(2) * (1.0 - h / h.hypot(r))
}

/// The configurations that are looked at.
#[must_use]
pub fn cases() -> Vec<Case> {
    let rectangle = |origin: DVec3, a: DVec3, b: DVec3| Shape::Quad([origin, origin + a, origin + a + b, origin + b]);
    let disk =
        |height: f64, outer: f64, normal: DVec3| Shape::Ring { center: DVec3::Z * height, normal, inner: 0.0, outer };
    let mut cases = Vec::new();
    for (a, b, c) in [(1.0, 1.0, 1.0), (1.0, 0.3, 0.1), (1.0, 1.0, 10.0)] {
        cases.push(Case {
            name: format!("parallel rectangles {a} x {b}, distance {c}"),
            receiver: rectangle(DVec3::ZERO, DVec3::X * a, DVec3::Y * b),
            sender: rectangle(DVec3::Z * c, DVec3::Y * b, DVec3::X * a),
            exact: parallel_rectangles(a, b, c),
        });
    }
    for (l, w, h) in [(1.0, 1.0, 1.0), (1.0, 0.2, 2.0)] {
        cases.push(Case {
            name: format!("perpendicular rectangles {l} x {w} and {l} x {h}"),
            receiver: rectangle(DVec3::ZERO, DVec3::X * l, DVec3::Y * w),
            sender: rectangle(DVec3::ZERO, DVec3::Z * h, DVec3::X * l),
            exact: perpendicular_rectangles(l, w, h),
        });
    }
    for (r1, r2, h) in [(1.0, 1.0, 1.0), (1.0, 0.5, 0.3), (0.5, 1.0, 5.0)] {
        cases.push(Case {
            name: format!("coaxial disks of radius {r1} and {r2}, distance {h}"),
            receiver: disk(0.0, r1, DVec3::Z),
            sender: disk(h, r2, -DVec3::Z),
            exact: coaxial_disks(r1, r2, h),
        });
    }
    for (r, s, h) in [(1.0, 0.5, 1.0), (2.0, 0.5, 0.6), (1.0, 0.1, 3.0)] {
        cases.push(Case {
            name: format!("disk of radius {r} to sphere of radius {s}, distance {h}"),
            receiver: disk(0.0, r, DVec3::Z),
            sender: Shape::Sphere { center: dvec3(0.0, 0.0, h), radius: s },
            exact: disk_to_sphere(r, s, h),
        });
    }
    cases
}

impl Case {
    fn geometries(&self) -> Result<[Geometry; 2], BenchError> {
        let surfaces = [&self.receiver, &self.sender].map(|shape| Surface::new(shape.clone(), 0));
        let normalization = Normalization::new(&surfaces);
        let make = |surface: usize| -> Result<Geometry, GeometryError> {
            Geometry::from_surface(&surfaces[surface], &normalization)
        };
        let wrong = |surface| move |source| BenchError::Surface { surface, source };
        Ok([make(0).map_err(wrong(0))?, make(1).map_err(wrong(1))?])
    }

    /// The engine's form factor.
    ///
    /// # Errors
    /// [`BenchError::Surface`] where a shape makes no sense.
    pub fn engine(&self) -> Result<Mean, BenchError> {
        let [receiver, sender] = self.geometries()?;
        Ok(part_factor(Part::front(&receiver), Part::front(&sender), Accuracy::relative(ACCURACY)))
    }

    /// Monte Carlo integration with `samples` points of the receiver: of each a point of the sender and a ray are drawn.
    /// The first alone has infinite variance where surfaces touch, the second is poor for small senders; the power
    /// heuristic takes the better one of both. Returns the form factor and its standard error.
    ///
    /// # Errors
    /// [`BenchError::Surface`] where a shape makes no sense.
    pub fn brute_force(&self, samples: u32) -> Result<(f64, f64), BenchError> {
        let [receiver, sender] = self.geometries()?;
        let area = sender.area(Domain::WHOLE);
        let total = receiver.area(Domain::WHOLE);
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..samples {
            let sampler = Sampler::new(1, i);
            let (u, v) = (sampler.pair(0), sampler.pair(1));
            let (x, n, weight) = receiver.sample_area(Domain::WHOLE, u.x, u.y);
            let mut found = 0.0;
            let (y, m, per_area) = sender.sample_area(Domain::WHOLE, v.x, v.y);
            let (to, d2) = (y - x, y.distance_squared(x));
            let (cos_x, cos_y) = (to.dot(n) / d2.sqrt(), -to.dot(m) / d2.sqrt());
            if cos_x > 0.0 && cos_y > 0.0 {
                let share = power_heuristic(d2 / (area * cos_y), cos_x * FRAC_1_PI);
                found += cos_x * cos_y * FRAC_1_PI / d2 * per_area * share;
            }
            let local = cosine_hemisphere(sampler.pair(2));
            let direction = Place::new(x, n).frame * local;
            if let Some((t, uv)) = sender.intersect(x, direction, 0.0, f32::MAX) {
                let cos_y = -sender.normal(uv).dot(direction);
                if cos_y > 0.0 {
                    found += power_heuristic(local.z * FRAC_1_PI, t * t / (area * cos_y));
                }
            }
            let found = f64::from(weight / total * found);
            sum += found;
            squares += found * found;
        }
        let mean = sum / f64::from(samples);
        let variance = (squares / f64::from(samples) - mean * mean).max(0.0);
        Ok((mean, (variance / f64::from(samples)).sqrt()))
    }
}

/// Prints the errors of all [`cases`].
///
/// # Errors
/// [`BenchError::Output`] where nothing can be printed.
pub fn report(samples: u32, out: Out<'_>) -> Result<(), BenchError> {
    say(out, "| configuration | closed form | engine | relative error | evaluations | brute force | error |")?;
    say(out, "| --- | ---: | ---: | ---: | ---: | ---: | ---: |")?;
    for case in cases() {
        let (Mean { value: ours, evaluations, .. }, (brute, sigma)) = (case.engine()?, case.brute_force(samples)?);
        let error = |v: f64| 100.0 * (v / case.exact - 1.0);
        let (name, exact) = (&case.name, case.exact);
        let line = format!(
            "| {name} | {exact:.6} | {ours:.6} | {:+.1e} | {evaluations} | {brute:.6} | {:+.3} ± {:.3} % |",
            ours / exact - 1.0,
            error(brute),
            100.0 * sigma / exact
        );
        say(out, &line)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_forms_are_the_published_values() {
        // Unit cube: 0.19982 and 0.20004 (Howell's tables); the four sides and the lid of a cube add up to 1.
        let (lid, side) = (parallel_rectangles(1.0, 1.0, 1.0), perpendicular_rectangles(1.0, 1.0, 1.0));
        assert!((lid - 0.19982).abs() < 1e-5, "lid {lid}");
        assert!((lid + 4.0 * side - 1.0).abs() < 1e-12, "cube: {lid} + 4 · {side}");
        let (a, b, c) = (0.7, 2.0, 1.3);
        let sides = 2.0 * perpendicular_rectangles(a, b, c) + 2.0 * perpendicular_rectangles(b, a, c);
        let box_sum = parallel_rectangles(a, b, c) + sides;
        assert!((box_sum - 1.0).abs() < 1e-12, "any box adds up: {box_sum}");
        // Equal disks at the distance of their radius: (3 − √5)/2.
        let disks = coaxial_disks(1.0, 1.0, 1.0);
        assert!((disks - 0.5 * (3.0 - 5f64.sqrt())).abs() < 1e-12, "disks {disks}");
        let back = coaxial_disks(0.5, 1.0, 2.0) * 0.25 - coaxial_disks(1.0, 0.5, 2.0);
        assert!(back.abs() < 1e-12, "reciprocity of disks");
        // A small sphere far away over a small disk: (s/h)².
        let far = disk_to_sphere(1e-3, 1e-2, 1.0);
        assert!((far / 1e-4 - 1.0).abs() < 1e-5, "far sphere {far}");
    }

    #[test]
    fn the_engine_agrees_with_closed_forms() {
        for case in cases() {
            let ours = case.engine().expect("sound shapes").value;
            assert!((ours / case.exact - 1.0).abs() < ACCURACY, "{}: {ours}, exactly {}", case.name, case.exact);
        }
    }

    #[test]
    fn brute_force_agrees_with_closed_forms() {
        for case in cases() {
            let (brute, sigma) = case.brute_force(1 << 16).expect("sound shapes");
            let (name, exact) = (&case.name, case.exact);
            assert!(sigma < 0.01 * exact, "{name}: noise {sigma} of {exact}");
            assert!((brute - exact).abs() < 4.0 * sigma, "{name}: {brute} ± {sigma}, exactly {exact}");
        }
    }
}

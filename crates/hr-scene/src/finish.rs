//! The last step of loading: what no solver could use is taken out, loudly.

use crate::camera::unit;
use crate::{Scene, SceneError, Warning};
use glam::DVec3;
use glossy_ext::Rgb;
use hr_diffuse::{Geometry, GeometryError, LightKind, Normalization, Shape, Surface};
use std::collections::HashSet;

/// A polygon or mantle thinner than this share of its length has no area: its normal would be noise.
const THINNEST: f64 = 1e-10;

impl Scene {
    /// Makes a scene fit for the solver. Leaves out, with a counted [`Warning`] each: surfaces with coordinates that are
    /// not finite, surfaces without area or next to none, exact duplicates (the same geometry on the same side with the same material,
    /// at whichever corner it starts; of several texture coordinates the first ones stay), lights and cameras that are
    /// not finite. Exitance that is negative or not finite becomes 0. Normals and axes are made unit length;
    /// `attributes` are sorted and follow their surfaces.
    ///
    /// [`Scene::load`] has done this already; call it on scenes that you put together yourself.
    ///
    /// # Errors
    /// [`SceneError::Syntax`] where a surface refers to a material, or attributes to a surface, that does not exist;
    /// [`SceneError::Empty`] where no surface is left.
    pub fn finish(mut self) -> Result<Self, SceneError> {
        self.check_indices()?;
        let mut counts = Counts::default();
        let mut seen = HashSet::new();
        // Where each surface went; `None` where it was left out.
        let mut moved = Vec::with_capacity(self.surfaces.len());
        let mut kept = 0_u32;
        let mut surfaces = std::mem::take(&mut self.surfaces);
        let mut index = 0;
        surfaces.retain_mut(|surface| {
            let place = || format!("{}: surface {index}", self.name);
            let material = &self.materials[surface.material as usize];
            // Both sides of a face that looks alike from both are one face.
            let sides_differ = !material.two_sided || material.exitance != Rgb::ZERO;
            let keep = match defect(&surface.shape) {
                Some(text) => {
                    counts.add(text, place);
                    false
                }
                None => {
                    normalise(surface);
                    let new = seen.insert(Key::of(surface, sides_differ));
                    if !new {
                        counts.add(DUPLICATE, place);
                    }
                    new
                }
            };
            moved.push(keep.then_some(kept));
            kept += u32::from(keep);
            index += 1;
            keep
        });
        self.surfaces = surfaces;
        self.attributes.retain_mut(|a| match moved[a.surface as usize] {
            Some(new) => {
                a.surface = new;
                true
            }
            None => false,
        });
        self.attributes.sort_by_key(|a| a.surface);
        self.attributes.dedup_by_key(|a| a.surface);
        self.drop_unusable_lights_and_cameras(&mut counts);
        self.warnings.extend(counts.0);
        let given: Vec<usize> = (0..moved.len()).filter(|&given| moved[given].is_some()).collect();
        self.leave_out_vanishing(|surface| given[surface]);
        if self.surfaces.is_empty() {
            return Err(SceneError::empty(self.name, &self.warnings));
        }
        Ok(self)
    }

    /// Leaves out, with a counted [`Warning`], surfaces so small that nothing is left of them where the scene's extent is 1, in single
    /// precision, as solvers have it. `given` tells which surface of what was given each one is.
    pub(crate) fn leave_out_vanishing(&mut self, given: impl Fn(usize) -> usize) {
        let normalization = Normalization::new(&self.surfaces);
        let vanishes = |surface: &Surface| {
            matches!(Geometry::from_surface(surface, &normalization), Err(GeometryError::Vanishing))
        };
        let stays: Vec<bool> = self.surfaces.iter().map(|surface| !vanishes(surface)).collect();
        let Some(first) = stays.iter().position(|stays| !stays) else { return };
        let mut counts = Counts::default();
        for _ in stays.iter().filter(|stays| !**stays) {
            counts.add(VANISHING, || format!("{}: surface {}", self.name, given(first)));
        }
        self.warnings.extend(counts.0);
        self.keep_surfaces(&stays);
    }

    fn check_indices(&self) -> Result<(), SceneError> {
        let wrong = |place: String, what: String, mend: &str| {
            Err(SceneError::Syntax { place: format!("{}: {place}", self.name), what, mend: mend.to_owned() })
        };
        let count = |n: usize, noun: &str| {
            if n == 1 { format!("1 {noun}") } else { format!("{n} {noun}s") }
        };
        for (k, surface) in self.surfaces.iter().enumerate() {
            if surface.material as usize >= self.materials.len() {
                return wrong(
                    format!("surface {k}"),
                    format!("material {} of {}", surface.material, count(self.materials.len(), "material")),
                    "refer to a material that exists, counted from 0",
                );
            }
        }
        for (k, attributes) in self.attributes.iter().enumerate() {
            if attributes.surface as usize >= self.surfaces.len() {
                return wrong(
                    format!("attributes {k}"),
                    format!("surface {} of {}", attributes.surface, count(self.surfaces.len(), "surface")),
                    "refer to a surface that exists, counted from 0",
                );
            }
        }
        Ok(())
    }

    fn drop_unusable_lights_and_cameras(&mut self, counts: &mut Counts) {
        let name = self.name.clone();
        for material in &mut self.materials {
            if !material.exitance.is_finite() || material.exitance.min_element() < 0.0 {
                counts.add("exitance that is negative or not finite: set to 0", || {
                    format!("{name}: material '{}'", material.name)
                });
                material.exitance = Rgb::ZERO;
            }
        }
        let mut index = 0;
        self.lights.retain(|light| {
            let direction = match light.kind {
                LightKind::Point => glam::Vec3::ZERO,
                LightKind::Spot { direction, .. } | LightKind::Directional { direction } => direction,
            };
            let keep = light.position.is_finite()
                && light.intensity.is_finite()
                && light.intensity.min_element() >= 0.0
                && direction.is_finite();
            if !keep {
                counts.add("light that is negative or not finite: left out", || format!("{name}: light {index}"));
            }
            index += 1;
            keep
        });
        self.cameras.retain(|(camera_name, camera)| match camera.check(&format!("{name}: camera '{camera_name}'")) {
            Ok(()) => true,
            Err(error) => {
                counts.add("camera that cannot take a picture: left out", || error.to_string());
                false
            }
        });
    }
}

const VANISHING: &str = "surface that vanishes against the extent of the scene: left out";
const DUPLICATE: &str = "duplicate of another surface: left out";

/// Warnings by text, in the order in which they came first.
#[derive(Default)]
struct Counts(Vec<Warning>);

impl Counts {
    fn add(&mut self, text: &str, place: impl FnOnce() -> String) {
        match self.0.iter_mut().find(|w| w.text == text) {
            Some(warning) => warning.count = warning.count.saturating_add(1),
            None => self.0.push(Warning { text: text.to_owned(), first: place(), count: 1 }),
        }
    }
}

/// Why a shape cannot be lit, if it cannot.
fn defect(shape: &Shape) -> Option<&'static str> {
    let (finite, has_area) = match *shape {
        Shape::Triangle(p) => (finite(&p), polygon_has_area(&p)),
        Shape::Quad(p) => (finite(&p), polygon_has_area(&p)),
        Shape::Sphere { center, radius } => (center.is_finite() && radius.is_finite(), radius > 0.0),
        Shape::Cone { ends: [a, b], radii: [r, s] } => {
            let axis = (b - a).length();
            let widest = r.max(s);
            // Without a length there is no axis, without a radius no mantle.
            let thick = axis > THINNEST * widest && widest > THINNEST * axis;
            (finite(&[a, b]) && r.is_finite() && s.is_finite(), r >= 0.0 && s >= 0.0 && widest > 0.0 && thick)
        }
        Shape::Ring { center, normal, inner, outer } => (
            finite(&[center, normal]) && inner.is_finite() && outer.is_finite(),
            unit(normal) != DVec3::ZERO && inner >= 0.0 && outer - inner > THINNEST * outer,
        ),
        Shape::Torus { center, axis, major, minor } => (
            finite(&[center, axis]) && major.is_finite() && minor.is_finite(),
            unit(axis) != DVec3::ZERO && minor > THINNEST * major && minor < major,
        ),
    };
    match (finite, has_area) {
        (false, _) => Some("surface with coordinates that are not finite: left out"),
        (true, false) => Some("surface without area: left out"),
        (true, true) => None,
    }
}

fn finite(points: &[DVec3]) -> bool {
    points.iter().all(|p| p.is_finite())
}

/// Whether a polygon is wider than [`THINNEST`] times its length.
fn polygon_has_area(corners: &[DVec3]) -> bool {
    // Relative to the largest coordinate difference, so that squares neither overflow nor vanish.
    let size = corners.iter().map(|p| (*p - corners[0]).abs().max_element()).fold(0.0, f64::max);
    if !(size > 0.0 && size.is_finite()) {
        return false;
    }
    let edge = |k: usize| (corners[k] - corners[0]) / size;
    let area: DVec3 = (2..corners.len()).map(|k| edge(k - 1).cross(edge(k))).sum();
    area.length() > THINNEST
}

/// Makes normals and axes unit length.
fn normalise(surface: &mut Surface) {
    match &mut surface.shape {
        Shape::Ring { normal: direction, .. } | Shape::Torus { axis: direction, .. } => {
            if (direction.length_squared() - 1.0).abs() > 1e-12 {
                *direction = unit(*direction);
            }
        }
        Shape::Triangle(_) | Shape::Quad(_) | Shape::Sphere { .. } | Shape::Cone { .. } => {}
    }
}

/// What two surfaces have in common if and only if they are duplicates.
#[derive(PartialEq, Eq, Hash)]
struct Key {
    kind: u8,
    flip: bool,
    material: u32,
    /// The shape's numbers in an order that does not depend on how it was written down.
    numbers: [u64; 12],
}

impl Key {
    fn of(surface: &Surface, sides_differ: bool) -> Self {
        let mut flip = surface.flip;
        let mut numbers = [0; 12];
        let kind = match surface.shape {
            Shape::Triangle(p) => {
                polygon_numbers(p, &mut flip, &mut numbers);
                0
            }
            Shape::Quad(p) => {
                polygon_numbers(p, &mut flip, &mut numbers);
                1
            }
            Shape::Sphere { center, radius } => {
                fill(&mut numbers, [center.to_array().as_slice(), &[radius]]);
                2
            }
            Shape::Cone { ends, radii } => {
                let end = |k: usize| [bits3(ends[k]).as_slice(), &[bits(radii[k])]].concat();
                let (mut a, mut b) = (end(0), end(1));
                if b < a {
                    std::mem::swap(&mut a, &mut b);
                }
                numbers[..4].copy_from_slice(&a);
                numbers[4..8].copy_from_slice(&b);
                3
            }
            Shape::Ring { center, normal, inner, outer } => {
                let (direction, turned) = upward(normal);
                flip ^= turned;
                fill(&mut numbers, [center.to_array().as_slice(), &direction.to_array(), &[inner, outer]]);
                4
            }
            Shape::Torus { center, axis, major, minor } => {
                let (direction, _) = upward(axis);
                fill(&mut numbers, [center.to_array().as_slice(), &direction.to_array(), &[major, minor]]);
                5
            }
        };
        Self { kind, flip: flip && sides_differ, material: surface.material, numbers }
    }
}

/// The corners from the smallest one on, in the direction that puts the smaller neighbour second; `flip` is turned over
/// where that goes against the polygon's own direction.
fn polygon_numbers<const N: usize>(corners: [DVec3; N], flip: &mut bool, numbers: &mut [u64; 12]) {
    let p = corners.map(bits3);
    let first = (0..N).min_by_key(|&k| p[k]).unwrap_or(0);
    let forward = p[(first + 1) % N] <= p[(first + N - 1) % N];
    *flip ^= !forward;
    for (k, out) in numbers.chunks_exact_mut(3).take(N).enumerate() {
        let at = if forward { first + k } else { first + N - k };
        out.copy_from_slice(&p[at % N]);
    }
}

/// A direction or its opposite, whichever has a positive last non-zero coordinate, and whether it was turned.
fn upward(v: DVec3) -> (DVec3, bool) {
    let sign = [v.z, v.y, v.x].into_iter().find(|c| *c != 0.0).unwrap_or(1.0);
    if sign < 0.0 { (-v, true) } else { (v, false) }
}

fn fill<const N: usize>(numbers: &mut [u64; 12], parts: [&[f64]; N]) {
    for (out, v) in numbers.iter_mut().zip(parts.into_iter().flatten()) {
        *out = bits(*v);
    }
}

/// Bits that are equal where the numbers are: −0 is 0.
fn bits(v: f64) -> u64 {
    (v + 0.0).to_bits()
}

fn bits3(v: DVec3) -> [u64; 3] {
    v.to_array().map(bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::tests::grey;
    use crate::{Camera, SurfaceAttributes};
    use glam::{Vec2, Vec3};
    use hr_diffuse::Light;

    const A: DVec3 = DVec3::ZERO;
    const B: DVec3 = DVec3::X;
    const C: DVec3 = DVec3::new(1.0, 1.0, 0.0);
    const D: DVec3 = DVec3::Y;

    fn scene(shapes: &[Shape]) -> Scene {
        Scene {
            name: "test".into(),
            surfaces: shapes.iter().map(|s| Surface::new(s.clone(), 0)).collect(),
            materials: vec![grey("one-sided", false, 0.0)],
            ..Scene::default()
        }
    }

    fn marked(surface: u32, mark: f32) -> SurfaceAttributes {
        SurfaceAttributes { surface, uv: [Vec2::splat(mark); 4], color: [Rgb::ONE; 4] }
    }

    #[test]
    fn hopeless_surfaces_are_left_out_and_counted() {
        let good = Shape::Triangle([A, B, C]);
        let nan = DVec3::new(0.0, f64::NAN, 0.0);
        let no_area = [
            Shape::Triangle([A, B, B]),
            Shape::Triangle([A, C * 0.5, C]),
            Shape::Quad([A, B, B, A]),
            Shape::Quad([A; 4]),
            Shape::Sphere { center: A, radius: 0.0 },
            Shape::Sphere { center: A, radius: -1.0 },
            Shape::Cone { ends: [A, A], radii: [1.0, 0.5] },
            Shape::Cone { ends: [A, B], radii: [0.0, 0.0] },
            Shape::Cone { ends: [A, B], radii: [1.0, -0.5] },
            Shape::Ring { center: A, normal: D, inner: 1.0, outer: 1.0 },
            Shape::Ring { center: A, normal: A, inner: 0.0, outer: 1.0 },
            Shape::Torus { center: A, axis: D, major: 1.0, minor: 0.0 },
            Shape::Torus { center: A, axis: D, major: 1.0, minor: 1.5 },
        ];
        let not_finite = [
            Shape::Triangle([A, nan, C]),
            Shape::Quad([A, B, C, DVec3::new(0.0, f64::INFINITY, 0.0)]),
            Shape::Sphere { center: A, radius: f64::NAN },
            Shape::Cone { ends: [A, B], radii: [1.0, f64::INFINITY] },
            Shape::Ring { center: nan, normal: D, inner: 0.0, outer: 1.0 },
            Shape::Torus { center: A, axis: nan, major: 1.0, minor: 0.1 },
        ];
        let all: Vec<_> = [good.clone()].iter().chain(&no_area).chain(&not_finite).cloned().collect();
        let done = scene(&all).finish().expect("one surface is good");
        assert_eq!(done.surfaces, [Surface::new(good, 0)], "the good one stays");
        let counted: Vec<_> = done.warnings.iter().map(|w| (w.count as usize, w.first.as_str())).collect();
        assert_eq!(
            counted,
            [(no_area.len(), "test: surface 1"), (not_finite.len(), "test: surface 14")],
            "each kind is counted, with its first place: {:?}",
            done.warnings
        );
    }

    #[test]
    fn tiny_huge_and_far_surfaces_stay() {
        for (scale, offset) in [(1e-9, 0.0), (1e9, 0.0), (1e-150, 0.0), (1e150, 0.0), (1e-3, 1e6)] {
            let move_to = |p: DVec3| p * scale + DVec3::splat(offset);
            let shapes = [Shape::Triangle([A, B, C].map(move_to)), Shape::Sphere { center: move_to(A), radius: scale }];
            let done = scene(&shapes).finish().expect("good surfaces");
            assert_eq!(done.surfaces.len(), 2, "scale {scale:e}, offset {offset:e}");
        }
    }

    #[test]
    fn duplicates_are_merged_from_any_corner_and_direction() {
        let cone = |a, b, r, s| Shape::Cone { ends: [a, b], radii: [r, s] };
        let ring = |n| Shape::Ring { center: A, normal: n, inner: 0.0, outer: 1.0 };
        let torus = |axis| Shape::Torus { center: A, axis, major: 1.0, minor: 0.1 };
        let minus = DVec3::new(-0.0, -0.0, 0.0);
        for (one, other, flip) in [
            (Shape::Triangle([A, B, C]), Shape::Triangle([C, minus, B]), false),
            (Shape::Triangle([A, B, C]), Shape::Triangle([C, B, A]), true),
            (Shape::Quad([A, B, C, D]), Shape::Quad([C, D, A, B]), false),
            (Shape::Quad([A, B, C, D]), Shape::Quad([B, A, D, C]), true),
            (cone(A, B, 1.0, 0.5), cone(B, A, 0.5, 1.0), false),
            (ring(D), ring(-D), true),
            (torus(D), torus(-D), false),
            (torus(D), torus(D * 2.0), false),
        ] {
            let mut same = scene(&[one.clone(), other.clone()]);
            same.surfaces[1].flip = flip;
            let done = same.clone().finish().expect("surfaces");
            assert_eq!(done.surfaces.len(), 1, "{one:?} is {other:?}");
            assert_eq!(done.warnings[0].count, 1, "and that is said");
            // Turned over it is another surface, unless both sides look alike.
            let mut turned = same.clone();
            turned.surfaces[1].flip = !flip;
            assert_eq!(turned.clone().finish().expect("surfaces").surfaces.len(), 2, "{one:?} is not turned {other:?}");
            turned.materials[0].two_sided = true;
            assert_eq!(turned.clone().finish().expect("surfaces").surfaces.len(), 1, "two-sided {one:?}");
            turned.materials[0].exitance = Rgb::ONE;
            assert_eq!(turned.finish().expect("surfaces").surfaces.len(), 2, "emitting to both sides: {one:?}");
            // With another material too.
            same.materials.push(grey("another", false, 0.0));
            same.surfaces[1].material = 1;
            assert_eq!(same.finish().expect("surfaces").surfaces.len(), 2, "two materials: {one:?}");
        }
        let far = C * 2.0;
        let bow = scene(&[Shape::Quad([A, B, far, D]), Shape::Quad([A, far, B, D])]);
        assert_eq!(bow.finish().expect("surfaces").surfaces.len(), 2, "the same corners in another order differ");
    }

    #[test]
    fn attributes_follow_their_surfaces() {
        let mut s = scene(&[
            Shape::Triangle([A, B, B]),
            Shape::Triangle([A, B, C]),
            Shape::Triangle([B, C, A]),
            Shape::Triangle([A, C, D]),
        ]);
        s.attributes = vec![marked(3, 3.0), marked(0, 0.0), marked(1, 1.0), marked(2, 2.0)];
        let done = s.finish().expect("surfaces");
        assert_eq!(done.surfaces.len(), 2, "one without area, one duplicate");
        assert_eq!(done.attributes, [marked(0, 1.0), marked(1, 3.0)], "sorted, with the new indices");
    }

    #[test]
    fn nothing_and_nonsense_are_errors() {
        let error = scene(&[]).finish().expect_err("empty");
        assert!(matches!(&error, SceneError::Empty { name, .. } if name == "test"), "{error}");
        let error = scene(&[Shape::Triangle([A, A, A])]).finish().expect_err("nothing is left");
        assert!(matches!(error, SceneError::Empty { .. }), "{error}");
        assert!(error.to_string().contains("area"), "says what was left out: {error}");
        let mut s = scene(&[Shape::Triangle([A, B, C])]);
        s.surfaces[0].material = 1;
        let error = s.finish().expect_err("no such material").to_string();
        assert!(error.contains("surface 0: material 1 of 1 material;"), "{error}");
        let mut s = scene(&[Shape::Triangle([A, B, C])]);
        s.attributes.push(marked(7, 0.0));
        let error = s.finish().expect_err("no such surface").to_string();
        assert!(error.contains("attributes 0: surface 7 of 1 surface;"), "{error}");
    }

    #[test]
    fn unusable_lights_cameras_and_exitances_go() {
        let mut s = scene(&[Shape::Triangle([A, B, C])]);
        let light = Light { position: A, intensity: Rgb::ONE, kind: LightKind::Point };
        s.lights = vec![
            Light { intensity: Rgb::splat(f32::NAN), ..light },
            light,
            Light { position: DVec3::splat(f64::INFINITY), ..light },
            Light { kind: LightKind::Directional { direction: Vec3::NAN }, ..light },
        ];
        let camera =
            Camera { eye: [0.0; 3], target: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0], fov_x: 60.0, width: 64, height: 40 };
        s.cameras = vec![("bad".into(), Camera { fov_x: -1.0, ..camera }), ("good".into(), camera)];
        s.materials[0].exitance = Rgb::splat(-1.0);
        let done = s.finish().expect("a surface is there");
        assert_eq!(done.lights, [light], "the good light stays");
        assert_eq!(done.cameras, [("good".to_owned(), camera)], "the good camera stays");
        assert_eq!(done.materials[0].exitance, Rgb::ZERO, "no negative light");
        assert_eq!(done.warnings.iter().map(|w| w.count).collect::<Vec<_>>(), [1, 3, 1], "{:?}", done.warnings);
        assert!(done.warnings[2].first.contains("camera 'bad': fov_x"), "{:?}", done.warnings[2]);
    }

    #[test]
    fn what_vanishes_against_the_rest_is_left_out() {
        let mut scene = Scene::load("cornell").expect("built in");
        let before = scene.surfaces.clone();
        let speck = [DVec3::ZERO, DVec3::X * 1e-12, DVec3::Y * 1e-12].map(|corner| corner + DVec3::splat(0.3));
        scene.surfaces.insert(1, Surface::new(Shape::Triangle(speck), 0));
        // What is left out before it does not change which one it is.
        scene.surfaces.insert(0, before[0].clone());
        scene.surfaces.insert(0, Surface::new(Shape::Triangle([DVec3::NAN; 3]), 0));
        let scene = scene.finish().expect("the rest is there");
        assert_eq!(scene.surfaces, before, "all but the speck");
        let told = scene.warnings.iter().filter(|warning| warning.text == VANISHING).collect::<Vec<_>>();
        assert_eq!(told.len(), 1, "{:?}", scene.warnings);
        assert_eq!((told[0].count, told[0].first.as_str()), (1, "cornell: surface 3"), "{told:?}");
    }
}

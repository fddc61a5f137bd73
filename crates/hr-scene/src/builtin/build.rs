//! Putting a scene together.

use crate::camera::unit;
use crate::reflectors::ward;
use crate::{Camera, Material, Rgb, Scene};
use glam::{DAffine3, DVec2, DVec3};
use hr_diffuse::{Shape, Surface};

/// What a material is made of.
#[derive(Clone, Copy)]
pub(super) struct Paint {
    /// Lambertian reflectance.
    pub(super) rd: Rgb,
    /// Reflectance of the Ward lobe.
    pub(super) rs: Rgb,
    /// Its root mean square slope.
    pub(super) alpha: f32,
    /// Exitance of the front in W/m².
    pub(super) exitance: Rgb,
    /// Whether the back reflects like the front.
    pub(super) two_sided: bool,
}

impl Paint {
    /// Diffuse, two-sided.
    pub(super) fn diffuse(rd: Rgb) -> Self {
        Self { rd, rs: Rgb::ZERO, alpha: 0.0, exitance: Rgb::ZERO, two_sided: true }
    }

    /// Diffuse with a glossy lobe, two-sided.
    pub(super) fn glossy(rd: Rgb, rs: Rgb, alpha: f32) -> Self {
        Self { rs, alpha, ..Self::diffuse(rd) }
    }

    /// A light that reflects nothing, two-sided as far as that can be told.
    pub(super) fn light(exitance: Rgb) -> Self {
        Self { exitance, ..Self::diffuse(Rgb::ZERO) }
    }

    /// The front of a closed solid: its inside is nowhere to be seen.
    pub(super) fn solid(self) -> Self {
        Self { two_sided: false, ..self }
    }
}

/// A material of a paint.
pub(super) fn material(name: &str, paint: Paint) -> Material {
    Material {
        name: name.to_owned(),
        reflector: ward(paint.rd, paint.rs, paint.alpha),
        exitance: paint.exitance,
        two_sided: paint.two_sided,
        texture: None,
        base_color: Rgb::ONE,
    }
}

/// Faces of a [block](Builder::block) that are left out, because something else covers them.
pub(super) mod skip {
    pub(in crate::builtin) const NONE: u8 = 0;
    pub(in crate::builtin) const X0: u8 = 1;
    pub(in crate::builtin) const X1: u8 = 2;
    pub(in crate::builtin) const Y0: u8 = 4;
    pub(in crate::builtin) const Y1: u8 = 8;
    pub(in crate::builtin) const Z0: u8 = 16;
    pub(in crate::builtin) const Z1: u8 = 32;
}

/// Collects materials, surfaces and cameras. Coordinates go through `frame` on their way into the scene.
pub(super) struct Builder {
    scene: Scene,
    /// Where things are put: a rotation and a shift, nothing else.
    pub(super) frame: DAffine3,
}

impl Builder {
    pub(super) fn new(name: &str) -> Self {
        Self { scene: Scene { name: name.to_owned(), ..Scene::default() }, frame: DAffine3::IDENTITY }
    }

    pub(super) fn done(self) -> Scene {
        self.scene
    }

    /// Adds a material; its index.
    pub(super) fn material(&mut self, name: &str, paint: Paint) -> u32 {
        self.scene.materials.push(material(name, paint));
        self.scene.materials.len() as u32 - 1
    }

    fn surface(&mut self, material: u32, shape: Shape, flip: bool) {
        self.scene.surfaces.push(Surface { flip, ..Surface::new(shape, material) });
    }

    fn point(&self, p: DVec3) -> DVec3 {
        self.frame.transform_point3(p)
    }

    fn vector(&self, v: DVec3) -> DVec3 {
        self.frame.transform_vector3(v)
    }

    /// Adds a quadrilateral, counter-clockwise seen from the front.
    pub(super) fn quad(&mut self, material: u32, corners: [DVec3; 4]) {
        let shape = Shape::Quad(corners.map(|p| self.point(p)));
        self.surface(material, shape, false);
    }

    /// Adds a triangle, counter-clockwise seen from the front.
    pub(super) fn triangle(&mut self, material: u32, corners: [DVec3; 3]) {
        let shape = Shape::Triangle(corners.map(|p| self.point(p)));
        self.surface(material, shape, false);
    }

    /// Adds a rectangle about `center` that faces `normal`; its height runs along `up`.
    pub(super) fn patch(&mut self, material: u32, center: DVec3, normal: DVec3, up: DVec3, size: DVec2) {
        let normal = unit(normal);
        let across = unit(up.cross(normal));
        let (a, b) = (across * size.x / 2.0, normal.cross(across) * size.y / 2.0);
        self.quad(material, [center - a - b, center + a - b, center + a + b, center - a + b]);
    }

    /// Adds a sphere.
    pub(super) fn sphere(&mut self, material: u32, center: DVec3, radius: f64) {
        let center = self.point(center);
        self.surface(material, Shape::Sphere { center, radius }, false);
    }

    /// Adds the mantle of a cone or cylinder.
    pub(super) fn rod(&mut self, material: u32, ends: [DVec3; 2], radii: [f64; 2]) {
        let ends = ends.map(|p| self.point(p));
        self.surface(material, Shape::Cone { ends, radii }, false);
    }

    /// Adds a torus.
    pub(super) fn torus(&mut self, material: u32, center: DVec3, axis: DVec3, major: f64, minor: f64) {
        let (center, axis) = (self.point(center), self.vector(axis));
        self.surface(material, Shape::Torus { center, axis, major, minor }, false);
    }

    /// Adds what a profile of points (radius, height) sweeps about a unit axis: cones, cylinders, rings and disks. The
    /// solid lies to the left of the way along the profile: upward on the outside, inward on the top, downward on the
    /// inside of a hollow.
    pub(super) fn lathe(&mut self, material: u32, base: DVec3, axis: DVec3, profile: &[(f64, f64)]) {
        let (base, axis) = (self.point(base), self.vector(axis));
        for pair in profile.windows(2) {
            let [(r0, z0), (r1, z1)] = [pair[0], pair[1]];
            let shape = if z0 == z1 {
                let normal = if r1 < r0 { axis } else { -axis };
                Shape::Ring { center: base + axis * z0, normal, inner: r0.min(r1), outer: r0.max(r1) }
            } else {
                Shape::Cone { ends: [base + axis * z0, base + axis * z1], radii: [r0, r1] }
            };
            self.surface(material, shape, z1 < z0);
        }
    }

    /// Adds a box between two corners, facing outward, without the faces in `skipped`.
    pub(super) fn block(&mut self, material: u32, low: [f64; 3], high: [f64; 3], skipped: u8) {
        let corner = |k: usize| {
            DVec3::from_array(std::array::from_fn(|axis| if k >> axis & 1 == 0 { low[axis] } else { high[axis] }))
        };
        // Corner numbers count x, y, z as bits 0, 1, 2.
        for (face, corners) in [
            (skip::X0, [0, 4, 6, 2]),
            (skip::X1, [1, 3, 7, 5]),
            (skip::Y0, [0, 1, 5, 4]),
            (skip::Y1, [2, 6, 7, 3]),
            (skip::Z0, [0, 2, 3, 1]),
            (skip::Z1, [4, 5, 7, 6]),
        ] {
            if skipped & face == 0 {
                self.quad(material, corners.map(corner));
            }
        }
    }

    /// Adds a camera.
    pub(super) fn camera(&mut self, name: &str, camera: Camera) {
        self.scene.cameras.push((name.to_owned(), camera));
    }
}

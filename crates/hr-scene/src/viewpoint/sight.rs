//! What can be seen from somewhere, and whether it is lit.

use super::shape_bounds;
use crate::{Camera, Rgb, Scene};
use glam::{DVec3, Vec3};
use hr_diffuse::{Domain, Geometry, Hit, LightKind, Normalization, Surface, Visibility};

/// Rays are cast against so many of the largest surfaces at most.
const MOST_SURFACES: usize = 100_000;
/// Rays of a camera, across and down.
const GRID: [u32; 2] = [16, 10];
/// Points on lamps, at most, that places are tested against: the strongest.
const MOST_LAMPS: usize = 16;
/// What a place is worth to the eye that no lamp reaches directly, of one that is lit: it may be lit by reflection.
const UNLIT: f64 = 0.1;
/// What the face of a lamp is worth: light, but nothing to look at.
const LAMP: f64 = 0.5;
/// What is this near the eye, as a share of the distance to what is looked at, is worth half: wide views are better.
const NEAR: f64 = 1.0;
/// Where no lamp is, light comes from everywhere: a place is lit that sees out in one of these directions, x and y of unit vectors about
/// its normal.
const OUTWARD: [[f32; 2]; 7] =
    [[0.0, 0.0], [0.7, 0.0], [0.35, 0.61], [-0.35, 0.61], [-0.7, 0.0], [-0.35, -0.61], [0.35, -0.61]];
/// Rays begin and end this far from surfaces, unit space.
const GAP: f32 = 1e-5;

/// Rays through a scene.
pub(super) struct Sight<'a> {
    scene: &'a Scene,
    normalization: Normalization,
    visibility: Visibility,
    /// The scene's surface for each one of `visibility`.
    surfaces: Vec<&'a Surface>,
    lamps: Vec<Lamp>,
}

/// From where light comes, unit space.
enum Lamp {
    /// A point of a surface, its normal.
    Face(Vec3, Vec3),
    Point(Vec3),
    /// The direction to it.
    Distant(Vec3),
}

impl<'a> Sight<'a> {
    pub(super) fn of(scene: &'a Scene) -> Self {
        let normalization = Normalization::new(&scene.surfaces);
        let size = |s: &Surface| {
            let (low, high) = shape_bounds(&s.shape);
            (high - low).length()
        };
        let mut surfaces: Vec<&Surface> = scene.surfaces.iter().collect();
        if surfaces.len() > MOST_SURFACES {
            surfaces.sort_by(|a, b| size(b).total_cmp(&size(a)));
            surfaces.truncate(MOST_SURFACES);
        }
        // What has no shape stops no ray; the solver will say so.
        let (surfaces, geometries): (Vec<&Surface>, Vec<Geometry>) =
            surfaces.into_iter().filter_map(|s| Some((s, Geometry::from_surface(s, &normalization).ok()?))).unzip();
        let exitance = |s: &Surface| scene.materials.get(s.material as usize).map_or(Rgb::ZERO, |m| m.exitance);
        let mut shining: Vec<(f32, &Geometry)> = surfaces
            .iter()
            .zip(&geometries)
            .map(|(s, g)| (exitance(s).element_sum() * g.area(Domain::WHOLE), g))
            .filter(|(power, _)| *power > 0.0)
            .collect();
        shining.sort_by(|a, b| b.0.total_cmp(&a.0));
        let faces = shining.iter().take(MOST_LAMPS).flat_map(|(_, g)| {
            // Off the symmetry, so that no ray runs along edges.
            [(0.52, 0.47), (0.21, 0.83), (0.79, 0.18)].map(|(s, t)| {
                let (point, normal) = g.sample(Domain::WHOLE, s, t);
                Lamp::Face(point, normal)
            })
        });
        let points = scene.lights.iter().filter(|light| light.intensity != Rgb::ZERO).map(|light| match light.kind {
            LightKind::Directional { direction } => Lamp::Distant(-direction),
            LightKind::Point | LightKind::Spot { .. } => Lamp::Point(normalization.to_unit(light.position)),
        });
        let lamps = points.take(MOST_LAMPS).chain(faces).collect();
        Self { scene, normalization, visibility: Visibility::new(&geometries), surfaces, lamps }
    }

    fn hit(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        self.visibility.closest(self.normalization.to_unit(origin), direction.as_vec3(), 0.0, f32::MAX)
    }

    /// Distance along a unit direction to the nearest surface; infinite where there is none.
    pub(super) fn distance(&self, origin: DVec3, direction: DVec3) -> f64 {
        self.hit(origin, direction).map_or(f64::INFINITY, |hit| f64::from(hit.t) / self.normalization.scale())
    }

    /// Where a ray ends, if that speaks for a room around its origin: on the front of a surface, or the back of a
    /// two-sided one where there is light. Otherwise it is the inside of a solid, or nothing.
    pub(super) fn wall(&self, origin: DVec3, direction: DVec3) -> Option<DVec3> {
        let hit = self.hit(origin, direction)?;
        let room = hit.front || self.has_lamps() && self.shows(&hit);
        room.then(|| self.normalization.to_scene(hit.point))
    }

    /// Whether there is a lamp, seen or not.
    pub(super) fn has_lamps(&self) -> bool {
        !self.lamps.is_empty()
    }

    /// How much of a picture shows what is lit, and not too near: 0…1.
    pub(super) fn seen(&self, camera: &Camera) -> f64 {
        let [across, down] = GRID;
        let (eye, rays, mut sum) = (DVec3::from(camera.eye), camera.rays(), 0.0);
        let near = NEAR * (DVec3::from(camera.target) - eye).length() * self.normalization.scale();
        for k in 0..across * down {
            let x = (f64::from(k % across) + 0.5) * f64::from(camera.width) / f64::from(across);
            let y = (f64::from(k / across) + 0.5) * f64::from(camera.height) / f64::from(down);
            let direction = rays.direction(x, y);
            let Some(hit) = self.hit(eye, direction).filter(|hit| self.shows(hit)) else { continue };
            let worth = if hit.front && self.exitance(&hit) != Rgb::ZERO {
                LAMP
            } else if self.lit(&hit, direction.as_vec3()) {
                1.0
            } else {
                UNLIT
            };
            sum += worth * f64::from(hit.t) / (f64::from(hit.t) + near);
        }
        sum / f64::from(across * down)
    }

    fn exitance(&self, hit: &Hit) -> Rgb {
        let material = self.surfaces[hit.surface as usize].material;
        self.scene.materials.get(material as usize).map_or(Rgb::ZERO, |m| m.exitance)
    }

    /// Whether the side that was hit is more than black.
    fn shows(&self, hit: &Hit) -> bool {
        let Some(material) = self.scene.materials.get(self.surfaces[hit.surface as usize].material as usize) else {
            return false;
        };
        let is_black = material.reflector.is_diffuse() && material.reflector.diffuse() == Rgb::ZERO;
        let emits = hit.front && material.exitance != Rgb::ZERO;
        (hit.front || material.two_sided) && !is_black || emits
    }

    /// Whether a lamp reaches what was hit directly, or without lamps the sky.
    fn lit(&self, hit: &Hit, direction: Vec3) -> bool {
        let normal = if hit.normal.dot(direction) < 0.0 { hit.normal } else { -hit.normal };
        let from = hit.point + normal * GAP;
        if self.lamps.is_empty() {
            let (right, ahead) = normal.any_orthonormal_pair();
            return OUTWARD.iter().any(|[x, y]| {
                let outward = right * *x + ahead * *y + normal * (1.0 - x * x - y * y).sqrt();
                self.visibility.closest(from, outward, GAP, f32::MAX).is_none()
            });
        }
        self.lamps.iter().any(|lamp| {
            let (to, reach) = match *lamp {
                Lamp::Face(point, facing) if facing.dot(from - point) <= 0.0 => return false,
                Lamp::Face(point, _) | Lamp::Point(point) => (point - from, 1.0),
                Lamp::Distant(to) => (to, f32::MAX),
            };
            let near = GAP / to.length().max(GAP);
            to.dot(normal) > 0.0 && self.visibility.closest(from, to, near, reach - near).is_none()
        })
    }
}

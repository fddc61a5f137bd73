//! All that emits, to draw a light from: surfaces by their power, and lights without extent.

use glam::{Vec2, Vec3};
use hr_diffuse::oracle::spot_ramp;
use hr_diffuse::{Domain, Geometry, Light, LightKind, Normalization, Rgb};
use hr_scene::Scene;
use std::f32::consts::{FRAC_1_PI, PI};

/// Farther than anything in the unit cube is from anything else in it.
const FAR: f32 = 2.0;

/// The emitters of a scene, in unit space.
#[derive(Clone, Debug)]
pub struct Emitters {
    entries: Vec<Entry>,
    /// Chance of each entry and of all before it.
    chances: Vec<f32>,
    /// Entry of each surface that emits, [`u32::MAX`] for the others.
    entry_of: Vec<u32>,
}

/// One thing that emits.
#[derive(Clone, Debug)]
struct Entry {
    source: Source,
    /// Chance to be drawn.
    chance: f32,
    /// Chance to be among the candidates, about.
    presence: f32,
}

#[derive(Clone, Debug)]
enum Source {
    /// A surface: exitant radiance of its front and area.
    Surface { surface: u32, radiance: Rgb, area: f32 },
    /// A light without extent, its position and intensity in unit space.
    Light { light: Light, position: Vec3 },
}

/// Light that would arrive at a point if nothing were between.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Where it comes from; for directional light a point outside of the scene.
    pub from: Vec3,
    /// The emitting surface, if it is one.
    pub surface: Option<u32>,
    /// Unit direction toward it.
    pub direction: Vec3,
    /// Irradiance on a plane perpendicular to `direction`, divided by the density it was drawn with.
    pub irradiance: Rgb,
    /// What stands for the density per solid angle; infinite where nothing else could find this light.
    pub density: f32,
}

impl Emitters {
    /// Collects what emits. `geometries` are the scene's surfaces in unit space. `candidates` is how many are drawn at a
    /// time, to pick the best of: it scales [`density`](Self::density).
    #[must_use]
    pub fn new(scene: &Scene, geometries: &[Geometry], normalization: &Normalization, candidates: u32) -> Self {
        let mut found = Vec::new();
        for (surface, geometry) in geometries.iter().enumerate() {
            let exitance = scene.materials[scene.surfaces[surface].material as usize].exitance;
            let area = geometry.area(Domain::WHOLE);
            let source = Source::Surface { surface: surface as u32, radiance: exitance * FRAC_1_PI, area };
            found.push((source, exitance.element_sum() * area));
        }
        let scale2 = (normalization.scale() * normalization.scale()) as f32;
        for light in &scene.lights {
            let (intensity, spread) = match light.kind {
                // Seen from the unit cube, the power that crosses it.
                LightKind::Directional { .. } => (light.intensity, 1.0),
                LightKind::Point => (light.intensity * scale2, 4.0 * PI),
                LightKind::Spot { cos_outer, .. } => (light.intensity * scale2, 2.0 * PI * (1.0 - cos_outer)),
            };
            let position = normalization.to_unit(light.position);
            found.push((
                Source::Light { light: Light { intensity, ..*light }, position },
                intensity.element_sum() * spread,
            ));
        }
        found.retain(|(_, power)| *power > 0.0);
        let total: f32 = found.iter().map(|(_, power)| power).sum();
        let mut emitters =
            Self { entries: Vec::new(), chances: Vec::new(), entry_of: vec![u32::MAX; geometries.len()] };
        let mut sum = 0.0;
        for (source, power) in found {
            if let Source::Surface { surface, .. } = source {
                emitters.entry_of[surface as usize] = emitters.entries.len() as u32;
            }
            let chance = power / total;
            sum += chance;
            let presence = (chance * candidates as f32).min(1.0);
            emitters.entries.push(Entry { source, chance, presence });
            emitters.chances.push(sum);
        }
        emitters
    }

    /// Draws light that may arrive at `at`: `choice` (0…1) picks the emitter, `u` the place on it. None where what was
    /// drawn does not shine there.
    #[must_use]
    pub fn draw(&self, geometries: &[Geometry], at: Vec3, choice: f32, u: Vec2) -> Option<Arrival> {
        // Rounding may leave the last sum a little below the choice.
        let index = self.chances.partition_point(|&sum| sum <= choice).min(self.entries.len().checked_sub(1)?);
        let Entry { source, chance, presence } = &self.entries[index];
        match source {
            Source::Surface { surface, radiance, area } => {
                let (from, normal, weight) = geometries[*surface as usize].sample_area(Domain::WHOLE, u.x, u.y);
                let to = from - at;
                let distance2 = to.length_squared();
                let direction = to / distance2.sqrt();
                let cosine = -normal.dot(direction);
                (distance2 > 0.0 && cosine > 0.0).then(|| Arrival {
                    from,
                    surface: Some(*surface),
                    direction,
                    irradiance: *radiance * (cosine * weight / (distance2 * chance)),
                    density: presence * distance2 / (area * cosine),
                })
            }
            Source::Light { light, position } => {
                let to = position - at;
                let distance2 = to.length_squared();
                let toward = to / distance2.sqrt();
                let (from, direction, share) = match light.kind {
                    LightKind::Directional { direction } => (at - direction * FAR, -direction, 1.0),
                    LightKind::Point => (*position, toward, distance2.recip()),
                    LightKind::Spot { direction, cos_inner, cos_outer } => {
                        let ramp = spot_ramp(-toward.dot(direction), cos_inner, cos_outer);
                        (*position, toward, ramp / distance2)
                    }
                };
                (share > 0.0 && share.is_finite()).then(|| Arrival {
                    from,
                    surface: None,
                    direction,
                    irradiance: light.intensity * (share / chance),
                    density: f32::INFINITY,
                })
            }
        }
    }

    /// What stands for the density per solid angle with which [`draw`](Self::draw) finds a point of a surface's front,
    /// seen at `distance` with the cosine `cosine` to its normal; 0 where the surface does not emit.
    #[must_use]
    pub fn density(&self, surface: u32, distance: f32, cosine: f32) -> f32 {
        match self.entries.get(self.entry_of[surface as usize] as usize) {
            Some(Entry { source: Source::Surface { area, .. }, presence, .. }) => {
                presence * distance * distance / (area * cosine)
            }
            _ => 0.0,
        }
    }
}

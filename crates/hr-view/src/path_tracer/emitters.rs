//! All that light is drawn from: surfaces that emit, by their power, lights without extent, and, where a solution knows
//! them, parts of surfaces that reflect so much that rays which meet them by chance would be noise.

use super::STEP;
use super::groups::Groups;
use super::nearby::Nearby;
use super::parts::Part;
use super::spherical::Spherical;
use glam::{Vec2, Vec3};
use hr_diffuse::beams::spot_ramp;
use hr_diffuse::form_factor::{point_to_sphere, point_to_surface};
use hr_diffuse::visibility::{Occluders, Patch};
use hr_diffuse::{Domain, Geometry, Light, LightKind, Normalization, Rgb, Shape, Surface};
use hr_scene::Scene;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};

/// Farther than anything in the unit cube is from anything else in it.
const FAR: f32 = 2.0;
/// Polygons that are farther than so many of their radii are far.
const NEAR: f32 = 2.5;

/// The emitters of a scene, in unit space.
#[derive(Clone, Debug)]
pub struct Emitters {
    entries: Vec<Entry>,
    /// Chance of each entry and of all before it.
    chances: Vec<f32>,
    /// Entry of each surface that emits, [`u32::MAX`] for the others.
    entry_of: Vec<u32>,
    /// The first entry that is a part of a surface that reflects.
    glowing: usize,
    /// How many are drawn at a time.
    candidates: u32,
    /// All but those that glow.
    groups: Groups,
}

/// One thing that emits.
#[derive(Clone, Debug)]
struct Entry {
    source: Source,
    /// Chance to be drawn by power alone.
    chance: f32,
    /// Where it is worth asking whether it is [`Spherical`]: a middle, and a squared distance from it; 0 for what is no polygon.
    near: (Vec3, f32),
}

#[derive(Clone, Debug)]
enum Source {
    /// One side of a part of a surface.
    Surface(Glow),
    /// The outside of a whole sphere.
    Sphere { surface: u32, center: Vec3, radius: f32, radiance: Rgb },
    /// A light without extent, its position and intensity in unit space.
    Light { light: Light, position: Vec3 },
}

/// One side of a part of a surface that shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glow {
    /// The surface.
    pub surface: u32,
    /// The part of it.
    pub domain: Domain,
    /// Whether its back shines.
    pub back: bool,
    /// Exitant radiance, W/(m² sr); the same in each channel where it is only believed.
    pub radiance: Rgb,
    /// Area in unit space.
    pub area: f32,
}

/// How emitters are drawn at a place.
#[derive(Clone, Copy, Debug)]
pub enum Draws<'a> {
    /// By power alone.
    ByPower,
    /// By what is known of those nearby.
    Nearby(&'a Nearby),
    /// One of each group of neighbours.
    OfGroups,
}

impl<'a> From<Option<&'a Nearby>> for Draws<'a> {
    fn from(nearby: Option<&'a Nearby>) -> Self {
        nearby.map_or(Self::ByPower, Self::Nearby)
    }
}

/// Light that would arrive at a point if nothing were between.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Where it comes from; for directional light a point outside of the scene.
    pub from: Vec3,
    /// Which emitter it is.
    pub entry: u32,
    /// The emitting surface, if it is one.
    pub surface: Option<u32>,
    /// The emitter, and the radiance that it is believed to have in each channel, if it is a part of a surface that reflects.
    pub glow: Option<(u32, f32)>,
    /// Share of it that is believed to be seen, > 0; 1 where nothing is known.
    pub seen: f32,
    /// Unit direction toward it.
    pub direction: Vec3,
    /// Irradiance on a plane perpendicular to `direction`, divided by the density it was drawn with.
    pub irradiance: Rgb,
    /// What stands for the density per solid angle; infinite where nothing else could find this light.
    pub density: f32,
}

impl Emitters {
    /// Collects what emits, and what glows. `geometries` are the scene's surfaces in unit space. `candidates` is how many are
    /// drawn at a time, to pick the best of: it scales [`density`](Self::density).
    #[must_use]
    pub fn new(
        scene: &Scene,
        geometries: &[Geometry],
        normalization: &Normalization,
        candidates: u32,
        glowing: &[Glow],
    ) -> Self {
        let mut found = Vec::new();
        for (surface, geometry) in geometries.iter().enumerate() {
            let exitance = scene.materials[scene.surfaces[surface].material as usize].exitance;
            let area = geometry.area(Domain::WHOLE);
            let (surface, radiance) = (surface as u32, exitance * FRAC_1_PI);
            let source = match scene.surfaces[surface as usize] {
                Surface { shape: Shape::Sphere { center, radius }, flip: false, .. } if radius > 0.0 => {
                    Source::Sphere {
                        surface,
                        center: normalization.to_unit(center),
                        radius: (radius * normalization.scale()) as f32,
                        radiance,
                    }
                }
                _ => Source::Surface(Glow { surface, domain: Domain::WHOLE, back: false, radiance, area }),
            };
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
        let first = found.len();
        let power = |glow: &Glow| glow.radiance.element_sum() * PI * glow.area;
        found.extend(glowing.iter().map(|glow| (Source::Surface(*glow), power(glow))));
        let middle = |source: &Source| match source {
            Source::Surface(glow) => {
                let geometry = &geometries[glow.surface as usize];
                geometry.point(geometry.middle(glow.domain))
            }
            Source::Sphere { center, .. } => *center,
            Source::Light { light: Light { kind: LightKind::Directional { direction }, .. }, .. } => -FAR * *direction,
            Source::Light { position, .. } => *position,
        };
        let grouped: Vec<(Vec3, f32)> = found[..first].iter().map(|(source, power)| (middle(source), *power)).collect();
        let total: f32 = found.iter().map(|(_, power)| power).sum();
        let (mut entries, mut chances, mut sum) = (Vec::new(), Vec::new(), 0.0);
        let mut entry_of = vec![u32::MAX; geometries.len()];
        for (index, (source, power)) in found.into_iter().enumerate() {
            match source {
                Source::Surface(Glow { surface, .. }) | Source::Sphere { surface, .. } if index < first => {
                    entry_of[surface as usize] = index as u32;
                }
                _ => {}
            }
            let chance = power / total;
            sum += chance;
            let middle = middle(&source);
            let near = (middle, reach(geometries, &source, middle).powi(2));
            entries.push(Entry { source, chance, near });
            chances.push(sum);
        }
        Self { entries, chances, entry_of, glowing: first, candidates, groups: Groups::new(&grouped) }
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether nothing shines.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The emitter that the part of a surface is that comes at this place among those that glow.
    #[must_use]
    pub fn glowing(&self, place: usize) -> u32 {
        (self.glowing + place) as u32
    }

    /// Whether an emitter is one of these.
    #[must_use]
    pub fn is_glowing(&self, entry: u32) -> bool {
        entry as usize >= self.glowing
    }

    /// Whether all of an emitter faces one way.
    pub(super) fn is_flat(&self, entry: u32, geometries: &[Geometry]) -> bool {
        match &self.entries[entry as usize].source {
            Source::Surface(glow) => geometries[glow.surface as usize].is_polygon(),
            Source::Sphere { .. } => false,
            Source::Light { .. } => true,
        }
    }

    /// The emitter that a surface is, if it emits.
    #[must_use]
    pub fn of_surface(&self, surface: u32) -> Option<u32> {
        Some(self.entry_of[surface as usize]).filter(|&entry| entry != u32::MAX)
    }

    /// The chance of an entry to be drawn.
    fn chance(&self, entry: u32, draws: Draws<'_>) -> f32 {
        let by_power = self.entries[entry as usize].chance;
        match draws {
            Draws::ByPower => by_power,
            Draws::Nearby(nearby) => nearby.chance(entry, by_power),
            Draws::OfGroups => self.groups.chance(entry),
        }
    }

    /// Draws light that may arrive at `at`: `choice` (0…1) picks the emitter, by power or by what is known of those nearby,
    /// `u` the place on it. None where what was drawn does not shine there.
    #[must_use]
    pub fn draw(
        &self,
        geometries: &[Geometry],
        at: Vec3,
        choice: f32,
        u: Vec2,
        nearby: Option<&Nearby>,
    ) -> Option<Arrival> {
        let by_power = |choice: f32| {
            // Rounding may leave the last sum a little below the choice.
            let index = self.chances.partition_point(|&sum| sum <= choice).min(self.entries.len().checked_sub(1)?);
            Some(index as u32)
        };
        let Some(nearby) = nearby else {
            let entry = by_power(choice)?;
            return self.shine(geometries, at, (entry, None), u, self.chance(entry, Draws::ByPower));
        };
        let entry = nearby.pick(choice).or_else(|rest| by_power(rest).ok_or(())).ok()?;
        let (part, u) = nearby.part(entry, u);
        let arrival = self.shine(geometries, at, (entry, part), u, self.chance(entry, Draws::Nearby(nearby)))?;
        Some(Arrival { seen: nearby.seen(entry), ..arrival })
    }

    /// Draws light of one emitter of each group that may arrive at `at`, with the group's number: numbers in 0…1, which the groups share
    /// by steps, pick the emitter and the place on it. Those that glow are in no group.
    pub fn draw_of_groups(
        &self,
        geometries: &[Geometry],
        at: Vec3,
        choice: f32,
        u: Vec2,
    ) -> impl Iterator<Item = (usize, Arrival)> {
        let drawn = self.groups.draw(move |number| (choice + STEP.y * number as f32).fract());
        drawn.enumerate().filter_map(move |(number, entry)| {
            let u = (u + STEP * number as f32).fract();
            Some((number, self.shine(geometries, at, (entry, None), u, self.groups.chance(entry))?))
        })
    }

    /// The light of one emitter, or of a part of it, that is drawn with a chance.
    pub(super) fn shine(
        &self,
        geometries: &[Geometry],
        at: Vec3,
        (entry, part): (u32, Option<Part>),
        u: Vec2,
        chance: f32,
    ) -> Option<Arrival> {
        match &self.entries[entry as usize].source {
            Source::Surface(glow) => {
                let geometry = &geometries[glow.surface as usize];
                let Part { domain, chance: share } = part.unwrap_or(Part { domain: glow.domain, chance: 1.0 });
                let facing = |front: Vec3| if glow.back { -front } else { front };
                let whole = self.spherical(geometries, entry, at);
                let solid_angle = whole.as_ref().map(Spherical::solid_angle);
                let near = |_| Spherical::new(geometry, domain, at);
                let spherical = if part.is_some() { whole.and_then(near) } else { whole };
                let (from, direction, distance, cosine, extent) = if let Some(spherical) = spherical {
                    let direction = spherical.direction(u)?;
                    let (on, front) = geometry.sample(domain, 0.5, 0.5);
                    let normal = facing(front);
                    let cosine = -direction.dot(normal);
                    let distance = (at - on).dot(normal) / cosine;
                    let shines = cosine > 0.0 && distance > 0.0 && distance < FAR;
                    shines.then_some((
                        at + direction * distance,
                        direction,
                        distance,
                        cosine,
                        spherical.solid_angle(),
                    ))?
                } else {
                    let (from, front, weight) = geometry.sample_area(domain, u.x, u.y);
                    let to = from - at;
                    let distance = to.length();
                    let direction = to / distance;
                    let cosine = -facing(front).dot(direction);
                    let shines = distance > 0.0 && cosine > 0.0;
                    shines.then_some((from, direction, distance, cosine, cosine * weight / (distance * distance)))?
                };
                // As if all of it had been drawn from: what else finds it does not know of parts.
                let density = solid_angle.map_or(distance * distance / (glow.area * cosine), f32::recip);
                Some(Arrival {
                    from,
                    entry,
                    surface: Some(glow.surface),
                    glow: self.is_glowing(entry).then_some((entry, glow.radiance.x)),
                    seen: 1.0,
                    direction,
                    irradiance: glow.radiance * (extent / (chance * share)),
                    density: self.presence(chance) * density,
                })
            }
            Source::Sphere { surface, center, radius, radiance } => {
                // Evenly within the cone that it fills, so that no point faces away.
                let to = center - at;
                let distance2 = to.length_squared();
                let narrowness = cap(distance2, *radius)?;
                let cosine = 1.0 - u.x * narrowness;
                let sine2 = (1.0 - cosine) * (1.0 + cosine);
                let (axis, distance) = (to / distance2.sqrt(), distance2.sqrt());
                let (right, up) = axis.any_orthonormal_pair();
                let (sin, cos) = (TAU * u.y).sin_cos();
                let direction = axis * cosine + (right * cos + up * sin) * sine2.sqrt();
                let near = distance * cosine - (radius * radius - distance2 * sine2).max(0.0).sqrt();
                let extent = TAU * narrowness;
                Some(Arrival {
                    from: at + direction * near,
                    entry,
                    surface: Some(*surface),
                    glow: None,
                    seen: 1.0,
                    direction,
                    irradiance: *radiance * (extent / chance),
                    density: self.presence(chance) / extent,
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
                    entry,
                    surface: None,
                    glow: None,
                    seen: 1.0,
                    direction,
                    irradiance: light.intensity * (share / chance),
                    density: f32::INFINITY,
                })
            }
        }
    }

    /// The part of a surface that an emitter is, if its light has the same radiance from everywhere.
    pub(super) fn patch(&self, entry: u32) -> Option<Patch> {
        match &self.entries[entry as usize].source {
            Source::Surface(Glow { surface, domain, back, .. }) if !self.is_glowing(entry) => {
                Some(Patch { surface: *surface, domain: *domain, back: *back })
            }
            _ => None,
        }
    }

    /// Irradiance of what is seen of an emitter at a point, by a unit normal and above the horizon of the surface's, if all is known that
    /// may hide parts of it.
    pub(super) fn visible(&self, entry: u32, occluders: &Occluders, at: Vec3, normals: [Vec3; 2]) -> Rgb {
        match &self.entries[entry as usize].source {
            Source::Surface(glow) => glow.radiance * PI * occluders.visible_factor(at, normals),
            _ => Rgb::ZERO,
        }
    }

    /// Irradiance of all of an emitter at a point with the unit normal `n`, were nothing between; none where there is no closed form, or
    /// where part of it lies below the horizon of the surface's `true_normal`, which hides it but is not that of `n`.
    pub(super) fn unoccluded(
        &self,
        geometries: &[Geometry],
        entry: u32,
        at: Vec3,
        [n, true_normal]: [Vec3; 2],
    ) -> Option<Rgb> {
        let above = |point: Vec3, radius: f32| n == true_normal || (point - at).dot(true_normal) >= radius;
        match &self.entries[entry as usize].source {
            Source::Surface(glow) => {
                let geometry = &geometries[glow.surface as usize];
                let is_within = |(center, radius): (Vec3, f32)| at.distance(center) < radius;
                let is_sky = glow.domain == Domain::WHOLE && !geometry.is_convex(glow.back);
                if is_sky && geometry.sphere().is_some_and(is_within) {
                    // All around: all that is above both horizons counts.
                    return Some(glow.radiance * (FRAC_PI_2 * (1.0 + n.dot(true_normal))));
                }
                let mut corners = geometry.corners(glow.domain).into_iter();
                if !geometry.is_polygon() || !corners.all(|uv| above(geometry.point(uv), 0.0)) {
                    return None;
                }
                Some(glow.radiance * PI * point_to_surface(geometry, &glow.domain, glow.back, at, n))
            }
            Source::Sphere { center, radius, radiance, .. } => {
                above(*center, *radius).then(|| *radiance * PI * point_to_sphere(at, n, *center, *radius))
            }
            Source::Light { .. } => None,
        }
    }

    /// Chance to be among the candidates, about.
    fn presence(&self, chance: f32) -> f32 {
        (chance * self.candidates as f32).min(1.0)
    }

    /// An emitter that is a polygon and fills much of what is seen from a point.
    fn spherical(&self, geometries: &[Geometry], entry: u32, at: Vec3) -> Option<Spherical> {
        let Entry { source: Source::Surface(glow), near: (middle, reach2), .. } = &self.entries[entry as usize] else {
            return None;
        };
        let is_near = at.distance_squared(*middle) < *reach2;
        is_near.then(|| Spherical::new(&geometries[glow.surface as usize], glow.domain, at))?
    }

    /// What stands for the density per solid angle with which [`draw`](Self::draw) finds a point of an emitter's shining side
    /// from the point `at`, seen at `distance` with the cosine `cosine` to its normal.
    #[must_use]
    pub fn density(
        &self,
        geometries: &[Geometry],
        entry: u32,
        at: Vec3,
        [distance, cosine]: [f32; 2],
        draws: Draws<'_>,
    ) -> f32 {
        let presence = self.presence(self.chance(entry, draws));
        match &self.entries[entry as usize].source {
            Source::Surface(glow) => self.spherical(geometries, entry, at).map_or_else(
                || presence * distance * distance / (glow.area * cosine),
                |spherical| presence / spherical.solid_angle(),
            ),
            Source::Sphere { radius, .. } => {
                let distance2 = distance * distance + radius * (radius + 2.0 * distance * cosine);
                cap(distance2, *radius).map_or(0.0, |narrowness| presence / (TAU * narrowness))
            }
            Source::Light { .. } => 0.0,
        }
    }
}

/// How far from its middle a polygon may fill much of what is seen; 0 for the others.
fn reach(geometries: &[Geometry], source: &Source, middle: Vec3) -> f32 {
    let Source::Surface(glow) = source else { return 0.0 };
    let geometry = &geometries[glow.surface as usize];
    if !geometry.is_polygon() {
        return 0.0;
    }
    let corners = geometry.corners(glow.domain).into_iter().map(|uv| geometry.point(uv).distance(middle));
    NEAR * corners.fold(0.0, f32::max)
}

/// 1 − cosine of half the angle that a sphere fills, seen from outside of it.
fn cap(distance2: f32, radius: f32) -> Option<f32> {
    let sine2 = radius * radius / distance2;
    (sine2 < 1.0).then(|| sine2 / (1.0 + (1.0 - sine2).sqrt()))
}

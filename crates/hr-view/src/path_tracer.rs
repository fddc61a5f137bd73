//! A path tracer on the exact surfaces, with nothing of hierarchical radiosity in it but its rays and its reflectors.
//! Its paths go on until their light is gone, as references need it: such images are unbiased. Or they end where somebody
//! knows the light already, which makes of a solution a final gather ([`RayCaster`](crate::raycast::RayCaster)).
//!
//! At every point of a path one emitter is picked for direct light, and one part of the BRDF (its Lambertian share, its
//! glossy part or its mirror) for the path to go on. Emitters that both find are weighted by the power heuristic
//! (Veach & Guibas, "Optimally Combining Sampling Techniques for Monte Carlo Rendering", SIGGRAPH 1995). Its weights
//! for the two add up to 1 for *any* positive functions in place of the densities, so that the glossy part's density,
//! which a [`Reflector`] does not tell, may be replaced by what it is in the ideal: glossy · cos / albedo.
//!
//! What counts as right where models differ: backs of one-sided surfaces absorb, only fronts emit, shading normals that
//! do not see the eye are bent until they just do, and no light passes below the true surface.

mod emitters;
mod groups;
mod nearby;
mod parts;
mod sampler;
mod spherical;
#[cfg(test)]
mod tests;

pub use emitters::{Arrival, Draws, Emitters, Glow};
pub use nearby::Nearby;
pub use sampler::Sampler;

use glam::{DVec3, Vec2, Vec3};
use glossy_ext::{Place as Frame, Reflector};
use groups::MOST_GROUPS;
use hr_diffuse::sampling::hash;
use hr_diffuse::visibility::{NO_BLOCKER, Occluders};
use hr_diffuse::{Geometry, Hit, Normalization, Rgb, SolveError, Visibility};
use hr_scene::{Camera, Film, Image, Pixel, Scene};
use rayon::prelude::*;
use smallvec::SmallVec;
use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Rays start this far from their surface (unit space): what rounding needs.
const START: f32 = 1e-6;
/// Cosine that shading normals are bent to where they do not see the eye.
const GRAZING: f32 = 0.02;
/// Paths go on this often before chance may end them.
const SURE_BOUNCES: u32 = 3;
/// Largest chance to go on after that: bounds the length of paths where nothing is absorbed.
const MOST_SURVIVAL: f32 = 0.95;
/// A glossy part is drawn with at least this albedo: that of a remainder may be 0 in the mean only.
const LEAST_ALBEDO: f32 = 0.05;
/// Emitters among which one is picked at each point of a path.
const CANDIDATES: u32 = 4;
/// Step from one candidate's place on its emitter to the next one's: the two-dimensional golden ratio, as in
/// [`hr_diffuse::sampling`].
const STEP: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
/// Side of the grid of rays that look for emitters in a pixel.
const LOOKS: u32 = 4;

/// Footprints of rays are not enlarged by less cosine than this.
const LEAST_COSINE: f32 = 1e-3;

/// Pairs of random numbers that one bounce uses, after the pixel's own.
const PAIRS: u32 = 4;
/// Pairs that tell which emitters irradiance is drawn from.
const IRRADIANCE_PAIRS: [u32; 2] = [4, 5];
/// Draws for irradiance in half shadow, and where nothing is known.
const SHADED_DRAWS: u32 = 4;

/// Path traces a scene.
#[derive(Debug)]
pub struct PathTracer<'a> {
    scene: &'a Scene,
    visibility: &'a Visibility,
    normalization: Normalization,
    emitters: Emitters,
    /// Largest channel of each material's glossy albedo, 0 where it is diffuse.
    albedos: Vec<f32>,
}

/// An image and how sure it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Linear radiance, W/(m² sr).
    pub image: Image,
    /// Standard error of each pixel and channel, from the variance among its paths. They are stratified, so that the
    /// true error is this or less.
    pub sigma: Image,
}

/// A ray of a path that met a surface.
#[derive(Clone, Copy, Debug)]
pub struct Ray<'a> {
    /// What it met.
    pub hit: &'a Hit,
    /// Its unit direction.
    pub direction: Vec3,
    /// What stands for the density per solid angle that it was drawn with; infinite from the eye and from mirrors.
    pub density: f32,
    /// Reflections before: 0 for a ray from the eye.
    pub bounce: u32,
}

impl Ray<'_> {
    /// Area (unit space) that the ray stands for where it met the surface; 0 for one from the eye or a mirror.
    #[must_use]
    pub fn footprint(&self) -> f32 {
        let cosine = self.hit.normal.dot(self.direction).abs().max(LEAST_COSINE);
        self.hit.t * self.hit.t / (self.density * cosine)
    }
}

/// What somebody knows already about the light of the scene.
pub trait Known: Sync {
    /// Where a path ends: the radiance that is reflected back along a ray from what it met (W/(m² sr), without what is
    /// emitted), or nothing where the path is to go on.
    fn end(&self, ray: &Ray<'_>) -> Option<Rgb>;

    /// Which emitters light what was hit, if that is known.
    fn nearby(&self, hit: &Hit) -> Option<&Nearby>;

    /// Whether what was hit is one of the [glowing](Emitters::glowing) emitters, and which one. Rays that meet it without density
    /// must [end](Self::end) there.
    fn glowing(&self, hit: &Hit) -> Option<u32>;
}

/// Nothing is known.
impl Known for () {
    fn end(&self, _: &Ray<'_>) -> Option<Rgb> {
        None
    }

    fn nearby(&self, _: &Hit) -> Option<&Nearby> {
        None
    }

    fn glowing(&self, _: &Hit) -> Option<u32> {
        None
    }
}

/// A point that reflects.
struct Point {
    position: Vec3,
    surface: u32,
    /// True unit normal on the side that was hit.
    true_normal: Vec3,
    /// Shading frame on that side.
    place: Frame,
    /// Back along the path, in the frame.
    outgoing: Vec3,
    reflector: Arc<dyn Reflector>,
    diffuse: Rgb,
    /// Chances of the Lambertian share, the glossy part and the mirror to be followed.
    chances: [f32; 3],
    /// Glossy albedo.
    albedo: f32,
    /// How many rays follow the glossy part for each draw of an emitter.
    rays: f32,
}

/// Where a path goes on.
struct Step {
    direction: Vec3,
    weight: Rgb,
    /// What stands for the density that direction was drawn with; infinite for a mirror.
    density: f32,
}

/// The rays of a scene.
///
/// # Errors
/// [`SolveError::Surface`] where a surface makes no sense.
pub fn visibility(scene: &Scene) -> Result<Visibility, SolveError> {
    let normalization = Normalization::new(&scene.surfaces);
    let geometries = scene
        .surfaces
        .iter()
        .enumerate()
        .map(|(surface, s)| {
            Geometry::from_surface(s, &normalization).map_err(|source| SolveError::Surface { surface, source })
        })
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Visibility::new(&geometries))
}

impl<'a> PathTracer<'a> {
    /// Prepares a scene; `visibility` is that of its surfaces, as [`visibility`] or a solution has it.
    #[must_use]
    pub fn new(scene: &'a Scene, visibility: &'a Visibility) -> Self {
        Self::with_glow(scene, visibility, &[])
    }

    /// The same where parts of surfaces glow, so that light is drawn from them, too: somebody who [knows](Known) must tell
    /// their light.
    #[must_use]
    pub fn with_glow(scene: &'a Scene, visibility: &'a Visibility, glowing: &[Glow]) -> Self {
        let normalization = Normalization::new(&scene.surfaces);
        let emitters = Emitters::new(scene, visibility.geometries(), &normalization, CANDIDATES, glowing);
        let albedo = |reflector: &Arc<dyn Reflector>| {
            if reflector.is_diffuse() { 0.0 } else { reflector.glossy_albedo().max_element().max(LEAST_ALBEDO) }
        };
        let albedos = scene.materials.iter().map(|m| albedo(&m.reflector)).collect();
        Self { scene, visibility, normalization, emitters, albedos }
    }

    /// What light is drawn from.
    #[must_use]
    pub fn emitters(&self) -> &Emitters {
        &self.emitters
    }

    /// The image that a camera takes with `paths` paths per pixel (at least one). The same seed gives the same image,
    /// for any number of threads; others give independent ones. `watch` is told the share that is done.
    #[must_use]
    pub fn render(&self, camera: &Camera, paths: u32, seed: u32, watch: &(dyn Fn(f32) + Sync)) -> Reference {
        let (film, sigma) = self.render_until(&(), camera, paths, seed, watch);
        Reference { image: film.image, sigma }
    }

    /// [`render`](Self::render) by paths that end where the light is [known](Known), on film, with its standard error.
    #[must_use]
    pub fn render_until(
        &self,
        known: &dyn Known,
        camera: &Camera,
        paths: u32,
        seed: u32,
        watch: &(dyn Fn(f32) + Sync),
    ) -> (Film, Image) {
        let paths = paths.max(1);
        let mut image = Image::new(camera.width, camera.height);
        let mut sigma = image.clone();
        let width = camera.width as usize;
        let eye = self.normalization.to_unit(camera.eye.into());
        let rays = camera.rays();
        let done = AtomicU32::new(0);
        let rows = image.pixels.par_chunks_mut(width).zip(sigma.pixels.par_chunks_mut(width));
        let edges = rows.enumerate().flat_map_iter(|(y, (row, sigmas))| {
            let mut edges = Vec::new();
            for (x, (mean, sigma)) in row.iter_mut().zip(sigmas).enumerate() {
                let seed = hash(hash(x as u32, y as u32), seed);
                let (mut pixel, mut squares) = (Pixel::default(), DVec3::ZERO);
                for index in 0..paths {
                    let sampler = Sampler::new(seed, index);
                    let direction = rays.within(x, y, sampler.pair(0));
                    let (surface, radiance) = self.seen(eye, direction, &sampler, known);
                    pixel.add(surface, radiance);
                    squares += radiance.as_dvec3() * radiance.as_dvec3();
                }
                let n = f64::from(paths);
                *mean = pixel.radiance();
                let variance = (squares / n - mean.as_dvec3() * mean.as_dvec3()).max(DVec3::ZERO) / (n - 1.0).max(1.0);
                *sigma = variance.map(f64::sqrt).as_vec3();
                if pixel.has_edge() {
                    edges.push((y * width + x, pixel));
                }
            }
            let rows = done.fetch_add(1, Ordering::Relaxed) + 1;
            watch(rows as f32 / camera.height as f32);
            edges
        });
        let edges = edges.collect();
        (Film::new(image, edges), sigma)
    }

    /// What a camera sees of the emitters themselves: their own radiance, without any reflection.
    #[must_use]
    pub fn emission(&self, camera: &Camera) -> Image {
        let mut image = Image::new(camera.width, camera.height);
        let eye = self.normalization.to_unit(camera.eye.into());
        let rays = camera.rays();
        image.pixels.par_chunks_mut(camera.width as usize).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                for i in 0..LOOKS * LOOKS {
                    let within = Vec2::new((i % LOOKS) as f32 + 0.5, (i / LOOKS) as f32 + 0.5) / LOOKS as f32;
                    let direction = rays.within(x, y, within);
                    if let Some(hit) = self.visibility.closest(eye, direction, START, f32::MAX) {
                        *pixel += self.emitted(&hit) / (LOOKS * LOOKS) as f32;
                    }
                }
            }
        });
        image
    }

    /// Radiance that arrives at `origin` (unit space) against the unit `direction`, by one path.
    #[must_use]
    pub fn path(&self, origin: Vec3, direction: Vec3, sampler: &Sampler) -> Rgb {
        self.seen(origin, direction, sampler, &()).1
    }

    /// The same with the surface that the path meets first.
    fn seen(&self, mut origin: Vec3, mut direction: Vec3, sampler: &Sampler, known: &dyn Known) -> (Option<u32>, Rgb) {
        let (mut light, mut throughput, mut first) = (Rgb::ZERO, Rgb::ONE, None);
        let (mut own, mut density, mut nearby) = (NO_BLOCKER, f32::INFINITY, None);
        for bounce in 0.. {
            let Some(hit) = self.visibility.closest_except(origin, direction, START, f32::MAX, own) else { break };
            first = first.or(Some(hit.surface));
            let emitted = self.emitted(&hit);
            if emitted != Rgb::ZERO {
                light += throughput * emitted * self.share_of_emission(origin, &hit, direction, density, nearby.into());
            }
            if let Some(entry) = known.glowing(&hit) {
                let seen = [hit.t, hit.normal.dot(direction).abs()];
                let other = self.emitters.density(self.visibility.geometries(), entry, origin, seen, nearby.into());
                throughput *= power_heuristic(density, other);
            }
            if let Some(reflected) = known.end(&Ray { hit: &hit, direction, density, bounce }) {
                light += throughput * reflected;
                break;
            }
            let Some(point) = self.point(&hit, direction) else { break };
            let pair = |i: u32| sampler.pair(1 + bounce * PAIRS + i);
            let (choices, place, turn, chance) = (pair(0), pair(1), pair(2), pair(3));
            nearby = known.nearby(&hit);
            light += throughput * self.direct(&point, [choices.x, chance.x], place, known, nearby, bounce);
            let Some(step) = point.step(choices.y, turn) else { break };
            throughput *= step.weight;
            if bounce + 1 >= SURE_BOUNCES {
                // A remainder beside the Lambertian share may be negative, and so may be its paths.
                let survival = throughput.abs().max_element().min(MOST_SURVIVAL);
                if chance.y >= survival {
                    break;
                }
                throughput /= survival;
            }
            (origin, direction, own, density) = (point.position, step.direction, point.surface, step.density);
        }
        (first, light)
    }

    /// Radiance that the glossy part of a surface's BRDF reflects back against the unit `direction` where it was hit: the light
    /// of emitters, drawn by a pair of random numbers each for which and where, and the mean along rays within the lobe, drawn
    /// by one pair each, of what is emitted where they end, and what is reflected there, as `beyond` tells. Whichever way
    /// finds an emitter rarely counts for little (multiple importance sampling).
    pub fn glossy(
        &self,
        hit: &Hit,
        direction: Vec3,
        [choice, place]: [Vec2; 2],
        turns: &[Vec2],
        beyond: &mut dyn FnMut(&Hit, Vec3) -> Rgb,
    ) -> Rgb {
        let Some(point) = self.point(hit, direction) else { return Rgb::ZERO };
        let point = Point { diffuse: Rgb::ZERO, chances: [0.0, 1.0, 0.0], rays: turns.len() as f32, ..point };
        let mut light = self.direct_of_groups(&point, choice, place);
        for turn in turns {
            let Some(step) = point.step(0.0, *turn) else { continue };
            let met = self.visibility.closest_except(point.position, step.direction, START, f32::MAX, point.surface);
            let Some(met) = met else { continue };
            let emitted = self.emitted(&met)
                * self.share_of_emission(point.position, &met, step.direction, step.density, Draws::OfGroups);
            light += step.weight * (emitted + beyond(&met, step.direction)) / turns.len() as f32;
        }
        light
    }

    /// Irradiance (W/m²) by emitters of which all is known that may hide parts of them from there, where a surface was hit by a ray of the
    /// unit `direction`: exact, and without a ray.
    pub fn outlined(&self, hit: &Hit, direction: Vec3, nearby: &Nearby) -> Rgb {
        let Some(point) = self.point(hit, direction) else { return Rgb::ZERO };
        let normals = [point.place.frame.z_axis, point.true_normal];
        let visible =
            |(entry, occluders): &(u32, Occluders)| self.emitters.visible(*entry, occluders, point.position, normals);
        nearby.all_outlined().iter().map(visible).sum()
    }

    /// Irradiance (W/m²) by the other emitters where a surface was hit by a ray of the unit `direction`, from one point of one of them, or from a few where it
    /// is believed to lie in half shadow, by what is known of those `nearby`; else from a few of the groups of neighbours.
    ///
    /// Of emitters of which a share s is believed to be seen, that share of all their light u, were nothing between, is known without
    /// chance. A point of density p that sends l and is seen (v = 1) or not (v = 0) adds (v - s) l / p to that, whose mean is what it
    /// lacks (a control variate). Where s is 0 or 1, and right, there is no noise in it; else it may be less than nothing.
    pub fn irradiance(&self, hit: &Hit, direction: Vec3, sampler: &Sampler, nearby: Option<&Nearby>) -> Rgb {
        let Some(point) = self.point(hit, direction) else { return Rgb::ZERO };
        let Some(nearby) = nearby else {
            let white = Point { diffuse: Rgb::splat(PI), chances: [0.0; 3], ..point };
            let draw = |draw| {
                let sampler = sampler.split(SHADED_DRAWS, draw);
                let [choice, place] = IRRADIANCE_PAIRS.map(|dimension| sampler.pair(dimension));
                self.direct_of_groups(&white, choice, place)
            };
            return (0..SHADED_DRAWS).map(draw).sum::<Rgb>() / SHADED_DRAWS as f32;
        };
        let geometries = self.visibility.geometries();
        let normals = [point.place.frame.z_axis, point.true_normal];
        let expected: SmallVec<[(u32, f32, Rgb); 4]> = (nearby.surely_seen())
            .filter_map(|(entry, seen)| {
                let unoccluded = self.emitters.unoccluded(geometries, entry, point.position, normals)?;
                Some((entry, seen, unoccluded * seen))
            })
            .collect();
        let mut light: Rgb = expected.iter().map(|(.., irradiance)| irradiance).sum();
        let count = if nearby.is_shaded() { SHADED_DRAWS } else { 1 };
        for draw in 0..count {
            let sampler = sampler.split(count, draw);
            let [choice, place] = IRRADIANCE_PAIRS.map(|dimension| sampler.pair(dimension));
            let drawn = self.emitters.draw(geometries, point.position, choice.x, place, Some(nearby));
            let is_lacking =
                |arrival: &Arrival| point.is_lit_from(arrival.direction) && !nearby.is_outlined(arrival.entry);
            let Some(arrival) = drawn.filter(is_lacking) else { continue };
            let believed =
                expected.iter().find(|(entry, ..)| *entry == arrival.entry).map_or(0.0, |(_, seen, _)| *seen);
            let ends = [point.surface, arrival.surface.unwrap_or(NO_BLOCKER)];
            let blocked = self.visibility.occluded(point.position, arrival.from, ends, &mut { NO_BLOCKER });
            let lacks = if blocked { -believed } else { 1.0 - believed };
            light += arrival.irradiance * (point.cosine(arrival.direction) * lacks / count as f32);
        }
        light
    }

    /// What of an emitter's light counts for a ray of some density from `origin` that met it; the rest is that of draws.
    fn share_of_emission(&self, origin: Vec3, hit: &Hit, direction: Vec3, density: f32, draws: Draws<'_>) -> f32 {
        let Some(entry) = self.emitters.of_surface(hit.surface).filter(|_| density.is_finite()) else { return 1.0 };
        let seen = [hit.t, -hit.normal.dot(direction)];
        power_heuristic(density, self.emitters.density(self.visibility.geometries(), entry, origin, seen, draws))
    }

    /// Radiance that a surface emits where it was hit.
    fn emitted(&self, hit: &Hit) -> Rgb {
        let exitance = self.scene.materials[self.scene.surfaces[hit.surface as usize].material as usize].exitance;
        if hit.front { exitance * FRAC_1_PI } else { Rgb::ZERO }
    }

    /// What a hit makes of light; none where it absorbs everything.
    fn point(&self, hit: &Hit, direction: Vec3) -> Option<Point> {
        let index = self.scene.surfaces[hit.surface as usize].material as usize;
        let material = &self.scene.materials[index];
        if !hit.front && !material.two_sided {
            return None;
        }
        let colored = self.scene.base_color(hit.surface, hit.uv.x, hit.uv.y);
        let colored = colored.and_then(|color| material.reflector.with_base_color(color));
        let reflector = colored.unwrap_or_else(|| Arc::clone(&material.reflector));
        let diffuse = reflector.diffuse();
        let albedo = self.albedos[index];
        let chances = [diffuse.max_element(), albedo, reflector.mirror().max_element()];
        let total: f32 = chances.iter().sum();
        if total <= 0.0 {
            return None;
        }
        let side = if hit.front { 1.0 } else { -1.0 };
        let away = -direction;
        let shading = self.shading_normal(hit) * side;
        let facing = shading.dot(away);
        let normal = if facing >= GRAZING { shading } else { (shading + away * (GRAZING - facing)).normalize_or(away) };
        let true_normal = hit.normal * side;
        // Without shading normals the true one is right also at grazing directions.
        let flat = self.scene.surfaces[hit.surface as usize].shading_normals.is_none();
        let place = Frame::along(hit.point, if flat { true_normal } else { normal }, reflector.grain());
        Some(Point {
            position: hit.point,
            surface: hit.surface,
            true_normal,
            outgoing: place.local(away),
            place,
            reflector,
            diffuse,
            chances: chances.map(|chance| chance / total),
            albedo,
            rays: 1.0,
        })
    }

    /// Unit shading normal on the front.
    fn shading_normal(&self, hit: &Hit) -> Vec3 {
        let Some(normals) = &self.scene.surfaces[hit.surface as usize].shading_normals else { return hit.normal };
        let weights = self.visibility.geometries()[hit.surface as usize].corner_weights(hit.uv);
        let normal: Vec3 = normals.iter().zip(weights).map(|(n, w)| *n * w).sum();
        normal.try_normalize().unwrap_or(hit.normal)
    }

    /// Radiance that a point reflects of the light of one emitter. It is picked from a few candidates by what they
    /// would send with what is known of their visibility, so that near lamps win over strong ones (Talbot, Cline, Egbert, "Importance
    /// Resampling for Global Illumination", EGSR 2005); the candidates are stratified by power, or by what is known of
    /// the emitters `nearby`.
    fn direct(
        &self,
        point: &Point,
        [choice, mut pick]: [f32; 2],
        place: Vec2,
        known: &dyn Known,
        nearby: Option<&Nearby>,
        bounce: u32,
    ) -> Rgb {
        let geometries = self.visibility.geometries();
        let (mut best, mut total) = (None, 0.0);
        for i in 0..CANDIDATES {
            let (choice, place) = ((choice + i as f32) / CANDIDATES as f32, (place + STEP * i as f32).fract());
            let Some(arrival) = self.emitters.draw(geometries, point.position, choice, place, nearby) else { continue };
            let light = point.reflected(&arrival) * arrival.irradiance;
            let strength = light.abs().element_sum() * arrival.seen;
            if strength > 0.0 {
                // One of several in one pass: the new one replaces the old one by its share of the sum so far, and what
                // is left of the random number serves the next.
                total += strength;
                let share = strength / total;
                if pick < share {
                    best = Some((arrival, light / strength));
                    pick /= share;
                } else {
                    pick = (pick - share) / (1.0 - share);
                }
            }
        }
        let Some((arrival, light)) = best else { return Rgb::ZERO };
        let light = light * (total / CANDIDATES as f32);
        if let Some((entry, believed)) = arrival.glow {
            let (origin, direction) = (point.position, arrival.direction);
            let met = self.visibility.closest_except(origin, direction, START, f32::MAX, point.surface);
            let Some(hit) = met.filter(|hit| known.glowing(hit) == Some(entry)) else { return Rgb::ZERO };
            let found = known.end(&Ray { hit: &hit, direction, density: 0.0, bounce: bounce + 1 });
            return found.map_or(Rgb::ZERO, |found| light * found / believed);
        }
        let ends = [point.surface, arrival.surface.unwrap_or(NO_BLOCKER)];
        let blocked = self.visibility.occluded(point.position, arrival.from, ends, &mut { NO_BLOCKER });
        if blocked { Rgb::ZERO } else { light }
    }

    /// Radiance that a point reflects of the light of one emitter of each group. The strongest few are looked at, were nothing
    /// between, of the others one here and there.
    fn direct_of_groups(&self, point: &Point, choice: Vec2, place: Vec2) -> Rgb {
        let geometries = self.visibility.geometries();
        let mut lights = [None; MOST_GROUPS];
        for (number, arrival) in self.emitters.draw_of_groups(geometries, point.position, choice.y, place) {
            let light = point.reflected(&arrival) * arrival.irradiance;
            let strength = light.abs().element_sum();
            lights[number] = (strength > 0.0).then_some((arrival, light, strength));
        }
        let total: f32 = lights.iter().flatten().map(|(.., strength)| strength).sum();
        let mut sum = Rgb::ZERO;
        for (number, (arrival, light, strength)) in lights.iter().flatten().enumerate() {
            let chance = (CANDIDATES as f32 * strength / total).min(1.0);
            if (choice.x + STEP.x * number as f32).fract() >= chance {
                continue;
            }
            let ends = [point.surface, arrival.surface.unwrap_or(NO_BLOCKER)];
            if !self.visibility.occluded(point.position, arrival.from, ends, &mut { NO_BLOCKER }) {
                sum += light / chance;
            }
        }
        sum
    }
}

impl Point {
    /// BRDF · cosine for light that was drawn from an emitter, each part of the BRDF weighted against the chance that
    /// a path that follows it finds the same light.
    fn reflected(&self, arrival: &Arrival) -> Rgb {
        if !self.is_lit_from(arrival.direction) {
            return Rgb::ZERO;
        }
        let incident = self.place.local(arrival.direction);
        let weight = |density: f32| power_heuristic(arrival.density, density);
        let mut brdf = self.diffuse * (FRAC_1_PI * weight(self.diffuse_density(incident)));
        if self.chances[1] > 0.0 {
            let glossy = self.reflector.glossy(incident, self.outgoing);
            brdf += glossy * weight(self.glossy_density(glossy, incident));
        }
        brdf * incident.z
    }

    /// Whether light from a direction arrives on this side.
    fn is_lit_from(&self, direction: Vec3) -> bool {
        self.cosine(direction) > 0.0 && direction.dot(self.true_normal) > 0.0
    }

    /// To the shading normal.
    fn cosine(&self, direction: Vec3) -> f32 {
        self.place.frame.z_axis.dot(direction)
    }

    /// Follows one part of the BRDF; none where it leads nowhere.
    fn step(&self, choice: f32, u: Vec2) -> Option<Step> {
        let [diffuse, glossy, mirror] = self.chances;
        let (incident, weight, density) = if choice < diffuse {
            let incident = cosine_hemisphere(u);
            (incident, self.diffuse / diffuse, self.diffuse_density(incident))
        } else if choice < diffuse + glossy {
            let sample = self.reflector.sample(self.outgoing, u)?;
            let value = self.reflector.glossy(sample.incident, self.outgoing);
            (sample.incident, sample.weight / glossy, self.glossy_density(value, sample.incident))
        } else {
            let incident = Vec3::new(-self.outgoing.x, -self.outgoing.y, self.outgoing.z);
            (incident, self.reflector.mirror() / mirror, f32::INFINITY)
        };
        let direction = (self.place.frame * incident).try_normalize()?;
        let goes_on = weight.is_finite() && weight != Rgb::ZERO && direction.dot(self.true_normal) > 0.0;
        goes_on.then_some(Step { direction, weight, density })
    }

    fn diffuse_density(&self, incident: Vec3) -> f32 {
        self.chances[0] * incident.z * FRAC_1_PI
    }

    /// Of a direction for which the glossy part of the BRDF is `glossy`.
    fn glossy_density(&self, glossy: Rgb, incident: Vec3) -> f32 {
        self.rays * self.chances[1] * glossy.abs().max_element() * incident.z / self.albedo
    }
}

/// Weight of a sample of density `own` where `other` is that of another way to draw it (exponent 2). The weights of
/// both add up to 1; an infinite density takes all.
#[must_use]
pub fn power_heuristic(own: f32, other: f32) -> f32 {
    if own.is_infinite() {
        return 1.0;
    }
    let ratio = other / own;
    if ratio.is_nan() { 0.0 } else { (1.0 + ratio * ratio).recip() }
}

/// A direction of density cos/π (Malley's method).
#[must_use]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let (sin, cos) = (2.0 * PI * u.x).sin_cos();
    let radius = u.y.sqrt();
    Vec3::new(radius * cos, radius * sin, (1.0 - u.y).sqrt())
}

//! The glossy light field: illumination samples in, directional distributions out, through the hooks alone.

mod albedos;
mod around;

use crate::Rgb;
use crate::basis::{Basis, Beyond, Known, Peak, Superposition, Support};
use crate::haar::{Haar, Refinement};
use crate::outgoing::{Focus, Outgoing, SHOWN_COSINE};
use crate::reflector::{Incident, Reflector, Ward};
use crate::samples::{
    IlluminationSample, LEAST_COSINE, Place, SampleSet, arriving_as, brought, hidden, look_again, merge_close,
    merge_weak,
};
use albedos::Albedos;
use glam::Vec3;
use hr_diffuse::hooks::TYPICAL_LOBE;
use hr_diffuse::{Arrived, Cone, Hierarchy, LightField, NodeId, Transfer};
use std::borrow::Cow;
use std::cell::Cell;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

/// Direction for which a lobe is typical: 37° off the normal.
const TYPICAL: Vec3 = Vec3::new(0.6, 0.0, 0.8);
/// In light transport lobes are at least as wide as a disk of this angular radius (radians, 1.7°): what distributions of level 6
/// resolve. Narrower ones are followed by rays at display.
const NARROWEST: f32 = 0.03;
/// Triangles that are no wider than this share of the finest detail are not divided: at their corners and in their middles
/// a disk of that radius is met several times.
const FINEST: f32 = 0.85;
/// A lobe this many times wider than a sender hardly shows the sender's extent: its variance grows by 1/32.
const WIDE: f32 = 4.0;
/// Slope of the lobe that stands for a perfect mirror in light transport.
const MIRROR_ALPHA: f32 = 0.03;
/// A leaf's glossy part reflects no more than this times its mean albedo: directions differ, and a smooth dielectric with a white
/// diffuse part under it may reflect more than all of what grazes it. …
const MOST_GAIN: f32 = 1.15;
/// … Lobes that are narrower than this (radians) may have all that the diffuse part leaves: smooth dielectrics reflect many times
/// their mean of what grazes them, and do so where it can be seen; rough ones spread it along the surface.
const SMOOTH: f32 = 0.3;
/// Distributions that have less power than this share of what the mean albedo makes of an irradiance are not scaled to all they lack.
const LEAST_POWER: f32 = 0.25;
/// A distribution is scaled up by at most this to add up to what the samples make: one that has missed its lobes shows none.
const MOST_SCALE: f32 = 2.0;
/// Samples are scaled up by at most this to add up to a leaf's irradiance.
const MOST_BALANCE: f32 = 4.0;
/// Places of a leaf whose normals differ by more than this (radians) from that of its middle see more than the middle does.
const AROUND: f32 = 0.3;
/// Samples that are merged since they are weak make up at most so many times the error asked for of the irradiance at a place…
const WEAK_PER_ERROR: f32 = 3.0;
/// … and never more than this share.
const WEAK_SHARE: f32 = 0.3;
/// Those stay as they are that make lobes that are at least so many times the error asked for as bright as all other light.
const BRIGHT: f32 = 2.0;
/// The same, so many times as bright, where all that is around is mirrored in what is round, each thing in a small part of it.
const BRIGHT_AROUND: f32 = 8.0;
/// Of a leaf's samples, the directions of so many strongest ones are told to the projection as peaks.
const PEAKS: usize = 12;
/// Peaks are found with others that are no more than so many times as wide.
const AS_WIDE: f32 = 1.2;

/// Distributions that have more power than this share beyond what they should are corrected where they are coarse before they are scaled.
const UNNOTICED: f32 = 0.01;

/// Reflectances and shares of radiances that are clamped by less are approximations, and not counted.
const CLAMPED: f32 = 0.01;

/// An albedo that a surface can have beside a diffuse reflectance: what is no number is 0.
fn possible(albedo: Rgb, diffuse: Rgb) -> Rgb {
    let channel = |albedo: f32, diffuse: f32| albedo.min(1.0 - diffuse).max(0.0);
    let known = Rgb::select(albedo.is_nan_mask(), Rgb::ZERO, albedo);
    Rgb::new(channel(known.x, diffuse.x), channel(known.y, diffuse.y), channel(known.z, diffuse.z))
}

/// How one material's light is transported.
#[derive(Clone, Debug)]
struct Material {
    reflector: Arc<dyn Reflector>,
    /// Stands for the perfect mirror that is part of the reflector.
    mirror: Option<Ward>,
    /// What is reflected beside the diffuse part.
    albedo: Rgb,
    /// Width of its lobe (radians).
    width: f32,
    /// The same by direction, for those that any light reaches.
    albedos: OnceLock<Albedos>,
}

/// Work counters.
#[derive(Debug, Default)]
pub struct Counters {
    evaluations: AtomicU64,
    samples: AtomicU64,
    clamped: AtomicU64,
    spared: AtomicU64,
    interpolated: AtomicU64,
}

/// Counts on from where they are.
impl Clone for Counters {
    fn clone(&self) -> Self {
        let counters = Self::default();
        counters.take_over(self.counts());
        counters
    }
}

impl Counters {
    /// All of them, to be kept.
    pub(crate) fn counts(&self) -> [u64; 5] {
        [&self.evaluations, &self.samples, &self.clamped, &self.spared, &self.interpolated]
            .map(|counter| counter.load(Ordering::Relaxed))
    }

    /// Takes over those of a solution that was kept.
    pub(crate) fn take_over(&self, [evaluations, samples, clamped, spared, interpolated]: [u64; 5]) {
        self.evaluations.store(evaluations, Ordering::Relaxed);
        self.samples.store(samples, Ordering::Relaxed);
        self.clamped.store(clamped, Ordering::Relaxed);
        self.spared.store(spared, Ordering::Relaxed);
        self.interpolated.store(interpolated, Ordering::Relaxed);
    }

    /// BRDF evaluations so far: one per sample and direction.
    #[must_use]
    pub fn brdf_evaluations(&self) -> u64 {
        self.evaluations.load(Ordering::Relaxed)
    }

    /// Samples reflected so far.
    #[must_use]
    pub fn samples_reflected(&self) -> u64 {
        self.samples.load(Ordering::Relaxed)
    }

    /// Triangles of directions that were not divided since what differs over them is
    /// [negligible](hr_diffuse::Arrived::negligible): detail that was skipped.
    #[must_use]
    pub fn negligible_detail(&self) -> u64 {
        self.spared.load(Ordering::Relaxed)
    }

    /// Samples that were not reflected to a direction since what they make there is known from directions around it: BRDF evaluations
    /// that were skipped.
    #[must_use]
    pub fn interpolated(&self) -> u64 {
        self.interpolated.load(Ordering::Relaxed)
    }

    /// How often a reflector did what none can, and was overruled: radiances that were not finite, which became 0, or
    /// negative together with the diffuse part, which became 0 together with it; and albedos that were no number, negative
    /// or above 1 (by more than a hundredth) together with the diffuse part, which were clamped. 0 with reflectors that
    /// pass [`conformance::check`](crate::conformance::check).
    #[must_use]
    pub fn clamped(&self) -> u64 {
        self.clamped.load(Ordering::Relaxed)
    }
}

/// Glossy reflection for an engine: implements its hooks. Outgoing light is represented in the basis `B`.
///
/// Reflectors are not trusted: what no surface can do is clamped and [counted](Counters::clamped), so that a wrong one
/// shows in its own place and never spoils the solution.
#[derive(Clone, Debug)]
pub struct GlossyField<B: Basis = Haar> {
    /// `None`: the material is diffuse.
    materials: Vec<Option<Material>>,
    settings: B::Settings,
    /// Whether what the host says of errors and of what is negligible makes no difference.
    alone: bool,
    counters: Counters,
}

impl GlossyField {
    /// For the materials of a scene, by index. Those whose reflector is diffuse take no part. Outgoing light is
    /// represented in the adaptive Haar basis.
    #[must_use]
    pub fn new(reflectors: &[Arc<dyn Reflector>], refinement: Refinement) -> Self {
        Self::in_basis(reflectors, refinement)
    }
}

impl<B: Basis> GlossyField<B> {
    /// As [`new`](GlossyField::new), in any basis.
    #[must_use]
    pub fn in_basis(reflectors: &[Arc<dyn Reflector>], settings: B::Settings) -> Self {
        let counters = Counters::default();
        let materials = reflectors.iter().map(|reflector| {
            (!reflector.is_diffuse()).then(|| {
                let mirror = reflector.mirror();
                let stated = reflector.glossy_albedo() + mirror;
                let albedo = possible(stated, reflector.diffuse());
                if (stated - albedo).abs().cmpgt(Rgb::splat(CLAMPED)).any() || !stated.is_finite() {
                    counters.clamped.fetch_add(1, Ordering::Relaxed);
                }
                Material {
                    reflector: Arc::clone(reflector),
                    mirror: (mirror.max_element() > 0.0)
                        .then(|| Ward::new(Rgb::ZERO, mirror, MIRROR_ALPHA).ok())
                        .flatten(),
                    albedo,
                    width: reflector.lobe(TYPICAL).width,
                    albedos: OnceLock::new(),
                }
            })
        });
        let materials = materials.collect();
        Self { materials, settings, alone: false, counters }
    }

    /// Refines distributions by their settings alone, whatever the host says of errors and of what is negligible: independently of space, to
    /// be compared with. The light is the same; it takes several times the memory.
    #[must_use]
    pub fn refined_alone(self) -> Self {
        Self { alone: true, ..self }
    }

    /// Work done so far.
    #[must_use]
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    fn material(&self, material: Option<u32>) -> Option<&Material> {
        self.materials.get(material? as usize)?.as_ref()
    }

    /// What a leaf is about to reflect; arguments as those of [`LightField::reflect`]. `None` where nothing arrives or the
    /// material is diffuse.
    #[must_use]
    pub fn reflection<H: Hierarchy>(
        &self,
        hierarchy: &H,
        leaf: NodeId,
        path: &[&SampleSet],
        arrived: Arrived,
    ) -> Option<Reflection<'_>> {
        let material = self.material(hierarchy.material(leaf))?;
        let arrived = if self.alone { Arrived { negligible: 0.0, error: 1.0, ..arrived } } else { arrived };
        let (center, normals) = (hierarchy.center(leaf), hierarchy.normals(leaf));
        let width = material.width;
        // Normals that turn by an angle turn what is reflected by twice as much.
        let narrowest = (2.0 * arrived.spread).clamp(NARROWEST, FRAC_PI_2);
        // A lobe that is not round is narrower one way; a mirror shows everything.
        let is_wide = material.mirror.is_none() && material.reflector.grain().is_none();
        // A disk has half its radius as standard deviation; what has a width of its own needs to be widened the less.
        let own = if is_wide { 2.0 * width } else { 0.0 };
        let lacks = (NARROWEST * NARROWEST - own * own).max(0.0).sqrt();
        let least_extent = lacks.max(2.0 * arrived.spread).min(FRAC_PI_2);
        let close = if is_wide { width.max(narrowest) } else { narrowest };
        let flat = hierarchy.is_flat(leaf);
        // What goes on to other leaves is spread by how far away they are; only who looks at a highlight sees its edge.
        let error = if arrived.shown { arrived.error } else { 1.0 };
        let around = arrived.shown && !flat && normals.angle() > AROUND;
        let bright = BRIGHT * error * if around { BRIGHT_AROUND } else { 1.0 };
        let (looks, mean) = (arrived.shown && flat, material.mean(&arrived));
        let peak = |sample: &Incident| material.peak(sample, width.max(narrowest)) / mean;
        let arrive = |normal: Vec3, irradiance: Option<Rgb>| {
            let place = Place::along(center, normal, material.reflector.grain());
            let (mut incident, mut doubtful) = (Vec::new(), Vec::new());
            arriving_as(hierarchy, (leaf, path), &place, true, &mut incident, |origin, samples| {
                if irradiance.is_some() {
                    doubtful.extend(brought(hierarchy, leaf, (&origin, samples), peak).filter(|_| looks));
                }
            });
            if let Some(irradiance) = irradiance {
                balance(&mut incident, irradiance);
            }
            if looks {
                hidden(hierarchy, (leaf, &place), (peak, error), &mut incident, &mut doubtful);
            }
            look_again(hierarchy, leaf, &doubtful, error, &mut incident);
            merge_close(&mut incident, close);
            let focus = Focus::of(&incident, &place.frame, hierarchy.radius(leaf));
            let share = WEAK_SHARE.min(WEAK_PER_ERROR * arrived.error);
            merge_weak(&mut incident, width.max(narrowest), share, |sample| peak(sample) >= bright);
            // Extents matter beside the lobe's own width only; without one a sample is reflected several times faster.
            for sample in &mut incident {
                sample.widen(if width < WIDE * narrowest { least_extent } else { 0.0 });
                if sample.reach() * WIDE < width {
                    sample.shrink();
                }
            }
            (place, incident, focus)
        };
        let (place, mut incident, focus) = arrive(normals.axis, (!around).then_some(arrived.irradiance));
        if around {
            let (below, lower, _) = arrive(-normals.axis, None);
            incident = around::all(incident, lower, |direction| place.local(below.frame * direction));
        }
        if incident.is_empty() {
            return None;
        }
        // A glossy part may be negative where the diffuse one overestimates; both together are not.
        let (least, negligible) = (-arrived.diffuse, arrived.negligible);
        Some(Reflection { material, place, incident, focus, width, narrowest, flat, around, least, negligible, error })
    }

    /// Represents what a leaf reflects in the basis.
    #[must_use]
    pub fn project(&self, reflection: &Reflection<'_>) -> B {
        let mut peaks = peaks(reflection);
        let mut evaluations = 0;
        if reflection.negligible > 0.0 {
            evaluations = peaks.len();
            peaks.retain(|peak| reflection.toward(peak.direction).abs().max_element() > reflection.negligible);
        }
        let known = Known {
            support: Some(reflection.support()),
            offset: -reflection.least,
            peaks: &peaks,
            finest: FINEST * reflection.narrowest,
            negligible: reflection.negligible,
            error: reflection.error,
        };
        let lobes = Lobes { reflection, overruled: Cell::new(0) };
        let projected = B::project_sum(&self.settings, &known, &lobes);
        let count = reflection.incident.len() as u64;
        let evaluations = evaluations as u64 * count + projected.terms as u64;
        self.counters.evaluations.fetch_add(evaluations, Ordering::Relaxed);
        self.counters.interpolated.fetch_add(projected.interpolated as u64, Ordering::Relaxed);
        self.counters.spared.fetch_add(projected.spared as u64, Ordering::Relaxed);
        self.counters.samples.fetch_add(count, Ordering::Relaxed);
        self.counters.clamped.fetch_add(lobes.overruled.get() + projected.not_finite as u64, Ordering::Relaxed);
        projected.distribution
    }

    /// The reflector of a material that takes part.
    #[must_use]
    pub fn reflector(&self, material: u32) -> Option<&Arc<dyn Reflector>> {
        self.material(Some(material)).map(|m| &m.reflector)
    }
}

impl Material {
    /// Light that a place sends toward a local direction, lobes widened to what transport resolves.
    fn reflect(&self, incident: &[Incident], outgoing: Vec3) -> Rgb {
        let mut light = self.reflector.reflect_sum(incident, outgoing);
        if let Some(mirror) = &self.mirror {
            light += mirror.reflect_sum(incident, outgoing);
        }
        light
    }

    /// What each sample makes of it.
    fn reflect_each(&self, incident: &[Incident], outgoing: Vec3, reflected: &mut [Rgb]) {
        self.reflector.reflect_each(incident, outgoing, reflected);
        if let Some(mirror) = &self.mirror {
            let mut mirrored = vec![Rgb::ZERO; reflected.len()];
            mirror.reflect_each(incident, outgoing, &mut mirrored);
            std::iter::zip(reflected, mirrored).for_each(|(light, mirrored)| *light += mirrored);
        }
    }

    /// About the radiance of a sample's lobe of some width at its brightest, sum of channels.
    fn peak(&self, sample: &Incident, width: f32) -> f32 {
        let across = (self.albedo * sample.irradiance).element_sum() * FRAC_1_PI;
        across / (sample.direction.z.max(LEAST_COSINE) * (sample.extent * sample.extent + width * width))
    }

    /// Mean radiance of a leaf, sum of channels.
    fn mean(&self, arrived: &Arrived) -> f32 {
        (arrived.diffuse + self.albedo * arrived.irradiance * FRAC_1_PI).element_sum().max(f32::MIN_POSITIVE)
    }

    /// Radiosity beside the diffuse one that samples make, whatever direction it leaves in.
    fn reflected(&self, incident: &[Incident]) -> Rgb {
        let albedos = self.albedos.get_or_init(|| Albedos::new(&*self.reflector));
        let irradiance: Rgb = incident.iter().map(|sample| sample.irradiance).sum();
        albedos.reflected(incident) + self.reflector.mirror() * irradiance
    }
}

/// The strongest of the lobes that the samples make, in world directions: parts of one lamp make one of them.
fn peaks(reflection: &Reflection<'_>) -> Vec<Peak> {
    let Reflection { material, place, incident, narrowest, .. } = reflection;
    let mut strongest: Vec<&Incident> = incident.iter().filter(|i| reflection.around || i.direction.z > 0.05).collect();
    let strength = |i: &Incident| i.irradiance.max_element() / (i.extent * i.extent + 1e-4);
    strongest.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
    let mut peaks: Vec<Peak> = Vec::with_capacity(PEAKS);
    for sample in strongest {
        // By reciprocity the lobe of the incident direction is where it is reflected to.
        let lobe = material.reflector.lobe(sample.direction.with_z(sample.direction.z.abs()));
        let mirrored = Vec3::new(-sample.direction.x, -sample.direction.y, sample.direction.z);
        let (direction, width) = if reflection.around {
            (mirrored, lobe.width)
        } else if material.mirror.is_some() {
            (mirrored, MIRROR_ALPHA)
        } else {
            (lobe.direction.try_normalize().unwrap_or(mirrored), lobe.width)
        };
        let peak = Peak { direction: place.frame * direction, width: width.max(*narrowest).max(sample.extent) };
        if !peaks.iter().any(|other| is_found(&peak, other)) {
            peaks.push(peak);
        }
        if peaks.len() == PEAKS {
            break;
        }
    }
    peaks
}

/// Whether a projection that looks closely at one peak finds another one, too.
fn is_found(peak: &Peak, with: &Peak) -> bool {
    with.width <= AS_WIDE * peak.width && with.direction.dot(peak.direction) > with.width.min(FRAC_PI_2).cos()
}

/// Scales samples, each renewed for a place on its own, so that together they are the irradiance that arrived there.
fn balance(incident: &mut [Incident], irradiance: Rgb) {
    let sum: f32 = incident.iter().map(|i| i.irradiance.element_sum()).sum();
    if sum > 0.0 {
        let scale = (irradiance.element_sum() / sum).min(MOST_BALANCE);
        for sample in incident {
            sample.irradiance *= scale;
        }
    }
}

/// What a leaf reflects of the samples that arrive at it, before it is projected: a function of the direction.
#[derive(Debug)]
pub struct Reflection<'a> {
    material: &'a Material,
    place: Place,
    incident: Vec<Incident>,
    focus: Focus,
    /// Of the lobe (radians).
    width: f32,
    /// Detail finer than this (radians) is lost.
    narrowest: f32,
    /// Whether it is radiance rather than intensity per area.
    flat: bool,
    /// Whether all around counts, for places with normals of their own: see [`around`].
    around: bool,
    /// No less than what cancels the diffuse part.
    least: Rgb,
    /// What differs by less is not looked at, in the unit of the distribution.
    negligible: f32,
    /// As in [`Known`].
    error: f32,
}

impl Reflection<'_> {
    /// The leaf's middle and its frame.
    #[must_use]
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// The samples, directions in the frame of the place.
    #[must_use]
    pub fn incident(&self) -> &[Incident] {
        &self.incident
    }

    /// How what it shows moves over the leaf.
    #[must_use]
    pub fn focus(&self) -> Focus {
        self.focus
    }

    /// What the leaf sends in a unit direction away from it, as [`LightField::radiance`] tells of its projection; lobes
    /// are widened to what transport resolves. Not finite where the reflector says so.
    #[must_use]
    pub fn toward(&self, direction: Vec3) -> Rgb {
        let (light, _) = self.clamped(direction, self.add_up(&self.incident, direction));
        light
    }

    /// What the reflector makes of samples toward a unit direction.
    fn add_up(&self, incident: &[Incident], direction: Vec3) -> Rgb {
        let (incident, outgoing) = self.seen(incident, direction);
        self.material.reflect(&incident, outgoing)
    }

    /// What it makes of each of them.
    fn each(&self, incident: &[Incident], direction: Vec3, reflected: &mut [Rgb]) {
        let (incident, outgoing) = self.seen(incident, direction);
        self.material.reflect_each(&incident, outgoing, reflected);
    }

    /// Samples and a unit direction in the frame in which they are reflected there.
    fn seen<'s>(&self, incident: &'s [Incident], direction: Vec3) -> (Cow<'s, [Incident]>, Vec3) {
        let outgoing = self.place.local(direction);
        if !self.around {
            return (Cow::Borrowed(incident), outgoing);
        }
        let (incident, outgoing) = around::seen(incident, outgoing);
        (Cow::Owned(incident), outgoing)
    }

    /// What the leaf sends in a unit direction if the reflector makes this of all samples, and whether it had to be overruled.
    fn clamped(&self, direction: Vec3, reflected: Rgb) -> (Rgb, bool) {
        // What is not finite the projection itself replaces and counts.
        let radiance = if reflected.is_finite() { reflected.max(self.least) } else { reflected };
        let is_clamped = (radiance - reflected).cmpgt(CLAMPED * radiance.abs()).any();
        let least = if self.around { SHOWN_COSINE } else { 0.0 };
        let cosine = self.place.normal().dot(direction).max(least);
        (if self.flat { radiance } else { radiance * cosine }, is_clamped)
    }

    /// Scales a distribution to the power that its samples make, however coarse it is, and to no more than the leaf can reflect of an
    /// irradiance: else mirrors facing each other would shine without end. What is only shown may be more.
    pub fn conserve<B: Basis>(&self, exitant: &mut B, irradiance: Rgb) {
        if self.around {
            return;
        }
        let power_of = |exitant: &B| {
            if self.flat { exitant.cosine_integral(self.place.normal()) } else { exitant.integral() }
        };
        let (mut power, mean) = (power_of(exitant), (self.material.albedo * irradiance).element_sum());
        let left = (Rgb::ONE - self.material.reflector.diffuse()).max(Rgb::ZERO);
        let grazing = if self.width < SMOOTH { (left * irradiance).element_sum() } else { 0.0 };
        let most = grazing.max(MOST_GAIN * mean);
        let made = self.material.reflected(&self.incident).element_sum().min(most);
        let excess = power.element_sum() - made;
        if excess > UNNOTICED * made && power.min_element() >= 0.0 {
            let by = power * (excess / power.element_sum() / if self.flat { PI } else { 2.0 * PI });
            exitant.shrink(by * (self.negligible / by.max_element()).min(1.0));
            power = power_of(exitant);
        }
        let power = power.element_sum();
        // What is above zero here and below zero there may add up to next to nothing, of which no share is known.
        let scale = 1.0 + (made - power) / power.max(LEAST_POWER * mean);
        if power > 0.0 && scale > 0.0 {
            exitant.scale(scale.min(MOST_SCALE));
        }
    }

    /// Where it is not zero.
    fn support(&self) -> Support {
        if self.around {
            return Support { cone: Cone::SPHERE, beyond: Beyond::Continued };
        }
        Support {
            cone: Cone { axis: self.place.normal(), cos_angle: 1e-3 },
            beyond: if self.flat { Beyond::Continued } else { Beyond::Zero },
        }
    }
}

/// The lobes that samples make, as a sum to be projected.
struct Lobes<'a> {
    reflection: &'a Reflection<'a>,
    /// How often the reflector was.
    overruled: Cell<u64>,
}

impl Superposition for Lobes<'_> {
    type Term = Incident;

    fn terms(&self) -> &[Incident] {
        &self.reflection.incident
    }

    fn peak(&self, sample: &Incident) -> Peak {
        let Reflection { place, width, .. } = self.reflection;
        let mirrored = Vec3::new(-sample.direction.x, -sample.direction.y, sample.direction.z);
        Peak { direction: place.frame * mirrored, width: width.max(sample.extent) }
    }

    fn add_up(&self, samples: &[Incident], direction: Vec3) -> Rgb {
        self.reflection.add_up(samples, direction)
    }

    fn each(&self, samples: &[Incident], direction: Vec3, values: &mut [Rgb]) {
        self.reflection.each(samples, direction, values);
    }

    fn value(&self, direction: Vec3, sum: Rgb) -> Rgb {
        let (light, is_clamped) = self.reflection.clamped(direction, sum);
        self.overruled.set(self.overruled.get() + u64::from(is_clamped));
        light
    }
}

impl<B: Basis> LightField for GlossyField<B> {
    type Incident = SampleSet;
    type Exitant = Outgoing<B>;

    fn active(&self, material: u32) -> Option<Rgb> {
        self.material(Some(material)).map(|m| m.albedo)
    }

    fn directional_albedo(&self, material: u32, cosine: f32) -> Option<Rgb> {
        let direction = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
        let incident = Incident { direction, irradiance: Rgb::ONE, ..Incident::default() };
        self.material(Some(material)).map(|material| material.reflected(&[incident]))
    }

    /// Of lobes narrower than light transport resolves nothing is told: they are followed by rays at display, and finer links would show
    /// nowhere.
    fn lobe_width(&self, material: u32) -> Option<f32> {
        let width = self.material(Some(material))?.width;
        Some(if width < NARROWEST { TYPICAL_LOBE } else { width })
    }

    fn incident_bytes(&self, incident: &SampleSet) -> usize {
        size_of_val(&**incident)
    }

    fn exitant_bytes(&self, exitant: &Outgoing<B>) -> usize {
        exitant.bytes() - size_of::<B>()
    }

    fn clear(&self, incident: &mut SampleSet) {
        incident.clear();
    }

    fn receive(&self, incident: &mut SampleSet, transfer: &Transfer) {
        debug_assert_eq!(transfer.fault(), None, "the host keeps to what the hooks ask for: {transfer:?}");
        incident.push(IlluminationSample::new(transfer));
    }

    fn reflect<H: Hierarchy>(&self, hierarchy: &H, leaf: NodeId, path: &[&SampleSet], arrived: Arrived) -> Outgoing<B> {
        debug_assert_eq!(arrived.fault(), None, "the host keeps to what the hooks ask for: {arrived:?}");
        debug_assert!(!path.is_empty(), "the path of leaf {} has the leaf itself in it", leaf.0);
        let Some(reflection) = self.reflection(hierarchy, leaf, path, arrived) else { return Outgoing::default() };
        let mut distribution = self.project(&reflection);
        reflection.conserve(&mut distribution, arrived.irradiance);
        Outgoing { distribution, focus: reflection.focus }
    }

    fn radiance(&self, exitant: &Outgoing<B>, away: Vec3) -> Rgb {
        exitant.eval(away)
    }

    fn radiance_beside(&self, exitant: &Outgoing<B>, (normal, offset): (Vec3, Vec3), away: Vec3) -> Rgb {
        let from_middle = exitant.focus.from_middle(offset, -away.reflect(normal));
        exitant.eval(-from_middle.reflect(normal))
    }

    fn radiance_bounds(&self, exitant: &Outgoing<B>, away: &Cone) -> (Rgb, Rgb) {
        exitant.bounds(away)
    }
}

#[cfg(test)]
mod tests;

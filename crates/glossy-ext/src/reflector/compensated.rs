//! Metallic-roughness with all the light that microfacets pass on.

use super::error::clamped;
use super::generic::albedo_by_samples;
use super::ggx::{directional_albedo, mean_fresnel};
use super::half_vector::cosine_range;
use super::metallic_roughness::DIELECTRIC_F0;
use super::{Formula, HORIZON, Incident, LOSSES, Lobe, MetallicRoughness, Reflector, Sample, above, cosine_hemisphere};
use glam::{Vec2, Vec3};
use hr_diffuse::{Cone, Rgb};
use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

/// [`MetallicRoughness`] with compensation for what its single-scattering lobe loses and its diffuse term gains:
///
/// f = lobe + m (1 − E(i)) (1 − E(o)) / (π (1 − Ē)) + (1 − metallic) base (1 − D(i)) (1 − D(o)) / (π (1 − D̄)).
///
/// - E is the lobe's directional albedo without Fresnel factor, Ē its cosine-weighted mean; the second term is what
///   leaves after more than one reflection (Kulla and Conty, "Revisiting Physically Based Shading at Imageworks",
///   SIGGRAPH 2017 course). m = F̄² Ē / (1 − F̄ (1 − Ē)) is the reflectance of all further bounces, F̄ the
///   cosine-weighted mean of Fresnel's factor, for the dielectric and the metal each, mixed by `metallic`.
/// - D is the directional albedo of the dielectric's first two terms. The diffuse term gets what they leave, in both
///   directions (Kelemen and Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model with Importance
///   Sampling", Eurographics 2001 short papers).
///
/// The albedo of a white surface, metal or not, is 1 in every direction, and no other exceeds it; it is reciprocal.
#[derive(Clone, Debug)]
pub struct Compensated {
    /// The lobe, without the diffuse term.
    single: MetallicRoughness,
    /// Reflectance of further bounces, m / (π (1 − Ē)).
    further: Rgb,
    /// (1 − metallic) base / (π (1 − D̄)).
    matte: Rgb,
    losses: Arc<Losses>,
}

/// What is left of 1 beside directional albedos of one roughness, by the cosine.
#[derive(Debug)]
struct Losses {
    /// (1 − E, 1 − D) at the squares of 0…1 in equal steps.
    table: [Vec2; NODES],
    /// Cosine-weighted means.
    mean: Vec2,
}

/// Fresnel's factor changes fastest at grazing directions: 33 squares leave 10⁻³ at most between them.
const NODES: usize = LOSSES;

/// Squared, values for each node.
const CELLS: usize = 24;

/// How often [`Reflector::sample`] draws by the cosine, for all but the lobe.
const COSINE_SHARE: f32 = 0.3;

/// A loss that is smaller is rounding: where nothing is lost nothing is to be compensated.
const LEAST_LOSS: f32 = 1e-4;

/// F̄² Ē / (1 − F̄ (1 − Ē)), of the flux that the first bounce loses the share that leaves later.
fn further_bounces(fresnel: Rgb, loss: f32) -> Rgb {
    fresnel * fresnel * (1.0 - loss) / (Rgb::ONE - fresnel * loss)
}

impl Losses {
    fn new(alpha: f32) -> Self {
        let albedos: [Vec2; NODES] = std::array::from_fn(|k| {
            let x = k as f32 / (NODES - 1) as f32;
            directional_albedo(alpha, (x * x).max(1e-4), CELLS)
        });
        let of = |f: &dyn Fn(Vec2) -> f32| Losses { table: albedos.map(|a| Vec2::splat(1.0 - f(a))), mean: Vec2::ZERO };
        let single = of(&|a| a.x).mean_of_table().x.max(0.0);
        let m = further_bounces(Rgb::splat(mean_fresnel(DIELECTRIC_F0)), single).x;
        let table = albedos.map(|a| {
            let loss = (1.0 - a.x).max(0.0);
            let dielectric = DIELECTRIC_F0 * (a.x - a.y) + a.y + m * loss;
            Vec2::new(loss, (1.0 - dielectric).max(0.0))
        });
        let losses = Self { table, mean: Vec2::ZERO };
        Self { mean: losses.mean_of_table(), ..losses }
    }

    /// Losses at a cosine.
    #[inline]
    fn at(&self, cos: f32) -> Vec2 {
        let x = cos.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32;
        let k = (x as usize).min(NODES - 2);
        self.table[k].lerp(self.table[k + 1], x - k as f32)
    }

    /// ∫ 2 μ (…) dμ, of the table as it is interpolated.
    fn mean_of_table(&self) -> Vec2 {
        const STEPS: usize = 512;
        let cosines = (0..STEPS).map(|k| ((k as f32 + 0.5) / STEPS as f32).sqrt());
        cosines.map(|cos| self.at(cos)).sum::<Vec2>() / STEPS as f32
    }
}

impl Compensated {
    pub(super) fn new(single: MetallicRoughness) -> Self {
        let losses = Arc::new(Losses::new(single.alpha));
        Self::with_losses(single, losses)
    }

    fn with_losses(single: MetallicRoughness, losses: Arc<Losses>) -> Self {
        let MetallicRoughness { base, metallic, .. } = single;
        let loss = losses.mean;
        let of = |f0: Rgb| further_bounces(f0.map(mean_fresnel), loss.x);
        let m = of(Rgb::splat(DIELECTRIC_F0)) * (1.0 - metallic) + of(base) * metallic;
        let per = |loss: f32| if loss > LEAST_LOSS { FRAC_1_PI / loss } else { 0.0 };
        let (further, matte) = (m * per(loss.x), base * ((1.0 - metallic) * per(loss.y)));
        Self { single: single.without_diffuse(), further, matte, losses }
    }

    /// Calls `each` with the place of every sender that is above the horizon and what its irradiance is multiplied by.
    #[inline]
    fn reflect_with(&self, incident: &[Incident], outgoing: Vec3, mut each: impl FnMut(usize, Rgb)) {
        let out = self.losses.at(outgoing.z);
        // Losses are almost linear in the cosine over any disk.
        self.single.reflect_with(incident, outgoing, |k, lobe, mean_cos| each(k, lobe + self.rest(mean_cos, out)));
    }

    /// The terms beside the lobe, less the Lambertian share.
    #[inline]
    fn rest(&self, cos_i: f32, out: Vec2) -> Rgb {
        let product = self.losses.at(cos_i) * out;
        self.further * product.x + self.matte * (product.y - self.losses.mean.y * self.losses.mean.y)
    }
}

impl Reflector for Compensated {
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        if above(incident) && above(outgoing) {
            let product = self.losses.at(incident.z) * self.losses.at(outgoing.z);
            self.single.glossy(incident, outgoing) + self.further * product.x + self.matte * product.y
        } else {
            Rgb::ZERO
        }
    }

    /// Mean of the diffuse term: (1 − metallic) base (1 − D̄).
    fn diffuse(&self) -> Rgb {
        self.matte * (PI * self.losses.mean.y * self.losses.mean.y)
    }

    fn glossy(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        self.glossy_toward_extent(incident, outgoing, 0.0)
    }

    fn glossy_toward_extent(&self, incident: Vec3, outgoing: Vec3, extent: f32) -> Rgb {
        let sender = Incident { direction: incident, extent, irradiance: Rgb::ONE, ..Incident::default() };
        self.reflect_sum(&[sender], outgoing)
    }

    fn reflect_sum(&self, incident: &[Incident], outgoing: Vec3) -> Rgb {
        let mut sum = Rgb::ZERO;
        self.reflect_with(incident, outgoing, |k, factor| sum += incident[k].irradiance * factor);
        sum
    }

    fn reflect_each(&self, incident: &[Incident], outgoing: Vec3, reflected: &mut [Rgb]) {
        reflected.fill(Rgb::ZERO);
        self.reflect_with(incident, outgoing, |k, factor| reflected[k] = incident[k].irradiance * factor);
    }

    fn glossy_bound(&self, incident: &Cone, outgoing: Vec3) -> f32 {
        let (low, high) = cosine_range(incident, Vec3::Z);
        if high <= HORIZON || !above(outgoing) {
            return 0.0;
        }
        let out = self.losses.at(outgoing.z);
        let step = |cos: f32| cos.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32;
        let nodes = step(low) as usize..=(step(high) as usize + 1).min(NODES - 1);
        // Between nodes the table is linear.
        let (mut most, mut least) = (Vec2::ZERO, Vec2::INFINITY);
        for k in nodes {
            most = most.max(self.losses.table[k] * out);
            least = least.min(self.losses.table[k] * out);
        }
        let mean = self.losses.mean.y * self.losses.mean.y;
        let matte = (most.y - mean).abs().max((least.y - mean).abs());
        let rest = self.further * most.x + self.matte * matte;
        self.single.glossy_bound(incident, outgoing) + rest.max_element() * 1.0001
    }

    fn glossy_albedo(&self) -> Rgb {
        // That of the diffuse term is in `diffuse`; of what the lobe loses 1 − Ē, m leaves.
        let further = self.further * (PI * self.losses.mean.x * self.losses.mean.x);
        self.single.glossy_albedo() + further
    }

    fn directional_albedo(&self, incident: Vec3) -> Rgb {
        albedo_by_samples(self, incident)
    }

    fn lobe(&self, outgoing: Vec3) -> Lobe {
        self.single.lobe(outgoing)
    }

    fn sample(&self, outgoing: Vec3, u: Vec2) -> Option<Sample> {
        if !above(outgoing) {
            return None;
        }
        if u.x >= COSINE_SHARE {
            let u = Vec2::new((u.x - COSINE_SHARE) / (1.0 - COSINE_SHARE), u.y);
            let sample = self.single.sample(outgoing, u)?;
            return Some(Sample { weight: sample.weight / (1.0 - COSINE_SHARE), ..sample });
        }
        let incident = cosine_hemisphere(Vec2::new(u.x / COSINE_SHARE, u.y));
        let rest = self.rest(incident.z, self.losses.at(outgoing.z));
        above(incident).then(|| Sample { incident, weight: rest * (PI / COSINE_SHARE) })
    }

    fn formulas(&self) -> Option<Vec<Formula>> {
        let MetallicRoughness { base, metallic, alpha, .. } = self.single;
        let losses = Box::new(self.losses.table);
        Some(vec![Formula::Compensated { base, metallic, alpha, losses, mean: self.losses.mean }])
    }

    fn with_base_color(&self, color: Rgb) -> Option<Arc<dyn Reflector>> {
        Some(Arc::new(Self::with_losses(self.single.with_base(clamped(color)), Arc::clone(&self.losses))))
    }
}

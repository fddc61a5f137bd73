//! The metallic-roughness model of glTF 2.0.

use super::error::{ReflectorError, clamped, number, reflectance};
use super::extent::{Disks, Lobes, Meeting, Meetings, ggx_over_disk};
use super::generic::albedo_by_samples;
use super::ggx::{density, distribution, draw, mean_albedo, schlick, visibility};
use super::half_vector::HalfRange;
use super::lanes::{Directions, LANES, Lanes, Number};
use super::ward::slope_to_width;
use super::{Compensated, Formula, Incident, Lobe, Reflector, Sample, above, cosine_hemisphere, mirrored};
use glam::{Vec2, Vec3};
use hr_diffuse::{Cone, Rgb};
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// The BRDF of the glTF 2.0 specification, Appendix B ("Metal BRDF and Dielectric BRDF"): with H the normalised half
/// vector, w = (1 − V·H)⁵ and α = roughness²,
///
/// f = (1 − metallic) (1 − F₀.₀₄) base/π + F D G / (4 (V·N) (L·N)),
/// Fₓ = x + (1 − x) w, F = F of x = 0.04 (1 − metallic) + base × metallic,
///
/// D the distribution of Trowbridge and Reitz (GGX), G the height-correlated masking of Smith. Nothing is added: no
/// scattering between facets. α is at least [`MIN_ALPHA`](Self::MIN_ALPHA). The specification's w for |V·H| is used.
///
/// The diffuse term is not Lambertian: F₀.₀₄ depends on V·H. [`diffuse`](Reflector::diffuse) is its mean,
/// (1 − metallic) base (1 − F̄), where F̄ is F₀.₀₄ averaged over incident and outgoing directions, both weighted by their
/// cosine: the share that reflects the same flux under uniform light. The remainder, (1 − metallic) base (F̄ − F₀.₀₄)/π,
/// is part of [`glossy`](Reflector::glossy). It is a little positive around the back-scattering direction and negative at
/// grazing forward scattering; its mean is 0.
///
/// The albedo of a bright dielectric exceeds 1 near grazing directions: the specification's diffuse term does not make
/// room for what the lobe reflects there. For white it comes to 1.85 at 89° where the surface is smooth (α = 0.001), to
/// 1.2 at 83° at roughness 0.3, to 1.02 where it is rough; the mean over directions stays below 1.01. Between facets no
/// light is passed on, so that rough metals are too dark. [`compensated`](Self::compensated) mends both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetallicRoughness {
    pub(super) base: Rgb,
    pub(super) metallic: f32,
    pub(super) alpha: f32,
    /// Reflectance along the normal.
    f0: Rgb,
    /// (1 − metallic) base/π.
    matte: Rgb,
    /// Mean albedo of the lobe without Fresnel factor, and with the factor w.
    albedo: f32,
    albedo_w: f32,
}

/// Reflectance of the dielectric along the normal.
pub(super) const DIELECTRIC_F0: f32 = 0.04;

/// w = (1 − V·H)⁵ averaged over incident and outgoing directions, both weighted by their cosine.
const MEAN_W: f32 = 0.003_684_55;

/// How often [`Reflector::sample`] draws by the cosine where there is a remainder of the diffuse term.
const COSINE_SHARE: f32 = 0.25;

impl MetallicRoughness {
    /// Smallest α = roughness²: roughness 0.032.
    pub const MIN_ALPHA: f32 = 1e-3;

    /// From the linear base colour (0…1 per channel), `metallic` (0…1) and `roughness` (0…1), the products of factors and
    /// texels.
    ///
    /// # Errors
    /// [`ReflectorError`] for the first parameter that is out of its range.
    pub fn new(base_color: Rgb, metallic: f32, roughness: f32) -> Result<Self, ReflectorError> {
        let base = reflectance("MetallicRoughness", "base colour", base_color)?;
        let metallic = number("MetallicRoughness", "metallic", metallic, (0.0, 1.0))?;
        let roughness = number("MetallicRoughness", "roughness", roughness, (0.0, 1.0))?;
        let alpha = (roughness * roughness).max(Self::MIN_ALPHA);
        let (albedo, albedo_w) = mean_albedo(alpha);
        Ok(Self { base, metallic, alpha, f0: Rgb::ZERO, matte: Rgb::ZERO, albedo, albedo_w }.with_base(base))
    }

    /// The same with compensation for what its lobe loses between facets and for what its diffuse term gains.
    #[must_use]
    pub fn compensated(self) -> Compensated {
        Compensated::new(self)
    }

    /// The lobe alone.
    pub(super) fn without_diffuse(self) -> Self {
        Self { matte: Rgb::ZERO, ..self }
    }

    pub(super) fn with_base(self, base: Rgb) -> Self {
        Self {
            base,
            f0: Rgb::splat(DIELECTRIC_F0 * (1.0 - self.metallic)) + base * self.metallic,
            matte: base * ((1.0 - self.metallic) * FRAC_1_PI),
            ..self
        }
    }

    /// Calls `each` with the place of every sender that is above the horizon, what its irradiance is multiplied by, and its mean cosine.
    #[inline]
    pub(super) fn reflect_with(&self, incident: &[Incident], outgoing: Vec3, mut each: impl FnMut(usize, Rgb, f32)) {
        if above(outgoing) {
            self.over(incident, outgoing, |k, Lit { lobe, w, mean_w, mean_cos }| {
                if mean_cos > 0.0 {
                    each(k, self.shade(lobe, w, mean_w), mean_cos);
                }
            });
        }
    }

    /// D where a lobe meets a sender, over which its density of slopes is this: that / cos⁴.
    #[inline]
    fn density<N: Number>(density: N, tan2: N) -> N {
        let inv_cos2 = tan2 + 1.0;
        density * inv_cos2 * inv_cos2
    }

    /// The lobe and w toward a point.
    #[inline]
    fn lobe_toward(&self, incident: Vec3, outgoing: Vec3) -> (f32, f32) {
        let h = incident + outgoing;
        (distribution(self.alpha, h) * visibility(self.alpha, incident.z, outgoing.z), schlick(h.length_squared()))
    }

    /// The glossy part out of the lobe and w.
    #[inline]
    fn shade(&self, lobe: f32, w: f32, mean_w: f32) -> Rgb {
        self.f0 * (lobe * (1.0 - w)) + Rgb::splat(lobe * w) + self.remainder(mean_w)
    }

    /// What the diffuse term has more than [`Reflector::diffuse`].
    #[inline]
    fn remainder(&self, w: f32) -> Rgb {
        self.matte * ((1.0 - DIELECTRIC_F0) * (MEAN_W - w))
    }
}

/// What a sender makes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lit {
    /// D G / (4 (V·N) (L·N)) averaged over it.
    lobe: f32,
    /// w for that …
    w: f32,
    /// … and averaged over it.
    mean_w: f32,
    /// Its mean cosine; 0 below the horizon.
    mean_cos: f32,
}

impl Lobes for MetallicRoughness {
    type Light = Lit;

    #[inline]
    fn alone(&self, sender: &Incident, outgoing: Vec3) -> Option<Lit> {
        let Incident { direction, contour, .. } = sender;
        if contour.reach() == 0.0 {
            return None;
        }
        let alpha2 = self.alpha * self.alpha;
        // Far out the density changes slowly.
        let h = *direction + outgoing;
        let width2 = alpha2 + (h.x * h.x + h.y * h.y) / (h.z * h.z);
        if !contour.shows(*direction, width2.sqrt()) {
            return None;
        }
        let variance = |tan2: f32| 0.25 * (alpha2 + tan2);
        // By 1/cos⁴ of the half vector: 1/2 seen head on, more at other angles.
        const RISE: f32 = 1.0;
        let meeting = Meeting::new((*direction, contour), outgoing, Vec2::ONE, variance, RISE);
        let density = meeting.outline.scaled(self.alpha.recip()).ggx() * (FRAC_1_PI / alpha2);
        let visibility = visibility(self.alpha, meeting.incident.z, outgoing.z);
        Some(Lit {
            lobe: Self::density(density, meeting.tan2) * meeting.weight * visibility,
            w: schlick(meeting.h.length_squared()),
            mean_w: schlick(h.length_squared()),
            mean_cos: direction.z,
        })
    }

    #[inline]
    fn together(&self, disks: &Disks, outgoing: Vec3) -> [Lit; LANES] {
        let alpha2 = self.alpha * self.alpha;
        // A Gaussian with the relative slope of the density at hand.
        let meeting = Meetings::new(disks, outgoing, Vec2::ONE, |tan2| 0.25 * (alpha2 + tan2));
        let (root, _) = meeting.rounded(Lanes::splat(alpha2), 1.0);
        // Far out the density changes slowly, and the ellipse's shape matters less.
        let (_, squared) = meeting.rounded(alpha2 + meeting.tan2, 1.0);
        let per = alpha2.recip();
        let density = ggx_over_disk(squared * per, (root - alpha2) * per) * (FRAC_1_PI * per);
        let visibility = visibility(self.alpha, meeting.incident.z, outgoing.z);
        let lobe = Self::density(density, meeting.tan2) * meeting.weight * visibility;
        let toward_middle = disks.middle + Directions::splat(outgoing);
        let w = schlick(meeting.h.length_squared()).to_array();
        let mean_w = schlick(toward_middle.length_squared()).to_array();
        let [lobe, mean_cos] = [lobe, disks.mean_cos].map(|values| disks.of_visible(values).to_array());
        std::array::from_fn(|k| Lit { lobe: lobe[k], w: w[k], mean_w: mean_w[k], mean_cos: mean_cos[k] })
    }
}

impl Reflector for MetallicRoughness {
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        if !(above(incident) && above(outgoing)) {
            return Rgb::ZERO;
        }
        let (lobe, w) = self.lobe_toward(incident, outgoing);
        let fresnel = self.f0 * (1.0 - w) + Rgb::splat(w);
        self.matte * ((1.0 - DIELECTRIC_F0) * (1.0 - w)) + fresnel * lobe
    }

    fn diffuse(&self) -> Rgb {
        self.base * ((1.0 - self.metallic) * (1.0 - DIELECTRIC_F0) * (1.0 - MEAN_W))
    }

    fn glossy(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        if above(incident) && above(outgoing) {
            let (lobe, w) = self.lobe_toward(incident, outgoing);
            self.shade(lobe, w, w)
        } else {
            Rgb::ZERO
        }
    }

    fn glossy_toward_extent(&self, incident: Vec3, outgoing: Vec3, extent: f32) -> Rgb {
        let sender = Incident { direction: incident, extent, irradiance: Rgb::ONE, ..Incident::default() };
        self.reflect_sum(&[sender], outgoing)
    }

    fn reflect_sum(&self, incident: &[Incident], outgoing: Vec3) -> Rgb {
        let mut sum = Rgb::ZERO;
        self.reflect_with(incident, outgoing, |k, factor, _| sum += incident[k].irradiance * factor);
        sum
    }

    fn reflect_each(&self, incident: &[Incident], outgoing: Vec3, reflected: &mut [Rgb]) {
        reflected.fill(Rgb::ZERO);
        self.reflect_with(incident, outgoing, |k, factor, _| reflected[k] = incident[k].irradiance * factor);
    }

    fn glossy_bound(&self, incident: &Cone, outgoing: Vec3) -> f32 {
        let Some(range) = HalfRange::new(incident, outgoing, Vec2::ONE) else {
            return 0.0;
        };
        let alpha2 = self.alpha * self.alpha;
        // Of h.x² + h.y² = t h.z², D falls with t (α ≤ 1); the visibility falls with the incident cosine.
        let tan2 = (range.across_low / range.z_high).powi(2);
        let ratio = (1.0 + tan2) / (alpha2 + tan2);
        let d = alpha2 * FRAC_1_PI * ratio * ratio;
        let lobe = d * visibility(self.alpha, range.z_low - outgoing.z, outgoing.z);
        // |h|² = 2 (1 + V·L).
        let w_of = |cos: f32| schlick((2.0 * (1.0 + cos)).max(0.0));
        let (w_low, w_high) = (w_of(range.cos_high), w_of(range.cos_low));
        let fresnel = self.f0 * (1.0 - w_high) + Rgb::splat(w_high);
        let above = fresnel * lobe + self.remainder(w_low).max(Rgb::ZERO);
        let below = (-self.remainder(w_high)).max(Rgb::ZERO);
        above.max(below).max_element() * 1.0001 + f32::MIN_POSITIVE
    }

    fn glossy_albedo(&self) -> Rgb {
        // The remainder's mean is 0.
        self.f0 * (self.albedo - self.albedo_w) + Rgb::splat(self.albedo_w)
    }

    fn directional_albedo(&self, incident: Vec3) -> Rgb {
        albedo_by_samples(self, incident)
    }

    fn lobe(&self, outgoing: Vec3) -> Lobe {
        if !above(outgoing) {
            return Lobe::HEMISPHERE;
        }
        // GGX has no variance; a Gaussian of the same peak has α²/2 per axis.
        Lobe { direction: mirrored(outgoing), width: slope_to_width(self.alpha, outgoing) }
    }

    /// Draws visible normals, and where there is a remainder of the diffuse term sometimes by the cosine; both are
    /// weighted by the balance heuristic, so that weights are bounded.
    fn sample(&self, outgoing: Vec3, u: Vec2) -> Option<Sample> {
        if !above(outgoing) {
            return None;
        }
        let cosine = if self.matte == Rgb::ZERO { 0.0 } else { COSINE_SHARE };
        let incident = if u.x < cosine {
            cosine_hemisphere(Vec2::new(u.x / cosine, u.y))
        } else {
            draw(self.alpha, outgoing, Vec2::new((u.x - cosine) / (1.0 - cosine), u.y))?
        };
        if !above(incident) {
            return None;
        }
        let density = (1.0 - cosine) * density(self.alpha, incident, outgoing) + cosine * FRAC_1_PI * incident.z;
        (density > 0.0).then(|| Sample { incident, weight: self.glossy(incident, outgoing) * (incident.z / density) })
    }

    fn formulas(&self) -> Option<Vec<Formula>> {
        let Self { base, metallic, alpha, .. } = *self;
        Some(vec![Formula::MetallicRoughness { base, metallic, alpha }])
    }

    fn with_base_color(&self, color: Rgb) -> Option<Arc<dyn Reflector>> {
        Some(Arc::new(self.with_base(clamped(color))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_of_the_fresnel_factor() {
        const N: usize = 100;
        let mut sum = 0.0;
        for i in 0..N {
            for o in 0..N {
                let (cos_i, cos_o) = (((i as f64 + 0.5) / N as f64).sqrt(), ((o as f64 + 0.5) / N as f64).sqrt());
                let sines = ((1.0 - cos_i * cos_i) * (1.0 - cos_o * cos_o)).sqrt();
                for k in 0..N {
                    let dot = cos_i * cos_o + sines * (std::f64::consts::PI * (k as f64 + 0.5) / N as f64).cos();
                    sum += (1.0 - ((1.0 + dot) / 2.0).sqrt()).powi(5);
                }
            }
        }
        let mean = sum / (N * N * N) as f64;
        // Midpoints leave about 10⁻³ where both directions graze.
        assert!((mean / f64::from(MEAN_W) - 1.0).abs() < 3e-3, "MEAN_W is {MEAN_W}, integrated {mean}");
    }
}

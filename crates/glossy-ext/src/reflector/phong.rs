//! Phong's reflection model, energy-normalised.

use super::error::{ReflectorError, clamped, number, reflectance};
use super::extent::{Disks, Lobes, gaussian_over_disk};
use super::generic::albedo_by_samples;
use super::half_vector::cosine_range;
use super::lanes::{Directions, LANES, Lanes, Number};
use super::{Contour, Formula, HORIZON, Incident, Lobe, Reflector, Sample, above, mirrored, unit};
use glam::{Vec2, Vec3};
use hr_diffuse::{Cone, Rgb};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, TAU};
use std::sync::Arc;

/// A Lambertian share and a cosine lobe about the mirror direction,
///
/// f = kd/π + ks (n + 2)/(2π) max(0, cos ψ)ⁿ,
///
/// with ψ the angle between the incident direction and the mirrored outgoing one: the modified Phong model of Lewis
/// (Computer Graphics Forum 13(2), 1994) as Lafortune and Willems normalise it (report CW 197, 1994). The albedo of the
/// lobe is ks along the normal and less elsewhere; it is reciprocal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phong {
    kd: Rgb,
    ks: Rgb,
    n: f32,
    /// Distance from the mirror direction where the lobe is 10⁻⁷ of its peak.
    cut: f32,
    /// Albedo of the lobe for ks = 1, mean over outgoing directions.
    unit_albedo: f32,
}

impl Phong {
    /// Largest exponent: a lobe of 0.03°. Beyond it a mirror is meant.
    pub const MAX_EXPONENT: f32 = 1e7;

    /// From the diffuse reflectance `kd` and the specular reflectance `ks`, both 0…1 per channel, and the exponent
    /// `n`, 0…[`MAX_EXPONENT`](Self::MAX_EXPONENT).
    ///
    /// # Errors
    /// [`ReflectorError`] for the first parameter that is out of its range.
    pub fn new(kd: Rgb, ks: Rgb, n: f32) -> Result<Self, ReflectorError> {
        let kd = reflectance("Phong", "kd", kd)?;
        let ks = reflectance("Phong", "ks", ks)?;
        let n = number("Phong", "n", n, (0.0, Self::MAX_EXPONENT))?;
        Ok(Self { kd, ks, n, cut: (32.0 / n.max(f32::MIN_POSITIVE)).sqrt(), unit_albedo: mean_albedo(n) })
    }

    /// What the lobe is multiplied by.
    fn scale(&self) -> Rgb {
        self.ks * ((self.n + 2.0) / TAU)
    }

    /// Calls `each` with the place of every sender that matters, and its lobe.
    #[inline]
    fn reflect_with(&self, incident: &[Incident], outgoing: Vec3, mut each: impl FnMut(usize, f32)) {
        if !self.is_diffuse() && above(outgoing) {
            self.over(incident, mirrored(outgoing), |k, lobe| {
                if lobe > 0.0 {
                    each(k, lobe);
                }
            });
        }
    }

    /// cosⁿ averaged over a sender with a contour that shows; `mirror` is the mirrored outgoing direction, above the horizon.
    // Inlined it would make disks half as fast.
    #[inline(never)]
    fn lobe_over_contour(&self, direction: Vec3, contour: &Contour, mirror: Vec3) -> f32 {
        // The plane that touches the sphere in the mirror direction, in units that make the lobe exp(−|p|²); away from there it is
        // stretched until that is right, too.
        let (x, y) = mirror.any_orthonormal_pair();
        let unit = (0.5 * self.n).sqrt();
        let flat = |v: Vec3| Vec2::new(x.dot(v), y.dot(v)) * unit;
        let seen = contour.mapped(flat(direction), |side| flat(side - direction * direction.dot(side)));
        let met = contour.about(direction, seen.product(0.5));
        let versine = 0.5 * met.incident.distance_squared(mirror);
        let at = flat(met.incident) * (1.0 + versine * (0.5 + 0.29 * versine));
        met.weight(direction.z, 0.0) * met.mapped(at, [0.0; 2], Vec2::ZERO, flat).gaussian()
    }
}

/// cosⁿ averaged over senders; the mirrored outgoing direction, above the horizon, is given in the place of the outgoing one.
impl Lobes for Phong {
    type Light = f32;

    #[inline]
    fn alone(&self, sender: &Incident, mirror: Vec3) -> Option<f32> {
        let Incident { direction, contour, .. } = sender;
        // Distances, not cosines, keep high exponents exact. cosⁿ ψ is below exp(−n ψ²/2).
        let (nearest, distance2) = (sender.reach() + self.cut, direction.distance_squared(mirror));
        if distance2 > nearest * nearest {
            return Some(0.0);
        }
        // In slopes of half vectors, which turn by half of what directions do, the lobe is half as wide.
        if !contour.shows(*direction, (0.5 / self.n).sqrt()) {
            return None;
        }
        Some(if distance2 < 2.0 { self.lobe_over_contour(*direction, contour, mirror) } else { 0.0 })
    }

    #[inline]
    fn together(&self, disks: &Disks, mirror: Vec3) -> [f32; LANES] {
        let apart = Directions::splat(mirror) - disks.middle;
        let versine = 0.5 * apart.length_squared();
        let is_before = versine.simd_lt(Lanes::ONE);
        let exponent = -self.n * (-is_before.select(versine, Lanes::ZERO)).ln_1p();
        // The cosine is taken where the lobe and the disk meet: both are like Gaussians, of variances 1/n and r²/4.
        let share = 0.25 * self.n * disks.radius2;
        let inside = (disks.radius2 / (2.0 * versine.at_least(f32::MIN_POSITIVE))).sqrt();
        let step = (share / (1.0 + share)).fast_min(inside);
        let cos = disks.middle.z + step * apart.z;
        let lobe = cos / disks.mean_cos * gaussian_over_disk(exponent, 2.0 * share);
        disks.of_visible(is_before & lobe).to_array()
    }
}

/// A direction of density (n + 1)/2π cosⁿ about the mirror direction, and its weight for ks = 1.
fn draw(n: f32, outgoing: Vec3, u: Vec2) -> Option<(Vec3, f32)> {
    let mirror = unit(mirrored(outgoing))?;
    let log_cos = (1.0 - u.y).clamp(f32::MIN_POSITIVE, 1.0).ln() / (n + 1.0);
    let versine = -log_cos.exp_m1();
    let sin = (versine * (2.0 - versine)).max(0.0).sqrt();
    let (s, c) = (TAU * u.x).sin_cos();
    let (a, b) = mirror.any_orthonormal_pair();
    let incident = unit(mirror * (1.0 - versine) + (a * c + b * s) * sin)?;
    (above(incident) && above(outgoing)).then(|| (incident, (n + 2.0) / (n + 1.0) * incident.z))
}

/// Mean weight over directions of the lobe and outgoing directions.
fn mean_albedo(n: f32) -> f32 {
    const OUT: usize = 12;
    const RINGS: usize = 12;
    const TURNS: usize = 24;
    let mut sum = 0.0_f64;
    for j in 0..OUT {
        let cos2 = (j as f32 + 0.5) / OUT as f32;
        let outgoing = Vec3::new((1.0 - cos2).sqrt(), 0.0, cos2.sqrt());
        for k in 0..RINGS {
            for l in 0..TURNS {
                let u = Vec2::new((l as f32 + 0.5) / TURNS as f32, (k as f32 + 0.5) / RINGS as f32);
                if let Some((_, weight)) = draw(n, outgoing, u) {
                    sum += f64::from(weight);
                }
            }
        }
    }
    (sum / (OUT * RINGS * TURNS) as f64) as f32
}

impl Reflector for Phong {
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        if above(incident) && above(outgoing) {
            self.kd * FRAC_1_PI + self.glossy(incident, outgoing)
        } else {
            Rgb::ZERO
        }
    }

    fn diffuse(&self) -> Rgb {
        self.kd
    }

    fn is_diffuse(&self) -> bool {
        self.ks == Rgb::ZERO
    }

    fn glossy(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        let versine = 0.5 * incident.distance_squared(mirrored(outgoing));
        if above(incident) && above(outgoing) && versine < 1.0 {
            self.scale() * (self.n * (-versine).ln_1p()).exp()
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
        self.reflect_with(incident, outgoing, |k, lobe| sum += incident[k].irradiance * lobe);
        self.scale() * sum
    }

    fn reflect_each(&self, incident: &[Incident], outgoing: Vec3, reflected: &mut [Rgb]) {
        let scale = self.scale();
        reflected.fill(Rgb::ZERO);
        self.reflect_with(incident, outgoing, |k, lobe| reflected[k] = incident[k].irradiance * (scale * lobe));
    }

    fn glossy_bound(&self, incident: &Cone, outgoing: Vec3) -> f32 {
        if !above(outgoing) || cosine_range(incident, Vec3::Z).1 <= HORIZON {
            return 0.0;
        }
        // Angles, from distances: a cosine would lose what high exponents need.
        let mirror = mirrored(outgoing);
        let between = 2.0 * (0.5 * incident.axis.distance(mirror)).min(1.0).asin();
        let nearest = (between - incident.angle() - 1e-6).clamp(0.0, FRAC_PI_2);
        let versine = 2.0 * (0.5 * nearest).sin().powi(2);
        let lobe = (self.n * (-versine.min(1.0)).ln_1p()).exp();
        // One part in 10⁴ covers the rounding of the exponentials. 0 × ln 0 is no number, but the lobe of n = 0 is 1.
        self.scale().max_element() * if self.n > 0.0 { lobe } else { 1.0 } * 1.0001 + f32::MIN_POSITIVE
    }

    fn glossy_albedo(&self) -> Rgb {
        self.ks * self.unit_albedo
    }

    fn directional_albedo(&self, incident: Vec3) -> Rgb {
        albedo_by_samples(self, incident)
    }

    fn lobe(&self, outgoing: Vec3) -> Lobe {
        if self.is_diffuse() || !above(outgoing) {
            return Lobe::HEMISPHERE;
        }
        Lobe { direction: mirrored(outgoing), width: (self.n + 1.0).sqrt().recip().min(FRAC_PI_2) }
    }

    fn sample(&self, outgoing: Vec3, u: Vec2) -> Option<Sample> {
        let (incident, weight) = draw(self.n, outgoing, u)?;
        Some(Sample { incident, weight: self.ks * weight })
    }

    fn formulas(&self) -> Option<Vec<Formula>> {
        Some(vec![Formula::Phong { ks: self.ks, n: self.n }])
    }

    /// The base colour is `kd`.
    fn with_base_color(&self, color: Rgb) -> Option<Arc<dyn Reflector>> {
        Some(Arc::new(Self { kd: clamped(color), ..*self }))
    }
}

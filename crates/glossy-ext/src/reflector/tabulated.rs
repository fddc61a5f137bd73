//! Measured isotropic BRDFs.

use super::generic::albedo_by_samples;
use super::half_vector::HalfRange;
use super::{HORIZON, Lobe, Reflector, Sample, above, cosine_hemisphere, generic, ggx, unit};
use glam::{Vec2, Vec3};
use hr_diffuse::{Cone, Rgb};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI, SQRT_2, TAU};
use std::fmt;
use std::sync::Arc;

/// An isotropic BRDF as a table over the half vector and the difference vector (Rusinkiewicz, "A New Change of Variables
/// for Efficient BRDF Representation", 1998): θh is the angle of the half vector to the normal, (θd, φd) the incident
/// direction relative to it. Values are interpolated linearly in √θh, θd and φd between the middles of cells. φd and φd + π
/// share an entry, so that it is reciprocal.
///
/// Measurements are imperfect, and what cannot be used is mended ([`mended`](Self::mended) counts):
///
/// - An entry that is negative, no number or beyond all bounds (10¹²/sr) is replaced, in all channels, by the nearest one at the same half vector
///   and less grazing directions; where there is none by that of a steeper half vector, or else 0.
/// - Where more would be reflected than arrives, which happens near grazing directions, values are divided by the larger
///   of both directions' albedos, channel by channel: reciprocal, and nobody's albedo exceeds 1.
///
/// A tenth of pairs of directions reflect less than the Lambertian share, which travels as radiosity. A table that is
/// the same everywhere is diffuse.
#[derive(Clone)]
pub struct Tabulated {
    table: Arc<Table>,
}

/// What was mended of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mended {
    /// Entries for directions above the horizon that were negative, no number or beyond all bounds.
    pub entries: usize,
    /// Largest directional albedo of the table as it was, 0…; 1 at most if nothing was limited.
    pub largest_albedo: f32,
}

#[derive(Clone)]
struct Table {
    /// Cells along √θh (0…√(π/2)), θd (0…π/2) and φd (0…π), the last innermost.
    size: [usize; 3],
    /// 1/sr.
    values: Vec<Rgb>,
    /// By θh and θd: the largest value (any channel, any φd, less the diffuse share) there and at larger θh.
    largest: Vec<f32>,
    diffuse: Rgb,
    is_diffuse: bool,
    glossy_albedo: Rgb,
    /// What values are divided by, and the lobe, at angles of 0…π/2 to the normal in equal steps.
    by_angle: [Toward; ANGLES],
    /// Roughness of the GGX facets that samples are drawn from.
    alpha: f32,
    mended: Mended,
}

/// What depends on the angle to the normal.
#[derive(Clone, Copy, Debug)]
struct Toward {
    /// At least 1 per channel.
    excess: Rgb,
    /// Tangent of half the angle of the lobe's middle, positive on the side of the mirror direction.
    lean: f32,
    /// Width of the lobe in radians.
    width: f32,
}

/// Larger values (1/sr) are not measured ones: no lobe is narrower than a millionth of a radian.
const LARGEST: f32 = 1e12;
/// Every 1.4°.
const ANGLES: usize = 65;
/// Share of the pairs of directions that reflect less than the Lambertian share.
const DARK_SHARE: f32 = 0.1;
/// Tables that differ by less than this share of the Lambertian part are diffuse.
const EVEN: f32 = 1e-3;
/// How often [`Reflector::sample`] draws by the cosine.
const COSINE_SHARE: f32 = 0.5;
/// The last angle of the table is this far from the horizon, in radians.
const GRAZING: f32 = 1e-3;

impl fmt::Debug for Tabulated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Table { size, diffuse, glossy_albedo, alpha, mended, .. } = &*self.table;
        f.debug_struct("Tabulated")
            .field("size", size)
            .field("diffuse", diffuse)
            .field("glossy_albedo", glossy_albedo)
            .field("alpha", alpha)
            .field("mended", mended)
            .finish_non_exhaustive()
    }
}

impl Tabulated {
    /// From values at the middles of cells of equal size in √θh, θd and φd, the last innermost; at least two along each,
    /// and as many values as cells.
    pub(super) fn new(size: [usize; 3], values: Vec<Rgb>) -> Self {
        let nothing = Toward { excess: Rgb::ONE, lean: 0.0, width: FRAC_PI_2 };
        let mut table = Table {
            size,
            values,
            largest: Vec::new(),
            diffuse: Rgb::ZERO,
            is_diffuse: false,
            glossy_albedo: Rgb::ZERO,
            by_angle: [nothing; ANGLES],
            alpha: 1.0,
            mended: Mended::default(),
        };
        table.mend();
        table.limit();
        table.split();
        let mut reflector = Self { table: Arc::new(table) };
        if !reflector.table.is_diffuse {
            let (by_angle, glossy_albedo) = (reflector.lobes(), reflector.table.glossy_albedo());
            let table = Arc::make_mut(&mut reflector.table);
            // The width of a lobe along the normal is √2 of its roughness.
            table.alpha = (by_angle[0].width / SQRT_2).clamp(1e-3, 1.0);
            (table.by_angle, table.glossy_albedo) = (by_angle, glossy_albedo);
        }
        reflector
    }

    /// What of the table could not be used as it was.
    #[must_use]
    pub fn mended(&self) -> Mended {
        self.table.mended
    }

    /// The lobes that the trait finds, one for each angle.
    fn lobes(&self) -> [Toward; ANGLES] {
        let mut by_angle = self.table.by_angle;
        for (k, toward) in by_angle.iter_mut().enumerate() {
            let lobe = generic::lobe(self, direction(angle(k)));
            toward.width = lobe.width;
            toward.lean = -lobe.direction.x / (1.0 + lobe.direction.z);
        }
        by_angle
    }
}

/// The k-th of the angles that things are kept for.
fn angle(k: usize) -> f32 {
    (FRAC_PI_2 * k as f32 / (ANGLES - 1) as f32).min(FRAC_PI_2 - GRAZING)
}

/// The direction at an angle to the normal, azimuth 0.
fn direction(angle: f32) -> Vec3 {
    Vec3::new(angle.sin(), 0.0, angle.cos())
}

impl Table {
    /// Replaces what is no value.
    fn mend(&mut self) {
        let [halves, differences, azimuths] = self.size;
        let usable = |v: &Rgb| v.cmpge(Rgb::ZERO).all() && v.cmple(Rgb::splat(LARGEST)).all();
        for half in 0..halves {
            let (sin_h, cos_h) = (FRAC_PI_2 * ((half as f32 + 0.5) / halves as f32).powi(2)).sin_cos();
            for difference in 0..differences {
                let (sin_d, cos_d) = (FRAC_PI_2 * (difference as f32 + 0.5) / differences as f32).sin_cos();
                for azimuth in 0..azimuths {
                    let k = (half * differences + difference) * azimuths + azimuth;
                    if usable(&self.values[k]) {
                        continue;
                    }
                    self.values[k] = match (half, difference) {
                        (0, 0) => Rgb::ZERO,
                        (_, 0) => self.values[k - differences * azimuths],
                        _ => self.values[k - azimuths],
                    };
                    // Heights of both directions: of what is below the horizon nothing can be known.
                    let tilt = sin_d * sin_h * (PI * (azimuth as f32 + 0.5) / azimuths as f32).cos();
                    self.mended.entries += usize::from(cos_d * cos_h > tilt.abs());
                }
            }
        }
    }

    /// Where more is reflected than arrives, values are divided by how much.
    fn limit(&mut self) {
        let albedos: [Rgb; ANGLES] = std::array::from_fn(|k| self.albedo(direction(angle(k))));
        for (toward, albedo) in self.by_angle.iter_mut().zip(albedos) {
            toward.excess = albedo.max(Rgb::ONE);
            self.mended.largest_albedo = self.mended.largest_albedo.max(albedo.max_element());
        }
    }

    /// Finds the Lambertian share and what depends on it.
    fn split(&mut self) {
        const LEVELS: usize = 12;
        const TURNS: usize = 16;
        // Middles of equal shares of the cosine-weighted hemisphere.
        let level = |k: usize| ((k as f32 + 0.5) / LEVELS as f32).sqrt().acos();
        let mut values = Vec::new();
        for k in 0..LEVELS * LEVELS * TURNS {
            let (i, o) = (direction(level(k % LEVELS)), direction(level(k / LEVELS % LEVELS)));
            let (s, c) = (PI * ((k / (LEVELS * LEVELS)) as f32 + 0.5) / TURNS as f32).sin_cos();
            values.push(self.eval(Vec3::new(i.x * c, i.x * s, i.z), o));
        }
        let dark = (values.len() as f32 * DARK_SHARE) as usize;
        let quantile = |channel: fn(&Rgb) -> f32| {
            let mut channel: Vec<f32> = values.iter().map(channel).collect();
            *channel.select_nth_unstable_by(dark, f32::total_cmp).1
        };
        let share = Rgb::new(quantile(|v| v.x), quantile(|v| v.y), quantile(|v| v.z));
        self.diffuse = (share * PI).min(Rgb::ONE);
        let share = self.diffuse * FRAC_1_PI;
        let limited = self.mended.largest_albedo > 1.0 + EVEN;
        let uneven = self.values.iter().fold(0.0_f32, |most, &v| most.max((v - share).abs().max_element()));
        self.is_diffuse = !limited && uneven <= EVEN * share.max_element();
        let [halves, differences, azimuths] = self.size;
        self.largest = self
            .values
            .chunks(azimuths)
            .map(|row| row.iter().fold(0.0_f32, |most, &v| most.max((v - share).max_element())))
            .collect();
        for k in (0..(halves - 1) * differences).rev() {
            self.largest[k] = self.largest[k].max(self.largest[k + differences]);
        }
    }

    /// The value between cells; both directions are above the horizon.
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        let Some(h) = unit(incident + outgoing) else { return Rgb::ZERO };
        let across = h.truncate().length();
        // The difference vector's axes: away from the normal, and about it.
        let about = unit(Vec3::new(-h.y, h.x, 0.0)).unwrap_or(Vec3::Y);
        // Of the difference between both directions exchanging them changes the sign alone, also where it is nearly 0.
        let apart = 0.5 * (incident - outgoing);
        let (x, y) = (apart.dot(about.cross(h)), apart.dot(about));
        let half = across.atan2(h.z);
        let difference = x.hypot(y).atan2(incident.dot(h)).min(FRAC_PI_2);
        let azimuth = y.atan2(x).rem_euclid(PI);
        let [halves, differences, azimuths] = self.size;
        let (h0, h1, h_share) = between((half / FRAC_PI_2).sqrt(), halves);
        let (d0, d1, d_share) = between(difference / FRAC_PI_2, differences);
        let turn = azimuth / PI * azimuths as f32 + azimuths as f32 - 0.5;
        let (a0, a1) = (turn as usize % azimuths, (turn as usize + 1) % azimuths);
        let row = |half: usize, difference: usize| {
            let row = &self.values[(half * differences + difference) * azimuths..][..azimuths];
            row[a0].lerp(row[a1], turn.fract())
        };
        let value = row(h0, d0).lerp(row(h0, d1), d_share).lerp(row(h1, d0).lerp(row(h1, d1), d_share), h_share);
        value / self.toward(incident).excess.max(self.toward(outgoing).excess)
    }

    /// What is kept for the angle of a direction.
    fn toward(&self, v: Vec3) -> Toward {
        let x = v.truncate().length().atan2(v.z) / FRAC_PI_2 * (ANGLES - 1) as f32;
        let k = (x as usize).min(ANGLES - 2);
        let (a, b, share) = (&self.by_angle[k], &self.by_angle[k + 1], (x - k as f32).min(1.0));
        Toward {
            excess: a.excess.lerp(b.excess, share),
            lean: a.lean + (b.lean - a.lean) * share,
            width: a.width + (b.width - a.width) * share,
        }
    }

    /// Directional albedo: an integral over half vectors, which meets every cell of their angle.
    fn albedo(&self, outgoing: Vec3) -> Rgb {
        const TURNS: usize = 32;
        let rings = 2 * self.size[0];
        let mut sum = Rgb::ZERO;
        for k in 0..rings * TURNS {
            let root = ((k / TURNS) as f32 + 0.5) / rings as f32;
            let (sin, cos) = (FRAC_PI_2 * root * root).sin_cos();
            // Half a turn: the other half is its image.
            let (s, c) = (PI * ((k % TURNS) as f32 + 0.5) / TURNS as f32).sin_cos();
            let h = Vec3::new(sin * c, sin * s, cos);
            let incident = 2.0 * outgoing.dot(h) * h - outgoing;
            if above(incident) {
                sum += self.eval(incident, outgoing) * (incident.z * outgoing.dot(h).max(0.0) * sin * root);
            }
        }
        // dω = 4 (o·h) sin θh dθh dφ, dθh = π √(θh/(π/2)) d√….
        sum * (4.0 * PI * TAU / (rings * TURNS) as f32)
    }

    /// Cosine-weighted mean of the albedo, less the Lambertian share.
    fn glossy_albedo(&self) -> Rgb {
        const LEVELS: usize = 16;
        let mean = (0..LEVELS).map(|k| self.albedo(direction(((k as f32 + 0.5) / LEVELS as f32).sqrt().acos())));
        mean.sum::<Rgb>() / LEVELS as f32 - self.diffuse
    }
}

/// The two cells whose middles are around `x` (0…1 over all `cells`), and how far it is from the first to the second.
fn between(x: f32, cells: usize) -> (usize, usize, f32) {
    let x = (x * cells as f32 - 0.5).clamp(0.0, (cells - 1) as f32);
    let k = (x as usize).min(cells - 2);
    (k, k + 1, x - k as f32)
}

impl Reflector for Tabulated {
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        if above(incident) && above(outgoing) { self.table.eval(incident, outgoing) } else { Rgb::ZERO }
    }

    fn diffuse(&self) -> Rgb {
        self.table.diffuse
    }

    fn is_diffuse(&self) -> bool {
        self.table.is_diffuse
    }

    fn glossy_bound(&self, incident: &Cone, outgoing: Vec3) -> f32 {
        let table = &*self.table;
        let Some(range) = HalfRange::new(incident, outgoing, Vec2::ONE) else { return 0.0 };
        if table.is_diffuse {
            return 0.0;
        }
        let [halves, differences, _] = table.size;
        let cells = |angle: f32, size: usize| angle / FRAC_PI_2 * size as f32;
        // Cells whose middles are next to the range of either angle; i·o is the cosine of 2 θd.
        let half = range.across_low.atan2(range.z_high) / FRAC_PI_2;
        let half = ((half.sqrt() * halves as f32 - 0.51).max(0.0) as usize).min(halves - 1);
        let nearest = cells(0.5 * range.cos_high.acos(), differences) - 0.51;
        let farthest = cells(0.5 * range.cos_low.acos(), differences) + 0.51;
        let row = &table.largest[half * differences..][..differences];
        let row = &row[(nearest.max(0.0) as usize).min(differences - 1)..(farthest as usize + 1).min(differences)];
        // What is reflected is not negative, and less than the table says where that is limited.
        let most = row.iter().fold(0.0, |most: f32, &v| most.max(v));
        most.max(table.diffuse.max_element() * FRAC_1_PI) * 1.0001 + f32::MIN_POSITIVE
    }

    fn glossy_albedo(&self) -> Rgb {
        self.table.glossy_albedo
    }

    fn directional_albedo(&self, incident: Vec3) -> Rgb {
        albedo_by_samples(self, incident)
    }

    fn lobe(&self, outgoing: Vec3) -> Lobe {
        if self.table.is_diffuse || !above(outgoing) {
            return Lobe::HEMISPHERE;
        }
        let Toward { lean, width, .. } = self.table.toward(outgoing);
        let across = outgoing.truncate().normalize_or_zero() * (-2.0 * lean / (1.0 + lean * lean));
        let direction = across.extend((1.0 - across.length_squared()).max(0.0).sqrt());
        Lobe { direction: direction.normalize(), width }
    }

    /// Draws facets of GGX as rough as the lobe is wide, or by the cosine; the balance heuristic bounds the weights.
    fn sample(&self, outgoing: Vec3, u: Vec2) -> Option<Sample> {
        if self.table.is_diffuse || !above(outgoing) {
            return None;
        }
        let incident = if u.x < COSINE_SHARE {
            Some(cosine_hemisphere(Vec2::new(u.x / COSINE_SHARE, u.y))).filter(|&v| above(v))?
        } else {
            let u = Vec2::new((u.x - COSINE_SHARE) / (1.0 - COSINE_SHARE), u.y);
            ggx::draw(self.table.alpha, outgoing, u)?
        };
        let facets = ggx::density(self.table.alpha, incident, outgoing);
        let density = (1.0 - COSINE_SHARE) * facets + COSINE_SHARE * FRAC_1_PI * incident.z.max(HORIZON);
        Some(Sample { incident, weight: self.glossy(incident, outgoing) * (incident.z / density) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reflector::MerlError;
    use crate::{MetallicRoughness, Phong, Ward, conformance};

    /// The file that a measurement of `f` would make.
    fn merl(size: [usize; 3], f: impl Fn(Vec3, Vec3) -> Rgb) -> Vec<u8> {
        let mut bytes: Vec<u8> = size.iter().flat_map(|&s| (s as i32).to_le_bytes()).collect();
        let mut values = Vec::new();
        for half in 0..size[0] {
            let (sin_h, cos_h) = (FRAC_PI_2 * ((half as f32 + 0.5) / size[0] as f32).powi(2)).sin_cos();
            let turn = |v: Vec3| Vec3::new(v.x * cos_h + v.z * sin_h, v.y, v.z * cos_h - v.x * sin_h);
            for difference in 0..size[1] {
                let (sin_d, cos_d) = (FRAC_PI_2 * (difference as f32 + 0.5) / size[1] as f32).sin_cos();
                for azimuth in 0..size[2] {
                    let (s, c) = (PI * (azimuth as f32 + 0.5) / size[2] as f32).sin_cos();
                    let (i, o) =
                        (turn(Vec3::new(sin_d * c, sin_d * s, cos_d)), turn(Vec3::new(-sin_d * c, -sin_d * s, cos_d)));
                    // The database marks what is below the horizon as negative.
                    values.push(if above(i) && above(o) { f(i, o) } else { Rgb::splat(-1.0) });
                }
            }
        }
        for channel in 0..3 {
            let scale = [1500.0, 1500.0 / 1.15, 1500.0 / 1.66][channel];
            bytes.extend(values.iter().flat_map(|v| (f64::from(v[channel]) * scale).to_le_bytes()));
        }
        bytes
    }

    const SIZE: [usize; 3] = [90, 45, 90];

    fn grey(value: f32) -> Rgb {
        Rgb::splat(value)
    }

    fn all() -> Vec<(&'static str, Box<dyn Reflector>)> {
        vec![
            ("Ward", Box::new(Ward::new(Rgb::new(0.4, 0.2, 0.1), grey(0.4), 0.15).expect("a lobe"))),
            ("a smooth metal", Box::new(MetallicRoughness::new(grey(0.9), 1.0, 0.25).expect("a metal"))),
            ("plastic", Box::new(MetallicRoughness::new(grey(0.5), 0.0, 0.5).expect("a plastic"))),
            ("Phong", Box::new(Phong::new(grey(0.1), grey(0.6), 60.0).expect("a lobe"))),
        ]
    }

    #[test]
    fn tables_reproduce_what_was_measured() {
        for (name, source) in all() {
            let bytes = merl(SIZE, |i, o| source.eval(i, o));
            let table = Tabulated::from_merl(&bytes).expect("a table");
            assert_eq!(table.mended().entries, 0, "{name}: what is below the horizon is not missed");
            let (mut off, mut sum) = (0.0, 0.0);
            for k in 0..4000 {
                let v = |a: f32, b: f32| {
                    let (height, turn) = ((a * k as f32).fract(), (b * k as f32).fract() * TAU);
                    let sin = (1.0 - height).sqrt();
                    Vec3::new(sin * turn.cos(), sin * turn.sin(), height.sqrt())
                };
                let (i, o) = (v(0.754_877_7, 0.569_840_3), v(0.618_034, 0.445_041_9));
                let (value, expected) = (table.eval(i, o), source.eval(i, o));
                off += (value - expected).abs().element_sum();
                sum += expected.element_sum();
            }
            assert!(off < 0.02 * sum, "{name}: mean error {} of the mean", off / sum);
            let albedo = |r: &dyn Reflector| r.diffuse() + r.glossy_albedo();
            let (found, expected) = (albedo(&table), albedo(&*source));
            assert!((found - expected).abs().max_element() < 0.01, "{name}: albedo {found}, not {expected}");
        }
    }

    #[test]
    fn tables_conform() {
        for (name, source) in all() {
            let bytes = merl(SIZE, |i, o| source.eval(i, o));
            let table = Tabulated::from_merl(&bytes).expect("a table");
            if let Err(faults) = conformance::check(&table) {
                panic!("{name}: {faults}");
            }
        }
    }

    #[test]
    fn bad_entries_and_excess_are_mended_and_counted() {
        let source = Ward::new(grey(0.5), grey(0.5), 0.3).expect("a lobe");
        // Twice too bright, and unusable where it grazes.
        let grazing = |i: Vec3, o: Vec3| i.dot(o) < -0.9;
        let unusable = std::cell::Cell::new(0_usize);
        let bytes = merl(SIZE, |i, o| {
            if !grazing(i, o) {
                return 2.0 * source.eval(i, o);
            }
            unusable.set(unusable.get() + 1);
            if i.x > 0.0 { Rgb::splat(f32::NAN) } else { grey(-0.5) }
        });
        let table = Tabulated::from_merl(&bytes).expect("a table");
        let Mended { entries, largest_albedo } = table.mended();
        let unusable = unusable.get();
        // Rounding tells differently what is just above the horizon.
        assert!(unusable > 1000 && entries.abs_diff(unusable) < 10, "{entries} of {unusable} unusable entries counted");
        assert!(largest_albedo > 1.8, "it was {largest_albedo}");
        let (i, o) = (direction(1.45), Vec3::new(-0.99, 0.0, 0.141_067));
        assert!(grazing(i, o) && table.eval(i, o).x > 0.05, "mended from the neighbour: {}", table.eval(i, o));
        match conformance::check(&table) {
            Ok(measured) => assert!(measured.largest_albedo > 0.9, "limited, not darkened: {measured:?}"),
            Err(faults) => panic!("{faults}"),
        }
        let nothing = Tabulated::from_merl(&merl(SIZE, |_, _| Rgb::splat(f32::NAN))).expect("a table");
        assert!(nothing.is_diffuse() && nothing.diffuse() == Rgb::ZERO, "black if nothing is known: {nothing:?}");
    }

    #[test]
    fn any_bits_make_a_reflector() {
        let mut bytes = merl([8, 5, 6], |_, _| Rgb::ZERO);
        let mut state = 1_u64;
        for byte in &mut bytes[12..] {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *byte = (state >> 56) as u8;
        }
        // Some are the largest that pass.
        for entry in 0..40 {
            bytes[12 + 8 * entry..][..8].copy_from_slice(&1e15_f64.to_le_bytes());
        }
        let table = Tabulated::from_merl(&bytes).expect("a table");
        assert!(table.mended().entries > 10 && table.mended().largest_albedo.is_finite(), "{table:?}");
        for k in 0..2000 {
            let v = |a: f32| direction(1.57 * (a * k as f32).fract());
            let (i, o) = (v(0.618_034), v(0.754_877_7) * Vec3::new(-1.0, 1.0, 1.0));
            let value = table.eval(i, o);
            assert!(value.is_finite() && value.min_element() >= 0.0, "{value} at {i}, {o}");
            let bound = table.glossy_bound(&Cone { axis: i, cos_angle: 0.99 }, o);
            assert!(bound >= table.glossy(i, o).abs().max_element(), "{bound} at {i}, {o}");
        }
    }

    #[test]
    fn even_tables_are_diffuse() {
        let table = Tabulated::from_merl(&merl([4, 4, 8], |_, _| grey(0.5 * FRAC_1_PI))).expect("a table");
        assert!(table.is_diffuse() && (table.diffuse().x - 0.5).abs() < 1e-4, "{table:?}");
    }

    #[test]
    fn wrong_files_are_refused() {
        let error = |bytes: &[u8]| Tabulated::from_merl(bytes).expect_err("refused").to_string();
        assert!(error(&[1, 2, 3]).contains("3 bytes are no MERL BRDF"), "{}", error(&[1, 2, 3]));
        let good = merl([4, 4, 8], |_, _| Rgb::ONE);
        assert!(error(&good[..good.len() - 8]).contains("is the file incomplete?"), "cut off");
        let mut bad = good.clone();
        bad[3] = 0x80;
        assert!(error(&bad).contains("is it a file of another kind?"), "negative size");
        let missing = Tabulated::read_merl("no/such/file.binary").expect_err("no file");
        assert!(matches!(missing, MerlError::Io { .. }), "{missing}");
        let path = std::env::temp_dir().join(format!("glossy-ext-{}.binary", std::process::id()));
        std::fs::write(&path, &good).expect("a file");
        let read = Tabulated::read_merl(&path);
        std::fs::remove_file(&path).expect("it is there");
        assert!(read.is_ok(), "{read:?}");
    }
}

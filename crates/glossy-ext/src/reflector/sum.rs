//! Reflectors added up.

use super::{Formula, Incident, Lobe, Reflector, Sample, above};
use glam::{Vec2, Vec3};
use hr_diffuse::{Cone, Rgb};
use std::sync::Arc;

/// The sum of any reflectors: their lobes, Lambertian shares and mirrors add up.
#[derive(Clone, Debug, Default)]
pub struct Sum {
    parts: Vec<Arc<dyn Reflector>>,
    glossy_albedo: Rgb,
    /// Chance of each part to be sampled, cumulative.
    chances: Vec<f32>,
}

/// A part that is not diffuse is sampled with at least this chance (before normalising): its albedo may be 0 only in
/// the mean.
const MIN_CHANCE: f32 = 0.02;

impl Sum {
    /// The sum of `parts`; black if there are none. Calls [`Reflector::glossy_albedo`] of every part once.
    #[must_use]
    pub fn new(parts: Vec<Arc<dyn Reflector>>) -> Self {
        let (mut glossy_albedo, mut total, mut chances) = (Rgb::ZERO, 0.0, Vec::new());
        for part in &parts {
            let albedo = part.glossy_albedo();
            glossy_albedo += albedo;
            total += if part.is_diffuse() { 0.0 } else { albedo.max_element().max(MIN_CHANCE) };
            chances.push(total);
        }
        for chance in &mut chances {
            *chance /= total.max(f32::MIN_POSITIVE);
        }
        Self { parts, glossy_albedo, chances }
    }

    /// What is added.
    #[must_use]
    pub fn parts(&self) -> &[Arc<dyn Reflector>] {
        &self.parts
    }

    fn add(&self, f: impl Fn(&dyn Reflector) -> Rgb) -> Rgb {
        self.parts.iter().map(|part| f(part.as_ref())).sum()
    }
}

impl Reflector for Sum {
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        self.add(|part| part.eval(incident, outgoing))
    }

    fn diffuse(&self) -> Rgb {
        self.add(|part| part.diffuse())
    }

    fn is_diffuse(&self) -> bool {
        self.parts.iter().all(|part| part.is_diffuse())
    }

    fn glossy(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        self.add(|part| part.glossy(incident, outgoing))
    }

    fn glossy_toward_extent(&self, incident: Vec3, outgoing: Vec3, extent: f32) -> Rgb {
        self.add(|part| part.glossy_toward_extent(incident, outgoing, extent))
    }

    fn reflect_sum(&self, incident: &[Incident], outgoing: Vec3) -> Rgb {
        self.add(|part| part.reflect_sum(incident, outgoing))
    }

    fn reflect_each(&self, incident: &[Incident], outgoing: Vec3, reflected: &mut [Rgb]) {
        reflected.fill(Rgb::ZERO);
        let mut parts = vec![Rgb::ZERO; reflected.len()];
        for part in &self.parts {
            part.reflect_each(incident, outgoing, &mut parts);
            std::iter::zip(&mut *reflected, &parts).for_each(|(sum, part)| *sum += *part);
        }
    }

    fn glossy_bound(&self, incident: &Cone, outgoing: Vec3) -> f32 {
        self.parts.iter().map(|part| part.glossy_bound(incident, outgoing)).sum()
    }

    fn glossy_albedo(&self) -> Rgb {
        self.glossy_albedo
    }

    fn directional_albedo(&self, incident: Vec3) -> Rgb {
        self.add(|part| part.directional_albedo(incident))
    }

    /// That of the part which reflects most toward `outgoing` from its own lobe; mirrors win.
    fn lobe(&self, outgoing: Vec3) -> Lobe {
        if !above(outgoing) {
            return Lobe::HEMISPHERE;
        }
        let mut best = (0.0, Lobe::HEMISPHERE);
        for part in self.parts.iter().filter(|part| !part.is_diffuse()) {
            let lobe = part.lobe(outgoing);
            let mirror = part.mirror().max_element() > 0.0;
            let peak = if mirror { f32::INFINITY } else { part.glossy(lobe.direction, outgoing).max_element() };
            if peak > best.0 {
                best = (peak, lobe);
            }
        }
        best.1
    }

    /// Draws one part in proportion to its albedo, and from it.
    fn sample(&self, outgoing: Vec3, u: Vec2) -> Option<Sample> {
        let chosen = self.chances.iter().position(|&chance| u.x < chance)?;
        let low = if chosen == 0 { 0.0 } else { self.chances[chosen - 1] };
        let share = self.chances[chosen] - low;
        let u = Vec2::new(((u.x - low) / share).clamp(0.0, 1.0), u.y);
        let sample = self.parts[chosen].sample(outgoing, u)?;
        Some(Sample { weight: sample.weight / share, ..sample })
    }

    /// That of the first part that has one: a surface has one frame.
    fn grain(&self) -> Option<Vec3> {
        self.parts.iter().find_map(|part| part.grain())
    }

    fn mirror(&self) -> Rgb {
        self.add(|part| part.mirror())
    }

    fn formulas(&self) -> Option<Vec<Formula>> {
        let parts: Option<Vec<_>> = self.parts.iter().map(|part| part.formulas()).collect();
        Some(parts?.concat())
    }

    /// Recolours the parts that have a base colour and are not purely glossy; none if no part has one.
    fn with_base_color(&self, color: Rgb) -> Option<Arc<dyn Reflector>> {
        let mut any = false;
        let parts = self.parts.iter().map(|part| {
            part.with_base_color(color).map_or_else(
                || Arc::clone(part),
                |recolored| {
                    any = true;
                    recolored
                },
            )
        });
        let parts = parts.collect();
        any.then(|| Arc::new(Self { parts, glossy_albedo: self.glossy_albedo, chances: self.chances.clone() }) as _)
    }
}

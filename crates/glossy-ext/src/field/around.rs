//! Leaves whose normals point to many sides, such as the leg of a chair, as they are shown.
//!
//! A leaf's distribution is that of its middle, and a place of it with another normal asks for the light that it mirrors to the eye by
//! where the middle would mirror it ([`Outgoing`](crate::outgoing::Outgoing)). That may come from below the middle's horizon. So light
//! from all around is reflected, that which the middle would see at a low angle or not at all as by a place that sees it at this angle.

use crate::reflector::{Contour, Incident};
use crate::samples::Place;
use glam::Vec3;

/// Cosine of the angle at which a place sees what it mirrors, at least; and its sine.
const LEAST: f32 = 0.5;
const SINE: f32 = 0.866_025_4;
/// Cosines that samples are divided by are at least this: what is nearer to the horizon is known to be weak, not how strong it is across.
const GRAZING: f32 = 0.05;

/// Samples of all directions, irradiance across them: those above the horizon of the middle and those below, as a place sees them that
/// looks there, whose directions `turned` turns into the middle's frame.
pub(super) fn all(upper: Vec<Incident>, lower: Vec<Incident>, turned: impl Fn(Vec3) -> Vec3) -> Vec<Incident> {
    let across = |sample: Incident, direction: Vec3| {
        let cosine = sample.direction.z.max(GRAZING);
        // Outlines are those in another frame: disks do.
        Incident { direction, irradiance: sample.irradiance / cosine, contour: Contour::NONE, ..sample }
    };
    let upper = upper.into_iter().map(|sample| across(sample, sample.direction));
    let lower = lower.into_iter().map(|sample| across(sample, turned(sample.direction)));
    upper.chain(lower).collect()
}

/// Such samples as a place sees them that mirrors them toward where the middle would mirror them, and that direction, both in its
/// frame. Those below its horizon are dark.
pub(super) fn seen(all: &[Incident], outgoing: Vec3) -> (Vec<Incident>, Vec3) {
    let seen = Vec3::new(-outgoing.x, -outgoing.y, outgoing.z);
    let normal = if seen.z >= LEAST {
        Vec3::Z
    } else {
        let up = Vec3::Z.reject_from_normalized(seen).normalize_or(Vec3::X);
        (seen * LEAST + up * SINE).normalize()
    };
    let place = Place::new(Vec3::ZERO, normal);
    let arriving = all.iter().map(|sample| {
        let direction = place.local(sample.direction);
        Incident { direction, irradiance: sample.irradiance * direction.z.max(0.0), ..*sample }
    });
    (arriving.collect(), place.local(-seen.reflect(normal)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rgb;
    use crate::reflector::{Reflector, Ward};

    /// What chrome makes of samples toward where the middle would mirror it.
    fn mirrored(all: &[Incident], outgoing: Vec3) -> f32 {
        let (incident, outgoing) = seen(all, outgoing);
        chrome().reflect_sum(&incident, outgoing).x
    }

    /// Directions all over the sphere.
    fn sphere(count: u16) -> impl Iterator<Item = Vec3> {
        (0..count).map(move |k| {
            let z = 1.0 - (2.0 * f32::from(k) + 1.0) / f32::from(count);
            let (sin, cos) = (2.399_963_2 * f32::from(k)).sin_cos();
            Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
        })
    }

    fn chrome() -> Ward {
        Ward::new(Rgb::ZERO, Rgb::splat(0.8), 0.1).expect("a Ward reflector")
    }

    /// Whatever side a place looks to, it mirrors as much of a sky that is the same all around.
    #[test]
    fn an_even_sky_is_mirrored_evenly() {
        const COUNT: u16 = 3000;
        let solid_angle = 4.0 * std::f32::consts::PI / f32::from(COUNT);
        let extent = (solid_angle / std::f32::consts::PI).sqrt();
        let sample =
            |direction| Incident { direction, extent, irradiance: Rgb::splat(solid_angle), ..Incident::default() };
        let sky: Vec<Incident> = sphere(COUNT).map(sample).collect();
        for outgoing in sphere(100) {
            let light = mirrored(&sky, outgoing);
            assert!((light / 0.8 - 1.0).abs() < 0.12, "{light} toward {outgoing}");
        }
    }

    #[test]
    fn lamps_below_the_horizon_are_mirrored() {
        let across = Vec3::new(0.6, 0.0, 0.8);
        let lamp = Incident { direction: across, irradiance: Rgb::splat(0.8), ..Incident::default() };
        let lamps = all(Vec::new(), vec![lamp], |direction| direction * Vec3::new(1.0, 1.0, -1.0));
        assert_eq!(lamps[0].direction, Vec3::new(0.6, 0.0, -0.8), "below");
        assert!((lamps[0].irradiance.x - 1.0).abs() < 1e-6, "what arrives across the direction");
        let toward = |outgoing| mirrored(&lamps, outgoing);
        let peak = toward(Vec3::new(-0.6, 0.0, -0.8));
        let brightest = sphere(2000).max_by(|a, b| toward(*a).total_cmp(&toward(*b))).expect("some");
        assert!(brightest.dot(Vec3::new(-0.6, 0.0, -0.8)) > 0.997, "the highlight is at {brightest}");
        assert!(peak > 1.0 && toward(Vec3::new(0.6, 0.0, -0.8)) < 1e-3 * peak, "{peak}, and nothing elsewhere");
    }
}

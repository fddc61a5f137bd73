//! Numerical answers for reflectors that only give their values.

use super::{HORIZON, Lobe, Reflector, above, mirrored, unit};
use glam::{Vec2, Vec3};
use hr_diffuse::Rgb;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Directions per disk. Enough for lobes that are not narrower than a quarter of the disk.
const DISK_POINTS: usize = 16;

/// Glossy part averaged over the visible part of a disk, weighted by the cosine.
pub(super) fn disk_average<R: Reflector + ?Sized>(r: &R, incident: Vec3, outgoing: Vec3, extent: f32) -> Rgb {
    if extent <= 0.0 || extent.is_nan() {
        return r.glossy(incident, outgoing);
    }
    let Some(axis) = unit(incident) else {
        return Rgb::ZERO;
    };
    if !above(outgoing) {
        return Rgb::ZERO;
    }
    let (a, b) = axis.any_orthonormal_pair();
    // Vogel's spiral: points of equal solid angle, each turned by the golden angle against the one before.
    const TURN: (f32, f32) = (-0.737_368_9, 0.675_490_3);
    let whole = 2.0 * (0.5 * extent.min(FRAC_PI_2)).sin().powi(2);
    let (mut x, mut y) = (1.0_f32, 0.0_f32);
    let (mut sum, mut weight) = (Rgb::ZERO, 0.0);
    for k in 0..DISK_POINTS {
        let versine = whole * (k as f32 + 0.5) / DISK_POINTS as f32;
        let sin = (versine * (2.0 - versine)).sqrt();
        let direction = axis * (1.0 - versine) + (a * x + b * y) * sin;
        (x, y) = (x * TURN.0 - y * TURN.1, x * TURN.1 + y * TURN.0);
        if above(direction) {
            sum += r.glossy(direction, outgoing) * direction.z;
            weight += direction.z;
        }
    }
    if weight > 0.0 { sum / weight } else { Rgb::ZERO }
}

/// Mean glossy albedo, by integrating around each lobe.
pub(super) fn albedo<R: Reflector + ?Sized>(r: &R) -> Rgb {
    const COSINES: usize = 8;
    const TURNS: usize = 4;
    let mut sum = Rgb::ZERO;
    for j in 0..COSINES {
        let cos2 = (j as f32 + 0.5) / COSINES as f32;
        for k in 0..TURNS {
            let (s, c) = (TAU * (k as f32 + 0.25) / TURNS as f32).sin_cos();
            let sin = (1.0 - cos2).sqrt();
            let outgoing = Vec3::new(sin * c, sin * s, cos2.sqrt());
            sum += albedo_toward(r, outgoing);
        }
    }
    sum / (COSINES * TURNS) as f32
}

/// The lobe of one outgoing direction: its peak, and the width of a Gaussian of the same peak and energy.
pub(super) fn lobe<R: Reflector + ?Sized>(r: &R, outgoing: Vec3) -> Lobe {
    let direction = peak(r, outgoing);
    let height = importance(r, direction, outgoing);
    let energy = albedo_about(r, outgoing, direction).max_element();
    if !(height > 0.0 && energy > 0.0) {
        return Lobe::HEMISPHERE;
    }
    Lobe { direction, width: (energy / (TAU * height)).sqrt().min(FRAC_PI_2) }
}

/// What the peak is a peak of: glossy × cosine, largest channel.
fn importance<R: Reflector + ?Sized>(r: &R, incident: Vec3, outgoing: Vec3) -> f32 {
    if above(incident) { r.glossy(incident, outgoing).max_element() * incident.z } else { 0.0 }
}

/// The incident direction of the largest [`importance`], as far as a coarse grid and a refinement find it.
fn peak<R: Reflector + ?Sized>(r: &R, outgoing: Vec3) -> Vec3 {
    const HEIGHTS: usize = 8;
    const TURNS: usize = 24;
    let grid = (0..HEIGHTS * TURNS).map(|k| {
        let z = ((k / TURNS) as f32 + 0.5) / HEIGHTS as f32;
        let (s, c) = (TAU * (k % TURNS) as f32 / TURNS as f32).sin_cos();
        let sin = (1.0 - z * z).sqrt();
        Vec3::new(sin * c, sin * s, z)
    });
    let likely = [mirrored(outgoing), outgoing, Vec3::Z].into_iter().filter_map(unit);
    let mut best = (Vec3::Z, 0.0);
    for direction in likely.chain(grid) {
        let value = importance(r, direction, outgoing);
        if value > best.1 {
            best = (direction, value);
        }
    }
    // Compass search: a step to the best neighbour, or half the step where there is none better.
    let mut step = PI / TURNS as f32;
    for _ in 0..64 {
        if step < 1e-4 {
            break;
        }
        let (a, b) = best.0.any_orthonormal_pair();
        let before = best.1;
        for side in [a, -a, b, -b] {
            let Some(direction) = unit(best.0 + side * step) else {
                continue;
            };
            let value = importance(r, direction, outgoing);
            if value > best.1 {
                best = (direction, value);
            }
        }
        if best.1 <= before {
            step *= 0.5;
        }
    }
    best.0
}

/// Directional-hemispherical reflectance of the glossy part, for one direction.
pub(super) fn albedo_toward<R: Reflector + ?Sized>(r: &R, outgoing: Vec3) -> Rgb {
    albedo_about(r, outgoing, peak(r, outgoing))
}

/// The same by the reflector's own [`sample`](Reflector::sample), where that follows the lobe.
pub(super) fn albedo_by_samples<R: Reflector>(r: &R, outgoing: Vec3) -> Rgb {
    const CELLS: usize = 24;
    let drawn = (0..CELLS * CELLS).filter_map(|k| {
        let u = Vec2::new((k % CELLS) as f32 + 0.5, (k / CELLS) as f32 + 0.5) / CELLS as f32;
        r.sample(outgoing, u)
    });
    drawn.map(|sample| sample.weight).sum::<Rgb>() / (CELLS * CELLS) as f32
}

/// The same, integrated in rings about `middle` that grow with their angle, so that narrow lobes are resolved.
fn albedo_about<R: Reflector + ?Sized>(r: &R, outgoing: Vec3, middle: Vec3) -> Rgb {
    const RINGS: usize = 64;
    const TURNS: usize = 24;
    const SMALLEST: f32 = 1e-4;
    let (a, b) = middle.any_orthonormal_pair();
    let growth = (PI / SMALLEST).ln() / RINGS as f32;
    let mut sum = Rgb::ZERO;
    for k in 0..RINGS {
        let angle = SMALLEST * ((k as f32 + 0.5) * growth).exp();
        // dω = sin dψ dφ with dψ = ψ d ln ψ.
        let solid_angle = angle.sin() * angle * growth * TAU / TURNS as f32;
        let mut ring = Rgb::ZERO;
        for l in 0..TURNS {
            // Every other ring is turned by half a step.
            let (s, c) = (TAU * (l as f32 + 0.5 * (k % 2) as f32) / TURNS as f32).sin_cos();
            let incident = middle * angle.cos() + (a * c + b * s) * angle.sin();
            if incident.z > HORIZON {
                ring += r.glossy(incident, outgoing) * incident.z;
            }
        }
        sum += ring * solid_angle;
    }
    sum
}

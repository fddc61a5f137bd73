//! Integrals over the hemisphere of functions with narrow peaks whose places are known.
//!
//! Around each place a grid of cells in (logarithm of the distance, azimuth) is halved where Simpson's rule errs most, along the axis that matters.
//! Distances are angles, or for the mirror direction slopes of half vectors: there microfacet lobes are ellipses along
//! the axes at every angle, however they are stretched in directions. Several places share the hemisphere by
//! smooth weights (d⁻⁴, d the distance), so that each grid sees its own peak only.

use glam::{DVec2, DVec3, DVec4, Vec3, Vec4};
use std::array::from_fn;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};
use std::iter::zip;

/// Where a peak may be, and how directions are counted around it.
#[derive(Clone, Copy, Debug)]
enum Chart {
    /// Slopes of the half vector with this direction.
    Slopes(DVec3),
    /// Angles from this direction; two tangents.
    Angles(DVec3, DVec3, DVec3),
}

/// Natural logarithms of the smallest and largest slope or angle. A lobe that is narrower does not differ from a mirror.
const SMALLEST: f64 = -18.5;
const LARGEST_SLOPE: f64 = 13.0;
/// First cells per turn: axes, diagonals and what is between are seen at once.
const TURNS: usize = 16;
/// First cells per unit of the logarithm.
const DENSITY: f64 = 1.0;

/// Peaks that are lower than this share of the highest need no chart.
const LOWEST_PEAK: f32 = 1e-3;

impl Chart {
    fn around(direction: Vec3) -> Self {
        let axis = direction.as_dvec3().normalize_or(DVec3::Z);
        // One tangent in the plane of the normal, in which lobes are cut off by the horizon.
        let y = DVec3::Z.cross(axis).normalize_or(DVec3::Y);
        Self::Angles(axis, y.cross(axis), y)
    }

    fn middle(&self) -> DVec3 {
        match *self {
            Self::Slopes(outgoing) => DVec3::new(-outgoing.x, -outgoing.y, outgoing.z),
            Self::Angles(axis, ..) => axis,
        }
    }

    fn largest(&self) -> f64 {
        match self {
            Self::Slopes(_) => LARGEST_SLOPE,
            Self::Angles(..) => PI.ln(),
        }
    }

    /// The direction at (logarithm, azimuth), and solid angle by the area of the chart.
    fn at(&self, p: DVec2) -> (DVec3, f64) {
        let r = p.x.exp();
        let (s, c) = p.y.sin_cos();
        match *self {
            Self::Slopes(outgoing) => {
                let h = DVec3::new(r * c, r * s, 1.0).normalize();
                let cos = outgoing.dot(h);
                // dω of the half vector is r dr dφ cos³; that of the direction 4 cos(o, h) times more.
                (2.0 * cos * h - outgoing, 4.0 * cos.max(0.0) * r * r * h.z.powi(3))
            }
            Self::Angles(axis, x, y) => (axis * r.cos() + (x * c + y * s) * r.sin(), r.sin().max(0.0) * r),
        }
    }
}

/// A rectangle of a chart, its integral and how far that may be off.
struct Cell {
    chart: usize,
    low: DVec2,
    size: DVec2,
    sum: DVec4,
    error: f64,
    /// The axis along which the function is less straight.
    axis: usize,
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Cell {}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error)
    }
}

/// ∫ f dω over the hemisphere above z = 0, to about `accuracy` in every channel. Peaks may be in the directions given and
/// in that of the mirror image of `outgoing`; at most about `budget` values of f are used.
pub(super) fn hemisphere(
    f: impl Fn(Vec3) -> Vec4,
    outgoing: Vec3,
    peaks: &[Vec3],
    accuracy: f64,
    budget: usize,
) -> DVec4 {
    let mut charts = vec![Chart::Slopes(outgoing.as_dvec3())];
    let height = |v: Vec3| f(v).abs().max_element();
    let mirror = Vec3::new(-outgoing.x, -outgoing.y, outgoing.z);
    let highest = peaks.iter().fold(height(mirror), |most, &v| most.max(height(v)));
    for &peak in peaks {
        let chart = Chart::around(peak);
        // A chart would take its share of what is better seen in that of a true peak.
        if height(peak) > LOWEST_PEAK * highest && charts.iter().all(|c| c.middle().distance(chart.middle()) > 1e-3) {
            charts.push(chart);
        }
    }
    let value = |chart: usize, p: DVec2| {
        let (direction, area) = charts[chart].at(p);
        if direction.z <= 0.0 || area <= 0.0 {
            return DVec4::ZERO;
        }
        let weight = |c: &Chart| direction.distance_squared(c.middle()).max(1e-40).powi(-2);
        let share = weight(&charts[chart]) / charts.iter().map(weight).sum::<f64>();
        f(direction.as_vec3().normalize()).as_dvec4() * (area * share)
    };
    let cell = |chart: usize, low: DVec2, size: DVec2| {
        let values: [DVec4; 9] =
            from_fn(|k| value(chart, low + size * DVec2::new((k % 3) as f64, (k / 3) as f64) * 0.5));
        // Second differences along each axis.
        let bend =
            |at: usize, step: usize| (values[at] - 2.0 * values[at + step] + values[at + 2 * step]).abs().max_element();
        let bends = [bend(0, 1) + bend(3, 1) + bend(6, 1), bend(0, 3) + bend(1, 3) + bend(2, 3)];
        let simpson: DVec4 = zip(values, [1.0, 4.0, 1.0, 4.0, 16.0, 4.0, 1.0, 4.0, 1.0]).map(|(v, w)| v * w).sum();
        let corners = values[0] + values[2] + values[6] + values[8];
        let area = size.x * size.y;
        Cell {
            chart,
            low,
            size,
            sum: simpson * (area / 36.0),
            error: (simpson / 36.0 - corners / 4.0).abs().max_element() * area,
            axis: usize::from(bends[1] > bends[0]),
        }
    };
    let mut cells = BinaryHeap::new();
    let mut used = 0;
    for (index, chart) in charts.iter().enumerate() {
        let range = chart.largest() - SMALLEST;
        let rings = (range * DENSITY).ceil() as usize;
        let size = DVec2::new(range / rings as f64, TAU / TURNS as f64);
        for k in 0..rings * TURNS {
            let low = DVec2::new(SMALLEST + size.x * (k / TURNS) as f64, size.y * (k % TURNS) as f64);
            cells.push(cell(index, low, size));
        }
        used += 9 * rings * TURNS;
    }
    let mut error: f64 = cells.iter().map(|c| c.error).sum();
    while error > accuracy && used < budget {
        let Some(coarse) = cells.pop() else { break };
        let half = if coarse.axis == 0 { DVec2::new(0.5, 1.0) } else { DVec2::new(1.0, 0.5) };
        let (size, step) = (coarse.size * half, coarse.size * (DVec2::ONE - half));
        let mut parts = [coarse.low, coarse.low + step].map(|low| cell(coarse.chart, low, size));
        used += 18;
        // What the finer rule changes tells the error, once the rule has begun to converge; each part keeps a share.
        let change = (parts.iter().map(|p| p.sum).sum::<DVec4>() - coarse.sum).abs().max_element();
        for part in &mut parts {
            part.error = part.error.min(change.max(0.1 * part.error));
            error += part.error;
        }
        error -= coarse.error;
        cells.extend(parts);
    }
    cells.iter().map(|c| c.sum).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reflector::Reflector;
    use crate::{Phong, Rgb, Ward};

    #[test]
    fn known_integrals() {
        for degrees in [0.0_f32, 30.0, 80.0, 89.9] {
            let (s, c) = degrees.to_radians().sin_cos();
            let outgoing = Vec3::new(s, 0.0, c);
            let cosine = hemisphere(|v| Vec4::splat(v.z), outgoing, &[outgoing, Vec3::Z], 1e-3, 100_000);
            assert!((cosine.x - PI).abs() < 3e-3, "the cosine over the hemisphere, {degrees}°: {cosine}");
        }
        // At normal incidence the albedo of Phong is ks; that of Ward tends to rs for a smooth surface.
        let narrow = Phong::new(Rgb::ZERO, Rgb::ONE, 1e5).expect("a lobe");
        let albedo = hemisphere(|i| (narrow.eval(i, Vec3::Z) * i.z).extend(0.0), Vec3::Z, &[], 1e-3, 100_000);
        assert!((albedo.x - 1.0).abs() < 3e-3, "Phong's lobe: {albedo}");
        for degrees in [0.0_f32, 60.0, 85.0] {
            let (s, c) = degrees.to_radians().sin_cos();
            let outgoing = Vec3::new(s, 0.0, c);
            let ward = Ward::anisotropic(Rgb::ZERO, Rgb::ONE, glam::Vec2::new(1e-3, 4e-3), Vec3::X).expect("a lobe");
            let albedo = hemisphere(|i| (ward.eval(i, outgoing) * i.z).extend(0.0), outgoing, &[], 1e-3, 100_000);
            // The facets' mean of 2 cos i/(cos i + cos o) is 1 up to a few α.
            assert!((albedo.x - 1.0).abs() < 6e-3, "Ward's lobe at {degrees}°: {albedo}");
        }
    }
}

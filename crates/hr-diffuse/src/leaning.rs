//! Leaning senders: what is near shows that an element is not as bright everywhere.
//!
//! Links carry light as if every element sent it evenly. A vertex in the corner of two walls sees mostly those parts of the other
//! wall that are nearest, which are darker than its leaf, or brighter. So light of near leaves is changed by how their irradiance
//! leans, as vertices tell it, and by which parts of them are seen most: what linear elements would send (H. R. Zatz,
//! "Galerkin radiosity", SIGGRAPH 1993), by values that are known already.

use crate::hooks::LightField;
use crate::transport::Light;
use crate::vertices::{Vertices, point_on};
use crate::{Domain, Rgb};
use glam::{Vec2, Vec3};
use smallvec::SmallVec;

/// Senders are near whose radius is larger than this share of their distance.
const NEAR: f32 = 0.2;
/// Side of the grid of points by which it is found which parts of a leaf are seen most: of one that is farther than its radius, and
/// of a nearer one.
const GRIDS: [u32; 2] = [4, 8];
/// A leaf's light changes by no more than this share.
const MOST: f32 = 0.5;

/// What a point sees of the senders near to it.
#[derive(Clone, Debug)]
pub(crate) struct Sight {
    pub(crate) at: Vec3,
    pub(crate) normal: Vec3,
    /// Each with its visibility.
    pub(crate) senders: SmallVec<[(u32, f32); 4]>,
    /// What is negligible there (see [`negligible`](crate::transport::negligible)).
    pub(crate) negligible: f32,
}

impl Sight {
    /// How much of a small part of a surface is seen, but for its area, given a point of it and the normal there.
    fn sees(&self, (point, normal): (Vec3, Vec3)) -> f32 {
        let to = point - self.at;
        let distance2 = to.length_squared().max(f32::MIN_POSITIVE);
        to.dot(self.normal).max(0.0) * (-to.dot(normal)).max(0.0) / (distance2 * distance2)
    }
}

/// By node, how the irradiance of a leaf changes with (u, v).
#[derive(Debug)]
pub(crate) struct Leaning {
    slopes: Vec<[Rgb; 2]>,
}

/// Whether a sender is near to a point.
pub(crate) fn is_near<L: LightField>(light: Light<'_, L>, at: Vec3, sender: u32) -> bool {
    let element = light.element(sender);
    element.radius > NEAR * at.distance(element.center)
}

impl Leaning {
    /// Of all leaves, by the irradiance at their vertices.
    pub(crate) fn new<L: LightField>(light: Light<'_, L>, vertices: &Vertices) -> Self {
        let mut slopes = vec![[Rgb::ZERO; 2]; light.elements.nodes.len()];
        for leaf in light.elements.patch_leaves() {
            let (mut sum, mut area) = ([Rgb::ZERO; 2], 0.0);
            for [middle, a, b] in vertices.triangles(leaf) {
                let (p, q) = (a.uv - middle.uv, b.uv - middle.uv);
                let [value, along_p, along_q] =
                    [middle, a, b].map(|corner| vertices.irradiance[corner.vertex as usize]);
                let (along_p, along_q, twice) = (along_p - value, along_q - value, p.perp_dot(q));
                // The slope of the triangle times its area.
                let sign = twice.signum();
                sum[0] += (along_p * q.y - along_q * p.y) * sign;
                sum[1] += (along_q * p.x - along_p * q.x) * sign;
                area += twice.abs();
            }
            if area > 0.0 {
                slopes[leaf as usize] = sum.map(|sum| sum / area);
            }
        }
        Self { slopes }
    }

    /// What senders bring to a point beside what they would if they sent evenly.
    pub(crate) fn beside<L: LightField>(&self, light: Light<'_, L>, sight: &Sight) -> Rgb {
        sight.senders.iter().map(|&(sender, seen)| self.from(light, sight, sender) * seen).sum()
    }

    fn from<L: LightField>(&self, light: Light<'_, L>, sight: &Sight, sender: u32) -> Rgb {
        let element = light.element(sender);
        let weakened = sight.at.distance_squared(element.center) * sight.negligible;
        let matters = |light: Rgb| light.max_element() * element.radius * element.radius > weakened;
        if !is_near(light, sight.at, sender) || !matters(light.exitant.range[sender as usize][1] * MOST) {
            return Rgb::ZERO;
        }
        if element.child_count > 0 {
            let children = element.first_child..element.first_child + element.child_count;
            return children.map(|child| self.from(light, sight, child)).sum();
        }
        if !element.is_patch() || element.reflectance == Rgb::ZERO {
            return Rgb::ZERO;
        }
        // What is seen most is within the leaf, so that no more than this can change.
        let ([along_u, along_v], Domain { u0, v0, u1, v1 }) = (self.slopes[sender as usize], element.domain);
        let across = along_u.abs() * (u1 - u0).abs() + along_v.abs() * (v1 - v0).abs();
        let most = across.min(light.exitant.irradiance[sender as usize] * MOST);
        if !matters(element.reflectance * most) {
            return Rgb::ZERO;
        }
        let factor = light.factor_at(sight.at, sight.normal, sender);
        if factor <= 0.0 {
            return Rgb::ZERO;
        }
        let shift = shift(light, sight, sender);
        let change = (along_u * shift.x + along_v * shift.y).clamp(-most, most);
        element.reflectance * change * factor
    }
}

/// From the middle of a leaf to that of what a point sees of it, in (u, v).
fn shift<L: LightField>(light: Light<'_, L>, sight: &Sight, sender: u32) -> Vec2 {
    let element = light.element(sender);
    let geometry = &light.scene.surfaces()[element.source as usize];
    let Domain { u0, v0, u1, v1 } = element.domain;
    let size = Vec2::new(u1 - u0, v1 - v0);
    let point = |share: Vec2| point_on(light.scene, light.elements, sender, element.domain.lerp(share.x, share.y));
    let grid = GRIDS[usize::from(sight.at.distance(element.center) < element.radius)];
    if !geometry.is_polygon() {
        return size * mean_share((grid, false), |share| sight.sees(point(share)));
    }
    // Points of polygons need not be looked up one by one.
    let [origin, end_u, end_v] = [Vec2::ZERO, Vec2::X, Vec2::Y].map(|share| point(share).0);
    let is_triangle = geometry.corners(Domain::WHOLE).len() == 3;
    let (along_u, along_v) = (end_u - origin, end_v - origin);
    let twist = if is_triangle { Vec3::ZERO } else { point(Vec2::ONE).0 - end_u - along_v };
    let on_plane = |share: Vec2| origin + along_u * share.x + along_v * share.y + twist * (share.x * share.y);
    size * mean_share((grid, is_triangle), |share| sight.sees((on_plane(share), element.normals.axis)))
}

/// How far the mean of a grid of points in the unit square, or its lower triangle, weighted by `weight`, is from that of all of them.
fn mean_share((grid, is_triangle): (u32, bool), weight: impl Fn(Vec2) -> f32) -> Vec2 {
    let (mut all, mut seen, mut total) = (Vec2::ZERO, Vec2::ZERO, 0.0);
    for i in 0..grid * grid {
        let mut share = (Vec2::new((i % grid) as f32, (i / grid) as f32) + 0.5) / grid as f32;
        if is_triangle && share.x + share.y > 1.0 {
            share = 1.0 - share;
        }
        let weight = weight(share);
        all += share;
        seen += share * weight;
        total += weight;
    }
    if total > 0.0 { seen / total - all / (grid * grid) as f32 } else { Vec2::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vertices::outlines;
    use crate::{DiffuseMaterial, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;
    use smallvec::smallvec;
    use std::f32::consts::FRAC_1_PI;

    /// A floor that is dark on one side and bright on the other, seen from upright places on it, against what the sum over small parts
    /// says.
    #[test]
    fn points_see_what_is_near_them() {
        const STEPS: u32 = 400;
        let (x, y) = (DVec3::X, DVec3::Y);
        let floor = Surface::new(Shape::Quad([DVec3::ZERO, x, x + y, y]), 0);
        let material = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ONE, two_sided: false };
        let input = SceneInput { surfaces: vec![floor], materials: vec![material], ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.5), ()).expect("a floor");
        let leaf = solver.elements.surface_nodes[0][0];
        solver.exitant.irradiance[leaf as usize] = Rgb::splat(0.5);
        let light = solver.light();
        let mut vertices = outlines(light.scene, light.elements).fans(light.scene, light.elements);
        vertices.irradiance = vertices.uv.iter().map(|uv| Rgb::splat(uv.x)).collect();
        let leaning = Leaning::new(light, &vertices);
        let to_unit = |point: DVec3| light.scene.normalization.to_unit(point);
        for (place, normal) in [(0.05, Vec3::X), (0.4, Vec3::X), (0.6, Vec3::NEG_X), (0.95, Vec3::NEG_X)] {
            let at = to_unit(DVec3::new(place, 0.5, 0.1));
            let (mut right, mut even) = (0.0, 0.0);
            for i in 0..STEPS * STEPS {
                let uv = (Vec2::new((i % STEPS) as f32, (i / STEPS) as f32) + 0.5) / STEPS as f32;
                let to = to_unit(uv.as_dvec2().extend(0.0)) - at;
                let cosines = to.dot(normal).max(0.0) * (-to.z).max(0.0) / to.length_squared();
                let area = light.element(leaf).area / (STEPS * STEPS) as f32;
                let factor = cosines / to.length_squared() * area * FRAC_1_PI;
                right += 0.5 * uv.x * factor;
                even += 0.5 * 0.5 * factor;
            }
            let ours = leaning.beside(light, &Sight { at, normal, senders: smallvec![(leaf, 1.0)], negligible: 0.0 }).x;
            assert!((even + ours - right).abs() < 0.07 * right, "at {place}: {even} + {ours}, not {right}");
            let half = leaning.beside(light, &Sight { at, normal, senders: smallvec![(leaf, 0.5)], negligible: 0.0 }).x;
            assert!((half - 0.5 * ours).abs() < 1e-6, "half of it is seen");
            for negligible in [0.01, 0.1, 1.0].map(|share| share * right) {
                let rough = leaning.beside(light, &Sight { at, normal, senders: smallvec![(leaf, 1.0)], negligible }).x;
                assert!((rough - ours).abs() <= negligible, "no more is missing than is negligible: {rough}, {ours}");
            }
            let afar = leaning.beside(
                light,
                &Sight { at: at + 9.0 * Vec3::Z, normal, senders: smallvec![(leaf, 1.0)], negligible: 0.0 },
            );
            assert_eq!(afar, Rgb::ZERO, "from afar all is seen alike");
        }
    }
}

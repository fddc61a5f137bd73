//! The bounded oracle (paper, section 3.1): boxes and normal cones bound the directions between two elements;
//! with them come bounds of the form factor, and with those of the sender's radiosity a minimum and a maximum
//! of the irradiance that a link carries.

use crate::beams::Beam;
use crate::form_factor::IN_PLANE;
use crate::hierarchy::{Element, Kind, SceneData};
use crate::{Aabb, Cone, LightKind};
use glam::Vec3;
use std::f32::consts::PI;

/// Bounds of what one unit of the sender's radiosity (or intensity, for lights without extent) makes of
/// irradiance at any point of the receiver, unoccluded. On receivers that are not flat the irradiance is that on a
/// plane perpendicular to the direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorBounds {
    /// Smallest irradiance per unit of radiosity, ≥ 0.
    pub min: f32,
    /// Largest; at most 1 for senders with extent.
    pub max: f32,
    /// Directions from the sender toward the receiver.
    pub from_sender: Cone,
}

impl FactorBounds {
    /// Of pairs that do not face each other.
    pub(crate) const NONE: Self = Self { min: 0.0, max: 0.0, from_sender: Cone::SPHERE };
}

/// Bounds for a pair, or `None` where the elements provably do not face each other: no light passes.
#[must_use]
pub fn factor_bounds(scene: &SceneData, receiver: &Element, sender: &Element) -> Option<FactorBounds> {
    if sender.kind == Kind::Light {
        return light_bounds(scene, receiver, sender);
    }
    if behind(scene, receiver, sender) || behind(scene, sender, receiver) {
        return None;
    }
    let apart = sender.center - receiver.center;
    let distance = apart.length();
    let (r_radius, s_radius) = (radius(receiver), radius(sender));
    let toward = Toward::new(apart, r_radius + s_radius);
    let from_sender = toward.cone().opposite();
    let (near, far) = box_distances(receiver.bounds, sender.bounds);
    let near = near.max(distance - r_radius - s_radius).max(1e-15);
    let far = far.min(distance + r_radius + s_radius) + ROUNDING;
    // Cosines at the receiver, by cones and by heights over its plane; of a tilted plane that follows the sender's middle
    // nothing is farther off than the ball around it.
    let (mut r_min, mut r_max) = toward.cosines(&receiver.normals, 1.0);
    let heights = is_plane(receiver).then(|| heights(scene, receiver, sender));
    if !receiver.is_flat() {
        let clear = distance - r_radius;
        let sine = if clear > s_radius { s_radius / clear } else { 1.0 };
        (r_min, r_max) = ((1.0 - sine * sine).max(0.0).sqrt(), if r_max > 0.0 { 1.0 } else { r_max });
    } else if let Some((low, high)) = heights {
        (r_min, r_max) = (r_min.max(low / far), r_max.min(high / near));
    }
    if sender.whole_sphere {
        let above = heights.is_some_and(|(low, _)| low > 0.0);
        return (r_max > 0.0).then(|| sphere_bounds(receiver, sender, (r_min, r_max), above, from_sender));
    }
    let (mut s_min, mut s_max) = toward.cosines(&sender.normals, -1.0);
    if is_plane(sender) {
        let (low, high) = self::heights(scene, sender, receiver);
        // What is in the sender's plane to rounding is taken to see nothing of it.
        let low = if low > 2.0 * IN_PLANE { low } else { 0.0 };
        (s_min, s_max) = (s_min.max(low / far).min(if low > 0.0 { 1.0 } else { 0.0 }), s_max.min(high / near));
    }
    if r_max <= 0.0 || s_max <= 0.0 {
        return None;
    }
    // All that is within a ball, however arranged, subtends no more than the ball.
    let clear = (distance - r_radius).max(box_distances(receiver.bounds, [sender.center; 2]).0);
    let ball = if clear > s_radius { (s_radius / clear).powi(2) } else { 1.0 };
    let area = sender.area / PI;
    let max = (area * s_max * r_max / (near * near)).min(ball * r_max).min(1.0);
    let min = if sender.is_patch() { (area * s_min.max(0.0) * r_min.max(0.0) / (far * far)).min(max) } else { 0.0 };
    Some(FactorBounds { min, max, from_sender })
}

/// Bounds for a whole sphere: cos θ (r/d)² where it is above the horizon, never more than the ball subtends.
fn sphere_bounds(
    receiver: &Element,
    sender: &Element,
    (r_min, r_max): (f32, f32),
    above: bool,
    from_sender: Cone,
) -> FactorBounds {
    let distance = sender.center.distance(receiver.center);
    let (near, far) = box_distances(receiver.bounds, [sender.center; 2]);
    let (near, far) = (near.max(distance - radius(receiver)), far.min(distance + radius(receiver)) + ROUNDING);
    // The radius without the rounding of the box; of a sphere it is exact.
    let radius2 = sender.area / (4.0 * PI);
    let share = |distance: f32| (radius2 / (distance * distance)).min(1.0);
    let (mut min, mut max) = (r_min.max(0.0) * share(far), r_max * share(near));
    if !receiver.is_flat() {
        // The plane faces the sphere's middle.
        (min, max) = (share(far), share(near));
    } else if above {
        let height = (sender.center - receiver.center).dot(receiver.normals.axis);
        min = min.max((height - ROUNDING) / far * share(far));
        max = max.min((height + ROUNDING) / near * share(near));
    }
    FactorBounds { min: min.min(max), max: max.min(1.0), from_sender }
}

/// Radius about its middle that holds an element: of whole spheres their own, not that of their box.
fn radius(element: &Element) -> f32 {
    if element.whole_sphere { (element.area / (4.0 * PI)).sqrt() + ROUNDING } else { element.radius }
}

/// Rounding of positions in unit space.
const ROUNDING: f32 = Aabb::ROUNDING;

/// Directions from one ball to another: those within an angle of an axis. Angles are kept by sine and cosine, as the
/// arc cosine of f32 is off by up to 3e-4 near 1, which would let light be lost at the horizon.
struct Toward {
    axis: Vec3,
    /// Sine and cosine of the half-angle; `None` where the balls overlap.
    half: Option<(f32, f32)>,
}

impl Toward {
    fn new(apart: Vec3, reach: f32) -> Self {
        let distance = apart.length();
        if distance > reach * 1.0001 && distance > 0.0 {
            let sine = reach / distance;
            let cosine = ((1.0 - sine) * (1.0 + sine)).sqrt();
            Self { axis: apart / distance, half: Some((sine, cosine)) }
        } else {
            Self { axis: Vec3::Z, half: None }
        }
    }

    fn cone(&self) -> Cone {
        self.half.map_or(Cone::SPHERE, |(_, cosine)| Cone { axis: self.axis, cos_angle: cosine })
    }

    /// Smallest and largest cosine between these directions (times `sign`) and a cone of normals.
    fn cosines(&self, normals: &Cone, sign: f32) -> (f32, f32) {
        let Some((sine, cosine)) = self.half else { return (-1.0, 1.0) };
        // Both half-angles together; a cone of a single direction has none.
        let (other_cos, other_sin) = if normals.cos_angle >= 1.0 {
            (1.0, 0.0)
        } else {
            (normals.cos_angle, ((1.0 - normals.cos_angle) * (1.0 + normals.cos_angle)).max(0.0).sqrt())
        };
        let half_cos = cosine * other_cos - sine * other_sin;
        let half_sin = sine * other_cos + cosine * other_sin;
        // The half-angle is 180° or more: every cosine is possible.
        if half_sin < 0.0 || normals.cos_angle <= -1.0 {
            return (-1.0, 1.0);
        }
        let between_cos = (self.axis.dot(normals.axis) * sign).clamp(-1.0, 1.0);
        let between_sin = self.axis.cross(normals.axis).length();
        let low = if -between_cos >= half_cos { -1.0 } else { between_cos * half_cos - between_sin * half_sin };
        let high = if between_cos >= half_cos { 1.0 } else { between_cos * half_cos + between_sin * half_sin };
        (low - COSINE_ROUNDING, (high + COSINE_ROUNDING).min(1.0))
    }
}

/// Rounding of cosines: of a few products of unit vectors in f32.
const COSINE_ROUNDING: f32 = 4.0 * f32::EPSILON;

/// Whether all of an element lies in one plane exactly; [`Element::is_flat`] takes nearly flat ones, too.
fn is_plane(element: &Element) -> bool {
    element.is_flat() && element.normals.cos_angle >= 1.0
}

/// Smallest and largest height of an element over the plane of a flat one, rounding included.
fn heights(scene: &SceneData, flat: &Element, other: &Element) -> (f32, f32) {
    let (n, origin) = (flat.normals.axis, flat.center);
    let height = |point: Vec3| (point - origin).dot(n);
    if other.is_patch() && scene.surfaces()[other.source as usize].is_polygon() {
        let geometry = &scene.surfaces()[other.source as usize];
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for uv in geometry.corners(other.domain) {
            let h = height(geometry.point(uv));
            (low, high) = (low.min(h), high.max(h));
        }
        return (low - ROUNDING, high + ROUNDING);
    }
    let up = n.cmpge(Vec3::ZERO);
    let low = height(Vec3::select(up, other.bounds[0], other.bounds[1]));
    let high = height(Vec3::select(up, other.bounds[1], other.bounds[0]));
    let (middle, radius) = (height(other.center), radius(other));
    (low.max(middle - radius) - ROUNDING, high.min(middle + radius) + ROUNDING)
}

fn light_bounds(scene: &SceneData, receiver: &Element, sender: &Element) -> Option<FactorBounds> {
    let light = &scene.lights[sender.source as usize];
    let flat = receiver.is_flat();
    if let LightKind::Directional { direction } = light.kind {
        let (low, high) = receiver.normals.cosines(-direction);
        if high <= 0.0 {
            return None;
        }
        let (min, max) = if flat { (low.max(0.0), high) } else { (1.0, 1.0) };
        return Some(FactorBounds { min, max, from_sender: Cone::single(direction) });
    }
    if behind(scene, receiver, sender) {
        return None;
    }
    let apart = sender.center - receiver.center;
    let toward = Toward::new(apart, radius(receiver));
    let (low, high) = toward.cosines(&receiver.normals, 1.0);
    if high <= 0.0 {
        return None;
    }
    let (low, high) = if flat { (low.max(0.0), high) } else { (1.0, 1.0) };
    let (near, far) = box_distances(receiver.bounds, sender.bounds);
    let from_sender = toward.cone().opposite();
    let [spot_min, spot_max] = Beam::of(scene, sender).map_or([1.0; 2], |beam| beam.ramp(receiver));
    if spot_max <= 0.0 {
        return None;
    }
    let max = high * spot_max / (near * near).max(1e-12);
    let min = (low * spot_min / (far * far).max(1e-12)).min(max);
    Some(FactorBounds { min, max, from_sender })
}

/// Whether all of `other` lies behind the plane of `element` (or in it); behind all planes of a cluster that faces one way, by
/// boxes. Neighbours in one plane never see each other.
fn behind(scene: &SceneData, element: &Element, other: &Element) -> bool {
    let n = element.normals.axis;
    if element.kind == Kind::Cluster && element.normals.cos_angle >= 1.0 {
        let up = n.cmpge(Vec3::ZERO);
        let lowest = Vec3::select(up, element.bounds[0], element.bounds[1]);
        let highest = Vec3::select(up, other.bounds[1], other.bounds[0]);
        return (highest - lowest).dot(n) - 2.0 * ROUNDING * n.abs().element_sum() <= IN_PLANE;
    }
    is_plane(element) && heights(scene, element, other).1 - ROUNDING <= IN_PLANE
}

/// Smallest and largest distance between points of two boxes.
fn box_distances(a: [Vec3; 2], b: [Vec3; 2]) -> (f32, f32) {
    let gap = (a[0] - b[1]).max(b[0] - a[1]).max(Vec3::ZERO);
    let span = (a[1] - b[0]).abs().max((b[1] - a[0]).abs());
    (gap.length(), span.length())
}

#[cfg(test)]
mod tests;

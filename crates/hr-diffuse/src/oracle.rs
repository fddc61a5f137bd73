//! The bounded oracle (paper, section 3.1): boxes and normal cones bound the directions between two elements;
//! with them come bounds of the form factor, and with those of the sender's radiosity a minimum and a maximum
//! of the irradiance that a link carries.

use crate::form_factor::IN_PLANE;
use crate::hierarchy::{Element, Kind, SceneData};
use crate::{Cone, LightKind};
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
    let reach = receiver.radius + sender.radius;
    let toward = if distance > reach * 1.0001 && distance > 0.0 {
        let sine = reach / distance;
        Cone { axis: apart / distance, cos_angle: (1.0 - sine * sine).sqrt() }
    } else {
        Cone::SPHERE
    };
    let from_sender = toward.opposite();
    let (r_min, r_max) = if receiver.is_flat() {
        receiver.normals.cosines_with(&toward)
    } else {
        let (_, most) = receiver.normals.cosines_with(&toward);
        (1.0, if most > 0.0 { 1.0 } else { most })
    };
    let (s_min, s_max) = if sender.whole_sphere { (0.25, 0.25) } else { sender.normals.cosines_with(&from_sender) };
    if r_max <= 0.0 || s_max <= 0.0 {
        return None;
    }
    let (near, far) = box_distances(receiver.bounds, sender.bounds);
    // All that is within a ball, however arranged, subtends no more than the ball.
    let clear = distance - receiver.radius;
    let ball = if clear > sender.radius { (sender.radius / clear).powi(2) } else { 1.0 };
    let area = sender.area / PI;
    let max = (area * s_max * r_max / (near * near).max(1e-30)).min(ball * r_max).min(1.0);
    let opaque = sender.is_patch() || sender.whole_sphere;
    let min = if opaque && far > 0.0 { (area * s_min.max(0.0) * r_min.max(0.0) / (far * far)).min(max) } else { 0.0 };
    Some(FactorBounds { min, max, from_sender })
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
    let distance = apart.length();
    let toward = if distance > receiver.radius * 1.0001 {
        let sine = receiver.radius / distance;
        Cone { axis: apart / distance, cos_angle: (1.0 - sine * sine).sqrt() }
    } else {
        Cone::SPHERE
    };
    let (low, high) = receiver.normals.cosines_with(&toward);
    if high <= 0.0 {
        return None;
    }
    let (low, high) = if flat { (low.max(0.0), high) } else { (1.0, 1.0) };
    let (near, far) = box_distances(receiver.bounds, sender.bounds);
    let from_sender = toward.opposite();
    let (spot_min, spot_max) = match light.kind {
        LightKind::Spot { direction, cos_inner, cos_outer } => {
            let (least, most) = from_sender.cosines(direction);
            (spot_ramp(least, cos_inner, cos_outer), spot_ramp(most, cos_inner, cos_outer))
        }
        _ => (1.0, 1.0),
    };
    if spot_max <= 0.0 {
        return None;
    }
    let max = high * spot_max / (near * near).max(1e-8);
    let min = (low * spot_min / (far * far).max(1e-8)).min(max);
    Some(FactorBounds { min, max, from_sender })
}

/// The ramp of a spot light between its inner and outer cone (`KHR_lights_punctual`, "Inner and Outer Cone
/// Angles"): the clamped linear function of the cosine, squared.
#[must_use]
pub fn spot_ramp(cosine: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    let t = ((cosine - cos_outer) / (cos_inner - cos_outer).max(1e-4)).clamp(0.0, 1.0);
    t * t
}

/// Whether all of `other` lies behind the plane of `element` (or in it).
fn behind(scene: &SceneData, element: &Element, other: &Element) -> bool {
    if !element.is_flat() {
        return false;
    }
    let n = element.normals.axis;
    let height = |point: Vec3| (point - element.center).dot(n);
    if other.is_patch() && scene.surfaces()[other.source as usize].is_polygon() {
        let geometry = &scene.surfaces()[other.source as usize];
        return geometry.corners(other.domain).iter().all(|&uv| height(geometry.point(uv)) <= IN_PLANE);
    }
    height(Vec3::select(n.cmpge(Vec3::ZERO), other.bounds[1], other.bounds[0])) <= IN_PLANE
}

/// Smallest and largest distance between points of two boxes.
fn box_distances(a: [Vec3; 2], b: [Vec3; 2]) -> (f32, f32) {
    let gap = (a[0] - b[1]).max(b[0] - a[1]).max(Vec3::ZERO);
    let span = (a[1] - b[0]).abs().max((b[1] - a[0]).abs());
    (gap.length(), span.length())
}

//! Beams: the light of a spot ends at an edge of its own, which may lie anywhere on a receiver. A few points of it may miss all that
//! there is; bounds of directions do not.

use crate::geometry::{Aabb, Domain, Geometry};
use crate::hierarchy::{Element, Kind, SceneData};
use crate::scene::LightKind;
use glam::Vec3;
use std::f32::consts::PI;

/// Where the ramp of a cone differs by less than this it is taken as even, …
const EVEN: f32 = 0.1;
/// … and where what is seen of it from the light is below this share of the cone's angle, its middle tells enough.
const FINE: f32 = 0.1;
/// Cuts after which it does anyhow: where a light touches a surface no part is small.
const MOST_CUTS: u32 = 12;
/// Cosines of a cone's angles are at least so far apart: no ramp is steeper.
const STEEPEST: f32 = 1e-6;

/// The ramp of a spot light between its inner and outer cone (`KHR_lights_punctual`, "Inner and Outer Cone
/// Angles"): the clamped linear function of the cosine, squared.
#[must_use]
pub fn spot_ramp(cosine: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    let t = ((cosine - cos_outer) / (cos_inner - cos_outer).max(STEEPEST)).clamp(0.0, 1.0);
    t * t
}

/// Solid angle of a spot's outer cone; that of all directions for a point.
pub(crate) fn solid_angle(kind: LightKind) -> f32 {
    let cos_outer = if let LightKind::Spot { cos_outer, .. } = kind { cos_outer } else { -1.0 };
    2.0 * PI * (1.0 - cos_outer)
}

/// The cone that a spot shines in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    position: Vec3,
    direction: Vec3,
    cos_inner: f32,
    cos_outer: f32,
}

impl Beam {
    /// That of a sender, if it is a spot.
    pub(crate) fn of(scene: &SceneData, sender: &Element) -> Option<Self> {
        if sender.kind != Kind::Light {
            return None;
        }
        match scene.lights[sender.source as usize].kind {
            LightKind::Spot { direction, cos_inner, cos_outer } => {
                Some(Self { position: sender.center, direction, cos_inner, cos_outer })
            }
            LightKind::Point | LightKind::Directional { .. } => None,
        }
    }

    /// Smallest and largest ramp on a receiver.
    pub(crate) fn ramp(&self, receiver: &Element) -> [f32; 2] {
        let [min, max] = receiver.bounds;
        self.within(&Aabb { min, max })
    }

    /// Whether it ends on a receiver, or fades.
    pub(crate) fn ends_on(&self, receiver: &Element) -> bool {
        let [least, most] = self.ramp(receiver);
        most - least > EVEN
    }

    /// Smallest and largest ramp within a box.
    fn within(&self, bounds: &Aabb) -> [f32; 2] {
        let (angle, half) = self.seen(bounds);
        let ramp = |angle: f32| spot_ramp(angle.clamp(0.0, PI).cos(), self.cos_inner, self.cos_outer);
        [ramp(angle + half), ramp(angle - half)]
    }

    /// Angle between its axis and the middle of a box, and half of that which the box takes up.
    fn seen(&self, bounds: &Aabb) -> (f32, f32) {
        let to = bounds.center() - self.position;
        // Of nearly parallel directions the sine tells more than the cosine.
        let angle = self.direction.cross(to).length().atan2(self.direction.dot(to));
        let (radius, distance) = (bounds.radius(), to.length());
        // From within it is seen all around.
        (angle, if radius < distance { (radius / distance).asin() } else { PI })
    }

    /// Mean over a part of a surface of what `mean` finds for parts of it that light falls on evenly, or that are small.
    pub(crate) fn mean_over(&self, geometry: &Geometry, whole: Domain, mean: &impl Fn(Domain) -> f32) -> f32 {
        let outer = self.cos_outer.clamp(-1.0, 1.0).acos();
        let (mut sum, mut open) = (0.0, vec![(whole, 0)]);
        while let Some((part, cuts)) = open.pop() {
            let bounds = geometry.bounds(part);
            let [least, most] = self.within(&bounds);
            let (_, half) = self.seen(&bounds);
            if most <= 0.0 {
                continue;
            }
            if most - least <= EVEN || half <= FINE * outer || cuts == MOST_CUTS {
                sum += f64::from(geometry.area(part) * mean(part));
            } else {
                open.extend(geometry.split(part).into_iter().map(|part| (part, cuts + 1)));
            }
        }
        (sum / f64::from(geometry.area(whole))) as f32
    }
}

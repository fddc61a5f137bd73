//! The same scene somewhere else: scaled, turned, moved.

use glam::{DQuat, DVec3, Vec3};
use hr_diffuse::{LightKind, SceneInput, Shape};

/// Where a scene is put.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placement {
    pub(crate) scale: f64,
    pub(crate) turn: DQuat,
    /// In multiples of the scene's size, which is about 1 before it is scaled.
    pub(crate) offset: DVec3,
}

/// All of them: scales from a millionth to a million, in place and a million sizes away, upright and askew.
pub(crate) fn all() -> impl Iterator<Item = Placement> {
    let askew = DQuat::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 1.0);
    let scales = [1e-6, 1.0, 1e6];
    let offsets = [DVec3::ZERO, DVec3::new(1e6, -1e6, 0.7e6)];
    let turns = [DQuat::IDENTITY, askew];
    scales.into_iter().flat_map(move |scale| {
        offsets.into_iter().flat_map(move |offset| turns.into_iter().map(move |turn| Placement { scale, turn, offset }))
    })
}

impl Placement {
    /// Puts a scene there. Lights become so much stronger that irradiance stays.
    pub(crate) fn of(&self, input: &SceneInput) -> SceneInput {
        let mut input = input.clone();
        let at = |p: &mut DVec3| *p = (self.turn * *p + self.offset) * self.scale;
        let turned = |d: &mut DVec3| *d = (self.turn * *d).normalize();
        let turned32 = |d: &mut Vec3| *d = (self.turn * d.as_dvec3()).normalize().as_vec3();
        for surface in &mut input.surfaces {
            match &mut surface.shape {
                Shape::Triangle(points) => points.iter_mut().for_each(at),
                Shape::Quad(points) => points.iter_mut().for_each(at),
                Shape::Sphere { center, radius } => {
                    at(center);
                    *radius *= self.scale;
                }
                Shape::Cone { ends, radii } => {
                    ends.iter_mut().for_each(at);
                    radii.iter_mut().for_each(|r| *r *= self.scale);
                }
                Shape::Ring { center, normal, inner, outer } => {
                    at(center);
                    turned(normal);
                    *inner *= self.scale;
                    *outer *= self.scale;
                }
                Shape::Torus { center, axis, major, minor } => {
                    at(center);
                    turned(axis);
                    *major *= self.scale;
                    *minor *= self.scale;
                }
            }
            surface.shading_normals.iter_mut().flatten().for_each(turned32);
        }
        for light in &mut input.lights {
            at(&mut light.position);
            match &mut light.kind {
                LightKind::Point => light.intensity *= (self.scale * self.scale) as f32,
                LightKind::Spot { direction, .. } => {
                    turned32(direction);
                    light.intensity *= (self.scale * self.scale) as f32;
                }
                LightKind::Directional { direction } => turned32(direction),
            }
        }
        input
    }
}

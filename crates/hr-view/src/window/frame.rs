//! What one picture shows, and as the shaders read it.

use super::gauge::{DECADES, Gauge, RAMP};
use super::overlay::Marks;
use super::tone::{BRIGHTEST, Tone};
use super::view::View;
use crate::display::DisplayMesh;
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};
use std::f32::consts::LOG2_10;

/// `Frame` of the shader.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FrameUniform {
    eye: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    to_srgb: [[f32; 4]; 3],
    numerator: [f32; 4],
    denominator: [f32; 4],
    luminance: [f32; 4],
    scale: [f32; 4],
    ramp: [[f32; 4]; RAMP.len()],
}

/// What one picture shows and how.
pub(super) struct Frame<'a> {
    pub(super) view: &'a View,
    pub(super) tone: &'a Tone,
    pub(super) mesh: &'a DisplayMesh,
    pub(super) gauge: Gauge,
    /// What is drawn over it.
    pub(super) marks: &'a [Marks],
}

impl Frame<'_> {
    pub(super) fn uniform(&self, near: f32, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> FrameUniform {
        let (view, tone) = (self.view, self.tone);
        let [x, y] = view.scales(f64::from(width) / f64::from(height)).map(|s| s as f32);
        let (n, d) = (tone.curve.numerator, tone.curve.denominator);
        let column = |v: Vec3, w: f32| Vec4::from((v, w)).to_array();
        FrameUniform {
            eye: column((view.eye - self.mesh.origin).as_vec3(), 0.0),
            right: column(view.right.as_vec3(), x),
            up: column(view.up.as_vec3(), y),
            forward: column(view.forward.as_vec3(), near),
            to_srgb: [0, 1, 2].map(|i| column(tone.to_srgb.col(i), 0.0)),
            numerator: [n[0], n[1], tone.exposure, BRIGHTEST],
            denominator: [d[0], d[1], d[2], if format.is_srgb() { 0.0 } else { 1.0 }],
            luminance: column(self.mesh.primaries.luminance_weights().as_vec3(), self.gauge.quantity.number()),
            scale: [self.gauge.high.log2() - DECADES * LOG2_10, (DECADES * LOG2_10).recip(), tone.curve.white(), 0.0],
            ramp: RAMP.map(|[r, g, b]| [r, g, b, 0.0]),
        }
    }
}

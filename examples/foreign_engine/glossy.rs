//! All that the engine had to be given for glossy light. It keeps the illumination samples of each patch apart by whether
//! the patch has shot their reflection: the unshot ones are to glossy light what unshot radiosity is to diffuse light.

use crate::engine::Patch;
use glam::Vec3;
use glossy_ext::haar::Haar;
use glossy_ext::hooks::{Arrived, Cone, Hierarchy, LightField, NodeId, Transfer};
use glossy_ext::{GlossyField, SampleSet};
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, PI};

/// The patches as extensions see them: a hierarchy of leaves alone.
struct Leaves<'a>(&'a [Patch]);

impl Hierarchy for Leaves<'_> {
    fn parent(&self, _: NodeId) -> Option<NodeId> {
        None
    }
    fn center(&self, node: NodeId) -> Vec3 {
        self.0[node.index()].center
    }
    fn radius(&self, node: NodeId) -> f32 {
        self.0[node.index()].radius
    }
    fn normals(&self, node: NodeId) -> Cone {
        Cone::single(self.0[node.index()].normal)
    }
    fn material(&self, node: NodeId) -> Option<u32> {
        Some(self.0[node.index()].paint as u32)
    }
}

/// Illumination samples of a patch.
#[derive(Default)]
struct Samples {
    unshot: SampleSet,
    shot: SampleSet,
    /// The sum of the unshot ones, W/m².
    irradiance: Vec3,
}

/// Glossy light of all patches.
pub(crate) struct Glossy {
    field: GlossyField,
    samples: Vec<Samples>,
}

impl Glossy {
    pub(crate) fn new(field: GlossyField, patches: usize) -> Self {
        Self { field, samples: std::iter::repeat_with(Samples::default).take(patches).collect() }
    }

    /// What a patch has still to shoot, W/m².
    pub(crate) fn unshot(&self, patches: &[Patch], patch: usize) -> Vec3 {
        self.field.active(patches[patch].paint as u32).unwrap_or_default() * self.samples[patch].irradiance
    }

    /// Reflects what a patch has still to shoot, which counts as shot then.
    pub(crate) fn take_unshot(&mut self, patches: &[Patch], patch: usize) -> Haar {
        let samples = &mut self.samples[patch];
        let irradiance = std::mem::take(&mut samples.irradiance);
        let light = reflect(&self.field, patches, patch, &samples.unshot, irradiance);
        samples.shot.append(&mut samples.unshot);
        light
    }

    /// All glossy light of a patch, at the end.
    pub(crate) fn leaving(&self, patches: &[Patch], patch: usize) -> Haar {
        let samples = &self.samples[patch];
        let all = [samples.shot.as_slice(), &samples.unshot].concat();
        reflect(&self.field, patches, patch, &all, patches[patch].irradiance)
    }

    /// What a diffuse patch would have to send so as to be as bright from a direction.
    pub(crate) fn radiosity(&self, light: &Haar, toward: Vec3) -> Vec3 {
        PI * self.field.radiance(light, toward)
    }

    /// Keeps what a patch has sent to each of the others.
    pub(crate) fn receive(&mut self, patches: &[Patch], from: usize, arriving: &[Vec3]) {
        let field = &self.field;
        let each = self.samples.par_iter_mut().zip(patches).zip(arriving).with_min_len(64);
        each.for_each(|((samples, patch), &irradiance)| {
            if irradiance != Vec3::ZERO && field.active(patch.paint as u32).is_some() {
                let direction = (patches[from].center - patch.center).normalize();
                let transfer = Transfer { sender: NodeId(from as u32), direction, irradiance, oriented: true };
                field.receive(&mut samples.unshot, &transfer);
                samples.irradiance += irradiance;
            }
        });
    }
}

/// The glossy reflection of some of a patch's samples.
fn reflect(field: &GlossyField, patches: &[Patch], patch: usize, samples: &SampleSet, irradiance: Vec3) -> Haar {
    let paint = field.reflector(patches[patch].paint as u32);
    let diffuse = paint.map_or(Vec3::ZERO, |paint| paint.diffuse()) * irradiance * FRAC_1_PI;
    let arrived = Arrived { irradiance, diffuse, spread: patches[patch].bend };
    field.reflect(&Leaves(patches), NodeId(patch as u32), &[samples], arrived)
}

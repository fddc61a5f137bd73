//! All that the engine had to be given for glossy light. Of each patch it keeps the illumination samples whose reflection
//! is still to be shot: they are to glossy light what unshot radiosity is to diffuse light.

use crate::ERROR;
use crate::engine::Patch;
use glam::Vec3;
use glossy_ext::hooks::{Arrived, Cone, Hierarchy, LightField, NodeId, Transfer};
use rayon::prelude::*;
use std::f32::consts::PI;

/// The extension; tests watch what it is asked to do.
#[cfg(not(test))]
pub(crate) type Field = glossy_ext::GlossyField;
#[cfg(test)]
pub(crate) type Field = glossy_ext::hooks::conformance::Watched<glossy_ext::GlossyField>;

/// Incident and exitant light of a patch.
type Incident = <Field as LightField>::Incident;
type Exitant = <Field as LightField>::Exitant;

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
    all: Incident,
    /// Those whose reflection is still to be shot.
    unshot: Incident,
    /// The sum of the unshot ones, W/m².
    irradiance: Vec3,
}

/// Glossy light of all patches.
pub(crate) struct Glossy {
    pub(crate) field: Field,
    samples: Vec<Samples>,
}

impl Glossy {
    pub(crate) fn new(field: Field, patches: usize) -> Self {
        Self { field, samples: std::iter::repeat_with(Samples::default).take(patches).collect() }
    }

    /// What a patch has still to shoot, W/m².
    pub(crate) fn unshot(&self, patches: &[Patch], patch: usize) -> Vec3 {
        self.field.active(patches[patch].paint as u32).unwrap_or_default() * self.samples[patch].irradiance
    }

    /// Reflects what a patch has still to shoot, which counts as shot then.
    pub(crate) fn take_unshot(&mut self, patches: &[Patch], patch: usize) -> Exitant {
        let samples = &mut self.samples[patch];
        let irradiance = std::mem::take(&mut samples.irradiance);
        let light = reflect(&self.field, patches, patch, &samples.unshot, irradiance, false);
        self.field.clear(&mut samples.unshot);
        light
    }

    /// All glossy light of a patch, at the end.
    pub(crate) fn leaving(&self, patches: &[Patch], patch: usize) -> Exitant {
        reflect(&self.field, patches, patch, &self.samples[patch].all, patches[patch].irradiance, true)
    }

    /// What a diffuse patch would have to send so as to be as bright from a direction.
    pub(crate) fn radiosity(&self, light: &Exitant, toward: Vec3) -> Vec3 {
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
                field.receive(&mut samples.all, &transfer);
                field.receive(&mut samples.unshot, &transfer);
                samples.irradiance += irradiance;
            }
        });
    }
}

/// The glossy reflection of some of a patch's samples.
fn reflect(field: &Field, patches: &[Patch], at: usize, samples: &Incident, irradiance: Vec3, shown: bool) -> Exitant {
    let Patch { paint, bend, .. } = patches[at];
    if field.active(paint as u32).is_none() {
        return Exitant::default();
    }
    // Diffuse light is the engine's own.
    let diffuse = Vec3::ZERO;
    // Beside what white paint would make of the same light.
    let negligible = ERROR * irradiance.max_element() / PI;
    let arrived = Arrived { irradiance, diffuse, spread: bend, negligible, error: ERROR, shown };
    field.reflect(&Leaves(patches), NodeId(at as u32), &[samples], arrived)
}

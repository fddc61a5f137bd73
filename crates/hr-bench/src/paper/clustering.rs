//! Radiance Clustering, the baseline (Sillion, Drettakis and Soler, "A Clustering Algorithm for Radiance Calculation in
//! General Environments", 1995, as the paper's section 2.2 describes it).
//!
//! There is no incident light. What a link brings is pushed down to the leaves at once, reflected there on its own,
//! projected and added to the leaf's distribution ("immediate push"). While contributions come in, others still gather what
//! the leaf sent before, so that a second distribution is needed for each.
//!
//! Here a leaf asks for the contributions one after the other, in place of each contribution asking for its leaves. The
//! projections are the same; the traversals of the hierarchy, one per link, are spared, and sums are made pair by pair,
//! which costs less than adding each small distribution to a large one. Everything else is shared with the light field that
//! it is compared with: links, the light of samples at a leaf, its balance with the irradiance, where peaks are, and the
//! projection itself.

use glam::Vec3;
use glossy_ext::haar::{Haar, Refinement};
use glossy_ext::samples::SampleSet;
use glossy_ext::{GlossyField, Outgoing, Reflector, arriving};
use hr_diffuse::{Arrived, Cone, Hierarchy, LightField, NodeId, Rgb, Transfer};
use std::sync::Arc;

/// Glossy reflection by Radiance Clustering.
#[derive(Debug)]
pub struct RadianceClustering {
    /// Reflects one contribution at a time.
    field: GlossyField,
}

impl RadianceClustering {
    /// Distributions that a leaf needs: what it sends, and what it is gathering.
    pub const DISTRIBUTIONS: usize = 2;

    /// For the materials of a scene, by index.
    #[must_use]
    pub fn new(reflectors: &[Arc<dyn Reflector>], refinement: Refinement) -> Self {
        Self { field: GlossyField::new(reflectors, refinement) }
    }

    /// BRDF evaluations so far: one per contribution and direction.
    #[must_use]
    pub fn brdf_evaluations(&self) -> u64 {
        self.field.counters().brdf_evaluations()
    }
}

/// The sum of distributions.
fn summed(mut all: Vec<Haar>) -> Haar {
    while all.len() > 1 {
        all = all.chunks(2).map(|pair| pair.iter().skip(1).fold(pair[0].clone(), |a, b| a.add(b))).collect();
    }
    all.pop().unwrap_or_default()
}

impl LightField for RadianceClustering {
    type Incident = SampleSet;
    type Exitant = Outgoing<Haar>;

    fn active(&self, material: u32) -> Option<Rgb> {
        self.field.active(material)
    }

    fn clear(&self, incident: &mut SampleSet) {
        self.field.clear(incident);
    }

    fn receive(&self, incident: &mut SampleSet, transfer: &Transfer) {
        self.field.receive(incident, transfer);
    }

    fn reflect<H: Hierarchy>(
        &self,
        hierarchy: &H,
        leaf: NodeId,
        path: &[&SampleSet],
        arrived: Arrived,
    ) -> Outgoing<Haar> {
        let Some(whole) = self.field.reflection(hierarchy, leaf, path, arrived) else { return Outgoing::default() };
        let mut here = Vec::new();
        let mut irradiance = |path: &[&SampleSet]| {
            arriving(hierarchy, leaf, path, whole.place(), &mut here);
            here.iter().map(|sample| sample.irradiance).sum::<Rgb>()
        };
        let balance = arrived.irradiance.element_sum() / irradiance(path).element_sum().max(f32::MIN_POSITIVE);
        let nothing = SampleSet::new();
        let mut contributions = Vec::new();
        for (depth, set) in path.iter().enumerate() {
            for sample in *set {
                let one = vec![*sample];
                let mut alone = vec![&nothing; path.len()];
                alone[depth] = &one;
                let own = Arrived { irradiance: irradiance(&alone) * balance, ..arrived };
                let contribution = self.field.reflection(hierarchy, leaf, &alone, own);
                contributions.extend(contribution.map(|contribution| self.field.project(&contribution)));
            }
        }
        let mut distribution = summed(contributions);
        whole.conserve(&mut distribution, arrived.irradiance);
        Outgoing { distribution, focus: whole.focus() }
    }

    fn radiance(&self, exitant: &Outgoing<Haar>, away: Vec3) -> Rgb {
        self.field.radiance(exitant, away)
    }

    fn radiance_bounds(&self, exitant: &Outgoing<Haar>, away: &Cone) -> (Rgb, Rgb) {
        self.field.radiance_bounds(exitant, away)
    }

    fn incident_bytes(&self, incident: &SampleSet) -> usize {
        self.field.incident_bytes(incident)
    }

    fn exitant_bytes(&self, exitant: &Outgoing<Haar>) -> usize {
        Self::DISTRIBUTIONS * self.field.exitant_bytes(exitant)
    }
}

//! What is kept of glossy light: samples and distributions as flat arrays.

use crate::field::GlossyField;
use crate::haar::Haar;
use crate::samples::{IlluminationSample, SampleSet};
use hr_diffuse::flat::{FlatError, Reader, Writer, fits};
use hr_diffuse::keep::{Keep, KeptLight};
use std::io;

const SAMPLES: &str = "illumination samples";

impl Keep for GlossyField {
    fn store(&self, incident: &[SampleSet], reflected: &[Haar], out: &mut Writer<'_>) -> io::Result<()> {
        out.put(&self.counters().counts())?;
        let lengths: Vec<u32> = incident.iter().map(|set| set.len() as u32).collect();
        out.put(&lengths)?;
        out.put(&incident.concat())?;
        Haar::store(reflected, out)
    }

    fn restore(&self, nodes: usize, from: &mut Reader<'_>) -> Result<KeptLight<Self>, FlatError> {
        self.counters().take_over(from.take_exactly("counts")?);
        let lengths: Vec<u32> = from.take(SAMPLES)?;
        let incident: Vec<SampleSet> = from.take_groups(lengths, SAMPLES)?;
        let is_sound = |sample: &IlluminationSample| sample.sender().index() < nodes && sample.irradiance().is_finite();
        fits(incident.iter().flatten().all(is_sound), SAMPLES)?;
        Ok((incident, Haar::restore(from)?))
    }
}

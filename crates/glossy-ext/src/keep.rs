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
        let (lengths, samples): (Vec<u32>, Vec<IlluminationSample>) = (from.take(SAMPLES)?, from.take(SAMPLES)?);
        let is_sound = |sample: &IlluminationSample| sample.sender().index() < nodes && sample.irradiance().is_finite();
        fits(samples.iter().all(is_sound), SAMPLES)?;
        let mut rest = samples.as_slice();
        let mut incident: Vec<SampleSet> = Vec::with_capacity(lengths.len());
        for &length in &lengths {
            let (set, after) = rest.split_at_checked(length as usize).ok_or(FlatError::Misfit(SAMPLES))?;
            incident.push(set.to_vec());
            rest = after;
        }
        fits(rest.is_empty(), SAMPLES)?;
        Ok((incident, Haar::restore(from)?))
    }
}

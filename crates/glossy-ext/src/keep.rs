//! What is kept of glossy light: samples, distributions and foci as flat arrays.

use crate::field::GlossyField;
use crate::haar::Haar;
use crate::outgoing::{Focus, Outgoing};
use crate::samples::{IlluminationSample, SampleSet};
use hr_diffuse::flat::{FlatError, Reader, Writer, fits};
use hr_diffuse::keep::{Keep, KeptLight};
use std::io;

const SAMPLES: &str = "illumination samples";
const FOCI: &str = "foci of distributions";

impl Keep for GlossyField {
    fn store(&self, incident: &[SampleSet], reflected: &[Outgoing<Haar>], out: &mut Writer<'_>) -> io::Result<()> {
        let lengths: Vec<u32> = incident.iter().map(|set| set.len() as u32).collect();
        out.put(&lengths)?;
        out.put(&incident.concat())?;
        out.put(&reflected.iter().map(|outgoing| outgoing.focus).collect::<Vec<_>>())?;
        Haar::store(reflected.iter().map(|outgoing| &outgoing.distribution), out)
    }

    fn restore(&self, nodes: usize, _: usize, from: &mut Reader<'_>) -> Result<KeptLight<Self>, FlatError> {
        let lengths: Vec<u32> = from.take(SAMPLES)?;
        let incident: Vec<SampleSet> = from.take_groups(lengths, SAMPLES)?;
        let is_sound = |sample: &IlluminationSample| sample.sender().index() < nodes && sample.irradiance().is_finite();
        fits(incident.iter().flatten().all(is_sound), SAMPLES)?;
        let foci: Vec<Focus> = from.take(FOCI)?;
        let distributions = Haar::restore(from)?;
        fits(foci.len() == distributions.len() && foci.iter().all(|focus| focus.plane().is_finite()), FOCI)?;
        let outgoing = |(distribution, focus)| Outgoing { distribution, focus };
        Ok((incident, std::iter::zip(distributions, foci).map(outgoing).collect()))
    }

    fn store_own(&self, out: &mut Writer<'_>) -> io::Result<()> {
        out.put(&self.counters().counts())
    }

    fn restore_own(&self, from: &mut Reader<'_>) -> Result<(), FlatError> {
        self.counters().take_over(from.take_exactly("counts")?);
        Ok(())
    }
}

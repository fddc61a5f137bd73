//! Glossy global illumination for hierarchical radiosity: illumination samples, directional distributions and
//! reflectors, after Stamminger et al., "Efficient Glossy Global Illumination with Interactive Viewing", Computer
//! Graphics Forum 19(1), 2000. It plugs into an engine through the hooks of `hr-diffuse` only.

pub mod basis;
pub mod conformance;
pub mod field;
pub mod haar;
mod keep;
pub mod reflector;
pub mod samples;

pub use basis::Basis;
pub use field::{GlossyField, Reflection};
pub use hr_diffuse::Rgb;
pub use reflector::{
    Compensated, Incident, Lambert, Lobe, MerlError, MetallicRoughness, Phong, Reflector, ReflectorError, Sample, Sum,
    Tabulated, Ward,
};
pub use samples::{IlluminationSample, Place, SampleSet, arriving};

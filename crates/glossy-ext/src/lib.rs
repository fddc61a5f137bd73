//! Glossy global illumination for hierarchical radiosity: illumination samples, directional distributions and
//! reflectors, after Stamminger et al., "Efficient Glossy Global Illumination with Interactive Viewing", Computer
//! Graphics Forum 19(1), 2000. It plugs into an engine through the [`hooks`] of `hr-diffuse` only.
//!
//! # Features
//! `parallel` (default): that of `hr-diffuse`.

pub mod basis;
pub mod conformance;
pub mod field;
pub mod haar;
mod keep;
pub mod outgoing;
pub mod reflector;
pub mod samples;
mod wide;

pub use basis::Basis;
pub use field::{GlossyField, Reflection};
pub use hr_diffuse::{Rgb, hooks};
pub use outgoing::{Focus, Outgoing, SHOWN_COSINE};
pub use reflector::{
    Compensated, Contour, Formula, Incident, Lambert, Lobe, MerlError, MetallicRoughness, Phong, Reflector,
    ReflectorError, Sample, Sum, Tabulated, Ward,
};
pub use samples::{IlluminationSample, Place, SampleSet, arriving};

/// What is glossy goes to other threads and is shared among them, as diffuse light is.
const _: () = {
    const fn is_shared<T: Send + Sync + ?Sized>() {}
    is_shared::<dyn Reflector>();
    is_shared::<hr_diffuse::Solver<GlossyField>>();
    is_shared::<hr_diffuse::Solution<GlossyField>>();
    is_shared::<haar::Haar>();
};

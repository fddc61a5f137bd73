//! Diffuse hierarchical radiosity with clustering and bounded link refinement, and the hooks that extensions
//! such as glossy reflection plug into.
//!
//! The steps and their names are those of Stamminger et al., "Efficient Glossy Global Illumination with
//! Interactive Viewing", Computer Graphics Forum 19(1), 2000. The way of the light through the modules:
//! [`scene`] → [`hierarchy`] → ([`oracle`] → refinement → [`links`], with [`form_factor`] and [`visibility`]) →
//! gather → push → [`hooks`]' reflect → pull ([`solver`]) → values at [`vertices`] → [`solution`].
//!
//! # Features
//! `parallel` (default): all cores, by rayon, in the pool of whoever calls. Without it there is one thread, and the answer
//! is the same, bit by bit.

mod adaptation;
mod all_over;
pub mod beams;
pub mod budget;
mod calibrate;
mod clock;
mod closely;
mod columns;
pub mod cone;
mod contact_shadows;
mod contacts;
mod convergence;
mod effort;
pub mod error;
mod exposed;
pub mod face_clusters;
pub mod facing;
mod faint;
mod feedback;
pub mod flat;
mod footprint;
pub mod form_factor;
mod gather;
pub mod geometry;
mod grazing;
mod hidden;
pub mod hierarchy;
pub mod hooks;
mod inherited;
pub mod keep;
mod kept_weights;
mod leaf_rows;
mod leaning;
mod light_then;
pub mod links;
mod lobes;
mod misjudged;
mod moved;
pub mod oracle;
mod places;
mod proofs;
mod push;
mod rearrange;
mod reconstruct;
mod refine;
pub mod reflect;
pub mod relight;
mod renewal;
mod residual;
mod resume;
mod rooms;
mod rows;
pub mod sampling;
pub mod scene;
mod sealed;
mod segments;
mod sent;
mod shadows;
mod shooting;
mod sides;
mod skips;
pub mod solution;
pub mod solver;
mod standing_lines;
pub mod stats;
mod steady;
pub mod threads;
pub mod toward;
mod transport;
mod tree;
mod twins;
pub mod vertices;
pub mod visibility;
mod within;

pub use budget::{Budget, Spent};
pub use cone::Cone;
pub use error::SolveError;
pub use facing::Facing;
pub use geometry::{Aabb, Domain, Geometry, GeometryError, Normalization};
pub use hooks::{Arrived, Hierarchy, LightField, NodeId, Transfer};
pub use relight::{Lamp, Variants};
pub use scene::{DiffuseMaterial, Light, LightKind, SceneInput, Shape, Surface, SurfaceReflectance};
pub use solution::Solution;
pub use solver::{Phase, Progress, Settings, Solver, Transport};
pub use stats::Stats;
pub use visibility::{Hit, Visibility};

/// A linear RGB triple: reflectance, radiosity, irradiance (W/m²) or radiance (W/(m² sr)), as its context says.
pub type Rgb = glam::Vec3;

/// Solvers and solutions go to other threads and are shared among them.
const _: () = {
    const fn is_shared<T: Send + Sync>() {}
    is_shared::<SceneInput>();
    is_shared::<Solver>();
    is_shared::<Solution>();
    is_shared::<SolveError>();
    is_shared::<hooks::conformance::Watched<()>>();
};

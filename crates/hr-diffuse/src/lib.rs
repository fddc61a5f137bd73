//! Diffuse hierarchical radiosity with clustering and bounded link refinement, and the hooks that extensions
//! such as glossy reflection plug into.
//!
//! The steps and their names are those of Stamminger et al., "Efficient Glossy Global Illumination with
//! Interactive Viewing", Computer Graphics Forum 19(1), 2000.

pub mod cone;
pub mod geometry;
pub mod hooks;
pub mod scene;
pub mod visibility;

pub use cone::Cone;
pub use geometry::{Aabb, Domain, Geometry, GeometryError, Normalization};
pub use hooks::{Hierarchy, LightField, NodeId, Transfer};
pub use scene::{DiffuseMaterial, Light, LightKind, SceneInput, Shape, Surface};
pub use visibility::{Hit, Visibility};

/// A linear RGB triple: reflectance, radiosity, irradiance (W/m²) or radiance (W/(m² sr)), as its context says.
pub type Rgb = glam::Vec3;

//! What a caller hands in: surfaces in the scene's own units, their diffuse materials, and lights without extent.

use crate::Rgb;
use glam::{DVec3, Vec2, Vec3};
use std::sync::Arc;

/// A geometric primitive in scene units. Curved ones stay curved: nothing is tessellated before it is needed.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Counter-clockwise seen from the front.
    Triangle([DVec3; 3]),
    /// Planar, convex, counter-clockwise seen from the front.
    Quad([DVec3; 4]),
    /// A whole sphere; its front is outside.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius, > 0.
        radius: f64,
    },
    /// The mantle of a truncated cone or cylinder, open at both ends; its front is outside.
    Cone {
        /// The two ends of the axis.
        ends: [DVec3; 2],
        /// The radius at each end, ≥ 0, not both 0.
        radii: [f64; 2],
    },
    /// A flat annulus, or a disk where `inner` is 0; its front is where `normal` points.
    Ring {
        /// Centre.
        center: DVec3,
        /// Unit normal.
        normal: DVec3,
        /// Inner radius, ≥ 0.
        inner: f64,
        /// Outer radius, > `inner`.
        outer: f64,
    },
    /// A whole torus; its front is outside.
    Torus {
        /// Centre.
        center: DVec3,
        /// Unit axis of rotation.
        axis: DVec3,
        /// Radius of the circle that the tube's centre runs on.
        major: f64,
        /// Radius of the tube, > 0, < `major`.
        minor: f64,
    },
}

/// One surface of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Geometry in scene units.
    pub shape: Shape,
    /// Turns the front to the other side: inside of a sphere, clockwise polygon.
    pub flip: bool,
    /// Index into [`SceneInput::materials`].
    pub material: u32,
    /// Unit shading normals at the corners of a triangle (first three) or quadrilateral, on the front side after
    /// `flip`; `None` shades with the geometric normal.
    pub shading_normals: Option<[Vec3; 4]>,
}

impl Surface {
    /// A surface with its front as the shape has it and without shading normals.
    #[must_use]
    pub fn new(shape: Shape, material: u32) -> Self {
        Self { shape, flip: false, material, shading_normals: None }
    }
}

/// The diffuse part of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseMaterial {
    /// Lambertian reflectance, 0…1 per channel.
    pub reflectance: Rgb,
    /// Exitance of the front in W/m² (radiance = exitance/π).
    pub exitance: Rgb,
    /// Whether the back reflects like the front; else it absorbs. The back never emits.
    pub two_sided: bool,
}

/// How a light without extent spreads its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Intensity (W/sr) alike in all directions; irradiance = intensity · cos/d².
    Point,
    /// A point with a cone: full within `inner`, none outside `outer`, angles in radians from `direction`, with
    /// the ramp that glTF's `KHR_lights_punctual` recommends (a linear function of the cosine, squared).
    Spot {
        /// Unit direction of the cone's axis.
        direction: Vec3,
        /// Cosine of the inner half-angle.
        cos_inner: f32,
        /// Cosine of the outer half-angle.
        cos_outer: f32,
    },
    /// Infinitely far: its `intensity` is the irradiance (W/m²) on a plane perpendicular to `direction`.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
    },
}

/// A light without extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Where it is, in scene units (ignored for directional light).
    pub position: DVec3,
    /// W/sr, or W/m² for directional light.
    pub intensity: Rgb,
    /// How it spreads.
    pub kind: LightKind,
}

/// Everything that the diffuse engine needs to know of a scene.
#[derive(Clone, Debug, Default)]
pub struct SceneInput {
    /// Surfaces, in scene units.
    pub surfaces: Vec<Surface>,
    /// Materials that surfaces refer to.
    pub materials: Vec<DiffuseMaterial>,
    /// Lights without extent.
    pub lights: Vec<Light>,
    /// Reflectance that varies over surfaces, where any does.
    pub texture: Option<Arc<dyn SurfaceReflectance>>,
}

/// Diffuse reflectance that varies over a surface: textures, vertex colours.
pub trait SurfaceReflectance: std::fmt::Debug + Send + Sync {
    /// Mean diffuse reflectance over the polygon with these corners in the surface's (u, v), or `None` where the
    /// material's own applies.
    fn mean(&self, surface: u32, corners: &[Vec2]) -> Option<Rgb>;
}

impl Light {
    /// What is wrong with a light, if anything is.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        if !self.position.is_finite() {
            return Some("its position is not finite");
        }
        if !self.intensity.is_finite() || self.intensity.min_element() < 0.0 {
            return Some("its intensity is negative or not finite");
        }
        match self.kind {
            LightKind::Point => None,
            LightKind::Spot { direction, .. } | LightKind::Directional { direction } if !direction.is_normalized() => {
                Some("its direction is not a unit vector")
            }
            LightKind::Spot { cos_inner, cos_outer, .. } => {
                let cosines = -1.0..=1.0;
                let wrong = !cosines.contains(&cos_inner) || !cosines.contains(&cos_outer) || cos_inner < cos_outer;
                wrong.then_some("the cosines of its cone are not within -1 to 1, or the inner cone is the wider one")
            }
            LightKind::Directional { .. } => None,
        }
    }
}

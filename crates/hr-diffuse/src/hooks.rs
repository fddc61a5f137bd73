//! The hooks: what an engine shows to extensions, and what an extension does with the light that passes.
//!
//! An engine owns one [`LightField::Incident`] and one [`LightField::Exitant`] per node of its hierarchy and calls,
//! in each iteration:
//!
//! 1. [`clear`](LightField::clear) on the incident light of every active node,
//! 2. [`receive`](LightField::receive) once per link, on the receiver's own incident light (*gather*),
//! 3. [`reflect`](LightField::reflect) for every active leaf, with the incident light of all nodes on the path from
//!    the root down to it: their union is what arrives there (*push*, without a copy),
//! 4. [`radiance`](LightField::radiance) and its bounds for the leaves that stand for a sender: inner nodes shine with
//!    the light of leaves below them (*pull*).
//!
//! Leaves whose light no link asks for may be left out of 3.
//!
//! Receivers run in parallel; each call writes only what it is given or returns, and reads only what the step
//! before made: gather reads exitant and writes incident light, reflect the reverse.

pub use crate::{Cone, Rgb};
use glam::Vec3;

/// Index of an element of the hierarchy. Children are contiguous and come after their parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct NodeId(pub u32);

impl NodeId {
    /// As an index into per-node arrays.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// What an engine shows to extensions: a read-only view of its element hierarchy. Lengths are in the engine's
/// own unit; extensions use them only relative to each other.
pub trait Hierarchy: Sync {
    /// Parent of a node, `None` for the root.
    fn parent(&self, node: NodeId) -> Option<NodeId>;
    /// A point in the middle of the node: on the surface for elements of a surface, that of the box for clusters.
    fn center(&self, node: NodeId) -> Vec3;
    /// Radius of a sphere about [`center`](Self::center) that holds the node.
    fn radius(&self, node: NodeId) -> f32;
    /// Directions of the node's surface normals, on the side that the node stands for.
    fn normals(&self, node: NodeId) -> Cone;
    /// Material of an element of a surface; `None` for clusters and for lights without extent.
    fn material(&self, node: NodeId) -> Option<u32>;
    /// Unit direction toward a sender as seen from `at`, and the angular radius (radians) of a disk that subtends
    /// the same solid angle as the sender.
    fn direction_to(&self, sender: NodeId, at: Vec3) -> (Vec3, f32) {
        let to = self.center(sender) - at;
        let distance = to.length().max(f32::MIN_POSITIVE);
        (to / distance, (self.radius(sender) / distance).min(1.0).asin())
    }
    /// Whether a sender is infinitely far: its direction is the same from everywhere.
    fn is_distant(&self, _sender: NodeId) -> bool {
        false
    }
    /// Whether the node is a part of one plane, so that all of it is oriented alike.
    fn is_flat(&self, node: NodeId) -> bool {
        self.material(node).is_some() && self.normals(node).cos_angle > FLAT_COSINE
    }
}

/// Normals within this cosine (0.8°) count as one.
pub const FLAT_COSINE: f32 = 0.9999;

/// One link's light as it arrives at the receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transfer {
    /// Where the light comes from.
    pub sender: NodeId,
    /// Unit direction from the receiver's centre toward the sender.
    pub direction: Vec3,
    /// Transported irradiance in W/m².
    pub irradiance: Rgb,
    /// Whether `irradiance` is on the receiver's own plane. Where the receiver is not flat (a cluster, a curved
    /// surface) it is on a plane perpendicular to `direction`: there is no surface to be oriented to, so the
    /// cosine is applied where the sample reaches one.
    pub oriented: bool,
}

/// What a leaf received in all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrived {
    /// Mean irradiance, W/m².
    pub irradiance: Rgb,
    /// Diffuse radiance that the leaf makes of it, W/(m² sr).
    pub diffuse: Rgb,
    /// The leaf stands for others, too, whose normals are within this angle (radians) of its own: detail finer than what
    /// that makes of a reflection is lost.
    pub spread: f32,
}

/// What light does besides being diffuse radiosity. `()` is the purely diffuse engine, at no cost.
pub trait LightField: Sync {
    /// What the extension keeps of a node's incident light. The default is "nothing here".
    type Incident: Default + Send + Sync;
    /// What it keeps of a node's exitant light. The default is "nothing here".
    type Exitant: Default + Send + Sync;

    /// What surfaces of this material reflect beside the diffuse part (a reflectance, 0…1 per channel), or `None`
    /// where they do not take part. Nodes without any active surface below them are never visited. An engine may
    /// carry the light of materials that reflect next to nothing this way as diffuse light until it is shown.
    fn active(&self, material: u32) -> Option<Rgb>;
    /// Forgets a node's incident light, before links are gathered anew.
    fn clear(&self, incident: &mut Self::Incident);
    /// Takes one link's light at its receiver, which may be a leaf, an inner element or a cluster.
    fn receive(&self, incident: &mut Self::Incident, transfer: &Transfer);
    /// A leaf's exitant light from its incident light. `path` holds that of all nodes from the root down to the
    /// leaf itself, which comes last. `arrived` is the leaf's irradiance and its diffuse radiance: what the incident
    /// light adds up to, and what glossy detail may be negligible beside.
    fn reflect<H: Hierarchy>(
        &self,
        hierarchy: &H,
        leaf: NodeId,
        path: &[&Self::Incident],
        arrived: Arrived,
    ) -> Self::Exitant;
    /// Exitant radiance (W/(m² sr)) in a direction away from a node, without the diffuse part. For nodes that are
    /// not flat: radiant intensity per unit of the node's surface area (one side).
    fn radiance(&self, exitant: &Self::Exitant, away: Vec3) -> Rgb;
    /// Smallest and largest [`radiance`](Self::radiance) over a cone of directions.
    fn radiance_bounds(&self, exitant: &Self::Exitant, away: &Cone) -> (Rgb, Rgb);
    /// Bytes that a node's incident light takes beside those of `Incident` itself; for budgets of memory.
    fn incident_bytes(&self, _incident: &Self::Incident) -> usize {
        0
    }
    /// The same for exitant light.
    fn exitant_bytes(&self, _exitant: &Self::Exitant) -> usize {
        0
    }
}

/// The purely diffuse engine.
impl LightField for () {
    type Incident = ();
    type Exitant = ();

    fn active(&self, _: u32) -> Option<Rgb> {
        None
    }
    fn clear(&self, (): &mut ()) {}
    fn receive(&self, (): &mut (), _: &Transfer) {}
    fn reflect<H: Hierarchy>(&self, _: &H, _: NodeId, _: &[&()], _: Arrived) {}
    fn radiance(&self, (): &(), _: Vec3) -> Rgb {
        Rgb::ZERO
    }
    fn radiance_bounds(&self, (): &(), _: &Cone) -> (Rgb, Rgb) {
        (Rgb::ZERO, Rgb::ZERO)
    }
}

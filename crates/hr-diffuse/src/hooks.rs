//! The hooks: what an engine shows to extensions, and what an extension does with the light that passes.
//!
//! An engine owns one [`LightField::State`] per node of its hierarchy and calls, in each iteration:
//!
//! 1. [`clear`](LightField::clear) on every active node,
//! 2. [`receive`](LightField::receive) once per link, on the receiver's own state (*gather*),
//! 3. [`reflect`](LightField::reflect) on every active leaf, with the states on the path from the root down to it:
//!    their union is the leaf's incident light (*push*, without a copy),
//! 4. [`pull`](LightField::pull) on every active inner node, children before parents.
//!
//! Receivers run in parallel; each call may write only the state it is given. [`radiance`](LightField::radiance)
//! and [`radiance_bounds`](LightField::radiance_bounds) are read while links are refined and gathered.

use crate::{Cone, Rgb};
use glam::Vec3;
use std::ops::Range;

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
    /// Number of nodes; ids are below it.
    fn node_count(&self) -> usize;
    /// Children of a node, empty for a leaf.
    fn children(&self, node: NodeId) -> Range<u32>;
    /// Parent of a node, `None` for the root.
    fn parent(&self, node: NodeId) -> Option<NodeId>;
    /// A point in the middle of the node: on the surface for elements of a surface, that of the box for clusters.
    fn center(&self, node: NodeId) -> Vec3;
    /// Radius of a sphere about [`center`](Self::center) that holds the node.
    fn radius(&self, node: NodeId) -> f32;
    /// Directions of the node's surface normals, on the side that the node stands for.
    fn normals(&self, node: NodeId) -> Cone;
    /// Surface area of the node (one side).
    fn area(&self, node: NodeId) -> f32;
    /// Material of an element of a surface; `None` for clusters and for lights without extent.
    fn material(&self, node: NodeId) -> Option<u32>;
    /// Unit direction toward a sender as seen from `at`, and the angular radius of the sender in radians.
    fn direction_to(&self, sender: NodeId, at: Vec3) -> (Vec3, f32) {
        let to = self.center(sender) - at;
        let distance = to.length().max(f32::MIN_POSITIVE);
        (to / distance, (self.radius(sender) / distance).min(1.0).asin())
    }
}

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

/// What light does besides being diffuse radiosity. `()` is the purely diffuse engine, at no cost.
pub trait LightField: Sync {
    /// What the extension keeps per node. The default is "nothing here".
    type State: Default + Send + Sync;

    /// Whether surfaces of this material take part. Nodes without any such surface below them are never visited.
    fn is_active(&self, material: u32) -> bool;
    /// Forgets the incident light of a node, before links are gathered anew; the exitant light stays.
    fn clear(&self, state: &mut Self::State);
    /// Takes one link's light at its receiver, which may be a leaf, an inner element or a cluster.
    fn receive(&self, state: &mut Self::State, transfer: &Transfer);
    /// Turns a leaf's incident light into exitant light. `path` holds the states from the root to the leaf's
    /// parent: their samples arrive at the leaf too. `diffuse` is the leaf's diffuse radiance, against which
    /// glossy detail may be judged negligible.
    fn reflect<H: Hierarchy>(
        &self,
        hierarchy: &H,
        leaf: NodeId,
        path: &[&Self::State],
        state: &mut Self::State,
        diffuse: Rgb,
    );
    /// Averages the children's exitant light, weighted by area. `children` are the states of
    /// `hierarchy.children(parent)`, in order.
    fn pull<H: Hierarchy>(&self, hierarchy: &H, parent: NodeId, state: &mut Self::State, children: &[Self::State]);
    /// Exitant radiance (W/(m² sr)) in a direction away from the node, without the diffuse part. For nodes that
    /// are not flat: radiant intensity per unit of [`Hierarchy::area`].
    fn radiance(&self, state: &Self::State, away: Vec3) -> Rgb;
    /// Smallest and largest [`radiance`](Self::radiance) over a cone of directions.
    fn radiance_bounds(&self, state: &Self::State, away: &Cone) -> (Rgb, Rgb);
}

/// The purely diffuse engine.
impl LightField for () {
    type State = ();

    fn is_active(&self, _: u32) -> bool {
        false
    }
    fn clear(&self, (): &mut ()) {}
    fn receive(&self, (): &mut (), _: &Transfer) {}
    fn reflect<H: Hierarchy>(&self, _: &H, _: NodeId, _: &[&()], (): &mut (), _: Rgb) {}
    fn pull<H: Hierarchy>(&self, _: &H, _: NodeId, (): &mut (), _: &[()]) {}
    fn radiance(&self, (): &(), _: Vec3) -> Rgb {
        Rgb::ZERO
    }
    fn radiance_bounds(&self, (): &(), _: &Cone) -> (Rgb, Rgb) {
        (Rgb::ZERO, Rgb::ZERO)
    }
}

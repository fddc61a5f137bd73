//! The hooks: what an engine shows to extensions, and what an extension does with the light that passes.
//!
//! An engine (the *host*) implements [`Hierarchy`] and calls [`LightField`]; an extension implements [`LightField`] and asks
//! [`Hierarchy`]. The host owns one [`LightField::Incident`] and one [`LightField::Exitant`] per node that needs one, made by
//! `Default`, which means "nothing here".
//!
//! # What is called when
//!
//! [`active`](LightField::active) once per material, before anything else, and [`lobe_width`](LightField::lobe_width) before links
//! are refined; their answers never change. Then, in each
//! iteration, in this order:
//!
//! | step | call | on | writes | reads |
//! | --- | --- | --- | --- | --- |
//! | | [`clear`](LightField::clear) | every active receiver | its incident light | |
//! | gather | [`radiance`](LightField::radiance), [`radiance_bounds`](LightField::radiance_bounds) | senders | | exitant light |
//! | gather | [`receive`](LightField::receive) | the receiver of each link that carries light | its incident light | |
//! | push, reflect | [`reflect`](LightField::reflect) | active leaves | makes the leaf's exitant light | incident light from the leaf up to the root |
//!
//! - *Push* needs no call: what arrives at a leaf is the union of what the nodes on its path from the root received.
//! - *Pull* needs none, either: inner nodes shine with the light of leaves below them, which the host adds up in the
//!   direction that it asks for.
//! - Leaves whose light nobody asks for need not be reflected; materials that are not active need no state.
//! - A host that gathers calls `clear` in every iteration: `receive` brings all the light there is.
//! - In a host that shoots, `receive` brings light that has not been reflected yet. It calls `clear` when it has reflected that
//!   light, and `reflect` makes what is to be shot next, in the place of what has been shot; `arrived` is what arrived since
//!   the last `clear`. So incident light is the paper's set `new`. For its set `accum` the host adds up what each link carried;
//!   when light has settled it calls `clear`, `receive` once per link with the sum, and `reflect`, as if it had gathered.
//!
//! # From which thread
//!
//! From any, and from many at once: the extension is shared (`Sync`). A call writes nothing but what it is given as
//! `&mut` or returns, and within a step nobody reads what the step writes. So receivers run in parallel, each on its own
//! state, and results do not depend on the number of threads as long as each receiver gets its light in the same order.
//!
//! # What holds
//!
//! A host keeps to this, and the extension relies on it:
//!
//! - Geometry does not change between `receive` and `reflect`; nodes may be added.
//! - Directions are unit vectors in the frame of the hierarchy, toward a sender or away from a node, and
//!   [`Transfer::direction`] is that of [`Hierarchy::direction_to`] from the receiver's centre.
//! - Light is finite and not negative, irradiance in W/m². The exitant radiance of the extension counts as π times itself
//!   where radiosity does.
//! - [`Transfer::oriented`] tells what [`Hierarchy::is_flat`] tells of the receiver.
//! - Parents hold their children, and `path` is the leaf and its ancestors, in order; those at the upper end that never
//!   receive light may be missing.
//! - [`Arrived::irradiance`] is what the samples of the path add up to at the leaf, but for visibility within ancestors.
//! - Only leaves of active materials are reflected.
//!
//! What can be seen of this in a single call, debug builds assert ([`Transfer::fault`], [`Arrived::fault`]); all of it is
//! checked by a field of [`conformance`], which a host puts in the place of its extension for a test.

pub mod conformance;

pub use crate::{Cone, Rgb};
use glam::Vec3;
use std::f32::consts::PI;

/// Index of an element of the hierarchy.
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
    /// The outline of a sender that is a polygon, about its [`center`](Self::center); `None` for all others, which then count
    /// as disks.
    fn sides(&self, _sender: NodeId) -> Option<Sides> {
        None
    }
    /// Whether a sender is infinitely far: its direction is the same from everywhere.
    fn is_distant(&self, _sender: NodeId) -> bool {
        false
    }
    /// The share of a sender that a link's receiver sees, 0…1; `None` where it is the same all over the receiver, as nothing lies between
    /// the two, or where nobody knows.
    fn seen(&self, _receiver: NodeId, _sender: NodeId) -> Option<f32> {
        None
    }
    /// What of a link's light a leaf below its receiver has, over what the link brings to the receiver: mean irradiance of the leaf by
    /// the sender, over that of the [`Transfer`]. `None` where the leaf has not looked for itself.
    fn brought(&self, _leaf: NodeId, _receiver: NodeId, _sender: NodeId) -> Option<f32> {
        None
    }
    /// What links to a receiver would carry if nothing lay between, of those that carry nothing as all of the few rays shot along them
    /// were blocked: a part of the receiver may see such a sender.
    fn hidden(&self, _receiver: NodeId) -> Vec<Transfer> {
        Vec::new()
    }
    /// Irradiance (W/m²) that a sender makes on a flat leaf with as much as the leaf sees of it, by so many rays from all over it; `None`
    /// where nobody looks.
    fn look(&self, _leaf: NodeId, _sender: NodeId, _rays: u32) -> Option<Rgb> {
        None
    }
    /// Whether the node is a part of one plane, so that all of it is oriented alike.
    fn is_flat(&self, node: NodeId) -> bool {
        self.material(node).is_some() && self.normals(node).cos_angle > FLAT_COSINE
    }
}

/// Outline of a flat sender: a trapezoid, the points centre + s (1 − taper t) across + (t + taper/3) along for −1 ≤ s, t ≤ 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides {
    /// Half of the mean width.
    pub across: Vec3,
    /// Half of the height.
    pub along: Vec3,
    /// 0 for a parallelogram, 1 for a triangle.
    pub taper: f32,
}

impl Sides {
    /// Distance from the centre to the farthest corner.
    #[must_use]
    pub fn reach(&self) -> f32 {
        let Self { across, along, taper } = *self;
        let corner = |s: f32, t: f32| (across * (s * (1.0 - taper * t)) + along * (t + taper / 3.0)).length();
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)].into_iter().fold(0.0, f32::max)
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

impl Transfer {
    /// What is wrong with it, if anything is that can be seen without the hierarchy.
    #[must_use]
    pub fn fault(&self) -> Option<&'static str> {
        if !self.direction.is_normalized() {
            return Some("the direction is not a unit vector");
        }
        (!is_light(self.irradiance)).then_some("the irradiance is negative or not finite")
    }
}

/// What a leaf received, of all the light that its path holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrived {
    /// Mean irradiance, W/m².
    pub irradiance: Rgb,
    /// Diffuse radiance that the leaf makes of it, W/(m² sr).
    pub diffuse: Rgb,
    /// The leaf sends light for others, too, whose normals are within this angle (radians) of its own: detail finer than what
    /// that makes of a reflection is lost. 0 where what it shows is turned by the normal of each place.
    pub spread: f32,
    /// Differences of the leaf's exitant light by less than this, W/(m² sr), make no difference to what is asked for: 0
    /// where everything counts.
    pub negligible: f32,
    /// The relative error that the leaf's exitant light may have, 0…1: what was asked for, or what it has anyhow, as links are no finer.
    /// What is merged or interpolated may be wrong by about as much.
    pub error: f32,
    /// Whether the leaf is only looked at, with each place's own normal, and sends no light on: then a curved one reflects what its
    /// middle does not see, too.
    pub shown: bool,
}

impl Arrived {
    /// What is wrong with it, if anything is.
    #[must_use]
    pub fn fault(&self) -> Option<&'static str> {
        if !is_light(self.irradiance) {
            return Some("the irradiance is negative or not finite");
        }
        if !is_light(self.diffuse) {
            return Some("the diffuse radiance is negative or not finite");
        }
        if !(0.0..=PI).contains(&self.spread) {
            return Some("the spread is not within 0…π");
        }
        if !(0.0..=1.0).contains(&self.error) {
            return Some("the error is not within 0…1");
        }
        (!(0.0..).contains(&self.negligible)).then_some("what is negligible is negative or no number")
    }
}

/// Width (radians) of the lobes of an extension that does not say what it is.
pub const TYPICAL_LOBE: f32 = 0.4;

/// Whether light is finite and not negative.
fn is_light(light: Rgb) -> bool {
    light.is_finite() && light.min_element() >= 0.0
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
    /// Of light from a direction of this cosine (0…1) to the normal, what surfaces of this material reflect beside the diffuse part: the
    /// directional-hemispherical reflectance, whose mean, weighted by cosines, [`active`](Self::active) tells. An engine that carries
    /// it as diffuse light knows so how much that is.
    fn directional_albedo(&self, material: u32, _cosine: f32) -> Option<Rgb> {
        self.active(material)
    }
    /// Width of the lobe that surfaces of this material reflect light in, as the standard deviation per axis in radians, so that links
    /// to them need be no finer than it can tell; `None` where they do not take part.
    fn lobe_width(&self, material: u32) -> Option<f32> {
        self.active(material).map(|_| TYPICAL_LOBE)
    }
    /// Forgets a node's incident light, before links carry light anew.
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
    /// The same of a place of a flat leaf, which is an offset (unit space) away from the middle that `exitant` is that of; `normal` is the
    /// leaf's. From beside, what lights the leaf is seen in another direction.
    fn radiance_beside(&self, exitant: &Self::Exitant, (_normal, _offset): (Vec3, Vec3), away: Vec3) -> Rgb {
        self.radiance(exitant, away)
    }
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

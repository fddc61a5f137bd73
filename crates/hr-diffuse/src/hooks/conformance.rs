//! Checks of a host: whether an engine keeps to what [the hooks](super) ask of it.
//!
//! Put a [`Watched`] extension in the place of the extension, compute some light (a small scene with a glossy surface, a
//! diffuse one and a lamp will do), and ask for the [verdict](Watched::verdict). The light is the same as without.
//!
//! ```
//! use hr_diffuse::hooks::conformance::Watched;
//! use hr_diffuse::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
//! use std::ops::ControlFlow;
//!
//! # let sphere = Shape::Sphere { center: glam::DVec3::ZERO, radius: 1.0 };
//! # let paint = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ONE, two_sided: false };
//! # let input = SceneInput { surfaces: vec![Surface::new(sphere, 0)], materials: vec![paint], ..SceneInput::default() };
//! // With an extension in the place of `()`.
//! let mut solver = Solver::new(&input, Settings::default(), Watched::new(()))?;
//! solver.solve(&mut |_| ControlFlow::Continue(()));
//! let solution = solver.finish(&mut |_| ControlFlow::Continue(()));
//! let tally = solution.field.verdict()?;
//! assert_eq!(tally.reflections, 0, "the purely diffuse engine reflects nothing");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(test)]
mod tests;

use super::{Arrived, Cone, Hierarchy, LightField, NodeId, Rgb, Transfer};
use glam::Vec3;
use std::fmt;
use std::mem::discriminant;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Directions agree when their cosine differs from 1 by less: 0.8°.
const COSINE: f32 = 1e-4;
/// What holds something may be smaller by this share of its size, and cones by this cosine.
const SLACK: f32 = 1e-3;
/// The samples of all leaves together add up to no more than this times what arrived there, and no less than one over it:
/// visibility and form factors are found anew for leaves. A factor of π is more.
const MOST_RATIO: f64 = 2.0;

/// What a host does wrong.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// See [`Transfer::fault`].
    #[error("light received from node {}: {what}", sender.0)]
    Transfer {
        /// Where the light comes from.
        sender: NodeId,
        /// What is wrong.
        what: &'static str,
    },
    /// The direction of a transfer is not that from the receiver's centre to the sender.
    #[error(
        "node {} received light of node {} from direction {said}, but `Hierarchy::direction_to` says {expected}; pass the \
         direction from the receiver toward the sender", receiver.0, sender.0
    )]
    Direction {
        /// Where the light arrives.
        receiver: NodeId,
        /// Where it comes from.
        sender: NodeId,
        /// [`Transfer::direction`].
        said: Vec3,
        /// That of the hierarchy.
        expected: Vec3,
    },
    /// Light that is said to be on the receiver's plane where the receiver is not flat, or the reverse.
    #[error("node {} received light with `oriented: {said}`, but `Hierarchy::is_flat` says {}", receiver.0, !said)]
    Oriented {
        /// Where the light arrives.
        receiver: NodeId,
        /// [`Transfer::oriented`].
        said: bool,
    },
    /// See [`Arrived::fault`].
    #[error("light that arrived at leaf {}: {what}", leaf.0)]
    Arrived {
        /// The leaf.
        leaf: NodeId,
        /// What is wrong.
        what: &'static str,
    },
    /// A leaf is reflected whose material is not active.
    #[error("leaf {} is reflected, but the extension does nothing with its material", leaf.0)]
    NotActive {
        /// The leaf.
        leaf: NodeId,
    },
    /// The path of a leaf is not the way up to the root.
    #[error("leaf {} is reflected with the light of {length} nodes, but has {depth} on its way up to the root", leaf.0)]
    Path {
        /// The leaf.
        leaf: NodeId,
        /// Nodes that were passed.
        length: usize,
        /// Nodes from the leaf up to the root, both included, as far as they were looked at.
        depth: usize,
    },
    /// A node's geometry makes no sense.
    #[error("node {}: {what}", node.0)]
    Geometry {
        /// The node.
        node: NodeId,
        /// What is wrong.
        what: &'static str,
    },
    /// A parent does not hold its child.
    #[error("node {} does not hold its child {}: {what}", parent.0, child.0)]
    Outside {
        /// The child.
        child: NodeId,
        /// The parent.
        parent: NodeId,
        /// What is not held.
        what: &'static str,
    },
    /// Radiance is asked for in something that is no direction.
    #[error("radiance is asked for in {direction}, which is not a unit vector")]
    Away {
        /// What was passed.
        direction: Vec3,
    },
    /// Samples do not add up to what arrived.
    #[error(
        "the samples of all leaves add up to {ratio:.3} times what is said to have arrived there; both are irradiances, in W/m²"
    )]
    Sum {
        /// Samples over what arrived.
        ratio: f64,
    },
    /// Light is reflected, but nobody asks for it.
    #[error("{reflections} leaves were reflected, but `radiance` is never called: no link carries that light")]
    Unasked {
        /// Calls of `reflect`.
        reflections: u64,
    },
}

impl Fault {
    /// Where it was found; the first of its kind is kept, whatever the threads do.
    fn node(&self) -> u32 {
        match *self {
            Self::Transfer { sender: node, .. }
            | Self::Direction { receiver: node, .. }
            | Self::Oriented { receiver: node, .. }
            | Self::Arrived { leaf: node, .. }
            | Self::NotActive { leaf: node }
            | Self::Path { leaf: node, .. }
            | Self::Geometry { node, .. }
            | Self::Outside { child: node, .. } => node.0,
            Self::Away { .. } | Self::Sum { .. } | Self::Unasked { .. } => 0,
        }
    }
}

/// All that a host does wrong: of every kind of fault the first case, and how many there are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults(Vec<(Fault, u64)>);

impl Faults {
    /// Each kind once.
    #[must_use]
    pub fn all(&self) -> &[(Fault, u64)] {
        &self.0
    }

    fn add(&mut self, fault: Fault) {
        match self.0.iter_mut().find(|(known, _)| discriminant(known) == discriminant(&fault)) {
            Some((known, count)) => {
                *count += 1;
                if fault.node() < known.node() {
                    *known = fault;
                }
            }
            None => self.0.push((fault, 1)),
        }
    }
}

impl std::error::Error for Faults {}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the host does not conform:")?;
        for (fault, count) in &self.0 {
            write!(f, "\n- {fault}")?;
            if *count > 1 {
                write!(f, " (the first of {count} cases)")?;
            }
        }
        Ok(())
    }
}

/// What a host that conforms did.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tally {
    /// Calls of `receive`.
    pub transfers: u64,
    /// Calls of `reflect`.
    pub reflections: u64,
    /// Calls of `radiance` and `radiance_bounds`.
    pub questions: u64,
    /// What the samples of all reflected leaves add up to over what arrived there; 1 where nothing did.
    pub ratio: f64,
}

/// An extension that looks at what the host does, and lets another one do the work.
#[derive(Debug)]
pub struct Watched<L> {
    field: L,
    transfers: AtomicU64,
    reflections: AtomicU64,
    questions: AtomicU64,
    seen: Mutex<Seen>,
}

/// What is known of a host so far.
#[derive(Debug, Default)]
struct Seen {
    faults: Faults,
    /// Irradiance, sum of channels: that of samples, and that which arrived.
    samples: f64,
    arrived: f64,
}

/// Incident light of the extension that is watched, and what it was made of.
#[derive(Debug)]
pub struct WatchedIncident<I> {
    incident: I,
    transfers: Vec<Transfer>,
}

impl<I: Default> Default for WatchedIncident<I> {
    fn default() -> Self {
        Self { incident: I::default(), transfers: Vec::new() }
    }
}

impl<L> Watched<L> {
    /// Watches what a host does with an extension.
    #[must_use]
    pub fn new(field: L) -> Self {
        let counter = AtomicU64::default;
        Self { field, transfers: counter(), reflections: counter(), questions: counter(), seen: Mutex::default() }
    }

    /// The extension.
    #[must_use]
    pub fn field(&self) -> &L {
        &self.field
    }

    /// What the host did so far.
    ///
    /// # Errors
    /// All that it did wrong.
    pub fn verdict(&self) -> Result<Tally, Faults> {
        let seen = self.seen();
        let [transfers, reflections, questions] =
            [&self.transfers, &self.reflections, &self.questions].map(|count| count.load(Ordering::Relaxed));
        let ratio = if seen.arrived > 0.0 { seen.samples / seen.arrived } else { 1.0 };
        let mut faults = seen.faults.clone();
        if !(MOST_RATIO.recip()..=MOST_RATIO).contains(&ratio) {
            faults.add(Fault::Sum { ratio });
        }
        if reflections > 0 && questions == 0 {
            faults.add(Fault::Unasked { reflections });
        }
        if faults.0.is_empty() { Ok(Tally { transfers, reflections, questions, ratio }) } else { Err(faults) }
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn report(&self, fault: Fault) {
        self.seen().faults.add(fault);
    }

    fn asked(&self, direction: Vec3) {
        self.questions.fetch_add(1, Ordering::Relaxed);
        if !direction.is_normalized() {
            self.report(Fault::Away { direction });
        }
    }

    /// Looks at the transfers of one node. Returns what they add up to at a leaf below it (sum of channels).
    fn look_at<H: Hierarchy>(&self, hierarchy: &H, receiver: NodeId, transfers: &[Transfer], leaf: NodeId) -> f64 {
        let center = hierarchy.center(receiver);
        let mut sum = 0.0;
        for &Transfer { sender, direction: said, irradiance, oriented } in transfers {
            let (expected, extent) = hierarchy.direction_to(sender, center);
            let apart = hierarchy.is_distant(sender) || hierarchy.center(sender) != center;
            if apart && !(expected.is_normalized() && (0.0..=std::f32::consts::FRAC_PI_2).contains(&extent)) {
                let what = "`direction_to` is not a unit vector with an angular radius of 0…π/2";
                self.report(Fault::Geometry { node: sender, what });
            } else if apart && said.dot(expected) < 1.0 - COSINE {
                self.report(Fault::Direction { receiver, sender, said, expected });
            }
            if let Some(sides) = hierarchy.sides(sender) {
                let is_trapezoid =
                    sides.across.is_finite() && sides.along.is_finite() && (0.0..=1.0).contains(&sides.taper);
                if !is_trapezoid || sides.reach() > hierarchy.radius(sender) * (1.0 + SLACK) {
                    let what =
                        "`sides` are not finite, reach beyond the radius, or taper by less than 0 or more than 1";
                    self.report(Fault::Geometry { node: sender, what });
                }
            }
            if oriented != hierarchy.is_flat(receiver) {
                self.report(Fault::Oriented { receiver, said: oriented });
            }
            let cosine = if oriented { 1.0 } else { hierarchy.normals(leaf).axis.dot(said).max(0.0) };
            sum += f64::from(irradiance.element_sum() * cosine);
        }
        sum
    }

    /// Looks at one node and its parent.
    fn look_up<H: Hierarchy>(&self, hierarchy: &H, node: NodeId) -> Option<NodeId> {
        let (center, radius, normals) = (hierarchy.center(node), hierarchy.radius(node), hierarchy.normals(node));
        let fault = |what| self.report(Fault::Geometry { node, what });
        if !center.is_finite() || !(0.0..f32::INFINITY).contains(&radius) {
            fault("the centre or the radius is not finite, or the radius is negative");
        }
        if !normals.axis.is_normalized() || !(-1.0..=1.0).contains(&normals.cos_angle) {
            fault("its normals are not a cone with a unit axis and a cosine of -1…1");
        }
        let parent = hierarchy.parent(node)?;
        let (above, reach) = (hierarchy.normals(parent), hierarchy.radius(parent));
        let outside = |what| self.report(Fault::Outside { child: node, parent, what });
        if center.distance(hierarchy.center(parent)) > reach * (1.0 + SLACK) {
            outside("its centre is farther from the parent's than the parent's radius");
        }
        if above.axis.dot(normals.axis) < above.cos_angle - SLACK {
            outside("its normals are not within the parent's cone of normals");
        }
        Some(parent)
    }
}

impl<L: LightField> LightField for Watched<L> {
    type Incident = WatchedIncident<L::Incident>;
    type Exitant = L::Exitant;

    fn active(&self, material: u32) -> Option<Rgb> {
        self.field.active(material)
    }

    fn directional_albedo(&self, material: u32, cosine: f32) -> Option<Rgb> {
        self.field.directional_albedo(material, cosine)
    }

    fn lobe_width(&self, material: u32) -> Option<f32> {
        self.field.lobe_width(material)
    }

    fn clear(&self, incident: &mut Self::Incident) {
        incident.transfers.clear();
        self.field.clear(&mut incident.incident);
    }

    fn receive(&self, incident: &mut Self::Incident, transfer: &Transfer) {
        self.transfers.fetch_add(1, Ordering::Relaxed);
        if let Some(what) = transfer.fault() {
            // Extensions rely on what is wrong here.
            return self.report(Fault::Transfer { sender: transfer.sender, what });
        }
        incident.transfers.push(*transfer);
        self.field.receive(&mut incident.incident, transfer);
    }

    fn reflect<H: Hierarchy>(
        &self,
        hierarchy: &H,
        leaf: NodeId,
        path: &[&Self::Incident],
        arrived: Arrived,
    ) -> Self::Exitant {
        self.reflections.fetch_add(1, Ordering::Relaxed);
        if hierarchy.material(leaf).is_none_or(|material| self.field.active(material).is_none()) {
            self.report(Fault::NotActive { leaf });
        }
        let (mut node, mut depth, mut samples) = (Some(leaf), 0, 0.0);
        for incident in path.iter().rev() {
            let Some(here) = node else { break };
            depth += 1;
            samples += self.look_at(hierarchy, here, &incident.transfers, leaf);
            node = self.look_up(hierarchy, here);
        }
        if path.is_empty() || depth < path.len() {
            self.report(Fault::Path { leaf, length: path.len(), depth: depth.max(1) });
            return L::Exitant::default();
        }
        if let Some(what) = arrived.fault() {
            self.report(Fault::Arrived { leaf, what });
            return L::Exitant::default();
        }
        {
            let mut seen = self.seen();
            seen.samples += samples;
            seen.arrived += f64::from(arrived.irradiance.element_sum());
        }
        let path: Vec<&L::Incident> = path.iter().map(|incident| &incident.incident).collect();
        self.field.reflect(hierarchy, leaf, &path, arrived)
    }

    fn radiance(&self, exitant: &Self::Exitant, away: Vec3) -> Rgb {
        self.asked(away);
        self.field.radiance(exitant, away)
    }

    fn radiance_beside(&self, exitant: &Self::Exitant, place: (Vec3, Vec3), away: Vec3) -> Rgb {
        self.asked(away);
        self.field.radiance_beside(exitant, place, away)
    }

    fn radiance_bounds(&self, exitant: &Self::Exitant, away: &Cone) -> (Rgb, Rgb) {
        self.asked(away.axis);
        self.field.radiance_bounds(exitant, away)
    }

    fn incident_bytes(&self, incident: &Self::Incident) -> usize {
        self.field.incident_bytes(&incident.incident) + size_of_val(incident.transfers.as_slice())
    }

    fn exitant_bytes(&self, exitant: &Self::Exitant) -> usize {
        self.field.exitant_bytes(exitant)
    }
}

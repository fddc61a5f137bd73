//! A host of two leaves below a root, right at first, and then wrong in one way after the other.

use super::*;
use crate::hooks::Sides;
use std::f32::consts::PI;

/// An extension that only adds up irradiance, of material 0.
#[derive(Debug)]
struct Sum;

impl LightField for Sum {
    type Incident = Rgb;
    type Exitant = Rgb;

    fn active(&self, material: u32) -> Option<Rgb> {
        (material == 0).then_some(Rgb::ONE)
    }
    fn clear(&self, incident: &mut Rgb) {
        *incident = Rgb::ZERO;
    }
    fn receive(&self, incident: &mut Rgb, transfer: &Transfer) {
        *incident += transfer.irradiance;
    }
    fn reflect<H: Hierarchy>(&self, _: &H, _: NodeId, path: &[&Rgb], _: Arrived) -> Rgb {
        path.iter().copied().sum::<Rgb>() / PI
    }
    fn radiance(&self, exitant: &Rgb, _: Vec3) -> Rgb {
        *exitant
    }
    fn radiance_bounds(&self, exitant: &Rgb, _: &Cone) -> (Rgb, Rgb) {
        (*exitant, *exitant)
    }
}

/// Two leaves that face each other, below a root.
#[derive(Clone, Debug)]
struct Host {
    parents: [Option<u32>; 3],
    centers: [Vec3; 3],
    radii: [f32; 3],
    normals: [Cone; 3],
    materials: [Option<u32>; 3],
    sides: Sides,
    direction: Vec3,
    irradiance: Rgb,
    oriented: bool,
    arrived: Arrived,
    /// Nodes of the path, the leaf last.
    path: Vec<usize>,
    away: Option<Vec3>,
}

impl Host {
    fn right() -> Self {
        Self {
            parents: [None, Some(0), Some(0)],
            centers: [Vec3::ZERO, -Vec3::Z, Vec3::Z],
            radii: [1.5, 0.5, 0.5],
            normals: [Cone::SPHERE, Cone::single(Vec3::Z), Cone::single(-Vec3::Z)],
            materials: [None, Some(0), Some(1)],
            sides: Sides { across: 0.3 * Vec3::X, along: 0.4 * Vec3::Y, taper: 0.0 },
            direction: Vec3::Z,
            irradiance: Rgb::splat(2.0),
            oriented: true,
            arrived: Arrived {
                irradiance: Rgb::splat(2.0),
                diffuse: Rgb::ZERO,
                spread: 0.0,
                negligible: 0.0,
                error: 0.1,
                shown: false,
            },
            path: vec![0, 1],
            away: Some(Vec3::Z),
        }
    }

    /// One iteration.
    fn run(&self) -> Result<Tally, Faults> {
        let field = Watched::new(Sum);
        let mut incident: [WatchedIncident<Rgb>; 3] = Default::default();
        field.clear(&mut incident[1]);
        let Self { direction, irradiance, oriented, .. } = *self;
        field.receive(&mut incident[1], &Transfer { sender: NodeId(2), direction, irradiance, oriented });
        let path: Vec<_> = self.path.iter().map(|&node| &incident[node]).collect();
        let leaf = NodeId(self.path.last().map_or(1, |&node| node as u32));
        let exitant = field.reflect(self, leaf, &path, self.arrived);
        if let Some(away) = self.away {
            field.radiance(&exitant, away);
        }
        field.verdict()
    }
}

impl Hierarchy for Host {
    fn parent(&self, node: NodeId) -> Option<NodeId> {
        self.parents[node.index()].map(NodeId)
    }
    fn center(&self, node: NodeId) -> Vec3 {
        self.centers[node.index()]
    }
    fn radius(&self, node: NodeId) -> f32 {
        self.radii[node.index()]
    }
    fn normals(&self, node: NodeId) -> Cone {
        self.normals[node.index()]
    }
    fn material(&self, node: NodeId) -> Option<u32> {
        self.materials[node.index()]
    }
    fn sides(&self, sender: NodeId) -> Option<Sides> {
        (sender.0 == 2).then_some(self.sides)
    }
}

#[test]
fn a_host_that_conforms_passes() {
    let tally = Host::right().run().expect("nothing is wrong");
    assert_eq!(tally, Tally { transfers: 1, reflections: 1, questions: 1, ratio: 1.0 }, "what it did");
    let mut alone = Host::right();
    alone.path = vec![1];
    assert!(alone.run().is_ok(), "ancestors that receive nothing may be missing");
}

#[test]
fn every_fault_is_found() {
    type Wrong = (fn(&mut Host), &'static str);
    let cases: [Wrong; 20] = [
        (|h| h.direction = 2.0 * Vec3::Z, "not a unit vector"),
        (|h| h.irradiance.x = f32::NAN, "negative or not finite"),
        (|h| h.direction = -Vec3::Z, "from direction"),
        (|h| h.oriented = false, "oriented: false"),
        (|h| h.normals[1].cos_angle = 0.5, "oriented: true"),
        (|h| h.arrived.irradiance.y = -1.0, "arrived at leaf 1"),
        (|h| h.arrived.spread = f32::NAN, "spread"),
        (|h| h.arrived.error = 2.0, "the error is not within"),
        (|h| h.materials[1] = Some(1), "does nothing with its material"),
        (|h| h.path = vec![2, 0, 1], "light of 3 nodes"),
        (|h| h.path = Vec::new(), "light of 0 nodes"),
        (|h| h.radii[1] = f32::NAN, "node 1: the centre or the radius"),
        (|h| h.normals[1].axis = Vec3::ZERO, "node 1: its normals"),
        (|h| h.radii[0] = 0.1, "does not hold its child 1: its centre"),
        (|h| h.normals[0] = Cone::single(Vec3::X), "does not hold its child 1: its normals"),
        (|h| h.away = Some(Vec3::ONE), "radiance is asked for in"),
        (|h| h.arrived.irradiance *= PI, "add up to 0.318 times"),
        (|h| h.sides.across.x = 0.31, "node 2: `sides` are not finite, reach beyond the radius"),
        (|h| h.sides.along.y = f32::NAN, "node 2: `sides`"),
        (|h| h.sides.taper = -0.1, "node 2: `sides`"),
    ];
    for (spoil, expected) in cases {
        let mut host = Host::right();
        spoil(&mut host);
        let faults = host.run().expect_err(expected).to_string();
        assert!(faults.contains(expected), "{expected:?} is not in: {faults}");
    }
    let mut silent = Host::right();
    silent.away = None;
    assert_eq!(silent.run().expect_err("unasked").all(), [(Fault::Unasked { reflections: 1 }, 1)], "no more than that");
}

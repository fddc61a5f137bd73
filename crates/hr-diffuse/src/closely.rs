//! Leaves that are looked at closely: what they see themselves, where links tell only what something larger sees.
//!
//! A link lies as high up as its light lets it. Of a lamp that sends a thousandth of a floor's light it is known how much all of the
//! floor sees of it; but its highlight may be the brightest thing on a polished board, and is there or not.

use crate::Rgb;
use crate::cone::Cone;
use crate::gather::Gather;
use crate::hooks::{Hierarchy, LightField, NodeId, Sides, Transfer};
use crate::links::{Link, Links};
use crate::push::{Spread, visible};
use crate::sampling::{hash, point2, unit};
use crate::segments::{receiving_point, visibility_at};
use crate::toward::Detail;
use crate::transport::Light;
use glam::Vec3;
use std::sync::atomic::{AtomicU64, Ordering};

/// The hierarchy with its light and links, for an extension that reflects light to be looked at.
pub(crate) struct Closely<'a, L: LightField> {
    light: Light<'a, L>,
    links: &'a Links,
    /// What leaves have found out, if they have, and by leaf: the position of its place among all, and where it lies from the middle.
    found: Option<(&'a Gather, Vec<(u32, Vec3)>)>,
    rays: AtomicU64,
    unseen: AtomicU64,
}

/// What looking took, and what it spared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Looks {
    pub(crate) rays: u64,
    /// Of senders of which nothing was seen: what they would bring was not found out.
    pub(crate) unseen: u64,
}

impl<'a, L: LightField> Closely<'a, L> {
    pub(crate) fn new(light: Light<'a, L>, links: &'a Links, gather: Option<&'a Gather>) -> Self {
        let found = gather.map(|gather| {
            let mut places = vec![(u32::MAX, Vec3::ZERO); light.elements.nodes.len()];
            gather.places().each_leaf(light.elements, |leaf, index, joined| {
                places[leaf as usize] = (index as u32, joined.map_or(Vec3::ZERO, |(_, from_middle)| from_middle));
            });
            (gather, places)
        });
        Self { light, links, found, rays: AtomicU64::new(0), unseen: AtomicU64::new(0) }
    }

    /// So far.
    pub(crate) fn looks(&self) -> Looks {
        Looks { rays: self.rays.load(Ordering::Relaxed), unseen: self.unseen.load(Ordering::Relaxed) }
    }
}

impl<L: LightField> Hierarchy for Closely<'_, L> {
    fn parent(&self, node: NodeId) -> Option<NodeId> {
        self.light.parent(node)
    }
    fn center(&self, node: NodeId) -> Vec3 {
        self.light.center(node)
    }
    fn radius(&self, node: NodeId) -> f32 {
        self.light.radius(node)
    }
    fn normals(&self, node: NodeId) -> Cone {
        self.light.normals(node)
    }
    fn material(&self, node: NodeId) -> Option<u32> {
        self.light.material(node)
    }
    fn direction_to(&self, sender: NodeId, at: Vec3) -> (Vec3, f32) {
        self.light.elements.direction_to(sender, at)
    }
    fn is_distant(&self, sender: NodeId) -> bool {
        self.light.is_distant(sender)
    }
    fn sides(&self, sender: NodeId) -> Option<Sides> {
        self.light.sides(sender)
    }
    fn seen(&self, receiver: NodeId, sender: NodeId) -> Option<f32> {
        let links = self.links.of(receiver.0);
        let at = links.binary_search_by_key(&sender.0, |link| link.sender).ok()?;
        Some(links[at].visibility).filter(|&visibility| visibility >= 0.0)
    }
    fn brought(&self, leaf: NodeId, receiver: NodeId, sender: NodeId) -> Option<f32> {
        let (gather, places) = self.found.as_ref()?;
        let (index, from_middle) = places[leaf.index()];
        let at = self.links.of(receiver.0).binary_search_by_key(&sender.0, |link| link.sender).ok()?;
        let at = self.links.range(receiver.0).start + at;
        gather.brought(self.light.elements, (index as usize, from_middle), (receiver.0, at))
    }
    fn hidden(&self, receiver: NodeId) -> Vec<Transfer> {
        let (light, node) = (self.light, self.light.element(receiver.0));
        let carries_nothing = |(link, at): (&Link, usize)| {
            let spread = self.found.as_ref().map_or(Spread::Even, |(gather, _)| gather.spread(at));
            (link.factor > 0.0 && visible(link, spread) == 0.0).then_some(*link)
        };
        let blocked = self.links.of(receiver.0).iter().zip(self.links.range(receiver.0)).filter_map(carries_nothing);
        let unoccluded = blocked.map(|link| {
            let direction = light.direction_to(node.center, link.sender);
            let irradiance = light.emitted(link.sender, -direction) * link.factor;
            Transfer { sender: NodeId(link.sender), direction, irradiance, oriented: node.is_flat() }
        });
        unoccluded.collect()
    }
    fn look(&self, leaf: NodeId, sender: NodeId, rays: u32) -> Option<Rgb> {
        let element = self.light.element(leaf.0);
        let seed = hash(leaf.0, 0x100c);
        let middle @ (x, n, _) = (element.center, element.normals.axis, element.source);
        let arriving = |detail: Detail| self.light.arriving_at(x, n, sender.0, detail).0;
        let spot =
            |i: u32| receiving_point(self.light, leaf.0, (unit(hash(seed, i)), point2(seed, i))).unwrap_or(middle);
        let see = || {
            self.rays.fetch_add(u64::from(rays), Ordering::Relaxed);
            visibility_at(self.light, spot, sender.0, (rays, seed))
        };
        // Most is hidden: what it would bring is found out only where something of it is seen.
        let first = (arriving(Detail::rough()) != Rgb::ZERO).then(see);
        if first == Some(0.0) {
            self.unseen.fetch_add(1, Ordering::Relaxed);
            return Some(Rgb::ZERO);
        }
        let irradiance = arriving(Detail::carried(0.0));
        Some(if irradiance == Rgb::ZERO { irradiance } else { irradiance * first.unwrap_or_else(see) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DiffuseMaterial, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;

    fn quad(o: DVec3, a: DVec3, b: DVec3) -> Shape {
        Shape::Quad([o, o + a, o + a + b, o + b])
    }

    /// A solver of a floor, a lamp, and what else there is, which reflects so much; with the nodes of floor and lamp.
    fn solver(shapes: &[Shape], reflectance: f32, error: f32) -> (Solver, [u32; 2]) {
        let material = |reflectance, exitance| DiffuseMaterial {
            reflectance: Rgb::splat(reflectance),
            exitance: Rgb::splat(exitance),
            two_sided: true,
        };
        let surface = |(at, shape): (usize, &Shape)| Surface::new(shape.clone(), u32::from(at == 1));
        let input = SceneInput {
            surfaces: shapes.iter().enumerate().map(surface).collect(),
            materials: vec![material(reflectance, 0.0), material(0.0, 1.0)],
            ..SceneInput::default()
        };
        let solver = Solver::new(&input, Settings::with_error(error), ()).expect("the scene is sound");
        let nodes = [0, 1].map(|surface| solver.elements.surface_nodes[surface][0]);
        (solver, nodes)
    }

    /// A floor in parts below a small lamp, which a sheet that stands on it hides from half of them; one link to all of it.
    #[test]
    fn leaves_see_what_the_floor_does_not_tell() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let shapes = [
            quad(DVec3::ZERO, x, y),
            quad(DVec3::new(0.2, 0.45, 0.9), y * 0.1, x * 0.1),
            quad(DVec3::new(0.5, 0.0, 0.0), y, z),
        ];
        let (mut solver, [floor, lamp]) = solver(&shapes, 0.5, 0.5);
        solver.elements.split(&solver.scene, floor);
        let count = solver.elements.nodes.len();
        solver.exitant.radiosity = vec![Rgb::ZERO; count];
        solver.exitant.radiosity[lamp as usize] = Rgb::ONE;
        solver.exitant.range = solver.exitant.radiosity.iter().map(|&radiosity| [radiosity; 2]).collect();
        let link = |visibility| Link { receiver: floor, sender: lamp, factor: 0.003, visibility };
        let links = [0.5, -1.0].map(|visibility| Links::new(vec![link(visibility)], count));
        let [floor_id, lamp_id] = [floor, lamp].map(NodeId);
        let closely = Closely::new(solver.light(), &links[0], None);
        assert_eq!(closely.seen(floor_id, lamp_id), Some(0.5), "as the link says");
        assert_eq!(closely.seen(lamp_id, floor_id), None, "there is no link");
        assert_eq!(Closely::new(solver.light(), &links[1], None).seen(floor_id, lamp_id), None, "proved for all of it");
        let element = solver.elements.nodes[floor as usize];
        for leaf in element.first_child..element.first_child + element.child_count {
            let at = solver.elements.nodes[leaf as usize];
            let right = solver.light().irradiance_at(at.center, at.normals.axis, lamp);
            let found = closely.look(NodeId(leaf), lamp_id, 256).expect("it looks");
            let is_lit = solver.scene.normalization.to_scene(at.center).x < 0.5;
            assert_eq!(found, if is_lit { right } else { Rgb::ZERO }, "all of it or nothing, at {}", at.center);
        }
        let looks = Looks { rays: u64::from(element.child_count) * 256, unseen: u64::from(element.child_count) / 2 };
        assert_eq!(closely.looks(), looks, "all are counted");
    }
    /// A floor, half of which a sheet hides from a lamp: what leaves found out of each link against many rays.
    #[test]
    fn leaves_know_what_they_have_of_a_link() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let shapes = [
            quad(DVec3::ZERO, x, y),
            quad(DVec3::new(0.2, 0.3, 0.9), y * 0.4, x * 0.4),
            quad(DVec3::new(0.55, 0.0, 0.2), y, z * 0.5),
        ];
        let (mut solver, [floor, lamp]) = solver(&shapes, 0.3, 0.2);
        solver.solve(&mut |_| std::ops::ControlFlow::Continue(()));
        let light = solver.light();
        let closely = Closely::new(light, &solver.links, Some(&solver.gather));
        let without = Closely::new(light, &solver.links, None);
        let is_below = |node: u32, root: u32| {
            std::iter::successors(Some(NodeId(node)), |&node| closely.parent(node)).any(|node| node == NodeId(root))
        };
        let (mut off, mut off_by_link, mut right, mut count) = (0.0, 0.0, 0.0, 0);
        for leaf in solver.elements.patch_leaves().filter(|&leaf| is_below(leaf, floor)) {
            for receiver in std::iter::successors(Some(NodeId(leaf)), |&node| closely.parent(node)) {
                for link in solver.links.of(receiver.0).iter().filter(|link| is_below(link.sender, lamp)) {
                    let sender = NodeId(link.sender);
                    assert_eq!(without.brought(NodeId(leaf), receiver, sender), None, "nobody has told");
                    let Some(brought) = closely.brought(NodeId(leaf), receiver, sender) else { continue };
                    let spread =
                        solver.gather.spread(solver.links.all().iter().position(|l| l == link).expect("it is one"));
                    let carried = crate::gather::carried(light, link, spread).x;
                    let truth = closely.look(NodeId(leaf), sender, 1024).expect("it looks").x;
                    let area = light.element(leaf).area;
                    off += area * (carried * brought - truth).abs();
                    off_by_link += area * (carried - truth).abs();
                    right += area * truth;
                    count += 1;
                }
            }
        }
        assert!(count > 20, "leaves have found out something: {count} links");
        assert!(off < 0.1 * right, "off by {}", off / right);
        // 0.51 was found: a leaf has no more than 16 rays for a link.
        assert!(off < 0.7 * off_by_link, "{off}, {off_by_link} by what links say of all of their receivers");
    }

    /// A link whose few rays were blocked, though nothing proves that all are.
    #[test]
    fn what_lets_nothing_through_is_told() {
        let (x, y) = (DVec3::X, DVec3::Y);
        let shapes = [quad(DVec3::ZERO, x, y), quad(DVec3::Z, y, x)];
        let (mut solver, [floor, lamp]) = solver(&shapes, 0.5, 0.5);
        let count = solver.elements.nodes.len();
        solver.exitant.radiosity = vec![Rgb::ONE; count];
        let told = |visibility: f32| {
            let links = Links::new(vec![Link { receiver: floor, sender: lamp, factor: 0.2, visibility }], count);
            Closely::new(solver.light(), &links, None).hidden(NodeId(floor))
        };
        for visibility in [-1.0, 0.01, 1.0] {
            assert_eq!(told(visibility), [], "light passes by {visibility}");
        }
        let [transfer] = told(0.0)[..] else { panic!("there is one such link") };
        assert_eq!((transfer.sender, transfer.fault()), (NodeId(lamp), None));
        assert_eq!(transfer.irradiance, Rgb::splat(0.2), "what it would bring");
        assert!(transfer.oriented && transfer.direction.distance(Vec3::Z) < 1e-6, "from {}", transfer.direction);
    }
}

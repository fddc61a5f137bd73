//! Senders that none of the leaves around a vertex sees.
//!
//! Of the light that could reach a vertex most is hidden: by furniture, by the walls of other rooms. Every link of a leaf to such a sender was
//! sampled when it was made, and the leaves around a vertex have links of their own to the same sender or to what holds it. Where one of
//! them sees a part, a shadow's edge may pass the vertex; where none does, a few rays more are enough to be sure.

use crate::hooks::LightField;
use crate::links::Links;
use crate::transport::Light;
use smallvec::SmallVec;

/// Senders in order.
pub(crate) struct Hidden(SmallVec<[u32; 64]>);

impl Hidden {
    /// Those that links of each of these leaves, and of what holds it, have found hidden altogether.
    pub(crate) fn from_all<L: LightField>(light: Light<'_, L>, links: &Links, leaves: &[u32]) -> Self {
        let Some((&first, others)) = leaves.split_first() else { return Self(SmallVec::new()) };
        let mut all = of_leaf(light, links, first);
        for &leaf in others {
            let hidden = of_leaf(light, links, leaf);
            all.retain(|sender| ancestors(light, *sender).any(|node| hidden.binary_search(&node).is_ok()));
        }
        Self(all)
    }

    pub(crate) fn holds(&self, sender: u32) -> bool {
        self.0.binary_search(&sender).is_ok()
    }
}

fn of_leaf<L: LightField>(light: Light<'_, L>, links: &Links, leaf: u32) -> SmallVec<[u32; 64]> {
    let through = ancestors(light, leaf).flat_map(|node| links.of(node));
    let mut hidden: SmallVec<_> = through.filter(|link| link.visibility == 0.0).map(|link| link.sender).collect();
    hidden.sort_unstable();
    hidden
}

/// A node and all that hold it.
fn ancestors<L: LightField>(light: Light<'_, L>, node: u32) -> impl Iterator<Item = u32> {
    std::iter::successors(Some(node), move |&node| (node != 0).then(|| light.element(node).parent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::footprint::footprint;
    use crate::segments::visibility_at;
    use crate::vertices::outlines;
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;
    use std::ops::ControlFlow;

    /// A lamp above a table: what is in its shadow is told from its edges, and with many rays nothing of the lamp is seen from there.
    #[test]
    fn what_no_leaf_sees_no_vertex_sees() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let plate = |half: f64, at: DVec3| [-y - x, x - y, x + y, y - x].map(|corner| half * corner + at);
        let [mut lamp, floor, table] = [plate(0.2, 2.0 * z), plate(2.0, DVec3::ZERO), plate(0.6, z)];
        lamp.reverse();
        let material = |reflectance, exitance| DiffuseMaterial { reflectance, exitance, two_sided: false };
        let input = SceneInput {
            surfaces: [floor, table, lamp]
                .into_iter()
                .zip(0..)
                .map(|(at, of)| Surface::new(Shape::Quad(at), of))
                .collect(),
            materials: vec![
                material(Rgb::splat(0.5), Rgb::ZERO),
                material(Rgb::ZERO, Rgb::ZERO),
                material(Rgb::ZERO, Rgb::ONE),
            ],
            ..SceneInput::default()
        };
        let mut solver = Solver::new(&input, Settings::with_error(0.05), ()).expect("a table");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let light = solver.light();
        let vertices = outlines(light.scene, light.elements).fans(light.scene, light.elements);
        let lamp = light.elements.surface_nodes[2][0];
        let on_floor = |&vertex: &u32| light.element(vertices.leaf[vertex as usize]).source == 0;
        // Of links to the lamp: how many there are, and how much is seen through them.
        let (mut hidden, mut all) = ((0, 0.0), (0, 0.0));
        for vertex in (0..vertices.positions.len() as u32).filter(on_floor) {
            let around = vertices.leaves_around(vertex);
            let in_all = Hidden::from_all(light, &solver.links, around);
            let spots = footprint(light, (&vertices, vertex), (0.25, 1));
            let through = ancestors(light, around[0]).flat_map(|node| solver.links.of(node));
            let senders = through.map(|link| link.sender);
            for sender in senders.filter(|&sender| ancestors(light, sender).any(|node| node == lamp)) {
                let from = |i| spots.spot(i).expect("it is open");
                let seen = light.element(sender).area * visibility_at(light, from, sender, (256, 7));
                let add = |to: &mut (u32, f32)| *to = (to.0 + 1, to.1 + seen);
                add(&mut all);
                if in_all.holds(sender) {
                    add(&mut hidden);
                }
            }
        }
        assert!(5 * hidden.0 > all.0, "a table's shadow: {hidden:?} of {all:?}");
        assert!(hidden.1 < 0.012 * all.1, "next to nothing is seen of what is hidden: {hidden:?} of {all:?}");
    }
}

//! The tree over surfaces as flat arrays, so that it need not be built anew for a solution that is read.

use super::{LEAF, Leaf, Node, Primitive, Visibility};
use crate::flat::{FlatError, Reader, Writer, fits};
use crate::geometry::Geometry;
use crate::threads;
use std::io;

const TREE: &str = "tree of surfaces";

impl Visibility {
    /// Writes all but the surfaces themselves.
    pub(crate) fn store(&self, out: &mut Writer<'_>) -> io::Result<()> {
        out.put(&self.nodes)?;
        out.put(&self.leaves)?;
        out.put(&self.surfaces)
    }

    /// Reads it again, for surfaces of which rays meet those that are their own `first`.
    pub(crate) fn restore(geometries: Vec<Geometry>, first: &[u32], from: &mut Reader<'_>) -> Result<Self, FlatError> {
        let nodes: Vec<Node> = from.take(TREE)?;
        let (leaves, surfaces): (Vec<Leaf>, Vec<u32>) = (from.take(TREE)?, from.take(TREE)?);
        fits(is_tree(&nodes, leaves.len()), TREE)?;
        let is_within =
            |leaf: &Leaf| leaf.first.checked_add(leaf.count).is_some_and(|end| end as usize <= surfaces.len());
        fits(leaves.iter().all(is_within), TREE)?;
        let mut primitive_of = vec![u32::MAX; geometries.len()];
        for (primitive, &surface) in surfaces.iter().enumerate() {
            let place = primitive_of.get_mut(surface as usize).filter(|place| **place == u32::MAX);
            *place.ok_or(FlatError::Misfit(TREE))? = primitive as u32;
        }
        let is_own = |surface: usize| first[surface] as usize == surface;
        fits((0..first.len()).all(|surface| (primitive_of[surface] != u32::MAX) == is_own(surface)), TREE)?;
        for (surface, &twin) in first.iter().enumerate() {
            primitive_of[surface] = primitive_of[twin as usize];
        }
        let primitive = |surface: &u32| Primitive::of(&geometries[*surface as usize]);
        let primitives: Vec<Primitive> = threads::map(&surfaces, 1024, primitive);
        Ok(Self { geometries, nodes, leaves, primitives, surfaces, primitive_of })
    }
}

/// Whether every node but the first, and every leaf, is the child of one node before it, and unused places are empty: so no walk
/// goes anywhere twice.
fn is_tree(nodes: &[Node], leaves: usize) -> bool {
    let (mut inner, mut outer) = (vec![false; nodes.len()], vec![false; leaves]);
    let is_first = |met: Option<&mut bool>| met.is_some_and(|met| !std::mem::replace(met, true));
    let sound = nodes.iter().enumerate().all(|(id, node)| {
        (0..4).all(|place| match node.children[place] {
            0 => (0..6).all(|bound| node.bounds[bound][place] == Node::EMPTY.bounds[bound][place]),
            child if child & LEAF != 0 => is_first(outer.get_mut((child & !LEAF) as usize)),
            child => child as usize > id && is_first(inner.get_mut(child as usize)),
        })
    });
    sound && inner.iter().skip(1).all(|met| *met) && outer.iter().all(|met| *met)
}

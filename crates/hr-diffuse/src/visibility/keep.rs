//! The tree over surfaces as flat arrays, so that it need not be built anew for a solution that is read.

use super::eight::WIDTH;
use super::{CURVED, LAST, LEAF, Node, Primitive, Visibility};
use crate::flat::{FlatError, Reader, Writer, fits};
use crate::geometry::Geometry;
use crate::threads;
use std::io;

const TREE: &str = "tree of surfaces";

impl Visibility {
    /// Writes all but the surfaces themselves.
    pub(crate) fn store(&self, out: &mut Writer<'_>) -> io::Result<()> {
        let ids: Vec<u32> = self.primitives.iter().map(|p| p.surface & !CURVED).collect();
        out.put(&self.nodes)?;
        out.put(&ids)
    }

    /// Reads it again, for surfaces of which rays meet those that are their own `first`.
    pub(crate) fn restore(geometries: Vec<Geometry>, first: &[u32], from: &mut Reader<'_>) -> Result<Self, FlatError> {
        let nodes: Vec<Node> = from.take(TREE)?;
        // Ids of the surfaces, leaf by leaf, the last of each marked.
        let ids: Vec<u32> = from.take(TREE)?;
        fits(is_tree(&nodes, &ids), TREE)?;
        let mut primitive_of = vec![u32::MAX; geometries.len()];
        for (primitive, &id) in ids.iter().enumerate() {
            let place = primitive_of.get_mut((id & !LAST) as usize).filter(|place| **place == u32::MAX);
            *place.ok_or(FlatError::Misfit(TREE))? = primitive as u32;
        }
        let is_own = |surface: usize| first[surface] as usize == surface;
        fits((0..first.len()).all(|surface| (primitive_of[surface] != u32::MAX) == is_own(surface)), TREE)?;
        for (surface, &twin) in first.iter().enumerate() {
            primitive_of[surface] = primitive_of[twin as usize];
        }
        let primitive = |&id: &u32| Primitive::of(&geometries[(id & !LAST) as usize], id & !LAST, id & LAST != 0);
        let primitives: Vec<Primitive> = threads::map(&ids, 1024, primitive);
        Ok(Self { geometries, nodes, primitives, primitive_of })
    }
}

/// Whether every node but the first, and every leaf, is the child of one node before it, and unused places are empty: so no walk
/// goes anywhere twice.
fn is_tree(nodes: &[Node], ids: &[u32]) -> bool {
    // Where a primitive is the first of a leaf.
    let begins = |at: usize| at < ids.len() && (at == 0 || ids[at - 1] & LAST != 0);
    let (mut inner, mut outer) = (vec![false; nodes.len()], vec![false; ids.len()]);
    let is_first = |met: Option<&mut bool>| met.is_some_and(|met| !std::mem::replace(met, true));
    let sound = nodes.iter().enumerate().all(|(id, node)| {
        (0..WIDTH).all(|place| match node.children[place] {
            0 => {
                (0..6).all(|bound| node.bounds[bound].to_array()[place] == Node::EMPTY.bounds[bound].to_array()[place])
            }
            child if child & LEAF != 0 => {
                let at = (child & !LEAF) as usize;
                begins(at) && is_first(outer.get_mut(at))
            }
            child => child as usize > id && is_first(inner.get_mut(child as usize)),
        })
    });
    let ends = ids.last().is_none_or(|id| id & LAST != 0);
    sound && ends && inner.iter().skip(1).all(|met| *met) && (0..ids.len()).all(|at| outer[at] == begins(at))
}

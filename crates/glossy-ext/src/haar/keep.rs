//! Distributions as flat arrays, and from them again.

use super::mesh::MAX_VERTICES;
use super::nodes::Layout;
use super::{Haar, MAX_LEVEL};
use crate::basis::half::Half3;
use hr_diffuse::flat::{FlatError, Reader, Writer, fits};
use std::io;

const WHAT: &str = "directional distributions";

/// Larger scales would make infinity of the largest number that half a word can hold, 131008.
const MOST_SCALE: f32 = f32::MAX / 131_072.0;

/// What there is of a distribution beside its arrays.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Head {
    scale: f32,
    roots: u8,
    unused: u8,
    layout: Layout,
    vertices: u32,
    /// Bytes.
    nodes: u32,
}

impl Haar {
    /// Writes distributions.
    ///
    /// # Errors
    /// Those of what is written to.
    pub fn store<'a>(all: impl Iterator<Item = &'a Self> + Clone, out: &mut Writer<'_>) -> io::Result<()> {
        let head = |haar: &Self| Head {
            scale: haar.scale,
            roots: haar.roots,
            unused: 0,
            layout: haar.layout,
            vertices: haar.vertices.len() as u32,
            nodes: haar.nodes.len() as u32,
        };
        out.put(&all.clone().map(head).collect::<Vec<_>>())?;
        out.put(&all.clone().flat_map(|haar| &*haar.vertices).copied().collect::<Vec<Half3>>())?;
        out.put(&all.flat_map(|haar| &*haar.nodes).copied().collect::<Vec<u8>>())
    }

    /// Reads what [`store`](Self::store) wrote.
    ///
    /// # Errors
    /// Where it is anything else.
    pub fn restore(from: &mut Reader<'_>) -> Result<Vec<Self>, FlatError> {
        let heads: Vec<Head> = from.take(WHAT)?;
        let vertices: Vec<Vec<Half3>> = from.take_groups(heads.iter().map(|head| head.vertices), WHAT)?;
        let nodes: Vec<Vec<u8>> = from.take_groups(heads.iter().map(|head| head.nodes), WHAT)?;
        let restored = heads.into_iter().zip(vertices).zip(nodes).map(|((head, vertices), nodes)| {
            let Head { scale, roots, layout, .. } = head;
            let haar = Self { scale, roots, vertices: vertices.into(), layout, nodes: nodes.into() };
            fits(haar.is_sound(), WHAT).map(|()| haar)
        });
        restored.collect()
    }

    /// Whether every index is within what it points into, and nodes are a forest no deeper than it may be: level by level, each
    /// node's children after those of the one before it, as they are made.
    fn is_sound(&self) -> bool {
        if self.vertices.is_empty() {
            return self.nodes.is_empty() && self.roots == 0;
        }
        let Some(count) = self.layout.count(&self.nodes) else { return false };
        let roots = self.roots.count_ones() as usize;
        let counts = (6..=MAX_VERTICES).contains(&self.vertices.len()) && roots <= count;
        let is_shortest = counts && self.layout == Layout::new(self.vertices.len(), count);
        if !is_shortest || !(0.0..=MOST_SCALE).contains(&self.scale) {
            return false;
        }
        // Where the next node's children begin. Nothing ends within a level, which is faster than to look whether it should.
        let (mut next, mut are_sound) = (roots, true);
        let (mut level, mut range) = (0, 0..roots);
        while !range.is_empty() {
            if level > MAX_LEVEL || range.end > count {
                return false;
            }
            for node in range.clone().map(|index| self.node(index)) {
                are_sound &= node.is_childless() | (node.is_divided() & (node.base() == next));
                are_sound &= node.mids().iter().all(|&mid| usize::from(mid) < self.vertices.len());
                next += node.children();
            }
            (level, range) = (level + 1, range.end..next);
        }
        are_sound && next == count
    }
}

#[cfg(test)]
mod tests {
    use super::super::nodes::{Fields, Node};
    use super::*;
    use crate::haar::{Known, Refinement};
    use glam::Vec3;

    #[test]
    fn nodes_in_another_order_are_refused() {
        let axis = Vec3::new(0.3, -0.2, 0.9).normalize();
        let lobe = |d: Vec3| Vec3::splat(d.dot(axis).max(0.0).powi(60));
        let haar = Haar::project(&Refinement::default(), &Known::NOTHING, lobe).distribution;
        assert!(haar.all_nodes().count() > 50 && haar.is_sound(), "what was made is sound: {haar:?}");
        let fields = |node: Node| Fields { mask: node.mask(), mids: node.mids(), base: node.base() };
        let nodes: Vec<Fields> = haar.all_nodes().map(fields).collect();
        let (vertices, parent) = (haar.vertices.len(), nodes.iter().position(|node| node.mask != 0).expect("a tree"));
        let changed = |change: &dyn Fn(&mut Vec<Fields>)| {
            let mut nodes = nodes.clone();
            change(&mut nodes);
            let layout = Layout::new(vertices, nodes.len());
            Haar { layout, nodes: layout.pack(&nodes), ..haar.clone() }.is_sound()
        };
        assert!(changed(&|_| ()), "the same");
        assert!(!changed(&|nodes| nodes[parent].base += 1), "children further on");
        assert!(!changed(&|nodes| nodes[parent].base -= 1), "children of another");
        assert!(!changed(&|nodes| nodes[parent].mask ^= 1), "a child more or less");
        assert!(!changed(&|nodes| nodes[parent].mids[0] = vertices as u16), "a vertex that is none");
        assert!(!changed(&|nodes| nodes.truncate(nodes.len() - 1)), "the last one is missing");
        assert!(
            !changed(&|nodes| nodes.push(Fields { mask: 0, mids: [Node::NO_VERTEX; 3], base: 0 })),
            "one that nobody has"
        );
        let mut nodes = haar.nodes.to_vec();
        nodes.pop();
        assert!(!Haar { nodes: nodes.into(), ..haar.clone() }.is_sound(), "a part of a node");
        assert!(!Haar { layout: Layout::default(), ..haar.clone() }.is_sound(), "nodes of no length");
    }
}

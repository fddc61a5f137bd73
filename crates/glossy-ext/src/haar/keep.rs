//! Distributions as flat arrays, and from them again.

use super::{Haar, MAX_LEVEL, Node};
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
    roots: u32,
    vertices: u32,
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
            roots: haar.roots.into(),
            vertices: haar.vertices.len() as u32,
            nodes: haar.nodes.len() as u32,
        };
        out.put(&all.clone().map(head).collect::<Vec<_>>())?;
        out.put(&all.clone().flat_map(|haar| &*haar.vertices).copied().collect::<Vec<Half3>>())?;
        out.put(&all.flat_map(|haar| &*haar.nodes).copied().collect::<Vec<Node>>())
    }

    /// Reads what [`store`](Self::store) wrote.
    ///
    /// # Errors
    /// Where it is anything else.
    pub fn restore(from: &mut Reader<'_>) -> Result<Vec<Self>, FlatError> {
        let heads: Vec<Head> = from.take(WHAT)?;
        let vertices: Vec<Vec<Half3>> = from.take_groups(heads.iter().map(|head| head.vertices), WHAT)?;
        let nodes: Vec<Vec<Node>> = from.take_groups(heads.iter().map(|head| head.nodes), WHAT)?;
        let restored = heads.into_iter().zip(vertices).zip(nodes).map(|((head, vertices), nodes)| {
            let roots = head.roots.try_into().map_err(|_| FlatError::Misfit(WHAT))?;
            let haar = Self { scale: head.scale, roots, vertices: vertices.into(), nodes: nodes.into() };
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
        let roots = self.roots.count_ones() as usize;
        let counts = (6..Node::NO_VERTEX.into()).contains(&self.vertices.len()) && roots <= self.nodes.len();
        if !counts || !(0.0..=MOST_SCALE).contains(&self.scale) {
            return false;
        }
        let vertices = self.vertices.len() as u16;
        // Where the next node's children begin. Nothing ends within a level, which is faster than to look whether it should.
        let (mut next, mut are_sound) = (roots, true);
        let (mut level, mut range) = (0, 0..roots);
        while !range.is_empty() {
            if level > MAX_LEVEL || range.end > self.nodes.len() {
                return false;
            }
            for node in &self.nodes[range.clone()] {
                are_sound &= node.is_childless() | (node.is_divided() & (node.base() == next));
                // What is no vertex is made 0.
                are_sound &= node.mids().iter().fold(true, |all, m| all & ((m + 1) & Node::NO_VERTEX <= vertices));
                next += node.children();
            }
            (level, range) = (level + 1, range.end..next);
        }
        are_sound && next == self.nodes.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::haar::{Known, Refinement};
    use glam::Vec3;

    #[test]
    fn nodes_in_another_order_are_refused() {
        let axis = Vec3::new(0.3, -0.2, 0.9).normalize();
        let lobe = |d: Vec3| Vec3::splat(d.dot(axis).max(0.0).powi(60));
        let haar = Haar::project(&Refinement::default(), &Known::NOTHING, lobe).distribution;
        assert!(haar.nodes.len() > 50 && haar.is_sound(), "what was made is sound: {} nodes", haar.nodes.len());
        let changed = |change: &dyn Fn(&mut Vec<Node>)| {
            let mut nodes = haar.nodes.to_vec();
            change(&mut nodes);
            Haar { nodes: nodes.into(), ..haar.clone() }.is_sound()
        };
        let parent = haar.nodes.iter().position(|node| !node.is_childless()).expect("a tree");
        let [mids, base] = [0_u32, 45].map(|shift| 1_u64 << shift);
        assert!(!changed(&|nodes| nodes[parent].0 += base), "children further on");
        assert!(!changed(&|nodes| nodes[parent].0 -= base), "children of another");
        assert!(!changed(&|nodes| nodes[parent].0 ^= 1 << 60), "a child more or less");
        assert!(!changed(&|nodes| nodes[parent].0 |= 0x7ffe * mids), "a vertex that is none");
        assert!(!changed(&|nodes| nodes.truncate(haar.nodes.len() - 1)), "the last one is missing");
        assert!(!changed(&|nodes| nodes.push(Node::new([Node::NO_VERTEX; 3], 0, 0))), "one that nobody has");
    }
}

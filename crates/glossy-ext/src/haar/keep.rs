//! Distributions as flat arrays, and from them again.

use super::{Haar, MAX_LEVEL, Node};
use crate::basis::half::Half3;
use hr_diffuse::flat::{FlatError, Reader, Writer, fits};
use hr_diffuse::threads::prelude::*;
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
    pub fn store(all: &[Self], out: &mut Writer<'_>) -> io::Result<()> {
        let head = |haar: &Self| Head {
            scale: haar.scale,
            roots: haar.roots.into(),
            vertices: haar.vertices.len() as u32,
            nodes: haar.nodes.len() as u32,
        };
        out.put(&all.iter().map(head).collect::<Vec<_>>())?;
        out.put(&all.iter().flat_map(|haar| &*haar.vertices).copied().collect::<Vec<Half3>>())?;
        out.put(&all.iter().flat_map(|haar| &*haar.nodes).copied().collect::<Vec<Node>>())
    }

    /// Reads what [`store`](Self::store) wrote.
    ///
    /// # Errors
    /// Where it is anything else.
    pub fn restore(from: &mut Reader<'_>) -> Result<Vec<Self>, FlatError> {
        let heads: Vec<Head> = from.take(WHAT)?;
        let vertices: Vec<Vec<Half3>> = from.take_groups(heads.iter().map(|head| head.vertices), WHAT)?;
        let nodes: Vec<Vec<Node>> = from.take_groups(heads.iter().map(|head| head.nodes), WHAT)?;
        let parts: Vec<_> = heads.into_iter().zip(vertices).zip(nodes).collect();
        let restored = parts.into_par_iter().with_min_len(64).map(|((head, vertices), nodes)| {
            let roots = head.roots.try_into().map_err(|_| FlatError::Misfit(WHAT))?;
            let haar = Self { scale: head.scale, roots, vertices: vertices.into(), nodes: nodes.into() };
            fits(haar.is_sound(), WHAT).map(|()| haar)
        });
        restored.collect()
    }

    /// Whether every index is within what it points into, and nodes are a forest no deeper than it may be.
    fn is_sound(&self) -> bool {
        if self.vertices.is_empty() {
            return self.nodes.is_empty() && self.roots == 0;
        }
        let roots = self.roots.count_ones() as usize;
        let counts = (6..Node::NO_VERTEX.into()).contains(&self.vertices.len()) && roots <= self.nodes.len();
        if !counts || !(0.0..=MOST_SCALE).contains(&self.scale) {
            return false;
        }
        const UNMET: u8 = u8::MAX;
        let mut levels = vec![UNMET; self.nodes.len()];
        levels[..roots].fill(0);
        self.nodes.iter().enumerate().all(|(index, node)| {
            let level = levels[index];
            let mids = node.mids();
            let are_vertices = mids.iter().all(|&m| m == Node::NO_VERTEX || usize::from(m) < self.vertices.len());
            let mut follow = || {
                (0..4).filter_map(|child| node.child(child)).all(|child| {
                    let is_new = child > index && levels.get(child) == Some(&UNMET);
                    if is_new {
                        levels[child] = level + 1;
                    }
                    is_new
                })
            };
            level <= MAX_LEVEL && are_vertices && (node.is_childless() || node.is_divided() && follow())
        })
    }
}

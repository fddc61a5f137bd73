//! Links: who lights whom, through which form factor, how visibly. 16 bytes each, sorted by receiver.

use crate::threads;
use std::ops::Range;

/// Light passes from `sender` to `receiver`.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Link {
    /// Node that receives.
    pub receiver: u32,
    /// Node that sends.
    pub sender: u32,
    /// Unoccluded irradiance at the receiver per unit of what the sender emits toward it: a form factor for parts
    /// of surfaces; area · cosine/(π d²) for clusters; cosine/d² for lights without extent. On receivers that are
    /// not flat the cosine is left out (the plane perpendicular to the direction).
    pub factor: f32,
    /// Share of the sender that the receiver sees, 0…1; negative where it is proven to be 1.
    pub visibility: f32,
}

/// All links of a solution, sorted by receiver, then by sender.
#[derive(Clone, Debug, Default)]
pub struct Links {
    all: Vec<Link>,
    /// `first[node]..first[node + 1]` are the links that the node receives through.
    first: Vec<u32>,
}

impl Links {
    /// Sorts links by receiver.
    pub(crate) fn new(mut all: Vec<Link>, nodes: usize) -> Self {
        threads::sort_unstable_by_key(&mut all, |link| (u64::from(link.receiver) << 32) | u64::from(link.sender));
        let mut first = vec![0_u32; nodes + 1];
        for link in &all {
            first[link.receiver as usize + 1] += 1;
        }
        for i in 0..nodes {
            first[i + 1] += first[i];
        }
        Self { all, first }
    }

    /// There are more nodes now, none of which receives through a link.
    pub(crate) fn grow(&mut self, nodes: usize) {
        self.first.resize(nodes + 1, self.all.len() as u32);
    }

    /// All of them.
    #[must_use]
    pub fn all(&self) -> &[Link] {
        &self.all
    }

    /// Those that a node receives through.
    #[must_use]
    pub fn of(&self, receiver: u32) -> &[Link] {
        &self.all[self.range(receiver)]
    }

    /// Where in [`all`](Self::all) those are that a node receives through.
    pub(crate) fn range(&self, receiver: u32) -> Range<usize> {
        match self.first.get(receiver as usize..receiver as usize + 2) {
            Some(range) => range[0] as usize..range[1] as usize,
            None => 0..0,
        }
    }

    pub(crate) fn take(&mut self) -> Vec<Link> {
        self.first.clear();
        std::mem::take(&mut self.all)
    }
}

#[cfg(test)]
mod tests;

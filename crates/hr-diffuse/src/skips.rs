//! Work that is skipped: all that can be, always. Tests solve without, to prove that nothing is lost by it.

/// What is skipped; [`Skipped`](crate::stats::Skipped) tells how often. Dark senders are not among them: what is left out of
/// them can be linked afterwards, to see that it brings nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Skips {
    pub(crate) black_receivers: bool,
    /// Pairs that are proved not to face each other, …
    pub(crate) facing: bool,
    /// … and those that hardly do, by their normals or by samples.
    pub(crate) averted: bool,
    /// Rays where all segments are proved free, and links where all are proved blocked.
    pub(crate) proofs: bool,
    pub(crate) sealed_sides: bool,
    pub(crate) converged_leaves: bool,
    /// Links over which a sender sends the same directional light as before, or so many times as much.
    pub(crate) steady_senders: bool,
    /// A look from each leaf at links that bring next to nothing, or by chance at those that hardly let anything through.
    pub(crate) faint_links: bool,
    /// Values at vertices within places of many leaves.
    pub(crate) inner_vertices: bool,
    /// Directional light of each leaf of a cluster whose leaves reflect alike.
    pub(crate) face_clusters: bool,
    /// Directional detail that makes no difference to what links carry, or that is finer than what they bring to a leaf that is shown.
    pub(crate) negligible_detail: bool,
}

impl Skips {
    pub(crate) const ALL: Self = Self {
        black_receivers: true,
        facing: true,
        averted: true,
        proofs: true,
        sealed_sides: true,
        converged_leaves: true,
        steady_senders: true,
        faint_links: true,
        inner_vertices: true,
        face_clusters: true,
        negligible_detail: true,
    };
}

#[cfg(test)]
pub(crate) mod tests;

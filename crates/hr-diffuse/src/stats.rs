//! Counters of the work done and of the work avoided, and the time that each phase took.

use crate::budget::Spent;

/// Counts and seconds of a solve.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Stats {
    /// Surfaces handed in.
    pub polygons: u64,
    /// Nodes of the hierarchy.
    pub nodes: u64,
    /// Leaves that are parts of surfaces.
    pub leaves: u64,
    /// Links at the end.
    pub links: u64,
    /// Visibility rays shot in the solve.
    pub rays: u64,
    /// Rays shot to find out how much reflected light links should bring, and what the solution is off by.
    pub check_rays: u64,
    /// Visibility rays shot for what is shown: values at vertices, and leaves that look for what makes highlights on them.
    pub vertex_rays: u64,
    /// Pairs of elements that the oracle looked at.
    pub pairs: u64,
    /// Of the last edit of places: links that it concerned, which were made anew, …
    pub renewed_links: u64,
    /// … and those that stayed.
    pub kept_links: u64,
    /// Places that found out anew how light reaches them, as it comes from other parts of senders than it did.
    pub renewed_places: u64,
    /// Leaves whose directional light would not have died out, as more came back than they sent: what they send, or what arrives there, was
    /// cut down until it did.
    pub reined_leaves: u64,
    /// Iterations (gather, push, reflect, pull).
    pub iterations: u32,
    /// Links that light was sent over, each counted in every iteration that did so.
    pub links_evaluated: u64,
    /// Change of irradiance by each iteration, ≥ 0: relative to all there is, or on average over places to what there is in each; the
    /// larger one.
    pub residuals: Vec<f32>,
    /// Relative L1 error of the leaves' irradiance, weighted by what they reflect, that rays have found; `None` where they did not
    /// look: the solve was broken off.
    pub error: Option<f32>,
    /// The same with its sign: negative where light is missing.
    pub bias: f32,
    /// Whether it was told to stop before it was done: the solution is what there was by then.
    pub stopped: bool,
    /// The budget that was spent before the solution had the error asked for: it is a coarser one.
    pub spent: Option<Spent>,
    /// Bytes of elements, links and what the extension keeps of them, at the end of the solve.
    pub bytes: u64,
    /// What was skipped, and why.
    pub skipped: Skipped,
    /// Seconds by phase.
    pub seconds: Seconds,
}

/// Work avoided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Skipped {
    /// Pairs whose receiver reflects nothing.
    pub black_receivers: u64,
    /// Pairs whose sender emits nothing (looked at again once it does).
    pub unlit_senders: u64,
    /// Pairs that provably do not face each other.
    pub facing: u64,
    /// Links that need no ray: nothing lies between.
    pub proved_free: u64,
    /// Pairs that need no link: one surface hides all of the sender from all of the receiver.
    pub proved_blocked: u64,
    /// Sides of surfaces that no light can reach.
    pub sealed_sides: u64,
    /// Leaves whose incident light did not change enough to be reflected anew.
    pub converged_leaves: u64,
    /// Links whose senders were not asked for their directional light in an iteration, as it is what it was, or in proportion.
    pub steady_senders: u64,
    /// Links that bring so little that leaves do not look for themselves what they bring there.
    pub faint_links: u64,
    /// Looks from leaves at links that hardly let anything through, left to those that were drawn by chance.
    pub spared_looks: u64,
    /// Looks at senders of which rays saw nothing: what they would bring there is not found out.
    pub unseen_senders: u64,
    /// Vertices that gather nothing, as they lie within a place of many leaves that gathered for them.
    pub inner_vertices: u64,
    /// Vertices that gather nothing, as pictures do not show them.
    pub unseen_vertices: u64,
    /// Leaves whose directional light is not made for display, as pictures do not show it.
    pub unseen_leaves: u64,
    /// Leaves whose directional light is that of another one of their cluster.
    pub joined_leaves: u64,
    /// Links over which nothing was shot in an iteration, as their senders had next to no unshot light.
    pub shot_links: u64,
}

impl std::ops::AddAssign for Skipped {
    fn add_assign(&mut self, other: Self) {
        self.black_receivers += other.black_receivers;
        self.unlit_senders += other.unlit_senders;
        self.facing += other.facing;
        self.proved_free += other.proved_free;
        self.proved_blocked += other.proved_blocked;
        self.sealed_sides += other.sealed_sides;
        self.converged_leaves += other.converged_leaves;
        self.steady_senders += other.steady_senders;
        self.faint_links += other.faint_links;
        self.spared_looks += other.spared_looks;
        self.unseen_senders += other.unseen_senders;
        self.inner_vertices += other.inner_vertices;
        self.unseen_vertices += other.unseen_vertices;
        self.unseen_leaves += other.unseen_leaves;
        self.joined_leaves += other.joined_leaves;
        self.shot_links += other.shot_links;
    }
}

/// Seconds by phase.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Seconds {
    /// Hierarchy and ray tree.
    pub build: f64,
    /// Refinement of links, visibility included.
    pub refine: f64,
    /// The part of `refine` that was spent on visibility, estimated from the time of the threads that shot rays.
    pub visibility: f64,
    /// Gather, push and pull.
    pub transport: f64,
    /// Reflection and pull of an extension's light.
    pub reflect: f64,
    /// Rays that find out what the solution is off by.
    pub check: f64,
    /// Values at vertices.
    pub reconstruct: f64,
}

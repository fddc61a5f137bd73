//! Pictures, meshes, pages and the command: what is shown is the light of the solution.
//!
//! One program for all of them: the solver is compiled anew into each.

mod browser;
mod command;
mod edges;
mod facets;
mod gather;
mod highlights;
mod meshes;
mod pixels;
#[path = "../room/mod.rs"]
mod room;
mod snapshot;

//! The whole pipeline, from surfaces to the finished solution: analytic answers, invariances, determinism, stability.
//!
//! One program for all of it: the solver is compiled anew into each.

mod caustic;
mod determinism;
mod diffuse;
mod edits;
mod furnace;
mod hooks;
mod invariance;
mod moved;
mod scenes;
mod shooting;
mod stability;

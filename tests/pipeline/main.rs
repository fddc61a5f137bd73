//! The whole pipeline, from surfaces to the finished solution: analytic answers, invariances, determinism.

mod determinism;
mod diffuse;
mod edits;
mod furnace;
mod hooks;
mod invariance;
mod moved;
mod scenes;
mod shooting;

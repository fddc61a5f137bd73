//! The whole pipeline, from surfaces to the finished solution: analytic answers, invariances, determinism, bad input.

mod determinism;
mod diffuse;
mod furnace;
mod input;
mod invariance;
mod scenes;

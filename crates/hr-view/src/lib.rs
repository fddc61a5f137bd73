//! Walk through a glossy global illumination solution.
pub mod raycast;
pub mod solved;

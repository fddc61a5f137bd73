//! Rooms that are lit, edited, and gone on with.

mod fixtures;
mod rearrange;
mod relight;
mod resume;
mod shooting;

//! Scenes whose light is known, and rooms that are lit, edited, and gone on with.
//!
//! One program for all of them: the solver is compiled anew into each.

mod adaptation;
mod analytic;
mod balance;
mod budget;
mod contact_shadows;
mod contacts;
mod copies;
mod covered;
mod dark_rooms;
mod fixtures;
mod paths;
mod rearrange;
mod relight;
mod resume;
mod shading;
mod shadows;
mod shooting;
mod windows;

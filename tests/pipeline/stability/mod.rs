//! Whatever is handed in: the right answer or a typed error. Never a panic, a hang, NaN or negative light.
//!
//! `STABILITY_CASES=10000` makes the random tests run that many cases each.

mod answers;
mod cases;
mod crowds;
mod energy;
mod input;
mod placement;
mod random;
mod reflectors;
mod stopping;

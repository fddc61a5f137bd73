//! Surfaces that coincide exactly: the first one counts, the others are only names for it.
//!
//! Files hold them by mistake, sometimes by the thousand. None of them hides another, so together they would send and
//! receive that many times the light of one; and a ray would have to be tested against each.

use crate::geometry::{Domain, Geometry};
use std::collections::HashMap;

/// Of different surfaces in the same box, so many are compared with another one.
const MOST_COMPARED: usize = 8;

/// For each surface the first one of the same shape, side and material: itself where there is none before it.
pub(crate) fn twins(surfaces: &[Geometry], materials: &[u32]) -> Vec<u32> {
    let mut known: HashMap<([u32; 6], u32), Vec<u32>> = HashMap::new();
    let mut first: Vec<u32> = (0..surfaces.len() as u32).collect();
    for (surface, geometry) in surfaces.iter().enumerate() {
        let bounds = geometry.bounds(Domain::WHOLE);
        let [a, b, c] = bounds.min.to_array().map(f32::to_bits);
        let [d, e, f] = bounds.max.to_array().map(f32::to_bits);
        let others = known.entry(([a, b, c, d, e, f], materials[surface])).or_default();
        match others.iter().rev().take(MOST_COMPARED).find(|&&other| surfaces[other as usize] == *geometry) {
            Some(&twin) => first[surface] = twin,
            None => others.push(surface as u32),
        }
    }
    first
}

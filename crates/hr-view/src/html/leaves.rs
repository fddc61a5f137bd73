//! Which distributions are evaluated for which vertex.

use super::directions::{self, Shine};
use super::payload::Payload;
use super::vertices::{Lattice, packed_normal};
use crate::display::DisplayMesh;
use crate::facets::Source;
use crate::glossy;
use crate::solved::Solved;
use crate::window::lists::VertexList;
use glossy_ext::Focus;
use glossy_ext::haar::{Haar, Known, Refinement};
use hr_diffuse::NodeId;
use std::collections::HashMap;
use std::f32::consts::FRAC_1_PI;

/// At most so many distributions are evaluated for a vertex; the weakest are left out.
const MOST_SHARES: usize = 12;

/// Adds the leaves around the vertices of the glossy list, their weights, and their distributions, times `exposure`,
/// with middles on the lattice and foci.
/// `sources` belong to the mesh's glossy vertices.
pub(super) fn add(
    payload: &mut Payload,
    solved: &Solved,
    mesh: &DisplayMesh,
    sources: &[Source],
    list: &VertexList,
    lattice: &Lattice,
    exposure: f32,
) {
    let source_of: HashMap<u32, &Source> = std::iter::zip(mesh.glossy.iter().copied(), sources).collect();
    let mut index: HashMap<u32, u32> = HashMap::new();
    let mut leaves = Vec::new();
    let (mut counts, mut members, mut weights) = (Vec::new(), Vec::new(), Vec::new());
    for vertex in &list.vertices {
        let shares = source_of.get(vertex).map_or_else(Vec::new, |source| shares(solved, source));
        counts.push(shares.len() as u8);
        for (leaf, weight) in shares {
            members.push(*index.entry(leaf).or_insert_with(|| {
                leaves.push(NodeId(leaf));
                leaves.len() as u32 - 1
            }));
            weights.push(weight);
        }
    }
    let normals: Vec<u32> = list.vertices.iter().map(|&v| packed_normal(mesh.normals[v as usize])).collect();
    payload.words("glossy.normals", &normals);
    payload.bytes("glossy.counts", &counts);
    payload.steps("glossy.leaves", members);
    payload.bytes("glossy.weights", &weights);

    let solution = &solved.solution;
    let element = |leaf: NodeId| &solution.elements.nodes[leaf.index()];
    let axes: Vec<u32> = leaves.iter().map(|&leaf| packed_normal(element(leaf).normals.axis)).collect();
    payload.words("leaf.axes", &axes);
    // In the mesh's frame.
    let normalization = &solution.scene.normalization;
    let middle = |leaf: NodeId| (normalization.to_scene(element(leaf).center) - mesh.origin).as_vec3();
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        payload.steps(format!("leaf.{letter}"), leaves.iter().map(|&leaf| lattice.place(middle(leaf))[axis]));
    }
    let unit = normalization.scale() as f32;
    let foci = leaves.iter().map(|&leaf| Focus::new(solution.reflected[leaf.index()].focus.plane() * unit).to_bits());
    let (sides, heights): (Vec<u32>, Vec<u32>) =
        foci.map(|[x, y, z]| (u32::from(x) | u32::from(y) << 16, u32::from(z))).unzip();
    payload.words("leaf.focus.xy", &sides);
    payload.words("leaf.focus.z", &heights);
    // Light that is carried as diffuse light is the same in all directions, as radiance.
    let even: Vec<Option<Haar>> = leaves
        .iter()
        .map(|&leaf| {
            let light = solution.reflected[leaf.index()].is_empty().then(|| glossy::carried(solution, leaf))?;
            let settings = Refinement { min_level: 0, ..Refinement::default() };
            Some(Haar::project(&settings, &Known::NOTHING, |_| light).distribution)
        })
        .collect();
    let is_radiance = |(&leaf, even): (&NodeId, &Option<Haar>)| u8::from(element(leaf).is_flat() || even.is_some());
    let flat: Vec<u8> = std::iter::zip(&leaves, &even).map(is_radiance).collect();
    payload.bytes("leaf.flat", &flat);
    let shines: Vec<Shine<'_>> = std::iter::zip(&leaves, &even)
        .map(|(&leaf, even)| {
            let diffuse = solved.scene.materials[element(leaf).material as usize].reflector.diffuse();
            let beside = diffuse * solution.exitant.irradiance[leaf.index()] * FRAC_1_PI;
            Shine { haar: even.as_ref().unwrap_or(&solution.reflected[leaf.index()].distribution), beside }
        })
        .collect();
    directions::add(payload, &shines, exposure);
}

/// The leaves around a vertex, strongest first, each once, and their shares in 1/255 of the largest.
fn shares(solved: &Solved, source: &Source) -> Vec<(u32, u8)> {
    let mut shares: Vec<(u32, f32)> = Vec::new();
    for (leaf, weight) in glossy::shares(&solved.solution, &source.corners) {
        match shares.iter_mut().find(|(known, _)| *known == leaf) {
            Some((_, sum)) => *sum += weight,
            None => shares.push((leaf, weight)),
        }
    }
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares.truncate(MOST_SHARES);
    let largest = shares.first().map_or(0.0, |share| share.1);
    let scaled = shares.into_iter().map(|(leaf, weight)| (leaf, (weight / largest * 255.0).round() as u8));
    scaled.filter(|(_, weight)| *weight > 0).collect()
}

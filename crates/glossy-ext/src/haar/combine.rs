//! Sums and averages of distributions: pull (paper, section 3), and accumulation.

use super::mesh::{Mesh, Midpoint, NO_VERTEX};
use super::nodes::Node;
use super::project::Variation;
use super::{Haar, Refinement};
use crate::Rgb;
use crate::basis::triangle::{child_corners, midpoints};

impl Haar {
    /// The sum of two distributions on the union of their subdivisions.
    #[must_use]
    pub fn add(&self, other: &Self) -> Self {
        match (self.is_empty(), other.is_empty()) {
            (_, true) => self.clone(),
            (true, false) => other.clone(),
            _ => union([(1.0, self), (1.0, other)]).pack(),
        }
    }

    /// The weighted sum Σ wᵢ hᵢ of distributions, such as those of the children of an element weighted by their
    /// share of its area. It is made on the union of the subdivisions, then coarsened wherever all of its values
    /// over a triangle pass the refiner, keeping the energy. Many sharp distributions often average to a smooth one.
    /// `offset` as in [`Known`](super::Known). Distributions with a weight that is zero or not finite are left out.
    #[must_use]
    pub fn average(distributions: &[(f32, &Self)], settings: &Refinement, offset: Rgb) -> Self {
        let some = distributions.iter().copied().filter(|(w, h)| *w != 0.0 && w.is_finite() && !h.is_empty());
        if some.clone().next().is_none() {
            return Self::default();
        }
        coarsen(&union(some), settings, offset).pack()
    }
}

/// The weighted sum, exactly: where one is coarser than the union it is linear.
fn union<'a>(distributions: impl IntoIterator<Item = (f32, &'a Haar)>) -> Mesh {
    let mut mesh = Mesh::new(|_| Rgb::ZERO);
    let mut own = Vec::new();
    for (weight, haar) in distributions {
        for face in 0..8 {
            cover(&mut mesh, face, haar, haar.root(face as usize));
        }
        own.clear();
        own.resize(mesh.values.len(), Rgb::ZERO);
        for face in 0..8_usize {
            let values = Haar::face_vertices(face).map(|v| haar.vertex(v));
            deposit(&mesh, face as u32, haar, haar.root(face), values, &mut own);
        }
        let factor = weight * haar.scale;
        for (sum, value) in std::iter::zip(&mut mesh.values, &own) {
            *sum += factor * *value;
        }
    }
    mesh
}

/// Divides the mesh where the distribution is divided. What is there already is linear over what is divided now.
fn cover(mesh: &mut Mesh, tri: u32, haar: &Haar, node: Option<usize>) {
    let Some(node) = node.map(|n| haar.node(n)).filter(|n| n.is_divided()) else {
        return;
    };
    if mesh.divide(tri, &mut |m: &Midpoint| m.between) {
        let first = mesh.tris[tri as usize].children;
        for child in 0..4 {
            cover(mesh, first + child, haar, node.child(child as usize));
        }
    }
}

/// Writes the distribution's values (in units of its scale) at the mesh's vertices under a triangle.
fn deposit(mesh: &Mesh, tri: u32, haar: &Haar, node: Option<usize>, corners: [Rgb; 3], own: &mut [Rgb]) {
    let here = &mesh.tris[tri as usize];
    for (vertex, value) in std::iter::zip(here.corners, corners) {
        own[usize::from(vertex)] = value;
    }
    let node = node.map_or(Node::NONE, |n| haar.node(n));
    let mids = haar.mid_values(corners, node);
    if here.is_divided() {
        for child in 0..4 {
            let values = child_corners(corners, mids, child);
            deposit(mesh, here.children + child as u32, haar, node.child(child), values, own);
        }
    } else {
        for (vertex, value) in std::iter::zip(here.mids, mids).filter(|(v, _)| *v != NO_VERTEX) {
            own[usize::from(vertex)] = value;
        }
    }
}

/// What is under a triangle of the mesh.
#[derive(Clone, Copy)]
struct Summary {
    variation: Variation,
    mean: Rgb,
    center: Rgb,
}

fn summaries(mesh: &Mesh) -> Vec<Summary> {
    let zero = Summary { variation: Variation::default(), mean: Rgb::ZERO, center: Rgb::ZERO };
    let mut all = vec![zero; mesh.tris.len()];
    // Children come after their parents.
    for (index, tri) in mesh.tris.iter().enumerate().rev() {
        let (corners, mids) = (mesh.corner_values(tri), mesh.mid_values(tri));
        // How far the midpoints are from the chords of their edges.
        let bend = std::iter::zip(mids, midpoints(corners)).map(|(m, b)| (m - b).abs().max_element());
        let bend = bend.fold(0.0, f32::max);
        all[index] = if tri.is_divided() {
            let first = tri.children as usize;
            let parts = [0, 1, 2, 3].map(|i| all[first + i]);
            let variations = parts.map(|p| p.variation);
            Summary {
                variation: Variation {
                    low: variations.iter().fold(Rgb::MAX, |low, v| low.min(v.low)),
                    high: variations.iter().fold(Rgb::MIN, |high, v| high.max(v.high)),
                    // The interpolations of parent and child differ by no more than the midpoints do.
                    deviation: bend + variations.iter().fold(0.0, |most, v| v.deviation.max(most)),
                },
                mean: parts.iter().map(|p| p.mean).sum::<Rgb>() * 0.25,
                center: parts[3].center,
            }
        } else {
            let values = || corners.iter().chain(&mids).copied();
            let (low, high) = (values().fold(Rgb::MAX, Rgb::min), values().fold(Rgb::MIN, Rgb::max));
            Summary {
                variation: Variation { low, high, deviation: bend },
                mean: mesh.mean(tri),
                center: mids.iter().sum::<Rgb>() / 3.0,
            }
        };
    }
    all
}

/// A mesh that is divided only where the refiner asks for it.
fn coarsen(fine: &Mesh, settings: &Refinement, offset: Rgb) -> Mesh {
    let all = summaries(fine);
    let largest = fine.values.iter().map(|v| v.abs().max_element()).fold(0.0, f32::max);
    let mut octahedron = fine.values.iter();
    let mut mesh = Mesh::new(|_| octahedron.next().copied().unwrap_or_default());
    let mut index = 0;
    // Which triangle of the fine mesh each one is. All are there: both are balanced, so that what balance divides
    // in the coarse mesh it has divided in the fine one.
    let mut same: Vec<u32> = (0..8).collect();
    while index < mesh.tris.len() {
        let tri = mesh.tris[index];
        let (there, what) = (fine.tris[same[index] as usize], all[same[index] as usize]);
        let wanted = tri.level < settings.max_level()
            && (tri.level < settings.min_level()
                || settings.is_rough(&what.variation, what.center + offset, largest, 1.0));
        if !tri.is_divided() && there.is_divided() && wanted {
            mesh.divide(index as u32, &mut |m: &Midpoint| {
                let mids = fine.tris[same[m.tri as usize] as usize].mids;
                fine.values[usize::from(mids[m.edge])]
            });
            for new in &mesh.tris[same.len()..] {
                same.push(fine.tris[same[new.parent as usize] as usize].children + u32::from(new.place));
            }
        }
        index += 1;
    }
    let means: Vec<Option<Rgb>> = same.iter().map(|&t| Some(all[t as usize].mean)).collect();
    mesh.preserve_means(&means, |_| false);
    mesh
}

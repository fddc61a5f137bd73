//! Face clusters: leaves whose directional light is that of one of them.
//!
//! Meshes are cut finely to be round, more finely than their light asks for: links end at clusters far above the polygons. (Face
//! clusters as elements: A. Willmott, P. Heckbert, M. Garland, *Face Cluster Radiosity*, Eurographics Workshop on
//! Rendering 1999.) All leaves below such a cluster receive the same light, and where they have the same material and nearly
//! the same normal they reflect it to nearly the same directions. So one of them is reflected, in place of all. How a mirror image
//! moves over the cluster, and turns with the normal, is found out where the light is asked for.

use crate::hierarchy::{Element, Elements};
use crate::hooks::LightField;
use crate::links::Links;
use crate::vertices::Vertices;
use glam::Vec3;
use smallvec::SmallVec;

/// Normals of a face cluster differ from their axis by at most so many widths of its material's lobe: what one leaf's light misses, as
/// it does not see quite what others mirror, is as blurred as the lobe is wide. …
const TURN: f32 = 1.5;
/// … By so much (radians) they may differ however narrow it is, …
const NORMALS: f32 = 0.1;
/// … and by no more than this: other horizons see other things.
const MOST_TURN: f32 = 0.2;

/// How far (radians) normals of a face cluster of a material may differ from their axis.
pub(crate) fn most_turn<L: LightField>(field: &L, material: u32) -> f32 {
    field.lobe_width(material).map_or(NORMALS, |width| (TURN * width).clamp(NORMALS, MOST_TURN))
}

/// Vertices take the light of face clusters whose middles are nearer than so many times their radius.
const REACH: f32 = 3.0;

/// Which leaf's directional light stands for that of which leaves.
#[derive(Clone, Debug, Default)]
pub struct FaceClusters {
    /// By node: the leaf that stands for it, and the cluster that it is in, itself where it is in none. Empty: there are no clusters.
    by_node: Vec<(u32, u32)>,
    /// By vertex: where the leaves are, in `around`, whose light it takes in the place of that of the leaves around it; with their shares.
    first_around: Vec<u32>,
    around: Vec<(u32, f32)>,
}

impl FaceClusters {
    /// The largest clusters that links, and normals for how wide lobes are, allow.
    pub(crate) fn new<L: LightField>(elements: &Elements, links: &Links, field: &L) -> Self {
        let nodes = &elements.nodes;
        let mut clusters = Self::default();
        if !nodes[0].active {
            return clusters;
        }
        let most_turn = |material: u32| most_turn(field, material);
        // By node: the material of all that is below it, where it can be a face cluster; else none.
        let mut materials: Vec<Option<u32>> = vec![None; nodes.len()];
        for node in (0..nodes.len()).rev() {
            materials[node] = common_material(elements, links, &materials, &most_turn, node as u32);
        }
        clusters.by_node = (0..nodes.len() as u32).map(|node| (node, node)).collect();
        let mut taken = vec![false; nodes.len()];
        for node in 1..nodes.len() as u32 {
            let element = &nodes[node as usize];
            if taken[element.parent as usize] {
                taken[node as usize] = true;
                clusters.by_node[node as usize] = clusters.by_node[element.parent as usize];
            } else if element.child_count > 0 && materials[node as usize].is_some() {
                taken[node as usize] = true;
                clusters.by_node[node as usize] = (middle(nodes, node), node);
            }
        }
        clusters
    }

    /// Finds out which clusters vertices take their light from: those around them and their neighbours, so that light is smooth
    /// where clusters meet, as it is where leaves do.
    pub(crate) fn with_vertices(mut self, elements: &Elements, vertices: &Vertices) -> Self {
        let count = vertices.positions.len() as u32;
        if self.joined(elements) == 0 {
            return self;
        }
        let around = |vertex: u32| {
            let mut clusters: SmallVec<[u32; 8]> =
                vertices.leaves_around(vertex).iter().map(|&leaf| self.cluster(leaf)).collect();
            clusters.sort_unstable();
            clusters.dedup();
            let is_cluster = |&node: &u32| !elements.is_patch_leaf(node);
            Some(clusters).filter(|clusters| clusters.iter().any(is_cluster))
        };
        let mut neighbours: Vec<(u32, u32)> = Vec::new();
        for clusters in (0..count).filter_map(around) {
            let others =
                |&one: &u32| clusters.iter().filter(move |&&other| other != one).map(move |&other| (one, other));
            neighbours.extend(clusters.iter().flat_map(others));
        }
        neighbours.sort_unstable();
        neighbours.dedup();
        let (mut first_around, mut shares) = (vec![0], Vec::new());
        for vertex in 0..count {
            if let Some(mut near) = around(vertex) {
                for one in near.clone() {
                    let first = neighbours.partition_point(|pair| pair.0 < one);
                    near.extend(neighbours[first..].iter().take_while(|pair| pair.0 == one).map(|pair| pair.1));
                }
                near.sort_unstable();
                near.dedup();
                let at = vertices.positions[vertex as usize];
                let weights: SmallVec<[(u32, f32); 16]> = near
                    .into_iter()
                    .map(|cluster| {
                        let (element, leaf) = (&elements.nodes[cluster as usize], self.standing(cluster));
                        let off = element.center.distance(at) / (REACH * element.radius).max(f32::MIN_POSITIVE);
                        (leaf, (1.0 - off).max(0.0).powi(2) * elements.exposed(leaf))
                    })
                    .filter(|&(_, weight)| weight > 0.0)
                    .collect();
                let all: f32 = weights.iter().map(|(_, weight)| weight).sum();
                shares.extend(weights.into_iter().map(|(leaf, weight)| (leaf, weight / all)));
            }
            first_around.push(shares.len() as u32);
        }
        (self.first_around, self.around) = (first_around, shares);
        self
    }

    /// The leaf whose directional light stands for that of a leaf: mostly its own.
    #[must_use]
    pub fn standing(&self, leaf: u32) -> u32 {
        self.by_node.get(leaf as usize).map_or(leaf, |&(standing, _)| standing)
    }

    /// The leaves whose directional light a vertex takes, with shares that sum to 1; none where it takes that of the leaves
    /// around it.
    #[must_use]
    pub fn around(&self, vertex: u32) -> &[(u32, f32)] {
        match self.first_around.get(vertex as usize..vertex as usize + 2) {
            Some(range) => &self.around[range[0] as usize..range[1] as usize],
            None => &[],
        }
    }

    fn cluster(&self, leaf: u32) -> u32 {
        self.by_node.get(leaf as usize).map_or(leaf, |&(_, cluster)| cluster)
    }

    /// Angle (radians) within which the normals are for which a leaf stands in its cluster; 0 for one that stands for itself.
    pub(crate) fn spread(&self, elements: &Elements, leaf: u32) -> f32 {
        let cluster = self.cluster(leaf);
        if cluster == leaf { 0.0 } else { elements.nodes[cluster as usize].normals.angle() }
    }

    /// Leaves that need no directional light of their own.
    pub(crate) fn joined(&self, elements: &Elements) -> u64 {
        let leaves = elements.patch_leaves().filter(|&leaf| self.standing(leaf) != leaf);
        if self.by_node.is_empty() { 0 } else { leaves.count() as u64 }
    }
}

/// The material of all leaves below a node, if they may be a face cluster.
fn common_material(
    elements: &Elements,
    links: &Links,
    materials: &[Option<u32>],
    most_turn: &dyn Fn(u32) -> f32,
    node: u32,
) -> Option<u32> {
    let element = &elements.nodes[node as usize];
    if element.child_count == 0 {
        let is_plain = element.active && element.is_patch() && element.is_flat() && elements.exposed(node) >= 1.0;
        return is_plain.then_some(element.material);
    }
    let mut children = element.first_child..element.first_child + element.child_count;
    let first = materials[element.first_child as usize]?;
    if element.normals.angle() > most_turn(first) {
        return None;
    }
    let is_like = |child: u32| materials[child as usize] == Some(first) && links.range(child).is_empty();
    children.all(is_like).then_some(first)
}

/// The leaf next to the middle of a node, which sees what most of it sees.
fn middle(nodes: &[Element], node: u32) -> u32 {
    let whole = &nodes[node as usize];
    let off = |element: &Element| {
        let place =
            (element.center - whole.center).length_squared() / (whole.radius * whole.radius).max(f32::MIN_POSITIVE);
        let turn: Vec3 = element.normals.axis - whole.normals.axis;
        place + turn.length_squared() / (NORMALS * NORMALS)
    };
    let (mut best, mut least, mut open) = (node, f32::INFINITY, vec![node]);
    while let Some(node) = open.pop() {
        let element = &nodes[node as usize];
        if element.child_count > 0 {
            open.extend(element.first_child..element.first_child + element.child_count);
        } else if off(element) < least {
            (best, least) = (node, off(element));
        }
    }
    best
}

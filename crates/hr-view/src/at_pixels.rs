//! Illumination samples and reflectors as flat arrays, for a device that reflects them at each pixel.
//!
//! A leaf is lit by its own samples and those of all nodes above it (paper, section 3.2). They stay where they are: a
//! receiver names the next one above it, so that what lights many leaves is there once. Each sample comes with all that
//! its direction, extent and irradiance are renewed from at a point ([`glossy_ext::arriving`]).

use crate::facets::NO_LEAF;
use crate::glossy::NARROWEST;
use crate::solved::Solved;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3, Vec4};
use glossy_ext::{Formula, IlluminationSample, Reflector, Rgb};
use hr_diffuse::facing::Facing;
use hr_diffuse::hooks::Sides;
use hr_diffuse::{Hierarchy, NodeId, Solution};
use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, TAU};

/// What tells whether a lobe is narrow: its width toward this direction.
const ASLANT: Vec3 = Vec3::new(0.6, 0.0, 0.8);

/// Lobes narrower than this (standard deviation in radians, about 8°) show more than samples tell: one of a link stands for too much
/// of what is to be seen in them.
const NARROW: f32 = 0.14;
/// In narrow lobes one sees that senders without a known outline, which lie side by side, count as disks. So much wider they
/// close the gaps between them: where they are equal each direction is in two of them on average.
const OVERLAP: f32 = 1.5;

/// Flag of [`Leaf::material`]: the base colour is that of vertices and texture.
pub const VARIES: u32 = 1 << 31;
/// Flags of [`Arrival::kind`]: a sender at infinity; irradiance on the receiver's own plane.
pub const DISTANT: u32 = 1;
/// See [`DISTANT`].
pub const ORIENTED: u32 = 2;
/// Flag of [`Arrival::kind`]: a sender that shines, whose outline is seen in what mirrors it.
pub const SHINES: u32 = 4;

/// A leaf (12 bytes).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Leaf {
    /// Its first run of samples.
    pub first: u32,
    /// How many runs there are: one for each node on the way up from it where any were left.
    pub count: u32,
    /// Where its material is among [`AtPixels::reflectors`], and whether it [`VARIES`].
    pub material: u32,
}

/// The samples that were left at a node (8 bytes).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Run {
    /// The first of them.
    pub first: u32,
    /// One after the last.
    pub end: u32,
}

/// An illumination sample with its sender and the place where it was received (112 bytes). Lengths are in scene units.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Arrival {
    /// The sender's middle relative to the mesh's origin; the direction toward it where it is [`DISTANT`].
    pub center: [f32; 3],
    /// [`DISTANT`], [`ORIENTED`], [`SHINES`].
    pub kind: u32,
    /// Radius of a ball that holds the sender.
    pub radius: f32,
    /// Its area / π.
    pub area: f32,
    /// Squared distance from the receiver's middle + `radius`².
    pub spread: f32,
    /// Cosine at the receiver's middle.
    pub cosine: f32,
    /// Irradiance at the receiver's middle, W/m².
    pub irradiance: [f32; 3],
    /// Moments of the sender's normals ([`hr_diffuse::facing::Facing`]): mean, squares, mixed products.
    pub facing: [f32; 9],
    /// Half of the mean width of a sender that is a polygon ([`hr_diffuse::hooks::Sides`]); 0 where it is none …
    pub across: [f32; 3],
    /// … how much it tapers …
    pub taper: f32,
    /// … and half of its height.
    pub along: [f32; 3],
    /// Makes the size one of a device's vectors.
    pub unused: f32,
}

/// Some leaves with all that lights them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Triangles of the mesh, in its order, and their places among `leaves`.
    pub triangles: Vec<(u32, u32)>,
    /// The leaves.
    pub leaves: Vec<Leaf>,
    /// Their runs of samples.
    pub runs: Vec<Run>,
    /// The samples, each once.
    pub arrivals: Vec<Arrival>,
}

impl Part {
    /// Bytes of the largest of its arrays.
    fn bytes(&self) -> u64 {
        let (leaves, runs) = (size_of_val(self.leaves.as_slice()), size_of_val(self.runs.as_slice()));
        leaves.max(runs).max(size_of_val(self.arrivals.as_slice())) as u64
    }
}

/// Glossy light that is to be computed at pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AtPixels {
    /// Leaves whose arrays fit a device together.
    pub parts: Vec<Part>,
    /// Materials, each a head of two, three for each of its lobes, and tables of losses.
    ///
    /// The head has the number of lobes, the least extent of senders, whether there is a grain, what extents of senders that
    /// do not shine are multiplied by, and the grain. A lobe has its kind (0 Phong, 1 Ward, 2 metallic-roughness, 3
    /// compensated) and roughness or exponent, its colour and how metallic it is, and the stretch of its slopes or the mean
    /// of its losses and where their table is.
    pub reflectors: Vec<[f32; 4]>,
    /// Which kinds of lobes they have: bit k for those of kind k.
    pub kinds: u32,
    /// Base colours at the mesh's vertices, to be multiplied by the texture's; where a colour does not vary it is not looked at.
    pub colors: Vec<Rgb>,
    /// Names of the materials whose light stays at vertices: mirrors, and those that are no formula.
    pub left: Vec<String>,
}

impl AtPixels {
    /// For a solution whose mesh is relative to `origin` and has triangles of these leaves; no array of a part is larger
    /// than `most` bytes. A leaf that alone is too much stays at vertices.
    #[must_use]
    pub fn new(solved: &Solved, origin: DVec3, leaves: &[u32], colors: Vec<Rgb>, most: u64) -> Self {
        let mut reflectors = Reflectors::default();
        let mut left = Vec::new();
        let used = used_materials(solved, leaves);
        let places: Vec<Option<u32>> = (solved.scene.materials.iter().zip(used))
            .map(|(material, is_used)| {
                let reflector = material.reflector.as_ref();
                if !is_used || reflector.is_diffuse() {
                    return None;
                }
                let place = reflectors.add(reflector);
                if place.is_none() {
                    left.push(material.name.clone());
                }
                place
            })
            .collect();
        let material_of = |leaf: u32| {
            let element = &solved.solution.elements.nodes[leaf as usize];
            let place = places[element.material as usize].filter(|_| element.active)?;
            Some(place | if solved.scene.attributes_of(element.source).is_some() { VARIES } else { 0 })
        };
        let triangles: Vec<(u32, u32)> = (0..)
            .zip(leaves)
            .filter(|&(_, &leaf)| leaf != NO_LEAF && material_of(leaf).is_some())
            .map(|(triangle, &leaf)| (triangle, leaf))
            .collect();
        let mut parts = Vec::new();
        divided(&triangles, most, &mut parts, &|triangles| Builder::new(solved, origin).part(triangles, &material_of));
        Self { parts, reflectors: reflectors.numbers, kinds: reflectors.kinds, colors, left }
    }
}

/// Which materials the leaves of triangles have.
fn used_materials(solved: &Solved, leaves: &[u32]) -> Vec<bool> {
    let mut used = vec![false; solved.scene.materials.len()];
    for &leaf in leaves.iter().filter(|&&leaf| leaf != NO_LEAF) {
        used[solved.solution.elements.nodes[leaf as usize].material as usize] = true;
    }
    used
}

/// Parts of a size that are made of triangles: all of them, or of halves.
fn divided(triangles: &[(u32, u32)], most: u64, out: &mut Vec<Part>, make: &impl Fn(&[(u32, u32)]) -> Part) {
    if triangles.is_empty() {
        return;
    }
    let part = make(triangles);
    if part.bytes() <= most {
        out.push(part);
    } else if triangles.len() > 1 {
        let (first, second) = triangles.split_at(triangles.len() / 2);
        divided(first, most, out, make);
        divided(second, most, out, make);
    }
}

/// Makes the arrays of one part.
struct Builder<'a> {
    solved: &'a Solved,
    origin: DVec3,
    part: Part,
    /// Place of each leaf, and run of each node with samples, that were met.
    leaves: HashMap<u32, u32>,
    runs: HashMap<u32, Run>,
}

impl<'a> Builder<'a> {
    fn new(solved: &'a Solved, origin: DVec3) -> Self {
        Self { solved, origin, part: Part::default(), leaves: HashMap::new(), runs: HashMap::new() }
    }

    fn part(mut self, triangles: &[(u32, u32)], material_of: &impl Fn(u32) -> Option<u32>) -> Part {
        for &(triangle, leaf) in triangles {
            let known = self.leaves.get(&leaf).copied();
            let place = known.unwrap_or_else(|| self.leaf(leaf, material_of(leaf).unwrap_or(0)));
            self.part.triangles.push((triangle, place));
        }
        self.part
    }

    fn leaf(&mut self, leaf: u32, material: u32) -> u32 {
        let solution = &self.solved.solution;
        let first = self.part.runs.len() as u32;
        let mut next = Some(NodeId(leaf));
        while let Some(node) = next {
            if !solution.incident[node.index()].is_empty() {
                let run = self.run(node);
                self.part.runs.push(run);
            }
            next = solution.elements.parent(node);
        }
        let place = self.part.leaves.len() as u32;
        self.part.leaves.push(Leaf { first, count: self.part.runs.len() as u32 - first, material });
        self.leaves.insert(leaf, place);
        place
    }

    fn run(&mut self, node: NodeId) -> Run {
        let Self { solved, origin, part, .. } = self;
        *self.runs.entry(node.0).or_insert_with(|| {
            let first = part.arrivals.len() as u32;
            let samples = &solved.solution.incident[node.index()];
            part.arrivals.extend(samples.iter().map(|sample| arrival(solved, *origin, node, sample)));
            Run { first, end: part.arrivals.len() as u32 }
        })
    }
}

/// A sample that was left at a receiver.
fn arrival(solved: &Solved, origin: DVec3, receiver: NodeId, sample: &IlluminationSample) -> Arrival {
    let Solution { elements, scene, .. } = &solved.solution;
    let sender = sample.sender();
    let element = &elements.nodes[sender.index()];
    let (at, normal) = (elements.center(receiver), elements.normals(receiver).axis);
    let (direction, _) = elements.direction_to(sender, at);
    let is_distant = elements.is_distant(sender);
    let unit = scene.normalization.scale().recip() as f32;
    let radius = element.radius * unit;
    let distance = element.center.distance(at) * unit;
    let center = if is_distant { direction } else { (scene.normalization.to_scene(element.center) - origin).as_vec3() };
    let shines = element.is_patch() && solved.scene.materials[element.material as usize].exitance != Rgb::ZERO;
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    let Facing { mean, diagonal, mixed } = element.facing;
    let sides = solved.solution.light().sides(sender);
    let Sides { across, along, taper } = sides.unwrap_or(Sides { across: Vec3::ZERO, along: Vec3::ZERO, taper: 0.0 });
    Arrival {
        center: center.to_array(),
        kind: flag(is_distant, DISTANT) | flag(sample.is_oriented(), ORIENTED) | flag(shines, SHINES),
        radius,
        area: element.area * unit * unit * FRAC_1_PI,
        spread: distance * distance + radius * radius,
        cosine: direction.dot(normal),
        irradiance: sample.irradiance().to_array(),
        facing: bytemuck::cast([mean, diagonal, mixed]),
        across: (across * unit).to_array(),
        taper,
        along: (along * unit).to_array(),
        unused: 0.0,
    }
}

/// Reflectors as the shader reads them.
#[derive(Default)]
struct Reflectors {
    numbers: Vec<[f32; 4]>,
    kinds: u32,
}

impl Reflectors {
    /// Adds a reflector, in the form of [`AtPixels::reflectors`]. Where it begins; `None` where it is no formula, or a mirror,
    /// which samples cannot show.
    fn add(&mut self, reflector: &dyn Reflector) -> Option<u32> {
        let lobes = reflector.formulas().filter(|_| reflector.mirror() == Rgb::ZERO)?;
        let begin = self.numbers.len();
        let is_narrow = reflector.lobe(ASLANT).width < NARROW;
        let grain = reflector.grain();
        let (narrowest, overlap) = if is_narrow { (NARROWEST, OVERLAP) } else { (0.0, 1.0) };
        self.numbers.push([lobes.len() as f32, narrowest, if grain.is_some() { 1.0 } else { 0.0 }, overlap]);
        self.numbers.push(Vec4::from((grain.unwrap_or(Vec3::ZERO), 0.0)).to_array());
        let mut table = begin + 2 + 3 * lobes.len();
        let mut tables = Vec::new();
        for lobe in lobes {
            let (kind, shape, color, metallic, last) = match lobe {
                Formula::Phong { ks, n } => (0.0, n, ks * ((n + 2.0) / TAU), 0.0, [0.0; 4]),
                Formula::Ward { rs, alpha, stretch } => {
                    (1.0, alpha, rs * (FRAC_1_PI / (alpha * alpha)), 0.0, [stretch.x, stretch.y, 0.0, 0.0])
                }
                Formula::MetallicRoughness { base, metallic, alpha } => (2.0, alpha, base, metallic, [0.0; 4]),
                Formula::Compensated { base, metallic, alpha, losses, mean } => {
                    tables.extend(losses.iter().map(|loss| [loss.x, loss.y, 0.0, 0.0]));
                    let last = [mean.x, mean.y, table as f32, 0.0];
                    table += losses.len();
                    (3.0, alpha, base, metallic, last)
                }
                _ => {
                    self.numbers.truncate(begin);
                    return None;
                }
            };
            self.kinds |= 1 << kind as u32;
            self.numbers.extend([[kind, shape, 0.0, 0.0], Vec4::from((color, metallic)).to_array(), last]);
        }
        self.numbers.append(&mut tables);
        Some(begin as u32)
    }
}

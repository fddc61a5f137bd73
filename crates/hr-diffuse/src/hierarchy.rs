//! The element hierarchy: flat arrays indexed by a node id; children are contiguous and come after their parent,
//! so that push is one forward sweep and pull one backward sweep.
//!
//! From the root down: clusters (an obvhs tree, widened), then one element per surface and reflecting side, then
//! the parts that refinement makes of it. A two-sided surface has two incident fields, so its front and its back
//! are two elements. Lights without extent are leaves that only send.

use crate::exposed::is_touched;
use crate::geometry::{Domain, FACETS, Facet, Geometry};
use crate::hooks::{FLAT_COSINE, Hierarchy, NodeId};
use crate::moved::Moved;
use crate::rooms::{self, NO_ROOM, Rooms};
use crate::scene::{Light, LightKind};
use crate::sealed::{Side, is_back, lit_sides};
use crate::skips::Skips;
use crate::standing_lines;
use crate::threads;
use crate::tree::{Leaves, tree};
use crate::visibility::Visibility;
use crate::{Cone, DiffuseMaterial, Facing, Rgb, SurfaceReflectance};
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// Children per cluster: the binary tree is widened to it.
const FAN_OUT: usize = 4;

/// What a node stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::NoUninit, bytemuck::CheckedBitPattern)]
#[repr(u8)]
pub enum Kind {
    /// Several surfaces.
    Cluster,
    /// Part of a surface, its front.
    Front,
    /// Part of a surface, its back.
    Back,
    /// A light without extent.
    Light,
}

/// One node: its geometry in unit space, and its place in the tree.
#[derive(Clone, Copy, Debug, bytemuck::NoUninit, bytemuck::CheckedBitPattern)]
#[repr(C)]
pub struct Element {
    /// What it stands for.
    pub kind: Kind,
    /// Whether an extension takes part here or below.
    pub active: bool,
    /// Whether it is a whole sphere seen from outside.
    pub whole_sphere: bool,
    /// Whether no two points of the node's side of its surface see each other.
    pub convex: bool,
    /// Corners of a box that holds it.
    pub bounds: [Vec3; 2],
    /// Middle (on the surface, for parts of one).
    pub center: Vec3,
    /// Radius about `center` that holds the node.
    pub radius: f32,
    /// Directions of its normals.
    pub normals: Cone,
    /// How its normals are distributed. Distant lights have the direction here in which their light travels.
    pub facing: Facing,
    /// Surface area.
    pub area: f32,
    /// Parent id; its own id for the root.
    pub parent: u32,
    /// Id of the first child.
    pub first_child: u32,
    /// Number of children.
    pub child_count: u32,
    /// Index of the surface or light; `u32::MAX` for clusters.
    pub source: u32,
    /// Index of the material; `u32::MAX` for clusters and lights.
    pub material: u32,
    /// The part of the surface.
    pub domain: Domain,
    /// Mean diffuse reflectance (area-weighted below clusters).
    pub reflectance: Rgb,
    /// Largest channel of what the node can reflect or what an extension makes of it; 0: light that arrives here
    /// is of no consequence.
    pub importance: f32,
    /// Index into [`Elements::facets`] of parts of curved surfaces that are no whole spheres; else `u32::MAX`.
    pub facets: u32,
    /// The [room](crate::rooms) that all of the node is in, [`ROOMS`](crate::rooms::ROOMS) or [`NO_ROOM`].
    pub(crate) room: u32,
}

impl Element {
    /// Whether all of the node lies in one plane, so that irradiance has one cosine.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        self.normals.cos_angle > FLAT_COSINE && self.kind != Kind::Cluster
    }

    /// Whether it is a whole sphere seen from outside: the same from everywhere.
    #[must_use]
    pub fn is_whole_sphere(&self) -> bool {
        self.whole_sphere
    }

    /// Whether it is part of a surface.
    #[must_use]
    pub fn is_patch(&self) -> bool {
        matches!(self.kind, Kind::Front | Kind::Back)
    }

    /// Mean of max(0, n·ω) over the node's surface: see [`Facing::mean_cosine`].
    #[must_use]
    pub fn mean_cosine(&self, direction: Vec3) -> f32 {
        self.facing.mean_cosine(direction)
    }
}

/// The static part of a scene in unit space, shared by solver and display.
#[derive(Clone, Debug)]
pub struct SceneData {
    /// Material of each surface.
    pub surface_materials: Vec<u32>,
    /// For each surface the first one that coincides with it: itself, mostly. The others have no elements of their own.
    pub twins: Vec<u32>,
    /// Shading normals of the surfaces that have any.
    pub shading_normals: Vec<Option<[Vec3; 4]>>,
    /// Diffuse materials.
    pub materials: Vec<DiffuseMaterial>,
    /// Lights without extent, positions in unit space, intensities scaled to it.
    pub lights: Vec<Light>,
    /// Positions of the lights in unit space.
    pub light_positions: Vec<Vec3>,
    /// Rays.
    pub visibility: Visibility,
    /// Reflectance that varies over surfaces.
    pub texture: Option<Arc<dyn SurfaceReflectance>>,
    /// Into and out of unit space.
    pub normalization: crate::geometry::Normalization,
}

impl SceneData {
    /// Surfaces in unit space.
    #[must_use]
    pub fn surfaces(&self) -> &[Geometry] {
        self.visibility.geometries()
    }

    /// Whether a surface coincides with one before it, which counts in its place.
    pub(crate) fn is_twin(&self, surface: u32) -> bool {
        self.twins[surface as usize] != surface
    }

    /// Unit shading normal on the front side: interpolated where the surface has shading normals.
    #[must_use]
    pub fn shading_normal(&self, surface: u32, uv: Vec2) -> Vec3 {
        let geometry = &self.surfaces()[surface as usize];
        match &self.shading_normals[surface as usize] {
            None => geometry.normal(uv),
            Some(n) => {
                let w = geometry.corner_weights(uv);
                let normal = n[0] * w[0] + n[1] * w[1] + n[2] * w[2] + n[3] * w[3];
                normal.try_normalize().unwrap_or_else(|| geometry.normal(uv))
            }
        }
    }

    /// Mean diffuse reflectance of a part of a surface, of what shading normals let in.
    #[must_use]
    pub fn reflectance(&self, surface: u32, domain: &Domain) -> Rgb {
        let textured = self.texture.as_ref().and_then(|texture| {
            let corners = self.surfaces()[surface as usize].corners(*domain);
            texture.mean(surface, &corners)
        });
        let own = textured.unwrap_or(self.materials[self.surface_materials[surface as usize] as usize].reflectance);
        own * self.let_in(surface, domain)
    }

    /// Share of the light that arrives at a part of a surface from everywhere alike which its shading normals let in: (1 + cos θ)/2 where
    /// they lean by θ, as what is below either horizon brings nothing. It hardly differs from 1 where normals stand for a
    /// round surface; of a box whose faces share their corners' normals it is 0.79 in a corner.
    pub(crate) fn let_in(&self, surface: u32, domain: &Domain) -> f32 {
        if self.shading_normals[surface as usize].is_none() {
            return 1.0;
        }
        let geometry = &self.surfaces()[surface as usize];
        let (corners, middle) = (geometry.corners(*domain), geometry.middle(*domain));
        let at = |uv: Vec2| 0.5 + 0.5 * self.shading_normal(surface, uv).dot(geometry.normal(uv));
        let fan = |(i, &a): (usize, &Vec2)| {
            let ends = [middle, a, corners[(i + 1) % corners.len()]];
            let third = ends.iter().sum::<Vec2>() / 3.0;
            ends.map(|end| at(third.midpoint(end))).iter().sum::<f32>() / 3.0
        };
        corners.iter().enumerate().map(fan).sum::<f32>() / corners.len().max(1) as f32
    }
}

/// The element hierarchy of a scene.
#[derive(Clone, Debug)]
pub struct Elements {
    /// The nodes.
    pub nodes: Vec<Element>,
    /// The element of each surface's front and back; `u32::MAX` where there is none.
    pub surface_nodes: Vec<[u32; 2]>,
    /// Points that stand for parts of curved surfaces.
    pub facets: Vec<[Facet; FACETS]>,
    /// Sides of surfaces left out because no light can reach them: front and back of each.
    pub(crate) sealed: Vec<[bool; 2]>,
    /// Sides of surfaces that others touch, so that parts of them may be covered.
    pub(crate) touched: Vec<[bool; 2]>,
    /// By node: see [`exposed`](Self::exposed).
    pub(crate) exposed: Vec<f32>,
    /// Those that there were when the hierarchy was built.
    pub(crate) rooms: Rooms,
}

struct Boxed(obvhs::aabb::Aabb);
impl obvhs::Boundable for Boxed {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        self.0
    }
}

impl Elements {
    /// Builds clusters and one element per surface and reflecting side. `extra` tells how much an extension
    /// reflects of a material beside the diffuse part; `None` where it takes no part.
    pub(crate) fn build(scene: &SceneData, extra: impl Fn(u32) -> Option<Rgb>, skips: Skips) -> Self {
        let mut roots: Vec<Element> = Vec::new();
        let mut sealed = vec![[false; 2]; scene.surfaces().len()];
        let (sides, rooms) = sides(scene, &extra, skips);
        for (i, sides) in sides.into_iter().enumerate() {
            let glossy = extra(scene.surface_materials[i]);
            let side = |((kind, _), room)| Element { room, ..patch(scene, i as u32, kind, Domain::WHOLE, glossy) };
            let shown = SIDES.into_iter().zip(sides.shown).zip(sides.rooms).filter(|((_, shown), _)| *shown);
            roots.extend(shown.map(side));
            sealed[i] = sides.sealed;
        }
        let (mut inside, rest): (Vec<Element>, Vec<Element>) = roots.into_iter().partition(|e| e.room != NO_ROOM);
        // Rooms in trees of their own: no cluster is in several of them but those that hold nothing else.
        inside.sort_by_key(|element| element.room);
        let of_room = |room: &[Element]| Tree::over(Tree::of_sides(room.to_vec()));
        let of_rooms: Vec<Tree> = inside.chunk_by(|a, b| a.room == b.room).filter_map(of_room).collect();
        let lights: Vec<Element> = (0..scene.lights.len()).map(|i| light(scene, i as u32)).collect();
        let mut trees: Vec<Tree> = Tree::over(of_rooms).into_iter().collect();
        trees.extend(Tree::of_sides(rest));
        trees.extend(lights.into_iter().map(Tree::Leaf));
        let root = if trees.len() == 1 { trees.remove(0) } else { Tree::Inner(trees) };
        let mut elements = Self {
            nodes: Vec::new(),
            surface_nodes: vec![[u32::MAX; 2]; scene.surfaces().len()],
            facets: Vec::new(),
            sealed,
            touched: Vec::new(),
            exposed: Vec::new(),
            rooms,
        };
        elements.flatten(root);
        for (surface, &twin) in scene.twins.iter().enumerate() {
            elements.surface_nodes[surface] = elements.surface_nodes[twin as usize];
        }
        for node in 0..elements.nodes.len() {
            elements.add_facets(scene, node);
        }
        elements.touched = vec![[false; 2]; scene.surfaces().len()];
        elements.find_touched(scene, |_| true);
        elements
    }

    /// Area that a receiver's counts a share of: of all surfaces in a single room, of those of one among several.
    pub(crate) fn measure(&self) -> f32 {
        (self.nodes[0].area / self.rooms.number.powi(2)).max(f32::MIN_POSITIVE)
    }

    /// Finds the touched sides anew, those of some surfaces.
    pub(crate) fn find_touched(&mut self, scene: &SceneData, of: impl Fn(u32) -> bool + Sync) {
        let elements = &*self;
        let touched = |surface: usize| {
            let surface = surface as u32;
            let is_touched = |side| elements.has(side) && is_touched(scene, elements, side);
            if of(surface) {
                [2 * surface, 2 * surface + 1].map(is_touched)
            } else {
                elements.touched[surface as usize]
            }
        };
        self.touched = threads::map_range(0..scene.surfaces().len(), 64, touched);
    }

    /// Share of a leaf's area that light may reach: the rest lies below something that stands on it. The leaf's irradiance
    /// and radiosity are those of this part.
    #[must_use]
    pub fn exposed(&self, leaf: u32) -> f32 {
        self.exposed.get(leaf as usize).copied().unwrap_or(1.0)
    }

    /// Whether no light can reach a side, which would reflect it.
    pub(crate) fn is_sealed(&self, side: Side) -> bool {
        self.sealed[(side / 2) as usize][usize::from(is_back(side))]
    }

    /// Whether parts of a side may be covered, by what touches it.
    pub(crate) fn is_touched(&self, side: Side) -> bool {
        self.touched[(side / 2) as usize][usize::from(is_back(side))]
    }

    /// Whether a side has an element.
    fn has(&self, side: Side) -> bool {
        self.surface_nodes[(side / 2) as usize][usize::from(is_back(side))] != u32::MAX
    }

    /// Sides of surfaces left out because no light can reach them.
    pub(crate) fn sealed_sides(&self) -> u64 {
        self.sealed.iter().flatten().filter(|sealed| **sealed).count() as u64
    }

    /// Lays down the facets of a part of a curved surface.
    fn add_facets(&mut self, scene: &SceneData, node: usize) {
        let element = &mut self.nodes[node];
        if !element.is_patch() || element.whole_sphere {
            return;
        }
        let geometry = &scene.surfaces()[element.source as usize];
        if !geometry.is_polygon() {
            element.facets = self.facets.len() as u32;
            self.facets.push(geometry.facets(element.domain));
        }
    }

    /// Lays the tree out breadth first, and fills clusters bottom-up.
    fn flatten(&mut self, root: Tree) {
        self.nodes.push(EMPTY);
        self.lay(root, 0, 0);
        for id in (0..self.nodes.len()).rev() {
            self.fill(id);
        }
    }

    /// Lays a tree out breadth first: its root in a place that there is, below a parent, the rest at the end.
    fn lay(&mut self, tree: Tree, parent: u32, at: u32) {
        let mut queue = std::collections::VecDeque::from([(tree, parent, at)]);
        while let Some((tree, parent, id)) = queue.pop_front() {
            self.nodes[id as usize] = match tree {
                Tree::Leaf(mut element) => {
                    element.parent = parent;
                    if element.is_patch() {
                        self.surface_nodes[element.source as usize][usize::from(element.kind == Kind::Back)] = id;
                    }
                    element
                }
                Tree::Inner(children) => {
                    let (first_child, child_count) = (self.nodes.len() as u32, children.len() as u32);
                    self.nodes.resize(self.nodes.len() + children.len(), EMPTY);
                    queue.extend(children.into_iter().zip(first_child..).map(|(child, at)| (child, id, at)));
                    Element { parent, first_child, child_count, ..EMPTY }
                }
            };
        }
    }

    /// Makes a cluster what its children are together.
    fn fill(&mut self, id: usize) {
        if self.nodes[id].kind == Kind::Cluster {
            self.nodes[id] = self.cluster(id);
        }
    }

    fn cluster(&self, id: usize) -> Element {
        let Element { parent, first_child, child_count, .. } = self.nodes[id];
        let mut cluster = Element { parent, first_child, child_count, ..EMPTY };
        let range = cluster.first_child as usize..(cluster.first_child + cluster.child_count) as usize;
        let children = || self.nodes[range.clone()].iter().filter(|c| c.kind != Kind::Light);
        let mut normals: Option<Cone> = None;
        cluster.room = children().map(|child| child.room).reduce(rooms::together).unwrap_or(NO_ROOM);
        let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
        for child in children() {
            low = low.min(child.bounds[0]);
            high = high.max(child.bounds[1]);
            cluster.area += child.area;
            cluster.facing.add(&child.facing, child.area);
            cluster.reflectance += child.reflectance * child.area;
            cluster.importance = cluster.importance.max(child.importance);
            cluster.active |= child.active;
            normals = Some(normals.map_or(child.normals, |n| n.union(&child.normals)));
        }
        if cluster.area > 0.0 {
            cluster.facing = cluster.facing.scaled(cluster.area.recip());
            cluster.reflectance /= cluster.area;
        }
        // Lights without extent have no normals, and shine anywhere.
        let has_lights = self.nodes[range.clone()].iter().any(|child| child.kind == Kind::Light);
        if let Some(normals) = normals {
            cluster.normals = if has_lights { Cone::SPHERE } else { normals };
            cluster.bounds = [low, high];
            cluster.center = 0.5 * (low + high);
            cluster.radius = 0.5 * (high - low).length();
        }
        cluster
    }

    /// Takes other places over: those of surfaces and lights that have moved, with all parts and what holds them.
    pub(crate) fn refit(&mut self, scene: &SceneData, moved: &Moved) {
        for id in (0..self.nodes.len()).rev() {
            let before = self.nodes[id];
            let now = match before.kind {
                _ if !moved.is_below(id as u32) => continue,
                Kind::Cluster => self.cluster(id),
                Kind::Light => light(scene, before.source),
                Kind::Front | Kind::Back => patch(scene, before.source, before.kind, before.domain, None),
            };
            let Element { parent, first_child, child_count, active, reflectance, importance, facets, .. } = before;
            if let Some(facets) = self.facets.get_mut(facets as usize) {
                *facets = scene.surfaces()[before.source as usize].facets(before.domain);
            }
            let kept = Element { parent, first_child, child_count, active, facets, ..now };
            self.nodes[id] = if before.is_patch() { Element { reflectance, importance, ..kept } } else { kept };
        }
    }

    /// Takes note of the sides that no light can reach now. Returns elements for those that it can reach now and could not
    /// before.
    pub(crate) fn unseal(
        &mut self,
        scene: &SceneData,
        extra: impl Fn(u32) -> Option<Rgb>,
        skips: Skips,
    ) -> Vec<Element> {
        let mut found = Vec::new();
        // What was in one room may not be now.
        self.nodes.iter_mut().for_each(|element| element.room = NO_ROOM);
        for (i, sides) in sides(scene, &extra, skips).0.into_iter().enumerate() {
            let glossy = extra(scene.surface_materials[i]);
            for ((kind, shown), node) in SIDES.into_iter().zip(sides.shown).zip(self.surface_nodes[i]) {
                if shown && node == u32::MAX {
                    found.push(patch(scene, i as u32, kind, Domain::WHOLE, glossy));
                }
            }
            self.sealed[i] = sides.sealed;
        }
        found
    }

    /// Adds sides beside all that there is: below a new root are the old one and a tree of them. Nodes there are have other
    /// ids then: see [`grafted`].
    pub(crate) fn graft(&mut self, scene: &SceneData, sides: Vec<Element>) {
        let Some(tree) = Tree::of(sides) else { return };
        for element in &mut self.nodes {
            element.parent = grafted(element.parent);
            element.first_child = if element.child_count > 0 { grafted(element.first_child) } else { 0 };
        }
        self.nodes[0].parent = 0;
        for node in self.surface_nodes.as_flattened_mut().iter_mut().filter(|node| **node != u32::MAX) {
            *node = grafted(*node);
        }
        make_room(&mut self.nodes, || EMPTY);
        make_room(&mut self.exposed, || 1.0);
        self.nodes[0] = Element { first_child: 1, child_count: 2, ..EMPTY };
        let first = self.nodes.len();
        self.lay(tree, 0, GRAFT);
        for id in (first..self.nodes.len()).rev().chain([GRAFT as usize, 0]) {
            self.fill(id);
            self.add_facets(scene, id);
        }
        for (surface, &twin) in scene.twins.iter().enumerate() {
            self.surface_nodes[surface] = self.surface_nodes[twin as usize];
        }
    }

    /// Finds all reflectances anew, those of surfaces from the scene.
    pub(crate) fn repaint(&mut self, scene: &SceneData, extra: impl Fn(u32) -> Option<Rgb>) {
        for node in 0..self.nodes.len() {
            let element = self.nodes[node];
            if !element.is_patch() {
                continue;
            }
            let reflectance = scene.reflectance(element.source, &element.domain);
            let parent = &self.nodes[element.parent as usize];
            let importance = if element.active && node > 0 && parent.is_patch() {
                parent.importance
            } else {
                (reflectance + extra(element.material).unwrap_or(Rgb::ZERO)).max_element()
            };
            self.nodes[node] = Element { reflectance, importance, ..element };
        }
        for node in (0..self.nodes.len()).rev() {
            let element = &self.nodes[node];
            if element.kind != Kind::Cluster {
                continue;
            }
            let (mut reflected, mut importance) = (Rgb::ZERO, 0.0_f32);
            for child in element.first_child..element.first_child + element.child_count {
                let child = &self.nodes[child as usize];
                reflected += child.reflectance * child.area;
                importance = importance.max(child.importance);
            }
            let cluster = &mut self.nodes[node];
            if cluster.area > 0.0 {
                cluster.reflectance = reflected / cluster.area;
            }
            cluster.importance = importance;
        }
    }

    /// Splits a leaf patch; its children are appended. Does nothing to a node that has children already or that
    /// cannot be split.
    pub(crate) fn split(&mut self, scene: &SceneData, node: u32) {
        let parent = self.nodes[node as usize];
        if parent.child_count > 0 || !parent.is_patch() {
            return;
        }
        let geometry = &scene.surfaces()[parent.source as usize];
        let first = self.nodes.len() as u32;
        let parts = match standing_lines::parts(scene, &parent) {
            Some(parts) => parts.into_iter().collect(),
            None => geometry.split(parent.domain),
        };
        for part in &parts {
            let mut child = patch(scene, parent.source, parent.kind, *part, None);
            child.parent = node;
            child.active = parent.active;
            child.room = parent.room;
            child.importance = if parent.active { parent.importance } else { child.reflectance.max_element() };
            self.nodes.push(child);
            self.add_facets(scene, self.nodes.len() - 1);
        }
        let parent = &mut self.nodes[node as usize];
        parent.first_child = first;
        parent.child_count = parts.len() as u32;
    }

    /// The leaf that a point of a surface belongs to, or `None` where that side has no element.
    #[must_use]
    pub fn leaf_at(&self, scene: &SceneData, surface: u32, back: bool, uv: Vec2) -> Option<NodeId> {
        let mut node = self.surface_nodes[surface as usize][usize::from(back)];
        if node == u32::MAX {
            return None;
        }
        loop {
            let element = &self.nodes[node as usize];
            if element.child_count == 0 {
                return Some(NodeId(node));
            }
            let children = element.first_child as usize..(element.first_child + element.child_count) as usize;
            let domains = self.nodes[children].iter().map(|child| child.domain);
            node = element.first_child + scene.surfaces()[surface as usize].locate(domains, uv) as u32;
        }
    }

    /// Ids of the leaves that are parts of surfaces, in order.
    pub fn patch_leaves(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.nodes.len() as u32).filter(|&node| self.is_patch_leaf(node))
    }

    /// Whether a node is one of them.
    pub(crate) fn is_patch_leaf(&self, node: u32) -> bool {
        let element = &self.nodes[node as usize];
        element.child_count == 0 && element.is_patch()
    }
}

const EMPTY: Element = Element {
    kind: Kind::Cluster,
    bounds: [Vec3::ZERO; 2],
    center: Vec3::ZERO,
    radius: 0.0,
    normals: Cone::SPHERE,
    facing: Facing::ZERO,
    area: 0.0,
    parent: 0,
    first_child: 0,
    child_count: 0,
    source: u32::MAX,
    material: u32::MAX,
    domain: Domain::WHOLE,
    reflectance: Rgb::ZERO,
    importance: 0.0,
    active: false,
    facets: u32::MAX,
    whole_sphere: false,
    convex: false,
    room: NO_ROOM,
};

/// The root of what [`Elements::graft`] adds.
pub(crate) const GRAFT: u32 = 2;

/// The id that a node has after [`Elements::graft`].
pub(crate) const fn grafted(node: u32) -> u32 {
    if node == 0 { 1 } else { node + GRAFT }
}

/// Makes room in an array by node for those that [`Elements::graft`] adds before others.
pub(crate) fn make_room<T>(array: &mut Vec<T>, empty: impl Fn() -> T) {
    if !array.is_empty() {
        array.insert(0, empty());
        array.insert(GRAFT as usize, empty());
    }
}

const SIDES: [Kind; 2] = [Kind::Front, Kind::Back];

/// What becomes of the front and the back of a surface.
#[derive(Clone, Copy, Default)]
struct Sides {
    /// Whether it has an element.
    shown: [bool; 2],
    /// Whether it has none because no light can reach it, which it would reflect.
    sealed: [bool; 2],
    /// The room that it is in.
    rooms: [u32; 2],
}

/// What becomes of the sides of all surfaces.
fn sides(scene: &SceneData, extra: &impl Fn(u32) -> Option<Rgb>, skips: Skips) -> (Vec<Sides>, Rooms) {
    let idle = idle(scene, extra);
    let (lit, rooms, of_sides) = if skips.sealed_sides {
        lit_sides(scene, &idle)
    } else {
        (vec![[true; 2]; idle.len()], Rooms::ONE, vec![[NO_ROOM; 2]; idle.len()])
    };
    let of_surface = |((i, [front, back]), rooms): ((usize, [bool; 2]), [u32; 2])| {
        if scene.is_twin(i as u32) {
            return Sides::default();
        }
        // Black ones are there to be shown.
        let front = front || idle[i];
        let material = scene.surface_materials[i];
        let reflects = || scene.reflectance(i as u32, &Domain::WHOLE) + extra(material).unwrap_or(Rgb::ZERO);
        let has_back = scene.materials[material as usize].two_sided && reflects().max_element() > 0.0;
        Sides { shown: [front, has_back && back], sealed: [!front, has_back && !back], rooms }
    };
    (lit.into_iter().enumerate().zip(of_sides).map(of_surface).collect(), rooms)
}

/// For each surface whether it does nothing with light but hide it: it is black, or coincides with another one.
fn idle(scene: &SceneData, extra: &impl Fn(u32) -> Option<Rgb>) -> Vec<bool> {
    let black = |surface: u32| {
        let material = scene.surface_materials[surface as usize];
        let glossy = extra(material).unwrap_or(Rgb::ZERO);
        let reflects = (scene.reflectance(surface, &Domain::WHOLE) + glossy).max_element() > 0.0;
        !reflects && scene.materials[material as usize].exitance == Rgb::ZERO
    };
    (0..scene.surfaces().len() as u32).map(|surface| scene.is_twin(surface) || black(surface)).collect()
}

/// An element for a part of a surface.
fn patch(scene: &SceneData, surface: u32, kind: Kind, domain: Domain, glossy: Option<Rgb>) -> Element {
    let geometry = &scene.surfaces()[surface as usize];
    let bounds = geometry.bounds(domain);
    let (low, high) = (bounds.min, bounds.max);
    let sign = if kind == Kind::Back { -1.0 } else { 1.0 };
    let mut normals = geometry.normal_cone(domain);
    normals.axis *= sign;
    // A whole closed surface has no middle on it: take the box's.
    let center = if normals.cos_angle > 0.0 { geometry.point(geometry.middle(domain)) } else { 0.5 * (low + high) };
    let farthest = (high - center).abs().max((low - center).abs());
    let mut radius = farthest.length();
    if geometry.is_polygon() {
        let corners = geometry.corners(domain);
        radius = corners.iter().map(|&uv| geometry.point(uv).distance(center)).fold(0.0, f32::max);
    }
    let reflectance = scene.reflectance(surface, &domain);
    Element {
        kind,
        bounds: [low, high],
        center,
        radius,
        normals,
        facing: if kind == Kind::Back { geometry.facing(domain).reversed() } else { geometry.facing(domain) },
        area: geometry.area(domain),
        source: surface,
        material: scene.surface_materials[surface as usize],
        domain,
        reflectance,
        importance: (reflectance + glossy.unwrap_or(Rgb::ZERO)).max_element(),
        active: glossy.is_some(),
        whole_sphere: geometry.sphere().is_some() && domain == Domain::WHOLE && geometry.is_convex(kind == Kind::Back),
        convex: geometry.is_convex(kind == Kind::Back),
        ..EMPTY
    }
}

fn light(scene: &SceneData, index: u32) -> Element {
    let at = scene.light_positions[index as usize];
    // A light without extent has no normals; the direction in which distant light travels stands there.
    let facing = match scene.lights[index as usize].kind {
        LightKind::Directional { direction } => Facing::single(direction),
        _ => Facing::ZERO,
    };
    Element { kind: Kind::Light, bounds: [at; 2], center: at, source: index, facing, ..EMPTY }
}

/// A tree of elements before it is laid out.
enum Tree {
    Leaf(Element),
    Inner(Vec<Tree>),
}

impl Tree {
    /// One of fronts and one of backs: what a cluster faces is then known better.
    fn of_sides(sides: Vec<Element>) -> Vec<Self> {
        let (fronts, backs): (Vec<Element>, Vec<Element>) = sides.into_iter().partition(|e| e.kind == Kind::Front);
        [fronts, backs].into_iter().filter_map(Self::of).collect()
    }

    fn of(elements: Vec<Element>) -> Option<Self> {
        Self::over(elements.into_iter().map(Tree::Leaf).collect())
    }

    /// One tree of several.
    fn over(trees: Vec<Self>) -> Option<Self> {
        if trees.len() <= 1 {
            return trees.into_iter().next();
        }
        let boxes: Vec<Boxed> = trees.iter().map(|tree| Boxed(tree.bounds())).collect();
        let bvh = tree(&boxes, &Leaves { most: 1, step_cost: 1.0, reinserted: false });
        let mut slots: Vec<Option<Self>> = trees.into_iter().map(Some).collect();
        Some(Self::convert(&bvh, 0, &mut slots))
    }

    fn bounds(&self) -> obvhs::aabb::Aabb {
        match self {
            Self::Leaf(element) => obvhs::aabb::Aabb::new(element.bounds[0].into(), element.bounds[1].into()),
            Self::Inner(trees) => {
                trees.iter().map(Self::bounds).reduce(|a, b| a.union(&b)).unwrap_or(obvhs::aabb::Aabb::INVALID)
            }
        }
    }

    fn convert(bvh: &obvhs::bvh2::Bvh2, node: usize, slots: &mut [Option<Self>]) -> Self {
        let primitives =
            |n: &obvhs::bvh2::node::Bvh2Node| n.first_index as usize..(n.first_index + n.prim_count) as usize;
        let leaf = |node: &obvhs::bvh2::node::Bvh2Node, slots: &mut [Option<Self>]| -> Vec<Self> {
            primitives(node).filter_map(|i| slots[bvh.primitive_indices[i] as usize].take()).collect()
        };
        let start = &bvh.nodes[node];
        if start.is_leaf() {
            let mut leaves = leaf(start, slots);
            return if leaves.len() == 1 { leaves.remove(0) } else { Tree::Inner(leaves) };
        }
        // Widening: open the largest inner node until the fan-out is reached.
        let mut open: Vec<usize> = vec![start.first_index as usize, start.first_index as usize + 1];
        while open.len() < FAN_OUT {
            let largest = open
                .iter()
                .enumerate()
                .filter(|(_, n)| !bvh.nodes[**n].is_leaf())
                .max_by(|a, b| {
                    let size = |n: usize| bvh.nodes[n].aabb().half_area();
                    size(*a.1).total_cmp(&size(*b.1)).then(b.0.cmp(&a.0))
                })
                .map(|(i, _)| i);
            let Some(i) = largest else { break };
            let first = bvh.nodes[open[i]].first_index as usize;
            open[i] = first;
            open.insert(i + 1, first + 1);
        }
        Tree::Inner(open.into_iter().map(|n| Self::convert(bvh, n, slots)).collect())
    }
}

impl Hierarchy for Elements {
    fn parent(&self, node: NodeId) -> Option<NodeId> {
        (node.0 != 0).then(|| NodeId(self.nodes[node.index()].parent))
    }
    fn center(&self, node: NodeId) -> Vec3 {
        self.nodes[node.index()].center
    }
    fn radius(&self, node: NodeId) -> f32 {
        self.nodes[node.index()].radius
    }
    fn normals(&self, node: NodeId) -> Cone {
        self.nodes[node.index()].normals
    }
    fn material(&self, node: NodeId) -> Option<u32> {
        let e = &self.nodes[node.index()];
        e.is_patch().then_some(e.material)
    }
    fn direction_to(&self, sender: NodeId, at: Vec3) -> (Vec3, f32) {
        let e = &self.nodes[sender.index()];
        if self.is_distant(sender) {
            return (-e.facing.mean, 0.0);
        }
        let to = e.center - at;
        let d2 = to.length_squared().max(1e-20);
        let direction = to / d2.sqrt();
        // Solid angle over π, no more than that of the bounding ball.
        let share = (e.area * e.mean_cosine(-direction) / std::f32::consts::PI).min(e.radius * e.radius) / d2;
        (direction, share.min(1.0).sqrt().asin())
    }
    fn is_distant(&self, sender: NodeId) -> bool {
        let e = &self.nodes[sender.index()];
        e.kind == Kind::Light && e.facing != Facing::ZERO
    }
}

//! Solutions to be kept: as flat arrays, and from them again. Geometry is not among them, only the tree over it: it comes from
//! the scene, and whoever restores a solution sees to it that it is the same one.
//!
//! What is read is checked as if it came from an enemy: all indices lie within what they point into, the hierarchy is a
//! tree, all light is finite.

use crate::budget::Spent;
use crate::clock::Instant;
use crate::effort::{self, Aim};
use crate::face_clusters::FaceClusters;
use crate::flat::{FlatError, Reader, Writer, are_offsets, fits, is_finite};
use crate::hierarchy::{Element, Elements, Kind, SceneData};
use crate::hooks::LightField;
use crate::links::{Link, Links};
use crate::misjudged::Misjudged;
use crate::refine::Pair;
use crate::reflect::{Representative, Senders};
use crate::resume::{Tried, Unfinished};
use crate::rooms::Rooms;
use crate::solution::Solution;
use crate::solver::scene_by;
use crate::stats::{Skipped, Stats};
use crate::threads;
use crate::transport::Exitant;
use crate::vertices::{Corner, Vertices};
use crate::visibility::Visibility;
use crate::{Normalization, Rgb, SceneInput, SolveError};
use std::io;

/// An extension whose light can be kept.
pub trait Keep: LightField {
    /// Writes what the extension keeps of a run of nodes.
    ///
    /// # Errors
    /// Those of what is written to.
    fn store(&self, incident: &[Self::Incident], reflected: &[Self::Exitant], out: &mut Writer<'_>) -> io::Result<()>;

    /// Reads it again: incident and exitant light of `run` of a hierarchy's nodes, of which there are so many. Called from
    /// several threads at once, for different runs.
    ///
    /// # Errors
    /// Where it is not what [`store`](Self::store) writes.
    fn restore(&self, nodes: usize, run: usize, from: &mut Reader<'_>) -> Result<KeptLight<Self>, FlatError>;

    /// Writes what it keeps beside the light of nodes: nothing unless it says so.
    ///
    /// # Errors
    /// Those of what is written to.
    fn store_own(&self, _: &mut Writer<'_>) -> io::Result<()> {
        Ok(())
    }

    /// Reads it again.
    ///
    /// # Errors
    /// Where it is not what [`store_own`](Self::store_own) writes.
    fn restore_own(&self, _: &mut Reader<'_>) -> Result<(), FlatError> {
        Ok(())
    }
}

/// Incident and exitant light of a run of nodes.
pub type KeptLight<L> = (Vec<<L as LightField>::Incident>, Vec<<L as LightField>::Exitant>);

impl Keep for () {
    fn store(&self, _: &[()], _: &[()], _: &mut Writer<'_>) -> io::Result<()> {
        Ok(())
    }

    fn restore(&self, _: usize, run: usize, _: &mut Reader<'_>) -> Result<KeptLight<Self>, FlatError> {
        Ok((vec![(); run], vec![(); run]))
    }
}

/// Why a solution cannot be restored.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// The scene makes no sense to the solver.
    #[error(transparent)]
    Scene(#[from] SolveError),
    /// The arrays are not those of a solution of this scene.
    #[error(transparent)]
    Flat(#[from] FlatError),
}

const LIGHT: &str = "extension's light";

/// What there is of a solution beside its extension's light.
struct Own {
    scene: SceneData,
    stats: Stats,
    elements: Elements,
    exitant: Exitant,
    links: Links,
    vertices: Vertices,
    faces: FaceClusters,
    faint: Vec<Rgb>,
    unfinished: Unfinished,
}

impl<L: Keep> Solution<L> {
    /// Writes all but the scene's geometry and materials, and the extension's light.
    ///
    /// # Errors
    /// Those of what is written to.
    pub fn store(&self, out: &mut Writer<'_>) -> io::Result<()> {
        // Things may have moved since it was made.
        out.put(&self.scene.normalization.to_array())?;
        out.put(&self.scene.twins)?;
        self.scene.visibility.store(out)?;
        self.stats.store(out)?;
        self.elements.store(out)?;
        self.exitant.store(out)?;
        out.put(self.links.all())?;
        self.vertices.store(out)?;
        out.put(&self.faint)?;
        self.unfinished.store(out)?;
        self.field.store_own(out)
    }

    /// Writes the extension's light of the `run`-th of so many runs of nodes. All of them, in this order, are
    /// what [`restore`](Self::restore) needs; that there are some lets it read them side by side.
    ///
    /// # Errors
    /// Those of what is written to.
    pub fn store_light(&self, run: usize, of: usize, out: &mut Writer<'_>) -> io::Result<()> {
        let nodes = self.incident.len();
        let [start, end] = [run, run + 1].map(|run| nodes.min(run * nodes.div_ceil(of)));
        out.put(&[nodes, end - start].map(|count| count as u64))?;
        self.field.store(&self.incident[start..end], &self.reflected[start..end], out)
    }

    /// Reads what [`store`](Self::store) and [`store_light`](Self::store_light) wrote of a solution of the same scene, where
    /// there are threads side by side. Of [`Stats::seconds`] there are those that this took; the other statistics are those of
    /// the solve.
    ///
    /// # Errors
    /// Where the scene cannot be used, or the arrays are not those of a solution of a scene like this.
    pub fn restore(
        input: &SceneInput,
        field: L,
        own: &mut Reader<'_>,
        light: &mut [Reader<'_>],
    ) -> Result<Self, RestoreError> {
        let start = Instant::now();
        let restore_light = || threads::map_mut(light, 1, |_, from| restore_run(&field, from)).into_iter().collect();
        let (own, light): (_, Result<Vec<_>, _>) = threads::join(|| Own::restore(input, &field, own), restore_light);
        let Own { scene, mut stats, elements, exitant, links, vertices, faces, faint, unfinished } = own?;
        let light = light?;
        let nodes = elements.nodes.len();
        fits(light.iter().all(|(all, _)| *all == nodes), LIGHT)?;
        let (incident, reflected): (Vec<_>, Vec<_>) = light.into_iter().map(|(_, run)| run).unzip();
        let incident: Vec<L::Incident> = incident.into_iter().flatten().collect();
        let reflected: Vec<L::Exitant> = reflected.into_iter().flatten().collect();
        fits(incident.len() == nodes && reflected.len() == nodes, LIGHT)?;
        stats.seconds.build = start.elapsed().as_secs_f64();
        Ok(Self {
            scene,
            elements,
            exitant,
            links,
            vertices,
            field,
            incident,
            reflected,
            faint,
            faces,
            stats,
            unfinished,
        })
    }
}

/// The number of all nodes, and the light of a run of them.
fn restore_run<L: Keep>(field: &L, from: &mut Reader<'_>) -> Result<(usize, KeptLight<L>), FlatError> {
    let counts: [u64; 2] = from.take_exactly(LIGHT)?;
    let [nodes, run] = counts.map(usize::try_from);
    let [nodes, run] = [nodes, run].map(|count| count.map_err(|_| FlatError::Misfit(LIGHT)));
    let (nodes, run) = (nodes?, run?);
    fits(run <= nodes, LIGHT)?;
    let light = field.restore(nodes, run, from)?;
    fits(light.0.len() == run && light.1.len() == run, LIGHT)?;
    Ok((nodes, light))
}

impl Own {
    fn restore(input: &SceneInput, field: &impl Keep, from: &mut Reader<'_>) -> Result<Self, RestoreError> {
        const SPACE: &str = "unit space";
        let normalization = Normalization::from_array(from.take_exactly(SPACE)?).ok_or(FlatError::Misfit(SPACE))?;
        let scene = scene_by(input, normalization, |surfaces, _| {
            let twins: Vec<u32> = from.take("coinciding surfaces")?;
            let is_sound = |(surface, &twin): (usize, &u32)| twin as usize <= surface && twins[twin as usize] == twin;
            let fit = twins.len() == surfaces.len() && twins.iter().enumerate().all(is_sound);
            fits(fit, "coinciding surfaces")?;
            Ok::<_, RestoreError>((Visibility::restore(surfaces, &twins, from)?, twins))
        })?;
        let stats = Stats::restore(from)?;
        let elements = Elements::restore(&scene, from)?;
        let count = elements.nodes.len();
        let exitant = Exitant::restore(count, from)?;
        let links = restore_links(count, from)?;
        let vertices = Vertices::restore(&elements, from)?;
        let faint: Vec<Rgb> = from.take_finite("faint materials")?;
        fits(faint.len() == scene.materials.len(), "faint materials")?;
        let unfinished = Unfinished::restore(count, from)?;
        field.restore_own(from)?;
        let faces = FaceClusters::new(&elements, &links, field).with_vertices(&elements, &vertices);
        Ok(Self { scene, stats, elements, exitant, links, vertices, faces, faint, unfinished })
    }
}

impl Elements {
    fn store(&self, out: &mut Writer<'_>) -> io::Result<()> {
        out.put(&self.nodes)?;
        out.put(&self.surface_nodes)?;
        out.put(&self.facets)?;
        out.put(self.sealed.as_flattened())?;
        out.put(self.touched.as_flattened())?;
        out.put(&self.exposed)?;
        out.put(&[self.rooms])
    }

    fn restore(scene: &SceneData, from: &mut Reader<'_>) -> Result<Self, FlatError> {
        let sides = |flags: Vec<bool>| flags.as_chunks().0.to_vec();
        let elements = Self {
            nodes: from.take("elements")?,
            surface_nodes: from.take("elements of surfaces")?,
            facets: from.take_finite("facets")?,
            sealed: sides(from.take("sealed sides")?),
            touched: sides(from.take("touched sides")?),
            exposed: from.take_finite("exposed shares")?,
            rooms: from.take_exactly::<Rooms, 1>("rooms")?[0],
        };
        fits(elements.rooms.is_sound(), "rooms")?;
        let surfaces = scene.surfaces().len();
        fits(elements.nodes.first().is_some_and(|root| root.parent == 0), "elements")?;
        let all = elements.nodes.iter().enumerate();
        fits(all.into_iter().all(|(id, element)| elements.is_sound(scene, id, element)), "elements")?;
        fits(elements.surface_nodes.len() == surfaces, "elements of surfaces")?;
        let all = elements.surface_nodes.iter().enumerate();
        let mut sides = all.flat_map(|(surface, sides)| {
            std::iter::zip([Kind::Front, Kind::Back], sides).map(move |(kind, &node)| (surface, kind, node))
        });
        let is_right = |(surface, kind, node): (usize, Kind, u32)| {
            let element = elements.nodes.get(node as usize);
            let is_its_own = |e: &Element| e.kind == kind && e.source == scene.twins[surface];
            node == u32::MAX || element.is_some_and(is_its_own)
        };
        fits(sides.all(is_right), "elements of surfaces")?;
        fits(elements.sealed.len() == surfaces && elements.touched.len() == surfaces, "sides")?;
        Ok(elements)
    }

    /// Whether a node that was read is one, in its place in the tree.
    fn is_sound(&self, scene: &SceneData, id: usize, element: &Element) -> bool {
        let parent = element.parent as usize;
        let is_child = id == 0
            || parent < id && {
                let above = &self.nodes[parent];
                above.has_child(id)
                    && (!above.is_patch() || (above.kind, above.source) == (element.kind, element.source))
            };
        let end = u64::from(element.first_child) + u64::from(element.child_count);
        let has_children =
            element.child_count == 0 || element.first_child as usize > id && end <= self.nodes.len() as u64;
        let source = element.source as usize;
        let stands_for = match element.kind {
            Kind::Cluster => true,
            Kind::Light => source < scene.lights.len() && element.child_count == 0,
            Kind::Front | Kind::Back => scene.surface_materials.get(source) == Some(&element.material),
        };
        let has_facets = element.facets == u32::MAX || (element.facets as usize) < self.facets.len();
        let numbers = [element.radius, element.area, element.importance];
        let vectors = [element.bounds[0], element.bounds[1], element.center, element.reflectance];
        let has_numbers = is_finite(&numbers)
            && is_finite(&vectors)
            && is_finite(&[element.normals])
            && is_finite(&[element.facing])
            && is_finite(&[element.domain]);
        is_child && has_children && stands_for && has_facets && has_numbers
    }
}

impl Element {
    /// Whether a node is among the children of this one.
    fn has_child(&self, node: usize) -> bool {
        let first = self.first_child as usize;
        (first..first + self.child_count as usize).contains(&node)
    }
}

impl Exitant {
    fn store(&self, out: &mut Writer<'_>) -> io::Result<()> {
        out.put(&self.radiosity)?;
        out.put(&self.range)?;
        out.put(&self.facing)?;
        out.put(&self.irradiance)?;
        out.put(&self.indirect)?;
        out.put(&self.directional)?;
        out.put(&self.reflected_as)?;
        out.put(&self.gain)?;
        out.put(&self.peak)?;
        out.put(&self.adaptation)?;
        out.put(&self.senders.ranges)?;
        out.put(&self.senders.standing)
    }

    fn restore(nodes: usize, from: &mut Reader<'_>) -> Result<Self, FlatError> {
        const SENDERS: &str = "senders of directional light";
        let exitant = Self {
            radiosity: from.take_finite("radiosities")?,
            range: from.take_finite("ranges of radiosity")?,
            facing: from.take_finite("directions of radiosity")?,
            irradiance: from.take_finite("irradiances")?,
            indirect: from.take_finite("indirect irradiances")?,
            directional: from.take_finite("directional light")?,
            reflected_as: from.take("nodes that stand for others")?,
            gain: from.take_finite("gains")?,
            peak: from.take_finite("peaks")?,
            adaptation: from.take_finite("what errors count")?,
            senders: Senders { ranges: from.take(SENDERS)?, standing: from.take(SENDERS)? },
            misjudged: Misjudged::default(),
        };
        let lengths = [
            exitant.radiosity.len(),
            exitant.range.len(),
            exitant.facing.len(),
            exitant.irradiance.len(),
            exitant.indirect.len(),
            exitant.directional.len(),
            exitant.reflected_as.len(),
            exitant.gain.len(),
            exitant.peak.len(),
            exitant.adaptation.len(),
        ];
        fits(lengths.iter().all(|&length| length == nodes), "arrays by node")?;
        fits(exitant.adaptation.iter().all(|&counts| counts > 0.0), "what errors count")?;
        fits(exitant.reflected_as.iter().all(|&node| (node as usize) < nodes), "nodes that stand for others")?;
        let Senders { ranges, standing } = &exitant.senders;
        let are_within = ranges.iter().all(|&[first, end]| first <= end && end as usize <= standing.len());
        let is_sound = |standing: &Representative| {
            (standing.leaf as usize) < nodes && standing.share.is_finite() && standing.strength.is_finite()
        };
        fits(are_within && standing.iter().all(is_sound), SENDERS)?;
        Ok(exitant)
    }
}

fn restore_links(nodes: usize, from: &mut Reader<'_>) -> Result<Links, FlatError> {
    let links: Vec<Link> = from.take("links")?;
    let is_sound = |link: &Link| {
        (link.receiver as usize) < nodes
            && (link.sender as usize) < nodes
            && link.factor.is_finite()
            && link.visibility.is_finite()
    };
    fits(links.iter().all(is_sound), "links")?;
    Ok(Links::new(links, nodes))
}

impl Unfinished {
    fn store(&self, out: &mut Writer<'_>) -> io::Result<()> {
        let Tried { in_vain, gained, rays_in_vain } = self.tried;
        let [in_vain, gained, rays_in_vain] = [in_vain, gained, rays_in_vain].map(|flag| f32::from(u8::from(flag)));
        out.put(&[self.aim.tolerance, self.aim.effort, self.found, in_vain, gained, rays_in_vain])?;
        out.put(&self.unlit)?;
        out.put(&self.coarse)
    }

    fn restore(nodes: usize, from: &mut Reader<'_>) -> Result<Self, FlatError> {
        const WHAT: &str = "pairs that are not done";
        let [tolerance, effort, found, flags @ ..]: [f32; 6] = from.take_exactly(WHAT)?;
        let [in_vain, gained, rays_in_vain] = flags.map(|flag| flag != 0.0);
        let (aim, tried) = (Aim { tolerance, effort }, Tried { in_vain, gained, rays_in_vain });
        let unfinished = Self { aim, found, tried, unlit: from.take(WHAT)?, coarse: from.take(WHAT)? };
        let is_sound = |pair: &Pair| (pair.receiver as usize) < nodes && (pair.sender as usize) < nodes;
        let pairs = unfinished.unlit.iter().chain(&unfinished.coarse).all(is_sound);
        let is_aim = tolerance > 0.0 && (1.0..=effort::MOST).contains(&effort);
        fits(pairs && is_aim && found >= 0.0, WHAT)?;
        Ok(unfinished)
    }
}

impl Vertices {
    fn store(&self, out: &mut Writer<'_>) -> io::Result<()> {
        out.put(&self.positions)?;
        out.put(&self.normals)?;
        out.put(&self.irradiance)?;
        out.put(&self.indirect)?;
        out.put(&self.leaf)?;
        out.put(&self.uv)?;
        out.put(&self.corners)?;
        out.put(&self.first_corner)?;
        out.put(&self.first_fan)?;
        out.put(&self.around)?;
        out.put(&self.first_around)
    }

    fn restore(elements: &Elements, from: &mut Reader<'_>) -> Result<Self, FlatError> {
        let vertices = Self {
            positions: from.take_finite("vertices")?,
            normals: from.take_finite("normals of vertices")?,
            irradiance: from.take_finite("irradiances of vertices")?,
            indirect: from.take_finite("indirect irradiances of vertices")?,
            leaf: from.take("leaves of vertices")?,
            uv: from.take_finite("parameters of vertices")?,
            corners: from.take::<Corner>("fans")?,
            first_corner: from.take("fans")?,
            first_fan: from.take("fans")?,
            around: from.take("leaves around vertices")?,
            first_around: from.take("leaves around vertices")?,
        };
        let count = vertices.positions.len();
        let values = [vertices.irradiance.len(), vertices.indirect.len()];
        let lengths = [vertices.normals.len(), values[0], values[1], vertices.leaf.len(), vertices.uv.len()];
        fits(lengths.iter().all(|&length| length == count), "vertices")?;
        let is_leaf = |&leaf: &u32| {
            elements.nodes.get(leaf as usize).is_some_and(|element| element.is_patch() && element.child_count == 0)
        };
        fits(vertices.leaf.iter().all(is_leaf), "leaves of vertices")?;
        let fans = vertices.first_corner.len().saturating_sub(1);
        fits(are_offsets(&vertices.first_corner, fans, vertices.corners.len()), "fans")?;
        fits(are_offsets(&vertices.first_fan, elements.nodes.len(), fans), "fans")?;
        let is_corner = |corner: &Corner| (corner.vertex as usize) < count && corner.uv.is_finite();
        fits(vertices.corners.iter().all(is_corner), "fans")?;
        fits(
            elements.patch_leaves().all(|leaf| vertices.fans(leaf).next().is_some_and(|fan| !fan.is_empty())),
            "fans",
        )?;
        let around = are_offsets(&vertices.first_around, count, vertices.around.len());
        fits(around && vertices.around.iter().all(is_leaf), "leaves around vertices")?;
        Ok(vertices)
    }
}

/// Counters of [`Stats`].
const COUNTERS: usize = 28;

impl Stats {
    /// All counters, in the order in which they are kept.
    fn counters(&mut self) -> [&mut u64; COUNTERS] {
        let Self {
            polygons,
            nodes,
            leaves,
            links,
            rays,
            check_rays,
            vertex_rays,
            pairs,
            renewed_links,
            kept_links,
            renewed_places,
            reined_leaves,
            iterations: _,
            links_evaluated,
            residuals: _,
            error: _,
            bias: _,
            stopped: _,
            spent: _,
            bytes,
            skipped,
            seconds: _,
        } = self;
        let Skipped {
            black_receivers,
            unlit_senders,
            facing,
            proved_free,
            proved_blocked,
            sealed_sides,
            converged_leaves,
            steady_senders,
            faint_links,
            spared_looks,
            unseen_senders,
            inner_vertices,
            // Of the pictures that were taken, not of the solution.
            unseen_vertices: _,
            unseen_leaves: _,
            joined_leaves,
            shot_links,
        } = skipped;
        [
            polygons,
            nodes,
            leaves,
            links,
            rays,
            check_rays,
            vertex_rays,
            pairs,
            renewed_links,
            kept_links,
            renewed_places,
            reined_leaves,
            links_evaluated,
            bytes,
            black_receivers,
            unlit_senders,
            facing,
            proved_free,
            proved_blocked,
            sealed_sides,
            converged_leaves,
            steady_senders,
            faint_links,
            spared_looks,
            unseen_senders,
            inner_vertices,
            joined_leaves,
            shot_links,
        ]
    }

    fn store(&self, out: &mut Writer<'_>) -> io::Result<()> {
        let spent = match self.spent {
            None => 0_u64,
            Some(Spent::Time) => 1,
            Some(Spent::Memory) => 2,
        };
        out.put(&self.clone().counters().map(|counter| *counter))?;
        out.put(&[self.iterations.into(), self.stopped.into(), spent])?;
        out.put(&self.residuals)?;
        out.put(self.error.as_slice())?;
        out.put(&[self.bias])
    }

    fn restore(from: &mut Reader<'_>) -> Result<Self, FlatError> {
        const WHAT: &str = "statistics";
        let mut stats = Self::default();
        for (counter, kept) in stats.counters().into_iter().zip(from.take_exactly::<u64, COUNTERS>(WHAT)?) {
            *counter = kept;
        }
        let [iterations, stopped, spent] = from.take_exactly::<u64, 3>(WHAT)?;
        stats.iterations = iterations.try_into().map_err(|_| FlatError::Misfit(WHAT))?;
        stats.stopped = stopped != 0;
        stats.spent = match spent {
            0 => None,
            1 => Some(Spent::Time),
            2 => Some(Spent::Memory),
            _ => return Err(FlatError::Misfit(WHAT)),
        };
        stats.residuals = from.take(WHAT)?;
        stats.error = from.take_finite(WHAT)?.first().copied();
        [stats.bias] = from.take_exactly(WHAT)?;
        Ok(stats)
    }
}

//! Values at vertices: a smooth reconstruction of the irradiance for display.
//!
//! The irradiance of a vertex is gathered anew over the links that light its leaf: the geometry is that of the vertex, and
//! visibility is renewed where a link carries much of the light.

use crate::calibrate::{OF_VERTICES, Sums, factors};
use crate::contacts::Contacts;
use crate::effort::Aim;
use crate::footprint::{Footprint, footprint};
use crate::gather::{Group, carried, share};
use crate::hidden::Hidden;
use crate::hooks::LightField;
use crate::inherited::{Above, inherit};
use crate::leaning::{Leaning, Sight, is_near};
use crate::links::{Link, Links};
use crate::places::Places;
use crate::push::{Spread, spreads};
use crate::rows::{self, Correction, Row, look_around};
use crate::sampling::hash;
use crate::segments::visible_at;
use crate::solution::Seen;
use crate::threads;
use crate::toward::Detail;
use crate::transport::{Light, negligible};
use crate::vertices::{Vertices, outlines_of_parts, point_on};
use crate::within::Within;
use crate::{Facing, NodeId, Rgb};
use glam::{Vec2, Vec3};
use smallvec::SmallVec;
use std::cell::LazyCell;
use std::ops::{AddAssign, ControlFlow, Mul};

/// Rays for a link that carries all of a vertex's light; others in proportion.
const RAYS: f32 = 160.0;
/// No link gets more rays than this at one vertex.
const MOST_RAYS: f32 = 40.0;
/// Whatever light it brings, a link to what takes up all of a vertex's view gets so many rays, others in proportion: by what they see
/// of the view its row is corrected, and with it all other light.
const ROW_RAYS: f32 = 80.0;
/// All vertices look at the same points of a sender. What each has wrong is then much the same as what its neighbours have wrong, and
/// half shadows are smooth; points of each vertex's own would mottle walls.
const SAME_POINTS: u32 = 0x8103_205b;
/// Links that carry a smaller share of the light keep the visibility they have: partly visible ones, and those
/// that looked wholly visible or hidden.
const PARTIAL_SHARE: f32 = 0.002;
const WHOLE_SHARE: f32 = 0.01;
/// This share of what a link found hidden may be seen all the same. Such senders are looked at closely only once they are seen.
const MAY_BE_SEEN: f32 = 0.05;
/// Of these rays, those for what none of the leaves around sees.
const HIDDEN_SHARE: f32 = 0.25;
/// Where it is proved how much is seen of senders that take up this share of the view there is nothing to look around for.
const ALL_PROVED: f32 = 0.97;
/// What is nearer to a vertex than this share of its leaf's radius, all around, covers it.
const COVER: f32 = 0.25;
/// Vertices are changed by no more than this factor to agree with their leaves.
const MOST_CHANGE: f64 = 1.5;
/// Leaves whose shading normals let in less than this share of the light are not compared with vertices, which know how they lean.
const UPRIGHT: f32 = 0.98;
/// What near senders lean to changes the reflected light of a vertex by no more than this share.
const MOST_LEAN: f32 = 0.5;
/// Vertices that a thread gathers between two calls of `watch`: some milliseconds.
const BETWEEN_WATCHES: usize = 128;

/// What the values at vertices took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cost {
    pub(crate) rays: u64,
    /// Vertices that gather nothing, as they lie within places, …
    pub(crate) within: u64,
    /// … or as nobody sees them.
    pub(crate) unseen: u64,
    /// Senders that were found hidden at a vertex, too, before it was found out what they would bring.
    pub(crate) unseen_senders: u64,
}

/// Builds the vertices of a solution with a relative error, which has links to `places` of many leaves where these are known, and
/// gathers the irradiance of those around leaves that are `seen`. `watch` is told the share that is done; once it breaks, the others
/// take the mean irradiance of the leaves around, as those do that nobody sees.
pub(crate) fn reconstruct<L: LightField>(
    light: Light<'_, L>,
    (links, joined): (&Links, Option<&Places>),
    (error, seen): (f32, Seen<'_>),
    watch: &mut dyn FnMut(f32) -> ControlFlow<()>,
) -> (Vertices, Cost) {
    let mut layout = outlines_of_parts(light.scene, light.elements, (&light.exitant.irradiance, error));
    let contacts = Contacts::new(light, &layout);
    contacts.cut(light.elements, &mut layout);
    let mut vertices = layout.fans(light.scene, light.elements);
    let places = contacts.places(light.elements, &vertices);
    let count = vertices.positions.len();
    let within = joined.map_or_else(|| Within::none(&vertices), |joined| Within::new(light, joined, &vertices));
    let is_seen = |vertex: u32| {
        let around = vertices.leaves_around(vertex);
        around.is_empty() || around.iter().any(|&leaf| seen(NodeId(leaf)))
    };
    let is_seen: Vec<bool> = (0..count as u32).map(is_seen).collect();
    let gathers = |vertex: u32| is_seen[vertex as usize] && !within.holds(vertex);
    let (mut rays, mut unseen_senders) = (contacts.rays, 0);
    let chunk = BETWEEN_WATCHES * threads::current_num_threads();
    let mut covered = Vec::with_capacity(count);
    let mut sights = Vec::new();
    let shares = light.reflected_shares();
    let (spreads, _) = spreads(light, links, Some(Aim::of(error)));
    let (from_afar, near) = inherited(light, (links, &spreads, &shares), (&vertices, &places, &gathers));
    for start in (0..count).step_by(chunk) {
        if watch(start as f32 / count as f32).is_break() {
            for vertex in start..count {
                let mean = mean_around(light, &vertices, vertex as u32);
                (vertices.irradiance[vertex], vertices.indirect[vertex]) = (mean.irradiance, mean.indirect);
            }
            covered.resize(count, false);
            break;
        }
        let end = (start + chunk).min(count);
        let part: Vec<Gathering> = threads::map_range(start..end, 16, |vertex| {
            let around = vertices.leaves_around(vertex as u32);
            if around.iter().all(|&leaf| light.element(leaf).importance <= 0.0) {
                return Gathering::default();
            }
            if !gathers(vertex as u32) {
                return mean_around(light, &vertices, vertex as u32);
            }
            let (afar, seed) = (&from_afar[vertex], seed(vertices.positions[vertex]));
            let spots = || footprint(light, (&vertices, vertex as u32), (COVER, seed));
            let hidden = LazyCell::new(|| Hidden::from_all(light, links, around));
            let gather = |place: (u32, Vec2), looks| {
                let negligible = negligible(light.exitant.irradiance[place.0 as usize], error);
                let inherited = (afar, near.of(place.0));
                let from = (seed, &spots, looks);
                let place = (place, negligible);
                gather_at(light, (links, &spreads, &shares), place, inherited, from, |sender| hidden.holds(sender))
            };
            let place = (vertices.leaf[vertex], places[vertex]);
            let mut gathering = gather(place, Looks::FromVertex);
            // What covers one of the leaves around need not cover another.
            let mut others = contacts.places_around(&vertices, vertex as u32).into_iter();
            let again = |gathering: Gathering, place, looks| {
                let other = gather(place, looks);
                let unseen_senders = gathering.unseen_senders + other.unseen_senders;
                Gathering { rays: gathering.rays + other.rays, unseen_senders, ..other }
            };
            while gathering.covered
                && let Some(place) = others.next()
            {
                gathering = again(gathering, place, Looks::FromVertex);
            }
            if gathering.covered {
                gathering = again(gathering, place, Looks::FromFootprint);
            }
            gathering
        });
        for (vertex, gathering) in (start..end).zip(part) {
            sights.extend(gathering.sight.map(|sight| (vertex, sight)));
            rays += u64::from(gathering.rays);
            unseen_senders += u64::from(gathering.unseen_senders);
            vertices.irradiance[vertex] = gathering.irradiance;
            covered.push(gathering.covered);
            vertices.indirect[vertex] = gathering.indirect;
        }
    }
    lean(light, &mut vertices, &sights);
    agree(light, &mut vertices, seen);
    uncover(&mut vertices, &covered, &is_seen);
    within.fill(light, &mut vertices);
    let unseen = is_seen.iter().filter(|&&is_seen| !is_seen).count() as u64;
    (vertices, Cost { rays, within: within.count(), unseen, unseen_senders })
}

/// Adds what near senders bring as they are not as bright everywhere.
fn lean<L: LightField>(light: Light<'_, L>, vertices: &mut Vertices, sights: &[(usize, Sight)]) {
    if sights.is_empty() {
        return;
    }
    let leaning = Leaning::new(light, vertices);
    let more = threads::map(sights, 16, |(_, sight)| leaning.beside(light, sight));
    for ((vertex, _), more) in sights.iter().zip(more) {
        let most = vertices.indirect[*vertex] * MOST_LEAN;
        let more = more.clamp(-most, most);
        vertices.irradiance[*vertex] += more;
        vertices.indirect[*vertex] += more;
    }
}

/// The mean of the leaves around a vertex.
fn mean_around<L: LightField>(light: Light<'_, L>, vertices: &Vertices, vertex: u32) -> Gathering {
    let around = vertices.leaves_around(vertex);
    let mean = |of: &[Rgb]| around.iter().map(|&leaf| of[leaf as usize]).sum::<Rgb>() / around.len().max(1) as f32;
    let [irradiance, indirect] = [&light.exitant.irradiance, &light.exitant.indirect].map(|of| mean(of));
    Gathering { irradiance, indirect, ..Gathering::default() }
}

/// What vertices gather of reflected light, with links made for something larger, is made to agree with what the leaves around have,
/// which has been compared with more rays: region by region, so that it stays as smooth as it is. Direct light may vary over a leaf in ways
/// that its mean does not tell. Only leaves that are `seen` are compared: around others not all have gathered.
fn agree<L: LightField>(light: Light<'_, L>, vertices: &mut Vertices, seen: Seen<'_>) {
    // Of a solution without reflected light, or one that was stopped before any, there is nothing to agree with.
    if light.exitant.indirect.iter().all(|&indirect| indirect == Rgb::ZERO) {
        return;
    }
    let gathered: Vec<f32> = vertices.indirect.iter().map(|indirect| indirect.element_sum()).collect();
    let compared = |leaf: u32| {
        let element = light.element(leaf);
        let is_upright = || light.scene.let_in(element.source, &element.domain) > UPRIGHT;
        let is_open = element.importance > 0.0 && light.elements.exposed(leaf) >= 1.0;
        let counts = is_open && seen(NodeId(leaf)) && is_upright();
        let mean = vertices.mean(leaf, &gathered).filter(|&mean| counts && mean > 0.0);
        let sums = mean.map(|mean| {
            let weight = f64::from(element.area * element.importance);
            let ours = light.exitant.indirect[leaf as usize].element_sum();
            Sums::of(weight * f64::from(ours), weight * f64::from(mean), 0.0)
        });
        (leaf, sums.unwrap_or_default())
    };
    let factors = factors(light.elements, light.elements.patch_leaves().map(compared), OF_VERTICES);
    let factor = |vertex: u32| {
        let around = vertices.leaves_around(vertex);
        let sum: f64 = around.iter().map(|&leaf| factors[leaf as usize]).sum();
        (sum / around.len().max(1) as f64).clamp(MOST_CHANGE.recip(), MOST_CHANGE) as f32
    };
    let factors: Vec<f32> = (0..vertices.indirect.len() as u32).map(factor).collect();
    for ((irradiance, indirect), factor) in vertices.irradiance.iter_mut().zip(&mut vertices.indirect).zip(factors) {
        // It is no more than all there is, but for rounding.
        *indirect = indirect.min(*irradiance);
        *irradiance += *indirect * (factor - 1.0);
        *indirect *= factor;
    }
}

/// Nobody sees the darkness behind a picture on a wall or below a cupboard, but interpolation would carry it to where it
/// is seen: vertices there take the mean irradiance of the others around, but for those that nobody sees, which may be dark, too.
fn uncover(vertices: &mut Vertices, covered: &[bool], is_seen: &[bool]) {
    let is_lit = |vertex: u32| !covered[vertex as usize] && is_seen[vertex as usize];
    let mut lit: Vec<(u32, [Rgb; 2])> = Vec::new();
    for vertex in (0..covered.len() as u32).filter(|&vertex| covered[vertex as usize]) {
        let (mut sums, mut count) = ([Rgb::ZERO; 2], 0.0);
        for &leaf in vertices.leaves_around(vertex) {
            for corner in vertices
                .fans(leaf)
                .filter(|fan| fan.iter().any(|corner| corner.vertex == vertex))
                .flatten()
                .filter(|corner| is_lit(corner.vertex))
            {
                sums[0] += vertices.irradiance[corner.vertex as usize];
                sums[1] += vertices.indirect[corner.vertex as usize];
                count += 1.0;
            }
        }
        if count > 0.0 {
            lit.push((vertex, sums.map(|sum| sum / count)));
        }
    }
    for (vertex, [irradiance, indirect]) in lit {
        (vertices.irradiance[vertex as usize], vertices.indirect[vertex as usize]) = (irradiance, indirect);
    }
}

/// Irradiance at a point of a leaf, gathered over all links that light it, but roughly from senders that bring less than is `negligible`; how much is seen of their senders from all over a footprint,
/// which is asked for where that has to be found out, and with fewer rays of what `is_hidden` from all around.
fn gather_at<L: LightField>(
    light: Light<'_, L>,
    (links, spreads, shares): (&Links, &[Spread], &[f32]),
    ((leaf, uv), negligible): ((u32, Vec2), f32),
    (inherited, near): (&[Brought; 3], &[u32]),
    (seed, spots, looks): (u32, &impl Fn() -> Footprint, Looks),
    is_hidden: impl Fn(u32) -> bool,
) -> Gathering {
    let element = light.element(leaf);
    let (x, n) = point_on(light.scene, light.elements, leaf, uv);
    let mut arriving: SmallVec<[Arriving; 128]> = SmallVec::new();
    let mut total: f32 = inherited.iter().map(|brought| brought.irradiance.max_element()).sum();
    let closely = |sender: u32| light.arriving_at(x, n, sender, Detail::shown(negligible));
    let mut look = |at: usize| {
        let link = &links.all()[at];
        let (irradiance, share) = if link.visibility == 0.0 {
            light.arriving_at(x, n, link.sender, Detail::rough())
        } else {
            closely(link.sender)
        };
        let most = irradiance.max_element();
        if most > 0.0 {
            total += most * link.visibility.abs().max(MAY_BE_SEEN);
            arriving.push(Arriving { irradiance, share, visibility: link.visibility, sender: link.sender });
        }
    };
    let mut node = leaf;
    loop {
        links.range(node).filter(|&at| !is_inherited(light, node, spreads[at])).for_each(&mut look);
        if node == 0 {
            break;
        }
        node = light.element(node).parent;
    }
    near.iter().for_each(|&at| look(at as usize));
    // Light whose visibility is known here, and light with the visibility that links have for something larger.
    let (mut own, mut kept) = ([Rgb::ZERO; 3], inherited.map(|brought| brought.irradiance));
    // What of both has been reflected.
    let mut reflected = [[Rgb::ZERO; 3], inherited.map(|brought| brought.indirect)];
    let [_, emitters, rest] = inherited.map(|brought| brought.share);
    let (mut rays, mut unseen_senders, mut row) = (0, 0, Row { emitters, own: 0.0, inherited: rest });
    let mut known_here: SmallVec<[u32; 64]> = SmallVec::new();
    let mut footprint: Option<Footprint> = None;
    let mut near_senders = SmallVec::new();
    // Share of the view through links of which it is proved how much they let through.
    let mut proved = 0.0;
    for Arriving { mut irradiance, share: mut view, mut visibility, sender } in arriving {
        let share = irradiance.max_element() / total;
        let partial = visibility > 0.0 && visibility < 1.0;
        let renewed = visibility >= 0.0 && share > if partial { PARTIAL_SHARE } else { WHOLE_SHARE };
        // What is proved of a link holds everywhere.
        let known = renewed || visibility < 0.0;
        let mut in_view = visibility.abs();
        proved += if visibility < 0.0 { view } else { 0.0 };
        if known {
            known_here.push(sender);
        }
        if renewed {
            let spots = &footprint.get_or_insert_with(|| {
                let found = spots();
                rays += found.rays;
                found
            });
            let from = |i: u32| spots.spot(known_here.len() as u32 + i).unwrap_or((x, n, element.source));
            let rarer = if visibility == 0.0 && is_hidden(sender) { HIDDEN_SHARE } else { 1.0 };
            let count = ((share * RAYS).min(MOST_RAYS).max(view * ROW_RAYS) * rarer).max(1.0) as u32;
            rays += count;
            let was_hidden = visibility == 0.0;
            let visible = visible_at(light, from, sender, (count, SAME_POINTS));
            (visibility, in_view) = (visible.light, visible.view);
            if was_hidden && visibility > 0.0 {
                (irradiance, view) = closely(sender);
            }
            unseen_senders += u32::from(was_hidden && visibility == 0.0);
        }
        let group = Group::of(light, sender);
        (if known { &mut own } else { &mut kept })[group as usize] += irradiance * visibility.abs();
        // What reflects nothing sends evenly.
        if known && shares[sender as usize] > 0.0 && is_near(light, x, sender) {
            near_senders.push((sender, visibility.abs()));
        }
        reflected[usize::from(!known)][group as usize] += irradiance * (visibility.abs() * shares[sender as usize]);
        *match group {
            Group::Light => continue,
            Group::Emitter => &mut row.emitters,
            _ if known => &mut row.own,
            _ => &mut row.inherited,
        } += view * in_view;
    }
    known_here.sort_unstable();
    let is_own = |sender: u32| known_here.binary_search(&sender).is_ok();
    let (Correction { inherited, rest, all }, covered) = if proved >= ALL_PROVED {
        (row.limit(), false)
    } else {
        rays += rows::RAYS;
        let open = footprint.filter(|footprint| looks == Looks::FromFootprint && footprint.is_open());
        let spot = |i| open.as_ref().and_then(|footprint| footprint.spot(i)).unwrap_or((x, n, element.source));
        let seen = look_around(light, spot, seed, COVER * element.radius, is_own);
        (row.correction(&seen), seen.covered)
    };
    let irradiance = own[0] + kept[0] + (own[1] + kept[1] + (own[2] + kept[2] * inherited) * rest) * all;
    let [known, others] = reflected;
    let indirect = (known[1] + others[1] + (known[2] + others[2] * inherited) * rest) * all;
    let sight = (!near_senders.is_empty()).then_some(Sight { at: x, normal: n, senders: near_senders, negligible });
    Gathering { irradiance, indirect, rays, unseen_senders, covered, sight }
}

/// From where a vertex looks around.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Looks {
    FromVertex,
    /// From where the footprint is open. Of a rail along a table's edge a vertex may lie in the line in which both touch: rounding tells on
    /// which side of the table it is.
    FromFootprint,
}

/// Where the random numbers of a vertex begin: those of vertices in the same place, on both sides of a cut, are the same.
fn seed(position: Vec3) -> u32 {
    let [x, y, z] = position.to_array().map(f32::to_bits);
    hash(hash(hash(x, y), z), 0x51ed)
}

/// What links bring, with the visibility that they have.
#[derive(Clone, Copy, Debug, Default)]
struct Brought {
    irradiance: Rgb,
    /// Share of the view.
    share: f32,
    /// What of the irradiance has been reflected before.
    indirect: Rgb,
}

impl Brought {
    /// The series of [`Inherited`](crate::inherited::Inherited) may tell of less than nothing.
    fn bounded(self) -> Self {
        Self {
            irradiance: self.irradiance.max(Rgb::ZERO),
            share: self.share.max(0.0),
            indirect: self.indirect.max(Rgb::ZERO),
        }
    }
}

impl AddAssign for Brought {
    fn add_assign(&mut self, other: Self) {
        self.irradiance += other.irradiance;
        self.share += other.share;
        self.indirect += other.indirect;
    }
}

impl Mul<f32> for Brought {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self { irradiance: self.irradiance * factor, share: self.share * factor, indirect: self.indirect * factor }
    }
}

/// Whether vertices inherit what a link of a node brings, where the sender is far.
fn is_inherited<L: LightField>(light: Light<'_, L>, node: u32, spread: Spread) -> bool {
    spread == Spread::Plain || spread == Spread::Even && !light.element(node).is_flat()
}

/// Links of near senders that leaves inherit, by place among all.
struct Near {
    all: Vec<u32>,
    /// By node, where its own begin; and the end of the last.
    first: Vec<u32>,
}

impl Near {
    fn of(&self, leaf: u32) -> &[u32] {
        &self.all[self.first[leaf as usize] as usize..self.first[leaf as usize + 1] as usize]
    }
}

/// By vertex and group (the last two are one), what it inherits from afar; and what there is beside.
fn inherited<L: LightField>(
    light: Light<'_, L>,
    (links, spreads, shares): (&Links, &[Spread], &[f32]),
    (vertices, places, gathers): (&Vertices, &[Vec2], &impl Fn(u32) -> bool),
) -> (Vec<[Brought; 3]>, Near) {
    let brought = |(link, &spread): (&Link, &Spread)| {
        if !is_inherited(light, link.receiver, spread) {
            return Brought::default();
        }
        let irradiance = carried(light, link, spread);
        let indirect = irradiance * shares[link.sender as usize];
        Brought { irradiance, share: share(light, link, spread), indirect }
    };
    let mut carried = vec![Brought::default(); links.all().len()];
    threads::map_mut(&mut carried, 256, |at, carried| *carried = brought((&links.all()[at], &spreads[at])));
    let groups = threads::map(links.all(), 256, |link| Group::of(light, link.sender));
    let mut of_leaf: Vec<(u32, u32)> =
        vertices.leaf.iter().copied().zip(0..).filter(|&(_, vertex)| gathers(vertex)).collect();
    threads::sort_unstable(&mut of_leaf);
    let above = Above { links, spreads, groups: &groups, carried: &carried };
    let found = inherit(
        light,
        above,
        |node| light.elements.is_patch_leaf(node),
        |leaf, inherited| {
            let first = of_leaf.partition_point(|&(other, _)| other < leaf);
            let mine = of_leaf[first..].iter().take_while(|&&(other, _)| other == leaf);
            let at_vertex = |&(_, vertex): &(u32, u32)| {
                let (_, n) = point_on(light.scene, light.elements, leaf, places[vertex as usize]);
                let [lights, emitters, mut rest, faint] = inherited.afar(&Facing::single(n));
                rest += faint;
                (vertex, [lights, emitters, rest].map(Brought::bounded))
            };
            (mine.map(at_vertex).collect::<SmallVec<[_; 2]>>(), inherited.near().collect::<SmallVec<[u32; 8]>>())
        },
    );
    let mut from_afar = vec![[Brought::default(); 3]; vertices.positions.len()];
    let mut near = Near { all: Vec::new(), first: vec![0; light.elements.nodes.len() + 1] };
    for (leaf, (brought, links)) in found {
        near.first[leaf as usize + 1] = links.len() as u32;
        near.all.extend(links);
        for (vertex, brought) in brought {
            from_afar[vertex as usize] = brought;
        }
    }
    for node in 1..near.first.len() {
        near.first[node] += near.first[node - 1];
    }
    (from_afar, near)
}

/// What was gathered at a vertex; nothing where only black surfaces meet.
#[derive(Default)]
struct Gathering {
    irradiance: Rgb,
    /// What of it has been reflected before.
    indirect: Rgb,
    rays: u32,
    /// Senders of which it saw nothing.
    unseen_senders: u32,
    covered: bool,
    sight: Option<Sight>,
}

/// Light of one link at a vertex, unoccluded, and the share of the vertex's view that its sender takes up.
struct Arriving {
    irradiance: Rgb,
    share: f32,
    visibility: f32,
    sender: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::point_to_polygon;
    use crate::vertices::INSET;
    use crate::{DiffuseMaterial, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;
    use std::f32::consts::FRAC_1_PI;

    /// Below the ceiling of a unit room; its front faces down.
    const LAMP: [DVec3; 4] = [
        DVec3::new(0.3, 0.3, 0.99),
        DVec3::new(0.3, 0.7, 0.99),
        DVec3::new(0.7, 0.7, 0.99),
        DVec3::new(0.7, 0.3, 0.99),
    ];

    /// A solved room with a lamp. One side is open, so that nobody knows how much there is to see.
    fn room() -> Solver {
        let (x, y, z, o) = (DVec3::X, DVec3::Y, DVec3::Z, DVec3::ZERO);
        let quad = |o: DVec3, a: DVec3, b: DVec3| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), 0);
        let wall = DiffuseMaterial { reflectance: Rgb::splat(0.6), exitance: Rgb::ZERO, two_sided: false };
        let lamp = DiffuseMaterial { exitance: Rgb::ONE, ..wall };
        let surfaces = vec![
            quad(o, x, y),
            quad(z, y, x),
            quad(o, y, z),
            quad(x, z, y),
            quad(o, z, x),
            Surface::new(Shape::Quad(LAMP), 1),
        ];
        let input = SceneInput { surfaces, materials: vec![wall, lamp], ..SceneInput::default() };
        let mut solver = Solver::new(&input, Settings::with_error(0.05), ()).expect("the room is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        solver
    }

    fn vertices(solver: &Solver, links: &Links) -> Vertices {
        reconstruct(solver.light(), (links, None), (0.05, &|_| true), &mut |_| ControlFlow::Continue(())).0
    }

    /// Of what links say that it is hidden, and vertices see, they gather as much as of all else.
    #[test]
    fn vertices_look_closely_at_what_was_hidden_and_is_seen() {
        let solver = room();
        let hidden = solver.links.all().iter().map(|link| Link { visibility: 0.0, ..*link });
        let hidden = Links::new(hidden.collect(), solver.elements.nodes.len());
        let [right, found] = [&solver.links, &hidden].map(|links| vertices(&solver, links));
        let (mut off, mut all) = (0.0, 0.0);
        for (right, found) in right.irradiance.iter().zip(&found.irradiance) {
            (off, all) = (off + (found - right).abs().element_sum(), all + right.element_sum());
        }
        assert!(off < 0.02 * all, "off by {} of {all}", off / all);
    }

    /// All light but that is the lamp's own, and on the floor that is known.
    #[test]
    fn vertices_know_what_has_been_reflected() {
        let solver = room();
        let vertices = vertices(&solver, &solver.links);
        let lamp = LAMP.map(|corner| solver.scene.normalization.to_unit(corner));
        let (mut ours, mut right, mut reflected) = (0.0, 0.0, 0.0);
        for vertex in 0..vertices.positions.len() {
            if solver.elements.nodes[vertices.leaf[vertex] as usize].source == 0 {
                ours += (vertices.irradiance[vertex] - vertices.indirect[vertex]).x;
                right += point_to_polygon(vertices.positions[vertex], Vec3::Z, &lamp);
                reflected += vertices.indirect[vertex].x;
            }
        }
        assert!((ours / right - 1.0).abs() < 0.02, "{ours}, not {right}");
        assert!(reflected > 0.2 * right, "some is reflected: {reflected}");
    }

    /// Links that bring too little are noticed by the leaves' light, which vertices are made to agree with.
    #[test]
    fn vertices_agree_with_their_leaves() {
        let mut solver = room();
        let mean = |solver: &Solver, links: &Links| {
            let vertices = vertices(solver, links);
            // Not on the ceiling: right above the lamp, where there is no light, it is cut finely.
            let counts = |&(_, leaf): &(&Rgb, &u32)| solver.elements.nodes[*leaf as usize].source != 1;
            let counted = || vertices.irradiance.iter().zip(&vertices.leaf).filter(counts);
            counted().map(|(irradiance, _)| irradiance.x).sum::<f32>() / counted().count() as f32
        };
        let right = mean(&solver, &solver.links);
        let emits = |sender: u32| Group::of(solver.light(), sender) == Group::Emitter;
        let dimmed = solver.links.all().iter().map(|link| {
            let visibility = link.visibility * if emits(link.sender) { 1.0 } else { 0.6 };
            Link { visibility, ..*link }
        });
        let dimmed = Links::new(dimmed.collect(), solver.elements.nodes.len());
        let alone = mean(&solver, &dimmed);
        for (leaf, indirect) in solver.gather.indirect(solver.light(), &solver.links) {
            solver.exitant.indirect[leaf as usize] = indirect;
        }
        let agreed = mean(&solver, &dimmed);
        assert!(alone < 0.96 * right, "vertices themselves do not know: {alone} of {right}");
        assert!((agreed / right - 1.0).abs() < 0.3 * (1.0 - alone / right), "{agreed}, {alone} of {right}");
    }

    /// How far off (relative L1) the irradiance is once around a shape that is lit by a lamp, at a place along its profile; and how
    /// many leaves it has.
    fn off_around(shape: Shape, lamp: [DVec3; 4], along: f32) -> (f32, usize) {
        let material = |reflectance, exitance| DiffuseMaterial { reflectance, exitance, two_sided: false };
        let input = SceneInput {
            surfaces: vec![Surface::new(shape, 0), Surface::new(Shape::Quad(lamp), 1)],
            materials: vec![material(Rgb::splat(0.5), Rgb::ZERO), material(Rgb::ZERO, Rgb::ONE)],
            ..SceneInput::default()
        };
        let mut solver = Solver::new(&input, Settings::with_error(0.5), ()).expect("two surfaces");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let solution = solver.finish(&mut |_| ControlFlow::Continue(()));
        let is_lit = |leaf: &u32| solution.elements.nodes[*leaf as usize].source == 0;
        let leaves = solution.elements.patch_leaves().filter(is_lit).count();
        let lamp = lamp.map(|corner| solution.scene.normalization.to_unit(corner));
        let (mut off, mut all) = (0.0, 0.0);
        for k in 0..64 {
            let uv = Vec2::new((k as f32 + 0.5) / 64.0, along);
            let leaf = solution.elements.leaf_at(&solution.scene, 0, false, uv).expect("it reflects");
            let (at, normal) = point_on(&solution.scene, &solution.elements, leaf.0, uv);
            let right = point_to_polygon(at, normal, &lamp);
            off += (solution.irradiance(leaf, uv).x - right).abs();
            all += right;
        }
        (off / all, leaves)
    }

    /// A post beside a lamp is one element for what light it reflects, and dark behind.
    #[test]
    fn round_leaves_are_lit_on_the_side_of_the_lamp() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let lamp = [-y - z, z - y, y + z, y - z].map(|corner| 3.0 * x + corner);
        let post = Shape::Cone { ends: [-0.3 * z, 0.3 * z], radii: [0.1; 2] };
        let (off, leaves) = off_around(post, lamp, 0.5);
        assert!(leaves <= 2 && off < 0.08, "{leaves} leaves: off by {off}");
    }

    /// So is a plate, whose corners are but its centre and one point of its rim.
    #[test]
    fn plates_are_lit_on_the_side_of_the_lamp() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let lamp = [-y - z, z - y, y + z, y - z].map(|corner| x - y + 0.5 * z + 0.5 * corner);
        let plate = Shape::Ring { center: DVec3::ZERO, normal: z, inner: 0.0, outer: 0.3 };
        let (off, leaves) = off_around(plate, lamp, 0.9);
        assert!(leaves <= 2 && off < 0.08, "{leaves} leaves: off by {off}");
    }

    /// Along the straight edge of a shadow light is the same everywhere: no teeth.
    #[test]
    fn edges_of_shadows_are_straight() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let plate = |from: DVec3, to: DVec3| {
            let [a, b] = [DVec3::new(to.x, from.y, from.z), DVec3::new(from.x, to.y, from.z)];
            Shape::Quad([from, a, to, b])
        };
        let lamp = [-x - y, y - x, x + y, x - y].map(|corner| 0.01 * corner + 3.0 * z);
        let material = |reflectance, exitance| DiffuseMaterial { reflectance, exitance, two_sided: true };
        for edge in [0.3, 0.32, 0.34, 0.36, 0.38] {
            let input = SceneInput {
                surfaces: vec![
                    Surface::new(plate(-x - y, x + y), 0),
                    Surface::new(plate(-3.0 * x - 3.0 * y + z, 3.0 * x + edge * y + z), 0),
                    Surface::new(Shape::Quad(lamp), 1),
                ],
                materials: vec![material(Rgb::splat(0.5), Rgb::ZERO), material(Rgb::ZERO, Rgb::ONE)],
                ..SceneInput::default()
            };
            let mut solver = Solver::new(&input, Settings::with_error(0.05), ()).expect("a plate above a floor");
            solver.solve(&mut |_| ControlFlow::Continue(()));
            let solution = solver.finish(&mut |_| ControlFlow::Continue(()));
            let along = |v: f32| {
                let at = |k: u16| {
                    let uv = Vec2::new(0.3 + 0.4 * f32::from(k) / 100.0, v);
                    let leaf = solution.elements.leaf_at(&solution.scene, 0, false, uv).expect("it reflects");
                    (solution.irradiance(leaf, uv) - solution.indirect_irradiance(leaf, uv)).x
                };
                let light: Vec<f32> = (0..100).map(at).collect();
                let mean = light.iter().sum::<f32>() / 100.0;
                (mean, light.iter().map(|light| (light - mean).abs()).sum::<f32>() / 100.0)
            };
            let lines: Vec<(f32, f32)> = (0..80).map(|k| along(0.65 + 0.3 * f32::from(k as u8) / 80.0)).collect();
            let most = lines.iter().map(|line| line.0).fold(0.0, f32::max);
            let off = lines.iter().map(|line| line.1).fold(0.0, f32::max);
            assert!(lines.iter().any(|line| line.0 < 0.1 * most), "it is dark below the plate");
            assert!(off < 0.055 * most, "along some line light differs by {off} of {most}");
        }
    }

    /// However little of a room a rail is, it is dark below; what is too small to be seen is shown as it is.
    #[test]
    fn thin_rails_are_shown_in_parts() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let turns_of = |radius: f64| {
            let rail = Shape::Cone { ends: [-0.25 * x, 0.25 * x], radii: [radius; 2] };
            let ground = Shape::Quad([-x - y, x - y, x + y, y - x].map(|corner| corner * 20.0 - z));
            let material = |exitance| DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance, two_sided: false };
            let input = SceneInput {
                surfaces: vec![Surface::new(rail, 0), Surface::new(ground, 1)],
                materials: vec![material(Rgb::ZERO), material(Rgb::ONE)],
                ..SceneInput::default()
            };
            let mut solver = Solver::new(&input, Settings::with_error(0.5), ()).expect("a rail");
            solver.solve(&mut |_| ControlFlow::Continue(()));
            let vertices = solver.finish(&mut |_| ControlFlow::Continue(())).vertices;
            let on_rail = |at: &usize| vertices.normals[*at].x.abs() < 0.5 && vertices.normals[*at].z < 0.99;
            let turn = |at: usize| (vertices.normals[at].y.atan2(vertices.normals[at].z) * 100.0).round() as i32;
            let turns: std::collections::BTreeSet<i32> =
                (0..vertices.normals.len()).filter(on_rail).map(turn).collect();
            turns.len()
        };
        let [thick, thin, tiny] = [0.03, 0.01, 0.001].map(turns_of);
        assert!(thick >= 6 && thin >= 6 && tiny < 4, "they have {thick}, {thin} and {tiny} turns");
    }

    /// A rail along the edge of a table that hangs over it by next to nothing: where both touch the rail is as bright as beside that.
    #[test]
    fn rails_are_lit_where_they_touch_a_table() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let quad = |o: DVec3, a: DVec3, b: DVec3| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), 0);
        let lamp = [-y - x, y - x, x + y, x - y].map(|corner| 0.25 * corner + 1.3 * z);
        let material = |reflectance, exitance| DiffuseMaterial { reflectance, exitance, two_sided: true };
        for height in [0.3, 0.7, 0.77, 0.9, 1.1] {
            let rail = Shape::Cone { ends: [-0.5 * x + height * z, 0.5 * x + height * z], radii: [0.02; 2] };
            let plate = |above: f64| quad(-0.5 * x - 1e-4 * y + (height + above) * z, x, y * 0.4);
            let input = SceneInput {
                surfaces: vec![
                    Surface::new(rail, 0),
                    plate(0.02 + 1e-6),
                    plate(-0.02),
                    Surface::new(Shape::Quad(lamp.map(|corner| corner + height * z)), 1),
                ],
                materials: vec![material(Rgb::splat(0.5), Rgb::ZERO), material(Rgb::ZERO, Rgb::ONE)],
                ..SceneInput::default()
            };
            let mut solver = Solver::new(&input, Settings::with_error(0.2), ()).expect("a table");
            solver.solve(&mut |_| ControlFlow::Continue(()));
            let solution = solver.finish(&mut |_| ControlFlow::Continue(()));
            let vertices = &solution.vertices;
            let above = |&at: &usize| {
                let on_rail = solution.elements.nodes[vertices.leaf[at] as usize].source == 0;
                on_rail && vertices.normals[at].z > 0.999
            };
            let along: Vec<f32> =
                (0..vertices.positions.len()).filter(above).map(|at| vertices.irradiance[at].x).collect();
            let [least, most] = [f32::min, f32::max].map(|of| along.iter().copied().reduce(of).expect("some vertex"));
            assert!(least > 0.6 * most, "from {least} to {most} along the rail at {height}");
        }
    }

    /// A wall sees mostly what is next to it of a floor, which is dark there and bright below a lamp farther on.
    #[test]
    fn corners_are_lit_by_what_is_next_to_them() {
        const STEPS: u32 = 200;
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let quad = |o: DVec3, a: DVec3, b: DVec3| Shape::Quad([o, o + a, o + a + b, o + b]);
        let lamp = [(0.7, 0.4), (0.7, 0.6), (0.9, 0.6), (0.9, 0.4)].map(|(x, y)| DVec3::new(x, y, 0.4));
        let material = |reflectance, exitance| DiffuseMaterial {
            reflectance: Rgb::splat(reflectance),
            exitance: Rgb::splat(exitance),
            two_sided: false,
        };
        let shapes = [quad(DVec3::ZERO, x, y), quad(DVec3::ZERO, y, z), Shape::Quad(lamp)];
        let input = SceneInput {
            surfaces: shapes.into_iter().zip(0..).map(|(shape, material)| Surface::new(shape, material)).collect(),
            materials: vec![material(0.8, 0.0), material(0.001, 0.0), material(0.0, 1.0)],
            ..SceneInput::default()
        };
        let mut solver = Solver::new(&input, Settings::with_error(0.3), ()).expect("three surfaces");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let solution = solver.finish(&mut |_| ControlFlow::Continue(()));
        let vertices = &solution.vertices;
        let to_unit = |at: DVec3| solution.scene.normalization.to_unit(at);
        let (lamp, area) = (lamp.map(to_unit), to_unit(x).distance(to_unit(DVec3::ZERO)).powi(2));
        let mut floor = Vec::new();
        for i in 0..STEPS * STEPS {
            let uv = (Vec2::new((i % STEPS) as f32, (i / STEPS) as f32) + 0.5) / STEPS as f32;
            let at = to_unit(uv.as_dvec2().extend(0.0));
            floor.push((at, 0.8 * point_to_polygon(at, Vec3::Z, &lamp)));
        }
        // What is reflected to a vertex of the wall, a little inside of it: ours, and the sum over small parts of the floor.
        let nodes = &solution.elements.nodes;
        let gathered = |uv: Vec2| {
            let on_wall = |&at: &usize| nodes[vertices.leaf[at] as usize].source == 1 && vertices.uv[at] == uv;
            let vertex = (0..vertices.positions.len()).find(on_wall).expect("the wall reflects a little");
            let middle = nodes[vertices.leaf[vertex] as usize].center;
            let (at, normal) = (vertices.positions[vertex].lerp(middle, INSET), vertices.normals[vertex]);
            let from = |&(from, sent): &(Vec3, f32)| {
                let to = from - at;
                let distance2 = to.length_squared();
                sent * to.dot(normal).max(0.0) * (-to.z).max(0.0) / (distance2 * distance2)
            };
            let right = floor.iter().map(from).sum::<f32>() * area * FRAC_1_PI / floor.len() as f32;
            [vertices.indirect[vertex].x, right]
        };
        let [corner, middle] = [Vec2::ZERO, Vec2::splat(0.5)].map(gathered);
        // How bright both are together is what the wall's element says.
        let [ours, right] = [0, 1].map(|k| corner[k] / middle[k]);
        assert!((ours / right - 1.0).abs() < 0.1, "the corner has {ours} of the middle's light, not {right}");
    }
}

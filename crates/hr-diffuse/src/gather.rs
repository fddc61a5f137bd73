//! Gather: every receiver adds up what its links carry.

use crate::Rgb;
use crate::calibrate::{Expected, calibrate};
use crate::effort::Aim;
use crate::faint::Grazing;
use crate::hierarchy::{Elements, Kind};
use crate::hooks::{LightField, NodeId, Transfer};
use crate::inherited::Carried;
use crate::kept_weights::KeptWeights;
use crate::leaf_rows::balance;
use crate::links::{Link, Links};
use crate::places::Places;
use crate::push::{self, Push, Spread, Weight, visible};
use crate::reflect::Sends;
use crate::residual::Brought;
use crate::shooting::Shot;
use crate::threads;
use crate::transport::Light;
use glam::{Vec2, Vec3};
use std::ops::ControlFlow;

/// Links that a thread evaluates between two calls of `watch`: about a millisecond.
const BETWEEN_WATCHES: usize = 1 << 14;

/// Bytes that are kept for each link, …
pub(crate) const LINK_BYTES: usize = size_of::<Rgb>() + size_of::<Group>() + push::LINK_BYTES;
/// … and for each node as much as leaves have: what arrives by group while it is summed up, and the rows.
pub(crate) const NODE_BYTES: usize = size_of::<[Rgb; GROUPS]>() + size_of::<[f32; GROUPS]>() + push::LEAF_BYTES;

/// Whose light it is: rows of form factors treat them differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Group {
    /// Lights without extent: no part of the view.
    Light,
    /// Parts of surfaces that emit: links to them are fine, since they are bright.
    Emitter,
    /// Other parts of surfaces, and clusters.
    Rest,
    /// What arrives through links that leaves do not look at closely.
    Faint,
}

/// How many there are.
pub(crate) const GROUPS: usize = 4;

/// Where nothing but senders is seen form factors sum to 1; but for rounding.
const CLOSED: f32 = 0.999;
/// Clusters that emit more than this share of their power count as emitters.
const MOSTLY: f32 = 0.5;

impl Group {
    /// That of a sender.
    pub(crate) fn of<L: LightField>(light: Light<'_, L>, sender: u32) -> Self {
        let element = light.element(sender);
        match element.kind {
            Kind::Light => Self::Light,
            Kind::Front if light.scene.materials[element.material as usize].exitance != Rgb::ZERO => Self::Emitter,
            Kind::Cluster | Kind::Front | Kind::Back => Self::Rest,
        }
    }

    /// That of a link, by the power that is emitted below each node.
    fn of_link<L: LightField>(light: Light<'_, L>, emitted: &[f32], link: &Link, spread: Spread) -> Self {
        let (sender, area) = (link.sender as usize, light.element(link.sender).area);
        match Self::of(light, link.sender) {
            Self::Rest if emitted[sender] > MOSTLY * light.exitant.radiosity[sender].element_sum() * area => {
                Self::Emitter
            }
            Self::Rest if spread != Spread::Exact && push::is_shared(light, link.receiver) => Self::Faint,
            group => group,
        }
    }
}

/// What arrives through the links of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gather {
    /// By link.
    groups: Vec<Group>,
    push: Push,
    /// By place, as in `push`: what makes the sum of its form factors what it should be, by group.
    rows: Vec<[f32; GROUPS]>,
    /// By place of many leaves, in an enclosure: how much the sum of its form factors, which should be the same everywhere, seems to
    /// change over it per unit of length, over the share of all but emitters, which it is put down to; nowhere on it by more than all of
    /// that.
    tilts: Vec<Vec3>,
    /// By link: the area that it lights, times what lets its light through, all places together. Where an extension takes part, else
    /// nothing.
    lit: Vec<f32>,
    /// By link, [`directional_toward`](Light::directional_toward) its receiver, as long as its sender sends the same. Where an extension
    /// takes part, else nothing.
    directional: Vec<Rgb>,
    /// Irradiance by link.
    arriving: Vec<Rgb>,
}

impl Gather {
    /// Prepares for a set of links; see [`Push::new`].
    pub(crate) fn new<L: LightField>(
        light: Light<'_, L>,
        links: &Links,
        aim: Option<Aim>,
        (room, known): (u64, Option<&KeptWeights>),
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Self {
        let push = Push::new(light, links, aim, (room, known), watch);
        let emitted = light.emitted_power();
        let groups = by_link(links, &push.spreads, |link, spread| Group::of_link(light, &emitted, link, spread));
        let mut gather = Self { groups, push, ..Self::default() };
        gather.balance(light, links, aim.is_some());
        gather
    }

    /// Finds weights anew where light comes from other parts of senders than when they were found: by node, so much of it is `uneven`.
    /// Returns the number of places, and of rays.
    pub(crate) fn renew<L: LightField>(
        &mut self,
        light: Light<'_, L>,
        links: &Links,
        uneven: &[f32],
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> (u64, u64) {
        let before = self.push.rays;
        let renewed = self.push.renew(light, links, (uneven, &self.directional), watch);
        if renewed > 0 {
            self.balance(light, links, true);
        }
        (renewed, self.push.rays - before)
    }

    /// Makes the rows of form factors, which are what would arrive of unit radiosity, sum to what they should; with a `look` whether that
    /// is all there is to see.
    fn balance<L: LightField>(&mut self, light: Light<'_, L>, links: &Links, look: bool) {
        let Self { push, groups, .. } = &*self;
        let each = by_link(links, &push.spreads, |link, spread| share(light, link, spread));
        let sums = push.sums(light, links, (groups, &each)).into_iter();
        let shares = sums.map(|[_, shares @ ..]| shares.map(|share| share.max(0.0)));
        let shares: Vec<[f32; GROUPS - 1]> = shares.collect();
        let rows = balance(light, &push.places.nodes, (&shares, &push.dim_views), look);
        let slopes = push.slopes(light, links, (groups, &each), &rows);
        let tilt = |(slope, index): ([f32; 3], usize)| {
            let [emitters, rest @ ..]: [f32; GROUPS - 1] =
                std::array::from_fn(|i| shares[index][i] * rows[index][i + 1]);
            let rest: f32 = rest.iter().sum();
            let closed = emitters + rest > CLOSED && rest > 0.0;
            // Where emitters are nearly all that is seen, what they change by is more than all the rest.
            let most = light.element(push.places.nodes[index]).radius.max(f32::MIN_POSITIVE).recip();
            if closed { (Vec3::from(slope) / rest).clamp_length_max(most) } else { Vec3::ZERO }
        };
        let tilts = slopes.into_iter().zip(push.places.joined()).map(tilt).collect();
        (self.rows, self.tilts) = (rows, tilts);
        if light.element(0).active {
            self.lit = self.lit_areas(light, links);
        }
    }

    /// The number of places that reflect any light.
    pub(crate) fn reflecting_places<L: LightField>(&self, light: Light<'_, L>) -> usize {
        self.push.places.nodes.iter().filter(|&&place| light.element(place).importance > 0.0).count()
    }

    /// Compares what arrives of reflected light with what so many rays find, and makes it so; returns the number of rays.
    pub(crate) fn calibrate<L: LightField>(
        &mut self,
        light: Light<'_, L>,
        links: &Links,
        rays: usize,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> u64 {
        let expected = self.expected(light, links);
        // Of what is diffuse rays all over the hemisphere know as much.
        let brought = if light.element(0).active { Brought::known(light, links, &self.arriving) } else { None };
        let reflectances = self.reflectances(light, links);
        let Some((factors, rays)) = calibrate(light, (&expected, &reflectances), brought.as_ref(), rays, watch) else {
            return 0;
        };
        for ((row, factor), expected) in self.rows.iter_mut().zip(factors).zip(expected) {
            if expected.mean > 0.0 {
                row[Group::Rest as usize] *= factor;
                row[Group::Faint as usize] *= factor;
            }
        }
        rays
    }

    /// Whether it was prepared for these links.
    pub(crate) fn is_for(&self, links: &Links) -> bool {
        !self.push.places.nodes.is_empty() && self.groups.len() == links.all().len()
    }

    /// By leaf, what arrives there of light that has been reflected.
    pub(crate) fn indirect<L: LightField>(&self, light: Light<'_, L>, links: &Links) -> Vec<(u32, Rgb)> {
        let shares = light.reflected_shares();
        let indirect = |link: &Link, spread| carried(light, link, spread) * shares[link.sender as usize];
        let on_leaves = self.on_leaves(light, links, &self.carried(links, indirect));
        on_leaves.into_iter().map(|(leaf, indirect)| (leaf, indirect.max(Rgb::ZERO))).collect()
    }

    /// By place, what rays from there are expected to find of light that has been reflected.
    pub(crate) fn expected<L: LightField>(&self, light: Light<'_, L>, links: &Links) -> Vec<Expected> {
        let shares = light.reflected_shares();
        let reflected = self
            .carried(links, |link, spread| carried(light, link, spread).element_sum() * shares[link.sender as usize]);
        // Light e through a share f of the view is read by that share of all rays, and is e / f then.
        let mut squares = self.carried(links, |link, spread| share(light, link, spread));
        for (square, reflected) in squares.iter_mut().zip(&reflected) {
            *square = if *square > 0.0 { reflected * reflected / *square } else { 0.0 };
        }
        let [means, squares] = [reflected, squares].map(|carried| self.on_places(light, links, &carried));
        let expected = |(&place, (mean, square))| Expected { place, mean, square };
        self.push.places.nodes.iter().zip(means.into_iter().zip(squares)).map(expected).collect()
    }

    /// By place, what share of the light there what is seen reflects, nodes by their largest channels.
    pub(crate) fn reflectances<L: LightField>(&self, light: Light<'_, L>, links: &Links) -> Vec<f32> {
        let nodes = &light.elements.nodes;
        let mut means = vec![0.0_f32; nodes.len()];
        for (node, element) in nodes.iter().enumerate().rev() {
            let is_leaf = element.child_count == 0;
            let power = if is_leaf { element.importance * element.area } else { means[node] };
            means[node] = if element.area > 0.0 { power / element.area } else { 0.0 };
            if node > 0 {
                means[element.parent as usize] += power;
            }
        }
        let mut seen = self.weigh(light, links, |sender| means[sender as usize]);
        for (seen, all) in seen.iter_mut().zip(self.weigh(light, links, |_| 1.0)) {
            // Links to clusters may together be more than all there is to see.
            *seen /= all.max(1.0);
        }
        seen
    }

    /// By place, the sum of what `of` says of senders with extent, times form factors and visibility.
    pub(crate) fn weigh<L: LightField>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        of: impl Fn(u32) -> f32 + Sync,
    ) -> Vec<f32> {
        let carried = self.carried(links, |link, spread| match light.element(link.sender).kind {
            Kind::Light => 0.0,
            Kind::Cluster | Kind::Front | Kind::Back => link.factor * visible(link, spread) * of(link.sender),
        });
        self.on_places(light, links, &carried)
    }

    /// By place, what arrives there of what links carry.
    fn on_places<L: LightField>(&self, light: Light<'_, L>, links: &Links, carried: &[f32]) -> Vec<f32> {
        let sums = self.push.sums(light, links, (&self.groups, carried));
        let brought = |(sums, rows): ([f32; GROUPS], &[f32; GROUPS])| {
            let sum: f32 = sums.iter().zip(rows).map(|(sum, factor)| sum * factor).sum();
            sum.max(0.0)
        };
        sums.into_iter().zip(&self.rows).map(brought).collect()
    }

    /// By link, what it carries as `of` says.
    fn carried<T: Carried>(&self, links: &Links, of: impl Fn(&Link, Spread) -> T + Sync) -> Vec<T> {
        by_link(links, &self.push.spreads, of)
    }

    /// By leaf, what arrives there of what links carry.
    fn on_leaves<L: LightField, T: Carried>(&self, light: Light<'_, L>, links: &Links, carried: &[T]) -> Vec<(u32, T)> {
        let links_of = (self.groups.as_slice(), carried);
        let (sums, mut slopes) =
            (self.push.sums(light, links, links_of), self.push.slopes(light, links, links_of, &self.rows));
        let counted = |index: usize, group: usize| sums[index][group] * self.rows[index][group];
        for ((slope, tilt), index) in slopes.iter_mut().zip(&self.tilts).zip(self.push.places.joined()) {
            let mut rest = counted(index, Group::Rest as usize);
            rest += counted(index, Group::Faint as usize);
            slope.iter_mut().zip(tilt.to_array()).for_each(|(slope, tilt)| *slope += rest * -tilt);
        }
        let mut leaves = Vec::new();
        self.push.places.each_leaf(light.elements, |leaf, index, joined| {
            let mut sum = T::default();
            (0..GROUPS).for_each(|group| sum += counted(index, group));
            if let Some((joined, from_middle)) = joined {
                slopes[joined].iter().zip(from_middle.to_array()).for_each(|(&slope, by)| sum += slope * by);
            }
            leaves.push((leaf, sum));
        });
        leaves
    }

    /// See [`Push::grafted`].
    pub(crate) fn grafted(&mut self) {
        self.push.grafted();
    }

    /// See [`Push::looked_at`].
    pub(crate) fn looked_at(&self, elements: &Elements, place: u32) -> (Vec<(usize, Weight)>, Option<f32>) {
        self.push.looked_at(elements, place)
    }

    /// What a part of a place, so far from its middle, has of a link's light over what it brings to its receiver, if the place looked for itself.
    pub(crate) fn brought(
        &self,
        elements: &Elements,
        (index, from_middle): (usize, Vec3),
        (receiver, at): (u32, usize),
    ) -> Option<f32> {
        let weight = self.push.weight_of(elements, index, (receiver, at))?;
        Some(weight.looked(from_middle)? * self.rows[index][weight.group(self.groups[at]) as usize])
    }

    /// How a link's light is spread over what lies below its receiver.
    pub(crate) fn spread(&self, at: usize) -> Spread {
        self.push.spreads[at]
    }

    /// What links deliver: [`lit`](Self::lit).
    fn lit_areas<L: LightField>(&self, light: Light<'_, L>, links: &Links) -> Vec<f32> {
        let nodes = &light.elements.nodes;
        let mut lit = vec![0.0; links.all().len()];
        // By node and group: area of the places below, times what lets light through.
        let mut open = vec![[0.0; GROUPS]; nodes.len()];
        for (index, &place) in self.push.places.nodes.iter().enumerate() {
            let row = self.rows[index].map(|factor| factor * light.element(place).area);
            self.push.each_weight(light, links, index, |at, weight| {
                lit[at] += weight.value * row[weight.group(self.groups[at]) as usize];
            });
            open[place as usize] = row;
        }
        for node in (1..nodes.len()).rev() {
            let below = open[node];
            let above = &mut open[nodes[node].parent as usize];
            above.iter_mut().zip(below).for_each(|(above, below)| *above += below);
        }
        for (at, (link, &spread)) in links.all().iter().zip(&self.push.spreads).enumerate() {
            let receiver = light.element(link.receiver);
            let oriented = match spread {
                Spread::Exact => lit[at],
                Spread::Even => open[link.receiver as usize][self.groups[at] as usize],
                Spread::Plain => {
                    let direction = light.direction_to(receiver.center, link.sender);
                    open[link.receiver as usize][self.groups[at] as usize] * receiver.mean_cosine(direction)
                }
            };
            lit[at] = oriented * visible(link, spread);
        }
        lit
    }

    /// By link: the area that it lights, times what lets its light through; nothing where no extension takes part.
    pub(crate) fn lit(&self) -> &[f32] {
        &self.lit
    }

    /// Links that leaves do not look at closely, though they are for more than one leaf.
    pub(crate) fn faint_links(&self) -> u64 {
        self.push.faint_links
    }

    /// Looks at links from places that were spared, as others were drawn by chance.
    pub(crate) fn spared_looks(&self) -> u64 {
        self.push.spared_looks
    }

    /// Looks that saw nothing of a sender, so that what it would bring was not found out.
    pub(crate) fn unseen_senders(&self) -> u64 {
        self.push.unseen_senders
    }

    /// Where light arrives.
    pub(crate) fn places(&self) -> &Places {
        &self.push.places
    }

    /// Rays shot for places and their weights.
    pub(crate) fn rays(&self) -> u64 {
        self.push.rays
    }

    /// Bytes of what is kept and can be had anew: weights, and what links carry of an extension's light.
    pub(crate) fn kept_bytes(&self) -> u64 {
        self.push.weight_bytes() + size_of_val(self.directional.as_slice()) as u64
    }

    /// Forgets what senders send: they send something else now.
    pub(crate) fn forget_directional(&mut self) {
        self.directional.clear();
    }

    /// By link, what its sender sends of an extension's light.
    pub(crate) fn directional(&self) -> &[Rgb] {
        &self.directional
    }

    /// Asks senders what they send over their links: all of them where it is not known for these links, else those that
    /// send something else now. What comes over a link in proportion to what came is known without. Returns the number of links over
    /// which they need not be asked.
    pub(crate) fn ask<L: LightField>(
        &mut self,
        light: Light<'_, L>,
        links: &Links,
        sends: impl Fn(u32) -> Sends + Sync,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<(), u64> {
        if !light.element(0).active {
            return ControlFlow::Continue(0);
        }
        let knows = self.directional.len() == links.all().len();
        self.directional.resize(links.all().len(), Rgb::ZERO);
        let chunk = BETWEEN_WATCHES / 16 * threads::current_num_threads();
        for (directional, links) in self.directional.chunks_mut(chunk).zip(links.all().chunks(chunk)) {
            if watch().is_break() {
                self.forget_directional();
                return ControlFlow::Break(());
            }
            threads::map_mut(directional, 64, |at, directional| match sends(links[at].sender) {
                Sends::Same if knows => (),
                Sends::InProportion(times) if knows => *directional *= times,
                _ => *directional = light.directional_toward(links[at].sender, links[at].receiver),
            });
        }
        let steady = |link: &&Link| knows && light.element(link.sender).active && sends(link.sender) != Sends::Else;
        ControlFlow::Continue(links.all().iter().filter(steady).count() as u64)
    }

    /// Evaluates all links, of those that `shot` says only for what has not been shot yet, and lets the extension receive what
    /// they carry.
    pub(crate) fn gather<L: LightField>(
        &mut self,
        light: Light<'_, L>,
        links: &Links,
        shot: Option<&Shot>,
        incident: &mut [L::Incident],
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let chunk = BETWEEN_WATCHES * threads::current_num_threads();
        self.ask(light, links, |_| Sends::Same, watch)?;
        let mut arriving = std::mem::take(&mut self.arriving);
        arriving.resize(links.all().len(), Rgb::ZERO);
        for (i, irradiances) in arriving.chunks_mut(chunk).enumerate() {
            if watch().is_break() {
                return ControlFlow::Break(());
            }
            threads::map_mut(irradiances, 256, |j, irradiance| {
                let at = i * chunk + j;
                let directional = self.directional.get(at).copied().unwrap_or_default();
                *irradiance = passed(light, &links.all()[at], (self.push.spreads[at], directional), shot);
            });
        }
        self.arriving = arriving;
        self.receive(light, links, &self.arriving, incident, watch)
    }

    /// What each link carries: where light is shot, in all once that has ended, and till then what it carried last.
    pub(crate) fn arriving(&self) -> &[Rgb] {
        &self.arriving
    }

    /// Takes it that each link carries so much.
    pub(crate) fn know_arriving(&mut self, carried: Vec<Rgb>) {
        self.arriving = carried;
    }

    /// Hands what each link carries to the extension, on active receivers, in place of what they had received.
    pub(crate) fn receive<L: LightField>(
        &self,
        light: Light<'_, L>,
        links: &Links,
        arriving: &[Rgb],
        incident: &mut [L::Incident],
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if !light.element(0).active {
            return ControlFlow::Continue(());
        }
        let chunk = BETWEEN_WATCHES / 16 * threads::current_num_threads();
        for (i, incident) in incident.chunks_mut(chunk).enumerate() {
            if watch().is_break() {
                return ControlFlow::Break(());
            }
            threads::map_mut(incident, 64, |j, incident| {
                let node = (i * chunk + j) as u32;
                let element = light.element(node);
                if !element.active {
                    return;
                }
                light.field.clear(incident);
                for at in links.range(node) {
                    // Where light is shot, rounding may leave less than nothing.
                    let (sender, irradiance) = (links.all()[at].sender, arriving[at].max(Rgb::ZERO));
                    if irradiance.max_element() > 0.0 {
                        let direction = light.direction_to(element.center, sender);
                        let oriented = element.is_flat();
                        let transfer = Transfer { sender: NodeId(sender), direction, irradiance, oriented };
                        light.field.receive(incident, &transfer);
                    }
                }
            });
        }
        ControlFlow::Continue(())
    }

    /// By leaf, how many times the mean its material reflects beside the diffuse part of what links brought there.
    pub(crate) fn grazing<L: LightField>(
        &self,
        light: Light<'_, L>,
        (links, brought): (&Links, &[Rgb]),
        grazing: &Grazing,
    ) -> Vec<(u32, f32)> {
        let weighed = threads::map_range(0..links.all().len(), 256, |at| {
            let (link, arriving) = (&links.all()[at], brought[at].element_sum().max(0.0));
            let receiver = light.element(link.receiver);
            let direction = light.direction_to(receiver.center, link.sender);
            let knows = receiver.is_patch() && receiver.is_flat();
            let times =
                if knows { grazing.times(receiver.material, direction.dot(receiver.normals.axis)) } else { 1.0 };
            Vec2::new(arriving, arriving * times)
        });
        let times = |sum: Vec2| if sum.x > 0.0 { (sum.y / sum.x).max(0.0) } else { 1.0 };
        self.on_leaves(light, links, &weighed).into_iter().map(|(leaf, sum)| (leaf, times(sum))).collect()
    }

    /// Irradiance of all leaves.
    pub(crate) fn push<L: LightField>(&self, light: Light<'_, L>, links: &Links) -> Vec<(u32, Rgb)> {
        self.on_leaves(light, links, &self.arriving)
    }
}

/// Irradiance that a link carries.
pub(crate) fn carried<L: LightField>(light: Light<'_, L>, link: &Link, spread: Spread) -> Rgb {
    passed(light, link, (spread, light.directional_toward(link.sender, link.receiver)), None)
}

/// The same where the sender's directional light is known, or what it carries of light that has not been shot yet.
fn passed<L: LightField>(
    light: Light<'_, L>,
    link: &Link,
    (spread, directional): (Spread, Rgb),
    shot: Option<&Shot>,
) -> Rgb {
    let visible = link.factor * visible(link, spread);
    if visible <= 0.0 || shot.is_some_and(|shot| !shot.shoots[link.sender as usize]) {
        return Rgb::ZERO;
    }
    let direction = light.direction_to(light.element(link.receiver).center, link.sender);
    let before = shot.map_or(Rgb::ZERO, |shot| shot.emitted(light, link.sender, -direction));
    (light.emitted_with(link, directional) - before) * visible
}

/// By link, what `of` says.
fn by_link<T: Send>(links: &Links, spreads: &[Spread], of: impl Fn(&Link, Spread) -> T + Sync) -> Vec<T> {
    threads::map_range(0..links.all().len(), 256, |at| of(&links.all()[at], spreads[at]))
}

/// What a link carries of unit radiosity, from senders that have any.
pub(crate) fn share<L: LightField>(light: Light<'_, L>, link: &Link, spread: Spread) -> f32 {
    let sender = light.element(link.sender);
    if light.emitted_most(link.sender) <= 0.0 {
        return 0.0;
    }
    let visible = link.factor * visible(link, spread);
    if sender.kind != Kind::Cluster {
        return visible;
    }
    let direction = light.direction_to(light.element(link.receiver).center, link.sender);
    visible * sender.mean_cosine(-direction)
}

#[cfg(test)]
mod tests {
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;
    use std::f64::consts::TAU;
    use std::ops::ControlFlow;

    /// A bowl of small polygons under a sky of exitance 1, grey outside and inside.
    fn bowl_under_the_sky() -> SceneInput {
        let (rings, sectors) = (8, 48);
        let at = |ring: i32, sector: i32| {
            let (r, angle) = (f64::from(ring + 1) / f64::from(rings), TAU * f64::from(sector) / f64::from(sectors));
            DVec3::new(r * angle.cos(), 0.2 * r * r, -r * angle.sin())
        };
        let quad = |ring, sector| {
            let corners = [at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1), at(ring, sector + 1)];
            Surface::new(Shape::Quad(corners), 0)
        };
        let bowl = (0..rings - 1).flat_map(|ring| (0..sectors).map(move |sector| quad(ring, sector)));
        let sky = Surface { flip: true, ..Surface::new(Shape::Sphere { center: DVec3::ZERO, radius: 10.0 }, 1) };
        let grey = DiffuseMaterial { reflectance: Rgb::splat(0.8), exitance: Rgb::ZERO, two_sided: true };
        let shining = DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::ONE, two_sided: false };
        SceneInput { surfaces: bowl.chain([sky]).collect(), materials: vec![grey, shining], ..SceneInput::default() }
    }

    /// What emitters that are nearly all there is to see change by over a place is not put down to the little that there is besides.
    #[test]
    fn no_part_of_a_place_has_less_than_nothing() {
        let mut solver = Solver::new(&bowl_under_the_sky(), Settings::with_error(0.05), ()).expect("the bowl is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let gather = &solver.gather;
        let places = gather.push.places.joined();
        assert!(places.len() > 4, "{} places of many leaves", places.len());
        let most = places.iter().zip(&gather.tilts).map(|(&index, tilt)| {
            let radius = solver.elements.nodes[gather.push.places.nodes[index] as usize].radius;
            tilt.length() * radius
        });
        let most = most.fold(0.0, f32::max);
        assert!(most > 0.0 && most <= 1.001, "the rest changes by {most} of itself");
        for leaf in solver.elements.patch_leaves() {
            let irradiance = solver.exitant.irradiance[leaf as usize].max_element();
            assert!((0.0..1.02).contains(&irradiance), "{irradiance} under a sky of 1");
        }
    }
}

//! Shooting: only light that has not been shot yet travels (paper, section 3.4).
//!
//! A node's *unshot* light is what it emits beyond what it did when its light was last carried over its links. Its links carry
//! that, and what arrives is added to what there is. So the light over each link adds up to what gathering would carry
//! at last, whatever the iterations before it did, and a node next to all of whose light is shot waits.
//!
//! Where an extension takes part, light can't be taken back: samples are not negative. So as soon as its light is reflected,
//! each set of links begins without any light, and each iteration is one reflection more: a node's incident light is the
//! paper's set `new`, made anew in each iteration, and its exitant light holds what was reflected exactly so many times. The
//! set `accum` is the sum of what each link carried. It has one sample for each link rather than one for each link
//! and iteration, and is reflected once when light has settled.

use crate::clock::Instant;
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::links::Links;
use crate::reflect::Reflect;
use crate::sent::Sent;
use crate::solver::{Solver, Transport};
use crate::transport::Light;
use crate::{Facing, Rgb};
use glam::Vec3;
use std::ops::ControlFlow;

/// Nodes wait while their unshot light is less than this share of the error asked for, relative to all their light, and to what
/// the reflections to come would make of it: half of what light may be from settled.
const UNSHOT_SHARE: f32 = 0.01;
/// New light on a leaf is reflected by the extension unless it is below this share of the error asked for, relative to all that
/// has arrived, and to what the reflections to come would make of it.
pub(crate) const NEW_SHARE: f32 = 0.25;
/// However slowly light settles, it is not known better.
const SLOWEST: f32 = 0.999;

/// Bytes that are kept for each link, …
pub(crate) const LINK_BYTES: usize = size_of::<Rgb>();
/// … and for each node.
pub(crate) const NODE_BYTES: usize = size_of::<Facing>() + 3 * size_of::<Rgb>() + size_of::<bool>();

/// What has been shot over the links that there are, since light last began to settle.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shot {
    /// By node: radiosity (intensity of lights) when it last was shot, …
    radiosity: Vec<Rgb>,
    /// … and how it was directed.
    facing: Vec<Facing>,
    /// By node: whether it has unshot light that counts.
    pub(crate) shoots: Vec<bool>,
    /// By leaf: irradiance received so far.
    received: Vec<Rgb>,
    /// By leaf: irradiance received in this iteration, not negative.
    pub(crate) new: Vec<Rgb>,
    /// By link: irradiance carried so far.
    carried: Vec<Rgb>,
    /// By leaf: irradiance before all light was shot anew, if it was; else nothing.
    before: Vec<Rgb>,
}

impl Shot {
    /// Nothing, over so many links between so many nodes.
    fn nothing(nodes: usize, links: usize) -> Self {
        Self {
            radiosity: vec![Rgb::ZERO; nodes],
            facing: vec![Facing::ZERO; nodes],
            shoots: vec![false; nodes],
            received: vec![Rgb::ZERO; nodes],
            new: vec![Rgb::ZERO; nodes],
            carried: vec![Rgb::ZERO; links],
            before: Vec::new(),
        }
    }

    /// Finds the nodes whose unshot light is more than a share of all their light, and those above them.
    pub(crate) fn choose<L: LightField>(&mut self, light: Light<'_, L>, share: f32) {
        self.shoots.fill(false);
        for node in (0..light.elements.nodes.len()).rev() {
            let now = diffuse(light, node);
            let unshot = (now - self.radiosity[node]).abs().max_element().max(light.directional_most(node as u32));
            let all = now.max_element() + light.exitant.directional[node].max_element();
            self.shoots[node] |= unshot > share * all;
            if self.shoots[node] && node > 0 {
                self.shoots[light.elements.nodes[node].parent as usize] = true;
            }
        }
    }

    /// What a sender that has unshot light emitted in a direction when it last was shot: the diffuse part, which is
    /// in [`Light::emitted`] as a whole.
    pub(crate) fn emitted<L: LightField>(&self, light: Light<'_, L>, sender: u32, away: Vec3) -> Rgb {
        let pattern = match light.element(sender).kind {
            Kind::Cluster => self.facing[sender as usize].mean_cosine(away),
            Kind::Light | Kind::Front | Kind::Back => 1.0,
        };
        self.radiosity[sender as usize] * pattern
    }

    /// Takes note that the links carried the unshot light. Returns the number of those that did not need to.
    pub(crate) fn note<L: LightField>(&mut self, light: Light<'_, L>, links: &Links, arriving: &[Rgb]) -> u64 {
        for node in (0..self.shoots.len()).filter(|&node| self.shoots[node]) {
            self.radiosity[node] = diffuse(light, node);
            self.facing[node] = light.exitant.facing[node];
        }
        for (sum, more) in self.carried.iter_mut().zip(arriving) {
            *sum += more;
        }
        links.all().iter().filter(|link| !self.shoots[link.sender as usize]).count() as u64
    }

    /// By link, the irradiance carried so far.
    pub(crate) fn carried(&self) -> &[Rgb] {
        &self.carried
    }

    /// Adds what a leaf received. Returns what it received in all.
    pub(crate) fn receive(&mut self, leaf: u32, more: Rgb) -> Rgb {
        self.new[leaf as usize] = more.max(Rgb::ZERO);
        self.received[leaf as usize] += more;
        self.received[leaf as usize].max(Rgb::ZERO)
    }
}

/// What a node emits now: radiosity, or intensity of a light.
fn diffuse<L: LightField>(light: Light<'_, L>, node: usize) -> Rgb {
    let element = &light.elements.nodes[node];
    match element.kind {
        Kind::Light => light.scene.lights[element.source as usize].intensity,
        Kind::Cluster | Kind::Front | Kind::Back => light.exitant.radiosity[node],
    }
}

impl<L: LightField> Solver<L> {
    /// Begins to shoot all the light that there is; where the extension is to reflect it, that is what surfaces emit. Then
    /// returns the extension's exitant light before.
    pub(crate) fn begin_shooting(&mut self, reflects: bool) -> Option<Vec<L::Exitant>> {
        if self.settings.transport != Transport::Shoot {
            return None;
        }
        let mut reflected = None;
        let nodes = self.elements.nodes.len();
        let mut shot = Shot::nothing(nodes, self.links.all().len());
        if reflects && self.elements.nodes[0].active {
            shot.before = std::mem::replace(&mut self.exitant.irradiance, vec![Rgb::ZERO; nodes]);
            let none = std::iter::repeat_with(L::Exitant::default).take(nodes).collect();
            reflected = Some(std::mem::replace(&mut self.reflected, none));
            self.gather.forget_directional();
            self.pull();
        }
        self.shot = Some(shot);
        reflected
    }

    /// Ends it: the extension gets all that was shot, and reflects it once. Light that did not settle is no less than it was
    /// before; where nothing was shot, `reflected` is what the extension had made before.
    pub(crate) fn finish_shooting(
        &mut self,
        reflects: bool,
        settled: bool,
        reflected: Option<Vec<L::Exitant>>,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) {
        let Some(shot) = self.shot.take().filter(|_| self.elements.nodes[0].active) else { return };
        if let Some(reflected) = reflected {
            (self.exitant.irradiance, self.reflected) = (shot.before, reflected);
            self.gather.forget_directional();
            return self.pull();
        }
        if !settled {
            for (now, before) in self.exitant.irradiance.iter_mut().zip(&shot.before) {
                *now = now.max(*before);
            }
        }
        let start = Instant::now();
        let mut incident = std::mem::take(&mut self.incident);
        let whole = &mut || ControlFlow::Continue(());
        let received = self.gather.receive(self.light(), &self.links, &shot.carried, &mut incident, whole);
        debug_assert!(received.is_continue(), "nobody breaks");
        self.incident = incident;
        self.gather.know_arriving(shot.carried);
        let middle = Instant::now();
        if reflects {
            self.sent.iter_mut().for_each(Sent::forget);
            self.reflect_senders(Reflect::Reshaped, watch);
        }
        self.pull();
        self.stats.seconds.transport += (middle - start).as_secs_f64();
        self.stats.seconds.reflect += middle.elapsed().as_secs_f64();
    }

    /// Share of a node's light below which it need not be shot.
    pub(crate) fn negligibly_unshot(&self) -> f32 {
        UNSHOT_SHARE * self.settings.tolerance() * self.lost()
    }

    /// Share of a leaf's light below which what is new of it need not be reflected by the extension.
    pub(crate) fn negligibly_new(&self) -> f32 {
        NEW_SHARE * self.settings.tolerance() * self.lost()
    }

    /// What is lost with each reflection, as a share: the reciprocal of what all reflections to come make of light.
    fn lost(&self) -> f32 {
        // Light settles at the rate of the last iterations, and no faster than what is reflected on average. What is new is told as a share of
        // all light, which grows by it.
        let rate = |pair: &[f32]| pair[1] / (pair[0] * (1.0 - pair[1]));
        let last = &self.stats.residuals[self.stats.residuals.len().saturating_sub(3)..];
        let last = last.windows(2).map(rate).filter(|rate| rate.is_finite()).fold(0.0, f32::max);
        1.0 - last.max(self.elements.nodes[0].reflectance.max_element()).min(SLOWEST)
    }
}

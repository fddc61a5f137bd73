//! Edits of light and paint, and lamps one by one: the links stay, light only settles anew.
//!
//! What is costly about a solution, the hierarchy, links, visibility and what leaves see of senders, depends on geometry.
//! So when lamps are dimmed or surfaces painted, [`Solver::relight`] iterates over the links that there are; and since light
//! adds up, [`Solver::each_lamp`] finds that of every lamp alone, of which [`Solver::mix`] makes that of any mixture.
//!
//! Links are as fine as the light needed for which they were made. So make them while all lamps are on, as bright as they
//! will be, and nothing is darker than it will be; what has no links at all because it was black or dark is refused.

use crate::error::SolveError;
use crate::hierarchy::{Elements, Kind, SceneData};
use crate::hooks::LightField;
use crate::reflect::Reflect;
use crate::sent::Sent;
use crate::solver::{Phase, Progress, Solver, check, unit_lights};
use crate::stats::Stats;
use crate::transport::Exitant;
use crate::{Light, LightKind, Rgb, SceneInput, Transport};
use std::f32::consts::PI;
use std::ops::ControlFlow;

/// Lights that are switched together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lamp {
    /// Materials that emit.
    pub materials: Vec<u32>,
    /// Indices of lights without extent.
    pub lights: Vec<u32>,
}

/// The light of lamps, one by one.
#[derive(Clone, Debug)]
pub struct Variants {
    lamps: Vec<Lamp>,
    /// By lamp, then by node.
    irradiance: Vec<Vec<Rgb>>,
    /// By material and by light: what they emit at full power.
    exitance: Vec<Rgb>,
    intensity: Vec<Rgb>,
}

impl Variants {
    /// The lamps.
    #[must_use]
    pub fn lamps(&self) -> &[Lamp] {
        &self.lamps
    }

    /// Irradiance (W/m²) of every node by one of the lamps alone, at full power.
    #[must_use]
    pub fn irradiance(&self, lamp: usize) -> &[Rgb] {
        &self.irradiance[lamp]
    }
}

/// What was there when links were made, which decides what has any.
#[derive(Clone, Debug, Default)]
pub(crate) struct Linked {
    /// By material: whether it reflected, whether it emitted.
    materials: Vec<[bool; 2]>,
    /// By light: whether it was on.
    lights: Vec<bool>,
}

impl<L: LightField> Solver<L> {
    /// Geometry and rays, in unit space.
    #[must_use]
    pub fn scene(&self) -> &SceneData {
        &self.scene
    }

    /// The element hierarchy as it is now.
    #[must_use]
    pub fn elements(&self) -> &Elements {
        &self.elements
    }

    /// The extension.
    #[must_use]
    pub fn field(&self) -> &L {
        &self.field
    }

    /// The light as it is now, by node.
    #[must_use]
    pub fn exitant(&self) -> &Exitant {
        &self.exitant
    }

    /// Work done and avoided so far.
    #[must_use]
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    /// What has links.
    pub(crate) fn linked(&self) -> Linked {
        let has = |(m, material): (usize, &crate::DiffuseMaterial)| {
            let glossy = self.field.active(m as u32).unwrap_or(Rgb::ZERO);
            [(material.reflectance + glossy).max_element() > 0.0, material.exitance != Rgb::ZERO]
        };
        Linked {
            materials: self.scene.materials.iter().enumerate().map(has).collect(),
            lights: self.scene.lights.iter().map(|light| light.intensity != Rgb::ZERO).collect(),
        }
    }

    /// Takes over other reflectances, exitances and intensities, and lets light settle over the links that there are. `input`
    /// is the scene as it was, but for those; its geometry is not looked at. `field` takes the extension's place where what it
    /// reflects has changed. `watch` is told how far it is, and may break: then the light is what there is by then.
    ///
    /// # Errors
    /// [`SolveError::Edit`] for what needs new links, and what [`Solver::new`] says of a scene; nothing has changed then.
    pub fn relight(
        &mut self,
        input: &SceneInput,
        field: Option<L>,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<(), SolveError> {
        self.can_take(input, field.as_ref(), false)?;
        let emitted = self.emitted();
        let lights = unit_lights(input, &self.scene.normalization)?;
        let before = (
            std::mem::replace(&mut self.scene.materials, input.materials.clone()),
            std::mem::replace(&mut self.scene.lights, lights),
            std::mem::replace(&mut self.scene.texture, input.texture.clone()),
        );
        let extra = |material| field.as_ref().unwrap_or(&self.field).active(material);
        if let Err(error) = crate::steady::check(&self.scene, |material| extra(material).unwrap_or(Rgb::ZERO)) {
            (self.scene.materials, self.scene.lights, self.scene.texture) = before;
            return Err(error);
        }
        self.elements.repaint(&self.scene, extra);
        if let Some(field) = field {
            self.field = field;
            self.sort_materials();
            // All that was reflected was reflected by the old one.
            self.sent.iter_mut().for_each(Sent::forget);
        }
        let times = ratio(self.emitted(), emitted);
        self.exitant.irradiance.iter_mut().for_each(|irradiance| *irradiance *= times);
        self.settle_anew(watch);
        Ok(())
    }

    /// Every material that emits and every light as a lamp of its own.
    #[must_use]
    pub fn lamps(&self) -> Vec<Lamp> {
        let materials = (0..self.scene.materials.len() as u32)
            .filter(|&m| self.scene.materials[m as usize].exitance != Rgb::ZERO)
            .map(|material| Lamp { materials: vec![material], ..Lamp::default() });
        let lights = (0..self.scene.lights.len() as u32)
            .filter(|&l| self.scene.lights[l as usize].intensity != Rgb::ZERO)
            .map(|light| Lamp { lights: vec![light], ..Lamp::default() });
        materials.chain(lights).collect()
    }

    /// The light of each lamp alone, all others being off. The solver is left with all of them on, as before. Once `watch`
    /// breaks, what is left is less exact.
    ///
    /// # Errors
    /// [`SolveError::Mix`] where a lamp has a material or a light that is not there.
    pub fn each_lamp(
        &mut self,
        lamps: &[Lamp],
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Variants, SolveError> {
        let (materials, lights) = (self.scene.materials.len(), self.scene.lights.len());
        let is_there = |lamp: &Lamp| {
            lamp.materials.iter().all(|&m| (m as usize) < materials)
                && lamp.lights.iter().all(|&l| (l as usize) < lights)
        };
        if !lamps.iter().all(is_there) {
            return Err(SolveError::Mix { what: "one has a material or a light that is not there; they count from 0" });
        }
        let before = self.exitant.irradiance.clone();
        let mut variants = Variants {
            lamps: lamps.to_vec(),
            irradiance: Vec::with_capacity(lamps.len()),
            exitance: self.scene.materials.iter().map(|material| material.exitance).collect(),
            intensity: self.scene.lights.iter().map(|light| light.intensity).collect(),
        };
        let emitted = self.emitted();
        let mut colors = vec![Rgb::ZERO; lamps.len()];
        for lamp in 0..lamps.len() {
            colors[lamp] = Rgb::ONE;
            self.switch(&variants, &colors);
            let share = ratio(self.emitted(), emitted);
            self.exitant.irradiance = before.iter().map(|irradiance| *irradiance * share).collect();
            self.settle_anew(watch);
            variants.irradiance.push(self.exitant.irradiance.clone());
            colors[lamp] = Rgb::ZERO;
        }
        for (material, &exitance) in self.scene.materials.iter_mut().zip(&variants.exitance) {
            material.exitance = exitance;
        }
        for (light, &intensity) in self.scene.lights.iter_mut().zip(&variants.intensity) {
            light.intensity = intensity;
        }
        self.exitant.irradiance = before;
        self.settle_anew(watch);
        Ok(variants)
    }

    /// Makes the light of a mixture: each lamp times a colour of its own, ≥ 0, with 1 for full power. Diffuse light is the sum of
    /// that of the lamps, at once; where an extension takes part it settles from there. Lights that are no part of any lamp
    /// are off.
    ///
    /// # Errors
    /// [`SolveError::Mix`] where there are not as many colours as lamps, one is negative or not finite, or the lamps are
    /// those of another solver; nothing has changed then.
    pub fn mix(
        &mut self,
        variants: &Variants,
        colors: &[Rgb],
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<(), SolveError> {
        let refused = |what| Err(SolveError::Mix { what });
        if colors.len() != variants.lamps.len() {
            return refused("there must be one colour for each lamp");
        }
        if colors.iter().any(|color| !color.is_finite() || color.min_element() < 0.0) {
            return refused("colours must be finite and not negative");
        }
        let nodes = self.elements.nodes.len();
        let fits = variants.exitance.len() == self.scene.materials.len()
            && variants.intensity.len() == self.scene.lights.len()
            && variants.irradiance.iter().all(|irradiance| irradiance.len() == nodes);
        if !fits {
            return refused("they are those of another solver or of older links; find the light of each lamp again");
        }
        self.switch(variants, colors);
        for (node, irradiance) in self.exitant.irradiance.iter_mut().enumerate() {
            *irradiance = variants.irradiance.iter().zip(colors).map(|(lamp, color)| lamp[node] * *color).sum();
        }
        if self.elements.nodes[0].active {
            self.settle_anew(watch);
        } else {
            self.pull();
        }
        Ok(())
    }

    /// What all that shines emits (powers, of which only ratios count): as that changes, so does light, roughly.
    fn emitted(&self) -> Rgb {
        let fronts = self.elements.patch_leaves().map(|leaf| &self.elements.nodes[leaf as usize]);
        let fronts = fronts.filter(|element| element.kind == Kind::Front);
        let surfaces = fronts.map(|front| self.scene.materials[front.material as usize].exitance * front.area);
        let lights = self.scene.lights.iter().map(|light| light.intensity * (4.0 * PI));
        surfaces.chain(lights).sum()
    }

    /// Lets each lamp shine in a colour, and nothing else.
    fn switch(&mut self, variants: &Variants, colors: &[Rgb]) {
        self.scene.materials.iter_mut().for_each(|material| material.exitance = Rgb::ZERO);
        self.scene.lights.iter_mut().for_each(|light| light.intensity = Rgb::ZERO);
        for (lamp, color) in variants.lamps.iter().zip(colors) {
            for &material in &lamp.materials {
                self.scene.materials[material as usize].exitance += variants.exitance[material as usize] * *color;
            }
            for &light in &lamp.lights {
                self.scene.lights[light as usize].intensity += variants.intensity[light as usize] * *color;
            }
        }
    }

    /// Iterates until light has settled, over the links that there are.
    fn settle_anew(&mut self, watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>) {
        let mut stopped = false;
        if self.stats.iterations > 0 {
            self.stats.residuals.clear();
            self.stats.error = None;
            self.restart();
            if self.settings.transport == Transport::Gather {
                // The extension's light has changed as that which arrives.
                let progress = self.progress(Phase::Transport, 0.0);
                self.reflect_senders(Reflect::InProportion, &mut || {
                    stopped = stopped || watch(&progress).is_break();
                    if stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                });
            }
        }
        self.pull();
        if self.stats.iterations > 0 {
            self.settle_again(&mut stopped, watch);
        }
        self.stats.stopped = stopped;
    }

    /// Whether a scene differs from this one by what links do not depend on, or also by where lights are where these may move.
    pub(crate) fn can_take(&self, input: &SceneInput, field: Option<&L>, moves: bool) -> Result<(), SolveError> {
        check(input)?;
        let refused = |what, index| Err(SolveError::Edit { what, index });
        let surfaces: Vec<u32> = input.surfaces.iter().map(|surface| surface.material).collect();
        if surfaces.len() != self.scene.surface_materials.len() || input.materials.len() != self.scene.materials.len() {
            return refused("surfaces or materials were added or removed, first of all surface", 0);
        }
        if let Some(surface) = (0..surfaces.len()).find(|&s| surfaces[s] != self.scene.surface_materials[s]) {
            return refused("it has another material now: surface", surface);
        }
        for (m, (new, old)) in input.materials.iter().zip(&self.scene.materials).enumerate() {
            let extra = |field: &L| field.active(m as u32);
            let (before, now) = (extra(&self.field), field.map_or_else(|| extra(&self.field), extra));
            let [reflected, emitted] = self.linked.materials[m];
            if new.two_sided != old.two_sided {
                return refused("its back has become another one: material", m);
            }
            if before.is_some() != now.is_some() {
                return refused("the extension takes part in it, or does no longer: material", m);
            }
            if !reflected && (new.reflectance + now.unwrap_or(Rgb::ZERO)).max_element() > 0.0 {
                return refused("it was black when links were made: material", m);
            }
            if !emitted && new.exitance != Rgb::ZERO {
                return refused("it did not emit when links were made: material", m);
            }
        }
        if input.lights.len() != self.scene.lights.len() {
            return refused("lights were added or removed, first of all light", 0);
        }
        for (l, (new, old)) in input.lights.iter().zip(&self.scene.lights).enumerate() {
            if !moves && !is_same(new, old) {
                return refused("it has another place, direction or cone now: light", l);
            }
            if !self.linked.lights[l] && new.intensity != Rgb::ZERO {
                return refused("it was off when links were made: light", l);
            }
        }
        Ok(())
    }
}

/// `a` over `b` by channel, 1 where that is nothing.
pub(crate) fn ratio(a: Rgb, b: Rgb) -> Rgb {
    let ratio = a / b;
    Rgb::select(ratio.is_finite_mask(), ratio, Rgb::ONE)
}

/// Whether two lights differ in intensity only.
fn is_same(a: &Light, b: &Light) -> bool {
    let is_distant = matches!(a.kind, LightKind::Directional { .. });
    a.kind == b.kind && (is_distant || a.position == b.position)
}

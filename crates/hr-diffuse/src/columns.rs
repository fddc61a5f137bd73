//! Column sums: the directional light that a sender's links carry away is no more than it has.
//!
//! A link evaluates its sender's distribution in a few directions, which stand for all that its receiver takes up. Where a
//! lobe is narrower than that, links in its middle carry more power than the whole lobe has, and two mirrors that face each
//! other would light each other up without end. So what the links of a sender carry is added up and scaled down to what it
//! leaves to be reflected.

use crate::Rgb;
use crate::hooks::LightField;
use crate::links::Links;
use crate::transport::Light;

/// Of what a leaf does not reflect diffusely, links may carry so much as directional light at first. What the links of a
/// sender carry errs either way; to cut it off at what is right on average would lose light.
pub(crate) const FREELY: f32 = 1.4;
/// With this, light dies out in any scene.
pub(crate) const STRICTLY: f32 = 0.9;
/// Where light went on growing, it is also no more than this times what an extension's mean albedo makes of what arrives: from some
/// directions more is reflected than from others.
const MOST_GAIN: f32 = 1.15;

/// By node: the factor, at most 1, for the directional light of all its links, which was made of this irradiance of leaves. `directional` is
/// the light that each asks for, `lit` the area that each link lights, times what lets its light through; `most`, by leaf, what its links may carry.
pub(crate) fn gains<L: LightField>(
    light: Light<'_, L>,
    links: &Links,
    (directional, lit): (&[Rgb], &[f32]),
    most: &[f32],
    irradiance: &[Rgb],
) -> Vec<f32> {
    let nodes = &light.elements.nodes;
    let mut carried = vec![0.0_f32; nodes.len()];
    for ((link, directional), lit) in links.all().iter().zip(directional).zip(lit) {
        carried[link.sender as usize] += directional.max(Rgb::ZERO).element_sum() * link.factor * lit;
    }
    // What each node has, from its leaves up.
    let mut power = vec![0.0_f32; nodes.len()];
    for (node, element) in nodes.iter().enumerate().rev() {
        if element.active && element.is_patch() && element.child_count == 0 {
            let rest = Rgb::ONE - element.reflectance;
            let albedo = light.field.active(element.material).unwrap_or(Rgb::ZERO);
            let glossy = if most[node] < FREELY { rest.min(MOST_GAIN * albedo) } else { rest };
            power[node] = most[node] * (irradiance[node] * glossy).element_sum() * element.area;
        }
        if node > 0 {
            power[element.parent as usize] += power[node];
        }
    }
    // Shares of it that the links of a node and of its ancestors carry, and the most of that over the leaves below.
    let mut share = vec![0.0_f32; nodes.len()];
    for (node, element) in nodes.iter().enumerate() {
        let own = if power[node] > 0.0 { carried[node] / power[node] } else { 0.0 };
        share[node] = own + if node > 0 { share[element.parent as usize] } else { 0.0 };
    }
    for node in (1..nodes.len()).rev() {
        let parent = nodes[node].parent as usize;
        share[parent] = share[parent].max(share[node]);
    }
    share.into_iter().map(|share| share.max(1.0).recip()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::tests::Echo;
    use crate::{DiffuseMaterial, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;
    use std::ops::ControlFlow;

    const DIFFUSE: f32 = 0.7;
    const GLOSSY: f32 = 0.1;

    /// What links carry is cut to what is not reflected diffusely, loosely; where light went on growing to what can be reflected at all.
    #[test]
    fn links_carry_no_more_than_there_is() {
        let square = |o: DVec3, a: DVec3, b: DVec3| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), 0);
        let surfaces = vec![square(DVec3::ZERO, DVec3::X, DVec3::Y), square(DVec3::Z, DVec3::Y, DVec3::X)];
        let material = DiffuseMaterial { reflectance: Rgb::splat(DIFFUSE), exitance: Rgb::ONE, two_sided: false };
        let input = SceneInput { surfaces, materials: vec![material], ..SceneInput::default() };
        let field = Echo { material: 0, albedo: GLOSSY, errs: false };
        let mut solver = Solver::new(&input, Settings::with_error(0.2), field).expect("the scene is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let (light, count) = (solver.light(), solver.elements.nodes.len());
        let irradiance = vec![Rgb::ONE; count];
        let directional = vec![Rgb::ONE; solver.links.all().len()];
        let lit: Vec<f32> = solver.links.all().iter().map(|link| light.element(link.receiver).area).collect();
        // Of unit irradiance, what leaves may send by directional light, as seen by the one that is cut most.
        let allowed = |most: f32| {
            let of = |share: f32| {
                let carried: Vec<Rgb> = directional.iter().map(|light| *light * share).collect();
                let gains = gains(light, &solver.links, (&carried, &lit), &vec![most; count], &irradiance);
                gains.into_iter().fold(1.0, f32::min)
            };
            // All is cut in proportion, once it is.
            let cut = of(1e3);
            assert!((of(2e3) / cut - 0.5).abs() < 1e-3, "cut in proportion");
            assert_eq!(of(1e-6), 1.0, "next to nothing is not cut");
            cut
        };
        let (freely, reined) = (allowed(FREELY), allowed(STRICTLY));
        let exact = STRICTLY * MOST_GAIN * GLOSSY / (FREELY * (1.0 - DIFFUSE));
        assert!((reined / freely - exact).abs() < 1e-3, "{reined} and {freely}");
    }
}

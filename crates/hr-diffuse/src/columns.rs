//! Column sums: the directional light that a sender's links carry away is no more than it has.
//!
//! A link evaluates its sender's distribution in a few directions, which stand for all that its receiver takes up. Where a
//! lobe is narrower than that, links in its middle carry more power than the whole lobe has, and two mirrors that face each
//! other would light each other up without end. So what the links of a sender carry is added up and scaled down to what it
//! leaves to be reflected. What others beside it carry too little makes up for that: between two polished walls, where light goes to
//! and fro twenty times, all that is lost on the way is lost twenty times.

use crate::Rgb;
use crate::hierarchy::Element;
use crate::hooks::LightField;
use crate::links::Links;
use crate::transport::Light;

/// Of what a leaf does not reflect diffusely, links may carry so much as directional light at first. What the links of a
/// sender carry errs either way; to cut it off at what is right on average would lose light.
pub(crate) const FREELY: f32 = 1.4;
/// With this, light dies out in nearly any scene; where it does not, [`feedback`](crate::feedback) lets less of what arrives count.
pub(crate) const STRICTLY: f32 = 0.9;
/// Where light went on growing, it is also no more than this times what an extension's mean albedo makes of what arrives: from some
/// directions more is reflected than from others.
const MOST_GAIN: f32 = 1.15;
/// What is cut off is made up for by no more than this.
const MOST_MADE_UP: f32 = 1.5;

/// By node: the factor for the directional light of all its links, which was made of this irradiance of leaves. `directional` is
/// the light that each asks for, `lit` the area that each link lights, times what lets its light through; `most`, by leaf, what its links may carry; `albedos`,
/// by material, what of what arrives leaves as directional light.
pub(crate) fn gains<L: LightField>(
    light: Light<'_, L>,
    links: &Links,
    (directional, lit): (&[Rgb], &[f32]),
    most: &[f32],
    (irradiance, albedos): (&[Rgb], &[Rgb]),
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
    // Shares of it that the links of a node and of its ancestors carry, the mean over the leaves below: what is too much for one leaf,
    // another has left. Were it the most, a single leaf would take from what is carried of all the others.
    let mut share = vec![0.0_f32; nodes.len()];
    for (node, element) in nodes.iter().enumerate() {
        let own = if power[node] > 0.0 { carried[node] / power[node] } else { 0.0 };
        share[node] = own + if node > 0 { share[element.parent as usize] } else { 0.0 };
    }
    let mut together = vec![0.0_f32; nodes.len()];
    for (node, element) in nodes.iter().enumerate().rev() {
        if element.child_count == 0 {
            together[node] = share[node] * power[node];
        } else if power[node] > 0.0 {
            share[node] = together[node] / power[node];
        }
        if node > 0 {
            together[element.parent as usize] += together[node];
        }
    }
    let mut gains: Vec<f32> = share.into_iter().map(|share| share.max(1.0).recip()).collect();
    let sent = |leaf: usize| irradiance[leaf] * albedos[nodes[leaf].material as usize];
    make_up(nodes, &carried, most, sent, &mut gains);
    gains
}

/// Raises gains by what was cut off too much. What the links of a node and of all below it carry together errs less than what those of
/// each do: as far as it is no more than these have, nothing should be lost of it. What is cut off of one leaf its nearest neighbours
/// make up for; those whose light went on growing have no part in it. Leaves have `sent` so much as directional light (W/m²).
fn make_up(nodes: &[Element], carried: &[f32], most: &[f32], sent: impl Fn(usize) -> Rgb, gains: &mut [f32]) {
    let mut sums = vec![Sums { carried: 0.0, cut: 0.0, power: 0.0, is_reined: false }; nodes.len()];
    let mut times = vec![1.0_f32; nodes.len()];
    for (node, element) in nodes.iter().enumerate().rev() {
        sums[node].carried += carried[node];
        sums[node].cut += carried[node] * gains[node];
        if element.active && element.is_patch() && element.child_count == 0 {
            sums[node].power = sent(node).element_sum() * element.area;
            sums[node].is_reined = most[node] < FREELY;
        }
        let Sums { carried, cut, power, is_reined } = sums[node];
        if cut > 0.0 && !is_reined {
            times[node] = (carried.min(power) / cut).clamp(1.0, MOST_MADE_UP);
            sums[node].cut *= times[node];
        }
        if node > 0 {
            let (of, above) = (sums[node], &mut sums[element.parent as usize]);
            // Of what a leaf carries its neighbours may lack something.
            above.carried += if element.child_count == 0 { of.carried } else { of.carried.min(of.power.max(of.cut)) };
            above.cut += of.cut;
            above.power += of.power;
            above.is_reined |= of.is_reined;
        }
    }
    for (node, element) in nodes.iter().enumerate().skip(1) {
        times[node] = (times[node] * times[element.parent as usize]).min(MOST_MADE_UP);
        gains[node] *= times[node];
    }
}

/// Of a node and all below it.
#[derive(Clone, Copy)]
struct Sums {
    /// What links carry, and what is left of it.
    carried: f32,
    cut: f32,
    /// What is reflected as directional light.
    power: f32,
    /// Whether light went on growing there.
    is_reined: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::links::Link;
    use crate::skips::tests::Echo;
    use crate::{DiffuseMaterial, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;
    use std::ops::ControlFlow;

    const DIFFUSE: f32 = 0.7;
    const GLOSSY: f32 = 0.1;

    /// A floor and a ceiling that send as directional light what they reflect of unit irradiance.
    fn solver() -> Solver<Echo> {
        let square = |o: DVec3, a: DVec3, b: DVec3| Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), 0);
        let surfaces = vec![square(DVec3::ZERO, DVec3::X, DVec3::Y), square(DVec3::Z, DVec3::Y, DVec3::X)];
        let material = DiffuseMaterial { reflectance: Rgb::splat(DIFFUSE), exitance: Rgb::ONE, two_sided: false };
        let input = SceneInput { surfaces, materials: vec![material], ..SceneInput::default() };
        let field = Echo { material: 0, albedo: GLOSSY, errs: false };
        let mut solver = Solver::new(&input, Settings::with_error(0.2), field).expect("the scene is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        solver
    }

    /// The area that each link lights.
    fn lit(solver: &Solver<Echo>) -> Vec<f32> {
        solver.links.all().iter().map(|link| solver.elements.nodes[link.receiver as usize].area).collect()
    }

    /// What links carry is cut to what is not reflected diffusely, loosely; where light went on growing to what can be reflected at all.
    #[test]
    fn links_carry_no_more_than_there_is() {
        let solver = solver();
        let (light, count) = (solver.light(), solver.elements.nodes.len());
        let irradiance = vec![Rgb::ONE; count];
        let directional = vec![Rgb::ONE; solver.links.all().len()];
        let albedos = [Rgb::splat(GLOSSY)];
        let lit = lit(&solver);
        // Of unit irradiance, what leaves may send by directional light, as seen by the one that is cut most.
        let allowed = |most: f32| {
            let of = |share: f32| {
                let carried: Vec<Rgb> = directional.iter().map(|light| *light * share).collect();
                let gains = gains(light, &solver.links, (&carried, &lit), &vec![most; count], (&irradiance, &albedos));
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

    /// What the links of one leaf carry too much is cut off of them, not of what is carried of all leaves around it together.
    #[test]
    fn one_leaf_does_not_take_from_all() {
        let solver = solver();
        let (light, nodes) = (solver.light(), &solver.elements.nodes);
        let is_leaf = |part: u32| nodes[part as usize].child_count == 0;
        let divided = |element: &Element| {
            let mut parts = element.first_child..element.first_child + element.child_count;
            element.is_patch() && !parts.is_empty() && parts.all(is_leaf)
        };
        let whole = nodes.iter().position(divided).expect("floor or ceiling are divided");
        let leaf = nodes[whole].first_child as usize;
        let link = |sender: usize| Link { receiver: 0, sender: sender as u32, factor: 1.0, visibility: 1.0 };
        let links = Links::new(vec![link(leaf), link(whole)], nodes.len());
        // Twice what the leaf has, of a whole that has four times as much; what that sends is little.
        let has = FREELY * (1.0 - DIFFUSE) * nodes[leaf].area;
        let carries = |link: &Link| Rgb::X * 3.0 * has * if link.sender as usize == leaf { 2.0 } else { 0.1 };
        let directional: Vec<Rgb> = links.all().iter().map(carries).collect();
        let (irradiance, most) = (vec![Rgb::ONE; nodes.len()], vec![FREELY; nodes.len()]);
        let gains = gains(light, &links, (&directional, &[1.0; 2]), &most, (&irradiance, &[Rgb::splat(GLOSSY)]));
        assert!(gains[leaf] < 0.8, "{}", gains[leaf]);
        assert!(gains[whole] >= 1.0, "{}", gains[whole]);
    }

    /// What is cut off of one leaf is sent by its neighbours, as far as they have it, and not where light went on growing.
    #[test]
    fn neighbours_make_up_for_what_is_cut_off() {
        let solver = solver();
        let nodes = &solver.elements.nodes;
        let leaves = |node: &Element| {
            let four = (node.child_count == 4).then(|| [0, 1, 2, 3].map(|part| (node.first_child + part) as usize))?;
            (node.is_patch() && four.iter().all(|&part| nodes[part].child_count == 0)).then_some(four)
        };
        let [one, others @ ..] = nodes.iter().find_map(leaves).expect("floor or ceiling are divided");
        // Each of the four has light of 1; what is left of what all of them carry, where as much as a leaf may freely send is left of what the first does.
        let left = |first: f32, other: f32, most: f32| {
            let (mut carried, mut gains) = (vec![0.0; nodes.len()], vec![1.0; nodes.len()]);
            (carried[one], gains[one]) = (first, FREELY / first);
            others.iter().for_each(|&part| carried[part] = other);
            let is_leaf = |node: usize| nodes[node].child_count == 0;
            let all_most: Vec<f32> = (0..nodes.len()).map(|node| if is_leaf(node) { most } else { FREELY }).collect();
            let sent = |_| Rgb::new(nodes[one].area.recip(), 0.0, 0.0);
            make_up(nodes, &carried, &all_most, sent, &mut gains);
            gains.iter().zip(&carried).map(|(gain, carried)| gain * carried).sum::<f32>()
        };
        for (name, found, expected) in [
            ("all that was cut off", left(2.0, 0.2, FREELY), 2.6),
            ("no more than there is", left(4.0, 0.7, FREELY), 4.0),
            ("not without bound", left(3.9, 0.0, FREELY), FREELY * MOST_MADE_UP),
            ("nothing where light went on growing", left(2.0, 0.2, STRICTLY), 2.0),
        ] {
            assert!((found - expected).abs() < 1e-3, "{name}: {found} instead of {expected}");
        }
    }
}

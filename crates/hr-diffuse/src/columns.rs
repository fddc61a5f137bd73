//! Column sums: the directional light that a sender's links carry away is no more than it has.
//!
//! A link evaluates its sender's distribution in one direction, which stands for all that its receiver takes up. Where a
//! lobe is narrower than that, links in its middle carry more power than the whole lobe has, and two mirrors that face each
//! other would light each other up without end. So what the links of a sender carry is added up and scaled down to what it
//! leaves to be reflected.

use crate::Rgb;
use crate::hooks::LightField;
use crate::links::{Link, Links};
use crate::threads::prelude::*;
use crate::transport::Light;

/// Of what a leaf reflects as directional light, links may carry so much at first. What the links of a sender carry errs
/// either way; to cut it off at what is right on average would lose light.
pub(crate) const FREELY: f32 = 1.75;
/// With this, light dies out in any scene.
pub(crate) const STRICTLY: f32 = 0.9;

/// By node: the factor, at most 1, for the directional light of all its links, which was made of this irradiance of leaves.
pub(crate) fn gains<L: LightField>(light: Light<'_, L>, links: &Links, most: f32, irradiance: &[Rgb]) -> Vec<f32> {
    let nodes = &light.elements.nodes;
    let mut carried = vec![0.0_f32; nodes.len()];
    let powers: Vec<f32> = links.all().par_iter().with_min_len(256).map(|link| power(light, link)).collect();
    for (link, power) in links.all().iter().zip(powers) {
        carried[link.sender as usize] += power;
    }
    // What each node has, from its leaves up.
    let mut power = vec![0.0_f32; nodes.len()];
    for (node, element) in nodes.iter().enumerate().rev() {
        if element.active && element.is_patch() && element.child_count == 0 {
            let albedo = light.field.active(element.material).unwrap_or(Rgb::ZERO);
            let glossy = irradiance[node] * albedo;
            power[node] = most * glossy.element_sum() * element.area;
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

/// Power of directional light that a link carries (sum of channels), before it is scaled down.
fn power<L: LightField>(light: Light<'_, L>, link: &Link) -> f32 {
    if !light.element(link.sender).active {
        return 0.0;
    }
    let receiver = light.element(link.receiver);
    let direction = light.direction_to(receiver.center, link.sender);
    let share = if receiver.is_flat() { 1.0 } else { receiver.mean_cosine(direction) };
    let power = light.directional(link.sender, -direction).max(Rgb::ZERO).element_sum();
    power * link.factor * link.visibility.abs() * receiver.area * share
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skips::Skips;
    use crate::skips::tests::{Echo, GREY, room, solve};

    #[test]
    fn links_carry_no_more_than_is_reflected() {
        const ALBEDO: f32 = 0.3;
        let mut input = room();
        input.materials[GREY as usize].reflectance = Rgb::splat(0.4);
        let solver = solve(&input, 0.1, Echo { material: GREY, albedo: ALBEDO }, Skips::ALL);
        let light = solver.light();
        let grey =
            solver.elements.patch_leaves().map(|leaf| leaf as usize).filter(|&leaf| light.elements.nodes[leaf].active);
        let arrived: f32 =
            grey.map(|leaf| solver.exitant.irradiance[leaf].element_sum() * light.elements.nodes[leaf].area).sum();
        let carried = |most| {
            let gains = gains(light, &solver.links, most, &solver.exitant.irradiance);
            let links = solver.links.all().iter();
            links.map(|link| power(light, link) * gains[link.sender as usize]).sum::<f32>()
        };
        let reflected = ALBEDO * arrived;
        for most in [0.1, STRICTLY, FREELY] {
            let carried = carried(most);
            assert!(carried <= 1.001 * most * reflected, "{carried} of {reflected}, at most {most} of it");
        }
        let freely = carried(FREELY);
        assert!(freely > 0.8 * reflected, "hardly any is cut off: {freely} of {reflected}");
    }
}

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
            let glossy = irradiance[node] * (Rgb::ONE - element.reflectance);
            power[node] = most[node] * glossy.element_sum() * element.area;
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

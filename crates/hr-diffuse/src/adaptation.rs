//! Adaptation: in dim places smaller errors are seen.
//!
//! The error that a solution may have is a share of its light. Were that the light of all of a scene everywhere, a dim room beside a
//! bright one would be solved as roughly as it is dark, with blotches for shadows; yet who walks in there sees nothing else, and an eye,
//! or the exposure of a picture, adapts to it. So what a link may be wrong by depends on how bright it is about its receiver: on the mean
//! irradiance of what is seen from there, and of the place itself. Links tell it: it is one more gather, of irradiance instead of
//! radiosity. Where it is bright nothing is solved more roughly for that: from there other places have their light.
//!
//! But for those whose light goes nowhere. The outer sides of a house's walls may have ten times the light that comes in by its windows;
//! they reflect it to the sky. Whoever sees them sees what share of their own light they are off by, and so much they count: as if they
//! were as bright as what lights others. What a surface sees of others these see of it.

use crate::gather::Gather;
use crate::hooks::LightField;
use crate::links::Links;
use crate::transport::Light;

/// It is dim where the irradiance is below this share of what is typical of the scene, …
const DIM: f32 = 1.0 / 3.0;
/// … and errors count no more than this many times as much there: where it is darker still nobody looks closely.
const MOST: f32 = 3.0;

/// Who sends this share of what it reflects to others that reflect counts in full, …
const ENOUGH: f32 = 0.1;
/// … and nobody less than this: where all that lights others is dark, what is bright is all there is.
const LEAST: f32 = 0.01;

/// By node, how much more errors count than where it is bright, by what links bring; less than 1 where it is bright in vain.
pub(crate) fn adaptation<L: LightField>(light: Light<'_, L>, gather: &Gather, links: &Links) -> Vec<f32> {
    let nodes = &light.elements.nodes;
    let about = irradiance_about(light, gather, links);
    // The square of the mean root: a spot right below a lamp says nothing of the room, and a dark closet neither.
    let (mut sum, mut power, mut area) = (0.0, 0.0, 0.0);
    for &About { leaf, irradiance, exchanged } in &about {
        let element = light.element(leaf);
        let counts = f64::from(element.area * element.importance * exchanged);
        sum += counts * f64::from(irradiance).sqrt();
        power += counts * f64::from(irradiance);
        area += counts;
    }
    // Where nothing is exchanged all counts alike.
    let (typical, mean) =
        if area > 0.0 { ((sum / area).powi(2) as f32, (power / area) as f32) } else { (0.0, f32::MAX) };
    let mut adaptation = vec![1.0_f32; nodes.len()];
    for About { leaf, irradiance, exchanged } in about {
        // Nothing is known where no light has come yet.
        if irradiance > mean {
            adaptation[leaf as usize] = (exchanged + (1.0 - exchanged) * mean / irradiance).max(LEAST);
        } else if irradiance > 0.0 {
            adaptation[leaf as usize] = (DIM * typical / irradiance).clamp(1.0, MOST);
        }
    }
    for (node, element) in nodes.iter().enumerate().rev().filter(|(_, element)| element.child_count > 0) {
        let parts = element.first_child..element.first_child + element.child_count;
        let (mut sum, mut area) = (0.0, 0.0);
        for part in parts {
            sum += adaptation[part as usize] * nodes[part as usize].area;
            area += nodes[part as usize].area;
        }
        adaptation[node] = if area > 0.0 { sum / area } else { 1.0 };
    }
    adaptation
}

/// What is about a leaf.
struct About {
    leaf: u32,
    /// Mean irradiance (max channel) of what it sees and of itself.
    irradiance: f32,
    /// How far what it reflects lights others, 0…1.
    exchanged: f32,
}

/// What is about each leaf.
fn irradiance_about<L: LightField>(light: Light<'_, L>, gather: &Gather, links: &Links) -> Vec<About> {
    let irradiance = |node: u32| light.exitant.irradiance[node as usize].max_element();
    // What reflects nothing, such as most lamps, tells nothing of how bright it is.
    let tells = |node: u32| f32::from(u8::from(light.element(node).importance > 0.0));
    let seen = gather.weigh(light, links, |sender| tells(sender) * irradiance(sender));
    let shares = gather.weigh(light, links, tells);
    let mut about = Vec::new();
    gather.places().each_leaf(light.elements, |leaf, place, _| {
        let irradiance = (irradiance(leaf) + seen[place]) / (1.0 + shares[place]);
        about.push(About { leaf, irradiance, exchanged: (shares[place] / ENOUGH).min(1.0) });
    });
    about
}

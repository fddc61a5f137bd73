//! Adaptation: in dim places smaller errors are seen.
//!
//! The error that a solution may have is a share of its light. Were that the light of all of a scene everywhere, a dim room beside a
//! bright one would be solved as roughly as it is dark, with blotches for shadows; yet who walks in there sees nothing else, and an eye,
//! or the exposure of a picture, adapts to it. So what a link may be wrong by depends on how bright it is about its receiver: on the mean
//! irradiance of what is seen from there, and of the place itself. Links tell it: it is one more gather, of irradiance instead of
//! radiosity. Where it is bright nothing is solved more roughly for that: from there other places have their light.

use crate::gather::Gather;
use crate::hooks::LightField;
use crate::links::Links;
use crate::transport::Light;

/// It is dim where the irradiance is below this share of what is typical of the scene, …
const DIM: f32 = 1.0 / 3.0;
/// … and errors count no more than this many times as much there: where it is darker still nobody looks closely.
const MOST: f32 = 3.0;

/// By node, how much more errors count than where it is bright, by what links bring.
pub(crate) fn adaptation<L: LightField>(light: Light<'_, L>, gather: &Gather, links: &Links) -> Vec<f32> {
    let nodes = &light.elements.nodes;
    let about = irradiance_about(light, gather, links);
    // The square of the mean root: a spot right below a lamp says nothing of the room, and a dark closet neither.
    let (mut sum, mut area) = (0.0, 0.0);
    for &(leaf, irradiance) in &about {
        let element = light.element(leaf);
        let counts = f64::from(element.area * element.importance);
        sum += counts * f64::from(irradiance).sqrt();
        area += counts;
    }
    let typical = if area > 0.0 { (sum / area).powi(2) as f32 } else { 0.0 };
    let mut adaptation = vec![1.0_f32; nodes.len()];
    for (leaf, irradiance) in about {
        // Nothing is known where no light has come yet.
        if irradiance > 0.0 {
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

/// By leaf, the mean irradiance (max channel) of what it sees and of itself.
fn irradiance_about<L: LightField>(light: Light<'_, L>, gather: &Gather, links: &Links) -> Vec<(u32, f32)> {
    let irradiance = |node: u32| light.exitant.irradiance[node as usize].max_element();
    // What reflects nothing, such as most lamps, tells nothing of how bright it is.
    let tells = |node: u32| f32::from(u8::from(light.element(node).importance > 0.0));
    let seen = gather.weigh(light, links, |sender| tells(sender) * irradiance(sender));
    let shares = gather.weigh(light, links, tells);
    let mut about = Vec::new();
    gather.places().each_leaf(light.elements, |leaf, place, _| {
        about.push((leaf, (irradiance(leaf) + seen[place]) / (1.0 + shares[place])));
    });
    about
}

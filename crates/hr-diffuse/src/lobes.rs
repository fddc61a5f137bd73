//! Links know who looks: how finely a receiver tells where light comes from.
//!
//! What a link carries is a mean over where its light may come from. A diffuse receiver adds up all that arrives, and next to nothing is
//! seen of that; a narrow lobe shows the sender itself. So the wider a receiver's lobe, the more of the oracle's interval is lost in it.

use crate::Rgb;
use crate::hierarchy::Elements;
use crate::hooks::{LightField, TYPICAL_LOBE};

/// Share of the oracle's interval that counts as error where it stems from geometry, for diffuse receivers: the transported value is
/// an average over the interval, and display renews the geometry per vertex.
const DIFFUSE: f32 = 0.12;
/// The same for the sharpest lobes, which show where each light comes from.
const SHARP: f32 = 0.5;
/// Width of the lobe of a diffuse receiver: the standard deviation per axis (radians) of directions by their cosine.
const COSINE: f32 = 0.6;

/// By receiver, the share of the oracle's interval that counts as error where it stems from geometry.
#[derive(Debug)]
pub(crate) struct Shares {
    by_material: Vec<f32>,
    /// By node, for clusters: that of the narrowest lobe below.
    by_node: Vec<f32>,
}

impl Shares {
    /// Of materials with `faint` lobes, whose light travels as diffuse light, little shows where it comes from, however sharp they are.
    pub(crate) fn new<L: LightField>(elements: &Elements, faint: &[Rgb], field: &L) -> Self {
        let width = |(material, faint): (u32, &Rgb)| {
            let width = field.lobe_width(material);
            if *faint == Rgb::ZERO { width } else { width.map(|width| width.max(TYPICAL_LOBE)) }
        };
        let by_material: Vec<f32> = (0..).zip(faint).map(|material| share(width(material))).collect();
        let nodes = &elements.nodes;
        let mut by_node = vec![DIFFUSE; nodes.len()];
        for node in (1..nodes.len()).rev() {
            if nodes[node].active {
                let own = by_material.get(nodes[node].material as usize).copied().unwrap_or(by_node[node]);
                let parent = nodes[node].parent as usize;
                by_node[parent] = by_node[parent].max(own);
            }
        }
        Self { by_material, by_node }
    }

    /// That of a node of a material, if it has one.
    pub(crate) fn of(&self, node: u32, material: u32) -> f32 {
        self.by_material.get(material as usize).copied().unwrap_or_else(|| self.by_node[node as usize])
    }
}

/// That of a lobe of a width (standard deviation, radians).
fn share(width: Option<f32>) -> f32 {
    let sharpness = width.map_or(0.0, |width| 1.0 - (width / COSINE).clamp(0.0, 1.0));
    DIFFUSE + (SHARP - DIFFUSE) * sharpness
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hooks::{Arrived, Hierarchy, NodeId, Transfer};
    use crate::skips::Skips;
    use crate::skips::tests::{room, solve};
    use crate::{Cone, Rgb};
    use glam::Vec3;

    /// The walls of the room look through a lobe of this width, and reflect nothing more by it.
    struct Looking(f32);

    impl LightField for Looking {
        type Incident = ();
        type Exitant = ();

        fn active(&self, material: u32) -> Option<Rgb> {
            (material == 0).then_some(Rgb::ZERO)
        }
        fn lobe_width(&self, material: u32) -> Option<f32> {
            (material == 0).then_some(self.0)
        }
        fn clear(&self, (): &mut ()) {}
        fn receive(&self, (): &mut (), _: &Transfer) {}
        fn reflect<H: Hierarchy>(&self, _: &H, _: NodeId, _: &[&()], _: Arrived) {}
        fn radiance(&self, (): &(), _: Vec3) -> Rgb {
            Rgb::ZERO
        }
        fn radiance_bounds(&self, (): &(), _: &Cone) -> (Rgb, Rgb) {
            (Rgb::ZERO, Rgb::ZERO)
        }
    }

    #[test]
    fn the_wider_a_lobe_the_less_it_tells() {
        let shares: Vec<f32> = [0.0, 0.03, 0.1, 0.3, 0.6, 1.5].into_iter().map(|width| share(Some(width))).collect();
        assert!(shares.is_sorted_by(|a, b| a >= b), "{shares:?}");
        assert_eq!(
            (shares[0], shares[4], shares[5]),
            (SHARP, DIFFUSE, DIFFUSE),
            "a mirror, a cosine and what is wider"
        );
        assert_eq!(share(None), DIFFUSE, "no lobe at all");
    }

    /// The same room: as many links to what looks through a lobe as wide as a cosine as to what is diffuse, more to sharper ones.
    #[test]
    fn links_are_as_fine_as_lobes_are_sharp() {
        let diffuse = solve(&room(), 0.1, (), Skips::ALL).stats.links as f64;
        let [broad, typical, sharp] = [0.6, 0.3, 0.05].map(|width| {
            let links = solve(&room(), 0.1, Looking(width), Skips::ALL).stats.links as f64;
            links / diffuse
        });
        assert!((broad - 1.0).abs() < 0.05, "{broad} times as many as to diffuse walls");
        assert!(typical > 1.15 && sharp > 1.15 * typical, "{typical} and {sharp} times as many");
    }
}

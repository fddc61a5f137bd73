//! Links know who looks: how finely a receiver tells where light comes from.
//!
//! What a link carries is a mean over where its light may come from. A diffuse receiver adds up all that arrives, and next to nothing is
//! seen of that; a narrow lobe shows the sender itself. So the wider a receiver's lobe, the more of the oracle's interval is lost in it.
//! And a lobe's light leaves in few directions, where it is as bright: how bright parts of a sender are, and what hides it, is seen in
//! its highlight, however little light of all that is.

use crate::Rgb;
use crate::hierarchy::{Element, Elements};
use crate::hooks::{LightField, TYPICAL_LOBE};
use crate::transport::Light;

/// Share of the oracle's interval that counts as error where it stems from geometry, for diffuse receivers: the transported value is
/// an average over the interval, and display renews the geometry per vertex.
const DIFFUSE: f32 = 0.12;
/// The same for the sharpest lobes, which show where each light comes from.
const SHARP: f32 = 0.5;
/// Width of the lobe of a diffuse receiver: the standard deviation per axis (radians) of directions by their cosine.
const COSINE: f32 = 0.6;

/// No lobe counts as narrower than this (radians): a mirror would show a point of light in no direction at all, and edges without end.
const NARROWEST: f32 = 0.03;

/// The lobe of a material.
#[derive(Clone, Copy, Debug)]
struct Lobe {
    /// Standard deviation per axis, radians; `None` where it reflects nothing but diffuse light.
    width: Option<f32>,
    /// What it reflects in all (max channel).
    albedo: f32,
}

/// By receiver, how finely it tells where light comes from.
#[derive(Debug)]
pub(crate) struct Lobes {
    by_material: Vec<Lobe>,
    /// By node, for clusters: the material of the narrowest lobe below; `u32::MAX` where there is none.
    narrowest: Vec<u32>,
}

impl Lobes {
    /// Of materials with `faint` lobes, whose light travels as diffuse light, little shows where it comes from, however sharp they are.
    pub(crate) fn new<L: LightField>(elements: &Elements, faint: &[Rgb], field: &L) -> Self {
        let lobe = |(material, faint): (u32, &Rgb)| {
            let width = field.lobe_width(material).map(|width| width.max(NARROWEST));
            let width = if *faint == Rgb::ZERO { width } else { width.map(|width| width.max(TYPICAL_LOBE)) };
            Lobe { width, albedo: field.active(material).map_or(0.0, Rgb::max_element) }
        };
        let by_material = (0..).zip(faint).map(lobe).collect();
        let nodes = &elements.nodes;
        let mut lobes = Self { by_material, narrowest: vec![u32::MAX; nodes.len()] };
        for node in (1..nodes.len()).rev().filter(|&node| nodes[node].active) {
            let own = lobes.material(node as u32, &nodes[node]);
            let parent = nodes[node].parent as usize;
            if share(lobes.width(own)) > share(lobes.width(lobes.narrowest[parent])) {
                lobes.narrowest[parent] = own;
            }
        }
        lobes
    }

    /// Its own, or that of the narrowest lobe below.
    fn material(&self, node: u32, element: &Element) -> u32 {
        if element.is_patch() {
            element.material
        } else {
            self.narrowest.get(node as usize).copied().unwrap_or(u32::MAX)
        }
    }

    fn width(&self, material: u32) -> Option<f32> {
        self.by_material.get(material as usize).and_then(|lobe| lobe.width)
    }

    /// The share of the oracle's interval that counts as error at a receiver where it stems from geometry.
    pub(crate) fn share<L: LightField>(&self, light: Light<'_, L>, receiver: u32) -> f32 {
        share(self.width(self.material(receiver, light.element(receiver))))
    }

    /// How much more what is seen of a sender counts at a receiver than by the power that is reflected: over the directions in which it
    /// leaves, the root mean square of radiance over its mean. A lobe leaves in few: those about the sender's mirror image.
    pub(crate) fn contrast<L: LightField>(&self, light: Light<'_, L>, receiver: u32, sender: u32) -> f32 {
        let (element, source) = (light.element(receiver), light.element(sender));
        let lobe = self.by_material.get(self.material(receiver, element) as usize);
        let Some(&Lobe { width: Some(width), albedo }) = lobe else { return 1.0 };
        let apart2 = element.center.distance_squared(source.center).max(f32::MIN_POSITIVE);
        // A disk has a standard deviation of half its radius per axis.
        let variance = width * width + 0.25 * source.radius * source.radius / apart2;
        contrast(element.reflectance.max_element(), albedo, variance)
    }
}

/// That of a lobe of a width (standard deviation, radians).
fn share(width: Option<f32>) -> f32 {
    let sharpness = width.map_or(0.0, |width| 1.0 - (width / COSINE).clamp(0.0, 1.0));
    DIFFUSE + (SHARP - DIFFUSE) * sharpness
}

/// That of what is reflected evenly, and of a lobe that spreads by a variance (per axis, radians).
fn contrast(diffuse: f32, lobe: f32, variance: f32) -> f32 {
    // Of a normal distribution the mean square is what it would be within 4π times the variance; all directions, by their cosine, are π.
    let share = (4.0 * variance).min(1.0);
    let square = diffuse * (diffuse + 2.0 * lobe) + lobe * lobe / share.max(f32::MIN_POSITIVE);
    (square.sqrt() / (diffuse + lobe).max(f32::MIN_POSITIVE)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hooks::{Arrived, Hierarchy, NodeId, Transfer};
    use crate::skips::Skips;
    use crate::skips::tests::{room, solve};
    use crate::{Cone, Rgb};
    use glam::Vec3;

    /// The walls of the room look through a lobe of this width, and this albedo counts though nothing more is reflected by it.
    struct Looking(f32, f32);

    impl LightField for Looking {
        type Incident = ();
        type Exitant = ();

        fn active(&self, material: u32) -> Option<Rgb> {
            (material == 0).then_some(Rgb::splat(self.1))
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
            let links = solve(&room(), 0.1, Looking(width, 0.0), Skips::ALL).stats.links as f64;
            links / diffuse
        });
        assert!((broad - 1.0).abs() < 0.05, "{broad} times as many as to diffuse walls");
        assert!(typical > 1.15 && sharp > 1.15 * typical, "{typical} and {sharp} times as many");
    }

    #[test]
    fn what_leaves_in_few_directions_counts_more() {
        assert_eq!(contrast(0.5, 0.0, 0.0), 1.0, "nothing but diffuse light");
        assert_eq!(contrast(0.5, 0.3, 1.0), 1.0, "a lobe as wide as all directions");
        let disk = |radius: f32| contrast(0.0, 0.3, 0.25 * radius * radius);
        assert!((disk(0.1) - 10.0).abs() < 1e-3, "what a mirror shows of a disk, in a hundredth of all: {}", disk(0.1));
        let counts = [0.9, 0.3, 0.1, 0.0].map(|diffuse| contrast(diffuse, 0.1, 0.01));
        assert!(counts.is_sorted() && counts[0] < 1.12, "beside diffuse light it is seen the less: {counts:?}");
        assert!(contrast(0.0, 0.0, 0.0).is_finite(), "nothing at all");
    }

    /// A post hides a lamp from part of the floor: the edge of its shadow is finer where the floor mirrors the lamp.
    #[test]
    fn edges_are_finer_in_highlights() {
        let leaves = |field| solve(&room(), 0.1, field, Skips::ALL).stats.leaves as f64;
        assert_eq!(leaves(Looking(0.0, 0.3)), leaves(Looking(NARROWEST, 0.3)), "mirrors are no sharper than that");
        let [evenly, broad, sharp] =
            [(0.6, 0.0), (0.6, 0.3), (0.05, 0.3)].map(|(width, albedo)| leaves(Looking(width, albedo)));
        assert!(
            sharp > 1.2 * broad,
            "{sharp} leaves, not more than the {broad} of a broad lobe ({evenly} without its light)"
        );
    }
}

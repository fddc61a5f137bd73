//! Where the shadow of a light without extent ends: at a line, too.
//!
//! The sun shines through a window, and its light ends on the floor at an edge, wherever that is. Some corners of a leaf see the light and
//! others do not; in between its outline is halved until the place is known where light ends, and the line from one such place to the
//! next is the edge of the shadow, or next to it where that is bent.

use super::{Contact, LONG, MOST_LINES};
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::segments::visibility_at;
use crate::shadows::counts;
use crate::transport::Light;
use crate::vertices::{Corner, Outline, point_on};
use glam::Vec2;
use smallvec::SmallVec;

/// Leaves that are smaller than this share of all area show no lines.
const SMALL: f32 = 3e-6;
/// Rays start at this share of the way from the outline to the middle: they would graze what stands there.
const ASIDE: f32 = 1e-3;
/// The place where light ends on an edge is known to this many halvings.
const HALVINGS: u32 = 10;

/// The lines on leaves, and the rays that were shot to find them.
pub(super) struct ShadowLines<'a, L: LightField> {
    light: Light<'a, L>,
    /// Nodes of lights without extent.
    lights: Vec<u32>,
}

impl<'a, L: LightField> ShadowLines<'a, L> {
    pub(super) fn new(light: Light<'a, L>) -> Self {
        let is_light = |&node: &u32| light.element(node).kind == Kind::Light;
        Self { light, lights: (0..light.elements.nodes.len() as u32).filter(is_light).collect() }
    }

    /// Those on a leaf that is shown by an outline.
    pub(super) fn on(&self, leaf: u32, outline: &Outline) -> (SmallVec<[Contact; MOST_LINES]>, u64) {
        let (light, element) = (self.light, self.light.element(leaf));
        let geometry = &light.scene.surfaces()[element.source as usize];
        let is_shown = element.importance > 0.0 && element.area > SMALL * light.elements.measure();
        let (mut lines, mut rays) = (SmallVec::new(), 0);
        if self.lights.is_empty() || !geometry.is_polygon() || !is_shown {
            return (lines, rays);
        }
        let middle = outline.iter().map(|corner| corner.uv).sum::<Vec2>() / outline.len().max(1) as f32;
        for &node in &self.lights {
            let brought = light.irradiance_at(element.center, element.normals.axis, node);
            if !counts(light, leaf, brought.max_element()) {
                continue;
            }
            let mut sees = |uv: Vec2| {
                rays += 1;
                let (x, n) = point_on(light.scene, light.elements, leaf, uv.lerp(middle, ASIDE));
                visibility_at(light, |_| (x, n, element.source), node, (1, 0)) > 0.0
            };
            let lit = sees(middle);
            let corners: SmallVec<[bool; 12]> = outline.iter().map(|corner| sees(corner.uv)).collect();
            for ends in unlike(&corners, lit) {
                let [p, q] = ends.map(|(like, other)| {
                    let ends: [&Corner; 2] = [&outline[like], &outline[other]];
                    let uv = halved(ends.map(|corner| corner.uv), |uv| sees(uv) == lit);
                    point_on(light.scene, light.elements, leaf, uv).0
                });
                let line = Contact::through([p, q], element.normals.axis);
                if p.distance(q) > LONG * element.radius && lines.len() < MOST_LINES {
                    lines.extend(line);
                }
            }
        }
        (lines, rays)
    }
}

/// The two edges of an outline, each given by the corner that is like its middle and the one that is not, at the ends of every row of corners
/// that are not.
fn unlike(corners: &[bool], middle: bool) -> SmallVec<[[(usize, usize); 2]; 2]> {
    let count = corners.len();
    let is_first = |&at: &usize| corners[at] != middle && corners[(at + count - 1) % count] == middle;
    let row = |first: usize| {
        let next = (first..first + count).find(|at| corners[at % count] == middle).unwrap_or(first);
        [((first + count - 1) % count, first), (next % count, (next + count - 1) % count)]
    };
    (0..count).filter(is_first).map(row).collect()
}

/// The place between the first end, which is like something, and the other one, which is not, where that changes.
fn halved([mut like, mut other]: [Vec2; 2], mut is_like: impl FnMut(Vec2) -> bool) -> Vec2 {
    for _ in 0..HALVINGS {
        let between = like.midpoint(other);
        *(if is_like(between) { &mut like } else { &mut other }) = between;
    }
    like.midpoint(other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_corners_have_two_ends() {
        let [x, o] = [true, false];
        let ends = |corners: &[bool]| unlike(corners, o).to_vec();
        assert_eq!(ends(&[o, x, x, o]), [[(0, 1), (3, 2)]]);
        assert_eq!(ends(&[x, o, o, x]), [[(2, 3), (1, 0)]], "around the beginning");
        assert_eq!(ends(&[x, o, x, o]), [[(3, 0), (1, 0)], [(1, 2), (3, 2)]], "a bar across the leaf");
        assert!(ends(&[o, o, o]).is_empty(), "all alike");
        assert!(ends(&[x, x, x]).is_empty(), "the edge is nowhere near the outline");
    }

    #[test]
    fn light_ends_where_it_changes() {
        let [a, b] = [Vec2::ZERO, Vec2::new(1.0, 0.5)];
        assert!((halved([a, b], |uv| uv.x < 0.3).x - 0.3).abs() < 1e-3);
        assert!((halved([b, a], |uv| uv.x > 0.3).x - 0.3).abs() < 1e-3, "from the other end");
    }
}

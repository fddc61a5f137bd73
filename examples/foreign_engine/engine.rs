//! A radiosity engine of another kind: progressive refinement (M. Cohen, S. E. Chen, J. Wallace, D. Greenberg, "A
//! Progressive Refinement Approach to Fast Radiosity Image Generation", SIGGRAPH 1988). Small flat patches, no links, no
//! clusters: the patch with the most unshot light shoots it at all others, over and over, by way of rays against a tree
//! of boxes.
//!
//! The lines that end in `// +` were added for glossy light.

use crate::boxes::Boxes;
use crate::glossy::Glossy; // +
use glam::Vec3;
use rayon::prelude::*;

/// Shooting ends when less than this share of the emitted power is unshot.
const ENOUGH: f32 = 0.005;
/// Pairs of points that stand for a pair of patches: in each direction no more than …
const MOST_POINTS: f32 = 4.0;
/// … and one for patches that are smaller than this share of their distance.
const POINT_SHARE: f32 = 0.25;

/// What a patch is painted with.
pub(crate) struct Paint {
    /// Diffuse reflectance.
    pub(crate) reflectance: Vec3,
    /// W/m².
    pub(crate) exitance: Vec3,
}

/// A flat quadrilateral; two corners may be one. It reflects in front, whence its corners are counter-clockwise.
pub(crate) struct Patch {
    pub(crate) corners: [Vec3; 4],
    pub(crate) center: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) area: f32,
    pub(crate) radius: f32,
    /// Angle (radians) by which the normals of the curved surface turn that it is a facet of.
    pub(crate) bend: f32,
    pub(crate) paint: usize,
    /// Irradiance so far, W/m².
    pub(crate) irradiance: Vec3,
    /// Radiosity that is still to be shot, W/m².
    unshot: Vec3,
}

impl Patch {
    pub(crate) fn new(corners: [Vec3; 4], paint: usize, bend: f32) -> Self {
        let [a, b, c, d] = corners;
        let center = 0.25 * (a + b + c + d);
        let cross = (c - a).cross(d - b);
        let radius = corners.iter().map(|p| p.distance(center)).fold(0.0, f32::max);
        let (normal, area) = (cross.normalize(), 0.5 * cross.length());
        Self { corners, center, normal, area, radius, bend, paint, irradiance: Vec3::ZERO, unshot: Vec3::ZERO }
    }

    /// A point, for s and t in 0…1.
    fn point(&self, s: f32, t: f32) -> Vec3 {
        let [a, b, c, d] = self.corners;
        a.lerp(b, s).lerp(d.lerp(c, s), t)
    }

    /// Distance at which a ray meets the patch, in lengths of its direction.
    pub(crate) fn meets(&self, from: Vec3, direction: Vec3) -> Option<f32> {
        let at = self.normal.dot(self.center - from) / self.normal.dot(direction);
        let point = from + at * direction;
        let inside = |k: usize| {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 4]);
            (b - a).cross(point - a).dot(self.normal) >= 0.0
        };
        (at.is_finite() && (0..4).all(inside)).then_some(at)
    }
}

/// Patches, and the light on them.
pub(crate) struct Engine {
    pub(crate) patches: Vec<Patch>,
    pub(crate) paints: Vec<Paint>,
    boxes: Boxes,
    pub(crate) glossy: Glossy, // +
}

impl Engine {
    pub(crate) fn new(
        mut patches: Vec<Patch>,
        paints: Vec<Paint>,
        glossy: Glossy, // +
    ) -> Self {
        for patch in &mut patches {
            patch.unshot = paints[patch.paint].exitance;
        }
        Self {
            boxes: Boxes::new(&patches),
            patches,
            paints,
            glossy, // +
        }
    }

    /// Shoots until next to nothing is left; tells how many times.
    pub(crate) fn solve(&mut self) -> usize {
        let power = |engine: &Self, patch: usize| {
            let glossy = engine.glossy.unshot(&engine.patches, patch); // +
            let unshot = engine.patches[patch].unshot + glossy; // +
            unshot.element_sum() * engine.patches[patch].area
        };
        let emitted: f32 = (0..self.patches.len()).map(|patch| power(self, patch)).sum();
        let mut shots = 0;
        loop {
            let (mut brightest, mut left) = ((0, 0.0), 0.0);
            for patch in 0..self.patches.len() {
                let here = power(self, patch);
                left += here;
                if here > brightest.1 {
                    brightest = (patch, here);
                }
            }
            if left <= ENOUGH * emitted {
                return shots;
            }
            self.shoot(brightest.0);
            shots += 1;
        }
    }

    /// Shoots the light of a patch at all others.
    fn shoot(&mut self, from: usize) {
        let unshot = std::mem::take(&mut self.patches[from].unshot);
        let directional = self.glossy.take_unshot(&self.patches, from); // +
        let patches = &self.patches;
        let glossy = &self.glossy; // +
        let irradiance = |to: usize| {
            let share = self.share(from, to);
            if share <= 0.0 {
                return Vec3::ZERO;
            }
            let toward = (patches[to].center - patches[from].center).normalize(); // +
            let unshot = unshot + glossy.radiosity(&directional, toward); // +
            unshot * share
        };
        let arriving: Vec<Vec3> = (0..patches.len()).into_par_iter().with_min_len(64).map(irradiance).collect();
        self.glossy.receive(&self.patches, from, &arriving); // +
        for (patch, irradiance) in self.patches.iter_mut().zip(arriving) {
            patch.irradiance += irradiance;
            patch.unshot += self.paints[patch.paint].reflectance * irradiance;
        }
    }

    /// Mean over a patch of the irradiance from another one of unit radiosity.
    fn share(&self, from: usize, to: usize) -> f32 {
        let (sender, receiver) = (&self.patches[from], &self.patches[to]);
        let apart = receiver.center - sender.center;
        let faces = |patch: &Patch, toward: Vec3| patch.normal.dot(toward) > -patch.radius;
        if from == to || !faces(sender, apart) || !faces(receiver, -apart) {
            return 0.0;
        }
        let size = (sender.radius + receiver.radius) / apart.length();
        let side = (size / POINT_SHARE).ceil().clamp(1.0, MOST_POINTS) as usize;
        let cell = |i: usize| ((i % side) as f32 + 0.5) / side as f32;
        let count = side * side;
        let pair = |i: usize| {
            // Cells of the two are matched so that the pairs are of all kinds.
            let j = (i * 7 + i / side * 3 + 1) % count;
            let (x, y) = (sender.point(cell(i), cell(i / side)), receiver.point(cell(j), cell(j / side)));
            let to = y - x;
            let d2 = to.length_squared();
            let cosines = sender.normal.dot(to).max(0.0) * receiver.normal.dot(-to).max(0.0) / d2;
            let area = sender.area / count as f32;
            let factor = cosines * area / (std::f32::consts::PI * d2 + area);
            if factor > 0.0 && self.boxes.is_free(&self.patches, x, y) { factor } else { 0.0 }
        };
        // Each point of the receiver sees a cell of the sender, which stands for all of them.
        (0..count).map(pair).sum::<f32>()
    }
}

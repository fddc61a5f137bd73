//! What the rays of a picture meet: along beams of neighbouring pixels, which meet the same few surfaces, or one by one where these
//! are many.

use super::START;
use glam::{Vec2, Vec3};
use hr_diffuse::visibility::Beam;
use hr_diffuse::{Hit, Visibility};
use hr_scene::Rays;
use std::ops::Range;

/// Pixels, squared, of the widest beams. …
const WIDEST: usize = 8;
/// … Where these meet more surfaces than so many they are parted, down to single pixels.
const FEW: usize = 4;
/// Beams reach so many pixels beyond their own, for rounding.
const MARGIN: f64 = 0.01;
/// Of a pixel without a beam.
const NONE: u32 = u32::MAX;

/// A part of a picture, seen from its eye.
pub(super) struct Sight<'a> {
    visibility: &'a Visibility,
    /// In unit space.
    eye: Vec3,
    rays: &'a Rays,
    /// Columns and rows of pixels.
    columns: Range<usize>,
    rows: Range<usize>,
    beams: Vec<Beam>,
    /// By pixel, which of them is its own.
    own: Vec<u32>,
}

impl<'a> Sight<'a> {
    pub(super) fn new(
        visibility: &'a Visibility,
        (eye, rays): (Vec3, &'a Rays),
        columns: Range<usize>,
        rows: Range<usize>,
    ) -> Self {
        let own = vec![NONE; columns.len() * rows.len()];
        let mut sight = Self { visibility, eye, rays, columns, rows, beams: Vec::new(), own };
        for top in sight.rows.clone().step_by(WIDEST) {
            for left in sight.columns.clone().step_by(WIDEST) {
                sight.look([left, top], WIDEST);
            }
        }
        sight
    }

    pub(super) fn columns(&self) -> Range<usize> {
        self.columns.clone()
    }

    /// How wide pixels are at distance 1.
    pub(super) fn pixel(&self) -> f32 {
        self.rays.pixel()
    }

    pub(super) fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Finds the beam, or beams, of a square of pixels.
    fn look(&mut self, [left, top]: [usize; 2], side: usize) {
        let [right, bottom] = [self.columns.end.min(left + side), self.rows.end.min(top + side)];
        if left >= right || top >= bottom {
            return;
        }
        let [x, y] = [left, top].map(|first| first as f64 - MARGIN);
        let [to_x, to_y] = [right, bottom].map(|end| end as f64 + MARGIN);
        let corners = [(x, y), (to_x, y), (to_x, to_y), (x, to_y)].map(|(x, y)| self.rays.direction(x, y));
        let beam = self.visibility.beam(self.eye, corners, START);
        let is_single = right - left == 1 && bottom - top == 1;
        if let Some(beam) = beam.filter(|beam| is_single || beam.count() <= FEW) {
            for y in top..bottom {
                for x in left..right {
                    let pixel = self.index([x, y]);
                    self.own[pixel] = self.beams.len() as u32;
                }
            }
            self.beams.push(beam);
        } else if !is_single {
            let half = side / 2;
            for [x, y] in [[left, top], [left + half, top], [left, top + half], [left + half, top + half]] {
                self.look([x, y], half);
            }
        }
    }

    fn index(&self, [x, y]: [usize; 2]) -> usize {
        (y - self.rows.start) * self.columns.len() + x - self.columns.start
    }

    /// The ray from the eye through a place (0…1) in a pixel.
    pub(super) fn ray(&self, [x, y]: [usize; 2], place: Vec2) -> (Vec3, Vec3) {
        (self.eye, self.rays.within(x, y, place))
    }

    /// The surface that a ray of a pixel meets first, and how far away.
    pub(super) fn first(&self, pixel: [usize; 2], direction: Vec3) -> Option<(u32, f32)> {
        match self.beam(pixel) {
            Some(beam) => self.visibility.first_in(beam, direction),
            None => self.visibility.first(self.eye, direction, START, f32::MAX),
        }
    }

    /// Where it meets that.
    pub(super) fn hit(&self, first: (u32, f32), direction: Vec3) -> Hit {
        self.visibility.hit(first, self.eye, direction)
    }

    /// Whether all rays of a pixel are known to meet the same.
    pub(super) fn is_even(&self, pixel: [usize; 2]) -> bool {
        self.beam(pixel).is_some_and(Beam::is_even)
    }

    fn beam(&self, pixel: [usize; 2]) -> Option<&Beam> {
        self.beams.get(self.own[self.index(pixel)] as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path_tracer;
    use glam::DVec3;
    use hr_diffuse::Normalization;
    use hr_diffuse::sampling::{hash, point2};
    use hr_scene::{Camera, Scene};

    /// Rays meet what they meet without beams, at the same distance, and most pixels have one. Of pixels that need no look at edges all rays meet
    /// the same.
    #[test]
    fn beams_change_nothing_that_is_seen() {
        let (width, height) = (90, 61);
        for scene in ["room", "glossy-sphere"] {
            let scene = Scene::load(scene).expect("built in");
            let camera = Camera { width: width as u32, height: height as u32, ..scene.default_camera() };
            let normalization = Normalization::new(&scene.surfaces);
            let visibility = path_tracer::visibility(&scene).expect("sound");
            let (eye, rays) = (normalization.to_unit(DVec3::from(camera.eye)), camera.rays());
            let sight = Sight::new(&visibility, (eye, &rays), 0..width, 0..height);
            let (mut with, mut even) = (0, 0);
            for pixel in (0..height).flat_map(|y| (0..width).map(move |x| [x, y])) {
                let mut met = Vec::new();
                for i in 0..16 {
                    let (_, direction) = sight.ray(pixel, point2(hash(pixel[0] as u32, pixel[1] as u32), i));
                    let (found, alone) =
                        (sight.first(pixel, direction), visibility.first(eye, direction, START, f32::MAX));
                    assert_eq!(found.map(|hit| hit.1), alone.map(|hit| hit.1), "{pixel:?}: {found:?}, {alone:?}");
                    met.push(found.map(|hit| hit.0));
                }
                with += usize::from(sight.beam(pixel).is_some());
                even += usize::from(sight.is_even(pixel));
                assert!(!sight.is_even(pixel) || met.iter().all(|surface| *surface == met[0]), "{pixel:?}: {met:?}");
            }
            assert!(10 * with > 9 * width * height, "{with} pixels have a beam");
            assert!(8 * even > width * height, "{even} pixels see one polygon");
        }
    }
}

//! What arrives all over a place: at several points of it at once.
//!
//! A large sender near by is taken by its parts, of which most are far from all of the place: those bring the same to each of its
//! points, but for distance and cosine. So the hierarchy is walked once for all points, and each of them by itself asks only what is near it.

use crate::hierarchy::{Element, Kind};
use crate::hooks::LightField;
use crate::toward::Detail;
use crate::transport::Light;
use glam::{Vec2, Vec3};
use smallvec::SmallVec;

/// Places and senders whose radii together are below this share of their distance are far from each other.
pub(crate) const FAR: f32 = 0.25;
/// The middle of a place stands for all of it where it gets at least this share of the mean.
const FACES: f32 = 0.5;

/// Points of a place, their normals and weights (sum 1).
pub(crate) type Points = SmallVec<[(Vec3, Vec3, f32); 8]>;

/// A place, by its points.
#[derive(Clone, Copy)]
pub(crate) struct Spots<'a> {
    pub(crate) points: &'a Points,
    /// Its middle and the normal there, …
    pub(crate) middle: (Vec3, Vec3),
    /// … and the radius that holds it.
    pub(crate) radius: f32,
    /// As in [`Light::arriving_at`].
    pub(crate) negligible: f32,
}

impl Spots<'_> {
    /// Whether a sender is far from all of it.
    pub(crate) fn is_far(&self, sender: &Element) -> bool {
        let reach = self.radius + sender.radius;
        reach * reach < FAR * FAR * sender.center.distance_squared(self.middle.0)
    }

    /// By point, what arrives from a sender that brings so much to the middle, where it may stand for all of the place.
    pub(crate) fn by_middle(&self, sender: &Element, brought: Vec2) -> Option<SmallVec<[Vec2; 8]>> {
        let kernel = |x: Vec3, n: Vec3| {
            let to = sender.center - x;
            to.dot(n).max(0.0) / (to.length_squared() * to.length()).max(f32::MIN_POSITIVE)
        };
        let kernels: SmallVec<[f32; 8]> = self.points.iter().map(|&(x, n, _)| kernel(x, n)).collect();
        let mean: f32 = kernels.iter().zip(self.points).map(|(kernel, (.., weight))| kernel * weight).sum();
        let in_middle = kernel(self.middle.0, self.middle.1);
        // Where the middle hardly faces the sender it tells little of the rest.
        (in_middle > FACES * mean).then(|| kernels.into_iter().map(|kernel| brought * (kernel / in_middle)).collect())
    }
}

impl<L: LightField> Light<'_, L> {
    /// By point of a place, what arrives from a sender if it is wholly visible (sum of channels), and the share of the view that it takes up.
    pub(crate) fn arriving_all_over(&self, spots: Spots<'_>, sender: u32) -> SmallVec<[Vec2; 8]> {
        let mut arriving = SmallVec::from_elem(Vec2::ZERO, spots.points.len());
        self.add_all_over(spots, sender, &mut arriving);
        arriving
    }

    /// The same at a single point.
    pub(crate) fn brought_to(&self, x: Vec3, n: Vec3, sender: u32, detail: Detail) -> Vec2 {
        let (light, share) = self.arriving_at(x, n, sender, detail);
        Vec2::new(light.element_sum(), share)
    }

    fn add_all_over(&self, spots: Spots<'_>, sender: u32, arriving: &mut [Vec2]) {
        let element = self.element(sender);
        if self.emitted_most(sender) <= 0.0 {
            return;
        }
        let at = |x: Vec3, n: Vec3| self.brought_to(x, n, sender, Detail::carried(spots.negligible));
        if element.kind != Kind::Light && spots.is_far(element) {
            let (x, n) = spots.middle;
            if let Some(values) = spots.by_middle(element, at(x, n)) {
                arriving.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
                return;
            }
        } else if let Some(parts) = self.parts_toward(spots.middle.0, sender) {
            parts.for_each(|part| self.add_all_over(spots, part, arriving));
            return;
        }
        arriving.iter_mut().zip(spots.points).for_each(|(sum, &(x, n, _))| *sum += at(x, n));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::push::sample_points;
    use crate::skips::Skips;
    use crate::skips::tests::{room, solve};

    /// All links of a room to parts of surfaces: at once, and point by point.
    #[test]
    fn what_arrives_all_over_arrives_at_each_point() {
        let solver = solve(&room(), 0.05, (), Skips::ALL);
        let light = solver.light();
        let (mut far, mut off, mut all) = (0, Vec2::ZERO, Vec2::ZERO);
        let to_patches = solver.links.all().iter().filter(|link| light.element(link.receiver).is_patch());
        for link in to_patches {
            let (receiver, sender) = (light.element(link.receiver), light.element(link.sender));
            let points: Points = sample_points(light.scene, receiver).into_iter().collect();
            let middle = (receiver.center, receiver.normals.axis);
            let spots = Spots { points: &points, middle, radius: receiver.radius, negligible: 0.0 };
            far += u32::from(spots.is_far(sender));
            let at_once = light.arriving_all_over(spots, link.sender);
            for (at_once, &(x, n, weight)) in at_once.into_iter().zip(&points) {
                let by_point = light.brought_to(x, n, link.sender, Detail::carried(0.0));
                off += weight * receiver.area * (at_once - by_point).abs();
                all += weight * receiver.area * by_point;
            }
        }
        assert!(far > 1000, "{far} senders are far");
        assert!(off.cmpgt(Vec2::ZERO).all() && off.cmplt(0.02 * all).all(), "off by {} of light and view", off / all);
    }

    /// Where the middle does not face a sender that others see, each point looks for itself.
    #[test]
    fn a_middle_that_sees_nothing_stands_for_no_one() {
        let solver = solve(&room(), 0.3, (), Skips::ALL);
        let sender = &solver.elements.nodes[0];
        let above = sender.center + Vec3::Z * 100.0;
        let points = Points::from_slice(&[(above, Vec3::NEG_Z, 0.5), (above, Vec3::Z, 0.5)]);
        let spots = |normal: Vec3| Spots { points: &points, middle: (above, normal), radius: 1.0, negligible: 0.0 };
        assert_eq!(
            spots(Vec3::NEG_Z).by_middle(sender, Vec2::splat(3.0)).as_deref(),
            Some([Vec2::splat(3.0), Vec2::ZERO].as_slice())
        );
        assert_eq!(spots(Vec3::Z).by_middle(sender, Vec2::ZERO), None);
    }
}

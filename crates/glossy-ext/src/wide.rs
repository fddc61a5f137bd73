//! Wide senders: a floor seen from a box that stands on it.
//!
//! A link's light comes from one direction (paper, section 3.2), that of its sender's middle. Of a sender that takes up much of the
//! view this is not where its light comes from: what is near is seen below the middle, and takes up more of the view. The link
//! knows how much arrives; from where follows from the sender's outline, since all of it is equally bright as far as the link
//! knows. So wide senders are seen in parts, none of them wide.

use glam::Vec3;
use hr_diffuse::hooks::Sides;
use std::f32::consts::PI;

/// Parts whose sides are further from their middle than this share of their distance are halved: corners further away than a
/// [contour](crate::reflector::Contour) tells of would leave gaps between parts, which polished surfaces show.
const WIDE: f32 = 0.3;
/// So often at most.
const MOST_HALVINGS: u32 = 10;

/// FlatPart of a flat sender.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FlatPart {
    /// Its middle, in the hierarchy's unit.
    pub(crate) center: Vec3,
    /// Its outline.
    pub(crate) sides: Sides,
}

impl FlatPart {
    /// Area.
    fn area(&self) -> f32 {
        4.0 * self.sides.across.cross(self.sides.along).length()
    }

    /// Irradiance at a place, across the direction, by its radiosity (a form factor), and the unit direction toward it; its unit
    /// normal is given. None is more than 1.
    pub(crate) fn factor(&self, normal: Vec3, at: Vec3) -> (f32, Vec3) {
        let to = self.center - at;
        let (distance2, area) = (to.length_squared(), self.area());
        let direction = to / distance2.sqrt().max(f32::MIN_POSITIVE);
        let factor = area * normal.dot(-direction).max(0.0) / (PI * distance2);
        (if factor.is_finite() { factor.min(1.0) } else { 0.0 }, direction)
    }

    /// Whether it is wide, seen from a place.
    pub(crate) fn is_wide(&self, at: Vec3) -> bool {
        let Sides { across, along, taper } = self.sides;
        let reach2 = (across.length_squared() * (1.0 + taper).powi(2)).max(along.length_squared());
        reach2 > WIDE * WIDE * self.center.distance_squared(at)
    }

    /// Halves, divided across the longer side.
    fn halves(&self) -> [Self; 2] {
        let Sides { across, along, taper } = self.sides;
        [-0.5_f32, 0.5].map(|side| {
            if along.length_squared() > across.length_squared() {
                // t = side + t'/2 of the whole.
                let width = 1.0 - taper * side;
                let tapers = 0.5 * taper / width;
                Self {
                    center: self.center + along * (side + taper / 3.0 - tapers / 6.0),
                    sides: Sides { across: across * width, along: along * 0.5, taper: tapers },
                }
            } else {
                // s = side + s'/2: sides that lean.
                Self {
                    center: self.center + across * (side * (1.0 + taper * taper / 3.0)),
                    sides: Sides { across: across * 0.5, along: along - across * (side * taper), taper },
                }
            }
        })
    }

    /// Parts that are not wide, seen from a place, or as small as parts get.
    pub(crate) fn divided(self, at: Vec3, mut each: impl FnMut(Self)) {
        self.divide(at, MOST_HALVINGS, &mut each);
    }

    fn divide(self, at: Vec3, halvings: u32, each: &mut impl FnMut(Self)) {
        if halvings == 0 || !self.is_wide(at) {
            return each(self);
        }
        for half in self.halves() {
            half.divide(at, halvings - 1, each);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Floors, with their normal z: parallelogram and triangle.
    fn floors() -> [FlatPart; 2] {
        let sides = |taper| Sides { across: Vec3::new(2.0, 0.5, 0.0), along: Vec3::new(-0.3, 1.0, 0.0), taper };
        [0.0, 1.0].map(|taper| FlatPart { center: Vec3::new(0.4, 0.2, 0.0), sides: sides(taper) })
    }

    /// Form factor to a point across the direction, and to a plane, by many points; with the mean direction of what reaches the plane.
    fn brute_force(floor: &FlatPart, at: Vec3, normal: Vec3) -> (f32, f32, Vec3) {
        const N: usize = 1000;
        let Sides { across, along, taper } = floor.sides;
        let (mut across_all, mut on_plane, mut mean) = (0.0, 0.0, Vec3::ZERO);
        for i in 0..N * N {
            let [s, t] = [i % N, i / N].map(|k| 2.0 * (k as f32 + 0.5) / N as f32 - 1.0);
            let point = floor.center + across * (s * (1.0 - taper * t)) + along * (t + taper / 3.0);
            let to = point - at;
            let direction = to.normalize();
            let area = floor.area() * (1.0 - taper * t) / (N * N) as f32;
            let factor = area * (-direction.z).max(0.0) / (PI * to.length_squared());
            across_all += factor;
            on_plane += factor * normal.dot(direction).max(0.0);
            mean += direction * (factor * normal.dot(direction).max(0.0));
        }
        (across_all, on_plane, mean.normalize())
    }

    #[test]
    fn parts_are_the_whole_and_none_is_wide() {
        for floor in floors() {
            let at = Vec3::new(0.5, 0.1, 0.4);
            assert!(floor.is_wide(at), "the floor itself is");
            let (mut area, mut count) = (0.0, 0);
            floor.divided(at, |part| {
                assert!(!part.is_wide(at), "{part:?}");
                (area, count) = (area + part.area(), count + 1);
            });
            assert!((area / floor.area() - 1.0).abs() < 1e-4, "{area} of {}", floor.area());
            assert!(count < 1 << MOST_HALVINGS, "{count} parts");
            let far = Vec3::new(0.0, 0.0, 15.0);
            let mut parts = Vec::new();
            floor.divided(far, |part| parts.push(part));
            assert_eq!(parts, [floor], "from afar it is not divided");
        }
    }

    /// What a wall sees of the floor that it stands on: below, not in the floor's middle.
    #[test]
    fn parts_are_where_light_comes_from() {
        let normal = Vec3::X;
        for floor in floors() {
            for height in [0.3, 1.0] {
                let at = Vec3::new(-0.4, 0.0, height);
                let (across, plane, mean) = brute_force(&floor, at, normal);
                let (mut all, mut on_plane, mut direction) = (0.0, 0.0, Vec3::ZERO);
                floor.divided(at, |part| {
                    let (factor, to) = part.factor(Vec3::Z, at);
                    let cosine = to.dot(normal).max(0.0);
                    (all, on_plane, direction) =
                        (all + factor, on_plane + factor * cosine, direction + to * (factor * cosine));
                });
                let off = [all / across - 1.0, on_plane / plane - 1.0];
                assert!(off.iter().all(|off| off.abs() < 0.1), "height {height}: off by {off:?}");
                let turned = direction.normalize().angle_between(mean);
                let middle = (floor.center - at).angle_between(mean);
                // From afar the middle is not far off.
                let is_near = height < 1.0;
                assert!(
                    turned < if is_near { 0.2 * middle } else { 0.06 },
                    "height {height}: {turned} of {middle} rad off"
                );
            }
        }
    }
}

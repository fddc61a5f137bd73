//! What of a scene is in the picture.

use glam::Vec3;

/// The part of space that a picture shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// The eye, relative to the mesh's origin.
    pub(super) eye: Vec3,
    /// Normals of the four side planes through the eye; the picture is where all are ≥ 0.
    pub(super) sides: [Vec3; 4],
}

impl Sight {
    /// Those of the picture's sides that a ball is not wholly within, and how many they are.
    pub(super) fn crossing(&self, center: Vec3, radius: f32) -> ([Vec3; 4], usize) {
        let from_eye = center - self.eye;
        // A distance is off by a few units in the last place of what it is made of.
        let margin = 16.0 * f32::EPSILON * (center.abs().max(self.eye.abs()).max_element() + radius);
        let (mut crossing, mut count) = ([Vec3::ZERO; 4], 0);
        for side in self.sides {
            if side.dot(from_eye) <= radius + margin {
                crossing[count] = side;
                count += 1;
            }
        }
        (crossing, count)
    }
}

/// Whether a triangle faces an eye and is not wholly on the far side of one of some [sides](Sight::sides).
// Else its arguments go through memory, in pieces of other sizes than they are read in: most of its time.
#[inline(always)]
pub(super) fn may_be_seen([a, b, c]: [Vec3; 3], eye: Vec3, sides: &[Vec3]) -> bool {
    let normal = (b - a).cross(c - a);
    normal.dot(eye - a) > 0.0
        && sides.iter().all(|side| side.dot(a - eye) >= 0.0 || side.dot(b - eye) >= 0.0 || side.dot(c - eye) >= 0.0)
}

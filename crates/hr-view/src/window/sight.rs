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

/// Whether a triangle faces the eye and is not wholly on the far side of one of the picture's edges.
pub(super) fn may_be_seen([a, b, c]: [Vec3; 3], sight: &Sight) -> bool {
    let normal = (b - a).cross(c - a);
    normal.dot(sight.eye - a) > 0.0
        && sight.sides.iter().all(|side| [a, b, c].iter().any(|p| side.dot(p - sight.eye) >= 0.0))
}

//! What is proved of the light between two nodes before any ray is shot.

use crate::LightKind;
use crate::geometry::Aabb;
use crate::hierarchy::{Element, Kind, SceneData};
use crate::segments::DISTANT;
use crate::visibility::{End, MOST_LISTED, NO_BLOCKER, Proof, Shaft};

/// What is proved of all segments between points of two nodes that face each other. What of clusters hides the rest of them
/// is not looked into: of these only that nothing is between can be proved, or that one surface hides all.
pub(crate) fn prove(scene: &SceneData, receiver: &Element, sender: &Element) -> Proof {
    // Surfaces that cannot hide their own points from what these face.
    let own = |element: &Element| if element.is_patch() && element.convex { element.source } else { NO_BLOCKER };
    let clusters = receiver.kind == Kind::Cluster || sender.kind == Kind::Cluster;
    let most = if clusters { 0 } else { MOST_LISTED };
    scene.visibility.prove(&shaft(scene, receiver, sender), [own(receiver), own(sender)], most)
}

/// All segments between points of two nodes that face each other, or a little more.
pub(crate) fn shaft(scene: &SceneData, receiver: &Element, sender: &Element) -> Shaft {
    let target = end(scene, receiver);
    let source = match sender.kind {
        Kind::Light => match scene.lights[sender.source as usize].kind {
            LightKind::Directional { direction } => target.shifted(direction * -DISTANT),
            _ => End::point(sender.center),
        },
        _ => end(scene, sender),
    };
    Shaft::new([target, source])
}

fn end(scene: &SceneData, element: &Element) -> End {
    let bounds = Aabb { min: element.bounds[0], max: element.bounds[1] };
    if !element.is_patch() {
        return End::within(bounds);
    }
    End::of(&scene.surfaces()[element.source as usize], element.domain, element.normals.axis, bounds)
}

//! What is proved of the light between two nodes before any ray is shot.

use crate::LightKind;
use crate::geometry::Aabb;
use crate::hierarchy::{Element, Kind, SceneData};
use crate::segments::DISTANT;
use crate::visibility::{End, MOST_LISTED, NO_BLOCKER, Proof, Shaft};

/// What is proved of all segments between points of two nodes that face each other. What of clusters hides the rest of them
/// is not looked into: of these only that nothing is between can be proved.
pub(crate) fn prove(scene: &SceneData, receiver: &Element, sender: &Element) -> Proof {
    let (shaft, own) = shaft(scene, receiver, sender);
    let clusters = receiver.kind == Kind::Cluster || sender.kind == Kind::Cluster;
    scene.visibility.prove(&shaft, own, if clusters { 0 } else { MOST_LISTED })
}

/// The same for a part of a pair of which something is proved.
pub(crate) fn narrowed(scene: &SceneData, receiver: &Element, sender: &Element, whole: &Proof) -> Proof {
    let Proof::Among(surfaces) = whole else { return whole.clone() };
    let (shaft, own) = shaft(scene, receiver, sender);
    scene.visibility.prove_among(&shaft, own, surfaces)
}

/// The shaft from one node to another, and the surfaces of its ends that cannot hide their own points.
fn shaft(scene: &SceneData, receiver: &Element, sender: &Element) -> (Shaft, [u32; 2]) {
    let target = end(scene, receiver);
    let source = match sender.kind {
        Kind::Light => match scene.lights[sender.source as usize].kind {
            LightKind::Directional { direction } => target.shifted(direction * -DISTANT),
            _ => End::point(sender.center),
        },
        _ => end(scene, sender),
    };
    let own = |element: &Element| if element.is_patch() && element.convex { element.source } else { NO_BLOCKER };
    (Shaft::new([target, source]), [own(receiver), own(sender)])
}

fn end(scene: &SceneData, element: &Element) -> End {
    if element.is_patch() {
        let geometry = &scene.surfaces()[element.source as usize];
        if geometry.is_polygon() {
            let corners = geometry.corners(element.domain).into_iter().map(|uv| geometry.point(uv));
            return End::polygon(corners, element.normals.axis);
        }
    }
    End::within(Aabb { min: element.bounds[0], max: element.bounds[1] })
}

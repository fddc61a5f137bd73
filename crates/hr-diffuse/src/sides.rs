//! Senders as extensions see them: the hierarchy together with the surfaces that its elements are parts of.

use crate::cone::Cone;
use crate::geometry::Geometry;
use crate::hooks::{Hierarchy, LightField, NodeId, Sides};
use crate::transport::Light;
use glam::Vec3;

impl<L: LightField> Hierarchy for Light<'_, L> {
    fn parent(&self, node: NodeId) -> Option<NodeId> {
        self.elements.parent(node)
    }
    fn center(&self, node: NodeId) -> Vec3 {
        self.elements.center(node)
    }
    fn radius(&self, node: NodeId) -> f32 {
        self.elements.radius(node)
    }
    fn normals(&self, node: NodeId) -> Cone {
        self.elements.normals(node)
    }
    fn material(&self, node: NodeId) -> Option<u32> {
        self.elements.material(node)
    }
    fn direction_to(&self, sender: NodeId, at: Vec3) -> (Vec3, f32) {
        self.elements.direction_to(sender, at)
    }
    fn is_distant(&self, sender: NodeId) -> bool {
        self.elements.is_distant(sender)
    }
    fn sides(&self, sender: NodeId) -> Option<Sides> {
        let element = &self.elements.nodes[sender.index()];
        if !element.is_patch() {
            return None;
        }
        let geometry = &self.scene.surfaces()[element.source as usize];
        let corners = geometry.corners(element.domain);
        let corner = |k: usize| geometry.point(corners[k]);
        match geometry {
            Geometry::Triangle(_) => {
                let (a, b, c) = (corner(0), corner(1), corner(2));
                Some(Sides { across: (b - a) * 0.25, along: (c - (a + b) * 0.5) * 0.5, taper: 1.0 })
            }
            Geometry::Quad(_) => {
                let (a, b, c, d) = (corner(0), corner(1), corner(2), corner(3));
                Some(Sides { across: (b - a + c - d) * 0.25, along: (d - a + c - b) * 0.25, taper: 0.0 })
            }
            Geometry::Revolution(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::dvec3;
    use std::ops::ControlFlow;

    #[test]
    fn sides_are_those_of_surfaces_and_of_their_parts() {
        let at = |x: f64, y: f64| dvec3(x, y, 0.0);
        let grey = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ONE, two_sided: false };
        let input = SceneInput {
            surfaces: vec![
                Surface::new(Shape::Quad([at(0.0, 0.0), at(3.0, 0.0), at(3.0, 1.0), at(0.0, 1.0)]), 0),
                Surface::new(Shape::Triangle([at(5.0, 0.0), at(7.0, 0.0), at(5.0, 2.0)]), 0),
                Surface::new(Shape::Sphere { center: dvec3(3.0, 1.0, 2.0), radius: 0.7 }, 0),
            ],
            materials: vec![grey],
            ..SceneInput::default()
        };
        let mut solver = Solver::new(&input, Settings::with_error(0.1), ()).expect("sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let light = solver.light();
        let (mut found, mut parts) = ([0; 3], 0);
        for (node, element) in light.elements.nodes.iter().enumerate() {
            let sides = light.sides(NodeId(node as u32));
            if !element.is_patch() {
                assert_eq!(sides, None, "cluster {node}");
                continue;
            }
            found[element.source as usize] += 1;
            let Some(Sides { across, along, taper }) = sides else {
                assert_eq!(element.source, 2, "element {node} is flat");
                continue;
            };
            let area = 4.0 * across.cross(along).length();
            assert!((area / element.area - 1.0).abs() < 1e-4, "element {node}: {area}, not {}", element.area);
            let reach = Sides { across, along, taper }.reach();
            assert!((reach / element.radius - 1.0).abs() < 1e-3, "element {node}: {reach}, not {}", element.radius);
            parts += 1;
        }
        assert!(found.iter().all(|&n| n > 0) && parts > 2, "all surfaces, and parts of them: {found:?}");
    }
}

//! Small scenes, and what several tests do with them.

use glam::{DVec3, Vec3};
use glossy_ext::haar::Refinement;
use glossy_ext::{GlossyField, Lambert, Phong, Reflector, Ward};
use hr_diffuse::{
    DiffuseMaterial, Light, LightField, LightKind, Rgb, SceneInput, Settings, Shape, Solution, Solver, Surface,
};
use std::ops::ControlFlow;
use std::sync::Arc;

/// A room with everything that takes a path of its own: glossy and diffuse surfaces, a two-sided table that casts a
/// shadow, a sphere, a cylinder, an area light, a point light.
pub(crate) struct Room {
    pub(crate) input: SceneInput,
    pub(crate) reflectors: Vec<Arc<dyn Reflector>>,
}

/// A parallelogram with a corner and two sides; its front is where `a` × `b` points.
pub(crate) fn quad(corner: DVec3, a: DVec3, b: DVec3, material: u32) -> Surface {
    Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), material)
}

/// The six walls of a box, seen from inside.
pub(crate) fn walls(low: DVec3, high: DVec3, material: u32) -> Vec<Surface> {
    let size = high - low;
    let mut walls = Vec::new();
    for axis in 0..3 {
        let side = |k: usize| DVec3::AXES[(axis + k) % 3] * size[(axis + k) % 3];
        let (a, b) = (side(1), side(2));
        walls.push(quad(low, a, b, material));
        walls.push(quad(low + DVec3::AXES[axis] * size[axis], b, a, material));
    }
    walls
}

impl Room {
    pub(crate) fn new() -> Self {
        let ward = Ward::new(Rgb::splat(0.3), Rgb::splat(0.3), 0.2).expect("a Ward lobe");
        let phong = Phong::new(Rgb::new(0.4, 0.2, 0.1), Rgb::splat(0.3), 30.0).expect("a Phong lobe");
        let lambert = |r, g, b| Arc::new(Lambert::new(Rgb::new(r, g, b)).expect("a colour")) as Arc<dyn Reflector>;
        let reflectors: Vec<Arc<dyn Reflector>> = vec![
            lambert(0.6, 0.5, 0.4),
            Arc::new(ward),
            lambert(0.3, 0.6, 0.3),
            Arc::new(phong),
            lambert(0.0, 0.0, 0.0),
        ];
        let mut surfaces = walls(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), 0);
        // The box's walls come as x, y, z, low before high: the fifth is the floor.
        surfaces[4].material = 1;
        surfaces.push(quad(DVec3::new(1.0, 1.0, 0.75), DVec3::X * 1.5, DVec3::Y * 0.75, 2));
        surfaces.push(Surface::new(Shape::Sphere { center: DVec3::new(3.0, 2.0, 0.5), radius: 0.5 }, 3));
        let ends = [DVec3::new(1.5, 1.25, 0.0), DVec3::new(1.5, 1.25, 0.75)];
        surfaces.push(Surface::new(Shape::Cone { ends, radii: [0.25, 0.125] }, 2));
        surfaces.push(quad(DVec3::new(1.5, 1.0, 2.375), DVec3::Y, DVec3::X, 4));
        let materials = reflectors
            .iter()
            .enumerate()
            .map(|(i, reflector)| DiffuseMaterial {
                reflectance: reflector.diffuse(),
                exitance: if i == 4 { Rgb::new(60.0, 55.0, 50.0) } else { Rgb::ZERO },
                two_sided: i == 2,
            })
            .collect();
        let lights =
            vec![Light { position: DVec3::new(3.5, 0.5, 2.0), intensity: Rgb::splat(2.0), kind: LightKind::Point }];
        Self { input: SceneInput { surfaces, materials, lights, texture: None }, reflectors }
    }

    /// The same with the diffuse share of its materials only.
    pub(crate) fn diffuse() -> Self {
        let mut room = Self::new();
        for reflector in &mut room.reflectors {
            *reflector = Arc::new(Lambert::new(reflector.diffuse()).expect("a reflectance"));
        }
        room
    }

    /// The same room `scale` times as large, then moved; the point light is that much stronger, so that all
    /// irradiance stays.
    pub(crate) fn moved(mut self, scale: f64, offset: DVec3) -> Self {
        let at = |p: &mut DVec3| *p = *p * scale + offset;
        for surface in &mut self.input.surfaces {
            match &mut surface.shape {
                Shape::Triangle(points) => points.iter_mut().for_each(at),
                Shape::Quad(points) => points.iter_mut().for_each(at),
                Shape::Sphere { center, radius } => {
                    at(center);
                    *radius *= scale;
                }
                Shape::Cone { ends, radii } => {
                    ends.iter_mut().for_each(at);
                    radii.iter_mut().for_each(|r| *r *= scale);
                }
                other => panic!("the room has no {other:?}"),
            }
        }
        for light in &mut self.input.lights {
            at(&mut light.position);
            light.intensity *= (scale * scale) as f32;
        }
        self
    }

    pub(crate) fn solve(&self, error: f32) -> Solution<GlossyField> {
        solve(&self.input, error, GlossyField::new(&self.reflectors, Refinement::default()))
    }
}

/// Solves without being watched.
pub(crate) fn solve<L: LightField>(input: &SceneInput, error: f32, field: L) -> Solution<L> {
    let mut solver = Solver::new(input, Settings::with_error(error), field).expect("the scene is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.finish(&mut |_| ControlFlow::Continue(()))
}

/// Mean radiosity of each surface's front, W/m².
pub(crate) fn mean_radiosity<L: LightField>(solution: &Solution<L>) -> Vec<Rgb> {
    let nodes = &solution.elements.surface_nodes;
    nodes.iter().map(|[front, _]| solution.exitant.radiosity[*front as usize]).collect()
}

/// The numbers' bits, to compare exactly what `==` would call equal (0, −0) or never equal (NaN).
pub(crate) fn bits(values: &[Vec3]) -> Vec<[u32; 3]> {
    values.iter().map(|v| v.to_array().map(f32::to_bits)).collect()
}

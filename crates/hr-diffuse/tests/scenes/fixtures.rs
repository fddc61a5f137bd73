//! What the rooms are made of.

use glam::DVec3;
use hr_diffuse::flat::{Reader, Writer};
use hr_diffuse::{
    DiffuseMaterial, Light, LightKind, Progress, Rgb, SceneInput, Settings, Shape, Solution, Solver, Surface,
};
use std::ops::ControlFlow;

/// A parallelogram, counter-clockwise.
pub(crate) fn quad(corner: DVec3, a: DVec3, b: DVec3, material: u32) -> Surface {
    Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), material)
}

/// Floor, ceiling and walls of 4 × 3 × 2.5 m, seen from inside. The floor and the wall at y = 0 have materials of their own.
pub(crate) fn walls(floor: u32, front: u32, others: u32) -> Vec<Surface> {
    let (x, y, z) = (DVec3::X * 4.0, DVec3::Y * 3.0, DVec3::Z * 2.5);
    let o = DVec3::ZERO;
    vec![
        quad(o, x, y, floor),
        quad(o + z, y, x, others),
        quad(o, y, z, others),
        quad(x, z, y, others),
        quad(o, z, x, front),
        quad(y, x, z, others),
    ]
}

/// A table without legs, 0.8 m above the floor.
pub(crate) fn table(material: u32) -> Surface {
    quad(DVec3::new(1.0, 1.0, 0.8), DVec3::X * 1.5, DVec3::Y * 0.8, material)
}

/// A lamp just below the ceiling that shines down.
pub(crate) fn ceiling_lamp(material: u32) -> Surface {
    quad(DVec3::new(0.5, 0.5, 2.45), DVec3::Y * 0.4, DVec3::X * 0.4, material)
}

/// Reflects on both sides.
pub(crate) fn paint(reflectance: Rgb) -> DiffuseMaterial {
    DiffuseMaterial { reflectance, exitance: Rgb::ZERO, two_sided: true }
}

/// Shines, and reflects nothing.
pub(crate) fn lamp(exitance: Rgb) -> DiffuseMaterial {
    DiffuseMaterial { reflectance: Rgb::ZERO, exitance, two_sided: false }
}

/// A white bulb.
pub(crate) fn bulb() -> Light {
    Light { position: DVec3::new(2.0, 2.5, 1.5), intensity: Rgb::splat(3.0), kind: LightKind::Point }
}

/// Watches, and never breaks.
pub(crate) fn on(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A solver that has solved.
pub(crate) fn solved(input: &SceneInput, settings: Settings) -> Solver {
    let mut solver = Solver::new(input, settings, ()).expect("the room is sound");
    solver.solve(&mut on);
    solver
}

/// Mean irradiance of the sides that have elements, of all surfaces in order.
pub(crate) fn sides(solver: &Solver) -> Vec<Rgb> {
    let nodes = solver.elements().surface_nodes.iter().flatten().filter(|&&node| node != u32::MAX);
    nodes.map(|&node| solver.exitant().irradiance[node as usize]).collect()
}

/// Largest difference, relative to what `b` has.
pub(crate) fn apart(a: &[Rgb], b: &[Rgb]) -> f32 {
    assert_eq!(a.len(), b.len(), "the same sides");
    a.iter().zip(b).map(|(a, b)| ((*a - *b).abs() / b.max(Rgb::splat(1e-6))).max_element()).fold(0.0, f32::max)
}

/// A solution as it is kept: the solver's part and the extension's, in two runs.
pub(crate) fn stored(solution: &Solution) -> [Vec<u8>; 3] {
    let mut parts = [Vec::new(), Vec::new(), Vec::new()];
    let [own, light @ ..] = &mut parts;
    solution.store(&mut Writer::new(own)).expect("memory takes everything");
    for (run, light) in light.iter_mut().enumerate() {
        solution.store_light(run, 2, &mut Writer::new(light)).expect("memory takes everything");
    }
    parts
}

/// A solution that was kept.
pub(crate) fn restored(input: &SceneInput, parts: &[Vec<u8>; 3]) -> Solution {
    let mut parts = parts.each_ref().map(Vec::as_slice);
    let [mut own, mut light @ ..] = parts.each_mut().map(|part| {
        let length = part.len() as u64;
        Reader::new(part, length)
    });
    Solution::restore(input, (), &mut own, &mut light).expect("what was written")
}

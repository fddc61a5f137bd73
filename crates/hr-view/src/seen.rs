//! What pictures show: the leaves that cameras see, by themselves or mirrored. Values at vertices of others need not be made.

use glam::{DVec3, Vec2, Vec3};
use glossy_ext::GlossyField;
use hr_diffuse::{Hit, Solver};
use hr_scene::{Camera, Scene};
use rayon::prelude::*;

/// No more rays than these are sent from all cameras together, 0.2 s of one core: where that is less than one through each pixel, from
/// a coarser grid. What falls between them is smaller than what is seen of its surroundings, and has the light of its element.
const MOST_RAYS: usize = 1 << 19;

/// By node, whether it is a leaf that a picture of one of the cameras shows. Rays that follow wide lobes meet others, too, which are
/// seen blurred: no better for values at vertices.
pub(crate) fn seen(scene: &Scene, solver: &Solver<GlossyField>, cameras: &[Camera]) -> Vec<bool> {
    let pixels: usize = cameras.iter().map(|camera| camera.width as usize * camera.height as usize).sum();
    let step = (pixels as f64 / MOST_RAYS as f64).sqrt().ceil().max(1.0) as usize;
    let (data, elements) = (solver.scene(), solver.elements());
    let along = |origin: Vec3, direction: Vec3, own: u32| {
        let hit = data.visibility.closest_except(origin, direction, 0.0, f32::MAX, own)?;
        Some((hit, elements.leaf_at(data, hit.surface, !hit.front, hit.uv)?.index()))
    };
    let is_diffuse = |hit: &Hit| {
        let material = scene.surfaces[hit.surface as usize].material;
        scene.materials[material as usize].reflector.is_diffuse()
    };
    let mut seen = vec![false; elements.nodes.len()];
    for camera in cameras {
        let (eye, rays) = (data.normalization.to_unit(DVec3::from(camera.eye)), camera.rays());
        let row = |y: usize| {
            let mut leaves = Vec::new();
            for x in (0..camera.width as usize).step_by(step) {
                let direction = rays.within(x, y, Vec2::splat(0.5 * step as f32));
                let Some((hit, leaf)) = along(eye, direction, u32::MAX) else { continue };
                leaves.push(leaf);
                if !is_diffuse(&hit) {
                    let mirrored = direction.reflect(data.shading_normal(hit.surface, hit.uv));
                    leaves.extend(along(hit.point, mirrored, hit.surface).map(|(_, leaf)| leaf));
                }
            }
            leaves
        };
        let rows: Vec<usize> = (0..camera.height as usize).step_by(step).collect();
        let found: Vec<Vec<usize>> = rows.into_par_iter().map(row).collect();
        found.into_iter().flatten().for_each(|leaf| seen[leaf] = true);
    }
    seen
}

#[cfg(test)]
mod tests {
    use crate::Mode;
    use crate::raycast::RayCaster;
    use crate::solved::{Purpose, Solved, Wanted};
    use hr_diffuse::Settings;
    use hr_scene::{Image, Scene};
    use std::sync::Arc;

    /// The built-in room has much behind the camera, and a polished floor.
    #[test]
    fn pictures_are_the_same_without_what_they_do_not_show() {
        const ERROR: f32 = 0.3;
        let scene = Arc::new(Scene::load("room").expect("built in"));
        let mut camera = scene.default_camera();
        (camera.width, camera.height) = (120, 80);
        let cameras = [camera];
        let solve = |purpose| {
            let settings = Settings::with_error(ERROR);
            let asked = Solved::awaited(Arc::clone(&scene), settings, purpose, &mut |_| Wanted::Whole);
            asked.expect("a sound scene").0.solution
        };
        let all = solve(Purpose { distributions: true, cameras: None });
        for mode in [Mode::Samples, Mode::Distributions] {
            let some = solve(Purpose { distributions: mode == Mode::Distributions, cameras: Some(&cameras) });
            let [one, other] =
                [&all, &some].map(|solution| RayCaster::new(&scene, solution, mode).render(&camera, &|_| ()));
            let unseen = some.stats.skipped.unseen_vertices as usize;
            assert_eq!(all.stats.skipped.unseen_vertices, 0, "from anywhere all may be seen");
            assert!(2 * unseen > some.vertices.positions.len(), "{unseen} of {}", some.vertices.positions.len());
            let leaves = some.stats.skipped.unseen_leaves;
            assert_eq!(leaves > 100, mode == Mode::Distributions, "{mode:?}: {leaves} are not reflected");
            assert!(2 * some.stats.vertex_rays < all.stats.vertex_rays, "rays are saved");
            let light = |image: &Image| image.pixels.iter().map(|pixel| pixel.element_sum()).sum::<f32>();
            let apart = one.pixels.iter().zip(&other.pixels).map(|(a, b)| (*a - *b).abs().element_sum()).sum::<f32>();
            assert!(apart < 0.05 * ERROR * light(&one), "{mode:?}: {:.4} of the light", apart / light(&one));
        }
    }
}

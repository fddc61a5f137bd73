//! Exposure as a photographer sets it: by what the camera sees, and then held.
//!
//! A picture is exposed for itself ([`ToneMap`]). What has no picture of its own, such as the window, the page and frames of a
//! walk, is exposed for small pictures that the ray caster takes from the cameras concerned, so that all of them come out alike.

use crate::glossy::Mode;
use crate::raycast::RayCaster;
use crate::solved::Solved;
use hr_scene::{Camera, Rgb, ToneMap};

/// Width of the small pictures.
const WIDTH: u32 = 80;

/// What radiance is multiplied by in pictures that some cameras take of a solution, and that are to be exposed alike; `None` where they
/// see no light at all.
#[must_use]
pub fn exposure(solved: &Solved, mode: Mode, cameras: &[Camera]) -> Option<f32> {
    let caster = RayCaster::new(&solved.scene, &solved.solution, mode).with_grid(1);
    let small = |camera: &Camera| {
        let shape = f64::from(camera.height.max(1)) / f64::from(camera.width.max(1));
        let height = (f64::from(WIDTH) * shape).round().clamp(1.0, f64::from(4 * WIDTH)) as u32;
        Camera { width: WIDTH, height, ..*camera }
    };
    let seen: Vec<Rgb> = cameras.iter().flat_map(|camera| caster.render(&small(camera), &|_| ()).pixels).collect();
    let is_lit = seen.iter().any(|light| light.max_element() > 0.0);
    is_lit.then(|| ToneMap::default().factor(&seen, solved.scene.primaries))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hr_diffuse::Settings;
    use hr_scene::Scene;
    use std::ops::ControlFlow;
    use std::sync::Arc;

    #[test]
    fn what_is_metered_is_what_the_picture_comes_to() {
        for name in ["three-lights", "cornell", "glossy-sphere"] {
            let scene = Arc::new(Scene::load(name).expect("built in"));
            let watch = &mut |_: &_| ControlFlow::Continue(());
            let solved = Solved::new(scene, Settings::with_error(0.3), true, watch).expect("sound");
            for (view, camera) in &solved.scene.cameras {
                let camera = Camera { width: 200, height: 150, ..*camera };
                for mode in [Mode::Distributions, Mode::Samples] {
                    let picture = RayCaster::new(&solved.scene, &solved.solution, mode).render(&camera, &|_| ());
                    let own = ToneMap::default().factor(&picture.pixels, solved.scene.primaries);
                    let metered = exposure(&solved, mode, &[camera]).expect("light");
                    // A tenth of a stop.
                    let stops = (metered / own).log2();
                    assert!(stops.abs() < 0.1, "{name}, {view}, {mode:?}: {stops} stops");
                }
            }
        }
    }

    #[test]
    fn darkness_has_no_exposure() {
        let scene = Arc::new(Scene::load("cornell").expect("built in"));
        let watch = &mut |_: &_| ControlFlow::Continue(());
        let solved = Solved::new(scene, Settings::with_error(0.5), true, watch).expect("sound");
        let camera = solved.scene.default_camera();
        let away = Camera { eye: [1e4, 1e4, 1e4], target: [2e4, 1e4, 1e4], up: [0.0, 0.0, 1.0], ..camera };
        assert_eq!(exposure(&solved, Mode::Distributions, &[away]), None, "nothing is seen");
        let both = exposure(&solved, Mode::Distributions, &[away, camera]);
        assert!(both.is_some_and(|factor| factor > 0.0), "one of two sees something: {both:?}");
    }
}

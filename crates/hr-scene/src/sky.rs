//! A sky, for what stands in the open, and for scenes that bring no light.

use crate::reflectors::phong;
use crate::viewpoint::bounds_of;
use crate::{Material, Rgb, Scene, SceneError};
use glam::DVec3;
use hr_diffuse::{Shape, Surface};
use std::f32::consts::PI;

/// Radius of the sky, in radii of the sphere around surfaces and cameras: whoever walks about what is there stays within it.
const RADIUS: f64 = 10.0;

impl Scene {
    /// Lets the same radiance (W/(m² sr), ≥ 0) come from everywhere: puts a sphere around surfaces and cameras, of a material `sky`, that
    /// shines inward and reflects nothing. What no surface hides from it receives π times the radiance. Choose cameras before: within
    /// a sky every place is inside of something, see [`default_camera`](Self::default_camera).
    ///
    /// # Errors
    /// [`SceneError::Empty`] where there is no surface.
    pub fn add_sky(&mut self, radiance: Rgb) -> Result<(), SceneError> {
        let (low, high) = self.bounds().ok_or_else(|| SceneError::empty(self.name.clone(), &self.warnings))?;
        let center = (low + high) * 0.5;
        let eyes = self.cameras.iter().map(|(_, camera)| DVec3::from(camera.eye).distance(center));
        let radius = RADIUS * eyes.fold((high - low).length() * 0.5, f64::max);
        let material = self.materials.len() as u32;
        self.materials.push(Material {
            name: "sky".to_owned(),
            reflector: phong(Rgb::ZERO, Rgb::ZERO, 0.0),
            exitance: radiance * PI,
            two_sided: false,
            texture: None,
            base_color: Rgb::ONE,
        });
        self.surfaces.push(Surface { flip: true, ..Surface::new(Shape::Sphere { center, radius }, material) });
        // The scene is wider now.
        self.leave_out_vanishing(|surface| surface);
        Ok(())
    }

    /// How far it is across all there is, in scene units, but for skies: spheres that shine inward. 0 where nothing else is there.
    #[must_use]
    pub fn extent(&self) -> f64 {
        let is_sky = |surface: &Surface| {
            matches!(surface.shape, Shape::Sphere { .. })
                && surface.flip
                && self.materials.get(surface.material as usize).is_some_and(|m| m.exitance != Rgb::ZERO)
        };
        let bounds = bounds_of(self.surfaces.iter().filter(|surface| !is_sky(surface)));
        bounds.map_or(0.0, |(low, high)| (high - low).length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;

    #[test]
    fn the_sky_is_around_everything() {
        let mut scene = Scene::load("cornell").expect("built in");
        let (_, camera) = scene.cameras[0];
        let far = Camera { eye: [1e3, 2e3, -3e3], ..camera };
        scene.cameras.push(("far".into(), far));
        let (low, high) = scene.bounds().expect("surfaces");
        let (surfaces, extent) = (scene.surfaces.len(), scene.extent());
        assert!((extent / (high - low).length() - 1.0).abs() < 1e-12, "{extent} across {low} {high}");
        scene.add_sky(Rgb::new(1.0, 2.0, 3.0)).expect("there are surfaces");
        let scene = scene.finish().expect("it is sound");
        assert_eq!(scene.surfaces.len(), surfaces + 1, "one surface");
        assert_eq!(scene.extent(), extent, "a sky is no place to walk to");
        let sky = &scene.surfaces[surfaces];
        let Shape::Sphere { center, radius } = sky.shape else { panic!("{sky:?}") };
        assert!(sky.flip, "its front is inside");
        for point in [low, high, DVec3::from(far.eye)] {
            assert!(point.distance(center) < 0.11 * radius, "{point} is well inside of {radius} about {center}");
        }
        let material = &scene.materials[sky.material as usize];
        assert_eq!(material.exitance, Rgb::new(1.0, 2.0, 3.0) * PI, "radiance times π");
        assert!(Scene::default().add_sky(Rgb::ONE).is_err(), "there is nothing to be lit");
    }
}

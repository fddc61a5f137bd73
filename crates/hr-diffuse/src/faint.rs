//! Faint light: what materials reflect beside their diffuse part where that is so little that transport carries it as diffuse light.
//!
//! How much it is depends on where light comes from: a smooth dielectric reflects half of its mean of what falls on it from above, and
//! several times its mean of what grazes it, as on a ceiling above a cove. Links know where from, so each leaf reflects as much as it
//! should, though not to where.

use crate::hooks::LightField;
use crate::{DiffuseMaterial, Rgb};

/// Materials that reflect no more than this share of the error asked for beside their diffuse part have it carried as
/// diffuse light until it is shown; and bright ones, no more than the error times all that they reflect: most of their light is diffuse anyhow.
const FAINT_SHARE: f32 = 0.7;
/// Cosines of the table: squares of equal steps, as albedos change fastest toward the horizon.
const STEPS: usize = 16;
/// With what is grazing a leaf reflects no more than this of all that arrives, or no more than on average: so light dies out.
const MOST: f32 = 0.98;

/// By material: what is reflected beside the diffuse part, as diffuse and as directional light.
pub(crate) fn sorted<L: LightField>(field: &L, materials: &[DiffuseMaterial], error: f32) -> (Vec<Rgb>, Vec<Rgb>) {
    let sort = |(material, diffuse): (u32, &DiffuseMaterial)| {
        let Some(albedo) = field.active(material) else { return (Rgb::ZERO, Rgb::ZERO) };
        let most = error * (albedo + diffuse.reflectance).min_element().max(FAINT_SHARE);
        if albedo.max_element() <= most { (albedo, Rgb::ZERO) } else { (Rgb::ZERO, albedo) }
    };
    (0..).zip(materials).map(sort).unzip()
}

/// By material, how many times its mean is reflected of light from a direction, by its cosine.
#[derive(Debug)]
pub(crate) struct Grazing(Vec<[f32; STEPS + 1]>);

impl Grazing {
    /// For what materials reflect beside their diffuse part on average; `None` where there is nothing.
    pub(crate) fn new<L: LightField>(field: &L, faint: &[Rgb]) -> Option<Self> {
        let times = |(material, mean): (u32, &Rgb)| {
            std::array::from_fn(|i| {
                let cosine = (i as f32 / STEPS as f32).powi(2);
                let albedo = field.directional_albedo(material, cosine).unwrap_or(*mean);
                let times = albedo.element_sum() / mean.element_sum();
                if times.is_finite() { times.max(0.0) } else { 1.0 }
            })
        };
        faint.iter().any(|faint| *faint != Rgb::ZERO).then(|| Self((0..).zip(faint).map(times).collect()))
    }

    /// Interpolated at a cosine.
    pub(crate) fn times(&self, material: u32, cosine: f32) -> f32 {
        let (table, at) = (&self.0[material as usize], cosine.clamp(0.0, 1.0).sqrt() * STEPS as f32);
        let step = (at as usize).min(STEPS - 1);
        table[step] + (table[step + 1] - table[step]) * (at - step as f32)
    }
}

/// How many times the mean `faint` a leaf of this reflectance may reflect.
pub(crate) fn most_times(reflectance: Rgb, faint: Rgb) -> f32 {
    ((MOST - reflectance.max_element()) / faint.max_element().max(f32::MIN_POSITIVE)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hooks::{Arrived, Hierarchy, NodeId, Transfer};
    use crate::{Cone, DiffuseMaterial, Light, LightKind, SceneInput, Settings, Shape, Solver, Surface, Transport};
    use glam::{DVec3, Vec3};
    use std::ops::ControlFlow;

    const MEAN: f32 = 0.06;

    /// Reflects nothing of what falls along the normal, and three times its mean, weighted by cosines, of what grazes it.
    struct Dielectric;

    impl LightField for Dielectric {
        type Incident = ();
        type Exitant = ();

        fn active(&self, _: u32) -> Option<Rgb> {
            Some(Rgb::splat(MEAN))
        }
        fn directional_albedo(&self, _: u32, cosine: f32) -> Option<Rgb> {
            Some(Rgb::splat(3.0 * MEAN * (1.0 - cosine)))
        }
        fn clear(&self, (): &mut ()) {}
        fn receive(&self, (): &mut (), _: &Transfer) {}
        fn reflect<H: Hierarchy>(&self, _: &H, _: NodeId, _: &[&()], _: Arrived) {}
        fn radiance(&self, (): &(), _: Vec3) -> Rgb {
            Rgb::ZERO
        }
        fn radiance_bounds(&self, (): &(), _: &Cone) -> (Rgb, Rgb) {
            (Rgb::ZERO, Rgb::ZERO)
        }
    }

    /// What a floor of this reflectance sends of all that arrives from the sun, whose cosine is given.
    fn reflected(reflectance: f32, cosine: f32, transport: Transport) -> f32 {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let floor = DiffuseMaterial { reflectance: Rgb::splat(reflectance), exitance: Rgb::ZERO, two_sided: false };
        let direction = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, -cosine);
        let kind = LightKind::Directional { direction };
        let input = SceneInput {
            surfaces: vec![Surface::new(Shape::Quad(corners), 0)],
            materials: vec![floor],
            lights: vec![Light { position: DVec3::ZERO, intensity: Rgb::ONE, kind }],
            ..SceneInput::default()
        };
        let settings = Settings { transport, ..Settings::with_error(0.3) };
        let mut solver = Solver::new(&input, settings, Dielectric).expect("the floor is sound");
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let leaf = solver.elements.patch_leaves().next().expect("it has a leaf") as usize;
        solver.exitant.radiosity[leaf].x / solver.exitant.irradiance[leaf].x
    }

    #[test]
    fn what_grazes_is_reflected_more_than_what_falls() {
        for transport in [Transport::Gather, Transport::Shoot] {
            for cosine in [0.1, 0.3, 0.9] {
                let (found, exact) = (reflected(0.2, cosine, transport), 0.2 + 3.0 * MEAN * (1.0 - cosine));
                assert!((found - exact).abs() < 0.005, "{transport:?}: {found}, not {exact}, at {cosine}");
            }
        }
    }

    #[test]
    fn nothing_reflects_more_than_arrives() {
        assert!((reflected(0.9, 0.01, Transport::Gather) - MOST).abs() < 1e-4, "what grazes a white floor");
        assert!((most_times(Rgb::splat(0.97), Rgb::splat(0.03)) - 1.0).abs() < 1e-6, "as much as on average");
    }
}

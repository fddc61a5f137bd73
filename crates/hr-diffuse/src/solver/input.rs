//! Scenes that are handed in: checked, and mapped to unit space.

use crate::error::SolveError;
use crate::geometry::{Geometry, Normalization};
use crate::hierarchy::SceneData;
use crate::threads;
use crate::twins::twins;
use crate::visibility::Visibility;
use crate::{LightKind, SceneInput};

/// Exitances and intensities above this are refused: sums of powers and what white surfaces make of them would leave the
/// range of f32.
const MOST_LIGHT: f32 = 1e30;

/// Checks what can be checked of a scene without its geometry.
pub(crate) fn check(input: &SceneInput) -> Result<(), SolveError> {
    if input.surfaces.is_empty() {
        return Err(SolveError::Empty);
    }
    for (i, material) in input.materials.iter().enumerate() {
        let wrong = |what, value, range| Err(SolveError::MaterialValue { material: i, what, value, range });
        let r = material.reflectance;
        if !r.is_finite() || r.min_element() < 0.0 || r.max_element() > 1.0 {
            return wrong("reflectance", r, "within 0…1");
        }
        let e = material.exitance;
        if !e.is_finite() || e.min_element() < 0.0 {
            return wrong("exitance", e, "not negative");
        }
        if e.max_element() > MOST_LIGHT {
            return wrong("exitance", e, "at most 1e30 W/m²");
        }
    }
    for (surface, s) in input.surfaces.iter().enumerate() {
        if s.material as usize >= input.materials.len() {
            return Err(SolveError::Material { surface, material: s.material, count: input.materials.len() });
        }
    }
    for (light, l) in input.lights.iter().enumerate() {
        if let Some(what) = l.fault() {
            return Err(SolveError::Light { light, what });
        }
    }
    Ok(())
}

/// Checks a scene and maps it to unit space.
pub(crate) fn scene_data(input: &SceneInput) -> Result<SceneData, SolveError> {
    scene_in(input, Normalization::new(&input.surfaces))
}

/// Checks a scene and maps it to a unit space that there is.
pub(crate) fn scene_in(input: &SceneInput, normalization: Normalization) -> Result<SceneData, SolveError> {
    scene_by(input, normalization, |surfaces, materials| {
        let twins = twins(&surfaces, materials);
        Ok((Visibility::with_twins(&surfaces, &twins), twins))
    })
}

/// Checks a scene and maps it to a unit space that there is; a closure makes of surfaces and materials what answers rays, and
/// tells which surfaces coincide.
pub(crate) fn scene_by<E: From<SolveError>>(
    input: &SceneInput,
    normalization: Normalization,
    rays: impl FnOnce(Vec<Geometry>, &[u32]) -> Result<(Visibility, Vec<u32>), E>,
) -> Result<SceneData, E> {
    check(input)?;
    let all = threads::map_range(0..input.surfaces.len(), 256, |surface| {
        let geometry = Geometry::from_surface(&input.surfaces[surface], &normalization);
        geometry.map_err(|source| SolveError::Surface { surface, source })
    });
    // The first error of all, whichever thread finds one first.
    let surfaces = all.into_iter().collect::<Result<Vec<_>, _>>()?;
    let lights = unit_lights(input, &normalization)?;
    let surface_materials: Vec<u32> = input.surfaces.iter().map(|s| s.material).collect();
    let (visibility, twins) = rays(surfaces, &surface_materials)?;
    Ok(SceneData {
        visibility,
        surface_materials,
        twins,
        shading_normals: input.surfaces.iter().map(|s| s.shading_normals).collect(),
        materials: input.materials.clone(),
        lights,
        light_positions: input.lights.iter().map(|l| normalization.to_unit(l.position)).collect(),
        texture: input.texture.clone(),
        normalization,
    })
}

/// Lights without extent in unit space, which their positions are not mapped to.
pub(crate) fn unit_lights(input: &SceneInput, normalization: &Normalization) -> Result<Vec<crate::Light>, SolveError> {
    let scale2 = (normalization.scale() * normalization.scale()) as f32;
    for (light, l) in input.lights.iter().enumerate() {
        // Far outside of the scene f32 ends: its square, which the inverse square law needs, must exist.
        if normalization.to_unit(l.position).abs().max_element() > 1e15 {
            return Err(SolveError::Light { light, what: "it is too far from the scene; make it a directional light" });
        }
    }
    let lights: Vec<crate::Light> = input
        .lights
        .iter()
        .map(|l| match l.kind {
            LightKind::Directional { .. } => *l,
            _ => crate::Light { intensity: l.intensity * scale2, ..*l },
        })
        .collect();
    // In a scene of micrometres a light of kilowatts is beyond f32.
    if let Some(light) = lights.iter().position(|l| l.intensity.max_element() > MOST_LIGHT) {
        return Err(SolveError::Light { light, what: "it is too strong for the size of the scene" });
    }
    Ok(lights)
}

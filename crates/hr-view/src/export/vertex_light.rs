//! Light at the vertices of the finest elements.

use super::even_radiance;
use super::glb::Glb;
use super::harmonics::{self, COUNT};
use crate::display::DisplayMesh;
use crate::facets::Source;
use crate::glossy::interpolated;
use crate::solved::Solved;
use crate::window::Tone;
use crate::window::lists::{VertexList, split};
use glam::Vec3;
use hr_diffuse::Rgb;
use rayon::prelude::*;
use serde_json::json;
use std::f32::consts::PI;

/// Adds the mesh; none of a scene where nothing is shown.
pub(super) fn add(
    file: &mut Glb,
    solved: &Solved,
    mesh: &DisplayMesh,
    sources: &[Source],
    tone: &Tone,
) -> Option<usize> {
    let texels = texels(mesh);
    let diffuse = |v: u32| mesh.irradiance[v as usize] * mesh.tint[v as usize] * texels[v as usize];
    // Which of the glossy vertices a vertex is.
    let mut source_of = vec![None; mesh.positions.len()];
    for (source, &vertex) in sources.iter().zip(&mesh.glossy) {
        source_of[vertex as usize] = Some(source);
    }
    let shown = |v: u32| {
        let material = source_of[v as usize].map(|s| solved.solution.elements.nodes[s.leaf as usize].material);
        let reflected = match material {
            Some(material) => {
                let reflectance = mesh.tint[v as usize] * texels[v as usize] * PI;
                even_radiance(solved, material, reflectance, mesh.irradiance[v as usize], false)
            }
            None => diffuse(v),
        };
        reflected + mesh.emission[v as usize]
    };
    let material = file.unlit("light at vertices", None, &json!({}));
    let mut primitives = Vec::new();
    for (list, glossy) in split(mesh, &[]).iter().zip([false, true]) {
        if list.indices.is_empty() {
            continue;
        }
        let to_709 = |light: Rgb| tone.to_srgb * light;
        let vertices = || list.vertices.iter().copied();
        let color = |v: u32| (to_709(shown(v)) * tone.exposure).clamp(Vec3::ZERO, Vec3::ONE);
        let mut attributes = json!({
            "POSITION": file.vectors(vertices().map(|v| mesh.positions[v as usize])),
            "NORMAL": file.vectors(vertices().map(|v| mesh.normals[v as usize])),
            "COLOR_0": file.vectors(vertices().map(color)),
            "_IRRADIANCE": file.vectors(vertices().map(|v| to_709(mesh.irradiance[v as usize]))),
            "_RADIANCE": file.vectors(vertices().map(|v| to_709(diffuse(v) + mesh.emission[v as usize]))),
        });
        if glossy {
            let coefficients = directional(solved, mesh, &source_of, list);
            for i in 0..COUNT {
                let values = coefficients.iter().map(|c| to_709(c[i]));
                attributes[format!("_SH_{i}")] = file.vectors(values).into();
            }
        }
        let indices = file.indices(&list.indices);
        primitives.push(json!({ "attributes": attributes, "indices": indices, "material": material }));
    }
    let extras = json!({ "exposure": tone.exposure });
    (!primitives.is_empty()).then(|| file.mesh("light at vertices", &primitives, &extras))
}

/// What the textures of batches are at each vertex.
fn texels(mesh: &DisplayMesh) -> Vec<Rgb> {
    let mut texels = vec![Rgb::ONE; mesh.positions.len()];
    for batch in &mesh.batches {
        let Some(texture) = batch.texture else { continue };
        for &vertex in &mesh.indices[batch.indices.start as usize..batch.indices.end as usize] {
            texels[vertex as usize] = mesh.textures[texture as usize].sample(mesh.uv[vertex as usize]);
        }
    }
    texels
}

/// Radiance that follows the eye, by vertex of a list.
fn directional(
    solved: &Solved,
    mesh: &DisplayMesh,
    source_of: &[Option<&Source>],
    list: &VertexList,
) -> Vec<[Rgb; COUNT]> {
    let project = |&vertex: &u32| {
        let Some(source) = source_of[vertex as usize] else { return [Rgb::ZERO; COUNT] };
        let normal = mesh.normals[vertex as usize];
        let place = source.place(&solved.solution);
        harmonics::project(|away| {
            let above = away.dot(normal) > 0.0;
            if above { interpolated(&solved.solution, &source.corners, (place, normal), away) } else { Rgb::ZERO }
        })
    };
    list.vertices.par_iter().map(project).collect()
}

//! glTF 2.0, .gltf and .glb.
//!
//! Read: node hierarchies, instances and mirrored ones; triangles, strips and fans, indexed or not, interleaved,
//! quantised or sparse; metallic-roughness materials with base colour textures and vertex colours; emission with
//! `KHR_materials_emissive_strength`; `KHR_texture_transform`; `KHR_lights_punctual`; perspective cameras.
//! Whatever is not simulated is named in the scene's warnings.
//!
//! Units: emission is radiance (W/(m² sr)), candela are taken as W/sr and lux as W/m², up to the file's own
//! photometric scale. Colours are linear Rec. 709. A pair of triangles that is a parallelogram becomes one
//! quadrilateral.

mod accessor;
mod document;
mod material;
#[cfg(test)]
mod tests;

use crate::mesh::{MAX_SURFACES, Part, Vertices, merge, place};
use crate::warnings::Warnings;
use crate::whole_file::read_whole;
use crate::{Camera, Primaries, Scene, SceneError};
use document::Document;
use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use glossy_ext::Rgb;
use gltf::json::extensions::scene::khr_lights_punctual::{Light as LightSource, Type as LightType};
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;
use hr_diffuse::{Light, LightKind};
use material::Materials;
use std::path::Path;

/// Width in pixels of the cameras; the height follows from their aspect ratio.
const CAMERA_WIDTH: u32 = 400;

/// Aspect ratio of cameras that leave it to the window.
const CAMERA_ASPECT: f64 = 4.0 / 3.0;

/// Smallest half-angle of a spot light's cone in radians: its cosine can still be told from 1 by the ramp.
const MIN_CONE: f32 = 0.02;

/// Smallest difference of the cosines of a spot light's cones: the ramp between them divides by it.
const MIN_RAMP: f32 = 1e-4;

/// Loads the default scene (else the first) of a .gltf or .glb file, with the files that it refers to.
///
/// Which of the two kinds it is, the file's first bytes say.
///
/// # Errors
/// [`SceneError::Io`] where the file cannot be read, [`SceneError::Syntax`] with the JSON path where one of its buffers
/// cannot, where it is damaged, contradicts the specification or requires an extension that is not supported,
/// [`SceneError::Empty`] where it has no triangle. Images that cannot be read are only warned of.
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    from_bytes(&read_whole(path)?, path)
}

/// As [`load`], for a file's contents; `path` is where other files are looked for, and its name.
pub(crate) fn from_bytes(bytes: &[u8], path: &Path) -> Result<Scene, SceneError> {
    let document = Document::new(bytes, path)?;
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let mut loader = Loader {
        meshes: document.root.meshes.iter().map(|_| None).collect(),
        document: &document,
        materials: Materials::default(),
        scene: Scene { name, primaries: Primaries::Rec709, ..Scene::default() },
        warnings: Warnings::default(),
    };
    for extension in document.ignored_extensions() {
        loader.warnings.add(format!("the extension {extension} is not simulated"), || "extensionsUsed".to_owned());
    }
    if !document.root.animations.is_empty() {
        loader.warnings.add("animations are left out: all stands as at rest", || "animations".to_owned());
    }
    loader.nodes()?;
    let Loader { materials, mut scene, warnings, .. } = loader;
    if scene.surfaces.is_empty() {
        return Err(SceneError::empty(scene.name, &warnings.into_list()));
    }
    materials.apply_means(&mut scene);
    scene.warnings = warnings.into_list();
    Ok(scene)
}

struct Loader<'a> {
    document: &'a Document,
    materials: Materials,
    /// The meshes' primitives, once an instance needs them.
    meshes: Vec<Option<Vec<Part>>>,
    scene: Scene,
    warnings: Warnings,
}

impl Loader<'_> {
    /// Walks the nodes of the scene, parents first. No recursion: the depth is the file's choice.
    fn nodes(&mut self) -> Result<(), SceneError> {
        let root = &self.document.root;
        let tops: Vec<usize> = match root.scenes.get(root.scene.map_or(0, |s| s.value())) {
            Some(scene) => scene.nodes.iter().map(|n| n.value()).collect(),
            None => {
                let mut is_child = vec![false; root.nodes.len()];
                root.nodes.iter().flat_map(|n| n.children.iter().flatten()).for_each(|c| is_child[c.value()] = true);
                (0..root.nodes.len()).filter(|n| !is_child[*n]).collect()
            }
        };
        let mut seen = vec![false; root.nodes.len()];
        let mut stack: Vec<(usize, DMat4)> = tops.into_iter().rev().map(|n| (n, DMat4::IDENTITY)).collect();
        while let Some((number, parent)) = stack.pop() {
            if std::mem::replace(&mut seen[number], true) {
                return Err(self.document.wrong(
                    &format!("nodes[{number}]"),
                    "it is reached twice: it has two parents, or is its own ancestor",
                    "a node that is a child of at most one other would be right",
                ));
            }
            let transform = parent * self.local_transform(number);
            if !transform.is_finite() {
                self.warnings
                    .add("node left out with its children: its transform is not finite", || format!("nodes[{number}]"));
                continue;
            }
            self.node(number, &transform)?;
            let children = root.nodes[number].children.iter().flatten().rev();
            stack.extend(children.map(|c| (c.value(), transform)));
        }
        Ok(())
    }

    fn local_transform(&mut self, number: usize) -> DMat4 {
        let node = &self.document.root.nodes[number];
        if let Some(matrix) = node.matrix {
            return DMat4::from_cols_array(&matrix.map(f64::from));
        }
        let rotation = DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from));
        let unit = rotation * rotation.length_recip();
        if !unit.is_finite() {
            self.warnings.add("a rotation that is no quaternion is left out", || format!("nodes[{number}].rotation"));
        }
        DMat4::from_scale_rotation_translation(
            DVec3::from(node.scale.unwrap_or([1.0; 3]).map(f64::from)),
            if unit.is_finite() { unit } else { DQuat::IDENTITY },
            DVec3::from(node.translation.unwrap_or_default().map(f64::from)),
        )
    }

    fn node(&mut self, number: usize, transform: &DMat4) -> Result<(), SceneError> {
        let node = &self.document.root.nodes[number];
        if let Some(camera) = node.camera {
            self.camera(number, camera.value(), transform);
        }
        if let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
            self.light(number, light.light.value(), transform);
        }
        let Some(mesh) = node.mesh else { return Ok(()) };
        if node.skin.is_some() {
            self.warnings
                .add("skins are left out: the mesh stands as it was bound", || format!("nodes[{number}].skin"));
        }
        self.instance(number, mesh.value(), transform)
    }

    fn instance(&mut self, node: usize, mesh: usize, transform: &DMat4) -> Result<(), SceneError> {
        let primitives = match self.meshes[mesh].take() {
            Some(primitives) => primitives,
            None => self.mesh(mesh)?,
        };
        let faces: usize = primitives.iter().map(|p| p.faces.len()).sum();
        if self.scene.surfaces.len() + faces > MAX_SURFACES {
            return Err(self.document.wrong(
                &format!("nodes[{node}].mesh"),
                format!("with this instance the scene has more than {MAX_SURFACES} surfaces"),
                "fewer instances or simpler meshes would be right",
            ));
        }
        for part in &primitives {
            place(&mut self.scene, &mut self.warnings, part, transform);
        }
        self.meshes[mesh] = Some(primitives);
        Ok(())
    }

    fn mesh(&mut self, mesh: usize) -> Result<Vec<Part>, SceneError> {
        let count = self.document.root.meshes[mesh].primitives.len();
        let primitives = (0..count).map(|p| self.primitive(mesh, p)).collect::<Result<Vec<_>, _>>()?;
        Ok(primitives.into_iter().flatten().collect())
    }

    /// One primitive; `None`, with a warning, where it has no triangles.
    fn primitive(&mut self, mesh: usize, number: usize) -> Result<Option<Part>, SceneError> {
        let document = self.document;
        let source = &document.root.meshes[mesh].primitives[number];
        let path = format!("meshes[{mesh}].primitives[{number}]");
        let mode = match source.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            _ => {
                self.warnings.add("points and lines are left out: they have no area", || path);
                return Ok(None);
            }
        };
        if source.targets.is_some() {
            self.warnings.add("morph targets are left out", || format!("{path}.targets"));
        }
        let find = |semantic: Semantic| {
            let place = format!("{path}.attributes.{}", semantic.to_string());
            source.attributes.get(&Checked::Valid(semantic)).map(|index| (index.value(), place))
        };
        let Some((positions, positions_path)) = find(Semantic::Positions) else {
            self.warnings.add("a primitive without positions is left out", || path);
            return Ok(None);
        };
        let positions = document.vectors::<3>(positions, &positions_path)?;
        let count = positions.len();
        let same_count = |place: &str, found: usize| {
            (found == count).then_some(()).ok_or_else(|| {
                document.wrong(place, format!("{found} elements"), format!("{count}, as of POSITION, would be right"))
            })
        };
        let mut vertices = Vertices {
            positions: positions.iter().map(|p| DVec3::from(p.map(f64::from))).collect(),
            ..Vertices::default()
        };
        if let Some((normals, place)) = find(Semantic::Normals) {
            vertices.normals = document.vectors::<3>(normals, &place)?.into_iter().map(Vec3::from).collect();
            same_count(&place, vertices.normals.len())?;
        }
        let material = source.material.map(|m| m.value());
        if let Some(set) = material.and_then(|m| material::base_color_set(document, m)) {
            match find(Semantic::TexCoords(set)) {
                Some((uv, place)) => {
                    vertices.uv = document.vectors::<2>(uv, &place)?.into_iter().map(Vec2::from).collect();
                    same_count(&place, vertices.uv.len())?;
                    self.mend(&mut vertices.uv, |uv| uv.is_finite(), |_| Vec2::ZERO, "texture coordinates", &place);
                }
                None => self.warnings.add("base colour texture left out: its texture coordinates are missing", || {
                    format!("{path}.attributes.TEXCOORD_{set}")
                }),
            }
        }
        if let Some((colors, place)) = find(Semantic::Colors(0)) {
            vertices.colors = if document.dimension(colors) == 4 {
                document.vectors::<4>(colors, &place)?.into_iter().map(|[r, g, b, _]| Rgb::new(r, g, b)).collect()
            } else {
                document.vectors::<3>(colors, &place)?.into_iter().map(Rgb::from).collect()
            };
            same_count(&place, vertices.colors.len())?;
            let in_range = |c: &Rgb| c.is_finite() && c.min_element() >= 0.0 && c.max_element() <= 1.0;
            let clamp = |c: Rgb| Rgb::from(c.to_array().map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, 1.0) }));
            self.mend(&mut vertices.colors, in_range, clamp, "vertex colours", &place);
        }
        let indices = match source.indices {
            Some(indices) => {
                let place = format!("{path}.indices");
                let indices = document.indices(indices.value(), &place)?;
                if let Some(bad) = indices.iter().find(|i| **i as usize >= count) {
                    return Err(document.wrong(
                        &place,
                        format!("it refers to vertex {bad} of {count}"),
                        format!("indices below {count} would be right"),
                    ));
                }
                indices
            }
            None => (0..count as u32).collect(),
        };
        let faces = merge(&vertices, &self.triangles(&indices, mode, &path));
        let (textured, colored) = (!vertices.uv.is_empty(), !vertices.colors.is_empty());
        let key = (material, textured, colored.then_some((mesh, number)));
        let material = self.materials.get(key, document, &mut self.scene, &mut self.warnings);
        Ok(Some(Part { vertices, faces, material, attributes: textured || colored, whence: path }))
    }

    /// Puts usable values where a file's are not, with a warning that counts them.
    fn mend<T: Copy>(
        &mut self,
        values: &mut [T],
        good: impl Fn(&T) -> bool,
        mended: impl Fn(T) -> T,
        what: &str,
        place: &str,
    ) {
        for value in values.iter_mut().filter(|v| !good(v)) {
            *value = mended(*value);
            self.warnings.add(format!("{what} out of range are clamped"), || place.to_owned());
        }
    }

    /// Triangles of a list, strip or fan, counter-clockwise seen from the front (glTF 2.0, section 3.7.2.1).
    fn triangles(&mut self, indices: &[u32], mode: Mode, path: &str) -> Vec<[u32; 3]> {
        match mode {
            Mode::TriangleStrip => {
                let turn = |(i, w): (usize, &[u32])| {
                    if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] }
                };
                indices.windows(3).enumerate().map(turn).collect()
            }
            Mode::TriangleFan => match indices.split_first() {
                Some((&hub, rim)) => rim.windows(2).map(|w| [w[0], w[1], hub]).collect(),
                None => Vec::new(),
            },
            _ => {
                let (triangles, rest) = indices.as_chunks::<3>();
                if !rest.is_empty() {
                    self.warnings.add("vertices left over from triangles are left out", || path.to_owned());
                }
                triangles.to_vec()
            }
        }
    }

    fn camera(&mut self, node: usize, number: usize, transform: &DMat4) {
        let source = &self.document.root.cameras[number];
        let place = || format!("cameras[{number}]");
        let Some(lens) = source.perspective.as_ref().filter(|_| source.orthographic.is_none()) else {
            self.warnings.add("an orthographic camera is left out", place);
            return;
        };
        let aspect = lens.aspect_ratio.map_or(CAMERA_ASPECT, f64::from);
        let half_y = 0.5 * f64::from(lens.yfov);
        let half_x = (half_y.tan() * aspect).atan();
        let eye = transform.w_axis.truncate();
        let forward = -transform.z_axis.truncate().normalize_or_zero();
        let up = transform.y_axis.truncate().normalize_or_zero();
        let good = half_y > 0.0
            && half_y.to_degrees() < 90.0
            && aspect > 0.0
            && half_x > 0.0
            && half_x.to_degrees() < 90.0
            && forward.cross(up).length() > 1e-6;
        if !good {
            self.warnings.add("a camera without a usable field of view or direction is left out", place);
            return;
        }
        let height = (f64::from(CAMERA_WIDTH) / aspect).round().clamp(1.0, 16384.0);
        let camera = Camera {
            eye: eye.to_array(),
            target: (eye + forward).to_array(),
            up: up.to_array(),
            fov_x: 2.0 * half_x.to_degrees(),
            width: CAMERA_WIDTH,
            height: height as u32,
        };
        let name = self.document.root.nodes[node].name.as_ref().or(source.name.as_ref());
        self.scene.cameras.push((name.cloned().unwrap_or_else(|| format!("camera {number}")), camera));
    }

    fn light(&mut self, node: usize, number: usize, transform: &DMat4) {
        let place = || format!("extensions.KHR_lights_punctual.lights[{number}]");
        let lights = self.document.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        let Some(source) = lights.and_then(|l| l.lights.get(number)) else {
            self.warnings.add("a light that the file does not have is left out", || format!("nodes[{node}]"));
            return;
        };
        let intensity = Rgb::from(source.color) * source.intensity;
        let direction = -transform.z_axis.truncate().normalize_or_zero().as_vec3();
        if !intensity.is_finite() || intensity.min_element() < 0.0 {
            self.warnings.add("a light of negative or infinite intensity is left out", place);
            return;
        }
        if source.range.is_some() {
            self.warnings.add("the range of a light is not simulated: it falls off with distance only", place);
        }
        let kind = match source.type_ {
            Checked::Valid(LightType::Point) => LightKind::Point,
            _ if direction == Vec3::ZERO => {
                self.warnings.add("a light without direction is left out", place);
                return;
            }
            Checked::Valid(LightType::Directional) => LightKind::Directional { direction },
            _ => self.spot(source, direction, number),
        };
        self.scene.lights.push(Light { position: transform.w_axis.truncate(), intensity, kind });
    }

    fn spot(&mut self, source: &LightSource, direction: Vec3, number: usize) -> LightKind {
        let (inner, outer) = source
            .spot
            .as_ref()
            .map_or((0.0, std::f32::consts::FRAC_PI_4), |s| (s.inner_cone_angle, s.outer_cone_angle));
        let good = 0.0 <= inner && inner < outer && outer <= std::f32::consts::FRAC_PI_2 * 1.0001;
        if !good {
            self.warnings.add("spot cone angles that are not 0 ≤ inner < outer ≤ π/2 are clamped", || {
                format!("extensions.KHR_lights_punctual.lights[{number}].spot")
            });
        }
        let outer = if outer.is_finite() { outer.clamp(MIN_CONE, std::f32::consts::FRAC_PI_2) } else { MIN_CONE };
        let inner = if inner.is_finite() { inner.clamp(0.0, outer) } else { 0.0 };
        let cos_outer = outer.cos();
        LightKind::Spot { direction, cos_inner: inner.cos().max(cos_outer + MIN_RAMP), cos_outer }
    }
}

//! The binary form of glTF 2.0: a JSON text and one buffer.

use glam::{DMat4, DVec3, Vec3};
use hr_scene::Camera;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::io::{self, Write};

/// What buffer views are for (glTF 2.0, section 5.11.5).
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Types of components (section 5.1.3).
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

/// A file in the making.
#[derive(Debug, Default)]
pub(super) struct Glb {
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    cameras: Vec<Value>,
    nodes: Vec<Value>,
    scenes: Vec<Value>,
}

/// Index of what has just been added.
fn last(list: &[Value]) -> usize {
    list.len() - 1
}

impl Glb {
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        // Accessors begin at multiples of four bytes.
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.buffer.extend_from_slice(bytes);
        self.views.push(view);
        last(&self.views)
    }

    /// Adds an attribute of `kind` (`VEC2`, `VEC3`) by vertex; what is not finite becomes 0.
    pub(super) fn attribute<const N: usize>(&mut self, values: impl Iterator<Item = [f32; N]>, kind: &str) -> usize {
        let finite = |x: f32| if x.is_finite() { x } else { 0.0 };
        let values: Vec<[f32; N]> = values.map(|value| value.map(finite)).collect();
        let view = self.view(bytemuck::cast_slice(values.as_flattened()), Some(ARRAY_BUFFER));
        let mut accessor = json!({ "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind });
        if let Some(&first) = values.first() {
            // Positions must have them.
            let (mut low, mut high) = (first, first);
            for value in &values {
                for i in 0..N {
                    low[i] = low[i].min(value[i]);
                    high[i] = high[i].max(value[i]);
                }
            }
            accessor["min"] = low.as_slice().into();
            accessor["max"] = high.as_slice().into();
        }
        self.accessors.push(accessor);
        last(&self.accessors)
    }

    /// Adds vectors by vertex.
    pub(super) fn vectors(&mut self, values: impl Iterator<Item = Vec3>) -> usize {
        self.attribute(values.map(|value| value.to_array()), "VEC3")
    }

    /// Adds the corners of triangles.
    pub(super) fn indices(&mut self, indices: &[u32]) -> usize {
        let view = self.view(bytemuck::cast_slice(indices), Some(ELEMENT_ARRAY_BUFFER));
        let count = indices.len();
        self.accessors
            .push(json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": count, "type": "SCALAR" }));
        last(&self.accessors)
    }

    /// Adds a PNG file as image and texture.
    pub(super) fn texture(&mut self, name: &str, png: &[u8]) -> usize {
        let view = self.view(png, None);
        self.images.push(json!({ "name": name, "bufferView": view, "mimeType": "image/png" }));
        last(&self.images)
    }

    /// Adds an unlit material; its base colour is white, or that of a texture on the second set of coordinates.
    pub(super) fn unlit(&mut self, name: &str, texture: Option<usize>, extras: &Value) -> usize {
        let mut base = json!({ "metallicFactor": 0.0 });
        if let Some(texture) = texture {
            base["baseColorTexture"] = json!({ "index": texture, "texCoord": 1 });
        }
        self.materials.push(json!({
            "name": name,
            "pbrMetallicRoughness": base,
            "extensions": { "KHR_materials_unlit": {} },
            "extras": extras,
        }));
        last(&self.materials)
    }

    /// Adds a mesh.
    pub(super) fn mesh(&mut self, name: &str, primitives: &[Value], extras: &Value) -> usize {
        self.meshes.push(json!({ "name": name, "primitives": primitives, "extras": extras }));
        last(&self.meshes)
    }

    /// Adds a scene of one mesh, if there is any of it, and of cameras in the mesh's own axes.
    pub(super) fn scene(&mut self, name: &str, mesh: Option<usize>, place: DMat4, cameras: &[(String, Camera)]) {
        let mut nodes = Vec::new();
        if let Some(mesh) = mesh {
            self.nodes.push(json!({ "name": name, "mesh": mesh, "matrix": place.as_mat4().to_cols_array() }));
            nodes.push(last(&self.nodes));
        }
        for (name, camera) in cameras {
            let aspect = f64::from(camera.width) / f64::from(camera.height);
            let half = (0.5 * camera.fov_x).to_radians().tan();
            let (eye, target) = (DVec3::from(camera.eye), DVec3::from(camera.target));
            let turn = DMat4::from_quat(glam::DQuat::from_mat4(&place));
            // A camera looks along its −z, with y up.
            let back = (eye - target).normalize_or(DVec3::Z);
            let right = DVec3::from(camera.up).cross(back).normalize_or(back.any_orthonormal_vector());
            let axes = glam::DMat3::from_cols(right, back.cross(right), back);
            let matrix = turn * DMat4::from_mat3_translation(axes, eye);
            self.cameras.push(json!({
                "type": "perspective",
                "name": name,
                "perspective": { "yfov": 2.0 * (half / aspect).atan(), "aspectRatio": aspect, "znear": 0.01 },
            }));
            let camera = last(&self.cameras);
            self.nodes.push(json!({ "name": name, "camera": camera, "matrix": matrix.as_mat4().to_cols_array() }));
            nodes.push(last(&self.nodes));
        }
        self.scenes.push(json!({ "name": name, "nodes": nodes }));
    }

    /// Writes the file.
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let Self { buffer, views, accessors, images, materials, meshes, cameras, nodes, scenes } = self;
        let textures: Vec<Value> = (0..images.len()).map(|image| json!({ "sampler": 0, "source": image })).collect();
        let mut root = json!({
            "asset": { "version": "2.0", "generator": concat!("hr-view ", env!("CARGO_PKG_VERSION")) },
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
        });
        // Filters of lightmaps: linear, and nothing beyond the border.
        let samplers = vec![json!({ "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071 })];
        let samplers = if images.is_empty() { Vec::new() } else { samplers };
        let buffers = vec![json!({ "byteLength": buffer.len() })];
        let lists = [
            ("buffers", &buffers),
            ("bufferViews", views),
            ("accessors", accessors),
            ("images", images),
            ("samplers", &samplers),
            ("textures", &textures),
            ("materials", materials),
            ("meshes", meshes),
            ("cameras", cameras),
            ("nodes", nodes),
            ("scenes", scenes),
        ];
        // Lists may not be empty.
        for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
            root[name] = json!(list);
        }
        let json = serde_json::to_vec(&root)?;
        let length = 12 + 8 + json.len().next_multiple_of(4) + 8 + buffer.len().next_multiple_of(4);
        let header = gltf::binary::Header {
            magic: *b"glTF",
            version: 2,
            length: u32::try_from(length).map_err(|_| io::Error::other("a .glb file has no more than 4 GB"))?,
        };
        let file = gltf::Glb { header, json: Cow::Owned(json), bin: Some(Cow::Borrowed(buffer)) };
        file.to_writer(out).map_err(io::Error::other)
    }
}

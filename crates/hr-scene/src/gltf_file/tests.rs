use super::*;
use crate::testing::Folder;
use crate::texture::Wrap;
use hr_diffuse::Shape;
use proptest::prelude::*;
use serde_json::{Value, json};

/// Builds small documents: data goes into one buffer, with one view and accessor per call.
#[derive(Default)]
struct Builder {
    data: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    document: serde_json::Map<String, Value>,
}

impl Builder {
    fn bytes(&mut self, bytes: &[u8]) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.data.len(), "byteLength": bytes.len()}));
        self.data.extend(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.bytes(&bytes);
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        self.accessor(json!({"bufferView": view, "componentType": 5126, "count": values.len(), "type": kind}))
    }

    fn indices(&mut self, values: &[u32], component: u32) -> usize {
        let size = match component {
            5121 => 1,
            5123 => 2,
            _ => 4,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()[..size].to_vec()).collect();
        let view = self.bytes(&bytes);
        self.accessor(json!({"bufferView": view, "componentType": component, "count": values.len(), "type": "SCALAR"}))
    }

    fn set(&mut self, key: &str, value: Value) {
        self.document.insert(key.to_owned(), value);
    }

    /// One mesh with one primitive, on one node.
    fn mesh(&mut self, primitive: &Value) {
        self.set("meshes", json!([{"primitives": [primitive]}]));
        self.set("nodes", json!([{"mesh": 0}]));
    }

    fn json(&self, uri: bool) -> Vec<u8> {
        let mut document = self.document.clone();
        document.insert("asset".into(), json!({"version": "2.0"}));
        document.insert("bufferViews".into(), json!(self.views));
        document.insert("accessors".into(), json!(self.accessors));
        let mut buffer = json!({"byteLength": self.data.len()});
        if uri {
            buffer["uri"] = json!(format!("data:application/octet-stream;base64,{}", base64(&self.data)));
        }
        document.insert("buffers".into(), json!([buffer]));
        serde_json::to_vec(&document).expect("it is JSON")
    }

    fn glb(&self) -> Vec<u8> {
        let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
        let glb = gltf::Glb { header, json: self.json(false).into(), bin: Some(self.data.clone().into()) };
        glb.to_vec().expect("it can be written")
    }

    fn load(&self) -> Result<Scene, SceneError> {
        from_bytes(&self.glb(), Path::new("small.glb"))
    }

    fn scene(&self) -> Scene {
        self.load().expect("the document is valid")
    }

    fn error(&self) -> String {
        self.load().expect_err("the document is wrong").to_string()
    }
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let word = (0..3).fold(0_u32, |w, i| w << 8 | u32::from(chunk.get(i).copied().unwrap_or(0)));
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i > chunk.len() { '=' } else { digit as char });
        }
    }
    text
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
const SQUARE_UV: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
const TWO: [u32; 6] = [0, 1, 2, 0, 2, 3];

/// A square in the plane z = 0 with whatever else a test adds to its primitive.
fn square(extra: &Value) -> Builder {
    let mut b = Builder::default();
    let position = b.floats(&SQUARE);
    let indices = b.indices(&TWO, 5123);
    let mut primitive = json!({"attributes": {"POSITION": position}, "indices": indices});
    merge_json(&mut primitive, extra);
    b.mesh(&primitive);
    b
}

fn merge_json(into: &mut Value, from: &Value) {
    if let (Some(into), Some(from)) = (into.as_object_mut(), from.as_object()) {
        for (key, value) in from {
            merge_json(into.entry(key.clone()).or_insert(value.clone()), value);
        }
    }
}

fn png(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 3]) -> Vec<u8> {
    let image = image::RgbImage::from_fn(width, height, |x, y| image::Rgb(texel(x, y)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("it can be written");
    bytes.into_inner()
}

/// A square with a texture of 2 × 2 texels: black, red / green, blue from its upper left.
fn textured(info: &Value) -> Builder {
    let mut b = square(&json!({"material": 0}));
    let uv = b.floats(&SQUARE_UV);
    let other = b.floats(&SQUARE_UV.map(|[u, v]| [0.25 + 0.0 * u, 0.25 + 0.0 * v]));
    let image =
        b.bytes(&png(2, 2, |x, y| [[[0, 0, 0], [255, 0, 0]], [[0, 255, 0], [0, 0, 255]]][y as usize][x as usize]));
    let primitive =
        json!({"attributes": {"POSITION": 0, "TEXCOORD_0": uv, "TEXCOORD_1": other}, "indices": 1, "material": 0});
    b.mesh(&primitive);
    let mut texture = json!({"index": 0});
    merge_json(&mut texture, info);
    b.set("images", json!([{"bufferView": image, "mimeType": "image/png"}]));
    b.set("textures", json!([{"source": 0}]));
    b.set(
        "materials",
        json!([{"pbrMetallicRoughness": {
        "baseColorTexture": texture, "baseColorFactor": [0.5, 1.0, 1.0, 1.0], "metallicFactor": 0.0}}]),
    );
    b
}

fn close(a: Rgb, b: [f32; 3]) -> bool {
    (a - Rgb::from(b)).abs().max_element() < 1e-5
}

fn corners(scene: &Scene, surface: usize) -> Vec<[f64; 3]> {
    match &scene.surfaces[surface].shape {
        Shape::Triangle(p) => p.iter().map(|p| p.to_array()).collect(),
        Shape::Quad(p) => p.iter().map(|p| p.to_array()).collect(),
        other => panic!("{other:?} does not come from glTF"),
    }
}

fn normal(scene: &Scene, surface: usize) -> DVec3 {
    let p: Vec<DVec3> = corners(scene, surface).into_iter().map(DVec3::from).collect();
    (p[1] - p[0]).cross(p[2] - p[0]).normalize()
}

fn warned(scene: &Scene, what: &str) -> bool {
    scene.warnings.iter().any(|w| w.text.contains(what))
}

#[test]
fn two_triangles_of_a_square_are_one_quadrilateral() {
    let scene = square(&json!({})).scene();
    assert_eq!(scene.surfaces.len(), 1, "merged");
    assert_eq!(scene.primaries, Primaries::Rec709, "glTF's primaries");
    let mut found = corners(&scene, 0);
    found.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
    assert_eq!(found, [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], "its corners");
    assert_eq!(normal(&scene, 0), DVec3::Z, "its front");
    assert!(scene.warnings.is_empty(), "nothing to warn of: {:?}", scene.warnings);
    assert_eq!(scene.materials[0].name, "default", "the default material");
    assert!(!scene.materials[0].two_sided, "backs absorb");
}

#[test]
fn json_files_with_data_uris_and_with_files_give_the_same() {
    let b = textured(&json!({}));
    let glb = b.scene();
    let embedded = from_bytes(&b.json(true), Path::new("small.gltf")).expect("valid");
    assert_eq!(embedded.surfaces, glb.surfaces, "data URI");
    let folder = Folder::new("gltf");
    let mut document: Value = serde_json::from_slice(&b.json(false)).expect("JSON");
    document["buffers"][0]["uri"] = json!("the%20data.bin");
    document["images"] = json!([{"uri": "texture.png"}]);
    std::fs::write(folder.path("the data.bin"), &b.data).expect("written");
    std::fs::write(folder.path("texture.png"), png(1, 1, |_, _| [255, 255, 0])).expect("written");
    std::fs::write(folder.path("a.gltf"), document.to_string()).expect("written");
    let scene = load(&folder.path("a.gltf")).expect("valid");
    assert_eq!(scene.surfaces, glb.surfaces, "external buffer");
    assert!(close(scene.base_color(0, 0.5, 0.5).expect("textured"), [0.5, 1.0, 0.0]), "external image");
    document["buffers"][0]["uri"] = json!("missing.bin");
    std::fs::write(folder.path("a.gltf"), document.to_string()).expect("written");
    let error = load(&folder.path("a.gltf")).expect_err("a file is missing").to_string();
    for part in ["a.gltf: buffers[0].uri: ", "missing.bin cannot be read", "lay that file beside this one"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn every_index_type_and_none() {
    for component in [5121, 5123, 5125] {
        let mut b = Builder::default();
        let position = b.floats(&SQUARE);
        let indices = b.indices(&[0, 1, 3], component);
        b.mesh(&json!({"attributes": {"POSITION": position}, "indices": indices}));
        assert_eq!(corners(&b.scene(), 0), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], "{component}");
    }
    let mut b = Builder::default();
    let position = b.floats(&[SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[0], SQUARE[2], SQUARE[3], SQUARE[0]]);
    b.mesh(&json!({"attributes": {"POSITION": position}}));
    let scene = b.scene();
    assert_eq!(scene.surfaces.len(), 1, "welded by position and merged");
    assert!(warned(&scene, "left over"), "the seventh vertex");
}

#[test]
fn strips_fans_points_and_lines() {
    for (mode, order) in [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let mut b = Builder::default();
        let position = b.floats(&SQUARE);
        let indices = b.indices(&order, 5121);
        b.mesh(&json!({"attributes": {"POSITION": position}, "indices": indices, "mode": mode}));
        let scene = b.scene();
        assert_eq!(scene.surfaces.len(), 1, "mode {mode}: two triangles, merged");
        assert_eq!(normal(&scene, 0), DVec3::Z, "mode {mode}: winding");
    }
    for mode in 0..4 {
        let mut b = square(&json!({}));
        b.set(
            "meshes",
            json!([{"primitives": [
            {"attributes": {"POSITION": 0}, "mode": mode}, {"attributes": {"POSITION": 0}, "indices": 1}]}]),
        );
        let scene = b.scene();
        assert_eq!(scene.surfaces.len(), 1, "mode {mode} has no area");
        assert!(warned(&scene, "points and lines"), "and is warned of");
    }
}

#[test]
fn interleaved_quantised_and_sparse_data() {
    let mut b = Builder::default();
    // Position as normalised u16, padded, and normal as normalised i8, padded, in turn.
    let mut bytes = Vec::new();
    for [x, y, z] in SQUARE {
        for c in [x, y, z, 0.0] {
            bytes.extend(((c * 65535.0) as u16).to_le_bytes());
        }
        bytes.extend([0_i8, 0, 127, 0].map(|c| c as u8));
    }
    let view = b.bytes(&bytes);
    b.views[view]["byteStride"] = json!(12);
    let position =
        b.accessor(json!({"bufferView": view, "componentType": 5123, "normalized": true, "count": 4, "type": "VEC3"}));
    let normals = b
        .accessor(json!({"bufferView": view, "byteOffset": 8, "componentType": 5120, "normalized": true, "count": 4,
            "type": "VEC3"}));
    let indices = b.indices(&TWO, 5121);
    b.mesh(&json!({"attributes": {"POSITION": position, "NORMAL": normals}, "indices": indices}));
    b.set("extensionsUsed", json!(["KHR_mesh_quantization"]));
    b.set("extensionsRequired", json!(["KHR_mesh_quantization"]));
    let scene = b.scene();
    assert_eq!(scene.surfaces.len(), 1, "a square");
    assert_eq!(normal(&scene, 0), DVec3::Z, "counter-clockwise");
    assert_eq!(scene.surfaces[0].shading_normals, None, "its normals are flat");

    // Sparse over a dense base, and over zeros.
    for dense in [true, false] {
        let mut b = Builder::default();
        let values = b.bytes(
            &[[1.0_f32, 0.0, 0.0], [0.0, 3.0, 0.0]]
                .as_flattened()
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect::<Vec<_>>(),
        );
        let targets = b.bytes(&[1, 2]);
        let base = b.floats(&[[0.0_f32; 3]; 3]);
        let mut accessor = json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": 2,
            "indices": {"bufferView": targets, "componentType": 5121}, "values": {"bufferView": values}}});
        if dense {
            accessor["bufferView"] = b.accessors[base]["bufferView"].clone();
        }
        let position = b.accessor(accessor);
        b.mesh(&json!({"attributes": {"POSITION": position}}));
        let scene = b.scene();
        assert_eq!(corners(&scene, 0), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 3.0, 0.0]], "dense base: {dense}");
    }
}

#[test]
fn node_hierarchies_place_and_mirrors_turn() {
    let mut b = square(&json!({}));
    let half = std::f32::consts::FRAC_1_SQRT_2;
    b.set(
        "nodes",
        json!([
            {"children": [1, 2], "translation": [10.0, 0.0, 0.0]},
            {"mesh": 0, "rotation": [half, 0.0, 0.0, half], "scale": [2.0, 3.0, 1.0]},
            {"mesh": 0, "matrix": [-1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 5.0, 0.0, 1.0]}
        ]),
    );
    b.set("scenes", json!([{"nodes": []}, {"nodes": [0]}]));
    b.set("scene", json!(1));
    let scene = b.scene();
    assert_eq!(scene.surfaces.len(), 2, "two instances");
    // Rotated by 90° about x: y becomes z; the normal points to −y.
    let far = corners(&scene, 0).into_iter().map(DVec3::from).fold(DVec3::MIN, DVec3::max);
    assert!(far.distance(DVec3::new(12.0, 0.0, 3.0)) < 1e-6, "scaled, rotated, moved: {far}");
    assert!(normal(&scene, 0).distance(-DVec3::Y) < 1e-6, "its front");
    let near = corners(&scene, 1).into_iter().map(DVec3::from).fold(DVec3::MAX, DVec3::min);
    assert_eq!(near, DVec3::new(9.0, 5.0, 0.0), "mirrored in x");
    assert_eq!(normal(&scene, 1), DVec3::Z, "a mirrored square keeps its front");
}

#[test]
fn without_scenes_the_roots_are_loaded() {
    let mut b = square(&json!({}));
    b.set("nodes", json!([{"mesh": 0, "translation": [0, 0, 1]}, {"children": [0], "translation": [0, 0, 2]}]));
    assert_eq!(corners(&b.scene(), 0)[0][2], 3.0, "once, below its parent");
}

#[test]
fn cycles_and_shared_nodes_are_errors() {
    for nodes in [
        json!([{"mesh": 0, "children": [1]}, {"children": [0]}]),
        json!([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"mesh": 0}]),
    ] {
        let mut b = square(&json!({}));
        b.set("nodes", nodes);
        b.set("scenes", json!([{"nodes": [0]}]));
        let error = b.error();
        assert!(error.contains("nodes[") && error.contains("two parents"), "{error}");
    }
}

#[test]
fn chains_of_nodes_may_be_long() {
    let mut b = square(&json!({}));
    let n = 20_000;
    let nodes: Vec<Value> =
        (0..n).map(|i| if i + 1 < n { json!({"children": [i + 1]}) } else { json!({"mesh": 0}) }).collect();
    b.set("nodes", json!(nodes));
    b.set("scenes", json!([{"nodes": [0]}]));
    assert_eq!(b.scene().surfaces.len(), 1, "no recursion");
}

#[test]
fn normals_are_kept_where_they_shade() {
    let tilted = |x: f32, z: f32| {
        let n = Vec3::new(x, 0.0, z).normalize();
        n.to_array()
    };
    let mut b = Builder::default();
    let position = b.floats(&SQUARE);
    let normals = b.floats(&[tilted(-0.5, 1.0), tilted(0.5, 1.0), tilted(0.5, 1.0), tilted(-0.5, 1.0)]);
    let indices = b.indices(&TWO, 5121);
    b.mesh(&json!({"attributes": {"POSITION": position, "NORMAL": normals}, "indices": indices}));
    b.set("nodes", json!([{"mesh": 0, "scale": [4.0, 1.0, 1.0]}, {"mesh": 0, "scale": [-4.0, 1.0, 1.0]}]));
    let scene = b.scene();
    assert_eq!(scene.surfaces.len(), 2, "affine normals do not keep triangles from merging");
    for surface in 0..2 {
        let shading = scene.surfaces[surface].shading_normals.expect("it is bent");
        for (corner, normal) in corners(&scene, surface).iter().zip(shading) {
            // Inverse transpose: a slope of 0.5 becomes 0.125; outwards on either side, mirrored or not.
            let middle = if surface == 0 { 2.0 } else { -2.0 };
            let expected = Vec3::new(0.125 * ((corner[0] - middle) as f32).signum(), 0.0, 1.0).normalize();
            assert!(normal.distance(expected) < 1e-5, "surface {surface} at {corner:?}: {normal}");
        }
    }
    let mut b = Builder::default();
    let position = b.floats(&SQUARE);
    let normals = b.floats(&[[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [f32::NAN, 0.0, 1.0], [0.1, 0.0, 1.0]]);
    let indices = b.indices(&[0, 1, 2], 5121);
    b.mesh(&json!({"attributes": {"POSITION": position, "NORMAL": normals}, "indices": indices}));
    let scene = b.scene();
    assert_eq!(scene.surfaces[0].shading_normals, None, "unusable normals fall back to the face");
    assert!(warned(&scene, "shading normal"), "with a warning");
}

#[test]
fn materials_and_emission() {
    let mut b = square(&json!({"material": 0}));
    b.set(
        "materials",
        json!([{"name": "lamp", "doubleSided": true,
        "pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 0.75, 1.0], "metallicFactor": 0.0,
            "roughnessFactor": 0.3},
        "emissiveFactor": [1.0, 0.5, 0.25],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}}}]),
    );
    let scene = b.scene();
    let material = &scene.materials[0];
    assert_eq!((material.name.as_str(), material.two_sided), ("lamp", true), "name and sides");
    assert_eq!(material.base_color, Rgb::new(0.25, 0.5, 0.75), "the factor");
    let pi = std::f32::consts::PI;
    assert!((material.exitance - Rgb::new(8.0, 4.0, 2.0) * pi).abs().max_element() < 1e-4, "π · radiance");
    assert!(warned(&scene, "front only"), "a two-sided emitter");
    assert!(scene.attributes.is_empty(), "plain surfaces carry no attributes");
    assert_eq!(scene.base_color(0, 0.5, 0.5), None, "nor a base colour per pixel");
}

#[test]
fn base_colour_textures() {
    let scene = textured(&json!({})).scene();
    assert_eq!((scene.surfaces.len(), scene.attributes.len()), (1, 1), "merged with its texture");
    // Texel centres: the corner at the origin shows the lower left texel, v pointing down.
    let at = |x: f64, y: f64| {
        let p = corners(&scene, 0);
        let (o, du, dv) =
            (DVec3::from(p[0]), DVec3::from(p[1]) - DVec3::from(p[0]), DVec3::from(p[3]) - DVec3::from(p[0]));
        let d = DVec3::new(x, y, 0.0) - o;
        scene.base_color(0, d.dot(du) as f32, d.dot(dv) as f32).expect("textured")
    };
    assert!(close(at(0.25, 0.25), [0.0, 1.0, 0.0]), "lower left is green");
    assert!(close(at(0.75, 0.25), [0.0, 0.0, 1.0]), "lower right is blue");
    assert!(close(at(0.75, 0.75), [0.5, 0.0, 0.0]), "upper right is red, times the factor");
    let whole = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let mean = scene.mean_base_color(0, &whole).expect("textured");
    assert!(close(mean, [0.125, 0.25, 0.25]), "{mean}");
    let reflected = scene.materials[0].reflector.diffuse();
    assert!(reflected.max_element() < 0.3, "the reflector has the mean colour: {reflected}");
}

#[test]
fn texture_coordinate_sets_transforms_and_samplers() {
    let color = |info: Value| textured(&info).scene().base_color(0, 0.5, 0.5).expect("textured");
    assert!(close(color(json!({"texCoord": 1})), [0.0; 3]), "set 1 lies on the black texel");
    let transform = |t: Value| json!({"texCoord": 1, "extensions": {"KHR_texture_transform": t}});
    assert!(close(color(transform(json!({"offset": [0.5, 0.0]}))), [0.5, 0.0, 0.0]), "moved to the red one");
    assert!(close(color(transform(json!({"scale": [1.0, 3.0]}))), [0.0, 1.0, 0.0]), "scaled to the green one");
    // (¼, ¼) turned by 90° counter-clockwise, v pointing down, is (¼, −¼): the green one, wrapped.
    let quarter = transform(json!({"rotation": std::f32::consts::FRAC_PI_2}));
    assert!(close(color(quarter), [0.0, 1.0, 0.0]), "turned to the green one");
    let other_set = json!({"texCoord": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}});
    assert!(close(color(other_set), [0.0; 3]), "the extension chooses the set");
    let mut b = textured(&json!({}));
    b.set("samplers", json!([{"wrapS": 33071, "wrapT": 33648}]));
    b.set("textures", json!([{"source": 0, "sampler": 0}]));
    let wrap = b.scene().materials[0].texture.as_ref().expect("textured").wrap;
    assert_eq!(wrap, [Wrap::Clamp, Wrap::Mirror], "wrap modes");
    let missing = textured(&json!({"texCoord": 7})).scene();
    assert!(missing.materials[0].texture.is_none() && missing.attributes.is_empty(), "no such set: no texture");
    assert!(warned(&missing, "texture coordinates are missing"), "with a warning");
}

#[test]
fn vertex_colours() {
    for wide in [false, true] {
        let mut b = square(&json!({"material": 0}));
        let color = if wide {
            let bytes: Vec<u8> = [[255_u8, 0, 0, 9], [255, 0, 0, 9], [0, 255, 0, 9], [0, 255, 0, 9]].concat();
            let view = b.bytes(&bytes);
            b.accessor(
                json!({"bufferView": view, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4"}),
            )
        } else {
            b.floats(&[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
        };
        b.mesh(&json!({"attributes": {"POSITION": 0, "COLOR_0": color}, "indices": 1, "material": 0}));
        b.set(
            "materials",
            json!([{"pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.5, 1.0, 1.0], "metallicFactor": 0.0}}]),
        );
        let scene = b.scene();
        assert_eq!(scene.surfaces.len(), 1, "affine colours merge");
        assert!(close(scene.base_color(0, 0.5, 0.5).expect("coloured"), [0.5, 0.25, 0.0]), "the middle");
        let whole = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        assert!(close(scene.mean_base_color(0, &whole).expect("coloured"), [0.5, 0.25, 0.0]), "the mean");
    }
    let mut b = square(&json!({}));
    let color = b.floats(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, f32::NAN, -1.0], [0.0, 0.0, 1.0]]);
    b.mesh(&json!({"attributes": {"POSITION": 0, "COLOR_0": color}, "indices": 1}));
    let scene = b.scene();
    assert_eq!(scene.surfaces.len(), 2, "colours that are not affine keep two triangles");
    assert!(warned(&scene, "vertex colours"), "clamped");
    assert!(scene.attributes.iter().all(|a| a.color.iter().all(|c| c.is_finite())), "all are numbers");
}

#[test]
fn what_is_not_simulated_is_said_once() {
    let mut b = textured(&json!({}));
    let uv = b.floats(&SQUARE_UV);
    let gray = b.bytes(&png(1, 1, |_, _| [0, 128, 64]));
    b.set("images", json!([{"bufferView": gray, "mimeType": "image/png"}]));
    b.set(
        "materials",
        json!([{"name": "all",
        "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}},
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0},
        "normalTexture": {"index": 0}, "occlusionTexture": {"index": 0}, "alphaMode": "BLEND",
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.9}}}]),
    );
    b.mesh(&json!({"attributes": {"POSITION": 0, "TEXCOORD_0": uv}, "indices": 1, "material": 0}));
    b.set("nodes", json!([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 1]}]));
    b.set("extensionsUsed", json!(["KHR_materials_clearcoat"]));
    let scene = b.scene();
    assert!(warned(&scene, "KHR_materials_clearcoat"), "the extension");
    let about: Vec<_> = scene.warnings.iter().filter(|w| w.text.contains("'all'")).collect();
    assert_eq!(about.len(), 1, "one warning per material: {:?}", scene.warnings);
    for what in ["metallic-roughness", "emissive", "normal", "occlusion", "BLEND", "transmission"] {
        assert!(about[0].text.contains(what), "{what} in {}", about[0].text);
    }
    assert_eq!((about[0].count, about[0].first.as_str()), (1, "materials[0]"), "once, and where");
    // sRGB 128 is 0.2159, 64 is 0.0513 of white.
    let radiance = scene.materials[0].exitance / std::f32::consts::PI;
    assert!((radiance - Rgb::new(0.0, 0.2159, 0.0513)).abs().max_element() < 1e-3, "mean emission {radiance}");
}

#[test]
fn broken_images_are_warned_of() {
    let mut b = textured(&json!({}));
    b.set("images", json!([{"bufferView": 0, "mimeType": "image/png"}]));
    let scene = b.scene();
    assert!(warned(&scene, "texture left out"), "{:?}", scene.warnings);
    assert!(close(scene.base_color(0, 0.5, 0.5).expect("it has attributes"), [0.5, 1.0, 1.0]), "the factor is left");
}

#[test]
fn cameras() {
    let mut b = square(&json!({}));
    b.set(
        "cameras",
        json!([
        {"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.6, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1}},
        {"type": "perspective", "perspective": {"yfov": 4.0, "znear": 0.1}}]),
    );
    let half = std::f32::consts::FRAC_1_SQRT_2;
    b.set(
        "nodes",
        json!([
        {"mesh": 0},
        {"name": "door", "camera": 0, "translation": [1, 2, 3], "rotation": [0.0, half, 0.0, half], "scale": [3, 3, 3]},
        {"camera": 1}, {"camera": 2}]),
    );
    let scene = b.scene();
    assert_eq!(scene.cameras.len(), 1, "one usable camera");
    let (name, camera) = &scene.cameras[0];
    assert_eq!((name.as_str(), camera.width, camera.height), ("door", 400, 250), "name and size");
    assert_eq!(camera.eye, [1.0, 2.0, 3.0], "eye");
    // Turned by 90° about y, −z becomes −x.
    let forward = DVec3::from(camera.target) - DVec3::from(camera.eye);
    assert!(forward.normalize().distance(-DVec3::X) < 1e-6, "{forward}");
    let expected = 2.0 * (0.5_f64.tan() * 1.6).atan().to_degrees();
    assert!((camera.fov_x - expected).abs() < 1e-4, "horizontal field of view {}", camera.fov_x);
    assert!(warned(&scene, "orthographic") && warned(&scene, "field of view"), "the others are warned of");
}

#[test]
fn punctual_lights() {
    let mut b = square(&json!({}));
    b.set(
        "extensions",
        json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1.0, 0.5, 0.25], "intensity": 4.0},
        {"type": "spot", "intensity": 2.0, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}},
        {"type": "directional", "intensity": 3.0, "range": 5.0},
        {"type": "spot", "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.5}}]}}),
    );
    let light = |i: usize| json!({"KHR_lights_punctual": {"light": i}});
    b.set(
        "nodes",
        json!([{"mesh": 0},
        {"extensions": light(0), "translation": [1, 2, 3]}, {"extensions": light(1), "scale": [2, 2, 2]},
        {"extensions": light(2), "rotation": [1, 0, 0, 0]}, {"extensions": light(3)}]),
    );
    let scene = b.scene();
    assert_eq!(scene.lights.len(), 4, "all of them");
    assert_eq!(scene.lights[0].position, DVec3::new(1.0, 2.0, 3.0), "position");
    assert_eq!(scene.lights[0].intensity, Rgb::new(4.0, 2.0, 1.0), "colour times intensity");
    let LightKind::Spot { direction, cos_inner, cos_outer } = scene.lights[1].kind else { panic!("it is a spot") };
    assert!(direction.distance(-Vec3::Z) < 1e-6, "along −z");
    assert!((cos_inner - 0.2_f32.cos()).abs() < 1e-6 && (cos_outer - 0.5_f32.cos()).abs() < 1e-6, "cone");
    let LightKind::Directional { direction } = scene.lights[2].kind else { panic!("it is directional") };
    assert!(direction.distance(Vec3::Z) < 1e-6, "turned over");
    let LightKind::Spot { cos_inner, cos_outer, .. } = scene.lights[3].kind else { panic!("it is a spot") };
    assert!(cos_inner > cos_outer, "a ramp that can be divided by");
    assert!(warned(&scene, "range") && warned(&scene, "cone angles"), "{:?}", scene.warnings);
}

#[test]
fn required_extensions_are_named() {
    let mut b = square(&json!({}));
    b.set("extensionsRequired", json!(["KHR_texture_transform", "KHR_draco_mesh_compression"]));
    let error = b.error();
    let expected = "small.glb: extensionsRequired[1]: the file cannot be read without the extension \
                    KHR_draco_mesh_compression; export the file without mesh compression";
    assert_eq!(error, expected);
    let mut b = square(&json!({}));
    b.set("extensionsRequired", json!(["KHR_texture_basisu"]));
    b.set("textures", json!([{"extensions": {"KHR_texture_basisu": {"source": 0}}}]));
    assert!(b.error().contains("PNG or JPEG"), "said before what else is missing");
}

#[test]
fn images_that_only_an_extension_has_are_left_out() {
    let mut b = textured(&json!({}));
    b.set("extensionsUsed", json!(["EXT_texture_webp"]));
    b.set("textures", json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]));
    let scene = b.scene();
    assert!(scene.materials[0].texture.is_none(), "nothing to show");
    assert!(warned(&scene, "EXT_texture_webp is not simulated") && warned(&scene, "no image that is PNG or JPEG"));
}

#[test]
fn other_versions_are_named() {
    let text = br#"{"asset": {"version": "1.0"}, "scenes": {"defaultScene": {"nodes": []}}}"#;
    let error = from_bytes(text, Path::new("old.gltf")).expect_err("not 2.0").to_string();
    assert_eq!(error, "old.gltf: asset.version: the file is glTF '1.0'; export it anew as glTF 2.0");
}

#[test]
fn errors_say_where_and_what() {
    let check = |b: &Builder, parts: &[&str]| {
        let error = b.error();
        for part in parts {
            assert!(error.contains(part), "'{part}' in '{error}'");
        }
    };
    let mut b = square(&json!({}));
    b.accessors[0]["count"] = json!(5);
    check(&b, &["small.glb: meshes[0].primitives[0].attributes.POSITION", "5 elements of 12 bytes"]);
    let mut b = square(&json!({}));
    b.accessors[0]["count"] = json!(u64::MAX);
    check(&b, &["attributes.POSITION", "do not fit"]);
    let mut b = square(&json!({}));
    b.accessors[0]["byteOffset"] = json!(u64::MAX);
    check(&b, &["attributes.POSITION", "do not fit"]);
    let mut b = square(&json!({}));
    b.views[0]["byteLength"] = json!(1000);
    check(&b, &["bufferViews[0] covers 1000 bytes"]);
    let mut b = square(&json!({}));
    b.accessors[0] = json!({"componentType": 5126, "count": 1_u64 << 40, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}}});
    check(&b, &["no buffer view"]);
    let mut b = square(&json!({}));
    b.accessors[0]["type"] = json!("VEC2");
    check(&b, &["attributes.POSITION", "2 components", "3 would be right"]);
    let mut b = square(&json!({}));
    b.mesh(&json!({"attributes": {"POSITION": 77}}));
    check(&b, &["meshes[0].primitives[0].attributes.POSITION", "no accessor 77"]);
    let mut b = square(&json!({}));
    b.mesh(&json!({"attributes": {"POSITION": 0}, "indices": 0}));
    check(&b, &["meshes[0].primitives[0].indices"]);
    let mut b = square(&json!({}));
    let bad = b.indices(&[0, 1, 4], 5121);
    b.mesh(&json!({"attributes": {"POSITION": 0}, "indices": bad}));
    check(&b, &["meshes[0].primitives[0].indices", "vertex 4 of 4"]);
    let mut b = square(&json!({}));
    let short = b.floats(&SQUARE[..3]);
    b.mesh(&json!({"attributes": {"POSITION": 0, "NORMAL": short}, "indices": 1}));
    check(&b, &["attributes.NORMAL", "3 elements", "4, as of POSITION"]);
    let mut b = square(&json!({}));
    b.set("nodes", json!([{"mesh": 9}]));
    check(&b, &["nodes[0].mesh", "out of range"]);
    let b = square(&json!({}));
    let glb = b.glb();
    for length in 0..glb.len() {
        let error = from_bytes(&glb[..length], Path::new("cut.glb")).expect_err("it is cut off").to_string();
        assert!(error.starts_with("cut.glb"), "{error}");
    }
    let mut b = Builder::default();
    b.set("nodes", json!([{}]));
    assert!(matches!(b.load(), Err(SceneError::Empty { .. })), "a scene without surfaces");
}

#[test]
fn a_primitive_without_positions_is_left_out() {
    let mut b = square(&json!({}));
    b.set("meshes", json!([{"primitives": [{"attributes": {}}, {"attributes": {"POSITION": 0}, "indices": 1}]}]));
    let scene = b.scene();
    assert_eq!(scene.surfaces.len(), 1, "the other one");
    assert!(warned(&scene, "without positions"), "with a warning");
}

#[test]
fn faces_without_area_or_numbers_are_counted() {
    let mut b = Builder::default();
    let position = b.floats(&[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [f32::NAN, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [5.0, 5.0, 5.0],
        [5.0, 5.0, 5.0],
        [5.0, 5.0, 5.0],
    ]);
    b.mesh(&json!({"attributes": {"POSITION": position}}));
    let scene = b.scene();
    assert_eq!(scene.surfaces.len(), 1, "one is good");
    let count = |what: &str| scene.warnings.iter().find(|w| w.text.contains(what)).map(|w| w.count);
    assert_eq!((count("no area"), count("not a finite")), (Some(2), Some(1)), "{:?}", scene.warnings);
    let mut b = square(&json!({}));
    b.set("nodes", json!([{"mesh": 0, "translation": [1e38, 0, 0], "scale": [1e300, 1, 1]}, {"mesh": 0}]));
    assert_eq!(b.scene().surfaces.len(), 1, "nodes that are not finite are left out");
}

/// A document with a bit of everything, for mutation.
fn everything() -> Builder {
    let mut b = textured(&json!({"extensions": {"KHR_texture_transform": {"rotation": 0.3, "scale": [2.0, 0.5]}}}));
    let sparse_values = b.floats(&[[0.5_f32, 0.5, 0.5]]);
    let normals = b.floats(&[[0.1_f32, 0.0, 1.0]; 4]);
    let colors = b.floats(&[[0.5_f32, 0.3, 1.0, 1.0]; 4]);
    let at = b.bytes(&[2]);
    let position = b.accessor(json!({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse":
        {"count": 1, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": sparse_values}}}));
    b.set(
        "meshes",
        json!([
        {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2, "NORMAL": normals}, "indices": 1,
             "material": 0},
                        {"attributes": {"POSITION": position, "COLOR_0": colors}, "mode": 5}]}]),
    );
    b.set("cameras", json!([{"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.6, "znear": 0.1}}]));
    b.set(
        "extensions",
        json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 2.0, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}}]}}),
    );
    b.set(
        "nodes",
        json!([{"mesh": 0, "children": [1, 2], "scale": [1, 2, 3]}, {"camera": 0},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 5, 0, 1],
         "extensions": {"KHR_lights_punctual": {"light": 0}}}]),
    );
    b.set("scenes", json!([{"nodes": [0]}]));
    b
}

/// All that a loaded scene promises.
fn check_promises(scene: &Scene) {
    for surface in &scene.surfaces {
        assert!((surface.material as usize) < scene.materials.len(), "materials exist");
        let points: &[DVec3] = match &surface.shape {
            Shape::Triangle(p) => p,
            Shape::Quad(p) => p,
            other => panic!("{other:?} does not come from glTF"),
        };
        assert!(points.iter().all(|p| p.is_finite()), "corners are numbers");
        let normals = surface.shading_normals.iter().flatten();
        assert!(normals.copied().all(|n| (n.length() - 1.0).abs() < 1e-3), "shading normals are unit vectors");
    }
    for material in &scene.materials {
        assert!(material.exitance.is_finite() && material.exitance.min_element() >= 0.0, "emission");
        assert!(material.base_color.is_finite(), "base colour");
    }
    assert!(scene.attributes.is_sorted_by_key(|a| a.surface), "attributes are sorted");
    for attributes in &scene.attributes {
        let color = scene.base_color(attributes.surface, 0.3, 0.3).expect("it has attributes");
        assert!(color.is_finite(), "{color}");
    }
    for (_, camera) in &scene.cameras {
        assert!(camera.direction(3.0, 7.0).is_finite(), "cameras look somewhere");
    }
    for light in &scene.lights {
        assert!(light.intensity.is_finite() && light.position.is_finite(), "lights are numbers");
    }
}

#[test]
fn the_mutated_document_is_valid() {
    let scene = everything().scene();
    assert_eq!(scene.attributes.len(), scene.surfaces.len(), "all have attributes");
    check_promises(&scene);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn mutated_bytes_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        binary: bool,
    ) {
        let b = everything();
        let mut bytes = if binary { b.glb() } else { b.json(true) };
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok(scene) = from_bytes(&bytes, Path::new("mutated")) {
            check_promises(&scene);
        }
    }

    #[test]
    fn mutated_values_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), 0..10_usize), 1..4)) {
        let mut document: Value = serde_json::from_slice(&everything().json(true)).expect("JSON");
        for (at, kind) in changes {
            let count = count_leaves(&document);
            let mut at = at.index(count);
            let value = [json!(0), json!(-1), json!(1e38), json!(1e-40), json!(u64::MAX), json!(null), json!(3),
                json!("x"), json!([]), json!(5121)][kind].clone();
            replace_leaf(&mut document, &mut at, &value);
        }
        if let Ok(scene) = from_bytes(document.to_string().as_bytes(), Path::new("mutated")) {
            check_promises(&scene);
        }
    }
}

fn count_leaves(value: &Value) -> usize {
    match value {
        Value::Array(items) if !items.is_empty() => items.iter().map(count_leaves).sum(),
        Value::Object(items) if !items.is_empty() => items.values().map(count_leaves).sum(),
        _ => 1,
    }
}

/// Puts a value in place of the `at`-th leaf.
fn replace_leaf(value: &mut Value, at: &mut usize, by: &Value) -> bool {
    match value {
        Value::Array(items) if !items.is_empty() => items.iter_mut().any(|v| replace_leaf(v, at, by)),
        Value::Object(items) if !items.is_empty() => items.values_mut().any(|v| replace_leaf(v, at, by)),
        leaf if *at == 0 => {
            *leaf = by.clone();
            true
        }
        _ => {
            *at -= 1;
            false
        }
    }
}

//! What is written is read again, by the `gltf` crate and by our own loader.

use super::*;
use glam::{Vec2, Vec3};
use hr_diffuse::{Settings, Shape, Surface};
use hr_scene::Scene;
use std::f32::consts::PI;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

/// Coarse: what is written is not how exact it is.
const ERROR: f32 = 0.3;

fn solved(name: &str) -> Solved {
    let scene = Arc::new(Scene::load(name).expect("a built-in scene"));
    let watch = &mut |_: &hr_diffuse::Progress| ControlFlow::Continue(());
    Solved::new(scene, Settings::with_error(ERROR), true, watch).expect("a sound scene")
}

/// A file that goes away with the test.
struct File(PathBuf);

impl File {
    fn of(solved: &Solved, name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("hr-view-export-{}-{name}", std::process::id()));
        write(solved, &path).expect("the folder for temporary files can be written to");
        Self(path)
    }
}

impl Drop for File {
    fn drop(&mut self) {
        drop(std::fs::remove_file(&self.0));
    }
}

/// The vectors of an attribute of all primitives of a mesh that have it, with the corners of its triangles.
fn attribute(file: &gltf::Gltf, mesh: usize, name: &str) -> Vec<Vec3> {
    let root = file.document.as_json();
    let mut values = Vec::new();
    for primitive in &root.meshes[mesh].primitives {
        let found = primitive.attributes.iter().find(|(semantic, _)| match semantic {
            gltf::json::validation::Checked::Valid(semantic) => semantic.to_string() == name,
            gltf::json::validation::Checked::Invalid => false,
        });
        let Some((_, index)) = found else { continue };
        let accessor = &root.accessors[index.value()];
        let view = &root.buffer_views[accessor.buffer_view.expect("a view").value()];
        let start = view.byte_offset.map_or(0, |offset| offset.0) as usize;
        let blob = file.blob.as_ref().expect("a binary chunk");
        let floats: Vec<f32> = blob[start..start + view.byte_length.0 as usize]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        let size = floats.len() / accessor.count.0 as usize;
        values.extend(floats.chunks_exact(size).map(|v| Vec3::new(v[0], v[1], v.get(2).copied().unwrap_or(0.0))));
    }
    values
}

#[test]
fn the_table_has_all_the_light() {
    let solved = solved("furnace");
    let file = File::of(&solved, "table.csv");
    let text = std::fs::read_to_string(&file.0).expect("the table was written");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("names");
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap_or_else(|| panic!("no {name}"));
    let (area, radiosity) = (column("area [m²]"), column("radiosity G [W/m²]"));
    let mut total = 0.0;
    for line in lines {
        let number = |column: usize| line[column].parse::<f64>().expect("a number");
        assert_eq!(line.len(), header.len(), "as many fields as names: {line:?}");
        // The furnace: 4 W/m² everywhere, in the second channel.
        assert!((number(radiosity) - 4.0).abs() < 4e-3, "radiosity {}", number(radiosity));
        total += number(area);
    }
    assert!((total - 24.0).abs() < 1e-3, "six faces of 4 m²: {total}");
}

#[test]
fn both_scenes_are_valid_and_bright() {
    let solved = solved("glossy-sphere");
    let file = File::of(&solved, "sphere.glb");
    let bytes = std::fs::read(&file.0).expect("the model was written");
    // Validates, too.
    let model = gltf::Gltf::from_slice(&bytes).expect("valid glTF");
    let names: Vec<_> = model.scenes().map(|scene| scene.name().unwrap_or_default().to_owned()).collect();
    assert_eq!(names, ["light at vertices", "lightmap"], "scenes");
    let vertices = attribute(&model, 0, "POSITION").len();
    for name in ["NORMAL", "COLOR_0", "_IRRADIANCE", "_RADIANCE"] {
        assert_eq!(attribute(&model, 0, name).len(), vertices, "{name} by vertex");
    }
    let colors = attribute(&model, 0, "COLOR_0");
    assert!(colors.iter().all(|c| c.cmpge(Vec3::ZERO).all() && c.cmple(Vec3::ONE).all()), "colours within 0…1");
    assert!(colors.iter().any(|c| c.y > 0.1), "there is light");
    for (image, name) in model.images().zip(["radiance", "irradiance"]) {
        let gltf::image::Source::View { view, .. } = image.source() else { panic!("the {name} is in the file") };
        let blob = model.blob.as_ref().expect("a binary chunk");
        let png = image::load_from_memory(&blob[view.offset()..view.offset() + view.length()]).expect("a picture");
        let mean =
            png.to_rgb8().pixels().map(|p| f64::from(p.0[1])).sum::<f64>() / f64::from(png.width() * png.height());
        assert!(mean > 5.0, "the {name} is dark: {mean}");
        let kind = if name == "radiance" { image::ColorType::Rgb8 } else { image::ColorType::Rgb16 };
        assert_eq!(png.color(), kind, "bits of the {name}");
    }
}

#[test]
fn gradients_have_no_steps() {
    // From one code to the next over 64 columns; the mean of each of four strips of them is between both codes.
    let [low, high] = [100.0_f32, 101.0].map(|code| ((code / 255.0 + 0.055) / 1.055).powf(2.4));
    let size = [64, 256];
    let colors = (0..size[0] * size[1]).map(|i| Vec3::splat(low + (high - low) * (i % size[0]) as f32 / 63.0));
    let png = image::load_from_memory(&lightmap::png8(size, colors)).expect("a picture").to_rgb8();
    for strip in 0..4 {
        let texels = png.enumerate_pixels().filter(|(x, ..)| x / 16 == strip);
        let mean = texels.map(|(.., p)| f64::from(p.0[0])).sum::<f64>() / f64::from(16 * size[1]);
        let right = 100.0 + (f64::from(strip) * 16.0 + 7.5) / 63.0;
        // 4096 draws of 0 or 1: 0.008 of standard deviation; the transfer function bends by less.
        assert!((mean - right).abs() < 0.03, "strip {strip}: {mean}, not {right}");
    }
    let ends = [0.0, 1.0]
        .map(|x| image::load_from_memory(&lightmap::png8(size, std::iter::repeat_n(Vec3::splat(x), 64 * 256))));
    for (end, code) in ends.into_iter().zip([0, 255]) {
        assert!(end.expect("a picture").to_rgb8().iter().all(|&c| c == code), "{code} stays");
    }
}

#[test]
fn the_lightmap_is_written_as_it_is() {
    let solved = solved("furnace");
    let image = lightmap::image(&solved);
    // The furnace: 4 W/m² everywhere, in the second channel.
    let lit: Vec<f32> = image.pixels.iter().map(|light| light.y).filter(|light| *light > 0.0).collect();
    assert!(lit.len() > 100 && lit.iter().all(|y| (y * PI / 4.0 - 1.0).abs() < 1e-2), "{} texels", lit.len());
    let file = File::of(&solved, "lightmap.exr");
    let bytes = std::fs::read(&file.0).expect("it was written");
    assert_eq!(bytes[..4], [0x76, 0x2f, 0x31, 0x01], "an OpenEXR file");
}

#[test]
fn our_own_loader_reads_the_model() {
    let solved = solved("glossy-sphere");
    let file = File::of(&solved, "loaded.glb");
    let read = Scene::load(&file.0.display().to_string()).expect("a scene");
    let area = |scene: &Scene| {
        let (low, high) = scene.bounds().expect("surfaces");
        let size = high - low;
        (size.x.max(size.z), size.min_element())
    };
    let (before, after) = (area(&solved.scene), area(&read));
    assert!((before.0 - after.0).abs() < 1e-3 && (before.1 - after.1).abs() < 1e-3, "size: {before:?}, {after:?}");
    assert_eq!(read.cameras.len(), solved.scene.cameras.len(), "cameras");
    let [eye, target] = [read.cameras[0].1.eye, solved.scene.cameras[0].1.eye].map(DVec3::from);
    // z up becomes y up.
    assert!(eye.distance(DVec3::new(target.x, target.z, -target.y)) < 1e-5, "{eye} was {target}");
}

#[test]
fn the_mean_of_harmonics_is_the_mean_of_distributions() {
    let solved = solved("glossy-sphere");
    let file = File::of(&solved, "harmonics.glb");
    let model = gltf::Gltf::from_slice(&std::fs::read(&file.0).expect("the model was written")).expect("valid glTF");
    let zeroth = attribute(&model, 0, "_SH_0");
    assert!(!zeroth.is_empty(), "some surfaces are glossy");
    // Y₀ = 0.282: over the hemisphere glossy light is less than all that arrives would make, and there is some.
    let mean = zeroth.iter().map(|c| c.y).sum::<f32>() / zeroth.len() as f32;
    assert!(mean > 0.0 && zeroth.iter().all(|c| c.is_finite()), "glossy light: {mean}");
}

#[test]
fn charts_do_not_overlap() {
    let solved = solved("cornell");
    let file = File::of(&solved, "charts.glb");
    let model = gltf::Gltf::from_slice(&std::fs::read(&file.0).expect("the model was written")).expect("valid glTF");
    let coordinates = attribute(&model, 1, "TEXCOORD_1");
    assert!(coordinates.iter().all(|uv| uv.cmpge(Vec3::ZERO).all() && uv.x <= 1.0 && uv.y <= 1.0), "inside the image");
    let mut charts = lightmap::charts(&solved);
    let size = lightmap::pack(&mut charts).expect("charts");
    let mut taken = vec![false; size[0] as usize * size[1] as usize];
    for chart in &charts {
        for [x, y] in chart.texels() {
            let texel = &mut taken[y as usize * size[0] as usize + x as usize];
            assert!(!std::mem::replace(texel, true), "texel {x}, {y} belongs to two charts");
        }
    }
}

/// A floor of a rectangle and two triangles beside it, and a lamp above.
fn floor() -> Solved {
    let material = |exitance: f32| hr_scene::Material {
        name: "grey".into(),
        reflector: Arc::new(glossy_ext::Lambert::new(Rgb::splat(0.5)).expect("a reflectance")),
        exitance: Rgb::splat(exitance),
        two_sided: false,
        texture: None,
        base_color: Rgb::ONE,
    };
    let [a, b, c, d, e, f] =
        [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [3.0, 1.5], [1.0, 1.5], [0.0, 1.5]].map(|[x, y]| DVec3::new(x, y, 0.0));
    let lamp = [[0.6, 0.6], [0.6, 1.0], [1.1, 1.0], [1.1, 0.6]].map(|[x, y]| DVec3::new(x, y, 0.7));
    let surfaces = vec![
        Surface::new(Shape::Quad([a, b, e, f]), 0),
        Surface::new(Shape::Triangle([b, c, d]), 0),
        Surface::new(Shape::Triangle([b, d, e]), 0),
        Surface::new(Shape::Quad(lamp), 1),
    ];
    let scene = Scene { surfaces, materials: vec![material(0.0), material(100.0)], ..Scene::default() };
    let scene = Arc::new(scene.finish().expect("a sound scene"));
    let watch = &mut |_: &hr_diffuse::Progress| ControlFlow::Continue(());
    Solved::new(scene, Settings::with_error(ERROR), true, watch).expect("a sound scene")
}

#[test]
fn charts_meet_without_seams() {
    let solved = floor();
    let mut charts = lightmap::charts(&solved);
    let size = lightmap::pack(&mut charts).expect("charts");
    let [_, light] = lightmap::bake(&solved, &charts, size);
    // As a linear filter sees it.
    let at = |surface: u32, u: f32, v: f32| {
        let chart = charts.iter().find(|chart| chart.surface == surface).expect("each surface has a chart");
        let place = chart.coordinates(Vec2::new(u, v), size) * Vec2::new(size[0] as f32, size[1] as f32) - 0.5;
        let texel = |x: f32, y: f32| light[y as usize * size[0] as usize + x as usize];
        let (low, share) = (place.floor(), place.fract());
        let row = |y: f32| texel(low.x, y).lerp(texel(low.x + 1.0, y), share.x);
        row(low.y).lerp(row(low.y + 1.0), share.y)
    };
    for i in 0..=40 {
        let t = i as f32 / 40.0;
        // Of the rectangle u = 1 is the first side of the second triangle, whose other one is the hypotenuse of the first.
        for (one, other) in [(at(0, 1.0, t), at(2, 0.0, t)), (at(1, 0.0, t), at(2, t, 0.0))] {
            let seam = (one - other).abs().max_element() / one.max_element();
            assert!(one.max_element() > 0.1 && seam < 0.005, "a seam of {seam} at {t}: {one}, {other}");
        }
    }
}

#[test]
fn turned_models_stand_upright() {
    let solved = solved("furnace");
    let place = place(&solved, DVec3::ZERO);
    let up = place.as_mat4().transform_vector3(up_of(&solved.scene.cameras).as_vec3());
    assert!(up.distance(Vec3::Y) < 1e-6, "up is {up}");
}

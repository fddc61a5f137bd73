use super::*;
use crate::testing::Folder;
use hr_diffuse::Shape;
use proptest::prelude::*;
use std::f32::consts::PI;
use std::path::PathBuf;
use std::sync::Arc;

fn write(folder: &Folder, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path(name);
    std::fs::write(&path, bytes).expect("written");
    path
}

/// A file of one square with a library of one material 'm'.
fn with_material(folder: &Folder, statements: &str) -> Result<Scene, SceneError> {
    write(folder, "a.mtl", format!("newmtl m\n{statements}"));
    load(&write(folder, "a.obj", format!("mtllib a.mtl\nusemtl m\n{SQUARE}f 1/1 2/2 3/3 4/4\n")))
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

fn parse(text: &str) -> Scene {
    from_bytes(text.as_bytes(), Path::new("no folder/small.obj")).expect("valid")
}

fn error(text: &str) -> String {
    from_bytes(text.as_bytes(), Path::new("small.obj")).expect_err("wrong").to_string()
}

fn warned(scene: &Scene, what: &str) -> bool {
    scene.warnings.iter().any(|w| w.text.contains(what))
}

fn close(a: Rgb, b: [f32; 3]) -> bool {
    (a - Rgb::from(b)).abs().max_element() < 1e-5
}

#[test]
fn text_is_read_by_its_mark() {
    let text = format!("o \u{fc}bung\n{SQUARE}f 1 2 3 4\n");
    let plain = parse(&text);
    let marked = format!("\u{feff}{text}");
    let units: Vec<u16> = marked.encode_utf16().collect();
    let little = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
    let big = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
    for bytes in [marked.into_bytes(), little, big] {
        let scene = from_bytes(&bytes, Path::new("no folder/small.obj")).expect("valid");
        assert_eq!((scene.surfaces, scene.warnings), (plain.surfaces.clone(), plain.warnings.clone()), "{bytes:?}");
    }
}

#[test]
fn quadrilaterals_stay_and_triangle_pairs_merge() {
    for faces in ["f 1 2 3 4", "f 1 2 3\nf 1 3 4", "f -4 -3 -2 -1", "f 1 2 \\\n 3 4 # a comment"] {
        let scene = parse(&format!("{SQUARE}{faces}\n"));
        assert_eq!(scene.surfaces.len(), 1, "{faces}");
        assert!(matches!(scene.surfaces[0].shape, Shape::Quad(_)), "{faces}");
    }
    let trapezoid = parse("v 0 0 0\nv 3 0 0\nv 2 1 0\nv 0 1 0\nf 1 2 3 4\n");
    assert!(matches!(trapezoid.surfaces[0].shape, Shape::Quad(_)), "planar and convex is enough");
    let bent = parse("v 0 0 0\nv 3 0 0\nv 2 1 1\nv 0 1 0\nf 1 2 3 4\n");
    assert_eq!(bent.surfaces.len(), 2, "a bent one is two triangles");
    assert_eq!(bent.primaries, Primaries::Rec709, "primaries");
    assert!(bent.materials[0].two_sided, "the format has no sides");
    assert_eq!(bent.materials[0].base_color, Rgb::splat(0.5), "grey without a material");
}

#[test]
fn polygons_fall_into_pieces() {
    let scene = parse("v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4 5 6\n");
    assert_eq!(scene.surfaces.len(), 2, "an L is two quadrilaterals");
    let area: f64 = (scene.surfaces.iter())
        .map(|s| match &s.shape {
            Shape::Triangle([a, b, c]) => 0.5 * (*b - *a).cross(*c - *a).z,
            Shape::Quad([a, b, c, d]) => 0.5 * (*c - *a).cross(*d - *b).z,
            other => panic!("{other:?} does not come from OBJ"),
        })
        .sum();
    assert!((area - 3.0).abs() < 1e-12, "the area of the L: {area}");
    let crossed = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 2 0\nv 0 2 0\nv 5 1 0\nf 1 2 3 4 5 6\nf 1 2 3\n");
    assert_eq!(crossed.surfaces.len(), 1, "crossed polygons do not stop the rest");
    assert!(warned(&crossed, "crosses itself"), "they are told of: {:?}", crossed.warnings);
}

#[test]
fn double_precision_is_kept() {
    let scene = parse("v 1e7 0 0\nv 10000000.001 0 0\nv 1e7 0.001 0\nf 1 2 3\n");
    let Shape::Triangle([a, b, _]) = scene.surfaces[0].shape else { panic!("a triangle") };
    assert!((b.x - a.x - 0.001).abs() < 1e-8, "a millimetre, ten thousand kilometres away");
}

#[test]
fn normals_and_colours() {
    let scene = parse(&format!(
        "{}vn 1 0 5\nvn -1 0 5\nf 1//1 2//2 3//2 4//1\nf 1 2 3\n",
        "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 1 1 0 0 1 0\nv 0 1 0 0 1 0\n"
    ));
    assert_eq!(scene.surfaces.len(), 2, "one face with normals, one without");
    let shaded = scene.surfaces.iter().find(|s| s.shading_normals.is_some()).expect("the first face");
    assert!(matches!(shaded.shape, Shape::Quad(_)), "it stays whole");
    let color = scene.base_color(0, 0.5, 0.5).expect("coloured");
    assert!(close(color, [0.25, 0.25, 0.0]), "grey times the middle colour: {color}");
}

#[test]
fn materials() {
    let folder = Folder::new("obj-materials");
    let material = |statements: &str| with_material(&folder, statements).expect("valid").materials.remove(0);
    let plain = material("Kd 0.2 0.4 0.6\nKe 1 2 3\nNs 20\nKs 0.1 0.1 0.1\n");
    assert_eq!((plain.name.as_str(), plain.base_color), ("m", Rgb::new(0.2, 0.4, 0.6)), "Kd");
    assert!(close(plain.exitance / PI, [1.0, 2.0, 3.0]), "Ke is radiance");
    assert!(close(plain.reflector.diffuse(), [0.2, 0.4, 0.6]), "the diffuse part");
    assert_eq!(material("Kd 0.3\n").base_color, Rgb::splat(0.3), "one number is grey");
    let metal = material("Kd 0.9 0.8 0.1\nPm 1\nPr 0.2\n");
    assert_eq!(metal.reflector.diffuse(), Rgb::ZERO, "a metal has no diffuse part");
    let bright = with_material(&folder, "Kd 1 0.5 0\nKs 1 1 1\nNs 8\n").expect("valid");
    assert!(warned(&bright, "classic") && warned(&bright, "scaled to at most 1"), "{:?}", bright.warnings);
    let [base, total] = [bright.materials[0].base_color, Rgb::new(2.0, 1.0, 0.0) / 3.0];
    assert!(close(base, total.to_array()), "half of Ks, then all scaled to 1: {base}");
    let matte = with_material(&folder, "Kd 1 0.5 0\nKs 1 1 1\nillum 1\n").expect("valid");
    assert!(close(matte.materials[0].base_color, [1.0, 0.5, 0.0]), "no highlight in model 1");
    let odd = with_material(&folder, "Kd spectral a.rfl\nd 0.5\nmap_Bump x.png\nKe nan -1 inf\n").expect("valid");
    assert!(warned(&odd, "spectral") && warned(&odd, "transparency") && warned(&odd, "map_Bump"), "{:?}", odd.warnings);
    assert_eq!(odd.materials[0].exitance, Rgb::ZERO, "only numbers shine");
    let error = with_material(&folder, "Kd 0.1 0.2 x\n").expect_err("no number").to_string();
    assert!(error.contains("a.mtl:2: 'x' is no number"), "{error}");
}

/// Ks of files that would reflect more than they receive are factors of lobes that are not normalised, in all materials
/// of the file: radiance at the peak is Ks / π times irradiance.
#[test]
fn highlights_of_the_classic_model() {
    let folder = Folder::new("obj-classic");
    let peak = |statements: &str| {
        let scene = with_material(&folder, statements).expect("valid");
        let reflector = Arc::clone(&scene.materials[0].reflector);
        let lobe = PI * reflector.glossy(Vec3::Z, Vec3::Z);
        (lobe.x, reflector.directional_albedo(Vec3::Z).x, warned(&scene, "classic"))
    };
    let wood = "Kd 0.4 0.3 0.2\nKs 0.5 0.5 0.5\nNs 96\n";
    let (lobe, albedo, classic) = peak(wood);
    assert!(!classic && (lobe - 0.5 * 98.0 / 2.0).abs() < 0.01 && (albedo - 0.5).abs() < 1e-3, "{lobe} {albedo}");
    let (lobe, albedo, classic) = peak(&format!("{wood}newmtl white\nKd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nNs 20\n"));
    assert!(classic && (lobe - 0.5).abs() < 1e-4, "{lobe}");
    assert!((albedo - 0.5 * 8.0 / 104.0).abs() < 1e-3, "{albedo}");
}

#[test]
fn textures() {
    let folder = Folder::new("obj-textures");
    // Black, red / green, blue from the upper left.
    let texel = |x: u32, y: u32| [[[0, 0, 0], [255, 0, 0]], [[0, 255, 0], [0, 0, 255]]][y as usize][x as usize];
    let image = image::RgbImage::from_fn(2, 2, |x, y| image::Rgb(texel(x, y)));
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).expect("written");
    write(&folder, "a texture.png", png.into_inner());
    let scene = with_material(&folder, "Kd 0.5 1 1\nmap_Kd a texture.png\n").expect("valid");
    let at = |scene: &Scene, u, v| scene.base_color(0, u, v).expect("textured");
    assert!(close(at(&scene, 0.25, 0.25), [0.0, 1.0, 0.0]), "lower left is green: v goes up");
    assert!(close(at(&scene, 0.75, 0.75), [0.5, 0.0, 0.0]), "upper right is red");
    let mean = scene.materials[0].reflector.diffuse();
    assert!(close(mean, [0.125, 0.25, 0.25]), "the mean colour reflects: {mean}");
    let moved =
        with_material(&folder, "Kd 1 1 1\nmap_Kd -s 1 1 1 -o 0 0.5 0 -clamp on a texture.png\n").expect("valid");
    // v + ½ of the lower left is the upper left.
    assert!(close(at(&moved, 0.25, 0.25), [0.0; 3]), "moved: {}", at(&moved, 0.25, 0.25));
    assert!(close(at(&moved, 0.75, 0.9), [1.0, 0.0, 0.0]), "clamped at the top");
    let missing = with_material(&folder, "Kd 1 1 1\nmap_Kd missing.png\n").expect("valid");
    assert!(warned(&missing, "missing.png") && missing.attributes.is_empty(), "only warned of");
}

#[test]
fn what_is_missing_is_warned_of() {
    let scene = parse(&format!("mtllib none.mtl\nusemtl gone\n{SQUARE}f 1 2 3 4\nf 1 2\nl 1 2 3\ncurv 0 1 1 2\n"));
    assert_eq!(scene.surfaces.len(), 1, "a line of three points is no face");
    for what in ["none.mtl", "'gone'", "fewer than three", "points and lines", "free-form"] {
        assert!(warned(&scene, what), "{what}: {:?}", scene.warnings);
    }
    let flat = parse(&format!("{SQUARE}f 1 2 3 4\nf 1 1 2\nf 1 2 2 1\nv nan 0 0\nf 1 2 5\n"));
    assert_eq!(flat.surfaces.len(), 1, "what has no area is left out: {:?}", flat.warnings);
}

#[test]
fn errors_name_the_line() {
    assert!(error("v 0 0 0\n\nv 1 x 0\n").starts_with("small.obj:3: 'x' is no number"), "a coordinate");
    assert!(error("v 0 0\n").starts_with("small.obj:1: a number is missing"), "a missing one");
    let message = error(&format!("{SQUARE}f 1 2 7\n"));
    assert!(message.starts_with("small.obj:9: '7' has the v index '7', and 4 are known here; 1…4"), "{message}");
    for corner in ["0", "-5", "1/9", "1//1", "1/1/1/1", "x", "/1", "99999999999999999999", "-9223372036854775808/1"] {
        assert!(error(&format!("{SQUARE}f 1 2 {corner}\n")).starts_with("small.obj:9: "), "{corner}");
    }
    assert!(error("# nothing\n").contains("no surface"), "empty");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn mutated_bytes_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12)) {
        let text = format!("{SQUARE}vn 0 0 1\nvn 0.1 0 1\nv 3 1 1 0.5 1 0\n\
            f 1/1/1 2/2/1 3/3/2 4/4/2\nf 1 2 \\\n 3\nf -1 -2 -3 -4 1\n");
        let mut bytes = text.into_bytes();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok(scene) = from_bytes(&bytes, Path::new("no folder/mutated.obj")) {
            for surface in &scene.surfaces {
                let finite = match &surface.shape {
                    Shape::Triangle(p) => p.iter().all(|p| p.is_finite()),
                    Shape::Quad(p) => p.iter().all(|p| p.is_finite()),
                    _ => false,
                };
                prop_assert!(finite, "corners are numbers");
            }
        }
    }

    #[test]
    fn mutated_libraries_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let text = "newmtl a\nKd 0.5 0.2 0.1\nKs 0.5\nNs 10\nKe 1 2 3\nmap_Kd -s 1 2 -clamp on -o 1 x.png\nillum 2\n\
                    newmtl b\nPr 0.2\nPm 1\nd 0.5\nmap_Kd y.png\nbump z.png\n";
        let mut bytes = text.as_bytes().to_vec();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        let mut library = Library::default();
        let mut warnings = Warnings::default();
        if library.read(&bytes, Path::new("no folder/m.mtl"), &mut warnings).is_ok() {
            for source in &library.materials {
                let material = mtl::material(Some(source), false);
                prop_assert!(material.exitance.is_finite() && material.exitance.min_element() >= 0.0, "emission");
                prop_assert!(material.base_color.min_element() >= 0.0, "base colour");
                prop_assert!(material.base_color.max_element() <= 1.0, "base colour");
            }
        }
    }
}

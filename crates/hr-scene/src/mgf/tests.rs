//! Whole texts: every entity, orientation, errors with their places, and texts that no one would write.

use super::read;
use crate::{Scene, SceneError};
use glam::{DVec3, Vec3};
use hr_diffuse::{Shape, Surface};
use proptest::prelude::*;
use std::collections::HashMap;
use std::io;
use std::path::Path;

fn read_with(text: &[u8], files: &[(&str, &str)]) -> Result<Scene, SceneError> {
    let files: HashMap<_, _> = files.iter().copied().collect();
    read("dir/t.mgf".as_ref(), text, &|path: &Path| {
        let name = path.to_str().and_then(|path| files.get(path));
        name.map(|text| text.as_bytes().to_vec()).ok_or_else(|| io::ErrorKind::NotFound.into())
    })
}

fn scene(text: &str) -> Scene {
    read_with(text.as_bytes(), &[]).unwrap_or_else(|error| panic!("{text}\n{error}"))
}

fn error(text: &str) -> String {
    read_with(text.as_bytes(), &[]).map(|scene| scene.surfaces).expect_err(text).to_string()
}

fn shapes(text: &str) -> Vec<Shape> {
    scene(text).surfaces.into_iter().map(|surface| surface.shape).collect()
}

fn corners(surface: &Surface) -> Vec<DVec3> {
    assert!(!surface.flip, "polygons are turned by the order of their corners");
    match &surface.shape {
        Shape::Triangle(p) => p.to_vec(),
        Shape::Quad(p) => p.to_vec(),
        other => panic!("{other:?} is no polygon"),
    }
}

/// Sum over polygons of area times normal.
fn area_vector(scene: &Scene) -> DVec3 {
    scene.surfaces.iter().map(|surface| 0.5 * crate::polygon::area_vector(&corners(surface))).sum()
}

/// Volume within polygons whose fronts look outward; negative where they look inward.
fn volume(scene: &Scene) -> f64 {
    let volume = |p: &[DVec3]| (2..p.len()).map(|k| p[0].dot(p[k - 1].cross(p[k])) / 6.0).sum::<f64>();
    scene.surfaces.iter().map(|surface| volume(&corners(surface))).sum()
}

fn warnings(scene: &Scene) -> Vec<&str> {
    scene.warnings.iter().map(|warning| warning.text.as_str()).collect()
}

fn assert_near(a: impl Into<DVec3>, b: [f64; 3], what: &str) {
    let a = a.into();
    assert!((a - DVec3::from(b)).abs().max_element() < 1e-6, "{what}: {a} is not {b:?}");
}

/// Corners a b c d of a square of 4 × 4 that looks to +z, e f g h and i j k l of two holes in it.
const SQUARE: &str = "v a =\n p 0 0 0\nv b =\n p 4 0 0\nv c =\n p 4 4 0\nv d =\n p 0 4 0\n\
    v e =\n p 1 1 0\nv f =\n p 1 2 0\nv g =\n p 2 2 0\nv h =\n p 2 1 0\n\
    v i =\n p 2.5 2.5 0\nv j =\n p 2.5 3.5 0\nv k =\n p 3.5 3.5 0\nv l =\n p 3.5 2.5 0\n";

/// Two vertices on the z axis, the first with a normal.
const AXIS: &str = "v a =\n p 1 2 3\n n 0 0 2\nv b =\n p 1 2 7\n";

#[test]
fn faces() {
    let s = scene(&format!("{SQUARE}f a b c d\n"));
    let square = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]].map(DVec3::from);
    assert_eq!(s.surfaces, [Surface::new(Shape::Quad(square), 0)], "a square is one quadrilateral");
    for (faces, area) in [
        ("f a b c", 8.0),
        ("f a b g d", 8.0),
        ("f a b c d a e f g h e", 15.0),
        ("fh a b c d", 16.0),
        ("fh a b c d - e f g h", 15.0),
        ("fh a b c d - h g f e - i j k l", 14.0),
    ] {
        let s = scene(&format!("{SQUARE}{faces}\n"));
        assert_near(area_vector(&s), [0.0, 0.0, area], faces);
        assert!(s.warnings.is_empty(), "{faces}: {:?}", s.warnings);
    }
}

#[test]
fn degenerate_geometry_is_left_out_and_counted() {
    let text = "f a b a\nf a a a\nfh a b b - e f g\nsph a 0\ncyl a 0 b\ncyl a 1 a\nprism a b a 1\n\
        prism a b c 0\nf a b c d a\nv x =\n p 1.5e308 0 0\nv y =\n p -1.5e308 1e308 0\nf x y a\nv a =\n n 0 0 1\n\
        ring a 2 2\ntorus a 1 1\nv m =\n p 1 -1 0\nf a b c m d\n";
    let s = scene(&format!("{SQUARE}{text}"));
    assert_eq!(s.surfaces.len(), 1, "one square is good: {:?}", s.surfaces);
    let counts: HashMap<_, _> = s.warnings.iter().map(|w| (w.text.as_str(), (w.count, w.first.as_str()))).collect();
    for (text, count, line) in [
        ("face with no area: left out", 3, 25),
        ("sphere with a radius of 0: left out", 1, 28),
        ("cone or cylinder without length or radius: left out", 2, 29),
        ("prism with no area: left out", 1, 31),
        ("prism with a length of 0: left out", 1, 32),
        ("face with coordinates that are not finite: left out", 1, 38),
        ("ring with equal radii: left out", 1, 41),
        ("torus with equal radii: left out", 1, 42),
        ("face with an outline that crosses itself: left out", 1, 45),
    ] {
        assert_eq!(counts.get(text), Some(&(count, format!("dir/t.mgf:{line}").as_str())), "{text}: {counts:?}");
    }
}

#[test]
fn vertex_normals() {
    let normals = |n: [&str; 4]| {
        let vertices: String =
            ["a", "b", "c", "d"].iter().zip(n).map(|(v, n)| format!("v {v} = {v}\n n {n}\n")).collect();
        scene(&format!("{SQUARE}{vertices}f a b c d\n"))
    };
    let s = normals(["0 0 1"; 4]);
    assert_eq!(s.surfaces[0].shading_normals, None, "equal ones say nothing");
    let s = normals(["0 0 0", "1 0 1", "1 0 1", "0 0 1"]);
    assert_eq!(s.surfaces[0].shading_normals, None, "one is missing");
    let s = normals(["0 0 1", "3 0 3", "3 0 3", "0 0 1"]);
    let given = s.surfaces[0].shading_normals.expect("they differ");
    assert_near(given[0].as_dvec3(), [0.0, 0.0, 1.0], "at a");
    assert_near(given[1].as_dvec3(), [0.5_f64.sqrt(), 0.0, 0.5_f64.sqrt()], "at b, unit length");
    assert!(s.warnings.is_empty(), "{:?}", s.warnings);
    let s = normals(["0 0 -1", "3 0 -3", "3 0 -3", "0 0 -1"]);
    assert_near(area_vector(&s), [0.0, 0.0, -16.0], "turned over");
    let corner = corners(&s.surfaces[0]).iter().position(|p| *p == DVec3::new(4.0, 0.0, 0.0)).expect("corner b");
    let given = s.surfaces[0].shading_normals.expect("they differ");
    assert_near(given[corner].as_dvec3(), [0.5_f64.sqrt(), 0.0, -0.5_f64.sqrt()], "turned with their corners");
    assert_eq!(warnings(&s), ["all vertex normals of a face point behind it: turned over to agree with them"], "said");
    let s = normals(["0 0 -1", "3 0 3", "3 0 3", "0 0 1"]);
    let given = s.surfaces[0].shading_normals.expect("they differ");
    assert_eq!(given[0], Vec3::Z, "a normal behind the face is replaced");
    assert_eq!(s.warnings.len(), 1, "{:?}", s.warnings);
}

#[test]
fn curved_surfaces_stay_curved() {
    let (a, b) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 7.0));
    for (text, shape, flip) in [
        ("sph a 2", Shape::Sphere { center: a, radius: 2.0 }, false),
        ("sph a -2", Shape::Sphere { center: a, radius: 2.0 }, true),
        ("cyl a 2 b", Shape::Cone { ends: [a, b], radii: [2.0, 2.0] }, false),
        ("cyl a -2 b", Shape::Cone { ends: [a, b], radii: [2.0, 2.0] }, true),
        ("cone a 2 b 0", Shape::Cone { ends: [a, b], radii: [2.0, 0.0] }, false),
        ("cone a 0 b -1", Shape::Cone { ends: [a, b], radii: [0.0, 1.0] }, true),
        ("cone a -0 b 1", Shape::Cone { ends: [a, b], radii: [0.0, 1.0] }, false),
        ("cone a -1 b -0.5", Shape::Cone { ends: [a, b], radii: [1.0, 0.5] }, true),
        ("ring a 0 2", Shape::Ring { center: a, normal: DVec3::Z, inner: 0.0, outer: 2.0 }, false),
        ("ring a 1 2", Shape::Ring { center: a, normal: DVec3::Z, inner: 1.0, outer: 2.0 }, false),
        ("torus a 1 3", Shape::Torus { center: a, axis: DVec3::Z, major: 2.0, minor: 1.0 }, false),
        ("torus a -1 -3", Shape::Torus { center: a, axis: DVec3::Z, major: 2.0, minor: 1.0 }, true),
    ] {
        let s = scene(&format!("{AXIS}{text}\n"));
        assert_eq!(s.surfaces, [Surface { flip, ..Surface::new(shape, 0) }], "{text}");
        assert!(s.warnings.is_empty(), "{text}: {:?}", s.warnings);
    }
    let closed = shapes(&format!("{AXIS}torus a 0 2\n"));
    assert!(
        matches!(closed[..], [Shape::Torus { major, minor, .. }] if minor < major && minor > 0.999_999 * major),
        "a torus without a hole: {closed:?}"
    );
}

#[test]
fn prisms() {
    assert_eq!(volume(&scene(&format!("{SQUARE}prism a b c d 2\n"))), 32.0, "behind the face, looking outward");
    assert_eq!(volume(&scene(&format!("{SQUARE}prism a b c d -2\n"))), -32.0, "before the face, looking inward");
    for (length, z) in [("2", -2.0), ("-2", 2.0)] {
        let s = scene(&format!("{SQUARE}prism a b c d {length}\n"));
        assert_eq!(s.surfaces.len(), 6, "a box");
        assert_eq!(area_vector(&s), DVec3::ZERO, "closed");
        for p in s.surfaces.iter().flat_map(corners) {
            assert!(p.z == 0.0 || p.z == z, "{p} with a length of {length}");
        }
    }
    let s = scene(&format!("{SQUARE}prism a b g d 3\n"));
    assert_eq!(volume(&s), 24.0, "a concave base");
    // A round one: normals on the sides, none on the caps.
    let vertices = "v a = a\n n -1 -1 0\nv b = b\n n 1 -1 0\nv c = c\n n 1 1 0\nv d = d\n n -1 1 0\n";
    let s = scene(&format!("{SQUARE}{vertices}prism a b c d 2\n"));
    assert_eq!(volume(&s), 32.0, "looking outward");
    let smooth = s.surfaces.iter().filter(|surface| surface.shading_normals.is_some()).count();
    assert_eq!((s.surfaces.len(), smooth), (6, 4), "four smooth sides, two flat caps");
}

#[test]
fn transforms_move_geometry_when_it_is_used() {
    let s = scene(&format!("xf -t 9 9 9\n{SQUARE}xf\nxf -s 2 -t 1 0 0 -rz 90\nf a b c d\nxf\n"));
    let moved = [[0.0, 1.0, 0.0], [0.0, 9.0, 0.0], [-8.0, 9.0, 0.0], [-8.0, 1.0, 0.0]].map(DVec3::from);
    assert_eq!(s.surfaces[0].shape, Shape::Quad(moved), "vertices do not know where they were defined");
    let s = scene(&format!("{AXIS}xf -t 0 0 1\nxf -s -2 -rx 90\ncyl a 1 b\ntorus a 1 3\nxf\nsph a 1\nxf\n"));
    // (1 2 3) scaled by −2 is (−2 −4 −6), turned (−2 6 −4), moved (−2 6 −3).
    let first = DVec3::new(-2.0, 6.0, -3.0);
    assert_eq!(
        s.surfaces.into_iter().map(|surface| surface.shape).collect::<Vec<_>>(),
        [
            Shape::Cone { ends: [first, DVec3::new(-2.0, 14.0, -3.0)], radii: [2.0; 2] },
            Shape::Torus { center: first, axis: DVec3::Y, major: 4.0, minor: 2.0 },
            Shape::Sphere { center: DVec3::new(1.0, 2.0, 4.0), radius: 1.0 },
        ],
        "inner transforms act first; radii are scaled"
    );
}

#[test]
fn mirrors_keep_the_side_that_the_normal_points_to() {
    for (flags, normal) in [
        ("-mx", [0.0, 0.0, 16.0]),
        ("-my", [0.0, 0.0, 16.0]),
        ("-mz", [0.0, 0.0, -16.0]),
        ("-s -1", [0.0, 0.0, -16.0]),
        ("-mx -rx 90", [0.0, -16.0, 0.0]),
        ("-mx -my", [0.0, 0.0, 16.0]),
    ] {
        assert_near(area_vector(&scene(&format!("{SQUARE}xf {flags}\nf a b c d\nxf\n"))), normal, flags);
        let s = scene(&format!("{SQUARE}xf {flags} -t 1 2 3\nprism a b g d 2\nxf\n"));
        assert!((volume(&s) - 16.0).abs() < 1e-12, "{flags}: outside stays outside, {}", volume(&s));
        let ring = shapes(&format!("v a =\n n 0 0 1\nxf {flags}\nring a 0 1\nxf\n"));
        let Shape::Ring { normal: n, .. } = ring[0] else { panic!("{ring:?}") };
        assert_near(n * 16.0, normal, "a ring looks where a face does");
        assert!(!scene(&format!("v a =\nxf {flags}\nsph a 1\nxf\n")).surfaces[0].flip, "{flags}: spheres stay");
        // Shading normals go along, and stay with their corners.
        let s = scene(&format!(
            "{SQUARE}v a = a\n n -1 0 2\nv b = b\n n 1 0 2\nv c = c\n n 1 0 2\nv d = d\n n -1 0 2\n\
             xf {flags}\nf a b c d\nxf\n"
        ));
        let normals = s.surfaces[0].shading_normals.expect("they differ");
        let front = DVec3::from(normal) / 16.0;
        let points = corners(&s.surfaces[0]);
        let middle = points.iter().sum::<DVec3>() / 4.0;
        for (p, n) in points.iter().zip(normals) {
            let n = n.as_dvec3();
            assert!(n.dot(front) > 0.8, "{flags}: {n} at {p} is on the front side");
            assert!(n.dot(*p - middle) > 0.0, "{flags}: {n} at {p} leans outward");
        }
    }
}

#[test]
fn arrays_and_nested_arrays() {
    let text = "v o =\nxf -a 3 -t 10 0 0\nxf -t 0 0 1 -a 2 -t 0 5 0\nsph o 1\nxf\nxf\nsph o 2\n";
    let mut centers: Vec<_> = shapes(text)
        .into_iter()
        .map(|shape| match shape {
            Shape::Sphere { center, radius } => (radius, center.to_array()),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(centers.pop(), Some((2.0, [0.0; 3])), "after the arrays we are back where we were");
    let expected: Vec<_> = (0..6).map(|k| (1.0, [10.0 * f64::from(k / 2), 5.0 * f64::from(k % 2), 1.0])).collect();
    assert_eq!(centers, expected, "three by two");
    assert_eq!(shapes("v o =\nxf -a 0 -mx\nsph o 1\nxf\nsph o 2\n").len(), 1, "an array of none");
    assert_eq!(shapes("v o =\nxf -a 5 -mx\nxf\nsph o 2\n").len(), 1, "an array of nothing");
}

#[test]
fn contexts_and_materials() {
    let s = scene(
        "v o =\nm a =\n rd .2\nm b = a\n rs .1 .05\nm a =\n rd .6\n sides 1\nm b\nsph o 1\nm a\nsph o 1\nm b\nsph o 1\n\
         rd .3\nsph o 1\nm\nsph o 1\n",
    );
    let used: Vec<_> = s.surfaces.iter().map(|surface| surface.material).collect();
    assert_eq!(used, [0, 1, 0, 2, 3], "a material is what it is when it is used");
    let described: Vec<_> =
        s.materials.iter().map(|m| (m.name.as_str(), m.two_sided, m.reflector.diffuse().x)).collect();
    assert_eq!(described, [("b", true, 0.2), ("a", false, 0.6), ("b", true, 0.3), ("unnamed", true, 0.0)], "materials");
}

#[test]
fn colors_by_hand() {
    let s = scene(
        "v o =\nc red =\n cxy .64 .33\nc green =\n cxy .29 .6\nm yellow =\n c yellow =\n \
         cmix .26510582 red .67010582 green\n rd .46760582\n c\n ed 100\nsph o 1\n\
         m lamp =\n c\n cct 2856\n ed 10\nsph o 1\nm line =\n c\n cspec 380 780 1 1\n rd .5\nsph o 1\n",
    );
    let rgb = |k: usize| s.materials[k].reflector.diffuse().as_dvec3();
    // Red and green with the luminances of the primaries are (1 1 0), of which Y = .93521164 is halved.
    assert_near(rgb(0), [0.5, 0.5, 0.0], "a mixture");
    assert_near(s.materials[0].exitance.as_dvec3(), [100.0; 3], "neutral after `c`");
    assert_near(rgb(2), [0.5; 3], "a flat spectrum");
    // Illuminant A, x = .4476, y = .4074: XYZ = (1.0987, 1, .3559) times 10; the matrix to these primaries is, to
    // three decimals, (2.690 −1.276 −.414, −1.022 1.978 .044, .061 −.224 1.163).
    let a = s.materials[1].exitance.as_dvec3();
    let luminance = a.dot(DVec3::new(0.265_105_82, 0.670_105_82, 0.064_788_36));
    assert!((luminance - 10.0).abs() < 1e-5, "ed is the luminance-weighted sum: {a}");
    assert!((a / 10.0 - DVec3::new(1.532, 0.871, 0.257)).abs().max_element() < 0.03, "orange: {a}");
}

#[test]
fn what_is_not_simulated_is_said() {
    let s = scene(
        "v o =\nm glass =\n rd .1\n td .2\n ts .5 0\n ir 1.5 0\nsph o 1\nsph o 2\nm bright =\n rd .9\n rs .3 .1\nsph o 1\n\
         sparkle 1 2\nsparkle\no ball\no\no\nc none =\n cxy .2 0\nxf -mx\no open\n",
    );
    assert_eq!(
        warnings(&s),
        [
            "material 'glass' is translucent (td, ts): opaque here, what it reflects is kept",
            "material 'bright' reflects 1.200 of the light in a channel: rd and rs scaled so that it is 1",
            "unknown entity 'sparkle': ignored",
            "'o' closes an object that was not opened: ignored",
            "colour without luminance (cxy): neutral taken instead",
            "transform (xf) left open at the end of its file: closed there",
            "object left open at the end of the file",
        ],
        "warnings in their order"
    );
    let counts: Vec<_> = s.warnings.iter().map(|w| w.count).collect();
    assert_eq!(counts, [1, 1, 2, 1, 1, 1, 1], "translucency once per material, unknown entities each time");
    assert_eq!(s.warnings[2].first, "dir/t.mgf:13", "where it came first");
}

#[test]
fn includes() {
    let files = [
        ("dir/sub/part.mgf", "i ./other.mgf -t 0 0 1\nsph o 1\n"),
        ("dir/sub/other.mgf", "v o =\nxf -mz\n"),
        ("dir/bad.mgf", "# fine\nrd 2\n"),
        ("dir/self.mgf", "i sub/../self.mgf\n"),
        ("dir/a.mgf", "i b.mgf\n"),
        ("dir/b.mgf", "i ./a.mgf\n"),
    ];
    let s = read_with(b"i sub/part.mgf -a 2 -t 3 0 0\nsph o 2\n", &files).expect("two spheres and one");
    assert_eq!(s.surfaces.len(), 3, "an array of includes, names known after it: {:?}", s.surfaces);
    assert_eq!(s.surfaces[1].shape, Shape::Sphere { center: DVec3::X * 3.0, radius: 1.0 }, "moved");
    assert_eq!(s.surfaces[2].shape, Shape::Sphere { center: DVec3::ZERO, radius: 2.0 }, "transforms end with the file");
    for (text, message) in [
        ("\ni missing.mgf", "dir/t.mgf:2: cannot read include 'missing.mgf': "),
        ("i bad.mgf", "dir/bad.mgf:2: rd of 2; it is a share of the light, from 0 to 1"),
        ("i a.mgf", "dir/b.mgf:1: file './a.mgf' includes itself; break the circle"),
        ("i self.mgf", "cannot read include"),
        ("i", "dir/t.mgf:1: an include without a file name; write"),
        ("i sub/other.mgf -q", "dir/t.mgf:1: unknown transform argument '-q'; transform arguments are"),
    ] {
        let error = read_with(text.as_bytes(), &files).expect_err(text).to_string();
        assert!(error.contains(message), "{text}: {error}");
    }
    // A file under ever new names is stopped by the depth.
    let error = read("t.mgf".as_ref(), b"i x/../t.mgf", &|_| Ok(b"i x/../t.mgf".to_vec())).expect_err("endless");
    assert!(error.to_string().contains("nested more than 64 deep"), "{error}");
}

#[test]
fn errors_say_where_what_and_what_would_be_right() {
    for (text, message) in [
        ("\n\nf a b v3", "dir/t.mgf:3: undefined vertex 'a'; define it with `v a =` before use"),
        ("v a =\nf a a", "dir/t.mgf:2: a polygon of 2 names where three or more belong; write `f v1 v2 v3 …`"),
        ("f", "a polygon of 0 names where"),
        ("v a =\nfh a a a - a", "dir/t.mgf:2: a polygon of 1 name where"),
        (
            "v a =\n\\\np 1 2",
            "dir/t.mgf:2: 2 arguments where 3 belong; write `p x y z`, comments on lines of their own",
        ),
        ("p 1 2 x", "'x' is not a finite number; write a number such as"),
        ("p 1 2 inf", "'inf' is not a finite number"),
        ("p 1 2 1e999", "'1e999' is not a finite number"),
        ("n 1 2 3 # up", "5 arguments where 3 belong"),
        ("v a b", "this is no vertex context; write `v`, `v name`, `v name =` or `v name = template`"),
        ("c blue", "undefined colour 'blue'; define it with `c blue =` before use"),
        ("m a = b", "undefined material 'b'; define it with `m b =` before use"),
        ("rd -1", "rd of -1; it is a share of the light, from 0 to 1"),
        ("td 1.5", "td of 1.5; it is a share"),
        ("rs .5", "1 argument where 2 belong; write `rs amount roughness`"),
        ("rs .5 -1", "rs with a roughness of -1; the roughness is the RMS facet slope"),
        ("ts 3 .1", "ts of 3; it is a share"),
        ("ed -5", "an exitance of -5 W/m²; ed is from 0 to 1e30 W/m²"),
        ("ed 1e40", "W/m²; ed is from 0"),
        ("sides 3", "a surface with '3' sides; write `sides 1`"),
        ("sides two", "a surface with 'two' sides; write `sides 1`"),
        ("ir 1", "1 argument where 2 belong; write `ir n_real n_imaginary`"),
        ("cxy .7 .7", "(0.7, 0.7) is no chromaticity; give CIE 1931 coordinates"),
        ("cct 0", "a black body of 0 K; give a temperature above 0 K"),
        ("cspec 400", "a spectrum without its wavelengths; write `cspec"),
        ("cspec 400 700 1", "a spectrum of 1 value; write `cspec"),
        ("cspec 700 400 1 1", "a spectrum from 700 nm to 400 nm; the shorter wavelength comes first"),
        ("cmix 1", "a mixture needs pairs of weight and colour; write `cmix"),
        ("cmix 1 blue", "undefined colour 'blue'"),
        ("c b =\ncmix -1 b", "weight -1 is negative; write `cmix"),
        ("v a =\nring a 0 1", "dir/t.mgf:2: vertex 'a' has no normal; give the axis with `n dx dy dz`"),
        ("v a =\nn 0 0 1\nring a 2 1", "a ring from radius 2 to 1; the inner radius comes first"),
        ("v a =\nn 0 0 1\nring a -1 1", "a ring from radius -1 to 1; the inner radius comes first"),
        ("v a =\nn 0 0 1\ntorus a 2 1", "a torus from radius 2 to 1; the inner radius comes first"),
        ("v a =\nn 0 0 1\ntorus a -1 2", "a torus from radius -1 to 2; the inner radius comes first"),
        ("v a =\ncone a 1 a -1", "a cone whose radii 1 and -1 have opposite signs; make both positive"),
        ("v a =\nsph a", "1 argument where 2 belong; write `sph center radius`"),
        ("v a =\ncyl a 1", "2 arguments where 3 belong; write `cyl v1 radius v2`"),
        ("prism", "a prism without vertices; write `prism v1 v2 v3 … length`"),
        ("v a =\nprism a a 1", "a polygon of 2 names where three or more belong; write `prism"),
        ("v a =\nprism a a a a", "'a' is not a finite number"),
        ("xf", "'xf' closes a transform that was not opened in this file; delete it"),
        ("xf -a 3 -mx", "an array (xf … -a) without an end; close it with `xf`"),
        ("xf -t 1", "dir/t.mgf:1: -t without its number; transform arguments are `-t dx dy dz`"),
        ("ies lamp.ies", "IES luminaire 'lamp.ies' is not supported; convert it"),
        ("ies", "IES luminaire '' is not supported; convert it"),
    ] {
        let error = error(text);
        assert!(error.contains(message), "{text}\n  says: {error}\n  not:  {message}");
    }
    let odd = error(&format!("f \u{1b}\u{7}\u{202e}{}", "x".repeat(1000)));
    assert!(odd.len() < 200 && odd.chars().all(|c| !c.is_control()), "one short line for any word: {odd}");
}

#[test]
fn explosions_are_refused() {
    let comment = "# words that take no time ".repeat(50);
    let nested = "xf -a 1000 -t 1 0 0\n".repeat(3) + &comment + "\n" + &"xf\n".repeat(3);
    for (text, message) in [
        (nested.as_str(), "come to more than 20000000 words; make arrays smaller"),
        ("xf -a 1000000 -a 1000000 -mx\nxf", "an array of 1000000000000 instances, where at most 1000000 are allowed"),
        (&"xf -a 2 -mx\n".repeat(100), "an array (xf … -a) without an end"),
        (&("xf -a 2 -mx\n".repeat(100) + &"xf\n".repeat(100)), "nested more than 64 deep; nest them less"),
    ] {
        let error = error(text);
        assert!(error.contains(message), "{error}");
    }
    let deep = "xf -mx\n".repeat(100_000) + "v o =\nsph o 1\n" + &"xf\n".repeat(100_000);
    assert_eq!(scene(&deep).surfaces.len(), 1, "transforms that are no arrays nest as deep as you like");
    let circle = |n: u32| {
        let corner = |k: u32| (f64::from(k) / f64::from(n) * std::f64::consts::TAU).sin_cos();
        let vertices: String = (0..n).map(|k| format!("v v{k} =\n p {} {} 0\n", corner(k).1, corner(k).0)).collect();
        vertices + &(0..n).map(|k| format!(" v{k}")).collect::<String>().replacen(' ', "xf -a 20 -mx\nf ", 1) + "\nxf\n"
    };
    assert!(error(&circle(4097)).contains("a polygon of 4097 corners, where at most 4096 are allowed"), "too large");
    assert!(error(&circle(4096)).contains("large polygons come to more than"), "large, and again and again");
}

/// A scene with every entity, to be mutilated.
const EVERYTHING: &str = "# everything\nc red =\n cxy .6 .3\nc lamp =\n cct 3000\nc mixed =\n cmix .5 red 1 lamp\n\
    c spec =\n cspec 400 700 .1 .5 .2\nm wall =\n c red\n rd .5\n rs .2 .1\n sides 1\nm light = wall\n c mixed\n ed 100\n\
    m glass =\n c spec\n td .3\n ts .4 0\n ir 1.5 0\nv a =\n p 0 0 0\n n 0 0 1\nv b =\n p 4 0 0\nv c =\n p 4 4 0\n\
    v d =\n p 0 4 0\nv e =\n p 1 1 0\nv g =\n p 2 2 0\nv h =\n p 2 1 0\no room\nm wall\nf a b c d\nfh a b c d - e g h\n\
    xf -t 1 2 3 -rx 30 -ry 40 -rz 50 -s 2 -mx -my -mz -i 2 -t 1 0 0\nsph a 1\ncyl a .5 b\ncone a 1 b -0\nxf\n\
    xf -a 3 -t 0 0 1 -a 2 -rz 10\nring a 0 1\ntorus a 1 2\nm light\nprism a b c d \\\n 2\nxf\no\ni part.mgf -t 1 1 1\n";

/// Reads bytes, with files that include each other, and checks what no text may violate.
fn check_any(bytes: &[u8]) -> Result<(), TestCaseError> {
    let include = |path: &Path| match path.file_name().and_then(|name| name.to_str()) {
        Some("part.mgf") => Ok(b"v q =\nsph q 1\ni other.mgf -a 2 -t 1 0 0\n".to_vec()),
        Some("other.mgf") => Ok(bytes.to_vec()),
        _ => Err(io::ErrorKind::NotFound.into()),
    };
    match read("t.mgf".as_ref(), bytes, &include) {
        Err(error) => {
            let text = error.to_string();
            prop_assert!(text.contains(".mgf:") && !text.contains('\n'), "a place, and one line: {text}");
        }
        Ok(scene) => {
            for surface in &scene.surfaces {
                prop_assert!((surface.material as usize) < scene.materials.len(), "{surface:?}");
                for n in surface.shading_normals.iter().flatten() {
                    prop_assert!((n.length() - 1.0).abs() < 1e-5, "{surface:?}");
                }
            }
            for material in &scene.materials {
                let (rd, ed) = (material.reflector.diffuse(), material.exitance);
                prop_assert!(rd.is_finite() && rd.min_element() >= 0.0 && rd.max_element() <= 1.0, "{material:?}");
                prop_assert!(ed.is_finite() && ed.min_element() >= 0.0, "{material:?}");
            }
        }
    }
    Ok(())
}

#[test]
fn everything_is_valid() {
    let s = read_with(EVERYTHING.as_bytes(), &[("dir/part.mgf", "sph a 9\n")]).expect("valid");
    assert_eq!(s.materials.len(), 2, "wall and light are used");
    let count = |name: fn(&Shape) -> bool| s.surfaces.iter().filter(|surface| name(&surface.shape)).count();
    assert_eq!(count(|s| matches!(s, Shape::Sphere { .. })), 2, "spheres");
    assert_eq!(count(|s| matches!(s, Shape::Cone { .. })), 2, "cylinder and cone");
    assert_eq!(count(|s| matches!(s, Shape::Ring { .. } | Shape::Torus { .. })), 12, "an array of rings and tori");
}

fn token() -> impl Strategy<Value = String> {
    let words = "# c cct cmix cone cspec cxy cyl ed f fh i ies ir m n o p prism rd ring rs sides sph td torus ts v xf \
        = - \\ -a -i -t -rx -ry -rz -s -mx -my -mz a b part.mgf other.mgf"
        .split_whitespace()
        .map(str::to_owned)
        .collect::<Vec<_>>();
    let numbers = ["0", "1", "-1", "2", "3", ".5", "1e300", "-1e308", "1e-300", "1e-320", "nan", "400", "700", "1e9"];
    prop_oneof![
        6 => prop::sample::select(words),
        6 => prop::sample::select(numbers.map(str::to_owned).to_vec()),
        2 => Just("\n".to_owned()),
        1 => any::<f64>().prop_map(|v| v.to_string()),
        1 => "\\PC{0,4}",
    ]
}

proptest! {
    #[test]
    fn random_bytes(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        check_any(&bytes)?;
    }

    #[test]
    fn token_soup(tokens in prop::collection::vec(token(), 0..120)) {
        check_any(tokens.join(" ").as_bytes())?;
    }

    #[test]
    fn soup_of_statements(picks in prop::collection::vec((0..usize::MAX, 0..8_u8, token()), 0..80)) {
        // Lines of a valid file in any order, one word in some of them replaced.
        let lines: Vec<_> = EVERYTHING.lines().collect();
        let text: String = picks.iter().map(|(pick, at, token)| {
            let mut words: Vec<_> = lines[pick % lines.len()].split(' ').collect();
            if let Some(word) = words.get_mut(usize::from(*at)) {
                *word = token;
            }
            words.join(" ") + "\n"
        }).collect();
        check_any(text.as_bytes())?;
    }

    #[test]
    fn mutilated_files(cuts in prop::collection::vec((0..EVERYTHING.len(), 0..6_usize, token()), 1..8)) {
        let mut bytes = EVERYTHING.as_bytes().to_vec();
        for (at, length, token) in cuts {
            let at = at.min(bytes.len());
            let end = (at + length).min(bytes.len());
            bytes.splice(at..end, token.bytes());
        }
        check_any(&bytes)?;
    }
}

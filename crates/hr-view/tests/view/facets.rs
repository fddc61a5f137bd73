//! The triangles that stand for a solution.

use glam::{DVec3, Vec3};
use hr_diffuse::{Settings, Shape, Surface};
use hr_scene::{Camera, Rgb, Scene, ToneMap};
use hr_view::Mode;
use hr_view::display::{DisplayMesh, Walkable};
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use hr_view::walkthrough::Walkthrough;
use hr_view::window::{Snapshot, WindowError};
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

fn solved(scene: Scene, error: f32) -> Arc<Solved> {
    let watch = &mut |_: &_| ControlFlow::Continue(());
    Arc::new(Solved::new(Arc::new(scene), Settings::with_error(error), true, watch).expect("a sound scene"))
}

fn built_in(name: &str, error: f32) -> Arc<Solved> {
    solved(Scene::load(name).expect("built in"), error)
}

/// The furnace's material on other shapes.
fn scene_of(surfaces: Vec<Surface>, two_sided: bool) -> Scene {
    let mut scene = Scene::load("furnace").expect("built in");
    scene.surfaces = surfaces;
    scene.materials[0].two_sided = two_sided;
    scene
}

/// Corners of all triangles.
fn triangles(mesh: &DisplayMesh) -> Vec<[u32; 3]> {
    mesh.batches
        .iter()
        .flat_map(|batch| mesh.indices[batch.indices.start as usize..batch.indices.end as usize].chunks_exact(3))
        .map(|t| [t[0], t[1], t[2]])
        .collect()
}

/// A place as it is in the mesh, bit by bit.
fn place(mesh: &DisplayMesh, vertex: u32) -> [u32; 3] {
    (mesh.positions[vertex as usize] + Vec3::ZERO).to_array().map(f32::to_bits)
}

#[test]
fn meshes_are_sound_and_face_outward() {
    for name in ["cornell", "three-lights", "furnace"] {
        let solved = built_in(name, 0.5);
        let walkthrough = Walkthrough::new(Arc::clone(&solved), Mode::Distributions);
        let mesh = walkthrough.mesh();
        assert_eq!(mesh.check(), Ok(()), "{name}");
        assert!(mesh.triangle_count() > 10, "{name} has {} triangles", mesh.triangle_count());
        let (mut right, mut folded) = (0.0, 0.0);
        for [a, b, c] in triangles(mesh) {
            let p = |v: u32| mesh.positions[v as usize];
            let normal = 0.5 * (p(b) - p(a)).cross(p(c) - p(a));
            let shaded = mesh.normals[a as usize] + mesh.normals[b as usize] + mesh.normals[c as usize];
            *(if normal.dot(shaded) >= 0.0 { &mut right } else { &mut folded }) += normal.length();
        }
        // Slivers at the poles of spheres, between an arc and its chord.
        assert!(folded < 1e-4 * right, "{name}: {right} m² face as they are shaded, {folded} m² do not");
        for array in [&mesh.irradiance, &mesh.tint, &mesh.emission] {
            assert!(array.iter().all(|v| v.is_finite() && v.min_element() >= 0.0), "{name}: light and colours");
        }
    }
}

/// A sphere's triangles close it: every edge belongs to two of them, once in each direction, and none is far from
/// round, on either side and however few leaves there are.
#[test]
fn curved_surfaces_are_round_and_closed() {
    let sphere = Shape::Sphere { center: DVec3::new(1e3, -5.0, 2.0), radius: 3.0 };
    let torus = Shape::Torus { center: DVec3::ZERO, axis: DVec3::Z, major: 2.0, minor: 0.7 };
    // One that absorbs everything is not refined: a single leaf, whose corners are one point.
    for (shape, euler, absorbs, flip) in [
        (&sphere, 2, false, false),
        (&sphere, 2, true, true),
        (&torus, 0, false, false),
        (&torus, 0, true, false),
        (&torus, 0, true, true),
    ] {
        let mut scene = scene_of(vec![Surface { flip, ..Surface::new(shape.clone(), 0) }], false);
        if absorbs {
            scene.materials[0].reflector = Arc::new(glossy_ext::Lambert::new(Rgb::ZERO).expect("black"));
        }
        let solved = solved(scene, 1.0);
        let walkthrough = Walkthrough::new(Arc::clone(&solved), Mode::Distributions);
        let mesh = walkthrough.mesh();
        assert_eq!(mesh.check(), Ok(()), "{shape:?}");
        let mut edges: HashMap<([u32; 3], [u32; 3]), u32> = HashMap::new();
        let (mut outside, mut inside) = (0, 0);
        for [a, b, c] in triangles(mesh) {
            if mesh.emission[a as usize] == Rgb::ZERO {
                inside += 1;
                assert_eq!(mesh.tint[a as usize], Rgb::ZERO, "the inside of {shape:?} is black");
                continue;
            }
            outside += 1;
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((place(mesh, from), place(mesh, to))).or_default() += 1;
                // 8° by the height of the arc, and half as much again for diagonals of the grid within a part, whose sides are as
                // long in both directions; along a saddle, which is straight, the normal turns without any.
                let cosine = mesh.normals[from as usize].dot(mesh.normals[to as usize]);
                let most: f32 = if euler == 2 { 0.22 } else { 0.45 };
                assert!(cosine > most.cos(), "{shape:?}: an edge spans {} rad", cosine.acos());
            }
        }
        // Only a flipped one shows its back; slivers that are folded over have none.
        let missing = outside - inside;
        assert!(
            if flip { (0..outside / 50).contains(&missing) } else { inside == 0 },
            "{shape:?}: {outside} outside, {inside} inside"
        );
        assert!(outside > 500, "{shape:?} is all there: {outside} triangles");
        let open = edges.iter().filter(|((a, b), count)| **count != 1 || edges.get(&(*b, *a)) != Some(&1)).count();
        assert_eq!(open, 0, "{shape:?}: {open} of {} edges are open", edges.len());
        let corners: std::collections::HashSet<_> = edges.keys().map(|(a, _)| *a).collect();
        let found = corners.len() as i64 - edges.len() as i64 / 2 + outside;
        assert_eq!(found, euler, "{shape:?}: vertices − edges + faces");
    }
}

#[test]
fn backs_that_absorb_are_black_and_opaque() {
    let quad = Shape::Quad([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
    for (two_sided, flip) in [(false, false), (false, true), (true, false)] {
        let surface = Surface { flip, ..Surface::new(quad.clone(), 0) };
        // It shines itself, and another one below lights its back: sides that no light reaches are black, too.
        let below = Shape::Quad([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y].map(|p| p - DVec3::Z));
        let solved = solved(scene_of(vec![surface, Surface::new(below, 0)], two_sided), 1.0);
        let walkthrough = Walkthrough::new(Arc::clone(&solved), Mode::Distributions);
        let mesh = walkthrough.mesh();
        assert_eq!(mesh.check(), Ok(()), "two-sided {two_sided}, flip {flip}");
        let (mut front, mut back) = (0.0, 0.0);
        for [a, b, c] in triangles(mesh) {
            let p = |v: u32| mesh.positions[v as usize];
            if f64::from(p(a).z) + mesh.origin.z < -0.5 {
                continue;
            }
            let area = 0.5 * (p(b) - p(a)).cross(p(c) - p(a)).z * if flip { -1.0 } else { 1.0 };
            if area > 0.0 {
                front += area;
                assert!(mesh.emission[a as usize].min_element() > 0.0, "fronts shine");
            } else {
                back -= area;
                assert_eq!(mesh.emission[a as usize], Rgb::ZERO, "backs never shine");
                assert_eq!(mesh.tint[a as usize] == Rgb::ZERO, !two_sided, "backs reflect if two-sided");
            }
        }
        assert!((front - 1.0).abs() < 1e-5 && (back - 1.0).abs() < 1e-5, "areas: front {front}, back {back}");
    }
}

/// Vertices toward an eye show what the ray caster shows there.
#[test]
fn glossy_vertices_agree_with_the_ray_caster() {
    let solved = built_in("three-lights", 0.5);
    let scene = &solved.scene;
    let walkthrough = Walkthrough::new(Arc::clone(&solved), Mode::Distributions);
    let mesh = walkthrough.mesh();
    assert!(!mesh.glossy.is_empty(), "the scene is glossy");
    let camera = scene.default_camera();
    let eye = DVec3::from(camera.eye);
    let slots: Vec<u32> = (0..mesh.glossy.len() as u32).collect();
    let mut found = vec![Rgb::ZERO; slots.len()];
    walkthrough.glossy_radiance(eye, &slots, &mut found);
    assert!(found.iter().all(|v| v.is_finite() && v.min_element() >= 0.0), "finite and not negative");
    let caster = RayCaster::new(scene, &solved.solution, Mode::Distributions).with_grid(1);
    let (mut compared, mut close) = (0, 0);
    for (&vertex, glossy) in mesh.glossy.iter().zip(&found) {
        let v = vertex as usize;
        let at = mesh.origin + mesh.positions[v].as_dvec3();
        if (eye - at).dot(mesh.normals[v].as_dvec3()) <= 0.1 * (eye - at).length() {
            continue;
        }
        let hidden = {
            let data = &solved.solution.scene;
            let (from, to) = (data.normalization.to_unit(eye), data.normalization.to_unit(at));
            let hit = data.visibility.closest(from, to - from, 1e-6, f32::MAX);
            hit.is_none_or(|hit| hit.point.distance(to) > 1e-5 || hit.normal.dot(mesh.normals[v]) < 0.9)
        };
        if hidden {
            continue;
        }
        // One pixel, so narrow that jittering within it does not matter.
        let up = mesh.normals[v].any_orthonormal_vector().as_dvec3();
        let up = if up.cross(at - eye).length() > 0.1 * (at - eye).length() { up } else { mesh.normals[v].as_dvec3() };
        let pixel = Camera { target: at.into(), up: up.into(), fov_x: 1e-4, width: 1, height: 1, ..camera };
        let seen = caster.render(&pixel, &|_| ()).pixels[0];
        let shown = mesh.irradiance[v] * mesh.tint[v] + mesh.emission[v] + *glossy;
        compared += 1;
        close += u32::from((seen - shown).abs().max_element() <= 0.02 * shown.max_element() + 1e-4);
    }
    // On an edge the ray may meet the neighbouring surface.
    assert!(compared > 20 && close * 10 >= compared * 9, "{close} of {compared} vertices agree");
}

/// A leaf of a curved surface has one distribution, but each place on it reflects what is mirrored there: the picture
/// comes near that of the samples, which are reflected with the normal of every pixel.
#[test]
fn curved_leaves_reflect_with_the_normals_of_their_places() {
    let solved = built_in("glossy-sphere", 0.3);
    let camera = Camera { width: 80, height: 60, ..solved.scene.default_camera() };
    let [a, b] = [Mode::Distributions, Mode::Samples]
        .map(|mode| RayCaster::new(&solved.scene, &solved.solution, mode).render(&camera, &|_| ()).pixels);
    let difference: f32 = a.iter().zip(&b).map(|(a, b)| (*a - *b).abs().element_sum()).sum();
    let share = difference / b.iter().map(|b| b.element_sum()).sum::<f32>();
    // 43 % with the normals of the leaves.
    assert!(share < 0.25, "the modes differ by {share} of the light");
}

#[test]
fn the_device_draws_what_the_ray_caster_sees() {
    let solved = built_in("cornell", 0.3);
    let walkthrough = Walkthrough::new(Arc::clone(&solved), Mode::Distributions);
    let scene = &solved.scene;
    let camera = Camera { width: 120, height: 120, ..scene.default_camera() };
    let film = RayCaster::new(scene, &solved.solution, Mode::Distributions).film(&camera, &|_| ());
    let tone_map = ToneMap::default();
    let mut tone = hr_view::window::Tone::for_mesh(walkthrough.mesh());
    tone.exposure = tone_map.factor(&film.image.pixels, scene.primaries);
    let picture = match Snapshot::of(&walkthrough, &camera, Some(&tone)) {
        Ok(picture) => picture,
        Err(WindowError::NoAdapter(reason)) => {
            eprintln!("skipped, no graphics device: {reason}");
            return;
        }
        Err(error) => panic!("{error}"),
    };
    let expected = film.to_srgb8(&tone_map, scene.primaries);
    let mut far = 0;
    for (expected, found) in expected.chunks_exact(3).zip(picture.rgba.chunks_exact(4)) {
        far += u32::from((0..3).any(|c| expected[c].abs_diff(found[c]) > 12));
    }
    // Edges are sampled differently; 120 pixels have some 1500 on edges.
    let pixels = picture.width * picture.height;
    assert!(far * 100 < pixels * 5, "{far} of {pixels} pixels differ");
}

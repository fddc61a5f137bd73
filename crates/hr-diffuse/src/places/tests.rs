use super::{Places, each_leaf};
use crate::skips::Skips;
use crate::skips::tests::solve;
use crate::{DiffuseMaterial, Rgb, SceneInput, Shape, Solver, Surface};
use glam::{DVec3, Vec3};

const ERROR: f32 = 0.1;
/// Parts of a side of the floor.
const PARTS: u32 = 40;

/// A floor cut into small parts below a lamp, with a sheet in between where asked for, which hides all of the lamp from some.
fn floor(sheet: bool) -> SceneInput {
    let (x, y) = (DVec3::X, DVec3::Y);
    let quad = |corner: DVec3, a: DVec3, b: DVec3| Shape::Quad([corner, corner + a, corner + a + b, corner + b]);
    let part = f64::from(PARTS).recip();
    let cell = |i: u32| DVec3::new(f64::from(i % PARTS), f64::from(i / PARTS), 0.0) * part;
    let floor = (0..PARTS * PARTS).map(|i| Surface::new(quad(cell(i), x * part, y * part), 0));
    let lamp = Surface::new(quad(DVec3::new(0.4, 0.3, 0.5), y * 0.2, x * 0.2), 1);
    let sheets = sheet.then(|| Surface::new(quad(DVec3::new(0.0, 0.0, 0.25), y, x * 0.45), 2));
    let material = |reflectance: f32, exitance: f32| DiffuseMaterial {
        reflectance: Rgb::splat(reflectance),
        exitance: Rgb::splat(exitance),
        two_sided: false,
    };
    let surfaces = floor.chain([lamp]).chain(sheets).collect();
    SceneInput {
        surfaces,
        materials: vec![material(0.5, 0.0), material(0.0, 1.0), material(0.0, 0.0)],
        ..SceneInput::default()
    }
}

fn solved(sheet: bool) -> (Solver, Places) {
    let solver = solve(&floor(sheet), ERROR, (), Skips::ALL);
    let places = solver.gather.places().clone();
    (solver, places)
}

/// Leaves of the floor with their irradiance, and that of all of the lamp at their middles.
fn leaves(solver: &Solver) -> Vec<(u32, f32, f32)> {
    let light = solver.light();
    let lamp = solver.elements.surface_nodes[(PARTS * PARTS) as usize][0];
    let leaf = |leaf: u32| {
        let open = light.factor_at(light.element(leaf).center, Vec3::Z, lamp);
        (leaf, solver.exitant.irradiance[leaf as usize].x, open)
    };
    solver.elements.patch_leaves().filter(|&leaf| light.element(leaf).importance > 0.0).map(leaf).collect()
}

#[test]
fn all_leaves_are_below_one_place_and_no_link_is() {
    let (solver, places) = solved(true);
    let mut found = Vec::new();
    let mut inside = vec![false; solver.elements.nodes.len()];
    for &place in &places.nodes {
        each_leaf(&solver.elements, place, |leaf| found.push(leaf));
        let mut waiting = vec![place];
        while let Some(node) = waiting.pop() {
            let element = &solver.elements.nodes[node as usize];
            inside[node as usize] = node != place;
            waiting.extend(element.first_child..element.first_child + element.child_count);
        }
    }
    found.sort_unstable();
    assert_eq!(found, solver.elements.patch_leaves().collect::<Vec<_>>(), "each once");
    assert!(3 * places.nodes.len() < found.len(), "{} places of {} leaves", places.nodes.len(), found.len());
    let below = |link: &&crate::links::Link| inside[link.receiver as usize] || inside[link.sender as usize];
    assert_eq!(solver.links.all().iter().find(below), None, "below a place");
}

/// Irradiance varies over a place as it does: against the closed form of the lamp's form factor.
#[test]
fn light_varies_over_places() {
    let (solver, places) = solved(false);
    let leaves = leaves(&solver);
    let total: f32 = leaves.iter().map(|(.., open)| open).sum();
    let off: f32 = leaves.iter().map(|(_, found, open)| (found - open).abs()).sum();
    assert!(off < 0.2 * ERROR * total, "off by {:.4}", off / total);
    let open = |leaf: u32| leaves.iter().find(|(other, ..)| *other == leaf).map_or(0.0, |(.., open)| *open);
    let mut varies = 0.0;
    for &place in &places.nodes {
        let mut all = Vec::new();
        each_leaf(&solver.elements, place, |leaf| all.push(open(leaf)));
        let mean = all.iter().sum::<f32>() / all.len() as f32;
        varies += all.iter().map(|open| (open - mean).abs()).sum::<f32>();
    }
    assert!(varies > 3.0 * off, "means alone would be off by {:.4}, this is by {:.4}", varies / total, off / total);
}

/// The sheet hides all of the lamp left of x = 0.3 (from its far edge at 0.6 through the sheet's at 0.45) and nothing right of 0.5.
#[test]
fn places_end_at_edges_of_shadows() {
    let (solver, _) = solved(true);
    let (mut dark, mut lit, mut open) = (0.0, 0.0, 0.0);
    for (leaf, found, whole) in leaves(&solver) {
        let x = solver.scene.normalization.to_scene(solver.elements.nodes[leaf as usize].center).x;
        if x < 0.3 {
            dark += found;
        } else if x > 0.5 {
            lit += found;
            open += whole;
        }
    }
    assert!(dark < 0.3 * ERROR * open, "{dark} in the dark, {open} in the light");
    assert!((lit / open - 1.0).abs() < 0.2 * ERROR, "{lit} of {open} arrives");
}

/// Round meshes are cut more finely than their light asks for: places bend with them. Against the closed form, on the side of a ball that sees
/// all of the lamp.
#[test]
fn places_bend_with_round_meshes() {
    const RINGS: u32 = 60;
    let angle = |i: u32| f64::from(i) * std::f64::consts::PI / f64::from(RINGS);
    let at = |i: u32, j: u32| {
        let ((sin, cos), (up, along)) = (angle(2 * i).sin_cos(), angle(j).sin_cos());
        DVec3::new(0.5, 0.5, -0.2) + 0.3 * DVec3::new(cos * up, sin * up, -along)
    };
    let ball = (0..RINGS * RINGS).flat_map(|cell| {
        let (i, j) = (cell / RINGS, cell % RINGS);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        let upper = (j > 0).then(|| Surface::new(Shape::Triangle([a, b, c]), 0));
        upper.into_iter().chain((j + 1 < RINGS).then(|| Surface::new(Shape::Triangle([a, c, d]), 0)))
    });
    let plain = floor(false);
    let lamp = plain.surfaces[(PARTS * PARTS) as usize].clone();
    let input = SceneInput { surfaces: [lamp].into_iter().chain(ball).collect(), ..plain };
    fn looked<L: crate::LightField>(solver: &Solver<L>) -> [f32; 2] {
        let (light, lamp) = (solver.light(), solver.elements.surface_nodes[0][0]);
        let (mut off, mut all) = (0.0, 0.0);
        for leaf in solver.elements.patch_leaves().filter(|&leaf| light.element(leaf).normals.axis.z > 0.5) {
            let element = light.element(leaf);
            let open = light.factor_at(element.center, element.normals.axis, lamp);
            off += element.area * (solver.exitant.irradiance[leaf as usize].x - open).abs();
            all += element.area * open;
        }
        let places = solver.gather.places().nodes.len() as f32 / solver.elements.patch_leaves().count() as f32;
        [places, off / all]
    }
    let [places, off] = looked(&solve(&input, ERROR, (), Skips::ALL));
    assert!(places < 0.65 && off < 0.3 * ERROR, "{places} places for each leaf, off by {off}");
    let glossy = crate::skips::tests::Echo { material: 0, albedo: 0.4, errs: false };
    let [places, off] = looked(&solve(&input, ERROR, glossy, Skips::ALL));
    assert!(places < 0.4 && off < 0.3 * ERROR, "{places} places for each glossy leaf, off by {off}");
}

#[test]
#[cfg(feature = "parallel")]
fn threads_change_nothing() {
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads");
        pool.install(|| solved(true).0.exitant.irradiance)
    };
    let one = of(1);
    assert!([2, 7].iter().all(|&threads| of(threads) == one), "bit by bit");
}

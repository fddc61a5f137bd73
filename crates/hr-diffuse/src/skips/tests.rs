use super::Skips;
use crate::effort::Aim;
use crate::hooks::{Arrived, Hierarchy, LightField, NodeId, Transfer};
use crate::links::{Link, Links};
use crate::refine::Pair;
use crate::reflect::Reflect;
use crate::sampling::{hash, unit};
use crate::{Cone, DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
use glam::{DVec3, Vec3};
use std::f32::consts::FRAC_1_PI;
use std::ops::ControlFlow;

const GREY: u32 = 0;
const LAMP: u32 = 1;
const BLACK: u32 = 2;
/// Reflects on its front alone.
const SOLID: u32 = 3;

/// A room with a lamp, a box, a ball and a post; a black sheet hangs in it. Nothing but the walls has two sides.
pub(crate) fn room() -> SceneInput {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let quad = |corner: DVec3, a: DVec3, b: DVec3| Shape::Quad([corner, corner + a, corner + a + b, corner + b]);
    let mut shapes = vec![
        (quad(DVec3::ZERO, x, y), GREY),
        (quad(z, y, x), GREY),
        (quad(DVec3::ZERO, y, z), GREY),
        (quad(x, z, y), GREY),
        (quad(DVec3::ZERO, z, x), GREY),
        (quad(y, x, z), GREY),
        (quad(DVec3::new(0.4, 0.4, 0.9), y * 0.2, x * 0.2), LAMP),
        (quad(DVec3::new(0.1, 0.7, 0.3), x * 0.3, y * 0.2), BLACK),
    ];
    // Its sides and lid; each sees the others' backs alone.
    let (at, a, b, up) = (DVec3::new(0.2, 0.1, 0.0), x * 0.3, y * 0.25, z * 0.5);
    let sides = [quad(at, a, up), quad(at + a, b, up), quad(at + a + b, -a, up), quad(at + b, -b, up)];
    shapes.extend(sides.into_iter().map(|side| (side, SOLID)));
    shapes.push((quad(at + up, a, b), SOLID));
    shapes.push((Shape::Sphere { center: DVec3::new(0.75, 0.6, 0.2), radius: 0.15 }, SOLID));
    let ends = [DVec3::new(0.8, 0.2, 0.0), DVec3::new(0.8, 0.2, 0.6)];
    shapes.push((Shape::Cone { ends, radii: [0.08; 2] }, SOLID));
    let surfaces = shapes.into_iter().map(|(shape, material)| Surface::new(shape, material)).collect();
    let material = |reflectance, exitance, two_sided| DiffuseMaterial {
        reflectance: Rgb::splat(reflectance),
        exitance: Rgb::splat(exitance),
        two_sided,
    };
    let materials =
        vec![material(0.6, 0.0, true), material(0.0, 10.0, false), material(0.0, 0.0, true), material(0.5, 0.0, false)];
    SceneInput { surfaces, materials, ..SceneInput::default() }
}

pub(crate) fn solve<L: LightField>(input: &SceneInput, error: f32, field: L, skips: Skips) -> Solver<L> {
    let mut solver = Solver::skipping(input, Settings::with_error(error), field, skips).expect("the room is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver
}

/// Mean radiosity of each surface's front and back, W/m².
fn radiosities<L: LightField>(solver: &Solver<L>) -> Vec<f32> {
    let of = |&node: &u32| solver.exitant.radiosity.get(node as usize).map_or(0.0, |b| b.element_sum() / 3.0);
    solver.elements.surface_nodes.iter().flatten().map(of).collect()
}

/// All nodes send the same light: to the last bit, or to within a share `rounding` of it.
fn assert_same<L: LightField>(a: &Solver<L>, b: &Solver<L>, rounding: f32) {
    assert_eq!(a.elements.nodes.len(), b.elements.nodes.len(), "nodes");
    for (node, element) in a.elements.nodes.iter().enumerate() {
        let [with, without] = [a, b].map(|solver| solver.exitant.radiosity[node]);
        let apart = (with - without).abs().max_element();
        assert!(apart <= rounding * with.max_element(), "{with} and {without} from {element:?}");
    }
}

/// The largest difference between the surfaces of two solutions, in units of the mean radiosity.
fn difference(before: &[f32], after: &[f32], mean: Rgb) -> f32 {
    let difference = std::iter::zip(before, after).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    difference / (mean.element_sum() / 3.0)
}

#[test]
fn black_receivers_change_nothing() {
    let with = solve(&room(), 0.1, (), Skips::ALL);
    let without = solve(&room(), 0.1, (), Skips { black_receivers: false, ..Skips::ALL });
    assert!(with.stats.skipped.black_receivers > 10, "{:?}", with.stats.skipped);
    assert_eq!(without.stats.skipped.black_receivers, 0, "none is skipped");
    assert!(without.links.all().len() > with.links.all().len(), "they have links");
    assert_same(&with, &without, 0.0);
}

/// Senders that are dark at first are looked at again; what is left out at the end would bring nothing if all of it were
/// seen from everywhere.
#[test]
fn senders_that_stay_dark_change_nothing() {
    let [mut with, mut without] = [(); 2].map(|()| solve(&room(), 0.1, (), Skips::ALL));
    assert!(with.stats.skipped.unlit_senders > 100 && !with.unfinished.unlit.is_empty(), "{:?}", with.stats.skipped);
    let link = |pair: &Pair| Link { receiver: pair.receiver, sender: pair.sender, factor: 1.0, visibility: 1.0 };
    let links = without.links.all().iter().copied().chain(without.unfinished.unlit.iter().map(link)).collect();
    without.links = Links::new(links, without.elements.nodes.len());
    for solver in [&mut with, &mut without] {
        solver.prepare(Some(Aim::of(solver.settings.tolerance())), &mut || ControlFlow::Continue(()));
        assert!(solver.iterate(Reflect::Reshaped, &mut || ControlFlow::Continue(())).is_some(), "nobody stops it");
    }
    assert_same(&with, &without, 0.0);
}

#[test]
fn pairs_that_do_not_face_each_other_change_nothing() {
    let proved = Skips { averted: false, ..Skips::ALL };
    let with = solve(&room(), 0.03, (), proved);
    let without = solve(&room(), 0.03, (), Skips { facing: false, ..proved });
    assert!(with.stats.skipped.facing > 100, "{:?}", with.stats.skipped);
    assert!(without.links.all().len() > with.links.all().len(), "they have links");
    // A place that is compared with what it sees knows senders by their links, those through which nothing comes, too.
    assert_same(&with, &without, 1e-3);
}

/// What samples say is no proof; but only what is too little to count is left out because of it.
#[test]
fn pairs_that_hardly_face_each_other_change_little() {
    // At 0.025 that with fewer pairs has three links more of ten thousand: other verdicts fall.
    const ERROR: f32 = 0.02;
    let with = solve(&room(), ERROR, (), Skips::ALL);
    let without = solve(&room(), ERROR, (), Skips { averted: false, ..Skips::ALL });
    // Pairs through whose links nothing comes are decided upon in each pass: counts of verdicts tell passes, too.
    let [fewer, all] = [&with, &without].map(|solver| solver.stats.links);
    assert!(fewer < all, "{fewer} of {all} links are left, as the others' ends cannot face each other");
    let apart = difference(&radiosities(&with), &radiosities(&without), with.exitant.radiosity[0]);
    assert!(apart < 0.2 * ERROR, "{apart} of the mean radiosity");
}

/// Downlights in black cans above a pieced ceiling. A lid gets light from its can's inside, though beside all else that is near it it is so small
/// that no pair of random points finds that the two face each other.
#[test]
fn lids_of_cans_are_lit_by_their_insides() {
    const CAN: u32 = 2;
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let quad = |corner: DVec3, a: DVec3, b: DVec3| Shape::Quad([corner, corner + a, corner + a + b, corner + b]);
    let (size, ceiling) = (DVec3::new(6.0, 5.0, 3.0), 3.0 * z);
    let mut shapes = vec![
        (quad(DVec3::ZERO, x * size.x, y * size.y), GREY),
        (quad(DVec3::ZERO, y * size.y, z * size.z), GREY),
        (quad(x * size.x, z * size.z, y * size.y), GREY),
        (quad(DVec3::ZERO, z * size.z, x * size.x), GREY),
        (quad(y * size.y, x * size.x, z * size.z), GREY),
    ];
    let ends = ([0.0, 0.9, 1.1, 2.9, 3.1, 4.9, 5.1, 6.0], [0.0, 1.15, 1.35, 3.65, 3.85, 5.0]);
    let pieces =
        |ends: &[f64]| ends.windows(2).map(|ends| (ends[0], ends[1] - ends[0])).enumerate().collect::<Vec<_>>();
    let mut lids = Vec::new();
    for (i, (left, width)) in pieces(&ends.0) {
        for (j, (front, depth)) in pieces(&ends.1) {
            let corner = x * left + y * front + ceiling;
            if i % 2 == 0 || j % 2 == 0 {
                shapes.push((quad(corner, y * depth, x * width), GREY));
                continue;
            }
            let at = corner + 0.5 * (x * width + y * depth);
            shapes.push((Shape::Cone { ends: [at, at + 0.2 * z], radii: [0.1; 2] }, CAN));
            lids.push(shapes.len());
            shapes.push((Shape::Ring { center: at + 0.2 * z, normal: -z, inner: 0.0, outer: 0.1 }, CAN));
            shapes.push((Shape::Sphere { center: at + 0.14 * z, radius: 0.04 }, LAMP));
        }
    }
    let surfaces = shapes.into_iter().map(|(shape, material)| Surface::new(shape, material)).collect();
    let material = |reflectance, exitance| DiffuseMaterial {
        reflectance: Rgb::splat(reflectance),
        exitance: Rgb::splat(exitance),
        two_sided: true,
    };
    let materials = vec![material(0.6, 0.0), material(0.0, 1000.0), material(0.05, 0.0)];
    let input = SceneInput { surfaces, materials, ..SceneInput::default() };
    let solvers = [Skips::ALL, Skips { averted: false, ..Skips::ALL }].map(|skips| solve(&input, 0.1, (), skips));
    for lid in lids {
        let [found, all] = solvers.each_ref().map(|solver| {
            let node = solver.elements.surface_nodes[lid][0];
            solver.exitant.irradiance[node as usize].x
        });
        assert!((found / all - 1.0).abs() < 0.05, "{lid}: {found}, not {all}");
    }
}

/// What is proved free is what all segments find, and what is proved blocked brings nothing: but for segments that touch
/// edges where surfaces meet, and pairs of which no drawn points face each other.
#[test]
fn proofs_change_next_to_nothing() {
    const ERROR: f32 = 0.05;
    let with = solve(&room(), ERROR, (), Skips::ALL);
    let without = solve(&room(), ERROR, (), Skips { proofs: false, ..Skips::ALL });
    let skipped = with.stats.skipped;
    assert!(skipped.proved_free > 1000 && skipped.proved_blocked > 10, "{skipped:?}");
    let none = without.stats.skipped;
    assert_eq!((none.proved_free, none.proved_blocked), (0, 0), "none is proved");
    assert!(3 * with.stats.rays < 2 * without.stats.rays, "{} of {} rays", with.stats.rays, without.stats.rays);
    let apart = difference(&radiosities(&with), &radiosities(&without), with.exitant.radiosity[0]);
    // Where some links need no rays, those of the others start from other points of the leaves.
    assert!(apart < 0.1 * ERROR, "{apart} of the mean radiosity");
}

/// Links that bring next to nothing need no look from every leaf.
#[test]
fn faint_links_change_little() {
    const ERROR: f32 = 0.1;
    let with = solve(&room(), ERROR, (), Skips::ALL);
    let without = solve(&room(), ERROR, (), Skips { faint_links: false, ..Skips::ALL });
    let [some, none] = [&with, &without].map(|solver| solver.stats.skipped.faint_links);
    // Few are faint to each leaf below their receiver.
    assert!(some > 30 && none < some / 2, "{some}, then {none}: only what brings nothing at all");
    let apart = difference(&radiosities(&with), &radiosities(&without), with.exitant.radiosity[0]);
    assert!(apart < 0.5 * ERROR, "{apart} of the mean radiosity");
}

#[test]
fn sealed_sides_stay_dark_without_being_left_out() {
    let with = solve(&room(), 0.03, (), Skips::ALL);
    let without = solve(&room(), 0.03, (), Skips { sealed_sides: false, ..Skips::ALL });
    assert_eq!(with.stats.skipped.sealed_sides, 6, "the outside of the room");
    assert_eq!(without.stats.skipped.sealed_sides, 0, "none is skipped");
    for (side, radiosity) in radiosities(&without).into_iter().enumerate() {
        let left_out = with.elements.surface_nodes.as_flattened()[side] == u32::MAX;
        assert!(!left_out || radiosity == 0.0, "side {side} is left out, and would send {radiosity}");
    }
    let apart = difference(&radiosities(&with), &radiosities(&without), with.exitant.radiosity[0]);
    assert!(apart < 0.05, "{apart} of the mean radiosity");
}

#[test]
fn iterations_that_are_left_out_would_change_nothing() {
    const ERROR: f32 = 0.1;
    let mut solver = solve(&room(), ERROR, (), Skips::ALL);
    let before = radiosities(&solver);
    for _ in 0..50 {
        let _ = solver.iterate(Reflect::Reshaped, &mut || ControlFlow::Continue(()));
    }
    let change = difference(&before, &radiosities(&solver), solver.exitant.radiosity[0]);
    assert!(change < 0.1 * ERROR, "{change} of the mean radiosity");
}

/// Diffuse reflection of one material by an extension: radiance is the same in all directions.
pub(crate) struct Echo {
    pub(crate) material: u32,
    pub(crate) albedo: f32,
    /// Whether it takes all liberty that it has: each leaf errs by as much as is negligible, up to all of its light.
    pub(crate) errs: bool,
}

impl LightField for Echo {
    type Incident = ();
    type Exitant = Rgb;

    fn active(&self, material: u32) -> Option<Rgb> {
        (material == self.material).then_some(Rgb::splat(self.albedo))
    }
    fn clear(&self, (): &mut ()) {}
    fn receive(&self, (): &mut (), _: &Transfer) {}
    fn reflect<H: Hierarchy>(&self, _: &H, leaf: NodeId, _: &[&()], arrived: Arrived) -> Rgb {
        let light = arrived.irradiance * (self.albedo * FRAC_1_PI);
        let error = light.min(Rgb::splat(arrived.negligible));
        match (self.errs, unit(hash(leaf.0, 1)) < 0.5) {
            (false, _) => light,
            (true, false) => light - error,
            (true, true) => light + error,
        }
    }
    fn radiance(&self, exitant: &Rgb, _: Vec3) -> Rgb {
        *exitant
    }
    fn radiance_bounds(&self, exitant: &Rgb, _: &Cone) -> (Rgb, Rgb) {
        (*exitant, *exitant)
    }
}

#[test]
fn leaves_whose_light_has_settled_change_little() {
    const ERROR: f32 = 0.05;
    let mut input = room();
    input.materials[GREY as usize].reflectance = Rgb::splat(0.3);
    let field = || Echo { material: GREY, albedo: 0.3, errs: false };
    let with = solve(&input, ERROR, field(), Skips::ALL);
    let without = solve(&input, ERROR, field(), Skips { converged_leaves: false, ..Skips::ALL });
    assert!(with.stats.skipped.converged_leaves > 1000, "{:?}", with.stats.skipped);
    assert_eq!(without.stats.skipped.converged_leaves, 0, "none is skipped");
    let apart = difference(&radiosities(&with), &radiosities(&without), with.exitant.radiosity[0]);
    assert!(apart < ERROR, "{apart} of the mean radiosity");
}

#[test]
fn senders_that_send_the_same_change_nothing() {
    let mut input = room();
    input.materials[GREY as usize].reflectance = Rgb::splat(0.3);
    let field = || Echo { material: GREY, albedo: 0.3, errs: false };
    let with = solve(&input, 0.1, field(), Skips::ALL);
    let without = solve(&input, 0.1, field(), Skips { steady_senders: false, ..Skips::ALL });
    assert!(with.stats.skipped.steady_senders > 1000, "{:?}", with.stats.skipped);
    assert_eq!(without.stats.skipped.steady_senders, 0, "none is skipped");
    // What is known in proportion is rounded otherwise.
    assert_same(&with, &without, 1e-4);
}

/// The room with its floor in many pieces, which reflect like the other walls.
fn cut_room() -> SceneInput {
    const PARTS: u32 = 48;
    let mut input = room();
    input.materials[GREY as usize].reflectance = Rgb::splat(0.3);
    let part = f64::from(PARTS).recip();
    let piece = |i: u32| DVec3::new(f64::from(i % PARTS), f64::from(i / PARTS), 0.0) * part;
    let pieces = (0..PARTS * PARTS).map(|i| {
        let (a, x, y) = (piece(i), DVec3::X * part, DVec3::Y * part);
        Surface::new(Shape::Quad([a, a + x, a + x + y, a + y]), GREY)
    });
    input.surfaces.splice(0..1, pieces);
    input
}

/// What one leaf of a face cluster reflects stands for all of it, and for the light that goes on from there.
#[test]
fn leaves_of_face_clusters_change_little() {
    const ERROR: f32 = 0.1;
    let field = || Echo { material: GREY, albedo: 0.3, errs: false };
    let with = solve(&cut_room(), ERROR, field(), Skips::ALL);
    let without = solve(&cut_room(), ERROR, field(), Skips { face_clusters: false, ..Skips::ALL });
    let [some, none] = [&with, &without].map(|solver| solver.face_clusters().joined(&solver.elements));
    assert!(some > 1000 && none == 0, "{some} of {} leaves, then {none}", with.stats.leaves);
    let [with_them, all] = [&with, &without].map(|solver| {
        let stand = |leaf: &u32| solver.sent[*leaf as usize].is_known();
        solver.elements.patch_leaves().filter(stand).count()
    });
    assert!(3 * with_them < 2 * all, "{with_them} of {all} leaves are reflected");
    let apart = difference(&radiosities(&with), &radiosities(&without), with.exitant.radiosity[0]);
    assert!(apart < 0.5 * ERROR, "{apart} of the mean radiosity");
}

/// What leaves are told to be negligible makes no difference to the light in the room, though each errs by all of it.
#[test]
fn negligible_detail_changes_little() {
    const ERROR: f32 = 0.1;
    let mut input = room();
    input.materials[GREY as usize].reflectance = Rgb::splat(0.3);
    let field = |errs| Echo { material: GREY, albedo: 0.3, errs };
    let with = solve(&input, ERROR, field(true), Skips::ALL);
    let without = solve(&input, ERROR, field(true), Skips { negligible_detail: false, ..Skips::ALL });
    let exact = solve(&input, ERROR, field(false), Skips { negligible_detail: false, ..Skips::ALL });
    assert_same(&without, &exact, 0.0);
    // Of the leaves that stand for others, what is negligible beside their light.
    let shares: Vec<f32> = (0..with.sent.len())
        .filter(|&leaf| with.brightest[leaf] > 0.0)
        .map(|leaf| with.sent[leaf].negligible() / with.brightest[leaf])
        .collect();
    let much = shares.iter().filter(|&&share| share > 0.1).count();
    assert!(3 * much > shares.len(), "a tenth of their light is negligible in {much} of {} leaves", shares.len());
    let apart = difference(&radiosities(&with), &radiosities(&without), with.exitant.radiosity[0]);
    assert!(apart > 0.0 && apart < 0.5 * ERROR, "{apart} of the mean radiosity");
}

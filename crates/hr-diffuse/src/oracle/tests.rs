use super::*;
use crate::form_factor::{Accuracy, Part, point_factor};
use crate::geometry::tests::surface;
use crate::hierarchy::Elements;
use crate::sampling::{hash, unit};
use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
use glam::DVec3;
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use std::collections::BTreeMap;

/// Numbers in 0…1, the same ones in every run.
struct Numbers(u32);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 += 1;
        unit(hash(self.0, 0x2545))
    }

    fn below(&mut self, count: u32) -> u32 {
        ((self.next() * count as f32) as u32).min(count - 1)
    }
}

/// A node below `node`, by random steps down, splitting what has no parts yet.
fn below(scene: &SceneData, elements: &mut Elements, mut node: u32, steps: u32, numbers: &mut Numbers) -> u32 {
    for _ in 0..steps {
        elements.split(scene, node);
        let element = &elements.nodes[node as usize];
        if element.child_count == 0 {
            break;
        }
        node = element.first_child + numbers.below(element.child_count);
    }
    node
}

fn patches(elements: &Elements, node: u32) -> Vec<u32> {
    let element = &elements.nodes[node as usize];
    if element.is_patch() {
        return vec![node];
    }
    (element.first_child..element.first_child + element.child_count).flat_map(|c| patches(elements, c)).collect()
}

fn name(element: &Element) -> &'static str {
    match element.kind {
        Kind::Cluster => "cluster",
        Kind::Light => "light",
        _ if element.whole_sphere => "sphere",
        _ if element.is_flat() => "flat",
        _ => "curved",
    }
}

/// Bounds of random pairs of every kind, against the factor at random points of the receiver. Prints how tight they are
/// (with `--nocapture`).
#[test]
fn bounds_hold_what_they_bound() {
    let mut runner = TestRunner::deterministic();
    let mut numbers = Numbers(0);
    let mut tightness: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    let mut violations = Vec::new();
    for _ in 0..3000 {
        let count = 2 + numbers.below(3);
        let surfaces = (0..count).map(|_| surface().new_tree(&mut runner).expect("sound surfaces").current()).collect();
        let material = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ONE, two_sided: true };
        let input = SceneInput { surfaces, materials: vec![material], ..SceneInput::default() };
        let Ok(mut solver) = Solver::new(&input, Settings::default(), ()) else { continue };
        let (scene, elements) = (&solver.scene, &mut solver.elements);
        for _ in 0..6 {
            let mut pick = |elements: &mut Elements| {
                let steps = 1 + numbers.below(7);
                below(scene, elements, 0, steps, &mut numbers)
            };
            let (receiver, sender) = (pick(elements), pick(elements));
            let (r, s) = (elements.nodes[receiver as usize], elements.nodes[sender as usize]);
            if receiver == sender {
                continue;
            }
            let bounds = factor_bounds(scene, &r, &s);
            let points = patches(elements, receiver);
            for _ in 0..4 {
                let part = elements.nodes[points[numbers.below(points.len() as u32) as usize] as usize];
                let geometry = &scene.surfaces()[part.source as usize];
                let (x, front) = geometry.sample(part.domain, numbers.next(), numbers.next());
                // Where nothing is to pass, nothing arrives at the surface itself; else a bent receiver is the plane that
                // faces the sender.
                let n = match bounds {
                    None if part.kind == Kind::Back => -front,
                    None => front,
                    Some(_) if r.is_flat() => r.normals.axis,
                    Some(_) => (s.center - x).normalize_or(Vec3::Z),
                };
                let factors = patches(elements, sender).into_iter().map(|node| {
                    let e = &elements.nodes[node as usize];
                    let geometry = &scene.surfaces()[e.source as usize];
                    let part = Part { geometry, domain: e.domain, back: e.kind == Kind::Back };
                    let accuracy = Accuracy { relative: 1e-3, absolute: 1e-9, most: 800 };
                    point_factor(part, x.as_dvec3(), n.as_dvec3(), accuracy)
                });
                // Of a cluster parts may hide others: what is seen is at least no less than any one of them alone.
                let factor = factors.fold(0.0, f64::max);
                let (min, max) = bounds.map_or((0.0, 0.0), |b| (f64::from(b.min), f64::from(b.max)));
                // Rounding of positions to f32, and what the oracle itself is asked for.
                let slack = 2e-3 * factor + 2e-6;
                if factor > max + slack || factor < min - slack {
                    violations.push(format!(
                        "{} from {}: {factor} is not in {min}…{max}, {:?} of {:?} and {:?} of {:?}",
                        name(&r),
                        name(&s),
                        r.domain,
                        scene.surfaces().get(r.source as usize),
                        s.domain,
                        scene.surfaces().get(s.source as usize),
                    ));
                }
                if factor > 1e-6 && s.kind != Kind::Cluster {
                    tightness.entry((name(&r), name(&s))).or_default().push((max - min) / factor);
                }
            }
        }
    }
    for ((receiver, sender), mut ratios) in tightness {
        ratios.sort_by(f64::total_cmp);
        let quantile = |q: f64| ratios[((ratios.len() - 1) as f64 * q) as usize];
        eprintln!(
            "{receiver:8} from {sender:8} {:6} points: (max − min)/factor {:.3} (quartiles {:.3}, {:.3})",
            ratios.len(),
            quantile(0.5),
            quantile(0.25),
            quantile(0.75)
        );
    }
    assert!(
        violations.is_empty(),
        "{} violations: {}",
        violations.len(),
        violations[..violations.len().min(12)].join("\n")
    );
}

/// Neighbours in one plane do not see each other, be they polygons or clusters; one that stands before it does.
#[test]
fn clusters_in_one_plane_do_not_face_each_other() {
    let quad = |corner: DVec3, a: DVec3, b: DVec3| {
        Surface::new(Shape::Quad([corner, corner + a, corner + a + b, corner + b]), 0)
    };
    let cells = |corner: DVec3, a: DVec3, b: DVec3| {
        (0..64).map(move |i| quad(corner + a * f64::from(i % 8) + b * f64::from(i / 8), a, b))
    };
    let (x, y, z) = (DVec3::X * 0.1, DVec3::Y * 0.1, DVec3::Z * 0.1);
    // Two parts of a floor, and a wall that faces them.
    let floor = cells(DVec3::ZERO, x, y).chain(cells(DVec3::new(1.0, 0.0, 0.0), x, y));
    let surfaces = floor.chain(cells(DVec3::new(2.5, 0.0, -0.1), y, z).map(|mut wall| {
        if let Shape::Quad(corners) = &mut wall.shape {
            corners.reverse();
        }
        wall
    }));
    let material = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ZERO, two_sided: false };
    let input = SceneInput { surfaces: surfaces.collect(), materials: vec![material], ..SceneInput::default() };
    let solver = Solver::new(&input, Settings::with_error(0.1), ()).expect("sound");
    let nodes = &solver.elements.nodes;
    let up = |element: &&Element| element.normals.cos_angle >= 1.0 && element.normals.axis.z > 0.9;
    let floors: Vec<&Element> = nodes.iter().filter(|element| element.kind == Kind::Cluster).filter(up).collect();
    let walls: Vec<&Element> = nodes.iter().filter(|element| element.normals.axis.x < -0.9).collect();
    assert!(floors.len() > 10 && walls.len() > 64, "{} and {} nodes", floors.len(), walls.len());
    for a in &floors {
        assert!(floors.iter().all(|b| factor_bounds(&solver.scene, a, b).is_none()), "{a:?}");
        assert!(walls.iter().any(|wall| factor_bounds(&solver.scene, a, wall).is_some()), "{a:?}");
    }
}

//! Shooting gives what gathering gives, and sends less light around.

use crate::fixtures::{apart, bulb, ceiling_lamp, lamp, on, paint, sides, walls};
use glam::DVec3;
use hr_diffuse::{Rgb, SceneInput, Settings, Shape, Solution, Solver, Surface, Transport};

/// The error that is asked for.
const ERROR: f32 = 0.1;
/// Iterations end when those to come would change light by 0.02 times the error, and half as much may wait to be shot: either way
/// of transport errs by no more, …
const APART: f32 = 0.03 * ERROR;
/// … but where so little leads a ray that calibrates to another sender. Of ten white rooms, with the sphere elsewhere in each, it does in two,
/// and sides differ by up to 0.1 times the error then; the other eight agree to a fortieth of [`APART`].
const APART_WHERE_WHITE: f32 = 0.1 * ERROR;

/// A closed room with a sphere, a lamp and a point light, of the reflectances given.
fn room(white: f32, grey: f32) -> SceneInput {
    let mut surfaces = walls(1, 0, 0);
    surfaces.push(Surface::new(Shape::Sphere { center: DVec3::new(2.5, 1.0, 0.8), radius: 0.5 }, 1));
    surfaces.push(ceiling_lamp(2));
    let materials = vec![
        paint(Rgb::new(1.0, 0.9, 0.8) * white),
        paint(Rgb::new(0.5, 0.7, 1.0) * grey),
        lamp(Rgb::new(100.0, 80.0, 60.0)),
    ];
    SceneInput { surfaces, materials, lights: vec![bulb()], texture: None }
}

fn solver(input: &SceneInput, transport: Transport) -> Solver {
    crate::fixtures::solved(input, Settings { transport, ..Settings::with_error(ERROR) })
}

fn solve(input: &SceneInput, transport: Transport) -> Solution {
    solver(input, transport).finish(&mut on)
}

/// In the white room light settles slowly: little changes from one iteration to the next, but much adds up.
#[test]
fn shooting_gives_what_gathering_gives() {
    let rooms = [
        ("grey", room(0.6, 0.4), APART),
        ("dark", room(0.1, 0.1), APART),
        ("white", room(0.98, 0.95), APART_WHERE_WHITE),
    ];
    for (name, input, most) in rooms {
        let [gathered, shot] = [Transport::Gather, Transport::Shoot].map(|transport| solver(&input, transport));
        let off = apart(&sides(&shot), &sides(&gathered));
        assert!(off < most, "{name}: sides differ by {:.3} %", 100.0 * off);
    }
}

#[test]
fn what_has_been_shot_waits() {
    let input = room(0.6, 0.4);
    let [gathered, shot] = [Transport::Gather, Transport::Shoot].map(|transport| solve(&input, transport).stats);
    assert_eq!(gathered.skipped.shot_links, 0, "all links carry all light");
    assert!(shot.skipped.shot_links > 0, "the lamp shoots once");
    assert!(shot.links_evaluated < gathered.links_evaluated, "{shot:?} against {gathered:?}");
    let all = |stats: &hr_diffuse::Stats| stats.links_evaluated + stats.skipped.shot_links;
    assert!(all(&shot) >= u64::from(shot.iterations), "each iteration counts: {shot:?}");
    assert_eq!(shot.links, gathered.links, "refinement sees the same light");
}

/// In a closed room everything that is emitted is absorbed.
#[test]
fn energy_is_kept() {
    let [gathered, shot] = [Transport::Gather, Transport::Shoot].map(|transport| {
        let solution = solve(&room(0.6, 0.4), transport);
        let (mut emitted, mut absorbed) = (0.0_f64, 0.0_f64);
        for leaf in solution.elements.patch_leaves() {
            let element = &solution.elements.nodes[leaf as usize];
            let exitance = solution.scene.materials[element.material as usize].exitance;
            emitted += f64::from(exitance.element_sum() * element.area);
            let lost = solution.exitant.irradiance[leaf as usize] * (Rgb::ONE - element.reflectance);
            absorbed += f64::from(lost.element_sum() * element.area);
        }
        let lights = solution.scene.lights.iter().map(|light| f64::from(light.intensity.element_sum()));
        absorbed / (emitted + 4.0 * std::f64::consts::PI * lights.sum::<f64>())
    });
    assert!((shot - 1.0).abs() < f64::from(ERROR), "{shot:.4} of what is emitted is absorbed");
    assert!((shot - gathered).abs() < f64::from(APART), "{shot:.4} and {gathered:.4} are absorbed");
}

#[test]
fn threads_change_nothing() {
    let input = room(0.6, 0.4);
    let on = |count: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads");
        pool.install(|| solve(&input, Transport::Shoot))
    };
    let (one, three) = (on(1), on(3));
    let bits = |solution: &Solution| -> Vec<[u32; 3]> {
        solution.exitant.radiosity.iter().map(|rgb| rgb.to_array().map(f32::to_bits)).collect()
    };
    assert!(bits(&one) == bits(&three), "radiosities with 1 and 3 threads");
    assert_eq!(one.stats.residuals, three.stats.residuals, "residuals");
    assert_eq!(one.stats.skipped, three.stats.skipped, "what waited");
}

/// Light that was shot before an edit is not there any more.
#[test]
fn edits_shoot_anew() {
    let input = room(0.6, 0.4);
    let mut edited = room(0.5, 0.2);
    edited.materials[2].exitance *= Rgb::new(1e-4, 0.5, 1.0);
    let settled = [Transport::Gather, Transport::Shoot].map(|transport| {
        let mut solver = solver(&input, transport);
        solver.relight(&edited, None, &mut on).expect("light and paint");
        sides(&solver)
    });
    let off = apart(&settled[1], &settled[0]);
    assert!(off < APART, "sides differ by {:.3} %", 100.0 * off);
}

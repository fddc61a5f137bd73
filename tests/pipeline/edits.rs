//! Edits of glossy scenes over links that exist.

use crate::scenes::Room;
use glossy_ext::haar::Refinement;
use glossy_ext::{GlossyField, Phong};
use hr_diffuse::{Rgb, Settings, Solver};
use std::ops::ControlFlow;
use std::sync::Arc;

/// Coarse: mean radiosities of surfaces are much better.
const ERROR: f32 = 0.1;

fn solved(room: &Room) -> Solver<GlossyField> {
    let field = GlossyField::new(&room.reflectors, Refinement::default());
    let mut solver = Solver::new(&room.input, Settings::with_error(ERROR), field).expect("the room is sound");
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver
}

/// Mean irradiance of the front of each surface but the lamp, which is the last.
fn fronts(solver: &Solver<GlossyField>) -> Vec<Rgb> {
    let (lamp, others) = solver.elements().surface_nodes.split_last().expect("surfaces");
    assert!(lamp[0] != u32::MAX, "the lamp has an element");
    others.iter().map(|[front, _]| solver.exitant().irradiance[*front as usize]).collect()
}

/// Relative to all of the light.
fn difference(a: &[Rgb], b: &[Rgb]) -> f32 {
    let apart: f32 = a.iter().zip(b).map(|(a, b)| (*a - *b).abs().element_sum()).sum();
    apart / b.iter().map(|light| light.element_sum()).sum::<f32>()
}

#[test]
fn glossy_paint_and_lamps_can_be_edited() {
    let mut room = Room::new();
    let mut solver = solved(&room);
    let before = fronts(&solver);
    let phong = Phong::new(Rgb::new(0.1, 0.2, 0.5), Rgb::splat(0.4), 60.0).expect("a Phong lobe");
    room.reflectors[3] = Arc::new(phong);
    for (material, reflector) in room.input.materials.iter_mut().zip(&room.reflectors) {
        material.reflectance = reflector.diffuse();
        material.exitance *= Rgb::new(0.5, 0.7, 1.0);
    }
    room.input.lights[0].intensity *= 1.5;
    let field = GlossyField::new(&room.reflectors, Refinement::default());
    solver.relight(&room.input, Some(field), &mut |_| ControlFlow::Continue(())).expect("links serve for it");
    let fresh = fronts(&solved(&room));
    assert!(difference(&before, &fresh) > 0.2, "the edit is one");
    let off = difference(&fronts(&solver), &fresh);
    assert!(off < 0.5 * ERROR, "off by {off}");
}

/// What all lamps together emit more or less is expected everywhere, and what arrives is sent on in proportion: that of a single lamp
/// shows where leaves have to be reflected anew, and those are few.
#[test]
fn dimming_lamps_reflects_few_leaves_anew() {
    const BAR: u64 = 20;
    let mut room = Room::new();
    let mut solver = solved(&room);
    let reflected = |solver: &Solver<GlossyField>| solver.field().counters().brdf_evaluations();
    let first = reflected(&solver);
    let mut share_of = |room: &Room| {
        let before = reflected(&solver);
        solver.relight(&room.input, None, &mut |_| ControlFlow::Continue(())).expect("links serve for it");
        let off = difference(&fronts(&solver), &fronts(&solved(room)));
        assert!(off < 0.5 * ERROR, "off by {off}");
        100 * (reflected(&solver) - before) / first
    };
    let color = Rgb::new(0.3, 0.6, 0.9);
    room.input.materials.iter_mut().for_each(|material| material.exitance *= color);
    room.input.lights[0].intensity *= color;
    assert_eq!(share_of(&room), 0, "percent of what the solve reflected, for all lamps in another colour");
    room.input.lights[0].intensity *= 0.5;
    let one = share_of(&room);
    assert!(one < BAR, "{one} % of what the solve reflected, for a single lamp");
}

#[test]
fn glossy_lamps_can_be_mixed() {
    let mut room = Room::new();
    let mut solver = solved(&room);
    let lamps = solver.lamps();
    let variants = solver.each_lamp(&lamps, &mut |_| ControlFlow::Continue(())).expect("lamps");
    let colors = [Rgb::new(0.5, 0.7, 1.0), Rgb::splat(1.5)];
    solver.mix(&variants, &colors, &mut |_| ControlFlow::Continue(())).expect("a mixture");
    room.input.materials.iter_mut().for_each(|material| material.exitance *= colors[0]);
    room.input.lights[0].intensity *= colors[1];
    let off = difference(&fronts(&solver), &fronts(&solved(&room)));
    assert!(off < 0.5 * ERROR, "off by {off}");
}

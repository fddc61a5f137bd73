//! The example keeps what it promises.

use crate::answers::Answer;
use crate::{FINENESS, added_lines, engine};
use glossy_ext::{Lambert, Reflector};
use hr_scene::Scene;
use std::sync::Arc;

/// Largest relative difference of the two engines' answers, and the error that our solver is asked for.
const AGREEMENT: f32 = 0.03;

#[test]
fn little_is_added() {
    let [file, marked] = added_lines();
    assert!(file > 50 && marked > 5, "lines of code are counted: {file} + {marked}");
    assert!(file + marked < 150, "{file} + {marked} lines");
}

#[test]
fn both_engines_agree() {
    let scene = Arc::new(Scene::load("glossy-sphere").expect("a built-in scene"));
    // No finer than what is compared. Most of what theirs does is done by one thread.
    let solved = || Answer::of_solver(&scene, AGREEMENT).expect("a scene that can be solved");
    let shot = || {
        let mut foreign = engine(&scene, FINENESS);
        foreign.solve();
        foreign
    };
    let (ours, foreign) = rayon::join(solved, shot);
    let theirs = Answer::of_engine(&scene, &foreign);
    let difference = theirs.ceilings_differ(&ours);
    assert!(difference < AGREEMENT, "ceiling: {difference}; {:?}, {:?}", theirs.ceiling, ours.ceiling);
    for (theirs, ours) in theirs.floor.iter().zip(&ours.floor) {
        assert!((theirs / ours - 1.0).abs() < AGREEMENT, "floor: {theirs}, {ours}");
    }
    let tally = foreign.glossy.field.verdict().unwrap_or_else(|faults| panic!("{faults}"));
    assert!(tally.reflections > 1000 && (tally.ratio - 1.0).abs() < 0.01, "samples are all the light: {tally:?}");
    // What is compared is glossy light for the most part.
    let mut diffuse = Scene::load("glossy-sphere").expect("a built-in scene");
    for material in &mut diffuse.materials {
        let lambert = Lambert::new(material.reflector.diffuse()).expect("a reflectance");
        material.reflector = Arc::new(lambert) as Arc<dyn Reflector>;
    }
    let mut foreign = engine(&diffuse, 2.0 * FINENESS);
    foreign.solve();
    let without = Answer::of_engine(&diffuse, &foreign);
    assert!(without.mean() < 0.7 * ours.mean(), "the ceiling without glossy light: {}", without.mean());
}

//! Table 2 and figure 7: the adaptive Haar basis against the non-adaptive one, and spherical harmonics.

use super::leaves::{Leaf, distance, glossy_leaves, reflect, solve};
use super::{Page, relative};
use crate::BenchError;
use glossy_ext::basis::{Harmonics, Level, NonAdaptive, Order, Window};
use glossy_ext::haar::{Haar, Refinement, Refiner};
use glossy_ext::{Basis, GlossyField, Reflector};
use hr_diffuse::Solution;
use hr_scene::Scene;
use std::sync::Arc;

/// Every so many leaves count.
const STEP: usize = 3;
/// Repetitions of what is timed.
const ATTEMPTS: u32 = 1;

/// What a basis does with the leaves of a solution.
struct Made {
    name: String,
    functions: usize,
    bytes: usize,
    evaluations: u64,
    seconds: f64,
    error: f64,
}

/// The leaves of a solution, and how they reflect.
struct Subject<'a> {
    solution: &'a Solution<GlossyField>,
    reflectors: &'a [Arc<dyn Reflector>],
    leaves: Vec<Leaf<'a>>,
}

impl Subject<'_> {
    fn made<B: Basis>(&self, name: String, settings: B::Settings) -> Made {
        let field = GlossyField::<B>::in_basis(self.reflectors, settings);
        let (sent, seconds) = reflect(&field, self.solution, &self.leaves, ATTEMPTS);
        let error = distance(&self.solution.field, self.solution, &self.leaves, |leaf, away| sent[leaf].eval(away));
        Made {
            name,
            functions: sent.iter().map(Basis::basis_functions).sum(),
            bytes: sent.iter().map(Basis::bytes).sum(),
            evaluations: field.counters().brdf_evaluations() / u64::from(ATTEMPTS),
            seconds,
            error,
        }
    }
}

pub(super) fn report(page: &mut Page<'_>) -> Result<(), BenchError> {
    let scene = Arc::new(Scene::load("empty-room")?);
    let reflectors = scene.reflectors();
    let solution = solve(&scene.input(), &reflectors, 0.1)?;
    let subject = Subject { solution: &solution, reflectors: &reflectors, leaves: glossy_leaves(&solution, STEP) };
    page.line(&format!("## Table 2 {} leaves", subject.leaves.len()));
    page.head(1, &["basis", "functions", "kB", "BRDF evaluations", "s", "error"]);
    let mut all = Vec::new();
    for level in 3..=7 {
        all.push(subject.made::<NonAdaptive>(format!("non-adaptive, level {level}"), Level(level)));
    }
    for level in 3..=6 {
        all.push(subject.made::<Haar>(format!("Haar, relative 0.5, 1/{level}"), relative(0.5, [1, level])));
    }
    for level in 3..=7 {
        for e in [0.02, 0.05, 0.1, 0.2] {
            for (min, neg) in [(0, 0.01), (0, 0.03), (0, 0.1)] {
                let settings = Refinement {
                    max_level: level,
                    min_level: min,
                    negligible: neg,
                    refiner: Refiner::Interpolation(e),
                    ..Refinement::default()
                };
                all.push(subject.made::<Haar>(format!("Haar, default {e}, {min}/{level} neg {neg}"), settings));
            }
        }
    }
    for last in [3] {
        let settings = Order { last, window: Window::Lanczos };
        all.push(subject.made::<Harmonics>(format!("harmonics, order {last}"), settings));
    }
    for made in &all {
        page.row(&[
            made.name.clone(),
            made.functions.to_string(),
            format!("{:.1}", made.bytes as f64 / 1e3),
            made.evaluations.to_string(),
            format!("{:.3}", made.seconds),
            format!("{:.1} %", 100.0 * made.error),
        ]);
    }
    Ok(())
}

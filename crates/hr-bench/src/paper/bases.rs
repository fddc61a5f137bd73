//! Table 2, figures 7 and 8: the adaptive Haar basis against the non-adaptive one and spherical harmonics, and the relative
//! refiner against the absolute one.

use super::leaves::{Leaf, distance, glossy_leaves, reflect, solve};
use super::{Page, percent, relative};
use crate::BenchError;
use crate::curve::time_at;
use crate::run::camera;
use crate::side_by_side::side_by_side;
use glossy_ext::basis::{Harmonics, Level, NonAdaptive, Order, Window};
use glossy_ext::haar::{Haar, Refinement, Refiner};
use glossy_ext::{Basis, GlossyField, Reflector};
use hr_diffuse::{Settings, Solution, Solver};
use hr_scene::{Camera, Image, Scene};
use hr_view::Mode;
use hr_view::raycast::RayCaster;
use std::ops::ControlFlow;
use std::sync::Arc;

/// The paper's empty room with a glossy floor.
const SCENE: &str = "empty-room";
/// Error that the solver is asked for.
const ERROR: f32 = 0.1;
/// Levels of the non-adaptive basis.
const LEVELS: [u8; 4] = [3, 4, 5, 6];
/// ε and last level of our refiner, ever finer: at each level the ε beyond which a smaller one brings little.
const FINER: [(f32, u8); 9] =
    [(0.2, 2), (0.2, 3), (0.2, 4), (0.2, 5), (0.1, 5), (0.07, 5), (0.05, 5), (0.02, 5), (0.02, 6)];
/// ε and levels of figure 8.
const RELATIVE: (f32, [u8; 2]) = (0.5, [1, 5]);
/// Steps of the search for a threshold.
const STEPS: u32 = 20;
/// Error that the solver is asked for to show the solution.
const SHOWN_ERROR: f32 = 0.05;
/// Width of the pictures, pixels.
const WIDTH: u32 = 200;

/// What a basis does with the leaves of a solution.
#[derive(Clone, Copy, Debug)]
struct Made {
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
    /// Repetitions of what is timed.
    attempts: u32,
}

impl Subject<'_> {
    fn made<B: Basis>(&self, settings: B::Settings) -> Made {
        let field = GlossyField::<B>::in_basis(self.reflectors, settings);
        let (sent, seconds) = reflect(&field, self.solution, &self.leaves, self.attempts);
        Made {
            functions: sent.iter().map(|outgoing| outgoing.basis_functions()).sum(),
            bytes: sent.iter().map(|outgoing| outgoing.bytes()).sum(),
            evaluations: field.counters().brdf_evaluations() / u64::from(self.attempts),
            seconds,
            error: distance(self.solution, &self.leaves, |leaf, away| sent[leaf].eval(away)),
        }
    }

    fn non_adaptive(&self) -> Vec<Made> {
        LEVELS.map(|level| self.made::<NonAdaptive>(Level(level))).to_vec()
    }

    fn haar(&self) -> Vec<Made> {
        FINER.map(|(epsilon, level)| self.made::<Haar>(refinement(epsilon, level))).to_vec()
    }

    /// The absolute refiner that makes about as many functions, between the same levels.
    fn as_many_as(&self, functions: usize, settings: Refinement) -> Refinement {
        let absolute = |threshold| Refinement { refiner: Refiner::Absolute(threshold), ..settings };
        // Radiances (W/(m² sr)), more and less than what differs anywhere.
        let (mut low, mut high) = (1e-3_f32, 1e3_f32);
        for _ in 0..STEPS {
            let middle = (low * high).sqrt();
            let is_finer = self.made::<Haar>(absolute(middle)).functions > functions;
            (low, high) = if is_finer { (middle, high) } else { (low, middle) };
        }
        absolute(high)
    }
}

/// Our refiner.
fn refinement(epsilon: f32, max_level: u8) -> Refinement {
    Refinement { max_level, refiner: Refiner::Interpolation(epsilon), ..Refinement::default() }
}

/// What costs of the Haar basis are of those of the other at the same error, where it is within its range.
fn share(haar: &[Made], other: &Made, cost: fn(&Made) -> f64) -> Option<f64> {
    let points: Vec<[f64; 2]> = haar.iter().map(|made| [cost(made), made.error]).collect();
    Some(time_at(&points, other.error)? / cost(other))
}

/// Adds the table to a page.
pub(super) fn report(page: &mut Page<'_>) -> Result<(), BenchError> {
    let scene = Arc::new(Scene::load(SCENE)?);
    let reflectors = scene.reflectors();
    let solution = solve(&scene.input(), &reflectors, ERROR)?;
    let leaves = glossy_leaves(&solution, 1);
    let subject = Subject { solution: &solution, reflectors: &reflectors, leaves, attempts: 3 };
    page.text("## Table 2, figures 7 and 8: the Haar basis against the non-adaptive one");
    page.text(&format!(
        "An empty room with a glossy floor: what its {} leaves reflect, in several bases. All of them keep vertex values \
         as half floats, spherical harmonics their coefficients as floats. The paper, for 2,878 distributions by Radiance \
         Clustering: level 3, 782,000 triangles (510 s) non-adaptive and 640,000 (722 s) Haar; level 4, 3,127,000 (731 s) \
         and 1,829,000 (1,125 s).",
        subject.leaves.len()
    ));
    page.head(2, &["basis", "settings", "functions", "kB", "BRDF evaluations", "s", "error"]);
    let mut row = |basis: &str, settings: String, made: &Made| {
        page.row(&[
            basis.to_owned(),
            settings,
            made.functions.to_string(),
            format!("{:.0}", made.bytes as f64 / 1e3),
            made.evaluations.to_string(),
            format!("{:.3}", made.seconds),
            percent(made.error),
        ]);
    };
    let (even, haar) = (subject.non_adaptive(), subject.haar());
    for (level, made) in LEVELS.iter().zip(&even) {
        row("non-adaptive", format!("level {level}"), made);
    }
    for level in [3, 4, 5] {
        row("Haar", format!("the paper's, ε = 0.5, 1/{level}"), &subject.made::<Haar>(relative(0.5, [1, level])));
    }
    for ((epsilon, level), made) in FINER.iter().zip(&haar) {
        row("Haar", format!("ours, ε = {epsilon}, 1/{level}"), made);
    }
    for last in [10, 20] {
        let made = subject.made::<Harmonics>(Order { last, window: Window::Lanczos });
        row("spherical harmonics", format!("order {last}, Lanczos"), &made);
    }
    page.text(
        "At the same error (between the rows of ours in the table, in logarithms), parts of what the non-adaptive basis \
         takes:",
    );
    page.head(1, &["as good as non-adaptive, level", "error", "Haar: memory", "triangles", "time"]);
    for (level, made) in LEVELS.iter().zip(&even) {
        let part = |cost| share(&haar, made, cost).map_or("-".to_owned(), |share| format!("{share:.2}"));
        page.row(&[
            level.to_string(),
            percent(made.error),
            part(|m| m.bytes as f64),
            part(|m| m.functions as f64),
            part(|m| m.seconds),
        ]);
    }
    page.text(
        "At level 3 triangles are wider than the highlights, so that neither basis has them: where nothing is resolved, an \
         adaptive one saves little.",
    );
    page.text(
        "Above non-adaptive, in the middle Haar by the paper's refiner, left to level 3, right to level 4; below left Haar by \
         our refiner, as `hr-view` uses it, right a final gather:",
    );
    let shows = Mode::Distributions;
    let pictures = [
        vec![shown::<NonAdaptive>(&scene, Level(3), shows)?, shown::<NonAdaptive>(&scene, Level(4), shows)?],
        vec![
            shown::<Haar>(&scene, relative(0.5, [1, 3]), shows)?,
            shown::<Haar>(&scene, relative(0.5, [1, 4]), shows)?,
        ],
        vec![
            shown::<Haar>(&scene, Refinement::default(), shows)?,
            shown::<Haar>(&scene, Refinement::default(), Mode::Gather)?,
        ],
    ];
    page.picture("figure-7", "The glossy floor in both bases", &side_by_side(&pictures))?;
    refiners(&subject, &scene, page)
}

/// Adds figure 8.
fn refiners(subject: &Subject<'_>, scene: &Arc<Scene>, page: &mut Page<'_>) -> Result<(), BenchError> {
    let (epsilon, levels) = RELATIVE;
    let settings = relative(epsilon, levels);
    let made = subject.made::<Haar>(settings);
    let absolute = subject.as_many_as(made.functions, settings);
    let other = subject.made::<Haar>(absolute);
    page.text(&format!(
        "Figure 8, levels {}/{}: left the relative refiner, ε = {epsilon} ({} functions for the leaves above, error {}), right the \
         absolute one with the threshold that makes as many ({}, error {}). Both divide down to the last level where the lobes \
         of strong samples point, whatever differs there, so that little is left to show the paper's ringing:",
        levels[0],
        levels[1],
        made.functions,
        percent(made.error),
        other.functions,
        percent(other.error),
    ));
    let shows = Mode::Distributions;
    let pictures = [vec![shown::<Haar>(scene, settings, shows)?, shown::<Haar>(scene, absolute, shows)?]];
    page.picture("figure-8", "The glossy floor by both refiners", &side_by_side(&pictures))
}

/// A picture of the scene with its distributions in some basis.
fn shown<B: Basis>(scene: &Arc<Scene>, settings: B::Settings, mode: Mode) -> Result<Image, BenchError> {
    let field = GlossyField::<B>::in_basis(&scene.reflectors(), settings);
    let mut solver = Solver::new(&scene.input(), Settings::with_error(SHOWN_ERROR), field)?;
    let going_on = |_: &_| ControlFlow::Continue(());
    solver.solve(&mut { going_on });
    solver.reflect_for_display(&mut { going_on });
    let solution = solver.finish(&mut { going_on });
    Ok(RayCaster::new(scene, &solution, mode).with_grid(2).render(&view(scene)?, &|_| ()))
}

fn view(scene: &Scene) -> Result<Camera, BenchError> {
    let camera = camera(scene, Some("corner"))?;
    let height = f64::from(camera.height) * f64::from(WIDTH) / f64::from(camera.width);
    Ok(Camera { width: WIDTH, height: height.round() as u32, ..camera })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where highlights are represented at all, the adaptive basis needs half of the memory at most, and half of the
    /// evaluations.
    #[test]
    fn haar_is_smaller_and_evaluates_less_at_equal_error() {
        let scene = Arc::new(Scene::load(SCENE).expect("built in"));
        let reflectors = scene.reflectors();
        let solution = solve(&scene.input(), &reflectors, ERROR).expect("sound");
        let leaves = glossy_leaves(&solution, 12);
        let subject = Subject { solution: &solution, reflectors: &reflectors, leaves, attempts: 3 };
        let (even, haar) = (subject.non_adaptive(), subject.haar());
        assert!(even[0].error > 0.3, "level 3 misses highlights: {:?}", even[0]);
        for (level, made) in LEVELS.iter().zip(&even).skip(1) {
            let memory = share(&haar, made, |m| m.bytes as f64).expect("within the range");
            // Times would be spoilt by other tests beside this one.
            let work = share(&haar, made, |m| m.evaluations as f64).expect("within the range");
            assert!(memory <= 0.5, "level {level}: {memory} of the memory");
            assert!(work <= 0.5, "level {level}: {work} of the evaluations");
        }
    }
}

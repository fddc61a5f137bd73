//! Tables 3 and 4: whole solutions by illumination samples and by Radiance Clustering.

use super::clustering::RadianceClustering;
use super::{Page, relative, saved};
use crate::BenchError;
use crate::measure::cpu_seconds;
use glossy_ext::GlossyField;
use glossy_ext::haar::{Haar, Refinement};
use glossy_ext::samples::SampleSet;
use hr_diffuse::{LightField, SceneInput, Settings, Solver};
use hr_scene::Scene;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// A row of the paper's tables 3 and 4.
struct Case {
    /// A scene of ours.
    scene: &'static str,
    epsilon: f32,
    levels: [u8; 2],
    /// The paper's, by illumination samples and by Radiance Clustering.
    functions: [u32; 2],
    seconds: [f64; 2],
}

const CASES: [Case; 6] = [
    Case { scene: "three-lights", epsilon: 0.5, levels: [1, 3], functions: [8618, 13_866], seconds: [44.6, 90.1] },
    Case { scene: "three-lights", epsilon: 0.1, levels: [1, 3], functions: [8820, 14_068], seconds: [44.2, 90.0] },
    Case { scene: "three-lights", epsilon: 0.5, levels: [1, 4], functions: [27_306, 43_510], seconds: [49.3, 95.5] },
    Case { scene: "three-lights", epsilon: 0.5, levels: [1, 5], functions: [79_218, 125_944], seconds: [58.6, 105.3] },
    Case {
        scene: "glossy-sphere",
        epsilon: 0.5,
        levels: [1, 3],
        functions: [2_114_324, 3_598_720],
        seconds: [4167.1, 6492.9],
    },
    Case {
        scene: "empty-room",
        epsilon: 0.5,
        levels: [1, 3],
        functions: [2_097_534, 3_339_794],
        seconds: [5207.6, 7117.4],
    },
];

/// A solution.
struct Solved {
    functions: usize,
    evaluations: u64,
    seconds: f64,
    links: u64,
}

fn solve<L: LightField<Incident = SampleSet, Exitant = Haar>>(
    input: &SceneInput,
    error: f32,
    field: L,
    evaluations: impl Fn(&L) -> u64,
) -> Result<Solved, BenchError> {
    let start = cpu_seconds();
    let mut solver = Solver::new(input, Settings::with_error(error), field)?;
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.reflect_for_display(&mut |_| ControlFlow::Continue(()));
    let seconds = cpu_seconds() - start;
    let solution = solver.finish(&mut |_| ControlFlow::Break(()));
    Ok(Solved {
        functions: solution.reflected.iter().map(Haar::basis_functions).sum(),
        evaluations: evaluations(&solution.field),
        seconds,
        links: solution.stats.links,
    })
}

fn both(scene: &Arc<Scene>, refinement: Refinement, error: f32) -> Result<[Solved; 2], BenchError> {
    let (input, reflectors) = (scene.input(), scene.reflectors());
    let samples = GlossyField::new(&reflectors, refinement);
    let clustering = RadianceClustering::new(&reflectors, refinement);
    Ok([
        solve(&input, error, samples, |field| field.counters().brdf_evaluations())?,
        solve(&input, error, clustering, RadianceClustering::brdf_evaluations)?,
    ])
}

/// Adds both tables to a page, with scenes beside the paper's.
pub(super) fn report(scenes: &[String], error: f32, page: &mut Page<'_>) -> Result<(), BenchError> {
    page.text("## Tables 3 and 4: illumination samples against Radiance Clustering");
    page.text(&format!(
        "Whole solutions at an error of {error} asked for, by illumination samples (IS) and by Radiance Clustering (RC), \
         which reflects what each link brings on its own and adds it to a leaf's distribution, and keeps a second \
         distribution for what it is gathering meanwhile. All else is the same code. RC is spared what is not its idea: the \
         traversals of the hierarchy, one for each link, and reflecting anew what has not changed. `empty-room` stands \
         for the paper's simple soda shop. In brackets: the paper's savings."
    ));
    let columns = [
        "scene",
        "ε",
        "m/M",
        "links: IS",
        "RC",
        "functions: IS",
        "RC, sent",
        "RC, both",
        "saved",
        "s: IS",
        "RC",
        "saved",
        "BRDF evaluations: IS",
        "RC",
    ];
    page.head(3, &columns);
    for Case { scene, epsilon, levels, functions, seconds } in CASES {
        let both = both(&Arc::new(Scene::load(scene)?), relative(epsilon, levels), error)?;
        page.row(&row(scene, (epsilon, levels), &both, Some([functions.map(f64::from), seconds])));
    }
    for name in scenes {
        let both = both(&Arc::new(Scene::load(name)?), relative(0.5, [1, 3]), error)?;
        let name = Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
        page.row(&row(&name, (0.5, [1, 3]), &both, None));
    }
    Ok(())
}

fn row(
    name: &str,
    (epsilon, [min, max]): (f32, [u8; 2]),
    [is, rc]: &[Solved; 2],
    published: Option<[[f64; 2]; 2]>,
) -> Vec<String> {
    let rc_functions = RadianceClustering::DISTRIBUTIONS * rc.functions;
    let beside = |ours: [f64; 2], theirs: Option<[f64; 2]>| {
        let theirs = theirs.map_or(String::new(), |theirs| format!(" ({})", saved(theirs)));
        saved(ours) + &theirs
    };
    vec![
        name.to_owned(),
        epsilon.to_string(),
        format!("{min}/{max}"),
        is.links.to_string(),
        rc.links.to_string(),
        is.functions.to_string(),
        rc.functions.to_string(),
        rc_functions.to_string(),
        beside([is.functions as f64, rc_functions as f64], published.map(|p| p[0])),
        format!("{:.2}", is.seconds),
        format!("{:.2}", rc.seconds),
        beside([is.seconds, rc.seconds], published.map(|p| p[1])),
        is.evaluations.to_string(),
        rc.evaluations.to_string(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn illumination_samples_take_fewer_functions_and_evaluations() {
        let scene = Arc::new(Scene::load("empty-room").expect("built in"));
        let [is, rc] = both(&scene, relative(0.5, [1, 3]), 0.2).expect("sound");
        let (sent, kept) = (rc.functions, RadianceClustering::DISTRIBUTIONS * rc.functions);
        assert!(is.functions < sent && 10 * is.functions <= 6 * kept, "functions: {} and {kept}", is.functions);
        // Times would be spoilt by other tests beside this one.
        assert!(is.evaluations < rc.evaluations, "evaluations: {} and {}", is.evaluations, rc.evaluations);
        // The solutions are the same but for how glossy light is represented.
        let links = is.links as f64 / rc.links as f64;
        assert!((links - 1.0).abs() < 0.1, "links: {} and {}", is.links, rc.links);
    }
}

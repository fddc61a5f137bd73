//! Tables 3 and 4: whole solutions by illumination samples and by Radiance Clustering.

use super::clustering::RadianceClustering;
use super::{Page, relative};
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

/// Error asked for.
fn error() -> f32 {
    std::env::var("ERR").unwrap().parse().unwrap()
}

/// A row of the paper's tables 3 and 4.
struct Case {
    /// A scene of ours.
    scene: &'static str,
    /// The paper's.
    name: &'static str,
    epsilon: f32,
    levels: [u8; 2],
    functions: [u32; 2],
    seconds: [f64; 2],
}

const CASES: [Case; 6] = [
    Case {
        scene: "three-lights",
        name: "3 lights",
        epsilon: 0.5,
        levels: [1, 3],
        functions: [8618, 13_866],
        seconds: [44.6, 90.1],
    },
    Case {
        scene: "three-lights",
        name: "3 lights",
        epsilon: 0.1,
        levels: [1, 3],
        functions: [8820, 14_068],
        seconds: [44.2, 90.0],
    },
    Case {
        scene: "three-lights",
        name: "3 lights",
        epsilon: 0.5,
        levels: [1, 4],
        functions: [27_306, 43_510],
        seconds: [49.3, 95.5],
    },
    Case {
        scene: "three-lights",
        name: "3 lights",
        epsilon: 0.5,
        levels: [1, 5],
        functions: [79_218, 125_944],
        seconds: [58.6, 105.3],
    },
    Case {
        scene: "glossy-sphere",
        name: "sphere",
        epsilon: 0.5,
        levels: [1, 3],
        functions: [2_114_324, 3_598_720],
        seconds: [4167.1, 6492.9],
    },
    Case {
        scene: "empty-room",
        name: "simple soda",
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
    reflect: f64,
    links: u64,
    leaves: u64,
}

fn solve<L: LightField<Incident = SampleSet, Exitant = Haar>>(
    input: &SceneInput,
    field: L,
    evaluations: impl Fn(&L) -> u64,
) -> Result<Solved, BenchError> {
    let start = cpu_seconds();
    let mut solver = Solver::new(input, Settings::with_error(error()), field)?;
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.reflect_for_display(&mut |_| ControlFlow::Continue(()));
    let seconds = cpu_seconds() - start;
    let solution = solver.finish(&mut |_| ControlFlow::Break(()));
    Ok(Solved {
        functions: solution.reflected.iter().map(Haar::basis_functions).sum(),
        evaluations: evaluations(&solution.field),
        seconds,
        reflect: solution.stats.seconds.reflect,
        links: solution.stats.links,
        leaves: solution.stats.leaves,
    })
}

fn both(scene: &Arc<Scene>, refinement: Refinement) -> Result<[Solved; 2], BenchError> {
    let (input, reflectors) = (scene.input(), scene.reflectors());
    let samples = GlossyField::new(&reflectors, refinement);
    let clustering = RadianceClustering::new(&reflectors, refinement);
    Ok([
        solve(&input, samples, |field| field.counters().brdf_evaluations())?,
        solve(&input, clustering, RadianceClustering::brdf_evaluations)?,
    ])
}

pub(super) fn report(scenes: &[String], page: &mut Page<'_>) -> Result<(), BenchError> {
    page.head(
        3,
        &[
            "scene",
            "ε",
            "m/M",
            "leaves",
            "links",
            "functions, IS",
            "RC, sent",
            "RC, both",
            "time",
            "RC",
            "saved",
            "reflect",
            "RC",
            "evals",
            "evals",
        ],
    );
    for case in CASES {
        let scene = Arc::new(Scene::load(case.scene)?);
        let [is, rc] = both(&scene, relative(case.epsilon, case.levels))?;
        row(page, case.scene, case.epsilon, case.levels, &is, &rc);
    }
    for name in scenes {
        let scene = Arc::new(Scene::load(name)?);
        let [is, rc] = both(&scene, relative(0.5, [1, 3]))?;
        row(page, &Path::new(name).file_stem().unwrap_or_default().to_string_lossy(), 0.5, [1, 3], &is, &rc);
    }
    Ok(())
}

fn row(page: &mut Page<'_>, name: &str, epsilon: f32, levels: [u8; 2], is: &Solved, rc: &Solved) {
    page.row(&[
        name.into(),
        epsilon.to_string(),
        format!("{levels:?}"),
        format!("{}/{}", is.leaves, rc.leaves),
        format!("{}/{}", is.links, rc.links),
        is.functions.to_string(),
        rc.functions.to_string(),
        (RadianceClustering::DISTRIBUTIONS * rc.functions).to_string(),
        format!("{:.2}", is.seconds),
        format!("{:.2}", rc.seconds),
        format!("{:.0} %", 100.0 * (1.0 - is.seconds / rc.seconds)),
        format!("{:.2}", is.reflect),
        format!("{:.2}", rc.reflect),
        is.evaluations.to_string(),
        rc.evaluations.to_string(),
    ]);
}

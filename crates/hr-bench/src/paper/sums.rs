//! Table 1: reflecting the sum against summing reflections.

use super::clustering::RadianceClustering;
use super::leaves::{Leaf, distance, glossy_leaves, reflect, solve};
use super::{Page, relative};
use crate::BenchError;
use glam::{DVec3, dvec3};
use glossy_ext::haar::{Haar, Refinement};
use glossy_ext::{GlossyField, Lambert, Reflector, Ward};
use hr_diffuse::{DiffuseMaterial, Rgb, SceneInput, Shape, Solution, Surface};
use std::sync::Arc;

/// A row of the paper's table 1: angle between lights in degrees, functions, BRDF evaluations and seconds, each for
/// reflecting the sum and for summing reflections.
struct Published {
    angle: f64,
    functions: [u32; 2],
    evaluations: [u32; 2],
    seconds: [f64; 2],
}

const PUBLISHED: [Published; 3] = [
    Published { angle: 3.0, functions: [4998, 7140], evaluations: [457_968, 148_172], seconds: [10.05, 19.83] },
    Published { angle: 15.0, functions: [3752, 16_390], evaluations: [342_000, 351_554], seconds: [7.56, 15.89] },
    Published { angle: 30.0, functions: [3096, 23_574], evaluations: [251_790, 219_372], seconds: [4.86, 10.39] },
];

/// Roughness of Ward's model: the paper does not tell how wide its highlights are.
const ALPHAS: [f32; 4] = [0.2, 0.3, 0.4, 0.5];

/// Repetitions of what is timed.
const ATTEMPTS: u32 = 5;

/// One way to reflect.
#[derive(Clone, Copy, Debug)]
pub(super) struct Made {
    pub(super) functions: usize,
    pub(super) evaluations: u64,
    pub(super) seconds: f64,
    pub(super) error: f64,
}

/// 3 × 7 lights of 4 cm, 1 m from the middle of a glossy reflector of 2 cm; those at the horizon shine past it and are
/// left out.
fn lights(angle: f64, alpha: f32) -> Result<(SceneInput, Vec<Arc<dyn Reflector>>), BenchError> {
    let unsound = |error: &dyn std::fmt::Display| BenchError::Arguments(error.to_string());
    let reflectors: Vec<Arc<dyn Reflector>> = vec![
        Arc::new(Ward::new(Rgb::ZERO, Rgb::splat(0.9), alpha).map_err(|e| unsound(&e))?),
        Arc::new(Lambert::new(Rgb::ZERO).map_err(|e| unsound(&e))?),
    ];
    let black = DiffuseMaterial { reflectance: Rgb::ZERO, exitance: Rgb::ZERO, two_sided: false };
    let materials = vec![black, DiffuseMaterial { exitance: Rgb::splat(2e5), ..black }];
    let mut surfaces = vec![patch(DVec3::ZERO, DVec3::Z, 0.02, 0)];
    for row in -1..=1 {
        for column in -3..=3 {
            let [x, y] = [column, row].map(|i| (f64::from(i) * angle).to_radians());
            let toward = dvec3(x.sin() * y.cos(), y.sin(), x.cos() * y.cos());
            if toward.z > 0.05 {
                surfaces.push(patch(toward, -toward, 0.04, 1));
            }
        }
    }
    Ok((SceneInput { surfaces, materials, ..SceneInput::default() }, reflectors))
}

/// A square about `middle` that faces `normal`.
fn patch(middle: DVec3, normal: DVec3, side: f64, material: u32) -> Surface {
    let (a, b) = normal.any_orthonormal_pair();
    let (a, b) = (a * side / 2.0, b * side / 2.0);
    Surface::new(Shape::Quad([middle - a - b, middle + a - b, middle + a + b, middle - a + b]), material)
}

/// Reflects the leaves of a solution by illumination samples and by Radiance Clustering.
pub(super) fn both_ways(
    solution: &Solution<GlossyField>,
    reflectors: &[Arc<dyn Reflector>],
    leaves: &[Leaf<'_>],
    refinement: Refinement,
) -> [Made; 2] {
    let made = |distributions: &[Haar], field: &GlossyField, evaluations: u64, seconds: f64| Made {
        functions: distributions.iter().map(Haar::basis_functions).sum(),
        evaluations: evaluations / u64::from(ATTEMPTS),
        seconds,
        error: distance(field, solution, leaves, |leaf, direction| distributions[leaf].eval(direction)),
    };
    let samples = GlossyField::new(reflectors, refinement);
    let clustering = RadianceClustering::new(reflectors, refinement);
    let (sum, sum_seconds) = reflect(&samples, solution, leaves, ATTEMPTS);
    let (summed, summed_seconds) = reflect(&clustering, solution, leaves, ATTEMPTS);
    [
        made(&sum, &samples, samples.counters().brdf_evaluations(), sum_seconds),
        made(&summed, &samples, clustering.brdf_evaluations(), summed_seconds),
    ]
}

pub(super) fn report(page: &mut Page<'_>) -> Result<(), BenchError> {
    page.line("## Table 1: reflecting the sum, or summing reflections");
    page.head(
        1,
        &[
            "highlights",
            "angle",
            "functions, sum",
            "summing",
            "fewer",
            "paper",
            "BRDF evaluations, sum",
            "summing",
            "fewer",
            "paper",
            "ms, sum",
            "summing",
            "faster",
            "paper",
            "error, sum",
            "summing",
        ],
    );
    for (refinement, name) in [(relative(0.5, [1, 6]), "relative"), (Refinement::default(), "default")] {
        for alpha in ALPHAS {
            for published in &PUBLISHED {
                let (input, reflectors) = lights(published.angle, alpha)?;
                let solution = solve(&input, &reflectors, 0.03)?;
                let leaves = glossy_leaves(&solution, 1);
                let [sum, summing] = both_ways(&solution, &reflectors, &leaves, refinement);
                let times = |[a, b]: [f64; 2]| format!("{:.1}", b / a);
                let published_times = |v: [u32; 2]| times(v.map(f64::from));
                page.row(&[
                    format!(
                        "{name}, α = {alpha} {} {}",
                        leaves.len(),
                        solution.incident.iter().map(Vec::len).sum::<usize>()
                    ),
                    format!("{}°", published.angle),
                    sum.functions.to_string(),
                    summing.functions.to_string(),
                    times([sum.functions as f64, summing.functions as f64]),
                    published_times(published.functions),
                    sum.evaluations.to_string(),
                    summing.evaluations.to_string(),
                    times([sum.evaluations as f64, summing.evaluations as f64]),
                    published_times(published.evaluations),
                    format!("{:.2}", 1e3 * sum.seconds),
                    format!("{:.2}", 1e3 * summing.seconds),
                    times([sum.seconds, summing.seconds]),
                    times(published.seconds),
                    format!("{:.1} %", 100.0 * sum.error),
                    format!("{:.1} %", 100.0 * summing.error),
                ]);
            }
        }
    }
    Ok(())
}

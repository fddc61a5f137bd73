//! Gathering against shooting: the same light, and what it costs either way.
//!
//! The difference of the two answers is that of the mean irradiances of surface sides that are no emitters, Σ area |E − E'| /
//! Σ area E'; the same links do not come of both, as refinement looks at the light that there is.

use crate::BenchError;
use crate::args::TransportArgs;
use crate::curve::{distance, sides};
use crate::measure::cpu_seconds;
use crate::run::{Out, say};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{Rgb, Settings, Solver, Stats, Transport};
use hr_scene::{Scene, builtin};
use std::ops::ControlFlow;
use std::sync::Arc;

/// A solve by one of the two.
struct Run {
    stats: Stats,
    /// Seconds of processor time: one thread.
    cpu: f64,
    evaluations: u64,
    samples: u64,
    irradiance: Vec<(f64, Rgb)>,
}

/// Prints a Markdown table.
///
/// # Errors
/// Where a scene cannot be solved or the system gives no threads.
pub fn report(args: &TransportArgs, out: Out<'_>) -> Result<(), BenchError> {
    let all = builtin::NAMES.map(String::from);
    let names = if args.scenes.is_empty() { &all } else { args.scenes.as_slice() };
    say(
        out,
        "| scene | error asked | transport | iterations | links | links evaluated | waiting | BRDF evaluations | samples \
         reflected | transport s | reflect s | CPU s | difference over error |",
    )?;
    say(out, "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")?;
    for name in names {
        let scene = Arc::new(Scene::load(name)?);
        for &error in &args.errors {
            let gathered = solve(&scene, error, Transport::Gather)?;
            let shot = solve(&scene, error, Transport::Shoot)?;
            let difference = distance(&shot.irradiance, &gathered.irradiance) / f64::from(error);
            say(out, &row(&scene.name, error, "gather", &gathered, "-"))?;
            say(out, &row(&scene.name, error, "shoot", &shot, &format!("{difference:.3}")))?;
        }
    }
    Ok(())
}

/// Solves without values at vertices, on one thread.
fn solve(scene: &Arc<Scene>, error: f32, transport: Transport) -> Result<Run, BenchError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| BenchError::Threads(error.to_string()))?;
    pool.install(|| {
        let before = cpu_seconds();
        let field = GlossyField::new(&scene.reflectors(), Refinement::default());
        let settings = Settings { transport, ..Settings::with_error(error) };
        let mut solver = Solver::new(&scene.input(), settings, field)?;
        solver.solve(&mut |_| ControlFlow::Continue(()));
        let cpu = cpu_seconds() - before;
        let solution = solver.finish(&mut |_| ControlFlow::Break(()));
        let counters = solution.field.counters();
        Ok(Run {
            cpu,
            evaluations: counters.brdf_evaluations(),
            samples: counters.samples_reflected(),
            irradiance: sides(&solution, &solution.exitant.irradiance),
            stats: solution.stats,
        })
    })
}

fn row(name: &str, error: f32, transport: &str, run: &Run, difference: &str) -> String {
    let Run { stats, cpu, evaluations, samples, .. } = run;
    format!(
        "| {name} | {error} | {transport} | {} | {} | {} | {} | {evaluations} | {samples} | {:.3} | {:.3} | {cpu:.3} | \
         {difference} |",
        stats.iterations,
        stats.links,
        stats.links_evaluated,
        stats.skipped.shot_links,
        stats.seconds.transport,
        stats.seconds.reflect
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_are_measured_and_agree() {
        let args = TransportArgs { scenes: vec!["cornell".into(), "area-light".into()], errors: vec![0.3] };
        let mut said = Vec::new();
        report(&args, &mut said).expect("sound");
        let said = String::from_utf8(said).expect("text");
        let rows: Vec<Vec<&str>> = said.lines().map(|line| line.split('|').map(str::trim).collect()).collect();
        assert_eq!(rows.len(), 6, "a head and two scenes either way: {said}");
        assert!(rows.iter().all(|row| row.len() == 15), "as many columns everywhere: {said}");
        for shot in [&rows[3], &rows[5]] {
            let difference: f64 = shot[13].parse().expect("a number");
            assert!(difference < 0.5, "the same answer: {said}");
        }
        assert!(rows[5][8].parse::<u64>().is_ok_and(|n| n > 0), "gloss is evaluated: {said}");
    }
}

//! How right solutions are, and what they cost: a table of scenes and errors asked for.

use crate::BenchError;
use crate::compare::{Difference, compare};
use crate::run::{Out, say};
use crate::views::{Subject, View};
use hr_diffuse::Settings;
use hr_view::Mode;
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

/// Prints a Markdown table: every scene solved at every error, and every view taken in both modes.
///
/// # Errors
/// Where a scene cannot be solved, an image has infinite or NaN pixels, or nothing can be printed.
pub fn report(subjects: &[Subject], errors: &[f32], out: Out<'_>) -> Result<(), BenchError> {
    say(
        out,
        "| scene | view | error asked | solve s | links | rays | leaves | samples: block L1 | bias | distributions: \
         block L1 | bias | reference noise |",
    )?;
    say(out, "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")?;
    for subject in subjects {
        for &error in errors {
            let start = Instant::now();
            let solved = Solved::new(Arc::clone(&subject.scene), Settings::with_error(error), true, &mut |_| {
                ControlFlow::Continue(())
            })?;
            let seconds = start.elapsed().as_secs_f64();
            let stats = &solved.solution.stats;
            let (links, rays, leaves) = (stats.links, stats.rays + stats.vertex_rays, stats.leaves);
            for view in &subject.views {
                let [samples, distributions] = [Mode::Samples, Mode::Distributions].map(|m| measure(&solved, view, m));
                let (samples, distributions) = (samples?, distributions?);
                let both = |d: &Difference| format!("{:.2} % | {:+.2} %", 100.0 * d.block_l1, 100.0 * d.bias);
                let noise = samples.noise.map_or("unknown".into(), |noise| format!("{:.1} %", 100.0 * noise));
                let line = format!(
                    "| {} | {} | {error} | {seconds:.1} | {links} | {rays} | {leaves} | {} | {} | {noise} |",
                    subject.scene.name,
                    view.name,
                    both(&samples),
                    both(&distributions)
                );
                say(out, &line)?;
            }
        }
    }
    Ok(())
}

/// Takes a picture and compares it.
fn measure(solved: &Solved, view: &View, mode: Mode) -> Result<Difference, BenchError> {
    let image = RayCaster::new(&solved.scene, &solved.solution, mode).render(&view.camera, &|_| ());
    compare(&image, &view.reference, view.sigma.as_ref(), |i, _| view.keep[i])
}

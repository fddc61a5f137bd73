//! What `--stats` writes: times, counts, what was skipped and why.

use crate::ViewError;
use crate::raycast::Spared;
use crate::solved::{Accuracy, Solved};
use hr_diffuse::Spent;
use hr_scene::whole_file::write_whole;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;

/// Seconds that the solver does not know of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Times {
    /// Reading the scene.
    pub load: f64,
    /// Making triangles, pictures and frames.
    pub show: f64,
    /// From the program's start to now.
    pub total: f64,
}

/// The statistics of a solution as JSON. Phases do not overlap: `refine` is without the rays, which are `visibility`,
/// and values at vertices are part of `display`. `error` is the relative error that the solution is believed to have,
/// `asked` that which was asked for, `bias` the light that is missing (negative) or too much. `spared` is what pictures did without.
#[must_use]
pub fn stats(solved: &Solved, accuracy: Accuracy, times: &Times, spared: Spared) -> Value {
    let solution = &solved.solution;
    let (stats, seconds, skipped) = (&solution.stats, &solution.stats.seconds, &solution.stats.skipped);
    let visibility = seconds.visibility.min(seconds.refine);
    let samples: usize = solution.incident.iter().map(Vec::len).sum();
    let basis_functions: usize = solution.reflected.iter().map(|haar| haar.basis_functions()).sum();
    json!({
        "scene": solved.scene.name,
        "error": accuracy.believed,
        "error_asked": accuracy.asked,
        "bias": stats.bias,
        "seconds": {
            "load": times.load,
            "build": seconds.build,
            "refine": seconds.refine - visibility,
            "visibility": visibility,
            "transport": seconds.transport + seconds.check,
            "reflect": seconds.reflect,
            "display": seconds.reconstruct + times.show,
            "total": times.total,
        },
        "counts": {
            "polygons": stats.polygons,
            "nodes": stats.nodes,
            "leaves": stats.leaves,
            "links": stats.links,
            "links_evaluated": stats.links_evaluated,
            "renewed_places": stats.renewed_places,
            "reined_leaves": stats.reined_leaves,
            "rays": stats.rays + stats.check_rays + stats.vertex_rays,
            "check_rays": stats.check_rays,
            "vertex_rays": stats.vertex_rays,
            "pairs": stats.pairs,
            "vertices": solution.vertices.positions.len(),
            "samples": samples,
            "basis_functions": basis_functions,
            "brdf_evaluations": solution.field.counters().brdf_evaluations(),
            "brdf_clamped": solution.field.counters().clamped(),
        },
        "skipped": {
            "black_receivers": skipped.black_receivers,
            "unlit_senders": skipped.unlit_senders,
            "facing": skipped.facing,
            "proved_free": skipped.proved_free,
            "proved_blocked": skipped.proved_blocked,
            "sealed_sides": skipped.sealed_sides,
            "converged_leaves": skipped.converged_leaves,
            "steady_senders": skipped.steady_senders,
            "faint_links": skipped.faint_links,
            "spared_looks": skipped.spared_looks,
            "unseen_senders": skipped.unseen_senders,
            "inner_vertices": skipped.inner_vertices,
            "unseen_vertices": skipped.unseen_vertices,
            "unseen_leaves": skipped.unseen_leaves,
            "joined_leaves": skipped.joined_leaves,
            "dark_pixels": spared.dark_pixels,
            "even_pixels": spared.even_pixels,
            "smooth_pixels": spared.smooth_pixels,
            "half_shadows": spared.half_shadows,
            "exact_shadows": spared.exact_shadows,
            "covered_ends": spared.covered_ends,
            "known_ends": spared.known_ends,
            "seldom_ends": spared.seldom_ends,
            "shot_links": skipped.shot_links,
            "negligible_detail": solution.field.counters().negligible_detail(),
            "interpolated_samples": solution.field.counters().interpolated(),
        },
        "stopped": stats.stopped,
        "budget_spent": stats.spent.map(|spent| match spent {
            Spent::Time => "time",
            Spent::Memory => "memory",
        }),
        "solution_bytes": stats.bytes,
        "iterations": stats.iterations,
        "residuals": stats.residuals,
        "peak_bytes": peak_bytes(),
    })
}

/// The most memory that the process has had so far; `None` where the system does not tell.
#[must_use]
pub fn peak_bytes() -> Option<u64> {
    // Linux: "VmHWM:    12345 kB".
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// Writes the statistics of a solution.
pub(crate) fn write(
    path: &Path,
    solved: &Solved,
    accuracy: Accuracy,
    times: &Times,
    spared: Spared,
) -> Result<(), ViewError> {
    let stats = stats(solved, accuracy, times, spared);
    write_whole(path, |out| {
        serde_json::to_writer_pretty(&mut *out, &stats)?;
        writeln!(out)
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn peak_memory_is_that_of_the_process() {
        let before = peak_bytes().expect("Linux tells");
        // Written to, so that the pages are there.
        let block = vec![1_u8; 64 << 20];
        let after = peak_bytes().expect("Linux tells");
        assert!(block.iter().all(|&b| b == 1), "the block stays until here");
        assert!(before > 100_000 && after >= 64 << 20 && after >= before, "{before} bytes, then {after}");
    }
}

//! One diffuse solve, and what it cost.

use crate::BenchError;
use hr_diffuse::{SceneInput, Settings, Solution, Solver};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// What a solve cost, and how large its result is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Seconds of processor time, of all threads together, building the hierarchy included; values at vertices are not.
    pub cpu: f64,
    /// Seconds by the clock, of the same.
    pub wall: f64,
    /// Seconds of processor time for values at vertices.
    pub vertices: f64,
    /// Seconds by the clock, of the same.
    pub vertices_wall: f64,
    /// Seconds by the clock of the hierarchy, of refinement and of transport.
    pub phases: [f64; 3],
    /// Surfaces handed in.
    pub polygons: u64,
    /// Nodes of the hierarchy.
    pub nodes: u64,
    /// Leaves that are parts of surfaces.
    pub leaves: u64,
    /// Links.
    pub links: u64,
    /// Visibility rays of the solve.
    pub rays: u64,
    /// Bytes that nodes, their light and links take: see [`Stats::bytes`](hr_diffuse::Stats::bytes).
    pub bytes: u64,
    /// Most memory that the process had until the solve ended, values at vertices not included; 0 where unknown.
    pub peak: u64,
    /// Relative error that the solver believes the solution to have.
    pub believed: f32,
    /// Whether it was stopped because of the time.
    pub stopped: bool,
}

/// When a solve ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Nothing is refined any more after this long.
    pub limit: Option<Duration>,
    /// Whether visibility is renewed for values at vertices; if not, what links know of it is taken.
    pub vertices: bool,
}

impl Extent {
    /// All there is to do.
    pub const FULL: Self = Self { limit: None, vertices: true };
}

/// Seconds of processor time, of all threads, that the process has used; where the system does not tell, NaN.
#[must_use]
pub fn cpu_seconds() -> f64 {
    #[cfg(unix)]
    {
        seconds(rustix::time::ClockId::ProcessCPUTime)
    }
    #[cfg(not(unix))]
    f64::NAN
}

/// Seconds of processor time that this thread has used; where the system does not tell, NaN.
#[must_use]
pub fn thread_seconds() -> f64 {
    #[cfg(unix)]
    {
        seconds(rustix::time::ClockId::ThreadCPUTime)
    }
    #[cfg(not(unix))]
    f64::NAN
}

#[cfg(unix)]
fn seconds(clock: rustix::time::ClockId) -> f64 {
    let time = rustix::time::clock_gettime(clock);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Solves the diffuse light in a scene on `threads` threads (0: all cores).
///
/// # Errors
/// Where the scene cannot be solved, or the system gives no threads.
pub fn solve(input: &SceneInput, error: f32, threads: usize, extent: Extent) -> Result<(Solution, Cost), BenchError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| BenchError::Threads(error.to_string()))?;
    pool.install(|| {
        let (start, cpu) = (Instant::now(), cpu_seconds());
        let mut stopped = false;
        let mut solver = Solver::new(input, Settings::with_error(error), ())?;
        solver.solve(&mut |_| {
            if extent.limit.is_some_and(|limit| start.elapsed() > limit) {
                stopped = true;
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        let (cpu, wall) = (cpu_seconds() - cpu, start.elapsed().as_secs_f64());
        let peak = hr_view::stats::peak_bytes().unwrap_or(0);
        let (start, before) = (Instant::now(), cpu_seconds());
        let going_on = if stopped || !extent.vertices { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let solution = solver.finish(&mut |_| going_on);
        let stats = &solution.stats;
        let cost = Cost {
            cpu,
            wall,
            vertices: cpu_seconds() - before,
            vertices_wall: start.elapsed().as_secs_f64(),
            phases: [stats.seconds.build, stats.seconds.refine, stats.seconds.transport],
            polygons: stats.polygons,
            nodes: stats.nodes,
            leaves: stats.leaves,
            links: stats.links,
            rays: stats.rays,
            bytes: stats.bytes,
            peak,
            believed: stats.error.unwrap_or(f32::NAN),
            stopped,
        };
        Ok((solution, cost))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hr_scene::Scene;
    use std::sync::Arc;

    #[test]
    fn costs_are_those_of_the_solution() {
        let input = Arc::new(Scene::load("cornell").expect("built in")).input();
        let (solution, cost) = solve(&input, 0.5, 1, Extent::FULL).expect("sound");
        assert_eq!(cost.links, solution.links.all().len() as u64, "links");
        assert_eq!(cost.leaves, solution.elements.patch_leaves().count() as u64, "leaves");
        assert!(cost.bytes > 16 * cost.links && !cost.stopped, "{cost:?}");
        assert!((0.001..0.5).contains(&cost.believed), "less than what was asked for: {cost:?}");
        let at_once = Extent { limit: Some(Duration::ZERO), vertices: false };
        let (_, stopped) = solve(&input, 0.01, 1, at_once).expect("sound");
        assert!(stopped.stopped && stopped.leaves > 0, "{stopped:?}");
        assert!(solve(&input, 7.0, 1, Extent::FULL).is_err(), "no such error");
    }

    #[test]
    #[cfg(unix)]
    fn processor_time_goes_on() {
        let before = cpu_seconds();
        let sum: u64 = (0..3_000_000_u64).map(|i| std::hint::black_box(i) ^ 7).sum();
        assert!(cpu_seconds() > before && before > 0.0 && sum > 0, "time of {before} s");
    }
}

//! From a scene to its solution.

use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{Phase, Progress, Settings, Solution, SolveError, Solver};
use hr_scene::Scene;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Values at vertices after a solve that was stopped may take this much longer than the solve took, and a second.
const PATIENCE: f64 = 0.5;

/// What is wanted of a solution that is being made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// All of it.
    Whole,
    /// What there is by now.
    Now,
    /// Nothing any more, as soon as may be.
    Nothing,
}

/// How exact a solution is.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Accuracy {
    /// The relative error asked for.
    pub asked: f32,
    /// The relative error that the solution is believed to have.
    pub believed: f32,
}

/// A scene and the light in it.
#[derive(Debug)]
pub struct Solved {
    /// Geometry, materials and cameras.
    pub scene: Arc<Scene>,
    /// The light.
    pub solution: Solution<GlossyField>,
}

impl Solved {
    /// Solves for the light in a scene; makes the distributions of all glossy leaves where they are to be shown.
    /// `watch` is told how far it is; once it breaks, what there is is finished
    /// without refining any more.
    ///
    /// # Errors
    /// Where the scene makes no sense to the solver.
    pub fn new(
        scene: Arc<Scene>,
        settings: Settings,
        distributions: bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, SolveError> {
        let field = GlossyField::new(&scene.reflectors(), Refinement::default());
        let solver = Solver::new(&scene.input(), settings, field)?;
        Ok(Self::by(scene, solver, distributions, watch))
    }

    /// Goes on with what was solved before, to an error that may be smaller; the rest as for [`new`](Self::new).
    ///
    /// # Errors
    /// Where the error is out of range.
    pub fn resume(
        self,
        settings: Settings,
        distributions: bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, SolveError> {
        let solver = Solver::resume(self.solution, settings)?;
        Ok(Self::by(self.scene, solver, distributions, watch))
    }

    fn by(
        scene: Arc<Scene>,
        mut solver: Solver<GlossyField>,
        distributions: bool,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Self {
        solver.solve(watch);
        if distributions {
            solver.reflect_for_display(watch);
        }
        let solution = solver.finish(watch);
        Self { scene, solution }
    }

    /// Like [`new`](Self::new), for one who waits for it and may want it sooner: `ask` is told how far it is and says what
    /// is wanted now. Also tells how exact the solution is.
    ///
    /// # Errors
    /// Where the scene makes no sense to the solver.
    pub fn awaited(
        scene: Arc<Scene>,
        settings: Settings,
        distributions: bool,
        ask: &mut dyn FnMut(&Progress) -> Wanted,
    ) -> Result<(Self, Accuracy), SolveError> {
        Self::waiting(settings, 1.0, ask, |watch| Self::new(scene, settings, distributions, watch))
    }

    /// [`resume`](Self::resume), for as long as it is wanted, as [`awaited`](Self::awaited) does; `accuracy` is that of what was
    /// solved before.
    ///
    /// # Errors
    /// Where the error is out of range.
    pub fn resumed(
        self,
        settings: Settings,
        distributions: bool,
        accuracy: Accuracy,
        ask: &mut dyn FnMut(&Progress) -> Wanted,
    ) -> Result<(Self, Accuracy), SolveError> {
        Self::waiting(settings, accuracy.believed, ask, |watch| self.resume(settings, distributions, watch))
    }

    fn waiting(
        settings: Settings,
        mut error: f32,
        ask: &mut dyn FnMut(&Progress) -> Wanted,
        solve: impl FnOnce(&mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Result<Self, SolveError>,
    ) -> Result<(Self, Accuracy), SolveError> {
        let begin = Instant::now();
        let patient = |from: Duration| from.mul_f64(1.0 + PATIENCE) + Duration::from_secs(1);
        let time = settings.budget.time;
        let mut stopped = false;
        // When values at vertices have to be done, after a solve that was stopped.
        let mut latest = None;
        let watch = &mut |state: &Progress| {
            let now = begin.elapsed();
            let wanted = ask(state);
            stopped |= wanted != Wanted::Whole;
            let over = if wanted == Wanted::Nothing {
                true
            } else if state.phase == Phase::Reconstruct {
                let latest = *latest.get_or_insert(patient(now));
                (stopped || time.is_some_and(|time| now >= time)) && now >= latest
            } else {
                error = state.error;
                // The solver itself keeps to the budget; this is for the final reflection.
                stopped |= time.is_some_and(|time| now >= patient(time));
                stopped
            };
            if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let solved = solve(watch)?;
        let believed = solved.solution.stats.error.unwrap_or(error);
        Ok((solved, Accuracy { asked: settings.error, believed }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use glossy_ext::Lambert;

    /// The light between elements comes from what stands for many normals, however detailed curved leaves are shown.
    #[test]
    fn light_at_vertices_does_not_depend_on_what_is_shown() {
        let mut scene = Scene::load("glossy-sphere").expect("built in");
        let floor = scene.materials.iter_mut().find(|material| material.name == "floor").expect("a floor");
        floor.reflector = Arc::new(Lambert::new(Vec3::splat(0.5)).expect("a reflectance"));
        let scene = Arc::new(scene);
        let [shown, not] = [true, false].map(|distributions| {
            let watch = &mut |_: &_| ControlFlow::Continue(());
            let settings = Settings::with_error(0.3);
            Solved::new(scene.clone(), settings, distributions, watch).expect("a sound scene").solution
        });
        let [all, some] = [&shown, &not].map(|it| it.reflected.iter().filter(|light| !light.is_empty()).count());
        assert!(all > some && some > 0, "{all} leaves have distributions, {some} send light");
        assert_eq!(shown.vertices.irradiance, not.vertices.irradiance, "light at vertices");
    }
}

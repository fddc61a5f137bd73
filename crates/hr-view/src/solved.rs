//! From a scene to its solution.

use crate::seen::seen;
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{NodeId, Phase, Progress, Settings, Solution, SolveError, Solver};
use hr_scene::{Camera, Scene};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Values at vertices after a solve that was stopped may take this much longer than the solve took, and a second.
const PATIENCE: f64 = 0.5;
/// Bytes of a solver that is kept for edits: it takes as much as the solution once more.
const MOST_KEPT: u64 = 1 << 29;

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

/// What a solution is to be ready for.
#[derive(Clone, Copy, Debug)]
pub struct Purpose<'a> {
    /// Glossy leaves are shown by their distributions.
    pub distributions: bool,
    /// It is looked at from nowhere else; `None` for a walk that may lead anywhere.
    pub cameras: Option<&'a [Camera]>,
}

impl Purpose<'_> {
    fn anywhere(distributions: bool) -> Self {
        Self { distributions, cameras: None }
    }
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
        let solver = solver(&scene, settings)?;
        Ok(Self::by(scene, solver, Purpose::anywhere(distributions), watch))
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
        Ok(Self::by(self.scene, solver, Purpose::anywhere(distributions), watch))
    }

    fn by(
        scene: Arc<Scene>,
        mut solver: Solver<GlossyField>,
        purpose: Purpose<'_>,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Self {
        solver.solve(watch);
        Self::shown(scene, solver, purpose, watch)
    }

    /// Makes what has been solved ready to be looked at.
    fn shown(
        scene: Arc<Scene>,
        mut solver: Solver<GlossyField>,
        purpose: Purpose<'_>,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Self {
        let seen = purpose.cameras.map(|cameras| seen(&scene, &solver, cameras));
        let is_seen = |leaf: NodeId| seen.as_ref().is_none_or(|seen| seen[leaf.index()]);
        if purpose.distributions {
            solver.reflect_seen_for_display(&is_seen, watch);
        }
        solver.reflect_flat_senders(watch);
        let solution = solver.finish_seen(&is_seen, watch);
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
        purpose: Purpose<'_>,
        ask: &mut dyn FnMut(&Progress) -> Wanted,
    ) -> Result<(Self, Accuracy), SolveError> {
        Self::waiting(settings, 1.0, ask, |watch| {
            let solver = solver(&scene, settings)?;
            Ok(Self::by(scene, solver, purpose, watch))
        })
    }

    /// The same, and what takes over edits; nothing where it was stopped, or is too large to be kept twice.
    ///
    /// # Errors
    /// Where the scene makes no sense to the solver.
    pub(crate) fn editable(
        scene: Arc<Scene>,
        settings: Settings,
        distributions: bool,
        ask: &mut dyn FnMut(&Progress) -> Wanted,
    ) -> Result<(Self, Accuracy, Option<Editable>), SolveError> {
        let mut editable = None;
        let (solved, accuracy) = Self::waiting(settings, 1.0, ask, |watch| {
            let mut solver = solver(&scene, settings)?;
            solver.solve(watch);
            let stats = solver.stats();
            if !stats.stopped && stats.spent.is_none() && stats.bytes <= MOST_KEPT {
                editable = Some(Editable { scene: Arc::clone(&scene), solver: solver.clone() });
            }
            Ok(Self::shown(scene, solver, Purpose::anywhere(distributions), watch))
        })?;
        Ok((solved, accuracy, editable))
    }

    /// [`resume`](Self::resume), for as long as it is wanted, as [`awaited`](Self::awaited) does; `accuracy` is that of what was
    /// solved before.
    ///
    /// # Errors
    /// Where the error is out of range.
    pub fn resumed(
        self,
        settings: Settings,
        purpose: Purpose<'_>,
        accuracy: Accuracy,
        ask: &mut dyn FnMut(&Progress) -> Wanted,
    ) -> Result<(Self, Accuracy), SolveError> {
        Self::waiting(settings, accuracy.believed, ask, |watch| {
            let solver = Solver::resume(self.solution, settings)?;
            Ok(Self::by(self.scene, solver, purpose, watch))
        })
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

fn solver(scene: &Arc<Scene>, settings: Settings) -> Result<Solver<GlossyField>, SolveError> {
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    Solver::new(&scene.input(), settings, field)
}

/// A solver that has solved, and the scene as it was then.
#[derive(Debug)]
pub(crate) struct Editable {
    scene: Arc<Scene>,
    solver: Solver<GlossyField>,
}

impl Editable {
    /// Takes over other light and paint, for as long as it is wanted: see [`Solver::relight`]. Shown as soon as may be, without directional light
    /// that no link asks for.
    ///
    /// # Errors
    /// [`SolveError::Edit`] for what needs new links.
    pub(crate) fn relit(
        &mut self,
        scene: Arc<Scene>,
        settings: Settings,
        ask: &mut dyn FnMut(&Progress) -> Wanted,
    ) -> Result<(Solved, Accuracy), SolveError> {
        let before = self.scene.materials.iter().map(|material| &material.reflector);
        let same = scene.materials.iter().zip(before).all(|(now, before)| Arc::ptr_eq(&now.reflector, before));
        let field = (!same).then(|| GlossyField::new(&scene.reflectors(), Refinement::default()));
        Solved::waiting(settings, 1.0, ask, |watch| {
            self.solver.relight(&scene.input(), field, watch)?;
            self.scene = Arc::clone(&scene);
            Ok(Solved::shown(scene, self.solver.clone(), Purpose::anywhere(false), watch))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use glossy_ext::Lambert;
    use hr_scene::Material;
    use hr_scene::edits::roughened;

    #[test]
    fn edits_follow_what_was_solved() {
        let ask = &mut |_: &_| Wanted::Whole;
        let settings = Settings::with_error(0.1);
        let scene = Arc::new(Scene::load("glossy-sphere").expect("built in"));
        let (solved, _, editable) = Solved::editable(Arc::clone(&scene), settings, false, ask).expect("a sound scene");
        let mut editable = editable.expect("it is small");
        let mut edited = Scene::clone(&scene);
        let glossy = |material: &&mut Material| !material.reflector.is_diffuse();
        roughened(edited.materials.iter_mut().find(glossy).expect("one is glossy"), 2.0).expect("it can be");
        edited.materials.iter_mut().for_each(|material| material.exitance *= 0.5);
        edited.lights.iter_mut().for_each(|light| light.intensity *= 0.5);
        let edited = Arc::new(edited);
        let (relit, accuracy) = editable.relit(Arc::clone(&edited), settings, ask).expect("links serve for it");
        let fresh = Solved::new(edited, settings, false, &mut |_| ControlFlow::Continue(())).expect("a sound scene");
        let mean = |solved: &Solved| solved.solution.exitant.irradiance[0].element_sum();
        let (off, edit) = (mean(&relit) / mean(&fresh), mean(&fresh) / mean(&solved));
        assert!((off - 1.0).abs() < 0.05 && edit < 0.6, "off by a factor of {off}, by an edit of {edit}");
        assert!(accuracy.believed < 0.1, "{accuracy:?}");
        assert_eq!(relit.solution.stats.rays, solved.solution.stats.rays, "nothing is looked at again");
    }

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

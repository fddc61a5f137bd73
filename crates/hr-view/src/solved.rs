//! From a scene to its solution.

use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{Progress, Settings, Solution, SolveError, Solver};
use hr_scene::Scene;
use std::ops::ControlFlow;
use std::sync::Arc;

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
}

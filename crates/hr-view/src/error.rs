//! Why the program ends with status 1: one line that says what is wrong, where, and what would be right.

use crate::solution_file::SolutionError;
use crate::window::WindowError;
use hr_diffuse::SolveError;
use hr_scene::SceneError;

/// Everything that can go wrong.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The command line cannot be meant.
    #[error("{0}")]
    Arguments(String),
    /// The scene, a camera file or an output file is at fault.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene cannot be solved.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// A solution that was kept cannot be shown.
    #[error(transparent)]
    Solution(#[from] SolutionError),
    /// The window failed.
    #[error(transparent)]
    Window(#[from] WindowError),
}

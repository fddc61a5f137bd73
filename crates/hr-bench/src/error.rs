//! Why the program ends with status 1: one line that says what is wrong, where, and what would be right.

use hr_diffuse::{GeometryError, SolveError};
use hr_scene::SceneError;
use std::path::PathBuf;

/// Everything that can go wrong.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The command line cannot be meant.
    #[error("{0}")]
    Arguments(String),
    /// The scene, a camera or an output file is at fault.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene cannot be solved.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// A surface makes no sense. Mend: leave it out, as finished scenes do.
    #[error("surface {surface}: {source}; leave it out")]
    Surface {
        /// Its index.
        surface: usize,
        /// What is wrong with it.
        source: GeometryError,
    },
    /// A file cannot be read.
    #[error("{path}: {source}", path = path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file has other contents than it should.
    #[error("{path}: {what}; {mend}", path = path.display())]
    Format {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        what: String,
        /// What would be right.
        mend: &'static str,
    },
    /// Two images cannot be compared.
    #[error("cannot compare: {0}")]
    Compare(String),
    /// A kept solution cannot be used.
    #[error(transparent)]
    Solution(#[from] hr_view::solution_file::SolutionError),
    /// Frames cannot be drawn.
    #[error(transparent)]
    Window(#[from] hr_view::window::WindowError),
    /// A file cannot be written.
    #[error("{path}: cannot be written: {source}", path = path.display())]
    Write {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The system gives no threads.
    #[error("cannot start threads: {0}")]
    Threads(String),
    /// A process that was to solve a scene did not.
    #[error("a process of its own: {0}")]
    Process(String),
    /// Standard output is closed.
    #[error("standard output: {0}")]
    Output(std::io::Error),
}

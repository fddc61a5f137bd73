//! (in the making)

use crate::{Scene, SceneError};
use std::path::Path;

/// Reads an MGF file.
///
/// # Errors
/// Always, for now.
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    let what = "MGF files are not read yet".to_owned();
    Err(SceneError::Syntax { place: path.display().to_string(), what, mend: "use a built-in scene".to_owned() })
}

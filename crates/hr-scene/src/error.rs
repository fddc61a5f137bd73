//! Errors of scene files: what is wrong, where, and what would be right.

use crate::Warning;
use std::path::PathBuf;

/// Why a scene could not be loaded or a file not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file could not be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file's contents are wrong. `place` is file and line, or file and JSON path.
    #[error("{place}: {what}; {mend}")]
    Syntax {
        /// File and line, or file and JSON path.
        place: String,
        /// What is wrong.
        what: String,
        /// What would be right.
        mend: String,
    },
    /// There is nothing to light.
    #[error("{name}: the scene has no surface{left_out}; add at least one face or curved surface of non-zero area")]
    Empty {
        /// Scene or file name.
        name: String,
        /// What was left out and why, in brackets; or nothing.
        left_out: String,
    },
    /// Neither a file of a known kind nor a built-in scene.
    #[error("'{name}' is neither a .mgf, .gltf, .glb or .obj file nor a built-in scene; built-in scenes: {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The names of the built-in scenes.
        known: String,
    },
    /// Neither the scene nor a file has this camera.
    #[error("'{name}' is neither a camera of {scene} nor a file; the scene has {known}; give a .json file for others")]
    NoCamera {
        /// What was asked for.
        name: String,
        /// The scene's name.
        scene: String,
        /// The names of its cameras, or "none".
        known: String,
    },
    /// No surface has a material of this name.
    #[error("no surface has a material '{name}'; materials: {known}")]
    NoMaterial {
        /// What was asked for.
        name: String,
        /// Names of those that surfaces have.
        known: String,
    },
}

impl SceneError {
    /// [`Empty`](Self::Empty), and what the warnings say of why.
    pub(crate) fn empty(name: String, warnings: &[Warning]) -> Self {
        let told: Vec<_> = warnings.iter().map(|w| format!("{} ({})", w.text, w.first)).collect();
        let left_out = if told.is_empty() { String::new() } else { format!(" ({})", told.join(", ")) };
        Self::Empty { name, left_out }
    }
}

/// A word of the file in quotes, fit for one line of an error message whatever is in it.
pub(crate) fn quoted(word: &str) -> String {
    const LONGEST: usize = 40;
    let mut text: String = word.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if word.chars().nth(LONGEST).is_some() {
        text.push('…');
    }
    format!("'{text}'")
}

//! Tells when a file has changed, by looking at it now and then.

use std::path::PathBuf;
use std::time::SystemTime;

/// What tells one state of a file from another: when it was changed, and its length.
type State = Option<(SystemTime, u64)>;

/// A file that is looked at.
#[derive(Debug)]
pub(crate) struct Watched {
    path: PathBuf,
    /// As it was when it was read.
    read: State,
    /// As it was at the last look.
    last: State,
}

impl Watched {
    /// The file as it is now counts as read.
    pub(crate) fn new(path: PathBuf) -> Self {
        let state = state(&path);
        Self { path, read: state, last: state }
    }

    /// Whether the file is another one than was read, and has been for one look, so that nobody is still writing it. It
    /// counts as read then. A file that is gone has not changed: editors take it away before they bring the new one.
    pub(crate) fn has_changed(&mut self) -> bool {
        let now = state(&self.path);
        let still = now == self.last;
        self.last = now;
        let changed = still && now.is_some() && now != self.read;
        if changed {
            self.read = now;
        }
        changed
    }
}

fn state(path: &PathBuf) -> State {
    let found = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
    Some((found.modified().ok()?, found.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_told_once_and_when_it_is_over() {
        let path = std::env::temp_dir().join(format!("hr-view-watched-{}", std::process::id()));
        let write = |text: &str| std::fs::write(&path, text).expect("written");
        write("one");
        let mut watched = Watched::new(path.clone());
        assert!(!watched.has_changed(), "nothing has happened");
        write("three");
        assert!(!watched.has_changed(), "somebody may still be writing");
        write("longer");
        assert!(!watched.has_changed(), "somebody was");
        assert!(watched.has_changed(), "now it is over");
        assert!(!watched.has_changed(), "once");
        std::fs::remove_file(&path).expect("removed");
        assert!(!watched.has_changed() && !watched.has_changed(), "it is gone: nothing to read");
        write("back again");
        assert!(!watched.has_changed(), "just written");
        let changed = watched.has_changed();
        drop(std::fs::remove_file(&path));
        assert!(changed, "it is back, and another one");
    }
}

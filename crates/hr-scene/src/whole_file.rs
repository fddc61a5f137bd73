//! Files: read whole, and written whole or not at all.

use crate::SceneError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The contents of a regular file; others might never end.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    is_regular(&fs::metadata(path)?)?;
    fs::read(path)
}

fn is_regular(found: &fs::Metadata) -> io::Result<()> {
    match found {
        found if found.is_file() => Ok(()),
        found if found.is_dir() => Err(io::Error::other("this is a folder; give a file")),
        _ => Err(io::Error::other("not a regular file")),
    }
}

/// As [`read`], with an error that names the file.
pub(crate) fn read_whole(path: &Path) -> Result<Vec<u8>, SceneError> {
    read(path).map_err(|source| SceneError::Io { path: path.to_owned(), source })
}

/// The text of a file: UTF-8, or UTF-16 where it begins with that mark, without the mark. What is no text becomes U+FFFD: it can only stand
/// in names and comments.
pub(crate) fn text(bytes: &[u8]) -> String {
    let units = |bytes: &[u8], unit: fn([u8; 2]) -> u16| -> Vec<u16> {
        bytes.chunks(2).map(|pair| unit([pair[0], *pair.get(1).unwrap_or(&0)])).collect()
    };
    match bytes {
        [0xef, 0xbb, 0xbf, bytes @ ..] => String::from_utf8_lossy(bytes).into_owned(),
        [0xff, 0xfe, bytes @ ..] => String::from_utf16_lossy(&units(bytes, u16::from_le_bytes)),
        [0xfe, 0xff, bytes @ ..] => String::from_utf16_lossy(&units(bytes, u16::from_be_bytes)),
        _ => String::from_utf8_lossy(bytes).into_owned(),
    }
}

/// A regular file, opened to be read, and its length in bytes.
///
/// # Errors
/// [`SceneError::Io`] with `path` where it cannot be opened, or is no regular file.
pub fn open(path: &Path) -> Result<(File, u64), SceneError> {
    let open = || {
        let file = File::open(path)?;
        let found = file.metadata()?;
        is_regular(&found)?;
        Ok((file, found.len()))
    };
    open().map_err(|source| SceneError::Io { path: path.to_owned(), source })
}

/// Temporary files that are neither renamed nor removed yet.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes what is half written, for a program that is about to end in the middle of its work. As long as the result
/// lives, no file is begun or finished.
pub fn abandon() -> Abandoned {
    let list = unfinished();
    for path in &*list {
        // What cannot be removed stays; the program has no time left to tell.
        let _ = fs::remove_file(path);
    }
    Abandoned(list)
}

/// See [`abandon`].
#[must_use]
pub struct Abandoned(#[expect(dead_code, reason = "it is there to be held")] MutexGuard<'static, Vec<PathBuf>>);

/// Writes a file through a temporary one in the same folder, renamed when it is complete, so that nobody ever sees
/// half a file and an older one survives a failure. A symbolic link keeps pointing where it did. Where `path` is no
/// regular file (a pipe, a terminal) there is nothing to rename: it is written directly.
///
/// # Errors
/// [`SceneError::Io`] with `path` where the folder cannot be written to, the disk is full, or `fill` fails; nothing is
/// left behind then.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<(), SceneError> {
    write(path, fill).map_err(|source| SceneError::Io { path: path.to_owned(), source })
}

fn write(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let place = match fs::metadata(path) {
        Ok(there) if there.is_dir() => {
            return Err(io::Error::other("this is a folder; give a file name"));
        }
        Ok(there) if !there.is_file() => {
            let mut out = BufWriter::new(fs::OpenOptions::new().write(true).open(path)?);
            fill(&mut out)?;
            return out.flush();
        }
        Ok(_) => fs::canonicalize(path)?,
        Err(_) => path.to_owned(),
    };
    let (file, partial) = Partial::create(&place)?;
    let mut out = BufWriter::new(file);
    fill(&mut out)?;
    // Data first, name after: a crash in between must not leave an empty file under the final name.
    out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
    partial.finish(&place)
}

/// A temporary file that goes away unless it is renamed: its name is free then, and there is nothing to remove.
struct Partial(PathBuf);

impl Partial {
    /// Makes a new file beside `place`; its name is unique among threads and processes.
    fn create(place: &Path) -> io::Result<(File, Self)> {
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        let Some(name) = place.file_name() else {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "this names no file"));
        };
        loop {
            let number = COUNTER.fetch_add(1, Ordering::Relaxed);
            let mut hidden = std::ffi::OsString::from(".");
            hidden.push(name);
            hidden.push(format!(".{}-{number}.partial", std::process::id()));
            let path = place.with_file_name(hidden);
            let mut list = unfinished();
            match File::create_new(&path) {
                Ok(file) => {
                    list.push(path.clone());
                    return Ok((file, Self(path)));
                }
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(e),
            }
        }
    }

    /// Gives it its name.
    fn finish(self, place: &Path) -> io::Result<()> {
        let _held = unfinished();
        fs::rename(&self.0, place)
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        let mut list = unfinished();
        // Already failing; the first error is the one to report.
        let _ = fs::remove_file(&self.0);
        list.retain(|path| *path != self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Folder;

    #[test]
    fn failure_leaves_the_old_file_and_nothing_else() {
        let folder = Folder::new("whole-file-failure");
        let path = folder.path("a.bin");
        write_whole(&path, |out| out.write_all(b"old")).expect("a first file");
        let error = write_whole(&path, |out| {
            out.write_all(b"half of the new")?;
            Err(io::Error::other("disk full"))
        })
        .expect_err("the writer fails");
        assert!(error.to_string().ends_with("a.bin: disk full"), "'{error}' names file and cause");
        assert_eq!(fs::read(&path).expect("still there"), b"old", "the old contents survive");
        assert_eq!(folder.names(), ["a.bin"], "no partial file is left");
        write_whole(&path, |out| out.write_all(b"new")).expect("a second file");
        assert_eq!(fs::read(&path).expect("there"), b"new", "replaced");
        assert_eq!(folder.names(), ["a.bin"], "no partial file is left");
    }

    #[test]
    fn impossible_places_are_errors() {
        let folder = Folder::new("whole-file-places");
        for path in [folder.path("no/such/folder/a.bin"), folder.path(""), folder.path("x/..")] {
            write_whole(&path, |out| out.write_all(b"x")).expect_err("cannot be written");
        }
        assert!(folder.names().is_empty(), "nothing is left");
    }

    #[test]
    fn only_regular_files_are_read() {
        let folder = Folder::new("whole-file-read");
        let path = folder.path("a.bin");
        write_whole(&path, |out| out.write_all(b"all")).expect("written");
        assert_eq!(read_whole(&path).expect("there"), b"all", "its contents");
        let error = read_whole(&folder.path("")).expect_err("a folder").to_string();
        assert!(error.ends_with("this is a folder; give a file"), "'{error}'");
        if cfg!(unix) {
            let error = read(Path::new("/dev/zero")).expect_err("it has no end").to_string();
            assert_eq!(error, "not a regular file", "refused at once");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links() {
        let folder = Folder::new("whole-file-links");
        write_whole(&folder.path("real"), |out| out.write_all(b"old")).expect("a first file");
        std::os::unix::fs::symlink("real", folder.path("link")).expect("a link");
        write_whole(&folder.path("link"), |out| out.write_all(b"new")).expect("written through the link");
        assert_eq!(fs::read(folder.path("real")).expect("there"), b"new", "the target has the new contents");
        assert!(fs::symlink_metadata(folder.path("link")).expect("there").is_symlink(), "the link is still one");
    }
}

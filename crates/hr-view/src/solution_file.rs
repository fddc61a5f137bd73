//! Solution files: what `--save` keeps and `--load` looks at again.
//!
//! A head of 40 bytes, then the arrays of [`Solution::store`](hr_diffuse::Solution::store), all of it little-endian. The
//! head tells what file it is, of which version, how long, of which scene, and has a checksum of everything else, so that no
//! byte can be missing or wrong unnoticed. Geometry and materials are not in the file: they come from the scene, whose
//! [fingerprint](hr_scene::Scene::fingerprint) must be the one in the head.

use crate::solved::{Accuracy, Solved};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::Solution;
use hr_diffuse::flat::{Reader, Writer};
use hr_diffuse::keep::RestoreError;
use hr_scene::whole_file::{open, write_whole};
use hr_scene::{Scene, SceneError};
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use xxhash_rust::xxh3::Xxh3;

/// What the file begins with. Written in the machine's byte order: on a big-endian machine files of others are unknown.
const MAGIC: u64 = u64::from_le_bytes(*b"hr-light");

/// Counts up with every change of what the arrays are or mean.
const VERSION: u64 = 11;

/// Why a solution cannot be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolutionError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] SceneError),
    /// It is something else.
    #[error("{path} is no solution; give --load a file that --save wrote")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// It is a solution as other versions of the program write it.
    #[error("{path} has version {found} of the format, this program reads version {VERSION}; save the solution again")]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u64,
    },
    /// It is not the whole file, or more than that.
    #[error("{path} has {found} bytes where {expected} were written; copy it again, or save the solution again")]
    Length {
        /// The file.
        path: PathBuf,
        /// Its length in bytes.
        found: u64,
        /// The length in its head.
        expected: u64,
    },
    /// It has changed since it was written.
    #[error("{path} is damaged: its checksum is wrong; copy it again, or save the solution again")]
    Checksum {
        /// The file.
        path: PathBuf,
    },
    /// The scene is another one, or has changed.
    #[error("{path} holds the light of another scene than {scene}, or of an older state of it; solve it again")]
    OtherScene {
        /// The file.
        path: PathBuf,
        /// The scene.
        scene: String,
    },
    /// What it says contradicts itself or the scene, though its checksum is right.
    #[error("{path} cannot be used: {source}; save the solution again")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: RestoreError,
    },
}

/// What the file begins with.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Head {
    magic: u64,
    version: u64,
    /// Of the whole file, in bytes.
    length: u64,
    /// Fingerprint of the scene.
    scene: u64,
    /// XXH3, 64 bits, of what follows and then of the head up to here.
    checksum: u64,
}

/// Files are read in pieces of so many bytes, which the processor's caches hold, and so many of them ahead.
const PIECE: usize = 1 << 17;
const AHEAD: usize = 4;

impl Head {
    /// The checksum, that of what follows the head being known.
    fn sealed(self, mut body: Xxh3) -> Self {
        body.update(bytemuck::bytes_of(&[self.magic, self.version, self.length, self.scene]));
        Self { checksum: body.digest(), ..self }
    }
}

/// Length and checksum of what is written to it.
#[derive(Default)]
struct Measure {
    length: u64,
    sum: Xxh3,
}

impl Write for Measure {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.length += bytes.len() as u64;
        self.sum.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes a solution, all of it or nothing.
///
/// # Errors
/// Where the file cannot be written.
pub fn save(path: &Path, solved: &Solved, accuracy: Accuracy) -> Result<(), SceneError> {
    let store = |out: &mut dyn Write| {
        let mut out = Writer::new(out);
        out.put(&[accuracy])?;
        solved.solution.store(&mut out)
    };
    write_whole(path, |out| {
        let mut measure = Measure::default();
        store(&mut measure)?;
        let length = size_of::<Head>() as u64 + measure.length;
        let head = Head { magic: MAGIC, version: VERSION, length, scene: solved.scene.fingerprint(), checksum: 0 };
        out.write_all(bytemuck::bytes_of(&head.sealed(measure.sum)))?;
        store(out)
    })
}

/// Reads the solution of a scene, and how exact it is.
///
/// # Errors
/// [`SolutionError`]: anything but what [`save`] wrote for this very scene.
pub fn load(path: &Path, scene: Arc<Scene>) -> Result<(Solved, Accuracy), SolutionError> {
    let at = || path.to_path_buf();
    let broken = |source| SolutionError::File(SceneError::Io { path: at(), source });
    let (mut file, found) = open(path)?;
    let mut head = [0; size_of::<Head>()];
    let head: Head = match file.read_exact(&mut head) {
        Ok(()) => bytemuck::pod_read_unaligned(&head),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
            return Err(SolutionError::Foreign { path: at() });
        }
        Err(error) => return Err(broken(error)),
    };
    if head.magic != MAGIC {
        return Err(SolutionError::Foreign { path: at() });
    }
    if head.version != VERSION {
        return Err(SolutionError::Version { path: at(), found: head.version });
    }
    if head.length != found {
        return Err(SolutionError::Length { path: at(), found, expected: head.length });
    }
    let (pieces, ahead) = sync_channel(AHEAD);
    let (used, again) = channel();
    // What is damaged can be read as safely as what is forged: while one thread reads and sums, another restores.
    let (restored, sum, is_its_own) = std::thread::scope(|scope| {
        let reading = scope.spawn(move || read_ahead(file, &pieces, &again));
        let owned = scope.spawn(|| head.scene == scene.fingerprint());
        let mut body = Ahead { pieces: ahead, used, piece: Vec::new(), at: 0 };
        let restored = restore(&scene, &mut Reader::new(&mut body, found - size_of::<Head>() as u64));
        drop(body);
        let failed = || io::Error::other("a thread that read it failed");
        let sum = reading.join().unwrap_or_else(|_| Err(failed()));
        (restored, sum, owned.join().unwrap_or(false))
    });
    if head.sealed(sum.map_err(broken)?).checksum != head.checksum {
        return Err(SolutionError::Checksum { path: at() });
    }
    if !is_its_own {
        return Err(SolutionError::OtherScene { path: at(), scene: scene.name.clone() });
    }
    let (solution, accuracy) = restored.map_err(|source| SolutionError::Content { path: at(), source })?;
    Ok((Solved { scene, solution }, accuracy))
}

/// Hands on a file in pieces, as long as somebody takes them, and sums all of it.
fn read_ahead(mut file: File, pieces: &SyncSender<Vec<u8>>, again: &Receiver<Vec<u8>>) -> io::Result<Xxh3> {
    let mut sum = Xxh3::new();
    loop {
        let mut piece = again.try_recv().unwrap_or_default();
        piece.resize(PIECE, 0);
        let length = match file.read(&mut piece) {
            Ok(0) => return Ok(sum),
            Ok(length) => length,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        piece.truncate(length);
        sum.update(&piece);
        // Where nobody wants more of it, the sum is still to be known.
        drop(pieces.send(piece));
    }
}

/// Reads what another thread has read.
struct Ahead {
    pieces: Receiver<Vec<u8>>,
    used: Sender<Vec<u8>>,
    piece: Vec<u8>,
    at: usize,
}

impl Read for Ahead {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.at == self.piece.len() {
            // None come any more: this is the end.
            let Ok(next) = self.pieces.recv() else { return Ok(0) };
            drop(self.used.send(std::mem::replace(&mut self.piece, next)));
            self.at = 0;
        }
        let length = (&self.piece[self.at..]).read(out)?;
        self.at += length;
        Ok(length)
    }
}

fn restore(scene: &Arc<Scene>, from: &mut Reader<'_>) -> Result<(Solution<GlossyField>, Accuracy), RestoreError> {
    let [accuracy] = from.take_exactly("accuracy")?;
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    let solution = Solution::restore(&scene.input(), field, from)?;
    from.end()?;
    Ok((solution, accuracy))
}

#[cfg(test)]
mod tests;

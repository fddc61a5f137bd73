//! Solution files: what `--save` keeps and `--load` looks at again.
//!
//! A head of 48 bytes, a table, and parts, all of it little-endian. The head tells what file it is, of which version, how long,
//! of which scene, and how many parts it has; the table how long each of these is, and its checksum; the head has one of
//! itself and the table, so that no byte can be missing or wrong unnoticed. The parts are the arrays of
//! [`Solution::store`](hr_diffuse::Solution::store) and, in runs that threads read side by side, of
//! [`Solution::store_light`](hr_diffuse::Solution::store_light). Geometry and materials are not in the file: they come from the
//! scene, whose [fingerprint](hr_scene::Scene::fingerprint) must be the one in the head.

use crate::solved::{Accuracy, Solved};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::Solution;
use hr_diffuse::flat::{FlatError, Reader, Writer};
use hr_diffuse::keep::RestoreError;
use hr_scene::whole_file::{open, write_whole};
use hr_scene::{Scene, SceneError};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Take, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use xxhash_rust::xxh3::Xxh3;

/// What the file begins with. Written in the machine's byte order: on a big-endian machine files of others are unknown.
const MAGIC: u64 = u64::from_le_bytes(*b"hr-light");

/// Counts up with every change of what the arrays are or mean.
const VERSION: u64 = 20;

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
    parts: u64,
    /// XXH3, 64 bits, of the head up to here and of the table.
    checksum: u64,
}

impl Head {
    /// With the checksum.
    fn sealed(self, table: &[Part]) -> Self {
        let mut sum = Xxh3::new();
        sum.update(bytemuck::bytes_of(&[self.magic, self.version, self.length, self.scene, self.parts]));
        sum.update(bytemuck::cast_slice(table));
        Self { checksum: sum.digest(), ..self }
    }
}

/// What the table says of a part.
#[derive(Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Part {
    /// In bytes.
    length: u64,
    /// XXH3, 64 bits.
    checksum: u64,
}

/// The extension's light is kept in so many runs.
const RUNS: usize = 16;

/// No file has more parts.
const MOST_PARTS: u64 = 1 << 10;

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
    let solution = &solved.solution;
    let store = |part: usize, out: &mut dyn Write| {
        let mut out = Writer::new(out);
        match part.checked_sub(1) {
            None => {
                out.put(&[accuracy])?;
                solution.store(&mut out)
            }
            Some(run) => solution.store_light(run, RUNS, &mut out),
        }
    };
    write_whole(path, |out| {
        let table = (0..=RUNS).map(|part| {
            let mut measure = Measure::default();
            store(part, &mut measure)?;
            Ok(Part { length: measure.length, checksum: measure.sum.digest() })
        });
        let table = table.collect::<io::Result<Vec<Part>>>()?;
        let before = size_of::<Head>() + size_of_val(table.as_slice());
        let length = before as u64 + table.iter().map(|part| part.length).sum::<u64>();
        let (scene, parts) = (solved.scene.fingerprint(), table.len() as u64);
        let head = Head { magic: MAGIC, version: VERSION, length, scene, parts, checksum: 0 };
        out.write_all(bytemuck::bytes_of(&head.sealed(&table)))?;
        out.write_all(bytemuck::cast_slice(&table))?;
        (0..=RUNS).try_for_each(|part| store(part, out))
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
    let damaged = || SolutionError::Checksum { path: at() };
    let table = read_table(&mut file, head).map_err(broken)?.ok_or_else(damaged)?;
    let mut start = (size_of::<Head>() + size_of_val(table.as_slice())) as u64;
    let parts = table.iter().map(|part| {
        let summed = Summed::new(path, start, part.length);
        start += part.length;
        summed
    });
    let mut parts = parts.collect::<Result<Vec<_>, SceneError>>()?;
    // What is damaged can be read as safely as what is forged: the sums are known at the end.
    let restored = restore(&scene, &mut parts);
    for (part, found) in table.iter().zip(parts) {
        if found.finish().map_err(broken)? != *part {
            return Err(damaged());
        }
    }
    if head.scene != scene.fingerprint() {
        return Err(SolutionError::OtherScene { path: at(), scene: scene.name.clone() });
    }
    let (solution, accuracy) = restored.map_err(|source| SolutionError::Content { path: at(), source })?;
    Ok((Solved { scene, solution }, accuracy))
}

/// The table of parts, or nothing where it, or the head, is not what was written.
fn read_table(file: &mut File, head: Head) -> io::Result<Option<Vec<Part>>> {
    let mut table = vec![Part { length: 0, checksum: 0 }; head.parts.clamp(1, MOST_PARTS) as usize];
    let bytes = bytemuck::cast_slice_mut(&mut table);
    match file.read_exact(bytes) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        read => read?,
    }
    let before = (size_of::<Head>() + bytes.len()) as u64;
    let length = table.iter().try_fold(before, |sum, part| sum.checked_add(part.length));
    let are_right = head.sealed(&table).checksum == head.checksum && length == Some(head.length);
    Ok((are_right && head.parts == table.len() as u64).then_some(table))
}

/// Part of a file, summed while it is read.
struct Summed {
    from: Take<File>,
    length: u64,
    sum: Xxh3,
}

impl Summed {
    /// So many bytes of a file.
    fn new(path: &Path, start: u64, length: u64) -> Result<Self, SceneError> {
        let (mut file, _) = open(path)?;
        let place = file.seek(SeekFrom::Start(start));
        place.map_err(|source| SceneError::Io { path: path.to_path_buf(), source })?;
        Ok(Self { from: file.take(length), length, sum: Xxh3::new() })
    }

    /// What there is of it, read before or not.
    fn finish(mut self) -> io::Result<Part> {
        io::copy(&mut self, &mut io::sink())?;
        Ok(Part { length: self.length - self.from.limit(), checksum: self.sum.digest() })
    }
}

impl Read for Summed {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let length = self.from.read(out)?;
        self.sum.update(&out[..length]);
        Ok(length)
    }
}

fn restore(scene: &Arc<Scene>, parts: &mut [Summed]) -> Result<(Solution<GlossyField>, Accuracy), RestoreError> {
    let mut parts: Vec<Reader<'_>> = parts
        .iter_mut()
        .map(|part| {
            let length = part.length;
            Reader::new(part, length)
        })
        .collect();
    let (own, light) = parts.split_first_mut().ok_or(FlatError::Ends("parts"))?;
    let [accuracy] = own.take_exactly("accuracy")?;
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    let solution = Solution::restore(&scene.input(), field, own, light)?;
    parts.iter().try_for_each(Reader::end)?;
    Ok((solution, accuracy))
}

#[cfg(test)]
mod tests;

//! The file format of the MERL BRDF database.

use super::Tabulated;
use hr_diffuse::Rgb;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Why bytes are no measured BRDF.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MerlError {
    /// The file could not be read. Mend: see that it exists and may be read.
    #[error("{path}: {source}")]
    Io {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// There is not even a header. Mend: give a whole file of the database.
    #[error("{length} bytes are no MERL BRDF: its header alone has 12 (three 32-bit sizes, little-endian)")]
    NoHeader {
        /// Bytes given.
        length: u64,
    },
    /// The sizes in the header make no sense. Mend: give a binary file of the database, of little-endian numbers.
    #[error(
        "the header says {} × {} × {} entries, but a MERL BRDF has 90 × 90 × 180, and none of the sizes is below 2 or \
         above 1024; is it a file of another kind?", size[0], size[1], size[2]
    )]
    Size {
        /// Sizes in the header: angles of the half vector, of the difference vector, azimuths of the latter.
        size: [i32; 3],
    },
    /// There are more or fewer bytes than the header says. Mend: fetch the file again, as a binary file.
    #[error("the header says {expected} bytes, but there are {length}; is the file incomplete?")]
    Length {
        /// Bytes that there are.
        length: u64,
        /// Bytes that there should be.
        expected: u64,
    },
}

/// Bytes of the header.
const HEADER: usize = 12;
/// What the file's numbers are multiplied by, per channel.
const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// The sizes in a header, if they suit the file's length.
fn sizes(header: [u8; HEADER], length: u64) -> Result<[usize; 3], MerlError> {
    let size: [i32; 3] = bytemuck::cast::<_, [[u8; 4]; 3]>(header).map(i32::from_le_bytes);
    if size.iter().any(|s| !(2..=1024).contains(s)) {
        return Err(MerlError::Size { size });
    }
    let expected = HEADER as u64 + size.iter().map(|&s| u64::from(s.unsigned_abs())).product::<u64>() * 24;
    if length == expected { Ok(size.map(|s| s as usize)) } else { Err(MerlError::Length { length, expected }) }
}

impl Tabulated {
    /// From the bytes of a file of the MERL database (Matusik, Pfister, Brand, McMillan, "A Data-Driven Reflectance
    /// Model", SIGGRAPH 2003): three 32-bit sizes, then for red, green and blue the values as 64-bit numbers, azimuths of
    /// the difference vector innermost, all little-endian. Other sizes than the database's 90 × 90 × 180 are taken, too.
    ///
    /// # Errors
    /// [`MerlError`] where the header makes no sense or does not suit the length. Entries that are negative or no numbers
    /// are mended and [counted](Self::mended), not refused: files of the database have many at grazing angles.
    pub fn from_merl(bytes: &[u8]) -> Result<Self, MerlError> {
        let length = bytes.len() as u64;
        let (header, values) = bytes.split_first_chunk().ok_or(MerlError::NoHeader { length })?;
        let size = sizes(*header, length)?;
        let numbers = values.as_chunks().0;
        let count = numbers.len() / 3;
        let channel = |c: usize, k: usize| (f64::from_le_bytes(numbers[c * count + k]) * SCALE[c]) as f32;
        let values = (0..count).map(|k| Rgb::new(channel(0, k), channel(1, k), channel(2, k)));
        Ok(Self::new(size, values.collect()))
    }

    /// From a file of the MERL database; see [`from_merl`](Self::from_merl).
    ///
    /// # Errors
    /// [`MerlError`] where it cannot be read, or is something else. The header is looked at first, so that nothing large
    /// is read in vain.
    pub fn read_merl(path: impl AsRef<Path>) -> Result<Self, MerlError> {
        let path = path.as_ref();
        let failed = |source| MerlError::Io { path: path.to_owned(), source };
        let mut file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        if length < HEADER as u64 {
            return Err(MerlError::NoHeader { length });
        }
        let mut header = [0; HEADER];
        file.read_exact(&mut header).map_err(failed)?;
        sizes(header, length)?;
        let mut bytes = header.to_vec();
        file.read_to_end(&mut bytes).map_err(failed)?;
        Self::from_merl(&bytes)
    }
}

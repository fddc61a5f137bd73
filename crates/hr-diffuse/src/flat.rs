//! Flat arrays one after the other: what a solution is kept as. Of each array there is the number of its entries (8 bytes),
//! then the entries as they are in memory, then zeros up to a multiple of 8 bytes, so that every array can be used where it
//! lies. Numbers have the machine's own byte order: whoever writes files says in their heads which one that is.
//!
//! ```
//! use hr_diffuse::flat::{Reader, Writer};
//!
//! let mut file = Vec::new();
//! Writer::new(&mut file).put(&[1.0_f32, 2.0, 3.0])?;
//! let words: Vec<u64> = file.chunks_exact(8).map(|w| u64::from_ne_bytes(w.try_into().unwrap())).collect();
//! assert_eq!(Reader::new(&words).take::<f32>("numbers")?, [1.0, 2.0, 3.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use bytemuck::{CheckedBitPattern, NoUninit, Pod};
use std::io::{self, Write};

/// Arrays begin at multiples of so many bytes.
const ALIGN: usize = size_of::<u64>();

/// Why arrays cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FlatError {
    /// There is less than there should be.
    #[error("it ends before the end of its {0}")]
    Ends(&'static str),
    /// Values that nothing can have, or that contradict others.
    #[error("its {0} make no sense together with the rest of it")]
    Misfit(&'static str),
    /// There is more than there should be.
    #[error("it goes on after its end")]
    GoesOn,
}

/// [`FlatError::Misfit`] unless something holds of an array.
///
/// # Errors
/// Where it does not.
pub fn fits(holds: bool, what: &'static str) -> Result<(), FlatError> {
    if holds { Ok(()) } else { Err(FlatError::Misfit(what)) }
}

/// Whether all of an array of structures of `f32` are finite.
pub(crate) fn is_finite<T: Pod>(array: &[T]) -> bool {
    bytemuck::try_cast_slice::<T, f32>(array).is_ok_and(|numbers| numbers.iter().all(|x| x.is_finite()))
}

/// Writes arrays.
pub struct Writer<'a>(&'a mut dyn Write);

impl<'a> Writer<'a> {
    /// To a file, or whatever else takes bytes.
    pub fn new(out: &'a mut dyn Write) -> Self {
        Self(out)
    }

    /// Writes an array.
    ///
    /// # Errors
    /// Those of what it writes to.
    pub fn put<T: NoUninit>(&mut self, array: &[T]) -> io::Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(array);
        self.0.write_all(&(array.len() as u64).to_ne_bytes())?;
        self.0.write_all(bytes)?;
        self.0.write_all(&[0; ALIGN][..bytes.len().next_multiple_of(ALIGN) - bytes.len()])
    }
}

/// Reads arrays in the order in which they were written. `what` they are is for errors.
pub struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    /// From what a [`Writer`] wrote.
    #[must_use]
    pub fn new(words: &'a [u64]) -> Self {
        Self(bytemuck::cast_slice(words))
    }

    /// Reads an array.
    ///
    /// # Errors
    /// Where there is less left than it says, or bytes are no `T`.
    pub fn take<T: CheckedBitPattern + 'a>(&mut self, what: &'static str) -> Result<Vec<T>, FlatError> {
        self.view(what).map(<[T]>::to_vec)
    }

    /// Looks at an array where it lies.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    pub fn view<T: CheckedBitPattern>(&mut self, what: &'static str) -> Result<&'a [T], FlatError> {
        let ends = || FlatError::Ends(what);
        let (count, rest) = self.0.split_first_chunk().ok_or_else(ends)?;
        let count = usize::try_from(u64::from_ne_bytes(*count)).ok();
        let bytes = count.and_then(|count| count.checked_mul(size_of::<T>())).ok_or_else(ends)?;
        let padded = bytes.checked_next_multiple_of(ALIGN).ok_or_else(ends)?;
        let (array, rest) = rest.split_at_checked(padded).ok_or_else(ends)?;
        self.0 = rest;
        bytemuck::checked::try_cast_slice(&array[..bytes]).map_err(|_| FlatError::Misfit(what))
    }

    /// Reads an array of structures of `f32`, all of them finite.
    ///
    /// # Errors
    /// As [`take`](Self::take), and where one is not.
    pub fn take_finite<T: Pod>(&mut self, what: &'static str) -> Result<Vec<T>, FlatError> {
        let array = self.take(what)?;
        fits(is_finite(&array), what)?;
        Ok(array)
    }

    /// Reads an array of a known length.
    ///
    /// # Errors
    /// As [`take`](Self::take), and where it has another one.
    pub fn take_exactly<T: Pod, const N: usize>(&mut self, what: &'static str) -> Result<[T; N], FlatError> {
        self.take(what)?.try_into().map_err(|_| FlatError::Misfit(what))
    }

    /// Whether all has been read.
    ///
    /// # Errors
    /// [`FlatError::GoesOn`] where something is left.
    pub fn end(&self) -> Result<(), FlatError> {
        if self.0.is_empty() { Ok(()) } else { Err(FlatError::GoesOn) }
    }
}

/// Whether `offsets` divide an array of this length into so many groups: `offsets[g]..offsets[g + 1]` is the g-th one.
pub(crate) fn are_offsets(offsets: &[u32], groups: usize, length: usize) -> bool {
    offsets.len() == groups + 1
        && offsets.first() == Some(&0)
        && offsets.last().is_some_and(|&last| last as usize == length)
        && offsets.is_sorted()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(fill: impl FnOnce(&mut Writer<'_>) -> io::Result<()>) -> Vec<u64> {
        let mut bytes = Vec::new();
        fill(&mut Writer::new(&mut bytes)).expect("memory takes everything");
        bytemuck::pod_collect_to_vec(&bytes)
    }

    #[test]
    fn arrays_of_any_size_come_back() {
        for length in 0..20_u8 {
            let bytes: Vec<u8> = (0..length).collect();
            let flags: Vec<bool> = bytes.iter().map(|b| b % 3 == 0).collect();
            let words = written(|out| {
                out.put(&bytes)?;
                out.put(&flags)?;
                out.put(&[0.5_f64])
            });
            let mut reader = Reader::new(&words);
            assert_eq!(reader.take::<u8>("bytes").as_ref(), Ok(&bytes), "{length} bytes");
            assert_eq!(reader.take::<bool>("flags"), Ok(flags), "{length} flags");
            assert_eq!(reader.end(), Err(FlatError::GoesOn), "there is one more");
            assert_eq!(reader.take_exactly("number"), Ok([0.5_f64]), "the number after them");
            assert_eq!(reader.end(), Ok(()), "that was all");
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let words = written(|out| out.put(&[1_u8, 2, 3]));
        assert_eq!(Reader::new(&words).take::<bool>("flags"), Err(FlatError::Misfit("flags")), "2 is no flag");
        assert_eq!(Reader::new(&words).take_exactly::<u8, 2>("pair"), Err(FlatError::Misfit("pair")), "three");
        assert_eq!(Reader::new(&words).take_finite::<u8>("bytes"), Err(FlatError::Misfit("bytes")), "no f32");
        let words = written(|out| out.put(&[1.0, f32::NAN]));
        assert_eq!(Reader::new(&words).take_finite::<f32>("light"), Err(FlatError::Misfit("light")), "no number");
        for words in [&words[..1], &[], &[u64::MAX, 0], &[u64::MAX / 4, 0], &[1 << 61, 0]] {
            assert_eq!(Reader::new(words).take::<f32>("light"), Err(FlatError::Ends("light")), "{words:?}");
        }
    }
}

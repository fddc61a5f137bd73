//! Flat arrays one after the other: what a solution is kept as. Of each array there is the number of its entries (8 bytes),
//! then the entries as they are in memory, then zeros up to a multiple of 8 bytes. Numbers have the machine's own byte order: whoever writes files says in their heads which one that is.
//!
//! ```
//! use hr_diffuse::flat::{Reader, Writer};
//!
//! let mut file = Vec::new();
//! Writer::new(&mut file).put(&[1.0_f32, 2.0, 3.0])?;
//! assert_eq!(Reader::new(&mut file.as_slice(), file.len() as u64).take::<f32>("numbers")?, [1.0, 2.0, 3.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use bytemuck::{CheckedBitPattern, NoUninit, Pod};
use std::io::{self, Read, Write};

/// Arrays begin at multiples of so many bytes.
const ALIGN: usize = size_of::<u64>();

/// Arrays are read in pieces of about so many bytes, which the processor's caches hold: so the memory of an array is touched
/// once, when what has been checked of it is written there.
const PIECE: usize = 1 << 16;

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
pub struct Reader<'a> {
    from: &'a mut (dyn Read + Send),
    /// Bytes that are left.
    left: u64,
    /// A piece of an array, aligned.
    piece: Vec<u128>,
}

impl<'a> Reader<'a> {
    /// From what a [`Writer`] wrote: so many bytes.
    #[must_use]
    pub fn new(from: &'a mut (dyn Read + Send), bytes: u64) -> Self {
        Self { from, left: bytes, piece: vec![0; PIECE / size_of::<u128>()] }
    }

    /// Reads an array.
    ///
    /// # Errors
    /// Where there is less left than it says, or bytes are no `T`.
    pub fn take<T: CheckedBitPattern>(&mut self, what: &'static str) -> Result<Vec<T>, FlatError> {
        let mut array = Vec::new();
        self.pieces(what, |count, piece: &[T]| {
            array.reserve_exact(count - array.len());
            array.extend_from_slice(piece);
            Ok(())
        })?;
        Ok(array)
    }

    /// Reads an array as groups of these lengths, one after the other.
    ///
    /// # Errors
    /// As [`take`](Self::take), and where lengths do not add up to that of the array.
    pub fn take_groups<T: CheckedBitPattern>(
        &mut self,
        lengths: impl IntoIterator<Item = u32>,
        what: &'static str,
    ) -> Result<Vec<Vec<T>>, FlatError> {
        let mut lengths = lengths.into_iter().map(|length| length as usize);
        let mut groups: Vec<Vec<T>> = Vec::with_capacity(lengths.size_hint().0);
        // Entries that the last group still lacks, and the array after it.
        let mut lacks = 0;
        let mut unread = None;
        self.pieces(what, |count, mut piece: &[T]| {
            let unread = unread.get_or_insert(count);
            loop {
                let (taken, after) = piece.split_at(lacks.min(piece.len()));
                if let Some(group) = groups.last_mut() {
                    group.extend_from_slice(taken);
                }
                (lacks, piece) = (lacks - taken.len(), after);
                *unread -= taken.len();
                if piece.is_empty() {
                    return Ok(());
                }
                lacks = lengths.next().filter(|length| *length <= *unread).ok_or(FlatError::Misfit(what))?;
                groups.push(Vec::with_capacity(lacks));
            }
        })?;
        // Groups after the last entry are empty.
        let whole = lacks == 0
            && lengths.all(|length| {
                groups.push(Vec::new());
                length == 0
            });
        fits(whole, what)?;
        Ok(groups)
    }

    /// Hands on an array in pieces, each with the number of entries of all of it.
    fn pieces<T: CheckedBitPattern>(
        &mut self,
        what: &'static str,
        mut with: impl FnMut(usize, &[T]) -> Result<(), FlatError>,
    ) -> Result<(), FlatError> {
        let ends = || FlatError::Ends(what);
        let mut count = [0_u64];
        self.fill(bytemuck::bytes_of_mut(&mut count), what)?;
        let count = usize::try_from(count[0]).map_err(|_| ends())?;
        let bytes = count.checked_mul(size_of::<T>()).ok_or_else(ends)?;
        // Known before any memory is asked for.
        if bytes.checked_next_multiple_of(ALIGN).is_none_or(|padded| padded as u64 > self.left) {
            return Err(ends());
        }
        // Of what has no size there could be any number.
        let most = PIECE.checked_div(size_of::<T>()).ok_or(FlatError::Misfit(what))?.max(1);
        let mut space = std::mem::take(&mut self.piece);
        space.resize(space.len().max((most * size_of::<T>()).div_ceil(size_of::<u128>())), 0);
        let mut done = 0;
        while done < count {
            let next = most.min(count - done);
            let piece = &mut bytemuck::cast_slice_mut::<u128, u8>(&mut space)[..next * size_of::<T>()];
            self.fill(piece, what)?;
            with(count, bytemuck::checked::try_cast_slice(piece).map_err(|_| FlatError::Misfit(what))?)?;
            done += next;
        }
        self.piece = space;
        let mut zeros = [0; ALIGN];
        self.fill(&mut zeros[..bytes.next_multiple_of(ALIGN) - bytes], what)
    }

    fn fill(&mut self, bytes: &mut [u8], what: &'static str) -> Result<(), FlatError> {
        let ends = |_| FlatError::Ends(what);
        self.left = self.left.checked_sub(bytes.len() as u64).ok_or(FlatError::Ends(what))?;
        self.from.read_exact(bytes).map_err(ends)
    }

    /// Reads an array of structures of `f32`, all of them finite.
    ///
    /// # Errors
    /// As [`take`](Self::take), and where one is not.
    pub fn take_finite<T: Pod>(&mut self, what: &'static str) -> Result<Vec<T>, FlatError> {
        let mut array = Vec::new();
        self.pieces(what, |count, piece: &[T]| {
            fits(is_finite(piece), what)?;
            array.reserve_exact(count - array.len());
            array.extend_from_slice(piece);
            Ok(())
        })?;
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
        if self.left == 0 { Ok(()) } else { Err(FlatError::GoesOn) }
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

    fn written(fill: impl FnOnce(&mut Writer<'_>) -> io::Result<()>) -> Vec<u8> {
        let mut bytes = Vec::new();
        fill(&mut Writer::new(&mut bytes)).expect("memory takes everything");
        bytes
    }

    fn read<T>(bytes: &[u8], take: impl FnOnce(&mut Reader<'_>) -> T) -> T {
        take(&mut Reader::new(&mut { bytes }, bytes.len() as u64))
    }

    #[test]
    fn arrays_of_any_size_come_back() {
        for length in 0..20_u8 {
            let bytes: Vec<u8> = (0..length).collect();
            let flags: Vec<bool> = bytes.iter().map(|b| b % 3 == 0).collect();
            let all = written(|out| {
                out.put(&bytes)?;
                out.put(&flags)?;
                out.put(&[0.5_f64])
            });
            let mut from = all.as_slice();
            let mut reader = Reader::new(&mut from, all.len() as u64);
            assert_eq!(reader.take::<u8>("bytes").as_ref(), Ok(&bytes), "{length} bytes");
            assert_eq!(reader.take::<bool>("flags"), Ok(flags), "{length} flags");
            assert_eq!(reader.end(), Err(FlatError::GoesOn), "there is one more");
            assert_eq!(reader.take_exactly("number"), Ok([0.5_f64]), "the number after them");
            assert_eq!(reader.end(), Ok(()), "that was all");
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let bytes = written(|out| out.put(&[1_u8, 2, 3]));
        assert_eq!(read(&bytes, |from| from.take::<bool>("flags")), Err(FlatError::Misfit("flags")), "2 is no flag");
        assert_eq!(read(&bytes, |from| from.take_exactly::<u8, 2>("pair")), Err(FlatError::Misfit("pair")), "three");
        assert_eq!(read(&bytes, |from| from.take_finite::<u8>("bytes")), Err(FlatError::Misfit("bytes")), "no f32");
        let bytes = written(|out| out.put(&[1.0, f32::NAN]));
        assert_eq!(read(&bytes, |from| from.take_finite::<f32>("light")), Err(FlatError::Misfit("light")), "no number");
        for words in [&[2_u64][..], &[], &[u64::MAX, 0], &[u64::MAX / 4, 0], &[1 << 61, 0]] {
            let found = read(bytemuck::cast_slice(words), |from| from.take::<f32>("light"));
            assert_eq!(found, Err(FlatError::Ends("light")), "{words:?}");
        }
        // What is read from ends sooner than it was said to.
        let mut short = &bytes[..8];
        let found = Reader::new(&mut short, bytes.len() as u64).take::<f32>("light");
        assert_eq!(found, Err(FlatError::Ends("light")), "cut off");
    }

    #[test]
    fn groups_come_back() {
        let numbers: Vec<u16> = (0..=u16::MAX).cycle().take(PIECE).collect();
        let bytes = written(|out| out.put(&numbers));
        let rest = numbers.len() as u32 - 9;
        for lengths in [vec![0, 4, 0, 5, rest, 0, 0], vec![rest, 9], vec![1; numbers.len()]] {
            let groups = read(&bytes, |from| from.take_groups::<u16>(lengths.iter().copied(), "groups"));
            let groups = groups.expect("they add up");
            assert!(groups.iter().map(Vec::len).eq(lengths.iter().map(|n| *n as usize)), "their lengths");
            assert!(groups.concat() == numbers, "what is in them");
        }
        for lengths in [vec![], vec![4, 4], vec![rest, 10], vec![u32::MAX, 3], vec![rest, 9, 1]] {
            let found = read(&bytes, |from| from.take_groups::<u16>(lengths, "groups"));
            assert_eq!(found.map(|_| ()), Err(FlatError::Misfit("groups")), "they do not add up");
        }
        let none = written(|out| out.put::<u16>(&[]));
        let found = read(&none, |from| from.take_groups::<u16>([0, 0], "groups"));
        assert_eq!(found, Ok(vec![vec![], vec![]]), "nothing in two groups");
    }

    #[test]
    fn arrays_of_many_pieces_come_back() {
        // 12 bytes divide no piece evenly.
        let numbers: Vec<[f32; 3]> = (0..3 * PIECE).map(|i| [i as f32, 0.5, -1.0]).collect();
        let mut bytes = written(|out| {
            out.put(&numbers)?;
            out.put(&[7_u64])
        });
        let both = read(&bytes, |from| (from.take_finite("numbers"), from.take_exactly("number")));
        assert!(both == (Ok(numbers.clone()), Ok([7_u64])), "as they were");
        let last = 8 + 12 * numbers.len();
        bytes[last - 4..last].copy_from_slice(&f32::NAN.to_ne_bytes());
        let found = read(&bytes, |from| from.take_finite::<[f32; 3]>("numbers"));
        assert_eq!(found.map(|_| ()), Err(FlatError::Misfit("numbers")), "the last one of all");
    }
}

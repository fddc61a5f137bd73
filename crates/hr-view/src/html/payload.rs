//! The numbers of a page: a JSON header and sections of bytes, arranged so that general compression finds what repeats.

use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Names, and where in the bytes after the header each section begins and how long it is.
#[derive(Debug, Default)]
pub(super) struct Payload {
    places: BTreeMap<String, [usize; 2]>,
    bytes: Vec<u8>,
}

/// What the page reads first.
#[derive(Serialize)]
struct Header<'a, T> {
    #[serde(flatten)]
    facts: &'a T,
    sections: &'a BTreeMap<String, [usize; 2]>,
}

impl Payload {
    /// A section of bytes as they are.
    pub(super) fn bytes(&mut self, name: impl Into<String>, bytes: &[u8]) {
        self.places.insert(name.into(), [self.bytes.len(), bytes.len()]);
        self.bytes.extend_from_slice(bytes);
    }

    /// Numbers, little-endian, their first bytes first, then all second ones, …: bytes of the same place repeat more
    /// often than bytes of the same number.
    pub(super) fn words(&mut self, name: impl Into<String>, words: &[u32]) {
        let bytes: Vec<u8> = (0..4).flat_map(|place| words.iter().map(move |word| word.to_le_bytes()[place])).collect();
        self.bytes(name, &bytes);
    }

    /// Numbers that differ little from the one before, as those [differences](fold).
    pub(super) fn steps(&mut self, name: impl Into<String>, words: impl IntoIterator<Item = u32>) {
        let mut last = 0_u32;
        let mut steps = Vec::new();
        for word in words {
            steps.push(fold(word.wrapping_sub(last).cast_signed()));
            last = word;
        }
        self.words(name, &steps);
    }

    /// Writes the length of the header, the header as JSON, and the sections.
    pub(super) fn write(&self, facts: &impl Serialize, out: &mut impl Write) -> io::Result<()> {
        let header = serde_json::to_vec(&Header { facts, sections: &self.places })?;
        let length = u32::try_from(header.len()).map_err(io::Error::other)?;
        out.write_all(&length.to_le_bytes())?;
        out.write_all(&header)?;
        out.write_all(&self.bytes)
    }
}

/// Small numbers of either sign as small numbers without: 0, −1, 1, −2, … become 0, 1, 2, 3, …
pub(super) fn fold(step: i32) -> u32 {
    (step.cast_unsigned() << 1) ^ (step >> 31).cast_unsigned()
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_where_the_header_says() {
        let mut payload = Payload::default();
        payload.bytes("a", b"xyz");
        payload.words("b", &[0x0403_0201, 0x0807_0605]);
        payload.steps("c", [5, 4, u32::MAX, 7]);
        let mut out = Vec::new();
        payload.write(&serde_json::json!({ "fact": 1 }), &mut out).expect("memory takes it");
        let length = u32::from_le_bytes(out[..4].try_into().expect("four bytes")) as usize;
        let header: serde_json::Value = serde_json::from_slice(&out[4..4 + length]).expect("JSON");
        assert_eq!(header["fact"], 1, "facts are kept: {header}");
        let section = |name: &str| {
            let [start, size] = [0, 1].map(|i| header["sections"][name][i].as_u64().expect("a number") as usize);
            &out[4 + length + start..][..size]
        };
        assert_eq!(section("a"), b"xyz", "bytes are as they are");
        assert_eq!(section("b"), [1, 5, 2, 6, 3, 7, 4, 8], "words are by place");
        // +5, −1, −5 around the end of the numbers, +8.
        assert_eq!(section("c")[..4], [10, 1, 9, 16], "steps are folded");
        assert!(section("c")[4..].iter().all(|&byte| byte == 0), "and small");
    }

    #[test]
    fn folding_loses_nothing() {
        for step in [0, 1, -1, 2, -2, 1000, -1000, i32::MAX, i32::MIN] {
            let folded = fold(step);
            let unfolded = (folded >> 1).cast_signed() ^ -(folded & 1).cast_signed();
            assert_eq!(unfolded, step, "{step} became {folded}");
            assert!(step.unsigned_abs() > 1000 || folded <= 2000, "{step} became {folded}: small stays small");
        }
    }
}

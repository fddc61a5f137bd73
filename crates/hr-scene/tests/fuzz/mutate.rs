//! Mutations of files: of bytes, and of the words, numbers and lines that texts are made of.

use hr_diffuse::sampling::hash;

/// A stream of numbers that depends on its seed alone.
pub(crate) struct Source {
    seed: u32,
    drawn: u32,
}

impl Source {
    pub(crate) fn new(test: u32, case: u32) -> Self {
        Self { seed: hash(test, case), drawn: 0 }
    }

    fn next(&mut self) -> u32 {
        self.drawn += 1;
        hash(self.seed, self.drawn)
    }

    /// 0…`count` − 1; 0 where there is nothing to choose from.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.next()) * count as u64) >> 32) as usize
    }

    fn of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }

    /// A range of up to `most` of `length` things.
    fn range(&mut self, length: usize, most: usize) -> std::ops::Range<usize> {
        let first = self.below(length + 1);
        first..(first + 1 + self.below(most)).min(length)
    }
}

/// What takes a number's place: the ends of number ranges, and what is no number at all.
const NUMBERS: [&str; 30] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "3",
    "7",
    "0.5",
    "1e-3",
    "1e3",
    "1e-7",
    "1e7",
    "1e-38",
    "1e38",
    "-1e38",
    "1e-300",
    "1e300",
    "1e999",
    "5e-324",
    "nan",
    "inf",
    "-inf",
    "255",
    "65536",
    "1000000",
    "2147483648",
    "-2147483648",
    "4294967295",
    "18446744073709551615",
    "",
];

/// What takes a byte's place.
const BYTES: [u8; 14] = [0, 1, 9, 10, 13, 32, b'"', b'\\', b'-', b'#', 0x7f, 0x80, 0xc3, 0xff];

/// A few mutations of a file, of bytes or of words; `other` is a file of the same kind to take parts from.
pub(crate) fn mutated(file: &[u8], other: &[u8], source: &mut Source) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..1 + source.below(4) {
        file = match source.below(8) {
            0..2 => byte(file, other, source),
            2..7 => word(&file, other, source),
            _ => line(&file, other, source),
        };
    }
    file
}

fn byte(mut file: Vec<u8>, other: &[u8], source: &mut Source) -> Vec<u8> {
    let at = source.below(file.len());
    match source.below(6) {
        0 if !file.is_empty() => file[at] ^= 1 << source.below(8),
        1 if !file.is_empty() => file[at] = source.of(&BYTES),
        2 => file.truncate(at),
        3 => drop(file.drain(source.range(file.len(), 64))),
        4 => file.insert(at, source.of(&BYTES)),
        _ => {
            let part = source.range(other.len(), 64);
            let there = source.range(file.len(), 64);
            file.splice(there, other[part].iter().copied());
        }
    }
    file
}

/// Where the words of a text are: numbers and names, and every other character by itself.
fn words(file: &[u8]) -> Vec<std::ops::Range<usize>> {
    let part = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'+' | b'_');
    let mut words: Vec<std::ops::Range<usize>> = Vec::new();
    for (at, &byte) in file.iter().enumerate() {
        match words.last_mut() {
            Some(last) if last.end == at && part(byte) && part(file[at - 1]) => last.end += 1,
            _ if byte.is_ascii_whitespace() => {}
            _ => words.push(at..at + 1),
        }
    }
    words
}

fn word(file: &[u8], other: &[u8], source: &mut Source) -> Vec<u8> {
    let words = words(file);
    if words.is_empty() {
        return other.to_vec();
    }
    let at = words[source.below(words.len())].clone();
    let is_number = |word: &std::ops::Range<usize>| file[word.clone()].iter().any(u8::is_ascii_digit);
    let replace = |by: &[u8]| [&file[..at.start], by, &file[at.end..]].concat();
    match source.below(6) {
        // A number, wherever it comes first.
        0..3 => {
            let numbers: Vec<_> = words.iter().filter(|word| is_number(word)).cloned().collect();
            let at = if numbers.is_empty() { at.clone() } else { numbers[source.below(numbers.len())].clone() };
            [&file[..at.start], source.of(&NUMBERS).as_bytes(), &file[at.end..]].concat()
        }
        3 => replace(b""),
        4 => replace(&[&file[at.clone()], b" ", &file[at.clone()]].concat()),
        _ => {
            let others = self::words(other);
            let by = others.get(source.below(others.len())).map_or(&b"x"[..], |word| &other[word.clone()]);
            replace(by)
        }
    }
}

fn line(file: &[u8], other: &[u8], source: &mut Source) -> Vec<u8> {
    let mut lines: Vec<&[u8]> = file.split_inclusive(|&byte| byte == b'\n').collect();
    let others: Vec<&[u8]> = other.split_inclusive(|&byte| byte == b'\n').collect();
    let (a, b) = (source.below(lines.len()), source.below(lines.len()));
    match source.below(4) {
        0 if !lines.is_empty() => drop(lines.remove(a)),
        1 if !lines.is_empty() => lines.swap(a, b),
        2 if !lines.is_empty() => lines.insert(a, lines[b]),
        _ => {
            let part = source.range(others.len(), 8);
            lines.splice(a..a, others[part].iter().copied());
        }
    }
    lines.concat()
}

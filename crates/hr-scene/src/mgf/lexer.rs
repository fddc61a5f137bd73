//! From bytes to statements: lines, continuations, words, and which `xf` closes which.

use crate::whole_file;
use std::ops::Range;
use std::path::PathBuf;

/// One entity with its arguments.
#[derive(Debug)]
pub(super) struct Statement {
    /// Line on which it begins, from 1.
    pub(super) line: usize,
    /// Its words, in [`File::words`].
    words: Range<usize>,
    /// For an `xf` with arguments: the index of the statement that closes it. For an `xf` without: the index of the
    /// one that it closes.
    pub(super) partner: Option<usize>,
}

/// A file cut into statements.
#[derive(Debug)]
pub(super) struct File {
    /// Where it was read from; includes are relative to its folder.
    pub(super) path: PathBuf,
    pub(super) statements: Vec<Statement>,
    text: String,
    words: Vec<Range<usize>>,
}

impl File {
    /// Cuts a file into statements.
    pub(super) fn new(path: PathBuf, bytes: &[u8]) -> Self {
        let text = whole_file::text(bytes);
        let mut file = Self {
            path,
            statements: Vec::new(),
            text: text.replace("\r\n", "\n").replace('\r', "\n"),
            words: Vec::new(),
        };
        file.cut();
        file.pair_transforms();
        file
    }

    fn cut(&mut self) {
        let mut first_line = None;
        let mut first_word = 0;
        let mut start = 0;
        for (index, line) in self.text.split('\n').enumerate() {
            let end = start + line.len();
            let body = line.trim_end();
            let (body, continued) = body.strip_suffix('\\').map_or((body, false), |body| (body, true));
            for word in body.split_ascii_whitespace() {
                // Where the word lies in the text: both are slices of it.
                let at = start + (word.as_ptr() as usize - line.as_ptr() as usize);
                self.words.push(at..at + word.len());
            }
            let line_number = *first_line.get_or_insert(index + 1);
            if !continued || end == self.text.len() {
                if self.words.len() > first_word {
                    let words = first_word..self.words.len();
                    self.statements.push(Statement { line: line_number, words, partner: None });
                }
                first_line = None;
                first_word = self.words.len();
            }
            start = end + 1;
        }
    }

    fn pair_transforms(&mut self) {
        let mut open = Vec::new();
        for index in 0..self.statements.len() {
            if self.keyword(index) != "xf" {
                continue;
            }
            if self.statements[index].words.len() > 1 {
                open.push(index);
            } else if let Some(opening) = open.pop() {
                self.statements[index].partner = Some(opening);
                self.statements[opening].partner = Some(index);
            }
        }
    }

    /// The first word of a statement.
    pub(super) fn keyword(&self, statement: usize) -> &str {
        &self.text[self.words[self.statements[statement].words.start].clone()]
    }

    /// The words of a statement after the first.
    pub(super) fn arguments(&self, statement: usize) -> impl ExactSizeIterator<Item = &str> {
        let words = self.statements[statement].words.clone();
        self.words[words.start + 1..words.end].iter().map(|range| &self.text[range.clone()])
    }

    /// How many words it has in all.
    pub(super) fn word_count(&self) -> usize {
        self.words.len()
    }

    /// File and line of a statement.
    pub(super) fn place(&self, statement: usize) -> String {
        let line = self.statements.get(statement).map_or(1, |s| s.line);
        format!("{}:{line}", self.path.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(text: &[u8]) -> Vec<(usize, Vec<String>)> {
        let file = File::new("t".into(), text);
        (0..file.statements.len())
            .map(|k| {
                let words = std::iter::once(file.keyword(k)).chain(file.arguments(k)).map(str::to_owned);
                (file.statements[k].line, words.collect())
            })
            .collect()
    }

    fn words(line: usize, text: &str) -> (usize, Vec<String>) {
        (line, text.split(' ').map(str::to_owned).collect())
    }

    #[test]
    fn lines_and_continuations() {
        let expected = [words(1, "v a = b"), words(4, "p 1 2 3"), words(6, "# no \\ end")];
        for text in [
            "v a\\\n\t=\\\n b\n  p 1 2 3\n\n# no \\ end",
            "\u{feff}v a\\\r\n\t= \\ \r\nb\r\n  p 1 2 3\r\n\r\n# no \\ end\r\n",
            "v a\\\r=\\\rb\rp 1 2 3\r\r# no \\ end\\",
        ] {
            assert_eq!(cut(text.as_bytes()), expected, "{text:?}");
        }
        assert_eq!(cut(b""), [], "nothing");
        assert_eq!(cut(b" \\\n \\"), [], "blanks and continuations only");
        assert_eq!(cut(b"o \xff\xfe\n"), [words(1, "o \u{fffd}\u{fffd}")], "invalid UTF-8");
    }

    #[test]
    fn transforms_are_paired() {
        let file = File::new("t".into(), b"xf\nxf -mx\nxf -my\nxf\nxf\nxf -mz\n");
        let partners: Vec<_> = file.statements.iter().map(|s| s.partner).collect();
        assert_eq!(partners, [None, Some(4), Some(3), Some(2), Some(1), None], "inner ones first");
    }
}

//! The tables and figures of the paper's comparisons, made anew: Stamminger et al., "Efficient Glossy Global Illumination
//! with Interactive Viewing", Computer Graphics Forum 19(1), 2000, tables 1 to 4 and figures 4, 7 and 8.
//!
//! Times are processor seconds of one thread, of all that is compared in the same process, one beside the other.

mod area_light;
mod bases;
mod clustering;
mod leaves;
mod solutions;
mod sums;

pub use clustering::RadianceClustering;

use crate::BenchError;
use crate::args::PaperArgs;
use crate::run::{Out, say};
use glossy_ext::haar::{Refinement, Refiner};
use hr_scene::{Image, Primaries, ToneMap};
use std::path::Path;

/// The paper's criterion (section 4.2) with a relative difference ε, between the levels "m/M" of its tables.
fn relative(epsilon: f32, [min_level, max_level]: [u8; 2]) -> Refinement {
    Refinement { min_level, max_level, refiner: Refiner::Relative(epsilon), ..Refinement::PAPER }
}

/// Paragraphs are wrapped at so many characters.
const WRAP: usize = 120;

/// A text that grows, and the folder where pictures go.
struct Page<'a> {
    text: String,
    folder: &'a Path,
}

impl Page<'_> {
    fn line(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    /// Adds a heading or a paragraph.
    fn text(&mut self, text: &str) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
        let mut width = 0;
        for word in text.split_whitespace() {
            let length = word.chars().count();
            if width > 0 {
                self.text.push(if width + length < WRAP { ' ' } else { '\n' });
                width = if width + length < WRAP { width + 1 } else { 0 };
            }
            self.text += word;
            width += length;
        }
        self.text.push('\n');
    }

    /// Adds the head of a table; columns after the first `left` ones are numbers.
    fn head(&mut self, left: usize, columns: &[&str]) {
        self.text.push('\n');
        let dashes = (0..columns.len()).map(|i| if i < left { " --- |" } else { " ---: |" });
        self.line(&format!("| {} |", columns.join(" | ")));
        self.line(&format!("|{}", dashes.collect::<String>()));
    }

    /// Adds the row of a table.
    fn row(&mut self, cells: &[String]) {
        self.line(&format!("| {} |", cells.join(" | ")));
    }

    /// Adds a picture, and writes it into the folder.
    fn picture(&mut self, name: &str, caption: &str, image: &Image) -> Result<(), BenchError> {
        let file = format!("paper-{name}.png");
        image.save(&self.folder.join(&file), &ToneMap::default(), Primaries::Rec709)?;
        self.text(&format!("![{caption}]({file})"));
        Ok(())
    }
}

/// Runs the comparisons and writes `paper-tables.md` with its pictures.
///
/// # Errors
/// Where a scene cannot be loaded or solved, or files cannot be written.
pub fn report(args: &PaperArgs, out: Out<'_>) -> Result<(), BenchError> {
    let unwritable = |path: &Path, source| BenchError::Write { path: path.to_owned(), source };
    std::fs::create_dir_all(&args.out).map_err(|source| unwritable(&args.out, source))?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| BenchError::Threads(error.to_string()))?;
    let mut page = Page { text: String::new(), folder: &args.out };
    pool.install(|| {
        introduce(&mut page, args);
        sums::report(&mut page)?;
        bases::report(&mut page)?;
        area_light::report(&mut page)?;
        solutions::report(&args.scenes, args.error, &mut page)
    })?;
    let path = args.out.join("paper-tables.md");
    std::fs::write(&path, &page.text).map_err(|source| unwritable(&path, source))?;
    say(out, &page.text)
}

fn introduce(page: &mut Page<'_>, args: &PaperArgs) {
    let name = |scene: &String| Path::new(scene).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let words =
        [format!("hr-bench paper --error {} --out docs", args.error)].into_iter().chain(args.scenes.iter().map(name));
    let command = words.collect::<Vec<_>>().join(" ");
    page.text("# The paper's tables");
    page.text(&format!(
        "Made by `{command}`. The paper is Stamminger, Scheel, Granier, Perez-Cazorla, Drettakis and Sillion, \"Efficient \
         Glossy Global Illumination with Interactive Viewing\", Computer Graphics Forum 19(1), 2000; its figures are those \
         of its tables 1 to 4, measured on a 195 MHz R10000.",
    ));
    page.text(
        "Scenes are ours, made after the descriptions, so counts and times compare by their ratios only. Times are \
         processor seconds of one thread; what is compared ran in the same process, one beside the other. *Error* is \
         the mean distance of what distributions show from the reflected samples themselves, in 3000 directions \
         weighted by their cosine, relative to the mean. \"Levels m/M\" and ε are the paper's: subdivision down to level m \
         everywhere, and further down to M where samples differ by more than ε of the value in the middle.",
    );
}

/// How many times smaller the first of two numbers is.
fn times([less, more]: [f64; 2]) -> String {
    format!("{:.1}", more / less)
}

/// How much smaller the first of two numbers is.
fn saved([less, more]: [f64; 2]) -> String {
    format!("{:.0} %", 100.0 * (1.0 - less / more))
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_markdown() {
        let mut page = Page { text: String::new(), folder: Path::new("nowhere") };
        page.text("Words.");
        page.head(1, &["a", "b"]);
        page.row(&[times([2.0, 5.0]), saved([1.0, 4.0])]);
        assert_eq!(page.text, "Words.\n\n| a | b |\n| --- | ---: |\n| 2.5 | 75 % |\n", "a table");
        let image = Image::new(1, 1);
        assert!(page.picture("p", "a picture", &image).is_err(), "no such folder");
    }
}

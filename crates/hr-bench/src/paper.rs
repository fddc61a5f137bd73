//! The tables and figures of the paper's comparisons, made anew: Stamminger et al., "Efficient Glossy Global Illumination
//! with Interactive Viewing", Computer Graphics Forum 19(1), 2000, tables 1 to 4 and figures 4, 7.
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
pub(crate) fn relative(epsilon: f32, [min_level, max_level]: [u8; 2]) -> Refinement {
    Refinement { min_level, max_level, refiner: Refiner::Relative(epsilon), ..Refinement::PAPER }
}

/// A text that grows, and the folder where pictures go.
pub(crate) struct Page<'a> {
    text: String,
    folder: &'a Path,
}

impl Page<'_> {
    /// Adds a line.
    pub(crate) fn line(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    /// Adds the head of a table; columns after the first `left` ones are numbers.
    pub(crate) fn head(&mut self, left: usize, columns: &[&str]) {
        let dashes = (0..columns.len()).map(|i| if i < left { " --- |" } else { " ---: |" });
        self.line(&format!("| {} |", columns.join(" | ")));
        self.line(&format!("|{}", dashes.collect::<String>()));
    }

    /// Adds the row of a table.
    pub(crate) fn row(&mut self, cells: &[String]) {
        self.line(&format!("| {} |", cells.join(" | ")));
    }

    /// Adds a picture, and writes it into the folder.
    pub(crate) fn picture(&mut self, name: &str, caption: &str, image: &Image) -> Result<(), BenchError> {
        let file = format!("paper-{name}.png");
        image.save(&self.folder.join(&file), &ToneMap::default(), Primaries::Rec709)?;
        self.line(&format!("![{caption}]({file})"));
        self.line("");
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
        //sums::report(&mut page)?;
        //bases::report(&mut page)?;
        //area_light::report(&mut page)?;
        solutions::report(&args.scenes, &mut page)
    })?;
    let path = args.out.join("paper-tables.md");
    std::fs::write(&path, &page.text).map_err(|source| unwritable(&path, source))?;
    say(out, &page.text)
}

fn introduce(page: &mut Page<'_>, args: &PaperArgs) {
    let scenes: Vec<_> =
        args.scenes.iter().map(|s| Path::new(s).file_name().unwrap_or_default().to_string_lossy()).collect();
    page.line("# The paper's tables");
    page.line("");
    page.line(&format!("Made by `hr-bench paper --out docs {}`", scenes.join(" ")).trim_end());
}

/// Pictures of one size, row by row, with white between them.
pub(crate) fn side_by_side(rows: &[Vec<Image>]) -> Image {
    const GAP: u32 = 4;
    let (width, height) = rows.iter().flatten().fold((0, 0), |(w, h), i| (i.width.max(w), i.height.max(h)));
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
    let mut all = Image::new(columns * (width + GAP), rows.len() as u32 * (height + GAP));
    for (y, row) in rows.iter().enumerate() {
        for (x, image) in row.iter().enumerate() {
            let (left, top) = (x as u32 * (width + GAP), y as u32 * (height + GAP));
            for (line, pixels) in image.pixels.chunks(image.width.max(1) as usize).enumerate() {
                let start = ((top + line as u32) * all.width + left) as usize;
                all.pixels[start..start + pixels.len()].copy_from_slice(pixels);
            }
        }
    }
    all
}

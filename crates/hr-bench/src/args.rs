//! The command line.

use crate::growth::Kind;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Measures the library: references, distances, accuracy, speed.
#[derive(Clone, Debug, PartialEq, Parser)]
#[command(name = "hr-bench", version)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Clone, Debug, PartialEq, Subcommand)]
pub enum Command {
    /// Path trace a reference image
    Reference(ReferenceArgs),
    /// Distance of an image to a reference
    Compare(CompareArgs),
    /// Solve scenes at several errors and compare their pictures with references: a Markdown table
    Accuracy(AccuracyArgs),
    /// The diffuse solver's error over its time: a Markdown table, CSV and SVG
    Curve(CurveArgs),
    /// How time and memory grow with generated scenes: Markdown tables with fitted exponents
    Growth(GrowthArgs),
    /// One solve on 1, 2 and all threads, and whether the results are the same bits: a Markdown table
    Threads(ThreadsArgs),
    /// Gathering against shooting: a Markdown table
    Transport(TransportArgs),
    /// Moved objects and lamps against fresh solves: a Markdown table
    Edits(EditsArgs),
    /// Form factors against closed forms and brute force: a Markdown table
    FormFactors(FormFactorArgs),
    /// How tight the oracle's bounds of form factors are: a Markdown table
    Bounds(BoundsArgs),
    /// Rays per second on one thread, and links that need none: Markdown tables
    Visibility(VisibilityArgs),
    /// The paper's tables 1 to 4 and figures 4, 7 and 8, made anew: a Markdown page with pictures
    Paper(PaperArgs),
    /// Memory over the error that distributions show, directions refined by themselves and together with space: Markdown tables
    Together(TogetherArgs),
    /// Time of frames along a walk, over the share of glossy vertices and the tolerance of their renewal: Markdown tables
    View(ViewArgs),
    /// The pictures of the guide in docs/, made anew
    Guide(GuideArgs),
    /// Pictures of built-in scenes beside those that are committed, and what differs: a Markdown table
    Pictures(PicturesArgs),
}

/// Of `hr-bench reference`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct ReferenceArgs {
    /// A .mgf, .gltf, .glb or .obj file, or the name of a built-in scene
    #[arg(value_name = "SCENE", default_value = hr_scene::builtin::DEFAULT)]
    pub scene: String,

    /// A camera file, or the name of one of the scene's cameras; its first one where this is not given
    #[arg(long, value_name = "FILE.json|NAME")]
    pub camera: Option<String>,

    /// Let this radiance come from everywhere, W/(m² sr), as `hr-view --sky` does
    #[arg(long, value_name = "L", value_parser = hr_view::args::radiance)]
    pub sky: Option<f32>,

    /// Paths per pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: u32,

    /// Other seeds give independent images
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u32,

    /// Image width in pixels, the height in proportion; as the camera has it where this is not given
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub width: Option<u32>,

    /// Where the image goes: .pfm, .exr or .png
    #[arg(long, value_name = "OUT")]
    pub image: PathBuf,

    /// Where the standard error of every pixel goes
    #[arg(long, value_name = "OUT.pfm")]
    pub sigma: Option<PathBuf>,
}

/// Of `hr-bench compare`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct CompareArgs {
    /// The image: .pfm or .npy
    pub image: PathBuf,

    /// The reference: .pfm or .npy
    pub reference: PathBuf,

    /// Standard error of the reference's pixels
    #[arg(long, value_name = "FILE")]
    pub sigma: Option<PathBuf>,

    /// Leave out pixels whose reference luminance is this or more: they see an emitter
    #[arg(long, value_name = "L")]
    pub below: Option<f64>,

    /// Exit with status 1 where block L1 is larger (0.05 is 5 %)
    #[arg(long, value_name = "E")]
    pub max_block: Option<f64>,
}

/// Of `hr-bench accuracy`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct AccuracyArgs {
    /// Scene files or names of built-in scenes; where none is given all built-in ones, or with --reference those listed
    #[arg(value_name = "SCENE")]
    pub scenes: Vec<String>,

    /// Errors to ask for
    #[arg(long, value_name = "E", value_delimiter = ',', default_values_t = [0.2, 0.1, 0.05, 0.02])]
    pub error: Vec<f32>,

    /// Folder of references (references.json, views/NAME.npy); where it is not given, references are path traced
    #[arg(long, value_name = "DIR")]
    pub reference: Option<PathBuf>,

    /// Paths per pixel of path traced references
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: u32,

    /// Width in pixels of path traced references
    #[arg(long, value_name = "W", default_value_t = 200, value_parser = clap::value_parser!(u32).range(8..=16384))]
    pub width: u32,

    /// Where path traced references are kept, to be used again
    #[arg(long, value_name = "DIR", default_value = "target/hr-bench")]
    pub out: PathBuf,
}

/// Of `hr-bench curve`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct CurveArgs {
    /// Scene files or names of built-in scenes
    #[arg(value_name = "SCENE", required = true)]
    pub scenes: Vec<String>,

    /// Errors to ask for
    #[arg(long, value_name = "E", value_delimiter = ',', default_values_t = [0.3, 0.2, 0.1, 0.05, 0.02, 0.01])]
    pub errors: Vec<f32>,

    /// Irradiances of triangles (object, mesh, triangle, area, cx, cy, cz, E_r, …, se_r, …, B_r, …); the first one for
    /// the first scene, the second for the second, …
    #[arg(long, value_name = "CSV", value_delimiter = ',')]
    pub reference: Vec<PathBuf>,

    /// Worker threads; 0 for all cores
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub threads: usize,

    /// Solves of less than a second are done so often; the fastest counts
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub repeat: u32,

    /// Where curve.csv and curve.svg go
    #[arg(long, value_name = "DIR", default_value = "target/hr-bench")]
    pub out: PathBuf,
}

/// Of `hr-bench growth`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct GrowthArgs {
    /// What is generated; all kinds where none is given
    #[arg(long, value_name = "KIND", value_delimiter = ',')]
    pub kind: Vec<Kind>,

    /// Polygons, about
    #[arg(long, value_name = "N", value_delimiter = ',', default_values_t = [1_000, 10_000, 100_000, 1_000_000],
        value_parser = clap::value_parser!(u64).range(100..=100_000_000))]
    pub sizes: Vec<u64>,

    /// Error to ask for
    #[arg(long, value_name = "E", default_value_t = 0.05)]
    pub error: f32,

    /// Worker threads; 0 for all cores
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub threads: usize,

    /// Seconds after which a solve refines no more; it does not count for the exponents
    #[arg(long, value_name = "S", default_value_t = 600)]
    pub limit: u64,

    /// Renew visibility for values at vertices too, as for display
    #[arg(long)]
    pub vertices: bool,

    /// Solve in this process and print JSON: what the others are started with
    #[arg(long, hide = true)]
    pub single: bool,
}

/// Of `hr-bench threads`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct ThreadsArgs {
    /// A scene file or the name of a built-in scene
    #[arg(value_name = "SCENE", default_value = hr_scene::builtin::DEFAULT)]
    pub scene: String,

    /// Error to ask for
    #[arg(long, value_name = "E", default_value_t = 0.05)]
    pub error: f32,
}

/// The last words of the names of edits.
pub(crate) const EDITS: [&str; 8] =
    ["intensity", "alone", "lamps", "colour", "reflectance", "roughness", "object", "lamp"];

/// Of `hr-bench edits`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct EditsArgs {
    /// Scene files or names of built-in scenes; all built-in ones where none is given
    #[arg(value_name = "SCENE")]
    pub scenes: Vec<String>,

    /// Error to ask for
    #[arg(long, value_name = "E", default_value_t = 0.05)]
    pub error: f32,

    /// Only these edits, by the last word of their names
    #[arg(long, value_name = "EDIT,EDIT,...", value_delimiter = ',', value_parser = EDITS)]
    pub only: Vec<String>,
}

/// Of `hr-bench transport`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct TransportArgs {
    /// Scene files or names of built-in scenes; all built-in ones where none is given
    #[arg(value_name = "SCENE")]
    pub scenes: Vec<String>,

    /// Errors to ask for
    #[arg(long, value_name = "E,E,...", value_delimiter = ',', default_value = "0.15")]
    pub errors: Vec<f32>,
}

/// Of `hr-bench form-factors`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct FormFactorArgs {
    /// Samples of brute force
    #[arg(long, value_name = "N", default_value_t = 1 << 20, value_parser = clap::value_parser!(u32).range(1..))]
    pub samples: u32,
}

/// Of `hr-bench bounds`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct BoundsArgs {
    /// Scene files or names of built-in scenes
    #[arg(value_name = "SCENE", default_values = ["cornell", "glossy-sphere", "room"])]
    pub scenes: Vec<String>,

    /// Pairs of elements of each kind and distance, from each scene
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub pairs: u32,
}

/// Of `hr-bench visibility`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct VisibilityArgs {
    /// A scene file or the name of a built-in scene
    #[arg(value_name = "SCENE", default_value = hr_scene::builtin::DEFAULT)]
    pub scene: String,

    /// Rays of each kind
    #[arg(long, value_name = "N", default_value_t = 1 << 19, value_parser = clap::value_parser!(u32).range(1..=1 << 26))]
    pub rays: u32,

    /// Solve with this error, and show what is proved of links and what could be
    #[arg(long, value_name = "E")]
    pub error: Option<f32>,
}

/// Of `hr-bench paper`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct PaperArgs {
    /// Scene files or names of built-in scenes for tables 3 and 4, beside those that are always there
    #[arg(value_name = "SCENE")]
    pub scenes: Vec<String>,

    /// Error to ask for in tables 3 and 4
    #[arg(long, value_name = "E", default_value_t = 0.05)]
    pub error: f32,

    /// Where paper-tables.md and its pictures go
    #[arg(long, value_name = "DIR", default_value = "target/hr-bench")]
    pub out: PathBuf,
}

/// Of `hr-bench together`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct TogetherArgs {
    /// Scenes of the references, files or names of built-in ones; all that are glossy where none is given
    #[arg(value_name = "SCENE")]
    pub scenes: Vec<String>,

    /// Errors to ask for
    #[arg(long, value_name = "E", value_delimiter = ',', default_values_t = [0.2, 0.1, 0.05, 0.02])]
    pub error: Vec<f32>,

    /// Folder of references (references.json, views/NAME.npy)
    #[arg(long, value_name = "DIR")]
    pub reference: PathBuf,
}

/// Of `hr-bench guide`.
#[derive(Clone, Debug, PartialEq, Eq, Args)]
pub struct GuideArgs {
    /// Where guide-errors.png, guide-point.png and guide-modes.png go
    #[arg(long, value_name = "DIR", default_value = "target/hr-bench")]
    pub out: PathBuf,

    /// Paths per pixel of the path-traced picture
    #[arg(long, value_name = "N", default_value_t = 256)]
    pub spp: u32,
}

/// Of `hr-bench pictures`.
#[derive(Clone, Debug, PartialEq, Eq, Args)]
pub struct PicturesArgs {
    /// Where those are that are committed
    #[arg(long, value_name = "DIR", default_value = "crates/hr-bench/pictures")]
    pub committed: PathBuf,

    /// Where each goes beside what is committed and the difference
    #[arg(long, value_name = "DIR", default_value = "target/hr-bench/pictures")]
    pub out: PathBuf,

    /// Replace what is committed by what is drawn now
    #[arg(long)]
    pub accept: bool,
}

/// Of `hr-bench view`.
#[derive(Clone, Debug, PartialEq, Args)]
pub struct ViewArgs {
    /// A scene file or the name of a built-in scene
    #[arg(value_name = "SCENE", default_value = hr_scene::builtin::DEFAULT)]
    pub scene: String,

    /// The walk, as hr-view records it; the scene's own where this is not given
    #[arg(long, value_name = "FILE.json")]
    pub path: Option<PathBuf>,

    /// Error to solve to
    #[arg(long, value_name = "E", default_value_t = 0.15)]
    pub error: f32,

    /// A solution of the scene that hr-view --save kept, instead of solving
    #[arg(long, value_name = "IN")]
    pub load: Option<PathBuf>,

    /// How glossy light is shown
    #[arg(long, value_name = "M", value_enum, default_value_t)]
    pub mode: hr_view::Mode,

    /// Frames of the walk
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub frames: u32,

    /// Size of the frames in pixels
    #[arg(long, value_name = "W", default_value_t = 1280, value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub width: u32,

    /// The same
    #[arg(long, value_name = "H", default_value_t = 720, value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub height: u32,

    /// Changes of direction in degrees that glossy vertices are evaluated again for
    #[arg(long, value_name = "DEGREES", value_delimiter = ',', default_values_t = [0.0, 1.0, 2.0, 5.0])]
    pub tolerance: Vec<f32>,

    /// Shares of the glossy vertices that follow the eye; the others look as they do without
    #[arg(long, value_name = "S", value_delimiter = ',', default_values_t = [0.0, 0.25, 0.5, 1.0])]
    pub share: Vec<f32>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn read(line: &str) -> Result<Command, String> {
        let words = std::iter::once("hr-bench").chain(line.split_whitespace());
        Cli::try_parse_from(words).map(|cli| cli.command).map_err(|error| error.to_string())
    }

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn everything_has_its_place() {
        let Ok(Command::Accuracy(all)) = read("accuracy --error 0.3,0.1 cornell room --spp 9") else {
            panic!("errors and scenes")
        };
        assert_eq!((all.error, all.spp), (vec![0.3, 0.1], 9), "errors");
        assert_eq!(all.scenes, ["cornell", "room"], "scenes");
        let Ok(Command::Accuracy(none)) = read("accuracy") else { panic!("nothing given") };
        assert_eq!(none.error, [0.2, 0.1, 0.05, 0.02], "default errors");
        let Ok(Command::Compare(two)) = read("compare a.pfm b.npy --below 3") else { panic!("two images") };
        assert_eq!((two.below, two.max_block), (Some(3.0), None), "bounds");
        let Ok(Command::Curve(curve)) = read("curve cornell --errors 0.2,0.1 --reference a.csv") else {
            panic!("a scene")
        };
        assert_eq!((curve.errors, curve.threads), (vec![0.2, 0.1], 1), "errors, and one thread");
        for wrong in [
            "",
            "compare a.pfm",
            "reference",
            "reference --image a.pfm --spp 0",
            "accuracy --error x",
            "curve",
            "growth --kind x",
            "growth --sizes 3",
        ] {
            assert!(read(wrong).is_err(), "'{wrong}' was taken");
        }
    }
}

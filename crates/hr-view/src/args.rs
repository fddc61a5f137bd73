//! The command line.

use crate::ViewError;
use crate::glossy::Mode;
use clap::Parser;
use clap::error::ErrorKind;
use hr_diffuse::Transport;
use std::ffi::OsString;
use std::path::PathBuf;

const CAMERA_HELP: &str = r#"Where to look from: the name of one of the scene's cameras, or a file, {"eye":[x,y,z],"target":[x,y,z],"up":[x,y,z],"fov_x":degrees,"width":w,"height":h}"#;

/// Walk through the global illumination of a scene, glossy reflection included.
///
/// A window opens, the scene is solved behind it, and you walk while the solution gets better, until it has the
/// accuracy asked for. H in the window shows the keys.
#[derive(Clone, Debug, PartialEq, Parser)]
#[command(name = "hr-view", version)]
pub struct Args {
    /// A .mgf, .gltf, .glb or .obj file, or the name of a built-in scene
    #[arg(value_name = "SCENE", default_value = hr_scene::builtin::DEFAULT)]
    pub scene: String,

    /// Where to look from: the name of one of the scene's cameras, or a file with the JSON form of a [`Camera`](hr_scene::Camera)
    #[arg(long, value_name = "FILE.json|NAME", help = CAMERA_HELP)]
    pub camera: Option<PathBuf>,

    /// Leave out all surfaces of a material, as if they were not there, such as the glass of windows; more than once for several
    #[arg(long, value_name = "MATERIAL")]
    pub leave_out: Vec<String>,

    /// Let this radiance come from everywhere, W/(m² sr): for scenes in the open, or without lamps
    #[arg(long, value_name = "L", value_parser = radiance, allow_negative_numbers = true)]
    pub sky: Option<f32>,

    /// No window: one image; .pfm and .exr hold linear radiance, unclamped, .png is tone-mapped
    #[arg(long, value_name = "OUT")]
    pub image: Option<PathBuf>,

    /// No window: PNG frames along the walkthrough's camera path
    #[arg(long, value_name = "DIR", conflicts_with = "image")]
    pub frames: Option<PathBuf>,

    /// A camera path: played by V in the window, which records to it, and followed by --frames
    #[arg(long, value_name = "FILE.json")]
    pub path: Option<PathBuf>,

    /// How glossy light is shown [default: samples for --image, distributions for walks]
    #[arg(long, value_name = "M", value_enum)]
    pub mode: Option<Mode>,

    /// The accuracy asked for: relative error of the solution, 0.001 to 1
    #[arg(long, value_name = "E", value_parser = error, default_value_t = 0.05, allow_negative_numbers = true)]
    pub error: f32,

    /// How light travels between surfaces: gather, where all of it does in each iteration, or shoot, where only what is new does
    #[arg(long, value_name = "T", value_parser = transport, default_value = "gather")]
    pub transport: Transport,

    /// Stop refining after so many seconds and show what there is
    #[arg(long, value_name = "S", value_parser = seconds, allow_negative_numbers = true)]
    pub time_budget: Option<f64>,

    /// Worker threads; as many as the machine has where it is not given
    #[arg(long, value_name = "N", value_parser = threads, allow_negative_numbers = true)]
    pub threads: Option<usize>,

    /// Write times, counts, what was skipped and why, and peak memory
    #[arg(long, value_name = "OUT.json")]
    pub stats: Option<PathBuf>,

    /// Keep the solution in a file, for --load
    #[arg(long, value_name = "OUT")]
    pub save: Option<PathBuf>,

    /// Look at a solution of this SCENE that --save kept, without solving
    #[arg(long, value_name = "IN", conflicts_with_all = ["save", "error", "transport", "time_budget"])]
    pub load: Option<PathBuf>,

    /// Go on with a solution of this SCENE that --save kept, stopped ones too, to the accuracy asked for
    #[arg(long, value_name = "IN", conflicts_with = "load")]
    pub resume: Option<PathBuf>,

    /// No window: one self-contained file that walks through the solution in any browser
    #[arg(long, value_name = "OUT.html", conflicts_with_all = ["image", "frames"])]
    pub html: Option<PathBuf>,

    /// No window: the solution for other programs; .csv is a table of elements, .glb a glTF model with the light in it, .exr its lightmap
    #[arg(long, value_name = "FILE", conflicts_with_all = ["image", "frames", "html", "camera", "mode"])]
    pub export: Option<PathBuf>,
}

/// What came of reading the command line.
#[derive(Clone, Debug, PartialEq)]
pub enum Parsed {
    /// Something to do.
    Run(Box<Args>),
    /// Help or version was asked for: text for standard output.
    Print(String),
}

impl Args {
    /// Reads a command line, the program's name first.
    ///
    /// # Errors
    /// [`ViewError::Arguments`], in one line, for what cannot be meant, and for modes that are not available yet.
    pub fn read(line: impl IntoIterator<Item = OsString>) -> Result<Parsed, ViewError> {
        let args = match Self::try_parse_from(line) {
            Ok(args) => args,
            Err(error) if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
                return Ok(Parsed::Print(error.to_string()));
            }
            Err(error) => return Err(ViewError::Arguments(one_line(&error))),
        };
        if args.html.is_some() && args.mode.is_some_and(|mode| mode != Mode::Distributions) {
            return Err(ViewError::Arguments("--html shows distributions; leave --mode out".into()));
        }
        if args.mode == Some(Mode::Gather) && args.image.is_none() && args.frames.is_none() {
            return Err(ViewError::Arguments("--mode gather is for stills; add --image or --frames".into()));
        }
        Ok(Parsed::Run(Box::new(args)))
    }
}

/// clap's message without its headings, usage and blank lines.
fn one_line(error: &clap::Error) -> String {
    if error.kind() == ErrorKind::InvalidUtf8 {
        return "a name on the command line is not text in UTF-8; rename the file".to_owned();
    }
    let text = error.to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let kept: Vec<_> = lines.take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more")).collect();
    // A list of what is missing follows a colon, tips and possible values follow what they are about.
    let joined = kept.join("; ").replace(":; ", ": ");
    format!("{joined}; hr-view --help lists the options")
}

fn error(text: &str) -> Result<f32, String> {
    let value: f32 = text.parse().map_err(|_| "must be a number from 0.001 to 1, such as 0.02".to_owned())?;
    if (0.001..=1.0).contains(&value) { Ok(value) } else { Err("must be from 0.001 to 1, such as 0.02".into()) }
}

fn transport(text: &str) -> Result<Transport, String> {
    match text {
        "gather" => Ok(Transport::Gather),
        "shoot" => Ok(Transport::Shoot),
        _ => Err("must be gather or shoot".into()),
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        // A duration of more seconds than this would not fit one.
        Ok(value) if (0.0..=1e9).contains(&value) => Ok(value),
        _ => Err("must be a number of seconds from 0 to 1e9, such as 10".into()),
    }
}

/// Reads the radiance of a sky.
///
/// # Errors
/// What would be right.
pub fn radiance(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 && value <= 1e20 => Ok(value),
        _ => Err("must be a radiance above 0 and up to 1e20, such as 1".into()),
    }
}

fn threads(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(value) if (1..=1024).contains(&value) => Ok(value),
        _ => Err("must be a whole number from 1 to 1024".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn read(line: &str) -> Result<Parsed, ViewError> {
        Args::read(std::iter::once("hr-view").chain(line.split_whitespace()).map(OsString::from))
    }

    fn run(line: &str) -> Args {
        match read(line) {
            Ok(Parsed::Run(args)) => *args,
            other => panic!("{line}: {other:?}"),
        }
    }

    #[test]
    fn the_definition_is_sound() {
        Args::command().debug_assert();
    }

    #[test]
    fn everything_has_its_place() {
        let nothing = run("");
        assert_eq!(nothing.scene, hr_scene::builtin::DEFAULT, "no scene is the default scene");
        assert_eq!(nothing.mode, None, "it depends on what is asked for");
        let all = run(
            "a.mgf --camera c.json --image o.exr --mode samples --error 0.02 --transport shoot --time-budget 10 --threads 3 \
             --stats s.json",
        );
        assert_eq!(all.scene, "a.mgf", "scene");
        assert_eq!(all.camera, Some("c.json".into()), "camera");
        assert_eq!(all.image, Some("o.exr".into()), "image");
        assert_eq!(all.mode, Some(Mode::Samples), "mode");
        assert_eq!((all.error, all.time_budget, all.threads), (0.02, Some(10.0), Some(3)), "numbers");
        assert_eq!((all.transport, nothing.transport), (Transport::Shoot, Transport::default()), "transport");
        assert_eq!(all.stats, Some("s.json".into()), "stats");
        assert_eq!(run("--mode gather --image o.exr").mode, Some(Mode::Gather), "stills by a final gather");
        assert_eq!(run("--save s.hrs").save, Some("s.hrs".into()), "save");
        assert_eq!(run("room --load s.hrs --threads 2").load, Some("s.hrs".into()), "load");
        assert_eq!(run("--export light.glb").export, Some("light.glb".into()), "export");
        assert_eq!(run("--frames out --path p.json").path, Some("p.json".into()), "path");
        assert_eq!(run("--leave-out glass --leave-out leaves").leave_out, ["glass", "leaves"], "several");
        assert_eq!(run("--frames out").frames, Some("out".into()), "frames");
    }

    #[test]
    fn mistakes_are_one_line_that_helps() {
        let cases = [
            ("--error 0", "0.001"),
            ("--error x", "0.02"),
            ("--error -1", "0.001"),
            ("--error nan", "0.001"),
            ("--time-budget -1", "seconds"),
            ("--time-budget inf", "seconds"),
            ("--transport teleport", "gather or shoot"),
            ("--load x --transport shoot", "--transport"),
            ("--threads 0", "1 to 1024"),
            ("--threads 99999999999999999999", "1 to 1024"),
            ("--mode best", "gather"),
            ("--imgae o.png", "--image"),
            ("--image", "--image"),
            ("--image a.png --frames b", "--frames"),
            ("a.mgf b.mgf", "b.mgf"),
            ("--mode gather", "add --image"),
            ("--save", "--save"),
            ("--load x --save y", "--save"),
            ("--load x --error 0.1", "--error"),
            ("--load x --time-budget 3", "--time-budget"),
            ("--load x --resume y", "--resume"),
            ("--html x --mode samples", "leave --mode out"),
            ("--html x --image a.png", "--image"),
            ("--export x.glb --image a.png", "--image"),
            ("--export x.glb --mode samples", "--mode"),
        ];
        for (line, hint) in cases {
            let Err(error) = read(line) else { panic!("'{line}' was taken") };
            let text = error.to_string();
            assert!(text.contains(hint) && text.lines().count() == 1, "'{line}' gives: {text}");
        }
    }

    #[test]
    fn help_and_version_are_no_errors() {
        for (line, part) in [("--help", "--time-budget"), ("--version", env!("CARGO_PKG_VERSION"))] {
            let Ok(Parsed::Print(text)) = read(line) else { panic!("{line} is an error") };
            assert!(text.contains(part), "{line} says {text}");
        }
    }
}

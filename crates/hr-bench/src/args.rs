//! The command line.

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

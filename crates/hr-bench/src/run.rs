//! What the subcommands do.

use crate::args::{AccuracyArgs, Cli, Command, CompareArgs, ReferenceArgs, ThreadsArgs, VisibilityArgs};
use crate::compare::{compare, luminance};
use crate::views::{Making, listed, path_traced};
use crate::{
    BenchError, accuracy, bounds, curve, edits, float_image, form_factors, frames, growth, guide, paper, pictures,
    threads, together, transport, visibility,
};
use hr_scene::{Camera, ImageKind, Rgb, Scene, ToneMap, builtin};
use hr_view::path_tracer::{self, PathTracer};
use std::io::Write;
use std::sync::Arc;
use std::time::Instant;

/// Where results are printed to.
pub type Out<'a> = &'a mut dyn Write;

/// Does what the command line says.
///
/// # Errors
/// Anything that keeps it from being done; the text is one line for the user.
pub fn run(cli: &Cli, out: Out<'_>) -> Result<(), BenchError> {
    match &cli.command {
        Command::Reference(args) => reference(args, out),
        Command::Compare(args) => compare_files(args, out),
        Command::Accuracy(args) => measure_accuracy(args, out),
        Command::Curve(args) => curve::report(args, out),
        Command::Growth(args) => growth::report(args, out),
        Command::Threads(args) => measure_threads(args, out),
        Command::Transport(args) => transport::report(args, out),
        Command::Edits(args) => edits::report(args, out),
        Command::FormFactors(args) => form_factors::report(args.samples, out),
        Command::Bounds(args) => bounds::report(args, out),
        Command::Visibility(args) => measure_visibility(args, out),
        Command::Paper(args) => paper::report(args, out),
        Command::Together(args) => together::report(args, out),
        Command::View(args) => frames::report(args, out),
        Command::Guide(args) => guide::pictures(args, out),
        Command::Pictures(args) => pictures::report(args, out),
    }
}

/// Prints one line.
pub(crate) fn say(out: Out<'_>, line: &str) -> Result<(), BenchError> {
    writeln!(out, "{line}").and_then(|()| out.flush()).map_err(BenchError::Output)
}

/// The camera [of that name](Scene::camera_named); the first one, or one made for the scene, without a name.
pub(crate) fn camera(scene: &Scene, name: Option<&str>) -> Result<Camera, BenchError> {
    Ok(name.map_or_else(|| Ok(scene.default_camera()), |name| scene.camera_named(name))?)
}

fn reference(args: &ReferenceArgs, out: Out<'_>) -> Result<(), BenchError> {
    for path in std::iter::once(&args.image).chain(&args.sigma) {
        ImageKind::of(path)?;
    }
    let mut scene = Scene::load(&args.scene)?;
    let mut camera = camera(&scene, args.camera.as_deref())?;
    if let Some(radiance) = args.sky {
        scene.add_sky(Rgb::splat(radiance))?;
    }
    if let Some(width) = args.width {
        let height = f64::from(camera.height) * f64::from(width) / f64::from(camera.width);
        camera = Camera { width, height: (height.round() as u32).clamp(1, 16384), ..camera };
    }
    let visibility = path_tracer::visibility(&scene)?;
    let tracer = PathTracer::new(&scene, &visibility);
    let start = Instant::now();
    let found = tracer.render(&camera, args.spp, args.seed, &|_| ());
    let seconds = start.elapsed().as_secs_f64();
    found.image.save(&args.image, &ToneMap::default(), scene.primaries)?;
    if let Some(path) = &args.sigma {
        found.sigma.save(path, &ToneMap::default(), scene.primaries)?;
    }
    let sum = |image: &hr_scene::Image| image.pixels.iter().map(|p| p.as_dvec3().element_sum()).sum::<f64>();
    let noise = 100.0 * sum(&found.sigma) / sum(&found.image).max(f64::MIN_POSITIVE);
    let Camera { width, height, .. } = camera;
    say(out, &format!("{width} x {height} pixels, {} paths each, {seconds:.1} s, noise {noise:.2} %", args.spp))
}

fn compare_files(args: &CompareArgs, out: Out<'_>) -> Result<(), BenchError> {
    let (image, reference) = (float_image::read(&args.image)?, float_image::read(&args.reference)?);
    let sigma = args.sigma.as_deref().map(float_image::read).transpose()?;
    let below = args.below.unwrap_or(f64::INFINITY);
    let found = compare(&image, &reference, sigma.as_ref(), |_, p| luminance(p) < below)?;
    say(out, &found.to_string())?;
    match args.max_block {
        Some(most) if found.block_l1 > most => {
            let (block, most) = (100.0 * found.block_l1, 100.0 * most);
            Err(BenchError::Compare(format!("block L1 is {block:.2} %, more than {most:.2} %")))
        }
        _ => Ok(()),
    }
}

fn measure_accuracy(args: &AccuracyArgs, out: Out<'_>) -> Result<(), BenchError> {
    if let Some(folder) = &args.reference {
        let wanted = |name: &str| args.scenes.is_empty() || args.scenes.iter().any(|scene| scene == name);
        return accuracy::report(&listed(folder, wanted, out)?, &args.error, out);
    }
    let all = || builtin::NAMES.iter().map(|&name| name.to_owned()).collect();
    let names: Vec<String> = if args.scenes.is_empty() { all() } else { args.scenes.clone() };
    let making = Making { folder: &args.out, spp: args.spp, width: args.width };
    let scenes = names.iter().map(|name| Scene::load(name).map(Arc::new)).collect::<Result<Vec<_>, _>>()?;
    let subjects = scenes.into_iter().map(|scene| path_traced(scene, &making, out)).collect::<Result<Vec<_>, _>>()?;
    accuracy::report(&subjects, &args.error, out)
}

fn measure_visibility(args: &VisibilityArgs, out: Out<'_>) -> Result<(), BenchError> {
    let scene = Arc::new(Scene::load(&args.scene)?);
    let camera = camera(&scene, None)?;
    visibility::report(&scene, &camera, args.rays, args.error, out)
}

fn measure_threads(args: &ThreadsArgs, out: Out<'_>) -> Result<(), BenchError> {
    let scene = Arc::new(Scene::load(&args.scene)?);
    threads::report(&scene.name, &scene.input(), args.error, out)
}

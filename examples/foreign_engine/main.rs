//! Glossy light for an engine of somebody else: `engine.rs` and `boxes.rs` are one that knows nothing of this library,
//! shooting where ours gathers. What it takes to give it glossy reflection is all in `glossy.rs` and in the lines of
//! `engine.rs` that end in `// +`: it implements `Hierarchy`, and calls `GlossyField`. Nothing of our solver is used.
//!
//! `cargo run --release --example foreign_engine`

mod answers;
mod boxes;
mod engine;
mod facets;
mod glossy;
#[cfg(test)]
mod tests;

use answers::Answer;
use engine::{Engine, Paint};
use glossy::Glossy;
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_scene::Scene;
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

/// Length of patches in the scene's unit.
const FINENESS: f64 = 0.2;
/// The error that our solver is asked for.
const ERROR: f32 = 0.02;

/// An engine for one of our scenes, as far as it can have one: flat facets that reflect in front.
fn engine(scene: &Scene, fineness: f64) -> Engine {
    let patches = scene.surfaces.iter().flat_map(|surface| facets::facets(surface, fineness)).collect::<Vec<_>>();
    let paint = |material: &hr_scene::Material| Paint {
        reflectance: material.reflector.diffuse(),
        exitance: material.exitance,
    };
    let paints = scene.materials.iter().map(paint).collect();
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    #[cfg(test)]
    let field = glossy_ext::hooks::conformance::Watched::new(field);
    let glossy = Glossy::new(field, patches.len());
    Engine::new(patches, paints, glossy)
}

/// Lines of code that were added for glossy light: those of a file, and those that are marked in the engine's.
fn added_lines() -> [usize; 2] {
    let is_code = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with("//");
    let marked = |line: &&str| line.ends_with("// +");
    let (file, engine) = (include_str!("glossy.rs"), include_str!("engine.rs"));
    [file.lines().filter(is_code).count(), engine.lines().filter(is_code).filter(marked).count()]
}

#[expect(clippy::print_stdout, reason = "an example shows what it found")]
fn main() -> Result<(), Box<dyn Error>> {
    let [file, marked] = added_lines();
    println!("Lines added to the engine for glossy light: {} ({file} + {marked})", file + marked);
    let scene = Arc::new(Scene::load("glossy-sphere")?);
    let mut engine = engine(&scene, FINENESS);
    let start = Instant::now();
    let shots = engine.solve();
    println!("{} patches, {shots} shots, {:.1} s", engine.patches.len(), start.elapsed().as_secs_f64());
    let theirs = Answer::of_engine(&scene, &engine);
    let ours = Answer::of_solver(&scene, ERROR)?;
    println!("\n                                 this engine      ours");
    println!("irradiance of the ceiling (W/m²)      {:6.3}    {:6.3}", theirs.mean(), ours.mean());
    println!("  by blocks of it, they differ by {:.1} %", 100.0 * theirs.ceilings_differ(&ours));
    for ((name, _), (theirs, ours)) in scene.cameras.iter().zip(theirs.floor.iter().zip(&ours.floor)) {
        println!("glossy light of the floor toward camera {name:5}  {theirs:6.3}    {ours:6.3} W/(m² sr)");
    }
    Ok(())
}

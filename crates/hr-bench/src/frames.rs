//! What frames of a walk cost: the paper's measure of section 5, frames per second over the share of glossy elements and
//! the tolerance of their renewal.

use crate::BenchError;
use crate::args::ViewArgs;
use crate::measure::cpu_seconds;
use crate::run::{Out, say};
use glam::DVec3;
use hr_diffuse::{Rgb, Settings};
use hr_scene::{Camera, Scene};
use hr_view::at_pixels::AtPixels;
use hr_view::camera_path::CameraPath;
use hr_view::display::{DisplayMesh, Walkable};
use hr_view::solution_file;
use hr_view::solved::Solved;
use hr_view::walkthrough::Walkthrough;
use hr_view::window::{FrameCost, Offscreen};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

/// A walk of which only some of the glossy vertices follow the eye.
struct Thinned<'a> {
    walk: &'a dyn Walkable,
    mesh: DisplayMesh,
    /// Positions in the walk's own list of glossy vertices.
    kept: Vec<u32>,
}

impl<'a> Thinned<'a> {
    /// A share (0…1) of them, spread evenly.
    fn new(walk: &'a dyn Walkable, share: f32) -> Self {
        let mut mesh = walk.mesh().clone();
        // The golden ratio's multiples are spread evenly, however many there are.
        let is_kept = |slot: u32| (f64::from(slot) * 0.618_033_988_75).fract() < f64::from(share);
        let kept: Vec<u32> = (0..mesh.glossy.len() as u32).filter(|&slot| is_kept(slot)).collect();
        mesh.glossy = kept.iter().map(|&slot| walk.mesh().glossy[slot as usize]).collect();
        Self { walk, mesh, kept }
    }
}

impl Walkable for Thinned<'_> {
    fn name(&self) -> &str {
        self.walk.name()
    }
    fn mesh(&self) -> &DisplayMesh {
        &self.mesh
    }
    fn cameras(&self) -> &[(String, Camera)] {
        self.walk.cameras()
    }
    fn prefers_pixels(&self) -> bool {
        self.walk.prefers_pixels()
    }
    fn at_pixels(&self, most: u64) -> Option<AtPixels> {
        let mut light = self.walk.at_pixels(most)?;
        // Triangles without a vertex that is kept look as they do without gloss.
        let mut is_kept = vec![false; self.mesh.positions.len()];
        self.mesh.glossy.iter().for_each(|&vertex| is_kept[vertex as usize] = true);
        for part in &mut light.parts {
            part.triangles.retain(|&(triangle, _)| {
                let first = 3 * triangle as usize;
                self.mesh.indices[first..first + 3].iter().any(|&corner| is_kept[corner as usize])
            });
        }
        Some(light)
    }
    fn glossy_radiance(&self, eye: DVec3, vertices: &[u32], out: &mut [Rgb]) {
        let slots: Vec<u32> = vertices.iter().map(|&v| self.kept[v as usize]).collect();
        self.walk.glossy_radiance(eye, &slots, out);
    }
}

/// Solves, walks, and prints a Markdown table.
///
/// # Errors
/// Where there is no scene, no walk, no solution, no graphics device.
pub fn report(args: &ViewArgs, out: Out<'_>) -> Result<(), BenchError> {
    let scene = Arc::new(Scene::load(&args.scene)?);
    let path = args.path.as_deref().map(CameraPath::load).transpose()?;
    let solved = match &args.load {
        Some(file) => solution_file::load(file, scene)?.0,
        None => {
            let settings = Settings::with_error(args.error);
            Solved::new(scene, settings, true, &mut |_| ControlFlow::Continue(()))?
        }
    };
    let walk = Walkthrough::new(Arc::new(solved), args.mode);
    let path = path.unwrap_or_else(|| walk.tour());
    let cameras = path.cameras(args.frames as usize);
    let mesh = walk.mesh();
    let counts = [mesh.triangle_count(), mesh.positions.len(), mesh.glossy.len()];
    let size = [args.width, args.height];
    let first = Offscreen::new(&walk, size)?;
    say(out, &format!("{}, {} × {}, {} frames on {}", args.scene, size[0], size[1], args.frames, first.adapter()))?;
    let bytes = first.device_bytes().map_or("unknown".to_owned(), |b| format!("{:.1} MB", b as f64 * 1e-6));
    drop(first);
    let [triangles, vertices, glossy] = counts;
    say(out, &format!("{triangles} triangles, {vertices} vertices, {glossy} of them glossy; device memory {bytes}\n"))?;
    say(out, HEAD)?;
    say(out, &format!("|{}", " ---: |".repeat(12)))?;
    for &share in &args.share {
        let thinned = Thinned::new(&walk, share);
        for (i, &degrees) in args.tolerance.iter().enumerate() {
            if share == 0.0 && i > 0 {
                // There is nothing that it could change.
                continue;
            }
            let mut stage = Offscreen::new(&thinned, size)?;
            // The first frame evaluates all there is to be seen, and is no part of a walk.
            stage.frame(&cameras[0], 0.0)?;
            let start = cpu_seconds();
            let mut outside = 0.0;
            let costs = cameras[1..].iter().map(|camera| {
                let before = cpu_seconds();
                let begun = stage.begin(camera, degrees.to_radians());
                outside += cpu_seconds() - before;
                stage.end(begun)
            });
            let costs = costs.collect::<Result<Vec<FrameCost>, _>>()?;
            let per_frame = |seconds: f64| 1e3 * seconds / costs.len().max(1) as f64;
            let cpu = [cpu_seconds() - start, outside].map(per_frame);
            say(out, &line(share * glossy as f32 / vertices.max(1) as f32, degrees, cpu, &costs))?;
        }
    }
    Ok(())
}

/// Times are by the clock but *CPU*, which is the time of all threads of the process: on a machine that others use, too,
/// the clock runs on while they do. *Outside* is outside of the rasteriser.
const HEAD: &str = "| glossy vertices | ε | frames/s | median ms | 95 % | 99 % | outside median ms | 95 % | CPU ms | \
                    outside CPU ms | seen | evaluated |";

/// A line of the table.
fn line(share: f32, degrees: f32, [cpu, outside_cpu]: [f64; 2], costs: &[FrameCost]) -> String {
    let whole = percentiles(costs, |cost| cost.whole);
    let outside = percentiles(costs, |cost| cost.outside);
    let mean = |count: &dyn Fn(&FrameCost) -> usize| costs.iter().map(count).sum::<usize>() / costs.len().max(1);
    let seconds: f64 = costs.iter().map(|cost| cost.whole.as_secs_f64()).sum();
    format!(
        "| {:.1} % | {degrees}° | {:.1} | {:.1} | {:.1} | {:.1} | {:.2} | {:.2} | {cpu:.1} | {outside_cpu:.2} | {} | {} |",
        100.0 * share,
        costs.len() as f64 / seconds.max(1e-9),
        whole[0],
        whole[1],
        whole[2],
        outside[0],
        outside[1],
        mean(&|cost| cost.visible),
        mean(&|cost| cost.evaluated),
    )
}

/// The time in milliseconds that half, 95 % and 99 % of all frames do not exceed.
fn percentiles(costs: &[FrameCost], time: impl Fn(&FrameCost) -> Duration) -> [f64; 3] {
    let mut times: Vec<f64> = costs.iter().map(|cost| 1e3 * time(cost).as_secs_f64()).collect();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let rank = (share * times.len() as f64).ceil().max(1.0) as usize;
        times.get(rank - 1).copied().unwrap_or(0.0)
    };
    [at(0.5), at(0.95), at(0.99)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_the_ranks() {
        let costs: Vec<FrameCost> =
            (1..=200).rev().map(|i| FrameCost { whole: Duration::from_millis(i), ..FrameCost::default() }).collect();
        assert_eq!(percentiles(&costs, |cost| cost.whole), [100.0, 190.0, 198.0], "of 1 … 200 ms");
        assert_eq!(percentiles(&costs[..1], |cost| cost.whole), [200.0; 3], "of a single one");
    }

    #[test]
    fn a_short_walk_gives_a_table() {
        let args = ViewArgs {
            scene: "glossy-sphere".into(),
            path: None,
            error: 0.5,
            load: None,
            mode: hr_view::Mode::Distributions,
            frames: 4,
            width: 64,
            height: 40,
            tolerance: vec![0.0, 90.0],
            share: vec![0.0, 1.0],
        };
        let mut said = Vec::new();
        match report(&args, &mut said) {
            Err(BenchError::Window(hr_view::window::WindowError::NoAdapter(why))) => {
                return eprintln!("skipped, no graphics device: {why}");
            }
            done => done.expect("a table"),
        }
        let said = String::from_utf8(said).expect("text");
        let rows: Vec<Vec<&str>> = said.lines().filter(|l| l.contains('°')).map(|l| l.split('|').collect()).collect();
        assert_eq!(rows.len(), 3, "one row without gloss, two with it:\n{said}");
        let evaluated: Vec<usize> = rows.iter().map(|r| r[12].trim().parse().expect("a count")).collect();
        assert!(evaluated[0] == 0 && evaluated[1] > 0, "gloss is evaluated only where there is any:\n{said}");
        assert!(evaluated[2] < evaluated[1], "a tolerance saves evaluations:\n{said}");
    }
}

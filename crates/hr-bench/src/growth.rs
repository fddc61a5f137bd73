//! How time and memory grow with a scene: the same generated scene at several sizes, each solved in a process of its
//! own, so that every size has its own peak of memory.

mod scenes;

pub use scenes::{Kind, scene};

use crate::BenchError;
use crate::args::GrowthArgs;
use crate::measure::{Cost, Extent, solve};
use crate::run::{Out, say};
use serde::{Deserialize, Serialize};
use std::process::Command;
use std::time::Duration;

/// What a process tells about its size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    polygons: u64,
    leaves: u64,
    links: u64,
    rays: u64,
    cpu: f64,
    wall: f64,
    phases: [f64; 3],
    vertices: f64,
    peak: u64,
    bytes: u64,
    stopped: bool,
}

impl From<Cost> for Row {
    fn from(cost: Cost) -> Self {
        let Cost { polygons, leaves, links, rays, cpu, wall, phases, vertices, peak, bytes, stopped, .. } = cost;
        Self { polygons, leaves, links, rays, cpu, wall, phases, vertices, peak, bytes, stopped }
    }
}

/// Prints a Markdown table for every kind of scene, with the exponents that fit it. With `--single`, what one process
/// has to tell, as JSON.
///
/// # Errors
/// Where a scene cannot be solved, or a process not be started.
pub fn report(args: &GrowthArgs, out: Out<'_>) -> Result<(), BenchError> {
    let extent = Extent { limit: Some(Duration::from_secs(args.limit)), vertices: args.vertices };
    let kinds = if args.kind.is_empty() { Kind::ALL.to_vec() } else { args.kind.clone() };
    if args.single {
        for (&kind, &size) in kinds.iter().zip(&args.sizes) {
            let (_, cost) = solve(&scene(kind, size), args.error, args.threads, extent)?;
            say(out, &serde_json::to_string(&Row::from(cost)).map_err(|e| BenchError::Process(e.to_string()))?)?;
        }
        return Ok(());
    }
    for kind in kinds {
        say(out, &format!("{kind}, error {}, {} threads (0: all cores)\n", args.error, args.threads))?;
        say(
            out,
            "| polygons | leaves | links | links per leaf | rays | solve CPU s | solve wall s | build, refine, transport wall s | vertices CPU s | peak MB | \
             bytes of peak per link | nodes and links MB |",
        )?;
        say(out, &format!("|{}", " ---: |".repeat(12)))?;
        let mut rows = Vec::new();
        for &size in &args.sizes {
            match child(kind, size, args) {
                Ok(row) => {
                    say(out, &text(&row))?;
                    rows.push(row);
                }
                // Out of memory, say: the sizes before it still count.
                Err(BenchError::Process(what)) => {
                    say(out, &format!("\n{kind} of {size}: {what}"))?;
                    break;
                }
                Err(other) => return Err(other),
            }
        }
        say(out, "")?;
        rows.retain(|row| !row.stopped);
        for (what, of) in MEASURES {
            let points: Vec<[f64; 2]> = rows.iter().map(|row| [row.polygons as f64, of(row)]).collect();
            let Some(all) = exponent(&points) else { continue };
            let last = exponent(&points[points.len() - 2..]).unwrap_or(all);
            say(out, &format!("- {what}: polygons to the power of {all:.2}; {last:.2} between the two largest"))?;
        }
        say(out, "")?;
    }
    Ok(())
}

/// A number of a row.
type Measure = fn(&Row) -> f64;

/// What exponents are fitted to.
const MEASURES: [(&str, Measure); 4] = [
    ("solve CPU time", |row| row.cpu),
    ("vertices CPU time", |row| row.vertices),
    ("peak memory", |row| row.peak as f64),
    ("links", |row| row.links as f64),
];

/// Solves one size in a process of its own.
fn child(kind: Kind, size: u64, args: &GrowthArgs) -> Result<Row, BenchError> {
    let wrong = |what: String| BenchError::Process(what);
    let program = std::env::current_exe().map_err(|error| wrong(error.to_string()))?;
    let options = [
        ("--kind", kind.to_string()),
        ("--sizes", size.to_string()),
        ("--error", args.error.to_string()),
        ("--threads", args.threads.to_string()),
        ("--limit", args.limit.to_string()),
    ];
    let words = options.iter().flat_map(|(option, value)| [*option, value]);
    let vertices = args.vertices.then_some("--vertices");
    let done = Command::new(program).args(["growth", "--single"]).args(words).args(vertices).output();
    let done = done.map_err(|error| wrong(error.to_string()))?;
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        return Err(wrong(format!("{}; {}", done.status, said.lines().next().unwrap_or("nothing said"))));
    }
    serde_json::from_slice(&done.stdout).map_err(|error| wrong(error.to_string()))
}

fn text(row: &Row) -> String {
    let (links, megabytes) = (row.links.max(1) as f64, |bytes: u64| bytes as f64 * 1e-6);
    format!(
        "| {} | {} | {} | {:.1} | {} | {:.2}{} | {:.2} | {:.2}, {:.2}, {:.2} | {:.2} | {:.1} | {:.0} | {:.1} |",
        row.polygons,
        row.leaves,
        row.links,
        links / row.leaves.max(1) as f64,
        row.rays,
        row.cpu,
        if row.stopped { " (stopped)" } else { "" },
        row.wall,
        row.phases[0],
        row.phases[1],
        row.phases[2],
        row.vertices,
        megabytes(row.peak),
        row.peak as f64 / links,
        megabytes(row.bytes),
    )
}

/// The exponent of the power law that fits points best: the slope of their logarithms, by least squares.
fn exponent(points: &[[f64; 2]]) -> Option<f64> {
    let logarithms: Vec<[f64; 2]> =
        points.iter().map(|p| p.map(f64::ln)).filter(|p| p[0].is_finite() && p[1].is_finite()).collect();
    let count = logarithms.len() as f64;
    let mean = |axis: usize| logarithms.iter().map(|p| p[axis]).sum::<f64>() / count;
    let (x, y) = (mean(0), mean(1));
    let spread: f64 = logarithms.iter().map(|p| (p[0] - x).powi(2)).sum();
    let common: f64 = logarithms.iter().map(|p| (p[0] - x) * (p[1] - y)).sum();
    (logarithms.len() > 1 && spread > 0.0).then(|| common / spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_laws_are_found() {
        let law = |x: f64| [x, 3.0 * x.powf(1.25)];
        let found = exponent(&[law(10.0), law(100.0), law(5000.0)]).expect("three points");
        assert!((found - 1.25).abs() < 1e-9, "{found}, made as 1.25");
        assert_eq!(exponent(&[law(10.0)]), None, "one point has no slope");
        assert_eq!(exponent(&[[1.0, 0.0], [2.0, 0.0]]), None, "0 has no logarithm");
    }

    #[test]
    fn a_process_tells_its_size() {
        let args = GrowthArgs {
            kind: vec![Kind::City],
            sizes: vec![100],
            error: 0.5,
            threads: 1,
            limit: 100,
            vertices: false,
            single: true,
        };
        let mut said = Vec::new();
        report(&args, &mut said).expect("sound");
        let row: Row = serde_json::from_slice(&said).expect("JSON");
        assert!(row.polygons == 100 && row.links > 0 && !row.stopped, "{row:?}");
        assert_eq!(text(&row).matches('|').count(), 13, "a row of the table: {}", text(&row));
    }
}

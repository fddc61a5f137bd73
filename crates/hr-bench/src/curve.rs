//! The diffuse solver's error over its time: scenes solved at several errors, and how far the solutions are from a
//! reference and from the finest of them.
//!
//! Both distances are relative: Σ area |B − B'| / Σ area B' over areas that are no emitters, B' being right. The
//! reference's is over its own triangles (see [`irradiance`]). The finest solution's is over surfaces: mean
//! radiosities of surface sides are compared, which is blind for what is wrong within a side, and for an error that all
//! solutions share; it is there because other programs have been measured by it.

use crate::BenchError;
use crate::args::CurveArgs;
use crate::irradiance::{self, Agreement};
use crate::measure::{Cost, Extent, solve};
use crate::plot::{Line, svg};
use crate::run::{Out, say};
use hr_diffuse::{LightField, Rgb, SceneInput, Solution};
use hr_scene::Scene;
use std::path::Path;
use std::sync::Arc;

/// Solves that are faster than this are repeated: seconds of processor time.
const FAST: f64 = 1.0;

/// Another program's error over its time: seconds of processor time, distance from its own finest solution.
struct Published {
    scene: &'static str,
    points: &'static [[f64; 2]],
}

/// Measured with rpkCpp, the C++ version of RenderPark, on 1 core: Galerkin radiosity with clusters, link error
/// thresholds of 1e-3 to 1e-6. The times are those of this scene; the errors, against a solution at 1e-7, are those of
/// the same scene with its glossy parts, which it leaves out.
const RENDERPARK: [Published; 1] =
    [Published { scene: "cube_diffuse", points: &[[0.05, 0.046], [0.10, 0.0125], [0.32, 0.0039], [1.37, 0.001_35]] }];

/// One solution.
#[derive(Clone, Debug)]
struct Point {
    asked: f32,
    cost: Cost,
    /// Mean radiosities of all sides that are no emitters, with their areas.
    sides: Vec<(f64, Rgb)>,
    reference: Option<Agreement>,
    /// Distance from the finest solution; `None` for that itself.
    finest: Option<f64>,
}

/// Prints a Markdown table and writes `curve.csv` and `curve.svg`.
///
/// # Errors
/// Where a scene cannot be solved, a reference does not belong to it, or files cannot be read or written.
pub fn report(args: &CurveArgs, out: Out<'_>) -> Result<(), BenchError> {
    if args.reference.len() > args.scenes.len() {
        let (references, scenes) = (args.reference.len(), args.scenes.len());
        return Err(BenchError::Arguments(format!(
            "{references} references for {scenes} scenes; give the first scene's first, then the second's"
        )));
    }
    let mut csv = String::from(
        "scene,error_asked,cpu_s,wall_s,vertices_cpu_s,leaves,links,rays,bytes,error_believed,radiosity_l1,irradiance_l1,\
         shown_l1,bias,reference_noise,finest_l1,renderpark_cpu_s\n",
    );
    let mut lines = Vec::new();
    say(
        out,
        "| scene | error asked | CPU s | wall s | leaves | links | rays | MB | believed | radiosity L1 | irradiance L1 | \
         shown L1 | bias | reference noise | from finest L1 | CPU time over RenderPark's |",
    )?;
    say(out, &format!("|{}", " --- |".repeat(16)))?;
    for (i, scene) in args.scenes.iter().enumerate() {
        let scene = Arc::new(Scene::load(scene)?);
        let name = Path::new(&scene.name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let reference = args.reference.get(i).map(|path| irradiance::read(path)).transpose()?;
        let input = scene.input();
        let mut points = Vec::new();
        for &error in &args.errors {
            points.push(measure(&input, error, args, reference.as_deref())?);
        }
        compare_with_finest(&mut points);
        let published = RENDERPARK.iter().find(|p| p.scene == name).map(|p| p.points);
        for point in &points {
            let theirs = published.zip(point.finest).and_then(|(points, error)| time_at(points, error));
            say(out, &row(&name, point, theirs))?;
            csv += &record(&name, point, theirs);
        }
        if let Some(missing) = points.iter().filter_map(|p| p.reference).map(|r| r.missing).max().filter(|&m| m > 0) {
            let count = reference.as_ref().map_or(0, Vec::len);
            say(out, &format!("\n{name}: {missing} of the reference's {count} triangles are on no surface\n"))?;
        }
        lines.extend(drawn(&name, i, &points));
        if let Some(points) = published {
            let name = format!("{name}: RenderPark");
            lines.push(Line { name, points: points.to_vec(), dashed: false, color: 7 });
        }
    }
    let title = "Relative L1 error over time (solid: from finest; dashed: from reference)";
    let plot = svg(title, ["processor time, s", "relative L1 error"], &lines);
    write(&args.out, "curve.csv", &csv)?;
    write(&args.out, "curve.svg", &plot)
}

/// Solves a scene, more than once if that is quick, and compares it with the reference.
fn measure(
    input: &SceneInput,
    asked: f32,
    args: &CurveArgs,
    reference: Option<&[irradiance::Triangle]>,
) -> Result<Point, BenchError> {
    let (mut solution, mut cost) = solve(input, asked, args.threads, Extent::FULL)?;
    for _ in 1..args.repeat {
        if cost.cpu >= FAST {
            break;
        }
        let (again, faster) = solve(input, asked, args.threads, Extent::FULL)?;
        if faster.cpu < cost.cpu {
            (solution, cost) = (again, faster);
        }
    }
    let reference = reference.map(|reference| irradiance::compare(&solution, reference)).transpose()?;
    let sides = sides(&solution, &solution.exitant.radiosity);
    Ok(Point { asked, cost, sides, reference, finest: None })
}

/// Mean of a quantity by node, and area (unit space), of every side of a surface that is no emitter.
pub(crate) fn sides<L: LightField>(solution: &Solution<L>, quantity: &[Rgb]) -> Vec<(f64, Rgb)> {
    let mut sides = Vec::new();
    for (surface, nodes) in solution.elements.surface_nodes.iter().enumerate() {
        let material = &solution.scene.materials[solution.scene.surface_materials[surface] as usize];
        for &node in nodes.iter().filter(|&&node| node != u32::MAX && material.exitance == Rgb::ZERO) {
            let area = f64::from(solution.elements.nodes[node as usize].area);
            sides.push((area, quantity[node as usize]));
        }
    }
    sides
}

/// The finest solution is that of the smallest error asked for.
fn compare_with_finest(points: &mut [Point]) {
    let Some(finest) = points.iter().min_by(|a, b| a.asked.total_cmp(&b.asked)).cloned() else { return };
    for point in points.iter_mut().filter(|point| point.asked > finest.asked) {
        point.finest = Some(distance(&point.sides, &finest.sides));
    }
}

/// Σ area |a − b| / Σ area b.
pub(crate) fn distance(ours: &[(f64, Rgb)], right: &[(f64, Rgb)]) -> f64 {
    let (mut error, mut total) = (0.0, 0.0);
    for ((area, a), (_, b)) in ours.iter().zip(right) {
        error += area * f64::from((*a - *b).abs().element_sum());
        total += area * f64::from(b.element_sum());
    }
    if total > 0.0 { error / total } else { 0.0 }
}

/// The time (or whatever else an error costs) at which an error is reached, between points of (time, error), both in
/// logarithms.
pub(crate) fn time_at(points: &[[f64; 2]], error: f64) -> Option<f64> {
    points.windows(2).find_map(|pair| {
        let [[t0, e0], [t1, e1]] = [pair[0], pair[1]];
        let share = (error / e0).ln() / (e1 / e0).ln();
        (0.0..=1.0).contains(&share).then(|| t0 * (t1 / t0).powf(share))
    })
}

fn row(name: &str, point: &Point, theirs: Option<f64>) -> String {
    let Point { asked, cost, .. } = point;
    let percent = |v: Option<f64>| v.map_or("-".into(), |v| format!("{:.2} %", 100.0 * v));
    let of = |value: fn(&Agreement) -> f64| percent(point.reference.as_ref().map(value));
    format!(
        "| {name} | {asked} | {:.3} | {:.3} | {} | {} | {} | {:.1} | {} | {} | {} | {} | {} | {} | {} | {} |",
        cost.cpu,
        cost.wall,
        cost.leaves,
        cost.links,
        cost.rays,
        cost.bytes as f64 * 1e-6,
        cost.believed,
        of(|a| a.radiosity),
        of(|a| a.irradiance),
        of(|a| a.shown),
        of(|a| a.bias),
        of(|a| a.noise),
        percent(point.finest),
        theirs.map_or("-".into(), |theirs| format!("{:.2}", cost.cpu / theirs)),
    )
}

fn record(name: &str, point: &Point, theirs: Option<f64>) -> String {
    let Point { asked, cost, .. } = point;
    let or_nothing = |v: Option<f64>| v.map_or(String::new(), |v| v.to_string());
    let of = |value: fn(&Agreement) -> f64| or_nothing(point.reference.as_ref().map(value));
    let counts = [cost.leaves, cost.links, cost.rays, cost.bytes].map(|v| v.to_string()).join(",");
    let errors =
        [of(|a| a.radiosity), of(|a| a.irradiance), of(|a| a.shown), of(|a| a.bias), of(|a| a.noise)].join(",");
    let (finest, theirs) = (or_nothing(point.finest), or_nothing(theirs));
    let Cost { cpu, wall, vertices, believed, .. } = cost;
    format!("{name},{asked},{cpu},{wall},{vertices},{counts},{believed},{errors},{finest},{theirs}\n")
}

fn drawn(name: &str, color: usize, points: &[Point]) -> Vec<Line> {
    let line = |what: &str, dashed, error: fn(&Point) -> Option<f64>| Line {
        name: format!("{name}{what}"),
        points: points.iter().filter_map(|p| Some([p.cost.cpu, error(p)?])).collect(),
        dashed,
        color,
    };
    let mut lines = vec![line("", false, |p| p.finest)];
    if points.iter().any(|p| p.reference.is_some()) {
        lines.push(line(", reference", true, |p| p.reference.map(|r| r.radiosity)));
    }
    lines
}

/// Writes a file into a folder that is made where it is not there.
fn write(folder: &Path, name: &str, text: &str) -> Result<(), BenchError> {
    let path = folder.join(name);
    let written = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, text));
    written.map_err(|source| BenchError::Write { path, source })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(scene: &str, out: &Path) -> CurveArgs {
        CurveArgs {
            scenes: vec![scene.into()],
            errors: vec![0.2, 0.1, 0.04],
            reference: Vec::new(),
            threads: 1,
            repeat: 1,
            out: out.to_owned(),
        }
    }

    #[test]
    fn times_are_interpolated_in_logarithms() {
        let points = [[0.1, 0.1], [10.0, 0.001], [1000.0, 0.0001]];
        for (error, expected) in [(0.1, Some(0.1)), (0.01, Some(1.0)), (0.001, Some(10.0)), (0.0001, Some(1000.0))] {
            let found = time_at(&points, error).zip(expected).map(|(a, b)| (a / b - 1.0).abs());
            assert!(found.is_some_and(|off| off < 1e-9), "at {error}: {:?}", time_at(&points, error));
        }
        assert_eq!((time_at(&points, 0.2), time_at(&points, 1e-5)), (None, None), "outside nothing is known");
    }

    #[test]
    fn distances_are_weighted_by_area() {
        let grey = Rgb::splat;
        let (ours, right) = ([(3.0, grey(1.0)), (1.0, grey(2.0))], [(3.0, grey(1.0)), (1.0, grey(1.0))]);
        assert_eq!((distance(&ours, &right), distance(&right, &right)), (0.25, 0.0), "by hand");
    }

    #[test]
    fn a_scene_gets_a_table_a_file_and_a_plot() {
        let folder = std::env::temp_dir().join(format!("hr-bench-curve-{}", std::process::id()));
        let mut said = Vec::new();
        let done = report(&args("cornell", &folder), &mut said);
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap_or_default();
        let (csv, plot) = (read("curve.csv"), read("curve.svg"));
        drop(std::fs::remove_dir_all(&folder));
        done.expect("sound");
        let said = String::from_utf8(said).expect("text");
        let rows: Vec<&str> = said.lines().collect();
        assert_eq!(rows.len(), 5, "a head and three errors: {said}");
        assert!(rows.iter().all(|r| r.matches('|').count() == 17), "as many columns everywhere: {said}");
        let columns: Vec<usize> = csv.lines().map(|line| line.matches(',').count()).collect();
        assert_eq!(columns, [16; 4], "{csv}");
        let finest: Vec<f64> = csv.lines().skip(1).filter_map(|l| l.split(',').nth(15)?.parse().ok()).collect();
        assert!(finest.len() == 2 && finest.iter().all(|&e| e > 0.0 && e < 0.8), "the finest has none: {finest:?}");
        assert_eq!(plot.matches("<circle").count(), 2, "two points");
    }

    #[test]
    fn references_need_their_scenes() {
        let mut two = args("cornell", Path::new("nowhere"));
        two.reference = vec!["a.csv".into(), "b.csv".into()];
        let error = report(&two, &mut Vec::new()).expect_err("too many");
        assert!(matches!(error, BenchError::Arguments(_)), "{error}");
        two.reference.truncate(1);
        let error = report(&two, &mut Vec::new()).expect_err("no such file").to_string();
        assert!(error.contains("a.csv"), "{error}");
    }
}

//! Tables 3 and 4: whole solutions by illumination samples and by Radiance Clustering.

use super::clustering::RadianceClustering;
use super::{Page, relative, saved};
use crate::BenchError;
use crate::measure::{cpu_seconds, thread_seconds};
use glam::Vec3;
use glossy_ext::haar::{Haar, Refinement};
use glossy_ext::samples::SampleSet;
use glossy_ext::{GlossyField, Outgoing, Reflector};
use hr_diffuse::{Arrived, Cone, Hierarchy, LightField, NodeId, Rgb, Settings, Solver, Transfer};
use hr_scene::Scene;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A row of the paper's tables 3 and 4.
struct Case {
    /// A scene of ours.
    scene: &'static str,
    epsilon: f32,
    levels: [u8; 2],
    /// The paper's, by illumination samples and by Radiance Clustering.
    functions: [u32; 2],
    seconds: [f64; 2],
}

const CASES: [Case; 6] = [
    Case { scene: "three-lights", epsilon: 0.5, levels: [1, 3], functions: [8618, 13_866], seconds: [44.6, 90.1] },
    Case { scene: "three-lights", epsilon: 0.1, levels: [1, 3], functions: [8820, 14_068], seconds: [44.2, 90.0] },
    Case { scene: "three-lights", epsilon: 0.5, levels: [1, 4], functions: [27_306, 43_510], seconds: [49.3, 95.5] },
    Case { scene: "three-lights", epsilon: 0.5, levels: [1, 5], functions: [79_218, 125_944], seconds: [58.6, 105.3] },
    Case {
        scene: "glossy-sphere",
        epsilon: 0.5,
        levels: [1, 3],
        functions: [2_114_324, 3_598_720],
        seconds: [4167.1, 6492.9],
    },
    Case {
        scene: "empty-room",
        epsilon: 0.5,
        levels: [1, 3],
        functions: [2_097_534, 3_339_794],
        seconds: [5207.6, 7117.4],
    },
];

/// One of the two ways to reflect the light of a solution.
#[derive(Clone, Copy, Debug)]
struct Way {
    functions: usize,
    evaluations: u64,
    seconds: f64,
}

/// A solution, and what both ways cost.
struct Solved {
    links: u64,
    samples: Way,
    clustering: Way,
}

/// Both ways side by side: each leaf is reflected by both whenever it is. The light of samples goes on, so that both have the
/// same links, the same leaves and as many reflections.
struct Both {
    samples: GlossyField,
    clustering: RadianceClustering,
    /// Processor time of either, nanoseconds.
    spent: [AtomicU64; 2],
}

/// What a leaf sends by samples, and how many functions it is by clustering.
#[derive(Default)]
struct Sent {
    light: Outgoing<Haar>,
    clustered: usize,
}

impl Both {
    fn new(reflectors: &[Arc<dyn Reflector>], refinement: Refinement) -> Self {
        let samples = GlossyField::new(reflectors, refinement);
        let clustering = RadianceClustering::new(reflectors, refinement);
        Self { samples, clustering, spent: Default::default() }
    }

    /// What `reflect` makes, its time being noted.
    fn timed(&self, way: usize, reflect: impl FnOnce() -> Outgoing<Haar>) -> Outgoing<Haar> {
        let start = thread_seconds();
        let made = reflect();
        self.spent[way].fetch_add((1e9 * (thread_seconds() - start)) as u64, Ordering::Relaxed);
        made
    }
}

impl LightField for Both {
    type Incident = SampleSet;
    type Exitant = Sent;

    fn active(&self, material: u32) -> Option<Rgb> {
        self.samples.active(material)
    }

    fn clear(&self, incident: &mut SampleSet) {
        self.samples.clear(incident);
    }

    fn receive(&self, incident: &mut SampleSet, transfer: &Transfer) {
        self.samples.receive(incident, transfer);
    }

    fn reflect<H: Hierarchy>(&self, hierarchy: &H, leaf: NodeId, path: &[&SampleSet], arrived: Arrived) -> Sent {
        let light = self.timed(0, || self.samples.reflect(hierarchy, leaf, path, arrived));
        let clustered = self.timed(1, || self.clustering.reflect(hierarchy, leaf, path, arrived));
        Sent { light, clustered: clustered.basis_functions() }
    }

    fn radiance(&self, exitant: &Sent, away: Vec3) -> Rgb {
        self.samples.radiance(&exitant.light, away)
    }

    fn radiance_bounds(&self, exitant: &Sent, away: &Cone) -> (Rgb, Rgb) {
        self.samples.radiance_bounds(&exitant.light, away)
    }
}

fn solve(scene: &Arc<Scene>, refinement: Refinement, error: f32) -> Result<Solved, BenchError> {
    let start = cpu_seconds();
    let field = Both::new(&scene.reflectors(), refinement);
    let mut solver = Solver::new(&scene.input(), Settings::with_error(error), field)?;
    solver.solve(&mut |_| ControlFlow::Continue(()));
    solver.reflect_for_display(&mut |_| ControlFlow::Continue(()));
    let seconds = cpu_seconds() - start;
    let solution = solver.finish(&mut |_| ControlFlow::Break(()));
    let Both { samples, clustering, spent } = &solution.field;
    let [by_samples, by_clustering] = spent.each_ref().map(|spent| 1e-9 * spent.load(Ordering::Relaxed) as f64);
    Ok(Solved {
        links: solution.stats.links,
        samples: Way {
            functions: solution.reflected.iter().map(|sent| sent.light.basis_functions()).sum(),
            evaluations: samples.counters().brdf_evaluations(),
            seconds: seconds - by_clustering,
        },
        clustering: Way {
            functions: solution.reflected.iter().map(|sent| sent.clustered).sum(),
            evaluations: clustering.brdf_evaluations(),
            seconds: seconds - by_samples,
        },
    })
}

/// Adds both tables to a page, with scenes beside the paper's.
pub(super) fn report(scenes: &[String], error: f32, page: &mut Page<'_>) -> Result<(), BenchError> {
    page.text("## Tables 3 and 4: illumination samples against Radiance Clustering");
    page.text(&format!(
        "Whole solutions at an error of {error} asked for, by illumination samples (IS) and by Radiance Clustering (RC), \
         which reflects what each link brings on its own and adds it to a leaf's distribution, and keeps a second \
         distribution for what it is gathering meanwhile. Both reflect the same light: whenever a leaf is reflected in a solve, \
         it is both ways, one after the other, and seconds are those of the solve without the other way. RC is spared what is \
         not its idea: the traversals of the hierarchy, one for each link, and reflecting anew what has not changed. \
         `empty-room` stands for the paper's simple soda shop. In brackets: the paper's savings."
    ));
    let columns = [
        "scene",
        "ε",
        "m/M",
        "links",
        "functions: IS",
        "RC, sent",
        "RC, both",
        "saved",
        "s: IS",
        "RC",
        "saved",
        "BRDF evaluations: IS",
        "RC",
    ];
    page.head(3, &columns);
    for Case { scene, epsilon, levels, functions, seconds } in CASES {
        let solved = solve(&Arc::new(Scene::load(scene)?), relative(epsilon, levels), error)?;
        page.row(&row(scene, (epsilon, levels), &solved, Some([functions.map(f64::from), seconds])));
    }
    for name in scenes {
        let solved = solve(&Arc::new(Scene::load(name)?), relative(0.5, [1, 3]), error)?;
        let name = Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
        page.row(&row(&name, (0.5, [1, 3]), &solved, None));
    }
    Ok(())
}

fn row(
    name: &str,
    (epsilon, [min, max]): (f32, [u8; 2]),
    Solved { links, samples: is, clustering: rc }: &Solved,
    published: Option<[[f64; 2]; 2]>,
) -> Vec<String> {
    let rc_functions = RadianceClustering::DISTRIBUTIONS * rc.functions;
    let beside = |ours: [f64; 2], theirs: Option<[f64; 2]>| {
        let theirs = theirs.map_or(String::new(), |theirs| format!(" ({})", saved(theirs)));
        saved(ours) + &theirs
    };
    vec![
        name.to_owned(),
        epsilon.to_string(),
        format!("{min}/{max}"),
        links.to_string(),
        is.functions.to_string(),
        rc.functions.to_string(),
        rc_functions.to_string(),
        beside([is.functions as f64, rc_functions as f64], published.map(|p| p[0])),
        format!("{:.2}", is.seconds),
        format!("{:.2}", rc.seconds),
        beside([is.seconds, rc.seconds], published.map(|p| p[1])),
        is.evaluations.to_string(),
        rc.evaluations.to_string(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn illumination_samples_take_fewer_functions_and_evaluations() {
        let scene = Arc::new(Scene::load("empty-room").expect("built in"));
        let Solved { samples: is, clustering: rc, .. } = solve(&scene, relative(0.5, [1, 3]), 0.2).expect("sound");
        let (sent, kept) = (rc.functions, RadianceClustering::DISTRIBUTIONS * rc.functions);
        assert!(is.functions < sent && 10 * is.functions <= 6 * kept, "functions: {} and {kept}", is.functions);
        // Times would be spoilt by other tests beside this one.
        assert!(is.evaluations < rc.evaluations, "evaluations: {} and {}", is.evaluations, rc.evaluations);
    }
}

//! What could be proved of a solution's links at most, and what is: many segments per link tell which are wholly free and
//! which wholly blocked. Of all others nothing can be proved.

use crate::BenchError;
use crate::measure::{Extent, solve};
use crate::run::{Out, say};
use glam::Vec3;
use hr_diffuse::hierarchy::{Element, Kind};
use hr_diffuse::sampling::hash;
use hr_diffuse::visibility::NO_BLOCKER;
use hr_diffuse::{SceneInput, Solution};
use hr_view::path_tracer::Sampler;

/// Segments of a link whose ends face each other, and attempts at them.
const SEGMENTS: u32 = 200;
const ATTEMPTS: u32 = 1200;

/// Links of a kind.
#[derive(Clone, Copy, Default)]
struct Row {
    all: u64,
    proved_free: u64,
    free: u64,
    blocked: u64,
    averted: u64,
}

/// Prints how many links of a solution with the given error are proved free, and what segments find of them.
///
/// # Errors
/// Where the scene cannot be solved, or nothing can be printed.
pub(super) fn report(input: &SceneInput, error: f32, out: Out<'_>) -> Result<(), BenchError> {
    let (solution, _) = solve(input, error, 0, Extent { limit: None, vertices: false })?;
    let kinds = ["flat parts", "other parts", "clusters"];
    let mut rows = [Row::default(); 4];
    for link in solution.links.all() {
        let nodes: [&Element; 2] = [link.receiver, link.sender].map(|node| &solution.elements.nodes[node as usize]);
        if nodes[1].kind == Kind::Light {
            continue;
        }
        let kind = match nodes {
            _ if nodes.iter().any(|node| node.kind == Kind::Cluster) => 2,
            _ if nodes.iter().all(|node| node.is_flat()) => 0,
            _ => 1,
        };
        let [facing, blocked] = look(&solution, [link.receiver, link.sender]);
        for row in [kind, 3] {
            let row = &mut rows[row];
            row.all += 1;
            row.proved_free += u64::from(link.visibility < 0.0);
            row.averted += u64::from(facing == 0);
            row.free += u64::from(facing > 0 && blocked == 0);
            row.blocked += u64::from(facing > 0 && blocked == facing);
        }
    }
    say(out, &format!("\n| links at error {error} between | all | proved free | free | blocked | partly | averted |"))?;
    say(out, "| --- | ---: | ---: | ---: | ---: | ---: | ---: |")?;
    for (name, Row { all, proved_free, free, blocked, averted }) in kinds.into_iter().chain(["any"]).zip(rows) {
        let partly = all - free - blocked - averted;
        say(out, &format!("| {name} | {all} | {proved_free} | {free} | {blocked} | {partly} | {averted} |"))?;
    }
    let skipped = solution.stats.skipped;
    let (pairs, rays) = (skipped.facing + skipped.proved_blocked, solution.stats.rays);
    say(
        out,
        &format!(
            "Beside these, {pairs} pairs are proved to need no link ({} of them are hidden by one surface,",
            skipped.proved_blocked
        ),
    )?;
    say(out, &format!("the others face away). The solver shot {rays} rays."))
}

/// How many segments between two nodes have ends that face each other, and how many of these are blocked.
fn look(solution: &Solution, nodes: [u32; 2]) -> [u32; 2] {
    let visibility = &solution.scene.visibility;
    let (mut facing, mut blocked, mut cache) = (0, 0, NO_BLOCKER);
    for i in 0..ATTEMPTS {
        let sampler = Sampler::new(hash(nodes[0], nodes[1]), i);
        let [from, to] = [0, 1].map(|end: u32| point(solution, nodes[end as usize], &sampler, end));
        let (Some((from, n, first)), Some((to, m, second))) = (from, to) else { continue };
        if (to - from).dot(n) > 0.0 && (from - to).dot(m) > 0.0 {
            facing += 1;
            blocked += u32::from(visibility.occluded(from, to, [first, second], &mut cache));
        }
        if facing == SEGMENTS {
            break;
        }
    }
    [facing, blocked]
}

/// A point below a node, by area, with its normal and surface; `None` for lights without extent.
fn point(solution: &Solution, mut node: u32, sampler: &Sampler, end: u32) -> Option<(Vec3, Vec3, u32)> {
    let nodes = &solution.elements.nodes;
    let area = |node: u32| nodes[node as usize].area;
    let mut choice = sampler.pair(2 * end).x;
    while !nodes[node as usize].is_patch() {
        let Element { first_child, child_count, .. } = nodes[node as usize];
        let children = (first_child..first_child + child_count).filter(|&child| area(child) > 0.0);
        let mut rest = choice * children.clone().map(area).sum::<f32>();
        let mut found = None;
        for child in children {
            if let Some(before) = found {
                rest -= area(before);
            }
            found = Some(child);
            if rest < area(child) {
                break;
            }
        }
        node = found?;
        choice = (rest / area(node)).clamp(0.0, 1.0);
    }
    let element = &nodes[node as usize];
    let at = sampler.pair(2 * end + 1);
    let (point, normal) = solution.scene.surfaces()[element.source as usize].sample(element.domain, at.x, at.y);
    Some((point, if element.kind == Kind::Back { -normal } else { normal }, element.source))
}

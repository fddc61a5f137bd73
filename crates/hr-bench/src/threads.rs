//! What more threads bring, and whether they change anything.

use crate::BenchError;
use crate::measure::{Extent, solve};
use crate::run::{Out, say};
use hr_diffuse::{SceneInput, Solution};

/// Prints a Markdown table: a scene solved on 1, on 2 and on all threads.
///
/// # Errors
/// [`BenchError::Compare`] where solutions differ in any bit of their light or links; else where the scene cannot be
/// solved.
pub fn report(name: &str, input: &SceneInput, error: f32, out: Out<'_>) -> Result<(), BenchError> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let mut counts = vec![1, 2, all];
    counts.dedup();
    say(out, &format!("{name}, error {error}; {all} cores"))?;
    say(out, "| threads | solve CPU s | solve wall s | faster | vertices wall s | faster | same bits |")?;
    say(out, &format!("|{}", " ---: |".repeat(7)))?;
    let mut first: Option<(u64, f64, f64)> = None;
    let mut different = Vec::new();
    for threads in counts {
        let (solution, cost) = solve(input, error, threads, Extent::FULL)?;
        let bits = fingerprint(&solution);
        let (right, wall, vertices) = *first.get_or_insert((bits, cost.wall, cost.vertices_wall));
        if bits != right {
            different.push(threads.to_string());
        }
        let line = format!(
            "| {threads} | {:.3} | {:.3} | {:.2} x | {:.3} | {:.2} x | {} |",
            cost.cpu,
            cost.wall,
            wall / cost.wall.max(1e-9),
            cost.vertices_wall,
            vertices / cost.vertices_wall.max(1e-9),
            if bits == right { "yes" } else { "NO" }
        );
        say(out, &line)?;
    }
    if different.is_empty() {
        return Ok(());
    }
    Err(BenchError::Compare(format!("the solution on {} threads is not that on one", different.join(" and "))))
}

/// FNV-1a of all bits of the light and the links.
fn fingerprint(solution: &Solution) -> u64 {
    let light = solution.exitant.radiosity.iter().chain(&solution.exitant.irradiance);
    let light = light.chain(&solution.vertices.irradiance).flat_map(|rgb| rgb.to_array()).map(f32::to_bits);
    let links = solution.links.all().iter();
    let links = links.flat_map(|l| [l.receiver, l.sender, l.factor.to_bits(), l.visibility.to_bits()]);
    let step = |sum: u64, word: u32| (sum ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3);
    light.chain(links).fold(0xcbf2_9ce4_8422_2325, step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hr_scene::Scene;
    use std::sync::Arc;

    #[test]
    fn a_table_for_a_scene_that_is_the_same_on_all_threads() {
        let input = Arc::new(Scene::load("cornell").expect("built in")).input();
        let mut said = Vec::new();
        report("cornell", &input, 0.5, &mut said).expect("bit by bit the same");
        let said = String::from_utf8(said).expect("text");
        assert!(said.contains("| 2 |") && said.contains("| yes |") && !said.contains("NO"), "{said}");
    }

    #[test]
    fn a_single_bit_is_noticed() {
        let input = Arc::new(Scene::load("cornell").expect("built in")).input();
        let (mut solution, _) = solve(&input, 0.8, 1, Extent::FULL).expect("sound");
        let before = fingerprint(&solution);
        let last = solution.exitant.radiosity.last_mut().expect("nodes");
        last.z = f32::from_bits(last.z.to_bits() ^ 1);
        assert_ne!(fingerprint(&solution), before, "the lowest bit of one radiosity");
    }
}

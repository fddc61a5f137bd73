//! The answer does not depend on the number of threads, nor on when it is computed.

use crate::scenes::{Room, bits};
use glossy_ext::GlossyField;
use hr_diffuse::Solution;

/// Coarse: what matters is that every step of the pipeline has many tasks to distribute.
const ERROR: f32 = 0.2;

fn on_threads(count: usize) -> Solution<GlossyField> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads");
    pool.install(|| Room::new().solve(ERROR))
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let one = on_threads(1);
    assert!(one.links.all().len() > 1000, "enough work: {} links", one.links.all().len());
    assert!(one.reflected.iter().any(|haar| !haar.is_empty()), "the room is glossy");
    for threads in [2, 3] {
        let other = on_threads(threads);
        let radiosity = |s: &Solution<GlossyField>| bits(&s.exitant.radiosity);
        assert!(radiosity(&one) == radiosity(&other), "radiosities with 1 and {threads} threads");
        assert!(one.links.all() == other.links.all(), "links with 1 and {threads} threads");
        assert!(one.incident == other.incident, "illumination samples with 1 and {threads} threads");
        assert!(one.reflected == other.reflected, "distributions with 1 and {threads} threads");
        assert!(bits(&one.vertices.positions) == bits(&other.vertices.positions), "vertices, {threads} threads");
        assert!(bits(&one.vertices.irradiance) == bits(&other.vertices.irradiance), "their light, {threads} threads");
        assert_eq!(one.stats.residuals, other.stats.residuals, "residuals with 1 and {threads} threads");
        assert_eq!(one.stats.rays, other.stats.rays, "rays with 1 and {threads} threads");
    }
}

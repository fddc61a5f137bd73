//! Our engine is a host like any other: it keeps to what the hooks ask of hosts.

use crate::scenes::{Room, bits, solve};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::hooks::conformance::Watched;

/// As coarse as other tests of the whole room.
const ERROR: f32 = 0.2;

#[test]
fn our_engine_conforms() {
    let room = Room::new();
    let field = Watched::new(GlossyField::new(&room.reflectors, Refinement::default()));
    let solution = solve(&room.input, ERROR, field);
    let tally = solution.field.verdict().unwrap_or_else(|faults| panic!("{faults}"));
    assert!(tally.transfers > 1000 && tally.reflections > 50 && tally.questions > 1000, "much was seen: {tally:?}");
    let unwatched = room.solve(ERROR);
    let same = bits(&solution.exitant.radiosity) == bits(&unwatched.exitant.radiosity);
    assert!(same, "being watched changes nothing");
}

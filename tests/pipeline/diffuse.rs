//! What is diffuse costs nothing glossy.

use crate::scenes::{Room, bits, solve};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;

#[test]
fn lambert_reflectors_are_the_purely_diffuse_engine() {
    let room = Room::diffuse();
    let plain = solve(&room.input, 0.1, ());
    let field = solve(&room.input, 0.1, GlossyField::new(&room.reflectors, Refinement::default()));
    assert!(plain.links.all().len() > 1000, "enough work: {} links", plain.links.all().len());
    assert!(plain.links.all() == field.links.all(), "the same links");
    assert!(bits(&plain.exitant.radiosity) == bits(&field.exitant.radiosity), "the same radiosities");
    assert!(bits(&plain.vertices.irradiance) == bits(&field.vertices.irradiance), "the same light at vertices");
    assert_eq!(field.field.counters().brdf_evaluations(), 0, "no BRDF is evaluated");
    assert_eq!(field.field.counters().samples_reflected(), 0, "no sample is reflected");
    assert!(field.incident.iter().all(Vec::is_empty), "no sample is kept");
    assert!(field.reflected.iter().all(|haar| haar.is_empty()), "no distribution is made");
}

#[test]
fn only_what_is_glossy_keeps_glossy_light() {
    let room = Room::new();
    let solution = room.solve(0.2);
    let mut seen = 0;
    for (node, element) in solution.elements.nodes.iter().enumerate() {
        if element.is_patch() && room.reflectors[element.material as usize].is_diffuse() {
            assert!(solution.incident[node].is_empty(), "node {node} is diffuse and keeps samples");
            assert!(solution.reflected[node].is_empty(), "node {node} is diffuse and has a distribution");
        } else if element.is_patch() {
            seen += usize::from(!solution.reflected[node].is_empty());
        }
    }
    assert!(seen > 0, "the floor and the sphere have distributions");
    assert!(solution.field.counters().brdf_evaluations() > 0, "they are counted");
}

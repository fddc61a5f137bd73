//! Radiosity does not know how long a metre is, nor where the scene stands.

use crate::scenes::{Room, bits, mean_radiosity};
use glam::{DVec3, Vec3};

const ERROR: f32 = 0.1;
/// Rounding moves what lies on a border of the oracle to its other side: a link here is a refined one there. So the
/// answers differ by a part of what refinement leaves; a tenth of the error asked for is well below what would show.
const TOLERANCE: f32 = 0.1 * ERROR;

fn assert_alike(a: &[Vec3], b: &[Vec3], what: &str) {
    assert_eq!(a.len(), b.len(), "{what}: surfaces");
    for (surface, (a, b)) in a.iter().zip(b).enumerate() {
        let error = ((*a - *b).abs() / a.max(Vec3::splat(1e-3))).max_element();
        assert!(error < TOLERANCE, "{what}: surface {surface} has {a} here, {b} there, {:.2} %", 100.0 * error);
    }
}

#[test]
fn millionfold_and_millionth_are_the_same_room() {
    let here = mean_radiosity(&Room::new().solve(ERROR));
    for scale in [1e-6, 1e6] {
        let there = mean_radiosity(&Room::new().moved(scale, DVec3::ZERO).solve(ERROR));
        assert_alike(&here, &there, &format!("scale {scale:e}"));
    }
}

#[test]
fn a_million_sizes_away_is_the_same_room() {
    let here = mean_radiosity(&Room::new().solve(ERROR));
    let there = mean_radiosity(&Room::new().moved(1.0, DVec3::new(4e6, -4e6, 4e6)).solve(ERROR));
    assert_alike(&here, &there, "offset");
    let there = mean_radiosity(&Room::new().moved(1e-3, DVec3::new(-4e3, 4e3, 4e3)).solve(ERROR));
    assert_alike(&here, &there, "offset in another unit");
}

/// Powers of two round nothing: not one bit may differ.
#[test]
fn powers_of_two_change_no_bit() {
    let here = Room::new().solve(ERROR);
    let there = Room::new().moved(f64::from(1 << 20), DVec3::splat(f64::from(1 << 22))).solve(ERROR);
    assert!(here.links.all() == there.links.all(), "links");
    assert!(bits(&here.exitant.radiosity) == bits(&there.exitant.radiosity), "radiosities");
    assert!(bits(&here.vertices.irradiance) == bits(&there.vertices.irradiance), "light at vertices");
    assert!(here.reflected == there.reflected, "distributions");
}

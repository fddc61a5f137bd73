use super::*;
use crate::reflector::MetallicRoughness;
use glam::Vec2;

/// A floor, lit from points at a distance of 10.
struct Floor {
    points: Vec<Vec3>,
}

const FLOOR: NodeId = NodeId(0);

impl Hierarchy for Floor {
    fn parent(&self, _: NodeId) -> Option<NodeId> {
        None
    }
    fn center(&self, node: NodeId) -> Vec3 {
        if node == FLOOR { Vec3::ZERO } else { self.points[node.index() - 1] * 10.0 }
    }
    fn radius(&self, node: NodeId) -> f32 {
        if node == FLOOR { 0.1 } else { 0.0 }
    }
    fn normals(&self, _: NodeId) -> Cone {
        Cone::single(Vec3::Z)
    }
    fn material(&self, node: NodeId) -> Option<u32> {
        (node == FLOOR).then_some(0)
    }
}

/// A metal floor, what arrives there from points of many strengths, and all of it together.
fn lit_floor() -> (GlossyField, Floor, SampleSet, Rgb) {
    let metal: Arc<dyn Reflector> = Arc::new(MetallicRoughness::new(Rgb::ONE, 1.0, 0.35).expect("a metal"));
    let field = GlossyField::new(&[metal], Refinement::default());
    let turn = |k: f32| Vec3::new((2.4 * k).cos(), (2.4 * k).sin(), 0.4 + 0.1 * k).normalize();
    let floor = Floor { points: (0..12_u8).map(|k| turn(k.into())).collect() };
    let mut incident = SampleSet::new();
    let mut total = Rgb::ZERO;
    for (k, &direction) in floor.points.iter().enumerate() {
        let irradiance = Rgb::splat(0.6_f32.powi(k as i32));
        field.receive(&mut incident, &Transfer { sender: NodeId(k as u32 + 1), direction, irradiance, oriented: true });
        total += irradiance;
    }
    (field, floor, incident, total)
}

/// Detail is left out where it is negligible, and nowhere else.
#[test]
fn negligible_detail_is_left_out() {
    let (field, floor, incident, irradiance) = lit_floor();
    let reflect = |negligible| {
        let before = field.counters().brdf_evaluations();
        let arrived = Arrived { irradiance, diffuse: Rgb::ZERO, spread: 0.0, negligible };
        let exitant = field.reflect(&floor, FLOOR, &[&incident], arrived);
        (exitant, field.counters().brdf_evaluations() - before)
    };
    let directions: Vec<Vec3> = (0..4000_u16)
        .map(|k| {
            let z = 0.05 + 0.95 * (f32::from(k) + 0.5) / 4000.0;
            Vec2::from_angle(2.399_963_2 * f32::from(k)).extend(0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
        })
        .collect();
    let (fine, all) = reflect(0.0);
    let peak = directions.iter().map(|&d| fine.eval(d).x).fold(0.0, f32::max);
    assert_eq!(field.counters().negligible_detail(), 0, "everything counts");
    let mut before = all;
    for share in [0.02, 0.1, 0.5] {
        let (coarse, evaluations) = reflect(share * peak);
        assert!(evaluations < before, "{evaluations} of {before} evaluations where {share} of the peak is negligible");
        before = evaluations;
        let worst = directions.iter().map(|&d| (coarse.eval(d) - fine.eval(d)).abs().x / peak).fold(0.0, f32::max);
        assert!(worst < 2.0 * share, "off by {worst} of the peak where {share} is negligible");
    }
    assert!(field.counters().negligible_detail() > 0 && 4 * before < all, "{before} of {all} evaluations");
    // Light as a whole stays: what cannot be told apart is still there.
    let (nothing, _) = reflect(2.0 * peak);
    let [some, right] = [&nothing, &fine].map(|exitant| exitant.cosine_integral(Vec3::Z).x);
    assert!((some / right - 1.0).abs() < 0.25, "{some} W/m² of {right}");
}

use super::*;
use crate::reflector::{Lambert, MetallicRoughness, Ward};
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
    let arrived =
        |negligible| Arrived { irradiance, diffuse: Rgb::ZERO, spread: 0.0, negligible, error: 0.1, shown: false };
    let project = |negligible| {
        let before = field.counters().brdf_evaluations();
        let reflection = field.reflection(&floor, FLOOR, &[&incident], arrived(negligible)).expect("it is lit");
        (field.project(&reflection), field.counters().brdf_evaluations() - before)
    };
    let directions: Vec<Vec3> = (0..4000_u16)
        .map(|k| {
            let z = 0.05 + 0.95 * (f32::from(k) + 0.5) / 4000.0;
            Vec2::from_angle(2.399_963_2 * f32::from(k)).extend(0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
        })
        .collect();
    let (fine, all) = project(0.0);
    let peak = directions.iter().map(|&d| fine.eval(d).x).fold(0.0, f32::max);
    assert_eq!(field.counters().negligible_detail(), 0, "everything counts");
    let mut before = all;
    for share in [0.02, 0.1, 0.5] {
        let (coarse, evaluations) = project(share * peak);
        assert!(evaluations < before, "{evaluations} of {before} evaluations where {share} of the peak is negligible");
        before = evaluations;
        let worst = directions.iter().map(|&d| (coarse.eval(d) - fine.eval(d)).abs().x / peak).fold(0.0, f32::max);
        assert!(worst < 2.0 * share, "off by {worst} of the peak where {share} is negligible");
    }
    assert!(field.counters().negligible_detail() > 0 && 4 * before < all, "{before} of {all} evaluations");
    // Light as a whole stays: what cannot be told apart is still there.
    let nothing = field.reflect(&floor, FLOOR, &[&incident], arrived(2.0 * peak)).distribution;
    let [some, right] = [&nothing, &fine].map(|distribution| distribution.cosine_integral(Vec3::Z).x);
    assert!((some / right - 1.0).abs() < 0.02, "{some} W/m² of {right}");
}

/// What is looked at is as exact as asked for; what goes on to others need not be.
#[test]
fn what_is_shown_is_as_exact_as_asked() {
    let (field, floor, incident, irradiance) = lit_floor();
    // The sum over directions of how far the projection is off, in the light's own.
    let off = |error, shown| {
        let arrived = Arrived { irradiance, diffuse: Rgb::ZERO, spread: 0.0, negligible: 0.0, error, shown };
        let reflection = field.reflection(&floor, FLOOR, &[&incident], arrived).expect("it is lit");
        let made = field.project(&reflection);
        let (mut difference, mut all) = (0.0, 0.0);
        for k in 0..4000_u16 {
            let z = (f32::from(k) + 0.5) / 4000.0;
            let toward = (Vec2::from_angle(2.399_963_2 * f32::from(k)) * (1.0 - z * z).sqrt()).extend(z);
            let right = reflection.toward(toward).x;
            difference += (made.eval(toward).x - right).abs();
            all += right;
        }
        difference / all
    };
    assert_eq!(off(0.01, false), off(0.1, false), "what goes on to others");
    assert!(off(0.1, true) < 0.05, "off by {}", off(0.1, true));
    assert!(off(0.02, true) < 0.01, "off by {}, where 0.02 is asked for", off(0.02, true));
}

/// However coarse a distribution is, it has the power that its samples make: here a smooth dielectric, which reflects what
/// grazes it up to twenty times as strongly as what comes from above.
#[test]
fn coarse_distributions_keep_their_power() {
    let plastic: Arc<dyn Reflector> =
        Arc::new(MetallicRoughness::new(Rgb::splat(0.5), 0.0, 0.18).expect("a dielectric").compensated());
    let field = GlossyField::new(&[plastic], Refinement::default());
    let turn = |k: f32| Vec3::new((2.4 * k).cos(), (2.4 * k).sin(), 0.04 * k + 0.02).normalize();
    let floor = Floor { points: (0..40_u8).map(|k| turn(k.into())).collect() };
    let (mut incident, mut irradiance) = (SampleSet::new(), Rgb::ZERO);
    for (k, &direction) in floor.points.iter().enumerate() {
        let sample = Rgb::splat(direction.z);
        let sender = NodeId(k as u32 + 1);
        field.receive(&mut incident, &Transfer { sender, direction, irradiance: sample, oriented: true });
        irradiance += sample;
    }
    let diffuse = irradiance * (0.4 * FRAC_1_PI);
    let arrived = Arrived { irradiance, diffuse, spread: 0.0, negligible: 0.1, error: 0.1, shown: false };
    let reflection = field.reflection(&floor, FLOOR, &[&incident], arrived).expect("it is lit");
    let mut exact = Rgb::ZERO;
    const STEPS: u16 = 400;
    for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
        let [u, v] = [i, j].map(|i| (f32::from(i) + 0.5) / f32::from(STEPS));
        let across = Vec2::from_angle(std::f32::consts::TAU * v) * u.sqrt();
        exact += reflection.toward(across.extend((1.0 - u).sqrt()));
    }
    exact *= PI / f32::from(STEPS).powi(2);
    let off = |distribution: &Haar| (distribution.cosine_integral(Vec3::Z) / exact - 1.0).x;
    let mut distribution = field.project(&reflection);
    let before = off(&distribution);
    reflection.conserve(&mut distribution, irradiance);
    let after = off(&distribution);
    assert!(before.abs() > 0.1, "it is coarse: off by {before}");
    assert!(after.abs() < 0.03, "off by {after}, {before} before");
}

/// What is smooth and dark reflects most of what grazes it, as above a cove; what lies under it takes part of that, if it is white.
#[test]
fn what_grazes_a_leaf_is_reflected() {
    let reflected = |base: f32, z: f32| {
        let reflector = MetallicRoughness::new(Rgb::splat(base), 0.0, 0.35).expect("a dielectric");
        let reflector: Arc<dyn Reflector> = Arc::new(reflector);
        let field = GlossyField::new(&[Arc::clone(&reflector)], Refinement::default());
        let direction = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
        let floor = Floor { points: vec![direction] };
        let irradiance = Rgb::ONE;
        let mut incident = SampleSet::new();
        field.receive(&mut incident, &Transfer { sender: NodeId(1), direction, irradiance, oriented: true });
        let diffuse = reflector.diffuse() * FRAC_1_PI;
        let arrived = Arrived { irradiance, diffuse, spread: 0.0, negligible: 0.0, error: 0.1, shown: false };
        let reflection = field.reflection(&floor, FLOOR, &[&incident], arrived).expect("it is lit");
        let mut distribution = field.project(&reflection);
        reflection.conserve(&mut distribution, irradiance);
        let [mean, albedo] = [reflector.glossy_albedo(), reflector.directional_albedo(direction)].map(|a| a.x);
        (distribution.cosine_integral(Vec3::Z).x, albedo, mean, 1.0 - reflector.diffuse().x)
    };
    for z in [0.1, 0.2, 0.4] {
        let (found, albedo, mean, _) = reflected(0.0, z);
        assert!((found / albedo - 1.0).abs() < 0.05, "{found} of {albedo} at {z}");
        assert!(z > 0.3 || albedo > 2.0 * mean, "much more than the mean: {albedo} and {mean} at {z}");
    }
    let (found, albedo, mean, left) = reflected(0.9, 0.1);
    let most = left.max(MOST_GAIN * mean);
    assert!(albedo > 1.2 * most && found < 1.01 * most, "{found}, as no more than {most} is left of {albedo}");
}

/// What a host is told of how much is reflected from each direction has the mean that it is told; of a dielectric it is far from even.
#[test]
fn albedos_by_direction_have_their_mean() {
    let dielectric = |base: f32| -> Arc<dyn Reflector> {
        Arc::new(MetallicRoughness::new(Rgb::splat(base), 0.0, 0.2).expect("a dielectric"))
    };
    let field = GlossyField::new(&[dielectric(0.3)], Refinement::default());
    let toward = |cosine: f32| field.directional_albedo(0, cosine).expect("it is glossy").x;
    // ∫ a(μ) 2μ dμ by midpoints of μ².
    let mean = (0..1000).map(|i| toward(((i as f32 + 0.5) / 1000.0).sqrt())).sum::<f32>() / 1000.0;
    let active = field.active(0).expect("it is glossy").x;
    assert!((mean / active - 1.0).abs() < 0.06, "{mean}, not {active}");
    assert!(toward(1.0) < 0.6 * active && toward(0.1) > 3.0 * active, "{} and {}", toward(1.0), toward(0.1));
    let diffuse: Arc<dyn Reflector> = Arc::new(Lambert::new(Rgb::splat(0.5)).expect("paint"));
    assert_eq!(GlossyField::new(&[diffuse], Refinement::default()).directional_albedo(0, 0.5), None);
}

/// What is negligible by itself adds up where a distribution is coarse: its tails pay for that, not its highlight.
#[test]
fn highlights_do_not_pay_for_coarse_tails() {
    let metal: Arc<dyn Reflector> = Arc::new(MetallicRoughness::new(Rgb::splat(0.5), 1.0, 0.35).expect("a metal"));
    let field = GlossyField::new(&[metal], Refinement::default());
    let direction = Vec3::new(0.5, 0.2, 1.0).normalize();
    let floor = Floor { points: vec![direction] };
    let irradiance = Rgb::ONE;
    let mut incident = SampleSet::new();
    field.receive(&mut incident, &Transfer { sender: NodeId(1), direction, irradiance, oriented: true });
    let toward = Vec3::new(-direction.x, -direction.y, direction.z);
    let arrived =
        |negligible: f32| Arrived { irradiance, diffuse: Rgb::ZERO, spread: 0.0, negligible, error: 0.4, shown: true };
    let reflection =
        |negligible| field.reflection(&floor, FLOOR, &[&incident], arrived(negligible)).expect("it is lit");
    let coarse = reflection(0.1 * reflection(0.0).toward(toward).x);
    let mut distribution = field.project(&coarse);
    let measured = |distribution: &Haar| (distribution.cosine_integral(Vec3::Z).x, distribution.eval(toward).x);
    let before = measured(&distribution);
    coarse.conserve(&mut distribution, irradiance);
    let after = measured(&distribution);
    assert!(before.0 > 1.05 * after.0, "coarse tails make more power: {}, {} after", before.0, after.0);
    assert!(after.1 > 0.97 * before.1, "the highlight stays: {}, {} after", before.1, after.1);
}

/// A white metal that loses nothing between its facets reflects all, from wherever it comes; narrow lobes, too.
#[test]
fn albedos_of_white_metals_are_one() {
    for roughness in [0.1, 0.3, 0.8] {
        let metal = MetallicRoughness::new(Rgb::ONE, 1.0, roughness).expect("a metal").compensated();
        let albedos = Albedos::new(&metal);
        for k in 1..50_u8 {
            let cos = 0.02 * f32::from(k);
            let direction = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let sample = Incident { direction, irradiance: Rgb::ONE, ..Incident::default() };
            let albedo = albedos.reflected(&[sample]).x;
            let allowed = if cos < 0.1 { 0.05 } else { 0.02 };
            assert!((albedo - 1.0).abs() < allowed, "roughness {roughness}, cosine {cos}: {albedo}");
        }
    }
}

/// One leaf under one lamp: where the highlight is seen is where a mirror would show the lamp.
#[test]
fn highlights_move_over_a_leaf_with_the_eye() {
    let plastic: Arc<dyn Reflector> = Arc::new(Ward::new(Rgb::ZERO, Rgb::ONE, 0.06).expect("a Ward reflector"));
    let field = GlossyField::new(&[plastic], Refinement::default());
    let lamp = Vec3::new(0.2, -0.1, 1.0);
    let floor = Floor { points: vec![lamp / 10.0] };
    let (direction, irradiance) = (lamp.normalize(), Rgb::ONE);
    let mut incident = SampleSet::new();
    field.receive(&mut incident, &Transfer { sender: NodeId(1), direction, irradiance, oriented: true });
    let arrived = Arrived { irradiance, diffuse: Rgb::ZERO, spread: 0.0, negligible: 0.0, error: 0.1, shown: false };
    let exitant = field.reflect(&floor, FLOOR, &[&incident], arrived);
    let far = Focus::default();
    // Where in a square of 1 the leaf shines most toward an eye.
    let brightest = |focus: Focus, eye: Vec3| {
        let places = (0..101_u8).flat_map(|i| (0..101_u8).map(move |k| [i, k].map(|k| 0.01 * f32::from(k) - 0.5)));
        let light = |[x, y]: [f32; 2]| {
            let at = Vec3::new(x, y, 0.0);
            let seen = -(eye - at).normalize().reflect(Vec3::Z);
            (exitant.eval((-focus.from_middle(at, seen)).reflect(Vec3::Z)).x, at)
        };
        places.map(light).fold((0.0, Vec3::ZERO), |best, next| if next.0 > best.0 { next } else { best }).1
    };
    let (mut worst, mut least) = (0.0_f32, f32::INFINITY);
    for eye in [[0.6, 0.3, 1.2], [-0.7, 0.2, 0.8], [0.4, -0.8, 1.6], [-0.9, -0.6, 1.0], [0.9, 0.9, 2.0]].map(Vec3::from)
    {
        let mirrored = (lamp * eye.z + eye * lamp.z).with_z(0.0) / (eye.z + lamp.z);
        worst = worst.max(brightest(exitant.focus, eye).distance(mirrored));
        least = least.min(brightest(far, eye).distance(mirrored));
    }
    // The finest triangles are 1.5° wide, which is 0.015 on the leaf; 0.01 is the step between places.
    assert!(worst < 0.03, "the highlight is off by {worst} of the leaf's width");
    assert!(least > 0.1, "without its focus the leaf would show it off by {least} at least");
}

/// A large lamp in parts, each a peak of its own, and a small one beside it, which is seen as brightly.
#[test]
fn parts_of_one_lamp_hide_no_other() {
    let metal: Arc<dyn Reflector> = Arc::new(MetallicRoughness::new(Rgb::ONE, 1.0, 0.2).expect("a metal"));
    let width = metal.lobe(Vec3::Z).width;
    let field = GlossyField::new(&[metal], Refinement::default());
    let part =
        |k: u16| Vec3::new(0.6 + 0.4 * width * f32::from(k % 5), 0.4 * width * f32::from(k / 5), 0.9).normalize();
    let small = Vec3::new(-0.5, -0.3, 0.8).normalize();
    let floor = Floor { points: (0..25).map(part).chain([small]).collect() };
    let (mut incident, mut irradiance) = (SampleSet::new(), Rgb::ZERO);
    for (k, &direction) in floor.points.iter().enumerate() {
        let sample = Rgb::splat(if direction == small { 0.5 } else { 1.0 });
        let sender = NodeId(k as u32 + 1);
        field.receive(&mut incident, &Transfer { sender, direction, irradiance: sample, oriented: true });
        irradiance += sample;
    }
    let arrived = Arrived { irradiance, diffuse: Rgb::ZERO, spread: 0.0, negligible: 0.0, error: 0.5, shown: true };
    let reflection = field.reflection(&floor, FLOOR, &[&incident], arrived).expect("it is lit");
    let toward = Vec3::new(-small.x, -small.y, small.z);
    let (shown, right) = (field.project(&reflection).eval(toward).x, reflection.toward(toward).x);
    assert!((shown / right - 1.0).abs() < 0.1, "the small one is {shown}, not {right}");
}

/// A lobe that transport resolves as it is stays so sharp, whatever lights it; a narrower one becomes no wider than what is resolved.
#[test]
fn lobes_are_widened_to_what_transport_resolves() {
    // Second moment about the mirrored direction across the plane of reflection, radians².
    let spread = |slope: f32| {
        let polished: Arc<dyn Reflector> = Arc::new(Ward::new(Rgb::ZERO, Rgb::ONE, slope).expect("polished"));
        let field = GlossyField::new(&[polished], Refinement::default());
        let floor = Floor { points: vec![TYPICAL] };
        let mut incident = SampleSet::new();
        let irradiance = Rgb::ONE;
        field.receive(&mut incident, &Transfer { sender: NodeId(1), direction: TYPICAL, irradiance, oriented: true });
        let arrived =
            Arrived { irradiance, diffuse: Rgb::ZERO, spread: 0.0, negligible: 0.0, error: 0.1, shown: false };
        let reflection = field.reflection(&floor, FLOOR, &[&incident], arrived).expect("it is lit");
        let mirrored = Vec3::new(-TYPICAL.x, 0.0, TYPICAL.z);
        let along = Vec3::new(TYPICAL.z, 0.0, TYPICAL.x);
        let (mut moment, mut all) = (0.0, 0.0);
        for (i, k) in (-80..=80_i16).flat_map(|i| (-80..=80_i16).map(move |k| (i, k))) {
            let [across, up] = [i, k].map(|at| f32::from(at) * 0.2 / 80.0);
            let light = reflection.toward((mirrored + Vec3::Y * across + along * up).normalize()).x;
            moment += light * across * across;
            all += light;
        }
        (moment / all).sqrt()
    };
    // Twice the slope's own, narrower by the cosine (0.8) across.
    let own = |slope: f32| 2.0 * slope * 0.5_f32.sqrt() * TYPICAL.z;
    let (sharp, sharper) = (spread(0.03), spread(0.003));
    assert!((sharp / own(0.03) - 1.0).abs() < 0.03, "{sharp} rad, not {}", own(0.03));
    let resolved = 0.5 * NARROWEST;
    assert!((sharper / resolved - 1.0).abs() < 0.15, "{sharper} rad, not {resolved}");
}

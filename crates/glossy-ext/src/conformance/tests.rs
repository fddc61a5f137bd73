//! Built-in reflectors pass; broken ones are caught, with the right words.

use super::*;
use crate::reflector::Sample;
use crate::{Lambert, MetallicRoughness, Phong, Sum, Ward};
use std::sync::Arc;

const ALPHAS: [f32; 7] = [1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0];

fn grey(value: f32) -> Rgb {
    Rgb::splat(value)
}

fn ward(alpha: f32) -> Ward {
    Ward::new(grey(0.1), Rgb::new(0.9, 0.5, 0.2), alpha).expect("valid parameters")
}

fn passes(name: &str, reflector: &dyn Reflector) {
    match check(reflector) {
        Ok(measured) => assert!(measured.largest_albedo > 0.01, "{name} reflects: {measured:?}"),
        Err(faults) => panic!("{name}: {faults}"),
    }
}

#[test]
fn lambert_ward_phong_and_metal_pass_for_all_roughnesses() {
    passes("Lambert", &Lambert::new(Rgb::new(0.9, 0.3, 0.1)).expect("valid parameters"));
    for alpha in ALPHAS {
        passes(&format!("Ward, α {alpha}"), &ward(alpha));
        for across in [0.01, 0.3] {
            let brushed = Ward::anisotropic(grey(0.1), grey(0.9), Vec2::new(alpha, across), Vec3::Y);
            passes(&format!("Ward, α {alpha} and {across}"), &brushed.expect("valid parameters"));
        }
        let phong = Phong::new(grey(0.1), grey(0.9), 2.0 / (alpha * alpha)).expect("valid parameters");
        passes(&format!("Phong, α {alpha}"), &phong);
        for (base, metallic) in [(1.0, 1.0), (0.0, 0.0)] {
            let gltf = MetallicRoughness::new(grey(base), metallic, alpha.sqrt()).expect("valid parameters");
            passes(&format!("glTF, base {base}, α {alpha}"), &gltf);
        }
    }
    passes("a mirror", &Ward::new(grey(0.1), grey(0.9), 0.0).expect("valid parameters"));
}

#[test]
fn sums_pass() {
    let lacquer = Sum::new(vec![
        Arc::new(Lambert::new(grey(0.3)).expect("valid parameters")),
        Arc::new(Ward::new(Rgb::ZERO, grey(0.2), 0.02).expect("valid parameters")),
        Arc::new(Phong::new(Rgb::ZERO, grey(0.3), 8.0).expect("valid parameters")),
        Arc::new(Ward::anisotropic(Rgb::ZERO, grey(0.1), Vec2::new(0.05, 0.2), Vec3::X).expect("valid parameters")),
    ]);
    passes("four parts", &lacquer);
}

#[test]
fn compensation_makes_white_white_and_nothing_brighter() {
    for alpha in ALPHAS {
        for (base, metallic) in [(1.0, 0.0), (1.0, 1.0), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0)] {
            let single = MetallicRoughness::new(grey(base), metallic, alpha.sqrt()).expect("valid parameters");
            let name = format!("base {base}, metallic {metallic}, α {alpha}");
            let measured = check(&single.compensated()).unwrap_or_else(|faults| panic!("{name}: {faults}"));
            assert!(base < 1.0 || measured.largest_albedo > 0.997, "{name} is white: {measured:?}");
        }
    }
}

/// The specification's diffuse term does not make room for what the dielectric's lobe reflects at grazing directions.
#[test]
fn bright_dielectrics_of_gltf_exceed_one_and_nothing_else() {
    for alpha in ALPHAS {
        let white = MetallicRoughness::new(grey(1.0), 0.0, alpha.sqrt()).expect("valid parameters");
        let faults = check(&white).expect_err("more than arrives");
        let [Finding { fault: Fault::Energy { albedo, outgoing }, .. }] = faults.findings() else {
            panic!("α {alpha}: {faults}");
        };
        assert!(albedo.x < 1.9 && outgoing.z < 0.1, "α {alpha}: {faults}");
    }
}

/// Something wrong, in one of its methods.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wrong {
    NotANumberAtGrazing,
    InfiniteAtTheNormal,
    Negative,
    Horizon,
    Reciprocity,
    Grain,
    Energy,
    Albedo,
    AlbedoRange,
    Diffuse,
    Split,
    Extent,
    ExtentMean,
    Sum,
    Each,
    Bound,
    NoLobe,
    LobeDirection,
    LobeNarrow,
    LobeWide,
    Sample,
    SampleMean,
    BaseColor,
}

/// A Ward lobe with something wrong.
#[derive(Debug)]
struct Broken(Ward, Wrong);

impl Reflector for Broken {
    fn eval(&self, i: Vec3, o: Vec3) -> Rgb {
        let value = self.0.eval(i, o);
        match self.1 {
            Wrong::NotANumberAtGrazing if i.z < 0.03 && i.z > 0.0 && o.z > 0.0 => value * (i.z - 0.03).sqrt(),
            Wrong::InfiniteAtTheNormal if i.z > 0.0 && o.z > 0.0 => value * (1.0 / i.truncate().length()).max(1.0),
            Wrong::Negative if value != Rgb::ZERO => value - 0.1,
            Wrong::Horizon if i.z <= 0.0 || o.z <= 0.0 => grey(0.1),
            Wrong::Reciprocity => value * i.z.max(0.0),
            Wrong::Grain => value * (0.5 + 0.5 * i.x * i.x),
            Wrong::Energy => value * 1.2,
            _ => value,
        }
    }

    fn diffuse(&self) -> Rgb {
        self.0.diffuse() * if self.1 == Wrong::Energy { 1.2 } else { 1.0 }
    }

    fn is_diffuse(&self) -> bool {
        self.1 == Wrong::Diffuse
    }

    fn glossy(&self, i: Vec3, o: Vec3) -> Rgb {
        match self.1 {
            Wrong::Split => self.eval(i, o),
            _ if i.z > HORIZON && o.z > HORIZON => self.eval(i, o) - self.diffuse() * FRAC_1_PI,
            _ => Rgb::ZERO,
        }
    }

    fn glossy_toward_extent(&self, i: Vec3, o: Vec3, extent: f32) -> Rgb {
        match self.1 {
            Wrong::Extent => 0.9 * self.glossy(i, o),
            Wrong::ExtentMean if extent > 0.0 => 2.0 * self.0.glossy_toward_extent(i, o, extent),
            _ if extent > 0.0 => self.0.glossy_toward_extent(i, o, extent),
            _ => self.glossy(i, o),
        }
    }

    fn reflect_sum(&self, incident: &[Incident], o: Vec3) -> Rgb {
        let incident = if self.1 == Wrong::Sum { &incident[1..] } else { incident };
        incident.iter().map(|s| self.glossy_toward_extent(s.direction, o, s.extent) * s.irradiance).sum()
    }

    fn reflect_each(&self, incident: &[Incident], o: Vec3, reflected: &mut [Rgb]) {
        let factor = if self.1 == Wrong::Each { 0.9 } else { 1.0 };
        for (sender, reflected) in std::iter::zip(incident, reflected) {
            *reflected = factor * self.reflect_sum(std::slice::from_ref(sender), o);
        }
    }

    fn glossy_bound(&self, cone: &Cone, o: Vec3) -> f32 {
        match self.1 {
            // The middle is not the largest.
            Wrong::Bound => self.0.glossy(cone.axis, o).max_element(),
            Wrong::Energy => 1.2 * self.0.glossy_bound(cone, o),
            _ => self.0.glossy_bound(cone, o),
        }
    }

    fn glossy_albedo(&self) -> Rgb {
        match self.1 {
            Wrong::Albedo => 0.9 * self.0.glossy_albedo(),
            Wrong::AlbedoRange => Rgb::splat(f32::NAN),
            Wrong::Energy => 1.2 * self.0.glossy_albedo(),
            _ => self.0.glossy_albedo(),
        }
    }

    fn lobe(&self, o: Vec3) -> Lobe {
        let lobe = self.0.lobe(o);
        match self.1 {
            Wrong::NoLobe => Lobe { direction: -lobe.direction, width: f32::NAN },
            Wrong::LobeDirection => Lobe { direction: o, ..lobe },
            Wrong::LobeNarrow => Lobe { width: 0.1 * lobe.width, ..lobe },
            Wrong::LobeWide => Lobe { width: 4.0 * lobe.width, ..lobe },
            _ => lobe,
        }
    }

    fn sample(&self, o: Vec3, u: Vec2) -> Option<Sample> {
        let sample = self.0.sample(o, u)?;
        Some(match self.1 {
            Wrong::Sample => Sample { incident: 2.0 * sample.incident, ..sample },
            Wrong::SampleMean => Sample { weight: 0.9 * sample.weight, ..sample },
            Wrong::Energy => Sample { weight: 1.2 * sample.weight, ..sample },
            _ => sample,
        })
    }

    fn with_base_color(&self, color: Rgb) -> Option<Arc<dyn Reflector>> {
        (self.1 == Wrong::BaseColor).then(|| Arc::new(Ward::new(color, Rgb::ONE, 0.0).expect("a mirror")) as _)
    }
}

#[test]
fn broken_reflectors_are_caught_with_the_right_words() {
    let cases = [
        (Wrong::NotANumberAtGrazing, "`eval` is not finite"),
        (Wrong::InfiniteAtTheNormal, "`eval` is not finite"),
        (Wrong::Negative, "`eval` is negative"),
        (Wrong::Horizon, "below the horizon"),
        (Wrong::Reciprocity, "`eval` is not reciprocal"),
        (Wrong::Grain, "there is no `grain`"),
        (Wrong::Energy, "`eval` reflects more than arrives: the albedo is [1.0"),
        (Wrong::Albedo, "but the glossy part integrates to"),
        (Wrong::AlbedoRange, "`glossy_albedo` is [NaN, NaN, NaN], but a reflectance is from 0 to 1"),
        (Wrong::Diffuse, "`is_diffuse` is true"),
        (Wrong::Split, "but `eval` − `diffuse`/π is"),
        (Wrong::Extent, "for a sender of 0 rad"),
        (Wrong::ExtentMean, "but the mean of `glossy` over it is"),
        (Wrong::Sum, "`reflect_sum` is"),
        (Wrong::Each, "`reflect_each` gives"),
        (Wrong::Bound, "samples that matter would be skipped"),
        (Wrong::NoLobe, "the width NaN; a unit vector with z ≥ 0"),
        (Wrong::LobeDirection, "`lobe` is off"),
        (Wrong::LobeNarrow, "`lobe` is too narrow"),
        (Wrong::LobeWide, "`lobe` is too wide"),
        (Wrong::Sample, "a unit vector above the horizon and a finite weight are due"),
        (Wrong::SampleMean, "`sample` is biased"),
        (Wrong::BaseColor, "with another `grain` or mirror"),
    ];
    for alpha in [0.02, 0.2] {
        let sound = Ward::new(grey(0.2), grey(0.7), alpha).expect("valid parameters");
        for (wrong, words) in cases {
            let faults = check(&Broken(sound, wrong)).map(|_| ()).expect_err(&format!("{wrong:?}, α {alpha}"));
            assert!(faults.to_string().contains(words), "{wrong:?}, α {alpha}: {faults}");
            // What is wrong with the values shows in all that is made of them; the rest stands alone.
            let values = [
                Wrong::NotANumberAtGrazing,
                Wrong::InfiniteAtTheNormal,
                Wrong::Negative,
                Wrong::Reciprocity,
                Wrong::Grain,
                Wrong::Split,
            ];
            assert!(
                values.contains(&wrong) || faults.findings().len() <= 3,
                "{wrong:?}, α {alpha}: much else is blamed: {faults}"
            );
        }
    }
}

#[test]
fn values_alone_are_enough() {
    #[derive(Debug)]
    struct ValuesOf(Ward);
    impl Reflector for ValuesOf {
        fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
            self.0.eval(incident, outgoing)
        }
    }
    for alpha in [0.05, 0.3] {
        passes(&format!("values of Ward, α {alpha}"), &ValuesOf(ward(alpha)));
    }
}

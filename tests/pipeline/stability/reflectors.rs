//! Reflectors that do what no surface can: the solution stays finite and bounded, and tells.

use crate::scenes::{solve, walls};
use crate::stability::answers::assert_sane;
use crate::stability::cases::glowing;
use glam::{DVec3, Vec3};
use glossy_ext::haar::Refinement;
use glossy_ext::{GlossyField, Lambert, Lobe, MetallicRoughness, Phong, Reflector};
use hr_diffuse::{DiffuseMaterial, LightField, Rgb, SceneInput, Solution};
use std::sync::Arc;

/// What one method returns in place of what it should.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wrong {
    NotANumber,
    Infinite,
    Negative,
    FarTooBright,
    AlbedoNotANumber,
    AlbedoAboveOne,
    AlbedoNegative,
    LobeNotANumber,
}

/// A Phong lobe that misbehaves.
#[derive(Debug)]
struct Misbehaving(Phong, Wrong);

impl Reflector for Misbehaving {
    fn eval(&self, incident: Vec3, outgoing: Vec3) -> Rgb {
        let value = self.0.eval(incident, outgoing);
        match self.1 {
            // Here and there.
            Wrong::NotANumber if outgoing.x > 0.3 => Rgb::new(f32::NAN, 1.0, 1.0),
            Wrong::Infinite if outgoing.x > 0.3 => Rgb::splat(f32::INFINITY),
            Wrong::Negative => value - 5.0,
            Wrong::FarTooBright => 50.0 * value,
            _ => value,
        }
    }

    fn diffuse(&self) -> Rgb {
        self.0.diffuse()
    }

    fn glossy_albedo(&self) -> Rgb {
        match self.1 {
            Wrong::AlbedoNotANumber => Rgb::splat(f32::NAN),
            Wrong::AlbedoAboveOne | Wrong::FarTooBright => Rgb::splat(20.0),
            Wrong::AlbedoNegative => Rgb::splat(-3.0),
            _ => self.0.glossy_albedo(),
        }
    }

    fn lobe(&self, outgoing: Vec3) -> Lobe {
        match self.1 {
            Wrong::LobeNotANumber => Lobe { direction: Vec3::NAN, width: f32::NAN },
            _ => self.0.lobe(outgoing),
        }
    }
}

/// The unit cube: a glowing wall that reflects half, five others of a reflector.
fn room(reflector: Arc<dyn Reflector>) -> Solution<GlossyField> {
    let mut surfaces = walls(DVec3::ZERO, DVec3::ONE, 1);
    surfaces[0].material = 0;
    let matte = DiffuseMaterial { reflectance: reflector.diffuse(), exitance: Rgb::ZERO, two_sided: false };
    let input = SceneInput { surfaces, materials: vec![glowing(0.5), matte], ..SceneInput::default() };
    let lamp = Lambert::new(Rgb::splat(0.5)).expect("valid parameters");
    solve(&input, 0.3, GlossyField::new(&[Arc::new(lamp), reflector], Refinement::default()))
}

/// The largest irradiance of any leaf, after what is glossy has been seen to be finite.
fn brightest(solution: &Solution<GlossyField>, what: &str) -> f32 {
    assert_sane(solution, what);
    for haar in &solution.reflected {
        let light = solution.field.radiance_bounds(haar, &hr_diffuse::Cone::SPHERE);
        assert!(light.0.is_finite() && light.1.is_finite(), "glossy light {light:?}: {what}");
    }
    solution.exitant.irradiance.iter().map(|e| e.max_element()).fold(0.0, f32::max)
}

#[test]
fn misbehaving_reflectors_are_clamped_and_counted() {
    let phong = Phong::new(Rgb::splat(0.3), Rgb::splat(0.4), 10.0).expect("valid parameters");
    let sound = room(Arc::new(phong));
    assert_eq!(sound.field.counters().clamped(), 0, "nothing is clamped of a sound one");
    for wrong in [
        Wrong::NotANumber,
        Wrong::Infinite,
        Wrong::Negative,
        Wrong::FarTooBright,
        Wrong::AlbedoNotANumber,
        Wrong::AlbedoAboveOne,
        Wrong::AlbedoNegative,
        Wrong::LobeNotANumber,
    ] {
        let solution = room(Arc::new(Misbehaving(phong, wrong)));
        let found = brightest(&solution, &format!("{wrong:?}"));
        // Where nothing but the lamp's wall absorbs, and that half, twice its exitance arrives; leaves differ.
        assert!((0.1..4.0).contains(&found), "{wrong:?}: irradiance of up to {found}");
        let clamped = solution.field.counters().clamped();
        assert!(clamped > 0 || wrong == Wrong::LobeNotANumber, "{wrong:?} is counted");
    }
}

/// Appendix B of the glTF specification reflects up to 1.85 times the light that grazes a smooth white dielectric.
#[test]
fn white_dielectrics_do_not_make_light() {
    for roughness in [0.0, 0.3] {
        let white = MetallicRoughness::new(Rgb::ONE, 0.0, roughness).expect("valid parameters");
        for reflector in [Arc::new(white) as Arc<dyn Reflector>, Arc::new(white.compensated())] {
            let what = format!("{reflector:?}");
            let solution = room(reflector);
            let found = brightest(&solution, &what);
            assert!((1.8..2.6).contains(&found), "{what}: irradiance of up to {found} where 2 is right");
        }
    }
}

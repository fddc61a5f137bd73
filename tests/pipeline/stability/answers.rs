//! Hard scenes, at any scale, anywhere, any way up: the answers that are known.

use crate::scenes::solve;
use crate::stability::cases::{self, Case};
use crate::stability::placement::{self, Placement};
use hr_diffuse::{LightField, SceneInput, Solution};

/// Asked for in all cases, and the most that known values are off where the case says no less.
pub(crate) const ERROR: f32 = 0.15;

/// Every number of a solution is finite, light is not negative.
#[track_caller]
pub(crate) fn assert_sane<L: LightField>(solution: &Solution<L>, what: &str) {
    let light = solution.exitant.radiosity.iter().chain(&solution.exitant.irradiance);
    for light in light.chain(&solution.vertices.irradiance) {
        assert!(light.is_finite() && light.min_element() >= 0.0, "light of {light}: {what}");
    }
    for link in solution.links.all() {
        assert!(link.factor.is_finite() && link.factor >= 0.0, "{link:?}: {what}");
        assert!((-1.0..=1.0).contains(&link.visibility), "{link:?}: {what}");
    }
    for node in &solution.elements.nodes {
        assert!(node.area.is_finite() && node.radius.is_finite() && node.center.is_finite(), "{node:?}: {what}");
    }
    assert!(solution.vertices.positions.iter().all(|p| p.is_finite()), "positions of vertices: {what}");
}

/// Mean irradiance of a surface's front, averaged over the channels; 0 where no light reaches it.
pub(crate) fn irradiance<L: LightField>(solution: &Solution<L>, surface: usize) -> f64 {
    let node = solution.elements.surface_nodes[surface][0] as usize;
    solution.exitant.irradiance.get(node).map_or(0.0, |e| f64::from(e.element_sum() / 3.0))
}

fn check(case: &Case, input: &SceneInput, at: &str, faults: &mut Vec<String>) {
    let what = format!("{} {at}", case.name);
    let solution = solve(input, ERROR, ());
    assert_sane(&solution, &what);
    for &(surface, exact) in &case.irradiance {
        let found = irradiance(&solution, surface);
        if (found - exact).abs() > case.tolerance * exact {
            let off = 100.0 * (found / exact - 1.0);
            faults.push(format!("{what}: surface {surface} receives {off:+.2} % of {exact:e}"));
        }
    }
    let most = solution.exitant.radiosity.iter().map(|b| b.max_element()).fold(0.0, f32::max);
    if f64::from(most) > case.most * (1.0 + f64::from(ERROR)) {
        faults.push(format!("{what}: something sends {most}, more than {}", case.most));
    }
}

#[test]
fn known_answers_are_met_wherever_the_scene_is() {
    let mut faults = Vec::new();
    for case in cases::all() {
        for placement in placement::all() {
            check(&case, &placement.of(&case.input), &format!("{placement:?}"), &mut faults);
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Light is linear: a scene with lamps that many times as strong has that many times as much light.
#[test]
fn the_strength_of_lamps_does_not_matter() {
    let mut faults = Vec::new();
    for mut case in cases::all() {
        let original = case.input.clone();
        let known = case.irradiance.clone();
        for power in [1e-20_f32, 1e-10, 1e10, 1e20] {
            case.input = original.clone();
            for material in &mut case.input.materials {
                material.exitance *= power;
            }
            for light in &mut case.input.lights {
                light.intensity *= power;
            }
            case.irradiance = known.iter().map(|&(surface, e)| (surface, e * f64::from(power))).collect();
            let most = case.most;
            case.most *= f64::from(power);
            check(&case, &case.input, &format!("at {power:e} times its strength"), &mut faults);
            case.most = most;
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// A weak lamp in the same scene as a strong one.
#[test]
fn lamps_of_all_strengths_shine_together() {
    let mut faults = Vec::new();
    for case in cases::all().into_iter().filter(|case| case.name == "parallel plates") {
        let mut input = case.input.clone();
        for power in [1e-20_f32, 1e-10, 1e-3] {
            let mut lamp = input.surfaces[1].clone();
            lamp.material = input.materials.len() as u32;
            if let hr_diffuse::Shape::Quad(points) = &mut lamp.shape {
                points.iter_mut().for_each(|p| p.z += f64::from(lamp.material));
            }
            input
                .materials
                .push(hr_diffuse::DiffuseMaterial { exitance: hr_diffuse::Rgb::splat(power), ..input.materials[1] });
            input.surfaces.push(lamp);
        }
        check(&case, &input, "below weaker lamps", &mut faults);
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// What a placement does to a scene is undone by its normalisation: the identity gives the scene itself.
#[test]
fn the_identity_changes_nothing() {
    let here = Placement { scale: 1.0, turn: glam::DQuat::IDENTITY, offset: glam::DVec3::ZERO };
    for case in cases::all() {
        assert_eq!(here.of(&case.input).surfaces, case.input.surfaces, "{}", case.name);
    }
}

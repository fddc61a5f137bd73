//! Scenes that come with the library: a furnished room to look at, and small ones to measure with.
//!
//! | name | what |
//! | --- | --- |
//! | `room` | a furnished room with a glossy floor, many lamps and curved things; z up; the [default](DEFAULT) |
//! | `three-lights` | red, green and blue light that reaches a wall over one small, very glossy reflector only |
//! | `lights-3deg`, `lights-15deg`, `lights-30deg` | seven small lights so far apart, over a glossy reflector |
//! | `glossy-sphere` | a glossy sphere over a glossy floor, under a diffuse ceiling |
//! | `empty-room` | a bare room with a glossy tile floor and five lamps; y up |
//! | `area-light` | a tilted area light over a plate of nearly mirror-like gloss |
//! | `furnace` | a closed cube that emits everywhere: radiosity is exitance / (1 − reflectance) |
//! | `cornell` | the Cornell box, in metres; y up |
//!
//! Lengths are metres, exitances W/m², colours in the [Radiance](crate::Primaries::Radiance) primaries.

mod build;
mod room;
mod studies;

use crate::Scene;

/// The name of the scene to show where none is asked for.
pub const DEFAULT: &str = "room";

/// The names of all built-in scenes.
pub const NAMES: [&str; 10] = [
    "room",
    "three-lights",
    "lights-3deg",
    "lights-15deg",
    "lights-30deg",
    "glossy-sphere",
    "empty-room",
    "area-light",
    "furnace",
    "cornell",
];

/// Makes the built-in scene of that name; `None` where there is none.
#[must_use]
pub fn scene(name: &str) -> Option<Scene> {
    Some(match name {
        "room" => room::room(),
        "three-lights" => studies::three_lights(),
        "lights-3deg" => studies::seven_lights("lights-3deg", 3.0),
        "lights-15deg" => studies::seven_lights("lights-15deg", 15.0),
        "lights-30deg" => studies::seven_lights("lights-30deg", 30.0),
        "glossy-sphere" => studies::glossy_sphere(),
        "empty-room" => studies::empty_room(),
        "area-light" => studies::area_light(),
        "furnace" => studies::furnace(),
        "cornell" => studies::cornell(),
        _ => return None,
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{Material, Rgb};
    use glam::{DVec3, Vec3};
    use hr_diffuse::Shape;
    use std::collections::HashMap;

    /// A grey diffuse material for tests.
    pub(crate) fn grey(name: &str, two_sided: bool, exitance: f32) -> Material {
        let paint =
            build::Paint { two_sided, exitance: Rgb::splat(exitance), ..build::Paint::diffuse(Rgb::splat(0.5)) };
        build::material(name, paint)
    }

    #[test]
    fn all_scenes_are_sound() {
        for name in NAMES {
            let raw = scene(name).expect(name);
            assert_eq!(raw.name, name, "named as asked for");
            let count = raw.surfaces.len();
            let done = Scene::load(name).expect(name);
            assert_eq!(done.warnings, [], "{name}: nothing to mend");
            assert_eq!(done.surfaces.len(), count, "{name}: nothing left out");
            assert!(done.cameras.len() >= 2, "{name}: cameras");
            for material in &done.materials {
                let total = material.reflector.diffuse() + material.reflector.glossy_albedo();
                assert!(
                    total.cmpge(Vec3::ZERO).all() && total.max_element() <= 1.0,
                    "{name}: {} reflects {total}",
                    material.name
                );
            }
            assert!(done.materials.iter().any(|m| m.exitance != Rgb::ZERO), "{name}: light");
            let used: std::collections::HashSet<_> = done.surfaces.iter().map(|s| s.material).collect();
            assert_eq!(used.len(), done.materials.len(), "{name}: every material is used");
        }
        assert!(NAMES.contains(&DEFAULT), "the default exists");
        assert!(scene("Room").is_none(), "names are exact");
    }

    #[test]
    fn quads_are_planar_and_convex() {
        for name in NAMES {
            for (k, surface) in scene(name).expect(name).surfaces.iter().enumerate() {
                let Shape::Quad(p) = surface.shape else {
                    continue;
                };
                let normal = (p[2] - p[0]).cross(p[3] - p[1]).normalize();
                let size = (p[2] - p[0]).length();
                for c in 0..4 {
                    let off = (p[c] - p[0]).dot(normal).abs();
                    assert!(off <= 1e-9 * size, "{name} {k}: corner {c} is off by {off}");
                    let turn = (p[(c + 1) % 4] - p[c]).cross(p[(c + 2) % 4] - p[(c + 1) % 4]);
                    assert!(turn.dot(normal) > 0.0, "{name} {k}: convex at corner {c}");
                }
            }
        }
    }

    /// The middle and the normal of a polygon.
    fn middle_and_normal(shape: &Shape) -> Option<(DVec3, DVec3)> {
        match shape {
            Shape::Quad(p) => Some(((p[0] + p[1] + p[2] + p[3]) / 4.0, (p[2] - p[0]).cross(p[3] - p[1]).normalize())),
            _ => None,
        }
    }

    #[test]
    fn room_shells_face_inward() {
        // The materials that make up the shell of each scene, how many faces, and a point in the free middle.
        let bare: &[&str] = &["wall", "floor_tile", "wallpaint"];
        let furnished: &[&str] =
            &["plank", "plank light", "plank dark", "ceiling", "white wall", "terracotta wall", "teal wall", "sky"];
        for (name, materials, faces, inside) in [
            ("furnace", bare, 6, DVec3::ZERO),
            ("empty-room", bare, 6, DVec3::new(0.5, 1.2, 1.9)),
            // 40 planks, the ceiling, three whole walls, four parts of the back wall, three reveals, the sky.
            ("room", furnished, 52, DVec3::new(4.1, 2.2, 1.3)),
        ] {
            let s = scene(name).expect(name);
            let mut seen = 0;
            for surface in &s.surfaces {
                let shell = materials.contains(&s.materials[surface.material as usize].name.as_str());
                let Some((middle, normal)) = middle_and_normal(&surface.shape).filter(|_| shell) else { continue };
                seen += 1;
                assert!(normal.dot(inside - middle) > 0.0, "{name}: the face at {middle} looks inward");
            }
            assert_eq!(seen, faces, "{name}: faces of the shell");
        }
    }

    #[test]
    fn furnace_is_closed() {
        let s = scene("furnace").expect("furnace");
        let mut edges: HashMap<[i64; 6], i32> = HashMap::new();
        for surface in &s.surfaces {
            let Shape::Quad(p) = surface.shape else { panic!("only quads: {surface:?}") };
            for k in 0..4 {
                let [a, b] = [p[k], p[(k + 1) % 4]].map(|v| v.to_array().map(|c| (c * 1e6).round() as i64));
                let (key, sign) = if a < b { ([a, b], 1) } else { ([b, a], -1) };
                *edges.entry([key[0], key[1]].concat().try_into().expect("six")).or_default() += sign;
            }
        }
        assert_eq!(edges.len(), 12, "a cube has twelve edges");
        assert!(edges.values().all(|v| *v == 0), "each is shared by two faces in opposite directions");
    }
}

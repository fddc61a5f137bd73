//! Rooms in which light has no end: lit, closed, and nothing in them absorbs.
//!
//! Where every side that light can get to reflects all of it and none can leave, it grows without end. Whether a room is
//! closed cannot be proven at little cost, so rays decide: sides that reflect a channel entirely and see each other make
//! a group, as in [`sealed`](crate::sealed), and a group that light enters is refused if none of several thousand rays
//! met anything else. What absorbs or opens less than about a thousandth of the view may be missed; light that is
//! reflected a thousand times over would not be solved to any accuracy either. Scenes in which no material
//! reflects any channel entirely are never looked at.

use crate::error::SolveError;
use crate::geometry::Domain;
use crate::hierarchy::SceneData;
use crate::sampling::{cosine_direction, hash, point4};
use crate::sealed::{Groups, Side, sees_light};
use crate::threads;
use crate::{LightKind, Rgb};

/// Reflectances above this are taken for 1: rounding of what an extension adds.
const ENTIRE: f32 = 1.0 - 1e-6;
/// Rays per group, dealt out among its sides, and the least per side.
const RAYS: u32 = 4096;
const LEAST_RAYS: u32 = 16;
/// Names of the channels.
const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// Refuses scenes whose light has no end. `extra` is what an extension reflects of a material beside the diffuse part.
pub(crate) fn check(scene: &SceneData, extra: impl Fn(u32) -> Rgb) -> Result<(), SolveError> {
    let extra: Vec<Rgb> = (0..scene.materials.len() as u32).map(extra).collect();
    if scene.texture.is_none()
        && extra.iter().zip(&scene.materials).all(|(e, m)| (*e + m.reflectance).max_element() <= ENTIRE)
    {
        return Ok(());
    }
    let count = scene.surfaces().len() as u32;
    let albedo = |surface: usize| {
        let surface = surface as u32;
        let other = extra[scene.surface_materials[surface as usize] as usize];
        if scene.is_twin(surface) { Rgb::ZERO } else { scene.reflectance(surface, &Domain::WHOLE) + other }
    };
    let albedos = threads::map_range(0..count as usize, 64, albedo);
    for (channel, name) in CHANNELS.into_iter().enumerate() {
        let entire: Vec<bool> = (0..2 * count)
            .map(|side| {
                let material = &scene.materials[scene.surface_materials[(side / 2) as usize] as usize];
                (side % 2 == 0 || material.two_sided) && albedos[(side / 2) as usize][channel] > ENTIRE
            })
            .collect();
        let sides: Vec<Side> = (0..2 * count).filter(|&side| entire[side as usize]).collect();
        if let Some(side) = endless(scene, &entire, &sides, channel) {
            return Err(SolveError::NoSteadyState { surface: (side / 2) as usize, channel: name });
        }
    }
    Ok(())
}

/// A side of a lit group from which no ray leaves.
fn endless(scene: &SceneData, entire: &[bool], sides: &[Side], channel: usize) -> Option<Side> {
    let rays = (RAYS / (sides.len() as u32).max(1)).max(LEAST_RAYS);
    let seen = threads::map(sides, 1, |&side| look(scene, entire, side, rays, channel));
    let mut groups = Groups::new(entire.len());
    for (&side, seen) in sides.iter().zip(&seen) {
        for &other in &seen.sides {
            groups.join(side, other);
        }
    }
    // Of each group by its root: whether light gets out of it.
    let mut leaks = vec![false; entire.len()];
    for (&side, seen) in sides.iter().zip(&seen) {
        let root = groups.root(side);
        leaks[root] |= seen.leaks;
        if seen.lit {
            groups.light(side);
        }
    }
    sides.iter().copied().find(|&side| groups.is_lit(side) && !leaks[groups.root(side)])
}

/// What a side sees.
struct Seen {
    sides: Vec<Side>,
    /// Something that absorbs, or nothing.
    leaks: bool,
    /// Whether it emits, or sees a light without extent.
    lit: bool,
}

fn look(scene: &SceneData, entire: &[bool], side: Side, rays: u32, channel: usize) -> Seen {
    let (surface, back) = (side / 2, side % 2 == 1);
    let material = &scene.materials[scene.surface_materials[surface as usize] as usize];
    let mut seen = Seen { sides: Vec::new(), leaks: false, lit: !back && material.exitance[channel] > 0.0 };
    let outside = |l: &crate::Light| matches!(l.kind, LightKind::Directional { .. }) || l.intensity[channel] <= 0.0;
    let unlit = scene.lights.iter().all(outside);
    for i in 0..rays {
        let u = point4(hash(side, 0x57ea), i);
        let (x, normal) = scene.surfaces()[surface as usize].sample(Domain::WHOLE, u.x, u.y);
        let n = if back { -normal } else { normal };
        let direction = cosine_direction(n, u.z, u.w);
        match scene.visibility.first_side(x, direction, f32::MAX, surface) {
            Some((other, _)) if entire[other as usize] => seen.sides.push(other),
            _ => {
                seen.leaks = true;
                break;
            }
        }
        seen.lit |= !unlit && sees_light(scene, surface, x, n, |light| light.intensity[channel] > 0.0);
    }
    seen.sides.sort_unstable();
    seen.sides.dedup();
    seen
}

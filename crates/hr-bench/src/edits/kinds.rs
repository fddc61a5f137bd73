//! What is edited, chosen so that any scene has it.

use glam::DVec3;
use glossy_ext::Reflector;
use hr_diffuse::{SceneInput, Shape, Surface};
use hr_scene::edits::roughened;
use hr_scene::{Rgb, Scene};
use std::collections::HashMap;
use std::sync::Arc;

/// Things that are moved are no larger than this share of the scene, and move by so much of it.
const LARGE: f64 = 0.5;
const STEP: f64 = 0.05;
/// What lamps are dimmed to, and how they and diffuse surfaces are coloured.
const DIMMED: f32 = 0.5;
const LIGHT_COLOR: Rgb = Rgb::new(1.0, 0.8, 0.6);
const PAINT: Rgb = Rgb::new(0.9, 0.8, 1.0);
/// So many times as rough.
const ROUGHER: f32 = std::f32::consts::SQRT_2;

/// A scene after an edit.
pub(super) struct Edit {
    pub(super) name: &'static str,
    pub(super) input: SceneInput,
    /// Those of all materials, where they are others now.
    pub(super) reflectors: Option<Vec<Arc<dyn Reflector>>>,
    pub(super) how: How,
}

/// What an edit needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum How {
    /// Light has to settle anew.
    Relight,
    /// Links have to be renewed.
    Rearrange,
    /// The light of each lamp alone has to be found, and that of all of them again.
    EachLamp,
    /// It is known, and has to be added up.
    Mix,
}

/// In which colours lamps shine after the edit of intensity, and in a mixture of them.
pub(super) fn dimmed(lamp: usize) -> Rgb {
    if lamp.is_multiple_of(2) { Rgb::splat(DIMMED) } else { Rgb::ONE }
}

/// All edits that a scene gives reason for.
pub(super) fn edits(scene: &Arc<Scene>) -> Vec<Edit> {
    let input = scene.input();
    let mut edits = Vec::from(light_and_paint(&input));
    edits.extend(rougher(scene));
    edits.extend(moves(&input));
    edits
}

/// Every other lamp dimmed, in two ways, each lamp by itself, all lamps coloured, all diffuse surfaces painted.
fn light_and_paint(input: &SceneInput) -> [Edit; 5] {
    let edit = |name, how, change: &dyn Fn(&mut SceneInput)| {
        let mut input = input.clone();
        change(&mut input);
        Edit { name, input, reflectors: None, how }
    };
    let lamps = |input: &mut SceneInput, color: &dyn Fn(usize) -> Rgb| {
        let exitances = input.materials.iter_mut().map(|material| &mut material.exitance).filter(|e| **e != Rgb::ZERO);
        let intensities = input.lights.iter_mut().map(|light| &mut light.intensity);
        exitances.chain(intensities).enumerate().for_each(|(i, of)| *of *= color(i));
    };
    [
        edit("intensity", How::Relight, &|input| lamps(input, &dimmed)),
        edit("each lamp alone", How::EachLamp, &|_| ()),
        edit("mixture of lamps", How::Mix, &|input| lamps(input, &dimmed)),
        edit("colour", How::Relight, &|input| lamps(input, &|_| LIGHT_COLOR)),
        edit("reflectance", How::Relight, &|input| {
            input.materials.iter_mut().for_each(|material| material.reflectance *= PAINT);
        }),
    ]
}

/// The glossy material that most surfaces have, somewhat rougher.
fn rougher(scene: &Arc<Scene>) -> Option<Edit> {
    let count = |material: usize| scene.surfaces.iter().filter(|surface| surface.material as usize == material).count();
    let mut edited = Scene::clone(scene);
    let mut glossy: Vec<usize> =
        (0..scene.materials.len()).filter(|&m| !scene.materials[m].reflector.is_diffuse()).collect();
    glossy.sort_by_key(|&material| std::cmp::Reverse(count(material)));
    glossy.into_iter().find(|&material| roughened(&mut edited.materials[material], ROUGHER).is_ok())?;
    let reflectors = Some(edited.reflectors());
    Some(Edit { name: "roughness", input: Arc::new(edited).input(), reflectors, how: How::Relight })
}

/// The first set of surfaces that share corners which is neither large nor a lamp, and the first that is a lamp, elsewhere.
fn moves(input: &SceneInput) -> Vec<Edit> {
    let emits = |surface: &Surface| input.materials[surface.material as usize].exitance != Rgb::ZERO;
    let all = bounds(input.surfaces.iter());
    let size = (all[1] - all[0]).max_element();
    let is_small = |thing: &&Vec<usize>| {
        let [low, high] = bounds(thing.iter().map(|&surface| &input.surfaces[surface]));
        (high - low).max_element() < LARGE * size
    };
    let things = things(&input.surfaces);
    let mut edits = Vec::new();
    // Toward the middle of the scene, along the floor or the ceiling.
    let step = |from: DVec3| {
        let to = (0.5 * (all[0] + all[1]) - from) * least_out(all);
        to.try_normalize().unwrap_or(DVec3::X) * (STEP * size)
    };
    for (name, lamp) in [("moved object", false), ("moved lamp", true)] {
        let found =
            things.iter().filter(is_small).find(|thing| thing.iter().any(|&s| emits(&input.surfaces[s])) == lamp);
        let mut moved = input.clone();
        if let Some(thing) = found {
            let [low, high] = bounds(thing.iter().map(|&surface| &input.surfaces[surface]));
            let by = step(0.5 * (low + high));
            thing.iter().for_each(|&surface| shift(&mut moved.surfaces[surface].shape, by));
        } else if let Some(light) = moved.lights.first_mut().filter(|_| lamp) {
            light.position += step(light.position);
        } else {
            continue;
        }
        edits.push(Edit { name, input: moved, reflectors: None, how: How::Rearrange });
    }
    edits
}

/// 0 along the axis along which the scene is lowest, where things stand, and 1 along the others.
fn least_out([low, high]: [DVec3; 2]) -> DVec3 {
    let size = high - low;
    let least = size.min_element();
    let mut kept = DVec3::ONE;
    let axis = (0..3).find(|&axis| size[axis] <= least).unwrap_or(2);
    kept[axis] = 0.0;
    kept
}

/// Surfaces that share corners, as sets in order of their first ones.
fn things(surfaces: &[Surface]) -> Vec<Vec<usize>> {
    let mut first: Vec<usize> = (0..surfaces.len()).collect();
    fn root(first: &mut [usize], mut of: usize) -> usize {
        while first[of] != of {
            first[of] = first[first[of]];
            of = first[of];
        }
        of
    }
    let mut owner: HashMap<[u64; 3], usize> = HashMap::new();
    for (surface, of) in surfaces.iter().enumerate() {
        for corner in corners(&of.shape) {
            let other = *owner.entry(corner.to_array().map(f64::to_bits)).or_insert(surface);
            let (a, b) = (root(&mut first, surface), root(&mut first, other));
            first[a.max(b)] = a.min(b);
        }
    }
    let mut sets: Vec<Vec<usize>> = vec![Vec::new(); surfaces.len()];
    for surface in 0..surfaces.len() {
        sets[root(&mut first, surface)].push(surface);
    }
    sets.retain(|set| !set.is_empty());
    sets
}

/// Corners of polygons, by which they hang together.
fn corners(shape: &Shape) -> &[DVec3] {
    match shape {
        Shape::Triangle(corners) => corners,
        Shape::Quad(corners) => corners,
        _ => &[],
    }
}

fn bounds<'a>(surfaces: impl Iterator<Item = &'a Surface>) -> [DVec3; 2] {
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let mut add = |at: DVec3, reach: f64| {
        bounds = [bounds[0].min(at - reach), bounds[1].max(at + reach)];
    };
    for surface in surfaces {
        match &surface.shape {
            Shape::Sphere { center, radius } => add(*center, *radius),
            Shape::Cone { ends, radii } => ends.iter().zip(radii).for_each(|(end, radius)| add(*end, *radius)),
            Shape::Ring { center, outer, .. } => add(*center, *outer),
            Shape::Torus { center, major, minor, .. } => add(*center, major + minor),
            polygon => corners(polygon).iter().for_each(|corner| add(*corner, 0.0)),
        }
    }
    bounds
}

fn shift(shape: &mut Shape, by: DVec3) {
    match shape {
        Shape::Triangle(corners) => corners.iter_mut().for_each(|corner| *corner += by),
        Shape::Quad(corners) => corners.iter_mut().for_each(|corner| *corner += by),
        Shape::Cone { ends, .. } => ends.iter_mut().for_each(|end| *end += by),
        Shape::Sphere { center, .. } | Shape::Ring { center, .. } | Shape::Torus { center, .. } => *center += by,
    }
}

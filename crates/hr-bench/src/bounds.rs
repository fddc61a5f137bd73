//! How tight the oracle's bounds of form factors are: random pairs of a scene's elements against their true factors.
//!
//! True is what the sender's surfaces make of irradiance at random points of the receiver, each by quadrature or its
//! closed form ([`point_factor`]). Parts of a cluster may hide others. So together they bound the smallest factor from above,
//! and each of them the largest from below.

use crate::BenchError;
use crate::args::BoundsArgs;
use crate::measure::{Extent, solve};
use crate::run::{Out, say};
use glam::Vec3;
use hr_diffuse::Solution;
use hr_diffuse::form_factor::{Accuracy, Part, point_factor};
use hr_diffuse::hierarchy::{Element, Kind};
use hr_diffuse::oracle::factor_bounds;
use hr_diffuse::sampling::{hash, unit};
use hr_scene::Scene;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Elements come from solutions with this error.
const ERROR: f32 = 0.2;
/// Points of each receiver.
const POINTS: usize = 6;
/// Clusters of more surfaces are left out: their true factors take too long.
const MOST_SURFACES: usize = 400;
/// Pairs are drawn this many times as often as they are wanted: some classes are rare.
const DRAWS: u32 = 60;
/// Distances over the sum of radii at which the classes end.
const CLASSES: [(f32, &str); 4] = [(1.5, "touching"), (4.0, "near"), (16.0, "far"), (f32::INFINITY, "very far")];
/// Bounds err by rounding of positions to f32, and by what the quadrature is asked for.
const SLACK: [f64; 2] = [2e-3, 2e-6];
/// Factors below this are no light.
const DARK: f64 = 1e-7;

/// What is looked at in a row of the table: kinds of receiver and sender, class of distance.
type Class = (&'static str, &'static str, usize);

/// Pairs of a class.
#[derive(Clone, Debug, Default)]
struct Row {
    /// (max − min) / factor of those that see each other.
    widths: Vec<f64>,
    pairs: u32,
    /// Pairs that may see each other by their bounds, but do not.
    in_vain: u32,
    violations: u32,
}

/// Prints a Markdown table over all scenes.
///
/// # Errors
/// [`BenchError::Compare`] where a bound is crossed; else where a scene cannot be solved.
pub fn report(args: &BoundsArgs, out: Out<'_>) -> Result<(), BenchError> {
    let mut rows: BTreeMap<Class, Row> = BTreeMap::new();
    for (i, name) in args.scenes.iter().enumerate() {
        let scene = Arc::new(Scene::load(name)?);
        let (solution, _) = solve(&scene.input(), ERROR, 1, Extent { vertices: false, ..Extent::FULL })?;
        draw(&solution, args.pairs * (i as u32 + 1), hash(i as u32, 0x51ed), &mut rows);
    }
    say(out, "| receiver | sender | distance | pairs | width over factor: median | 90 % | in vain | violations |")?;
    say(out, "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |")?;
    for ((receiver, sender, class), row) in &mut rows {
        row.widths.sort_by(f64::total_cmp);
        let quantile = |q: f64| {
            let width = row.widths.get(((row.widths.len().max(1) - 1) as f64 * q) as usize);
            width.map_or("-".into(), |width| format!("{width:.2}"))
        };
        let line = format!(
            "| {receiver} | {sender} | {} | {} | {} | {} | {} | {} |",
            CLASSES[*class].1,
            row.pairs,
            quantile(0.5),
            quantile(0.9),
            row.in_vain,
            row.violations
        );
        say(out, &line)?;
    }
    match rows.values().map(|row| row.violations).sum::<u32>() {
        0 => Ok(()),
        count => Err(BenchError::Compare(format!("{count} pairs have factors that are not within their bounds"))),
    }
}

/// Random pairs of a solution's elements, until each class has as many as wanted.
fn draw(solution: &Solution, wanted: u32, seed: u32, rows: &mut BTreeMap<Class, Row>) {
    let mut kinds: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    for (node, element) in solution.elements.nodes.iter().enumerate() {
        if element.kind != Kind::Light {
            kinds.entry(kind(element)).or_default().push(node as u32);
        }
    }
    let mut count = seed;
    let mut number = || {
        count = count.wrapping_add(1);
        unit(hash(count, seed))
    };
    for (to, receivers) in &kinds {
        for (from, senders) in &kinds {
            for _ in 0..wanted * DRAWS {
                let mut pick = |of: &[u32]| of[((number() * of.len() as f32) as usize).min(of.len() - 1)];
                let (receiver, sender) = (pick(receivers), pick(senders));
                let (r, s) = [receiver, sender].map(|node| &solution.elements.nodes[node as usize]).into();
                if receiver == sender || r.kind == Kind::Cluster && surfaces(solution, receiver).is_none() {
                    continue;
                }
                let ratio = r.center.distance(s.center) / (r.radius + s.radius);
                let class = CLASSES.iter().position(|(end, _)| ratio < *end).unwrap_or(CLASSES.len() - 1);
                let row = rows.entry((*to, *from, class)).or_default();
                if row.pairs < wanted
                    && let Some(parts) = surfaces(solution, sender)
                {
                    row.look(solution, (receiver, &parts), (r, s), &mut number);
                }
            }
        }
    }
}

impl Row {
    fn look(
        &mut self,
        solution: &Solution,
        (receiver, parts): (u32, &[u32]),
        (r, s): (&Element, &Element),
        number: &mut impl FnMut() -> f32,
    ) {
        let bounds = factor_bounds(&solution.scene, r, s);
        let (min, max) = bounds.map_or((0.0, 0.0), |bounds| (f64::from(bounds.min), f64::from(bounds.max)));
        let places = surfaces(solution, receiver).unwrap_or_default();
        let (mut mean, mut is_violated) = (0.0, false);
        for _ in 0..POINTS {
            let place = places[((number() * places.len() as f32) as usize).min(places.len() - 1)];
            let place = &solution.elements.nodes[place as usize];
            let geometry = &solution.scene.surfaces()[place.source as usize];
            let (x, front, _) = geometry.sample_area(place.domain, number(), number());
            // Where nothing is to pass nothing arrives at the surface itself; else what is bent is a plane that faces the
            // sender.
            let n = match bounds {
                None if place.kind == Kind::Back => -front,
                None => front,
                Some(_) if r.is_flat() => r.normals.axis,
                Some(_) => (s.center - x).normalize_or(Vec3::Z),
            };
            let (mut sum, mut largest) = (0.0_f64, 0.0_f64);
            for &node in parts {
                let part = &solution.elements.nodes[node as usize];
                let geometry = &solution.scene.surfaces()[part.source as usize];
                let sender = Part { geometry, domain: part.domain, back: part.kind == Kind::Back };
                let accuracy = Accuracy { relative: 1e-3, absolute: 1e-9, most: 800 };
                let factor = point_factor(sender, x.as_dvec3(), n.as_dvec3(), accuracy);
                (sum, largest) = (sum + factor, largest.max(factor));
            }
            let slack = SLACK[0] * sum + SLACK[1];
            is_violated |= largest > max + slack || sum < min - slack;
            mean += sum / POINTS as f64;
        }
        self.pairs += 1;
        self.violations += u32::from(is_violated);
        if mean > DARK {
            self.widths.push((max - min) / mean);
        } else {
            self.in_vain += u32::from(max > DARK);
        }
    }
}

fn kind(element: &Element) -> &'static str {
    match element.kind {
        Kind::Cluster => "cluster",
        Kind::Light => "light",
        _ if element.is_whole_sphere() => "sphere",
        _ if element.is_flat() => "flat",
        _ => "curved",
    }
}

/// The whole surface sides below a node, or the node itself if it is a part of one; `None` where there are too many.
fn surfaces(solution: &Solution, node: u32) -> Option<Vec<u32>> {
    let (mut found, mut open) = (Vec::new(), vec![node]);
    while let Some(node) = open.pop() {
        let element = &solution.elements.nodes[node as usize];
        match element.kind {
            Kind::Cluster => open.extend(element.first_child..element.first_child + element.child_count),
            Kind::Front | Kind::Back => found.push(node),
            Kind::Light => {}
        }
        if found.len() + open.len() > MOST_SURFACES {
            return None;
        }
    }
    (!found.is_empty()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bounds_of_built_in_scenes_are_never_crossed() {
        let args = BoundsArgs { scenes: vec!["cornell".into(), "glossy-sphere".into()], pairs: 8 };
        let mut said = Vec::new();
        report(&args, &mut said).expect("bounds hold");
        let said = String::from_utf8(said).expect("text");
        for kinds in ["| flat | flat | far |", "| flat | cluster |", "| cluster | cluster |", "| flat | sphere |"] {
            assert!(said.contains(kinds), "{kinds} is looked at: {said}");
        }
    }
}

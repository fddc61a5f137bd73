//! What lies behind a picture, to be drawn over it: elements, clusters, and all about one point.

use crate::glossy;
use crate::solved::Solved;
use glam::{DVec3, Vec3};
use glossy_ext::{Incident, Place, Rgb, arriving};
use hr_diffuse::hierarchy::{Element, Kind};
use hr_diffuse::{Hit, NodeId};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, TAU};

/// Rays from the eye begin this far from it (unit space).
const START: f32 = 1e-6;
/// The longest arrow and the balloon's farthest point, as a share of the scene's size.
const REACH: f32 = 0.1;
/// Circles and meridians of a balloon.
const CIRCLES: u32 = 24;
const MERIDIANS: u32 = 72;
/// The strongest samples are listed by numbers.
const LISTED: usize = 5;
/// So many of the strongest links are drawn.
const MOST_LINKS: usize = 300;

/// A corner of something drawn over the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// In scene units, relative to the mesh's origin.
    pub at: Vec3,
    /// Linear colour as the screen shows it, 0…1, and opacity.
    pub color: [f32; 4],
}

/// What is known about a point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Finding {
    /// Index of the material.
    pub material: u32,
    /// Its figures, in lines.
    pub text: Vec<String>,
    /// Two ends of each arrow and outline: seen through everything.
    pub lines: Vec<Mark>,
    /// Two ends of each link that lights it: seen through everything.
    pub links: Vec<Mark>,
    /// Corners of the triangles of the balloon.
    pub balloon: Vec<Mark>,
}

/// What a solution shows of its inside.
pub trait Inside {
    /// Two ends of each edge of all elements that light is computed for.
    fn elements(&self) -> Vec<Mark>;
    /// Two ends of each edge of the boxes of all clusters so many levels below the one that holds all; empty where there
    /// are none so deep.
    fn clusters(&self, level: u32) -> Vec<Mark>;
    /// All about the point that is seen from an eye (scene units) in a direction; `None` where there is none.
    fn look_at(&self, eye: DVec3, direction: DVec3) -> Option<Finding>;
}

/// The inside of a solution whose picture is relative to an origin (scene units).
pub(crate) struct Anatomy<'a> {
    pub(crate) solved: &'a Solved,
    pub(crate) origin: DVec3,
}

impl Anatomy<'_> {
    /// A point of unit space.
    fn place(&self, at: Vec3) -> Vec3 {
        (self.solved.solution.scene.normalization.to_scene(at) - self.origin).as_vec3()
    }

    fn line(&self, out: &mut Vec<Mark>, ends: [Vec3; 2], color: [f32; 4]) {
        out.extend(ends.map(|at| Mark { at: self.place(at), color }));
    }

    fn outline(&self, out: &mut Vec<Mark>, leaf: u32, color: [f32; 4]) {
        let vertices = &self.solved.solution.vertices;
        for (_, outline) in vertices.fans(leaf).filter_map(<[_]>::split_first) {
            for (i, corner) in outline.iter().enumerate() {
                let next = &outline[(i + 1) % outline.len()];
                let ends = [corner, next].map(|c| vertices.positions[c.vertex as usize]);
                self.line(out, ends, color);
            }
        }
    }

    fn look(&self, hit: &Hit, eye: Vec3) -> Finding {
        let solution = &self.solved.solution;
        let scene = &self.solved.scene;
        let mut finding = Finding { material: scene.surfaces[hit.surface as usize].material, ..Finding::default() };
        let material = &scene.materials[finding.material as usize];
        let side = if hit.front { "front" } else { "back" };
        let say = &mut finding.text;
        say.push(format!("surface {} ({side}), material '{}'", hit.surface, material.name));
        let at = solution.scene.normalization.to_scene(hit.point);
        say.push(format!("at {:.4} {:.4} {:.4}", at.x, at.y, at.z));
        let emitted = if hit.front { material.exitance } else { Rgb::ZERO };
        if emitted != Rgb::ZERO {
            say.push(format!("emits {} W/m²", three(emitted)));
        }
        let Some(leaf) = solution.leaf(hit) else {
            say.push("this side absorbs everything".to_owned());
            return finding;
        };
        let element = &solution.elements.nodes[leaf.index()];
        let axis = element.normals.axis;
        let shown = NodeId(solution.faces.standing(leaf.0));
        // Metres per unit: areas of the scene.
        let area = f64::from(element.area) / solution.scene.normalization.scale().powi(2);
        let path = self.path(leaf);
        say.push(format!("element {}, {} levels down, area {area:.3e}", leaf.0, path.len() - 1));
        say.push(format!("irradiance {} W/m² here", three(solution.irradiance(leaf, hit.uv))));
        say.push(format!("irradiance {} W/m² mean of the element", three(solution.exitant.irradiance[leaf.index()])));
        let diffuse = solution.exitant.radiosity[leaf.index()];
        say.push(format!("radiosity {} W/m² diffuse, with emission", three(diffuse)));
        let away = (eye - hit.point).normalize_or(axis);
        let (glossy, _) = glossy::leaving(solution, shown, hit.point, glossy::mirrored(axis, away));
        let is_glossy = !material.reflector.is_diffuse();
        if is_glossy {
            let albedo = material.reflector.glossy_albedo() + material.reflector.mirror();
            say.push(format!("radiance {} W/(m² sr) glossy, toward the eye", three(glossy)));
            say.push(format!("glossy reflectance {}", three(albedo)));
            let haar = &solution.reflected[shown.index()];
            say.push(format!("distribution of {} basis functions", haar.basis_functions()));
        }
        self.outline(&mut finding.lines, leaf.0, [1.0, 0.75, 0.0, 1.0]);
        self.arrows(&mut finding, leaf, &path, hit.point);
        self.links(&mut finding, &path, hit.point);
        self.balloon(&mut finding, shown, element, hit.point, diffuse * FRAC_1_PI, is_glossy);
        finding
    }

    /// Nodes from a leaf up to the root.
    fn path(&self, leaf: NodeId) -> Vec<u32> {
        let nodes = &self.solved.solution.elements.nodes;
        let mut path = vec![leaf.0];
        let mut node = leaf.0;
        while nodes[node as usize].parent != node {
            node = nodes[node as usize].parent;
            path.push(node);
        }
        path
    }

    /// Light that arrives through one link, as an estimate of the mean over the leaf: what the sender emits times the
    /// link's factor and visibility, or what its sample carries.
    fn arrivals(&self, path: &[u32]) -> Vec<(u32, f32, Rgb)> {
        let solution = &self.solved.solution;
        let light = solution.light();
        let mut all = Vec::new();
        for &receiver in path {
            for link in solution.links.of(receiver) {
                let element = &solution.elements.nodes[receiver as usize];
                let away = -light.direction_to(element.center, link.sender);
                let seen = if link.visibility < 0.0 { 1.0 } else { link.visibility };
                let irradiance = light.emitted(link.sender, away) * link.factor * seen;
                all.push((link.sender, seen, irradiance));
            }
        }
        all.sort_by(|a, b| b.2.element_sum().total_cmp(&a.2.element_sum()));
        all
    }

    /// Light as it arrives at the point: illumination samples, longer where they are stronger.
    fn arrows(&self, finding: &mut Finding, leaf: NodeId, path: &[u32], at: Vec3) {
        let solution = &self.solved.solution;
        let place = Place::new(at, solution.elements.nodes[leaf.index()].normals.axis);
        let mut incident: Vec<Incident> = Vec::new();
        arriving(&solution.elements, leaf, &solution.incident_path(leaf), &place, &mut incident);
        if incident.is_empty() {
            // Diffuse receivers keep no samples; their links tell the same.
            let light = solution.light();
            incident = self
                .arrivals(path)
                .into_iter()
                .map(|(sender, _, irradiance)| Incident {
                    direction: place.local(light.direction_to(at, sender)),
                    irradiance,
                    ..Incident::default()
                })
                .collect();
        }
        incident.sort_by(|a, b| b.irradiance.element_sum().total_cmp(&a.irradiance.element_sum()));
        let sum: Rgb = incident.iter().map(|i| i.irradiance).sum();
        finding.text.push(format!("{} samples arrive with {} W/m²; the strongest:", incident.len(), three(sum)));
        for sample in incident.iter().take(LISTED) {
            let share = 100.0 * sample.irradiance.element_sum() / sum.element_sum().max(f32::MIN_POSITIVE);
            let angle = sample.direction.z.clamp(-1.0, 1.0).acos().to_degrees();
            finding
                .text
                .push(format!("  {share:5.1} %  {} W/m²  {angle:.0}° off the normal", three(sample.irradiance)));
        }
        let most = incident.first().map_or(0.0, |i| i.irradiance.element_sum()).max(f32::MIN_POSITIVE);
        for sample in &incident {
            let strength = sample.irradiance.element_sum() / most;
            let direction = place.frame * sample.direction;
            // An arrow whose tip is at the point; lengths by the energy.
            let color = shade(sample.irradiance, 0.9);
            self.line(&mut finding.lines, [at, at + direction * (REACH * strength)], color);
        }
    }

    /// Lines to the senders: green where they are seen, red where they are hidden.
    fn links(&self, finding: &mut Finding, path: &[u32], at: Vec3) {
        let solution = &self.solved.solution;
        let arrivals = self.arrivals(path);
        let [own, above] =
            [&path[..1], &path[1..]].map(|p| p.iter().map(|&n| solution.links.of(n).len()).sum::<usize>());
        finding.text.push(format!("{own} links to the element, {above} to those above it"));
        let most = arrivals.first().map_or(0.0, |a| a.2.element_sum()).max(f32::MIN_POSITIVE);
        for (sender, seen, irradiance) in arrivals.into_iter().take(MOST_LINKS) {
            let element = &solution.elements.nodes[sender as usize];
            let to = if element.kind == Kind::Light {
                // Infinitely far ones, too, end somewhere.
                let direction = solution.light().direction_to(at, sender);
                at + direction * at.distance(element.center).min(1.0)
            } else {
                element.center
            };
            let opacity = 0.15 + 0.85 * (irradiance.element_sum() / most).sqrt();
            self.line(&mut finding.links, [at, to], [1.0 - seen, seen, 0.1, opacity]);
        }
    }

    /// The radiance that leaves the element as a surface about the point, as far from it as it is bright.
    fn balloon(&self, finding: &mut Finding, leaf: NodeId, element: &Element, at: Vec3, diffuse: Rgb, is_glossy: bool) {
        let solution = &self.solved.solution;
        let frame = Place::new(at, element.normals.axis).frame;
        let radiance = |circle: u32, meridian: u32| {
            let polar = FRAC_PI_2 * circle as f32 / CIRCLES as f32;
            let turn = TAU * (meridian % MERIDIANS) as f32 / MERIDIANS as f32;
            let away = frame * Vec3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos());
            let glossy = if is_glossy {
                glossy::leaving(solution, leaf, at, glossy::mirrored(element.normals.axis, away)).0
            } else {
                Rgb::ZERO
            };
            (away, (diffuse + glossy).max(Rgb::ZERO))
        };
        let grid: Vec<Vec<(Vec3, Rgb)>> =
            (0..=CIRCLES).map(|c| (0..=MERIDIANS).map(|m| radiance(c, m)).collect()).collect();
        let most = grid.iter().flatten().map(|(_, light)| light.element_sum()).fold(0.0, f32::max);
        if most <= 0.0 {
            return;
        }
        let [low, high] = grid.iter().flatten().fold([f32::INFINITY, 0.0], |[low, high], (_, light)| {
            let mean = light.element_sum() / 3.0;
            [low.min(mean), high.max(mean)]
        });
        finding.text.push(format!("leaves with radiance {low:.3} to {high:.3} W/(m² sr), mean of R, G, B"));
        let corner = |(away, light): &(Vec3, Rgb)| {
            // Darker toward the surface, so that its shape is seen.
            let depth = 0.25 + 0.75 * element.normals.axis.dot(*away).max(0.0);
            let [r, g, b, opacity] = shade(*light, 1.0);
            let at = self.place(at + *away * (REACH * light.element_sum() / most));
            Mark { at, color: [depth * r, depth * g, depth * b, opacity] }
        };
        for (inner, outer) in grid.iter().zip(&grid[1..]) {
            for m in 0..MERIDIANS as usize {
                let [a, b, c, d] = [&inner[m], &outer[m], &outer[m + 1], &inner[m + 1]].map(corner);
                finding.balloon.extend([a, b, c, a, c, d]);
            }
        }
    }
}

impl Inside for Anatomy<'_> {
    fn elements(&self) -> Vec<Mark> {
        let mut lines = Vec::new();
        for leaf in self.solved.solution.elements.patch_leaves() {
            self.outline(&mut lines, leaf, [0.0, 0.0, 0.0, 0.6]);
        }
        lines
    }

    fn clusters(&self, level: u32) -> Vec<Mark> {
        let nodes = &self.solved.solution.elements.nodes;
        // Parents come first.
        let mut depth = vec![0_u32; nodes.len()];
        let mut lines = Vec::new();
        for (i, node) in nodes.iter().enumerate() {
            depth[i] = if node.parent as usize == i { 0 } else { depth[node.parent as usize] + 1 };
            if node.kind != Kind::Cluster || depth[i] != level {
                continue;
            }
            let corner = |k: usize| {
                let side = |bit: usize| node.bounds[(k >> bit) & 1];
                Vec3::new(side(0).x, side(1).y, side(2).z)
            };
            // Neighbouring boxes differ in colour.
            let hue = (i as f32 * 0.618_034).fract();
            let color = [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|shift| 0.5 + 0.5 * (TAU * (hue + shift)).cos());
            for k in 0..8 {
                for bit in 0..3 {
                    if k & (1 << bit) == 0 {
                        self.line(&mut lines, [corner(k), corner(k | (1 << bit))], [color[0], color[1], color[2], 0.9]);
                    }
                }
            }
        }
        lines
    }

    fn look_at(&self, eye: DVec3, direction: DVec3) -> Option<Finding> {
        let scene = &self.solved.solution.scene;
        let eye = scene.normalization.to_unit(eye);
        let direction = direction.as_vec3().try_normalize()?;
        let hit = scene.visibility.closest_except(eye, direction, START, f32::MAX, u32::MAX)?;
        Some(self.look(&hit, eye))
    }
}

/// Three channels as text.
fn three(v: Rgb) -> String {
    format!("{:.4} {:.4} {:.4}", v.x, v.y, v.z)
}

/// A light's hue at full brightness.
fn shade(light: Rgb, opacity: f32) -> [f32; 4] {
    let hue = light / light.max_element().max(f32::MIN_POSITIVE);
    [hue.x, hue.y, hue.z, opacity]
}

#[cfg(test)]
mod tests {
    use super::*;
    use hr_diffuse::Settings;
    use hr_scene::Scene;
    use std::ops::ControlFlow;
    use std::sync::Arc;

    fn solved(name: &str) -> Solved {
        let scene = Arc::new(Scene::load(name).expect("built in"));
        Solved::new(scene, Settings::with_error(0.3), true, &mut |_| ControlFlow::Continue(())).expect("sound")
    }

    #[test]
    fn a_point_of_a_glossy_sphere_shows_where_its_light_comes_from() {
        let solved = solved("glossy-sphere");
        let anatomy = Anatomy { solved: &solved, origin: DVec3::ZERO };
        let camera = solved.scene.default_camera();
        let [width, height] = [camera.width, camera.height].map(f64::from);
        // Somewhere down the middle of the picture there is the sphere.
        let down = (0..64).map(|y| camera.direction(0.5 * width, height * f64::from(y) / 64.0));
        let (finding, text, ahead) = down
            .filter_map(|ahead| anatomy.look_at(camera.eye.into(), ahead).map(|f| (f, ahead)))
            .map(|(finding, ahead)| (finding.clone(), finding.text.join("\n"), ahead))
            .find(|(_, text, _)| text.contains("basis functions"))
            .expect("a glossy sphere");
        for part in
            ["material", "irradiance", "radiosity", "glossy reflectance", "samples arrive", "links to the element"]
        {
            assert!(text.contains(part), "'{part}' is missing in\n{text}");
        }
        assert!(!finding.balloon.is_empty() && finding.balloon.len() % 3 == 0, "triangles");
        assert!(!finding.links.is_empty() && finding.links.len() % 2 == 0, "links");
        // All is in the scene or near it.
        let (low, high) = solved.scene.bounds().expect("surfaces");
        let margin = f64::from(REACH) / solved.solution.scene.normalization.scale();
        for mark in finding.lines.iter().chain(&finding.balloon) {
            let at = mark.at.as_dvec3();
            assert!(at.cmpge(low - margin).all() && at.cmple(high + margin).all(), "{at} is nowhere near the scene");
        }
        let away = anatomy.look_at(camera.eye.into(), -ahead);
        assert_eq!(away.map(|f| f.text), None, "there is nothing behind the camera");
    }

    #[test]
    fn links_account_for_the_irradiance() {
        let solved = solved("cornell");
        let anatomy = Anatomy { solved: &solved, origin: DVec3::ZERO };
        let solution = &solved.solution;
        let (mut told, mut is) = (Rgb::ZERO, Rgb::ZERO);
        for leaf in solution.elements.patch_leaves() {
            let area = solution.elements.nodes[leaf as usize].area;
            let path = anatomy.path(NodeId(leaf));
            told += area * anatomy.arrivals(&path).iter().map(|(_, _, light)| *light).sum::<Rgb>();
            is += area * solution.exitant.irradiance[leaf as usize];
        }
        // Links bring estimates of means; where a leaf's rows would exceed 1 the solver balances them. Within the error of
        // 0.3 that was asked for both are the same.
        let off = ((told - is) / is).abs().max_element();
        assert!(off < 0.2, "links bring {told}, irradiance is {is}");
    }

    #[test]
    fn boxes_and_outlines_are_those_of_the_tree() {
        let solved = solved("cornell");
        let anatomy = Anatomy { solved: &solved, origin: DVec3::ZERO };
        assert_eq!(anatomy.clusters(0).len(), 24, "twelve edges of the box that holds all");
        assert!(anatomy.clusters(1).len() >= 24, "and boxes in it");
        assert!(anatomy.clusters(99).is_empty(), "none so deep");
        let leaves = solved.solution.elements.patch_leaves().count();
        assert!(anatomy.elements().len() >= 6 * leaves, "three edges at least of each of {leaves}");
    }
}

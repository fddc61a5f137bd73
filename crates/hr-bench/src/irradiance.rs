//! How far the light on surfaces is from reference values that are means over triangles.
//!
//! The reference is a CSV file, one triangle a line, with the columns `object`, `mesh`, `triangle`, `area`, `cx`, `cy`,
//! `cz` (its middle), `E_r`, `E_g`, `E_b` (irradiance of its front), `se_r`, … (standard error of that) and `B_r`, …
//! (radiosity), in W/m² and metres or in whatever units the scene has. n² successive lines of the same triangle of the
//! same mesh are its n × n equal parts, row by row.
//!
//! Of the leaves, every one counts by the area that it has in common with the triangle, to rounding: nothing is sampled.

use crate::BenchError;
use glam::{DVec2, DVec3, dvec2};
use hr_diffuse::{Geometry, NodeId, Rgb, Solution};
use std::path::Path;

/// Surfaces lie in a triangle's plane when they are less than this away from it: lengths in unit space, and the sine of
/// the angle. What rounding to seven digits in the file and to f32 explains.
const SAME_PLANE: f64 = 2e-5;
/// Middles and areas agree to this share of the triangle's size.
const SAME_PLACE: f64 = 1e-3;
/// A triangle of which less than this share is found on surfaces is left out.
const LEAST_FOUND: f64 = 0.99;

/// A triangle of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Corners, counter-clockwise seen from its front; known only of parts of larger triangles.
    pub corners: Option<[DVec3; 3]>,
    /// Its middle.
    pub middle: DVec3,
    /// Its area.
    pub area: f64,
    /// Mean irradiance.
    pub irradiance: DVec3,
    /// Standard error of it.
    pub sigma: DVec3,
    /// Mean radiosity.
    pub radiosity: DVec3,
}

/// Distances from a reference, all relative to its total.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Σ area |B − B'| / Σ area B', emitters left out.
    pub radiosity: f64,
    /// The same for the irradiance of all surfaces that reflect.
    pub irradiance: f64,
    /// As `radiosity`, with values at vertices interpolated within the leaves: what is shown.
    pub shown: f64,
    /// Too bright (> 0) or too dark on the whole: Σ area B / Σ area B' − 1.
    pub bias: f64,
    /// What `radiosity` would be of a perfect solution because of the reference's own noise.
    pub noise: f64,
    /// Triangles compared.
    pub compared: usize,
    /// Triangles that are not on the scene's surfaces.
    pub missing: usize,
}

/// Reads a reference.
///
/// # Errors
/// [`BenchError::Read`] and [`BenchError::Format`].
pub fn read(path: &Path) -> Result<Vec<Triangle>, BenchError> {
    let text = std::fs::read_to_string(path).map_err(|source| BenchError::Read { path: path.to_owned(), source })?;
    parse(&text).map_err(|what| BenchError::Format {
        path: path.to_owned(),
        what,
        mend: "the columns are object, mesh, triangle, area, cx, cy, cz, E_r, E_g, E_b, se_r, se_g, se_b, B_r, B_g, B_b",
    })
}

fn parse(text: &str) -> Result<Vec<Triangle>, String> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let column = |name: &str| header.iter().position(|&h| h == name).ok_or(format!("there is no column {name}"));
    let columns = |names: [&str; 3]| -> Result<[usize; 3], String> {
        Ok([column(names[0])?, column(names[1])?, column(names[2])?])
    };
    let (keys, area) = (columns(["object", "mesh", "triangle"])?, column("area")?);
    let places = [["cx", "cy", "cz"], ["E_r", "E_g", "E_b"], ["se_r", "se_g", "se_b"], ["B_r", "B_g", "B_b"]];
    let [middle, irradiance, sigma, radiosity] = places.map(columns);
    let (middle, irradiance, sigma, radiosity) = (middle?, irradiance?, sigma?, radiosity?);
    let mut groups: Vec<(String, Vec<Triangle>)> = Vec::new();
    for (i, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let number = |column: usize| -> Result<f64, String> {
            let field = *fields.get(column).ok_or(format!("line {} is too short", i + 2))?;
            let number = field.parse::<f64>().ok().filter(|v| v.is_finite());
            number.ok_or(format!("'{field}' in line {} is no number", i + 2))
        };
        let vector = |at: [usize; 3]| -> Result<DVec3, String> {
            Ok(DVec3::new(number(at[0])?, number(at[1])?, number(at[2])?))
        };
        let triangle = Triangle {
            corners: None,
            middle: vector(middle)?,
            area: number(area)?,
            irradiance: vector(irradiance)?,
            sigma: vector(sigma)?,
            radiosity: vector(radiosity)?,
        };
        let key = keys.map(|key| fields.get(key).copied().unwrap_or_default()).join(",");
        match groups.last_mut() {
            Some((last, members)) if *last == key => members.push(triangle),
            _ => groups.push((key, vec![triangle])),
        }
    }
    for (key, group) in &mut groups {
        place_parts(group).ok_or(format!("the parts of triangle {key} are not its n × n equal ones, row by row"))?;
    }
    Ok(groups.into_iter().flat_map(|(_, group)| group).collect())
}

/// Finds the corners of the n × n equal parts of a triangle from their middles. Row by row from corner a: part (i, j)
/// has the corner p = a + i u + j v and then p + u, p + v, and but for the last of a row, the other half of the
/// parallelogram follows.
fn place_parts(group: &mut [Triangle]) -> Option<()> {
    let n = group.len().isqrt();
    if n * n != group.len() {
        return None;
    }
    if n == 1 {
        return Some(());
    }
    let (first, end_v, end_u) = (group[0].middle, group[2 * (n - 1)].middle, group[group.len() - 1].middle);
    let (u, v) = ((end_u - first) / (n - 1) as f64, (end_v - first) / (n - 1) as f64);
    let a = first - (u + v) / 3.0;
    let mut parts = group.iter_mut();
    for i in 0..n {
        for j in 0..n - i {
            let p = a + i as f64 * u + j as f64 * v;
            let halves = [[p, p + u, p + v], [p + u + v, p + v, p + u]];
            let count = if i + j + 1 < n { 2 } else { 1 };
            for corners in &halves[..count] {
                let part = parts.next()?;
                if !agrees(part, corners) {
                    return None;
                }
                part.corners = Some(*corners);
            }
        }
    }
    Some(())
}

/// Whether a triangle has these corners, by middle and area.
fn agrees(triangle: &Triangle, corners: &[DVec3; 3]) -> bool {
    let area = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    (area - triangle.area).abs() <= SAME_PLACE * triangle.area
        && middle.distance(triangle.middle) <= SAME_PLACE * triangle.area.sqrt()
}

/// Light on a triangle, summed over area.
#[derive(Clone, Copy, Default)]
struct Found {
    area: f64,
    radiosity: DVec3,
    shown: DVec3,
    irradiance: DVec3,
    emitted: bool,
    reflects: bool,
}

/// Compares a solution with a reference.
///
/// # Errors
/// [`BenchError::Compare`] where no triangle of the reference is on the scene's surfaces.
pub fn compare(solution: &Solution, reference: &[Triangle]) -> Result<Agreement, BenchError> {
    let mut agreement = Agreement::default();
    let (mut total, mut ours, mut irradiance_total) = (0.0, 0.0, 0.0);
    for triangle in reference {
        let Some(found) = find(solution, triangle) else {
            agreement.missing += 1;
            continue;
        };
        agreement.compared += 1;
        let sum = |v: DVec3| triangle.area * v.element_sum();
        if found.reflects {
            agreement.irradiance += sum((found.irradiance / found.area - triangle.irradiance).abs());
            irradiance_total += sum(triangle.irradiance);
        }
        if !found.emitted {
            let radiosity = found.radiosity / found.area;
            agreement.radiosity += sum((radiosity - triangle.radiosity).abs());
            agreement.shown += sum((found.shown / found.area - triangle.radiosity).abs());
            total += sum(triangle.radiosity);
            ours += sum(radiosity);
            // The mean of |x| for a normal distribution; radiosity is known from irradiance.
            let relative = triangle.sigma / triangle.irradiance.max(DVec3::splat(f64::MIN_POSITIVE));
            agreement.noise += sum(relative * triangle.radiosity) * std::f64::consts::FRAC_2_PI.sqrt();
        }
    }
    if total <= 0.0 || irradiance_total <= 0.0 {
        return Err(BenchError::Compare("no lit triangle of the reference is on the scene's surfaces".into()));
    }
    agreement.radiosity /= total;
    agreement.shown /= total;
    agreement.noise /= total;
    agreement.irradiance /= irradiance_total;
    agreement.bias = ours / total - 1.0;
    Ok(agreement)
}

/// The light on a triangle of the reference: on the surfaces that face as it does, or on all in its plane where they do
/// not fill it.
fn find(solution: &Solution, triangle: &Triangle) -> Option<Found> {
    let corners = triangle.corners.or_else(|| corners_on_surface(solution, triangle))?;
    let corners = corners.map(|p| solution.scene.normalization.to_unit(p).as_dvec3());
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let (area, normal) = (0.5 * normal.length(), normal.try_normalize()?);
    [true, false].into_iter().find_map(|fronts_only| {
        let found = overlap(solution, &corners, normal, fronts_only);
        (found.area >= LEAST_FOUND * area).then_some(found)
    })
}

/// The triangle among the scene's own, and the halves of its quadrilaterals, with that middle and area.
fn corners_on_surface(solution: &Solution, triangle: &Triangle) -> Option<[DVec3; 3]> {
    let scene = |p: glam::Vec3| solution.scene.normalization.to_scene(p);
    let mut surfaces = solution.scene.surfaces().iter();
    surfaces.find_map(|geometry| {
        let (points, halves): (Vec<DVec3>, &[[usize; 3]]) = match geometry {
            Geometry::Triangle(t) => (t.points().map(scene).to_vec(), &[[0, 1, 2]]),
            Geometry::Quad(q) => (q.points().map(scene).to_vec(), &[[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]),
            Geometry::Revolution(_) => return None,
        };
        let mut corners = halves.iter().map(|half| half.map(|i| points[i])).find(|c| agrees(triangle, c))?;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        if normal.dot(geometry.normal(glam::Vec2::splat(0.25)).as_dvec3()) < 0.0 {
            corners.swap(1, 2);
        }
        Some(corners)
    })
}

/// Sums the light over all parts of surfaces that lie on a triangle (unit space).
fn overlap(solution: &Solution, corners: &[DVec3; 3], normal: DVec3, fronts_only: bool) -> Found {
    let mut found = Found::default();
    let along = (corners[1] - corners[0]).normalize();
    let across = normal.cross(along);
    let flat = |p: DVec3| dvec2((p - corners[0]).dot(along), (p - corners[0]).dot(across));
    let outline = corners.map(flat);
    for (surface, geometry) in solution.scene.surfaces().iter().enumerate() {
        if matches!(geometry, Geometry::Revolution(_)) {
            continue;
        }
        let surface_normal = geometry.normal(glam::Vec2::splat(0.25)).as_dvec3();
        let off = (geometry.point(glam::Vec2::splat(0.25)).as_dvec3() - corners[0]).dot(normal);
        let facing = surface_normal.dot(normal);
        if surface_normal.cross(normal).length() > SAME_PLANE.sqrt() || off.abs() > SAME_PLANE {
            continue;
        }
        let back = facing < 0.0;
        if back && fronts_only {
            continue;
        }
        let material = &solution.scene.materials[solution.scene.surface_materials[surface] as usize];
        let mut part = |domain, leaf: Option<NodeId>| {
            let on: Vec<DVec2> =
                geometry.corners(domain).iter().map(|&uv| flat(geometry.point(uv).as_dvec3())).collect();
            let common = clipped(on, &outline);
            let (area, middle) = area_and_middle(&common);
            if area <= 0.0 {
                return;
            }
            found.area += area;
            found.emitted |= material.exitance != Rgb::ZERO && !back;
            found.reflects |= material.reflectance != Rgb::ZERO || solution.scene.texture.is_some();
            if let Some(leaf) = leaf {
                let point = corners[0] + along * middle.x + across * middle.y;
                let shown = solution.irradiance(leaf, geometry.parameters_of(point.as_vec3()));
                let reflectance = solution.elements.nodes[leaf.index()].reflectance;
                // What something covers is dark in the reference; a leaf's light is that of the rest of it.
                let open = area * f64::from(solution.elements.exposed(leaf.0));
                found.radiosity += open * solution.exitant.radiosity[leaf.index()].as_dvec3();
                found.irradiance += open * solution.exitant.irradiance[leaf.index()].as_dvec3();
                found.shown += open * (reflectance * shown).as_dvec3();
            }
        };
        let mut pending = vec![solution.elements.surface_nodes[surface][usize::from(back)]];
        while let Some(node) = pending.pop() {
            // No element: no light reaches that side.
            let Some(element) = solution.elements.nodes.get(node as usize) else {
                part(hr_diffuse::Domain::WHOLE, None);
                continue;
            };
            if element.child_count == 0 {
                part(element.domain, Some(NodeId(node)));
            }
            pending.extend(element.first_child..element.first_child + element.child_count);
        }
    }
    found
}

/// The part of a convex polygon within a counter-clockwise triangle (Sutherland and Hodgman).
fn clipped(mut polygon: Vec<DVec2>, triangle: &[DVec2; 3]) -> Vec<DVec2> {
    for i in 0..3 {
        let (from, to) = (triangle[i], triangle[(i + 1) % 3]);
        let inside = |p: DVec2| (to - from).perp_dot(p - from);
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (k, &p) in polygon.iter().enumerate() {
            let q = polygon[(k + 1) % polygon.len()];
            let (dp, dq) = (inside(p), inside(q));
            if dp >= 0.0 {
                kept.push(p);
            }
            if (dp < 0.0) != (dq < 0.0) {
                kept.push(p + (q - p) * (dp / (dp - dq)));
            }
        }
        polygon = kept;
    }
    polygon
}

/// Of a convex polygon with its corners in either order.
fn area_and_middle(polygon: &[DVec2]) -> (f64, DVec2) {
    let (mut area, mut moment) = (0.0, DVec2::ZERO);
    for pair in polygon.windows(2).skip(1) {
        let twice = (pair[0] - polygon[0]).perp_dot(pair[1] - polygon[0]);
        area += 0.5 * twice;
        moment += 0.5 * twice * (polygon[0] + pair[0] + pair[1]) / 3.0;
    }
    (area.abs(), if area == 0.0 { DVec2::ZERO } else { moment / area })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::{Extent, solve};

    const HEADER: &str = "object,mesh,triangle,material,area,cx,cy,cz,E_r,E_g,E_b,se_r,se_g,se_b,B_r,B_g,B_b\n";

    fn line(name: &str, corners: [DVec3; 3], irradiance: f64, radiosity: f64) -> String {
        let m = (corners[0] + corners[1] + corners[2]) / 3.0;
        let area = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        let (e, b) = (irradiance, radiosity);
        format!("{name},0,0,m,{area},{},{},{},{e},{e},{e},1,1,1,{b},{b},{b}\n", m.x, m.y, m.z)
    }

    #[test]
    fn parts_get_their_corners_back() {
        let (a, u, v) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.5, 0.0, 0.1), DVec3::new(0.0, 0.7, 0.0));
        let part = |i: f64, j: f64| a + i * u + j * v;
        let mut text = HEADER.to_owned();
        text += &line("whole", [a, a + u, a + v], 1.0, 0.5);
        let parts = [
            [part(0.0, 0.0), part(1.0, 0.0), part(0.0, 1.0)],
            [part(1.0, 1.0), part(0.0, 1.0), part(1.0, 0.0)],
            [part(0.0, 1.0), part(1.0, 1.0), part(0.0, 2.0)],
            [part(1.0, 0.0), part(2.0, 0.0), part(1.0, 1.0)],
        ];
        for corners in parts {
            text += &line("cut", corners, 1.0, 0.5);
        }
        let read = parse(&text).expect("sound");
        assert_eq!(read[0].corners, None, "a whole one");
        for (found, corners) in read[1..].iter().zip(parts) {
            let found = found.corners.expect("a part");
            assert!((0..3).all(|i| found[i].distance(corners[i]) < 1e-12), "{found:?}, made as {corners:?}");
        }
        let swapped: Vec<&str> = text.lines().collect();
        let swapped = [swapped[0], swapped[2], swapped[4], swapped[3], swapped[5]].join("\n");
        for (wrong, why) in
            [("area,E\n1,2\n", "no column object"), (&swapped, "cut,0,0"), (&format!("{HEADER}a,0,0,m,1,x,0,0"), "'x'")]
        {
            let error = parse(wrong).expect_err(why);
            assert!(error.contains(why), "{error}, not {why}");
        }
    }

    #[test]
    fn polygons_are_cut() {
        let triangle = [dvec2(0.0, 0.0), dvec2(2.0, 0.0), dvec2(0.0, 2.0)];
        let square = |x: f64, y: f64| vec![dvec2(x, y), dvec2(x, y + 1.0), dvec2(x + 1.0, y + 1.0), dvec2(x + 1.0, y)];
        for (x, y, area) in [(0.0, 0.0, 1.0), (1.0, 0.0, 0.5), (-0.5, -0.5, 0.25), (1.5, 1.5, 0.0), (0.5, 0.5, 0.5)] {
            let (found, middle) = area_and_middle(&clipped(square(x, y), &triangle));
            assert!((found - area).abs() < 1e-12, "square at {x}, {y}: {found}, by hand {area}");
            assert!(area == 0.0 || middle.min_element() > 0.0 && middle.element_sum() < 2.0, "inside: {middle}");
        }
    }

    #[test]
    fn a_solution_agrees_with_itself() {
        let quad = |corners: [[f64; 3]; 4], material| {
            hr_diffuse::Surface::new(hr_diffuse::Shape::Quad(corners.map(DVec3::from)), material)
        };
        let floor = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 2.0, 0.0], [0.0, 2.0, 0.0]];
        let lamp = [[1.0, 1.0, 1.0], [1.0, 1.5, 1.0], [1.5, 1.5, 1.0], [1.5, 1.0, 1.0]];
        let material = |reflectance, exitance| hr_diffuse::DiffuseMaterial {
            reflectance: Rgb::splat(reflectance),
            exitance: Rgb::splat(exitance),
            two_sided: false,
        };
        let input = hr_diffuse::SceneInput {
            surfaces: vec![quad(floor, 0), quad(lamp, 1)],
            materials: vec![material(0.5, 0.0), material(0.0, 10.0)],
            ..Default::default()
        };
        let (solution, cost) = solve(&input, 0.05, 1, Extent::FULL).expect("sound");
        assert!(cost.leaves > 8, "there is something to add up: {cost:?}");
        let [a, b, c, d] = floor.map(DVec3::from);
        let [e, f, g, _] = lamp.map(DVec3::from);
        let text = [HEADER, &line("a", [a, b, c], 1.0, 1.0), &line("b", [d, a, c], 1.0, 1.0)].concat();
        let mut reference = parse(&(text + &line("c", [e, f, g], 1.0, 10.0))).expect("sound");
        for half in &mut reference[..2] {
            let found = find(&solution, half).expect("half of the floor");
            let scale = solution.scene.normalization.scale();
            assert!((found.area / scale.powi(2) - 3.0).abs() < 1e-5, "half of the floor: {} m²", found.area);
            (half.irradiance, half.radiosity) = (found.irradiance / found.area, found.radiosity / found.area);
            half.sigma = 0.1 * half.irradiance;
        }
        let node = solution.elements.surface_nodes[0][0] as usize;
        let mean = 0.5 * (reference[0].irradiance + reference[1].irradiance);
        let whole = solution.exitant.irradiance[node].as_dvec3();
        assert!((mean / whole - DVec3::ONE).abs().max_element() < 1e-5, "{mean}, the floor as a whole {whole}");
        let same = compare(&solution, &reference).expect("two halves and a lamp");
        assert!(same.radiosity < 1e-12 && same.irradiance < 1e-12 && same.shown < 0.2, "nothing is off: {same:?}");
        assert!((same.noise - 0.0798).abs() < 1e-3, "a tenth times √(2/π): {same:?}");
        assert_eq!((same.compared, same.missing), (3, 0), "all are there");
        reference[1].middle.z += 0.1;
        reference[0].radiosity *= 2.0;
        let half = compare(&solution, &reference).expect("half of the floor and a lamp");
        assert!((half.radiosity - 0.5).abs() < 1e-9 && (half.bias + 0.5).abs() < 1e-9, "twice the light: {half:?}");
        assert_eq!(half.missing, 1, "one is not on the floor any more");
    }
}

//! Light in images: a rectangle of texels for each side of each surface.

use super::even_radiance;
use super::glb::Glb;
use crate::solved::Solved;
use crate::window::Tone;
use glam::{DVec3, Vec2, Vec3};
use hr_diffuse::sampling::{hash, unit};
use hr_diffuse::{Domain, Geometry, Rgb};
use hr_scene::Image;
use hr_scene::tonemap::srgb_transfer;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use serde_json::json;

/// Images are no wider and no higher than this.
const MOST_SIDE: u32 = 2048;
/// Texels are at least so large, as a share of the scene's size.
const FINEST: f32 = 1.0 / 1024.0;
/// Larger texels are tried by this factor until all rectangles fit.
const COARSER: f32 = 1.2;
/// Copies of the border around each rectangle.
const MARGIN: u32 = 2;
/// Round surfaces are cut until chords leave them by less than this share of the scene's size, or into so many.
const ROUND: f32 = 3e-4;
const MOST_CELLS: u32 = 64;
/// Tells the numbers of one use of a hash from those of others.
const DITHER: u32 = 0x51ed;
/// So many of all texels may be brighter than white in the image of the irradiance.
const BRIGHTER: f32 = 1e-3;

/// A side of a surface, and the rectangle of its texels.
pub(super) struct Chart {
    pub(super) surface: u32,
    pub(super) back: bool,
    /// Lengths of its middle lines in u and v, unit space.
    lengths: [f32; 2],
    /// Texels along u and v, without margins.
    size: [u32; 2],
    /// The first one in the image, without margins.
    first: [u32; 2],
}

/// Adds images and mesh; none of a scene where nothing is shown.
pub(super) fn add(file: &mut Glb, solved: &Solved, origin: DVec3, tone: &Tone) -> Option<usize> {
    let mut charts = charts(solved);
    let size = pack(&mut charts)?;
    let [radiance, irradiance] = bake(solved, &charts, size);
    let to_709 = |light: &Rgb| tone.to_srgb * *light;
    let white = white(&irradiance);
    let shown = png8(size, radiance.iter().map(|light| to_709(light) * tone.exposure));
    let arriving = png16(size, irradiance.iter().map(|light| to_709(light) / white));
    let shown = file.texture("radiance", &shown);
    let arriving = file.texture("irradiance", &arriving);
    let extras = json!({
        "exposure": tone.exposure,
        "irradiance": { "index": arriving, "texCoord": 1, "white": white },
    });
    let material = file.unlit("lightmap", Some(shown), &extras);
    let mesh = mesh(solved, &charts, size, origin);
    let coordinates = || mesh.coordinates.iter().map(|uv| uv.to_array());
    let attributes = json!({
        "POSITION": file.vectors(mesh.positions.iter().copied()),
        "NORMAL": file.vectors(mesh.normals.iter().copied()),
        // The first set must be there for the second to be; nothing else is in it.
        "TEXCOORD_0": file.attribute(coordinates(), "VEC2"),
        "TEXCOORD_1": file.attribute(coordinates(), "VEC2"),
    });
    let indices = file.indices(&mesh.indices);
    let primitive = json!({ "attributes": attributes, "indices": indices, "material": material });
    Some(file.mesh("lightmap", &[primitive], &json!({})))
}

/// The radiance of all texels as a picture, in the scene's primaries; one black pixel of a scene where nothing is shown.
pub(super) fn image(solved: &Solved) -> Image {
    let mut charts = charts(solved);
    let Some([width, height]) = pack(&mut charts) else { return Image::new(1, 1) };
    let [pixels, _] = bake(solved, &charts, [width, height]);
    Image { width, height, pixels }
}

/// All sides that do anything with light, each surface once.
pub(super) fn charts(solved: &Solved) -> Vec<Chart> {
    let (solution, scene) = (&solved.solution, &solved.solution.scene);
    let mut charts = Vec::new();
    for (surface, geometry) in scene.surfaces().iter().enumerate() {
        for back in [false, true] {
            let node = solution.elements.surface_nodes[surface][usize::from(back)];
            if node == u32::MAX || scene.twins[surface] != surface as u32 {
                continue;
            }
            let lengths = [length(geometry, |t| Vec2::new(t, 0.5)), length(geometry, |t| Vec2::new(0.5, t))];
            let lengths = if is_triangle(geometry) {
                // Their sides, for two that share one to agree.
                [length(geometry, |t| Vec2::new(t, 0.0)), length(geometry, |t| Vec2::new(0.0, t))]
            } else {
                lengths
            };
            charts.push(Chart { surface: surface as u32, back, lengths, size: [0; 2], first: [0; 2] });
        }
    }
    charts
}

pub(super) fn is_triangle(geometry: &Geometry) -> bool {
    matches!(geometry, Geometry::Triangle(_))
}

/// Length of a line on a surface, unit space.
fn length(geometry: &Geometry, line: impl Fn(f32) -> Vec2) -> f32 {
    const STEPS: u32 = 16;
    let at = |i: u32| geometry.point(line(i as f32 / STEPS as f32));
    (0..STEPS).map(|i| at(i).distance(at(i + 1))).sum()
}

/// Gives each chart its place, texels as fine as fit. Returns the image's size, if there is any chart.
pub(super) fn pack(charts: &mut [Chart]) -> Option<[u32; 2]> {
    if charts.is_empty() {
        return None;
    }
    let mut texel = FINEST;
    loop {
        for chart in &mut *charts {
            chart.size = chart.lengths.map(|length| ((length / texel).ceil() as u32 + 1).clamp(2, MOST_SIDE / 2));
        }
        let least = charts.iter().all(|chart| chart.size == [2, 2]);
        let most = if least { u32::MAX } else { MOST_SIDE };
        if let Some(size) = rows(charts, most) {
            return Some(size);
        }
        texel *= COARSER;
    }
}

/// Places charts in rows, the highest first. Returns the image's size unless it is higher than `most`.
fn rows(charts: &mut [Chart], most: u32) -> Option<[u32; 2]> {
    let outer = |chart: &Chart| chart.size.map(|side| side + 2 * MARGIN);
    let area: f64 = charts.iter().map(|chart| outer(chart).map(f64::from).iter().product::<f64>()).sum();
    let widest = charts.iter().map(|chart| outer(chart)[0]).max().unwrap_or(1);
    let width = (area.sqrt() as u32).clamp(1, MOST_SIDE).max(widest).next_multiple_of(4);
    let mut order: Vec<usize> = (0..charts.len()).collect();
    order.sort_by_key(|&chart| std::cmp::Reverse(charts[chart].size[1]));
    let ([mut x, mut y], mut height) = ([0, 0], 0);
    for chart in order {
        let [across, up] = outer(&charts[chart]);
        if x + across > width {
            (x, y, height) = (0, y + height, 0);
        }
        if height == 0 {
            height = up;
        }
        charts[chart].first = [x + MARGIN, y + MARGIN];
        x += across;
    }
    let height = (y + height).next_multiple_of(4);
    (height <= most).then_some([width, height])
}

impl Chart {
    /// All texels, those of the margin among them.
    pub(super) fn texels(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let range = |axis: usize| self.first[axis] - MARGIN..self.first[axis] + self.size[axis] + MARGIN;
        let (columns, rows) = (range(0), range(1));
        rows.flat_map(move |y| columns.clone().map(move |x| [x, y]))
    }

    /// Parameters of the surface at a texel, or at the nearest one inside; its border is in the middle of the outermost ones.
    fn parameters(&self, geometry: &Geometry, at: [u32; 2]) -> Vec2 {
        let along = |axis: usize| {
            let last = self.size[axis] - 1;
            at[axis].saturating_sub(self.first[axis]).min(last) as f32 / last as f32
        };
        let uv = Vec2::new(along(0), along(1));
        let beyond = uv.element_sum() - 1.0;
        if is_triangle(geometry) && beyond > 0.0 { (uv - 0.5 * beyond).clamp(Vec2::ZERO, Vec2::ONE) } else { uv }
    }

    /// Texture coordinates of a place of the surface.
    pub(super) fn coordinates(&self, uv: Vec2, [width, height]: [u32; 2]) -> Vec2 {
        let along = |at: f32, axis: usize| self.first[axis] as f32 + 0.5 + at * (self.size[axis] - 1) as f32;
        Vec2::new(along(uv.x, 0) / width as f32, along(uv.y, 1) / height as f32)
    }
}

/// Radiance and irradiance of all texels.
pub(super) fn bake(solved: &Solved, charts: &[Chart], [width, height]: [u32; 2]) -> [Vec<Rgb>; 2] {
    let count = width as usize * height as usize;
    let mut images = [vec![Rgb::ZERO; count], vec![Rgb::ZERO; count]];
    let texels = |chart: &Chart| {
        let geometry = &solved.solution.scene.surfaces()[chart.surface as usize];
        let light = |at: [u32; 2]| light(solved, chart, chart.parameters(geometry, at));
        chart.texels().map(light).collect::<Vec<_>>()
    };
    let baked: Vec<Vec<_>> = charts.par_iter().map(texels).collect();
    for (chart, texels) in charts.iter().zip(baked) {
        for ([x, y], [radiance, irradiance]) in chart.texels().zip(texels) {
            let at = y as usize * width as usize + x as usize;
            images[0][at] = radiance;
            images[1][at] = irradiance;
        }
    }
    images
}

/// Radiance and irradiance at a place of a chart's surface.
fn light(solved: &Solved, chart: &Chart, uv: Vec2) -> [Rgb; 2] {
    let (scene, solution) = (&solved.scene, &solved.solution);
    let leaf = solution.elements.leaf_at(&solution.scene, chart.surface, chart.back, uv);
    let irradiance = leaf.map_or(Rgb::ZERO, |leaf| solution.irradiance(leaf, uv));
    let material = scene.surfaces[chart.surface as usize].material;
    let diffuse = match scene.base_color(chart.surface, uv.x, uv.y) {
        Some(color) => scene.diffuse_of(chart.surface, color),
        None => scene.materials[material as usize].reflector.diffuse(),
    };
    [even_radiance(solved, material, diffuse, irradiance, !chart.back), irradiance]
}

/// What white stands for, so that few texels are brighter.
fn white(light: &[Rgb]) -> f32 {
    let mut lit: Vec<f32> = light.iter().map(|light| light.max_element()).filter(|light| *light > 0.0).collect();
    lit.sort_by(f32::total_cmp);
    let at = ((1.0 - BRIGHTER) * lit.len() as f32) as usize;
    lit.get(at.min(lit.len().saturating_sub(1))).copied().unwrap_or(1.0)
}

/// sRGB code of a linear value, 0…1.
fn encoded(x: f32) -> f64 {
    srgb_transfer(f64::from(x.clamp(0.0, 1.0)))
}

/// A PNG file of linear colours, 8-bit sRGB. Viewers show no more bits; so that slow gradients have no steps in them, what
/// lies between two codes is rounded up as often as it is near the upper one.
pub(super) fn png8(size: [u32; 2], colors: impl Iterator<Item = Vec3>) -> Vec<u8> {
    let texels = (0..).zip(colors);
    let codes = texels.flat_map(|(texel, color)| {
        let chance = f64::from(unit(hash(texel, DITHER)));
        // 255 and what rounding adds to it is 255.
        color.to_array().map(|x| (255.0 * encoded(x) + chance).floor() as u8)
    });
    png(size, &codes.collect::<Vec<u8>>(), ExtendedColorType::Rgb8)
}

/// The same, 16-bit, for programs that compute with it.
fn png16(size: [u32; 2], colors: impl Iterator<Item = Vec3>) -> Vec<u8> {
    let codes = colors.flat_map(|color| color.to_array().map(|x| (65_535.0 * encoded(x)).round() as u16));
    // The encoder takes the machine's byte order.
    png(size, bytemuck::cast_slice(&codes.collect::<Vec<u16>>()), ExtendedColorType::Rgb16)
}

fn png([width, height]: [u32; 2], bytes: &[u8], kind: ExtendedColorType) -> Vec<u8> {
    let mut png = Vec::new();
    let encoder = PngEncoder::new(&mut png);
    // Into memory, with as many bytes as there are texels: nothing can fail.
    let written = encoder.write_image(bytes, width, height, kind);
    debug_assert!(written.is_ok(), "a picture in memory: {written:?}");
    png
}

/// The surfaces, with a vertex of its own for each chart.
#[derive(Default)]
struct Mesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    coordinates: Vec<Vec2>,
    indices: Vec<u32>,
}

fn mesh(solved: &Solved, charts: &[Chart], size: [u32; 2], origin: DVec3) -> Mesh {
    let scene = &solved.solution.scene;
    let mut mesh = Mesh::default();
    for chart in charts {
        let geometry = &scene.surfaces()[chart.surface as usize];
        let side = if chart.back { -1.0 } else { 1.0 };
        let first = mesh.positions.len() as u32;
        let (places, triangles) = cut(geometry);
        for &uv in &places {
            mesh.positions.push((scene.normalization.to_scene(geometry.point(uv)) - origin).as_vec3());
            mesh.normals.push(scene.shading_normal(chart.surface, uv) * side);
            mesh.coordinates.push(chart.coordinates(uv, size));
        }
        for corners in triangles {
            let [p, q, r] = corners.map(|corner| geometry.point(places[corner as usize]));
            let middle = corners.map(|corner| places[corner as usize]).iter().sum::<Vec2>() / 3.0;
            let turn = (q - p).cross(r - p).dot(geometry.normal(middle) * side);
            let [a, b, c] = corners.map(|corner| first + corner);
            // Nothing is left of those at poles.
            if turn != 0.0 {
                mesh.indices.extend(if turn > 0.0 { [a, b, c] } else { [a, c, b] });
            }
        }
    }
    mesh
}

/// Places and triangles of a surface.
fn cut(geometry: &Geometry) -> (Vec<Vec2>, Vec<[u32; 3]>) {
    let corners = geometry.corners(Domain::WHOLE);
    if corners.len() == 3 {
        return (corners.to_vec(), vec![[0, 1, 2]]);
    }
    let [columns, rows] = cells(geometry);
    let place =
        |k: u32| Vec2::new((k % (columns + 1)) as f32 / columns as f32, (k / (columns + 1)) as f32 / rows as f32);
    let places = (0..(columns + 1) * (rows + 1)).map(place).collect();
    let cell = |k: u32| {
        let a = k / columns * (columns + 1) + k % columns;
        let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
        [[a, b, c], [a, c, d]]
    };
    (places, (0..columns * rows).flat_map(cell).collect())
}

/// How many cells a surface is cut into along u and v.
fn cells(geometry: &Geometry) -> [u32; 2] {
    let cells_along = |point: &dyn Fn(f32, f32) -> Vec3| {
        let mut cells = 1;
        while cells < MOST_CELLS {
            let bends = (0..=4).any(|line| {
                (0..cells).any(|cell| {
                    let at = |t: f32| point((cell as f32 + t) / cells as f32, line as f32 / 4.0);
                    at(0.5).distance(at(0.0).midpoint(at(1.0))) > ROUND
                })
            });
            // A full turn has its ends in one place, and needs three at least.
            let closed = cells < 4 && point(0.0, 0.5).distance(point(1.0, 0.5)) < ROUND;
            if !bends && !closed {
                break;
            }
            cells *= 2;
        }
        cells
    };
    [
        cells_along(&|t, line| geometry.point(Vec2::new(t, line))),
        cells_along(&|t, line| geometry.point(Vec2::new(line, t))),
    ]
}

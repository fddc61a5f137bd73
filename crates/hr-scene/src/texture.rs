//! Base colour textures and vertex colours: point samples for the eye, exact means over patches for the light.
//!
//! Between texel centres a texture is bilinear. The mean over a polygon is the exact integral of that function, by
//! Green's theorem: with F(x, y) = ∫₀ˣ f(s, y) ds the integral over the polygon is the contour integral ∮ F dy. F is
//! quadratic in x and linear in y inside a cell between four texel centres, so two Gauss points on each piece of an
//! edge inside a cell are exact, and running sums along each texel row give F without walking over the interior. The
//! cost grows with the perimeter in texels, not with the area, for small and large regions alike.

use crate::Scene;
use glam::{DVec2, DVec3, Mat3, Vec2};
use glossy_ext::Rgb;
use hr_diffuse::Shape;
use std::sync::{Arc, OnceLock};

/// Perimeter in texels above which a mean is estimated from [`ESTIMATE_SAMPLES`] samples: bounds one mean to some
/// ten milliseconds, however often a texture is repeated on one patch.
const MAX_PERIMETER: f64 = (1 << 18) as f64;

/// Perimeter in texels below which a texture is as good as linear, and the integral all rounding.
const MIN_PERIMETER: f64 = 1e-5;

/// Samples of an estimated mean. Quasi-random: an error of about 1/200 of the texture's contrast.
const ESTIMATE_SAMPLES: u32 = 1 << 14;

/// Steps per side when a texture is multiplied by colours that vary over the same patch.
const PRODUCT_STEPS: u32 = 8;

/// A base colour texture.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Linear RGB texels, row 0 first, shared among materials.
    pub texels: Arc<Texels>,
    /// Transform of texture coordinates (`KHR_texture_transform`), applied before wrapping.
    pub transform: Mat3,
    /// What happens outside 0…1 in u and v.
    pub wrap: [Wrap; 2],
}

/// Texels in linear RGB. Texture coordinate (0, 0) is the outer corner of the first texel of row 0, (1, 1) the
/// outer corner of the last texel of the last row.
#[derive(Clone, Debug)]
pub struct Texels {
    width: u32,
    height: u32,
    data: Vec<Rgb>,
    /// Running sums along each row, `width + 1` per row, made when first needed. Double precision: the mean over a
    /// part of a texel is a small difference of large sums.
    sums: OnceLock<Vec<DVec3>>,
}

/// What a texture does outside 0…1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Starts anew.
    #[default]
    Repeat,
    /// Starts anew, every second time mirrored.
    Mirror,
    /// Keeps the colour of the border.
    Clamp,
}

/// What varies over a surface beside its geometry, for textured or vertex-coloured surfaces only. Corners as in
/// the surface's shape; a triangle's fourth repeats its third.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceAttributes {
    /// Index of the surface in [`Scene::surfaces`].
    pub surface: u32,
    /// Texture coordinates at the corners.
    pub uv: [Vec2; 4],
    /// Linear vertex colours at the corners.
    pub color: [Rgb; 4],
}

impl PartialEq for Texels {
    fn eq(&self, other: &Self) -> bool {
        (self.width, self.height) == (other.width, other.height) && self.data == other.data
    }
}

impl Texels {
    /// Texels from `width · height` linear colours, row 0 first; `None` where the numbers do not fit or are 0.
    #[must_use]
    pub fn new(width: u32, height: u32, data: Vec<Rgb>) -> Option<Self> {
        let count = (width as usize).checked_mul(height as usize)?;
        (count > 0 && count == data.len()).then(|| Self { width, height, data, sums: OnceLock::new() })
    }

    /// Width in texels, ≥ 1.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in texels, ≥ 1.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Linear colours, row 0 first.
    #[must_use]
    pub fn data(&self) -> &[Rgb] {
        &self.data
    }

    /// Mean of all texels.
    #[must_use]
    pub fn mean(&self) -> Rgb {
        let sum: DVec3 = self.data.iter().map(|c| c.as_dvec3()).sum();
        (sum / self.data.len() as f64).as_vec3()
    }

    /// Half the size (rounded up), each new texel the mean of up to four.
    pub(crate) fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut data = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            let rows = [2 * y, (2 * y + 1).min(self.height - 1)];
            for x in 0..width {
                let columns = [2 * x, (2 * x + 1).min(self.width - 1)];
                let sum: Rgb = rows.iter().flat_map(|&j| columns.map(|i| self.row(j)[i as usize])).sum();
                data.push(sum * 0.25);
            }
        }
        Self { width, height, data, sums: OnceLock::new() }
    }

    fn row(&self, j: u32) -> &[Rgb] {
        let start = j as usize * self.width as usize;
        &self.data[start..start + self.width as usize]
    }

    /// Running sums of row `j`: entry i is the sum of the first i texels.
    fn row_sums(&self, j: u32) -> &[DVec3] {
        let sums = self.sums.get_or_init(|| {
            let mut sums = Vec::with_capacity((self.width as usize + 1) * self.height as usize);
            for j in 0..self.height {
                let mut sum = DVec3::ZERO;
                sums.push(sum);
                sums.extend(self.row(j).iter().map(|c| {
                    sum += c.as_dvec3();
                    sum
                }));
            }
            sums
        });
        let start = j as usize * (self.width as usize + 1);
        &sums[start..=start + self.width as usize]
    }
}

impl Wrap {
    /// The texel that stands at position `i` of an endless row of which `n` texels are given.
    fn index(self, i: i64, n: u32) -> u32 {
        let n = i64::from(n);
        let wrapped = match self {
            Self::Repeat => i.rem_euclid(n),
            Self::Mirror => {
                let i = i.rem_euclid(2 * n);
                i.min(2 * n - 1 - i)
            }
            Self::Clamp => i.clamp(0, n - 1),
        };
        wrapped as u32
    }

    /// Texels after which the endless row repeats itself; `None`: never.
    fn period(self, n: u32) -> Option<f64> {
        match self {
            Self::Repeat => Some(f64::from(n)),
            Self::Mirror => Some(2.0 * f64::from(n)),
            Self::Clamp => None,
        }
    }

    /// A position in texels moved to where the endless row looks alike and integers are safe to compute with.
    fn reduce(self, x: f64, n: u32) -> f64 {
        self.period(n).map_or_else(|| x.clamp(-1.0, f64::from(n)), |period| x.rem_euclid(period))
    }

    /// Sum of the texels 0…`i`−1 of the endless row, negative before 0, from the running sums of the given ones.
    fn sum(self, i: i64, sums: &[DVec3]) -> DVec3 {
        let n = sums.len() as i64 - 1;
        let total = sums[n as usize];
        match self {
            Self::Repeat => total * i.div_euclid(n) as f64 + sums[i.rem_euclid(n) as usize],
            Self::Mirror => {
                let rest = i.rem_euclid(2 * n);
                let part = if rest <= n { sums[rest as usize] } else { 2.0 * total - sums[(2 * n - rest) as usize] };
                2.0 * total * i.div_euclid(2 * n) as f64 + part
            }
            Self::Clamp if i < 0 => sums[1] * i as f64,
            Self::Clamp if i > n => total + (total - sums[n as usize - 1]) * (i - n) as f64,
            Self::Clamp => sums[i as usize],
        }
    }
}

impl Texture {
    /// A texture without a transform.
    #[must_use]
    pub fn new(texels: Arc<Texels>, wrap: [Wrap; 2]) -> Self {
        Self { texels, transform: Mat3::IDENTITY, wrap }
    }

    /// The linear colour at a texture coordinate: bilinear between texel centres, wrapped. Where a coordinate is
    /// not finite: the mean.
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> Rgb {
        let p = self.to_texels(uv);
        if p.is_finite() { self.bilinear(p) } else { self.mean() }
    }

    /// Mean over the whole texture.
    #[must_use]
    pub fn mean(&self) -> Rgb {
        self.texels.mean()
    }

    /// Mean over a triangle or convex quadrilateral of texture coordinates, in either sense of rotation.
    ///
    /// Exact for triangles and parallelograms (see the module's head), if the region's perimeter is below 2¹⁸ texels;
    /// beyond, and for regions without area, the mean of well spread samples. A quadrilateral that is no
    /// parallelogram counts as two triangles of equal weight. Fewer than three corners: the mean of the samples there.
    #[must_use]
    pub fn mean_over(&self, corners: &[Vec2]) -> Rgb {
        let points: Vec<DVec2> = corners.iter().map(|&uv| self.to_texels(uv)).collect();
        if points.is_empty() || !points.iter().all(|p| p.is_finite()) {
            return self.mean();
        }
        match points[..] {
            [a, b, c] => self.mean_over_polygon(&[a, b, c]),
            [a, b, c, d] => {
                let size = a.distance(c).max(b.distance(d));
                if (a + c - b - d).length() <= 1e-4 * size {
                    self.mean_over_polygon(&[a, b, c, d])
                } else {
                    0.5 * (self.mean_over_polygon(&[a, b, c]) + self.mean_over_polygon(&[a, c, d]))
                }
            }
            _ => points.iter().map(|&p| self.bilinear(p)).sum::<Rgb>() / points.len() as f32,
        }
    }

    /// Texture coordinates to texels, with the centre of the first texel at 0.
    fn to_texels(&self, uv: Vec2) -> DVec2 {
        let uv = self.transform.as_dmat3().transform_point2(uv.as_dvec2());
        uv * self.size() - 0.5
    }

    fn size(&self) -> DVec2 {
        DVec2::new(f64::from(self.texels.width), f64::from(self.texels.height))
    }

    fn bilinear(&self, p: DVec2) -> Rgb {
        let x = self.wrap[0].reduce(p.x, self.texels.width);
        let y = self.wrap[1].reduce(p.y, self.texels.height);
        let (i, j) = (x.floor(), y.floor());
        let (a, b) = ((x - i) as f32, (y - j) as f32);
        let (i, j) = (i as i64, j as i64);
        let along = |j: i64| {
            let row = self.texels.row(self.wrap[1].index(j, self.texels.height));
            let at = |i| row[self.wrap[0].index(i, self.texels.width) as usize];
            at(i).lerp(at(i + 1), a)
        };
        along(j).lerp(along(j + 1), b)
    }

    /// Mean over a triangle or parallelogram given in texels.
    fn mean_over_polygon(&self, points: &[DVec2]) -> Rgb {
        let edges = || points.iter().zip(points.iter().cycle().skip(1)).map(|(&a, &b)| (a, b));
        let perimeter: f64 = edges().map(|(a, b)| (b - a).abs().element_sum()).sum();
        // Taken about the first corner: exact enough however far from 0 the region lies.
        let area: f64 = 0.5 * edges().map(|(a, b)| (a - points[0]).perp_dot(b - points[0])).sum::<f64>();
        if !(MIN_PERIMETER..=MAX_PERIMETER).contains(&perimeter) || area.abs() < 1e-7 * perimeter * perimeter {
            return self.estimate(points, perimeter);
        }
        let shift = DVec2::new(
            self.wrap[0].period(self.texels.width).map_or(0.0, |n| (points[0].x / n).floor() * n),
            self.wrap[1].period(self.texels.height).map_or(0.0, |n| (points[0].y / n).floor() * n),
        );
        if (points[0] - shift).abs().max_element() > 1e9 {
            return self.estimate(points, perimeter);
        }
        let integral: DVec3 = edges().map(|(a, b)| self.contour(a - shift, b - shift)).sum();
        (integral / area).as_vec3().max(Rgb::ZERO)
    }

    /// ∫ F dy along an edge.
    fn contour(&self, a: DVec2, b: DVec2) -> DVec3 {
        let d = b - a;
        if d.y == 0.0 {
            return DVec3::ZERO;
        }
        let mut next = [Crossings::new(a.x, d.x), Crossings::new(a.y, d.y)];
        let mut sum = DVec3::ZERO;
        let mut from = 0.0;
        while from < 1.0 {
            let to = next[0].t.min(next[1].t).clamp(from, 1.0);
            if to > from {
                sum += self.piece(a, d, from, to);
            }
            next.iter_mut().filter(|n| n.t <= to).for_each(Crossings::advance);
            from = to;
        }
        sum
    }

    /// ∫ F dy along the part `from`…`to` of the line a + t d, which lies in one cell.
    fn piece(&self, a: DVec2, d: DVec2, from: f64, to: f64) -> DVec3 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let cell = (a + d * middle).floor();
        let (i, j) = (cell.x as i64, cell.y as i64);
        let rows = [j, j + 1].map(|j| {
            let j = self.wrap[1].index(j, self.texels.height);
            let row = self.texels.row(j);
            let at = |i| row[self.wrap[0].index(i, self.texels.width) as usize].as_dvec3();
            // ∫ from texel 0 to texel i of a piecewise linear function is the sum of the texels before i plus
            // half of texel i less half of texel 0. The latter depends on y only: it cancels around a contour.
            (self.wrap[0].sum(i, self.texels.row_sums(j)) + 0.5 * at(i), at(i), at(i + 1))
        });
        let value = |t: f64| {
            let p = a + d * t - cell;
            let [lower, upper] = rows.map(|(sum, f0, f1)| sum + p.x * f0 + 0.5 * p.x * p.x * (f1 - f0));
            lower.lerp(upper, p.y)
        };
        let gauss = half / 3.0_f64.sqrt();
        (value(middle - gauss) + value(middle + gauss)) * (half * d.y)
    }

    /// Mean of samples that are spread evenly over a triangle or parallelogram.
    fn estimate(&self, points: &[DVec2], perimeter: f64) -> Rgb {
        let count = (4.0 * perimeter).clamp(16.0, f64::from(ESTIMATE_SAMPLES)) as u32;
        let (origin, du, dv) = match *points {
            [a, b, c] => (a, b - a, c - a),
            [a, b, _, d] => (a, b - a, d - a),
            _ => return self.mean(),
        };
        let sum: DVec3 = (0..count)
            .map(|k| {
                // The additive recurrence with the plastic number, the plane's counterpart of the golden ratio.
                let k = f64::from(k);
                let mut s = DVec2::new(
                    (0.5 + k * 0.754_877_666_246_692_8).fract(),
                    (0.5 + k * 0.569_840_290_998_053_3).fract(),
                );
                if points.len() == 3 && s.x + s.y > 1.0 {
                    s = 1.0 - s;
                }
                self.bilinear(origin + du * s.x + dv * s.y).as_dvec3()
            })
            .sum();
        (sum / f64::from(count)).as_vec3()
    }
}

/// Where a coordinate a + t d passes integers, in the order of t.
struct Crossings {
    start: f64,
    slope: f64,
    next: f64,
    t: f64,
}

impl Crossings {
    fn new(start: f64, slope: f64) -> Self {
        let next = if slope > 0.0 { start.floor() + 1.0 } else { start.ceil() - 1.0 };
        let mut this = Self { start, slope, next, t: 0.0 };
        this.update();
        this
    }

    fn update(&mut self) {
        self.t = if self.slope == 0.0 { f64::INFINITY } else { (self.next - self.start) / self.slope };
    }

    fn advance(&mut self) {
        self.next += self.slope.signum();
        self.update();
    }
}

impl SurfaceAttributes {
    /// Texture coordinates at (u, v): on a triangle linear in P = p₀(1−u−v) + p₁u + p₂v, else bilinear with the
    /// corners at (0,0), (1,0), (1,1), (0,1).
    #[must_use]
    pub fn uv_at(&self, shape: &Shape, u: f32, v: f32) -> Vec2 {
        let w = corner_weights(shape, u, v);
        (0..4).map(|i| self.uv[i] * w[i]).sum()
    }

    /// Linear vertex colour at (u, v), parameters as in [`uv_at`](Self::uv_at).
    #[must_use]
    pub fn color_at(&self, shape: &Shape, u: f32, v: f32) -> Rgb {
        let w = corner_weights(shape, u, v);
        (0..4).map(|i| self.color[i] * w[i]).sum()
    }

    /// The corners' colour, where all have the same.
    fn uniform_color(&self) -> Option<Rgb> {
        self.color.iter().all(|c| *c == self.color[0]).then_some(self.color[0])
    }
}

fn corner_weights(shape: &Shape, u: f32, v: f32) -> [f32; 4] {
    match shape {
        Shape::Triangle(_) => [1.0 - u - v, u, v, 0.0],
        _ => [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v],
    }
}

impl Scene {
    /// Attributes of a surface, if it has any.
    #[must_use]
    pub fn attributes_of(&self, surface: u32) -> Option<&SurfaceAttributes> {
        let at = self.attributes.binary_search_by_key(&surface, |a| a.surface).ok()?;
        self.attributes.get(at)
    }

    /// Linear base colour of a surface at (u, v): factor · texel · vertex colour. `None` where the surface has
    /// neither texture nor vertex colours, or is unknown. Parameters as in [`SurfaceAttributes::uv_at`].
    #[must_use]
    pub fn base_color(&self, surface: u32, u: f32, v: f32) -> Option<Rgb> {
        let (shape, attributes, material) = self.colored(surface)?;
        let texel = material.texture.as_ref().map_or(Rgb::ONE, |t| t.sample(attributes.uv_at(shape, u, v)));
        Some(material.base_color * texel * attributes.color_at(shape, u, v))
    }

    /// Mean of [`base_color`](Self::base_color) over a patch with three or four corners in (u, v), convex.
    ///
    /// Texture alone and vertex colours alone are integrated exactly where texture coordinates are affine in
    /// (u, v), as on triangles and parallelograms; where both vary, the patch is cut into 64 or more pieces, each
    /// with one vertex colour. `None` as for [`base_color`](Self::base_color), and for fewer than three corners.
    #[must_use]
    pub fn mean_base_color(&self, surface: u32, corners: &[Vec2]) -> Option<Rgb> {
        let (shape, attributes, material) = self.colored(surface)?;
        if corners.len() < 3 {
            return None;
        }
        let uv = |p: &Vec2| attributes.uv_at(shape, p.x, p.y);
        let mean = match (&material.texture, attributes.uniform_color()) {
            (None, Some(color)) => color,
            (Some(texture), Some(color)) => {
                let corners: Vec<Vec2> = corners.iter().map(uv).collect();
                color * texture.mean_over(&corners)
            }
            (None, None) => fan_mean(corners, |triangle| {
                // Colours are at most quadratic: the three middles of the edges integrate them exactly.
                let middles = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| 0.5 * (triangle[i] + triangle[j]));
                middles.map(|m| attributes.color_at(shape, m.x, m.y)).iter().sum::<Rgb>() / 3.0
            }),
            (Some(texture), None) => fan_mean(corners, |triangle| {
                let sum: Rgb = pieces(triangle)
                    .map(|piece| {
                        let middle = (piece[0] + piece[1] + piece[2]) / 3.0;
                        attributes.color_at(shape, middle.x, middle.y) * texture.mean_over(&piece.map(|p| uv(&p)))
                    })
                    .sum();
                sum / (PRODUCT_STEPS * PRODUCT_STEPS) as f32
            }),
        };
        Some(material.base_color * mean)
    }

    fn colored(&self, surface: u32) -> Option<(&Shape, &SurfaceAttributes, &crate::Material)> {
        let attributes = self.attributes_of(surface)?;
        let surface = self.surfaces.get(surface as usize)?;
        Some((&surface.shape, attributes, self.materials.get(surface.material as usize)?))
    }
}

/// Mean over a convex polygon of what `mean` gives for a triangle, weighted by area.
fn fan_mean(corners: &[Vec2], mean: impl Fn([Vec2; 3]) -> Rgb) -> Rgb {
    let triangles = || (1..corners.len() - 1).map(|i| [corners[0], corners[i], corners[i + 1]]);
    let area = |t: [Vec2; 3]| (t[1] - t[0]).perp_dot(t[2] - t[0]).abs();
    let total: f32 = triangles().map(area).sum();
    if total > 0.0 && total.is_finite() {
        triangles().map(|t| mean(t) * (area(t) / total)).sum()
    } else {
        mean([corners[0], corners[1], corners[2]])
    }
}

/// A triangle cut into [`PRODUCT_STEPS`]² congruent ones.
fn pieces([a, b, c]: [Vec2; 3]) -> impl Iterator<Item = [Vec2; 3]> {
    let n = PRODUCT_STEPS;
    let at = move |i: u32, j: u32| a + (b - a) * (i as f32 / n as f32) + (c - a) * (j as f32 / n as f32);
    (0..n).flat_map(move |i| (0..n - i).map(move |j| (i, j))).flat_map(move |(i, j)| {
        let upright = [at(i, j), at(i + 1, j), at(i, j + 1)];
        let turned = (i + j + 1 < n).then(|| [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        std::iter::once(upright).chain(turned)
    })
}

/// Most texels kept of one image (4096²); larger ones are halved until they fit.
const MAX_TEXELS: usize = 1 << 24;

/// Decodes a PNG or JPEG image; `srgb`: its numbers are sRGB and turned to linear. Also says whether it was made
/// smaller. The error is what is wrong with it.
pub(crate) fn decode(bytes: &[u8], srgb: bool) -> Result<(Texels, bool), String> {
    let mut reader =
        image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(1 << 15);
    limits.max_image_height = Some(1 << 15);
    reader.limits(limits);
    let image = reader.decode().map_err(|e| e.to_string())?;
    let linear = |c: f32| if srgb { srgb_to_linear(c) } else { c };
    let (width, height) = (image.width(), image.height());
    let data: Vec<Rgb> = match image.color() {
        image::ColorType::L8 | image::ColorType::La8 | image::ColorType::Rgb8 | image::ColorType::Rgba8 => {
            let table: Vec<f32> = (0..=255_u8).map(|i| linear(f32::from(i) / 255.0)).collect();
            let at = |i: u8| table[usize::from(i)];
            image.to_rgb8().pixels().map(|p| Rgb::new(at(p.0[0]), at(p.0[1]), at(p.0[2]))).collect()
        }
        _ => image.to_rgb32f().pixels().map(|p| Rgb::from(p.0.map(linear))).collect(),
    };
    let mut texels = Texels::new(width, height, data).ok_or("it has no pixels")?;
    let large = texels.data.len() > MAX_TEXELS;
    while texels.data.len() > MAX_TEXELS {
        texels = texels.halved();
    }
    Ok((texels, large))
}

/// The sRGB transfer function of IEC 61966-2-1, to linear light; both in 0…1.
fn srgb_to_linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests;

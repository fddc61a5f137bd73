//! From radiance to screen: exposure, primaries, a filmic curve, the sRGB encoding.
//!
//! The same formula runs in the shader, with every constant of it in the uniforms; [`Tone::apply`] is what the shader
//! is tested against. It is that of saved pictures ([`hr_scene::tonemap`]), which says why it is so.

use crate::display::{DisplayMesh, Walkable};
use glam::{Mat3, Vec3};
use glossy_ext::Rgb;
use hr_scene::Camera;
use hr_scene::tonemap::Meter;

/// A filmic curve y = x (a x + b) / (x (c x + d) + e), the common form of the usual rational fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// a, b.
    pub numerator: [f32; 2],
    /// c, d, e.
    pub denominator: [f32; 3],
}

impl Curve {
    /// K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2015: a fit of the reference rendering transform.
    pub const ACES_FIT: Self = Self { numerator: [2.51, 0.03], denominator: [2.43, 0.59, 0.14] };

    /// The curve at `x` ≥ 0, clamped to 0…1.
    #[must_use]
    pub fn at(&self, x: f32) -> f32 {
        let ([a, b], [c, d, e]) = (self.numerator, self.denominator);
        ((x * (a * x + b)) / (x * (c * x + d) + e)).clamp(0.0, 1.0)
    }

    /// Where the curve reaches 1; far above 1 where it does so farther on or never.
    #[must_use]
    pub fn white(&self) -> f32 {
        let ([a, b], [c, d, e]) = (self.numerator.map(f64::from), self.denominator.map(f64::from));
        // The larger root of (a − c) x² + (b − d) x = e.
        let (p, q) = (a - c, b - d);
        let root = if p == 0.0 { e / q } else { (-q + (q * q + 4.0 * p * e).sqrt()) / (2.0 * p) };
        let white = root as f32;
        if white > 0.0 { white.min(BRIGHTEST) } else { BRIGHTEST }
    }
}

/// Everything between radiance and screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tone {
    /// What radiance is multiplied by, > 0.
    pub exposure: f32,
    /// From the scene's primaries to linear sRGB.
    pub to_srgb: Mat3,
    /// The curve, of the largest and the smallest channel.
    pub curve: Curve,
}

/// Exposed values are cut here: far beyond white, and the curve's squares stay finite.
pub(crate) const BRIGHTEST: f32 = 1e6;

/// In place of 0 as a divisor.
const TINY: f32 = 1e-30;

/// Share of the lit area that may be brighter than the curve's shoulder; lamps are not among it.
const HIGHLIGHTS: f64 = 0.02;

impl Tone {
    /// For what a camera sees of a solution ([`Walkable::exposure`]), or where that is not known [for its mesh](Self::for_mesh).
    #[must_use]
    pub fn for_view(walk: &dyn Walkable, camera: &Camera) -> Self {
        let of_mesh = Self::for_mesh(walk.mesh());
        Self { exposure: walk.exposure(camera).map_or(of_mesh.exposure, printable), ..of_mesh }
    }

    /// For what is seen first of a solution.
    #[must_use]
    pub fn for_start(walk: &dyn Walkable) -> Self {
        walk.cameras().first().map_or_else(|| Self::for_mesh(walk.mesh()), |(_, camera)| Self::for_view(walk, camera))
    }

    /// For a mesh, exposed so that the geometric mean of its diffuse radiance becomes middle grey, or darker where more
    /// than a fiftieth of it would burn out ([`Meter`]). Area counts, so that it does not depend on how finely surfaces
    /// are meshed; where no diffuse surface is lit, emission does.
    #[must_use]
    pub fn for_mesh(mesh: &DisplayMesh) -> Self {
        let to_srgb = mesh.primaries.to_srgb().as_mat3();
        let diffuse = |v: usize| mesh.irradiance[v] * mesh.tint[v];
        let emitted = |v: usize| mesh.emission[v];
        let factor = metered(mesh, diffuse).or_else(|| metered(mesh, emitted));
        let exposure = factor.map_or(1.0, |factor| printable(factor as f32));
        Self { exposure, to_srgb, curve: Curve::ACES_FIT }
    }

    /// sRGB-encoded colour, 0…1 per channel, of a radiance; black where that is not a number.
    #[must_use]
    pub fn apply(&self, radiance: Rgb) -> Vec3 {
        // Cut on both sides of the matrix: nothing may overflow in it, no negative channel may come out of it.
        let exposed = finite(radiance * self.exposure).clamp(Vec3::ZERO, Vec3::splat(BRIGHTEST));
        let linear = (self.to_srgb * exposed).max(Vec3::ZERO);
        let color = linear * (self.curve.white() / linear.max_element().max(TINY)).min(1.0);
        let (low, high) = (color.min_element(), color.max_element());
        let (dark, bright) = (self.curve.at(low), self.curve.at(high));
        let printed = Vec3::splat(dark) + (color - low) * ((bright - dark) / (high - low).max(TINY));
        Vec3::from_array(printed.to_array().map(srgb_encode))
    }
}

/// A factor that leaves room for what it is multiplied by.
fn printable(factor: f32) -> f32 {
    factor.clamp(1e-20, 1e20)
}

/// The nearest finite colour, black where not a number: shaders are not bound to carry infinities and NaN through.
pub(crate) fn finite(v: Rgb) -> Rgb {
    Rgb::from_array(v.to_array().map(|x| if x.is_nan() { 0.0 } else { x.clamp(f32::MIN, f32::MAX) }))
}

/// The sRGB transfer function (IEC 61966-2-1) of a linear value in 0…1.
pub(crate) fn srgb_encode(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// The exposure of a radiance over all lit surface area; `None` where there is none.
fn metered(mesh: &DisplayMesh, radiance: impl Fn(usize) -> Rgb) -> Option<f64> {
    let weights = mesh.primaries.luminance_weights();
    let mut meter = Meter::default();
    for batch in &mesh.batches {
        let indices = &mesh.indices[batch.indices.start as usize..batch.indices.end as usize];
        for corners in indices.chunks_exact(3) {
            let [a, b, c] = [corners[0], corners[1], corners[2]].map(|i| mesh.positions[i as usize]);
            let third = f64::from((b - a).cross(c - a).length()) / 6.0;
            for &corner in corners {
                meter.add(weights.dot(radiance(corner as usize).as_dvec3()), third);
            }
        }
    }
    meter.factor(HIGHLIGHTS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::Batch;
    use glam::Vec2;
    use hr_scene::Primaries;

    #[test]
    fn the_formula_is_that_of_saved_pictures() {
        for primaries in [Primaries::Radiance, Primaries::Rec709] {
            let tone = Tone { exposure: 0.7, to_srgb: primaries.to_srgb().as_mat3(), curve: Curve::ACES_FIT };
            let map = hr_scene::ToneMap { exposure: hr_scene::Exposure::Factor(0.7), stops: 0.0 };
            let print = map.print(&[], primaries);
            for color in [
                Rgb::splat(0.01),
                Rgb::new(0.2, 1.0, 3.0),
                Rgb::new(90.0, 1.0, 0.1),
                Rgb::X,
                Rgb::Y,
                Rgb::Z,
                Rgb::splat(1e9),
            ] {
                let (window, picture) = (tone.apply(color) * 255.0, print.srgb8(color));
                for c in 0..3 {
                    // Half a code of rounding, and f32 here against f64 there.
                    let off = (window[c] - f32::from(picture[c])).abs();
                    assert!(off < 0.51, "{primaries:?} {color}: {window} in the window, {picture:?} in pictures");
                }
            }
        }
    }

    #[test]
    fn curve_rises_and_nonsense_is_black() {
        let tone = Tone { exposure: 1.0, to_srgb: Mat3::IDENTITY, curve: Curve::ACES_FIT };
        let mut last = -1.0;
        for step in 0..200 {
            let y = tone.curve.at(0.02 * step as f32);
            assert!(y >= last && (0.0..=1.0).contains(&y), "not monotone at step {step}: {last} to {y}");
            last = y;
        }
        assert!((f64::from(tone.curve.white()) - hr_scene::tonemap::WHITE).abs() < 1e-3, "white as in pictures");
        for (curve, white) in [([0.0, 1.0], 1.0), ([0.0, 0.5], 2.0)] {
            let straight = Curve { numerator: curve, denominator: [0.0, 0.0, 1.0] };
            assert_eq!(straight.white(), white, "of a straight line");
        }
        let endless = Curve { numerator: [0.0, 1.0], denominator: [0.0, 1.0, 1.0] };
        assert_eq!(endless.white(), BRIGHTEST, "never reached");
        let white = tone.apply(Rgb::splat(f32::INFINITY));
        assert!((white - Vec3::ONE).abs().max_element() < 1e-6, "infinitely bright is white, not {white}");
        assert_eq!(tone.apply(Rgb::splat(f32::NAN)), Vec3::ZERO, "not a number is black");
        assert_eq!(tone.apply(Rgb::splat(-1.0)), Vec3::ZERO, "negative is black");
    }

    #[test]
    fn exposure_does_not_depend_on_meshing() {
        // A unit square of radiance 2 beside one of radiance 8, the latter once as two triangles, once as many.
        let mesh = |fine: usize| {
            let mut mesh = DisplayMesh { primaries: Primaries::Rec709, ..DisplayMesh::default() };
            let mut strip = |x: f32, width: f32, light: f32| {
                let first = u32::try_from(mesh.positions.len()).expect("a small mesh");
                for (dx, dy) in [(0.0, 0.0), (width, 0.0), (width, 1.0), (0.0, 1.0)] {
                    mesh.positions.push(Vec3::new(x + dx, dy, 0.0));
                    mesh.irradiance.push(Rgb::splat(light));
                }
                mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
            };
            strip(0.0, 1.0, 2.0);
            for i in 0..fine {
                strip(1.0 + i as f32 / fine as f32, 1.0 / fine as f32, 8.0);
            }
            let n = mesh.positions.len();
            (mesh.normals, mesh.tint) = (vec![Vec3::Z; n], vec![Rgb::ONE; n]);
            (mesh.emission, mesh.uv) = (vec![Rgb::ZERO; n], vec![Vec2::ZERO; n]);
            mesh.batches = vec![Batch { indices: 0..u32::try_from(mesh.indices.len()).expect("small"), texture: None }];
            mesh
        };
        for fine in [1, 16] {
            let exposure = Tone::for_mesh(&mesh(fine)).exposure;
            // Of equal areas of 2 and 8, 45 % and 40 % count: 1 and 3 stops.
            let mean = (f32::from(45_u8 + 3 * 40) / 85.0).exp2();
            assert!((exposure - 0.18 / mean).abs() < 1e-5, "{fine} strips gave {exposure}");
        }
        assert_eq!(Tone::for_mesh(&DisplayMesh::default()).exposure, 1.0, "nothing to expose for");
    }
}

//! False colours: a quantity on a logarithmic scale instead of the picture.

use super::tone::finite;
use crate::display::DisplayMesh;
use glossy_ext::Rgb;
use std::f32::consts::PI;

/// From the scale's low end to its high end, a factor of ten each.
pub(super) const DECADES: f32 = 3.0;

/// Linear colours from low to high: dark blue, blue, cyan, green, yellow, red, white.
pub(super) const RAMP: [[f32; 3]; 7] = [
    [0.01, 0.01, 0.10],
    [0.02, 0.08, 0.80],
    [0.00, 0.60, 0.75],
    [0.05, 0.55, 0.08],
    [0.90, 0.75, 0.02],
    [0.80, 0.04, 0.02],
    [1.00, 1.00, 1.00],
];

/// Share of all vertices, weighted alike, that the scale's high end is not exceeded by.
const ALMOST_ALL: f32 = 0.98;

/// What is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Quantity {
    /// The picture itself.
    #[default]
    Picture,
    Radiance,
    Radiosity,
    Irradiance,
}

/// A quantity and the high end of its scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gauge {
    pub(super) quantity: Quantity,
    /// > 0.
    pub(super) high: f32,
}

impl Gauge {
    /// The picture itself.
    pub(super) const OFF: Self = Self { quantity: Quantity::Picture, high: 1.0 };
}

impl Quantity {
    /// The one after it, round and round.
    pub(super) fn next(self) -> Self {
        match self {
            Self::Picture => Self::Radiance,
            Self::Radiance => Self::Radiosity,
            Self::Radiosity => Self::Irradiance,
            Self::Irradiance => Self::Picture,
        }
    }

    /// Its number in the shader.
    pub(super) fn number(self) -> f32 {
        match self {
            Self::Picture => 0.0,
            Self::Radiance => 1.0,
            Self::Radiosity => 2.0,
            Self::Irradiance => 3.0,
        }
    }

    /// Name and unit.
    pub(super) fn label(self) -> &'static str {
        match self {
            Self::Picture => "",
            Self::Radiance => "radiance toward the eye, W/(m² sr)",
            Self::Radiosity => "radiosity, diffuse and emitted, W/m²",
            Self::Irradiance => "irradiance, W/m²",
        }
    }

    /// The high end of a scale that holds what a mesh shows: 1, 2 or 5 times a power of ten. Luminance by the weights.
    pub(super) fn high(self, mesh: &DisplayMesh) -> f32 {
        let weights = mesh.primaries.luminance_weights().as_vec3();
        // Lamps are far brighter than what they light; they may leave the scale.
        let reflected = |v: usize| mesh.irradiance[v] * mesh.tint[v];
        let positive = |value: &dyn Fn(usize) -> Rgb| -> Vec<f32> {
            let all = (0..mesh.positions.len()).map(|v| weights.dot(finite(value(v)).max(Rgb::ZERO)));
            all.filter(|x| *x > 0.0).collect()
        };
        let mut values = match self {
            Self::Picture | Self::Radiance => positive(&reflected),
            Self::Radiosity => positive(&|v| reflected(v) * PI),
            Self::Irradiance => positive(&|v| mesh.irradiance[v]),
        };
        if values.is_empty() {
            values = positive(&|v| mesh.emission[v]);
        }
        if values.is_empty() {
            return 1.0;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
        let at = (ALMOST_ALL * (values.len() - 1) as f32) as usize;
        let (_, value, _) = values.select_nth_unstable_by(at, f32::total_cmp);
        round_up(*value)
    }
}

/// The linear colour at a share of the scale's length.
pub(super) fn color(share: f32) -> [f32; 3] {
    let place = share.clamp(0.0, 1.0) * (RAMP.len() - 1) as f32;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    let below = (place as usize).min(RAMP.len() - 2);
    let (low, high) = (RAMP[below], RAMP[below + 1]);
    [0, 1, 2].map(|c| low[c] + (high[c] - low[c]) * (place - below as f32))
}

/// The next 1, 2 or 5 times a power of ten that is not below `value` > 0.
fn round_up(value: f32) -> f32 {
    let value = value.clamp(1e-30, 1e30);
    let power = 10_f32.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|step| step * power).into_iter().find(|high| *high >= value).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{Batch, Walkable};
    use crate::inside::Mark;
    use crate::window::frame::Frame;
    use crate::window::gpu::Gpu;
    use crate::window::layouts::Layouts;
    use crate::window::overlay::{Layer, Marks};
    use crate::window::parts::Parts;
    use crate::window::shown::Shown;
    use crate::window::snapshot::Snapshot;
    use crate::window::tone::{Tone, srgb_encode};
    use crate::window::view::View;
    use glam::{DVec3, Vec2, Vec3};
    use hr_scene::Camera;
    use std::f32::consts::FRAC_1_PI;

    #[test]
    fn scales_end_at_round_figures() {
        for (value, high) in [(1.0, 1.0), (1.1, 2.0), (0.03, 0.05), (730.0, 1000.0), (0.0, 1e-30)] {
            let found = round_up(value);
            assert!((found / high - 1.0).abs() < 1e-5, "{value} is on a scale up to {found}, not {high}");
        }
        assert_eq!(Quantity::Irradiance.high(&DisplayMesh::default()), 1.0, "nothing to show");
    }

    /// A square that fills the picture, of irradiance 40 and radiance 40 / π · 0.5 + 3.
    struct Square(DisplayMesh);

    impl Walkable for Square {
        fn name(&self) -> &str {
            "square"
        }
        fn mesh(&self) -> &DisplayMesh {
            &self.0
        }
        fn cameras(&self) -> &[(String, Camera)] {
            &[]
        }
        fn glossy_radiance(&self, _: DVec3, _: &[u32], out: &mut [Rgb]) {
            // Toward the eye alone, so that it is no part of the radiosity.
            out.fill(Rgb::splat(2.0));
        }
    }

    #[test]
    fn the_shader_shows_each_quantity_on_its_scale() {
        let corners = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
        let square = Square(DisplayMesh {
            positions: corners.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
            normals: vec![Vec3::Z; 4],
            irradiance: vec![Rgb::splat(40.0); 4],
            tint: vec![Rgb::splat(0.5 * FRAC_1_PI); 4],
            emission: vec![Rgb::splat(1.0); 4],
            uv: vec![Vec2::ZERO; 4],
            indices: vec![0, 1, 2, 0, 2, 3],
            batches: vec![Batch { indices: 0..6, texture: None }],
            glossy: vec![0, 1, 2, 3],
            ..DisplayMesh::default()
        });
        let gpu = match Gpu::new() {
            Ok(gpu) => gpu,
            Err(error) => return eprintln!("skipped, no graphics device: {error}"),
        };
        let layouts = Layouts::new(&gpu);
        let mut shown =
            Shown::new(&gpu, &layouts, &square, Parts::new(&square, gpu.capacity(), false)).expect("a small mesh");
        let view = View::looking(DVec3::new(0.0, 0.0, 4.0), DVec3::NEG_Z, DVec3::Y, 60.0, 1.0);
        shown.follow(&gpu, &square, &view, [4, 4], 0.0);
        let tone = Tone::for_mesh(square.mesh());
        let reflected = 20.0 * FRAC_1_PI;
        for (quantity, value) in [
            (Quantity::Radiance, reflected + 1.0 + 2.0),
            (Quantity::Radiosity, 20.0 + PI),
            (Quantity::Irradiance, 40.0),
        ] {
            let gauge = Gauge { quantity, high: 100.0 };
            let mut mark = Mark { at: Vec3::new(-1.0, 1.2, 0.5), color: [1.0, 1.0, 1.0, 1.0] };
            let triangle = [Vec3::ZERO, Vec3::X * 0.3, Vec3::Y * 0.3].map(|offset| {
                mark.at += offset;
                mark
            });
            let marks: Vec<Marks> = Marks::new(&gpu, Layer::Solid, &triangle).expect("small").into_iter().collect();
            let frame = Frame { view: &view, tone: &tone, mesh: square.mesh(), gauge, marks: &marks };
            let picture = Snapshot::draw(&gpu, &layouts, &shown.buffers, [64, 64], &frame).expect("a small picture");
            let pixel = |x: usize, y: usize| &picture.rgba[4 * (64 * y + x)..][..3];
            let share = ((value / 100.0_f32).log10() + DECADES) / DECADES;
            let expected = color(share).map(|c| 255.0 * srgb_encode(c));
            for c in 0..3 {
                let off = (f32::from(pixel(32, 40)[c]) - expected[c]).abs();
                assert!(off < 1.5, "{quantity:?}: {:?} instead of {expected:?}", pixel(32, 40));
            }
            let white = picture.rgba.chunks(4).filter(|p| p[..3] == [255; 3]).count();
            assert!((1..40).contains(&white), "the mark before it is seen in {white} pixels");
        }
    }

    #[test]
    fn all_quantities_come_round() {
        let mut quantity = Quantity::default();
        for number in [0.0, 1.0, 2.0, 3.0, 0.0] {
            assert_eq!(quantity.number(), number, "the order of the keys is that of the shader");
            quantity = quantity.next();
        }
    }
}

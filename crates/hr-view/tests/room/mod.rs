//! A room made by hand, to test the window with: light that is invented, but where it belongs.

use glam::{DVec3, Mat3, Vec2, Vec3};
use glossy_ext::Rgb;
use hr_scene::{Camera, Primaries, Texels, Texture, Wrap};
use hr_view::display::{Batch, DisplayMesh, Walkable};
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// Far from zero, so that positions that lose their origin show at once.
pub(crate) const ORIGIN: DVec3 = DVec3::new(4_000_000.0, -2_000_000.0, 1_000.0);

/// Where the lamp hangs, relative to `ORIGIN`.
const LAMP: Vec3 = Vec3::new(2.0, 1.5, 2.6);

/// A room 4 × 3 × 3 with coloured side walls, a checkered wall at its end, a lamp and a glossy floor.
pub(crate) struct Room {
    mesh: DisplayMesh,
    cameras: Vec<(String, Camera)>,
}

impl Room {
    /// Each face is a grid of `n` × `n` quadrilaterals.
    pub(crate) fn new(n: u16) -> Self {
        let mut mesh = DisplayMesh { origin: ORIGIN, primaries: Primaries::Rec709, ..DisplayMesh::default() };
        let (x, y, z) = (Vec3::X * 4.0, Vec3::Y * 3.0, Vec3::Z * 3.0);
        let grey = Rgb::splat(0.7);
        face(&mut mesh, n, [z, y, x], grey, Rgb::ZERO);
        face(&mut mesh, n, [Vec3::ZERO, z, x], Rgb::new(0.75, 0.12, 0.1), Rgb::ZERO);
        face(&mut mesh, n, [y, x, z], Rgb::new(0.1, 0.25, 0.75), Rgb::ZERO);
        face(&mut mesh, n, [Vec3::ZERO, y, z], grey, Rgb::ZERO);
        let half = 0.3;
        let corner = LAMP - Vec3::new(half, half, 0.0);
        face(&mut mesh, 1, [corner, Vec3::Y * (2.0 * half), Vec3::X * (2.0 * half)], Rgb::ZERO, Rgb::splat(30.0));
        let floor = mesh.positions.len();
        face(&mut mesh, n, [Vec3::ZERO, x, y], Rgb::splat(0.2), Rgb::ZERO);
        mesh.glossy = (floor..mesh.positions.len()).map(|v| u32::try_from(v).expect("small")).collect();
        let plain = u32::try_from(mesh.indices.len()).expect("small");
        face(&mut mesh, n, [x, z, y], Rgb::ONE, Rgb::ZERO);
        let all = u32::try_from(mesh.indices.len()).expect("small");
        mesh.batches =
            vec![Batch { indices: 0..plain, texture: None }, Batch { indices: plain..all, texture: Some(0) }];
        mesh.textures.push(checks());
        let camera = |eye: [f64; 3], target: [f64; 3]| Camera {
            eye: (ORIGIN + DVec3::from(eye)).into(),
            target: (ORIGIN + DVec3::from(target)).into(),
            up: [0.0, 0.0, 1.0],
            fov_x: 75.0,
            width: 640,
            height: 400,
        };
        let cameras = vec![
            ("entrance".to_owned(), camera([0.3, 1.5, 1.6], [4.0, 1.5, 1.0])),
            ("corner".to_owned(), camera([0.4, 2.6, 2.4], [3.5, 0.5, 0.2])),
            // The lamp's mirror image lies on the floor halfway between two equal heights.
            ("highlight".to_owned(), camera([0.8, 1.5, LAMP.z.into()], [1.4, 1.5, 0.0])),
        ];
        Self { mesh, cameras }
    }
}

impl Walkable for Room {
    fn name(&self) -> &str {
        "room"
    }
    fn mesh(&self) -> &DisplayMesh {
        &self.mesh
    }
    fn cameras(&self) -> &[(String, Camera)] {
        &self.cameras
    }
    /// A Phong lobe about the mirror image of the lamp.
    fn glossy_radiance(&self, eye: DVec3, vertices: &[u32], out: &mut [Rgb]) {
        let eye = (eye - ORIGIN).as_vec3();
        for (out, &slot) in out.iter_mut().zip(vertices) {
            let p = self.mesh.positions[self.mesh.glossy[slot as usize] as usize];
            let mirrored = ((LAMP - p) * Vec3::new(-1.0, -1.0, 1.0)).normalize();
            let peak = mirrored.dot((eye - p).normalize()).max(0.0).powi(60);
            *out = Rgb::new(1.0, 0.9, 0.7) * (4.0 * peak);
        }
    }
}

/// A parallelogram from a corner along two edges, facing edge 1 × edge 2, as a grid.
fn face(mesh: &mut DisplayMesh, n: u16, [corner, a, b]: [Vec3; 3], reflectance: Rgb, emission: Rgb) {
    let first = u32::try_from(mesh.positions.len()).expect("small");
    let normal = a.cross(b).normalize();
    let side = u32::from(n) + 1;
    for i in 0..=n {
        for j in 0..=n {
            let uv = Vec2::new(f32::from(i), f32::from(j)) / f32::from(n);
            let p = corner + a * uv.x + b * uv.y;
            let to = LAMP - p;
            let light = normal.dot(to.normalize_or_zero()).max(0.0) / to.length_squared().max(0.1);
            mesh.positions.push(p);
            mesh.normals.push(normal);
            mesh.irradiance.push(Rgb::splat(1.5) + Rgb::splat(12.0 * light));
            mesh.tint.push(reflectance * FRAC_1_PI);
            mesh.emission.push(emission);
            mesh.uv.push(uv);
        }
    }
    for i in 0..u32::from(n) {
        for j in 0..u32::from(n) {
            let k = first + i * side + j;
            mesh.indices.extend([k, k + side, k + side + 1, k, k + side + 1, k + 1]);
        }
    }
}

fn checks() -> Texture {
    let size = 64_u32;
    let dark = |i: u32| (i % size / 8 + i / size / 8).is_multiple_of(2);
    let data = (0..size * size).map(|i| if dark(i) { Rgb::splat(0.1) } else { Rgb::new(0.8, 0.7, 0.4) }).collect();
    let texels = Texels::new(size, size, data).expect("as many texels as it says");
    Texture { texels: Arc::new(texels), transform: Mat3::from_scale(Vec2::splat(2.0)), wrap: [Wrap::Repeat; 2] }
}

//! The shader against the formula that it stands for.

use crate::room::Room;
use glam::{DVec3, Mat3, Vec2, Vec3};
use glossy_ext::Rgb;
use hr_scene::{Camera, Primaries};
use hr_view::display::{Batch, DisplayMesh, Walkable};
use hr_view::window::{Curve, Snapshot, Tone, WindowError};

/// Draws, or says that there is nothing to draw with.
fn draw(walk: &dyn Walkable, camera: &Camera, tone: Option<&Tone>) -> Option<Snapshot> {
    match Snapshot::of(walk, camera, tone) {
        Ok(picture) => Some(picture),
        Err(WindowError::NoAdapter(reason)) => {
            eprintln!("skipped, no graphics device: {reason}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

fn pixel(picture: &Snapshot, x: u32, y: u32) -> [u8; 3] {
    let at = 4 * (y * picture.width + x) as usize;
    [picture.rgba[at], picture.rgba[at + 1], picture.rgba[at + 2]]
}

/// A wall of vertical stripes seen head-on, each of one radiance; every second one glossy.
struct Stripes {
    mesh: DisplayMesh,
    colors: Vec<Rgb>,
}

impl Stripes {
    fn new(colors: Vec<Rgb>, primaries: Primaries) -> Self {
        let mut mesh = DisplayMesh { primaries, ..DisplayMesh::default() };
        for (i, &color) in (0_u16..).zip(&colors) {
            let first = 4 * u32::from(i);
            let is_glossy = i % 2 == 1;
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                mesh.positions.push(Vec3::new(f32::from(i) + dx, dy * 4.0, 0.0));
                mesh.normals.push(Vec3::Z);
                // Split between its terms, so that a missing one shows.
                mesh.irradiance.push(if is_glossy { Rgb::ZERO } else { color * 0.75 * std::f32::consts::PI });
                mesh.tint.push(Rgb::splat(std::f32::consts::FRAC_1_PI));
                mesh.emission.push(color * 0.25);
                mesh.uv.push(Vec2::ZERO);
            }
            mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|k| first + k));
            if is_glossy {
                mesh.glossy.extend(first..first + 4);
            }
        }
        mesh.batches = vec![Batch { indices: 0..u32::try_from(mesh.indices.len()).expect("small"), texture: None }];
        Self { mesh, colors }
    }

    fn camera(&self, z: f64) -> Camera {
        let middle = 0.5 * self.colors.len() as f64;
        Camera {
            eye: [middle, 2.0, z],
            target: [middle, 2.0, 0.0],
            up: [0.0, 1.0, 0.0],
            // Exactly as wide as the wall: stripe i covers pixels 8 i … 8 i + 7.
            fov_x: 2.0 * (middle / z.abs()).atan().to_degrees(),
            width: 8 * u32::try_from(self.colors.len()).expect("small"),
            height: 8,
        }
    }
}

impl Walkable for Stripes {
    fn name(&self) -> &str {
        "stripes"
    }
    fn mesh(&self) -> &DisplayMesh {
        &self.mesh
    }
    fn cameras(&self) -> &[(String, Camera)] {
        &[]
    }
    fn glossy_radiance(&self, _: DVec3, vertices: &[u32], out: &mut [Rgb]) {
        for (out, &slot) in out.iter_mut().zip(vertices) {
            *out = self.colors[self.mesh.glossy[slot as usize] as usize / 4] * 0.75;
        }
    }
}

fn colors() -> Vec<Rgb> {
    let mut colors: Vec<Rgb> = (0..10_i16).map(|i| Rgb::splat(0.002 * 3.0_f32.powf(f32::from(i)))).collect();
    colors.extend([Rgb::X, Rgb::Y, Rgb::Z, Rgb::new(0.3, 0.02, 0.5), Rgb::ZERO, Rgb::splat(1e30)]);
    colors
}

#[test]
fn every_pixel_follows_the_formula() {
    for primaries in [Primaries::Radiance, Primaries::Rec709] {
        let wall = Stripes::new(colors(), primaries);
        let tone = Tone { exposure: 0.7, ..Tone::for_mesh(wall.mesh()) };
        let Some(picture) = draw(&wall, &wall.camera(5.0), Some(&tone)) else {
            return;
        };
        for (i, &color) in (0..).zip(&wall.colors) {
            let expected = tone.apply(color) * 255.0;
            let found = pixel(&picture, 8 * i + 4, 4);
            for c in 0..3 {
                // Rounding to 8 bits is half a code; devices may encode half a code off at most.
                let off = (f32::from(found[c]) - expected[c]).abs();
                assert!(off <= 1.01, "{primaries:?} stripe {i} ({color}): {found:?} for {expected}");
            }
        }
    }
}

#[test]
fn other_curves_come_through_the_uniforms() {
    let wall = Stripes::new(colors(), Primaries::Rec709);
    // x / (1 + x)
    let curve = Curve { numerator: [0.0, 1.0], denominator: [0.0, 1.0, 1.0] };
    let tone = Tone { exposure: 2.0, to_srgb: Mat3::IDENTITY, curve };
    let Some(picture) = draw(&wall, &wall.camera(5.0), Some(&tone)) else {
        return;
    };
    for (i, &color) in (0..).zip(&wall.colors) {
        let off = (f32::from(pixel(&picture, 8 * i + 4, 4)[0]) - 255.0 * tone.apply(color).x).abs();
        assert!(off <= 1.01, "stripe {i} is off by {off}");
    }
}

#[test]
fn back_faces_are_not_seen() {
    let wall = Stripes::new(colors(), Primaries::Rec709);
    let Some(picture) = draw(&wall, &wall.camera(-5.0), None) else {
        return;
    };
    let lit = picture.rgba.chunks(4).filter(|p| p[..3] != [0, 0, 0]).count();
    assert_eq!(lit, 0, "the wall has no back");
}

#[test]
fn the_room_far_from_zero_is_where_it_should_be() {
    let room = Room::new(16);
    let (_, camera) = &room.cameras()[0];
    let Some(picture) = draw(&room, camera, None) else {
        return;
    };
    if let Some(path) = std::env::var_os("HR_VIEW_KEEP") {
        picture.save_png(path.as_ref()).expect("a writable path");
    }
    let (left, right) = (pixel(&picture, 20, 200), pixel(&picture, 619, 200));
    // Looking along +x with z up, the wall y = 3 is on the left.
    assert!(left[2] > left[0] + 30, "the left wall is blue, not {left:?}");
    assert!(right[0] > right[2] + 30, "the right wall is red, not {right:?}");
    // The texture repeats twice: 16 checks across the far wall, dark and light.
    let row: Vec<bool> = (220..420).map(|x| pixel(&picture, x, 190)[0] > 128).collect();
    let edges = row.windows(2).filter(|w| w[0] != w[1]).count();
    assert!(edges >= 8, "only {edges} edges between the checks");
}

#[test]
fn the_highlight_follows_the_eye() {
    let room = Room::new(64);
    let (_, camera) = &room.cameras()[2];
    let Some(picture) = draw(&room, camera, None) else { return };
    let highlight = pixel(&picture, 320, 200)[0];
    let beside = pixel(&picture, 320, 20)[0];
    assert!(highlight > beside + 60, "the middle of the picture is {highlight}, the floor beyond it {beside}");
    let mut aside = *camera;
    aside.eye[1] += 0.8;
    let Some(picture) = draw(&room, &aside, None) else { return };
    let found = pixel(&picture, 320, 200)[0];
    assert!(found < highlight - 30, "seen from aside the same point is {found}, was {highlight}");
}

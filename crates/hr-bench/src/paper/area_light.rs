//! Figure 4: how the highlight of an area light converges with the number of its samples.
//!
//! The scene `area-light`: a square light over a highly glossy plate. The light is divided in n × n squares, each of which
//! is one sample at every point of the plate that a pixel sees: a Dirac impulse from its middle, as in the paper, a disk
//! of its solid angle ([`Incident::extent`]), or the square that it is ([`Incident::contour`]). Nothing lies between light and plate, so that all there is to see of the
//! convergence is the samples'.

use super::{Page, percent};
use crate::BenchError;
use crate::side_by_side::side_by_side;
use glam::{DVec3, Vec3};
use glossy_ext::{Contour, Incident, Place, Reflector, Ward};
use hr_diffuse::Shape;
use hr_scene::{Camera, Image, Rgb, Scene};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Roughness of the plate: the scene's own, and wider lobes.
const ALPHAS: [f32; 3] = [0.01, 0.03, 0.1];
/// The paper's 4, 16 and 64 samples, and fewer; n of n × n.
const SIDES: [usize; 4] = [1, 2, 4, 8];
/// The reference: parts of a fifth of a degree.
const FINEST: usize = 160;
/// Where on the plate the light is mirrored to the scene's first camera.
const HIGHLIGHT: [f64; 3] = [0.0, -0.4, 0.0];
/// Irradiance is the mean from points so far from a square's middle, in its sides, along both (Gauss and Legendre): right to the third
/// order, as links know it. From the middle alone a fourth of the light would be off by 1 %, more than what is compared.
const GAUSS: f64 = 0.288_675_134_594_812_9;
/// Width of the pictures, pixels.
const WIDTH: u32 = 160;

/// What a sample stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A direction.
    Dirac,
    /// A disk.
    Disk,
    /// What it is.
    Square,
}

/// A square light over a plate in the plane z = 0.
struct Subject {
    plate: [f64; 4],
    light: [DVec3; 4],
    radiance: Rgb,
    camera: Camera,
}

impl Subject {
    /// The built-in one, for pictures so many pixels wide.
    fn load(width: u32) -> Result<Self, BenchError> {
        let scene = Scene::load("area-light")?;
        let quad = |name: &str| {
            let of = |material: u32| scene.materials[material as usize].name == name;
            let found = scene.surfaces.iter().find(|surface| of(surface.material));
            let corners = found.and_then(|surface| match surface.shape {
                Shape::Quad(corners) => Some((corners, surface.material)),
                _ => None,
            });
            corners.ok_or_else(|| BenchError::Arguments(format!("the built-in scene has no quadrilateral '{name}'")))
        };
        let ((plate, _), (light, material)) = (quad("plate")?, quad("light")?);
        let low = plate.iter().fold(DVec3::MAX, |a, b| a.min(*b));
        let high = plate.iter().fold(DVec3::MIN, |a, b| a.max(*b));
        let radiance = scene.materials[material as usize].exitance * FRAC_1_PI;
        // What is reflected toward the scene's first camera, close up.
        let camera = scene.default_camera();
        let camera = Camera { target: HIGHLIGHT, fov_x: 22.0, width, height: width * 3 / 4, ..camera };
        Ok(Self { plate: [low.x, low.y, high.x, high.y], light, radiance, camera })
    }

    /// Samples of n × n parts of the light at a point of the plate.
    fn samples(&self, at: DVec3, n: usize, kind: Kind, out: &mut Vec<Incident>) {
        let [corner, right, _, up] = self.light;
        let (a, b) = ((right - corner) / n as f64, (up - corner) / n as f64);
        let normal = a.cross(b);
        out.clear();
        for i in 0..n * n {
            let middle = corner + a * ((i % n) as f64 + 0.5) + b * ((i / n) as f64 + 0.5);
            let (direction, distance) = (middle - at).normalize_and_length();
            let (mut solid_angle, mut factor) = (0.0, 0.0);
            for [s, t] in [[-GAUSS, -GAUSS], [GAUSS, -GAUSS], [GAUSS, GAUSS], [-GAUSS, GAUSS]] {
                let (direction, distance) = (middle + a * s + b * t - at).normalize_and_length();
                let part = (-direction.dot(normal)).max(0.0) / (4.0 * distance * distance);
                solid_angle += part;
                factor += part * direction.z.max(0.0);
            }
            let half = |side: DVec3| (side * (0.5 / distance)).as_vec3();
            let is_square = kind == Kind::Square;
            let direction = direction.as_vec3();
            out.push(Incident {
                direction,
                extent: if kind == Kind::Dirac { 0.0 } else { (solid_angle / std::f64::consts::PI).sqrt() as f32 },
                irradiance: self.radiance * factor as f32,
                contour: if is_square { Contour::new(direction, half(a), half(b), 0.0) } else { Contour::NONE },
                nearness: distance.recip() as f32,
            });
        }
    }

    /// The glossy light of the plate.
    fn image(&self, reflector: &Ward, n: usize, kind: Kind) -> Image {
        let mut image = Image::new(self.camera.width, self.camera.height);
        let (eye, rays) = (DVec3::from(self.camera.eye), self.camera.rays());
        let width = self.camera.width as usize;
        let [x0, y0, x1, y1] = self.plate;
        image.pixels.par_iter_mut().enumerate().for_each_init(Vec::new, |samples, (i, pixel)| {
            let (x, y) = (i % width, i / width);
            let direction = rays.direction(x as f64 + 0.5, y as f64 + 0.5);
            let at = eye - direction * (eye.z / direction.z);
            if direction.z < 0.0 && (x0..x1).contains(&at.x) && (y0..y1).contains(&at.y) {
                self.samples(at, n, kind, samples);
                let away = Place::new(Vec3::ZERO, Vec3::Z).local(-direction.as_vec3());
                *pixel = reflector.reflect_sum(samples, away);
            }
        });
        image
    }
}

/// Mean distance, relative to the mean of what is right.
fn distance(image: &Image, right: &Image) -> f64 {
    let sum = |f: &dyn Fn(usize) -> Rgb| (0..right.pixels.len()).map(|i| f64::from(f(i).element_sum())).sum::<f64>();
    sum(&|i| (image.pixels[i] - right.pixels[i]).abs()) / sum(&|i| right.pixels[i])
}

/// Adds the figure to a page.
pub(super) fn report(page: &mut Page<'_>) -> Result<(), BenchError> {
    page.text("## Figure 4: an area light's highlight, and the number of samples");
    page.text(
        "A square light of about 28° over a glossy plate (Ward's model), one sample for each of so many squares that it is \
         divided in. The paper's samples are Dirac impulses; ours carry the solid angle that they stand for, and their outline \
         where the sender is a polygon, and are reflected as disks or as the squares that they are, seen in perspective. \
         All bring the irradiance of their square. Mean distance of the glossy light in a picture from that of 25,600 \
         impulses, relative to its mean:",
    );
    let subject = Subject::load(WIDTH)?;
    page.head(2, &["α", "samples are", "1", "4", "16", "64"]);
    let mut pictures = Vec::new();
    for alpha in ALPHAS {
        let reflector = ward(alpha)?;
        let right = subject.image(&reflector, FINEST, Kind::Dirac);
        for (kind, name) in [(Kind::Dirac, "Dirac impulses"), (Kind::Disk, "disks"), (Kind::Square, "squares")] {
            let images = SIDES.map(|n| subject.image(&reflector, n, kind));
            let errors = images.iter().map(|image| percent(distance(image, &right)));
            page.row(&[alpha.to_string(), name.to_owned()].into_iter().chain(errors).collect::<Vec<_>>());
            if alpha == ALPHAS[0] {
                pictures.push(images.into_iter().chain([right.clone()]).collect());
            }
        }
    }
    page.text(&format!(
        "1, 4, 16 and 64 samples at α = {} and the reference, as Dirac impulses, disks and squares:",
        ALPHAS[0]
    ));
    page.picture("figure-4", "Highlights of an area light", &side_by_side(&pictures))
}

fn ward(alpha: f32) -> Result<Ward, BenchError> {
    Ward::new(Rgb::ZERO, Rgb::splat(0.85), alpha).map_err(|error| BenchError::Arguments(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_samples_with_their_extent_are_better_than_64_impulses() {
        // Of the highlight a fourth of the pixels tells the same.
        let subject = Subject::load(WIDTH / 2).expect("built in");
        for alpha in ALPHAS {
            let reflector = ward(alpha).expect("a Ward reflector");
            let right = subject.image(&reflector, FINEST, Kind::Dirac);
            let error = |n, kind| distance(&subject.image(&reflector, n, kind), &right);
            let (four, impulses) = (error(2, Kind::Square), error(8, Kind::Dirac));
            assert!(four < impulses, "α = {alpha}: 4 squares are off by {four}, 64 impulses by {impulses}");
            let disks = error(2, Kind::Disk);
            assert!(four < 0.7 * disks, "α = {alpha}: 4 squares are off by {four}, disks by {disks}");
            assert!(error(8, Kind::Disk) < 0.6 * disks, "α = {alpha}: disks converge");
        }
    }
}

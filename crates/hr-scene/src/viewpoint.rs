//! Where to stand and where to walk in a scene: a camera for files without one, and the walkthrough's path.

mod sight;

use crate::camera::unit;
use crate::{Camera, Scene};
use glam::DVec3;
use hr_diffuse::{Shape, Surface};
use sight::Sight;
use std::f64::consts::{PI, TAU};

/// Eye height as a share of a room's height: 1.6 m of 2.6 m.
const EYE_HEIGHT: f64 = 0.62;
/// Shares of length and width at which a place inside of a room is looked for: near the corners first.
const PLACES: [f64; 5] = [0.14, 0.86, 0.32, 0.68, 0.5];
/// Share of all directions that must end on a surface for a place to count as within something.
const WITHIN: f64 = 0.5;
/// The same where there is no lamp, so that light comes from above if at all: a yard is stood in, a bowl is not.
const WITHIN_OPEN: f64 = 0.8;
/// The same for a closed room.
const CLOSED: f64 = 0.9;
/// How much better a view from outside must be to be taken in place of one from inside of a closed room.
const INSIDE: f64 = 1.5;
/// Area that faces +z and has no opposite, as a share of all that faces along y and z, from which it is a solid's ground.
const GROUND_SHARE: f64 = 0.1;
/// Surfaces larger by this factor than all that is smaller are ground, or sky: what stands on it is looked at.
const GROUND: f64 = 4.0;
/// Field of view of a default camera across, inside and outside, degrees.
const FIELDS: [f64; 2] = [70.0, 45.0];
/// Radius of the walk about a single camera, as a share of the distance to what it looks at.
const STROLL: f64 = 0.3;

impl Scene {
    /// Smallest and largest coordinates of the surfaces; `None` without any. Exact for polygons and spheres, a little
    /// wide for other curved surfaces.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        bounds_of(&self.surfaces)
    }

    /// Which way is up: that of the first camera; else +y for glTF files, which say so. MGF and OBJ files do not tell:
    /// +y or +z, whichever has more floor and ceiling, that is, polygon area facing along it; area of floors that no
    /// ceiling is opposite to counts twice, since walls come in pairs. In OBJ files of solids every face is one of a pair,
    /// which tells nothing: +y, as most programs write them, unless there is a ground that faces +z.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        if let Some((_, camera)) = self.cameras.first() {
            return unit(camera.up.into());
        }
        let name = self.name.to_lowercase();
        if name.ends_with(".gltf") || name.ends_with(".glb") {
            return DVec3::Y;
        }
        let (mut both, mut net) = (DVec3::ZERO, DVec3::ZERO);
        for surface in &self.surfaces {
            let Some((_, area)) = flat(&surface.shape) else { continue };
            // Only what faces along an axis: slopes and rounded things tell nothing.
            if (area / area.length()).abs().max_element() > 0.95 {
                both += area.abs();
                net += if surface.flip { -area } else { area };
            }
        }
        let horizontal = net.abs()
            + if name.ends_with(".obj") && self.is_solid() {
                DVec3::Y * (GROUND_SHARE * (both.y + both.z))
            } else {
                both
            };
        if horizontal.y >= horizontal.z { DVec3::Y } else { DVec3::Z }
    }

    /// Whether flat surfaces and spheres face outward on the whole, so that they enclose a positive volume: an object, or
    /// a house whose walls have two sides each. A room of walls that face inward encloses a negative one.
    fn is_solid(&self) -> bool {
        let (low, high) = self.bounds().unwrap_or_default();
        let center = low + (high - low) * 0.5;
        // Gauss's theorem: a third of the flux of the position.
        let volume = |surface: &Surface| {
            let outward = match &surface.shape {
                Shape::Sphere { radius, .. } => 4.0 * PI / 3.0 * radius.powi(3),
                // All points of a plane have the same part along its normal.
                shape => flat(shape).map_or(0.0, |(point, area)| (point - center).dot(area) / 3.0),
            };
            if surface.flip { -outward } else { outward }
        };
        self.surfaces.iter().map(volume).sum::<f64>() > 0.0
    }

    /// A camera for a scene that brings none: of some places inside, at eye height, and some around it, with everything in
    /// view but a wide ground, that from which most can be seen that is lit, by the sky where nothing shines. In a closed
    /// room it is one inside; about a solid that has no lamps, one outside. 640 x 400 pixels. Where the scene has cameras,
    /// it is the first one.
    #[must_use]
    pub fn default_camera(&self) -> Camera {
        if let Some((_, camera)) = self.cameras.first() {
            return *camera;
        }
        let sight = Sight::of(self);
        // Where only the sky gives light, solids are dark within, and meant to be seen from outside.
        let inside = if sight.has_lamps() || !self.is_solid() { self.inside(&sight) } else { Vec::new() };
        let candidates = inside.into_iter().chain(self.around());
        // The first of equals, so that those that are named first are preferred.
        let mut best: Option<(f64, Camera)> = None;
        for (worth, camera) in candidates {
            let worth = worth * sight.seen(&camera);
            if best.as_ref().is_none_or(|(most, _)| worth > *most) {
                best = Some((worth, camera));
            }
        }
        best.map_or_else(|| self.camera(DVec3::ONE, DVec3::ZERO, FIELDS[1]), |(_, camera)| camera)
    }

    fn camera(&self, eye: DVec3, target: DVec3, fov_x: f64) -> Camera {
        let up = self.up().to_array();
        Camera { eye: eye.to_array(), target: target.to_array(), up, fov_x, width: 640, height: 400 }
    }

    /// Views from places within the scene that have surfaces about them, and how much they are preferred.
    fn inside(&self, sight: &Sight<'_>) -> Vec<(f64, Camera)> {
        let (low, high) = self.bounds().unwrap_or_default();
        let up = self.up();
        let place = |across: f64, along: f64| {
            let share = if up == DVec3::Y {
                DVec3::new(across, EYE_HEIGHT, along)
            } else {
                DVec3::new(across, along, EYE_HEIGHT)
            };
            low + (high - low) * share
        };
        let within = if sight.has_lamps() { WITHIN } else { WITHIN_OPEN };
        let mut views = Vec::new();
        for eye in PLACES.iter().flat_map(|&across| PLACES.iter().map(move |&along| place(across, along))) {
            let ends: Vec<DVec3> = sphere_directions(64).filter_map(|d| Some(sight.wall(eye, d)? - eye)).collect();
            let share = ends.len() as f64 / 64.0;
            if share < within {
                continue;
            }
            let worth = if share >= CLOSED { INSIDE } else { 1.0 };
            let level = |d: DVec3| d - up * d.dot(up);
            let reach = ends.iter().map(|end| end.length()).sum::<f64>() / ends.len() as f64;
            // Toward the middle of what there is about the eye, or along it, a little down.
            let middle = level(ends.iter().sum::<DVec3>() / ends.len() as f64);
            let along = ends.iter().map(|end| level(*end)).max_by(|a, b| a.length().total_cmp(&b.length()));
            for ahead in along.into_iter().chain([middle]).filter(|ahead| ahead.length() > 0.1 * reach) {
                let target = eye + unit(ahead) * reach - up * (0.2 * reach);
                views.push((worth, self.camera(eye, target, FIELDS[0])));
            }
        }
        views
    }

    /// Views from outside, far enough for the bounding sphere of what there is to fit into the height of the picture, and
    /// how much they are preferred.
    fn around(&self) -> Vec<(f64, Camera)> {
        let whole = self.bounds().unwrap_or((-DVec3::ONE, DVec3::ONE));
        let subject = self.subject().unwrap_or(whole);
        let half_height = ((FIELDS[1].to_radians() * 0.5).tan() * 400.0 / 640.0).atan();
        let up = self.up();
        let mut views = Vec::new();
        for ((low, high), worth) in [(subject, 1.0), (whole, 0.8)] {
            let center = low + (high - low) * 0.5;
            let radius = ((high - low).length() * 0.5).max(f64::MIN_POSITIVE);
            let mut view = |worth: f64, [right, front, above]: [f64; 3]| {
                let side =
                    if up == DVec3::Y { DVec3::new(right, above, front) } else { DVec3::new(right, -front, above) };
                let eye = center + unit(side) * (radius / half_height.sin());
                views.push((worth, self.camera(eye, center, FIELDS[1])));
            };
            // A little above, from the front and from other sides; and if that shows little, level, into what is open
            // there, steeply, or from below.
            view(worth, [0.5, 0.8, 0.4]);
            for (less, height) in [(0.95, 0.4), (0.7, 0.05), (0.7, 1.5), (0.5, -0.4)] {
                for k in 0..8 {
                    let angle = TAU * f64::from(k) / 8.0;
                    view(less * worth, [angle.sin(), angle.cos(), height]);
                }
            }
        }
        views
    }

    /// Bounds of what is to be looked at: all but a ground or a sky that is far larger than what is there.
    fn subject(&self) -> Option<(DVec3, DVec3)> {
        let mut all: Vec<(DVec3, DVec3)> = self.surfaces.iter().map(|s| shape_bounds(&s.shape)).collect();
        let size = |(low, high): &(DVec3, DVec3)| (*high - *low).length();
        all.sort_by(|a, b| size(a).total_cmp(&size(b)));
        let mut bounds = *all.first()?;
        for next in &all[1..] {
            if size(next) > GROUND * size(&bounds) && size(&bounds) > 0.0 {
                break;
            }
            bounds = (bounds.0.min(next.0), bounds.1.max(next.1));
        }
        Some(bounds)
    }

    /// A closed walk of so many cameras, evenly spaced in distance walked and angle turned, all with the picture size of
    /// the first camera. Through the scene's cameras where there are two or more: Catmull and Rom's spline ("A class of
    /// local interpolating splines", 1974) for the eye, and for the view's heading and pitch, which cannot flip over as
    /// a moving target can. Otherwise a stroll about the only or the [default](Self::default_camera) camera: the eye
    /// runs on an ellipse that is free of obstacles, looking at the same target.
    #[must_use]
    pub fn walkthrough(&self, frames: usize) -> Vec<Camera> {
        if frames == 0 {
            return Vec::new();
        }
        let cameras: Vec<Camera> = if self.cameras.len() >= 2 {
            self.cameras.iter().map(|(_, camera)| *camera).collect()
        } else {
            self.stroll()
        };
        let up = self.up();
        let path = Path::new(&cameras, up);
        path.even(frames).into_iter().map(|t| path.at(t)).collect()
    }

    /// Cameras on an ellipse about the default camera.
    fn stroll(&self) -> Vec<Camera> {
        let camera = self.default_camera();
        let (right, above, forward) = camera.frame();
        let (eye, target) = (DVec3::from(camera.eye), DVec3::from(camera.target));
        let sight = Sight::of(self);
        let distance = (target - eye).length();
        let mut radius = STROLL * distance;
        let ring = |radius: f64| {
            (0..8).map(move |k| {
                let a = TAU * f64::from(k) / 8.0;
                // Beginning at the camera itself, to the side, a little ahead and up.
                let (side, ahead) = (a.sin(), 1.0 - a.cos());
                radius * (right * side + forward * (0.5 * ahead) + above * (0.1 * side))
            })
        };
        // As wide as there is room for, with a margin of a quarter.
        let free = |offset: DVec3| sight.distance(eye, unit(offset)) > 1.25 * offset.length();
        for _ in 0..12 {
            if ring(radius).all(|offset| offset == DVec3::ZERO || free(offset)) {
                break;
            }
            radius *= 0.7;
        }
        ring(radius).map(|offset| Camera { eye: (eye + offset).to_array(), ..camera }).collect()
    }
}

/// A closed walk through key cameras.
struct Path {
    keys: Vec<Key>,
    up: DVec3,
    /// Two unit vectors that span the ground.
    ground: [DVec3; 2],
    width: u32,
    height: u32,
}

/// One camera in the numbers that are interpolated.
#[derive(Clone, Copy)]
struct Key {
    eye: DVec3,
    /// Radians about `up`; the difference to the key before is in −π…π.
    heading: f64,
    /// Radians above the ground.
    pitch: f64,
    /// Distance to the target.
    reach: f64,
    fov_x: f64,
}

impl Path {
    /// `cameras` must not be empty.
    fn new(cameras: &[Camera], up: DVec3) -> Self {
        let x = unit(up.any_orthonormal_vector());
        let ground = [x, up.cross(x)];
        let mut heading = 0.0;
        let keys = cameras
            .iter()
            .map(|camera| {
                let view = DVec3::from(camera.target) - DVec3::from(camera.eye);
                let ahead = unit(view);
                let absolute = ahead.dot(ground[1]).atan2(ahead.dot(ground[0]));
                heading += wrapped(absolute - heading);
                // Not quite straight up or down, where there is no heading.
                let pitch = ahead.dot(up).clamp(-1.0, 1.0).asin().clamp(-1.55, 1.55);
                Key { eye: camera.eye.into(), heading, pitch, reach: view.length(), fov_x: camera.fov_x }
            })
            .collect();
        Self { keys, up, ground, width: cameras[0].width, height: cameras[0].height }
    }

    /// Key `k` of the endless path, whose heading goes on turning where one round is a full turn.
    fn key(&self, k: isize) -> Key {
        let n = self.keys.len() as isize;
        let first = self.keys[0];
        let last = self.keys[self.keys.len() - 1];
        let turn = last.heading + wrapped(first.heading - last.heading) - first.heading;
        let key = self.keys[k.rem_euclid(n) as usize];
        Key { heading: key.heading + turn * k.div_euclid(n) as f64, ..key }
    }

    /// The camera at `t` in 0…number of keys.
    fn at(&self, t: f64) -> Camera {
        let k = t.floor();
        let t = t - k;
        let [a, b, c, d] = [-1, 0, 1, 2].map(|i| self.key(k as isize + i));
        // Catmull-Rom weights, tension 1/2.
        let w = [
            ((2.0 - t) * t - 1.0) * t * 0.5,
            ((3.0 * t - 5.0) * t * t + 2.0) * 0.5,
            ((4.0 - 3.0 * t) * t + 1.0) * t * 0.5,
            (t - 1.0) * t * t * 0.5,
        ];
        let mix = |f: fn(&Key) -> f64| w[0] * f(&a) + w[1] * f(&b) + w[2] * f(&c) + w[3] * f(&d);
        // What must stay in range is not allowed to overshoot.
        let between = |f: fn(&Key) -> f64| mix(f).clamp(f(&b).min(f(&c)), f(&b).max(f(&c)));
        let eye = a.eye * w[0] + b.eye * w[1] + c.eye * w[2] + d.eye * w[3];
        let (heading, pitch) = (mix(|k| k.heading), between(|k| k.pitch));
        let level = self.ground[0] * heading.cos() + self.ground[1] * heading.sin();
        let ahead = level * pitch.cos() + self.up * pitch.sin();
        Camera {
            eye: eye.to_array(),
            target: (eye + ahead * between(|k| k.reach)).to_array(),
            up: self.up.to_array(),
            fov_x: between(|k| k.fov_x),
            width: self.width,
            height: self.height,
        }
    }

    /// Parameters that are evenly spaced in distance walked (relative to the keys' mean reach) plus angle turned.
    fn even(&self, frames: usize) -> Vec<f64> {
        const STEPS: usize = 64;
        let total_steps = self.keys.len() * STEPS;
        let reach = self.keys.iter().map(|k| k.reach).sum::<f64>() / self.keys.len() as f64;
        let view = |step: usize| {
            let camera = self.at(step as f64 / STEPS as f64);
            (DVec3::from(camera.eye), unit(DVec3::from(camera.target) - DVec3::from(camera.eye)))
        };
        let mut walked = Vec::with_capacity(total_steps + 1);
        walked.push(0.0);
        let (mut last, mut sum) = (view(0), 0.0);
        for step in 1..=total_steps {
            let now = view(step);
            sum += (now.0 - last.0).length() / reach + (now.1 - last.1).length();
            walked.push(sum);
            last = now;
        }
        (0..frames)
            .map(|frame| {
                let wanted = sum * frame as f64 / frames as f64;
                let step = walked.partition_point(|w| *w <= wanted).clamp(1, total_steps);
                let (a, b) = (walked[step - 1], walked[step]);
                let part = if b > a { (wanted - a) / (b - a) } else { 0.0 };
                ((step - 1) as f64 + part) / STEPS as f64
            })
            .collect()
    }
}

/// The same angle in −π…π.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// Evenly spread unit directions (Fibonacci's spiral).
fn sphere_directions(count: u32) -> impl Iterator<Item = DVec3> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |k| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
        let r = (1.0 - z * z).sqrt();
        let a = golden * f64::from(k);
        DVec3::new(r * a.cos(), r * a.sin(), z)
    })
}

/// Smallest and largest coordinates of some surfaces; `None` without any.
pub(crate) fn bounds_of<'a>(surfaces: impl IntoIterator<Item = &'a Surface>) -> Option<(DVec3, DVec3)> {
    surfaces.into_iter().map(|s| shape_bounds(&s.shape)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// Those of one, of curved ones other than spheres a little wide.
fn shape_bounds(shape: &Shape) -> (DVec3, DVec3) {
    let of = |points: &[DVec3], pad: f64| {
        let low = points.iter().copied().reduce(DVec3::min).unwrap_or_default();
        let high = points.iter().copied().reduce(DVec3::max).unwrap_or_default();
        (low - DVec3::splat(pad), high + DVec3::splat(pad))
    };
    match shape {
        Shape::Triangle(p) => of(p, 0.0),
        Shape::Quad(p) => of(p, 0.0),
        Shape::Sphere { center, radius } => of(&[*center], *radius),
        Shape::Cone { ends, radii } => of(ends, radii[0].max(radii[1])),
        Shape::Ring { center, outer, .. } => of(&[*center], *outer),
        Shape::Torus { center, major, minor, .. } => of(&[*center], major + minor),
    }
}

/// A point and area times normal, not flipped, of what is flat.
fn flat(shape: &Shape) -> Option<(DVec3, DVec3)> {
    match shape {
        Shape::Triangle([a, b, c]) => Some((*a, (*b - *a).cross(*c - *a) * 0.5)),
        Shape::Quad([a, b, c, d]) => Some((*a, (*c - *a).cross(*d - *b) * 0.5)),
        Shape::Ring { center, normal, inner, outer } => {
            Some((*center, *normal * (PI * (outer * outer - inner * inner))))
        }
        Shape::Sphere { .. } | Shape::Cone { .. } | Shape::Torus { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::tests::grey;
    use crate::{Material, builtin};
    use glossy_ext::Lambert;
    use std::sync::Arc;

    fn without_cameras(name: &str) -> Scene {
        let mut scene = builtin::scene(name).expect("a built-in scene");
        scene.cameras.clear();
        scene
    }

    fn object(shape: Shape) -> Scene {
        let materials = vec![grey("grey", true, 0.0)];
        Scene { name: "object.obj".into(), surfaces: vec![Surface::new(shape, 0)], materials, ..Scene::default() }
    }

    #[test]
    fn floors_tell_where_up_is() {
        assert_eq!(without_cameras("room").up(), DVec3::Z, "the room stands on the xy plane");
        assert_eq!(without_cameras("empty-room").up(), DVec3::Y, "this room stands on the xz plane");
        let mut file = without_cameras("room");
        file.name = "flat.GLB".into();
        assert_eq!(file.up(), DVec3::Y, "glTF says y");
        assert_eq!(builtin::scene("cornell").expect("there").up(), DVec3::Y, "the camera says y");
    }

    #[test]
    fn solids_stand_upright() {
        let cupboard = |ground: &[Surface]| {
            let faces = open_box(DVec3::ZERO, DVec3::new(2.0, 1.8, 0.6), &[]);
            let faces = faces.into_iter().map(|s| Surface { flip: true, ..s });
            let mut scene = lit(faces.chain(ground.iter().cloned()).collect());
            scene.name = "cupboard.obj".into();
            scene
        };
        assert_eq!(cupboard(&[]).up(), DVec3::Y, "its large doors are not its top");
        let inward = Scene { surfaces: open_box(DVec3::ZERO, DVec3::new(2.0, 1.8, 0.6), &[]), ..cupboard(&[]) };
        assert_eq!(inward.up(), DVec3::Z, "of a room, large walls are floor and ceiling");
        let [a, b, c, d] = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(x, y)| DVec3::new(x, y, -0.1));
        let ground = Surface::new(Shape::Quad([a, b, c, d]), 0);
        assert_eq!(cupboard(&[ground]).up(), DVec3::Z, "a ground tells");
    }

    #[test]
    fn default_camera_stands_inside_of_rooms_and_outside_of_objects() {
        for name in ["room", "empty-room", "furnace"] {
            let scene = without_cameras(name);
            let camera = scene.default_camera();
            camera.check(name).expect("usable");
            let (low, high) = scene.bounds().expect("surfaces");
            let eye = DVec3::from(camera.eye);
            assert!(eye.cmpgt(low).all() && eye.cmplt(high).all(), "{name}: {eye} is inside {low} {high}");
            let free = Sight::of(&scene).distance(eye, camera.frame().2);
            assert!(free > 0.1 * (high - low).length(), "{name}: {free} of free sight");
        }
        let mut dome = object(Shape::Sphere { center: DVec3::ZERO, radius: 5.0 });
        dome.surfaces[0].flip = true;
        let camera = dome.default_camera();
        camera.check("dome").expect("usable");
        let eye = DVec3::from(camera.eye);
        assert!(eye.length() < 5.0 && eye.with_y(0.0).length() > 2.0, "inside of a room without corners, aside: {eye}");
        let sphere = object(Shape::Sphere { center: DVec3::new(5.0, 6.0, 7.0), radius: 2.0 });
        let camera = sphere.default_camera();
        camera.check("object").expect("usable");
        let distance = (DVec3::from(camera.eye) - DVec3::new(5.0, 6.0, 7.0)).length();
        assert!(distance > 4.0 && distance < 40.0, "outside, not too far: {distance}");
    }

    /// A box of one-sided walls that face inward, without those named by their indices: −x, +x, −y, +y, −z, +z.
    fn open_box(low: DVec3, high: DVec3, without: &[usize]) -> Vec<Surface> {
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
            DVec3::new(pick(0), pick(1), pick(2))
        };
        let walls = [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];
        let wall = |w: [usize; 4]| Surface::new(Shape::Quad(w.map(corner)), 0);
        walls.into_iter().enumerate().filter(|(k, _)| !without.contains(k)).map(|(_, w)| wall(w)).collect()
    }

    /// A lamp that shines down, of side 2 `half`.
    fn lamp(center: DVec3, half: f64) -> Surface {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        Surface::new(Shape::Quad(corners.map(|(x, z)| center + DVec3::new(x, 0.0, z) * half)), 1)
    }

    fn lit(surfaces: Vec<Surface>) -> Scene {
        let materials = vec![grey("wall", false, 0.0), grey("lamp", false, 10.0)];
        Scene { name: "made.mgf".into(), surfaces, materials, ..Scene::default() }
    }

    #[test]
    fn default_cameras_show_what_is_lit() {
        let at = DVec3::new;
        let unit_box = |without: &[usize]| {
            let mut surfaces = open_box(DVec3::ZERO, at(4.0, 3.0, 5.0), without);
            surfaces.push(lamp(at(2.0, 2.9, 2.5), 0.5));
            surfaces
        };
        let tube = |length: f64| {
            let ends = [DVec3::ZERO, at(length, 0.0, 0.0)];
            let mantle = Surface { flip: true, ..Surface::new(Shape::Cone { ends, radii: [1.0; 2] }, 0) };
            vec![mantle, lamp(at(0.5 * length, 0.9, 0.0), 0.2)]
        };
        let heap = |extra: Vec<Surface>| {
            let balls = (0..3).map(|k| {
                let center = at(f64::from(k), 0.4, f64::from(k % 2));
                Surface::new(Shape::Sphere { center, radius: 0.4 }, 0)
            });
            balls.chain([lamp(at(1.0, 4.0, 0.5), 1.0)]).chain(extra).collect::<Vec<_>>()
        };
        let ground = |half: f64| {
            let corner = |x: f64, z: f64| at(x, 0.0, z) * half;
            let [a, b, c, d] = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
            [[a, b, c], [a, c, d]].map(|t| Surface::new(Shape::Triangle(t), 0)).to_vec()
        };
        let rooms = || {
            let far = |s: Surface| Surface {
                shape: match s.shape {
                    Shape::Quad(corners) => Shape::Quad(corners.map(|c| c + at(9.0, 0.0, 1.0))),
                    other => other,
                },
                ..s
            };
            let second = unit_box(&[]);
            unit_box(&[]).into_iter().chain(second.into_iter().map(far)).collect::<Vec<_>>()
        };
        let tiny = |surfaces: Vec<Surface>| {
            let small = |c: DVec3| at(100.0, 7.0, -3.0) + c * 1e-4;
            let shape = |s: Shape| match s {
                Shape::Quad(corners) => Shape::Quad(corners.map(small)),
                other => other,
            };
            surfaces.into_iter().map(|s| Surface { shape: shape(s.shape.clone()), ..s }).collect::<Vec<_>>()
        };
        // Least share of the picture that is to show something lit, near ones and lamps counting less.
        let cases = [
            ("a room", unit_box(&[]), 0.4),
            ("a room without front", unit_box(&[5]), 0.3),
            ("a room without back", unit_box(&[4]), 0.3),
            ("a room without a side", unit_box(&[0]), 0.3),
            ("a room without ceiling", unit_box(&[3]), 0.3),
            ("a tunnel", tube(12.0), 0.3),
            ("a ring", tube(1.0), 0.1),
            ("a long tunnel", tube(300.0), 0.02),
            ("a heap", heap(vec![]), 0.01),
            ("a heap on a ground", heap(ground(8.0)), 0.3),
            ("a heap on a huge ground", heap(ground(4000.0)), 0.3),
            ("rooms apart", rooms(), 0.4),
            ("a tiny room", tiny(unit_box(&[])), 0.4),
        ];
        for (name, surfaces, least) in cases {
            let scene = lit(surfaces);
            let camera = scene.default_camera();
            camera.check(name).expect("usable");
            let seen = Sight::of(&scene).seen(&camera);
            assert!(seen >= least, "{name}: {seen} of {camera:?}");
        }
        let along = lit(tube(300.0)).default_camera().frame().2.x.abs();
        assert!(along > 0.6, "along the tunnel rather than at its wall: {along}");
        // The balls of the heap are not lost on the ground: they are 2 m wide.
        let eye = DVec3::from(lit(heap(ground(4000.0))).default_camera().eye);
        assert!(eye.length() < 30.0, "near the balls: {eye}");
    }

    /// What stands in the open is looked at from where the sky lights it: a bowl from outside, a yard from inside.
    #[test]
    fn without_lamps_the_sky_is_the_lamp() {
        let at = DVec3::new;
        let dark = |surfaces: Vec<Surface>| Scene {
            name: "made.obj".into(),
            surfaces,
            materials: vec![grey("wall", true, 0.0)],
            ..Scene::default()
        };
        // Walls that face inward and, a little outside of them, outward.
        let walls = |low: DVec3, high: DVec3, without: &[usize]| {
            let outside = open_box(low - DVec3::splat(0.1), high + DVec3::splat(0.1), without);
            let outside = outside.into_iter().map(|s| Surface { flip: true, ..s });
            open_box(low, high, without).into_iter().chain(outside).collect::<Vec<_>>()
        };
        let within = |scene: &Scene| {
            let (low, high) = scene.bounds().expect("surfaces");
            let eye = DVec3::from(scene.default_camera().eye);
            eye.cmpgt(low).all() && eye.cmplt(high).all()
        };
        let open = dark(walls(DVec3::ZERO, at(1.0, 0.3, 0.7), &[3]));
        assert!(!within(&open), "a tray is looked at from outside: {:?}", open.default_camera());
        let deep = dark(walls(DVec3::ZERO, at(1.0, 5.0, 1.0), &[3]));
        assert!(!within(&deep), "so is a bin: {:?}", deep.default_camera());
        let closed = dark(walls(DVec3::ZERO, at(1.0, 1.5, 0.7), &[]));
        assert!(!within(&closed), "a cupboard is dark inside: {:?}", closed.default_camera());
        let yard = dark(open_box(DVec3::ZERO, at(10.0, 10.0, 10.0), &[3]));
        let yard = Scene { materials: vec![grey("wall", false, 0.0)], ..yard };
        assert!(within(&yard), "a yard is looked at from inside: {:?}", yard.default_camera());
    }

    #[test]
    fn default_cameras_look_away_from_what_is_black() {
        let mut surfaces = open_box(DVec3::ZERO, DVec3::new(4.0, 3.0, 4.0), &[]);
        surfaces.push(lamp(DVec3::new(2.0, 2.9, 2.0), 0.5));
        let mut scene = lit(surfaces);
        scene.materials.push(Material { reflector: Arc::new(Lambert::BLACK), ..grey("black", false, 0.0) });
        let before = scene.default_camera().frame().2;
        for wall in [0, 1, 4, 5] {
            let mut blackened = scene.clone();
            blackened.surfaces[wall].material = 2;
            let Shape::Quad(corners) = blackened.surfaces[wall].shape else { continue };
            let middle = corners.iter().sum::<DVec3>() / 4.0;
            let camera = blackened.default_camera();
            let toward = unit(middle - DVec3::from(camera.eye)).dot(camera.frame().2);
            assert!(toward < 0.6, "wall {wall}: {toward} toward it, {before} when it was grey");
        }
    }

    #[test]
    fn nobody_stands_inside_of_closed_things_that_light_does_not_enter() {
        // Two-sided walls, and the lamp outside.
        let mut surfaces = open_box(DVec3::ZERO, DVec3::ONE, &[]);
        surfaces.push(lamp(DVec3::new(0.5, 4.0, 0.5), 1.0));
        let mut scene = lit(surfaces);
        scene.materials[0].two_sided = true;
        let eye = DVec3::from(scene.default_camera().eye);
        assert!(eye.cmplt(DVec3::ZERO).any() || eye.cmpgt(DVec3::ONE).any(), "outside: {eye}");
    }

    #[test]
    fn walks_are_closed_even_and_usable() {
        let mut single = builtin::scene("cornell").expect("there");
        single.cameras.truncate(1);
        let sphere = object(Shape::Sphere { center: DVec3::ZERO, radius: 1.0 });
        let scenes = builtin::NAMES.iter().map(|n| builtin::scene(n).expect("there")).chain([
            single,
            without_cameras("room"),
            sphere,
        ]);
        for scene in scenes {
            let name = &scene.name;
            let walk = scene.walkthrough(240);
            assert_eq!(walk.len(), 240, "{name}");
            let first = scene.default_camera();
            let off = (DVec3::from(walk[0].eye) - DVec3::from(first.eye)).length();
            assert!(off < 1e-9, "{name}: begins at the first camera");
            let (mut steps, mut reach) = (Vec::new(), 0.0_f64);
            for (a, b) in walk.iter().zip(walk.iter().cycle().skip(1)) {
                a.check(name).expect("usable");
                let view = |c: &Camera| DVec3::from(c.target) - DVec3::from(c.eye);
                reach = reach.max(view(a).length());
                steps.push((
                    (DVec3::from(a.eye) - DVec3::from(b.eye)).length(),
                    (unit(view(a)) - unit(view(b))).length(),
                ));
            }
            for (moved, turned) in steps {
                // 240 frames for a round: no frame leaps farther than a few times the mean.
                assert!(moved < 0.1 * reach && turned < 0.12, "{name}: smooth: {moved} of {reach}, {turned}");
            }
        }
    }

    #[test]
    fn the_walk_through_the_room_touches_nothing() {
        let scene = builtin::scene("room").expect("there");
        let sight = Sight::of(&scene);
        for (k, camera) in scene.walkthrough(60).iter().enumerate() {
            let free = sphere_directions(200).map(|d| sight.distance(camera.eye.into(), d)).fold(9.0, f64::min);
            assert!(free > 0.3, "frame {k}: {free} m to the nearest surface");
        }
    }

    #[test]
    fn walks_without_cameras_stay_inside() {
        for name in ["room", "empty-room"] {
            let scene = without_cameras(name);
            let (low, high) = scene.bounds().expect("surfaces");
            let walk = scene.walkthrough(100);
            let eyes = walk.iter().map(|c| DVec3::from(c.eye));
            assert!(eyes.clone().all(|e| e.cmpgt(low).all() && e.cmplt(high).all()), "{name}: within the walls");
            let spread = eyes.clone().map(|e| (e - DVec3::from(walk[0].eye)).length()).fold(0.0, f64::max);
            assert!(spread > 0.05 * (high - low).length(), "{name}: it does move: {spread}");
        }
        assert!(builtin::scene("room").expect("there").walkthrough(0).is_empty(), "no frames, no cameras");
    }

    #[test]
    fn a_walk_never_looks_through_its_own_eye() {
        // Two cameras that look at each other: a spline of targets would pass through the eye.
        let mut scene = builtin::scene("furnace").expect("there");
        let camera = scene.cameras[0].1;
        scene.cameras = vec![
            ("a".into(), Camera { eye: [-0.5, 0.0, 0.0], target: [0.5, 0.0, 0.0], ..camera }),
            ("b".into(), Camera { eye: [0.5, 0.0, 0.0], target: [-0.5, 0.0, 0.0], ..camera }),
        ];
        for camera in scene.walkthrough(64) {
            camera.check("walk").expect("usable");
            let reach = (DVec3::from(camera.target) - DVec3::from(camera.eye)).length();
            assert!((reach - 1.0).abs() < 1e-9, "the target stays a metre away: {reach}");
        }
    }
}

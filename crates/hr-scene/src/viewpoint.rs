//! Where to stand and where to walk in a scene: a camera for files without one, and the walkthrough's path.

use crate::camera::unit;
use crate::{Camera, Rgb, Scene};
use glam::DVec3;
use hr_diffuse::{Shape, Surface};
use std::f64::consts::{PI, TAU};

/// Eye height as a share of a room's height: 1.6 m of 2.6 m.
const EYE_HEIGHT: f64 = 0.62;
/// How far from the corner of a room its default camera stands, as a share of length and width.
const CORNER_INSET: f64 = 0.14;
/// Shares of length and width at which a place inside of a room is looked for.
const PLACES: [f64; 5] = [0.5, 0.32, 0.68, 0.15, 0.85];
/// Share of all directions that must end on a surface for a scene to count as a closed room.
const CLOSED: f64 = 0.9;
/// Rays are cast against so many of the largest surfaces at most: those that walls are made of.
const MAX_OCCLUDERS: usize = 20_000;
/// Radius of the walk about a single camera, as a share of the distance to what it looks at.
const STROLL: f64 = 0.3;

impl Scene {
    /// Smallest and largest coordinates of the surfaces; `None` without any. Exact for polygons and spheres, a little
    /// wide for other curved surfaces.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.surfaces.iter().map(|s| shape_bounds(&s.shape)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Which way is up: that of the first camera; else +y for glTF files, which say so; else (MGF, OBJ: their files do
    /// not tell) +y or +z, whichever has more floor and ceiling, that is, polygon area facing along it.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        if let Some((_, camera)) = self.cameras.first() {
            return unit(camera.up.into());
        }
        let name = self.name.to_lowercase();
        if name.ends_with(".gltf") || name.ends_with(".glb") {
            return DVec3::Y;
        }
        let (mut y, mut z) = (0.0, 0.0);
        for surface in &self.surfaces {
            let area = match &surface.shape {
                Shape::Triangle([a, b, c]) => (*b - *a).cross(*c - *a) * 0.5,
                Shape::Quad([a, b, c, d]) => (*c - *a).cross(*d - *b) * 0.5,
                Shape::Ring { normal, inner, outer, .. } => *normal * (PI * (outer * outer - inner * inner)),
                Shape::Sphere { .. } | Shape::Cone { .. } | Shape::Torus { .. } => continue,
            };
            // Only what faces along an axis: slopes and rounded things tell nothing.
            let facing = area.abs() / area.length();
            y += if facing.y > 0.95 { area.length() } else { 0.0 };
            z += if facing.z > 0.95 { area.length() } else { 0.0 };
        }
        if y >= z { DVec3::Y } else { DVec3::Z }
    }

    /// A camera for a scene that brings none: in a closed room at eye height near the corner with the widest view,
    /// looking to the middle; otherwise from outside, with everything in view. 640 x 400 pixels. Where the scene has
    /// cameras, it is the first one.
    #[must_use]
    pub fn default_camera(&self) -> Camera {
        if let Some((_, camera)) = self.cameras.first() {
            return *camera;
        }
        let up = self.up();
        let (low, high) = self.bounds().unwrap_or((-DVec3::ONE, DVec3::ONE));
        let center = low + (high - low) * 0.5;
        let camera = |eye: DVec3, target: DVec3, fov_x| Camera {
            eye: eye.to_array(),
            target: target.to_array(),
            up: up.to_array(),
            fov_x,
            width: 640,
            height: 400,
        };
        let occluders = self.occluders();
        // Height along `up`, the rest across.
        let at = |share: DVec3| low + (high - low) * share;
        let place = |across: [f64; 2], height: f64| {
            at(if up == DVec3::Y {
                DVec3::new(across[0], height, across[1])
            } else {
                DVec3::new(across[0], across[1], height)
            })
        };
        let inside = |p: &DVec3| {
            let hits = sphere_directions(64).filter(|d| self.is_wall(occluders.nearest(*p, *d))).count();
            hits as f64 >= CLOSED * 64.0
        };
        // Rooms are not always boxes: the middle is the place inside that is nearest to the middle of all.
        let mut places: Vec<[f64; 2]> =
            PLACES.into_iter().flat_map(|across| PLACES.map(|along| [across, along])).collect();
        let off = |p: &[f64; 2]| (p[0] - 0.5).abs().max((p[1] - 0.5).abs());
        places.sort_by(|a, b| off(a).total_cmp(&off(b)));
        if let Some(middle) = places.iter().copied().find(|&p| inside(&place(p, EYE_HEIGHT))) {
            let target = place(middle, 0.4);
            let view = |eye: &DVec3| {
                // Free sight along some directions about the middle: a cupboard before the eye shows nothing.
                let ahead = unit(target - *eye);
                let free = |d: DVec3| occluders.distance(*eye, d).min((high - low).length());
                sphere_directions(32).map(|d| free(unit(ahead + 0.6 * d))).sum::<f64>()
            };
            let near = CORNER_INSET;
            let far = 1.0 - near;
            let corners = [[near, near], [far, near], [near, far], [far, far]].map(|c| place(c, EYE_HEIGHT));
            let best = corners.into_iter().filter(inside).max_by(|a, b| view(a).total_cmp(&view(b)));
            // Rooms without corners: the place that is farthest from the middle.
            let aside = || places.iter().rev().filter(|p| **p != middle).map(|p| place(*p, EYE_HEIGHT)).find(inside);
            if let Some(eye) = best.or_else(aside) {
                return camera(eye, target, 70.0);
            }
        }
        // Outside, a little above, far enough for the bounding sphere to fit into the height of the picture.
        let fov_x = 45.0_f64;
        let half_height = ((fov_x.to_radians() * 0.5).tan() * 400.0 / 640.0).atan();
        let radius = ((high - low).length() * 0.5).max(f64::MIN_POSITIVE);
        let side = if up == DVec3::Y { DVec3::new(0.5, 0.4, 0.8) } else { DVec3::new(0.5, -0.8, 0.4) };
        camera(center + unit(side) * (radius / half_height.sin()), center, fov_x)
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

    /// Whether what a ray from the middle hit speaks for a room around it: the front of a surface, or the back of a
    /// two-sided one where there is light. Otherwise it is the inside of a solid.
    fn is_wall(&self, hit: Option<Hit>) -> bool {
        let lit = || !self.lights.is_empty() || self.materials.iter().any(|m| m.exitance != Rgb::ZERO);
        hit.is_some_and(|h| {
            let two_sided = self.materials.get(h.surface.material as usize).is_some_and(|m| m.two_sided);
            h.front || two_sided && lit()
        })
    }

    /// Cameras on an ellipse about the default camera.
    fn stroll(&self) -> Vec<Camera> {
        let camera = self.default_camera();
        let (right, above, forward) = camera.frame();
        let (eye, target) = (DVec3::from(camera.eye), DVec3::from(camera.target));
        let occluders = self.occluders();
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
        let free = |offset: DVec3| occluders.distance(eye, unit(offset)) > 1.25 * offset.length();
        for _ in 0..12 {
            if ring(radius).all(|offset| offset == DVec3::ZERO || free(offset)) {
                break;
            }
            radius *= 0.7;
        }
        ring(radius).map(|offset| Camera { eye: (eye + offset).to_array(), ..camera }).collect()
    }

    /// The largest surfaces, for rays that ask for walls.
    fn occluders(&self) -> Occluders<'_> {
        let mut surfaces: Vec<&Surface> = self.surfaces.iter().collect();
        if surfaces.len() > MAX_OCCLUDERS {
            let size = |s: &Surface| {
                let (low, high) = shape_bounds(&s.shape);
                (high - low).length()
            };
            surfaces.sort_by(|a, b| size(b).total_cmp(&size(a)));
            surfaces.truncate(MAX_OCCLUDERS);
        }
        Occluders(surfaces)
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

/// Surfaces that stop rays.
struct Occluders<'a>(Vec<&'a Surface>);

/// What a ray meets first.
struct Hit<'a> {
    surface: &'a Surface,
    distance: f64,
    /// Whether it meets the front.
    front: bool,
}

impl<'a> Occluders<'a> {
    /// Distance along a unit direction to the nearest surface; infinite where there is none.
    fn distance(&self, origin: DVec3, direction: DVec3) -> f64 {
        self.nearest(origin, direction).map_or(f64::INFINITY, |hit| hit.distance)
    }

    /// The nearest surface along a unit direction. Cones and tori are passed through: nobody builds a wall of them.
    fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<Hit<'a>> {
        let mut nearest: Option<Hit<'a>> = None;
        for &surface in &self.0 {
            let (distance, front) = match &surface.shape {
                Shape::Triangle(p) => polygon_hit(p, origin, direction),
                Shape::Quad(p) => polygon_hit(p, origin, direction),
                Shape::Sphere { center, radius } => {
                    let to = *center - origin;
                    let (middle, gap) = (to.dot(direction), to.length_squared() - radius * radius);
                    let half = (middle * middle - gap).sqrt();
                    let outside = gap > 0.0;
                    (if outside { middle - half } else { middle + half }, outside)
                }
                Shape::Ring { center, normal, inner, outer } => {
                    let t = (*center - origin).dot(*normal) / direction.dot(*normal);
                    let r = (origin + direction * t - *center).length();
                    (if (*inner..=*outer).contains(&r) { t } else { f64::INFINITY }, direction.dot(*normal) < 0.0)
                }
                Shape::Cone { .. } | Shape::Torus { .. } => continue,
            };
            // False for NaN too: no hit.
            if distance > 0.0 && distance < nearest.as_ref().map_or(f64::INFINITY, |hit| hit.distance) {
                nearest = Some(Hit { surface, distance, front: front != surface.flip });
            }
        }
        nearest
    }
}

/// Distance to a convex polygon (NaN or infinity where the ray passes it), and whether the ray comes from its front.
fn polygon_hit(corners: &[DVec3], origin: DVec3, direction: DVec3) -> (f64, bool) {
    let (mut inside, mut outside) = (true, true);
    let mut last = corners[corners.len() - 1] - origin;
    for corner in corners {
        let next = *corner - origin;
        let side = last.cross(next).dot(direction);
        inside &= side >= 0.0;
        outside &= side <= 0.0;
        last = next;
    }
    if !inside && !outside {
        return (f64::INFINITY, false);
    }
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let toward = direction.dot(normal);
    ((corners[0] - origin).dot(normal) / toward, toward < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin;
    use crate::builtin::tests::grey;

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
    fn default_camera_stands_inside_of_rooms_and_outside_of_objects() {
        for name in ["room", "empty-room", "furnace"] {
            let scene = without_cameras(name);
            let camera = scene.default_camera();
            camera.check(name).expect("usable");
            let (low, high) = scene.bounds().expect("surfaces");
            let eye = DVec3::from(camera.eye);
            assert!(eye.cmpgt(low).all() && eye.cmplt(high).all(), "{name}: {eye} is inside {low} {high}");
            let free = scene.occluders().distance(eye, camera.frame().2);
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
        let occluders = scene.occluders();
        for (k, camera) in scene.walkthrough(60).iter().enumerate() {
            let free = sphere_directions(200).map(|d| occluders.distance(camera.eye.into(), d)).fold(9.0, f64::min);
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

//! Surfaces of revolution: sphere, cone, cylinder, ring, disk and torus are one map with two kinds of profile.
//!
//! P(u, v) = c + ρ(v)(x cos 2πu + y sin 2πu) + h(v) z, with the profile (ρ, h) a straight line or a circle's arc.
//! Closed forms for area, bounds and normals follow from the profile alone.

use super::roots::roots_between;
use super::{Aabb, Domain, GeometryError, Normalization};
use crate::Cone;
use glam::{DVec2, DVec3, Vec2, Vec3, vec2};
use smallvec::SmallVec;
use std::f32::consts::TAU;

/// What rounding may do to the cosine between a normal computed in f32 and the axis of a cone.
const COSINE_SLACK: f32 = 1e-6;

/// Hits this far (unit space, along the profile) beyond the end of a profile still count, so that no ray slips
/// through where two surfaces abut: the rounding of positions to f32.
const RIM: f64 = 2e-7;

/// A line misses a ball of radius R (unit space) if it passes farther than √(`BALL_GROWTH` R² + `BALL_SLACK` (1 + l²)) from its centre,
/// l the distance of the ray's origin: (R + e)² ≤ (1 + δ) R² + (1 + 1/δ) e², where rounding in f32 and [`RIM`] come to e² ≤ 3e-13 (1 + l²).
const BALL_GROWTH: f32 = 1.05;
const BALL_SLACK: f32 = 7e-12;

/// A profile curve (ρ, h), v running 0…1: distance from the axis and height along it, in unit space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Profile {
    /// A straight line between two points: cone, cylinder, ring.
    Line {
        /// (ρ, h) at v = 0.
        from: Vec2,
        /// (ρ, h) at v = 1.
        to: Vec2,
    },
    /// An arc about (ρ = `center`, h = 0): sphere, torus.
    Arc {
        /// Distance of the arc's centre from the axis; 0 for a sphere.
        center: f32,
        /// Radius of the arc.
        radius: f32,
        /// Angle at v = 0 in full turns, from the outward direction toward the axis of rotation.
        start: f32,
        /// Angle that the arc sweeps, in full turns.
        sweep: f32,
    },
}

impl Profile {
    /// Height of the centre, and radius, of a ball that holds the surface.
    fn ball(&self) -> (f32, f32) {
        match *self {
            Self::Line { from, to } => (0.5 * (from.y + to.y), (0.5 * (to.y - from.y)).hypot(from.x.max(to.x))),
            Self::Arc { center, radius, .. } => (0.0, center + radius),
        }
    }
}

/// A surface of revolution in unit space.
#[derive(Clone, Debug, PartialEq)]
pub struct Revolution {
    center: Vec3,
    /// Orthonormal; z is the axis.
    frame: [Vec3; 3],
    profile: Profile,
    /// 1 or −1: the front is left or right of the profile's direction.
    side: f32,
    /// Centre and radius of a ball that holds all of it.
    ball: (Vec3, f32),
}

impl Revolution {
    pub(super) fn sphere(
        center: DVec3,
        radius: f64,
        flip: bool,
        normalization: &Normalization,
    ) -> Result<Self, GeometryError> {
        let radius = positive("the radius of a sphere", radius, normalization)?;
        let profile = Profile::Arc { center: 0.0, radius, start: 0.25, sweep: -0.5 };
        Self::new(center, DVec3::Z, profile, flip, normalization)
    }

    pub(super) fn cone(
        ends: [DVec3; 2],
        radii: [f64; 2],
        flip: bool,
        normalization: &Normalization,
    ) -> Result<Self, GeometryError> {
        if !ends.iter().all(|p| p.is_finite()) || !radii.iter().all(|r| r.is_finite()) {
            return Err(GeometryError::NonFinite);
        }
        for value in radii {
            if value < 0.0 {
                return Err(GeometryError::Radius { what: "a radius of a cone", value, range: "0 or more" });
            }
        }
        if radii == [0.0; 2] {
            return Err(GeometryError::NoArea("cone"));
        }
        let axis = ends[1] - ends[0];
        let height = (axis.length() * normalization.scale()) as f32;
        let radii = radii.map(|r| (r * normalization.scale()) as f32);
        let profile = Profile::Line { from: vec2(radii[0], 0.0), to: vec2(radii[1], height) };
        if height == 0.0 {
            return Err(if axis == DVec3::ZERO {
                GeometryError::NoDirection("the axis of a cone (a ring has none)")
            } else {
                GeometryError::Vanishing
            });
        }
        Self::new(ends[0], axis, profile, flip, normalization)
    }

    pub(super) fn ring(
        center: DVec3,
        normal: DVec3,
        [inner, outer]: [f64; 2],
        flip: bool,
        normalization: &Normalization,
    ) -> Result<Self, GeometryError> {
        if !inner.is_finite() {
            return Err(GeometryError::NonFinite);
        }
        let to = positive("the outer radius of a ring", outer, normalization)?;
        if inner < 0.0 {
            return Err(GeometryError::Radius { what: "the inner radius of a ring", value: inner, range: "0 or more" });
        }
        let range = "greater than the inner radius";
        if inner >= outer {
            return Err(GeometryError::Radius { what: "the outer radius of a ring", value: outer, range });
        }
        let from = (inner * normalization.scale()) as f32;
        let profile = Profile::Line { from: vec2(from, 0.0), to: vec2(to, 0.0) };
        if from >= to {
            return Err(GeometryError::Vanishing);
        }
        // Outward along the ring, "up" is to the left: the other side than on a cone.
        Self::new(center, normal, profile, !flip, normalization)
    }

    pub(super) fn torus(
        center: DVec3,
        axis: DVec3,
        [major, minor]: [f64; 2],
        flip: bool,
        normalization: &Normalization,
    ) -> Result<Self, GeometryError> {
        if !major.is_finite() {
            return Err(GeometryError::NonFinite);
        }
        let radius = positive("the minor radius of a torus", minor, normalization)?;
        if minor >= major {
            let range = "less than the major radius";
            return Err(GeometryError::Radius { what: "the minor radius of a torus", value: minor, range });
        }
        let ring = (major * normalization.scale()) as f32;
        let profile = Profile::Arc { center: ring, radius, start: 0.0, sweep: 1.0 };
        Self::new(center, axis, profile, flip, normalization)
    }

    fn new(
        center: DVec3,
        axis: DVec3,
        profile: Profile,
        flip: bool,
        normalization: &Normalization,
    ) -> Result<Self, GeometryError> {
        let unit_center = normalization.to_unit(center);
        if !unit_center.is_finite() || !axis.is_finite() {
            return Err(GeometryError::NonFinite);
        }
        // Scaled first, so that the length neither over- nor underflows.
        let largest = axis.abs().max_element();
        if largest == 0.0 {
            return Err(GeometryError::NoDirection("an axis or normal"));
        }
        let z = (axis / largest).normalize();
        let (x, y) = z.any_orthonormal_pair();
        let side = if flip { -1.0 } else { 1.0 };
        let frame = [x, y, z].map(|v| v.as_vec3());
        let (height, radius) = profile.ball();
        let ball = (unit_center + frame[2] * height, radius);
        let surface = Self { center: unit_center, frame, profile, side, ball };
        let area = surface.domain_area(Domain::WHOLE);
        if area < f32::MIN_POSITIVE {
            return Err(GeometryError::Vanishing);
        }
        if !area.is_finite() {
            return Err(GeometryError::NonFinite);
        }
        Ok(surface)
    }

    /// The profile.
    #[must_use]
    pub fn profile(&self) -> Profile {
        self.profile
    }

    /// The profile's origin: a point on the axis.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        self.center
    }

    /// Unit direction of the axis.
    #[must_use]
    pub fn axis(&self) -> Vec3 {
        self.frame[2]
    }

    /// The least coordinate of the whole surface along a unit direction.
    pub(super) fn lowest(&self, direction: Vec3) -> f32 {
        let along = direction.dot(self.axis());
        let across = (1.0 - along * along).max(0.0).sqrt();
        let below = match self.profile {
            Profile::Line { from, to } => (along * from.y - across * from.x).min(along * to.y - across * to.x),
            Profile::Arc { center, radius, .. } => -across * center - radius,
        };
        direction.dot(self.center) + below
    }

    pub(super) fn is_flat(&self) -> bool {
        matches!(self.profile, Profile::Line { from, to } if from.y == to.y)
    }

    /// (ρ, h) at v.
    fn profile_point(&self, v: f32) -> Vec2 {
        match self.profile {
            Profile::Line { from, to } => from * (1.0 - v) + to * v,
            Profile::Arc { center, radius, start, sweep } => {
                let (cos, sin) = cos_sin_turns(start + sweep * v);
                vec2(center + radius * cos, radius * sin)
            }
        }
    }

    /// Angle of the profile's normal in full turns, on the outer side, at v.
    fn profile_normal(&self, v: f32) -> f32 {
        match self.profile {
            Profile::Line { from, to } => {
                let along = to - from;
                (-along.x).atan2(along.y) / TAU
            }
            Profile::Arc { start, sweep, .. } => start + sweep * v,
        }
    }

    /// Length of the profile.
    fn profile_length(&self) -> f32 {
        match self.profile {
            Profile::Line { from, to } => from.distance(to),
            Profile::Arc { radius, sweep, .. } => TAU * radius * sweep.abs(),
        }
    }

    /// Combines an angle around the axis with components away from it and along it.
    fn turn(&self, u: f32, radial: f32, axial: f32) -> Vec3 {
        let [x, y, z] = self.frame;
        let (cos, sin) = cos_sin_turns(u);
        (x * cos + y * sin) * radial + z * axial
    }

    pub(super) fn point(&self, uv: Vec2) -> Vec3 {
        let profile = self.profile_point(uv.y);
        self.center + self.turn(uv.x, profile.x, profile.y)
    }

    pub(super) fn normal(&self, uv: Vec2) -> Vec3 {
        self.point_and_normal(uv).1
    }

    /// Both at the cost of one.
    pub(super) fn point_and_normal(&self, uv: Vec2) -> (Vec3, Vec3) {
        let (profile, (radial, axial)) = match self.profile {
            Profile::Line { from, to } => {
                let along = (to - from).normalize();
                (self.profile_point(uv.y), (along.y, -along.x))
            }
            Profile::Arc { center, radius, .. } => {
                let (cos, sin) = cos_sin_turns(self.profile_normal(uv.y));
                (vec2(center + radius * cos, radius * sin), (cos, sin))
            }
        };
        let [x, y, z] = self.frame;
        let (cos, sin) = cos_sin_turns(uv.x);
        let away = x * cos + y * sin;
        let point = self.center + (away * profile.x + z * profile.y);
        (point, away * (self.side * radial) + z * (self.side * axial))
    }

    pub(super) fn jacobian(&self, uv: Vec2) -> f32 {
        TAU * self.profile_point(uv.y).x * self.profile_length()
    }

    /// Point, unit front normal and Jacobian at (u, v) in double precision.
    pub(super) fn place(&self, uv: DVec2) -> (DVec3, DVec3, f64) {
        let full = std::f64::consts::TAU;
        let [x, y, z] = self.frame.map(|v| v.as_dvec3());
        let (sin, cos) = (uv.x * full).sin_cos();
        let away = x * cos + y * sin;
        let (profile, normal, length) = match self.profile {
            Profile::Line { from, to } => {
                let (from, to) = (from.as_dvec2(), to.as_dvec2());
                let along = to - from;
                (from + along * uv.y, DVec2::new(along.y, -along.x) / along.length(), along.length())
            }
            Profile::Arc { center, radius, start, sweep } => {
                let (sweep, radius) = (f64::from(sweep), f64::from(radius));
                let (sin, cos) = ((f64::from(start) + sweep * uv.y) * full).sin_cos();
                let normal = DVec2::new(cos, sin);
                (DVec2::new(f64::from(center), 0.0) + normal * radius, normal, full * radius * sweep.abs())
            }
        };
        let point = self.center.as_dvec3() + away * profile.x + z * profile.y;
        let front = (away * normal.x + z * normal.y) * f64::from(self.side);
        (point, front.normalize(), full * profile.x.abs() * length)
    }

    /// Share of a full turn that a part goes around the axis and around the profile's centre.
    pub(super) fn turns(&self, domain: Domain) -> (f32, f32) {
        let along = match self.profile {
            Profile::Line { .. } => 0.0,
            Profile::Arc { sweep, .. } => (domain.v1 - domain.v0) * sweep.abs(),
        };
        (domain.u1 - domain.u0, along)
    }

    /// Lengths of a part along u (where it is longest of both ends and the middle) and v.
    pub(super) fn extent(&self, domain: Domain) -> (f32, f32) {
        let Domain { u0, v0, u1, v1 } = domain;
        let radius = [v0, 0.5 * (v0 + v1), v1].into_iter().map(|v| self.profile_point(v).x).fold(0.0, f32::max);
        (TAU * (u1 - u0) * radius, (v1 - v0) * self.profile_length())
    }

    pub(super) fn domain_area(&self, domain: Domain) -> f32 {
        // The theorem of Pappus: the angle times the integral of ρ along the profile.
        let Domain { u0, v0, u1, v1 } = domain;
        let integral = match self.profile {
            Profile::Line { .. } => {
                let radius = 0.5 * (self.profile_point(v0).x + self.profile_point(v1).x);
                radius * (v1 - v0) * self.profile_length()
            }
            Profile::Arc { center, radius, start, sweep } => {
                // sin b − sin a without cancellation.
                let (half, middle) = (0.5 * sweep * (v1 - v0), start + 0.5 * sweep * (v0 + v1));
                let sines = 2.0 * cos_sin_turns(middle).0 * cos_sin_turns(half).1;
                radius * (center * TAU * 2.0 * half + radius * sines).abs()
            }
        };
        TAU * (u1 - u0) * integral
    }

    /// Parameters in a part for two numbers in 0…1.
    pub(super) fn sample(&self, domain: Domain, s: f32, t: f32) -> Vec2 {
        let Domain { v0, v1, .. } = domain;
        let uv = domain.lerp(s, t);
        let v = match self.profile {
            // The area up to a radius grows with the radius' square.
            Profile::Line { .. } => {
                let (a, b) = (self.profile_point(v0).x, self.profile_point(v1).x);
                let radius = (a * a + (b * b - a * a) * t).max(0.0).sqrt();
                let share = if radius + a > 0.0 { (a + b) * t / (radius + a) } else { 0.0 };
                v0 + (v1 - v0) * share.min(1.0)
            }
            // Archimedes: the area up to a polar angle θ grows with 1 − cos θ = 2 sin²(θ/2).
            Profile::Arc { center: 0.0, .. } => {
                let square = |v: f32| (0.5 * std::f64::consts::PI * f64::from(v)).sin().powi(2);
                let (a, b) = (square(v0), square(v1));
                let sine = (a + (b - a) * f64::from(t)).clamp(0.0, 1.0).sqrt();
                ((sine.asin() / (0.5 * std::f64::consts::PI)) as f32).clamp(v0, v1)
            }
            Profile::Arc { .. } => uv.y,
        };
        vec2(uv.x, v)
    }

    /// The area that parameters of [`sample`](Self::sample) stand for.
    pub(super) fn sample_weight(&self, domain: Domain, uv: Vec2) -> f32 {
        match self.profile {
            Profile::Arc { center, .. } if center != 0.0 => self.jacobian(uv) * domain.rectangle(),
            _ => self.domain_area(domain),
        }
    }

    pub(super) fn domain_bounds(&self, domain: Domain) -> Aabb {
        let Domain { u0, v0, u1, v1 } = domain;
        let [x, y, z] = self.frame.map(|v| v.as_dvec3());
        let (mut min, mut max) = (Vec3::ZERO, Vec3::ZERO);
        for axis in 0..3 {
            // The coordinate is ρ A(u) + h z with ρ ≥ 0: extremal where A is, whatever ρ.
            let around = range_on_arc(x[axis], y[axis], u0, u1);
            let at = |radial: f64, profile: Vec2| radial * f64::from(profile.x) + z[axis] * f64::from(profile.y);
            let along = |radial: f64| match self.profile {
                Profile::Line { .. } => {
                    let (a, b) = (at(radial, self.profile_point(v0)), at(radial, self.profile_point(v1)));
                    (a.min(b), a.max(b))
                }
                Profile::Arc { center, radius, start, sweep } => {
                    let (a, b) = (start + sweep * v0, start + sweep * v1);
                    let (low, high) = range_on_arc(radial, z[axis], a.min(b), a.max(b));
                    let (middle, radius) = (radial * f64::from(center), f64::from(radius));
                    (middle + radius * low, middle + radius * high)
                }
            };
            let center = f64::from(self.center[axis]);
            min[axis] = (center + along(around.0).0) as f32;
            max[axis] = (center + along(around.1).1) as f32;
        }
        Aabb { min, max }
    }

    pub(super) fn domain_normals(&self, domain: Domain) -> Cone {
        let Domain { u0, v0, u1, v1 } = domain;
        if self.is_flat() {
            return Cone::single(self.normal(Vec2::ZERO));
        }
        let (a, b) = (self.profile_normal(v0), self.profile_normal(v1));
        let (low, high) = (a.min(b), a.max(b));
        let cos_half = f64::from(cos_sin_turns((0.5 * (u1 - u0)).min(0.5)).0);
        // In the half-plane of the middle of u an axis is (radial, axial). A normal's product with it is
        // cos ψ radial cos δ + sin ψ axial, δ the angle from the middle of u; linear in cos δ, thus smallest at
        // an end of its range, and there a sinusoid of ψ.
        let smallest = |axis: DVec2| {
            let at = |cos: f64| range_on_arc(axis.x * cos, axis.y, low, high).0;
            at(1.0).min(at(cos_half))
        };
        let ends = [low, high].map(|turn| {
            let (cos, sin) = cos_sin_turns(turn);
            DVec2::new(f64::from(cos), f64::from(sin))
        });
        let middle = {
            let (cos, sin) = cos_sin_turns(0.5 * (low + high));
            DVec2::new(f64::from(cos), f64::from(sin))
        };
        // The best of a few: the middle normal, the mean of the corners' normals, straight along the axis.
        let corners = (ends[0] + ends[1]) * DVec2::new(cos_half.max(0.0), 1.0);
        let candidates = [middle, corners, middle * DVec2::new(cos_half.max(0.0), 1.0), DVec2::Y, DVec2::NEG_Y];
        let (axis, cos) = candidates
            .into_iter()
            .filter_map(DVec2::try_normalize)
            .map(|axis| (axis, smallest(axis)))
            .fold((DVec2::Y, f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best });
        let direction = self.turn(0.5 * (u0 + u1), self.side * axis.x as f32, self.side * axis.y as f32).normalize();
        Cone { axis: direction, cos_angle: (cos as f32 - COSINE_SLACK).max(-1.0) }
    }

    pub(super) fn self_gap(&self) -> f32 {
        let (largest, thickness) = match self.profile {
            Profile::Line { from, to } => (from.x.max(to.x), from.x.max(to.x)),
            Profile::Arc { center, radius, .. } => (center + radius, radius),
        };
        // A chord of length l is l²/8r deep; the depth in question is the rounding of positions at both ends.
        (8.0 * largest * Aabb::ROUNDING).sqrt().min(0.5 * thickness)
    }

    /// A vector in the frame.
    fn local(&self, vector: DVec3) -> DVec3 {
        let [x, y, z] = self.frame.map(|v| v.as_dvec3());
        DVec3::new(vector.dot(x), vector.dot(y), vector.dot(z))
    }

    pub(super) fn parameters_of(&self, point: Vec3) -> Vec2 {
        self.local_parameters(self.local(point.as_dvec3() - self.center.as_dvec3()))
    }

    fn local_parameters(&self, p: DVec3) -> Vec2 {
        let full = std::f64::consts::TAU;
        let radial = p.truncate().length();
        let u = (p.y.atan2(p.x) / full).rem_euclid(1.0);
        let v = match self.profile {
            Profile::Line { from, to } => {
                let (from, to) = (from.as_dvec2(), to.as_dvec2());
                let along = to - from;
                (DVec2::new(radial, p.z) - from).dot(along) / along.length_squared()
            }
            Profile::Arc { center, start, sweep, .. } => {
                let turn = p.z.atan2(radial - f64::from(center)) / full;
                let v = (turn - f64::from(start)) / f64::from(sweep);
                if sweep == 1.0 { v.rem_euclid(1.0) } else { v }
            }
        };
        vec2(u as f32, v.clamp(0.0, 1.0) as f32)
    }

    /// The nearest hit of a ray and its parameters.
    pub(super) fn intersect(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<(f32, Vec2)> {
        let (o, d) = self.local_ray(origin, direction);
        let t = self.first(o, d, t_min, t_max)?;
        Some((t as f32, self.local_parameters(o + d * t)))
    }

    /// The nearest hit alone.
    pub(super) fn distance(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<f32> {
        if self.is_missed(origin, direction) {
            return None;
        }
        let (o, d) = self.local_ray(origin, direction);
        self.first(o, d, t_min, t_max).map(|t| t as f32)
    }

    /// Whether the line of a ray passes by at a distance: most that come near do.
    #[inline]
    fn is_missed(&self, origin: Vec3, direction: Vec3) -> bool {
        let (center, radius) = self.ball;
        let to = center - origin;
        let near = BALL_GROWTH * radius * radius + BALL_SLACK * (1.0 + to.length_squared());
        to.cross(direction).length_squared() > near * direction.length_squared()
    }

    /// A ray in the frame, in f64: the quadratics and the quartic cancel where the surface is small and far.
    fn local_ray(&self, origin: Vec3, direction: Vec3) -> (DVec3, DVec3) {
        (self.local(origin.as_dvec3() - self.center.as_dvec3()), self.local(direction.as_dvec3()))
    }

    fn first(&self, o: DVec3, d: DVec3, t_min: f32, t_max: f32) -> Option<f64> {
        let (low, high) = (f64::from(t_min), f64::from(t_max));
        match self.profile {
            Profile::Line { from, to } => first_of(line_hits(from.as_dvec2(), to.as_dvec2(), o, d), low, high),
            Profile::Arc { center: 0.0, radius, .. } => {
                let radius = f64::from(radius);
                let hits = quadratic(d.length_squared(), o.dot(d), o.length_squared() - radius * radius);
                first_of(hits, low, high)
            }
            Profile::Arc { center, radius, .. } => {
                first_of(torus_hits(f64::from(center), f64::from(radius), o, d, low, high), low, high)
            }
        }
    }
}

/// The least of some distances within a range; infinite ones and those that are no number are none.
fn first_of(hits: impl IntoIterator<Item = f64>, low: f64, high: f64) -> Option<f64> {
    let t = hits.into_iter().filter(|&t| t > low && t < high).fold(f64::INFINITY, f64::min);
    t.is_finite().then_some(t)
}

/// Checks a radius and takes it to unit space.
fn positive(what: &'static str, value: f64, normalization: &Normalization) -> Result<f32, GeometryError> {
    if !value.is_finite() {
        return Err(GeometryError::NonFinite);
    }
    if value <= 0.0 {
        return Err(GeometryError::Radius { what, value, range: "greater than 0" });
    }
    let radius = (value * normalization.scale()) as f32;
    if radius < f32::MIN_POSITIVE { Err(GeometryError::Vanishing) } else { Ok(radius) }
}

/// Cosine and sine of an angle in full turns; exact at quarter turns, and the same bits for 0 and 1, so that a
/// surface of revolution closes.
fn cos_sin_turns(turns: f32) -> (f32, f32) {
    let quarters = (4.0 * turns).round();
    let (sin, cos) = ((turns - 0.25 * quarters) * TAU).sin_cos();
    match (quarters as i32).rem_euclid(4) {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

/// Range of a cos α + b sin α for α between two angles in full turns, `from` ≤ `to`.
fn range_on_arc(a: f64, b: f64, from: f32, to: f32) -> (f64, f64) {
    let at = |turns: f32| {
        let (sin, cos) = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
        a * cos + b * sin
    };
    let amplitude = a.hypot(b);
    let (start, end) = (at(from), at(to));
    let peak = b.atan2(a) / std::f64::consts::TAU;
    // Whether peak + a whole number is in the interval.
    let holds = |turns: f64| turns + (f64::from(from) - turns).ceil() <= f64::from(to);
    let low = if holds(peak + 0.5) { -amplitude } else { start.min(end) };
    let high = if holds(peak) { amplitude } else { start.max(end) };
    (low, high)
}

/// No hit.
const NONE: f64 = f64::INFINITY;

/// Roots of a t² + 2 b t + c, without cancellation; what is no root is not finite.
fn quadratic(a: f64, b: f64, c: f64) -> [f64; 2] {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 || discriminant.is_nan() {
        return [NONE; 2];
    }
    let q = -(b + discriminant.sqrt().copysign(b));
    [q / a, c / q]
}

/// Hits of a ray with a line profile turned around z: a cone, cylinder or ring. What is no hit is not finite.
fn line_hits(from: DVec2, to: DVec2, o: DVec3, d: DVec3) -> [f64; 2] {
    let along = to - from;
    if along.y == 0.0 {
        let t = (from.y - o.z) / d.z;
        let radius = (o + d * t).truncate().length();
        let inside = radius >= from.x - RIM && radius <= to.x + RIM;
        return [if inside { t } else { NONE }, NONE];
    }
    // With h = along.y: (hρ)² = (along.x z + from.x h)², z from the first end. The ray's numbers are relative to
    // its nearest point to the middle of the profile, which keeps b² − ac from cancelling for far origins.
    let middle = DVec3::new(0.0, 0.0, 0.5 * (from.y + to.y));
    let shift = (middle - o).dot(d) / d.length_squared();
    if !shift.is_finite() {
        return [NONE; 2];
    }
    let p = o + d * shift;
    let (h, g) = (along.y, from.x * along.y + along.x * (p.z - from.y));
    let slope = along.x * d.z;
    let a = h * h * d.truncate().length_squared() - slope * slope;
    let b = h * h * p.truncate().dot(d.truncate()) - slope * g;
    let c = h * h * p.truncate().length_squared() - g * g;
    let rim = RIM * h / along.length();
    quadratic(a, b, c).map(|t| {
        let z = p.z + d.z * t - from.y;
        // A little beyond the rim counts; the other nappe of the cone does not.
        let inside = z >= -rim && z <= h + rim && from.x + along.x * (z / h) >= -RIM;
        if inside { t + shift } else { NONE }
    })
}

/// Hits of a ray with a torus around z, within a range of t.
fn torus_hits(major: f64, minor: f64, o: DVec3, d: DVec3, low: f64, high: f64) -> SmallVec<[f64; 8]> {
    // Relative to the nearest point to the centre, in units of the major radius, unit speed.
    let speed = d.length();
    let shift = -o.dot(d) / (speed * speed);
    if !shift.is_finite() {
        return SmallVec::new();
    }
    let (p, d) = ((o + d * shift) / major, d / speed);
    let r = minor / major;
    // The bounding sphere, of radius 1 + r, limits the roots.
    let reach = (1.0 + r) * (1.0 + r) - p.length_squared();
    if reach <= 0.0 {
        return SmallVec::new();
    }
    let scale = major / speed;
    // So do the planes above and below it: of a ray within these the quotients are infinite, or no numbers.
    let thickness = r * (1.0 + RIM);
    let planes = [(-thickness - p.z) / d.z, (thickness - p.z) / d.z];
    let enters = planes[0].min(planes[1]);
    let leaves = planes[0].max(planes[1]);
    let first = ((low - shift) / scale).max(-reach.sqrt()).max(enters);
    let last = ((high - shift) / scale).min(reach.sqrt()).min(leaves);
    // Between these planes, what is nearer to the axis at both ends than the inside is so all along: the hole.
    let hole = (1.0 - r) * (1.0 - RIM);
    let misses = |t: f64| (p + d * t).truncate().length_squared() < hole * hole;
    if misses(first) && misses(last) {
        return SmallVec::new();
    }
    // (|p|² + 1 − r²)² = 4 (x² + y²) with p + t d and p·d = 0: |p|² = t² + |p₀|².
    let k = p.length_squared() + 1.0 - r * r;
    let (flat_p, flat_d) = (p.truncate(), d.truncate());
    let coefficients = [
        k * k - 4.0 * flat_p.length_squared(),
        -8.0 * flat_p.dot(flat_d),
        2.0 * k - 4.0 * flat_d.length_squared(),
        0.0,
        1.0,
    ];
    roots_between(&coefficients, first, last).into_iter().map(|t| t * scale + shift).collect()
}

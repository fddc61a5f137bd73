//! Triangles and planar convex quadrilaterals.

use super::{Aabb, Domain, GeometryError, Normalization, slabs};
use glam::{DVec2, DVec3, Vec2, Vec3, Vec4, Vec4Swizzles, vec2};

/// Corners of a quadrilateral may be off the mean plane by this share of the longer diagonal: what decimals of four
/// digits in a file leave, and little enough that no shadow shows.
const PLANARITY: f64 = 1e-3;

/// Polygons thinner than this share of their length have no area: below it the normal is rounding noise in f64.
const THIN: f64 = 1e-12;

/// A ray counts as inside an edge if it passes it on the wrong side by less than this share of the polygon's size:
/// the rounding of the edge functions (two ulp of products of three differences), so that no ray slips through
/// where edges meet.
const EDGE_TOLERANCE: f32 = 4.0 * f32::EPSILON;

/// A ray whose direction has less than this cosine with the normal runs within the plane and does not hit: its edge
/// functions are but the rounding of positions.
const IN_PLANE: f32 = 1e-6;

/// A triangle in unit space; P(u, v) = p₀(1−u−v) + p₁u + p₂v.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangle {
    points: [Vec3; 3],
    normal: Vec3,
    area: f32,
}

impl Triangle {
    pub(super) fn new(points: &[DVec3; 3], flip: bool, normalization: &Normalization) -> Result<Self, GeometryError> {
        check_area(points, "triangle")?;
        let points = points.map(|p| normalization.to_unit(p));
        let (normal, area) = normal_and_area(&points, flip)?;
        Ok(Self { points, normal, area })
    }

    /// The corners, counter-clockwise around the normal unless the surface is flipped.
    #[must_use]
    pub fn points(&self) -> &[Vec3; 3] {
        &self.points
    }

    /// Unit normal on the front.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// The area.
    #[must_use]
    pub fn area(&self) -> f32 {
        self.area
    }

    pub(super) fn point(&self, uv: Vec2) -> Vec3 {
        // On an edge one weight is exactly 0 and the sum is one of two products: commutative, so that a triangle
        // that shares the edge, in whatever order of corners, gets the same bits.
        let [p0, p1, p2] = self.points;
        p0 * (1.0 - uv.x - uv.y) + p1 * uv.x + p2 * uv.y
    }

    pub(super) fn parameters_of(&self, point: Vec3) -> Vec2 {
        let [p0, p1, p2] = self.points.map(|p| p.as_dvec3());
        let (e, f, h) = (p1 - p0, p2 - p0, point.as_dvec3() - p0);
        let normal = e.cross(f);
        let scale = normal.length_squared().recip();
        let u = (h.cross(f).dot(normal) * scale).clamp(0.0, 1.0);
        let v = (e.cross(h).dot(normal) * scale).clamp(0.0, 1.0);
        let sum = (u + v).max(1.0);
        vec2((u / sum) as f32, (v / sum) as f32)
    }

    pub(crate) fn outline(&self) -> Outline {
        let [p0, p1, p2] = self.points;
        Outline::new([p0, p1, p2, p2], self.normal)
    }
}

/// A planar convex quadrilateral in unit space; P(u, v) = p₀(1−u)(1−v) + p₁u(1−v) + p₂uv + p₃(1−u)v.
#[derive(Clone, Debug, PartialEq)]
pub struct Quad {
    points: [Vec3; 4],
    normal: Vec3,
    area: f32,
}

impl Quad {
    pub(super) fn new(points: &[DVec3; 4], flip: bool, normalization: &Normalization) -> Result<Self, GeometryError> {
        check_area(points, "quadrilateral")?;
        check_planar_and_convex(points)?;
        let points = points.map(|p| normalization.to_unit(p));
        let (normal, area) = normal_and_area(&points, flip)?;
        Ok(Self { points, normal, area })
    }

    /// The corners, counter-clockwise around the normal unless the surface is flipped.
    #[must_use]
    pub fn points(&self) -> &[Vec3; 4] {
        &self.points
    }

    /// Unit normal on the front.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// The area.
    #[must_use]
    pub fn area(&self) -> f32 {
        self.area
    }

    pub(super) fn point(&self, uv: Vec2) -> Vec3 {
        // As for triangles: on an edge the two weights of the other corners are exactly 0.
        let [p0, p1, p2, p3] = self.points;
        let (u, v) = (uv.x, uv.y);
        let (s, t) = (1.0 - u, 1.0 - v);
        (p0 * (s * t) + p1 * (u * t)) + (p2 * (u * v) + p3 * (s * v))
    }

    /// Tangents ∂P/∂u and ∂P/∂v.
    fn tangents(&self, uv: Vec2) -> (Vec3, Vec3) {
        let [p0, p1, p2, p3] = self.points;
        ((p1 - p0).lerp(p2 - p3, uv.y), (p3 - p0).lerp(p2 - p1, uv.x))
    }

    pub(super) fn jacobian(&self, uv: Vec2) -> f32 {
        let (along_u, along_v) = self.tangents(uv);
        along_u.cross(along_v).length()
    }

    pub(super) fn domain_area(&self, domain: Domain) -> f32 {
        // In the plane the Jacobian is linear in u and v (the product of the mixed terms vanishes): its mean is the
        // middle's.
        self.jacobian(domain.lerp(0.5, 0.5)) * domain.rectangle()
    }

    /// Lengths of a part along u and v, in its middle.
    pub(super) fn extent(&self, domain: Domain) -> (f32, f32) {
        let (along_u, along_v) = self.tangents(domain.lerp(0.5, 0.5));
        (along_u.length() * (domain.u1 - domain.u0), along_v.length() * (domain.v1 - domain.v0))
    }

    /// Inverts the bilinear map in the plane: the line of constant v through the point fulfils a quadratic, of
    /// which exactly one root is within 0…1 for points inside a convex quadrilateral.
    pub(super) fn parameters_of(&self, point: Vec3) -> Vec2 {
        let [p0, p1, p2, p3] = self.points.map(|p| p.as_dvec3());
        // Of any length: what counts are ratios.
        let x = if p1 == p0 { p2 - p3 } else { p1 - p0 };
        let y = self.normal.as_dvec3().cross(x);
        let flat = |v: DVec3| DVec2::new(v.dot(x), v.dot(y));
        let (e, f, g, h) = (flat(p1 - p0), flat(p3 - p0), flat(p0 - p1 + p2 - p3), flat(point.as_dvec3() - p0));
        let (a, b, c) = (g.perp_dot(f), e.perp_dot(f) + h.perp_dot(g), h.perp_dot(e));
        let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
        let q = -0.5 * (b + root.copysign(b));
        let candidates = [c / q, q / a].map(|v| if v.is_finite() { v } else { f64::MAX });
        let outside = |v: f64| (v - 0.5).abs();
        let v = if outside(candidates[0]) <= outside(candidates[1]) { candidates[0] } else { candidates[1] };
        let v = if v == f64::MAX { 0.0 } else { v.clamp(0.0, 1.0) };
        let along = e + g * v;
        let u = (h - f * v).dot(along) / along.length_squared();
        let u = if u.is_finite() { u.clamp(0.0, 1.0) } else { 0.0 };
        vec2(u as f32, v as f32)
    }

    pub(crate) fn outline(&self) -> Outline {
        Outline::new(self.points, self.normal)
    }
}

/// What a ray test needs of a convex polygon with three or four corners (the last one twice if three), all four
/// edges side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Outline {
    x: [f32; 4],
    y: [f32; 4],
    z: [f32; 4],
    normal: Vec3,
}

impl Outline {
    /// That of no polygon.
    pub(crate) const NONE: Self = Self { x: [0.0; 4], y: [0.0; 4], z: [0.0; 4], normal: Vec3::ZERO };

    fn new([a, b, c, d]: [Vec3; 4], normal: Vec3) -> Self {
        Self { x: [a.x, b.x, c.x, d.x], y: [a.y, b.y, c.y, d.y], z: [a.z, b.z, c.z, d.z], normal }
    }

    /// Its corners as seen from a point.
    #[inline(always)]
    fn from(&self, origin: Vec3) -> [Vec4; 3] {
        [Vec4::from(self.x) - origin.x, Vec4::from(self.y) - origin.y, Vec4::from(self.z) - origin.z]
    }

    /// Where a ray meets the polygon, from either side, with `t_min` < t < `t_max`.
    ///
    /// The test is by signed volumes of the ray and the edges (Plücker coordinates), relative to the origin of the
    /// ray. An edge's volume changes its sign and no other bit when its corners change places, so a ray that
    /// passes between two polygons by rounding passes between no two that share an edge.
    #[inline(always)]
    pub(crate) fn intersect(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<f32> {
        let corners @ [x, y, z] = self.from(origin);
        let [a, b, c] = edge_planes(corners);
        let volumes = a * direction.x + b * direction.y + c * direction.z;
        let tolerance = EDGE_TOLERANCE * volumes.element_sum().abs();
        if volumes.min_element() < -tolerance && volumes.max_element() > tolerance {
            return None;
        }
        let along = direction.dot(self.normal);
        if along.abs() <= IN_PLANE * direction.abs().max_element() {
            return None;
        }
        let t = Vec3::new(x.x, y.x, z.x).dot(self.normal) / along;
        (t > t_min && t < t_max && is_toward(&corners, direction)).then_some(t)
    }

    /// Whether some edge has the polygon on one side, and on the other all rays from `origin` that run between four `directions`.
    pub(crate) fn is_beside(&self, origin: Vec3, directions: &[Vec3; 4]) -> bool {
        let corners @ [x, y, z] = self.from(origin);
        let [a, b, c] = edge_planes(corners);
        let (mut low, mut high, mut all) = (Vec4::INFINITY, Vec4::NEG_INFINITY, 0.0);
        for direction in directions {
            let volumes = a * direction.x + b * direction.y + c * direction.z;
            (low, high) = (low.min(volumes), high.max(volumes));
            all += volumes.element_sum().abs();
        }
        // Volumes of rays that hit have the sign of this, which is unclear where the origin is in the polygon's plane.
        let (area, corner) = (Vec3::new(a.element_sum(), b.element_sum(), c.element_sum()), Vec3::new(x.x, y.x, z.x));
        let turn = area.dot(corner);
        if turn.abs() <= IN_PLANE * area.length() * corner.length() {
            return false;
        }
        let tolerance = Vec4::splat(2.0 * EDGE_TOLERANCE * all);
        if turn > 0.0 { high.cmplt(-tolerance).any() } else { low.cmpgt(tolerance).any() }
    }
}

/// Whether the line through the origin along a direction passes the box around a polygon, but for rounding. One that runs in
/// the polygon's plane but far from it may have edge functions that are all rounding, of either sign, and a cosine with the
/// normal that is the rounding of so small a polygon's corners.
#[inline(always)]
fn is_toward(corners: &[Vec4; 3], direction: Vec3) -> bool {
    let reciprocal = slabs::reciprocal(direction);
    let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
    for (axis, corner) in corners.iter().enumerate() {
        let low = (corner.min_element() - Aabb::ROUNDING) * reciprocal[axis];
        let high = (corner.max_element() + Aabb::ROUNDING) * reciprocal[axis];
        (near, far) = (near.max(low.min(high)), far.min(low.max(high)));
    }
    near <= far * slabs::GROWTH
}

/// Twice the normals of the planes through the origin and each edge of a polygon.
#[inline(always)]
fn edge_planes([x, y, z]: [Vec4; 3]) -> [Vec4; 3] {
    let (nx, ny, nz) = (x.yzwx(), y.yzwx(), z.yzwx());
    let (ex, ey, ez) = (nx - x, ny - y, nz - z);
    let (sx, sy, sz) = (nx + x, ny + y, nz + z);
    [ey * sz - ez * sy, ez * sx - ex * sz, ex * sy - ey * sx]
}

/// Rejects what has no area before it is rounded to f32.
fn check_area(points: &[DVec3], what: &'static str) -> Result<(), GeometryError> {
    if !points.iter().all(|p| p.is_finite()) {
        return Err(GeometryError::NonFinite);
    }
    // Scaled by the longest coordinate difference, so that no product over- or underflows.
    let size = points.iter().map(|p| (p / 2.0 - points[0] / 2.0).abs().max_element()).fold(0.0, f64::max);
    if size == 0.0 {
        return Err(GeometryError::NoArea(what));
    }
    let scaled: Vec<DVec3> = points.iter().map(|p| (p / 2.0 - points[0] / 2.0) / size).collect();
    if newell(&scaled).length() < THIN {
        return Err(GeometryError::NoArea(what));
    }
    Ok(())
}

/// Rejects quadrilaterals (finite, with area) that are not planar or not convex.
fn check_planar_and_convex(points: &[DVec3; 4]) -> Result<(), GeometryError> {
    let normal = newell(points).normalize_or_zero();
    let center = (points[0] + points[1] + points[2] + points[3]) / 4.0;
    let diagonal = points[0].distance(points[2]).max(points[1].distance(points[3]));
    let distance = points.iter().map(|&p| (p - center).dot(normal).abs()).fold(0.0, f64::max) / diagonal;
    if distance > PLANARITY {
        return Err(GeometryError::NotPlanar { distance, tolerance: PLANARITY });
    }
    for i in 0..4 {
        let (a, b, c) = (points[i], points[(i + 1) % 4], points[(i + 2) % 4]);
        let turn = (b - a).cross(c - b).dot(normal);
        // Three corners in line are fine, up to rounding.
        if a == b || turn < -1e-9 * diagonal * diagonal {
            return Err(GeometryError::NotConvex);
        }
    }
    Ok(())
}

/// Twice the area vector of a closed polygon (Newell's method), relative to its first corner.
fn newell(points: &[DVec3]) -> DVec3 {
    let first = points[0];
    points.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first)).sum()
}

/// Unit front normal and area of the rounded polygon.
fn normal_and_area(points: &[Vec3], flip: bool) -> Result<(Vec3, f32), GeometryError> {
    if !points.iter().all(|p| p.is_finite()) {
        return Err(GeometryError::NonFinite);
    }
    let exact: smallvec::SmallVec<[DVec3; 4]> = points.iter().map(|p| p.as_dvec3()).collect();
    let vector = newell(&exact);
    let area = (0.5 * vector.length()) as f32;
    let normal = vector.normalize_or_zero().as_vec3();
    if normal == Vec3::ZERO || area < f32::MIN_POSITIVE {
        return Err(GeometryError::Vanishing);
    }
    Ok((if flip { -normal } else { normal }, area))
}

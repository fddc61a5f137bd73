//! Flat triangles as seen from the origin: how they lie to cones of directions, and integrals over them.

use glam::{DVec3, Vec3};
use hr_diffuse::Cone;

/// Which of (corner 0, 1, 2, midpoint of the edge opposite corner 0, 1, 2) are the corners of each child: three at
/// the corners of the parent, then the one in the middle.
pub(crate) const CHILD_CORNERS: [[usize; 3]; 4] = [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]];

/// The two ends of the edge opposite each corner.
pub(crate) const EDGE_ENDS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

/// Picks the corners of a child from corners and midpoints, whatever is kept there.
#[inline]
pub(crate) fn child_corners<T: Copy>(corners: [T; 3], mids: [T; 3], child: usize) -> [T; 3] {
    let all = [corners[0], corners[1], corners[2], mids[0], mids[1], mids[2]];
    let [i, j, k] = CHILD_CORNERS[child];
    [all[i], all[j], all[k]]
}

/// Midpoints of the edges opposite each corner.
#[inline]
pub(crate) fn midpoints(corners: [Vec3; 3]) -> [Vec3; 3] {
    let [a, b, c] = [0.5 * corners[0], 0.5 * corners[1], 0.5 * corners[2]];
    [b + c, c + a, a + b]
}

/// How often bounds divide a linear piece that is much larger than the cone.
pub(crate) const PIECE_SPLITS: u32 = 6;

/// A cone of directions made ready for many tests.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ConeTest {
    axis: Vec3,
    cos: f32,
    sin: f32,
}

impl ConeTest {
    /// Rounding of the dot and cross products of unit vectors in `f32`, several times over; tests err toward "touches".
    const SLACK: f32 = 1e-6;

    pub(crate) fn new(cone: &Cone) -> Self {
        let cos = cone.cos_angle.clamp(-1.0, 1.0);
        Self { axis: cone.axis, cos, sin: (1.0 - cos * cos).max(0.0).sqrt() }
    }

    pub(crate) fn axis(&self) -> Vec3 {
        self.axis
    }

    /// Whether a direction, about as long as 1, is in a cone narrower than a hemisphere. Never wrongly true.
    #[inline]
    fn holds(&self, direction: Vec3) -> bool {
        let along = direction.dot(self.axis) - Self::SLACK;
        along > 0.0 && along * along > self.cos * self.cos * direction.length_squared()
    }
}

/// How a triangle lies to a cone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Overlap {
    /// No direction in common.
    Apart,
    /// Perhaps some.
    Partial,
    /// The whole triangle is in the cone.
    Inside,
}

/// A flat triangle; the directions through it are a spherical one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// Corners, of any length.
    pub(crate) corners: [Vec3; 3],
    /// 1 where they are counterclockwise as seen from outside, −1 where they are clockwise.
    turn: f32,
}

impl Triangle {
    #[inline]
    pub(crate) fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        Self { corners, turn: (b - a).cross(c - a).dot(a).signum() }
    }

    #[inline]
    pub(crate) fn child(&self, child: usize) -> Self {
        Self { corners: child_corners(self.corners, midpoints(self.corners), child), ..*self }
    }

    /// All four parts, in the order of [`CHILD_CORNERS`].
    #[inline]
    pub(crate) fn children(&self) -> [Self; 4] {
        let mids = midpoints(self.corners);
        let child = |child| Self { corners: child_corners(self.corners, mids, child), ..*self };
        [child(0), child(1), child(2), child(3)]
    }

    /// Unit direction through the centroid.
    #[inline]
    pub(crate) fn center(&self) -> Vec3 {
        (self.corners[0] + self.corners[1] + self.corners[2]).normalize()
    }

    /// Cosine of the angle from the middle to the farthest corner, which is less than 90° away.
    #[inline]
    pub(crate) fn cos_radius(&self) -> f32 {
        let [a, b, c] = self.corners;
        let middle = a + b + c;
        let squared = |corner: Vec3| middle.dot(corner).powi(2) / corner.length_squared();
        (squared(a).min(squared(b)).min(squared(c)) / middle.length_squared()).sqrt().min(1.0)
    }

    /// Whether a cone and this triangle may have a direction in common. Never wrongly false.
    pub(crate) fn touches(&self, cone: &ConeTest) -> bool {
        self.overlap(cone) != Overlap::Apart
    }

    /// Never wrongly apart nor inside.
    pub(crate) fn overlap(&self, cone: &ConeTest) -> Overlap {
        // Most triangles are beyond the great circle of an edge: no root is needed to see that. A cone wider than a
        // hemisphere reaches across every one.
        let beyond = |edge: usize| {
            let (depth, length2) = self.depth(edge, cone.axis);
            let beyond = (-depth - ConeTest::SLACK).max(0.0);
            beyond * beyond > cone.sin * cone.sin * length2
        };
        if cone.cos > 0.0 {
            if beyond(0) || beyond(1) || beyond(2) {
                return Overlap::Apart;
            }
            // It is convex, and holds all of what it holds the corners of.
            if self.corners.iter().all(|&corner| cone.holds(corner)) {
                return Overlap::Inside;
            }
        }
        let between = self.center().dot(cone.axis);
        let cos = self.cos_radius();
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        // Inside: angle(axis, center) ≤ cone's angle − radius, in cosines.
        if cone.cos < cos - ConeTest::SLACK && between > cone.cos * cos + cone.sin * sin + ConeTest::SLACK {
            return Overlap::Inside;
        }
        // Touching the circle around the triangle: angle(axis, center) ≤ cone's angle + radius.
        if cone.cos > -cos && between < cone.cos * cos - cone.sin * sin - ConeTest::SLACK {
            return Overlap::Apart;
        }
        Overlap::Partial
    }

    /// Extends bounds by those of a linear interpolation over the triangle, by its parts that the cone touches where it
    /// is larger than the cone; it is divided `splits` times at most.
    pub(crate) fn bound(&self, values: [Vec3; 3], cone: &ConeTest, splits: u32, low: &mut Vec3, high: &mut Vec3) {
        let (min, max) = (values[0].min(values[1]).min(values[2]), values[0].max(values[1]).max(values[2]));
        if min.cmpge(*low).all() && max.cmple(*high).all() || self.overlap(cone) == Overlap::Apart {
            return;
        }
        if splits == 0 || self.cos_radius() >= cone.cos {
            *low = low.min(min);
            *high = high.max(max);
            return;
        }
        let mids = midpoints(values);
        for (child, triangle) in self.children().iter().enumerate() {
            triangle.bound(child_corners(values, mids, child), cone, splits - 1, low, high);
        }
    }

    /// Whether a cone narrower than a hemisphere is inside the triangle. Never wrongly true.
    pub(crate) fn holds(&self, cone: &ConeTest) -> bool {
        let within = |edge: usize| {
            let (depth, length2) = self.depth(edge, cone.axis);
            let within = depth - ConeTest::SLACK;
            within > 0.0 && within * within > cone.sin * cone.sin * length2
        };
        cone.cos > 0.0 && within(0) && within(1) && within(2)
    }

    /// How far a direction is on the inner side of the plane through an edge and the origin, as the product with a
    /// normal of that plane, and that normal's squared length.
    #[inline]
    fn depth(&self, edge: usize, direction: Vec3) -> (f32, f32) {
        let [from, to] = EDGE_ENDS[edge];
        let normal = self.corners[from].cross(self.corners[to]);
        (self.turn * normal.dot(direction), normal.length_squared())
    }

    /// ∫ weight(direction) · (linear interpolation of `values`) dω over the triangle and ∫ weight dω, by quadrature
    /// on each of 4^`splits` parts: Radon's seven points, fewer for small triangles. Of an area dA at the point p, on a
    /// plane at the distance h from the origin, the solid angle is dω = h dA / |p|³; h times the area of the triangle is
    /// half of its corners' triple product.
    pub(crate) fn integrate(&self, values: [DVec3; 3], splits: u32, weight: &impl Fn(Vec3) -> f32) -> (DVec3, f64) {
        if splits > 0 {
            let mids = EDGE_ENDS.map(|[a, b]| 0.5 * (values[a] + values[b]));
            return (0..4).fold((DVec3::ZERO, 0.0), |(sum, total), i| {
                let (s, t) = self.child(i).integrate(child_corners(values, mids, i), splits - 1, weight);
                (sum + s, total + t)
            });
        }
        let [a, b, c] = self.corners;
        let area = 0.5 * f64::from((b - a).cross(c - a).dot(a).abs());
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        // Small triangles take the three midpoints of their edges, degree 2.
        let rule: &[_] = if self.cos_radius() > 0.998 { &MIDPOINTS } else { &RADON };
        for &(l, w) in rule {
            let p = a * l[0] as f32 + b * l[1] as f32 + c * l[2] as f32;
            let length = p.length();
            let jacobian = area * w / f64::from(length * length * length);
            let density = jacobian * f64::from(weight(p / length));
            sum += density * (values[0] * l[0] + values[1] * l[1] + values[2] * l[2]);
            total += density;
        }
        (sum, total)
    }

    /// Which way its octant lies, of a part of a face of the octahedron.
    pub(crate) fn signs(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (a + b + c).signum()
    }

    /// Solid angle in steradians to first order: the Jacobian in the middle. For weighting neighbours only.
    pub(crate) fn rough_solid_angle(&self) -> f32 {
        let [a, b, c] = self.corners;
        let p = (a + b + c) / 3.0;
        0.5 * (b - a).cross(c - a).dot(a).abs() / p.length().powi(3)
    }
}

/// The rule of degree 2 on a triangle: barycentric coordinates and weights.
const MIDPOINTS: [([f64; 3], f64); 3] =
    [([0.0, 0.5, 0.5], 1.0 / 3.0), ([0.5, 0.0, 0.5], 1.0 / 3.0), ([0.5, 0.5, 0.0], 1.0 / 3.0)];

/// Radon's rule of degree 5 on a triangle: barycentric coordinates and weights.
const RADON: [([f64; 3], f64); 7] = {
    const ROOT: f64 = 3.872_983_346_207_417; // √15
    const NEAR: f64 = (6.0 - ROOT) / 21.0;
    const FAR: f64 = (6.0 + ROOT) / 21.0;
    const W_NEAR: f64 = (155.0 - ROOT) / 1200.0;
    const W_FAR: f64 = (155.0 + ROOT) / 1200.0;
    const THIRD: f64 = 1.0 / 3.0;
    [
        ([THIRD, THIRD, THIRD], 9.0 / 40.0),
        ([NEAR, NEAR, 1.0 - 2.0 * NEAR], W_NEAR),
        ([NEAR, 1.0 - 2.0 * NEAR, NEAR], W_NEAR),
        ([1.0 - 2.0 * NEAR, NEAR, NEAR], W_NEAR),
        ([FAR, FAR, 1.0 - 2.0 * FAR], W_FAR),
        ([FAR, 1.0 - 2.0 * FAR, FAR], W_FAR),
        ([1.0 - 2.0 * FAR, FAR, FAR], W_FAR),
    ]
};

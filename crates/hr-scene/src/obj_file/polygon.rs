//! Polygons in space: are they planar and convex, and how do they fall into triangles?

use glam::{DVec2, DVec3};

/// Distance from its plane, relative to its size, within which a quadrilateral is planar.
const PLANAR: f64 = 1e-5;

/// Most corners of a polygon that is not convex: clipping ears takes a time that grows with the third power.
const MAX_CONCAVE: usize = 256;

/// Newell's normal: twice the area in length, robust for polygons that are not quite planar.
fn normal(points: &[DVec3]) -> DVec3 {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| (*a - points[0]).cross(*b - points[0])).sum()
}

/// Corners in the plane of the polygon, counter-clockwise; `None` where it has no area.
fn flattened(points: &[DVec3]) -> Option<Vec<DVec2>> {
    let z = normal(points).try_normalize()?;
    let x = z.any_orthonormal_vector();
    let y = z.cross(x);
    Some(points.iter().map(|p| *p - points[0]).map(|p| DVec2::new(p.dot(x), p.dot(y))).collect())
}

fn is_convex(flat: &[DVec2]) -> bool {
    let n = flat.len();
    let turns = |i: usize| {
        let (a, b, c) = (flat[i], flat[(i + 1) % n], flat[(i + 2) % n]);
        (b - a).perp_dot(c - b) > 1e-9 * (b - a).length() * (c - b).length()
    };
    // Left turns all along, and only once around: a star turns left too.
    let around: f64 =
        (0..n).map(|i| (flat[(i + 1) % n] - flat[i]).angle_to(flat[(i + 2) % n] - flat[(i + 1) % n])).sum();
    (0..n).all(turns) && around < 3.0 * std::f64::consts::PI
}

/// Whether a polygon is planar and convex.
pub(super) fn is_planar_convex(points: &[DVec3]) -> bool {
    let Some(z) = normal(points).try_normalize() else {
        return false;
    };
    let size = points.iter().map(|p| p.distance(points[0])).fold(0.0, f64::max);
    points.iter().all(|p| (*p - points[0]).dot(z).abs() <= PLANAR * size)
        && flattened(points).is_some_and(|flat| is_convex(&flat))
}

/// Cuts a polygon into triangles by clipping ears; fewer than `points.len() - 2` where it crosses itself or is too
/// complex.
pub(super) fn triangles(points: &[DVec3]) -> Vec<[u32; 3]> {
    let fan = || (1..points.len() as u32 - 1).map(|i| [0, i, i + 1]).collect();
    if points.len() == 3 {
        return fan();
    }
    let Some(flat) = flattened(points) else {
        return Vec::new();
    };
    // A bent quadrilateral is convex in projection: both diagonals will do.
    if is_convex(&flat) {
        return fan();
    }
    if points.len() > MAX_CONCAVE {
        return Vec::new();
    }
    let mut rest: Vec<u32> = (0..points.len() as u32).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    while rest.len() > 3 {
        let n = rest.len();
        let Some(ear) = (0..n).find(|&i| is_ear(&flat, &rest, i)) else {
            return triangles;
        };
        triangles.push([rest[(ear + n - 1) % n], rest[ear], rest[(ear + 1) % n]]);
        rest.remove(ear);
    }
    triangles.push([rest[0], rest[1], rest[2]]);
    triangles
}

/// Whether the corner `i` of what is left can be cut off: it turns left, or not at all, and no other corner lies
/// inside.
fn is_ear(flat: &[DVec2], rest: &[u32], i: usize) -> bool {
    let n = rest.len();
    let (before, after) = ((i + n - 1) % n, (i + 1) % n);
    let [a, b, c] = [before, i, after].map(|k| flat[rest[k] as usize]);
    if (b - a).perp_dot(c - b) < 0.0 {
        return false;
    }
    let inside = |p: DVec2| {
        p != a
            && p != b
            && p != c
            && (b - a).perp_dot(p - a) >= 0.0
            && (c - b).perp_dot(p - b) >= 0.0
            && (a - c).perp_dot(p - c) >= 0.0
    };
    !rest.iter().any(|&k| inside(flat[k as usize]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn space(flat: &[[f64; 2]]) -> Vec<DVec3> {
        // A plane that is askew in space.
        let (x, y) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 1.0, 0.0));
        flat.iter().map(|p| DVec3::new(5.0, -2.0, 1.0) + x * p[0] + y * p[1]).collect()
    }

    fn area(points: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
        let z = normal(points).normalize();
        let of = |t: &[u32; 3]| t.map(|i| points[i as usize]);
        triangles.iter().map(of).map(|[a, b, c]| 0.5 * (b - a).cross(c - a).dot(z)).sum()
    }

    #[test]
    fn concave_polygons_fall_into_triangles_of_their_area() {
        let l = space(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]);
        assert!(!is_planar_convex(&l), "an L is not convex");
        let cut = triangles(&l);
        assert_eq!(cut.len(), 4, "n - 2 triangles");
        assert!((area(&l, &cut) - 3.0).abs() < 1e-12, "its area");
        let arrow = space(&[[0.0, 0.0], [2.0, -1.0], [1.0, 0.0], [2.0, 1.0]]);
        let cut = triangles(&arrow);
        assert!((area(&arrow, &cut) - 1.0).abs() < 1e-12, "the inner diagonal is taken, {cut:?}");
        // A comb with eight teeth.
        let mut comb = vec![[0.0, 0.0], [16.0, 0.0]];
        for i in (0..8).rev() {
            let x = 2.0 * f64::from(i);
            comb.extend([[x + 2.0, 5.0], [x + 1.0, 1.0]]);
        }
        comb.push([0.0, 5.0]);
        let comb = space(&comb);
        let cut = triangles(&comb);
        assert_eq!(cut.len(), comb.len() - 2, "all of the comb");
        assert!((area(&comb, &cut) - 0.5 * normal(&comb).length()).abs() < 1e-9, "its area");
    }

    #[test]
    fn convexity_and_planarity() {
        assert!(is_planar_convex(&space(&[[0.0, 0.0], [3.0, 0.0], [2.0, 1.0], [0.0, 1.0]])), "a trapezoid");
        assert!(!is_planar_convex(&space(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])), "crossed");
        assert!(!is_planar_convex(&space(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])), "a straight corner");
        let mut bent = space(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        bent[2].y += 0.01;
        bent[2].z -= 0.01;
        assert!(!is_planar_convex(&bent), "bent");
        assert_eq!(triangles(&bent).len(), 2, "bent ones are cut");
        let star: Vec<[f64; 2]> =
            (0..5).map(|i| f64::from(i) * 0.8 * std::f64::consts::PI).map(|a| [a.cos(), a.sin()]).collect();
        assert!(!is_planar_convex(&space(&star)), "a pentagram turns left at every corner, but twice around");
    }

    #[test]
    fn nonsense_ends() {
        assert!(triangles(&[DVec3::ZERO; 5]).is_empty(), "a point");
        assert!(triangles(&[DVec3::NAN; 7]).is_empty(), "no numbers");
        let zigzag: Vec<[f64; 2]> = (0..200).map(|i| [f64::from(i * 37 % 101), f64::from(i * 59 % 103)]).collect();
        assert!(triangles(&space(&zigzag)).len() <= 198, "it crosses itself everywhere");
    }
}

//! Polygons of any kind, cut into triangles and convex planar quadrilaterals.
//!
//! Concave outlines, holes, seams (an outline that runs to a hole and back along the same edge), straight corners and
//! corners that are not quite in one plane are welcome. No corner is invented, so that neighbours keep fitting.
//! Triangles come from ear clipping, are made Delaunay by edge flips, and are joined in pairs where that gives a
//! well-shaped quadrilateral: fewer and rounder elements for the light transport.

use earcut::{Earcut, refine};
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// Indices of corners, counter-clockwise seen from the side that the polygon's normal points to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Piece {
    Triangle([usize; 3]),
    /// Convex and planar.
    Quad([usize; 4]),
}

impl Piece {
    /// Its corners.
    pub(crate) fn corners(&self) -> &[usize] {
        match self {
            Self::Triangle(corners) => corners,
            Self::Quad(corners) => corners,
        }
    }

    /// The same seen from the other side.
    pub(crate) fn turned(self) -> Self {
        match self {
            Self::Triangle([a, b, c]) => Self::Triangle([a, c, b]),
            Self::Quad([a, b, c, d]) => Self::Quad([a, d, c, b]),
        }
    }
}

/// Why a polygon cannot be cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum PolygonError {
    #[error("coordinates that are not finite")]
    NotFinite,
    #[error("no area")]
    NoArea,
    #[error("an outline that crosses itself")]
    Crossing,
}

/// A polygon whose area is below this share of its squared extent has no area: its normal would be noise.
const LEAST_AREA: f64 = 1e-10;

/// A corner that turns by less than this (sine) is straight, and left out.
const STRAIGHT: f64 = 1e-9;

/// Corners this near to each other are one, relative to the polygon's extent: they may coincide once they are placed.
const REPEATED: f64 = 1e-9;

/// How far a corner of a quadrilateral may lie from the plane of the others, relative to its size: what files
/// written with six digits leave of a flat one.
const PLANAR: f64 = 1e-5;

/// A given quadrilateral counts as convex where all corners turn left by more than this (sine).
const CONVEX: f64 = 1e-3;

/// Triangles are joined where the quadrilateral's corners all turn left by more than this (sine of 15°).
const WELL_SHAPED: f64 = 0.26;

/// An end of an edge this close to another edge only touches it, relative to the polygon's extent.
const TOUCHING: f64 = 1e-9;

/// How much the pieces' area may differ from the polygon's, relatively; more means that the outline crosses itself.
const AREA_TOLERANCE: f64 = 1e-5;

/// Twice the area of a polygon times its normal (Newell): the mean one where the corners are not in one plane.
pub(crate) fn area_vector(points: &[DVec3]) -> DVec3 {
    let Some(&origin) = points.first() else { return DVec3::ZERO };
    (2..points.len()).map(|k| (points[k - 1] - origin).cross(points[k] - origin)).sum()
}

/// The polygon's corners relative to the first one, scaled to an extent of 1, and its unit normal.
fn normalised(points: &[DVec3], outline: usize) -> Result<(Vec<DVec3>, DVec3), PolygonError> {
    let Some(&origin) = points.first() else { return Err(PolygonError::NoArea) };
    let extent = points.iter().map(|p| (*p - origin).abs().max_element()).fold(0.0, f64::max);
    // `max` ignores NaN, so look at the points themselves, too.
    if !extent.is_finite() || points.iter().any(|p| !p.is_finite()) {
        return Err(PolygonError::NotFinite);
    }
    if extent < f64::MIN_POSITIVE {
        return Err(PolygonError::NoArea);
    }
    let points: Vec<_> = points.iter().map(|p| (*p - origin) / extent).collect();
    let normal = area_vector(&points[..outline]);
    let length = normal.length();
    if length > LEAST_AREA { Ok((points, normal / length)) } else { Err(PolygonError::NoArea) }
}

/// The unit normal of a polygon by the right-hand rule.
pub(crate) fn normal(points: &[DVec3]) -> Result<DVec3, PolygonError> {
    Ok(normalised(points, points.len())?.1)
}

/// Cuts a polygon into pieces. `holes` has the index of each hole's first corner, ascending; the outline ends where
/// the first one begins. Holes may run either way round. Time is
/// about linear in the number of corners for usual polygons, cubic for the worst ones.
///
/// # Errors
/// Where the outline has no area, crosses itself or a hole, or is not finite.
pub(crate) fn pieces(points: &[DVec3], holes: &[usize]) -> Result<Vec<Piece>, PolygonError> {
    let outline = holes.first().copied().unwrap_or(points.len());
    let (points, normal) = normalised(points, outline)?;
    let (right, up) = normal.any_orthonormal_pair();
    let flat: Vec<_> = points.iter().map(|p| DVec2::new(p.dot(right), p.dot(up))).collect();

    let (kept, kept_holes) = significant_corners(&flat, holes);
    if kept_holes.is_empty() {
        match *kept.as_slice() {
            [] | [_] | [_, _] => return Err(PolygonError::NoArea),
            [a, b, c] => return Ok(vec![Piece::Triangle([a, b, c])]),
            [a, b, c, d] if roundness(&points, &flat, [a, b, c, d]) > CONVEX => {
                return Ok(vec![Piece::Quad([a, b, c, d])]);
            }
            _ => {}
        }
    }
    if crosses_itself(&flat, &kept, &kept_holes) {
        return Err(PolygonError::Crossing);
    }
    let triangles = triangles(&flat, &kept, &kept_holes)?;
    Ok(joined(&points, &flat, &triangles))
}

/// Corners that are neither straight nor repeated, and where the holes begin among them. Holes that vanish are left
/// out.
fn significant_corners(flat: &[DVec2], holes: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let (mut kept, mut kept_holes) = (Vec::with_capacity(flat.len()), Vec::new());
    let mut start = 0;
    for (k, end) in holes.iter().copied().chain([flat.len()]).enumerate() {
        let first = kept.len();
        kept.extend(start..end);
        simplify(flat, &mut kept, first);
        if kept.len() < first + 3 {
            kept.truncate(first);
        } else if k > 0 {
            kept_holes.push(first);
        }
        start = end;
    }
    (kept, kept_holes)
}

/// Removes straight and repeated corners from the loop `kept[first..]`.
fn simplify(flat: &[DVec2], kept: &mut Vec<usize>, first: usize) {
    let given: Vec<_> = kept.drain(first..).collect();
    // A stack: taking a corner away may make the one before it straight.
    for &corner in &given {
        while kept.len() >= first + 2 && is_straight(flat, kept[kept.len() - 2], kept[kept.len() - 1], corner) {
            kept.pop();
        }
        if kept.len() == first || flat[kept[kept.len() - 1]].distance(flat[corner]) > REPEATED {
            kept.push(corner);
        }
    }
    // And around the end.
    let mut begin = first;
    while kept.len() > begin + 2 {
        let [last, before, head, next] = [kept[kept.len() - 1], kept[kept.len() - 2], kept[begin], kept[begin + 1]];
        if is_straight(flat, before, last, head) {
            kept.pop();
        } else if is_straight(flat, last, head, next) {
            begin += 1;
        } else {
            break;
        }
    }
    kept.drain(first..begin);
}

fn is_straight(flat: &[DVec2], a: usize, b: usize, c: usize) -> bool {
    let (to, from) = (flat[b] - flat[a], flat[c] - flat[b]);
    let (to_length, from_length) = (to.length(), from.length());
    to_length.min(from_length) <= REPEATED || to.perp_dot(from).abs() <= STRAIGHT * to_length * from_length
}

/// Where each loop begins and ends in a list of `count` corners.
fn loops(count: usize, holes: &[usize]) -> impl Iterator<Item = (usize, usize)> {
    std::iter::once(0).chain(holes.iter().copied()).zip(holes.iter().copied().chain([count]))
}

/// Whether two edges cross. Edges that only touch, as seams do, are fine. Ear clipping would cover some polygons that
/// cross themselves with triangles that overlap.
fn crosses_itself(flat: &[DVec2], kept: &[usize], holes: &[usize]) -> bool {
    let mut edges = Vec::with_capacity(kept.len());
    for (start, end) in loops(kept.len(), holes) {
        edges.extend((start..end).map(|k| [flat[kept[k]], flat[kept[if k + 1 < end { k + 1 } else { start }]]]));
    }
    edges.sort_by(|a, b| a[0].x.min(a[1].x).total_cmp(&b[0].x.min(b[1].x)));
    edges.iter().enumerate().any(|(k, &edge)| {
        let right = edge[0].x.max(edge[1].x);
        edges[k + 1..].iter().take_while(|other| other[0].x.min(other[1].x) <= right).any(|&other| crosses(edge, other))
    })
}

/// Whether two edges cross such that both ends of each are clearly on different sides of the other.
fn crosses([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> bool {
    let apart = |p: DVec2, q: DVec2, a: DVec2, b: DVec2| {
        let edge = b - a;
        let (left, right) = (edge.perp_dot(p - a), edge.perp_dot(q - a));
        left * right < 0.0 && left.abs().min(right.abs()) > TOUCHING * edge.length()
    };
    apart(c, d, a, b) && apart(a, b, c, d)
}

/// Triangles of the polygon whose corners `kept` lists, counter-clockwise.
fn triangles(flat: &[DVec2], kept: &[usize], holes: &[usize]) -> Result<Vec<[usize; 3]>, PolygonError> {
    let corners: Vec<_> = kept.iter().map(|&k| flat[k].to_array()).collect();
    let mut indices = Vec::new();
    Earcut::new().earcut_slice(&corners, holes, &mut indices);
    // Both banks of a seam have the same corners: as one, the seam is an inner edge and can be flipped or joined over.
    let mut first_at = HashMap::new();
    for index in &mut indices {
        let [x, y] = corners[*index].map(|v| (v + 0.0).to_bits());
        *index = *first_at.entry([x, y]).or_insert(*index);
    }
    let twice_area = |corners: &[usize]| -> f64 {
        let at = |k: usize| flat[kept[corners[k]]] - flat[kept[corners[0]]];
        (2..corners.len()).map(|k| at(k - 1).perp_dot(at(k))).sum()
    };
    indices = indices
        .chunks_exact(3)
        .filter_map(|t| {
            let area = twice_area(t);
            (area != 0.0).then(|| if area > 0.0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] })
        })
        .flatten()
        .collect();

    let mut expected = 0.0;
    for (k, (start, end)) in loops(kept.len(), holes).enumerate() {
        let area = twice_area(&(start..end).collect::<Vec<_>>());
        expected += if k == 0 { area } else { -area.abs() };
    }
    let found: f64 = indices.chunks_exact(3).map(twice_area).sum();
    if (found - expected).abs() > AREA_TOLERANCE * expected || expected <= 0.0 {
        return Err(PolygonError::Crossing);
    }
    refine(&mut indices, &corners);
    Ok(indices.chunks_exact(3).map(|t| [kept[t[0]], kept[t[1]], kept[t[2]]]).collect())
}

/// Pairs of triangles joined to quadrilaterals, the roundest first.
fn joined(points: &[DVec3], flat: &[DVec2], triangles: &[[usize; 3]]) -> Vec<Piece> {
    let mut edges = HashMap::with_capacity(3 * triangles.len());
    for (t, &[a, b, c]) in triangles.iter().enumerate() {
        for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
            edges.insert((from, to), (t, apex));
        }
    }
    let mut candidates = Vec::new();
    for (t, &[a, b, c]) in triangles.iter().enumerate() {
        for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
            if let Some(&(other, far)) = edges.get(&(to, from))
                && other > t
            {
                let quad = [apex, from, far, to];
                let quality = roundness(points, flat, quad);
                if quality > WELL_SHAPED {
                    candidates.push((quality, t, other, quad));
                }
            }
        }
    }
    // The sort is stable, so that equal qualities keep the order of the triangles.
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut quads = vec![None; triangles.len()];
    let mut used = vec![false; triangles.len()];
    for (_, t, other, quad) in candidates {
        if !used[t] && !used[other] {
            (used[t], used[other]) = (true, true);
            quads[t] = Some(Piece::Quad(quad));
        }
    }
    let pieces = triangles.iter().zip(quads).zip(used);
    pieces.filter_map(|((&triangle, quad), used)| if used { quad } else { Some(Piece::Triangle(triangle)) }).collect()
}

/// The least sine of a quadrilateral's corners: 1 for a rectangle, below 0 where it is concave or not planar.
fn roundness(points: &[DVec3], flat: &[DVec2], quad: [usize; 4]) -> f64 {
    let [a, b, c, d] = quad.map(|k| points[k]);
    let normal = (c - a).cross(d - b);
    let size = (c - a).length().max((d - b).length());
    // Both diagonals lie in planes perpendicular to this normal; the distance of the planes is the warp.
    let warp = (b - a).dot(normal.normalize_or_zero()).abs();
    if warp > PLANAR * size {
        return -1.0;
    }
    let mut least = 1.0_f64;
    for k in 0..4 {
        let [before, at, after] = [(k + 3) % 4, k, (k + 1) % 4].map(|k| flat[quad[k]]);
        let (to, from) = (at - before, after - at);
        least = least.min(to.perp_dot(from) / (to.length() * from.length()).max(f64::MIN_POSITIVE));
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Area of the pieces, all of which must have the polygon's orientation.
    fn area(points: &[DVec3], outline: usize, pieces: &[Piece]) -> f64 {
        let normal = normal(&points[..outline]).expect("a normal");
        pieces
            .iter()
            .map(|piece| {
                let corners: Vec<_> = piece.corners().iter().map(|&k| points[k]).collect();
                let area = 0.5 * area_vector(&corners).dot(normal);
                assert!(area > 0.0, "{piece:?} of {points:?} looks to the other side");
                area
            })
            .sum()
    }

    fn polygon(corners: &[[f64; 2]]) -> Vec<DVec3> {
        corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
    }

    const L: [[f64; 2]; 6] = [[-5.0, 0.0], [5.0, 0.0], [5.0, 10.0], [15.0, 10.0], [15.0, 20.0], [-5.0, 20.0]];

    /// Turns, scales and moves a polygon in space.
    fn placed(points: &[DVec3], scale: f64, offset: f64) -> Vec<DVec3> {
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -2.0);
        points.iter().map(|&p| turn * p * scale + DVec3::splat(offset)).collect()
    }

    #[test]
    fn triangles_and_convex_quadrilaterals_stay() {
        let quad = polygon(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]);
        assert_eq!(pieces(&quad, &[]), Ok(vec![Piece::Quad([0, 1, 2, 3])]), "square");
        assert_eq!(pieces(&quad[..3], &[]), Ok(vec![Piece::Triangle([0, 1, 2])]), "triangle");
        let mut back = quad;
        back.reverse();
        assert_eq!(pieces(&back, &[]), Ok(vec![Piece::Quad([0, 1, 2, 3])]), "the square's other side");
    }

    #[test]
    fn straight_and_repeated_corners_are_left_out() {
        let p = polygon(&[[2.0, 0.0], [4.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 2.0], [0.0, 0.0]]);
        assert_eq!(pieces(&p, &[]), Ok(vec![Piece::Quad([2, 3, 4, 6])]), "a square with corners to spare");
        let near = polygon(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [4.0, 4.0], [1e-30, 4.0], [0.0, 1e-30]]);
        assert_eq!(
            pieces(&near, &[]),
            Ok(vec![Piece::Quad([0, 1, 3, 4])]),
            "a square with corners as good as repeated"
        );
        let spike = polygon(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [9.0, 9.0], [4.0, 4.0], [0.0, 4.0]]);
        assert_eq!(pieces(&spike, &[]), Ok(vec![Piece::Quad([0, 1, 4, 5])]), "a square with a spike");
    }

    #[test]
    fn concave_ones_are_covered_by_few_pieces() {
        let l = polygon(&L);
        for (scale, offset) in [(1.0, 0.0), (1e-3, 0.0), (1e150, 0.0), (1e-150, 0.0), (1.0, 1e6)] {
            let p = placed(&l, scale, offset);
            let pieces = pieces(&p, &[]).expect("an L");
            assert_eq!(pieces.len(), 2, "two quadrilaterals: {pieces:?}");
            // In units of the polygon: areas would leave the range of f64.
            let q: Vec<_> = p.iter().map(|&v| (v - p[0]) / scale).collect();
            assert!((area(&q, 6, &pieces) - 300.0).abs() < 1e-6, "scale {scale}, offset {offset}: area");
        }
        let dart = polygon(&[[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]]);
        let two = pieces(&dart, &[]).expect("a dart");
        assert_eq!((two.len(), area(&dart, 4, &two)), (2, 4.0), "two triangles: {two:?}");
        let tooth = |i: u8| [[2.0 * f64::from(i) + 2.0, 5.0], [2.0 * f64::from(i) + 1.0, 1.0]];
        let comb: Vec<_> = [[0.0, 0.0], [16.0, 0.0]].into_iter().chain((0..8).rev().flat_map(tooth)).collect();
        let comb = placed(&polygon(&[comb, vec![[0.0, 5.0]]].concat()), 1.0, 0.0);
        let teeth = pieces(&comb, &[]).expect("a comb");
        // A spine of 16 × 1; on it a half tooth at each end and seven whole ones, 2 wide and 4 high.
        assert!((area(&comb, comb.len(), &teeth) - 48.0).abs() < 1e-9, "a comb of eight gaps: {teeth:?}");
    }

    #[test]
    fn holes_and_seams() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let one = [[1.0, 1.0], [1.0, 2.0], [2.0, 2.0], [2.0, 1.0]];
        let two = [[2.5, 2.5], [3.5, 2.5], [3.5, 3.5], [2.5, 3.5]];
        let p = polygon(&[square, one, two].concat());
        let found = pieces(&p, &[4, 8]).expect("two holes");
        assert!((area(&p, 4, &found) - 14.0).abs() < 1e-12, "16 − 1 − 1: {found:?}");
        let frame = pieces(&p[..8], &[4]).expect("one hole");
        assert_eq!(frame.len(), 4, "a frame is four quadrilaterals: {frame:?}");
        let seam = polygon(&[square.as_slice(), &square[..1], &one, &one[..1]].concat());
        let found = pieces(&seam, &[]).expect("a seam");
        assert!((area(&seam, seam.len(), &found) - 15.0).abs() < 1e-12, "16 − 1: {found:?}");
        assert_eq!(found.len(), 4, "a frame is four quadrilaterals, its seam notwithstanding: {found:?}");
    }

    #[test]
    fn warped_quadrilaterals_become_triangles() {
        let mut p = polygon(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]);
        p[2].z = 1e-6;
        assert_eq!(pieces(&p, &[]).map(|p| p.len()), Ok(1), "flat but for rounding");
        p[2].z = 0.1;
        let found = pieces(&p, &[]).expect("a warped square");
        assert!(matches!(found[..], [Piece::Triangle(_), Piece::Triangle(_)]), "{found:?}");
    }

    #[test]
    fn hopeless_ones_are_errors() {
        let p = polygon(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]);
        assert_eq!(pieces(&p, &[]), Err(PolygonError::NoArea), "a line");
        assert_eq!(pieces(&[], &[]), Err(PolygonError::NoArea), "nothing");
        assert_eq!(pieces(&[DVec3::ONE; 5], &[]), Err(PolygonError::NoArea), "a point");
        let mut p = polygon(&L);
        p[1].x = f64::NAN;
        assert_eq!(pieces(&p, &[]), Err(PolygonError::NotFinite), "not a number");
        p[1].x = f64::MAX;
        p[0].x = f64::MIN;
        assert_eq!(pieces(&p, &[]), Err(PolygonError::NotFinite), "differences overflow");
        let p = polygon(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [1.0, -1.0], [0.0, 4.0]]);
        assert_eq!(pieces(&p, &[]), Err(PolygonError::Crossing), "crossing itself");
        let bow = polygon(&[[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [2.0, 1.0]]);
        assert_eq!(pieces(&bow, &[]), Err(PolygonError::Crossing), "a quadrilateral whose corners are out of order");
        let zigzag: Vec<_> = (0..200).map(|i| [f64::from(i * 37 % 101), f64::from(i * 59 % 103)]).collect();
        assert_eq!(pieces(&polygon(&zigzag), &[]), Err(PolygonError::Crossing), "crossing itself everywhere");
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let across = [[3.0, 1.0], [5.0, 1.0], [5.0, 2.0], [3.0, 2.0]];
        let outside = across.map(|[x, y]| [x + 3.0, y]);
        for hole in [across, outside] {
            let p = polygon(&[square, hole].concat());
            assert_eq!(pieces(&p, &[4]), Err(PolygonError::Crossing), "a hole that is not inside");
        }
        // Winding round twice: ear clipping alone would cover it with triangles that overlap.
        let pentagram: Vec<_> = (0..5).map(|k| f64::from(2 * k) * std::f64::consts::TAU / 5.0).collect();
        let p = polygon(&pentagram.iter().map(|angle| [angle.cos(), angle.sin()]).collect::<Vec<_>>());
        assert_eq!(pieces(&p, &[]), Err(PolygonError::Crossing), "pentagram");
    }

    proptest! {
        /// Star-shaped polygons have no crossing, whatever their radii.
        #[test]
        fn stars_are_covered(radii in prop::collection::vec(0.05..1.0_f64, 3..60), scale in -6..6_i32) {
            let n = radii.len() as f64;
            let star: Vec<_> = radii.iter().enumerate().map(|(k, r)| {
                let (y, x) = (std::f64::consts::TAU * k as f64 / n).sin_cos();
                DVec3::new(x * r, y * r, 0.0)
            }).collect();
            let p = placed(&star, 10_f64.powi(scale), 0.0);
            let expected = 0.5 * area_vector(&p).length();
            let found = pieces(&p, &[]);
            prop_assert!(found.is_ok(), "{found:?}");
            let found = found.unwrap_or_default();
            prop_assert!((area(&p, p.len(), &found) / expected - 1.0).abs() < 1e-5, "area of {found:?}");
            prop_assert!(found.len() <= star.len() - 2, "no more than triangles");
        }

        /// Whatever the corners are: an answer that covers the area, or an error, never a panic.
        #[test]
        fn any_corners(
            corners in prop::collection::vec((-3..3_i8, -3..3_i8, prop_oneof![9 => Just(0.0), 1 => -1.0..1.0_f64]), 0..14),
            holes in prop::collection::vec(0..14_usize, 0..3),
        ) {
            let p: Vec<_> = corners.iter().map(|&(x, y, z)| DVec3::new(x.into(), y.into(), z)).collect();
            let mut holes: Vec<_> = holes.into_iter().filter(|&h| h <= p.len()).collect();
            holes.sort_unstable();
            if let Ok(found) = pieces(&p, &holes) {
                for corner in found.iter().flat_map(|piece| piece.corners()) {
                    prop_assert!(*corner < p.len(), "{found:?}");
                }
            }
        }
    }
}

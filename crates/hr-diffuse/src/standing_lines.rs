//! Where elements are cut: along the lines in which other polygons stand on them.
//!
//! Where a wall stands on a floor that goes on behind it, light ends at a line. An element on both sides of it has the mean of both, however
//! small it is, and sends that to both sides: into a dark room next to a lit one comes as much light through the wall as through its door. So
//! an element that is split is cut along such a line, not in its middle, and next to none is on both sides any more (discontinuities of degree
//! 0: P. Heckbert, "Discontinuity meshing for radiosity", Eurographics Workshop on Rendering 1992; here of rectangles only, and along their
//! sides, as most walls stand).

use crate::contacts::{contact, length_within, section};
use crate::geometry::{Domain, Geometry};
use crate::hierarchy::{Element, SceneData};
use crate::visibility::Region;
use glam::{Vec2, Vec3};
use smallvec::SmallVec;

/// What is no higher above an element than this, in unit space, and than the share of its radius, stands on it.
const MOST_GAP: f32 = 1e-3;
const GAP: f32 = 0.02;
/// A line is parallel to a side to this sine.
const STRAIGHT: f32 = 1e-3;
/// Corners of a parallelogram agree to this share of its size.
const EVEN: f32 = 1e-4;
/// Lines nearer to each other than this share of an element's radius are one; …
const LIKE: f32 = 0.01;
/// … it counts where something stands on this share of its length in the element, …
const LONG: f32 = 0.4;
/// … and no part is narrower than this share of the whole.
const NARROW: f32 = 0.2;
/// Parameters are rounded to this, so that parts beside each other are cut at the same ones.
const STEP: f32 = 1.0 / 16384.0;

/// A line in an element on which something stands.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// Whether u is constant on it; else v is.
    across_u: bool,
    at: f32,
    /// How much of it is stood on.
    length: f32,
}

/// The parts of an element on both sides of a line on which others stand, of several of the one next to its middle; `None` where there is none.
pub(crate) fn parts(scene: &SceneData, element: &Element) -> Option<[Domain; 2]> {
    let Domain { u0, v0, u1, v1 } = element.domain;
    let cuts = |line: &Line| {
        let [low, high] = if line.across_u { [u0, u1] } else { [v0, v1] };
        (line.at - low) / (high - low)
    };
    let lines = lines(scene, element);
    let inside = lines.iter().filter(|line| (NARROW..=1.0 - NARROW).contains(&cuts(line)));
    let next_to_middle = inside.min_by(|a, b| (cuts(a) - 0.5).abs().total_cmp(&(cuts(b) - 0.5).abs()))?;
    let (at, whole) = (next_to_middle.at, element.domain);
    Some(if next_to_middle.across_u {
        [Domain { u1: at, ..whole }, Domain { u0: at, ..whole }]
    } else {
        [Domain { v1: at, ..whole }, Domain { v0: at, ..whole }]
    })
}

/// Lines in an element that count.
fn lines(scene: &SceneData, element: &Element) -> SmallVec<[Line; 8]> {
    let geometry = &scene.surfaces()[element.source as usize];
    let Some([origin, u, v]) = parallelogram(geometry).filter(|_| element.importance > 0.0) else {
        return SmallVec::new();
    };
    let normal = element.normals.axis;
    let (height, gap) = (origin.dot(normal), (GAP * element.radius).min(MOST_GAP));
    let region =
        Region { bounds: geometry.bounds(element.domain).padded(gap), normal, heights: [height - gap, height + gap] };
    let outline: SmallVec<[Vec3; 4]> = geometry.corners(element.domain).iter().map(|uv| geometry.point(*uv)).collect();
    let mut found: SmallVec<[Line; 8]> = SmallVec::new();
    let near = LIKE * element.radius;
    scene.visibility.any_in(&region, |other| {
        let surface = &scene.surfaces()[other as usize];
        if other != element.source
            && contact(surface, geometry, (normal, near)).is_some_and(|contact| !contact.beside)
            && let Some([from, to]) = section(surface, normal, height + gap)
        {
            let length = length_within([from, to], (&outline, false), normal, element);
            let is_along =
                |side: Vec3| (to - from).cross(side).length() <= STRAIGHT * (to - from).length() * side.length();
            let across =
                |(one, other): (Vec3, Vec3)| (from - origin).cross(other).dot(normal) / one.cross(other).dot(normal);
            let line = if is_along(v) {
                Some((true, across((u, v)), u.length()))
            } else if is_along(u) {
                Some((false, across((v, u)), v.length()))
            } else {
                None
            };
            if let Some((across_u, at, side)) = line.filter(|_| length > 0.0) {
                let is_like = |line: &&mut Line| line.across_u == across_u && (line.at - at).abs() * side < near;
                match found.iter_mut().find(is_like) {
                    Some(line) => line.length += length,
                    None => found.push(Line { across_u, at: (at / STEP).round() * STEP, length }),
                }
            }
        }
        false
    });
    let Domain { u0, v0, u1, v1 } = element.domain;
    let whole = |line: &Line| if line.across_u { (v1 - v0).abs() * v.length() } else { (u1 - u0).abs() * u.length() };
    found.retain(|line| line.length > LONG * whole(line));
    found
}

/// Origin and sides of a surface whose parameters are those of a parallelogram.
fn parallelogram(geometry: &Geometry) -> Option<[Vec3; 3]> {
    let Geometry::Quad(_) = geometry else { return None };
    let [o, a, b, c] = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE].map(|uv| geometry.point(uv));
    let [u, v] = [a - o, b - o];
    ((o + u + v).distance(c) <= EVEN * u.length().min(v.length())).then_some([o, u, v])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hierarchy::Kind;
    use crate::{DiffuseMaterial, Rgb, SceneInput, Settings, Shape, Solver, Surface};
    use glam::DVec3;

    fn quad(o: DVec3, a: DVec3, b: DVec3) -> Surface {
        Surface::new(Shape::Quad([o, o + a, o + a + b, o + b]), 0)
    }

    /// The parts of the upper side of a floor of 7 × 3 m on which these stand.
    fn parts_below(others: impl IntoIterator<Item = Surface>) -> Vec<Domain> {
        let floor = quad(DVec3::ZERO, DVec3::X * 7.0, DVec3::Y * 3.0);
        let material = DiffuseMaterial { reflectance: Rgb::splat(0.5), exitance: Rgb::ZERO, two_sided: true };
        let surfaces = std::iter::once(floor).chain(others).collect();
        let input = SceneInput { surfaces, materials: vec![material], ..SceneInput::default() };
        let solver = Solver::new(&input, Settings::with_error(0.1), ()).expect("the scene is sound");
        let element = solver.elements.nodes[solver.elements.surface_nodes[0][0] as usize];
        assert_eq!(element.kind, Kind::Front, "the upper side");
        parts(&solver.scene, &element).into_iter().flatten().collect()
    }

    /// A wall across the floor, from a height on.
    fn wall(x: f64, height: f64) -> Surface {
        quad(DVec3::new(x, 0.0, height), DVec3::Y * 3.0, DVec3::Z * 2.5)
    }

    /// What the parts say of where the floor is cut, in meters from its first side.
    fn cut(parts: &[Domain]) -> f32 {
        let [first, second] = *parts else { panic!("{parts:?}") };
        assert!(first.u1 == second.u0 && (first.u0, second.u1) == (0.0, 1.0), "{parts:?}");
        assert!([first, second].iter().all(|part| (part.v0, part.v1) == (0.0, 1.0)), "{parts:?}");
        7.0 * first.u1
    }

    #[test]
    fn floors_are_cut_where_walls_stand() {
        assert!((cut(&parts_below([wall(4.0, 0.0)])) - 4.0).abs() < 7.0 * STEP, "at the wall");
        assert!((cut(&parts_below([wall(4.0, -1.0)])) - 4.0).abs() < 7.0 * STEP, "a wall that goes on below");
        let two = cut(&parts_below([wall(2.0, 0.0), wall(4.5, 0.0)]));
        assert!((two - 4.5).abs() < 7.0 * STEP, "next to the middle: {two}");
        let piece = |y: f64| quad(DVec3::new(4.0, y, 0.0), DVec3::Y, DVec3::Z);
        let door = cut(&parts_below([piece(0.0), piece(2.0)]));
        assert!((door - 4.0).abs() < 7.0 * STEP, "on both sides of a door");
    }

    #[test]
    fn floors_stay_whole_where_nothing_ends() {
        let short = quad(DVec3::new(4.0, 1.0, 0.0), DVec3::Y * 0.3, DVec3::Z);
        let slanted = quad(DVec3::new(3.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 0.0), DVec3::Z);
        let leg = Surface::new(
            Shape::Cone { ends: [DVec3::new(4.0, 1.5, 0.0), DVec3::new(4.0, 1.5, 1.0)], radii: [0.3; 2] },
            0,
        );
        for (what, other) in [
            ("hangs above it", wall(4.0, 0.5)),
            ("is below it", wall(4.0, -2.5)),
            ("stands at its side", wall(7.0, 0.0)),
            ("would leave next to nothing beside it", wall(6.9, 0.0)),
            ("is short", short),
            ("stands across", slanted),
            ("is round", leg),
        ] {
            assert_eq!(parts_below([other]), [], "what {what}");
        }
    }
}

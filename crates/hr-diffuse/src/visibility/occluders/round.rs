//! Outlines of spheres, cylinders and cones from a point: of the last two the lines that touch them are exact, circles are
//! polygons of the same area.

use super::doubled_area;
use crate::geometry::{Profile, Revolution};
use crate::visibility::pieces::Corners;
use glam::{DVec2, DVec3};
use smallvec::SmallVec;
use std::f64::consts::{PI, TAU};

/// Corners of the outline of a sphere, or a disk.
const AROUND: u32 = 20;
/// The angle that sides of a part of a circle span, at most.
const STEP: f64 = PI / 6.0;
/// Sine of the angle between directions that count as one.
const PARALLEL: f64 = 1e-5;
/// Points outside are at least this share of the radius outside: rounding must not tell where an outline is.
const OUTSIDE: f64 = 1e-3;

/// A convex body that hides what is behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Round {
    Ball {
        center: DVec3,
        radius: f64,
    },
    /// A cylinder or cone without its caps: `ends` of its axis, and the radii there.
    Tube {
        ends: [DVec3; 2],
        radii: [f64; 2],
    },
}

/// What of a body is before a plane.
pub(super) enum Before {
    Nothing,
    Round(Round),
}

/// Where points are from where outlines are asked for: between these, and in a ball.
#[derive(Clone, Debug)]
pub(super) struct Viewers {
    corners: SmallVec<[DVec3; 8]>,
    pub(super) middle: DVec3,
    radius: f64,
}

impl Viewers {
    pub(super) fn new(corners: SmallVec<[DVec3; 8]>) -> Self {
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let radius = corners.iter().map(|corner| corner.distance(middle)).fold(0.0, f64::max);
        Self { corners, middle, radius }
    }

    /// The least that all of them are beyond a plane.
    fn beyond(&self, on_plane: DVec3, normal: DVec3) -> f64 {
        self.corners.iter().map(|corner| (*corner - on_plane).dot(normal)).fold(f64::INFINITY, f64::min)
    }
}

/// A polygon in the place of a disk.
pub(super) fn disk(surface: &Revolution) -> Option<impl Iterator<Item = DVec3>> {
    let Profile::Line { from, to } = surface.profile() else { return None };
    let center = surface.center().as_dvec3() + surface.axis().as_dvec3() * f64::from(from.y);
    (from.y == to.y && from.x == 0.0).then(|| circle(center, surface.axis().as_dvec3(), f64::from(to.x)))
}

/// Corners of a polygon that has the area of a circle around an axis.
fn circle(center: DVec3, axis: DVec3, radius: f64) -> impl Iterator<Item = DVec3> {
    let (x, y) = axis.any_orthonormal_pair();
    let step = TAU / f64::from(AROUND);
    let radius = radius * outset(step);
    let (x, y, turn) = (x * radius, y * radius, DVec2::from_angle(step));
    let around = std::iter::successors(Some(DVec2::X), move |to| Some(turn.rotate(*to)));
    around.take(AROUND as usize).map(move |to| center + x * to.x + y * to.y)
}

/// What the corners of a polygon are further away than the circle of the same area, if its sides span this angle.
fn outset(step: f64) -> f64 {
    (step / step.sin()).sqrt()
}

impl Round {
    /// That of a surface; of a tube without caps what is seen through it is not hidden. None for a torus, a ring, and what may be around
    /// some of these points.
    pub(super) fn of(surface: &Revolution, viewers: &Viewers) -> Option<Self> {
        let (origin, axis) = (surface.center().as_dvec3(), surface.axis().as_dvec3());
        let round = match surface.profile() {
            Profile::Line { from, to } if from.y != to.y => Self::Tube {
                ends: [from, to].map(|end| origin + axis * f64::from(end.y)),
                radii: [from, to].map(|end| f64::from(end.x)),
            },
            Profile::Arc { center: 0.0, radius, .. } => Self::Ball { center: origin, radius: f64::from(radius) },
            _ => return None,
        };
        round.is_outside(viewers).then_some(round)
    }

    /// Whether it is around none of these points.
    fn is_outside(&self, viewers: &Viewers) -> bool {
        match *self {
            Self::Ball { center, radius } => {
                let low = viewers.corners.iter().copied().reduce(DVec3::min).unwrap_or(center);
                let high = viewers.corners.iter().copied().reduce(DVec3::max).unwrap_or(center);
                let apart = (low - center).max(center - high).max(DVec3::ZERO).length();
                apart > radius * (1.0 + OUTSIDE)
            }
            Self::Tube { ends, radii } => {
                let Along { axis, length, aside, .. } = Along::new(ends, viewers.middle);
                let beyond = viewers.beyond(ends[0], -axis).max(viewers.beyond(ends[1], axis));
                let beside = aside.length() - viewers.radius;
                let beside = beside.max(viewers.beyond(ends[0], aside.normalize_or_zero()));
                beyond > OUTSIDE * length || beside > radii[0].max(radii[1]) * (1.0 + OUTSIDE)
            }
        }
    }

    /// What of it is before a plane, by its unit normal and distance from the zero point. None where that is another kind of body.
    pub(super) fn before(self, normal: DVec3, plane: f64) -> Option<Before> {
        let [low, high] = self.heights(normal).map(|height| height - plane);
        if high <= 0.0 {
            return Some(Before::Nothing);
        }
        if low >= 0.0 {
            return Some(Before::Round(self));
        }
        let Self::Tube { mut ends, mut radii } = self else { return None };
        if (ends[1] - ends[0]).normalize().cross(normal).length() > PARALLEL {
            return None;
        }
        let heights = ends.map(|end| end.dot(normal) - plane);
        let cut = heights[0] / (heights[0] - heights[1]);
        let behind = usize::from(heights[1] < 0.0);
        ends[behind] = ends[0] + (ends[1] - ends[0]) * cut;
        radii[behind] = radii[0] + (radii[1] - radii[0]) * cut;
        Some(Before::Round(Self::Tube { ends, radii }))
    }

    /// The least and the greatest coordinate along a unit direction.
    fn heights(&self, direction: DVec3) -> [f64; 2] {
        match self {
            Self::Ball { center, radius } => [-radius, *radius].map(|off| center.dot(direction) + off),
            Self::Tube { ends, radii } => {
                let axis = (ends[1] - ends[0]).normalize();
                let reach = axis.cross(direction).length();
                let [low, high] =
                    [-reach, reach].map(|reach| [0, 1].map(|end| ends[end].dot(direction) + radii[end] * reach));
                [low[0].min(low[1]), high[0].max(high[1])]
            }
        }
    }

    /// Its outline as it is seen from a point outside, relative to that, in the place of another polygon. Tells whether its normal points
    /// away from there.
    pub(super) fn seen_from(&self, x: DVec3, outline: &mut Corners) -> bool {
        outline.clear();
        match *self {
            Self::Ball { center, radius } => {
                let to = center - x;
                // What a cone from x touches, over the distance and the radius.
                let share = (1.0 - radius * radius / to.length_squared()).max(0.0);
                outline.extend(circle(to * share, to.normalize(), radius * share.sqrt()));
                points_away(outline, to)
            }
            Self::Tube { ends, radii } => {
                let Along { axis, length, height, aside } = Along::new(ends, x);
                let distance = aside.length();
                let radius_there = radii[0] + (radii[1] - radii[0]) * (height / length);
                if radius_there.abs() >= distance {
                    // One end is before the other, and all that is between: the near one, or the base of a cone that is seen from its tip.
                    let end = usize::from((height > 0.0) == (radius_there > 0.0));
                    outline.extend(circle(ends[end] - x, axis, radii[end]));
                    return points_away(outline, ends[end] - x);
                }
                let toward = aside / distance;
                let side = axis.cross(toward);
                // Where lines from x touch it, around the axis, from the direction of x.
                let touch = (radius_there / distance).acos();
                let mut arc = |end: usize, [from, to]: [f64; 2]| {
                    let sides = ((to - from).abs() / STEP).ceil().max(1.0);
                    let (step, center) = ((to - from) / sides, ends[end] - x);
                    let sides = sides as u32;
                    for i in 0..=sides {
                        let out = if i % sides == 0 { 1.0 } else { outset(step.abs()) };
                        let (sin, cos) = (from + step * f64::from(i)).sin_cos();
                        outline.push(center + (toward * cos + side * sin) * (radii[end] * out));
                    }
                };
                // Beyond the end of the axis one sees the far half of the circle behind the cap, else the near half before it.
                arc(0, if height < 0.0 { [touch, TAU - touch] } else { [touch, -touch] });
                arc(1, if height > length { [-touch, touch - TAU] } else { [-touch, touch] });
                points_away(outline, 0.5 * (ends[0] + ends[1]) - x)
            }
        }
    }

    /// The ends of a tube as they are seen from a point outside, relative to that, where one may see through both; each with whether its
    /// normal points away from there.
    pub(super) fn openings(&self, x: DVec3) -> Option<[(Corners, bool); 2]> {
        let Self::Tube { ends, radii } = *self else { return None };
        let Along { axis, length, height, aside } = Along::new(ends, x);
        // Lines through both ends are within this radius.
        let along = height / length;
        let within = (1.0 - along).abs() * radii[0] + along.abs() * radii[1];
        let sees_through = (height < 0.0 || height > length) && aside.length() < within && radii[0].min(radii[1]) > 0.0;
        sees_through.then(|| {
            [0, 1].map(|end| {
                let opening: Corners = circle(ends[end] - x, axis, radii[end]).collect();
                let away = points_away(&opening, ends[end] - x);
                (opening, away)
            })
        })
    }
}

/// Where a point is along an axis.
struct Along {
    /// Unit vector.
    axis: DVec3,
    length: f64,
    /// From the first end.
    height: f64,
    /// From the axis to the point.
    aside: DVec3,
}

impl Along {
    fn new(ends: [DVec3; 2], x: DVec3) -> Self {
        let axis = ends[1] - ends[0];
        let length = axis.length();
        let axis = axis / length;
        let to = x - ends[0];
        let height = to.dot(axis);
        Self { axis, length, height, aside: to - axis * height }
    }
}

/// Whether the normal of a polygon points away from the zero point, given a direction toward its middle.
fn points_away(polygon: &[DVec3], middle: DVec3) -> bool {
    doubled_area(polygon).dot(middle) > 0.0
}

//! Surfaces whose normals are nearly the same hardly see each other: only along their planes, where both are seen edge-on.
//!
//! A smooth mesh is thousands of polygons, each of which faces some of its neighbours where it is hollow. By their boxes, which touch,
//! a neighbour could be all that a polygon sees.

use crate::cone::Cone;

/// Most of the view of any point of a surface that another one takes up, by the normals of both: of irradiance, what one unit of the
/// other's radiosity makes; 1 where normals tell nothing.
///
/// If all normals are within α of an axis, two points that face each other see each other in directions within α of the plane across that
/// axis. What a point sees beyond that, the directions within π/2 − α of the axis, is cos³α of its view at least, where its normal is farthest off.
pub(crate) fn most_view(a: &Cone, b: &Cone) -> f32 {
    let between = a.axis.cross(b.axis).length().atan2(a.axis.dot(b.axis));
    let (wide, narrow) = (a.angle().max(b.angle()), a.angle().min(b.angle()));
    // The least cone about both.
    let half = wide.max(0.5 * (between + wide + narrow));
    1.0 - half.cos().max(0.0).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{cosine_direction, hash, unit};
    use glam::Vec3;
    use std::f32::consts::TAU;

    fn tilted(axis: Vec3, angle: f32, around: f32) -> Vec3 {
        let side = axis.any_orthonormal_vector();
        axis * angle.cos() + (side * around.cos() + axis.cross(side) * around.sin()) * angle.sin()
    }

    /// Of what normals within a cone see, how much may see them: by directions, for all normals of the one, and the best one of the other.
    #[test]
    fn no_view_is_more_than_its_bound() {
        const DIRECTIONS: u32 = 4096;
        let mut tightest = f32::INFINITY;
        for trial in 0..300 {
            let random = |i: u32| unit(hash(trial, i));
            let (wide, narrow) = (0.5 * random(0), 0.3 * random(1));
            let axis = tilted(Vec3::new(0.6, 0.0, 0.8), 3.0 * random(2), TAU * random(3));
            let other = tilted(axis, 0.8 * random(4) * random(5), TAU * random(6));
            let cone = |axis: Vec3, angle: f32| Cone { axis, cos_angle: angle.cos() };
            let most = most_view(&cone(axis, wide), &cone(other, narrow));
            let normal = tilted(axis, wide * random(7).sqrt(), TAU * random(8));
            let faced = |i: &u32| {
                let direction = cosine_direction(normal, unit(hash(*i, 1)), unit(hash(*i, 2)));
                other.angle_between(-direction) < std::f32::consts::FRAC_PI_2 + narrow
            };
            let seen = (0..DIRECTIONS).filter(faced).count() as f32 / DIRECTIONS as f32;
            let noise = 4.0 * (most / DIRECTIONS as f32).sqrt();
            assert!(seen <= most + noise, "{trial}: {seen} of a view, at most {most}");
            tightest = tightest.min(most / seen.max(0.01));
        }
        assert!(tightest < 1.6, "no bound is nearer than {tightest} times what may be seen");
        let plane = Cone::single(Vec3::Z);
        assert_eq!(most_view(&plane, &plane), 0.0, "parallel ones see nothing of each other");
        assert_eq!(most_view(&plane, &Cone::SPHERE), 1.0, "whatever is seen of those that face anywhere");
    }
}

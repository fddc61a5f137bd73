//! Integrals of distributions: over all directions, and of the quantity times the cosine to a normal.
//!
//! Both are linear in the values at a piece's corners, and the cosine is linear in the normal. So the integrals of each corner's hat
//! function, and of that times the direction, are known for all triangles but the finest, once for one face of the octahedron: the others
//! mirror it. Only what the horizon cuts takes quadrature.

use super::{Haar, Piece, face_corners};
use crate::Rgb;
use crate::basis::triangle::{EDGE_ENDS, Triangle, child_corners, midpoints};
use glam::{DVec3, Vec3, Vec4};
use std::sync::LazyLock;

/// Of triangles down to this level moments are kept, 64 KB; finer ones take three points each.
const KEPT_LEVEL: u32 = 5;
/// How many there are on a face.
const KEPT: usize = (4_usize.pow(KEPT_LEVEL + 1) - 1) / 3;
/// What the horizon cuts is split down to this level, and twice at least: the cosine has a kink there.
const HORIZON_LEVEL: u32 = 4;
const HORIZON_SPLITS: u32 = 2;

/// By corner of a triangle: ∫ hat · direction dω and, last, ∫ hat dω.
type Moments = [Vec4; 3];

/// By [place](super::Visit::place) on the face of positive directions.
static MOMENTS: LazyLock<Box<[Moments]>> = LazyLock::new(|| {
    let mut all = vec![[Vec4::ZERO; 3]; KEPT];
    find(0, &Triangle::new(face_corners(0)), 0, &mut all);
    all.into()
});

/// Finds the moments of a triangle and of all its parts.
fn find(place: usize, triangle: &Triangle, level: u32, all: &mut [Moments]) {
    if level == KEPT_LEVEL {
        let hats = [DVec3::X, DVec3::Y, DVec3::Z];
        let by_corner = |weight: &dyn Fn(Vec3) -> f32| triangle.integrate(hats, 1, &weight).0.to_array();
        let [x, y, z, one] = [by_corner(&|d| d.x), by_corner(&|d| d.y), by_corner(&|d| d.z), by_corner(&|_| 1.0)];
        all[place] = [0, 1, 2].map(|k| Vec4::new(x[k] as f32, y[k] as f32, z[k] as f32, one[k] as f32));
        return;
    }
    for child in 0..4 {
        let below = 4 * place + 1 + child;
        find(below, &triangle.child(child), level + 1, all);
        // What each of this triangle's hats is at the child's corners.
        let hats = [Vec3::X, Vec3::Y, Vec3::Z];
        for (hats, moment) in child_corners(hats, midpoints(hats), child).into_iter().zip(all[below]) {
            all[place].iter_mut().zip(hats.to_array()).for_each(|(sum, hat)| *sum += moment * hat);
        }
    }
}

impl Haar {
    /// ∫ over the sphere, per steradian of the quantity: of intensity (W/sr), the power (W).
    #[must_use]
    pub fn integral(&self) -> Rgb {
        self.sum_of_pieces(|piece| match MOMENTS.get(piece.place) {
            Some(moments) => piece.dot(moments.map(|moment| moment.w)),
            None => piece.triangle.integrate(piece.values.map(Vec3::as_dvec3), 0, &|_| 1.0).0,
        })
    }

    /// ∫ of the quantity times the cosine to `normal` (unit length) over the hemisphere around it: of radiance
    /// (W/(m² sr)), the radiosity (W/m²).
    #[must_use]
    pub fn cosine_integral(&self, normal: Vec3) -> Rgb {
        self.sum_of_pieces(|piece| piece.above(normal, HORIZON_LEVEL.saturating_sub(piece.level()).max(HORIZON_SPLITS)))
    }

    /// Adds up integrals over the pieces, in units of the scale.
    fn sum_of_pieces(&self, integral: impl Fn(&Piece) -> DVec3) -> Rgb {
        let mut sum = DVec3::ZERO;
        self.pieces(&mut |_| true, &mut |piece| sum += integral(piece));
        (sum * f64::from(self.scale)).as_vec3()
    }
}

impl Piece {
    fn level(&self) -> u32 {
        (3 * self.place + 1).ilog(4)
    }

    fn dot(&self, weights: [f32; 3]) -> DVec3 {
        self.values.into_iter().zip(weights).map(|(value, weight)| value.as_dvec3() * f64::from(weight)).sum()
    }

    /// ∫ of the quantity times the cosine to a normal where that is positive: what the horizon cuts is split so often.
    fn above(&self, normal: Vec3, splits: u32) -> DVec3 {
        let heights = self.triangle.corners.map(|corner| corner.dot(normal));
        if heights.iter().all(|&height| height <= 0.0) {
            return DVec3::ZERO;
        }
        let is_cut = heights.iter().any(|&height| height < 0.0);
        if !is_cut && let Some(moments) = MOMENTS.get(self.place) {
            // On the face of positive directions the normal's mirror image has these cosines.
            let mirrored = (self.triangle.signs() * normal).extend(0.0);
            return self.dot(moments.map(|moment| moment.dot(mirrored)));
        }
        if !is_cut || splits == 0 {
            return self.triangle.integrate(self.values.map(Vec3::as_dvec3), 0, &|d| d.dot(normal).max(0.0)).0;
        }
        let mids = EDGE_ENDS.map(|[a, b]| 0.5 * (self.values[a] + self.values[b]));
        let triangles = self.triangle.children();
        let part = |child: usize| Self {
            triangle: triangles[child],
            place: 4 * self.place + 1 + child,
            values: child_corners(self.values, mids, child),
        };
        (0..4).map(|child| part(child).above(normal, splits - 1)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Known;
    use crate::haar::{MAX_LEVEL, Refinement};
    use hr_diffuse::sampling::{hash, unit};

    /// Both integrals are those of a quadrature over fine parts, whatever the horizon cuts.
    #[test]
    fn integrals_are_those_of_fine_quadrature() {
        let random = |i: u32| Vec3::from_array([0, 1, 2].map(|k| 2.0 * unit(hash(i, k)) - 1.0));
        let lobe = random(5).normalize();
        let quantity = |d: Vec3| Rgb::new(d.dot(lobe).max(0.0).powi(40), 1.0 + d.x, d.z * d.y);
        let haar = Haar::project(&Refinement::default(), &Known::NOTHING, quantity).distribution;
        for normal in (10..20).map(|i| random(i).normalize()).chain([Vec3::Z, Vec3::NEG_X]) {
            let (mut all, mut above) = (DVec3::ZERO, DVec3::ZERO);
            haar.pieces(&mut |_| true, &mut |piece| {
                let values = piece.values.map(|value| value.as_dvec3() * f64::from(haar.scale));
                let splits = 6_u32.saturating_sub(piece.level()).max(3);
                all += piece.triangle.integrate(values, splits, &|_| 1.0).0;
                above += piece.triangle.integrate(values, splits, &|d| d.dot(normal).max(0.0)).0;
            });
            let off = |found: Rgb, right: DVec3| (found.as_dvec3() - right).abs().max_element();
            assert!(off(haar.integral(), all) < 1e-5, "{} {all}", haar.integral());
            let found = haar.cosine_integral(normal);
            assert!(off(found, above) < 1e-4, "to {normal}: {found} {above}");
        }
    }

    /// However fine a triangle is, its level is told by its place.
    #[test]
    fn places_tell_levels() {
        let mut first = 0;
        for level in 0..=u32::from(MAX_LEVEL) {
            let last = 4 * first;
            let levels = [first, last].map(|place| {
                let triangle = Triangle::new(face_corners(0));
                Piece { triangle, place, values: [Rgb::ZERO; 3] }.level()
            });
            assert_eq!(levels, [level; 2], "places {first} to {last}");
            first = last + 1;
        }
    }
}

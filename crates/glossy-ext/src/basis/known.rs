//! What is known of a function before it is sampled, and how it is sampled.

use crate::Rgb;
use glam::Vec3;
use hr_diffuse::Cone;

/// What the function is taken to be where it is known to vanish, in the triangles that straddle the border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beyond {
    /// Zero. Right for functions that fall to zero at the border, such as the intensity of a flat surface; a step
    /// there is smeared over the width of a triangle.
    Zero,
    /// As on the border's nearest point, where the function is evaluated. Right for functions with a step at the
    /// border, such as the radiance of a surface, that are never looked up beyond it.
    Continued,
}

/// Where the function is not zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// The directions where the function is evaluated, and no others.
    pub cone: Cone,
    /// What to interpolate with outside.
    pub beyond: Beyond,
}

impl Support {
    /// Whether a direction of any length is inside.
    pub(crate) fn contains(&self, direction: Vec3) -> bool {
        self.cone.axis.dot(direction) >= self.cone.cos_angle * direction.length()
    }
}

/// A direction in which a narrow lobe points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Unit direction of its middle.
    pub direction: Vec3,
    /// Angle in radians from the middle within which triangles are made no larger than this angle.
    pub width: f32,
}

/// What is known of a function before it is sampled.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// Where it is not zero, if not everywhere.
    pub support: Option<Support>,
    /// What is added to the middle value in the relative test: the diffuse radiance beside which glossy detail is
    /// negligible. In the unit of the function.
    pub offset: Rgb,
    /// Where lobes point, lest they be missed between the samples.
    pub peaks: &'a [Peak],
    /// Angle in radians: what is no wider is not refined any more. 0 to leave that to the settings alone.
    pub finest: f32,
    /// What differs by no more than this, in the unit of the function, is not refined. Bases that do not adapt take no notice.
    pub negligible: f32,
    /// Interpolation is to be as exact as this, relative to the function, and no more; from 1 on, as exact as the settings say. Bases that
    /// do not adapt take no notice.
    pub error: f32,
}

impl Known<'_> {
    /// Nothing: the whole sphere, no offset, no peaks.
    pub const NOTHING: Known<'static> =
        Known { support: None, offset: Rgb::ZERO, peaks: &[], finest: 0.0, negligible: 0.0, error: 1.0 };
}

/// A projection and what it took.
#[derive(Clone, Debug)]
pub struct Projected<B> {
    /// The distribution.
    pub distribution: B,
    /// How often the function was evaluated.
    pub evaluations: usize,
    /// How often terms of a sum were evaluated, …
    pub terms: usize,
    /// … and how often they were not, since they were known by interpolation.
    pub interpolated: usize,
    /// How many of its values were infinite or not a number, and were replaced by 0.
    pub not_finite: usize,
    /// Triangles that were left as they are only because what differs over them is negligible.
    pub spared: usize,
    /// Whether refinement stopped because a distribution cannot be larger.
    pub truncated: bool,
}

/// The function, called only where it should be.
pub(crate) struct Sampler<'a> {
    support: Option<&'a Support>,
    evaluations: usize,
    not_finite: usize,
    /// Largest component met so far.
    pub(crate) largest: f32,
}

impl<'a> Sampler<'a> {
    pub(crate) fn new(support: Option<&'a Support>) -> Self {
        Self { support, evaluations: 0, not_finite: 0, largest: 0.0 }
    }

    pub(crate) fn is_inside(&self, position: Vec3) -> bool {
        self.support.is_none_or(|s| s.contains(position))
    }

    /// What came of it.
    pub(crate) fn projected<B>(&self, distribution: B) -> Projected<B> {
        let Self { evaluations, not_finite, .. } = *self;
        Projected {
            distribution,
            evaluations,
            terms: evaluations,
            interpolated: 0,
            not_finite,
            spared: 0,
            truncated: false,
        }
    }

    /// The value of the function in a direction of any length but 0.
    pub(crate) fn at(&mut self, position: Vec3, f: impl FnOnce(Vec3) -> Rgb) -> Rgb {
        let mut direction = position.normalize();
        if let Some(support) = self.support.filter(|_| !self.is_inside(direction)) {
            match support.beyond {
                Beyond::Zero => return Rgb::ZERO,
                Beyond::Continued => direction = onto_border(&support.cone, direction),
            }
        }
        self.evaluations += 1;
        let value = f(direction);
        if !value.is_finite() {
            self.not_finite += 1;
            return Rgb::ZERO;
        }
        self.largest = self.largest.max(value.abs().max_element());
        value
    }
}

/// The direction of a cone's border nearest to one outside.
fn onto_border(cone: &Cone, direction: Vec3) -> Vec3 {
    let aside = (direction - cone.axis * cone.axis.dot(direction)).normalize_or(cone.axis.any_orthonormal_vector());
    let cos = cone.cos_angle.clamp(-1.0, 1.0);
    (cone.axis * cos + aside * (1.0 - cos * cos).max(0.0).sqrt()).normalize()
}

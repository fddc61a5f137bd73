//! Functions of a direction that are sums, such as what the samples at a leaf make together.

use super::Peak;
use crate::Rgb;
use glam::Vec3;

/// A function of a direction that is made of a sum of terms.
///
/// Bases that adapt need not ask for all terms everywhere: where a term is smooth it is known from a few directions.
pub trait Superposition {
    /// What a term is.
    type Term: Copy;

    /// All of them.
    fn terms(&self) -> &[Self::Term];

    /// Where a term is narrow: around that it is not known from a few directions.
    fn peak(&self, term: &Self::Term) -> Peak;

    /// Some terms in a unit direction, added up.
    fn add_up(&self, terms: &[Self::Term], direction: Vec3) -> Rgb;

    /// Each of some terms in a unit direction: as many values as terms.
    fn each(&self, terms: &[Self::Term], direction: Vec3, values: &mut [Rgb]) {
        for (term, value) in std::iter::zip(terms, values) {
            *value = self.add_up(std::slice::from_ref(term), direction);
        }
    }

    /// The value of the function in a unit direction where the terms add up to `sum`.
    fn value(&self, direction: Vec3, sum: Rgb) -> Rgb;

    /// The value with all terms.
    fn at(&self, direction: Vec3) -> Rgb {
        self.value(direction, self.add_up(self.terms(), direction))
    }
}

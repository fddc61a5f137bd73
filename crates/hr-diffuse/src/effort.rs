//! How much is spent on what rays find, beside how fine links are.
//!
//! Where much hides much, what leaves see of senders and what regions get is known by rays, and no finer links make up for too few of
//! these. Noise shrinks with the root of their number, so that who asks for half the error needs four times as many.

/// The tolerance of links of a pass in which rays are as many as usual: that of the first close look toward an error of 0.05.
const USUAL: f32 = 0.16;
/// Effort is to the tolerance's reciprocal to this power: what the soda shop's diffuse variant is off by is least for its time so.
const GROWS: f32 = 2.0 / 3.0;
/// More effort takes more time than what it brings is worth.
pub(crate) const MOST: f32 = 16.0;

/// What a pass is held to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Aim {
    /// Relative error that its links may have, if it all comes to the worst.
    pub(crate) tolerance: f32,
    /// How many times finer than usual what rays find is to be known, 1 to [`MOST`].
    pub(crate) effort: f32,
}

impl Aim {
    /// Rays as links ask for; where all is looked at, whatever it brings (a tolerance of nothing), as usual.
    pub(crate) fn of(tolerance: f32) -> Self {
        let effort = if tolerance > 0.0 { (USUAL / tolerance).powf(GROWS).clamp(1.0, MOST) } else { 1.0 };
        Self { tolerance, effort }
    }
}

impl Default for Aim {
    fn default() -> Self {
        Self::of(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_asks_for_less_error_gets_more_rays() {
        let effort = |tolerance| Aim::of(tolerance).effort;
        assert_eq!([1.0, USUAL, 0.0].map(effort), [1.0; 3]);
        assert!((effort(USUAL / 8.0) - 4.0).abs() < 1e-5);
        assert_eq!(effort(1e-6), MOST);
    }
}

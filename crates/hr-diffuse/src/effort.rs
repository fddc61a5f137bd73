//! How much is spent on what rays find, beside how fine links are.
//!
//! Where much hides much, what leaves see of senders and what regions get is known by rays, and no finer links make up for too few of
//! these. Noise shrinks with the root of their number, so that who asks for half the error needs four times as many.

/// The tolerance of links of a pass in which rays are as many as usual: that of the first close look toward an error of 0.05.
const USUAL: f32 = 0.16;
/// More is not worth the while: passes that go on in vain would take the longer. With 16 a room into which a lamp without extent shines
/// through a small window took minutes.
const MOST: f32 = 2.5;

/// How many times finer than usual a pass of some tolerance is to know what rays find; where all is looked at, whatever it brings
/// (a tolerance of nothing), as usual.
pub(crate) fn effort(tolerance: f32) -> f32 {
    if tolerance > 0.0 { (USUAL / tolerance).clamp(1.0, MOST) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_asks_for_less_error_gets_more_rays() {
        assert_eq!([1.0, USUAL, 0.0].map(effort), [1.0; 3]);
        assert!((effort(0.5 * USUAL) - 2.0).abs() < 1e-6);
        assert_eq!(effort(1e-6), MOST);
    }
}

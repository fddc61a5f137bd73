//! What a leaf sends between two times that it is reflected: the same, in proportion to what arrives.

use crate::Rgb;

/// What is known of the last time that a leaf was reflected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sent {
    /// Where so much arrives (irradiance), …
    irradiance: Rgb,
    /// … so many times as much is sent as was reflected.
    times: Rgb,
    /// So many times as much as was reflected is sent now.
    strength: Rgb,
    /// What was negligible of what was reflected ([`Arrived::negligible`](crate::hooks::Arrived)).
    negligible: f32,
}

impl Sent {
    /// Nothing.
    pub(crate) const NOTHING: Self =
        Self { irradiance: Rgb::NEG_INFINITY, times: Rgb::ONE, strength: Rgb::ONE, negligible: 0.0 };

    /// What was reflected of so much irradiance, just now.
    pub(crate) const fn of(irradiance: Rgb, negligible: f32) -> Self {
        Self { irradiance, negligible, ..Self::NOTHING }
    }

    /// It goes on being sent, but is to be reflected anew, however little changes.
    pub(crate) fn forget(&mut self) {
        self.irradiance = Rgb::NEG_INFINITY;
    }

    /// Whether anything was reflected, and has not been forgotten.
    pub(crate) fn is_known(&self) -> bool {
        self.irradiance != Rgb::NEG_INFINITY
    }

    /// Where so much arrived it was reflected, or was expected to send what it does.
    pub(crate) fn irradiance(&self) -> Option<Rgb> {
        self.is_known().then_some(self.irradiance)
    }

    /// By how much what arrives has changed (irradiance); infinite where nothing is known.
    pub(crate) fn change(&self, now: Rgb) -> f32 {
        (now - self.irradiance).abs().max_element()
    }

    /// What is negligible of what is sent now: what was of what was reflected (see [`Arrived`](crate::hooks::Arrived)), in proportion.
    pub(crate) fn negligible(&self) -> f32 {
        self.negligible * self.strength.max_element()
    }

    /// Where it was to be expected that so many times as much arrives, that is no change.
    pub(crate) fn expect(&mut self, times: Rgb) {
        if self.is_known() {
            self.irradiance *= times;
            self.times *= times;
        }
    }

    /// So many times as much as was reflected is sent, where so much arrives; what changes that by less than a share, `step`, of it
    /// does not.
    pub(crate) fn follow(&mut self, now: Rgb, step: f32) -> Rgb {
        let (was, times, strength) = (self.irradiance, self.times, self.strength);
        // A channel in which nothing arrived was reflected as nothing.
        let in_proportion = |c: usize| Some(now[c] / was[c] * times[c]).filter(|s| was[c] > 0.0 && s.is_finite());
        let wanted = Rgb::from_array(std::array::from_fn(|c| in_proportion(c).unwrap_or(strength[c])));
        if (wanted - strength).abs().cmpgt(step * strength).any() {
            self.strength = wanted;
        }
        self.strength
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f32 = 0.01;

    #[test]
    fn it_follows_what_arrives_in_steps() {
        let mut sent = Sent::of(Rgb::new(2.0, 1.0, 0.0), 0.0);
        assert_eq!(sent.follow(Rgb::new(2.01, 1.005, 0.0), STEP), Rgb::ONE, "too little to tell");
        assert_eq!(sent.follow(Rgb::new(1.0, 3.0, 5.0), STEP), Rgb::new(0.5, 3.0, 1.0), "each channel by itself");
        assert_eq!(sent.follow(Rgb::ZERO, STEP), Rgb::new(0.0, 0.0, 1.0), "it is dark now");
        assert_eq!(sent.follow(Rgb::new(2.0, 1.0, 0.0), STEP), Rgb::ONE, "and light again");
        assert_eq!(sent.follow(Rgb::splat(f32::MAX), STEP).x, 0.5 * f32::MAX, "as far as numbers go");
    }

    /// Where all light is dimmed, what is negligible is dimmed with it: nothing need be looked at more closely.
    #[test]
    fn what_is_negligible_follows_what_is_sent() {
        let mut sent = Sent::of(Rgb::ONE, 0.2);
        assert_eq!(sent.negligible(), 0.2);
        sent.follow(Rgb::new(0.25, 0.5, 0.1), STEP);
        assert_eq!(sent.negligible(), 0.1, "as its strongest channel");
    }

    #[test]
    fn what_was_expected_is_no_change() {
        let mut sent = Sent::of(Rgb::ONE, 0.0);
        let times = Rgb::new(0.5, 2.0, 1.0);
        assert_eq!(sent.change(times), 1.0);
        sent.expect(times);
        assert_eq!(sent.change(times), 0.0);
        assert_eq!(sent.follow(times, STEP), times, "it is sent all the same");
        sent.forget();
        assert_eq!((sent.change(times), sent.follow(Rgb::ONE, STEP)), (f32::INFINITY, times), "until it is known");
        let mut nothing = Sent::NOTHING;
        nothing.expect(Rgb::ZERO);
        assert_eq!(nothing, Sent::NOTHING);
    }
}

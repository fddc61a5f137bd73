//! Row sums of leaves, and of [places](crate::places) of several: in an enclosure the form factors of each leaf sum to 1, so no light is lost or made on the way;
//! nowhere to more, so that light dies out wherever reflectances are below 1.

use crate::Rgb;
use crate::gather::GROUPS;
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::sampling::{cosine_direction, hash, point2, unit};
use crate::segments::receiving_point;
use crate::threads;
use crate::transport::Light;

/// Relative uncertainty of what arrives from emitters, through other links that leaves look at, and through those that they do
/// not look at, of which all may be hidden.
const UNCERTAIN: [f32; 3] = [0.02, 0.1, 0.5];
/// No light is raised by more than this: where more is missing, it is not known from where.
const MOST_RAISE: f32 = 3.0;

/// A row of less than this share of an enclosure is left alone: what is missing is too dim to have been looked at, and would become as bright
/// as what is known.
const MOSTLY_KNOWN: f32 = 0.8;

/// No leaf sees more than all there is, but its few rays may say so: a sum is cut off above this. Cut off at 1, what errs to
/// the other side would be left alone, and light be lost; so it is the mean over a side of a surface that is kept below 1.
const MOST_SEEN: f32 = 1.1;

/// Sums of form factors times visibility of a place, by which its light is balanced.
#[derive(Clone, Copy, Debug)]
struct LeafRow {
    /// Of emitters, of other links that leaves look at, and of faint ones.
    shares: [f32; 3],
    /// Share of the place that light may reach.
    exposed: f32,
}

impl LeafRow {
    fn sum(&self) -> f32 {
        self.shares.iter().sum()
    }

    /// What the sum is to be: where nothing but senders is seen, `closed` by all of the view but their dark parts, 1 less these. Leaves of
    /// which nothing is covered have so much of their sums that on average over a side there is no more than all there is to see.
    fn goal(&self, closed: Option<f32>, share: f32) -> f32 {
        match closed {
            _ if self.exposed < 1.0 => self.sum().min(self.exposed),
            Some(dim) if self.sum() >= MOSTLY_KNOWN => 1.0 - dim.min(1.0),
            _ => (share * self.sum()).min(MOST_SEEN),
        }
    }

    /// Factors for the light of [lights without extent, and of each of the shares] that make the row's sum what it is to be; the
    /// exposed part gets all of it. What is off is put down to each share by its uncertainty, as least squares do; what a share that is
    /// nothing, or as much as it may be, leaves of that is put down to the others.
    fn factors(&self, sum: f32) -> [f32; GROUPS] {
        if self.exposed <= 0.0 {
            return [0.0; GROUPS];
        }
        let mut factors = [1.0_f32; 3];
        let mut free = [true; 3];
        for _ in 0..3 {
            let now: f32 = factors.iter().zip(self.shares).map(|(factor, share)| factor * share).sum();
            let variance = |i: usize| if free[i] { (UNCERTAIN[i] * self.shares[i]).powi(2) } else { 0.0 };
            let (off, all) = (sum - now, (0..3).map(variance).sum::<f32>());
            let more: [f32; 3] =
                std::array::from_fn(|i| off * variance(i) / (all * self.shares[i]).max(f32::MIN_POSITIVE));
            for ((factor, more), free) in factors.iter_mut().zip(more).zip(&mut free) {
                let goal = *factor + more;
                *factor = goal.clamp(0.0, MOST_RAISE);
                *free = *factor == goal;
            }
        }
        let now: f32 = factors.iter().zip(self.shares).map(|(factor, share)| factor * share).sum();
        let most = (sum / now.max(f32::MIN_POSITIVE)).min(1.0);
        let [emitters, rest, faint] = factors.map(|factor| factor * most / self.exposed);
        [self.exposed.recip(), emitters, rest, faint]
    }
}

/// Rays that tell whether a side of a surface sees nothing but senders: at least so many, …
const CLOSED_RAYS: u32 = 32;
/// … and so many for each place.
const CLOSED_RAYS_PER_PLACE: u32 = 4;

/// By place, the factors for the light of each group that balance its row, by the shares of all but the first, and by what dark parts of
/// senders take up of its view beyond them; for nothing but the limits where nobody is to `look`. Rows are 1 where all that is seen from a
/// side of a surface sends light: as many rays as are shot miss an opening only if it hardly counts.
pub(crate) fn balance<L: LightField>(
    light: Light<'_, L>,
    places: &[u32],
    (shares, dim_views): (&[[f32; GROUPS - 1]], &[f32]),
    look: bool,
) -> Vec<[f32; GROUPS]> {
    let side = |index: u32| {
        let (place, element) = (places[index as usize], light.element(places[index as usize]));
        // A place of several surfaces is a side for itself.
        (element.source, if element.is_patch() { u32::from(element.kind == Kind::Back) } else { place })
    };
    let mut order: Vec<u32> = (0..places.len() as u32).collect();
    order.sort_by_key(|&index| side(index));
    let sides: Vec<&[u32]> = order.chunk_by(|&a, &b| side(a) == side(b)).collect();
    let of_side = |side: &&[u32]| {
        let place = |index: u32| places[index as usize];
        let row =
            |index: u32| LeafRow { shares: shares[index as usize], exposed: light.elements.exposed(place(index)) };
        let rays = CLOSED_RAYS_PER_PLACE.max(CLOSED_RAYS / side.len() as u32);
        let is_lit = |index: &u32| light.exitant.irradiance[place(*index) as usize] != Rgb::ZERO;
        let sees_senders = |&index: &u32| (0..rays).all(|ray| sees_sender(light, place(index), ray));
        let closed = look && side.iter().filter(|index| is_lit(index)).all(sees_senders);
        let (mut area, mut sum) = (0.0, 0.0);
        for &index in side.iter().filter(|&&index| row(index).exposed >= 1.0) {
            area += light.element(place(index)).area;
            sum += light.element(place(index)).area * row(index).sum();
        }
        let most = if sum > area { area / sum } else { 1.0 };
        let factors = |&index: &u32| {
            let row = row(index);
            let dim = dim_views.get(index as usize).copied().unwrap_or_default();
            row.factors(row.goal(closed.then_some(dim), most))
        };
        side.iter().map(factors).collect::<Vec<_>>()
    };
    let balanced: Vec<Vec<[f32; GROUPS]>> = threads::map(&sides, 4, of_side);
    let mut factors = vec![[0.0; GROUPS]; places.len()];
    for (&index, balanced) in order.iter().zip(balanced.into_iter().flatten()) {
        factors[index as usize] = balanced;
    }
    factors
}

/// Whether a random ray from a place meets something that sends light.
fn sees_sender<L: LightField>(light: Light<'_, L>, place: u32, ray: u32) -> bool {
    let (u, v) = (point2(hash(place, 0x8e1d), ray), point2(hash(place, 0x77a3), ray));
    let choice = unit(hash(hash(place, 0x91c7), ray));
    let Some((x, n, surface)) = receiving_point(light, place, (choice, u)) else { return false };
    let direction = cosine_direction(n, v.x, v.y);
    let hit = light.scene.visibility.closest_except(x, direction, 0.0, f32::MAX, surface);
    let met = hit.and_then(|hit| light.elements.leaf_at(light.scene, hit.surface, !hit.front, hit.uv));
    met.is_some_and(|leaf| light.emitted_most(leaf.0) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(shares: [f32; 3], factors: [f32; GROUPS]) -> f32 {
        shares.iter().zip(&factors[1..]).map(|(share, factor)| share * factor).sum()
    }

    #[test]
    fn what_is_uncertain_changes_first() {
        let factors = |shares, sum| LeafRow { shares, exposed: 1.0 }.factors(sum);
        let row = [0.2, 0.5, 0.2];
        assert_eq!(factors(row, 0.9), [1.0; GROUPS], "it is what it should be");
        let all @ [lights, emitters, rest, faint] = factors(row, 1.0);
        assert!((sum(row, all) - 1.0).abs() < 1e-6, "all there is to see: {all:?}");
        assert!(lights == 1.0 && (emitters - 1.0).abs() < 0.01, "links to emitters are fine: {emitters}");
        assert!(faint - 1.0 > 5.0 * (rest - 1.0) && rest > 1.0, "what is looked at is known better: {rest}, {faint}");
        let [_, emitters, rest, _] = factors([0.9, 0.0, 0.0], 1.0);
        assert!((emitters * 0.9 - 1.0).abs() < 1e-6 && rest.is_finite(), "nothing else could be what is missing");
        let [.., faint] = factors([0.1, 0.1, 0.01], 1.0);
        assert!(faint <= MOST_RAISE, "so much may be missing elsewhere: {faint}");
    }

    /// In an enclosure what is missing of a row is in what is seen; but if that is much, it is dark, and what is bright is not raised for it.
    #[test]
    fn rows_of_which_little_is_known_are_left_alone() {
        let goal = |shares, closed| LeafRow { shares, exposed: 1.0 }.goal(closed, 0.5);
        assert_eq!(goal([0.2, 0.7, 0.0], Some(0.0)), 1.0, "it is nearly whole");
        assert_eq!(goal([0.2, 0.7, 0.0], Some(0.3)), 0.7, "parts of senders are dark");
        assert_eq!(goal([0.2, 0.7, 0.0], None), 0.45, "the whole side has too much");
        let hidden = [0.2, 0.05, 0.02];
        assert_eq!(goal(hidden, Some(0.0)), 0.135, "nobody looked at what takes up most of the view");
        let raised = LeafRow { shares: hidden, exposed: 1.0 }.factors(1.0)[1];
        assert!(raised > 2.0, "though it would change emitters: {raised}");
    }

    #[test]
    fn what_hides_the_rest_keeps_its_light() {
        // Right above a lamp, where nobody looked whether all else is seen.
        let row = [0.95, 0.05, 0.5];
        let all @ [_, emitters, _, faint] = LeafRow { shares: row, exposed: 1.0 }.factors(1.0);
        assert!((sum(row, all) - 1.0).abs() < 1e-6, "{all:?}");
        assert!(emitters > 0.99 && faint < 0.02, "what is not known is not there: {all:?}");
    }

    #[test]
    fn rows_never_exceed_what_they_are_to_be() {
        for exposed in [0.0, 0.5, 1.0] {
            for most in [0.0, 0.3, 1.0] {
                for emitters in [0.0, 1e-30, 0.3, 1.0, 7.0] {
                    for rest in [0.0, 1e-30, 0.4, 1.0, 9.0] {
                        for faint in [0.0, 1e-20, 0.1, 2.0] {
                            let row = [emitters, rest, faint];
                            let all = LeafRow { shares: row, exposed }.factors(most);
                            let sum = sum(row, all) * if exposed > 0.0 { exposed } else { 1.0 };
                            assert!((0.0..=most + 1e-6).contains(&sum), "{row:?}, {exposed}, {most}: {sum}");
                            assert!(all.iter().all(|f| f.is_finite() && *f >= 0.0), "{row:?}: {all:?}");
                        }
                    }
                }
            }
        }
    }
}

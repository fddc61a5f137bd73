//! Row sums of leaves: in an enclosure the form factors of each leaf sum to 1, so no light is lost or made on the way;
//! nowhere to more, so that light dies out wherever reflectances are below 1.

use crate::Rgb;
use crate::hierarchy::Kind;
use crate::hooks::LightField;
use crate::rows::MOST_RAISE;
use crate::sampling::{cosine_direction, hash, point2};
use crate::threads::prelude::*;
use crate::transport::Light;

/// Sums of form factors times visibility of a leaf, by which its light is balanced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafRow {
    /// Of emitters, and of other surfaces.
    pub(crate) shares: [f32; 2],
    /// Share of the leaf that light may reach.
    pub(crate) exposed: f32,
    /// Whether all that is seen from the leaf sends light.
    pub(crate) closed: bool,
}

impl LeafRow {
    /// Factors for the light of [lights without extent, emitters, others] that make the row 1 where it is known to be, and no
    /// more than what is exposed elsewhere; the exposed part gets all of it. Others change first, as links to emitters are
    /// fine.
    pub(crate) fn factors(&self) -> [f32; 3] {
        let [emitters, rest] = self.shares;
        if self.exposed <= 0.0 {
            return [0.0; 3];
        }
        if self.closed && self.exposed >= 1.0 {
            let more = if rest > 0.0 { ((1.0 - emitters).max(0.0) / rest).min(MOST_RAISE) } else { 1.0 };
            let all = (emitters + rest * more).max(MOST_RAISE.recip()).recip();
            return [1.0, all, all * more];
        }
        let limited = |share: f32, most: f32| (most.max(0.0) / share.max(f32::MIN_POSITIVE)).min(1.0);
        let (all, rest) = (limited(emitters, self.exposed), limited(rest, self.exposed - emitters));
        [1.0, all, rest].map(|factor| factor / self.exposed)
    }
}

/// Rays that tell whether a side of a surface sees nothing but senders: at least so many, …
const CLOSED_RAYS: u32 = 32;
/// … and so many for each leaf.
const CLOSED_RAYS_PER_LEAF: u32 = 4;

/// For each leaf, whether all that is seen from its side of its surface sends light: then its form factors sum to 1. As
/// many rays as are shot miss an opening only if it hardly counts.
pub(crate) fn closed<L: LightField>(light: Light<'_, L>, leaves: &[u32]) -> Vec<bool> {
    let side = |leaf: u32| (light.element(leaf).source, light.element(leaf).kind == Kind::Back);
    let mut order: Vec<u32> = (0..leaves.len() as u32).collect();
    order.sort_by_key(|&index| side(leaves[index as usize]));
    let groups: Vec<&[u32]> = order.chunk_by(|&a, &b| side(leaves[a as usize]) == side(leaves[b as usize])).collect();
    let of_group = |group: &&[u32]| {
        let rays = CLOSED_RAYS_PER_LEAF.max(CLOSED_RAYS / group.len() as u32);
        let lit = group.iter().map(|&index| leaves[index as usize]);
        lit.filter(|&leaf| light.exitant.irradiance[leaf as usize] != Rgb::ZERO)
            .all(|leaf| (0..rays).all(|ray| sees_sender(light, leaf, ray)))
    };
    let decided: Vec<bool> = groups.par_iter().with_min_len(4).map(of_group).collect();
    let mut closed = vec![false; leaves.len()];
    for (group, is_closed) in groups.into_iter().zip(decided) {
        for &index in group {
            closed[index as usize] = is_closed;
        }
    }
    closed
}

/// Whether a random ray from a leaf meets something that sends light.
fn sees_sender<L: LightField>(light: Light<'_, L>, leaf: u32, ray: u32) -> bool {
    let element = light.element(leaf);
    let (u, v) = (point2(hash(leaf, 0x8e1d), ray), point2(hash(leaf, 0x77a3), ray));
    let (x, normal) = light.scene.surfaces()[element.source as usize].sample(element.domain, u.x, u.y);
    let n = if element.kind == Kind::Back { -normal } else { normal };
    let direction = cosine_direction(n, v.x, v.y);
    let hit = light.scene.visibility.closest_except(x, direction, 0.0, f32::MAX, element.source);
    let met = hit.and_then(|hit| light.elements.leaf_at(light.scene, hit.surface, !hit.front, hit.uv));
    met.is_some_and(|leaf| light.emitted_most(leaf.0) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factors(shares: [f32; 2], exposed: f32, closed: bool) -> [f32; 3] {
        LeafRow { shares, exposed, closed }.factors()
    }

    #[test]
    fn rows_of_enclosures_are_filled_and_no_others() {
        assert_eq!(factors([0.2, 0.5], 1.0, false), [1.0; 3], "there may be sky");
        let [lights, emitters, rest] = factors([0.2, 0.64], 1.0, true);
        assert!((0.2 * emitters + 0.64 * rest - 1.0).abs() < 1e-6, "all there is to see: {emitters}, {rest}");
        assert!(lights == 1.0 && (emitters - 1.0).abs() < 1e-6, "links to emitters are fine: {emitters}");
        let [_, emitters, rest] = factors([0.9, 0.0], 1.0, true);
        assert!((emitters * 0.9 - 1.0).abs() < 1e-6 && rest.is_finite(), "nothing else could be what is missing");
    }

    #[test]
    fn rows_never_exceed_what_is_open() {
        for exposed in [0.0, 0.5, 1.0] {
            for closed in [false, true] {
                for emitters in [0.0, 1e-30, 0.3, 1.0, 7.0] {
                    for rest in [0.0, 1e-30, 0.4, 1.0, 9.0] {
                        let [lights, all, others] = factors([emitters, rest], exposed, closed);
                        let sum = emitters * all + rest * others;
                        assert!((0.0..=1.000_001).contains(&sum), "{emitters}, {rest}, {exposed}, {closed}: {sum}");
                        assert!(lights.is_finite() && lights >= 0.0, "{lights}");
                    }
                }
            }
        }
    }
}

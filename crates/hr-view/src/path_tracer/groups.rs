//! Emitters in groups of neighbours: what is drawn from for lobes that are followed.
//!
//! A lobe sees a few of a scene's emitters. One of all, picked by power, is seldom among them: where lamps are meshes of hundreds of
//! triangles highlights would be noise. So there are a few groups, each of one lamp or a part of one, or of lamps that stand together,
//! and at each point one emitter of every group is drawn. Where there are no more emitters than groups, that is each of them.

use glam::Vec3;

/// So many groups at most.
pub(super) const MOST_GROUPS: usize = 16;

/// The emitters of a scene, divided.
#[derive(Clone, Debug, Default)]
pub(super) struct Groups {
    /// Emitters by group, with the chance of each in its group and of all before it there.
    members: Vec<(u32, f32)>,
    /// End of each group among these.
    ends: Vec<usize>,
    /// By emitter, the chance to be drawn in its group.
    chances: Vec<f32>,
}

impl Groups {
    /// Divides emitters, given their middles and powers, where groups of much power are wide.
    pub(super) fn new(emitters: &[(Vec3, f32)]) -> Self {
        let all: Vec<u32> = (0..emitters.len() as u32).collect();
        let mut groups = vec![all];
        while groups.len() < MOST_GROUPS {
            let weights = groups.iter().map(|group| weight(emitters, group));
            let largest = weights.enumerate().filter(|(_, weight)| *weight > 0.0).max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((largest, _)) = largest else { break };
            let (low, high) = halves(emitters, groups.swap_remove(largest));
            groups.extend([low, high]);
        }
        groups.retain(|group| !group.is_empty());
        groups.sort_unstable();
        let mut divided = Self { chances: vec![0.0; emitters.len()], ..Self::default() };
        for group in groups {
            let power = |&member: &u32| emitters[member as usize].1;
            let total: f32 = group.iter().map(power).sum();
            let mut sum = 0.0;
            for member in &group {
                let chance = power(member) / total;
                sum += chance;
                divided.chances[*member as usize] = chance;
                divided.members.push((*member, sum));
            }
            divided.ends.push(divided.members.len());
        }
        divided
    }

    /// The chance of an emitter to be drawn in its group.
    pub(super) fn chance(&self, emitter: u32) -> f32 {
        self.chances[emitter as usize]
    }

    /// One emitter of each group, by a number in 0…1 for each.
    pub(super) fn draw(&self, mut choice: impl FnMut(usize) -> f32) -> impl Iterator<Item = u32> {
        let mut start = 0;
        self.ends.iter().enumerate().map(move |(number, &end)| {
            let members = &self.members[std::mem::replace(&mut start, end)..end];
            let choice = choice(number);
            // Rounding may leave the last sum a little below the choice.
            members[members.partition_point(|&(_, sum)| sum <= choice).min(members.len() - 1)].0
        })
    }
}

/// What a group would gain from being divided: power × squared extent; 0 for a single emitter.
fn weight(emitters: &[(Vec3, f32)], group: &[u32]) -> f32 {
    let power: f32 = group.iter().map(|&member| emitters[member as usize].1).sum();
    let least = f32::MIN_POSITIVE;
    if group.len() < 2 { 0.0 } else { (power * extent(emitters, group).length_squared()).max(least) }
}

/// Size of the box about the middles of a group.
fn extent(emitters: &[(Vec3, f32)], group: &[u32]) -> Vec3 {
    let middles = group.iter().map(|&member| emitters[member as usize].0);
    let (low, high) = middles.fold((Vec3::MAX, Vec3::MIN), |(low, high), at| (low.min(at), high.max(at)));
    high - low
}

/// Divides a group of two or more across its longest side, at its centre of power; in the middle where all lie there.
fn halves(emitters: &[(Vec3, f32)], mut group: Vec<u32>) -> (Vec<u32>, Vec<u32>) {
    let axis = extent(emitters, &group).max_position();
    let at = |member: &u32| emitters[*member as usize].0[axis];
    let (sum, power) = group.iter().fold((0.0, 0.0), |(sum, power), member| {
        let own = emitters[*member as usize].1;
        (sum + own * at(member), power + own)
    });
    let (low, high): (Vec<u32>, Vec<u32>) = group.iter().partition(|member| at(member) < sum / power);
    if low.is_empty() || high.is_empty() {
        let rest = group.split_off(group.len() / 2);
        return (group, rest);
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_emitters_are_each_drawn() {
        let emitters: Vec<_> = (0..MOST_GROUPS).map(|i| (Vec3::splat((i / 3) as f32), 1.0 + i as f32)).collect();
        let groups = Groups::new(&emitters);
        let drawn: Vec<u32> = groups.draw(|_| 0.3).collect();
        assert_eq!(drawn, (0..MOST_GROUPS as u32).collect::<Vec<_>>(), "also where some lie in one place");
        assert!((0..drawn.len() as u32).all(|emitter| groups.chance(emitter) == 1.0), "each for certain");
        assert_eq!(Groups::new(&[]).draw(|_| 0.5).count(), 0, "there are none");
    }

    #[test]
    fn many_emitters_are_drawn_by_power_within_groups_of_neighbours() {
        // Four lamps of 50 parts, of which one is brighter.
        let emitters: Vec<_> = (0..200_usize)
            .map(|i| {
                let (lamp, part) = (i % 4, (i / 4) as f32);
                (Vec3::new(lamp as f32, 0.001 * part, 0.0), if i == 7 { 50.0 } else { 1.0 })
            })
            .collect();
        let groups = Groups::new(&emitters);
        let mut drawn = vec![0.0; emitters.len()];
        const DRAWS: usize = 1000;
        for i in 0..DRAWS {
            let choice = (i as f32 + 0.5) / DRAWS as f32;
            let chosen: Vec<u32> = groups.draw(|_| choice).collect();
            assert!(chosen.len() <= MOST_GROUPS, "no more than that");
            for lamp in 0..4 {
                assert!(chosen.iter().any(|emitter| emitter % 4 == lamp), "of lamp {lamp}, too: {chosen:?}");
            }
            chosen.into_iter().for_each(|emitter| drawn[emitter as usize] += 1.0 / DRAWS as f32);
        }
        for (emitter, share) in drawn.into_iter().enumerate() {
            let chance = groups.chance(emitter as u32);
            assert!((share - chance).abs() < 0.002, "{emitter} is drawn {share}, not {chance}");
        }
    }
}

//! Well-spread random numbers of one path: Sobol' points in pairs, padded to any number of dimensions.

use glam::Vec2;
use hr_diffuse::sampling::{hash, unit};

/// The numbers of one of the paths of a pixel. Every pair of dimensions is the two-dimensional Sobol' sequence, its
/// order shuffled and its values scrambled by the pair's own hash (Burley, "Practical Hash-based Owen Scrambling", JCGT
/// 9(4), 2020): stratified within each pair, independent among pairs, unbiased for any number of paths.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    seed: u32,
    index: u32,
}

impl Sampler {
    /// For path number `index` of the pixel that `seed` stands for.
    #[must_use]
    pub fn new(seed: u32, index: u32) -> Self {
        Self { seed, index }
    }

    /// Number `k` of `count` paths that go on from this one: all those of a pixel are spread evenly together.
    #[must_use]
    pub fn split(&self, count: u32, k: u32) -> Self {
        Self { index: self.index * count + k, ..*self }
    }

    /// The first of the paths of a pixel of their own, which goes on from this one.
    #[must_use]
    pub fn apart(&self, number: u32) -> Self {
        Self::new(hash(hash(self.seed, self.index), number), 0)
    }

    /// Two numbers in 0…1 (1 excluded).
    #[must_use]
    pub fn pair(&self, dimension: u32) -> Vec2 {
        let seed = hash(self.seed, dimension);
        let index = scrambled(self.index, hash(seed, 1));
        Vec2::new(unit(scrambled(index.reverse_bits(), hash(seed, 2))), unit(scrambled(sobol(index), hash(seed, 3))))
    }
}

/// Second dimension of the Sobol' sequence: its direction numbers are the rows of Pascal's triangle modulo 2, of which number `i` is odd
/// at `j` where `j` has no bit that `i` lacks (Lucas's theorem). So all bits are summed that have a bit more, for each of the five
/// bits of their places.
fn sobol(index: u32) -> u32 {
    let mut sum = index;
    for (step, lower) in [(16, 0x0000_ffff), (8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)] {
        sum ^= (sum >> step) & lower;
    }
    sum.reverse_bits()
}

/// Owen scrambling: every bit is flipped by a hash of the bits above it. On reversed bits that is a permutation in
/// which carries run upward only (Laine & Karras, "Stratified sampling for stochastic transparency", CGF 30(4), 2011).
fn scrambled(value: u32, seed: u32) -> u32 {
    let mut x = value.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_is_stratified() {
        for (seed, dimension) in [(1, 0), (7, 5), (0xdead_beef, 31)] {
            // 64 points of a (0, 2)-sequence: one in each box of area 1/64, whatever the box's shape.
            for columns in [1, 2, 4, 8, 16, 32, 64] {
                let mut boxes = vec![0; 64];
                for index in 0..64 {
                    let p = Sampler::new(seed, index).pair(dimension);
                    let (x, y) = ((p.x * columns as f32) as usize, (p.y * (64 / columns) as f32) as usize);
                    boxes[y * columns + x] += 1;
                }
                assert_eq!(boxes, [1; 64], "seed {seed}, dimension {dimension}: {columns} columns");
            }
        }
    }

    #[test]
    fn the_second_dimension_is_that_of_direction_numbers() {
        for index in (0..32).map(|bit| 1 << bit).chain((0..64).map(|i| hash(i, 5))) {
            let direction = |bit: u32| (0..bit).fold(1u32 << 31, |direction, _| direction ^ (direction >> 1));
            let sum = (0..32).filter(|bit| index >> bit & 1 == 1).fold(0, |sum, bit| sum ^ direction(bit));
            assert_eq!(sobol(index), sum, "{index:#x}");
        }
    }

    #[test]
    fn paths_that_split_are_stratified_together() {
        let mut boxes = vec![0; 64];
        for (index, k) in (0..16).flat_map(|index| (0..4).map(move |k| (index, k))) {
            let p = Sampler::new(9, index).split(4, k).pair(3);
            boxes[(p.y * 8.0) as usize * 8 + (p.x * 8.0) as usize] += 1;
        }
        assert_eq!(boxes, [1; 64], "4 of 16 paths each");
        let [one, other] = [1, 2].map(|number| Sampler::new(9, 0).apart(number).pair(3));
        assert_ne!(one, other, "those that are apart are others");
    }

    #[test]
    fn pairs_are_independent() {
        // Correlation of x among two pairs: 0 ± 1/√n, here 4 sigma.
        let n = 4096;
        let product: f32 =
            (0..n).map(|i| (Sampler::new(3, i).pair(1).x - 0.5) * (Sampler::new(3, i).pair(2).x - 0.5)).sum();
        let correlation = product * 12.0 / n as f32;
        assert!(correlation.abs() < 4.0 / (n as f32).sqrt(), "correlation {correlation}");
    }
}

//! Directional distributions in few bytes.
//!
//! Distributions are coarsened to what can be seen of them ([`Haar::average`]), then taken apart
//! ([`Haar::outline`]). Values become whole numbers on a logarithmic scale, and of those only the
//! difference to the mean of the edge's ends is kept: most are small, and most colours are those of the edge's ends.

use super::payload::{Payload, fold};
use glossy_ext::haar::{Haar, Outline, Refinement, Refiner};
use hr_diffuse::Rgb;
use rayon::prelude::*;

/// Added to radiances, at automatic exposure, where errors are judged relative to them: 1.8 stops below middle grey, so
/// that nothing is spent on what is nearly black.
pub(super) const FLOOR: f32 = 0.05;
/// From one whole number to the next, radiance plus [`FLOOR`] grows by this factor. Rounding, 1 % at most, is half a
/// code of an 8-bit sRGB picture in its middle tones.
pub(super) const GROWTH: f32 = 1.02;
/// The largest whole number: 2e7 times the floor.
pub(super) const MOST: i32 = 850;
/// How far coarser distributions may be off relative to the radiance that is seen, and their finest level: the first
/// that leaves few enough values. In a soda shop of 3,931 distributions 0.1 and 0.2 change pictures by 0.4 and 1 code of
/// 255 on average, and keep 70 % and 50 % of the values. Triangles of level 5 are 3° wide.
const TOLERANCES: [(f32, u8); 5] = [(0.1, MAX_LEVEL), (0.2, MAX_LEVEL), (0.2, 5), (0.4, 5), (0.4, 4)];
/// Vertices of all distributions of a page. Each takes about 2 bytes in the end: 4.4 MB.
const MOST_VALUES: usize = 2_200_000;
/// Distributions of a page are no finer than this: what [`Refinement::default`] makes.
pub(super) const MAX_LEVEL: u8 = 6;

/// A distribution to be written.
pub(super) struct Shine<'a> {
    /// What a leaf sends out by direction.
    pub(super) haar: &'a Haar,
    /// What is seen beside it (W/(m² sr)).
    pub(super) beside: Rgb,
}

/// Adds the distributions, times `exposure`.
pub(super) fn add(payload: &mut Payload, shines: &[Shine<'_>], exposure: f32) {
    let mut outlines: Vec<Outline> = Vec::new();
    for tolerance in TOLERANCES {
        outlines = shines.par_iter().map(|shine| coarse(shine, tolerance, exposure)).collect();
        if outlines.iter().map(|outline| outline.values.len()).sum::<usize>() <= MOST_VALUES {
            break;
        }
    }
    let faces: Vec<u8> = outlines.iter().map(|outline| outline.faces).collect();
    let children: Vec<u8> = outlines.iter().flat_map(|outline| outline.children.iter().copied()).collect();
    let mut streams = [const { Vec::new() }; 3];
    let mut large = Vec::new();
    let mut last = [0; 3];
    for outline in &outlines {
        let mut numbers: Vec<[i32; 3]> = Vec::with_capacity(outline.values.len());
        for (i, &value) in outline.values.iter().enumerate() {
            let here = channels(value * exposure);
            let guess = match i.checked_sub(6) {
                Some(edge) => mean(outline.ends[edge].map(|end| numbers[usize::from(end)])),
                None => last,
            };
            for channel in 0..3 {
                let step = fold(here[channel] - guess[channel]);
                // Two bytes where one is not enough.
                match u8::try_from(step) {
                    Ok(byte) if byte < u8::MAX => streams[channel].push(byte),
                    _ => {
                        streams[channel].push(u8::MAX);
                        large.push(step);
                    }
                }
            }
            last = here;
            numbers.push(here);
        }
    }
    payload.bytes("faces", &faces);
    payload.bytes("children", &children);
    for (name, stream) in std::iter::zip(["green", "red", "blue"], &streams) {
        payload.bytes(name, stream);
    }
    payload.words("large", &large);
}

/// What is kept of a distribution.
fn coarse(shine: &Shine<'_>, (tolerance, max_level): (f32, u8), exposure: f32) -> Outline {
    let settings = Refinement {
        min_level: 0,
        max_level,
        refiner: Refiner::Interpolation(tolerance),
        negligible: 0.0,
        preserve_energy: true,
    };
    let beside = shine.beside + Rgb::splat(FLOOR / exposure);
    let mut outline = Haar::average(&[(1.0, shine.haar)], &settings, beside).outline();
    // Black distributions have vertices here, too.
    outline.values.resize(outline.values.len().max(6), Rgb::ZERO);
    outline
}

/// Green as a whole number, and half of what red and blue are more than that: colours may be off by two steps where
/// brightness is off by one.
fn channels(value: Rgb) -> [i32; 3] {
    let number = |x: f32| ((x.max(0.0) / FLOOR).ln_1p() / GROWTH.ln()).min(MOST as f32);
    let [red, green, blue] = value.to_array().map(number);
    let whole = green.round();
    [whole, 0.5 * (red - whole), 0.5 * (blue - whole)].map(|number| number.round() as i32)
}

/// Rounded down, as a shift does.
fn mean([a, b]: [[i32; 3]; 2]) -> [i32; 3] {
    [0, 1, 2].map(|channel| (a[channel] + b[channel]) >> 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use glossy_ext::haar::{Known, Peak};

    #[test]
    fn too_many_values_are_coarsened_and_black_has_corners() {
        let axis = Vec3::new(0.3, 0.5, 0.8).normalize();
        let lobe = |d: Vec3| Rgb::new(2.0, 1.0, 0.5) * d.dot(axis).max(0.0).powi(80) + 0.1 * (1.0 + d.z);
        let peaks = [Peak { direction: axis, width: 0.1 }];
        let haar = Haar::project(&Refinement::default(), &Known { peaks: &peaks, ..Known::NOTHING }, lobe).distribution;
        let shine = |haar| Shine { haar, beside: Rgb::ZERO };
        let counts = TOLERANCES.map(|tolerance| coarse(&shine(&haar), tolerance, 1.0).values.len());
        assert!(counts.is_sorted_by(|a, b| a >= b) && counts[0] > 2 * counts[4], "coarser and coarser: {counts:?}");
        let black = Haar::default();
        assert_eq!(coarse(&shine(&black), TOLERANCES[0], 1.0).values, [Rgb::ZERO; 6], "black has six corners");
    }

    #[test]
    fn numbers_keep_colors_to_a_percent() {
        let back = |number: i32| FLOOR * ((number as f32 * GROWTH.ln()).exp() - 1.0);
        for i in 0..300 {
            let value = Rgb::new(1.0, 0.8, 0.1) * 1e-3 * 1.05_f32.powi(i);
            let [green, red, blue] = channels(value);
            let found = [green + 2 * red, green, green + 2 * blue].map(back);
            for (k, (found, wanted)) in found.into_iter().zip(value.to_array()).enumerate() {
                // Half a step of the scale for green, one for red and blue.
                let most = if k == 1 { 0.0101 } else { 0.0202 } * (wanted + FLOOR);
                assert!((found - wanted).abs() <= most, "{wanted} comes back as {found}");
            }
        }
        assert_eq!(channels(Rgb::new(f32::INFINITY, -1.0, f32::NAN)), [0, MOST / 2, 0], "nonsense has its place");
    }
}

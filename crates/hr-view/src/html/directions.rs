//! Directional distributions in few bytes.
//!
//! Distributions are coarsened to what can be seen of them ([`Haar::average`]), then taken apart
//! ([`Haar::outline`](Haar::outline)). Values become whole numbers on a logarithmic scale, and of those only the
//! difference to the mean of the edge's ends is kept: most are small, and most colours are those of the edge's ends.

use super::payload::{Payload, fold};
use glossy_ext::haar::{Haar, Outline, Refinement, Refiner};
use hr_diffuse::Rgb;
use rayon::prelude::*;

/// Radiances below this count as that bright where errors are judged; middle grey is 0.18. Half of it, and so much
/// more, cannot be told apart beside the light that every surface sends diffusely.
pub(super) const FLOOR: f32 = 0.05;
/// From one whole number to the next, radiance plus [`FLOOR`] grows by this factor: less than one code of an 8-bit
/// sRGB picture.
pub(super) const GROWTH: f32 = 1.02;
/// The largest whole number: 2e7 times the floor.
pub(super) const MOST: i32 = 850;
/// How far coarser distributions may be off relative to the radiance that is seen: the first that leaves few enough
/// values.
const TOLERANCES: [f32; 4] = [0.1, 0.2, 0.4, 0.8];
/// Vertices of all distributions of a page. One takes about 1.2 bytes.
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

/// Adds the distributions, times `exposure`. Returns the tolerance that they were coarsened to.
pub(super) fn add(payload: &mut Payload, shines: &[Shine<'_>], exposure: f32) -> f32 {
    let mut outlines = Vec::new();
    let mut tolerance = 0.0;
    for wanted in TOLERANCES {
        tolerance = wanted;
        outlines = shines.par_iter().map(|shine| coarse(shine, tolerance, exposure)).collect();
        if outlines.iter().map(|outline: &Outline| outline.values.len()).sum::<usize>() <= MOST_VALUES {
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
    tolerance
}

fn coarse(shine: &Shine<'_>, tolerance: f32, exposure: f32) -> Outline {
    let settings = Refinement {
        min_level: 0,
        max_level: MAX_LEVEL,
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

/// Green as a whole number, red and blue as differences to it.
fn channels(value: Rgb) -> [i32; 3] {
    let number = |x: f32| ((x.max(0.0) / FLOOR).ln_1p() / GROWTH.ln()).round().min(MOST as f32) as i32;
    let [red, green, blue] = value.to_array().map(number);
    [green, red - green, blue - green]
}

/// Rounded down, as a shift does.
fn mean([a, b]: [[i32; 3]; 2]) -> [i32; 3] {
    [0, 1, 2].map(|channel| (a[channel] + b[channel]) >> 1)
}

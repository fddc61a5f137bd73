//! Colours in 32 bits, as the page's shaders take them.

use glossy_ext::Rgb;

/// Bits of each channel.
const BITS: i32 = 9;
/// Bias of the exponent.
const BIAS: i32 = 15;
/// The largest number that there is: all bits of a channel with the largest exponent.
const LARGEST: f32 = 65408.0;

/// Three channels of 9 bits, red lowest, over a common exponent of 5 bits: the shared-exponent format of OpenGL ES
/// 3.0.6, section 3.8.3.2. Accurate to 1/512 of the largest channel between 2⁻¹⁵ and 65408; what is negative or not a
/// number becomes 0, what is larger than the largest that.
pub(super) fn shared_exponent(color: Rgb) -> u32 {
    let channels = color.to_array().map(|c| if c > 0.0 { c.min(LARGEST) } else { 0.0 });
    let largest = channels.into_iter().fold(0.0, f32::max);
    if largest == 0.0 {
        return 0;
    }
    let mut exponent = (largest.log2().floor() as i32).clamp(-BIAS - 1, 15) + 1 + BIAS;
    let scale = |exponent: i32| (BITS + BIAS - exponent) as f32;
    // Rounding up may need the next exponent; the logarithm may be off by one at powers of two.
    if (largest * scale(exponent).exp2()).round() >= 512.0 {
        exponent += 1;
    }
    let scale = scale(exponent).exp2();
    let [r, g, b] = channels.map(|c| (c * scale).round() as u32);
    r | g << 9 | b << 18 | exponent.cast_unsigned() << 27
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(word: u32) -> Rgb {
        let scale = ((word >> 27) as f32 - 24.0).exp2();
        Rgb::new((word & 511) as f32, (word >> 9 & 511) as f32, (word >> 18 & 511) as f32) * scale
    }

    #[test]
    fn colors_keep_nine_bits() {
        let mut largest = 4e-5_f32;
        while largest < 65000.0 {
            for color in [Rgb::new(largest, 0.3 * largest, 0.0), Rgb::splat(largest)] {
                let off = (decoded(shared_exponent(color)) - color).abs().max_element();
                // Half a step of a mantissa between 256 and 511.
                assert!(off <= largest / 511.9, "{color} is off by {off}");
            }
            largest *= 1.013;
        }
        for power in -14..16 {
            let color = Rgb::splat((power as f32).exp2());
            assert_eq!(decoded(shared_exponent(color)), color, "powers of two are exact");
        }
        let odd = Rgb::new(f32::NAN, -1.0, f32::INFINITY);
        assert_eq!(decoded(shared_exponent(odd)), Rgb::new(0.0, 0.0, LARGEST), "nonsense has its place");
        assert_eq!(shared_exponent(Rgb::ZERO), 0, "black");
    }
}

//! Half-precision storage of the values of one distribution.
//!
//! The layout is IEEE 754 binary16 without infinities, NaNs and subnormal numbers, relative to a scale that each
//! distribution chooses. The general conversions of a half-float package cost a call each; without the special
//! cases decoding is one shift and one product, and a look-up decodes nine numbers.

use crate::Rgb;

/// One stored value: three half floats.
pub(crate) type Half3 = [u16; 3];

/// The stored number that the largest component of a distribution is mapped to: the largest power of two of
/// binary16, so that scaling is exact for it.
const TOP: f32 = 32768.0;

/// Smallest normal number of binary16; what is smaller is stored as zero, 2⁻²⁹ of the largest component.
const SMALLEST: f32 = 1.0 / 16384.0;

/// Difference of the exponents' biases of binary32 and binary16, as a factor: 2¹¹².
const REBIAS: f32 = f32::from_bits((127 + 112) << 23);

/// Its inverse, 2⁻¹¹².
const UNBIAS: f32 = f32::from_bits((127 - 112) << 23);

/// The scale for values with this largest component, 0 if that is too small for any value to be told from zero.
pub(crate) fn scale_for(largest: f32) -> f32 {
    let scale = largest / TOP;
    // Below this, 1/scale overflows.
    if scale < f32::MIN_POSITIVE { 0.0 } else { scale }
}

/// Rounds to the nearest stored value; `value` is in units of the scale, at most [`TOP`] in size.
fn encode_one(value: f32) -> u16 {
    let size = value.abs();
    if size < SMALLEST {
        return 0;
    }
    let bits = (size * UNBIAS).to_bits();
    // Round half to even: the tie bit is that of the last place kept.
    let rounded = (bits + 0x0fff + ((bits >> 13) & 1)) >> 13;
    let sign = if value < 0.0 { 0x8000 } else { 0 };
    sign | (rounded & 0x7fff) as u16
}

fn decode_one(stored: u16) -> f32 {
    let bits = (u32::from(stored & 0x8000) << 16) | (u32::from(stored & 0x7fff) << 13);
    f32::from_bits(bits) * REBIAS
}

/// Stores a value in units of `scale`; relative rounding error 2⁻¹¹ per component.
pub(crate) fn encode(value: Rgb, scale: f32) -> Half3 {
    let v = value / scale;
    [encode_one(v.x), encode_one(v.y), encode_one(v.z)]
}

/// The stored value, still in units of the scale.
#[inline]
pub(crate) fn decode(stored: Half3) -> Rgb {
    Rgb::new(decode_one(stored[0]), decode_one(stored[1]), decode_one(stored[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_keeps_eleven_bits_over_nine_decades() {
        for magnitude in [1e-30_f32, 1e-20, 1.0, 3.7, 1e20, 1e38] {
            let scale = scale_for(magnitude);
            for i in 0..390 {
                let v = magnitude * 0.95_f32.powi(i);
                let back = decode(encode(Rgb::new(v, -v, 0.0), scale)) * scale;
                assert!((back.x - v).abs() <= v / 2048.0, "{v} came back as {}", back.x);
                assert_eq!(back.x, -back.y, "sign is lost");
                assert_eq!(back.z, 0.0, "zero is not exact");
            }
            let top = decode(encode(Rgb::splat(magnitude), scale)) * scale;
            assert_eq!(top.x, magnitude, "the largest component is exact");
        }
    }
}

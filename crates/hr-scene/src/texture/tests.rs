use super::*;
use crate::{Material, Scene};
use glam::DVec3;
use hr_diffuse::Surface;
use proptest::prelude::*;

fn noise(width: u32, height: u32) -> Arc<Texels> {
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let data = (0..width * height).map(|_| Rgb::new(next(), next(), next())).collect();
    Arc::new(Texels::new(width, height, data).expect("sizes fit"))
}

fn max_difference(a: Rgb, b: Rgb) -> f32 {
    (a - b).abs().max_element()
}

/// Mean of samples on a fine regular grid in the parameters of a triangle or parallelogram.
fn brute_force(texture: &Texture, corners: &[Vec2], n: u32) -> Rgb {
    let mut sum = DVec3::ZERO;
    let mut count = 0;
    for i in 0..n {
        for j in 0..n {
            let s = [(i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32];
            let (du, dv) = (corners[1] - corners[0], corners[corners.len() - 1] - corners[0]);
            if corners.len() == 4 || s[0] + s[1] < 1.0 {
                sum += texture.sample(corners[0] + du * s[0] + dv * s[1]).as_dvec3();
                count += 1;
            }
        }
    }
    (sum / f64::from(count)).as_vec3()
}

#[test]
fn samples_at_texel_centres_are_the_texels() {
    let texels = noise(5, 3);
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        let texture = Texture::new(texels.clone(), [wrap; 2]);
        for j in 0..3 {
            for i in 0..5 {
                let uv = Vec2::new((i as f32 + 0.5) / 5.0, (j as f32 + 0.5) / 3.0);
                let expected = texels.data()[(j * 5 + i) as usize];
                assert!(max_difference(texture.sample(uv), expected) < 1e-5, "{wrap:?} texel {i}, {j}");
            }
        }
    }
}

#[test]
fn wrapping_continues_as_named() {
    let texels = noise(4, 4);
    let of = |wrap| Texture::new(texels.clone(), [wrap; 2]);
    let uv = Vec2::new(0.3, 0.6);
    let inside = of(Wrap::Repeat).sample(uv);
    for shift in [-3.0, 2.0, 1000.0] {
        let moved = of(Wrap::Repeat).sample(uv + Vec2::new(shift, 0.0));
        assert!(max_difference(moved, inside) < 1e-3, "repeats at {shift}");
        let moved = of(Wrap::Mirror).sample(uv + Vec2::new(0.0, 2.0 * shift));
        assert!(max_difference(moved, of(Wrap::Mirror).sample(uv)) < 1e-3, "mirrors twice at {shift}");
    }
    let mirrored = of(Wrap::Mirror).sample(Vec2::new(-0.3, 0.6));
    assert!(max_difference(mirrored, inside) < 1e-5, "mirrored at 0");
    let mirrored = of(Wrap::Mirror).sample(Vec2::new(1.7, 0.6));
    assert!(max_difference(mirrored, inside) < 1e-5, "mirrored at 1");
    let corner = of(Wrap::Clamp).sample(Vec2::new(1e30, -1e30));
    assert_eq!(corner, texels.data()[3], "clamped to the upper right texel");
    assert!(of(Wrap::Repeat).sample(Vec2::splat(1e30)).is_finite(), "huge coordinates give colours");
    assert_eq!(of(Wrap::Repeat).sample(Vec2::splat(f32::NAN)), texels.mean(), "no number: the mean");
}

#[test]
fn means_are_the_integral_of_the_samples() {
    // Regions below a texel, of some texels, of several repetitions; both senses; wrapped, clamped, mirrored.
    let triangle = [Vec2::new(0.1, 0.2), Vec2::new(0.7, 0.3), Vec2::new(0.4, 0.95)];
    let square = [Vec2::ZERO, Vec2::new(1.0, 0.1), Vec2::new(0.8, 0.9), Vec2::new(-0.2, 0.8)];
    let regions: [&[Vec2]; 2] = [&triangle, &square];
    for wrap in [[Wrap::Repeat; 2], [Wrap::Mirror, Wrap::Clamp], [Wrap::Clamp, Wrap::Mirror], [Wrap::Clamp; 2]] {
        let texture = Texture::new(noise(16, 8), wrap);
        for region in regions {
            for scale in [0.002, 0.05, 1.0, 4.3] {
                for shift in [0.0, -2.6, 0.93] {
                    let corners: Vec<Vec2> = region.iter().map(|c| *c * scale + shift).collect();
                    // Midpoint rule on 300² points, jumps in slope at texel borders, about 70 texels across at most.
                    let expected = brute_force(&texture, &corners, 300);
                    let mean = texture.mean_over(&corners);
                    assert!(max_difference(mean, expected) < 3e-3, "{wrap:?} {corners:?}: {mean} against {expected}");
                    let reversed: Vec<Vec2> = corners.iter().rev().copied().collect();
                    assert!(max_difference(texture.mean_over(&reversed), mean) < 1e-5, "either sense of rotation");
                }
            }
        }
    }
}

#[test]
fn a_whole_period_has_the_mean_of_the_texels() {
    let texels = noise(37, 19);
    for (wrap, n) in [(Wrap::Repeat, 1.0), (Wrap::Mirror, 2.0)] {
        let texture = Texture::new(texels.clone(), [wrap; 2]);
        for start in [0.0, 0.37, -5.2] {
            let s = Vec2::splat(start);
            let mean = texture.mean_over(&[s, s + Vec2::new(n, 0.0), s + Vec2::splat(n), s + Vec2::new(0.0, n)]);
            // Single precision coordinates: 6e-7 of a period at −5.2, times the 37 texels' contrast.
            assert!(max_difference(mean, texels.mean()) < 1e-5, "{wrap:?} from {start}: {mean} {}", texels.mean());
        }
    }
}

#[test]
fn parts_add_up_to_the_whole() {
    let texture = Texture::new(noise(64, 64), [Wrap::Repeat; 2]);
    let at = |i: u32, j: u32| Vec2::new(i as f32, j as f32) / 16.0 * 0.9 + 0.03;
    let parts: Rgb = (0..256)
        .map(|k| (k % 16, k / 16))
        .map(|(i, j)| texture.mean_over(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]))
        .sum();
    let whole = texture.mean_over(&[at(0, 0), at(16, 0), at(16, 16), at(0, 16)]);
    assert!(max_difference(parts / 256.0, whole) < 1e-5, "{} against {whole}", parts / 256.0);
}

#[test]
fn huge_and_flat_regions_are_estimated() {
    let texture = Texture::new(noise(256, 256), [Wrap::Repeat; 2]);
    let huge = texture.mean_over(&[Vec2::ZERO, Vec2::new(1e6, 3.0), Vec2::new(7.0, 1e6)]);
    // 2^14 independent samples of a standard deviation of 0.29 · 2/3: 4 sigma.
    assert!(max_difference(huge, texture.mean()) < 6e-3, "{huge} against {}", texture.mean());
    let line = texture.mean_over(&[Vec2::new(0.0, 0.5), Vec2::new(0.5, 0.5), Vec2::new(1.0, 0.5)]);
    let along: Rgb = (0..2560).map(|i| texture.sample(Vec2::new(i as f32 / 2560.0, 0.5))).sum::<Rgb>() / 2560.0;
    assert!(max_difference(line, along) < 0.05, "a flat region is its line: {line} against {along}");
    let point = texture.mean_over(&[Vec2::splat(0.3); 4]);
    assert!(max_difference(point, texture.sample(Vec2::splat(0.3))) < 1e-5, "a point is its sample");
}

#[test]
fn transforms_come_before_wrapping() {
    let texels = noise(8, 8);
    let plain = Texture::new(texels, [Wrap::Repeat; 2]);
    let transform = Mat3::from_translation(Vec2::new(0.4, -3.1)) * Mat3::from_scale(Vec2::new(2.0, 0.5));
    let moved = Texture { transform, ..plain.clone() };
    let uv = Vec2::new(0.7, 0.2);
    let expected = plain.sample(Vec2::new(1.8, -3.0));
    assert!(max_difference(moved.sample(uv), expected) < 1e-4, "scaled, then moved");
}

proptest! {
    #[test]
    fn means_stay_within_the_texture(
        corners in prop::collection::vec(prop::array::uniform2(prop::num::f32::ANY), 0..6),
        scale in -4..4_i32,
    ) {
        let texture = Texture::new(noise(3, 7), [Wrap::Mirror, Wrap::Clamp]);
        let scaled: Vec<Vec2> = corners.iter().map(|c| Vec2::from(*c)).collect();
        let tame: Vec<Vec2> =
            corners.iter().map(|c| Vec2::from(c.map(|x| (x.to_bits() as f32 / 4e9) * 10.0_f32.powi(scale)))).collect();
        for corners in [scaled, tame] {
            let mean = texture.mean_over(&corners);
            prop_assert!(mean.is_finite(), "{corners:?}: {mean}");
            prop_assert!(mean.min_element() >= 0.0 && mean.max_element() <= 1.001, "{corners:?}: {mean}");
        }
    }
}

fn scene(shape: Shape, texture: Option<Texture>, uv: [Vec2; 4], color: [Rgb; 4]) -> Scene {
    Scene {
        surfaces: vec![Surface::new(Shape::Sphere { center: DVec3::ZERO, radius: 1.0 }, 0), Surface::new(shape, 0)],
        attributes: vec![SurfaceAttributes { surface: 1, uv, color }],
        materials: vec![Material {
            name: String::new(),
            reflector: crate::reflectors::phong(Rgb::ONE, Rgb::ZERO, 1.0),
            exitance: Rgb::ZERO,
            two_sided: false,
            texture,
            base_color: Rgb::new(0.5, 1.0, 0.25),
        }],
        ..Scene::default()
    }
}

#[test]
fn base_colors_multiply_factor_texel_and_vertex_colour() {
    let quad = Shape::Quad([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
    let triangle = Shape::Triangle([DVec3::ZERO, DVec3::X, DVec3::Y]);
    let uv = [Vec2::new(0.1, 0.1), Vec2::new(0.9, 0.1), Vec2::new(0.9, 0.8), Vec2::new(0.1, 0.8)];
    let color = [Rgb::new(0.1, 0.9, 0.4), Rgb::new(0.8, 0.2, 0.3), Rgb::new(0.3, 1.0, 0.0), Rgb::new(0.6, 0.1, 0.9)];
    let texture = Texture::new(noise(6, 6), [Wrap::Repeat; 2]);
    let corners = [Vec2::new(0.1, 0.2), Vec2::new(0.8, 0.1), Vec2::new(0.3, 0.6)];
    for shape in [quad, triangle] {
        for texture in [None, Some(texture.clone())] {
            for color in [[Rgb::ONE; 4], color] {
                let scene = scene(shape.clone(), texture.clone(), uv, color);
                assert_eq!(scene.base_color(0, 0.5, 0.5), None, "the sphere has no attributes");
                assert_eq!(scene.base_color(9, 0.5, 0.5), None, "there is no such surface");
                assert_eq!(scene.mean_base_color(1, &corners[..2]), None, "two corners are no patch");
                let mean = scene.mean_base_color(1, &corners).expect("it has attributes");
                let mut sum = DVec3::ZERO;
                let n = 300;
                let mut count = 0;
                for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
                    let s = (i as f32 + 1.0 / 3.0) / n as f32;
                    let t = (j as f32 + 1.0 / 3.0) / n as f32;
                    let p = corners[0] + (corners[1] - corners[0]) * s + (corners[2] - corners[0]) * t;
                    sum += scene.base_color(1, p.x, p.y).expect("it has attributes").as_dvec3();
                    count += 1;
                }
                let expected = (sum / f64::from(count)).as_vec3();
                // 300 steps of a piecewise smooth function.
                assert!(max_difference(mean, expected) < 3e-3, "{shape:?}: {mean} against {expected}");
            }
        }
    }
}

#[test]
fn colours_alone_are_exact() {
    let quad = Shape::Quad([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
    let color = [Rgb::ZERO, Rgb::ZERO, Rgb::ONE, Rgb::ZERO];
    let scene = scene(quad, None, [Vec2::ZERO; 4], color);
    let mean = scene.mean_base_color(1, &[Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]).expect("it has attributes");
    // ∫∫ u v = 1/4.
    assert!(max_difference(mean, Rgb::new(0.125, 0.25, 0.0625)) < 1e-6, "{mean}");
}

fn png(image: &image::DynamicImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("it can be written");
    bytes.into_inner()
}

#[test]
fn images_are_decoded_to_linear_light() {
    let image = image::RgbImage::from_fn(3, 2, |x, y| image::Rgb([0, (x * 40) as u8, (188 + y) as u8]));
    let (texels, _) = decode(&png(&image.clone().into()), true).expect("a PNG image");
    assert_eq!((texels.width(), texels.height()), (3, 2), "size");
    // sRGB 188 is 0.5029 of white.
    assert!((texels.data()[0].z - 0.502_886).abs() < 1e-4, "{}", texels.data()[0]);
    let (raw, _) = decode(&png(&image.into()), false).expect("a PNG image");
    assert!((raw.data()[2].y - 80.0 / 255.0).abs() < 1e-6, "numbers as they are");
    let deep = image::ImageBuffer::<image::Rgb<u16>, Vec<u16>>::from_pixel(1, 1, image::Rgb([48_316, 65_535, 0]));
    let (texels, _) = decode(&png(&deep.into()), true).expect("a 16-bit PNG image");
    assert!(max_difference(texels.data()[0], Rgb::new(0.502_886, 1.0, 0.0)) < 1e-4, "16 bits");
    let gray = image::GrayImage::from_pixel(2, 2, image::Luma([188]));
    let (texels, _) = decode(&png(&gray.into()), true).expect("a grey PNG image");
    assert!((texels.mean() - Rgb::splat(0.502_886)).abs().max_element() < 1e-4, "grey");
    assert!(decode(b"nonsense", true).is_err(), "no image");
}

#[test]
fn halving_keeps_the_mean_of_even_sizes() {
    let texels = noise(8, 6);
    let half = texels.halved();
    assert_eq!((half.width(), half.height()), (4, 3), "half the size");
    assert!(max_difference(half.mean(), texels.mean()) < 1e-6, "the same mean");
    let odd = noise(5, 1).halved();
    assert_eq!((odd.width(), odd.height()), (3, 1), "rounded up");
}

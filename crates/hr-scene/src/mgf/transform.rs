//! Transforms: `-t -rx -ry -rz -s -mx -my -mz`, repeated with `-i`, in arrays with `-a`.
//!
//! All of them keep angles, so that what is round stays round. The rightmost argument acts last.

use super::fault::{Fault, count, fault, number};
use crate::error::quoted;
use glam::{DAffine3, DMat3, DVec3};

/// Most instances of one array; a slip of the keyboard should not fill the memory.
const MAX_INSTANCES: u64 = 1_000_000;

const USAGE: &str = "transform arguments are `-t dx dy dz`, `-rx a`, `-ry a`, `-rz a` (degrees), `-s factor`, `-mx`, \
                     `-my`, `-mz`, `-i count` and `-a count`";

/// A parsed transform, which may be an array of them.
#[derive(Debug, PartialEq)]
pub(super) struct Transform {
    blocks: Vec<Block>,
    instances: u64,
}

/// What stands between two of `-i` and `-a`.
#[derive(Debug, PartialEq)]
struct Block {
    matrix: DAffine3,
    repeat: Repeat,
}

#[derive(Debug, PartialEq)]
enum Repeat {
    /// So many times, in every instance.
    Times(u32),
    /// 0 … n − 1 times, an instance each.
    Array(u32),
}

impl Transform {
    /// One instance that stays where it is.
    pub(super) fn identity() -> Self {
        Self { blocks: Vec::new(), instances: 1 }
    }

    /// Parses transform arguments.
    pub(super) fn new(words: &[&str]) -> Result<Self, Fault> {
        let mut blocks = vec![Block { matrix: DAffine3::IDENTITY, repeat: Repeat::Times(1) }];
        let mut instances = 1_u64;
        let mut rest = words;
        while let Some((&flag, arguments)) = rest.split_first() {
            let used = match flag {
                "-i" | "-a" => {
                    let n = count(argument(flag, arguments, 0)?)?;
                    let repeat = if flag == "-i" { Repeat::Times(n) } else { Repeat::Array(n) };
                    if flag == "-a" {
                        instances = instances.saturating_mul(n.into());
                    }
                    blocks.push(Block { matrix: DAffine3::IDENTITY, repeat });
                    1
                }
                _ => {
                    let (step, used) = step(flag, arguments)?;
                    if let Some(block) = blocks.last_mut() {
                        block.matrix = step * block.matrix;
                    }
                    used
                }
            };
            rest = &arguments[used..];
        }
        if instances > MAX_INSTANCES {
            return fault(
                format!("an array of {instances} instances, where at most {MAX_INSTANCES} are allowed"),
                "make the array smaller",
            );
        }
        Ok(Self { blocks, instances })
    }

    /// How many instances there are: 1 where there is no array.
    pub(super) fn instances(&self) -> u64 {
        self.instances
    }

    /// The matrix of an instance, the last array's count running fastest.
    pub(super) fn matrix(&self, instance: u64) -> DAffine3 {
        let mut digits = instance;
        let mut total = DAffine3::IDENTITY;
        for block in self.blocks.iter().rev() {
            let times = match block.repeat {
                Repeat::Times(n) => n,
                Repeat::Array(n) => {
                    let digit = digits % u64::from(n.max(1));
                    digits /= u64::from(n.max(1));
                    u32::try_from(digit).unwrap_or(u32::MAX)
                }
            };
            total *= power(block.matrix, times);
        }
        total
    }
}

/// Uniform scale of a transform, > 0.
pub(super) fn scale(matrix: &DAffine3) -> f64 {
    matrix.matrix3.x_axis.length()
}

/// Whether a transform turns right hands into left ones.
pub(super) fn is_mirrored(matrix: &DAffine3) -> bool {
    // Not the determinant: its cubed scale overflows long before the scale does.
    let s = scale(matrix);
    let [x, y, z] = [matrix.matrix3.x_axis / s, matrix.matrix3.y_axis / s, matrix.matrix3.z_axis / s];
    x.cross(y).dot(z) < 0.0
}

fn power(matrix: DAffine3, exponent: u32) -> DAffine3 {
    let (mut result, mut square, mut rest) = (DAffine3::IDENTITY, matrix, exponent);
    while rest > 0 {
        if rest & 1 == 1 {
            result *= square;
        }
        square *= square;
        rest >>= 1;
    }
    result
}

fn argument<'a>(flag: &str, arguments: &[&'a str], index: usize) -> Result<&'a str, Fault> {
    match arguments.get(index) {
        Some(word) => Ok(word),
        None => fault(format!("{flag} without its number"), USAGE),
    }
}

/// One transform and how many words after the flag belong to it.
fn step(flag: &str, arguments: &[&str]) -> Result<(DAffine3, usize), Fault> {
    let value = |index| number(argument(flag, arguments, index)?);
    Ok(match flag {
        "-t" => (DAffine3::from_translation(DVec3::new(value(0)?, value(1)?, value(2)?)), 3),
        "-rx" | "-ry" | "-rz" => (DAffine3::from_mat3(rotation(flag, value(0)?)), 1),
        "-s" => {
            let factor = value(0)?;
            if factor == 0.0 {
                return fault("-s with a factor of 0 leaves nothing", "give a factor that is not 0");
            }
            (DAffine3::from_mat3(DMat3::from_diagonal(DVec3::splat(factor))), 1)
        }
        "-mx" => (mirror(DVec3::new(-1.0, 1.0, 1.0)), 0),
        "-my" => (mirror(DVec3::new(1.0, -1.0, 1.0)), 0),
        "-mz" => (mirror(DVec3::new(1.0, 1.0, -1.0)), 0),
        _ => return fault(format!("unknown transform argument {}", quoted(flag)), USAGE),
    })
}

fn mirror(diagonal: DVec3) -> DAffine3 {
    DAffine3::from_mat3(DMat3::from_diagonal(diagonal))
}

fn rotation(flag: &str, degrees: f64) -> DMat3 {
    // Right angles exactly, so that axis-parallel walls stay so and copies coincide.
    let (sin, cos) = match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        angle => angle.to_radians().sin_cos(),
    };
    let columns = match flag {
        "-rx" => [[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]],
        "-ry" => [[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]],
        _ => [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]],
    };
    DMat3::from_cols_array_2d(&columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(text: &str, instance: u64, p: [f64; 3]) -> DVec3 {
        let words: Vec<_> = text.split_whitespace().collect();
        Transform::new(&words).expect("valid").matrix(instance).transform_point3(p.into())
    }

    fn assert_near(a: DVec3, b: [f64; 3], text: &str) {
        assert!((a - DVec3::from(b)).abs().max_element() < 1e-14, "{text}: {a} is not {b:?}");
    }

    #[test]
    fn each_argument() {
        let h = 0.5 * 3.0_f64.sqrt();
        for (text, p, expected) in [
            ("", [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]),
            ("-t 1 2 3", [1.0, 1.0, 1.0], [2.0, 3.0, 4.0]),
            ("-s -2", [1.0, 2.0, 3.0], [-2.0, -4.0, -6.0]),
            ("-mx", [1.0, 2.0, 3.0], [-1.0, 2.0, 3.0]),
            ("-my", [1.0, 2.0, 3.0], [1.0, -2.0, 3.0]),
            ("-mz", [1.0, 2.0, 3.0], [1.0, 2.0, -3.0]),
            ("-rx 90", [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
            ("-ry 90", [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]),
            ("-rz -270", [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            ("-rz 30", [1.0, 0.0, 0.0], [h, 0.5, 0.0]),
            ("-rx 30", [0.0, 1.0, 0.0], [0.0, h, 0.5]),
            ("-ry 30", [0.0, 0.0, 1.0], [0.5, 0.0, h]),
            ("-s 2 -t 1 0 0 -rz 90", [4.0, 0.0, 0.0], [0.0, 9.0, 0.0]),
            ("-t 1 0 0 -i 3 -t 0 1 0 -rz 90 -i 1 -s 2", [0.0, 0.0, 0.0], [0.0, -4.0, 0.0]),
            ("-i 0 -t 1 1 1", [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]),
            ("-i 4000000000 -t 1 0 0", [0.0, 0.0, 0.0], [4e9, 0.0, 0.0]),
        ] {
            assert_near(moved(text, 0, p), expected, text);
        }
    }

    #[test]
    fn arrays() {
        let text = "-rz 90 -a 3 -t 10 0 0 -a 2 -t 0 20 0 -i 1 -t 0 0 5";
        let words: Vec<_> = text.split_whitespace().collect();
        let transform = Transform::new(&words).expect("valid");
        assert_eq!(transform.instances(), 6, "3 × 2");
        for instance in 0..6 {
            let expected = [10.0 * (instance / 2) as f64, 20.0 * (instance % 2) as f64 + 1.0, 5.0];
            assert_near(moved(text, instance, [1.0, 0.0, 0.0]), expected, text);
        }
        assert_eq!(Transform::new(&["-a", "0", "-mx"]).expect("valid").instances(), 0, "none at all");
    }

    #[test]
    fn mirrors_and_scales() {
        for (text, mirrored, factor) in [
            ("-mx", true, 1.0),
            ("-mx -my", false, 1.0),
            ("-s -3", true, 3.0),
            ("-s 1e120 -rx 20", false, 1e120),
            ("-s 1e-120 -mz -ry 77", true, 1e-120),
        ] {
            let words: Vec<_> = text.split_whitespace().collect();
            let matrix = Transform::new(&words).expect("valid").matrix(0);
            assert_eq!(is_mirrored(&matrix), mirrored, "{text}");
            assert!((scale(&matrix) / factor - 1.0).abs() < 1e-14, "{text}: {}", scale(&matrix));
        }
    }

    #[test]
    fn errors() {
        for (text, what) in [
            ("-t 1 2", "-t without"),
            ("-rx", "-rx without"),
            ("-rx nan", "'nan' is not a finite number"),
            ("-s 0", "leaves nothing"),
            ("-x 1", "unknown transform argument '-x'"),
            ("1", "unknown transform argument '1'"),
            ("-a -1 -mx", "'-1' is not a whole number"),
            ("-i 2.5 -mx", "'2.5' is not a whole number"),
            ("-a 1000 -t 1 0 0 -a 1001 -t 0 1 0", "1001000 instances"),
            ("-a 4000000000 -a 4000000000 -a 4000000000", "instances, where at most"),
        ] {
            let words: Vec<_> = text.split_whitespace().collect();
            let fault = Transform::new(&words).expect_err("invalid");
            assert!(fault.what.contains(what), "{text}: {fault:?}");
        }
    }
}

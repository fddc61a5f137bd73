//! Images of linear radiance out of files: PFM and NPY.

use crate::BenchError;
use hr_scene::{Image, Rgb};
use std::path::Path;

/// Reads a `.pfm` (colour) or `.npy` file (height × width × 3, float32 or float64, in C order), row 0 on top.
///
/// # Errors
/// [`BenchError::Read`] where there is no such file, [`BenchError::Format`] where it is not such an image.
pub fn read(path: &Path) -> Result<Image, BenchError> {
    let bytes = std::fs::read(path).map_err(|source| BenchError::Read { path: path.to_owned(), source })?;
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let image = match extension.as_str() {
        "pfm" => pfm(&bytes),
        "npy" => npy(&bytes),
        _ => Err(("it is neither .pfm nor .npy".into(), "give an image in one of the two formats")),
    };
    image.map_err(|(what, mend)| BenchError::Format { path: path.to_owned(), what, mend })
}

/// What is wrong, and what would be right.
type Fault = (String, &'static str);

/// A side of more pixels than this is no image.
const MOST_SIDE: usize = 1 << 20;

/// Splits off what comes before the first byte for which `ends` holds, and that byte.
fn until<'a>(bytes: &mut &'a [u8], ends: impl Fn(u8) -> bool) -> Option<&'a str> {
    let at = bytes.iter().position(|&b| ends(b))?;
    let word = std::str::from_utf8(&bytes[..at]).ok()?;
    *bytes = &bytes[at + 1..];
    Some(word)
}

/// "PF", width, height and scale (negative: little-endian), each followed by one white space; rows from the bottom up.
fn pfm(mut bytes: &[u8]) -> Result<Image, Fault> {
    let mend = "a colour PFM file begins with PF, width, height and -1.0";
    let mut word = || until(&mut bytes, |b| b.is_ascii_whitespace());
    if word() != Some("PF") {
        return Err(("it does not begin with PF".into(), mend));
    }
    let mut number = || word()?.parse::<f64>().ok();
    let (Some(width), Some(height), Some(scale)) = (number(), number(), number()) else {
        return Err(("its header is broken".into(), mend));
    };
    let little = scale < 0.0;
    let values =
        bytes.as_chunks::<4>().0.iter().map(|&b| if little { f32::from_le_bytes(b) } else { f32::from_be_bytes(b) });
    let mut image = image([height as usize, width as usize], &values.collect::<Vec<_>>())?;
    let rows: Vec<Rgb> = image.pixels.rchunks_exact(image.width as usize).flatten().copied().collect();
    image.pixels = rows;
    Ok(image)
}

/// NumPy's format, version 1 to 3: magic, version, length of the header, header, data.
fn npy(bytes: &[u8]) -> Result<Image, Fault> {
    let broken = || ("it is not an NPY file".to_owned(), "write it with numpy.save");
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or_else(broken)?;
    let (length, rest) = match rest {
        [1, _, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, rest),
        _ => return Err(broken()),
    };
    let (header, data) = rest.split_at_checked(length).ok_or_else(broken)?;
    let header = std::str::from_utf8(header).map_err(|_| broken())?;
    let after = |key: &str| header.split_once(key).map(|(_, after)| after.trim_start_matches([':', ' ']));
    let mend = "want little-endian float32 or float64 in C order, height x width x 3";
    if !after("'fortran_order'").is_some_and(|v| v.starts_with("False")) {
        return Err(("its data are not in C order".into(), mend));
    }
    let shape = after("'shape'").and_then(|v| v.strip_prefix('(')?.split_once(')')).ok_or_else(broken)?.0;
    let sides: Vec<usize> = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let [height, width, 3] = sides[..] else { return Err((format!("its shape is ({shape})"), mend)) };
    let values: Vec<f32> = match after("'descr'") {
        Some(kind) if kind.starts_with("'<f4'") => {
            data.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
        }
        Some(kind) if kind.starts_with("'<f8'") => {
            data.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b) as f32).collect()
        }
        _ => return Err(("its numbers are of another type".into(), mend)),
    };
    image([height, width], &values)
}

fn image([height, width]: [usize; 2], values: &[f32]) -> Result<Image, Fault> {
    if !(1..MOST_SIDE).contains(&width) || !(1..MOST_SIDE).contains(&height) || values.len() != width * height * 3 {
        let what = format!("it has {} numbers for {width} x {height} pixels", values.len());
        return Err((what, "an image has three numbers per pixel"));
    }
    let pixels = values.as_chunks::<3>().0.iter().map(|&p| Rgb::from(p)).collect();
    Ok(Image { width: width as u32, height: height as u32, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hr_scene::{Primaries, ToneMap};

    fn picture() -> Image {
        let mut image = Image::new(3, 2);
        for (k, p) in image.pixels.iter_mut().enumerate() {
            *p = Rgb::new(k as f32, 0.1 * k as f32, 1e6);
        }
        image
    }

    fn npy_bytes(version: u8, kind: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let mut bytes = vec![0x93];
        bytes.extend(b"NUMPY");
        bytes.extend([version, 0]);
        let length = (header.len() as u32).to_le_bytes();
        bytes.extend(if version == 1 { &length[..2] } else { &length[..] });
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn pfm_files_read_back() {
        let path = std::env::temp_dir().join(format!("hr-bench-read-{}.pfm", std::process::id()));
        picture().save(&path, &ToneMap::default(), Primaries::Radiance).expect("written");
        let back = read(&path);
        std::fs::remove_file(&path).expect("the file was there");
        assert_eq!(back.expect("read"), picture(), "every bit, the right way up");
        let mut big = b"PF\n1 1\n1.0\n".to_vec();
        big.extend([1.0_f32, 2.0, 3.0].iter().flat_map(|v| v.to_be_bytes()));
        assert_eq!(pfm(&big).expect("big-endian").pixels, [Rgb::new(1.0, 2.0, 3.0)], "big-endian");
    }

    #[test]
    fn npy_files_are_read() {
        let values: Vec<f32> = picture().pixels.iter().flat_map(Rgb::to_array).collect();
        let single: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let double: Vec<u8> = values.iter().flat_map(|v| f64::from(*v).to_le_bytes()).collect();
        assert_eq!(npy(&npy_bytes(1, "<f4", "False", "(2, 3, 3)", &single)).expect("float32"), picture(), "float32");
        assert_eq!(npy(&npy_bytes(2, "<f8", "False", "(2, 3, 3)", &double)).expect("float64"), picture(), "float64");
    }

    #[test]
    fn what_is_no_image_is_refused() {
        let data = [0; 72];
        for (bytes, hint) in [
            (npy_bytes(1, "<f4", "True", "(2, 3, 3)", &data), "C order"),
            (npy_bytes(1, "<i4", "False", "(2, 3, 3)", &data), "type"),
            (npy_bytes(1, "<f4", "False", "(2, 3)", &data), "shape"),
            (npy_bytes(1, "<f4", "False", "(2, 3, 3)", &data[..68]), "17 numbers"),
            (npy_bytes(9, "<f4", "False", "(2, 3, 3)", &data), "not an NPY"),
            (vec![0x93], "not an NPY"),
        ] {
            let (what, _) = npy(&bytes).expect_err(hint);
            assert!(what.contains(hint), "'{what}' should say '{hint}'");
        }
        for text in [
            "",
            "P6\n1 1\n255\n",
            "PF\n1 1\n",
            "PF\n1 x\n-1\n",
            "PF\n1 1\n-1\nshort",
            "PF\n-1 1\n-1\n",
            "PF 9e99 1 -1 ",
        ] {
            assert!(pfm(text.as_bytes()).is_err(), "'{text}' is no image");
        }
    }
}

//! Pictures beside one another.

use hr_scene::Image;

/// Pictures of one size, row by row, with black between them.
pub(crate) fn side_by_side(rows: &[Vec<Image>]) -> Image {
    const GAP: u32 = 4;
    let (width, height) = rows.iter().flatten().fold((0, 0), |(w, h), i| (i.width.max(w), i.height.max(h)));
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
    let mut all = Image::new(columns * (width + GAP), rows.len() as u32 * (height + GAP));
    for (y, row) in rows.iter().enumerate() {
        for (x, image) in row.iter().enumerate() {
            let (left, top) = (x as u32 * (width + GAP), y as u32 * (height + GAP));
            for (line, pixels) in image.pixels.chunks(image.width.max(1) as usize).enumerate() {
                let start = ((top + line as u32) * all.width + left) as usize;
                all.pixels[start..start + pixels.len()].copy_from_slice(pixels);
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_side_by_side() {
        let of = |value: f32| {
            let mut image = Image::new(3, 2);
            image.pixels.fill(hr_scene::Rgb::splat(value));
            image
        };
        let all = side_by_side(&[vec![of(1.0), of(2.0)], vec![of(3.0)]]);
        assert_eq!((all.width, all.height), (14, 12), "two columns and two rows with gaps");
        let at = |x: u32, y: u32| all.pixels[(y * all.width + x) as usize].x;
        let found = [at(2, 1), at(3, 0), at(7, 0), at(0, 6), at(7, 6)];
        assert_eq!(found, [1.0, 0.0, 2.0, 3.0, 0.0], "each in its place, black between");
    }
}

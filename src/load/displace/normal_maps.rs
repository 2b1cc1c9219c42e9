//! Normal maps from height maps.

use crate::image::{Encoding, Image, Pixels};
use crate::math::Vec3;
use std::sync::Arc;

/// Height range of a bump map from black to white at factor 1 (`-bm` in MTL), as a fraction of the texture's width. The
/// formats don't define the unit.
pub const BUMP_HEIGHT: f32 = 0.01;

/// Whether an image is a normal map rather than a height map: at least 90 % of up to 4096 sampled texels must be coloured and
/// decode to unit vectors with z > 0.
pub fn holds_normals(image: &Image) -> bool {
    let (w, h) = (image.width, image.height);
    let (columns, rows) = (w.min(64), h.min(64));
    let mut vectors = 0;
    for (i, j) in (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))) {
        let at = |k: u32, n: u32, size: u32| (u64::from(k) * u64::from(size) / u64::from(n)) as u32;
        let [r, g, b, _] = image.rgba(at(i, columns, w), at(j, rows, h));
        let n = Vec3::new(r, g, b) * 2.0 - 1.0;
        vectors += u32::from(n.z > 0.0 && (n.length() - 1.0).abs() < 0.15 && (r - b).abs() > 0.02);
    }
    vectors * 10 >= columns * rows * 9
}

/// The tangent-space normal map of a tileable height map, by central differences: x along u, y against the rows.
/// `height` is the height range from black to white, in image widths.
pub fn normals_of_heights(image: &Image, height: f32) -> Image {
    let (w, h) = (image.width, image.height);
    // Assumes square texels: one scale for both axes.
    let slope = height * w as f32 * 0.5;
    let value = |x: u32, y: u32| image.rgba(x, y)[0];
    let mut texels = Vec::with_capacity(w as usize * h as usize * 3);
    for y in 0..h {
        for x in 0..w {
            let along_u = value((x + 1) % w, y) - value((x + w - 1) % w, y);
            let along_rows = value(x, (y + 1) % h) - value(x, (y + h - 1) % h);
            let n = Vec3::new(-slope * along_u, slope * along_rows, 1.0).normalize();
            texels.extend((n * 0.5 + 0.5).to_array().map(|c| (c * 65535.0).round() as u16));
        }
    }
    Image {
        name: format!("{} as normals", image.name),
        width: w,
        height: h,
        channels: 3,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::U16(texels)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(channels: u32, texel: impl Fn(u32, u32) -> Vec<u8>) -> Image {
        let pixels =
            (0..8).flat_map(|y| (0..8).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect();
        let pixels = Arc::new(Pixels::U8(pixels));
        Image { name: "a".into(), width: 8, height: 8, channels, encoding: Encoding::Linear, pixels }
    }

    #[test]
    fn normals_and_heights_are_distinguished() {
        assert!(holds_normals(&image(3, |x, _| vec![128 + x as u8, 120, 255])));
        for grey in [0, 128, 201, 255] {
            assert!(!holds_normals(&image(3, |_, _| vec![grey; 3])), "{grey}");
            assert!(!holds_normals(&image(1, |_, _| vec![grey])), "{grey}");
        }
    }

    #[test]
    fn normals_of_a_ramp_tilt_against_its_slope() {
        // Slope of 16/255 per texel along u, -8/255 per row.
        let ramp = image(1, |x, y| vec![(100 + 16 * x - 8 * y) as u8]);
        let normals = normals_of_heights(&ramp, 0.5);
        let [r, g, b, _] = normals.rgba(3, 3);
        let n = Vec3::new(r, g, b) * 2.0 - 1.0;
        let expected = Vec3::new(-0.5 * 8.0 * 16.0 / 255.0, -0.5 * 8.0 * 8.0 / 255.0, 1.0).normalize();
        assert!(n.distance(expected) < 1e-4, "{n} {expected}");
    }
}

//! Pictures of 8 bits for the terminal and the page, and scaling them down.

use oscura::color::{linear_from_srgb, srgb_from_linear};

/// Display-referred RGBA with straight alpha, 8 bits, row by row from the top.
pub(super) struct Pixels {
    pub size: (u32, u32),
    pub rgba: Vec<u8>,
}

impl Pixels {
    /// A pixel; transparent black outside of the picture.
    pub fn at(&self, x: u32, y: u32) -> [u8; 4] {
        let (width, height) = self.size;
        if x >= width || y >= height {
            return [0; 4];
        }
        let index = (y as usize * width as usize + x as usize) * 4;
        [self.rgba[index], self.rgba[index + 1], self.rgba[index + 2], self.rgba[index + 3]]
    }
}

/// Size of a picture scaled down, if necessary, to fit into `max_size`; keeps the aspect ratio.
pub(super) fn fitted_size((width, height): (u32, u32), max_size: (u32, u32)) -> (u32, u32) {
    let scale_x = f64::from(max_size.0) / f64::from(width.max(1));
    let scale_y = f64::from(max_size.1) / f64::from(height.max(1));
    let scale = scale_x.min(scale_y).min(1.0);
    let scaled = |pixels: u32, max: u32| ((f64::from(pixels) * scale).round() as u32).clamp(1, max.max(1));
    (scaled(width, max_size.0), scaled(height, max_size.1))
}

/// Scales a picture down to fit into `max_size`, by a box filter in linear light.
pub(super) fn downscaled(picture: &Pixels, max_size: (u32, u32)) -> Pixels {
    let size = fitted_size(picture.size, max_size);
    // Source pixels of a pixel, along one axis.
    let range = |index: u32, count: u32, source_count: u32| {
        let edge = |index: u32| (u64::from(index) * u64::from(source_count) / u64::from(count)) as u32;
        edge(index)..edge(index + 1).max(edge(index) + 1)
    };
    let mut rgba = Vec::with_capacity(size.0 as usize * size.1 as usize * 4);
    for y in 0..size.1 {
        for x in 0..size.0 {
            let rows = range(y, size.1, picture.size.1);
            let columns = range(x, size.0, picture.size.0);
            let pixels = rows.flat_map(|row| columns.clone().map(move |column| picture.at(column, row)));
            rgba.extend(mean(pixels));
        }
    }
    Pixels { size, rgba }
}

/// Mean of pixels in linear light, weighted by alpha.
fn mean(pixels: impl Iterator<Item = [u8; 4]>) -> [u8; 4] {
    let (mut sum, mut alphas, mut count) = ([0.0f32; 3], 0.0f32, 0.0f32);
    for [r, g, b, a] in pixels {
        let alpha = f32::from(a) / 255.0;
        for (sum, code) in sum.iter_mut().zip([r, g, b]) {
            *sum += linear_from_srgb(f32::from(code) / 255.0) * alpha;
        }
        alphas += alpha;
        count += 1.0;
    }
    let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
    let [r, g, b] = sum.map(|sum| byte(srgb_from_linear(sum / alphas.max(1e-6))));
    [r, g, b, byte(alphas / count.max(1.0))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fitted_sizes_keep_the_aspect_ratio_and_never_grow() {
        assert_eq!(fitted_size((1280, 720), (80, 44)), (78, 44));
        assert_eq!(fitted_size((10, 10), (80, 44)), (10, 10));
        assert_eq!(fitted_size((10_000, 10), (80, 44)), (80, 1));
    }

    #[test]
    fn downscaling_averages_in_linear_light() {
        let rgba = [[255, 255, 255, 255], [0, 0, 0, 255], [255, 0, 0, 255], [9, 9, 9, 0]].concat();
        let small = downscaled(&Pixels { size: (4, 1), rgba }, (2, 9));
        // Half of white in linear light has the sRGB code 188; transparent pixels add no colour.
        assert_eq!((small.size, small.at(0, 0)), ((2, 1), [188, 188, 188, 255]));
        assert_eq!((small.at(1, 0), small.at(2, 0)), ([255, 0, 0, 128], [0; 4]));
    }
}

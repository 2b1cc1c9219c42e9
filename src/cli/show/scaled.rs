//! Pictures made smaller.

use oscura::color::{linear_from_srgb, srgb_from_linear};

/// Alpha from which on a pixel is drawn.
pub(super) const OPAQUE: u8 = 128;

/// Display-referred RGBA with straight alpha, row by row from the top.
pub(super) struct Pixels {
    pub size: (u32, u32),
    pub rgba: Vec<u8>,
}

impl Pixels {
    /// A pixel; transparent black beyond the edge.
    pub fn at(&self, x: u32, y: u32) -> [u8; 4] {
        let (width, height) = self.size;
        if x >= width || y >= height {
            return [0; 4];
        }
        let at = (y as usize * width as usize + x as usize) * 4;
        [self.rgba[at], self.rgba[at + 1], self.rgba[at + 2], self.rgba[at + 3]]
    }
}

/// The largest size of a picture's shape that is no larger than the picture and the room.
pub(super) fn fitted_size((width, height): (u32, u32), room: (u32, u32)) -> (u32, u32) {
    let across = f64::from(room.0) / f64::from(width.max(1));
    let down = f64::from(room.1) / f64::from(height.max(1));
    let scale = across.min(down).min(1.0);
    let edge = |pixels: u32, most: u32| ((f64::from(pixels) * scale).round() as u32).clamp(1, most.max(1));
    (edge(width, room.0), edge(height, room.1))
}

/// The picture, made small enough: each pixel is the mean light of those that it stands for.
pub(super) fn fitting(picture: &Pixels, room: (u32, u32)) -> Pixels {
    let size = fitted_size(picture.size, room);
    let range = |at: u32, count: u32, of: u32| {
        let edge = |at: u32| (u64::from(at) * u64::from(of) / u64::from(count)) as u32;
        edge(at)..edge(at + 1).max(edge(at) + 1)
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

/// The mean of pixels, each weighted by its alpha.
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
    fn sizes_keep_their_shape_and_never_grow() {
        assert_eq!(fitted_size((1280, 720), (80, 44)), (78, 44));
        assert_eq!(fitted_size((10, 10), (80, 44)), (10, 10));
        assert_eq!(fitted_size((10_000, 10), (80, 44)), (80, 1));
    }

    #[test]
    fn small_pixels_are_means_of_light() {
        let rgba = [[255, 255, 255, 255], [0, 0, 0, 255], [255, 0, 0, 255], [9, 9, 9, 0]].concat();
        let small = fitting(&Pixels { size: (4, 1), rgba }, (2, 9));
        // Half the light of white has the code 188; what is transparent adds no colour.
        assert_eq!((small.size, small.at(0, 0)), ((2, 1), [188, 188, 188, 255]));
        assert_eq!((small.at(1, 0), small.at(2, 0)), ([255, 0, 0, 128], [0; 4]));
    }
}

//! Ever coarser copies of an image (Williams 1983, "Pyramidal Parametrics").

use super::texels::{Texels, WithTexels, with_texels};
use crate::color::linear_from_srgb;
use crate::image::{Encoding, Image, Pixels};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// The levels above the image itself, down to one texel; each in the image's own format.
pub(super) fn coarser_levels(image: &Image) -> Vec<Image> {
    let mut levels: Vec<Image> = Vec::new();
    loop {
        let finer = levels.last().unwrap_or(image);
        if finer.width == 1 && finer.height == 1 {
            return levels;
        }
        let next = halved(finer);
        levels.push(next);
    }
}

/// Half the size, rounded down but at least 1. Each texel is the mean of the area that it covers, in linear values;
/// colours weigh by their alpha, so that invisible ones don't bleed into others.
fn halved(image: &Image) -> Image {
    let (width, height) = ((image.width / 2).max(1), (image.height / 2).max(1));
    let columns: Vec<Taps> = (0..width).map(|x| Taps::new(x, width, image.width)).collect();
    let rows: Vec<Taps> = (0..height).map(|y| Taps::new(y, height, image.height)).collect();
    let task = Halve { columns: &columns, rows: &rows, stride: image.width as usize };
    let rgba = with_texels(image, task);
    let pixels = encode(&rgba, image);
    Image { name: image.name.clone(), width, height, pixels: Arc::new(pixels), ..*image }
}

/// The texels of a finer level that a coarser one's texel covers along one axis, and how much of each.
#[derive(Clone, Copy)]
struct Taps {
    first: u32,
    count: u32,
    weights: [f32; 3],
}

impl Taps {
    fn new(i: u32, coarse: u32, fine: u32) -> Taps {
        // Integers: texel i covers i * fine / coarse to (i + 1) * fine / coarse, at most three texels.
        let (from, to) = (u64::from(i) * u64::from(fine), (u64::from(i) + 1) * u64::from(fine));
        let coarse = u64::from(coarse);
        let first = from / coarse;
        let mut taps = Taps { first: first as u32, count: 0, weights: [0.0; 3] };
        for (k, weight) in taps.weights.iter_mut().enumerate() {
            let (start, end) = ((first + k as u64) * coarse, (first + k as u64 + 1) * coarse);
            let covered = end.min(to).saturating_sub(start.max(from));
            if covered > 0 {
                *weight = (covered as f64 / fine as f64) as f32;
                taps.count = k as u32 + 1;
            }
        }
        taps
    }

    fn iter(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        (0..self.count as usize).map(|k| (self.first as usize + k, self.weights[k]))
    }
}

struct Halve<'a> {
    columns: &'a [Taps],
    rows: &'a [Taps],
    stride: usize,
}

impl WithTexels for Halve<'_> {
    type Output = Vec<[f32; 4]>;

    fn run(self, texels: impl Texels) -> Vec<[f32; 4]> {
        let of_row = |row: &Taps| {
            let mean = |column| mean_of(row, column, self.stride, &texels);
            self.columns.iter().map(mean).collect::<Vec<_>>()
        };
        self.rows.par_iter().flat_map_iter(of_row).collect()
    }
}

#[inline(always)]
fn mean_of(row: &Taps, column: &Taps, stride: usize, texels: &impl Texels) -> [f32; 4] {
    let (mut color, mut visible, mut alpha, mut total) = ([0.0f32; 3], [0.0f32; 3], 0.0, 0.0);
    for (y, of_row) in row.iter() {
        for (x, of_column) in column.iter() {
            let [r, g, b, a] = texels.texel(y * stride + x);
            let weight = of_row * of_column;
            total += weight;
            alpha += weight * a;
            for (i, c) in [r, g, b].into_iter().enumerate() {
                color[i] += weight * c;
                visible[i] += weight * a * c;
            }
        }
    }
    let [r, g, b] = if alpha > 0.0 { visible.map(|c| c / alpha) } else { color.map(|c| c / total) };
    [r, g, b, alpha / total]
}

/// Back to the format of `like`.
fn encode(rgba: &[[f32; 4]], like: &Image) -> Pixels {
    let channels: &[usize] = match like.channels {
        1 => &[0],
        2 => &[0, 3],
        3 => &[0, 1, 2],
        _ => &[0, 1, 2, 3],
    };
    let is_srgb = |c: usize| like.encoding == Encoding::Srgb && c != 3;
    let values = rgba.par_iter().flat_map_iter(|texel| channels.iter().map(|&c| (c, texel[c])));
    match &*like.pixels {
        Pixels::U8(_) => {
            Pixels::U8(values.map(|(c, v)| if is_srgb(c) { srgb_code(v) } else { code(v) }).collect())
        }
        Pixels::U16(_) => {
            let of_srgb = |v| (crate::color::srgb_from_linear(v) * 65535.0).round() as u16;
            let linear = |v: f32| (v * 65535.0).round() as u16;
            Pixels::U16(values.map(|(c, v)| if is_srgb(c) { of_srgb(v) } else { linear(v) }).collect())
        }
        Pixels::F32(_) => Pixels::F32(values.map(|(_, v)| v).collect()),
    }
}

fn code(linear: f32) -> u8 {
    (linear * 255.0 + 0.5) as u8
}

/// The nearest sRGB code, as encoded.
fn srgb_code(linear: f32) -> u8 {
    const FIRST_GUESSES: usize = 1024;
    // Linear values where one code gives way to the next, and a code at or below the right one for each interval.
    static TABLES: OnceLock<(Vec<f32>, Vec<u8>)> = OnceLock::new();
    let (limits, guesses) = TABLES.get_or_init(|| {
        let limits: Vec<f32> = (0..255).map(|i| linear_from_srgb((i as f32 + 0.5) / 255.0)).collect();
        let below = |x: f32| limits.partition_point(|&l| l <= x) as u8;
        let guesses = (0..=FIRST_GUESSES).map(|i| below(i as f32 / FIRST_GUESSES as f32)).collect();
        (limits, guesses)
    });
    let linear = linear.clamp(0.0, 1.0);
    let mut code = guesses[(linear * FIRST_GUESSES as f32) as usize];
    while limits.get(code as usize).is_some_and(|&l| l <= linear) {
        code += 1;
    }
    code
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::srgb_from_linear;

    fn grey(width: u32, height: u32) -> Image {
        let rgb = (0..width * height * 3).map(|i| ((i * 7919) % 101) as f32 * 0.01).collect();
        Image::from_linear_rgb("grey", width, height, rgb)
    }

    fn mean(image: &Image) -> [f64; 3] {
        let n = f64::from(image.width * image.height);
        let mut sum = [0.0; 3];
        for (x, y) in (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y))) {
            let texel = image.rgba(x, y);
            (0..3).for_each(|i| sum[i] += f64::from(texel[i]) / n);
        }
        sum
    }

    #[test]
    fn every_level_keeps_the_mean() {
        for (width, height) in [(16, 16), (7, 5), (1, 9), (33, 2), (3, 1)] {
            let image = grey(width, height);
            let levels = coarser_levels(&image);
            assert_eq!(levels.len() as u32, 31 - width.max(height).leading_zeros());
            for level in levels {
                for (a, b) in mean(&level).into_iter().zip(mean(&image)) {
                    assert!((a - b).abs() < 1e-5, "{width} x {height}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn codes_are_the_nearest() {
        for i in 0..=100_000 {
            let linear = i as f32 / 100_000.0;
            let exact = f64::from(srgb_from_linear(linear)) * 255.0;
            let found = f64::from(srgb_code(linear));
            assert!((found - exact).abs() <= 0.5 + 1e-4, "{linear}: {found} {exact}");
        }
    }

    #[test]
    fn invisible_colours_do_not_bleed() {
        let data = vec![200, 0, 0, 255, 0, 200, 0, 0];
        let image = Image {
            name: String::new(),
            width: 2,
            height: 1,
            channels: 4,
            encoding: Encoding::Linear,
            pixels: Arc::new(Pixels::U8(data)),
        };
        let level = &coarser_levels(&image)[0];
        let Pixels::U8(bytes) = &*level.pixels else { panic!("8 bits stay 8 bits") };
        assert_eq!(bytes[..], [200, 0, 0, 128]);
    }
}

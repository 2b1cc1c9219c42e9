//! Downsampling of mip levels (Williams 1983, "Pyramidal Parametrics"), and decoding of texels to linear values.

use crate::color::{linear_from_srgb, srgb_from_linear, srgb_table};
use crate::image::{Encoding, Image, Pixels};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Width and height of an image's mip levels, from the image itself to one texel.
pub(super) fn sizes(width: u32, height: u32) -> impl Iterator<Item = [u32; 2]> {
    let next = |&[w, h]: &[u32; 2]| ([w, h] != [1, 1]).then(|| [(w / 2).max(1), (h / 2).max(1)]);
    std::iter::successors(Some([width, height]), next)
}

/// The next coarser level in the image's own format: half the size, rounded down but at least 1. Each texel is the mean of linear values
/// over the area that it covers (box filter); colours are weighted by alpha, so that transparent texels don't bleed into others.
pub(super) fn halved(image: &Image) -> Image {
    halved_by(image, Threads::All)
}

/// The next coarser level, computed on this thread.
pub(super) fn halved_by_one_thread(image: &Image) -> Image {
    halved_by(image, Threads::This)
}

/// The levels of an image from itself to one texel; none without an image.
pub(super) fn mip_levels(image: Option<Image>) -> impl Iterator<Item = Image> {
    std::iter::successors(image, |finer| ((finer.width, finer.height) != (1, 1)).then(|| halved(finer)))
}

/// The threads that a task may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Threads {
    All,
    This,
}

fn halved_by(image: &Image, threads: Threads) -> Image {
    halved_rows(image, [0, image.height], 0..(image.height / 2).max(1), threads)
}

/// The rows `coarse` of the next coarser level of an image with `height` rows; `image` holds its rows from `first` on.
pub(super) fn halved_rows(
    image: &Image,
    [first, height]: [u32; 2],
    coarse: Range<u32>,
    threads: Threads,
) -> Image {
    let means = Downsampling::new(image, [first, height], coarse, threads);
    let is_srgb = image.encoding == Encoding::Srgb;
    let pixels = match &*image.pixels {
        Pixels::U8(_) => {
            let srgb = SrgbCodes::get();
            let color = |v| if is_srgb { srgb.nearest(v) } else { code(v) };
            Pixels::U8(means.encoded(color, code))
        }
        Pixels::U16(_) => {
            let linear = |v: f32| (v * 65535.0).round() as u16;
            let color = |v| if is_srgb { linear(srgb_from_linear(v)) } else { linear(v) };
            Pixels::U16(means.encoded(color, linear))
        }
        Pixels::F32(_) => Pixels::F32(means.encoded(|v| v, |v| v)),
        Pixels::Encoded(_) => unreachable!("images are decoded before they are averaged"),
    };
    let (width, height) = (means.columns.len() as u32, means.rows.len() as u32);
    Image { name: image.name.clone(), width, height, pixels: Arc::new(pixels), ..*image }
}

/// The rows of a level of `height` rows that a row of the next coarser level covers.
pub(super) fn covered(row: u32, height: u32) -> Range<u32> {
    let taps = BoxTaps::of_level(row, height);
    taps.first..taps.first + taps.count
}

/// The texels of a level that a texel of the next coarser level covers along one axis, and the covered fractions.
#[derive(Clone, Copy)]
struct BoxTaps {
    first: u32,
    count: u32,
    weights: [f32; 3],
}

impl BoxTaps {
    fn new(i: u32, coarse: u32, fine: u32) -> BoxTaps {
        // In integers: texel i covers i * fine / coarse to (i + 1) * fine / coarse, at most three texels.
        let (from, to) = (u64::from(i) * u64::from(fine), (u64::from(i) + 1) * u64::from(fine));
        let coarse = u64::from(coarse);
        let first = from / coarse;
        let mut taps = BoxTaps { first: first as u32, count: 0, weights: [0.0; 3] };
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

    /// The taps along an axis where the finer level has `fine` texels.
    fn of_level(i: u32, fine: u32) -> BoxTaps {
        BoxTaps::new(i, (fine / 2).max(1), fine)
    }

    fn iter(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        (0..self.count as usize).map(|k| (self.first as usize + k, self.weights[k]))
    }
}

/// Computes (rows of) the next coarser level of an image.
struct Downsampling<'a> {
    image: &'a Image,
    columns: Vec<BoxTaps>,
    rows: Vec<BoxTaps>,
    /// Does every texel cover exactly 2 x 2 finer ones?
    is_even: bool,
    threads: Threads,
}

impl<'a> Downsampling<'a> {
    fn new(
        image: &'a Image,
        [first, height]: [u32; 2],
        coarse: Range<u32>,
        threads: Threads,
    ) -> Downsampling<'a> {
        let (width, narrow) = (image.width, (image.width / 2).max(1));
        let columns = (0..narrow).map(|i| BoxTaps::new(i, narrow, width)).collect();
        let row = |i: u32| {
            let taps = BoxTaps::of_level(i, height);
            BoxTaps { first: taps.first - first, ..taps }
        };
        let is_even = width.is_multiple_of(2) && height.is_multiple_of(2);
        Downsampling { image, columns, rows: coarse.map(row).collect(), is_even, threads }
    }

    /// All texels in the image's own format: `color` and `alpha` encode linear values.
    fn encoded<T>(&self, color: impl Fn(f32) -> T + Sync, alpha: impl Fn(f32) -> T + Sync) -> Vec<T>
    where
        T: bytemuck::Zeroable + Copy + Send,
    {
        match self.image.channels {
            1 => self.encoded_as::<T, 1>(color, alpha),
            2 => self.encoded_as::<T, 2>(color, alpha),
            3 => self.encoded_as::<T, 3>(color, alpha),
            _ => self.encoded_as::<T, 4>(color, alpha),
        }
    }

    fn encoded_as<T, const N: usize>(
        &self,
        color: impl Fn(f32) -> T + Sync,
        alpha: impl Fn(f32) -> T + Sync,
    ) -> Vec<T>
    where
        T: bytemuck::Zeroable + Copy + Send,
    {
        let width = self.columns.len();
        let mut values = vec![T::zeroed(); width * self.rows.len() * N];
        let means = || vec![[0.0; 4]; width];
        let fill = |means: &mut Vec<[f32; 4]>, (values, row): (&mut [T], &BoxTaps)| {
            with_texels(self.image, RowMeans { of: self, row, means });
            for (mean, texel) in means.iter().zip(values.chunks_exact_mut(N)) {
                for (c, value) in texel.iter_mut().enumerate() {
                    let is_alpha = N.is_multiple_of(2) && c == N - 1;
                    *value = if is_alpha { alpha(mean[3]) } else { color(mean[c]) };
                }
            }
        };
        match self.threads {
            Threads::All => {
                let rows = values.par_chunks_exact_mut(width * N).zip(&self.rows).with_min_len(16);
                rows.for_each_init(means, fill);
            }
            Threads::This => {
                let mut means = means();
                values.chunks_exact_mut(width * N).zip(&self.rows).for_each(|row| fill(&mut means, row));
            }
        }
        values
    }
}

/// Computes the linear mean values of a row.
struct RowMeans<'a> {
    of: &'a Downsampling<'a>,
    row: &'a BoxTaps,
    means: &'a mut [[f32; 4]],
}

impl WithTexels for RowMeans<'_> {
    type Output = ();

    fn run(self, texels: impl Texels) {
        let stride = self.of.image.width as usize;
        if self.of.is_even {
            let first = self.row.first as usize * stride;
            for (x, mean) in self.means.iter_mut().enumerate() {
                let at = first + 2 * x;
                let texel = |offset| texels.texel(at + offset);
                *mean = mean_of_four([texel(0), texel(1), texel(stride), texel(stride + 1)]);
            }
        } else {
            for (mean, column) in self.means.iter_mut().zip(&self.of.columns) {
                *mean = mean_of(self.row, column, stride, &texels);
            }
        }
    }
}

/// [`mean_of`] for four whole texels.
#[inline(always)]
fn mean_of_four(texels: [[f32; 4]; 4]) -> [f32; 4] {
    let [a, b, c, d] = texels;
    let mean = |values: [f32; 4]| 0.25 * values[0] + 0.25 * values[1] + 0.25 * values[2] + 0.25 * values[3];
    let alpha = mean([a[3], b[3], c[3], d[3]]);
    let color = |i: usize| match alpha > 0.0 {
        true => mean([a[3] * a[i], b[3] * b[i], c[3] * c[i], d[3] * d[i]]) / alpha,
        false => mean([a[i], b[i], c[i], d[i]]),
    };
    [color(0), color(1), color(2), alpha]
}

#[inline(always)]
fn mean_of(row: &BoxTaps, column: &BoxTaps, stride: usize, texels: &impl Texels) -> [f32; 4] {
    let (mut color, mut visible, mut alpha, mut total) = ([0.0f32; 3], [0.0f32; 3], 0.0, 0.0);
    for (y, row_weight) in row.iter() {
        for (x, column_weight) in column.iter() {
            let [r, g, b, a] = texels.texel(y * stride + x);
            let weight = row_weight * column_weight;
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

fn code(linear: f32) -> u8 {
    (linear * 255.0 + 0.5) as u8
}

/// Finds the nearest 8-bit sRGB codes by table.
struct SrgbCodes {
    /// By code: the linear value from which the next code is nearer; infinite for the last.
    limits: [f32; 256],
    /// The code at the start of each of [`SrgbCodes::INTERVALS`] intervals, which are so narrow that each contains at most one
    /// limit.
    starts: Vec<u8>,
}

impl SrgbCodes {
    const INTERVALS: usize = 8192;

    fn get() -> &'static SrgbCodes {
        static CODES: OnceLock<SrgbCodes> = OnceLock::new();
        CODES.get_or_init(|| {
            let limit = |i| if i < 255 { linear_from_srgb((i as f32 + 0.5) / 255.0) } else { f32::INFINITY };
            let limits: [f32; 256] = std::array::from_fn(limit);
            let code_at = |x: f32| limits.partition_point(|&l| l <= x) as u8;
            let starts = (0..=Self::INTERVALS).map(|i| code_at(i as f32 / Self::INTERVALS as f32)).collect();
            SrgbCodes { limits, starts }
        })
    }

    /// The code nearest to a linear value in sRGB encoding.
    #[inline(always)]
    fn nearest(&self, linear: f32) -> u8 {
        let linear = linear.clamp(0.0, 1.0);
        let start = self.starts[(linear * Self::INTERVALS as f32) as usize];
        start + u8::from(self.limits[start as usize] <= linear)
    }
}

// Decoding of texels to linear values; the format is dispatched once per lookup, not once per texel.

/// Decodes texels of one format.
pub(super) trait Texels: Sync {
    /// Linear RGBA of the texel at a row-major index in the image.
    fn texel(&self, at: usize) -> [f32; 4];
}

/// A task on the texels of an image, generic over their format.
pub(super) trait WithTexels {
    /// Result of the task.
    type Output;

    /// Runs the task.
    fn run(self, texels: impl Texels) -> Self::Output;
}

/// Runs `task` on the texels of `image`.
#[inline(always)]
pub(super) fn with_texels<T: WithTexels>(image: &Image, task: T) -> T::Output {
    with_common_texels(image, task, |task| task.run(AnyFormat(image)))
}

/// Runs `task` on the texels of `image` if they are decoded and of a common format; else runs `otherwise`.
#[inline(always)]
pub(super) fn with_common_texels<T: WithTexels>(
    image: &Image,
    task: T,
    otherwise: impl FnOnce(T) -> T::Output,
) -> T::Output {
    match &*image.pixels {
        Pixels::U8(data) => {
            let color = if image.encoding == Encoding::Srgb { srgb_table() } else { linear_table() };
            match image.channels {
                1 => task.run(Bytes::<1> { data, color }),
                2 => task.run(Bytes::<2> { data, color }),
                3 => task.run(Bytes::<3> { data, color }),
                _ => task.run(Bytes::<4> { data, color }),
            }
        }
        Pixels::F32(data) if image.channels == 3 => task.run(Floats { data }),
        _ => otherwise(task),
    }
}

/// 8-bit texels of `N` channels.
struct Bytes<'a, const N: usize> {
    data: &'a [u8],
    /// Linear value by code, of all channels but alpha.
    color: &'static [f32; 256],
}

impl<const N: usize> Texels for Bytes<'_, N> {
    #[inline(always)]
    fn texel(&self, at: usize) -> [f32; 4] {
        let codes: &[u8] = &self.data[at * N..at * N + N];
        let color = |i: usize| self.color[codes[i] as usize];
        let alpha = |i: usize| linear_table()[codes[i] as usize];
        match N {
            1 => [color(0), color(0), color(0), 1.0],
            2 => [color(0), color(0), color(0), alpha(1)],
            3 => [color(0), color(1), color(2), 1.0],
            _ => [color(0), color(1), color(2), alpha(3)],
        }
    }
}

/// RGB floats.
struct Floats<'a> {
    data: &'a [f32],
}

impl Texels for Floats<'_> {
    #[inline(always)]
    fn texel(&self, at: usize) -> [f32; 4] {
        let rgb = &self.data[at * 3..at * 3 + 3];
        [rgb[0], rgb[1], rgb[2], 1.0]
    }
}

/// Texels of any format, decoded one by one.
struct AnyFormat<'a>(&'a Image);

impl Texels for AnyFormat<'_> {
    #[inline]
    fn texel(&self, at: usize) -> [f32; 4] {
        let width = self.0.width as usize;
        self.0.rgba((at % width) as u32, (at / width) as u32)
    }
}

/// Values 0..1 of linear 8-bit codes.
fn linear_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| i as f32 / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All mip levels coarser than the image itself.
    fn coarser_levels(image: &Image) -> Vec<Image> {
        mip_levels(Some(image.clone())).skip(1).collect()
    }

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
    fn srgb_codes_are_the_nearest() {
        for i in 0..=100_000 {
            let linear = i as f32 / 100_000.0;
            let exact = f64::from(srgb_from_linear(linear)) * 255.0;
            let found = f64::from(SrgbCodes::get().nearest(linear));
            assert!((found - exact).abs() <= 0.5 + 1e-4, "{linear}: {found} {exact}");
        }
    }

    #[test]
    fn transparent_colours_do_not_bleed() {
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

#[cfg(test)]
mod texels_tests {
    use super::*;
    use std::sync::Arc;

    struct All(usize);

    impl WithTexels for All {
        type Output = Vec<[f32; 4]>;

        fn run(self, texels: impl Texels) -> Vec<[f32; 4]> {
            (0..self.0).map(|i| texels.texel(i)).collect()
        }
    }

    #[test]
    fn every_format_decodes_as_image_rgba_does() {
        let formats: [fn(usize) -> Pixels; 3] = [
            |n| Pixels::U8((0..n).map(|i| (i * 37 % 256) as u8).collect()),
            |n| Pixels::U16((0..n).map(|i| (i * 9001 % 65536) as u16).collect()),
            |n| Pixels::F32((0..n).map(|i| i as f32 * 0.3 - 2.0).collect()),
        ];
        for channels in 1..=4u32 {
            for encoding in [Encoding::Linear, Encoding::Srgb] {
                for pixels in formats {
                    let pixels = Arc::new(pixels(15 * channels as usize));
                    let image =
                        Image { name: String::new(), width: 5, height: 3, channels, encoding, pixels };
                    let pixel = |i: u32| image.rgba(i % 5, i / 5);
                    let expected: Vec<[f32; 4]> = (0..15).map(pixel).collect();
                    assert_eq!(with_texels(&image, All(15)), expected);
                }
            }
        }
    }
}

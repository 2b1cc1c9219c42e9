//! Texels of an image decoded to linear values; the format is chosen once a lookup, not once a texel.

use crate::color::srgb_table;
use crate::image::{Encoding, Image, Pixels};
use std::sync::OnceLock;

/// Decodes texels of one format.
pub(super) trait Texels: Sync {
    /// The texel at a position in the image, counted row by row, as linear RGBA.
    fn texel(&self, at: usize) -> [f32; 4];
}

/// What can be done with the texels of an image, whatever their format.
pub(super) trait WithTexels {
    /// What comes of it.
    type Output;

    /// Does it.
    fn run(self, texels: impl Texels) -> Self::Output;
}

/// Lets `task` work on the texels of `image`.
#[inline(always)]
pub(super) fn with_texels<T: WithTexels>(image: &Image, task: T) -> T::Output {
    with_common_texels(image, task, |task| task.run(Any(image)))
}

/// Lets `task` work on the texels of `image` if they are in memory and of a common format; else `otherwise` does what is to be done.
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
    /// Linear values of the codes of all channels but alpha.
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

/// Rare formats.
struct Any<'a>(&'a Image);

impl Texels for Any<'_> {
    #[inline]
    fn texel(&self, at: usize) -> [f32; 4] {
        let width = self.0.width as usize;
        self.0.rgba((at % width) as u32, (at / width) as u32)
    }
}

/// The 256 values of linear 8-bit codes.
fn linear_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| i as f32 / 255.0))
}

#[cfg(test)]
mod tests {
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
    fn every_format_decodes_as_the_image_does() {
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

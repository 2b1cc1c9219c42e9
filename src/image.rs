//! Images in memory, at the precision of their files, without codecs. Pixels may still be encoded; [`Image::decoded`]
//! decodes them.

use crate::error::{Error, Warning};
use std::fmt::Debug;
use std::sync::Arc;

/// The transfer function of the stored values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Linear (0..1 for integers).
    Linear,
    /// Red, green and blue are sRGB-encoded; alpha is linear.
    Srgb,
}

/// Pixel values, row by row from the top, channels interleaved.
#[derive(Clone, Debug)]
pub enum Pixels {
    /// 0..255 for 0..1.
    U8(Vec<u8>),
    /// 0..65535 for 0..1.
    U16(Vec<u16>),
    /// Floats.
    F32(Vec<f32>),
    /// Not decoded yet.
    Encoded(Encoded),
}

/// Pixels that are decoded on demand.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// Width, height and channels of the decoded image, which [`Scene::validate`](crate::scene::Scene::validate) compares with
    /// the [`Image`]'s.
    pub size: [u32; 3],
    /// Bits per channel of the decoded image: 8 or 16 for integers, 32 for floats.
    pub bits: u32,
    /// The decoder.
    pub source: Arc<dyn ImageSource>,
}

/// A decoder of an encoded image. Decoding is deterministic, unless a file has changed.
pub trait ImageSource: Debug + Send + Sync {
    /// Decodes the image; callers ignore its name and encoding. Adds warnings that depend on the pixels.
    ///
    /// # Errors
    /// [`Damage`] if the image can't be decoded, or its size has changed since the scene was loaded.
    fn decode(&self, warnings: &mut Vec<Warning>) -> Result<Image, Damage>;

    /// Memory of [`ImageSource::decode_rows`] in bytes; `None` if it decodes the whole image first.
    fn bytes_by_rows(&self) -> Option<usize> {
        None
    }

    /// Decodes an image of floats in batches of rows from the top down, with other threads if `in_parallel`. After an error,
    /// the rows passed before are invalid.
    ///
    /// # Errors
    /// As for [`ImageSource::decode`].
    fn decode_rows(
        &self,
        in_parallel: bool,
        warnings: &mut Vec<Warning>,
        take: &mut dyn FnMut(&[f32]),
    ) -> Result<(), Damage> {
        let _ = in_parallel;
        if let Pixels::F32(numbers) = &*self.decode(warnings)?.pixels {
            take(numbers);
        }
        Ok(())
    }

    /// Passes the encoded bytes, in several parts for large files; none if they can't be read any more.
    fn with_bytes(&self, take: &mut dyn FnMut(&[u8]));
}

/// An image that can't be decoded.
#[derive(Debug)]
pub enum Damage {
    /// Materials ignore its textures.
    LeftOut(Warning),
    /// The scene can't be rendered.
    Fatal(Error),
}

/// The stored integers of a pixel, one per channel.
#[derive(Clone, Copy, Debug)]
pub enum Codes<'a> {
    /// 0..255 for 0..1.
    U8(&'a [u8]),
    /// 0..65535 for 0..1.
    U16(&'a [u16]),
}

impl Codes<'_> {
    /// The pixel as linear RGBA. Grey is replicated to RGB; missing alpha is 1.
    #[inline]
    pub fn rgba(self, encoding: Encoding) -> [f32; 4] {
        let is_srgb = |c: usize, n: usize| {
            let is_alpha = (n == 2 && c == 1) || c == 3;
            encoding == Encoding::Srgb && !is_alpha
        };
        let mut values = [0.0f32; 4];
        let n = match self {
            Codes::U8(codes) => {
                let table = crate::color::srgb_table();
                for (c, (value, &code)) in values.iter_mut().zip(codes).enumerate() {
                    let is_srgb = is_srgb(c, codes.len());
                    *value = if is_srgb { table[code as usize] } else { f32::from(code) / 255.0 };
                }
                codes.len()
            }
            Codes::U16(codes) => {
                for (c, (value, &code)) in values.iter_mut().zip(codes).enumerate() {
                    let v = f32::from(code) / 65535.0;
                    *value = if is_srgb(c, codes.len()) { crate::color::linear_from_srgb(v) } else { v };
                }
                codes.len()
            }
        };
        spread(&values[..n])
    }
}

/// The values of 1 to 4 channels as RGBA.
#[inline]
pub(crate) fn spread(values: &[f32]) -> [f32; 4] {
    match *values {
        [grey] => [grey, grey, grey, 1.0],
        [grey, alpha] => [grey, grey, grey, alpha],
        [r, g, b] => [r, g, b, 1.0],
        [r, g, b, a, ..] => [r, g, b, a],
        [] => [0.0, 0.0, 0.0, 1.0],
    }
}

/// A rectangle of pixels with 1 to 4 interleaved channels (grey, grey + alpha, RGB, RGBA).
#[derive(Clone, Debug)]
pub struct Image {
    /// The name in reports: the file, or the glTF image.
    pub name: String,
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// Channels per pixel, 1 to 4.
    pub channels: u32,
    /// The transfer function.
    pub encoding: Encoding,
    /// `width * height * channels` values.
    pub pixels: Arc<Pixels>,
}

impl Image {
    /// An RGB image of linear floats.
    pub fn from_linear_rgb(name: &str, width: u32, height: u32, rgb: Vec<f32>) -> Image {
        assert_eq!(rgb.len(), width as usize * height as usize * 3);
        Image {
            name: name.to_string(),
            width,
            height,
            channels: 3,
            encoding: Encoding::Linear,
            pixels: Arc::new(Pixels::F32(rgb)),
        }
    }

    /// Are its pixels still encoded?
    pub fn is_encoded(&self) -> bool {
        matches!(*self.pixels, Pixels::Encoded(_))
    }

    /// Are its values floats, once decoded?
    pub fn is_float(&self) -> bool {
        matches!(*self.pixels, Pixels::F32(_) | Pixels::Encoded(Encoded { bits: 32, .. }))
    }

    /// The image with decoded pixels. Nothing is cached.
    ///
    /// # Errors
    /// As for [`ImageSource::decode`].
    pub fn decoded(&self, warnings: &mut Vec<Warning>) -> Result<Image, Damage> {
        let Pixels::Encoded(encoded) = &*self.pixels else { return Ok(self.clone()) };
        let Image { pixels, .. } = encoded.source.decode(warnings)?;
        Ok(Image { pixels, ..self.clone() })
    }

    /// The decoder in batches of rows, if there is one, and its memory in bytes.
    pub fn rows(&self) -> Option<(&dyn ImageSource, usize)> {
        let Pixels::Encoded(encoded) = &*self.pixels else { return None };
        Some((&*encoded.source, encoded.source.bytes_by_rows()?))
    }

    /// Memory for decoding in bytes.
    pub fn decoding_bytes(&self) -> usize {
        self.rows().map_or(self.bytes(), |(_, bytes)| bytes.min(self.bytes()))
    }

    /// A pixel as linear RGBA. Grey is replicated to RGB; missing alpha is 1. Encoded images are black.
    ///
    /// # Panics
    /// If `x` or `y` is out of range.
    #[inline]
    pub fn rgba(&self, x: u32, y: u32) -> [f32; 4] {
        let n = self.channels as usize;
        let at = (y as usize * self.width as usize + x as usize) * n;
        match &*self.pixels {
            Pixels::U8(data) => Codes::U8(&data[at..at + n]).rgba(self.encoding),
            Pixels::U16(data) => Codes::U16(&data[at..at + n]).rgba(self.encoding),
            Pixels::F32(data) => spread(&data[at..at + n]),
            Pixels::Encoded(_) => spread(&[0.0; 4][..n]),
        }
    }

    /// Memory of the decoded pixels in bytes.
    pub fn bytes(&self) -> usize {
        let n = self.width as usize * self.height as usize * self.channels as usize;
        match &*self.pixels {
            Pixels::U8(_) => n,
            Pixels::U16(_) => n * 2,
            Pixels::F32(_) => n * 4,
            Pixels::Encoded(encoded) => n * encoded.bits as usize / 8,
        }
    }
}

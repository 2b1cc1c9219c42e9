//! Images in memory; no codecs. 8-bit files stay 8-bit. Pixels may still be encoded: then only the size is known, and
//! [`Image::decoded`] decodes them.

use crate::error::{Error, Warning};
use std::fmt::Debug;
use std::sync::Arc;

/// How the stored numbers map to linear values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Stored values are linear (0..1 for integers).
    Linear,
    /// Red, green and blue are sRGB-encoded; alpha is linear.
    Srgb,
}

/// The numbers themselves, row by row from the top, channels interleaved.
#[derive(Clone, Debug)]
pub enum Pixels {
    /// 0..255 for 0..1.
    U8(Vec<u8>),
    /// 0..65535 for 0..1.
    U16(Vec<u16>),
    /// As they are.
    F32(Vec<f32>),
    /// Not decoded yet.
    Encoded(Encoded),
}

/// Pixels that are decoded when they are needed.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// Width, height and channels of the decoded image. [`Scene::validate`](crate::scene::Scene::validate) compares the image's own.
    pub size: [u32; 3],
    /// Bits of each number once it is decoded: 8 or 16 of an integer, 32 of a float.
    pub bits: u32,
    /// Where they come from.
    pub source: Arc<dyn ImageSource>,
}

/// Where the pixels of an encoded image come from. Decoding gives the same numbers each time, unless a file has changed.
pub trait ImageSource: Debug + Send + Sync {
    /// The decoded image; its name and its encoding are those of the image that asks.
    ///
    /// Adds warnings that depend on the pixels.
    ///
    /// # Errors
    /// [`Damage`] if the image can't be decoded, or has another size than it had when the scene was loaded.
    fn decode(&self, warnings: &mut Vec<Warning>) -> Result<Image, Damage>;

    /// Bytes of memory that [`ImageSource::decode_rows`] takes; `None` where it decodes the whole image first.
    fn bytes_by_rows(&self) -> Option<usize> {
        None
    }

    /// Hands over the numbers of an image of floats, some rows at a time from the top down. Other threads help if they may. With an
    /// error, the rows passed on before are void.
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

    /// Hands over the encoded bytes, of large files in several parts; nothing if they can't be read any more.
    fn with_bytes(&self, take: &mut dyn FnMut(&[u8]));
}

/// An image that can't be decoded.
#[derive(Debug)]
pub enum Damage {
    /// Its textures are left out of the materials that use them.
    LeftOut(Warning),
    /// Its scene can't be rendered.
    Fatal(Error),
}

/// The stored integers of a pixel, one a channel.
#[derive(Clone, Copy, Debug)]
pub enum Codes<'a> {
    /// 0..255 for 0..1.
    U8(&'a [u8]),
    /// 0..65535 for 0..1.
    U16(&'a [u16]),
}

impl Codes<'_> {
    /// The pixel as linear RGBA. Grey spreads over RGB; missing alpha is 1.
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
    /// A name for reports: the file, or the glTF image.
    pub name: String,
    /// Pixels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Numbers a pixel, 1 to 4.
    pub channels: u32,
    /// How the numbers map to linear values.
    pub encoding: Encoding,
    /// `width * height * channels` numbers.
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

    /// Are its numbers floats, also where they are still encoded?
    pub fn is_float(&self) -> bool {
        matches!(*self.pixels, Pixels::F32(_) | Pixels::Encoded(Encoded { bits: 32, .. }))
    }

    /// The image with its pixels: decoded, if they are encoded. Keeps nothing.
    ///
    /// # Errors
    /// As for [`ImageSource::decode`].
    pub fn decoded(&self, warnings: &mut Vec<Warning>) -> Result<Image, Damage> {
        let Pixels::Encoded(encoded) = &*self.pixels else { return Ok(self.clone()) };
        let Image { pixels, .. } = encoded.source.decode(warnings)?;
        Ok(Image { pixels, ..self.clone() })
    }

    /// Where its numbers come from some rows at a time, if they may, and the bytes of memory that this takes.
    pub fn rows(&self) -> Option<(&dyn ImageSource, usize)> {
        let Pixels::Encoded(encoded) = &*self.pixels else { return None };
        Some((&*encoded.source, encoded.source.bytes_by_rows()?))
    }

    /// Bytes of memory that decoding it takes.
    pub fn decoding_bytes(&self) -> usize {
        self.rows().map_or(self.bytes(), |(_, bytes)| bytes.min(self.bytes()))
    }

    /// One pixel as linear RGBA. Grey spreads over RGB; missing alpha is 1. `x` and `y` must be inside. Those of an image that is
    /// still encoded are black.
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

    /// Bytes that the pixels take once they are decoded.
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

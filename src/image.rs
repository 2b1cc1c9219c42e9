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
    /// Bits of each number once it is decoded: 8 or 16.
    pub bits: u32,
    /// Where they come from.
    pub source: Arc<dyn ImageSource>,
}

/// Where the pixels of an encoded image come from. Decoding gives the same numbers each time, unless a file has changed.
pub trait ImageSource: Debug + Send + Sync {
    /// The decoded image; its name and its encoding are those of the image that asks.
    ///
    /// # Errors
    /// [`Damage`] if the image can't be decoded, or has another size than it had when the scene was loaded.
    fn decode(&self) -> Result<Image, Damage>;

    /// Hands over the encoded bytes; nothing if they can't be read any more.
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

    /// The image with its pixels: decoded, if they are encoded. Keeps nothing.
    ///
    /// # Errors
    /// As for [`ImageSource::decode`].
    pub fn decoded(&self) -> Result<Image, Damage> {
        let Pixels::Encoded(encoded) = &*self.pixels else { return Ok(self.clone()) };
        let Image { pixels, .. } = encoded.source.decode()?;
        Ok(Image { pixels, ..self.clone() })
    }

    /// One pixel as linear RGBA. Grey spreads over RGB; missing alpha is 1. `x` and `y` must be inside. Those of an image that is
    /// still encoded are black.
    #[inline]
    pub fn rgba(&self, x: u32, y: u32) -> [f32; 4] {
        let n = self.channels as usize;
        let at = (y as usize * self.width as usize + x as usize) * n;
        let mut raw = [0.0f32; 4];
        match &*self.pixels {
            Pixels::U8(data) => {
                let table = crate::color::srgb_table();
                for (c, &code) in data[at..at + n].iter().enumerate() {
                    let is_alpha = (n == 2 && c == 1) || c == 3;
                    raw[c] = if self.encoding == Encoding::Srgb && !is_alpha {
                        table[code as usize]
                    } else {
                        f32::from(code) / 255.0
                    };
                }
            }
            Pixels::U16(data) => {
                for (c, &code) in data[at..at + n].iter().enumerate() {
                    let is_alpha = (n == 2 && c == 1) || c == 3;
                    let v = f32::from(code) / 65535.0;
                    raw[c] = if self.encoding == Encoding::Srgb && !is_alpha {
                        crate::color::linear_from_srgb(v)
                    } else {
                        v
                    };
                }
            }
            Pixels::F32(data) => raw[..n].copy_from_slice(&data[at..at + n]),
            Pixels::Encoded(_) => {}
        }
        match n {
            1 => [raw[0], raw[0], raw[0], 1.0],
            2 => [raw[0], raw[0], raw[0], raw[1]],
            3 => [raw[0], raw[1], raw[2], 1.0],
            _ => raw,
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

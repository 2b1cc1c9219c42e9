//! Pixel buffers in memory; no codecs. What was 8-bit in the file stays 8-bit here.

use std::sync::Arc;

/// How the stored numbers map to linear values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

    /// One pixel as linear RGBA. Grey spreads over RGB; missing alpha is 1. `x` and `y` must be inside.
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
        }
        match n {
            1 => [raw[0], raw[0], raw[0], 1.0],
            2 => [raw[0], raw[0], raw[0], raw[1]],
            3 => [raw[0], raw[1], raw[2], 1.0],
            _ => raw,
        }
    }

    /// Bytes that the pixels take.
    pub fn bytes(&self) -> usize {
        let n = self.width as usize * self.height as usize * self.channels as usize;
        match &*self.pixels {
            Pixels::U8(_) => n,
            Pixels::U16(_) => n * 2,
            Pixels::F32(_) => n * 4,
        }
    }
}

//! Moving pictures for looking at: GIF and APNG, which repeat for ever.

use super::png::{PngOptions, rgba8};
use crate::film::Film;
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, RgbaImage};
use std::time::Duration;

/// The kinds of files of moving pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnimationFormat {
    /// At most 256 colours a frame, transparent or opaque.
    Gif,
    /// Animated PNG: 8 bits, lossless.
    Apng,
}

impl AnimationFormat {
    /// The format that a file name asks for by its extension, if it is one of a moving picture.
    pub fn of(path: &std::path::Path) -> Option<AnimationFormat> {
        match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase().as_str() {
            "gif" => Some(AnimationFormat::Gif),
            "apng" => Some(AnimationFormat::Apng),
            _ => None,
        }
    }
}

/// Frames of one size, RGBA with straight alpha, 8 bits, display-referred.
#[derive(Clone, Debug, Default)]
pub struct Animation {
    size: (u32, u32),
    frames: Vec<Vec<u8>>,
}

impl Animation {
    /// Adds a frame of `width * height * 4` bytes.
    pub fn add(&mut self, rgba: Vec<u8>, width: u32, height: u32) {
        self.size = (width, height);
        self.frames.push(rgba);
    }

    /// Adds a picture as PNGs would show it.
    pub fn add_film(&mut self, film: &Film, options: &PngOptions) {
        self.add(rgba8(film, options), film.width(), film.height());
    }

    /// Encodes the frames, so many a second.
    ///
    /// # Errors
    /// What the encoder objects to.
    pub fn encode(&self, format: AnimationFormat, frames_a_second: f64) -> Result<Vec<u8>, String> {
        match format {
            AnimationFormat::Gif => self.gif(frames_a_second).map_err(|e| e.to_string()),
            AnimationFormat::Apng => self.apng(frames_a_second).map_err(|e| e.to_string()),
        }
    }

    fn gif(&self, frames_a_second: f64) -> image::ImageResult<Vec<u8>> {
        let mut bytes = Vec::new();
        // The encoder's best colours take a second a frame; 10 are hardly told apart.
        let mut encoder = GifEncoder::new_with_speed(&mut bytes, 10);
        encoder.set_repeat(Repeat::Infinite)?;
        let delay = Delay::from_saturating_duration(Duration::from_secs_f64(1.0 / frames_a_second));
        for rgba in &self.frames {
            let picture = RgbaImage::from_raw(self.size.0, self.size.1, rgba.clone()).unwrap_or_default();
            encoder.encode_frame(Frame::from_parts(picture, 0, 0, delay))?;
        }
        drop(encoder);
        Ok(bytes)
    }

    fn apng(&self, frames_a_second: f64) -> Result<Vec<u8>, ::png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut bytes, self.size.0, self.size.1);
        encoder.set_color(::png::ColorType::Rgba);
        encoder.set_depth(::png::BitDepth::Eight);
        encoder.set_animated(self.frames.len() as u32, 0)?;
        let milliseconds = (1000.0 / frames_a_second).round().clamp(1.0, 65535.0);
        encoder.set_frame_delay(milliseconds as u16, 1000)?;
        let mut writer = encoder.write_header()?;
        for rgba in &self.frames {
            writer.write_image_data(rgba)?;
        }
        writer.finish()?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::AnimationDecoder;
    use std::io::Cursor;

    #[test]
    fn frames_come_back() {
        let mut animation = Animation::default();
        for k in 0..3u8 {
            animation.add([[k * 100, 10, 200, 255]; 12].concat(), 4, 3);
        }
        let gif = animation.encode(AnimationFormat::Gif, 20.0).expect("a GIF");
        let decoder = image::codecs::gif::GifDecoder::new(Cursor::new(gif)).expect("a GIF");
        let frames = decoder.into_frames().collect_frames().expect("frames");
        assert_eq!(frames.len(), 3);
        assert_eq!(frames[0].delay().numer_denom_ms(), (50, 1));
        assert!(frames[2].buffer().get_pixel(1, 1)[0].abs_diff(200) < 4);
        let apng = animation.encode(AnimationFormat::Apng, 20.0).expect("an APNG");
        let decoder = image::codecs::png::PngDecoder::new(Cursor::new(apng)).expect("a PNG");
        let frames = decoder.apng().expect("animated").into_frames().collect_frames().expect("frames");
        assert_eq!(frames.iter().map(|f| f.buffer().get_pixel(1, 1)[0]).collect::<Vec<_>>(), [0, 100, 200]);
    }
}

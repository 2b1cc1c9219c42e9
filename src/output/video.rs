//! Video by the program `ffmpeg`, to which frames are piped as they are rendered; and animated GIF and PNG. Files are created atomically.

use super::atomic::{create, persist};
use super::png::{Linear, PngOptions, display_rgba8, straight8};
use crate::error::{Error, Result};
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, RgbaImage};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;
use tempfile::NamedTempFile;

/// The encoder's executable.
const PROGRAM: &str = "ffmpeg";

/// Maximum number of lines of the encoder's output in an error.
const MAX_LINES: usize = 6;

/// Filters: even sizes, and the HDTV colour matrix instead of the default one.
const FILTER: &str = "crop=trunc(iw/2)*2:trunc(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv";

/// Colour metadata of the file.
const COLORS: [&str; 8] =
    ["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1", "-color_range", "tv"];

/// Video formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VideoFormat {
    /// H.264 in MP4, opaque: composited over black.
    Mp4,
    /// VP9 in WebM, with alpha if the first frame is not opaque.
    WebM,
}

impl VideoFormat {
    /// The video format by the extension of a file name, if it is one.
    pub fn of(path: &Path) -> Option<VideoFormat> {
        match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase().as_str() {
            "mp4" => Some(VideoFormat::Mp4),
            "webm" => Some(VideoFormat::WebM),
            _ => None,
        }
    }

    /// Encoder options.
    fn encoder(self, has_alpha: bool) -> Vec<&'static str> {
        let pixels = if has_alpha { "yuva420p" } else { "yuv420p" };
        match self {
            VideoFormat::Mp4 => {
                vec![
                    "-c:v",
                    "libx264",
                    "-crf",
                    "16",
                    "-pix_fmt",
                    pixels,
                    "-movflags",
                    "+faststart",
                    "-f",
                    "mp4",
                ]
            }
            VideoFormat::WebM => {
                let mut options = vec!["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1"];
                if has_alpha {
                    // Alternate reference frames don't support alpha.
                    options.extend(["-auto-alt-ref", "0"]);
                }
                options.extend(["-pix_fmt", pixels, "-f", "webm"]);
                options
            }
        }
    }
}

/// A video being written. If dropped before [`Video::finish`], no file is created.
#[derive(Debug)]
pub struct Video {
    path: PathBuf,
    format: VideoFormat,
    frames_per_second: f64,
    /// The encoder process; `None` before the first frame.
    running: Option<Running>,
}

/// An encoder process.
#[derive(Debug)]
struct Running {
    child: Child,
    frames: Option<ChildStdin>,
    /// Reader of its standard error.
    messages: Option<JoinHandle<String>>,
    temporary: Option<NamedTempFile>,
    size: (u32, u32),
    has_alpha: bool,
}

impl Video {
    /// A video at a frame rate in frames per second; `None` if the file extension isn't that of a video.
    ///
    /// # Errors
    /// A usage error if the encoder can't be run, an output error if the file can't be written.
    pub fn new(path: &Path, frames_per_second: f64) -> Result<Option<Video>> {
        let Some(format) = VideoFormat::of(path) else { return Ok(None) };
        super::check_target(path)?;
        let version = encoder().arg("-version").stdin(Stdio::null()).output();
        version.map_err(|e| missing(path, &e))?;
        Ok(Some(Video { path: path.to_path_buf(), format, frames_per_second, running: None }))
    }

    /// Checks the size of pictures, pixels. (Chroma has half the resolution in both directions.)
    ///
    /// # Errors
    /// A usage error if width or height is a single pixel.
    pub fn check_size(&self, width: u32, height: u32) -> Result<()> {
        if width.min(height) >= 2 {
            return Ok(());
        }
        let message = format!("{}: {width} x {height} is too small for video", self.path.display());
        Err(Error::usage(message).with_help("make it 2 pixels or more a side"))
    }

    /// Adds a display-referred picture; all must have the same size.
    ///
    /// # Errors
    /// A usage error for an invalid size, or an output error with the encoder's message.
    pub fn add(&mut self, picture: &Linear, options: &PngOptions) -> Result<()> {
        let size = (picture.width, picture.height);
        if self.running.is_none() {
            self.check_size(size.0, size.1)?;
            let has_alpha = self.format == VideoFormat::WebM
                && straight8(picture, options).chunks_exact(4).any(|pixel| pixel[3] != 255);
            self.running = Some(self.start(size, has_alpha)?);
        }
        let Some(running) = &mut self.running else { return Ok(()) };
        if running.size != size {
            let message = format!(
                "frames have different sizes, {} x {} and {} x {}",
                running.size.0, running.size.1, size.0, size.1
            );
            return Err(Error::output(&self.path, message + " pixels"));
        }
        let rgba = frame(picture, options, running.has_alpha);
        match running.frames.as_mut().map(|pipe| pipe.write_all(&rgba)) {
            Some(Ok(())) => Ok(()),
            // The encoder has exited early.
            _ => Err(running.failure(&self.path)),
        }
    }

    /// Waits for the encoder and renames the file to its target; does nothing without frames.
    ///
    /// # Errors
    /// An output error with the encoder's message; no file is then created, and an existing one is unchanged.
    pub fn finish(mut self) -> Result<()> {
        let Some(running) = &mut self.running else { return Ok(()) };
        running.frames = None;
        let is_done = running.child.wait().is_ok_and(|status| status.success());
        match running.temporary.take().filter(|_| is_done) {
            Some(temporary) => persist(temporary, &self.path),
            None => Err(running.failure(&self.path)),
        }
    }

    fn start(&self, size: (u32, u32), has_alpha: bool) -> Result<Running> {
        let temporary = create(&self.path)?;
        let mut command = encoder();
        command.args(["-hide_banner", "-loglevel", "error", "-y"]);
        command.args(["-f", "rawvideo", "-pixel_format", "rgba"]);
        command.args(["-video_size", &format!("{}x{}", size.0, size.1)]);
        command.args(["-framerate", &self.frames_per_second.to_string(), "-i", "pipe:0"]);
        command.args(["-an", "-vf", FILTER]).args(self.format.encoder(has_alpha)).args(COLORS);
        command.arg(temporary.path());
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|e| missing(&self.path, &e))?;
        let frames = child.stdin.take();
        let messages = child.stderr.take().map(|mut pipe| {
            std::thread::spawn(move || {
                let mut bytes = Vec::new();
                // After a read error the part read so far is reported.
                let _ = pipe.read_to_end(&mut bytes);
                String::from_utf8_lossy(&bytes).into_owned()
            })
        });
        Ok(Running { child, frames, messages, temporary: Some(temporary), size, has_alpha })
    }
}

impl Running {
    /// The error of a failed encoder, with its last messages.
    fn failure(&mut self, path: &Path) -> Error {
        self.frames = None;
        let status = self.child.wait();
        let ended = status.map_or_else(|e| e.to_string(), |status| status.to_string());
        let messages = self.messages.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        let lines: Vec<&str> = messages.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
        let last = lines[lines.len().saturating_sub(MAX_LINES)..].join("\n    ");
        let reason = if last.is_empty() { " and printed nothing".into() } else { format!(":\n    {last}") };
        Error::output(path, format!("was not created: {PROGRAM} ended with {ended}{reason}"))
            .with_help("nothing was written; numbered pictures, .gif and .apng need no encoder")
    }
}

impl Drop for Running {
    /// Kills an unfinished encoder.
    fn drop(&mut self) {
        self.frames = None;
        if self.temporary.is_some() {
            // It may have exited already.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// The encoder's command, in a process group of its own, so that Ctrl-C only reaches this program.
fn encoder() -> Command {
    #[allow(unused_mut)]
    let mut command = Command::new(PROGRAM);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

fn missing(path: &Path, error: &io::Error) -> Error {
    Error::usage(format!(
        "{}: video needs the program {PROGRAM}, which can't be run: {error}",
        path.display()
    ))
    .with_help("install it (its folder must be in PATH), or write .gif, .apng or numbered pictures")
}

/// A frame for the encoder, RGBA: with straight alpha if `has_alpha`, else opaque, composited over black.
fn frame(picture: &Linear, options: &PngOptions, has_alpha: bool) -> Vec<u8> {
    if has_alpha {
        return straight8(picture, options);
    }
    let mut rgba = display_rgba8(picture, options);
    rgba.chunks_exact_mut(4).for_each(|pixel| pixel[3] = 255);
    rgba
}

// Animated GIF and PNG, which repeat endlessly.

/// Formats of animated pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnimationFormat {
    /// At most 256 colours per frame, transparent or opaque.
    Gif,
    /// Animated PNG: 8 bits, lossless.
    Apng,
}

impl AnimationFormat {
    /// The animation format by the extension of a file name, if it is one.
    pub fn of(path: &Path) -> Option<AnimationFormat> {
        match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase().as_str() {
            "gif" => Some(AnimationFormat::Gif),
            "apng" => Some(AnimationFormat::Apng),
            _ => None,
        }
    }
}

/// Frames of equal size, RGBA with straight alpha, 8 bits, display-referred.
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

    /// Adds a display-referred picture.
    pub fn add_picture(&mut self, picture: &Linear, options: &PngOptions) {
        self.add(straight8(picture, options), picture.width, picture.height);
    }

    /// Encodes the frames at a frame rate in frames per second.
    ///
    /// # Errors
    /// The message of the encoder.
    pub fn encode(
        &self,
        format: AnimationFormat,
        frames_per_second: f64,
    ) -> std::result::Result<Vec<u8>, String> {
        match format {
            AnimationFormat::Gif => self.gif(frames_per_second).map_err(|e| e.to_string()),
            AnimationFormat::Apng => self.apng(frames_per_second).map_err(|e| e.to_string()),
        }
    }

    fn gif(&self, frames_per_second: f64) -> image::ImageResult<Vec<u8>> {
        let mut bytes = Vec::new();
        // The best palette (speed 1) takes a second per frame; the difference to speed 10 is hardly visible.
        let mut encoder = GifEncoder::new_with_speed(&mut bytes, 10);
        encoder.set_repeat(Repeat::Infinite)?;
        let delay = Delay::from_saturating_duration(Duration::from_secs_f64(1.0 / frames_per_second));
        for rgba in &self.frames {
            let picture = RgbaImage::from_raw(self.size.0, self.size.1, rgba.clone()).unwrap_or_default();
            encoder.encode_frame(Frame::from_parts(picture, 0, 0, delay))?;
        }
        drop(encoder);
        Ok(bytes)
    }

    fn apng(&self, frames_per_second: f64) -> std::result::Result<Vec<u8>, ::png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut bytes, self.size.0, self.size.1);
        encoder.set_color(::png::ColorType::Rgba);
        encoder.set_depth(::png::BitDepth::Eight);
        encoder.set_animated(self.frames.len() as u32, 0)?;
        let milliseconds = (1000.0 / frames_per_second).round().clamp(1.0, 65535.0);
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
    use crate::film::{AovSet, Film};
    use crate::output::{Format, encode_display_png, rgba8};

    /// A picture with alpha 0.5.
    fn half_transparent() -> Film {
        let mut film = Film::new(16, 16, AovSet::NONE);
        let mut tile = film.tile(0, 0, 16, 16);
        (0..256).for_each(|pixel| assert!(tile.add(pixel, [0.4, 0.2, 0.1], 0.5)));
        film.merge(tile);
        film
    }

    #[test]
    fn opaque_frames_are_composited_over_black() {
        let (film, options) = (half_transparent(), PngOptions::default());
        let picture = Linear { width: 16, height: 16, rgba: &film.rgba() };
        let jpeg = encode_display_png(&picture, Format::Jpeg, &options).expect("encoded");
        let jpeg = image::load_from_memory(&jpeg).expect("a picture").into_rgb8();
        let frame = frame(&picture, &options, false);
        for (pixel, expected) in frame.chunks_exact(4).zip(jpeg.pixels()) {
            assert!(pixel.iter().zip(expected.0).all(|(a, b)| a.abs_diff(b) <= 3), "{pixel:?} {expected:?}");
            assert_eq!(pixel[3], 255);
        }
    }

    #[test]
    fn transparent_frames_have_straight_alpha() {
        let (film, options) = (half_transparent(), PngOptions::default());
        let picture = Linear { width: 16, height: 16, rgba: &film.rgba() };
        let transparent = frame(&picture, &options, true);
        assert_eq!(transparent, rgba8(&film, &options));
        assert_eq!(transparent[3], 128);
        assert!(transparent[0] > frame(&picture, &options, false)[0]);
    }

    #[test]
    fn a_side_of_one_pixel_is_refused() {
        let video =
            Video { path: "a.mp4".into(), format: VideoFormat::Mp4, frames_per_second: 24.0, running: None };
        assert!(video.check_size(1, 9).is_err() && video.check_size(9, 1).is_err());
        assert!(video.check_size(2, 2).is_ok());
    }
}

#[cfg(test)]
mod animation_tests {
    use super::*;
    use image::AnimationDecoder;
    use std::io::Cursor;

    #[test]
    fn animations_are_decoded_to_their_frames() {
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

//! Video, by the program `ffmpeg`: frames go to it as they are made, and no file stands where they are not all in.

use super::atomic::{create, place};
use super::png::{PngOptions, rgba8};
use crate::error::{Error, Result};
use crate::film::Film;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;
use tempfile::NamedTempFile;

/// What is run.
const PROGRAM: &str = "ffmpeg";

/// Lines of what a failed encoder printed that an error shows.
const SHOWN: usize = 6;

/// What displays expect: even sizes, and the colour matrix of HDTV instead of the one that old players fall back to.
const FILTER: &str = "crop=trunc(iw/2)*2:trunc(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv";

/// What the file says about its colours.
const COLORS: [&str; 8] =
    ["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1", "-color_range", "tv"];

/// The kinds of files of video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VideoFormat {
    /// H.264 in MP4, opaque: what is transparent stands before black.
    Mp4,
    /// VP9 in WebM, transparent where the first frame is anywhere.
    WebM,
}

impl VideoFormat {
    /// The format that a file name asks for by its extension, if it is one of video.
    pub fn of(path: &Path) -> Option<VideoFormat> {
        match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase().as_str() {
            "mp4" => Some(VideoFormat::Mp4),
            "webm" => Some(VideoFormat::WebM),
            _ => None,
        }
    }

    /// How frames become such a file.
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
                let mut words = vec!["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1"];
                if has_alpha {
                    // Its frames ahead of time have no alpha.
                    words.extend(["-auto-alt-ref", "0"]);
                }
                words.extend(["-pix_fmt", pixels, "-f", "webm"]);
                words
            }
        }
    }
}

/// A video that is being made. Dropped before it is finished, it leaves nothing behind.
#[derive(Debug)]
pub struct Video {
    path: PathBuf,
    format: VideoFormat,
    frames_a_second: f64,
    /// From the first frame on.
    running: Option<Running>,
}

/// The encoder at work.
#[derive(Debug)]
struct Running {
    child: Child,
    frames: Option<ChildStdin>,
    /// What it prints.
    said: Option<JoinHandle<String>>,
    temporary: Option<NamedTempFile>,
    size: (u32, u32),
    has_alpha: bool,
}

impl Video {
    /// One of so many frames a second; `None` where the file's name asks for another kind of file.
    ///
    /// # Errors
    /// A usage error if the encoder can't be run, an output error if the file can't be written.
    pub fn new(path: &Path, frames_a_second: f64) -> Result<Option<Video>> {
        let Some(format) = VideoFormat::of(path) else { return Ok(None) };
        super::check_target(path)?;
        let version = encoder().arg("-version").stdin(Stdio::null()).output();
        version.map_err(|e| missing(path, &e))?;
        Ok(Some(Video { path: path.to_path_buf(), format, frames_a_second, running: None }))
    }

    /// Adds a picture as PNGs would show it; all must have one size.
    ///
    /// # Errors
    /// An output error with what the encoder says.
    pub fn add_film(&mut self, film: &Film, options: &PngOptions) -> Result<()> {
        let size = (film.width(), film.height());
        let mut rgba = rgba8(film, options);
        if self.running.is_none() {
            let is_transparent = rgba.chunks_exact(4).any(|pixel| pixel[3] != 255);
            self.running = Some(self.start(size, is_transparent && self.format == VideoFormat::WebM)?);
        }
        let Some(running) = &mut self.running else { return Ok(()) };
        if running.size != size {
            let message =
                format!("frames of {} x {} and {} x {}", running.size.0, running.size.1, size.0, size.1);
            return Err(Error::output(&self.path, message + " pixels are no video"));
        }
        if !running.has_alpha {
            rgba.chunks_exact_mut(4).for_each(put_before_black);
        }
        match running.frames.as_mut().map(|pipe| pipe.write_all(&rgba)) {
            Some(Ok(())) => Ok(()),
            // It ended before its frames did, and says why.
            _ => Err(running.failure(&self.path)),
        }
    }

    /// Waits for the encoder and puts the file in its place; nothing without frames.
    ///
    /// # Errors
    /// An output error with what the encoder says; no file is left then, and an older one unharmed.
    pub fn finish(mut self) -> Result<()> {
        let Some(running) = &mut self.running else { return Ok(()) };
        running.frames = None;
        let is_done = running.child.wait().is_ok_and(|status| status.success());
        match running.temporary.take().filter(|_| is_done) {
            Some(temporary) => place(temporary, &self.path),
            None => Err(running.failure(&self.path)),
        }
    }

    fn start(&self, size: (u32, u32), has_alpha: bool) -> Result<Running> {
        let temporary = create(&self.path)?;
        let mut command = encoder();
        command.args(["-hide_banner", "-loglevel", "error", "-y"]);
        command.args(["-f", "rawvideo", "-pixel_format", "rgba"]);
        command.args(["-video_size", &format!("{}x{}", size.0, size.1)]);
        command.args(["-framerate", &self.frames_a_second.to_string(), "-i", "pipe:0"]);
        command.args(["-an", "-vf", FILTER]).args(self.format.encoder(has_alpha)).args(COLORS);
        command.arg(temporary.path());
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|e| missing(&self.path, &e))?;
        let frames = child.stdin.take();
        let said = child.stderr.take().map(|mut pipe| {
            std::thread::spawn(move || {
                let mut bytes = Vec::new();
                // What was read until then is told.
                let _ = pipe.read_to_end(&mut bytes);
                String::from_utf8_lossy(&bytes).into_owned()
            })
        });
        Ok(Running { child, frames, said, temporary: Some(temporary), size, has_alpha })
    }
}

impl Running {
    /// Why it failed, by its own words.
    fn failure(&mut self, path: &Path) -> Error {
        self.frames = None;
        let status = self.child.wait();
        let ended = status.map_or_else(|e| e.to_string(), |status| status.to_string());
        let said = self.said.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        let lines: Vec<&str> = said.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
        let last = lines[lines.len().saturating_sub(SHOWN)..].join("\n    ");
        let said = if last.is_empty() { " and printed nothing".into() } else { format!(":\n    {last}") };
        Error::output(path, format!("was not made: {PROGRAM} ended with {ended}{said}"))
            .with_help("nothing was written; numbered pictures, .gif and .apng take no encoder")
    }
}

impl Drop for Running {
    /// An encoder without all of its frames has nothing to finish.
    fn drop(&mut self) {
        self.frames = None;
        if self.temporary.is_some() {
            // It may have ended already.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// The encoder; signals to stop are for this program, which decides what becomes of it.
fn encoder() -> Command {
    #[allow(unused_mut)]
    let mut command = Command::new(PROGRAM);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

fn missing(path: &Path, error: &io::Error) -> Error {
    Error::usage(format!(
        "{}: video takes the program {PROGRAM}, which can't be run: {error}",
        path.display()
    ))
    .with_help("install it (its folder must be in PATH), or write .gif, .apng or numbered pictures")
}

/// Light that a black ground shows through.
fn put_before_black(pixel: &mut [u8]) {
    let alpha = u32::from(pixel[3]);
    for code in &mut pixel[..3] {
        *code = ((u32::from(*code) * alpha + 127) / 255) as u8;
    }
    pixel[3] = 255;
}

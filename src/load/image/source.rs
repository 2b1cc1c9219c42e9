//! Encoded images: bytes, location, use, and checks before decoding.

use crate::error::{Choice, Error, Message, Problem, Result, Warning};
use crate::load::decoders::Decoder;
use crate::load::{decoders, files};
use image::{ImageFormat, Limits};
use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// The use of an image, which determines its colour encoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Use {
    /// Colour: integers are sRGB-encoded, floats linear.
    Color,
    /// Data such as roughness or normals: always linear.
    Data,
    /// Environment: integers are sRGB-encoded, floats radiance; no texel may be negative.
    Environment,
    /// A picture for display; encoded like colour.
    Picture,
}

impl Use {
    /// Whether it is a photograph rather than a texture, so that its orientation and colour profile are applied.
    pub fn is_photograph(self) -> bool {
        matches!(self, Use::Environment | Use::Picture)
    }

    /// Whether the alpha of an EXR is used.
    pub fn has_alpha(self) -> bool {
        matches!(self, Use::Color | Use::Picture)
    }
}

/// An image file in memory.
pub(crate) struct ImageFile<'a> {
    pub bytes: Cow<'a, [u8]>,
    /// The file of the image, if it contains nothing else: it is read again for decoding. Otherwise the bytes are kept.
    pub own_file: Option<&'a Path>,
    /// Location for messages: file, and JSON pointer inside it.
    pub place: (&'a Path, &'a str),
    /// The declared media type.
    pub mime: Option<&'a str>,
    /// Maximum size of the decoded pixels, bytes.
    pub memory_limit: Option<u64>,
}

impl ImageFile<'_> {
    pub(super) fn source(&self) -> Source<'_> {
        let (file, pointer) = self.place;
        Source::new(&self.bytes, (file, pointer), self.memory_limit)
    }
}

/// Pixel format of an image, from its header.
pub(super) struct Layout {
    pub size: [u32; 2],
    pub channels: u32,
    /// Bits per channel: 8 or 16 for integers, 32 for floats.
    pub bits: u32,
    /// Number of rows of a block, for decoding by rows; `None` if only the whole image can be decoded.
    pub rows: Option<u32>,
}

/// The bytes of an image, and its location for messages.
pub(super) struct Source<'a> {
    /// All bytes, or the first bytes of an open file.
    pub bytes: &'a [u8],
    open: Option<&'a File>,
    /// Total length, bytes.
    pub length: u64,
    pub file: &'a Path,
    pub pointer: &'a str,
    /// Maximum size of the decoded pixels, bytes; `None` for no limit.
    pub memory_limit: Option<u64>,
}

impl<'a> Source<'a> {
    /// An image in memory.
    pub fn new(
        bytes: &'a [u8],
        (file, pointer): (&'a Path, &'a str),
        memory_limit: Option<u64>,
    ) -> Source<'a> {
        Source { bytes, open: None, length: bytes.len() as u64, file, pointer, memory_limit }
    }

    /// An image in an open file whose first bytes were read.
    pub fn in_file(
        (open, length): (&'a File, u64),
        beginning: &'a [u8],
        (file, pointer): (&'a Path, &'a str),
        memory_limit: Option<u64>,
    ) -> Source<'a> {
        Source { bytes: beginning, open: Some(open), length, file, pointer, memory_limit }
    }

    /// A reader of the bytes from an offset on.
    pub fn reader(&'a self, position: u64) -> Box<dyn BufRead + 'a> {
        let start = usize::try_from(position).unwrap_or(usize::MAX).min(self.bytes.len());
        match self.open {
            None => Box::new(&self.bytes[start..]),
            Some(file) => Box::new(BufReader::new(FileReader { file, position })),
        }
    }

    pub fn error(&self, message: impl Into<Message>) -> Error {
        Error::input_problems(self.file, vec![Problem::new(self.pointer, message)])
    }

    /// The error for an image whose decoder is not part of this build.
    pub fn missing_decoder_error(&self, decoder: Decoder) -> Error {
        let message = format!("can't be read: {}", decoder.missing_message());
        self.error(message).with_help(format!("{}, or convert the image to PNG", decoder.remedy()))
    }

    pub fn warning(&self, message: impl Into<Message>) -> Warning {
        Warning::new(self.file, self.pointer, message)
    }

    /// The image's name for reports.
    pub fn name(&self) -> String {
        let file = self.file.display();
        if self.pointer.is_empty() { file.to_string() } else { format!("{file}#{}", self.pointer) }
    }
}

/// Reads a file from an offset on, independent of other readers of the same handle.
struct FileReader<'a> {
    file: &'a File,
    position: u64,
}

impl Read for FileReader<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.file.seek(SeekFrom::Start(self.position))?;
        let count = self.file.read(into)?;
        self.position += count as u64;
        Ok(count)
    }
}

// Reading bytes and identifying formats.

/// Runs a decoder; a panic becomes an error.
pub(super) fn catching_panics<T>(source: &Source, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    let broken = |message| source.error(format!("can't be read as an image: {message}"));
    decoders::catch_panic(decode).map_err(broken)?
}

/// A file's bytes, up to a maximum.
pub(super) fn read_bytes(path: &Path, memory_limit: Option<u64>) -> Result<Vec<u8>> {
    files::read(path, memory_limit.unwrap_or(u64::MAX).min(files::MAX_DATA))
        .map_err(|message| Error::input(path, message))
}

/// The image format recognised by the first bytes.
pub(super) fn signature(bytes: &[u8]) -> Option<ImageFormat> {
    if bytes.starts_with(b"#?") { Some(ImageFormat::Hdr) } else { image::guess_format(bytes).ok() }
}

// Limits of image sizes by the size of the file.

/// Number of pixels that any file may declare: some codecs store constant images of any size in a few bytes.
const ALWAYS_ALLOWED: u64 = 1 << 24;
/// Maximum number of pixels per byte of the file: deflate compresses at most 1032:1, and a byte holds 8 bilevel pixels.
const PIXELS_PER_BYTE: u64 = 1032 * 8;
/// Maximum number of pixels of any image: 32,768 x 16,384.
const MAX_PIXELS: u64 = 1 << 29;

/// Maximum number of pixels for a file of a length, bytes.
pub(super) fn max_pixels(file_length: u64) -> u64 {
    file_length.saturating_mul(PIXELS_PER_BYTE).clamp(ALWAYS_ALLOWED, MAX_PIXELS)
}

/// Fails for images without pixels, and for sizes that are implausible for the file's length.
pub(super) fn check(source: &Source, width: u64, height: u64) -> Result<()> {
    let max_pixels = max_pixels(source.length);
    match width.checked_mul(height) {
        Some(0) => Err(source.error("has no pixels")),
        Some(n) if n <= max_pixels && width.max(height) <= u64::from(u32::MAX) => Ok(()),
        _ => {
            let bytes = source.length;
            let claim =
                format!("declares {width} x {height} pixels in {bytes} bytes; at most {max_pixels} pixels");
            Err(source.error(("image-size-claim", format!("{claim} are accepted for a file of that length"))))
        }
    }
}

/// Fails if the decoded pixels would exceed the memory limit.
pub(super) fn check_memory(source: &Source, width: u64, height: u64, bytes: u64) -> Result<()> {
    let Some(limit) = source.memory_limit.filter(|limit| bytes > *limit) else { return Ok(()) };
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let message = format!(
        "has {width} x {height} pixels, which take {} MiB of memory; at most {} MiB are allowed",
        mib(bytes),
        limit >> 20
    );
    Err(source.error(message).with_help(format!("make it smaller, or raise {}", Choice::MemoryLimit)))
}

/// Limit of a decoder's allocations: 16 bytes per pixel.
pub(super) fn decoder_limits(source: &Source) -> Limits {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(max_pixels(source.length) * 16);
    limits
}

/// A big-endian number of `length` bytes.
pub(super) fn big_endian(bytes: &[u8], at: usize, length: usize) -> Option<usize> {
    let digits = bytes.get(at..at.checked_add(length)?)?;
    usize::try_from(digits.iter().fold(0u64, |n, &b| n << 8 | u64::from(b))).ok()
}

/// Repair of invalid values: sets NaN, infinite and, in environments, negative values to 0, and counts them.
pub(super) struct Repair {
    is_environment: bool,
    not_finite: usize,
    negative: usize,
    total: usize,
}

impl Repair {
    pub fn new(purpose: Use) -> Repair {
        Repair { is_environment: purpose == Use::Environment, not_finite: 0, negative: 0, total: 0 }
    }

    pub fn apply(&mut self, numbers: &mut [f32]) {
        self.total += numbers.len();
        for v in numbers {
            if !v.is_finite() {
                self.not_finite += 1;
                *v = 0.0;
            } else if *v < 0.0 && self.is_environment {
                self.negative += 1;
                *v = 0.0;
            }
        }
    }

    pub fn warn(self, source: &Source, warnings: &mut Vec<Warning>) {
        let total = self.total;
        for (count, what) in [(self.not_finite, "NaN or infinite"), (self.negative, "negative")] {
            if count > 0 {
                warnings.push(source.warning(format!("{count} of {total} numbers are {what} and became 0")));
            }
        }
    }
}

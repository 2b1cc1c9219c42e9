//! Deferred decoding: only the headers of large textures are read while a scene is loaded.

use super::source::{ImageFile, Layout, Repair, Source, Use};
use super::{
    decode, decode_source, format_of, jpeg_is_complete, metadata_warnings, openexr, radiance, source,
};
use crate::error::{Error, Result, Warning};
use crate::image::{Damage, Encoded, Encoding, Image, ImageSource, Pixels};
use crate::load::files;
use image::{ColorType, ImageDecoder, ImageFormat, ImageReader};
use std::borrow::Cow;
use std::fmt::{self, Debug};
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

/// Minimum decoded size of deferred images, bytes.
const MIN_BYTES: u64 = 1 << 20;

/// Bytes read from the start of a file; enough for the headers of most JPEG files.
const HEAD_BYTES: usize = 1 << 16;

/// Size of one chunk: bytes to read, or values to decode.
const CHUNK: usize = 1 << 23;

/// Classifies the error of a damaged image as fatal or as a warning.
pub(crate) type OnDamage = Arc<dyn Fn(Error) -> Damage + Send + Sync>;

/// The image of a texture: decoded if it is small or its format has no simple header, else encoded.
///
/// # Errors
/// As for [`super::decode`]; damage after the header of a large image is reported by `on_damage` when it is decoded.
pub(crate) fn for_texture(
    of: &ImageFile,
    purpose: Use,
    warnings: &mut Vec<Warning>,
    on_damage: OnDamage,
) -> Result<Image> {
    let (file, pointer) = of.place;
    let source = of.source();
    let mut new_warnings = Vec::new();
    // Errors are ignored here: decoding finds and reports them.
    let layout = source::catching_panics(&source, || layout(&source, of.mime, purpose, &mut new_warnings))
        .ok()
        .flatten();
    let Some(layout) = layout else {
        return decode(of, purpose, warnings);
    };
    warnings.append(&mut new_warnings);
    let origin = match of.own_file.map(|path| (path, stamp_of(path))) {
        Some((path, Some(stamp))) => Origin::File(path.to_path_buf(), stamp),
        _ => Origin::Memory(of.bytes.as_ref().into()),
    };
    let (file, pointer) = (file.to_path_buf(), pointer.to_string());
    let mime = of.mime.map(str::to_string);
    let deferred = Deferred { origin, file, pointer, mime, purpose, layout, on_damage };
    Ok(deferred.into_image(source.name()))
}

/// Reads the image file of a texture; see [`for_texture`].
///
/// # Errors
/// As for [`super::read`].
pub(crate) fn read_for_texture(
    path: &Path,
    purpose: Use,
    memory_limit: Option<u64>,
    warnings: &mut Vec<Warning>,
    on_damage: OnDamage,
) -> Result<Image> {
    if let Some(open) = OpenedFile::new(path) {
        let source = open.source((path, ""), memory_limit);
        // Errors are ignored here: reading the whole file finds and reports them.
        let layout = || source::catching_panics(&source, || layout(&source, None, purpose, &mut Vec::new()));
        let is_float =
            matches!(source::signature(source.bytes), Some(ImageFormat::OpenExr | ImageFormat::Hdr));
        if let Some(Ok(Some(layout))) = is_float.then(layout)
            && layout.rows.is_some()
        {
            let origin = Origin::Parts(path.to_path_buf(), open.stamp);
            let (file, pointer) = (path.to_path_buf(), String::new());
            let deferred = Deferred { origin, file, pointer, mime: None, purpose, layout, on_damage };
            return Ok(deferred.into_image(source.name()));
        }
    }
    let bytes = source::read_bytes(path, memory_limit)?;
    let metadata_messages = metadata_warnings(&bytes, path, "", purpose);
    let file =
        ImageFile { bytes: bytes.into(), own_file: Some(path), place: (path, ""), mime: None, memory_limit };
    let image = for_texture(&file, purpose, warnings, on_damage)?;
    warnings.extend(metadata_messages);
    Ok(image)
}

/// The layout of a large image; `None` for images to be decoded immediately.
fn layout(
    source: &Source,
    mime: Option<&str>,
    purpose: Use,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Layout>> {
    let found = if super::ktx2::is_ktx2(source.bytes) {
        super::ktx2::layout(source, warnings)?
    } else {
        match format_of(source, mime, warnings)? {
            ImageFormat::OpenExr => Some(openexr::layout(source, purpose.has_alpha())?),
            ImageFormat::Hdr => Some(radiance::layout(source)?),
            format => common_layout(source, format, warnings)?,
        }
    };
    let Some(found) = found else { return Ok(None) };
    let ([width, height], channel) = (found.size.map(u64::from), u64::from(found.bits / 8));
    let bytes = width * height * u64::from(found.channels) * channel;
    if bytes < MIN_BYTES {
        return Ok(None);
    }
    source::check_memory(source, width, height, bytes)?;
    Ok(Some(found))
}

/// The layout of an image that the crate `image` decodes; `None` for floats and palettes.
fn common_layout(
    source: &Source,
    format: ImageFormat,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Layout>> {
    // The JPEG decoder copies its input, so it gets the beginning first.
    let beginning = &source.bytes[..source.bytes.len().min(HEAD_BYTES)];
    let found = match format {
        ImageFormat::Jpeg => size_and_type(source, beginning, format).ok(),
        _ => None,
    };
    let ((width, height), color_type) =
        found.map_or_else(|| size_and_type(source, source.bytes, format), Ok)?;
    source::check(source, width.into(), height.into())?;
    let (channels, bits) = match color_type {
        ColorType::L8 => (1, 8),
        ColorType::La8 => (2, 8),
        ColorType::Rgb8 => (3, 8),
        ColorType::Rgba8 => (4, 8),
        ColorType::L16 => (1, 16),
        ColorType::La16 => (2, 16),
        ColorType::Rgb16 => (3, 16),
        ColorType::Rgba16 => (4, 16),
        _ => return Ok(None),
    };
    if format == ImageFormat::Jpeg && !jpeg_is_complete(source.bytes) {
        warnings.push(source.warning(super::TRUNCATED_JPEG));
    }
    Ok(Some(Layout { size: [width, height], channels, bits, rows: None }))
}

/// Size and pixel format from the decoder of the crate `image`.
fn size_and_type(source: &Source, bytes: &[u8], format: ImageFormat) -> Result<((u32, u32), ColorType)> {
    let broken = |e: image::ImageError| source.error(format!("can't be read as an image: {e}"));
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(source::decoder_limits(source));
    let decoder = reader.into_decoder().map_err(broken)?;
    Ok((decoder.dimensions(), decoder.color_type()))
}

/// An open file whose first bytes were read.
struct OpenedFile {
    file: File,
    stamp: FileStamp,
    beginning: Vec<u8>,
}

impl OpenedFile {
    fn new(path: &Path) -> Option<OpenedFile> {
        let file = files::open(path).ok()?;
        let metadata = file.metadata().ok().filter(|data| data.len() <= files::MAX_DATA)?;
        let mut beginning = Vec::new();
        (&file).take(HEAD_BYTES as u64).read_to_end(&mut beginning).ok()?;
        Some(OpenedFile { stamp: (metadata.len(), metadata.modified().ok()), file, beginning })
    }

    fn source<'a>(&'a self, place: (&'a Path, &'a str), memory_limit: Option<u64>) -> Source<'a> {
        Source::in_file((&self.file, self.stamp.0), &self.beginning, place, memory_limit)
    }
}

/// Decodes the float image of a texture and calls `take` with chunks of rows, from the top. Uses all threads if `in_parallel`.
fn decode_rows(
    source: &Source,
    purpose: Use,
    in_parallel: bool,
    warnings: &mut Vec<Warning>,
    take: &mut dyn FnMut(&[f32]),
) -> Result<()> {
    let mut repair = Repair::new(purpose);
    let mut repaired = |mut rows: Vec<f32>| {
        repair.apply(&mut rows);
        take(&rows);
    };
    source::catching_panics(source, || match source::signature(source.bytes) {
        Some(ImageFormat::Hdr) => radiance::rows(source, warnings, &mut repaired),
        _ => {
            let kind = (purpose != Use::Data, purpose.has_alpha());
            openexr::displayed_rows(source, kind, in_parallel, warnings, &mut repaired)
        }
    })?;
    repair.warn(source, warnings);
    Ok(())
}

/// Length (bytes) and modification time of a file, to detect changes.
type FileStamp = (u64, Option<SystemTime>);

fn stamp_of(path: &Path) -> Option<FileStamp> {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.len(), metadata.modified().ok()))
}

/// Source of the encoded bytes.
enum Origin {
    /// A file to be read as a whole.
    File(PathBuf, FileStamp),
    /// A file to be read in parts.
    Parts(PathBuf, FileStamp),
    Memory(Arc<[u8]>),
}

/// An image to be decoded later.
struct Deferred {
    origin: Origin,
    file: PathBuf,
    pointer: String,
    mime: Option<String>,
    purpose: Use,
    layout: Layout,
    on_damage: OnDamage,
}

impl Deferred {
    fn into_image(self, name: String) -> Image {
        let Layout { size: [width, height], channels, bits, .. } = self.layout;
        let is_linear = self.purpose == Use::Data || bits == 32;
        let encoding = if is_linear { Encoding::Linear } else { Encoding::Srgb };
        let size = [width, height, channels];
        let pixels = Arc::new(Pixels::Encoded(Encoded { size, bits, source: Arc::new(self) }));
        Image { name, width, height, channels, encoding, pixels }
    }

    /// The bytes of the file; an error if it has changed since its header was read.
    fn bytes(&self) -> Result<Cow<'_, [u8]>> {
        match &self.origin {
            Origin::Memory(bytes) => Ok(Cow::Borrowed(bytes)),
            Origin::File(path, stamp) | Origin::Parts(path, stamp) => {
                let bytes = source::read_bytes(path, None)?;
                match stamp_of(path) == Some(*stamp) {
                    true => Ok(Cow::Owned(bytes)),
                    false => Err(self.changed()),
                }
            }
        }
    }

    fn changed(&self) -> Error {
        Source::new(&[], self.place(), None).error(("file-changed", "has changed since the scene was loaded"))
    }

    fn place(&self) -> (&Path, &str) {
        (&self.file, &self.pointer)
    }

    /// Calls `work` with the source; an error if the file has changed since its header was read.
    fn with_source<T>(&self, work: impl FnOnce(&Source) -> Result<T>) -> Result<T> {
        match &self.origin {
            Origin::Parts(path, stamp) => match OpenedFile::new(path).filter(|open| open.stamp == *stamp) {
                Some(open) => work(&open.source(self.place(), None)),
                None => Err(self.changed()),
            },
            _ => work(&Source::new(&self.bytes()?, self.place(), None)),
        }
    }

    fn try_decode(&self, warnings: &mut Vec<Warning>) -> Result<Image> {
        let mut found = Vec::new();
        let image =
            self.with_source(|source| decode_source(source, self.mime.as_deref(), self.purpose, &mut found))?;
        let bits = match *image.pixels {
            Pixels::U8(_) => 8,
            Pixels::U16(_) => 16,
            Pixels::F32(_) => 32,
            Pixels::Encoded(_) => 0,
        };
        // Warnings about integer images were given when the header was read.
        if bits == 32 {
            warnings.append(&mut found);
        }
        let Layout { size, channels, bits: expected, .. } = self.layout;
        let is_same = ([image.width, image.height], image.channels, bits) == (size, channels, expected);
        if is_same { Ok(image) } else { Err(self.changed()) }
    }

    fn try_rows(
        &self,
        in_parallel: bool,
        warnings: &mut Vec<Warning>,
        take: &mut dyn FnMut(&[f32]),
    ) -> Result<()> {
        self.with_source(|source| {
            let Layout { size, channels, .. } = self.layout;
            let found = layout(source, None, self.purpose, &mut Vec::new())?;
            if found.is_none_or(|found| (found.size, found.channels) != (size, channels)) {
                return Err(self.changed());
            }
            decode_rows(source, self.purpose, in_parallel, warnings, take)
        })
    }
}

impl ImageSource for Deferred {
    fn decode(&self, warnings: &mut Vec<Warning>) -> std::result::Result<Image, Damage> {
        self.try_decode(warnings).map_err(|error| (self.on_damage)(error))
    }

    fn bytes_by_rows(&self) -> Option<usize> {
        let Layout { size: [width, _], channels, bits, rows } = self.layout;
        // Estimated copies of a block: compressed, decompressed, as values, and processed values.
        let row = width as usize * channels as usize * 4;
        let together = (rows.filter(|_| bits == 32)? as usize * row).max(CHUNK);
        Some(together * 4)
    }

    fn decode_rows(
        &self,
        in_parallel: bool,
        warnings: &mut Vec<Warning>,
        take: &mut dyn FnMut(&[f32]),
    ) -> std::result::Result<(), Damage> {
        if self.layout.rows.is_some() {
            return self.try_rows(in_parallel, warnings, take).map_err(|error| (self.on_damage)(error));
        }
        if let Pixels::F32(numbers) = &*self.decode(warnings)?.pixels {
            take(numbers);
        }
        Ok(())
    }

    fn with_bytes(&self, take: &mut dyn FnMut(&[u8])) {
        if !matches!(self.origin, Origin::Parts(..)) {
            if let Ok(bytes) = self.bytes() {
                take(&bytes);
            }
            return;
        }
        let _ = self.with_source(|source| {
            let mut file = source.reader(0);
            let mut part = Vec::new();
            while file.by_ref().take(CHUNK as u64).read_to_end(&mut part).is_ok_and(|count| count > 0) {
                take(&part);
                part.clear();
            }
            Ok(())
        });
    }
}

impl Debug for Deferred {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Deferred { file, pointer, layout, .. } = self;
        let Layout { size: [width, height], channels, bits, .. } = layout;
        write!(f, "{}{pointer}, {width} x {height}, {channels} channels of {bits} bits", file.display())
    }
}

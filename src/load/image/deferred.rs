//! Large images that become textures stay encoded while a scene is loaded: only their headers are read.

use super::source::{ImageFile, Layout, Source, Use};
use super::{decode, format_of, jpeg_is_complete, metadata_warnings, openexr, radiance, source};
use crate::error::{Error, Result, Warning};
use crate::image::{Damage, Encoded, Encoding, Image, ImageSource, Pixels};
use image::{ColorType, ImageDecoder, ImageFormat, ImageReader};
use std::borrow::Cow;
use std::fmt::{self, Debug};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

/// Images that take fewer bytes are decoded at once.
const LARGE: u64 = 1 << 20;

/// Bytes that hold the headers of most JPEG files.
const BEGINNING: usize = 1 << 16;

/// Decides what happens to a scene with a damaged image.
pub(crate) type OnDamage = Arc<dyn Fn(Error) -> Damage + Send + Sync>;

/// The image of a texture: decoded if it is small or of a format that has no plain header, else encoded.
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
    let mut own = Vec::new();
    // The decoder finds errors again and reports them.
    let layout = source::guarded(&source, || layout(&source, of.mime, purpose, &mut own)).ok().flatten();
    let Some(Layout { size: [width, height], channels, bits }) = layout else {
        return decode(of, purpose, warnings);
    };
    let is_float = bits == 32;
    warnings.append(&mut own);
    let origin = match of.own_file.map(|path| (path, Stamp::of(path))) {
        Some((path, Some(stamp))) => Origin::File(path.to_path_buf(), stamp),
        _ => Origin::Memory(of.bytes.as_ref().into()),
    };
    let encoding = if purpose == Use::Data || is_float { Encoding::Linear } else { Encoding::Srgb };
    let name = source.name();
    let (file, pointer) = (file.to_path_buf(), pointer.to_string());
    let mime = of.mime.map(str::to_string);
    let size = [width, height];
    let deferred = Deferred { origin, file, pointer, mime, purpose, size, channels, bits, on_damage };
    let size = [width, height, channels];
    let pixels = Arc::new(Pixels::Encoded(Encoded { size, bits, source: Arc::new(deferred) }));
    Ok(Image { name, width, height, channels, encoding, pixels })
}

/// Reads the file of an image that becomes a texture; see [`for_texture`].
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
    let bytes = source::read_bytes(path, memory_limit)?;
    let of_metadata = metadata_warnings(&bytes, path, "", purpose);
    let file =
        ImageFile { bytes: bytes.into(), own_file: Some(path), place: (path, ""), mime: None, memory_limit };
    let image = for_texture(&file, purpose, warnings, on_damage)?;
    warnings.extend(of_metadata);
    Ok(image)
}

/// The layout of a large image; `None` if it is better decoded at once.
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
    if bytes < LARGE {
        return Ok(None);
    }
    source::check_memory(source, width, height, bytes)?;
    Ok(Some(found))
}

/// The layout of what the crate `image` decodes; `None` for floats and palettes, too.
fn common_layout(
    source: &Source,
    format: ImageFormat,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Layout>> {
    // The decoder of JPEG copies what it is given.
    let beginning = &source.bytes[..source.bytes.len().min(BEGINNING)];
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
        warnings.push(source.warning(super::CUT_SHORT));
    }
    Ok(Some(Layout { size: [width, height], channels, bits }))
}

/// The header as a decoder reports it.
fn size_and_type(source: &Source, bytes: &[u8], format: ImageFormat) -> Result<((u32, u32), ColorType)> {
    let broken = |e: image::ImageError| source.error(format!("can't be read as an image: {e}"));
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(source::for_decoder(source));
    let decoder = reader.into_decoder().map_err(broken)?;
    Ok((decoder.dimensions(), decoder.color_type()))
}

/// Length of a file, and when it was written last.
type StampOfFile = (u64, Option<SystemTime>);

struct Stamp;

impl Stamp {
    fn of(path: &Path) -> Option<StampOfFile> {
        let metadata = std::fs::metadata(path).ok()?;
        Some((metadata.len(), metadata.modified().ok()))
    }
}

/// The location of the bytes.
enum Origin {
    File(PathBuf, StampOfFile),
    Memory(Arc<[u8]>),
}

/// An image that is decoded later.
struct Deferred {
    origin: Origin,
    file: PathBuf,
    pointer: String,
    mime: Option<String>,
    purpose: Use,
    size: [u32; 2],
    channels: u32,
    bits: u32,
    on_damage: OnDamage,
}

impl Deferred {
    /// Its bytes, if they are those of which the header was read.
    fn bytes(&self) -> Result<Cow<'_, [u8]>> {
        match &self.origin {
            Origin::Memory(bytes) => Ok(Cow::Borrowed(bytes)),
            Origin::File(path, stamp) => {
                let bytes = source::read_bytes(path, None)?;
                match Stamp::of(path) == Some(*stamp) {
                    true => Ok(Cow::Owned(bytes)),
                    false => Err(self.changed()),
                }
            }
        }
    }

    fn changed(&self) -> Error {
        let source = Source { bytes: &[], file: &self.file, pointer: &self.pointer, memory_limit: None };
        source.error(("file-changed", "has changed since the scene was loaded"))
    }

    fn try_decode(&self, warnings: &mut Vec<Warning>) -> Result<Image> {
        let bytes = self.bytes()?;
        let place = (self.file.as_path(), self.pointer.as_str());
        let file = ImageFile { bytes, own_file: None, place, mime: self.mime.as_deref(), memory_limit: None };
        let mut found = Vec::new();
        let image = decode(&file, self.purpose, &mut found)?;
        let bits = match *image.pixels {
            Pixels::U8(_) => 8,
            Pixels::U16(_) => 16,
            Pixels::F32(_) => 32,
            Pixels::Encoded(_) => 0,
        };
        // Those about integers were given when the header was read.
        if bits == 32 {
            warnings.append(&mut found);
        }
        let is_same =
            ([image.width, image.height], image.channels, bits) == (self.size, self.channels, self.bits);
        if is_same { Ok(image) } else { Err(self.changed()) }
    }
}

impl ImageSource for Deferred {
    fn decode(&self, warnings: &mut Vec<Warning>) -> std::result::Result<Image, Damage> {
        self.try_decode(warnings).map_err(|error| (self.on_damage)(error))
    }

    fn with_bytes(&self, take: &mut dyn FnMut(&[u8])) {
        if let Ok(bytes) = self.bytes() {
            take(&bytes);
        }
    }
}

impl Debug for Deferred {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        let Deferred { file, pointer, channels, bits, .. } = self;
        write!(f, "{}{pointer}, {width} x {height}, {channels} channels of {bits} bits", file.display())
    }
}

//! OpenEXR encoding: by default one part, scan lines, ZIP, with colour as R, G, B, A (premultiplied) and the film's further channels
//! under their names and pixel types. For other layouts see [`ExrOptions`].

use super::atomic::EncodedPicture;
use super::exr_options::{ExrOptions, FACTORS, WorkingSpace, is_color, layer_of};
use crate::color::{Primaries, converted};
use crate::error::{Choice, Warning};
use crate::film::{AovSpace, Film, PixelType, Plane, Values, matte_id, matte_key};
use crate::load::image::Layered;
use crate::math::{DAffine3, DMat4, DVec3};
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::image::Layers;
use exr::image::write::layers::WritableLayers;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, FlatSamples, Image, ImageAttributes, Layer,
    LayerAttributes, LineOrder, Text, Vec2, WritableImage, f16,
};
use flate2::{Compress, Compression as Level, FlushCompress, Status};
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Cursor;
use std::time::SystemTime;

/// Metadata of the header. `None` is omitted.
#[derive(Clone, Debug, Default)]
pub struct Metadata {
    /// Mean number of samples per pixel.
    pub samples: f64,
    /// Random seed.
    pub seed: u32,
    /// Owner of the picture.
    pub owner: Option<String>,
    /// Rendering time, seconds; not reproducible.
    pub render_s: Option<f64>,
    /// Date of creation (written in UTC); not reproducible.
    pub captured: Option<SystemTime>,
    /// World-to-camera matrix for column vectors; camera space is right-handed, y up, looking along -z.
    pub world_to_camera: Option<DMat4>,
    /// Matrix from world space to normalized device coordinates of the frame: see [`ndc_from_world`](crate::camera::ndc_from_world).
    pub world_to_ndc: Option<DMat4>,
    /// Pixel aspect ratio, width over height; 1 if `None`.
    pub pixel_aspect: Option<f64>,
    /// Coordinate space of AOVs of positions and directions.
    pub aov_space: AovSpace,
    /// Denoiser and guides, if the picture was denoised.
    pub denoised: Option<String>,
    /// Cryptomattes of the picture.
    pub mattes: Vec<Matte>,
    /// Offset of the scene's origin in world space, metres; matrices are relative to the world's origin.
    pub world_offset: Option<DVec3>,
    /// Reason for stopping early.
    pub stopped_by: Option<String>,
    /// Warnings about ignored, approximated or repaired parts of the scene.
    pub warnings: Vec<String>,
}

/// Encodes a film. Values beyond the range of half floats are clamped, with a warning, which is also in the header.
///
/// # Errors
/// The message of the encoder.
pub fn encode_exr(
    film: &Film,
    float: bool,
    options: &ExrOptions,
    metadata: &Metadata,
) -> Result<EncodedPicture, String> {
    let mut clamped = 0u64;
    let parts = parts(film, float, options, &mut clamped);
    let mut warnings = if clamped == 0 { vec![] } else { vec![overflow(clamped)] };
    let names: Vec<&str> = film.names().collect();
    warnings.extend(options.unknown(&names).map(|name| {
        Warning::general(format!(
            "a pixel type is set for '{name}', but the picture has no such channel or layer"
        ))
    }));
    let mut metadata = metadata.clone();
    metadata.warnings.extend(warnings.iter().map(Warning::to_string));
    let size = Vec2(film.width() as usize, film.height() as usize);
    let is_multipart = parts.len() > 1;
    let layer = |(index, (name, channels)): (usize, (String, Vec<AnyChannel<FlatSamples>>))| {
        let mut attributes = attributes(&metadata, &name, index == 0, options);
        if names.iter().any(|n| AovSpace::concerns(n) && options.part_of(n) == name) {
            let space = AttributeValue::Text(text(metadata.aov_space.name()));
            attributes.other.insert(text("aovSpace"), space);
        }
        if is_multipart {
            attributes.layer_name = Some(text(&name));
        }
        let (x, y) = options.window.map_or((0, 0), |window| window.origin);
        attributes.layer_position = Vec2(x, y);
        Layer::new(size, attributes, options.encoding(), AnyChannels::sort(channels.into_iter().collect()))
    };
    let layers: Vec<_> = parts.into_iter().enumerate().map(layer).collect();
    let (width, height) = options.window.map_or((film.width(), film.height()), |window| window.frame);
    let mut shared = ImageAttributes::with_size(Vec2(width as usize, height as usize));
    shared.pixel_aspect = metadata.pixel_aspect.unwrap_or(1.0) as f32;
    shared.chromaticities = Some(options.space.chromaticities());
    let image = Image::from_layers(shared, layers);
    let bytes = encode_image(&image)?;
    Ok(EncodedPicture { bytes, warnings })
}

/// Encodes a file read before, with all parts, channels and attributes.
///
/// # Errors
/// The message of the encoder.
pub fn encode_layered(layered: &Layered) -> Result<Vec<u8>, String> {
    encode_image(layered.file())
}

/// Encodes an image with all layers.
fn encode_image(image: &AnyImage) -> Result<Vec<u8>, String> {
    let mut bytes = match is_zip(image) {
        true => encode_zip(image).map_err(|e| e.to_string())?,
        false => {
            let mut bytes = Cursor::new(Vec::new());
            let write = image.write();
            // The crate uses a thread pool of its own with all cores.
            let write = if rayon::current_num_threads() == 1 { write.non_parallel() } else { write };
            write.to_buffered(&mut bytes).map_err(|e| e.to_string())?;
            bytes.into_inner()
        }
    };
    sort_attributes(&mut bytes).ok_or("the encoder wrote a header that can't be read")?;
    Ok(bytes)
}

/// The planes of the film grouped by part, in the order of the film; adds the number of clamped values to `clamped`. `float` makes 32-bit
/// floats the default of half-float channels.
fn parts(
    film: &Film,
    float: bool,
    options: &ExrOptions,
    clamped: &mut u64,
) -> Vec<(String, Vec<AnyChannel<FlatSamples>>)> {
    let samples = |plane: Plane<'_>| {
        let default =
            if float && plane.pixel_type == PixelType::Half { PixelType::Float } else { plane.pixel_type };
        match plane.values {
            Values::Uint(values) => (FlatSamples::U32(values), 0),
            Values::Float(values) if options.type_of(plane.name, default) == PixelType::Half => {
                to_half(values)
            }
            Values::Float(values) => (FlatSamples::F32(values), 0),
        }
    };
    let planes: Vec<_> =
        planes(film, options).into_par_iter().map(|plane| (plane.name, samples(plane))).collect();
    let is_b44 = matches!(options.encoding().compression, Compression::B44 | Compression::B44A);
    let mut parts: Vec<(String, Vec<_>)> = Vec::new();
    for (name, (samples, count)) in planes {
        *clamped += count;
        let mut channel = AnyChannel::new(text(&options.name_of(name)), samples);
        if is_b44 {
            // The logarithmic encoding of B44 loses precision: an alpha of 1 would be decoded as 0.9976.
            channel.quantize_linearly = false;
        }
        let part = options.part_of(name);
        match parts.iter_mut().find(|(name, _)| *name == part) {
            Some((_, channels)) => channels.push(channel),
            None => parts.push((part, vec![channel])),
        }
    }
    parts
}

/// Converts to half floats; returns the number of clamped values.
fn to_half(mut values: Vec<f32>) -> (FlatSamples, u64) {
    let limit = f16::MAX.to_f32();
    let mut clamped = 0u64;
    for v in &mut values {
        clamped += u64::from(v.abs() > limit);
        *v = v.clamp(-limit, limit);
    }
    let mut halves = vec![f16::ZERO; values.len()];
    halves.convert_from_f32_slice(&values);
    (FlatSamples::F16(halves), clamped)
}

fn overflow(clamped: u64) -> Warning {
    Warning::general(format!(
        "{clamped} values above 65504 don't fit into half floats and were clamped; {} keeps them",
        Choice::Float
    ))
}

/// Name of the attribute with the denoiser.
pub const DENOISED: &str = "denoised";

/// Attributes of a part; Cryptomatte attributes only if the part is the first or has their channels.
fn attributes(metadata: &Metadata, part: &str, is_first: bool, options: &ExrOptions) -> LayerAttributes {
    let mut attributes = LayerAttributes {
        software_name: Some(text(concat!("oscura ", env!("CARGO_PKG_VERSION")))),
        owner: metadata.owner.as_deref().map(text),
        capture_date: metadata.captured.and_then(exr_date).map(|date| text(&date)),
        utc_offset: metadata.captured.and_then(exr_date).map(|_| 0.0),
        // EXR stores rows of matrices for row vectors, which are the columns for column vectors.
        world_to_camera: metadata.world_to_camera.map(|m| camera(m, metadata.world_offset)),
        world_to_normalized_device: metadata.world_to_ndc.map(|m| camera(m, metadata.world_offset)),
        ..LayerAttributes::default()
    };
    let mut add = |name: &str, value| attributes.other.insert(text(name), value);
    let space = if is_first || is_color(part) { options.space.interop_id() } else { "data" };
    add("colorInteropID", AttributeValue::Text(text(space)));
    let samples = metadata.samples;
    let is_whole = samples.fract() == 0.0 && samples <= f64::from(i32::MAX);
    add(
        "samples",
        if is_whole { AttributeValue::I32(samples as i32) } else { AttributeValue::F32(samples as f32) },
    );
    if let Some(offset) = metadata.world_offset {
        let [x, y, z] = offset.to_array();
        add("worldOffset", AttributeValue::Text(text(&format!("{x} {y} {z}"))));
    }
    if let Some(denoiser) = &metadata.denoised {
        add(DENOISED, AttributeValue::Text(text(denoiser)));
    }
    if let Some(reason) = &metadata.stopped_by {
        add("stoppedBy", AttributeValue::Text(text(reason)));
    }
    add("seed", AttributeValue::Text(text(&metadata.seed.to_string())));
    if let Some(seconds) = metadata.render_s {
        add("renderTime", AttributeValue::F32(seconds as f32));
    }
    let mattes = metadata.mattes.iter().filter(|matte| is_first || matte.kind() == part);
    for (name, value) in mattes.flat_map(|matte| matte.attributes(options.prefix())) {
        add(&name, AttributeValue::Text(text(&value)));
    }
    if !metadata.warnings.is_empty() {
        add("warnings", AttributeValue::Text(text(&metadata.warnings.join("\n"))));
    }
    attributes
}

/// The matrix in single precision, for points relative to the offset.
fn camera(world_to_camera: DMat4, offset: Option<DVec3>) -> [f32; 16] {
    let local = match offset {
        Some(offset) => world_to_camera * DMat4::from(DAffine3::from_translation(offset)),
        None => world_to_camera,
    };
    local.to_cols_array().map(|v| v as f32)
}

/// Converts to EXR text, which only has the first 256 code points; others become question marks.
fn text(s: &str) -> Text {
    let latin: String = s.chars().map(|c| if (c as u32) < 256 && c != '\0' { c } else { '?' }).collect();
    Text::new_or_none(latin).unwrap_or_default()
}

/// Formats a date for the attribute capDate, `YYYY:MM:DD hh:mm:ss` in UTC. `None` outside of the years 1970 to 9999.
fn exr_date(time: SystemTime) -> Option<String> {
    // The crate panics for earlier times and fails for later ones.
    time.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    let mut date = String::new();
    // 2024-02-29T23:59:59Z
    write!(date, "{}", humantime::format_rfc3339_seconds(time)).ok()?;
    Some(date.replace('-', ":").replace('T', " ").replace('Z', ""))
}

// Sorts the attributes of an encoded EXR file alphabetically, as OpenEXR does. The crate keeps some of them in a hash map, so without
// sorting the bytes would not be reproducible.

/// Offset of the first attribute, after magic number and version, bytes.
const ATTRIBUTES_START: usize = 8;

/// The version bit of multi-part files.
const IS_MULTIPART: u8 = 1 << 4;

/// Sorts the attributes of each header in place, which preserves all file offsets. `None` if the headers can't be parsed.
pub(super) fn sort_attributes(file: &mut [u8]) -> Option<()> {
    let is_multipart = *file.get(5)? & IS_MULTIPART != 0;
    let mut at = ATTRIBUTES_START;
    loop {
        // A zero byte ends the header.
        at = sort_header(file, at)? + 1;
        if !is_multipart || *file.get(at)? == 0 {
            return Some(());
        }
    }
}

/// Sorts the attributes of the header at offset `start`; returns its end.
fn sort_header(file: &mut [u8], start: usize) -> Option<usize> {
    let mut attributes: Vec<(Vec<u8>, Vec<u8>)> = Vec::new();
    let mut at = start;
    while *file.get(at)? != 0 {
        let name_end = at + file[at..].iter().position(|&b| b == 0)?;
        let kind_end = name_end + 1 + file.get(name_end + 1..)?.iter().position(|&b| b == 0)?;
        let size: [u8; 4] = file.get(kind_end + 1..kind_end + 5)?.try_into().ok()?;
        let end = kind_end + 5 + usize::try_from(i32::from_le_bytes(size)).ok()?;
        attributes.push((file[at..name_end].to_vec(), file.get(at..end)?.to_vec()));
        at = end;
    }
    attributes.sort();
    let sorted: Vec<u8> = attributes.into_iter().flat_map(|(_, bytes)| bytes).collect();
    file[start..at].copy_from_slice(&sorted);
    Some(at)
}

/// The planes of a film, with colours in the selected space.
fn planes<'a>(film: &'a Film, options: &ExrOptions) -> Vec<Plane<'a>> {
    let mut planes = film.all_planes();
    let space = options.space;
    if space == WorkingSpace::Rec709 {
        return planes;
    }
    let matrix = Primaries::REC709.to(&space.primaries()).expect("both have valid primaries");
    for at in 0..planes.len().saturating_sub(2) {
        let layer = layer_of(planes[at].name).trim_end_matches(|c: char| c.is_ascii_digit());
        let is_red = planes[at].name.rsplit('.').next() == Some("R");
        if is_red && is_color(layer) && layer != FACTORS {
            convert(&mut planes[at..at + 3], &matrix);
        }
    }
    planes
}

/// Applies a matrix to planes of red, green and blue.
fn convert(planes: &mut [Plane], matrix: &[[f64; 3]; 3]) {
    let [red, green, blue] = planes else { return };
    let (Values::Float(red), Values::Float(green), Values::Float(blue)) =
        (&mut red.values, &mut green.values, &mut blue.values)
    else {
        return;
    };
    for ((r, g), b) in red.iter_mut().zip(green).zip(blue) {
        [*r, *g, *b] = converted(matrix, [*r, *g, *b]);
    }
}

// ZIP-compressed scan lines, the most common kind of EXR: compressed by all threads of the current pool, several times as fast as by the
// crate, which encodes all other kinds. Format: "OpenEXR File Layout" (openexr.com) for chunks, ImfZip.cpp for the compressed data.

/// A file in memory.
type AnyImage = Image<Layers<AnyChannels<FlatSamples>>>;
type AnyLayer = Layer<AnyChannels<FlatSamples>>;

/// Zlib compression level: passes of the Cornell box are 0.5 % larger than at level 4, in less than half the time; below 2 they are
/// 13 % larger.
const ZLIB_LEVEL: Level = Level::new(2);

thread_local! {
    /// Reused, since creating a compressor takes as long as compressing some lines.
    static ENCODER: RefCell<Compress> = RefCell::new(Compress::new(ZLIB_LEVEL, true));
}

/// Does [`encode_zip`] support the image?
fn is_zip(image: &AnyImage) -> bool {
    let is_supported = |layer: &AnyLayer| {
        let encoding = &layer.encoding;
        matches!(encoding.compression, Compression::ZIP1 | Compression::ZIP16)
            && encoding.blocks == Blocks::ScanLines
            && encoding.line_order != LineOrder::Decreasing
            && layer.channel_data.list.iter().all(|channel| channel.sampling == Vec2(1, 1))
    };
    cfg!(target_endian = "little") && image.layer_data.iter().all(is_supported)
}

/// Encodes an image for which [`is_zip`] is true.
///
/// # Errors
/// The message of the crate.
fn encode_zip(image: &AnyImage) -> exr::error::Result<Vec<u8>> {
    let headers = image.layer_data.infer_headers(&image.attributes);
    let blocks: Vec<(usize, usize)> = (image.layer_data.iter().enumerate())
        .flat_map(|(index, layer)| {
            (0..layer.size.height().div_ceil(lines_per_chunk(layer))).map(move |block| (index, block))
        })
        .collect();
    let compressed: Vec<Vec<u8>> = (blocks.par_iter())
        .map(|&(index, block)| compress(&image.layer_data[index], block))
        .collect::<std::io::Result<_>>()?;
    let mut bytes = Cursor::new(Vec::new());
    exr::block::write(&mut bytes, headers, true, |_, writer| {
        blocks.iter().zip(compressed).try_for_each(|(&(layer_index, block), compressed_pixels_le)| {
            let layer = &image.layer_data[layer_index];
            let y_coordinate = layer.attributes.layer_position.y() + (block * lines_per_chunk(layer)) as i32;
            let compressed_block =
                CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate, compressed_pixels_le });
            writer.write_chunk(block, Chunk { layer_index, compressed_block })
        })
    })?;
    Ok(bytes.into_inner())
}

/// Number of scan lines per chunk.
fn lines_per_chunk(layer: &AnyLayer) -> usize {
    if layer.encoding.compression == Compression::ZIP1 { 1 } else { 16 }
}

/// The data of a chunk: compressed if that is smaller.
fn compress(layer: &AnyLayer, block: usize) -> std::io::Result<Vec<u8>> {
    let (width, first) = (layer.size.width(), block * lines_per_chunk(layer));
    let mut plain = Vec::new();
    for y in first..(first + lines_per_chunk(layer)).min(layer.size.height()) {
        let row = y * width..(y + 1) * width;
        for channel in &layer.channel_data.list {
            match &channel.sample_data {
                FlatSamples::F16(values) => {
                    plain.extend_from_slice(bytemuck::cast_slice(&values[row.clone()]))
                }
                FlatSamples::F32(values) => {
                    plain.extend_from_slice(bytemuck::cast_slice(&values[row.clone()]))
                }
                FlatSamples::U32(values) => {
                    plain.extend_from_slice(bytemuck::cast_slice(&values[row.clone()]))
                }
            }
        }
    }
    let bytes = differences(&deinterleave(&plain));
    // Zlib enlarges incompressible data by 0.1 % and a few bytes; such chunks are stored uncompressed.
    let mut compressed = Vec::with_capacity(bytes.len() + bytes.len() / 1000 + 64);
    let status = ENCODER.with_borrow_mut(|encoder| {
        if encoder.total_in() > 0 {
            encoder.reset();
        }
        encoder.compress_vec(&bytes, &mut compressed, FlushCompress::Finish)
    })?;
    let is_smaller = status == Status::StreamEnd && compressed.len() < plain.len();
    Ok(if is_smaller { compressed } else { plain })
}

/// The bytes at even offsets, then those at odd offsets. (Their number is even.)
fn deinterleave(plain: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; plain.len()];
    let (even, odd) = bytes.split_at_mut(plain.len() / 2);
    for ((even, odd), pair) in even.iter_mut().zip(odd).zip(plain.chunks_exact(2)) {
        (*even, *odd) = (pair[0], pair[1]);
    }
    bytes
}

/// The difference of each byte from the previous one, plus 128.
fn differences(bytes: &[u8]) -> Vec<u8> {
    let mut differences = Vec::with_capacity(bytes.len());
    differences.extend(bytes.first());
    let pairs = bytes.iter().zip(bytes.iter().skip(1));
    differences.extend(pairs.map(|(before, byte)| byte.wrapping_sub(*before).wrapping_add(128)));
    differences
}

// Header of a Cryptomatte (Psyop's specification 1.2.0).

/// A Cryptomatte: name prefix of its layers, and the manifest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matte {
    kind: &'static str,
    /// Ids by name.
    manifest: BTreeMap<String, u32>,
}

impl Matte {
    /// A Cryptomatte with a name prefix (`CryptoObject`) for objects or materials of these names.
    pub fn new(kind: &'static str, names: Vec<String>) -> Matte {
        let manifest = names
            .into_iter()
            .map(|name| {
                let id = matte_id(&name);
                (name, id)
            })
            .collect();
        Matte { kind, manifest }
    }

    /// The names in the manifest.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.manifest.keys().map(String::as_str)
    }

    /// Name prefix of the layers.
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    /// Header attributes as names and texts. Layer names in the file start with `prefix`.
    pub fn attributes(&self, prefix: &str) -> [(String, String); 4] {
        let name = format!("{prefix}{}", self.kind);
        let key = matte_key(&name);
        let named = |field: &str, text: String| (format!("cryptomatte/{key}/{field}"), text);
        [
            named("name", name.clone()),
            named("hash", "MurmurHash3_32".to_string()),
            named("conversion", "uint32_to_float32".to_string()),
            named("manifest", self.manifest()),
        ]
    }

    /// The manifest: a JSON object from names to ids as eight hexadecimal digits.
    fn manifest(&self) -> String {
        let entry = |(name, id): (&String, &u32)| format!("\"{}\":\"{id:08x}\"", escaped(name));
        let entries: Vec<String> = self.manifest.iter().map(entry).collect();
        format!("{{{}}}", entries.join(","))
    }
}

/// Escapes a text for a JSON string, with ASCII characters only.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for unit in text.encode_utf16() {
        match u8::try_from(unit).map(char::from) {
            Ok(c @ ('"' | '\\')) => escaped.extend(['\\', c]),
            Ok(c) if c.is_ascii() && !c.is_ascii_control() => escaped.push(c),
            _ => escaped.push_str(&format!("\\u{unit:04x}")),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn dates_are_formatted_in_utc() {
        let at = |s| exr_date(SystemTime::UNIX_EPOCH + Duration::from_secs(s));
        for (seconds, date) in [
            (0, "1970:01:01 00:00:00"),
            (951_782_400, "2000:02:29 00:00:00"),
            (1_709_251_199, "2024:02:29 23:59:59"),
            (4_107_542_400, "2100:03:01 00:00:00"),
        ] {
            assert_eq!(at(seconds).as_deref(), Some(date));
        }
        assert_eq!(exr_date(SystemTime::UNIX_EPOCH - Duration::from_secs(1)), None);
        assert_eq!(at(1 << 40), None);
    }
}

#[cfg(test)]
mod exr_zip_tests {
    use super::*;
    use exr::image::{AnyChannel, Encoding};
    use exr::meta::header::{ImageAttributes, LayerAttributes};
    use exr::prelude::{ReadChannels, ReadLayers, f16};

    fn layer(size: (usize, usize), position: (i32, i32), compression: Compression, noise: u32) -> AnyLayer {
        let count = size.0 * size.1;
        let random = |i: usize| ((i as u32).wrapping_mul(2_654_435_761) >> 8) % noise;
        let channels = vec![
            AnyChannel::new(
                "A",
                FlatSamples::F16((0..count).map(|i| f16::from_f32(random(i) as f32)).collect()),
            ),
            AnyChannel::new("Z", FlatSamples::F32((0..count).map(|i| (random(i) as f32).sqrt()).collect())),
            AnyChannel::new("id", FlatSamples::U32((0..count).map(|i| random(i) << 7).collect())),
        ];
        let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let attributes = LayerAttributes {
            layer_name: Some(format!("layer {noise}").as_str().into()),
            layer_position: Vec2(position.0, position.1),
            ..LayerAttributes::default()
        };
        Layer::new(size, attributes, encoding, AnyChannels::sort(channels.into()))
    }

    fn read(bytes: &[u8]) -> AnyImage {
        let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
        reader.all_layers().all_attributes().from_buffered(Cursor::new(bytes)).expect("a valid file")
    }

    /// Round trip of files with smooth values, with incompressible noise, of one pixel and of several parts.
    #[test]
    fn zip_files_are_read_back() {
        for (size, position) in [((37, 33), (0, 0)), ((1, 1), (-5, 7)), ((16, 48), (3, -20))] {
            for compression in [Compression::ZIP1, Compression::ZIP16] {
                let layers = [2, 3, u32::MAX].map(|noise| layer(size, position, compression, noise));
                let image = Image::from_layers(ImageAttributes::with_size(size), layers.to_vec());
                assert!(is_zip(&image));
                let bytes = encode_zip(&image).expect("it is encoded");
                let found = read(&bytes);
                for (own, other) in image.layer_data.iter().zip(&found.layer_data) {
                    assert_eq!(
                        (own.size, own.attributes.layer_position),
                        (other.size, other.attributes.layer_position)
                    );
                    assert_eq!(own.channel_data, other.channel_data);
                }
                assert_eq!(found.layer_data.len(), 3);
            }
        }
    }

    #[test]
    fn other_encodings_are_written_by_the_crate() {
        let of = |compression| {
            let layer = layer((4, 4), (0, 0), compression, 2);
            Image::from_layers(ImageAttributes::with_size((4, 4)), vec![layer])
        };
        assert!(!is_zip(&of(Compression::PIZ)) && !is_zip(&of(Compression::Uncompressed)));
        let mut tiles = of(Compression::ZIP16);
        tiles.layer_data[0].encoding.blocks = Blocks::Tiles(Vec2(2, 2));
        assert!(!is_zip(&tiles));
    }
}

#[cfg(test)]
mod matte_tests {
    use super::*;

    #[test]
    fn header_attributes_follow_the_specification() {
        let names = ["hello", "a \"b\"\\", "Würfel\u{1f600}"].map(String::from);
        let matte = Matte::new("crypto_asset", names.to_vec());
        let attributes = matte.attributes("");
        assert_eq!(attributes[0], ("cryptomatte/28322e9/name".into(), "crypto_asset".into()));
        let manifest: serde_json::Value = serde_json::from_str(&attributes[3].1).expect("JSON");
        assert!(attributes[3].1.is_ascii());
        for name in names {
            assert_eq!(manifest[&name], format!("{:08x}", matte_id(&name)), "{name}");
        }
        assert_eq!(manifest["hello"], "248bfa47");
    }
}

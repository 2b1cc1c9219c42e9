//! EXR: the first layer with colour as an image, and complete files with all parts and channels.

use super::exr_rows::Part;
use super::source::{self, Layout, Source, catching_panics, read_bytes, signature};
use crate::color::{Primaries, converted};
use crate::error::{Error, Result, Warning};
use crate::image::{Encoding, Image, Pixels};
use exr::image::{AnyChannels, Blocks, FlatSamples, Layers};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Chromaticities, Text};
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers, f16};
use image::ImageFormat;
use std::borrow::Cow;
use std::io::Cursor;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Maximum number of unused layers and channels listed in a warning.
const MAX_LISTED: usize = 8;

/// Size of the chunks in which a whole image is decoded, bytes of samples.
const IMAGE_CHUNK: usize = 1 << 26;
/// Size of the chunks in decoding by rows, bytes of samples.
const ROW_CHUNK: usize = 1 << 23;

/// Decodes the first layer with channels R, G and B, or else with Y (grey). If `alpha` is set and there is a channel A,
/// colours are divided by it (unpremultiplied). If `is_color` is set, colours are converted from the primaries of the
/// header to linear Rec. 709. Warns of other layers and channels.
pub(super) fn decode(
    source: &Source,
    is_color: bool,
    alpha: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    let picture = Picture::open(source, alpha)?;
    picture.warn(warnings);
    let size = picture.header().layer_size;
    let mut numbers = Vec::with_capacity(size.area() * picture.channels().len());
    let options = DecodeOptions { is_color, in_parallel: true, chunk_bytes: IMAGE_CHUNK };
    picture.each(0..size.1, &options, &mut |rows| numbers.extend(rows))?;
    Ok(picture.image([size.0 as u32, size.1 as u32], numbers))
}

/// The layout of the image that [`displayed`] returns, from the header.
pub(super) fn layout(source: &Source, alpha: bool) -> Result<Layout> {
    let picture = Picture::open(source, alpha)?;
    let Window { size, .. } = picture.display();
    source::check(source, size[0].into(), size[1].into())?;
    let rows = picture.header().max_block_pixel_size().1.min(picture.header().layer_size.1);
    Ok(Layout { size, channels: picture.channels().len() as u32, bits: 32, rows: Some(rows as u32) })
}

/// Decodes as [`decode`] and fits the data window to the display window: missing pixels are black and transparent, overscan
/// is cropped.
pub(super) fn displayed(
    source: &Source,
    is_color: bool,
    alpha: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    let picture = Picture::open(source, alpha)?;
    let size = picture.display().size;
    let mut numbers = Vec::new();
    let options = DecodeOptions { is_color, in_parallel: true, chunk_bytes: IMAGE_CHUNK };
    picture.each_displayed(&options, warnings, &mut |rows| match numbers.is_empty() {
        // Small images arrive in a single chunk.
        true if rows.len() == size[0] as usize * size[1] as usize * picture.channels().len() => {
            numbers = rows
        }
        true => {
            numbers.reserve_exact(size[0] as usize * size[1] as usize * picture.channels().len());
            numbers.extend(rows);
        }
        false => numbers.extend(rows),
    })?;
    Ok(picture.image(size, numbers))
}

/// As [`displayed`], in chunks of rows from the top.
pub(super) fn displayed_rows(
    source: &Source,
    (is_color, alpha): (bool, bool),
    in_parallel: bool,
    warnings: &mut Vec<Warning>,
    take: &mut dyn FnMut(Vec<f32>),
) -> Result<()> {
    let options = DecodeOptions { is_color, in_parallel, chunk_bytes: ROW_CHUNK };
    Picture::open(source, alpha)?.each_displayed(&options, warnings, take)
}

/// Parameters of decoding.
struct DecodeOptions {
    /// Convert colours to linear Rec. 709.
    is_color: bool,
    /// Use all threads.
    in_parallel: bool,
    /// Chunk size, bytes of samples.
    chunk_bytes: usize,
}

/// An open file and its selected channels.
struct Picture<'a> {
    source: &'a Source<'a>,
    meta: MetaData,
    /// File offset of the end of the headers.
    end: u64,
    /// Index of the layer.
    index: usize,
    color_channels: ColorChannels,
    alpha: bool,
}

impl<'a> Picture<'a> {
    fn open(source: &'a Source<'a>, alpha: bool) -> Result<Picture<'a>> {
        let mut head = Cursor::new(source.bytes);
        let meta = MetaData::read_from_buffered(&mut head, false).map_err(|e| broken(source, &e))?;
        check_kind(source, &meta)?;
        check_sizes(source, &meta)?;
        MetaData::validate(&meta.headers, false).map_err(|e| broken(source, &e))?;
        let of_header = |header: &Header| names(header.channels.list.iter().map(|channel| &channel.name));
        let (index, color_channels) =
            ColorChannels::find_in_layers(source, meta.headers.iter().map(of_header))?;
        Ok(Picture { source, meta, end: head.position(), index, color_channels, alpha })
    }

    fn header(&self) -> &Header {
        &self.meta.headers[self.index]
    }

    /// Indices of the selected channels.
    fn channels(&self) -> Vec<usize> {
        let alpha = self.color_channels.alpha.filter(|_| self.alpha);
        self.color_channels.color.iter().copied().chain(alpha).collect()
    }

    fn display(&self) -> Window {
        let shown = self.header().shared_attributes.display_window;
        let size = [shown.size.0, shown.size.1].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
        Window { position: [shown.position.0, shown.position.1], size }
    }

    fn warn(&self, warnings: &mut Vec<Warning>) {
        let message = self.color_channels.left_out(&self.meta.headers, self.index);
        warnings.extend(message.map(|message| self.source.warning(message)));
    }

    fn image(&self, [width, height]: [u32; 2], numbers: Vec<f32>) -> Image {
        let (name, channels) = (self.source.name(), self.channels().len() as u32);
        let pixels = Arc::new(Pixels::F32(numbers));
        Image { name, width, height, channels, encoding: Encoding::Linear, pixels }
    }

    /// Calls `take` with chunks of rows of the data window.
    fn each(
        &self,
        lines: Range<usize>,
        options: &DecodeOptions,
        take: &mut dyn FnMut(Vec<f32>),
    ) -> Result<()> {
        let channels = self.channels();
        let (count, width) = (channels.len(), self.header().layer_size.0);
        let space = self.header().shared_attributes.chromaticities;
        let space = space.filter(|_| options.is_color && self.color_channels.color.len() == 3);
        let matrix = space.and_then(|c| primaries(&c).to_rec709());
        let finish = |line: &mut [f32]| finish_line(line, count, matrix.as_ref());
        let fail = |e: exr::error::Error| broken(self.source, &e);
        let mut part = Part::open(self.source, (&self.meta, self.end), self.index, channels).map_err(fail)?;
        let height = part.block_height();
        let step = (options.chunk_bytes / part.row_bytes().max(1)).max(1);
        let last = lines.end.div_ceil(height).min(part.len());
        for first in (lines.start / height..last).step_by(step) {
            let rows = first..(first + step).min(last);
            let mut numbers = part.rows(rows.clone(), options.in_parallel, finish).map_err(fail)?;
            // Blocks may overlap the first and the last row of the range.
            let at = rows.start * height;
            numbers.truncate((lines.end - at).saturating_mul(width * count));
            numbers.drain(..lines.start.saturating_sub(at) * width * count);
            take(numbers);
        }
        Ok(())
    }

    /// Calls `take` with chunks of rows of the display window.
    fn each_displayed(
        &self,
        options: &DecodeOptions,
        warnings: &mut Vec<Warning>,
        take: &mut dyn FnMut(Vec<f32>),
    ) -> Result<()> {
        self.warn(warnings);
        let (Window { position, size }, header) = (self.display(), self.header());
        let (held, corner) = (header.layer_size, header.own_attributes.layer_position);
        if position == [corner.0, corner.1] && size.map(|n| n as usize) == [held.0, held.1] {
            return self.each(0..held.1, options, take);
        }
        let channels = self.channels().len();
        let [width, height] = size.map(u64::from);
        source::check(self.source, width, height)?;
        source::check_memory(self.source, width, height, width * height * channels as u64 * 4)?;
        let message = format!(
            "has a data window of {} x {} at {}, {} and a display window of {} x {} at {}, {}: it was fitted to the display window",
            held.0, held.1, corner.0, corner.1, size[0], size[1], position[0], position[1]
        );
        warnings.push(self.source.warning(message));
        let [width, height] = size.map(|n| n as usize);
        let shift =
            [i64::from(corner.0) - i64::from(position[0]), i64::from(corner.1) - i64::from(position[1])];
        let Span { from, to, count } = Span::of(shift[1], held.1, height);
        let step = (options.chunk_bytes / (width * channels * 4)).max(1);
        let blank = |lines: usize| {
            let starts = (0..lines).step_by(step);
            starts.map(move |first| vec![0.0; step.min(lines - first) * width * channels])
        };
        blank(if count > 0 { to } else { height }).for_each(&mut *take);
        if count > 0 {
            self.each(from..from + count, options, &mut |rows| {
                let lines = rows.len() / (held.0 * channels);
                take(fitted(&rows, [held.0, lines, channels], [shift[0], 0], [width, lines]));
            })?;
            blank(height - to - count).for_each(take);
        }
        Ok(())
    }
}

/// Divides colours by alpha and converts them to linear Rec. 709.
fn finish_line(line: &mut [f32], channels: usize, matrix: Option<&[[f64; 3]; 3]>) {
    if channels == 4 {
        for pixel in line.chunks_exact_mut(4) {
            let alpha = pixel[3];
            if alpha > 0.0 {
                pixel[..3].iter_mut().for_each(|v| *v /= alpha);
            }
        }
    }
    if let Some(matrix) = matrix {
        for pixel in line.chunks_exact_mut(channels) {
            let color = converted(matrix, [pixel[0], pixel[1], pixel[2]]);
            pixel[..3].copy_from_slice(&color);
        }
    }
}

fn broken(source: &Source, error: &exr::error::Error) -> Error {
    source.error(format!("can't be read as an EXR image: {error}"))
}

fn names<'a>(channels: impl Iterator<Item = &'a Text>) -> Vec<String> {
    channels.map(Text::to_string).collect()
}

/// Overlap of the data window with the display window along an axis: first pixel, its position in the display window, and
/// number of pixels.
struct Span {
    from: usize,
    to: usize,
    count: usize,
}

impl Span {
    fn of(shift: i64, held: usize, room: usize) -> Span {
        let (from, to) = ((-shift).max(0), shift.max(0));
        let count = (held as i64 - from).min(room as i64 - to).max(0);
        Span { from: from as usize, to: to as usize, count: count as usize }
    }
}

/// Copies pixels of a size (width, height, channels) with a shift into an image of another size; 0 elsewhere.
fn fitted<T: Copy + Default>(
    values: &[T],
    [width, height, channels]: [usize; 3],
    shift: [i64; 2],
    size: [usize; 2],
) -> Vec<T> {
    let mut out = vec![T::default(); size[0] * size[1] * channels];
    let Span { from: x, to: at_x, count: columns } = Span::of(shift[0], width, size[0]);
    let Span { from: y, to: at_y, count: rows } = Span::of(shift[1], height, size[1]);
    for row in 0..rows {
        let from = ((y + row) * width + x) * channels;
        let to = ((at_y + row) * size[0] + at_x) * channels;
        out[to..to + columns * channels].copy_from_slice(&values[from..from + columns * channels]);
    }
    out
}

/// A rectangle of pixels.
struct Window {
    position: [i32; 2],
    size: [u32; 2],
}

/// Fails for unsupported features.
fn check_kind(source: &Source, meta: &MetaData) -> Result<()> {
    if meta.headers.iter().any(|header| header.deep) {
        return Err(source
            .error("is a deep EXR: it holds several samples per pixel")
            .with_help("flatten it in a compositor"));
    }
    let is_subsampled =
        |header: &Header| header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1));
    if meta.headers.iter().any(is_subsampled) {
        return Err(source
            .error(
                "is a luminance-chroma EXR: it has fewer samples of its chroma channels (RY, BY) than pixels",
            )
            .with_help("convert it to channels R, G and B, in a compositor"));
    }
    Ok(())
}

/// Primaries and white point of a header.
pub(super) fn primaries(of: &Chromaticities) -> Primaries {
    let pair = |v: Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
    Primaries { red: pair(of.red), green: pair(of.green), blue: pair(of.blue), white: pair(of.white) }
}

/// Indices of a layer's colour channels.
struct ColorChannels {
    /// R, G and B, or Y.
    color: Vec<usize>,
    alpha: Option<usize>,
    /// The prefix of the channels (`diffuse.` of `diffuse.R`).
    prefix: String,
}

impl ColorChannels {
    /// The index of the first layer with colour channels, and these; `layers` are the channel names of each layer.
    fn find_in_layers(
        source: &Source,
        layers: impl Iterator<Item = Vec<String>>,
    ) -> Result<(usize, ColorChannels)> {
        let found = layers.enumerate().find_map(|(i, names)| Some((i, ColorChannels::find(&names)?)));
        found.ok_or_else(|| source.error("has no layer with channels R, G and B or Y"))
    }

    /// Channels without prefix, else the first group with a prefix; colour before grey.
    fn find(names: &[String]) -> Option<ColorChannels> {
        let prefixed = names.iter().filter_map(|name| Some(name[..=name.rfind('.')?].to_string()));
        let prefixes: Vec<String> = std::iter::once(String::new()).chain(prefixed).collect();
        let channel = |prefix: &str, letter: &str| {
            names.iter().position(|name| name.strip_prefix(prefix) == Some(letter))
        };
        [&["R", "G", "B"][..], &["Y"]].into_iter().find_map(|letters| {
            prefixes.iter().find_map(|prefix| {
                let color = letters.iter().map(|letter| channel(prefix, letter)).collect::<Option<_>>()?;
                // Grey is read without alpha.
                let alpha = channel(prefix, "A").filter(|_| letters.len() == 3);
                Some(ColorChannels { color, alpha, prefix: prefix.clone() })
            })
        })
    }

    /// The warning about unused layers and channels.
    fn left_out(&self, layers: &[Header], index: usize) -> Option<String> {
        let layer_name = |i: usize| match &layers[i].own_attributes.layer_name {
            Some(name) => format!("layer '{name}'"),
            None => format!("layer {}", i + 1),
        };
        let is_used = |channel: usize| self.color.contains(&channel) || self.alpha == Some(channel);
        let others = (0..layers.len()).filter(|&i| i != index).map(layer_name);
        let unused = layers[index].channels.list.iter().enumerate().filter(|(i, _)| !is_used(*i));
        let all: Vec<String> = others.chain(unused.map(|(_, c)| format!("channel '{}'", c.name))).collect();
        if all.is_empty() {
            return None;
        }
        let mut listed = all.iter().take(MAX_LISTED).map(String::as_str).collect::<Vec<_>>().join(", ");
        if all.len() > MAX_LISTED {
            listed += &format!(" and {} more", all.len() - MAX_LISTED);
        }
        let layer = if layers.len() > 1 { format!(" of {}", layer_name(index)) } else { String::new() };
        let letters = if self.color.len() == 3 { "RGB" } else { "Y" };
        Some(format!("is taken from the channels {}{letters}{layer}; left out: {listed}", self.prefix))
    }
}

/// Checks the sizes in the headers against the file's length, before the parser allocates memory.
pub(super) fn check_sizes(source: &Source, meta: &MetaData) -> Result<()> {
    let (mut samples, mut memory) = (0u64, 0u64);
    for header in &meta.headers {
        let (width, height) = (header.layer_size.0 as u64, header.layer_size.1 as u64);
        source::check(source, width, height)?;
        samples += width * height * header.channels.list.len() as u64;
        memory += header
            .channels
            .list
            .iter()
            .map(|c| width * height * c.sample_type.bytes_per_sample() as u64)
            .sum::<u64>();
        source::check_memory(source, width, height, memory)?;
        // Each chunk has an offset of 8 bytes in the table and a header of at least 8.
        if (header.chunk_count as u64).saturating_mul(16) > source.length {
            return Err(source.error(format!(
                "declares {} blocks of pixels, but the file has only {} bytes: it is truncated",
                header.chunk_count, source.length
            )));
        }
    }
    // With many channels: at most one sample per bit of the file.
    let bytes = source.length;
    if samples > source::max_pixels(bytes).saturating_mul(4).max(bytes.saturating_mul(8)) {
        return Err(source.error(format!("declares {samples} numbers in {bytes} bytes, which is too many")));
    }
    Ok(())
}

// Complete EXR files: all parts, channels and attributes, unchanged.

/// An EXR file in memory.
#[derive(Clone, Debug)]
pub struct Layered {
    file: exr::image::Image<Layers<AnyChannels<FlatSamples>>>,
}

/// Information about a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelInfo {
    /// Name with its layer: `albedo.R`.
    pub name: String,
    /// `half`, `float` or `uint`.
    pub kind: &'static str,
}

impl Layered {
    /// Number of parts.
    pub fn len(&self) -> usize {
        self.file.layer_data.len()
    }

    /// Whether there are no parts.
    pub fn is_empty(&self) -> bool {
        self.file.layer_data.is_empty()
    }

    /// Width and height of a part's pixels.
    pub fn size(&self, part: usize) -> [usize; 2] {
        let size = self.file.layer_data[part].size;
        [size.0, size.1]
    }

    /// Fits pixels of a part to the display window, filled with the default value; returns its size and pixels.
    pub fn in_display_window<T: Copy + Default>(&self, part: usize, pixels: &[T]) -> ([usize; 2], Vec<T>) {
        let (layer, shown) = (&self.file.layer_data[part], self.file.attributes.display_window);
        let (size, corner) = (layer.size, layer.attributes.layer_position);
        let shift = [
            i64::from(corner.0) - i64::from(shown.position.0),
            i64::from(corner.1) - i64::from(shown.position.1),
        ];
        let room = [shown.size.0, shown.size.1];
        // An implausibly large display window is ignored.
        if room[0].saturating_mul(room[1]) > pixels.len().saturating_mul(64).max(1 << 24) {
            return ([size.0, size.1], pixels.to_vec());
        }
        (room, fitted(pixels, [size.0, size.1, 1], shift, room))
    }

    /// The channels of a part.
    pub fn channels(&self, part: usize) -> Vec<ChannelInfo> {
        let kind = |samples: &FlatSamples| match samples {
            FlatSamples::F16(_) => "half",
            FlatSamples::F32(_) => "float",
            FlatSamples::U32(_) => "uint",
        };
        let list = self.file.layer_data[part].channel_data.list.iter();
        list.map(|c| ChannelInfo { name: c.name.to_string(), kind: kind(&c.sample_data) }).collect()
    }

    /// The name of a part, if it has one.
    pub fn name(&self, part: usize) -> Option<String> {
        self.file.layer_data[part].attributes.layer_name.as_ref().map(Text::to_string)
    }

    /// Layout and compression of a part's pixels: `scan lines, ZIP16`.
    pub fn compression(&self, part: usize) -> String {
        let encoding = &self.file.layer_data[part].encoding;
        let blocks = match encoding.blocks {
            Blocks::ScanLines => "scan lines".to_string(),
            Blocks::Tiles(size) => format!("tiles of {} x {}", size.0, size.1),
        };
        format!("{blocks}, {:?}", encoding.compression)
    }

    /// Descriptive attributes of a part's header: names and values as text, sorted.
    pub fn attributes(&self, part: usize) -> Vec<(String, String)> {
        let (file, own) = (&self.file.attributes, &self.file.layer_data[part].attributes);
        let window = file.display_window;
        let mut list = vec![
            ("dataWindow".to_string(), rectangle(own.layer_position, self.file.layer_data[part].size)),
            ("displayWindow".to_string(), rectangle(window.position, window.size)),
        ];
        let mut add = |name: &str, value: Option<String>| list.extend(value.map(|v| (name.to_string(), v)));
        let chromaticities = |c: Chromaticities| {
            let pair = |v: Vec2<f32>| format!("{} {}", v.0, v.1);
            format!("{}, {}, {}, white {}", pair(c.red), pair(c.green), pair(c.blue), pair(c.white))
        };
        add("chromaticities", file.chromaticities.map(chromaticities));
        for (name, value) in [
            ("software", &own.software_name),
            ("owner", &own.owner),
            ("capDate", &own.capture_date),
            ("comments", &own.comments),
            ("view", &own.view_name),
        ] {
            add(name, value.as_ref().map(Text::to_string));
        }
        add("worldToCamera", own.world_to_camera.map(|m| format!("{m:?}")));
        add("worldToNDC", own.world_to_normalized_device.map(|m| format!("{m:?}")));
        for (name, value) in file.other.iter().chain(&own.other) {
            add(&name.to_string(), Some(attribute_text(value)));
        }
        list.sort();
        list
    }

    /// The primaries of the file, if its header defines them.
    pub fn primaries(&self) -> Option<Primaries> {
        self.file.attributes.chromaticities.map(|c| primaries(&c))
    }

    /// The name of a channel without the prefix of a render layer, as Blender writes it: `albedo.R` for `ViewLayer.albedo.R`,
    /// `R` for `ViewLayer.Combined.R`. Other names are unchanged.
    pub fn plain_name(&self, part: usize, name: &str) -> String {
        plain_name(self.render_layer(part).as_deref(), name).to_string()
    }

    /// The prefix of a part's channel names, with its dot, if it is a render layer.
    fn render_layer(&self, part: usize) -> Option<String> {
        let list = &self.file.layer_data[part].channel_data.list;
        let layer =
            |name: String| name.strip_suffix("Combined.R").filter(|l| l.ends_with('.')).map(str::to_string);
        list.iter().find_map(|c| layer(c.name.to_string()))
    }

    /// Index of a channel in its part: by its name, or by its [plain name](Layered::plain_name).
    fn index_of(&self, part: usize, name: &str) -> Option<usize> {
        let list = &self.file.layer_data[part].channel_data.list;
        let exact = list.iter().position(|c| c.name == *name);
        exact.or_else(|| {
            let layer = self.render_layer(part)?;
            list.iter().position(|c| plain_name(Some(&layer), &c.name.to_string()) == name)
        })
    }

    /// The first part with a channel among the parts with the size of part `like`, starting with `like`.
    pub fn part_with(&self, like: usize, name: &str) -> Option<usize> {
        let others = (0..self.len()).filter(|&part| part != like && self.size(part) == self.size(like));
        std::iter::once(like).chain(others).find(|&part| self.index_of(part, name).is_some())
    }

    /// The values of a channel by its name or its [plain name](Layered::plain_name), row by row from the top; integers are
    /// converted to floats. `None` if there is no such channel.
    pub fn values(&self, part: usize, name: &str) -> Option<Vec<f32>> {
        let channel = &self.file.layer_data[part].channel_data.list[self.index_of(part, name)?];
        Some(channel.sample_data.values_as_f32().collect())
    }

    /// Replaces a channel's values, converted to its type and clamped to its range. Does nothing if there is no such channel.
    ///
    /// # Panics
    /// If the number of values differs.
    pub fn set_values(&mut self, part: usize, name: &str, values: &[f32]) {
        let Some(index) = self.index_of(part, name) else { return };
        let channel = &mut self.file.layer_data[part].channel_data.list[index];
        assert_eq!(channel.sample_data.len(), values.len(), "the number of pixels must not change");
        let half = |v: &f32| f16::from_f32(v.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()));
        match &mut channel.sample_data {
            FlatSamples::F16(old) => *old = values.iter().map(half).collect(),
            FlatSamples::F32(old) => *old = values.to_vec(),
            FlatSamples::U32(old) => *old = values.iter().map(|v| *v as u32).collect(),
        }
    }

    /// Sets a text attribute of a part. Does nothing for text with code points above 255.
    pub fn set_attribute(&mut self, part: usize, name: &str, value: &str) {
        if let (Some(name), Some(value)) = (Text::new_or_none(name), Text::new_or_none(value)) {
            let other = &mut self.file.layer_data[part].attributes.other;
            other.insert(name, AttributeValue::Text(value));
        }
    }

    /// Three channels of a part, if it has them all; f32 channels are borrowed.
    pub fn planes(&self, part: usize, names: [&str; 3]) -> Option<[Cow<'_, [f32]>; 3]> {
        let list = &self.file.layer_data[part].channel_data.list;
        let [a, b, c] = names.map(|name| match &list[self.index_of(part, name)?].sample_data {
            FlatSamples::F32(values) => Some(Cow::Borrowed(values.as_slice())),
            others => Some(others.values_as_f32().collect()),
        });
        Some([a?, b?, c?])
    }

    /// [`Layered::planes`] as owned values.
    pub fn triple(&self, part: usize, names: [&str; 3]) -> Option<[Vec<f32>; 3]> {
        self.planes(part, names).map(|planes| planes.map(Cow::into_owned))
    }

    /// The file in the type of the crate `exr`.
    pub(crate) fn file(&self) -> &exr::image::Image<Layers<AnyChannels<FlatSamples>>> {
        &self.file
    }
}

/// The name of a channel without its render layer.
fn plain_name<'a>(layer: Option<&str>, name: &'a str) -> &'a str {
    match layer.and_then(|layer| name.strip_prefix(layer)) {
        None => name,
        Some("Depth.Z") => "Z",
        Some("Samples.X") => "samples",
        Some(below) => below.strip_prefix("Combined.").unwrap_or(below),
    }
}

/// A rectangle as text.
fn rectangle(position: Vec2<i32>, size: Vec2<usize>) -> String {
    format!("{} x {} at {}, {}", size.0, size.1, position.0, position.1)
}

/// The value of an attribute as text.
fn attribute_text(value: &AttributeValue) -> String {
    match value {
        AttributeValue::Text(text) => text.to_string(),
        AttributeValue::F64(number) => number.to_string(),
        AttributeValue::F32(number) => number.to_string(),
        AttributeValue::I32(number) => number.to_string(),
        other => format!("{other:?}"),
    }
}

/// Reads a complete EXR file, at its largest resolution.
///
/// # Errors
/// An input error if the file is missing, damaged, not an EXR file, or declares more pixels than its length permits.
pub fn load_layered(path: &Path) -> Result<Layered> {
    let bytes = read_bytes(path, None)?;
    let source = Source::new(&bytes, (path, ""), None);
    if signature(&bytes) != Some(ImageFormat::OpenExr) {
        let help = "'oscura render SCENE -o NAME.exr' writes one";
        return Err(source.error("is not an .exr file").with_help(help));
    }
    let broken = |e: exr::error::Error| source.error(format!("can't be read as an EXR image: {e}"));
    catching_panics(&source, || {
        let meta = MetaData::read_from_buffered(Cursor::new(bytes.as_slice()), false).map_err(broken)?;
        check_kind(&source, &meta)?;
        check_sizes(&source, &meta)?;
        exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(Cursor::new(bytes.as_slice()))
            .map(|file| Layered { file })
            .map_err(broken)
    })
}

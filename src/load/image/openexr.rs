//! EXR to pixels: the first layer with colour.

use super::source::{self, Layout, Source, guarded, read_bytes, signature};
use crate::color::{Primaries, converted};
use crate::error::{Error, Result, Warning};
use crate::image::{Encoding, Image, Pixels};
use exr::image::{AnyChannels, Blocks, FlatSamples, Layer, Layers};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Chromaticities, Text};
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers, f16};
use half::slice::HalfFloatSliceExt;
use image::ImageFormat;
use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

/// Maximum number of unused layers and channels that are named.
const LISTED: usize = 8;

/// Decodes the first layer with channels R, G and B, or else with Y (grey). Where `alpha` is wanted and there is a
/// channel A, colour, which EXR stores multiplied by alpha, is divided by it. Where the numbers are colours (`is_color`), those of
/// another space that the header names become linear Rec. 709. Warns of other layers and channels.
pub(super) fn decode(
    source: &Source,
    is_color: bool,
    alpha: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    decode_placed(source, is_color, alpha, warnings).map(|(image, _)| image)
}

fn decode_placed(
    source: &Source,
    is_color: bool,
    alpha: bool,
    warnings: &mut Vec<Warning>,
) -> Result<(Image, Placed)> {
    checked(source)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(source.bytes))
        .map_err(|e| broken(source, &e))?;
    let layers = &image.layer_data;
    let names =
        |layer: &Layer<AnyChannels<FlatSamples>>| names(layer.channel_data.list.iter().map(|c| &c.name));
    let (index, colour) = Colour::of_file(source, layers.iter().map(names))?;
    if let Some(message) = colour.left_out(layers, index) {
        warnings.push(source.warning(message));
    }
    let planes = colour.planes(&layers[index], alpha);
    let mut values = interleave(&planes);
    let space = image.attributes.chromaticities.filter(|_| is_color && colour.color.len() == 3);
    if let Some(matrix) = space.and_then(|c| primaries(&c).to_rec709()) {
        for pixel in values.chunks_exact_mut(planes.len()) {
            let color = converted(&matrix, [pixel[0], pixel[1], pixel[2]]);
            pixel[..3].copy_from_slice(&color);
        }
    }
    let (shown, corner) = (image.attributes.display_window, layers[index].attributes.layer_position);
    let size = [shown.size.0, shown.size.1].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    let display = Window { position: [shown.position.0, shown.position.1], size };
    let placed = Placed { position: [corner.0, corner.1], display };
    let image = Image {
        name: source.name(),
        width: layers[index].size.0 as u32,
        height: layers[index].size.1 as u32,
        channels: planes.len() as u32,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::F32(values)),
    };
    Ok((image, placed))
}

/// The header of a file of a kind and a size that are read.
fn checked(source: &Source) -> Result<MetaData> {
    let meta = MetaData::read_from_buffered(Cursor::new(source.bytes), false);
    let meta = meta.map_err(|e| broken(source, &e))?;
    check_kind(source, &meta)?;
    check_sizes(source, &meta)?;
    Ok(meta)
}

fn broken(source: &Source, error: &exr::error::Error) -> Error {
    source.error(format!("can't be read as an EXR image: {error}"))
}

fn names<'a>(channels: impl Iterator<Item = &'a Text>) -> Vec<String> {
    channels.map(Text::to_string).collect()
}

/// What [`displayed`] will give, by the header.
pub(super) fn layout(source: &Source, alpha: bool) -> Result<Layout> {
    let meta = checked(source)?;
    let of_header = |header: &Header| names(header.channels.list.iter().map(|channel| &channel.name));
    let (index, colour) = Colour::of_file(source, meta.headers.iter().map(of_header))?;
    let shown = meta.headers[index].shared_attributes.display_window.size;
    let size = [shown.0, shown.1].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    source::check(source, size[0].into(), size[1].into())?;
    let alpha = usize::from(alpha && colour.alpha.is_some());
    Ok(Layout { size, channels: (colour.color.len() + alpha) as u32, bits: 32 })
}

/// An EXR within its display window: black and transparent where the file has no pixels, without those beyond it. Renderers write
/// what isn't empty, and pictures from elsewhere margins.
pub(super) fn displayed(
    source: &Source,
    is_color: bool,
    alpha: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    let (image, data) = decode_placed(source, is_color, alpha, warnings)?;
    let Window { position, size } = data.display;
    if position == data.position && size == [image.width, image.height] {
        return Ok(image);
    }
    let [width, height] = size.map(u64::from);
    source::check(source, width, height)?;
    source::check_memory(source, width, height, width * height * u64::from(image.channels) * 4)?;
    let Pixels::F32(values) = &*image.pixels else { return Ok(image) };
    let message = format!(
        "has pixels for {} x {} at {}, {} of its display window of {} x {} at {}, {}: it was fitted to that",
        image.width,
        image.height,
        data.position[0],
        data.position[1],
        size[0],
        size[1],
        position[0],
        position[1]
    );
    warnings.push(source.warning(message));
    let shift = [0, 1].map(|axis| i64::from(data.position[axis]) - i64::from(position[axis]));
    let held = [image.width, image.height, image.channels].map(|n| n as usize);
    let values = fitted(values, held, shift, size.map(|n| n as usize));
    let pixels = Arc::new(Pixels::F32(values));
    Ok(Image { width: size[0], height: size[1], pixels, ..image })
}

/// Pixels of a width, a height and channels, placed in a rectangle of another size; 0 where there are none.
fn fitted<T: Copy + Default>(
    values: &[T],
    [width, height, channels]: [usize; 3],
    shift: [i64; 2],
    size: [usize; 2],
) -> Vec<T> {
    let mut out = vec![T::default(); size[0] * size[1] * channels];
    // Of one axis: the first pixel, the first place and how many.
    let span = |shift: i64, held: usize, room: usize| {
        let (from, to) = ((-shift).max(0), shift.max(0));
        let count = (held as i64 - from).min(room as i64 - to).max(0);
        (from as usize, to as usize, count as usize)
    };
    let (x, at_x, columns) = span(shift[0], width, size[0]);
    let (y, at_y, rows) = span(shift[1], height, size[1]);
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

/// Where the pixels of a file are, and the rectangle that is shown.
struct Placed {
    position: [i32; 2],
    display: Window,
}

/// Refuses what the decoder doesn't read, by its name.
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

/// The space that a header names.
pub(super) fn primaries(of: &Chromaticities) -> Primaries {
    let pair = |v: Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
    Primaries { red: pair(of.red), green: pair(of.green), blue: pair(of.blue), white: pair(of.white) }
}

/// The channels of a layer that make a picture, by number.
struct Colour {
    /// R, G and B, or Y.
    color: Vec<usize>,
    alpha: Option<usize>,
    /// The prefix of the channels (`diffuse.` of `diffuse.R`).
    prefix: String,
}

impl Colour {
    /// The channels of the first layer that has a picture, and the number of that layer; given the names of each layer's channels.
    fn of_file(source: &Source, layers: impl Iterator<Item = Vec<String>>) -> Result<(usize, Colour)> {
        let found = layers.enumerate().find_map(|(i, names)| Some((i, Colour::find(&names)?)));
        found.ok_or_else(|| source.error("has no layer with channels R, G and B or Y"))
    }

    /// Channels of plain letters, or else the first whose names have a part before them; colour before grey.
    fn find(names: &[String]) -> Option<Colour> {
        let prefixed = names.iter().filter_map(|name| Some(name[..=name.rfind('.')?].to_string()));
        let prefixes: Vec<String> = std::iter::once(String::new()).chain(prefixed).collect();
        let channel = |prefix: &str, letter: &str| {
            names.iter().position(|name| name.strip_prefix(prefix) == Some(letter))
        };
        [&["R", "G", "B"][..], &["Y"]].into_iter().find_map(|letters| {
            prefixes.iter().find_map(|prefix| {
                let color = letters.iter().map(|letter| channel(prefix, letter)).collect::<Option<_>>()?;
                // Grey comes without.
                let alpha = channel(prefix, "A").filter(|_| letters.len() == 3);
                Some(Colour { color, alpha, prefix: prefix.clone() })
            })
        })
    }

    fn planes<'a>(&self, layer: &'a Layer<AnyChannels<FlatSamples>>, alpha: bool) -> Vec<&'a FlatSamples> {
        let alpha = self.alpha.filter(|_| alpha);
        let channels = self.color.iter().copied().chain(alpha);
        channels.map(|channel| &layer.channel_data.list[channel].sample_data).collect()
    }

    /// Warns of layers and channels that are not used; alpha has its own rules.
    fn left_out(&self, layers: &[Layer<AnyChannels<FlatSamples>>], index: usize) -> Option<String> {
        let layer_name = |i: usize| match &layers[i].attributes.layer_name {
            Some(name) => format!("layer '{name}'"),
            None => format!("layer {}", i + 1),
        };
        let is_used = |channel: usize| self.color.contains(&channel) || self.alpha == Some(channel);
        let others = (0..layers.len()).filter(|&i| i != index).map(layer_name);
        let unused = layers[index].channel_data.list.iter().enumerate().filter(|(i, _)| !is_used(*i));
        let all: Vec<String> = others.chain(unused.map(|(_, c)| format!("channel '{}'", c.name))).collect();
        if all.is_empty() {
            return None;
        }
        let mut listed = all.iter().take(LISTED).map(String::as_str).collect::<Vec<_>>().join(", ");
        if all.len() > LISTED {
            listed += &format!(" and {} more", all.len() - LISTED);
        }
        let layer = if layers.len() > 1 { format!(" of {}", layer_name(index)) } else { String::new() };
        let letters = if self.color.len() == 3 { "RGB" } else { "Y" };
        Some(format!("is taken from the channels {}{letters}{layer}; left out: {listed}", self.prefix))
    }
}

/// Compares what the header claims with the bytes that the file holds, before the parser allocates for it.
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
        // Each chunk has an offset of 8 bytes in a table and a header of at least 8.
        if (header.chunk_count as u64).saturating_mul(16) > source.bytes.len() as u64 {
            return Err(source.error(format!(
                "promises {} blocks of pixels, but the file has only {} bytes: it is cut short",
                header.chunk_count,
                source.bytes.len()
            )));
        }
    }
    // Channels make numbers many: a large file may hold as many as it has bits.
    let bytes = source.bytes.len();
    if samples > source::pixels(bytes).saturating_mul(4).max(bytes as u64 * 8) {
        return Err(source.error(format!("claims {samples} numbers in {bytes} bytes, which is too many")));
    }
    Ok(())
}

fn interleave(planes: &[&FlatSamples]) -> Vec<f32> {
    let count = planes.len();
    let mut out = vec![0f32; planes.first().map_or(0, |p| p.len()) * count];
    for (c, plane) in planes.iter().enumerate() {
        let values = numbers(plane);
        out.iter_mut().skip(c).step_by(count).zip(values.iter()).for_each(|(o, v)| *o = *v);
    }
    if count == 4 {
        for pixel in out.chunks_exact_mut(4) {
            let alpha = pixel[3];
            if alpha > 0.0 {
                pixel[..3].iter_mut().for_each(|v| *v /= alpha);
            }
        }
    }
    out
}

/// The samples of a channel; half floats are converted many at a time.
fn numbers(plane: &FlatSamples) -> Cow<'_, [f32]> {
    match plane {
        FlatSamples::F32(values) => values.into(),
        FlatSamples::F16(values) => {
            let mut numbers = vec![0.0; values.len()];
            values.convert_to_f32_slice(&mut numbers);
            numbers.into()
        }
        FlatSamples::U32(values) => values.iter().map(|&v| v as f32).collect(),
    }
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
    /// Its name with that of its layer: `albedo.R`.
    pub name: String,
    /// `half`, `float` or `uint`.
    pub kind: &'static str,
}

impl Layered {
    /// Parts of the file.
    pub fn len(&self) -> usize {
        self.file.layer_data.len()
    }

    /// Has it none?
    pub fn is_empty(&self) -> bool {
        self.file.layer_data.is_empty()
    }

    /// Width and height of a part's pixels.
    pub fn size(&self, part: usize) -> [usize; 2] {
        let size = self.file.layer_data[part].size;
        [size.0, size.1]
    }

    /// Pixels of a part, one value or several each, within the display window: the default where the part has none.
    pub fn in_display_window<T: Copy + Default>(&self, part: usize, pixels: &[T]) -> ([usize; 2], Vec<T>) {
        let (layer, shown) = (&self.file.layer_data[part], self.file.attributes.display_window);
        let (size, corner) = (layer.size, layer.attributes.layer_position);
        let shift = [
            i64::from(corner.0) - i64::from(shown.position.0),
            i64::from(corner.1) - i64::from(shown.position.1),
        ];
        let room = [shown.size.0, shown.size.1];
        // What a file of that size can't justify stays as it is.
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

    /// The attributes of a part's header that say something about the picture, as text, by name.
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
            add(&name.to_string(), Some(shown(value)));
        }
        list.sort();
        list
    }

    /// The space of the file's colours, if it says one.
    pub fn primaries(&self) -> Option<Primaries> {
        self.file.attributes.chromaticities.map(|c| primaries(&c))
    }

    /// The name of a channel without the render layer that Blender, and files laid out as its are, write before it:
    /// `albedo.R` for `ViewLayer.albedo.R`, `R` for `ViewLayer.Combined.R`. Others stay as they are.
    pub fn plain_name(&self, part: usize, name: &str) -> String {
        plain_name(self.render_layer(part).as_deref(), name).to_string()
    }

    /// The prefix of a part's channel names, with its dot, if that is a render layer.
    fn render_layer(&self, part: usize) -> Option<String> {
        let list = &self.file.layer_data[part].channel_data.list;
        let layer =
            |name: String| name.strip_suffix("Combined.R").filter(|l| l.ends_with('.')).map(str::to_string);
        list.iter().find_map(|c| layer(c.name.to_string()))
    }

    /// Index of a channel in its part: by its name, or by its [plain name](Layered::plain_name).
    fn index_of(&self, part: usize, name: &str) -> Option<usize> {
        let list = &self.file.layer_data[part].channel_data.list;
        let as_it_is = list.iter().position(|c| c.name == *name);
        as_it_is.or_else(|| {
            let layer = self.render_layer(part)?;
            list.iter().position(|c| plain_name(Some(&layer), &c.name.to_string()) == name)
        })
    }

    /// The first part with a channel, of those that are as large as part `like`; that one before others.
    pub fn part_with(&self, like: usize, name: &str) -> Option<usize> {
        let others = (0..self.len()).filter(|&part| part != like && self.size(part) == self.size(like));
        std::iter::once(like).chain(others).find(|&part| self.index_of(part, name).is_some())
    }

    /// The values of a channel, by its name or its [plain name](Layered::plain_name), row by row from the top, integers as
    /// floats. `None` if there is no such channel.
    pub fn values(&self, part: usize, name: &str) -> Option<Vec<f32>> {
        let channel = &self.file.layer_data[part].channel_data.list[self.index_of(part, name)?];
        Some(channel.sample_data.values_as_f32().collect())
    }

    /// Replaces a channel's values, in the channel's type, half floats within their range. Does nothing if there
    /// is no such channel.
    ///
    /// # Panics
    /// If there are not as many as before.
    pub fn set_values(&mut self, part: usize, name: &str, values: &[f32]) {
        let Some(index) = self.index_of(part, name) else { return };
        let channel = &mut self.file.layer_data[part].channel_data.list[index];
        assert_eq!(channel.sample_data.len(), values.len(), "another number of pixels");
        let half = |v: &f32| f16::from_f32(v.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()));
        match &mut channel.sample_data {
            FlatSamples::F16(old) => *old = values.iter().map(half).collect(),
            FlatSamples::F32(old) => *old = values.to_vec(),
            FlatSamples::U32(old) => *old = values.iter().map(|v| *v as u32).collect(),
        }
    }

    /// Sets a text attribute of a part. Text has the first 256 code points only; nothing is set for other text.
    pub fn set_attribute(&mut self, part: usize, name: &str, value: &str) {
        if let (Some(name), Some(value)) = (Text::new_or_none(name), Text::new_or_none(value)) {
            let other = &mut self.file.layer_data[part].attributes.other;
            other.insert(name, AttributeValue::Text(value));
        }
    }

    /// Three channels of a part, if it has them all.
    pub fn triple(&self, part: usize, names: [&str; 3]) -> Option<[Vec<f32>; 3]> {
        let [a, b, c] = names.map(|name| self.values(part, name));
        Some([a?, b?, c?])
    }

    /// The file in the types of the crate that writes it.
    pub(crate) fn file(&self) -> &exr::image::Image<Layers<AnyChannels<FlatSamples>>> {
        &self.file
    }
}

/// The name of a channel without that of the render layer before it.
fn plain_name<'a>(layer: Option<&str>, name: &'a str) -> &'a str {
    match layer.and_then(|layer| name.strip_prefix(layer)) {
        None => name,
        Some("Depth.Z") => "Z",
        Some("Samples.X") => "samples",
        Some(below) => below.strip_prefix("Combined.").unwrap_or(below),
    }
}

/// Corner and size.
fn rectangle(position: Vec2<i32>, size: Vec2<usize>) -> String {
    format!("{} x {} at {}, {}", size.0, size.1, position.0, position.1)
}

/// The value of an attribute as text.
fn shown(value: &AttributeValue) -> String {
    match value {
        AttributeValue::Text(text) => text.to_string(),
        AttributeValue::F64(number) => number.to_string(),
        AttributeValue::F32(number) => number.to_string(),
        AttributeValue::I32(number) => number.to_string(),
        other => format!("{other:?}"),
    }
}

/// Reads an EXR file with all that is in it; of pictures in several resolutions the largest.
///
/// # Errors
/// An input error if the file is missing, no EXR, broken, or larger than its length can justify.
pub fn load_layered(path: &Path) -> Result<Layered> {
    let bytes = read_bytes(path, None)?;
    let source = Source { bytes: &bytes, file: path, pointer: "", memory_limit: None };
    if signature(&bytes) != Some(ImageFormat::OpenExr) {
        let help = "'oscura render SCENE -o NAME.exr' writes one";
        return Err(source.error("is not an .exr file").with_help(help));
    }
    let broken = |e: exr::error::Error| source.error(format!("can't be read as an EXR image: {e}"));
    guarded(&source, || {
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

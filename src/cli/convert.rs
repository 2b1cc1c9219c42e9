//! `oscura convert`: a layer of an EXR, or of a sequence of EXRs, as a display-referred picture.

use super::parsers::Frames;
use super::picture_args::ConvertArgs;
use super::pictures::{AnimationFiles, is_animation};
use super::process::Outcome;
use font8x8::legacy::BASIC_LEGACY;
use oscura::color::converted;
use oscura::error::{Error, Result};
use oscura::film::Aov;
use oscura::load::image::{Layered, load_layered};
use oscura::output::{
    Format, Linear, PngOptions, check_target, display_rgba8, encode_display_png, encode_rgb8, is_color,
    write_atomically,
};
use std::path::Path;

pub(crate) fn run(args: &ConvertArgs) -> Result<Outcome> {
    if is_animation(&args.output) {
        return animate(args);
    }
    const ENDINGS: &str = "end the name in .png, .jpg, .tif, .webp or .hdr";
    let format = Format::of(&args.output).map_err(|error| error.with_help(ENDINGS))?;
    if format == Format::Exr {
        let message = format!("{}: is an EXR, which 'convert' does not write", args.output.display());
        return Err(Error::usage(message).with_help(ENDINGS));
    }
    if args.sheet && format == Format::Hdr {
        return Err(
            Error::usage("--sheet is display-referred, but .hdr is linear").with_help("write a .png or .jpg")
        );
    }
    if !Frames::is_pattern(&args.picture) {
        convert_file(args, (&args.picture, &args.output), format)?;
        return Ok(Outcome::Done);
    }
    if !Frames::is_pattern(&args.output) {
        let message = format!("-o {}: a sequence needs a name for each frame", args.output.display());
        return Err(Error::usage(message)
            .with_help("such as -o frame.####.png, or one animation such as -o walk.mp4"));
    }
    for number in Frames::existing(&args.picture)? {
        let [picture, output] = [&args.picture, &args.output].map(|path| Frames::file(path, number));
        convert_file(args, (&picture, &output), format)?;
    }
    Ok(Outcome::Done)
}

fn png_options(args: &ConvertArgs) -> PngOptions {
    PngOptions {
        view: args.view.clone(),
        exposure: args.exposure,
        white_balance: args.white_balance,
        dither: args.dither,
        deep: args.deep,
        opaque: false,
    }
}

fn convert_file(args: &ConvertArgs, (picture, output): (&Path, &Path), format: Format) -> Result<()> {
    check_target(output)?;
    let file = load_layered(picture)?;
    let options = png_options(args);
    let data = args.layer.as_deref().filter(|_| format != Format::Hdr && !args.deep);
    let (bytes, invalid) = match data.and_then(|name| data_layer(&file, name)) {
        _ if args.sheet => (encode_sheet(&file, format, &options), None),
        Some(layer) => (layer.encode(&file, format, &options), None),
        None => {
            let ([width, height], rgba) = pixels(&file, args, picture)?;
            let linear = Linear { width, height, rgba: &rgba };
            (encode_display_png(&linear, format, &options), invalid(&rgba))
        }
    };
    let bytes = bytes.map_err(|message| Error::output(output, message))?;
    write_atomically(output, &bytes)?;
    if !args.quiet {
        invalid.iter().for_each(|note| say!("note: {note}"));
        say!("wrote    {}", output.display());
    }
    Ok(())
}

/// Converts a sequence to one animation.
fn animate(args: &ConvertArgs) -> Result<Outcome> {
    if !Frames::is_pattern(&args.picture) || args.sheet {
        let message = format!("{}: an animation needs the pictures of a sequence", args.output.display());
        return Err(Error::usage(message).with_help("use #### instead of the frame number, without --sheet"));
    }
    let numbers = Frames::existing(&args.picture)?;
    let mut moving = AnimationFiles::new(std::slice::from_ref(&args.output), args.fps)?;
    let options = png_options(args);
    for number in numbers {
        let picture = Frames::file(&args.picture, number);
        let ([width, height], rgba) = pixels(&load_layered(&picture)?, args, &picture)?;
        moving.check_size(width, height)?;
        moving.add(&Linear { width, height, rgba: &rgba }, &options)?;
    }
    moving.finish(args.quiet)?;
    Ok(Outcome::Done)
}

/// Size and RGBA pixels of the layer of `--layer`, in the display window.
fn pixels(file: &Layered, args: &ConvertArgs, path: &Path) -> Result<([u32; 2], Vec<[f32; 4]>)> {
    let layer = args.layer.as_deref();
    let found = find(file, layer).or_else(|| find(file, Some(layer_of_pass(layer?)?)));
    let (part, rgba) = found.ok_or_else(|| no_layer(file, args, path))?;
    let (size, rgba) = file.in_display_window(part, &rgba);
    Ok((size.map(|length| length as u32), rgba))
}

/// A layer by name or AOV that holds data other than colours or a single number: a view transform does not show it.
fn data_layer(file: &Layered, name: &str) -> Option<Layer> {
    let of_pass = layer_of_pass(name);
    let is_named = |layer: &Layer| layer.name == name || Some(&*layer.name) == of_pass;
    let found = layers(file).into_iter().find(is_named)?;
    (!matches!(found.kind, Kind::Color | Kind::Scalar | Kind::Variance)).then_some(found)
}

/// The layer of an AOV by its option name, such as `Z` for `depth`.
fn layer_of_pass(name: &str) -> Option<&'static str> {
    let channel = *Aov::from_option(name)?.info().names.first()?;
    Some(channel.rsplit_once('.').map_or(channel, |(layer, _)| layer))
}

/// A note about NaN and infinite values, if there are any.
fn invalid(rgba: &[[f32; 4]]) -> Option<String> {
    let values = rgba.as_flattened();
    let of = |is: fn(f32) -> bool| values.iter().filter(|v| is(**v)).count();
    let (nan, infinite, all) = (of(f32::is_nan), of(f32::is_infinite), values.len());
    (nan + infinite > 0).then(|| {
        format!("of {all} values, {nan} are NaN (shown as 0) and {infinite} infinite (shown as minimum or maximum)")
    })
}

/// All layers on one sheet.
fn encode_sheet(
    file: &Layered,
    format: Format,
    options: &PngOptions,
) -> std::result::Result<Vec<u8>, String> {
    let Sheet { width, height, data } = sheet(file, options);
    encode_rgb8(&data, width as u32, height as u32, format)
}

/// Part index and pixels of a layer: a channel prefix up to the last dot, a part's name, or a single channel. Without a layer:
/// the picture itself.
fn find(file: &Layered, layer: Option<&str>) -> Option<(usize, Vec<[f32; 4]>)> {
    let named = layer.map(|layer| format!("{layer}."));
    (0..file.len()).find_map(|part| {
        let is_part = layer.is_none() || file.name(part).as_deref() == layer;
        let prefixes = named.as_deref().into_iter().chain(is_part.then_some(""));
        let pixels = prefixes.clone().find_map(|prefix| colors(file, part, prefix));
        let single = || layer.and_then(|layer| grey(file, part, layer));
        Some((part, pixels.or_else(single).or_else(|| prefixes.clone().find_map(|p| first(file, part, p)))?))
    })
}

/// Three channels with a prefix as RGB, with alpha if there is one.
fn colors(file: &Layered, part: usize, prefix: &str) -> Option<Vec<[f32; 4]>> {
    let triple = |letters: [&str; 3]| {
        let names = letters.map(|letter| format!("{prefix}{letter}"));
        file.triple(part, names.each_ref().map(String::as_str))
    };
    let is_color = is_color(prefix.trim_end_matches(|c: char| c == '.' || c.is_ascii_digit()));
    let mut rgb = triple(["R", "G", "B"]);
    rgb.iter_mut().filter(|_| is_color).for_each(|rgb| to_rec709(file, rgb));
    let [r, g, b] = rgb.or_else(|| triple(["X", "Y", "Z"]))?;
    let alpha = file.values(part, &format!("{prefix}A")).unwrap_or_else(|| vec![1.0; r.len()]);
    Some((0..r.len()).map(|i| [r[i], g[i], b[i], alpha[i]]).collect())
}

/// One channel as opaque grey.
fn grey(file: &Layered, part: usize, name: &str) -> Option<Vec<[f32; 4]>> {
    Some(file.values(part, name)?.into_iter().map(|v| [v, v, v, 1.0]).collect())
}

/// The luminance channel Y of a layer with alpha, or its first channel, preferring others to alpha, as grey.
fn first(file: &Layered, part: usize, prefix: &str) -> Option<Vec<[f32; 4]>> {
    let letter =
        |name: &str| name.strip_prefix(prefix).filter(|letter| !letter.contains('.')).map(str::to_string);
    let mut letters: Vec<String> =
        file.channels(part).iter().filter_map(|channel| letter(&channel.name)).collect();
    letters.sort_by_key(|letter| (letter != "Y", letter == "A"));
    let mut pixels = grey(file, part, &format!("{prefix}{}", letters.first()?))?;
    if letters[0] == "Y"
        && let Some(alpha) = file.values(part, &format!("{prefix}A"))
    {
        pixels.iter_mut().zip(alpha).for_each(|(pixel, alpha)| pixel[3] = alpha);
    }
    Some(pixels)
}

fn no_layer(file: &Layered, args: &ConvertArgs, path: &Path) -> Error {
    let mut layers: Vec<String> = (0..file.len())
        .flat_map(|part| file.channels(part))
        .map(|channel| {
            channel.name.rsplit_once('.').map_or(channel.name.clone(), |(layer, _)| layer.to_string())
        })
        .collect();
    layers.sort();
    layers.dedup();
    let message = match &args.layer {
        Some(layer) => format!("has no layer '{layer}'"),
        None => "has no channels".to_string(),
    };
    Error::input(path, message).with_help(format!("it has {}", layers.join(", ")))
}

// Contact sheet: thumbnails of all layers of an EXR with their names.

/// Maximum width of a thumbnail, pixels.
const MAX_WIDTH: usize = 240;
/// Distance between thumbnails, pixels.
const GAP: usize = 8;
/// Height of a label with its gap, pixels.
const LABEL_HEIGHT: usize = 14;
const BACKGROUND: [u8; 3] = [24, 24, 26];
const LABEL_COLOR: [u8; 3] = [214, 214, 208];

/// Depths from here on are background, metres.
const MIN_BACKGROUND_DEPTH: f32 = 1e9;

/// An RGB image of 8 bits per channel.
pub(super) struct Sheet {
    pub width: usize,
    pub height: usize,
    pub data: Vec<u8>,
}

/// Visualization of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Through the view transform.
    Color,
    /// Grey, white for the maximum.
    Scalar,
    /// Square root, white for the maximum.
    Variance,
    /// Near is bright.
    Depth,
    /// Components from -1 to 1 as colours.
    Vector,
    /// Components from minimum to maximum as colours.
    Position,
    /// Motion vectors as colours, relative to the maximum component.
    Motion,
    /// Fractional parts as red and green.
    Uv,
    /// A random colour per id; the second channel, if any, is the coverage.
    Id,
}

/// Channels of a part with the same prefix.
struct Layer {
    part: usize,
    name: String,
    kind: Kind,
    /// Names of the displayed channels.
    channels: Vec<String>,
}

/// The layers of a file, in file order.
fn layers(file: &Layered) -> Vec<Layer> {
    let mut list: Vec<Layer> = Vec::new();
    for part in 0..file.len() {
        for channel in file.channels(part) {
            let name = file.plain_name(part, &channel.name);
            let layer = name.rsplit_once('.').map_or("", |(layer, _)| layer);
            let layer = if name == "Z" || name == "samples" { &name } else { layer };
            match list.iter_mut().find(|known| known.part == part && known.name == layer) {
                Some(known) => known.channels.push(name.clone()),
                None => {
                    let kind =
                        if channel.kind == "uint" && name != "samples" { Kind::Id } else { Kind::Scalar };
                    list.push(Layer { part, name: layer.to_string(), kind, channels: vec![name] });
                }
            }
        }
    }
    // Only the first ranks of mattes are shown.
    list.retain(|layer| !layer.name.starts_with("Crypto") || layer.name.ends_with("00"));
    list.iter_mut().for_each(Layer::arrange);
    list
}

impl Layer {
    /// Determines the kind from the channel names, and sorts the channels.
    fn arrange(&mut self) {
        let has = |letter: &str| self.channels.iter().any(|name| name.rsplit('.').next() == Some(letter));
        let plain = self.name.trim_end_matches(|c: char| c.is_ascii_digit());
        let (kind, letters): (Kind, &[&str]) = match plain {
            "Z" | "nearest" => (Kind::Depth, &["Z"]),
            _ if plain.starts_with("Crypto") => (Kind::Id, &["R", "G"]),
            _ if has("R") && has("G") && has("B") && is_color(plain) => (Kind::Color, &["R", "G", "B", "A"]),
            "variance" => (Kind::Variance, &["R", "G", "B"]),
            "Vector" => (Kind::Motion, &["X", "Y"]),
            "P" => (Kind::Position, &["X", "Y", "Z"]),
            _ if has("X") && has("Y") && has("Z") => (Kind::Vector, &["X", "Y", "Z"]),
            _ if has("U") && has("V") => (Kind::Uv, &["U", "V"]),
            _ => return self.channels.truncate(1),
        };
        let find = |letter: &&str| {
            self.channels.iter().find(|name| name.rsplit('.').next() == Some(letter)).cloned()
        };
        let found: Vec<String> = letters.iter().filter_map(find).collect();
        // Alpha is optional; if another channel is missing, only the first is shown.
        if found.len() + usize::from(kind == Kind::Color) < letters.len() {
            return self.channels.truncate(1);
        }
        self.channels = found;
        self.kind = kind;
    }

    /// The name for `--layer`; the channel names for the picture itself.
    fn label(&self) -> String {
        if self.name.is_empty() { self.channels.join(" ") } else { self.name.clone() }
    }

    /// The layer at its size, in the display window.
    fn encode(
        &self,
        file: &Layered,
        format: Format,
        options: &PngOptions,
    ) -> std::result::Result<Vec<u8>, String> {
        let data = self.picture(file, file.size(self.part).into(), options);
        let ([width, height], pixels) = file.in_display_window(self.part, data.as_chunks::<3>().0);
        encode_rgb8(pixels.as_flattened(), width as u32, height as u32, format)
    }

    /// The thumbnail of this size, 8-bit RGB.
    fn picture(&self, file: &Layered, (width, height): (usize, usize), options: &PngOptions) -> Vec<u8> {
        let full = file.size(self.part);
        let mut planes: Vec<Vec<f32>> = self
            .channels
            .iter()
            .map(|name| {
                let values = file.values(self.part, name).unwrap_or_default();
                downsampled(&values, full, (width, height), self.kind)
            })
            .collect();
        let pixels = width * height;
        if self.kind == Kind::Color {
            let mut rgb = [0, 1, 2].map(|c| std::mem::take(&mut planes[c]));
            to_rec709(file, &mut rgb);
            planes.splice(..3, rgb);
            let at = |c: usize, i: usize| planes.get(c).map_or(1.0, |plane| plane[i]);
            let rgba: Vec<[f32; 4]> = (0..pixels).map(|i| [at(0, i), at(1, i), at(2, i), at(3, i)]).collect();
            let linear = Linear { width: width as u32, height: height as u32, rgba: &rgba };
            return display_rgba8(&linear, options)
                .chunks_exact(4)
                .flat_map(|p| [p[0], p[1], p[2]])
                .collect();
        }
        let ranges: Vec<(f32, f32)> = planes.iter().map(|plane| range(plane, self.kind)).collect();
        let color = |i: usize| shown(self.kind, &planes, &ranges, i).map(|v| (v * 255.0 + 0.5) as u8);
        (0..pixels).flat_map(color).collect()
    }
}

/// Box-filtered pixels; nearest neighbour for ids, positions and UVs.
fn downsampled(values: &[f32], full: [usize; 2], (width, height): (usize, usize), kind: Kind) -> Vec<f32> {
    let cover = |i: usize, small: usize, full: usize| {
        let start = i * full / small;
        start..((i + 1) * full / small).max(start + 1)
    };
    let has_mean = !matches!(kind, Kind::Id | Kind::Position | Kind::Uv);
    let is_valid = |v: &f32| v.is_finite() && !(kind == Kind::Depth && *v >= MIN_BACKGROUND_DEPTH);
    let one = |x: usize, y: usize| {
        let (columns, rows) = (cover(x, width, full[0]), cover(y, height, full[1]));
        if !has_mean {
            return values[rows.start * full[0] + columns.start];
        }
        let covered = rows.flat_map(|row| columns.clone().map(move |column| values[row * full[0] + column]));
        let (sum, count) =
            covered.filter(is_valid).fold((0.0f64, 0u32), |(sum, n), v| (sum + f64::from(v), n + 1));
        let empty = if kind == Kind::Depth { MIN_BACKGROUND_DEPTH } else { 0.0 };
        if count == 0 { empty } else { (sum / f64::from(count)) as f32 }
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| one(x, y)).collect()
}

/// Minimum and maximum of the valid values; both 0 if there are none.
fn range(values: &[f32], kind: Kind) -> (f32, f32) {
    let valid = values
        .iter()
        .copied()
        .filter(|v| v.is_finite() && !(kind == Kind::Depth && *v >= MIN_BACKGROUND_DEPTH));
    let (min, max) = valid.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if min <= max { (min, max) } else { (0.0, 0.0) }
}

/// A value relative to a range, clamped to 0..1.
fn normalized(v: f32, (min, max): (f32, f32)) -> f32 {
    let t = (v - min) / (max - min);
    if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 }
}

/// Display colour of a pixel, 0 to 1.
fn shown(kind: Kind, planes: &[Vec<f32>], ranges: &[(f32, f32)], i: usize) -> [f32; 3] {
    let at = |c: usize| planes.get(c).map_or(0.0, |plane| plane[i]);
    let max = ranges.iter().fold(0.0f32, |max, (a, b)| max.max(a.abs()).max(b.abs()));
    match kind {
        Kind::Color | Kind::Scalar => [normalized(at(0), (0.0, max)); 3],
        Kind::Variance => [0, 1, 2].map(|c| normalized(at(c).max(0.0).sqrt(), (0.0, max.sqrt()))),
        Kind::Depth if at(0) >= MIN_BACKGROUND_DEPTH => [0.0; 3],
        Kind::Depth => [1.0 - 0.85 * normalized(at(0), ranges[0]); 3],
        Kind::Vector if (0..3).all(|c| at(c) == 0.0) => [0.0; 3],
        Kind::Vector => [0, 1, 2].map(|c| normalized(at(c), (-1.0, 1.0))),
        Kind::Position => [0, 1, 2].map(|c| normalized(at(c), ranges[c])),
        Kind::Motion => [normalized(at(0), (-max, max)), normalized(at(1), (-max, max)), 0.5],
        Kind::Uv => [at(0).rem_euclid(1.0), at(1).rem_euclid(1.0), 0.0].map(|v| normalized(v, (0.0, 1.0))),
        Kind::Id => {
            let coverage = if planes.len() > 1 { at(1).clamp(0.0, 1.0) } else { 1.0 };
            color_of(at(0).to_bits()).map(|v| v * coverage)
        }
    }
}

/// A random colour for an id; black for 0.
pub(super) fn color_of(id: u32) -> [f32; 3] {
    if id == 0 {
        return [0.0; 3];
    }
    // Knuth's multiplicative hash.
    let hash = id.wrapping_mul(2_654_435_761).rotate_right(9).wrapping_mul(2_654_435_761);
    [0, 8, 16].map(|shift| 0.25 + 0.75 * (hash >> shift & 0xff) as f32 / 255.0)
}

/// The contact sheet of all layers.
pub(super) fn sheet(file: &Layered, options: &PngOptions) -> Sheet {
    let layers = layers(file);
    let size = |layer: &Layer| {
        let [width, height] = file.size(layer.part);
        let small = width.clamp(1, MAX_WIDTH);
        (small, (height * small / width.max(1)).max(1))
    };
    let (tile, tall) = layers.iter().map(size).fold((1, 1), |(w, h), (w2, h2)| (w.max(w2), h.max(h2)));
    let columns = (1..layers.len())
        .find(|c| c * (tile + GAP) * 3 >= layers.len().div_ceil(*c) * (tall + LABEL_HEIGHT + GAP) * 4);
    let columns = columns.unwrap_or(layers.len()).max(1);
    let rows = layers.len().div_ceil(columns).max(1);
    let (width, height) = (columns * (tile + GAP) + GAP, rows * (tall + LABEL_HEIGHT + GAP) + GAP);
    let mut sheet = Sheet { width, height, data: BACKGROUND.repeat(width * height) };
    for (i, layer) in layers.iter().enumerate() {
        let (left, top) = (GAP + i % columns * (tile + GAP), GAP + i / columns * (tall + LABEL_HEIGHT + GAP));
        let (w, h) = size(layer);
        let picture = layer.picture(file, (w, h), options);
        for (y, row) in picture.chunks_exact(3 * w).enumerate() {
            let at = 3 * ((top + y) * width + left);
            sheet.data[at..at + 3 * w].copy_from_slice(row);
        }
        let letters = tile / GLYPH_WIDTH;
        let label: String = layer.label().chars().take(letters).collect();
        glyph_points(&label, |x, y| {
            let at = 3 * ((top + tall + 4 + y) * width + left + x);
            sheet.data[at..at + 3].copy_from_slice(&LABEL_COLOR);
        });
    }
    sheet
}

/// Converts colours from the primaries of the file's header to linear Rec. 709, for view transforms.
pub(super) fn to_rec709(file: &Layered, rgb: &mut [Vec<f32>; 3]) {
    let Some(matrix) = file.primaries().and_then(|primaries| primaries.to_rec709()) else { return };
    for i in 0..rgb[0].len() {
        let color = converted(&matrix, [0, 1, 2].map(|c| rgb[c][i]));
        rgb.iter_mut().zip(color).for_each(|(plane, value)| plane[i] = value);
    }
}

/// Width of a glyph, pixels.
pub(super) const GLYPH_WIDTH: usize = 8;

/// Calls `point` with x and y of all set pixels of a line of text in an 8 x 8 font, relative to the upper left corner. Other
/// characters than ASCII become question marks.
pub(super) fn glyph_points(text: &str, mut point: impl FnMut(usize, usize)) {
    for (i, c) in text.chars().enumerate() {
        let glyph = BASIC_LEGACY.get(c as usize).unwrap_or(&BASIC_LEGACY[usize::from(b'?')]);
        for (y, bits) in glyph.iter().enumerate() {
            (0..GLYPH_WIDTH).filter(|x| bits >> x & 1 == 1).for_each(|x| point(GLYPH_WIDTH * i + x, y));
        }
    }
}

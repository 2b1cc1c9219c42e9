//! `oscura convert`: a layer of an EXR, or of a sequence of them, as a picture to look at.

use super::parsers::Frames;
use super::picture_args::ConvertArgs;
use super::pictures::{AnimationFiles, is_moving};
use super::process::Outcome;
use font8x8::legacy::BASIC_LEGACY;
use oscura::color::converted;
use oscura::error::{Error, Result};
use oscura::film::Aov;
use oscura::load::image::{Layered, load_layered};
use oscura::output::{
    Format, Linear, PngOptions, check_target, encode_rgb8, encode_shown, is_color, shown8, write_atomically,
};
use std::path::Path;

pub(crate) fn run(args: &ConvertArgs) -> Result<Outcome> {
    if is_moving(&args.output) {
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
            Error::usage("--sheet is made to look at, and .hdr is linear").with_help("write a .png or .jpg")
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
    let (bytes, invalid) = match args.sheet {
        true => (encode_sheet(&file, format, &options), None),
        false => {
            let ([width, height], rgba) = pixels(&file, args, picture)?;
            let linear = Linear { width, height, rgba: &rgba };
            (encode_shown(&linear, format, &options), invalid(&rgba))
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

/// Makes one animation of a sequence.
fn animate(args: &ConvertArgs) -> Result<Outcome> {
    if !Frames::is_pattern(&args.picture) || args.sheet {
        let message = format!("{}: an animation needs the pictures of a sequence", args.output.display());
        return Err(
            Error::usage(message).with_help("name them by #### in place of their numbers, without --sheet")
        );
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

/// The layer of a file that is to be seen, and its size.
fn pixels(file: &Layered, args: &ConvertArgs, path: &Path) -> Result<([u32; 2], Vec<[f32; 4]>)> {
    let layer = args.layer.as_deref();
    let found = find(file, layer).or_else(|| find(file, Some(layer_of_pass(layer?)?)));
    let (part, rgba) = found.ok_or_else(|| no_layer(file, args, path))?;
    let (size, rgba) = file.in_display_window(part, &rgba);
    Ok((size.map(|length| length as u32), rgba))
}

/// The layer of a pass by its name for `--aov`: `Z` of `depth`.
fn layer_of_pass(name: &str) -> Option<&'static str> {
    let channel = *Aov::from_option(name)?.info().names.first()?;
    Some(channel.rsplit_once('.').map_or(channel, |(layer, _)| layer))
}

/// How many values are no numbers that a picture could show, if some are.
fn invalid(rgba: &[[f32; 4]]) -> Option<String> {
    let values = rgba.as_flattened();
    let of = |is: fn(f32) -> bool| values.iter().filter(|v| is(**v)).count();
    let (nan, infinite, all) = (of(f32::is_nan), of(f32::is_infinite), values.len());
    (nan + infinite > 0).then(|| {
        format!("of {all} values {nan} are NaN, shown as 0, and {infinite} infinite, shown as the least or the most")
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

/// The pixels of a layer, and which part has it. A layer is what channels' names have before the last dot, a part's name, or
/// a channel that stands alone; without one it is the picture itself.
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

/// Three channels as red, green and blue; alpha if there is any.
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

/// One channel as grey.
fn grey(file: &Layered, part: usize, name: &str) -> Option<Vec<[f32; 4]>> {
    Some(file.values(part, name)?.into_iter().map(|v| [v, v, v, 1.0]).collect())
}

/// The luminance of a layer, or its only channel, whatever its letter; alpha is no picture of its own.
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

// All layers of an EXR beside each other, small, with their names: what a file holds at a glance.

/// Widest picture of a layer, pixels.
const WIDEST: usize = 240;
const GAP: usize = 8;
/// Height of a line of text with its gap.
const LINE: usize = 14;
const PAPER: [u8; 3] = [24, 24, 26];
const INK: [u8; 3] = [214, 214, 208];

/// Depths from here on are backgrounds.
const FAR: f32 = 1e9;

/// A picture of 8-bit red, green and blue.
pub(super) struct Sheet {
    pub width: usize,
    pub height: usize,
    pub data: Vec<u8>,
}

/// How a layer is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Through the view.
    Color,
    /// Grey, white for the largest value.
    Amount,
    /// Grey by the square root, white for the largest value.
    Variance,
    /// Bright is near.
    Depth,
    /// Components from -1 to 1 as colours.
    Direction,
    /// Components from the least to the largest as colours.
    Place,
    /// Ways in the picture: as directions, the largest way being 1.
    Way,
    /// Fractions as red and green.
    Uv,
    /// Numbers and hashes, a colour each; the second channel, if there is one, is the share.
    Id,
}

/// Some channels of a part with one name before their last dot.
struct Layer {
    part: usize,
    name: String,
    kind: Kind,
    /// Names of the channels that are shown.
    channels: Vec<String>,
}

/// The layers of a file in its order.
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
                        if channel.kind == "uint" && name != "samples" { Kind::Id } else { Kind::Amount };
                    list.push(Layer { part, name: layer.to_string(), kind, channels: vec![name] });
                }
            }
        }
    }
    // Further ranks of mattes say nothing by themselves.
    list.retain(|layer| !layer.name.starts_with("Crypto") || layer.name.ends_with("00"));
    list.iter_mut().for_each(Layer::arrange);
    list
}

impl Layer {
    /// Finds the kind by the channels' letters, and puts these in order.
    fn arrange(&mut self) {
        let has = |letter: &str| self.channels.iter().any(|name| name.rsplit('.').next() == Some(letter));
        let plain = self.name.trim_end_matches(|c: char| c.is_ascii_digit());
        let (kind, letters): (Kind, &[&str]) = match plain {
            "Z" | "nearest" => (Kind::Depth, &["Z"]),
            _ if plain.starts_with("Crypto") => (Kind::Id, &["R", "G"]),
            _ if has("R") && has("G") && has("B") && is_color(plain) => (Kind::Color, &["R", "G", "B", "A"]),
            "variance" => (Kind::Variance, &["R", "G", "B"]),
            "Vector" => (Kind::Way, &["X", "Y"]),
            "P" => (Kind::Place, &["X", "Y", "Z"]),
            _ if has("X") && has("Y") && has("Z") => (Kind::Direction, &["X", "Y", "Z"]),
            _ if has("U") && has("V") => (Kind::Uv, &["U", "V"]),
            _ => return self.channels.truncate(1),
        };
        let find = |letter: &&str| {
            self.channels.iter().find(|name| name.rsplit('.').next() == Some(letter)).cloned()
        };
        let found: Vec<String> = letters.iter().filter_map(find).collect();
        // Alpha may be missing; where others are, one channel is shown as it is.
        if found.len() + usize::from(kind == Kind::Color) < letters.len() {
            return self.channels.truncate(1);
        }
        self.channels = found;
        self.kind = kind;
    }

    /// Its name for `--layer`; empty for the picture's own channels.
    fn label(&self) -> String {
        if self.name.is_empty() { self.channels.join(" ") } else { self.name.clone() }
    }

    /// Its picture, so wide and high, red, green and blue.
    fn picture(&self, file: &Layered, (width, height): (usize, usize), options: &PngOptions) -> Vec<u8> {
        let full = file.size(self.part);
        let mut planes: Vec<Vec<f32>> = self
            .channels
            .iter()
            .map(|name| {
                let values = file.values(self.part, name).unwrap_or_default();
                smaller(&values, full, (width, height), self.kind)
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
            return shown8(&linear, options).chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        }
        let ranges: Vec<(f32, f32)> = planes.iter().map(|plane| range(plane, self.kind)).collect();
        let color = |i: usize| shown(self.kind, &planes, &ranges, i).map(|v| (v * 255.0 + 0.5) as u8);
        (0..pixels).flat_map(color).collect()
    }
}

/// Means of the pixels that fall together; of ids, which have none, and of places one of them.
fn smaller(values: &[f32], full: [usize; 2], (width, height): (usize, usize), kind: Kind) -> Vec<f32> {
    let cover = |i: usize, small: usize, full: usize| {
        let start = i * full / small;
        start..((i + 1) * full / small).max(start + 1)
    };
    let has_mean = !matches!(kind, Kind::Id | Kind::Place | Kind::Uv);
    let is_meant = |v: &f32| v.is_finite() && !(kind == Kind::Depth && *v >= FAR);
    let one = |x: usize, y: usize| {
        let (columns, rows) = (cover(x, width, full[0]), cover(y, height, full[1]));
        if !has_mean {
            return values[rows.start * full[0] + columns.start];
        }
        let covered = rows.flat_map(|row| columns.clone().map(move |column| values[row * full[0] + column]));
        let (sum, count) =
            covered.filter(is_meant).fold((0.0f64, 0u32), |(sum, n), v| (sum + f64::from(v), n + 1));
        let empty = if kind == Kind::Depth { FAR } else { 0.0 };
        if count == 0 { empty } else { (sum / f64::from(count)) as f32 }
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| one(x, y)).collect()
}

/// The minimum and the maximum value that are shown; both 0 where there is none.
fn range(values: &[f32], kind: Kind) -> (f32, f32) {
    let meant = values.iter().copied().filter(|v| v.is_finite() && !(kind == Kind::Depth && *v >= FAR));
    let (least, most) = meant.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if least <= most { (least, most) } else { (0.0, 0.0) }
}

/// A share of a range in 0..1.
fn share(v: f32, (least, most): (f32, f32)) -> f32 {
    let share = (v - least) / (most - least);
    if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
}

/// The colour of a pixel, 0..1 as displays take it.
fn shown(kind: Kind, planes: &[Vec<f32>], ranges: &[(f32, f32)], i: usize) -> [f32; 3] {
    let at = |c: usize| planes.get(c).map_or(0.0, |plane| plane[i]);
    let most = ranges.iter().fold(0.0f32, |most, (a, b)| most.max(a.abs()).max(b.abs()));
    match kind {
        Kind::Color | Kind::Amount => [share(at(0), (0.0, most)); 3],
        Kind::Variance => [0, 1, 2].map(|c| share(at(c).max(0.0).sqrt(), (0.0, most.sqrt()))),
        Kind::Depth if at(0) >= FAR => [0.0; 3],
        Kind::Depth => [1.0 - 0.85 * share(at(0), ranges[0]); 3],
        Kind::Direction if (0..3).all(|c| at(c) == 0.0) => [0.0; 3],
        Kind::Direction => [0, 1, 2].map(|c| share(at(c), (-1.0, 1.0))),
        Kind::Place => [0, 1, 2].map(|c| share(at(c), ranges[c])),
        Kind::Way => [share(at(0), (-most, most)), share(at(1), (-most, most)), 0.5],
        Kind::Uv => [at(0).rem_euclid(1.0), at(1).rem_euclid(1.0), 0.0].map(|v| share(v, (0.0, 1.0))),
        Kind::Id => {
            let coverage = if planes.len() > 1 { at(1).clamp(0.0, 1.0) } else { 1.0 };
            color_of(at(0).to_bits()).map(|v| v * coverage)
        }
    }
}

/// A colour that stands for an id; black for none.
fn color_of(id: u32) -> [f32; 3] {
    if id == 0 {
        return [0.0; 3];
    }
    // Knuth's multiplicative hash.
    let hash = id.wrapping_mul(2_654_435_761).rotate_right(9).wrapping_mul(2_654_435_761);
    [0, 8, 16].map(|shift| 0.25 + 0.75 * (hash >> shift & 0xff) as f32 / 255.0)
}

/// Puts all layers onto one sheet.
pub(super) fn sheet(file: &Layered, options: &PngOptions) -> Sheet {
    let layers = layers(file);
    let size = |layer: &Layer| {
        let [width, height] = file.size(layer.part);
        let small = width.clamp(1, WIDEST);
        (small, (height * small / width.max(1)).max(1))
    };
    let (tile, tall) = layers.iter().map(size).fold((1, 1), |(w, h), (w2, h2)| (w.max(w2), h.max(h2)));
    let columns = (1..layers.len())
        .find(|c| c * (tile + GAP) * 3 >= layers.len().div_ceil(*c) * (tall + LINE + GAP) * 4);
    let columns = columns.unwrap_or(layers.len()).max(1);
    let rows = layers.len().div_ceil(columns).max(1);
    let (width, height) = (columns * (tile + GAP) + GAP, rows * (tall + LINE + GAP) + GAP);
    let mut sheet = Sheet { width, height, data: PAPER.repeat(width * height) };
    for (i, layer) in layers.iter().enumerate() {
        let (left, top) = (GAP + i % columns * (tile + GAP), GAP + i / columns * (tall + LINE + GAP));
        let (w, h) = size(layer);
        let picture = layer.picture(file, (w, h), options);
        for (y, row) in picture.chunks_exact(3 * w).enumerate() {
            let at = 3 * ((top + y) * width + left);
            sheet.data[at..at + 3 * w].copy_from_slice(row);
        }
        let letters = tile / WIDTH;
        let label: String = layer.label().chars().take(letters).collect();
        glyph_points(&label, |x, y| {
            let at = 3 * ((top + tall + 4 + y) * width + left + x);
            sheet.data[at..at + 3].copy_from_slice(&INK);
        });
    }
    sheet
}

// Colours of files as views take them.

/// Colours of another space, which the file names, become linear Rec. 709, which views are for.
pub(super) fn to_rec709(file: &Layered, rgb: &mut [Vec<f32>; 3]) {
    let Some(matrix) = file.primaries().and_then(|primaries| primaries.to_rec709()) else { return };
    for i in 0..rgb[0].len() {
        let color = converted(&matrix, [0, 1, 2].map(|c| rgb[c][i]));
        rgb.iter_mut().zip(color).for_each(|(plane, value)| plane[i] = value);
    }
}

// Letters of 8 x 8 pixels.

/// Width of a letter, pixels.
pub(super) const WIDTH: usize = 8;

/// Hands on the points of a line of text, in pixels to the right and down from its corner. What is not ASCII is a question mark.
pub(super) fn glyph_points(text: &str, mut point: impl FnMut(usize, usize)) {
    for (i, c) in text.chars().enumerate() {
        let glyph = BASIC_LEGACY.get(c as usize).unwrap_or(&BASIC_LEGACY[usize::from(b'?')]);
        for (y, bits) in glyph.iter().enumerate() {
            (0..WIDTH).filter(|x| bits >> x & 1 == 1).for_each(|x| point(WIDTH * i + x, y));
        }
    }
}

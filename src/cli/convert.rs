//! `oscura convert`: a layer of an EXR as a picture to look at.

use super::Outcome;
use super::picture_args::ConvertArgs;
use super::rec709::to_rec709;
use super::sheet::{Sheet, sheet};
use oscura::error::{Error, Result};
use oscura::load::image::{Layered, load_layered};
use oscura::output::{
    Format, Linear, PngOptions, check_target, encode_rgb8, encode_shown, is_color, write_atomically,
};

pub(crate) fn run(args: &ConvertArgs) -> Result<Outcome> {
    let format = Format::of(&args.output)?;
    if format == Format::Exr {
        return Err(Error::usage(format!(
            "{}: is an EXR, which 'convert' does not write",
            args.output.display()
        ))
        .with_help("end the name in .png, .jpg, .tif, .webp or .hdr"));
    }
    if args.sheet && format == Format::Hdr {
        return Err(
            Error::usage("--sheet is made to look at, and .hdr is linear").with_help("write a .png or .jpg")
        );
    }
    check_target(&args.output)?;
    let file = load_layered(&args.picture)?;
    let options = PngOptions {
        view: args.view.clone(),
        exposure: args.exposure,
        white_balance: args.white_balance,
        dither: args.dither,
        deep: args.deep,
        opaque: false,
    };
    let (bytes, invalid) = match args.sheet {
        true => (encode_sheet(&file, format, &options), None),
        false => {
            let (part, rgba) = find(&file, args.layer.as_deref()).ok_or_else(|| no_layer(&file, args))?;
            let [width, height] = file.size(part);
            let picture = Linear { width: width as u32, height: height as u32, rgba: &rgba };
            (encode_shown(&picture, format, &options), invalid(&rgba))
        }
    };
    let bytes = bytes.map_err(|message| Error::output(&args.output, message))?;
    write_atomically(&args.output, &bytes)?;
    if !args.quiet {
        invalid.iter().for_each(|note| say!("note: {note}"));
        say!("wrote    {}", args.output.display());
    }
    Ok(Outcome::Done)
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

fn no_layer(file: &Layered, args: &ConvertArgs) -> Error {
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
    Error::input(&args.picture, message).with_help(format!("it has {}", layers.join(", ")))
}

//! `oscura denoise`: denoises the picture of a file.

use super::outcome::Outcome;
use super::picture_args::DenoiseArgs;
use oscura::denoise::{Guides, NAME, Noise, Noisy, denoise, slices};
use oscura::error::{Error, Result};
use oscura::film::LIGHT_GROUP;
use oscura::load::image::{Layered, load_layered};
use oscura::output::{DENOISED, Format, check_target, encode_layered, write_atomically};
use oscura::render::in_pool;
use std::path::Path;
use std::time::Instant;

const RGB: [&str; 3] = ["R", "G", "B"];

/// Layers with red, green and blue that are no light.
const DATA: [&str; 6] = ["albedo.", "denoising_albedo.", "variance.", "DiffCol.", "GlossCol.", "TransCol."];

pub(crate) fn run(args: &DenoiseArgs) -> Result<Outcome> {
    if Format::of(&args.output)? != Format::Exr {
        return Err(Error::usage(format!("{}: what is denoised is written as .exr", args.output.display()))
            .with_help("'oscura convert' makes other files of it"));
    }
    check_target(&args.output)?;
    in_pool(args.threads.map(usize::from), || denoise_file(args))?
}

fn denoise_file(args: &DenoiseArgs) -> Result<Outcome> {
    let start = Instant::now();
    let first = load_layered(&args.picture)?;
    let part = part_with_color(&first, &args.picture)?;
    let second = args.other_seed.as_deref().map(|path| other(path, &first, part)).transpose()?;
    let mut file = first.clone();
    if let Some(second) = &second {
        average(&mut file, second);
    }
    let layers = Layers::of(&file, part);
    let deviations = second.as_ref().and_then(|second| half_difference(&first, second, part));
    let noise = match (&deviations, &layers.variance) {
        (Some(deviations), _) => Noise::Deviations(slices(deviations)),
        (None, Some(variance)) => Noise::Variance(slices(variance)),
        (None, None) => Noise::Unknown,
    };
    let load_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let [width, height] = file.size(part);
    let result = denoise(&Noisy {
        width,
        height,
        color: slices(&layers.color),
        noise,
        guides: layers.guides(),
        parts: layers.sets().map(|set| set.map(|(_, part)| slices(part)).collect()).collect(),
    });
    let denoise_s = start.elapsed().as_secs_f64();
    let prefixes = std::iter::once("").chain(layers.sets().flatten().map(|(prefix, _)| prefix.as_str()));
    for (prefix, values) in prefixes.zip(std::iter::once(&result.color).chain(result.parts.iter().flatten()))
    {
        for (letter, values) in RGB.iter().zip(values) {
            let name = format!("{prefix}{letter}");
            let Some(part) = file.part_with(part, &name) else { continue };
            file.set_values(part, &name, values);
        }
    }
    let by = format!("{NAME}; guides {}; noise {}", layers.guides().names(), name_of(&noise));
    (0..file.len()).for_each(|part| file.set_attribute(part, DENOISED, &by));
    let bytes = encode_layered(&file).map_err(|message| Error::output(&args.output, message))?;
    write_atomically(&args.output, &bytes)?;
    if !args.quiet {
        args.denoiser.notes().iter().for_each(|note| say!("note: {note}"));
        say!("guides   {}; noise {}", layers.guides().names(), name_of(&noise));
        say!("time     load {load_s:.3} s, denoise {denoise_s:.3} s");
        say!("wrote    {}", args.output.display());
    }
    Ok(Outcome::Done)
}

/// What of a file denoising looks at.
struct Layers {
    color: [Vec<f32>; 3],
    variance: Option<[Vec<f32>; 3]>,
    albedo: Option<[Vec<f32>; 3]>,
    normal: Option<[Vec<f32>; 3]>,
    /// Light passes and groups of lights, by what stands before `R`.
    parts: Vec<(String, [Vec<f32>; 3])>,
}

impl Layers {
    /// Those of a part with a picture, and of others of its size.
    fn of(file: &Layered, part: usize) -> Layers {
        let is_light = |prefix: &str| {
            !prefix.is_empty()
                && !DATA.contains(&prefix)
                && !prefix.to_ascii_lowercase().starts_with("crypto")
        };
        let triple = |names: [&str; 3]| file.triple(file.part_with(part, names[0])?, names);
        let names_in = |part| {
            let names = file.channels(part).into_iter().map(move |c| file.plain_name(part, &c.name));
            names.collect::<Vec<String>>()
        };
        let all = (0..file.len()).filter(|&other| file.size(other) == file.size(part)).flat_map(names_in);
        let prefixes = all.filter_map(|name| Some(name.strip_suffix('R')?.to_string()));
        let parts = prefixes.filter(|prefix| is_light(prefix)).filter_map(|prefix| {
            let names = RGB.map(|letter| format!("{prefix}{letter}"));
            let values = triple(names.each_ref().map(String::as_str))?;
            Some((prefix, values))
        });
        Layers {
            color: triple(RGB).unwrap_or_default(),
            variance: triple(["variance.R", "variance.G", "variance.B"]),
            albedo: triple(["denoising_albedo.R", "denoising_albedo.G", "denoising_albedo.B"])
                .or_else(|| triple(["albedo.R", "albedo.G", "albedo.B"])),
            normal: triple(["denoising_normal.X", "denoising_normal.Y", "denoising_normal.Z"])
                .or_else(|| triple(["N.X", "N.Y", "N.Z"])),
            parts: parts.collect(),
        }
    }

    /// Light groups, and light passes: each of both adds up to the picture.
    fn sets(&self) -> impl Iterator<Item = impl Iterator<Item = &(String, [Vec<f32>; 3])>> {
        let is_group = |prefix: &str| prefix.starts_with(LIGHT_GROUP);
        [true, false]
            .map(|wanted| self.parts.iter().filter(move |(prefix, _)| is_group(prefix) == wanted))
            .into_iter()
    }

    fn guides(&self) -> Guides<'_> {
        Guides { albedo: self.albedo.as_ref().map(slices), normal: self.normal.as_ref().map(slices) }
    }
}

fn name_of(noise: &Noise) -> &'static str {
    match noise {
        Noise::Deviations(_) => "from another seed",
        Noise::Variance(_) => "from the variance",
        Noise::Unknown => "guessed",
    }
}

/// The first part with a picture.
fn part_with_color(file: &Layered, path: &Path) -> Result<usize> {
    let has = |part: &usize| file.triple(*part, RGB).is_some();
    (0..file.len()).find(has).ok_or_else(|| {
        Error::input(path, "has no channels R, G and B").with_help("it is they that are denoised")
    })
}

/// The same picture with another seed.
fn other(path: &Path, first: &Layered, part: usize) -> Result<Layered> {
    let other = load_layered(path)?;
    let fits =
        part < other.len() && other.size(part) == first.size(part) && other.triple(part, RGB).is_some();
    match fits {
        true => Ok(other),
        false => Err(Error::input(path, "is no picture of the same size and layers")
            .with_help("give the same picture, rendered with another seed")),
    }
}

/// Half of what two pictures differ by.
fn half_difference(first: &Layered, second: &Layered, part: usize) -> Option<[Vec<f32>; 3]> {
    let (first, second) = (first.triple(part, RGB)?, second.triple(part, RGB)?);
    let half = |(a, b): (&f32, &f32)| 0.5 * (a - b);
    Some([0, 1, 2].map(|c| first[c].iter().zip(&second[c]).map(half).collect()))
}

/// Averages all channels of floats that both have.
fn average(file: &mut Layered, other: &Layered) {
    let fits = |part: &usize| *part < other.len() && other.size(*part) == file.size(*part);
    let parts: Vec<usize> = (0..file.len()).filter(fits).collect();
    parts.into_iter().for_each(|part| average_part(file, other, part));
}

fn average_part(file: &mut Layered, other: &Layered, part: usize) {
    for channel in file.channels(part).iter().filter(|channel| channel.kind != "uint") {
        let name = file.plain_name(part, &channel.name);
        let is_matte = name.to_ascii_lowercase().starts_with("crypto");
        let both = file.values(part, &channel.name).zip(other.values(part, &channel.name));
        if let Some((a, b)) = both.filter(|_| !is_matte) {
            // The mean of two pictures has half the variance of one.
            let scale = if name.starts_with("variance.") { 0.25 } else { 0.5 };
            let mean: Vec<f32> = a.iter().zip(&b).map(|(a, b)| scale * (a + b)).collect();
            file.set_values(part, &channel.name, &mean);
        }
    }
}

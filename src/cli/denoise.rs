//! `oscura denoise`: denoises a picture, or the frames of a sequence.

use super::parsers::Frames;
use super::picture_args::DenoiseArgs;
use super::process::Outcome;
use oscura::denoise::temporal::{Averaged, Frame, Sequence, with_neighbours};
use oscura::denoise::{Denoised, NAME, Noise, NoisyLayers, slices};
use oscura::error::{Error, Result};
use oscura::load::image::{Layered, load_layered};
use oscura::output::{DENOISED, Format, check_target, encode_layered, is_same_target, write_atomically};
use oscura::render::in_pool;
use std::borrow::Cow;
use std::path::Path;
use std::time::Instant;

const RGB: [&str; 3] = ["R", "G", "B"];

/// Prefixes of RGB layers that are not radiance.
const DATA: [&str; 6] = ["albedo.", "denoising_albedo.", "variance.", "DiffCol.", "GlossCol.", "TransCol."];

pub(crate) fn run(args: &DenoiseArgs) -> Result<Outcome> {
    if Format::of(&args.output)? != Format::Exr {
        return Err(Error::usage(format!("{}: must be an .exr file", args.output.display()))
            .with_help("'oscura convert' converts them to other formats"));
    }
    let is_sequence = Frames::is_pattern(&args.picture);
    if args.frames.is_some() && !is_sequence {
        let message = format!("--frames is for sequences, but {} is one picture", args.picture.display());
        return Err(Error::usage(message).with_help("use #### instead of the frame number"));
    }
    in_pool(args.threads.map(usize::from), || {
        if is_sequence { denoise_sequence(args) } else { denoise_file(args) }
    })?
}

fn denoise_file(args: &DenoiseArgs) -> Result<Outcome> {
    check_target(&args.output)?;
    let start = Instant::now();
    let noisy = NoisyFile::load(&args.picture, args.other_seed.as_deref())?;
    let load_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let layers = noisy.layers();
    let (guides, noise) = (layers.guides().names(), name_of(&layers.noise()));
    let result = layers.denoised();
    drop(layers);
    let denoise_s = start.elapsed().as_secs_f64();
    noisy.write(&result, &description(guides, noise), &args.output)?;
    if !args.quiet {
        args.denoiser.notes().iter().for_each(|note| say!("note: {note}"));
        say!("guides   {guides}; noise {noise}");
        say!("time     load {load_s:.3} s, denoise {denoise_s:.3} s");
        say!("wrote    {}", args.output.display());
    }
    Ok(Outcome::Done)
}

/// A file with a noisy picture.
struct NoisyFile {
    file: Layered,
    /// Index of the part with the picture.
    part: usize,
    /// Half the difference to the picture with another seed, RGB planes.
    deviations: Option<[Vec<f32>; 3]>,
}

impl NoisyFile {
    /// Reads a file, and averages it with the same picture with another seed, if given.
    ///
    /// # Errors
    /// A file that can't be read or has no picture, or pictures that don't match.
    fn load(path: &Path, other_seed: Option<&Path>) -> Result<NoisyFile> {
        let first = load_layered(path)?;
        let part = part_with_color(&first, path)?;
        let second = other_seed.map(|path| load_other_seed(path, &first, part)).transpose()?;
        let deviations = second.as_ref().and_then(|second| half_difference(&first, second, part));
        let mut file = first;
        if let Some(second) = &second {
            average(&mut file, second);
        }
        Ok(NoisyFile { file, part, deviations })
    }

    /// The layers for the denoiser.
    fn layers(&self) -> NoisyLayers<'_> {
        let NoisyFile { file, part, deviations } = self;
        let layer = |names: [&str; 3]| file.planes(file.part_with(*part, names[0])?, names);
        let deviations = deviations.as_ref().map(|planes| slices(planes).map(Cow::Borrowed));
        let layers = NoisyLayers::read(file.size(*part), deviations, part_names(file, *part), layer);
        layers.expect("the part has a picture")
    }

    /// Writes the file with the denoised layers.
    fn write(self, result: &Denoised, by: &str, target: &Path) -> Result<()> {
        let names: Vec<String> = self.layers().names().map(str::to_string).collect();
        let NoisyFile { mut file, part, .. } = self;
        for (prefix, planes) in result.named(names.iter().map(String::as_str)) {
            for (letter, values) in RGB.iter().zip(planes) {
                let name = format!("{prefix}{letter}");
                let Some(part) = file.part_with(part, &name) else { continue };
                file.set_values(part, &name, values);
            }
        }
        (0..file.len()).for_each(|part| file.set_attribute(part, DENOISED, by));
        let bytes = encode_layered(&file).map_err(|message| Error::output(target, message))?;
        write_atomically(target, &bytes)
    }

    /// The frame for temporal denoising.
    ///
    /// # Errors
    /// A file without motion vectors.
    fn frame(&self, path: &Path) -> Result<Frame> {
        let vectors = MOTION.map(|name| {
            let part = self.file.part_with(self.part, name)?;
            self.file.values(part, name)
        });
        let [Some(a), Some(b), Some(c), Some(d)] = vectors else {
            return Err(Error::input(path, "has no motion vectors")
                .with_help("render frames with --aov denoising_albedo,denoising_normal,variance,motion"));
        };
        Ok(self.layers().frame([a, b, c, d]))
    }
}

/// Channels of motion vectors.
const MOTION: [&str; 4] = ["Vector.X", "Vector.Y", "Vector.Z", "Vector.W"];

/// Denoises the frames of a sequence, each with its neighbours.
fn denoise_sequence(args: &DenoiseArgs) -> Result<Outcome> {
    if !Frames::is_pattern(&args.output) || is_same_target(&args.picture, &args.output) {
        let message = format!("-o {}: a sequence needs another name with ####", args.output.display());
        return Err(Error::usage(message).with_help("such as -o clean.####.exr"));
    }
    let all = Frames::existing(&args.picture)?;
    let is_selected = |number: u32| args.frames.is_none_or(|frames| frames.contains(number));
    let numbers = with_neighbours(&all, is_selected);
    if numbers.is_empty() {
        return Err(Frames::missing(&args.picture));
    }
    let mut targets = numbers.iter().filter(|&&number| is_selected(number));
    targets.try_for_each(|&number| check_target(Frames::file(&args.output, number)))?;
    if !args.quiet {
        args.denoiser.notes().iter().for_each(|note| say!("note: {note}"));
    }
    let mut sequence = Sequence::default();
    for &number in &numbers {
        let path = Frames::file(&args.picture, number);
        let other_seed = args.other_seed.as_ref().map(|path| Frames::file(path, number));
        let file = NoisyFile::load(&path, other_seed.as_deref())?;
        let frame = file.frame(&path)?;
        let done = sequence.push(number, frame, is_selected(number).then_some(file));
        done.into_iter().try_for_each(|frame| write_frame(args, frame))?;
    }
    sequence.finish().into_iter().try_for_each(|frame| write_frame(args, frame))?;
    Ok(Outcome::Done)
}

/// Writes a frame of a sequence.
fn write_frame(args: &DenoiseArgs, frame: Averaged<NoisyFile>) -> Result<()> {
    let Averaged { number, item: file, picture, frames } = frame;
    let layers = file.layers();
    let denoiser = description(layers.guides().names(), name_of(&layers.noise()));
    drop(layers);
    let by = format!("{denoiser}; frames {}-{}", frames.start(), frames.end());
    let target = Frames::file(&args.output, number);
    file.write(&picture, &by, &target)?;
    if !args.quiet {
        say!("wrote    {}", target.display());
    }
    Ok(())
}

/// Prefixes of light passes and light groups (channel names without `R`) in all parts of the same size.
fn part_names(file: &Layered, part: usize) -> Vec<String> {
    let is_light = |prefix: &String| {
        !prefix.is_empty()
            && !DATA.contains(&prefix.as_str())
            && !prefix.to_ascii_lowercase().starts_with("crypto")
    };
    let file_names_in = |part| {
        let names = file.channels(part).into_iter().map(move |c| file.plain_name(part, &c.name));
        names.collect::<Vec<String>>()
    };
    let all = (0..file.len()).filter(|&other| file.size(other) == file.size(part)).flat_map(file_names_in);
    all.filter_map(|name| Some(name.strip_suffix('R')?.to_string())).filter(is_light).collect()
}

/// Denoiser, guides and noise estimate, for the header.
fn description(guides: &str, noise: &str) -> String {
    format!("{NAME}; guides {guides}; noise {noise}")
}

fn name_of(noise: &Noise) -> &'static str {
    match noise {
        Noise::Deviations(_) => "from another seed",
        Noise::Variance(_) => "from the variance",
        Noise::Unknown => "guessed",
    }
}

/// The index of the first part with a picture.
fn part_with_color(file: &Layered, path: &Path) -> Result<usize> {
    let has = |part: &usize| file.planes(*part, RGB).is_some();
    (0..file.len()).find(has).ok_or_else(|| without_color(path))
}

fn without_color(path: &Path) -> Error {
    Error::input(path, "has no channels R, G and B")
        .with_help("the picture to denoise must have these channels")
}

/// Reads the picture that was rendered with another seed.
fn load_other_seed(path: &Path, first: &Layered, part: usize) -> Result<Layered> {
    let other = load_layered(path)?;
    let fits =
        part < other.len() && other.size(part) == first.size(part) && other.planes(part, RGB).is_some();
    match fits {
        true => Ok(other),
        false => Err(Error::input(path, "doesn't have the same size and layers")
            .with_help("it must be the same picture, rendered with another seed")),
    }
}

/// Half the difference of two pictures, RGB planes.
fn half_difference(first: &Layered, second: &Layered, part: usize) -> Option<[Vec<f32>; 3]> {
    let (first, second) = (first.planes(part, RGB)?, second.planes(part, RGB)?);
    let half = |(a, b): (&f32, &f32)| 0.5 * (a - b);
    Some([0, 1, 2].map(|c| first[c].iter().zip(second[c].iter()).map(half).collect()))
}

/// Averages all float channels that both files have.
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

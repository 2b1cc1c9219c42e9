//! `oscura merge`: merges partial renders into a picture.

use super::parsers::{integer, stops};
use super::picture_args::{DenoiserArgs, ExrFormatArgs, views};
use super::pictures::{EncodeOptions, Pictures, Targets, UnencodedPicture};
use super::process::Outcome;
use super::report::counted;
use super::settings::check_memory_before_merging;
use super::{json, process, report};
use clap::Args;
use oscura::error::{Error, Problem, Result, Warning};
use oscura::film::{Aov, AovSet, Film};
use oscura::math::{DMat4, DVec3};
use oscura::output::part::{OutputSettings, PartHeader, check_parts, read_header, read_part};
use oscura::output::{Matte, Metadata, PngOptions, ViewTransform, read_view};
use oscura::render::{denoise_film, film_warnings, in_pool};
use serde::Serialize;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

/// Output of `--json`.
#[derive(Serialize)]
struct MergeReport {
    parts: usize,
    width: u32,
    height: u32,
    /// Mean over all pixels.
    samples_per_pixel: f64,
    /// Render time of all parts together, seconds.
    render_s: f64,
    render_cpu_s: f64,
    rays: u64,
    merge_s: f64,
    peak_memory_bytes: Option<u64>,
    missing: Vec<String>,
    outputs: Vec<String>,
    warnings: Vec<String>,
}

pub(crate) fn run(args: &MergeArgs) -> Result<Outcome> {
    in_pool(args.threads.map(usize::from), || merge(args))?
}

fn merge(args: &MergeArgs) -> Result<Outcome> {
    let start = Instant::now();
    let targets = Targets::check(&args.output)?;
    if let Some(part) = targets.parts().first() {
        return Err(Error::usage(format!("{}: must be a picture, not a .part file", part.display())));
    }
    let twice = args.parts.iter().enumerate().find(|(at, part)| args.parts[..*at].contains(part));
    if let Some((_, part)) = twice {
        return Err(Error::input(part, ("parts-overlap", "is given twice")));
    }
    let mut parts = headers(&args.parts)?;
    // Some channels have the value of the first sample: merge in the order of samples.
    parts.sort_by_key(|(_, header)| (header.first_sample, header.region.y0, header.region.x0));
    let missing = check_parts(&parts)?;
    if !args.allow_missing {
        refuse_missing(&parts[0].0, &missing)?;
    }
    check_memory_before_merging(&parts)?;
    let (mut film, backdrop) = merged_film(&parts)?;
    args.exr.check(film.names().any(|name| name.starts_with("Crypto")))?;
    let warnings = film_warnings(&film);
    let denoised = denoise(args, &parts[0], &mut film)?;
    let first = &parts[0].1;
    film.resolve_catchers(first.channels.catcher_output());
    backdrop.iter().for_each(|backdrop| film.composite_over(backdrop));
    let output = &first.output;
    let mut earlier: Vec<Warning> = output.warnings.iter().map(Warning::general).collect();
    if !missing.is_empty() {
        earlier.push(
            Warning::general(format!("parts are missing: {}", missing.join("; "))).with_code("part-missing"),
        );
    }
    let samples = film.mean_samples();
    let finished = UnencodedPicture {
        film: Cow::Borrowed(&film),
        warnings,
        metadata: Metadata { denoised, ..metadata(&parts, samples, missing.is_empty()) },
    };
    let how = encoding(args, output);
    let pictures = Pictures::encode(&how, &targets, finished, &png(args, output, &targets)?, &earlier);
    earlier.extend(pictures.warnings.iter().cloned());
    pictures.write()?;
    let sum = |of: fn(&PartHeader) -> f64| parts.iter().map(|(_, header)| of(header)).sum();
    let report = MergeReport {
        parts: parts.len(),
        width: first.width,
        height: first.height,
        samples_per_pixel: samples,
        render_s: sum(|header| header.cost.wall_s),
        render_cpu_s: sum(|header| header.cost.cpu_s),
        rays: parts.iter().fold(0, |sum, (_, header)| sum.saturating_add(header.cost.rays)),
        merge_s: start.elapsed().as_secs_f64(),
        peak_memory_bytes: process::peak_memory(),
        missing,
        outputs: targets.names(true),
        warnings: earlier.iter().map(Warning::to_string).collect(),
    };
    say(args, &report, &earlier);
    Ok(Outcome::Done)
}

/// Reads the headers of all files; reports all unreadable ones together.
fn headers(files: &[PathBuf]) -> Result<Vec<(PathBuf, PartHeader)>> {
    let (mut headers, mut failed) = (Vec::new(), None::<Error>);
    for file in files {
        match (read_header(file), &mut failed) {
            (Ok(header), _) => headers.push((file.clone(), header)),
            (Err(error), Some(all)) => all.append(error),
            (Err(error), none) => *none = Some(error),
        }
    }
    failed.map_or(Ok(headers), Err)
}

/// The error for missing parts, with the path of the first part.
fn refuse_missing(file: &Path, missing: &[String]) -> Result<()> {
    if missing.is_empty() {
        return Ok(());
    }
    let problem = |what: &String| Problem::new("", format!("no part has {what}")).with_code("part-missing");
    let error = Error::input_problems(file, missing.iter().map(problem).collect());
    Err(error.with_help("render the missing parts, or use --allow-missing"))
}

/// Denoises if requested now or when the parts were rendered; returns the denoiser's description.
fn denoise(
    args: &MergeArgs,
    (file, first): &(PathBuf, PartHeader),
    film: &mut Film,
) -> Result<Option<String>> {
    let kept = first.output.denoise.as_ref();
    if args.no_denoise || !args.denoise && kept.is_none() {
        return Ok(None);
    }
    let names = kept.unwrap_or(&first.channels.aovs);
    let kept = names.iter().map(|name| Aov::from_option(name)).collect::<Option<AovSet>>();
    let kept = kept.ok_or_else(|| Error::input(file, "has channels that are unknown"))?;
    if !args.quiet {
        args.denoiser.notes().iter().for_each(|note| say!("note: {note}"));
    }
    Ok(Some(denoise_film(film, kept)))
}

/// The merged film of all parts, and its backdrop.
fn merged_film(parts: &[(PathBuf, PartHeader)]) -> Result<(Film, Option<oscura::scene::Backdrop>)> {
    let (file, first) = &parts[0];
    let layout =
        first.channels.layout().ok_or_else(|| Error::input(file, "has channels that are unknown"))?;
    let mut film = Film::of_layout(first.width, first.height, layout)?;
    let mut backdrop = None;
    for (file, header) in parts {
        let part = read_part(file)?;
        if part.header != *header {
            return Err(Error::input(file, "was changed while it was read"));
        }
        film.merge_film(&part.film);
        backdrop = part.backdrop;
    }
    Ok((film, backdrop))
}

/// Metadata of the merged picture, from the parts' headers.
fn metadata(parts: &[(PathBuf, PartHeader)], samples: f64, is_complete: bool) -> Metadata {
    let first = &parts[0].1;
    let OutputSettings {
        seed,
        world_to_camera,
        world_to_ndc,
        pixel_aspect,
        aov_space,
        world_offset,
        mattes,
        ..
    } = &first.output;
    let aovs = first.channels.aovs().unwrap_or_default();
    let mattes = aovs.mattes().zip(mattes).map(|((_, kind), names)| Matte::new(kind, names.clone()));
    Metadata {
        samples,
        seed: *seed,
        owner: None,
        render_s: Some(parts.iter().map(|(_, header)| header.cost.wall_s).sum()),
        captured: Some(SystemTime::now()),
        world_to_camera: Some(DMat4::from_cols_array(&world_to_camera.map(f64::from_bits))),
        world_to_ndc: world_to_ndc.map(|m| DMat4::from_cols_array(&m.map(f64::from_bits))),
        pixel_aspect: pixel_aspect.map(f64::from_bits),
        aov_space: aov_space.parse().unwrap_or_default(),
        denoised: None,
        mattes: mattes.collect(),
        world_offset: world_offset.map(|offset| DVec3::from_array(offset.map(f64::from_bits))),
        stopped_by: (!is_complete).then(|| "parts are missing".to_string()),
        warnings: Vec::new(),
    }
}

/// Encoding options of the arguments, else of the parts.
fn encoding(args: &MergeArgs, output: &OutputSettings) -> EncodeOptions {
    EncodeOptions {
        owner: args.owner.clone().or_else(|| output.owner.clone()),
        reproducible: args.reproducible || output.reproducible,
        float: args.float || output.float,
        exr: args.exr.options(None),
        mark: None,
    }
}

/// Display options of the arguments, else of the parts.
///
/// # Errors
/// A lookup table of the view transform that can't be read.
fn png(args: &MergeArgs, output: &OutputSettings, targets: &Targets) -> Result<PngOptions> {
    let view = match &args.view {
        Some(view) => view.clone(),
        None if ViewTransform::is_file(&output.view) && targets.has_display_referred() => {
            let path = Path::new(&output.view);
            let help = "the parts use it as view transform; --view sets another";
            read_view(path).map_err(|e| Error::input(path, e).with_help(help))?
        }
        None => ViewTransform::from_name(&output.view).unwrap_or_default(),
    };
    Ok(PngOptions {
        view,
        white_balance: output.white_balance.map(f32::from_bits),
        deep: output.deep,
        exposure: args.exposure.unwrap_or(f32::from_bits(output.exposure)),
        dither: output.dither,
        opaque: output.opaque,
    })
}

fn say(args: &MergeArgs, report: &MergeReport, warnings: &[Warning]) {
    if !args.quiet {
        report::PrintedMessages::default().warnings(warnings);
        let (count, seconds) = (report.parts, report.merge_s);
        let (width, height, samples) = (report.width, report.height, report.samples_per_pixel);
        let count = counted(count as u64, "part");
        let samples = (samples * 10.0).round() / 10.0;
        say!("merged   {count} in {seconds:.2} s: {width} x {height}, {samples} samples per pixel");
        report.outputs.iter().for_each(|output| say!("wrote    {output}"));
    }
    if args.json {
        json::print(report);
    }
}

#[derive(Args, Debug)]
pub(crate) struct MergeArgs {
    /// Parts of one image (.part), in any order.
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// Output file, .exr or .png; may be given several times.
    #[arg(short, long, required = true, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Write the image even if parts are missing: some pixels then have fewer samples, or none.
    #[arg(long)]
    pub allow_missing: bool,
    /// Denoise the image, its light passes and light groups. Parts rendered with --denoise contain the guides; others
    /// need --aov albedo,normal,depth,variance for good results.
    #[arg(long)]
    pub denoise: bool,
    /// Do not denoise, even if the parts were rendered with --denoise.
    #[arg(long, conflicts_with = "denoise")]
    pub no_denoise: bool,
    #[command(flatten)]
    pub denoiser: DenoiserArgs,
    /// Write the colour channels of EXRs as 32-bit floats, as if the parts had been rendered with --float.
    #[arg(long)]
    pub float: bool,
    #[command(flatten)]
    pub exr: ExrFormatArgs,
    /// View transform of PNG and other display-referred output: a name, or a lookup table (cinespace, .csp) [default:
    /// that of the parts].
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,
    /// Exposure of PNG and other display-referred output, stops, -100 to 100 [default: that of the parts].
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, value_parser = stops)]
    pub exposure: Option<f32>,
    /// Write no dates and render times, as if the parts had been rendered with --reproducible.
    #[arg(long)]
    pub reproducible: bool,
    /// Owner of the image, for the EXR header [default: that of the parts].
    #[arg(long, value_name = "NAME")]
    pub owner: Option<String>,
    /// Number of threads [default: one per core].
    #[arg(long, value_name = "N", value_parser = integer::<u16>(1, 1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
    /// Print a JSON report on standard output.
    #[arg(long)]
    pub json: bool,
}

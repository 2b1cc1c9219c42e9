//! From arguments to settings: choices, preparation of the scene, memory limits, options without effect.

use super::args::{CRYPTO_LEVELS, FilterArg, FresnelArg, MicrofacetArg, RenderArgs, TreeArg};
use super::checkpoint::cropped;
use super::parsers::FRAME_RATE;
use super::picture_args::{Framed, Preset, Quality};
use super::pictures::{EncodeOptions, format_of, is_moving, is_part};
use super::process;
use super::process::{Limits, Watchdog};
use super::progress::{ProgressTarget, StageProgress};
use super::report::name_options_in_loaded;
use oscura::compile::{CompileReport, CompiledScene, Compiler, MemoryPart, texture_memory_for};
use oscura::denoise::temporal::REACH;
use oscura::error::{Error, Result, Warning};
use oscura::film::{Aov, AovSet, AovSpace, Source};
use oscura::image::Image;
use oscura::load::image::load_environment_within;
use oscura::load::stage::middle;
use oscura::load::{Loaded, asks_for_denoising};
use oscura::output::part::{PartHeader, Region};
use oscura::output::{Format, PngOptions, ViewTransform};
use oscura::render::{
    BvhQuality, Labels, PathReuse, RenderOptions, RequestedOptions, ResolvedOptions, SAMPLE_BLOCK, Splitting,
    denoising_guides, film_bytes, guiding_bytes, sequence_guides, shows_alpha, splat_bytes,
};
use oscura::scene::{
    BounceLimits, Camera, Clamp, EnergyCompensation, Environment, Filter, FresnelModel, ImageId, Keyframes,
    Model, Motion, RayKinds, Scene, Settings, SkippedCaustics,
};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Default maximum of samples per pixel with a noise threshold.
const MAX_SAMPLES: u32 = 1 << 16;

/// The render settings of the arguments.
pub(crate) fn requested(args: &RenderArgs) -> RequestedOptions {
    let filter = args.filter.map(|f| match f {
        FilterArg::Box => Filter::Box,
        FilterArg::Gaussian => Filter::Gaussian,
        FilterArg::BlackmanHarris => Filter::BlackmanHarris,
    });
    let energy_compensation = args.microfacet.map(|m| match m {
        MicrofacetArg::Multi => EnergyCompensation::On,
        MicrofacetArg::Single => EnergyCompensation::Off,
    });
    let fresnel = args.fresnel.map(|f| match f {
        FresnelArg::Exact => FresnelModel::Exact,
        FresnelArg::Schlick => FresnelModel::Schlick,
    });
    let tree = match args.tree {
        TreeArg::Auto => BvhQuality::Auto,
        TreeArg::Fast => BvhQuality::Fast,
        TreeArg::Full => BvhQuality::Full,
    };
    RequestedOptions {
        settings: Settings {
            width: args.width,
            height: args.height,
            // With a noise threshold, the maximum.
            samples: args.spp.or(args.long.noise.map(|_| args.long.max_spp.unwrap_or(MAX_SAMPLES))),
            depth: args.depth.or(args.unbiased.then_some(RenderOptions::default().max_depth)),
            bounces: args.bounces.or(args.unbiased.then_some(BounceLimits::NONE)),
            clamp: args.clamp.or(args.unbiased.then_some(Clamp::NONE)),
            filter_glossy: args.filter_glossy.or(args.unbiased.then_some(0.0)),
            skip_caustics: args.unbiased.then_some(SkippedCaustics::NONE),
            terminator: args.terminator,
            seed: args.seed,
            filter,
            energy_compensation,
            fresnel,
            spectral: args.spectral.then_some(true),
            exposure: args.exposure,
            ..Settings::default()
        },
        camera: args.camera.clone(),
        tree,
        options: RenderOptions::default()
            .aovs(args.aov.iter().fold(AovSet::NONE, |all, aovs| all.union(*aovs)))
            .aov_space(args.aov_space)
            .matte_levels(args.crypto_levels)
            .light_groups(args.light_groups)
            .planned(args.long.plan.unwrap_or(0))
            .sample_range(args.long.sample_range)
            .region(args.long.region.or(args.exr.crop))
            .transparent_glass(args.transparent_glass)
            .path_reuse(args.path_reuse)
            .splitting(args.splitting)
            .caustics(args.picture.caustics)
            .guiding(args.guiding.guiding)
            .least_samples(args.long.min_spp.unwrap_or(0))
            .noise(args.long.noise.map(|percent| percent / 100.0))
            .time_limit(args.long.time_limit),
    }
}

/// Without techniques that nobody asked for and that would do harm, though trials find a gain.
fn without_harmful_techniques(
    options: RenderOptions,
    args: &RenderArgs,
    is_stage_lit: bool,
) -> RenderOptions {
    let mut options = options;
    if is_stage_lit && args.splitting == Splitting::Auto {
        // Trials overestimate its gain there: at equal time it had 1.3 to 1.4 times the error.
        options = options.splitting(Splitting::OFF);
    }
    if args.picture.denoise && args.path_reuse == PathReuse::Auto {
        // Denoising takes noise that pixels share for detail and leaves patches of it.
        options = options.path_reuse(PathReuse::Off);
    }
    options
}

/// Removes AOVs and light groups, which only EXRs can store.
pub(crate) fn without_exr(requested: RequestedOptions) -> RequestedOptions {
    let options = requested.options.aovs(AovSet::NONE).light_groups(false);
    RequestedOptions { options, ..requested }
}

/// Checks that --transparent-glass has an effect.
///
/// # Errors
/// A usage error where the camera sees the environment.
pub(crate) fn check_glass(args: &RenderArgs, scene: &Scene) -> Result<()> {
    let sees_environment = scene.environment_visible_to.contains(RayKinds::CAMERA);
    if args.transparent_glass && sees_environment && scene.environment != Environment::Black {
        let message = "--transparent-glass has no effect where the camera sees the environment";
        return Err(Error::usage(message).with_help("add --transparent, or a --background"));
    }
    Ok(())
}

/// Options of display-referred output.
pub(crate) fn png(args: &RenderArgs, exposure: f32, is_stage_lit: bool, opaque: bool) -> PngOptions {
    let view = match &args.view {
        Some(view) => view.clone(),
        None if is_stage_lit && args.stage.leaves_view_open() => ViewTransform::Filmic,
        None => ViewTransform::Srgb,
    };
    PngOptions {
        view,
        exposure,
        white_balance: args.picture.white_balance,
        dither: args.dither,
        deep: args.picture.deep,
        opaque,
    }
}

// Preparation of a loaded scene: resolved options, memory check, compiled geometry.

/// Use of the pictures.
pub(super) struct PictureUse {
    /// AOVs can be stored.
    pub has_exr: bool,
    /// Texture coordinates may be requested later.
    pub keeps_uv: bool,
    /// Number of pictures.
    pub pictures: u64,
}

impl PictureUse {
    /// Pictures that are written to files.
    pub fn of_files(args: &RenderArgs, has_exr: bool) -> PictureUse {
        let pictures = args.frames.map_or(1, |frames| frames.numbers().count() as u64);
        PictureUse { has_exr, keeps_uv: false, pictures }
    }
}

pub(super) struct Prepared {
    pub scene: Arc<CompiledScene>,
    pub labels: Labels,
    pub camera: Camera,
    pub resolved: ResolvedOptions,
    /// Options of encoding.
    pub how: EncodeOptions,
    /// AOVs that the files are to have.
    pub kept_aovs: AovSet,
    pub png: PngOptions,
    pub build: CompileReport,
    pub load_s: f64,
    pub notes: Vec<Warning>,
    pub warnings: Vec<Warning>,
    pub left_out: Vec<String>,
}

/// Settles options and compiles what was loaded since `start`; `environment` is what the arguments put in place of the
/// scene's, unless that has been done.
///
/// # Errors
/// If arguments don't fit the scene, if there is not enough memory, and as compiling has them.
pub(super) fn prepare(
    args: &RenderArgs,
    wants: PictureUse,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    compiler: &mut Compiler,
) -> Result<Prepared> {
    name_options_in_loaded(loaded);
    let mut warnings = std::mem::take(&mut loaded.warnings);
    let mut resolved = resolve(args, wants.has_exr, loaded)?;
    let kept_aovs = resolved.options.aovs;
    resolved.options = without_harmful_techniques(resolved.options, args, loaded.is_stage_lit);
    if args.picture.denoise {
        let is_averaged = args.frame.as_ref().is_some_and(|frame| frame.is_averaged);
        let of_sequence = if is_averaged { sequence_guides() } else { AovSet::NONE };
        let needed = denoising_guides().union(of_sequence);
        resolved.options = resolved.options.aovs(kept_aovs.union(needed)).halves(!is_averaged);
    }
    warnings.extend(environment.map_or(Vec::new(), |e| e.apply(args, &mut loaded.scene)));
    check_glass(args, &loaded.scene)?;
    let load_s = start.elapsed().as_secs_f64();

    args.place.apply(loaded, resolved.camera.unwrap_or(0), args.stage.fov, middle)?;
    let frame = (resolved.options.width, resolved.options.height);
    args.exr.format.check(resolved.options.aovs.mattes().next().is_some())?;
    let framed = args.exr.window(frame, cropped(args), loaded.scene.backdrop.as_ref())?;
    let mut camera = resolved.camera(&loaded.scene)?.clone();
    if let Some(framed) = framed {
        framed.check_camera(&camera)?;
        camera = framed.widened(camera);
        resolved.options = resolved.options.size(framed.size.0, framed.size.1).region(framed.region);
    }
    check_memory_before_building(args, loaded, &resolved)?;
    compiler.set_tree(resolved.tree(wants.pictures));
    compiler.keep_uv(wants.keeps_uv || resolved.options.aovs.contains(Aov::Uv));
    let (scene, mut build) = compiled(args, compiler, &loaded.scene, &resolved, &camera)?;
    warnings.append(&mut build.warnings);
    let (mut notes, mut left_out) = (std::mem::take(&mut loaded.notes), std::mem::take(&mut loaded.left_out));
    notes.extend(build.notes.iter().cloned());
    left_out.append(&mut build.left_out);
    let labels = Labels::of(&loaded.scene, &resolved.options);
    build.memory.push(MemoryPart { name: "picture", bytes: film_bytes(&resolved.options, &labels) });
    let opaque = !shows_alpha(&scene, &resolved.options);
    let png = png(args, resolved.display.exposure, loaded.is_stage_lit, opaque);
    Ok(Prepared {
        scene,
        labels,
        camera,
        resolved,
        how: EncodeOptions::of(args, framed.map(Framed::window)),
        kept_aovs,
        png,
        build,
        load_s,
        notes,
        warnings,
        left_out,
    })
}

/// Compiles the scene, with a progress bar. Errors name the scene's file.
fn compiled(
    args: &RenderArgs,
    compiler: &mut Compiler,
    scene: &Scene,
    resolved: &ResolvedOptions,
    camera: &Camera,
) -> Result<(Arc<CompiledScene>, CompileReport)> {
    let size = (resolved.options.width, resolved.options.height);
    compiler.set_texture_memory(Some(texture_memory(args, size)));
    let target = ProgressTarget::of(args.quiet, args.long.progress);
    let _progress = StageProgress::new(target, "build", compiler.counter());
    let compiled = compiler.compile(scene, resolved.shading, camera, size);
    compiled.map_err(|error| error.in_file(&args.scene))
}

/// Memory for textures: about as much as a picture of this size can show of them, but at most a quarter of the machine's memory, unless the
/// user says something else.
fn texture_memory(args: &RenderArgs, (width, height): (u32, u32)) -> u64 {
    let quarter = process::memory_of_machine().map_or(u64::MAX, |bytes| bytes / 4);
    args.long.texture_memory.unwrap_or_else(|| texture_memory_for(width, height).min(quarter))
}

/// Resolves all options, without channels that no output can store.
fn resolve(args: &RenderArgs, has_exr: bool, loaded: &mut Loaded) -> Result<ResolvedOptions> {
    if has_exr {
        return requested(args).resolve(&loaded.scene);
    }
    let mut resolved = without_exr(requested(args)).resolve(&loaded.scene)?;
    // The AOVs of the scene file are validated but not rendered.
    resolved.options = resolved.options.aovs(AovSet::NONE);
    loaded.scene.settings.aovs = None;
    Ok(resolved)
}

// Settings of the scene file that are arguments of the command line.

/// The arguments, completed by the scene's settings.
pub(super) fn completed(args: &RenderArgs, settings: &Settings) -> RenderArgs {
    let mut args = args.clone();
    args.view = args.view.or_else(|| settings.view.clone());
    args.picture.white_balance = args.picture.white_balance.or(settings.white_balance);
    apply_quality(&mut args, settings);
    // A quality that is asked for overrides what the scene says of samples and denoising.
    if args.quality.is_none() {
        args.picture.denoise |= settings.denoise == Some(true) && !args.picture.no_denoise;
        apply_noise_threshold(&mut args, settings);
    }
    if args.long.region.is_none() {
        args.exr.crop = args.exr.crop.or(settings.crop.map(|crop| resized_crop(crop, &args, settings)));
    }
    args
}

/// The scene's crop in a picture of the size that the arguments ask for: the same part of the frame, in whole pixels around it.
fn resized_crop([x0, y0, x1, y1]: [u32; 4], args: &RenderArgs, settings: &Settings) -> Region {
    let scale = |wanted: Option<u32>, own: Option<u32>| {
        wanted.zip(own).map(|(wanted, own)| f64::from(wanted) / f64::from(own.max(1)))
    };
    let [x, y] = [scale(args.width, settings.width), scale(args.height, settings.height)];
    // One dimension alone keeps the aspect ratio.
    let [x, y] = [x.or(y).unwrap_or(1.0), y.or(x).unwrap_or(1.0)];
    let before = |edge: u32, scale: f64| (f64::from(edge) * scale).floor() as u32;
    let after = |edge: u32, scale: f64, own: Option<u32>| {
        let size = own.map_or(u32::MAX, |own| (f64::from(own) * scale).round() as u32);
        ((f64::from(edge) * scale).ceil() as u32).min(size)
    };
    let [x1, y1] = [after(x1, x, settings.width), after(y1, y, settings.height)];
    Region { x0: before(x0, x), y0: before(y0, y), x1, y1 }
}

/// The quality of a render: what `--quality` says, or `Normal` where neither the user nor the scene says when to stop. Parts
/// of pictures have none, since all parts need the same number of samples.
fn quality_of(args: &RenderArgs, settings: &Settings) -> Option<Quality> {
    let has_end = has_stop_condition(args) || args.long.time_limit.is_some();
    let of_scene = settings.samples.is_some() || settings.noise.is_some();
    let is_part = args.output.iter().any(|path| is_part(path));
    args.quality.or((!has_end && !of_scene && !is_part).then_some(Quality::Normal))
}

/// Are frames denoised with those around them?
pub(super) fn averages_frames(args: &RenderArgs) -> bool {
    let is_sequence = args.orbit.is_some() || args.frames.is_some_and(|frames| frames.are_consecutive());
    let is_denoised = || {
        let of_scene = || asks_for_denoising(&args.scene);
        let quality = quality_of(args, &Settings::default());
        args.picture.denoise || quality.map_or_else(of_scene, |quality| quality.preset().denoise)
    };
    is_sequence && !args.picture.no_denoise && !args.picture.denoise_alone && is_denoised()
}

/// True if the arguments give a number of samples or a noise threshold, or ask for a part of a picture, all parts of which have the same
/// number of samples.
fn has_stop_condition(args: &RenderArgs) -> bool {
    let long = &args.long;
    let is_part = long.sample_range.is_some() || long.region.is_some();
    let is_counted = args.spp.is_some() || is_part || long.plan.is_some();
    is_counted || long.noise.is_some()
}

/// Puts the settings of the quality into the arguments.
fn apply_quality(args: &mut RenderArgs, settings: &Settings) {
    args.quality = quality_of(args, settings);
    let Some(Preset { noise, samples, denoise }) = args.quality.map(Quality::preset) else { return };
    args.picture.denoise |= denoise && !args.picture.no_denoise;
    args.long.noise = noise;
    match noise {
        Some(_) => args.long.max_spp = args.long.max_spp.or(Some(samples)),
        None => args.spp = Some(samples),
    }
}

/// The scene's noise threshold, unless the user says how many samples to take.
fn apply_noise_threshold(args: &mut RenderArgs, settings: &Settings) {
    if !has_stop_condition(args) && settings.noise.is_some() {
        args.long.noise = settings.noise;
        args.long.max_spp = args.long.max_spp.or(settings.samples);
    }
}

// Memory limits, checked before loading and before building.

/// Upper bound of memory per triangle while building the BVH, bytes.
const BYTES_A_TRIANGLE: u64 = 150;

/// Memory that each key of a triangle takes that changes its shape, bytes: in the tree, and twice with its vertices.
const BYTES_A_KEY: u64 = 100;

/// Maximum number of bytes of memory that anything may take.
pub(super) fn memory_limit(args: &RenderArgs) -> Option<u64> {
    args.long.memory_limit.or_else(process::memory_of_machine)
}

/// Watches the limit that the arguments set while files are read, which nobody knows beforehand what they hold.
pub(super) fn watch_memory(args: &RenderArgs) -> Watchdog {
    let too_much = |message: String| {
        let help = "make its images smaller, or raise the limit";
        Error::usage(format!("loading the scene {message}")).with_help(help)
    };
    Watchdog::begin(Limits { time: None, memory: args.long.memory_limit }, too_much)
}

/// Checks the size of the scene file.
pub(super) fn check_memory_before_loading(args: &RenderArgs) -> Result<()> {
    let size = process::size_of(&args.scene).unwrap_or(0);
    refuse(args.long.memory_limit, &[("the file", size)]).map_err(smaller)
}

/// Checks the memory of merging these parts.
pub(super) fn check_memory_before_merging(parts: &[(PathBuf, PartHeader)]) -> Result<()> {
    let bytes_of = |pixels: u64, header: &PartHeader| {
        let a_pixel = header.channels.layout().map_or(0, |layout| layout.bytes_per_pixel());
        pixels.saturating_mul(a_pixel)
    };
    let whole = |(_, h): &(PathBuf, PartHeader)| bytes_of(u64::from(h.width) * u64::from(h.height), h);
    let part = |(_, h): &(PathBuf, PartHeader)| {
        bytes_of(u64::from(h.region.width()) * u64::from(h.region.height()), h)
    };
    let [picture, largest] = [parts.iter().map(whole).max(), parts.iter().map(part).max()];
    refuse(None, &[("the picture", picture.unwrap_or(0)), ("the largest part", largest.unwrap_or(0))])
        .map_err(|error| error.with_help("merge it on a machine with more"))
}

/// Checks the memory of the loaded scene, its compiled form and the film.
pub(super) fn check_memory_before_building(
    args: &RenderArgs,
    loaded: &Loaded,
    resolved: &ResolvedOptions,
) -> Result<()> {
    let scene = &loaded.scene;
    let triangles: usize = scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let keys = |(&mesh, moving): (&usize, &Keyframes<_>)| {
        scene.meshes.get(mesh).map_or(0, |mesh| mesh.triangles.len() * moving.keys.len())
    };
    let of_keys: usize = scene.motion.meshes.iter().map(keys).sum();
    let labels = Labels::of(scene, &resolved.options);
    refuse(
        args.long.memory_limit,
        &[
            ("the scene as loaded", process::memory_now().unwrap_or(0)),
            (
                "building the tree over its triangles",
                triangles as u64 * BYTES_A_TRIANGLE + of_keys as u64 * BYTES_A_KEY,
            ),
            ("the picture", film_bytes(&resolved.options, &labels)),
            (
                "splats of light paths",
                if may_send(scene) { splat_bytes(&resolved.options, &labels) } else { 0 },
            ),
            ("learning what guides paths", guiding_bytes(&resolved.options)),
            (
                "taking the noise out",
                if args.picture.denoise { denoising_bytes(resolved, &labels) } else { 0 },
            ),
            ("frames that wait for others", waiting_bytes(args, resolved, &labels)),
        ],
    )
    .map_err(smaller)
}

/// True if the scene may have caustics: lights, and smooth glass, mirrors or metal.
fn may_send(scene: &Scene) -> bool {
    scene.materials.iter().any(|material| !matches!(material.model, Model::Lambert { .. }))
}

fn smaller(error: Error) -> Error {
    error.with_help("make the picture smaller, render parts of it by --region, or leave out --aov")
}

/// Maximum memory of denoising, besides the film: planes of the picture, its guides and the parts of its light, before and
/// after.
fn denoising_bytes(resolved: &ResolvedOptions, labels: &Labels) -> u64 {
    let options = &resolved.options;
    let planes =
        60 + 9 * (options.aovs.of(Source::PartOfColor).iter().count() + labels.light_groups.len()) as u64;
    u64::from(options.width) * u64::from(options.height) * 4 * planes
}

/// Memory of frames that are denoised with their neighbours: those that are not written yet, and all that these are averaged
/// with.
fn waiting_bytes(args: &RenderArgs, resolved: &ResolvedOptions, labels: &Labels) -> u64 {
    let options = &resolved.options;
    if !args.picture.denoise || !args.frame.as_ref().is_some_and(|frame| frame.is_averaged) {
        return 0;
    }
    let parts = (options.aovs.of(Source::PartOfColor).iter().count() + labels.light_groups.len()) as u64;
    let frames = 1 + 2 * REACH as u64;
    let pixels = u64::from(options.width) * u64::from(options.height);
    REACH as u64 * film_bytes(options, labels) + frames * pixels * 4 * (16 + 3 * parts)
}

/// A size in GiB, or in MiB if small.
fn readable(bytes: u64) -> String {
    match bytes >> 30 {
        0 => format!("{:.0} MiB", bytes as f64 / f64::from(1u32 << 20)),
        _ => format!("{:.1} GiB", bytes as f64 / f64::from(1u32 << 30)),
    }
}

/// Error if more bytes are needed than the limit or the machine allows.
fn refuse(allowed: Option<u64>, needed: &[(&str, u64)]) -> Result<()> {
    let Some(limit) = allowed.or_else(process::memory_of_machine) else { return Ok(()) };
    let all = needed.iter().fold(0u64, |sum, (_, bytes)| sum.saturating_add(*bytes));
    if all <= limit {
        return Ok(());
    }
    let items: Vec<String> = (needed.iter().filter(|(_, bytes)| *bytes > 0))
        .map(|(what, bytes)| format!("{what} {}", readable(*bytes)))
        .collect();
    let whose = if allowed.is_some() { "--memory-limit allows" } else { "the machine has" };
    let message = format!("this takes more memory than {whose}, {}: {}", readable(limit), items.join(", "));
    Err(Error::usage(message))
}

// Warnings about options without effect.

/// Kinds of output of a run.
struct Made {
    /// EXRs, or partial renders.
    exr: bool,
    /// Display-referred pictures, also previews and partial renders.
    shown: bool,
    /// The same, or Radiance HDR.
    exposed: bool,
    /// Formats with 16 bits per channel.
    deep: bool,
    /// Formats with alpha.
    alpha: bool,
    /// GIF, APNG or video.
    moving: bool,
}

impl Made {
    fn of(args: &RenderArgs) -> Made {
        let is = |wanted: &[Format]| {
            let fits = |path: &&PathBuf| format_of(path).is_ok_and(|f| wanted.contains(&f));
            args.output.iter().any(|path| fits(&path))
        };
        let part = args.output.iter().any(|path| is_part(path));
        let moving = args.output.iter().any(|path| is_moving(path));
        let live = args.show.is_some() || args.preview.is_some();
        let pictures = is(&[Format::Png, Format::Jpeg, Format::Tiff, Format::WebP]);
        let shown = pictures || moving || live || part;
        Made {
            exr: part || is(&[Format::Exr]),
            shown,
            exposed: shown || is(&[Format::Hdr]),
            deep: part || is(&[Format::Png, Format::Tiff]),
            alpha: part || live || moving || is(&[Format::Exr, Format::Png, Format::Tiff, Format::WebP]),
            moving,
        }
    }
}

const NO_EXR: &str = "no output is an EXR";
const NOT_SHOWN: &str = "no output is a picture for looking at, such as a PNG";

/// One warning per option that is given and has no effect.
pub(super) fn unused_option_warnings(args: &RenderArgs, scene: &Scene, prepared: &Prepared) -> Vec<Warning> {
    let made = Made::of(args);
    let aovs = prepared.kept_aovs;
    let given = args.aov.iter().fold(AovSet::NONE, |all, aovs| all.union(*aovs));
    let aovs = given.union(aovs);
    let has_mattes = aovs.mattes().next().is_some();
    let placed = [Aov::Position, Aov::Normal, Aov::GeometricNormal, Aov::DenoisingNormal];
    let has_placed = placed.into_iter().any(|aov| aovs.contains(aov));
    let is_space_chosen = args.aov_space != AovSpace::default();
    let moves = scene.instances.iter().any(|i| !matches!(i.motion, Motion::Still))
        || scene.cameras.iter().any(|camera| camera.motion.is_some())
        || args.shutter.shutter.is_some();
    let timed = args.frames.is_some() || args.orbit.is_some() && made.moving || moves;
    // For each option: is it given, has it an effect, and the reason if not.
    let options = [
        ("--aov", !args.aov.is_empty(), made.exr, NO_EXR),
        ("--light-groups", args.light_groups, made.exr, NO_EXR),
        ("--float", args.float, made.exr, NO_EXR),
        ("--owner", args.owner.is_some(), made.exr, NO_EXR),
        ("what --exr-... and --working-space say", args.exr.format.is_given(), made.exr, NO_EXR),
        ("--crypto-levels", args.crypto_levels != CRYPTO_LEVELS, has_mattes, "--aov has no Cryptomatte"),
        ("--aov-space", is_space_chosen, has_placed, "--aov has no position, normal or geometric_normal"),
        ("--view", args.view.is_some(), made.shown, NOT_SHOWN),
        ("--exposure", args.exposure.is_some(), made.exposed, NOT_SHOWN),
        ("--white-balance", args.picture.white_balance.is_some(), made.exposed, NOT_SHOWN),
        ("--dither", args.dither, made.shown, NOT_SHOWN),
        ("--deep", args.picture.deep, made.deep, "no output is a PNG or TIFF"),
        (
            "the transparent background",
            args.transparent
                || matches!(args.stage.background, Some(super::scene_args::BackgroundArg::Transparent)),
            made.alpha,
            "the output has no alpha; .png, .tif, .webp and .exr have",
        ),
        (
            "--fps",
            args.fps != FRAME_RATE,
            timed,
            "there is no sequence, no moving picture and no open shutter",
        ),
    ];
    let idle = options.into_iter().filter(|(_, is_given, works, _)| *is_given && !works);
    idle.map(|(option, _, _, why)| Warning::general(format!("{option} has no effect: {why}"))).collect()
}

/// Notes of options that are fine and do nothing for this scene.
pub(super) fn idle_option_notes(args: &RenderArgs, scene: &Scene) -> Vec<Warning> {
    let has_groups = scene.light_groups().len() > 1;
    let is_idle = args.light_groups && Made::of(args).exr && !has_groups;
    let message = "--light-groups: the scene has no light groups, and all its light is in RGBA_default";
    let groups = is_idle.then(|| Warning::general(message));
    let range = args.long.sample_range.and_then(|range| block_note(range, args.spp));
    groups.into_iter().chain(range).collect()
}

/// Says which samples a range means that doesn't begin and end with blocks.
fn block_note((from, until): (u32, u32), samples: Option<u32>) -> Option<Warning> {
    let whole = |sample: u32| sample.checked_next_multiple_of(SAMPLE_BLOCK).unwrap_or(u32::MAX);
    let (first, last) = (whole(from), whole(until));
    // The last block of a picture may be a part of one.
    let message = format!(
        "--sample-range: samples come in blocks of {SAMPLE_BLOCK}, which belong to the range of their first sample: \
         {first}..{last}, or up to the last of the picture"
    );
    let is_other = first != from || last != until && samples != Some(until);
    is_other.then(|| Warning::general(message))
}

// Environment of the arguments, which overrides the scene's.

/// Environment map of `--env`, loaded once for all frames.
pub(crate) struct EnvironmentOverride {
    image: Option<Image>,
    warnings: Vec<Warning>,
}

impl EnvironmentOverride {
    /// Loads the environment map of the arguments, if any.
    ///
    /// # Errors
    /// An input error if it can't be read.
    pub fn load(args: &RenderArgs) -> Result<EnvironmentOverride> {
        let mut warnings = Vec::new();
        let path = args.env.as_ref().filter(|path| !path.as_os_str().is_empty());
        let image = path.map(|path| load_environment_within(path, memory_limit(args), &mut warnings));
        let image = image.transpose()?;
        Ok(EnvironmentOverride { image, warnings })
    }

    /// Replaces or adjusts a scene's environment; returns warnings.
    pub fn apply(&self, args: &RenderArgs, scene: &mut Scene) -> Vec<Warning> {
        let mut warnings = self.warnings.clone();
        if args.env.is_some() {
            scene.scale_environment_sun(0.0);
            scene.environment_sun = None;
            scene.environment_unsampled = false;
            scene.camera_environment = None;
        }
        if let Some(image) = &self.image {
            scene.images.push(image.clone());
            let image = ImageId((scene.images.len() - 1) as u32);
            scene.environment = Environment::Image { image, strength: 1.0, rotation_rad: 0.0 };
        } else if args.env.is_some() {
            scene.environment = Environment::Black;
        }
        let factor = args.env_strength;
        match &mut scene.environment {
            Environment::Image { strength, .. } => {
                let before = *strength;
                *strength = factor.unwrap_or(before);
                let ratio = if before > 0.0 { *strength / before } else { 1.0 };
                scene.scale_environment_sun(ratio);
                if let Some(degrees) = args.env_rotation {
                    scene.turn_environment(degrees.to_radians());
                }
                return warnings;
            }
            Environment::Constant(color) => *color = color.map(|v| v * factor.unwrap_or(1.0)),
            Environment::Gradient { nadir, zenith } => {
                *nadir = nadir.map(|v| v * factor.unwrap_or(1.0));
                *zenith = zenith.map(|v| v * factor.unwrap_or(1.0));
            }
            Environment::Black if factor.is_some() => {
                warnings.push(Warning::general("--env-strength has no effect: there is no environment"));
            }
            Environment::Black => {}
        }
        if args.env_rotation.is_some() {
            warnings.push(Warning::general("--env-rotation has no effect: there is no environment picture"));
        }
        warnings
    }
}

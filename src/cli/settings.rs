//! Settings from arguments: choices, preparation of the scene, memory checks, options without effect.

use super::args::{CRYPTO_LEVELS, RenderArgs};
use super::checkpoint::cropped;
use super::parsers::FRAME_RATE;
use super::picture_args::{FrameWindow, Preset, Quality};
use super::pictures::{EncodeOptions, format_of, is_animation, is_part};
use super::process;
use super::process::{Limits, Watchdog};
use super::progress::{ProgressTarget, StageProgress};
use super::report::name_options_in_loaded;
use oscura::compile::{CompileReport, CompiledScene, Compiler, MemoryPart, texture_memory_for};
use oscura::denoise::temporal::RADIUS;
use oscura::error::{Error, Result, Warning};
use oscura::film::{Aov, AovSet, AovSpace, Source};
use oscura::image::Image;
use oscura::load::image::load_environment_within;
use oscura::load::stage::scene_center;
use oscura::load::{Loaded, requests_denoising};
use oscura::output::part::{PartHeader, Region};
use oscura::output::{Format, PngOptions, ViewTransform};
use oscura::render::{
    Labels, PathReuse, RenderOptions, RequestedOptions, ResolvedOptions, SAMPLE_BLOCK, Splitting,
    denoising_guides, film_bytes, guiding_bytes, has_visible_alpha, sequence_guides, splat_bytes,
};
use oscura::scene::{
    BounceLimits, Camera, Clamp, Environment, ImageId, Keyframes, Model, Motion, RayKinds, Scene, Settings,
    SkippedCaustics,
};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Default of `--max-spp` with a noise threshold.
const MAX_SAMPLES: u32 = 1 << 16;

/// Render settings requested by the arguments.
pub(crate) fn requested(args: &RenderArgs) -> RequestedOptions {
    RequestedOptions {
        settings: Settings {
            width: args.width,
            height: args.height,
            // The maximum, with a noise threshold.
            samples: args.spp.or(args.long.noise.map(|_| args.long.max_spp.unwrap_or(MAX_SAMPLES))),
            depth: args.depth.or(args.unbiased.then_some(RenderOptions::default().max_depth)),
            bounces: args.bounces.or(args.unbiased.then_some(BounceLimits::NONE)),
            clamp: args.clamp.or(args.unbiased.then_some(Clamp::NONE)),
            filter_glossy: args.filter_glossy.or(args.unbiased.then_some(0.0)),
            skip_caustics: args.unbiased.then_some(SkippedCaustics::NONE),
            terminator: args.terminator,
            seed: args.seed,
            filter: args.filter,
            filter_radius: args.filter_radius,
            energy_compensation: args.microfacet,
            fresnel: args.fresnel,
            spectral: args.spectral.then_some(true),
            exposure: args.exposure,
            ..Settings::default()
        },
        camera: args.camera.clone(),
        bvh: args.bvh,
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
            .light_selection(args.guiding.light_selection)
            .min_samples(args.long.min_spp.unwrap_or(0))
            .noise(args.long.noise.map(|percent| percent / 100.0))
            .time_limit(args.long.time_limit),
    }
}

/// Disables automatic techniques where they are known to increase the error.
fn without_harmful_techniques(
    options: RenderOptions,
    args: &RenderArgs,
    is_stage_lit: bool,
) -> RenderOptions {
    let mut options = options;
    if is_stage_lit && args.splitting == Splitting::Auto {
        // On stages splitting increases the error by a factor of 1.3 to 1.4 at equal time.
        options = options.splitting(Splitting::OFF);
    }
    if args.picture.denoise && args.path_reuse == PathReuse::Auto {
        // Denoisers mistake noise that is correlated between pixels for detail, which leaves blotches.
        options = options.path_reuse(PathReuse::Off);
    }
    options
}

/// Removes AOVs and light groups, which only EXRs store.
pub(crate) fn without_exr(requested: RequestedOptions) -> RequestedOptions {
    let options = requested.options.aovs(AovSet::NONE).light_groups(false);
    RequestedOptions { options, ..requested }
}

/// Checks that `--transparent-glass` has an effect.
///
/// # Errors
/// A usage error if the camera sees the environment.
pub(crate) fn check_glass(args: &RenderArgs, scene: &Scene) -> Result<()> {
    let sees_environment = scene.environment_visible_to.contains(RayKinds::CAMERA);
    if args.transparent_glass && sees_environment && scene.environment != Environment::Black {
        let message = "--transparent-glass has no effect while the camera sees the environment";
        return Err(Error::usage(message).with_help("add --transparent, or a --background"));
    }
    Ok(())
}

/// Options of display-referred pictures.
pub(crate) fn png(args: &RenderArgs, exposure: f32, is_stage_lit: bool, opaque: bool) -> PngOptions {
    let view = match &args.view {
        Some(view) => view.clone(),
        None if is_stage_lit && args.stage.allows_filmic_view() => ViewTransform::Filmic,
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

/// What the rendered pictures are used for.
pub(super) struct PictureUse {
    /// An output stores AOVs.
    pub has_exr: bool,
    /// Texture coordinates may be requested later.
    pub keeps_uv: bool,
    /// Number of pictures.
    pub pictures: u64,
}

impl PictureUse {
    /// Pictures written to files.
    pub fn of_files(args: &RenderArgs, has_exr: bool) -> PictureUse {
        let pictures = args.frames.map_or(1, |frames| frames.numbers().count() as u64);
        PictureUse { has_exr, keeps_uv: false, pictures }
    }
}

/// A scene ready for rendering.
pub(super) struct Prepared {
    pub scene: Arc<CompiledScene>,
    pub labels: Labels,
    pub camera: Camera,
    pub resolved: ResolvedOptions,
    pub encoding: EncodeOptions,
    /// AOVs to write to files.
    pub output_aovs: AovSet,
    pub png: PngOptions,
    pub build: CompileReport,
    pub load_s: f64,
    pub notes: Vec<Warning>,
    pub warnings: Vec<Warning>,
    pub left_out: Vec<String>,
}

/// Resolves options and compiles a scene whose loading began at `start`. `environment` overrides the scene's; `None` if already
/// applied.
///
/// # Errors
/// Arguments don't fit the scene, there is not enough memory, or compiling fails.
pub(super) fn prepare(
    args: &RenderArgs,
    usage: PictureUse,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    compiler: &mut Compiler,
) -> Result<Prepared> {
    name_options_in_loaded(loaded);
    let mut warnings = std::mem::take(&mut loaded.warnings);
    let mut resolved = resolve(args, usage.has_exr, loaded)?;
    let output_aovs = resolved.options.aovs;
    resolved.options = without_harmful_techniques(resolved.options, args, loaded.is_stage_lit);
    if args.picture.denoise {
        let is_averaged = args.frame.as_ref().is_some_and(|frame| frame.is_averaged);
        let temporal_guides = if is_averaged { sequence_guides() } else { AovSet::NONE };
        let needed = denoising_guides().union(temporal_guides);
        resolved.options =
            resolved.options.aovs(output_aovs.union(needed)).halves(!is_averaged).denoises(true);
    }
    warnings.extend(environment.map_or(Vec::new(), |e| e.apply(args, &mut loaded.scene)));
    check_glass(args, &loaded.scene)?;
    let load_s = start.elapsed().as_secs_f64();

    args.camera_args.apply(loaded, resolved.camera.unwrap_or(0), args.stage.fov, scene_center)?;
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
    compiler.set_bvh(resolved.bvh(usage.pictures));
    compiler.keep_uv(usage.keeps_uv || resolved.options.aovs.contains(Aov::Uv));
    let (scene, mut build) = compiled(args, compiler, &loaded.scene, &resolved, &camera)?;
    warnings.append(&mut build.warnings);
    let (mut notes, mut left_out) = (std::mem::take(&mut loaded.notes), std::mem::take(&mut loaded.left_out));
    notes.extend(build.notes.iter().cloned());
    left_out.append(&mut build.left_out);
    let labels = Labels::of(&loaded.scene, &resolved.options);
    build.memory.push(MemoryPart { name: "picture", bytes: film_bytes(&resolved.options, &labels) });
    let opaque = !has_visible_alpha(&scene, &resolved.options);
    let png = png(args, resolved.display.exposure, loaded.is_stage_lit, opaque);
    Ok(Prepared {
        scene,
        labels,
        camera,
        resolved,
        encoding: EncodeOptions::of(args, framed.map(FrameWindow::window)),
        output_aovs,
        png,
        build,
        load_s,
        notes,
        warnings,
        left_out,
    })
}

/// Compiles the scene and reports progress. Errors name the scene file.
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

/// Memory limit of textures: `--texture-memory`, by default about what a picture of this size needs, at most a quarter of the
/// machine's memory.
fn texture_memory(args: &RenderArgs, (width, height): (u32, u32)) -> u64 {
    let quarter = process::memory_of_machine().map_or(u64::MAX, |bytes| bytes / 4);
    args.long.texture_memory.unwrap_or_else(|| texture_memory_for(width, height).min(quarter))
}

/// Resolves all options; without EXR outputs, removes AOVs and light groups.
fn resolve(args: &RenderArgs, has_exr: bool, loaded: &mut Loaded) -> Result<ResolvedOptions> {
    if has_exr {
        return requested(args).resolve(&loaded.scene);
    }
    let mut resolved = without_exr(requested(args)).resolve(&loaded.scene)?;
    // AOVs of the scene file are validated but not rendered.
    resolved.options = resolved.options.aovs(AovSet::NONE);
    loaded.scene.settings.aovs = None;
    Ok(resolved)
}

// Settings of the scene file that complete the arguments.

/// The arguments, completed by the scene's settings.
pub(super) fn completed(args: &RenderArgs, settings: &Settings) -> RenderArgs {
    let mut args = args.clone();
    args.view = args.view.or_else(|| settings.view.clone());
    args.picture.white_balance = args.picture.white_balance.or(settings.white_balance);
    apply_quality(&mut args, settings);
    // A quality overrides the scene's samples and denoising.
    if args.quality.is_none() {
        args.picture.denoise |= settings.denoise == Some(true) && !args.picture.no_denoise;
        apply_noise_threshold(&mut args, settings);
    }
    if args.long.region.is_none() {
        args.exr.crop = args.exr.crop.or(settings.crop.map(|crop| resized_crop(crop, &args, settings)));
    }
    args
}

/// The scene's crop, scaled to the picture size of the arguments and rounded outwards to whole pixels.
fn resized_crop([x0, y0, x1, y1]: [u32; 4], args: &RenderArgs, settings: &Settings) -> Region {
    let scale = |new: Option<u32>, old: Option<u32>| {
        new.zip(old).map(|(new, old)| f64::from(new) / f64::from(old.max(1)))
    };
    let [x, y] = [scale(args.width, settings.width), scale(args.height, settings.height)];
    // One dimension alone keeps the aspect ratio.
    let [x, y] = [x.or(y).unwrap_or(1.0), y.or(x).unwrap_or(1.0)];
    let scaled_start = |edge: u32, scale: f64| (f64::from(edge) * scale).floor() as u32;
    let scaled_end = |edge: u32, scale: f64, frame: Option<u32>| {
        let size = frame.map_or(u32::MAX, |frame| (f64::from(frame) * scale).round() as u32);
        ((f64::from(edge) * scale).ceil() as u32).min(size)
    };
    let [x1, y1] = [scaled_end(x1, x, settings.width), scaled_end(y1, y, settings.height)];
    Region { x0: scaled_start(x0, x), y0: scaled_start(y0, y), x1, y1 }
}

/// Quality of a render: `--quality`, or `Normal` if neither the user nor the scene sets a stop condition. Partial renders have
/// none, since all parts need the same number of samples.
fn quality_of(args: &RenderArgs, settings: &Settings) -> Option<Quality> {
    let by_args = has_stop_condition(args) || args.long.time_limit.is_some();
    let by_scene = settings.samples.is_some() || settings.noise.is_some();
    let is_part = args.output.iter().any(|path| is_part(path));
    args.quality.or((!by_args && !by_scene && !is_part).then_some(Quality::Normal))
}

/// Whether frames are denoised together with their neighbours.
pub(super) fn averages_frames(args: &RenderArgs) -> bool {
    let is_sequence = args.orbit.is_some() || args.frames.is_some_and(|frames| frames.are_consecutive());
    let is_denoised = || {
        let by_scene = || requests_denoising(&args.scene);
        let quality = quality_of(args, &Settings::default());
        args.picture.denoise || quality.map_or_else(by_scene, |quality| quality.preset().denoise)
    };
    is_sequence && !args.picture.no_denoise && !args.picture.denoise_alone && is_denoised()
}

/// True if the arguments set the number of samples or a noise threshold, or request a partial render, since all parts need the
/// same number of samples.
fn has_stop_condition(args: &RenderArgs) -> bool {
    let long = &args.long;
    let is_part = long.sample_range.is_some() || long.region.is_some();
    args.spp.is_some() || is_part || long.plan.is_some() || long.noise.is_some()
}

/// Applies the preset of the quality to the arguments.
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

/// Applies the scene's noise threshold, unless the arguments have a stop condition.
fn apply_noise_threshold(args: &mut RenderArgs, settings: &Settings) {
    if !has_stop_condition(args) && settings.noise.is_some() {
        args.long.noise = settings.noise;
        args.long.max_spp = args.long.max_spp.or(settings.samples);
    }
}

// Memory limits, checked before loading and before building.

/// Upper bound of memory per triangle while building the BVH, bytes.
const BYTES_PER_TRIANGLE: u64 = 150;

/// Additional memory per keyframe of a deforming triangle, bytes: once in the BVH and twice for its vertices.
const BYTES_PER_KEY: u64 = 100;

/// Memory limit, bytes: `--memory-limit`, by default the machine's memory.
pub(super) fn memory_limit(args: &RenderArgs) -> Option<u64> {
    args.long.memory_limit.or_else(process::memory_of_machine)
}

/// Enforces `--memory-limit` while loading, whose memory can't be estimated in advance.
pub(super) fn watch_memory(args: &RenderArgs) -> Watchdog {
    let exceeded = |message: String| {
        let help = "make its images smaller, or raise the limit";
        Error::usage(format!("loading the scene {message}")).with_help(help)
    };
    Watchdog::begin(Limits { time: None, memory: args.long.memory_limit }, exceeded)
}

/// Checks the size of the scene file.
pub(super) fn check_memory_before_loading(args: &RenderArgs) -> Result<()> {
    let size = process::size_of(&args.scene).unwrap_or(0);
    check_memory(args.long.memory_limit, &[("the file", size)]).map_err(with_memory_help)
}

/// Checks the memory of merging partial renders.
pub(super) fn check_memory_before_merging(parts: &[(PathBuf, PartHeader)]) -> Result<()> {
    let bytes_of = |pixels: u64, header: &PartHeader| {
        let bytes_per_pixel = header.channels.layout().map_or(0, |layout| layout.bytes_per_pixel());
        pixels.saturating_mul(bytes_per_pixel)
    };
    let picture = |(_, h): &(PathBuf, PartHeader)| bytes_of(u64::from(h.width) * u64::from(h.height), h);
    let part = |(_, h): &(PathBuf, PartHeader)| {
        bytes_of(u64::from(h.region.width()) * u64::from(h.region.height()), h)
    };
    let [picture, largest] = [parts.iter().map(picture).max(), parts.iter().map(part).max()];
    check_memory(None, &[("the picture", picture.unwrap_or(0)), ("the largest part", largest.unwrap_or(0))])
        .map_err(|error| error.with_help("merge it on a machine with more memory"))
}

/// Checks the memory needed for building and rendering.
pub(super) fn check_memory_before_building(
    args: &RenderArgs,
    loaded: &Loaded,
    resolved: &ResolvedOptions,
) -> Result<()> {
    let scene = &loaded.scene;
    let triangles: usize = scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let triangle_keys = |(&mesh, motion): (&usize, &Keyframes<_>)| {
        scene.meshes.get(mesh).map_or(0, |mesh| mesh.triangles.len() * motion.keys.len())
    };
    let keys: usize = scene.motion.meshes.iter().map(triangle_keys).sum();
    let labels = Labels::of(scene, &resolved.options);
    check_memory(
        args.long.memory_limit,
        &[
            ("the loaded scene", process::memory_now().unwrap_or(0)),
            ("building the BVH", triangles as u64 * BYTES_PER_TRIANGLE + keys as u64 * BYTES_PER_KEY),
            ("the picture", film_bytes(&resolved.options, &labels)),
            (
                "light tracing",
                if may_have_caustics(scene) { splat_bytes(&resolved.options, &labels) } else { 0 },
            ),
            ("path guiding", guiding_bytes(&resolved.options)),
            ("denoising", if args.picture.denoise { denoising_bytes(resolved, &labels) } else { 0 }),
            ("neighbouring frames", temporal_denoising_bytes(args, resolved, &labels)),
        ],
    )
    .map_err(with_memory_help)
}

/// True if a material is not purely diffuse: the scene may have caustics.
fn may_have_caustics(scene: &Scene) -> bool {
    scene.materials.iter().any(|material| !matches!(material.model, Model::Lambert { .. }))
}

fn with_memory_help(error: Error) -> Error {
    error.with_help("make the picture smaller, render it in parts with --region, or omit --aov")
}

/// Maximum memory of denoising without the film, bytes: colour, guides and components, before and after denoising.
fn denoising_bytes(resolved: &ResolvedOptions, labels: &Labels) -> u64 {
    let options = &resolved.options;
    let planes =
        60 + 9 * (options.aovs.of(Source::PartOfColor).iter().count() + labels.light_groups.len()) as u64;
    u64::from(options.width) * u64::from(options.height) * 4 * planes
}

/// Memory of temporal denoising, bytes: pending frames and their neighbours.
fn temporal_denoising_bytes(args: &RenderArgs, resolved: &ResolvedOptions, labels: &Labels) -> u64 {
    let options = &resolved.options;
    if !args.picture.denoise || !args.frame.as_ref().is_some_and(|frame| frame.is_averaged) {
        return 0;
    }
    let components = (options.aovs.of(Source::PartOfColor).iter().count() + labels.light_groups.len()) as u64;
    let frames = 1 + 2 * RADIUS as u64;
    let pixels = u64::from(options.width) * u64::from(options.height);
    RADIUS as u64 * film_bytes(options, labels) + frames * pixels * 4 * (16 + 3 * components)
}

/// A size as text, in GiB or MiB.
fn readable_size(bytes: u64) -> String {
    match bytes >> 30 {
        0 => format!("{:.0} MiB", bytes as f64 / f64::from(1u32 << 20)),
        _ => format!("{:.1} GiB", bytes as f64 / f64::from(1u32 << 30)),
    }
}

/// Checks that the needed bytes fit into `limit`, by default the machine's memory.
fn check_memory(limit: Option<u64>, needed: &[(&str, u64)]) -> Result<()> {
    let Some(available) = limit.or_else(process::memory_of_machine) else { return Ok(()) };
    let total = needed.iter().fold(0u64, |sum, (_, bytes)| sum.saturating_add(*bytes));
    if total <= available {
        return Ok(());
    }
    let items: Vec<String> = (needed.iter().filter(|(_, bytes)| *bytes > 0))
        .map(|(item, bytes)| format!("{item} {}", readable_size(*bytes)))
        .collect();
    let source = if limit.is_some() { "--memory-limit allows" } else { "the machine has" };
    let message =
        format!("this takes more memory than {source}, {}: {}", readable_size(available), items.join(", "));
    Err(Error::usage(message))
}

// Warnings about options without effect.

/// Kinds of outputs of a run. Partial renders count as all kinds except animations.
struct OutputKinds {
    exr: bool,
    /// Display-referred pictures and previews.
    display_referred: bool,
    /// Outputs with exposure: display-referred or Radiance HDR.
    exposed: bool,
    /// Integer formats with 16 bits per channel.
    deep: bool,
    /// Outputs with alpha.
    alpha: bool,
    /// GIF, APNG or video.
    animation: bool,
}

impl OutputKinds {
    fn of(args: &RenderArgs) -> OutputKinds {
        let has_format = |formats: &[Format]| {
            args.output.iter().any(|path| format_of(path).is_ok_and(|format| formats.contains(&format)))
        };
        let part = args.output.iter().any(|path| is_part(path));
        let animation = args.output.iter().any(|path| is_animation(path));
        let live = args.show.is_some() || args.preview.is_some();
        let pictures = has_format(&[Format::Png, Format::Jpeg, Format::Tiff, Format::WebP]);
        let display_referred = pictures || animation || live || part;
        OutputKinds {
            exr: part || has_format(&[Format::Exr]),
            display_referred,
            exposed: display_referred || has_format(&[Format::Hdr]),
            deep: part || has_format(&[Format::Png, Format::Tiff]),
            alpha: part
                || live
                || animation
                || has_format(&[Format::Exr, Format::Png, Format::Tiff, Format::WebP]),
            animation,
        }
    }
}

const NO_EXR: &str = "no output is an EXR";
const NO_DISPLAY_REFERRED: &str = "no output is display-referred, such as a PNG";

/// A warning for each option that is given but has no effect.
pub(super) fn unused_option_warnings(args: &RenderArgs, scene: &Scene, prepared: &Prepared) -> Vec<Warning> {
    let outputs = OutputKinds::of(args);
    let given = args.aov.iter().fold(AovSet::NONE, |all, aovs| all.union(*aovs));
    let aovs = given.union(prepared.output_aovs);
    let has_mattes = aovs.mattes().next().is_some();
    let spatial = [Aov::Position, Aov::Normal, Aov::GeometricNormal, Aov::DenoisingNormal];
    let has_spatial = spatial.into_iter().any(|aov| aovs.contains(aov));
    let is_space_chosen = args.aov_space != AovSpace::default();
    let has_motion = scene.instances.iter().any(|i| !matches!(i.motion, Motion::Still))
        || scene.cameras.iter().any(|camera| camera.motion.is_some())
        || args.shutter.shutter.is_some();
    let uses_fps = args.frames.is_some() || args.orbit.is_some() && outputs.animation || has_motion;
    // For each option: whether it is given, whether it has an effect, and the reason if not.
    let options = [
        ("--aov", !args.aov.is_empty(), outputs.exr, NO_EXR),
        ("--light-groups", args.light_groups, outputs.exr, NO_EXR),
        ("--float", args.float, outputs.exr, NO_EXR),
        ("--owner", args.owner.is_some(), outputs.exr, NO_EXR),
        ("--exr-... or --working-space", args.exr.format.is_given(), outputs.exr, NO_EXR),
        ("--crypto-levels", args.crypto_levels != CRYPTO_LEVELS, has_mattes, "--aov has no Cryptomatte"),
        ("--aov-space", is_space_chosen, has_spatial, "--aov has no position, normal or geometric_normal"),
        ("--view", args.view.is_some(), outputs.display_referred, NO_DISPLAY_REFERRED),
        ("--exposure", args.exposure.is_some(), outputs.exposed, NO_DISPLAY_REFERRED),
        ("--white-balance", args.picture.white_balance.is_some(), outputs.exposed, NO_DISPLAY_REFERRED),
        ("--dither", args.dither, outputs.display_referred, NO_DISPLAY_REFERRED),
        ("--deep", args.picture.deep, outputs.deep, "no output is a PNG or TIFF"),
        (
            "the transparent background",
            args.transparent
                || matches!(args.stage.background, Some(super::scene_args::BackgroundArg::Transparent)),
            outputs.alpha,
            "the output format has no alpha; use .png, .tif, .webp or .exr",
        ),
        ("--fps", args.fps != FRAME_RATE, uses_fps, "there is no sequence, animation file or open shutter"),
    ];
    let unused = options.into_iter().filter(|(_, is_given, has_effect, _)| *is_given && !has_effect);
    unused.map(|(option, _, _, why)| Warning::general(format!("{option} has no effect: {why}"))).collect()
}

/// Notes about valid options that have no effect on this scene.
pub(super) fn ineffective_option_notes(args: &RenderArgs, scene: &Scene) -> Vec<Warning> {
    let has_groups = scene.light_groups().len() > 1;
    let is_ineffective = args.light_groups && OutputKinds::of(args).exr && !has_groups;
    let message = "--light-groups: the scene has no light groups; all light is in RGBA_default";
    let groups = is_ineffective.then(|| Warning::general(message));
    let range = args.long.sample_range.and_then(|range| sample_range_note(range, args.spp));
    groups.into_iter().chain(range).collect()
}

/// A note if a sample range doesn't begin and end at block boundaries.
fn sample_range_note((start, end): (u32, u32), samples: Option<u32>) -> Option<Warning> {
    let rounded = |sample: u32| sample.checked_next_multiple_of(SAMPLE_BLOCK).unwrap_or(u32::MAX);
    let (rounded_start, rounded_end) = (rounded(start), rounded(end));
    // The last block of a picture may be incomplete.
    let message = format!(
        "--sample-range is rounded to blocks of {SAMPLE_BLOCK} samples: {rounded_start}..{rounded_end}, or up to the picture's \
         last sample"
    );
    let is_rounded = rounded_start != start || rounded_end != end && samples != Some(end);
    is_rounded.then(|| Warning::general(message))
}

/// Environment map of `--env`, which overrides the scene's; loaded once for all frames.
pub(crate) struct EnvironmentOverride {
    image: Option<Image>,
    warnings: Vec<Warning>,
}

impl EnvironmentOverride {
    /// Loads the environment map, if any.
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

    /// Replaces the scene's environment and applies `--env-strength` and `--env-rotation`; returns warnings.
    pub fn apply(&self, args: &RenderArgs, scene: &mut Scene) -> Vec<Warning> {
        let mut warnings = self.warnings.clone();
        if args.env.is_some() {
            scene.scale_environment_sun(0.0);
            scene.environment_sun = None;
            scene.environment_bsdf_only = false;
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
                    scene.set_environment_rotation(degrees.to_radians());
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
            warnings.push(Warning::general("--env-rotation has no effect: there is no environment map"));
        }
        warnings
    }
}

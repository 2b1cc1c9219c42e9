//! All that rendering needs of a scene that was loaded: options settled, memory checked, geometry compiled.

use super::args::RenderArgs;
use super::checkpoint::cropped;
use super::environment::EnvironmentOverride;
use super::exr_args::Framed;
use super::pictures::How;
use super::settings::{check_glass, choices, png, without_exr};
use super::waiting::{Telling, Waiting};
use super::{limits, terms};
use oscura::compile::{CompileReport, CompiledScene, Compiler, MemoryPart};
use oscura::error::{Result, Warning};
use oscura::film::{Aov, AovSet};
use oscura::load::Loaded;
use oscura::load::stage::middle;
use oscura::output::PngOptions;
use oscura::render::{Labels, Settled, denoising_guides, film_bytes, shows_alpha};
use oscura::scene::Camera;
use std::sync::Arc;
use std::time::Instant;

/// What pictures are wanted for.
pub(super) struct Wants {
    /// Can anything hold AOVs?
    pub has_exr: bool,
    /// May texture coordinates be asked for later on?
    pub keeps_uv: bool,
    /// How many pictures there will be.
    pub pictures: u64,
}

impl Wants {
    /// Pictures that become files.
    pub fn of_files(args: &RenderArgs, has_exr: bool) -> Wants {
        let pictures = args.frames.map_or(1, |frames| frames.numbers().count() as u64);
        Wants { has_exr, keeps_uv: false, pictures }
    }
}

pub(super) struct Prepared {
    pub scene: Arc<CompiledScene>,
    pub labels: Labels,
    pub camera: Camera,
    pub settled: Settled,
    /// How files are written.
    pub how: How,
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
    wants: Wants,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    compiler: &mut Compiler,
) -> Result<Prepared> {
    terms::in_loaded(loaded);
    let mut warnings = std::mem::take(&mut loaded.warnings);
    let mut settled = settle(args, wants.has_exr, loaded)?;
    let kept_aovs = settled.options.aovs;
    if args.picture.denoise {
        settled.options = settled.options.aovs(kept_aovs.union(denoising_guides())).halves(true);
    }
    warnings.extend(environment.map_or(Vec::new(), |e| e.apply(args, &mut loaded.scene)));
    check_glass(args, &loaded.scene)?;
    let load_s = start.elapsed().as_secs_f64();

    args.place.apply(loaded, settled.camera.unwrap_or(0), args.stage.fov, middle)?;
    let frame = (settled.options.width, settled.options.height);
    args.exr.format.check(settled.options.aovs.mattes().next().is_some())?;
    let framed = args.exr.window(frame, cropped(args), loaded.scene.backdrop.as_ref())?;
    let mut camera = settled.camera(&loaded.scene)?.clone();
    if let Some(framed) = framed {
        framed.check_camera(&camera)?;
        camera = framed.widened(camera);
        settled.options = settled.options.size(framed.size.0, framed.size.1).region(framed.region);
    }
    limits::before_building(args, loaded, &settled)?;
    let size = (settled.options.width, settled.options.height);
    compiler.set_tree(settled.tree(wants.pictures));
    compiler.keep_uv(wants.keeps_uv || settled.options.aovs.contains(Aov::Uv));
    compiler.set_texture_memory(texture_memory(args));
    let telling = Telling::of(args.quiet, args.long.progress);
    let waiting = Waiting::new(telling, "build", compiler.gauge());
    let (scene, mut build) = compiler.compile(&loaded.scene, settled.shading, &camera, size)?;
    drop(waiting);
    warnings.append(&mut build.warnings);
    let (mut notes, mut left_out) = (std::mem::take(&mut loaded.notes), std::mem::take(&mut loaded.left_out));
    notes.extend(build.notes.iter().cloned());
    left_out.append(&mut build.left_out);
    let labels = Labels::of(&loaded.scene, &settled.options);
    build.memory.push(MemoryPart { name: "picture", bytes: film_bytes(&settled.options, &labels) });
    let opaque = !shows_alpha(&scene, &settled.options);
    let png = png(args, settled.look.exposure, loaded.is_stage_lit, opaque);
    Ok(Prepared {
        scene,
        labels,
        camera,
        settled,
        how: How::of(args, framed.map(Framed::window)),
        kept_aovs,
        png,
        build,
        load_s,
        notes,
        warnings,
        left_out,
    })
}

/// What textures may take: a quarter of the machine's memory, unless the user says something else.
fn texture_memory(args: &RenderArgs) -> Option<u64> {
    let quarter = || super::process::memory_of_machine().map(|bytes| bytes / 4);
    args.long.texture_memory.or_else(quarter)
}

/// All options, without channels that no file could hold.
fn settle(args: &RenderArgs, has_exr: bool, loaded: &mut Loaded) -> Result<Settled> {
    if has_exr {
        return choices(args).settle(&loaded.scene);
    }
    let mut settled = without_exr(choices(args)).settle(&loaded.scene)?;
    // Those of the scene file have been checked, and go nowhere.
    settled.options = settled.options.aovs(AovSet::NONE);
    loaded.scene.settings.aovs = None;
    Ok(settled)
}

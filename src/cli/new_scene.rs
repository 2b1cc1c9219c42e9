//! `oscura new`: writes a commented scene file, or a sidecar for a model. `oscura export`: exports a Blender file to a folder of
//! files in common formats. `oscura cache`: the cache of exported Blender files.

use super::args::{CacheArgs, ExportArgs, NewArgs};
use super::process::Outcome;
use super::report::{PrintedMessages, name_options_in_error, print_line};
use super::scene_args::check_scene_path;
use super::toml_names::{key, quoted};
use oscura::error::{Error, ErrorKind, Problem, Result};
use oscura::load::blender::{BlenderOptions, cache_size, clear_cache, default_cache, export};
use oscura::load::gltf::GltfOptions;
use oscura::load::scene_file::sidecar_path;
use oscura::load::{BlenderExport, LoadOptions, Loaded, is_blender_file, load};
use oscura::math::DVec3;
use oscura::output::{check_folder, check_target, move_folder, write_atomically};
use oscura::scene::{Camera, Material, Model, Scene};
use std::fmt::Write;
use std::path::Path;

/// The scene file of `oscura new`.
const STARTER: &str = include_str!("starter.toml");

pub(crate) fn run(args: &NewArgs) -> Result<Outcome> {
    let path = match (&args.sidecar, &args.scene) {
        (Some(model), _) => return write_sidecar(model, args),
        (None, Some(path)) => path,
        (None, None) => return Err(Error::usage("the scene file to write is missing")),
    };
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("toml")) {
        let message = format!("{}: the extension of scene files is .toml", path.display());
        return Err(
            Error::usage(message).with_help(format!("oscura new {}", path.with_extension("toml").display()))
        );
    }
    if path.exists() && !args.force {
        let message = format!("{} exists already", path.display());
        return Err(Error::usage(message).with_help("choose another name, or replace it with --force"));
    }
    check_target(path)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    write_atomically(path, STARTER.replace("THIS-FILE.toml", &name).as_bytes())?;
    if !args.quiet {
        say!("wrote    {}", path.display());
        say!("next     oscura render {0} -o {1}.png", path.display(), name.trim_end_matches(".toml"));
    }
    Ok(Outcome::Done)
}

/// `oscura new --sidecar MODEL`: writes a sidecar with proposals for the model's contents.
fn write_sidecar(model: &Path, args: &NewArgs) -> Result<Outcome> {
    let path = sidecar_path(model);
    if path == model || model.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let message = format!("{} is not a model", model.display());
        return Err(Error::usage(message).with_help("use a .glb, .gltf, .obj or .ply file"));
    }
    if path.exists() && !args.force {
        let message = format!("{} exists already", path.display());
        return Err(Error::usage(message).with_help("replace it with --force"));
    }
    check_target(&path)?;
    let options = LoadOptions { no_sidecar: true, overrides_environment: true, ..LoadOptions::default() };
    let loaded = load(model, &options).map_err(name_options_in_error)?;
    write_atomically(&path, text(model, &loaded).as_bytes())?;
    if !args.quiet {
        say!("wrote    {}", path.display());
        let picture = model.with_extension("png");
        let picture = picture.file_name().unwrap_or_default().to_string_lossy();
        say!("next     oscura render {} -o {picture}", model.display());
    }
    Ok(Outcome::Done)
}

/// The text of the sidecar. Comments start with "# ", commented-out keys with "#" only.
fn text(model: &Path, loaded: &Loaded) -> String {
    let name = model.file_name().unwrap_or_default().to_string_lossy();
    let lost = loaded.blender.clone().unwrap_or_default();
    let mut parts = vec![head(&name, loaded.blender.is_some())];
    parts.push(PICTURE.to_string());
    parts.push(ENVIRONMENT.to_string());
    parts.extend(cameras(&loaded.scene));
    parts.push(LIGHT.to_string());
    parts.extend(area_lights(&lost));
    parts.extend(materials(&lost));
    parts.extend(other_materials(&loaded.scene, &lost));
    parts.extend(objects(&lost));
    parts.join("\n")
}

fn head(name: &str, is_blender_file: bool) -> String {
    let mut text = format!(
        "# Sidecar of {name}: data that its format can't store, used with the model; `oscura help sidecar` explains each key.\n\
         # Lines with a # directly before a word are proposals: remove the # to use them.\n"
    );
    if is_blender_file {
        text.push_str(
            "# Blender's glTF export lacks: the world, area lights, radii of lights, depth of field, lens shift, the picture's\n\
             # size, volumes, subsurface scattering, and nodes other than Principled BSDF. `oscura render x.blend` has all of this.\n",
        );
    }
    text
}

const PICTURE: &str = "\
#[render]
#width = 1920
#height = 1080
#samples = 256
#exposure = 0.0
";

const ENVIRONMENT: &str = "\
# The environment: a constant colour, or an image around the scene.
#[environment]
#background = [0.05, 0.05, 0.05]
# or: image = \"studio.exr\", rotation = 0, strength = 1
";

const LIGHT: &str = "\
# A light instead of the stage's light, in metres and watts; other types are area, spot and sun (`oscura help lights`).
#[[lights]]
#name = \"key\"
#point = { position = [2.0, 3.0, 2.0], radius = 0.3, power = 500.0 }
";

/// Name of the stage's camera for models without a camera.
const STAGE_CAMERA: &str = "default";

/// Maximum number of materials with a proposal.
const MAX_MATERIALS: usize = 12;

/// Proposals for the model's other materials.
fn other_materials(scene: &Scene, lost: &BlenderExport) -> Vec<String> {
    let is_proposed = |name: &String| {
        [&lost.white, &lost.lost, &lost.unused_alpha].iter().any(|names| names.contains(name))
    };
    let mut own: Vec<&Material> = Vec::new();
    for material in scene.materials.iter().filter(|m| !m.name.is_empty() && !is_proposed(&m.name)) {
        if own.iter().all(|known| known.name != material.name) {
            own.push(material);
        }
    }
    let part = |material: &&Material| {
        // Only glTF materials have parameters that can be changed singly.
        let kind = if matches!(material.model, Model::Pbr(_)) { "" } else { "#type = \"pbr\"\n" };
        format!(
            "# A material of the model: keys of type \"pbr\" change its parameters; a `type` replaces it.\n\
             #[materials.{}]\n{kind}#base_color = [0.8, 0.8, 0.8]\n#metallic = 0.0\n#roughness = 0.5\n",
            key(&material.name)
        )
    };
    own.iter().take(MAX_MATERIALS).map(part).collect()
}

/// Maximum number of cameras with a proposal.
const MAX_CAMERAS: usize = 8;

fn cameras(scene: &Scene) -> Vec<String> {
    let proposal = |name: &str| {
        format!(
            "# Depth of field and lens shift (in picture heights) of a camera.\n\
             #[[camera]]\n#name = {}\n#f_stop = 2.8\n#focal_length = 50\n#focus_distance = 5.0\n#shift = [0.0, 0.0]\n",
            quoted(name)
        )
    };
    let own = scene.cameras.iter().filter(|c| c.name != STAGE_CAMERA).take(MAX_CAMERAS);
    let proposals: Vec<String> = own.map(|camera| proposal(&camera.name)).collect();
    let framing = scene.cameras.iter().find(|camera| camera.name == STAGE_CAMERA);
    match framing.filter(|_| proposals.is_empty()) {
        Some(camera) => vec![stage_camera(camera)],
        None => proposals,
    }
}

/// The stage's camera, as a proposal for a model without a camera.
fn stage_camera(camera: &Camera) -> String {
    let eye = camera.world_from_camera.translation;
    let to = eye - camera.world_from_camera.matrix3.z_axis;
    let list = |v: DVec3| format!("[{:.4}, {:.4}, {:.4}]", v.x, v.y, v.z);
    format!(
        "# A camera: the default view of the model.\n#[camera]\n#look_from = {}\n#look_at = {}\n#vfov = 30\n",
        list(eye),
        list(to)
    )
}

fn area_lights(lost: &BlenderExport) -> Option<String> {
    let mut text = String::from(
        "# Empty nodes named like lights: the export of area lights. Their sizes (metres) and power (watts) are lost: these are\n\
         # guesses.\n",
    );
    for name in &lost.lights {
        let name = quoted(name);
        let _ = write!(
            text,
            "[[lights]]\nname = {name}\narea = {{ node = {name}, size = [1.0, 1.0], power = 100.0 }}\n\
             visible_to_camera = false\nobstacle = false\n"
        );
    }
    (!lost.lights.is_empty()).then_some(text)
}

fn materials(lost: &BlenderExport) -> Vec<String> {
    let with = |names: &[String], why: &str, lines: &str| {
        let part = |name: &String| format!("# {why}\n#[materials.{}]\n{lines}", key(name));
        names.iter().map(part).collect::<Vec<_>>()
    };
    let color = "#base_color = [0.8, 0.8, 0.8]\n#roughness = 0.5\n";
    [
        with(&lost.white, "Pure white without a texture: its nodes may not have been exported.", color),
        with(&lost.lost, "Other nodes than Principled BSDF are lost: it is white and diffuse.", color),
        with(
            &lost.unused_alpha,
            "The image of its base colour has an unused alpha channel; \"mask\" is for sharp edges.",
            "#alpha = \"blend\"\n",
        ),
    ]
    .concat()
}

fn objects(lost: &BlenderExport) -> Vec<String> {
    let part = |(name, inside): &(String, String)| {
        format!(
            "# Its material is lost and it encloses the {inside}: it may have been a volume, and hides the scene.\n\
             [objects.{}]\nhidden = true\n",
            key(name)
        )
    };
    lost.enclosing.iter().map(part).collect()
}

pub(crate) fn export_blender_file(args: &ExportArgs) -> Result<Outcome> {
    if !is_blender_file(&args.scene) {
        let message = format!("{} is not a .blend file: only those can be exported", args.scene.display());
        return Err(Error::usage(message));
    }
    check_scene_path(&args.scene)?;
    check_folder(&args.output, args.force).map_err(|error| match error.kind {
        ErrorKind::Usage => error.with_help("choose another name, or replace its files with --force"),
        _ => error,
    })?;
    let options = LoadOptions {
        blender: BlenderOptions { frame: args.frame, ..args.blender.options() },
        gltf: GltfOptions { scene: args.scene_name.clone(), ..GltfOptions::default() },
        ..LoadOptions::default()
    };
    // A temporary folder on the same file system, so that the export can be moved atomically.
    let parent = args.output.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let exported = export(&args.scene, &options, parent)?;
    if !args.quiet {
        let mut printed = PrintedMessages::default();
        printed.notes(&exported.notes);
        printed.warnings(&exported.warnings);
    }
    if args.strict && !exported.warnings.is_empty() {
        let problems = exported.warnings.iter().map(|w| Problem::new("", w.to_string())).collect();
        let file = Some(args.scene.clone());
        let error = Error { kind: ErrorKind::Input, file, problems, source_text: None };
        return Err(error.with_help("--strict treats warnings as errors"));
    }
    let names = move_folder(&exported.folder, &args.output)?;
    if !args.quiet {
        for name in names {
            say!("wrote    {}", args.output.join(name).display());
        }
    }
    Ok(Outcome::Done)
}

pub(crate) fn run_cache(args: &CacheArgs) -> Result<Outcome> {
    let Some(folder) = args.folder.clone().or_else(default_cache) else {
        let error = Error::usage("this system has no user cache directory: nothing is cached");
        return Err(error.with_help("set a folder with --cache"));
    };
    let (found, verb) = match args.clear {
        true => (clear_cache(&folder)?, "deleted"),
        false => (cache_size(&folder)?, "cached"),
    };
    let mib = found.bytes as f64 / f64::from(1 << 20);
    print_line(&format!("{}: {} files of {mib:.1} MiB {verb}", folder.display(), found.files));
    Ok(Outcome::Done)
}

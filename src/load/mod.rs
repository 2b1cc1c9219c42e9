//! File loading: glTF, OBJ, PLY, SPZ, STL, 3MF, scene files (TOML), Blender files, images and environments. Returns a
//! [`Scene`](crate::scene::Scene) with warnings, or one error with all problems of the file.

pub mod blender;
mod curves;
mod decoders;
mod displace;
mod files;
mod formats;
pub mod gltf;
mod grid;
mod ies;
pub mod image;
mod mesh_tools;
pub mod obj;
mod options;
pub mod ply;
mod points;
mod procedural_media;
pub mod scene_file;
pub mod sky;
mod smooth;
mod splats;
pub mod stage;
mod stl;
pub mod subdivide;
mod threemf;
mod triangulate;
mod unpack;
mod upright;
mod vdb;
mod words;
mod zip;

pub use files::{file_names_in, text_of};
pub use formats::extensions;
pub use options::{
    BlenderExport, EmptyNode, LoadOptions, Loaded, MAX_SHUTTER_FRAMES, ShutterOptions, ShutterPosition,
    WatchedFiles,
};
pub use upright::{Up, UpHint};

use crate::error::{Choice, Error, Result, Warning};
use crate::scene::MeshId;
use formats::Format;
use scene_file::{Sidecar, sidecar_text};
use std::fs::File;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Loads a scene from a `.gltf`, `.glb`, `.obj`, `.ply`, `.spz`, `.stl`, `.3mf`, `.toml` or `.blend` file, or from a `.zip`
/// with a model, by the extension ([`extensions`]).
///
/// # Errors
/// An input error with all problems of the file.
pub fn load(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Loaded> {
    let mut scene = Loaded::default();
    load_each(path.as_ref(), options, [Moment::Time(options.gltf.time_s)], &mut |loaded| {
        scene = std::mem::take(loaded);
        Ok(ControlFlow::Break(()))
    })?;
    Ok(scene)
}

/// Loads a scene at several times (seconds), in order, and calls `each` for each time until it breaks. The static data of a
/// glTF file are read once: the file itself, images, materials, and meshes without skin and morph targets. `each` may change
/// the scene except for these meshes, which come first. Files of other types are loaded again for each time.
///
/// # Errors
/// As for [`load`], and the errors of `each`.
pub fn load_times(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    times: impl IntoIterator<Item = f64>,
    each: &mut dyn FnMut(&mut Loaded) -> Result<ControlFlow<()>>,
) -> Result<()> {
    load_each(path.as_ref(), options, times.into_iter().map(|time_s| Moment::Time(Some(time_s))), each)
}

/// The time or frame of an animation to load.
#[derive(Clone, Copy)]
enum Moment {
    /// The pose at a time, seconds; `None` is the rest pose.
    Time(Option<f64>),
    /// A frame of a Blender file.
    Frame(u32),
}

/// Loads a file at several moments. Archives are unpacked to a temporary folder.
fn load_each(
    path: &Path,
    options: &LoadOptions,
    moments: impl IntoIterator<Item = Moment>,
    each: &mut dyn FnMut(&mut Loaded) -> Result<ControlFlow<()>>,
) -> Result<()> {
    if !is_archive(path)? {
        return load_file(path, options, moments, each);
    }
    options.files.note(path);
    let unpacked = unpack::Unpacked::new(path)?;
    let inner = LoadOptions { files: WatchedFiles::default(), ..options.clone() };
    let report_archive = |file: &mut Option<PathBuf>| {
        if unpacked.contains(file.as_ref()) {
            *file = Some(path.to_path_buf());
        }
    };
    let loaded = load_file(&unpacked.model, &inner, moments, &mut |loaded| {
        let messages = loaded.warnings.iter_mut().chain(&mut loaded.notes);
        messages.for_each(|warning| report_archive(&mut warning.file));
        unpacked.keep_for(loaded);
        each(loaded)
    });
    loaded.map_err(|mut error| {
        report_archive(&mut error.file);
        error
    })
}

/// Whether a file is an archive with a model, by its content. Known contents that aren't models are errors.
fn is_archive(path: &Path) -> Result<bool> {
    let format = formats::of(path);
    let has_archive_name = formats::is_named_as_archive(path);
    if !matches!(format, Format::Model(_)) && !has_archive_name || !path.is_file() {
        return Ok(false);
    }
    let mut start = Vec::new();
    // Unreadable files are reported by the reader.
    let _ = File::open(path).and_then(|file| file.take(files::HEAD as u64).read_to_end(&mut start));
    if zip::is_archive(&start) {
        return Ok(!formats::is_package(path));
    }
    let is_own = match format {
        Format::Model(model) if model.is_gltf => start.starts_with(b"glTF"),
        _ => formats::extension(path) == "ply" && start.starts_with(b"ply"),
    };
    match files::content_of(&start).filter(|_| !is_own && !start.starts_with(files::GZIP)) {
        Some(files::Content { what, remedy }) => {
            Err(Error::input(path, format!("is {what}")).with_help(remedy))
        }
        None if has_archive_name => Err(Error::input(path, ("zip-missing", "is not a ZIP archive"))),
        None => Ok(false),
    }
}

/// Loads a file that is not an archive.
fn load_file(
    path: &Path,
    options: &LoadOptions,
    moments: impl IntoIterator<Item = Moment>,
    each: &mut dyn FnMut(&mut Loaded) -> Result<ControlFlow<()>>,
) -> Result<()> {
    let format = formats::of(path);
    let text = match format {
        Format::Model(_) if !options.no_sidecar => sidecar_text(path, options)?,
        _ => None,
    };
    let sidecar = text.as_ref().map(Sidecar::parse);
    let mut options = sidecar.as_ref().map_or_else(|| options.clone(), |s| s.reader_options(options));
    options.keeps_polygons |= options.subdivision.is_some();
    if matches!(format, Format::Model(model) if model.is_gltf) {
        let times = moments.into_iter().map(|moment| match moment {
            Moment::Time(time_s) => time_s,
            Moment::Frame(_) => None,
        });
        return gltf::load_times(path, &options, times, &mut |loaded| {
            complete(path, &options, sidecar.as_ref(), loaded)?;
            each(loaded)
        });
    }
    for (i, moment) in moments.into_iter().enumerate() {
        match moment {
            Moment::Frame(frame) => options.blender.frame = Some(frame),
            Moment::Time(time_s) => options.gltf.time_s = time_s,
        }
        let mut loaded = match format {
            Format::Model(model) => (model.load)(path, &options)?,
            Format::SceneFile => scene_file::load(path, &options)?,
            Format::Blender => blender::load(path, &options, i == 0)?,
            Format::Other => {
                let extension = formats::extension(path);
                let message = match extension.as_str() {
                    "" => "has no extension, which determines the format of a scene".to_string(),
                    _ => format!("files of type '.{extension}' can't be rendered"),
                };
                return Err(Error::input(path, message).with_help(conversion_hint(&extension)));
            }
        };
        complete(path, &options, sidecar.as_ref(), &mut loaded)?;
        if each(&mut loaded)?.is_break() {
            break;
        }
    }
    Ok(())
}

/// Loads the frames of a sequence in order and calls `each` for each frame until it breaks. Frame numbers of `.blend` files
/// are Blender's; in all other files frame N is the time N / `fps`, as in [`load_times`].
///
/// # Errors
/// As for [`load`], and the errors of `each`.
pub fn load_frames(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    numbers: impl Iterator<Item = u32>,
    fps: f64,
    each: &mut dyn FnMut(&mut Loaded) -> Result<ControlFlow<()>>,
) -> Result<()> {
    let is_blender = is_blender_file(&path);
    let moment = |number| match is_blender {
        true => Moment::Frame(number),
        false => Moment::Time(Some(f64::from(number) / fps)),
    };
    load_each(path.as_ref(), options, numbers.map(moment), each)
}

/// Whether it is a Blender file, or a file that Blender imports (USD, FBX, Alembic, Collada), by its extension.
pub fn is_blender_file(path: impl AsRef<Path>) -> bool {
    matches!(formats::of(path.as_ref()), Format::Blender)
}

/// Whether a file is a scene, by its extension.
pub fn is_named_as_scene(path: impl AsRef<Path>) -> bool {
    !matches!(formats::of(path.as_ref()), Format::Other) || formats::is_named_as_archive(path.as_ref())
}

/// Whether a file is a scene, by its extension, and for `.toml` files, which may also be settings of other programs, by its tables.
pub fn is_scene(path: impl AsRef<Path>) -> bool {
    let path = path.as_ref();
    is_named_as_scene(path) && (!matches!(formats::of(path), Format::SceneFile) || scene_file::is_scene(path))
}

/// Whether a scene file enables denoising (`denoise` of `[render]`). Reads only the scene file itself.
pub fn requests_denoising(path: impl AsRef<Path>) -> bool {
    let path = path.as_ref();
    matches!(formats::of(path), Format::SceneFile) && scene_file::requests_denoising(path)
}

/// Help text for files of other programs: how to convert them, by their extension.
fn conversion_hint(extension: &str) -> String {
    let hint = match extension {
        "3ds" | "max" | "ma" | "mb" | "c4d" | "skp" | "step" | "stp" | "x3d" | "wrl" | "lwo" => {
            "export .glb (glTF), .usd or .fbx from the program that wrote it"
        }
        "xyz" | "pts" | "ptx" | "asc" | "pcd" | "las" | "laz" | "e57" => {
            "CloudCompare saves point clouds as .ply"
        }
        "off" | "ctm" | "iv" | "vtk" | "vtp" => "MeshLab or ParaView saves it as .ply",
        "exr" | "hdr" | "png" | "jpg" | "jpeg" => "it is a picture, not a scene",
        _ => {
            return format!(
                "oscura renders models ({}), scene files (.toml) and, through Blender, .blend, .usd, .fbx and .abc",
                formats::models_in_words()
            );
        }
    };
    hint.to_string()
}

/// Adds smooth normals to meshes if requested; warns if the option has no effect.
fn add_smooth_normals(path: &Path, options: &LoadOptions, is_mesh_file: bool, loaded: &mut Loaded) {
    let Some(crease_rad) = options.smooth_rad else { return };
    let meshes = loaded.scene.meshes.iter_mut().filter(|_| is_mesh_file);
    let count =
        meshes.map(|mesh| smooth::smooth(mesh, crease_rad)).filter(|is_smoothed| *is_smoothed).count();
    if count == 0 {
        let why = match is_mesh_file {
            true => "all meshes have normals",
            false => "it applies to OBJ and PLY files; objects in scene files have the key 'smooth'",
        };
        let message = format!("{} has no effect: {why}", Choice::Smooth);
        loaded.warnings.push(Warning::new(path, "", ("unused-option", message)));
    }
}

/// Subdivides all meshes of an OBJ or PLY file if requested; warns if the option has no effect.
///
/// # Errors
/// If the meshes would have too many triangles.
fn subdivide_all(path: &Path, options: &LoadOptions, is_mesh_file: bool, loaded: &mut Loaded) -> Result<()> {
    let Some(subdivision) = options.subdivision else { return Ok(()) };
    if !is_mesh_file || loaded.scene.meshes.is_empty() {
        let why = match is_mesh_file {
            true => "there are no meshes",
            false => {
                "it applies to OBJ and PLY files; objects in scene files and sidecars have the key 'subdivide'"
            }
        };
        let message = ("unused-option", format!("{} has no effect: {why}", Choice::Subdivide));
        loaded.warnings.push(Warning::new(path, "", message));
        return Ok(());
    }
    let Loaded { scene, polygons, .. } = loaded;
    for id in (0..scene.meshes.len() as u32).map(MeshId) {
        if let Some(mesh) =
            polygons.subdivided(scene, id, subdivision).map_err(|message| Error::input(path, message))?
        {
            scene.meshes[id.index()] = mesh;
        }
    }
    Ok(())
}

/// Whether the format of a file leaves the up axis undefined.
pub fn has_ambiguous_up(path: impl AsRef<Path>) -> bool {
    matches!(formats::of(path.as_ref()), Format::Model(model) if model.has_ambiguous_up)
}

/// Completes a scene after reading, for all formats: mesh options, sidecar, up axis, displacement, procedural media, the
/// stage for models without camera or light, and validation.
fn complete(
    path: &Path,
    options: &LoadOptions,
    sidecar: Option<&Sidecar>,
    loaded: &mut Loaded,
) -> Result<()> {
    let format = formats::of(path);
    let model = match format {
        Format::Model(model) => Some(model),
        _ => None,
    };
    let is_mesh_file = model.is_some_and(|model| !model.is_gltf);
    warn_of_unused_options(path, options, is_mesh_file, loaded);
    subdivide_all(path, options, is_mesh_file, loaded)?;
    add_smooth_normals(path, options, is_mesh_file, loaded);
    let has_ambiguous_up = model.is_some_and(|model| model.has_ambiguous_up);
    if has_ambiguous_up {
        upright::apply_up_option(options, loaded);
    } else if !matches!(options.up, Up::Auto | Up::Y) {
        let message = ("unused-option", format!("{} has no effect on files of this type", Choice::Up));
        loaded.warnings.push(Warning::new(path, "", message));
    }
    match sidecar {
        Some(sidecar) => sidecar.apply(options, loaded)?,
        None if model.is_some() && !options.no_sidecar => gltf::warn_of_losses(path, loaded),
        None => {}
    }
    if has_ambiguous_up {
        upright::apply_guessed_up(path, options, loaded);
    }
    // Subdivision is done; meshes of the next time sample differ.
    loaded.polygons = subdivide::Polygons::default();
    mesh_tools::flatten_singular_instances(path, loaded);
    displace::apply(loaded)?;
    procedural_media::apply(loaded)?;
    loaded.is_model = model.is_some() || formats::is_imported_by_blender(path);
    stage::complete(loaded, &options.stage, options.overrides_environment);
    let problems = loaded.scene.validate();
    if problems.is_empty() { Ok(()) } else { Err(Error::input_problems(path, problems)) }
}

/// Warns of options that have no effect on files of this type.
fn warn_of_unused_options(path: &Path, options: &LoadOptions, is_mesh_file: bool, loaded: &mut Loaded) {
    let mut warn = |message: &str| loaded.warnings.push(Warning::new(path, "", message));
    if is_mesh_file && options.gltf.time_s.is_some() {
        warn("files of this type have no animations: all frames are the same picture");
    }
    let other_options = gltf::GltfOptions { time_s: None, ..options.gltf.clone() };
    if is_mesh_file && other_options != gltf::GltfOptions::default() {
        warn(
            "options for glTF assets (scene, node, variant, lights, glass) have no effect on files of this type",
        );
    }
}

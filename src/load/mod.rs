//! The only reader of files: glTF, OBJ, PLY, scene files (TOML), images and environments. A path goes in, a [`Scene`](crate::scene::Scene)
//! with its warnings comes out, or one error with all the problems of the file.

pub mod blender;
mod curves;
mod decoders;
mod displace;
mod formats;
pub mod gltf;
mod grid;
mod heights;
mod ies;
pub mod image;
mod mesh_tools;
pub mod obj;
mod options;
pub mod ply;
mod points;
pub mod scene_file;
mod shutter;
pub mod sky;
mod smooth;
pub mod stage;
pub mod subdivide;
mod subdivided;
mod upright;
mod vdb;
mod words;

pub use formats::extensions;
pub use options::SavedFiles;
pub use options::{BlenderExport, EmptyNode, LoadOptions, Loaded};
pub use shutter::{LONGEST_SHUTTER, ShutterOptions, ShutterPosition};
pub use upright::{Up, UpHint};

use crate::error::{Choice, Error, Result, Warning};
use formats::Format;
use std::ops::ControlFlow;
use std::path::Path;

/// Loads a scene from a `.gltf`, `.glb`, `.obj`, `.ply`, `.toml` or `.blend` file; the extension says which it is
/// ([`extensions`]).
///
/// # Errors
/// An input error with all problems of the file.
pub fn load(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Loaded> {
    let path = path.as_ref();
    let options = &with_sidecar(path, options);
    let format = formats::of(path);
    let mut loaded = match format {
        Format::Model(model) => (model.load)(path, options)?,
        Format::SceneFile => scene_file::load(path, options)?,
        Format::Blender => blender::load(path, options)?,
        Format::Other => {
            let extension = formats::extension(path);
            return Err(Error::input(path, format!("files of type '.{extension}' can't be rendered"))
                .with_help(way_to_a_scene(&extension)));
        }
    };
    if is_of_blender(path) && options.shutter.is_open() {
        let message = "what moves in files of Blender is not blurred: it is exported at one moment";
        loaded.warnings.push(Warning::new(path, "", message));
    }
    let is_of_other_model = matches!(format, Format::Model(model) if !model.is_gltf);
    if is_of_other_model && options.gltf.time_s.is_some() {
        let message = "nothing moves in files of this type: every frame or moment is the same picture";
        loaded.warnings.push(Warning::new(path, "", message));
    }
    let of_assets = gltf::GltfOptions { time_s: None, ..options.gltf.clone() };
    if is_of_other_model && of_assets != gltf::GltfOptions::default() {
        let message =
            "choices about glTF assets (a scene, a node, a variant, lights, glass) change nothing here";
        loaded.warnings.push(Warning::new(path, "", message));
    }
    subdivided::all(path, options, is_of_other_model, &mut loaded)?;
    smoothed(path, options, is_of_other_model, &mut loaded);
    if matches!(format, Format::Model(model) if model.leaves_up_open) {
        upright::apply(path, options, &mut loaded, false);
    } else if !matches!(options.up, Up::Auto | Up::Y) {
        let message = "the choice of the axis that points up changes nothing here";
        loaded.warnings.push(Warning::new(path, "", message));
    }
    complete(path, options, &mut loaded)?;
    Ok(loaded)
}

/// Loads the same scene at one moment (seconds) after another and hands each to `each`, until that breaks off. Of a glTF
/// file everything that doesn't move is read once: the file itself, images, materials, and meshes that neither a skin nor
/// morph targets deform. `each` may change the scene it gets, but not its first meshes. Files of other types are loaded
/// for every moment.
///
/// # Errors
/// As for [`load`], and those of `each`.
pub fn load_moments(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    moments: impl IntoIterator<Item = f64>,
    each: &mut dyn FnMut(&mut Loaded) -> Result<ControlFlow<()>>,
) -> Result<()> {
    let path = path.as_ref();
    let options = &with_sidecar(path, options);
    let mut moments = moments.into_iter().map(Some);
    if matches!(formats::of(path), Format::Model(model) if model.is_gltf) {
        return gltf::load_moments(path, options, moments, &mut |loaded| {
            complete(path, options, loaded)?;
            each(loaded)
        });
    }
    let ended = moments.try_for_each(|time_s| {
        let options =
            LoadOptions { gltf: gltf::GltfOptions { time_s, ..options.gltf.clone() }, ..options.clone() };
        match load(path, &options).and_then(|mut loaded| each(&mut loaded)) {
            Ok(ControlFlow::Continue(())) => ControlFlow::Continue(()),
            Ok(ControlFlow::Break(())) => ControlFlow::Break(Ok(())),
            Err(error) => ControlFlow::Break(Err(error)),
        }
    });
    ended.break_value().unwrap_or(Ok(()))
}

/// Loads the frames of a sequence in order and calls `each` with every one until it breaks. Frames of a `.blend`
/// file are Blender's own; of all others, frame N is the time N / `fps`, as in [`load_moments`].
///
/// # Errors
/// As for [`load`], and those of `each`.
pub fn load_frames(
    path: impl AsRef<Path>,
    options: &LoadOptions,
    numbers: impl Iterator<Item = u32>,
    fps: f64,
    each: &mut dyn FnMut(&mut Loaded) -> Result<ControlFlow<()>>,
) -> Result<()> {
    if !is_of_blender(&path) {
        return load_moments(path, options, numbers.map(|number| f64::from(number) / fps), each);
    }
    for frame in numbers {
        let blender = blender::BlenderOptions { frame: Some(frame), ..options.blender.clone() };
        let mut loaded = load(&path, &LoadOptions { blender, ..options.clone() })?;
        if each(&mut loaded)?.is_break() {
            break;
        }
    }
    Ok(())
}

/// With what is to be known of the file beside a model before the model is read: its shutter, where its lights stand, and whether
/// something is subdivided.
fn with_sidecar(path: &Path, options: &LoadOptions) -> LoadOptions {
    let asks_sidecar = matches!(formats::of(path), Format::Model(_)) && !options.no_sidecar;
    let mut options = match asks_sidecar {
        true => scene_file::sidecar::asked_first(path, options),
        false => options.clone(),
    };
    options.keeps_polygons |= options.subdivision.is_some();
    options
}

/// Does its name say that a file is one of Blender?
pub fn is_of_blender(path: impl AsRef<Path>) -> bool {
    matches!(formats::of(path.as_ref()), Format::Blender)
}

/// Does its name say that a file is a scene?
pub fn is_named_as_scene(path: impl AsRef<Path>) -> bool {
    !matches!(formats::of(path.as_ref()), Format::Other)
}

/// The way to a scene from a file of another program, by its ending.
fn way_to_a_scene(extension: &str) -> String {
    let way = match extension {
        "fbx" | "dae" | "3ds" | "max" | "ma" | "mb" | "c4d" | "abc" | "usd" | "usda" | "usdc" | "usdz"
        | "stl" => "import it into Blender and export it as glTF (.glb)",
        "exr" | "hdr" | "png" | "jpg" | "jpeg" => "it is a picture, not a scene",
        _ => {
            return format!("oscura renders models ({}) and scene files (.toml)", formats::models_in_words());
        }
    };
    way.to_string()
}

/// Adds smooth normals to meshes if requested; warns where that has no effect.
fn smoothed(path: &Path, options: &LoadOptions, is_of_meshes: bool, loaded: &mut Loaded) {
    let Some(crease_rad) = options.smooth_rad else { return };
    let meshes = loaded.scene.meshes.iter_mut().filter(|_| is_of_meshes);
    let count =
        meshes.map(|mesh| smooth::smooth(mesh, crease_rad)).filter(|is_smoothed| *is_smoothed).count();
    if count == 0 {
        let why = match is_of_meshes {
            true => "all meshes have normals of their own",
            false => "it is for OBJ and PLY files; scene files have the key 'smooth' of objects",
        };
        let message = format!("{} changes nothing: {why}", Choice::Smooth);
        loaded.warnings.push(Warning::new(path, "", message));
    }
}

/// Adds what lies beside a model and what bare models lack, and checks the whole.
fn complete(path: &Path, options: &LoadOptions, loaded: &mut Loaded) -> Result<()> {
    if matches!(formats::of(path), Format::Model(_)) && !options.no_sidecar {
        let beside = scene_file::sidecar::path_for(path);
        options.files.note(&beside);
        match beside.is_file() {
            true => scene_file::sidecar::apply(&beside, options, loaded)?,
            false => gltf::warn_of_losses(path, loaded),
        }
    }
    if matches!(formats::of(path), Format::Model(model) if model.leaves_up_open) {
        upright::apply(path, options, loaded, true);
    }
    // Meshes have been subdivided, and those of the next moment are others.
    loaded.polygons = subdivide::Polygons::default();
    displace::apply(loaded);
    loaded.is_model = matches!(formats::of(path), Format::Model(_));
    stage::complete(loaded, &options.stage, options.brings_environment);
    let problems = loaded.scene.validate();
    if problems.is_empty() { Ok(()) } else { Err(Error::input_problems(path, problems)) }
}

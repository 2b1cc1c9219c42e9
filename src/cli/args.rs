//! The arguments as clap parses them; nothing is decided here.

use super::aov_arg::AovParser;
use super::asset_args::AssetArgs;
use super::blender_args::BlenderArgs;
use super::camera_args::CameraArgs;
use super::exr_args::ExrArgs;
use super::frames::Frames;
use super::guiding_args::GuidingArgs;
use super::long_args::LongArgs;
use super::numbers::{number, stops};
use super::picture_args::{PictureArgs, views};
use super::preview_arg::PreviewArg;
use super::show_arg::ShowArg;
use super::shutter_args::ShutterArgs;
use super::stage_args::StageArgs;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use oscura::film::{AovSet, AovSpace};
use oscura::output::ViewTransform;
use oscura::render::{Adaptive, PathReuse, Splitting};
use std::path::PathBuf;

/// Ranks of ids in Cryptomattes, unless the user says so.
pub(crate) const CRYPTO_LEVELS: u32 = 6;
/// Frames a second, unless the user says so.
pub(crate) const FRAME_RATE: f64 = 24.0;

/// Shells with completions.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ShellArg {
    Bash,
    Elvish,
    Fish,
    Powershell,
    Zsh,
}

#[derive(Args, Debug)]
pub(crate) struct NewArgs {
    /// The file to write, .toml.
    #[arg(required_unless_present = "beside", conflicts_with = "beside")]
    pub scene: Option<PathBuf>,
    /// Write MODEL.oscura.toml beside a model: what its format can't carry, with what it tells filled in.
    #[arg(long, value_name = "MODEL")]
    pub beside: Option<PathBuf>,
    /// Replace a file that exists.
    #[arg(long)]
    pub force: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct CacheArgs {
    /// The folder [default: oscura/blender in the user's folder of caches].
    #[arg(long = "cache", value_name = "FOLDER")]
    pub folder: Option<PathBuf>,
    /// Delete what is kept.
    #[arg(long)]
    pub clear: bool,
}

#[derive(Args, Debug)]
pub(crate) struct HelpArgs {
    /// A command, 'scene-file', or a part of scene files.
    pub topic: Option<String>,
}

#[derive(Args, Debug)]
pub(crate) struct CompletionsArgs {
    /// Which shell.
    pub shell: ShellArg,
}

#[derive(Args, Debug)]
pub(crate) struct ManArgs {
    /// The command; without one, the program.
    pub command: Option<String>,
}

/// Reconstruction filters.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum FilterArg {
    Box,
    Gaussian,
    BlackmanHarris,
}

/// Single or multiple scattering between microfacets.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum MicrofacetArg {
    Multi,
    Single,
}

/// Fresnel terms.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum FresnelArg {
    /// The curve of the index of refraction.
    Exact,
    /// Schlick's approximation of it, as the glTF specification suggests.
    Schlick,
}

/// How good the tree over the triangles is.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum TreeArg {
    /// Fast where few rays will follow, else full.
    Auto,
    /// Built soon.
    Fast,
    /// Fewest steps a ray.
    Full,
}

/// What to do about self-shadowing on shapes with shading normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TerminatorArg {
    /// Let light fade where it sinks below the triangles.
    Soft,
    /// Let the triangles cut it off.
    Off,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct RenderArgs {
    /// The scenes, one or more: .gltf, .glb, .obj, .ply, .toml or .blend.
    #[arg(required = true, value_name = "SCENE")]
    pub scenes: Vec<PathBuf>,
    /// The one of them that is rendered now.
    #[arg(skip)]
    pub scene: PathBuf,
    /// File to write, .exr, .png, .jpg, .tif, .webp, .hdr or .part, of --orbit and --frames also .gif, .apng, .mp4 or .webm
    /// (video takes the program ffmpeg); may be given several times. In a sequence, #### or %04d stands for the frame; {stem} or {name} stands for the scene's name without its extension.
    #[arg(short, long, required_unless_present = "show", value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Render a sequence, such as 1-10 or 1-10x2: frame N shows the moment N / fps, of .blend files Blender's frame N.
    #[arg(long, value_name = "A-B", conflicts_with = "time")]
    pub frames: Option<Frames>,
    /// Frames a second of a sequence or a moving picture.
    #[arg(long, value_name = "N", default_value_t = FRAME_RATE, value_parser = frames_per_second, allow_negative_numbers = true)]
    pub fps: f64,
    /// Render N pictures while the camera goes once around: numbered files, or one moving picture.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000), conflicts_with = "frames", allow_negative_numbers = true)]
    pub orbit: Option<u32>,
    /// Samples a pixel [default: 128].
    #[arg(long, alias = "samples", value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub spp: Option<u32>,
    /// Width in pixels [default: from the height or 1280].
    #[arg(long, value_name = "W", value_parser = clap::value_parser!(u32).range(1..=65536), allow_negative_numbers = true)]
    pub width: Option<u32>,
    /// Height in pixels [default: from the width and the camera's aspect ratio, else 16:9].
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u32).range(1..=65536), allow_negative_numbers = true)]
    pub height: Option<u32>,
    /// Most scattering events of a path; 0 shows emission only [default: 100].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub depth: Option<u32>,
    /// Seed of all randomness [default: 0].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub seed: Option<u32>,
    /// Threads [default: one a core]. The picture doesn't depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Camera by name or number, from 0 [default: 0].
    #[arg(long, value_name = "CAMERA")]
    pub camera: Option<String>,
    /// Environment picture (.exr, .hdr or 8-bit), equirectangular; '' for none.
    #[arg(long, value_name = "FILE", value_parser = OsStringValueParser::new().map(PathBuf::from))]
    pub env: Option<PathBuf>,
    /// Factor on the environment.
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = strength)]
    pub env_strength: Option<f32>,
    /// Turns the environment picture about the vertical axis, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = degrees)]
    pub env_rotation: Option<f64>,
    /// Keep the environment out of the camera's sight: pictures are transparent there, and its light stays.
    #[arg(long, conflicts_with = "background")]
    pub transparent: bool,
    /// Make smooth glass transparent, too, where nothing is behind it (with --transparent); its reflections stay.
    #[arg(long)]
    pub transparent_glass: bool,
    /// Let glTF and OBJ files refer to files outside their folder.
    #[arg(long)]
    pub allow_external: bool,
    /// Show the points of a point cloud as spheres of this radius, metres.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub point_radius: Option<f64>,
    /// Don't use the settings that lie beside the model (model.oscura.toml beside model.glb).
    #[arg(long)]
    pub no_sidecar: bool,
    /// Reconstruction filter [default: blackman-harris].
    #[arg(long)]
    pub filter: Option<FilterArg>,
    /// Show the picture in the browser while it renders; =address prints the page's address only, =tev (or =tev:HOST:PORT) has a running tev show it.
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "page")]
    pub preview: Option<PreviewArg>,
    /// Draw the finished picture in the terminal: =blocks, =kitty or =sixel in place of what the terminal is known for.
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "auto", hide_possible_values = true)]
    pub show: Option<ShowArg>,
    /// Write the EXR's colour as 32-bit floats.
    #[arg(long)]
    pub float: bool,
    /// Further channels of the EXR.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = AovParser)]
    pub aov: Vec<AovSet>,
    /// The space of position, normal and geometric_normal: world or camera.
    #[arg(long, value_name = "SPACE", default_value = "world")]
    pub aov_space: AovSpace,
    /// Further channels RGBA_key of the EXR for the light of each group of lights.
    #[arg(long)]
    pub light_groups: bool,
    /// Ranks of ids in Cryptomattes.
    #[arg(long, value_name = "N", default_value_t = CRYPTO_LEVELS, value_parser = clap::value_parser!(u32).range(1..=64), allow_negative_numbers = true)]
    pub crypto_levels: u32,
    /// Microfacet model [default: multi].
    #[arg(long)]
    pub microfacet: Option<MicrofacetArg>,
    /// How dielectric layers of glTF materials reflect more towards grazing incidence [default: exact].
    #[arg(long)]
    pub fresnel: Option<FresnelArg>,
    /// Render by wavelength instead of red, green and blue.
    #[arg(long)]
    pub spectral: bool,
    /// Remedy for the jagged edge of self-shadowing on shapes with shading normals.
    #[arg(long, default_value = "soft")]
    pub terminator: TerminatorArg,
    /// Share paths between neighbouring pixels: auto, off, or groups such as 4x4 [default: auto].
    #[arg(long, value_name = "REUSE", default_value = "auto", hide_default_value = true)]
    pub path_reuse: PathReuse,
    /// Let several paths go on from the first surface of each sample: auto, off, 2, 4, 8 or 16 [default: auto].
    #[arg(long, value_name = "PATHS", default_value = "auto", hide_default_value = true)]
    pub splitting: Splitting,
    /// Give noisy pixels more samples and others fewer: auto or off [default: off].
    #[arg(long, value_name = "CHOICE", default_value = "off", hide_default_value = true)]
    pub adaptive: Adaptive,
    /// The tree over the triangles, which pictures don't depend on: fast to build, or full for fast rays.
    #[arg(long, default_value = "auto")]
    pub tree: TreeArg,
    /// How PNGs and the like look: a name, or a table (cinespace, .csp) [default: srgb; filmic for models that a stage lights, unless their background is chosen].
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,
    /// Exposure of PNGs and the like in stops, -100 to 100 [default: 0].
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, value_parser = stops)]
    pub exposure: Option<f32>,
    /// Dither pictures of 8 bits.
    #[arg(long)]
    pub dither: bool,
    /// Whose picture it is, for the EXR's header.
    #[arg(long, value_name = "NAME")]
    pub owner: Option<String>,
    /// Leave times and dates out of the files: the same command gives the same bytes.
    #[arg(long)]
    pub reproducible: bool,
    /// Treat warnings as errors.
    #[arg(long)]
    pub strict: bool,
    /// Say what was left out because the picture doesn't need it.
    #[arg(long)]
    pub explain: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
    /// Print one JSON object about the run on standard output; one a frame for a sequence.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub place: CameraArgs,
    #[command(flatten)]
    pub long: LongArgs,
    #[command(flatten)]
    pub guiding: GuidingArgs,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub exr: ExrArgs,
    #[command(flatten)]
    pub stage: StageArgs,
    #[command(flatten)]
    pub shutter: ShutterArgs,
    #[command(flatten)]
    pub asset: AssetArgs,
    #[command(flatten)]
    pub blender: BlenderArgs,
}

#[derive(Args, Debug)]
pub(crate) struct InspectArgs {
    /// The scene: .gltf, .glb, .obj, .ply, .toml or .blend.
    pub scene: PathBuf,
    /// Let glTF and OBJ files refer to files outside their folder.
    #[arg(long)]
    pub allow_external: bool,
    /// Show the points of a point cloud as spheres of this radius, metres.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub point_radius: Option<f64>,
    /// Don't use the settings that lie beside the model (model.oscura.toml beside model.glb).
    #[arg(long)]
    pub no_sidecar: bool,
    /// Print one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub asset: AssetArgs,
    #[command(flatten)]
    pub blender: BlenderArgs,
}

#[derive(Args, Debug)]
pub(crate) struct ExportArgs {
    /// The scene: .blend.
    pub scene: PathBuf,
    /// Folder to write, new or empty.
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Replace files of the same names in a folder that is not empty.
    #[arg(long)]
    pub force: bool,
    /// Scene by name [default: the one that was open].
    #[arg(long = "scene", value_name = "SCENE")]
    pub scene_name: Option<String>,
    /// Frame to export [default: the file's current one].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub frame: Option<u32>,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
    /// Treat warnings as errors.
    #[arg(long)]
    pub strict: bool,
    #[command(flatten)]
    pub blender: BlenderArgs,
}

#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// The picture (.exr or .hdr).
    pub picture: PathBuf,
    /// The reference.
    pub reference: PathBuf,
    /// The same picture with another seed, for a statistical test; exit code 1 if it fails.
    #[arg(long, value_name = "FILE", requires = "var")]
    pub other_seed: Option<PathBuf>,
    /// Variance of the reference's pixels.
    #[arg(long, value_name = "FILE", requires = "other_seed")]
    pub var: Option<PathBuf>,
    /// Write the signed difference as a picture: red where the picture is brighter, blue where it is darker.
    #[arg(short, long, value_name = "FILE.png")]
    pub output: Option<PathBuf>,
    /// Write the picture, the reference and their FLIP differences beside each other.
    #[arg(long, value_name = "FILE.png")]
    pub side_by_side: Option<PathBuf>,
    /// Print one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

fn frames_per_second(text: &str) -> Result<f64, String> {
    number(text, |f| f.is_finite() && f > 0.0, "a number above 0")
}

fn strength(text: &str) -> Result<f32, String> {
    let fits = |v: f64| v >= 0.0 && v <= f64::from(f32::MAX);
    number(text, fits, "a finite number, 0 or more").map(|v| v as f32)
}

fn degrees(text: &str) -> Result<f64, String> {
    number(text, f64::is_finite, "a finite number of degrees")
}

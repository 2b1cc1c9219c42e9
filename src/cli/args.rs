//! The arguments as clap parses them; nothing is decided here.

use super::camera_args::{CameraArgs, ShutterArgs};
use super::exr_args::ExrArgs;
use super::parsers::{AovParser, Frames, PreviewArg, ShowArg, number, region, stops};
use super::picture_args::{PictureArgs, views};
use super::progress::ProgressArg;
use super::scene_args::{AssetArgs, BlenderArgs, StageArgs};
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use oscura::film::{AovSet, AovSpace};
use oscura::output::ViewTransform;
use oscura::output::part::Region;
use oscura::render::{Adaptive, Guiding, PathReuse, Splitting};
use std::path::PathBuf;
use std::time::Duration;

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

// Arguments about renders that take long: when they stop, how they survive, how they are divided.

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Long renders")]
pub(crate) struct LongArgs {
    /// Stop when the picture's relative error is about P percent, at --max-spp samples at most [default then: 65536].
    #[arg(long, value_name = "P", value_parser = percent, allow_negative_numbers = true)]
    pub noise: Option<f32>,
    /// Fewest samples of a pixel with --noise or --adaptive auto.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub min_spp: Option<u32>,
    /// Most samples of a pixel with --noise (where --spp says the same) or --adaptive auto.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub max_spp: Option<u32>,
    /// Stop after this many seconds of rendering and write what is there.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub time_limit: Option<Duration>,
    /// Also write the picture so far, each time that so many seconds of rendering have passed.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub save_every: Option<Duration>,
    /// Keep in FILE what --resume goes on from: written now and then, at a signal, and at the end.
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Seconds between two writings of the checkpoint.
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "60", requires = "checkpoint")]
    pub checkpoint_interval: Duration,
    /// Go on from the checkpoint, if there is one, to as many samples as before or to more. Of a sequence, leave out those
    /// frames whose pictures exist; a frame that is interrupted is not written.
    #[arg(long)]
    pub resume: bool,
    /// Arrange samples so that a picture of at most 256 a pixel can be gone on from to N later.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub plan: Option<u32>,
    /// Take only the samples A to B, B not included, of all --spp, in blocks of eight, and write a .part file.
    #[arg(long, value_name = "A..B", value_parser = range)]
    pub sample_range: Option<(u32, u32)>,
    /// Take only the pixels from column X0 and row Y0 to before column X1 and row Y1: into a .part file to be merged with
    /// others, or into a picture as --crop does.
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = region)]
    pub region: Option<Region>,
    /// How progress is told: plain lines, json or openjd lines on standard output, none [default: a bar on a terminal].
    #[arg(long, value_name = "KIND")]
    pub progress: Option<ProgressArg>,
    /// Refuse pictures and scenes that take more memory, such as 8G or 500M [default: what the machine has].
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub memory_limit: Option<u64>,
    /// Memory for the images of textures, such as 4G or 500M: what is beyond is decoded again when it is needed. The picture doesn't depend
    /// on it [default: a quarter of the machine's].
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub texture_memory: Option<u64>,
}

fn percent(text: &str) -> Result<f32, String> {
    let valid = |v: &f32| *v > 0.0 && *v <= 1000.0;
    text.parse().ok().filter(valid).ok_or_else(|| "must be a number of percent above 0".to_string())
}

fn seconds(text: &str) -> Result<Duration, String> {
    let value: f64 = text.parse().map_err(|_| "not a number of seconds".to_string())?;
    let valid = value > 0.0;
    Duration::try_from_secs_f64(value)
        .ok()
        .filter(|_| valid)
        .ok_or_else(|| "must be a number of seconds above 0".to_string())
}

fn range(text: &str) -> Result<(u32, u32), String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    ends.filter(|(a, b)| a < b).ok_or_else(|| "not a range of samples such as 0..64".to_string())
}

/// A number of bytes: `500M`, `8G`, `8GiB`.
fn bytes(text: &str) -> Result<u64, String> {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let unit = unit.trim().to_ascii_uppercase();
    let bits = match unit.trim_end_matches('B').trim_end_matches('I') {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => return Err("not a size such as 500M or 8G".into()),
    };
    let value = number.parse::<f64>().ok().map(|n| n * f64::from(bits).exp2());
    let value = value.filter(|v| *v >= 1.0).ok_or("not a size such as 500M or 8G")?;
    Ok(value as u64)
}

// Arguments about guiding.

#[derive(Args, Clone, Debug)]
pub(crate) struct GuidingArgs {
    /// Guide paths at diffuse surfaces to where light came from, and end them where little is expected of them: on, off, or auto,
    /// where it makes indirect light less noisy. Learning takes a fifth of the work of the whole picture, also for a part of it; rooms
    /// lit through a door gain several times that.
    #[arg(long, value_name = "G", default_value = "auto")]
    pub guiding: Guiding,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values() {
        assert_eq!((range("0..64"), range("8..9")), (Ok((0, 64)), Ok((8, 9))));
        assert!(["", "4", "4..4", "5..4", "-1..3", "a..b"].iter().all(|text| range(text).is_err()));
        assert_eq!(region("1,2,3,4"), Ok(Region { x0: 1, y0: 2, x1: 3, y1: 4 }));
        assert!(["", "1,2,3", "3,0,3,4", "0,0,-1,1"].iter().all(|text| region(text).is_err()));
        assert_eq!((bytes("500M"), bytes("1.5 GiB"), bytes("7")), (Ok(500 << 20), Ok(3 << 29), Ok(7)));
        assert!(["", "G", "-1G", "5X"].iter().all(|text| bytes(text).is_err()));
    }
}

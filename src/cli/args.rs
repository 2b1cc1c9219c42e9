//! Command-line arguments, as parsed by clap.

use super::camera_args::{CameraArgs, ShutterArgs};
use super::parsers::{
    AovParser, FRAME_RATE, Frames, PreviewArg, ShowArg, bounce_limits, clamp, frames_per_second, integer,
    named, number, region, stops,
};
use super::picture_args::{ExrArgs, PictureArgs, Quality, views};
use super::progress::ProgressArg;
use super::scene_args::{AssetArgs, BlenderArgs, SourceArgs, StageArgs};
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use oscura::film::{AovSet, AovSpace};
use oscura::output::ViewTransform;
use oscura::output::part::Region;
use oscura::render::{BvhQuality, Guiding, LightSelection, PathReuse, Splitting, setting_help};
use oscura::scene::{BounceLimits, Clamp, EnergyCompensation, Filter, FresnelModel, ShadowTerminator};
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

/// Default number of Cryptomatte ranks.
pub(crate) const CRYPTO_LEVELS: u32 = 6;

/// Shells that have completion scripts.
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
    /// Scene file to write (.toml).
    #[arg(required_unless_present = "sidecar", conflicts_with = "sidecar")]
    pub scene: Option<PathBuf>,
    /// Write a sidecar MODEL.oscura.toml next to a model, pre-filled with its materials, lights and cameras: settings
    /// that the model's format cannot store.
    #[arg(long, value_name = "MODEL")]
    pub sidecar: Option<PathBuf>,
    /// Overwrite an existing file.
    #[arg(long)]
    pub force: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct CacheArgs {
    /// Cache folder [default: oscura/blender in the user's cache directory].
    #[arg(long = "cache", value_name = "FOLDER")]
    pub folder: Option<PathBuf>,
    /// Delete all cached files.
    #[arg(long)]
    pub clear: bool,
}

#[derive(Args, Debug)]
pub(crate) struct HelpArgs {
    /// A command, an option, a topic, 'scene-file', or a section of scene files.
    #[arg(allow_hyphen_values = true)]
    pub topic: Vec<String>,
}

#[derive(Args, Debug)]
pub(crate) struct CompletionsArgs {
    /// Shell.
    pub shell: ShellArg,
}

#[derive(Args, Debug)]
pub(crate) struct ManArgs {
    /// Command [default: the program itself].
    pub command: Option<String>,
}

/// Parser of `--bvh`.
fn bvh() -> impl TypedValueParser<Value = BvhQuality> {
    named(&BvhQuality::ALL, BvhQuality::name, |quality| match quality {
        BvhQuality::Fast => "Fast to build",
        BvhQuality::Full => "Fewest traversal steps per ray",
        _ => "Fast for renders of few rays, else full",
    })
}

/// Parser of `--fresnel`.
fn fresnel() -> impl TypedValueParser<Value = FresnelModel> {
    named(&FresnelModel::ALL, FresnelModel::name, |model| match model {
        FresnelModel::Exact => "Dielectric Fresnel equations for the index of refraction",
        FresnelModel::Schlick => "Schlick's approximation, as the glTF specification suggests",
    })
}

/// A frame of a sequence.
#[derive(Clone, Debug)]
pub struct SequenceFrame {
    /// Frame number; `--animate-seed` adds it to the seed.
    pub number: u32,
    /// Name in messages.
    pub label: String,
    /// Denoised temporally, with its neighbours.
    pub is_averaged: bool,
    /// Rendered only as a neighbour for temporal denoising, and not written.
    pub is_neighbour: bool,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct RenderArgs {
    /// Scenes to render: .gltf, .glb, .vrm, .obj, .ply, .spz, .stl, .3mf, .zip, .toml or .blend.
    #[arg(required = true, value_name = "SCENE")]
    pub scenes: Vec<PathBuf>,
    /// The current scene of `scenes`.
    #[arg(skip)]
    pub scene: PathBuf,
    /// Without -o: text chunk that identifies pictures written by this command (see `pictures`).
    #[arg(skip)]
    pub mark: Option<String>,
    /// The current frame of a sequence.
    #[arg(skip)]
    pub frame: Option<SequenceFrame>,
    /// Output file: .exr, .png, .jpg, .tif, .webp, .hdr or .part; may be given several times [default: SCENE.png].
    ///
    /// With --orbit and --frames also .gif, .apng, .mp4 or .webm (video needs the program ffmpeg). #### or %04d is
    /// replaced by the frame number, {stem} or {name} by the scene's name without extension. '-' writes a PNG to
    /// standard output, 'exr:-' an EXR (also jpg:-, tif:-, webp:-, hdr:-). The default is in the current folder and never
    /// replaces a file that the same command didn't write.
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
    /// Print the details of the render: geometry, samples, time and memory.
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Image size in pixels, such as 1920x1080; short for --width and --height.
    #[arg(long, visible_alias = "resolution", value_name = "WxH", conflicts_with_all = ["width", "height"], value_parser = size)]
    pub size: Option<(u32, u32)>,
    #[arg(long, help = setting_help("width"), value_name = "W", value_parser = integer::<u32>(1, 65536), allow_negative_numbers = true)]
    pub width: Option<u32>,
    #[arg(long, help = setting_help("height"), value_name = "H", value_parser = integer::<u32>(1, 65536), allow_negative_numbers = true)]
    pub height: Option<u32>,
    /// Render an animation: a frame range such as 1-10, or 1-10x2 with a step.
    ///
    /// Frame N is the time N / fps; in .blend files it is Blender's frame N.
    #[arg(long, value_name = "A-B", conflicts_with = "time")]
    pub frames: Option<Frames>,
    /// Frame rate of animations, frames per second.
    #[arg(long, value_name = "N", default_value_t = FRAME_RATE, value_parser = frames_per_second, allow_negative_numbers = true)]
    pub fps: f64,
    /// Render a turntable of N frames, as numbered files or as one animation.
    ///
    /// The camera orbits the model once.
    #[arg(long, value_name = "N", value_parser = integer::<u32>(2, 100_000), conflicts_with = "frames", allow_negative_numbers = true)]
    pub orbit: Option<u32>,
    #[command(flatten)]
    pub shutter: ShutterArgs,
    /// Camera by name or by index from 0 [default: 0].
    #[arg(long, value_name = "CAMERA")]
    pub camera: Option<String>,
    #[command(flatten)]
    pub camera_args: CameraArgs,
    /// Environment map (HDRI): an equirectangular .exr, .hdr or 8-bit image; 'none' for none.
    #[arg(long, value_name = "FILE", value_parser = OsStringValueParser::new().map(environment))]
    pub env: Option<PathBuf>,
    /// Strength of the environment: factor on its radiance.
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = strength)]
    pub env_strength: Option<f32>,
    /// Rotation of the environment map about the vertical axis, degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = degrees)]
    pub env_rotation: Option<f64>,
    #[command(flatten)]
    pub source: SourceArgs,
    #[command(flatten)]
    pub asset: AssetArgs,
    #[command(flatten)]
    pub blender: BlenderArgs,
    /// Quality preset: when to stop, and whether to denoise [default: normal, unless another option or the scene sets when to
    /// stop].
    #[arg(long, value_name = "Q", value_enum, conflicts_with_all = ["spp", "noise", "plan", "sample_range"])]
    pub quality: Option<Quality>,
    /// Samples per pixel [default: set by the quality; 128 with a time limit and for parts of images].
    #[arg(long, alias = "samples", value_name = "N", value_parser = integer::<u32>(1, u32::MAX), allow_negative_numbers = true)]
    pub spp: Option<u32>,
    #[arg(long, help = setting_help("max_depth"), value_name = "N", allow_negative_numbers = true)]
    pub depth: Option<u32>,
    #[arg(long, help = setting_help("bounces"), value_name = "LIMITS", value_parser = bounce_limits)]
    pub bounces: Option<BounceLimits>,
    #[arg(long, help = setting_help("clamp"), value_name = "LIMITS", value_parser = clamp)]
    pub clamp: Option<Clamp>,
    #[arg(long, help = setting_help("filter_glossy"), value_name = "F", allow_negative_numbers = true, value_parser = strength)]
    pub filter_glossy: Option<f32>,
    /// Ignore the scene's bounce limits, clamps, glossy filter and skipped caustics, which Blender files usually have.
    #[arg(long, conflicts_with_all = ["bounces", "clamp", "filter_glossy"])]
    pub unbiased: bool,
    #[arg(long, help = setting_help("seed"), value_name = "N", value_parser = integer::<u32>(0, u32::MAX), allow_negative_numbers = true)]
    pub seed: Option<u32>,
    /// Vary the noise of a sequence: add the frame number to the seed, so that `oscura denoise` can average over frames.
    #[arg(long)]
    pub animate_seed: bool,
    #[arg(long, help = setting_help("aovs"), value_name = "LIST", value_delimiter = ',', value_parser = AovParser)]
    pub aov: Vec<AovSet>,
    #[arg(long, help = setting_help("aov_space"), value_name = "SPACE", default_value = "world")]
    pub aov_space: AovSpace,
    #[arg(long, help = setting_help("light_groups"))]
    pub light_groups: bool,
    #[arg(long, help = setting_help("matte_levels"), value_name = "N", default_value_t = CRYPTO_LEVELS, value_parser = integer::<u32>(1, 64), allow_negative_numbers = true)]
    pub crypto_levels: u32,
    /// Transparent background: the camera does not see the environment, which still lights the scene.
    #[arg(long, conflicts_with = "background")]
    pub transparent: bool,
    /// With --transparent, also make smooth glass in front of the background transparent; its reflections stay.
    #[arg(long)]
    pub transparent_glass: bool,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Number of threads [default: one per core]. The image does not depend on it.
    #[arg(long, value_name = "N", value_parser = integer::<u16>(1, 1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    #[command(flatten)]
    pub long: LongArgs,
    #[arg(long, help = setting_help("filter"), value_parser = named(&Filter::ALL, Filter::name, |_| ""))]
    pub filter: Option<Filter>,
    #[arg(long, help = setting_help("filter_radius"), value_name = "PIXELS", allow_negative_numbers = true, value_parser = filter_radius)]
    pub filter_radius: Option<f32>,
    /// Show the image in the browser while it renders; =address only prints the page's address, =tev (or =tev:HOST:PORT)
    /// sends the image to a running tev.
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "page")]
    pub preview: Option<PreviewArg>,
    /// Show the finished image in the terminal; =blocks, =kitty or =sixel overrides the detected graphics protocol.
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "auto", hide_possible_values = true)]
    pub show: Option<ShowArg>,
    /// Write the colour channels of EXRs as 32-bit floats instead of half floats.
    #[arg(long)]
    pub float: bool,
    /// Microfacet scattering: multi compensates the energy that single scattering loses [default: multi].
    #[arg(long, value_parser = named(&EnergyCompensation::ALL, EnergyCompensation::name, |_| ""))]
    pub microfacet: Option<EnergyCompensation>,
    /// Fresnel term of the dielectric layers of glTF materials [default: exact].
    #[arg(long, value_parser = fresnel())]
    pub fresnel: Option<FresnelModel>,
    /// Spectral rendering: sample wavelengths instead of red, green and blue.
    #[arg(long)]
    pub spectral: bool,
    #[arg(long, help = setting_help("terminator"), value_parser = named(&ShadowTerminator::ALL, ShadowTerminator::name, |_| ""))]
    pub terminator: Option<ShadowTerminator>,
    #[arg(long, help = setting_help("path_reuse"), value_name = "REUSE", default_value = "auto", hide_default_value = true)]
    pub path_reuse: PathReuse,
    #[arg(long, help = setting_help("splitting"), value_name = "PATHS", default_value = "auto", hide_default_value = true)]
    pub splitting: Splitting,
    /// BVH quality: fast builds sooner, full traces faster. The image does not depend on it.
    #[arg(long, default_value = "auto", value_parser = bvh())]
    pub bvh: BvhQuality,
    /// View transform of PNG and other 8- or 16-bit output: a name, or a lookup table (.csp) [default: srgb; filmic for
    /// models lit by a stage, unless --background is given].
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,
    /// Exposure of PNG and other display-referred output, stops, -100 to 100 [default: 0].
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, value_parser = stops)]
    pub exposure: Option<f32>,
    /// Dither 8-bit output.
    #[arg(long)]
    pub dither: bool,
    /// Owner of the image, for the EXR header.
    #[arg(long, value_name = "NAME")]
    pub owner: Option<String>,
    /// Write no dates and render times: the same command writes the same bytes.
    #[arg(long)]
    pub reproducible: bool,
    /// Treat warnings as errors.
    #[arg(long)]
    pub strict: bool,
    /// List scene content that was skipped because it does not affect the image.
    #[arg(long)]
    pub explain: bool,
    /// Print a JSON report of the render on standard output; one per frame of an animation.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub guiding: GuidingArgs,
    #[command(flatten)]
    pub exr: ExrArgs,
    #[command(flatten)]
    pub stage: StageArgs,
}

impl RenderArgs {
    /// Replaces `--size` by `--width` and `--height`.
    pub fn resolve_size(&mut self) {
        if let Some((width, height)) = self.size.take() {
            (self.width, self.height) = (Some(width), Some(height));
        }
    }
}

#[derive(Args, Debug)]
pub(crate) struct InspectArgs {
    /// Scene: .gltf, .glb, .vrm, .obj, .ply, .spz, .stl, .3mf, .zip, .toml or .blend.
    pub scene: PathBuf,
    #[command(flatten)]
    pub source: SourceArgs,
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
    /// Blender file (.blend).
    pub scene: PathBuf,
    /// Output folder, new or empty.
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Write into a folder that is not empty, overwriting files of the same names.
    #[arg(long)]
    pub force: bool,
    /// Scene by name [default: the active one].
    #[arg(long = "scene", value_name = "SCENE")]
    pub scene_name: Option<String>,
    /// Frame to export [default: the current frame of the file].
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
    /// Image to test (.exr or .hdr).
    pub picture: PathBuf,
    /// Reference image.
    pub reference: PathBuf,
    /// The tested image rendered with another seed, for a z-test of the mean; exit code 1 if the test fails.
    #[arg(long, value_name = "FILE", requires = "var")]
    pub other_seed: Option<PathBuf>,
    /// Per-pixel variance of the reference image.
    #[arg(long, value_name = "FILE", requires = "other_seed")]
    pub var: Option<PathBuf>,
    /// Write the signed difference as a PNG: red where the image is brighter than the reference, blue where darker.
    #[arg(short, long, value_name = "FILE.png")]
    pub output: Option<PathBuf>,
    /// Write a PNG of the image, the reference and their FLIP error map side by side.
    #[arg(long, value_name = "FILE.png")]
    pub side_by_side: Option<PathBuf>,
    /// Print one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

fn strength(text: &str) -> Result<f32, String> {
    let fits = |v: f64| v >= 0.0 && v <= f64::from(f32::MAX);
    number(text, fits, "a finite number, 0 or more").map(|v| v as f32)
}

fn filter_radius(text: &str) -> Result<f32, String> {
    number(text, |v| (0.005..=16.0).contains(&v), "a number of pixels from 0.005 to 16").map(|v| v as f32)
}

/// The file of `--env`; an empty path for 'none'.
fn environment(text: OsString) -> PathBuf {
    if text == "none" { PathBuf::new() } else { text.into() }
}

/// Width and height, `1920x1080`.
fn size(text: &str) -> Result<(u32, u32), String> {
    let edge = |text: &str| text.trim().parse().ok().filter(|edge| (1..=65536).contains(edge));
    let edges = text.split_once(['x', 'X', '×']).and_then(|(w, h)| Some((edge(w)?, edge(h)?)));
    edges.ok_or_else(|| "must be width and height such as 1920x1080, each from 1 to 65536".to_string())
}

fn degrees(text: &str) -> Result<f64, String> {
    number(text, f64::is_finite, "a finite number of degrees")
}

/// Options of long renders: stopping conditions, checkpoints, partial renders, memory.
#[derive(Args, Clone, Debug)]
pub(crate) struct LongArgs {
    /// Noise threshold: stop when the estimated relative error of the image (after denoising, if enabled) is below P percent.
    ///
    /// Stops after --max-spp samples per pixel at the latest [default: 65536].
    #[arg(long, value_name = "P", value_parser = percent, allow_negative_numbers = true)]
    pub noise: Option<f32>,
    /// Minimum samples per pixel with --noise.
    #[arg(long, value_name = "N", value_parser = integer::<u32>(1, u32::MAX), allow_negative_numbers = true)]
    pub min_spp: Option<u32>,
    /// Maximum samples per pixel with --noise (same as --spp).
    #[arg(long, value_name = "N", value_parser = integer::<u32>(1, u32::MAX), allow_negative_numbers = true)]
    pub max_spp: Option<u32>,
    #[arg(long, help = setting_help("time_limit"), value_name = "S", value_parser = seconds)]
    pub time_limit: Option<Duration>,
    /// Write the unfinished image every S seconds of rendering.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub save_every: Option<Duration>,
    /// Checkpoint file for --resume, written periodically, on interruption and at the end.
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Seconds between checkpoints.
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "60", requires = "checkpoint")]
    pub checkpoint_interval: Duration,
    /// Resume from the checkpoint, if it exists; for animations, skip frames whose files exist.
    ///
    /// The number of samples may be increased. An interrupted frame of an animation is not written.
    #[arg(long)]
    pub resume: bool,
    #[arg(long, help = setting_help("planned"), value_name = "N", value_parser = integer::<u32>(1, u32::MAX), allow_negative_numbers = true)]
    pub plan: Option<u32>,
    #[arg(long, help = setting_help("sample_range"), value_name = "A..B", value_parser = range)]
    pub sample_range: Option<(u32, u32)>,
    /// Render only the pixels of a rectangle (X1 and Y1 exclusive): into a .part file for 'oscura merge', or into an
    /// image as --crop does.
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = region)]
    pub region: Option<Region>,
    /// Progress reports: plain lines on standard error, json or openjd lines on standard output, or none [default: a
    /// progress bar on a terminal].
    #[arg(long, value_name = "KIND")]
    pub progress: Option<ProgressArg>,
    /// Memory limit, such as 8G or 500M: larger images and scenes are refused [default: the machine's memory].
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub memory_limit: Option<u64>,
    /// Texture memory, such as 4G or 500M; textures beyond it are compressed, in memory or in a temporary file. The image does not
    /// depend on it [default: 1 KiB per pixel, from 192M to a quarter of the machine's memory].
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub texture_memory: Option<u64>,
}

fn percent(text: &str) -> Result<f32, String> {
    let valid = |v: &f32| *v > 0.0 && *v <= 1000.0;
    text.parse().ok().filter(valid).ok_or_else(|| "must be a percentage above 0, at most 1000".to_string())
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
pub(super) fn bytes(text: &str) -> Result<u64, String> {
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

#[derive(Args, Clone, Debug)]
pub(crate) struct GuidingArgs {
    #[arg(long, help = setting_help("guiding"), value_name = "G", default_value = "auto")]
    pub guiding: Guiding,
    #[arg(long, help = setting_help("light_selection"), value_name = "L", default_value = "auto")]
    pub light_selection: LightSelection,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_parsed() {
        assert_eq!((size("1920x1080"), size("8 X 9")), (Ok((1920, 1080)), Ok((8, 9))));
        assert!(["", "x", "8", "0x8", "8x65537", "8x8x8", "-1x8"].iter().all(|text| size(text).is_err()));
        assert_eq!((range("0..64"), range("8..9")), (Ok((0, 64)), Ok((8, 9))));
        assert!(["", "4", "4..4", "5..4", "-1..3", "a..b"].iter().all(|text| range(text).is_err()));
        assert_eq!(region("1,2,3,4"), Ok(Region { x0: 1, y0: 2, x1: 3, y1: 4 }));
        assert!(["", "1,2,3", "3,0,3,4", "0,0,-1,1"].iter().all(|text| region(text).is_err()));
        assert_eq!((bytes("500M"), bytes("1.5 GiB"), bytes("7")), (Ok(500 << 20), Ok(3 << 29), Ok(7)));
        assert!(["", "G", "-1G", "5X"].iter().all(|text| bytes(text).is_err()));
    }
}

//! Output pictures of a run: targets, encoding, metadata, denoising, animation files.

use super::args::RenderArgs;
use super::progress::{ProgressArg, ProgressTarget, StageProgress};
use super::report::{PrintedMessages, name_options_in_warnings, print_bytes};
use oscura::error::{Error, Result, Warning};
use oscura::film::{AovSet, Film};
use oscura::output::{
    Animation, AnimationFormat, ExrOptions, ExrWindow, Format, Linear, Metadata, OutputOptions, PngOptions,
    Video, VideoFormat, check_target, encode, is_same_target, png_text, with_png_text, write_atomically,
};
use oscura::render::{Picture, Rendering};
use oscura::work_counter::WorkCounter;
use std::borrow::Cow;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Extension of partial renders.
const PART: &str = "part";

/// Output files of a run.
pub(crate) struct Targets {
    pictures: Vec<(PathBuf, Format)>,
    parts: Vec<PathBuf>,
    /// The first file that existed before.
    existing: Option<PathBuf>,
}

impl Targets {
    /// Sorts the paths by kind and checks that all can be written.
    ///
    /// # Errors
    /// A usage error for unknown formats and for duplicate files; an output error for files that can't be written.
    pub fn check(paths: &[PathBuf]) -> Result<Targets> {
        let existing = paths.iter().find(|path| path.exists()).cloned();
        let mut targets = Targets { pictures: Vec::new(), parts: Vec::new(), existing };
        for (index, path) in paths.iter().enumerate() {
            if let Some(earlier) = paths[..index].iter().find(|earlier| is_same_target(earlier, path)) {
                let message = format!("-o {} is given twice", path.display());
                let help = format!("it is the same file as -o {}", earlier.display());
                return Err(Error::usage(message).with_help(help));
            }
            if is_animation(path) {
                let message = format!("{}: an animation needs more than one frame", path.display());
                return Err(Error::usage(message).with_help("add --orbit N or --frames A-B"));
            }
            match is_part(path) {
                true => targets.parts.push(path.clone()),
                false => targets.pictures.push((path.clone(), format_of(path)?)),
            }
        }
        paths.iter().filter(|path| !is_stdout(path)).try_for_each(check_target)?;
        Ok(targets)
    }

    /// Checks that the formats can store a picture of this size.
    ///
    /// # Errors
    /// A usage error for the first format that can't.
    pub fn check_size(&self, width: u32, height: u32) -> Result<()> {
        self.pictures.iter().try_for_each(|(path, format)| match format.max_edge() {
            Some(largest) if width.max(height) > largest => {
                let message = format!("{}: {width} x {height} is too large", path.display());
                let help =
                    format!("this format allows at most {largest} pixels per side; write .exr or .png");
                Err(Error::usage(message).with_help(help))
            }
            _ => Ok(()),
        })
    }

    /// True if any output is an EXR, or a partial render, which may become one.
    pub fn has_exr(&self) -> bool {
        !self.parts.is_empty() || self.pictures.iter().any(|(_, format)| *format == Format::Exr)
    }

    /// True if any output is display-referred.
    pub fn has_display_referred(&self) -> bool {
        self.pictures.iter().any(|(_, format)| !matches!(format, Format::Exr | Format::Hdr))
    }

    /// True if any output is not a partial render.
    pub fn has_pictures(&self) -> bool {
        !self.pictures.is_empty()
    }

    /// The first file that existed before the run.
    pub fn existing(&self) -> Option<&Path> {
        self.existing.as_deref()
    }

    /// The partial renders.
    pub fn parts(&self) -> &[PathBuf] {
        &self.parts
    }

    /// Names of the output files; partial renders are included only if `with_parts`.
    pub fn names(&self, with_parts: bool) -> Vec<String> {
        let pictures = self.pictures.iter().map(|(path, _)| path);
        let parts = self.parts.iter().filter(|_| with_parts);
        let name = |path: &PathBuf| match is_stdout(path) {
            true => "standard output".to_string(),
            false => path.display().to_string(),
        };
        pictures.chain(parts).map(name).collect()
    }
}

/// Format of an output: by the file extension, or by the prefix of standard output.
///
/// # Errors
/// As for [`Format::of`].
pub(super) fn format_of(path: &Path) -> Result<Format> {
    stdout_kind(path).map_or_else(|| Format::of(path), |kind| Format::of(format!("picture.{kind}")))
}

/// Whether the path means standard output: `-`, or with a format, `exr:-`.
pub(super) fn is_stdout(path: &Path) -> bool {
    stdout_kind(path).is_some()
}

/// Format extension for standard output; `None` for files.
fn stdout_kind(path: &Path) -> Option<&str> {
    match path.to_str()? {
        "-" => Some("png"),
        text => text.strip_suffix(":-").filter(|kind| kind.chars().all(char::is_alphanumeric)),
    }
}

/// Checks that a picture written to standard output is the only output there.
///
/// # Errors
/// A usage error that names the conflicting output.
pub(super) fn check_stdout(args: &RenderArgs) -> Result<()> {
    let count = args.output.iter().filter(|path| is_stdout(path)).count();
    if count == 0 {
        return Ok(());
    }
    let is_sequence = args.frames.is_some() || args.orbit.is_some();
    let progress = args.long.progress;
    let reason = if count > 1 || args.scenes.len() > 1 || is_sequence {
        "there is more than one picture"
    } else if args.long.save_every.is_some() {
        "--save-every writes it several times"
    } else if args.json || matches!(progress, Some(ProgressArg::Json | ProgressArg::Openjd)) {
        "--json or --progress json or openjd writes there, too"
    } else if args.show.is_some() {
        "--show draws there"
    } else if std::io::stdout().is_terminal() {
        "it is a terminal"
    } else {
        return Ok(());
    };
    let message = format!("-o - writes the picture to standard output, but {reason}");
    Err(Error::usage(message).with_help("give -o a file name"))
}

/// Encoding options shared by all pictures of a run.
pub(crate) struct EncodeOptions {
    /// Owner of the image, for metadata.
    pub owner: Option<String>,
    /// Omits dates and render times from metadata.
    pub reproducible: bool,
    /// 32-bit floats for colour.
    pub float: bool,
    pub exr: ExrOptions,
    /// Text chunk of PNGs with the default name, by which the next run knows that it may overwrite them ([`mark`]).
    pub mark: Option<String>,
}

impl EncodeOptions {
    /// From the arguments; `window` is the position of the pixels within the frame.
    pub fn of(args: &RenderArgs, window: Option<ExrWindow>) -> EncodeOptions {
        let exr = args.exr.format.options(window);
        let (owner, mark) = (args.owner.clone(), args.mark.clone());
        EncodeOptions { owner, reproducible: args.reproducible, float: args.float, exr, mark }
    }
}

/// A finished or unfinished picture before encoding.
pub(crate) struct UnencodedPicture<'a> {
    pub film: Cow<'a, Film>,
    pub warnings: Vec<Warning>,
    pub metadata: Metadata,
}

impl<'a> From<&'a Picture> for UnencodedPicture<'a> {
    fn from(picture: &'a Picture) -> UnencodedPicture<'a> {
        let mut metadata = picture.output_options().metadata.clone();
        if picture.statistics().interrupted {
            metadata.stopped_by = Some("signal".to_string());
        }
        UnencodedPicture {
            film: Cow::Borrowed(picture.film()),
            warnings: picture.warnings().to_vec(),
            metadata,
        }
    }
}

impl<'a> From<&'a Rendering> for UnencodedPicture<'a> {
    /// The current state of an unfinished rendering.
    fn from(rendering: &'a Rendering) -> UnencodedPicture<'a> {
        let metadata = rendering.output_options().metadata;
        let stopped_by = Some("not finished".to_string());
        UnencodedPicture {
            film: rendering.shown(),
            warnings: rendering.warnings(),
            metadata: Metadata { stopped_by, ..metadata },
        }
    }
}

/// Encoded pictures, not yet written.
pub(crate) struct Pictures<'a> {
    /// Encoded bytes of each file, or the encoder's error.
    files: Vec<(&'a Path, Result<Vec<u8>>)>,
    /// Warnings of rendering and encoding.
    pub warnings: Vec<Warning>,
}

impl<'a> Pictures<'a> {
    /// Encodes all pictures; an error in one does not affect the others. Metadata also list the earlier warnings.
    pub fn encode(
        encoding: &EncodeOptions,
        targets: &'a Targets,
        finished: UnencodedPicture,
        png: &PngOptions,
        earlier_warnings: &[Warning],
    ) -> Pictures<'a> {
        let UnencodedPicture { film, mut warnings, mut metadata } = finished;
        metadata.owner.clone_from(&encoding.owner);
        metadata.warnings = earlier_warnings.iter().chain(&warnings).map(Warning::to_string).collect();
        if let Some(window) = encoding.exr.window {
            let frame_from_ndc = window.frame_from_ndc(film.width(), film.height());
            metadata.world_to_ndc = metadata.world_to_ndc.map(|ndc| frame_from_ndc * ndc);
        }
        if encoding.reproducible {
            (metadata.render_s, metadata.captured) = (None, None);
        }
        let options =
            OutputOptions { float: encoding.float, exr: encoding.exr.clone(), png: png.clone(), metadata };
        let mut files = Vec::new();
        for (path, format) in &targets.pictures {
            let bytes = encode(&film, *format, &options, path).map(|encoded| {
                for warning in encoded.warnings {
                    warnings.push(Warning { file: Some(path.clone()), ..warning });
                }
                match &encoding.mark {
                    Some(mark) if *format == Format::Png => marked(encoded.bytes, mark),
                    _ => encoded.bytes,
                }
            });
            files.push((path.as_path(), bytes));
        }
        name_options_in_warnings(&mut warnings);
        Pictures { files, warnings }
    }

    /// Writes all encoded files.
    ///
    /// # Errors
    /// An output error that lists all files that could not be encoded or written.
    pub fn write(self) -> Result<()> {
        let results = self.files.into_iter().map(|(path, bytes)| match is_stdout(path) {
            true => print_bytes(&bytes?),
            false => write_atomically(path, &bytes?),
        });
        let mut errors = results.filter_map(Result::err);
        let Some(mut first) = errors.next() else { return Ok(()) };
        errors.for_each(|error| first.append(error));
        Err(first)
    }
}

/// Denoising of finished pictures.
pub(super) struct Denoising<'a> {
    args: &'a RenderArgs,
    /// AOVs to write.
    output_aovs: AovSet,
    /// False if all outputs are partial renders, which are not denoised.
    has_pictures: bool,
}

impl<'a> Denoising<'a> {
    /// From the arguments; `output_aovs` are written to files.
    pub fn of(args: &'a RenderArgs, targets: &Targets, output_aovs: AovSet) -> Denoising<'a> {
        Denoising { args, output_aovs, has_pictures: targets.has_pictures() || targets.parts().is_empty() }
    }

    /// AOVs to keep after denoising; `None` without denoising.
    pub fn output_aovs(&self) -> Option<AovSet> {
        self.args.picture.denoise.then_some(self.output_aovs)
    }

    /// Whether the picture is denoised together with neighbouring frames.
    pub fn is_temporal(&self) -> bool {
        self.output_aovs().is_some()
            && self.has_pictures
            && self.args.frame.as_ref().is_some_and(|frame| frame.is_averaged)
    }

    /// Denoises the picture by itself, if requested; returns the time, seconds.
    pub fn run(&self, rendering: &mut Rendering, printed: &mut PrintedMessages) -> Option<f64> {
        let output_aovs = self.output_aovs().filter(|_| self.has_pictures && !self.is_temporal())?;
        if !self.args.quiet {
            printed.notes(&self.args.picture.denoiser.notes());
        }
        let start = Instant::now();
        let target = ProgressTarget::of(self.args.quiet, self.args.long.progress);
        let progress = StageProgress::new(target, "denoise", &WorkCounter::default());
        rendering.denoise(output_aovs);
        drop(progress);
        Some(start.elapsed().as_secs_f64())
    }
}

/// True for file names of partial renders.
pub(super) fn is_part(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(PART))
}

/// True for file names of animations: GIF, APNG or video.
pub(crate) fn is_animation(path: &Path) -> bool {
    AnimationFormat::of(path).is_some() || VideoFormat::of(path).is_some()
}

/// The outputs that are not animations.
pub(crate) fn stills(paths: &[PathBuf]) -> Vec<PathBuf> {
    paths.iter().filter(|path| !is_animation(path)).cloned().collect()
}

/// Encoders of the animation files of turntables and frame ranges.
pub(super) struct AnimationFiles {
    /// Frames of GIFs and APNGs, encoded at the end.
    animation: Animation,
    animations: Vec<(PathBuf, AnimationFormat)>,
    videos: Vec<(PathBuf, Video)>,
    frames_per_second: f64,
}

impl AnimationFiles {
    /// Opens the animation files among the outputs.
    ///
    /// # Errors
    /// A file can't be written or there is no encoder for it; a usage error with `--resume`.
    pub fn of(args: &RenderArgs) -> Result<AnimationFiles> {
        if let Some(path) = args.output.iter().find(|path| is_animation(path) && args.long.resume) {
            let message = "--resume skips existing frames, but an animation file needs all frames";
            return Err(
                Error::usage(format!("{}: {message}", path.display())).with_help("omit one of the two")
            );
        }
        AnimationFiles::new(&args.output, args.fps)
    }

    /// Opens the animation files among the outputs.
    ///
    /// # Errors
    /// A file can't be written or there is no encoder for it.
    pub fn new(outputs: &[PathBuf], frames_per_second: f64) -> Result<AnimationFiles> {
        let (mut animations, mut videos) = (Vec::new(), Vec::new());
        for path in outputs.iter().filter(|path| is_animation(path)) {
            check_target(path)?;
            animations.extend(AnimationFormat::of(path).map(|format| (path.clone(), format)));
            videos.extend(Video::new(path, frames_per_second)?.map(|video| (path.clone(), video)));
        }
        Ok(AnimationFiles { animation: Animation::default(), animations, videos, frames_per_second })
    }

    /// Checks that the video formats support this size.
    ///
    /// # Errors
    /// A usage error for the first format that doesn't.
    pub fn check_size(&self, width: u32, height: u32) -> Result<()> {
        self.videos.iter().try_for_each(|(_, video)| video.check_size(width, height))
    }

    /// Reports that the files are not written because the run ended early.
    pub fn print_unfinished(&self, args: &RenderArgs) {
        if args.quiet {
            return;
        }
        let videos = self.videos.iter().map(|(path, _)| path);
        for path in self.animations.iter().map(|(path, _)| path).chain(videos) {
            say!("{} is not written: frames are missing", path.display());
        }
    }

    /// Adds a rendered frame to all files.
    ///
    /// # Errors
    /// As for [`AnimationFiles::add`].
    pub fn add_film(&mut self, film: &Film, png: &PngOptions) -> Result<()> {
        self.add(&Linear { width: film.width(), height: film.height(), rgba: &film.rgba() }, png)
    }

    /// Adds a frame to all files.
    ///
    /// # Errors
    /// An output error if an encoder fails.
    pub fn add(&mut self, picture: &Linear, png: &PngOptions) -> Result<()> {
        if !self.animations.is_empty() {
            self.animation.add_picture(picture, png);
        }
        self.videos.iter_mut().try_for_each(|(_, video)| video.add(picture, png))
    }

    /// Writes the files.
    ///
    /// # Errors
    /// An output error for the first file that can't be written.
    pub fn finish(self, quiet: bool) -> Result<()> {
        let say = |path: &Path| {
            if !quiet {
                say!("wrote    {}", path.display());
            }
        };
        for (path, format) in &self.animations {
            let bytes = self.animation.encode(*format, self.frames_per_second);
            write_atomically(path, &bytes.map_err(|message| Error::output(path, message))?)?;
            say(path);
        }
        for (path, video) in self.videos {
            video.finish()?;
            say(&path);
        }
        Ok(())
    }
}

// Overwrite protection of pictures with default names: `scan.png` for `oscura scan.ply`, `scan.thumb.png` for
// `oscura thumb scan.ply`. Each stores a mark with the command and the scene; only pictures with the same mark are overwritten.

/// Keyword of the PNG text chunk with the mark.
const KEYWORD: &str = "oscura";

/// Mark of a picture: the command, the scene's file name, and a hash of its full path, since folders may contain scenes
/// with equal names.
pub(super) fn mark(command: &str, scene: &Path) -> String {
    let path = scene.canonicalize().unwrap_or_else(|_| scene.to_path_buf());
    // PNG text chunks are Latin-1.
    let name = scene.file_name().unwrap_or_default().to_string_lossy().replace(|c: char| !c.is_ascii(), "?");
    format!("{command} {name} {:016x}", fnv1a(path.as_os_str().as_encoded_bytes()))
}

/// 64-bit FNV-1a hash (Fowler, Noll, Vo).
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
}

/// Adds a mark to a PNG.
pub(super) fn marked(png: Vec<u8>, mark: &str) -> Vec<u8> {
    with_png_text(png, KEYWORD, mark)
}

/// Refuses to overwrite a file without this mark; `help` is added to the error.
///
/// # Errors
/// A usage error.
pub(super) fn check(target: &Path, mark: &str, help: &str) -> Result<()> {
    if !target.exists() || png_text(target, KEYWORD).as_deref() == Some(mark) {
        return Ok(());
    }
    let message = format!("{} exists, and this command did not write it", target.display());
    Err(Error::usage(message).with_help(help))
}

/// Refuses a picture that would overwrite the scene or one of its files, such as a texture with the same name. Missing
/// textures count as well: the next run would load the picture as the texture.
///
/// # Errors
/// A usage error.
pub(super) fn refuse_scene_file(scene: &Path, target: &Path, files: &[PathBuf], help: &str) -> Result<()> {
    if !files.iter().any(|file| is_same_target(file, target)) {
        return Ok(());
    }
    let scene = scene.display();
    let message = format!("the picture would overwrite {}, a file of the scene {scene}", target.display());
    Err(Error::usage(message).with_help(help))
}

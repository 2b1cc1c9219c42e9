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

/// Output files, checked before rendering.
pub(crate) struct Targets {
    pictures: Vec<(PathBuf, Format)>,
    parts: Vec<PathBuf>,
}

impl Targets {
    /// # Errors
    /// A usage error for unknown formats and for one file given twice; an output error for one that can't be written.
    pub fn check(paths: &[PathBuf]) -> Result<Targets> {
        let mut targets = Targets { pictures: Vec::new(), parts: Vec::new() };
        for (at, path) in paths.iter().enumerate() {
            if let Some(earlier) = paths[..at].iter().find(|earlier| is_same_target(earlier, path)) {
                let message = format!("-o {} is given twice", path.display());
                let same = format!("it is the same file as -o {}", earlier.display());
                return Err(Error::usage(message).with_help(same));
            }
            if is_moving(path) {
                let message = format!("{}: an animation needs more than one frame", path.display());
                return Err(Error::usage(message).with_help("add --orbit N or --frames A-B"));
            }
            match path.extension().is_some_and(|e| e.eq_ignore_ascii_case(PART)) {
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
    /// A usage error for the first that can't.
    pub fn check_size(&self, width: u32, height: u32) -> Result<()> {
        self.pictures.iter().try_for_each(|(path, format)| match format.largest_edge() {
            Some(largest) if width.max(height) > largest => {
                let message = format!("{}: {width} x {height} is too large", path.display());
                let help =
                    format!("files of this kind have at most {largest} pixels a side; write .exr or .png");
                Err(Error::usage(message).with_help(help))
            }
            _ => Ok(()),
        })
    }

    /// True if any of them is an EXR, or a partial render that may become one.
    pub fn has_exr(&self) -> bool {
        !self.parts.is_empty() || self.pictures.iter().any(|(_, format)| *format == Format::Exr)
    }

    /// True if any of them is display-referred.
    pub fn has_shown(&self) -> bool {
        self.pictures.iter().any(|(_, format)| !matches!(format, Format::Exr | Format::Hdr))
    }

    /// True if there are other files than partial renders.
    pub fn has_pictures(&self) -> bool {
        !self.pictures.is_empty()
    }

    /// The partial renders.
    pub fn parts(&self) -> &[PathBuf] {
        &self.parts
    }

    /// Names of the files that are written; partial renders only `with_parts`.
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

/// The format of an output: by the extension, or by the option for standard output.
///
/// # Errors
/// As for [`Format::of`].
pub(super) fn format_of(path: &Path) -> Result<Format> {
    stdout_kind(path).map_or_else(|| Format::of(path), |kind| Format::of(format!("picture.{kind}")))
}

/// Is it standard output: `-`, or with a format, `exr:-`?
pub(super) fn is_stdout(path: &Path) -> bool {
    stdout_kind(path).is_some()
}

/// The extension of what goes to standard output; `None` for files.
fn stdout_kind(path: &Path) -> Option<&str> {
    match path.to_str()? {
        "-" => Some("png"),
        text => text.strip_suffix(":-").filter(|kind| kind.chars().all(char::is_alphanumeric)),
    }
}

/// Is standard output, if a picture goes there, free for it?
///
/// # Errors
/// A usage error that says what else would be written there.
pub(super) fn check_stdout(args: &RenderArgs) -> Result<()> {
    let pictures = args.output.iter().filter(|path| is_stdout(path)).count();
    if pictures == 0 {
        return Ok(());
    }
    let is_sequence = args.frames.is_some() || args.orbit.is_some();
    let progress = args.long.progress;
    let why = if pictures > 1 || args.scenes.len() > 1 || is_sequence {
        "there is more than one picture"
    } else if args.long.save_every.is_some() {
        "--save-every writes it several times"
    } else if args.json || matches!(progress, Some(ProgressArg::Json | ProgressArg::Openjd)) {
        "JSON or progress for programs is asked for, too"
    } else if args.show.is_some() {
        "--show draws there"
    } else if std::io::stdout().is_terminal() {
        "that is a terminal"
    } else {
        return Ok(());
    };
    let message = format!("-o - writes the picture to standard output, but {why}");
    Err(Error::usage(message).with_help("give -o the name of a file"))
}

/// Options of encoding that are the same for all pictures of a run.
pub(crate) struct EncodeOptions {
    /// Owner of the image.
    pub owner: Option<String>,
    /// Write no dates and render times.
    pub reproducible: bool,
    /// 32-bit floats for colour.
    pub float: bool,
    /// Format of EXRs.
    pub exr: ExrOptions,
    /// Mark of PNGs whose name is the default.
    pub mark: Option<String>,
}

impl EncodeOptions {
    /// As the arguments say, of pixels that stand so in the frame.
    pub fn of(args: &RenderArgs, window: Option<ExrWindow>) -> EncodeOptions {
        let exr = args.exr.format.options(window);
        let (owner, mark) = (args.owner.clone(), args.mark.clone());
        EncodeOptions { owner, reproducible: args.reproducible, float: args.float, exr, mark }
    }
}

/// A finished or unfinished picture before encoding.
pub(crate) struct FinishedPicture<'a> {
    pub film: Cow<'a, Film>,
    pub warnings: Vec<Warning>,
    pub metadata: Metadata,
}

impl<'a> From<&'a Picture> for FinishedPicture<'a> {
    fn from(picture: &'a Picture) -> FinishedPicture<'a> {
        let mut metadata = picture.output_options().metadata.clone();
        if picture.statistics().interrupted {
            metadata.stopped_by = Some("signal".to_string());
        }
        FinishedPicture {
            film: Cow::Borrowed(picture.film()),
            warnings: picture.warnings().to_vec(),
            metadata,
        }
    }
}

impl<'a> From<&'a Rendering> for FinishedPicture<'a> {
    /// The unfinished picture.
    fn from(rendering: &'a Rendering) -> FinishedPicture<'a> {
        let metadata = rendering.output_options().metadata;
        let stopped_by = Some("not finished".to_string());
        FinishedPicture {
            film: rendering.shown(),
            warnings: rendering.warnings(),
            metadata: Metadata { stopped_by, ..metadata },
        }
    }
}

/// Encoded pictures, not yet written.
pub(crate) struct Pictures<'a> {
    /// Bytes of each file, or the encoder's error.
    files: Vec<(&'a Path, Result<Vec<u8>>)>,
    /// Warnings of rendering and encoding.
    pub warnings: Vec<Warning>,
}

impl<'a> Pictures<'a> {
    /// Encodes all pictures. If one fails, the others are still written.
    pub fn encode(
        how: &EncodeOptions,
        targets: &'a Targets,
        shot: FinishedPicture,
        png: &PngOptions,
        earlier: &[Warning],
    ) -> Pictures<'a> {
        let FinishedPicture { film, mut warnings, mut metadata } = shot;
        metadata.owner.clone_from(&how.owner);
        metadata.warnings = earlier.iter().chain(&warnings).map(Warning::to_string).collect();
        if let Some(window) = how.exr.window {
            let frame_from_ndc = window.frame_from_ndc(film.width(), film.height());
            metadata.world_to_ndc = metadata.world_to_ndc.map(|ndc| frame_from_ndc * ndc);
        }
        if how.reproducible {
            (metadata.render_s, metadata.captured) = (None, None);
        }
        let options = OutputOptions { float: how.float, exr: how.exr.clone(), png: png.clone(), metadata };
        let mut files = Vec::new();
        for (path, format) in &targets.pictures {
            let bytes = encode(&film, *format, &options, path).map(|encoded| {
                for warning in encoded.warnings {
                    warnings.push(Warning { file: Some(path.clone()), ..warning });
                }
                match &how.mark {
                    Some(mark) if *format == Format::Png => marked(encoded.bytes, mark),
                    _ => encoded.bytes,
                }
            });
            files.push((path.as_path(), bytes));
        }
        name_options_in_warnings(&mut warnings);
        Pictures { files, warnings }
    }

    /// Writes all files that were encoded.
    ///
    /// # Errors
    /// An output error that says of all others why they were not.
    pub fn write(self) -> Result<()> {
        let written = self.files.into_iter().map(|(path, bytes)| match is_stdout(path) {
            true => print_bytes(&bytes?),
            false => write_atomically(path, &bytes?),
        });
        let mut failed = written.filter_map(Result::err);
        let Some(mut first) = failed.next() else { return Ok(()) };
        failed.for_each(|error| first.append(error));
        Err(first)
    }
}

// Denoising of finished pictures.

/// Whether and how the picture is denoised.
pub(super) struct Denoising<'a> {
    args: &'a RenderArgs,
    /// AOVs to write.
    kept: AovSet,
    /// Partial renders stay noisy.
    has_pictures: bool,
}

impl<'a> Denoising<'a> {
    /// As the arguments say, of files that are to have these AOVs.
    pub fn of(args: &'a RenderArgs, targets: &Targets, kept: AovSet) -> Denoising<'a> {
        Denoising { args, kept, has_pictures: targets.has_pictures() || targets.parts().is_empty() }
    }

    /// AOVs that are kept after denoising; `None` without denoising.
    pub fn kept(&self) -> Option<AovSet> {
        self.args.picture.denoise.then_some(self.kept)
    }

    /// Is the picture to be denoised with the frames around it?
    pub fn is_over_frames(&self) -> bool {
        self.kept().is_some()
            && self.has_pictures
            && self.args.frame.as_ref().is_some_and(|frame| frame.is_averaged)
    }

    /// Denoises the picture alone if that is asked for; returns the time, seconds.
    pub fn run(&self, rendering: &mut Rendering, printed: &mut PrintedMessages) -> Option<f64> {
        let kept = self.kept().filter(|_| self.has_pictures && !self.is_over_frames())?;
        if !self.args.quiet {
            printed.notes(&self.args.picture.denoiser.notes());
        }
        let start = Instant::now();
        let target = ProgressTarget::of(self.args.quiet, self.args.long.progress);
        let waiting = StageProgress::new(target, "denoise", &WorkCounter::default());
        rendering.denoise(kept);
        drop(waiting);
        Some(start.elapsed().as_secs_f64())
    }
}

/// True for file names of partial renders.
pub(super) fn is_part(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("part"))
}

// Animation files of turntables and frame ranges: GIF, APNG and video.

/// True for file names of GIF, APNG or video.
pub(crate) fn is_moving(path: &Path) -> bool {
    AnimationFormat::of(path).is_some() || VideoFormat::of(path).is_some()
}

/// The outputs that are stills.
pub(crate) fn still(paths: &[PathBuf]) -> Vec<PathBuf> {
    paths.iter().filter(|path| !is_moving(path)).cloned().collect()
}

/// Animation files that are being encoded.
pub(super) struct AnimationFiles {
    /// Frames of the GIFs and APNGs, which are encoded at the end.
    animation: Animation,
    animations: Vec<(PathBuf, AnimationFormat)>,
    videos: Vec<(PathBuf, Video)>,
    frames_a_second: f64,
}

impl AnimationFiles {
    /// The animation files among the outputs.
    ///
    /// # Errors
    /// If one of them can't be written, or there is no encoder for it.
    pub fn of(args: &RenderArgs) -> Result<AnimationFiles> {
        if let Some(path) = args.output.iter().find(|path| is_moving(path) && args.long.resume) {
            let message = "--resume leaves out frames that exist, and a moving picture takes them all";
            return Err(
                Error::usage(format!("{}: {message}", path.display())).with_help("leave one of both out")
            );
        }
        AnimationFiles::new(&args.output, args.fps)
    }

    /// The animations among the outputs, at a frame rate in frames per second.
    ///
    /// # Errors
    /// If one of them can't be written, or there is no encoder for it.
    pub fn new(outputs: &[PathBuf], frames_a_second: f64) -> Result<AnimationFiles> {
        let (mut animations, mut videos) = (Vec::new(), Vec::new());
        for path in outputs.iter().filter(|path| is_moving(path)) {
            check_target(path)?;
            animations.extend(AnimationFormat::of(path).map(|format| (path.clone(), format)));
            videos.extend(Video::new(path, frames_a_second)?.map(|video| (path.clone(), video)));
        }
        Ok(AnimationFiles { animation: Animation::default(), animations, videos, frames_a_second })
    }

    /// Checks that the video formats support this size.
    ///
    /// # Errors
    /// A usage error for the first that can't.
    pub fn check_size(&self, width: u32, height: u32) -> Result<()> {
        self.videos.iter().try_for_each(|(_, video)| video.check_size(width, height))
    }

    /// Reports that none of them is written because the run ended early.
    pub fn print_unfinished(&self, args: &RenderArgs) {
        if args.quiet {
            return;
        }
        let videos = self.videos.iter().map(|(path, _)| path);
        for path in self.animations.iter().map(|(path, _)| path).chain(videos) {
            say!("{} is not written, as not all frames are there", path.display());
        }
    }

    /// Adds a rendered frame to all of them.
    ///
    /// # Errors
    /// As for [`AnimationFiles::add`].
    pub fn add_film(&mut self, film: &Film, png: &PngOptions) -> Result<()> {
        self.add(&Linear { width: film.width(), height: film.height(), rgba: &film.rgba() }, png)
    }

    /// Adds a frame to all of them.
    ///
    /// # Errors
    /// An output error if an encoder fails.
    pub fn add(&mut self, picture: &Linear, png: &PngOptions) -> Result<()> {
        if !self.animations.is_empty() {
            self.animation.add_picture(picture, png);
        }
        self.videos.iter_mut().try_for_each(|(_, video)| video.add(picture, png))
    }

    /// Writes them.
    ///
    /// # Errors
    /// An output error for the first that can't be written.
    pub fn finish(self, quiet: bool) -> Result<()> {
        let say = |path: &Path| {
            if !quiet {
                say!("wrote    {}", path.display());
            }
        };
        for (path, format) in &self.animations {
            let bytes = self.animation.encode(*format, self.frames_a_second);
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

// Pictures whose names nobody gave: `scan.png` of `oscura scan.ply`, `scan.thumb.png` of `oscura thumb scan.ply`. Each holds a
// mark of the command and the scene that it was made of, and only a picture with the same mark is replaced.

/// Keyword of the mark among a PNG's texts.
const KEYWORD: &str = "oscura";

/// The mark of a command's picture of a scene: the command, the scene's name, and a hash of where it lies, as scenes of one name
/// may lie in several folders.
pub(super) fn mark(command: &str, scene: &Path) -> String {
    let whole = scene.canonicalize().unwrap_or_else(|_| scene.to_path_buf());
    // PNG's texts are Latin-1.
    let name = scene.file_name().unwrap_or_default().to_string_lossy().replace(|c: char| !c.is_ascii(), "?");
    format!("{command} {name} {:016x}", fnv1a(whole.as_os_str().as_encoded_bytes()))
}

/// FNV-1a of 64 bits (Fowler, Noll, Vo).
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
}

/// A PNG with a mark.
pub(super) fn marked(png: Vec<u8>, mark: &str) -> Vec<u8> {
    with_png_text(png, KEYWORD, mark)
}

/// Refuses to replace a file without this mark; `remedy` says what else to do.
///
/// # Errors
/// A usage error.
pub(super) fn check(target: &Path, mark: &str, remedy: &str) -> Result<()> {
    if !target.exists() || png_text(target, KEYWORD).as_deref() == Some(mark) {
        return Ok(());
    }
    let message = format!("{} exists, and this command did not write it", target.display());
    Err(Error::usage(message).with_help(remedy))
}

/// Refuses a picture that would replace its scene or a file that the scene is made of, such as a texture of its name. A texture that is
/// missing counts as well: the picture would become it.
///
/// # Errors
/// A usage error.
pub(super) fn refuse_part(scene: &Path, target: &Path, parts: &[PathBuf], remedy: &str) -> Result<()> {
    if !parts.iter().any(|part| is_same_target(part, target)) {
        return Ok(());
    }
    let scene = scene.display();
    let message = format!("the picture would be {}, which {scene} is made of", target.display());
    Err(Error::usage(message).with_help(remedy))
}

//! `oscura thumb` and `oscura install-thumbnailer`: thumbnails of models.

use super::args::bytes;
use super::parsers::integer;
use super::pictures::{check, mark, marked, refuse_scene_file};
use super::process::{Limits, Outcome, Watchdog, cancel_by_signals, exit_code};
use super::report;
use super::report::{name_options_in_error, print_text};
use super::scene_args::{StageArgs, check_scene_path};
use clap::Args;
use oscura::error::{Error, Result};
use oscura::film::AovSet;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::output::{
    Format, PngOptions, ViewTransform, check_target, encode, make_folder, remove_file, write_atomically,
};
use oscura::render::{
    CancelHandle, Caustics, Guiding, LightSelection, PathReuse, Renderer, Splitting, denoising_guides,
    in_pool,
};
use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Maximum path depth; deeper paths are hardly visible at thumbnail size.
const DEPTH: u32 = 6;

/// Help if a thumbnail would overwrite another file.
const OUTPUT_HELP: &str = "choose another file with -o FOLDER or --file FILE, or overwrite it with --force";

/// Renders all thumbnails. Failures are listed at the end; the highest exit code is returned.
pub(super) fn run(args: &ThumbArgs) -> Result<Outcome> {
    let cancel = cancel_by_signals()?;
    let targets = targets(args)?;
    let threads = args.threads.map(usize::from);
    in_pool(threads, || render_all(args, &targets, &cancel))?
}

/// The output file given by `--file` or `-o NAME.png`, if any.
fn named_file(args: &ThumbArgs) -> Option<&PathBuf> {
    let is_picture =
        |path: &&PathBuf| Format::of(path).is_ok_and(|format| format == Format::Png) && !path.is_dir();
    args.file.as_ref().or_else(|| args.output.as_ref().filter(is_picture))
}

/// Output file of each model.
fn targets(args: &ThumbArgs) -> Result<Vec<PathBuf>> {
    if let Some(file) = named_file(args) {
        return match args.models.len() {
            1 => Ok(vec![file.clone()]),
            many => Err(Error::usage(format!("{} is one file for {many} models", file.display()))
                .with_help("choose a folder with -o")),
        };
    }
    if let Some(folder) = &args.output {
        make_folder(folder)?;
    }
    let mut targets: Vec<PathBuf> = Vec::new();
    for model in &args.models {
        // Next to the model, `scan.png` may be its rendering or a texture.
        let target = match &args.output {
            Some(folder) => folder.join(model.with_extension("png").file_name().unwrap_or_default()),
            None => model.with_extension("thumb.png"),
        };
        if targets.contains(&target) {
            let message = format!("two models have the thumbnail {}", target.display());
            return Err(Error::usage(message).with_help("omit -o, or run the command for each folder"));
        }
        targets.push(target);
    }
    Ok(targets)
}

fn render_all(args: &ThumbArgs, targets: &[PathBuf], cancel: &CancelHandle) -> Result<Outcome> {
    let mut failures: Vec<(&Path, Error)> = Vec::new();
    for (model, target) in args.models.iter().zip(targets) {
        let start = Instant::now();
        match render_one(args, model, target, cancel) {
            Ok(true) if !args.quiet => {
                say!("wrote    {} in {:.1} s", target.display(), start.elapsed().as_secs_f64());
            }
            Ok(_) => {}
            Err(error) => {
                let error = name_options_in_error(error);
                report::error(&error);
                failures.push((model, error));
            }
        }
        if cancel.is_cancelled() {
            return Ok(Outcome::Interrupted);
        }
    }
    let worst = failures.iter().map(|(_, error)| exit_code(error)).max();
    let Some(worst) = worst else { return Ok(Outcome::Done) };
    if args.models.len() > 1 {
        say!("{} of {} models failed:", failures.len(), args.models.len());
        failures.iter().for_each(|(model, _)| say!("  {}", model.display()));
    }
    Ok(Outcome::Failed(worst))
}

/// Limits for file managers, which request thumbnails of all visible models.
const LIMITS: &str = "--time-limit 60 --memory-limit 4G";

/// Renders one thumbnail; returns false if cancelled.
fn render_one(args: &ThumbArgs, model: &Path, target: &Path, cancel: &CancelHandle) -> Result<bool> {
    let time = args.time_limit.map(|seconds| Duration::from_secs(seconds.into()));
    let file = model.to_path_buf();
    let exceeded = move |message: String| {
        Error::input(&file, message).with_help("the remaining thumbnails are not made")
    };
    let _watchdog = Watchdog::begin(Limits { time, memory: args.memory_limit }, exceeded);
    check_scene_path(model)?;
    check_target(target)?;
    refuse_scene_file(model, target, &[model.to_path_buf()], OUTPUT_HELP)?;
    let mark = mark("thumb", model);
    if named_file(args).is_none() && !args.force {
        check(target, &mark, OUTPUT_HELP)?;
    }
    let stage = args.stage.options(Some(1.0), args.memory_limit, &mut Vec::new())?;
    let options = LoadOptions {
        allow_external: args.allow_external,
        up: args.stage.up,
        smooth_rad: args.stage.smooth.map(f64::to_radians),
        subdivision: args.stage.subdivision(),
        stage,
        memory_limit: args.memory_limit,
        ..LoadOptions::default()
    };
    let loaded = load(model, &options)?;
    refuse_scene_file(model, target, &options.files.paths(), OUTPUT_HELP)?;
    let is_stage_lit = loaded.is_stage_lit;
    let (width, height) = size(args.size, &loaded);
    // With few samples, denoising is worth more than techniques that cost time per sample.
    let mut rendering = Renderer::new(loaded)
        .size(width, height)
        .samples(args.spp)
        .max_depth(DEPTH)
        .caustics(Caustics::Off)
        .guiding(Guiding::Off)
        .light_selection(LightSelection::Estimated)
        .path_reuse(PathReuse::Off)
        .splitting(Splitting::OFF)
        .aovs(denoising_guides())
        .halves(true)
        .cancel_by(cancel)
        .start()?;
    rendering.run();
    if cancel.is_cancelled() {
        return Ok(false);
    }
    rendering.denoise(AovSet::NONE);
    let picture = rendering.into_picture();
    let view = match is_stage_lit && args.stage.allows_filmic_view() {
        true => ViewTransform::Filmic,
        false => ViewTransform::Srgb,
    };
    let mut output = picture.output_options().clone();
    output.png = PngOptions { view, ..output.png };
    // Always PNG: temporary files of file managers may have any extension.
    let encoded = encode(picture.film(), Format::Png, &output, target)?;
    write_atomically(target, &marked(encoded.bytes, &mark))?;
    Ok(true)
}

/// Size with this longer side: square for automatically framed models, else with the scene's aspect ratio.
fn size(longer: u32, loaded: &Loaded) -> (u32, u32) {
    let settings = &loaded.scene.settings;
    let scene_aspect = match (settings.width, settings.height) {
        (Some(w), Some(h)) if h > 0 => Some(f64::from(w) / f64::from(h)),
        _ => loaded.scene.cameras.first().and_then(|c| c.aspect_ratio),
    };
    let aspect =
        scene_aspect.filter(|a| *a > 0.0 && a.is_finite() && loaded.turntable.is_none()).unwrap_or(1.0);
    let scaled = |factor: f64| ((f64::from(longer) * factor).round() as u32).max(1);
    (scaled(aspect.min(1.0)), scaled(1.0 / aspect.max(1.0)))
}

#[derive(Args, Debug)]
pub(crate) struct ThumbArgs {
    /// Models or scenes: .gltf, .glb, .vrm, .obj, .ply, .spz, .stl, .3mf, .zip, .toml or .blend.
    #[arg(required = true, value_name = "MODEL")]
    pub models: Vec<PathBuf>,
    /// Output folder for the thumbnails, MODEL.png each, or NAME.png for a single one [default: MODEL.thumb.png next to each model].
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// Output file for a single model; always a PNG, whatever its extension.
    #[arg(long, value_name = "FILE", conflicts_with = "output")]
    pub file: Option<PathBuf>,
    /// Replace files that 'oscura thumb' did not write.
    #[arg(id = "force_overwrite", long = "force")]
    pub force: bool,
    /// Longer side of the thumbnail, pixels.
    #[arg(long, value_name = "N", default_value = "512", value_parser = integer::<u32>(1, 8192), allow_negative_numbers = true)]
    pub size: u32,
    /// Samples per pixel; the thumbnail is denoised.
    #[arg(long, value_name = "N", default_value = "4", value_parser = integer::<u32>(1, u32::MAX), allow_negative_numbers = true)]
    pub spp: u32,
    /// Number of threads [default: one per core].
    #[arg(long, value_name = "N", value_parser = integer::<u16>(1, 1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Time limit per model, seconds; the program ends if a model takes longer.
    #[arg(long, value_name = "SECONDS", value_parser = integer::<u32>(1, u32::MAX), allow_negative_numbers = true)]
    pub time_limit: Option<u32>,
    /// Memory limit, such as 2G or 500M; the program ends if a model takes more.
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub memory_limit: Option<u64>,
    /// Let glTF and OBJ files and sidecars refer to files outside their folder.
    #[arg(long)]
    pub allow_external: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
    #[command(flatten)]
    pub stage: StageArgs,
}

#[derive(Args, Debug)]
pub(crate) struct ThumbnailerArgs {
    /// Dry run: print the files and their contents without writing them.
    #[arg(long, conflicts_with = "remove")]
    pub print: bool,
    /// Uninstall: remove the files.
    #[arg(long)]
    pub remove: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

// `oscura install-thumbnailer`: registers `oscura thumb` with file managers (thumbnailer entries of GNOME and Xfce, and the shared
// MIME database of freedesktop.org).

/// File types: MIME type, description, extension, and magic bytes, if any.
const TYPES: [(&str, &str, &str, Option<&str>); 7] = [
    ("model/gltf-binary", "glTF model (binary)", "glb", Some("glTF")),
    ("model/gltf+json", "glTF model", "gltf", None),
    ("model/obj", "Wavefront OBJ model", "obj", None),
    ("model/x-ply", "PLY model or point cloud", "ply", Some("ply")),
    ("model/stl", "STL model", "stl", None),
    ("model/3mf", "3MF model", "3mf", None),
    ("model/vrm", "VRM avatar", "vrm", None),
];

/// Program that updates the MIME database.
const UPDATE_COMMAND: &str = "update-mime-database";

/// Files to install, with their contents.
struct Installed {
    thumbnailer: (PathBuf, String),
    types: (PathBuf, String),
    /// Folder of the MIME database.
    mime: PathBuf,
}

impl Installed {
    /// In the user's data folder.
    fn in_folder(data: &Path) -> Installed {
        let mime = data.join("mime");
        Installed {
            thumbnailer: (data.join("thumbnailers/oscura.thumbnailer"), thumbnailer(&program())),
            types: (mime.join("packages/oscura.xml"), types()),
            mime,
        }
    }

    fn files(&self) -> [&(PathBuf, String); 2] {
        [&self.thumbnailer, &self.types]
    }
}

/// Writes, prints or removes the files.
pub(crate) fn install(args: &ThumbnailerArgs) -> Result<Outcome> {
    if args.print {
        // Package builds may have no home folder.
        let installed = Installed::in_folder(&data_folder().unwrap_or_else(|_| "~/.local/share".into()));
        for (path, text) in installed.files() {
            print_text(&format!("# {}\n{text}\n", path.display()));
        }
        return Ok(Outcome::Done);
    }
    let installed = Installed::in_folder(&data_folder()?);
    let say = |action: &str, path: &Path| {
        if !args.quiet {
            say!("{action:<8} {}", path.display());
        }
    };
    for (path, text) in installed.files() {
        match args.remove {
            true if remove_file(path)? => say("removed", path),
            true => {}
            false => {
                make_folder(path.parent().unwrap_or(Path::new(".")))?;
                write_atomically(path, text.as_bytes())?;
                say("wrote", path);
            }
        }
    }
    if !args.quiet {
        print_hints(args.remove, update_mime_database(&installed.mime), &installed.mime);
    }
    Ok(Outcome::Done)
}

/// Prints hints after installing or removing.
fn print_hints(is_removal: bool, is_updated: bool, mime: &Path) {
    if !is_updated {
        say!("next     {UPDATE_COMMAND} {} (was not found or failed; needed for thumbnails)", mime.display());
    }
    if is_removal {
        return;
    }
    say!("note     restart file managers to see thumbnails; delete failed ones in ~/.cache/thumbnails/fail");
    if !program().starts_with("/usr") {
        let path = program();
        say!(
            "note     GNOME's file manager only runs thumbnailers in /usr, so oscura must be there instead of at {}",
            path.display()
        );
    }
    say!("undo     oscura install-thumbnailer --remove");
}

/// Updates the MIME database; returns false if that fails.
fn update_mime_database(mime: &Path) -> bool {
    let mut command = Command::new(UPDATE_COMMAND);
    command.arg(mime).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    mime.is_dir() && command.status().is_ok_and(|status| status.success())
}

/// The user's data folder: `$XDG_DATA_HOME`, else `~/.local/share` (XDG Base Directory Specification).
fn data_folder() -> Result<PathBuf> {
    let variable = |name: &str| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let default = || variable("HOME").map(|home| home.join(".local/share"));
    variable("XDG_DATA_HOME").or_else(default).ok_or_else(|| {
        Error::usage("can't find the user's data folder").with_help("set XDG_DATA_HOME to a folder")
    })
}

/// Path of this program; if it runs within another program (Python), `oscura` in PATH.
fn program() -> PathBuf {
    let own = env::current_exe().ok().filter(|path| path.file_stem().is_some_and(|stem| stem == "oscura"));
    let on_path = || {
        let folders: OsString = env::var_os("PATH")?;
        env::split_paths(&folders).map(|folder| folder.join("oscura")).find(|path| path.is_file())
    };
    own.or_else(on_path).unwrap_or_else(|| PathBuf::from("oscura"))
}

/// Thumbnailer entry. `%s` is the size in pixels, `%o` the output and `%i` the input.
fn thumbnailer(program: &Path) -> String {
    let names: Vec<&str> = TYPES.iter().map(|(name, ..)| *name).collect();
    let program = program.display().to_string();
    // TryExec is not quoted, by the specification.
    let (try_exec, exec) = (escaped(&program), escaped(&quoted(&program)));
    format!(
        "[Thumbnailer Entry]\nTryExec={try_exec}\nExec={exec} thumb --quiet {LIMITS} --size %s --file %o %i\nMimeType={};\n",
        names.join(";")
    )
}

/// Quotes an argument (Desktop Entry Specification, "The Exec key").
fn quoted(word: &str) -> String {
    let mut out = String::from("\"");
    for c in word.chars() {
        match c {
            '%' => out.push('%'),
            '"' | '`' | '$' | '\\' => out.push('\\'),
            _ => {}
        }
        out.push(c);
    }
    out + "\""
}

/// Escapes a string value; applied after quoting (Desktop Entry Specification, "Possible value types").
fn escaped(text: &str) -> String {
    text.replace('\\', r"\\").replace('\n', r"\n").replace('\t', r"\t").replace('\r', r"\r")
}

/// XML file for the MIME database.
fn types() -> String {
    let element = |(name, about, extension, magic): &(&str, &str, &str, Option<&str>)| {
        let magic = magic.map_or_else(String::new, |start| {
            format!(
                "    <magic priority=\"60\"><match type=\"string\" value=\"{start}\" offset=\"0\"/></magic>\n"
            )
        });
        format!(
            "  <mime-type type=\"{name}\">\n    <comment>{about}</comment>\n{magic}    <glob pattern=\"*.{extension}\"/>\n  \
             </mime-type>\n"
        )
    };
    let elements: String = TYPES.iter().map(element).collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <mime-info xmlns=\"http://www.freedesktop.org/standards/shared-mime-info\">\n{elements}</mime-info>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn special_characters_of_paths_are_escaped() {
        let line = |path: &str, key: &str| {
            let entry = thumbnailer(Path::new(path));
            let found = entry.lines().find_map(|line| line.strip_prefix(key)).map(str::to_string);
            found.expect("the key")
        };
        let path = r#"/opt/50% $off `a` "b" c\d/oscura"#;
        let program = r#""/opt/50%% \\$off \\`a\\` \\"b\\" c\\\\d/oscura""#;
        assert_eq!(line(path, "Exec="), format!("{program} thumb --quiet {LIMITS} --size %s --file %o %i"));
        assert_eq!(line(path, "TryExec="), r#"/opt/50% $off `a` "b" c\\d/oscura"#);
        assert!(line("/usr/bin/oscura", "Exec=").starts_with("\"/usr/bin/oscura\" thumb"));
    }
}

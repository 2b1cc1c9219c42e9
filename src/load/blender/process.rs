//! Runs the exporter in a Blender or Python process.

use crate::error::{Choice, Error, Result};
use crate::load::{LoadOptions, formats};
use serde::Deserialize;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::path::{Path, PathBuf, absolute};
use std::process::{Command, ExitStatus, Stdio};
use std::{env, fs};

/// File name of the exported scene file, without extension.
pub(super) const NAME: &str = "scene";

macro_rules! package {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../../tools/blender/oscura_blender/", $name)))),*]
    };
}

/// The exporter's Python package: file names and contents.
const PACKAGE: &[(&str, &str)] = package![
    "__init__.py" "bakes.py" "cache.py" "camera.py" "closures.py" "cycles.py" "displacement.py"
    "export.py" "final_render.py" "fingerprint.py" "generated_coordinates.py" "geometry_attributes.py" "grids.py" "hair.py"
    "hair_colors.py" "ies_profiles.py" "image_files.py" "importers.py" "light_linking.py"
    "light_nodes.py" "lights.py" "materials.py" "media.py" "mesh_files.py" "mesh_normals.py"
    "mesh_objects.py" "mesh_topology.py" "meshes.py" "motion.py" "multiscatter.py" "node_links.py"
    "node_trees.py" "node_types.py" "nodes.py" "object_info.py" "objects.py" "point_clouds.py"
    "report.py" "scene_file.py" "settings.py" "sky.py" "state.py" "subdivision.py" "tangents.py"
    "view_table.py" "volumes.py" "world.py" "world_nodes.py"
];

/// The script that runs the exporter.
const SCRIPT: &str = include_str!("../../../tools/blender/export.py");

/// The script that imports files of other programs and runs the exporter.
const IMPORT: &str = include_str!("../../../tools/blender/import.py");
/// File name of the import's messages.
const IMPORTED: &str = "imported.json";

/// Maximum number of lines of the output of a failed process in an error.
const MAX_LOG_LINES: usize = 12;

/// Exports a file into `folder`; if `links` is set, images may be symbolic links. Temporary files go to `work`.
pub(super) fn run(
    host: &Host,
    file: &Path,
    options: &LoadOptions,
    work: &Path,
    folder: &Path,
    links: bool,
) -> Result<Report> {
    let unwritable = |e: std::io::Error| Error::output(work, format!("can't be written: {e}"));
    let script = unpack(work, formats::is_imported_by_blender(file)).map_err(unwritable)?;
    let (log, report_path) = (work.join("log.txt"), work.join("report.json"));
    let output = File::create(&log).and_then(|f| Ok((f.try_clone()?, f))).map_err(unwritable)?;
    let mut command = command(host, &script);
    command.arg("--").arg(file).arg(folder).arg(NAME).arg(&report_path);
    for (option, value) in arguments(options) {
        command.arg(option).arg(value);
    }
    if links {
        command.arg("--links");
    }
    command.stdin(Stdio::null()).stdout(output.0).stderr(output.1).current_dir(work);
    let program = host.program().display();
    let status = command.status().map_err(|e| Error::input(file, format!("{program} can't be run: {e}")))?;
    let report = fs::read(&report_path).ok().and_then(|bytes| Report::parse(&bytes));
    match report {
        Some(mut report) if status.success() && report.error.is_none() => {
            let imported = fs::read(work.join(IMPORTED)).ok().and_then(|bytes| Report::parse(&bytes));
            if let Some(imported) = imported {
                // The empty scene that holds imported models has no camera and only default settings.
                report.warnings.retain(|(_, message)| message != "has no active camera");
                report.notes.retain(|(_, message)| !message.starts_with("Cycles"));
                report.warnings.splice(0..0, imported.warnings);
                report.notes.splice(0..0, imported.notes);
            }
            Ok(report)
        }
        Some(Report { error: Some(error), .. }) => {
            Err(Error::input(file, format!("can't be exported from Blender: {error}")))
        }
        _ => Err(failure(host, file, status, &log)),
    }
}

/// Writes the exporter's files to `work`; returns the path of the script to run.
fn unpack(work: &Path, is_imported_by_blender: bool) -> std::io::Result<PathBuf> {
    let package = work.join("oscura_blender");
    fs::create_dir(&package)?;
    PACKAGE.iter().try_for_each(|(name, text)| fs::write(package.join(name), text))?;
    let (name, text) = if is_imported_by_blender { ("import.py", IMPORT) } else { ("export.py", SCRIPT) };
    let script = work.join(name);
    fs::write(&script, text)?;
    Ok(script)
}

fn command(host: &Host, script: &Path) -> Command {
    let mut command = Command::new(host.program());
    if let Host::Blender(_) = host {
        command.args(["--background", "--factory-startup", "--disable-autoexec", "--offline-mode"]);
        command.args(["--python-exit-code", "3", "--python"]);
    }
    command.arg(script).env("PYTHONDONTWRITEBYTECODE", "1");
    command
}

/// Command line arguments of the script.
fn arguments(options: &LoadOptions) -> Vec<(&'static str, OsString)> {
    let frame = options.blender.frame.map(|frame| ("--frame", frame.to_string().into()));
    let time =
        options.gltf.time_s.filter(|_| frame.is_none()).map(|time| ("--time", format!("{time:?}").into()));
    let scene = options.gltf.scene.clone().map(|scene| ("--scene", scene.into()));
    let layer = options.blender.view_layer.clone().map(|layer| ("--view-layer", layer.into()));
    // The process has another working directory. Paths stay relative if the current directory is unknown.
    let absolute = |folder: &PathBuf| absolute(folder).unwrap_or_else(|_| folder.clone());
    let cache = options.blender.cache.as_ref().map(|f| ("--cache", absolute(f).into_os_string()));
    let bake = options.blender.bake.map(|edge| ("--bake", edge.to_string().into()));
    let shutter = options.shutter.frames.map(|frames| ("--shutter", format!("{frames:?}").into()));
    let position = options.shutter.position.map(|p| ("--shutter-position", p.name().into()));
    let vectors = options.shutter.vectors.then(|| ("--vectors", "on".into()));
    let all = [frame, time, scene, layer, cache, bake, shutter, position, vectors];
    all.into_iter().flatten().collect()
}

/// The error for a process that wrote no report.
fn failure(host: &Host, file: &Path, status: ExitStatus, log: &Path) -> Error {
    let text = fs::read(log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let last = lines[lines.len().saturating_sub(MAX_LOG_LINES)..].join("\n    ");
    let message = match last.is_empty() {
        true => "and printed nothing".to_string(),
        false => format!("and printed:\n    {last}"),
    };
    let error = Error::input(
        file,
        format!("can't be exported: {} ended with {status}, {message}", host.program().display()),
    );
    match host {
        Host::Python(_) if text.contains("No module named 'bpy'") => error.with_help(
            "this Python lacks the module 'bpy': run 'pip install bpy', or specify Blender's program",
        ),
        _ => error.with_help("does Blender itself open the file?"),
    }
}

// Search for Blender: the user's path, else `PATH`, else the usual installation folders, else a Python with `bpy`.

/// The environment variable with the path of Blender or Python.
const VARIABLE: &str = "OSCURA_BLENDER";

/// The oldest supported version of Blender.
const OLDEST: [u32; 2] = [4, 2];

/// The help text of errors about a missing Blender.
fn remedy() -> String {
    format!(
        "install Blender 4.2 or newer (blender.org), or its Python module by 'pip install bpy'; if it is installed, specify \
         its path by {} or the environment variable OSCURA_BLENDER",
        Choice::Blender
    )
}

/// The program that runs the exporter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Host {
    /// Blender's program.
    Blender(PathBuf),
    /// A Python interpreter.
    Python(PathBuf),
}

impl Host {
    pub fn program(&self) -> &Path {
        match self {
            Host::Blender(program) | Host::Python(program) => program,
        }
    }
}

/// Finds the program that runs the exporter; `user_path` takes precedence.
pub(super) fn find(file: &Path, user_path: Option<&Path>) -> Result<Host> {
    let variable = || env::var_os(VARIABLE).filter(|v| !v.is_empty()).map(PathBuf::from);
    let named = user_path
        .map(|p| (p.to_path_buf(), Choice::Blender.to_string()))
        .or_else(|| variable().map(|p| (p, VARIABLE.to_string())));
    if let Some((path, by)) = named {
        return identify(&executable_at(&path)).map_err(|what| {
            Error::input(file, format!("needs Blender, but {} ({by}) {what}", path.display()))
                .with_help(remedy())
        });
    }
    let mut outdated = None;
    for program in programs() {
        match identify(&program) {
            Ok(host @ Host::Blender(_)) => return Ok(host),
            Ok(Host::Python(_)) => {}
            Err(what) => outdated = outdated.or(Some(format!("{} {what}", program.display()))),
        }
    }
    let has_module = |python: &PathBuf| output(python, &["-c", "import bpy"]).is_ok();
    if let Some(python) = ["python3", "python"].iter().filter_map(on_path).find(has_module) {
        return Ok(Host::Python(python));
    }
    let message = match outdated {
        None => "needs Blender, which was not found".to_string(),
        Some(outdated) => format!("needs Blender, but {outdated}"),
    };
    Err(Error::input(file, message).with_help(remedy()))
}

/// Classifies a program by its `--version` output; else an error message.
fn identify(program: &Path) -> std::result::Result<Host, String> {
    let message = output(program, &["--version"])?;
    if message.lines().any(|line| line.starts_with("Python 3")) {
        return Ok(Host::Python(program.to_path_buf()));
    }
    let version = message.lines().find_map(|line| line.trim().strip_prefix("Blender "));
    let Some(version) = version else { return Err("is neither Blender nor Python".to_string()) };
    match numbers(version) {
        Some(found) if found >= OLDEST => Ok(Host::Blender(program.to_path_buf())),
        _ => Err(format!("is Blender {version}, which is too old")),
    }
}

/// The first two numbers of a version.
fn numbers(version: &str) -> Option<[u32; 2]> {
    let mut parts = version.split(|c: char| !c.is_ascii_digit()).map(str::parse);
    Some([parts.next()?.ok()?, parts.next()?.ok()?])
}

/// A program's standard output, if it succeeds.
fn output(program: &Path, arguments: &[&str]) -> std::result::Result<String, String> {
    let run = Command::new(program).args(arguments).stdin(Stdio::null()).stderr(Stdio::null()).output();
    let run = run.map_err(|e| format!("can't be run: {e}"))?;
    match run.status.success() {
        true => Ok(String::from_utf8_lossy(&run.stdout).into_owned()),
        false => Err(format!("ended with {} when asked for its version", run.status)),
    }
}

/// The executable at a path: the file itself, or the one within a folder or macOS application.
fn executable_at(path: &Path) -> PathBuf {
    let names = ["blender", "blender.exe", "Contents/MacOS/Blender", "bin/python3", "Scripts/python.exe"];
    let found = || names.iter().map(|name| path.join(name)).find(|p| p.is_file());
    if path.is_dir() { found().unwrap_or_else(|| path.to_path_buf()) } else { path.to_path_buf() }
}

/// Candidates for Blender: the one on `PATH`, then installed ones, newest version first.
fn programs() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = Vec::new();
    let mut add_from = |parent: PathBuf| {
        let entries = fs::read_dir(parent).into_iter().flatten().flatten().map(|entry| entry.path());
        let is_named = |p: &PathBuf| {
            p.file_name().is_some_and(|n| n.to_string_lossy().to_ascii_lowercase().starts_with("blender"))
        };
        folders.extend(entries.filter(is_named));
    };
    ["/opt", "/usr/local", "/usr/local/share", "/snap/bin", "/Applications"]
        .into_iter()
        .map(PathBuf::from)
        .chain(env::var_os("ProgramFiles").map(|p| PathBuf::from(p).join("Blender Foundation")))
        .chain(home().into_iter().flat_map(|h| ["", "Applications", "Downloads"].map(|f| h.join(f))))
        .for_each(&mut add_from);
    folders.sort_by_key(|folder| folder.file_name().map(version_in));
    folders.reverse();
    let installed = folders.iter().map(|folder| executable_at(folder)).filter(|p| p.is_file());
    on_path(&"blender").into_iter().chain(installed).collect()
}

fn home() -> Option<PathBuf> {
    env::var_os("HOME").or_else(|| env::var_os("USERPROFILE")).map(PathBuf::from)
}

/// The numbers in a file name, to sort by version.
fn version_in(name: &OsStr) -> Vec<u32> {
    let name = name.to_string_lossy();
    name.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect()
}

/// A program on `PATH`.
fn on_path(name: &&str) -> Option<PathBuf> {
    let folders = env::var_os("PATH")?;
    let file = format!("{name}{}", env::consts::EXE_SUFFIX);
    env::split_paths(&folders).map(|folder| folder.join(&file)).find(|p| p.is_file())
}

// The exporter's report.

/// Pairs of a location (material or object name; empty for the whole file) and a message.
type Messages = Vec<(String, String)>;

/// The exporter's report.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Report {
    /// Error message of a failed export.
    pub error: Option<String>,
    /// Losses of the export.
    pub warnings: Messages,
    /// Notes about choices of the exporter.
    pub notes: Messages,
}

impl Report {
    /// Parses the report; `None` if it is invalid.
    pub fn parse(bytes: &[u8]) -> Option<Report> {
        serde_json::from_slice(bytes).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_package_lists_all_exporter_files() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/blender/oscura_blender");
        let names =
            fs::read_dir(folder).expect("the package").map(|entry| entry.expect("an entry").file_name());
        let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
        names.retain(|name| name.ends_with(".py"));
        names.sort();
        assert_eq!(names, PACKAGE.iter().map(|(name, _)| name.to_string()).collect::<Vec<_>>());
    }

    #[test]
    fn versions_are_parsed() {
        assert_eq!(numbers("4.5.15 LTS"), Some([4, 5]));
        assert_eq!(numbers("5.0.1"), Some([5, 0]));
        assert_eq!(numbers("new"), None);
        assert!(
            version_in(OsStr::new("blender-4.10.0-linux-x64"))
                > version_in(OsStr::new("blender-4.5.2-linux"))
        );
    }
}

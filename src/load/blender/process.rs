//! Runs the exporter.

use super::host::Host;
use super::report::Report;
use crate::error::{Error, Result};
use crate::load::{LoadOptions, ShutterPosition};
use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf, absolute};
use std::process::{Command, ExitStatus, Stdio};

/// The name of the model in the folder of an export.
pub(super) const MODEL: &str = "scene";

/// The package of the exporter, by file.
const PACKAGE: &[(&str, &str)] = &[
    ("__init__.py", include_str!("../../../tools/blender/oscura_blender/__init__.py")),
    ("bake.py", include_str!("../../../tools/blender/oscura_blender/bake.py")),
    ("brushed.py", include_str!("../../../tools/blender/oscura_blender/brushed.py")),
    ("cache.py", include_str!("../../../tools/blender/oscura_blender/cache.py")),
    ("camera.py", include_str!("../../../tools/blender/oscura_blender/camera.py")),
    ("closures.py", include_str!("../../../tools/blender/oscura_blender/closures.py")),
    ("cones.py", include_str!("../../../tools/blender/oscura_blender/cones.py")),
    ("context.py", include_str!("../../../tools/blender/oscura_blender/context.py")),
    ("densities.py", include_str!("../../../tools/blender/oscura_blender/densities.py")),
    ("export.py", include_str!("../../../tools/blender/oscura_blender/export.py")),
    ("facets.py", include_str!("../../../tools/blender/oscura_blender/facets.py")),
    ("facing.py", include_str!("../../../tools/blender/oscura_blender/facing.py")),
    ("fingerprint.py", include_str!("../../../tools/blender/oscura_blender/fingerprint.py")),
    ("flat.py", include_str!("../../../tools/blender/oscura_blender/flat.py")),
    ("geometry.py", include_str!("../../../tools/blender/oscura_blender/geometry.py")),
    ("glasses.py", include_str!("../../../tools/blender/oscura_blender/glasses.py")),
    ("glb.py", include_str!("../../../tools/blender/oscura_blender/glb.py")),
    ("glow.py", include_str!("../../../tools/blender/oscura_blender/glow.py")),
    ("grids.py", include_str!("../../../tools/blender/oscura_blender/grids.py")),
    ("hair.py", include_str!("../../../tools/blender/oscura_blender/hair.py")),
    ("kept_meshes.py", include_str!("../../../tools/blender/oscura_blender/kept_meshes.py")),
    ("lamp_trees.py", include_str!("../../../tools/blender/oscura_blender/lamp_trees.py")),
    ("lights.py", include_str!("../../../tools/blender/oscura_blender/lights.py")),
    ("limits.py", include_str!("../../../tools/blender/oscura_blender/limits.py")),
    ("links.py", include_str!("../../../tools/blender/oscura_blender/links.py")),
    ("materials.py", include_str!("../../../tools/blender/oscura_blender/materials.py")),
    ("means.py", include_str!("../../../tools/blender/oscura_blender/means.py")),
    ("media.py", include_str!("../../../tools/blender/oscura_blender/media.py")),
    ("meshes.py", include_str!("../../../tools/blender/oscura_blender/meshes.py")),
    ("mixes.py", include_str!("../../../tools/blender/oscura_blender/mixes.py")),
    ("motion.py", include_str!("../../../tools/blender/oscura_blender/motion.py")),
    ("objectwise.py", include_str!("../../../tools/blender/oscura_blender/objectwise.py")),
    ("originals.py", include_str!("../../../tools/blender/oscura_blender/originals.py")),
    ("panes.py", include_str!("../../../tools/blender/oscura_blender/panes.py")),
    ("passing.py", include_str!("../../../tools/blender/oscura_blender/passing.py")),
    ("pictures.py", include_str!("../../../tools/blender/oscura_blender/pictures.py")),
    ("points.py", include_str!("../../../tools/blender/oscura_blender/points.py")),
    ("relief.py", include_str!("../../../tools/blender/oscura_blender/relief.py")),
    ("report.py", include_str!("../../../tools/blender/oscura_blender/report.py")),
    ("settings.py", include_str!("../../../tools/blender/oscura_blender/settings.py")),
    ("shaders.py", include_str!("../../../tools/blender/oscura_blender/shaders.py")),
    ("sidecar.py", include_str!("../../../tools/blender/oscura_blender/sidecar.py")),
    ("sizes.py", include_str!("../../../tools/blender/oscura_blender/sizes.py")),
    ("skins.py", include_str!("../../../tools/blender/oscura_blender/skins.py")),
    ("stills.py", include_str!("../../../tools/blender/oscura_blender/stills.py")),
    ("strand_colors.py", include_str!("../../../tools/blender/oscura_blender/strand_colors.py")),
    ("trees.py", include_str!("../../../tools/blender/oscura_blender/trees.py")),
    ("undeformed.py", include_str!("../../../tools/blender/oscura_blender/undeformed.py")),
    ("uniform.py", include_str!("../../../tools/blender/oscura_blender/uniform.py")),
    ("variants.py", include_str!("../../../tools/blender/oscura_blender/variants.py")),
    ("vertex_colors.py", include_str!("../../../tools/blender/oscura_blender/vertex_colors.py")),
    ("view_table.py", include_str!("../../../tools/blender/oscura_blender/view_table.py")),
    ("views.py", include_str!("../../../tools/blender/oscura_blender/views.py")),
    ("volumes.py", include_str!("../../../tools/blender/oscura_blender/volumes.py")),
    ("world.py", include_str!("../../../tools/blender/oscura_blender/world.py")),
];

/// What starts it.
const SCRIPT: &str = include_str!("../../../tools/blender/export.py");

/// Lines of what a failed child printed that an error shows.
const SHOWN: usize = 12;

/// Exports a file into `folder`, where pictures may be `links`; what else it takes goes to `work`.
pub(super) fn run(
    host: &Host,
    file: &Path,
    options: &LoadOptions,
    work: &Path,
    folder: &Path,
    links: bool,
) -> Result<Report> {
    let unwritable = |e: std::io::Error| Error::output(work, format!("can't be written: {e}"));
    let script = unpack(work).map_err(unwritable)?;
    let (log, answer) = (work.join("log.txt"), work.join("report.json"));
    let output = File::create(&log).and_then(|f| Ok((f.try_clone()?, f))).map_err(unwritable)?;
    let mut command = command(host, &script);
    command.arg("--").arg(file).arg(folder).arg(MODEL).arg(&answer);
    for (option, value) in choices(options) {
        command.arg(option).arg(value);
    }
    if links {
        command.arg("--links");
    }
    command.stdin(Stdio::null()).stdout(output.0).stderr(output.1).current_dir(work);
    let program = host.program().display();
    let status = command.status().map_err(|e| Error::input(file, format!("{program} can't be run: {e}")))?;
    let report = fs::read(&answer).ok().and_then(|bytes| Report::parse(&bytes));
    match report {
        Some(report) if status.success() && report.error.is_none() => Ok(report),
        Some(Report { error: Some(error), .. }) => {
            Err(Error::input(file, format!("can't be exported from Blender: {error}")))
        }
        _ => Err(failure(host, file, status, &log)),
    }
}

/// Writes the exporter; gives what to run.
fn unpack(work: &Path) -> std::io::Result<PathBuf> {
    let package = work.join("oscura_blender");
    fs::create_dir(&package)?;
    PACKAGE.iter().try_for_each(|(name, text)| fs::write(package.join(name), text))?;
    let script = work.join("export.py");
    fs::write(&script, SCRIPT)?;
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

/// What the user chose, as arguments.
fn choices(options: &LoadOptions) -> Vec<(&'static str, OsString)> {
    let frame = options.blender.frame.map(|frame| ("--frame", frame.to_string().into()));
    let time =
        options.gltf.time_s.filter(|_| frame.is_none()).map(|time| ("--time", format!("{time:?}").into()));
    let scene = options.gltf.scene.clone().map(|scene| ("--scene", scene.into()));
    let layer = options.blender.view_layer.clone().map(|layer| ("--view-layer", layer.into()));
    // Blender's own folder of work is another; where there is no current one, relative names mean nothing.
    let absolute = |folder: &PathBuf| absolute(folder).unwrap_or_else(|_| folder.clone());
    let cache = options.blender.cache.as_ref().map(|f| ("--cache", absolute(f).into_os_string()));
    let bake = options.blender.bake.map(|edge| ("--bake", edge.to_string().into()));
    let shutter = options.shutter.frames.map(|frames| ("--shutter", format!("{frames:?}").into()));
    let named = |position| ShutterPosition::ALL.iter().find(|(_, known)| *known == position);
    let position = options.shutter.position.and_then(named);
    let position = position.map(|(name, _)| ("--shutter-position", (*name).into()));
    let vectors = options.shutter.vectors.then(|| ("--vectors", "on".into()));
    let all = [frame, time, scene, layer, cache, bake, shutter, position, vectors];
    all.into_iter().flatten().collect()
}

/// Says what is known of a child that left no answer.
fn failure(host: &Host, file: &Path, status: ExitStatus, log: &Path) -> Error {
    let text = fs::read(log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let last = lines[lines.len().saturating_sub(SHOWN)..].join("\n    ");
    let said = match last.is_empty() {
        true => "and printed nothing".to_string(),
        false => format!("and printed:\n    {last}"),
    };
    let error = Error::input(
        file,
        format!("can't be exported: {} ended with {status}, {said}", host.program().display()),
    );
    match host {
        Host::Python(_) if text.contains("No module named 'bpy'") => {
            error.with_help("this Python has no Blender: 'pip install bpy', or name Blender's program")
        }
        _ => error.with_help("does Blender itself open the file?"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_package_has_all_its_files() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/blender/oscura_blender");
        let names =
            fs::read_dir(folder).expect("the package").map(|entry| entry.expect("an entry").file_name());
        let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
        names.retain(|name| name.ends_with(".py"));
        names.sort();
        assert_eq!(names, PACKAGE.iter().map(|(name, _)| name.to_string()).collect::<Vec<_>>());
    }
}

//! Where Blender is: as the user says, else on the search path, else where systems install it; else a Python that has it as
//! the module `bpy`.

use crate::error::{Choice, Error, Result};
use std::env;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The environment variable that names the program.
const VARIABLE: &str = "OSCURA_BLENDER";

/// The oldest Blender that the exporter works with.
const OLDEST: [u32; 2] = [4, 2];

/// What helps where there is none.
fn remedy() -> String {
    format!(
        "install Blender 4.2 or newer (blender.org), or its Python module by 'pip install bpy'; if it is installed already, \
         name it: {}, or the environment variable OSCURA_BLENDER",
        Choice::Blender
    )
}

/// What runs the exporter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Host {
    /// Blender's program.
    Blender(PathBuf),
    /// A Python interpreter.
    Python(PathBuf),
}

impl Host {
    /// The program.
    pub fn program(&self) -> &Path {
        match self {
            Host::Blender(program) | Host::Python(program) => program,
        }
    }
}

/// Finds what runs the exporter for a file; `asked` is what the user named.
pub(super) fn find(file: &Path, asked: Option<&Path>) -> Result<Host> {
    let variable = || env::var_os(VARIABLE).filter(|v| !v.is_empty()).map(PathBuf::from);
    let named = asked
        .map(|p| (p.to_path_buf(), Choice::Blender.to_string()))
        .or_else(|| variable().map(|p| (p, VARIABLE.to_string())));
    if let Some((path, by)) = named {
        return identify(&inside(&path)).map_err(|what| {
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

/// What a program says that it is; else what is wrong with it.
fn identify(program: &Path) -> std::result::Result<Host, String> {
    let said = output(program, &["--version"])?;
    if said.lines().any(|line| line.starts_with("Python 3")) {
        return Ok(Host::Python(program.to_path_buf()));
    }
    let version = said.lines().find_map(|line| line.trim().strip_prefix("Blender "));
    let Some(version) = version else { return Err("is neither Blender nor Python".to_string()) };
    match numbers(version) {
        Some(found) if found >= OLDEST => Ok(Host::Blender(program.to_path_buf())),
        _ => Err(format!("is Blender {version}, and too old")),
    }
}

/// The first two numbers of a version.
fn numbers(version: &str) -> Option<[u32; 2]> {
    let mut parts = version.split(|c: char| !c.is_ascii_digit()).map(str::parse);
    Some([parts.next()?.ok()?, parts.next()?.ok()?])
}

/// What a program prints, if it succeeds.
fn output(program: &Path, arguments: &[&str]) -> std::result::Result<String, String> {
    let run = Command::new(program).args(arguments).stdin(Stdio::null()).stderr(Stdio::null()).output();
    let run = run.map_err(|e| format!("can't be run: {e}"))?;
    match run.status.success() {
        true => Ok(String::from_utf8_lossy(&run.stdout).into_owned()),
        false => Err(format!("ended with {} when asked for its version", run.status)),
    }
}

/// The program that a path means: itself, or the one in a folder or in an application of macOS.
fn inside(path: &Path) -> PathBuf {
    let names = ["blender", "blender.exe", "Contents/MacOS/Blender", "bin/python3", "Scripts/python.exe"];
    let found = || names.iter().map(|name| path.join(name)).find(|p| p.is_file());
    if path.is_dir() { found().unwrap_or_else(|| path.to_path_buf()) } else { path.to_path_buf() }
}

/// Programs that may be Blender: that of the search path first, then the newest by name.
fn programs() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = Vec::new();
    let mut look = |parent: PathBuf| {
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
        .for_each(&mut look);
    folders.sort_by_key(|folder| folder.file_name().map(version_in));
    folders.reverse();
    let installed = folders.iter().map(|folder| inside(folder)).filter(|p| p.is_file());
    on_path(&"blender").into_iter().chain(installed).collect()
}

fn home() -> Option<PathBuf> {
    env::var_os("HOME").or_else(|| env::var_os("USERPROFILE")).map(PathBuf::from)
}

/// The numbers in a file's name, for its order.
fn version_in(name: &OsStr) -> Vec<u32> {
    let name = name.to_string_lossy();
    name.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect()
}

/// A program of the search path.
fn on_path(name: &&str) -> Option<PathBuf> {
    let folders = env::var_os("PATH")?;
    let file = format!("{name}{}", env::consts::EXE_SUFFIX);
    env::split_paths(&folders).map(|folder| folder.join(&file)).find(|p| p.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions() {
        assert_eq!(numbers("4.5.15 LTS"), Some([4, 5]));
        assert_eq!(numbers("5.0.1"), Some([5, 0]));
        assert_eq!(numbers("new"), None);
        assert!(
            version_in(OsStr::new("blender-4.10.0-linux-x64"))
                > version_in(OsStr::new("blender-4.5.2-linux"))
        );
    }
}

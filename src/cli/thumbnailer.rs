//! `oscura install-thumbnailer`: the files by which file managers find out that `oscura thumb` makes small pictures of models
//! (the thumbnailers of GNOME and Xfce, and the shared MIME database of freedesktop.org).

use super::Outcome;
use super::report::print_text;
use super::thumb_args::ThumbnailerArgs;
use oscura::error::{Error, Result};
use oscura::output::{make_folder, remove_file, write_atomically};
use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Types of models: name, what people call it, extension, and what such files begin with, if that is the same for all.
const TYPES: [(&str, &str, &str, Option<&str>); 4] = [
    ("model/gltf-binary", "glTF model (binary)", "glb", Some("glTF")),
    ("model/gltf+json", "glTF model", "gltf", None),
    ("model/obj", "Wavefront OBJ model", "obj", None),
    ("model/x-ply", "PLY model or point cloud", "ply", Some("ply")),
];

/// The program that reads the folder of types anew.
const UPDATE: &str = "update-mime-database";

/// What is written.
struct Installed {
    thumbnailer: (PathBuf, String),
    types: (PathBuf, String),
    /// The folder of all types.
    mime: PathBuf,
}

impl Installed {
    /// Below the user's folder of data.
    fn below(data: &Path) -> Installed {
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
pub(crate) fn run(args: &ThumbnailerArgs) -> Result<Outcome> {
    if args.print {
        // Where nothing is written, the usual place says enough (packages are built without a home).
        let installed = Installed::below(&data_folder().unwrap_or_else(|_| "~/.local/share".into()));
        for (path, text) in installed.files() {
            print_text(&format!("# {}\n{text}\n", path.display()));
        }
        return Ok(Outcome::Done);
    }
    let installed = Installed::below(&data_folder()?);
    let say = |what: &str, path: &Path| {
        if !args.quiet {
            say!("{what:<8} {}", path.display());
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
        explain(args.remove, update(&installed.mime), &installed.mime);
    }
    Ok(Outcome::Done)
}

/// Says what else is to know.
fn explain(is_removal: bool, is_updated: bool, mime: &Path) {
    if !is_updated {
        say!("next     {UPDATE} {} (it was not found or failed; types show after it)", mime.display());
    }
    if is_removal {
        return;
    }
    say!(
        "note     pictures show when file managers have started anew; they keep failures: ~/.cache/thumbnails/fail"
    );
    if !program().starts_with("/usr") {
        let path = program();
        say!(
            "note     GNOME's file manager lets thumbnailers see /usr only; it needs the program there, not at {}",
            path.display()
        );
    }
    say!("undo     oscura install-thumbnailer --remove");
}

/// Lets the system read the types again, if it has the means.
fn update(mime: &Path) -> bool {
    let mut command = Command::new(UPDATE);
    command.arg(mime).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    mime.is_dir() && command.status().is_ok_and(|status| status.success())
}

/// `$XDG_DATA_HOME`, else `~/.local/share` (XDG Base Directory Specification).
fn data_folder() -> Result<PathBuf> {
    let given = |name: &str| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let usual = || given("HOME").map(|home| home.join(".local/share"));
    given("XDG_DATA_HOME").or_else(usual).ok_or_else(|| {
        Error::usage("can't tell where the user's data are").with_help("set XDG_DATA_HOME to a folder")
    })
}

/// How the system starts this program: by its file, or by its name where it runs inside of another (Python).
fn program() -> PathBuf {
    let own = env::current_exe().ok().filter(|path| path.file_stem().is_some_and(|stem| stem == "oscura"));
    let on_path = || {
        let folders: OsString = env::var_os("PATH")?;
        env::split_paths(&folders).map(|folder| folder.join("oscura")).find(|path| path.is_file())
    };
    own.or_else(on_path).unwrap_or_else(|| PathBuf::from("oscura"))
}

/// The entry of a thumbnailer; `%s` is the size in pixels, `%o` the picture and `%i` the model.
fn thumbnailer(program: &Path) -> String {
    let names: Vec<&str> = TYPES.iter().map(|(name, ..)| *name).collect();
    let program = program.display().to_string();
    // The specification has no quotes in TryExec.
    let (tried, run) = (value(&program), value(&quoted(&program)));
    format!(
        "[Thumbnailer Entry]\nTryExec={tried}\nExec={run} thumb --quiet --size %s --file %o %i\nMimeType={};\n",
        names.join(";")
    )
}

/// A word of a command, in quotes (Desktop Entry Specification, "The Exec key").
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

/// A string as the value of a key, which is read before its quotes are (Desktop Entry Specification, "Possible value types").
fn value(text: &str) -> String {
    text.replace('\\', r"\\").replace('\n', r"\n").replace('\t', r"\t").replace('\r', r"\r")
}

/// The types with their extensions, which systems may know already.
fn types() -> String {
    let of = |(name, about, extension, magic): &(&str, &str, &str, Option<&str>)| {
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
    let all: String = TYPES.iter().map(of).collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <mime-info xmlns=\"http://www.freedesktop.org/standards/shared-mime-info\">\n{all}</mime-info>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_with_characters_of_the_command_are_escaped() {
        let line = |path: &str, key: &str| {
            let entry = thumbnailer(Path::new(path));
            let found = entry.lines().find_map(|line| line.strip_prefix(key)).map(str::to_string);
            found.expect("the key")
        };
        let path = r#"/opt/50% $off `a` "b" c\d/oscura"#;
        let program = r#""/opt/50%% \\$off \\`a\\` \\"b\\" c\\\\d/oscura""#;
        assert_eq!(line(path, "Exec="), format!("{program} thumb --quiet --size %s --file %o %i"));
        assert_eq!(line(path, "TryExec="), r#"/opt/50% $off `a` "b" c\\d/oscura"#);
        assert!(line("/usr/bin/oscura", "Exec=").starts_with("\"/usr/bin/oscura\" thumb"));
    }
}

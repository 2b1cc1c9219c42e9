//! `oscura install-thumbnailer`, and what it installs.

use crate::program::*;
use crate::skip::skip;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const FILES: [&str; 2] = ["thumbnailers/oscura.thumbnailer", "mime/packages/oscura.xml"];

/// Runs the command with a data folder of its own.
fn install(data: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_oscura"));
    command.arg("install-thumbnailer").args(more).env("XDG_DATA_HOME", data);
    command.output().expect("it starts")
}

#[test]
fn a_thumbnailer_is_installed_and_removed() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let output = install(&data, &[]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    for file in FILES {
        let path = data.join(file);
        assert!(
            path.is_file() && stderr(&output).contains(&path.display().to_string()),
            "{}",
            stderr(&output)
        );
    }
    assert!(stderr(&output).contains("undo     oscura install-thumbnailer --remove"), "{}", stderr(&output));
    // Installing again succeeds.
    assert_eq!(code(&install(&data, &["--quiet"])), 0);
    let removed = install(&data, &["--remove"]);
    assert_eq!(code(&removed), 0, "{}", stderr(&removed));
    assert!(FILES.iter().all(|file| !data.join(file).exists()));
    assert_eq!(code(&install(&data, &["--remove"])), 0, "nothing to remove is fine");
}

#[test]
fn printing_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let output = install(&data, &["--print"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("[Thumbnailer Entry]") && text.contains("model/gltf-binary"), "{text}");
    assert!(FILES.iter().all(|file| text.contains(file)), "{text}");
    assert!(!data.exists());
    let both = install(&data, &["--print", "--remove"]);
    assert_eq!(code(&both), 2, "{}", stderr(&both));
}

#[test]
fn unwritable_folders_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    fs::write(&data, "a file").unwrap();
    let output = install(&data, &[]);
    assert_eq!(code(&output), 4, "{}", stderr(&output));
    assert!(stderr(&output).contains("thumbnailers"), "{}", stderr(&output));
}

#[test]
#[cfg(unix)]
fn installed_command_writes_to_any_file_name() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    install(&data, &[]);
    let entry = fs::read_to_string(data.join(FILES[0])).unwrap();
    let exec = entry.lines().find_map(|line| line.strip_prefix("Exec=")).expect("a command");
    let (model, picture) = (folder.path().join("my model.obj"), folder.path().join("picture.XYZ123"));
    fs::write(&model, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let quoted = |path: &Path| format!("'{}'", path.display());
    let command = exec.replace("%s", "64").replace("%o", &quoted(&picture)).replace("%i", &quoted(&model));
    let output = Command::new("sh").args(["-c", &command]).output().expect("a shell");
    assert!(output.status.success() && output.stderr.is_empty(), "{}", stderr(&output));
    let bytes = fs::read(&picture).expect("a picture");
    let image = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png).expect("a PNG");
    assert_eq!((image.width(), image.height()), (64, 64));
    let two = run(folder.path(), &["thumb", "a.obj", "b.obj", "--file", "c.png"], 2);
    assert!(stderr(&two).contains("c.png") && stderr(&two).contains("-o"), "{}", stderr(&two));
}

/// The system's MIME database accepts the types.
#[test]
#[cfg(target_os = "linux")]
fn mime_types_are_valid() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    install(&data, &[]);
    if !data.join("mime/globs2").is_file() {
        skip("shared-mime-info", "update-mime-database (shared-mime-info) is not installed");
        return;
    }
    let globs = fs::read_to_string(data.join("mime/globs2")).unwrap();
    for line in ["model/gltf-binary:*.glb", "model/x-ply:*.ply", "model/obj:*.obj", "model/gltf+json:*.gltf"]
    {
        assert!(globs.contains(line), "{line} is not in {globs}");
    }
}

/// The packaging recipe installs every file, without references to the build folder.
#[test]
#[cfg(target_os = "linux")]
fn packages_have_the_expected_layout() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut command = Command::new(root.join("tools/packaging/install.sh"));
    command.arg(env!("CARGO_BIN_EXE_oscura")).env("DESTDIR", folder.path()).env("PREFIX", "/usr");
    // Packages are built without a home folder.
    command.env_remove("HOME").env_remove("XDG_DATA_HOME");
    let output = command.output().expect("a shell");
    assert!(output.status.success(), "{}", stderr(&output));
    let read = |name: &str| {
        fs::read_to_string(folder.path().join("usr/share").join(name))
            .unwrap_or_else(|e| panic!("{name}: {e}"))
    };
    for page in ["oscura", "oscura-render", "oscura-install-thumbnailer"] {
        assert!(read(&format!("man/man1/{page}.1")).contains(".TH"), "{page}");
    }
    assert!(read("bash-completion/completions/oscura").contains("install-thumbnailer"));
    assert!(read("zsh/site-functions/_oscura").starts_with("#compdef oscura"));
    assert!(read("fish/vendor_completions.d/oscura.fish").contains("complete -c oscura"));
    let entry = read("thumbnailers/oscura.thumbnailer");
    assert!(entry.contains("TryExec=/usr/bin/oscura\nExec=\"/usr/bin/oscura\" thumb"), "{entry}");
    assert!(read("mime/packages/oscura.xml").contains("model/gltf-binary"));
    assert!(read("doc/oscura/LICENSE-MIT").contains("MIT"));
    assert!(folder.path().join("usr/bin/oscura").is_file());
}

/// A failing program is not packaged.
#[test]
#[cfg(target_os = "linux")]
fn packaging_fails_if_the_program_fails() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/packaging/install.sh");
    let program = folder.path().join("program");
    for failing in ["--help", "man", "completions", "install-thumbnailer"] {
        let real = env!("CARGO_BIN_EXE_oscura");
        let text = format!("#!/bin/sh\n[ \"$1\" = {failing} ] && exit 3\nexec '{real}' \"$@\"\n");
        fs::write(&program, text).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let root = folder.path().join(failing);
        let output = Command::new(&script).arg(&program).env("DESTDIR", root).output().expect("a shell");
        assert!(!output.status.success(), "{failing}");
    }
}

/// A release contains what `cargo binstall` and Homebrew need.
#[cfg(target_os = "linux")]
fn check_recipes(release: &Path, root: &str) {
    let manifest = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml")).unwrap();
    let header = "[package.metadata.binstall.overrides.x86_64-unknown-linux-gnu]";
    let table = manifest.split(header).nth(1).expect(header);
    let filled = |key: &str| {
        let value = table.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(" = ")).expect(key);
        let text = value.trim_matches('"').replace("{ version }", env!("CARGO_PKG_VERSION"));
        text.replace("{ target-arch }", std::env::consts::ARCH).replace("{ bin }", "oscura")
    };
    let address = filled("pkg-url");
    let archive = address.rsplit('/').next().expect("a name");
    assert!(release.join(archive).is_file(), "{address}");
    assert_eq!(filled("bin-dir"), format!("{root}/bin/oscura"));
    let formula = fs::read_to_string(release.join("oscura.rb")).expect("a formula");
    let sources = format!("oscura-{}.tar.gz", env!("CARGO_PKG_VERSION"));
    let sums = fs::read_to_string(release.join("SHA256SUMS")).expect("sums");
    let sum = sums
        .lines()
        .find(|line| line.ends_with(&sources))
        .and_then(|line| line.split(' ').next())
        .expect("a sum");
    assert!(formula.contains(&format!("sha256 \"{sum}\"")) && !formula.contains('@'), "{formula}");
    assert!(formula.contains(&format!(
        "https://example.org/oscura/releases/download/v{}/{sources}",
        env!("CARGO_PKG_VERSION")
    )));
}

/// The files of a release: archive and Debian package contain a working program, the checksums match, and all crates are listed.
#[test]
#[cfg(target_os = "linux")]
fn releases_contain_the_program() {
    for tool in ["git", "tar", "xz", "strip", "dpkg-deb", "python3", "sha256sum"] {
        if Command::new(tool).arg("--version").output().is_err() {
            return skip(tool, "releases are packed by it");
        }
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/packaging/release.sh");
    let folder = tempfile::tempdir().unwrap();
    let make = |name: &str| {
        let mut command = Command::new(&script);
        command.arg(env!("CARGO_BIN_EXE_oscura")).arg(folder.path().join(name)).env("XZ_LEVEL", "0");
        command
            .env("MAINTAINER", "Someone <someone@example.org>")
            .env("REPOSITORY", "https://example.org/oscura");
        command.env("SOURCE_DATE_EPOCH", "1700000000");
        let output = command.output().expect("a shell");
        assert!(output.status.success(), "{}", stderr(&output));
        fs::read_to_string(folder.path().join(name).join("SHA256SUMS")).unwrap()
    };
    let sums = make("a");
    assert_eq!(make("b"), sums);
    let a = folder.path().join("a");
    let file = |end: &str| {
        let name = names(&a).into_iter().find(|name| name.ends_with(end)).expect(end);
        assert!(sums.contains(&name), "{name} in {sums}");
        a.join(name)
    };
    let runs = |program: &Path| {
        let output = Command::new(program).arg("--version").output().expect("it starts");
        assert!(String::from_utf8_lossy(&output.stdout).starts_with("oscura "));
    };
    let unpack = |command: &mut Command| assert!(command.status().expect("it starts").success());
    let version = env!("CARGO_PKG_VERSION");
    let root = format!("oscura-{version}-{}-linux", std::env::consts::ARCH);
    unpack(Command::new("tar").arg("-xf").arg(file(".tar.xz")).arg("-C").arg(folder.path()));
    runs(&folder.path().join(&root).join("bin/oscura"));
    check_recipes(&a, &root);
    let installed = folder.path().join("installed");
    unpack(Command::new("dpkg-deb").arg("-x").arg(file(".deb")).arg(&installed));
    runs(&installed.join("usr/bin/oscura"));
    assert!(installed.join("usr/share/mime/packages/oscura.xml").is_file());
    let list: serde_json::Value = serde_json::from_slice(&fs::read(file(".cdx.json")).unwrap()).unwrap();
    let crates: Vec<_> =
        list["components"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert!(["gltf", "tobj", "exr", "glam"].iter().all(|name| crates.contains(name)), "{crates:?}");
    assert!(!crates.contains(&"oscura-bench") && list["metadata"]["component"]["version"] == version);
}

//! Runs every command and snippet of README.md and the guide in a folder with the files that they use.
//!
//! Pictures are made small: `--width`, `--height` and `--spp` of `render` are replaced by small values, and long sequences by
//! two frames. `cargo run --release --` becomes the program under test; other cargo commands are skipped. [`fixtures`] generates
//! the README's input files, scripts stand in for Blender and ffmpeg, and `view` is asked for its page and ended. `tools/python`
//! tests the page of the Python module.

use crate::skip::skip;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Prefixes of skipped commands: they build or test the whole project.
const NOT_REPEATED: [&str; 3] = [
    "cargo test --release --workspace",
    "cargo install ",
    // Needs a terminal: tested in `terminal.rs`.
    "oscura render scan.ply --show",
];

/// A fenced code block.
struct Block {
    language: String,
    text: String,
    /// The paragraph before it.
    before: String,
}

/// README.md and the pages of the guide.
const PAGES: [&str; 22] = [
    "README.md",
    "src/guide/first_picture.md",
    "src/guide/gallery.md",
    "src/guide/scans.md",
    "src/guide/from_blender.md",
    "src/guide/rendering.md",
    "src/guide/questions.md",
    "src/guide/compositing.md",
    "src/guide/other_renderers.md",
    "src/guide/scene_files.md",
    "src/guide/formats.md",
    "src/guide/exactness.md",
    "src/guide/speed.md",
    "src/guide/limits.md",
    "src/guide/history.md",
    "src/guide/internals.md",
    "src/guide/internals_loading.md",
    "src/guide/internals_compiling.md",
    "src/guide/internals_tracing.md",
    "src/guide/internals_film.md",
    "src/guide/internals_output.md",
    "src/guide/adding.md",
];

fn page(name: &str) -> String {
    fs::read_to_string(Path::new(ROOT).join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// All pages, one after another.
fn readme() -> String {
    PAGES.map(page).join("\n\n")
}

fn blocks(markdown: &str) -> Vec<Block> {
    let mut list = Vec::new();
    let mut paragraph = String::new();
    let mut lines = markdown.lines();
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```") {
            let text: Vec<&str> = lines.by_ref().take_while(|l| *l != "```").collect();
            let before = std::mem::take(&mut paragraph);
            list.push(Block { language: language.to_string(), text: text.join("\n"), before });
        } else if !line.trim().is_empty() {
            paragraph.push_str(line);
            paragraph.push('\n');
        } else if !paragraph.ends_with("\n\n") {
            // A block belongs to the paragraph right before it.
            let next_is_block = lines.clone().next().is_some_and(|l| l.starts_with("```"));
            if !next_is_block {
                paragraph.clear();
            }
        }
    }
    list
}

/// Words of a command line, with quotes.
fn words(line: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut word: Option<String> = None;
    let mut quote = None;
    for c in line.chars() {
        match (quote, c) {
            (Some(q), c) if c == q => quote = None,
            (Some(_), c) => word.get_or_insert_default().push(c),
            (None, '\'' | '"') => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (None, ' ') => words.extend(word.take()),
            (None, c) => word.get_or_insert_default().push(c),
        }
    }
    assert!(quote.is_none(), "a quote stays open: {line}");
    words.extend(word);
    words
}

/// The input files of the README: the project's assets and scenes, a Blender export, a scan, an environment, and pictures of
/// another renderer.
fn fixtures(folder: &Path) {
    for name in [
        "assets/cornell-box.gltf",
        "scenes/meshes/torus.ply",
        "scenes/cornell-spheres.toml",
        "scenes/rings.toml",
        "scenes/meshes/torus-quads.obj",
    ] {
        let target = folder.join(name);
        fs::create_dir_all(target.parent().expect("a folder")).expect("made");
        fs::copy(Path::new(ROOT).join(name), &target).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    fs::copy(folder.join("scenes/meshes/torus.ply"), folder.join("scan.ply")).expect("copied");
    let json = fs::read_to_string(folder.join("assets/cornell-box.gltf")).expect("the Cornell box");
    let mut value: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    value["cameras"][0]["name"] = "front".into();
    for node in value["nodes"].as_array_mut().expect("nodes") {
        if node.get("camera").is_some() {
            node["name"] = "front".into();
        }
    }
    // The empty node that Blender exports for an area light.
    let area = value["nodes"].as_array_mut().map(|nodes| {
        nodes.push(serde_json::json!({ "name": "Area", "translation": [0.3, 0.5, 0.3] }));
        nodes.len() - 1
    });
    value["scenes"][0]["nodes"].as_array_mut().expect("nodes").push(area.into());
    fs::write(folder.join("room.glb"), glb(&value)).expect("written");
    let strands = "curves 1\n0 0 0\n0 0.1 0\n0.02 0.2 0\n\n0.05 0 0\n0.05 0.1 0\n0.06 0.2 0\n";
    fs::write(folder.join("fur.curves"), strands).expect("written");
    let splats = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
        property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float opacity\n\
        property float scale_0\nproperty float scale_1\nproperty float scale_2\n\
        property float rot_0\nproperty float rot_1\nproperty float rot_2\nproperty float rot_3\nend_header\n\
        0 0 0 1 0.5 0 4 -1 -2 -2 1 0 0 0\n1 1 0 0 0.5 1 4 -2 -1 -2 1 0 0 0\n";
    fs::write(folder.join("capture.ply"), splats).expect("written");
    // Version 2 of SPZ: a header, then positions, opacities, colours, scales and rotations of one splat.
    let head = [0x5053_474eu32, 2, 1].map(u32::to_le_bytes).concat();
    let splat = [0, 0, 0, 0, 0, 0, 0, 0, 0, 255, 200, 120, 60, 144, 128, 144, 128, 128, 128];
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &[&head[..], &[0, 12, 0, 0], &splat].concat()).expect("in memory");
    fs::write(folder.join("capture.spz"), packed.finish().expect("in memory")).expect("written");
    let plate = image::RgbImage::from_fn(16, 8, |x, _| image::Rgb([10 * x as u8, 90, 120]));
    plate.save(folder.join("plate.jpg")).expect("a JPEG picture");
    for name in ["studio.exr", "studio.hdr"] {
        let path = folder.join(name);
        let sky = image::Rgb32FImage::from_fn(16, 8, |_, y| image::Rgb([1.0, 1.0, 0.3 + 0.1 * y as f32]));
        match name.ends_with("hdr") {
            true => image::DynamicImage::from(sky).save(&path).expect("an HDR picture"),
            false => {
                exr::prelude::write_rgb_file(&path, 16, 8, |_, y| (1.0f32, 1.0f32, 0.3 + 0.1 * y as f32))
                    .expect("an EXR picture")
            }
        }
    }
}

/// A binary glTF file without a binary chunk: the buffers are data URIs.
fn glb(value: &serde_json::Value) -> Vec<u8> {
    let mut json = value.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((20 + json.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes
}

/// Reference pictures for `compare`: matching, with a variance.
fn reference_pictures(folder: &Path) {
    for (name, value) in [("mitsuba.exr", None), ("mitsuba-variance.exr", Some(0.01f32))] {
        let path = folder.join(name);
        if path.exists() {
            continue;
        }
        match value {
            None => fs::copy(folder.join("a.exr"), &path).map(|_| ()).expect("the picture before"),
            Some(v) => {
                exr::prelude::write_rgb_file(&path, SIZE, SIZE, |_, _| (v, v, v)).expect("an EXR picture")
            }
        }
    }
}

/// Edge of pictures, pixels.
const SIZE: usize = 24;

/// Arguments with a small size and few samples.
fn small(arguments: &[String]) -> Vec<String> {
    let mut result = Vec::new();
    // The samples of a part depend on the total number.
    let is_part = arguments.iter().any(|a| a == "--sample-range");
    let size = SIZE.to_string();
    // Quality presets exclude a number of samples.
    let samples =
        if arguments.iter().any(|a| a == "--quality") { ["--max-spp", "16"] } else { ["--spp", "2"] };
    let mut less = vec!["--width", &size, "--height", &size, samples[0], samples[1]];
    less.truncate(if is_part { 4 } else { 6 });
    let mut rest = arguments.iter();
    while let Some(word) = rest.next() {
        match word.as_str() {
            word if (less.contains(&word) || word == "--size") && word.starts_with("--") => drop(rest.next()),
            "--frames" => {
                rest.next();
                result.extend(["--frames", "1-2"].map(str::to_string));
            }
            "--crop" => {
                rest.next();
                result.extend(["--crop", "2,2,20,20"].map(str::to_string));
            }
            _ => result.push(word.clone()),
        }
    }
    result.extend(less.into_iter().map(str::to_string));
    result
}

fn oscura(folder: &Path, arguments: &[String]) -> Output {
    program(folder, arguments).output().expect("the program starts")
}

/// The program, with stand-ins for others on its search path.
fn program(folder: &Path, arguments: &[String]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_oscura"));
    command.args(arguments).current_dir(folder);
    let default_materials = folder.join("bin");
    if default_materials.exists() {
        let own = std::env::var_os("PATH").unwrap_or_default();
        let path =
            std::env::join_paths([default_materials.clone()].into_iter().chain(std::env::split_paths(&own)));
        command
            .env("PATH", path.expect("a search path"))
            .env("OSCURA_BLENDER", default_materials.join("blender"));
    }
    command
}

/// Scripts that stand in for other programs: a Blender that always exports the room, and an ffmpeg that writes its input. None
/// where scripts can't be executed.
fn default_materials(folder: &Path) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let scripts = [
            (
                "blender",
                "if [ \"$1\" = --version ]; then echo 'Blender 4.5.1 LTS'; exit 0; fi\n\
                 while [ \"$1\" != -- ]; do shift; done\ncp \"$(dirname \"$0\")/../room.glb\" \"$3\"\n\
                 echo 'environment.background = 1' > \"$3/$4.toml\"\n\
                 echo 'camera.from = \"room.glb\"' >> \"$3/$4.toml\"\n\
                 echo 'objects = [{ mesh = \"room.glb\" }]' >> \"$3/$4.toml\"\n\
                 echo '{\"error\": null, \"warnings\": [], \"notes\": []}' > \"$5\"\n",
            ),
            (
                "ffmpeg",
                "for last; do :; done\ncase $last in -version) echo 'ffmpeg version 7'; exit 0;; esac\n\
                 exec cat > \"$last\"\n",
            ),
        ];
        fs::create_dir_all(folder.join("bin")).expect("made");
        for (name, text) in scripts {
            let path = folder.join("bin").join(name);
            fs::write(&path, format!("#!/bin/sh\n{text}")).expect("written");
            fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("made a program");
        }
        fs::write(folder.join("scene.blend"), "BLENDER").expect("written");
    }
    #[cfg(not(unix))]
    let _ = folder;
}

/// Starts `view` without a browser, requests its page, and ends it.
fn look(folder: &Path, arguments: &[String]) {
    use std::io::{BufRead, BufReader, Read, Write};
    let mut command = program(folder, arguments);
    command.args(["--no-open", "--width", "24", "--height", "24", "--spp", "2"]);
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().expect("the program starts");
    let mut lines = BufReader::new(child.stderr.take().expect("its messages")).lines();
    let line = lines.find_map(|line| line.ok().filter(|l| l.contains("http://"))).expect("an address");
    std::thread::spawn(move || lines.for_each(drop));
    let address = line.split("http://").nth(1).and_then(|a| a.split_whitespace().next()).expect("an address");
    let (host, path) = address.split_once('/').expect("a path");
    let mut stream = std::net::TcpStream::connect(host).expect("it listens");
    write!(stream, "GET /{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").expect("sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("a page");
    assert!(answer.starts_with("HTTP/1.1 200") && answer.contains("<html"), "{answer}");
    child.kill().and_then(|()| child.wait()).expect("ended");
}

/// Runs a line of a shell block; gives false for skipped ones.
fn carry_out(folder: &Path, line: &str) -> bool {
    if NOT_REPEATED.iter().any(|start| line.starts_with(start)) {
        return false;
    }
    let program = ["cargo run --release -- ", "oscura "].into_iter().find_map(|p| line.strip_prefix(p));
    let Some(arguments) = program else { panic!("what is this command? {line}") };
    let (arguments, target) = match arguments.split_once(" > ") {
        Some((arguments, target)) => (arguments, Some(target.trim())),
        None => (arguments, None),
    };
    let mut arguments = words(arguments);
    // A file name instead of a command is rendered.
    if arguments.first().is_some_and(|word| word.contains('.')) {
        arguments.insert(0, "render".to_string());
    }
    let is_render = arguments.first().is_some_and(|a| a == "render");
    if is_render && !arguments.iter().any(|word| word == "-o") {
        // Another page's command may have written a picture of this name.
        let _ = fs::remove_file(
            folder.join(Path::new(&arguments[1]).with_extension("png").file_name().expect("a name")),
        );
    }
    let needs_stand_in =
        [".blend", ".mp4", ".webm"].iter().any(|end| arguments.iter().any(|a| a.ends_with(end)));
    if needs_stand_in && !folder.join("bin").exists() {
        skip("sh", &format!("{line}: no script can stand for the other program"));
        return false;
    }
    match arguments.first().map(String::as_str) {
        Some("compare") => reference_pictures(folder),
        Some("view") => {
            look(folder, &arguments);
            return true;
        }
        // Another page makes the same: neither command overwrites files.
        Some("new" | "export") => {
            let made = folder.join(arguments.last().expect("a name"));
            let _ = if made.is_dir() { fs::remove_dir_all(made) } else { remove_scene(&made) };
        }
        _ => {}
    }
    let output = oscura(folder, &if is_render { small(&arguments) } else { arguments.clone() });
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{line}\n{errors}");
    match target {
        Some(target) => {
            assert!(!output.stdout.is_empty(), "{line} prints nothing");
            fs::write(folder.join(target), &output.stdout).expect("written");
        }
        None if is_render => {
            for pair in arguments.windows(2).filter(|p| p[0] == "-o") {
                // Only the first frame of a sequence.
                let file = pair[1].replace("####", "0001");
                assert!(folder.join(&file).is_file(), "{line} wrote no {file}");
            }
        }
        None => {}
    }
    true
}

/// Removes a file that `new` would create; models stay.
fn remove_scene(path: &Path) -> std::io::Result<()> {
    if path.extension().is_some_and(|e| e == "toml") { fs::remove_file(path) } else { Ok(()) }
}

/// The file that a paragraph says to write a snippet into.
fn file_named(paragraph: &str) -> Option<&str> {
    let words = paragraph.split('`').skip(1).step_by(2);
    words.filter(|w| w.len() > ".toml".len() && w.ends_with(".toml") && !w.contains(' ')).last()
}

#[test]
fn every_command_and_snippet_works() {
    let folder = tempfile::tempdir().expect("a folder");
    fixtures(folder.path());
    default_materials(folder.path());
    let (mut commands, mut snippets) = (0, Vec::new());
    for block in blocks(&readme()) {
        match block.language.as_str() {
            "sh" => {
                for line in block.text.lines().filter(|l| !l.is_empty() && !l.starts_with('#')) {
                    commands += u32::from(carry_out(folder.path(), line));
                }
            }
            "toml" => {
                let name = file_named(&block.before);
                let name = name.unwrap_or_else(|| panic!("no file is named before: {}", block.text));
                fs::write(folder.path().join(name), &block.text).expect("written");
                // Sidecars are used with the model.
                let scene = name.replace(".oscura.toml", ".glb");
                assert!(carry_out(folder.path(), &format!("oscura render {scene} -o snippet.png")));
                snippets.push(name.to_string());
            }
            "text" => {}
            // Doc tests compile it; it is what `examples/render.rs` does, which is run.
            "rust,no_run" => {}
            other => panic!("a block of '{other}': nothing tries it"),
        }
    }
    assert!(commands >= 40, "only {commands} commands were found");
    assert!(snippets.len() >= 2, "{snippets:?}");
}

/// Options in inline code, `--like-this`.
fn options_in(text: &str) -> BTreeSet<String> {
    let starts = text.match_indices("--").filter(|&(at, _)| {
        let before = text[..at].chars().next_back();
        before.is_none_or(|c| " `[\n(".contains(c))
    });
    let name = |at: usize| -> String {
        text[at..].chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect()
    };
    starts.map(|(at, _)| name(at)).filter(|n| n.len() > 3).collect()
}

fn help_of(command: &str) -> String {
    let output = oscura(Path::new(ROOT), &["help".to_string(), command.to_string()]);
    assert!(output.status.success(), "help {command}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn options_match_the_program() {
    let readme = readme();
    let own: BTreeSet<String> = [
        "render",
        "merge",
        "inspect",
        "export",
        "compare",
        "denoise",
        "convert",
        "info",
        "view",
        "thumb",
        "install-thumbnailer",
        "new",
        "cache",
        "help",
    ]
    .iter()
    .flat_map(|command| options_in(&help_of(command)))
    .collect();
    let oscura_lines = readme.lines().filter(|l| !l.contains("cargo ") && !l.contains("oscura-"));
    let mentioned = options_in(&oscura_lines.collect::<Vec<_>>().join("\n"));
    let unknown: Vec<_> = mentioned.difference(&own).collect();
    assert!(unknown.is_empty(), "README.md has options that the program hasn't: {unknown:?}");
    let rendering = options_in(&help_of("render"));
    let missing: Vec<_> =
        rendering.difference(&mentioned).filter(|o| *o != "--help" && *o != "--output").collect();
    assert!(missing.is_empty(), "README.md doesn't explain: {missing:?}");
}

#[test]
fn pictures_and_files_of_the_readme_exist() {
    let count: u32 = PAGES.iter().map(|name| existing_files(name)).sum();
    assert!(count >= 20, "only {count} files were found");
    let guide = fs::read_dir(Path::new(ROOT).join("src/guide")).expect("the guide");
    let pages =
        guide.filter(|entry| entry.as_ref().is_ok_and(|e| e.path().extension().is_some_and(|e| e == "md")));
    assert_eq!(pages.count() + 1, PAGES.len(), "a page is not tried");
}

/// The number of files a page names, all of which must exist: links relative to the page, inline code relative to the root.
fn existing_files(name: &str) -> u32 {
    let (root, text) = (Path::new(ROOT), page(name));
    let links = text.match_indices("](").filter_map(|(at, _)| text[at + 2..].split(')').next());
    let folder = root.join(name).parent().expect("a folder").to_path_buf();
    let links = links.filter(|l| !l.contains("://")).map(|link| (link, folder.join(link)));
    let files = text.split('`').skip(1).step_by(2).filter(|word| {
        let is_own = ["src/", "tests/", "tools/", "assets/", "scenes/"].iter().any(|f| word.starts_with(f));
        is_own && !word.contains([' ', '*'])
    });
    let mut count = 0;
    for (file, path) in links.chain(files.map(|file| (file, root.join(file)))) {
        if file.contains("tools/") && !root.join("tools").exists() {
            skip("tools", &format!("{file}: the package on crates.io is without tools"));
            continue;
        }
        if file.contains("assets/showcase") && !root.join("assets/showcase").exists() {
            skip("showcase", &format!("{file}: the package on crates.io is without pictures of the gallery"));
            continue;
        }
        assert!(path.exists(), "{name} names {file}, which doesn't exist");
        if path.extension().is_some_and(|e| e == "jpg" || e == "png") {
            let bytes = fs::metadata(&path).expect("a picture").len();
            assert!(bytes < 300_000, "{file} has {bytes} bytes");
        }
        count += 1;
    }
    count
}

#[test]
fn words_and_blocks_are_parsed() {
    assert_eq!(words("a --env '' \"b c\"  d"), ["a", "--env", "", "b c", "d"]);
    let found = blocks("One `x.toml`:\n\n```toml\na = 1\n```\n\nTwo.\n\nThree\n```sh\nls\n```\n");
    assert_eq!((found[0].text.as_str(), file_named(&found[0].before)), ("a = 1", Some("x.toml")));
    assert_eq!((found[1].language.as_str(), found[1].before.as_str()), ("sh", "Three\n"));
    assert_eq!(
        small(&words("render a --spp 9 -o b")).join(" "),
        "render a -o b --width 24 --height 24 --spp 2"
    );
    let options = options_in("`--spp N`, `--a-b` [--json] x--no -- |---|");
    assert_eq!(options.into_iter().collect::<Vec<_>>(), ["--a-b", "--json", "--spp"]);
}

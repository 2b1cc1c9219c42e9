//! Runs the program and reads its outputs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in a folder.
pub fn oscura(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_oscura"))
        .args(args)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .output()
        .expect("the program starts")
}

/// Runs the program, which must end with an exit code.
pub fn run(folder: &Path, args: &[&str], expected: i32) -> Output {
    let output = oscura(folder, args);
    assert_eq!(code(&output), expected, "{args:?}: {}", stderr(&output));
    output
}

/// Asserts that its messages contain a word.
pub fn says(output: &Output, word: &str) {
    assert!(stderr(output).contains(word), "'{word}' is not in: {}", stderr(output));
}

/// Runs the program with arguments separated by spaces, which must succeed; returns its messages.
pub fn run_line(folder: &Path, line: &str) -> String {
    stderr(&run(folder, &line.split_whitespace().collect::<Vec<_>>(), 0))
}

/// The exit code.
pub fn code(output: &Output) -> i32 {
    output.status.code().expect("the program ends by itself")
}

/// What it printed on standard output.
pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What it printed on standard error.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The `--json` report of a run.
pub fn report(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", stderr(output)))
}

/// The names of the files in a folder.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("the folder can be read")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// The Cornell box of the repository.
pub fn cornell() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cornell-box.gltf").display().to_string()
}

/// Renders a small Cornell box.
pub fn render(folder: &Path, name: &str, more: &[&str]) -> Output {
    let scene = cornell();
    let mut args = vec!["render", &scene, "-o", name, "--width", "48", "--spp", "4"];
    args.extend(more);
    run(folder, &args, 0)
}

/// The text attribute of an EXR's header.
pub fn attribute(path: &Path, name: &str) -> Option<exr::prelude::AttributeValue> {
    let meta = exr::meta::MetaData::read_from_file(path, true).expect("our own file is valid");
    meta.headers[0].own_attributes.other.get(&exr::prelude::Text::from(name)).cloned()
}

/// The value of a text attribute.
pub fn text(value: &str) -> Option<exr::prelude::AttributeValue> {
    Some(exr::prelude::AttributeValue::Text(exr::prelude::Text::from(value)))
}

/// All channels of an EXR by name.
pub fn planes(path: &Path) -> BTreeMap<String, Vec<f32>> {
    let image = exr::prelude::read_first_flat_layer_from_file(path).expect("an EXR");
    let list = image.layer_data.channel_data.list;
    list.iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect()
}

/// A picture as a flat list.
pub fn pixels(path: &Path) -> Vec<[f32; 3]> {
    let image = oscura::load::image::load_linear_rgb(path).expect("a picture");
    let all = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    all.map(|(x, y)| image.rgba(x, y)).map(|[r, g, b, _]| [r, g, b]).collect()
}

/// A closed sphere without losses: paths end at the maximum depth only.
pub fn endless_scene(folder: &Path) {
    let scene = r#"
        [camera]
        look_from = [0, 0, 0]
        look_at = [0, 0, 1]
        [environment]
        background = [1, 1, 1]
        [materials]
        white = { type = "lambert", color = [1, 1, 1] }
        [[objects]]
        sphere = { center = [0, 0, 0], radius = 2 }
        material = "white"
    "#;
    fs::write(folder.join("endless.toml"), scene).unwrap();
}

//! Renders the converged references in `tests/references/`: needed where pictures are meant to change, and after a scene has.
//!
//! ```text
//! oscura-references PROGRAM [NAME...]     all of them, or those of some names, rendered by a program: target/release/oscura
//! ```
//!
//! Each is the mean of sixteen renders whose seeds no test uses; the variance of that mean is estimated from their differences.

#[path = "../../../tests/pictures/converged/scenes.rs"]
mod scenes;

use exr::prelude::{
    Compression, Encoding, Image, SpecificChannels, Vec2, WritableImage, read_first_rgba_layer_from_file,
};
use scenes::{COMMON, Converged, SCENES};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Number of renders per reference.
const PARTS: u32 = 16;
/// Seed of the first; tests use small ones.
const FIRST_SEED: u32 = 1_000_000;

/// A three-channel picture, rows from the top.
struct Picture {
    size: Vec2<usize>,
    rgb: Vec<[f32; 3]>,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((program, names)) = arguments.split_first() else {
        eprintln!("usage: oscura-references PROGRAM [NAME...]");
        return ExitCode::from(2);
    };
    let wanted = |scene: &&Converged| names.is_empty() || names.iter().any(|name| name == scene.name);
    for scene in SCENES.iter().filter(wanted) {
        if let Err(error) = make(Path::new(program), scene) {
            eprintln!("{}: {error}", scene.name);
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// Renders the parts of a reference and writes their mean and its variance.
fn make(program: &Path, scene: &Converged) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let program = program.canonicalize()?;
    let folder = tempfile::tempdir()?;
    let mut parts = Vec::new();
    for part in 0..PARTS {
        let path = folder.path().join("part.exr");
        let mut command = Command::new(&program);
        command.arg("render").args(scene.arguments).args(COMMON).arg("-o").arg(&path).current_dir(&root);
        command.args(["--spp", &scene.part_samples.to_string()]);
        command.args(["--seed", &(FIRST_SEED + part).to_string()]);
        if !command.status()?.success() {
            return Err("rendering failed".into());
        }
        parts.push(read(&path)?);
    }
    let (mean, variance) = mean_and_variance(&parts);
    let target = |kind: &str| root.join(format!("tests/references/{}.{kind}.exr", scene.name));
    write(&target("ref"), &mean)?;
    write(&target("var"), &variance)?;
    let average = mean.rgb.iter().map(|p| p[1]).sum::<f32>() / mean.rgb.len() as f32;
    let noise = variance.rgb.iter().map(|p| p[1]).sum::<f32>().sqrt() / mean.rgb.len() as f32;
    println!("{}: mean of green {average:.6} +- {noise:.6}", scene.name);
    Ok(())
}

/// The mean of pictures, and the variance of that mean.
fn mean_and_variance(parts: &[Picture]) -> (Picture, Picture) {
    let (size, n) = (parts[0].size, parts.len() as f64);
    let (mut means, mut variances) = (Vec::new(), Vec::new());
    for i in 0..parts[0].rgb.len() {
        let each = |c: usize| parts.iter().map(move |p| f64::from(p.rgb[i][c]));
        let mean = [0, 1, 2].map(|c| each(c).sum::<f64>() / n);
        let spread = [0, 1, 2].map(|c| each(c).map(|v| (v - mean[c]).powi(2)).sum::<f64>());
        means.push(mean.map(|v| v as f32));
        variances.push(spread.map(|s| (s / (n - 1.0) / n) as f32));
    }
    (Picture { size, rgb: means }, Picture { size, rgb: variances })
}

fn read(path: &PathBuf) -> Result<Picture> {
    let blank = |size: Vec2<usize>, _: &_| Picture { size, rgb: vec![[0.0; 3]; size.area()] };
    let set = |picture: &mut Picture, at: Vec2<usize>, (r, g, b, _): (f32, f32, f32, f32)| {
        picture.rgb[at.1 * picture.size.0 + at.0] = [r, g, b];
    };
    Ok(read_first_rgba_layer_from_file(path, blank, set)?.layer_data.channel_data.pixels)
}

fn write(path: &Path, picture: &Picture) -> Result<()> {
    let at = |at: Vec2<usize>| <(f32, f32, f32)>::from(picture.rgb[at.1 * picture.size.0 + at.0]);
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::default() };
    let channels = SpecificChannels::rgb(at);
    Image::from_encoded_channels(picture.size, encoding, channels).write().to_file(path)?;
    Ok(())
}

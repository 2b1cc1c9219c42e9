//! Renders against own converged references in `tests/references/`: changes of sampling must not change the expected value.
//! `tools/references` regenerates them where pictures are meant to change.

pub mod scenes;

use oscura::load::image::load_linear_rgb;
use oscura::metrics::z_test;
use scenes::{COMMON, Converged, SCENES};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
/// Samples per pixel of each of two pictures with different seeds.
const SAMPLES: u32 = 256;

fn oscura(arguments: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_oscura"));
    program.args(arguments).current_dir(ROOT).output().expect("the program starts")
}

/// Where a reference lies; `kind` is `ref` or `var`.
fn reference(name: &str, kind: &str) -> String {
    let path = Path::new(ROOT).join(format!("tests/references/{name}.{kind}.exr"));
    path.to_str().expect("a UTF-8 path").to_string()
}

/// Renders with a seed into the folder of this test's files.
fn render(scene: &Converged, seed: &str, more: &[&str]) -> String {
    let name = format!("{}-{seed}{}.exr", scene.name, more.concat());
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let path = path.to_str().expect("a UTF-8 path").to_string();
    let samples = SAMPLES.to_string();
    let own = ["-o", &path, "--spp", &samples, "--seed", seed];
    let output = oscura(&[&["render"], scene.arguments, COMMON, &own, more].concat());
    assert!(output.status.success(), "{}: {}", scene.name, String::from_utf8_lossy(&output.stderr));
    path
}

/// Whether `compare` accepts two pictures against a reference, with its report; the difference image is written next to the
/// first.
fn agrees(scene: &Converged, a: &str, b: &str) -> (bool, String) {
    let (means, variances) = (reference(scene.name, "ref"), reference(scene.name, "var"));
    let picture = a.replace(".exr", ".png");
    let output = oscura(&["compare", a, &means, "--other-seed", b, "--var", &variances, "-o", &picture]);
    let messages =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    let agrees = match output.status.code() {
        Some(0) => true,
        Some(1) => false,
        _ => panic!("{}: {messages}", scene.name),
    };
    (agrees, format!("{}, {picture}\n{messages}", scene.name))
}

#[test]
fn pictures_agree_with_converged_references() {
    let mut wrong = Vec::new();
    for scene in SCENES {
        assert!(
            16 * scene.part_samples >= 8 * SAMPLES,
            "{}: the reference is as noisy as the picture",
            scene.name
        );
        let (agrees, messages) = agrees(scene, &render(scene, "1", &[]), &render(scene, "2", &[]));
        println!("{messages}");
        if !agrees {
            wrong.push(messages);
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Negative test: light lost after eight bounces is detected.
#[test]
fn a_picture_with_less_light_disagrees() {
    let more = ["--depth", "8"];
    let scene = Converged { arguments: &SCENES[0].arguments[..1], ..SCENES[0] };
    let (agrees, messages) = agrees(&scene, &render(&scene, "1", &more), &render(&scene, "2", &more));
    assert!(!agrees, "{messages}");
}

/// An independent reference: the Cornell box of another renderer, means within 4 standard errors, which are below 0.1 %.
#[test]
fn converged_cornell_box_agrees_with_another_renderer() {
    let (Some(theirs), Some(variances)) = (
        super::references::reference("S1_cornell.ref.exr"),
        super::references::reference("S1_cornell.var.exr"),
    ) else {
        return;
    };
    let read = |path: &Path| load_linear_rgb(path).expect("a reference");
    let (theirs, variances) = (read(&theirs), read(&variances));
    let (ours, noise) =
        (read(reference("cornell", "ref").as_ref()), read(reference("cornell", "var").as_ref()));
    let test = z_test(&ours, &ours, &super::references::shrunk(&theirs, 1.0), &noise).expect("many blocks");
    let pixels = f64::from(theirs.width * theirs.height);
    for (c, channel) in test.channels.iter().enumerate() {
        let all = (0..theirs.height).flat_map(|y| (0..theirs.width).map(move |x| (x, y)));
        let variance: f64 = all.map(|(x, y)| f64::from(variances.rgba(x, y)[c])).sum();
        let sigma = channel.sigma.hypot(variance.sqrt() / pixels);
        println!("{:.6} {:.6} +- {sigma:.6}", channel.mean, channel.reference);
        assert!(sigma < 0.001 * channel.reference, "too noisy to tell: {sigma} {channel:?}");
        assert!((channel.mean - channel.reference).abs() < 4.0 * sigma, "{sigma} {channel:?}");
    }
}

//! Denoising of parts and of files.

use crate::program::*;
use std::path::Path;

fn run(folder: &Path, line: &str) -> String {
    let args: Vec<&str> = line.split_whitespace().collect();
    let output = oscura(folder, &args);
    assert_eq!(code(&output), 0, "{line}: {}", stderr(&output));
    stderr(&output)
}

const SMALL: &str = "--width 48 --spp 16 --quiet --reproducible";

/// Parts of a picture that is to have no noise become it, bit by bit; others lose the noise on demand.
#[test]
fn merged_parts_lose_their_noise() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    let fixed =
        format!("render {scene} {SMALL} --aov normal,diffuse_direct --path-reuse off --splitting off");
    run(folder, &format!("{fixed} --denoise -o whole.exr"));
    for (range, part) in [("0..8", "a"), ("8..16", "b")] {
        run(folder, &format!("{fixed} --denoise --sample-range {range} -o {part}.part"));
        run(folder, &format!("{fixed} --sample-range {range} -o plain-{part}.part"));
    }
    run(folder, "merge b.part a.part -o merged.exr --quiet");
    let at = |name: &str| folder.join(name);
    assert_eq!(planes(&at("merged.exr")), planes(&at("whole.exr")));
    let says = attribute(&at("merged.exr"), "denoised");
    let expected = format!("oscura {}; guides albedo, normal", env!("CARGO_PKG_VERSION"));
    assert_eq!((&says, &attribute(&at("whole.exr"), "denoised")), (&text(&expected), &says));

    run(folder, "merge plain-a.part plain-b.part -o noisy.exr --quiet");
    run(folder, "merge plain-a.part plain-b.part -o clean.exr --denoise --quiet");
    let (noisy, clean) = (planes(&at("noisy.exr")), planes(&at("clean.exr")));
    assert!(noisy["N.X"] == clean["N.X"] && noisy["A"] == clean["A"]);
    assert!(noisy["G"] != clean["G"] && noisy["DiffDir.G"] != clean["DiffDir.G"]);
    let says = attribute(&at("clean.exr"), "denoised");
    assert_eq!(says, text(&expected.replace("albedo, normal", "none")));
    assert_eq!(attribute(&at("noisy.exr"), "denoised"), None);
}

#[test]
fn files_say_what_took_their_noise() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    run(folder, &format!("render {scene} {SMALL} -o a.exr --exr-layout multipart --aov albedo"));
    run(folder, "denoise a.exr -o b.exr --quiet");
    let info = report(&oscura(folder, &["info", "b.exr", "--json"]));
    let parts = info["parts"].as_array().expect("parts");
    assert_eq!(parts.len(), 2);
    for part in parts {
        let says = part["header"]["denoised"].as_str().expect("the attribute");
        assert!(says.ends_with("guides albedo; noise guessed"), "{says}");
    }
}

/// Options that chose a library do no harm.
#[test]
fn options_of_a_library_say_that_they_have_no_effect() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    let small = SMALL.replace("--quiet", "");
    run(folder, &format!("render {scene} {small} --denoise -o a.exr"));
    let said = run(
        folder,
        &format!("render {scene} {small} --denoise --denoiser oidn --oidn-library none.so -o b.exr"),
    );
    assert!(said.contains("built in"), "{said}");
    assert_eq!(planes(&folder.join("a.exr")), planes(&folder.join("b.exr")));
    let said = run(folder, "denoise a.exr -o c.exr --denoiser oidn");
    assert!(said.contains("built in"), "{said}");
}

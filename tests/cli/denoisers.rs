//! What takes the noise out: of parts, of files, and by the library that may be there for it.

use crate::program::*;
use crate::skip::skip;
use std::path::{Path, PathBuf};

fn run(folder: &Path, line: &str) -> String {
    let args: Vec<&str> = line.split_whitespace().collect();
    let output = oscura(folder, &args);
    assert_eq!(code(&output), 0, "{line}: {}", stderr(&output));
    stderr(&output)
}

fn refused(folder: &Path, line: &str) -> String {
    let args: Vec<&str> = line.split_whitespace().collect();
    let output = oscura(folder, &args);
    assert_eq!(code(&output), 2, "{line}: {}", stderr(&output));
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
    let expected = format!("oscura {}; guides albedo, normal, depth", env!("CARGO_PKG_VERSION"));
    assert_eq!((&says, &attribute(&at("whole.exr"), "denoised")), (&text(&expected), &says));

    run(folder, "merge plain-a.part plain-b.part -o noisy.exr --quiet");
    run(folder, "merge plain-a.part plain-b.part -o clean.exr --denoise --quiet");
    let (noisy, clean) = (planes(&at("noisy.exr")), planes(&at("clean.exr")));
    assert!(noisy["N.X"] == clean["N.X"] && noisy["A"] == clean["A"]);
    assert!(noisy["G"] != clean["G"] && noisy["DiffDir.G"] != clean["DiffDir.G"]);
    let says = attribute(&at("clean.exr"), "denoised");
    assert_eq!(says, text(&expected.replace("albedo, normal, depth", "normal")));
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

#[test]
fn a_library_that_is_not_there_is_told_before_work() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    run(folder, &format!("render {scene} {SMALL} -o a.exr"));
    let render = format!("render {scene} -o b.exr");
    for line in [
        &format!("{render} --denoise --denoiser oidn --oidn-library none.so"),
        "denoise a.exr -o b.exr --denoiser oidn --oidn-library none.so",
    ] {
        let said = refused(folder, line);
        assert!(said.contains("none.so") && said.contains("pyoidn"), "{said}");
    }
    std::fs::write(folder.join("text.so"), "text").unwrap();
    assert!(
        refused(folder, "denoise a.exr -o b.exr --denoiser oidn --oidn-library ./text.so")
            .contains("text.so")
    );
    assert!(refused(folder, "denoise a.exr -o b.exr --denoiser own --oidn-library x").contains("no effect"));
    refused(folder, "denoise a.exr -o b.exr --oidn-library x");
    assert!(refused(folder, &format!("{render} --denoiser own")).contains("no effect without --denoise"));
    assert_eq!(names(folder), ["a.exr", "text.so"]);
}

/// The library that `OSCURA_TEST_OIDN` names.
fn library() -> Option<PathBuf> {
    let named = std::env::var_os("OSCURA_TEST_OIDN").map(PathBuf::from).filter(|path| path.exists());
    if named.is_none() {
        skip("oidn", "OSCURA_TEST_OIDN names no libOpenImageDenoise (the wheel 'pyoidn' has one)");
    }
    named
}

/// Where the library is there, it takes the noise out on the way, of parts and of files, and leaves alpha and guides.
#[test]
fn open_image_denoise_takes_the_noise_out() {
    let Some(library) = library() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    let by = format!("--denoiser oidn --oidn-library {}", library.display());
    let sized = format!("render {scene} --width 96 --quiet --float --splitting off --path-reuse off");
    run(folder, &format!("{sized} --spp 512 --seed 9 --denoise -o reference.exr"));
    run(folder, &format!("{sized} --spp 4 -o noisy.exr --aov albedo,normal,diffuse_direct"));
    run(folder, &format!("{sized} --spp 4 -o way.exr --denoise {by}"));
    run(folder, &format!("{sized} --spp 4 -o part.part --denoise"));
    run(folder, &format!("merge part.part -o merged.exr --quiet {by}"));
    run(folder, &format!("denoise noisy.exr -o later.exr {by} --threads 1"));
    let error = |name: &str| {
        let output = oscura(folder, &["compare", name, "reference.exr", "--json"]);
        report(&output)["rel_mse"].as_f64().expect("a number")
    };
    let before = error("noisy.exr");
    for name in ["way.exr", "merged.exr", "later.exr"] {
        let after = error(name);
        println!("{name}: relMSE {before:.5} -> {after:.5}");
        assert!(after * 5.0 < before, "{name}: {before} -> {after}");
        let says = format!("{:?}", attribute(&folder.join(name), "denoised"));
        assert!(says.contains("Open Image Denoise"), "{name}: {says}");
    }
    let (noisy, later) = (planes(&folder.join("noisy.exr")), planes(&folder.join("later.exr")));
    assert!(
        noisy["A"] == later["A"] && noisy["N.X"] == later["N.X"] && noisy["albedo.R"] == later["albedo.R"]
    );
    assert!(noisy["DiffDir.R"] != later["DiffDir.R"]);
}

//! `compare`: metrics, difference pictures and exit codes.

use crate::program::*;
use std::path::{Path, PathBuf};

/// A constant EXR picture of 16 x 16 pixels.
fn picture(folder: &Path, name: &str, value: f32) -> PathBuf {
    let path = folder.join(name);
    exr::prelude::write_rgb_file(&path, 16, 16, |_, _| (value, value, value)).expect("an EXR can be written");
    path
}

#[test]
fn compare_reports_metrics_and_difference_pictures() {
    let folder = tempfile::tempdir().unwrap();
    picture(folder.path(), "a.exr", 1.1);
    picture(folder.path(), "r.exr", 1.0);
    let output = run(
        folder.path(),
        &["compare", "a.exr", "r.exr", "--json", "-o", "d.png", "--side-by-side", "s.png"],
        0,
    );
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one object");
    // The pictures are 32-bit floats.
    let near = |v: &serde_json::Value, expected: f64| (v.as_f64().expect("a number") - expected).abs() < 1e-6;
    assert!(near(&value["rmse"], 0.1) && near(&value["rel_mse"], 0.01 / 1.01), "{value}");
    assert!(near(&value["mean_ratio"][0], 1.1) && value["z_test"].is_null(), "{value}");
    let flip = value["flip"].as_f64().expect("a number");
    // Both are clipped to white by the view transform.
    assert_eq!(flip, 0.0);
    let beside = image::open(folder.path().join("s.png")).expect("a PNG").to_rgb8();
    assert_eq!((beside.dimensions(), beside.get_pixel(40, 8).0), ((48, 16), [0; 3]));
    let drawn = image::open(folder.path().join("d.png")).expect("a PNG").to_rgb8();
    assert_eq!((drawn.dimensions(), drawn.get_pixel(0, 0)[0]), ((16, 16), 255));
}

#[test]
fn compare_exits_with_1_on_difference_and_3_on_mismatched_pictures() {
    let folder = tempfile::tempdir().unwrap();
    for (name, value) in [("a.exr", 1.01), ("b.exr", 0.99), ("far.exr", 2.0), ("r.exr", 1.0), ("v.exr", 1e-4)]
    {
        picture(folder.path(), name, value);
    }
    let test = |a, b| oscura(folder.path(), &["compare", a, "r.exr", "--other-seed", b, "--var", "v.exr"]);
    assert_eq!(code(&test("a.exr", "b.exr")), 0);
    assert_eq!(code(&test("far.exr", "far.exr")), 1);
    exr::prelude::write_rgb_file(folder.path().join("small.exr"), 8, 8, |_, _| (1.0f32, 1.0f32, 1.0f32))
        .unwrap();
    says(&run(folder.path(), &["compare", "small.exr", "r.exr"], 3), "8 x 8");
}

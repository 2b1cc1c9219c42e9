//! View transforms given as lookup tables.

use crate::program::*;
use std::path::Path;

/// A table that inverts colours.
const NEGATIVE: &str = "CSPLUTV100\n3D\n2\n0 1\n0 1\n2\n0 1\n0 1\n2\n0 1\n0 1\n2 2 2\n1 1 1\n0 1 1\n1 0 1\n0 0 1\n1 1 0\n0 1 0\n1 0 0\n0 0 0\n";

/// An emissive sheet that fills the frame.
const SCENE: &str = r#"
camera = { look_from = [0, 0, 2], look_at = [0, 0, 0], vfov = 20 }
environment = { background = 0 }
materials.lamp = { type = "emissive", radiance = [0.25, 0.5, 0.75] }

[[objects]]
quad = { corner = [-4, -4, 0], u = [8, 0, 0], v = [0, 8, 0] }
material = "lamp"

[render]
width = 8
height = 8
samples = 1
view = "negative.csp"
"#;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("scenes")).unwrap();
    std::fs::write(folder.path().join("scenes/negative.csp"), NEGATIVE).unwrap();
    std::fs::write(folder.path().join("scenes/sheet.toml"), SCENE).unwrap();
    folder
}

fn middle(folder: &Path, name: &str) -> [u8; 3] {
    let picture = image::open(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}")).to_rgb8();
    picture.get_pixel(4, 4).0
}

#[test]
fn lookup_tables_in_scenes_merges_and_options() {
    let folder = folder();
    let folder = folder.path();
    let scene = "scenes/sheet.toml";
    run(folder, &["render", scene, "-o", "a.png", "-o", "a.exr", "-o", "a.part", "--quiet"], 0);
    assert_eq!(middle(folder, "a.png"), [191, 128, 64]);
    run(folder, &["render", scene, "-o", "b.png", "--view", "srgb", "--quiet"], 0);
    assert_eq!(middle(folder, "b.png"), [137, 188, 225]);
    run(folder, &["convert", "a.exr", "-o", "c.png", "--view", "scenes/negative.csp"], 0);
    assert_eq!(middle(folder, "c.png"), [191, 128, 64]);
    run(folder, &["merge", "a.part", "-o", "d.png", "--quiet"], 0);
    assert_eq!(middle(folder, "d.png"), [191, 128, 64]);
    let reported = oscura(folder, &["inspect", scene]);
    assert!(stdout(&reported).contains("negative.csp"), "{}", stdout(&reported));

    // Without the file, merging still works for scene-referred outputs.
    std::fs::remove_file(folder.join("scenes/negative.csp")).unwrap();
    run(folder, &["merge", "a.part", "-o", "e.exr", "--quiet"], 0);
    run(folder, &["merge", "a.part", "-o", "e.png", "--view", "srgb", "--quiet"], 0);
    let output = run(folder, &["merge", "a.part", "-o", "f.png", "--quiet"], 3);
    let messages = stderr(&output);
    assert!(messages.contains("negative.csp") && messages.contains("--view"), "{messages}");
    assert!(!folder.join("f.png").exists());
}

#[test]
fn invalid_tables_are_reported_with_their_lines() {
    let folder = folder();
    let folder = folder.path();
    std::fs::write(folder.join("scenes/negative.csp"), NEGATIVE.replace("1 0 0\n0 0 0", "1 0 0\n0 zero 0"))
        .unwrap();
    let output = run(folder, &["render", "scenes/sheet.toml", "-o", "a.png"], 3);
    let messages = stderr(&output);
    assert!(
        messages.contains("sheet.toml:14") && messages.contains("line 20: expected a number, not 'zero'"),
        "{messages}"
    );

    std::fs::write(folder.join("scenes/sheet.toml"), SCENE.replace("negative.csp", "agxx")).unwrap();
    let output = oscura(folder, &["render", "scenes/sheet.toml", "-o", "a.png"]);
    assert!(stderr(&output).contains("one of: srgb, filmic, agx"), "{}", stderr(&output));

    std::fs::write(folder.join("look.cube"), "LUT_3D_SIZE 2\n").unwrap();
    for (view, expected) in
        [("gone.csp", "gone.csp"), ("look.cube", "ociobakelut"), ("agxx", "a similar value exists: 'agx'")]
    {
        says(&run(folder, &["convert", "a.exr", "-o", "a.png", "--view", view], 2), expected);
    }
}

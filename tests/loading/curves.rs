//! `[[curves]]` of scene files, and the files they reference.

use crate::files::load_files;
use oscura::error::Error;
use oscura::load::Loaded;
use oscura::scene::CurveBasis;

fn with_file(curves: &str, name: &str, file: &[u8]) -> Result<Loaded, Error> {
    let text = format!(
        "camera = {{ look_from = [0, 0, 5], look_at = [0, 0, 0] }}\nenvironment.background = 1\n\
         materials.default = {{ type = \"hair\" }}\nmaterials.lamp = {{ type = \"emissive\", radiance = 1 }}\n\
         materials.glass = {{ type = \"dielectric\" }}\nmaterials.pane = {{ type = \"dielectric\", thin = true }}\n\
         materials.milk = {{ type = \"medium\", density = 1 }}\n[[curves]]\n{curves}\n"
    );
    load_files(&[("scene.toml", text.as_bytes()), (name, file)])
}

fn read(curves: &str) -> Result<Loaded, Error> {
    with_file(curves, "a.curves", b"curves 1\nbasis bspline\n0 0 0 .1\n1 0 0 .1\n2 0 0 .1\n3 0 0 0\n")
}

const STRAND: &str = "strands = [[[0, 0, 0], [1, 0, 0], [2, 1, 0], [3, 0, 0]]]\n";

/// Strands out of range, and files without strands, are reported by name.
#[test]
fn distant_and_missing_strands_are_reported() {
    let text = "curves 1\n0 0 0 .1 1 0 0\n1 0 0 .1 1 0 0\n\n1e38 0 0 .1 0 1 0\n-1e38 0 0 .1 0 1 0\n\n0 1 0 .2 0 0 1\n0 2 0 .2 0 0 1\n";
    let linear = "file = \"a.curves\"\nname = \"beard\"\nbasis = \"linear\"\n";
    let loaded = with_file(linear, "a.curves", text.as_bytes()).expect("it loads");
    let beard = &loaded.scene.curves[0];
    assert_eq!((&beard.strands[..], beard.points.len(), beard.radii[2]), (&[2, 2][..], 4, 0.2));
    assert_eq!(beard.colors[3], [0.0, 0.0, 1.0]);
    let messages = |loaded: &Loaded, words: &str| loaded.warnings.iter().any(|w| w.message == words);
    assert!(
        messages(&loaded, "a strand of beard reaches beyond 1e18 m and is left out"),
        "{:?}",
        loaded.warnings
    );
    let mut hair = b"HAIR".to_vec();
    hair.extend([0u32, 0, 2, 1].iter().flat_map(|x| x.to_le_bytes()));
    hair.extend([0.1f32, 0.0, 1.0, 1.0, 1.0].iter().flat_map(|x| x.to_le_bytes()));
    hair.resize(128, 0);
    for (name, bytes) in [("a.hair", &hair[..]), ("a.curves", b"curves 1\n")] {
        let loaded = with_file(&format!("file = \"{name}\"\nradius = 1\n"), name, bytes).expect("it loads");
        assert!(messages(&loaded, "curves 1 hold no strands"), "{name}: {:?}", loaded.warnings);
    }
}

#[test]
fn inline_strands_and_files_load() {
    let scene = read(&format!("{STRAND}radius = [0.3, 0]")).expect("it loads").scene;
    let curves = &scene.curves[0];
    assert_eq!((curves.basis, &curves.strands[..]), (CurveBasis::CatmullRom, &[4][..]));
    assert_eq!((curves.points[2], curves.radii[3]), ([2.0, 1.0, 0.0], 0.0));
    assert!((curves.radii[1] - 0.2).abs() < 1e-6 && curves.name == "curves 1");
    let scene = read("file = \"a.curves\"").expect("it loads").scene;
    assert_eq!((scene.curves[0].basis, scene.curves[0].radii[3]), (CurveBasis::BSpline, 0.0));
    let scene = read("file = \"a.curves\"\nbasis = \"linear\"\nradius = 2").expect("it loads").scene;
    assert_eq!((scene.curves[0].basis, scene.curves[0].radii[3]), (CurveBasis::Linear, 2.0));
    assert!(read(&format!("{STRAND}radius = 1\nmaterial = \"pane\"")).is_ok());
}

#[test]
fn hair_files_are_linear_and_their_transparency_is_reported() {
    let mut bytes = b"HAIR".to_vec();
    bytes.extend([1u32, 2, 2, 1].into_iter().flat_map(u32::to_le_bytes));
    bytes.extend([0.5f32, 0.25, 1.0, 1.0, 1.0].into_iter().flat_map(f32::to_le_bytes));
    bytes.resize(128, 0);
    bytes.extend([0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0].into_iter().flat_map(f32::to_le_bytes));
    let loaded = with_file("file = \"a.hair\"", "a.hair", &bytes).expect("it loads");
    assert_eq!((loaded.scene.curves[0].basis, loaded.scene.curves[0].radii[0]), (CurveBasis::Linear, 0.25));
    assert!(loaded.warnings.iter().any(|w| w.to_string().contains("transparency")), "{:?}", loaded.warnings);
}

#[test]
fn colours_multiply_the_material() {
    let file = b"curves 1\n0 0 0 .1 1 0 0\n1 0 0 .1 0 1 0\n";
    let scene = with_file("file = \"b.curves\"", "b.curves", file).expect("it loads").scene;
    let material = scene.curves[0].material;
    assert!(scene.materials[material.index()].use_vertex_colors && scene.curves[0].colors.len() == 2);
}

#[test]
fn errors_are_reported() {
    for (curves, words) in [
        ("radius = 1".to_string(), "exactly one of 'strands' and 'file'"),
        (format!("{STRAND}file = \"a.curves\""), "exactly one of 'strands' and 'file'"),
        (STRAND.to_string(), "have no radii"),
        (format!("{STRAND}radius = -1"), "'radius' must be a number above 0"),
        (format!("{STRAND}radius = [0, 0]"), "'radius' must be a number above 0"),
        (format!("{STRAND}radius = 1\nmaterial = \"lamp\""), "without emission"),
        (format!("{STRAND}radius = 1\nmaterial = \"glass\""), "neither solid glass"),
        (format!("{STRAND}radius = 1\nmaterial = \"milk\""), "neither solid glass"),
        (format!("{STRAND}radius = 1\nmaterial = \"fur\""), "fur"),
        (format!("{STRAND}radius = 1\nbasis = \"wavy\""), "can't be 'wavy'"),
        (format!("{STRAND}radius = 1\nmotion = {{}}"), "motion"),
        ("strands = [[[0, 0, 0]]]\nradius = 1".into(), "strand 1 of curves 1 has 1 points"),
        ("strands = [[[0, 0]]]\nradius = 1".into(), "list of points [x, y, z]"),
        ("strands = [[[0, 0, 0], [1, 0, 0]]]\nradius = 1\nbasis = \"bezier\"".into(), "has 2 points"),
        ("file = \"none.curves\"".into(), "none.curves"),
    ] {
        let error = read(&curves).expect_err(words).to_string();
        assert!(error.contains(words), "{curves}: {error}");
    }
    let error = with_file("file = \"b.hair\"", "b.hair", b"HAIR").expect_err("a header").to_string();
    assert!(error.contains("b.hair") && error.contains("4 bytes"), "{error}");
}

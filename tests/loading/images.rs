//! Images referenced by files: textures and environments of scene files, maps of OBJ materials.

use crate::files::load_files;
use crate::skip::skip;
use image::{ImageFormat, Rgb, RgbImage};
use oscura::compile::{CompileOptions, compile};
use oscura::image::Encoding;
use oscura::load::image::load_environment;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::scene::{Environment, Model, Texture, TextureId};
use std::io::Cursor;
use std::path::{Path, PathBuf};

fn png(width: u32, height: u32) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let picture = RgbImage::from_pixel(width, height, Rgb([188, 0, 255]));
    picture.write_to(&mut out, ImageFormat::Png).expect("encoded");
    out.into_inner()
}

/// The pixel of a texture's image, as linear colour.
fn colour(loaded: &Loaded, texture: TextureId) -> [f32; 4] {
    let Texture::Image { image, .. } = loaded.scene.textures[texture.index()] else { panic!("not an image") };
    loaded.scene.images[image.index()].rgba(0, 0)
}

const SCENE: &str = "camera = { look_from = [0, 0, 5], look_at = [0, 0, 0] }\n\
                     textures.a = { type = \"image\", file = \"a.png\" }\n\
                     textures.b = { type = \"image\", file = \"a.png\", wrap = \"clamp\" }\n\
                     materials.a = { type = \"lambert\", color = \"a\" }\n\
                     materials.b = { type = \"lambert\", color = \"b\" }\n\
                     [[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n\
                     [[objects]]\nsphere = { center = [3, 0, 0], radius = 1 }\nmaterial = \"b\"\n";

#[test]
fn scene_file_textures_are_srgb_and_share_their_image() {
    let loaded =
        load_files(&[("s.toml", SCENE.as_bytes()), ("a.png", &png(3, 2))]).unwrap_or_else(|e| panic!("{e}"));
    let scene = &loaded.scene;
    assert_eq!((scene.images.len(), scene.textures.len()), (1, 2));
    assert_eq!((scene.images[0].width, scene.images[0].encoding), (3, Encoding::Srgb));
    let Model::Lambert { albedo } = scene.materials[0].model else { panic!("not Lambert") };
    let [r, g, b, a] = colour(&loaded, albedo.texture.expect("a texture"));
    assert!((r - 0.502_886).abs() < 1e-5 && [g, b, a] == [0.0, 1.0, 1.0]);
}

#[test]
fn damaged_and_missing_textures_are_errors_with_their_line() {
    let whole = png(64, 64);
    let cut = load_files(&[("s.toml", SCENE.as_bytes()), ("a.png", &whole[..whole.len() / 2])]);
    let shown = cut.expect_err("a cut picture").to_string();
    assert!(shown.contains("line 2") && shown.contains("a.png"), "{shown}");
    let missing = load_files(&[("s.toml", SCENE.as_bytes())]).expect_err("no picture").to_string();
    assert!(missing.contains("line 2") && missing.contains("a.png"), "{missing}");
}

#[test]
fn environments_of_scene_files_are_checked() {
    let text = "camera = { look_from = [0, 0, 5], look_at = [0, 0, 0] }\n\
                environment = { image = \"e.exr\", strength = 2, rotation = 90 }\n\
                materials.default = { type = \"lambert\" }\n\
                [[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\n";
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("e.exr");
    exr::prelude::write_rgb_file(&path, 4, 2, |x, _| (if x == 0 { -1.0f32 } else { 1.0 }, 2.0f32, f32::NAN))
        .expect("written");
    std::fs::write(folder.path().join("s.toml"), text).expect("written");
    let loaded =
        load(folder.path().join("s.toml"), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let Environment::Image { image, strength, rotation_rad } = loaded.scene.environment else {
        panic!("no image")
    };
    assert!(strength == 2.0 && (rotation_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    let image = &loaded.scene.images[image.index()];
    assert_eq!((image.rgba(0, 0), image.rgba(1, 1)), ([0.0, 2.0, 0.0, 1.0], [1.0, 2.0, 0.0, 1.0]));
    let messages: Vec<&str> = loaded.warnings.iter().map(|w| w.message.as_str()).collect();
    assert_eq!(
        messages,
        ["8 of 24 numbers are NaN or infinite and became 0", "2 of 24 numbers are negative and became 0"]
    );
}

const OBJ: &[u8] =
    b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 3/1 2/1\n";
const MTL: &[u8] =
    b"newmtl a\nKd 0 0 0\nmap_Kd -s 2 2 1 .\\my map.png\nnewmtl b\nKd .5 .5 .5\nmap_Kd ./my map.png\n";

#[test]
fn mtl_maps_are_read_once_and_keep_their_factor() {
    let files: [(&str, &[u8]); 3] = [("a.obj", OBJ), ("m.mtl", MTL), ("my map.png", &png(2, 2))];
    let loaded = load_files(&files).unwrap_or_else(|e| panic!("{e}"));
    let slot = |name: &str| {
        let material = loaded.scene.materials.iter().find(|m| m.name == name).expect("the material");
        let Model::Lambert { albedo } = material.model else { panic!("not Lambert") };
        albedo
    };
    // A black factor next to a map is an exporter's habit and ignored; others apply.
    assert_eq!((slot("a").factor, slot("b").factor), ([1.0; 3], [0.5; 3]));
    let [r, ..] = colour(&loaded, slot("b").texture.expect("a texture"));
    assert!((r - 0.502_886).abs() < 1e-5);
    assert_eq!(loaded.scene.images.len(), 1);
}

#[test]
fn missing_mtl_maps_are_warnings() {
    let loaded = load_files(&[("a.obj", OBJ), ("m.mtl", MTL)]).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.scene.textures.is_empty());
    let left_out: Vec<String> =
        loaded.warnings.iter().filter(|w| w.code == "texture-left-out").map(ToString::to_string).collect();
    assert_eq!(left_out.len(), 2, "{left_out:?}");
    assert!(left_out.iter().all(|w| w.contains("my map.png'")), "{left_out:?}");
}

/// A damaged block in the middle of a large EXR: the material loses its texture, and the model loads.
#[test]
fn damaged_exr_block_loses_only_the_texture() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    let pixel = |x: usize, y: usize| (x as f32 / 64.0, y as f32, (x * y % 97) as f32);
    exr::prelude::write_rgb_file(path("map.exr"), 512, 512, pixel).expect("written");
    std::fs::write(path("a.obj"), OBJ).expect("written");
    std::fs::write(path("m.mtl"), b"newmtl a\nmap_Kd map.exr\nnewmtl b\nKd 1 0 0\n").expect("written");
    let compiled = || {
        let loaded = load(path("a.obj"), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        assert!(loaded.scene.images[0].is_encoded(), "only its header is read");
        compile(&loaded.scene, &CompileOptions::default()).unwrap_or_else(|e| panic!("{e}")).1
    };
    let whole = compiled();
    assert!(whole.warnings.is_empty(), "{:?}", whole.warnings);
    let mut bytes = std::fs::read(path("map.exr")).expect("read");
    let middle = bytes.len() / 2;
    bytes[middle..middle + 20_000].fill(0xa5);
    std::fs::write(path("map.exr"), bytes).expect("written");
    let damaged = compiled();
    let messages: Vec<String> = damaged.warnings.iter().map(ToString::to_string).collect();
    assert!(messages.len() == 1 && messages[0].contains("map.exr"), "{messages:?}");
    assert_eq!(damaged.triangles, whole.triangles);
}

/// Damaged third-party EXR files; skipped where absent.
#[test]
fn damaged_exr_files_never_panic() {
    let shared = std::env::var_os("OSCURA_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let folder = shared.join("data/broken/exr");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        return skip("shared", &format!("{} is absent", folder.display()));
    };
    let mut refused = 0;
    for path in entries.map(|e| e.expect("an entry").path()).filter(|p| p.is_file()) {
        if let Err(e) = load_environment(&path, &mut Vec::new()) {
            assert!(e.to_string().starts_with(&path.display().to_string()), "{e}");
            refused += 1;
        }
    }
    assert!(refused > 50, "only {refused} were refused");
}

/// The data window of an EXR environment is placed in its display window, black around it, and cropped if larger.
#[test]
fn exr_data_windows_are_fitted_to_the_display_window() {
    use exr::prelude::{
        Encoding, Image, IntegerBounds, Layer, LayerAttributes, SpecificChannels, Vec2, WritableImage,
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("window.exr");
    let write = |corner: (i32, i32), size: (usize, usize)| {
        let of = |at: Vec2<usize>| {
            let (x, y) = (at.x() as i32 + corner.0, at.y() as i32 + corner.1);
            (1.0 + x as f32, 2.0 + y as f32, 3.0f32)
        };
        let mut attributes = LayerAttributes::named("");
        attributes.layer_position = Vec2(corner.0, corner.1);
        let channels = SpecificChannels::rgb(of);
        let mut image = Image::from_layer(Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels));
        image.attributes.display_window = IntegerBounds::from_dimensions((8, 4));
        image.write().to_file(&path).expect("written");
    };
    for (corner, size) in [((3, 1), (4, 2)), ((-2, -1), (12, 6)), ((-2, 2), (6, 4))] {
        write(corner, size);
        let mut warnings = Vec::new();
        let image = load_environment(&path, &mut warnings).expect("an environment");
        assert_eq!((image.width, image.height), (8, 4), "{corner:?}");
        for (x, y) in (0..8).flat_map(|x| (0..4).map(move |y| (x, y))) {
            let is_inside = (corner.0..corner.0 + size.0 as i32).contains(&x)
                && (corner.1..corner.1 + size.1 as i32).contains(&y);
            let expected = if is_inside { [1.0 + x as f32, 2.0 + y as f32, 3.0] } else { [0.0; 3] };
            assert_eq!(image.rgba(x as u32, y as u32)[..3], expected, "{corner:?}: {x}, {y}");
        }
    }
}

/// Unsupported EXR features are reported with a hint.
#[test]
fn deep_and_subsampled_exrs_are_reported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let attribute = |name: &str, kind: &str, value: &[u8]| {
        let length = (value.len() as u32).to_le_bytes();
        [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &length, value].concat()
    };
    let words = |values: &[i32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let window = words(&[0, 0, 1, 1]);
    let header = |flags: u32, channels: &[u8], more: Vec<u8>| {
        let parts = [
            attribute("channels", "chlist", channels),
            attribute("compression", "compression", &[0]),
            attribute("dataWindow", "box2i", &window),
            attribute("displayWindow", "box2i", &window),
            attribute("lineOrder", "lineOrder", &[0]),
            attribute("pixelAspectRatio", "float", &1.0f32.to_le_bytes()),
            attribute("screenWindowCenter", "v2f", &[0; 8]),
            attribute("screenWindowWidth", "float", &1.0f32.to_le_bytes()),
            more,
            vec![0],
        ];
        [&0x0131_2f76u32.to_le_bytes()[..], &flags.to_le_bytes(), &parts.concat(), &[0; 64]].concat()
    };
    let channel =
        |name: &str, sampling: i32| [name.as_bytes(), b"\0", &words(&[2, 0, sampling, sampling])].concat();
    let deep = [
        attribute("type", "string", b"deepscanline"),
        attribute("version", "int", &words(&[1])),
        attribute("chunkCount", "int", &words(&[2])),
        attribute("name", "string", b"deep"),
        attribute("maxSamplesPerPixel", "int", &words(&[1])),
    ];
    let of_deep = [channel("A", 1), channel("Z", 1), vec![0]].concat();
    let of_chroma = [channel("BY", 2), channel("RY", 2), channel("Y", 1), vec![0]].concat();
    for (bytes, word) in [
        (header(2 | 0x800, &of_deep, deep.concat()), "deep EXR"),
        (header(2, &of_chroma, Vec::new()), "luminance-chroma EXR"),
    ] {
        let path = folder.path().join("a.exr");
        std::fs::write(&path, bytes).expect("written");
        let error = load_environment(&path, &mut Vec::new()).expect_err(word).to_string();
        assert!(error.contains(word) && error.contains("compositor"), "{error}");
    }
}

/// A PNG file of noise whose pixels take more than a mebibyte.
fn large_png() -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let noise = |x: u32, y: u32| (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503)).to_le_bytes();
    let picture = RgbImage::from_fn(700, 600, |x, y| Rgb([noise(x, y)[1], noise(x, y)[2], (x / 4) as u8]));
    picture.write_to(&mut out, ImageFormat::Png).expect("encoded");
    out.into_inner()
}

#[test]
fn large_textures_are_decoded_during_compilation() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("s.toml");
    std::fs::write(&path, SCENE).expect("written");
    std::fs::write(folder.path().join("a.png"), large_png()).expect("written");
    let loaded = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let image = &loaded.scene.images[0];
    assert!(image.is_encoded() && (image.width, image.height, image.channels) == (700, 600, 3));
    let decoded = image.decoded(&mut Vec::new()).expect("it is whole");
    assert_eq!((decoded.bytes(), decoded.encoding), (700 * 600 * 3, Encoding::Srgb));
    let (_, report) = compile(&loaded.scene, &CompileOptions::default()).expect("it is whole");
    // With its mip levels.
    let textures = &report.textures;
    assert_eq!((textures.decoded, textures.reduced, textures.bytes), (1, 0, textures.all_bytes));
    assert!((700 * 600 * 3..700 * 600 * 4).contains(&textures.bytes));
    // Another file at the same path.
    std::fs::write(folder.path().join("a.png"), png(3, 2)).expect("written");
    let error = compile(&loaded.scene, &CompileOptions::default()).map(drop).expect_err("it has changed");
    let shown = error.to_string();
    assert!(shown.contains("line 2") && shown.contains("changed"), "{shown}");
}

#[test]
fn damage_in_large_images_is_reported() {
    let whole = large_png();
    let cut = &whole[..whole.len() / 2];
    let loaded = load_files_kept(&[("s.toml", SCENE.as_bytes()), ("a.png", cut)]);
    let error = compile(&loaded.0.scene, &CompileOptions::default()).map(drop).expect_err("a cut picture");
    let shown = error.to_string();
    assert!(shown.contains("line 2") && shown.contains("a.png"), "{shown}");
    assert!(error.source_text.is_some());
    let mtl = "newmtl m\nKd .5 .5 .5\nmap_Kd a.png\n";
    let obj = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";
    let files = [("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), ("a.png", cut)];
    let loaded = load_files_kept(&files);
    let (_, report) = compile(&loaded.0.scene, &CompileOptions::default()).expect("textures are left out");
    let shown: Vec<String> = report.warnings.iter().map(ToString::to_string).collect();
    assert!(shown[0].contains("m.mtl") && shown[0].contains("line 3: "), "{shown:?}");
}

/// Loads the first of some files; the folder is kept.
fn load_files_kept(files: &[(&str, &[u8])]) -> (Loaded, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).expect("written");
    }
    let loaded = load(folder.path().join(files[0].0), &LoadOptions::default());
    (loaded.unwrap_or_else(|e| panic!("{e}")), folder)
}

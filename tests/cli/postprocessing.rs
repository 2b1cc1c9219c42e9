//! Postprocessing of pictures: denoising, view transforms, conversion, and `info`.

use crate::program::*;
use std::path::Path;

/// relMSE of a picture.
fn error(folder: &Path, picture: &str, reference: &str) -> f64 {
    let output = oscura(folder, &["compare", picture, reference, "--json"]);
    report(&output)["rel_mse"].as_f64().expect("a number")
}

#[test]
fn denoising_during_and_after_rendering() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let size = ["--width", "96", "--quiet", "--float", "--path-reuse", "off", "--splitting", "off"];
    let scene = cornell();
    let make_with = |name: &str, samples: &str, more: &[&str]| {
        let first = ["render", &scene, "-o", name, "--spp", samples];
        run(folder.path(), &[&first[..], &size, more].concat(), 0);
    };
    let make = |name: &str, more: &[&str]| make_with(name, "4", more);
    make_with("reference.exr", "512", &["--seed", "9", "--denoise"]);
    make("noisy.exr", &[]);
    make("clean.exr", &["--denoise", "--threads", "1"]);
    make("again.exr", &["--denoise", "--threads", "2", "--reproducible"]);
    make("passes.exr", &["--denoise", "--aov", "normal,diffuse_direct,diffuse_indirect,emission"]);
    let (noisy, clean) = (planes(&at("noisy.exr")), planes(&at("clean.exr")));
    assert_eq!(noisy.keys().collect::<Vec<_>>(), clean.keys().collect::<Vec<_>>(), "guides stay out");
    assert_eq!(noisy["A"], clean["A"]);
    assert_eq!(clean, planes(&at("again.exr")));
    let before = error(folder.path(), "noisy.exr", "reference.exr");
    let after = error(folder.path(), "clean.exr", "reference.exr");
    assert!(after * 5.0 < before, "{before} -> {after}");

    let passes = planes(&at("passes.exr"));
    assert!(passes.contains_key("N.X") && !passes.contains_key("Z") && !passes.contains_key("albedo.R"));
    for (i, beauty) in passes["R"].iter().enumerate() {
        let sum: f32 = ["DiffDir.R", "DiffInd.R", "Emit.R"].iter().map(|name| passes[*name][i]).sum();
        assert!((sum - beauty).abs() <= 1e-3 * beauty.max(0.1), "{sum} {beauty}");
    }

    let guides = ["--aov", "albedo,normal,depth,variance,samples"];
    make("a.exr", &guides);
    make("b.exr", &[&guides[..], &["--seed", "1"]].concat());
    for more in [&["--other-seed", "b.exr"][..], &[]] {
        let args = [&["denoise", "a.exr", "-o", "later.exr"][..], more].concat();
        says(&run(folder.path(), &args, 0), "albedo, normal;");
        let later = error(folder.path(), "later.exr", "reference.exr");
        assert!(later * 4.0 < before, "{before} -> {later}");
        assert_eq!(planes(&at("later.exr"))["samples"], planes(&at("a.exr"))["samples"]);
    }
}

#[test]
fn pictures_that_cannot_be_denoised_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    exr::prelude::write_rgb_file(folder.path().join("small.exr"), 8, 8, |_, _| (1.0f32, 1.0f32, 1.0f32))
        .unwrap();
    render(folder.path(), "a.exr", &["--quiet"]);
    std::fs::write(folder.path().join("broken.exr"), [0x76, 0x2f, 0x31, 0x01, 2, 0]).unwrap();
    for (args, expected) in [
        (&["denoise", "a.exr", "-o", "b.png"][..], 2),
        (&["denoise", "a.exr", "-o", "b.exr", "--other-seed", "small.exr"], 3),
        (&["denoise", "broken.exr", "-o", "b.exr"], 3),
        (&["info", "none.exr"], 3),
        (&["convert", "a.exr", "-o", "b.exr"], 2),
        (&["convert", "a.exr", "-o", "b.png", "--layer", "nothing"], 3),
    ] {
        run(folder.path(), args, expected);
    }
    assert_eq!(names(folder.path()), ["a.exr", "broken.exr", "small.exr"]);
}

#[test]
fn all_formats_and_view_transforms() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["-o", "a.jpg", "-o", "a.tif", "-o", "a.webp", "-o", "a.hdr", "-o", "a.exr"];
    // With alpha, as in the EXR.
    let look = ["--view", "agx", "--exposure", "1", "--deep", "--transparent"];
    render(folder.path(), "a.png", &[&files[..], &look].concat());
    let open = |name: &str| image::open(folder.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    let png = open("a.png").to_rgb16();
    assert!(png.pixels().any(|p| p[0] % 257 != 0), "more than 8 bits");
    for name in ["a.jpg", "a.tif", "a.webp"] {
        // JPEG has subsampled chroma, and no alpha.
        let (own, other) = (open("a.png").to_luma8(), open(name).to_luma8());
        let differences = own.pixels().zip(other.pixels()).map(|(p, q)| u32::from(p[0].abs_diff(q[0])));
        let mean = f64::from(differences.sum::<u32>()) / f64::from(own.width() * own.height());
        assert!(mean < if name == "a.jpg" { 6.0 } else { 0.6 }, "{name}: {mean}");
    }
    run(folder.path(), &["convert", "a.exr", "-o", "c.png", "--view", "agx", "--exposure", "1", "--deep"], 0);
    let converted = open("c.png").to_rgb16();
    // The EXR has half floats.
    assert!(png.pixels().zip(converted.pixels()).all(|(p, q)| p[0].abs_diff(q[0]) < 200));
    let picture = |view: &str| {
        run(folder.path(), &["convert", "a.exr", "-o", "v.png", "--view", view], 0);
        std::fs::read(folder.path().join("v.png")).unwrap()
    };
    let views = ["srgb", "filmic", "agx", "agx-punchy", "pbr-neutral", "false-color", "gamma"];
    let pictures: std::collections::HashSet<Vec<u8>> = views.into_iter().map(picture).collect();
    assert_eq!(pictures.len(), views.len());
}

#[test]
fn info_prints_ranges_and_headers_and_layers_are_converted() {
    let folder = tempfile::tempdir().unwrap();
    render(folder.path(), "a.exr", &["--aov", "normal,depth,samples", "--owner", "somebody", "--quiet"]);
    let value = report(&oscura(folder.path(), &["info", "a.exr", "--json"]));
    let part = &value["parts"][0];
    assert_eq!((part["width"].as_u64(), part["header"]["owner"].as_str()), (Some(48), Some("somebody")));
    let channel = |name: &str| {
        let all = part["channels"].as_array().expect("a list").iter();
        all.clone().find(|c| c["name"] == name).unwrap_or_else(|| panic!("no {name}")).clone()
    };
    assert_eq!(
        (channel("samples")["type"].as_str(), channel("samples")["max"].as_f64()),
        (Some("uint"), Some(4.0))
    );
    assert_eq!((channel("A")["max"].as_f64(), channel("R")["nan"].as_u64()), (Some(1.0), Some(0)));
    let text = stdout(&oscura(folder.path(), &["info", "a.exr"]));
    assert!(text.contains("ZIP16") && text.contains("owner: somebody") && text.contains("N.X"), "{text}");
    for layer in ["N", "Z", "samples"] {
        run(folder.path(), &["convert", "a.exr", "-o", "n.png", "--layer", layer, "--quiet"], 0);
    }
}

#[test]
fn non_finite_pixels_are_counted_once() {
    let folder = tempfile::tempdir().unwrap();
    let pixel = |x: usize, y: usize| match (x, y) {
        (0, 0) => (f32::NAN, 1.0f32, f32::NAN),
        (1, 2) => (f32::INFINITY, f32::NEG_INFINITY, 0.0),
        (2, 2) => (0.0, 0.0, f32::INFINITY),
        _ => (0.5, 0.5, 0.5),
    };
    exr::prelude::write_rgb_file(folder.path().join("a.exr"), 4, 4, pixel).unwrap();
    exr::prelude::write_rgb_file(folder.path().join("b.exr"), 4, 4, |_, _| (0.5f32, 0.5f32, 0.5f32)).unwrap();
    let messages = |file: &str, more: &[&str]| {
        let output = run(folder.path(), &[&["convert", file, "-o", "a.png"], more].concat(), 0);
        stderr(&output)
    };
    let notes = messages("a.exr", &[]);
    assert_eq!(notes.matches("note:").count(), 1, "{notes}");
    assert!(notes.contains("2 are NaN") && notes.contains('3'), "{notes}");
    assert!(!messages("b.exr", &[]).contains("note:") && !messages("a.exr", &["--quiet"]).contains("note:"));
}

/// A contact sheet has a cell for each layer, in any channel layout, with the picture of that layer.
#[test]
fn contact_sheets_show_all_layers() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let sheet = |file: &str, more: &[&str]| {
        run(folder.path(), &[&["convert", file, "-o", "sheet.png", "--sheet"], more].concat(), 0);
        image::open(at("sheet.png")).expect("a picture").to_rgb8()
    };
    render(folder.path(), "a.exr", &["--quiet", "--aov", "depth,normal,object_id,crypto_object"]);
    render(folder.path(), "b.exr", &["--quiet", "--aov", "all", "--exr-layout", "multipart"]);
    let small = sheet("a.exr", &[]);
    // Five layers of 48 x 48, and a line of text under each.
    let [tile, tall] = [48 + 8, 48 + 14 + 8];
    let columns = (small.width() - 8) / tile;
    let rows = (small.height() - 8) / tall;
    assert_eq!((small.width(), small.height()), (columns * tile + 8, rows * tall + 8));
    assert!(columns * rows >= 5 && columns * (rows - 1) < 5, "{columns} x {rows}");
    let all = sheet("b.exr", &[]);
    assert!(all.width() * all.height() > 20 * tile * tall, "{} x {}", all.width(), all.height());
    // The beauty pass is the first layer of that file, with the view transform.
    run(folder.path(), &["convert", "b.exr", "-o", "beauty.png", "--view", "agx"], 0);
    let beauty = image::open(at("beauty.png")).expect("a picture").to_rgba8();
    let all = sheet("b.exr", &["--view", "agx"]);
    let opaque: Vec<_> = beauty.enumerate_pixels().filter(|(_, _, pixel)| pixel[3] == 255).collect();
    assert!(opaque.len() > 1000 && opaque.iter().all(|(x, y, p)| all.get_pixel(8 + x, 8 + y).0 == p.0[..3]));
    // Layers without the channels that their names imply are shown by the channels they have.
    for name in ["P.X", "nearest.V", "variance.G", "Vector.Y"] {
        let channel = |name: &str| {
            exr::image::AnyChannel::new(name, exr::image::FlatSamples::F32(vec![0.5, 1.0, 2.0, 0.0]))
        };
        let channels =
            exr::image::AnyChannels::sort(["R", "G", "B", name].map(channel).into_iter().collect());
        let image = exr::image::Image::from_channels((2, 2), channels);
        exr::prelude::WritableImage::write(&image).to_file(at("odd.exr")).expect("written");
        assert!(sheet("odd.exr", &[]).width() > 2, "{name}");
    }
    // Different layers look different.
    let place = |i: u32| (8 + i % columns * tile, 8 + i / columns * tall);
    let pixels = |i: u32| -> Vec<[u8; 3]> {
        let (left, top) = place(i);
        (0..48 * 48).map(|k| small.get_pixel(left + k % 48, top + k / 48).0).collect()
    };
    for i in 0..5 {
        assert!((i + 1..5).all(|k| pixels(i) != pixels(k)), "layer {i}");
        assert!(pixels(i).iter().any(|pixel| *pixel != pixels(i)[0]), "layer {i} is flat");
    }
    for (args, expected) in [
        (["convert", "a.exr", "-o", "s.hdr", "--sheet", "--quiet"], 2),
        (["convert", "a.exr", "-o", "s.png", "--sheet", "--deep"], 2),
    ] {
        run(folder.path(), &args, expected);
    }
}

/// Data layers look as on the contact sheet; with `--deep` and in .hdr they are raw values.
#[test]
fn data_layers_match_the_contact_sheet() {
    let folder = tempfile::tempdir().unwrap();
    render(
        folder.path(),
        "a.exr",
        &["--quiet", "--aov", "depth,normal,crypto_object", "--crop", "4,0,48,44"],
    );
    let convert = |layer: &str, target: &str, more: &[&str]| {
        let args = ["convert", "a.exr", "-o", target, "--quiet", "--layer", layer];
        run(folder.path(), &[&args[..], more].concat(), 0);
        image::open(folder.path().join(target)).expect("a picture")
    };
    let shown = |layer: &str| convert(layer, "layer.png", &[]).to_rgb8();
    run(folder.path(), &["convert", "a.exr", "-o", "sheet.png", "--sheet"], 0);
    let sheet = image::open(folder.path().join("sheet.png")).expect("a picture").to_rgb8();
    let (width, height) = (sheet.width() - 43, sheet.height() - 43);
    for (layer, option) in [("Z", "depth"), ("N", "normal"), ("CryptoObject00", "crypto_object")] {
        let picture = shown(layer);
        assert_eq!((picture.dimensions(), &picture), ((48, 48), &shown(option)), "{layer}");
        let rendered = |x: u32, y: u32| picture.get_pixel(4 + x, y);
        let is_at = |left: u32, top: u32| {
            (0..44 * 44).all(|i| sheet.get_pixel(left + i % 44, top + i / 44) == rendered(i % 44, i / 44))
        };
        assert!((0..width).any(|left| (0..height).any(|top| is_at(left, top))), "{layer}");
    }
    let colors: std::collections::HashSet<[u8; 3]> = shown("crypto_object").pixels().map(|p| p.0).collect();
    assert!(colors.len() > 4, "{colors:?}");
    let depths = planes(&folder.path().join("a.exr")).remove("Z").expect("depths");
    let linear = convert("Z", "z.hdr", &[]).to_rgb32f();
    let ratio = linear.get_pixel(24, 24).0[0] / depths[24 * 44 + 20];
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    // On the back wall, whose normal has no x.
    let x_of_normal = |picture: image::DynamicImage| picture.to_rgb8().get_pixel(36, 22).0[0];
    assert_eq!(x_of_normal(convert("N", "n.png", &["--deep"])), 0);
    assert!((120..136).contains(&x_of_normal(convert("N", "n.png", &[]))));
}

#[test]
fn scene_files_set_output_options() {
    let folder = tempfile::tempdir().unwrap();
    let scene = |render: &str| {
        let rest = "[camera]\nlook_from = [0, 1, 5]\nlook_at = [0, 0, 0]\n[environment]\nbackground = [0.9, 0.5, 0.2]\n\
                    [materials]\na = { type = \"lambert\" }\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n";
        std::fs::write(folder.path().join("a.toml"), format!("[render]\n{render}\n{rest}")).expect("written");
    };
    let make = |name: &str, more: &[&str]| {
        let size = ["--width", "40", "--height", "30", "--quiet", "--reproducible", "--json"];
        let output = run(folder.path(), &[&["render", "a.toml", "-o", name], &size[..], more].concat(), 0);
        report(&output)
    };
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect("a picture");
    scene("samples = 8");
    make("plain.png", &[]);
    make("asked.png", &["--view", "agx", "--white-balance", "4000"]);
    make("asked.exr", &["--crop", "10,5,30,25", "--denoise"]);
    scene("samples = 8\nview = \"agx\"\nwhite_balance = 4000");
    make("said.png", &[]);
    assert_eq!(bytes("said.png"), bytes("asked.png"));
    make("over.png", &["--view", "srgb", "--white-balance", "6500"]);
    assert_ne!(bytes("over.png"), bytes("said.png"));
    assert_ne!(bytes("plain.png"), bytes("said.png"));
    scene("samples = 8\ncrop = [10, 5, 30, 25]\ndenoise = true");
    make("said.exr", &[]);
    assert_eq!(planes(&folder.path().join("said.exr")), planes(&folder.path().join("asked.exr")));
    // A crop of the scene is a part of its own frame, and of one of another size.
    scene("samples = 8\nwidth = 80\nheight = 60\ncrop = [20, 10, 60, 50]\ndenoise = true");
    make("resized.exr", &[]);
    assert_eq!(planes(&folder.path().join("resized.exr")), planes(&folder.path().join("asked.exr")));
    scene("samples = 8\ncrop = [10, 5, 30, 25]\ndenoise = true");
    make("noisy.exr", &["--no-denoise"]);
    assert_ne!(planes(&folder.path().join("noisy.exr")), planes(&folder.path().join("asked.exr")));
    // A crop reports its own noise.
    scene("samples = 4096\nnoise = 30\ncrop = [4, 4, 28, 28]");
    let cropped = make("crop.exr", &[]);
    assert!(cropped["samples_per_pixel"].as_f64().expect("a number") < 4096.0, "{cropped}");
    scene("samples = 4096\nnoise = 8");
    let samples = |report: serde_json::Value| report["samples_per_pixel"].as_f64().expect("a number");
    assert!(samples(make("noise.exr", &[])) < 4096.0);
    assert_eq!(samples(make("counted.exr", &["--spp", "16"])), 16.0);
}

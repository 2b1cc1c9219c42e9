//! Multi-part EXRs and Blender's channel layout in commands that read pictures, and EXR layouts of merged parts.

use crate::program::*;
use exr::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// All channels of all parts, without the name of the render layer.
fn all_planes(path: &Path) -> BTreeMap<String, Vec<f32>> {
    let file = read_all_flat_layers_from_file(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let channels = file.layer_data.iter().flat_map(|layer| &layer.channel_data.list);
    let plain = |name: String| {
        let below = name.trim_start_matches("ViewLayer.").trim_start_matches("Combined.");
        if below == "Depth.Z" { "Z".to_string() } else { below.to_string() }
    };
    channels.map(|c| (plain(c.name.to_string()), c.sample_data.values_as_f32().collect())).collect()
}

#[test]
fn all_layouts_are_denoised_and_converted() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let mut found = Vec::new();
    for layout in ["single", "multipart", "layers"] {
        let aovs = "albedo,normal,depth,variance,diffuse_direct";
        run_line(
            folder.path(),
            &format!(
                "render {scene} -o {layout}.exr --exr-layout {layout} --width 48 --spp 4 --float --quiet --aov {aovs}"
            ),
        );
        let messages = run_line(folder.path(), &format!("denoise {layout}.exr -o clean-{layout}.exr"));
        assert!(
            messages.contains("albedo, normal;") && messages.contains("variance"),
            "{layout}: {messages}"
        );
        let (noisy, clean) = (format!("{layout}.exr"), format!("clean-{layout}.exr"));
        let (noisy, clean) = (all_planes(&folder.path().join(noisy)), all_planes(&folder.path().join(clean)));
        assert!(noisy["G"] != clean["G"] && noisy["DiffDir.G"] != clean["DiffDir.G"], "{layout}");
        run_line(folder.path(), &format!("convert {layout}.exr -o {layout}.png --layer DiffDir"));
        let picture = std::fs::read(folder.path().join(format!("{layout}.png"))).expect("a picture");
        found.push((clean, picture));
    }
    assert_eq!(found[0], found[1]);
    assert_eq!(found[0], found[2]);
}

#[test]
fn merge_sets_the_exr_layout() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let small = "--width 16 --spp 2 --quiet --aov normal";
    says(
        &run(
            folder.path(),
            &format!("render {scene} -o a.part {small} --exr-layout multipart")
                .split_whitespace()
                .collect::<Vec<_>>(),
            2,
        ),
        "oscura merge",
    );
    run_line(folder.path(), &format!("render {scene} -o a.part {small}"));
    run_line(folder.path(), "merge a.part -o a.exr --exr-layout multipart --exr-compression piz");
    let file = read_all_flat_layers_from_file(folder.path().join("a.exr")).expect("an EXR");
    assert_eq!(file.layer_data.len(), 2);
    assert!(file.layer_data.iter().all(|layer| layer.encoding.compression == Compression::PIZ));
}

#[test]
fn pixel_types_without_effect_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let scene = cornell();
    let small = "--width 16 --spp 2";
    let line = format!("render {scene} -o a.exr {small} --aov crypto_object --exr-half CryptoObject00");
    run(folder.path(), &line.split_whitespace().collect::<Vec<_>>(), 2);
    let messages = run_line(folder.path(), &format!("render {scene} -o a.exr {small} --exr-half Foo"));
    assert!(messages.contains("'Foo'"), "{messages}");
}

/// ACEScg: colours are converted, data is not, headers state it, and display pictures are the same.
#[test]
fn output_colour_space() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, scene) = (folder.path(), cornell());
    let aovs = "--aov albedo,normal,depth,variance,diffuse_direct,emission,crypto_object --light-groups";
    let fixed = format!("render {scene} --width 32 --spp 4 --float --quiet {aovs}");
    run_line(folder, &format!("{fixed} -o plain.exr -o plain.png"));
    run_line(folder, &format!("{fixed} -o aces.exr -o aces.png --working-space acescg"));
    run_line(folder, &format!("{fixed} -o parts.exr --working-space acescg --exr-layout multipart"));
    run_line(folder, &format!("{fixed} -o a.part"));
    run_line(folder, "merge a.part -o merged.exr --working-space acescg --quiet");
    let read = |name: &str| std::fs::read(folder.join(name)).expect("a file");
    assert!(read("plain.png") == read("aces.png"));
    let (plain, aces) = (all_planes(&folder.join("plain.exr")), all_planes(&folder.join("aces.exr")));
    let compared = oscura(folder, &["compare", "aces.exr", "plain.exr", "--json"]);
    assert!(report(&compared)["rmse"].as_f64().expect("a number") < 1e-5, "{}", stdout(&compared));
    assert_eq!(aces, all_planes(&folder.join("parts.exr")));
    assert_eq!(aces, all_planes(&folder.join("merged.exr")));
    // As published with OpenColorIO's configurations for ACES.
    let matrix = [
        [0.613_097_4, 0.339_523_1, 0.047_379_5],
        [0.070_193_7, 0.916_353_9, 0.013_452_4],
        [0.020_615_6, 0.109_569_8, 0.869_814_6],
    ];
    let is_converted =
        |layer: &str| ["", "albedo.", "DiffDir.", "Emit."].contains(&layer) || layer.starts_with("RGBA_");
    let (mut converted, mut kept) = (0, 0);
    for (name, own) in &aces {
        let (layer, letter) = name.split_at(name.rfind('.').map_or(0, |dot| dot + 1));
        let Some(row) = ["R", "G", "B"].iter().position(|l| *l == letter).filter(|_| is_converted(layer))
        else {
            assert_eq!(own, &plain[name], "{name}");
            kept += 1;
            continue;
        };
        let from = ["R", "G", "B"].map(|letter| &plain[&format!("{layer}{letter}")]);
        for (i, own) in own.iter().enumerate() {
            let expected: f32 = (0..3).map(|c| matrix[row][c] * from[c][i]).sum();
            assert!((own - expected).abs() <= 1e-5 * (1.0 + expected.abs()), "{name}: {own}, not {expected}");
        }
        converted += 1;
    }
    assert!(converted >= 15 && kept > 15, "{converted} {kept}");
    let file = read_all_flat_layers_from_file(folder.join("parts.exr")).expect("an EXR");
    let space = file.attributes.chromaticities.expect("chromaticities");
    assert_eq!((space.red.0, space.green.1, space.white.0), (0.713, 0.83, 0.32168));
    for layer in &file.layer_data {
        let name = layer.attributes.layer_name.as_ref().expect("a name").to_string();
        let id = layer.attributes.other[&Text::from("colorInteropID")].to_text().expect("text").to_string();
        let is_data = ["N", "depth", "variance", "CryptoObject"].contains(&name.as_str());
        assert_eq!(id, if is_data { "data" } else { "lin_ap1_scene" }, "{name}");
    }
    // Readers of such files honour it.
    run_line(folder, "convert plain.exr -o of-plain.png --quiet");
    run_line(folder, "convert aces.exr -o of-aces.png --quiet");
    let codes = |name: &str| image::open(folder.join(name)).expect("a picture").to_rgb8().into_raw();
    let (one, other) = (codes("of-plain.png"), codes("of-aces.png"));
    assert!(one.iter().zip(&other).all(|(a, b)| a.abs_diff(*b) <= 1));
    run(folder, &["render", &scene, "-o", "a.exr", "--working-space", "cmyk"], 2);
}

/// Data window and frame of a file: position and size of the first, size of the second.
fn windows(path: &Path) -> ([i32; 2], [usize; 2], [usize; 2]) {
    let meta = MetaData::read_from_file(path, true).expect("our own file is valid");
    let header = &meta.headers[0];
    let (position, frame) =
        (header.own_attributes.layer_position, header.shared_attributes.display_window.size);
    ([position.0, position.1], [header.layer_size.0, header.layer_size.1], [frame.0, frame.1])
}

/// Lossy compression excludes data: alpha of 1 stays 1.
#[test]
fn lossy_compression_keeps_alpha() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["b44", "b44a"] {
        let name = format!("{kind}.exr");
        run_line(
            folder.path(),
            &format!(
                "render {} -o {name} --width 40 --height 30 --spp 2 --quiet --exr-compression {kind}",
                concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/sky.toml")
            ),
        );
        let alpha = &planes(&folder.path().join(&name))["A"];
        assert!(alpha.iter().all(|a| *a == 1.0), "{kind}: {:?}", alpha.iter().find(|a| **a != 1.0));
    }
}

/// A crop of a print larger than memory needs memory for the crop only.
#[test]
fn crops_of_large_prints() {
    let folder = tempfile::tempdir().unwrap();
    let of = "--size 60000x60000 --crop 30000,30000,30024,30016 --spp 1 --quiet --memory-limit 500M";
    run_line(folder.path(), &format!("render {} -o print.exr {of}", cornell()));
    assert_eq!(windows(&folder.path().join("print.exr")), ([30000, 30000], [24, 16], [60000, 60000]));
}

#[test]
fn crops_and_overscan() {
    let folder = tempfile::tempdir().unwrap();
    let fixed = "--width 40 --height 30 --spp 4 --quiet";
    let of = |name: &str, more: &str| {
        run_line(folder.path(), &format!("render {} -o {name} {fixed} {more}", cornell()));
        folder.path().join(name)
    };
    let crop = of("crop.exr", "--crop 10,5,30,25");
    let region = of("region.exr", "--region 10,5,30,25");
    assert_eq!(windows(&region), ([10, 5], [20, 20], [40, 30]));
    assert_eq!((all_planes(&crop), windows(&crop)), (all_planes(&region), windows(&region)));

    let wide = of("wide.exr", "--overscan 10");
    let around = of("around.exr", "--crop 10,5,30,25 --overscan 10");
    assert_eq!(windows(&wide), ([-4, -3], [48, 36], [40, 30]));
    assert_eq!(windows(&around), ([6, 2], [28, 26], [40, 30]));
    let (wide, around) = (all_planes(&wide), all_planes(&around));
    // The data window of the crop begins 10 columns and 5 rows after that of the whole.
    for (name, plane) in &around {
        let rows = wide[name].chunks(48).skip(5).take(26);
        let part: Vec<f32> = rows.flat_map(|row| &row[10..38]).copied().collect();
        assert_eq!(*plane, part, "{name}");
    }

    let line = format!("render {} -o a.part -o a.exr {fixed} --region 0,0,8,8", cornell());
    let mixed = oscura(folder.path(), &line.split_whitespace().collect::<Vec<_>>());
    assert!(code(&mixed) == 2 && stderr(&mixed).contains("--region"), "{}", stderr(&mixed));
}

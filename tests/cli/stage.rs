//! Models without camera or light: the default stage, turntables and thumbnails.

use crate::program::*;
use std::fs;
use std::path::Path;

/// A z-up pyramid on a square base.
fn pyramid(folder: &Path) {
    let text = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 3\n\
                f 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
    fs::write(folder.join("a.obj"), text).unwrap();
}

fn shoot(folder: &Path, more: &[&str]) -> String {
    let samples = if more.contains(&"--spp") { &[][..] } else { &["--spp", "8"] };
    let fixed = ["render", "a.obj", "--width", "48", "--height", "48"];
    let output = run(folder, &[&fixed[..], samples, more].concat(), 0);
    stderr(&output)
}

#[test]
fn default_stage_and_up_axis_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    let messages = shoot(folder.path(), &["-o", "a.png"]);
    assert!(messages.contains("note: ") && messages.contains("--up"), "{messages}");
    assert!(messages.contains("--stage") && !messages.contains("warning:"), "{messages}");
    let picture = image::open(folder.path().join("a.png")).unwrap();
    assert!(!picture.color().has_alpha());
    let rgb = picture.into_rgb8();
    // The corner shows the ground; the model is brighter where the key light falls, without clipping.
    let corner = rgb.get_pixel(2, 2)[0];
    assert!((100..220).contains(&corner), "{corner}");
    assert!(rgb.pixels().all(|p| p.0 != [255; 3]));
    let brightest = rgb.pixels().map(|p| p[0]).max().unwrap();
    assert!(brightest > corner + 20, "{brightest} over {corner}");
    // As set by the caller.
    let quiet = shoot(folder.path(), &["-o", "b.png", "--up", "y"]);
    assert!(!quiet.contains("--up"), "{quiet}");
}

#[test]
fn missing_light_is_reported_without_a_stage() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    let messages = shoot(folder.path(), &["-o", "a.png", "--stage", "none"]);
    assert!(messages.contains("warning:") && messages.contains("--stage"), "{messages}");
    // Lights and emissive materials of the file stay.
    fs::write(folder.path().join("a.mtl"), "newmtl glow\nKe 3 3 3\n").unwrap();
    let model = fs::read_to_string(folder.path().join("a.obj")).unwrap();
    fs::write(folder.path().join("a.obj"), format!("mtllib a.mtl\nusemtl glow\n{model}")).unwrap();
    let messages = shoot(folder.path(), &["-o", "a.png", "--stage", "none"]);
    assert!(!messages.contains("warning:"), "{messages}");
}

#[test]
fn backgrounds_are_colours_pictures_or_transparent() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    let corner = |name: &str, more: &[&str]| {
        shoot(folder.path(), &[&["-o", name, "--ground", "none"], more].concat());
        image::open(folder.path().join(name)).unwrap().into_rgba8().get_pixel(1, 1).0
    };
    assert_eq!(corner("c.png", &["--background", "#204060"]), [0x20, 0x40, 0x60, 255]);
    assert_eq!(corner("t.png", &["--background", "transparent"]), [0, 0, 0, 0]);
    // The picture is cropped to fill the frame: only its middle is visible.
    image::RgbImage::from_fn(64, 16, |x, _| image::Rgb(if x < 24 { [255, 0, 0] } else { [0, 0, 255] }))
        .save(folder.path().join("back.png"))
        .unwrap();
    assert_eq!(corner("p.png", &["--background", "back.png"]), [0, 0, 255, 255]);
    // The unshadowed ground matches the background's colour.
    shoot(folder.path(), &["-o", "g.png", "--background", "#808080", "--spp", "64"]);
    let ground = image::open(folder.path().join("g.png")).unwrap().into_rgb8();
    let edge: Vec<u8> = (0..48).map(|x| ground.get_pixel(x, 1)[0]).collect();
    let mean = edge.iter().map(|&v| f64::from(v)).sum::<f64>() / 48.0;
    assert!((mean - 128.0).abs() < 14.0, "{mean}");
}

/// From the front, the horizon is in view: left of the model, rows above and below it look alike.
#[test]
fn ground_blends_into_the_background() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    let more: [&[&str]; 5] = [
        &[],
        &["--background", "#c02020"],
        &["--background", "#f0f0ff"],
        &["--stage", "sky"],
        &["--stage", "white"],
    ];
    for more in more {
        let fixed = ["-o", "a.png", "--view-from", "front", "--spp", "256", "--up", "z"];
        shoot(folder.path(), &[&fixed[..], more].concat());
        let picture = image::open(folder.path().join("a.png")).unwrap().into_rgb8();
        // The key light is on this side, the shadow on the other.
        let row =
            |y: u32, c: usize| (0..8).map(|x| f64::from(picture.get_pixel(x, y).0[c])).sum::<f64>() / 8.0;
        for c in 0..3 {
            let rows: Vec<f64> = (0..24).map(|y| row(y, c)).collect();
            let most = rows.iter().fold(0.0f64, |most, v| most.max((v - rows[0]).abs()));
            assert!(most < 2.0, "{more:?}, channel {c}: {rows:?}");
        }
    }
}

#[test]
fn shadows_on_background_pictures_and_transparency() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    let pixels = |name: &str, more: &[&str]| {
        shoot(folder.path(), &[&["-o", name, "--up", "z", "--spp", "64"], more].concat());
        image::open(folder.path().join(name)).unwrap().into_rgba8()
    };
    // The shadow lies to the right of the model, away from the key light.
    let open = pixels("t.png", &["--background", "transparent"]);
    assert_eq!(open.get_pixel(1, 1).0, [0; 4]);
    let partly = open.pixels().filter(|p| (12..235).contains(&p.0[3]) && p.0[0] < 16).count();
    assert!(partly > 20, "{partly} pixels of shadow");
    image::RgbImage::from_pixel(8, 8, image::Rgb([90, 160, 220]))
        .save(folder.path().join("sky.png"))
        .unwrap();
    let plate = pixels("p.png", &["--background", "sky.png"]);
    assert_eq!(plate.get_pixel(1, 1).0, [90, 160, 220, 255]);
    // Where alpha marks a shadow the picture behind is darker, and far above nothing has changed.
    let shades: Vec<(u8, u8)> = open
        .pixels()
        .zip(plate.pixels())
        .filter(|(over, _)| over.0[3] < 235 && over.0[..3].iter().all(|&v| v < 16))
        .map(|(over, onto)| (over.0[3], onto.0[2]))
        .collect();
    let dark: Vec<_> = shades.iter().filter(|(alpha, _)| *alpha > 30).collect();
    assert!(dark.len() > 20 && dark.iter().all(|(_, blue)| *blue < 210), "{dark:?}");
    assert!((0..48).all(|x| plate.get_pixel(x, 0).0 == [90, 160, 220, 255]));
}

/// A translated copy is oriented as the one at the origin.
#[test]
fn up_axis_detection_is_translation_invariant() {
    let folder = tempfile::tempdir().unwrap();
    let base = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [0.0, 3.0, 0.0]];
    for (turn, axis) in [([0, 1, 2], "y"), ([2, 0, 1], "z")] {
        for offset in [[0.0; 3], [512345.0, 0.0, 4512345.0], [512345.0, 4512345.0, 12.0]] {
            let corner = |p: &[f64; 3]| {
                let at: [f64; 3] = std::array::from_fn(|i| p[turn[i]] + offset[i]);
                format!("v {} {} {}\n", at[0], at[1], at[2])
            };
            let vertices: String = base.iter().map(corner).collect();
            let faces = "f 1 2 3 4\nf 2 1 5\nf 3 2 5\nf 4 3 5\nf 1 4 5\n";
            fs::write(folder.path().join("a.obj"), vertices + faces).unwrap();
            let messages = shoot(folder.path(), &["-o", "a.png", "--spp", "1"]);
            assert!(messages.contains(&format!("{axis} points up")), "{offset:?}: {messages}");
        }
    }
}

/// Map coordinates exceed single precision: the picture is that of the same terrain at the origin, to the bit.
#[test]
fn geospatial_coordinates_match_the_origin() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, [east, north]: [f64; 2]| {
        let height = |i: u32, j: u32| f64::from((i * 7 + j * 3) % 5) * 0.25;
        let points: Vec<[f64; 3]> = (0..36u32)
            .map(|k| (k % 6, k / 6))
            .map(|(i, j)| [east + 0.5 * f64::from(i), north + 0.5 * f64::from(j), height(i, j)])
            .collect();
        let quads: Vec<[u32; 4]> = (0..25u32)
            .map(|k| k % 5 + 6 * (k / 5))
            .map(|first| [first, first + 1, first + 7, first + 6])
            .collect();
        let is_obj = name.ends_with(".obj");
        let lines = points.iter().map(|[x, y, z]| format!("{}{x} {y} {z}\n", if is_obj { "v " } else { "" }));
        let face = |q: &[u32; 4]| match is_obj {
            true => format!("f {} {} {} {}\n", q[0] + 1, q[1] + 1, q[2] + 1, q[3] + 1),
            false => format!("4 {} {} {} {}\n", q[0], q[1], q[2], q[3]),
        };
        let head = "ply\nformat ascii 1.0\nelement vertex 36\nproperty double x\nproperty double y\n\
                    property double z\nelement face 25\nproperty list uchar int vertex_indices\nend_header\n";
        let text = lines.chain(quads.iter().map(face)).collect::<String>();
        fs::write(folder.path().join(name), if is_obj { text } else { format!("{head}{text}") }).unwrap();
    };
    let picture = |name: &str| {
        let size = ["--width", "48", "--height", "32", "--spp", "2", "--up", "z", "--float", "-o", "a.exr"];
        run(folder.path(), &[&["render", name][..], &size].concat(), 0);
        let flat = exr::prelude::read_first_flat_layer_from_file(folder.path().join("a.exr")).unwrap();
        let channels = flat.layer_data.channel_data.list;
        channels.iter().flat_map(|c| c.sample_data.values_as_f32()).map(f32::to_bits).collect::<Vec<u32>>()
    };
    for extension in ["obj", "ply"] {
        let [near, far] = ["near", "far"].map(|stem| format!("{stem}.{extension}"));
        write(&near, [0.0; 2]);
        write(&far, [512_345.25, 4_512_345.75]);
        let [near, far] = [near, far].map(|name| picture(&name));
        assert!(near == far && near.iter().any(|&bits| bits != 0), "{extension}");
    }
}

#[test]
fn stage_options_without_effect_are_refused_or_reported() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    for (option, value) in
        [("--stage", "disco"), ("--view-from", "12"), ("--background", "#12"), ("--up", "w"), ("--zoom", "0")]
    {
        run(folder.path(), &["render", "a.obj", "-o", "a.png", option, value], 2);
    }
    let scene = cornell();
    let size = ["--width", "8", "--spp", "1", "-o", "c.png"];
    let more = ["--stage", "sky", "--view-from", "top", "--ground", "floor"];
    let output = run(folder.path(), &[&["render", &scene][..], &size, &more].concat(), 0);
    for option in ["--view-from", "--ground"] {
        let part = format!("{option} has no effect");
        assert!(stderr(&output).contains(&part), "'{part}' is not in {}", stderr(&output));
    }
    let more = ["--stage", "sky", "--env", "", "--zoom", "2"];
    let output = oscura(folder.path(), &[&["render", &scene][..], &size, &more].concat());
    for option in ["--stage", "--zoom"] {
        let part = format!("{option} has no effect");
        assert!(stderr(&output).contains(&part), "'{part}' is not in {}", stderr(&output));
    }
}

#[test]
fn smooth_shading_option() {
    let folder = tempfile::tempdir().unwrap();
    // A bent strip: eight faces around a quarter of a tube.
    let ring = |i: u32| (f64::from(i) / 8.0 * std::f64::consts::FRAC_PI_2).sin_cos();
    let vertices: String =
        (0..9).map(|i| format!("v {0} {1} 0\nv {0} {1} 2\n", ring(i).0, ring(i).1)).collect();
    let faces: String =
        (0..8).map(|i| 2 * i + 1).map(|a| format!("f {} {} {} {}\n", a, a + 1, a + 3, a + 2)).collect();
    fs::write(folder.path().join("a.obj"), vertices + &faces).unwrap();
    let steps = |name: &str, more: &[&str]| {
        let fixed = ["-o", name, "--up", "y", "--view-from", "45,10", "--ground", "none", "--spp", "32"];
        let messages = shoot(folder.path(), &[&fixed[..], more].concat());
        let picture = image::open(folder.path().join(name)).unwrap().into_luma8();
        let row: Vec<u8> = (8..40).map(|x| picture.get_pixel(x, 24)[0]).collect();
        (row.windows(2).map(|w| w[0].abs_diff(w[1])).max().unwrap(), messages)
    };
    let (facets, smooth) = (steps("a.png", &[]), steps("b.png", &["--smooth"]));
    assert!(fs::read(folder.path().join("a.png")).unwrap() != fs::read(folder.path().join("b.png")).unwrap());
    assert!(smooth.0 <= facets.0, "{} {}", smooth.0, facets.0);
    let sharp = steps("c.png", &["--smooth=5"]);
    assert!(fs::read(folder.path().join("a.png")).unwrap() == fs::read(folder.path().join("c.png")).unwrap());
    assert!(!sharp.1.contains("--smooth"), "{}", sharp.1);
    let other = oscura(
        folder.path(),
        &["render", &cornell(), "--width", "8", "--spp", "1", "-o", "d.png", "--smooth"],
    );
    assert!(code(&other) == 0 && stderr(&other).contains("--smooth"), "{}", stderr(&other));
}

/// Degenerate triangles at poles of spheres are accepted.
#[test]
fn degenerate_triangles_are_a_note() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\nf 1 2 4\n").unwrap();
    let messages = shoot(folder.path(), &["-o", "a.png", "--strict"]);
    assert!(messages.contains("note: 1 "), "{messages}");
    // A position alone is aimed at the model.
    let messages = shoot(folder.path(), &["-o", "b.png", "--eye", "0.3,0.3,4", "--frames", "1-2"]);
    assert!(messages.contains("warning: "), "{messages}");
    let picture = image::open(folder.path().join("b.0001.png")).unwrap().into_rgb8();
    assert!(picture.get_pixel(24, 24) != picture.get_pixel(2, 24));
}

/// A square floor with a camera as glTF, and a small emissive triangle.
fn spark(folder: &Path) {
    let floats = |list: &[f32]| list.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let floor = [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [0.0, 0.0, -2.0]];
    let spark = [[-0.02, 0.5, 0.0], [0.02, 0.5, 0.0], [0.0, 0.54, 0.0]];
    fs::write(folder.join("a.bin"), floats([floor, spark].as_flattened().as_flattened())).unwrap();
    let accessor = |at: u32, low: &str, high: &str| {
        format!(
            r#"{{"bufferView":0,"byteOffset":{at},"componentType":5126,"count":3,"type":"VEC3","min":{low},"max":{high}}}"#
        )
    };
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1]}}],
        "nodes":[{{"mesh":0}},{{"camera":0,"translation":[0,1,4]}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.8,"znear":0.1}}}}],
        "materials":[{{"doubleSided":true,"pbrMetallicRoughness":{{"metallicFactor":0}}}},{{"emissiveFactor":[1,0.5,0.2]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}},{{"attributes":{{"POSITION":1}},"material":1}}]}}],
        "accessors":[{},{}],
        "bufferViews":[{{"buffer":0,"byteLength":72}}],"buffers":[{{"uri":"a.bin","byteLength":72}}]}}"#,
        accessor(0, "[-2,0,-2]", "[2,0,2]"),
        accessor(36, "[-0.02,0.5,0]", "[0.02,0.54,0]")
    );
    fs::write(folder.join("a.gltf"), text).unwrap();
}

#[test]
fn emissive_parts_do_not_disable_default_lights() {
    let folder = tempfile::tempdir().unwrap();
    spark(folder.path());
    let shoot = |name: &str, more: &[&str]| {
        let fixed = ["render", "a.gltf", "-o", name, "--width", "32", "--height", "24", "--spp", "16"];
        let output = run(folder.path(), &[&fixed[..], more].concat(), 0);
        let picture = image::open(folder.path().join(name)).unwrap();
        (stderr(&output), picture.color().has_alpha(), picture.into_rgb8())
    };
    // The floor, in the lower half of the picture.
    let (messages, _, lit) = shoot("lit.png", &[]);
    assert!(messages.contains("--env none"), "{messages}");
    assert!(lit.get_pixel(16, 16)[0] > 100, "{:?}", lit.get_pixel(16, 16));
    let (messages, _, staged) = shoot("staged.png", &["--stage", "studio"]);
    assert!(messages.contains("note: ") && messages.contains("studio"), "{messages}");
    assert!(!messages.contains("warning:"), "{messages}");
    assert!(staged.get_pixel(16, 16)[0] > 60, "{:?}", staged.get_pixel(16, 16));
    let (_, has_alpha, dark) = shoot("dark.png", &["--env", ""]);
    assert!(!has_alpha && dark.get_pixel(16, 16)[0] < 30, "{:?}", dark.get_pixel(16, 16));
    assert_eq!(dark.get_pixel(1, 1).0, [0; 3]);
    assert!(shoot("clear.png", &["--env", "", "--transparent"]).1);
}

#[test]
fn turntables() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    shoot(
        folder.path(),
        &["-o", "turn.##.png", "-o", "turn.gif", "-o", "turn.apng", "--orbit", "4", "--fps", "10"],
    );
    let names = names(folder.path());
    let expected =
        ["a.obj", "turn.00.png", "turn.01.png", "turn.02.png", "turn.03.png", "turn.apng", "turn.gif"];
    assert_eq!(names, expected);
    let frame = |k: u32| image::open(folder.path().join(format!("turn.0{k}.png"))).unwrap().into_rgb8();
    let apart = |a: &image::RgbImage, b: &image::RgbImage| {
        let sum: u64 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        sum as f64 / a.as_raw().len() as f64
    };
    // A square pyramid looks the same after a quarter turn: the light rotates with the camera.
    assert!(apart(&frame(0), &frame(1)) < 6.0, "{}", apart(&frame(0), &frame(1)));
    let gif = fs::read(folder.path().join("turn.gif")).unwrap();
    assert!(gif.starts_with(b"GIF89a"));
    run(folder.path(), &["render", "a.obj", "-o", "a.gif"], 2);
}

#[test]
fn thumbnails_of_many_models_list_those_that_fail() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    fs::write(folder.path().join("broken.ply"), "ply\n").unwrap();
    says(
        &run(
            folder.path(),
            &["thumb", "a.obj", "broken.ply", &cornell(), "-o", "thumbs", "--size", "32", "--spp", "2"],
            3,
        ),
        "1 of 3 models failed:\n  broken.ply",
    );
    assert_eq!(names(&folder.path().join("thumbs")), ["a.png", "cornell-box.png"]);
    let picture = image::open(folder.path().join("thumbs/a.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (32, 32));
    run(folder.path(), &["thumb", "a.obj", "x/a.obj", "-o", "thumbs"], 2);
}

#[test]
fn thumbnails_never_overwrite_textures() {
    let folder = tempfile::tempdir().unwrap();
    pyramid(folder.path());
    let file = |name: &str| folder.path().join(name);
    let model = fs::read(file("a.obj")).unwrap();
    let textured =
        "mtllib q.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    fs::write(file("q.obj"), textured).unwrap();
    fs::write(file("q.mtl"), "newmtl m\nmap_Kd q.thumb.png\n").unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([200, 30, 30])).save(file("q.thumb.png")).unwrap();
    let texture = fs::read(file("q.thumb.png")).unwrap();
    fs::write(file("b.blend"), "BLENDER").unwrap();
    fs::write(file("b.thumb.png"), "a texture").unwrap();
    for words in [
        &["thumb", "a.obj", "--file", "./a.obj"][..],
        &["thumb", "q.obj"],
        &["thumb", "q.obj", "--force"],
        &["thumb", "q.obj", "--file", "q.mtl"],
        &["thumb", "b.blend"],
    ] {
        says(&run(folder.path(), &[words, &["--size", "16", "--spp", "1"]].concat(), 2), "--force");
    }
    assert_eq!(fs::read(file("a.obj")).unwrap(), model);
    assert_eq!(fs::read(file("q.thumb.png")).unwrap(), texture);
    assert_eq!(fs::read_to_string(file("b.thumb.png")).unwrap(), "a texture");
    run(folder.path(), &["thumb", "q.obj", "-o", "small", "--size", "16", "--spp", "1"], 0);
    // Other pictures are overwritten.
    for _ in 0..2 {
        run(folder.path(), &["thumb", "a.obj", "--size", "16", "--spp", "1"], 0);
    }
}

//! AOVs: requested by options, scene files and models, and what files then contain.

use crate::program::*;
use oscura::film::Aov;
use std::fs;
use std::path::Path;

/// The planes of an EXR.
const LIGHTS: &str = r#"
[camera]
look_from = [0, 1, 4]
look_at = [0, 0.5, 0]
vfov = 40

[render]
width = 24
height = 16
samples = 4
aovs = ["material_id", "emission"]

[environment]
background = [0.1, 0.2, 0.3]
group = "sky"

[materials.floor]
type = "lambert"

[materials.neon]
type = "emissive"
radiance = [3, 1, 1]
light_group = "neon"

[[objects]]
name = "floor"
material = "floor"
quad = { corner = [-3, 0, 3], u = [6, 0, 0], v = [0, 0, -6] }

[[objects]]
name = "tube"
material = "neon"
sphere = { center = [0, 0.8, 0], radius = 0.3 }

[[lights]]
name = "key"
group = "key"
point = { position = [2, 2, 1], power = 100 }

[[lights]]
name = "rest"
point = { position = [-2, 2, 1], power = 20 }
"#;

#[test]
fn help_lists_aovs_with_their_channels() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(folder.path(), &["render", "--aov", "help"], 0);
    let table = stdout(&output);
    for aov in Aov::ALL {
        let info = aov.info();
        let layer = info.names[0].split('.').next().expect("a name");
        let line = table.lines().find(|line| line.split(' ').next() == Some(info.option));
        assert!(line.is_some_and(|line| line.contains(layer)), "{}: {line:?}", info.option);
        assert!(table.contains(info.about), "{}", info.option);
    }
}

#[test]
fn all_and_deprecated_aov_names() {
    let folder = tempfile::tempdir().unwrap();
    let names = |list: &str| -> Vec<String> {
        render(folder.path(), "a.exr", &["--quiet", "--aov", list]);
        planes(&folder.path().join("a.exr")).into_keys().collect()
    };
    let listed: Vec<&str> = Aov::ALL.iter().map(|aov| aov.info().option).collect();
    assert_eq!(names("all"), names(&listed.join(",")));
    assert_eq!(names("nearest,material"), names("depth_min,material_id"));
}

#[test]
fn scene_files_request_aovs_and_name_light_groups() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    fs::write(folder.path().join("a.toml"), LIGHTS).unwrap();
    let shoot = |more: &[&str]| {
        let fixed = ["render", "a.toml", "-o", "a.exr", "--float", "--quiet"];
        run(folder.path(), &[&fixed[..], more].concat(), 0);
        planes(&path)
    };
    let plain = shoot(&[]);
    assert!(plain.contains_key("material.id") && plain.contains_key("Emit.R"), "{:?}", plain.keys());
    assert!(!plain.contains_key("Z") && !plain.keys().any(|name| name.starts_with("RGBA_")));

    let grouped = shoot(&["--aov", "depth", "--light-groups"]);
    assert!(grouped.contains_key("Z") && grouped.contains_key("material.id"));
    let groups = ["default", "key", "neon", "sky"].map(|g| &grouped[&format!("RGBA_{g}.R")]);
    let listed = grouped.keys().filter(|name| name.starts_with("RGBA_")).count();
    assert_eq!(listed, 3 * groups.len());
    for (i, red) in grouped["R"].iter().enumerate() {
        let sum: f32 = groups.iter().map(|group| group[i]).sum();
        assert!((sum - red).abs() <= 1e-5 * red, "pixel {i}: {sum} for {red}");
    }
    for (group, red) in ["default", "key", "neon", "sky"].iter().zip(groups) {
        assert!(red.iter().any(|v| *v > 0.0), "{group} is black");
    }
    // A format that can't store them ignores the scene's request.
    run(folder.path(), &["render", "a.toml", "-o", "a.png", "--strict", "--quiet"], 0);
}

#[test]
fn unknown_names_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    for (from, to, message) in [
        (r#""emission""#, r#""emissions""#, "there is no AOV 'emissions'"),
        (r#"group = "key""#, r#"group = "k.y""#, "'k.y' is not a valid name of a light group"),
        (r#"aovs = ["material_id", "emission"]"#, "aovs = 3", "must be a list of names"),
    ] {
        fs::write(folder.path().join("a.toml"), LIGHTS.replace(from, to)).unwrap();
        let output = oscura(folder.path(), &["render", "a.toml", "-o", "a.exr"]);
        assert!(code(&output) == 2 || code(&output) == 3, "{to}");
        assert!(stderr(&output).contains(message), "{}", stderr(&output));
    }
}

#[test]
fn cryptomatte_levels() {
    let folder = tempfile::tempdir().unwrap();
    for (levels, layers) in [("1", 1), ("6", 3), ("9", 5)] {
        render(folder.path(), "a.exr", &["--quiet", "--aov", "crypto_object", "--crypto-levels", levels]);
        let names: Vec<String> = planes(&folder.path().join("a.exr")).into_keys().collect();
        let count = names.iter().filter(|name| name.starts_with("CryptoObject")).count();
        assert_eq!(count, 4 * layers, "{names:?}");
    }
    let key = oscura::film::matte_key("CryptoObject");
    let manifest = attribute(&folder.path().join("a.exr"), &format!("cryptomatte/{key}/manifest"));
    assert!(manifest.is_some(), "no manifest under {key}");
}

/// The environment is hidden from the camera, and its light stays.
#[test]
fn transparent_background_keeps_the_lighting() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), LIGHTS).unwrap();
    let shoot = |more: &[&str]| {
        let fixed = ["render", "a.toml", "-o", "a.exr", "--float", "--quiet", "--aov", "all"];
        run(folder.path(), &[&fixed[..], more].concat(), 0);
        planes(&folder.path().join("a.exr"))
    };
    let (seen, hidden) = (shoot(&[]), shoot(&["--transparent"]));
    let (mut clear, mut solid) = (0, 0);
    for i in 0..seen["R"].len() {
        assert_eq!(seen["A"][i], 1.0);
        if hidden["A"][i] == 0.0 {
            clear += 1;
            assert!(hidden["R"][i] == 0.0 && seen["Env.R"][i] > 0.0);
        } else if hidden["A"][i] == 1.0 {
            solid += 1;
            assert_eq!(hidden["R"][i], seen["R"][i]);
        }
    }
    assert!(clear > 20 && solid > 100, "{clear} {solid}");
    assert!(hidden["Env.R"].iter().all(|v| *v == 0.0));
}

/// `extras` in glTF, of nodes with lights and of materials.
#[test]
fn gltf_extras_name_light_groups() {
    let folder = tempfile::tempdir().unwrap();
    let model = fs::read_to_string(cornell()).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&model).unwrap();
    let materials = json["materials"].as_array_mut().expect("materials");
    for material in materials.iter_mut().filter(|m| m.get("emissiveFactor").is_some()) {
        material["extras"] = serde_json::json!({ "light_group": "ceiling" });
    }
    json["extensionsUsed"] = serde_json::json!(["KHR_lights_punctual"]);
    json["extensions"] =
        serde_json::json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 50.0 }] } });
    let nodes = json["nodes"].as_array_mut().expect("nodes");
    let lamp = nodes.len();
    nodes.push(serde_json::json!({
        "translation": [0.0, 0.5, 0.5],
        "extras": { "light_group": "lamp" },
        "extensions": { "KHR_lights_punctual": { "light": 0 } },
    }));
    json["scenes"][0]["nodes"].as_array_mut().expect("roots").push(lamp.into());
    let source = Path::new(&cornell()).parent().expect("a folder").to_path_buf();
    for buffer in json["buffers"].as_array_mut().expect("buffers") {
        if let Some(uri) = buffer["uri"].as_str().filter(|uri| !uri.starts_with("data:")) {
            fs::copy(source.join(uri), folder.path().join(uri)).unwrap();
        }
    }
    fs::write(folder.path().join("a.gltf"), json.to_string()).unwrap();
    let fixed =
        ["render", "a.gltf", "-o", "a.exr", "--width", "16", "--spp", "2", "--quiet", "--light-groups"];
    run(folder.path(), &fixed, 0);
    let planes = planes(&folder.path().join("a.exr"));
    for group in ["ceiling", "lamp"] {
        assert!(planes[&format!("RGBA_{group}.G")].iter().any(|v| *v > 0.0), "{group}");
    }
}

/// Transparent glass requires a transparent background.
#[test]
fn transparent_glass_requires_a_transparent_background() {
    let folder = tempfile::tempdir().unwrap();
    let glass = "[materials.glass]\ntype = \"dielectric\"\n\n[[objects]]\nname = \"ball\"\nmaterial = \"glass\"\nsphere = { center = [0, 1.2, 1], radius = 0.6 }\n";
    fs::write(folder.path().join("a.toml"), format!("{LIGHTS}\n{glass}")).unwrap();
    let shoot = |more: &[&str]| {
        let fixed = ["render", "a.toml", "-o", "a.exr", "--float", "--quiet", "--depth", "8"];
        oscura(folder.path(), &[&fixed[..], more].concat())
    };
    let alphas = |more: &[&str]| {
        let output = shoot(more);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        planes(&folder.path().join("a.exr"))["A"].clone()
    };
    let opaque = alphas(&["--transparent"]);
    let clear = alphas(&["--transparent", "--transparent-glass"]);
    let cleared =
        opaque.iter().zip(&clear).filter(|(opaque, clear)| **opaque == 1.0 && **clear < 0.6).count();
    assert!(cleared > 5, "{cleared}");
    assert!(opaque.iter().zip(&clear).all(|(opaque, clear)| clear <= opaque && *clear >= 0.0));
    let output = shoot(&["--transparent-glass"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--background"), "{}", stderr(&output));
}

/// Passes of positions and directions state their space in the header, also after merging; others don't.
#[test]
fn headers_name_the_space_of_passes() {
    let folder = tempfile::tempdir().unwrap();
    let space = |name: &str| attribute(&folder.path().join(name), "aovSpace");
    render(folder.path(), "a.exr", &["--quiet", "--aov", "normal"]);
    assert_eq!(space("a.exr"), text("world"));
    render(folder.path(), "a.exr", &["--quiet", "--aov", "albedo"]);
    assert_eq!(space("a.exr"), None);
    render(folder.path(), "a.part", &["--quiet", "--aov", "position", "--aov-space", "camera"]);
    run(folder.path(), &["merge", "a.part", "-o", "b.exr", "--quiet"], 0);
    assert_eq!(space("b.exr"), text("camera"));
    let refused = oscura(folder.path(), &["render", &cornell(), "-o", "a.exr", "--aov-space", "tangent"]);
    assert!(code(&refused) == 2 && stderr(&refused).contains("'tangent'"));
}

/// The world-to-screen matrix of the header maps visible points into the frame, also with overscan.
#[test]
fn headers_have_the_screen_matrix() {
    let folder = tempfile::tempdir().unwrap();
    for more in [&[][..], &["--overscan", "25"], &["--crop", "10,5,30,25"]] {
        let fixed = ["--quiet", "--filter", "box", "--aov", "position,depth"];
        render(folder.path(), "a.exr", &[&fixed[..], more].concat());
        let path = folder.path().join("a.exr");
        let meta = exr::meta::MetaData::read_from_file(&path, true).expect("our own file is valid");
        let (shared, own) = (&meta.headers[0].shared_attributes, &meta.headers[0].own_attributes);
        let m = own.world_to_normalized_device.expect("the attribute");
        let frame = shared.display_window.size;
        let (width, x0, y0) = (meta.headers[0].layer_size.0, own.layer_position.0, own.layer_position.1);
        let planes = planes(&path);
        let mut seen = 0;
        for (i, depth) in planes["Z"].iter().enumerate().filter(|(_, depth)| **depth < 1e9) {
            let p = ["P.X", "P.Y", "P.Z"].map(|name| planes[name][i]);
            // Row vectors.
            let row = |c: usize| p[0] * m[c] + p[1] * m[4 + c] + p[2] * m[8 + c] + m[12 + c];
            let at = [row(0) / row(3) * frame.0 as f32, row(1) / row(3) * frame.1 as f32];
            let expected = [(i % width) as f32 + x0 as f32 + 0.5, (i / width) as f32 + y0 as f32 + 0.5];
            let off = (at[0] - expected[0]).abs().max((at[1] - expected[1]).abs());
            assert!(off <= 0.51, "{more:?}: {at:?} for {expected:?} at depth {depth}");
            seen += 1;
        }
        assert!(seen > 100, "{more:?}: {seen}");
    }
}

/// The pixel aspect ratio is in the header, also of merged parts.
#[test]
fn pixel_aspect_ratio() {
    let folder = tempfile::tempdir().unwrap();
    let scene =
        LIGHTS.replace("vfov = 40", "vfov = 40\npixel_aspect = 1.5").replace("width = 24\nheight = 16\n", "");
    fs::write(folder.path().join("wide.toml"), scene).unwrap();
    let run = |args: &[&str]| run(folder.path(), args, 0);
    let shared = |name: &str| {
        let meta = exr::meta::MetaData::read_from_file(folder.path().join(name), true).expect("an EXR");
        meta.headers[0].shared_attributes.clone()
    };
    // A 16:9 frame with a pixel aspect ratio of 1.5.
    let fixed = ["--quiet", "--height", "90", "--filter", "box", "--spp", "1", "--aov", "position,depth"];
    run(&[&["render", "wide.toml", "-o", "wide.exr"], &fixed[..]].concat());
    let window = shared("wide.exr").display_window.size;
    assert_eq!((window.0, window.1, shared("wide.exr").pixel_aspect), (107, 90, 1.5));
    // Depth and height give the row and column of a point: the camera is at height 1, aimed at (0, 0.5, 0).
    let planes = planes(&folder.path().join("wide.exr"));
    let half = 20f32.to_radians().tan();
    let (ahead, up) = (
        [0.0, -0.5, -4.0].map(|v: f32| v / 16.25f32.sqrt()),
        [0.0, 4.0, -0.5].map(|v: f32| v / 16.25f32.sqrt()),
    );
    let mut seen = 0;
    for (i, depth) in planes["Z"].iter().enumerate().filter(|(_, depth)| **depth < 1e9) {
        let from = [planes["P.X"][i], planes["P.Y"][i] - 1.0, planes["P.Z"][i] - 4.0];
        let along = |axis: [f32; 3]| (0..3).map(|c| from[c] * axis[c]).sum::<f32>();
        assert!((along(ahead) - depth).abs() < 1e-3);
        let pixel = depth * half / 45.0;
        let at = [from[0] / (1.5 * pixel) + 53.5, 45.0 - along(up) / pixel];
        let off = (at[0] - (i % 107) as f32 - 0.5).abs().max((at[1] - (i / 107) as f32 - 0.5).abs());
        assert!(off <= 0.51, "{at:?} in pixel {} {}", i % 107, i / 107);
        seen += 1;
    }
    assert!(seen > 100, "{seen}");
    run(&[&["render", "wide.toml", "-o", "wide.part"], &fixed[..]].concat());
    run(&["merge", "wide.part", "-o", "merged.exr", "--quiet"]);
    assert_eq!(shared("merged.exr").pixel_aspect, 1.5);
    assert_eq!(shared("merged.exr").display_window.size, window);
    let reported = run(&["inspect", "wide.toml"]);
    assert!(stdout(&reported).contains("1.5"), "{}", stdout(&reported));
}

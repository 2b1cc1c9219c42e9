//! Gaussian splats: `KHR_gaussian_splatting`.

use super::asset::load_with;
use flate2::Compression;
use flate2::write::GzEncoder;
use oscura::scene::Splats;
use serde_json::{Map, Value, json};
use std::io::Write;

/// Two splats with spherical harmonics of a degree, a mesh of points, rotated by half a turn about z; `change` may damage the
/// asset.
fn asset(degree: usize, change: impl FnOnce(&mut Value)) -> (Value, Vec<u8>) {
    let mut lists: Vec<(String, &str, Vec<f32>)> = vec![
        ("POSITION".into(), "VEC3", vec![1.0, 2.0, 3.0, -1.0, 0.0, 0.5]),
        (own("ROTATION"), "VEC4", vec![0.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0]),
        (own("SCALE"), "VEC3", vec![0.1, 0.2, 0.3, 1.0, 1.0, 0.5]),
        (own("OPACITY"), "SCALAR", vec![0.25, 1.0]),
    ];
    for (l, n) in (0..=degree).flat_map(|l| (0..2 * l + 1).map(move |n| (l, n))) {
        let value = (l * 10 + n) as f32 * 0.01;
        lists.push((
            own(&format!("SH_DEGREE_{l}_COEF_{n}")),
            "VEC3",
            vec![value, 0.5, 0.0, value, 0.25, 1.0],
        ));
    }
    let (mut bytes, mut views, mut accessors, mut attributes) = (Vec::new(), vec![], vec![], Map::new());
    for (name, kind, numbers) in &lists {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": numbers.len() * 4}));
        accessors
            .push(json!({"bufferView": views.len() - 1, "componentType": 5126, "count": 2, "type": kind}));
        attributes.insert(name.clone(), json!(accessors.len() - 1));
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    }
    let extension = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
    let mut asset = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "extensionsRequired": ["KHR_gaussian_splatting"],
        "buffers": [{"uri": "a.bin", "byteLength": bytes.len()}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [
            {"mode": 0, "attributes": attributes, "extensions": {"KHR_gaussian_splatting": extension}}
        ]}],
        "nodes": [{"name": "cloud", "mesh": 0, "rotation": [0, 0, 1, 0]}],
        "scenes": [{"nodes": [0]}],
        "scene": 0
    });
    change(&mut asset);
    (asset, bytes)
}

fn own(name: &str) -> String {
    format!("KHR_gaussian_splatting:{name}")
}

#[test]
fn splats_load_from_points() {
    for degree in 0..=3 {
        let (asset, bytes) = asset(degree, |_| ());
        let loaded = load_with(&asset, &[("a.bin", &bytes)]).expect("it loads");
        let scene = &loaded.scene;
        assert_eq!((scene.meshes.len(), scene.instances.len(), scene.shapes.len()), (1, 1, 0));
        assert!(!loaded.warnings.iter().any(|w| w.message.contains("splat")), "{:?}", loaded.warnings);
        let splats: &Splats = scene.meshes[0].splats.as_ref().expect("splats");
        assert_eq!((usize::from(splats.degree), splats.is_linear), (degree, false));
        assert_eq!(scene.meshes[0].positions, [[1.0, 2.0, 3.0], [-1.0, 0.0, 0.5]]);
        assert_eq!(splats.scales, [[0.1, 0.2, 0.3], [1.0, 1.0, 0.5]]);
        assert_eq!(splats.rotations, [[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]]);
        assert_eq!(splats.opacities, [0.25, 1.0]);
        let last = splats.coefficients[splats.coefficients.len() - 1].map(|c| c.to_f32());
        let value = (degree * 10 + 2 * degree) as f32 * 0.01;
        assert!((last[0] - value).abs() < 1e-3 && last[1..] == [0.25, 1.0], "{last:?}");
    }
}

#[test]
fn kernels_and_errors_of_splats_are_reported() {
    let messages = |change: &dyn Fn(&mut Value)| {
        let (asset, bytes) = asset(1, change);
        let loaded = load_with(&asset, &[("a.bin", &bytes)]).expect("it loads");
        let words: Vec<String> = loaded.warnings.iter().map(|w| w.message.clone()).collect();
        (words.join("; "), loaded.scene)
    };
    let extension =
        |a: &mut Value| a["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"].take();
    let (words, scene) = messages(&|a| {
        a["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"] =
            json!({"kernel": "cube", "colorSpace": "lin_rec709_display"});
    });
    assert!(words.contains("'cube'"), "{words}");
    assert!(scene.meshes[0].splats.as_ref().is_some_and(|s| s.is_linear));
    let (words, scene) = messages(&|a| {
        let _ = extension(a);
        a["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"] =
            json!({"extensions": {"EXT_other": {}}});
    });
    assert!(words.contains("EXT_other") && scene.meshes.is_empty(), "{words}");
    let (words, scene) = messages(&|a| {
        let attributes = a["meshes"][0]["primitives"][0]["attributes"].as_object_mut().expect("attributes");
        attributes.remove("KHR_gaussian_splatting:OPACITY");
    });
    assert!(words.contains("OPACITY") && scene.meshes.is_empty(), "{words}");
    // An incomplete degree is dropped.
    let (_, scene) = messages(&|a| {
        let attributes = a["meshes"][0]["primitives"][0]["attributes"].as_object_mut().expect("attributes");
        attributes.remove("KHR_gaussian_splatting:SH_DEGREE_1_COEF_2");
    });
    assert_eq!(scene.meshes[0].splats.as_ref().map(|s| s.degree), Some(0));
}

/// Two splats as SPZ of version 2 or 3, packed, with harmonics of degree 1: at (1, -0.5, 2) and at (-1, 0.5, -2).
fn spz(version: u8) -> Vec<u8> {
    let mut bytes = b"NGSP".to_vec();
    bytes.extend([version, 0, 0, 0, 2, 0, 0, 0, 1, 12, 0, 0]);
    for place in [4096i32, -2048, 8192, -4096, 2048, -8192] {
        bytes.extend(&place.to_le_bytes()[..3]);
    }
    bytes.extend([204, 255]);
    bytes.extend([255, 0, 128, 0, 255, 128]);
    bytes.extend([160, 144, 128, 160, 144, 128]);
    // Identity rotation: 3 bytes of x, y and z, or the index of the largest component and three zeros.
    let turn: &[u8] = if version == 2 { &[127, 128, 128] } else { &[0, 0, 0, 192] };
    bytes.extend([turn, turn].concat());
    bytes.extend([128, 0, 255, 192, 128, 64, 128, 128, 128]);
    bytes.extend([128; 9]);
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&bytes).and_then(|()| encoder.finish()).expect("packed")
}

/// Points whose data is SPZ in the first buffer view, by extensions of the primitive.
fn packed(spz: &[u8], extensions: &Value) -> Value {
    let kinds = [("POSITION".to_string(), "VEC3"), (own("ROTATION"), "VEC4"), (own("SCALE"), "VEC3")];
    let accessors: Vec<Value> =
        kinds.iter().map(|(_, kind)| json!({"componentType": 5126, "count": 2, "type": kind})).collect();
    let attributes: Map<String, Value> =
        kinds.iter().enumerate().map(|(i, (name, _))| (name.clone(), json!(i))).collect();
    json!({
        "asset": {"version": "2.0"},
        "extensionsRequired": ["KHR_gaussian_splatting", "KHR_gaussian_splatting_compression_spz_2"],
        "buffers": [{"uri": "a.bin", "byteLength": spz.len()}],
        "bufferViews": [{"buffer": 0, "byteLength": spz.len()}],
        "accessors": accessors,
        "meshes": [{"primitives": [{"mode": 0, "attributes": attributes, "extensions": extensions}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}]
    })
}

#[test]
fn splats_are_unpacked_from_spz() {
    let inner = |name: &str| json!({"KHR_gaussian_splatting": {"extensions": {name: {"bufferView": 0}}}});
    let kinds = [
        inner("KHR_gaussian_splatting_compression_spz_2"),
        inner("KHR_gaussian_splatting_compression_spz"),
        json!({"KHR_spz_gaussian_splats_compression": {"bufferView": 0}}),
    ];
    for (version, extensions) in [2, 3].iter().flat_map(|v| kinds.iter().map(move |k| (*v, k))) {
        let bytes = spz(version);
        let loaded = load_with(&packed(&bytes, extensions), &[("a.bin", &bytes)]);
        let loaded = loaded.unwrap_or_else(|e| panic!("{extensions}: {e}"));
        // The stage has its own messages, depending on the splats it frames.
        let of_file = |w: &&oscura::error::Warning| !w.place.is_empty();
        assert_eq!(loaded.warnings.iter().find(of_file).map(ToString::to_string), None, "{extensions}");
        let mesh = &loaded.scene.meshes[0];
        assert_eq!(mesh.positions, [[1.0, -0.5, 2.0], [-1.0, 0.5, -2.0]], "{extensions}");
        let splats: &Splats = mesh.splats.as_ref().expect("splats");
        assert_eq!((splats.degree, &splats.opacities[..]), (1, &[0.8, 1.0][..]));
        assert!(splats.rotations[0][3].abs() > 0.9999, "{:?}", splats.rotations);
        let first = splats.coefficients[1].map(|c| c.to_f32());
        assert_eq!((first[0], first[1]), (0.0, -1.0), "{first:?}");
    }
}

#[test]
fn damaged_spz_is_reported_with_its_location() {
    let whole = spz(3);
    let extensions = &json!({"KHR_gaussian_splatting": {"extensions":
        {"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}}}});
    let refusal = |bytes: &[u8], view: usize| {
        let mut asset = packed(bytes, extensions);
        let inner = "/meshes/0/primitives/0/extensions/KHR_gaussian_splatting/extensions";
        asset.pointer_mut(inner).expect("it has one")["KHR_gaussian_splatting_compression_spz_2"]["bufferView"] =
            json!(view);
        load_with(&asset, &[("a.bin", bytes)]).expect_err("it is refused").to_string()
    };
    assert!(refusal(b"NGSP", 0).contains("/meshes/0/primitives/0"), "{}", refusal(b"NGSP", 0));
    assert!(refusal(&whole[..whole.len() - 12], 0).contains("gzip"));
    assert!(refusal(&whole, 7).contains("bufferViews"), "{}", refusal(&whole, 7));
}

//! Photometric profiles (IES LM-63), in scene files and by EXT_lights_ies in glTF.

use crate::files::load_files;
use crate::gltf::asset::{triangle_bytes, triangle_with};
use oscura::error::Error;
use oscura::load::Loaded;
use oscura::math::{DQuat, DVec3};
use oscura::scene::{Light, LightKind};
use serde_json::{Value, json};
use std::sync::Arc;

/// 1366 candela in the lower hemisphere, which is 2 W/sr; nothing above.
const HALF: &str = "IESNA:LM-63-1995\nTILT=NONE\n1 1 1 2 1 1 2 0 0 0 1 1 1\n0 90\n0\n1366 1366\n";

fn with_files(name: &str, content: &str, ies: &str, more: &[(&str, &[u8])]) -> Result<Loaded, Error> {
    let files = [(name, content.as_bytes()), ("lamp.ies", ies.as_bytes())];
    load_files(&[&files[..], more].concat())
}

fn lit(light: &str, ies: &str) -> Result<Loaded, Error> {
    let text = format!(
        "camera = {{ look_from = [0, 0, 5], look_at = [0, 0, 0] }}\nmaterials.a = {{ type = \"lambert\" }}\n\
         [[objects]]\nsphere = {{ center = [0, 0, 0], radius = 1 }}\nmaterial = \"a\"\n[[lights]]\n{light}\n"
    );
    with_files("scene.toml", &text, ies, &[])
}

fn light(text: &str) -> Light {
    lit(text, HALF).unwrap_or_else(|e| panic!("{e}")).scene.lights.remove(0)
}

/// Position, axis and direction of horizontal angle 0 of a light with a profile.
fn placed(light: &Light) -> (DVec3, DVec3, DVec3, Option<[f64; 2]>) {
    let LightKind::Profiled { position, rotation, cone } = light.kind else { panic!("{light:?}") };
    (position, rotation * DVec3::NEG_Z, rotation * DVec3::X, cone)
}

#[test]
fn profiles_of_point_and_spot_lights() {
    let own = light("point = { position = [1, 2, 3], ies = \"lamp.ies\" }\ncolor = [1, 0.5, 0]");
    assert!((own.intensity[0] - 2.0).abs() < 1e-6 && (own.intensity[1] - 1.0).abs() < 1e-6);
    let profile = own.profile.as_ref().expect("a profile");
    assert_eq!([0.0, 89.0, 91.0].map(|v| profile.at(v, 0.0)), [1.0, 1.0, 0.0]);
    let (position, way, zero, cone) = placed(&own);
    assert!(position == DVec3::new(1.0, 2.0, 3.0) && cone.is_none());
    assert!((way - DVec3::NEG_Y).length() < 1e-12 && (zero - DVec3::X).length() < 1e-12);
    let by = |keys: &str| light(&format!("point = {{ position = [0, 4, 0], ies = \"lamp.ies\", {keys} }}"));
    assert_eq!(by("intensity = 7").intensity, [7.0; 3]);
    // Half of the directions.
    assert!((by("power = 6.2831853").intensity[0] - 1.0).abs() < 1e-3);
    // Seen from above, x turns towards -z.
    let (_, _, zero, _) = placed(&by("turn = 90"));
    assert!((zero - DVec3::NEG_Z).length() < 1e-9, "{zero}");
    assert!((by("strength = 3").intensity[0] - 6.0).abs() < 1e-5);
    assert_eq!(by("clockwise = true").profile, Some(Arc::new((**profile).clone().mirrored())));
    let (_, way, _, _) = placed(&by("target = [4, 4, 0]"));
    assert!((way - DVec3::X).length() < 1e-12);
    let spot = light(
        "spot = { position = [0, 4, 0], direction = [0, 0, 2], angle = 60, blend = 1, ies = \"lamp.ies\" }",
    );
    let (_, way, _, cone) = placed(&spot);
    let [inner, outer] = cone.expect("a cone");
    assert!((way - DVec3::Z).length() < 1e-12 && inner < 1e-3 && (outer.to_degrees() - 30.0).abs() < 1e-9);
}

#[test]
fn damaged_profiles_are_reported_with_their_light() {
    let point = "point = { position = [0, 4, 0], ies = \"lamp.ies\" }";
    for (light, ies, words) in [
        (point, "nothing", "'TILT='"),
        (point, &HALF[..HALF.len() - 6], "ends too early"),
        (point, &HALF.replace("1 2 0", "2 2 0"), "type 2"),
        ("point = { position = [0, 4, 0], ies = \"other.ies\" }", HALF, "other.ies: can't be read"),
        ("point = { position = [0, 4, 0], ies = \"lamp.ies\", strength = 2, power = 1 }", HALF, "'strength'"),
        ("point = { position = [0, 4, 0], ies = \"lamp.ies\", power = 1, intensity = 1 }", HALF, "exclude"),
        ("point = { position = [0, 4, 0], ies = \"lamp.ies\", direction = [0, 0, 0] }", HALF, "no direction"),
        ("spot = { position = [0, 4, 0], ies = \"lamp.ies\" }", HALF, "'target' or 'direction'"),
        ("point = { position = [0, 4, 0], ies = 3 }", HALF, "'ies'"),
    ] {
        let message = lit(light, ies).expect_err(words).to_string();
        assert!(message.contains(words) && message.contains("line "), "'{words}' is not in: {message}");
    }
}

fn lamps(extension: Value, node: Value) -> Value {
    triangle_with(|a| {
        a["extensions"] = json!({"EXT_lights_ies": {"lights": [extension]}});
        a["nodes"][0]["extensions"] = json!({"EXT_lights_ies": node});
        a["nodes"][0]["translation"] = json!([1, 2, 3]);
        // -z is rotated to -y.
        a["nodes"][0]["rotation"] = json!(DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2).to_array());
    })
}

fn load_lamps(asset: &Value) -> Result<Loaded, Error> {
    let mut bytes = triangle_bytes();
    bytes.extend(HALF.as_bytes());
    with_files("a.gltf", &asset.to_string(), HALF, &[("a.bin", &bytes)])
}

#[test]
fn gltf_lights_with_profiles() {
    let mut in_buffer = lamps(
        json!({"bufferView": 2, "mimeType": "application/x-ies-lm-63"}),
        json!({"light": 0, "multiplier": 0.5, "color": [1, 0.5, 7]}),
    );
    in_buffer["buffers"][0]["byteLength"] = json!(44 + HALF.len());
    in_buffer["bufferViews"]
        .as_array_mut()
        .expect("a list")
        .push(json!({"buffer": 0, "byteOffset": 44, "byteLength": HALF.len()}));
    let in_file = lamps(json!({"uri": "lamp.ies"}), json!({"light": 0}));
    for (asset, intensity) in [(in_buffer, [1.0, 0.5, 1.0]), (in_file, [2.0; 3])] {
        let loaded = load_lamps(&asset).unwrap_or_else(|e| panic!("{e}"));
        assert!(!loaded.warnings.iter().any(|w| w.message.contains("EXT_lights_ies")));
        let light = &loaded.scene.lights[0];
        assert!(light.intensity.iter().zip(intensity).all(|(a, b)| (a - b).abs() < 1e-6), "{light:?}");
        assert_eq!(light.profile.as_ref().expect("a profile").peak(), 1.0);
        let (position, way, zero, _) = placed(light);
        assert_eq!(position, DVec3::new(1.0, 2.0, 3.0));
        assert!((way - DVec3::NEG_Y).length() < 1e-9 && (zero - DVec3::X).length() < 1e-9);
    }
}

/// A single problem: other keys of the light stay known.
#[test]
fn damaged_profile_is_the_only_problem() {
    let point = "point = { position = [1, 2, 3], ies = \"lamp.ies\", power = 5 }";
    let message = lit(point, "IESNA:LM-63-1995\n").expect_err("no profile").to_string();
    assert!(message.contains("lamp.ies") && !message.contains("power"), "{message}");
}

#[test]
fn invalid_gltf_profiles_are_reported() {
    let file = json!({"uri": "lamp.ies"});
    for (asset, words) in [
        (lamps(file.clone(), json!({})), "EXT_lights_ies/light: is missing"),
        (lamps(file.clone(), json!({"light": 3})), "there are 1"),
        (lamps(file.clone(), json!({"light": 0, "multiplier": -1})), "negative"),
        (lamps(file, json!({"light": 0, "color": [1]})), "EXT_lights_ies/color"),
        (lamps(json!({}), json!({"light": 0})), "neither a uri nor a bufferView"),
        (lamps(json!({"uri": "none.ies"}), json!({"light": 0})), "is missing"),
        (lamps(json!({"uri": "a.bin"}), json!({"light": 0})), "TILT="),
    ] {
        let asset = if words == "TILT=" { without_text(asset) } else { asset };
        let message = load_lamps(&asset).expect_err(words).to_string();
        assert!(message.contains(words), "'{words}' is not in: {message}");
    }
}

/// The binary file of the triangle is not a profile.
fn without_text(mut asset: Value) -> Value {
    asset["extensions"]["EXT_lights_ies"]["lights"][0] = json!({"bufferView": 0});
    asset
}

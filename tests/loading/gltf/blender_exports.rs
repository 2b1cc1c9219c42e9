//! Losses of Blender's own exporter: reported by name, and restored by sidecars.

use super::asset::{load_by, triangle_bytes, triangle_with};
use oscura::load::{BlenderExport, LoadOptions, Loaded};
use oscura::math::DVec3;
use oscura::scene::{AlphaMode, Model};
use serde_json::{Value, json};

const BLENDER: &str = "Khronos glTF Blender I/O v5.0.21";

/// A TGA image of two pixels with alpha 255 and `alpha`, as a data URI.
fn picture(alpha: u8) -> String {
    use base64::Engine;
    let mut bytes = vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 32, 8];
    bytes.extend([10, 20, 30, 255, 40, 50, 60, alpha]);
    format!("data:image/x-tga;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// A room as Blender exports it: objects with a white, a lost, a foliage and an ordinary material, two lights, a camera.
fn room(generator: &str, alpha: u8) -> Value {
    triangle_with(|a| {
        a["asset"]["generator"] = json!(generator);
        a["materials"] = json!([
            {"name": "Wood", "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.5}},
            {"name": "Fog.001"},
            {"name": "Leaf", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}},
            {"name": "Plain", "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.8, 0.8, 1], "metallicFactor": 0}},
            {"name": "Pane", "pbrMetallicRoughness": {"metallicFactor": 0},
             "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}},
            {"name": "Polish", "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.8, 0.8, 1]}},
            {"name": "Neon", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}, "emissiveFactor": [1, 0, 0]}
        ]);
        a["textures"] = json!([{"source": 0}]);
        a["images"] = json!([{"uri": picture(alpha)}]);
        let primitive = a["meshes"][0]["primitives"][0].clone();
        let with = |material: usize| {
            let mut primitive = primitive.clone();
            primitive["material"] = json!(material);
            json!({"primitives": [primitive]})
        };
        a["meshes"] = json!((0..7).map(with).collect::<Vec<_>>());
        a["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}]);
        // The fog's triangle is rotated and scaled so that its bounding box contains the camera.
        a["nodes"] = json!([
            {"name": "Table", "mesh": 0},
            {"name": "Fog", "mesh": 1, "scale": [20, 20, 20], "translation": [-5, -5, -5],
             "rotation": [0.5, 0.5, 0.1, 0.7]},
            {"name": "Tree", "mesh": 2}, {"name": "Floor", "mesh": 3}, {"name": "Window", "mesh": 4},
            {"name": "Area.001", "translation": [0, 3, 0]},
            {"name": "Key", "translation": [1, 2, 0]},
            {"name": "Lamp rig", "children": [8]}, {"name": "Target"},
            {"name": "Camera", "camera": 0, "translation": [0, 0, 1]},
            {"name": "Door", "mesh": 5}, {"name": "Sign", "mesh": 6}
        ]);
        a["scenes"] = json!([{"nodes": [0, 1, 2, 3, 4, 5, 6, 7, 9, 10, 11]}]);
    })
}

fn load(asset: &Value, sidecar: Option<&str>) -> Loaded {
    let (bytes, beside) = (triangle_bytes(), sidecar.unwrap_or_default().as_bytes());
    let mut files: Vec<(&str, &[u8])> = vec![("a.bin", &bytes)];
    files.extend(sidecar.map(|_| ("a.oscura.toml", beside)));
    load_by(asset, &files, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn losses_are_reported_by_name() {
    let loaded = load(&room(BLENDER, 128), None);
    let BlenderExport { lights, white, rough_metal, lost, unused_alpha, .. } =
        loaded.blender.clone().expect("by Blender");
    assert_eq!((lights, white), (vec!["Area.001".into(), "Key".into()], vec!["Wood".to_string()]));
    assert_eq!(rough_metal, ["Polish"]);
    assert_eq!((lost, unused_alpha), (vec!["Fog.001".into()], vec!["Leaf".to_string()]));
    let warned: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    for words in [
        "nodes 'Area.001', 'Key' without contents may have been area lights",
        "material 'Wood': pure white without a texture",
        "material 'Polish': metal of roughness 1 without a texture",
        "material 'Leaf': the image of the base colour has alpha",
        "material 'Fog.001': has no pbrMetallicRoughness",
        "object 'Fog' with a lost material encloses the camera 'Camera'",
    ] {
        assert!(warned.iter().any(|w| w.contains(words)), "'{words}' is not in {warned:#?}");
    }
    assert_eq!(loaded.notes.iter().filter(|n| n.code == "blender-exporter-limits").count(), 1);
    // Files of other exporters are not checked for Blender's losses.
    let other = load(&room("other", 128), None);
    assert!(other.blender.is_none() && !other.warnings.iter().any(|w| w.code == "lost-color"));
    assert!(!other.notes.iter().any(|n| n.code == "blender-exporter-limits"));
    // Constant alpha of 1 is no loss.
    let opaque = load(&room(BLENDER, 255), None).blender.expect("by Blender");
    assert!(opaque.unused_alpha.is_empty());
}

#[test]
fn sidecar_changes_materials_and_objects() {
    let toml = "[materials.Wood]\nbase_color = [0.3, 0.2, 0.1]\nroughness = 0.25\n\
                [materials.Leaf]\nalpha = \"mask\"\nclearcoat = 0.5\n\
                [materials.\"Fog.001\"]\ntype = \"lambert\"\ncolor = 0.1\n\
                [materials.Red]\ntype = \"lambert\"\ncolor = [0.9, 0, 0]\n\
                [objects.Fog]\nhidden = true\n[objects.Tree]\nmaterial = \"Red\"\n\
                [objects.Floor]\nmaterial = \"Wood\"\n";
    let loaded = load(&room(BLENDER, 128), Some(toml));
    assert!(!loaded.warnings.iter().any(|w| w.code == "lost-color"), "{:?}", loaded.warnings);
    let scene = &loaded.scene;
    let material = |name: &str| {
        let found = scene.materials.iter().enumerate().filter(|(_, m)| m.name == name).collect::<Vec<_>>();
        assert_eq!(found.len(), 1, "{name}");
        found[0]
    };
    let Model::Pbr(wood) = &material("Wood").1.model else { panic!("no glTF material") };
    assert_eq!((wood.base_color.factor, wood.roughness.factor), ([0.3, 0.2, 0.1], 0.25));
    assert_eq!(wood.metallic.factor, 0.0, "what is not named stays");
    let (_, leaf) = material("Leaf");
    let Model::Pbr(model) = &leaf.model else { panic!("no glTF material") };
    assert_eq!(leaf.alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(leaf.alpha.texture, model.base_color.texture.map(|t| (t, 3)));
    assert!(model.clearcoat.is_some_and(|c| c.factor.factor == 0.5));
    assert!(matches!(material("Fog.001").1.model, Model::Lambert { .. }));
    let of =
        |name: &str| scene.instances.iter().find(|i| i.name == name).map(|i| i.material.map(|m| m.index()));
    assert_eq!(of("Fog"), None);
    assert_eq!(of("Tree"), Some(Some(material("Red").0)));
    assert_eq!(of("Floor"), Some(Some(material("Wood").0)));
    assert_eq!(of("Table"), Some(None));

    // In `objects`, a node is referenced by a key.
    let toml = "[[objects]]\nnode = \"Fog\"\nhidden = true\n\
                [[objects]]\nsphere = { center = [0, 1, 0], radius = 0.1 }\nmaterial = \"Wood\"\n";
    let scene = load(&room(BLENDER, 128), Some(toml)).scene;
    assert!(scene.instances.iter().all(|i| i.name != "Fog"));
    assert_eq!(scene.materials[scene.shapes[0].material.index()].name, "Wood");
    assert_eq!(scene.shapes[0].center, DVec3::Y);
}

#[test]
fn misspelt_names_are_reported() {
    let fails = |toml: &str, words: &str| {
        let files: [(&str, &[u8]); 2] = [("a.bin", &triangle_bytes()), ("a.oscura.toml", toml.as_bytes())];
        let error =
            load_by(&room(BLENDER, 255), &files, &LoadOptions::default()).expect_err(words).to_string();
        assert!(error.contains(words), "'{words}' is not in: {error}");
    };
    fails("[objects.Tre]\nhidden = true\n", "the model has no object 'Tre' (did you mean 'Tree'?)");
    fails("[objects.Tree]\nhiden = true\n", "object 'Tree' has no key 'hiden' (did you mean 'hidden'?)");
    fails("[objects.Tree]\nmaterial = \"Wod\"\n", "there is no material 'Wod'");
    fails("[objects.Tree]\nmaterial = \"Wod\"\n", "did you mean 'Wood' of the model?");
    fails(
        "[materials.Wod]\nbase_color = 0.5\n",
        "there is no material 'Wod' (did you mean 'Wood' of the model?)",
    );
    fails("[materials.Marble]\nbase_color = 0.5\n", "material 'Marble' needs 'type'");
    fails("[materials.Wood]\nbase_colour = 1\n", "material 'Wood' has no key 'base_colour'");
    let warned = load(&room(BLENDER, 255), Some("[materials.Wod]\ntype = \"lambert\"\n")).warnings;
    let words = "the model has no material 'Wod' and no object uses it (did you mean 'Wood'?)";
    assert!(warned.iter().any(|w| w.message == words), "{warned:?}");
}

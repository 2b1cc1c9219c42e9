//! Load options: scenes, nodes, variants, light units, glass, required extensions.

use super::asset::{corners, load_by, triangle_bytes, triangle_with};
use oscura::load::gltf::{Glass, GltfOptions, LightUnits};
use oscura::load::{LoadOptions, Loaded};
use oscura::math::DVec3;
use oscura::scene::{LightKind, Model};
use serde_json::{Value, json};

fn load(asset: &Value, gltf: GltfOptions) -> Result<Loaded, oscura::error::Error> {
    load_by(asset, &[("a.bin", &triangle_bytes())], &LoadOptions { gltf, ..LoadOptions::default() })
}

#[test]
fn scenes_and_nodes_by_name_or_number() {
    let asset = triangle_with(|a| {
        a["nodes"] = json!([
            {"name": "a", "mesh": 0},
            {"name": "b", "translation": [1, 0, 0], "children": [2]},
            {"name": "c", "mesh": 0, "translation": [0, 1, 0]}
        ]);
        a["scenes"] = json!([{"name": "first", "nodes": [0]}, {"name": "second", "nodes": [1]}]);
    });
    let shown = |scene: Option<&str>, node: Option<&str>| {
        let options = GltfOptions {
            scene: scene.map(str::to_string),
            node: node.map(str::to_string),
            ..GltfOptions::default()
        };
        let loaded = load(&asset, options).map_err(|e| e.to_string())?;
        let placed = |i: &oscura::scene::Instance| (i.name.clone(), i.world_from_object.translation);
        Ok::<_, String>(loaded.scene.instances.iter().map(placed).collect::<Vec<_>>())
    };
    let c = DVec3::new(1.0, 1.0, 0.0);
    assert_eq!(shown(None, None), Ok(vec![("a".to_string(), DVec3::ZERO)]));
    assert_eq!(shown(Some("second"), None), Ok(vec![("b/c".to_string(), c)]));
    assert_eq!(shown(Some("1"), None), Ok(vec![("b/c".to_string(), c)]));
    // A node alone keeps its world transform.
    assert_eq!(shown(None, Some("c")), Ok(vec![("c".to_string(), c)]));
    for (scene, node, words) in [(Some("x"), None, "0 'first', 1 'second'"), (None, Some("x"), "2 'c'")] {
        let message = shown(scene, node).expect_err("there is none");
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn variants_replace_materials() {
    let asset = triangle_with(|a| {
        a["extensionsRequired"] = json!(["KHR_materials_variants"]);
        a["extensions"] =
            json!({"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}});
        a["materials"] = json!([{"name": "own"}, {"name": "dark"}]);
        a["meshes"][0]["primitives"][0]["extensions"] =
            json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}});
    });
    let shown = |variant: Option<&str>| {
        let options = GltfOptions { variant: variant.map(str::to_string), ..GltfOptions::default() };
        load(&asset, options).map(|l| l.scene.materials[0].name.clone()).map_err(|e| e.to_string())
    };
    assert_eq!(shown(None).as_deref(), Ok("own"));
    assert_eq!(shown(Some("day")).as_deref(), Ok("own"));
    assert_eq!(shown(Some("night")).as_deref(), Ok("dark"));
    assert_eq!(shown(Some("1")).as_deref(), Ok("dark"));
    assert!(shown(Some("dusk")).expect_err("there is none").contains("1 'night'"));
}

/// 100 W of a point light and 3 W/m2 of a sun, as Blender's three modes write them, are the same light.
#[test]
fn light_units() {
    let lights = |units: LightUnits, point: f64, sun: f64| {
        let asset = triangle_with(|a| {
            a["extensions"] = json!({"KHR_lights_punctual": {"lights": [
                {"type": "point", "intensity": point}, {"type": "directional", "intensity": sun}
            ]}});
            let light = |i: usize| json!({"KHR_lights_punctual": {"light": i}});
            a["nodes"] = json!([{"children": [1, 2]}, {"extensions": light(0)}, {"extensions": light(1)}]);
        });
        let loaded =
            load(&asset, GltfOptions { light_units: units, ..GltfOptions::default() }).expect("it loads");
        let lights = loaded.scene.lights;
        assert!(matches!(lights[0].kind, LightKind::Point { .. }));
        (lights[0].intensity[0], lights[1].intensity[0])
    };
    let watts_per_steradian = 100.0 / (4.0 * std::f64::consts::PI);
    for (units, point, sun) in [
        (LightUnits::Auto, watts_per_steradian * 683.0, 3.0 * 683.0),
        (LightUnits::Spec, watts_per_steradian * 683.0, 3.0 * 683.0),
        (LightUnits::Compat, watts_per_steradian, 3.0),
        (LightUnits::Raw, 100.0, 3.0),
    ] {
        let (found_point, found_sun) = lights(units, point, sun);
        assert!((found_point - watts_per_steradian as f32).abs() < 1e-5 && (found_sun - 3.0).abs() < 1e-6);
    }
}

/// Is it solid, and is its tint applied once for the whole path through it?
fn body(loaded: &Loaded) -> (bool, bool) {
    match &loaded.scene.materials[0].model {
        Model::Pbr(p) => (p.has_volume, p.tints_once),
        other => panic!("{other:?}"),
    }
}

#[test]
fn glass_without_a_volume() {
    let asset = |generator: &str, thickness: f64, is_closed: bool| {
        triangle_with(|a| {
            a["asset"]["generator"] = json!(generator);
            if is_closed {
                // A second triangle on the first: each edge belongs to two.
                let twin = a["meshes"][0]["primitives"][0].clone();
                a["meshes"][0]["primitives"].as_array_mut().expect("a list").push(twin);
            }
            a["materials"][0] = json!({"extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": thickness}
            }});
        })
    };
    let blender = "Khronos glTF Blender I/O v5.0.21";
    for (glass, generator, thickness, is_closed, solid) in [
        (Glass::Auto, "other", 0.0, true, false),
        (Glass::Auto, "other", 0.1, false, true),
        (Glass::Auto, blender, 0.0, true, true),
        // A pane of one sheet.
        (Glass::Auto, blender, 0.0, false, false),
        (Glass::Auto, blender, 0.1, false, true),
        (Glass::Solid, "other", 0.0, false, true),
        (Glass::Thin, blender, 0.0, true, false),
        // What the file declares is kept.
        (Glass::Thin, blender, 0.1, true, true),
    ] {
        let options = GltfOptions { glass, ..GltfOptions::default() };
        let loaded = load(&asset(generator, thickness, is_closed), options).expect("it loads");
        // A solid declared in the file is tinted as specified, at each interface.
        let tints_once = solid && thickness == 0.0;
        assert_eq!(body(&loaded), (solid, tints_once), "{glass:?} {generator} {thickness} {is_closed}");
        let guessed = glass == Glass::Auto && generator == blender && thickness == 0.0;
        assert_eq!(loaded.notes.iter().any(|w| w.message.contains("GltfOptions::glass")), guessed);
        assert!(loaded.warnings.iter().all(|w| !w.message.contains("GltfOptions::glass")));
    }
}

#[test]
fn materials_lost_by_blenders_exporter_are_diffuse() {
    let asset = |generator: &str| {
        triangle_with(|a| {
            a["asset"]["generator"] = json!(generator);
            a["materials"][0] = json!({"name": "mix of nodes"});
        })
    };
    let metallic = |generator: &str| {
        let loaded = load(&asset(generator), GltfOptions::default()).expect("it loads");
        let warned = loaded.warnings.iter().any(|w| w.message.contains("Principled"));
        match &loaded.scene.materials[0].model {
            Model::Pbr(p) => (p.metallic.factor, warned),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(metallic("Khronos glTF Blender I/O v5.0.21"), (0.0, true));
    assert_eq!(metallic("other"), (1.0, false));
}

#[test]
fn required_extensions_can_be_ignored() {
    let asset = triangle_with(|a| a["extensionsRequired"] = json!(["ACME_x"]));
    let message = load(&asset, GltfOptions::default()).expect_err("it is refused").to_string();
    assert!(message.contains("ACME_x") && message.contains("GltfOptions::force"), "{message}");
    let loaded = load(&asset, GltfOptions { force: true, ..GltfOptions::default() }).expect("it loads");
    assert!(loaded.warnings.iter().any(|w| w.message.contains("ACME_x")));
}

/// The triangles of a box at the origin, facing outwards.
fn box_bytes(size: [f32; 3]) -> Vec<u8> {
    let mut floats: Vec<f32> = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for is_far in [false, true] {
            let corner = |a: f32, b: f32| {
                let mut p = [0.0; 3];
                (p[axis], p[u], p[v]) = (f32::from(u8::from(is_far)) * size[axis], a * size[u], b * size[v]);
                p
            };
            let (b, d) = if is_far { ((1.0, 0.0), (0.0, 1.0)) } else { ((0.0, 1.0), (1.0, 0.0)) };
            let quad = [corner(0.0, 0.0), corner(b.0, b.1), corner(1.0, 1.0), corner(d.0, d.1)];
            floats.extend([0, 1, 2, 0, 2, 3].map(|i| quad[i]).as_flattened());
        }
    }
    floats.iter().flat_map(|f| f.to_le_bytes()).collect()
}

#[test]
fn flat_panes_become_thin_glass_on_request() {
    let scaled = |size: [f32; 3], scale: &[[f32; 3]], glass: Glass| {
        let bytes = box_bytes(size);
        let mut asset = corners(36, bytes.len());
        asset["nodes"] = scale.iter().map(|scale| json!({"mesh": 0, "scale": scale})).collect();
        asset["scenes"][0]["nodes"] = (0..scale.len()).collect();
        asset["nodes"]
            .as_array_mut()
            .expect("nodes")
            .push(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
        asset["scenes"][0]["nodes"].as_array_mut().expect("roots").push(json!(scale.len()));
        asset["extensions"] =
            json!({"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 1}]}});
        asset["accessors"][0]
            .as_object_mut()
            .expect("an object")
            .retain(|key, _| key != "min" && key != "max");
        asset["materials"] = json!([{
            "name": "window", "pbrMetallicRoughness": {"baseColorFactor": [0.9, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": 0},
            "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationColor": [1, 0.25, 1], "attenuationDistance": 0.04}
            }
        }]);
        asset["meshes"][0]["primitives"][0]["material"] = json!(0);
        let options =
            LoadOptions { gltf: GltfOptions { glass, ..GltfOptions::default() }, ..LoadOptions::default() };
        load_by(&asset, &[("a.bin", &bytes)], &options).unwrap_or_else(|e| panic!("{e}"))
    };
    let shown = |size: [f32; 3], glass: Glass| scaled(size, &[[1.0; 3]], glass);
    let pane = shown([1.0, 2.0, 0.02], Glass::Panes);
    let Model::Pbr(model) = &pane.scene.materials[0].model else { panic!("no glTF material") };
    assert!(!model.has_volume && model.attenuation_distance.is_infinite());
    // The tint of both interfaces, and the attenuation of half the distance.
    let [r, g, b] = model.base_color.factor;
    assert!((r - 0.81).abs() < 1e-5 && (g - 0.5).abs() < 1e-4 && b == 1.0, "{r} {g} {b}");
    assert_eq!((pane.scene.meshes[0].triangles.len(), pane.scene.meshes[0].parts[0].triangle_count), (2, 2));
    let messages = pane.notes.iter().find(|n| n.code == "glass-panes").expect("it is said");
    assert!(messages.message.contains("'window'") && messages.message.contains("0.020 m"), "{messages}");
    // Other solids stay, and panes stay without the option.
    for (size, glass) in [([1.0, 1.0, 0.5], Glass::Panes), ([1.0, 2.0, 0.02], Glass::Auto)] {
        let loaded = shown(size, glass);
        let Model::Pbr(model) = &loaded.scene.materials[0].model else { panic!("no glTF material") };
        assert!(model.has_volume && loaded.scene.meshes[0].triangles.len() == 12);
    }
    // A cube flattened by its node is a pane; instances as well, unless flattened along another axis.
    let (flat, thick) = ([2.0, 1.0, 0.02], [2.0, 1.0, 0.5]);
    for (scales, triangles) in [
        (&[flat][..], 2),
        (&[flat, [1.0, 1.0, -0.01]], 2),
        (&[thick], 12),
        (&[flat, thick], 12),
        (&[flat, [0.02, 1.0, 2.0]], 12),
    ] {
        let loaded = scaled([1.0; 3], scales, Glass::Panes);
        assert_eq!(loaded.scene.meshes[0].triangles.len(), triangles, "{scales:?}");
        let Model::Pbr(model) = &loaded.scene.materials[0].model else { panic!("no glTF material") };
        assert!(
            triangles == 12 || (model.base_color.factor[1] - 0.5).abs() < 1e-4,
            "{:?}",
            model.base_color.factor
        );
    }
}

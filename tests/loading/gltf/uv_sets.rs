//! Texture coordinate sets beyond the first.

use super::asset::{floats, load_with, triangle_with};
use super::materials::RED;
use oscura::load::Loaded;
use oscura::scene::{Mapping, Texture};
use serde_json::{Value, json};

/// A triangle with TEXCOORD_0 to TEXCOORD_3, each of which contains its own index, and two materials; `materials` gives the sets
/// of the base colour and of the emission of each, and of the normal map of the first.
fn load(materials: [[u32; 2]; 2], normal: u32) -> Loaded {
    let sets: Vec<f32> = (0..4).flat_map(|set| [set as f32; 6]).collect();
    let bytes = [floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]), floats(&sets)].concat();
    let texture = |set: u32| json!({"index": 0, "texCoord": set});
    let asset = triangle_with(|a| {
        let attributes =
            json!({"POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 2, "TEXCOORD_2": 3, "TEXCOORD_3": 4});
        let primitive = |material: usize| json!({"attributes": attributes, "material": material});
        a["meshes"][0]["primitives"] = json!([primitive(0), primitive(1)]);
        let view =
            |from: usize, length: usize| json!({"buffer": 0, "byteOffset": from, "byteLength": length});
        let views = std::iter::once(view(0, 36)).chain((0..4).map(|set| view(36 + 24 * set, 24)));
        a["bufferViews"] = views.collect();
        let accessor = |i: usize| {
            let kind = if i == 0 { "VEC3" } else { "VEC2" };
            json!({"bufferView": i, "componentType": 5126, "type": kind, "count": 3})
        };
        a["accessors"] = (0..5).map(accessor).collect();
        a["buffers"][0]["byteLength"] = json!(bytes.len());
        a["textures"] = json!([{"source": 0}]);
        a["images"] = json!([{"uri": "red.png"}]);
        let material = |[base, emission]: [u32; 2]| {
            json!({"pbrMetallicRoughness": {"baseColorTexture": texture(base)},
                   "emissiveFactor": [1, 1, 1], "emissiveTexture": texture(emission)})
        };
        a["materials"] = Value::Array(materials.map(material).into());
        a["materials"][0]["normalTexture"] = texture(normal);
    });
    load_with(&asset, &[("a.bin", &bytes), ("red.png", RED)]).unwrap_or_else(|e| panic!("{e}"))
}

/// The set of the file that a texture of a mesh part uses, identified by its coordinates.
fn seen(loaded: &Loaded, part: usize, texture: oscura::scene::TextureId) -> f32 {
    let mesh = &loaded.scene.meshes[0];
    let Texture::Image { mapping: Mapping::Uv { set, .. }, .. } = &loaded.scene.textures[texture.index()]
    else {
        panic!("{:?}", loaded.scene.textures);
    };
    let corner = mesh.triangles[mesh.parts[part].first_triangle as usize][0];
    mesh.uv_sets[*set as usize][corner as usize][0]
}

/// The sets that base colour and emission of a material use.
fn sets(loaded: &Loaded, material: usize) -> [f32; 2] {
    let m = &loaded.scene.materials[material];
    let oscura::scene::Model::Pbr(p) = &m.model else { panic!("{m:?}") };
    let emission = m.emission.and_then(|e| e.radiance.texture);
    [p.base_color.texture, emission].map(|t| seen(loaded, material, t.expect("a texture")))
}

/// Messages about the file, without that about the missing camera.
fn messages(loaded: &Loaded) -> Vec<String> {
    loaded.warnings.iter().filter(|w| w.file.is_some()).map(ToString::to_string).collect()
}

#[test]
fn materials_use_the_sets_that_they_name() {
    for (first, second) in [([2, 3], [0, 1]), ([0, 3], [3, 0]), ([1, 2], [2, 2]), ([3, 3], [1, 3])] {
        let loaded = load([first, second], first[0]);
        assert!(messages(&loaded).is_empty(), "{:?}", messages(&loaded));
        for (i, expected) in [first, second].into_iter().enumerate() {
            assert_eq!(sets(&loaded, i), expected.map(|set| set as f32), "{first:?} {second:?}");
        }
        assert!(loaded.scene.materials[0].normal_map.is_some());
    }
}

#[test]
fn third_set_of_a_material_is_dropped_with_a_warning() {
    let loaded = load([[0, 1], [0, 1]], 3);
    assert!(loaded.scene.materials[0].normal_map.is_none());
    assert_eq!(sets(&loaded, 0), [0.0, 1.0]);
    let messages = messages(&loaded);
    assert!(
        matches!(&messages[..], [one] if one.contains("/materials/0/normalTexture") && one.contains("coordinates 3")),
        "{messages:?}"
    );
}

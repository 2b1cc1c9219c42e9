//! The Cornell box as glTF: the vertices published with its measurements by Cornell's Program of Computer Graphics, in
//! millimetres, with the reflectances and the light that later renderers made customary.

use crate::json;
use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};

type Corners = [[f64; 3]; 4];

/// One mesh: quadrilaterals, counter-clockwise seen from their front, in millimetres.
struct Part {
    name: &'static str,
    material: usize,
    quads: &'static [Corners],
}

const WHITE: usize = 0;
const RED: usize = 1;
const GREEN: usize = 2;
const LIGHT: usize = 3;

const PARTS: [Part; 6] = [
    Part {
        name: "floor, ceiling and back wall",
        material: WHITE,
        quads: &[
            [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]],
            [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]],
            [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]],
        ],
    },
    Part {
        name: "right wall",
        material: GREEN,
        quads: &[[[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]]],
    },
    Part {
        name: "left wall",
        material: RED,
        quads: &[[[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]]],
    },
    // Half a millimetre below the ceiling, facing down.
    Part {
        name: "light",
        material: LIGHT,
        quads: &[[
            [343.0, 548.3, 227.0],
            [343.0, 548.3, 332.0],
            [213.0, 548.3, 332.0],
            [213.0, 548.3, 227.0],
        ]],
    },
    Part {
        name: "short box",
        material: WHITE,
        quads: &[
            [[130.0, 165.0, 65.0], [82.0, 165.0, 225.0], [240.0, 165.0, 272.0], [290.0, 165.0, 114.0]],
            [[290.0, 0.0, 114.0], [290.0, 165.0, 114.0], [240.0, 165.0, 272.0], [240.0, 0.0, 272.0]],
            [[130.0, 0.0, 65.0], [130.0, 165.0, 65.0], [290.0, 165.0, 114.0], [290.0, 0.0, 114.0]],
            [[82.0, 0.0, 225.0], [82.0, 165.0, 225.0], [130.0, 165.0, 65.0], [130.0, 0.0, 65.0]],
            [[240.0, 0.0, 272.0], [240.0, 165.0, 272.0], [82.0, 165.0, 225.0], [82.0, 0.0, 225.0]],
        ],
    },
    Part {
        name: "tall box",
        material: WHITE,
        quads: &[
            [[423.0, 330.0, 247.0], [265.0, 330.0, 296.0], [314.0, 330.0, 456.0], [472.0, 330.0, 406.0]],
            [[423.0, 0.0, 247.0], [423.0, 330.0, 247.0], [472.0, 330.0, 406.0], [472.0, 0.0, 406.0]],
            [[472.0, 0.0, 406.0], [472.0, 330.0, 406.0], [314.0, 330.0, 456.0], [314.0, 0.0, 456.0]],
            [[314.0, 0.0, 456.0], [314.0, 330.0, 456.0], [265.0, 330.0, 296.0], [265.0, 0.0, 296.0]],
            [[265.0, 0.0, 296.0], [265.0, 330.0, 296.0], [423.0, 330.0, 247.0], [423.0, 0.0, 247.0]],
        ],
    },
];

/// The camera's position in millimetres; it looks along +z with y up.
const EYE: [f64; 3] = [278.0, 273.0, -800.0];
/// Half the film's height over the focal length, both as published: 25 mm square, 35 mm.
const HALF_FILM: f64 = 12.5 / 35.0;

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Binary data of the parts, and the JSON that references it.
#[derive(Default)]
struct Built {
    positions: Vec<u8>,
    indices: Vec<u8>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

impl Built {
    fn add(&mut self, part: &Part) {
        let corners: Vec<[f32; 3]> =
            part.quads.as_flattened().iter().map(|p| p.map(|mm| (mm / 1000.0) as f32)).collect();
        let extreme = |pick: fn(f32, f32) -> f32| {
            corners
                .iter()
                .copied()
                .reduce(|a, b| [0, 1, 2].map(|i| pick(a[i], b[i])))
                .map(|p| p.map(f64::from))
        };
        self.accessors.push(json!({
            "bufferView": 0, "byteOffset": self.positions.len(), "componentType": FLOAT, "count": corners.len(),
            "type": "VEC3", "min": extreme(f32::min), "max": extreme(f32::max),
        }));
        self.positions.extend(corners.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        let first = self.indices.len();
        for quad in 0..part.quads.len() as u16 {
            self.indices.extend([0, 1, 2, 0, 2, 3].iter().flat_map(|i| (4 * quad + i).to_le_bytes()));
        }
        self.accessors.push(json!({
            "bufferView": 1, "byteOffset": first, "componentType": UNSIGNED_SHORT,
            "count": part.quads.len() * 6, "type": "SCALAR",
        }));
        let primitive = json!({
            "attributes": { "POSITION": self.accessors.len() - 2 },
            "indices": self.accessors.len() - 1, "material": part.material, "mode": 4,
        });
        self.nodes.push(json!({ "mesh": self.meshes.len(), "name": part.name }));
        self.meshes.push(json!({ "name": part.name, "primitives": [primitive] }));
    }
}

/// The asset: one file with an embedded buffer, without messages of the Khronos validator.
pub fn gltf() -> String {
    let mut built = Built::default();
    PARTS.iter().for_each(|part| built.add(part));
    let Built { positions, indices, accessors, meshes, mut nodes } = built;
    // Half a turn about y: the camera, which looks along -z, looks along +z.
    nodes.push(json!({
        "camera": 0, "name": "camera", "rotation": [0, 1, 0, 0], "translation": EYE.map(|mm| mm / 1000.0),
    }));
    let split = positions.len();
    let buffer = [positions, indices].concat();
    json::pretty(&json!({
        "asset": { "version": "2.0", "generator": "oscura-assets" },
        "extensionsUsed": ["KHR_materials_emissive_strength", "KHR_materials_specular"],
        "scene": 0,
        "scenes": [{
            "name": "Cornell box",
            "nodes": (0..nodes.len()).collect::<Vec<_>>(),
            "extras": { "width": 512, "height": 512, "bounces": 100 },
        }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials(),
        "cameras": [{
            "name": "camera",
            "type": "perspective",
            "perspective": { "aspectRatio": 1, "yfov": 2.0 * HALF_FILM.atan(), "znear": 0.01 },
        }],
        "accessors": accessors,
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": split, "byteStride": 12, "target": VERTICES },
            { "buffer": 0, "byteOffset": split, "byteLength": buffer.len() - split, "target": INDICES },
        ],
        "buffers": [{
            "byteLength": buffer.len(),
            "uri": format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&buffer)),
        }],
    }))
}

/// In the order of the constants. Non-metallic, without specular reflection and with roughness 1, glTF's model is Lambertian.
fn materials() -> Vec<Value> {
    let no_specular = json!({ "specularFactor": 0 });
    let matte = |rgb: [f64; 3]| {
        let [r, g, b] = rgb;
        json!({ "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0, "roughnessFactor": 1 })
    };
    let wall = |name: &str, rgb: [f64; 3]| {
        json!({
            "name": name, "doubleSided": true, "pbrMetallicRoughness": matte(rgb),
            "extensions": { "KHR_materials_specular": no_specular },
        })
    };
    let radiance = [17.0, 12.0, 4.0];
    let strength = 17.0;
    vec![
        wall("white", [0.725, 0.71, 0.68]),
        wall("red", [0.63, 0.065, 0.05]),
        wall("green", [0.14, 0.45, 0.091]),
        json!({
            "name": "light", "doubleSided": false, "pbrMetallicRoughness": matte([0.0; 3]),
            "emissiveFactor": radiance.map(|x| x / strength),
            "extensions": {
                "KHR_materials_emissive_strength": { "emissiveStrength": strength },
                "KHR_materials_specular": no_specular,
            },
        }),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn committed_file_is_up_to_date() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/cornell-box.gltf");
        let committed = std::fs::read_to_string(&path).expect("the asset is there");
        assert!(
            committed == gltf(),
            "{} differs; write it anew: cargo run -p oscura-assets -- cornell assets/cornell-box.gltf",
            path.display()
        );
    }

    #[test]
    fn walls_face_the_room_and_the_light_faces_down() {
        let middle = [278.0, 274.4, 279.6];
        for part in &PARTS {
            for q in part.quads {
                let side = |i: usize| [0, 1, 2].map(|k| q[i][k] - q[0][k]);
                let (a, b) = (side(1), side(2));
                let cross = |k: usize| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
                let towards = |p: [f64; 3]| (0..3).map(|k| cross(k) * (p[k] - q[0][k])).sum::<f64>();
                match part.name {
                    "light" => assert!(cross(1) < 0.0),
                    "short box" => assert!(towards([185.5, 80.0, 169.0]) < 0.0),
                    "tall box" => assert!(towards([368.5, 160.0, 351.5]) < 0.0),
                    _ => assert!(towards(middle) > 0.0, "{}", part.name),
                }
            }
        }
    }
}

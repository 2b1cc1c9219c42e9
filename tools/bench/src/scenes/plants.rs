//! Plants: alpha-masked leaves, and a forest of instances.

use image::RgbaImage;
use oscura::error::{Error, Result};
use oscura::sampling::hash::{SplitMix64, unit};
use std::fmt::Write;
use std::io::Cursor;

/// Width of the leaf texture in texels.
const TEXELS: u32 = 128;

/// A leaf with serrated edges, transparent around it, as PNG.
///
/// # Errors
/// An output error if it can't be encoded.
pub fn leaf_png() -> Result<Vec<u8>> {
    let picture = RgbaImage::from_fn(TEXELS, TEXELS, |x, y| {
        let [x, y] = [x, y].map(|t| (f64::from(t) + 0.5) / f64::from(TEXELS) * 2.0 - 1.0);
        let width = 0.55 * (1.0 - y * y) * (1.0 + 0.12 * (24.0 * y).sin());
        let vein = if x.abs() < 0.03 || ((y + x.abs()) * 5.0).fract().abs() < 0.08 { 40 } else { 0 };
        image::Rgba([60 + vein, 140 + vein, 40, if x.abs() < width { 255 } else { 0 }])
    });
    let mut bytes = Vec::new();
    let written = picture.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png);
    written.map_err(|e| Error::usage(format!("the leaf can't be encoded: {e}")))?;
    Ok(bytes)
}

/// A leaf mesh: one glTF quad with an alpha mask and diffuse transmission.
pub const LEAF: &str = r#"{
"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
"extensionsUsed": ["KHR_materials_diffuse_transmission"],
"materials": [{"alphaMode": "MASK", "doubleSided": true, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0},
  "metallicFactor": 0, "roughnessFactor": 0.6}, "extensions": {"KHR_materials_diffuse_transmission":
  {"diffuseTransmissionFactor": 0.3, "diffuseTransmissionColorFactor": [0.6, 0.9, 0.3]}}}],
"textures": [{"source": 0}], "images": [{"uri": "leaf.png"}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-0.5, 0, 0], "max": [0.5, 1, 0]},
  {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
  {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}],
"bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 32},
  {"buffer": 0, "byteOffset": 80, "byteLength": 12}],
"buffers": [{"uri": "leaf.bin", "byteLength": 92}]}"#;

/// The buffer of that mesh.
pub fn leaf_bin() -> Vec<u8> {
    let numbers: [f32; 20] = [
        -0.5, 0.0, 0.0, 0.5, 0.0, 0.0, 0.5, 1.0, 0.0, -0.5, 1.0, 0.0, // Positions.
        0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, // Texture coordinates.
    ];
    let indices: [u16; 6] = [0, 1, 2, 0, 2, 3];
    let bytes = numbers.iter().flat_map(|n| n.to_le_bytes());
    bytes.chain(indices.iter().flat_map(|n| n.to_le_bytes())).collect()
}

/// A bush of leaves on a ground under the sky.
pub fn foliage() -> String {
    let mut out = format!("environment = {{ image = \"sky.hdr\" }}\n{}", ground([0.0, 1.2, 4.5], 0.9));
    let mut random = Random(SplitMix64::new(5));
    for _ in 0..600 {
        let (around, height) = (360.0 * random.next(), 1.6 * random.next());
        let out_from_axis = 0.9 * (1.0 - (height / 1.6 - 0.4).powi(2)) * random.next().sqrt();
        let (sin, cos) = around.to_radians().sin_cos();
        let tilt = 30.0 + 80.0 * random.next();
        let _ = write!(
            out,
            "\n[[objects]]\nmesh = \"leaf.gltf\"\ntransform = [{{ scale = 0.25 }}, {{ euler = [{tilt:.3}, {around:.3}, 0] }}, \
             {{ translate = [{:.4}, {height:.4}, {:.4}] }}]\n",
            sin * out_from_axis,
            cos * out_from_axis
        );
    }
    out
}

/// A forest of ten thousand trees, all instances of one mesh.
pub fn forest() -> String {
    let mut out = format!("environment = {{ sky = {{}} }}\n{}", ground([0.0, 14.0, 60.0], 0.0));
    out += "\n[materials.tree]\ntype = \"lambert\"\ncolor = [0.2, 0.4, 0.12]\n";
    let mut random = Random(SplitMix64::new(9));
    for i in 0..10_000 {
        let [x, z] = [i % 100, i / 100].map(|k| f64::from(k) - 50.0 + 0.8 * random.next());
        let (turn, size) = (360.0 * random.next(), 0.3 + 0.3 * random.next());
        let _ = write!(
            out,
            "\n[[objects]]\nmesh = \"tree.ply\"\nmaterial = \"tree\"\ntransform = [{{ scale = [{size:.3}, {:.3}, {size:.3}] }}, \
             {{ rotate = {{ axis = [0, 1, 0], angle = {turn:.3} }} }}, {{ translate = [{x:.3}, {:.3}, {z:.3}] }}]\n",
            2.5 * size,
            1.2 * size
        );
    }
    out
}

/// A camera that looks at a height above the centre of a ground.
fn ground(from: [f64; 3], at_height: f64) -> String {
    format!(
        "camera = {{ look_from = {from:?}, look_at = [0, {at_height}, 0], vfov = 35, aspect_ratio = 1.5 }}\n\n[materials.ground]\n\
         type = \"lambert\"\ncolor = [0.3, 0.25, 0.2]\n\n[[objects]]\n\
         quad = {{ corner = [-500, 0, 500], u = [1000, 0, 0], v = [0, 0, -1000] }}\nmaterial = \"ground\"\n"
    )
}

struct Random(SplitMix64);

impl Random {
    /// In 0..1.
    fn next(&mut self) -> f64 {
        f64::from(unit((self.0.next_bits() >> 32) as u32))
    }
}

//! Images: formats that only glTF uses, and deferred decoding.
// Tests of optional decoders use some of this.
#![cfg_attr(not(feature = "decoders"), allow(unused_imports, dead_code))]

use super::asset::{load_with, triangle_bytes, triangle_with};
use super::materials::RED;
use image::ImageEncoder;
use oscura::error::Error;
use oscura::image::Encoding;
use oscura::load::Loaded;
use oscura::scene::{Scene, Texture};
use serde_json::{Value, json};
use std::process::Command;

/// A KTX2 file of one level: `format` is a VkFormat, 0 with the data format descriptor of UASTC.
fn ktx2(format: u32, width: u32, height: u32, level: &[u8]) -> Vec<u8> {
    let (description, data) = (104u32, 104 + 44);
    let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    for word in [format, 1, width, height, 0, 0, 1, 1, 0, description, 44, 0, 0] {
        bytes.extend(word.to_le_bytes());
    }
    for long in [0u64, 0, data, level.len() as u64, level.len() as u64] {
        bytes.extend(long.to_le_bytes());
    }
    // Colour model 166 (UASTC), primaries BT.709, transfer sRGB; blocks of 4 x 4; one sample of 128 bits, RGBA.
    let model = 166 | 1 << 8 | 2 << 16;
    for word in [44, 0, 40 << 16 | 2, model, 3 | 3 << 8, 16, 0, 127 << 16 | 3 << 24, 0, 0, u32::MAX] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(level);
    bytes
}

/// A uniform UASTC block (mode 8).
#[cfg(feature = "ktx2")]
fn solid_block(rgba: [u8; 4]) -> [u8; 16] {
    (0x17u128 | u128::from(u32::from_le_bytes(rgba)) << 5).to_le_bytes()
}

fn textured(image: &str, texture: Value) -> Value {
    triangle_with(|a| {
        a["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
        a["textures"] = json!([texture]);
        a["images"] = json!([{"uri": image}, {"uri": "red.png"}]);
    })
}

fn load(asset: &Value, name: &str, bytes: &[u8]) -> Result<Loaded, Error> {
    load_with(asset, &[("a.bin", &triangle_bytes()), (name, bytes), ("red.png", RED)])
}

/// The message about the only image, which can't be read: only the texture is lost.
fn lost(loaded: &Result<Loaded, Error>) -> String {
    let loaded = loaded.as_ref().unwrap_or_else(|e| panic!("{e}"));
    let Scene { images, textures, meshes, .. } = &loaded.scene;
    let is_used =
        loaded.scene.materials.iter().any(|m| m.model.pbr().is_some_and(|p| p.base_color.texture.is_some()));
    assert!(textures.is_empty() && !is_used && meshes.len() == 1, "{} images", images.len());
    let messages: Vec<_> = loaded.warnings.iter().filter(|w| w.place.starts_with("/images/0")).collect();
    assert_eq!(messages.len(), 1, "{:?}", loaded.warnings);
    format!("{} [{}]", messages[0].message, messages[0].code)
}

#[cfg(feature = "ktx2")]
#[test]
fn basis_universal_textures() {
    let texture = json!({"source": 1, "extensions": {"KHR_texture_basisu": {"source": 0}}});
    let asset = textured("a.ktx2", texture);
    let bytes = ktx2(0, 4, 4, &solid_block([10, 128, 255, 77]));
    let scene = load(&asset, "a.ktx2", &bytes).unwrap_or_else(|e| panic!("{e}")).scene;
    let image = &scene.images[0];
    assert_eq!((image.width, image.height, image.channels), (4, 4, 4));
    assert_eq!(image.encoding, Encoding::Srgb);
    let [r, g, _, a] = image.rgba(3, 2);
    let expected = oscura::color::linear_from_srgb(128.0 / 255.0);
    assert!((g - expected).abs() < 1e-6 && r < 0.01 && (a - 77.0 / 255.0).abs() < 1e-6);
}

#[test]
fn plain_ktx2_and_its_damage() {
    let asset = textured("a.ktx2", json!({"source": 0}));
    let pixels: Vec<u8> = (0..24).collect();
    let whole = ktx2(29, 4, 2, &pixels);
    let scene = load(&asset, "a.ktx2", &whole).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!((scene.images[0].width, scene.images[0].height, scene.images[0].channels), (4, 2, 3));
    let claims = [
        ktx2(29, 4, 3, &pixels),
        ktx2(29, 1 << 20, 1 << 20, &pixels),
        ktx2(0, 1 << 13, 1 << 11, &pixels),
        ktx2(0, 8, 8, &[0xff; 16]),
        ktx2(0, 4, 0, &[0; 16]),
        ktx2(97, 4, 2, &pixels),
    ];
    for bytes in claims.iter().map(Vec::as_slice).chain((12..whole.len()).map(|n| &whole[..n])) {
        let messages = lost(&load(&asset, "a.ktx2", bytes));
        assert!(messages.contains("[texture-missing]"), "{messages}");
    }
}

/// An embedded image, without deferred decoding.
fn load_embedded(bytes: &[u8]) -> Result<Loaded, Error> {
    use base64::Engine;
    let text = base64::engine::general_purpose::STANDARD.encode(bytes);
    let asset = textured(&format!("data:image/ktx2;base64,{text}"), json!({"source": 0}));
    load_with(&asset, &[("a.bin", &triangle_bytes()), ("red.png", RED)])
}

/// Large ones are decoded when needed, to the same pixels.
#[test]
fn large_ktx2_files_stay_encoded() {
    let pixels: Vec<u8> =
        (0..1024 * 512 * 4u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let whole = ktx2(43, 1024, 512, &pixels);
    let scene = load_embedded(&whole).unwrap_or_else(|e| panic!("{e}")).scene;
    let image = &scene.images[0];
    assert!(image.is_encoded() && (image.width, image.height, image.channels) == (1024, 512, 4));
    assert_eq!(image.encoding, Encoding::Srgb);
    let decoded = image.decoded(&mut Vec::new()).unwrap_or_else(|_| panic!("damaged"));
    assert!(matches!(&*decoded.pixels, oscura::image::Pixels::U8(read) if *read == pixels));
    // Damage visible in the header is reported while loading.
    let messages = lost(&load_embedded(&whole[..whole.len() - 1]));
    assert!(messages.contains("[texture-missing]"), "{messages}");
}

#[cfg(feature = "ktx2")]
#[test]
fn large_basis_universal_textures_stay_encoded() {
    let blocks: Vec<u8> = (0..256 * 256u32).flat_map(|i| solid_block((i * 251).to_le_bytes())).collect();
    let whole = ktx2(0, 1024, 1024, &blocks);
    let scene = load_embedded(&whole).unwrap_or_else(|e| panic!("{e}")).scene;
    let image = &scene.images[0];
    assert!(image.is_encoded() && (image.width, image.height, image.channels) == (1024, 1024, 4));
    let decoded = image.decoded(&mut Vec::new()).unwrap_or_else(|_| panic!("damaged"));
    let oscura::image::Pixels::U8(read) = &*decoded.pixels else { panic!("not bytes") };
    let at = 4 * (1024 * (4 * 3 + 1) + 4 * 200 + 2);
    assert_eq!(read[at..at + 4], ((3 * 256 + 200) * 251u32).to_le_bytes());
}

#[test]
fn ktx2_texture_arrays_use_the_first_layer() {
    let asset = textured("a.ktx2", json!({"source": 0}));
    let mut bytes = ktx2(29, 4, 2, &[9; 24]);
    bytes[32..36].copy_from_slice(&3u32.to_le_bytes());
    let loaded = load(&asset, "a.ktx2", &bytes).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.warnings.iter().any(|w| w.code == "image-list"), "{:?}", loaded.warnings);
}

/// Glossiness in alpha becomes roughness; the same image gives the specular colour.
#[test]
fn specular_glossiness_is_converted() {
    let mut asset = textured("a.ktx2", json!({"source": 0}));
    asset["materials"][0] = json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.25, 0.125, 1], "specularFactor": [0.2, 0.4, 1], "glossinessFactor": 0.5,
        "specularGlossinessTexture": {"index": 0}
    }}});
    let bytes = ktx2(43, 1, 1, &[255, 255, 255, 102]);
    let scene = load(&asset, "a.ktx2", &bytes).unwrap_or_else(|e| panic!("{e}")).scene;
    let oscura::scene::Model::Pbr(p) = &scene.materials[0].model else { panic!("no glTF material") };
    assert_eq!((p.base_color.factor, p.metallic.factor, p.ior), ([0.5, 0.25, 0.125], 0.0, 1.5));
    // 0.04 is the factor on the specular colour.
    assert!(p.specular_color.factor.iter().zip([0.2, 0.4, 1.0]).all(|(f, s)| (f * 0.04 - s).abs() < 1e-6));
    let (rough, channel) = p.roughness.texture.expect("a texture");
    let Texture::Image { image, .. } = scene.textures[rough.index()] else { panic!("no image") };
    let value = scene.images[image.index()].rgba(0, 0)[usize::from(channel)];
    assert!((p.roughness.factor * value - (1.0 - 0.5 * 102.0 / 255.0)).abs() < 1e-4);
    assert!(p.specular_color.texture.is_some_and(|t| t != rough));
}

/// Of 50 images 2 are visible; the others are invalid images, and `--explain` lists them as culled.
#[test]
fn unreferenced_images_are_not_read() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let asset = triangle_with(|a| {
        a["materials"] = json!([
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 7}, "metallicRoughnessTexture": {"index": 31}}},
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 8}}}
        ]);
        a["textures"] = (0..50).map(|i| json!({"source": i})).collect();
        a["images"] =
            (0..50).map(|i| json!({"uri": if [7, 31].contains(&i) { "red.png" } else { "a.bin" }})).collect();
    });
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).expect("written");
    write("a.gltf", asset.to_string().as_bytes());
    write("a.bin", &triangle_bytes());
    write("red.png", RED);
    let loaded = super::asset::open(&folder.path().join("a.gltf")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.images.len(), 2);
    let output = Command::new(env!("CARGO_BIN_EXE_oscura"))
        .args(["render", "a.gltf", "-o", "a.png", "--width", "4", "--height", "4", "--spp", "1", "--explain"])
        .current_dir(folder.path())
        .output()
        .expect("the program starts");
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && messages.contains("48 of 50 images"), "{messages}");
}

/// Pixels are used as stored, as glTF requires: that is noted, without a warning.
#[test]
fn how_an_image_asks_to_be_turned_is_noted() {
    let exif = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let mut jpeg = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
    encoder.set_exif_metadata(exif.to_vec()).expect("room for Exif");
    encoder.write_image(&[9; 24], 4, 2, image::ExtendedColorType::Rgb8).expect("encoded");
    let asset = textured("a.jpg", json!({"source": 0}));
    let loaded = load(&asset, "a.jpg", &jpeg).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((loaded.scene.images[0].width, loaded.scene.images[0].height), (4, 2));
    let notes: Vec<String> = loaded.notes.iter().map(ToString::to_string).collect();
    let expected = "a.jpg: has the EXIF orientation 6, which is ignored";
    assert_eq!(notes.iter().filter(|note| note.ends_with(expected)).count(), 1, "{notes:?}");
    assert!(loaded.warnings.iter().all(|w| !w.message.contains("orientation")), "{:?}", loaded.warnings);
}

/// Plain pixels as they are, and deflated by ZLIB and by Zstandard.
#[cfg(feature = "ktx2")]
#[test]
fn plain_pixels_under_supercompression() {
    let pixels: Vec<u8> = (0..4 * 2 * 4).map(|i| (i * 7) as u8).collect();
    let zlib = miniz_oxide::deflate::compress_to_vec_zlib(&pixels, 6);
    // A frame of one raw block: magic number, one segment of so many bytes, the block's header.
    let mut zstd = vec![0x28, 0xb5, 0x2f, 0xfd, 0x20, pixels.len() as u8];
    zstd.extend(&((pixels.len() as u32) << 3 | 1).to_le_bytes()[..3]);
    zstd.extend(&pixels);
    let asset = textured("a.ktx2", json!({"source": 1, "extensions": {"KHR_texture_basisu": {"source": 0}}}));
    for (scheme, level) in [(0, &pixels), (3, &zlib), (2, &zstd)] {
        let mut bytes = ktx2(37, 4, 2, level);
        bytes[44] = scheme;
        bytes[96..104].copy_from_slice(&(pixels.len() as u64).to_le_bytes());
        let scene = load(&asset, "a.ktx2", &bytes).unwrap_or_else(|e| panic!("scheme {scheme}: {e}")).scene;
        let oscura::image::Pixels::U8(read) = &*scene.images[0].pixels else { panic!("not bytes") };
        assert_eq!(read, &pixels, "scheme {scheme}");
        // Cut short it is lost.
        let mut cut = ktx2(37, 4, 2, &level[..level.len() - 9]);
        cut[44] = scheme;
        assert!(!lost(&load(&asset, "a.ktx2", &cut)).is_empty(), "scheme {scheme}");
    }
}

/// The pixels of a level, as [`FRAMES`] has them.
fn pixels_of([width, height]: [u32; 2], level: u32) -> Vec<u8> {
    let pixel = |x: u32, y: u32| [(x / 2 * 40 + level) as u8, (y / 2 * 30) as u8, ((x ^ y) & 3) as u8, 255];
    (0..height).flat_map(|y| (0..width).flat_map(move |x| pixel(x, y))).collect()
}

/// The sizes of three levels.
const SIZES: [[u32; 2]; 3] = [[16, 8], [8, 4], [4, 2]];

/// Their pixels as `zstd -19 --no-check` (1.5) compresses them.
#[cfg(feature = "ktx2")]
const FRAMES: [&str; 3] = [
    "28b52ffd600001b50500624d1b13d0a503140557700557dc578fe9078a05912405bd88bdf7c065e5b27259b9acdcbdf7\
     0e25baaad4ab5057757a95e9aa48af1a5d5df7bdf738a0e864ea48d4c9d391a693a4234727ef169f36fab3cd933dfeb0\
     e81605a77e6a1875a3824fff346cba4dc1a44f1a1edda3e0fb0755a8a1417301afff1b603d0760f926f6a861250d0d77\
     0a5e64100b555c505101a964e3e18f2c166aae2c23220ca1c6c21f592cd4c4fe9023e3e1a7e5317bb1bdd8d9e77f4a55",
    "28b52ffd20801d020002c80f0de0e900003350818ac3c0bd650a2bf5a406a14368659ecc203b644f6aa50ea141e8c9ac\
     cc211b648375582b3d69700e67dd738735584f5ae97006e7b9750100",
    "28b52ffd2020cd00000242050af039ffff3b354b4a9902c72db76698e58e1b664d00",
];

/// A KTX2 file of so many levels (KTX 2.0, sections 3.1 to 3.10): the least comes first.
fn ktx2_of_levels(format: u32, scheme: u32, levels: &[Vec<u8>]) -> Vec<u8> {
    let count = levels.len();
    let description = 80 + 24 * count;
    let mut bytes = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    let [width, height] = SIZES[0];
    for word in [format, 1, width, height, 0, 0, 1, count as u32, scheme, description as u32, 92, 0, 0] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend([0; 16]);
    let start = description + 92;
    for (k, level) in levels.iter().enumerate() {
        let before: usize = levels[k + 1..].iter().map(Vec::len).sum();
        let whole = pixels_of(SIZES[k], 0).len();
        for long in [start + before, level.len(), whole] {
            bytes.extend((long as u64).to_le_bytes());
        }
    }
    // Colour model RGBSDA, primaries BT.709, transfer sRGB for format 43, else linear; four samples of 8 bits.
    let transfer = if format == 43 { 2 } else { 1 };
    for word in [92u32, 0, 88 << 16 | 2, 1 | 1 << 8 | transfer << 16, 0, 4, 0] {
        bytes.extend(word.to_le_bytes());
    }
    for (k, channel) in [0u32, 1, 2, 15].into_iter().enumerate() {
        for word in [channel << 24 | 7 << 16 | (8 * k as u32), 0, 0, 255] {
            bytes.extend(word.to_le_bytes());
        }
    }
    levels.iter().rev().for_each(|level| bytes.extend(level));
    bytes
}

/// Each level of pixels, supercompressed.
#[cfg(feature = "ktx2")]
fn compressed(scheme: u32) -> Vec<Vec<u8>> {
    let unhex = |text: &str| {
        let byte = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).expect("hexadecimal");
        (0..text.len()).step_by(2).map(byte).collect()
    };
    let plain = |k: usize| pixels_of(SIZES[k], k as u32);
    match scheme {
        2 => FRAMES.map(unhex).to_vec(),
        3 => (0..3).map(|k| miniz_oxide::deflate::compress_to_vec_zlib(&plain(k), 6)).collect(),
        _ => (0..3).map(plain).collect(),
    }
}

/// With levels and without, UNORM and SRGB, under each compression: the largest level's pixels.
#[cfg(feature = "ktx2")]
#[test]
fn levels_of_plain_pixels_under_supercompression() {
    let asset = textured("a.ktx2", json!({"source": 1, "extensions": {"KHR_texture_basisu": {"source": 0}}}));
    for (scheme, format, count) in
        [0, 2, 3].into_iter().flat_map(|s| [(37, 1), (43, 1), (37, 3), (43, 3)].map(|(f, c)| (s, f, c)))
    {
        let what = format!("scheme {scheme}, format {format}, {count} levels");
        let bytes = ktx2_of_levels(format, scheme, &compressed(scheme)[..count]);
        let scene = load(&asset, "a.ktx2", &bytes).unwrap_or_else(|e| panic!("{what}: {e}")).scene;
        let image = &scene.images[0];
        assert_eq!((image.width, image.height, image.channels), (16, 8, 4), "{what}");
        assert_eq!(image.encoding, Encoding::Srgb, "{what}: what a base colour is");
        let oscura::image::Pixels::U8(read) = &*image.pixels else { panic!("not bytes") };
        assert!(*read == pixels_of(SIZES[0], 0), "{what}");
    }
}

/// A screen whose picture is lost is no lamp.
#[test]
fn emission_without_its_texture_is_dropped() {
    let mut asset = textured("a.png", json!({"source": 0}));
    asset["materials"][0]["emissiveTexture"] = json!({"index": 0});
    asset["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    let loaded = load(&asset, "a.png", b"\x89PNG\r\n\x1a\nand no more").unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.scene.materials[0].emission.is_none());
    let messages: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert!(messages.iter().any(|s| s.contains("/materials/0/emissiveTexture: ")), "{messages:?}");
}

/// Of two textures the damaged one is lost, wherever the damage is noticed, and the other stays.
#[cfg(feature = "ktx2")]
#[test]
fn damaged_textures_are_lost_alone() {
    let mut asset = textured("a.ktx2", json!({"source": 0}));
    asset["materials"][0]["emissiveTexture"] = json!({"index": 1});
    asset["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    asset["textures"] = json!([{"source": 0}, {"source": 1}]);
    for scheme in [2, 3] {
        let whole = ktx2_of_levels(43, scheme, &compressed(scheme));
        let base = whole.len() - compressed(scheme)[0].len();
        let mut damaged = whole.clone();
        damaged[base..].iter_mut().for_each(|byte| *byte ^= 0x5a);
        for bytes in [&damaged[..], &whole[..whole.len() - 1], &whole[..60]] {
            let loaded = load(&asset, "a.ktx2", bytes).unwrap_or_else(|e| panic!("{e}"));
            let material = &loaded.scene.materials[0];
            assert!(material.model.pbr().is_some_and(|p| p.base_color.texture.is_none()));
            let Some(shines) = material.emission.and_then(|e| e.radiance.texture) else { panic!("lost") };
            let Texture::Image { image, .. } = loaded.scene.textures[shines.index()] else {
                panic!("no image")
            };
            assert!(loaded.scene.images[image.index()].rgba(0, 0)[0] > 0.5, "red.png is red");
            let messages: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
            let about: Vec<_> = loaded.warnings.iter().filter(|w| w.code == "texture-missing").collect();
            assert!(
                about.len() == 1 && about[0].place.contains("/images/0"),
                "scheme {scheme}: {messages:?}"
            );
        }
    }
}

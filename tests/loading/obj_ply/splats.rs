//! PLY files of Gaussian splats, plain and compressed, valid and damaged.

use super::load_ply;
use crate::codes::code_of;
use crate::files::{load_files, load_files_by};
use oscura::load::{LoadOptions, Up};
use oscura::math::DVec3;
use oscura::scene::Scene;

/// A header, and rows of floats.
fn plain(rest: usize, rows: &[Vec<f32>]) -> Vec<u8> {
    let mut text = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", rows.len());
    let names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"].map(str::to_string);
    let rest = (0..rest).map(|i| format!("f_rest_{i}"));
    let last = ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];
    for name in names.into_iter().chain(rest).chain(last.map(str::to_string)) {
        text += &format!("property float {name}\n");
    }
    text += "end_header\n";
    let mut bytes = text.into_bytes();
    bytes.extend(rows.iter().flatten().flat_map(|x| x.to_le_bytes()));
    bytes
}

/// Position, colour, coefficients, opacity, scales and rotation of one splat.
fn row(rest: &[f32], last: [f32; 8]) -> Vec<f32> {
    let first = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3];
    first.into_iter().chain(rest.iter().copied()).chain(last).collect()
}

const USUAL: [f32; 8] = [0.0, -1.0, -2.0, -3.0, 2.0, 0.0, 0.0, 0.0];

fn only_splats(scene: &Scene) -> &oscura::scene::Splats {
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 1));
    scene.meshes[0].splats.as_ref().expect("splats")
}

fn close(found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= 1e-3 * b.abs() + 1e-6, "{found:?}, not {expected:?}");
    }
}

/// A material of a scene file replaces emission, multiplied by the splats' colours.
#[test]
fn materials_of_scene_files_keep_splat_colours() {
    let scene = b"[camera]\nlook_from = [0, 0, 5]\nlook_at = [0, 0, 0]\n[materials]\nlit = { type = \"lambert\", color = 0.9 }\n\
        [[objects]]\nmesh = \"a.ply\"\nmaterial = \"lit\"\n";
    let splats = plain(0, &[row(&[], USUAL)]);
    let loaded = load_files(&[("s.toml", &scene[..]), ("a.ply", &splats)]).unwrap_or_else(|e| panic!("{e}"));
    let material = loaded.scene.instances[0].material.expect("another one");
    let material = &loaded.scene.materials[material.index()];
    assert!(material.name == "lit" && material.use_vertex_colors && material.emission.is_none());
}

#[test]
fn plain_splats_are_decoded() {
    // Coefficients of red first, then of green, then of blue.
    let rest: Vec<f32> = (0..45).map(|i| i as f32 * 0.01).collect();
    let loaded = load_ply(&plain(45, &[row(&rest, USUAL)])).expect("it loads");
    let splats = only_splats(&loaded.scene);
    assert_eq!((splats.degree, splats.len(), splats.is_linear), (3, 1, false));
    assert_eq!(loaded.scene.meshes[0].positions, [[1.0, 2.0, 3.0]]);
    close(&splats.scales[0], &[-1.0f32, -2.0, -3.0].map(f32::exp));
    close(&splats.rotations[0], &[0.0, 0.0, 0.0, 1.0]);
    close(&splats.opacities, &[0.5]);
    let coefficient = |i: usize| splats.coefficients[i].map(|c| c.to_f32());
    close(&coefficient(0), &[0.1, 0.2, 0.3]);
    close(&coefficient(1), &[0.0, 0.15, 0.3]);
    close(&coefficient(15), &[0.14, 0.29, 0.44]);
    // Rotations have w first.
    let turned =
        load_ply(&plain(0, &[row(&[], [0.0, -1.0, -2.0, -3.0, 0.0, 3.0, 0.0, 0.0])])).expect("it loads");
    close(&only_splats(&turned.scene).rotations[0], &[1.0, 0.0, 0.0, 0.0]);
    assert_eq!(only_splats(&turned.scene).degree, 0);
    // Their y points down.
    let files = [("a.ply", plain(0, &[row(&[], USUAL)]))];
    let guessed = load_files_by(&files, &LoadOptions { up: Up::Auto, ..LoadOptions::default() });
    let guessed = guessed.expect("it loads");
    assert!(
        guessed.notes.iter().any(|note| note.code == "up-guessed" && note.message.starts_with("-y")),
        "{:?}",
        guessed.notes
    );
    let up = guessed.scene.instances[0].world_from_object.transform_vector3(-DVec3::Y);
    assert!((up - DVec3::Y).length() < 1e-12, "{up}");
}

#[test]
fn ascii_and_flat_splats_load() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float opacity\n\
                property float scale_0\nproperty float scale_1\nproperty float rot_0\nproperty float rot_1\n\
                property float rot_2\nproperty float rot_3\nend_header\n0 0 0 1 1 1 2 -1 -1 1 0 0 0\n";
    let loaded = load_ply(text.as_bytes()).expect("it loads");
    let [a, b, c] = only_splats(&loaded.scene).scales[0];
    assert!(a == b && (c / a - 1e-4).abs() < 1e-7, "{a} {b} {c}");
    let lacking = text.replace("rot_2", "other");
    let error = load_ply(lacking.as_bytes()).expect_err("no rotation");
    assert!(code_of(&error) == "splats-incomplete" && error.to_string().contains("rot_2"), "{error}");
}

/// Invalid splats are dropped with a count, and repairable ones repaired.
#[test]
fn damaged_splats_are_counted() {
    let with = |at: usize, value: f32| {
        let mut row = row(&[], USUAL);
        row[at] = value;
        row
    };
    let odd = [with(0, f32::NAN), with(6, f32::INFINITY), with(9, f32::NAN), with(10, 200.0), with(13, 0.0)];
    let faint = [with(9, -20.0), with(9, f32::NEG_INFINITY)];
    let rows: Vec<Vec<f32>> = odd.into_iter().chain(faint).chain([row(&[], USUAL)]).collect();
    let loaded = load_ply(&plain(0, &rows)).expect("it loads");
    assert_eq!(only_splats(&loaded.scene).len(), 2);
    let counted = |code: &str, count: &str| {
        loaded.warnings.iter().any(|w| w.code == code && w.message.starts_with(count))
    };
    assert!(counted("splats-not-finite", "4 "), "{:?}", loaded.warnings);
    assert!(counted("splats-not-rotated", "1 "), "{:?}", loaded.warnings);
    assert!(loaded.left_out.iter().any(|w| w.starts_with("2 ")), "{:?}", loaded.left_out);
    let none = load_ply(&plain(0, &[with(0, f32::NAN)])).expect_err("nothing is left");
    assert_eq!(code_of(&none), "splats-invisible");
    let whole = plain(0, &[row(&[], USUAL)]);
    for length in 0..whole.len() {
        assert!(load_ply(&whole[..length]).is_err(), "{length}");
    }
    let huge = String::from_utf8_lossy(&whole[..60]).replace("vertex 1", "vertex 4000000000");
    assert!(load_ply(&[huge.as_bytes(), &whole[60..]].concat()).is_err());
}

/// A chunk with bounds, two splats and coefficients of degree 1, in the format's layout.
fn packed(chunks: usize) -> Vec<u8> {
    let mut text = format!("ply\nformat binary_little_endian 1.0\nelement chunk {chunks}\n");
    let bounds = ["min", "max", "min_scale", "max_scale"];
    for name in bounds.iter().flat_map(|b| ["x", "y", "z"].map(|axis| format!("{b}_{axis}"))) {
        text += &format!("property float {name}\n");
    }
    for name in ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"] {
        text += &format!("property float {name}\n");
    }
    text += "element vertex 2\nproperty uint packed_position\nproperty uint packed_rotation\n\
             property uint packed_scale\nproperty uint packed_color\nelement sh 2\n";
    (0..9).for_each(|i| text += &format!("property uchar f_rest_{i}\n"));
    text += "end_header\n";
    let mut bytes = text.into_bytes();
    let chunk =
        [-1.0, 0.0, 1.0, 1.0, 2.0, 3.0, -4.0, -4.0, -4.0, -2.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0];
    for _ in 0..chunks {
        bytes.extend(chunk.iter().flat_map(|x: &f32| x.to_le_bytes()));
    }
    // The first at the minimum of all bounds, the second at the maximum, rotated by half a turn about y (x, y, z, w) = (0, 1,
    // 0, 0).
    let (middle, half) = (512u32 << 20 | 512 << 10 | 512, 0x8000_0000u32);
    let words = [[0, middle, 0, 0xff], [u32::MAX, half | middle, u32::MAX, u32::MAX]];
    bytes.extend(words.iter().flatten().flat_map(|w| w.to_le_bytes()));
    bytes.extend((0..18).map(|i| i * 10u8));
    bytes
}

#[test]
fn compressed_splats_are_unpacked() {
    let loaded = load_ply(&packed(1)).expect("it loads");
    let (scene, splats) = (&loaded.scene, only_splats(&loaded.scene));
    assert_eq!((splats.degree, splats.len()), (1, 2));
    close(&scene.meshes[0].positions[0], &[-1.0, 0.0, 1.0]);
    close(&scene.meshes[0].positions[1], &[1.0, 2.0, 3.0]);
    close(&splats.scales[0], &[-4.0f32; 3].map(f32::exp));
    close(&splats.scales[1], &[-2.0f32, -1.0, 0.0].map(f32::exp));
    close(&splats.opacities, &[1.0, 1.0]);
    // 512 of 1023 is slightly more than the middle.
    let near =
        |q: [f32; 4], place: usize| q[place] > 0.99 && q.iter().filter(|x| x.abs() < 2e-3).count() == 3;
    assert!(near(splats.rotations[0], 3) && near(splats.rotations[1], 1), "{:?}", splats.rotations);
    let color = |i: usize| splats.coefficients[4 * i].map(|c| c.to_f32() * 0.282_094_8 + 0.5);
    close(&color(1), &[1.0, 1.0, 2.0]);
    assert!(color(0).iter().all(|c| c.abs() < 1e-3));
    // Bytes of red first: the second coefficient of the first splat has those of 0, 30 and 60.
    let of = |byte: f32| byte * 8.0 / 255.0 - 4.0;
    close(&splats.coefficients[1].map(|c| c.to_f32()), &[of(0.0), of(30.0), of(60.0)]);
    assert_eq!(code_of(&load_ply(&packed(0)).expect_err("no bounds")), "splats-incomplete");
    let whole = packed(1);
    for length in (0..whole.len()).step_by(7) {
        assert!(load_ply(&whole[..length]).is_err(), "{length}");
    }
}

/// Scene files place splats like meshes.
#[test]
fn scene_files_place_splats() {
    let toml = "[[objects]]\nmesh = 'a.ply'\ntransform = [{ translate = [1, 2, 3] }]\n";
    let splats = plain(0, &[row(&[], USUAL)]);
    let loaded = load_files(&[("scene.toml", toml.as_bytes()), ("a.ply", &splats)]).expect("it loads");
    assert_eq!(only_splats(&loaded.scene).len(), 1);
    assert_eq!(loaded.scene.instances[0].world_from_object.translation.to_array(), [1.0, 2.0, 3.0]);
}

//! Textured area lights: seen directly, in mirrors and by their illumination.

use crate::support::options;
use oscura::film::Film;
use oscura::load::load;
use std::path::Path;

/// The left half is white, but for its lower quarter, which is red; the right half is black.
fn write_picture(folder: &Path) {
    let picture = image::RgbImage::from_fn(64, 64, |x, y| match (x < 32, y < 48) {
        (true, true) => image::Rgb([255; 3]),
        (true, false) => image::Rgb([255, 0, 0]),
        (false, _) => image::Rgb([0; 3]),
    });
    picture.save(folder.join("lamp.png")).expect("saved");
}

fn picture(text: &str, size: u32, samples: u32) -> Film {
    let folder = tempfile::tempdir().expect("a folder");
    write_picture(folder.path());
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("written");
    let loaded = load(&path, &Default::default()).unwrap_or_else(|e| panic!("{e}\n{text}"));
    crate::support::picture(&loaded.scene, &options(size, samples, 1))
}

const LAMP: &str =
    "area = { center = [0, 0, 0], direction = [0, 0, 1], size = [2, 2], radiance = 3, image = \"lamp.png\"";

/// Seen directly the texture is upright; in a mirror left and right are swapped.
#[test]
fn textured_lights_show_their_texture() {
    let object =
        "[[objects]]\nquad = { corner = [-9, -9, 4], u = [0, 18, 0], v = [18, 0, 0] }\nmaterial = \"m\"\n";
    for shape in ["rectangle", "ellipse"] {
        let lamp = format!("[[lights]]\n{LAMP}, shape = \"{shape}\" }}\n");
        let head =
            "[materials.m]\ntype = \"metal\"\ncolor = 1\n[camera]\nvfov = 14\nwidth = 16\nheight = 16\n";
        let direct = format!("{head}look_from = [0, 0, 3.9]\nlook_at = [0, 0, 0]\n{lamp}{object}");
        let direct = picture(&direct, 16, 16);
        // From inside the mirror: 4 metres to the mirror and back.
        let mirrored = format!("{head}look_from = [0, 0, 0.1]\nlook_at = [0, 0, 4]\n{lamp}{object}");
        let mirrored = picture(&mirrored, 16, 16);
        for (x, y, color) in [(5, 5, [3.0; 3]), (5, 11, [3.0; 3]), (11, 5, [0.0; 3]), (11, 11, [0.0; 3])] {
            let seen = [direct.mean_rgba(x, y), mirrored.mean_rgba(15 - x, y)];
            for rgba in seen {
                let off = (0..3).map(|c| (rgba[c] - color[c]).abs()).fold(0.0f32, f32::max);
                assert!(off < 1e-3, "{shape} at {x}, {y}: {rgba:?}");
            }
        }
    }
    let far = format!(
        "[camera]\nlook_from = [0, 0, 9]\nlook_at = [0, 0, 0]\nvfov = 14\n[[lights]]\n{LAMP} }}\n[[objects]]\n\
         sphere = {{ center = [0, 0, -9], radius = 1 }}\nmaterial = \"m\"\n[materials.m]\ntype = \"lambert\"\n"
    );
    let far = picture(&far, 16, 16);
    let red = far.mean_rgba(3, 13);
    assert!(red[0] > 2.9 && red[1] < 1e-3, "{red:?}");
}

/// Light samples of a diffuse floor and BSDF samples of rough metal agree with quadrature over the texture.
#[test]
fn textured_lights_agree_with_quadrature() {
    // Over the floor, facing down, with its width along x: seen from below with up along -z, right is -x.
    let (center, half) = ([0.3, 2.0, 0.2], [1.0, 0.5]);
    let n = 400;
    let mut irradiance = [0.0f64; 3];
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n) * 2.0 - 1.0;
        let (x, z) = (center[0] + at(i) * half[0], center[2] + at(j) * half[1]);
        let squared = x * x + center[1] * center[1] + z * z;
        let area = 4.0 * half[0] * half[1] / f64::from(n * n);
        let weight = 5.0 * center[1] * center[1] / (squared * squared) * area;
        // The left half of the picture is at greater x, its lower quarter at greater z.
        let is_left = at(i) > 0.0;
        let is_low = at(j) > 0.5;
        irradiance[0] += if is_left { weight } else { 0.0 };
        irradiance[1] += if is_left && !is_low { weight } else { 0.0 };
        irradiance[2] = irradiance[1];
    }
    let text = "[camera]\nlook_from = [-3, 1, -2]\nlook_at = [0, 0, 0]\nvfov = 0.001\n[materials.a]\ntype = \"lambert\"\ncolor = 0.8\n\
        [[lights]]\narea = { center = [0.3, 2, 0.2], direction = [0, -1, 0], size = [2, 1], radiance = 5, image = \"lamp.png\" }\n\
        [[objects]]\nquad = { corner = [-9, 0, 9], u = [18, 0, 0], v = [0, 0, -18] }\nmaterial = \"a\"\n";
    let film = picture(text, 16, 256);
    for (channel, expected) in irradiance.into_iter().enumerate() {
        let sum: f64 = (0..256).map(|i| f64::from(film.mean_rgba(i % 16, i / 16)[channel])).sum();
        let (mean, truth) = (sum / 256.0, expected * 0.8 / std::f64::consts::PI);
        assert!((mean / truth - 1.0).abs() < 0.01, "{channel}: {mean} {truth}");
    }
}

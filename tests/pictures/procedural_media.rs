//! Procedural volumes: media with textured coefficients, read from scene files, against closed forms.

use crate::support::{options, picture};
use oscura::load::{LoadOptions, load};
use oscura::render::RenderOptions;

/// Mean radiance by channel of a scene file with parallel rays along -z through the origin, and how many grids it has.
fn seen(rest: &str, options: &RenderOptions) -> ([f64; 3], usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    let head = "[camera]\nlook_from = [0, 0, 9]\nlook_at = [0, 0, 0]\ntype = \"orthographic\"\nview_height = 0.001\n";
    std::fs::write(&path, format!("{head}{rest}")).expect("written");
    let scene = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}")).scene;
    let film = picture(&scene, options);
    let count = options.width * options.height;
    let of_pixel = |i: u32| film.mean_rgba(i % options.width, i / options.width);
    let mean = |c: usize| (0..count).map(|i| f64::from(of_pixel(i)[c])).sum::<f64>() / f64::from(count);
    ([0, 1, 2].map(mean), scene.grids.len())
}

fn assert_close(what: &str, found: [f64; 3], truth: [f64; 3], precision: f64) {
    let is_close = |c: usize| (found[c] - truth[c]).abs() < precision * truth[c].max(0.1);
    assert!((0..3).all(is_close), "{what}: {found:?}, truth {truth:?}");
}

/// A medium in a box from (-1, -1, -1) to (1, 1, 1), in white light.
fn in_box(medium: &str) -> String {
    format!(
        "[environment]\nbackground = 1\n[materials.body]\ntype = \"medium\"\n{medium}\n[[objects]]\n\
         box = {{ min = [-1, -1, -1], max = [1, 1, 1] }}\nmaterial = \"body\"\n"
    )
}

/// Grey absorption with a linear gradient along the ray: grids represent it exactly.
#[test]
fn absorption_of_a_gradient() {
    let medium = "density = \"tint.vector\"\ncolor = 0\nresolution = 16\n\
                  nodes.place = { type = \"texture_coordinate\" }\n\
                  nodes.parts = { type = \"separate_xyz\", vector = \"place.generated\" }\n\
                  nodes.rise = { type = \"math\", operation = \"multiply_add\", a = \"parts.z\", b = 0.4, c = 0.6 }\n\
                  nodes.tint = { type = \"vector_math\", operation = \"multiply\", a = \"rise.value\", b = [1, 0.5, 0] }\n";
    // The density is 0.6 + 0.4 z with z from 0 to 1: its mean along the ray is that at the centre.
    let (found, grids) = seen(&in_box(medium), &options(16, 1024, 4));
    assert_close("gradient", found, [-1.6f64, -0.8, 0.0].map(f64::exp), 5e-3);
    assert_eq!(grids, 1);
}

/// Emission of varying colour, without extinction.
#[test]
fn emission_by_position() {
    let medium = "density = 0\nemission = \"shift.vector\"\nresolution = 16\n\
                  nodes.place = { type = \"geometry\" }\n\
                  nodes.shift = { type = \"vector_math\", operation = \"add\", a = \"place.position\", b = [1, 2, 3] }\n";
    let (found, grids) = seen(&in_box(medium), &options(16, 256, 4));
    // 1 of the background, and a mean of (1, 2, 3) over two metres.
    assert_close("emission", found, [3.0, 5.0, 7.0], 3e-3);
    assert_eq!(grids, 4);
}

/// Constant textures match constants: single scattering, in a furnace, and multiple scattering.
#[test]
fn colors_by_textures_scatter_as_constants_do() {
    let medium = |color: &str| format!("density = 1.5\ncolor = {color}\nanisotropy = 0.4\n");
    let by_texture = "[textures.tint]\ntype = \"solid\"\ncolor = [0.9, 0.5, 0.1]\n";
    for depth in [1, 40] {
        let options = options(32, 256, depth);
        let (truth, _) = seen(&in_box(&medium("[0.9, 0.5, 0.1]")), &options);
        let (found, grids) =
            seen(&format!("{by_texture}{}", in_box(&medium("\"tint\"\nresolution = 8"))), &options);
        assert_close(&format!("depth {depth}"), found, truth, 1.2e-2);
        assert_eq!(grids, 4);
    }
}

/// Each object has a grid in its own coordinates: two spheres of different sizes with a density peak at their centres.
#[test]
fn objects_have_grids_of_their_own() {
    let materials = "[environment]\nbackground = 1\n[materials.body]\ntype = \"medium\"\ncolor = 0\nresolution = 64\n\
                     density = \"dense.value\"\n\
                     nodes.place = { type = \"texture_coordinate\" }\n\
                     nodes.parts = { type = \"separate_xyz\", vector = \"place.generated\" }\n\
                     nodes.dense = { type = \"math\", operation = \"multiply\", a = \"parts.z\", b = 0.5 }\n";
    let ball = |z: f64, radius: f64| {
        format!("[[objects]]\nsphere = {{ center = [0, 0, {z}], radius = {radius} }}\nmaterial = \"body\"\n")
    };
    let both = format!("{materials}{}{}", ball(0.0, 1.0), ball(-5.0, 2.0));
    let (found, grids) = seen(&both, &options(16, 1024, 4));
    // Generated coordinates go from 0 to 1 through each ball: a mean of 0.25 over two and over four metres.
    assert_close("two balls", found, [(-1.5f64).exp(); 3], 8e-3);
    assert_eq!(grids, 2);
}

/// Absorption and emission of varying colours.
#[test]
fn absorption_and_emission_of_many_colors() {
    let medium = "density = \"absorbed.vector\"\ncolor = 0\nresolution = 16\nnodes.place = { type = \"geometry\" }\n\
                  nodes.absorbed = { type = \"vector_math\", operation = \"multiply_add\", a = \"place.position\", b = [1, 1, 0.5], c = [1, 0.5, 0.5] }\n";
    // Along the ray the last channel goes from 0 to 1.
    let left = [-2.0f64, -1.0, -1.0].map(f64::exp);
    let (found, grids) = seen(&in_box(medium), &options(16, 2048, 4));
    assert_close("absorption", found, left, 8e-3);
    assert_eq!(grids, 4);
    let (found, _) = seen(&in_box(&format!("{medium}emission = [1, 2, 3]\n")), &options(16, 2048, 4));
    // The absorption of the last channel falls along the ray: the integral of exp(-(x - x^2 / 4)) over x from 0 to 2.
    let steps = 10_000;
    let x = |i: i32| 2.0 * (f64::from(i) + 0.5) / f64::from(steps);
    let last: f64 = (0..steps).map(|i| (-(x(i) - 0.25 * x(i) * x(i))).exp() * 2.0 / f64::from(steps)).sum();
    let shone = [1.0 - (-2.0f64).exp(), 2.0 * (1.0 - (-1.0f64).exp()) / 0.5, 3.0 * last];
    assert_close("emission", found, [0, 1, 2].map(|c| left[c] + shone[c]), 1e-2);
}

/// Shadow rays through the empty part of a medium of varying colour.
#[test]
fn empty_regions_transmit_all_light() {
    let medium = "density = \"absorbed.vector\"\ncolor = 0\nresolution = 16\nnodes.place = { type = \"geometry\" }\n\
                  nodes.shift = { type = \"vector_math\", operation = \"add\", a = \"place.position\", b = [-0.5, -0.5, 0] }\n\
                  nodes.absorbed = { type = \"vector_math\", operation = \"maximum\", a = \"shift.vector\", b = [0, 0, 0] }\n";
    let floor = "[materials.floor]\ntype = \"lambert\"\ncolor = 0.5\n[[lights]]\n\
                 sun = { direction = [0, 0, -1], irradiance = 3.14159265 }\n[[objects]]\nmaterial = \"floor\"\n\
                 quad = { corner = [-9, -9, -2], u = [18, 0, 0], v = [0, 18, 0] }\n";
    let dark = in_box(medium).replace("background = 1", "background = 0");
    // The last channel goes from 0 to 1 in the upper half, which light crosses twice.
    let (found, _) = seen(&format!("{dark}{floor}"), &options(16, 1024, 4));
    assert_close("floor", found, [0.5, 0.5, 0.5 * (-1.0f64).exp()], 8e-3);
}

//! The answer for people.

use super::super::shapes::ShapeCounts;
use super::facts::{placed_triangles, used_images, used_materials};
use super::objects::tree;
use super::words;
use oscura::image::{Encoding, Image, Pixels};
use oscura::load::Loaded;
use oscura::scene::{EnergyCompensation, FresnelModel, Scene, instance_extents, scene_extent};
use std::path::Path;

/// Everything, line by line.
pub fn lines(path: &Path, loaded: &Loaded) -> Vec<String> {
    let scene = &loaded.scene;
    let mut out = vec![path.display().to_string()];
    if !scene.name.is_empty() {
        out.push(format!("  scene      '{}'", scene.name));
    }
    geometry(scene, &mut out);
    out.extend(tree(scene).iter().map(|l| format!("    {l}")));
    section(&mut out, "materials", scene.materials.len());
    for (m, used) in scene.materials.iter().zip(used_materials(scene)) {
        let unused = if used { "" } else { "; not used" };
        out.push(format!("    '{}': {}{unused}", m.name, words::material(scene, m)));
    }
    section(&mut out, "lights", scene.lights.len());
    for l in &scene.lights {
        out.push(format!("    '{}': {}", l.name, words::light(l)));
    }
    out.push(format!("  environment {}", words::environment(scene)));
    section(&mut out, "images", scene.images.len());
    for (image, used) in scene.images.iter().zip(used_images(scene)) {
        out.push(format!("    {}, {}", image_line(image), if used { "used" } else { "not used" }));
    }
    section(&mut out, "cameras", scene.cameras.len());
    for (i, camera) in scene.cameras.iter().enumerate() {
        out.push(format!("    {i} '{}': {}", camera.name, words::camera(camera)));
    }
    let settings = settings(scene);
    if !settings.is_empty() {
        out.push(format!("  settings   {}", settings.join(", ")));
    }
    if !loaded.notes.is_empty() {
        section(&mut out, "notes", loaded.notes.len());
        out.extend(loaded.notes.iter().map(|w| format!("    {w}")));
    }
    section(&mut out, "warnings", loaded.warnings.len());
    out.extend(loaded.warnings.iter().map(|w| format!("    {w}")));
    section(&mut out, "left out", loaded.left_out.len());
    out.extend(loaded.left_out.iter().map(|w| format!("    {w}")));
    out
}

fn section(out: &mut Vec<String>, name: &str, count: usize) {
    out.push(format!("  {name:<10} {count}"));
}

fn geometry(scene: &Scene, out: &mut Vec<String>) {
    let vertices: usize = scene.meshes.iter().map(|m| m.positions.len()).sum();
    out.push(format!(
        "  geometry   {} meshes of {vertices} vertices, placed {} times ({} triangles), {}{} quads{}",
        scene.meshes.len(),
        scene.instances.len(),
        placed_triangles(scene),
        ShapeCounts::of(scene).words(),
        scene.quads.len(),
        strands(scene)
    ));
    if let Some((low, high)) = scene_extent(scene, &instance_extents(scene)).0 {
        let (from, to) = (words::list(&low.to_array()), words::list(&high.to_array()));
        out.push(format!("  extent     {from} to {to} m"));
    }
    let count = scene.instances.len() + scene.shapes.len() + scene.quads.len() + scene.curves.len();
    section(out, "objects", count);
}

/// How many curves there are, where there are some.
fn strands(scene: &Scene) -> String {
    match scene.curves.iter().map(|c| c.strands.len()).sum::<usize>() {
        0 => String::new(),
        count => format!(", {count} curves"),
    }
}

fn image_line(image: &Image) -> String {
    let bits = match &*image.pixels {
        Pixels::U8(_) => "8 bits",
        Pixels::U16(_) => "16 bits",
        Pixels::F32(_) => "32-bit floats",
        Pixels::Encoded(encoded) if encoded.bits == 8 => "8 bits",
        Pixels::Encoded(_) => "16 bits",
    };
    let encoding = match image.encoding {
        Encoding::Linear => "linear",
        Encoding::Srgb => "sRGB",
    };
    format!(
        "'{}': {} x {}, {} channels of {bits}, {encoding}, {} bytes",
        image.name,
        image.width,
        image.height,
        image.channels,
        image.bytes()
    )
}

/// What the scene says about rendering.
fn settings(scene: &Scene) -> Vec<String> {
    let s = &scene.settings;
    let numbers = [
        ("width", s.width),
        ("height", s.height),
        ("samples", s.samples),
        ("depth", s.depth),
        ("seed", s.seed),
    ];
    let mut shown: Vec<String> =
        numbers.iter().filter_map(|(name, value)| Some(format!("{name} {}", (*value)?))).collect();
    shown.extend(s.filter.map(|f| format!("filter {f:?}")));
    let scattering = |e: EnergyCompensation| match e {
        EnergyCompensation::On => "multi",
        EnergyCompensation::Off => "single",
    };
    shown.extend(s.energy_compensation.map(|e| format!("microfacet {}", scattering(e))));
    let fresnel = |f: FresnelModel| match f {
        FresnelModel::Exact => "exact",
        FresnelModel::Schlick => "schlick",
    };
    shown.extend(s.fresnel.map(|f| format!("fresnel {}", fresnel(f))));
    shown.extend(s.spectral.map(|spectral| format!("spectral {spectral}")));
    shown.extend(s.exposure.map(|e| format!("exposure {e}")));
    shown.extend(s.view.as_ref().map(|view| format!("view {}", view.name())));
    shown.extend(s.white_balance.map(|kelvin| format!("white balance {kelvin} K")));
    shown.extend(s.noise.map(|percent| format!("noise {percent} %")));
    shown.extend(s.denoise.map(|denoise| format!("denoise {denoise}")));
    shown.extend(s.caught.map(|caught| format!("caught {caught:?}").to_lowercase()));
    shown.extend(s.crop.map(|[x0, y0, x1, y1]| format!("crop {x0},{y0},{x1},{y1}")));
    shown
}

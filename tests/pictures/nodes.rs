//! What nodes of graphs give on surfaces, against Cycles: a ball and a plane with attributes, each output of each node in blocks of
//! pixels. The truth is what `tools/compare/nodes_surface.py` writes.

use crate::support::{options, picture};
use oscura::film::Film;
use oscura::load::{LoadOptions, load};
use oscura::math::{DAffine3, DMat3, DVec3};
use oscura::scene::{Camera, Projection, Scene};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references/nodes")
}

/// Twelve or sixteen numbers, row by row.
fn matrix(value: &Value) -> DAffine3 {
    let rows: Vec<f64> = numbers(value);
    let column = |i: usize| DVec3::new(rows[i], rows[4 + i], rows[8 + i]);
    DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

/// The scene whose objects shine with the output of a case's node, mapped to `0.5 + factor * value`.
fn scene(truth: &Value, case: &Value, factor: f64) -> Scene {
    let table = case["node"].as_object().expect("a table");
    let node: Vec<String> = table.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    let mut text = format!(
        "[camera]\nlook_from = [0, 0, 1]\nlook_at = [0, 0, 0]\n[textures.shown]\ntype = \"nodes\"\nup = \"z\"\n\
         result = \"mapped.vector\"\n[textures.shown.nodes]\nnode = {{ {} }}\ngeometry = {{ type = \"texture_coordinate\" }}\n\
         given = {{ type = \"vector_math\", a = \"geometry.object\" }}\n\
         mapped = {{ type = \"vector_math\", operation = \"multiply_add\", a = \"node.{}\", b = {factor:?}, c = 0.5 }}\n\
         [materials]\nshown = {{ type = \"emissive\", radiance = \"shown\", two_sided = true }}\n",
        node.join(", "),
        case["output"].as_str().expect("a name")
    );
    for (name, object) in truth["objects"].as_object().expect("objects") {
        text += &format!(
            "[[objects]]\nname = \"{name}\"\nmesh = \"{}\"\nmaterials = [\"shown\"]\ntransform = [{{ matrix = {} }}]\n\
             color = {}\nindex = {}\n",
            folder().join(format!("{name}.ply")).display(),
            object["matrix"],
            object["color"],
            object["index"]
        );
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("written");
    let mut scene = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}")).scene;
    let camera = &truth["camera"];
    let vfov_rad = camera["vfov_deg"].as_f64().expect("a number").to_radians();
    let old = scene.cameras[0].clone();
    scene.cameras[0] = Camera {
        world_from_camera: matrix(&camera["matrix"]),
        projection: Projection::Perspective { vfov_rad },
        ..old
    };
    scene
}

/// Means of blocks, by row, column and channel.
fn blocks(film: &Film, size: usize, block: usize) -> Vec<f64> {
    let count = size / block;
    let mut sums = vec![0.0; count * count * 3];
    for y in 0..size {
        for x in 0..size {
            let pixel = film.mean_rgba(x as u32, y as u32);
            for channel in 0..3 {
                let at = (y / block * count + x / block) * 3 + channel;
                sums[at] += f64::from(pixel[channel]) / (block * block) as f64;
            }
        }
    }
    sums
}

#[test]
fn outputs_on_surfaces_are_those_of_cycles() {
    let text = std::fs::read_to_string(folder().join("surface.json")).expect("it is there");
    let truth: Value = serde_json::from_str(&text).expect("JSON");
    let (size, block) = (truth["size"].as_u64().expect("a size"), truth["block"].as_u64().expect("a size"));
    let only = std::env::var("OSCURA_NODE").unwrap_or_default();
    let mut wrong = Vec::new();
    let mut count = 0;
    for case in truth["cases"].as_array().expect("cases") {
        let label = case["label"].as_str().expect("a label");
        if !label.contains(&only) {
            continue;
        }
        let expected = numbers(&case["values"]);
        let largest = expected.iter().fold(1e-3f64, |most, x| most.max(x.abs()));
        let factor = 0.4 / largest;
        let film = picture(&scene(&truth, case, factor), &options(size as u32, 64, 1));
        let found = blocks(&film, size as usize, block as usize);
        let differences = found.iter().zip(&expected).map(|(f, e)| ((f - 0.5) / factor - e) / largest);
        let worst = differences.fold(0.0f64, |worst, d| if d.abs() > worst.abs() { d } else { worst });
        count += 1;
        println!("{label}: {worst:+.5} of {largest:.3}");
        if worst.abs() > 4e-3 {
            wrong.push(format!("{label}: {worst:+.5}"));
        }
    }
    assert!(count > 0, "no case has '{only}' in its label");
    assert!(wrong.is_empty(), "{} of {count}: {wrong:#?}", wrong.len());
}

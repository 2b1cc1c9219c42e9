//! Instances of objects from a point file.

use oscura::load::{LoadOptions, load};
use oscura::math::DVec3;
use oscura::scene::Scene;

const PROPERTIES: [&str; 9] = ["x", "y", "z", "qx", "qy", "qz", "qw", "scale", "index"];

/// A scene of one object instanced at `places`.
fn scene(object: &str, places: &[[f64; 9]]) -> Result<(Scene, Vec<String>), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut ply = format!("ply\nformat ascii 1.0\nelement vertex {}\n", places.len());
    PROPERTIES.iter().for_each(|name| ply += &format!("property double {name}\n"));
    ply += "end_header\n";
    places.iter().for_each(|row| ply += &format!("{}\n", row.map(|v| v.to_string()).join(" ")));
    std::fs::write(folder.path().join("places.ply"), ply).expect("written");
    let text = format!(
        "[materials]\na = {{ type = \"lambert\" }}\n[[objects]]\nname = \"leaf\"\nmaterial = \"a\"\ninstances = \"places.ply\"\n{object}\n"
    );
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("written");
    let loaded = load(&path, &LoadOptions::default()).map_err(|e| e.to_string())?;
    Ok((loaded.scene, loaded.warnings.iter().map(ToString::to_string).collect()))
}

#[test]
fn instances_share_a_mesh() {
    // A quarter turn about y rotates x to -z; the object's own transform is applied first.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let places =
        [[1.0, 2.0, 3.0, 0.0, half, 0.0, half, 2.0, 7.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 8.0]];
    let object = "box = { min = [0, 0, 0], max = [1, 1, 1] }\ntransform = [{ translate = [10, 0, 0] }]\nholdout = true";
    let (scene, warnings) = scene(object, &places).unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    assert!(!warnings.iter().any(|warning| warning.contains("places.ply")), "{warnings:?}");
    let [a, b] = &scene.instances[..] else { panic!("two copies") };
    let corner = a.world_from_object.transform_point3(DVec3::X);
    assert!((corner - DVec3::new(1.0, 2.0, 3.0 - 22.0)).length() < 1e-9, "{corner}");
    assert_eq!([a.info.index, b.info.index], [7.0, 8.0]);
    assert_ne!(a.info.random, b.info.random);
    assert_eq!((a.name.as_str(), a.traits == b.traits), ("leaf", true));
}

/// All instances of a mesh have the materials listed by the object for its faces, and later objects their own.
#[test]
fn instances_have_the_listed_materials() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    let vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    write("leaf.ply", &format!("ply\nformat ascii 1.0\n{vertices}{faces}0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"));
    write("places.ply", &format!("ply\nformat ascii 1.0\n{vertices}end_header\n0 0 0\n2 0 0\n4 0 0\n"));
    let materials = "[materials]\na = { type = \"lambert\" }\nb = { type = \"phong\" }\n";
    let objects = "[[objects]]\nmesh = \"leaf.ply\"\nmaterials = [\"b\"]\ninstances = \"places.ply\"\n[[objects]]\nmesh = \"leaf.ply\"\nmaterials = [\"a\"]\n";
    write("scene.toml", &format!("{materials}{objects}"));
    let scene = load(folder.path().join("scene.toml"), &LoadOptions::default()).expect("loads").scene;
    let name = |i: usize| {
        let mesh = &scene.meshes[scene.instances[i].mesh.index()];
        scene.materials[mesh.parts[0].material.index()].name.as_str()
    };
    assert_eq!((0..scene.instances.len()).map(name).collect::<Vec<_>>(), ["b", "b", "b", "a"]);
}

#[test]
fn spheres_are_instanced_and_singular_transforms_dropped() {
    let still = |x: f64, scale: f64| [x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, scale, 0.0];
    let places = [still(1.0, 1.0), still(2.0, 0.0), still(3.0, 4.0)];
    let (scene, warnings) = scene("sphere = { center = [0, 1, 0], radius = 0.5 }", &places).unwrap();
    let spheres: Vec<(DVec3, f64)> = scene.shapes.iter().map(|s| (s.center, s.radius)).collect();
    assert_eq!(spheres, [(DVec3::new(1.0, 1.0, 0.0), 0.5), (DVec3::new(3.0, 4.0, 0.0), 2.0)]);
    assert_eq!(warnings.iter().filter(|warning| warning.contains("places.ply")).count(), 1, "{warnings:?}");
}

#[test]
fn unsupported_instances_are_refused() {
    let place = [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]];
    assert!(scene("quad = { corner = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }", &place).is_err());
    let moving = "sphere = { center = [0, 1, 0], radius = 0.5 }\nmotion = { keys = [{ frame = -1 }, { frame = 1, transform = [{ scale = 2 }] }] }";
    assert!(scene(moving, &place).is_err());
    assert!(scene("sphere = { center = [0, 1, 0], radius = 0.5 }", &[[f64::NAN; 9]]).is_err());
}

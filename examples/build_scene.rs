//! Builds a scene in code, without any file, and renders it: `cargo run --release --example build_scene -- picture.png`

use oscura::Renderer;
use oscura::glam::DAffine3;
use oscura::scene::{
    Aperture, Camera, Environment, Instance, Light, Material, Mesh, PbrMaterial, Quad, Scene, Shape, ThinLens,
};

fn main() -> oscura::Result<()> {
    let path = std::env::args().nth(1).unwrap_or("build_scene.png".to_string());
    let mut scene = Scene::default();

    // A material is a name and a BSDF model; glTF's is the richest.
    let clay = scene.add_material(Material::lambert("clay", [0.7, 0.65, 0.6]));
    let gold = PbrMaterial {
        base_color: [1.0, 0.77, 0.34].into(),
        metallic: 1.0.into(),
        roughness: 0.2.into(),
        ..PbrMaterial::default()
    };
    let gold = scene.add_material(Material::gltf("gold", gold));
    let lamp = scene.add_material(Material::emitter("lamp", [12.0, 10.0, 8.0], false));

    // Spheres and quads are in world space; meshes are placed by instances.
    scene.quads.push(Quad::new([-4.0, 0.0, 4.0], [8.0, 0.0, 0.0], [0.0, 0.0, -8.0], clay));
    scene.shapes.push(Shape::sphere([-1.2, 1.0, 0.0], 1.0, gold));
    scene.shapes.push(Shape::disk([0.0, 4.5, 1.0], [0.0, -1.0, 0.0], 0.8, lamp));
    let pyramid = scene.add_mesh(pyramid(clay));
    for i in 0..3 {
        let place = DAffine3::from_translation([1.0 + 0.9 * f64::from(i), 0.0, -0.7 * f64::from(i)].into());
        scene.instances.push(Instance::new(pyramid, place * DAffine3::from_rotation_y(f64::from(i))));
    }

    scene.environment = Environment::Gradient { nadir: [0.1; 3], zenith: [0.25, 0.35, 0.5] };
    scene.lights.push(Light::directional([1.0, -1.0, -0.5], [0.5; 3]));
    let lens = ThinLens { defocus_angle_rad: 0.01, focus_distance: 7.0, aperture: Aperture::default() };
    scene
        .cameras
        .push(Camera { lens: Some(lens), ..Camera::look_at([0.5, 2.0, 7.0], [0.4, 0.8, 0.0], 32.0) });

    Renderer::new(scene).size(240, 160).samples(64).render()?.save(path)?;
    Ok(())
}

/// A pyramid without base, over a unit square.
fn pyramid(material: oscura::scene::MaterialId) -> Mesh {
    let positions =
        vec![[-0.5, 0.0, 0.5], [0.5, 0.0, 0.5], [0.5, 0.0, -0.5], [-0.5, 0.0, -0.5], [0.0, 1.2, 0.0]];
    let triangles = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    Mesh::new("pyramid", positions, triangles, material)
}

//! `oscura inspect`: what is in a scene, and what would not be rendered.

use super::Outcome;
use super::args::InspectArgs;
use super::json::Json;
use super::report::print_line;
use oscura::error::{Result, Warning};
use oscura::load::{LoadOptions, load};
use oscura::math::DVec3;
use oscura::scene::{Environment, Model, Scene, Texture};

pub(crate) fn run(args: &InspectArgs) -> Result<Outcome> {
    let options = LoadOptions { allow_external: args.allow_external, ..LoadOptions::default() };
    let loaded = load(&args.scene, &options)?;
    let scene = &loaded.scene;
    if args.json {
        print_line(&to_json(scene, &loaded.warnings, &loaded.left_out).to_string());
    } else {
        print(scene, &loaded.warnings, &loaded.left_out);
    }
    Ok(Outcome::Done)
}

/// Triangles that the instances place; those of a mesh count as often as it is placed.
fn placed_triangles(scene: &Scene) -> u64 {
    scene.instances.iter().map(|i| scene.meshes[i.mesh.index()].triangles.len() as u64).sum()
}

/// The corners of the box around everything; `None` for an empty scene.
fn extent(scene: &Scene) -> Option<(DVec3, DVec3)> {
    let mut bounds: Option<(DVec3, DVec3)> = None;
    let mut grow = |p: DVec3| {
        let (low, high) = bounds.unwrap_or((p, p));
        bounds = Some((low.min(p), high.max(p)));
    };
    for instance in &scene.instances {
        for p in &scene.meshes[instance.mesh.index()].positions {
            let [x, y, z] = p.map(f64::from);
            grow(instance.world_from_object.transform_point3(DVec3::new(x, y, z)));
        }
    }
    for sphere in &scene.spheres {
        grow(sphere.center - sphere.radius);
        grow(sphere.center + sphere.radius);
    }
    for q in &scene.quads {
        [q.corner, q.corner + q.edge_u, q.corner + q.edge_v, q.corner + q.edge_u + q.edge_v]
            .into_iter()
            .for_each(&mut grow);
    }
    bounds
}

/// Which images a material or the environment reaches.
fn used_images(scene: &Scene) -> Vec<bool> {
    let mut textures = vec![false; scene.textures.len()];
    for id in scene.materials.iter().flat_map(|m| m.textures()) {
        textures[id.index()] = true;
    }
    let mut images = vec![false; scene.images.len()];
    // A texture comes after those that it is made of, so one pass backwards reaches them all.
    for (i, texture) in scene.textures.iter().enumerate().rev() {
        match *texture {
            Texture::Image { image, .. } if textures[i] => images[image.index()] = true,
            Texture::Checker { even, odd, .. } if textures[i] => {
                textures[even.index()] = true;
                textures[odd.index()] = true;
            }
            _ => {}
        }
    }
    if let Environment::Image { image, .. } = scene.environment {
        images[image.index()] = true;
    }
    images
}

fn model_name(model: &Model) -> &'static str {
    match model {
        Model::Black => "black",
        Model::Lambert { .. } => "lambert",
        Model::OrenNayar { .. } => "oren-nayar",
        Model::Phong { .. } => "phong",
        Model::Metal { .. } | Model::MeasuredMetal { .. } => "metal",
        Model::Dielectric { .. } | Model::Glass { .. } => "dielectric",
        Model::Pbr(_) => "glTF",
    }
}

fn environment_name(environment: &Environment) -> &'static str {
    match environment {
        Environment::Black => "none",
        Environment::Constant(_) => "constant",
        Environment::Gradient { .. } => "gradient",
        Environment::Image { .. } => "image",
    }
}

fn print(scene: &Scene, warnings: &[Warning], left_out: &[String]) {
    let line = |text: String| print_line(&text);
    line(scene.name.clone());
    line(format!(
        "  geometry: {} meshes placed {} times ({} triangles), {} spheres, {} quads",
        scene.meshes.len(),
        scene.instances.len(),
        placed_triangles(scene),
        scene.spheres.len(),
        scene.quads.len()
    ));
    if let Some((low, high)) = extent(scene) {
        line(format!("  extent: {low} to {high} m"));
    }
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.index()];
        line(format!(
            "    instance '{}': mesh '{}', {} triangles",
            instance.name,
            mesh.name,
            mesh.triangles.len()
        ));
    }
    line(format!("  materials: {}", scene.materials.len()));
    for m in &scene.materials {
        let emits = if m.emission.is_some() { ", emits" } else { "" };
        line(format!("    '{}': {}{emits}", m.name, model_name(&m.model)));
    }
    line(format!("  lights without a surface: {}", scene.lights.len()));
    line(format!("  environment: {}", environment_name(&scene.environment)));
    line(format!("  images: {}", scene.images.len()));
    for (image, used) in scene.images.iter().zip(used_images(scene)) {
        let used = if used { "used" } else { "not used" };
        line(format!(
            "    '{}': {} x {}, {} bytes, {used}",
            image.name,
            image.width,
            image.height,
            image.bytes()
        ));
    }
    line(format!("  cameras: {}", scene.cameras.len()));
    for (i, camera) in scene.cameras.iter().enumerate() {
        line(format!("    {i} '{}': {:?}", camera.name, camera.projection));
    }
    warnings.iter().for_each(|w| line(format!("  warning: {w}")));
    left_out.iter().for_each(|w| line(format!("  left out: {w}")));
}

fn to_json(scene: &Scene, warnings: &[Warning], left_out: &[String]) -> Json {
    let count = |n: usize| Json::Integer(n as u64);
    let images = scene.images.iter().zip(used_images(scene)).map(|(image, used)| {
        Json::Object(vec![
            ("name", Json::Text(image.name.clone())),
            ("width", Json::Integer(image.width.into())),
            ("height", Json::Integer(image.height.into())),
            ("bytes", count(image.bytes())),
            ("used", Json::Bool(used)),
        ])
    });
    let materials = scene.materials.iter().map(|m| {
        Json::Object(vec![
            ("name", Json::Text(m.name.clone())),
            ("model", Json::Text(model_name(&m.model).into())),
            ("emits", Json::Bool(m.emission.is_some())),
        ])
    });
    let extent = extent(scene).map_or(Json::Null, |(low, high)| {
        Json::List(vec![Json::decimals(&low.to_array()), Json::decimals(&high.to_array())])
    });
    Json::Object(vec![
        ("name", Json::Text(scene.name.clone())),
        ("meshes", count(scene.meshes.len())),
        ("instances", count(scene.instances.len())),
        ("triangles", Json::Integer(placed_triangles(scene))),
        ("spheres", count(scene.spheres.len())),
        ("quads", count(scene.quads.len())),
        ("extent", extent),
        ("materials", Json::List(materials.collect())),
        ("lights", count(scene.lights.len())),
        ("environment", Json::Text(environment_name(&scene.environment).into())),
        ("images", Json::List(images.collect())),
        ("cameras", Json::texts(scene.cameras.iter().map(|c| &c.name))),
        ("warnings", Json::texts(warnings)),
        ("left_out", Json::texts(left_out)),
    ])
}

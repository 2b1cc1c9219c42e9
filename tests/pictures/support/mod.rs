//! Small scenes and measured radiances for tests of light transport.
#![allow(dead_code)]

pub mod differences;
pub mod sheet;

use oscura::compile::{CompileOptions, CompiledScene, compile};
use oscura::film::Film;
use oscura::math::{DAffine3, DMat3, DVec3};
use oscura::render::{PassOutcome, RenderOptions, Rendering};
use oscura::scene::{
    Camera, ColorSlot, DiffuseTransmission, Filter, FloatSlot, FresnelModel, Instance, Material, MaterialId,
    Medium, Mesh, Model, PbrMaterial, Projection, Quad, Scene, Shape,
};
use std::sync::Arc;

/// A pinhole camera.
pub fn camera(from: DVec3, at: DVec3, up: DVec3, vfov_deg: f64) -> Camera {
    let back = (from - at).normalize();
    let right = up.cross(back).normalize();
    let rotation = DMat3::from_cols(right, back.cross(right), back);
    let place = DAffine3::from_mat3_translation(rotation, from);
    let pinhole = Camera::new(place, Projection::Perspective { vfov_rad: vfov_deg.to_radians() });
    Camera { name: "camera".into(), ..pinhole }
}

/// Options for a small picture.
pub fn options(size: u32, samples: u32, max_depth: u32) -> RenderOptions {
    RenderOptions::default()
        .size(size, size)
        .samples(samples)
        .seed(1)
        .max_depth(max_depth)
        .filter(Filter::Box)
}

/// A floor of a material, seen at one point: its origin.
pub fn floor(of: Material) -> Scene {
    let mut scene = Scene::default();
    let ground = material(&mut scene, of);
    quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], ground);
    scene.cameras.push(camera(DVec3::new(-3.0, 1.0, -2.0), DVec3::ZERO, DVec3::Y, 1e-3));
    scene
}

/// A floor of albedo 0.8.
pub fn grey_floor() -> Scene {
    floor(Material::lambert("grey", [0.8; 3]))
}

/// Compiles a scene.
pub fn compiled(scene: &Scene) -> Arc<CompiledScene> {
    Arc::new(compile(scene, &CompileOptions::default()).expect("the scene compiles").0)
}

/// Compiles a scene and prepares its first pass.
pub fn rendering(scene: &Scene, options: &RenderOptions) -> Rendering {
    Rendering::new(compiled(scene), &scene.cameras[0], *options).expect("the film fits")
}

/// Compiles and renders.
pub fn picture(scene: &Scene, options: &RenderOptions) -> Film {
    finished(rendering(scene, options))
}

/// Renders what a camera sees.
pub fn shot(compiled: &Arc<CompiledScene>, camera: &Camera, options: &RenderOptions) -> Film {
    finished(Rendering::new(compiled.clone(), camera, *options).expect("the film fits"))
}

fn finished(mut rendering: Rendering) -> Film {
    assert_eq!(rendering.run(), PassOutcome::Done);
    assert_eq!(rendering.statistics().invalid_samples, 0, "NaN or infinite samples");
    rendering.into_picture().into_film()
}

/// Mean of a film's green channel.
pub fn mean(film: &Film) -> f64 {
    let rgba = film.rgba();
    rgba.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / rgba.len() as f64
}

/// Mean radiance of a picture over independent seeds, with the standard error of that mean.
pub fn measure(scene: &Scene, options: &RenderOptions) -> (f64, f64) {
    const SEEDS: u32 = 12;
    let compiled = compiled(scene);
    let film = |seed| shot(&compiled, &scene.cameras[0], &options.seed(seed * 7919 + 1));
    let means: Vec<f64> = (0..SEEDS).map(|seed| mean(&film(seed))).collect();
    let n = f64::from(SEEDS);
    let mean = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Asserts that a measured radiance agrees with the reference: within 4.5 standard errors of a mean of 12 (a chance of about
/// 1e-3 for Student's t with 11 degrees of freedom; seeds are fixed) and f32's rounding. The standard error itself must be below
/// `precision`, which makes the test sensitive.
pub fn assert_radiance(what: &str, scene: &Scene, options: &RenderOptions, truth: f64, precision: f64) {
    let (mean, error) = measure(scene, options);
    println!("{what}: {mean:.6} +- {error:.6}, truth {truth:.6}");
    assert!(
        error <= precision * truth || error == 0.0,
        "{what}: standard error {error} is not below {precision} of {truth}"
    );
    let bound = 4.5 * error + 2e-5 * truth;
    assert!((mean - truth).abs() <= bound, "{what}: {mean} +- {error}, but the truth is {truth}");
}

/// Adds a material.
pub fn material(scene: &mut Scene, material: Material) -> MaterialId {
    scene.add_material(material)
}

/// A subsurface material with diffuse entry and exit.
pub fn translucent(scene: &mut Scene, medium: Medium) -> MaterialId {
    let (factor, white) = (FloatSlot::constant(1.0), ColorSlot::constant([1.0; 3]));
    let wax = PbrMaterial {
        metallic: FloatSlot::constant(0.0),
        specular: FloatSlot::constant(0.0),
        ior: 1.0,
        has_volume: true,
        diffuse_transmission: Some(DiffuseTransmission { factor, color: white, subsurface: None }),
        ..PbrMaterial::default()
    };
    material(scene, Material { medium: Some(medium), ..Material::gltf("wax", wax) })
}

/// Adds a quad.
pub fn quad(scene: &mut Scene, corner: [f64; 3], edge_u: [f64; 3], edge_v: [f64; 3], material: MaterialId) {
    scene.quads.push(Quad { name: "quad".into(), ..Quad::new(corner, edge_u, edge_v, material) });
}

/// An opaque glTF material.
pub fn pbr(name: &str, color: [f32; 3], metallic: f32, roughness: f32) -> Material {
    let pbr = PbrMaterial {
        base_color: ColorSlot::constant(color),
        metallic: FloatSlot::constant(metallic),
        roughness: FloatSlot::constant(roughness),
        ..PbrMaterial::default()
    };
    Material::new(name, Model::Pbr(Box::new(pbr)))
}

/// White glass of a glTF roughness, thin by default.
pub fn gltf_glass(roughness: f32) -> PbrMaterial {
    PbrMaterial {
        metallic: FloatSlot::constant(0.0),
        roughness: FloatSlot::constant(roughness),
        transmission: FloatSlot::constant(1.0),
        ..PbrMaterial::default()
    }
}

/// Smooth white glass of an index of refraction.
pub fn dielectric(ior: f32) -> Material {
    let tint = ColorSlot::constant([1.0; 3]);
    Material::new("glass", Model::Dielectric { ior, tint, fresnel: FresnelModel::Exact })
}

/// A solid of index 1 that tints light once on its whole way through.
pub fn tinted_solid(scene: &mut Scene, share: f32) -> MaterialId {
    let pbr = PbrMaterial {
        base_color: ColorSlot::constant([share; 3]),
        has_volume: true,
        tints_once: true,
        ior: 1.0,
        ..gltf_glass(0.0)
    };
    material(scene, Material::new("solid", Model::Pbr(Box::new(pbr))))
}

/// Vertices and triangles of a closed box, counter-clockwise seen from outside.
pub fn cuboid(low: [f64; 3], high: [f64; 3]) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let corner =
        |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] } as f32);
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(corner).collect(), triangles.collect())
}

/// Adds an instance of a mesh at the identity.
pub fn place(scene: &mut Scene, mesh: Mesh) {
    let mesh = scene.add_mesh(mesh);
    scene.instances.push(Instance::new(mesh, DAffine3::IDENTITY));
}

/// Adds a closed box.
pub fn block(scene: &mut Scene, low: [f64; 3], high: [f64; 3], material: MaterialId) {
    let (positions, triangles) = cuboid(low, high);
    place(scene, Mesh::new("block", positions, triangles, material));
}

/// Adds a sphere.
pub fn sphere(scene: &mut Scene, center: [f64; 3], radius: f64, material: MaterialId) {
    scene.shapes.push(Shape { name: "sphere".into(), ..Shape::sphere(center, radius, material) });
}

/// Adds a disk.
pub fn disk(scene: &mut Scene, center: [f64; 3], normal: [f64; 3], radius: f64, material: MaterialId) {
    scene.shapes.push(Shape { name: "disk".into(), ..Shape::disk(center, normal, radius, material) });
}

/// Six walls around the box from `-half` to `half`, fronts inwards (each spans corner, u, v with u x v pointing in); `of` gives
/// their materials.
pub fn walls(scene: &mut Scene, [x, y, z]: [f64; 3], mut of: impl FnMut(&mut Scene, usize) -> MaterialId) {
    let (u, v, w) = ([2.0 * x, 0.0, 0.0], [0.0, 2.0 * y, 0.0], [0.0, 0.0, 2.0 * z]);
    let faces = [
        ([-x, -y, -z], v, w),
        ([x, -y, -z], w, v),
        ([-x, -y, -z], w, u),
        ([-x, y, -z], u, w),
        ([-x, -y, -z], u, v),
        ([-x, -y, z], v, u),
    ];
    for (i, (corner, u, v)) in faces.into_iter().enumerate() {
        let material = of(scene, i);
        quad(scene, corner, u, v, material);
    }
}

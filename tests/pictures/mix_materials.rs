//! Mix materials: closed forms, and the same expected value with all techniques.

use crate::support::differences::{assert_same_bits, assert_same_means};
use crate::support::{assert_radiance, camera, dielectric, floor, material, measure, options, quad, sphere};
use oscura::math::DVec3;
use oscura::render::{Caustics, Guiding, PathReuse, Splitting};
use oscura::scene::nodes::{Node, NodeGraph, NodeInput, NodeKind};
use oscura::scene::{
    AlphaMode, ColorSlot, DiffuseTransmission, Emission, Environment, FloatSlot, Light, LightKind, Mapping,
    Material, Medium, MixComponent, Model, PbrMaterial, Scene, Texture,
};
use std::sync::Arc;

fn mix(parts: Vec<(ColorSlot, Material)>) -> Material {
    let components = parts.into_iter().map(|(weight, material)| MixComponent { weight, material }).collect();
    Material::new("mix", Model::Mix { components })
}

fn grey(albedo: f32) -> Material {
    Material::lambert("grey", [albedo; 3])
}

/// A large sheet in a uniform environment of radiance 1, seen head-on.
fn in_uniform_light(of: Material) -> Scene {
    Scene { environment: Environment::Constant([1.0; 3]), ..floor(of) }
}

#[test]
fn furnace_shows_the_weighted_sum() {
    let few = options(8, 1024, 4);
    let constant = |w: f32| ColorSlot::constant([w; 3]);
    for (weights, albedos) in [([0.5, 0.5], [0.2, 0.8]), ([0.9, 0.1], [0.1, 0.9]), ([0.3, 0.2], [0.5, 1.0])] {
        let truth: f32 = weights.iter().zip(albedos).map(|(w, a)| w * a).sum();
        let parts = weights.iter().zip(albedos).map(|(w, a)| (constant(*w), grey(a)));
        let scene = in_uniform_light(mix(parts.collect()));
        assert_radiance(&format!("{weights:?} of {albedos:?}"), &scene, &few, truth.into(), 4e-3);
    }
    // A mix of everything that reflects and transmits loses no light.
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let body = material(&mut scene, mix(vec![(constant(0.4), grey(1.0)), (constant(0.6), dielectric(1.5))]));
    sphere(&mut scene, [0.0; 3], 1.0, body);
    scene.cameras.push(camera(DVec3::new(0.3, 0.2, 5.0), DVec3::ZERO, DVec3::Y, 5.0));
    assert_radiance("diffuse and glass", &scene, &options(8, 256, 200), 1.0, 4e-3);
}

/// Light that enters a solid by one component of a mix exits through all components.
#[test]
fn subsurface_component_of_a_mix() {
    let (none, whole) = (FloatSlot::constant(0.0), FloatSlot::constant(1.0));
    let white = ColorSlot::constant([1.0; 3]);
    let model = PbrMaterial {
        metallic: none,
        specular: none,
        ior: 1.0,
        has_volume: true,
        diffuse_transmission: Some(DiffuseTransmission { factor: whole, color: white, subsurface: None }),
        ..PbrMaterial::default()
    };
    let medium = Some(Medium::subsurface([0.6; 3], [0.01; 3], 0.0));
    let wax = Material { medium, ..Material::gltf("wax", model) };
    let few = options(16, 256, 100);
    let ball = |of: Material| {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let of = material(&mut scene, of);
        sphere(&mut scene, [0.0; 3], 1.0, of);
        scene.cameras.push(camera(DVec3::new(0.3, 0.2, 5.0), DVec3::ZERO, DVec3::Y, 5.0));
        scene
    };
    let (of_wax, error_of_wax) = measure(&ball(wax.clone()), &few);
    assert!((of_wax - 0.6).abs() < 0.02, "wax: {of_wax}");
    for (share, albedo) in [(0.2, 0.9), (0.5, 0.0), (0.8, 0.3)] {
        let constant = |w: f32| ColorSlot::constant([w; 3]);
        let mixed = mix(vec![(constant(1.0 - share), grey(albedo)), (constant(share), wax.clone())]);
        let truth = f64::from(share) * of_wax + f64::from((1.0 - share) * albedo);
        let (found, error) = measure(&ball(mixed), &few);
        let error = error.hypot(f64::from(share) * error_of_wax);
        assert!(
            error < 1e-3 && (found - truth).abs() < 4.5 * error,
            "{share} of wax: {found} for {truth} +- {error}"
        );
    }
}

/// A subsurface solid and clear glass in one material: light that entered by the glass component exits by that alone, as in
/// Cycles.
#[test]
fn subsurface_and_glass_components_are_independent() {
    let (none, whole) = (FloatSlot::constant(0.0), FloatSlot::constant(1.0));
    let solid = PbrMaterial { metallic: none, has_volume: true, ..PbrMaterial::default() };
    let through =
        DiffuseTransmission { factor: whole, color: ColorSlot::constant([1.0; 3]), subsurface: None };
    let body = PbrMaterial { specular: none, ior: 1.0, diffuse_transmission: Some(through), ..solid.clone() };
    let medium = Some(Medium::subsurface([0.2, 0.5, 0.8], [0.01; 3], 0.0));
    let wax = Material { medium, ..Material::gltf("wax", body) };
    // Reflection and refraction are negligible.
    let clear = PbrMaterial { transmission: whole, roughness: none, ior: 1.0001, ..solid };
    let ball = |of: Material| {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let of = material(&mut scene, of);
        sphere(&mut scene, [0.0; 3], 1.0, of);
        scene.cameras.push(camera(DVec3::new(0.3, 0.2, 5.0), DVec3::ZERO, DVec3::Y, 5.0));
        scene
    };
    let few = options(16, 256, 100);
    let (of_wax, error_of_wax) = measure(&ball(wax.clone()), &few);
    for glass_first in [true, false] {
        let share = 0.6f32;
        let constant = |w: f32| ColorSlot::constant([w; 3]);
        let mut parts = vec![
            (constant(1.0 - share), Material::gltf("clear", clear.clone())),
            (constant(share), wax.clone()),
        ];
        if !glass_first {
            parts.reverse();
        }
        let truth = f64::from(share) * of_wax + f64::from((1.0 - share) * (1.0 - share));
        let (found, error) = measure(&ball(mix(parts)), &few);
        let error = error.hypot(f64::from(share) * error_of_wax);
        assert!(
            error < 2e-3 && (found - truth).abs() < 4.5 * error + 2e-3,
            "glass first {glass_first}: {found} for {truth} +- {error}"
        );
    }
}

/// Weights may depend on the hit: the normal of a horizontal sheet is (0, 1, 0), so it reflects green.
#[test]
fn weights_may_depend_on_the_normal() {
    let mut scene = in_uniform_light(grey(0.0));
    let node = Node { kind: NodeKind::Geometry {}, inputs: Vec::new(), image: None, reads_alpha: false };
    let outputs = node.kind.outputs();
    let output = outputs.iter().position(|socket| socket.name == "normal").expect("an output");
    let result = NodeInput::Link { node: 0, output };
    let graph = NodeGraph { nodes: vec![node], result, is_z_up: false };
    let weight = ColorSlot::texture(scene.add_texture(Texture::Nodes(Arc::new(graph))));
    scene.materials[0] = mix(vec![(weight, grey(0.5))]);
    assert_radiance("normals as weights", &scene, &options(8, 64, 4), 0.5, 1e-3);
}

/// Emission and alpha of a material apply to the mix as a whole, independent of the weights.
#[test]
fn emission_and_alpha_apply_to_the_whole_mix() {
    let constant = |w: f32| ColorSlot::constant([w; 3]);
    let both = || mix(vec![(constant(0.5), grey(0.2)), (constant(0.25), grey(0.8))]);
    let emission = Some(Emission { radiance: ColorSlot::constant([0.5; 3]), two_sided: true });
    let emissive = in_uniform_light(Material { emission, ..both() });
    assert_radiance("emissive", &emissive, &options(8, 1024, 4), 0.5 + 0.3, 4e-3);
    let alpha = FloatSlot::constant(0.25);
    let absent = in_uniform_light(Material { alpha, alpha_mode: AlphaMode::Blend, emission, ..both() });
    assert_radiance("absent", &absent, &options(8, 4096, 4), 0.75 + 0.25 * (0.5 + 0.3), 4e-3);
}

/// Textured weights: checker cells that each select one material.
fn room() -> Scene {
    let mut scene = floor(grey(0.5));
    let solid = |value: f32| Texture::Solid([value; 3]);
    let [a, b] = [0.9, 0.1].map(|value| scene.add_texture(solid(value)));
    let cells = |even, odd| Texture::Checker { even, odd, cell_size: 0.25, mapping: Mapping::World };
    let (first, second) = (scene.add_texture(cells(a, b)), scene.add_texture(cells(b, a)));
    let parts = vec![(ColorSlot::texture(first), grey(0.8)), (ColorSlot::texture(second), dielectric(1.5))];
    let mixed = material(&mut scene, mix(parts));
    sphere(&mut scene, [0.0, 1.0, 0.0], 0.8, mixed);
    let lamp = material(&mut scene, Material::emitter("lamp", [20.0; 3], true));
    quad(&mut scene, [-0.5, 4.0, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], lamp);
    let position = DVec3::new(2.0, 3.0, 1.0);
    scene.lights.push(Light::new(LightKind::Point { position }, [5.0; 3]));
    scene.environment = Environment::Constant([0.2; 3]);
    scene.cameras = vec![camera(DVec3::new(0.0, 2.0, 5.0), DVec3::new(0.0, 0.8, 0.0), DVec3::Y, 40.0)];
    scene
}

#[test]
fn techniques_agree_on_mixes() {
    techniques_agree(&["split", "caustics"]);
    assert_same_bits("mixes", &room(), &options(24, 4, 8));
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn all_techniques_agree_on_mixes() {
    techniques_agree(&["shared", "guided"]);
}

fn techniques_agree(names: &[&str]) {
    let scene = room();
    let plain = options(24, 512, 200).path_reuse(PathReuse::Off).splitting(Splitting::OFF);
    let plain = plain.caustics(Caustics::Off).guiding(Guiding::Off);
    for (what, other) in [
        ("split", plain.splitting(Splitting::Into(4))),
        ("shared", plain.path_reuse(PathReuse::Groups("4x4/2".parse().expect("a shape")))),
        ("guided", plain.guiding(Guiding::On)),
        ("caustics", plain.caustics(Caustics::On)),
    ] {
        if names.contains(&what) {
            assert_same_means(what, &scene, [&plain, &other], 16);
        }
    }
}

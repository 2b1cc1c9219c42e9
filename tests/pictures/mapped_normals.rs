//! Normal inputs of node graphs that tilt away from the viewer, point into the surface, or vary over coarse triangles.

use crate::shadow_terminator::ball;
use crate::support::{floor, mean, measure, options, picture};
use oscura::film::Film;
use oscura::scene::nodes::{Node, NodeGraph, NodeInput, NodeKind, VectorOperation};
use oscura::scene::{Clearcoat, ColorSlot, FloatSlot, Light, Material, Model, PbrMaterial, Scene, Texture};
use std::sync::Arc;

/// A floor with a constant shading normal. The viewer is at (-3, 1, -2).
fn shaded(material: Material, normal: [f32; 3]) -> Scene {
    let mut scene = floor(material);
    let none = NodeInput::Value([0.0; 3]);
    let inputs = vec![NodeInput::Value(normal), none, none, none];
    let kind = NodeKind::VectorMath { operation: VectorOperation::Add };
    let nodes = vec![Node { kind, inputs, image: None, reads_alpha: false }];
    let graph = NodeGraph { nodes, result: NodeInput::Link { node: 0, output: 0 }, is_z_up: false };
    let normal = scene.add_texture(Texture::Nodes(Arc::new(graph)));
    scene.materials[0].normal = Some(normal);
    scene.lights.push(Light::point([2.0, 3.0, 1.0], [20.0; 3]));
    scene.lights.push(Light::point([-2.0, 2.0, 1.0], [20.0; 3]));
    scene
}

fn faint(change: impl Fn(&mut PbrMaterial)) -> Material {
    let mut pbr = PbrMaterial {
        base_color: ColorSlot::constant([0.6; 3]),
        metallic: FloatSlot::constant(0.0),
        roughness: FloatSlot::constant(1.0),
        specular: FloatSlot::constant(1e-4),
        ..PbrMaterial::default()
    };
    change(&mut pbr);
    Material::new("faint", Model::Pbr(Box::new(pbr)))
}

/// A layer of negligible reflectance doesn't bend the normal of the diffuse base towards the viewer.
#[test]
fn diffuse_base_keeps_its_mapped_normal() {
    let few = options(4, 2048, 1);
    let coat = || {
        let (factor, roughness) = (FloatSlot::constant(1e-4), FloatSlot::constant(1.0));
        Some(Clearcoat { factor, roughness, normal_map: None })
    };
    let materials = [
        ("layer", faint(|_| ())),
        ("coat", faint(|pbr| pbr.clearcoat = coat())),
        ("rough", faint(|pbr| pbr.diffuse_roughness = FloatSlot::constant(1e-3))),
        ("rough alone", {
            let (color, roughness) = (ColorSlot::constant([0.6; 3]), FloatSlot::constant(1e-3));
            Material::new("rough", Model::OrenNayar { color, roughness })
        }),
    ];
    for normal in [[3.0, 2.0, 2.0], [1.0, 1.0, 1.0], [-1.0, 2.0, 0.5]] {
        let truth = mean(&picture(&shaded(Material::lambert("matt", [0.6; 3]), normal), &few));
        assert!(truth > 0.01, "{truth}");
        for (what, material) in &materials {
            let (found, error) = measure(&shaded(material.clone(), normal), &few);
            let most = 4.5 * error + 2e-3 * truth;
            assert!((found - truth).abs() < most, "{what}, {normal:?}: {found} for {truth} +- {error}");
        }
    }
}

/// As in Cycles, a normal that points into the surface makes diffuse reflection black; normals need not be normalised.
#[test]
fn inward_normals_are_black_and_lengths_are_ignored() {
    let few = options(4, 256, 1);
    let seen = |normal| mean(&picture(&shaded(Material::lambert("matt", [0.6; 3]), normal), &few));
    assert_eq!(seen([1.0, -0.1, 0.0]), 0.0);
    assert_eq!(seen([0.0, -1.0, 0.0]), 0.0);
    let unit = seen([0.6, 0.8, 0.0]);
    for length in [0.1, 3.0] {
        assert!((seen([0.6 * length, 0.8 * length, 0.0]) / unit - 1.0).abs() < 1e-5);
    }
    assert!((seen([0.0, 1.0, 0.0]) / unit - 1.0).abs() > 0.05, "{unit}");
}

/// A coarse sphere with smooth vertex normals, shaded with normals tilted off the smooth ones.
fn leaning_ball(rings: u32) -> Scene {
    let mut scene = ball(rings, 2 * rings);
    let none = NodeInput::Value([0.0; 3]);
    let lean = NodeInput::Value([0.35, 0.4, -0.3]);
    let normal = NodeInput::Link { node: 0, output: 2 };
    let add = NodeKind::VectorMath { operation: VectorOperation::Add };
    let geometry = NodeKind::from_name("geometry").expect("a node");
    let nodes = vec![
        Node { kind: geometry, inputs: Vec::new(), image: None, reads_alpha: false },
        Node { kind: add, inputs: vec![normal, lean, none, none], image: None, reads_alpha: false },
    ];
    let graph = NodeGraph { nodes, result: NodeInput::Link { node: 1, output: 0 }, is_z_up: false };
    let normal = scene.add_texture(Texture::Nodes(Arc::new(graph)));
    scene.materials[0].normal = Some(normal);
    scene
}

/// Bumps are relative to the smooth normal: the triangles don't show.
#[test]
fn mapped_normals_hide_tessellation() {
    let few = options(24, 64, 1);
    let shown = |rings: u32| {
        let mut scene = leaning_ball(rings);
        scene.lights.push(Light::directional([-0.8, -0.5, 0.3], [3.0; 3]));
        picture(&scene, &few)
    };
    let (coarse, fine) = (shown(10), shown(80));
    let inner = (6..18).flat_map(|y| (6..18).map(move |x| (x, y)));
    let of = |film: &Film, (x, y)| f64::from(film.mean_rgba(x, y)[1]);
    let worst = inner.map(|at| (of(&coarse, at) / of(&fine, at) - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 0.03, "{worst}");
}

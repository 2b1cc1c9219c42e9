use super::*;
use crate::image::{Encoding, Image, Pixels};
use crate::math::Vec3;
use crate::scene::{Interpolation, Mapping, Material, Shape, Texture, TextureTransform, Wrap};
use std::sync::Arc;

/// A material displaced by heights on a square of `n` texels, of `scale` over `midlevel`.
fn displaced_by(scene: &mut Scene, n: u32, edge: f32, height: impl Fn(u32, u32) -> f32) -> MaterialId {
    let texels = (0..n * n).map(|i| height(i % n, i / n)).collect();
    let image = scene.add_image(Image {
        name: "heights".into(),
        width: n,
        height: n,
        channels: 1,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::F32(texels)),
    });
    let transform = TextureTransform::default();
    scene.textures.push(Texture::Image {
        image,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Repeat,
        interpolation: Interpolation::Bilinear,
        mapping: Mapping::Uv { set: 0, transform },
    });
    let texture = (crate::scene::TextureId(scene.textures.len() as u32 - 1), 0);
    let displacement = Some(Displacement { texture, scale: 0.5, midlevel: 0.25, edge });
    scene.add_material(Material { displacement, ..Material::lambert("rock", [0.5; 3]) })
}

fn applied(scene: Scene) -> Loaded {
    let mut loaded = Loaded::from(scene);
    apply(&mut loaded);
    assert!(loaded.scene.materials.iter().all(|m| m.displacement.is_none()));
    assert!(loaded.scene.validate().is_empty(), "{:?}", loaded.scene.validate());
    loaded
}

fn vertex(mesh: &Mesh, v: u32) -> Vec3 {
    Vec3::from_array(mesh.positions[v as usize])
}

/// A quad of 2 x 1 under a ramp along u: between the middles of the outer texels the surface is a plane, with its slope and normal.
#[test]
fn a_ramp_tilts_a_quad() {
    let mut scene = Scene::default();
    let n = 16;
    let rock = displaced_by(&mut scene, n, 0.05, |x, _| (x as f32 + 0.5) / 16.0);
    scene.quads.push(Quad::new([1.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -1.0], rock));
    let loaded = applied(scene);
    assert!(loaded.warnings.is_empty() && loaded.scene.quads.is_empty());
    let instance = &loaded.scene.instances[0];
    let mesh = &loaded.scene.meshes[instance.mesh.index()];
    assert!(mesh.triangles.len() > 800, "{} triangles", mesh.triangles.len());
    let slope = Vec3::new(-0.25, 1.0, 0.0).normalize();
    for (v, (p, normal)) in mesh.positions.iter().zip(&mesh.normals).enumerate() {
        let u = f64::from(p[0]) / 2.0;
        let height = (u.clamp(0.5 / 16.0, 15.5 / 16.0) - 0.25) * 0.5;
        assert!((f64::from(p[1]) - height).abs() < 1e-6, "{p:?} {height}");
        let is_inner = (0.1..0.9).contains(&u) && (-0.95..-0.05).contains(&p[2]);
        let normal = Vec3::from_array(*normal);
        assert!(!is_inner || normal.distance(slope) < 1e-4, "{v}: {p:?} {normal}");
    }
}

#[test]
fn no_edge_is_longer_than_wanted_and_no_crack_opens() {
    let mut scene = Scene::default();
    let rock = displaced_by(&mut scene, 32, 0.11, |x, y| ((x * 7 + y * 5) % 11) as f32 / 11.0);
    // A cube with vertices of its own for each face, as hard edges need.
    let (mut positions, mut normals, mut uv) = (Vec::new(), Vec::new(), Vec::new());
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let first = positions.len() as u32;
            for [a, b] in [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, a * side, b);
                let mut normal = [0.0; 3];
                normal[axis] = side;
                positions.push(p);
                normals.push(normal);
                uv.push([0.5 * a + 0.5, 0.5 * b + 0.5]);
            }
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    let mesh = Mesh { normals, uv_sets: vec![uv], ..Mesh::new("cube", positions, triangles, rock) };
    let (fine, longest) = subdivide::subdivided(&mesh, &[Some(0.11)], usize::MAX);
    assert!(longest.is_none());
    for t in &fine.triangles {
        for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
            assert!(vertex(&fine, a).distance(vertex(&fine, b)) <= 0.11001);
        }
    }
    let id = scene.add_mesh(mesh);
    scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
    scene.instances.push(Instance::new(id, DAffine3::from_translation(DVec3::X * 5.0)));
    let loaded = applied(scene);
    assert_eq!(loaded.scene.instances[0].mesh, loaded.scene.instances[1].mesh, "made once");
    let mesh = &loaded.scene.meshes[loaded.scene.instances[0].mesh.index()];
    assert_eq!(mesh.triangles.len(), fine.triangles.len());
    // Closed: every edge, by the places of its ends, has a twin the other way.
    let mut open: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    for t in &mesh.triangles {
        for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
            let [a, b] = [a, b].map(|v| vertex(mesh, v).to_array().map(f32::to_bits));
            *open.entry([a, b]).or_default() += 1;
            *open.entry([b, a]).or_default() -= 1;
        }
    }
    assert!(open.values().all(|&count| count == 0), "cracks");
}

#[test]
fn the_limit_of_triangles_is_kept_and_told() {
    let mut scene = Scene::default();
    let rock = displaced_by(&mut scene, 4, 0.1, |_, _| 1.0);
    let mesh = Mesh::new("sheet", vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], rock);
    let (fine, longest) = subdivide::subdivided(&mesh, &[Some(1e-3)], 5000);
    assert!(fine.triangles.len() <= 5000 && fine.triangles.len() > 1000);
    assert!(longest.is_some_and(|longest| (0.01..0.1).contains(&longest)), "{longest:?}");
}

#[test]
fn what_can_not_be_displaced_is_told() {
    let mut scene = Scene::default();
    let rock = displaced_by(&mut scene, 4, 0.1, |_, _| 1.0);
    let sheet = Mesh::new("sheet", vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], rock);
    let id = scene.add_mesh(sheet);
    scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
    scene.shapes.push(Shape::sphere([0.0; 3], 1.0, rock));
    let loaded = applied(scene);
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let all = warnings.join("\n");
    assert!(all.contains("no texture coordinates") && all.contains("no spheres"), "{all}");
    assert_eq!(loaded.scene.instances[0].mesh, id);
}

/// Neighbouring numbers at 1e8 are 8 apart: an edge between them has no middle, and is left as it is.
#[test]
fn edges_without_a_middle_are_left() {
    let positions = vec![[1e8, 0.0, 0.0], [1e8 + 32.0, 0.0, 0.0], [1e8, 0.0, 1e-3]];
    let rock = displaced_by(&mut Scene::default(), 4, 1.0, |_, _| 1.0);
    let mesh = Mesh::new("far", positions, vec![[0, 1, 2]], rock);
    let (fine, longest) = subdivide::subdivided(&mesh, &[Some(1.0)], 10_000);
    assert!(longest.is_none() && (4..100).contains(&fine.triangles.len()), "{}", fine.triangles.len());
    let steps = fine.positions.iter().map(|p| (p[0] - 1e8) / 8.0);
    assert_eq!(steps.clone().fold(0.0, f32::max), 4.0);
    assert!([0.0, 1.0, 2.0, 3.0].iter().all(|n| steps.clone().any(|step| step == *n)));
}

/// The sides of a card share their places, and their normals cancel: each goes its own way.
#[test]
fn both_sides_of_a_card_are_displaced() {
    let mut scene = Scene::default();
    let rock = displaced_by(&mut scene, 4, 10.0, |_, _| 1.0);
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let normals = [[0.0, 0.0, 1.0]; 4].into_iter().chain([[0.0, 0.0, -1.0]; 4]).collect();
    let uv = vec![[0.5, 0.5]; 8];
    let triangles = vec![[0, 1, 2], [0, 2, 3], [6, 5, 4], [7, 6, 4]];
    let mesh = Mesh::new("card", [square, square].concat(), triangles, rock);
    let id = scene.add_mesh(Mesh { normals, uv_sets: vec![uv], ..mesh });
    scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
    let loaded = applied(scene);
    let mesh = &loaded.scene.meshes[loaded.scene.instances[0].mesh.index()];
    let heights: Vec<f32> = mesh.positions.iter().map(|p| p[2]).collect();
    assert_eq!(heights, [0.375, 0.375, 0.375, 0.375, -0.375, -0.375, -0.375, -0.375]);
}

/// Edges that no number of triangles reaches are told at once.
#[test]
fn edges_that_are_far_too_short() {
    let mut scene = Scene::default();
    let rock = displaced_by(&mut scene, 4, 1e-6, |x, _| x as f32 / 4.0);
    scene.quads.push(Quad::new([0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], rock));
    let loaded = applied(scene);
    let told: Vec<String> = loaded.warnings.iter().map(|w| w.message.clone()).collect();
    assert!(told.iter().any(|w| w.contains("at least") && w.contains("is possible")), "{told:?}");
    let triangles: usize = loaded.scene.meshes.iter().map(|mesh| mesh.triangles.len()).max().unwrap_or(0);
    assert!((10_000..1_000_000).contains(&triangles), "{triangles}");
}

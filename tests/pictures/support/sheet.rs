//! A textured sheet.

use super::{camera, material};
use oscura::image::Image;
use oscura::math::{DAffine3, DVec3, Vec3};
use oscura::scene::{
    ColorSlot, Emission, Environment, FloatSlot, ImageId, Instance, Interpolation, Mapping, Material, Mesh,
    MeshId, MeshPart, Model, NormalMap, PbrMaterial, Scene, Texture, TextureId,
};

const CELLS: u32 = 12;

/// How the surface is described.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// With white vertex colours.
    pub colored: bool,
    /// With shading normals.
    pub smooth: bool,
    /// With tangents.
    pub tangents: bool,
    /// Texture coordinates are mirrored.
    pub mirrored: bool,
    /// The camera sees the back face.
    pub from_behind: bool,
    /// Common to all its pictures.
    pub interpolation: Interpolation,
}

impl Variant {
    /// The front of one with shading normals and tangents.
    pub const SMOOTH: Variant = Variant {
        colored: false,
        smooth: true,
        tangents: true,
        mirrored: false,
        from_behind: false,
        interpolation: Interpolation::Trilinear,
    };
}

/// A wavy sheet over -1..1 in x and y.
fn sheet(variant: &Variant) -> Mesh {
    let (mut positions, mut normals, mut uv, mut tangents) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let side = if variant.mirrored { -1.0f32 } else { 1.0 };
    for j in 0..=CELLS {
        for i in 0..=CELLS {
            let (s, t) = (i as f32 / CELLS as f32, j as f32 / CELLS as f32);
            let (x, y) = (2.0 * s - 1.0, 2.0 * t - 1.0);
            positions.push([x, y, 0.1 * (5.0 * x).sin() + 0.1 * (4.0 * y).cos()]);
            let (dx, dy) = (0.5 * (5.0 * x).cos(), -0.4 * (4.0 * y).sin());
            let normal = Vec3::new(-dx, -dy, 1.0).normalize();
            normals.push(normal.to_array());
            uv.push([side * 1.7 * s + 0.3 * t, -1.3 * t]);
            let tangent = Vec3::new(side, 0.0, side * dx).normalize();
            let tangent = (tangent - normal * normal.dot(tangent)).normalize();
            tangents.push([tangent.x, tangent.y, tangent.z, side]);
        }
    }
    let corner = |i: u32, j: u32| j * (CELLS + 1) + i;
    let triangles: Vec<[u32; 3]> = (0..CELLS * CELLS)
        .map(|k| (k % CELLS, k / CELLS))
        .flat_map(|(i, j)| {
            let (a, b, c, d) = (corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1));
            [[a, b, d], [a, d, c]]
        })
        .collect();
    let count = positions.len();
    Mesh {
        name: "sheet".into(),
        positions,
        parts: vec![MeshPart {
            first_triangle: 0,
            triangle_count: triangles.len() as u32,
            material: oscura::scene::MaterialId(0),
        }],
        triangles,
        normals: if variant.smooth { normals } else { Vec::new() },
        uv_sets: vec![uv],
        tangents: if variant.tangents { tangents } else { Vec::new() },
        colors: if variant.colored { vec![[1.0; 4]; count] } else { Vec::new() },
        ..Mesh::default()
    }
}

/// A textured, bumpy, partly emissive sheet under a sky, with a camera.
pub fn scene(variant: &Variant) -> Scene {
    let mut scene = Scene {
        environment: Environment::Gradient { nadir: [0.2, 0.1, 0.1], zenith: [1.0, 1.5, 2.0] },
        ..Scene::default()
    };
    let mut texture = |name: &str, value: &dyn Fn(u32) -> [f32; 3]| {
        let rgb = (0..16 * 16).flat_map(value).collect();
        scene.images.push(Image::from_linear_rgb(name, 16, 16, rgb));
        scene.textures.push(Texture::Image {
            image: ImageId(scene.images.len() as u32 - 1),
            wrap_u: Default::default(),
            wrap_v: Default::default(),
            interpolation: variant.interpolation,
            mapping: Mapping::Uv { set: 0, transform: Default::default() },
        });
        TextureId(scene.textures.len() as u32 - 1)
    };
    let share = |k: u32, of: u32| ((k * 7919 + of * 104_729) % 97) as f32 / 96.0;
    let base = texture("base", &|k| [share(k, 1), share(k, 2), share(k, 3)]);
    let rough = texture("rough", &|k| [0.0, 0.2 + 0.8 * share(k, 4), share(k, 5)]);
    let bumps = texture("bumps", &|k| [0.3 + 0.4 * share(k, 6), 0.3 + 0.4 * share(k, 7), 0.9]);
    let glow = texture("glow", &|k| [share(k, 8).powi(8); 3]);
    let pbr = PbrMaterial {
        base_color: ColorSlot::texture(base),
        roughness: FloatSlot { factor: 1.0, texture: Some((rough, 1)) },
        metallic: FloatSlot { factor: 1.0, texture: Some((rough, 2)) },
        ..PbrMaterial::default()
    };
    let mut painted = Material::new("painted", Model::Pbr(Box::new(pbr)));
    painted.use_vertex_colors = variant.colored;
    painted.normal_map = Some(NormalMap { texture: bumps, scale: 0.8 });
    painted.emission = Some(Emission { radiance: ColorSlot::texture(glow), two_sided: false });
    material(&mut scene, painted);
    scene.meshes.push(sheet(variant));
    scene.instances.push(Instance { name: "sheet".into(), ..Instance::new(MeshId(0), DAffine3::IDENTITY) });
    let z = if variant.from_behind { -2.0 } else { 2.0 };
    scene.cameras.push(camera(DVec3::new(0.4, 0.7, z), DVec3::ZERO, DVec3::Y, 60.0));
    scene
}

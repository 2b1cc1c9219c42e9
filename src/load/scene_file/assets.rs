//! Mesh files that a scene file refers to: each is read once, however often it is placed.

use super::Build;
use crate::error::Result;
use crate::load::{Loaded, gltf, obj, ply};
use crate::scene::{Camera, Instance, MaterialId, MeshId, Scene, Texture, TextureId};
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What a mesh file brought.
#[derive(Clone, Default)]
struct Asset {
    /// Its placements, by the ids of the whole scene.
    instances: Vec<Instance>,
    cameras: Vec<Camera>,
}

/// The mesh files read so far; `None` for those with problems.
#[derive(Default)]
pub(super) struct Assets {
    files: HashMap<PathBuf, Option<Asset>>,
}

impl Assets {
    /// The placements of a file's meshes; `None` where it has problems, which have been noted.
    pub fn instances(&mut self, build: &mut Build, name: &str, span: Range<usize>) -> Option<&[Instance]> {
        self.asset(build, name, span).map(|a| a.instances.as_slice())
    }

    /// The cameras of a file.
    pub fn cameras(&mut self, build: &mut Build, name: &str, span: Range<usize>) -> Option<Vec<Camera>> {
        self.asset(build, name, span).map(|a| a.cameras.clone())
    }

    fn asset(&mut self, build: &mut Build, name: &str, span: Range<usize>) -> Option<&Asset> {
        let path = build.file.parent().unwrap_or(build.file).join(name);
        let key = path.canonicalize().unwrap_or_else(|_| path.clone());
        let entry = self.files.entry(key).or_insert_with(|| match read(&path, build) {
            Ok(loaded) => Some(absorb(build, loaded)),
            Err(e) => {
                for problem in &e.problems {
                    build.problems.push(span.clone(), format!("'{name}': {problem}"));
                }
                None
            }
        });
        entry.as_ref()
    }
}

fn read(path: &Path, build: &Build) -> Result<Loaded> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "gltf" | "glb" => gltf::load(path, build.options),
        "obj" => obj::load(path, build.options),
        "ply" => ply::load(path, build.options),
        _ => {
            Err(crate::error::Error::input(path, "is no mesh file")
                .with_help("use .gltf, .glb, .obj or .ply"))
        }
    }
}

/// Moves a file's meshes, materials, textures and images into the scene.
fn absorb(build: &mut Build, mut loaded: Loaded) -> Asset {
    build.loaded.warnings.append(&mut loaded.warnings);
    build.loaded.left_out.append(&mut loaded.left_out);
    let Scene { meshes, instances, materials, textures, images, cameras, .. } = loaded.scene;
    let scene = &mut build.loaded.scene;
    let shift = Shift {
        mesh: scene.meshes.len() as u32,
        material: scene.materials.len() as u32,
        texture: scene.textures.len() as u32,
        image: scene.images.len() as u32,
    };
    scene.images.extend(images);
    scene.textures.extend(textures.into_iter().map(|t| shift.texture(t)));
    for mut material in materials {
        material.for_each_texture(&mut |id: &mut TextureId| id.0 += shift.texture);
        scene.materials.push(material);
    }
    for mut mesh in meshes {
        mesh.parts.iter_mut().for_each(|p| p.material.0 += shift.material);
        scene.meshes.push(mesh);
    }
    let instances = instances.into_iter().map(|i| Instance {
        mesh: MeshId(i.mesh.0 + shift.mesh),
        material: i.material.map(|m| MaterialId(m.0 + shift.material)),
        ..i
    });
    Asset { instances: instances.collect(), cameras }
}

/// What is added to each kind of id.
struct Shift {
    mesh: u32,
    material: u32,
    texture: u32,
    image: u32,
}

impl Shift {
    fn texture(&self, mut texture: Texture) -> Texture {
        match &mut texture {
            Texture::Image { image, .. } => image.0 += self.image,
            Texture::Checker { even, odd, .. } => {
                even.0 += self.texture;
                odd.0 += self.texture;
            }
            Texture::Solid(_) | Texture::Normal | Texture::Noise { .. } => {}
        }
        texture
    }
}

impl crate::scene::Material {
    /// Lets `change` rewrite every texture id of the material.
    fn for_each_texture(&mut self, change: &mut dyn FnMut(&mut TextureId)) {
        use crate::scene::{ColorSlot, FloatSlot, Model};
        let mut colors: Vec<&mut ColorSlot> = Vec::new();
        let mut floats: Vec<&mut FloatSlot> = vec![&mut self.alpha];
        match &mut self.model {
            Model::Black => {}
            Model::Lambert { albedo } => colors.push(albedo),
            Model::Metal { color, roughness } => {
                colors.push(color);
                floats.push(roughness);
            }
            Model::Dielectric { tint, .. } => colors.push(tint),
            Model::Pbr(p) => {
                let p = &mut **p;
                colors.extend([&mut p.base_color, &mut p.specular_color]);
                floats.extend([&mut p.metallic, &mut p.roughness, &mut p.specular, &mut p.transmission]);
            }
        }
        colors.extend(self.emission.iter_mut().map(|e| &mut e.radiance));
        colors.into_iter().filter_map(|c| c.texture.as_mut()).for_each(&mut *change);
        floats.into_iter().filter_map(|f| f.texture.as_mut()).for_each(|(id, _)| change(id));
        if let Some(n) = &mut self.normal_map {
            change(&mut n.texture);
        }
    }
}

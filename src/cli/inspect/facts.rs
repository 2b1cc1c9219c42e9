//! Counts and sizes of a scene.

use oscura::scene::{Environment, Instance, Material, MaterialId, Scene, Texture};

/// Triangles that the instances place; those of a mesh count as often as it is placed.
pub fn placed_triangles(scene: &Scene) -> u64 {
    scene.instances.iter().map(|i| scene.meshes[i.mesh.index()].triangles.len() as u64).sum()
}

/// The materials of an instance, each once.
pub fn instance_materials(scene: &Scene, instance: &Instance) -> Vec<MaterialId> {
    if let Some(material) = instance.material {
        return vec![material];
    }
    let mut ids: Vec<MaterialId> = Vec::new();
    for part in &scene.meshes[instance.mesh.index()].parts {
        if !ids.contains(&part.material) {
            ids.push(part.material);
        }
    }
    ids
}

/// Which materials something uses.
pub fn used_materials(scene: &Scene) -> Vec<bool> {
    let mut used = vec![false; scene.materials.len()];
    let surfaces = scene.shapes.iter().map(|s| s.material).chain(scene.quads.iter().map(|q| q.material));
    let surfaces = surfaces.chain(scene.curves.iter().map(|c| c.material));
    let instances = scene.instances.iter().flat_map(|i| instance_materials(scene, i));
    for id in surfaces.chain(instances) {
        used[id.index()] = true;
    }
    used
}

/// Which images a material in use or the environment reaches.
pub fn used_images(scene: &Scene) -> Vec<bool> {
    let used = used_materials(scene);
    let materials = scene.materials.iter().zip(used).filter(|(_, used)| *used);
    let mut images = vec![false; scene.images.len()];
    for (material, _) in materials {
        for image in material_images(scene, material) {
            images[image] = true;
        }
    }
    if let Environment::Image { image, .. } = scene.environment {
        images[image.index()] = true;
    }
    images
}

/// The images that a material reaches, by index, each once and in order.
pub fn material_images(scene: &Scene, material: &Material) -> Vec<usize> {
    let mut textures = vec![false; scene.textures.len()];
    for id in material.textures() {
        textures[id.index()] = true;
    }
    let mut images = Vec::new();
    // A texture comes after those that it is made of, so one pass backwards reaches them all.
    for (i, texture) in scene.textures.iter().enumerate().rev() {
        match *texture {
            Texture::Image { image, .. } if textures[i] => images.push(image.index()),
            Texture::Checker { even, odd, .. } if textures[i] => {
                textures[even.index()] = true;
                textures[odd.index()] = true;
            }
            Texture::Mix { a, b, factor } if textures[i] => {
                for part in [a, b, factor] {
                    textures[part.index()] = true;
                }
            }
            _ => {}
        }
    }
    images.sort_unstable();
    images.dedup();
    images
}

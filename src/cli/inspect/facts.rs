//! Counts and sizes of a scene.

use oscura::math::DVec3;
use oscura::scene::{Environment, Instance, Material, MaterialId, Scene, Texture};

/// Vertices of one mesh, over all its placements, that are looked at; beyond, the corners of its box stand for them.
const MOST_VERTICES: usize = 20_000_000;

/// Triangles that the instances place; those of a mesh count as often as it is placed.
pub fn placed_triangles(scene: &Scene) -> u64 {
    scene.instances.iter().map(|i| scene.meshes[i.mesh.index()].triangles.len() as u64).sum()
}

/// A box around points; `None` before the first.
#[derive(Clone, Copy, Default)]
pub struct Extent(pub Option<(DVec3, DVec3)>);

impl Extent {
    fn grow(&mut self, p: DVec3) {
        let (low, high) = self.0.unwrap_or((p, p));
        self.0 = Some((low.min(p), high.max(p)));
    }

    fn join(&mut self, other: Extent) {
        if let Some((low, high)) = other.0 {
            self.grow(low);
            self.grow(high);
        }
    }
}

/// The box around each instance, in world space.
pub fn instance_extents(scene: &Scene) -> Vec<Extent> {
    let mut placements = vec![0usize; scene.meshes.len()];
    for instance in &scene.instances {
        placements[instance.mesh.index()] += 1;
    }
    let corners: Vec<Vec<DVec3>> = scene
        .meshes
        .iter()
        .zip(&placements)
        .map(|(mesh, &times)| {
            let points = mesh.positions.iter().map(|p| DVec3::from(p.map(f64::from)));
            if mesh.positions.len().saturating_mul(times) <= MOST_VERTICES {
                return points.collect();
            }
            let mut extent = Extent::default();
            points.for_each(|p| extent.grow(p));
            extent.0.map_or(Vec::new(), |(low, high)| box_corners(low, high))
        })
        .collect();
    let of = |i: &Instance| {
        let mut extent = Extent::default();
        corners[i.mesh.index()].iter().for_each(|&p| extent.grow(i.world_from_object.transform_point3(p)));
        extent
    };
    scene.instances.iter().map(of).collect()
}

fn box_corners(low: DVec3, high: DVec3) -> Vec<DVec3> {
    let pick = |bits: u32, k: usize| if bits >> k & 1 == 0 { low[k] } else { high[k] };
    (0..8).map(|bits| DVec3::new(pick(bits, 0), pick(bits, 1), pick(bits, 2))).collect()
}

/// The box around everything.
pub fn scene_extent(scene: &Scene, instances: &[Extent]) -> Extent {
    let mut all = Extent::default();
    instances.iter().for_each(|e| all.join(*e));
    for sphere in &scene.spheres {
        all.grow(sphere.center - sphere.radius);
        all.grow(sphere.center + sphere.radius);
    }
    for q in &scene.quads {
        [q.corner, q.corner + q.edge_u, q.corner + q.edge_v, q.corner + q.edge_u + q.edge_v]
            .into_iter()
            .for_each(|p| all.grow(p));
    }
    all
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
    let surfaces = scene.spheres.iter().map(|s| s.material).chain(scene.quads.iter().map(|q| q.material));
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
            _ => {}
        }
    }
    images.sort_unstable();
    images.dedup();
    images
}

//! Checks that the lists of a scene refer to each other correctly. Loaders run it last, so that the stages after them
//! need no checks.

use super::{MaterialId, Scene, Texture};
use crate::error::Problem;

impl Scene {
    /// All broken references and impossible numbers. An empty list means that `compile` can't fail on it.
    pub fn validate(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        self.check_meshes(&mut problems);
        self.check_materials(&mut problems);
        let material_exists = |m: MaterialId| m.index() < self.materials.len();
        for instance in &self.instances {
            if instance.mesh.index() >= self.meshes.len() {
                problems.push(Problem::new(&instance.name, "refers to a mesh that does not exist"));
            }
            if instance.material.is_some_and(|m| !material_exists(m)) {
                problems.push(Problem::new(&instance.name, "refers to a material that does not exist"));
            }
        }
        for sphere in &self.spheres {
            if !material_exists(sphere.material) {
                problems.push(Problem::new(&sphere.name, "refers to a material that does not exist"));
            }
            if !(sphere.radius > 0.0 && sphere.radius.is_finite() && sphere.center.is_finite()) {
                problems.push(Problem::new(&sphere.name, "needs a finite centre and a radius above 0"));
            }
        }
        for quad in &self.quads {
            if !material_exists(quad.material) {
                problems.push(Problem::new(&quad.name, "refers to a material that does not exist"));
            }
            if !(quad.corner.is_finite() && quad.edge_u.is_finite() && quad.edge_v.is_finite()) {
                problems.push(Problem::new(&quad.name, "has a corner or edge that is not finite"));
            }
        }
        problems
    }

    fn check_meshes(&self, problems: &mut Vec<Problem>) {
        for mesh in &self.meshes {
            let vertices = mesh.positions.len();
            let mut complain = |what: &str| problems.push(Problem::new(&mesh.name, what));
            if mesh.triangles.iter().flatten().any(|&i| i as usize >= vertices) {
                complain("has an index beyond its vertices");
            }
            let fits = |n: usize| n == 0 || n == vertices;
            if !fits(mesh.normals.len()) || !fits(mesh.tangents.len()) || !fits(mesh.colors.len()) {
                complain("has a vertex attribute of another length than its positions");
            }
            if mesh.uv_sets.iter().any(|set| !fits(set.len())) {
                complain("has a set of texture coordinates of another length than its positions");
            }
            let mut next = 0u64;
            for part in &mesh.parts {
                if u64::from(part.first_triangle) != next || part.material.index() >= self.materials.len() {
                    complain("has parts that leave gaps or refer to a missing material");
                    break;
                }
                next += u64::from(part.triangle_count);
            }
            if next != mesh.triangles.len() as u64 {
                complain("has triangles without a part");
            }
        }
    }

    fn check_materials(&self, problems: &mut Vec<Problem>) {
        for (i, texture) in self.textures.iter().enumerate() {
            let place = format!("texture {i}");
            match *texture {
                Texture::Image { image, .. } if image.index() >= self.images.len() => {
                    problems.push(Problem::new(place, "refers to an image that does not exist"));
                }
                // Children come first, which also rules out cycles.
                Texture::Checker { even, odd, .. } if even.index() >= i || odd.index() >= i => {
                    problems.push(Problem::new(place, "must come after the textures that it is made of"));
                }
                _ => {}
            }
        }
        let exists = |id: super::TextureId| id.index() < self.textures.len();
        for material in &self.materials {
            if !material.textures().all(exists) {
                problems.push(Problem::new(&material.name, "refers to a texture that does not exist"));
            }
        }
    }
}

impl super::Material {
    /// Every texture that the material refers to.
    pub fn textures(&self) -> impl Iterator<Item = super::TextureId> {
        use super::Model;
        let (colors, floats) = match &self.model {
            Model::Black => (vec![], vec![]),
            Model::Lambert { albedo } => (vec![*albedo], vec![]),
            Model::SchlickMetal { color, roughness } => (vec![*color], vec![*roughness]),
            Model::Dielectric { tint, .. } => (vec![*tint], vec![]),
            Model::OrenNayar { color, roughness } => (vec![*color], vec![*roughness]),
            Model::Phong { diffuse, specular, .. } => (vec![*diffuse, *specular], vec![]),
            Model::Conductor { roughness, .. } => (vec![], vec![*roughness]),
            Model::Glass { tint, roughness, .. } => (vec![*tint], vec![*roughness]),
            Model::Pbr(p) => (p.color_slots().copied().collect(), p.float_slots().copied().collect()),
        };
        let other: Vec<_> = match &self.model {
            Model::Pbr(p) => p.other_textures().collect(),
            _ => Vec::new(),
        };
        colors
            .into_iter()
            .chain(self.emission.map(|e| e.radiance))
            .filter_map(|c| c.texture)
            .chain(floats.into_iter().chain([self.alpha]).filter_map(|f| f.texture.map(|(id, _)| id)))
            .chain(self.normal_map.map(|n| n.texture))
            .chain(other)
    }
}

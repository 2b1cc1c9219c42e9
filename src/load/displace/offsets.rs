//! The offsets of displaced vertices: textures evaluated at vertices.

use crate::error::{Error, Warning};
use crate::image::{Encoding, Image};
use crate::math::{DMat4, Vec2, Vec3, normal_matrix, uv_frame};
use crate::scene::{Displacement, DisplacementKind, Mapping, MaterialId, Mesh, Scene, Texture, TextureId};
use crate::texture::{
    AttributeList, CameraData, CompiledTextures, GRAPH_LANES, HitAttributes, HitData, JointGraphs,
    ObjectData, PathData, PointReader, TexturePoint,
};
use rayon::prelude::*;
use std::collections::HashMap;

/// The displacement of a material with its compiled texture.
pub struct Displacer {
    pub displacement: Displacement,
    /// The texture as a node graph.
    graph: Option<JointGraphs>,
    /// UV set of the height map.
    uv_set: Option<u32>,
    /// Index of the material, an output of the `object_info` node.
    index: f32,
}

/// Adds a warning about the object or material `name`.
pub fn warn(warnings: &mut Vec<Warning>, name: &str, message: impl Into<String>) {
    warnings.push(Warning::general(format!("'{name}': {}", message.into())));
}

/// Displacer of each part of a mesh.
pub type Parts<'a> = Vec<Option<&'a Displacer>>;

/// The displacements of a scene's materials.
pub struct Displacers {
    by_material: HashMap<MaterialId, Displacer>,
    textures: Textures,
}

/// The scene's textures, compiled for each kind of displacement that it has.
struct Textures {
    /// With images as linear data.
    heights: Option<CompiledTextures>,
    vectors: Option<CompiledTextures>,
}

impl Textures {
    fn of(&self, displacement: &Displacement) -> Option<&CompiledTextures> {
        if is_height(displacement) { self.heights.as_ref() } else { self.vectors.as_ref() }
    }

    /// Names of the attributes that node graphs of the scene read.
    fn attributes(&self) -> &[String] {
        self.heights.as_ref().or(self.vectors.as_ref()).map_or(&[], |textures| textures.attributes())
    }
}

impl Displacer {
    /// Maximum edge length of the subdivision, object units, 0 for the default; `None` without subdivision.
    pub fn edge(&self) -> Option<f32> {
        match self.displacement.kind {
            DisplacementKind::Heights { edge, .. } => Some(edge),
            DisplacementKind::Vectors { .. } => None,
        }
    }

    /// Whether a mesh lacks the UV set of the height map.
    pub fn lacks_coordinates(&self, mesh: &Mesh) -> bool {
        let has = |set: u32| mesh.uv_sets.get(set as usize).is_some_and(|uv| !uv.is_empty());
        self.uv_set.is_some_and(|set| !has(set))
    }
}

impl Displacers {
    /// Compiles the displacements of a scene's materials. Those with a damaged image are left out with a warning.
    ///
    /// # Errors
    /// If an image without which the scene can't be rendered is damaged.
    pub fn of(scene: &Scene, warnings: &mut Vec<Warning>) -> Result<Displacers, Error> {
        let displaced = |material: u32| scene.materials[material as usize].displacement;
        let all = (0..scene.materials.len() as u32).filter_map(|i| Some((MaterialId(i), displaced(i)?)));
        let all: Vec<(MaterialId, Displacement)> = all.collect();
        let compiled = |are_heights: bool| {
            let wanted = all.iter().filter(|(_, displacement)| is_height(displacement) == are_heights);
            let some: Vec<TextureId> = wanted.map(|(_, displacement)| displacement.texture.0).collect();
            let linear = are_heights.then(|| linear_images(scene, &some));
            let images = linear.as_deref().unwrap_or(&scene.images);
            let compile = || CompiledTextures::of_subset(&scene.textures, images, &some);
            (!some.is_empty()).then(compile).transpose().map(|made| made.map(|(textures, _)| textures))
        };
        let textures = Textures { heights: compiled(true)?, vectors: compiled(false)? };
        let mut by_material = HashMap::new();
        for (id, displacement) in all {
            let texture = displacement.texture.0;
            let Some(compiled) = textures.of(&displacement) else { continue };
            if compiled.is_damaged(texture) {
                warn(
                    warnings,
                    &scene.materials[id.index()].name,
                    "is displaced by an image that can't be decoded",
                );
                continue;
            }
            let graph = compiled.join_graphs([texture]);
            let uv_set = match scene.textures.get(texture.index()) {
                Some(Texture::Image { mapping: Mapping::Uv { set, .. }, .. }) => Some(*set),
                _ => None,
            };
            let index = scene.materials[id.index()].index as f32;
            by_material.insert(id, Displacer { displacement, graph, uv_set, index });
        }
        Ok(Displacers { by_material, textures })
    }

    pub fn of_material(&self, id: MaterialId) -> Option<&Displacer> {
        self.by_material.get(&id)
    }

    /// Whether node graphs of the scene read an attribute.
    pub fn reads_attribute(&self, name: &str) -> bool {
        self.textures.attributes().iter().any(|attribute| attribute == name)
    }

    /// The offset of each vertex of displaced parts in object space. `normals`: the unit displacement direction of each vertex for height maps.
    pub fn offsets(
        &self,
        mesh: &Mesh,
        parts: &Parts,
        normals: &[Vec3],
        object: &ObjectData,
    ) -> Vec<(u32, Vec3)> {
        let attributes = attribute_lists(mesh, self.textures.attributes());
        let at = MeshReader { displacers: self, mesh, normals, object, attributes: &attributes };
        let mut is_done = vec![false; mesh.positions.len()];
        let mut offsets = Vec::new();
        for (part, displacer) in mesh.parts.iter().zip(parts) {
            let Some(displacer) = displacer else { continue };
            let mut corners = Vec::new();
            for triangle in part.first_triangle..part.first_triangle + part.triangle_count {
                for (corner, vertex) in mesh.triangles[triangle as usize].into_iter().enumerate() {
                    if !std::mem::replace(&mut is_done[vertex as usize], true) {
                        corners.push((triangle, corner));
                    }
                }
            }
            let chunks = corners.par_chunks(GRAPH_LANES);
            offsets.extend(chunks.flat_map_iter(|chunk| at.offsets(displacer, chunk)).collect::<Vec<_>>());
        }
        offsets
    }
}

fn is_height(displacement: &Displacement) -> bool {
    matches!(displacement.kind, DisplacementKind::Heights { .. })
}

/// The images of a scene, those of some textures as linear data, even if they are also colours.
fn linear_images(scene: &Scene, textures: &[TextureId]) -> Vec<Image> {
    let mut images = scene.images.clone();
    for id in textures.iter().flat_map(|&texture| Texture::image_ids(&scene.textures, texture)) {
        if let Some(image) = images.get_mut(id.index()) {
            image.encoding = Encoding::Linear;
        }
    }
    images
}

/// The attributes of a mesh by index of the names.
fn attribute_lists(mesh: &Mesh, names: &[String]) -> Vec<AttributeList> {
    let count = mesh.positions.len();
    let list = |name: &String| {
        let found = mesh.attributes.iter().find(|attribute| attribute.name == *name);
        let mut list = AttributeList::default();
        list.append(found.map(|found| (found.width as usize, found.values.as_slice())), 0, count);
        list
    };
    names.iter().map(list).collect()
}

/// Evaluates textures at the vertices of a mesh.
struct MeshReader<'a> {
    displacers: &'a Displacers,
    mesh: &'a Mesh,
    normals: &'a [Vec3],
    object: &'a ObjectData,
    attributes: &'a [AttributeList],
}

impl MeshReader<'_> {
    /// The vertex and the object-space offset at up to [`GRAPH_LANES`] triangle corners.
    fn offsets(&self, displacer: &Displacer, corners: &[(u32, usize)]) -> Vec<(u32, Vec3)> {
        let (points, hits): (Vec<TexturePoint>, Vec<HitData<'_>>) =
            corners.iter().map(|&(triangle, corner)| self.corner(displacer, triangle, corner)).unzip();
        let mut values = Vec::new();
        let Some(textures) = self.displacers.textures.of(&displacer.displacement) else { return Vec::new() };
        if let Some(graph) = &displacer.graph {
            let hits: Vec<Option<&HitData<'_>>> = hits.iter().map(Some).collect();
            graph.evaluate(textures, &points, &hits, &mut values);
        }
        let Displacement { texture: (texture, channel), kind } = displacer.displacement;
        let offset = |(lane, &(triangle, corner)): (usize, &(u32, usize))| {
            let vertex = self.mesh.triangles[triangle as usize][corner];
            let offset = match (kind, &displacer.graph) {
                (DisplacementKind::Heights { scale, midlevel, .. }, graph) => {
                    let channel = usize::from(channel.min(3));
                    let value = match graph {
                        Some(_) => values[lane][channel.min(2)],
                        None => PointReader::new(textures, points[lane]).eval(texture)[channel],
                    };
                    self.normals[vertex as usize] * (scale * (value - midlevel))
                }
                (DisplacementKind::Vectors { .. }, Some(graph)) => {
                    let world = Vec3::from_array(graph.as_vector(values[lane]));
                    (self.object.object_from_world.matrix3 * world.as_dvec3()).as_vec3()
                }
                (DisplacementKind::Vectors { .. }, None) => Vec3::ZERO,
            };
            (vertex, if offset.is_finite() { offset } else { Vec3::ZERO })
        };
        corners.iter().enumerate().map(offset).collect()
    }

    /// The inputs of textures at a corner of a triangle, seen from the front.
    fn corner(&self, displacer: &Displacer, triangle: u32, corner: usize) -> (TexturePoint, HitData<'_>) {
        let (mesh, object) = (self.mesh, self.object);
        let vertices = mesh.triangles[triangle as usize];
        let vertex = vertices[corner] as usize;
        let in_object = vertices.map(|v| Vec3::from_array(mesh.positions[v as usize]));
        let to_world = |p: Vec3| object.world_from_object.transform_point3(p.as_dvec3()).as_vec3();
        let normal_from_object = normal_matrix(&object.world_from_object.matrix3).as_mat3();
        let corners = in_object.map(to_world);
        let normal = (normal_from_object * self.normals[vertex]).normalize_or_zero();
        let face = (in_object[1] - in_object[0]).cross(in_object[2] - in_object[0]);
        let true_normal = (normal_from_object * face).try_normalize().unwrap_or(normal);
        let weights = std::array::from_fn(|k| f32::from(u8::from(k == corner)));
        let uv_of = |set: usize| mesh.uv_sets.get(set).filter(|uv| !uv.is_empty());
        let corner_uv = uv_of(0).map(|uv| vertices.map(|v| Vec2::from_array(uv[v as usize])));
        let at = |set: usize| uv_of(set).map_or(Vec2::ZERO, |uv| Vec2::from_array(uv[vertex]));
        let point = TexturePoint {
            uv: [at(0), at(1)],
            world: corners[corner],
            normal: true_normal,
            cosine: 1.0,
            ..TexturePoint::default()
        };
        let hit = HitData {
            attributes: HitAttributes { lists: self.attributes, triangle: Some((vertices, weights)) },
            object,
            camera: CameraData { camera_from_world: &DMat4::IDENTITY, ndc_from_world: None },
            object_point: in_object[corner],
            shading_normal: normal,
            true_normal,
            incoming: normal,
            is_back: false,
            parametric: [weights[0], weights[1]],
            corners: Some(corners),
            point: corners[corner],
            corner_uv,
            tangent_frame: corner_uv.and_then(|uv| uv_frame(corners, uv, normal)),
            material_index: displacer.index,
            path: PathData::default(),
            strand: None,
            rays: None,
        };
        (point, hit)
    }
}

//! Caustic casters and receivers, and bounding spheres of the casters as targets of light tracing.

use super::geometry::{Placement, Space};
use super::material::CompiledMaterial;
use super::scene::CompiledScene;
use crate::bsdf::{Bsdf, BsdfClass, BsdfProgram};
use crate::light::{TargetSphere, TargetSpheres};
use crate::math::{Bounds3, Vec3};
use crate::scene::FloatSlot;
use crate::shape::Shape;
use std::collections::BTreeMap;

/// Maximum perceptual roughness (square root of GGX alpha) of metals that cast caustics.
const MAX_CASTER_ROUGHNESS: f32 = 0.25;

/// Maximum number of bounding spheres of casters.
const MAX_TARGETS: usize = 16;

/// The role of a material in caustics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CausticRole {
    /// Casts caustics: smooth glass, mirrors, polished metals.
    Caster,
    /// Receives caustics with all lobes: diffuse and rough surfaces.
    Receiver,
    /// Receives caustics with its diffuse lobes only: others are smooth or have textured roughness.
    DiffuseReceiver,
    /// Neither caster nor receiver, or varying over the surface.
    Neither,
}

impl CompiledMaterial {
    /// Caustic role of the material, constant over its surface.
    pub fn role(&self) -> CausticRole {
        use BsdfClass::{
            Beckmann, Black, Conductor, Dielectric, Lambert, Layered, MetalRough, OrenNayar, RoughDielectric,
            SchlickMetal,
        };
        match self.class {
            _ if self.depends_on_viewer || self.is_component => CausticRole::Neither,
            Lambert | OrenNayar => CausticRole::Receiver,
            Black => CausticRole::Neither,
            Dielectric | RoughDielectric if self.is_smooth_glass() => CausticRole::Caster,
            MetalRough | SchlickMetal | Beckmann | Conductor
                if self.is_polished() || self.is_textured_polished_metal() =>
            {
                CausticRole::Caster
            }
            MetalRough | SchlickMetal | Beckmann | Conductor if self.is_rough() => CausticRole::Receiver,
            MetalRough => CausticRole::DiffuseReceiver,
            Layered if self.medium_index == 0 && !self.has_glass_layer() => match self.uniform_bsdf() {
                Some(bsdf) if bsdf.is_specular() => CausticRole::Caster,
                _ => CausticRole::DiffuseReceiver,
            },
            _ => match self.uniform_bsdf() {
                Some(bsdf) if bsdf.is_specular() && self.is_specular_in_media(bsdf) => CausticRole::Caster,
                _ => CausticRole::Neither,
            },
        }
    }

    /// Is a BSDF that is specular in air also specular inside another medium?
    fn is_specular_in_media(&self, bsdf: Bsdf) -> bool {
        self.medium_index == 0 || bsdf.with_ior(2.0).is_specular()
    }

    fn is_polished(&self) -> bool {
        let appearance = self.uniform_bsdf().map(|bsdf| bsdf.appearance());
        appearance.is_some_and(|a| a.diffuse.max_element() <= 0.0 && a.roughness <= MAX_CASTER_ROUGHNESS)
    }

    /// Is it a polished metal with any colour texture?
    fn is_textured_polished_metal(&self) -> bool {
        let is_smooth =
            |roughness: FloatSlot| roughness.texture.is_none() && roughness.factor <= MAX_CASTER_ROUGHNESS;
        match &self.program {
            BsdfProgram::MetalRough(program) => {
                let metallic = program.metallic();
                metallic.texture.is_none() && metallic.factor >= 1.0 && is_smooth(program.roughness())
            }
            BsdfProgram::SchlickMetal(program) => is_smooth(program.roughness),
            BsdfProgram::Beckmann(program) => is_smooth(program.roughness),
            _ => false,
        }
    }

    /// Is the roughness above the maximum of casters, for all colour textures?
    fn is_rough(&self) -> bool {
        let roughness = match &self.program {
            BsdfProgram::MetalRough(program) => program.roughness(),
            BsdfProgram::SchlickMetal(program) => program.roughness,
            BsdfProgram::Beckmann(program) => program.roughness,
            BsdfProgram::Conductor(program) => program.roughness,
            _ => return false,
        };
        roughness.texture.is_none() && roughness.factor > MAX_CASTER_ROUGHNESS
    }

    /// Is it a layered material with a glass layer?
    fn has_glass_layer(&self) -> bool {
        matches!(&self.program, BsdfProgram::Layered(program) if program.has_glass())
    }
}

impl CompiledScene {
    /// The caustic role of each material.
    pub fn roles(&self) -> Vec<CausticRole> {
        self.materials.iter().map(CompiledMaterial::role).collect()
    }

    /// Bounding spheres of all casters, one per object or group of neighbouring objects.
    pub fn targets(&self, roles: &[CausticRole]) -> TargetSpheres {
        let casters = Casters::of(self, roles);
        let mut boxes: BTreeMap<u32, Bounds3> = BTreeMap::new();
        for (i, run) in casters.runs.iter().enumerate() {
            let bounds = boxes.entry(run.object).or_insert(Bounds3::EMPTY);
            casters.visit(i, |sphere| *bounds = with_sphere(*bounds, sphere));
        }
        let mut groups: Vec<(Bounds3, Vec<u32>)> =
            boxes.into_iter().map(|(object, b)| (b, vec![object])).collect();
        while groups.len() > MAX_TARGETS {
            merge_neighbours(&mut groups);
        }
        let group_of = |(group, (_, objects)): (usize, &(Bounds3, Vec<u32>))| -> Vec<(u32, usize)> {
            objects.iter().map(|&object| (object, group)).collect()
        };
        let group_of: BTreeMap<u32, usize> = groups.iter().enumerate().flat_map(group_of).collect();
        let mut spheres: Vec<TargetSphere> =
            groups.iter().map(|(bounds, _)| TargetSphere { center: bounds.center(), radius: 0.0 }).collect();
        for (i, run) in casters.runs.iter().enumerate() {
            let Some(around) = group_of.get(&run.object).map(|&group| &mut spheres[group]) else { continue };
            casters.visit(i, |sphere| {
                let far = (sphere.center - around.center).length() + sphere.radius;
                around.radius = around.radius.max(far * (1.0 + 1e-5));
            });
        }
        TargetSpheres::new(spheres)
    }

    /// Radius of the scene's bounding sphere about the anchor, metres.
    pub fn bounding_radius(&self) -> f32 {
        let of_box = |bounds: &Bounds3| bounds.corners().map(|p| p.length()).into_iter().fold(0.0, f32::max);
        let world =
            Some(&self.geometries.world.bounds).filter(|bounds| !bounds.is_empty()).map_or(0.0, of_box);
        let placed = self.geometries.placements.iter().map(|placement| {
            let bounds = &self.geometries.shared[placement.geometry as usize].bounds;
            match bounds.is_empty() {
                true => 0.0,
                false => of_box(&Bounds3::of(placed_corners(placement, bounds))),
            }
        });
        placed.fold(world, f32::max)
    }
}

/// Points and spheres that bound all primitives of casters.
struct Casters<'s> {
    /// Positions of all vertices.
    positions: &'s [[f32; 3]],
    /// Vertices of triangles, without duplicates in a run.
    vertices: Vec<u32>,
    /// Spheres that bound all other primitives.
    spheres: Vec<TargetSphere>,
    runs: Vec<CasterRun>,
}

/// Start of the primitives of one caster; they end where the next run begins.
struct CasterRun {
    object: u32,
    first_vertex: usize,
    first_sphere: usize,
}

impl<'s> Casters<'s> {
    fn of(scene: &'s CompiledScene, roles: &[CausticRole]) -> Casters<'s> {
        let world = &scene.geometries.world;
        let positions = &world.shapes.positions;
        let mut casters = Casters { positions, vertices: Vec::new(), spheres: Vec::new(), runs: Vec::new() };
        casters.add_world(world, roles);
        casters.add_placements(scene, roles);
        casters
    }

    fn add_world(&mut self, world: &Space, roles: &[CausticRole]) {
        let casters = world.attributes.materials.iter().enumerate().filter(|(_, m)| casts(roles, **m));
        // Primitives of an object are consecutive: it is looked up once.
        let mut end = 0;
        // The run that each vertex was last visited for.
        let mut visited: Vec<u32> = Vec::new();
        for (prim, _) in casters {
            if prim as u32 >= end {
                end = world.owners.end_of_run(prim as u32);
                self.begin_run(world.owners.of(prim as u32).0);
            }
            match world.shapes.triangles.get(prim) {
                None => visit_primitive(world, prim, |sphere| self.spheres.push(sphere)),
                Some(triangle) => {
                    visited.resize(world.shapes.positions.len(), 0);
                    let run = self.runs.len() as u32;
                    for &vertex in triangle {
                        if std::mem::replace(&mut visited[vertex as usize], run) != run {
                            self.vertices.push(vertex);
                        }
                    }
                }
            }
        }
    }

    fn add_placements(&mut self, scene: &CompiledScene, roles: &[CausticRole]) {
        for placement in &scene.geometries.placements {
            let space = &scene.geometries.shared[placement.geometry as usize];
            let materials = &space.attributes.materials;
            let is_caster = placement
                .material
                .map_or_else(|| materials.iter().any(|m| casts(roles, *m)), |m| casts(roles, m));
            if is_caster && !space.bounds.is_empty() {
                self.begin_run(placement.object.0);
                self.spheres.extend(placed_corners(placement, &space.bounds).map(point));
            }
        }
    }

    fn begin_run(&mut self, object: u32) {
        let (first_vertex, first_sphere) = (self.vertices.len(), self.spheres.len());
        self.runs.push(CasterRun { object, first_vertex, first_sphere });
    }

    /// Visits the vertices and spheres of a run.
    fn visit(&self, index: usize, mut visit: impl FnMut(TargetSphere)) {
        let first = &self.runs[index];
        let (vertices, spheres) = self.runs.get(index + 1).map_or_else(
            || (self.vertices.len(), self.spheres.len()),
            |next| (next.first_vertex, next.first_sphere),
        );
        for &vertex in &self.vertices[first.first_vertex..vertices] {
            visit(point(Vec3::from_array(self.positions[vertex as usize])));
        }
        self.spheres[first.first_sphere..spheres].iter().for_each(|sphere| visit(*sphere));
    }
}

/// The corners of a shared mesh's bounds in world space.
fn placed_corners(placement: &Placement, bounds: &Bounds3) -> [Vec3; 8] {
    let place = placement.world_from_object;
    bounds.corners().map(|p| place.linear * p + place.translation)
}

/// Does a material cast caustics?
fn casts(roles: &[CausticRole], material: u32) -> bool {
    roles.get(material as usize) == Some(&CausticRole::Caster)
}

/// The bounds extended by a sphere, which often has the radius 0.
fn with_sphere(bounds: Bounds3, sphere: TargetSphere) -> Bounds3 {
    if sphere.radius == 0.0 {
        return bounds.with(sphere.center);
    }
    let r = Vec3::splat(sphere.radius);
    bounds.with(sphere.center - r).with(sphere.center + r)
}

/// A sphere of radius 0.
fn point(center: Vec3) -> TargetSphere {
    TargetSphere { center, radius: 0.0 }
}

/// Calls `visit` with spheres whose convex hull contains a primitive other than a triangle.
fn visit_primitive(space: &Space, prim: usize, mut visit: impl FnMut(TargetSphere)) {
    let shapes = &space.shapes;
    let prim = prim - shapes.triangles.len();
    if let Some(quad) = shapes.quads.get(prim) {
        let corners = [Vec3::ZERO, quad.edge_u, quad.edge_v, quad.edge_u + quad.edge_v];
        return corners.into_iter().for_each(|edge| visit(point(quad.corner + edge)));
    }
    let prim = prim - shapes.quads.len();
    if let Some(shape) = shapes.analytic.get(prim) {
        let (center, radius) = shape.center_and_radius();
        return visit(TargetSphere { center, radius });
    }
    let prim = prim - shapes.analytic.len();
    if let Some(splat) = prim.checked_sub(shapes.curves.len()) {
        return visit(point(Vec3::from_array(shapes.splats.centers[splat])));
    }
    let segment = shapes.curves.get(prim);
    segment
        .ends
        .into_iter()
        .zip(segment.radii)
        .for_each(|(center, radius)| visit(TargetSphere { center, radius }));
}

/// Merges pairs of neighbouring groups along the axis of largest extent.
fn merge_neighbours(groups: &mut Vec<(Bounds3, Vec<u32>)>) {
    let spread = Bounds3::of(groups.iter().map(|(bounds, _)| bounds.center())).extent();
    let axis = (0..3).fold(0, |best, c| if spread[c] > spread[best] { c } else { best });
    groups.sort_by(|(a, _), (b, _)| a.center()[axis].total_cmp(&b.center()[axis]));
    let mut merged: Vec<(Bounds3, Vec<u32>)> = Vec::with_capacity(groups.len() / 2 + 1);
    for (at, (bounds, objects)) in groups.drain(..).enumerate() {
        match merged.last_mut().filter(|_| at % 2 == 1) {
            Some(last) => {
                last.0 = last.0.union(bounds);
                last.1.extend(objects);
            }
            None => merged.push((bounds, objects)),
        }
    }
    *groups = merged;
}

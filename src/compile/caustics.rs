//! Materials that cast and that receive caustics, and bounding spheres of the casters for light tracing.

use super::geometry::{Placement, Space};
use super::material::CompiledMaterial;
use super::scene::CompiledScene;
use crate::bsdf::{Bsdf, BsdfClass, BsdfProgram};
use crate::light::{TargetSphere, TargetSpheres};
use crate::math::{Bounds3, Vec3};
use crate::scene::FloatSlot;
use crate::shape::Shape;
use std::collections::BTreeMap;
use std::ops::Range;

/// Metals up to this perceptual roughness (the square root of GGX alpha) cast caustics.
const MAX_CASTER_ROUGHNESS: f32 = 0.25;

/// Maximum number of bounding spheres of casters.
const MAX_TARGETS: usize = 16;

/// CausticRole of a material for caustics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CausticRole {
    /// Sends light on: smooth glass, mirrors, polished metals.
    Caster,
    /// Scatters light into all directions, so that caustics are visible on it.
    Receiver,
    /// Only its diffuse lobes do so; others are smooth or as smooth as textures say.
    DiffuseReceiver,
    /// Neither in all cases.
    Neither,
}

impl CompiledMaterial {
    /// Its role, the same at all points.
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
                if self.is_polished() || self.is_painted_metal() =>
            {
                CausticRole::Caster
            }
            MetalRough | SchlickMetal | Beckmann | Conductor if self.is_rough() => CausticRole::Receiver,
            MetalRough => CausticRole::DiffuseReceiver,
            Layered if self.medium_index == 0 && !self.lets_light_pass() => match self.alike() {
                Some(bsdf) if bsdf.is_specular() => CausticRole::Caster,
                _ => CausticRole::DiffuseReceiver,
            },
            _ => match self.alike() {
                Some(bsdf) if bsdf.is_specular() && self.is_the_same_in_solids(bsdf) => CausticRole::Caster,
                _ => CausticRole::Neither,
            },
        }
    }

    /// What is smooth in air need not be within another solid.
    fn is_the_same_in_solids(&self, bsdf: Bsdf) -> bool {
        self.medium_index == 0 || bsdf.with_ior(2.0).is_specular()
    }

    fn is_polished(&self) -> bool {
        let look = self.alike().map(|bsdf| bsdf.appearance());
        look.is_some_and(|look| look.diffuse.max_element() <= 0.0 && look.roughness <= MAX_CASTER_ROUGHNESS)
    }

    /// Is it a metal as smooth as that, whatever colours its textures show?
    fn is_painted_metal(&self) -> bool {
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

    /// Are its facets rougher than those of casters, whatever its textures show?
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

    /// May light pass a layered material as glass?
    fn lets_light_pass(&self) -> bool {
        matches!(&self.program, BsdfProgram::Layered(program) if program.has_glass())
    }
}

impl CompiledScene {
    /// CausticRole of each material.
    pub fn roles(&self) -> Vec<CausticRole> {
        self.materials.iter().map(CompiledMaterial::role).collect()
    }

    /// Balls around all that sends light on: one for each object, or for neighbouring ones together.
    pub fn targets(&self, roles: &[CausticRole]) -> TargetSpheres {
        let senders = Senders::of(self, roles);
        let mut boxes: BTreeMap<u32, Bounds3> = BTreeMap::new();
        for run in &senders.runs {
            let bounds = boxes.entry(run.object).or_insert(Bounds3::EMPTY);
            senders.visit(run, |ball| *bounds = with_ball(*bounds, ball));
        }
        let mut groups: Vec<(Bounds3, Vec<u32>)> =
            boxes.into_iter().map(|(object, b)| (b, vec![object])).collect();
        while groups.len() > MAX_TARGETS {
            unite_neighbours(&mut groups);
        }
        let group_of = |(group, (_, objects)): (usize, &(Bounds3, Vec<u32>))| -> Vec<(u32, usize)> {
            objects.iter().map(|&object| (object, group)).collect()
        };
        let group_of: BTreeMap<u32, usize> = groups.iter().enumerate().flat_map(group_of).collect();
        let mut balls: Vec<TargetSphere> =
            groups.iter().map(|(bounds, _)| TargetSphere { center: bounds.center(), radius: 0.0 }).collect();
        for run in &senders.runs {
            let Some(around) = group_of.get(&run.object).map(|&group| &mut balls[group]) else { continue };
            senders.visit(run, |ball| {
                let far = (ball.center - around.center).length() + ball.radius;
                around.radius = around.radius.max(far * (1.0 + 1e-5));
            });
        }
        TargetSpheres::new(balls)
    }

    /// Radius of a ball about the origin that holds all that rays can hit.
    pub fn reach(&self) -> f32 {
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

/// Balls within which all primitives lie that send light on.
struct Senders<'s> {
    /// Of all vertices.
    positions: &'s [[f32; 3]],
    /// Vertices of triangles that send light on; those that triangles share, once a run.
    vertices: Vec<u32>,
    /// Balls of all other primitives.
    balls: Vec<TargetSphere>,
    runs: Vec<SenderRun>,
}

/// What of an object sends light on, or a part of it.
struct SenderRun {
    object: u32,
    vertices: Range<usize>,
    balls: Range<usize>,
}

impl<'s> Senders<'s> {
    fn of(scene: &'s CompiledScene, roles: &[CausticRole]) -> Senders<'s> {
        let world = &scene.geometries.world;
        let positions = &world.shapes.positions;
        let mut senders = Senders { positions, vertices: Vec::new(), balls: Vec::new(), runs: Vec::new() };
        senders.add_world(world, roles);
        senders.add_placements(scene, roles);
        senders
    }

    fn add_world(&mut self, world: &Space, roles: &[CausticRole]) {
        let senders = world.attributes.materials.iter().enumerate().filter(|(_, m)| sends(roles, **m));
        // Primitives of an object follow each other: maps are asked once for each.
        let mut end = 0;
        // The run that each vertex was last visited for.
        let mut visited: Vec<u32> = Vec::new();
        for (prim, _) in senders {
            if prim as u32 >= end {
                end = world.owners.end_of_run(prim as u32);
                self.begin_run(world.owners.of(prim as u32).0);
            }
            match world.shapes.triangles.get(prim) {
                None => visit_primitive(world, prim, |ball| self.balls.push(ball)),
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
            self.end_run();
        }
    }

    fn add_placements(&mut self, scene: &CompiledScene, roles: &[CausticRole]) {
        for placement in &scene.geometries.placements {
            let space = &scene.geometries.shared[placement.geometry as usize];
            let materials = &space.attributes.materials;
            let is_sender = placement
                .material
                .map_or_else(|| materials.iter().any(|m| sends(roles, *m)), |m| sends(roles, m));
            if is_sender && !space.bounds.is_empty() {
                self.begin_run(placement.object.0);
                self.balls.extend(placed_corners(placement, &space.bounds).map(point));
                self.end_run();
            }
        }
    }

    fn begin_run(&mut self, object: u32) {
        let (vertices, balls) = (self.vertices.len(), self.balls.len());
        self.runs.push(SenderRun { object, vertices: vertices..vertices, balls: balls..balls });
    }

    /// Ends the last run after what was added.
    fn end_run(&mut self) {
        if let Some(run) = self.runs.last_mut() {
            (run.vertices.end, run.balls.end) = (self.vertices.len(), self.balls.len());
        }
    }

    fn visit(&self, run: &SenderRun, mut visit: impl FnMut(TargetSphere)) {
        for &vertex in &self.vertices[run.vertices.clone()] {
            visit(point(Vec3::from_array(self.positions[vertex as usize])));
        }
        self.balls[run.balls.clone()].iter().for_each(|ball| visit(*ball));
    }
}

/// The corners of the bounds of a shared geometry where it is placed.
fn placed_corners(placement: &Placement, bounds: &Bounds3) -> [Vec3; 8] {
    let place = placement.world_from_object;
    bounds.corners().map(|p| place.linear * p + place.translation)
}

/// Does a material send light on?
fn sends(roles: &[CausticRole], material: u32) -> bool {
    roles.get(material as usize) == Some(&CausticRole::Caster)
}

/// Bounds that hold a ball, too. Most balls are vertices of triangles.
fn with_ball(bounds: Bounds3, ball: TargetSphere) -> Bounds3 {
    if ball.radius == 0.0 {
        return bounds.with(ball.center);
    }
    let r = Vec3::splat(ball.radius);
    bounds.with(ball.center - r).with(ball.center + r)
}

/// A ball without size.
fn point(center: Vec3) -> TargetSphere {
    TargetSphere { center, radius: 0.0 }
}

/// Calls `visit` with balls of which each sphere that holds them holds a primitive that is no triangle.
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
    let piece = shapes.curves.get(prim);
    piece
        .ends
        .into_iter()
        .zip(piece.radii)
        .for_each(|(center, radius)| visit(TargetSphere { center, radius }));
}

/// Puts groups together in twos that follow each other along the axis in which all are spread most.
fn unite_neighbours(groups: &mut Vec<(Bounds3, Vec<u32>)>) {
    let spread = Bounds3::of(groups.iter().map(|(bounds, _)| bounds.center())).extent();
    let axis = (0..3).fold(0, |best, c| if spread[c] > spread[best] { c } else { best });
    groups.sort_by(|(a, _), (b, _)| a.center()[axis].total_cmp(&b.center()[axis]));
    let mut united: Vec<(Bounds3, Vec<u32>)> = Vec::with_capacity(groups.len() / 2 + 1);
    for (at, (bounds, objects)) in groups.drain(..).enumerate() {
        match united.last_mut().filter(|_| at % 2 == 1) {
            Some(last) => {
                last.0 = last.0.union(bounds);
                last.1.extend(objects);
            }
            None => united.push((bounds, objects)),
        }
    }
    *groups = united;
}

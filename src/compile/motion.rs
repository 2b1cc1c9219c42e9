//! Motion blur (keyframes in compiled spaces while the shutter is open) and motion vectors (positions a frame before and after).

use super::geometry::{Geometries, Primitive, Space, primitive, vertices};
use super::material::CompiledMaterial;
use super::objects::{ObjectId, ObjectIds, ObjectMaterials};
use crate::light::{MovingLight, PunctualLight};
use crate::math::{DAffine3, DMat3, DVec3, Hit, Mat3, TransformKeys, Vec3};
use crate::scene::{
    Instance, Keyframes, Light, LightKind, MaterialId, MeshId, Motion, Scene, Shape, ShapeKind, Vertices,
};
use crate::shape::triangle::interpolate;
use crate::shape::{Analytic, Quad};
use std::collections::{BTreeMap, HashMap};

/// Transforms of an instance at the keys of the shutter interval, relative to `origin`; `None` if static.
pub(super) fn keys(scene: &Scene, instance: &Instance, origin: DVec3) -> Option<TransformKeys> {
    let Motion::Keyed(number) = instance.motion else { return None };
    let moving = scene.motion.instances.get(number as usize).filter(|m| m.blurs())?;
    Some(moving.keys.iter().map(|key| from_origin(key, origin)).collect())
}

fn from_origin(key: &DAffine3, origin: DVec3) -> DAffine3 {
    DAffine3 { translation: key.translation - origin, ..*key }
}

/// Does a mesh deform while the shutter is open, or between frames with motion vectors?
pub(super) fn deforms(scene: &Scene, mesh: MeshId) -> bool {
    let moving = scene.motion.meshes.get(&mesh.index());
    moving.is_some_and(|m| m.blurs() || m.neighbours.is_some())
}

/// Does a mesh change over time?
pub(super) fn changes(scene: &Scene, mesh: MeshId) -> bool {
    scene.motion.meshes.contains_key(&mesh.index())
}

/// The moving lights without a surface, by index in the scene.
pub(super) fn moving_lights(scene: &Scene, origin: DVec3) -> BTreeMap<usize, MovingLight<PunctualLight>> {
    let moving = |(i, light): (usize, &Light)| {
        let found = light.motion.as_ref().filter(|m| m.blurs())?;
        let at = |kind: &LightKind| PunctualLight::new(&Light { kind: *kind, ..light.clone() }, origin);
        Some((i, MovingLight(found.keys.iter().map(at).collect())))
    };
    scene.lights.iter().enumerate().filter_map(moving).collect()
}

impl Space {
    /// Sets the vertex keys of a deforming mesh.
    pub(super) fn set_keys(&mut self, scene: &Scene, mesh: MeshId) {
        let Some(moving) = scene.motion.meshes.get(&mesh.index()) else { return };
        let positions = |[a, b]: &[Vertices; 2]| [a.positions.clone(), b.positions.clone()];
        self.neighbours = moving.neighbours.as_ref().map(positions);
        if !moving.blurs() {
            return;
        }
        self.shapes.keys = moving.keys.iter().map(|key| key.positions.clone()).collect();
        if !self.attributes.normals.is_empty() {
            self.attributes.normal_keys = moving.keys.iter().map(|key| key.normals.clone()).collect();
        }
        self.update_bounds();
    }
}

/// A moving quad or analytic shape in its own space.
pub(super) struct MovingShape {
    pub space: Space,
    pub object: ObjectId,
    /// Transform at the time of the frame.
    pub world_from_object: DAffine3,
    /// Transforms while the shutter is open.
    pub keys: TransformKeys,
}

/// All quads and analytic shapes that move while the shutter is open.
pub(super) fn moving_shapes(
    scene: &Scene,
    materials: &[CompiledMaterial],
    origin: DVec3,
    object_ids: &ObjectIds,
    (object_materials, keeps_uv): (&ObjectMaterials, bool),
) -> Vec<MovingShape> {
    let is_visible = |id: MaterialId| !materials[id.index()].is_invisible();
    let mut all = Vec::new();
    let quads = scene.motion.quads.iter().filter(|(_, moving)| moving.blurs());
    for (&i, moving) in quads {
        let Some(quad) = scene.quads.get(i).filter(|quad| is_visible(quad.material)) else { continue };
        let (edge_u, edge_v) = (quad.edge_u.as_vec3(), quad.edge_v.as_vec3());
        let mut space = Space::EMPTY;
        space.shapes.quads.push(Quad { corner: Vec3::ZERO, edge_u, edge_v });
        let place = |world_from_rest: &DAffine3| {
            from_origin(&(*world_from_rest * DAffine3::from_translation(quad.corner)), origin)
        };
        let material = object_materials.index_of(quad.material, &quad.traits);
        all.push(MovingShape::new(space, material, object_ids.quad(i), moving, place));
    }
    let shapes = scene.motion.shapes.iter().filter(|(_, moving)| moving.blurs());
    for (&i, moving) in shapes {
        let Some(shape) = scene.shapes.get(i).filter(|shape| is_visible(shape.material)) else { continue };
        let mut space = Space::EMPTY;
        space.shapes.analytic.push(Analytic::of_scene(shape, Vec3::ZERO));
        if keeps_uv || materials[shape.material.index()].uses_uv {
            let rotation = Mat3::from_quat(shape.rotation.inverse().as_quat());
            space.attributes.object_from_world.push(rotation);
        }
        let emits = materials[shape.material.index()].emission.is_some();
        let place = |world_from_rest: &DAffine3| from_origin(&placed(shape, world_from_rest, emits), origin);
        let material = object_materials.index_of(shape.material, &shape.traits);
        all.push(MovingShape::new(space, material, object_ids.shape(i), moving, place));
    }
    all
}

/// The transform of a shape from its centre. Emissive spheres are not rotated: interpolated rotations would deform them
/// slightly, and light sampling requires exact spheres.
fn placed(shape: &Shape, world_from_rest: &DAffine3, emits: bool) -> DAffine3 {
    let m = world_from_rest.matrix3;
    let scale = m.determinant().abs().cbrt();
    let is_sphere_light = emits && shape.kind != ShapeKind::Disk;
    let linear = if is_sphere_light { DMat3::from_diagonal(DVec3::splat(scale)) } else { m };
    DAffine3 { matrix3: linear, translation: world_from_rest.transform_point3(shape.center) }
}

impl MovingShape {
    fn new(
        mut space: Space,
        material: u32,
        object: ObjectId,
        moving: &Keyframes<DAffine3>,
        place: impl Fn(&DAffine3) -> DAffine3,
    ) -> MovingShape {
        space.attributes.materials.push(material);
        space.update_bounds();
        let world_from_object = place(&DAffine3::IDENTITY);
        MovingShape { space, object, world_from_object, keys: moving.keys.iter().map(place).collect() }
    }
}

// Motion vectors.

/// World transforms at the time of the frame, a frame before and a frame after.
#[derive(Clone, Copy, Debug)]
struct ObjectPoses {
    now: DAffine3,
    neighbours: [DAffine3; 2],
}

/// World positions of a surface point at the time of the frame, a frame before and a frame after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMotion {
    /// At the time of the frame.
    pub now: Vec3,
    /// A frame before and a frame after.
    pub neighbours: [Vec3; 2],
}

/// The motion of a scene's objects between frames; empty unless motion vectors are enabled.
#[derive(Clone, Debug, Default)]
pub struct MotionVectors {
    objects: HashMap<ObjectId, ObjectPoses>,
}

impl MotionVectors {
    /// The motion vectors of a scene, relative to `origin`.
    pub(super) fn of(scene: &Scene, origin: DVec3) -> MotionVectors {
        let (object_ids, motion) = (ObjectIds::of(scene), &scene.motion);
        let to_origin = DAffine3::from_translation(-origin);
        let mut objects = HashMap::new();
        let mut add = |object,
                       moving: &Keyframes<DAffine3>,
                       now: DAffine3,
                       transform_of: &dyn Fn(&DAffine3) -> DAffine3| {
            if let Some([before, after]) = &moving.neighbours {
                let neighbours = [to_origin * transform_of(before), to_origin * transform_of(after)];
                objects.insert(object, ObjectPoses { now: to_origin * now, neighbours });
            }
        };
        for (i, instance) in scene.instances.iter().enumerate() {
            let Motion::Keyed(number) = instance.motion else { continue };
            if let Some(moving) = motion.instances.get(number as usize) {
                add(object_ids.instance(i), moving, instance.world_from_object, &|m| *m);
            }
        }
        // The spaces of quads and shapes have their origin at the corner or centre.
        for (&i, moving) in &motion.quads {
            let Some(quad) = scene.quads.get(i) else { continue };
            let corner = DAffine3::from_translation(quad.corner);
            add(object_ids.quad(i), moving, corner, &|m| *m * corner);
        }
        for (&i, moving) in &motion.shapes {
            let Some(shape) = scene.shapes.get(i) else { continue };
            let center = DAffine3::from_translation(shape.center);
            add(object_ids.shape(i), moving, center, &|m| *m * center);
        }
        MotionVectors { objects }
    }

    /// The positions of the surface point `p`, hit at a time in 0..1 of the shutter interval.
    pub fn point_motion(&self, geometries: &Geometries, hit: &Hit, p: Vec3, time: f32) -> PointMotion {
        let still = PointMotion { now: p, neighbours: [p; 2] };
        if self.objects.is_empty() {
            return still;
        }
        let Some(places) = self.objects.get(&geometries.object(hit)) else { return still };
        let placement = geometries.placements.get((hit.instance as usize).wrapping_sub(1));
        let here = placement.map_or(places.now, |placement| geometries.world_from_object(placement, time));
        let object = here.inverse().transform_point3(p.as_dvec3());
        let [now, before, after] = placement
            .and_then(|placement| deformed(geometries, placement.geometry as usize, hit))
            .unwrap_or([object; 3]);
        let place = |m: &DAffine3, p: DVec3| m.transform_point3(p).as_vec3();
        let [m0, m1] = &places.neighbours;
        PointMotion { now: place(&places.now, now), neighbours: [place(m0, before), place(m1, after)] }
    }
}

/// A point of a deforming mesh in object space: at the time of the frame, a frame before and a frame after.
fn deformed(geometries: &Geometries, geometry: usize, hit: &Hit) -> Option<[DVec3; 3]> {
    let space = &geometries.shared[geometry];
    let [before, after] = space.neighbours.as_ref()?;
    let Primitive::Triangle(t) = primitive(&space.shapes, hit.prim) else { return None };
    let lists = [&space.shapes.positions, before, after];
    Some(lists.map(|list| interpolate(vertices(list, t), hit.u, hit.v).as_dvec3()))
}

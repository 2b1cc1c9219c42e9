//! Motion blur and motion vectors: what moves while the shutter is open, in the spaces that geometry is compiled to, and positions a
//! frame before and after.

use super::geometry::{Geometries, Primitive, Space, primitive, vertices};
use super::material::CompiledMaterial;
use super::objects::{Numbering, ObjectId, ObjectMaterials};
use crate::light::{MovingLight, PunctualLight};
use crate::math::{DAffine3, DMat3, DVec3, Hit, Mat3, TransformKeys, Vec3};
use crate::scene::{
    Instance, Keyframes, Light, LightKind, MaterialId, MeshId, Motion, Scene, Shape, ShapeKind, Vertices,
};
use crate::shape::triangle::interpolate;
use crate::shape::{Analytic, Quad};
use std::collections::{BTreeMap, HashMap};

/// Transforms of an instance at the keys of the shutter interval, relative to an origin; `None` if it is static.
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

/// Is a mesh another at other times?
pub(super) fn changes(scene: &Scene, mesh: MeshId) -> bool {
    scene.motion.meshes.contains_key(&mesh.index())
}

/// The lights without a surface that move while the shutter is open, by their place in the scene's list.
pub(super) fn moving_lights(scene: &Scene, origin: DVec3) -> BTreeMap<usize, MovingLight<PunctualLight>> {
    let moving = |(i, light): (usize, &Light)| {
        let found = light.motion.as_ref().filter(|m| m.blurs())?;
        let at = |kind: &LightKind| PunctualLight::new(&Light { kind: *kind, ..light.clone() }, origin);
        Some((i, MovingLight(found.keys.iter().map(at).collect())))
    };
    scene.lights.iter().enumerate().filter_map(moving).collect()
}

impl Space {
    /// Takes the shapes of a mesh while the shutter is open, if it changes then.
    pub(super) fn take_keys(&mut self, scene: &Scene, mesh: MeshId) {
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
        self.measure();
    }
}

/// A quad or another shape that moves, in a space of its own.
pub(super) struct MovingShape {
    pub space: Space,
    /// The object that it is.
    pub object: ObjectId,
    /// Where it stands at the picture's time.
    pub world_from_object: DAffine3,
    /// Where it stands while the shutter is open.
    pub keys: TransformKeys,
}

/// All quads and other shapes that move while the shutter is open.
pub(super) fn moving_shapes(
    scene: &Scene,
    materials: &[CompiledMaterial],
    origin: DVec3,
    numbering: &Numbering,
    (numbers, keeps_uv): (&ObjectMaterials, bool),
) -> Vec<MovingShape> {
    let is_seen = |id: MaterialId| !materials[id.index()].is_invisible();
    let mut all = Vec::new();
    let quads = scene.motion.quads.iter().filter(|(_, moving)| moving.blurs());
    for (&i, moving) in quads {
        let Some(quad) = scene.quads.get(i).filter(|quad| is_seen(quad.material)) else { continue };
        let (edge_u, edge_v) = (quad.edge_u.as_vec3(), quad.edge_v.as_vec3());
        let mut space = Space::EMPTY;
        space.shapes.quads.push(Quad { corner: Vec3::ZERO, edge_u, edge_v });
        let place = |world_from_rest: &DAffine3| {
            from_origin(&(*world_from_rest * DAffine3::from_translation(quad.corner)), origin)
        };
        let material = numbers.number(quad.material, &quad.traits);
        all.push(MovingShape::new(space, material, numbering.quad(i), moving, place));
    }
    let shapes = scene.motion.shapes.iter().filter(|(_, moving)| moving.blurs());
    for (&i, moving) in shapes {
        let Some(shape) = scene.shapes.get(i).filter(|shape| is_seen(shape.material)) else { continue };
        let mut space = Space::EMPTY;
        space.shapes.analytic.push(Analytic::of_scene(shape, Vec3::ZERO));
        if keeps_uv || materials[shape.material.index()].uses_uv {
            let rotation = Mat3::from_quat(shape.rotation.inverse().as_quat());
            space.attributes.object_from_world.push(rotation);
        }
        let emits = materials[shape.material.index()].emission.is_some();
        let place = |world_from_rest: &DAffine3| from_origin(&placed(shape, world_from_rest, emits), origin);
        let material = numbers.number(shape.material, &shape.traits);
        all.push(MovingShape::new(space, material, numbering.shape(i), moving, place));
    }
    all
}

/// Where a shape around its own middle stands. Spheres that emit light are not turned: interpolated rotations would bend them a little,
/// and what samples their light asks for spheres.
fn placed(shape: &Shape, world_from_rest: &DAffine3, emits: bool) -> DAffine3 {
    let m = world_from_rest.matrix3;
    let scale = m.determinant().abs().cbrt();
    let keeps_straight = emits && shape.kind != ShapeKind::Disk;
    let linear = if keeps_straight { DMat3::from_diagonal(DVec3::splat(scale)) } else { m };
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
        space.measure();
        let world_from_object = place(&DAffine3::IDENTITY);
        MovingShape { space, object, world_from_object, keys: moving.keys.iter().map(place).collect() }
    }
}

// Motion vectors: positions of surface points per frame before and a frame after.

/// World transforms at the time of the frame, a frame before and a frame after.
#[derive(Clone, Copy, Debug)]
struct ObjectPoses {
    now: DAffine3,
    neighbours: [DAffine3; 2],
}

/// A point of a surface at the picture's time, a frame before and a frame after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMotion {
    /// At the picture's time.
    pub now: Vec3,
    /// A frame before, and a frame after.
    pub neighbours: [Vec3; 2],
}

/// The motion of a scene's objects from frame to frame; empty unless it is asked for.
#[derive(Clone, Debug, Default)]
pub struct MotionVectors {
    objects: HashMap<ObjectId, ObjectPoses>,
}

impl MotionVectors {
    /// The motion vectors of a scene whose origin moves to `origin`.
    pub(super) fn of(scene: &Scene, origin: DVec3) -> MotionVectors {
        let (numbering, motion) = (Numbering::of(scene), &scene.motion);
        let to_origin = DAffine3::from_translation(-origin);
        let mut objects = HashMap::new();
        let mut add =
            |object, moving: &Keyframes<DAffine3>, now: DAffine3, of: &dyn Fn(&DAffine3) -> DAffine3| {
                if let Some([before, after]) = &moving.neighbours {
                    let neighbours = [to_origin * of(before), to_origin * of(after)];
                    objects.insert(object, ObjectPoses { now: to_origin * now, neighbours });
                }
            };
        for (i, instance) in scene.instances.iter().enumerate() {
            let Motion::Keyed(number) = instance.motion else { continue };
            if let Some(moving) = motion.instances.get(number as usize) {
                add(numbering.instance(i), moving, instance.world_from_object, &|m| *m);
            }
        }
        // Their spaces begin at their corners and middles.
        for (&i, moving) in &motion.quads {
            let Some(quad) = scene.quads.get(i) else { continue };
            let own = DAffine3::from_translation(quad.corner);
            add(numbering.quad(i), moving, own, &|m| *m * own);
        }
        for (&i, moving) in &motion.shapes {
            let Some(shape) = scene.shapes.get(i) else { continue };
            let own = DAffine3::from_translation(shape.center);
            add(numbering.shape(i), moving, own, &|m| *m * own);
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

/// A point of a mesh that changes its shape: at the picture's time, a frame before and a frame after.
fn deformed(geometries: &Geometries, geometry: usize, hit: &Hit) -> Option<[DVec3; 3]> {
    let space = &geometries.shared[geometry];
    let [before, after] = space.neighbours.as_ref()?;
    let Primitive::Triangle(t) = primitive(&space.shapes, hit.prim) else { return None };
    let lists = [&space.shapes.positions, before, after];
    Some(lists.map(|list| interpolate(vertices(list, t), hit.u, hit.v).as_dvec3()))
}

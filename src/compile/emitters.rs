//! Emissive primitives as area lights. Two triangles that form a parallelogram become one light; a moving primitive is one
//! light with keys.
//!
//! Flat lights coplanar with other surfaces, such as a ceiling, would be occluded or noisy by rounding (z-fighting). They are
//! offset towards their front by slightly more than the rounding error.

use super::geometry::{Geometries, Placement, Primitive, Space, primitive, vertices};
use super::hit_reader::{HitReader, SurfaceHit, point_reader};
use super::material::{CompiledEmission, CompiledMaterial};
use super::objects::{ObjectId, part_materials};
use crate::accel;
use crate::accel::is_valid_position;
use crate::bsdf::Slots;
use crate::color::Rgb;
use crate::error::{Warning, listed};
use crate::light::{AreaLight, AreaShape, Edges, MovingLight, Radiance};
use crate::math::{Bounds3, DAffine3, DMat4, DVec3, Frame, Hit, Mat3, Ray, Vec2, Vec3};
use crate::scene::{MaterialId, Model, Quad, Scene, ShapeKind, instance_extents};
use crate::shape::{Analytic, Packed, Shape};
use crate::texture::{CameraData, CompiledTextures, ObjectData, PathData};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Area lights and their primitives.
#[derive(Debug, Default)]
pub struct Emitters {
    pub lights: Vec<AreaLight>,
    /// Pairs of a primitive of the world and its light, sorted by primitive.
    pub light_of_primitive: Vec<(u32, u32)>,
    /// Keys of moving lights, by light.
    pub moving: BTreeMap<usize, MovingLight<AreaLight>>,
    /// Moving lights by instance and primitive.
    pub moving_primitives: BTreeMap<(u32, u32), u32>,
}

/// All emissive primitives: those of the world, and of moving placements. (Static emissive meshes are merged into the world.)
pub fn find(
    geometries: &Geometries,
    materials: &[CompiledMaterial],
    textures: &CompiledTextures,
    objects: &[ObjectData],
) -> Emitters {
    let mut emitters = Emitters::default();
    if materials.iter().any(|m| m.emission.is_some()) {
        emitters.add_static(&EmissionReader { geometries, textures, objects }, materials);
        emitters.add_moving(geometries, materials);
    }
    emitters
}

/// Evaluation of a material's emission in light sampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sampling {
    /// No light sampling: only BSDF samples find the emission.
    None,
    /// Emission depends on the position alone.
    ByPoint,
    /// Emission and alpha are evaluated as for a hit.
    ByHit,
}

/// Light sampling of a material. Not for emission that depends on the path, which would differ between light and BSDF samples,
/// nor for unlit models, whose emission is not meant as light.
fn sampling_of(material: &CompiledMaterial) -> Sampling {
    let needs_hit = material.emission_depends_on_viewer || material.alpha.is_some();
    let is_unusual = material.reads_path || material.surface_visibility.is_some();
    match material.emission {
        None => Sampling::None,
        _ if material.emission_depends_on_vertex() || needs_hit && is_unusual => Sampling::None,
        _ if needs_hit => Sampling::ByHit,
        _ => Sampling::ByPoint,
    }
}

/// Estimates the emission of surfaces.
struct EmissionReader<'a> {
    geometries: &'a Geometries,
    textures: &'a CompiledTextures,
    objects: &'a [ObjectData],
}

/// Points of a primitive (area coordinates) at which its emission is estimated.
const ESTIMATE_POINTS: [[f32; 2]; 3] = [[1.0 / 6.0; 2], [2.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 2.0 / 3.0]];
/// Cosines of the directions in which emission is estimated.
const ESTIMATE_COSINES: [f32; 2] = [0.9, 0.4];

/// Number of primitives above which emission is estimated at a single point each.
const MANY_PRIMITIVES: usize = 20_000;

impl EmissionReader<'_> {
    /// Estimated mean luminance of the front of a primitive of the world.
    fn luminance(&self, primitive: u32, shape: &AreaShape, material: &CompiledMaterial) -> f32 {
        let light = AreaLight::new(*shape, false, Radiance::Constant(Rgb::ONE));
        let all = self.geometries.world.attributes.materials.len();
        let points = &ESTIMATE_POINTS[..if all > MANY_PRIMITIVES { 1 } else { ESTIMATE_POINTS.len() }];
        let mut sum = 0.0;
        for &place in points {
            let point = light.point_by_area(place);
            let [u, v] = light.edge_coordinates(point);
            let hit = Hit { t: 1.0, u, v, prim: primitive, ..Hit::MISS };
            let normal = light.normal_at(point, point);
            for cosine in ESTIMATE_COSINES {
                let wo = Frame::from_normal(normal).to_world(Vec3::new(
                    (1.0 - cosine * cosine).sqrt(),
                    0.0,
                    cosine,
                ));
                sum += self.emitted(&Ray::new(point + wo, -wo), &hit, material);
            }
        }
        sum / (points.len() * ESTIMATE_COSINES.len()) as f32
    }

    /// Luminance of the emission at a hit, times the alpha.
    fn emitted(&self, ray: &Ray, hit: &Hit, material: &CompiledMaterial) -> f32 {
        let Some(emission) = &material.emission else { return 0.0 };
        let surface = self.geometries.surface(ray, hit, 0.0);
        let coordinates = self.geometries.coordinates(&surface, hit, false, 0.0);
        let camera = CameraData { camera_from_world: &DMat4::IDENTITY, ndc_from_world: None };
        let reader = HitReader { geometries: self.geometries, objects: self.objects, camera };
        let at = SurfaceHit { surface: &surface, hit, material, is_back: false, time: 0.0 };
        let wo = -ray.direction;
        let read = || reader.read(at, &coordinates, wo, PathData::default());
        let hit_data = material.reads_hit.then(read).flatten();
        let slots = point_reader(self.textures, &coordinates, &surface, wo, 0.0, hit_data.as_ref());
        let vertex_alpha = if material.uses_vertex_colors { coordinates.color[3] } else { 1.0 };
        let opacity = material.alpha.map_or(1.0, |alpha| alpha.opacity(&slots, vertex_alpha));
        let luminance = slots.color(&emission.radiance).luminance() * opacity;
        if luminance.is_finite() { luminance.max(0.0) } else { 0.0 }
    }
}

impl Emitters {
    fn add_static(&mut self, reader: &EmissionReader<'_>, materials: &[CompiledMaterial]) {
        let world = &reader.geometries.world;
        let Space { shapes, attributes, .. } = &**world;
        let numbers = &attributes.materials;
        let mut prim = 0;
        while prim < numbers.len() {
            let first = prim;
            prim += 1;
            let material = &materials[numbers[first] as usize];
            let (Some(emission), sampling) = (material.emission, sampling_of(material)) else { continue };
            if sampling == Sampling::None {
                continue;
            }
            let Some(shape) = area_shape(shapes, first as u32, None) else { continue };
            if sampling == Sampling::ByHit {
                let luminance = reader.luminance(first as u32, &shape, material);
                let radiance = Radiance::AtHit { primitive: first as u32, luminance };
                self.push(emission.light(shape, radiance), first..prim);
                continue;
            }
            let is_pair = prim < shapes.triangles.len() && numbers[first] == numbers[prim];
            let is_uniform = emission.radiance.texture.is_none();
            match (is_pair && is_uniform).then(|| parallelogram(shapes, first)).flatten() {
                Some(edges) => {
                    prim += 1;
                    let radiance = Radiance::Constant(Rgb::from_array(emission.radiance.factor));
                    self.push(emission.light(right_angled(edges), radiance), first..prim);
                }
                None => {
                    let radiance = radiance(world, first as u32, &emission, false);
                    self.push(emission.light(shape, radiance), first..prim);
                }
            }
        }
    }

    /// Adds each emissive primitive of moving placements as a light with a key per key of the motion. Other analytic shapes than
    /// spheres are excluded: only BSDF samples find their emission.
    fn add_moving(&mut self, geometries: &Geometries, materials: &[CompiledMaterial]) {
        let is_sampled = |p: &Placement| p.moves && !p.is_unsampled;
        for (index, placement) in geometries.placements.iter().enumerate().filter(|(_, p)| is_sampled(p)) {
            let space = &*geometries.shared[placement.geometry as usize];
            let keys = keys_of(geometries, placement, space);
            for (prim, own) in space.attributes.materials.iter().enumerate() {
                let (prim, material) = (prim as u32, placement.material.unwrap_or(*own));
                let material = &materials[material as usize];
                let Some(emission) = material.emission.filter(|_| sampling_of(material) == Sampling::ByPoint)
                else {
                    continue;
                };
                let shapes = keys.iter().map(|key| area_shape(&space.shapes, prim, Some(key)));
                let Some(shapes) = shapes.collect::<Option<Vec<AreaShape>>>() else { continue };
                let radiance = radiance(space, prim, &emission, keys[0].mirrors());
                let lights = shapes.into_iter().map(|shape| emission.light(shape, radiance)).collect();
                self.push_moving((index as u32 + 1, prim), lights);
            }
        }
    }

    fn push(&mut self, light: AreaLight, prims: Range<usize>) {
        let index = self.lights.len() as u32;
        self.light_of_primitive.extend(prims.map(|p| (p as u32, index)));
        self.lights.push(light);
    }

    /// Adds a moving light by its keys.
    fn push_moving(&mut self, primitive: (u32, u32), keys: Vec<AreaLight>) {
        let Some(&first) = keys.first() else { return };
        let index = self.lights.len();
        self.moving_primitives.insert(primitive, index as u32);
        self.lights.push(first);
        self.moving.insert(index, MovingLight(keys));
    }

    /// Each light with its object and material.
    pub(super) fn owners(&self, geometries: &Geometries) -> impl Iterator<Item = (usize, ObjectId, u32)> {
        let world = &geometries.world;
        let still = self.light_of_primitive.iter().map(|&(prim, light)| {
            (light as usize, world.owners.of(prim), world.attributes.materials[prim as usize])
        });
        let moving = self.moving_primitives.iter().map(|(&(instance, prim), &light)| {
            let hit = Hit { instance, prim, ..Hit::MISS };
            (light as usize, geometries.object(&hit), geometries.material(&hit))
        });
        still.chain(moving)
    }

    /// The light of a primitive of a moving instance.
    #[cold]
    pub fn moving_light_of(&self, instance: u32, prim: u32) -> Option<u32> {
        self.moving_primitives.get(&(instance, prim)).copied()
    }

    /// The light of a primitive of the world.
    #[inline]
    pub fn light_of(&self, prim: u32) -> Option<u32> {
        let at = self.light_of_primitive.binary_search_by_key(&prim, |&(p, _)| p).ok()?;
        Some(self.light_of_primitive[at].1)
    }
}

impl CompiledEmission {
    fn light(&self, shape: AreaShape, radiance: Radiance) -> AreaLight {
        AreaLight::new(shape, self.two_sided, radiance).with_beam(self.beam)
    }
}

fn corners(shapes: &accel::Geometry, prim: usize) -> [Vec3; 3] {
    shapes.triangles[prim].map(|i| Vec3::from_array(shapes.positions[i as usize]))
}

/// The parallelogram of a triangle and the next one, if any: they share an edge with opposite directions, and the sum of its
/// ends equals the sum of the other two vertices within rounding.
fn parallelogram(shapes: &accel::Geometry, prim: usize) -> Option<Edges> {
    let (first, second) = (corners(shapes, prim), corners(shapes, prim + 1));
    for i in 0..3 {
        let (apex, start, end) = (first[i], first[(i + 1) % 3], first[(i + 2) % 3]);
        for j in 0..3 {
            let (other, back, forth) = (second[j], second[(j + 1) % 3], second[(j + 2) % 3]);
            if back != end || forth != start {
                continue;
            }
            let size =
                [apex, start, end, other].map(|p| p.abs().max_element()).into_iter().fold(0.0, f32::max);
            let gap = (apex + other) - (start + end);
            let is_closed = gap.abs().max_element() <= 4.0 * f32::EPSILON * size;
            return is_closed.then(|| Edges { corner: apex, edge_u: start - apex, edge_v: end - apex });
        }
    }
    None
}

/// A key of a placement's motion: transform, and vertices of the mesh.
struct Key<'a> {
    world_from_object: DAffine3,
    positions: &'a [[f32; 3]],
}

impl Key<'_> {
    fn point(&self, p: Vec3) -> Vec3 {
        self.world_from_object.transform_point3(p.as_dvec3()).as_vec3()
    }

    fn vector(&self, v: Vec3) -> Vec3 {
        self.world_from_object.transform_vector3(v.as_dvec3()).as_vec3()
    }

    fn mirrors(&self) -> bool {
        self.world_from_object.matrix3.determinant() < 0.0
    }

    /// A transformed shape defined by centre and radius; `None` for others.
    fn sphere(&self, shape: &Analytic) -> Option<Analytic> {
        let (Analytic::Sphere(_) | Analytic::FacingDisk(_) | Analytic::Shell(_)) = shape else { return None };
        let packed = shape.pack();
        let [x, y, z, radius, ..] = packed.parameters;
        let [x, y, z] = self.point(Vec3::new(x, y, z)).to_array();
        let scale = self.world_from_object.matrix3.x_axis.length() as f32;
        Analytic::unpack(&Packed { parameters: [x, y, z, radius * scale, 0.0, 0.0], ..packed })
    }
}

fn keys_of<'a>(geometries: &Geometries, placement: &Placement, space: &'a Space) -> Vec<Key<'a>> {
    let transforms = placement.motion.map_or(0, |motion| geometries.motions[motion as usize].len());
    let count = transforms.max(space.shapes.keys.len()).max(1);
    let key = |k: usize| {
        let time = k as f32 / (count - 1).max(1) as f32;
        let positions = space.shapes.keys.get(k).unwrap_or(&space.shapes.positions);
        Key { world_from_object: geometries.world_from_object(placement, time), positions }
    };
    (0..count).map(key).collect()
}

/// The light shape of a primitive, at a key if it moves; `None` without area, for invalid positions, and for curves.
fn area_shape(shapes: &accel::Geometry, prim: u32, key: Option<&Key>) -> Option<AreaShape> {
    let point = |p: Vec3| key.map_or(p, |key| key.point(p));
    let vector = |v: Vec3| key.map_or(v, |key| key.vector(v));
    // Swapped edges keep the front side under mirroring transforms.
    let oriented = |edges: Edges| match key.is_some_and(Key::mirrors) {
        true => Edges { edge_u: edges.edge_v, edge_v: edges.edge_u, ..edges },
        false => edges,
    };
    let shape = match primitive(shapes, prim) {
        Primitive::Triangle(t) => {
            let positions = key.map_or(&shapes.positions[..], |key| key.positions);
            let [a, b, c] = vertices(positions, t).map(|p| point(Vec3::from_array(p)));
            AreaShape::Triangle(oriented(Edges { corner: a, edge_u: b - a, edge_v: c - a }))
        }
        Primitive::Quad(q) => {
            let (corner, edge_u, edge_v) = (point(q.corner), vector(q.edge_u), vector(q.edge_v));
            let edges = oriented(Edges { corner, edge_u, edge_v });
            // Interpolation between keys may not preserve right angles.
            if key.is_some() { AreaShape::Parallelogram(edges) } else { right_angled(edges) }
        }
        Primitive::Analytic(_, shape) => AreaShape::Analytic(match key {
            None => *shape,
            Some(key) => key.sphere(shape)?,
        }),
        Primitive::Curve(..) | Primitive::Splat(..) => return None,
    };
    is_usable(&shape).then_some(shape)
}

/// Has a light a positive area and valid positions? The BVH drops primitives with invalid positions.
fn is_usable(shape: &AreaShape) -> bool {
    let is_valid = |bounds: Bounds3| is_valid_position(bounds.min) && is_valid_position(bounds.max);
    match shape {
        AreaShape::Triangle(e) | AreaShape::Parallelogram(e) | AreaShape::Rectangle(e) => {
            let area = e.edge_u.cross(e.edge_v).length();
            let corners = [e.corner, e.corner + e.edge_u, e.corner + e.edge_v];
            let opposite = if let AreaShape::Triangle(_) = shape { e.corner } else { corners[2] + e.edge_u };
            area > 0.0 && area.is_finite() && is_valid(Bounds3::of(corners.into_iter().chain([opposite])))
        }
        AreaShape::Analytic(shape) => is_valid(shape.bounds()),
    }
}

/// A rectangle, if the edges of a parallelogram are orthogonal within rounding.
fn right_angled(edges: Edges) -> AreaShape {
    let (u, v) = (edges.edge_u, edges.edge_v);
    let is_right_angled = u.dot(v).abs() <= 1e-6 * u.length() * v.length();
    if is_right_angled { AreaShape::Rectangle(edges) } else { AreaShape::Parallelogram(edges) }
}

/// The radiance of a primitive. `mirrors`: edges are swapped, and so are texture coordinates.
fn radiance(space: &Space, prim: u32, emission: &CompiledEmission, mirrors: bool) -> Radiance {
    let order = |[a, b, c]: [Vec2; 3]| if mirrors { [a, c, b] } else { [a, b, c] };
    let factor = Rgb::from_array(emission.radiance.factor);
    let Some(texture) = emission.radiance.texture else { return Radiance::Constant(factor) };
    match primitive(&space.shapes, prim) {
        Primitive::Triangle(t) => {
            let uv_of = |list: &Vec<[f32; 2]>| {
                order(t.map(|i| list.get(i as usize).map_or(Vec2::ZERO, |&uv| Vec2::from_array(uv))))
            };
            Radiance::Flat {
                texture,
                factor,
                uv: [uv_of(&space.attributes.uv[0]), uv_of(&space.attributes.uv[1])],
            }
        }
        Primitive::Quad(_) => {
            Radiance::Flat { texture, factor, uv: [order([Vec2::ZERO, Vec2::X, Vec2::Y]); 2] }
        }
        Primitive::Analytic(index, _) => {
            let object_from_world: Mat3 = space.attributes.object_from_world(index);
            Radiance::Analytic { texture, factor, object_from_world }
        }
        Primitive::Curve(..) | Primitive::Splat(..) => unreachable!("they are no lights"),
    }
}

/// Maximum number of flat lights that are tested for coplanar surfaces.
const MAX_LIGHTS: usize = 256;

/// Maximum distance of coplanar points, relative to the largest coordinate around the camera.
const COPLANAR: f64 = 4e-7;

/// Offset of coplanar lights, relative to the largest coordinate around the camera.
const OFFSET: f64 = 4e-6;

/// Offsets of coplanar lights, by index of the quad or shape in the scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Shifts {
    pub quads: BTreeMap<usize, DVec3>,
    pub shapes: BTreeMap<usize, DVec3>,
}

/// A flat light with its bounding parallelogram.
struct FlatLight<'a> {
    index: usize,
    is_quad: bool,
    name: &'a str,
    corner: DVec3,
    edges: [DVec3; 2],
    normal: DVec3,
    /// Largest coordinate relative to the compiled scene's origin.
    reach: f64,
}

impl FlatLight<'_> {
    /// Is a polygon coplanar with the light, and does it overlap the light in bounds along the edges?
    fn is_covered_by(&self, corners: &[DVec3]) -> bool {
        let distance = corners.iter().map(|p| (*p - self.corner).dot(self.normal).abs()).fold(0.0, f64::max);
        if distance > COPLANAR * self.reach {
            return false;
        }
        self.edges.iter().all(|edge| {
            let along = corners.iter().map(|p| (*p - self.corner).dot(*edge) / edge.length_squared());
            let (low, high) =
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
            low < 1.0 - 1e-6 && high > 1e-6
        })
    }

    fn corners(&self) -> [DVec3; 4] {
        let [u, v] = self.edges;
        [self.corner, self.corner + u, self.corner + v, self.corner + u + v]
    }
}

/// Finds the flat lights of a scene that are coplanar with other surfaces; `origin` is that of the compiled scene.
pub(super) fn find_flush_lights(scene: &Scene, origin: DVec3, notes: &mut Vec<Warning>) -> Shifts {
    let lights = flat_lights(scene, origin);
    if lights.is_empty() || lights.len() > MAX_LIGHTS {
        return Shifts::default();
    }
    let mut is_flush: Vec<bool> = lights.iter().map(|light| is_on_quad(light, scene)).collect();
    mark_on_meshes(scene, &lights, &mut is_flush);
    let mut shifts = Shifts::default();
    let found = || lights.iter().zip(&is_flush).filter(|(_, flush)| **flush).map(|(light, _)| light);
    for light in found() {
        let list = if light.is_quad { &mut shifts.quads } else { &mut shifts.shapes };
        list.insert(light.index, light.normal * (OFFSET * light.reach));
    }
    let names: Vec<&str> = found().map(|light| light.name).collect();
    if !names.is_empty() {
        notes.push(Warning::general(format!(
            "lights in the plane of other surfaces are moved slightly in front of them: {}",
            listed(&names)
        )));
    }
    shifts
}

fn flat_lights(scene: &Scene, origin: DVec3) -> Vec<FlatLight<'_>> {
    let is_emissive = |id: MaterialId| scene.materials.get(id.index()).is_some_and(|m| m.emission.is_some());
    let new = |index: usize, is_quad, name, corner: DVec3, edges: [DVec3; 2]| {
        let normal = edges[0].cross(edges[1]).try_normalize()?;
        let max_coordinate = |p: DVec3| (p - origin).abs().max_element();
        let mut light = FlatLight { index, is_quad, name, corner, edges, normal, reach: 0.0 };
        light.reach = light.corners().map(max_coordinate).into_iter().fold(0.0, f64::max);
        Some(light)
    };
    let quads = scene.quads.iter().enumerate().filter(|(_, quad)| is_emissive(quad.material));
    let quads = quads.filter_map(|(i, q)| new(i, true, q.name.as_str(), q.corner, [q.edge_u, q.edge_v]));
    let disks = scene.shapes.iter().enumerate();
    let disks = disks.filter(|(_, s)| matches!(s.kind, ShapeKind::Disk) && is_emissive(s.material));
    let disks = disks.filter_map(|(i, s)| {
        // The front of a disk faces its local z axis.
        let [x, y] = [DVec3::X, DVec3::Y].map(|axis| s.rotation * axis * s.radius);
        new(i, false, s.name.as_str(), s.center - x - y, [x * 2.0, y * 2.0])
    });
    quads.chain(disks).collect()
}

/// Is a material an opaque surface in front of lights? Not if emissive or a medium boundary.
fn occludes(scene: &Scene, id: MaterialId) -> bool {
    let material = &scene.materials[id.index()];
    material.emission.is_none() && !matches!(material.model, Model::Boundary {})
}

/// Is another quad coplanar with a light?
fn is_on_quad(light: &FlatLight<'_>, scene: &Scene) -> bool {
    let is_other = |quad: &&Quad| occludes(scene, quad.material);
    scene.quads.iter().filter(is_other).any(|quad| {
        let opposite = quad.corner + quad.edge_u + quad.edge_v;
        light.is_covered_by(&[quad.corner, quad.corner + quad.edge_u, opposite, quad.corner + quad.edge_v])
    })
}

/// Marks the lights that are coplanar with triangles of meshes.
fn mark_on_meshes(scene: &Scene, lights: &[FlatLight<'_>], is_flush: &mut [bool]) {
    let is_ignored = |id: MaterialId| !occludes(scene, id);
    for (instance, extent) in scene.instances.iter().zip(instance_extents(scene)) {
        let mesh = &scene.meshes[instance.mesh.index()];
        let Some((low, high)) = extent.0.filter(|_| !part_materials(mesh, instance).all(is_ignored)) else {
            continue;
        };
        for (light, flush) in lights.iter().zip(&mut *is_flush).filter(|(_, flush)| !**flush) {
            let margin = DVec3::splat(COPLANAR * light.reach);
            let (from, to) = light
                .corners()
                .into_iter()
                .fold((light.corner, light.corner), |(l, h), p| (l.min(p), h.max(p)));
            if (from - margin).cmpgt(high).any() || (to + margin).cmplt(low).any() {
                continue;
            }
            *flush = mesh.triangles.par_iter().with_min_len(4096).any(|t| {
                let place = |p| instance.world_from_object.transform_point3(p);
                light.is_covered_by(&mesh.corners_f64(*t).map(place))
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;

    /// The offset of a square light of 1 m that faces down, at a height below a ceiling at 2.5 m.
    fn shift_at(height: f64) -> Option<DVec3> {
        let mut scene = Scene::default();
        let wall = scene.add_material(Material::lambert("wall", [0.7; 3]));
        let lamp = scene.add_material(Material::emitter("lamp", [5.0; 3], false));
        scene.quads.push(Quad::new([-2.0, 2.5, -2.0], [4.0, 0.0, 0.0], [0.0, 0.0, 4.0], wall));
        scene.quads.push(Quad::new([-0.5, height, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], lamp));
        let mut notes = Vec::new();
        let shifts = find_flush_lights(&scene, DVec3::new(0.0, 1.0, 2.0), &mut notes);
        assert_eq!(notes.len(), shifts.quads.len());
        shifts.quads.get(&1).copied()
    }

    #[test]
    fn lights_coplanar_with_a_ceiling_are_moved_to_their_front() {
        let shift = shift_at(2.5).expect("it is in its plane");
        assert!(shift.y < -1e-6 && shift.y > -1e-4 && shift.x == 0.0 && shift.z == 0.0, "{shift}");
        assert_eq!(shift_at(2.499), None);
    }
}

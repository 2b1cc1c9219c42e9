//! What shines and moves: each triangle, quad and sphere of a placement that moves becomes a light of its own, with a key for each of
//! the placement's.

use super::emitters::{Emitters, is_reached, sampled_emission};
use super::geometry::{Geometries, Placement, Primitive, Space, primitive, vertices};
use super::material::{CompiledEmission, CompiledMaterial};
use crate::accel;
use crate::color::Rgb;
use crate::light::{AreaLight, AreaShape, Edges, Radiance};
use crate::math::{Bounds3, DAffine3, Mat3, Vec2, Vec3};
use crate::shape::{Analytic, Packed, Shape};

/// What an emitter is at a key.
enum Shine {
    Triangle(Edges),
    Parallelogram(Edges),
    Sphere(Analytic),
}

/// Adds the lights of placements that move. (Disks that move, and surfaces whose presence is uncertain, are none: paths find them.)
pub(super) fn add(emitters: &mut Emitters, geometries: &Geometries, materials: &[CompiledMaterial]) {
    if materials.iter().all(|m| m.emission.is_none()) {
        return;
    }
    for (index, placement) in geometries.placements.iter().enumerate().filter(|(_, p)| p.moves) {
        let space = &*geometries.shared[placement.geometry as usize];
        let keys = keys_of(geometries, placement, space);
        for prim in 0..space.attributes.materials.len() as u32 {
            let own = space.attributes.materials[prim as usize];
            let material = &materials[placement.material.unwrap_or(own) as usize];
            let Some(emission) = sampled_emission(material) else { continue };
            let at_keys: Option<Vec<Shine>> = keys.iter().map(|key| shine(space, prim, key)).collect();
            let Some(at_keys) = at_keys.filter(|keys| keys.iter().all(Shine::is_usable)) else { continue };
            let mirrors = keys[0].world_from_object.matrix3.determinant() < 0.0;
            let radiance = radiance(space, prim, &emission, mirrors);
            let light = |shape| AreaLight::new(shape, emission.two_sided, radiance).with_beam(emission.beam);
            let lights = at_keys.into_iter().map(Shine::into_shape).map(light).collect();
            emitters.push_moving((index as u32 + 1, prim), lights);
        }
    }
}

/// A moment of a placement: where it stands, and its vertices.
struct Key<'a> {
    world_from_object: DAffine3,
    positions: &'a [[f32; 3]],
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

/// A primitive as a light at a key.
fn shine(space: &Space, prim: u32, key: &Key) -> Option<Shine> {
    let m = &key.world_from_object;
    let point = |p: Vec3| m.transform_point3(p.as_dvec3()).as_vec3();
    let vector = |v: Vec3| m.transform_vector3(v.as_dvec3()).as_vec3();
    // The front of a mirror image is the mirror image of the front.
    let turned = |edges: Edges| match m.matrix3.determinant() < 0.0 {
        true => Edges { edge_u: edges.edge_v, edge_v: edges.edge_u, ..edges },
        false => edges,
    };
    match primitive(&space.shapes, prim) {
        Primitive::Triangle(t) => {
            let [a, b, c] = vertices(key.positions, t).map(|p| point(Vec3::from_array(p)));
            Some(Shine::Triangle(turned(Edges { corner: a, edge_u: b - a, edge_v: c - a })))
        }
        Primitive::Quad(q) => {
            let (corner, edge_u, edge_v) = (point(q.corner), vector(q.edge_u), vector(q.edge_v));
            Some(Shine::Parallelogram(turned(Edges { corner, edge_u, edge_v })))
        }
        Primitive::Analytic(_, Analytic::Sphere(_) | Analytic::FacingDisk(_) | Analytic::Shell(_)) => {
            let scale = m.matrix3.x_axis.length() as f32;
            let packed = sphere_of(&space.shapes, prim)?.pack();
            let [x, y, z, radius, ..] = packed.numbers;
            let [x, y, z] = point(Vec3::new(x, y, z)).to_array();
            let numbers = [x, y, z, radius * scale, 0.0, 0.0];
            Analytic::unpack(&Packed { numbers, ..packed }).map(Shine::Sphere)
        }
        Primitive::Analytic(..) | Primitive::Curve(..) => None,
    }
}

fn sphere_of(shapes: &accel::Geometry, prim: u32) -> Option<&Analytic> {
    let first = shapes.triangles.len() + shapes.quads.len();
    shapes.analytic.get(prim as usize - first)
}

/// What a primitive emits. The edges of mirror images are swapped, and so are their texture coordinates.
fn radiance(space: &Space, prim: u32, emission: &CompiledEmission, mirrors: bool) -> Radiance {
    let order = |[a, b, c]: [Vec2; 3]| if mirrors { [a, c, b] } else { [a, b, c] };
    let factor = Rgb::from_array(emission.radiance.factor);
    let Some(texture) = emission.radiance.texture else { return Radiance::Constant(factor) };
    match primitive(&space.shapes, prim) {
        Primitive::Triangle(t) => {
            let of = |list: &Vec<[f32; 2]>| {
                order(t.map(|i| list.get(i as usize).map_or(Vec2::ZERO, |&uv| Vec2::from_array(uv))))
            };
            Radiance::Flat { texture, factor, uv: [of(&space.attributes.uv[0]), of(&space.attributes.uv[1])] }
        }
        Primitive::Quad(_) => {
            Radiance::Flat { texture, factor, uv: [order([Vec2::ZERO, Vec2::X, Vec2::Y]); 2] }
        }
        Primitive::Analytic(index, _) => {
            let object_from_world: Mat3 = space.attributes.object_from_world(index);
            Radiance::Analytic { texture, factor, object_from_world }
        }
        Primitive::Curve(..) => unreachable!("curves don't shine"),
    }
}

impl Shine {
    fn is_usable(&self) -> bool {
        match self {
            Shine::Triangle(e) | Shine::Parallelogram(e) => {
                let area = e.edge_u.cross(e.edge_v).length();
                let corners = [e.corner, e.corner + e.edge_u, e.corner + e.edge_v];
                area > 0.0 && area.is_finite() && is_reached(Bounds3::of(corners))
            }
            Shine::Sphere(sphere) => is_reached(sphere.bounds()),
        }
    }

    fn into_shape(self) -> AreaShape {
        match self {
            Shine::Triangle(edges) => AreaShape::Triangle(edges),
            Shine::Parallelogram(edges) => AreaShape::Parallelogram(edges),
            Shine::Sphere(sphere) => AreaShape::Analytic(sphere),
        }
    }
}

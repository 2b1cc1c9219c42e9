//! Finds what shines: emitting primitives become area lights, pairs of triangles that form a parallelogram one light.

use super::geometry::{Attributes, Geometries, Space};
use super::material::{CompiledEmission, CompiledMaterial};
use super::objects::ObjectId;
use crate::accel::{self, is_in_reach};
use crate::color::Rgb;
use crate::light::{AreaLight, AreaShape, Edges, MovingLight, Radiance};
use crate::math::{Bounds3, Hit, Mat3, Vec2, Vec3};
use crate::shape::{Analytic, Shape};
use std::collections::BTreeMap;

/// Area lights and which primitives they are.
#[derive(Debug, Default)]
pub struct Emitters {
    /// The lights.
    pub lights: Vec<AreaLight>,
    /// Primitive of the world's own geometry and its light, by primitive.
    pub light_of_primitive: Vec<(u32, u32)>,
    /// Of lights that move, at the keys of their motion.
    pub moving: BTreeMap<usize, MovingLight<AreaLight>>,
    /// Their instances and primitives.
    pub moving_primitives: BTreeMap<(u32, u32), u32>,
}

/// All emitting primitives of the world's own geometry; no other has any, but for what moves.
pub fn find(geometries: &Geometries, materials: &[CompiledMaterial]) -> Emitters {
    let mut emitters = Emitters::default();
    if materials.iter().all(|m| m.emission.is_none()) {
        return emitters;
    }
    let Space { shapes, attributes, .. } = &*geometries.world;
    let material = |prim: usize| attributes.materials[prim] as usize;
    let emits = |prim: usize| sampled_emission(&materials[material(prim)]).is_some();
    let (triangles, quads) = (shapes.triangles.len(), shapes.quads.len());
    let mut prim = 0;
    while prim < triangles {
        if !emits(prim) {
            prim += 1;
            continue;
        }
        let shape = triangle_edges(shapes, prim);
        let is_pair = prim + 1 < triangles && material(prim) == material(prim + 1);
        let merged = (is_pair && shape.is_some()).then(|| parallelogram(shapes, prim)).flatten();
        let is_constant = materials[material(prim)].emission.is_some_and(|e| e.radiance.texture.is_none());
        match (merged, shape) {
            (Some(edges), _) if is_constant => {
                emitters.add(flat(edges), &materials[material(prim)], None, &[prim, prim + 1]);
                prim += 2;
            }
            (_, Some(edges)) => {
                let uv = triangle_uv(attributes, shapes.triangles[prim]);
                emitters.add(AreaShape::Triangle(edges), &materials[material(prim)], Some(uv), &[prim]);
                prim += 1;
            }
            _ => prim += 1,
        }
    }
    for (i, quad) in shapes.quads.iter().enumerate() {
        let edges = Edges { corner: quad.corner, edge_u: quad.edge_u, edge_v: quad.edge_v };
        if quad.edge_u.cross(quad.edge_v).length() > 0.0 && is_reached(quad.bounds()) {
            let uv = [[Vec2::ZERO, Vec2::X, Vec2::Y]; 2];
            emitters.add(flat(edges), &materials[material(triangles + i)], Some(uv), &[triangles + i]);
        }
    }
    for (i, shape) in shapes.analytic.iter().enumerate().filter(|(_, shape)| is_reached(shape.bounds())) {
        let prim = triangles + quads + i;
        let rotation = attributes.object_from_world(i);
        emitters.add_analytic(*shape, &materials[material(prim)], rotation, prim);
    }
    emitters
}

/// The emission that light sampling knows of. Where a surface is partly absent, or shines otherwise for each viewer, only paths that
/// meet it find its light.
pub(super) fn sampled_emission(material: &CompiledMaterial) -> Option<CompiledEmission> {
    material.emission.filter(|_| material.alpha.is_none() && !material.shines_by_viewer)
}

impl Emitters {
    fn add(
        &mut self,
        shape: AreaShape,
        material: &CompiledMaterial,
        uv: Option<[[Vec2; 3]; 2]>,
        prims: &[usize],
    ) {
        let Some(emission) = sampled_emission(material) else { return };
        let factor = Rgb::from_array(emission.radiance.factor);
        let radiance = match (emission.radiance.texture, uv) {
            (Some(texture), Some(uv)) => Radiance::Flat { texture, factor, uv },
            _ => Radiance::Constant(factor),
        };
        self.push(AreaLight::new(shape, emission.two_sided, radiance).with_beam(emission.beam), prims);
    }

    fn add_analytic(
        &mut self,
        shape: Analytic,
        material: &CompiledMaterial,
        object_from_world: Mat3,
        prim: usize,
    ) {
        let Some(emission) = sampled_emission(material) else { return };
        let factor = Rgb::from_array(emission.radiance.factor);
        let radiance = match emission.radiance.texture {
            Some(texture) => Radiance::Analytic { texture, factor, object_from_world },
            None => Radiance::Constant(factor),
        };
        let light = AreaLight::new(AreaShape::Analytic(shape), emission.two_sided, radiance);
        self.push(light.with_beam(emission.beam), &[prim]);
    }

    fn push(&mut self, light: AreaLight, prims: &[usize]) {
        let index = self.lights.len() as u32;
        self.light_of_primitive.extend(prims.iter().map(|&p| (p as u32, index)));
        self.lights.push(light);
    }

    /// Adds a light that moves, at its keys.
    pub(super) fn push_moving(&mut self, primitive: (u32, u32), keys: Vec<AreaLight>) {
        let Some(&first) = keys.first() else { return };
        let index = self.lights.len();
        self.moving_primitives.insert(primitive, index as u32);
        self.lights.push(first);
        self.moving.insert(index, MovingLight(keys));
    }

    /// Each light with an object and a material of what it is the light of.
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

    /// The light that a primitive of a placement is part of.
    #[cold]
    pub fn moving_light_of(&self, instance: u32, prim: u32) -> Option<u32> {
        self.moving_primitives.get(&(instance, prim)).copied()
    }

    /// The light that a primitive is part of.
    #[inline]
    pub fn light_of(&self, prim: u32) -> Option<u32> {
        let at = self.light_of_primitive.binary_search_by_key(&prim, |&(p, _)| p).ok()?;
        Some(self.light_of_primitive[at].1)
    }
}

fn corners(shapes: &accel::Geometry, prim: usize) -> [Vec3; 3] {
    shapes.triangles[prim].map(|i| Vec3::from_array(shapes.positions[i as usize]))
}

/// Can rays reach what lies in a box? The accelerator drops what they can't, which then shines no more than it is seen.
pub(super) fn is_reached(bounds: Bounds3) -> bool {
    is_in_reach(bounds.min) && is_in_reach(bounds.max)
}

/// The triangle at its first vertex; `None` without area or too far away (the accelerator drops it).
fn triangle_edges(shapes: &accel::Geometry, prim: usize) -> Option<Edges> {
    let [a, b, c] = corners(shapes, prim);
    if ![a, b, c].into_iter().all(is_in_reach) {
        return None;
    }
    let edges = Edges { corner: a, edge_u: b - a, edge_v: c - a };
    let area = edges.edge_u.cross(edges.edge_v).length();
    (area > 0.0 && area.is_finite()).then_some(edges)
}

fn triangle_uv(attributes: &Attributes, t: [u32; 3]) -> [[Vec2; 3]; 2] {
    [0, 1].map(|set| {
        let list = &attributes.uv[set];
        t.map(|i| list.get(i as usize).map_or(Vec2::ZERO, |&uv| Vec2::from_array(uv)))
    })
}

fn flat(edges: Edges) -> AreaShape {
    let (u, v) = (edges.edge_u, edges.edge_v);
    let is_right_angled = u.dot(v).abs() <= 1e-6 * u.length() * v.length();
    if is_right_angled { AreaShape::Rectangle(edges) } else { AreaShape::Parallelogram(edges) }
}

/// The parallelogram that a triangle and the next one form, if they do: they share an edge that they run through in
/// opposite directions, and its ends add up to the same point as the other two vertices, but for rounding.
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

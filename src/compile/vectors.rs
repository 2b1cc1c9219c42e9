//! Where surfaces are a frame before and after the picture: for motion vectors.

use super::geometry::{Geometries, Primitive, primitive, vertices};
use super::objects::{Numbering, ObjectId};
use crate::math::{DAffine3, DVec3, Hit, Vec3};
use crate::scene::{Motion, Moving, Scene};
use crate::shape::triangle::interpolate;
use std::collections::HashMap;

/// How something stands at the picture's moment, and a frame before and after.
#[derive(Clone, Copy, Debug)]
struct Places {
    now: DAffine3,
    neighbours: [DAffine3; 2],
}

/// A point of a surface at the picture's moment, a frame before and a frame after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    /// At the picture's moment.
    pub now: Vec3,
    /// A frame before, and a frame after.
    pub neighbours: [Vec3; 2],
}

/// The motion of a scene's objects from frame to frame; empty unless it is asked for.
#[derive(Clone, Debug, Default)]
pub struct Vectors {
    objects: HashMap<ObjectId, Places>,
}

impl Vectors {
    /// Those of a scene whose origin moves to `origin`.
    pub(super) fn of(scene: &Scene, origin: DVec3) -> Vectors {
        let (numbering, motion) = (Numbering::of(scene), &scene.motion);
        let to_origin = DAffine3::from_translation(-origin);
        let mut objects = HashMap::new();
        let mut add =
            |object, moving: &Moving<DAffine3>, now: DAffine3, of: &dyn Fn(&DAffine3) -> DAffine3| {
                if let Some([before, after]) = &moving.neighbours {
                    let neighbours = [to_origin * of(before), to_origin * of(after)];
                    objects.insert(object, Places { now: to_origin * now, neighbours });
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
        Vectors { objects }
    }

    /// The way of the point `p` of a surface that was hit at a time.
    pub fn way(&self, geometries: &Geometries, hit: &Hit, p: Vec3, time: f32) -> Way {
        let still = Way { now: p, neighbours: [p; 2] };
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
        Way { now: place(&places.now, now), neighbours: [place(m0, before), place(m1, after)] }
    }
}

/// A point of a mesh that changes its shape: at the picture's moment, a frame before and a frame after.
fn deformed(geometries: &Geometries, geometry: usize, hit: &Hit) -> Option<[DVec3; 3]> {
    let space = &geometries.shared[geometry];
    let [before, after] = space.neighbours.as_ref()?;
    let Primitive::Triangle(t) = primitive(&space.shapes, hit.prim) else { return None };
    let lists = [&space.shapes.positions, before, after];
    Some(lists.map(|list| interpolate(vertices(list, t), hit.u, hit.v).as_dvec3()))
}

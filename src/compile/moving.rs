//! Surfaces of what moves while a picture is taken, as they are at a path's time.

use super::geometry::{
    Attributes, Geometries, Placement, Primitive, Space, SurfaceCoordinates, Transform, frame_of, primitive,
    vertices,
};
use crate::accel;
use crate::math::{DAffine3, Hit, Ray, Vec2, Vec3, gamma, segment, transform_at};
use crate::shape::{Shape, Surface, shading_normal, triangle_surface};

/// The primitive at a hit at a time, with all that it is part of.
pub(super) struct Moment<'a> {
    space: &'a Space,
    placement: Placement,
    world_from_object: DAffine3,
    time: f32,
}

impl Geometries {
    /// A hit on something that moves, at the time of its path; `None` on all else.
    #[inline(always)]
    pub(super) fn moment(&self, hit: &Hit, time: f32) -> Option<Moment<'_>> {
        if self.moves { self.moment_at(hit, time) } else { None }
    }

    #[cold]
    #[inline(never)]
    fn moment_at(&self, hit: &Hit, time: f32) -> Option<Moment<'_>> {
        let placement = self.placements.get((hit.instance as usize).wrapping_sub(1)).filter(|p| p.moves)?;
        let space = &*self.shared[placement.geometry as usize];
        let world_from_object = self.world_from_object(placement, time);
        let placement = Placement { world_from_object: Transform::of(&world_from_object), ..*placement };
        Some(Moment { space, placement, world_from_object, time })
    }

    /// Where a placement stands at a time.
    pub(super) fn world_from_object(&self, placement: &Placement, time: f32) -> DAffine3 {
        match placement.motion.and_then(|motion| self.motions.get(motion as usize)) {
            Some(keys) => transform_at(keys, time),
            None => placement.world_from_object.to_double(),
        }
    }
}

impl Moment<'_> {
    /// The corners of a triangle.
    fn corners(&self, t: [u32; 3]) -> [[f32; 3]; 3] {
        corners_at(&self.space.shapes, t, self.time)
    }

    /// A point of the world in the object's space.
    fn to_object(&self, p: Vec3) -> Vec3 {
        self.world_from_object.inverse().transform_point3(p.as_dvec3()).as_vec3()
    }

    /// The surface at a hit of `ray`.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let Space { shapes, attributes, .. } = self.space;
        let mut surface = match primitive(shapes, hit.prim) {
            Primitive::Triangle(t) => {
                let mut s = triangle_surface(self.corners(t), hit.u, hit.v);
                if !attributes.normals.is_empty() {
                    s.ns = shading_normal(attributes.normals_at(t, self.time), hit.u, hit.v, s.ng);
                }
                s
            }
            Primitive::Quad(q) => {
                let corners = [q.corner, q.corner + q.edge_u, q.corner + q.edge_v];
                triangle_surface(corners.map(|c| c.to_array()), hit.u, hit.v)
            }
            Primitive::Analytic(_, shape) => {
                shape.surface(self.to_object(ray.at(hit.t)), self.to_object(ray.origin))
            }
            Primitive::Curve(..) => unreachable!("curves stand still"),
        };
        surface.material = attributes.materials[hit.prim as usize];
        let surface = self.placement.surface_to_world(&surface);
        // Rays that leave it are taken back to its space in single precision.
        let back = surface.p.abs() + self.placement.world_from_object.translation.abs();
        Surface { p_error: surface.p_error + back * gamma(4), ..surface }
    }

    /// Does a ray hit the back of a flat primitive? `None` for others.
    pub fn is_back_of_flat(&self, ray: &Ray, hit: &Hit) -> Option<bool> {
        let corners = match primitive(&self.space.shapes, hit.prim) {
            Primitive::Triangle(t) => self.corners(t),
            Primitive::Quad(q) => [q.corner, q.corner + q.edge_u, q.corner + q.edge_v].map(|c| c.to_array()),
            Primitive::Analytic(..) | Primitive::Curve(..) => return None,
        };
        let ng = triangle_surface(corners, 0.0, 0.0).ng;
        let ng = self.placement.world_from_object.normal_from_object * ng;
        Some(ng.dot(ray.direction) > 0.0)
    }

    /// Texture coordinates, colour and tangents.
    pub fn coordinates(&self, surface: &Surface, hit: &Hit, footprints: bool) -> SurfaceCoordinates {
        let Space { shapes, attributes, .. } = self.space;
        let linear = self.placement.world_from_object.linear;
        match primitive(shapes, hit.prim) {
            Primitive::Triangle(t) => {
                let corners = self.corners(t).map(|c| linear * Vec3::from_array(c));
                attributes.of_triangle(t, corners, hit, surface, &linear, footprints)
            }
            Primitive::Quad(q) => {
                let [u, v] = [linear * q.edge_u, linear * q.edge_v];
                let uv = Vec2::new(hit.u, hit.v);
                let uv_per_metre = [u.cross(v).length().sqrt().recip(); 2];
                let tangent_frame = frame_of(u, surface.ns, -1.0);
                SurfaceCoordinates { uv: [uv, uv], color: [1.0; 4], tangent_frame, uv_per_metre }
            }
            Primitive::Analytic(index, shape) => {
                let object_from_world = attributes.object_from_world(index);
                let (p, normal) = (self.to_object(surface.p), (linear.transpose() * surface.ng).normalize());
                let uv = shape.texture_coordinates(p, normal, &object_from_world);
                let lies = shape.parametrize(normal, &object_from_world);
                let tangent_frame = frame_of(linear * lies.tangent, surface.ns, lies.handedness);
                let scale = linear.determinant().abs().cbrt();
                let uv_per_metre = [lies.uv_per_metre / scale; 2];
                SurfaceCoordinates { uv: [uv, uv], color: [1.0; 4], tangent_frame, uv_per_metre }
            }
            Primitive::Curve(..) => unreachable!("curves stand still"),
        }
    }
}

/// The corners of a triangle at a time.
pub(super) fn corners_at(shapes: &accel::Geometry, t: [u32; 3], time: f32) -> [[f32; 3]; 3] {
    match shapes.keys.is_empty() {
        true => vertices(&shapes.positions, t),
        false => between(&shapes.keys, t, time),
    }
}

impl Attributes {
    /// The normals at a triangle's corners at a time.
    fn normals_at(&self, t: [u32; 3], time: f32) -> [[f32; 3]; 3] {
        match self.normal_keys.is_empty() {
            true => vertices(&self.normals, t),
            false => between(&self.normal_keys, t, time)
                .map(|n| Vec3::from_array(n).normalize_or_zero().to_array()),
        }
    }
}

/// What lists say of a triangle's corners, between two keys. The arithmetic is that of the accelerator.
fn between(keys: &[Vec<[f32; 3]>], t: [u32; 3], time: f32) -> [[f32; 3]; 3] {
    let (key, share) = segment(keys.len(), time);
    let (from, to) = (vertices(&keys[key], t), vertices(&keys[(key + 1).min(keys.len() - 1)], t));
    std::array::from_fn(|i| std::array::from_fn(|axis| from[i][axis] + (to[i][axis] - from[i][axis]) * share))
}

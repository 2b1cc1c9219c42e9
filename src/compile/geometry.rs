//! Surfaces at hits: position with error bound, normals, texture coordinates, vertex colours and tangents.

use super::objects::{ObjectId, Owners};
use crate::accel;
use crate::math::{
    Bounds3, DAffine3, Hit, Mat3, OriginPrimitive, Ray, TransformKeys, Vec2, Vec3, frame_from_tangent, gamma,
    normal_matrix, segment, transform_at, uv_frame,
};
use crate::shape::triangle::interpolate;
use crate::shape::{
    Analytic, CurveSegment, Quad, Shape, Surface, from_octahedral, shading_normal, triangle_surface,
};
use crate::simd::map_each;
use crate::texture::{AttributeList, HitAttributes, StrandData};
use std::sync::Arc;

/// Shading attributes of the primitives of a space. Lists that no material uses are empty.
#[derive(Clone, Debug, Default)]
pub struct Attributes {
    /// Unit normals by vertex; zero for flat shading.
    pub normals: Vec<[f32; 3]>,
    /// Unit normals at each key of a deforming mesh.
    pub normal_keys: Vec<Vec<[f32; 3]>>,
    /// Two UV sets by vertex.
    pub uv: [Vec<[f32; 2]>; 2],
    /// Unit tangents with handedness by vertex; zero if absent.
    pub tangents: Vec<[f32; 4]>,
    /// Linear RGBA by vertex.
    pub colors: Vec<[f32; 4]>,
    /// Named attributes by vertex, indexed as in the textures; empty if no node graph reads any.
    pub named: Vec<AttributeList>,
    /// Material of each primitive, in the order of primitive ids.
    pub materials: Vec<u32>,
    /// Rotations from world to texture space by analytic shape; empty if none is needed.
    pub object_from_world: Vec<Mat3>,
    /// Attributes of the points of curves.
    pub curves: CurveAttributes,
}

/// Shading attributes of curve points.
#[derive(Clone, Debug, Default)]
pub struct CurveAttributes {
    /// Position along the strand: 0 at the root, 1 at the tip.
    pub along: Vec<f32>,
    /// Linear colours; empty if no curve has any.
    pub colors: Vec<[f32; 3]>,
}

/// An instance of a shared geometry.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Index into [`Geometries::shared`].
    pub geometry: u32,
    /// Transform; at the time of the frame if it moves.
    pub world_from_object: Transform,
    /// Overrides the materials of its primitives.
    pub material: Option<u32>,
    /// The scene's object.
    pub object: ObjectId,
    /// Does it move or deform while the shutter is open?
    pub moves: bool,
    /// Index into [`Geometries::motions`]; `None` if only its mesh deforms.
    pub motion: Option<u32>,
    /// Its emission is not light-sampled: its mesh has too many instances.
    pub is_unsampled: bool,
}

/// Object-to-world transform.
#[derive(Clone, Copy, Debug)]
pub struct Transform {
    /// Linear part.
    pub linear: Mat3,
    pub translation: Vec3,
    /// Inverse transpose of the linear part, for normals.
    pub normal_from_object: Mat3,
}

/// The geometry of one space: the world, or the object space of an instanced mesh.
#[derive(Clone, Debug)]
pub struct Space {
    /// The input of the acceleration structure.
    pub shapes: accel::Geometry,
    /// Shading attributes.
    pub attributes: Attributes,
    /// Bounding box.
    pub bounds: Bounds3,
    /// Vertex positions a frame before and a frame after, for motion vectors of deforming meshes.
    pub neighbours: Option<[Vec<[f32; 3]>; 2]>,
    /// The scene object of each primitive; only for the world space.
    pub owners: Owners,
}

/// Inputs of textures and normal maps at a hit.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceCoordinates {
    /// Two UV sets.
    pub uv: [Vec2; 2],
    /// Linear RGBA vertex colour; white without one.
    pub color: [f32; 4],
    /// Tangent, bitangent and shading normal as columns, for normal maps; `None` without texture coordinates.
    pub tangent_frame: Option<Mat3>,
    /// Rate of change of each UV set, per metre.
    pub uv_per_metre: [f32; 2],
}

/// All geometry.
#[derive(Clone, Debug)]
pub struct Geometries {
    /// Geometry in world space.
    pub world: Arc<Space>,
    /// Geometries of instances, in object space.
    pub shared: Vec<Arc<Space>>,
    /// Indexed by the instance of a hit minus 1.
    pub placements: Vec<Placement>,
    /// Transform keys of moving placements.
    pub motions: Vec<TransformKeys>,
    /// Does any placement move or deform while the shutter is open?
    pub moves: bool,
}

/// The corners of a flat primitive with their normals.
#[derive(Clone, Copy, Debug)]
pub struct Corners {
    /// Positions: of a triangle's vertices, or of a quad's corner and the ends of its edges.
    pub positions: [[f32; 3]; 3],
    /// Shading normals; zero for flat shading.
    pub normals: [[f32; 3]; 3],
}

/// Texture coordinates and tangents at the corners of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct TextureCorners {
    /// Texture coordinates.
    pub uv: [[f32; 2]; 3],
    /// Tangents; the fourth component is the sign of the bitangent, equal at all corners. Zero if absent.
    pub tangents: [[f32; 4]; 3],
}

/// A primitive by its id.
pub(super) enum Primitive<'a> {
    Triangle([u32; 3]),
    Quad(&'a Quad),
    Analytic(usize, &'a Analytic),
    Curve(usize, CurveSegment),
    Splat(usize),
}

pub(super) fn primitive(shapes: &accel::Geometry, prim: u32) -> Primitive<'_> {
    let prim = prim as usize;
    if let Some(&t) = shapes.triangles.get(prim) {
        return Primitive::Triangle(t);
    }
    let prim = prim - shapes.triangles.len();
    match shapes.quads.get(prim) {
        Some(quad) => Primitive::Quad(quad),
        None => {
            let index = prim - shapes.quads.len();
            match shapes.analytic.get(index) {
                Some(shape) => Primitive::Analytic(index, shape),
                None => {
                    let index = index - shapes.analytic.len();
                    match index.checked_sub(shapes.curves.len()) {
                        None => Primitive::Curve(index, shapes.curves.get(index)),
                        Some(index) => Primitive::Splat(index),
                    }
                }
            }
        }
    }
}

#[inline(always)]
pub(super) fn vertices<T: Copy>(list: &[T], t: [u32; 3]) -> [T; 3] {
    [list[t[0] as usize], list[t[1] as usize], list[t[2] as usize]]
}

impl Geometries {
    #[inline(always)]
    fn space(&self, hit: &Hit) -> &Space {
        match hit.instance {
            0 => &self.world,
            i => &self.shared[self.placements[i as usize - 1].geometry as usize],
        }
    }

    /// The object of the scene at a hit, by a binary search: too slow for every hit.
    pub fn object(&self, hit: &Hit) -> ObjectId {
        match hit.instance {
            0 => self.world.owners.of(hit.prim),
            i => self.placements[i as usize - 1].object,
        }
    }

    /// The object of a mesh at a hit; `None` for other primitives.
    pub fn placed_mesh(&self, hit: &Hit) -> Option<ObjectId> {
        let is_triangle = (hit.prim as usize) < self.space(hit).shapes.triangles.len();
        is_triangle.then(|| self.object(hit))
    }

    #[inline(always)]
    pub fn material(&self, hit: &Hit) -> u32 {
        self.material_of(hit.into())
    }

    #[inline(always)]
    pub fn material_of(&self, OriginPrimitive { prim, instance }: OriginPrimitive) -> u32 {
        match instance.checked_sub(1) {
            None => self.world.attributes.materials[prim as usize],
            Some(i) => {
                let placement = &self.placements[i as usize];
                let of_primitive =
                    self.shared[placement.geometry as usize].attributes.materials[prim as usize];
                placement.material.unwrap_or(of_primitive)
            }
        }
    }

    /// Does any vertex have a shading normal?
    pub fn has_normals(&self) -> bool {
        self.shared.iter().chain([&self.world]).any(|space| !space.attributes.normals.is_empty())
    }

    /// Is the hit on a triangle or quad of the world?
    #[inline(always)]
    pub fn is_flat(&self, hit: &Hit) -> bool {
        hit.instance == 0
            && (hit.prim as usize) < self.world.shapes.triangles.len() + self.world.shapes.quads.len()
    }

    /// The corners of a triangle or quad of the world; `None` for other primitives.
    #[inline(always)]
    pub fn corners(&self, hit: &Hit) -> Option<Corners> {
        if hit.instance != 0 {
            return None;
        }
        let (shapes, attributes) = (&self.world.shapes, &self.world.attributes);
        let prim = hit.prim as usize;
        if let Some(&t) = shapes.triangles.get(prim) {
            let is_flat = attributes.normals.is_empty();
            let normals = if is_flat { [[0.0; 3]; 3] } else { vertices(&attributes.normals, t) };
            return Some(Corners { positions: vertices(&shapes.positions, t), normals });
        }
        let quad = shapes.quads.get(prim - shapes.triangles.len())?;
        let positions = [quad.corner, quad.corner + quad.edge_u, quad.corner + quad.edge_v];
        Some(Corners { positions: map_each(positions, |p| p.to_array()), normals: [[0.0; 3]; 3] })
    }

    /// Is the hit on a triangle of the world, without a second UV set?
    #[inline(always)]
    pub fn is_single_uv_triangle(&self, hit: &Hit) -> bool {
        hit.instance == 0
            && (hit.prim as usize) < self.world.shapes.triangles.len()
            && self.world.attributes.uv[1].is_empty()
    }

    /// Texture coordinates and tangents of a triangle of the world; see [`Geometries::is_single_uv_triangle`].
    #[inline(always)]
    pub fn texture_corners(&self, hit: &Hit) -> Option<TextureCorners> {
        let (shapes, attributes) = (&self.world.shapes, &self.world.attributes);
        let &t = shapes.triangles.get(hit.prim as usize)?;
        let uv = &attributes.uv[0];
        let uv = if uv.is_empty() { [[0.0; 2]; 3] } else { vertices(uv, t) };
        let tangents = &attributes.tangents;
        let tangents = if tangents.is_empty() { [[0.0; 4]; 3] } else { vertices(tangents, t) };
        Some(TextureCorners { uv, tangents })
    }

    /// The named attributes at a hit.
    pub fn attributes(&self, hit: &Hit) -> HitAttributes<'_> {
        let Space { shapes, attributes, .. } = self.space(hit);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let triangle = shapes.triangles.get(hit.prim as usize).map(|&t| (t, weights));
        HitAttributes { lists: &attributes.named, triangle }
    }

    /// The transform from world to object space at a path's time (0..1); `None` for static objects.
    pub fn object_from_world(&self, hit: &Hit, time: f32) -> Option<DAffine3> {
        self.at_time(hit, time).map(|at_time| at_time.world_from_object.inverse())
    }

    /// The strand of a curve at a hit.
    pub fn strand(&self, hit: &Hit) -> Option<StrandData> {
        let Space { shapes, attributes, .. } = self.space(hit);
        match primitive(shapes, hit.prim) {
            Primitive::Curve(index, segment) => {
                Some(attributes.curves.strand(&shapes.curves, shapes.curves.segments[index], &segment, hit.u))
            }
            _ => None,
        }
    }

    /// The first UV set at the corners of a triangle or quad.
    pub fn corner_uv(&self, hit: &Hit) -> Option<[Vec2; 3]> {
        let Space { shapes, attributes, .. } = self.space(hit);
        match primitive(shapes, hit.prim) {
            Primitive::Triangle(_) if attributes.uv[0].is_empty() => None,
            Primitive::Triangle(t) => Some(map_each(vertices(&attributes.uv[0], t), Vec2::from_array)),
            Primitive::Quad(_) => Some([Vec2::ZERO, Vec2::X, Vec2::Y]),
            _ => None,
        }
    }

    /// The corners of a triangle in world space at a path's time (0..1), or the corner of a quad and the ends of its edges;
    /// `None` for other primitives.
    pub fn world_corners(&self, hit: &Hit, time: f32) -> Option<[Vec3; 3]> {
        let shapes = &self.space(hit).shapes;
        let corners = match primitive(shapes, hit.prim) {
            Primitive::Triangle(t) => map_each(corners_at(shapes, t, time), Vec3::from_array),
            Primitive::Quad(q) => [q.corner, q.corner + q.edge_u, q.corner + q.edge_v],
            _ => return None,
        };
        let Some(i) = hit.instance.checked_sub(1) else { return Some(corners) };
        let world_from_object = self.world_from_object(&self.placements[i as usize], time);
        Some(map_each(corners, |c| world_from_object.transform_point3(c.as_dvec3()).as_vec3()))
    }

    /// Positions and unit shading normals at the corners of a triangle in world space at a path's time (0..1); `None` for flat
    /// shading and other primitives.
    pub fn smooth_corners(&self, hit: &Hit, time: f32) -> Option<[[Vec3; 3]; 2]> {
        let Space { shapes, attributes, .. } = self.space(hit);
        let Primitive::Triangle(t) = primitive(shapes, hit.prim) else { return None };
        if attributes.normals.is_empty() {
            return None;
        }
        let positions = self.world_corners(hit, time)?;
        let normals = map_each(attributes.normals_at(t, time), Vec3::from_array);
        let Some(i) = hit.instance.checked_sub(1) else { return Some([positions, normals]) };
        let placement = &self.placements[i as usize];
        let normal_from_object = match placement.moves {
            true => Transform::of(&self.world_from_object(placement, time)).normal_from_object,
            false => placement.world_from_object.normal_from_object,
        };
        Some([positions, map_each(normals, |n| (normal_from_object * n).normalize_or_zero())])
    }

    /// The surface at a hit of `ray`; `time` in 0..1 applies to moving objects.
    #[inline]
    pub fn surface(&self, ray: &Ray, hit: &Hit, time: f32) -> Surface {
        if let Some(at_time) = self.at_time(hit, time) {
            return at_time.surface(ray, hit);
        }
        let Space { shapes, attributes, .. } = self.space(hit);
        let material = attributes.materials[hit.prim as usize];
        let mut surface = match primitive(shapes, hit.prim) {
            Primitive::Triangle(t) => {
                let mut s = triangle_surface(vertices(&shapes.positions, t), hit.u, hit.v);
                if !attributes.normals.is_empty() {
                    s.ns = shading_normal(vertices(&attributes.normals, t), hit.u, hit.v, s.ng);
                }
                s
            }
            Primitive::Quad(q) => {
                let corners = [q.corner, q.corner + q.edge_u, q.corner + q.edge_v];
                triangle_surface(map_each(corners, |c| c.to_array()), hit.u, hit.v)
            }
            Primitive::Analytic(_, shape) => shape.surface(ray.at(hit.t), ray.origin),
            Primitive::Curve(_, segment) => segment.surface(ray.origin, ray.direction),
            Primitive::Splat(index) => {
                shapes.splats.surface(index, self.object_point(ray, hit), splat_direction(hit))
            }
        };
        surface.material = material;
        if hit.instance != 0 {
            surface = self.placements[hit.instance as usize - 1].surface_to_world(&surface);
        }
        surface
    }

    /// Does a ray hit the back of a flat primitive? `None` for curved ones, where it depends on the position.
    #[inline]
    pub fn is_back_of_flat(&self, ray: &Ray, hit: &Hit, time: f32) -> Option<bool> {
        if let Some(at_time) = self.at_time(hit, time) {
            return at_time.is_back_of_flat(ray, hit);
        }
        let shapes = &self.space(hit).shapes;
        let corners = match primitive(shapes, hit.prim) {
            Primitive::Triangle(t) => vertices(&shapes.positions, t),
            Primitive::Quad(q) => [q.corner, q.corner + q.edge_u, q.corner + q.edge_v].map(|c| c.to_array()),
            Primitive::Analytic(..) => return None,
            // Rays hit curves from outside.
            Primitive::Curve(..) => return Some(false),
            Primitive::Splat(..) => return None,
        };
        let mut ng = triangle_surface(corners, 0.0, 0.0).ng;
        if hit.instance != 0 {
            let placement = &self.placements[hit.instance as usize - 1];
            ng = (placement.world_from_object.normal_from_object * ng).normalize();
        }
        Some(ng.dot(ray.direction) > 0.0)
    }

    /// Does a ray hit the back of a surface?
    pub fn is_back(&self, ray: &Ray, hit: &Hit, time: f32) -> bool {
        let of_flat = self.is_back_of_flat(ray, hit, time);
        of_flat.unwrap_or_else(|| self.surface(ray, hit, time).ng.dot(ray.direction) > 0.0)
    }

    /// Texture coordinates, colour and tangents at a hit; `uv_per_metre` of triangles only if `footprints` is set.
    pub fn coordinates(
        &self,
        surface: &Surface,
        hit: &Hit,
        footprints: bool,
        time: f32,
    ) -> SurfaceCoordinates {
        if let Some(at_time) = self.at_time(hit, time) {
            return at_time.coordinates(surface, hit, footprints);
        }
        let placement = hit.instance.checked_sub(1).map(|i| &self.placements[i as usize]);
        let Space { shapes, attributes, .. } = self.space(hit);
        match primitive(shapes, hit.prim) {
            Primitive::Triangle(t) => {
                let linear = placement.map_or(Mat3::IDENTITY, |p| p.world_from_object.linear);
                let corners = vertices(&shapes.positions, t);
                let corners = map_each(corners, |c| linear * Vec3::from_array(c));
                attributes.of_triangle(t, corners, hit, surface, &linear, footprints)
            }
            Primitive::Quad(q) => {
                let uv = Vec2::new(hit.u, hit.v);
                // v points down in the image.
                let tangent_frame = frame_from_tangent(q.edge_u, surface.ns, -1.0);
                let uv_per_metre = [q.edge_u.cross(q.edge_v).length().sqrt().recip(); 2];
                SurfaceCoordinates { uv: [uv, uv], color: [1.0; 4], tangent_frame, uv_per_metre }
            }
            Primitive::Analytic(index, shape) => {
                let object_from_world = attributes.object_from_world(index);
                let uv = shape.texture_coordinates(surface.p, surface.ng, &object_from_world);
                let parametrization = shape.parametrize(surface.ng, &object_from_world);
                let tangent_frame =
                    frame_from_tangent(parametrization.tangent, surface.ns, parametrization.handedness);
                SurfaceCoordinates {
                    uv: [uv, uv],
                    color: [1.0; 4],
                    tangent_frame,
                    uv_per_metre: [parametrization.uv_per_metre; 2],
                }
            }
            Primitive::Curve(index, segment) => {
                attributes.curves.coordinates(shapes.curves.segments[index], &segment, surface, hit.u)
            }
            Primitive::Splat(index) => SurfaceCoordinates::of_splat(shapes, index, hit),
        }
    }
}

/// The object-space direction of the ray that hit a splat.
fn splat_direction(hit: &Hit) -> Vec3 {
    from_octahedral([hit.u, hit.v])
}

impl SurfaceCoordinates {
    /// The view-dependent colour of a splat, without texture coordinates.
    fn of_splat(shapes: &accel::Geometry, index: usize, hit: &Hit) -> SurfaceCoordinates {
        let [r, g, b] = shapes.splats.color(index, splat_direction(hit));
        SurfaceCoordinates {
            uv: [Vec2::ZERO; 2],
            color: [r, g, b, 1.0],
            tangent_frame: None,
            uv_per_metre: [0.0; 2],
        }
    }
}

impl Geometries {
    /// The hit point in the object space of a static placement.
    fn object_point(&self, ray: &Ray, hit: &Hit) -> Vec3 {
        let p = ray.at(hit.t);
        let Some(i) = hit.instance.checked_sub(1) else { return p };
        let Transform { linear, translation, .. } = self.placements[i as usize].world_from_object;
        linear.inverse() * (p - translation)
    }
}

impl Attributes {
    pub(super) const EMPTY: Attributes = Attributes {
        normals: Vec::new(),
        normal_keys: Vec::new(),
        uv: [const { Vec::new() }; 2],
        tangents: Vec::new(),
        colors: Vec::new(),
        named: Vec::new(),
        materials: Vec::new(),
        object_from_world: Vec::new(),
        curves: CurveAttributes { along: Vec::new(), colors: Vec::new() },
    };

    /// The rotation from world space to the texture space of an analytic shape.
    pub(super) fn object_from_world(&self, index: usize) -> Mat3 {
        self.object_from_world.get(index).copied().unwrap_or(Mat3::IDENTITY)
    }

    pub(super) fn of_triangle(
        &self,
        t: [u32; 3],
        corners: [Vec3; 3],
        hit: &Hit,
        surface: &Surface,
        linear: &Mat3,
        footprints: bool,
    ) -> SurfaceCoordinates {
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let corner_uv = |set: usize| {
            (!self.uv[set].is_empty()).then(|| map_each(vertices(&self.uv[set], t), Vec2::from_array))
        };
        let mix = |uv: Option<[Vec2; 3]>| {
            uv.map_or(Vec2::ZERO, |c| c[0] * weights[0] + c[1] * weights[1] + c[2] * weights[2])
        };
        let color = match self.colors.is_empty() {
            true => [1.0; 4],
            false => {
                let c = vertices(&self.colors, t);
                std::array::from_fn(|i| (0..3).map(|k| c[k][i] * weights[k]).sum())
            }
        };
        let (first, second) = (corner_uv(0), corner_uv(1));
        let mut uv_per_metre = [0.0; 2];
        if footprints {
            let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            let density = |uv: Option<[Vec2; 3]>| {
                uv.map_or(0.0, |c| ((c[1] - c[0]).perp_dot(c[2] - c[0]).abs() / area).sqrt())
            };
            uv_per_metre = [density(first), density(second)];
        }
        let from_vertices = (!self.tangents.is_empty())
            .then(|| vertices(&self.tangents, t))
            .filter(|c| c[0] != [0.0; 4])
            .and_then(|c| {
                let tangent = interpolate(map_each(c, |[x, y, z, _]| [x, y, z]), hit.u, hit.v);
                // v points down: glTF's bitangent is w (n x t).
                frame_from_tangent(
                    *linear * tangent,
                    surface.ns,
                    1.0f32.copysign(c[0][3]) * linear.determinant().signum(),
                )
            });
        let tangent_frame = from_vertices.or_else(|| first.and_then(|uv| uv_frame(corners, uv, surface.ns)));
        SurfaceCoordinates { uv: [mix(first), mix(second)], color, tangent_frame, uv_per_metre }
    }
}

// Transforms from object to world space.

impl Transform {
    /// The transform of a matrix.
    pub(super) fn of(world_from_object: &DAffine3) -> Transform {
        let DAffine3 { matrix3, translation } = world_from_object;
        Transform {
            linear: matrix3.as_mat3(),
            translation: translation.as_vec3(),
            normal_from_object: normal_matrix(matrix3).as_mat3(),
        }
    }

    /// The transform in f64, with the precision of f32.
    pub(super) fn to_double(self) -> DAffine3 {
        DAffine3 { matrix3: self.linear.as_dmat3(), translation: self.translation.as_dvec3() }
    }
}

impl Placement {
    #[inline]
    pub(super) fn surface_to_world(&self, s: &Surface) -> Surface {
        let Transform { linear: m, translation, normal_from_object } = self.world_from_object;
        let p = m * s.p + translation;
        let magnitude = Mat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        let p_error = magnitude * (s.p_error + s.p.abs() * gamma(4)) + translation.abs() * gamma(4);
        // The inverse transpose keeps the front side under mirroring transforms.
        let ng = (normal_from_object * s.ng).normalize();
        let ns = (normal_from_object * s.ns).normalize();
        Surface { p, p_error, ng, ns, material: self.material.unwrap_or(s.material) }
    }
}

// Motion blur: surfaces of moving and deforming placements at the time of a path.

/// A moving placement at the time of a path.
pub(super) struct PlacementAtTime<'a> {
    space: &'a Space,
    placement: Placement,
    world_from_object: DAffine3,
    time: f32,
}

impl Geometries {
    /// The placement of a hit at a path's time, if it moves or deforms.
    #[inline(always)]
    pub(super) fn at_time(&self, hit: &Hit, time: f32) -> Option<PlacementAtTime<'_>> {
        if self.moves { self.find_at_time(hit, time) } else { None }
    }

    #[cold]
    #[inline(never)]
    fn find_at_time(&self, hit: &Hit, time: f32) -> Option<PlacementAtTime<'_>> {
        let placement = self.placements.get((hit.instance as usize).wrapping_sub(1)).filter(|p| p.moves)?;
        let space = &*self.shared[placement.geometry as usize];
        let world_from_object = self.world_from_object(placement, time);
        let placement = Placement { world_from_object: Transform::of(&world_from_object), ..*placement };
        Some(PlacementAtTime { space, placement, world_from_object, time })
    }

    /// The transform of a placement at a time in 0..1 of the shutter interval.
    pub(super) fn world_from_object(&self, placement: &Placement, time: f32) -> DAffine3 {
        match placement.motion.and_then(|motion| self.motions.get(motion as usize)) {
            Some(keys) => transform_at(keys, time),
            None => placement.world_from_object.to_double(),
        }
    }
}

impl PlacementAtTime<'_> {
    /// The corners of a triangle.
    fn corners(&self, t: [u32; 3]) -> [[f32; 3]; 3] {
        corners_at(&self.space.shapes, t, self.time)
    }

    /// A point from world to object space.
    fn to_object(&self, p: Vec3) -> Vec3 {
        self.world_from_object.inverse().transform_point3(p.as_dvec3()).as_vec3()
    }

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
            Primitive::Curve(..) => unreachable!("curves are static"),
            Primitive::Splat(index) => {
                shapes.splats.surface(index, self.to_object(ray.at(hit.t)), splat_direction(hit))
            }
        };
        surface.material = attributes.materials[hit.prim as usize];
        let surface = self.placement.surface_to_world(&surface);
        // Secondary rays are transformed to object space in single precision.
        let back = surface.p.abs() + self.placement.world_from_object.translation.abs();
        Surface { p_error: surface.p_error + back * gamma(4), ..surface }
    }

    /// Does a ray hit the back of a flat primitive? `None` for others.
    pub fn is_back_of_flat(&self, ray: &Ray, hit: &Hit) -> Option<bool> {
        let corners = match primitive(&self.space.shapes, hit.prim) {
            Primitive::Triangle(t) => self.corners(t),
            Primitive::Quad(q) => [q.corner, q.corner + q.edge_u, q.corner + q.edge_v].map(|c| c.to_array()),
            Primitive::Analytic(..) | Primitive::Curve(..) | Primitive::Splat(..) => return None,
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
                let tangent_frame = frame_from_tangent(u, surface.ns, -1.0);
                SurfaceCoordinates { uv: [uv, uv], color: [1.0; 4], tangent_frame, uv_per_metre }
            }
            Primitive::Analytic(index, shape) => {
                let object_from_world = attributes.object_from_world(index);
                let (p, normal) = (self.to_object(surface.p), (linear.transpose() * surface.ng).normalize());
                let uv = shape.texture_coordinates(p, normal, &object_from_world);
                let parametrization = shape.parametrize(normal, &object_from_world);
                let tangent_frame = frame_from_tangent(
                    linear * parametrization.tangent,
                    surface.ns,
                    parametrization.handedness,
                );
                let scale = linear.determinant().abs().cbrt();
                let uv_per_metre = [parametrization.uv_per_metre / scale; 2];
                SurfaceCoordinates { uv: [uv, uv], color: [1.0; 4], tangent_frame, uv_per_metre }
            }
            Primitive::Curve(..) => unreachable!("curves are static"),
            Primitive::Splat(index) => SurfaceCoordinates::of_splat(shapes, index, hit),
        }
    }
}

/// The corners of a triangle at a time.
pub(super) fn corners_at(shapes: &accel::Geometry, t: [u32; 3], time: f32) -> [[f32; 3]; 3] {
    match shapes.keys.is_empty() {
        true => vertices(&shapes.positions, t),
        false => interpolated(&shapes.keys, t, time),
    }
}

impl Attributes {
    /// The normals at a triangle's corners at a time.
    fn normals_at(&self, t: [u32; 3], time: f32) -> [[f32; 3]; 3] {
        match self.normal_keys.is_empty() {
            true => vertices(&self.normals, t),
            false => interpolated(&self.normal_keys, t, time)
                .map(|n| Vec3::from_array(n).normalize_or_zero().to_array()),
        }
    }
}

/// Values at a triangle's corners, interpolated between two keys. The arithmetic must equal that of the BVH.
fn interpolated(keys: &[Vec<[f32; 3]>], t: [u32; 3], time: f32) -> [[f32; 3]; 3] {
    let (key, fraction) = segment(keys.len(), time);
    let (from, to) = (vertices(&keys[key], t), vertices(&keys[(key + 1).min(keys.len() - 1)], t));
    std::array::from_fn(|i| {
        std::array::from_fn(|axis| from[i][axis] + (to[i][axis] - from[i][axis]) * fraction)
    })
}

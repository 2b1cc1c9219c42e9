//! Inputs of node graphs at a hit.

use super::geometry::{Geometries, SurfaceCoordinates};
use super::material::CompiledMaterial;
use crate::math::{Hit, Vec3};
use crate::shape::Surface;
use crate::texture::{
    CameraData, CompiledTextures, HitData, ObjectData, PathData, PointReader, TexturePoint,
};

/// Reads hits for graphs of nodes.
pub struct HitReader<'a> {
    /// The scene's surfaces.
    pub geometries: &'a Geometries,
    /// The objects by number.
    pub objects: &'a [ObjectData],
    /// The camera.
    pub camera: CameraData<'a>,
}

/// A hit on a surface.
#[derive(Clone, Copy)]
pub struct SurfaceHit<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// The hit.
    pub hit: &'a Hit,
    /// Its material.
    pub material: &'a CompiledMaterial,
    /// The ray came from behind.
    pub is_back: bool,
    /// When, where something moves.
    pub time: f32,
}

impl<'a> HitReader<'a> {
    /// Inputs of node graphs at a hit seen from `wo` by a path of these properties. `None` where the scene has no objects for
    /// graphs.
    pub fn read(
        &self,
        at: SurfaceHit<'_>,
        coordinates: &SurfaceCoordinates,
        wo: Vec3,
        path: PathData,
    ) -> Option<HitData<'a>> {
        let SurfaceHit { surface, hit, material, is_back, time } = at;
        let geometries = self.geometries;
        let object = self.objects.get(geometries.object(hit).0 as usize)?;
        let side = if is_back { -1.0 } else { 1.0 };
        let object_from_world = geometries.object_from_world(hit, time).unwrap_or(object.object_from_world);
        Some(HitData {
            attributes: geometries.attributes(hit),
            object,
            camera: self.camera,
            object_point: object_from_world.transform_point3(surface.p.as_dvec3()).as_vec3(),
            shading_normal: surface.ns * side,
            true_normal: surface.ng * side,
            incoming: wo,
            is_back,
            parametric: [1.0 - hit.u - hit.v, hit.u],
            corners: geometries.world_corners(hit, time),
            corner_uv: geometries.corner_uv(hit),
            point: surface.p,
            tangent_frame: coordinates.tangent_frame,
            material_index: material.index,
            path,
            strand: geometries.strand(hit),
        })
    }
}

/// Texture lookups at a point with the filter width of a path that sees it from `wo`; graphs read `hit`.
#[inline(always)]
pub fn point_reader<'h>(
    textures: &'h CompiledTextures,
    at: &SurfaceCoordinates,
    surface: &Surface,
    wo: Vec3,
    width: f32,
    hit: Option<&'h HitData<'h>>,
) -> PointReader<'h> {
    let (world, normal) = (surface.p, surface.ng);
    let cosine = surface.ns.dot(wo).abs();
    let point = TexturePoint { uv: at.uv, world, normal, cosine, width, uv_per_metre: at.uv_per_metre };
    PointReader::new(textures, point).with_hit(hit)
}

//! Inputs of node graphs at a hit.

use super::geometry::{Geometries, SurfaceCoordinates};
use super::material::CompiledMaterial;
use crate::math::{Hit, Vec3};
use crate::shape::Surface;
use crate::texture::{
    CameraData, CompiledTextures, HitData, ObjectData, PathData, PointReader, TexturePoint,
};

/// Provides the inputs of node graphs at hits.
pub struct HitReader<'a> {
    /// Geometries of the scene.
    pub geometries: &'a Geometries,
    /// Indexed by [`ObjectId`](super::objects::ObjectId).
    pub objects: &'a [ObjectData],
    /// Camera, for node graphs.
    pub camera: CameraData<'a>,
}

#[derive(Clone, Copy)]
pub struct SurfaceHit<'a> {
    /// Surface of the hit.
    pub surface: &'a Surface,
    pub hit: &'a Hit,
    /// Material of the hit.
    pub material: &'a CompiledMaterial,
    /// The ray hit the back.
    pub is_back: bool,
    /// Time of the path in the shutter interval, 0..1.
    pub time: f32,
}

impl<'a> HitReader<'a> {
    /// Inputs of node graphs at a hit, for the view direction `wo` and the data of the path. `None` if no graph of the scene
    /// needs objects.
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
            rays: None,
        })
    }
}

/// Texture lookups at a surface point, for the view direction `wo` and the filter width of the path; `hit` is for node graphs.
#[inline(always)]
pub fn point_reader<'h>(
    textures: &'h CompiledTextures,
    at: &SurfaceCoordinates,
    surface: &Surface,
    wo: Vec3,
    width: f32,
    hit: Option<&'h HitData<'h>>,
) -> PointReader<'h> {
    PointReader::new(textures, texture_point(at, surface, wo, width)).with_hit(hit)
}

/// The point of texture lookups at a surface point, for the view direction `wo` and the filter width of the path.
#[inline(always)]
pub fn texture_point(at: &SurfaceCoordinates, surface: &Surface, wo: Vec3, width: f32) -> TexturePoint {
    let (world, normal) = (surface.p, surface.ng);
    let cosine = surface.ns.dot(wo).abs();
    TexturePoint { uv: at.uv, world, normal, cosine, width, uv_per_metre: at.uv_per_metre }
}

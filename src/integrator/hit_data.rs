//! What graphs of nodes read of a hit.

use super::Integrator;
use super::shading_geometry::HitPoint;
use crate::compile::SurfaceCoordinates;
use crate::math::{Hit, Vec3};
use crate::shape::Surface;
use crate::texture::{CameraData, HitData, PathData};

impl Integrator<'_> {
    /// What the graphs of a material read of a hit that is seen from `wo`; `None` where they read nothing.
    #[inline(always)]
    pub(super) fn hit_data(
        &self,
        at: &HitPoint<'_>,
        coordinates: &SurfaceCoordinates,
        wo: Vec3,
        path: PathData,
    ) -> Option<HitData<'_>> {
        let HitPoint { surface, hit, material, is_back, time } = at;
        if !material.reads_hit {
            return None;
        }
        self.read_hit((surface, hit, *time), *is_back, coordinates, wo, path)
    }

    #[inline(never)]
    fn read_hit(
        &self,
        (surface, hit, time): (&Surface, &Hit, f32),
        is_back: bool,
        coordinates: &SurfaceCoordinates,
        wo: Vec3,
        path: PathData,
    ) -> Option<HitData<'_>> {
        let geometries = &self.scene.geometries;
        let object = self.scene.objects.get(geometries.object(hit).0 as usize)?;
        let side = if is_back { -1.0 } else { 1.0 };
        let object_point = object.object_from_world.transform_point3(surface.p.as_dvec3()).as_vec3();
        Some(HitData {
            attributes: geometries.attributes(hit),
            object,
            camera: CameraData {
                camera_from_world: &self.view.camera_from_world,
                ndc_from_world: self.view.ndc_from_world.as_ref(),
            },
            object_point,
            shading_normal: surface.ns * side,
            true_normal: surface.ng * side,
            incoming: wo,
            is_back,
            parametric: [1.0 - hit.u - hit.v, hit.u],
            corners: geometries.world_corners(hit, time),
            point: surface.p,
            tangent_frame: coordinates.tangent_frame,
            material_index: 0.0,
            path,
            strand: None,
        })
    }
}

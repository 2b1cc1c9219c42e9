//! What graphs of nodes read of a hit.

use super::Integrator;
use super::shading_geometry::{HitPoint, PathOrigin};
use crate::compile::SurfaceCoordinates;
use crate::math::Vec3;
use crate::scene::RayKinds;
use crate::texture::{CameraData, HitData, PathData};

impl Integrator<'_> {
    /// What the graphs of a material read of a hit that is seen from `wo`; `None` where they read nothing.
    #[inline(always)]
    pub(super) fn hit_data(
        &self,
        at: &HitPoint<'_>,
        coordinates: &SurfaceCoordinates,
        wo: Vec3,
    ) -> Option<HitData<'_>> {
        if at.material.reads_hit { self.read_hit(at, coordinates, wo) } else { None }
    }

    #[inline(never)]
    fn read_hit(&self, at: &HitPoint<'_>, coordinates: &SurfaceCoordinates, wo: Vec3) -> Option<HitData<'_>> {
        let HitPoint { surface, hit, is_back, time, path, .. } = at;
        let geometries = &self.scene.geometries;
        let object = self.scene.objects.get(geometries.object(hit).0 as usize)?;
        let side = if *is_back { -1.0 } else { 1.0 };
        let object_from_world = geometries.object_from_world(hit, *time).unwrap_or(object.object_from_world);
        Some(HitData {
            attributes: geometries.attributes(hit),
            object,
            camera: CameraData {
                camera_from_world: &self.view.camera_from_world,
                ndc_from_world: self.view.ndc_from_world.as_ref(),
            },
            object_point: object_from_world.transform_point3(surface.p.as_dvec3()).as_vec3(),
            shading_normal: surface.ns * side,
            true_normal: surface.ng * side,
            incoming: wo,
            is_back: *is_back,
            parametric: [1.0 - hit.u - hit.v, hit.u],
            corners: geometries.world_corners(hit, *time),
            corner_uv: geometries.corner_uv(hit),
            point: surface.p,
            tangent_frame: coordinates.tangent_frame,
            material_index: at.material.index,
            path: path_data(path, hit.t),
            strand: geometries.strand(hit),
        })
    }
}

/// The flags of a path in the words of Cycles, which counts refraction and mirrors among what is glossy.
fn path_data(path: &PathOrigin, length: f32) -> PathData {
    let is = |kind: RayKinds| path.kinds.contains(kind) && path.kinds != RayKinds::NONE;
    let (diffuse, glossy, transmission) =
        (is(RayKinds::DIFFUSE), is(RayKinds::GLOSSY), is(RayKinds::TRANSMISSION));
    let shadow = is(RayKinds::SHADOW);
    let kinds = [
        is(RayKinds::CAMERA) && !shadow,
        shadow,
        diffuse && !shadow,
        (glossy || transmission) && !shadow,
        path.is_singular,
        (diffuse || glossy) && !shadow,
        transmission && !shadow,
        is(RayKinds::VOLUME) && !shadow,
    ];
    PathData { kinds: kinds.map(|is| f32::from(u8::from(is))), length, depth: f32::from(path.bounces) }
}

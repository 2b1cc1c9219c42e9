//! What graphs of nodes read of a hit.

use super::Integrator;
use super::shading_geometry::{HitPoint, PathOrigin};
use crate::compile::{HitReader, SurfaceCoordinates, SurfaceHit};
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
        let HitPoint { surface, hit, material, is_back, time, path } = at;
        let reader = HitReader {
            geometries: &self.scene.geometries,
            objects: &self.scene.objects,
            camera: CameraData {
                camera_from_world: &self.view.camera_from_world,
                ndc_from_world: self.view.ndc_from_world.as_ref(),
            },
        };
        let at = SurfaceHit { surface, hit, material, is_back: *is_back, time: *time };
        reader.read(at, coordinates, wo, path_data(path, hit.t))
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

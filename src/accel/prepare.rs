//! Rays in the space of an instance.

use super::layout::InstanceRecord;
use crate::math::{DAffine3, Ray, Vec3};
use crate::shape::PreparedRay;

impl InstanceRecord {
    /// The matrix of a record.
    pub fn rows(object_from_world: &DAffine3) -> [[f32; 4]; 3] {
        let m = object_from_world;
        let row = |k: usize| {
            [m.matrix3.x_axis[k], m.matrix3.y_axis[k], m.matrix3.z_axis[k], m.translation[k]]
                .map(|x| x as f32)
        };
        [row(0), row(1), row(2)]
    }

    /// A world ray in object space. The direction keeps its parametrisation.
    #[inline(always)]
    pub fn transform(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Ray {
        let [o, d] = [ray.origin, ray.direction];
        let row = |k: usize| {
            let m = &self.object_from_world[k];
            ((m[0] * o[0] + m[1] * o[1]) + (m[2] * o[2] + m[3]), m[0] * d[0] + m[1] * d[1] + m[2] * d[2])
        };
        let [x, y, z] = [row(0), row(1), row(2)];
        let (origin, direction) = (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1));
        Ray { t_min, t_max, ..Ray::new(origin, direction) }
    }
}

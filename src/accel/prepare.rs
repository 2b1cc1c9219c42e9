//! Rays in the space of an instance.

use super::layout::InstanceRecord;
use crate::math::{Ray, Vec3};
use crate::shape::PreparedRay;

impl InstanceRecord {
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

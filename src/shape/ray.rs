//! A ray in the form that the box and primitive tests use.

use crate::math::Ray;
use crate::simd::{BoxRay, ShearedLine};

/// A ray whose direction is scaled by a power of two so that its largest component lies in [1, 2). All parameters are
/// in units of this direction; the scaling is exact, so directions of any length behave alike.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    /// Origin.
    pub origin: [f32; 3],
    /// Scaled direction.
    pub direction: [f32; 3],
    /// Shear of the space in which triangles are seen along the ray (Woop, Benthin, Wald 2013, section 3.1, `Sx`, `Sy`).
    pub shear: [f32; 2],
    /// Parameters in the caller's units are ours times this power of two.
    pub unscale: f32,
}

impl PreparedRay {
    /// Never hits anything; fills unused slots.
    pub const NONE: PreparedRay =
        PreparedRay { origin: [0.0; 3], direction: [0.0; 3], shear: [0.0; 2], unscale: 1.0 };

    /// Prepares a ray in place, for geometry within `reach` of the coordinates' origin, and returns its bounds of the
    /// parameter; `None` where it can hit nothing: an empty range, a zero direction, or a component that is infinite or NaN.
    /// (In place, since copies in whole vectors would wait for the narrow stores before them.)
    #[inline(always)]
    pub fn set(&mut self, boxes: &mut BoxRay, ray: &Ray, reach: f32) -> Option<(f32, f32)> {
        let range = self.set_scaled(ray)?;
        boxes.set(self.origin, self.direction, reach);
        let [kx, ky, kz] = boxes.axes();
        let sz = boxes.inverse(kz);
        self.shear = [self.direction[kx] * sz, self.direction[ky] * sz];
        Some(range)
    }

    /// The same for a ray that is tested against no boxes, with its line.
    #[inline(always)]
    pub fn set_line(&mut self, ray: &Ray) -> Option<((f32, f32), ShearedLine)> {
        let range = self.set_scaled(ray)?;
        let line = ShearedLine::new(self.origin, self.direction);
        self.shear = line.shear;
        Some((range, line))
    }

    /// Sets all but the shear, and returns the bounds of the parameter.
    #[inline(always)]
    fn set_scaled(&mut self, ray: &Ray) -> Option<(f32, f32)> {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let largest = d[0].abs().max(d[1].abs()).max(d[2].abs());
        // Zero times anything but infinity and NaN is zero.
        let zero = (o[0] * 0.0 + o[1] * 0.0 + o[2] * 0.0) + (d[0] * 0.0 + d[1] * 0.0 + d[2] * 0.0);
        let t_min = if ray.t_min > 0.0 { ray.t_min } else { 0.0 };
        if !((zero == 0.0) & (largest > 0.0) & (t_min < ray.t_max)) {
            return None;
        }
        let (scale, unscale) = power_of_two_scale(largest);
        self.origin = o;
        self.direction = [d[0] * unscale, d[1] * unscale, d[2] * unscale];
        self.unscale = unscale;
        Some((t_min * scale, ray.t_max * scale))
    }
}

/// `(2^e, 2^-e)` for a positive `x` in [2^e, 2^(e+1)), with e kept where both are normal numbers.
#[inline(always)]
fn power_of_two_scale(x: f32) -> (f32, f32) {
    let e = ((x.to_bits() >> 23) as i32 - 127).clamp(-126, 126);
    (f32::from_bits(((127 + e) as u32) << 23), f32::from_bits(((127 - e) as u32) << 23))
}
